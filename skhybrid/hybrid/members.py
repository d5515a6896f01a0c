"""Members of the blend: models that forecast new rows, learn from them, and record their own errors."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable
from ..filtering import ForecastSample
from ..forecasting import ARXRegressor
from ..forecasting.arx import ARXData
from ..forecasting.features import rows_per_day, rows_per_hour
from ..schedule import ErrorHistory, LeadFit, NumberedSegment, RollingNetwork, fit_leads
from ..thermal import RCNetwork


class NumberedTable(NamedTuple):
    """Known and future rows: after the training rows as one table with them, or by themselves."""

    table: ZoneTable
    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    begin: int  # the first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own
    first: int = 0  # the table's first row, where it holds the last ones only
    whole: Callable[[], tuple[ZoneTable, np.ndarray]] | None = None  # all rows from 0 on, where it does not hold them


class RollingMember(Protocol):
    """A member that goes through rows: it learns from them, forecasts, and records its errors."""

    @property
    def errors(self) -> np.ndarray:
        """Errors (n, L, k) [K] of hourly forecasts from the first new row on, NaN where unknown; only with adaptation.

        Each of the member's k ways forecasts by what was known at the start of the origin's day.
        """

    def advance(self, view: Any, origin: int) -> None:
        """Go through the rows up to ``origin``, that one included."""

    def forecast(self, view: Any, n_leads: int) -> tuple[np.ndarray, np.ndarray | None]:
        """From the last row: (k, n_leads) temperatures [degC], and unmeasured heat [kW]; None where it knows none."""


class Member(Protocol):
    """One model of a blend, which may forecast in several ways."""

    names: tuple[str, ...]  # of its ways to forecast
    is_rule: bool  # whether it is a simple rule, which learns next to nothing

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        """Learn from a training table, whose history ``T_za`` is the target."""

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        """(O, L) errors [K] of training forecasts, each by a fit without its block of days, alike in all the ways."""

    def view(self, rows: NumberedTable) -> Any:
        """Rows as the member takes them."""

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingMember:
        """Begin at the first row; errors are wanted at the leads of ``sample``."""


class ScheduleMember:
    """A network with schedules, fitted on the errors of forecasts at all leads; ``known`` capacities in kW."""

    names: tuple[str, ...] = ("network", "network, short memory")
    is_rule = False
    fit_: LeadFit

    def __init__(self, network: RCNetwork, known: dict[str, float]) -> None:
        self.network, self.known = network, known

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        self.fit_ = fit_leads(self.network, training, training.history["T_za"], n_leads, self.known, calendar=True)
        return self

    def __getstate__(self) -> dict[str, Any]:
        """The series of the training rows, which are large, are computed again from the rows."""
        return {**self.__dict__, "fit_": self.fit_.without_rows()}

    def restore(self, training: ZoneTable) -> None:
        """Compute the series of the training rows after the state was loaded."""
        self.fit_ = self.fit_.with_rows(self.fit_.make_segment(training, training.history["T_za"]))

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        """Errors of the fit's own sample and blocks, which the blend shares."""
        return self.fit_.left_out

    def view(self, rows: NumberedTable) -> NumberedSegment:
        segment, whole = self.fit_.make_segment(rows.table, rows.T), rows.whole
        whole_segment = None if whole is None else cache(lambda: self.fit_.make_segment(*whole()))
        return NumberedSegment(segment, rows.begin, rows.joined, rows.first, whole_segment)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingSchedule:
        """Coefficients re-solved at every origin; with ``adapt="full"`` the network re-fitted every ten days."""
        return RollingSchedule(self.fit_, rows.begin, rows.joined, adapt)


