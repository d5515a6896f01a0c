"""The rows ahead of a forecast: weather of a day to come, and its set-points or planned heat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .._holidays import read_holidays
from .._table import SETPOINT_ROLES
from ..study.settings import Settings
from ..study.thermostat import Schedule


class RowsAhead(NamedTuple):
    """What is known of the rows to forecast."""

    frame: pd.DataFrame  # weather, and set-points or planned heat, by role
    planned: bool  # whether the heat is planned, and no thermostat acts


def rows_ahead(
    settings: Settings,
    origin: pd.Timestamp,
    inputs: list[str],
    *,
    weather: pd.DataFrame | None = None,
    plan: pd.DataFrame | None = None,
    schedule: Schedule | None = None,
) -> RowsAhead:
    """The rows after an origin, one horizon long.

    Parameters
    ----------
    settings : Settings
    origin : Timestamp, the last row of the history
    inputs : list of roles that the model reads, besides ``T_za``
    weather : DataFrame, optional
        Columns by role over the rows ahead, at any step: from a forecast, or the end of the log.
    plan : DataFrame, optional
        Planned heat or stages, or set-points, by role; rows as in ``weather``.
    schedule : Schedule, optional
        Set-points; by default those of ``plan``, then of the settings.

    Raises
    ------
    ValueError
        If an input is missing in some rows, or neither heat nor set-points are known.
    """
    step = pd.Timedelta(settings.step)
    index = pd.date_range(origin + step, periods=round(pd.Timedelta(settings.horizon) / step), freq=step)
    frame = pd.DataFrame(index=index.rename("time"))
    plant = [role for role in inputs if role.startswith(("Q_", "u_"))]
    for role in inputs:
        if role in plant or role.startswith("q_sol_"):
            continue  # facades are computed of q_sol
        given = next((f[role] for f in (weather, plan) if f is not None and role in f), None)
        frame[role] = _on_rows(given, role, index, step)
    heat = {role: plan[role].reindex(index) for role in plant if plan is not None and role in plan}
    if schedule is None and heat and all(values.notna().any() for values in heat.values()):
        return RowsAhead(frame.assign(**{r: _whole(v, r, "planned heat") for r, v in heat.items()}), True)
    return RowsAhead(frame.join(_setpoints(settings, index, plan, schedule, plant)), False)


def _setpoints(
    settings: Settings,
    index: pd.DatetimeIndex,
    plan: pd.DataFrame | None,
    schedule: Schedule | None,
    plant: list[str],
) -> pd.DataFrame:
    """Set-points by role: as given, else of the plan, else of the settings."""
    of_plan = [role for role in SETPOINT_ROLES if plan is not None and role in plan]
    if schedule is None and plan is not None and of_plan and plan[of_plan].reindex(index).notna().any(axis=None):
        return pd.DataFrame({role: _whole(plan[role].reindex(index), role, "set-point") for role in of_plan})
    found = schedule or Schedule.of_tables(settings.thermostat)
    if found is None:
        names = " and ".join(plant) or "heat"
        raise ValueError(
            f"nothing tells what the plant does tomorrow: give --setpoint, such as 21,24, or [thermostat] in the "
            f"configuration, or fill in {names} in the rows ahead."
        )
    local = index.tz_localize(None) if index.tz is not None else index
    free = read_holidays(settings.holidays, local).day_of_week(local) >= 5
    return found.band(index, free)


def _on_rows(given: pd.Series | None, role: str, index: pd.DatetimeIndex, step: pd.Timedelta) -> pd.Series:
    """Weather at the rows ahead: temperatures between two values, irradiance as the mean of its interval."""
    if given is None or given.notna().sum() == 0:
        raise ValueError(
            f"{role} is not known for the rows ahead; give tomorrow's weather with --weather, or rows ahead in the log."
        )
    known = given.dropna()
    try:
        known.index = pd.DatetimeIndex(known.index).tz_convert(index.tz)
    except TypeError:
        raise ValueError(
            "the log and the weather must both have a time zone, or both none; give timezone = in the configuration."
        ) from None
    ticks, wanted = known.index.as_unit("ns").asi8, index.as_unit("ns").asi8
    spacing = int(np.median(np.diff(ticks))) if len(ticks) > 1 else step.value
    hold = not role.startswith("T_")
    last = ticks[-1] + (spacing if hold else spacing // 2)
    outside = (wanted < ticks[0]) | (wanted > last - (step.value if hold else 0))
    if outside.any():
        first = index[int(np.argmax(outside))]
        raise ValueError(
            f"{role} ahead covers {known.index[0]} to {known.index[-1]}, but the forecast needs {first}; give weather "
            "for all rows ahead."
        )
    if hold:
        return pd.Series(known.to_numpy()[np.searchsorted(ticks, wanted, side="right") - 1], index=index)
    return pd.Series(np.interp(wanted, ticks, known.to_numpy(dtype=np.float64)), index=index)


def _whole(values: pd.Series, role: str, what: str) -> pd.Series:
    missing = values.isna()
    if missing.any():
        raise ValueError(
            f"{role} ({what}) is missing in {int(missing.sum())} of the rows ahead, first at "
            f"{values.index[int(np.argmax(missing))]}; fill it in, or give --setpoint."
        )
    return values
