"""Parameters that a log can identify, judged by what moved in it, and what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._holidays import read_holidays
from .._table import SETPOINT_ROLES, is_plant
from .._time import wall_clock
from .._warnings import several
from .conversion import row_hours
from .zone_names import shared_plants

_PLAN = "skhybrid.identification.plan_experiment"  # plans days of random set-points
_FEW_HOURS = 5.0  # hours at full heat, below which a plant shows little
_FEW_DAYS, _ENOUGH_DAYS = 3, 14
_LEAST_SPREAD = 1.0  # range of a room's temperature [K] that shows its time constants
_MOST_NAMED = 4  # columns that may be a temperature which is missing
_LEAST_WEATHER = 5.0  # range of the outdoor temperature [K] that shows the loss


def excitation(frame: pd.DataFrame) -> pd.DataFrame:
    """Moves of each column by role: lowest, highest and mean value, share of rows with one; hours run and starts."""
    rows = {}
    for role in frame:
        values = frame[role].dropna().to_numpy(dtype=np.float64)
        if not len(values):
            continue
        found = {
            "lowest": values.min(), "highest": values.max(), "mean": values.mean(), "share": len(values) / len(frame)
        }  # fmt: skip
        if is_plant(role) and np.abs(values).max() > 0.0:
            on = np.abs(values) > 0.05 * np.abs(values).max()
            found["hours run"] = np.abs(values).sum() / np.abs(values).max() * row_hours(frame[role])
            found["starts"] = float((on[1:] & ~on[:-1]).sum())
        rows[str(role)] = found
    columns = ["lowest", "highest", "mean", "share", "hours run", "starts"]
    return pd.DataFrame.from_dict(rows, orient="index").reindex(columns=columns).rename_axis("role")


def abilities(
    moved: pd.DataFrame, n_days: int, unsure: set[str], rooms: Sequence[str] = ("T_za",), unplaced: Sequence[str] = ()
) -> tuple[list[str], list[str], list[str]]:
    """Facts that a log can tell, those that it cannot, and what would help, from the table of :func:`excitation`.

    ``unsure`` are roles of stages and powers whose scale is not certain; ``rooms`` are the roles of the rooms'
    temperatures, of which the first is judged, and ``unplaced`` columns of temperatures without a role.
    """
    can: list[str] = []
    cannot: list[str] = []
    steps: list[str] = []
    have = set(moved.index)
    plants = list(filter(is_plant, moved.index))
    for role in (*rooms, "T_oa"):
        if role not in have:
            what = "outdoor" if role == "T_oa" else "room"
            cannot.append(f"anything: there is no {what} temperature ({role}).")
            steps += _to_name(role, what, unplaced, bool(plants))
    if {rooms[0], "T_oa"} <= have:
        scaled = any(role not in unsure and moved["hours run"].get(role, 0.0) > 0.0 for role in plants)
        _building(moved, n_days, can, cannot, rooms[0], scaled)
    if not plants:
        cannot.append("how the room responds to heating or cooling: no column shows when the plant ran.")
        steps.append("log the heat [kW], the stage of the plant or the opening of the valve.")
    for role in plants:
        ran = moved["hours run"].get(role, 0.0)
        if not ran > 0.0:
            cannot.append(f"the effect of {role}: it never ran.")
            steps.append(f"log days on which {role} runs, if the plant can.")
        elif moved["lowest"][role] == moved["highest"][role]:
            cannot.append(f"the effect of {role}: it never changed.")
            steps.append(f"see that {role} is measured, and that it changes.")
        elif not ran >= _FEW_HOURS:
            cannot.append(f"the effect of {role}: it ran for {ran:.1f} full-load hours only.")
            steps.append(f"let {role} run: days of random set-points show its effect ({_PLAN}).")
        elif role in unsure:
            can.append(f"the effect of {role} on the temperature.")
            cannot.append(f"kW of {role}: its capacity or its coefficient of performance is not known.")
            steps.append(f"give the nameplate capacity or the coefficient of performance of {role}.")
        else:
            can.append(f"the effect of {role}, which ran for {ran:.0f} full-load hours.")
    if not any(role.startswith("q_sol") for role in have):
        cannot.append("the heat of the sun: no column has irradiance; it becomes part of the unmeasured heat.")
        steps.append("add the global irradiance, from a sensor or a weather service.")
    if plants:
        _thermostat(have, plants, rooms, cannot, steps)
    return can, cannot, steps


def _to_name(role: str, what: str, unplaced: Sequence[str], plant: bool) -> list[str]:
    """Steps to a temperature that is missing."""
    perhaps = f" ({' or '.join(map(repr, unplaced[:_MOST_NAMED]))}?)" if unplaced else ""
    steps = [f"name the column of the {what} temperature{perhaps} as {role}, or log it."]
    if what == "room" and plant and len(unplaced) > 1:
        steps.append("to forecast several rooms, name each of them, such as T_za_kitchen and T_za_hall.")
    return steps


def _thermostat(
    have: set[str], plants: Sequence[str], rooms: Sequence[str], cannot: list[str], steps: list[str]
) -> None:
    if len(rooms) > 1 and (shared := shared_plants(plants, [room.removeprefix("T_za_") for room in rooms])):
        cannot.append(f"tomorrow from set-points: the zones share the plant {shared[0]}.")
        steps.append(f"give {shared[0]} in rows ahead to forecast the temperatures.")
    elif not any(role.startswith(SETPOINT_ROLES) for role in have):
        cannot.append("how the thermostat acts: no set-point is logged, so tomorrow's load is that of an ideal plant.")
        steps.append("log the set-points, from which the thermostat is learned.")


def _building(moved: pd.DataFrame, n_days: int, can: list[str], cannot: list[str], room: str, scaled: bool) -> None:
    spread = moved["highest"] - moved["lowest"]
    if n_days < _FEW_DAYS:
        cannot.append(
            f"a day-ahead forecast: the log has {several(n_days, 'whole day')}; three are "
            "needed, and two weeks are better."
        )
    else:
        better = "" if n_days >= _ENOUGH_DAYS else " (two weeks would be better)"
        can.append(f"a day-ahead forecast of the temperature, from {n_days} days{better}.")
    if spread[room] < _LEAST_SPREAD:
        cannot.append(f"time constants: the room moved by {spread[room]:.1f} K only.")
    if spread["T_oa"] < _LEAST_WEATHER:
        cannot.append(f"the loss to outdoors: the outdoor temperature moved by {spread['T_oa']:.1f} K only.")
    elif spread[room] >= _LEAST_SPREAD and n_days >= _FEW_DAYS:
        can.append(
            "the heat loss to outdoors [W/K], the heat capacities and the time constants."
            if scaled
            else "the time constants; the heat loss only up to a factor, since no capacity is known."
        )


def days_of(frame: pd.DataFrame, step: pd.Timedelta, holidays: Any) -> dict[str, int]:
    """Number of days of each kind with at least nine tenths of their rows."""
    index = pd.DatetimeIndex(frame.index)
    rooms = [role for role in frame if role == "T_za" or str(role).startswith("T_za_")]
    known = frame[rooms].notna().any(axis=1).to_numpy() if rooms else np.ones(len(frame), dtype=bool)
    per_day = pd.Series(1, index=wall_clock(index[known]).normalize()).groupby(level=0).sum()
    whole = pd.DatetimeIndex(per_day.index[per_day >= 0.9 * (pd.Timedelta("1D") / step)])
    kind = read_holidays(holidays, whole).day_of_week(whole) if len(whole) else np.empty(0)
    free = (kind == 6) & (whole.day_of_week != 6)
    weekend = (kind >= 5) & ~free
    counts = {"working days": int((~weekend & ~free).sum()), "weekend days": int(weekend.sum())}
    return counts | ({"holidays": int(free.sum())} if free.any() else {})
