"""Set-points that are blank: while the plant is off, as where a controller logs none at night, or not logged."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES
from .._time import SHORTEST_GAP
from .._warnings import several
from .zone_names import plants_of_room

_BEYOND = 3.0  # from the lowest or highest measured temperature to one that the room does not reach [K]
_RUNS = 0.02  # of its peaks, from which on a plant runs
_MAY_RUN = 0.02  # share of the rows of a blank in which it may run on
_SIGNS = dict(zip(SETPOINT_ROLES, (1.0, -1.0), strict=True))
_ONE_SIDED = ("u_", "Q_heat", "Q_cool")  # other heat is negative where it cools
_OTHER_SIDE = {1.0: ("u_cool", "Q_cool"), -1.0: ("u_heat", "Q_heat")}


class BlankRows(NamedTuple):
    """Rows in which a set-point was blank."""

    remark: str  # what was taken in its place
    last: pd.Timestamp


def filled_setpoints(frame: pd.DataFrame) -> tuple[pd.DataFrame, list[BlankRows]]:
    """The rows with set-points where these are blank, and what was blank.

    Where the plant is off it is a temperature that the room never reaches: held at the set-point of the day before, a
    room that cools at night would look like one whose plant has failed.  Elsewhere it is that of another week.
    """
    frame, found = _where_off(frame)
    filled = {}
    for role in (name for name in map(str, frame) if name.startswith(SETPOINT_ROLES) and frame[name].isna().any()):
        blank = _lasting(frame[role].isna()) & frame[role].bfill().notna() & frame[role].ffill().notna()
        if blank.any():
            filled[role] = frame[role].mask(blank, _of_another_week(frame[role]))
            text = f"{role} is missing in {several(int(blank.sum()), 'row')}, first {blank.idxmax()}"
            remark = f"{text}: that of the week before or after is taken, or the last one"
            found.append(BlankRows(remark, frame.index[blank][-1]))
    return frame.assign(**filled), found


def _of_another_week(values: pd.Series) -> pd.Series:
    """Values in whose blanks those at the same time a week before stand, else a week after, else the last one."""
    for week in (pd.Timedelta("7D"), -pd.Timedelta("7D")):
        values = values.fillna(values.set_axis(values.index + week).reindex(values.index))
    return values.ffill()


def _where_off(frame: pd.DataFrame) -> tuple[pd.DataFrame, list[BlankRows]]:
    """The rows with a temperature that the room never reaches where a set-point is blank and its plant off."""
    filled, found = {}, []
    for role in map(str, frame):
        side = next((name for name in SETPOINT_ROLES if role.startswith(name)), None)
        if side is None or not frame[role].isna().any() or frame[role].isna().all():
            continue
        zone, sign = role.removeprefix(side), _SIGNS[side]
        runs = _runs(frame, zone, sign)
        rooms = [name for name in map(str, frame) if name == f"T_za{zone}" or (not zone and name.startswith("T_za_"))]
        if runs is None or not rooms:
            continue
        off = _blanks_without(runs, _lasting(frame[role].isna()))
        beyond = np.floor((sign * frame[rooms]).min().min() - _BEYOND) * sign
        if off.any():
            filled[role] = frame[role].mask(off, beyond)
            text = f"{role} is missing in {several(int(off.sum()), 'row')} in which the plant is off: {beyond:g} degC"
            found.append(BlankRows(f"{text}, which the room does not reach, is taken there", frame.index[off][-1]))
    return frame.assign(**filled), found


def _runs(frame: pd.DataFrame, zone: str, sign: float) -> pd.Series | None:
    """Whether the plant of one side runs, NaN where that is not known; None without a plant."""
    others = frame.drop(columns=[role for role in frame if str(role).startswith(_OTHER_SIDE[sign])])
    own = plants_of_room(others, zone)
    if not own:
        return None
    signed = [frame[role].abs() if role.startswith(_ONE_SIDED) else frame[role] * sign for role in own]
    peaks = [values[values > 0.0].quantile(0.99) for values in signed]
    running = [(values > _RUNS * peak).where(values.notna()) for values, peak in zip(signed, peaks, strict=True)]
    return pd.concat(running, axis=1).astype(np.float64).max(axis=1, skipna=False)


def _lasting(blank: pd.Series) -> pd.Series:
    """Rows of blanks that last for hours, and are no mere gaps between values."""
    stamps, number = blank.index.to_series(), (blank != blank.shift()).cumsum()
    ends = stamps.shift(-1, fill_value=stamps.iloc[-1] + SHORTEST_GAP)  # one at the end of the log may go on
    hours = ends.groupby(number).transform("max") - stamps.groupby(number).transform("min")
    return blank & (hours >= SHORTEST_GAP)


def _blanks_without(runs: pd.Series, blank: pd.Series) -> pd.Series:
    """Rows of blanks in which the plant is known to be off, but for the few at their ends."""
    number = (blank != blank.shift()).cumsum()[blank]
    share = runs[blank].groupby(number).transform(lambda one: one.mean(skipna=False))
    return (share <= _MAY_RUN).reindex(blank.index, fill_value=False)
