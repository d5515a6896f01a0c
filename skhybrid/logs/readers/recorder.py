"""Tables of Home Assistant's recorder, an SQLite database: states and long-term statistics, entity by entity."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from ..raw_log import RawLog
from ..unit_names import ENERGY, unit_named, unit_or_energy
from .entity_states import (
    climate_roles,
    climate_values,
    on_even_rows,
    refuse_unknown,
    some_of,
    states_to_numbers,
    utc_index,
)

_DOMAINS = ("sensor", "binary_sensor", "switch", "input_number", "number", "input_boolean", "climate", "weather", "fan")
_FOR_STATISTICS = {"statistics": 3600.0, "statistics_short_term": 300.0}
_IN_USE = "the database is in use: its newest rows may be missing."
HELD_NOTE = "a value is held until the entity's next change, and missing while Home Assistant had none."
_Changes = tuple[np.ndarray, np.ndarray]  # stamps [s] and values, (n,) each


def is_sqlite(file: Path) -> bool:
    """Whether a file is an SQLite database, by its first bytes."""
    with file.open("rb") as stream:
        return stream.read(16) == b"SQLite format 3\x00"


def is_recorder(file: Path) -> bool:
    """Whether a file is an SQLite database with the tables of a recorder."""
    try:
        if not is_sqlite(file):
            return False
        with _opened(file) as (database, _):
            return {"states", "statistics_meta"} & _tables(database) != set()
    except (OSError, sqlite3.DatabaseError):
        return False


def read_recorder(
    file: Path,
    where: str,
    table: str | None,
    entities: Collection[str] | None,
    step: pd.Timedelta,
    timezone: str | None,
) -> RawLog:
    """Read the states or the statistics of a recorder's database."""
    if table not in (None, "states", *_FOR_STATISTICS):
        raise ValueError(f"table={table!r} must be 'states', 'statistics' or 'statistics_short_term'.")
    try:
        with _opened(file) as (database, notes):
            tables = _tables(database)
            if not tables & {"states", "statistics"}:
                raise ValueError(f"{where} has no tables of Home Assistant's recorder (states, statistics).")
            if table is not None and table not in tables:
                raise ValueError(f"{where} has no table {table!r}.")
            if table is None:
                some = "states" in tables and database.execute("SELECT 1 FROM states LIMIT 1").fetchone()
                table = "states" if some else "statistics"
            if table == "states":
                log = _read_states(database, where, entities, step, timezone, tables)
            else:
                log = _read_statistics(database, where, table, entities, timezone)
            return replace(log, notes=(*notes, *log.notes))
    except sqlite3.DatabaseError as error:
        raise ValueError(
            f"{where} cannot be read as Home Assistant's database ({error}); copy it while Home Assistant is stopped, "
            "or take it from a backup."
        ) from error


@contextmanager
def _opened(file: Path) -> Iterator[tuple[sqlite3.Connection, list[str]]]:
    """A read-only connection, and notes; a locked file is read in spite of its lock."""
    address = f"file:{quote(str(file.resolve()))}?mode=ro"
    with file.open("rb") as stream:
        keeps_log = stream.read(20)[18:] == b"\x02\x02"
    if keeps_log and not file.with_name(f"{file.name}-wal").exists():
        address += "&immutable=1"  # of a copy without its write-ahead log; otherwise SQLite would make an empty one
    for uri in (address, f"{address}&immutable=1"):
        connection = sqlite3.connect(uri, uri=True, timeout=0.5)
        connection.text_factory = lambda raw: raw.decode("utf-8", "replace")
        try:
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            connection.close()
            if uri != address:
                raise
            continue
        with closing(connection):
            yield connection, [] if uri == address else [_IN_USE]
        return


def _tables(database: sqlite3.Connection) -> set[str]:
    return {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}


def _columns(database: sqlite3.Connection, table: str) -> set[str]:
    return {row[1] for row in database.execute(f"PRAGMA table_info({table})")}


def _seconds_of(database: sqlite3.Connection, table: str, new: str, old: str) -> str:
    """The expression for seconds since 1970: a number since 2023, text in UTC before."""
    columns = _columns(database, table)
    text = f"round((julianday({table}.{old}) - 2440587.5) * 86400.0, 3)"
    if new not in columns:
        return text
    return f"coalesce({table}.{new}, {text})" if old in columns else f"{table}.{new}"


