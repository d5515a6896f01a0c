"""Factors and solutions of positive definite equations that are so small that scipy's own checks take half the time."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv, dpotrf


def cholesky_root(H):
    """Upper triangular U (n, n) with ``U' U = H``; a LinAlgError where H (n, n) is not positive definite."""
    U, failed = dpotrf(H)
    if failed or not np.isfinite(np.trace(U)):
        raise _not_positive_definite()
    return U


def solve_positive_definite(H, b):
    """x (n,) with ``H x = b``; a LinAlgError where H (n, n) is not positive definite, or b not finite."""
    _, x, failed = dposv(H, b)
    if failed or not np.isfinite(x).all():
        raise _not_positive_definite()
    return x


def _not_positive_definite():
    return np.linalg.LinAlgError("the sums of products are not finite, or not positive definite.")
