"""Buildings, occupancies and set-point plans for tuning and testing the day-ahead forecast.

Every building is run twice with the same weather and people: ``irregular`` keeps the model's set-points (a home gets a
programmable thermostat), ``shifted`` draws new ones every day (a control that the log of ``irregular`` never saw).
Some are run as ``replayed`` too: two days of three they get the heat that the thermostat gave other people under the
same weather and set-points, so that this heat tells nothing of their own; on the third day their thermostat acts, which
keeps the temperature where people would have it.
Everything is drawn from a seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from _energyplus import GAINS, N_STEPS, load_model, prepare, read_schedules, schedules_of, simulate, site

DAY = 96
N_DAYS = N_STEPS // DAY
CONTROLS = ("irregular", "shifted")
REPLAYED = ("irregular", "replayed")
#: season -> first and last day of training and of test; six weeks, a week between, eight weeks.
SEASONS = {
    "autumn": ("2018-09-03", "2018-10-14", "2018-10-22", "2018-12-15"),
    "winter": ("2018-01-08", "2018-02-18", "2018-02-26", "2018-04-21"),
    "summer": ("2018-05-07", "2018-06-17", "2018-06-25", "2018-08-18"),
    # instead of summer, for schools: the long vacation is another question than a day-ahead forecast
    "spring": ("2018-02-26", "2018-04-08", "2018-04-16", "2018-06-09"),
}


@dataclass(frozen=True)
class Building:
    """A zone (or the volume mean of several) of a building model under a climate, with a use and a seed."""

    name: str
    model: str
    climate: str
    zones: tuple[str, ...]
    use: str
    seed: int
    held_out: bool = False
    seasons: tuple[str, ...] = ("autumn", "winter", "summer")


def floor(name: str, core: str) -> tuple[str, ...]:
    return (core, *(f"Perimeter_{name}_ZN_{i}" for i in range(1, 5)))


_CLASSROOMS = tuple(
    f"{room}_Pod_1_ZN_1_FLR_1" for room in ("Corner_Class_1", "Corner_Class_2", "Mult_Class_1", "Mult_Class_2")
)
BUILDINGS = (
    Building(
        "medium_office_san_francisco", "medium_office", "usa_ca_san_francisco", floor("mid", "Core_mid"), "office",
        101,
    ),
    Building("retail_colorado_springs", "standalone_retail", "usa_co_colorado_springs", ("Core_Retail",), "shop", 102),
    Building("apartment_newark", "midrise_apartment", "usa_nj_newark", ("T SW Apartment",), "home", 103),
    Building(
        "primary_school_phoenix", "primary_school", "usa_az_phoenix", _CLASSROOMS, "school", 104,
        seasons=("autumn", "winter", "spring"),
    ),
    Building(
        "small_office_2019_fresno", "ashrae/office_small", "usa_ca_fresno",
        ("Core_ZN", *(f"Perimeter_ZN_{i}" for i in range(1, 5))), "office", 105,
    ),
    Building("strip_mall_las_vegas", "strip_mall", "usa_nv_las_vegas", ("LGstore1",), "shop", 201, True),
    Building(
        "restaurant_sterling", "quick_service_restaurant", "usa_va_sterling", ("Dining",), "restaurant", 202, True,
    ),
    Building("warehouse_denver", "warehouse", "usa_co_denver", ("FineStorage",), "shop", 203, True),
    Building(
        "medium_office_2019_oklahoma", "ashrae/office_medium", "usa_ok_oklahoma", floor("top", "Core_top"), "office",
        204, True,
    ),
    Building(
        "apartment_2019_chicago", "ashrae/apartment_mid_rise", "usa_il_chicago", ("T NE Apartment",), "home", 205, True,
    ),
    Building("retail_2019_tampa", "ashrae/retail_standalone", "usa_fl_tampa", ("Core_Retail",), "shop", 206, True),
)  # fmt: skip
#: the office of the shared tables, with people of its own
SMALL_OFFICE = replace(
    BUILDINGS[4], name="small_office_chicago", model="small_office", climate="usa_il_chicago", seed=106
)
#: those of them whose air loops serve no other room
REPLAYABLE = tuple(
    replace(b, seasons=("autumn", "winter"))
    for b in (SMALL_OFFICE, *(b for b in BUILDINGS if not b.held_out and b.use != "school"))
)


def make_tables(building: Building, controls: tuple[str, ...] = CONTROLS) -> Iterator[tuple[str, pd.DataFrame]]:
    """Tables of a building, control by control, in the columns of ``small_office_chicago_irregular.csv``."""
    from pyenergyplus.dataset import weather_files

    document = prepare(load_model(building.model), weather_files[building.climate])
    names = schedules_of(document, building.zones)
    reference = read_schedules(document, building.climate, tuple(sorted(set().union(*names.values()))))
    kinds = {kind: names[kind] for kind in GAINS}
    gains = occupy(building, kinds, reference)
    volumes = dict.fromkeys(building.zones, 1.0) if len(building.zones) == 1 else floor_areas(document, building.zones)
    for control in controls:
        setpoints: dict[str, np.ndarray] = {}
        if control == "shifted":
            setpoints = plan_setpoints(building, names["heat"], names["cool"], reference)
        elif building.use == "home":
            setpoints = programme_home(names["heat"], names["cool"], reference)
        heat = None
        if control == "replayed":
            others = occupy(replace(building, seed=building.seed + 1000), kinds, reference)
            run = simulate(document, building.climate, building.zones, others | setpoints)
            heat = {zone: _two_of_three(run[f"heating:{zone}"] - run[f"cooling:{zone}"]) for zone in building.zones}
        run = simulate(document, building.climate, building.zones, gains | setpoints, replay=heat)
        yield control, table_of(run, building, volumes, heat)


def _two_of_three(values: pd.Series) -> np.ndarray:
    """Values with NaN on the first day of every three."""
    return np.where(np.arange(N_STEPS) // DAY % 3 > 0, values.to_numpy(), np.nan)


def floor_areas(document: dict, zones: tuple[str, ...]) -> dict[str, float]:
    """Area of the floor of each zone [m2], which is its share in a mean (zones of one mean are of one height)."""
    area = dict.fromkeys(zones, 0.0)
    for surface in document["BuildingSurface:Detailed"].values():
        if surface["zone_name"] in area and surface["surface_type"] == "Floor":
            x, y, z = (
                np.array([v[f"vertex_{axis}_coordinate"] for v in surface["vertices"]]) for axis in ("x", "y", "z")
            )
            corners = np.column_stack([x, y, z])
            area[surface["zone_name"]] += 0.5 * np.linalg.norm(
                np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
            )
    return area


def table_of(
    run: pd.DataFrame, building: Building, volumes: dict[str, float], heat: dict[str, np.ndarray] | None
) -> pd.DataFrame:
    """Columns and units of the shared tables; with replayed heat [W], and whether it was."""
    zones, weights = building.zones, np.array(list(volumes.values()))
    weights = weights / weights.sum()

    def each(key: str) -> np.ndarray:
        return run[[f"{key}:{zone}" for zone in zones]].to_numpy()

    sun = np.sin(np.radians(run["altitude"].to_numpy())).clip(0.0)
    gains = sum(each(f"gain_{part}") for part in ("convective", "radiant", "visible"))
    delivered = each("heating") - each("cooling")
    if heat is not None:  # EnergyPlus counts it among the gains
        forced, replayed = np.isfinite(next(iter(heat.values()))), np.nan_to_num(np.column_stack(list(heat.values())))
        # without a flow of air, the heat that lights give to the return air stays in the zone: EnergyPlus counts it as
        # delivered, a step later
        stays = np.where(forced[:, None], np.roll(each("gain_return"), 1, axis=0), 0.0)
        gains, delivered = gains + stays, delivered - stays
        if np.abs(delivered[forced]).max() > 0.01 * np.abs(replayed).max():
            raise RuntimeError(f"the plant of {building.name} ran while other people's heat was replayed.")
        gains, delivered = gains - replayed, delivered + replayed
    offset = f"{site(building.climate)['time_zone']:+03.0f}:00"
    table = pd.DataFrame(
        {
            "T_in_degC": (each("T") @ weights).round(5),
            "T_out_degC": run["T_out"].round(4).to_numpy(),
            "ghi_kW_m2": ((run["dni"] * sun + run["dhi"]) / 1000.0).round(5).to_numpy(),
            "dni_kW_m2": (run["dni"] / 1000.0).round(5).to_numpy(),
            "dhi_kW_m2": (run["dhi"] / 1000.0).round(5).to_numpy(),
            "set_heat_degC": each("set_heat")[:, 0].round(3),
            "set_cool_degC": each("set_cool")[:, 0].round(3),
            "q_hvac_kW": (delivered.sum(axis=1) / 1000.0).round(5),
            "truth_gains_kW": (gains.sum(axis=1) / 1000.0).round(5),
            "truth_people": each("people").sum(axis=1).round(3),
        },
        index=run.index.tz_localize(offset),
    )
    if heat is not None:
        table["replayed"] = forced.astype(int)
    return table


# ---- people ----------------------------------------------------------------------------------------------------------

#: use -> (AR(1) and sd of the day's level, chance of a day off, sd of arrival [h], sd within the day, share of lights
#: and of equipment that follow people).
_USES = {
    "office": (0.7, 0.22, 0.05, 0.75, 0.15, 0.5, 0.6),
    "school": (0.5, 0.08, 0.04, 0.25, 0.10, 0.3, 0.5),
    "shop": (0.6, 0.25, 0.01, 0.30, 0.25, 0.0, 0.3),
    "restaurant": (0.6, 0.25, 0.01, 0.40, 0.35, 0.0, 0.3),
    "home": (0.5, 0.20, 0.06, 1.00, 0.20, 1.0, 1.0),
}


def occupy(building: Building, names: dict[str, set[str]], reference: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Irregular schedules of gains in place of reference ones, all from one draw of presence."""
    rng = np.random.default_rng(building.seed)
    persistence, spread, off, arrival, within, lights, equipment = _USES[building.use]
    level = _ar1(rng, N_DAYS, persistence, spread)
    level = np.where(rng.random(N_DAYS) < off, 0.1, (1.0 - 0.5 * spread + level).clip(0.15, 1.3))
    shift = np.clip(rng.normal(0.0, arrival, (N_DAYS, 2)), -2.5 * arrival, 2.5 * arrival)
    noise = _ar1(rng, N_STEPS, 0.9, within).reshape(N_DAYS, DAY)
    presence = (level[:, None] * (1.0 + noise)).clip(0.05, 1.5)
    if building.use == "home":
        presence = presence * _life_at_home(rng)
    cooking = _bursts(rng) if building.use == "home" else np.zeros((N_DAYS, DAY))
    follow = {"People": 1.0, "Lights": lights, "ElectricEquipment": equipment, "GasEquipment": equipment}
    schedules = {}
    for kind, share in follow.items():
        for name in sorted(names[kind]):
            days = _warp(reference[name].reshape(N_DAYS, DAY), shift)
            # what runs day and night (stand-by) does not depend on people
            standing = 0.0 if kind == "People" else days.min()
            active = (days - standing) * (1.0 - share + share * presence)
            if kind == "ElectricEquipment":
                active = active + cooking
            schedules[name] = (standing + active).clip(0.0, 2.0).ravel()
    return schedules