def _queries(database: sqlite3.Connection, tables: set[str]) -> tuple[str, str]:
    """Queries of a schema, new or old: key and entity_id of each entity; by its key state, seconds and attributes."""
    columns, seconds = _columns(database, "states"), _seconds_of(database, "states", "last_updated_ts", "last_updated")
    named = "states_meta" in tables and "metadata_id" in columns
    key = "metadata_id" if named else "entity_id"
    entities = "metadata_id, entity_id FROM states_meta" if named else "DISTINCT entity_id, entity_id FROM states"
    shared = "state_attributes" in tables and "attributes_id" in columns
    inline = "states.attributes" if "attributes" in columns else "NULL"
    attributes = f"coalesce(state_attributes.shared_attrs, {inline})" if shared else inline
    join = " LEFT JOIN state_attributes ON states.attributes_id = state_attributes.attributes_id" if shared else ""
    rows = f"state, {seconds} AS stamp, {attributes} FROM states{join} WHERE states.{key} = ? ORDER BY stamp"
    return f"SELECT {entities}", f"SELECT {rows}"


def _read_states(
    database: sqlite3.Connection,
    where: str,
    wanted: Collection[str] | None,
    step: pd.Timedelta,
    timezone: str | None,
    tables: set[str],
) -> RawLog:
    entities, rows = _queries(database, tables)
    known = {str(name): key for key, name in database.execute(entities) if name}
    chosen = _chosen(known, wanted, where)
    series: dict[str, _Changes] = {}
    units: dict[str, str] = {}
    text = []
    for name in chosen:
        found, unit = _entity(database, rows, name, known[name])
        series |= found
        units |= {c: unit for c in found if unit and not c.startswith("climate.")}
        if not found:
            text.append(name)
    if not series:
        raise ValueError(f"{where} has no entity with numbers, only {some_of(text)}.")
    frame, grid = on_even_rows(series, step, timezone, where)
    held = list(map(str, frame))
    notes = [HELD_NOTE, *_blank_outages(database, frame, grid, tables)]
    if text:
        notes.append(f"left out, because they have no numbers: {some_of(text)}.")
    climates = [name for name in chosen if name.startswith("climate.") and f"{name}.current_temperature" in frame]
    weather = [c for c in held if c.startswith("weather.")]
    roles = climate_roles(climates, held) | ({"T_oa": weather[0]} if len(weather) == 1 else {})
    _add_climate_units(units, [c for c in held if c.startswith(("climate.", "weather."))])
    if len(climates) > 1:
        notes.append(f"several thermostats, so none has a role: {some_of(climates)}; name one in entities=.")
    notes += _older_statistics(database, tables)
    modes = frozenset(c for c in held if c.startswith("climate.") and c.endswith(".mode"))
    return RawLog(frame, "Home Assistant states", units, roles, label="left", notes=tuple(notes), modes=modes)


def _chosen(known: Collection[str], wanted: Collection[str] | None, where: str) -> list[str]:
    if wanted is None:
        return sorted(name for name in known if name.split(".")[0] in _DOMAINS)
    refuse_unknown(wanted, known, where)
    return list(dict.fromkeys(wanted))


def _entity(database: sqlite3.Connection, query: str, name: str, key: Any) -> tuple[dict[str, _Changes], str | None]:
    """Stamps [s] and values of each channel of an entity, and its unit; empty where it has no numbers."""
    rows = [row for row in database.execute(query, (key,)) if isinstance(row[1], float | int)]
    if not rows:
        return {}, None
    stamps = np.array([row[1] for row in rows], dtype=np.float64)
    domain = name.split(".")[0]
    if domain in ("climate", "weather"):
        attributes = _attributes([row[2] for row in rows])
        if domain == "climate":
            found = climate_values(attributes, [row[0] for row in rows])
            return {f"{name}.{c}": (stamps, v) for c, v in found.items()}, None
        numbers, _ = states_to_numbers((a or {}).get("temperature") for a in attributes)
        return ({f"{name}.temperature": (stamps, numbers)} if np.isfinite(numbers).any() else {}), None
    values, other = states_to_numbers(row[0] for row in rows)
    if np.isfinite(values).sum() <= other:
        return {}, None
    unit = next((a.get("unit_of_measurement") for row in reversed(rows) if (a := _attributes([row[2]])[0])), None)
    return {name: (stamps, values)}, unit_or_energy(unit)


