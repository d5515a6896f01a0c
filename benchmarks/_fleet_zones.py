"""Zones of the study of fleet priors: logs of one kind of columns, each with its building and a nameplate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pandas as pd
from _buildings import BUILDINGS
from _reference_data import SHARED, reference

from skhybrid.datasets import load_dutch_home, make_house, make_office, read_zone_csv

DAYS = 42  # of training of a zone of the fleet
_ROLES = {"T_oa": "T_out_degC", "q_sol": "ghi_kW_m2"}
_BOILER = 8.0  # assumed capacity of a home's boiler, whose log has its signal only [kW]
#: first day of training in the fleet, by turns
STARTS = ("2018-01-08", "2018-05-07", "2018-09-03")
EP_DATES, HOME_DATES = ("2018-02-19", "2018-10-22"), ("2021-12-08", "2021-12-20")
#: beginnings of the names of buildings, each a model of which all variants are left out together
_MODELS = (
    "apartment", "medium_office", "primary_school", "restaurant", "retail", "small_office", "strip_mall", "warehouse",
)  # fmt: skip
#: whole buildings that joined the fleet last
HELD = tuple(building.name for building in BUILDINGS if building.held_out)
_HOME_STARTS = {1: "2021-11-24", 2: "2021-11-01", 3: "2021-11-01"}


@dataclass(frozen=True)
class Zone:
    """A zone, of which ``load`` gives T_oa, q_sol, Q_hvac [kW] and T_za."""

    name: str
    building: str  # model of building; zones of one are left out together
    load: Callable[[], pd.DataFrame]
    start: str  # first day of training in the fleet
    days: int = DAYS
    dates: tuple[str, ...] = ()  # on which it is a new zone

    def training(self) -> pd.DataFrame:
        """Its rows as a zone of the fleet."""
        first = pd.Timestamp(self.start)
        return between(self.load(), first, first + pd.Timedelta(self.days, unit="D"))

    def nameplate(self) -> float:
        """Its highest heat of all rows, as its nameplate has it [kW]."""
        return float(self.load()["Q_hvac"].abs().max())


def between(rows: pd.DataFrame, first: pd.Timestamp, end: pd.Timestamp) -> pd.DataFrame:
    """The rows of some local days."""
    local = rows.index.tz_localize(None) if rows.index.tz is not None else rows.index
    return rows[(local >= first) & (local < end)]


@lru_cache(maxsize=64)
def _energyplus(path: Path, temperature: str, heat: str, label: str) -> pd.DataFrame:
    return read_zone_csv(path, {**_ROLES, "Q_hvac": heat, "T_za": temperature}, label=label)


@lru_cache(maxsize=4)
def _home(number: int) -> pd.DataFrame:
    X = load_dutch_home(number).X
    return X.assign(Q_hvac=_BOILER * X["u_heat"]).drop(columns="u_heat")


def _simulated(X: pd.DataFrame, heat: pd.Series, size: float) -> pd.DataFrame:
    """A log of a building of another size: with all capacitances, conductances and heat times ``size``."""
    return X[["T_oa", "q_sol", "T_za"]].assign(Q_hvac=size * heat)


@lru_cache(maxsize=16)
def _office(seed: int) -> pd.DataFrame:
    climate, pattern = ("oakland", "chicago")[seed % 2], ("office", "home", "shop")[seed % 3]
    start = ("2023-01-09", "2023-10-02")[seed // 2 % 2]
    X = make_office(DAYS, climate, start=start, pattern=pattern, excitation=None, random_state=seed).X
    return _simulated(X, 6.0 * (X["u_heat"] - X["u_cool"]), _size(seed))


@lru_cache(maxsize=16)
def _room(seed: int) -> pd.DataFrame:
    house = make_house(DAYS, 3, ("oakland", "chicago")[seed % 2], start="2023-11-04", random_state=seed)
    room = ("living", "kitchen", "bedroom")[seed % 3]
    X = house.X.rename(columns={f"q_sol_{room}": "q_sol", f"T_za_{room}": "T_za"})
    return _simulated(X, house.heat[f"Q_hvac_{room}"], _size(100 + seed))


def _size(seed: int) -> float:
    return float(np.exp(np.random.default_rng(seed).normal(0.0, 0.8)))


def zones(folder: Path) -> list[Zone]:
    """All zones; ``folder`` as ``make_buildings.py`` and ``make_step_tests.py`` write it."""
    return [*_of_folder(folder), *_small_offices(), *_homes(), *simulated_zones()]


def _of_folder(folder: Path) -> list[Zone]:
    dev = ("apartment_newark", "medium_office_san_francisco", "primary_school_phoenix", "retail_colorado_springs")
    rooms = {
        "apartment_newark": ("m_n1_apartment",),
        "medium_office_san_francisco": ("core_mid", "perimeter_mid_zn_1", "perimeter_mid_zn_3"),
        "retail_colorado_springs": ("front_retail",),
        "small_office_chicago": ("core_zn", "perimeter_zn_1", "perimeter_zn_2", "perimeter_zn_3"),
    }
    new = {"m_n1_apartment", "core_mid", "perimeter_mid_zn_3", "front_retail", "perimeter_zn_1"}
    files = [("dev", name, "", True) for name in (*dev, "small_office_2019_fresno")]
    files += [("steps", name, room, room in new) for name, of in rooms.items() for room in of]
    files += [("held", name, "", True) for name in HELD]
    found = []
    for k, (group, name, room, is_new) in enumerate(files):
        path = folder / group / f"{name}_{room}{'_' * bool(room)}irregular.csv"
        load = partial(_energyplus, path, "T_in_degC", "q_hvac_kW", "right")
        model = next(model for model in _MODELS if name.startswith(model))
        found.append(Zone(f"{name} {room}".strip(), model, load, STARTS[k % 3], dates=EP_DATES if is_new else ()))
    return found


def _small_offices() -> list[Zone]:
    """The office of the reference data, and some of its five rooms in a variant."""
    path = reference("small_office_chicago_irregular.csv", "leave out the small office")
    load = partial(_energyplus, path, "T_in_degC", "q_hvac_kW", "right")
    found = [Zone("office chicago", "small_office", load, STARTS[2])]
    for room, coupling in (("south", "ref"), ("west", "weak"), ("north", "weak")):
        path = SHARED / "zones" / f"small_office_zones_{coupling}_base_1.csv.gz"
        load = partial(_energyplus, path, f"T_{room}_degC", f"Q_{room}_kW", "left")
        dates = ("2018-10-22", "2018-11-26") if room == "south" else ()
        found.append(Zone(f"room {room} {coupling}", "small_office", load, STARTS[2], dates=dates))
    return found


def _homes() -> list[Zone]:
    return [
        Zone(f"dutch home {n}", "real home", partial(_home, n), start, 35, HOME_DATES[1:] if n == 1 else HOME_DATES)
        for n, start in _HOME_STARTS.items()
    ]


def simulated_zones() -> list[Zone]:
    """Offices and rooms of houses of random sizes, which need no files."""
    offices = [
        Zone(f"make_office {s}", "simulated", partial(_office, s), ("2023-01-09", "2023-10-02")[s // 2 % 2])
        for s in range(8)
    ]
    return offices + [Zone(f"make_house {s}", "simulated", partial(_room, s), "2023-11-04") for s in range(6)]