def _ar1(rng: np.random.Generator, n: int, persistence: float, spread: float) -> np.ndarray:
    drawn = rng.normal(0.0, spread * np.sqrt(1.0 - persistence**2), n)
    drawn[0] = rng.normal(0.0, spread)
    for i in range(1, n):
        drawn[i] += persistence * drawn[i - 1]
    return drawn


def _warp(days: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Delay mornings by ``shift[:, 0]`` and evenings by ``shift[:, 1]`` [h]; linear in between (10 to 15 h)."""
    hours = (np.arange(DAY) + 0.5) * 24.0 / DAY
    evening = ((hours - 10.0) / 5.0).clip(0.0, 1.0)
    moved = [hours - (1.0 - evening) * early - evening * late for early, late in shift]
    return np.array([np.interp(m, hours, day) for m, day in zip(moved, days, strict=True)])


def _life_at_home(rng: np.random.Generator) -> np.ndarray:
    """Factor on presence: days at home, evenings out, guests, week-ends away and one journey."""
    hours = np.arange(DAY) * 24.0 / DAY
    factor = np.ones((N_DAYS, DAY))
    weekend = np.arange(N_DAYS) % 7 >= 5
    at_home = (rng.random(N_DAYS) < 0.25) & ~weekend
    factor[np.ix_(at_home, (hours >= 8) & (hours < 17))] = 2.5
    out, guests = rng.random(N_DAYS) < 0.2, rng.random(N_DAYS) < 0.1
    factor[np.ix_(out, (hours >= 18) & (hours < 23))] = 0.1
    factor[np.ix_(guests & ~out, (hours >= 17) & (hours < 23))] = 1.8
    for saturday in np.flatnonzero(np.arange(N_DAYS) % 7 == 5):
        if rng.random() < 0.12:
            factor[saturday : saturday + 2] = 0.0
    first = rng.integers(20, 320)
    factor[first : first + rng.integers(5, 10)] = 0.0
    return factor


def _bursts(rng: np.random.Generator) -> np.ndarray:
    """Cooking and washing: at most three per day of 0.5 to 1.5 h, in units of the installed power."""
    days = np.zeros((N_DAYS, DAY))
    for day in range(N_DAYS):
        for chance, hour in ((0.5, 7.5), (0.4, 12.5), (0.7, 18.5)):
            start = round((hour + rng.normal(0.0, 1.0)) * DAY / 24)
            length, size = rng.integers(2, 7), rng.uniform(0.2, 0.8)
            if rng.random() < chance:
                days[day, start : start + length] += size
    return days


# ---- control ---------------------------------------------------------------------------------------------------------


def plan_setpoints(
    building: Building, heat: set[str], cool: set[str], reference: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Set-points that change every day: level, depth of set-back, early start, and load-shift events."""
    rng = np.random.default_rng(building.seed + 5000)
    draws = {
        "heat": rng.uniform(-1.5, 1.0, N_DAYS),
        "cool": rng.uniform(-1.0, 1.5, N_DAYS),
        "depth": rng.uniform(0.0, 1.0, N_DAYS),
        "night": np.where(rng.random(N_DAYS) < 0.5, rng.uniform(1.0, 3.0, N_DAYS), 0.0),
        "early": rng.integers(0, 13, N_DAYS),
    }
    event = _events(rng)
    warm = {name: _plan(reference[name], draws["heat"], draws, 1.0) + event for name in sorted(heat)}
    cold = {name: _plan(reference[name], draws["cool"], draws, -1.0) - event for name in sorted(cool)}
    ceiling = np.max([np.zeros((N_DAYS, DAY)), *warm.values()], axis=0)
    plans = warm | {name: np.maximum(plan, ceiling + 1.5) for name, plan in cold.items()}
    return {name: np.clip(plan, 10.0, 35.0).ravel() for name, plan in plans.items()}


def programme_home(heat: set[str], cool: set[str], reference: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A programmable thermostat: 2 K lower at night, 1.5 K milder on weekdays from 9 to 16 h.

    The models hold one set-point all year, at which a log would hardly show how a home warms and cools.
    """
    hours = np.arange(DAY) * 24.0 / DAY
    night = np.broadcast_to((hours >= 23) | (hours < 6), (N_DAYS, DAY))
    away = ((hours >= 9) & (hours < 16))[None, :] & (np.arange(N_DAYS) % 7 < 5)[:, None]
    lower, higher = np.where(night, 2.0, np.where(away, 1.5, 0.0)).ravel(), np.where(away, 1.5, 0.0).ravel()
    return {n: reference[n] - lower for n in heat} | {n: reference[n] + higher for n in cool}


def _plan(values: np.ndarray, offset: np.ndarray, draws: dict[str, np.ndarray], sign: float) -> np.ndarray:
    """One schedule, ``sign`` +1 heating or -1 cooling: the set-back is towards less of it."""
    days = values.reshape(N_DAYS, DAY)
    best = (sign * days).max()
    on = sign * days > best - 0.5
    early = np.array([_start_early(row, n) for row, n in zip(on, draws["early"], strict=True)])
    setback = draws["depth"][:, None] * (best - sign * days)
    if on.all():  # a model without set-back gets one, on some nights
        hours = np.arange(DAY) * 24.0 / DAY
        early = np.broadcast_to((hours >= 6) & (hours < 23), on.shape)
        setback = np.broadcast_to(draws["night"][:, None], on.shape)
    return sign * (best - np.where(early, 0.0, setback)) + offset[:, None]


def _start_early(on: np.ndarray, steps: int) -> np.ndarray:
    """The first occupied step of a day moved ``steps`` forward."""
    if on.all() or not on.any():
        return on
    first = int(on.argmax())
    moved = on.copy()
    moved[max(first - steps, 0) : first] = True
    return moved


def _events(rng: np.random.Generator) -> np.ndarray:
    """Load shift [K] on the heating set-point: up for an hour or two, then down for one to three; 40 % of days."""
    shift = np.zeros((N_DAYS, DAY))
    for day in range(N_DAYS):
        start, before, length = rng.integers(32, 80), rng.integers(4, 9), rng.integers(4, 13)
        if rng.random() < 0.4:
            shift[day, start - before : start] = 1.0
            shift[day, start : start + length] = -2.0
    return shift
