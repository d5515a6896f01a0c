"""EnergyPlus buildings of which one zone's set-points are decided step by step while the simulation runs.

Every conditioned zone has an ideal plant for its air, of the size of a heat pump; the other zones keep their
thermostats.  The plant does not dehumidify, since its capacity would then be one of total heat, not of sensible.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from _buildings import Building, floor_areas, occupy, programme_home
from _energyplus import (
    GAINS,
    N_STEPS,
    SPACE,
    STEPS_PER_HOUR,
    YEAR,
    _engine,
    _Recorder,
    load_model,
    prepare,
    read_schedules,
    schedules_of,
)

STEP = pd.Timedelta(hours=1) / STEPS_PER_HOUR
#: between heating and cooling set-points; equal ones end the run [K]
LEAST_BAND = 0.2
#: capacity of each plant, heating and cooling, by floor area [W/m2]; a cold morning takes hours with it
CAPACITY = {"small_office_chicago": 25.0, "apartment_newark": 35.0}
#: what serves air loops, water and boilers
_SERVICES = (
    "AirLoopHVAC", "AirTerminal:", "AvailabilityManager", "Branch", "Boiler", "Chiller", "Coil", "Connector",
    "Controller:", "CoolingTower", "Curve:", "Fan:", "OutdoorAir:", "Pipe:", "Plant", "Pump:", "Refrigeration:",
    "SetpointManager:", "Sizing:Plant", "Sizing:System", "WaterHeater", "WaterUse:", "ZoneHVAC:", "NodeList",
)  # fmt: skip
#: set-points [degC] of a step, from its number in the year, the present temperature [degC] and the heat of the step
#: before [kW]
Policy = Callable[[int, float, float], tuple[float, float]]


def row_of(stamp: pd.Timestamp) -> int:
    """Number in the year of the step that begins at a stamp without time zone."""
    return round((stamp - pd.Timestamp(YEAR, 1, 1)) / STEP)


def with_ideal_plants(document: dict, power: dict[str, float]) -> dict:
    """A document whose conditioned zones have ideal plants of some power [W], and a source of heat that is off."""
    kept = {kind: value for kind, value in document.items() if not kind.startswith(_SERVICES)}
    names = list(power)
    kinds = ("plant", "supply", "return", "air", "list", "added")
    named = {(kind, zone): f"{zone} {kind}" for zone in names for kind in kinds}
    kept["ZoneHVAC:IdealLoadsAirSystem"] = {
        named["plant", zone]: {
            "zone_supply_air_node_name": named["supply", zone],
            "heating_limit": "LimitCapacity",
            "maximum_sensible_heating_capacity": power[zone],
            "cooling_limit": "LimitCapacity",
            "maximum_total_cooling_capacity": power[zone],
            "dehumidification_control_type": "None",
        }
        for zone in names
    }
    kept["ZoneHVAC:EquipmentConnections"] = {
        f"{zone} connections": {
            "zone_name": zone,
            "zone_conditioning_equipment_list_name": named["list", zone],
            "zone_air_inlet_node_or_nodelist_name": named["supply", zone],
            "zone_air_node_name": named["air", zone],
            "zone_return_air_node_or_nodelist_name": named["return", zone],
        }
        for zone in names
    }
    order = {"zone_equipment_cooling_sequence": 1, "zone_equipment_heating_or_no_load_sequence": 1}
    kind = {"zone_equipment_object_type": "ZoneHVAC:IdealLoadsAirSystem"}
    kept["ZoneHVAC:EquipmentList"] = {
        named["list", zone]: {"equipment": [order | kind | {"zone_equipment_name": named["plant", zone]}]}
        for zone in names
    }
    constant = {named["added", zone]: {"hourly_value": 0.0} for zone in names}
    source = {"fuel_type": "None", "design_level": 1.0}
    kept["Schedule:Constant"] = document.get("Schedule:Constant", {}) | constant
    kept["OtherEquipment"] = document.get("OtherEquipment", {}) | {
        f"{zone} source": source | {SPACE: zone, "schedule_name": named["added", zone]} for zone in names
    }
    control = document["SimulationControl"]["control"]
    sizing = {"do_system_sizing_calculation": "No", "do_plant_sizing_calculation": "No"}
    return kept | {"SimulationControl": {"control": control | sizing}}


def without_ramps(heat: np.ndarray, cool: np.ndarray) -> np.ndarray:
    """(n, 2) set-points of two levels each, where a model comes to the one of the day in steps."""
    sides = [np.where(side >= side.max() - 1e-6, side, side.min()) for side in (heat, -cool)]
    return np.column_stack([sides[0], -sides[1]])


class Plant:
    """A building with its people, ready to be run; by zone the ``bands`` (N_STEPS, 2) and the ``power`` [W]."""

    def __init__(self, building: Building, seed: int) -> None:
        from pyenergyplus.dataset import weather_files

        self.building = building = replace(building, seed=seed)
        document = prepare(load_model(building.model), weather_files[building.climate])
        names = schedules_of(document, building.zones)
        reference = read_schedules(document, building.climate, tuple(sorted(set().union(*names.values()))))
        conditioned = tuple(c["zone_name"] for c in document["ZoneHVAC:EquipmentConnections"].values())
        areas = floor_areas(document, conditioned)
        self.power = {zone: CAPACITY[building.name] * area for zone, area in areas.items()}
        self.document = with_ideal_plants(document, self.power)
        self.schedules = occupy(building, {kind: names[kind] for kind in GAINS}, reference)
        if building.use == "home":
            programme = programme_home(names["heat"], names["cool"], reference)
            self.schedules, reference = self.schedules | programme, reference | programme
        self.bands = {}
        for zone in building.zones:
            own = schedules_of(document, (zone,))
            self.bands[zone] = without_ramps(*(reference[sorted(own[side])[0]] for side in ("heat", "cool")))

    def run(
        self, zone: str, first: pd.Timestamp, last: pd.Timestamp, policy: Policy, added: np.ndarray | None = None
    ) -> pd.DataFrame:
        """Run days, first and last included, under a policy, with ``added`` (N_STEPS,) heat [W] to the zone's air.

        Returns the columns of the data contract by begin of the step, and the heat of people and appliances [kW].
        """
        from pyenergyplus.dataset import weather_files

        span = {"begin_month": first.month, "begin_day_of_month": first.day}
        span |= {"end_month": last.month, "end_day_of_month": last.day}
        document = self.document | {"RunPeriod": {"year": self.document["RunPeriod"]["year"] | span}}
        own = self.schedules | ({} if added is None else {f"{zone} added": added})
        loop = _Loop(document, zone, own, policy)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.epJSON"
            path.write_text(json.dumps(document), encoding="utf-8")
            _engine(folder, path, weather_files[self.building.climate], [], loop)
        return loop.table(zone, first, last)


class _Loop(_Recorder):
    """Asks a policy for set-points at the begin of each step."""

    def __init__(self, document: dict, zone: str, overrides: dict[str, np.ndarray], policy: Policy) -> None:
        super().__init__(document, (zone,), overrides, ())
        self.zone, self.policy = zone, policy
        self.setters: tuple[int, ...] = ()
        self.last, self.decided = -1, (0.0, 0.0)

    def _set(self, state) -> None:
        super()._set(state)
        if not self.setters:
            kinds = ("Heating Setpoint", "Cooling Setpoint")
            find = self.exchange.get_actuator_handle
            self.setters = tuple(find(state, "Zone Temperature Control", kind, self.zone) for kind in kinds)
            if min(self.setters) < 0:
                raise RuntimeError(f"EnergyPlus has no set-points of zone {self.zone!r}")
        row = self._row(state)
        if row != self.last or self.exchange.warmup_flag(state):
            self.last, self.decided = row, self._decide(state, row)
        for handle, value in zip(self.setters, self.decided, strict=True):
            self.exchange.set_actuator_value(state, handle, value)

    def _decide(self, state, row: int) -> tuple[float, float]:
        names = list(self.held)
        T = self.exchange.get_variable_value(state, self.handles[0][names.index(f"T:{self.zone}")])
        delivered = (self.means[row - 1, 0] - self.means[row - 1, 1]) * STEPS_PER_HOUR / 1000.0
        # days are repeated until the building is warm: none of them was
        warming = self.exchange.warmup_flag(state)
        heat, cool = self.policy(-1 - row if warming else row, T, delivered)
        if cool < heat + LEAST_BAND:
            raise ValueError(f"set-points {heat:.2f} and {cool:.2f} are closer than {LEAST_BAND} K.")
        return heat, cool

    def table(self, zone: str, first: pd.Timestamp, last: pd.Timestamp) -> pd.DataFrame:
        """Rows by begin of the step."""
        begin, end = row_of(first), row_of(last + pd.Timedelta(days=1))
        if not np.allclose(self.hours[begin:end], 1.0 / STEPS_PER_HOUR):
            raise RuntimeError("EnergyPlus left out steps of the days")
        held = pd.DataFrame(self.values, columns=list(self.held))[begin:end]
        heating, cooling = (self.means[begin:end] * STEPS_PER_HOUR / 1000.0).T
        T = held[f"T:{zone}"].to_numpy()
        sun = np.sin(np.radians(held["altitude"].to_numpy())).clip(0.0)
        gains = sum(held[f"gain_{part}:{zone}"].to_numpy() for part in ("convective", "radiant", "visible"))
        return pd.DataFrame(
            {
                "T_oa": held["T_out"].to_numpy(),
                "q_sol": (held["dni"].to_numpy() * sun + held["dhi"].to_numpy()) / 1000.0,
                "Q_hvac": heating - cooling,
                "T_za": np.append(T[0], T[:-1]),
                "T_end": T,
                "Q_gain": gains / 1000.0,
            },
            index=pd.DatetimeIndex(pd.Timestamp(YEAR, 1, 1) + STEP * np.arange(begin, end), freq=STEP),
        )


def held_setpoints(setpoints: np.ndarray) -> Policy:
    """The thermostat alone, with set-points (N_STEPS, 2) of the year."""

    def policy(row: int, T: float, delivered: float) -> tuple[float, float]:
        heat, cool = setpoints[row if row >= 0 else -1 - row]
        return float(heat), float(cool)

    return policy


def warming_per_kW(plant: Plant, zone: str, first: pd.Timestamp, leads: np.ndarray) -> np.ndarray:
    """Warming [K/kW] of the zone air after so many steps of added heat, with its plant off; median over 12 begins.

    Steps of a day at 0, 8 and 16 h on four days, each after two days under the thermostat, against the same days
    without them.
    """
    day, power = 24 * STEPS_PER_HOUR, 1000.0
    found = []
    for hour in (0, 8, 16):
        begins = row_of(first) + (2 + 3 * np.arange(4)) * day + hour * STEPS_PER_HOUR
        off = np.zeros(N_STEPS, dtype=bool)
        for begin in begins:
            off[begin : begin + leads.max() + 1] = True
        wide = np.where(off[:, None], [-20.0, 60.0], plant.bands[zone])
        last = first + pd.Timedelta(days=14)
        base, moved = (
            plant.run(zone, first, last, held_setpoints(wide), np.where(off, heat, 0.0))["T_end"].to_numpy()
            for heat in (0.0, power)
        )
        at = begins[:, None] - row_of(first) + leads - 1
        found.append((moved - base)[at] * 1000.0 / power)
    return np.median(np.concatenate(found), axis=0)
