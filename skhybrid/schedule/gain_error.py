"""Standard error of the step gain of a network: a jackknife over blocks of days."""

from __future__ import annotations

import numpy as np

from .constrained_ridge import gram
from .fit import LeadFit
from .step_gain import observed_gains, step_response


def step_gain(fit: LeadFit, n_leads: int) -> np.ndarray:
    """(n_leads,) temperature after a step of 1 kW of known heat [K/kW]."""
    return _gain_and_slope(fit, np.arange(1, n_leads + 1))[0]


def step_gain_error(fit: LeadFit, rows: np.ndarray) -> np.ndarray:
    """(L,) relative standard error at ``rows``: the larger one of the jackknife and of the curvature of the loss."""
    gain, slope = _gain_and_slope(fit, rows)
    slope /= gain[:, None]
    H, moves = _moves(fit)
    curvature = np.sum(slope.T * np.linalg.solve(H, slope.T), axis=0)
    change = moves @ slope.T
    return np.sqrt(np.maximum(curvature, (len(change) - 1) * np.var(change, axis=0)))


def _gain_and_slope(fit: LeadFit, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain (L,) and its derivatives (L, p + J) by psi and coefficients."""
    at = step_response(fit.model, fit.model.matrices(fit.psi), fit.psi, fit.plan.heated, int(rows.max()))
    lagging = fit.coef[-1] if fit.plan.emitter else 0.0
    slope = np.zeros((len(rows), len(fit.psi) + len(fit.coef)))
    slope[:, : len(fit.psi)] = (at.slope + lagging * at.dlagging)[rows - 1]
    if fit.plan.emitter:
        slope[:, -1] = at.lagging[rows - 1]
    return (at.gain + lagging * at.lagging)[rows - 1], slope


def _moves(fit: LeadFit) -> tuple[np.ndarray, np.ndarray]:
    """Hessian of psi and coefficients (q, q), and by how much these move without each block of days (n_blocks, q)."""
    problem, scored, coef = fit.problem, fit.problem.forecasts[0], fit.coef
    p, bound = len(fit.psi), ~fit.solution.free
    root = problem.root_weights(scored)
    E = problem.design(fit.psi, scored)
    _, de = problem.sensitivities(fit.psi, coef, scored)
    slopes = np.hstack([(root[..., None] * de).reshape(-1, p), -E[:, :-1]])
    errors = E @ np.append(-coef, 1.0)
    slopes[:, p:][:, bound] = 0.0
    H = gram(slopes) + np.diag(np.append(1.0 / problem.spread**2, problem.penalty + bound))
    pulled = np.empty((0, len(H)))
    if problem.pull is not None:
        pulls = problem.pull.design(problem.model, fit.psi, scored.segment)
        pulled = np.hstack([problem.pull.sensitivities(problem.model, fit.psi, coef, scored.segment), -pulls[:, :-1]])
        pulled[:, p:][:, bound] = 0.0
        H += gram(pulled)
    moves, block = [], np.repeat(fit.blocks, root.shape[1])
    for b in np.unique(fit.blocks):
        own, e = slopes[block == b], errors[block == b]
        moved = own.T @ e - pulled.T @ _pull_without(fit, b)
        moves.append(np.linalg.solve(H - gram(own), moved))
    return H, np.array(moves)


def _pull_without(fit: LeadFit, block: int) -> np.ndarray:
    """(r,) change of the weighted errors of the pull when its jumps in a block of days are left out."""
    pull, scored = fit.problem.pull, fit.problem.forecasts[0]
    if pull is None:
        return np.empty(0)
    begin = scored.sample.origins[np.argmax(fit.blocks == block)]
    later = scored.sample.origins[fit.blocks > block]
    shares = np.ones(scored.segment.n_rows)
    shares[begin : later[0] if len(later) else None] = 0.0
    left = {(g.source, g.lead): g.gain for g in observed_gains(scored.segment, shares)}
    change = [left.get((g.source, g.lead), g.gain) - g.gain for g in pull.observed]
    return np.append(pull.root * change, np.zeros(pull.n_rows - len(change)))
