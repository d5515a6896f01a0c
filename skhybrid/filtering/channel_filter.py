"""One Kalman filter for many channels, and its adjoint: derivatives of any scalar function of the innovations.

A channel is a measurement series or the response to one input; all share the covariances and the gains.  The filter is
linear in its channels, so a model that is linear in some coefficients has innovations ``e_y + sum_j beta_j e_j``
(variable projection, design ruling 4).  The adjoint costs about two filter passes, however many parameters there are.

The measured outputs of a row update the state one after the other, which for independent noises is the joint update.
The innermost loops run over the channels, which are contiguous in memory, so that they become vector instructions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled, compiled_sums
from .covariance import measure, propagate


class ChannelFilter(NamedTuple):
    """Innovations of every channel, and the arrays that the adjoint needs."""

    errors: np.ndarray  # (N, o, J); 0 where nothing was measured
    S: np.ndarray  # (N, o) innovation variance; 1 where nothing was measured
    states: np.ndarray  # (N, n, J) filtered states
    gains: np.ndarray  # (N, o, n) filter gains
    covariances: np.ndarray  # (N, n, n) filtered covariances


class ChannelAdjoint(NamedTuple):
    """Derivatives of a scalar by each argument of the filter."""

    A: np.ndarray  # (n, n)
    columns: np.ndarray  # (n, J)
    known: np.ndarray  # (N, n) by the known forcing of channel 0
    Q: np.ndarray  # (n_classes, n, n)
    R: np.ndarray  # (o,)
    P0: np.ndarray  # (n, n)


@compiled
def _covariance_pass(A, Q, noise_class, C, R, y, P0, S, gains, covariances):
    """Gains, innovation variances and filtered covariances of every row, into the last three arguments."""
    P, AP = P0.copy(), np.empty_like(P0)
    for k in range(len(y)):
        for q in range(y.shape[1]):
            if not np.isnan(y[k, q]):
                S[k, q] = measure(P, C[q], R[q], gains[k, q])
        for i in range(len(P)):
            for j in range(len(P)):
                covariances[k, i, j] = P[i, j]
        propagate(A, P, Q[noise_class[k]], AP)


@compiled_sums
def _state_pass(A, columns, series, known, C, y, x, gains, errors, states):
    """Innovations and filtered states of every channel; ``x`` (n, J) begins as the first row's prediction."""
    N, o = y.shape
    n, J = x.shape
    after = np.empty((n, J))
    for k in range(N):
        for q in range(o):
            if np.isnan(y[k, q]):
                continue
            for i in range(n):
                if C[q, i] != 0.0:
                    for j in range(J):
                        errors[k, q, j] -= C[q, i] * x[i, j]
            errors[k, q, 0] += y[k, q]
            for i in range(n):
                g = gains[k, q, i]
                for j in range(J):
                    x[i, j] += g * errors[k, q, j]
        for i in range(n):
            for j in range(J):
                states[k, i, j] = x[i, j]
                after[i, j] = columns[i, j] * series[k, j]
            after[i, 0] = known[k, i]
            for m in range(n):
                a = A[i, m]
                if a != 0.0:
                    for j in range(J):
                        after[i, j] += a * x[m, j]
        for i in range(n):
            for j in range(J):
                x[i, j] = after[i, j]


def filter_channels(A, columns, series, known, Q, noise_class, C, R, y, s0, P0):
    """Filter channel 0 (the measurement ``y``) and the responses to the inputs ``series``.

    ``A`` (n, n); ``columns`` (n, J), the effect of each input on the states over a step, and ``series`` (N, J), neither
    used for channel 0; ``known`` (N, n), channel 0's forcing by inputs without a coefficient; ``Q`` and ``noise_class``
    as in :func:`kalman_filter`; ``C`` (o, n); ``R`` (o,) noise variances; ``y`` (N, o), NaN where missing; ``s0`` (n,),
    channel 0's first mean, 0 in the others; ``P0`` (n, n), the first covariance.
    """
    (N, o), (n, J) = y.shape, columns.shape
    S, gains, covariances = np.ones((N, o)), np.zeros((N, o, n)), np.empty((N, n, n))
    _covariance_pass(A, Q, noise_class, C, R, y, P0, S, gains, covariances)
    errors, states, x = np.zeros((N, o, J)), np.empty((N, n, J)), np.zeros((n, J))
    x[:, 0] = s0
    _state_pass(A, columns, series, known, C, y, x, gains, errors, states)
    return ChannelFilter(errors, S, states, gains, covariances)


