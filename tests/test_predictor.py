"""The predictor with sensitivities against a plain filter, differences, and many starts against each alone."""

from __future__ import annotations

import numpy as np
import pytest

from skhybrid.filtering import Model, one_step_errors, one_step_sensitivities

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
    return plain_run(m, b, inputs, y, filtered)[0]


def plain_run(m, b, inputs, y, filtered):
    """Errors, and the variance of each before any of its row is used; 1 where nothing was measured or filtered."""
    s, P, errors, variances = m.s0[b].copy(), m.P0.copy(), np.zeros(y.shape), np.ones(y.shape)
    for k in range(len(y)):
        seen = np.isfinite(y[k])
        errors[k, seen] = y[k, seen] - m.C[seen] @ s
        if k < filtered:
            variances[k, seen] = np.diag(m.C @ P @ m.C.T + np.diag(m.R))[seen]
            if seen.any():
                C = m.C[seen]
                gain = P @ C.T @ np.linalg.inv(C @ P @ C.T + np.diag(m.R[seen]))
                s, P = s + gain @ errors[k, seen], P - gain @ C @ P
            s, P = m.A[b] @ s + m.B[b] @ inputs[k], m.A[b] @ P @ m.A[b].T + m.Q[b]
        else:
            s = m.A[b] @ s + m.B[b] @ inputs[k] + m.K[b] @ errors[k]
    return errors, variances


@pytest.mark.parametrize("filtered", [0, 20, N])
def test_errors_are_those_of_a_plain_filter(case, filtered):
    m, inputs, y = case
    found = one_step_sensitivities(m, inputs, y, filtered, False).errors
    for b in range(S):
        np.testing.assert_allclose(found[b], plain_filter(m, b, inputs, y, filtered), rtol=1e-9, atol=1e-10)


def test_stages_that_are_full_or_off_act_as_any_other_input(case):
    m, inputs, y = case
    stages = (np.arange(inputs.size).reshape(inputs.shape) % 2).astype(float)
    near = stages + 1e-7 * (1.0 - 2.0 * stages)
    exact, beside = (one_step_sensitivities(m, values, y, 20, False) for values in (stages, near))
    np.testing.assert_allclose(exact.errors, beside.errors, atol=1e-4)
    np.testing.assert_allclose(exact.derrors, beside.derrors, atol=1e-4)


@pytest.mark.parametrize("filtered", [0, 20, N])
def test_derivatives_are_exact(case, filtered):
    m, inputs, y = case
    found = one_step_sensitivities(m, inputs, y, filtered, False).derrors

    def moved(q, t):
        along = {f: getattr(m, f) + t * getattr(m, "d" + f)[..., q] for f in ("A", "B", "K", "Q", "s0")}
        return one_step_sensitivities(m._replace(**along), inputs, y, filtered, False).errors

    step = 1e-3
    for q in range(P):
        f = [moved(q, k * step) for k in (-2, -1, 1, 2)]
        expected = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)
        assert np.abs(expected).max() > 1e-3
        np.testing.assert_allclose(found[..., q], expected, atol=1e-7 * np.abs(expected).max())
    assert (found[:, ~np.isfinite(y)] == 0.0).all()


@pytest.fixture
def arma_case(case):
    """The last states are driven by the errors, each by its own, and nothing else is: the form that OD has."""
    m, inputs, y = case
    o = y.shape[1]
    own, outputs = STATES - o + np.arange(o), np.arange(o)
    K, dK, A, dA, B, dB, C = m.K.copy(), m.dK.copy(), m.A.copy(), m.dA.copy(), m.B.copy(), m.dB.copy(), m.C.copy()
    K[:, : STATES - o], dK[:, : STATES - o] = 0.0, 0.0
    K[:, own] *= np.eye(o)
    dK[:, own] *= np.eye(o)[..., None]
    K[:, own, outputs] += 0.5
    for whole, d in ((A, dA), (B, dB)):
        whole[:, own], d[:, own] = 0.0, 0.0
    A[:, : STATES - o, own], dA[:, : STATES - o, own] = 0.0, 0.0
    A[:, own, own], dA[:, own, own] = 0.9, m.dA[:, own, own]
    C[:, own] = np.eye(o)
    s0, ds0 = m.s0.copy(), m.ds0.copy()
    s0[:, own], ds0[:, own] = 0.0, 0.0
    return m._replace(A=A, dA=dA, B=B, dB=dB, K=K, dK=dK, C=C, s0=s0, ds0=ds0), inputs, y


