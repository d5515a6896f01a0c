"""Day-ahead error of a new zone with 1, 3, 7 and 28 days of data, with a prior from a fleet and without one.

``python benchmarks/fleet_prior.py --buildings FOLDER`` (as ``make_buildings.py`` and ``make_step_tests.py`` write it)
runs what is missing, kept in ``benchmarks/.forecast/fleet``, and writes ``results/fleet_prior.md`` and
``fleet_prior.csv``.  A zone of the fleet is fitted on six weeks.  A new zone is one of a model of building that is left
out of the fleet, with all its variants and climates; the next two weeks are its test.

    python benchmarks/fleet_prior.py --buildings FOLDER --part 0/2      the first of two halves, for two processes
    python benchmarks/fleet_prior.py --tables-only
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from _fleet_zones import Zone, between, zones
from _forecast_store import STORE
from _report import RESULTS, write_table
from sklearn.base import BaseEstimator

from skhybrid import HybridPredictor
from skhybrid.fleet import FleetPrior
from skhybrid.model_selection import backtest
from skhybrid.persistence import load_model, save_model

DAYS, TEST_DAYS = (1, 3, 7, 28), 14
DEFAULT, NAMEPLATE, PLAIN = "default", "prior", "prior without nameplate"
KEYS = ["building", "zone", "date", "days", "model"]
_STORE = STORE / "fleet"
_DRAWS = 2000  # of the bootstrap over buildings


def fitted(fleet: Sequence[Zone]) -> dict[str, HybridPredictor]:
    """The zones of the fleet, fitted once."""
    _STORE.mkdir(parents=True, exist_ok=True)
    models = {}
    for zone in fleet:
        path = _STORE / f"{zone.name.replace(' ', '_')}.skops"
        if not path.is_file():
            rows = zone.training()
            save_model(HybridPredictor(intervals=False).fit(rows, rows["T_za"]), path)
        models[zone.name] = load_model(path)
    return models


def error(zone: Zone, date: str, days: int, model: BaseEstimator) -> float | None:
    """Error of a model of a zone that is new on a date [K]; None where the log begins too late."""
    rows, day = zone.load(), pd.Timestamp(date)
    first, end = day - pd.Timedelta(days, unit="D"), day + pd.Timedelta(TEST_DAYS, unit="D")
    train, test = between(rows, first, day), between(rows, day, end)
    if len(train) < 96 * days - 8:
        return None
    frame = backtest(model.fit(train, train["T_za"]), test, test["T_za"], origin_step="7h")
    return float(np.sqrt(np.nanmean((frame["y_pred"] - frame["y_true"]) ** 2)))


def fill(fleet: Sequence[Zone], part: tuple[int, int], store: Path) -> None:
    """Run what is missing of one part of the new zones."""
    done = set() if not store.is_file() else set(map(tuple, read(store)[KEYS].astype(str).to_numpy()))
    models, priors = fitted(fleet), {}
    for zone in [zone for zone in fleet if zone.dates][part[0] :: part[1]]:
        if zone.building not in priors:
            rest = [other for other in fleet if other.building != zone.building]
            priors = {zone.building: FleetPrior.learn([models[z.name] for z in rest], [z.nameplate() for z in rest])}
        prior = priors[zone.building]
        given = {DEFAULT: None, NAMEPLATE: prior.for_nameplate(zone.nameplate()), PLAIN: prior}
        wanted = [(date, days, model) for date in zone.dates for days in DAYS for model in given]
        for date, days, model in wanted:
            key = (zone.building, zone.name, date, days, model)
            if tuple(map(str, key)) in done or (model == PLAIN and days == DAYS[-1]):
                continue
            rmse = error(zone, date, days, HybridPredictor(prior=given[model], intervals=False))
            if rmse is not None:
                with store.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(dict(zip([*KEYS, "rmse"], [*key, rmse], strict=True))) + "\n")


def read(store: Path) -> pd.DataFrame:
    """All runs that are kept."""
    return pd.DataFrame([json.loads(line) for line in store.read_text(encoding="utf-8").splitlines()])


# ------------------------------------------------------------------------------------------------------------ results
def ratios(runs: pd.DataFrame) -> pd.DataFrame:
    """Error as a share of the default's by zone, date, days (rows) and model (columns)."""
    wide = runs.pivot_table(index=KEYS[:-1], columns="model", values="rmse")
    return wide.div(wide[DEFAULT], axis=0).drop(columns=DEFAULT)


