"""Closed loop on EnergyPlus: what forecasts are worth to a controller, in money and comfort.

A controller decides every hour on the set-points of one zone, in fortnights after the six weeks of training.  MPC plans
a day of heat by linear programming (price with hours of peak, soft comfort band) on a forecast that is affine in that
heat; the thermostat tracks the planned temperatures.  Every controller has the same plan, and differs by its forecast.

``python benchmarks/control.py`` runs what is missing and writes ``results/control.md``, which says what was run.
Finished rows are kept in ``benchmarks/.rows/control`` and published in ``results/control_rows.json``, from which
another machine goes on.  It needs ``pip install skhybrid[energyplus]``; run it on one
core (``OMP_NUM_THREADS=1``).

    python benchmarks/control.py --buildings small_office_chicago --zones Perimeter_ZN_3 --seasons winter --seeds 106
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from _buildings import BUILDINGS, SEASONS, SMALL_OFFICE, Building
from _control_plant import Plant, held_setpoints, row_of, warming_per_kW
from _control_report import write_results
from _controllers import (
    COMFORT,
    DAY,
    Forecaster,
    Impulse,
    Interface,
    Planner,
    closed_loop_error,
    judge,
    prices,
    rule,
    tune,
)
from _energyplus import DAYS_OFF, N_STEPS, YEAR
from _report import RESULTS

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor, OutputDisturbanceID
from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting import WeatherError
from skhybrid.model_selection.single_reading import read_once

STORE = Path(__file__).parent / ".rows" / "control"
PUBLISHED = "control_rows.json"  # beside the tables
TESTED = (
    replace(SMALL_OFFICE, zones=("Perimeter_ZN_3", "Perimeter_ZN_1")),
    replace(BUILDINGS[2], zones=("T SW Apartment", "M N1 Apartment")),
)
SEEDS, FORTNIGHTS = (0, 1), (0, 1, 2)
LOGS = ("plain", "excited")
LEADS = {"15 min": 1, "1 h": 4, "4 h": 16, "12 h": 48, "24 h": 96}
LEAD_IN, TUNED_ON = pd.Timedelta("7D"), 21  # before a run's first day, and days of training on which rules are tuned
INPUTS = ["T_oa", "q_sol", "Q_hvac", "T_za"]
GAINS_KNOWN = "MPC, gains known"


class Maker(NamedTuple):
    """Source of a controller's forecast: an estimator, the way it is asked, and what it may know."""

    estimator: Callable[[], Any]
    forecaster: Callable[[Any], Forecaster] = Interface
    gains: bool = False
    weather: bool = False


def _hybrid(**settings) -> Callable[[], Any]:
    return lambda: HybridPredictor(holidays=DAYS_OFF, intervals=False, random_state=0, **settings)


def _network(model) -> Forecaster:
    return Interface(model, "network")


def _held(model) -> Forecaster:
    return Interface(model, "network", hold=True)


def _multi_step() -> ARXRegressor:
    return ARXRegressor(objective="multi_step", holidays=DAYS_OFF)


STARTS = {"n_starts": 4, "random_state": 0}
DEFAULT = _hybrid()
MAKERS = {
    "MPC, OD": Maker(lambda: OutputDisturbanceID(**STARTS)),
    "MPC, GrayBoxRC": Maker(lambda: GrayBoxRC(**STARTS)),
    "MPC, multi-step ARX": Maker(_multi_step, Impulse),
    "MPC, hybrid": Maker(DEFAULT),
    "MPC, hybrid's network": Maker(DEFAULT, _network),
    "MPC, network, heat held": Maker(DEFAULT, _held),
    GAINS_KNOWN: Maker(DEFAULT, _network, gains=True),
    "MPC, hybrid, weather forecast": Maker(DEFAULT, weather=True),
}
if "purpose" in HybridPredictor().get_params():
    MAKERS["MPC, hybrid for planning"] = Maker(_hybrid(purpose="plan"))
