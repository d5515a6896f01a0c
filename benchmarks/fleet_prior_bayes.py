"""The prior of a fleet by empirical Bayes and by full Bayes (PyMC), compared on the zones that it is made for.

``python benchmarks/fleet_prior_bayes.py`` takes the simulated zones of ``fleet_prior.py`` and writes
``results/fleet_prior_bayes.md``, in about fifteen minutes.  Two zones at a time are new; the others are the fleet.
The regression is a small ARX, for which NUTS is quick.  Full Bayes takes the mean of the coefficients and their spread
along the axes of their covariance for unknown; empirical Bayes, which ``FleetPrior`` does, for known once EM has found
them.
"""

from __future__ import annotations

import argparse
import logging
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import arviz
import numpy as np
import pandas as pd
import pymc as pm
from _fleet_zones import simulated_zones
from _report import write_table
from fleet_prior import error

from skhybrid import ARXRegressor
from skhybrid.fleet import FleetPrior
from skhybrid.forecasting.arx_prior import ARXPrior, shared_sums

DAYS, NEW_AT_ONCE = (1, 3, 7), 2
FIRST = 7  # days of a zone's log before its first data as a new zone
NONE, EMPIRICAL, FULL = "no prior", "empirical Bayes", "full Bayes"
SETTINGS = {"n_lags": 4, "n_input_lags": 2, "calendar": False, "intervals": False}


class Posterior(NamedTuple):
    """The prior by full Bayes, and how the sampler got there."""

    prior: ARXPrior
    r_hat: float  # the largest
    divergences: int
    seconds: float


def arx(prior: FleetPrior | ARXPrior | None = None) -> ARXRegressor:
    return ARXRegressor(prior=prior, **SETTINGS)


def full_bayes(fleet: Sequence[ARXRegressor], log_plates: np.ndarray, empirical: ARXPrior, n_draws: int) -> Posterior:
    """Sample mean and spread of the coefficients along the axes of the covariance that EM has found."""
    begun = time.perf_counter()
    sums = [model.evidence_.regressions["one_step"] for model in fleet]
    grams, crosses = shared_sums(sums, log_plates)
    sizes, axes = np.linalg.eigh(np.linalg.inv(empirical.precision))
    unit = axes * np.sqrt(sizes)  # in these coordinates EM has mean 0 and covariance 1
    errors = np.linalg.inv(unit.T @ grams @ unit)
    own = np.einsum("nij,nj->ni", errors, (crosses - grams @ empirical.mean) @ unit)
    known = np.linalg.cholesky(errors)
    n, p = own.shape
    with pm.Model():
        mean = pm.Normal("mean", 0.0, 3.0, shape=p)
        spread = pm.HalfNormal("spread", 2.0, shape=p)
        # the rows of a zone know its coefficients well: what they leave open is standard normal
        left_open = pm.Normal("left_open", shape=(n, p))
        coef = own + (known * left_open[:, None, :]).sum(axis=-1)
        pm.Potential("zones", pm.logp(pm.Normal.dist(mean, spread), coef).sum())
        draws = pm.sample(
            n_draws, tune=n_draws, chains=2, cores=1, random_seed=0, progressbar=False, target_accept=0.98
        )
    means, spreads = (draws.posterior[name].to_numpy().reshape(-1, p) for name in ("mean", "spread"))
    predictive = np.diag((spreads**2).mean(axis=0)) + np.cov(means.T)
    r_hat = max(float(arviz.rhat(draws.posterior[name])[name].max()) for name in ("mean", "spread"))
    divergences = int(draws.sample_stats["diverging"].sum())
    prior = replace(
        empirical,
        mean=empirical.mean + unit @ means.mean(axis=0),
        precision=np.linalg.inv(unit @ predictive @ unit.T),
    )
    return Posterior(prior, r_hat, divergences, time.perf_counter() - begun)


