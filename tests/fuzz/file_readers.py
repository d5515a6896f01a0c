"""Mutants of logs, TOML settings, model files and stores, and what becomes of reading them."""

from __future__ import annotations

import hashlib
import io
import json
import random
import re
import sqlite3
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from estimators import NETWORKS, fitted
from outcomes import Outcome, observe, wrong_numbers
from zone_tables import training

from skhybrid.datasets import read_epw, read_weather, read_zone_csv, regularize
from skhybrid.logs import read_log as read_any_log
from skhybrid.logs.readers import ecobee, epa_thermostat, home_assistant, influx
from skhybrid.model_selection.search.store import Result, ResultStore, Task
from skhybrid.persistence import load_model, save_model
from skhybrid.study import make_models, propose_settings, read_log, read_settings, split_log

_NUMBERS = ["0", "-1", "1e999", "-9999", "9.97e36", "NaN", "1_000", "0x10", "10" * 30, "1e-320", "1,5", "٣", "true"]
_STAMPS = ["2024-03-31 02:30", "31/02/2024", "24:00", "9999-12-31", "0001-01-01", "2024-10-27T02:30+02:00", "+25:00"]
_MARKS = [*",;\n\r\"'\t#=[]{}\\\x00é\ufeff", "\\u0000", "..."]
_TOML = ["'''", "[[columns]]", "inf", "nan", "1979-05-27T07:32:00Z", "[1, 2]", "{ a = 1 }", '"1ns"', '"P1D"', "-0"]
_JSON = ["null", "[]", "{}", '"x"', "1e400", '"__class__"', '"__module__"', '"os"', '"system"', '"__skhybrid__"']
TOKENS = [t.encode() for t in (*_NUMBERS, *_STAMPS, *_MARKS, *_TOML, *_JSON)]
TOKENS += [b"\xff\xfe", b"\x93NUMPY", b"PK\x03\x04"]


