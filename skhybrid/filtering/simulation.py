"""Simulation of a discrete state-space model."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def simulate_path(A, forcing, s0):
    """States of every row: ``s[0] = s0``, ``s[k+1] = A s[k] + forcing[k]``.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        By all inputs.
    s0 : ndarray of shape (n,)

    Returns
    -------
    ndarray of shape (N + 1, n)
    """
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
