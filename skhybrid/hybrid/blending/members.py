"""Members of the blend: models that forecast new rows, learn from them, and record their own errors."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol, Self

import numpy as np
import pandas as pd

from ..._shallow import shallow_copy
from ..._table import ZoneTable
from ..._time import rows_per_day, rows_per_hour
from ...control import Plan, gain_of
from ...filtering import ForecastSample
from ...forecasting import ARXRegressor
from ...forecasting.arx import ARXData
from ...schedule import (
    ErrorHistory,
    LeadFit,
    NetworkPrior,
    NumberedSegment,
    RollingNetwork,
    fit_leads,
    plant_gain,
    step_gain,
)
from ...thermal import RCNetwork
from .daily_profile import MeanDay, ProfileRows
from .numbered_table import NumberedTable

_SMALL = 1e-3  # step by which a linear model is tried [kW], so small that nothing is clipped
_RETURN = pd.Timedelta("12h")  # after which 1/e of the deviation from the mean day is left


class RollingMember(Protocol):
    """A member that goes through rows: it learns from them, forecasts, and records its errors."""

    @property
    def errors(self) -> np.ndarray:
        """Errors (n, L, k) [K] of hourly forecasts by what was known at the start of the origin's day, in k ways.

        From the first new row on, NaN where unknown; only with adaptation.
        """

    def fork(self, first: int) -> Self:
        """A copy that goes on by itself, and keeps the errors of forecasts from number ``first`` on."""

    def advance(self, view: Any, origin: int) -> None:
        """Go through the rows up to and including ``origin``."""

    def solve(self) -> None:
        """Compute the coefficients now, and not when they are first read."""

    def forecast(self, view: Any, n_leads: int, clipped: bool = True) -> tuple[np.ndarray, np.ndarray | None]:
        """From the last row: (k, n_leads) temperatures [degC], and unmeasured heat [kW]; None where it knows none.

        Not ``clipped``: without limits of its own.
        """

    def gain(self, plan: Plan) -> np.ndarray:
        """(k, H, H, m) gain by a plan [K per kW or stage] of a forecast that is not clipped."""


class Member(Protocol):
    """One model of a blend, which may forecast in several ways."""

    names: tuple[str, ...]  # of its ways to forecast
    is_rule: bool  # whether it is a simple rule, which learns next to nothing
    needs_days: bool  # whether it forecasts badly after a day of training

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        """Learn from a training table, whose history ``T_za`` is the target."""

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        """(O, L) errors [K] of training forecasts, each by a fit without its block of days, alike in all the ways."""

    def step_gain(self, training: ZoneTable, plant: tuple[str, float], n_leads: int) -> np.ndarray:
        """(n_leads,) temperature after a step of 1 kW of a plant, given with its capacity [kW] [K/kW]."""

    def view(self, rows: NumberedTable) -> Any:
        """Rows as the member takes them."""

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingMember:
        """Begin at the first row; errors are wanted at the leads of ``sample``."""


class ScheduleMember:
    """A network with schedules, fitted on the errors of forecasts at all leads; ``known`` capacities in kW.

    With the ``purpose`` "plan" its response to a kW is pulled toward what jumps of the heat say of it.
    """

    names: tuple[str, ...] = ("network", "network, short memory")
    is_rule = False
    fit_: LeadFit

    def __init__(self, network: RCNetwork, known: dict[str, float], purpose: str, prior: NetworkPrior | None) -> None:
        self.network, self.known, self.purpose, self._prior = network, known, purpose, prior
        self.needs_days = prior is None

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        T = training.history["T_za"]
        given = self.known, self.purpose, self._prior
        self.fit_ = fit_leads(self.network, training, T, n_leads, *given)
        return self

    def __getstate__(self) -> dict[str, Any]:
        # the series of the training rows, which are large, are computed again from the rows
        return {**self.__dict__, "fit_": self.fit_.without_rows()}

    def restore(self, training: ZoneTable) -> None:
        """Compute the series of the training rows after the state was loaded."""
        self.fit_ = self.fit_.with_rows(self.fit_.make_segment(training, training.history["T_za"]))

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        return self.fit_.left_out

    def step_gain(self, training: ZoneTable, plant: tuple[str, float], n_leads: int) -> np.ndarray:
        return step_gain(self.fit_, n_leads)

    def view(self, rows: NumberedTable) -> NumberedSegment:
        segment, whole = self.fit_.make_segment(rows.table, rows.T), rows.whole
        whole_segment = None if whole is None else cache(lambda: self.fit_.make_segment(*whole()))
        return NumberedSegment(segment, rows.begin, rows.joined, rows.first, whole_segment)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingSchedule:
        """Coefficients re-solved at every origin; with ``adapt="full"`` the network refitted too."""
        return RollingSchedule(self.fit_, rows.begin, adapt)


class RollingSchedule(RollingNetwork):
    """The network as it goes through rows, in degC."""

    def solve(self) -> None:
        self.coefs()

    def forecast(self, view: NumberedSegment, n_leads: int, clipped: bool = True) -> tuple[np.ndarray, np.ndarray]:
        path, heat = super().forecast(view, n_leads)
        return path + self.fit.reference, heat

    def path(self, view: NumberedSegment, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(n_leads,) temperatures [degC] and unmeasured heat [kW] by the long memory."""
        if not n_leads:
            return np.empty(0), np.empty(0)
        paths, heats = self.forecast(view, n_leads)
        return paths[0], heats[0]

    def gain(self, plan: Plan) -> np.ndarray:
        states = [self.forecast_state(memory) for memory in range(len(self.coefs()))]
        return np.stack([plant_gain(self.fit, state, plan.inputs, plan.values) for state in states])