def spell_days(days: int) -> str:
    """A number of days in words."""
    return f"{days} day{'s' if days > 1 else ''}"


def summary(shares: pd.Series) -> pd.DataFrame:
    """Geometric mean of shares with its spread over buildings, and how many cases are worse, by days."""
    rng, rows = np.random.default_rng(0), {}
    for days, own in shares.dropna().groupby("days"):
        by_building = [np.log(values.to_numpy()) for _, values in own.groupby("building")]
        drawn = [
            np.concatenate([by_building[i] for i in rng.integers(len(by_building), size=len(by_building))]).mean()
            for _ in range(_DRAWS)
        ]
        low, high = np.exp(np.quantile(drawn, [0.05, 0.95]))
        rows[spell_days(days)] = {
            "share of the default's error": f"{np.exp(np.log(own).mean()):.3f} [{low:.3f}, {high:.3f}]",
            "worse than the default": f"{int((own > 1).sum())} of {len(own)}",
            "best and worst case": f"{own.min():.2f} to {own.max():.2f}",
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("data of the new zone")


def by_building(shares: pd.Series) -> pd.DataFrame:
    """Geometric mean of shares by building and days."""
    logs = np.log(shares.dropna()).rename("log").reset_index()
    table = np.exp(logs.pivot_table(values="log", index="building", columns="days"))
    return table.rename(columns=spell_days).map(lambda v: "" if np.isnan(v) else f"{v:.3f}")


def write_results(store: Path, fleet: Sequence[Zone], folder: Path) -> list[Path]:
    """Write table and CSV of what is kept."""
    runs = read(store).sort_values(KEYS)
    shares = ratios(runs)
    folder.mkdir(parents=True, exist_ok=True)
    csv = folder / "fleet_prior.csv"
    runs.to_csv(csv, index=False, float_format="%.4g")
    first = {zone.name: zone.dates[0] for zone in fleet if zone.dates}
    names, dates = (shares.index.get_level_values(level) for level in ("zone", "date"))
    tuned = np.array([first[name] == date for name, date in zip(names, dates, strict=True)])
    tables = {
        "With the nameplate, all dates": summary(shares[NAMEPLATE]),
        "With the nameplate, first dates (on which constants were chosen)": summary(shares[NAMEPLATE][tuned]),
        "With the nameplate, later dates": summary(shares[NAMEPLATE][~tuned]),
        "Without a nameplate, all dates": summary(shares[PLAIN]),
        "With the nameplate, by the building left out": by_building(shares[NAMEPLATE]),
        "RMSE of the default [K], geometric mean": by_building(
            runs[runs["model"] == DEFAULT].set_index(KEYS[:-1])["rmse"]
        ),
    }
    note = (
        f"{len(fleet)} zones of {len({z.building for z in fleet})} models of building, of which the new zone's is left "
        f"out with all variants; {shares.index.get_level_values('zone').nunique()} new zones on up to two dates.  The "
        "default is that of the same columns (T_oa, q_sol, Q_hvac), with clipping and daily profile.  Training of any "
        "length ends at the date; the next two weeks are the test, an origin every 7 h, delivered heat known.  The "
        "highest heat of a log stands for its nameplate.  Homes are measured; their boiler is taken to have 8 kW.  "
        "Brackets: 90 % of a bootstrap over buildings.  That "
        "the network has no prior from a week of data on was decided with all dates seen."
    )
    command = "python benchmarks/fleet_prior.py --buildings FOLDER"
    return [write_table("fleet_prior", "A new zone with a prior from a fleet", command, tables, note, folder), csv]


def main() -> None:
    """Fill the store, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--buildings", type=Path, default=Path(__file__).parent / ".buildings")
    parser.add_argument("--part", default="0/1", help="which of how many parts of the new zones are run, such as 0/2")
    parser.add_argument("--tables-only", action="store_true", help="write the tables of what is kept")
    options = parser.parse_args()
    fleet, store = zones(options.buildings), _STORE / "runs.jsonl"
    warnings.simplefilter("ignore")
    if not options.tables_only:
        k, n = (int(number) for number in options.part.split("/"))
        fill(fleet, (k, n), store)
    for path in write_results(store, fleet, RESULTS):
        print(path)


if __name__ == "__main__":
    main()
