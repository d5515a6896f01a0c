"""Normal equations: their sums, their solution by LAPACK without scipy's checks and copies, and their common prior."""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dposv, dpotrf

_ROUNDS = 25  # of expectation and maximisation
_FIRST = 10.0  # pull of each regression toward the common one at the first guess
_RELATIVE = 1e-9  # ridge that keeps the common regression regular, relative to its sums
_LEAST = 1e-12  # least variance of a coefficient


def with_products(sums, rows, fade=1.0, sign=1.0):
    """``fade`` times the symmetric sums (p, p) and ``sign`` times the sums of products of rows (m, p)."""
    rows = np.ascontiguousarray(rows).T
    return dgemm(sign, rows, rows, beta=fade, c=sums.T, trans_b=True).T if rows.size else fade * sums


def cholesky_root(H):
    """Upper triangular U (n, n) with ``U' U = H``, which may be overwritten; refused where not positive definite."""
    U, failed = dpotrf(H, overwrite_a=True)
    if failed or not np.isfinite(np.trace(U)):  # LAPACK lets NaN pass
        raise _not_positive_definite()
    return U


def solve_positive_definite(H, b):
    """x, of the shape of b (n,) or (n, k), with ``H x = b``; as :func:`cholesky_root` treats H."""
    U, x, failed = dposv(H.T, b, overwrite_a=True)
    if failed or not np.isfinite(np.trace(U) + x.sum()):  # LAPACK lets NaN pass
        raise _not_positive_definite()
    return x


def _not_positive_definite():
    return np.linalg.LinAlgError("the sums of products are not finite, or not positive definite.")


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
