"""Errors of forecasts at several leads: simulated responses, filtered differences from them, and sensitivities.

A forecast from row o is the simulated response plus the filtered difference of the measurement from it,
``y_hat[o + h] = s[o + h] + c F^h x[o|o]`` with x the filter's state on ``y - s``.  All of it is linear in the inputs,
so each input's response is filtered as the measurement is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import propagate_covariance, update_covariance
from .rows import copy_values, load_row, store_row


class FilterGains(NamedTuple):
    """Kalman gains of every row, 0 where nothing was measured, and the variance after the last row."""

    gains: np.ndarray  # (N, m) effect of an error on the state of its own row
    dgains: np.ndarray  # (N, m, p)
    variance: np.ndarray  # (m, m) before the row after the last one, with which a next segment begins


class InputStates(NamedTuple):
    """States of a network under each of J inputs by itself."""

    last: np.ndarray  # (n, J) at the last row, before its inputs
    after: np.ndarray  # (n, J) at the row after it


class FilteredSeries(NamedTuple):
    """Filtered states of J series."""

    states: np.ndarray  # (n_origins, m, J) at the origins, each given its own row
    last: np.ndarray  # (m, J) at the last row, given it
    after: np.ndarray  # (m, J) at the row after it


class LeadSensitivity(NamedTuple):
    """One simulated series and the filtered difference of the measurement from it, with derivatives."""

    response: np.ndarray  # (N,) simulated output
    dresponse: np.ndarray  # (N, p)
    states: np.ndarray  # (n_origins, m) filtered states, given the origin's own row
    dstates: np.ndarray  # (n_origins, m, p)


@compiled
def filter_gains(A, Q, c, R, P0, dA, dQ, seen):
    """Kalman gains of every row and their derivatives; 0 where ``seen`` (N,) is False.

    ``A``, ``Q``, ``P0`` (m, m); ``dA``, ``dQ`` (m, m, p); ``c`` (m,) measures the state with variance ``R``.
    """
    m, p, N = A.shape[0], dA.shape[2], len(seen)
    gains, dgains = np.zeros((N, m)), np.zeros((N, m, p))
    C, noise, measured = c.copy().reshape(1, m), np.empty(1), np.ones(1, np.bool_)
    noise[0] = R
    P, dP = P0.copy(), np.zeros((m, m, p))
    gain, dgain, Pc, dPc = np.zeros((1, m)), np.zeros((1, m, p)), np.empty(m), np.empty((m, p))
    AP, AdP, work = np.empty((m, m)), np.empty((m, m, p)), np.empty((m, m, p))
    steady = False
    for k in range(N):
        # with every row measured the gains settle; from then on they are left as they are, to rounding
        if not (steady and seen[k]):
            change = 1.0
            if seen[k]:
                change = update_covariance(P, dP, C, noise, measured, gain, dgain, Pc, dPc)
            propagate_covariance(A, Q, dA, dQ, P, dP, AP, AdP, work)
            steady = seen[k] and change < 1e-12
        if seen[k]:
            for i in range(m):
                gains[k, i] = gain[0, i]
                for q in range(p):
                    dgains[k, i, q] = dgain[0, i, q]
    return FilterGains(gains, dgains, P)


@compiled
def _propagate(A, x, after):
    """``after = A x`` for the columns of x."""
    n, J = x.shape
    for i in range(n):
        # views of rows, so that the innermost loop runs on several numbers at once
        row, first, a = after[i], x[0], A[i, 0]
        for j in range(J):
            row[j] = a * first[j]
        for r in range(1, n):
            other, a = x[r], A[i, r]
            if a != 0.0:
                for j in range(J):
                    row[j] += a * other[j]


@compiled
def _padded(begin):
    """Columns (n, J) with columns of 0 after them: loops over a multiple of 16 numbers have no slow rest."""
    n, J = begin.shape
    wide = np.zeros((n, J + -J % 16))
    for i in range(n):
        copy_values(begin[i], wide[i])
    return wide


@compiled
def simulate_inputs(A, B, V, node, begin, out):
    """Simulate state ``node`` of a network under each of J inputs by itself, into ``out`` (N, J).

    ``A`` (n, n); ``B`` (n, J), the effect of a unit of each input over a step; ``V`` (N, J); ``begin`` (n, J), the
    states at the first row.
    """
    n, J = B.shape
    N = V.shape[0]
    x, after = _padded(begin), _padded(begin)
    for k in range(N):
        x, after = after, x
        copy_values(x[node, :J], out[k])
        _propagate(A, x, after)
        for i in range(n):
            row, effect, given = after[i], B[i], V[k]
            for j in range(J):
                row[j] += effect[j] * given[j]
    return InputStates(x[:, :J].copy(), after[:, :J].copy())


@compiled
def filter_series(A, gains, node, S, origins, begin):
    """Filtered states of J series ``S`` (N, J), measurements of state ``node``, at increasing ``origins``.

    ``A`` (m, m); ``gains`` (N, m), a row of gain 0 is not read; ``begin`` (m, J), the states before the first row is
    read.
    """
    m = A.shape[0]
    N, J = S.shape
    states = np.empty((len(origins), m, J))
    x, after = _padded(begin), _padded(begin)
    error, at = np.zeros(x.shape[1]), 0
    for k in range(N):
        x, after = after, x
        if gains[k, node] != 0.0:
            measured, expected = S[k], x[node]
            for j in range(J):
                error[j] = measured[j] - expected[j]
            for i in range(m):
                row, gain = x[i], gains[k, i]
                for j in range(len(error)):
                    row[j] += gain * error[j]
        while at < len(origins) and origins[at] == k:
            for i in range(m):
                copy_values(x[i, :J], states[at, i])
            at += 1
        _propagate(A, x, after)
    return FilteredSeries(states, x[:, :J].copy(), after[:, :J].copy())


@compiled
def _add_product(A, dA, x, dx, out, dout):
    """``out += A x`` and its derivatives."""
    n, p = A.shape[0], dA.shape[2]
    for i in range(n):
        for r in range(n):
            out[i] += A[i, r] * x[r]
            for q in range(p):
                dout[i, q] += dA[i, r, q] * x[r] + A[i, r] * dx[r, q]


@compiled
def _filter_error(gains, dgains, k, e, de, x, dx):
    """Update the filter's state and its derivatives by row k's error ``e`` and its derivatives ``de``, in place."""
    for i in range(len(x)):
        x[i] += gains[k, i] * e
        for q in range(len(de)):
            dx[i, q] += dgains[k, i, q] * e + gains[k, i] * de[q]


@compiled
def lead_sensitivities(A, dA, forcing, dforcing, F, dF, gains, dgains, node, y, origins):
    """Simulate one series and filter the difference of the measurement from it, with exact derivatives of both.

    The network ``A`` (n, n) under ``forcing`` (N, n) and the filter ``F`` (m, m) with ``gains`` (N, m) both measure
    state ``node``; ``dA``, ``dforcing``, ``dF`` and ``dgains`` have a last axis p.  Rows of ``y`` (N,) of gain 0 are
    not read; ``origins`` increase.
    """
    n, m, p, N = A.shape[0], F.shape[0], dA.shape[2], forcing.shape[0]
    response, dresponse = np.empty(N), np.empty((N, p))
    states, dstates = np.empty((len(origins), m)), np.empty((len(origins), m, p))
    s, ds, x, dx = np.zeros(n), np.zeros((n, p)), np.zeros(m), np.zeros((m, p))
    s_after, ds_after, x_after, dx_after = np.empty(n), np.empty((n, p)), np.empty(m), np.empty((m, p))
    nothing, dnothing, de = np.zeros((1, m)), np.zeros((1, m, p)), np.empty(p)
    at = 0
    for k in range(N):
        response[k] = s[node]
        for q in range(p):
            dresponse[k, q] = ds[node, q]
        if gains[k, node] != 0.0:
            for q in range(p):
                de[q] = -ds[node, q] - dx[node, q]
            _filter_error(gains, dgains, k, y[k] - s[node] - x[node], de, x, dx)
        while at < len(origins) and origins[at] == k:
            store_row(x, dx, states, dstates, at)
            at += 1
        load_row(forcing, dforcing, k, s_after, ds_after)
        _add_product(A, dA, s, ds, s_after, ds_after)
        load_row(nothing, dnothing, 0, x_after, dx_after)
        _add_product(F, dF, x, dx, x_after, dx_after)
        s, s_after, ds, ds_after = s_after, s, ds_after, ds
        x, x_after, dx, dx_after = x_after, x, dx_after, dx
    return LeadSensitivity(response, dresponse, states, dstates)


@compiled
def lead_errors(S, states, P, origins, leads, weight):
    """Weighted errors (n_origins L, J) of each series at each origin and lead, ``S[o + h] - P[h] x[o]``.

    ``S`` (N, J), ``states`` x (n_origins, m, J), ``P`` (L, m), ``weight`` (n_origins, L); where it is 0 nothing is
    read.
    """
    n_origins, m, J = states.shape
    L = len(leads)
    out = np.empty((n_origins * L, J))
    for o in range(n_origins):
        for h in range(L):
            w, row = weight[o, h], out[o * L + h]
            if w == 0.0:
                row[:] = 0.0
                continue
            simulated = S[origins[o] + leads[h]]
            for j in range(J):
                row[j] = w * simulated[j]
            for i in range(m):
                a, x = w * P[h, i], states[o, i]
                for j in range(J):
                    row[j] -= a * x[j]
    return out
