"""Kernels of horizon errors against textbook recursions, plain loops and differences."""

from __future__ import annotations

import numpy as np
import pytest

from skhybrid.filtering import (
    filter_gains,
    filter_series,
    lead_errors,
    lead_sensitivities,
    simulate_inputs,
)


def slope(function, step):
    """Fourth-order central difference at 0 of a function of one number."""
    f = [np.asarray(function(k * step), dtype=np.float64) for k in (-2, -1, 1, 2)]
    return (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)


class Filter:
    """A random stable filter of three states, and how it hangs on two parameters."""

    def __init__(self, seed=0, n_rows=40):
        self.rng = rng = np.random.default_rng(seed)
        m, p = 3, 2
        self.node, self.R = 1, 0.3
        self.A = 0.9 * np.eye(m) + 0.05 * rng.normal(size=(m, m))
        root = 0.3 * rng.normal(size=(m, m))
        self.Q, self.P0 = root @ root.T + 0.01 * np.eye(m), np.diag([1.0, 2.0, 3.0])
        self.dA, half = 0.1 * rng.normal(size=(m, m, p)), 0.1 * rng.normal(size=(m, m, p))
        self.dQ = half + half.swapaxes(0, 1)
        self.seen = np.ones(n_rows, dtype=bool)
        self.seen[[0, 7, 8, 9, 20]] = False
        self.c = np.eye(m)[self.node]

    def at(self, t):
        return self.A + self.dA @ t, self.Q + self.dQ @ t

    def gains(self, t):
        """Kalman's recursion as in a textbook."""
        A, Q = self.at(t)
        P, out = self.P0, np.zeros((len(self.seen), len(A)))
        for k, seen in enumerate(self.seen):
            if seen:
                out[k] = P @ self.c / (self.c @ P @ self.c + self.R)
                P = P - np.outer(out[k], self.c @ P)
            P = A @ P @ A.T + Q
        return out


def test_filter_gains_are_those_of_the_textbook():
    f = Filter()
    gains, dgains, _ = filter_gains(f.A, f.Q, f.c, f.R, f.P0, f.dA, f.dQ, f.seen)
    np.testing.assert_allclose(gains, f.gains(np.zeros(2)), atol=1e-10)
    for q, unit in enumerate(np.eye(2)):
        numeric = slope(lambda h, unit=unit: f.gains(h * unit), 1e-3)
        np.testing.assert_allclose(dgains[..., q], numeric, atol=1e-8)


def test_gains_go_on_from_the_variance_of_a_segment_before():
    f = Filter()
    whole = filter_gains(f.A, f.Q, f.c, f.R, f.P0, f.dA, f.dQ, f.seen)
    first = filter_gains(f.A, f.Q, f.c, f.R, f.P0, f.dA, f.dQ, f.seen[:9])
    rest = filter_gains(f.A, f.Q, f.c, f.R, first.variance, f.dA, f.dQ, f.seen[9:])
    np.testing.assert_allclose(np.vstack([first.gains, rest.gains]), whole.gains, atol=1e-10)
    np.testing.assert_allclose(rest.variance, whole.variance, atol=1e-10)


def test_settled_gains_are_still_those_of_the_textbook():
    """After many rows, and after a gap in the settled part."""
    f = Filter(n_rows=400)
    f.seen[300:310] = False
    gains, dgains, _ = filter_gains(f.A, f.Q, f.c, f.R, f.P0, f.dA, f.dQ, f.seen)
    np.testing.assert_allclose(gains, f.gains(np.zeros(2)), atol=1e-9)
    numeric = slope(lambda h: f.gains(np.array([h, 0.0])), 1e-3)
    np.testing.assert_allclose(dgains[..., 0], numeric, atol=1e-7)


def test_inputs_are_simulated_each_by_itself():
    f = Filter(1)
    B, V = f.rng.normal(size=(3, 4)), f.rng.normal(size=(30, 4))
    expected = np.empty((30, 4))
    for j in range(4):
        x = np.zeros(3)
        for k in range(30):
            expected[k, j] = x[f.node]
            x = f.A @ x + B[:, j] * V[k, j]
    found = np.empty((30, 4))
    here, ahead = simulate_inputs(f.A, B, V, f.node, np.zeros((3, 4)), found)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    np.testing.assert_allclose(ahead, f.A @ here + B * V[-1], atol=1e-12)
    middle = np.zeros((3, 4))
    for rows in (slice(11), slice(11, 12), slice(12, None)):  # in pieces
        again = np.empty_like(V[rows])
        _, middle = simulate_inputs(f.A, B, V[rows], f.node, middle, again)
        np.testing.assert_allclose(again, expected[rows], atol=1e-12)
    np.testing.assert_allclose(middle, ahead, atol=1e-12)


