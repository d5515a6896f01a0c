"""Forecasts of later rows, with what the rows up to each origin teach: coefficients re-solved, network re-fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..filtering import ForecastSample, lead_errors, lead_rows, simulate_path
from .channels import emitter_series
from .constrained_ridge import gram, solve_coefficients
from .filter_model import Matrices
from .fit import LeadFit
from .lead_problem import LeadProblem, Part, minimise
from .responses import ResponseFilter, Segment

#: how much a completed forecast of the history counts beside one of the training
_RECENT = 3.0
#: days between re-fits of the network, days that such a re-fit sees, its steps, and hours between what it scores
_REFIT_DAYS, _WINDOW_DAYS, _STEPS, _REFIT_EVERY = 10, 56, 2, 4
#: days after which what was learned counts half: in a long memory, and in a short one that leaves a change behind soon
HALF_LIVES = (30.0, 7.0)
#: days that are gone through at once behind a re-fit, which bounds the memory
_PIECE_DAYS = 7
_DAY = 24.0


class NumberedSegment(NamedTuple):
    """Rows behind the training: as one segment with it, or by themselves."""

    segment: Segment
    begin: int  # the first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own
    first: int = 0  # the segment's first row, where it holds the last ones only
    whole: Callable[[], Segment] | None = None  # all rows from 0 on, where the segment does not hold them

    @property
    def end(self) -> int:
        """The row behind the last one."""
        return self.first + self.segment.n_rows

    def between(self, begin: int, end: int) -> Segment:
        """Rows from ``begin`` on, before ``end``."""
        if begin >= self.first:
            return self.segment.between(begin - self.first, end - self.first)
        assert self.whole is not None
        return self.whole().between(begin, end)


class OriginState(NamedTuple):
    """What a network knows at an origin."""

    psi: np.ndarray
    matrices: Matrices
    coef: np.ndarray
    nodes: np.ndarray  # (n,) temperatures [K from the reference], the origin's own row not yet applied
    tracked: float  # heat that the filter tracks [kW]
    store: float  # what the emitter holds back, before the origin's own row [kW]


class _CompletedForecasts(NamedTuple):
    """Forecasts of the history that have come to their ends."""

    columns: np.ndarray  # (k, J + 1), weighted
    root: np.ndarray  # (k,) root weights
    origin: np.ndarray  # (k,) rows
    lead: np.ndarray  # (k,) places among the leads
    age: np.ndarray  # (k,) rows since their ends


class _FadingProducts:
    """What completed forecasts teach the coefficients, fading with time."""

    def __init__(self, products: np.ndarray, row: int, half_life: float) -> None:
        self._products, self._row, self._half_life = products, row, half_life  # rows
        self._coef: np.ndarray | None = None

    def learn(self, columns: np.ndarray, age: np.ndarray, row: int) -> None:
        """Take in forecasts that ended so many rows before ``row``; what was known before fades."""
        faded = 0.5 ** (0.5 * age / self._half_life)
        fade = 0.5 ** (max(row - self._row, 0) / self._half_life)
        self._products = self._products * fade + gram(columns * faded[:, None])
        self._row, self._coef = max(row, self._row), None

    def coef(self, problem: LeadProblem) -> np.ndarray:
        """(J,) by what has been learned."""
        if self._coef is None:
            self._coef = solve_coefficients(self._products, problem.penalty, problem.positive).coef
        return self._coef


class _NetworkPass:
    """One network on its way through the rows, and what forecasts of the history teach its coefficients."""

    def __init__(self, fit: LeadFit, psi: np.ndarray, begin: int) -> None:
        channels = fit.segment.channels
        self.fit, self.psi, self.start, self.stop = fit, psi, begin, np.iinfo(np.int64).max
        self._begin = begin
        self.stream = ResponseFilter(fit.model, psi, fit.segment.plan, channels.node)
        M = self.stream.matrices
        self._rows, _ = lead_rows(M.F, M.dF[..., :0], fit.model.zone, fit.sample.leads)
        m, J = self.stream.held.shape
        self.remember(fit.gram)
        self._first, self._series, self._seen = 0, np.empty((0, J)), np.empty(0, dtype=bool)
        self._origins, self._share = np.empty(0, dtype=np.int64), np.empty(0)
        self._states = np.empty((0, m, J))

    def remember(self, products: np.ndarray) -> None:
        """Begin with the products of the training."""
        a_day, begin = round(_DAY / self.fit.model.step), self._begin
        self.memories = [_FadingProducts(products, begin, days * a_day) for days in HALF_LIVES]

    def go(self, segment: Segment, first: int, origins: np.ndarray, apart: float) -> _CompletedForecasts:
        """Go through the next rows; forecasts from the origins, which are ``apart`` rows from one another, begin."""
        found = self.stream.run(segment, origins - first)
        end, leads, problem = first + segment.n_rows, self.fit.sample.leads, self.fit.problem
        if not len(self._origins):
            self._first, self._series, self._seen = first, found.series, segment.seen
        else:
            self._series = np.concatenate([self._series, found.series])
            self._seen = np.concatenate([self._seen, segment.seen])
        self._origins = np.concatenate([self._origins, origins])
        self._states = np.concatenate([self._states, found.states])
        self._share = np.append(self._share, np.full(len(origins), _RECENT * problem.share(apart)))
        ends = self._origins[:, None] + leads
        known = (ends >= first) & (ends < end)
        known &= self._seen[np.minimum(ends, end - 1) - self._first]
        root = problem.roots(known, self._share)
        E = lead_errors(self._series, self._states, self._rows, self._origins - self._first, leads, root)
        place, lead = np.nonzero(root)
        age = end - 1 - ends[place, lead]
        ended = _CompletedForecasts(E[root.ravel() > 0], root[place, lead], self._origins[place], lead, age)
        self._forget(end)
        return ended

    def _forget(self, end: int) -> None:
        """Keep what the forecasts that end at row ``end`` or later need."""
        open_ = self._origins + self.fit.sample.leads[-1] >= end
        self._origins, self._states, self._share = self._origins[open_], self._states[open_], self._share[open_]
        first = int(self._origins[0]) if len(self._origins) else end
        keep = slice(first - self._first, None)
        self._first, self._series, self._seen = first, self._series[keep], self._seen[keep]

    def learn(self, ended: _CompletedForecasts, row: int) -> None:
        """Take in forecasts that have ended by the last row."""
        for memory in self.memories:
            memory.learn(ended.columns, ended.age, row)

    def coefs(self) -> np.ndarray:
        """(K, J) by what each memory holds."""
        return np.array([memory.coef(self.fit.problem) for memory in self.memories])


class ErrorHistory:
    """Errors of one forecast after the other at some leads; NaN until they are known.

    Parameters
    ----------
    n_leads : int
    n_kinds : int
        Forecasts that are made at once, as by several memories.
    """

    def __init__(self, n_leads: int, n_kinds: int) -> None:
        self._room = np.empty((0, n_leads, n_kinds))
        self._n = 0

    @property
    def values(self) -> np.ndarray:
        """(n, n_leads, n_kinds), to be read and written."""
        return self._room[: self._n]

    def extend(self, n: int) -> None:
        """Make room for ``n`` forecasts in all."""
        if n > len(self._room):
            grown = np.full((2 * n, *self._room.shape[1:]), np.nan)
            grown[: self._n] = self.values
            self._room = grown
        self._n = max(n, self._n)


class RollingNetwork:
    """A fit that goes through later rows and forecasts from them.

    Parameters
    ----------
    fit : LeadFit
    begin : int
        The first row that the training has not seen.
    joined : bool
        Whether the rows before ``begin`` are the training's own.
    adapt : {None, "linear", "full"}

    Attributes
    ----------
    row : int
        The row that comes next.
    errors : ndarray of shape (n, L, K)
        [K] of each memory's forecasts from ``begin``, ``begin + every``, ... at the fit's leads, by the coefficients
        that were known at the start of the forecast's day; NaN where unknown, and where they have not ended.  Only
        with adaptation.
    every : int
        An hour of rows, or a row.
    """

    def __init__(self, fit: LeadFit, begin: int, joined: bool, adapt: str | None) -> None:
        self.fit, self.begin, self.joined, self.adapt = fit, begin, joined, adapt
        self.every = max(1, round(1.0 / fit.model.step))
        self.row = 0
        self._a_day = round(_DAY / fit.model.step)
        self._errors = ErrorHistory(len(fit.sample.leads), len(HALF_LIVES))
        self._run = _NetworkPass(fit, fit.point.psi, begin)
        self._before: _NetworkPass | None = None  # the network before, whose last forecasts have not ended
        self._days: dict[int, np.ndarray] = {}

    @property
    def errors(self) -> np.ndarray:
        """Errors of forecasts of the history."""
        return self._errors.values

    # -------------------------------------------------------------------------------------------------------- advance
    def advance(self, later: NumberedSegment, origin: int) -> None:
        """Go through the rows up to ``origin``, that one included."""
        while self.row <= origin:
            if self.adapt is None:
                self._take(later, origin)
                continue
            day = max(0, -(-(self.row - self.begin) // self._a_day))
            mark = self.begin + day * self._a_day
            self._take(later, min(origin, mark))
            if self.row == mark + 1:
                if self.adapt == "full" and day and day % _REFIT_DAYS == 0:
                    self._refit(later)
                self._days[day] = self._run.coefs()
                self._days = {d: coef for d, coef in self._days.items() if d >= day - 1 - self._longest // self._a_day}

    @property
    def _longest(self) -> int:
        return int(self.fit.sample.leads[-1])

    def _take(self, later: NumberedSegment, last: int) -> None:
        """Go through the rows up to ``last``."""
        segment, first = later.between(self.row, last + 1), self.row
        nothing = np.empty(0, dtype=np.int64)
        origins = nothing if self.adapt is None else self._hourly(first, last + 1, self.every)
        self._errors.extend(len(self.errors) + len(origins))
        ended = self._run.go(segment, first, origins, self.every)
        if self.adapt is not None:
            self._keep_errors(ended, self._run)
            self._run.learn(ended, last)
        if self._before is not None:
            self._keep_errors(self._before.go(segment, first, nothing, self.every), self._before)
            if last >= self._run.start + self._longest:
                self._before = None
        self.row = last + 1

    def _hourly(self, first: int, end: int, every: int) -> np.ndarray:
        """Rows of [first, end) that are so many rows apart, counted from ``begin``."""
        first = max(first, self.begin)
        return np.arange(first + (self.begin - first) % every, end, every)

    def _keep_errors(self, ended: _CompletedForecasts, run: _NetworkPass) -> None:
        """Errors of forecasts that began under a network, by the coefficients of their days."""
        day, own = (ended.origin - self.begin) // self._a_day, (ended.origin >= run.start) & (ended.origin < run.stop)
        for d in np.unique(day[own]):
            mine = own & (day == d)
            columns = ended.columns[mine]
            e = (columns[:, [-1]] - columns[:, :-1] @ self._days[d].T) / ended.root[mine, None]
            self.errors[(ended.origin[mine] - self.begin) // self.every, ended.lead[mine]] = e

    # ---------------------------------------------------------------------------------------------------------- re-fit
    def _refit(self, later: NumberedSegment) -> None:
        """Fit the network again at the last row, and take it through all rows so far."""
        mark, fit = self.row - 1, self.fit
        run = _NetworkPass(fit, self._refitted(later), self.begin)
        half = ForecastSample(fit.sample.origins[::2], fit.sample.leads)
        part, done = Part(fit.segment, half), self.begin
        if self.joined:  # the rows are the same, and so is the stream
            done = fit.segment.n_rows
            found = run.stream.run(later.between(0, done), half.origins)
            run.remember(gram(fit.problem.columns(run.psi, part, found)))
        else:
            run.remember(gram(fit.problem.columns(run.psi, part)))
        for first in range(done, mark + 1, _PIECE_DAYS * self._a_day):
            end = min(first + _PIECE_DAYS * self._a_day, mark + 1)
            origins = self._hourly(first, end, _REFIT_EVERY * self.every)
            run.learn(run.go(later.between(first, end), first, origins, _REFIT_EVERY * self.every), end - 1)
        self._run.stop = run.start = mark
        self._before, self._run = self._run, run

    def _refitted(self, later: NumberedSegment) -> np.ndarray:
        """The network's parameters from the last weeks of rows, beginning with what they were."""
        fit, end, leads = self.fit, self.row, self.fit.sample.leads
        first = max(0, end - _WINDOW_DAYS * self._a_day - self._a_day)
        warm = self._a_day if self.joined or first else 0  # from a day on, as in training
        origins = np.arange(warm, end - 1 - first, max(1, round(_REFIT_EVERY / fit.model.step)))
        weight = np.where(origins + first >= self.begin, _RECENT, 1.0)
        parts = [Part(later.between(first, end), ForecastSample(origins, leads), weight)]
        if not self.joined:
            parts.append(Part(fit.segment, ForecastSample(fit.sample.origins[::2], leads)))
        return minimise(replace(fit.problem, parts=tuple(parts)), self._run.psi, most=_STEPS).psi

    # -------------------------------------------------------------------------------------------------------- forecast
    def coefs(self) -> np.ndarray:
        """(K, J) of each memory, as known at the last row."""
        if self.adapt is None:
            return np.tile(self.fit.point.solution.coef, (len(HALF_LIVES), 1))
        return self._run.coefs()

    def state(self, memory: int = 0) -> OriginState:
        """What is known at the last row, by one memory."""
        stream, coef = self._run.stream, self.coefs()[memory]
        own, held = np.append(coef, 1.0), stream.held @ np.append(-coef, 1.0)
        # what acts over the first of all rows is not known to have acted before
        store = stream.store.held if stream.store is not None and self.row > 1 else 0.0
        return OriginState(self._run.psi, stream.matrices, coef, stream.here @ own + held[:-1], held[-1], store)

    def forecast(self, later: NumberedSegment, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """From the last row: (K, n_leads) deviations from the reference [K], and unmeasured heat [kW].

        What lies behind the rows of ``later`` is held at the last of them.
        """
        M, origin, leads = self._run.stream.matrices, self.row - 1, np.arange(1, n_leads + 1)
        last = min(origin + n_leads, later.end - 1)
        ahead = later.between(min(origin + 1, last), last + 1)
        P, _ = lead_rows(M.F, M.dF[..., :0], self.fit.model.zone, leads)
        found = [self._path(ahead, coef, leads, last - origin, P) for coef in self.coefs()]
        return np.array([path for path, _ in found]), np.array([heat for _, heat in found])

    def _path(
        self, ahead: Segment, coef: np.ndarray, leads: np.ndarray, n_ahead: int, P: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of some coefficients, over ``n_ahead`` rows that are known."""
        stream, zone, own = self._run.stream, self.fit.model.zone, np.append(coef, 1.0)
        M, held = stream.matrices, stream.held @ np.append(-coef, 1.0)
        rows = np.minimum(leads - 1, n_ahead - 1)
        if n_ahead > 0:
            path = simulate_path(M.A, _forcing(stream, ahead, coef)[:-1], stream.ahead @ own)[:, zone]
        else:  # nothing is known of what follows
            path = stream.here[[zone]] @ own
        planned = ahead.channels.scheduled_heat(coef)
        return path[rows] + P @ held, planned[rows] + held[-1] * M.F[-1, -1] ** leads


def _forcing(stream: ResponseFilter, segment: Segment, coef: np.ndarray) -> np.ndarray:
    """(N, n) what all inputs of rows that come next add to the nodes."""
    M, plan, channels = stream.matrices, segment.plan, segment.channels
    heat = channels.heat(coef[: len(channels.names)], len(M.A))
    heat[:, plan.heated] += segment.heat
    if plan.emitter:
        lag, _ = emitter_series(segment.heat, stream.model.step, np.exp(stream.psi[-1]), stream.store)
        heat[:, plan.heated] += coef[-1] * lag
    return np.hstack([segment.boundary, heat]) @ M.B.T


class Followed(NamedTuple):
    """Forecasts [K from the reference], and how wrong those of the history were."""

    paths: np.ndarray  # (n_origins, n_leads)
    heat: np.ndarray  # (n_origins, n_leads) unmeasured heat over the step of each row ahead [kW]
    errors: np.ndarray  # (O, L) [K], as :class:`RollingNetwork` has them
    learned: list[OriginState]  # at each origin


def follow(
    fit: LeadFit, later: NumberedSegment, origins: np.ndarray, n_leads: int, adapt: str | None, memory: int = 0
) -> Followed:
    """Forecast from each origin.

    Parameters
    ----------
    fit : LeadFit
    later : NumberedSegment
    origins : ndarray of int, shape (n_origins,)
        Rows, increasing.
    n_leads : int
    adapt : {None, "linear", "full"}
    memory : int
        Place in HALF_LIVES.

    Returns
    -------
    Followed
    """
    learner = RollingNetwork(fit, later.begin, later.joined, adapt)
    paths, heat = np.empty((len(origins), n_leads)), np.empty((len(origins), n_leads))
    learned = []
    for i, origin in enumerate(origins):
        learner.advance(later, int(origin))
        paths[i], heat[i] = (found[memory] for found in learner.forecast(later, n_leads))
        learned.append(learner.state(memory))
    return Followed(paths, heat, learner.errors[..., memory], learned)
