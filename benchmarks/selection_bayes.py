"""Cost of the Bayesian part of model selection, and the effect of groups on the intervals of a regression.

The table is synthetic: the paper's 76 cases of four frameworks, 36 sizes each, ID, with known effects, an effect of
each case that no ingredient explains (0.05 K), and a spread over the sizes (10 %).
"""

from __future__ import annotations

import time

import numpy as np
import pandas as pd
from _report import write_table

from skhybrid.forecasting import list_cases
from skhybrid.forecasting.cases import resolve_case
from skhybrid.model_selection import PatternExpressiveness, RobustnessComparison

TRUE = {"CNN": 0.0, "RNN": 0.0, "LSTM": -0.05, "time": -0.1, "pattern": 0.01, "past-w": 0.0, "future-w": -0.15}


def make_results(n_sizes: int = 36, seed: int = 0) -> pd.DataFrame:
    """One row per candidate."""
    rng = np.random.default_rng(seed)
    rows = []
    for framework, case in list_cases()[["model", "name"]].to_numpy():
        parts = resolve_case(case, framework).ingredients
        centre = 0.9 + sum(TRUE[name] * value for name, value in parts.items()) + TRUE.get(framework.upper(), 0.0)
        centre += 0.05 * rng.standard_normal()
        errors = centre * rng.lognormal(0.0, 0.1, n_sizes)
        rows += [(framework, case, "input", f"{framework}-{case}", size, e) for size, e in enumerate(errors)]
    return pd.DataFrame(rows, columns=["framework", "case", "disturbance", "name", "size", "rmse"])


def timed(make) -> tuple[object, dict[str, float]]:
    wall, cpu = time.perf_counter(), time.process_time()
    fitted = make()
    return fitted, {"seconds": time.perf_counter() - wall, "seconds of the processor": time.process_time() - cpu}


def main() -> None:
    results = make_results()
    RobustnessComparison(by="name", draws=200, tune=200, random_state=0).fit(
        results.query("framework == 'rnn'")
    )  # load
    jobs = {
        "RobustnessComparison": lambda: RobustnessComparison(by="name", random_state=0).fit(results),
        "PatternExpressiveness": lambda: PatternExpressiveness(random_state=0).fit(results),
        "PatternExpressiveness, group='name'": lambda: PatternExpressiveness(group="name", random_state=0).fit(results),
    }
    fitted, costs = {}, {}
    for name, job in jobs.items():
        fitted[name], costs[name] = timed(job)
    plain, grouped = (fitted[name].summary_ for name in list(jobs)[1:])
    effects = pd.DataFrame({"true": pd.Series(TRUE)})
    for label, summary in (("rows", plain), ("groups", grouped)):
        effects[f"mean, {label}"], effects[f"std, {label}"] = summary["mean"], summary["std"]
        effects[f"P(reduces), {label}"] = summary["probability_reduces"]
    write_table(
        "selection_bayes",
        "Bayesian model selection: cost and intervals",
        "python benchmarks/selection_bayes.py",
        {
            f"{len(results)} candidates, {results['name'].nunique()} cases": pd.DataFrame(costs).T,
            "Effects [K]": effects,
        },
        note=__doc__.split("\n\n")[1].replace("\n", " "),
    )


if __name__ == "__main__":
    main()
