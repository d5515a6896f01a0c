"""Kernels against independent truth: SciPy's matrix exponential, a dense Gaussian, plain loops and differences."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from scipy.signal import cont2discrete

from skhybrid.filtering import Model as PredictorModel
from skhybrid.filtering import (
    cholesky_root,
    discretize,
    divided_difference,
    filter_channels,
    filter_channels_adjoint,
    iterate_lags,
    kalman_filter,
    low_pass,
    one_step_errors,
    regression_slopes,
    simplex_weights,
    simulate_inverse,
    simulate_path,
    smooth_states,
    solve_lq_path,
    solve_positive_definite,
    with_products,
)
from skhybrid.filtering.covariance import propagate
from skhybrid.thermal import RCNetwork
from skhybrid.thermal.catalogue import CATALOGUE

ROLES = ("T_oa", "q_sol", "u_heat", "u_cool", "Q_other")
HOURS = (1 / 60, 0.25, 1.0, 24.0)
#: two rooms that hardly know of each other: eigenvalues that differ in the seventh digit, or not at all
TWINS = RCNetwork(
    "twins",
    {"a": "C_a", "za": "C_za"},
    {"R_a": ("a", "T_oa"), "R_b": ("za", "T_oa"), "R_ab": ("a", "za")},
    {"za": None},
)


def slope(function, step):
    """Fourth-order central difference at 0 of a function of one number, exact to about 1e-10 where it is smooth."""
    f = [np.asarray(function(k * step), dtype=np.float64) for k in (-2, -1, 1, 2)]
    return (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)


def assert_close(actual, desired, relative, floor=1e-15):
    """Equal within ``relative`` of the largest entry (small entries are sums of large ones), or within ``floor``."""
    np.testing.assert_allclose(actual, desired, rtol=0, atol=max(relative * float(np.abs(desired).max()), floor))


# ------------------------------------------------------------------------------------------------------- discretize
def drawn_parameters(network, seed):
    rng = np.random.default_rng(seed)
    theta = {}
    for p in network.parameters(ROLES):
        low, high = p.free_bounds
        theta[p.name] = p.from_free(low + (high - low) * rng.uniform(0.25, 0.75))
    return theta


#: stiffer ones, whose differences are no truth, are held against ``expm_frechet`` in test_thermal.py
BASIC = [CATALOGUE[name] for name in ("1R1C", "2R2C", "3R2C", "3R3C", "4R3C")]
NETWORKS = [(network, drawn_parameters(network, seed)) for network in BASIC for seed in (0, 1)]
NETWORKS += [
    (TWINS, {"C_a": 2.0, "C_za": 2.0, "R_a": 5.0, "R_b": 5.0, "R_ab": 1e6, "A_win": 2.0, "Q_h": 6.0, "Q_c": -6.0}),
    (
        TWINS,
        {"C_a": 2.0, "C_za": 2.0, "R_a": 5.0, "R_b": 5.0 + 1e-9, "R_ab": 1e9, "A_win": 2.0, "Q_h": 6.0, "Q_c": -6.0},
    ),
]
NAMES = [f"{network.name}-{i}" for i, (network, _) in enumerate(NETWORKS)]


@pytest.mark.parametrize("hours", HOURS)
@pytest.mark.parametrize(("network", "theta"), NETWORKS, ids=NAMES)
def test_discretize_is_the_zero_order_hold(network, theta, hours):
    continuous = network.matrices(theta, ROLES)
    n, m = continuous.B.shape
    A, B, *_ = cont2discrete((continuous.A, continuous.B, np.eye(n), np.zeros((n, m))), hours)
    found = discretize(*continuous, hours)
    assert_close(found.A, A, 1e-9)
    assert_close(found.B, B, 1e-9)


@pytest.mark.parametrize("hours", HOURS)
@pytest.mark.parametrize(("network", "theta"), NETWORKS, ids=NAMES)
def test_discretize_has_exact_derivatives(network, theta, hours):
    found = discretize(*network.matrices(theta, ROLES), hours)
    for q, p in enumerate(network.parameters(ROLES)):

        def at(shift, name=p.name):
            moved = {**theta, name: theta[name] * np.exp(shift)}
            return discretize(*network.matrices(moved, ROLES), hours)

        for exact, field in ((found.dA[q], "A"), (found.dB[q], "B")):
            values = np.abs(getattr(found, field))
            rounding = 1e-12 * values.max()  # that of the difference, not of the derivative
            assert_close(exact * theta[p.name], slope(lambda s, f=field: getattr(at(s), f), 2e-3), 1e-8, rounding)


@pytest.mark.parametrize(
    ("a", "b"),
    [(-1.0, -1.0), (-1.0, -1.0 - 1e-13), (-0.4, -0.6), (-1e-12, 0.0), (-3.0, -3.9), (-5.0, -0.1), (-60.0, -1)],
)
def test_divided_difference(a, b):
    """A function of the matrix [[a, 1], [0, b]] bears the function's divided difference off the diagonal."""
    M = np.array([[a, 1.0], [0.0, b]])
    augmented = expm(np.block([[M, np.eye(2)], [np.zeros((2, 4))]]))
    assert divided_difference(a, b, False) == pytest.approx(augmented[0, 1], rel=1e-11)
    assert divided_difference(a, b, True) == pytest.approx(augmented[0, 3], rel=1e-11)


