"""Rows that give the output some steps ahead of a state: ``C A^h``, with derivatives."""

from __future__ import annotations

import numpy as np

from ._compile import compiled
from .rows import store_row


@compiled
def output_powers(A, dA, C, powers):
    """``C A^h`` (L, o, n) at increasing powers h >= 0, and its derivatives (L, o, n, p); ``C`` (o, n) has none."""
    (o, n), p, L = C.shape, dA.shape[2], len(powers)
    rows, drows = np.empty((L, o, n)), np.empty((L, o, n, p))
    row, drow, new, dnew = C.copy(), np.zeros((o, n, p)), np.empty((o, n)), np.empty((o, n, p))
    at = 0
    for h in range(powers[-1] + 1):
        if h == powers[at]:
            for j in range(o):
                store_row(row[j], drow[j], rows[at], drows[at], j)
            at += 1
        for j in range(o):
            for i in range(n):
                value = 0.0
                for q in range(p):
                    dnew[j, i, q] = 0.0
                for r in range(n):
                    value += row[j, r] * A[r, i]
                    for q in range(p):
                        dnew[j, i, q] += drow[j, r, q] * A[r, i] + row[j, r] * dA[r, i, q]
                new[j, i] = value
        row, new, drow, dnew = new, row, dnew, drow
    return rows, drows


@compiled
def lead_rows(F, dF, node, leads):
    """Rows ``c F^h`` (L, m) at increasing leads h, where c measures state ``node``, and their derivatives (L, m, p)."""
    c = np.zeros((1, F.shape[0]))
    c[0, node] = 1.0
    rows, drows = output_powers(F, dF, c, leads)
    return rows[:, 0].copy(), drows[:, 0].copy()
