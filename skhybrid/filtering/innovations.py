"""Innovations-form predictor ``s[k+1] = A s[k] + B v[k] + K[k] e[k]``, ``e[k] = y[k] - C s[k]``, with sensitivities.

One recursion serves every disturbance model; they differ in the states that they append and in the gain ``K``:
constant, or Kalman's over the first rows or over all.  A row without a measurement has ``e[k] = 0``.

The constant gain is Kalman's of a process that only its own errors drive, ``z[k+1] = a z[k] + b e[k]``, while every row
is measured.  A missing row leaves ``b e[k]`` unknown: with p the variance of z, in units of that of e, the row that is
measured next has variance 1 + p and gain ``(a p + b) / (1 + p)``, and p decays by ``(a - b)^2 / (1 + p)`` per row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import propagate_covariance, update_covariance
from .rows import store_row


class Model(NamedTuple):
    """Predictor of one start, with derivatives by p parameters in the last axis.

    For S starts at once every array but ``C``, ``R`` and ``P0``, which all starts share, has a leading axis S.
    """

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, m)
    C: np.ndarray  # (o, n)
    K: np.ndarray  # (n, o) constant gain, of the rows that the Kalman filter does not serve
    Q: np.ndarray  # (n, n) process noise of the filter
    R: np.ndarray  # (o,) its measurement variances
    P0: np.ndarray  # (n, n) covariance of the first state
    s0: np.ndarray  # (n,) first state
    dA: np.ndarray  # (n, n, p)
    dB: np.ndarray  # (n, m, p)
    dK: np.ndarray  # (n, o, p)
    dQ: np.ndarray  # (n, n, p)
    ds0: np.ndarray  # (n, p)


class Prediction(NamedTuple):
    """One-step prediction of every row."""

    errors: np.ndarray  # (N, o) e[k]; 0 where nothing was measured
    variances: np.ndarray  # (N, o) of the errors in units of the noise; 1 where nothing was measured
    states: np.ndarray  # (N + 1, n) s[k|k-1]


class Sensitivity(NamedTuple):
    """One-step errors of S starts and their exact derivatives by each of p parameters."""

    errors: np.ndarray  # (S, N, o)
    derrors: np.ndarray  # (S, N, o, p)
    variances: np.ndarray  # (S, N, o) of the errors: Kalman's; in units of the noise under a constant gain; 1 unseen
    dvariances: np.ndarray  # (S, N, o, p); both have N = 0 where they were not asked for


@compiled
def _innovation_variances(C, R, P, dP, k, seen, variances, dvariances):
    """Variances of row k's errors before any of its measurements is used, and their derivatives."""
    o, n = C.shape
    for j in range(o):
        if not seen[j]:
            continue
        value = R[j]
        for i in range(n):
            for m in range(n):
                share = C[j, i] * C[j, m]
                if share != 0.0:
                    value += share * P[i, m]
                    for q in range(dP.shape[2]):
                        dvariances[k, j, q] += share * dP[i, m, q]
        variances[k, j] = value


@compiled
def _correct_after_gap(model, k, seen, begun, errors, derrors, after, dafter, p, dp, variances, dvariances):
    """Row k's correction of the constant gain after missing rows, into ``after`` and ``dafter``.

    The last o states are the processes that the gain drives, one per output; ``p`` (o,) are their variances, 0 up to
    the first measured row (``begun``).
    """
    A, K, dA, dK = model.A, model.K, model.dA, model.dK
    n, o = K.shape
    for j in range(o):
        i, v = n - o + j, p[j]
        a, b = A[i, i], K[i, j]
        if not seen[j]:
            if begun[j]:
                for q in range(dA.shape[2]):
                    dp[j, q] = a * (a * dp[j, q] + 2.0 * v * dA[i, i, q]) + 2.0 * b * dK[i, j, q]
                p[j] = a * a * v + b * b
            continue
        begun[j] = True
        if v == 0.0:
            continue
        S, gap, e = 1.0 + v, a - b, errors[k, j]
        more, left = gap * v / S, gap * gap * v / S
        after[i] += more * e
        variances[k, j] = S
        decayed = left < 1e-16
        for q in range(dA.shape[2]):
            dgap, dv = dA[i, i, q] - dK[i, j, q], dp[j, q]
            dafter[i, q] += (dgap * v + gap * dv / S) / S * e + more * derrors[k, j, q]
            dvariances[k, j, q] = dv
            dp[j, q] = gap * (2.0 * dgap * v + gap * dv / S) / S
            decayed = decayed and abs(dp[j, q]) < 1e-16
        p[j] = left
        if decayed:  # to rounding, and before numbers become denormal, which are slow
            p[j] = 0.0
            for q in range(dA.shape[2]):
                dp[j, q] = 0.0


