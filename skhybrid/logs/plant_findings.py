"""Faults of a plant that a log shows: heat of the wrong sign, a plant that failed, and what it may serve beside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from .._table import SETPOINT_ROLES, is_cooling, is_plant, is_stage, listed
from .._warnings import percent
from .counters import is_counter
from .log_findings import RUNS, Finding
from .zone_names import plants_of_room

_AWAY, _AWAY_FOR = 3.0, pd.Timedelta("12h")  # a plant that works brings a room back sooner, or stops it before [K]
_HOTTER, _HOTTER_FOR = 1.0, pd.Timedelta("12h")  # outdoors than in the room, so that no heating is needed [K]
_COLDER_OUT = 10.0  # outdoors than in the room, so that few rooms are cooled [K]
_MOST_RUN = 0.4  # share of such hours in which a heater may give more
_STEADY = 0.01  # relative deviation of the rises of a counter that counts evenly
_ALIKE = 0.95  # correlation of two meters of the same heat


def parallel_findings(frame: pd.DataFrame, used: Mapping[str, str], others: Mapping[str, str]) -> Iterator[Finding]:
    """A remark on each column that could be more of a plant's heat than is used.

    ``used`` are columns by role, ``others`` the roles of columns that are not used, and ``frame`` all columns.
    """
    for name, role in others.items():
        if not is_plant(role) or role not in used or not frame[name].abs().max() > 0.0:
            continue
        if not abs(float(_as_it_ran(frame[name]).corr(_as_it_ran(frame[used[role]])))) > _ALIKE:
            text = f"could be heat or cold of the plant beside {used[role]!r}, and is not used"
            both = "one stage of both, from 0 to 1," if is_stage(role) else "their sum"
            yield Finding("warning", name, f"{text}: if the room gets both, write {both} in one column.")


def _as_it_ran(values: pd.Series) -> pd.Series:
    """The rises of a counter, since any two counters are alike; other values as they are."""
    rises = values.diff().clip(lower=0.0)
    return rises if is_counter(values) and rises.std() > _STEADY * rises.mean() else values


def shared_plant_findings(columns: Mapping[str, str], others: Sequence[str]) -> Iterator[Finding]:
    """A remark on each plant that may serve other rooms than that of ``T_za``; ``columns`` by role."""
    for role, name in columns.items() if others else ():
        if is_plant(role):
            text = f"is taken to act on {columns['T_za']!r} alone: does it serve {listed(others)} too? Then name each"
            yield Finding("warning", name, f"{text} room in [columns], as T_za_<room>.")


def plant_findings(frame: pd.DataFrame, rooms: Sequence[str]) -> Iterator[Finding]:
    """A remark on each room that goes on leaving a set-point, as where a plant has failed; columns are roles."""
    sides = zip(SETPOINT_ROLES, (1.0, -1.0), ("below", "above"), ("u_cool", "u_heat"), strict=True)
    for side, sign, beyond, other in sides:
        for role in (role for role in rooms if role in frame):
            if all(plant.startswith(other) for plant in plants_of_room(frame, role.removeprefix("T_za"))):
                continue
            set_point = next((name for name in (side + role.removeprefix("T_za"), side) if name in frame), None)
            spell = None if set_point is None else _left_alone(sign * (frame[set_point] - frame[role]))
            if spell is not None:
                text = f"is more than {_AWAY:g} K {beyond} {set_point} from {spell[0]} to {spell[-1]}"
                advice = "did the plant fail? It is learned from these rows too; end [train] before them"
                yield Finding("warning", role, f"{text}: {advice}, or begin it after them.")


def cooling_findings(frame: pd.DataFrame, meters: Mapping[str, str]) -> Iterator[Finding]:
    """A remark on each meter of heat with a sign that seems wrong; columns are roles, ``meters`` columns by role."""
    step = pd.DatetimeIndex(frame.index).to_series().diff().median()
    for role, name in meters.items():
        end = next(role.removeprefix(begin) for begin in ("Q_hvac", "Q_heat", "Q") if role.startswith(begin))
        room, heat = f"T_za{end}", frame[role]
        if room not in frame or "T_oa" not in frame:
            continue
        cold = heat[frame["T_oa"] < frame[room] - _COLDER_OUT].dropna() / heat.abs().quantile(0.99)
        share = float((cold < -RUNS).mean()) if len(cold) * step >= _HOTTER_FOR else 0.0
        if not role.startswith("Q_heat") and share > max(RUNS, 10.0 * (cold > RUNS).mean()):
            text = f"is negative in {percent(share)} of the hours when it is {_COLDER_OUT:g} K colder outdoors"
            yield Finding("warning", name, f"{text} than in the room: is it heating? Then give [scale] {role} = -1.")
        if not heat.min() >= 0.0:
            continue
        hot = heat[frame["T_oa"] > frame[room] + _HOTTER].dropna()
        share = float((hot > RUNS * heat.quantile(0.99)).mean()) if len(hot) * step >= _HOTTER_FOR else 0.0
        if share > _MOST_RUN:
            text = f"is positive in {percent(share)} of the hours when it is hotter outdoors than in the room"
            advice = f"make cooling negative, give it in a column of its own as Q_cool{end}, or give a column that says"
            text = f"{text}: is it cooling? Heat into the room is positive: {advice} heat or cool as mode."
            yield Finding("warning", name, text)


def cold_findings(frame: pd.DataFrame, columns: Mapping[str, str]) -> Iterator[Finding]:
    """A remark on cooling that runs in the cold, as of an air conditioner that heats; ``columns`` by role."""
    step = pd.DatetimeIndex(frame.index).to_series().diff().median()
    for role, name in columns.items():
        heats, room = role.replace("cool", "heat", 1), f"T_za{role[len('u_cool') :]}"
        if not is_cooling(role) or {room, "T_oa"} - set(frame) or heats in columns:
            continue
        values = frame[role]
        cold = values.abs()[frame["T_oa"] < frame[room] - _COLDER_OUT].dropna()
        if len(cold) * step < _HOTTER_FOR or values.min() < 0.0 < values.max():  # which is an error of its own
            continue
        share = float((cold > RUNS * values.abs().quantile(0.99)).mean())
        if share > _MOST_RUN:
            text = f"is taken for cooling, but runs in {percent(share)} of the hours when it is {_COLDER_OUT:g} K"
            advice = f"is it heating? Then give it as {heats}."
            yield Finding("warning", name, f"{text} colder outdoors than in the room: {advice}")


def _left_alone(missed: pd.Series) -> pd.Index | None:
    """Stamps of the first spell in which a room misses its set-point (n,) [K] by more and more."""
    away = missed > _AWAY
    for _, spell in missed[away].groupby((away != away.shift()).cumsum()[away]):
        if spell.idxmax() - spell.index[0] >= _AWAY_FOR:  # at the end of a set-back it misses most at once
            return spell.index
    return None
