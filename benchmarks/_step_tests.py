"""Step tests on single zones of EnergyPlus: what a kW more does to the zone air, the zone's own plant being off.

The heat that the zone's thermostat delivered is given again as a convective gain, once as it was and once with a step;
the other zones keep their thermostats.  The two temperatures differ by the response of the zone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from _buildings import BUILDINGS, DAY, SEASONS, SMALL_OFFICE, Building, floor_areas, occupy, programme_home
from _energyplus import (
    GAINS,
    N_STEPS,
    SPACE,
    STEPS_PER_HOUR,
    load_model,
    prepare,
    read_schedules,
    schedules_of,
    simulate,
)

#: leads at which the response is read [h], begins of a step [h of the day], and days of steps after the season's first
#: test day; a week of the thermostat between them lets the step before be forgotten.
LEADS = (0.25, 1.0, 4.0, 12.0, 24.0)
STARTS = (0, 7, 14, 21)
TEST_DAYS = (1, 10, 19)
#: days before the first step from which a run goes, and power of a step per floor area [W/m2]
_BEFORE = 21
_STEP = 10.0


def _tested(name: str, *zones: str) -> Building:
    found = next(b for b in (SMALL_OFFICE, *BUILDINGS) if b.name == name)
    return replace(found, zones=zones, seasons=("winter", "summer"))


#: buildings of which single zones are tested; of the first, zones face south (1), east (2) and north (3).
TESTED = (
    _tested("small_office_chicago", "Perimeter_ZN_3", "Perimeter_ZN_1", "Core_ZN", "Perimeter_ZN_2"),
    _tested("retail_colorado_springs", "Core_Retail", "Front_Retail"),
    _tested("medium_office_san_francisco", "Perimeter_mid_ZN_1", "Perimeter_mid_ZN_3", "Core_mid"),
    _tested("apartment_newark", "T SW Apartment", "M N1 Apartment"),
)


def single_zones(building: Building) -> list[Building]:
    """The building with each of its zones alone, named after both."""
    names = [f"{building.name}_{zone}".lower().replace(" ", "_") for zone in building.zones]
    return [replace(building, name=name, zones=(zone,)) for name, zone in zip(names, building.zones, strict=True)]


def days_of_steps(season: str) -> list[pd.Timestamp]:
    """Days of steps."""
    first = pd.Timestamp(SEASONS[season][2])
    return [first + pd.Timedelta(days=n) for n in TEST_DAYS]


class Plant:
    """A building with its people, ready to be run."""

    def __init__(self, building: Building) -> None:
        from pyenergyplus.dataset import weather_files

        self.building = building
        self.document = prepare(load_model(building.model), weather_files[building.climate])
        names = schedules_of(self.document, building.zones)
        reference = read_schedules(self.document, building.climate, tuple(sorted(set().union(*names.values()))))
        self.schedules = occupy(building, {kind: names[kind] for kind in GAINS}, reference)
        if building.use == "home":
            self.schedules |= programme_home(names["heat"], names["cool"], reference)

    def log(self) -> pd.DataFrame:
        """The year under the thermostats of all zones."""
        return simulate(self.document, self.building.climate, self.building.zones, self.schedules)

    def respond(self, zone: str, heat: pd.Series, added: np.ndarray, days: tuple[str, str]) -> pd.DataFrame:
        """Days with heat [W] as a convective gain where it is finite, and added heat [W] beside it.

        The zone's terminal is shut there; its air loop may serve other zones.  Without return air, what lights gave to
        it goes to the zone, so that some zones are up to 1 K warmer than in the log.
        """
        forced = np.isfinite(heat.to_numpy())
        name, shut = f"replay {zone}", f"open {zone}"
        constant = {name: {"hourly_value": 0.0}, shut: {"hourly_value": 1.0}}
        source = {"fuel_type": "None", "schedule_name": name, "design_level": 1.0, SPACE: zone}
        document = _with_schedule_of_terminal(self.document, zone, shut)
        document["Schedule:Constant"] = document.get("Schedule:Constant", {}) | constant
        document["OtherEquipment"] = document.get("OtherEquipment", {}) | {name: source}
        own = {name: np.nan_to_num(heat.to_numpy()) + added, shut: np.where(forced, 0.0, 1.0)}
        return simulate(document, self.building.climate, (zone,), self.schedules | own, days=days)


def _with_schedule_of_terminal(document: dict, zone: str, schedule: str) -> dict:
    """The document with a schedule of its own for the terminal that gives air to a zone."""
    connection = next(c for c in document["ZoneHVAC:EquipmentConnections"].values() if c["zone_name"] == zone)
    units = document["ZoneHVAC:EquipmentList"][connection["zone_conditioning_equipment_list_name"]]["equipment"]
    document = dict(document)
    for unit in (document["ZoneHVAC:AirDistributionUnit"].get(u["zone_equipment_name"]) for u in units):
        if unit is not None:
            kind, name = unit["air_terminal_object_type"], unit["air_terminal_name"]
            document[kind] = document[kind] | {name: document[kind][name] | {"availability_schedule_name": schedule}}
    return document


def step_gains(plant: Plant, tested: Building, season: str, log: pd.DataFrame) -> pd.DataFrame:
    """Response [K/kW] of a single zone to steps of 10 W/m2 of floor that last a day; one row per day and start."""
    (zone,) = tested.zones
    days = days_of_steps(season)
    span = tuple(str((day + pd.Timedelta(days=n)).date()) for day, n in ((days[0], -_BEFORE), (days[-1], 1)))
    begins = np.array([(day.day_of_year - 1) * DAY for day in days])
    forced, rows = np.zeros(N_STEPS, dtype=bool), np.arange(N_STEPS)
    for begin in begins:
        forced[begin : begin + 2 * DAY] = True
    heat = (log[f"heating:{zone}"] - log[f"cooling:{zone}"]).where(forced)
    off = pd.Series(forced, log.index)
    power = _STEP * floor_areas(plant.document, (zone,))[zone]
    base = plant.respond(zone, heat, np.zeros(N_STEPS), span)
    found = []
    for start in STARTS:
        first = begins + start * STEPS_PER_HOUR
        on = ((rows[:, None] >= first) & (rows[:, None] < first + DAY)).any(axis=1)
        moved = plant.respond(zone, heat, np.where(on, power, 0.0), span)
        gain = _difference(base, moved, zone, off, power).reindex(log.index).to_numpy()
        for day, row in zip(days, first, strict=True):
            about = {"zone": tested.name, "season": season, "day": day.date(), "start_h": start}
            found.append(
                about | {f"K_per_kW_{lead:g}h": gain[row - 1 + round(lead * STEPS_PER_HOUR)] for lead in LEADS}
            )
    return pd.DataFrame(found)


def _difference(base: pd.DataFrame, moved: pd.DataFrame, zone: str, off: pd.Series, power: float) -> pd.Series:
    """Warming per kW by a step of so many W, which the plant must not have answered."""
    difference = moved - base
    answer = (difference[f"heating:{zone}"] - difference[f"cooling:{zone}"])[off[base.index]]
    if answer.abs().max() > 0.01 * power:
        raise RuntimeError(f"the plant of {zone} answered a step of {power:.0f} W with {answer.abs().max():.0f} W.")
    return difference[f"T:{zone}"] / (power / 1000.0)
