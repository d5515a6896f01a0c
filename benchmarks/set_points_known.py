"""The forecast benchmark without tomorrow's heat: set-points and weather are known, temperature and load are scored.

``python benchmarks/set_points_known.py`` runs what is missing and writes ``results/set_points_known.md``.  Finished
rows are kept in ``benchmarks/.set_points_known``; ``--again`` repeats them.  Logs that are not beside the checkout are
left out.  Run it on one core (``OMP_NUM_THREADS=1``).

    python benchmarks/set_points_known.py --data "office autumn"         some rows
    python benchmarks/set_points_known.py --buildings FOLDER/dev         buildings that make_buildings.py made
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from datetime import date
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from _forecast_data import SEASONS, chosen
from _reference_data import SHARED, made_buildings
from _report import RESULTS
from sklearn.ensemble import HistGradientBoostingRegressor

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office, read_zone_csv

STORE = Path(__file__).parent / ".set_points_known"
DAY, STEP = 96, pd.Timedelta("15min")
BOOSTED = {"max_iter": 200, "learning_rate": 0.06, "l2_regularization": 1.0, "random_state": 0}
LEVELS = (0.1, 0.9)
_COLUMNS = {
    "T_oa": "T_out_degC",
    "q_sol": "ghi_kW_m2",
    "Q_hvac": "q_hvac_kW",
    "T_za": "T_in_degC",
    "T_heat_set": "set_heat_degC",
    "T_cool_set": "set_cool_degC",
}
SETPOINTS = ["T_heat_set", "T_cool_set"]
_RUNS = 0.02  # of the highest load, from which on a plant runs
RULES = ("last week", "yesterday", "mean by hour and day kind")
BOOSTING, DEFAULT = "gradient boosting", "default"


class Log(NamedTuple):
    """Training rows and those after them, the first row of the test among these, and capacities of stages [kW]."""

    train: pd.DataFrame
    later: pd.DataFrame
    start: int
    capacity: dict[str, float]

    def load(self, frame: pd.DataFrame) -> np.ndarray:
        """Heat of the plant [kW]."""
        if not self.capacity:
            return frame["Q_hvac"].to_numpy()
        return frame[list(self.capacity)].to_numpy() @ np.array(list(self.capacity.values()))


def logs(folders: Sequence[Path]) -> dict[str, Callable[[], Log]]:
    """Loaders by name."""
    found: dict[str, Callable[[], Log]] = {}
    if SHARED.is_dir():
        stem = SHARED / "small_office_chicago"
        for season, spans in SEASONS.items():
            for control, file in (("same", "irregular"), ("new", "shifted")):
                found[f"office {season}, {control} control"] = partial(_building, stem, file, spans)
    for climate in ("oakland", "chicago"):
        found[f"make_office {climate}"] = partial(_synthetic, climate)
    for folder in folders:
        for row, spans in made_buildings(folder):
            for control, file in (("same", "irregular"), ("new", "shifted")):
                name = f"{folder.name}: {row['name']} {row['season']}, {control} control"
                found[name] = partial(_building, folder / str(row["name"]), file, spans)
    return found


def _building(stem: Path, file: str, spans: tuple[str, ...]) -> Log:
    """Rows of an EnergyPlus run; where the test is another run, a step between the two is left out."""
    trained, tested = (
        read_zone_csv(stem.with_name(f"{stem.name}_{name}.csv"), _COLUMNS, label="right")
        for name in ("irregular", file)
    )
    train = trained[spans[0] : spans[1]]
    first = train.index[-1] + (STEP if file == "irregular" else 2 * STEP)
    later = tested[tested.index >= first][: spans[3]]
    start = int(later.index.searchsorted(pd.Timestamp(spans[2]).tz_localize(later.index.tz)))
    return Log(train, later, start, {})


def _synthetic(climate: str) -> Log:
    """The paper's office: six weeks, then a week between and four weeks of test."""
    office = make_office(11 * 7, climate, start="2023-09-04", random_state=7000)
    frame = office.X.join(office.setpoints)
    rows = 42 * DAY
    return Log(frame[:rows], frame[rows:], 7 * DAY, {"u_heat": office.theta["Q_h"], "u_cool": office.theta["Q_c"]})