# ------------------------------------------------------------------------------------------- a dense Gaussian as truth
class Model(NamedTuple):
    """A small time-varying linear Gaussian model with rows that were not measured."""

    A: np.ndarray
    forcing: np.ndarray
    Q: np.ndarray
    noise_class: np.ndarray
    c: np.ndarray
    R: float
    y: np.ndarray
    s0: np.ndarray
    P0: np.ndarray

    @property
    def seen(self):
        return np.isfinite(self.y)


def definite(rng, n, rank=None):
    root = rng.normal(size=(n, rank or n))
    return root @ root.T


def drawn_model(n=3, N=12, seed=0, noiseless=False):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    # as in the networks, a class of rows may have noise on a single state only
    Q = np.array([definite(rng, n, 1 if noiseless else n), 0.2 * definite(rng, n, 1), 3.0 * definite(rng, n, 1)])
    y = 20.0 + rng.normal(size=N)
    y[[0, 4, 5, N - 2]] = np.nan
    c = np.append(rng.normal(size=n - 1), 1.0)
    return Model(
        A, rng.normal(size=(N, n)), Q, rng.integers(0, 3, N), c, 0.3, y, rng.normal(size=n) + 5.0, definite(rng, n)
    )


class Dense(NamedTuple):
    """Mean and covariance of all states, stacked, before any measurement."""

    mean: np.ndarray  # (N, n)
    covariance: np.ndarray  # (N, n, N, n)


def dense_prior(m):
    N, n = m.forcing.shape
    to_states = np.zeros((N * n, N * n))  # from the first state and the noises to all states
    for k in range(N):
        for j in range(k + 1):
            to_states[k * n : k * n + n, j * n : j * n + n] = np.linalg.matrix_power(m.A, k - j)
    drive = np.concatenate([m.s0[None], m.forcing[:-1]]).ravel()
    noise = block_diag(m.P0, *m.Q[m.noise_class[:-1]])
    covariance = to_states @ noise @ to_states.T
    return Dense((to_states @ drive).reshape(N, n), covariance.reshape(N, n, N, n))


def condition(m, prior, k, rows):
    """Mean and covariance of state k given the measured ones among ``rows``."""
    rows = [i for i in rows if m.seen[i]]
    mean, covariance = prior.mean[k], prior.covariance[k, :, k, :]
    if not rows:
        return mean, covariance
    cross = np.einsum("aib,b->ai", prior.covariance[k][:, rows], m.c)
    joint = np.einsum("iajb,a,b->ij", prior.covariance[rows][:, :, rows], m.c, m.c) + m.R * np.eye(len(rows))
    gain = np.linalg.solve(joint, cross.T).T
    return mean + gain @ (m.y[rows] - prior.mean[rows] @ m.c), covariance - gain @ cross.T


MODELS = [drawn_model(seed=0), drawn_model(n=2, seed=1), drawn_model(n=4, seed=2), drawn_model(seed=3, noiseless=True)]


def run_track(m):
    return kalman_filter(m.A, m.forcing, m.Q, m.noise_class, m.c[None], np.array([m.R]), m.y[:, None], m.s0, m.P0)


def run_errors(m, gain):
    """Errors and states of the predictor with one output and a constant gain (n,)."""
    n, no_slopes = len(m.A), np.empty((len(m.A), len(m.A), 0))
    slopes = (no_slopes, no_slopes, np.empty((n, 1, 0)), no_slopes, np.empty((n, 0)))
    noise = np.zeros((n, n)), np.zeros(1), np.zeros((n, n))
    model = PredictorModel(m.A, np.eye(n), m.c[None], gain[:, None], *noise, m.s0, *slopes)
    run = one_step_errors(model, m.forcing, m.y[:, None])
    return run.errors[:, 0], run.states


