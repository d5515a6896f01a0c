"""Kalman gains with exact derivatives, filtered states, and the fixed-interval smoother.

The covariance recursion does not depend on the data, only on which rows were measured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import dot_column, propagate, sandwich, subtract_outer


class Gains(NamedTuple):
    """Predictor-form gains ``A P c / S`` of every row, and derivatives by each of p parameters."""

    K: np.ndarray  # (N, n)
    S: np.ndarray  # (N,) innovation variance
    dK: np.ndarray  # (p, N, n)
    dS: np.ndarray  # (p, N)


class Smoothed(NamedTuple):
    """States given all rows."""

    states: np.ndarray  # (N, n)
    covariances: np.ndarray  # (N, n, n)


@compiled
def kalman_gains(A, Q, klass, c, R, P0, seen, dA, dQ, dR):
    """Gains of a Kalman filter whose process noise may change from row to row.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    Q : ndarray of shape (n_classes, n, n)
        Process noise of a step, by class.
    klass : ndarray of int, shape (N,)
        Class of every row.
    c : ndarray of shape (n,)
        Output row.
    R : float
        Measurement variance.
    P0 : ndarray of shape (n, n)
        Covariance of the first row's state, before its measurement.
    seen : ndarray of bool, shape (N,)
        Whether the row was measured.
    dA, dQ, dR : ndarray of shape (p, n, n), (p, n_classes, n, n) and (p,)
        Derivatives; p may be 0.

    Returns
    -------
    Gains
    """
    N, n, p = klass.size, A.shape[0], dA.shape[0]
    gains, variances = np.zeros((N, n)), np.empty(N)
    dgains, dvariances = np.zeros((p, N, n)), np.zeros((p, N))
    P, ahead, work, turned = P0.copy(), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    dP = np.zeros((p, n, n))
    Pc, dPc, gain, dgain = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for k in range(N):
        dot_column(P, c, Pc)
        S = R
        for i in range(n):
            S += c[i] * Pc[i]
        variances[k] = S
        for i in range(n):
            gain[i] = Pc[i] / S
        if seen[k]:
            subtract_outer(P, gain, gain, S)
            dot_column(A, gain, gains[k])
        for q in range(p):
            dot_column(dP[q], c, dPc)
            dS = dR[q]
            for i in range(n):
                dS += c[i] * dPc[i]
            dvariances[q, k] = dS
            if seen[k]:
                for i in range(n):
                    dgain[i] = (dPc[i] - gain[i] * dS) / S
                subtract_outer(dP[q], dgain, gain, S)
                subtract_outer(dP[q], gain, dgain, S)
                subtract_outer(dP[q], gain, gain, dS)
                for i in range(n):
                    for j in range(n):
                        dgains[q, k, i] += dA[q, i, j] * gain[j] + A[i, j] * dgain[j]
            turned[:] = dQ[q, klass[k]]
            sandwich(A, dP[q], A, work, turned)
            sandwich(dA[q], P, A, work, turned)
            sandwich(A, P, dA[q], work, turned)
            dP[q] = turned
        propagate(A, P, Q[klass[k]], work, ahead)
        P[:] = ahead
    return Gains(gains, variances, dgains, dvariances)


@compiled
def kalman_track(A, forcing, Q, klass, c, R, y, s0, P0):
    """Filtered states: the state of every row given its own measurement and all earlier ones.

    Returns
    -------
    states, covariances, predicted, predicted_covariances : ndarray
        (N, n), (N, n, n) after the measurement, and the same before it.
    """
    N, n = forcing.shape
    filtered, covariances = np.empty((N, n)), np.empty((N, n, n))
    predicted, before = np.empty((N, n)), np.empty((N, n, n))
    s, P = s0.copy(), P0.copy()
    ahead, work = np.empty((n, n)), np.empty((n, n))
    for k in range(N):
        predicted[k], before[k] = s, P
        if not np.isnan(y[k]):
            Pc = P @ c
            S = c @ Pc + R
            gain = Pc / S
            s = s + gain * (y[k] - c @ s)
            P = P - np.outer(gain, gain) * S
        filtered[k], covariances[k] = s, P
        s = A @ s + forcing[k]
        propagate(A, P, Q[klass[k]], work, ahead)
        P = ahead.copy()
    return filtered, covariances, predicted, before


@compiled
def smooth_states(A, filtered, covariances, predicted, before):
    """Fixed-interval (Rauch-Tung-Striebel) smoother behind :func:`kalman_track`.

    Returns
    -------
    Smoothed
    """
    N = len(filtered)
    states, spread = filtered.copy(), covariances.copy()
    for k in range(N - 2, -1, -1):
        ahead = before[k + 1]
        # a state without process noise makes the covariance singular to rounding: the pseudo-inverse is exact there
        gain = covariances[k] @ A.T @ np.linalg.pinv(ahead)
        states[k] = filtered[k] + gain @ (states[k + 1] - predicted[k + 1])
        spread[k] = covariances[k] + gain @ (spread[k + 1] - ahead) @ gain.T
    return Smoothed(states, spread)
