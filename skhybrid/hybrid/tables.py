"""Stamps, days and measured rows of tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import ASSUMED_START
from ..forecasting.quantiles import measured_ahead

KEPT = pd.Timedelta("15D")  # kept history: two weeks, which is the longest lag of any forecaster, and a day
#: stamps that a table without any is given in ``predict``, so that it follows no training table
ELSEWHERE = ASSUMED_START + pd.Timedelta(weeks=5200)


def with_stamps(table: ZoneTable, start: pd.Timestamp) -> ZoneTable:
    """The table with time stamps, which where it had none are those of its assumed clock from ``start`` on."""
    if table.utc is not None:
        return table
    index = pd.DatetimeIndex(start + (table.time - ASSUMED_START))
    return table.replace(index=index, time=index, utc=index.tz_localize("UTC"))


def utc_of(table: ZoneTable) -> pd.DatetimeIndex:
    """The stamps in UTC of a table that has some."""
    assert table.utc is not None
    return table.utc


def stamps_ns(table: ZoneTable) -> np.ndarray:
    """(n_rows,) stamps in UTC [ns], or on the assumed clock where the table has none."""
    return (table.time if table.utc is None else table.utc).as_unit("ns").asi8


def time_zone_of(table: ZoneTable) -> Any:
    """The time zone of a table's stamps; None where they have none."""
    return table.index.tz if isinstance(table.index, pd.DatetimeIndex) else None


def midnights(table: ZoneTable) -> np.ndarray:
    """Rows that are the first of a local day."""
    day = table.time.normalize()
    return np.flatnonzero(day[1:] != day[:-1]) + 1


def parts_of_days(table: ZoneTable, longest: int, per_day: int) -> np.ndarray:
    """(n_days, n_parts) rows at which the equal parts of each local day begin, none longer than ``longest`` rows."""
    n_rows = max(n for n in range(1, min(longest, per_day) + 1) if per_day % n == 0)
    return midnights(table)[:, None] + np.arange(0, per_day, n_rows)


def days_after(table: ZoneTable, origins: np.ndarray, per_day: int) -> pd.DataFrame:
    """Measured temperature of the rows after each origin, stamped by the day."""
    return pd.DataFrame(measured_ahead(table, origins, per_day), index=table.time[origins].normalize())


def since_history(table: ZoneTable) -> ZoneTable:
    """The rows of a table after its history, with their temperature."""
    T = {"T_za": table.measured()}
    return table.replace(history=T).rows(slice(table.n_history, None))