# ------------------------------------------------------------------------------------------------------------- models
class Series(NamedTuple):
    """All rows of a log as arrays, the later ones after the training."""

    load: np.ndarray
    T: np.ndarray
    known: np.ndarray  # (n, 4) set-points, outdoor temperature, irradiance
    clock: np.ndarray  # (n, 3) hour, day of the week, whether it is a weekend

    @classmethod
    def of(cls, log: Log) -> Series:
        frame = pd.concat([log.train, log.later])
        day = frame.index.day_of_week.to_numpy()
        clock = np.column_stack([frame.index.hour + frame.index.minute / 60.0, day, day >= 5])
        known = frame[[*SETPOINTS, "T_oa", "q_sol"]].to_numpy()
        return cls(log.load(frame), frame["T_za"].to_numpy(), known, clock)


def rule(name: str, rows: Series, origins: np.ndarray) -> np.ndarray:
    """(O, 96) load by a naive rule."""
    at = origins[:, None] + np.arange(DAY)
    if name != RULES[2]:
        return rows.load[at - (7 * DAY if name == RULES[0] else DAY)]
    slot = np.round(rows.clock[:, 0] * 4).astype(int) + DAY * rows.clock[:, 2].astype(int)
    out = np.empty(at.shape)
    for i, origin in enumerate(origins):
        count = np.maximum(np.bincount(slot[:origin], minlength=2 * DAY), 1)
        out[i] = (np.bincount(slot[:origin], rows.load[:origin], 2 * DAY) / count)[slot[at[i]]]
    return out