@compiled
def _innovations(C, y, k, s, ds, seen, errors, derrors):
    """Row k's errors, their derivatives and ``seen``, the outputs that were measured; returns whether all were."""
    o, n = C.shape
    complete = True
    for j in range(o):
        seen[j] = not np.isnan(y[k, j])
        complete = complete and seen[j]
        if seen[j]:
            e = y[k, j]
            for i in range(n):
                e -= C[j, i] * s[i]
            errors[k, j] = e
            for i in range(n):
                if C[j, i] != 0.0:
                    for q in range(ds.shape[1]):
                        derrors[k, j, q] -= C[j, i] * ds[i, q]
    return complete


@compiled
def _update_state(C, y, k, seen, gain, dgain, s, ds, de):
    """Update the state and its derivatives by row k's measurements, one after the other, in place."""
    o, n = C.shape
    p = ds.shape[1]
    for j in range(o):
        if not seen[j]:
            continue
        e = y[k, j]
        for q in range(p):
            de[q] = 0.0
        for i in range(n):
            e -= C[j, i] * s[i]
            for q in range(p):
                de[q] -= C[j, i] * ds[i, q]
        for i in range(n):
            s[i] += gain[j, i] * e
            for q in range(p):
                ds[i, q] += dgain[j, i, q] * e + gain[j, i] * de[q]


@compiled
def _propagate_state(A, dA, B, dB, s, ds, inputs, k, after, dafter):
    """``after = A s + B v[k]`` and its derivatives."""
    n, m, p = A.shape[0], B.shape[1], dA.shape[2]
    for i in range(n):
        value = 0.0
        for q in range(p):
            dafter[i, q] = 0.0
        for j in range(n):
            value += A[i, j] * s[j]
            for q in range(p):
                dafter[i, q] += dA[i, j, q] * s[j] + A[i, j] * ds[j, q]
        for j in range(m):
            v = inputs[k, j]
            if v != 0.0:
                value += B[i, j] * v
                for q in range(p):
                    dafter[i, q] += dB[i, j, q] * v
        after[i] = value


@compiled
def _add_errors(K, dK, errors, derrors, k, after, dafter):
    """``after += K e[k]`` and its derivatives."""
    n, o = K.shape
    for i in range(n):
        for j in range(o):
            e = errors[k, j]
            after[i] += K[i, j] * e
            for q in range(dafter.shape[1]):
                dafter[i, q] += dK[i, j, q] * e + K[i, j] * derrors[k, j, q]


@compiled
def _store_prediction(rows, at, k, s, ds, states, dstates):
    """Store the state predicted from row k if k is entry ``at`` of the increasing ``rows``; returns the next entry."""
    if at == len(rows) or rows[at] != k:
        return at
    store_row(s, ds, states, dstates, at)
    return at + 1


