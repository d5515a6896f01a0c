"""Heat that keeps the output of a network within a band, and the linear-quadratic path that follows wanted values.

Common arguments: ``A`` (n, n); ``forcing`` (N, n) by all other inputs; ``heat`` (2, n), the effect of 1 kW over a step
on the states, first where the plant heats, then where it cools; ``c`` (n,), the output's row; ``lower``, ``upper``
(N,), limits of the plant over each step [kW]; ``s0``, the first states (n,).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled, inlined
from .rows import copy_values

_PASSES = 4  # in which the steps that cool are found, where heating and cooling have different effects


class LoadPath(NamedTuple):
    """A load and the output under it."""

    applied: np.ndarray  # (N,) heat over each step [kW], within the limits
    path: np.ndarray  # (N,) output at the end of each step under it


@inlined
def _step(A, s, forcing, k, heat, side, load, after):
    """``after = A s + forcing[k] + heat[side] load``."""
    for i in range(len(s)):
        value = forcing[k, i] + heat[side, i] * load
        for j in range(len(s)):
            value += A[i, j] * s[j]
        after[i] = value


@inlined
def _output(c, s):
    """``c s``."""
    value = 0.0
    for i in range(len(s)):
        value += c[i] * s[i]
    return value


@compiled
def simulate_inverse(A, forcing, heat, c, lowest, highest, lower, upper, s0, ahead, unforeseen=None):
    """Least heat that keeps the output in [lowest, highest] (N,) at the end of every step (paper Eq. 16).

    Where the band is one value this is the equation itself.  With ``ahead > 1`` each step applies the heat that, held
    for so many steps, meets the band at the end of the last of them: heat into a node that is not the measured one
    would ring otherwise (``control.steps_ahead``).  After the last row forcing and band are held.  An ``unforeseen``
    forcing (N, n), which comes on top, is held from each step on where heat is sought for it.
    """
    N, n = forcing.shape
    applied, path = np.empty(N), np.empty(N)
    s, held, new, effect = s0.copy(), np.empty(n), np.empty(n), np.empty(2)
    for side in range(2):  # effect of 1 kW, held, on the output
        held[:] = 0.0
        for _ in range(ahead):
            _step(A, held, heat, side, heat, side, 0.0, new)
            copy_values(new, held)
        effect[side] = _output(c, held)
    for k in range(N):
        copy_values(s, held)  # without any heat
        last = k
        for step in range(ahead):
            last = min(k + step, N - 1)
            _step(A, held, forcing, last, heat, 0, 0.0, new)
            if unforeseen is not None:
                new += unforeseen[k]
            copy_values(new, held)
        output = _output(c, held)
        wanted = min(max(output, lowest[last]), highest[last])
        side = 0 if wanted >= output else 1
        applied[k] = min(max((wanted - output) / effect[side], lower[k]), upper[k])
        side = 0 if applied[k] >= 0.0 else 1
        _step(A, s, forcing, k, heat, side, applied[k], new)
        if unforeseen is not None:
            new += unforeseen[k]
        path[k] = _output(c, new)
        copy_values(new, s)
    return LoadPath(applied, path)


@compiled
def _optimal_step(P, p, F, b, drift, penalty, Pb, Pf, PF, gains, k):
    """Write row k of ``gains``, the best heat by the state and the heat before, and return its constant.

    The cost to go after the step is ``z' P z + 2 p' z``; ``P b``, ``P drift`` and ``P F`` are kept for its update.
    """
    m = len(b)
    curvature, slope = penalty, 0.0
    for i in range(m):
        Pb[i] = Pf[i] = 0.0
        for j in range(m):
            Pb[i] += P[i, j] * b[j]
            Pf[i] += P[i, j] * drift[j]
            PF[i, j] = 0.0
            for q in range(m):
                PF[i, j] += P[i, q] * F[q, j]
        curvature += b[i] * Pb[i]
        slope += b[i] * (Pf[i] + p[i])
    for j in range(m):
        value = penalty if j == m - 1 else 0.0
        for i in range(m - 1):
            value -= Pb[i] * F[i, j]
        gains[k, j] = value / curvature
    return -slope / curvature


@compiled
def _update_cost(P, p, F, b, penalty, gains, k, offset, Pb, Pf, PF, closed):
    """Cost to go before a step from that after it, in place; with the best heat put in, squares of it cancel."""
    m = len(b)
    n = m - 1
    for i in range(m):
        for j in range(m):
            closed[i, j] = F[i, j] + b[i] * gains[k, j]
        Pf[i] += Pb[i] * offset + p[i]
    for i in range(m):
        p[i] = 0.0
        for j in range(m):
            p[i] += F[j, i] * Pf[j]
            P[i, j] = 0.0
            for q in range(m):
                P[i, j] += PF[q, i] * closed[q, j]
    p[n] -= penalty * offset
    for j in range(m):
        P[n, j] -= penalty * gains[k, j]
    P[n, n] += penalty
    for i in range(m):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@compiled
def _feedback_law(A, forcing, heat, sides, c, wanted, penalty, beyond):
    """Best heat of each step by the state and the heat before (N, n + 1), and a constant (N,).

    ``sides`` (N,) are the rows of ``heat`` that act.  Dynamic programming from ``beyond`` steps after the last row back
    to the first, with the heat of the step before as one more state.  At the end the cost to go is 0.
    """
    N, n = forcing.shape
    m = n + 1
    gains, offsets = np.zeros((N, m)), np.zeros(N)
    P, p, PF, closed = np.zeros((m, m)), np.zeros(m), np.zeros((m, m)), np.zeros((m, m))
    Pb, Pf, drift = np.zeros(m), np.zeros(m), np.zeros(m)
    F, b = np.zeros((m, m)), np.ones(m)
    for i in range(n):
        copy_values(A[i], F[i])
    for step in range(N + beyond - 1, -1, -1):
        k = min(step, N - 1)
        copy_values(heat[sides[k]], b)
        change_penalty = penalty if step > 0 else 0.0  # there is no heat before the first step
        copy_values(forcing[k], drift)
        for i in range(n):
            p[i] -= c[i] * wanted[k]
            for j in range(n):
                P[i, j] += c[i] * c[j]
        offsets[k] = _optimal_step(P, p, F, b, drift, change_penalty, Pb, Pf, PF, gains, k)
        _update_cost(P, p, F, b, change_penalty, gains, k, offsets[k], Pb, Pf, PF, closed)
    return gains, offsets


@compiled
def solve_lq_path(A, forcing, heat, c, wanted, penalty, lower, upper, s0, beyond):
    """Heat whose output is near ``wanted`` (N,), at the end of each step, while it changes little from step to step.

    The minimum of ``sum (output - wanted)^2 + penalty sum (change of heat)^2`` over the remaining steps, from the state
    and the heat before; at a limit the heat is clipped, and the later steps go on from there.  Without limits it is the
    minimum over all steps.  The heat of the first row is free; ``beyond`` steps after the last row count too, with
    forcing and wanted output held.  ``penalty`` is positive [squared output per kW2].  Where heating and cooling have
    different effects, the steps that cool are those of the pass before.
    """
    N, n = forcing.shape
    applied, path, sides = np.empty(N), np.empty(N), np.zeros(N, np.int64)
    s, new, alike = np.empty(n), np.empty(n), True
    for i in range(n):
        alike = alike and heat[0, i] == heat[1, i]
    for _ in range(_PASSES):
        gains, offsets = _feedback_law(A, forcing, heat, sides, c, wanted, penalty, beyond)
        copy_values(s0, s)
        before, n_moved = 0.0, 0
        for k in range(N):
            best = offsets[k] + gains[k, n] * before
            for i in range(n):
                best += gains[k, i] * s[i]
            before = applied[k] = min(max(best, lower[k]), upper[k])
            side = 0 if before >= 0.0 else 1
            n_moved += side != sides[k]
            sides[k] = side
            _step(A, s, forcing, k, heat, side, before, new)
            path[k] = _output(c, new)
            copy_values(new, s)
        if n_moved == 0 or alike:
            break
    return LoadPath(applied, path)