@pytest.mark.parametrize("m", MODELS)
def test_filtered_states_are_the_conditional_ones(m):
    filtered, covariances, predicted, before = run_track(m)
    prior = dense_prior(m)
    for k in range(len(m.y)):
        mean, covariance = condition(m, prior, k, range(k + 1))
        assert_close(filtered[k], mean, 1e-9)
        assert_close(covariances[k], covariance, 1e-9)
        mean, covariance = condition(m, prior, k, range(k))
        assert_close(predicted[k], mean, 1e-9)
        assert_close(before[k], covariance, 1e-9)


@pytest.mark.parametrize("m", MODELS)
def test_smoothed_states_are_the_conditional_ones(m):
    smooth = smooth_states(m.A, m.c[None], np.array([m.R]), m.y[:, None], run_track(m))
    prior = dense_prior(m)
    for k in range(len(m.y)):
        assert_close(smooth[k], condition(m, prior, k, range(len(m.y)))[0], 1e-9)


def test_smoothed_states_without_noise_are_one_path():
    """The covariances of the filter become singular to rounding."""
    A = np.array([[0.98, 0.02, 0.0], [0.08, 0.9, 0.2], [0.0, 0.0, 1.0]])
    m = drawn_model(N=300)._replace(
        A=A, Q=np.zeros((3, 3, 3)), c=np.array([0.0, 1.0, 0.0]), P0=np.diag([4.0, 4.0, 1.0])
    )
    m = m._replace(R=1e-4)
    smooth = smooth_states(A, m.c[None], np.array([m.R]), m.y[:, None], run_track(m))
    np.testing.assert_allclose(smooth[1:], smooth[:-1] @ A.T + m.forcing[:-1], atol=1e-8)


class Channels(NamedTuple):
    columns: np.ndarray
    series: np.ndarray


def drawn_channels(m, J=4, seed=5):
    rng = np.random.default_rng(seed)
    return Channels(rng.normal(size=(len(m.A), J)), rng.normal(size=(len(m.y), J)))


def run_channels(m, ch):
    return filter_channels(
        m.A, ch.columns, ch.series, m.forcing, m.Q, m.noise_class, m.c[None], np.array([m.R]), m.y[:, None], m.s0, m.P0
    )


@pytest.mark.parametrize("m", MODELS)
def test_channels_are_filters_of_their_own(m):
    """Channel 0 is the measurement; every other one is what its input alone does to the innovations of a zero."""
    ch = drawn_channels(m)
    found = run_channels(m, ch)
    silent = np.where(m.seen, 0.0, np.nan)
    models = [m] + [
        m._replace(forcing=np.outer(ch.series[:, j], ch.columns[:, j]), y=silent, s0=np.zeros(len(m.A)))
        for j in range(1, ch.columns.shape[1])
    ]
    for j, one in enumerate(models):
        prior = dense_prior(one)
        for k in range(len(m.y)):
            mean, covariance = condition(one, prior, k, range(k))
            expected = one.y[k] - m.c @ mean if m.seen[k] else 0.0
            assert found.errors[k, 0, j] == pytest.approx(expected, rel=1e-9, abs=1e-9)
            assert found.S[k, 0] == pytest.approx(m.c @ covariance @ m.c + m.R if m.seen[k] else 1.0, rel=1e-9)
            after, spread = condition(one, prior, k, range(k + 1))
            assert_close(found.states[k, :, j], after, 1e-9)
            assert_close(found.covariances[k], spread, 1e-9)


class Pair(NamedTuple):
    """A model with two outputs, the second of which is often missing."""

    m: Model
    C: np.ndarray
    R: np.ndarray
    y: np.ndarray


def drawn_pair(seed=40):
    m, rng = drawn_model(seed=seed), np.random.default_rng(seed)
    y = np.column_stack([m.y, rng.normal(size=len(m.y))])
    y[::3, 1] = np.nan
    return Pair(m, np.vstack([m.c, rng.normal(size=len(m.A))]), np.array([m.R, 0.3]), y)


