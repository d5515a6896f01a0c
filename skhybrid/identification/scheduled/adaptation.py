"""Forecasts of later rows, with what the rows up to each origin teach: coefficients re-solved, network re-fitted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .coefficients import gram, solve_coefficients
from .fit import LeadFit
from .problem import Part, minimise
from .responses import Responses, Sample, Stretch, respond

#: how much a completed forecast of the history counts beside one of the training
_RECENT = 3.0
#: days between re-fits of the network, days that such a re-fit sees, its steps, and hours between what it scores
_REFIT_DAYS, _WINDOW_DAYS, _STEPS, _REFIT_EVERY = 10, 56, 2, 3.0
#: days after which what was learned counts half
_HALF_LIFE = 30.0
_DAY = 24.0
_NEVER = np.iinfo(np.int64).max


class Later(NamedTuple):
    """Rows behind the training: as one stretch with it, or by themselves."""

    stretch: Stretch
    begin: int  # the first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own


class Followed(NamedTuple):
    """Forecasts [K from the reference], and how wrong those of the history were."""

    paths: np.ndarray  # (n_origins, n_leads)
    errors: np.ndarray  # (O, L) [K] of the history's sample, made with what was known on the day; NaN where unknown
    heat: np.ndarray | None = None  # (n_origins, n_leads) unmeasured heat over the step of each row ahead [kW]
    learned: tuple[tuple[np.ndarray, np.ndarray], ...] = ()  # psi and coefficients of each origin


@dataclass(frozen=True)
class _Era:
    """Rows over which the network stays as it is."""

    psi: np.ndarray
    start: int
    stop: int


def follow(
    fit: LeadFit, later: Later, origins: np.ndarray, n_leads: int, sample: Sample, adapt: str | None
) -> Followed:
    """Forecast from each origin.

    Parameters
    ----------
    fit : LeadFit
    later : Later
    origins : ndarray of int, shape (n_origins,)
        Rows of the stretch, increasing.
    n_leads : int
    sample : Sample
        Forecasts of the history, from ``later.begin`` on, that are learned from and whose errors are wanted.
    adapt : {None, "linear", "full"}

    Returns
    -------
    Followed
    """
    paths, heat = np.empty((len(origins), n_leads)), np.empty((len(origins), n_leads))
    errors = np.full((len(sample.origins), len(sample.leads)), np.nan)
    learned: list[tuple[np.ndarray, np.ndarray]] = []
    for era in _eras(fit, later, int(origins[-1]) if len(origins) else 0, adapt):
        mine = np.flatnonzero((origins >= era.start) & (origins < era.stop))
        wanted = [origins[mine], sample.origins if adapt else origins[:0]]
        if adapt and later.joined and era.psi is not fit.point.psi:
            wanted.append(fit.sample.origins)
        found = respond(fit.model, era.psi, later.stretch, np.unique(np.concatenate(wanted)))
        if adapt is None:
            coefs = np.tile(fit.point.solution.coef, (len(mine), 1))
        else:
            coefs, own = _learn(fit, later, era, origins[mine], sample, found)
            past = np.isfinite(own)
            errors[past] = own[past]
        if len(mine):
            ahead = Sample(origins[mine], np.arange(1, n_leads + 1))
            here = found.at(ahead.origins)
            paths[mine] = here.forecasts(fit.model, ahead, coefs)
            heat[mine] = here.unmeasured(later.stretch, ahead, coefs)
            learned += [(era.psi, coef) for coef in coefs]
    return Followed(paths, errors, heat, tuple(learned))


def _eras(fit: LeadFit, later: Later, last: int, adapt: str | None) -> Iterator[_Era]:
    """The training's network, and with ``adapt="full"`` one that is re-fitted every so many days."""
    every = _REFIT_DAYS * round(_DAY / fit.model.step)
    psi, start, mark = fit.point.psi, 0, later.begin + every
    while adapt == "full" and mark <= last:
        yield _Era(psi, start, mark)
        psi, start, mark = _refit(fit, later, psi, mark), mark, mark + every
    yield _Era(psi, start, _NEVER)


