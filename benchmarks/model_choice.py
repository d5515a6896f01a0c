"""Error rates of compare_models and of the tests of white errors, on data whose model is known."""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import pandas as pd
from _report import write_table
from sklearn.exceptions import ConvergenceWarning

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.identification import diagnose, make_state_space
from skhybrid.model_selection import compare_models

SMALL = {"C_w": 6.0, "C_za": 1.0, "R_zw": 1.5, "R_zo": 6.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}
#: step of the random walk of heat per row [kW]: over a week it leaves a room habitable
WALK = 0.02


def white_log(network: str, theta: dict[str, float], seed: int) -> tuple[pd.DataFrame, pd.Series]:
    """Ten hourly days of a network with nothing but white noise of 0.05 K on its thermometer."""
    office = make_office(n_days=10, random_state=seed, sampling_time="1h")
    model = make_state_space(network, theta, sampling_time="1h")
    state, y = np.array([20.0, 22.0]), []
    for row in office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy():
        y.append(state[1])
        state = model.A @ state + model.B @ np.append(row, 0.0)
    noisy = pd.Series(y, index=office.X.index) + 0.05 * np.random.default_rng(seed).normal(size=len(y))
    return office.X.assign(T_za=noisy), noisy


def nested(n_seeds: int) -> pd.DataFrame:
    """CONV with 2R2C and 3R2C, where CONV's assumption holds: level and power of the likelihood ratio."""
    rows = []
    for R_wo in (None, 1000.0, 300.0, 100.0):
        network, theta = ("2R2C", SMALL) if R_wo is None else ("3R2C", SMALL | {"R_wo": R_wo})
        p, picked, passed = [], [], []
        for seed in range(n_seeds):
            X, y = white_log(network, theta, seed)
            common = {"known": {"Q_h": 6.0}, "n_starts": 6, "random_state": 0}
            wide = {"R_wo": (0.1, 1e5)}  # the default bound, 40 K/kW, is short of infinity
            models = {"2R2C": GrayBoxRC(**common), "3R2C": GrayBoxRC("3R2C", bounds=wide, **common)}
            found = compare_models(models, X, y)
            p.append(found.tests["p_value"].iloc[0])
            picked.append(found.recommended)
            passed.append(found.diagnostics[network].tests["passed"])
        rows.append(
            {
                "truth": network if R_wo is None else f"{network}, R_wo = {R_wo:g} K/kW",
                "likelihood ratio p < 0.05 [%]": 100 * np.mean(np.array(p) < 0.05),
                "truth recommended [%]": 100 * np.mean(np.array(picked) == network),
                "tests of the truth's errors passed at 1 % [%]": 100 * np.mean(pd.DataFrame(passed).to_numpy()),
            }
        )
    return pd.DataFrame(rows).set_index("truth")


def office(n_seeds: int) -> pd.DataFrame:
    """The office (a 2R2C with unmeasured gains): the recommendation, and all scores on held-out rows."""
    tables, picks = [], []
    for seed in range(100, 100 + n_seeds):
        data = make_office(n_days=14, random_state=seed)
        common = {"known": {"Q_h": 6.0}, "random_state": 0}
        models = {
            "CONV 2R2C": GrayBoxRC(n_starts=8, **common),
            "OD 2R2C": OutputDisturbanceID(n_starts=8, **common),
            "OD 3R2C": OutputDisturbanceID("3R2C", n_starts=8, **common),
            "ID 2R2C": InputDisturbanceID(n_starts=8, **common),
            "ID 3R2C": InputDisturbanceID("3R2C", n_starts=8, **common),
            "Periodic 2R2C": PeriodicDisturbanceID(n_starts=2, **common),
        }
        found = compare_models(models, data.X, data.y)
        truth = pd.Series(data.theta)
        errors = {
            name: float(np.median(np.abs(model.theta_[truth.index] / truth - 1).drop("Q_h")))
            for name, model in found.estimators.items()
            if name.endswith("2R2C") and set(truth.index) <= set(model.theta_.index)
        }
        tables.append(found.table.assign(error=100 * pd.Series(errors)))
        picks.append(found.recommended)
    every = pd.concat(tables)
    columns = {
        "error": "median error of a parameter [%]",
        "cv_log_score": "held-out log score [1/row]",
        "cv_rmse": "held-out day-ahead RMSE [K]",
        "bic": "BIC",
        "acf_outside": "autocorrelations outside 95 % [-]",
    }
    out = every.groupby(level=0, sort=False)[list(columns)].median().rename(columns=columns)
    out.insert(0, "recommended [of " + str(n_seeds) + "]", [picks.count(name) for name in out.index])
    return out.sort_index()


def white_level(n_seeds: int) -> pd.DataFrame:
    """Tests of the errors of the right model of a random walk of heat, with a tenth of the rows missing."""
    passed = []
    for seed in range(n_seeds):
        rng, data = np.random.default_rng(seed), make_office(n_days=7, random_state=seed)
        model = make_state_space("2R2C", data.theta)
        state, heat, y = np.array([22.0, 22.0]), 0.0, []
        for row in data.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy():
            y.append(state[1] + 0.02 * rng.normal())
            state = model.A @ state + model.B @ np.append(row, heat)
            heat += WALK * rng.normal()
        X = data.X.assign(T_za=np.where(rng.uniform(size=len(y)) < 0.1, np.nan, y))
        known = data.theta | {"sigma_x": 1e-6, "sigma_zeta": WALK}
        found = diagnose(InputDisturbanceID(known=known, measurement_sd=0.02).fit(X, X["T_za"]), X)
        passed.append(found.tests["p_value"])
    p = pd.DataFrame(passed)
    return pd.DataFrame({f"p < {level:g} [%]": 100 * (p < level).mean() for level in (0.05, 0.01)})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--office-seeds", type=int, default=10)
    args = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.simplefilter("ignore", UserWarning)
    tables = {
        "Nested networks, white noise": nested(args.seeds),
        "Tests of the right model's errors, 10 % of the rows missing": white_level(args.seeds),
        "The office with unmeasured gains, 14 days": office(args.office_seeds),
    }
    print(
        write_table(
            "model_choice",
            "Choice of a model",
            f"python benchmarks/model_choice.py --seeds {args.seeds} --office-seeds {args.office_seeds}",
            tables,
            "`compare_models` with its defaults; medians over seeds.",
        )
    )


if __name__ == "__main__":
    main()
