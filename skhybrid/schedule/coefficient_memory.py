"""Recursive ridge regression of the coefficients, in which older forecasts fade."""

from __future__ import annotations

import numpy as np

from .constrained_ridge import gram, solve_coefficients
from .lead_problem import LeadProblem

#: days after which evidence counts half: in a long memory, and in a short one that adapts to a change sooner
HALF_LIVES = (30.0, 7.0)


class CoefficientMemory:
    """Coefficients that the training and later forecasts give, the weight of each fading with time.

    Parameters
    ----------
    problem : LeadProblem
        Penalties and bounds.
    products : ndarray of shape (J + 1, J + 1)
        Gram matrix of the training forecasts.
    row : int
        Row at which ``products`` count fully.
    half_life : float
        Rows after which a forecast counts half.
    """

    def __init__(self, problem: LeadProblem, products: np.ndarray, row: int, half_life: float) -> None:
        self._problem, self._products, self._row, self._half_life = problem, products, row, half_life
        self._coef: np.ndarray | None = None

    def learn(self, columns: np.ndarray, age: np.ndarray, row: int) -> None:
        """Add weighted forecasts (k, J + 1) whose targets are ``age`` rows before ``row``; earlier ones fade."""
        root_fade = 0.5 ** (0.5 * age / self._half_life)
        fade = 0.5 ** (max(row - self._row, 0) / self._half_life)
        self._products = self._products * fade + gram(columns * root_fade[:, None])
        self._row, self._coef = max(row, self._row), None

    @property
    def coef(self) -> np.ndarray:
        """(J,) solved when first read after new forecasts."""
        if self._coef is None:
            self._coef = solve_coefficients(self._products, self._problem.penalty, self._problem.positive).coef
        return self._coef
