"""Weights that are not negative and sum to 1, with the least quadratic loss."""

from __future__ import annotations

import numpy as np

from ._compile import compiled
from .rows import copy_values


@compiled
def simplex_weights(M, pulled):
    """Weights (G, K) that minimise ``w' M w - 2 pulled' w`` for each of the positive definite M (G, K, K).

    The stationary point on every face of the simplex is tried, so K is to be small.
    """
    G, K = M.shape[:2]
    out, w = np.empty((G, K)), np.empty(K)
    for g in range(G):
        out[g] = np.nan
        least = np.inf
        for face in range(1, 2**K):
            _stationary(M[g], pulled, face, w)
            if w.min() < -1e-12:
                continue
            loss = 0.0
            for i in range(K):
                for j in range(K):
                    loss += w[i] * M[g, i, j] * w[j]
                loss -= 2.0 * pulled[i] * w[i]
            if loss < least:
                least = loss
                copy_values(w, out[g])
    return out


@compiled
def _stationary(M, pulled, face, w):
    """Write weights (K,) that sum to 1 and make the loss stationary on a ``face``, whose members are its set bits."""
    K = len(w)
    own, n = np.empty(K, np.int64), 0
    for i in range(K):
        if face >> i & 1:
            own[n] = i
            n += 1
    A = np.empty((n, n + 2))  # of the members: M, and the right sides of the free solution and of its slope
    for i in range(n):
        for j in range(n):
            A[i, j] = M[own[i], own[j]]
        A[i, n], A[i, n + 1] = pulled[own[i]], 1.0
    for i in range(n):
        for r in range(n):
            if r != i:
                share = A[r, i] / A[i, i]
                for j in range(i, n + 2):
                    A[r, j] -= share * A[i, j]
    free, slope = 0.0, 0.0
    for i in range(n):
        A[i, n] /= A[i, i]
        A[i, n + 1] /= A[i, i]
        free += A[i, n]
        slope += A[i, n + 1]
    w[:] = 0.0
    for i in range(n):
        w[own[i]] = A[i, n] + A[i, n + 1] * (1.0 - free) / slope
