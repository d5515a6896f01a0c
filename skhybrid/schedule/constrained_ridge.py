"""Ridge regression with non-negative and free coefficients, from sums of products."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.linalg.blas import dsyrk
from scipy.optimize import nnls


class Solution(NamedTuple):
    """Solution of the constrained problem."""

    coef: np.ndarray  # (J,)
    free: np.ndarray  # (J,) bool, coefficients that are not at their bound
    loss: float  # half the penalised sum of squares


def gram(E: np.ndarray) -> np.ndarray:
    """``E' E``, symmetric to the bit."""
    if not len(E):
        return np.zeros((E.shape[1],) * 2)
    upper = dsyrk(1.0, np.ascontiguousarray(E).T)
    return upper + np.triu(upper, 1).T


def solve_coefficients(G: np.ndarray, penalty: np.ndarray, positive: np.ndarray) -> Solution:
    """Coefficients with the least sum of squares under ``penalty`` (J,), those in ``positive`` (J,) at least 0.

    ``G`` (J + 1, J + 1) are sums of products of the columns and, last, the target.
    """
    J = len(penalty)
    H, b = G[:J, :J] + np.diag(penalty), G[:J, J]
    free, bounded = np.flatnonzero(~positive), np.flatnonzero(positive)
    factor = cho_factor(H[np.ix_(free, free)])
    coef = np.zeros(J)
    cross = cho_solve(factor, H[np.ix_(free, bounded)])
    if len(bounded):
        # with the free ones eliminated, what is left is a small problem with bounds
        inner = H[np.ix_(bounded, bounded)] - H[np.ix_(bounded, free)] @ cross
        inner[np.diag_indices_from(inner)] += 1e-10 * np.trace(inner)
        L = cholesky(inner, lower=True)
        coef[bounded], _ = nnls(L.T, solve_triangular(L, b[bounded] - cross.T @ b[free], lower=True))
    coef[free] = cho_solve(factor, b[free]) - cross @ coef[bounded]
    return Solution(coef, ~positive | (coef > 0), 0.5 * float(G[J, J] - b @ coef))
