"""Time and memory of every identification and of ARX on a year of one-minute rows.

Writes ``results/numerics.md``: ``python benchmarks/numerics.py``, or with names of models only their rows.  Each model
is fitted in a process of its own, one after the other, at low priority.
"""

from __future__ import annotations

import datetime
import json
import os
import resource
import subprocess
import sys
import time
import warnings
from typing import Any

import numpy as np
import pandas as pd
from _report import RESULTS, write_table

from skhybrid import ARXRegressor, GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.datasets._office import true_system
from skhybrid.exceptions import SkhybridWarning

COMMAND = "python benchmarks/numerics.py"
YEAR, STEP = 365, pd.Timedelta("1min")
KNOWN = {"known": {"Q_h": 6.0}, "random_state": 0}
TWO = {**KNOWN, "n_starts": 2}
MULTI = {**TWO, "objective": "multi_step"}
#: estimator and its settings
MODELS: dict[str, tuple[Any, dict[str, Any]]] = {
    "ARX": (ARXRegressor, {}),
    "CONV": (GrayBoxRC, TWO),
    "ID": (InputDisturbanceID, TWO),
    "OD": (OutputDisturbanceID, KNOWN),
    "CONV, multi-step": (GrayBoxRC, MULTI),
    "ID, multi-step": (InputDisturbanceID, MULTI),
    "OD, multi-step": (OutputDisturbanceID, MULTI),
    "periodic": (PeriodicDisturbanceID, KNOWN),
}
NOTE = (
    "Seconds are of the processor, one core; memory is the peak beyond that of the data [GB]. The paper's office, "
    "simulated exactly at one minute; Q_h known. CONV, ID and the multi-step objectives search from two starts "
    "instead of 50, as the machine "
    "was shared: a search takes the time of an evaluation times their number, and ten starts need about 250.\n\n"
    "How exact the numbers are is held by `tests/test_numerics.py`: forecasts of 1 and 2 threads are equal to the "
    "bit; so are those of compiled and plain kernels, but for the periodic model's likelihood (2e-14 of its size); "
    "networks at ten times their bounds are within 2e-10 of the matrix exponential, filters within 1e-11 K of "
    "extended precision for noises at their bounds; after a million rows covariances are symmetric and positive, "
    "and the last one is that of the Riccati equation to 1e-9."
)


def log_of_minutes(n_days: int) -> pd.DataFrame:
    """The paper's office, simulated exactly at one minute under the inputs of its five-minute log."""
    office = make_office(n_days, sampling_time="5min", noise_std=0.0, random_state=0)
    A, B = true_system(STEP / pd.Timedelta("1h"))
    inputs = np.repeat(office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy(), 5, axis=0)
    forcing = np.column_stack([inputs, np.repeat(office.heat_gain.to_numpy(), 5)]) @ B.T
    states = np.empty((len(forcing), 2))
    states[0] = office.states.iloc[0]
    for k, v in enumerate(forcing[:-1]):
        states[k + 1] = A @ states[k] + v
    index = pd.date_range(office.X.index[0], periods=len(forcing), freq=STEP)
    X = pd.DataFrame(inputs, index=index, columns=["T_oa", "q_sol", "u_heat", "u_cool"])
    return X.assign(T_za=states[:, 1] + 0.03 * np.random.default_rng(1).standard_normal(len(X)))


def one(name: str) -> dict[str, object]:
    """Fit and predict with one model."""
    kind, settings = MODELS[name]
    X = log_of_minutes(YEAR)
    model, before = kind(**settings), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    model.fit(X, X["T_za"])
    fitted = time.process_time()
    predicted = model.predict(X)
    end, peak = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if not np.isfinite(predicted).all():
        raise ValueError(f"{name} has forecasts that are not finite.")
    found = {"rows": len(X), "fit [s]": round(fitted - begin), "predict [s]": round(end - fitted, 1)}
    found |= {"memory [GB]": round((peak - before) / 2**20, 2)}
    starts = getattr(model, "starts_", None)
    found |= {"evaluations": "-" if starts is None else int(starts["n_evaluations"].sum())}
    theta = getattr(model, "theta_", {})
    found |= {p: round(float(theta[p]), 3) if p in theta else "-" for p in ("C_w", "C_za", "R_zw", "R_zo")}
    return found | {"date": str(datetime.date.today())}


def apart(name: str) -> dict[str, object]:
    """The same in a process of its own."""
    command = [sys.executable, __file__, "--one", name]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def main(names: list[str]) -> None:
    """Measure the models named, or all, and write the table with what is known of the others."""
    kept = RESULTS / "numerics.json"
    rows = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for name in names or MODELS:
        rows[name] = apart(name)
        print(name, rows[name], flush=True)
        kept.write_text(
            json.dumps({model: rows[model] for model in MODELS if model in rows}, indent=1) + "\n", encoding="utf-8"
        )
    table = pd.DataFrame({model: rows[model] for model in MODELS if model in rows}, dtype=object).T
    write_table("numerics", "A year of one-minute rows", COMMAND, {"Cost": table.rename_axis("model")}, NOTE)


if __name__ == "__main__":
    warnings.simplefilter("ignore", SkhybridWarning)
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(sys.argv[2])))
    else:
        os.nice(10)
        main(sys.argv[1:])
