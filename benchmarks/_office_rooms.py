"""Offices all of whose rooms are logged: as they are, or with people, thermostats and doors of each room's own.

An office as it is has one thermostat plan and one draw of people for all rooms, so that its rooms hardly differ.  In
one with ``doors`` each room has people and set-points of its own, and air mixes through the doors that are open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
import pandas as pd
from _buildings import BUILDINGS, CONTROLS, SMALL_OFFICE, Building, floor, occupy, plan_setpoints
from _energyplus import (
    GAINS,
    SCHEDULE_OF,
    SPACE,
    load_model,
    prepare,
    read_schedules,
    schedules_of,
    simulate,
    site,
)

#: air through a door of the ring, relative to that between its rooms and their core
CORNER = 0.2


@dataclass(frozen=True)
class Rooms(Building):
    """An office with all its rooms; ``doors`` is the air between a core and each of its neighbours [m3/s].

    With ``doors`` None the rooms have people and set-points in common, and closed doors.
    """

    doors: float | None = None


def _rooms(building: Building, **changes: object) -> Rooms:
    return Rooms(**({f.name: getattr(building, f.name) for f in fields(Building)} | changes))


_FRESNO = BUILDINGS[4]
#: 5 rooms with two seeds, and 15; then 5 rooms with people and set-points of their own, doors open and closed
OFFICES = (
    _rooms(SMALL_OFFICE),
    _rooms(SMALL_OFFICE, name="small_office_chicago_2", seed=107),
    _rooms(BUILDINGS[0], zones=(*floor("bot", "Core_bottom"), *floor("mid", "Core_mid"), *floor("top", "Core_top"))),
    *(_rooms(SMALL_OFFICE, name=f"open_office_chicago_{i}", seed=110 + i, doors=0.25) for i in (1, 2, 3)),
    *(_rooms(_FRESNO, name=f"open_office_fresno_{i}", seed=120 + i, doors=0.25) for i in (1, 2)),
    *(_rooms(SMALL_OFFICE, name=f"closed_office_chicago_{i}", seed=110 + i, doors=0.0) for i in (1, 2)),
    _rooms(_FRESNO, name="closed_office_fresno_1", seed=121, doors=0.0),
)


def on_floors(rooms: list[str]) -> list[tuple[str, str]]:
    """Pairs of a core and its four perimeter rooms, in a ring, floor by floor."""
    out = []
    for k in range(0, len(rooms), 5):
        core, *ring = rooms[k : k + 5]
        out += [(core, room) for room in ring] + list(zip(ring, [*ring[1:], ring[0]], strict=True))
    return out


def tables_of_rooms(office: Rooms, controls: tuple[str, ...] = CONTROLS) -> Iterator[tuple[str, pd.DataFrame]]:
    """Tables of all zones of an office, control by control, in the columns of ``../shared/data/zones``."""
    from pyenergyplus.dataset import weather_files

    document = prepare(load_model(office.model), weather_files[office.climate])
    groups: list[tuple[Building, tuple[str, ...]]] = [(office, office.zones)]
    if office.doors is not None:
        document = with_doors(with_schedules_apart(document, office.zones), office)
        groups = [(replace(office, seed=100 * office.seed + k), (zone,)) for k, zone in enumerate(office.zones)]
    used = [(building, schedules_of(document, zones)) for building, zones in groups]
    reference = read_schedules(
        document, office.climate, tuple(sorted({n for _, u in used for n in set().union(*u.values())}))
    )
    for control in controls:
        overrides: dict[str, np.ndarray] = {}
        for building, names in used:
            overrides |= occupy(building, {kind: names[kind] for kind in GAINS}, reference)
            if control == "shifted":
                overrides |= plan_setpoints(building, names["heat"], names["cool"], reference)
            elif office.doors is not None:
                overrides |= own_level(building, names["heat"] | names["cool"], reference)
        yield control, rooms_of(simulate(document, office.climate, office.zones, overrides), office)


def own_level(room: Building, setpoints: set[str], reference: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Set-points of a room that keeps the plan of the model at a level of its own, up to 2 K beside it."""
    level = np.random.default_rng(room.seed + 5000).uniform(-2.0, 2.0)
    return {name: reference[name] + level for name in sorted(setpoints)}


def with_schedules_apart(document: dict, zones: tuple[str, ...]) -> dict:
    """Give each zone copies of the schedules of its gains and its thermostat."""
    out = document | {kind: dict(document[kind]) for kind in document if kind.startswith("Schedule:")}
    kinds = {name: kind for kind in out if kind.startswith("Schedule:") for name in out[kind]}

    def copied(item: dict, key: str, zone: str) -> dict:
        shared = item[key]
        own = f"{zone} {shared}"
        out[kinds[shared]][own] = out[kinds[shared]][shared]
        return item | {key: own}

    for kind in GAINS:
        out[kind] = {
            name: copied(gain, SCHEDULE_OF[kind], gain[SPACE]) if gain[SPACE] in zones else gain
            for name, gain in document.get(kind, {}).items()
        }
    dual = "ThermostatSetpoint:DualSetpoint"
    out[dual] = dict(document[dual])
    for control in document["ZoneControl:Thermostat"].values():
        if (zone := control["zone_or_zonelist_name"]) in zones:
            name = control["control_1_name"]
            for side in ("heating", "cooling"):
                out[dual][name] = copied(out[dual][name], f"{side}_setpoint_temperature_schedule_name", zone)
    return out


def with_doors(document: dict, office: Rooms) -> dict:
    """Let air mix between rooms: all of ``doors`` with a core, a fifth of it in the ring."""
    if not office.doors:
        return document
    always = {"doors open": {"hourly_value": 1.0}}
    mixing = {}
    for one, other in on_floors(list(office.zones)):
        flow = office.doors * (1.0 if one in office.zones[::5] else CORNER)
        for zone, source in ((one, other), (other, one)):
            mixing[f"{source} to {zone}"] = {
                "zone_or_space_name": zone,
                "schedule_name": "doors open",
                "design_flow_rate_calculation_method": "Flow/Zone",
                "design_flow_rate": flow,
                "source_zone_or_space_name": source,
                "delta_temperature": 0.0,
            }
    return document | {
        "Schedule:Constant": document.get("Schedule:Constant", {}) | always,
        "ZoneMixing": document.get("ZoneMixing", {}) | mixing,
    }


def rooms_of(run: pd.DataFrame, office: Rooms) -> pd.DataFrame:
    """Temperature at each stamp, and means over the step that begins there, of every zone."""
    sun = np.sin(np.radians(run["altitude"].to_numpy())).clip(0.0)
    columns = {"T_out_degC": run["T_out"], "ghi_kW_m2": (run["dni"] * sun + run["dhi"]) / 1000.0}
    columns |= {"dni_kW_m2": run["dni"] / 1000.0, "dhi_kW_m2": run["dhi"] / 1000.0}
    for zone in office.zones:
        room = zone.lower()
        columns[f"T_{room}_degC"] = run[f"T:{zone}"].shift(1)  # that at the end of the step before
        columns[f"Q_{room}_kW"] = (run[f"heating:{zone}"] - run[f"cooling:{zone}"]) / 1000.0
        columns |= {f"set_{side}_{room}_degC": run[f"set_{side}:{zone}"] for side in ("heat", "cool")}
    offset = f"{site(office.climate)['time_zone']:+03.0f}:00"
    begins = (run.index - pd.Timedelta("15min")).tz_localize(offset)
    return pd.DataFrame(columns).set_axis(begins).iloc[1:].round(5)
