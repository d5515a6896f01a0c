"""The rows ahead of a forecast: weather of a day to come, and its set-points or planned heat."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, is_plant, listed
from .._time import SHORTEST_GAP
from ..datasets import weather_on_steps
from ..logs.even_steps import resample_column
from ..logs.zone_names import shared_plants
from ..preprocessing import GapFiller
from ..study.settings import Settings
from ..study.thermostat import Schedule
from ..study.zone_part import log_columns, roles_of
from .dead_meters import not_learned

Schedules = Schedule | Mapping[str, Schedule]  # of one zone or for all, or by zone, with "" for all others
GivenSchedules = str | Iterable[str] | Mapping[str, str] | Schedules  # as a user gives them


class RowsAhead(NamedTuple):
    """The known part of the rows to forecast."""

    frame: pd.DataFrame  # weather, and set-points or planned heat, by role
    planned: bool  # whether the heat is planned, and no thermostat acts


def schedules_of(given: GivenSchedules | None, zones: Sequence[str] = ()) -> Schedules | None:
    """Set-points from text: ``21,24``; of several zones that is for all of them, and ``hall:21,24`` for one.

    Of several zones they may also be a mapping of zone to text.  Schedules that are read already stay as they are.  A
    ValueError names what cannot be read, an unknown zone, or a zone with two texts.
    """
    if given is None or isinstance(given, Schedule):
        return given
    if isinstance(given, Mapping):
        by_zone = list(given.items())
    else:
        texts = given if isinstance(given, Iterable) and not isinstance(given, str) else [given]
        by_zone = [_zone_apart(text, zones) for text in texts]
    found: dict[str, Schedule] = {}
    for zone, one in by_zone:
        if zone and zone not in zones:
            known = f"has {listed(zones)}" if zones else "is of one zone: leave the name out"
            raise ValueError(f"--setpoint names the zone {zone!r}, but the model {known}.")
        if zone in found:
            of = f" for {zone!r}" if zone else ""
            raise ValueError(f"--setpoint is given twice{of}; give heating and cooling in one, such as 21,24.")
        found[zone] = one if isinstance(one, Schedule) else Schedule.of_text(one)
    return (found or None) if zones else found.get("")


def _zone_apart(text: Any, zones: Sequence[str]) -> tuple[str, Any]:
    """The zone that a text begins with, "" where it names none, and its set-points."""
    zone, colon, rest = text.partition(":") if isinstance(text, str) else ("", "", text)
    named = bool(colon) and (zone.strip() in zones or zone.strip().isidentifier())
    return (zone.strip(), rest) if named else ("", text)


def rows_ahead(
    settings: Settings,
    origin: pd.Timestamp,
    inputs: list[str],
    *,
    weather: pd.DataFrame | None = None,
    plan: pd.DataFrame | None = None,
    schedule: Schedules | None = None,
) -> RowsAhead:
    """The rows after an origin, one horizon long, for a model that reads ``inputs`` besides ``T_za``.

    ``weather`` has columns by role over the rows ahead, at any step, and ``plan`` likewise planned heat or stages, or
    set-points; by default set-points are those of the plan, then of the weather, then of the settings.  A ValueError
    says what is missing, or that a zone without a plant has a set-point.
    """
    step = pd.Timedelta(settings.step)
    index = pd.date_range(origin + step, periods=round(pd.Timedelta(settings.horizon) / step), freq=step)
    plant = list(filter(is_plant, inputs))
    known = weather if weather is not None else plan
    if weather is None and plan is not None and len(plan):  # the rows that the log has, where it has any
        index = index[index <= plan.index[-1]]
    computed = [r for r in inputs if r.startswith("q_sol_") and r not in settings.columns]  # of the site's facades
    frame = _weather(known, [r for r in inputs if r not in (*plant, *computed)], index, origin)
    if not plant:
        if schedule is not None:
            raise ValueError("the model has no heating or cooling, so that --setpoint does nothing; leave it out.")
        return RowsAhead(frame, True)
    heat = {role: plan[role].reindex(index) for role in plant if plan is not None and role in plan}
    if schedule is None and heat and all(values.notna().any() for values in heat.values()):
        return RowsAhead(frame.assign(**{r: _whole(v, r, "planned heat") for r, v in heat.items()}), True)
    frame = frame.join(_setpoints(settings, index, plan, weather, schedule, plant))
    alone = _without_setpoints(settings, plant, list(map(str, frame)))
    planned = {r: v for zone in alone for r, v in heat.items() if r in alone[zone] and v.notna().any()}
    return RowsAhead(frame.assign(**{r: _whole(v, r, "planned heat") for r, v in planned.items()}), False)


def _without_setpoints(settings: Settings, plant: Sequence[str], setpoints: Sequence[str]) -> dict[str, list[str]]:
    """The roles of the plant of each zone that has none of some set-points."""
    found = {zone: list(roles_of([*plant, *setpoints], settings, zone).items()) for zone in settings.zones}
    bare = {zone: pairs for zone, pairs in found.items() if not {own for own, _ in pairs} & set(SETPOINT_ROLES)}
    return {zone: roles for zone, pairs in bare.items() if (roles := [role for own, role in pairs if is_plant(own)])}


def _setpoints(
    settings: Settings,
    index: pd.DatetimeIndex,
    plan: pd.DataFrame | None,
    weather: pd.DataFrame | None,
    schedule: Schedules | None,
    plant: list[str],
) -> pd.DataFrame:
    """Set-points by role: as given, else of the plan, of the weather, or of the settings."""
    known = (rows for rows in (plan, weather) if schedule is None and rows is not None)
    for rows in known:
        given = {role: _over_steps(rows[role].dropna(), index, settings) for role in settings.setpoints if role in rows}
        if any(values.notna().any() for values in given.values()):
            return pd.DataFrame({role: _whole(values, role, "set-point") for role, values in given.items()})
    found = schedule or Schedule.of_tables(settings.thermostat)
    if settings.zones and (shared := shared_plants(plant, settings.zones)):
        named = listed(log_columns(shared[:1], settings))
        raise ValueError(
            f"the zones share the plant {named}, and one stage cannot hold the set-points of several: give what it "
            "will do, in rows of the log after the last measured one, and no set-points."
        )
    if found is None:
        wanted = log_columns(settings.setpoints, settings) or log_columns(plant, settings)
        raise ValueError(
            f"nothing says what the plant does tomorrow: give --setpoint, such as 21,24, or [thermostat] in the "
            f"configuration, or fill in {listed(wanted)} in the rows ahead."
        )
    if isinstance(found, Schedule) and not settings.zones:
        return found.band(index, settings.holidays)
    by_zone = {"": found} if isinstance(found, Schedule) else found
    run = [zone for zone in settings.zones if any(map(is_plant, roles_of(plant, settings, zone)))]
    silent = not_learned(settings, plant)  # of which the model has no heat
    wrong = [zone for zone in by_zone if zone and zone not in (*run, *silent)]
    if wrong:
        raise ValueError(
            f"--setpoint names {wrong[0]!r}, which the model does not heat or cool; name one of {listed(run)}."
        )
    unlogged = _without_setpoints(settings, plant, list(settings.columns))
    usual = unlogged if len(unlogged) < len(run) else {}  # their plants may run as usual
    absent = [] if "" in by_zone else [zone for zone in run if zone not in by_zone and zone not in usual]
    if absent:
        options = " ".join(f"--setpoint {zone}:21,24" for zone in absent)
        raise ValueError(f"no set-point is given for {listed(absent)}; give one for all, or {options}.")
    own = {zone: by_zone[zone if zone in by_zone else ""] for zone in run if zone in by_zone or "" in by_zone}
    bands = [held.band(index, settings.holidays).add_suffix(f"_{zone}") for zone, held in own.items()]
    return pd.concat(bands, axis=1)


def _weather(
    given: pd.DataFrame | None, roles: list[str], index: pd.DatetimeIndex, origin: pd.Timestamp
) -> pd.DataFrame:
    """Weather at the rows ahead: temperatures by interpolation, irradiance with the energy of each interval."""
    known = [] if given is None else list(given.columns[given.notna().sum() > 1])
    for role in roles:
        if role not in known:
            only = f" (only {listed(known)})" if known else ""
            raise ValueError(
                f"{role} is not known for the rows ahead, after {origin}{only}; give tomorrow's weather with "
                f"--weather, in a column named {role} or as in the log, or rows ahead in the log."
            )
    assert given is not None
    out = {}
    for role in roles:
        kind = "q_sol" if role.startswith("q_sol") else "T_oa"  # further boundary temperatures as that of outdoors
        pair = pd.DataFrame({"T_oa": 0.0, "q_sol": 0.0, kind: given[role]}).dropna()
        pair.attrs = dict(given.attrs)
        out[role] = weather_on_steps(pair, index)[kind]
    return pd.DataFrame(out, index).rename_axis("time")


def _over_steps(values: pd.Series, index: pd.DatetimeIndex, settings: Settings) -> pd.Series:
    """Set-points over the rows ahead, each held to the next of its own rows, and over a short gap."""
    if len(values) < 2:
        return values.reindex(index)
    stamps, known = pd.DatetimeIndex(values.index), values.to_numpy(dtype=np.float64)
    row = stamps.to_series().diff().median()
    name = str(values.name)
    found = {name: resample_column(name, known, stamps, index, pd.Timedelta(settings.step), row)}
    return GapFiller(SHORTEST_GAP).fit_transform(pd.DataFrame(found, index))[name]


def _whole(values: pd.Series, role: str, what: str) -> pd.Series:
    missing = values.isna()
    if missing.any():
        raise ValueError(
            f"{role} ({what}) is missing in {int(missing.sum())} of the rows ahead, first at "
            f"{values.index[int(np.argmax(missing))]}; fill it in, or give --setpoint."
        )
    return values
