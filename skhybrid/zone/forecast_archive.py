"""Archive of a zone: every forecast and what was measured, in one SQLite file."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from os import PathLike, fspath
from typing import Any

import numpy as np
import pandas as pd

from .._sqlite import open_database, table_of_others, transaction
from .._table import SETPOINT_ROLES
from ..study.day_energy import Energy

_FORECAST = ("T_za", "q_0.1", "q_0.9", "Q_hvac", "Q_hvac_0.1", "Q_hvac_0.9")
_MEASURED = ("T_za", "Q_hvac")
BEYOND = "beyond"  # column of a forecast: 1 where the weather lies beyond what training covered


#: rows of the log: at the steps of the zone, as they were posted, or ahead of the last measurement
EVEN, POSTED, AHEAD = 0, 1, 2


def _table(name: str, keys: tuple[str, ...], values: tuple[str, ...]) -> str:
    columns = [*(f"{key} TEXT NOT NULL" for key in keys), *(f'"{value}" REAL' for value in values)]
    return f"CREATE TABLE IF NOT EXISTS {name} ({', '.join(columns)}, PRIMARY KEY ({', '.join(keys)})) WITHOUT ROWID"


_TABLES = (
    _table("forecast", ("origin", "time"), _FORECAST),
    _table("measured", ("time",), _MEASURED),
    _table("energy", ("origin", "kind"), ("value", "low", "high")),
    _table("log", ("kind", "role", "time"), ("value",)),
    _table("held", ("role",), ()),
)
_STAMPED = (("forecast", "origin"), ("forecast", "time"), ("energy", "origin"), ("measured", "time"), ("log", "time"))
_FINISHED = """
SELECT f.*, {measured} FROM forecast f LEFT JOIN measured m USING (time)
WHERE f.origin IN (
    SELECT origin FROM forecast WHERE origin >= ? GROUP BY origin HAVING max(time) <= (SELECT max(time) FROM measured))