def test_after_a_missing_row_the_gain_is_that_of_the_process(arma_case):
    """Against a filter of the network and ``z[k+1] = a z[k] + b e[k]`` by the joint covariance of all measurements."""
    m, inputs, y = arma_case
    found = one_step_sensitivities(m, inputs, y, 0, True)
    o = y.shape[1]
    for b in range(S):
        s, free = m.s0[b].copy(), np.empty(y.shape)
        for k in range(N):
            free[k] = y[k] - m.C[:, : STATES - o] @ s[: STATES - o]
            s = m.A[b] @ s + m.B[b] @ inputs[k]
        for j in range(o):
            i, rows = STATES - o + j, np.flatnonzero(np.isfinite(y[:, j]))
            lag = np.subtract.outer(np.arange(N), np.arange(N))
            turn = np.eye(N) + np.where(lag > 0, m.K[b, i, j] * m.A[b, i, i] ** np.maximum(lag - 1.0, 0.0), 0.0)
            # the process begins with the first measured row, which is row 1 here
            turn = turn[:, rows[0] :]
            root = np.linalg.cholesky((turn @ turn.T)[np.ix_(rows, rows)])
            expected = np.linalg.solve(root, free[rows, j]) * np.diag(root)
            np.testing.assert_allclose(found.errors[b, rows, j], expected, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found.variances[b, rows, j], np.diag(root) ** 2, rtol=1e-9)
    assert found.variances.max() > 1.1
    assert (found.variances[:, ~np.isfinite(y)] == 1.0).all()


@pytest.mark.parametrize("filtered", [20, N])
def test_variances_are_those_of_a_plain_filter(case, filtered):
    m, inputs, y = case
    found = one_step_sensitivities(m, inputs, y, filtered, True)
    for b in range(S):
        expected = plain_run(m, b, inputs, y, filtered)[1][:filtered]
        np.testing.assert_allclose(found.variances[b, :filtered], expected, rtol=1e-9)


@pytest.mark.parametrize("filtered", [0, N])
def test_weighed_derivatives_are_exact(arma_case, filtered):
    m, inputs, y = arma_case
    found = one_step_sensitivities(m, inputs, y, filtered, True)

    def moved(q, t):
        along = {f: getattr(m, f) + t * getattr(m, "d" + f)[..., q] for f in ("A", "B", "K", "Q", "s0")}
        run = one_step_sensitivities(m._replace(**along), inputs, y, filtered, True)
        return np.array([run.errors, run.variances])

    step = 1e-3
    for q in range(P):
        f = [moved(q, k * step) for k in (-2, -1, 1, 2)]
        expected = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)
        for values, truth in zip((found.derrors, found.dvariances), expected, strict=True):
            assert np.abs(truth).max() > 1e-3
            np.testing.assert_allclose(values[..., q], truth, atol=1e-7 * np.abs(truth).max())


@pytest.mark.parametrize("filtered", [0, N])
def test_weights_change_no_error_of_a_complete_record(arma_case, filtered):
    m, inputs, y = arma_case
    y = np.nan_to_num(y)
    plain, weighed = (one_step_sensitivities(m, inputs, y, filtered, flag) for flag in (False, True))
    np.testing.assert_array_equal(plain.errors, weighed.errors)
    np.testing.assert_array_equal(plain.derrors, weighed.derrors)
    assert plain.variances.size == plain.dvariances.size == 0
    if filtered == 0:
        assert (weighed.variances == 1.0).all()


def test_settled_gains_stay_exact():
    """A long complete record, where the covariances are left alone once they have settled, then a missing row."""
    rng = np.random.default_rng(5)
    m, inputs, y = drawn_model(rng, 1), rng.normal(size=(3000, INPUTS)), rng.normal(size=(3000, 1))
    y[2500] = np.nan
    found = one_step_sensitivities(m, inputs, y, 3000, True)
    errors, variances = plain_run(m, 0, inputs, y, 3000)
    np.testing.assert_allclose(found.errors[0], errors, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.variances[0], variances, rtol=1e-9)


def test_a_start_does_not_depend_on_its_company(case):
    m, inputs, y = case
    together = one_step_sensitivities(m, inputs, y, N, False)
    for b in range(S):
        shared = {f: getattr(m, f) for f in ("C", "R", "P0")}
        alone = Model(**{f: v[b : b + 1] for f, v in m._asdict().items() if f not in shared}, **shared)
        run = one_step_sensitivities(alone, inputs, y, N, False)
        np.testing.assert_array_equal(run.errors[0], together.errors[b])
        np.testing.assert_array_equal(run.derrors[0], together.derrors[b])


def test_without_derivatives_the_errors_are_the_same(case):
    m, inputs, y = case
    none = {f: np.ascontiguousarray(getattr(m, f)[..., :0]) for f in ("dA", "dB", "dK", "dQ", "ds0")}
    found = one_step_sensitivities(m._replace(**none), inputs, y, 20, False)
    np.testing.assert_array_equal(found.errors, one_step_sensitivities(m, inputs, y, 20, False).errors)
    assert found.derrors.shape == (S, N, y.shape[1], 0)


def test_one_start_alone_has_the_same_errors_and_variances(arma_case):
    m, inputs, y = arma_case
    many = one_step_sensitivities(m, inputs, y, 0, True)
    for b in range(S):
        parts = {f: v if f in ("C", "R", "P0") else v[b] for f, v in m._asdict().items()}
        none = {f: np.ascontiguousarray(parts[f][..., :0]) for f in ("dA", "dB", "dK", "dQ", "ds0")}
        run = one_step_errors(Model(**parts | none), inputs, y)
        np.testing.assert_allclose(run.errors, many.errors[b], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(run.variances, many.variances[b], rtol=1e-12)
        seen = np.isfinite(y)
        np.testing.assert_allclose((y - run.states[:-1] @ m.C.T)[seen], run.errors[seen], rtol=1e-9, atol=1e-12)
