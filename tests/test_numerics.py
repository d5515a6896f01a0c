"""Numbers at the ends of their ranges: bounds, time constants, steps, a million rows, threads, uncompiled kernels."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm, solve_discrete_are
from threadpoolctl import threadpool_info, threadpool_limits

from skhybrid import ARXRegressor, GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid._threads import one_blas_thread
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.filtering import Model, discretize, filter_channels, kalman_filter, one_step_sensitivities
from skhybrid.identification.disturbance_models import measurement_variance
from skhybrid.thermal.catalogue import CATALOGUE

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
ROLES = ("q_sol", "u_heat", "u_cool", "Q_other")
#: steps [h] from ten seconds to an hour, time constants [h] from a minute to a month
STEPS = {"10s": 1 / 360, "1min": 1 / 60, "15min": 0.25, "1h": 1.0}
TIMES = {"minute": 1 / 60, "hour": 1.0, "day": 24.0, "month": 720.0}


# ------------------------------------------------------------------------------------------------ bounds, times, steps
def corners(network, seed):
    """Every parameter at its lower bound, all at the upper one, and some of each; ten times wider for R and C."""
    parameters = network.parameters((*network.boundaries, *ROLES))
    ends = np.vstack([np.zeros(len(parameters)), np.ones(len(parameters))])
    for row in np.vstack([ends, np.random.default_rng(seed).integers(2, size=(4, len(parameters)))]).astype(int):
        theta = {}
        for p, end in zip(parameters, row, strict=True):
            wider = 10.0 ** (2 * end - 1) if p.unit in ("kWh/K", "K/kW") else 1.0
            theta[p.name] = p.from_free(p.free_bounds[end]) * wider
        yield theta


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_network_at_its_bounds_is_held_exactly(name):
    """Against the matrix exponential; a building as warm as all around it stays so, and no temperature overshoots.

    Rates reach 3e4 per hour beside ones of 1e-5, so that rounding of the slow ones is 1e-10.
    """
    network = CATALOGUE[name]
    n, k = len(network.nodes), len(network.boundaries)
    for theta in corners(network, seed=1):
        c = network.matrices(theta, (*network.boundaries, *ROLES))
        for hours in STEPS.values():
            found = discretize(*c, hours)
            truth = expm(hours * np.block([[c.A, c.B], [np.zeros((c.B.shape[1], n + c.B.shape[1]))]]))
            np.testing.assert_allclose(found.A, truth[:n, :n], rtol=0, atol=2e-10)
            np.testing.assert_allclose(found.B, truth[:n, n:], rtol=0, atol=2e-10 * np.abs(truth[:n, n:]).max())
            np.testing.assert_allclose(found.A.sum(axis=1) + found.B[:, :k].sum(axis=1), 1.0, rtol=0, atol=2e-10)
            assert found.A.min() > -2e-10
            assert all(np.isfinite(values).all() for values in found)


def one_room(time, step, n=600):
    """A room of one resistor and one capacity, R = C, whose product is the time constant; without noise."""
    hours, R, rng = STEPS[step], np.sqrt(TIMES[time]), np.random.default_rng(0)
    heat = np.repeat(rng.uniform(0.0, 2.0, n // 20), 20)
    outdoor = 5.0 + 3.0 * np.sin(np.arange(n) / 40.0)
    steady, left = outdoor + R * heat, np.exp(-hours / TIMES[time])
    T = np.full(n, 20.0)
    for row in range(n - 1):
        T[row + 1] = steady[row] + left * (T[row] - steady[row])
    index = pd.date_range("2024-01-08", periods=n, freq=step)
    return pd.DataFrame({"T_oa": outdoor, "Q_hvac": heat, "T_za": T}, index=index)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("time", TIMES)
def test_one_room_of_any_time_constant_is_identified(time, step):
    X = one_room(time, step)
    model = GrayBoxRC("1R1C", n_starts=3, columns={"q_sol": None}, random_state=0).fit(X, X["T_za"])
    np.testing.assert_allclose(model.simulate(X)[-100:], X["T_za"].iloc[-100:], atol=1e-4)
    if STEPS[step] < 20.0 * TIMES[time]:  # else nothing is left of it after a step
        assert model.theta_.iloc[0] * model.theta_.iloc[1] == pytest.approx(TIMES[time], rel=1e-3)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(
    "kind", [GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID, ARXRegressor]
)
def test_every_forecast_holds_at_every_step(kind, step):
    """Sixty rows ahead; the noise is 0.01 K."""
    X = one_room("day", step)
    y = X["T_za"] + 0.01 * np.random.default_rng(1).normal(size=len(X))
    given = {} if kind is ARXRegressor else {"network": "1R1C", "n_starts": 2, "random_state": 0}
    model = kind(horizon=60 * pd.Timedelta(step), columns={"q_sol": None}, **given).fit(X, y)
    assert np.sqrt(np.mean((model.predict(X.assign(T_za=y)) - X["T_za"]) ** 2)) < 0.5


# --------------------------------------------------------------------------------------------------- filters at the end
def input_model(hours, sigma_x, sigma_zeta):
    """A 2R2C with a random walk of the heat, over a step: A, Q, C and the measurement variance."""
    theta = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}
    c = CATALOGUE["2R2C"].matrices(theta, ("T_oa", "Q_other"))
    d = discretize(*c, hours)
    A = np.eye(3)
    A[:2, :2], A[:2, 2] = d.A, d.B[:, 1]
    return A, np.diag([sigma_x**2, sigma_x**2, sigma_zeta**2]), np.eye(3)[[1]], measurement_variance(hours)


def precise_filter(A, Q, C, R, y, s0, P0):
    """Joseph's form in extended precision: predicted states, covariances and innovations."""
    A, Q, c, x, P = (np.asarray(v, np.longdouble) for v in (A, Q, C[0], s0, P0))
    states, covariances, errors, S = [], [], [], []
    for value in y:
        states.append(x)
        covariances.append(P)
        s = c @ P @ c + np.longdouble(R)
        gain, e = P @ c / s, value - c @ x
        errors.append(e)
        S.append(s)
        left = np.eye(len(x), dtype=np.longdouble) - np.outer(gain, c)
        P = A @ (left @ P @ left.T + np.longdouble(R) * np.outer(gain, gain)) @ A.T + Q
        x = A @ (x + gain * e)
    return (np.array(v, np.float64) for v in (states, covariances, errors, S))