def mutate(content: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """One to six changes of bytes, tokens, lines or pieces."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        content = rng.choice(_MUTATIONS)(bytearray(content), rng, others)
    return content


def _place(b: bytearray, rng: random.Random) -> tuple[int, int]:
    i = rng.randrange(len(b) + 1)
    return i, min(len(b), i + rng.choice((1, 1, 2, 4, 8, 32, 256)))


def _flip(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    if b:
        b[rng.randrange(len(b))] ^= 1 << rng.randrange(8)
    return bytes(b)


def _delete(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    i, j = _place(b, rng)
    return bytes(b[:i] + b[j:])


def _repeat(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    i, j = _place(b, rng)
    return bytes(b[:i] + b[i:j] * rng.choice((2, 3, 40)) + b[j:])


def _insert(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    i, j = _place(b, rng)
    return bytes(b[:i] + rng.choice(TOKENS) + b[rng.choice((i, j)) :])


def _replace_word(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    words = list(re.finditer(rb"[\w.+:-]+", b))
    if not words:
        return bytes(b)
    one, other = rng.choice(words), rng.choice(words)
    return bytes(b[: one.start()] + rng.choice((*rng.sample(TOKENS, 3), other[0])) + b[one.end() :])


def _lines(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    lines = bytes(b).split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = rng.choice(((lines[j], lines[i]), (b"", lines[j]), (lines[j], lines[j])))
    return b"\n".join(lines)


def _splice(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    other = rng.choice(others)
    return bytes(b[: rng.randrange(len(b) + 1)]) + other[rng.randrange(len(other) + 1) :]


def _cut(b: bytearray, rng: random.Random, others: list[bytes]) -> bytes:
    return bytes(b[: rng.randrange(len(b) + 1)])


_MUTATIONS = (_flip, _delete, _repeat, _insert, _insert, _replace_word, _replace_word, _lines, _splice, _cut)


# -------------------------------------------------------------------------------------------------------- CSV and TOML
@cache
def _logs() -> list[bytes]:
    X = training().X.rename_axis("time")
    naive = X.tz_localize(None)
    day = naive.iloc[:60]
    texts = [
        X.to_csv(),
        naive.iloc[:120].to_csv(),
        day.to_csv(sep=";", decimal=","),
        day.set_axis(day.index.strftime("%d/%m/%Y %H:%M")).rename_axis("Date").to_csv(),
        X.tz_convert("UTC").iloc[100:200, [0, 4]].to_csv(date_format="%Y-%m-%dT%H:%M:%SZ"),
        day.rename(columns={"T_za": "room temp [degF]", "T_oa": "outdoor", "q_sol": "GHI"}).to_csv(),
        "\ufeff" + day.iloc[::-1].to_csv(na_rep="", quoting=1),
    ]
    return [text.encode() for text in texts]


@cache
def _weather() -> bytes:
    head = "LOCATION,Amsterdam,-,NLD,IWEC,062400,52.30,4.77,1.0,-2.0\n" + "COMMENTS\n" * 7
    rest = "60,A7," + ",".join(["5.1"] * 29)
    hours = pd.date_range("2001-01-01", periods=8760, freq="h")
    return (head + "".join(f"2001,{t.month},{t.day},{t.hour + 1},{rest}\n" for t in hours)).encode()


_READ = (
    {}, {"timezone": "Europe/Amsterdam"}, {"label": "right"}, {"units": {"T_oa": "degF"}}, {"dayfirst": True},
    {"columns": {"T_za": "T_za", "T_oa": "T_oa"}}, {"sep": ";", "decimal": ","}, {"time_column": "time"},
)  # fmt: skip

_READ_LOG = ({}, {"timezone": "Europe/Amsterdam"}, {"dayfirst": True}, {"format": "CSV"}, {"format": "change of value"})


def _finite(result: Any, warned: bool) -> str | None:
    return wrong_numbers(result, missing=True)


def csv(content: bytes, choice: int, folder: Path) -> Outcome:
    """Read a log (or a weather file) and make its step even."""
    path = folder / "log.csv"
    path.write_bytes(content)
    if content.startswith(b"LOCATION"):
        return observe(lambda: read_epw(path), _finite)
    if choice % 4 == 0:
        return observe(lambda: propose_settings(path), lambda text, warned: None if text else "no proposal")

    if choice % 4 == 1:
        return observe(lambda: read_any_log(path, **_READ_LOG[choice // 4 % len(_READ_LOG)]).frame, _finite)

    def read() -> Any:
        frame = read_zone_csv(path, **_READ[choice % len(_READ)])
        return regularize(frame.replace([np.inf, -np.inf], np.nan), "1h") if len(frame) < 2000 else frame

    return observe(read, _finite)


_TOMLS = (
    b"""timezone = "Europe/Amsterdam"
label = "left"
step = "1h"
horizon = "1D"
origin_step = "6h"
random_state = 0
[columns]
T_za = "T_za"
T_oa = "T_oa"
q_sol = "q_sol"
u_heat = "u_heat"
[units]
T_oa = "degC"
[scale]
u_heat = 0.5
[network]
name = "2R2C"
[estimator]
name = "input"
known = { Q_h = 6.0 }
bounds = { R_zo = [0.1, 40] }
n_starts = 1
[forecaster]
model = "ridge"
[train]
start = 2024-10-17
end = 2024-10-21
[test]
start = "2024-10-22"
end = "2024-10-24"
[load]
setpoint = 21.0
[site]
latitude = 52.4
longitude = 4.9
""",
    b"""step = "1h"
[columns]
T_za = "T_za"
T_oa = "T_oa"
[network]
capacitances = { za = "C_za", w = "C_w" }
resistors = { R_zw = ["za", "w"], R_wo = ["w", "T_oa"] }
solar = { za = "rest" }
measured = "za"
""",
)


@cache
def _settings(folder: Path) -> list[bytes]:
    log = folder / "good.csv"
    log.write_bytes(_logs()[0])
    return [propose_settings(log).encode(), *_TOMLS]


def toml(content: bytes, choice: int, folder: Path) -> Outcome:
    """Read settings, make the models, and read and split a good log with them."""
    path, log = folder / "zone.toml", folder / "good.csv"
    path.write_bytes(content)

    def read() -> Any:
        settings = read_settings(path)
        make_models(settings)
        frame, _ = read_log(log, settings)
        return split_log(frame, settings).train

    return observe(read, _finite)


# --------------------------------------------------------------------------------------------------------- model files
@cache
def _models(folder: Path) -> list[bytes]:
    path = folder / "good.skops"
    made = []
    names = ("InputDisturbanceID", "ARXRegressor", "DisturbanceForecaster, ridge", "Pipeline", "HybridPredictor")
    for name in (*names, NETWORKS[0]):
        save_model(fitted(name), path)
        made.append(path.read_bytes())
    return made


def _forged(content: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """A model file with one member changed and the checksum made right again, or simply other bytes."""
    head, _, body = content.partition(b"\n")
    if rng.random() < 0.1:
        return mutate(content, rng, others)
    body = mutate(body, rng, others) if rng.random() < 0.2 else _other_member(body, rng)
    version = re.search(rb"version=(\S+)", head)
    digest = hashlib.sha256((version[1] if version else b"") + b"\n" + body).hexdigest().encode()
    return re.sub(rb"sha256=[0-9a-f]*", b"sha256=" + digest, head) + b"\n" + body


def _other_member(body: bytes, rng: random.Random) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(body)) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        spoilt = rng.choice([n for n in names if n.endswith("json")] if rng.random() < 0.7 else names)
        for name in names:
            content = old.read(name)
            if name == spoilt:
                content = _other_json(content, rng) if name.endswith("json") and rng.random() < 0.7 else content
                content = mutate(content, rng, [content]) if rng.random() < 0.5 else content
                name = rng.choice((name, name, name, name, "../" + name, name + "x"))
            new.writestr(name, content)
        if rng.random() < 0.1:
            new.writestr(rng.choice(("more.npy", "schema.json", "/etc/x", "a" * 300)), b"x" * rng.choice((0, 9, 10**6)))
    return made.getvalue()


def _other_json(content: bytes, rng: random.Random) -> bytes:
    """One value of the description replaced by another one of it or by a token."""
    tree = json.loads(content)
    places: list[tuple[Any, Any]] = []

    def collect(node: Any) -> None:
        for key in node if isinstance(node, dict) else range(len(node)):
            places.append((node, key))
            if isinstance(node[key], dict | list):
                collect(node[key])

    collect(tree)
    (one, key), (other, there) = rng.choice(places), rng.choice(places)
    value = rng.choice((other[there], None, [], {}, "os", "system", "posix", -1, 10**30, 1e308, "builtins", True, "x"))
    one[key] = json.loads(json.dumps(value))
    return json.dumps(tree).encode()


def model(content: bytes, choice: int, folder: Path) -> Outcome:
    """Load a model file; it is refused within a second or read."""
    path = folder / "m.skops"
    path.write_bytes(content)
    return observe(lambda: load_model(path), lambda result, warned: None, seconds=10.0)


# --------------------------------------------------------------------------------------------------------------- store
_SETTING = {"data": "a", "version of numpy": np.__version__}
_DONE, _FAILED = Result({"rmse": 1.0}, 1.0, 0.1, 0.1, 3, None), Result({}, np.nan, 0.1, 0.1, None, "Error")
_TASKS = {Task("a", 0): _DONE, Task("b", 0): _FAILED}
_SQL = (
    "UPDATE result SET scores = {x}", "UPDATE result SET rmse = {x}", "UPDATE result SET split = {x}",
    "UPDATE setting SET value = {x}", "UPDATE setting SET name = {x}", "UPDATE owner SET pid = {x}, host = {x}",
    "INSERT INTO owner VALUES ({x}, {x}, {x}, {x})", "INSERT INTO claim VALUES ({x}, {x}, {x})", "DROP TABLE result",
    "ALTER TABLE result RENAME COLUMN rmse TO r", "CREATE VIEW v AS SELECT 1", "DELETE FROM setting",
    "DROP TABLE owner",
    "CREATE TRIGGER t AFTER INSERT ON claim BEGIN DELETE FROM result; END", "PRAGMA user_version = 7", "VACUUM",
    "UPDATE result SET fit_time = {x}, error = {x}", "UPDATE result SET n_epochs = {x}",
)  # fmt: skip
_VALUES = ("'x'", "NULL", "x'00ff'", "1e999", "-1", "''", "'[]'", '\'{"a": "b"}\'', "'NaN'", "'2'", "99999999999")


@cache
def _stores(folder: Path) -> list[bytes]:
    path = folder / "good.sqlite"
    path.unlink(missing_ok=True)
    with ResultStore(path, _SETTING) as store:
        store.describe({"a": "A()", "b": "B()"})
        store.claim([*_TASKS, Task("c", 1)])
        store.finish(_TASKS)
    return [path.read_bytes()]


def _other_store(content: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """A store with other values or tables, or with other bytes."""
    if rng.random() < 0.5:
        return mutate(content, rng, others)
    db = sqlite3.connect(":memory:")
    db.deserialize(content[:18] + b"\x01\x01" + content[20:])  # without the write-ahead log, which memory has not
    for _ in range(rng.choice((1, 1, 2))):
        try:
            db.execute(rng.choice(_SQL).format(x=rng.choice(_VALUES)))
            db.commit()
        except sqlite3.Error:
            db.rollback()
    made = db.serialize()
    db.close()
    return made


def store(content: bytes, choice: int, folder: Path) -> Outcome:
    """Open a store, read it, claim and finish a task, and close it."""
    path = folder / "s.sqlite"
    for old in folder.glob("s.sqlite*"):
        old.unlink()
    path.write_bytes(content)

    def use() -> Any:
        with ResultStore(path, _SETTING) as opened:
            opened.results()
            claimed = opened.claim([*_TASKS, Task("d", 0)])
            opened.finish({task: _TASKS[Task("a", 0)] for task in claimed})
            if choice % 3 == 0:
                opened.forget_failed()
            found = opened.results()
            return [r.rmse for r in found.values()], claimed

    return observe(use, lambda result, warned: None)


# ------------------------------------------------------------------------------------------- logs of other formats
_FORMATS = (ecobee, epa_thermostat, home_assistant, influx)
_SAMPLES = Path(__file__).parents[1] / "log_samples"
_RECORDER = """
CREATE TABLE states (state_id INTEGER, entity_id VARCHAR(255), state TEXT, attributes TEXT, last_updated DATETIME);
INSERT INTO states VALUES (1, 'sensor.room', '20.5', '{"unit_of_measurement": "C"}', '2024-01-01 00:00:00.000000');
INSERT INTO states VALUES (2, 'sensor.room', '21.5', '{}', '2024-01-01 01:00:00.000000');
INSERT INTO states VALUES (3, 'climate.room', 'heat', '{"hvac_action": "idle", "temperature": 20}', '2024-01-01');
"""


@cache
def _samples() -> list[bytes]:
    db = sqlite3.connect(":memory:")
    db.executescript(_RECORDER)
    names = ("ecobee_portal.csv", "donate_your_data.csv", "epa_interval.csv", "home_assistant_history.csv")
    files = [(_SAMPLES / name).read_bytes() for name in (*names, "influx_annotated.csv", "open_meteo.json")]
    return [*files, db.serialize()]


def logs(content: bytes, choice: int, folder: Path) -> Outcome:
    """Read a log with the reader that claims it, or with any of them; or the weather of a forecast."""
    path = folder / ("weather.json" if content.startswith(b'{"latitude"') else "log.csv")
    path.write_bytes(content)
    if path.suffix == ".json":
        return observe(lambda: read_weather(path, window_azimuth=(None, 180.0)[choice % 2]), _finite)
    head = content[:8000].decode("utf-8", "replace")

    def read() -> Any:
        claims = [format for format in _FORMATS if format.looks_like(path, head)]
        return (claims or [_FORMATS[choice % len(_FORMATS)]])[0].read(path).frame

    return observe(read, _finite)


class Reader(NamedTuple):
    """A reader, the good files that mutants are made of, and how they are made."""

    seeds: Callable[[Path], list[bytes]]
    mutate: Callable[[bytes, random.Random, list[bytes]], bytes]
    read: Callable[[bytes, int, Path], Outcome]


READERS = {
    "logs": Reader(lambda folder: _samples(), mutate, logs),
    "csv": Reader(lambda folder: [*_logs() * 3, _weather()], mutate, csv),
    "toml": Reader(_settings, mutate, toml),
    "model": Reader(_models, _forged, model),
    "store": Reader(_stores, _other_store, store),
}


def mutant(name: str, number: int, folder: Path) -> tuple[bytes, int]:
    """The mutant of a number, and which arguments it is read with; the same for the same number."""
    rng = random.Random(f"{name} {number}")
    seeds = READERS[name].seeds(folder)
    return READERS[name].mutate(rng.choice(seeds), rng, seeds), rng.randrange(1000)


def smallest(name: str, content: bytes, choice: int, folder: Path) -> bytes:
    """The same failure in fewer bytes, for files of text."""
    read = READERS[name].read
    kind, size = read(content, choice, folder).kind, len(content) // 2
    while size >= 1 and name in ("csv", "toml") and len(content) < 20_000:
        i = 0
        while i < len(content):
            less = content[:i] + content[i + size :]
            if read(less, choice, folder).kind == kind:
                content = less
            else:
                i += size
        size //= 4
    return content


def good_files_are_read(folder: Path) -> dict[str, Outcome]:
    """Outcomes of the good files, by reader and number."""
    return {
        f"{name} {i}": reader.read(seed, 1, folder)
        for name, reader in READERS.items()
        for i, seed in enumerate(dict.fromkeys(reader.seeds(folder)))
    }
