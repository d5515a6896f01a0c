"""The innovations-form predictor ``s[k+1] = A s[k] + B v[k] + K[k] e[k]``, ``e[k] = y[k] - C s[k]``.

One recursion serves every disturbance model; they differ in the states that they append and in the gain ``K``
(design 4): constant, or Kalman's over the first rows or over all.  A row without a measurement has ``e[k] = 0``.

The constant gain is Kalman's of a process that only its own errors drive, ``z[k+1] = a z[k] + b e[k]``, while every row
is measured.  A missing one leaves ``b e[k]`` unknown: with p the variance of z, in units of that of e, the row that is
measured next has variance 1 + p and gain ``(a p + b) / (1 + p)``, and p dies away by ``(a - b)^2 / (1 + p)`` a row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled


class Prediction(NamedTuple):
    """One-step prediction of every row."""

    errors: np.ndarray  # (N, o) e[k]; 0 where nothing was measured
    states: np.ndarray  # (N + 1, n) s[k|k-1]


class Model(NamedTuple):
    """The predictor of one start, with derivatives by p parameters in the last axis; also of S starts at once.

    With S starts every array has a leading axis S, but ``C``, ``R`` and ``P0``, which all starts share.
    """

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, m)
    C: np.ndarray  # (o, n)
    K: np.ndarray  # (n, o) gain of the rows that no Kalman filter serves
    Q: np.ndarray  # (n, n) process noise of the filter
    R: np.ndarray  # (o,) its measurement variances
    P0: np.ndarray  # (n, n) covariance of the first state
    s0: np.ndarray  # (n,) first state
    dA: np.ndarray  # (n, n, p)
    dB: np.ndarray  # (n, m, p)
    dK: np.ndarray  # (n, o, p)
    dQ: np.ndarray  # (n, n, p)
    ds0: np.ndarray  # (n, p)


class Sensitivity(NamedTuple):
    """One-step errors of S starts and their exact derivatives by each of p parameters."""

    errors: np.ndarray  # (S, N, o)
    derrors: np.ndarray  # (S, N, o, p)
    variances: np.ndarray  # (S, N, o) of the errors: Kalman's, in units of the noise below a constant gain; 1 unseen
    dvariances: np.ndarray  # (S, N, o, p); both have N = 0 where they were not asked for


@compiled
def one_step_errors(A, forcing, K, C, y, s0):
    """Run the predictor.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        ``B v[k]``.
    K : ndarray of shape (n_gains, n, o)
        Gain of every row, predictor form; the last one serves all rows from there on.
    C : ndarray of shape (o, n)
    y : ndarray of shape (N, o)
        Measurements, NaN where missing.
    s0 : ndarray of shape (n,)
        State at the first row.

    Returns
    -------
    Prediction
    """
    N, n = forcing.shape
    o, last = C.shape[0], K.shape[0] - 1
    errors, states = np.zeros((N, o)), np.empty((N + 1, n))
    for i in range(n):
        states[0, i] = s0[i]
    for k in range(N):
        for j in range(o):
            if not np.isnan(y[k, j]):
                e = y[k, j]
                for i in range(n):
                    e -= C[j, i] * states[k, i]
                errors[k, j] = e
        row = min(k, last)
        for i in range(n):
            value = forcing[k, i]
            for j in range(o):
                value += K[row, i, j] * errors[k, j]
            for j in range(n):
                value += A[i, j] * states[k, j]
            states[k + 1, i] = value
    return Prediction(errors, states)


@compiled
def _correct(P, dP, C, R, seen, gain, dgain, Pc, dPc):
    """One row's sequential measurement updates of the covariance; gains (o, n), their derivatives (o, n, p).

    Returns by how much any gain differs from what it was.
    """
    o, n = C.shape
    p = dP.shape[2]
    moved = 0.0
    for j in range(o):
        if not seen[j]:
            continue
        S = R[j]
        for i in range(n):
            value = 0.0
            for m in range(n):
                value += P[i, m] * C[j, m]
            Pc[i] = value
        for i in range(n):
            S += C[j, i] * Pc[i]
        for i in range(n):
            for q in range(p):
                dPc[i, q] = 0.0
            for m in range(n):
                for q in range(p):
                    dPc[i, q] += dP[i, m, q] * C[j, m]
        for i in range(n):
            moved = max(moved, abs(Pc[i] / S - gain[j, i]))
            gain[j, i] = Pc[i] / S
        for q in range(p):
            dS = 0.0
            for i in range(n):
                dS += C[j, i] * dPc[i, q]
            for i in range(n):
                slope = (dPc[i, q] - gain[j, i] * dS) / S
                moved = max(moved, abs(slope - dgain[j, i, q]) / (1.0 + abs(slope)))
                dgain[j, i, q] = slope
            for i in range(n):
                for m in range(n):
                    dP[i, m, q] -= gain[j, i] * dPc[m, q] + dgain[j, i, q] * Pc[m]
        for i in range(n):
            for m in range(n):
                P[i, m] -= gain[j, i] * Pc[m]
    return moved


@compiled
def _spread(A, Q, dA, dQ, P, dP, AP, AdP, work):
    """One row's propagation of the covariance and of its derivatives, in place."""
    n, p = A.shape[0], dP.shape[2]
    for i in range(n):
        for j in range(n):
            value = 0.0
            for m in range(n):
                value += A[i, m] * P[m, j]
            AP[i, j] = value
    # A dP A' is symmetric, and dA P A' and its transpose need A P only
    for i in range(n):
        for j in range(n):
            for q in range(p):
                AdP[i, j, q] = 0.0
                work[i, j, q] = 0.0
            for m in range(n):
                for q in range(p):
                    AdP[i, j, q] += A[i, m] * dP[m, j, q]
                    work[i, j, q] += dA[i, m, q] * AP[j, m]
    for i in range(n):
        for j in range(i + 1):
            for q in range(p):
                dP[i, j, q] = dQ[i, j, q] + work[i, j, q] + work[j, i, q]
            for m in range(n):
                for q in range(p):
                    dP[i, j, q] += AdP[i, m, q] * A[j, m]
            for q in range(p):
                dP[j, i, q] = dP[i, j, q]
            value = Q[i, j]
            for m in range(n):
                value += AP[i, m] * A[j, m]
            P[i, j] = value
            P[j, i] = value