class RollingSchedule(RollingNetwork):
    """The network as it goes through rows, in degC."""

    def forecast(self, view: NumberedSegment, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        path, heat = super().forecast(view, n_leads)
        return path + self.fit.reference, heat


class ARXMember:
    """ARX on all inputs and the last ``n_lags`` temperatures."""

    names: tuple[str, ...] = ("ARX",)
    is_rule = False

    def __init__(self, n_lags: int) -> None:
        self.n_lags = n_lags

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        self.arx_ = ARXRegressor(horizon=n_leads * training.step, n_lags=self.n_lags, max_missing=1.0)
        self.arx_.fit(training.replace(history={}), training.history["T_za"])
        return self

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        """Errors of regressions without a block."""
        T, n_leads = training.history["T_za"], int(sample.leads[-1])
        paths = self.arx_.left_out_paths(training, T, sample.origins, n_leads, blocks)
        rows, inside = sample.targets(len(T))
        return np.where(inside, T[rows] - paths[:, sample.leads - 1], np.nan)

    def view(self, rows: NumberedTable) -> ARXData:
        return self.arx_.view(rows.table, rows.T, rows.first)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingARX:
        """Re-solved at every origin on all pairs known by then."""
        return RollingARX(self.arx_, rows.begin, sample.leads, adapt)


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

    def _going_on(self, origin: int) -> int | None:
        """Go on to a row; the row before, where errors are recorded."""
        before, self._row = self._row, origin
        return None if self.adapt is None or origin < self.begin else before

    def _unfinished(self, before: int) -> np.ndarray:
        """Numbers of the forecasts up to the present row that had not ended at the row ``before``."""
        self._errors.extend((self._row - self.begin) // self._every + 1)
        return np.arange(max(0, (before - int(self.leads[-1]) - self.begin) // self._every), len(self.errors))


class RollingARX(_RollingErrors):
    """A fitted regression that goes through rows."""

    def __init__(self, arx: ARXRegressor, begin: int, leads: np.ndarray, adapt: str | None) -> None:
        super().__init__(begin, leads, adapt, rows_per_hour(arx.sampling_time_))
        self.arx, self._per_day = arx, rows_per_day(arx.sampling_time_)
        self._recursive = arx.recursive(begin)
        self._coefs: list[np.ndarray] = []  # of the days so far

    def advance(self, view: ARXData, origin: int) -> None:
        """Take in the pairs of rows up to ``origin``."""
        before = self._going_on(origin)
        if before is None:
            return
        while (mark := self.begin + len(self._coefs) * self._per_day) <= origin:
            self._recursive.advance(view, mark)
            self._coefs.append(self._recursive.coef())
        self._recursive.advance(view, origin)
        place, longest = self._unfinished(before), int(self.leads[-1])
        rows = self.begin + place * self._every
        day = (rows - self.begin) // self._per_day
        coefs = np.array(self._coefs[day[0] :])[day - day[0]]
        paths = self.arx.iterate(view, rows, longest, coefs)[:, self.leads - 1]
        ends = rows[:, None] + self.leads
        known, errors = (ends > before) & (ends <= origin), self.errors[place, :, 0]
        self.errors[place, :, 0] = np.where(known, view.T[np.minimum(ends, origin) - view.first] - paths, errors)

    def forecast(self, view: ARXData, n_leads: int) -> tuple[np.ndarray, None]:
        coef = self.arx.coef_ if self.adapt is None else self._recursive.coef()
        return self.arx.iterate(view, np.array([self._row]), n_leads, coef[None, :]), None


class DayBeforeMember:
    """The temperature of the day before: a rule that learns nothing and is hard to beat after a short training."""

    names: tuple[str, ...] = ("day before",)
    is_rule = True

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        """Keep the mean, at which rows before the first measurement are held."""
        self._per_day = rows_per_day(training.step)
        self.every = rows_per_hour(training.step)
        T = training.history["T_za"]
        known = T[np.isfinite(T)]
        self._mean = float(known.mean()) if len(known) else 0.0
        return self

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        """Errors of a rule that learns nothing."""
        view = self._held(training.history["T_za"], 0)
        return self.errors(view, sample.origins, sample.leads, training.n_rows - 1)

    def view(self, rows: NumberedTable) -> NumberedTemperatures:
        """Rows with the last measurement where there is none."""
        return self._held(rows.T, rows.first)

    def _held(self, T: np.ndarray, first: int) -> NumberedTemperatures:
        return NumberedTemperatures(T, pd.Series(T).ffill().fillna(self._mean).to_numpy(), first)

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingDayBefore:
        """Nothing is learned on the way."""
        return RollingDayBefore(self, rows.begin, sample.leads, adapt)

    def paths(self, view: NumberedTemperatures, origins: np.ndarray, leads: np.ndarray) -> np.ndarray:
        """(O, L) temperatures of the last day that was known at each origin [degC]."""
        back = -(-leads // self._per_day) * self._per_day
        return view.held[np.maximum(origins[:, None] + leads - back - view.first, 0)]

    def errors(self, view: NumberedTemperatures, origins: np.ndarray, leads: np.ndarray, row: int) -> np.ndarray:
        """(O, L) errors [K], NaN where unknown at ``row``."""
        ends = origins[:, None] + leads
        measured = view.T[np.minimum(ends, row) - view.first]
        return np.where(ends <= row, measured - self.paths(view, origins, leads), np.nan)


class NumberedTemperatures(NamedTuple):
    """Temperatures of rows that are known by their numbers from ``first`` on [degC]."""

    T: np.ndarray  # (n_rows,) NaN where missing
    held: np.ndarray  # (n_rows,) the last known one where missing
    first: int


class RollingDayBefore(_RollingErrors):
    """The rule as it goes through rows."""

    def __init__(self, rule: DayBeforeMember, begin: int, leads: np.ndarray, adapt: str | None) -> None:
        super().__init__(begin, leads, adapt, rule.every)
        self._rule = rule

    def advance(self, view: NumberedTemperatures, origin: int) -> None:
        before = self._going_on(origin)
        if before is not None:
            place = self._unfinished(before)
            origins = self.begin + self._every * place
            self.errors[place, :, 0] = self._rule.errors(view, origins, self.leads, origin)

    def forecast(self, view: NumberedTemperatures, n_leads: int) -> tuple[np.ndarray, None]:
        return self._rule.paths(view, np.array([self._row]), np.arange(1, n_leads + 1)), None
