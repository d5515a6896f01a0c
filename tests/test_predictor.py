"""The predictor with sensitivities against a plain filter, differences, and many starts against each alone."""

from __future__ import annotations

import numpy as np
import pytest

from skhybrid._kernels import Model, one_step_errors, one_step_sensitivities

S, N, STATES, INPUTS, P = 3, 60, 4, 3, 5


def drawn_model(rng, outputs):
    """S stable models with everything a derivative may pass through."""
    A = rng.normal(size=(S, STATES, STATES))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max(axis=1)[:, None, None]
    root = rng.normal(size=(S, STATES, STATES))
    Q = 0.1 * root @ np.swapaxes(root, 1, 2)
    turn = rng.normal(size=(S, STATES, STATES, P))
    first = rng.normal(size=(STATES, STATES))
    return Model(
        A=A,
        B=rng.normal(size=(S, STATES, INPUTS)),
        C=rng.normal(size=(outputs, STATES)),
        K=0.1 * rng.normal(size=(S, STATES, outputs)),
        Q=Q,
        R=rng.uniform(0.1, 0.5, outputs),
        P0=first @ first.T,
        s0=rng.normal(size=(S, STATES)),
        dA=0.1 * rng.normal(size=(S, STATES, STATES, P)),
        dB=rng.normal(size=(S, STATES, INPUTS, P)),
        dK=0.1 * rng.normal(size=(S, STATES, outputs, P)),
        dQ=0.02 * (turn + np.swapaxes(turn, 1, 2)),
        ds0=rng.normal(size=(S, STATES, P)),
    )


@pytest.fixture(scope="module", params=[1, 2], ids=["one output", "two outputs"])
def case(request):
    rng = np.random.default_rng(request.param)
    y = rng.normal(size=(N, request.param))
    y[[0, 7, 8, 30]] = np.nan
    y[12, 0] = np.nan  # of two outputs only one is missing
    return drawn_model(rng, request.param), rng.normal(size=(N, INPUTS)), y


def plain_filter(m, b, inputs, y, filtered):
    """Joint measurement updates, as in any textbook; the last rows by the constant gain."""
    s, P, errors = m.s0[b].copy(), m.P0.copy(), np.zeros(y.shape)
    for k in range(len(y)):
        seen = np.isfinite(y[k])
        errors[k, seen] = y[k, seen] - m.C[seen] @ s
        if k < filtered:
            if seen.any():
                C = m.C[seen]
                gain = P @ C.T @ np.linalg.inv(C @ P @ C.T + np.diag(m.R[seen]))
                s, P = s + gain @ errors[k, seen], P - gain @ C @ P
            s, P = m.A[b] @ s + m.B[b] @ inputs[k], m.A[b] @ P @ m.A[b].T + m.Q[b]
        else:
            s = m.A[b] @ s + m.B[b] @ inputs[k] + m.K[b] @ errors[k]
    return errors


@pytest.mark.parametrize("filtered", [0, 20, N])
def test_errors_are_those_of_a_plain_filter(case, filtered):
    m, inputs, y = case
    found = one_step_sensitivities(m, inputs, y, filtered).errors
    for b in range(S):
        np.testing.assert_allclose(found[b], plain_filter(m, b, inputs, y, filtered), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("filtered", [0, 20, N])
def test_derivatives_are_exact(case, filtered):
    m, inputs, y = case
    found = one_step_sensitivities(m, inputs, y, filtered).derrors

    def moved(q, t):
        along = {f: getattr(m, f) + t * getattr(m, "d" + f)[..., q] for f in ("A", "B", "K", "Q", "s0")}
        return one_step_sensitivities(m._replace(**along), inputs, y, filtered).errors

    step = 1e-3
    for q in range(P):
        f = [moved(q, k * step) for k in (-2, -1, 1, 2)]
        expected = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)
        assert np.abs(expected).max() > 1e-3
        np.testing.assert_allclose(found[..., q], expected, atol=1e-7 * np.abs(expected).max())
    assert (found[:, ~np.isfinite(y)] == 0.0).all()


def test_settled_gains_stay_exact():
    """A long complete record, where the covariances are left alone once they have settled, then a missing row."""
    rng = np.random.default_rng(5)
    m, inputs, y = drawn_model(rng, 1), rng.normal(size=(3000, INPUTS)), rng.normal(size=(3000, 1))
    y[2500] = np.nan
    found = one_step_sensitivities(m, inputs, y, 3000).errors
    np.testing.assert_allclose(found[0], plain_filter(m, 0, inputs, y, 3000), rtol=1e-9, atol=1e-9)


def test_a_start_does_not_depend_on_its_company(case):
    m, inputs, y = case
    together = one_step_sensitivities(m, inputs, y, N)
    for b in range(S):
        shared = {f: getattr(m, f) for f in ("C", "R", "P0")}
        alone = Model(**{f: v[b : b + 1] for f, v in m._asdict().items() if f not in shared}, **shared)
        run = one_step_sensitivities(alone, inputs, y, N)
        np.testing.assert_array_equal(run.errors[0], together.errors[b])
        np.testing.assert_array_equal(run.derrors[0], together.derrors[b])


def test_without_derivatives_the_errors_are_the_same(case):
    m, inputs, y = case
    none = {f: np.ascontiguousarray(getattr(m, f)[..., :0]) for f in ("dA", "dB", "dK", "dQ", "ds0")}
    found = one_step_sensitivities(m._replace(**none), inputs, y, 20)
    np.testing.assert_array_equal(found.errors, one_step_sensitivities(m, inputs, y, 20).errors)
    assert found.derrors.shape == (S, N, y.shape[1], 0)


def test_the_plain_pass_is_the_predictor_with_constant_gain(case):
    m, inputs, y = case
    for b in range(S):
        run = one_step_errors(m.A[b], inputs @ m.B[b].T, m.K[b][None], m.C, y, m.s0[b])
        np.testing.assert_allclose(run.errors, plain_filter(m, b, inputs, y, 0), rtol=1e-9, atol=1e-10)