def _training_gram(fit: LeadFit, later: Later, psi: np.ndarray, found: Responses) -> np.ndarray:
    """Of the training forecasts under a network; every other one where that is not the training's own."""
    if psi is fit.point.psi:
        return fit.gram
    own = fit.problem.parts[0]
    half = own._replace(sample=Sample(own.sample.origins[::2], own.sample.leads))
    if later.joined:  # the rows are the same, and the stretch is as it would be
        return gram(fit.problem.columns(psi, half._replace(stretch=later.stretch.until(own.stretch.n_rows)), found))
    return gram(fit.problem.columns(psi, half))


def _refit(fit: LeadFit, later: Later, psi: np.ndarray, row: int) -> np.ndarray:
    """The network's parameters from the rows up to ``row`` (that one included), beginning with ``psi``."""
    a_day, step, leads = round(_DAY / fit.model.step), fit.model.step, fit.sample.leads
    earliest = a_day if later.joined else later.begin
    first = max(earliest, row + 1 - _WINDOW_DAYS * a_day)
    origins = np.arange(first, row, max(1, round(_REFIT_EVERY / step)))
    weight = np.where(origins >= later.begin, _RECENT, 1.0)
    parts = [Part(later.stretch.until(row + 1), Sample(origins, leads), weight)]
    if not later.joined:
        own = fit.problem.parts[0]
        parts.append(Part(own.stretch, Sample(own.sample.origins[::2], leads)))
    return minimise(replace(fit.problem, parts=tuple(parts)), psi, most=_STEPS).psi


def _learn(
    fit: LeadFit, later: Later, era: _Era, origins: np.ndarray, sample: Sample, found: Responses
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (n_origins, J) of each origin, and the errors (O, L) of the era's history.

    Errors are those of coefficients that were known at the start of the forecast's day.
    """
    problem, a_day = fit.problem, round(_DAY / fit.model.step)
    last = int(origins[-1]) if len(origins) else min(era.stop, later.stretch.n_rows) - 1
    errors = np.full((len(sample.origins), len(sample.leads)), np.nan)
    known = Sample(sample.origins[sample.origins < last], sample.leads)
    if not len(known.origins):
        total = _training_gram(fit, later, era.psi, found)
        coef = solve_coefficients(total, problem.penalty, problem.positive).coef
        return np.tile(coef, (len(origins), 1)), errors
    part = Part(later.stretch, known, _RECENT)
    root, E = problem.root_weights(part), problem.columns(era.psi, part, found)
    ends = (known.origins[:, None] + known.leads).ravel()
    order = np.argsort(ends, kind="stable")
    day = (known.origins - later.begin) // a_day
    ours = (known.origins >= era.start) & (known.origins < era.stop)
    marks = later.begin + a_day * np.unique(day[ours])
    total, done, coefs = _training_gram(fit, later, era.psi, found), 0, np.empty((len(origins), len(problem.penalty)))
    before = later.begin
    for row in np.unique(np.concatenate([origins, marks])):
        stop = int(np.searchsorted(ends[order], row, side="right"))
        new = order[done:stop]
        faded = 0.5 ** (0.5 * (row - ends[new]) / (a_day * _HALF_LIFE))
        total = total * 0.5 ** (max(row - before, 0) / (a_day * _HALF_LIFE)) + gram(E[new] * faded[:, None])
        before, done = max(row, before), stop
        coef = solve_coefficients(total, problem.penalty, problem.positive).coef
        coefs[origins == row] = coef
        if row in marks:
            chosen = np.flatnonzero(ours & (day == (row - later.begin) // a_day))
            rows = (chosen[:, None] * len(known.leads) + np.arange(len(known.leads))).ravel()
            e = (E[rows, -1] - E[rows, :-1] @ coef).reshape(len(chosen), -1)
            errors[chosen] = np.where(root[chosen] > 0, e / np.where(root[chosen] > 0, root[chosen], 1.0), np.nan)
    return coefs, errors
