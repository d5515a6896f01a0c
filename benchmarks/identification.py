"""Speed of the identifications, as ratios within one run: against the plain predictor, SciPy and darkgreybox.

Writes ``results/identification.md``: ``OMP_NUM_THREADS=1 python benchmarks/identification.py``.  One process, one
thread; compile time is apart.
``--darkgreybox DIR`` names a folder with darkgreybox 0.3.2 and lmfit where they are not installed:
``pip install --target DIR --no-deps darkgreybox==0.3.2 lmfit asteval uncertainties dill`` (its metadata ask for
pandas < 3, which its fit does not need).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd
from _report import write_table
from numba import njit
from scipy.linalg import expm
from scipy.optimize import least_squares

from skhybrid import InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID, RCNetwork
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning

KNOWN = {"Q_h": 6.0}
N_STARTS, PASSES, WEEK = 50, 50_000, 672
ROLES = ("T_oa", "q_sol", "u_heat", "u_cool")
#: the eight parameters, rho_1, rho_1 - rho_2 and the wall's first temperature, with the paper's bounds
NAMES = ("C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_c", "rho_1", "gap", "T_w0")
LOW = np.array([0.1, 0.1, 0.1, 0.1, 1e-6, 0.1, 0.05, -0.999, -0.999, 0.0])
HIGH = np.array([40, 40, 40, 40, 1.0, 25, 100, 0.999, 0.999, 45.0])
LOGS = np.array([True] * 7 + [False] * 3)


def seconds_of(work: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def best_of(work: Callable[[], object], repeats: int = 3) -> float:
    """Shortest of a few calls [s], the one least disturbed by other processes."""
    return min(seconds_of(work) for _ in range(repeats))


# ------------------------------------------------------------------------------------- the same likelihood in NumPy
def od_system(p: dict[str, float], hours: float) -> tuple[np.ndarray, np.ndarray]:
    """Zero-order hold of the 2R2C by a matrix exponential: states T_w, T_za; inputs of ``ROLES``."""
    A = np.array(
        [
            [-1 / (p["C_w"] * p["R_zw"]), 1 / (p["C_w"] * p["R_zw"])],
            [1 / (p["C_za"] * p["R_zw"]), -(1 / p["R_zw"] + 1 / p["R_zo"]) / p["C_za"]],
        ]
    )
    B = np.zeros((2, 4))
    B[0, 1] = (1 - p["f"]) * p["A_win"] / p["C_w"]
    B[1] = np.array([1 / p["R_zo"], p["f"] * p["A_win"], KNOWN["Q_h"], -p["Q_c"]]) / p["C_za"]
    both = expm(np.block([[A, B], [np.zeros((4, 6))]]) * hours)
    return both[:2, :2], both[:2, 2:]


def numpy_errors(x: np.ndarray, v: np.ndarray, y: np.ndarray, hours: float) -> np.ndarray:
    """One-step errors of OD by a loop over rows, as one writes it first."""
    p = {name: np.exp(value) if log else value for name, value, log in zip(NAMES, x, LOGS, strict=True)}
    A, B = od_system(p, hours)
    forcing, rho_2 = v @ B.T, p["rho_1"] - p["gap"]
    state, zeta, errors = np.array([p["T_w0"], y[0]]), 0.0, np.empty(len(y))
    for k in range(len(y)):
        errors[k] = y[k] - state[1] - zeta
        zeta = p["rho_1"] * zeta + rho_2 * errors[k]
        state = A @ state + forcing[k]
    return errors


def scipy_start(v: np.ndarray, y: np.ndarray, hours: float, rng: np.random.Generator) -> tuple[float, float, int]:
    """Seconds, loss and evaluations of one start with ``scipy.optimize.least_squares`` and its finite differences."""
    low, high = LOW.copy(), HIGH.copy()
    low[LOGS], high[LOGS] = np.log(LOW[LOGS]), np.log(HIGH[LOGS])
    begin, count = time.perf_counter(), 0

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return numpy_errors(x, v, y, hours)

    with np.errstate(all="ignore"):
        found = least_squares(residuals, low + (high - low) * rng.uniform(size=len(low)), bounds=(low, high))
    return time.perf_counter() - begin, 2 * found.cost, count


# --------------------------------------------------------------------------------------------------------- darkgreybox
def darkgreybox_start(X: pd.DataFrame, y: np.ndarray, method: str, rng: np.random.Generator) -> tuple[float, float]:
    """Seconds and simulation error [K] of one start of darkgreybox's TiTe (2R2C without sun) on the same rows."""
    from darkgreybox.models import TiTe

    heat = KNOWN["Q_h"] * X["u_heat"].to_numpy() - 6.0 * X["u_cool"].to_numpy()
    draw = np.exp(rng.uniform(np.log(0.1), np.log(40.0), size=4))
    given = {n: {"value": d, "min": 0.1, "max": 40.0} for n, d in zip(("Ci", "Ce", "Rie", "Rea"), draw, strict=True)}
    params = {
        "Ti0": {"value": y[0], "vary": False},
        "Te0": {"value": y[0], "min": y[0] - 20, "max": y[0] + 20},
        **given,
    }
    model = TiTe(params, rec_duration=0.25)
    inputs = {"Ph": heat, "Ta": X["T_oa"].to_numpy()}
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        took = seconds_of(lambda: model.fit(inputs, y, method=method))
        error = float(np.sqrt(np.mean((model.predict(inputs).Z - y) ** 2)))
    return took, error