class ARXMember:
    """ARX on all inputs and the last ``n_lags`` temperatures, fitted on errors of one step or at all leads."""

    names: tuple[str, ...] = ("ARX",)
    is_rule, needs_days = False, False

    def __init__(
        self, n_lags: int, *, multi_step: bool = False, like: ARXRegressor | None = None, prior: Any = None
    ) -> None:
        self.n_lags, self.multi_step, self._like, self._prior = n_lags, multi_step, like, prior
        if multi_step:
            self.names = ("multi-step ARX",)

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        horizon, prior = n_leads * training.step, self._prior
        self.arx_ = ARXRegressor(horizon=horizon, n_lags=self.n_lags, max_missing=1.0, prior=prior, intervals=False)
        if self.multi_step:
            self.arx_.set_params(objective="multi_step", adapt="refit")
        self.arx_.fit(training.replace(history={}), training.history["T_za"], self._like)
        self._like = None
        return self

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        T, n_leads = training.history["T_za"], int(sample.leads[-1])
        paths = self.arx_.left_out_paths(training, T, sample.origins, n_leads, blocks)
        return _errors(T, sample, paths[:, sample.leads - 1])

    def step_gain(self, training: ZoneTable, plant: tuple[str, float], n_leads: int) -> np.ndarray:
        role, capacity = plant
        rows = training.rows(slice(-(n_leads + 2 * self.n_lags), None))
        origin, T = max(rows.n_rows - n_leads, 0), rows.history["T_za"]
        step = _SMALL / capacity * (np.arange(rows.n_rows) >= origin)
        more = rows.replace(inputs={**rows.inputs, role: rows.inputs[role] + step})
        design, coefs = self.arx_.design_, self.arx_.coef_[None]
        before, after = (
            design.iterate(design.view(table, T), np.array([origin]), n_leads, coefs)[0] for table in (rows, more)
        )
        return (after - before) / _SMALL

    def view(self, rows: NumberedTable) -> ARXData:
        return self.arx_.design_.view(rows.table, rows.T, rows.first, rows.before)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingARX:
        return RollingARX(self.arx_, rows.begin, sample.leads, adapt)


