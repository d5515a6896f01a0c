"""Ridge regression with some coefficients that must not be negative, from sums of products."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.linalg.blas import dsyrk
from scipy.optimize import nnls


class Solution(NamedTuple):
    """Coefficients, which of them no bound holds, and half the penalised sum of squares."""

    coef: np.ndarray  # (J,)
    free: np.ndarray  # (J,) bool
    loss: float


def gram(E: np.ndarray) -> np.ndarray:
    """``E' E``, symmetric to the bit."""
    if not len(E):
        return np.zeros((E.shape[1],) * 2)
    upper = dsyrk(1.0, np.ascontiguousarray(E).T)
    return upper + np.triu(upper, 1).T


def solve_coefficients(G: np.ndarray, penalty: np.ndarray, positive: np.ndarray) -> Solution:
    """Coefficients with the least penalised sum of squares.

    Parameters
    ----------
    G : ndarray of shape (J + 1, J + 1)
        Sums of products of the columns and, last, the target.
    penalty : ndarray of shape (J,)
        Positive.
    positive : ndarray of bool, shape (J,)
        Coefficients that are at least 0.

    Returns
    -------
    Solution
    """
    J = len(penalty)
    H, b = G[:J, :J] + np.diag(penalty), G[:J, J]
    loose, bound = np.flatnonzero(~positive), np.flatnonzero(positive)
    factor = cho_factor(H[np.ix_(loose, loose)])
    coef = np.zeros(J)
    cross = cho_solve(factor, H[np.ix_(loose, bound)])
    if len(bound):
        # the loose ones solved inside, what is left is a small problem with bounds
        inner = H[np.ix_(bound, bound)] - H[np.ix_(bound, loose)] @ cross
        inner[np.diag_indices_from(inner)] += 1e-10 * np.trace(inner)
        L = cholesky(inner, lower=True)
        coef[bound], _ = nnls(L.T, solve_triangular(L, b[bound] - cross.T @ b[loose], lower=True))
    coef[loose] = cho_solve(factor, b[loose]) - cross @ coef[bound]
    return Solution(coef, ~positive | (coef > 0), 0.5 * float(G[J, J] - b @ coef))
