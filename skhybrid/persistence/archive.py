"""Checks of the archive in a model file: names, sizes and kinds of node, before anything in it is built."""

from __future__ import annotations

import io
import json
import math
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

MOST_BYTES = 2**30  # of an archive
_SMALL, _RATIO = 2**26, 10  # an archive may unpack to 64 MiB, or to ten times its own size
_PROBED, _WORTHWHILE = 4096, 0.9  # bytes of an entry that are compressed to see whether it shrinks to so much
_SCHEMA = "schema.json"
_MOST_SCHEMA, _MOST_NODES = 2**25, 200_000
_SCHEMA_DENSITY = 20  # at least so many bytes per bracket or comma; a node of skops has 30
_NAME = re.compile(r"\d{1,20}\.npy|[0-9a-f-]{36}\.bin")
#: numpy's own header of an array of plain values: bool, integers, floats, complex numbers, stamps, durations, text
_NPY = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '([<>|=][biufcmMSU]\d{0,9}(?:\[\w{1,9}\])?)', 'fortran_order': (?:True|False), "
    rb"'shape': \(((?:\d{1,18},? ?){0,64})\), \} *\n",
    re.DOTALL,
)
#: nodes of skops that hold data, construct nothing but trusted types, and open no further archive
_LOADERS = {
    "BytesNode", "DictNode", "FunctionNode", "JsonNode", "ListNode", "LossNode", "NdArrayNode", "ObjectNode",
    "RandomGeneratorNode", "RandomStateNode", "SetNode", "SliceNode", "TupleNode", "TypeNode",
}  # fmt: skip
_POOL_SIZE = "4"  # of every seed sequence; NumPy allocates what a file says


def deflated(body: bytes) -> bytes:
    """An archive whose entries are compressed, but for those of noise, which take long and hardly shrink."""
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(body)) as stored, zipfile.ZipFile(packed, "w") as archive:
        for name in stored.namelist():
            data = stored.read(name)
            middle = data[len(data) // 2 :][:_PROBED]
            pays = len(zlib.compress(middle, 1)) < _WORTHWHILE * len(middle)
            archive.writestr(name, data, zipfile.ZIP_DEFLATED if pays else zipfile.ZIP_STORED)
    return packed.getvalue()


def unpacks_too_large(body: bytes) -> bool:
    """Whether an archive unpacks to more than a model file may; one that is not compressed never does."""
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        return _unpacked(archive) > _most_unpacked(body)


def check_archive(body: bytes) -> bytes:
    """Read an archive of skops, refuse with ValueError what no saved model contains, and pack the rest anew."""
    if len(body) > MOST_BYTES:
        raise ValueError(f"it takes {len(body):,} bytes, and at most {MOST_BYTES:,} are read")
    members = _members(body)
    schema = json.loads(members[_SCHEMA])
    if schema["protocol"] < 2:
        raise ValueError("it was written by a skops that is too old")
    arrays = {name: _array_type(name, data) for name, data in members.items() if name.endswith(".npy")}
    used: dict[str, int] = {}
    for number, node in enumerate(_nodes(schema)):
        if number >= _MOST_NODES:
            raise ValueError(f"it has more than {_MOST_NODES:,} parts")
        _check_node(node, members, arrays, used)
    extra = sorted(members.keys() - used.keys() - {_SCHEMA})
    if extra:
        raise ValueError(f"its entry {extra[0]} belongs to no part of the model")
    members[_SCHEMA] = json.dumps(schema).encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return packed.getvalue()


def _unpacked(archive: zipfile.ZipFile) -> int:
    return sum(entry.file_size for entry in archive.infolist())


def _most_unpacked(body: bytes) -> int:
    return max(_SMALL, _RATIO * len(body))


def _members(body: bytes) -> dict[str, bytes]:
    """Contents by name; no entry is read beyond the size that it declares."""
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        entries = archive.infolist()
        if _unpacked(archive) > _most_unpacked(body):
            raise ValueError(f"it unpacks to {_unpacked(archive):,} bytes, more than {_most_unpacked(body):,}")
        names = [entry.filename for entry in entries]
        if len(set(names)) < len(names):
            raise ValueError("two of its entries have the same name")
        for entry in entries:
            _check_entry(entry)
        # a read without a size would unpack what the entry holds, not what it declares
        members = {entry.filename: archive.open(entry).read(entry.file_size + 1) for entry in entries}
    if any(len(members[entry.filename]) != entry.file_size for entry in entries):
        raise ValueError("one of its entries is shorter than it declares")
    marks = sum(members[_SCHEMA].count(mark) for mark in (b"{", b"[", b","))
    if marks > len(members[_SCHEMA]) / _SCHEMA_DENSITY:
        raise ValueError(f"its {_SCHEMA} was not written by save_model")
    return members


def _check_entry(entry: zipfile.ZipInfo) -> None:
    if entry.filename != _SCHEMA and not _NAME.fullmatch(entry.filename):
        raise ValueError(f"its entry {entry.filename[:60]!r} is not one that save_model writes")
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG) or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"its entry {entry.filename} is not a plain file")
    if entry.filename == _SCHEMA and entry.file_size > _MOST_SCHEMA:
        raise ValueError(f"its {_SCHEMA} has {entry.file_size:,} bytes, and at most {_MOST_SCHEMA:,} are read")