def darkgreybox_rows(X: pd.DataFrame, y: np.ndarray, n_starts: int) -> list[dict[str, object]]:
    """darkgreybox by its two usual methods, or the reason why it is missing."""
    try:
        import darkgreybox  # noqa: F401
    except ImportError as error:
        return [{"what": f"darkgreybox: skipped ({error})"}]
    rows: list[dict[str, object]] = []
    for method in ("nelder", "leastsq"):
        rng, took, failed = np.random.default_rng(0), [], ""
        for _ in range(n_starts):
            try:
                took.append(darkgreybox_start(X, y, method, rng)[0])
            except ValueError as error:  # its explicit Euler steps overflow from some starts
                failed = f", others fail: {str(error)[:60]}"
        if took:
            what = f"darkgreybox TiTe, {method} ({len(took)} of {n_starts} starts{failed})"
            rows.append({"what": what, "seconds per start": float(np.mean(took))})
        else:
            rows.append({"what": f"darkgreybox TiTe, {method}: no start ran{failed}"})
    return rows


# --------------------------------------------------------------------------------------------------------- the measures
@njit
def plain_errors(A: np.ndarray, forcing: np.ndarray, K: np.ndarray, c: np.ndarray, y: np.ndarray, s: np.ndarray):
    """One-step errors of a predictor with one output, without missing rows, weights and derivatives."""
    errors, s, after = np.empty(len(y)), s.copy(), np.empty(len(s))
    for k in range(len(y)):
        errors[k] = y[k]
        for i in range(len(s)):
            errors[k] -= c[i] * s[i]
        for i in range(len(s)):
            after[i] = forcing[k, i] + K[i] * errors[k]
            for j in range(len(s)):
                after[i] += A[i, j] * s[j]
        s, after = after, s
    return errors


def predictor_pass(X: pd.DataFrame, y: np.ndarray) -> float:
    """Seconds of a plain pass of the compiled OD predictor over the rows, from 50 000 calls."""
    p = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_c": 6.0}
    A2, B2 = od_system(p, 0.25)
    A = np.zeros((3, 3))
    A[:2, :2], A[2, 2] = A2, 0.9
    forcing = np.zeros((len(y), 3))
    forcing[:, :2] = X[list(ROLES)].to_numpy() @ B2.T
    K, c, s0 = np.array([0.0, 0.0, 0.7]), np.array([0.0, 1.0, 1.0]), np.array([22.0, y[0], 0.0])
    plain_errors(A, forcing, K, c, y, s0)

    def passes() -> None:
        for _ in range(PASSES):
            plain_errors(A, forcing, K, c, y, s0)

    return seconds_of(passes) / PASSES


