"""ARX fitted on errors at many leads: slopes of its forecasts, damped Gauss-Newton steps, and daily re-fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_per_day, rows_per_hour
from ..filtering import hourly_sample, iterate_lags, regression_slopes
from .arx_design import CONSTANT_PENALTY, ARXData, ARXDesign, Moments, Pairs, coefs_at
from .arx_prior import ARXPrior
from .features import target_rows

_CHUNK = 256  # origins whose slopes are in memory at a time
_LEAD_POWER = -0.3  # squared errors count with this power of their lead
_QUARTER_HOUR = 0.25  # unit of that lead [h]
_STEPS, _TRIES = 6, 4  # Gauss-Newton steps of a fit, and attempts with more damping at each
_DAMPING = 1e-6  # next to none: the problem is nearly quadratic, and steps that fail are damped by far more
_LEAST_GAIN = 1e-4  # of the squared errors, below which steps end
_STEPS_PER_DAY = 2  # Gauss-Newton steps of a daily re-fit; where penalties are compared for long trainings, half of it
_HISTORY_WEIGHT, _HALF_LIFE_DAYS = 3.0, 30.0  # of the rows after the training table


class Penalties(NamedTuple):
    """The penalties of a fit."""

    alpha: float  # on every standardised column
    calendar: float  # further, on columns of the calendar
    one_step: float  # weight of squared one-step errors, relative to those at all leads at the start


_USUAL = Penalties(alpha=1.0, calendar=1000.0, one_step=5.0)
_CHOICES = {"one_step": (1.0, 25.0), "calendar": (100.0,), "alpha": (1000.0,)}  # compared in turn with the usual ones
_ORIGINS_PER_DAY = 8  # of the comparison


class LeadTargets(NamedTuple):
    """Forecasts that are scored, and what was measured of their targets."""

    origins: np.ndarray  # (O,) rows
    truth: np.ndarray  # (O, L) measured temperatures [degC]
    weights: np.ndarray  # (O, L), 0 where nothing counts


class LeadForecasts(NamedTuple):
    """Forecasts by some coefficients, and their errors."""

    coef: np.ndarray  # (p,)
    targets: LeadTargets
    paths: np.ndarray  # (O, H) [degC]
    errors: np.ndarray  # (O, L) [K], 0 where nothing counts

    @property
    def squares(self) -> float:
        """Weighted sum of squared errors [K2]."""
        return float(np.sum(self.targets.weights * self.errors**2))


@dataclass(frozen=True)
class MultiStepProblem:
    """The weighted squares of errors at many leads from origins an hour or two apart."""

    design: ARXDesign
    leads: np.ndarray  # (L,) int, increasing
    weights: np.ndarray  # (L,)
    stride: int  # hourly origins, or rows, from one origin to the next
    every: int  # rows between origins
    per_day: int  # rows

    @classmethod
    def of_training(cls, design: ARXDesign, table: ZoneTable, n_leads: int) -> Self:
        """Leads up to ``n_leads`` rows, fewer for a short table."""
        sample = hourly_sample(table.n_rows, n_leads, table.step_hours, 0)
        leads, stride = sample.main_leads, sample.stride
        own = (sample.leads * table.step_hours / _QUARTER_HOUR) ** _LEAD_POWER
        # of a lead that is left out the errors are those between its neighbours
        weights = np.array([np.interp(sample.leads, leads, one) for one in np.eye(len(leads))]) @ own
        every = stride * rows_per_hour(table.step)
        return cls(design, leads, stride * weights, stride, every, rows_per_day(table.step))

    @property
    def unit(self) -> float:
        """Weight of all leads from one hourly origin."""
        return float(self.weights.sum()) / self.stride

    def origins(self, begin: int, end: int) -> np.ndarray:
        """Origins in [begin, end)."""
        return np.arange(begin, end, self.every)

    def targets(self, view: ARXData, origins: np.ndarray, span: tuple[int, int]) -> LeadTargets:
        """Targets in (span[0], span[1]] of forecasts from some origins, without a gap."""
        rows = origins[:, None] + self.leads
        inside = (rows > span[0]) & (rows <= min(span[1], view.end - 1))
        truth = view.T[np.minimum(rows, view.end - 1) - view.first]
        counts = inside & np.isfinite(truth) & self.design.half_known(view, origins)[:, None]
        return LeadTargets(origins, truth, counts * self.weights)

    def forecasts(self, view: ARXData, coef: np.ndarray, targets: LeadTargets) -> LeadForecasts:
        """Forecasts by coefficients (p,)."""
        paths = self.design.iterate(view, targets.origins, int(self.leads[-1]), coef[None, :])
        errors = np.where(targets.weights > 0.0, targets.truth - paths[:, self.leads - 1], 0.0)
        return LeadForecasts(coef, targets, paths, errors)

    def training_forecasts(self, view: ARXData, coef: np.ndarray, end: int) -> LeadForecasts:
        """Forecasts by coefficients (p,) of all targets before row ``end``."""
        return self.forecasts(view, coef, self.targets(view, self.origins(view.first, end), (view.first, end - 1)))

    def moments(self, view: ARXData, made: LeadForecasts) -> Moments:
        """The normal equations of the errors linearised at the coefficients of forecasts."""
        coef, origins = made.coef, made.targets.origins
        p, n_leads = len(coef), int(self.leads[-1])
        total, impulse = Moments(np.zeros((p, p)), np.zeros(p)), self._impulse(coef)
        for first in range(0, len(origins), _CHUNK):
            part = slice(first, first + _CHUNK)
            chunk, weights = origins[part], made.targets.weights[part]
            ahead = (made.paths[part, :-1] - self.design.T_mean) / self.design.T_scale
            T = np.hstack([self.design.windows(view, chunk)[:, ::-1], ahead])
            rows = view.exogenous[chunk[0] - view.first : chunk[-1] - view.first + n_leads]
            root = np.sqrt(weights)
            slopes = regression_slopes(T, rows, impulse, self.every, self.leads, root)
            errors = (root * made.errors[part])[weights > 0.0]
            total = total.plus(Moments(slopes.T @ slopes, slopes.T @ (errors + slopes @ coef)))
        return total

    def _impulse(self, coef: np.ndarray) -> np.ndarray:
        """(H,) effect of a change of a temperature step on the temperature at its end and at each row after it."""
        lags = coef[None, : self.design.n_lags][:, ::-1] / self.design.T_scale
        begin, still, at = np.zeros_like(lags), np.zeros(1), np.zeros(1, dtype=np.int64)
        begin[0, -1] = 1.0
        return np.append(1.0, iterate_lags(begin, lags, still, at, int(self.leads[-1]) - 1, -np.inf, np.inf))

    def penalty(self, penalties: Penalties) -> np.ndarray:
        """(p,) the penalty on each coefficient; none on the constant."""
        p = self.design.n_lags + len(self.design.input_mean) + self.design.n_calendar + 1
        penalty = np.full(p, penalties.alpha)
        penalty[p - 1 - self.design.n_calendar :] += penalties.calendar
        penalty[-1] = CONSTANT_PENALTY
        return penalty


class MultiStepFit(NamedTuple):
    """A solution, with the sums at it to which later rows are added."""

    problem: MultiStepProblem
    coef: np.ndarray  # (p,)
    moments: Moments  # of the errors at all leads, linearised at ``coef``
    pairs: Moments  # of the one-step errors
    penalties: Penalties
    ratio: float  # squares at all leads per one-step square, at the start
    noise: float = 0.0  # squares at all leads and of one step, per row, in units of the leads' weights [K2]
    prior: Moments | None = None  # as sums over pairs, which ``pairs`` includes

    @property
    def one_step(self) -> float:
        """Weight of the one-step sums."""
        return self.penalties.one_step * self.ratio

    def without(self, view: ARXData, begin: int, end: int, pairs: Pairs) -> np.ndarray:
        """Coefficients (p,) one step from the solution, without forecasts that meet rows [begin, end) and ``pairs``."""
        reach = int(self.problem.leads[-1])
        origins = self.problem.origins(view.first, view.end)
        meeting = origins[(origins >= begin - reach) & (origins < end)]
        targets = self.problem.targets(view, meeting, (view.first, view.end))
        meant = self.problem.moments(view, self.problem.forecasts(view, self.coef, targets))
        left = self.moments.plus(meant, -1.0)
        return left.plus(self.pairs.with_pairs(pairs, sign=-1), self.one_step).solution(
            self.problem.penalty(self.penalties)
        )

    def improved(self, view: ARXData, end: int, penalties: Penalties, n_steps: int = _STEPS) -> MultiStepFit:
        """After damped Gauss-Newton steps with these penalties on errors with targets up to row ``end``."""
        problem, coef, moments, damping = self.problem, self.coef, self.moments, _DAMPING
        targets = problem.targets(view, problem.origins(view.first, end), (view.first, end))
        penalty, weight = problem.penalty(penalties), penalties.one_step * self.ratio

        def tried(at: np.ndarray) -> tuple[LeadForecasts, float]:
            made = problem.forecasts(view, at, targets)
            return made, made.squares + _quadratic(self.pairs, weight, penalty, at)

        _, best = tried(coef)
        for _ in range(n_steps):
            whole, before = moments.plus(self.pairs, weight), best
            for _ in range(_TRIES):
                held = damping * np.diag(whole.gram)
                trial = Moments(whole.gram, whole.cross + held * coef).solution(penalty + held)
                made, reached = tried(trial)
                damping *= 0.1 if reached < best else 100.0
                if reached < best:
                    coef, best, moments = trial, reached, problem.moments(view, made)
                    break
            if not before - best >= _LEAST_GAIN * made.squares:  # NaN far from where equations hold
                break
        return self._replace(coef=coef, moments=moments, penalties=penalties)

    @property
    def _own_pairs(self) -> Moments:
        """The sums of the one-step errors without the prior's."""
        return self.pairs if self.prior is None else self.pairs.plus(self.prior, -1.0)

    def information(self) -> Moments:
        """The sums of the training at the solution, of errors at all leads and of one step, per unit of weight."""
        weight = self.problem.unit
        whole = self.moments.plus(self._own_pairs, self.one_step)
        return Moments(whole.gram / weight, whole.cross / weight)

    def under(self, prior: ARXPrior, step: pd.Timedelta, squares: float, n: int) -> MultiStepFit:
        """The same with a prior among its pairs; ``squares`` are what its ``n`` rows leave."""
        weight, here = self.problem.unit, self.information()
        whole = squares / weight + 2.0 * here.cross @ self.coef - self.coef @ here.gram @ self.coef
        pull = prior.pseudo_rows(self.problem.design, step, here, float(whole), n)
        share = weight / self.one_step
        rows = Moments(share * pull.gram, share * pull.cross)
        return self._replace(pairs=self._own_pairs.plus(rows), prior=rows)