def _attributes(texts: list[str | None]) -> list[dict[str, Any] | None]:
    """Attributes from their JSON, each text parsed once."""
    parsed: dict[str | None, dict[str, Any] | None] = {}
    for text in set(texts):
        try:
            parsed[text] = found if isinstance(found := json.loads(text or "null"), dict) else None
        except json.JSONDecodeError:
            parsed[text] = None
    return [parsed[text] for text in texts]


def _add_climate_units(units: dict[str, str], channels: list[str]) -> None:
    """Give thermostats the unit that all temperature sensors share: Home Assistant shows all in the user's."""
    shared = {unit for unit in units.values() if unit in ("degC", "degF")}
    if len(shared) == 1:
        unit = shared.pop()
        units |= {c: unit for c in channels if c.split(".")[-1].startswith(("current_temp", "temp", "target_temp"))}


def _blank_outages(database: sqlite3.Connection, frame: pd.DataFrame, grid: np.ndarray, tables: set[str]) -> list[str]:
    """Blank the rows between two runs of Home Assistant, in place; runs that ended in a crash have no known end."""
    if "recorder_runs" not in tables:
        return []
    rows = database.execute(
        'SELECT (julianday(start) - 2440587.5) * 86400.0, (julianday("end") - 2440587.5) * 86400.0 '
        "FROM recorder_runs ORDER BY start"
    ).fetchall()
    off = np.zeros(len(grid), dtype=bool)
    for (_, ended), (began, _) in pairwise(rows):
        if ended is not None and began is not None:
            off |= (grid > ended) & (grid < began)
    if not off.any():
        return []
    frame.iloc[off] = np.nan
    return [f"Home Assistant did not run for {int(off.sum())} of {len(grid)} rows, which are missing."]


def _older_statistics(database: sqlite3.Connection, tables: set[str]) -> list[str]:
    if not {"statistics", "statistics_meta"} <= tables:
        return []
    stamp = _seconds_of(database, "statistics", "start_ts", "start")
    first, last = database.execute(f"SELECT min({stamp}), max({stamp}) FROM statistics").fetchone()
    if first is None:
        return []
    return [f"the hourly statistics reach over {(last - first) / 86400.0:.0f} days: read them with table='statistics'."]


def _read_statistics(
    database: sqlite3.Connection, where: str, table: str, wanted: Collection[str] | None, timezone: str | None
) -> RawLog:
    """Means per hour or five minutes; counters as their increase, energy as mean power [kW]."""
    stamp = _seconds_of(database, table, "start_ts", "start")
    meta = database.execute("SELECT id, statistic_id, unit_of_measurement, has_sum FROM statistics_meta").fetchall()
    known = {str(name): (key, unit, counts) for key, name, unit, counts in meta if name}
    length = _FOR_STATISTICS[table]
    columns: dict[str, pd.Series] = {}
    units: dict[str, str] = {}
    power = []
    for name in sorted(known) if wanted is None else _chosen(known, wanted, where):
        key, unit, counts = known[name]
        query = f"SELECT {stamp} AS stamp, mean, state, sum FROM {table} WHERE metadata_id = ? ORDER BY stamp"
        rows = np.array(database.execute(query, (key,)).fetchall(), dtype=np.float64).reshape(-1, 4)
        rows = rows[np.isfinite(rows[:, 0])]
        if not len(rows):
            continue
        values, factor = rows[:, 1], ENERGY.get(str(unit))
        if counts:
            grown = np.diff(rows[:, 3], prepend=np.nan)
            grown[np.diff(rows[:, 0], prepend=np.nan) > 1.5 * length] = np.nan  # the increase of several rows
            values = grown if factor is None else grown * factor * 3600.0 / length
        if np.isfinite(values).any():
            columns[name] = pd.Series(values, rows[:, 0]).groupby(level=0).last()
            power += [name] if counts and factor is not None else []
            found = "kW" if counts and factor is not None else unit_named(unit)
            units |= {name: found} if found and (not counts or factor is not None) else {}
    if not columns:
        raise ValueError(f"{where} has no statistics with numbers; read table='states'.")
    frame = pd.DataFrame(columns)
    frame.index = utc_index(frame.index.to_numpy(np.float64), timezone)
    notes = [f"means over {length / 60.0:g} minutes, stamped with their start."]
    if power:
        notes.append(f"counters of energy as mean power in kW: {some_of(power)}.")
    return RawLog(frame, "Home Assistant statistics", units, label="left", notes=tuple(notes))
