"""The cells of RNN and LSTM, element by element, and their gradients: one pass over memory for a step.

Arrays are float32 of shape (n_rows, n_windows) and contiguous: a view, whose last stride numba could not
know, would be computed number by number, six times slower.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements

_TERMS = 13
_ONE, _HALF = np.float32(1.0), np.float32(0.5)
#: beyond it tanh is 1 in float32.
_END = np.float32(9.1)


def _continued_fraction(n_terms: int) -> tuple[tuple[np.float32, ...], tuple[np.float32, ...]]:
    """Lambert's ``tanh x = x / (1 + x^2 / (3 + x^2 / (5 + ...)))`` as a quotient of polynomials in x^2."""
    above, below = [Fraction(1)], [Fraction(2 * n_terms - 1)]
    for k in range(n_terms - 1, 0, -1):
        longer = [Fraction(0)] * max(len(below), len(above) + 1)
        for i, value in enumerate(below):
            longer[i] += (2 * k - 1) * value
        for i, value in enumerate(above):
            longer[i + 1] += value
        above, below = below, longer
    scale = above[0]
    return tuple(np.float32(v / scale) for v in above), tuple(np.float32(v / scale) for v in below)


_ABOVE, _BELOW = _continued_fraction(_TERMS)
_P0, _P1, _P2, _P3, _P4, _P5, _P6 = _ABOVE
_Q0, _Q1, _Q2, _Q3, _Q4, _Q5, _Q6 = _BELOW


@compiled_elements
def tanh32(x: Any) -> Any:
    """``tanh x`` in float32, without a branch or a call; NaN stays NaN."""
    x = min(max(x, -_END), _END)
    y = x * x
    p = (((((_P6 * y + _P5) * y + _P4) * y + _P3) * y + _P2) * y + _P1) * y + _P0
    q = (((((_Q6 * y + _Q5) * y + _Q4) * y + _Q3) * y + _Q2) * y + _Q1) * y + _Q0
    return x * p / q


@compiled_elements
def lstm_forward(
    gates: ndarray, bias: ndarray, c_before: ndarray, c: ndarray, tanh_c: ndarray, column: ndarray, first: int
) -> None:
    """One step of LSTM cells: gates i, f, o, g (rows in this order) are activated in place; the others are written.

    ``c = f c_before + i g``; ``h = o tanh(c)`` becomes the rows of ``column`` from ``first`` on.
    """
    n, n_windows = c.shape
    for r in range(n):
        gi, gf, go, gg = gates[r], gates[n + r], gates[2 * n + r], gates[3 * n + r]
        bi, bf, bo, bg = bias[r], bias[n + r], bias[2 * n + r], bias[3 * n + r]
        before, now, tanh_now, out = c_before[r], c[r], tanh_c[r], column[first + r]
        for w in range(n_windows):
            i = _HALF + _HALF * tanh32(_HALF * (gi[w] + bi))
            f = _HALF + _HALF * tanh32(_HALF * (gf[w] + bf))
            o = _HALF + _HALF * tanh32(_HALF * (go[w] + bo))
            g = tanh32(gg[w] + bg)
            value = f * before[w] + i * g
            squashed = tanh32(value)
            gi[w], gf[w], go[w], gg[w] = i, f, o, g
            now[w], tanh_now[w], out[w] = value, squashed, o * squashed


@compiled_elements
def lstm_backward(
    gates: ndarray, c_before: ndarray, tanh_c: ndarray, dh: ndarray, dc: ndarray, d_gates: ndarray
) -> None:
    """The gradient before the gates' sigmoid and tanh; ``dc`` becomes that of ``c_before``."""
    n, n_windows = dc.shape
    for r in range(n):
        gi, gf, go, gg = gates[r], gates[n + r], gates[2 * n + r], gates[3 * n + r]
        di, df, do, dg = d_gates[r], d_gates[n + r], d_gates[2 * n + r], d_gates[3 * n + r]
        before, tanh_now, d_out, d_cell = c_before[r], tanh_c[r], dh[r], dc[r]
        for w in range(n_windows):
            i, f, o, g, u = gi[w], gf[w], go[w], gg[w], tanh_now[w]
            d = d_cell[w] + d_out[w] * o * (_ONE - u * u)
            do[w] = d_out[w] * u * o * (_ONE - o)
            di[w] = d * g * i * (_ONE - i)
            df[w] = d * before[w] * f * (_ONE - f)
            dg[w] = d * i * (_ONE - g * g)
            d_cell[w] = d * f


@compiled_elements
def rnn_forward(gates: ndarray, bias: ndarray, column: ndarray, first: int) -> None:
    """One step of RNN cells: ``h = tanh(gates + bias)``, in place and as the rows of ``column`` from ``first`` on."""
    n, n_windows = gates.shape
    for r in range(n):
        inner, out, b = gates[r], column[first + r], bias[r]
        for w in range(n_windows):
            value = tanh32(inner[w] + b)
            inner[w], out[w] = value, value


@compiled_elements
def rnn_backward(gates: ndarray, dh: ndarray, d_gates: ndarray) -> None:
    """The gradient before the tanh, from its values ``gates``."""
    n, n_windows = gates.shape
    for r in range(n):
        value, d_out, d_inner = gates[r], dh[r], d_gates[r]
        for w in range(n_windows):
            d_inner[w] = d_out[w] * (_ONE - value[w] * value[w])
