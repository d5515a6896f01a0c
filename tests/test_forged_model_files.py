"""Forged model files, their checksums right: each is refused within a second and little memory, and runs nothing."""

from __future__ import annotations

import ast
import io
import json
import pickle
import resource
import time
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import skops.io
from scipy import sparse
from sklearn.linear_model import Ridge

import skhybrid
from skhybrid import HybridPredictor
from skhybrid.exceptions import ModelFileError
from skhybrid.persistence import archive as archive_checks
from skhybrid.persistence import load_model, model_file, plain_objects, save_model
from skhybrid.persistence.archive import check_archive, deflated
from skhybrid.persistence.folding import fold, unfold

MIB = 2**20
HUGE = 10**12


def forge(path: Path, body: bytes) -> Path:
    version = model_file.__version__.encode()
    path.write_bytes(b"skhybrid-model version=%s sha256=%s\n" % (version, model_file._digest(version, body)) + body)
    return path


def refused(path: Path, body: bytes) -> str:
    """The message with which a forged file is refused; asserts that this took neither time nor memory."""
    forge(path, body)
    del body
    model_file.import_skops()
    assert HybridPredictor  # an import is no part of the reading
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
    if before[0] == resource.RLIM_INFINITY:
        resource.setrlimit(
            resource.RLIMIT_AS, (used + 2048 * MIB, before[1])
        )  # what is not refused must not stop the machine
    started = time.process_time()
    try:
        with pytest.raises(ModelFileError) as caught:
            load_model(path)
        elapsed = time.process_time() - started
        tracemalloc.start()
        with pytest.raises(ModelFileError):
            load_model(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        resource.setrlimit(resource.RLIMIT_AS, before)
    assert not isinstance(caught.value.__cause__, MemoryError)
    assert elapsed < 1.0
    assert peak < 64 * MIB
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def archive(members, compression=zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of (name or ZipInfo, content) pairs."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", compression) as file:
        for name, content in members:
            file.writestr(name, content)
    return made.getvalue()


def saved(value=None) -> dict[str, bytes]:
    """Members of the archive of a value as a file holds it, by default of an array by itself."""
    body = skops.io.dumps({"a": np.arange(3.0)} if value is None else fold(value))
    with zipfile.ZipFile(io.BytesIO(body)) as file:
        return {name: file.read(name) for name in file.namelist()}


def read(body: bytes) -> Any:
    """The data in an archive, read by skops after the check."""
    return skops.io.loads(check_archive(body))


def with_array(content: bytes) -> bytes:
    return archive((name, content if name.endswith(".npy") else old) for name, old in saved().items())


def npy(descr="<f8", shape="(3,)", data=bytes(24), version=1) -> bytes:
    text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY" + bytes([version, 0]) + len(text).to_bytes(2 if version == 1 else 4, "little") + text + data


def node(loader, kind, **more):
    module, _, name = kind.rpartition(".")
    return {"__class__": name, "__module__": module, "__loader__": loader, **more}


def schema(root) -> bytes:
    return json.dumps({**root, "protocol": 2, "_skops_version": "0.16.0"}, indent=2).encode()


def plain(value) -> dict:
    return node("JsonNode", "builtins.str", content=json.dumps(value), is_json=True)


# --------------------------------------------------------------------------------------------------------------- sizes
ARRAYS = {
    "8 TB": npy(shape=f"({HUGE},)"),
    "10**30": npy(shape=f"({10**30},)"),
    "2**64": npy(shape="(4294967296, 4294967296)"),
    "more than held": npy(shape="(100,)"),
    "less than none": npy(shape="(-3,)"),
    "10**12 of nothing": npy("<U0", f"({HUGE},)", b""),
    "one of 1 TB": npy(f"|V{HUGE}", "()", b""),
    "one of 1 GB": npy("|S999999999", "()", b""),
    "pickle": npy("|O", "(1,)", b"."),
    "fields": npy([("a", "<f8")]),
    "no such type": npy("<f3", "(1,)", b"123"),
    "version 2": npy(version=2),
    "version 3": npy(version=3),
    "cut data": npy()[:-1],
    "cut header": npy()[:40],
    "empty": b"",
    "brackets": b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535,
}


@pytest.mark.parametrize("name", ARRAYS)
def test_an_array_must_be_as_large_as_its_header_says(tmp_path, name):
    assert ".npy" in refused(tmp_path / "m", with_array(ARRAYS[name])) or name == "no such type"


def zeros(n_mib: int) -> bytes:
    """An archive with an array of zeros that is a thousandth of its size."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, old in saved().items():
            with file.open(name, "w", force_zip64=False) as entry:
                entry.write(npy(shape=f"({n_mib * MIB // 8},)", data=b"") if name.endswith(".npy") else old)
                for _ in range(n_mib * name.endswith(".npy")):
                    entry.write(bytes(MIB))
    return made.getvalue()


def test_a_bomb_is_refused(tmp_path):
    assert "it unpacks to" in refused(tmp_path / "m", zeros(200))


def test_a_bomb_that_declares_a_small_size_is_not_unpacked(tmp_path):
    body = bytearray(zeros(200))
    with zipfile.ZipFile(io.BytesIO(body)) as file:
        size = max(entry.file_size for entry in file.infolist()).to_bytes(4, "little")
    for place in (at for at in range(len(body)) if body[at : at + 4] == size):
        body[place : place + 4] = (152).to_bytes(4, "little")
    refused(tmp_path / "m", bytes(body))


def test_a_model_of_zeros_is_saved_and_loaded(tmp_path, monkeypatch):
    """Arrays that compress as a bomb does are stored as they are."""
    monkeypatch.setattr(archive_checks, "_SMALL", MIB)
    model = Ridge().fit([[0.0], [1.0]], [0.0, 1.0])
    model.held_ = np.zeros(MIB)
    save_model(model, tmp_path / "m")
    assert (tmp_path / "m").stat().st_size > 8 * model.held_.size
    assert load_model(tmp_path / "m").held_.sum() == 0.0


def test_entries_are_compressed_where_that_pays():
    """Noise is stored as it is, also where it begins with zeros; the contents stay."""
    noise = np.random.default_rng(0).normal(size=4000)
    noise[:500] = 0.0
    body = skops.io.dumps([np.zeros(4000), noise])
    with zipfile.ZipFile(io.BytesIO(body)) as before, zipfile.ZipFile(io.BytesIO(deflated(body))) as after:
        assert {name: before.read(name) for name in before.namelist()} == {n: after.read(n) for n in after.namelist()}
        arrays = [entry for entry in after.infolist() if entry.filename.endswith(".npy")]
    assert [entry.compress_type for entry in arrays] == [zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED]


@pytest.mark.parametrize(
    "text",
    [
        b'{"protocol": 2, "a": [' + b"[]," * (8 * MIB) + b"[]]}",
        b'{"protocol": 2, "a": "' + b"a" * (40 * MIB) + b'"}',
        b"[" * 100_000 + b"]" * 100_000,
        b'{"protocol": ' + b"9" * 5000 + b"}",
        b'{"protocol": true}',
        b"[]",
        b"\xff",
    ],
    ids=lambda text: text[:30],
)
def test_a_schema_that_unfolds_or_is_none_is_refused(tmp_path, text):
    refused(tmp_path / "m", archive([("schema.json", text)]))


@pytest.mark.parametrize("depth", [2000, 200_000])
def test_deep_nesting_is_refused(tmp_path, depth):
    one = b'{"__class__": "list", "__module__": "builtins", "__loader__": "ListNode", "protocol": 2, "content": ['
    refused(tmp_path / "m", archive([("schema.json", one * depth + b"]}" * depth)]))
    root = plain(0) | {"content": "[" * depth + "]" * depth}
    refused(tmp_path / "m", archive([("schema.json", schema(root))]))


def test_shared_nodes_do_not_unfold(tmp_path):
    """Forty lists, each twice in the next: 2**40 items, were a node named by its id more than once."""
    root = node("ListNode", "builtins.list", content=[plain(0)], __id__=1)
    for number in range(2, 42):
        again = node("ListNode", "builtins.list", content=[], __id__=number - 1)
        root = node("ListNode", "builtins.list", content=[root, again], __id__=number)
    assert len(read(archive([("schema.json", schema(root))]))) == 2
    cycle = node(
        "ListNode", "builtins.list", __id__=1, content=[node("ListNode", "builtins.list", content=[], __id__=1)]
    )
    assert read(archive([("schema.json", schema(cycle))])) == [[]]
    cached = node("ListNode", "builtins.list", __id__=1, content=[node("CachedNode", "builtins.list", __id__=1)])
    assert "CachedNode" in refused(tmp_path / "m", archive([("schema.json", schema(cached))]))


def test_an_array_in_three_thousand_places_is_read_once():
    members = saved()
    name = next(name for name in members if name.endswith(".npy"))
    members[name] = npy(shape=f"({MIB // 8},)", data=bytes(MIB))
    places = [node("NdArrayNode", "numpy.ndarray", type="numpy", file=name, __id__=n) for n in range(3_000)]
    members["schema.json"] = schema(node("ListNode", "builtins.list", content=places))
    body = archive(members.items())
    tracemalloc.start()
    back = read(body)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len({id(one) for one in back}) == 1
    assert peak < 128 * MIB


# ------------------------------------------------------------------------------------------------------------- entries
def _link(name: str) -> zipfile.ZipInfo:
    made = zipfile.ZipInfo(name)
    made.create_system, made.external_attr = 3, 0o120777 << 16
    return made


def _bad_members() -> dict[str, tuple[list, int]]:
    members = saved()
    array = next(name for name in members if name.endswith(".npy"))
    rest = [(name, old) for name, old in members.items() if name != array]
    kept = list(members.items())
    return {
        "twice": ([*kept, (array, npy())], zipfile.ZIP_STORED),
        "schema twice": ([*kept, ("schema.json", members["schema.json"])], zipfile.ZIP_STORED),
        "above": ([*kept, ("../1.npy", npy())], zipfile.ZIP_STORED),
        "absolute": ([*kept, ("/etc/1.npy", npy())], zipfile.ZIP_STORED),
        "folder": ([*kept, ("1/", b"")], zipfile.ZIP_STORED),
        "script": ([*kept, ("setup.py", b"1")], zipfile.ZIP_STORED),
        "unused": ([*kept, ("1.npy", npy())], zipfile.ZIP_STORED),
        "nested": ([*kept, ("1.npz", archive([("1.npy", npy())]))], zipfile.ZIP_STORED),
        "link": ([*rest, (_link(array), b"/etc/passwd")], zipfile.ZIP_STORED),
        "lzma": (kept, zipfile.ZIP_LZMA),
        "bzip2": (kept, zipfile.ZIP_BZIP2),
        "missing": (rest, zipfile.ZIP_STORED),
        "no schema": ([(array, npy())], zipfile.ZIP_STORED),
        "empty": ([], zipfile.ZIP_STORED),
    }


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", _bad_members())
def test_entries_that_save_model_does_not_write_are_refused(tmp_path, name):
    refused(tmp_path / "m", archive(*_bad_members()[name]))


def test_an_archive_that_is_cut_short_is_refused(tmp_path):
    body = archive(saved().items())
    for kept in (0, 1, 30, len(body) // 2, len(body) - 1):
        refused(tmp_path / "m", body[:kept])


# ---------------------------------------------------------------------------------------------------- nodes and objects
def _seeded(pool_size):
    made = saved({"a": np.random.default_rng(0)})
    made["schema.json"] = made["schema.json"].replace(b'"content": "4"', b'"content": "%d"' % pool_size)
    return made


def _keyed(kind, key):
    types = node("ListNode", "builtins.list", content=[node("TypeNode", kind)])
    return {"schema.json": schema(node("DictNode", "builtins.dict", key_types=types, content={key: plain(0)}))}


def _scalar(kind):
    made = saved()
    made["schema.json"] = made["schema.json"].replace(b'"ndarray"', b'"%s"' % kind)
    return {name: npy("<i8", "()", (10**9).to_bytes(8, "little")) if "npy" in name else v for name, v in made.items()}


NODES = {
    "seed of 4 TB": lambda: _seeded(HUGE),
    "void key": lambda: _keyed("numpy.void", "9"),
    "list key": lambda: _keyed("builtins.list", "999"),
    "void of 1 GB": lambda: _scalar(b"void"),
    "bytes of 1 GB": lambda: _scalar(b"bytes_"),
    "object": lambda: _scalar(b"object_"),
    "sparse matrix": lambda: saved({"a": sparse.csr_matrix(np.eye(3))}),
    "partial": lambda: {"schema.json": schema(node("PartialNode", "functools.partial", content={}))},
    "method": lambda: {"schema.json": schema(node("MethodNode", "builtins.list", content={}))},
    "operator": lambda: {"schema.json": schema(node("OperatorFuncNode", "operator.methodcaller", attrs=plain(1)))},
    "system": lambda: {"schema.json": schema(node("FunctionNode", "os.system"))},
    "no loader": lambda: {"schema.json": schema({"a": 1})},
    "no class": lambda: {"schema.json": schema({"__loader__": "DictNode"})},
    "old protocol": lambda: {"schema.json": schema(plain(1)).replace(b'"protocol": 2', b'"protocol": 1')},
}


@pytest.mark.parametrize("name", NODES)
def test_nodes_that_save_model_does_not_write_are_refused(tmp_path, name):
    refused(tmp_path / "m", archive(NODES[name]().items()))


def _text(text: bytes, values=(), **more):
    return {"text": np.frombuffer(text, np.uint8), "values": list(values), **more}


def test_a_text_with_its_values_is_read(tmp_path):
    given = {"a": [1, 2.5, "x", None, True], "b": np.arange(3.0), "c": {"d": np.float64(1.5)}}
    back = load_model(forge(tmp_path / "m", archive(saved({"model": given, "metadata": {}}).items())))
    assert back["a"] == given["a"]
    np.testing.assert_array_equal(back["b"], given["b"])
    assert type(back["c"]["d"]) is np.float64


def test_an_array_that_is_held_twice_is_held_once():
    array = np.arange(3.0)
    folded = fold({"a": array, "b": [array]})
    assert len(folded["values"]) == 1
    back = unfold(folded)
    assert back["a"] is back["b"][0]


TEXTS = {
    "no text": {"a": 1},
    "more": _text(b"1", more=1),
    "numbers": {"text": np.arange(3.0), "values": []},
    "values": {"text": np.frombuffer(b"1", np.uint8), "values": 1},
    "no JSON": _text(b"{"),
    "no value": _text(b'{"__skhybrid__": 1}', [np.ones(1)]),
    "a value from the end": _text(b'{"__skhybrid__": -1}', [np.ones(1)]),
    "lists": _text(b"[" + b"[]," * 2_000_000 + b"0]"),
    "depth": _text(b"[" * 100_000 + b"]" * 100_000),
    "length": _text(b'"' + b" " * 2**23 + b'"'),
    "digits": _text(b"9" * 1_000_000),
}


@pytest.mark.parametrize("name", TEXTS)
def test_texts_that_save_model_does_not_write_are_refused(tmp_path, name):
    body = skops.io.dumps(TEXTS[name])
    refused(tmp_path / "m", body)


def marked(mark, /, **parts):
    return {"__skhybrid__": mark, **parts}


LONG = marked("RangeIndex", start=0, stop=HUGE, step=1, name=None)
ROWS = marked("RangeIndex", start=0, stop=10**8, step=1, name=None)
OBJECTS = {
    "rows": LONG,
    "series of one number": marked("Series", values=1.0, index=ROWS, name=None),
    "series of rows": marked("Series", values=np.ones(1), index=ROWS, name=None),
    "frame of one number": marked("DataFrame", values=[1.0], index=ROWS, columns=np.array(["a"])),
    "tuple of rows": marked("sequence", kind="tuple", items=ROWS),
    "pairs of rows": marked("dict", pairs=ROWS),
    "tuples of rows": marked("MultiIndex", tuples=ROWS, names=["a"]),
    "objects of rows": marked("objects", shape=[1], items=ROWS),
    "shape of objects": marked("objects", shape=[10**30], items=[1]),
    "shape of nothing": marked("objects", shape=[0, 10**30], items=[]),
    "stamp": marked("Timestamp", ns=10**40, tz=None),
    "zone": marked("Timestamp", ns=0, tz="../../etc/passwd"),
    "frequency": marked("DatetimeIndex", ns=np.arange(3), unit="ns", tz=None, freq="1D", name=None),
    "stamps of rows": marked("DatetimeIndex", ns=ROWS, unit="ns", tz=None, freq=None, name=None),
    "half of rows": marked("symmetric", half=ROWS),
    "half of too few": marked("symmetric", half=np.ones(4)),
    "planes of rows": marked("planes", planes=ROWS, shape=[1]),
    "planes of another shape": marked("planes", planes=np.zeros((8, 3), dtype=np.uint8), shape=[10**9]),
    "kind": marked("exec"),
    "list as kind": marked([1]),
    "one field": marked("tuple", type="skhybrid.thermal.declaration:Source", items=[1]),
    "class as tuple": marked("tuple", type="skhybrid.thermal.network:RCNetwork", items=[1]),
    "tuple as object": marked("object", type="skhybrid.thermal.declaration:Source", state={}),
}


@pytest.mark.parametrize("name", OBJECTS)
def test_objects_that_save_model_does_not_write_are_refused(tmp_path, name):
    refused(tmp_path / "m", archive(saved(OBJECTS[name]).items()))


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return Path.touch, (self.trace,)


def test_nothing_in_a_file_is_run(tmp_path):
    trace, objects = tmp_path / "it ran", np.empty(1, dtype=object)
    objects[0] = Bomb(trace)
    array, payload = io.BytesIO(), pickle.dumps(Bomb(trace))
    np.save(array, objects, allow_pickle=True)
    (tmp_path / "bare").write_bytes(payload)
    with pytest.raises(ModelFileError):
        load_model(tmp_path / "bare")
    assert "types that are not allowed" in refused(tmp_path / "m", skops.io.dumps({"a": Bomb(trace)}))
    for body in (payload, with_array(array.getvalue())):
        refused(tmp_path / "m", body)
    assert not trace.exists()
    pickle.loads(payload)
    assert trace.exists()  # the payload does run if it is unpickled


@pytest.mark.parametrize("kind", ["object", "type"])
@pytest.mark.parametrize(
    "name",
    [
        "skhybrid.parallel.shared:Shared",
        "skhybrid.model_selection.search.store:ResultStore",
        "skhybrid.parallel.workers:Workers",
        "skhybrid.model_selection.search.runner:Runner",
        "skhybrid.forecasting.networks.modules:MLPStack",
        "skhybrid.persistence.skops_import:_TorchIsAbsent",
        "skhybrid.cli._output:Progress",
        "skhybrid.study.run:StudyResult",
        "skhybrid.exceptions:ModelFileError",
        "skhybrid.thermal.network:RCNetwork.__init__",
        "skhybrid.thermal..network:RCNetwork",
        "skhybrid.thermal.network:",
        "subprocess:Popen",
        "skhybrid.persistence:load_model",
        "skhybrid:x",
        "skhybrid.no:A",
    ],
)
def test_only_classes_that_hold_data_may_be_named(tmp_path, kind, name):
    forged = marked(kind, type=name, state={"_packed": np.zeros(1, dtype=np.uint8), "_key": "k"})
    refused(tmp_path / "m", archive(saved(forged).items()))


def test_no_module_whose_classes_may_be_named_unpickles_or_opens_a_process():
    package = Path(skhybrid.__file__).parent
    risky = {"pickle", "cloudpickle", "dill", "shelve", "marshal", "subprocess", "runpy", "socket", "sqlite3"}
    checked = 0
    for path in sorted(package.rglob("*.py")):
        module = ".".join(["skhybrid", *path.relative_to(package).with_suffix("").parts]).removesuffix(".__init__")
        if not plain_objects._HOLDERS.fullmatch(module):
            continue
        checked += 1
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        loaded = {alias.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for alias in n.names}
        loaded |= {(n.module or "").split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and not n.level}
        calls = [n.func for n in nodes if isinstance(n, ast.Call)]
        called = {getattr(n, "id", f".{getattr(n, 'attr', '')}") for n in calls}
        assert not loaded & risky, path
        assert not called & {"eval", "exec", "compile", "__import__", ".load", ".loads", ".system"}, path
    assert checked > 50


# ------------------------------------------------------------------------------------------------------ what is no file
def test_what_is_not_a_file_is_refused(tmp_path):
    with pytest.raises(ModelFileError, match=r"is not a file; give the path of a model file"):
        load_model(tmp_path)
    with pytest.raises(ModelFileError, match=r"is not a file"):
        load_model("/dev/zero")
    with open(tmp_path / "big", "wb") as file:
        file.truncate(8 * HUGE)
    started = time.process_time()
    with pytest.raises(ModelFileError, match="not a skhybrid model file"):
        load_model(tmp_path / "big")
    assert time.process_time() - started < 0.1


def test_a_wrong_number_loads_and_runs_nothing(tmp_path):
    """A checksum tells of accidents; numbers that a stranger wrote are read as they are."""
    model = Ridge().fit([[0.0], [1.0]], [0.0, 1.0])
    model.coef_ = np.full(1, np.nan)
    save_model(model, tmp_path / "m")
    assert np.isnan(load_model(tmp_path / "m").coef_).all()


def test_what_could_not_be_read_again_is_not_saved(tmp_path):
    model = Ridge().fit([[0.0], [1.0]], [0.0, 1.0])
    (tmp_path / "m").write_text("old", encoding="utf-8")
    try:
        model.held_ = pd.DatetimeIndex(["2024-01-01"], tz="dateutil/Europe/Amsterdam")
    except AttributeError:
        pytest.skip("this version of pandas does not find time zones of dateutil")
    with pytest.raises(ValueError, match=r"the time zone tzfile.* cannot be saved"):
        save_model(model, tmp_path / "m")
    assert (tmp_path / "m").read_text(encoding="utf-8") == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_refusal_does_not_quote_the_file(tmp_path):
    """A name in a member's own header that is longer than that of the directory, and holds the data."""
    body = bytearray(archive([("schema.json", bytes(range(256)) * 40)], zipfile.ZIP_STORED))
    body[26:28] = (8000).to_bytes(2, "little")
    message = refused(tmp_path / "long.skops", bytes(body))
    assert "cannot be read as a model" in message
    assert len(message) < 300 + len(str(tmp_path))
