"""Steps of the disturbance, usually hours: means of rows over them, and forecasters that learn from them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._holidays import Holidays
from .._rolling import RollingForecastMixin
from .._table import ZoneTable, concatenate_tables
from .._time import wall_clock
from .tables import time_zone_of, utc_of

_HOUR = pd.Timedelta("1h")  # the disturbance is forecast by hours (paper 3.3)


class Steps(NamedTuple):
    """Rows of a table averaged over the steps of the forecaster."""

    table: ZoneTable  # one row per step, with the disturbance as history ``zeta``
    of_row: np.ndarray  # (n_rows,) step of every row


def disturbance_step(step: pd.Timedelta) -> pd.Timedelta:
    """An hour where the table's step divides it, else the table's own step."""
    return _HOUR if step < _HOUR and _HOUR % step == pd.Timedelta(0) else step


def steps_table(
    labels: pd.DatetimeIndex,
    zone: Any,
    inputs: dict[str, np.ndarray],
    zeta: np.ndarray,
    step: pd.Timedelta,
    holidays: Holidays,
) -> ZoneTable:
    """A table of one row per step of the disturbance; ``labels`` are the beginnings of the steps in UTC."""
    index = labels.tz_localize(None) if zone is None else labels.tz_convert(zone)
    time, order = wall_clock(index), (*inputs, "zeta")
    return ZoneTable(inputs, {"zeta": zeta}, index, time, labels, step, order=order, holidays=holidays)


def steps_of_rows(table: ZoneTable, step: pd.Timedelta) -> tuple[pd.DatetimeIndex, np.ndarray]:
    """Steps of the forecaster over a stamped table: (n_steps,) labels in UTC, and (n_rows,) the step of every row."""
    stamps = utc_of(table).floor(step) if table.step < step else utc_of(table)
    begins = np.append(True, stamps[1:] != stamps[:-1])
    return stamps[begins], np.cumsum(begins) - 1


def average(table: ZoneTable, zeta: np.ndarray, step: pd.Timedelta, zone: Any) -> Steps:
    """Means of a stamped table and of its disturbance (n_rows,) over the steps of the forecaster.

    The hours of the steps are those of a time ``zone``.
    """
    labels, of_row = steps_of_rows(table, step)
    roles = sorted(table.inputs, key=table.roles.index)
    columns = [*(table.inputs[role] for role in roles), zeta]
    means = pd.DataFrame(np.column_stack(columns)).groupby(of_row).mean().to_numpy()
    inputs = {role: means[:, j].copy() for j, role in enumerate(roles)}
    return Steps(steps_table(labels, zone, inputs, means[:, -1].copy(), step, table.holidays), of_row)


def with_step_before(table: ZoneTable, step: pd.Timedelta) -> ZoneTable:
    """The table after one more step of rows like its first: a forecast needs a known row to start from."""
    count = max(1, int(step / table.step))
    back = pd.to_timedelta(-table.step.value * np.arange(count, 0, -1), unit="ns")
    first = table.replace(
        inputs={role: np.full(count, v[0]) for role, v in table.inputs.items()},
        history={role: np.full(count, np.nan) for role in table.history},
        index=table.index[0] + back,
        time=table.time[0] + back,
        utc=utc_of(table)[0] + back,
    )
    return concatenate_tables([first, table])


def join_steps(old: ZoneTable, new: ZoneTable) -> ZoneTable:
    """Steps of the training and of later history as one even table.

    Training is moved later by whole weeks where it ended long before; in the rest of the gap no disturbance is known.
    """
    step, after = old.step, utc_of(new)
    stamps = pd.DatetimeIndex(_weeks_later(old, after[0] - step).append(after))
    place = np.asarray((stamps - stamps[0]) // step, dtype=np.int64)
    labels = pd.date_range(stamps[0], stamps[-1], freq=step)
    held = np.zeros(len(labels), dtype=np.int64)
    held[place] = np.arange(len(stamps))
    held = np.maximum.accumulate(held)
    zeta = np.full(len(labels), np.nan)
    zeta[place] = np.concatenate([old.history["zeta"], new.history["zeta"]])
    inputs = {role: np.concatenate([v, new.inputs[role]])[held] for role, v in old.inputs.items()}
    return steps_table(labels, time_zone_of(old), inputs, zeta, step, new.holidays)


def _weeks_later(table: ZoneTable, end: pd.Timestamp) -> pd.DatetimeIndex:
    """The stamps of a table [UTC] moved by whole weeks to end by ``end``, at the hours of the day that they had."""
    stamps, zone, week = utc_of(table), time_zone_of(table), pd.Timedelta("7D")
    for n_weeks in range(int((end - stamps[-1]) / week), 0, -1):
        moved = stamps + week * n_weeks
        if zone is not None:  # daylight saving may have begun or ended since
            local = pd.DatetimeIndex([stamps[-1], moved[-1]]).tz_convert(zone).tz_localize(None)
            change = (moved[-1] - stamps[-1]) - (local[1] - local[0])
            moved = moved + change if change % table.step == pd.Timedelta(0) else moved
        if moved[-1] <= end:
            return moved
    return stamps


def fit_forecaster(forecaster: Any, steps: ZoneTable, target: np.ndarray | None = None) -> Any:
    """Fit a forecaster of the disturbance to a table of steps; ``target`` may hide parts that stay known as past."""
    zeta = steps.history["zeta"] if target is None else target
    if reads_tables(forecaster):
        return forecaster.fit(steps, zeta)
    frame = frame_of(steps)
    return forecaster.fit(frame, pd.Series(zeta, frame.index, name="zeta"))


def forecast_steps(forecaster: Any, steps: ZoneTable, known: np.ndarray, n_steps: int) -> np.ndarray:
    """(n_origins, n_steps) forecasts of the disturbance in the steps after each of the ``known`` ones."""
    table = steps if reads_tables(forecaster) else frame_of(steps)
    return forecaster.predict_from(table, known, horizon=n_steps * steps.step)


def reads_tables(forecaster: Any) -> bool:
    """Whether a forecaster reads a ZoneTable as it is; others are given a DataFrame."""
    return isinstance(forecaster, RollingForecastMixin)


def frame_of(steps: ZoneTable) -> pd.DataFrame:
    """A table of steps as a DataFrame with columns by role."""
    return pd.DataFrame({**steps.inputs, "zeta": steps.history["zeta"]}, index=steps.index)
