"""Fits of a forecaster on parts of the past: refits after each week, and halves whose days the other half forecasts."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import clone

from .._table import ZoneTable
from .._time import rows_per_day
from .disturbance_steps import fit_forecaster, forecast_steps
from .tables import KEPT, midnights

#: how much of the past a new fit may be made on; None is all of it
SPANS: tuple[pd.Timedelta | None, ...] = (None, pd.Timedelta("21D"), pd.Timedelta("14D"))
_CLEARLY = 0.9  # share of the error by all steps below which fewer steps are believed
_MOST_WEEKS = 5  # fits that are kept: those whose forecasts tell how wide an interval is
_WEEK, _DAY = pd.Timedelta("7D"), pd.Timedelta("1D")


class WeeklyRefit:
    """Fits of a forecaster's clones at the ends of weeks, on the span whose fit a week earlier forecast it best."""

    def __init__(self, forecaster: Any) -> None:
        self._forecaster = forecaster
        self._fits: dict[tuple[int, int], Any] = {}
        self._once: dict[int, Any] = {}

    def fork(self) -> Self:
        """A copy that goes on by itself: another object may be given other rows."""
        made = copy(self)
        made._fits, made._once = dict(self._fits), dict(self._once)
        return made

    def fitted_once(self, n_steps: int, steps: Callable[[], ZoneTable]) -> Any:
        """The fit on so many steps since the training, which do not change any more; ``steps`` gives their table."""
        if n_steps not in self._once:
            self._once[n_steps] = self.fitted(steps())
            self._once = dict(list(self._once.items())[-_MOST_WEEKS:])
        return self._once[n_steps]

    def fitted(self, steps: ZoneTable) -> Any:
        """The forecaster fitted on steps that end with a week."""
        return self._fit(steps, self._span(steps))

    def _span(self, steps: ZoneTable) -> pd.Timedelta | None:
        before = steps.rows(slice(0, steps.n_rows - int(_WEEK / steps.step)))
        long_enough = [s for s in SPANS if s is None or _knows(before, int(s / steps.step))]
        if len(long_enough) < 2:
            return None
        errors = [_last_week_error(self._fit(before, span), steps) for span in long_enough]
        best = int(np.argmin(errors))
        return long_enough[best] if errors[best] < _CLEARLY * errors[0] else None

    def _fit(self, steps: ZoneTable, span: pd.Timedelta | None) -> Any:
        n = steps.n_rows
        length = n if span is None else min(n, int(span / steps.step))
        key = (n, length)
        if key not in self._fits:
            self._fits[key] = fit_forecaster(clone(self._forecaster), steps.rows(slice(n - length, None)))
            # only the fits of this week and of the one before are wanted again
            self._fits = {k: v for k, v in self._fits.items() if k[0] >= n - int(_WEEK / steps.step)}
        return self._fits[key]


def _knows(steps: ZoneTable, n_last: int) -> bool:
    """Whether there are more steps than the last so many, and a disturbance is known in one of these."""
    return n_last < steps.n_rows and bool(np.isfinite(steps.history["zeta"][-n_last:]).any())


def _last_week_error(forecaster: Any, steps: ZoneTable) -> float:
    """RMS error a day ahead over the last week."""
    day, week = int(_DAY / steps.step), int(_WEEK / steps.step)
    recent = steps.rows(slice(max(0, steps.n_rows - week - int(KEPT / steps.step)), None))
    origins = np.arange(recent.n_rows - week - 1, recent.n_rows - day, day)
    paths = forecast_steps(forecaster, recent, origins, day)
    error = (paths - recent.history["zeta"][origins[:, None] + np.arange(1, day + 1)]) ** 2
    return float(np.sqrt(np.nanmean(error))) if np.isfinite(error).any() else np.inf


def by_days(steps: ZoneTable, forecaster: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(n_days, n_steps_per_day) estimated disturbance of whole local days but the first, and forecast from midnight."""
    per_day, begins = rows_per_day(steps.step), midnights(steps)
    begins = begins[begins + per_day <= steps.n_rows]
    days = steps.history["zeta"][begins[:, None] + np.arange(per_day)]
    measured = pd.DataFrame(days, index=steps.time[begins].normalize())
    return measured, pd.DataFrame(forecast_steps(forecaster, steps, begins - 1, per_day), index=measured.index)


def reference_days(steps: ZoneTable, forecaster: Any, refit: bool) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Days of the training, as ``by_days``: where ``refit``, each half is forecast by a fit to the other half."""
    if not refit:
        return by_days(steps, forecaster)
    half = steps.n_rows // 2
    halves = [steps.rows(slice(0, half)), steps.rows(slice(half, None))]
    fits = [fit_forecaster(clone(forecaster), other) for other in reversed(halves)]
    parts = [by_days(part, fit) for part, fit in zip(halves, fits, strict=True)]
    measured, forecast = (pd.concat(tables) for tables in zip(*parts, strict=True))
    return measured, forecast
