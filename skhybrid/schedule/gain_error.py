"""Standard error of the step gain of a network, and how far days of random set-points would lower it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._time import rows_per_day
from ..filtering import simulate_path
from .constrained_ridge import gram
from .fit import LeadFit, weighted
from .responses import emitter_series
from .segment import Segment
from .step_gain import network_step_response, observed_gains

_DAY = 24.0
_DAYS = (3, 7, 14, 21, 28)  # numbers of days of random set-points that are tried
LITTLE_ERROR = 0.1  # relative standard error that they are to reach
_FORESEEN = 1.5  # error after such days relative to the foreseen one, mean of 128 fits to make_office
_HELD = (2.0, 6.0)  # hours for which random set-points hold the heat
_SWING = 1.5  # standard deviation of the temperature [K] that random set-points within comfort allow


def step_gain(fit: LeadFit, n_leads: int) -> np.ndarray:
    """(n_leads,) temperature after a step of 1 kW of known heat [K/kW]."""
    return _gain_and_slope(fit, np.arange(1, n_leads + 1))[0]


def step_gain_error(fit: LeadFit, rows: np.ndarray) -> np.ndarray:
    """(L,) relative standard error at ``rows``: the larger one of the jackknife and of the curvature of the loss."""
    gain, slope = _gain_and_slope(fit, rows)
    slope /= gain[:, None]
    H, moves = _jackknife(fit)
    change = moves @ slope.T
    return np.sqrt(np.maximum(_variance(H, slope), (len(change) - 1) * np.var(change, axis=0)))


def _variance(H: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """(L,) variance of what has slopes (L, q) by parameters of which ``H`` is the information."""
    return np.sum(slope.T * np.linalg.solve(H, slope.T), axis=0)


def days_to_determine(fit: LeadFit, role: str) -> tuple[int, float]:
    """Days of random set-points and the relative standard error of a plant's gain at 24 h after them.

    The fewest days with little error, or as many as are tried.  They are like those of the training, but for random
    heat of the plant.
    """
    step, p, coef, free = fit.model.step, len(fit.psi), fit.coef.copy(), fit.solution.free.copy()
    row = np.array([rows_per_day(step)])
    gain, slope = _gain_and_slope(fit, row)
    slope /= gain
    stage = fit.channel_names.index(role) if role in dict(fit.plan.stages) else None
    if stage is not None:  # its capacity is fitted, and is part of its gain
        coef[stage], free[stage] = max(coef[stage], 2.0 * fit.model.heat_scale), True
        slope[:, p + stage] = 1.0 / coef[stage]
    H, _ = _hessian(fit, _slopes(fit, coef, free)[0], free)
    more = _FORESEEN
    if stage is None:  # what blocks of days say beyond the curvature, later days say, too
        more *= float((step_gain_error(fit, row) / np.sqrt(_variance(H, slope)))[0])
    excited = fit.with_rows(_randomly_heated(fit, stage, coef))
    at = excited.problem.evaluate(excited.problem.centre)
    excited = replace(excited, problem=weighted(excited.problem, at))  # each lead counts by how well it is forecast
    per_day = gram(_slopes(excited, coef, free)[0]) * _DAY / (step * fit.segment.n_rows)
    errors = {days: more * float(np.sqrt(_variance(H + days * per_day, slope)[0])) for days in _DAYS}
    return next((found for found in errors.items() if found[1] < LITTLE_ERROR), (_DAYS[-1], errors[_DAYS[-1]]))


def _randomly_heated(fit: LeadFit, stage: int | None, coef: np.ndarray) -> Segment:
    """Training rows under random heat of the known plants, or of a stage, and the temperature that it makes."""
    segment, rng = fit.segment, np.random.default_rng(0)
    heat = segment.heat if stage is None else coef[stage] * segment.channels.series[:, stage]
    shortest, longest = np.maximum(np.divide(_HELD, fit.model.step), 1.0)
    held = rng.integers(round(shortest), round(longest) + 1, segment.n_rows)
    levels = np.repeat(rng.uniform(-0.5, 0.5, segment.n_rows), held)[: segment.n_rows]
    drawn = max(float(np.ptp(heat)), 2.0 * fit.model.heat_scale) * levels
    drawn *= min(1.0, _SWING / float(np.std(_temperature_change(fit, drawn, stage is None))))
    change = heat.mean() + drawn - heat
    excited = segment._replace(y=segment.y + _temperature_change(fit, change, stage is None))
    if stage is None:
        return excited._replace(heat=heat + change)
    series = segment.channels.series.copy()
    series[:, stage] += change / coef[stage]
    return excited._replace(channels=segment.channels._replace(series=series))


def _temperature_change(fit: LeadFit, heat: np.ndarray, delayed: bool) -> np.ndarray:
    """(N,) change of the temperature [K] under additional heat [kW]."""
    model, M = fit.model, fit.model.matrices(fit.psi, slopes=False)
    if delayed and fit.plan.emitter:
        heat = heat + fit.coef[-1] * emitter_series(heat, model.step, np.exp(fit.psi[-1]))
    forcing = np.outer(heat, M.of_heat[:, fit.plan.heated])
    return simulate_path(M.A, forcing, np.zeros(len(M.A)))[:-1, model.zone]


def _gain_and_slope(fit: LeadFit, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain (L,) and its derivatives (L, p + J) by psi and coefficients."""
    at = network_step_response(fit.model, fit.model.matrices(fit.psi), fit.psi, fit.plan.heated, int(rows.max()))
    lagging = fit.coef[-1] if fit.plan.emitter else 0.0
    slope = np.zeros((len(rows), len(fit.psi) + len(fit.coef)))
    slope[:, : len(fit.psi)] = (at.slope + lagging * at.dlagging)[rows - 1]
    if fit.plan.emitter:
        slope[:, -1] = at.lagging[rows - 1]
    return (at.gain + lagging * at.lagging)[rows - 1], slope


