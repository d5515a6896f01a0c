"""Recovery of the paper's office by the four identifications, over seeds that were used for no choice.

Writes ``results/identification.md``.  About six minutes on one core: ``python benchmarks/bench_identification.py``.
"""

from __future__ import annotations

import argparse
import time
import warnings

import pandas as pd
from _report import write_table

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning

START = {"oakland": "2023-07-08", "chicago": "2023-10-07"}
METHODS = {
    "CONV": GrayBoxRC(n_starts=10),
    "ID": InputDisturbanceID(n_starts=10),
    "OD": OutputDisturbanceID(n_starts=10),
    "Periodic": PeriodicDisturbanceID(),
}


def one(method: str, climate: str, seed: int) -> dict[str, object]:
    """Relative errors [%] of one method on one office."""
    office = make_office(climate=climate, start=START[climate], random_state=1000 + seed)
    model = METHODS[method].set_params(known={"Q_h": 6.0}, random_state=seed)
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model.fit(office.X, office.y)
    seconds = time.perf_counter() - begin
    errors = {n: 100 * abs(model.theta_[n] / v - 1) for n, v in office.theta.items() if n != "Q_h"}
    return {"climate": climate, "method": method, "seed": seed, **errors, "seconds": seconds}


def main() -> None:
    """Run all and write medians with quartiles."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=8)
    seeds = parser.parse_args().seeds
    rows = []
    for climate in START:
        for method in METHODS:
            rows += [one(method, climate, seed) for seed in range(seeds)]
            print(pd.DataFrame(rows[-seeds:]).drop(columns=["climate", "seed"]).groupby("method").median().round(1))
    frame = pd.DataFrame(rows).drop(columns="seed")
    grouped = frame.groupby(["climate", "method"], sort=False)
    spread = grouped.quantile(0.75) - grouped.quantile(0.25)
    write_table(
        "identification",
        "Recovery of the paper's office",
        f"python benchmarks/bench_identification.py --seeds {seeds}",
        {"Median absolute relative error [%] and seconds a fit": grouped.median(), "Interquartile range": spread},
        f"14 days with a perturbed first weekend, noise 0.03 K, Q_h known; {seeds} seeds a row.",
    )


if __name__ == "__main__":
    main()
