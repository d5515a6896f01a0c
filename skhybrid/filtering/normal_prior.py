"""Empirical Bayes: the normal distribution from which the coefficients of several regressions came."""

from __future__ import annotations

import numpy as np

_ROUNDS = 25  # of expectation and maximisation
_FIRST = 10.0  # pull of each regression toward the common one at the first guess
_RELATIVE = 1e-9  # ridge that keeps the common regression regular, relative to its sums
_LEAST = 1e-12  # least variance of a coefficient


def learn_normal(grams: np.ndarray, crosses: np.ndarray, pseudo: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean (p,) and precision (p, p) by EM of the coefficients of regressions with unit noise.

    ``grams`` (N, p, p) and ``crosses`` (N, p) are their normal equations; the covariance is shrunk toward its diagonal
    as by ``pseudo`` more of them.
    """
    n, p = crosses.shape
    ridge = _RELATIVE * np.trace(grams.sum(axis=0)) / p
    mean = np.linalg.solve(grams.sum(axis=0) + ridge * np.eye(p), crosses.sum(axis=0))
    near = np.linalg.solve(grams + _FIRST * np.eye(p), (crosses + _FIRST * mean)[..., None])[..., 0]
    covariance = np.diag(np.var(near, axis=0) + _LEAST)
    for _ in range(_ROUNDS):
        precision = np.linalg.inv(covariance)
        own = np.linalg.inv(grams + precision)
        at = np.einsum("nij,nj->ni", own, crosses + precision @ mean)
        mean = at.mean(axis=0)
        away = at - mean
        found = (own.sum(axis=0) + away.T @ away) / n
        covariance = shrunk_covariance(found, n, pseudo, _LEAST)
    return mean, np.linalg.inv(covariance)


def shrunk_covariance(found: np.ndarray, n: int, pseudo: float, least: float) -> np.ndarray:
    """Covariance (p, p) of ``n`` samples, shrunk toward its diagonal as by ``pseudo`` more, plus ``least``."""
    return (n * found + pseudo * np.diag(np.diag(found))) / (n + pseudo) + least * np.eye(len(found))
