"""Standard errors of the periodic model: its Hessian, the coefficients solved inside, and the fits without each day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import null_space

from ...thermal import Parameter
from ..fitting.excitation import fixing_scale, scaling_of
from .identifiability import held_subspace
from .standard_errors import (
    FEW_DAYS,
    MOST_PARTS,
    ParameterUncertainty,
    day_of_rows,
    inverse_information,
    jackknife_covariance,
    log_slopes,
    open_places,
    prior_precision,
    unit,
)


def periodic_uncertainty(
    problem: Any,
    free: np.ndarray,
    theta: Mapping[str, float],
    turn: Mapping[str, np.ndarray],
    parameters: Sequence[Parameter],
) -> ParameterUncertainty:
    """Uncertainty of the network's ``parameters`` at the optimum ``free`` (p,), where all have the values ``theta``.

    ``turn`` holds the derivatives (J,) of those that are solved inside by the inner coefficients.
    """
    _, slope, linear = problem.evaluate(free)
    chosen, (hessian, dbeta) = open_places(problem, free, slope), problem.hessian(free)
    hessian, dbeta = hessian[np.ix_(chosen, chosen)], dbeta[:, chosen]
    outer, slopes = inverse_information(hessian), log_slopes(problem, free)[chosen]
    place = {problem.searched[i].name: k for k, i in enumerate(chosen)}
    # a coefficient that its sign holds at 0 stays there
    inside = {name: by * linear.free for name, by in turn.items()}
    decided = tuple(q for q in parameters if q.name in place or np.any(inside.get(q.name, 0.0)))
    identified = {q.name for q in problem.searched} | {name for name, by in turn.items() if np.any(by)}
    held = tuple(q.name for q in parameters if q.name in identified and q not in decided)
    by_free, by_beta = np.zeros((len(decided), len(chosen))), np.zeros((len(decided), len(linear.beta)))
    for i, q in enumerate(decided):
        if q.name in place:
            by_free[i, place[q.name]] = slopes[place[q.name]]
        else:
            by_beta[i] = inside[q.name] / unit(theta[q.name])
    chain = by_free + by_beta @ dbeta
    model = chain @ outer @ chain.T + by_beta @ linear.covariance @ by_beta.T
    days = day_of_rows(len(problem.experiment.y), problem.experiment.hours)
    n_days = int(days[-1]) + 1
    moves = np.zeros((0, len(decided)))
    if len(decided) and n_days >= FEW_DAYS:
        parts = days // -(-n_days // MOST_PARTS)
        moves = _moves_without_days(problem, free, linear.beta, outer, chosen, parts) @ np.hstack([chain, by_beta]).T
    data = hessian - np.diag(prior_precision(problem)[chosen])
    information = _joint_information(data, dbeta, linear, problem.layout.n_plain, by_free, by_beta)
    information = _without_scale(information, problem, decided)
    values, vectors = np.linalg.eigh(information) if len(decided) else (np.zeros(0), np.zeros((0, 0)))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    jackknife = jackknife_covariance(moves @ held_subspace(model))
    return ParameterUncertainty(decided, root, model, jackknife, n_days, held)


def _without_scale(information: np.ndarray, problem: Any, decided: Sequence[Parameter]) -> np.ndarray:
    """The information less that of the gain's prior on the scale, where neither rows nor known values fix the scale."""
    experiment = problem.experiment
    columns = dict(zip(problem.network.inputs(experiment.roles), experiment.inputs.T, strict=False))
    heat_is_measured = any(role.startswith("Q_") and np.any(columns[role]) for role in columns)
    if heat_is_measured or fixing_scale(problem.network, columns, problem.fixed):
        return information
    way = np.array([scaling_of(p) for p in decided])
    way /= max(float(np.linalg.norm(way)), 1.0)
    across = np.eye(len(way)) - np.outer(way, way)
    return across @ information @ across


def _moves_without_days(
    problem: Any, free: np.ndarray, beta: np.ndarray, outer: np.ndarray, chosen: np.ndarray, days: np.ndarray
) -> np.ndarray:
    """(D, k + J) moves of the ``chosen`` parameters, and of the inner coefficients beyond what those explain."""
    moves = []
    for d in range(days[-1] + 1):
        y = problem.experiment.y.copy()
        if not np.isfinite(y[days == d]).any():
            continue
        y[days == d] = np.nan
        _, slope, linear = replace(problem, experiment=problem.experiment._replace(y=y)).evaluate(free)
        moves.append(np.concatenate([-outer @ slope[chosen], linear.beta - beta]))
    return np.array(moves)


def _joint_information(
    data: np.ndarray, dbeta: np.ndarray, linear: Any, n_plain: int, by_free: np.ndarray, by_beta: np.ndarray
) -> np.ndarray:
    """(k, k) information about the logarithms of the parameters; ``data`` (p, p) is the Hessian without the prior."""
    plain = np.flatnonzero(linear.free[:n_plain])
    normal = linear.normal
    rest = np.arange(n_plain, len(normal))
    cross = normal[np.ix_(plain, rest)]
    inner = normal[np.ix_(plain, plain)] - cross @ np.linalg.solve(normal[np.ix_(rest, rest)], cross.T)
    D = dbeta[plain]
    joint = np.block([[data + D.T @ inner @ D, -D.T @ inner], [-inner @ D, inner]])
    turn = np.hstack([by_free, by_beta[:, plain]])
    if not len(turn):
        return np.zeros((0, 0))
    back = np.hstack([np.linalg.pinv(turn), null_space(turn)])
    turned, k = back.T @ joint @ back, len(turn)
    cross = turned[:k, k:]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(turned)[k:], 1e-12))
    values, vectors = np.linalg.eigh(scale[:, None] * turned[k:, k:] * scale)
    held = values > 1e-9
    reduced = (cross * scale) @ vectors[:, held]
    return turned[:k, :k] - (reduced / values[held]) @ reduced.T
