"""One Kalman filter for many channels, with the reverse-mode derivative of whatever is made of its innovations.

A channel is a measurement series or the response to one input; all share the covariances and the gains.  The filter is
linear in its channels, so a model that is linear in some coefficients has innovations ``e_y - sum_j beta_j e_j``
(variable projection, design ruling 4).  The adjoint costs about two filter passes, however many parameters there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .covariance import dot_column, propagate, sandwich, subtract_outer


class ChannelFilter(NamedTuple):
    """Innovations of every channel, and what the adjoint needs again."""

    errors: np.ndarray  # (N, J); 0 where nothing was measured
    S: np.ndarray  # (N,) innovation variance; 1 where nothing was measured
    states: np.ndarray  # (N, J, n) filtered states
    gains: np.ndarray  # (N, n) filter gains
    covariances: np.ndarray  # (N, n, n) filtered covariances


class ChannelAdjoint(NamedTuple):
    """Derivatives of a scalar by the filter's ingredients."""

    A: np.ndarray  # (n, n)
    columns: np.ndarray  # (J, n)
    known: np.ndarray  # (N, n) by the known forcing of channel 0
    Q: np.ndarray  # (n_classes, n, n)
    R: float
    P0: np.ndarray  # (n, n)


@compiled
def filter_channels(A, columns, series, known, Q, klass, c, R, y, s0, P0):
    """Filter channel 0 (the measurement) and the responses to the inputs ``series``.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    columns : ndarray of shape (J, n)
        Effect of each channel's input on the states over a step; row 0 is not used.
    series : ndarray of shape (N, J)
        Input of each channel; column 0 is not used.
    known : ndarray of shape (N, n)
        Forcing of channel 0 by the inputs whose effect is not a coefficient.
    Q, klass, c, R, P0
        As in :func:`skhybrid._kernels.kalman_gains`.
    y : ndarray of shape (N,)
        Measurements, NaN where missing.
    s0 : ndarray of shape (n,)
        Mean of channel 0's first state; the others begin at 0.

    Returns
    -------
    ChannelFilter
    """
    N, J = series.shape
    n = A.shape[0]
    errors, variances = np.zeros((N, J)), np.ones(N)
    states, gains, covariances = np.empty((N, J, n)), np.zeros((N, n)), np.empty((N, n, n))
    x, after = np.zeros((J, n)), np.empty(n)
    x[0] = s0
    P, ahead, work, gain = P0.copy(), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for k in range(N):
        if not np.isnan(y[k]):
            dot_column(P, c, gain)
            S = R
            for i in range(n):
                S += c[i] * gain[i]
            for i in range(n):
                gain[i] /= S
                gains[k, i] = gain[i]
            variances[k] = S
            subtract_outer(P, gain, gain, S)
            for j in range(J):
                e = y[k] if j == 0 else 0.0
                for i in range(n):
                    e -= c[i] * x[j, i]
                errors[k, j] = e
                for i in range(n):
                    x[j, i] += gain[i] * e
        covariances[k] = P
        for j in range(J):
            for i in range(n):
                states[k, j, i] = x[j, i]
                value = known[k, i] if j == 0 else columns[j, i] * series[k, j]
                for m in range(n):
                    value += A[i, m] * x[j, m]
                after[i] = value
            for i in range(n):
                x[j, i] = after[i]
        propagate(A, P, Q[klass[k]], work, ahead)
        P[:] = ahead
    return ChannelFilter(errors, variances, states, gains, covariances)


@compiled
def filter_channels_adjoint(A, series, klass, c, y, n_classes, result, errors_bar, S_bar):
    """Derivatives of a scalar by A, the columns, the noise and P0, given its derivatives by the innovations.

    Parameters
    ----------
    A, series, klass, c, y
        As given to :func:`filter_channels`.
    n_classes : int
    result : ChannelFilter
    errors_bar : ndarray of shape (N, J)
        Derivative by every innovation.
    S_bar : ndarray of shape (N,)
        Derivative by every innovation variance.

    Returns
    -------
    ChannelAdjoint
    """
    N, J = series.shape
    n = A.shape[0]
    A_bar, columns_bar, known_bar = np.zeros((n, n)), np.zeros((J, n)), np.zeros((N, n))
    Q_bar, R_bar = np.zeros((n_classes, n, n)), 0.0
    x_bar, P_bar = np.zeros((J, n)), np.zeros((n, n))  # of the next row's predicted state and covariance
    plus_bar, gain_bar, Pg = np.empty(n), np.empty(n), np.empty(n)
    work, turned, transposed = np.empty((n, n)), np.empty((n, n)), A.T.copy()
    identity = np.eye(n)
    for k in range(N - 1, -1, -1):
        P_plus = result.covariances[k]
        Q_bar[klass[k]] += P_bar
        turned[:] = 0.0
        sandwich(A, P_plus, identity, work, turned)
        for i in range(n):
            for j in range(n):
                for m in range(n):
                    A_bar[i, j] += 2.0 * P_bar[i, m] * turned[m, j]
        turned[:] = 0.0
        sandwich(transposed, P_bar, transposed, work, turned)
        P_bar[:] = turned
        seen = not np.isnan(y[k])
        gain, S = result.gains[k], result.S[k]
        gain_bar[:] = 0.0
        for j in range(J):
            for i in range(n):
                if j == 0:
                    known_bar[k, i] = x_bar[0, i]
                else:
                    columns_bar[j, i] += x_bar[j, i] * series[k, j]
                for m in range(n):
                    A_bar[i, m] += x_bar[j, i] * result.states[k, j, m]
            e_bar = 0.0
            for m in range(n):
                value = 0.0
                for i in range(n):
                    value += A[i, m] * x_bar[j, i]
                plus_bar[m] = value
            if seen:
                e_bar = errors_bar[k, j]
                for i in range(n):
                    e_bar += gain[i] * plus_bar[i]
                    gain_bar[i] += plus_bar[i] * result.errors[k, j]
            for i in range(n):
                x_bar[j, i] = plus_bar[i] - c[i] * e_bar
        if seen:
            dot_column(P_bar, gain, Pg)
            s_bar = S_bar[k]
            for i in range(n):
                gain_bar[i] -= 2.0 * S * Pg[i]
                s_bar -= gain[i] * Pg[i] + gain_bar[i] * gain[i] / S
            subtract_outer(P_bar, gain_bar, c, -0.5 / S)
            subtract_outer(P_bar, c, gain_bar, -0.5 / S)
            subtract_outer(P_bar, c, c, -s_bar)
            R_bar += s_bar
    return ChannelAdjoint(A_bar, columns_bar, known_bar, Q_bar, R_bar, P_bar)