RULES = ("thermostat", "tuned rule", "best rule in hindsight")
CONTROLLERS = (*RULES, *MAKERS)


class Case(NamedTuple):
    """Subject of a row, but for controller and fortnight."""

    building: str
    zone: str
    season: str
    seed: int
    log: str

    @property
    def folder(self) -> str:
        return f"{self.building}/{self.zone}_{self.season}_{self.seed}_{self.log}".replace(" ", "_").lower()


class Bench:
    """A zone in a season: its log, its rules, and runs under a controller."""

    def __init__(self, case: Case, plant: Plant, store: Path) -> None:
        self.case, self.plant, self.store = case, plant, store / case.folder
        spans = [pd.Timestamp(day) for day in SEASONS[case.season]]
        self.train, self.test = (spans[0], spans[1]), (spans[2], spans[3])
        self.band = plant.bands[case.zone]
        year = pd.date_range(f"{YEAR}-01-01", periods=N_STEPS, freq="15min")
        self.price = prices(year, case.season)
        self.models: dict[Any, Any] = {}

    def run(self, first: pd.Timestamp, n_days: int, policy) -> pd.DataFrame:
        """Days under a policy, after some under the thermostat, which are cut off."""
        last = first + pd.Timedelta(days=n_days - 1)
        return self.plant.run(self.case.zone, first - LEAD_IN, last, policy)[first:]

    @cached_property
    def log(self) -> pd.DataFrame:
        """Training and test under the thermostat; of an excited log two weeks of training had random set-points."""
        setpoints = self.band if self.case.log == "plain" else excited(self.band, self.train[1], self.case)
        n_days = (self.test[1] - self.train[0]).days + 2
        return self.run(self.train[0], n_days, held_setpoints(setpoints))

    @property
    def training(self) -> pd.DataFrame:
        return self.log[: row_of(self.train[1]) + DAY - row_of(self.train[0])]

    def setpoints(self, controller: str) -> np.ndarray:
        """Set-points of a rule; the one that is tuned, in training or on all that is tested, is kept."""
        if controller == RULES[0]:
            return self.band
        path = self.store / f"{controller.replace(' ', '_')}.json"
        if not path.is_file():
            weeks = [(self._first(n), 14) for n in FORTNIGHTS]
            if controller == RULES[1]:
                weeks = [(self.train[1] - pd.Timedelta(days=TUNED_ON - 1), TUNED_ON)]
            write_row(path, {"rule": tune(lambda *one: sum(self._cost(one, *span) for span in weeks))})
        return rule(self.band, self.price, self.case.season, *read_row(path)["rule"])

    def _cost(self, one: tuple[int, float], first: pd.Timestamp, n_days: int) -> float:
        """J of days under a rule."""
        policy = held_setpoints(rule(self.band, self.price, self.case.season, *one))
        found = self._judged(self.run(first, n_days, policy))
        return found["cost"] + COMFORT * found["K h"]

    def _first(self, fortnight: int) -> pd.Timestamp:
        return self.test[0] + fortnight * pd.Timedelta("14D")

    def _judged(self, log: pd.DataFrame) -> dict[str, float]:
        rows = slice(row_of(log.index[0]), row_of(log.index[-1]) + 1)
        return judge(log, self.band[rows], self.price[rows])

    def assess(self, controller: str, fortnight: int) -> dict[str, Any]:
        """A fortnight under a controller."""
        first = self._first(fortnight)
        if controller in RULES:
            return self._judged(self.run(first, 14, held_setpoints(self.setpoints(controller))))
        planner = self._planner(MAKERS[controller], first)
        log = self.run(first, 14, planner)
        heat, T = np.full((2, N_STEPS), np.nan)
        rows = slice(row_of(first), row_of(first) + len(log))
        heat[rows], T[rows] = log["Q_hvac"], log["T_za"]
        found = self._judged(log) | closed_loop_error(planner.kept, heat, T)
        step = np.cumsum(planner.kept[0][1].gain[:, ::-1], axis=1)[:, ::-1][:, 0]
        found |= {f"gain {name}": float(step[lead]) for name, lead in LEADS.items()}
        forecast, solved = 1000.0 * np.median(planner.seconds, axis=0)
        return found | {"ms forecast": float(forecast), "ms plan": float(solved)}

    def _planner(self, maker: Maker, first: pd.Timestamp) -> Planner:
        columns = [*INPUTS, "Q_gain"] if maker.gains else INPUTS
        training, log = self.training[columns], self.log[columns]
        key = maker.estimator, maker.gains
        if key not in self.models:
            self.models[key] = maker.estimator().fit(training, training["T_za"])
        forecaster = maker.forecaster(self.models[key])
        forecaster.observe(log[training.index[-1] + log.index.freq : first - log.index.freq])
        inputs = self._year(columns)
        weather = weather_forecasts(inputs, self.case.seed) if maker.weather else None
        power = self.plant.power[self.case.zone] / 1000.0
        return Planner(forecaster, inputs, self.band, self.price, (-power, power), row_of(first), weather)

    def _year(self, columns: list[str]) -> pd.DataFrame:
        """Weather, and gains where they are known, by row of the year; the measured columns are left out."""
        year = pd.date_range(f"{YEAR}-01-01", periods=N_STEPS, freq="15min")
        return self.log[[c for c in columns if c not in ("Q_hvac", "T_za")]].reindex(year)

    def warming(self) -> dict[str, float]:
        """The plant's warming by a kW [K]."""
        leads = np.array(list(LEADS.values()))
        found = warming_per_kW(self.plant, self.case.zone, self.test[0], leads)
        return {f"gain {name}": float(value) for name, value in zip(LEADS, found, strict=True)}