def _quadratic(moments: Moments, weight: float, penalty: np.ndarray, coef: np.ndarray) -> float:
    """Weighted squares of a regression and of its coefficients, less a constant."""
    return float(weight * coef @ (moments.gram @ coef - 2.0 * moments.cross) + penalty @ coef**2)


class RecursiveMultiStep:
    """The fit as later rows become known: re-fitted once a day; row ``begin`` is the first after the training."""

    def __init__(self, fit: MultiStepFit, begin: int, n_steps: int = _STEPS_PER_DAY) -> None:
        self._fit, self._coef, self._done, self._n_steps = fit, fit.coef, begin - 1, n_steps
        self._begin = max(begin - 1, 0)
        self._known = fit.moments.plus(fit.pairs, fit.one_step)
        p = len(fit.coef)
        self._history = Moments(np.zeros((p, p)), np.zeros(p))

    def advance(self, view: ARXData, row: int) -> None:
        """Re-fit at the end of each day up to ``row``."""
        per_day = self._fit.problem.per_day
        while self._done + per_day <= row:
            self._learn(view, self._done + per_day)

    def _learn(self, view: ARXData, mark: int) -> None:
        """Add the errors that became known by row ``mark``."""
        problem, fit = self._fit.problem, self._fit
        fade = 0.5 ** (1.0 / _HALF_LIFE_DAYS)
        self._history = Moments(fade * self._history.gram, fade * self._history.cross)
        earliest = max(self._begin, self._done - int(problem.leads[-1]))
        earliest += -(earliest - self._begin) % problem.every
        targets = problem.targets(view, problem.origins(earliest, mark), (self._done, mark))
        pairs = Moments.of(problem.design.pairs(view, max(self._done, 0), mark))
        penalty, known = problem.penalty(fit.penalties), self._known.plus(self._history)

        def tried(at: np.ndarray) -> tuple[LeadForecasts, float]:
            made = problem.forecasts(view, at, targets)
            new = made.squares + _quadratic(pairs, fit.one_step, 0.0 * penalty, at)
            return made, _HISTORY_WEIGHT * new + _quadratic(known, 1.0, penalty, at)

        made, best = tried(self._coef)
        self._done = mark
        for _ in range(self._n_steps):
            new = problem.moments(view, made).plus(pairs, fit.one_step)
            if not np.isfinite(new.cross).all():  # inputs far beyond training: such a day teaches nothing
                return
            trial = known.plus(new, _HISTORY_WEIGHT).solution(penalty)
            made, reached = tried(trial)
            if reached >= best:
                break
            self._coef, best = trial, reached
        self._history = self._history.plus(new, _HISTORY_WEIGHT)

    def coef(self) -> np.ndarray:
        """Coefficients (n_columns,) of the last re-fit."""
        return self._coef


