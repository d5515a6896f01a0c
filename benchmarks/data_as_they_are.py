"""Effect of missing measurements, steps, slow thermometers and gaps on the identified parameters.

Writes ``results/data_as_they_are.md``: ``python benchmarks/data_as_they_are.py``.  Every condition sees the same
simulated building, weather, gains and thermostat as the complete 15-min log beside it, seed by seed, so its cost
is a paired difference: a bias shows as a mean difference beyond its standard error.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import numpy as np
import pandas as pd
from _report import write_table

from skhybrid import InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.datasets._office import true_system
from skhybrid.exceptions import SkhybridWarning

DAYS, NOISE, BASE, CLEAN = 14, 0.03, "complete, 15 min", "no gain, complete"
NAMES = ("C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_c")
SETTINGS = {"known": {"Q_h": 6.0}, "max_missing": 0.7}
MODELS = {
    "OD": lambda seed: OutputDisturbanceID(**SETTINGS, random_state=seed),
    "ID": lambda seed: InputDisturbanceID(**SETTINGS, random_state=seed),
    "Periodic": lambda seed: PeriodicDisturbanceID(**SETTINGS, random_state=seed),
}
SHIFTS = "Mean shift against the complete 15-min log [%], of no gain against the same"
Log = tuple[pd.DataFrame, pd.Series]


def office(step: str, seed: int) -> Log:
    """The log of one building at a step; the underlying run is the same at every step."""
    log = make_office(DAYS, sampling_time=step, noise_std=NOISE, random_state=3000 + seed)
    return log.X, log.y


def blanked(log: Log, missing: np.ndarray) -> Log:
    """The log without the measurements of some rows."""
    X, y = log
    return X.assign(T_za=X["T_za"].where(~missing)), y.where(~missing)


def at_random(log: Log, seed: int) -> Log:
    """10 % of the measurements lost."""
    return blanked(log, np.random.default_rng(seed).random(len(log[1])) < 0.1)


def lost_day(log: Log, seed: int) -> Log:
    """The measurements of the second Tuesday lost."""
    return blanked(log, np.asarray(log[1].index.normalize() == pd.Timestamp("2023-07-18")))


def every_other(log: Log, seed: int) -> Log:
    """Every second measurement lost."""
    return blanked(log, np.arange(len(log[1])) % 2 == 1)


def slow_thermometer(seed: int) -> Log:
    """Inputs at 5 min, measurements at 15."""
    log = office("5min", seed)
    return blanked(log, np.arange(len(log[1])) % 3 != 0)


def pieces(log: Log, seed: int) -> Log:
    """The rows of two days, inputs and all, are not in the table."""
    X, y = log
    day = X.index.normalize()
    kept = ~np.asarray(day.isin(pd.to_datetime(["2023-07-13", "2023-07-18"])))
    return X[kept], y[kept]


def propagated(seed: int, minutes: int, gain: bool) -> Log:
    """The 5-min run sampled at ``minutes``, temperatures propagated exactly under the run's stages.

    Without the gain the room is colder and no thermostat answers, but the network with its inputs is all there is: what
    a method then loses to missing data is not mixed up with what it loses to people.
    """
    run = make_office(DAYS, sampling_time="5min", noise_std=0.0, random_state=3000 + seed)
    fine, step = run.X.drop(columns="T_za"), min(minutes, 5)
    X = fine.loc[fine.index.repeat(5 // step)]
    X.index = pd.date_range(fine.index[0], periods=len(X), freq=f"{step}min")
    A, B = true_system(step / 60.0)
    heat = np.repeat(run.heat_gain.to_numpy(), 5 // step) * gain
    forcing = np.column_stack([X[["T_oa", "q_sol", "u_heat", "u_cool"]], heat]) @ B.T
    state, room = run.states.to_numpy()[0], np.empty(len(X))
    for k, push in enumerate(forcing):
        room[k] = state[1]
        state = A @ state + push
    rows = minutes // step
    X = X.groupby(np.arange(len(X)) // rows).mean().set_axis(X.index[::rows], axis=0)
    y = pd.Series(room[::rows] + NOISE * np.random.default_rng(seed).standard_normal(len(X)), index=X.index)
    return X.assign(T_za=y), y


CONDITIONS: dict[str, dict[str, Callable[[int], Log]]] = {
    "missing": {
        BASE: lambda seed: office("15min", seed),
        "10 % missing at random": lambda seed: at_random(office("15min", seed), seed),
        "a day missing": lambda seed: lost_day(office("15min", seed), seed),
        "every other row missing": lambda seed: every_other(office("15min", seed), seed),
        "two days cut out": lambda seed: pieces(office("15min", seed), seed),
    },
    "steps": {
        "5-min inputs, 15-min T_za": slow_thermometer,
        "1 min": lambda seed: propagated(seed, 1, True),
        "5 min": lambda seed: office("5min", seed),
        "30 min": lambda seed: office("30min", seed),
        "1 h": lambda seed: office("1h", seed),
    },
    "no gain": {
        f"no gain, {how}": lambda seed, change=change: change(propagated(seed, 15, False), seed)
        for how, change in (
            ("complete", lambda log, seed: log),
            ("10 % missing at random", at_random),
            ("a day missing", lost_day),
            ("every other row missing", every_other),
            ("two days cut out", pieces),
        )
    },
}
MAKERS = {name: make for group in CONDITIONS.values() for name, make in group.items()}


def identified(method: str, condition: str, seed: int) -> dict[str, object]:
    """Errors [%] of one fit, and its standard errors, as logarithms of estimate over truth."""
    X, y = MAKERS[condition](seed)
    truth = make_office(1).theta
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model = MODELS[method](seed).fit(X, y)
    row: dict[str, object] = {"method": method, "condition": condition, "seed": seed}
    row |= {n: 100.0 * float(np.log(np.clip(model.theta_[n] / truth[n], 1e-3, None))) for n in NAMES}
    row |= {f"std {n}": 100.0 * abs(float(model.theta_std_[n] / model.theta_[n])) for n in NAMES}
    return {**row, "seconds": time.perf_counter() - begin}


def sizes(frame: pd.DataFrame) -> pd.DataFrame:
    """Median absolute error [%] by method and condition, and seconds per fit."""
    grouped = frame.assign(**frame[list(NAMES)].abs()).groupby(["method", "condition"], sort=False)
    return grouped[[*NAMES, "seconds"]].median().round(2)


def shifts(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean difference to the complete 15-min log [%], with its standard error over the seeds."""
    out = {}
    for method, mine in frame.groupby("method", sort=False):
        base, clean = (mine[mine["condition"] == name].set_index("seed")[list(NAMES)] for name in (BASE, CLEAN))
        for condition, here in mine.groupby("condition", sort=False):
            if condition in (BASE, CLEAN):
                continue
            difference = here.set_index("seed")[list(NAMES)] - (clean if condition.startswith("no gain") else base)
            difference = difference.dropna()
            spread = difference.std() / np.sqrt(len(difference))
            out[method, condition] = {n: f"{difference[n].mean():+.2f} ± {spread[n]:.2f}" for n in NAMES}
    return pd.DataFrame(out).T.rename_axis(["method", "condition"])