@compiled
def _weigh(C, R, P, dP, k, seen, variances, dvariances):
    """Variances of one row's errors, each before any of the row's measurements is used, and their derivatives."""
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
def _catch_up(model, k, seen, known, errors, derrors, after, dafter, spread, dspread, variances, dvariances):
    """One row's correction of the constant gain behind missing rows.

    ``spread`` (o,) is the variance of the last o states, one an output; it is 0 up to the first measured row.
    """
    A, K, dA, dK = model[0], model[3], model[8], model[10]
    n, o = K.shape
    for j in range(o):
        i, v = n - o + j, spread[j]
        a, b = A[i, i], K[i, j]
        if not seen[j]:
            if known[j]:
                for q in range(dA.shape[2]):
                    dspread[j, q] = a * (a * dspread[j, q] + 2.0 * v * dA[i, i, q]) + 2.0 * b * dK[i, j, q]
                spread[j] = a * a * v + b * b
            continue
        known[j] = True
        if v == 0.0:
            continue
        S, gap, e = 1.0 + v, a - b, errors[k, j]
        more, left = gap * v / S, gap * gap * v / S
        after[i] += more * e
        variances[k, j] = S
        gone = left < 1e-16
        for q in range(dA.shape[2]):
            dgap, dv = dA[i, i, q] - dK[i, j, q], dspread[j, q]
            dafter[i, q] += (dgap * v + gap * dv / S) / S * e + more * derrors[k, j, q]
            dvariances[k, j, q] = dv
            dspread[j, q] = gap * (2.0 * dgap * v + gap * dv / S) / S
            gone = gone and abs(dspread[j, q]) < 1e-16
        spread[j] = left
        if gone:  # to rounding, and before numbers become slow
            spread[j] = 0.0
            for q in range(dA.shape[2]):
                dspread[j, q] = 0.0


