"""Standard errors of CONV, ID and OD: the exact Hessian, and the fits without each day."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from ...thermal.parameters import search_bounds
from .identifiability import held_subspace
from .standard_errors import (
    ParameterUncertainty,
    day_of_rows,
    informed_directions,
    inverse_information,
    jackknife_covariance,
    log_slopes,
    open_places,
    prior_precision,
    prior_slope,
)

_STEP = 1e-4  # of the searched parameters, for differences of gradients


def least_squares_uncertainty(
    problem: Any, free: np.ndarray, noise: float, names: Sequence[str], days: np.ndarray | None, overlap: int
) -> ParameterUncertainty:
    """Uncertainty of the network's parameters ``names`` at the optimum ``free`` (p,), by the Hessian of every day.

    ``noise`` [K2]; ``days`` (n,) of the errors, None where they follow each other as rows and outputs do; errors are
    correlated over ``overlap`` days.  Where the Hessian is not positive definite, the Gauss-Newton matrix replaces it.
    """
    (n_rows, n_outputs), hours = problem.experiment.outputs.shape, problem.experiment.hours
    n_days = int(day_of_rows(n_rows, hours)[-1]) + 1
    none = np.zeros((0, 0))
    if not len(problem.searched):
        return ParameterUncertainty((), none, none, none, n_days)
    noise = max(noise, 1e-200)  # of an exact fit; information in units of it stays finite
    errors, jacobian = problem.linearised(free)
    slope = errors @ jacobian / noise + prior_slope(problem, free)
    chosen = open_places(problem, free, slope)
    searched, jacobian = [problem.searched[i] for i in chosen], jacobian[:, chosen]
    held = tuple(q.name for q in problem.searched if q.name in set(names) and q not in searched)
    if not len(chosen):
        return ParameterUncertainty((), none, none, none, n_days, held)
    place = [i for i, q in enumerate(searched) if q.name in set(names)]
    day = np.repeat(day_of_rows(len(errors) // n_outputs, hours), n_outputs) if days is None else days
    gauss = np.array([jacobian[day == d].T @ jacobian[day == d] for d in range(day[-1] + 1)])
    scores = _day_scores(errors, jacobian, day)
    prior = np.diag(noise * prior_precision(problem)[chosen])
    exact = _day_hessians(problem, free, day, chosen)
    by_day = exact if _positive(exact.sum(axis=0) + prior) else gauss
    total = by_day.sum(axis=0) + prior
    bread = inverse_information(total / noise)
    model = bread @ (gauss.sum(axis=0) / noise + prior / noise) @ bread if by_day is exact else bread
    # the Hessian without a day is nearly flat where the disturbance is nearly white
    slopes = slope[chosen] - scores / noise
    within = tuple(end[chosen] - free[chosen] for end in search_bounds(problem.searched))
    whole = gauss.sum(axis=0) + prior
    moves = np.array([_step(s, (whole - g) / noise, within) for s, g in zip(slopes, gauss, strict=True)])
    scale = log_slopes(problem, free)[chosen][place]
    model = model[np.ix_(place, place)] * scale[:, None] * scale
    sensitivity = _without(jacobian, place) / np.sqrt(noise) / scale
    jackknife = jackknife_covariance(moves[:, place] * scale @ held_subspace(model), overlap)
    return ParameterUncertainty(tuple(searched[i] for i in place), sensitivity, model, jackknife, n_days, held)


def _day_scores(errors: np.ndarray, jacobian: np.ndarray, day: np.ndarray) -> np.ndarray:
    """(D, p) half gradient of every day's sum of squares."""
    rows = jacobian * errors[:, None]
    return np.array([rows[day == d].sum(axis=0) for d in range(day[-1] + 1)])


def _day_hessians(problem: Any, free: np.ndarray, day: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(D, k, k) half Hessian of every day's sum of squares by the ``chosen``, from differences of exact gradients."""
    out = np.empty((day[-1] + 1, len(chosen), len(chosen)))
    for q, shift in enumerate(_STEP * np.eye(len(free))[chosen]):
        above, below = problem.linearised(free + shift), problem.linearised(free - shift)
        up, down = _day_scores(above[0], above[1][:, chosen], day), _day_scores(below[0], below[1][:, chosen], day)
        out[:, :, q] = (up - down) / (2.0 * _STEP)
    return 0.5 * (out + out.transpose(0, 2, 1))


def _step(slope: np.ndarray, information: np.ndarray, within: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(k,) step to the minimum of a quadratic with a ``slope`` (k,) at zero, between lower and upper ends."""
    values, vectors = informed_directions(information)
    root = np.sqrt(values)
    ends = np.minimum(within[0], 0.0), np.maximum(within[1], 0.0)
    return lsq_linear(root[:, None] * vectors.T, -(slope @ vectors) / root, ends, method="bvls").x


def _positive(matrix: np.ndarray) -> bool:
    """Whether a matrix is positive definite by more than rounding, whatever the units of its rows."""
    diagonal = np.diag(matrix)
    if not (np.isfinite(matrix).all() and (diagonal > 0).all()):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(scale[:, None] * matrix * scale)[0] > 1e-9)


def _without(jacobian: np.ndarray, place: Sequence[int]) -> np.ndarray:
    """Columns ``place`` of a Jacobian, less their projection on the other columns."""
    others = [j for j in range(jacobian.shape[1]) if j not in set(place)]
    chosen = jacobian[:, list(place)]
    if not others:
        return chosen
    norms = np.linalg.norm(jacobian[:, others], axis=0)
    rest = jacobian[:, others] / np.where(norms > 0, norms, 1.0)
    return chosen - rest @ np.linalg.lstsq(rest, chosen, rcond=1e-10)[0]
