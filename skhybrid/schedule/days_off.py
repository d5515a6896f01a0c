"""Working days of a training that were used as days of a weekend are, such as holidays that nobody named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import wall_clock
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from ..filtering import ForecastSample
from .fit import LeadFit, forecast_errors
from .segment import Segment

_LARGE = 5.0  # mean squared error of forecasts of such a day, relative to that of a usual day
_LEFT = 0.4  # share of it that is left if the day counts as one of a weekend


def warn_of_days_off(fit: LeadFit, training: ZoneTable) -> None:
    """Warn of working days of the training that look like holidays."""
    if days := days_like_weekends(fit, training):
        named, used, these = days[0], "was", "this day"
        if len(days) > 1:
            named, used, these = f"{', '.join(days[:-1])} and {days[-1]}", "were", "these days"
        warn_user(
            f"{named} {used} used like a weekend; if the building was closed, holidays= (a country, a state or dates) "
            f"should name {these}, and those to come, which forecasts miss otherwise.",
            SkhybridWarning,
        )


def days_like_weekends(fit: LeadFit, training: ZoneTable) -> list[str]:
    """Dates, such as "2018-12-25", of working days that were used as days of a weekend are.

    Forecasts of such a day err much more than those of other days, and hardly if it counts as a day of a weekend.
    ``fit`` still has its training rows.
    """
    if not (fit.plan.calendar and isinstance(training.index, pd.DatetimeIndex)):
        return []
    weekend, sample = training.weekend, fit.sample
    if weekend.all() or not weekend.any() or np.isnan(fit.left_out).all():
        return []
    dates, day = np.unique(wall_clock(training.time).to_numpy().astype("M8[D]"), return_inverse=True)
    targets, inside = sample.targets(training.n_rows)
    target_day = np.where(inside, day[targets], -1)
    squares = _by_day(fit.left_out**2, target_day, len(dates))
    working = ~np.isin(np.arange(len(dates)), day[weekend])
    suspect = np.flatnonzero(working & (squares > _LARGE * np.nanmedian(squares)))
    if not len(suspect):
        return []
    near = np.isin(target_day, suspect).any(axis=1)
    chosen = ForecastSample(np.ascontiguousarray(sample.origins[near]), sample.leads)
    named = (*training.holidays.dates, *dates[suspect].astype(str).tolist())
    turned = training.replace(holidays=replace(training.holidays, dates=named))
    segments = fit.segment, fit.make_segment(turned, training.history["T_za"])
    as_is, as_weekend = (_by_day(_errors(fit, s, chosen) ** 2, target_day[near], len(dates))[suspect] for s in segments)
    return dates[suspect[as_weekend < _LEFT * as_is]].astype(str).tolist()


def _errors(fit: LeadFit, segment: Segment, sample: ForecastSample) -> np.ndarray:
    """(O, L) errors [K] of forecasts of a segment; NaN where not measured."""
    scored = fit.problem.scored._replace(segment=segment, sample=sample, weight=1.0, surprise=None)
    problem = replace(fit.problem, forecasts=(scored,))
    root = problem.root_weights(scored)
    return forecast_errors(root, problem.design(fit.psi, scored).reshape(*root.shape, -1), fit.coef)


def _by_day(values: np.ndarray, day: np.ndarray, n_days: int) -> np.ndarray:
    """Mean (n_days,) of values (O, L) by the number of their day, -1 for none; NaN for a day without any."""
    known = np.isfinite(values) & (day >= 0)
    count = np.bincount(day[known], minlength=n_days)
    return np.bincount(day[known], values[known], n_days) / np.where(count, count, np.nan)
