"""Covariance recursions of the Kalman filter as plain loops: at three rows a library call costs more than the work."""

from __future__ import annotations

from ._compile import compiled, inlined


@compiled
def propagate(A, P, Q, AP):
    """``P = A P A' + Q``, in place and symmetric to the bit; ``AP`` (n, n) becomes ``A P``."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += A[i, m] * P[m, j]
            AP[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = Q[i, j]
            for m in range(n):
                total += AP[i, m] * A[j, m]
            P[i, j] = total
            P[j, i] = total


@inlined
def measure(P, c, R, gain):
    """Update P by a measurement ``c x`` of variance R, in place; writes ``gain`` (n,), returns the error's variance."""
    n, S = len(c), R
    for i in range(n):
        gain[i] = 0.0
        for m in range(n):
            gain[i] += P[i, m] * c[m]
        S += c[i] * gain[i]
    for i in range(n):
        gain[i] /= S
    for i in range(n):
        for m in range(n):
            P[i, m] -= S * (gain[i] * gain[m])  # symmetric to the bit
    return S


@compiled
def update_covariance(P, dP, C, R, seen, gain, dgain, Pc, dPc):
    """Update a covariance and its derivatives by one row's measurements, one after the other, in place.

    Writes ``gain`` (o, n) and ``dgain`` (o, n, p) and returns the largest change of any gain, or relative change of any
    of its derivatives; ``Pc`` (n,) and ``dPc`` (n, p) are work space.
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
def propagate_covariance(A, Q, dA, dQ, P, dP, AP, AdP, work):
    """Propagate a covariance and its derivatives by one row, in place; ``AP``, ``AdP`` and ``work`` are work space."""
    n, p = A.shape[0], dP.shape[2]
    propagate(A, P, Q, AP)
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