def run_pair(p, ch):
    return filter_channels(
        p.m.A, ch.columns, ch.series, p.m.forcing, p.m.Q, p.m.noise_class, p.C, p.R, p.y, p.m.s0, p.m.P0
    )


def test_two_outputs_are_taken_in_together():
    """The sum of squares, the determinant and the states are those of the joint update by matrices."""
    p = drawn_pair()
    m, ch = p.m, drawn_channels(p.m)
    found = run_pair(p, ch)
    x, P = m.s0.copy(), m.P0.copy()
    for k, y in enumerate(p.y):
        seen = np.isfinite(y)
        C = p.C[seen]
        S = C @ P @ C.T + np.diag(p.R[seen])
        e = y[seen] - C @ x
        one_by_one = found.errors[k, seen, 0] ** 2 / found.S[k, seen]
        assert one_by_one.sum() == pytest.approx(e @ np.linalg.solve(S, e), rel=1e-9, abs=1e-12)
        assert np.log(found.S[k]).sum() == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-9, abs=1e-9)
        gain = P @ C.T @ np.linalg.inv(S)
        x, P = x + gain @ e, P - gain @ C @ P
        assert_close(found.states[k, :, 0], x, 1e-9)
        assert_close(found.covariances[k], P, 1e-9)
        x, P = m.A @ x + m.forcing[k], m.A @ P @ m.A.T + m.Q[m.noise_class[k]]


def test_adjoint_of_two_outputs():
    p = drawn_pair()
    m, ch, rng = p.m, drawn_channels(p.m), np.random.default_rng(41)
    result = run_pair(p, ch)
    errors_bar, S_bar = rng.normal(size=result.errors.shape), rng.normal(size=result.S.shape)
    adjoint = filter_channels_adjoint(m.A, ch.series, m.noise_class, p.C, p.y, len(m.Q), result, errors_bar, S_bar)
    d, dR = drawn_direction(m, 42), rng.uniform(0.1, 0.2, 2)
    along = np.sum(adjoint.A * d.A) + np.sum(adjoint.Q * d.Q) + np.sum(adjoint.P0 * d.P0) + adjoint.R @ dR

    def scalar(t):
        r = run_pair(p._replace(m=moved(m, d, t, "A", "Q", "P0"), R=p.R + t * dR), ch)
        return float((r.errors * errors_bar).sum() + (r.S * S_bar).sum())

    assert along == pytest.approx(slope(scalar, 1e-4), rel=1e-6)


# ---------------------------------------------------------------------------------------------- derivatives of filters
class Direction(NamedTuple):
    """A direction in which everything that a filter is given moves at once."""

    A: np.ndarray
    forcing: np.ndarray
    Q: np.ndarray
    R: float
    s0: np.ndarray
    P0: np.ndarray


def drawn_direction(m, seed):
    rng = np.random.default_rng(seed)
    turn = lambda M: M + np.swapaxes(M, -1, -2)  # noqa: E731
    return Direction(
        rng.normal(size=m.A.shape),
        rng.normal(size=m.forcing.shape),
        0.1 * turn(rng.normal(size=m.Q.shape)),
        0.2,
        rng.normal(size=m.s0.shape),
        0.1 * turn(rng.normal(size=m.P0.shape)),
    )


def moved(m, d, t, *fields):
    return m._replace(**{f: getattr(m, f) + t * getattr(d, f) for f in fields})


@pytest.mark.parametrize("m", MODELS)
def test_adjoint_has_the_derivatives_of_any_scalar(m):
    """A random scalar of innovations and variances, moved along a random direction of each ingredient."""
    ch = drawn_channels(m)
    result = run_channels(m, ch)
    rng = np.random.default_rng(30)
    errors_bar, S_bar = rng.normal(size=result.errors.shape), rng.normal(size=result.S.shape)
    adjoint = filter_channels_adjoint(
        m.A, ch.series, m.noise_class, m.c[None], m.y[:, None], len(m.Q), result, errors_bar, S_bar
    )

    def scalar(one, channels=ch):
        r = run_channels(one, channels)
        return float((r.errors * errors_bar).sum() + (r.S * S_bar).sum())

    d = drawn_direction(m, 31)
    d_columns = rng.normal(size=ch.columns.shape)
    along = {
        "A": np.sum(adjoint.A * d.A),
        "forcing": np.sum(adjoint.known * d.forcing),
        "Q": np.sum(adjoint.Q * d.Q),
        "R": adjoint.R[0] * d.R,
        "P0": np.sum(adjoint.P0 * d.P0),
    }
    for field, value in along.items():
        assert value == pytest.approx(slope(lambda t, f=field: scalar(moved(m, d, t, f)), 1e-4), rel=1e-7)
    by_columns = slope(lambda t: scalar(m, ch._replace(columns=ch.columns + t * d_columns)), 1e-2)
    assert np.sum(adjoint.columns[:, 1:] * d_columns[:, 1:]) == pytest.approx(by_columns, rel=1e-8)