def _errors(T: np.ndarray, sample: ForecastSample, paths: np.ndarray) -> np.ndarray:
    """(O, L) errors [K] of the forecasts of a sample, NaN where not measured."""
    rows, inside = sample.targets(len(T))
    return np.where(inside, T[rows] - paths, np.nan)


class _RollingErrors:
    """Base of members that record the errors of hourly forecasts from row ``begin`` on at ``leads`` (L,)."""

    def __init__(self, begin: int, leads: np.ndarray, adapt: str | None, every: int) -> None:
        self.begin, self.leads, self.adapt, self._every = begin, leads, adapt, every
        self._row = -1
        self._errors = ErrorHistory(len(leads), 1)

    @property
    def errors(self) -> np.ndarray:
        """(n, L, 1) errors of forecasts of the history [K]."""
        return self._errors.values

    def fork(self, first: int) -> Self:
        made = shallow_copy(self)
        made._errors = self._errors.fork(first)
        return made

    def advance(self, view: Any, origin: int) -> None:
        """Go through the rows up to ``origin``; where anything is adapted, learn and record the errors known since."""
        before, self._row = self._row, origin
        if self.adapt is None or origin < self.begin:
            return
        self._learn(view, origin)
        self._errors.extend((origin - self.begin) // self._every + 1)
        # forecasts that had not ended at the row before
        place = np.arange(max(0, (before - int(self.leads[-1]) - self.begin) // self._every), self._errors.n)
        ends = self.begin + place[:, None] * self._every + self.leads
        known = (ends > before) & (ends <= origin)
        some = known.any(axis=1)
        if not some.any():
            return
        place, ends, known = place[some], ends[some], known[some]
        paths = self._past_paths(view, self.begin + place * self._every)
        place -= self._errors.first
        errors = self.errors[place, :, 0]
        self.errors[place, :, 0] = np.where(known, view.T[np.minimum(ends, origin) - view.first] - paths, errors)

    def _learn(self, view: Any, origin: int) -> None:
        """Learn from the rows up to ``origin``."""

    def solve(self) -> None:
        """Do nothing: only members with coefficients have some to compute."""

    def _past_paths(self, view: Any, origins: np.ndarray) -> np.ndarray:
        """(O, L) forecasts of the history by what was known at the start of each origin's day [degC]."""
        raise NotImplementedError


class RollingARX(_RollingErrors):
    """A fitted regression that goes through rows, re-solved at every origin on all pairs known by then."""

    def __init__(self, arx: ARXRegressor, begin: int, leads: np.ndarray, adapt: str | None) -> None:
        super().__init__(begin, leads, adapt, rows_per_hour(arx.sampling_time_))
        self.arx, self._per_day = arx, rows_per_day(arx.sampling_time_)
        self._recursive = arx.recursive(begin)
        self._coefs: list[np.ndarray] = []  # of the days so far

    def fork(self, first: int) -> Self:
        made = super().fork(first)
        made._recursive, made._coefs = shallow_copy(self._recursive), list(self._coefs)
        return made

    def _learn(self, view: ARXData, origin: int) -> None:
        while (mark := self.begin + len(self._coefs) * self._per_day) <= origin:
            self._recursive.advance(view, mark)
            self._coefs.append(self._recursive.coef())
        self._recursive.advance(view, origin)

    def solve(self) -> None:
        _ = self._coef

    def _past_paths(self, view: ARXData, origins: np.ndarray) -> np.ndarray:
        day = (origins - self.begin) // self._per_day
        paths = np.empty((len(origins), len(self.leads)))
        for d in np.unique(day):
            own = day == d
            coef = self._coefs[d][None, :]
            paths[own] = self.arx.design_.iterate(view, origins[own], int(self.leads[-1]), coef)[:, self.leads - 1]
        return paths

    def forecast(self, view: ARXData, n_leads: int, clipped: bool = True) -> tuple[np.ndarray, None]:
        origin, coefs = np.array([self._row]), self._coef[None, :]
        return self.arx.design_.iterate(view, origin, n_leads, coefs, clipped=clipped), None

    @property
    def _coef(self) -> np.ndarray:
        """(n_columns,) as known at the last row."""
        return self.arx.coef_ if self.adapt is None else self._recursive.coef()

    def gain(self, plan: Plan) -> np.ndarray:
        responses = [self.arx.design_.input_response(role, self._coef, len(plan.values)) for role in plan.inputs]
        return gain_of(np.column_stack(responses))[None]


class DailyProfileMember:
    """The mean day so far, to which the temperature returns: a rule that is hard to beat after a short training."""

    names: tuple[str, ...] = ("daily profile",)
    is_rule, needs_days = True, False

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        self.every = rows_per_hour(training.step)
        self._rate = float(training.step / _RETURN)
        _, self._mean_day = self._after(training)
        self._mean_day.forget(0)
        return self

    def _after(self, training: ZoneTable) -> tuple[ProfileRows, MeanDay]:
        """The rows of a training, and the mean day as it was known at each of them."""
        T = training.history["T_za"]
        rows, known = ProfileRows.of(training, T), T[np.isfinite(T)]
        mean = float(known.mean()) if len(known) else 0.0
        mean_day = MeanDay(rows_per_day(training.step), mean, int(rows.place[0]))
        mean_day.extend(rows, 0, training.n_rows)
        return rows, mean_day

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        rows, mean_day = self._after(training)
        return _errors(rows.T, sample, self.paths(rows, mean_day, sample.origins, sample.leads))

    def step_gain(self, training: ZoneTable, plant: tuple[str, float], n_leads: int) -> np.ndarray:
        return np.zeros(n_leads)

    def view(self, rows: NumberedTable) -> ProfileRows:
        return ProfileRows.of(rows.table, rows.T, rows.first)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingProfile:
        before = self.view(rows).place[max(rows.begin - 1, 0)] + (rows.begin > 0)
        return RollingProfile(self, self._mean_day.starting_at(int(before)), rows.begin, sample.leads, adapt)

    def paths(self, rows: ProfileRows, mean_day: MeanDay, origins: np.ndarray, leads: np.ndarray) -> np.ndarray:
        """(O, L) temperatures [degC]: the mean of the days known at each origin, and what is left of the last error."""
        at = origins - rows.first
        seen, targets = rows.seen[at][:, None], at[:, None] + leads
        known = rows.place[at][:, None]
        usual = mean_day.at(rows, np.minimum(targets, len(rows.T) - 1), known)
        missed = np.where(seen >= 0, rows.T[seen] - mean_day.at(rows, seen, known - 1), 0.0)  # by the days before
        return usual + missed * np.exp(-self._rate * (targets - seen))


class RollingProfile(_RollingErrors):
    """The rule as it goes through rows; it knows the days so far, whether or not anything is adapted."""

    def __init__(
        self, rule: DailyProfileMember, mean_day: MeanDay, begin: int, leads: np.ndarray, adapt: str | None
    ) -> None:
        super().__init__(begin, leads, adapt, rule.every)
        self._rule, self._mean_day, self._row = rule, mean_day, begin - 1

    def fork(self, first: int) -> Self:
        made = super().fork(first)
        made._mean_day = shallow_copy(self._mean_day)
        return made

    def advance(self, view: ProfileRows, origin: int) -> None:
        self._mean_day.extend(view, self._row + 1, origin + 1)
        super().advance(view, origin)
        self._mean_day.forget(int(self.leads[-1]))

    def _past_paths(self, view: ProfileRows, origins: np.ndarray) -> np.ndarray:
        return self._rule.paths(view, self._mean_day, origins, self.leads)

    def forecast(self, view: ProfileRows, n_leads: int, clipped: bool = True) -> tuple[np.ndarray, None]:
        return self._rule.paths(view, self._mean_day, np.array([self._row]), np.arange(1, n_leads + 1)), None

    def gain(self, plan: Plan) -> np.ndarray:
        (n, m) = plan.values.shape
        return np.zeros((1, n, n, m))