def fit_quietly(model: object, X: pd.DataFrame, y: pd.Series) -> object:
    """Fit without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        return model.fit(X, y)


class AllStarts(OutputDisturbanceID):
    """OD whose search does not end before all starts are made."""

    def _search(self, *args: object, **settings: object) -> object:
        return super()._search(*args, **{**settings, "enough": self.n_starts + 1})


def speed_table(dg_starts: int, scipy_starts: int) -> pd.DataFrame:
    """A week of 15-min rows: the predictor, 50 starts of ours, SciPy and darkgreybox."""
    office = make_office(7, random_state=0)
    X, y = office.X, office.y
    fit_quietly(OutputDisturbanceID(known=KNOWN, n_starts=2, random_state=1), X, y)  # compiles
    a_pass = predictor_pass(X, y.to_numpy())
    whole = PASSES * a_pass
    rows: list[dict[str, object]] = [{"what": f"{PASSES} plain predictor passes over {WEEK} rows", "seconds": whole}]
    for name, kind in (
        ("OD, n_starts=50, all starts made", AllStarts),
        ("OD, n_starts=50, ends when starts agree", OutputDisturbanceID),
    ):
        model = kind(known=KNOWN, n_starts=N_STARTS, random_state=0)
        took = best_of(lambda model=model: fit_quietly(model, X, y))
        made = len(model.starts_)
        rows.append({"what": f"{name} ({made} made)", "seconds": took, "seconds per start": took / made})
    v, rng = X[list(ROLES)].to_numpy(), np.random.default_rng(0)
    starts = [scipy_start(v, y.to_numpy(), 0.25, rng) for _ in range(scipy_starts)]
    mean = float(np.mean([s[0] for s in starts]))
    rows.append(
        {
            "what": f"the same likelihood in NumPy and SciPy, {scipy_starts} starts, x50 extrapolated",
            "seconds": N_STARTS * mean,
            "seconds per start": mean,
        }
    )
    rows += darkgreybox_rows(X, y.to_numpy(), dg_starts)
    table = pd.DataFrame(rows).set_index("what")
    table["seconds"] = table["seconds"].fillna(N_STARTS * table["seconds per start"])
    table["of the passes"] = table["seconds"] / whole
    return table


def chain(n_nodes: int) -> RCNetwork:
    """A wall of ``n_nodes - 1`` layers beyond the zone, its last layer to the outside."""
    layers = [f"l{i}" for i in range(1, n_nodes)]
    places = ["za", *layers]
    resistors = {f"R_{a}_{b}": (a, b) for a, b in pairwise(places)}
    resistors["R_out"] = (places[-1], "T_oa")
    if layers:
        resistors["R_zo"] = ("za", "T_oa")
    return RCNetwork(f"chain{n_nodes}", {p: f"C_{p}" for p in places}, resistors, {"za": None})


def evaluation_ms(model: object, X: pd.DataFrame, y: pd.Series) -> tuple[float, float]:
    """Seconds of a fit, and milliseconds of one evaluation with its derivatives."""
    took = seconds_of(lambda: fit_quietly(model, X, y))
    return took, 1000.0 * took / model.starts_["n_evaluations"].sum()


def makers() -> dict[str, Callable[[object], object]]:
    """The identifications that are timed as rows and states grow."""
    return {
        "OD": lambda network: OutputDisturbanceID(network, known=KNOWN, n_starts=10, random_state=0),
        "ID": lambda network: InputDisturbanceID(network, known=KNOWN, n_starts=10, random_state=0),
        "Periodic": lambda network: PeriodicDisturbanceID(network, known=KNOWN, n_starts=1, random_state=0),
    }


def exponent(sizes: list[int], times: list[float]) -> float:
    """Slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def growth(sizes: list[int], data: Callable[[int], tuple[object, pd.DataFrame, pd.Series]]) -> pd.DataFrame:
    """Milliseconds per evaluation and seconds per fit by size, and the fitted exponents."""
    columns: dict[str, list[float]] = {}
    for name, make in makers().items():
        fits, each = [], []
        network, X, y = data(sizes[0])
        fit_quietly(make(network).set_params(n_starts=1), X, y)  # compiles
        for size in sizes:
            network, X, y = data(size)
            took, one = evaluation_ms(make(network), X, y)
            fits.append(took)
            each.append(one)
        columns[f"{name} ms/evaluation"] = [*each, exponent(sizes, each), exponent(sizes[-2:], each[-2:])]
        columns[f"{name} s/fit"] = [*fits, exponent(sizes, fits), exponent(sizes[-2:], fits[-2:])]
    return pd.DataFrame(columns, index=pd.Index([*map(str, sizes), "exponent", "exponent, last two"], name="size"))


