"""Exact zero-order hold of an RC network and its exact derivatives.

Scaled by the square root of its capacitances an RC network is a symmetric system: it has real eigenvalues and an
orthogonal basis of eigenvectors.  Matrix functions of it are scalar functions of the eigenvalues, and their derivatives
are divided differences (Daleckii and Krein), both cheap and stable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled


class Discrete(NamedTuple):
    """A network over one step: ``x[k+1] = A x[k] + B v[k]``, with derivatives by each of p parameters."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, m)
    dA: np.ndarray  # (p, n, n)
    dB: np.ndarray  # (p, n, m)


# nodes and weights of 7-point Gauss-Legendre quadrature on [0, 1]: exact to rounding for gaps below 1
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
_NODES = 0.5 * (_NODES + 1.0)
_WEIGHTS = 0.5 * _WEIGHTS


@compiled
def _hold(x):
    """(exp(x) - 1) / x, the integral of exp(s x) over s in [0, 1]."""
    return 1.0 + 0.5 * x if abs(x) < 1e-9 else np.expm1(x) / x


@compiled
def _hold_slope(x):
    """Derivative of ``_hold``: the integral of s exp(s x) over s in [0, 1]."""
    if abs(x) > 0.5:
        return (x * np.exp(x) - np.expm1(x)) / (x * x)
    term, total = 1.0, 0.5
    for k in range(1, 16):
        term *= x / k
        total += term / (k + 2)
    return total


@compiled
def divided_difference(a, b, hold):
    """(f(a) - f(b)) / (a - b) of f = exp, or of the hold function where ``hold``; f'(a) at a = b."""
    if abs(a - b) > 1.0:
        return (_hold(a) - _hold(b)) / (a - b) if hold else (np.exp(a) - np.exp(b)) / (a - b)
    total = 0.0
    for i in range(_NODES.size):
        x = b + _NODES[i] * (a - b)
        total += _WEIGHTS[i] * (_hold_slope(x) if hold else np.exp(x))
    return total


@compiled
def discretize(A, B, dA, dB, capacitance, dt):
    """Zero-order hold over ``dt`` of dx/dt = A x + B v, and its derivatives.

    Parameters
    ----------
    A, B : ndarray of shape (n, n) and (n, m)
        Continuous matrices of an RC network [1/h].
    dA, dB : ndarray of shape (p, n, n) and (p, n, m)
        Their derivatives by each parameter.
    capacitance : ndarray of shape (n,)
        Capacitances [kWh/K], in the order of the states.
    dt : float
        Step [h].

    Returns
    -------
    Discrete
    """
    n, m, p = A.shape[0], B.shape[1], dA.shape[0]
    root = np.sqrt(capacitance)
    symmetric = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            symmetric[i, j] = 0.5 * (root[i] * A[i, j] / root[j] + root[j] * A[j, i] / root[i])
    values, vectors = np.linalg.eigh(symmetric)
    left, right = np.empty((n, n)), np.empty((n, n))  # A = left diag(values) right
    for i in range(n):
        for j in range(n):
            left[i, j] = vectors[i, j] / root[i]
            right[j, i] = vectors[i, j] * root[i]
    x = values * dt
    slope, hold_slope = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            slope[i, j] = dt * divided_difference(x[i], x[j], False)
            hold_slope[i, j] = dt * dt * divided_difference(x[i], x[j], True)
    power, hold = np.empty(n), np.empty(n)
    for i in range(n):
        power[i], hold[i] = np.exp(x[i]), dt * _hold(x[i])
    Ad = (left * power) @ right
    Phi = (left * hold) @ right  # integral of exp(A s) over the step
    dAd, dBd = np.empty((p, n, n)), np.empty((p, n, m))
    for q in range(p):
        inner = right @ dA[q] @ left
        dAd[q] = left @ (slope * inner) @ right
        dBd[q] = left @ (hold_slope * inner) @ right @ B + Phi @ dB[q]
    return Discrete(Ad, Phi @ B, dAd, dBd)
