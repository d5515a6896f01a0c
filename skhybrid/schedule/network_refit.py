"""Refit of the network's nonlinear parameters on the last weeks of rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..filtering import ForecastSample
from .completed_forecasts import HISTORY_WEIGHT
from .constrained_ridge import gram
from .fit import LeadFit
from .lead_problem import ScoredForecasts, minimise
from .online_network import OnlineNetwork
from .segment import NumberedSegment

#: days of rows that a refit sees, its Gauss-Newton steps, and hours between the origins that it scores
_WINDOW_DAYS, _STEPS, _ORIGIN_HOURS = 56, 2, 4
#: days of rows that a refitted network goes through at once, which bounds the memory
_PIECE_DAYS = 7
_DAY = 24.0


def refit_network(fit: LeadFit, psi: np.ndarray, rows: NumberedSegment, end: int) -> OnlineNetwork:
    """Refit a network on the last weeks and take it through all rows so far.

    Parameters
    ----------
    fit : LeadFit
    psi : ndarray of shape (p,)
        Where the search begins.
    rows : NumberedSegment
    end : int
        Row after the last one that counts.

    Returns
    -------
    OnlineNetwork
        At row ``end - 1``.
    """
    network = OnlineNetwork(fit, _refit_psi(fit, psi, rows, end), rows.begin)
    training, first = None, rows.begin
    half = _every_second(fit)
    if rows.joined:  # the training rows are the first of these rows
        first = fit.segment.n_rows
        training = network.respond(rows.between(0, first), half.sample.origins)
    network.start_memories(gram(fit.problem.design(network.psi, half, training)))
    per_day, spacing = round(_DAY / fit.model.step), _ORIGIN_HOURS * max(1, round(1.0 / fit.model.step))
    for piece in range(first, end, _PIECE_DAYS * per_day):
        until = min(piece + _PIECE_DAYS * per_day, end)
        origins = origins_between(piece, until, rows.begin, spacing)
        network.learn(network.advance(rows.between(piece, until), piece, origins, spacing), until - 1)
    return network


def origins_between(first: int, end: int, begin: int, spacing: int) -> np.ndarray:
    """Origins in [first, end) that are ``spacing`` rows apart, counted from ``begin``; none is before ``begin``."""
    first = max(first, begin)
    return np.arange(first + (begin - first) % spacing, end, spacing)


def _refit_psi(fit: LeadFit, psi: np.ndarray, rows: NumberedSegment, end: int) -> np.ndarray:
    """Nonlinear parameters (p,) of the last weeks."""
    per_day, leads = round(_DAY / fit.model.step), fit.sample.leads
    first = max(0, end - _WINDOW_DAYS * per_day - per_day)
    warmup = per_day if rows.joined or first else 0  # from a day on, as in training
    origins = np.arange(warmup, end - 1 - first, max(1, round(_ORIGIN_HOURS / fit.model.step)))
    weight = np.where(origins + first >= rows.begin, HISTORY_WEIGHT, 1.0)
    forecasts = [ScoredForecasts(rows.between(first, end), ForecastSample(origins, leads), weight)]
    if not rows.joined:
        forecasts.append(_every_second(fit))
    return minimise(replace(fit.problem, forecasts=tuple(forecasts)), psi, max_steps=_STEPS).psi


def _every_second(fit: LeadFit) -> ScoredForecasts:
    """Training forecasts from every second origin."""
    return ScoredForecasts(fit.segment, ForecastSample(fit.sample.origins[::2], fit.sample.leads))
