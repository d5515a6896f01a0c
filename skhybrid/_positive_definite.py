"""Equations with a symmetric positive definite matrix."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv


def solve_positive(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Solve ``A x = b`` for a symmetric positive definite ``A`` (n, n) and ``b`` (n,) or (n, k).

    ``cho_factor`` and ``cho_solve`` check and convert for longer than a hundred unknowns take to solve.

    Raises
    ------
    numpy.linalg.LinAlgError
        If ``A`` is not positive definite, or not finite.
    """
    if not len(b):
        return np.zeros(b.shape)
    _, x, failed = dposv(A.T, b)  # in LAPACK's order of columns, A's transpose needs no copy in another order
    if failed:
        raise np.linalg.LinAlgError(f"the matrix of {len(A)} equations is not positive definite.")
    return np.asarray(x)
