"""Hours and kinds of day of rows, as models tell them apart."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ._clock import hour_of_day, kept_by_stamps
from ._table import ZoneTable
from ._time import per_hour, rows_per_day, wall_clock

#: cells of a weekly profile: the hours of a weekday, then those of a weekend day or holiday
N_CELLS = 48


@kept_by_stamps
def clock_hour(time: pd.DatetimeIndex) -> np.ndarray:
    """Hour of day (0 ... 23) of local stamps, (n,) int."""
    return np.asarray(time.asi8 // per_hour(time.unit) % 24)


def slot_of_day(time: pd.DatetimeIndex, step: pd.Timedelta) -> np.ndarray:
    """Number of each row's step within its local day, (n,) int below ``rows_per_day(step)``."""
    slots = np.floor(hour_of_day(time) * (pd.Timedelta("1h") / step) + 1e-9).astype(np.int64)
    return np.minimum(slots, rows_per_day(step) - 1)


def profile_cell(hour: np.ndarray, weekend: np.ndarray) -> np.ndarray:
    """Cell of the weekly profile: the hour (0 ... 23) on weekdays, 24 + the hour on weekends, (n,) int."""
    return hour + 24 * weekend


def day_type_hour(table: ZoneTable) -> np.ndarray:
    """:func:`profile_cell` of every row, (n,) int; a holiday is one of the weekend."""
    return profile_cell(clock_hour(table.time), table.weekend)


def day_type_hours(table: ZoneTable, rows: np.ndarray) -> np.ndarray:
    """:func:`day_type_hour` of rows (n,) counted from a table's last one, within it or not."""
    stamps = table.index if isinstance(table.index, pd.DatetimeIndex) else table.time
    time = wall_clock(stamps[-1] + pd.TimedeltaIndex(rows * table.step.to_timedelta64()))
    return profile_cell(clock_hour(time), table.holidays.weekend(time))


def one_hot(levels: np.ndarray, n_levels: int) -> np.ndarray:
    """(n, n_levels) float64 with a 1 in each row's level."""
    return np.eye(n_levels)[levels]
