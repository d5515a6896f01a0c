"""Simulation of a discrete state-space model, of a low-pass, and of autoregressions with inputs."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def simulate_path(A, forcing, s0):
    """States (N + 1, n) under ``forcing`` (N, n): ``s[0] = s0``, ``s[k+1] = A s[k] + forcing[k]``."""
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


def low_pass(series, decay, start):
    """``z[k] = decay z[k-1] + (1 - decay) series[k]`` over the rows of a series (N, ...), from ``z[-1] = start``.

    ``decay`` and ``start`` are numbers, or one for each column.
    """
    columns = np.ascontiguousarray(series, dtype=np.float64).reshape(len(series), -1)
    each = np.empty((2, columns.shape[1]))
    each[0], each[1] = np.ravel(decay), np.ravel(start)
    return _low_pass(columns, each[0], each[1]).reshape(np.shape(series))


@compiled
def _low_pass(series, decay, start):
    """The same for a series (N, m), of which each column has its decay and start (m,)."""
    out, last = np.empty_like(series), start.copy()
    for k in range(len(series)):
        for j in range(len(last)):
            last[j] = decay[j] * last[j] + (1.0 - decay[j]) * series[k, j]
            out[k, j] = last[j]
    return out


@compiled
def iterate_lags(begin, coefs, driven, first, n_leads, lowest, highest):
    """Values (n, n_leads) of n autoregressions after ``begin`` (n, n_lags), held within [lowest, highest].

    The change over a step is a row of ``driven`` (N,), from row ``first`` (n,) on, plus ``coefs`` (n, n_lags) times the
    last values, the oldest first.  After its end the last row of ``driven`` holds.
    """
    n, n_lags = begin.shape
    # a column for each, so that the innermost loop runs on several at once
    values, effects = np.empty((n_lags + n_leads, n)), coefs.T.copy()
    for i in range(n):
        for lag in range(n_lags):
            values[lag, i] = begin[i, lag]
    for lead in range(n_leads):
        value, last = values[n_lags + lead], values[n_lags + lead - 1]
        for i in range(n):
            value[i] = driven[min(first[i] + lead, len(driven) - 1)]
        for lag in range(n_lags):
            effect, before = effects[lag], values[lead + lag]
            for i in range(n):
                value[i] += effect[i] * before[i]
        for i in range(n):
            value[i] = min(max(last[i] + value[i], lowest), highest)
    return values[n_lags:].T
