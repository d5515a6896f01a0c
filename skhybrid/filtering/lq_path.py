"""Heat that follows a wanted path without swinging: a linear-quadratic regulator that knows the path to its end."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def _law(A, forcing, heat, c, wanted, penalty, beyond):
    """Best heat of every step by the state and the heat of the step before, and a constant: (N, n + 1) and (N,).

    Dynamic programming from ``beyond`` the last step back.  What is still to be paid is quadratic in the state and
    the heat before, ``z' P z + 2 p' z``; at the end it is nothing.
    """
    N, n = forcing.shape
    m = n + 1
    gains, offsets = np.zeros((N, m)), np.zeros(N)
    P, p, PA, closed = np.zeros((m, m)), np.zeros(m), np.zeros((m, m)), np.zeros((m, m))
    Pb, Pf, drift = np.zeros(m), np.zeros(m), np.zeros(m)
    F, b = np.zeros((m, m)), np.ones(m)
    F[:n, :n], b[:n] = A, heat
    for step in range(N + beyond - 1, -1, -1):
        k = min(step, N - 1)
        of_change = penalty if step > 0 else 0.0  # nothing is known before the first step
        drift[:n] = forcing[k]
        for i in range(n):
            p[i] -= c[i] * wanted[k]
            for j in range(n):
                P[i, j] += c[i] * c[j]
        curvature, slope = of_change, 0.0
        for i in range(m):
            Pb[i] = Pf[i] = 0.0
            for j in range(m):
                Pb[i] += P[i, j] * b[j]
                Pf[i] += P[i, j] * drift[j]
                PA[i, j] = 0.0
                for q in range(m):
                    PA[i, j] += P[i, q] * F[q, j]
            curvature += b[i] * Pb[i]
            slope += b[i] * (Pf[i] + p[i])
        offsets[k] = -slope / curvature
        for j in range(m):
            value = of_change if j == n else 0.0
            for i in range(n):
                value -= Pb[i] * F[i, j]
            gains[k, j] = value / curvature
        for i in range(m):
            for j in range(m):
                closed[i, j] = F[i, j] + b[i] * gains[k, j]
            Pf[i] += Pb[i] * offsets[k] + p[i]
        # with the best heat put in, the other terms of its square cancel
        for i in range(m):
            p[i] = 0.0
            for j in range(m):
                p[i] += F[j, i] * Pf[j]
                P[i, j] = 0.0
                for q in range(m):
                    P[i, j] += PA[q, i] * closed[q, j]
        p[n] -= of_change * offsets[k]
        for j in range(m):
            P[n, j] -= of_change * gains[k, j]
        P[n, n] += of_change
        for i in range(m):
            for j in range(i):
                P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
    return gains, offsets


@compiled
def solve_lq_path(A, forcing, heat, c, wanted, penalty, lower, upper, s0, beyond):
    """Heat whose output is near a path while it changes little from step to step.

    The least of ``sum (output - wanted)^2 + penalty sum (change of heat)^2`` over the steps that are left, from the
    state and the heat that came before; at a limit the heat is cut, and what follows goes on from there.  Without
    limits it is the least over all steps.  The heat of the first row is free.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        By all other inputs.
    heat : ndarray of shape (n,)
        Effect of 1 kW over a step on the states.
    c : ndarray of shape (n,)
    wanted : ndarray of shape (N,)
        Output at the end of each step.
    penalty : float
        Positive, squared output per squared kW.
    lower, upper : ndarray of shape (N,)
        What the plant can do over each step [kW].
    s0 : ndarray of shape (n,)
    beyond : int
        Steps behind the last row that count too, forcing and path being as they were.

    Returns
    -------
    applied : ndarray of shape (N,)
        The heat over each step [kW].
    path : ndarray of shape (N,)
        Output at the end of each step under it.
    """
    N, n = forcing.shape
    gains, offsets = _law(A, forcing, heat, c, wanted, penalty, beyond)
    applied, path = np.empty(N), np.zeros(N)
    s, new, before = s0.copy(), np.empty(n), 0.0
    for k in range(N):
        best = offsets[k] + gains[k, n] * before
        for i in range(n):
            best += gains[k, i] * s[i]
        before = applied[k] = min(max(best, lower[k]), upper[k])
        for i in range(n):
            new[i] = forcing[k, i] + heat[i] * before
            for j in range(n):
                new[i] += A[i, j] * s[j]
            path[k] += c[i] * new[i]
        s[:] = new
    return applied, path
