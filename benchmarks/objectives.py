"""Two objectives of an identification: one-step errors suit the parameters, day-ahead errors the forecast.

    nice python benchmarks/objectives.py             # 20 offices, CONV, ID and OD under both objectives
    nice python benchmarks/objectives.py --seeds 2   # a quick look

Fourteen days of an office are for training, the next seven for testing.  The seeds (7000 and up) were used for no
choice; half of the offices lie in the July of Oakland, half in the October of Chicago.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import pandas as pd
from _report import write_table
from scipy.stats import t as student

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID
from skhybrid.datasets import make_office

MODELS = {"CONV": GrayBoxRC, "ID": InputDisturbanceID, "OD": OutputDisturbanceID}
OBJECTIVES = ("one_step", "multi_step")
CLIMATES = (("oakland", "2023-07-08"), ("chicago", "2023-10-07"))
NAMES = ["C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_c"]
DAY, N_TRAIN = 96, 14 * 96
NOTE = (
    "2R2C with Q_h known, at most 10 starts, 14 days to train and 7 to test, seeds from 7000 on, half in Oakland's "
    "July, half in Chicago's October.  Forecasts of 24 h: from every midnight as `predict` makes them, and from every "
    "hour.  Centre of the estimates: their mean over the seeds of a climate, which is not the truth where the model is "
    "wrong; an interval can only be honest about the scatter around it."
)


def one(kind: str, objective: str, number: int, first: int) -> dict:
    """Fit one office; errors of its forecasts on the test week, logarithms of the parameters and standard errors."""
    climate, start = CLIMATES[number % 2]
    office = make_office(n_days=21, climate=climate, start=start, random_state=first + number)
    X, y, later, truth = office.X[:N_TRAIN], office.y[:N_TRAIN], office.X[N_TRAIN:], office.y[N_TRAIN:].to_numpy()
    model = MODELS[kind](known={"Q_h": 6.0}, n_starts=10, horizon="1D", random_state=0, objective=objective)
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(X, y)
    seconds = time.perf_counter() - begin
    origins = np.arange(0, len(later) - DAY, 4)
    hourly = model.predict_from(later, origins) - truth[origins[:, None] + np.arange(1, DAY + 1)]
    theta = np.log(model.theta_.abs())
    return {
        "model": kind,
        "objective": objective,
        "seed": first + number,
        "climate": climate,
        "midnight": float(np.sqrt(np.mean((model.predict(later) - truth) ** 2))),
        "hourly": float(np.sqrt(np.mean(hourly**2))),
        "seconds": seconds,
        **{f"error_{n}": float(theta[n] - np.log(abs(office.theta_effective[n]))) for n in NAMES},
        **{f"log_{n}": float(theta[n]) for n in NAMES},
        **{f"std_{n}": float(model.theta_std_[n] / abs(model.theta_[n])) for n in NAMES},
    }


def forecasts(runs: pd.DataFrame) -> pd.DataFrame:
    """Root mean square errors over the offices, and how often the other objective was no better."""
    rows = []
    for (kind, objective), mine in runs.groupby(["model", "objective"], sort=False):
        other = runs[(runs["model"] == kind) & (runs["objective"] != objective)].set_index("seed")
        row = {"model": kind, "objective": objective}
        for name in ("midnight", "hourly"):
            row[f"{name} RMSE [K]"] = float(np.sqrt((mine[name] ** 2).mean()))
            row[f"{name} median [K]"] = float(mine[name].median())
            row[f"{name} better on"] = int((mine.set_index("seed")[name] < other[name]).sum())
        rows.append({**row, "offices": len(mine), "median fit [s]": float(mine["seconds"].median())})
    return pd.DataFrame(rows).set_index("model")


def parameters(runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Distance from the truth, and what the standard errors say of the scatter."""
    quantile, tables = float(student.ppf(0.95, 13)), {}
    groups = list(runs.groupby(["model", "objective"], sort=False))
    for title, measure in {
        "Median distance from the truth [%]": lambda m, n: 100 * float(np.expm1(m[f"error_{n}"].abs().median())),
        "Coverage of the centre of the estimates by intervals of 90 % [%]": lambda m, n: (
            100 * float((_off_centre(m, n).abs() <= quantile * m[f"std_{n}"]).mean())
        ),
        "Median standard error over scatter [-]": lambda m, n: float(m[f"std_{n}"].median()) / _scatter(m, n),
    }.items():
        rows = [{"model": k, "objective": o, **{n: measure(mine, n) for n in NAMES}} for (k, o), mine in groups]
        tables[title] = pd.DataFrame(rows).set_index("model")
    return tables


def _off_centre(runs: pd.DataFrame, name: str) -> pd.Series:
    return runs[f"log_{name}"] - runs.groupby("climate")[f"log_{name}"].transform("mean")


def _scatter(runs: pd.DataFrame, name: str) -> float:
    """Around the centre of each climate; NaN if there is one office per climate."""
    return float(np.sqrt((_off_centre(runs, name) ** 2).sum() / max(len(runs) - len(CLIMATES), 1))) or np.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=7000, help="first seed")
    parser.add_argument("--no-write", action="store_true", help="leave the committed table as it is")
    given = parser.parse_args()
    rows = []
    for kind in MODELS:
        for number in range(given.seeds):
            rows += [one(kind, objective, number, given.first) for objective in OBJECTIVES]
            print(rows[-1]["seed"], kind, *(f"{r['midnight']:.3f} {r['hourly']:.3f}" for r in rows[-2:]), flush=True)
    runs = pd.DataFrame(rows)
    tables = {"Forecasts of a day": forecasts(runs), **parameters(runs)}
    for title, found in tables.items():
        print(f"\n{title}\n{found.round(3).to_string()}")
    if not given.no_write:
        title = "Errors one step ahead and errors of a day ahead as objectives"
        write_table("objectives", title, "python benchmarks/objectives.py", tables, NOTE)


if __name__ == "__main__":
    main()
