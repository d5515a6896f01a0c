"""Logs of the forecast benchmark: training rows, the rows after them, and what is known of site, plant and truth.

A row of the benchmark is a data set.  The later rows begin where the training ended, so a model that keeps learning may
use the time between training and test.  No origin lies before ``start``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from functools import lru_cache, partial
from pathlib import Path

import pandas as pd
from _energyplus import DAYS_OFF as OF_SCHEDULES
from _reference_data import made_buildings, reference

from skhybrid.datasets import load_benchmark, load_dutch_home, read_zone_csv
from skhybrid.datasets._benchmark import CHICAGO, OFFICE_SPANS, cut_log
from skhybrid.datasets._benchmark import LOGS as PUBLIC

#: weather that a facade model reads beside ``q_sol``, if it was logged; not a role of the data contract
BEAM_AND_SKY = ("dni", "dhi")
#: six weeks of training and two months of test of the small office, a week apart (shared/data/README.md, recipes.md B).
SEASONS = {
    "autumn": OFFICE_SPANS,
    "winter": ("2018-02-01", "2018-03-14", "2018-03-22", "2018-05-15"),
    "summer": ("2018-06-01", "2018-07-12", "2018-07-20", "2018-09-12"),
}
#: days on which nobody works in the small office, by run; its users know them ahead
DAYS_OFF = {
    "irregular": ("2018-01-01", "2018-07-04", "2018-11-22", "2018-12-24", "2018-12-25", "2018-12-31"),
    "regular": OF_SCHEDULES,
}
KNOWN = ", calendar known"
_BUILDING_COLUMNS = {
    "T_oa": "T_out_degC",
    "q_sol": "ghi_kW_m2",
    "Q_hvac": "q_hvac_kW",
    "T_za": "T_in_degC",
    "dni": "dni_kW_m2",
    "dhi": "dhi_kW_m2",
}


@dataclass(frozen=True)
class Truth:
    """Quantities that a simulation knows and no model is given, for training and later rows."""

    heat_gain: pd.Series  # all unmeasured heat [kW]
    air: pd.Series  # the part of it that outdoor air brings [kW]
    states: pd.DataFrame  # T_w, T_za without noise [degC]


@dataclass(frozen=True)
class DataSet:
    """One row of the benchmark."""

    name: str
    train: pd.DataFrame  # one column per role with T_za, and BEAM_AND_SKY if logged
    later: pd.DataFrame  # the same of the rows after it: history up to start, then the test
    start: pd.Timestamp  # no origin before it
    origin_step: str
    site: tuple[float, float] | None = None  # latitude, longitude [deg] if the irradiance is global horizontal
    known: Mapping[str, float] = field(default_factory=dict)  # capacity that an identification is given
    capacity: Mapping[str, float] = field(default_factory=dict)  # true capacities of stages [kW]
    truth: Truth | None = None
    holidays: tuple[str, ...] | None = None  # given to every model that takes them

    def delivered(self) -> pd.Series | None:
        """Heat delivered in the later rows [kW]; None if only a stage was logged."""
        if "Q_hvac" in self.later:
            return self.later["Q_hvac"]
        return self.later[list(self.capacity)] @ pd.Series(self.capacity) if self.capacity else None

    def limits(self) -> tuple[float, float] | None:
        """The least and most heat of the plant [kW], for lack of a nameplate; None if stages were logged."""
        if "Q_hvac" not in self.later:
            return None
        heat = pd.concat([self.train["Q_hvac"], self.later["Q_hvac"]])
        return min(0.0, float(heat.min())), max(0.0, float(heat.max()))


def data_sets(buildings: Sequence[Path] = ()) -> dict[str, Callable[[int], DataSet]]:
    """Loaders by name; each takes a seed, which matters for synthetic data only.

    Parameters
    ----------
    buildings : sequence of Path
        Folders of further EnergyPlus runs: ``meta.csv`` and ``<name>_{irregular,shifted}.csv``.
    """
    found: dict[str, Callable[[int], DataSet]] = {}
    public = {name: partial(_public, name) for name in PUBLIC}
    for season in SEASONS:
        for control, file in (("same", "irregular"), ("new", "shifted")):
            name = f"office {season}, {control} control"
            found[name] = public.pop(name, partial(_office, season, file))
    found["office autumn, regular occupancy"] = partial(_office, "autumn", "regular")
    for name in [name for name in found if "winter" not in name]:  # no day off lies in training or test of winter
        found[name + KNOWN] = partial(_with_calendar, found[name], "regular" if "regular" in name else "irregular")
    found |= public
    for folder in buildings:
        found |= _fresh(folder)
    return found


def varies(name: str) -> bool:
    """Whether a data set differs from seed to seed."""
    return name.startswith("make_office")


def group_of(name: str) -> str:
    """The folder of a further EnergyPlus run (``dev``, ``held``), else an empty string."""
    return name.partition(": ")[0] if ": " in name else ""


def split(
    name: str,
    training_run: pd.DataFrame,
    test_run: pd.DataFrame,
    spans: tuple[str, str, str, str],
    origin_step: str,
    **facts: object,
) -> DataSet:
    """A data set cut by first and last day of training, first and last day of the test."""
    return DataSet(name, *cut_log(training_run, test_run, spans), origin_step, **facts)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------------ loaders
@lru_cache(maxsize=4)
def _building_run(path: Path) -> pd.DataFrame:
    """A year of EnergyPlus: means moved to the start of their step; the stamps carry the time zone."""
    return read_zone_csv(path, _BUILDING_COLUMNS, label="right")


def _public(name: str, seed: int) -> DataSet:
    """A log of the public benchmark."""
    log = load_benchmark([name], seed=seed)[name]
    facts = {name: getattr(log, name) for name in ("site", "known", "capacity")}
    truth = None if log.truth is None else Truth(**log.truth)
    return DataSet(log.name, log.train, log.later, log.start, log.origin_step, **facts, truth=truth)


def office_run(file: str) -> pd.DataFrame:
    """A year's run of the small office: irregular, shifted or regular."""
    return _building_run(reference(f"small_office_chicago_{file}.csv", "choose other rows with --data"))


