"""Time and memory of every identification and of ARX on a year of one-minute rows.

Writes ``results/numerics.md`` (half an hour on one core): ``python benchmarks/numerics.py``, or with names of models
only those.  Each model is fitted in a process of its own, one after the other, at low priority.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
import warnings

import numpy as np
import pandas as pd
from _report import write_table

from skhybrid import ARXRegressor, GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.datasets._office import true_system
from skhybrid.exceptions import SkhybridWarning

COMMAND = "python benchmarks/numerics.py"
DAYS, STEP = 365, pd.Timedelta("1min")
#: seconds after which a fit is given up
LIMIT = 1800
MULTI = {"objective": "multi_step"}
MODELS = {
    "CONV": (GrayBoxRC, {}),
    "ID": (InputDisturbanceID, {}),
    "OD": (OutputDisturbanceID, {}),
    "CONV multi-step": (GrayBoxRC, MULTI),
    "ID multi-step": (InputDisturbanceID, MULTI),
    "OD multi-step": (OutputDisturbanceID, MULTI),
    "periodic": (PeriodicDisturbanceID, {}),
    "ARX": (ARXRegressor, {}),
}


def year_of_minutes(n_days: int = DAYS) -> tuple[pd.DataFrame, pd.Series]:
    """The paper's office, simulated exactly at one minute under the inputs of its five-minute log."""
    office = make_office(n_days, sampling_time="5min", noise_std=0.0, random_state=0)
    A, B = true_system(1 / 60)
    inputs = np.repeat(office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy(), 5, axis=0)
    forcing = np.column_stack([inputs, np.repeat(office.heat_gain.to_numpy(), 5)]) @ B.T
    states = np.empty((len(forcing), 2))
    states[0] = office.states.iloc[0]
    for k, v in enumerate(forcing[:-1]):
        states[k + 1] = A @ states[k] + v
    index = pd.date_range(office.X.index[0], periods=len(forcing), freq=STEP)
    X = pd.DataFrame(inputs, index=index, columns=["T_oa", "q_sol", "u_heat", "u_cool"])
    noise = 0.03 * np.random.default_rng(1).standard_normal(len(X))
    X["T_za"] = states[:, 1] + noise
    return X, X["T_za"].copy()


def one(name: str, n_days: int) -> dict[str, object]:
    """Fit and predict with one model; seconds and the peak memory above that of the data."""
    X, y = year_of_minutes(n_days)
    kind, settings = MODELS[name]
    model = kind(**settings) if kind is ARXRegressor else kind(known={"Q_h": 6.0}, random_state=0, **settings)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    model.fit(X, y)
    fitted = time.process_time()
    predicted = model.predict(X)
    end = time.process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = {"fit [s]": fitted - begin, "predict [s]": end - fitted, "memory [GB]": (peak - before) / 2**20}
    found["RMSE [K]"] = float(np.sqrt(np.mean((predicted - y.to_numpy()) ** 2)))
    if hasattr(model, "theta_"):
        found |= {"starts": len(model.starts_), "evaluations": int(model.starts_["n_evaluations"].sum())}
        found |= {p: float(model.theta_[p]) for p in ("C_w", "C_za", "R_zw", "R_zo")}
    return found


def apart(name: str, n_days: int) -> dict[str, object]:
    """The same in a process of its own."""
    command = [sys.executable, __file__, "--one", name, str(n_days)]
    try:
        run = subprocess.run(command, check=False, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {"fit [s]": f"> {LIMIT}"}
    if run.returncode:
        return {"fit [s]": f"failed: {run.stderr.strip().splitlines()[-1]}"}
    return json.loads(run.stdout.splitlines()[-1])


if __name__ == "__main__":
    warnings.simplefilter("ignore", SkhybridWarning)
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(sys.argv[2], int(sys.argv[3]))))
    else:
        os.nice(10)
        rows = {}
        for name in sys.argv[1:] or MODELS:
            rows[name] = apart(name, DAYS)
            print(name, rows[name], flush=True)
        if not sys.argv[1:]:
            write_table("numerics", "A year of one-minute rows", COMMAND, {"Cost": pd.DataFrame(rows).T})
