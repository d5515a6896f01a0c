"""Cross-validation of the coefficients: blocks of days are left out in turn, and the linear part is solved again."""

from __future__ import annotations

import numpy as np

from ..filtering import ForecastSample
from .constrained_ridge import gram, solve_coefficients
from .lead_problem import Evaluation, LeadProblem, ScoredForecasts, Shrinkage, penalty_of

#: shrinkages that are tried
_GAINS, _UAS, _DAY_TYPES = (0.1, 0.3, 1.0, 3.0), (0.1, 0.3, 1.0, 3.0, 10.0), (1.0, 3.0)
_MOST_BLOCKS, _LEAST_BLOCKS = 6, 3
_DAY = 24.0


def blocks_of_days(sample: ForecastSample, step: float) -> np.ndarray:
    """(O,) block of days of each origin: weeks where there are enough; a single block where none can be left out."""
    hours = (sample.origins - sample.origins[:1]) * step if len(sample.origins) else np.empty(0)
    days = hours[-1] / _DAY if len(hours) else 0.0
    length = max(1.0, min(7.0, days / _MOST_BLOCKS)) if days < 7.0 * _LEAST_BLOCKS else 7.0
    count = max(1, round(days / length))
    if count < _LEAST_BLOCKS:
        return np.zeros(len(hours), dtype=np.int64)
    return np.minimum((hours / _DAY / length).astype(np.int64), count - 1)


def best_shrinkage(problem: LeadProblem, at: Evaluation, blocks: np.ndarray) -> Shrinkage:
    """Shrinkage with the least error in blocks that are left out in turn."""
    if not problem.plan.calendar or not _several(blocks):
        return Shrinkage()
    scored = problem.forecasts[0]
    grams = _block_grams(at.designs[0], scored.sample, blocks)
    scale, positive = problem.model.heat_scale, problem.positive

    def error(shrinkage: Shrinkage) -> float:
        penalty, out = penalty_of(scored.segment, shrinkage, scale), 0.0
        for block, others in grams:
            residual = np.append(-solve_coefficients(others, penalty, positive).coef, 1.0)
            out += float(residual @ block @ residual)
        return out

    # one coordinate after the other: the three hardly depend on each other
    best = min((Shrinkage(g, u) for g in _GAINS for u in _UAS), key=error)
    return min((best._replace(day_type=d) for d in _DAY_TYPES), key=error)


def left_out_errors(problem: LeadProblem, at: Evaluation, blocks: np.ndarray) -> np.ndarray:
    """(O, L) errors [K] of forecasts whose block of days was left out; NaN where there is no measurement."""
    scored, E = problem.forecasts[0], at.designs[0]
    errors = np.full((len(scored.sample.origins), len(scored.sample.leads)), np.nan)
    if not _several(blocks):
        return errors
    for b, (_, others) in enumerate(_block_grams(E, scored.sample, blocks)):
        coef = solve_coefficients(others, problem.penalty, problem.positive).coef
        errors[blocks == b] = forecast_errors(problem, scored, E, coef)[blocks == b]
    return errors


def forecast_errors(problem: LeadProblem, scored: ScoredForecasts, design: np.ndarray, coef: np.ndarray) -> np.ndarray:
    """(O, L) errors [K] of a weighted design under coefficients; NaN where there is no measurement."""
    root = problem.root_weights(scored)
    e = (design[:, -1] - design[:, :-1] @ coef).reshape(root.shape)
    return np.where(root > 0, e / np.where(root > 0, root, 1.0), np.nan)


def _several(blocks: np.ndarray) -> bool:
    return bool(len(blocks) and blocks.max())


def _block_grams(E: np.ndarray, sample: ForecastSample, blocks: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Sums of products (J + 1, J + 1) of each block of days, and of the forecasts that touch none of its days."""
    by_origin = E.reshape(len(blocks), -1, E.shape[1])

    def gram_of(chosen: np.ndarray) -> np.ndarray:
        return gram(by_origin[chosen].reshape(-1, E.shape[1]))

    grams = [gram_of(blocks == b) for b in range(int(blocks.max()) + 1)]
    total = np.sum(grams, axis=0)
    begins = sample.origins[np.searchsorted(blocks, np.arange(len(grams)))]
    longest = int(sample.leads[-1])
    # forecasts from just before a block have their targets in it
    into = [gram_of((blocks < b) & (sample.origins + longest > begin)) for b, begin in enumerate(begins)]
    return [(own, total - own - before) for own, before in zip(grams, into, strict=True)]
