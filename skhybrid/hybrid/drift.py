"""Drift monitor: sequential tests on the size of day-ahead errors, and on their recurrence from day to day."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from sklearn.exceptions import NotFittedError

from .._arguments import is_number
from .._holidays import read_holidays
from .._table import float_columns
from .._transaction import unchanged_on_failure
from ..exceptions import TooFewDaysError

_ALLOWANCE = 0.5  # allowance of the sum [standard deviations]: a rise of twice as much is found soonest
_SURE = 1.65  # standard errors of the reference mean by which the allowance is larger
#: allowance of the sum of recurrences, which are more skewed than normal variables, and the largest value of one
_ALLOWANCE_RECURRENCE, _MOST_RECURRENCE = 1.0, 6.0
_MEMORY = 0.7  # share of the fading mean of earlier days' errors that is kept from one day to the next
_LARGEST = 3.0  # limit of a day's error in that mean, as a multiple of the reference's
_BLOCKS = 24  # blocks of a day whose mean errors are compared
_MOST_CORRELATION = 0.8  # most days of memory that a reference of few days may show
_QUIET = 0.4  # a working day that moves less than this share of the usual range is quiet
_SMALLEST = 0.05  # least error of a day, as a share of the reference's median, before its logarithm is taken


class DriftMonitor:
    """Watch day-ahead errors for growth and for repeated daily patterns, by cumulative sums (CUSUM).

    A day counts by the logarithm of its root mean square error, less the mean of the reference days of its kind
    (weekday or weekend), in long-run standard deviations.  What exceeds an allowance is summed up, never below zero; an
    alarm is a sum above the threshold.  When a schedule moves, errors need not be larger, but they are alike on all
    days of a kind.  So a second sum takes the product of each day's hourly errors with the fading mean of those of
    earlier days of its kind, standardised by the reference days.  The larger sum counts.

    Parameters
    ----------
    false_alarms_per_year : float, default=1.0
        How often a building that stays as it was may raise an alarm (Siegmund's approximation of the run length).
    holidays : str or sequence of dates, optional
        A country, a state or local dates, which count as Sundays.

    Attributes
    ----------
    mean_ : ndarray of shape (2,)
        Mean logarithm of a day's error, on weekdays and on weekends.
    std_ : float
        Long-run standard deviation of the logarithm [-].
    correlation_ : float
        Correlation of one day with the next, in [0, 0.8].
    range_ : float
        Median range of the measured series over a weekday, in its unit.
    threshold_ : float
        Of the statistic.
    allowance_ : float
        What a day's standardised score must exceed to be summed up.
    recurrence_ : ndarray of shape (2,)
        Mean and standard deviation of the recurrence on the reference days [-].

    References
    ----------
    Page, Continuous inspection schemes, Biometrika 41 (1954); Siegmund, Sequential Analysis (1985), section 2.6.
    """

    def __init__(self, false_alarms_per_year: float = 1.0, *, holidays: Any = None) -> None:
        self.false_alarms_per_year = false_alarms_per_year
        self.holidays = holidays

    @unchanged_on_failure
    def fit(self, measured: pd.DataFrame, forecast: pd.DataFrame) -> Self:
        """Learn from reference days.

        Parameters
        ----------
        measured, forecast : DataFrame of shape (n_days, n_steps)
            One row per day, stamped by it; NaN where missing.  Forecasts of days that the model was not fitted on.

        Raises
        ------
        ValueError
            If fewer than seven days are known, the two frames do not match or have no increasing days as their index,
            or ``false_alarms_per_year`` is not a positive number.
        """
        rate: Any = self.false_alarms_per_year
        if not (is_number(rate) and rate > 0):
            raise ValueError(f"false_alarms_per_year={rate!r} must be a positive number.")
        measured, error = _errors(measured, forecast)
        size = _rms(error)
        if (known := int(np.isfinite(size).sum())) < 7:
            raise TooFewDaysError(f"the reference has {known} days with measurement and forecast; give seven or more.")
        self._floor = _SMALLEST * float(np.nanmedian(size)) + 1e-12
        score, weekend = self._score(error), self._weekend(measured)
        overall = np.nanmean(score)
        means = [score[weekend == kind] for kind in (False, True)]
        self.mean_ = np.array([np.nanmean(m) if np.isfinite(m).sum() > 1 else overall for m in means])
        left = score - self.mean_[weekend.astype(int)]
        neighbours = left[1:] * left[:-1]
        variance = np.nanvar(left, ddof=1)
        found = np.nanmean(neighbours) / variance if variance > 0 and np.isfinite(neighbours).any() else 0.0
        # the correlation that a short series shows is too low by about (1 + 4 rho) / n (Kendall)
        found += (1.0 + 4.0 * found) / known
        self.correlation_ = float(np.clip(found, 0.0, _MOST_CORRELATION))
        self.std_ = float(np.sqrt(variance * (1 + self.correlation_) / (1 - self.correlation_))) + 1e-12
        self.allowance_ = _ALLOWANCE + _SURE / np.sqrt(known)
        self.threshold_ = threshold(2.0 * 365.25 / float(rate))  # each sum has half of the alarms
        spread = _range(measured)[~weekend]
        self.range_ = float(np.nanmedian(spread)) if np.isfinite(spread).any() else float("nan")
        self._steps = measured.columns
        self._bias = np.nanmean(np.where(np.isnan(error).all(axis=0), 0.0, error), axis=0)
        self._square = float(np.nanmean(error**2)) + 1e-12
        recurrence, self._usual = self._recurrence(error, weekend, [None, None])
        self.recurrence_ = np.array([0.0, 1.0])
        if np.isfinite(recurrence).sum() > 1:
            self.recurrence_[:] = np.nanmean(recurrence), np.nanstd(recurrence, ddof=1) + 1e-12
        return self

    def watch(self, measured: pd.DataFrame, forecast: pd.DataFrame) -> pd.DataFrame:
        """Test later days, one after the other.

        Parameters
        ----------
        measured, forecast : DataFrame of shape (n_days, n_steps)
            As in :meth:`fit`, of days in a row, with the same columns in the same order.

        Returns
        -------
        DataFrame of length n_days
            ``statistic`` and ``threshold`` after each day; ``drifted``; ``since``, the day from which on errors are
            larger; ``kind``: ``"level"`` where they lie on one side at all hours (season, plant), ``"schedule"`` where
            they follow the hours of the day, ``"quiet"`` where the working days since hardly move (a long closure).
            A day's row reads nothing of later days.

        Raises
        ------
        ValueError
            If the monitor is not fitted, or the frames do not match each other or those of ``fit``.
        """
        if not hasattr(self, "threshold_"):
            raise NotFittedError("this DriftMonitor has no reference days yet; call fit first.")
        measured, error = _errors(measured, forecast)
        _refuse_other_steps(measured.columns, self._steps)
        weekend, span = self._weekend(measured), _range(measured)
        excess = (self._score(error) - self.mean_[weekend.astype(int)]) / self.std_ - self.allowance_
        recurrence, _ = self._recurrence(error, weekend, self._usual)
        mean, std = self.recurrence_
        recurring = np.minimum((recurrence - mean) / std, _MOST_RECURRENCE) - _ALLOWANCE_RECURRENCE
        sums, rows = [_BoundedSum(2.0 * self.threshold_), _BoundedSum(2.0 * self.threshold_)], []
        for day, steps in enumerate(zip(excess, recurring, strict=True)):
            for one, step in zip(sums, steps, strict=True):
                one.add(day, step)
            largest = max(sums, key=lambda one: one.total)
            drifted = largest.total > self.threshold_
            since = slice(largest.begin, day + 1)
            kind = self._kind(error[since], span[since][~weekend[since]]) if drifted else ""
            begin = measured.index[largest.begin] if drifted else pd.NaT
            rows.append((largest.total, self.threshold_, drifted, begin, kind))
        return pd.DataFrame(rows, index=measured.index, columns=["statistic", "threshold", "drifted", "since", "kind"])

    def _recurrence(
        self, error: np.ndarray, weekend: np.ndarray, usual: list[np.ndarray | None]
    ) -> tuple[np.ndarray, list[np.ndarray | None]]:
        """(n_days,) products of days with the mean of earlier ones, NaN where either is unknown, and the last means."""
        out, usual = np.full(len(error), np.nan), list(usual)
        for day, (whole, kind) in enumerate(zip(error, weekend.astype(int), strict=True)):
            known = np.isfinite(whole)
            if 2 * known.sum() < len(whole):
                continue
            parts = np.array_split(whole, min(_BLOCKS, len(whole)))
            e = np.array([np.mean(part[np.isfinite(part)]) if np.isfinite(part).any() else 0.0 for part in parts])
            before = usual[kind]
            if before is not None:
                out[day] = np.mean(e * before) / self._square
            # one odd day must not be what the next ones are compared with
            counted = e * min(1.0, _LARGEST / max(np.sqrt(np.mean(e**2) / self._square), 1e-12))
            usual[kind] = counted if before is None else _MEMORY * before + (1.0 - _MEMORY) * counted
        return out, usual

    def _weekend(self, measured: pd.DataFrame) -> np.ndarray:
        days = pd.DatetimeIndex(measured.index)
        return read_holidays(self.holidays, days).weekend(days)

    def _score(self, error: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(_rms(error), self._floor))

    def _kind(self, error: np.ndarray, working: np.ndarray) -> str:
        """The kind of a drift, by the errors since it began."""
        if np.isfinite(working).any() and np.nanmedian(working) < _QUIET * self.range_:
            return "quiet"
        known = np.isfinite(error).any(axis=0)
        profile = np.nanmean(error[:, known], axis=0) - self._bias[known]
        return "level" if abs(float(np.nanmean(profile))) > float(np.nanstd(profile)) else "schedule"


class _BoundedSum:
    """A sum that stays between zero and a limit, so that it can fall again soon."""

    def __init__(self, most: float) -> None:
        self.total, self.begin, self._most = 0.0, 0, most

    def add(self, day: int, step: float) -> None:
        """Add a day's step; a day without measurements (NaN) changes nothing."""
        if self.total <= 0.0:
            self.begin = day
        self.total = min(max(0.0, self.total + (step if np.isfinite(step) else 0.0)), self._most)


def _errors(measured: pd.DataFrame, forecast: pd.DataFrame) -> tuple[pd.DataFrame, np.ndarray]:
    """The measurements as float64, and (n_days, n_steps) measured less forecast."""
    known = float_columns(measured, getattr(measured, "columns", ()), "measured")
    expected = float_columns(forecast, getattr(forecast, "columns", ()), "forecast")
    days = known.index
    if not (isinstance(days, pd.DatetimeIndex) and days.is_unique and days.is_monotonic_increasing and known.shape[1]):
        raise ValueError("measured needs increasing days as its index, and at least one column; give one row per day.")
    if not (days.equals(expected.index) and known.columns.equals(expected.columns)):
        raise ValueError("measured and forecast differ in their days or columns; give the same rows of both.")
    return known, (known - expected).to_numpy(dtype=np.float64)


def _refuse_other_steps(steps: pd.Index, fitted: pd.Index) -> None:
    """Refuse days whose steps are not those of the reference, of which each has errors of its own."""
    if steps.equals(fitted):
        return
    if len(steps) != len(fitted):
        raise ValueError(f"the days have {len(steps)} steps, but those of fit have {len(fitted)}; give the same steps.")
    for j, (here, there) in enumerate(zip(steps, fitted, strict=True)):
        if here != there:
            raise ValueError(
                f"step {j} of the days is the column {here!r}, but that of fit is {there!r}; give the columns of fit "
                "in their order."
            )


def _rms(error: np.ndarray) -> np.ndarray:
    """(n_days,) root mean square of what is known of each day, NaN where less than half of it is."""
    known = np.isfinite(error)
    count = known.sum(axis=1)
    square = np.where(known, error, 0.0) ** 2
    return np.where(2 * count >= error.shape[1], np.sqrt(square.sum(axis=1) / np.maximum(count, 1)), np.nan)


def _range(measured: pd.DataFrame) -> np.ndarray:
    """(n_days,) highest less lowest value of each day."""
    return (measured.max(axis=1) - measured.min(axis=1)).to_numpy()


def threshold(run_length: float) -> float:
    """Threshold of a one-sided sum of standard normal steps less the allowance, by its mean run length [steps]."""
    # Siegmund's approximation: with b = h + 1.166 the run length is (exp(2 k b) - 2 k b - 1) / (2 k^2)
    k = _ALLOWANCE

    def excess(h: float) -> float:
        b = 2.0 * k * (h + 1.166)
        return (np.exp(b) - b - 1.0) / (2.0 * k**2) - run_length

    return float(brentq(excess, 0.0, 60.0)) if excess(0.0) < 0.0 else 0.0
