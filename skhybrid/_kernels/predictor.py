"""The innovations-form predictor ``s[k+1] = A s[k] + f[k] + K[k] e[k]``, ``e[k] = y[k] - c s[k]``.

One recursion serves every disturbance model; they differ in the states that they append and in the gain ``K``
(design 4).  ``f[k] = B v[k]`` is the forcing by the inputs; a row without a measurement has ``e[k] = 0``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled


class Prediction(NamedTuple):
    """One-step prediction of every row."""

    errors: np.ndarray  # (N,) e[k]; 0 where nothing was measured
    states: np.ndarray  # (N + 1, n) s[k|k-1]


class Sensitivity(NamedTuple):
    """One-step errors and their exact derivatives by each of p parameters."""

    errors: np.ndarray  # (N,)
    derrors: np.ndarray  # (N, p)


@compiled
def one_step_errors(A, forcing, K, c, y, s0):
    """Run the predictor.

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
    K : ndarray of shape (N, n)
        Gain of every row, predictor form.
    c : ndarray of shape (n,)
        Output row.
    y : ndarray of shape (N,)
        Measurements, NaN where missing.
    s0 : ndarray of shape (n,)
        State at the first row.

    Returns
    -------
    Prediction
    """
    N, n = forcing.shape
    errors, states = np.zeros(N), np.empty((N + 1, n))
    states[0] = s0
    for k in range(N):
        s = states[k]
        if not np.isnan(y[k]):
            e = y[k]
            for i in range(n):
                e -= c[i] * s[i]
            errors[k] = e
        for i in range(n):
            value = forcing[k, i] + K[k, i] * errors[k]
            for j in range(n):
                value += A[i, j] * s[j]
            states[k + 1, i] = value
    return Prediction(errors, states)


@compiled
def one_step_sensitivities(A, forcing, K, c, y, s0, dA, dforcing, dK, ds0):
    """The predictor with forward sensitivities.

    Parameters
    ----------
    A, forcing, K, c, y, s0
        As in :func:`one_step_errors`.
    dA, dforcing, dK, ds0 : ndarray of shape (p, n, n), (p, N, n), (p, N, n) and (p, n)
        Derivatives by each parameter.

    Returns
    -------
    Sensitivity
    """
    N, n = forcing.shape
    p = dA.shape[0]
    errors, derrors = np.zeros(N), np.zeros((N, p))
    s, after = s0.copy(), np.empty(n)
    ds, dafter = ds0.copy(), np.empty(n)
    for k in range(N):
        seen = not np.isnan(y[k])
        e = 0.0
        if seen:
            e = y[k]
            for i in range(n):
                e -= c[i] * s[i]
        errors[k] = e
        for q in range(p):
            de = 0.0
            if seen:
                for i in range(n):
                    de -= c[i] * ds[q, i]
            derrors[k, q] = de
            for i in range(n):
                value = dforcing[q, k, i] + dK[q, k, i] * e + K[k, i] * de
                for j in range(n):
                    value += dA[q, i, j] * s[j] + A[i, j] * ds[q, j]
                dafter[i] = value
            for i in range(n):
                ds[q, i] = dafter[i]
        for i in range(n):
            value = forcing[k, i] + K[k, i] * e
            for j in range(n):
                value += A[i, j] * s[j]
            after[i] = value
        for i in range(n):
            s[i] = after[i]
    return Sensitivity(errors, derrors)


@compiled
def simulate_path(A, forcing, s0):
    """States of every row, (N + 1, n): ``s[0] = s0``, ``s[k+1] = A s[k] + forcing[k]``."""
    N, n = forcing.shape
    states = np.empty((N + 1, n))
    states[0] = s0
    for k in range(N):
        for i in range(n):
            value = forcing[k, i]
            for j in range(n):
                value += A[i, j] * states[k, j]
            states[k + 1, i] = value
    return states


@compiled
def simulate_inverse(A, forcing, heat, c, target, lower, upper, s0):
    """Heat that brings the output to ``target[k]`` at the end of every step (paper Eq. inverseQ2).

    Parameters
    ----------
    A : ndarray of shape (n, n)
    forcing : ndarray of shape (N, n)
        By all other inputs.
    heat : ndarray of shape (n,)
        Effect of 1 kW over a step on the states.
    c : ndarray of shape (n,)
    target : ndarray of shape (N,)
        Wanted output at the end of each step.
    lower, upper : float
        What the plant can do [kW].
    s0 : ndarray of shape (n,)

    Returns
    -------
    ndarray of shape (N,)
        The heat over each step [kW]; the state follows what was applied.
    """
    N, n = forcing.shape
    applied = np.empty(N)
    s, free = s0.copy(), np.empty(n)
    effect = 0.0
    for i in range(n):
        effect += c[i] * heat[i]
    for k in range(N):
        output = 0.0
        for i in range(n):
            value = forcing[k, i]
            for j in range(n):
                value += A[i, j] * s[j]
            free[i] = value
            output += c[i] * value
        applied[k] = min(max((target[k] - output) / effect, lower), upper)
        for i in range(n):
            s[i] = free[i] + heat[i] * applied[k]
    return applied