def boosting(rows: Series, begin: int, origins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(O, 96) load and temperature by gradient boosting over pairs of origin and lead, refitted every week."""
    out = np.empty((2, len(origins), DAY))
    for end in range(begin, int(origins[-1]) + 1, 7 * DAY):
        own = (origins >= end) & (origins < end + 7 * DAY)
        if not own.any():
            continue
        fitted = np.repeat(np.arange(7 * DAY, end, 8), 12)
        lead = np.random.default_rng(0).integers(0, DAY, len(fitted))
        inside = fitted + lead + 1 < end
        fitted, lead = fitted[inside], lead[inside]
        X = _features(rows, fitted, lead)
        here, ahead = np.repeat(origins[own], DAY), np.tile(np.arange(DAY), own.sum())
        X_ahead = _features(rows, here, ahead)
        for part, target, level in (
            (0, rows.load[fitted + lead], 0.0),
            (1, rows.T[fitted + lead + 1] - rows.T[fitted], rows.T[here]),
        ):
            booster = HistGradientBoostingRegressor(
                max_iter=200, learning_rate=0.06, l2_regularization=1.0, random_state=0
            )
            out[part, own] = (level + booster.fit(X, target).predict(X_ahead)).reshape(-1, DAY)
    return out[0], out[1]


def _features(rows: Series, origins: np.ndarray, lead: np.ndarray) -> np.ndarray:
    """Features that a data scientist would choose: set-points and their changes, weather, calendar, lags."""
    at = origins + lead
    total = np.concatenate([np.zeros((1, 4)), np.cumsum(rows.known, axis=0)])

    def mean(n: int) -> np.ndarray:
        return (total[at + 1] - total[np.maximum(at + 1 - n, 0)]) / np.minimum(at + 1, n)[:, None]

    now, T = rows.known[at], rows.T[origins]
    ahead = rows.known[np.minimum(at + 4, origins + DAY - 1)][:, :2]
    lags = [
        rows.load[at - DAY],
        rows.load[at - 7 * DAY],
        rows.load[origins - 1],
        rows.T[at + 1 - DAY],
        rows.T[at - 671],
    ]
    columns = [lead, rows.clock[at], now, now - rows.known[at - 1], now - mean(4), now - mean(16), ahead - now[:, :2]]
    columns += [mean(24)[:, 2:], mean(DAY), T, T - now[:, 0], T - now[:, 1], *lags]
    columns += [now[:, :3] - rows.known[at - DAY][:, :3], now[:, :3] - rows.known[at - 7 * DAY][:, :3]]
    return np.column_stack(columns)


# --------------------------------------------------------------------------------------------------------------- runs
def rmse(error: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(error))))


def assess(log: Log) -> dict[str, float]:
    """Errors of every model on one row, from an origin every 7 hours."""
    begin = time.perf_counter()
    rows, n_train = Series.of(log), len(log.train)
    origins = np.arange(log.start, len(log.later) - DAY - 1, 28)
    whole = origins + n_train
    at = whole[:, None] + np.arange(DAY)
    load, T = rows.load[at], rows.T[at + 1]
    found = {f"load, {name}": rmse(rule(name, rows, whole) - load) for name in RULES}
    of_load, of_T = boosting(rows, n_train, whole)
    found |= {f"load, {BOOSTING}": rmse(of_load - load), f"T, {BOOSTING}": rmse(of_T - T)}
    model = HybridPredictor(known={"Q_h": 6.0} if log.capacity else None, random_state=0)
    model.fit(log.train, log.train["T_za"])
    given = model.predict_from(log.later, origins)
    loop = model.closed_loop_from(log.later, origins, quantiles=LEVELS)
    least = _RUNS * np.abs(rows.load).max()
    runs = (np.abs(load) > least) | (np.abs(loop.paths.heat) > least)
    found |= {
        "T, heat given": rmse(given - T),
        f"load, {DEFAULT}": rmse(loop.paths.heat - load),
        f"T, {DEFAULT}": rmse(loop.paths.temperature - T),
        "coverage of the load": _coverage(loop.heat_bands, load),
        "coverage while it runs": _coverage(loop.heat_bands, load, runs),
        "coverage of T": _coverage(loop.temperature_bands, T),
        "seconds": time.perf_counter() - begin,
    }
    return found


def _coverage(bands: np.ndarray, measured: np.ndarray, chosen: np.ndarray | bool = True) -> float:
    inside = (bands[..., 0] <= measured) & (measured <= bands[..., 1])
    return float(np.mean(inside, where=chosen))


def table(runs: dict[str, dict[str, float]]) -> str:
    """The result as text."""
    head = ["row", *RULES, BOOSTING, DEFAULT, "/ best rule", "/ boosting", "cov.", "cov. running"]
    head += ["T heat given", BOOSTING, DEFAULT, "/ heat given", "cov."]
    lines = [" | ".join(head), " | ".join(["---"] * len(head))]
    for name, run in runs.items():
        rules, ours = [run[f"load, {r}"] for r in RULES], run[f"load, {DEFAULT}"]
        T = [run["T, heat given"], run[f"T, {BOOSTING}"], run[f"T, {DEFAULT}"]]
        boosted = run[f"load, {BOOSTING}"]
        cells = [*rules, boosted, ours, ours / min(rules), ours / boosted]
        cells += [run["coverage of the load"], run["coverage while it runs"]]
        cells += [*T, T[2] / T[0], run["coverage of T"]]
        lines.append(" | ".join([name, *(f"{value:.2f}" for value in cells)]))
    return "\n".join(f"| {line} |" for line in lines)


def options_of(doc: str | None, store: Path, arguments: list[str] | None) -> argparse.Namespace:
    """Options of a study of these logs, whose store is made."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of the names of rows")
    parser.add_argument("--buildings", type=Path, nargs="+", default=[], help="folders that make_buildings.py made")
    parser.add_argument("--again", action="store_true", help="repeat what is kept")
    parser.add_argument("--store", type=Path, default=store)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    options.store.mkdir(parents=True, exist_ok=True)
    return options


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the table."""
    options, runs = options_of(__doc__, STORE, arguments), {}
    loaders = logs(options.buildings)
    wanted = chosen(list(loaders), options.data)
    for name, load in loaders.items():
        path = options.store / f"{name.replace(': ', '_')}.json"
        if name in wanted and (options.again or not path.is_file()):
            path.write_text(json.dumps(assess(load())), encoding="utf-8")
            print(name, path.read_text(encoding="utf-8"), flush=True)
        if path.is_file():
            runs[name] = json.loads(path.read_text(encoding="utf-8"))
    text = (
        "# Only set-points are known\n\nWeather and set-points are known a day ahead, heat is not: the thermostat acts "
        "inside the forecast.\nRMSE of the load [kW, 15 min] and of the temperature [K] over all leads to 24 h, an "
        'origin every 7 h;\n"/" are ratios of the default to others, "cov." the share inside the 80 % interval, '
        '"running" that of\nrows in which the plant gives, or is forecast to give, 2 % of its highest load (one of 0 '
        "lies in most intervals).\n"
        f"{date.today()}, one core,\n`{' '.join(['python benchmarks/set_points_known.py', *sys.argv[1:]])}`.\n\n"
    )
    (options.results / "set_points_known.md").write_text(text + table(runs) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
