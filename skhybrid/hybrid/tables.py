"""Tables by rows and by steps of the disturbance (hours): frames by role, bins of rows, training behind history."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import ASSUMED_START

#: the disturbance is forecast by hours (paper 3.3)
_HOUR = pd.Timedelta("1h")
#: history kept behind the training table: two weeks, the longest lag of any forecaster
KEPT = pd.Timedelta("15D")
#: stamps that a table without any is given in ``predict``, so that it follows no training table
ELSEWHERE = ASSUMED_START + pd.Timedelta(weeks=5200)


class Bins(NamedTuple):
    """Rows of a table gathered into the steps of the forecaster."""

    frame: pd.DataFrame  # one row a bin, columns by role
    of_row: np.ndarray  # (n_rows,) bin of every row


def frame_by_role(table: ZoneTable, start: pd.Timestamp) -> pd.DataFrame:
    """A table as a frame by roles, with stamps (from ``start`` where it had none) and a ``T_za`` column."""
    index = table.index if table.utc is not None else pd.DatetimeIndex(start + (table.time - table.time[0]))
    missing = np.full(table.n_rows, np.nan)
    frame = pd.DataFrame({**table.inputs, "T_za": table.history.get("T_za", missing)}, index=index)
    return frame[sorted(frame.columns, key=lambda role: table.order.index(role) if role in table.order else 99)]


def in_zone_of(future: pd.Index, history: pd.Index, names: tuple[str, str] = ("history", "future")) -> pd.Index:
    """The stamps of ``future`` in the time zone of ``history``.

    Raises
    ------
    ValueError
        If only one of the two has a zone; it calls them by ``names``.
    """
    if not isinstance(future, pd.DatetimeIndex) or not isinstance(history, pd.DatetimeIndex):
        return future
    if (future.tz is None) != (history.tz is None):
        past, ahead = names
        raise ValueError(f"{past} has the time zone {history.tz}, {ahead} {future.tz}; localize the one without.")
    return future if history.tz is None or future.tz == history.tz else future.tz_convert(history.tz)


def disturbance_step(step: pd.Timedelta) -> pd.Timedelta:
    """An hour where the table's step divides it, else the table's own step."""
    return _HOUR if step < _HOUR and _HOUR % step == pd.Timedelta(0) else step


def joined_rows(old: pd.DataFrame, new: pd.DataFrame, step: pd.Timedelta) -> pd.DataFrame:
    """Training rows and history as one even table.

    Training that ended long before is moved later by whole weeks, which keeps the hour of the week; what is left of the
    gap has no disturbance, so that nothing is learned from it.
    """
    gap = new.index[0] - old.index[-1] - step
    moved = old.set_axis(old.index + pd.Timedelta("7D") * int(gap / pd.Timedelta("7D")))
    whole = pd.concat([moved, new[list(old.columns)]])
    grid = pd.date_range(whole.index[0], whole.index[-1], freq=step)
    if len(grid) == len(whole):
        return whole
    filled = whole.reindex(grid)
    inputs = [c for c in filled.columns if c != "zeta"]
    filled[inputs] = filled[inputs].ffill()
    return filled


def with_row_before(frame: pd.DataFrame, step: pd.Timedelta) -> pd.DataFrame:
    """The frame behind one more step of rows, whose disturbance is unknown: a forecast needs a row to stand on."""
    index = pd.DatetimeIndex(frame.index)
    own = index[1] - index[0] if len(index) > 1 else step
    count = max(1, int(step / own))
    stamps = index[0] - own * np.arange(count, 0, -1)
    first = pd.concat([frame.iloc[[0]]] * count).set_axis(pd.DatetimeIndex(stamps)).assign(zeta=np.nan)
    return pd.concat([first, frame])


def gather(frame: pd.DataFrame, step: pd.Timedelta) -> Bins:
    """Means by steps of the forecaster."""
    index = pd.DatetimeIndex(frame.index)
    utc = index.tz_convert("UTC") if index.tz is not None else index
    stamps = utc.floor(step) if len(index) < 2 or utc[1] - utc[0] < step else utc
    begins = np.append(True, stamps[1:] != stamps[:-1])
    of_row = np.cumsum(begins) - 1
    hours = frame.groupby(of_row).mean()
    labels = stamps[begins]
    return Bins(hours.set_axis(labels.tz_convert(index.tz) if index.tz is not None else labels), of_row)


def stamps_ns(table: ZoneTable) -> np.ndarray:
    """(n_rows,) stamps in UTC [ns], or on the assumed clock where the table has none."""
    return (table.time if table.utc is None else table.utc).as_unit("ns").asi8


def concatenate_tables(tables: list[ZoneTable]) -> ZoneTable:
    """Tables that follow each other, with the same roles, as one."""
    first, *others = tables

    def joined(stamps: str) -> pd.DatetimeIndex:
        return pd.DatetimeIndex(getattr(first, stamps).append([getattr(table, stamps) for table in others]))

    return first.replace(
        inputs={role: np.concatenate([table.inputs[role] for table in tables]) for role in first.inputs},
        history={role: np.concatenate([table.history[role] for table in tables]) for role in first.history},
        index=first.index.append([table.index for table in others]),
        time=joined("time"),
        utc=None if first.utc is None else joined("utc"),
    )


def last_rows(tables: list[ZoneTable], n_rows: int) -> ZoneTable:
    """The last rows of tables that follow each other, as one; all of them where there are fewer."""
    segments: list[ZoneTable] = []
    while n_rows > 0 and len(segments) < len(tables):
        table = tables[-1 - len(segments)]
        segments.append(table.rows(slice(max(0, table.n_rows - n_rows), None)))
        n_rows -= table.n_rows
    return concatenate_tables(segments[::-1])
