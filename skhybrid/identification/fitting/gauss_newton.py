"""Bounded Gauss-Newton (Levenberg-Marquardt) from many starts at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

#: evaluates S points (S, p): merit (S,), Gauss-Newton matrix (S, p, p) and half gradient (S, p)
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

_LEAST_DAMPING = 1e-9  # keeps the search from following a flat direction, whose slope is rounding
_FIRST_DAMPING, _MOST_DAMPING = 1e-2, 1e12


class Minimum(NamedTuple):
    """Minimum that one start reached."""

    free: np.ndarray  # (p,) on the searched scale
    loss: float
    n_evaluations: int
    converged: bool


class _PresentPoints(NamedTuple):
    """Present point of every start; the arrays are written in place."""

    x: np.ndarray  # (S, p)
    merit: np.ndarray  # (S,)
    matrix: np.ndarray  # (S, p, p)
    slope: np.ndarray  # (S, p)
    scale: np.ndarray  # (S, p) largest diagonal met so far
    damping: np.ndarray  # (S,)
    growth: np.ndarray  # (S,) of the damping after a step that failed
    evaluations: np.ndarray  # (S,) int
    converged: np.ndarray  # (S,) bool


def minimise_together(
    evaluate: Evaluate, starts: np.ndarray, low: np.ndarray, high: np.ndarray, max_evaluations: int, tolerance: float
) -> list[Minimum]:
    """Minimise from every start (S, p) within bounds (p,), all together but independently; minima in their order.

    A start has converged when neither the actual nor the predicted relative reduction of the merit exceeds
    ``tolerance``.  Damping by the diagonal as Marquardt, its updates as Nielsen; a parameter at a bound with the
    descent pointing outward is held there, and steps are projected onto the bounds.
    """
    x = np.clip(starts, low, high)
    merit, matrix, slope = evaluate(x)
    n, p = x.shape
    damping, growth, evaluations = np.full(n, _FIRST_DAMPING), np.full(n, 2.0), np.ones(n, dtype=np.int64)
    converged = np.full(n, not p)
    front = _PresentPoints(x, merit, matrix, slope, _diagonal(matrix), damping, growth, evaluations, converged)
    active = np.flatnonzero(np.isfinite(merit) & ~converged)
    while len(active):
        active = active[_advance(front, active, evaluate, low, high, tolerance)]
        active = active[front.evaluations[active] < max_evaluations]
    return [
        Minimum(front.x[i].copy(), float(front.merit[i]), int(front.evaluations[i]), bool(front.converged[i]))
        for i in range(n)
    ]


def _diagonal(matrix: np.ndarray) -> np.ndarray:
    return np.diagonal(matrix, axis1=1, axis2=2).copy()


def _advance(
    front: _PresentPoints, active: np.ndarray, evaluate: Evaluate, low: np.ndarray, high: np.ndarray, tolerance: float
) -> np.ndarray:
    """One trial step of the active starts; which of them go on, (len(active),) bool."""
    x, slope, matrix = front.x[active], front.slope[active], front.matrix[active]
    held = ((x <= low) & (slope > 0)) | ((x >= high) & (slope < 0))
    scale = np.maximum(front.scale[active], 1e-12 * front.scale[active].max(axis=1, keepdims=True) + 1e-300)
    p = x.shape[1]
    damped = matrix.copy()
    damped[:, np.arange(p), np.arange(p)] += front.damping[active][:, None] * scale
    open_ = ~held
    damped *= open_[:, :, None] & open_[:, None, :]
    damped[:, np.arange(p), np.arange(p)] += held * scale
    step = np.linalg.solve(damped, np.where(held, 0.0, -slope)[..., None])[..., 0]
    trial = np.clip(x + step, low, high)
    step = trial - x
    promised = -(2.0 * (slope * step).sum(axis=1) + (step * (matrix @ step[..., None])[..., 0]).sum(axis=1))

    merit, new_matrix, new_slope = evaluate(trial)
    front.evaluations[active] += 1
    old = front.merit[active]
    better = np.isfinite(merit) & (merit < old)
    gained = np.where(better, old - merit, 0.0)
    settled = (gained <= tolerance * old) & (np.abs(promised) <= tolerance * old)
    rate = np.where(better, gained / np.maximum(promised, 1e-300), 0.0)

    good, bad = active[better], active[~better]
    front.x[good], front.merit[good] = trial[better], merit[better]
    front.matrix[good], front.slope[good] = new_matrix[better], new_slope[better]
    front.scale[good] = np.maximum(front.scale[good], _diagonal(new_matrix[better]))
    eased = front.damping[good] * np.maximum(1.0 / 3.0, 1.0 - (2.0 * np.minimum(rate[better], 1.0) - 1.0) ** 3)
    front.damping[good] = np.maximum(eased, _LEAST_DAMPING)
    front.growth[good] = 2.0
    front.damping[bad] *= front.growth[bad]
    front.growth[bad] *= 2.0
    lost = front.damping[active] > _MOST_DAMPING
    front.converged[active[settled | lost]] = True
    return ~(settled | lost)