# ---------------------------------------------------------------------------------------------------------- plain loops
def test_one_step_errors_and_path_against_a_loop():
    m = drawn_model(N=30, seed=7)
    m = m._replace(y=np.where(m.seen, m.y, 20.0))
    gain = np.random.default_rng(8).normal(scale=0.1, size=len(m.A))
    s, errors = m.s0.copy(), []
    states, free = [s], [s]
    for k in range(len(m.y)):
        errors.append(m.y[k] - m.c @ s)
        s = m.A @ s + m.forcing[k] + gain * errors[-1]
        states.append(s)
        free.append(m.A @ free[-1] + m.forcing[k])
    found, path = run_errors(m, gain)
    np.testing.assert_allclose(found, errors, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(path, states, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(simulate_path(m.A, m.forcing, m.s0), free, rtol=1e-12)


@pytest.mark.parametrize(("lower", "upper"), [(-np.inf, np.inf), (-3.0, 2.0), (0.0, 1.5)])
def test_inverse_against_a_loop(lower, upper):
    network = CATALOGUE["3R3C"]
    d = discretize(*network.matrices(drawn_parameters(network, 3), ROLES), 0.25)
    rng = np.random.default_rng(9)
    N, n = 40, len(d.A)
    forcing = np.outer(5.0 + rng.normal(size=N), d.B[:, 0])
    heat, c = d.B[:, -1], np.eye(n)[network.nodes.index("za")]
    target, s0 = 21.0 + rng.normal(size=N), np.full(n, 20.0)
    low, high = np.full(N, lower), np.full(N, upper)
    applied, path = simulate_inverse(d.A, forcing, np.stack([heat, heat]), c, target, target, low, high, s0, 1)
    s, clipped = s0.copy(), 0
    for k in range(N):
        free = d.A @ s + forcing[k]
        wanted = (target[k] - c @ free) / (c @ heat)
        assert applied[k] == pytest.approx(np.clip(wanted, lower, upper), rel=1e-9, abs=1e-9)
        s = free + heat * applied[k]
        assert path[k] == pytest.approx(c @ s, rel=1e-9)
        clipped += not lower < wanted < upper
        if lower < wanted < upper:
            assert c @ s == pytest.approx(target[k], abs=1e-9)
    assert (clipped > 0) == np.isfinite(upper)


@pytest.mark.parametrize("ahead", [1, 4])
def test_heat_is_sought_without_what_is_unforeseen(ahead):
    """Up to a step the heat is that under a forcing that holds from there on."""
    rng = np.random.default_rng(5)
    N, n = 20, 3
    A, heat, c, s0 = 0.4 * rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n), rng.normal(size=n)
    forcing, other, low = rng.normal(size=(N, n)), rng.normal(size=(N, n)), rng.normal(size=N)
    band, most = (low, low + 0.5), np.full(N, 2.0)
    given = (A, forcing, np.stack([heat, heat]), c, *band, -most, most, s0, ahead)
    found = simulate_inverse(*given, other)
    for k in (0, 7, N - 1):
        known = other[np.minimum(np.arange(N), k)]
        one = simulate_inverse(*given, known)
        np.testing.assert_array_equal(one.applied[: k + 1], found.applied[: k + 1])
    held = np.tile(other[0], (N, 1))
    plain = simulate_inverse(A, forcing + held, *given[2:])
    for one, two in zip(simulate_inverse(*given, held), plain, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize("ahead", [2, 5])
def test_inverse_with_a_hold_and_a_band_against_a_loop(ahead):
    """Each step applies the heat that, held, brings the output into the band of the last step of the hold."""
    rng = np.random.default_rng(11)
    N, n = 30, 3
    A, heat, c, s0 = 0.4 * rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n), rng.normal(size=n)
    forcing, low = rng.normal(size=(N, n)), rng.normal(size=N)
    high = low + rng.uniform(0.5, 2.0, N)
    most = np.full(N, 2.0)
    applied, path = simulate_inverse(A, forcing, np.stack([heat, heat]), c, low, high, -most, most, s0, ahead)
    s, inside = s0, 0
    for k in range(N):
        outputs = []
        for q in (0.0, 1.0):  # the output at the end of the hold is linear in the heat
            x = s
            for step in range(ahead):
                x = A @ x + forcing[min(k + step, N - 1)] + heat * q
            outputs.append(c @ x)
        last = min(k + ahead - 1, N - 1)
        wanted = np.clip(outputs[0], low[last], high[last])
        best = (wanted - outputs[0]) / (outputs[1] - outputs[0])
        assert applied[k] == pytest.approx(np.clip(best, -2.0, 2.0), abs=1e-9)
        s = A @ s + forcing[k] + heat * applied[k]
        assert path[k] == pytest.approx(c @ s, abs=1e-9)
        inside += applied[k] == 0.0
    assert 0 < inside < N
    assert (np.abs(applied) == 2.0).any()


@pytest.mark.parametrize(("shape", "decay"), [((7,), 0.8), ((7, 3), 0.8), ((7, 3), np.array([0.8, 0.5, 0.0]))])
def test_a_low_pass_against_a_loop(shape, decay):
    """All columns alike, or each with its own decay."""
    series = np.random.default_rng(5).standard_normal(shape)
    start = z = series[0] + 1.0
    found = low_pass(series, decay, start)
    for k in range(len(series)):
        z = decay * z + (1.0 - decay) * series[k]
        np.testing.assert_allclose(found[k], z, rtol=1e-12)


@pytest.mark.parametrize("n_models", [1, 2, 5])
def test_weights_on_the_simplex_are_where_no_other_weights_are_better(n_models):
    """By the first-order conditions: the slope is the same for all that count, and not lower for those that do not."""
    rng, outside = np.random.default_rng(n_models), 0
    roots, pulled = rng.normal(size=(40, 8, n_models)), rng.uniform(size=n_models)
    M = np.einsum("gni,gnj->gij", roots, roots) + 0.1 * np.eye(n_models)
    for own, w in zip(M, simplex_weights(M, pulled), strict=True):
        assert w.sum() == pytest.approx(1.0, abs=1e-12)
        assert (w >= -1e-12).all()
        slope, counts = own @ w - pulled, w > 1e-9
        np.testing.assert_allclose(slope[counts], slope[counts].mean(), atol=1e-9)
        assert (slope[~counts] >= slope[counts].mean() - 1e-9).all()
        outside += (~counts).sum()
    assert (outside > 0) == (n_models > 1)


def test_weights_of_unknown_losses_are_unknown():
    assert np.isnan(simplex_weights(np.full((1, 2, 2), np.nan), np.ones(2))).all()


@pytest.mark.parametrize("n_rows", [0, 1, 9])
def test_sums_of_products_fade_and_grow(n_rows):
    """Nothing that was given is changed, as a forecast goes on from sums that others keep."""
    rng = np.random.default_rng(n_rows)
    rows, root = rng.normal(size=(n_rows, 4)), rng.normal(size=(6, 4))
    sums = root.T @ root
    kept, given = sums.copy(), rows.copy()
    for fade, sign in ((1.0, 1), (0.7, 1), (1.0, -1)):
        np.testing.assert_allclose(
            with_products(sums, rows, fade, sign), fade * kept + sign * rows.T @ rows, atol=1e-12
        )
    np.testing.assert_array_equal(sums, kept)
    np.testing.assert_array_equal(rows, given)


def test_positive_definite_equations_are_solved_and_others_refused():
    root = np.random.default_rng(8).normal(size=(9, 4))
    H, b = root.T @ root, np.arange(4.0)
    np.testing.assert_allclose(solve_positive_definite(H.copy(), b), np.linalg.solve(H, b), rtol=1e-10)
    U = cholesky_root(H.copy())
    np.testing.assert_allclose(U.T @ U, H, atol=1e-12)
    np.testing.assert_array_equal(U, np.triu(U))
    for wrong in (-1.0, np.nan, np.inf):  # LAPACK itself lets NaN pass
        G = H.copy()
        G[2, 2] = wrong
        for solve in (cholesky_root, lambda G: solve_positive_definite(G, b)):
            with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
                solve(G.copy())
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        solve_positive_definite(H.copy(), np.full(4, np.nan))


def test_autoregressions_against_a_loop():
    """Each of its own coefficients, the oldest value first; values stay within the bounds, and the last row holds."""
    rng = np.random.default_rng(12)
    n, n_lags, n_leads = 3, 4, 25
    begin, coefs = rng.uniform(-1.0, 1.0, (n, n_lags)), rng.normal(scale=0.3, size=(n, n_lags))
    driven, first = rng.normal(scale=0.3, size=30), np.array([0, 4, 11])
    found = iterate_lags(begin, coefs, driven, first, n_leads, -1.2, 1.2)
    bounded = 0
    for i in range(n):
        values = list(begin[i])
        for lead in range(n_leads):
            value = values[-1] + driven[min(first[i] + lead, 29)]
            value += sum(c * v for c, v in zip(coefs[i], values[-n_lags:], strict=True))
            values.append(np.clip(value, -1.2, 1.2))
            bounded += abs(value) > 1.2
        np.testing.assert_allclose(found[i], values[n_lags:], atol=1e-12)
    assert 0 < bounded < n * n_leads


@pytest.mark.parametrize(("every", "n_lags"), [(1, 3), (4, 7), (30, 40)])
def test_slopes_of_a_regression_against_a_loop(every, n_lags):
    """Rows end before the last leads of the last origins; some factors are 0."""
    rng = np.random.default_rng(13)
    leads, n_origins, m = np.array([1, 2, 6, 7, 12, 25]), 9, 2
    T, rows = rng.normal(size=(n_origins, n_lags + 24)), rng.normal(size=((n_origins - 1) * every + 20, m))
    impulse = rng.normal(size=25)
    factors = rng.uniform(0.5, 2.0, (n_origins, 6)) * (rng.random((n_origins, 6)) < 0.7)
    factors[np.arange(n_origins)[:, None] * every + leads > len(rows)] = 0.0
    wanted = []
    for a, i in np.argwhere(factors):
        each = np.zeros(n_lags + m)
        for k in range(leads[i]):
            columns = np.append(T[a, k : k + n_lags][::-1], rows[a * every + k])
            each += impulse[leads[i] - 1 - k] * columns
        wanted.append(factors[a, i] * each)
    found = regression_slopes(T, rows, impulse, every, leads, factors)
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.slow
def test_kernels_run_uncompiled():
    """``NUMBA_DISABLE_JIT=1`` gives the same numbers from plain Python, for whoever steps through them."""
    code = (
        "import numpy as np\n"
        "from skhybrid.filtering import simulate_path, solve_lq_path, kalman_filter\n"
        "assert type(simulate_path).__name__ == 'function'\n"
        "A, F, one = np.array([[0.9]]), np.ones((4, 1)), np.ones(1)\n"
        "path = solve_lq_path(A, F, F[:2], one, np.arange(4.0), 0.3, -np.ones(4), np.ones(4), one, 1).applied\n"
        "run = kalman_filter(A, F, np.ones((1, 1, 1)), np.zeros(4, int), A, one, F, one, A)\n"
        "print(*simulate_path(A, F, one)[:, 0], *path, *run.states[:, 0])"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    A, F, one = np.array([[0.9]]), np.ones((4, 1)), np.ones(1)
    path = solve_lq_path(A, F, np.ones((2, 1)), one, np.arange(4.0), 0.3, -np.ones(4), np.ones(4), one, 1).applied
    run = kalman_filter(A, F, np.ones((1, 1, 1)), np.zeros(4, np.int64), A, one, F, one, A)
    expected = [*simulate_path(A, F, one)[:, 0], *path, *run.states[:, 0]]
    np.testing.assert_allclose([float(value) for value in out.stdout.split()], expected, rtol=1e-12)


def likeliest_heat(A, forcing, heat, c, wanted, penalty, s0, before=None):
    """Heat of all steps by plain least squares; ``before`` is that of the step before the first one."""
    N = len(forcing)
    unforced, effect, s = np.empty(N), np.zeros((N, N)), s0
    for k in range(N):
        s = A @ s + forcing[k]
        unforced[k] = c @ s
        for j in range(k + 1):
            effect[k, j] = c @ np.linalg.matrix_power(A, k - j) @ heat
    change, level = np.eye(N) - np.eye(N, k=-1), np.zeros(N)
    level[0] = 0.0 if before is None else before
    rows = slice(1 if before is None else 0, None)
    root = np.sqrt(penalty)
    return np.linalg.lstsq(
        np.vstack([effect, root * change[rows]]), np.concatenate([wanted - unforced, root * level[rows]])
    )[0]


@pytest.mark.parametrize(("lower", "upper"), [(-np.inf, np.inf), (-0.8, 0.6), (0.0, 0.9)])
@pytest.mark.parametrize("beyond", [0, 7])
def test_lq_path_against_least_squares(lower, upper, beyond):
    """Every step's heat is the first of the least squares over the steps that are left, cut at the limits."""
    rng = np.random.default_rng(5)
    N, n, penalty = 30, 4, 0.3
    A, heat, c, s0 = 0.4 * rng.normal(size=(n, n)), rng.normal(size=n), np.eye(n)[1], rng.normal(size=n)
    forcing, wanted = rng.normal(size=(N, n)), rng.normal(size=N)
    low, high = np.full(N, lower), np.full(N, upper)
    applied, path = solve_lq_path(A, forcing, np.stack([heat, heat]), c, wanted, penalty, low, high, s0, beyond)
    more, on = (np.concatenate([v, np.repeat(v[-1:], beyond, axis=0)]) for v in (forcing, wanted))
    s, before = s0, None
    for k in range(N):
        best = likeliest_heat(A, more[k:], heat, c, on[k:], penalty, s, before)[0]
        before = np.clip(best, lower, upper)
        assert applied[k] == pytest.approx(before, abs=1e-8)
        s = A @ s + forcing[k] + heat * before
        assert path[k] == pytest.approx(c @ s, abs=1e-8)
    cut = (applied == lower) | (applied == upper)
    assert cut.any() == np.isfinite(upper)
    assert not cut.all()


@pytest.mark.parametrize("wanted", [None, 1.0])
def test_a_load_whose_cooling_acts_later_than_its_heating(wanted):
    """The path is that of the effect of each step's own side, and the load brings it where it should be."""
    rng = np.random.default_rng(4)
    N, A, c = 40, np.array([[0.8, 0.3], [0.0, 0.5]]), np.array([1.0, 0.0])
    heat, forcing = np.array([[0.4, 0.0], [0.2, 0.3]]), np.column_stack([rng.normal(size=N), np.zeros(N)])
    free, band = np.full(N, np.inf), (np.full(N, 0.8), np.full(N, 1.2))
    if wanted is None:
        load, path = simulate_inverse(A, forcing, heat, c, *band, -free, free, np.zeros(2), 1)
    else:
        load, path = solve_lq_path(A, forcing, heat, c, np.full(N, wanted), 1e-8, -free, free, np.zeros(2), 5)
    s = np.zeros(2)
    for k in range(N):
        s = A @ s + forcing[k] + heat[0 if load[k] > 0 else 1] * load[k]
        assert path[k] == pytest.approx(c @ s, abs=1e-12)
        assert 0.8 - 1e-6 <= path[k] <= 1.2 + 1e-6
    assert min((load > 0).sum(), (load < 0).sum()) > 8


def test_kernels_leave_their_arguments_alone():
    m, ch = drawn_model(), drawn_channels(drawn_model())
    copies = [np.copy(v) for v in (*m, *ch)]
    result = run_channels(m, ch)
    ones = np.ones_like(result.errors), np.ones_like(result.S)
    filter_channels_adjoint(m.A, ch.series, m.noise_class, m.c[None], m.y[:, None], 3, result, *ones)
    smooth_states(m.A, m.c[None], np.array([m.R]), m.y[:, None], run_track(m))
    run_errors(m, np.ones_like(m.s0))
    simulate_path(m.A, m.forcing, m.s0)
    nothing = np.zeros(len(m.forcing))
    solve_lq_path(m.A, m.forcing, m.forcing[:2], m.c, nothing, 1.0, nothing - 1.0, nothing + 1.0, m.s0, 3)
    for kept, now in zip(copies, (*m, *ch), strict=True):
        np.testing.assert_array_equal(kept, now)


def test_a_propagated_covariance_is_that_of_matrices_and_symmetric_to_the_bit():
    rng = np.random.default_rng(3)
    A, root = rng.standard_normal((2, 4, 4))
    P, Q = root @ root.T, np.diag(rng.random(4))
    out = P.copy()
    propagate(A, out, Q, np.empty((4, 4)))
    np.testing.assert_allclose(out, A @ P @ A.T + Q, rtol=1e-12)
    np.testing.assert_array_equal(out, out.T)