def run(n_draws: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of new zones by prior, and what became of each prior."""
    zones = simulated_zones()
    models = [arx().fit(rows := zone.training(), rows["T_za"]) for zone in zones]
    plates = np.array([zone.nameplate() for zone in zones])
    order = np.random.default_rng(0).permutation(len(zones))
    errors, priors = [], []
    for new in np.array_split(order, len(zones) // NEW_AT_ONCE):
        rest = [i for i in range(len(zones)) if i not in new]
        fleet = FleetPrior.learn([models[i] for i in rest], plates[rest])
        empirical = fleet.regressions["one_step"]
        full = full_bayes([models[i] for i in rest], np.log(plates[rest]), empirical, n_draws)
        sd = {NONE: None, EMPIRICAL: empirical, FULL: full.prior}
        spread = [np.sqrt(np.diag(np.linalg.inv(prior.precision))) for prior in (full.prior, empirical)]
        apart = np.abs(full.prior.mean - empirical.mean) / spread[1]
        priors.append(
            {
                "new zones": ", ".join(zones[i].name for i in new),
                "difference of means [sd]": float(np.median(apart)),
                "its largest": float(apart.max()),
                "sd, full / empirical": float(np.median(spread[0] / spread[1])),
                "largest R-hat": full.r_hat,
                "divergences": full.divergences,
                "seconds": full.seconds,
            }
        )
        for i in new:
            for days in DAYS:
                row = {"zone": zones[i].name, "days": days}
                date = str(pd.Timestamp(zones[i].start) + pd.Timedelta(FIRST + days, unit="D"))
                for name, prior in sd.items():
                    sized = None if prior is None else prior.sized(float(np.log(plates[i])), 0.0)
                    row[name] = error(zones[i], date, days, arx(sized))
                errors.append(row)
        print(priors[-1], flush=True)
    return pd.DataFrame(errors), pd.DataFrame(priors).set_index("new zones")


def summary(errors: pd.DataFrame) -> pd.DataFrame:
    """Geometric means of ratios by days of data, and how often full Bayes is the better one."""
    logs = np.log(errors.set_index(["zone", "days"]))
    ratios = {
        "empirical Bayes / no prior": logs[EMPIRICAL] - logs[NONE],
        "full Bayes / no prior": logs[FULL] - logs[NONE],
        "full / empirical": logs[FULL] - logs[EMPIRICAL],
    }
    table = np.exp(pd.DataFrame(ratios).groupby("days").mean())
    by_days = ratios["full / empirical"].groupby("days")
    table["lowest"], table["highest"] = np.exp(by_days.min()), np.exp(by_days.max())
    table["full better"] = [f"{(group < 0).sum()} of {len(group)}" for _, group in by_days]
    table.index = [f"{days} day{'s' * (days > 1)}" for days in table.index]
    return table.rename_axis("data of the new zone")


def main() -> None:
    """Run, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=500, help="of each of two chains, after as many of tuning")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.getLogger("pymc").setLevel(logging.ERROR)
    errors, priors = run(options.draws)
    note = (
        f"{len(errors) // len(DAYS)} simulated zones (make_office and rooms of make_house, of sizes that differ by a "
        f"factor of two), {NEW_AT_ONCE} of them new at a time and the others the fleet.  One-step ARX with 4 lags of "
        "the temperature, 2 of the inputs and no calendar, 15 min; nameplates known.  Full Bayes: mean and spread by "
        "NUTS, 2 chains, along the axes of EM's covariance; the prior of a new zone has the posterior mean of the "
        "covariance and, on top, the uncertainty of the mean.  Errors: RMSE over all leads to 24 h in the two weeks "
        "after the zone's first days, an origin every 7 h, delivered heat known."
    )
    command = f"python benchmarks/fleet_prior_bayes.py --draws {options.draws}"
    tables = {"Ratios of errors": summary(errors), "The two priors": priors}
    print(
        write_table("fleet_prior_bayes", "The prior of a fleet by empirical and by full Bayes", command, tables, note)
    )


if __name__ == "__main__":
    main()
