"""Normal equations that grow by a few rows and are solved at each step, by LAPACK without scipy's checks and copies."""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dposv, dpotrf


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
