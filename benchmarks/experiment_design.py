"""Planned errors of ``plan_experiment`` against the spread of identifications of new simulated logs.

Writes ``results/experiment_design.md``: ``python benchmarks/experiment_design.py``.  ``--statistics`` prints the gain
of the synthetic office by class instead, which the defaults of ``GainStatistics`` round.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import pandas as pd
from _report import write_table

from skhybrid import PeriodicDisturbanceID
from skhybrid.datasets import make_office, make_prbs, make_weather
from skhybrid.exceptions import SkhybridWarning
from skhybrid.identification import GainStatistics, plan_experiment

START, DAYS, CLIMATE = "2023-10-07", 14, "chicago"
CASES = {"weekend_prbs": ("prbs 2h", 48.0), None: ("none", 0.0)}
CANDIDATES = {"prbs 2h": (4, "2h"), "prbs 30min": (6, "30min"), "prbs 6h": (3, "6h")}


def office_of(weather: pd.DataFrame, excitation: str | None, seed: int):
    """One office under the given weather; the gains, set-points and noise are the seed's."""
    return make_office(DAYS, start=START, weather=weather, excitation=excitation, random_state=2000 + seed)


def statistics(n_days: int = 182) -> pd.DataFrame:
    """Standard deviation of the office's gain around its weekly profile, and its correlation after an hour."""
    gain = make_office(n_days, random_state=5).heat_gain
    hour, weekend = gain.index.hour.to_numpy(), np.asarray(gain.index.day_of_week >= 5)
    rest = gain - gain.groupby([weekend, hour]).transform("mean")
    klass = np.where(weekend, "weekend", np.where((hour >= 6) & (hour < 21), "weekday_day", "weekday_night"))
    rows = {}
    for name in ("weekday_day", "weekday_night", "weekend"):
        mine = rest.where(klass == name)
        rows[name] = {"sd [kW]": mine.std(), "correlation after 1 h": mine.corr(mine.shift(4))}
    return pd.DataFrame(rows).T


def planned(weather: pd.DataFrame):
    """The plan for the office under this weather, and the seconds it took."""
    theta = make_office(1, weather=weather, start=START).theta
    perturbations = {
        name: make_prbs(order, scale, step="5min", low=18.0, high=25.0, random_state=0)
        for name, (order, scale) in CANDIDATES.items()
    }
    usual = office_of(weather.resample("5min").ffill(), None, 0).setpoints.reindex(weather.index, method="ffill")
    begin = time.perf_counter()
    plan = plan_experiment(
        "2R2C",
        theta,
        weather=weather,
        perturbations=perturbations,
        known=["Q_h"],
        setpoints=usual,
        sampling_time="15min",
        gain=GainStatistics(),
        random_state=0,
    )
    return plan, time.perf_counter() - begin


def fitted(weather: pd.DataFrame, excitation: str | None, seed: int) -> dict[str, float]:
    """Logarithm of estimate over truth of every parameter, and of the standard error that the fit itself gives."""
    office = office_of(weather, excitation, seed)
    model = PeriodicDisturbanceID(known={"Q_h": office.theta["Q_h"]}, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model.fit(office.X, office.y)
    names = [n for n in office.theta if n != "Q_h"]
    return {n: float(np.log(np.clip(model.theta_[n] / office.theta[n], 1e-6, None))) for n in names}


def robust_sd(errors: pd.DataFrame) -> pd.Series:
    """Standard deviation from the quartiles, which a stray fit does not move."""
    return (errors.quantile(0.75) - errors.quantile(0.25)) / 1.349


def main() -> None:
    """Plan, identify, compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--statistics", action="store_true")
    options = parser.parse_args()
    if options.statistics:
        print(statistics().round(3))
        return
    weather = make_weather(DAYS, CLIMATE, start=START, step="5min", random_state=7)
    plan, seconds = planned(weather)
    print(plan)
    tables = {"The plan: relative standard errors [%]": plan.table.round(2)}
    for excitation, candidate in CASES.items():
        errors = 100.0 * pd.DataFrame([fitted(weather, excitation, seed) for seed in range(options.seeds)])
        expected = plan.table.loc[candidate].drop(["worst", "worst_error"]).astype(float)
        spread = pd.DataFrame({"planned": expected, "spread": errors.std(), "from quartiles": robust_sd(errors)})
        spread["mean error"] = errors.mean()
        spread["ratio"] = spread["from quartiles"] / spread["planned"]
        tables[f"{candidate[1]:g} h of {candidate[0]}: planned and found [%]"] = spread.T
        print(spread.round(2))
    write_table(
        "experiment_design",
        "Planned errors and errors found",
        f"python benchmarks/experiment_design.py --seeds {options.seeds}",
        tables,
        f"The paper's office, {DAYS} days from {START} in {CLIMATE}, Q_h known; {options.seeds} fresh seeds of gain, "
        f"set-points and noise, identified by PeriodicDisturbanceID.  The plan took {seconds:.1f} s.",
    )


if __name__ == "__main__":
    main()
