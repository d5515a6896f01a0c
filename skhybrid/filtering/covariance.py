"""Steps of a covariance recursion as plain loops: at three rows a library call costs more than the work."""

from __future__ import annotations

from ._compile import compiled


@compiled
def sandwich(A, P, B, work, out):
    """``out += A P B'``."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += A[i, m] * P[m, j]
            work[i, j] = total
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += work[i, m] * B[j, m]
            out[i, j] += total


@compiled
def propagate(A, P, Q, work, out):
    """``out = A P A' + Q``, symmetric to the bit."""
    n = A.shape[0]
    for i in range(n):  # a slice assignment would take seconds to compile, for the shapes that it checks
        for j in range(n):
            out[i, j] = Q[i, j]
    sandwich(A, P, A, work, out)
    for i in range(n):
        for j in range(i):
            middle = 0.5 * (out[i, j] + out[j, i])
            out[i, j] = middle
            out[j, i] = middle