def fit_multi_step(
    design: ARXDesign,
    table: ZoneTable,
    view: ARXData,
    n_leads: int,
    penalties: Penalties | float | None,
    refits: bool,
    prior: ARXPrior | None = None,
) -> MultiStepFit:
    """Fit on errors at leads up to ``n_leads`` rows, with the penalties that forecast the last third best.

    ``penalties`` may be given, or ``alpha`` alone; a ``prior`` takes their place.
    """
    problem, pairs = MultiStepProblem.of_training(design, table, n_leads), design.pairs(view)
    if prior is not None:
        fit = _under_prior(problem, table.step, view, pairs, prior)
    else:
        if not isinstance(penalties, Penalties):
            penalties = _choose_penalties(problem, view, pairs, n_leads, penalties, refits)
        fit = _one_step_start(problem, view, pairs, view.end).improved(view, view.end - 1, penalties)
    noise = _training_squares(fit, view, pairs) / problem.unit / max(len(pairs.d), 1)
    return fit._replace(noise=noise)


def _choose_penalties(
    problem: MultiStepProblem, view: ARXData, pairs: Pairs, n_leads: int, alpha: float | None, refits: bool
) -> Penalties:
    """The penalties that forecast the last third best, the usual ones for a short table; ``alpha`` may be given."""
    best = _USUAL if alpha is None else _USUAL._replace(alpha=float(alpha))
    split = (2 * view.end) // 3
    if view.end - split <= n_leads:  # no forecast from the last third ends within it
        return best
    first = _one_step_start(problem, view, pairs.between(0, split - 1), split).improved(view, split - 1, best)
    least = _later_squares(first, view, split, n_leads, refits)
    for name, values in _CHOICES.items():
        if name == "alpha" and alpha is not None:
            continue
        for value in values:
            penalties = best._replace(**{name: value})
            squares = _later_squares(first.improved(view, split - 1, penalties, 1), view, split, n_leads, refits)
            if squares < least:
                best, least = penalties, squares
    return best


