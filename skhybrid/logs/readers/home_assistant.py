"""Readers of Home Assistant: the recorder's database, its long-term statistics and its history in CSV or JSON."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..._table import listed
from ..._time import positive_duration
from ..raw_log import RawLog
from ..text_files import damage_refused, head_of, open_bytes
from ..unit_names import unit_or_energy
from .entity_states import on_even_rows, refuse_unknown, some_of, states_to_numbers
from .json_log import json_items
from .known_table import header_names, utc_ticks
from .recorder import HELD_NOTE, is_recorder, is_sqlite, read_recorder

_COLUMNS = ["entity_id", "state", "last_changed"]
_JSON = re.compile(r"\s*\[\s*\[[\s\],\[]*\{")  # the beginning of a history with a list for each entity
_PIECE = 200_000  # rows of a history that are read at a time


def looks_like(path: Path, head: str) -> bool:
    """Whether a file is a recorder's database, or a history with one row per change of an entity."""
    in_json = _JSON.match(head) is not None and '"entity_id"' in head
    return header_names(head)[:3] == _COLUMNS or in_json or is_recorder(path)


def read(
    path: Path,
    table: str | None = None,
    entities: Collection[str] | None = None,
    step: str = "1min",
    timezone: str | None = None,
) -> RawLog:
    """Read the recorder's database (SQLite, opened read-only), or a history in CSV or JSON; stamps are UTC.

    An entity is a channel under its own id; a climate entity gives ``<id>.current_temperature``, ``.temperature`` or
    ``.target_temp_low`` and ``.target_temp_high``, ``.heating`` and ``.cooling`` (1 while it acts).  A counter in the
    statistics gives its increase per hour, energy as mean power [kW].

    States are put on even rows, the last value at or before each, for the stamps of different entities never agree, and
    a table with a row per change of any of them would not fit in memory.  So no channel is left to be held later: only
    here is it known where an entity was unavailable, and where Home Assistant did not run.
    """
    where, delta = repr(path.name), positive_duration(step, "step")
    if isinstance(entities, str):
        raise ValueError(f"entities={entities!r} is one text; give a list of entities.")
    if is_sqlite(path):
        return read_recorder(path, where, table, entities, delta, timezone)
    if table is not None:
        raise ValueError(f"table={table!r} is for a database, but {where} is a history; leave it out.")
    return _read_history(path, where, entities, delta, timezone)


def _read_history(
    file: Path, where: str, entities: Collection[str] | None, step: pd.Timedelta, timezone: str | None
) -> RawLog:
    units: dict[str, str] = {}
    series, text = _series(file, where, entities, units)
    if not series:
        found = some_of(text) if text else "none at all"
        raise ValueError(f"{where} has no entity with numbers, only {found}; export a sensor's history.")
    frame, _ = on_even_rows(series, step, timezone, where)
    notes = [HELD_NOTE, *([] if units else ["the history names no units; take them from Home Assistant."])]
    if text:
        notes.append(f"left out, because they have no numbers: {some_of(text)}.")
    units = {name: unit for name, unit in units.items() if name in frame}
    return RawLog(frame, "Home Assistant history", units, label="left", notes=tuple(notes))


def _series(
    file: Path, where: str, entities: Collection[str] | None, units: dict[str, str]
) -> tuple[dict[str, tuple[np.ndarray, np.ndarray]], set[str]]:
    """Stamps [s] and values of each entity with numbers, and the names of the others; adds known units."""
    pieces: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    text: Counter[str] = Counter()
    known: set[str] = set()
    in_json = _JSON.match(head_of(file)) is not None
    for piece in _states_of_json(file, where, units) if in_json else _pieces(file, where):
        seconds = utc_ticks(piece["last_changed"], where) / 1e9
        for name, rows in piece.groupby("entity_id", sort=False).indices.items():
            known.add(str(name))
            if entities is None or name in entities:
                values, other = states_to_numbers(piece["state"].to_numpy()[rows])
                pieces.setdefault(str(name), []).append((seconds[rows], values))
                text[str(name)] += other
    if not known:
        raise ValueError(f"{where} has a header but no rows.")
    refuse_unknown(entities or (), known, where)
    found = {}
    for name, parts in pieces.items():
        at, numbers = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
        order = np.argsort(at, kind="stable")
        if np.isfinite(numbers).sum() > text[name]:
            found[name] = (at[order], numbers[order])
    return found, set(pieces) - set(found)


def _states_of_json(file: Path, where: str, units: dict[str, str]) -> Iterator[pd.DataFrame]:
    """The rows of a history with a list for each entity, of which the first may tell alone what it is; adds units."""
    lists = (states for states in json_items(file, where) if isinstance(states, list))
    table = pd.DataFrame([row for states in lists for row in states if isinstance(row, dict)])
    table = table.reindex(columns=[*_COLUMNS, "attributes"]).assign(entity_id=lambda rows: rows["entity_id"].ffill())
    for name, told in table.dropna().drop_duplicates("entity_id")[["entity_id", "attributes"]].to_numpy():
        if isinstance(told, dict) and (unit := unit_or_energy(told.get("unit_of_measurement"))):
            units[str(name)] = unit
    yield table[_COLUMNS].astype(str).set_axis(table.index + 1, axis=0)


def _pieces(file: Path, where: str) -> Iterator[pd.DataFrame]:
    """The rows of a history as text, piece by piece."""
    options: dict[str, Any] = {"dtype": str, "keep_default_na": False, "encoding": "utf-8-sig", "chunksize": _PIECE}
    try:
        with damage_refused(where), open_bytes(file) as stream, pd.read_csv(stream, **options) as reader:
            for piece in reader:
                piece.columns = [str(c).strip() for c in piece.columns]
                if list(piece.columns[:3]) != _COLUMNS:
                    raise ValueError(f"{where} has the columns {listed(piece)}; a history has {listed(_COLUMNS)}.")
                piece = piece.set_axis(piece.index + 2, axis=0)  # lines of the file
                yield piece[piece["last_changed"] != "last_changed"]  # a history that was put below another
    except pd.errors.EmptyDataError:
        raise ValueError(f"{where} is empty; export it again.") from None
    except (UnicodeDecodeError, pd.errors.ParserError) as error:
        raise ValueError(f"{where} cannot be read as a history ({str(error).strip()}); export it again.") from error
