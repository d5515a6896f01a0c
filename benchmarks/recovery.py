"""Recovery of the paper's office over unused seeds, beside two Cramer-Rao bounds.

Writes ``results/recovery.md``: ``python benchmarks/recovery.py``.  Fits and bounds that ``results/recovery.csv``
and ``results/recovery_bounds.csv`` have are not made again: remove these files, or rows of them, to begin anew.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from _cramer_rao import NAMES, bound, statistics
from _information import bound as bound_likewise
from _report import write_table

from skhybrid import InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning

START = {"oakland": "2023-07-08", "chicago": "2023-10-07"}
#: the periodic model with a variance of its own every three hours, as the bound 'likewise' has it
FINE = "Periodic 3h"
METHODS = {
    "ID": InputDisturbanceID(n_starts=10),
    "OD": OutputDisturbanceID(n_starts=10),
    "Periodic": PeriodicDisturbanceID(),
    FINE: PeriodicDisturbanceID(variance="3h"),
}
FIRST_SEED = 5000
#: signed errors [%], one row per fit, from which the tables are made
ROWS = Path(__file__).parent / "results" / "recovery.csv"
BOUNDS = ROWS.with_name("recovery_bounds.csv")
#: what a bound presumes of the gain
KNOWN, LIKEWISE = "statistics of the gain known", "gain modelled likewise"
KEYS = ["scene", "climate", "method", "seed"]
#: settings of the office, and what is known
SCENES = {
    "office": ({}, {"Q_h": 6.0}),
    "no gain": ({"pattern": "none"}, {"Q_h": 6.0}),
    "home": ({"pattern": "home"}, {"Q_h": 6.0}),
    "shop": ({"pattern": "shop"}, {"Q_h": 6.0}),
    "no perturbed weekend": ({"excitation": None}, {"Q_c": -6.0}),
    "four weeks": ({"n_days": 28}, {"Q_h": 6.0}),
    "5-min inputs, 15-min outputs": ({"sampling_time": "5min"}, {"Q_h": 6.0}),
}
TARGETS = pd.Series({"C_w": 5, "C_za": 2, "R_zw": 3, "R_zo": 10, "f": 15, "A_win": 10, "Q_c": 2}, dtype=float)


def one(method: str, climate: str, seed: int, settings: dict, known: dict) -> dict[str, object]:
    """Relative errors [%] of one method on one office."""
    office = make_office(climate=climate, start=START[climate], random_state=FIRST_SEED + seed, **settings)
    X, y = office.X, office.y
    if settings.get("sampling_time") == "5min":
        y = y.where(np.arange(len(y)) % 3 == 0)
        X = X.assign(T_za=y)
    model = METHODS[method].set_params(known=known, random_state=seed, max_missing=0.7)
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model.fit(X, y)
    seconds = time.perf_counter() - begin
    errors = {n: 100 * (model.theta_[n] / v - 1) for n, v in office.theta.items()}
    errors["R_zo eff."] = 100 * (model.theta_["R_zo"] / office.theta_effective["R_zo"] - 1)
    return {"climate": climate, "method": method, **errors, "seconds": seconds}


def run(scene: str, seeds: int, methods: list[str], fit: bool = True) -> pd.DataFrame:
    """Signed errors of all seeds of a scene, in both climates; fits that :data:`ROWS` has are not made again.

    Without ``fit`` none is made, and what is not there is left out.
    """
    settings, known = SCENES[scene]
    done = pd.read_csv(ROWS) if ROWS.exists() else pd.DataFrame(columns=KEYS)
    there = set(done[KEYS].itertuples(index=False, name=None))
    for climate in START:
        for method in methods:
            for seed in range(seeds if fit else 0):
                if (scene, climate, method, FIRST_SEED + seed) in there:
                    continue
                row = {"scene": scene, "seed": FIRST_SEED + seed, **one(method, climate, seed, settings, known)}
                pd.DataFrame([row]).round(5).to_csv(ROWS, mode="a", header=not ROWS.exists(), index=False)
            print(scene, climate, method, flush=True)
    frame = pd.read_csv(ROWS)
    wanted = frame["seed"].sub(FIRST_SEED).between(0, seeds - 1) & frame["method"].isin(methods)
    frame = frame[(frame["scene"] == scene) & wanted]
    order = {name: place for place, name in enumerate([*START, *METHODS])}
    return frame.sort_values(KEYS[1:3], key=lambda names: names.map(order)).drop(columns=["scene", "seed"])


def medians(frame: pd.DataFrame) -> pd.DataFrame:
    """Median absolute errors by climate and method."""
    return frame.set_index(["climate", "method"]).abs().groupby(level=[0, 1], sort=False).median()


def bounds(scene: str, offices: int) -> pd.DataFrame:
    """Both Cramer-Rao standard deviations [%] in both climates, mean over offices with seeds of their own.

    They are kept in :data:`BOUNDS`, and not computed again where that has them.
    """
    settings, _ = SCENES[scene]
    done = pd.read_csv(BOUNDS) if BOUNDS.exists() else pd.DataFrame(columns=["scene", "climate"])
    for climate, start in START.items():
        if ((done["scene"] == scene) & (done["climate"] == climate)).any():
            continue
        known = statistics(range(940, 980), climate=climate, start=start, **settings)
        for seed in range(900, 900 + offices):
            office = make_office(climate=climate, start=start, random_state=seed, **settings)
            for presumed, found in ((KNOWN, bound(office, known)), (LIKEWISE, bound_likewise(office))):
                row = {"scene": scene, "climate": climate, "presumed": presumed, "seed": seed, **found}
                pd.DataFrame([row]).round(5).to_csv(BOUNDS, mode="a", header=not BOUNDS.exists(), index=False)
    found = pd.read_csv(BOUNDS)
    found = found[found["scene"] == scene].drop(columns=["scene", "seed"])
    return found.groupby(["presumed", "climate"], sort=False).mean()


def beside_bounds(frame: pd.DataFrame, crb: pd.DataFrame, method: str = FINE) -> pd.DataFrame:
    """Median error, 0.67 times each bound, and their ratio; R_zo against what can be told from infiltration."""
    found = medians(frame[frame["method"] == method]).droplevel("method")
    found = found.drop(columns="R_zo").rename(columns={"R_zo eff.": "R_zo"})[list(NAMES)]
    parts = {"median error": found}
    for presumed in (KNOWN, LIKEWISE):
        parts[f"0.67 bound, {presumed}"] = 0.67 * crb.loc[presumed]
        parts[f"ratio, {presumed}"] = found / (0.67 * crb.loc[presumed])
    return pd.concat(parts, names=["what"]).swaplevel().sort_index(level=0, sort_remaining=False)


def note(seeds: int, scene_seeds: int) -> str:
    """Note on what the tables mean."""
    return (
        f"14 days with a perturbed first weekend, noise 0.03 K, Q_h known; {seeds} seeds per row from {FIRST_SEED} on "
        f"({scene_seeds} in the other scenes).  R_zo is against the nominal 9 K/kW, 'R_zo eff.' against 8.396 K/kW, "
        "which infiltration at all hours makes of it and nothing measured can tell apart (without gain there is none, "
        "and both are the same).  'No perturbed weekend' knows Q_c instead of Q_h.\n\n"
        "The bounds are standard deviations of unbiased estimates, 0.67 of which is the median error of a normal one; "
        f"means over offices with seeds of their own.  '{KNOWN}': the variance by hour and the memory of the gain are "
        "those of many true gains, and only profile and ventilation are to be found; no estimator knows that much.  "
        f"'{LIKEWISE}': the gain is what the estimator with variance='3h' takes it for, where that fits "
        "the true building best, and its "
        "time constant, variances, days, profile, ventilation and noise are to be found, from the estimator's priors "
        "on.  What the true gain is beyond that model is charged by neither.  `python benchmarks/_information.py` "
        "holds the second bound to the spread of the estimates from data that such a gain made."
    )


def main() -> None:
    """Run all and write medians, quartiles and bounds."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--scene-seeds", type=int, default=8)
    parser.add_argument("--no-fits", action="store_true", help="tables of the fits that are in recovery.csv")
    arguments = parser.parse_args()
    fit = not arguments.no_fits
    office = run("office", arguments.seeds, list(METHODS), fit)
    grouped = office.set_index(["climate", "method"]).groupby(level=[0, 1], sort=False)
    tables = {
        "Median absolute relative error [%] and seconds per fit": medians(office),
        "Targets [%]": TARGETS.to_frame("at most").T.rename_axis("target"),
        "Median relative error with its sign [%]": grouped.median(),
        "Interquartile range of the signed error [%]": grouped.quantile(0.75) - grouped.quantile(0.25),
        "Periodic beside the Cramer-Rao bounds, office": beside_bounds(office, bounds("office", 2), "Periodic"),
        "Periodic 3h beside the Cramer-Rao bounds, office": beside_bounds(office, bounds("office", 2)),
    }
    scenes = {}
    for name in list(SCENES)[1:]:
        scenes[name] = run(name, arguments.scene_seeds, ["OD", "Periodic", FINE], fit)
        if name in ("home", "shop"):
            tables[f"Periodic 3h beside the Cramer-Rao bounds, {name}"] = beside_bounds(scenes[name], bounds(name, 1))
    together = pd.concat({name: medians(frame) for name, frame in scenes.items()}, names=["scene"])
    tables["Other scenes: median absolute relative error [%] and seconds per fit"] = together
    write_table(
        "recovery",
        "Recovery of the paper's office",
        f"python benchmarks/recovery.py --seeds {arguments.seeds} --scene-seeds {arguments.scene_seeds}",
        tables,
        note(arguments.seeds, arguments.scene_seeds),
    )


if __name__ == "__main__":
    main()
