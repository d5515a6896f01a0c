"""Reader of InfluxDB's annotated CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..raw_log import RawLog
from ..stamps import time_zone_named
from ..text_files import damage_refused, open_text
from ..unit_names import unit_or_energy
from .entity_states import MOST_CELLS, ON_OFF, some_of
from .known_table import to_numbers, utc_ticks

_ANNOTATIONS = ("#datatype", "#group", "#default")
_NUMBERS = ("double", "long", "unsignedLong", "boolean")
_RESERVED = ("", "result", "table", "_start", "_stop", "_time", "_value", "_field", "_measurement")
_PIECE = 100_000  # rows of a table that are held as text
_Series = dict[str, list[tuple[np.ndarray, np.ndarray]]]


def looks_like(path: Path, head: str) -> bool:
    """Whether the beginning of a file has InfluxDB's annotations."""
    return any(line.startswith(_ANNOTATIONS) for line in head.splitlines()[:4])


class _Header(NamedTuple):
    """Columns of one table."""

    names: list[str]
    types: list[str]
    defaults: list[str]


def read(path: Path, timezone: str | None = None) -> RawLog:
    """Read the tables of an annotated CSV, with ``_field`` and ``_value`` or pivoted with a column per field.

    A channel is a field and set of tags: ``"<measurement> <field> <tag>=<value> ..."``.  InfluxDB writes UTC.
    """
    where = repr(path.name)
    series: _Series = {}
    text: set[str] = set()
    for header, rows, line in _tables(path, where):
        _add_rows(series, text, header, rows, line, where)
    found = {name: joined for name, parts in series.items() if len(joined := _joined(parts))}
    if not found:
        raise ValueError(f"{where} has no numbers{f', only the text of {some_of(text)}' if text else ''}.")
    stamps = pd.Index(np.unique(np.concatenate([s.index for s in found.values()])))
    if len(stamps) * len(found) > MOST_CELLS:
        raise ValueError(
            f"{where} makes {len(stamps)} rows of {len(found)} channels, too many to hold; query fewer fields, or "
            "means per interval (aggregateWindow)."
        )
    frame = pd.DataFrame({name: s.reindex(stamps).to_numpy() for name, s in found.items()})
    index = pd.DatetimeIndex(pd.to_datetime(stamps.to_numpy(), utc=True), name="time")
    frame.index = index if timezone is None else index.tz_convert(time_zone_named(timezone))
    notes = ["the stamps of aggregateWindow end their window unless it was told timeSrc: '_start'."]
    if text - set(found):
        notes.append(f"left out, because they hold text: {some_of(text - set(found))}.")
    units = {name: unit for name in found if (unit := unit_or_energy(name.split(" ")[0]))}
    return RawLog(frame, "InfluxDB annotated CSV", units, notes=tuple(notes), first=index[0])


def _tables(file: Path, where: str) -> Iterator[tuple[_Header, list[list[str]], int]]:
    """Rows of each table in pieces, with its header and the line of the first one."""
    annotations: dict[str, list[str]] = {}
    header: _Header | None = None
    rows: list[list[str]] = []
    try:
        with damage_refused(where), open_text(file) as stream:
            reader = csv.reader(stream)
            for row in reader:
                if not any(row) or row[0].startswith("#") or len(rows) >= _PIECE:
                    if header is not None and rows:
                        yield header, rows, reader.line_num - len(rows)
                    rows = []
                    if not any(row):
                        continue
                    if row[0].startswith("#"):
                        annotations, header = {**(annotations if header is None else {}), row[0]: row}, None
                        continue
                if header is None:
                    header = _header(row, annotations, where, reader.line_num)
                    continue
                if len(row) != len(header.names):
                    raise ValueError(
                        f"line {reader.line_num} of {where} has {len(row)} cells, but its table has "
                        f"{len(header.names)} columns; the file may be cut off there: export it again."
                    )
                rows.append(row)
            if header is not None and rows:
                yield header, rows, reader.line_num - len(rows) + 1
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{where} cannot be read as annotated CSV ({str(error).strip()}); export it again.") from error


def _header(row: list[str], annotations: dict[str, list[str]], where: str, line: int) -> _Header:
    names = [name.strip() for name in row]
    if "error" in names and "reference" in names:
        raise ValueError(f"{where} holds an error message of InfluxDB in line {line + 1}; run the query again.")
    if "#datatype" not in annotations:
        raise ValueError(f"{where} has a table without #datatype at line {line}; export it with annotations.")
    if "_time" not in names:
        raise ValueError(f"{where} has a table without _time at line {line}; keep that column in the query.")
    types = [kind.strip() for kind in annotations["#datatype"]]
    types[0] = ""
    defaults = list(annotations.get("#default", [""] * len(names)))
    defaults[0] = ""
    if len(types) != len(names) or len(defaults) != len(names):
        raise ValueError(f"{where} has annotations that do not fit the header in line {line}; export it again.")
    return _Header(names, types, defaults)


def _add_rows(series: _Series, text: set[str], header: _Header, rows: list[list[str]], line: int, where: str) -> None:
    """Add the rows of a table to the series of their field and tags."""
    lines = pd.RangeIndex(line, line + len(rows))
    table = pd.DataFrame(rows, lines, [f"{i}" for i in range(len(header.names))])
    of = {name: f"{i}" for i, name in enumerate(header.names) if name}
    for i, default in enumerate(header.defaults):
        if default:
            table[f"{i}"] = table[f"{i}"].replace("", default)
    ticks = utc_ticks(table[of["_time"]], where)
    kinds = dict(zip(header.names, header.types, strict=True))
    fields = ["_value"] if "_value" in of else [n for n in of if kinds[n] in _NUMBERS and n not in _RESERVED]
    tags = [n for n in of if n not in (*_RESERVED, *fields) and kinds[n] == "string"]
    keys = [of[n] for n in ("_measurement", "_field", *tags) if n in of]
    groups = table.groupby(keys, sort=False).indices if keys else {(): np.arange(len(table))}
    for key, chosen in groups.items():
        values = dict(zip(keys, key if isinstance(key, tuple) else (key,), strict=True))
        for field in fields:
            name = _channel(values, of, tags, field)
            if kinds[field] not in _NUMBERS:
                text.add(name)
                continue
            numbers = to_numbers(table[of[field]].iloc[chosen], repr(name), where, ON_OFF)
            series.setdefault(name, []).append((ticks[chosen], numbers))


def _channel(values: dict[str, str], of: dict[str, str], tags: list[str], field: str) -> str:
    """Name of a channel: measurement, field, and the tags that are not empty."""
    start = [values.get(of.get("_measurement", ""), ""), values.get(of.get("_field", ""), "")]
    if field != "_value":
        start[1] = field
    return " ".join([*filter(None, start), *(f"{tag}={values[of[tag]]}" for tag in tags if values[of[tag]])]) or field


def _joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> pd.Series:
    """One series from its parts, sorted; of two values at a stamp the later in the file holds."""
    whole = pd.Series(np.concatenate([v for _, v in parts]), np.concatenate([t for t, _ in parts])).dropna()
    return whole[~whole.index.duplicated(keep="last")].sort_index()