@compiled
def _compare(C, y, k, s, ds, seen, errors, derrors):
    """One row's errors and their derivatives; which outputs were measured, and whether all were."""
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
def _follow(C, y, k, seen, gain, dgain, s, ds, de):
    """One row's sequential measurement updates of the state and of its derivatives, in place."""
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
def _keep(kept, at, k, s, ds, states, dstates):
    """Store what row k leads to expect of the next where it is the next of the increasing rows ``kept``."""
    if at == len(kept) or kept[at] != k:
        return at
    for i in range(len(s)):
        states[at, i] = s[i]
        for q in range(ds.shape[1]):
            dstates[at, i, q] = ds[i, q]
    return at + 1


@compiled
def _advance(model, inputs, y, filtered, weigh, errors, derrors, variances, dvariances, kept, states, dstates):
    """The predictor with forward sensitivities over one segment of rows, for one start."""
    A, B, C, K, Q, R, P0, s0, dA, dB, dK, dQ, ds0 = model
    n, m, o, p, N = A.shape[0], B.shape[1], C.shape[0], dA.shape[2], inputs.shape[0]
    s, after, ds, dafter = s0.copy(), np.empty(n), ds0.copy(), np.empty((n, p))
    P, dP = P0.copy(), np.zeros((n, n, p))
    gain, dgain, Pc, dPc = np.zeros((o, n)), np.zeros((o, n, p)), np.empty(n), np.empty((n, p))
    AP, AdP, work = np.empty((n, n)), np.empty((n, n, p)), np.empty((n, n, p))
    seen, de = np.empty(o, np.bool_), np.empty(p)
    known, spread, dspread = np.zeros(o, np.bool_), np.zeros(o), np.zeros((o, p))
    steady, at = False, 0
    for k in range(N):
        complete = _compare(C, y, k, s, ds, seen, errors, derrors)
        kalman = k < filtered
        if kalman:
            # with every row measured the gains settle; from then on they are left as they are, to rounding
            if not (steady and complete):
                if weigh:
                    _weigh(C, R, P, dP, k, seen, variances, dvariances)
                moved = _correct(P, dP, C, R, seen, gain, dgain, Pc, dPc)
                _spread(A, Q, dA, dQ, P, dP, AP, AdP, work)
                steady = complete and moved < 1e-13
            elif weigh:
                for j in range(o):
                    variances[k, j] = variances[k - 1, j]
                    for q in range(p):
                        dvariances[k, j, q] = dvariances[k - 1, j, q]
            _follow(C, y, k, seen, gain, dgain, s, ds, de)
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
            if not kalman:
                for j in range(o):
                    e = errors[k, j]
                    value += K[i, j] * e
                    for q in range(p):
                        dafter[i, q] += dK[i, j, q] * e + K[i, j] * derrors[k, j, q]
            after[i] = value
        if weigh and not kalman:
            _catch_up(model, k, seen, known, errors, derrors, after, dafter, spread, dspread, variances, dvariances)
        for i in range(n):
            s[i] = after[i]
            for q in range(p):
                ds[i, q] = dafter[i, q]
        at = _keep(kept, at, k, s, ds, states, dstates)


