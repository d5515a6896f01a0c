"""Errors of forecasts at several leads: simulated responses, what a filter makes of them, and their sensitivities.

A forecast from row o is the simulated response plus what the filter has seen of the difference from it,
``y_hat[o + h] = s[o + h] + c A^h x[o|o]`` with x the filter on ``y - s``.  All of it is linear in the inputs, so that
each input's response is filtered as the measurement is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .innovations import _correct, _spread


class LeadSensitivity(NamedTuple):
    """One simulated series and what the filter holds of the measurement's difference from it, with derivatives."""

    response: np.ndarray  # (N,) simulated output
    dresponse: np.ndarray  # (N, p)
    states: np.ndarray  # (n_origins, m) filtered, given the origin's own row
    dstates: np.ndarray  # (n_origins, m, p)


@compiled
def filter_gains(A, Q, c, R, P0, dA, dQ, seen):
    """Kalman gains of every row and their derivatives; 0 where nothing was measured.

    Parameters
    ----------
    A, Q, P0 : ndarray of shape (m, m)
    c : ndarray of shape (m,)
    R : float
        Measurement variance.
    dA, dQ : ndarray of shape (m, m, p)
    seen : ndarray of bool, shape (N,)

    Returns
    -------
    gains, dgains : ndarray
        (N, m) and (N, m, p): what an error adds to the state of its own row.
    P : ndarray of shape (m, m)
        Variance before the row behind the last one, with which a next segment begins.
    """
    m, p, N = A.shape[0], dA.shape[2], len(seen)
    gains, dgains = np.zeros((N, m)), np.zeros((N, m, p))
    C, noise, measured = c.copy().reshape(1, m), np.full(1, R), np.ones(1, np.bool_)
    P, dP = P0.copy(), np.zeros((m, m, p))
    gain, dgain, Pc, dPc = np.zeros((1, m)), np.zeros((1, m, p)), np.empty(m), np.empty((m, p))
    AP, AdP, work = np.empty((m, m)), np.empty((m, m, p)), np.empty((m, m, p))
    steady = False
    for k in range(N):
        # with every row measured the gains settle; from then on they are left as they are, to rounding
        if not (steady and seen[k]):
            moved = 1.0
            if seen[k]:
                moved = _correct(P, dP, C, noise, measured, gain, dgain, Pc, dPc)
            _spread(A, Q, dA, dQ, P, dP, AP, AdP, work)
            steady = seen[k] and moved < 1e-12
        if seen[k]:
            for i in range(m):
                gains[k, i] = gain[0, i]
                for q in range(p):
                    dgains[k, i, q] = dgain[0, i, q]
    return gains, dgains, P


@compiled
def _propagate(A, x, ahead):
    """``ahead = A x`` for the columns of x."""
    n, J = x.shape
    for i in range(n):
        # views of rows, so that the innermost loop runs on several numbers at once
        row, first, a = ahead[i], x[0], A[i, 0]
        for j in range(J):
            row[j] = a * first[j]
        for r in range(1, n):
            other, a = x[r], A[i, r]
            if a != 0.0:
                for j in range(J):
                    row[j] += a * other[j]


@compiled
def simulate_inputs(A, B, V, node, begin, out):
    """Output of a network under each of J inputs by itself.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    B : ndarray of shape (n, J)
        Effect of one unit of each input over a step on the states.
    V : ndarray of shape (N, J)
    node : int
        The state that is the output.
    begin : ndarray of shape (n, J)
        States at the first row.
    out : ndarray of shape (N, J)
        The outputs are written here.

    Returns
    -------
    here, ahead : ndarray of shape (n, J)
        States at the last row, and at the one behind it.
    """
    n, J = B.shape
    N = V.shape[0]
    x, ahead = begin.copy(), begin.copy()
    for k in range(N):
        x, ahead = ahead, x
        for j in range(J):
            out[k, j] = x[node, j]
        _propagate(A, x, ahead)
        for i in range(n):
            for j in range(J):
                ahead[i, j] += B[i, j] * V[k, j]
    return x, ahead


@compiled
def filter_series(A, gains, node, S, origins, begin):
    """Filtered states of J series at the origins, each given its own rows up to the origin.

    Parameters
    ----------
    A : ndarray of shape (m, m)
    gains : ndarray of shape (N, m)
    node : int
        The state that is measured.
    S : ndarray of shape (N, J)
        Measured series; a row whose gain is 0 is not read.
    origins : ndarray of int, shape (n_origins,)
        Increasing.
    begin : ndarray of shape (m, J)
        States at the first row, before it is read.

    Returns
    -------
    states : ndarray of shape (n_origins, m, J)
    last : ndarray of shape (m, J)
        States at the last row, given it.
    ahead : ndarray of shape (m, J)
        States at the row behind it.
    """
    m = A.shape[0]
    N, J = S.shape
    states = np.empty((len(origins), m, J))
    x, ahead, error = begin.copy(), begin.copy(), np.empty(J)
    at = 0
    for k in range(N):
        x, ahead = ahead, x
        if gains[k, node] != 0.0:
            for j in range(J):
                error[j] = S[k, j] - x[node, j]
            for i in range(m):
                g = gains[k, i]
                for j in range(J):
                    x[i, j] += g * error[j]
        while at < len(origins) and origins[at] == k:
            for i in range(m):
                for j in range(J):
                    states[at, i, j] = x[i, j]
            at += 1
        _propagate(A, x, ahead)
    return states, x, ahead


