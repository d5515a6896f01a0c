"""When what was learned no longer holds: a sequential test on the size of day-ahead errors."""

from __future__ import annotations

from typing import Self

import numpy as np
import pandas as pd
from scipy.optimize import brentq

#: allowance of the sum [standard deviations]: a rise of twice as much is found soonest
_ALLOWANCE = 0.5
#: standard errors of the reference mean by which the allowance is larger
_SURE = 1.65
#: most days of memory that a reference of few days may show
_MOST_CORRELATION = 0.8
#: a working day that moves less than this share of the usual range is quiet
_QUIET = 0.4
#: a day's error counts by its logarithm, which is bounded below by this share of the reference's
_SMALLEST = 0.05
KINDS = ("", "level", "schedule", "quiet")


class DriftMonitor:
    """Cumulative sum (CUSUM) of how much larger than before each day's forecast error is.

    A day counts by the logarithm of its root mean square error, less the mean of the reference days of its kind
    (weekday or weekend), in standard deviations of a sum of such days, so that days that resemble their neighbours
    raise no more alarms than independent ones.  What exceeds an allowance is summed up, never below zero; an alarm is
    a sum above the threshold.  The allowance is larger by 1.65 standard errors of the reference mean.

    Parameters
    ----------
    false_alarms_per_year : float, default=1.0
        How often a building that stays as it was may raise an alarm, by Siegmund's approximation of the run length;
        from it follows the threshold.

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

    References
    ----------
    Page, Continuous inspection schemes, Biometrika 41 (1954); Siegmund, Sequential Analysis (1985), section 2.6.
    """

    def __init__(self, false_alarms_per_year: float = 1.0) -> None:
        self.false_alarms_per_year = false_alarms_per_year

    def fit(self, measured: pd.DataFrame, forecast: pd.DataFrame) -> Self:
        """Take the reference.

        Parameters
        ----------
        measured, forecast : DataFrame of shape (n_days, n_steps)
            One row a day, stamped by it; NaN where missing.  Forecasts of days that the model was not fitted on.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If fewer than seven days are known.
        """
        error = (measured - forecast).to_numpy(dtype=np.float64)
        size = _rms(error)
        if (known := int(np.isfinite(size).sum())) < 7:
            raise ValueError(f"the reference has {known} days with measurement and forecast; give seven or more.")
        self._floor = _SMALLEST * float(np.nanmedian(size)) + 1e-12
        score, weekend = self._score(error), _weekend(measured)
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
        self.threshold_ = threshold(365.25 / self.false_alarms_per_year)
        spread = _range(measured)[~weekend]
        self.range_ = float(np.nanmedian(spread)) if np.isfinite(spread).any() else float("nan")
        self._bias = np.nanmean(error, axis=0)
        return self

    def watch(self, measured: pd.DataFrame, forecast: pd.DataFrame) -> pd.DataFrame:
        """Go through later days.

        Parameters
        ----------
        measured, forecast : DataFrame of shape (n_days, n_steps)
            As in :meth:`fit`, of days in a row.

        Returns
        -------
        DataFrame of length n_days
            ``statistic`` and ``threshold`` after each day; ``drifted``; ``since``, the day from which on errors are
            larger; ``kind``: ``"level"`` where they lie on one side at all hours (season, plant), ``"schedule"`` where
            they follow the hours of the day, ``"quiet"`` where the working days since hardly move (a long closure).
            A day's row reads nothing of later days.
        """
        error = (measured - forecast).to_numpy(dtype=np.float64)
        weekend, span = _weekend(measured), _range(measured)
        excess = (self._score(error) - self.mean_[weekend.astype(int)]) / self.std_ - self.allowance_
        total, begin, rows = 0.0, 0, []
        for day, step in enumerate(excess):
            if total <= 0.0:
                begin = day
            # a sum far above the threshold would take long to come back once the errors are small again
            total = min(max(0.0, total + (step if np.isfinite(step) else 0.0)), 2.0 * self.threshold_)
            drifted = total > self.threshold_
            since = slice(begin, day + 1)
            kind = self._kind(error[since], span[since][~weekend[since]]) if drifted else ""
            rows.append((total, self.threshold_, drifted, measured.index[begin] if drifted else pd.NaT, kind))
        return pd.DataFrame(rows, index=measured.index, columns=["statistic", "threshold", "drifted", "since", "kind"])

    def _score(self, error: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(_rms(error), self._floor))

    def _kind(self, error: np.ndarray, working: np.ndarray) -> str:
        """What the errors since a change have in common."""
        if np.isfinite(working).any() and np.nanmedian(working) < _QUIET * self.range_:
            return "quiet"
        known = np.isfinite(error).any(axis=0)
        profile = np.nanmean(error[:, known], axis=0) - self._bias[known]
        level = abs(float(np.nanmean(profile)))
        return "level" if level > float(np.nanstd(profile)) else "schedule"


def _rms(error: np.ndarray) -> np.ndarray:
    """(n_days,) root mean square of what is known of each day, NaN where less than half of it is."""
    known = np.isfinite(error)
    count = known.sum(axis=1)
    square = np.where(known, error, 0.0) ** 2
    return np.where(2 * count >= error.shape[1], np.sqrt(square.sum(axis=1) / np.maximum(count, 1)), np.nan)


def _range(measured: pd.DataFrame) -> np.ndarray:
    """(n_days,) highest less lowest value of each day."""
    return (measured.max(axis=1) - measured.min(axis=1)).to_numpy()


def _weekend(measured: pd.DataFrame) -> np.ndarray:
    return np.asarray(pd.DatetimeIndex(measured.index).day_of_week >= 5)


def threshold(run_length: float) -> float:
    """Threshold of a one-sided sum of standard normal steps less the allowance, whose mean run length is given [steps].

    Siegmund's approximation: with b = h + 1.166 the run length is (exp(2 k b) - 2 k b - 1) / (2 k^2).

    Parameters
    ----------
    run_length : float

    Returns
    -------
    float
    """
    k = _ALLOWANCE

    def excess(h: float) -> float:
        b = 2.0 * k * (h + 1.166)
        return (np.exp(b) - b - 1.0) / (2.0 * k**2) - run_length

    return float(brentq(excess, 0.0, 60.0)) if excess(0.0) < 0.0 else 0.0
