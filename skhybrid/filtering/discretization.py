"""Exact zero-order hold of an RC network and its exact derivatives.

Scaled by the square root of its capacitances an RC network is a symmetric system: it has real eigenvalues and an
orthogonal basis of eigenvectors.  Matrix functions of it are scalar functions of the eigenvalues, and their derivatives
are divided differences (Daleckii and Krein), both cheap and stable.  Plain NumPy, over any number of networks at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Discrete(NamedTuple):
    """A network over one step: ``x[k+1] = A x[k] + B v[k]``, with derivatives by each of p parameters."""

    A: np.ndarray  # (..., n, n)
    B: np.ndarray  # (..., n, m)
    dA: np.ndarray  # (..., p, n, n)
    dB: np.ndarray  # (..., p, n, m)


# nodes and weights of 7-point Gauss-Legendre quadrature on [0, 1]: exact to rounding for gaps below 1
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
_NODES = 0.5 * (_NODES + 1.0)
_WEIGHTS = 0.5 * _WEIGHTS
#: 1 / (k! (k + 2)): the series of the hold function's slope
_SLOPE_SERIES = np.array([1.0 / (np.prod(np.arange(1.0, k + 1.0)) * (k + 2)) for k in range(16)])


def _hold(x: np.ndarray) -> np.ndarray:
    """(exp(x) - 1) / x, the integral of exp(s x) over s in [0, 1]."""
    small = np.abs(x) < 1e-9
    return np.where(small, 1.0 + 0.5 * x, np.expm1(x) / np.where(small, 1.0, x))


def _hold_slope(x: np.ndarray) -> np.ndarray:
    """Derivative of ``_hold``: the integral of s exp(s x) over s in [0, 1]."""
    big = np.abs(x) > 0.5
    away, near = np.where(big, x, 1.0), np.where(big, 0.0, x)
    series = np.polynomial.polynomial.polyval(near, _SLOPE_SERIES)
    return np.where(big, (away * np.exp(away) - np.expm1(away)) / (away * away), series)


def divided_difference(a: np.ndarray, b: np.ndarray, hold: bool) -> np.ndarray:
    """(f(a) - f(b)) / (a - b) of f = exp, or of the hold function where ``hold``; f'(a) at a = b."""
    a, b = np.broadcast_arrays(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))
    gap = a - b
    far = np.abs(gap) > 1.0
    f, slope = (_hold, _hold_slope) if hold else (np.exp, np.exp)
    close = slope(b[..., None] + _NODES * gap[..., None]) @ _WEIGHTS
    return np.where(far, (f(a) - f(b)) / np.where(far, gap, 1.0), close)


def discretize(
    A: np.ndarray, B: np.ndarray, dA: np.ndarray, dB: np.ndarray, capacitance: np.ndarray, dt: float
) -> Discrete:
    """Zero-order hold over ``dt`` [h] of RC networks dx/dt = A x + B v [1/h], and its derivatives.

    ``A`` (..., n, n), ``B`` (..., n, m), their derivatives ``dA`` (..., p, n, n), ``dB`` (..., p, n, m) by p >= 0
    parameters, and ``capacitance`` (..., n) [kWh/K] of the states.
    """
    root = np.sqrt(capacitance)
    scaled = root[..., :, None] * A / root[..., None, :]
    values, vectors = np.linalg.eigh(0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
    left = vectors / root[..., :, None]  # A = left diag(values) right
    right = np.swapaxes(vectors * root[..., :, None], -1, -2)
    x = values * dt
    Ad = (left * np.exp(x)[..., None, :]) @ right
    Phi = (left * (dt * _hold(x))[..., None, :]) @ right  # integral of exp(A s) over the step
    if dA.shape[-3] == 0:
        return Discrete(Ad, Phi @ B, np.zeros_like(dA), np.zeros_like(dB))
    a, b = x[..., :, None], x[..., None, :]
    slope = dt * divided_difference(a, b, False)
    hold_slope = dt * dt * divided_difference(a, b, True)
    left, right = left[..., None, :, :], right[..., None, :, :]
    inner = right @ dA @ left
    dAd = left @ (slope[..., None, :, :] * inner) @ right
    dBd = left @ ((hold_slope[..., None, :, :] * inner) @ (right @ B[..., None, :, :])) + Phi[..., None, :, :] @ dB
    return Discrete(Ad, Phi @ B, dAd, dBd)
