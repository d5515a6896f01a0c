"""Copies of a row of vectors and matrices, as loops: a slice assignment takes seconds to compile."""

from __future__ import annotations

from ._compile import compiled, inlined


@compiled
def store_row(x, dx, table, dtable, k):
    """``table[k] = x`` and ``dtable[k] = dx``, of shapes (n,) and (n, p): derivatives, or a covariance."""
    for i in range(len(x)):
        table[k, i] = x[i]
        for q in range(dx.shape[1]):
            dtable[k, i, q] = dx[i, q]


@compiled
def load_row(table, dtable, k, x, dx):
    """``x = table[k]`` and ``dx = dtable[k]``, of shapes (n,) and (n, p)."""
    for i in range(len(x)):
        x[i] = table[k, i]
        for q in range(dx.shape[1]):
            dx[i, q] = dtable[k, i, q]


@inlined
def copy_values(values, out):
    """``out[:n] = values``, of shape (n,)."""
    for i in range(len(values)):
        out[i] = values[i]
