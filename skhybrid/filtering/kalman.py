"""Kalman filter of a linear Gaussian model, and its fixed-interval smoother."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import propagate


class Filtered(NamedTuple):
    """States of every row after its measurements, and before them."""

    states: np.ndarray  # (N, n)
    covariances: np.ndarray  # (N, n, n)
    predicted: np.ndarray  # (N, n)
    predicted_covariances: np.ndarray  # (N, n, n)


class Smoothed(NamedTuple):
    """States given all rows."""

    states: np.ndarray  # (N, n)
    covariances: np.ndarray  # (N, n, n)


@compiled
def _update(x, P, C, R, row, gain):
    """Update state and covariance by one row's measurements, one after the other, in place; NaN is skipped."""
    o, n = C.shape
    for j in range(o):
        if np.isnan(row[j]):
            continue
        e, S = row[j], R[j]
        for i in range(n):
            value = 0.0
            for m in range(n):
                value += P[i, m] * C[j, m]
            gain[i] = value
        for i in range(n):
            e -= C[j, i] * x[i]
            S += C[j, i] * gain[i]
        for i in range(n):
            x[i] += gain[i] * e / S
            for m in range(n):
                P[i, m] -= gain[i] * gain[m] / S


@compiled
def kalman_filter(A, forcing, Q, noise_class, C, R, y, s0, P0):
    """States of every row given its own measurements and all earlier ones.

    ``A`` (n, n), ``forcing`` (N, n); ``Q`` (n_classes, n, n) process noise of a step, by ``noise_class`` (N,) of its
    row; ``C`` (o, n), ``R`` (o,) measurement variances, ``y`` (N, o) with NaN where missing; ``s0`` (n,) and ``P0`` (n,
    n), mean and covariance of the first row's state before its measurements.
    """
    N, n = forcing.shape
    filtered, covariances = np.empty((N, n)), np.empty((N, n, n))
    predicted, before = np.empty((N, n)), np.empty((N, n, n))
    x, P, after = s0.copy(), P0.copy(), np.empty(n)
    ahead, work, gain = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for k in range(N):
        for i in range(n):
            predicted[k, i] = x[i]
            for j in range(n):
                before[k, i, j] = P[i, j]
        _update(x, P, C, R, y[k], gain)
        for i in range(n):
            filtered[k, i] = x[i]
            value = forcing[k, i]
            for j in range(n):
                covariances[k, i, j] = P[i, j]
                value += A[i, j] * x[j]
            after[i] = value
        propagate(A, P, Q[noise_class[k]], work, ahead)
        for i in range(n):
            x[i] = after[i]
            for j in range(n):
                P[i, j] = ahead[i, j]
    return Filtered(filtered, covariances, predicted, before)


def smooth_states(
    A: np.ndarray, filtered: np.ndarray, covariances: np.ndarray, predicted: np.ndarray, before: np.ndarray
) -> Smoothed:
    """Fixed-interval (Rauch-Tung-Striebel) smoother after :func:`kalman_filter`."""
    states, spread = filtered.copy(), covariances.copy()
    # a state without process noise makes the covariance singular to rounding: the pseudo-inverse is exact there
    gains = covariances[:-1] @ A.T @ np.linalg.pinv(before[1:], hermitian=True)
    for k in range(len(filtered) - 2, -1, -1):
        gain = gains[k]
        states[k] += gain @ (states[k + 1] - predicted[k + 1])
        spread[k] += gain @ (spread[k + 1] - before[k + 1]) @ gain.T
    return Smoothed(states, spread)
