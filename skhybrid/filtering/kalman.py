"""Filtered states, and the fixed-interval smoother."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import propagate


class Smoothed(NamedTuple):
    """States given all rows."""

    states: np.ndarray  # (N, n)
    covariances: np.ndarray  # (N, n, n)


@compiled
def _update(x, P, C, R, row, gain):
    """Sequential measurement updates of one row, in place; missing measurements are skipped."""
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
def kalman_filter(A, forcing, Q, klass, C, R, y, s0, P0):
    """Filtered states: the state of every row given its own measurements and all earlier ones.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
    Q : ndarray of shape (n_classes, n, n)
        Process noise of a step, by class.
    klass : ndarray of int, shape (N,)
    C : ndarray of shape (o, n)
    R : ndarray of shape (o,)
        Measurement variances.
    y : ndarray of shape (N, o)
        Measurements, NaN where missing.
    s0, P0 : ndarray of shape (n,) and (n, n)
        What is known of the first row before its measurements.

    Returns
    -------
    states, covariances, predicted, predicted_covariances : ndarray
        (N, n), (N, n, n) after the measurements, and the same before them.
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
        propagate(A, P, Q[klass[k]], work, ahead)
        for i in range(n):
            x[i] = after[i]
            for j in range(n):
                P[i, j] = ahead[i, j]
    return filtered, covariances, predicted, before


def smooth_states(
    A: np.ndarray, filtered: np.ndarray, covariances: np.ndarray, predicted: np.ndarray, before: np.ndarray
) -> Smoothed:
    """Fixed-interval (Rauch-Tung-Striebel) smoother behind :func:`kalman_filter`.

    Returns
    -------
    Smoothed
    """
    states, spread = filtered.copy(), covariances.copy()
    # a state without process noise makes the covariance singular to rounding: the pseudo-inverse is exact there
    gains = covariances[:-1] @ A.T @ np.linalg.pinv(before[1:], hermitian=True)
    for k in range(len(filtered) - 2, -1, -1):
        gain = gains[k]
        states[k] += gain @ (states[k + 1] - predicted[k + 1])
        spread[k] += gain @ (spread[k + 1] - before[k + 1]) @ gain.T
    return Smoothed(states, spread)
