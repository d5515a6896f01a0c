"""The cells of RNN and LSTM, element by element, and their gradients.

Arrays are float32 runs of memory, as many numbers as there are units and windows together: loops over short rows would
cost as much again, and a view, whose stride numba could not know, six times as much.
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
def lstm_forward(gates: ndarray, c_before: ndarray, c: ndarray, tanh_c: ndarray, h: ndarray) -> None:
    """One step of LSTM cells: the runs of gates i, f, o, g, one behind the other, are activated in place.

    ``c = f c_before + i g``; ``h = o tanh(c)``.
    """
    n = len(c)
    for j in range(3 * n):
        gates[j] = _HALF + _HALF * tanh32(_HALF * gates[j])
    g = gates[3 * n :]
    for j in range(n):
        g[j] = tanh32(g[j])
    i, f, o = gates[:n], gates[n : 2 * n], gates[2 * n : 3 * n]
    for j in range(n):
        value = f[j] * c_before[j] + i[j] * g[j]
        squashed = tanh32(value)
        c[j], tanh_c[j], h[j] = value, squashed, o[j] * squashed


@compiled_elements
def lstm_backward(
    gates: ndarray, c_before: ndarray, tanh_c: ndarray, later: ndarray, above: ndarray, dc: ndarray, d_gates: ndarray
) -> None:
    """The gradient before the gates' sigmoid and tanh; ``dc`` becomes that of ``c_before``.

    That of ``h`` is what comes from the step behind, ``later``, and from the layer above.
    """
    n = len(dc)
    gi, gf, go, gg = gates[:n], gates[n : 2 * n], gates[2 * n : 3 * n], gates[3 * n :]
    di, df, do, dg = d_gates[:n], d_gates[n : 2 * n], d_gates[2 * n : 3 * n], d_gates[3 * n :]
    for j in range(n):
        i, f, o, g, u = gi[j], gf[j], go[j], gg[j], tanh_c[j]
        dh = later[j] + above[j]
        d = dc[j] + dh * o * (_ONE - u * u)
        do[j] = dh * u * o * (_ONE - o)
        di[j] = d * g * i * (_ONE - i)
        df[j] = d * c_before[j] * f * (_ONE - f)
        dg[j] = d * i * (_ONE - g * g)
        dc[j] = d * f


@compiled_elements
def rnn_forward(gates: ndarray, h: ndarray) -> None:
    """One step of RNN cells: ``h = tanh(gates)``, also in place."""
    for j in range(len(h)):
        value = tanh32(gates[j])
        gates[j], h[j] = value, value


@compiled_elements
def rnn_backward(gates: ndarray, later: ndarray, above: ndarray, d_gates: ndarray) -> None:
    """The gradient before the tanh, from its values ``gates``."""
    for j in range(len(gates)):
        d_gates[j] = (later[j] + above[j]) * (_ONE - gates[j] * gates[j])
