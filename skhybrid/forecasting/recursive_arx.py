"""The ridge solution of the ARX regression, and its update by new rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from .arx_design import ARXData, ARXDesign, Pairs

#: penalty of the constant: none, but where no pair is known the equations must stay regular
_CONSTANT_PENALTY = 1e-9


class Moments(NamedTuple):
    """The normal equations of the regression.  They are sums over pairs, so that rows are added without a new fit."""

    gram: np.ndarray  # (p, p) D' D
    cross: np.ndarray  # (p,) D' d

    @classmethod
    def of(cls, pairs: Pairs) -> Moments:
        """The sums over these pairs."""
        return cls(pairs.D.T @ pairs.D, pairs.D.T @ pairs.d)

    def plus(self, pairs: Pairs) -> Moments:
        """The sums with further pairs."""
        more = Moments.of(pairs)
        return Moments(self.gram + more.gram, self.cross + more.cross)

    def minus(self, pairs: Pairs) -> Moments:
        """The sums without some of the pairs."""
        less = Moments.of(pairs)
        return Moments(self.gram - less.gram, self.cross - less.cross)

    def ridge(self, alpha: float) -> np.ndarray:
        """Coefficients (p,) under the penalty ``alpha``, from which the constant (the last column) is free."""
        penalty = np.full(len(self.cross), alpha)
        penalty[-1] = _CONSTANT_PENALTY
        return solve(self.gram + np.diag(penalty), self.cross, assume_a="pos")


class RecursiveARX:
    """The regression updated by pairs of rows as they become known.

    Parameters
    ----------
    design : ARXDesign
    moments : Moments
        Of the training pairs.
    alpha : float
        Penalty.
    begin : int
        The first row that is not in the training table.
    """

    def __init__(self, design: ARXDesign, moments: Moments, alpha: float, begin: int) -> None:
        self._design, self._moments, self._alpha = design, moments, alpha
        self._next = begin - 1  # row k of the next pair: the first one ends at the first new row
        self._coef: np.ndarray | None = None

    def advance(self, view: ARXData, row: int) -> None:
        """Add the pairs that end by ``row``."""
        if row > max(self._next, 0):
            pairs = self._design.pairs(view, max(self._next, 0), row)
            self._moments, self._next, self._coef = self._moments.plus(pairs), row, None

    def coef(self) -> np.ndarray:
        """Coefficients (n_columns,) from all pairs so far."""
        if self._coef is None:
            self._coef = self._moments.ridge(self._alpha)
        return self._coef