@compiled
def one_step_sensitivities(model, inputs, y, filtered, weigh):
    """One-step errors and their exact derivatives, for S starts over one segment of rows.

    Parameters
    ----------
    model : Model
        With a leading axis of S starts, and p parameters; p may be 0.
    inputs : ndarray of shape (N, m)
    y : ndarray of shape (N, o)
        Measurements, NaN where missing.
    filtered : int
        Rows below this number have Kalman's gain, the others ``K``.
    weigh : bool
        Whether to return the variances of the errors too.  Behind missing rows the constant gain is then the exact one;
        its model has one state an output, the last o ones, which K drives and nothing else does.

    Returns
    -------
    Sensitivity
    """
    A, B, C, K, Q, R, P0, s0, dA, dB, dK, dQ, ds0 = model
    S, p = A.shape[0], dA.shape[3]
    N, o = y.shape
    rows = N if weigh else 0
    errors, derrors = np.zeros((S, N, o)), np.zeros((S, N, o, p))
    variances, dvariances = np.ones((S, rows, o)), np.zeros((S, rows, o, p))
    kept, states, dstates = np.empty(0, np.int64), np.empty((0, A.shape[1])), np.empty((0, A.shape[1], p))
    for b in range(S):
        one = (A[b], B[b], C, K[b], Q[b], R, P0, s0[b], dA[b], dB[b], dK[b], dQ[b], ds0[b])
        out = (errors[b], derrors[b], variances[b], dvariances[b])
        _advance(one, inputs, y, filtered, weigh, *out, kept, states, dstates)
    return Sensitivity(errors, derrors, variances, dvariances)


@compiled
def simulate_path(A, forcing, s0):
    """States of every row, (N + 1, n): ``s[0] = s0``, ``s[k+1] = A s[k] + forcing[k]``."""
    N, n = forcing.shape
    states = np.empty((N + 1, n))
    for i in range(n):
        states[0, i] = s0[i]
    for k in range(N):
        for i in range(n):
            value = forcing[k, i]
            for j in range(n):
                value += A[i, j] * states[k, j]
            states[k + 1, i] = value
    return states


@compiled
def simulate_inverse(A, forcing, heat, c, lowest, highest, lower, upper, s0, ahead):
    """Least heat that keeps the output within a band at the end of every step (paper Eq. inverseQ2).

    Where the band is one value this is the equation itself.  ``ahead > 1`` chooses the heat that, held for so many
    steps, meets the band behind the last of them, and applies it for one: without that the heat into a node that is
    not the measured one rings (``steps_ahead``).

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        By all other inputs.
    heat : ndarray of shape (n,)
        Effect of 1 kW over a step on the states.
    c : ndarray of shape (n,)
    lowest, highest : ndarray of shape (N,)
        Wanted output at the end of each step.
    lower, upper : ndarray of shape (N,)
        What the plant can do over each step [kW].
    s0 : ndarray of shape (n,)
    ahead : int
        1 or more; behind the last row forcing and band stay as they were.

    Returns
    -------
    applied : ndarray of shape (N,)
        The heat over each step [kW]; the state follows what was applied.
    path : ndarray of shape (N,)
        Output at the end of each step under it.
    """
    N, n = forcing.shape
    applied, path = np.empty(N), np.empty(N)
    s, free, held, new = s0.copy(), np.empty(n), np.zeros(n), np.empty(n)
    for _ in range(ahead):
        for i in range(n):
            new[i] = heat[i]
            for j in range(n):
                new[i] += A[i, j] * held[j]
        held[:] = new
    effect = 0.0
    for i in range(n):
        effect += c[i] * held[i]
    for k in range(N):
        free[:] = s
        last = k
        for step in range(ahead):
            last = min(k + step, N - 1)
            for i in range(n):
                new[i] = forcing[last, i]
                for j in range(n):
                    new[i] += A[i, j] * free[j]
            free[:] = new
        output = 0.0
        for i in range(n):
            output += c[i] * free[i]
        wanted = min(max(output, lowest[last]), highest[last])
        applied[k] = min(max((wanted - output) / effect, lower[k]), upper[k])
        path[k] = 0.0
        for i in range(n):
            new[i] = forcing[k, i] + heat[i] * applied[k]
            for j in range(n):
                new[i] += A[i, j] * s[j]
            path[k] += c[i] * new[i]
        s[:] = new
    return applied, path