@compiled
def lead_sensitivities(A, dA, forcing, dforcing, F, dF, gains, dgains, node, y, origins):
    """Simulate one series, filter the measurement's difference from it, with exact derivatives of both.

    Parameters
    ----------
    A, dA : ndarray of shape (n, n) and (n, n, p)
        The network over one step.
    forcing, dforcing : ndarray of shape (N, n) and (N, n, p)
        What all inputs add to the states.
    F, dF : ndarray of shape (m, m) and (m, m, p)
        The filter's transition.
    gains, dgains : ndarray of shape (N, m) and (N, m, p)
    node : int
        The state that is measured, in both.
    y : ndarray of shape (N,)
        Measurements; a row whose gain is 0 is not read.
    origins : ndarray of int, shape (n_origins,)
        Increasing.

    Returns
    -------
    LeadSensitivity
    """
    n, m, p, N = A.shape[0], F.shape[0], dA.shape[2], forcing.shape[0]
    response, dresponse = np.empty(N), np.empty((N, p))
    states, dstates = np.empty((len(origins), m)), np.empty((len(origins), m, p))
    s, ds, s2, ds2 = np.zeros(n), np.zeros((n, p)), np.empty(n), np.empty((n, p))
    x, dx, x2, dx2 = np.zeros(m), np.zeros((m, p)), np.empty(m), np.empty((m, p))
    de = np.empty(p)
    at = 0
    for k in range(N):
        response[k] = s[node]
        for q in range(p):
            dresponse[k, q] = ds[node, q]
        if gains[k, node] != 0.0:
            e = y[k] - s[node] - x[node]
            for q in range(p):
                de[q] = -ds[node, q] - dx[node, q]
            for i in range(m):
                x[i] += gains[k, i] * e
                for q in range(p):
                    dx[i, q] += dgains[k, i, q] * e + gains[k, i] * de[q]
        while at < len(origins) and origins[at] == k:
            for i in range(m):
                states[at, i] = x[i]
                for q in range(p):
                    dstates[at, i, q] = dx[i, q]
            at += 1
        for i in range(n):
            value = forcing[k, i]
            for q in range(p):
                ds2[i, q] = dforcing[k, i, q]
            for r in range(n):
                value += A[i, r] * s[r]
                for q in range(p):
                    ds2[i, q] += dA[i, r, q] * s[r] + A[i, r] * ds[r, q]
            s2[i] = value
        for i in range(m):
            value = 0.0
            for q in range(p):
                dx2[i, q] = 0.0
            for r in range(m):
                value += F[i, r] * x[r]
                for q in range(p):
                    dx2[i, q] += dF[i, r, q] * x[r] + F[i, r] * dx[r, q]
            x2[i] = value
        s, s2, ds, ds2 = s2, s, ds2, ds
        x, x2, dx, dx2 = x2, x, dx2, dx
    return LeadSensitivity(response, dresponse, states, dstates)


@compiled
def lead_errors(S, states, P, origins, leads, weight):
    """Weighted errors of every series at every (lead, origin), ``S[o + h] - P[h] x[o]``.

    Parameters
    ----------
    S : ndarray of shape (N, J)
    states : ndarray of shape (n_origins, m, J)
    P : ndarray of shape (L, m)
    origins, leads : ndarray of int, shape (n_origins,) and (L,)
    weight : ndarray of shape (n_origins, L)
        Rows of weight 0 are not read.

    Returns
    -------
    ndarray of shape (n_origins * L, J)
    """
    n_origins, m, J = states.shape
    L = len(leads)
    out = np.zeros((n_origins * L, J))
    for o in range(n_origins):
        for h in range(L):
            w = weight[o, h]
            if w == 0.0:
                continue
            row, simulated = out[o * L + h], S[origins[o] + leads[h]]
            for j in range(J):
                row[j] = w * simulated[j]
            for i in range(m):
                a, held = w * P[h, i], states[o, i]
                for j in range(J):
                    row[j] -= a * held[j]
    return out


@compiled
def lead_rows(F, dF, node, leads):
    """Row ``c F^h`` of every lead h, and its derivatives.

    Parameters
    ----------
    F, dF : ndarray of shape (m, m) and (m, m, p)
    node : int
        The state that c measures.
    leads : ndarray of int, shape (L,)
        Increasing.

    Returns
    -------
    rows, drows : ndarray of shape (L, m) and (L, m, p)
    """
    m, p, L = F.shape[0], dF.shape[2], len(leads)
    rows, drows = np.empty((L, m)), np.empty((L, m, p))
    row, drow, row2, drow2 = np.zeros(m), np.zeros((m, p)), np.empty(m), np.empty((m, p))
    row[node] = 1.0
    at = 0
    for h in range(1, leads[-1] + 1):
        for j in range(m):
            value = 0.0
            for q in range(p):
                drow2[j, q] = 0.0
            for i in range(m):
                value += row[i] * F[i, j]
                for q in range(p):
                    drow2[j, q] += drow[i, q] * F[i, j] + row[i] * dF[i, j, q]
            row2[j] = value
        row, row2, drow, drow2 = row2, row, drow2, drow
        if h == leads[at]:
            for j in range(m):
                rows[at, j] = row[j]
                for q in range(p):
                    drows[at, j, q] = drow[j, q]
            at += 1
    return rows, drows