def _jackknife(fit: LeadFit) -> tuple[np.ndarray, np.ndarray]:
    """Hessian of psi and coefficients (q, q), and by how much these move without each block of days (n_blocks, q)."""
    free = fit.solution.free
    slopes, errors = _slopes(fit, fit.coef, free)
    H, pulled = _hessian(fit, slopes, free)
    moves, block = [], np.repeat(fit.blocks, len(fit.sample.leads))
    for b in np.unique(fit.blocks):
        own, e = slopes[block == b], errors[block == b]
        moved = own.T @ e - pulled.T @ _pull_without(fit, b)
        moves.append(np.linalg.solve(H - gram(own), moved))
    return H, np.array(moves)


def _slopes(fit: LeadFit, coef: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (O L, q) of the weighted errors by psi and by coefficients, 0 where not ``free``; the errors."""
    problem, scored, p = fit.problem, fit.problem.scored, len(fit.psi)
    E = problem.design(fit.psi, scored)
    _, de = problem.sensitivities(fit.psi, coef, scored)
    slopes = np.hstack([(problem.root_weights(scored)[..., None] * de).reshape(-1, p), -E[:, :-1]])
    slopes[:, p:][:, ~free] = 0.0
    return slopes, E @ np.append(-coef, 1.0)


def _hessian(fit: LeadFit, slopes: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hessian (q, q) by the slopes of the forecasts, and those of the pull (r, q)."""
    problem, p = fit.problem, len(fit.psi)
    H = gram(slopes)
    H[:p, :p] += problem.psi_precision
    H[p:, p:] += np.diag(problem.penalty + ~free)
    if problem.prior is not None:
        H[p:, p:] += problem.prior.of_channels(problem.channels)[:-1, :-1] * (free[:, None] & free)
    if problem.pull is None:
        return H, np.empty((0, len(H)))
    by_coef = -problem.pull.design(problem.model, fit.psi, problem.segment)[:, :-1]
    pulled = np.hstack([problem.pull.sensitivities(problem.model, fit.psi, fit.coef, problem.segment), by_coef])
    pulled[:, p:][:, ~free] = 0.0
    return H + gram(pulled), pulled


def _pull_without(fit: LeadFit, block: int) -> np.ndarray:
    """(r,) change of the weighted errors of the pull when its jumps in a block of days are left out."""
    pull, scored = fit.problem.pull, fit.problem.scored
    if pull is None:
        return np.empty(0)
    begin = scored.sample.origins[np.argmax(fit.blocks == block)]
    later = scored.sample.origins[fit.blocks > block]
    shares = np.ones(scored.segment.n_rows)
    shares[begin : later[0] if len(later) else None] = 0.0
    left = {(g.source, g.lead): g.gain for g in observed_gains(scored.segment, shares)}
    change = [left.get((g.source, g.lead), g.gain) - g.gain for g in pull.observed]
    return np.append(pull.root * change, np.zeros(pull.n_rows - len(change)))