def excited(band: np.ndarray, last: pd.Timestamp, case: Case) -> np.ndarray:
    """Set-points (N, 2) that are random for 4 h each in the two weeks up to a day, the season's one alone."""
    rng = np.random.default_rng(9000 + case.seed)
    out, end = band.copy(), row_of(last) + DAY
    rows = slice(end - 14 * DAY, end)
    draws = np.repeat(rng.uniform(0.0, 1.0, 14 * 6), DAY // 6)
    if case.season == "winter":
        out[rows] = np.column_stack([16.0 + 7.0 * draws, np.full(14 * DAY, 27.0)])
    else:
        out[rows] = np.column_stack([np.full(14 * DAY, 15.6), 21.0 + 6.0 * draws])
    return out


def weather_forecasts(inputs: pd.DataFrame, seed: int) -> Callable[[int, int], pd.DataFrame]:
    """Weather of rows from one on, as forecast in it."""
    known = inputs.dropna()
    table, error, begin = read_once(known, fits=False), WeatherError("medium", seed), row_of(known.index[0])

    def forecast(row: int, n: int) -> dict[str, np.ndarray]:
        seen = error.forecast(table, row - begin, n - 1).inputs
        rows = slice(row - begin, row - begin + n)
        return {role: seen[role][rows] for role in ("T_oa", "q_sol")}

    return forecast


# ------------------------------------------------------------------------------------------------------------- the rows
def write_row(path: Path, row: dict[str, Any]) -> None:
    """Keep a row, completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(row), encoding="utf-8")
    part.replace(path)


def read_row(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def path_of(store: Path, case: Case, controller: str, fortnight: int) -> Path:
    name = "".join(c if c.isalnum() else "_" for c in controller)
    return store / case.folder / f"{name}_{fortnight}.json"


def rows_of(case: Case) -> Iterator[tuple[str, int]]:
    """Controllers and fortnights of a case; what learns nothing has no excited log."""
    for controller in CONTROLLERS if case.log == "plain" else MAKERS:
        for fortnight in FORTNIGHTS:
            yield controller, fortnight


def rules_of_excited(kept: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of rules for the excited logs of which there is a row; they are those of the plain log."""
    about = Case._fields[:-1]
    there = {tuple(row[f] for f in about) for row in kept if row["log"] == "excited"}
    rules = [row for row in kept if row["controller"] in RULES]
    return [row | {"log": "excited"} for row in rules if tuple(row[f] for f in about) in there]


def fill(case: Case, store: Path, bench_of: Callable[[Case], Any], controllers: tuple[str, ...] = CONTROLLERS) -> None:
    """Run what is missing of a case."""
    missing = [r for r in rows_of(case) if r[0] in controllers and not path_of(store, case, *r).is_file()]
    plant = store / case.folder / "plant.json"
    if not missing and plant.is_file():
        return
    bench = bench_of(case)
    for controller, fortnight in missing:
        row = case._asdict() | {"controller": controller, "fortnight": fortnight}
        write_row(path_of(store, case, controller, fortnight), row | bench.assess(controller, fortnight))
        print(case.folder, controller, fortnight, flush=True)
    if not plant.is_file():
        write_row(plant, case._asdict() | bench.warming())


def unpack(results: Path, store: Path) -> None:
    """Put the rows that were published into a store that lacks them."""
    published = results / PUBLISHED
    for name, row in (read_row(published) if published.is_file() else {}).items():
        if not (store / name).is_file():
            write_row(store / name, row)


def pack(results: Path, store: Path) -> None:
    """Publish all rows of a store, so that another machine can go on from them."""
    write_row(
        results / PUBLISHED,
        {path.relative_to(store).as_posix(): read_row(path) for path in sorted(store.rglob("*.json"))},
    )


def matrix() -> list[Case]:
    """Every case, the first ones first."""
    return [
        Case(building.name, zone, season, building.seed + seed, log)
        for seed in SEEDS
        for log in LOGS
        for building in TESTED
        for season in ("winter", "summer")
        for zone in building.zones
    ]


def _bench(store: Path) -> Callable[[Case], Bench]:
    """Benches whose plant is made once per building and seed."""
    plants: dict[tuple[str, int], Plant] = {}

    def bench_of(case: Case) -> Bench:
        key = case.building, case.seed
        if key not in plants:
            plants.clear()
            plants[key] = Plant(_building(case.building), case.seed)
        return Bench(case, plants[key], store)

    return bench_of


def _building(name: str) -> Building:
    return next(b for b in TESTED if b.name == name)


def main(arguments: list[str] | None = None) -> None:
    """Run what is missing, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for field, values in zip(Case._fields, zip(*matrix(), strict=True), strict=True):
        kind = type(values[0])
        parser.add_argument(f"--{field}s", nargs="+", type=kind, choices=list(dict.fromkeys(values)))
    parser.add_argument("--controllers", nargs="+", choices=CONTROLLERS, default=list(CONTROLLERS))
    parser.add_argument("--tables", action="store_true", help="run nothing, write the tables of what is kept")
    parser.add_argument("--store", type=Path, default=STORE)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    if not options.tables and importlib.util.find_spec("pyenergyplus") is None:
        parser.exit(0, "control.py needs EnergyPlus: pip install skhybrid[energyplus]\n")
    warnings.simplefilter("ignore", SkhybridWarning)
    chosen = [getattr(options, f"{field}s") for field in Case._fields]
    unpack(options.results, options.store)
    bench_of = _bench(options.store)
    for case in () if options.tables else matrix():
        if all(values is None or value in values for value, values in zip(case, chosen, strict=True)):
            fill(case, options.store, bench_of, tuple(options.controllers))
    expected = [(case, *row) for case in matrix() for row in rows_of(case)]
    kept = [read_row(path) for case, *row in expected if (path := path_of(options.store, case, *row)).is_file()]
    kept += rules_of_excited(kept)
    plants = [read_row(p) for case in matrix() if (p := options.store / case.folder / "plant.json").is_file()]
    missing = [(case, *row) for case, *row in expected if not path_of(options.store, case, *row).is_file()]
    command = "python benchmarks/control.py"
    write_results(kept, plants, missing, len(expected), command, options.results)
    pack(options.results, options.store)


if __name__ == "__main__":
    main()