def _office(season: str, file: str, seed: int) -> DataSet:
    name = f"office {season}, " + {"irregular": "same control", "shifted": "new control"}.get(file, "regular occupancy")
    training_run = office_run("irregular" if file == "shifted" else file)
    test_run = office_run(file) if file == "shifted" else training_run
    return split(name, training_run, test_run, SEASONS[season], "7h", site=CHICAGO)


def _with_calendar(load: Callable[[int], DataSet], people: str, seed: int) -> DataSet:
    data = load(seed)
    return replace(data, name=data.name + KNOWN, holidays=DAYS_OFF[people])


def read_home(number: int) -> pd.DataFrame:
    """A Dutch home; the heating signal as a share of its highest value."""
    return load_dutch_home(number).X


def chosen(names: list[str], wanted: list[str] | None) -> list[str]:
    """Names that equal or match (``*``) a wanted one, or begin with it if no name does."""
    if wanted is None:
        return names
    found: set[str] = set()
    for text in wanted:
        same = [n for n in names if fnmatch(n, text)] or [n for n in names if n.startswith(text)]
        if not same:
            raise SystemExit(f"nothing is called {text!r}; there are {', '.join(names)}.")
        found.update(same)
    return [n for n in names if n in found]


# ------------------------------------------------------------------------------------------------ further buildings
def _fresh(folder: Path) -> dict[str, Callable[[int], DataSet]]:
    """One data set per building, season and control of a folder that ``make_buildings.py`` wrote."""
    found: dict[str, Callable[[int], DataSet]] = {}
    for row, spans in made_buildings(folder):
        site = (float(row["latitude"]), float(row["longitude"]))
        for control, file in (("same", "irregular"), ("new", "shifted")):
            name = f"{folder.name}: {row['name']} {row['season']}, {control} control"
            found[name] = partial(_fresh_run, name, folder / str(row["name"]), file, spans, site)
    return found


def _fresh_run(name: str, stem: Path, file: str, spans: tuple, site: tuple[float, float], seed: int) -> DataSet:
    training_run = _building_run(stem.with_name(f"{stem.name}_irregular.csv"))
    test_run = training_run if file == "irregular" else _building_run(stem.with_name(f"{stem.name}_{file}.csv"))
    return split(name, training_run, test_run, spans, "7h", site=site)