def _array_type(name: str, data: bytes) -> tuple[type, bool]:
    """Type of the elements of an .npy entry, and whether it is one value; its size must be what its header says."""
    header = _NPY.match(data)
    if header is None:
        raise ValueError(f"{name} is not an array of numbers, text or stamps")
    dtype = np.dtype(header[1].decode())
    shape = [int(n) for n in header[2].replace(b" ", b"").split(b",") if n]
    held, count = len(data) - header.end(), math.prod(shape)
    if count * dtype.itemsize != held or count > max(held, 1):
        raise ValueError(f"{name} declares {shape} elements of {dtype.itemsize} bytes, and holds {held:,} bytes")
    return dtype.type, not shape


def _nodes(schema: Any) -> Iterator[dict[str, Any]]:
    """All nodes of skops, at any depth."""
    stack = [schema]
    while stack:
        value = stack.pop()
        if isinstance(value, dict):
            stack.extend(value.values())
            if isinstance(value.get("__loader__"), str):
                yield value
        elif isinstance(value, list):
            stack.extend(value)


def _check_node(
    node: dict[str, Any], members: dict[str, bytes], arrays: dict[str, tuple[type, bool]], used: dict[str, int]
) -> None:
    """Check a node, and let it share its object only if that is an entry: shared nodes unfold without a limit."""
    loader, kind = node["__loader__"], f"{node['__module__']}.{node['__class__']}"
    node.pop("__id__", None)
    if loader not in _LOADERS:
        raise ValueError(f"it contains types that are not allowed in a model file: {kind} ({loader})")
    if loader in ("NdArrayNode", "BytesNode"):
        name = node["file"]
        if name not in members:
            raise ValueError(f"its entry {name!r} is missing")
        node["__id__"] = used.setdefault(name, len(used) + 1)
    if loader == "NdArrayNode":
        element, is_scalar = arrays[node["file"]]
        scalar = is_scalar and kind == f"numpy.{element.__name__}"
        if node["type"] != "numpy" or not (scalar or kind == "numpy.ndarray"):
            raise ValueError(f"{node['file']} is not an array")
    elif loader == "DictNode":
        if kind != "builtins.dict" or any(key["__class__"] != "str" for key in node["key_types"]["content"]):
            raise ValueError("the keys of a dictionary are not text")
    elif loader == "RandomGeneratorNode":
        seed = node["content"]["seed_seq"]["content"]
        if seed["pool_size"]["content"] != _POOL_SIZE:
            raise ValueError("the seed of a random generator has another size than NumPy's")