ORDER BY f.origin, f.time
"""


class ForecastArchive:
    """Forecasts by origin and time, and measurements by time, as :func:`open_archive` gives them.

    Stamps are ISO 8601 texts: in UTC where the log has a time zone (``2024-01-31T23:45:00Z``), else as in the log.
    """

    def __init__(self, database: sqlite3.Connection) -> None:
        self.database = database

    def transaction(self) -> AbstractContextManager[None]:
        """Keep all that the block writes, or nothing; no other process can begin one meanwhile."""
        return transaction(self.database)

    def add_forecast(
        self, origin: pd.Timestamp, frame: pd.DataFrame, zones: Sequence[str] = (), energy: Sequence[Energy] = ()
    ) -> None:
        """Keep a forecast and its energy; one from the same origin is replaced.

        Columns of several ``zones`` end with their names.
        """
        (first,) = _texts(pd.DatetimeIndex([origin]))
        for table in ("forecast", "energy"):
            self.database.execute(f"DELETE FROM {table} WHERE origin = ?", (first,))
        self._insert("forecast", frame, _of_zones(_FORECAST, zones), first)
        rows = [(first, one.kind, one.value, *(one.interval or (None, None))) for one in energy]
        self.database.executemany("INSERT INTO energy VALUES (?, ?, ?, ?, ?)", rows)

    def add_measured(self, frame: pd.DataFrame, zones: Sequence[str] = ()) -> None:
        """Keep measured temperature [degC], delivered heat [kW] and stages [-]; rows of the same times are replaced."""
        self._insert("measured", frame, _of_zones(_MEASURED, zones))

    def last_measured(self) -> pd.Timestamp | None:
        """Stamp of the last measurement, None where there is none."""
        return self._last("measured", "time")

    def last_temperature(self, zone: str = "") -> pd.Timestamp | None:
        """Stamp of the last temperature, of several zones that of the one named; None where there is none."""
        role = f"T_za_{zone}" if zone else "T_za"
        known = role in self._columns("measured")
        return self._last("measured", "time", f'WHERE "{role}" IS NOT NULL') if known else None

    def last_origin(self) -> pd.Timestamp | None:
        """Origin of the last forecast, None where there is none."""
        return self._last("forecast", "origin")

    def finished(self, since: pd.Timestamp) -> pd.DataFrame:
        """The forecasts from ``since`` on whose rows are all in the past, with what was measured.

        Columns: ``origin``, ``time``, those of the forecast, ``T_za_measured`` [degC], ``Q_hvac_measured`` [kW], and of
        stages and set-points such as ``u_heat_measured`` [-] and ``T_heat_set_measured`` [degC].
        """
        named = ", ".join(f'm."{name}" AS "{name}_measured"' for name in self._columns("measured")[1:])
        return self._read(_FINISHED.format(measured=named), _texts(pd.DatetimeIndex([since])))

    def _read(self, query: str, values: list[str] | tuple[()] = ()) -> pd.DataFrame:
        rows = self.database.execute(query, values)
        found = pd.DataFrame(rows.fetchall(), columns=[column[0] for column in rows.description])
        return found.astype({name: np.float64 for name in found if name not in ("origin", "time")})

    def latest(self) -> pd.DataFrame:
        """The rows of the last forecast by time, with the columns of the forecast; empty where there is none."""
        query = "SELECT * FROM forecast WHERE origin = (SELECT max(origin) FROM forecast)"
        return _by_time(self._read(query)).drop(columns="origin")

    def latest_energy(self) -> list[Energy]:
        """Heating and cooling of all zones together by the last forecast, where they are known."""
        query = "SELECT * FROM energy WHERE origin = (SELECT max(origin) FROM forecast) ORDER BY kind DESC"
        rows = self.database.execute(query).fetchall()
        return [Energy(kind, value, None if low is None else (low, high)) for _, kind, value, low, high in rows]

    def measured(self, since: pd.Timestamp) -> pd.DataFrame:
        """Temperature [degC] and delivered heat [kW] by time, from a stamp on."""
        texts = _texts(pd.DatetimeIndex([since]))
        return _by_time(self._read("SELECT * FROM measured WHERE time >= ? ORDER BY time", texts))

    def keep_log(self, frame: pd.DataFrame, kind: int) -> None:
        """Keep rows of the log, with a column per role, of one kind: EVEN, POSTED or AHEAD.

        Those at even steps replace what was kept in their span, and other roles are forgotten; those ahead replace what
        was known of the same roles from their first stamp on; posted ones replace those at the same stamps.
        """
        if frame.empty:
            return
        stamps, roles = _texts(pd.DatetimeIndex(frame.index)), [str(role) for role in frame]
        if kind == EVEN:
            self.database.execute(f"DELETE FROM log WHERE role NOT IN ({', '.join('?' * len(roles))})", roles)
        for role in roles:
            values = frame[role].to_numpy(dtype=np.float64)
            known = np.flatnonzero(~np.isnan(values))
            last = {EVEN: max(stamps), AHEAD: "9999" if len(known) else ""}.get(kind, "")
            where = (kind, role, min(stamps), last)
            self.database.execute("DELETE FROM log WHERE kind = ? AND role = ? AND time BETWEEN ? AND ?", where)
            self.database.executemany(
                "INSERT OR REPLACE INTO log VALUES (?, ?, ?, ?)",
                [(kind, role, stamps[i], float(values[i])) for i in known],
            )

    def log(self, kind: int) -> pd.DataFrame:
        """The rows of the log of one kind: one column per role, by time."""
        found = self.database.execute("SELECT time, role, value FROM log WHERE kind = ?", (kind,)).fetchall()
        table = pd.DataFrame(found, columns=["time", "role", "value"]).pivot_table(
            index="time", columns="role", values="value"
        )
        return table.set_axis(_stamps(table.index), axis=0).rename_axis(columns=None)

    def keep_held(self, roles: Sequence[str]) -> None:
        """Keep which roles of the log are logged by change."""
        self.database.execute("DELETE FROM held")
        self.database.executemany("INSERT INTO held VALUES (?)", [(role,) for role in ("", *roles)])

    def held(self) -> list[str] | None:
        """The roles that are logged by change; None where no log has told."""
        found = [role for (role,) in self.database.execute("SELECT role FROM held")]
        return [role for role in found if role] if found else None

    def forget_log(self, kind: int, before: pd.Timestamp) -> None:
        """Remove the rows of one kind before a stamp."""
        (text,) = _texts(pd.DatetimeIndex([before]))
        self.database.execute("DELETE FROM log WHERE kind = ? AND time < ?", (kind, text))

    def keep_clock(self, tz: Any, former: Any) -> None:
        """Bring all stamps to the clock of a log, which may have got or lost a time zone.

        Stamps without one are local to ``tz``, that of the log now; where it has none, others become local to the
        ``former``.  Rows at stamps that do not exist, or exist twice, are forgotten.
        """
        other = "LIKE" if tz is None else "NOT LIKE"
        for table, column in _STAMPED:
            found = self.database.execute(f"SELECT DISTINCT {column} FROM {table} WHERE {column} {other} '%Z'")
            old = [text for (text,) in found]
            stamps = _stamps(pd.Index(old, dtype=object))
            if tz is None:
                stamps = stamps.tz_convert(former or "UTC").tz_localize(None) if old else stamps
            else:
                stamps = stamps.tz_localize(tz, ambiguous="NaT", nonexistent="NaT")
            new = [text if isinstance(text, str) else None for text in _texts(stamps)]
            gone = [(before,) for before, now in zip(old, new, strict=True) if now is None]
            moved = [(now, before) for before, now in zip(old, new, strict=True) if now is not None]
            self.database.executemany(f"DELETE FROM {table} WHERE {column} = ?", gone)
            self.database.executemany(f"UPDATE OR REPLACE {table} SET {column} = ? WHERE {column} = ?", moved)

    def _columns(self, table: str) -> list[str]:
        return [row[1] for row in self.database.execute(f"PRAGMA table_info({table})")]

    def _last(self, table: str, column: str, where: str = "") -> pd.Timestamp | None:
        (text,) = self.database.execute(f"SELECT max({column}) FROM {table} {where}").fetchone()
        return None if text is None else pd.Timestamp(text)

    def _insert(self, table: str, frame: pd.DataFrame, values: tuple[str, ...], *keys: Any) -> None:
        """Insert rows, or replace those with the same keys; what the frame lacks is NULL."""
        values = (*values, *(str(name) for name in frame if str(name).startswith(("u_", *SETPOINT_ROLES, BEYOND))))
        known = self._columns(table)
        for name in [name for name in dict.fromkeys(values) if name not in known]:  # a stage or zone that is new
            self.database.execute(f'ALTER TABLE {table} ADD COLUMN "{name}" REAL')
        named = ", ".join(f'"{name}"' for name in (*("origin",)[: len(keys)], "time", *values))
        numbers = frame.reindex(columns=list(values)).astype(object)
        rows = numbers.where(numbers.notna(), None).to_numpy().tolist()
        stamps = _texts(pd.DatetimeIndex(frame.index))
        marks = ", ".join("?" * (len(keys) + 1 + len(values)))
        self.database.executemany(
            f"INSERT OR REPLACE INTO {table} ({named}) VALUES ({marks})",
            [(*keys, stamp, *row) for stamp, row in zip(stamps, rows, strict=True)],
        )


@contextmanager
def open_archive(path: str | PathLike[str]) -> Iterator[ForecastArchive]:
    """The archive in a file, which is created where there is none.

    A BlockingIOError says that another process is writing to it, an OSError that it cannot be used.
    """
    busy = f"another command is at work on {fspath(path)}; try again when it has ended."
    remedy = "check disk and permissions, or move the file away to begin a new archive."
    with open_database(path, busy, remedy) as database:
        if (other := table_of_others(database, "forecast")) is not None:
            raise OSError(f"{fspath(path)} is a database of another program, with a table {other!r}; move it away.")
        for statement in _TABLES:
            database.execute(statement)
        yield ForecastArchive(database)


def _of_zones(names: tuple[str, ...], zones: Sequence[str]) -> tuple[str, ...]:
    """The names of columns of one zone, or of each of several; SQLite takes hall and Hall for one."""
    lower = [zone.lower() for zone in zones]
    if alike := [zone for zone in zones if lower.count(zone.lower()) > 1]:
        raise ValueError(f"the zones {' and '.join(alike)} differ in upper and lower case only; rename one.")
    return tuple(f"{name}_{zone}" for zone in zones for name in names) or names


def _by_time(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.drop(columns="time").set_axis(_stamps(pd.Index(rows["time"])), axis=0)


def _stamps(texts: pd.Index) -> pd.DatetimeIndex:
    """Stamps from those of the archive."""
    return pd.DatetimeIndex(pd.to_datetime(texts), name="time")


def _texts(index: pd.DatetimeIndex) -> list[str]:
    """Stamps as the archive keeps them."""
    if index.tz is None:
        return list(index.strftime("%Y-%m-%dT%H:%M:%S"))
    return list(index.tz_convert("UTC").strftime("%Y-%m-%dT%H:%M:%SZ"))
