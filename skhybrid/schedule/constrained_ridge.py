"""Ridge regression with non-negative and free coefficients, from sums of products."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dsyrk
from scipy.linalg.lapack import dtrtrs
from scipy.optimize import nnls

from ..filtering import cholesky_root


class Solution(NamedTuple):
    """Solution of the constrained problem."""

    coef: np.ndarray  # (J,)
    free: np.ndarray  # (J,) bool, coefficients that are not at their bound
    loss: float  # half the penalised sum of squares


def gram(E: np.ndarray) -> np.ndarray:
    """``E' E``, symmetric to the bit."""
    if not len(E):
        return np.zeros((E.shape[1],) * 2)
    upper = dsyrk(1.0, np.ascontiguousarray(E).T)  # the rest is 0
    whole = upper + upper.T
    _diagonal(whole)[:] *= 0.5
    return whole


def _diagonal(square: np.ndarray) -> np.ndarray:
    """The diagonal of a matrix, to be written."""
    return np.einsum("ii->i", square)


def solve_coefficients(G: np.ndarray, penalty: np.ndarray, positive: np.ndarray) -> Solution:
    """Coefficients with the least sum of squares under ``penalty`` (J,), those in ``positive`` (J,) at least 0.

    ``G`` (J + 1, J + 1) are sums of products of the columns and, last, the target.
    """
    J = len(penalty)
    free, bounded = np.flatnonzero(~positive), np.flatnonzero(positive)
    of_free, of_bounded = G[free], G[bounded]
    H, inner = of_free[:, free], of_bounded[:, bounded]
    _diagonal(H)[:] += penalty[free]
    _diagonal(inner)[:] += penalty[bounded]
    root = cholesky_root(H)
    turned = dtrtrs(root, of_free[:, np.append(bounded, J)], trans=1)[0]
    beside, left = turned[:, :-1], turned[:, -1]
    coef = np.zeros(J)
    if len(bounded):
        # with the free ones eliminated, what is left is a small problem with bounds
        inner -= beside.T @ beside
        _diagonal(inner)[:] += 1e-10 * np.trace(inner)
        R = cholesky_root(inner)
        coef[bounded], _ = nnls(R, dtrtrs(R, of_bounded[:, J] - beside.T @ left, trans=1)[0])
    coef[free] = dtrtrs(root, left - beside @ coef[bounded])[0]
    return Solution(coef, ~positive | (coef > 0), 0.5 * float(G[J, J] - G[:J, J] @ coef))