@compiled
def run_predictor(
    model, inputs, y, n_filtered, with_variances, errors, derrors, variances, dvariances, rows, states, dstates
):
    """Run the predictor of one start with forward sensitivities, into ``errors`` and all arguments after it.

    ``states`` (n_rows, n) are those predicted from the increasing ``rows``; the other arguments are as in
    :func:`one_step_sensitivities`, without the axis of starts.
    """
    A, B, C, K, Q, R, P0, s0, dA, dB, dK, dQ, ds0 = model
    n, o, p = A.shape[0], C.shape[0], dA.shape[2]
    s, after, ds, dafter = s0.copy(), np.empty(n), ds0.copy(), np.empty((n, p))
    P, dP = P0.copy(), np.zeros((n, n, p))
    gain, dgain, Pc, dPc = np.zeros((o, n)), np.zeros((o, n, p)), np.empty(n), np.empty((n, p))
    AP, AdP, work = np.empty((n, n)), np.empty((n, n, p)), np.empty((n, n, p))
    seen, de = np.empty(o, np.bool_), np.empty(p)
    begun, gap, dgap = np.zeros(o, np.bool_), np.zeros(o), np.zeros((o, p))
    steady, at = False, 0
    for k in range(len(inputs)):
        complete = _innovations(C, y, k, s, ds, seen, errors, derrors)
        if k < n_filtered:
            # with every row measured the gains settle; from then on they are left as they are, to rounding
            if not (steady and complete):
                if with_variances:
                    _innovation_variances(C, R, P, dP, k, seen, variances, dvariances)
                change = update_covariance(P, dP, C, R, seen, gain, dgain, Pc, dPc)
                propagate_covariance(A, Q, dA, dQ, P, dP, AP, AdP, work)
                steady = complete and change < 1e-13
            elif with_variances:
                store_row(variances[k - 1], dvariances[k - 1], variances, dvariances, k)
            _update_state(C, y, k, seen, gain, dgain, s, ds, de)
        _propagate_state(A, dA, B, dB, s, ds, inputs, k, after, dafter)
        if k >= n_filtered:
            _add_errors(K, dK, errors, derrors, k, after, dafter)
            if with_variances:
                _correct_after_gap(
                    model, k, seen, begun, errors, derrors, after, dafter, gap, dgap, variances, dvariances
                )
        s, after, ds, dafter = after, s, dafter, ds
        at = _store_prediction(rows, at, k, s, ds, states, dstates)


@compiled
def one_start(models, b, K, dK):
    """The predictor of start ``b`` of several, with a constant gain and its derivatives."""
    m = models
    return Model(m.A[b], m.B[b], m.C, K, m.Q[b], m.R, m.P0, m.s0[b], m.dA[b], m.dB[b], dK, m.dQ[b], m.ds0[b])


@compiled
def one_step_sensitivities(model, inputs, y, n_filtered, with_variances):
    """One-step errors and their exact derivatives, for S starts over one segment of rows.

    ``model`` has a leading axis of S starts, and p >= 0 parameters; ``inputs`` (N, m); ``y`` (N, o), NaN where
    missing.  Rows below ``n_filtered`` have Kalman's gain, the others ``K``.  With variances the constant gain is the
    exact one after missing rows; its model has one state per output, the last o ones, which K drives and nothing else
    does.
    """
    S, n, p = model.ds0.shape
    N, o = y.shape
    n_variances = N if with_variances else 0
    errors, derrors = np.zeros((S, N, o)), np.zeros((S, N, o, p))
    variances, dvariances = np.ones((S, n_variances, o)), np.zeros((S, n_variances, o, p))
    rows, states, dstates = np.empty(0, np.int64), np.empty((0, n)), np.empty((0, n, p))
    for b in range(S):
        one = one_start(model, b, model.K[b], model.dK[b])
        out = (errors[b], derrors[b], variances[b], dvariances[b])
        run_predictor(one, inputs, y, n_filtered, with_variances, *out, rows, states, dstates)
    return Sensitivity(errors, derrors, variances, dvariances)


@compiled
def one_step_errors(model, inputs, y):
    """Errors and states of one start without derivatives, under the constant gain that is exact after missing rows."""
    (N, o), n = y.shape, len(model.s0)
    errors, variances, states = np.zeros((N, o)), np.ones((N, o)), np.empty((N + 1, n))
    states[0] = model.s0
    none = np.empty((N, o, 0))
    out = (errors, none, variances, none)
    run_predictor(model, inputs, y, 0, True, *out, np.arange(N), states[1:], np.empty((N, n, 0)))
    return Prediction(errors, variances, states)