FIRST_CALLS = {
    "PeriodicDisturbanceID().fit": "PeriodicDisturbanceID(known={'Q_h': 6.0}, random_state=0).fit(X, y)",
    "OutputDisturbanceID().fit": "OutputDisturbanceID(known={'Q_h': 6.0}, random_state=0).fit(X, y)",
    "HybridPredictor().fit and predict": "HybridPredictor(random_state=0).fit(X[:-96], y[:-96]).predict(X[-96:])",
}


def first_call(code: str, cache: str) -> dict[str, float]:
    """Seconds that the first call and a second one take in a fresh process."""
    program = f"""
import time, warnings
warnings.simplefilter("ignore")
begin = time.perf_counter()
from skhybrid import HybridPredictor, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
office = make_office(14, random_state=0)
X, y = office.X, office.y
ready = time.perf_counter()
{code}
first = time.perf_counter()
{code}
print(ready - begin, first - ready, time.perf_counter() - first)
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    numbers = [float(v) for v in done.stdout.split()[-3:]]
    return {"import and data": numbers[0], "first call": numbers[1], "second call": numbers[2]}


def latency() -> pd.DataFrame:
    """First calls in fresh processes, with an empty compile cache and with a filled one [s]."""
    rows = {}
    for name, code in FIRST_CALLS.items():
        with tempfile.TemporaryDirectory() as cache:
            for state in ("cold", "warm"):
                found = first_call(code, cache)
                rows[name, state] = {**found, "latency": found["first call"] - found["second call"]}
    table = pd.DataFrame(rows).T
    return table.rename_axis(["what", "cache"])


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--darkgreybox", help="folder with darkgreybox and lmfit")
    parser.add_argument("--quick", action="store_true", help="small sizes, nothing written")
    options = parser.parse_args()
    if options.darkgreybox:
        sys.path.append(options.darkgreybox)
    quick = options.quick
    tables = {"A week of 15-min rows, one process": speed_table(2 if quick else 5, 1 if quick else 3)}
    print(tables["A week of 15-min rows, one process"].to_string())
    days = [7, 14, 28] if quick else [7, 14, 28, 56, 112, 224, 365]
    long = make_office(max(days), random_state=0)
    tables["Growth with rows (2R2C), size in days"] = growth(
        days, lambda d: ("2R2C", long.X[: 96 * d], long.y[: 96 * d])
    )
    print(tables["Growth with rows (2R2C), size in days"].round(3).to_string())
    nodes = [1, 2, 3] if quick else [1, 2, 3, 4, 5, 6]
    tables["Growth with states (chains, 14 days), size in nodes"] = growth(
        nodes, lambda n: (chain(n), long.X[:1344], long.y[:1344])
    )
    print(tables["Growth with states (chains, 14 days), size in nodes"].round(3).to_string())
    tables["First calls in fresh processes [s], 14 days"] = latency()
    print(tables["First calls in fresh processes [s], 14 days"].round(2).to_string())
    if not quick:
        write_table(
            "identification",
            "Speed of the identifications",
            "OMP_NUM_THREADS=1 python benchmarks/identification.py --darkgreybox DIR",
            tables,
            "Times are wall seconds of one process with one thread; compile time is in the last table only.  An "
            "evaluation is the objective with its exact derivatives, a fit's time over all that it made, its own "
            "overhead included.  darkgreybox fits a 2R2C without sun by simulation error (no disturbance model), with "
            "explicit Euler steps.  SciPy's starts are few and extrapolated to 50.",
        )


if __name__ == "__main__":
    main()