@compiled_sums
def _state_pass_back(A, series, C, y, errors, states, gains, errors_bar, A_bar, columns_bar, known_bar, gains_bar):
    """Reverse of ``_state_pass``, into the last four arguments."""
    N, o = y.shape
    n, J = columns_bar.shape
    x_bar, before, e_bar = np.zeros((n, J)), np.empty((n, J)), np.empty(J)
    for k in range(N - 1, -1, -1):
        for i in range(n):
            known_bar[k, i] = x_bar[i, 0]
            for j in range(J):
                columns_bar[i, j] += x_bar[i, j] * series[k, j]
                before[i, j] = 0.0
        for i in range(n):
            for m in range(n):
                a, total = A[i, m], 0.0
                for j in range(J):
                    total += x_bar[i, j] * states[k, m, j]
                    before[m, j] += a * x_bar[i, j]
                A_bar[i, m] += total
        for q in range(o - 1, -1, -1):
            if np.isnan(y[k, q]):
                continue
            for j in range(J):
                e_bar[j] = errors_bar[k, q, j]
            for i in range(n):
                g, total = gains[k, q, i], 0.0
                for j in range(J):
                    total += before[i, j] * errors[k, q, j]
                    e_bar[j] += g * before[i, j]
                gains_bar[k, q, i] = total
            for i in range(n):
                if C[q, i] != 0.0:
                    for j in range(J):
                        before[i, j] -= C[q, i] * e_bar[j]
        for i in range(n):
            for j in range(J):
                x_bar[i, j] = before[i, j]


@compiled
def _covariance_pass_back(A, noise_class, C, y, S, gains, covariances, S_bar, gains_bar, A_bar, Q_bar, R_bar, P_bar):
    """Reverse of ``_covariance_pass``: adds to A_bar, Q_bar and R_bar; ``P_bar`` begins at 0 and ends as that of P0."""
    N, o = y.shape
    n = A.shape[0]
    work, Pg, g_bar = np.empty((n, n)), np.empty(n), np.empty(n)
    for k in range(N - 1, -1, -1):
        for i in range(n):
            for j in range(n):
                Q_bar[noise_class[k], i, j] += P_bar[i, j]
                total = 0.0
                for m in range(n):
                    total += P_bar[i, m] * A[m, j]
                work[i, j] = total
        for i in range(n):
            for j in range(n):
                slope, total = 0.0, 0.0
                for m in range(n):
                    slope += work[i, m] * covariances[k, m, j]
                    total += A[m, i] * work[m, j]
                A_bar[i, j] += 2.0 * slope
                P_bar[i, j] = total
        for q in range(o - 1, -1, -1):
            if np.isnan(y[k, q]):
                continue
            s, s_bar = S[k, q], S_bar[k, q]
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += P_bar[i, j] * gains[k, q, j]
                Pg[i] = total
            for i in range(n):
                g_bar[i] = gains_bar[k, q, i] - 2.0 * s * Pg[i]
                s_bar -= gains[k, q, i] * (Pg[i] + g_bar[i] / s)
            for i in range(n):
                for j in range(n):
                    P_bar[i, j] += 0.5 / s * (g_bar[i] * C[q, j] + C[q, i] * g_bar[j]) + s_bar * C[q, i] * C[q, j]
            R_bar[q] += s_bar


def filter_channels_adjoint(A, series, noise_class, C, y, n_classes, result, errors_bar, S_bar):
    """Derivatives of a scalar by A, the columns, the noise and P0, given its derivatives by the innovations.

    ``errors_bar`` (N, o, J) and ``S_bar`` (N, o) are those by every innovation of ``result`` and its variance; the
    other arguments are those of :func:`filter_channels`.
    """
    (N, n, J), o = result.states.shape, y.shape[1]
    A_bar, columns_bar, known_bar = np.zeros((n, n)), np.zeros((n, J)), np.empty((N, n))
    gains_bar, Q_bar, R_bar = np.zeros((N, o, n)), np.zeros((n_classes, n, n)), np.zeros(o)
    errors, S, states, gains, covariances = result
    _state_pass_back(A, series, C, y, errors, states, gains, errors_bar, A_bar, columns_bar, known_bar, gains_bar)
    P_bar = np.zeros((n, n))
    _covariance_pass_back(A, noise_class, C, y, S, gains, covariances, S_bar, gains_bar, A_bar, Q_bar, R_bar, P_bar)
    columns_bar[:, 0] = 0.0
    return ChannelAdjoint(A_bar, columns_bar, known_bar, Q_bar, R_bar, P_bar)
