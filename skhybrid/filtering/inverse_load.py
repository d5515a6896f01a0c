"""Inverse of the load: the heat that keeps the output of a network within a band (paper Eq. inverseQ2)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled


class LoadPath(NamedTuple):
    """A load and the output under it."""

    applied: np.ndarray  # (N,) heat over each step [kW], within the limits
    path: np.ndarray  # (N,) output at the end of each step under it


@compiled
def simulate_inverse(A, forcing, heat, c, lowest, highest, lower, upper, s0, ahead):
    """Least heat that keeps the output within a band at the end of every step (paper Eq. inverseQ2).

    Where the band is one value this is the equation itself.  With ``ahead > 1`` each step applies the heat that, held
    for so many steps, meets the band at the end of the last of them: heat into a node that is not the measured one
    would ring otherwise (``control.steps_ahead``).

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        By all other inputs.
    heat : ndarray of shape (n,)
        Effect of 1 kW over a step on the states.
    c : ndarray of shape (n,)
    lowest, highest : ndarray of shape (N,)
        Band of the output at the end of each step.
    lower, upper : ndarray of shape (N,)
        Limits of the plant over each step [kW].
    s0 : ndarray of shape (n,)
    ahead : int
        1 or more; after the last row forcing and band are held.

    Returns
    -------
    LoadPath
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
    effect = 0.0  # of 1 kW, held, on the output
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
    return LoadPath(applied, path)