def main() -> None:
    """Run what is requested and write the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--slow-seeds", type=int, default=2, help="seeds of Periodic at 1 min")
    parser.add_argument("--methods", nargs="+", default=list(MODELS), choices=list(MODELS))
    parser.add_argument("--conditions", nargs="+", default=list(MAKERS), choices=list(MAKERS))
    parser.add_argument("--dry", action="store_true", help="print only")
    options = parser.parse_args()
    rows = []
    for method in options.methods:
        for condition in dict.fromkeys([BASE, CLEAN, *options.conditions]):
            slow = method == "Periodic" and condition == "1 min"
            try:
                rows += [identified(method, condition, s) for s in range(options.slow_seeds if slow else options.seeds)]
            except ValueError as error:
                print(f"{method}, {condition}: {error}")
                continue
            done = pd.DataFrame(rows)
            print(sizes(done[done["method"] == method]).tail(1).to_string(header=condition == BASE), flush=True)
    frame = pd.DataFrame(rows)
    spread = frame.groupby(["method", "condition"], sort=False)[[f"std {n}" for n in NAMES]].median().round(2)
    tables = {
        "Median absolute error [%] and seconds per fit": sizes(frame),
        SHIFTS: shifts(frame),
        "Standard error that the fit itself gives, median [%]": spread,
    }
    print(tables[SHIFTS].to_string())
    if not options.dry:
        write_table(
            "data_as_they_are",
            "Data as they are",
            f"python benchmarks/data_as_they_are.py --seeds {options.seeds} --slow-seeds {options.slow_seeds}",
            tables,
            f"{DAYS} days of the paper's office (Oakland, July), noise {NOISE} K, Q_h known; {options.seeds} seeds "
            f"({options.slow_seeds} of Periodic at 1 min); errors are 100 log(estimate / truth).  A shift is paired by "
            "seed and stands with its standard error.",
        )


if __name__ == "__main__":
    main()
