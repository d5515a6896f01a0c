"""Kalman filter of a linear Gaussian model, and its fixed-interval smoother."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import measure, propagate
from .rows import store_row


class Filtered(NamedTuple):
    """States of every row after its measurements, and before them."""

    states: np.ndarray  # (N, n)
    covariances: np.ndarray  # (N, n, n)
    predicted: np.ndarray  # (N, n)
    predicted_covariances: np.ndarray  # (N, n, n)


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
    AP, gain = np.empty((n, n)), np.empty(n)
    for k in range(N):
        store_row(x, P, predicted, before, k)
        for j in range(len(C)):  # one measurement after the other
            if np.isnan(y[k, j]):
                continue
            measure(P, C[j], R[j], gain)
            e = y[k, j]
            for i in range(n):
                e -= C[j, i] * x[i]
            for i in range(n):
                x[i] += gain[i] * e
        store_row(x, P, filtered, covariances, k)
        for i in range(n):
            after[i] = forcing[k, i]
            for j in range(n):
                after[i] += A[i, j] * x[j]
        x, after = after, x
        propagate(A, P, Q[noise_class[k]], AP)
    return Filtered(filtered, covariances, predicted, before)


def smooth_states(A: np.ndarray, C: np.ndarray, R: np.ndarray, y: np.ndarray, found: Filtered) -> np.ndarray:
    """States (N, n) given all rows, from what :func:`kalman_filter` found with these arguments.

    It goes back through the errors (modified Bryson-Frazier), and inverts no covariance of states: one without process
    noise is singular to rounding.
    """
    states = found.states.copy()
    seen = np.isfinite(y)
    measured = seen[:, :, None] * C  # 0 where nothing was measured
    errors = np.where(seen, y, 0.0) - np.einsum("koi,ki->ko", measured, found.predicted)
    S = measured @ found.predicted_covariances @ np.swapaxes(measured, 1, 2) + np.diag(R)
    weighted = np.linalg.solve(S, measured)
    share = found.predicted_covariances @ (np.swapaxes(measured, 1, 2) @ weighted)
    kept = np.eye(len(A)) - share  # of the prediction, after the row's measurements
    slope = np.zeros(len(A))  # of the later rows' squared errors by the state
    for k in range(len(y) - 1, -1, -1):
        states[k] -= found.covariances[k] @ slope
        slope = A.T @ (kept[k].T @ slope - errors[k] @ weighted[k])
    return states