def filtered(A, gains, node, y, origins):
    x, out = np.zeros(len(A)), {}
    for k, value in enumerate(y):
        if gains[k].any():
            x = x + gains[k] * (value - x[node])
        out[k] = x
        x = A @ x
    return np.array([out[o] for o in origins])


def test_series_are_filtered_each_by_itself():
    f = Filter(2)
    gains, S, origins = f.gains(np.zeros(2)), f.rng.normal(size=(40, 3)), np.array([0, 5, 8, 8, 39])
    S[~f.seen] = np.nan  # never read
    found, last, ahead = filter_series(f.A, gains, f.node, S, origins, np.zeros((3, 3)))
    for j in range(3):
        np.testing.assert_allclose(found[..., j], filtered(f.A, gains, f.node, S[:, j], origins), atol=1e-12)
    np.testing.assert_array_equal(last, found[-1])
    np.testing.assert_allclose(ahead, f.A @ last, atol=1e-12)
    _, _, middle = filter_series(f.A, gains[:9], f.node, S[:9], origins[:0], np.zeros((3, 3)))
    rest, _, _ = filter_series(f.A, gains[9:], f.node, S[9:], np.array([30]), middle)
    np.testing.assert_allclose(rest[0], last, atol=1e-12)


def test_errors_by_lead_are_what_is_left_of_the_filtered_forecast():
    f = Filter(3)
    S, states, P = f.rng.normal(size=(20, 2)), f.rng.normal(size=(3, 3, 2)), f.rng.normal(size=(2, 3))
    origins, leads, weight = np.array([2, 9, 18]), np.array([1, 4]), f.rng.uniform(size=(3, 2))
    weight[2, 1] = 0.0  # beyond the series
    found = lead_errors(S, states, P, origins, leads, weight).reshape(3, 2, 2)
    for o in range(3):
        for h in range(2):
            for j in range(2):
                inside = weight[o, h] > 0
                expected = weight[o, h] * (S[origins[o] + leads[h], j] - P[h] @ states[o, :, j]) if inside else 0.0
                assert found[o, h, j] == pytest.approx(expected, abs=1e-12)


def test_sensitivities_of_response_and_filter():
    f = Filter(4)
    n, N, p = 2, 40, 2
    A, dA = 0.8 * np.eye(n) + 0.05 * f.rng.normal(size=(n, n)), 0.1 * f.rng.normal(size=(n, n, p))
    forcing, dforcing = f.rng.normal(size=(N, n)), f.rng.normal(size=(N, n, p))
    y, origins = np.where(f.seen, f.rng.normal(size=N), np.nan), np.array([0, 6, 8, 39])

    def plain(t):
        F, _ = f.at(t)
        s, response = np.zeros(n), np.empty(N)
        for k in range(N):
            response[k] = s[f.node]
            s = (A + dA @ t) @ s + forcing[k] + dforcing[k] @ t
        return response, filtered(F, f.gains(t), f.node, y - response, origins)

    gains, dgains, _ = filter_gains(f.A, f.Q, f.c, f.R, f.P0, f.dA, f.dQ, f.seen)
    found = lead_sensitivities(A, dA, forcing, dforcing, f.A, f.dA, gains, dgains, f.node, y, origins)
    response, states = plain(np.zeros(p))
    np.testing.assert_allclose(found.response, response, atol=1e-12)
    np.testing.assert_allclose(found.states, states, atol=1e-10)
    for q, unit in enumerate(np.eye(p)):
        np.testing.assert_allclose(found.dresponse[:, q], slope(lambda h, u=unit: plain(h * u)[0], 1e-3), atol=1e-7)
        np.testing.assert_allclose(found.dstates[..., q], slope(lambda h, u=unit: plain(h * u)[1], 1e-3), atol=1e-7)