@pytest.mark.parametrize("hours", [STEPS["10s"], STEPS["1h"]])
@pytest.mark.parametrize("sigma_x", [1e-9, 1.0])
@pytest.mark.parametrize("sigma_zeta", [1e-9, 1.0])
def test_filters_with_noises_at_their_bounds(hours, sigma_x, sigma_zeta):
    A, Q, C, R = input_model(hours, sigma_x, sigma_zeta)
    N, s0, P0 = 400, np.array([18.0, 20.0, 0.0]), np.diag([4.0, 0.25, 1.0])
    y = 20.0 + np.random.default_rng(2).normal(size=(N, 1))
    states, covariances, errors, S = precise_filter(A, Q, C, R, y[:, 0], s0, P0)
    nothing, klass, R = np.zeros((N, 3)), np.zeros(N, np.int64), np.array([R])
    found = kalman_filter(A, nothing, Q[None], klass, C, R, y, s0, P0)
    np.testing.assert_allclose(found.predicted, states, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found.predicted_covariances, covariances, rtol=1e-9, atol=1e-12)
    channels = filter_channels(A, np.zeros((3, 1)), np.zeros((N, 1)), nothing, Q[None], klass, C, R, y, s0, P0)
    np.testing.assert_allclose(channels.errors[:, 0, 0], errors, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(channels.S[:, 0], S, rtol=1e-8)
    run = one_step_sensitivities(predictor(A, Q, C, R, s0, P0), np.zeros((N, 1)), y, N, True)
    np.testing.assert_allclose(run.errors[0, :, 0], errors, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.variances[0, :, 0], S, rtol=1e-8)


def predictor(A, Q, C, R, s0, P0):
    """One start without derivatives."""
    n, o = len(A), len(C)
    shapes = {"dA": (n, n, 0), "dB": (n, 1, 0), "dK": (n, o, 0), "dQ": (n, n, 0), "ds0": (n, 0)}
    none = {name: np.zeros((1, *shape)) for name, shape in shapes.items()}
    given = {"A": A[None], "B": np.zeros((1, n, 1)), "K": np.zeros((1, n, o)), "Q": Q[None], "s0": s0[None]}
    return Model(C=C, R=R, P0=P0, **given, **none)


@pytest.mark.slow
def test_a_million_rows_leave_the_covariance_symmetric_and_positive():
    N = 1_000_000
    A, Q, C, R = input_model(STEPS["1min"], 1e-3, 1e-2)
    s0, P0, klass = np.array([18.0, 20.0, 0.0]), np.diag([4.0, 0.25, 1.0]), np.zeros(N, np.int64)
    y = 20.0 + 0.1 * np.random.default_rng(3).normal(size=(N, 1))
    y[np.random.default_rng(4).random(N) < 0.1] = np.nan
    y[-20_000:] = 20.0
    nothing, R = np.zeros((N, 3)), np.array([R])
    found = kalman_filter(A, nothing, Q[None], klass, C, R, y, s0, P0)
    for P in (found.covariances, found.predicted_covariances):
        np.testing.assert_array_equal(P, P.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(P[::100]).min() > 0.0
    steady = solve_discrete_are(A.T, C.T, Q, R[None])
    np.testing.assert_allclose(found.predicted_covariances[-1], steady, rtol=1e-9)
    channels = filter_channels(A, np.zeros((3, 1)), np.zeros((N, 1)), nothing, Q[None], klass, C, R, y, s0, P0)
    P = channels.covariances
    np.testing.assert_allclose(P, P.transpose(0, 2, 1), rtol=1e-12)
    np.testing.assert_allclose(P, found.covariances, rtol=1e-9, atol=1e-15)
    run = one_step_sensitivities(predictor(A, Q, C, R, s0, P0), np.zeros((N, 1)), y, N, True)
    seen = np.isfinite(y[:, 0])
    np.testing.assert_allclose(run.errors[0, seen, 0], (y - found.predicted[:, 1:2])[seen, 0], atol=1e-8)
    np.testing.assert_allclose(run.errors[0, seen, 0], channels.errors[seen, 0, 0], atol=1e-8)


# --------------------------------------------------------------------------------------------- threads, plain functions
KNOWN = {"C_w": 4.0, "R_zw": 1.2, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}


def numbers(complete: bool) -> dict[str, list[float]]:
    """Findings and forecasts of fits; without ``complete`` a small part, which takes plain Python seconds."""
    office = make_office(n_days=12 if complete else 2, sampling_time="1h", start="2023-01-09", random_state=0)
    fitted = {
        kind.__name__: kind(known=None if complete else KNOWN, n_starts=2 if complete else 1, random_state=0)
        for kind in (GrayBoxRC, InputDisturbanceID, OutputDisturbanceID)
    }
    fitted["ARX"] = ARXRegressor(adapt="refit", horizon="6h")
    if complete:
        fitted["periodic"] = PeriodicDisturbanceID(n_starts=1, random_state=0)
    out = {} if complete else {"periodic": likelihood(office)}
    for name, model in fitted.items():
        model.fit(office.X, office.y)
        found = model.coef_ if name == "ARX" else [*model.theta_, *model.disturbance_, *model.theta_std_]
        out[name] = [*map(float, found), *map(float, model.predict(office.X))]
    return out


def likelihood(office) -> list[float]:
    """The periodic model's objective and gradient at one point."""
    model = PeriodicDisturbanceID(known=KNOWN)
    network, table, experiment, parameters = model._prepare(office.X, office.y)
    problem, _ = model._make_problem(network, table, experiment, parameters)
    loss, gradient, _ = problem.evaluate(np.array([0.3 * sum(p.free_bounds) for p in problem.searched]))
    return [loss, *map(float, gradient)]


def elsewhere(complete: bool, **environment: str) -> dict[str, np.ndarray]:
    """The same in a process with other variables of the environment."""
    command = [sys.executable, __file__, "complete" if complete else "part"]
    run = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=True)
    return {name: np.array(values) for name, values in json.loads(run.stdout).items()}


def test_calls_that_overlap_in_threads_have_one_blas_thread_each_and_leave_as_many_as_there_were():
    """The first to end gave the others as many as before it, and the last one left the process with one."""
    first_in, second_in, first_out = (threading.Event() for _ in range(3))
    seen = {}

    def blas_threads():
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    @one_blas_thread
    def first():
        first_in.set()
        second_in.wait(60)

    @one_blas_thread
    def second():
        second_in.set()
        first_out.wait(60)
        seen["second"] = blas_threads()

    with threadpool_limits(2, user_api="blas"):
        before = blas_threads()
        other = threading.Thread(target=lambda: first_in.wait(60) and second())
        other.start()
        first()
        first_out.set()
        other.join()
        seen["after"] = blas_threads()
    assert seen == {"second": {1}, "after": before}


@pytest.mark.slow
def test_two_threads_change_no_bit():
    two = elsewhere(True, **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "2"))
    for name, values in numbers(True).items():
        np.testing.assert_array_equal(two[name], values, err_msg=name)


@pytest.mark.slow
def test_uncompiled_kernels_find_the_same():
    """To the bit, but for the periodic model, whose compiled sums are in another order."""
    plain = elsewhere(False, NUMBA_DISABLE_JIT="1")
    for name, values in numbers(False).items():
        if name == "periodic":
            np.testing.assert_allclose(plain[name], values, rtol=1e-11, atol=1e-11 * np.abs(values).max())
        else:
            np.testing.assert_array_equal(plain[name], values, err_msg=name)


if __name__ == "__main__":
    warnings.simplefilter("ignore", SkhybridWarning)
    sys.stdout.write(json.dumps(numbers(sys.argv[1] == "complete")))
