"""Online updating: coefficients re-solved at each origin, network refitted now and then, errors recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from .._shallow import shallow_copy
from .._time import rows_in, rows_per_day, rows_per_hour
from ..filtering import ForecastSample
from .constrained_ridge import gram
from .fit import LeadFit, with_expected_heat
from .lead_problem import ScoredForecasts, minimise
from .online_network import HALF_LIVES, HISTORY_WEIGHT, CompletedForecasts, OnlineNetwork, OriginState
from .segment import NumberedSegment
from .step_gain import GainPull

_REFIT_DAYS = 10  # days between refits of the network; in a young log as many as it has
#: days of rows that a refit sees, its Gauss-Newton steps, and hours between the origins that it scores
_WINDOW_DAYS, _STEPS, _ORIGIN_HOURS = 56, 2, 4
_ROOM = 8  # forecasts for which a copy has room at first
_PIECE_DAYS = 7  # days of rows that a refitted network goes through at once, which bounds the memory


class ErrorHistory:
    """Errors of successive forecasts at some leads, in ``n_kinds`` ways each; NaN until they are known."""

    def __init__(self, n_leads: int, n_kinds: int) -> None:
        self._buffer = np.empty((0, n_leads, n_kinds))
        self.first = 0  # number of the first forecast that is kept
        self.n = 0  # forecasts so far

    @property
    def values(self) -> np.ndarray:
        """(n - first, n_leads, n_kinds), to be read and written."""
        return self._buffer[: self.n - self.first]

    def extend(self, n: int) -> None:
        """Make room for ``n`` forecasts in all."""
        kept = n - self.first
        if kept > len(self._buffer):
            buffer = np.full((2 * kept, *self._buffer.shape[1:]), np.nan)
            buffer[: len(self.values)] = self.values
            self._buffer = buffer
        self.n = max(n, self.n)

    def fork(self, first: int) -> Self:
        """A copy that goes on by itself, and keeps the forecasts from one on."""
        made = shallow_copy(self)
        made.first = min(max(first, self.first), self.n)
        kept = self.values[made.first - self.first :]
        made._buffer = np.full((len(kept) + _ROOM, *kept.shape[1:]), np.nan)
        made.values[:] = kept
        return made


def _refit_network(fit: LeadFit, psi: np.ndarray, rows: NumberedSegment, end: int) -> OnlineNetwork:
    """Refit from ``psi`` (p,) on the last weeks before row ``end``, and take the network through all rows so far."""
    network = OnlineNetwork(fit, _refit_psi(fit, psi, rows, end), rows.begin)
    training, first = None, rows.begin
    half = fit.problem.scored.every(2)
    if rows.joined:  # the training rows are the first of these rows
        first = fit.segment.n_rows
        training = network.respond(rows.between(0, first), half.sample.origins)
    network.start_memories(gram(fit.problem.design(network.psi, half, training)) + fit.problem.pull_gram(network.psi))
    per_day, spacing = rows_per_day(fit.model.step), _ORIGIN_HOURS * rows_per_hour(fit.model.step)
    for piece in range(first, end, _PIECE_DAYS * per_day):
        until = min(piece + _PIECE_DAYS * per_day, end)
        origins = _origins_between(piece, until, rows.begin, spacing)
        network.learn(network.advance(rows.between(piece, until), piece, origins, spacing), until - 1)
    return network


def _origins_between(first: int, end: int, begin: int, spacing: int) -> np.ndarray:
    """Origins in [first, end) that are ``spacing`` rows apart, counted from ``begin``; none is before ``begin``."""
    first = max(first, begin)
    return np.arange(first + (begin - first) % spacing, end, spacing)


def _refit_psi(fit: LeadFit, psi: np.ndarray, rows: NumberedSegment, end: int) -> np.ndarray:
    """Nonlinear parameters (p,) of the last weeks."""
    per_day, leads = rows_per_day(fit.model.step), fit.sample.leads
    first = max(0, end - _WINDOW_DAYS * per_day - per_day)
    warmup = per_day if rows.joined or first else 0  # from a day on, as in training
    origins = np.arange(warmup, end - 1 - first, rows_in(_ORIGIN_HOURS, fit.model.step))
    weight = np.where(origins + first >= rows.begin, HISTORY_WEIGHT, 1.0)
    window = rows.between(first, end)
    forecasts = [ScoredForecasts(window, ForecastSample(origins, leads), weight)]
    if not rows.joined:
        forecasts.append(fit.problem.scored.every(2))
    pull = fit.problem.pull
    if pull is not None:
        forecasts = [with_expected_heat(scored, fit.model.step) for scored in forecasts]
    if pull is not None and (seen := GainPull.of(window, fit.model.step)).observed:
        # what the training says of the response lasts
        pull = seen._replace(shape=pull.shape) if pull.observed else seen
    problem = replace(fit.problem, forecasts=tuple(forecasts), pull=pull)
    return minimise(problem, problem.evaluate(psi), max_steps=_STEPS).psi


class RollingNetwork:
    """A fitted model that goes through rows, of which ``row`` is the next, learns from them and forecasts.

    ``begin`` as of :class:`NumberedSegment`.  ``adapt``: None learns nothing, "linear" re-solves the coefficients,
    "full" refits the network too.  ``every`` rows (an hour, or one) lie between recorded forecasts.
    """

    def __init__(self, fit: LeadFit, begin: int, adapt: str | None) -> None:
        self.fit, self.begin, self.adapt = fit, begin, adapt
        self.every = rows_per_hour(fit.model.step)
        self.row = 0
        self._per_day = rows_per_day(fit.model.step)
        self._longest = int(fit.sample.leads[-1])
        self._errors = ErrorHistory(len(fit.sample.leads), len(HALF_LIVES))
        self._network = OnlineNetwork(fit, fit.psi, begin)
        self._since = begin  # first origin whose errors are the network's own
        # the network before a refit goes on until its last forecasts have ended
        self._previous: OnlineNetwork | None = None
        self._previous_since = begin
        self._morning_coefs: dict[int, np.ndarray] = {}  # day -> (K, J)

    @property
    def psi(self) -> np.ndarray:
        """(p,) as last fitted."""
        return self._network.psi

    @property
    def errors(self) -> np.ndarray:
        """(n, L, K) errors [K] of each memory's forecasts from ``begin``, ``begin + every``, ..., NaN where unknown.

        Only with adaptation; by the coefficients that were known at the start of the forecast's day.
        """
        return self._errors.values

    def fork(self, first: int) -> Self:
        """A copy that goes on by itself, and keeps the errors of forecasts from number ``first`` on."""
        made = shallow_copy(self)
        made._errors, made._network = self._errors.fork(first), self._network.fork()
        made._previous = None if self._previous is None else self._previous.fork()
        made._morning_coefs = dict(self._morning_coefs)
        return made

    def refits(self, origin: int) -> list[int]:
        """Rows to come, up to ``origin``, at which it is refitted."""
        if self.adapt != "full":
            return []
        n_trained = max(1, round(self.fit.segment.n_rows / self._per_day))
        day, last, rows = 0, (origin - self.begin) // self._per_day, []
        while (day := day + min(_REFIT_DAYS, n_trained + day)) <= last:
            rows.append(self.begin + day * self._per_day)
        return [row for row in rows if row >= self.row]

    def advance(self, rows: NumberedSegment, origin: int) -> None:
        """Go through the rows up to ``origin``, that one included."""
        while self.row <= origin:
            if self.adapt is None:
                self._take(rows, origin)
                continue
            day = max(0, -(-(self.row - self.begin) // self._per_day))
            morning = self.begin + day * self._per_day
            is_due = morning in self.refits(morning)
            self._take(rows, min(origin, morning))
            if self.row == morning + 1:
                self._begin_day(rows, day, is_due)

    def _begin_day(self, rows: NumberedSegment, day: int, is_due: bool) -> None:
        """Refit where it is due, and keep the coefficients that the day's forecasts are judged by."""
        if is_due:
            self._previous, self._previous_since = self._network, self._since
            self._network, self._since = _refit_network(self.fit, self._network.psi, rows, self.row), self.row - 1
        oldest = day - 1 - self._longest // self._per_day
        self._morning_coefs = {d: coefs for d, coefs in self._morning_coefs.items() if d >= oldest}
        self._morning_coefs[day] = self._network.coefs()

    def _take(self, rows: NumberedSegment, last: int) -> None:
        """Go through the rows up to ``last``."""
        segment, first = rows.between(self.row, last + 1), self.row
        none = np.empty(0, dtype=np.int64)
        origins = none if self.adapt is None else _origins_between(first, last + 1, self.begin, self.every)
        self._errors.extend(self._errors.n + len(origins))
        completed = self._network.advance(segment, first, origins, self.every)
        if self.adapt is not None:
            self._record_errors(completed, completed.origin >= self._since)
            self._network.learn(completed, last)
        if self._previous is not None:
            completed = self._previous.advance(segment, first, none, self.every)
            own = (completed.origin >= self._previous_since) & (completed.origin < self._since)
            self._record_errors(completed, own)
            if last >= self._since + self._longest:
                self._previous = None
        self.row = last + 1

    def _record_errors(self, completed: CompletedForecasts, own: np.ndarray) -> None:
        """Record the errors of a network's ``own`` (k,) forecasts, by the coefficients of their mornings."""
        day = (completed.origin - self.begin) // self._per_day
        for d in np.unique(day[own]):
            of_day = own & (day == d)
            columns = completed.columns[of_day]
            e = (columns[:, [-1]] - columns[:, :-1] @ self._morning_coefs[d].T) / completed.root[of_day, None]
            place = (completed.origin[of_day] - self.begin) // self.every - self._errors.first
            self.errors[place, completed.lead[of_day]] = e

    def coefs(self) -> np.ndarray:
        """(K, J) coefficients of each memory, as known at the last row."""
        if self.adapt is None:
            return np.tile(self.fit.coef, (len(HALF_LIVES), 1))
        return self._network.coefs()

    def state(self, memory: int = 0) -> OriginState:
        """State at the last row, by one memory."""
        return self._network.state(self.fit.coef if self.adapt is None else self._network.coef(memory))

    def forecast_state(self, memory: int) -> OriginState:
        """The state from which a forecast by one memory starts."""
        return self.state(memory)._replace(emitter=self._network.emitted)

    def heat_now(self, rows: NumberedSegment) -> float:
        """Unmeasured heat over the last row's step [kW]."""
        state, last = self.state(), rows.between(self.row - 1, self.row)
        return float(last.channels.scheduled_heat(state.coef)[0]) + state.gain

    def forecast(self, rows: NumberedSegment, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(K, n_leads) deviations from the reference [K] and unmeasured heat [kW] after the last row; inputs hold."""
        origin = self.row - 1
        last = min(origin + n_leads, rows.first + rows.segment.n_rows - 1)
        ahead = rows.between(min(origin + 1, last), last + 1)
        return self._network.forecast(ahead, last - origin, self.coefs(), n_leads)