def _under_prior(
    problem: MultiStepProblem, step: pd.Timedelta, view: ARXData, pairs: Pairs, prior: ARXPrior
) -> MultiStepFit:
    """The fit under a prior, whose size and strength are found from the errors by its mean, and again by the fit."""
    penalties = Penalties(0.0, 0.0, _USUAL.one_step)
    made = problem.training_forecasts(view, prior.usual(problem.design), view.end)
    ratio = made.squares / max(pairs.squares(made.coef), 1e-12)
    fit = MultiStepFit(problem, made.coef, problem.moments(view, made), Moments.of(pairs), penalties, ratio)
    for n_steps in (2, _STEPS):
        fit = fit.under(prior, step, _training_squares(fit, view, pairs), len(pairs.d))
        fit = fit.improved(view, view.end - 1, penalties, n_steps)
    return fit


def _training_squares(fit: MultiStepFit, view: ARXData, pairs: Pairs) -> float:
    """Weighted squared errors of a fit on its training rows, at all leads and of one step."""
    return fit.problem.training_forecasts(view, fit.coef, view.end).squares + fit.one_step * pairs.squares(fit.coef)


def _one_step_start(problem: MultiStepProblem, view: ARXData, pairs: Pairs, end: int) -> MultiStepFit:
    """The one-step solution of the rows before ``end``, whose ``pairs`` are given."""
    sums = Moments.of(pairs)
    made = problem.training_forecasts(view, sums.solution(problem.penalty(_USUAL)), end)
    one_step = pairs.squares(made.coef)
    ratio = made.squares / one_step if one_step > 0.0 else 1.0
    return MultiStepFit(problem, made.coef, problem.moments(view, made), sums, _USUAL, ratio)


def _later_squares(fit: MultiStepFit, view: ARXData, begin: int, n_leads: int, refits: bool) -> float:
    """Squared errors of forecasts from row ``begin`` on by a fit on the rows before it."""
    origins = np.arange(begin, view.end - n_leads, max(1, fit.problem.per_day // _ORIGINS_PER_DAY))
    coefs = fit.coef[None, :]
    if refits:
        recursive = RecursiveMultiStep(fit, begin, _STEPS_PER_DAY // fit.problem.stride)
        coefs = coefs_at(recursive, view, origins)
    paths = fit.problem.design.iterate(view, origins, n_leads, coefs)
    return float(np.nansum((paths - view.T[target_rows(origins, n_leads) - view.first]) ** 2))
