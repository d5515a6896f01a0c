"""Intervals around a path forecast, learned from errors on data that the forecast was not fitted on.

The shape of the errors is conformal: quantiles of standardised errors, with a finite-sample correction.  Their scale
depends on the lead and on the hour of the target.  Their location and width follow the errors of the last days, whose
weights decay with age (weighted conformal prediction, Barber et al. 2023, doi:10.1214/23-AOS2276).  Last, a factor
follows how well the intervals of the last days, each from what was known then, held what was measured (as adaptive
conformal inference does, Gibbs and Candes 2021, arXiv:2106.00170).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtri

from .._calendar import N_CELLS

DAYS_BACK = 21  # days before an origin whose forecasts count as recent; the oldest has a weight of 0.12
_MEMORY_DAYS = 10.0  # age at which the weight of an error is 1/e [days]
#: weights of the prior [days]: of the shape in training, of location 0, of width 1
_SHAPE_DAYS, _LOCATION_DAYS, _WIDTH_DAYS = 5.0, 5.0, 2.0
#: of the factor: the probability and the days whose intervals are scored, weight of the prior [days], largest change
_SCORED_PROBABILITY, _SCORED_DAYS, _FACTOR_DAYS, _MOST_FACTOR = 0.8, 10.0, 5.0, 2.0
_HOUR_DAYS = 10.0  # weight of the average over hours in the scale of one hour [days]
_INDEPENDENT_PER_DAY = 2.0  # independent errors per day: those of a day-ahead forecast are correlated over half a day
#: ends of the groups of leads that share a shape [h], and the lead at which each shape holds; between them it blends
_GROUP_ENDS, _GROUP_LEADS = (2.0, 8.0), (1.0, 4.0, 16.0)
_BIN_RATIO = 1.35  # largest ratio of two leads in one bin of the scale
_SCORED_LEVELS = (0.5 - _SCORED_PROBABILITY / 2, 0.5, 0.5 + _SCORED_PROBABILITY / 2)
_SHAPE_LEVELS = (np.arange(200) + 0.5) / 200
LEAST_ERRORS = 20  # fewest errors that intervals are learned from


class PathClock(NamedTuple):
    """Lead, hour and day of the targets of forecast paths."""

    lead: np.ndarray  # (n_origins, n_leads) time since the last measured value [h]
    slot: np.ndarray  # (n_origins, n_leads) int, local hour of day, + 24 on weekends
    day: np.ndarray  # (n_origins, n_leads) time of the target since any fixed instant [days]
    spread: np.ndarray | None = None  # (n_origins, n_leads) standard deviation by a model, in units of y

    def rows(self, chosen: np.ndarray | slice) -> PathClock:
        """The clock of some of the origins."""
        spread = None if self.spread is None else self.spread[chosen]
        return PathClock(self.lead[chosen], self.slot[chosen], self.day[chosen], spread)


class LeadIntervals:
    """Quantiles of the error of a path forecast, by lead and hour of the target.

    An error (measured - forecast) is ``scale(lead, hour) * (location + width * shape)``.  Scale and shape come from
    errors on left-out training data.  Location and width come from the errors of the last days, shrunk towards 0 and 1;
    the standardised errors of the last days also join the shape.

    ``independent_per_day`` says how many errors of a day are independent, for the finite-sample correction.  Fitted
    are ``lead_scale_`` (2, n_bins), leads [h] and the mean absolute error there; ``hour_scale_`` (48,), the factor of
    each hour of a weekday and then of a weekend day; ``shape_`` (n_groups, 200), evenly spaced quantiles of the
    standardised errors of leads up to 2 h, up to 8 h and above; and ``n_days_``, the number of days with errors.
    """

    def __init__(self, *, independent_per_day: float = _INDEPENDENT_PER_DAY) -> None:
        self.independent_per_day = independent_per_day

    def fit(self, errors: np.ndarray, clock: PathClock) -> Self:
        """Learn from LEAST_ERRORS or more errors (n_origins, n_leads) on left-out data, NaN where unknown."""
        known = np.isfinite(errors)
        self._set_scales(np.abs(errors if clock.spread is None else errors / clock.spread)[known], known, clock)
        standard = errors / self.scale(clock)
        groups = _groups(clock.lead)
        pooled = np.quantile(standard[known], _SHAPE_LEVELS)
        shapes = []
        for group in range(len(_GROUP_LEADS)):
            own = standard[known & (groups == group)]
            shapes.append(np.quantile(own, _SHAPE_LEVELS) if len(own) >= LEAST_ERRORS else pooled)
        self.shape_ = np.array(shapes)
        self.n_days_ = len(np.unique(np.floor(clock.day[known])))
        return self

    def _set_scales(self, size: np.ndarray, known: np.ndarray, clock: PathClock) -> None:
        """Fit the mean absolute error as a product of a factor by lead and one by hour, in turn."""
        lead, slot = clock.lead[known], clock.slot[known]
        numbers = np.floor(np.log(lead / lead.min()) / np.log(_BIN_RATIO) + 1e-9).astype(np.int64)
        bins = np.unique(numbers, return_inverse=True)[1]
        count = np.bincount(bins)
        met = np.unique(slot + N_CELLS * np.floor(clock.day[known]).astype(np.int64)) % N_CELLS
        n_days = np.bincount(met, minlength=N_CELLS).astype(np.float64)
        by_hour = np.ones(N_CELLS)
        for _ in range(3):
            by_lead = np.maximum(np.bincount(bins, size / by_hour[slot]) / count, 1e-9)
            ratio = size / by_lead[bins]
            by_hour = _shrunk_hours(np.bincount(slot, ratio, N_CELLS), np.bincount(slot, minlength=N_CELLS), n_days)
            by_hour /= by_hour[slot].mean()
        self.lead_scale_ = np.stack([np.exp(np.bincount(bins, np.log(lead)) / count), by_lead])
        self.hour_scale_ = by_hour

    def scale(self, clock: PathClock) -> np.ndarray:
        """Typical absolute error of each target, (n_origins, n_leads)."""
        leads, values = self.lead_scale_
        by_lead = np.exp(np.interp(np.log(np.maximum(clock.lead, 1e-9)), np.log(leads), np.log(values)))
        scale = by_lead * self.hour_scale_[clock.slot]
        return scale if clock.spread is None else scale * clock.spread

    def offsets(
        self,
        clock: PathClock,
        quantiles: Sequence[float] | np.ndarray,
        recent: tuple[np.ndarray, PathClock] | None = None,
        now: float | None = None,
        further: np.ndarray | None = None,
        factor: float = 1.0,
    ) -> np.ndarray:
        """(n_leads, n_quantiles) quantiles of the error of one path, to be added to it; never decreasing along a row.

        ``clock`` has one origin.  ``recent`` has errors of earlier paths, one row per path, and their clock, on which
        ``now`` is the time of the origin [days]; only errors known at ``now`` are read.  ``further`` (n_leads,) is the
        standard deviation of an independent normal error, by which the interval is wider.  ``factor``
        (:meth:`factor_at`) stretches it about its median.
        """
        if further is not None or factor != 1.0:
            middle, *own = self.offsets(clock, [0.5, *quantiles], recent, now).T
            off = factor * (np.stack(own, axis=1) - middle[:, None])
            if further is not None:  # as the quantiles of a normal error with another
                of_other = further[:, None] * ndtri(quantiles)
                off = np.copysign(np.hypot(off, of_other), of_other)
            return middle[:, None] + off
        levels = np.asarray(quantiles, dtype=np.float64)
        standard, age, of_recent = np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0))
        if recent is not None and now is not None and recent[0].size:
            errors, past = recent
            age = now - past.day
            standard = np.where(age >= -1e-9, errors / self.scale(past), np.nan)
            of_recent = _groups(past.lead)
        weighed = [_weighted(standard, age, of_recent == group) for group in range(len(_GROUP_LEADS))]
        by_group = np.array([self._standard_quantiles(group, levels, *known) for group, known in enumerate(weighed)])
        at = np.log(np.maximum(clock.lead[0], 1e-9))
        blended = [np.interp(at, np.log(_GROUP_LEADS), column) for column in by_group.T]
        return self.scale(clock)[0][:, None] * np.stack(blended, axis=1)

    def factor_at(self, recent: tuple[np.ndarray, PathClock], now: float) -> float:
        """Factor by which the intervals of the last days were too narrow to hold their share, shrunk towards 1.

        ``recent`` and ``now`` as in :meth:`offsets`.  Each path is scored by the interval that was known at its origin.
        """
        errors, past = recent
        scores, weights = [np.empty(0)], [np.empty(0)]
        for j in np.flatnonzero(now - past.day[:, 0] < _SCORED_DAYS):
            age = now - past.day[j]
            known = np.isfinite(errors[j]) & (age >= -1e-9)
            # just before the first target: what its origin knew
            band = self.offsets(past.rows(slice(j, j + 1)), _SCORED_LEVELS, recent, past.day[j, 0] - 1e-6)[known]
            low, middle, high = band.T
            off = errors[j][known] - middle
            scores.append(np.abs(off) / np.maximum(np.where(off > 0, high - middle, middle - low), 1e-9))
            weights.append(np.exp(-np.maximum(age[known], 0.0) / _MEMORY_DAYS) / max(1, known.sum()))
        score, weight = np.concatenate(scores), np.concatenate(weights)
        if not len(score):
            return 1.0
        factor = float(weighted_quantiles(score, weight, np.array([_SCORED_PROBABILITY]))[0])
        share = weight.sum() / (weight.sum() + _FACTOR_DAYS)
        return float(np.clip(factor, 1.0 / _MOST_FACTOR, _MOST_FACTOR) ** share)

    def _standard_quantiles(
        self, group: int, levels: np.ndarray, values: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """Quantiles (n_levels,) of the standardised error, from the shape in training and recent errors (n_days, n)."""
        shape = self.shape_[group]
        known = np.isfinite(values)
        filled, weights = np.where(known, values, 0.0), np.where(known, weights, 0.0)
        total = weights.sum()
        location = np.sum(weights * filled) / (total + _LOCATION_DAYS)
        sizes = np.sum(weights * np.abs(filled - location)) / max(np.abs(shape).mean(), 1e-9)
        width = (sizes + _WIDTH_DAYS) / (total + _WIDTH_DAYS)
        from_training = min(_SHAPE_DAYS, self.n_days_)
        pool = np.concatenate([shape, (values[known] - location) / width])
        weight = np.concatenate([np.full(len(shape), from_training / len(shape)), weights[known]])
        squares = from_training**2 / self.n_days_ + np.sum(weights.sum(axis=-1) ** 2)
        n_independent = self.independent_per_day * (from_training + total) ** 2 / squares
        return location + width * weighted_quantiles(pool, weight, finite_sample_levels(levels, n_independent))


def _groups(lead: np.ndarray) -> np.ndarray:
    """Number of each lead's group."""
    return np.searchsorted(_GROUP_ENDS, lead - 1e-9)


def _weighted(standard: np.ndarray, age: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors of one group of leads, NaN elsewhere, and weights; those of a complete path sum to exp(-age / memory)."""
    values = np.where(chosen, standard, np.nan)
    size = np.maximum(chosen.sum(axis=-1, keepdims=True), 1)
    return values, np.exp(-np.maximum(age, 0.0) / _MEMORY_DAYS) / size


def _shrunk_hours(total: np.ndarray, count: np.ndarray, n_days: np.ndarray) -> np.ndarray:
    """Smoothed means by slot (48,), shrunk towards the mean of that hour over all days, and that towards 1."""
    both = total.reshape(2, 24).sum(axis=0) / np.maximum(count.reshape(2, 24).sum(axis=0), 1)
    n_both = n_days.reshape(2, 24).sum(axis=0)
    hour = _smooth((n_both * both + _HOUR_DAYS) / (n_both + _HOUR_DAYS))
    own, n_own = (total / np.maximum(count, 1)).reshape(2, 24), n_days.reshape(2, 24)
    return np.concatenate([_smooth(day) for day in (n_own * own + _HOUR_DAYS * hour) / (n_own + _HOUR_DAYS)])


def _smooth(day: np.ndarray) -> np.ndarray:
    """Average each hour (weight 1/2) with its neighbours (1/4 each), around the clock."""
    return 0.25 * np.roll(day, 1) + 0.5 * day + 0.25 * np.roll(day, -1)


def weighted_quantiles(values: np.ndarray, weights: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """(n_levels,) quantiles of a weighted sample (n,), linear between the midpoints of the cumulative weights."""
    order = np.argsort(values, kind="stable")
    weight = weights[order]
    reached = np.cumsum(weight)
    return np.interp(levels, (reached - 0.5 * weight) / reached[-1], values[order])


def finite_sample_levels(levels: np.ndarray, n: float) -> np.ndarray:
    """Levels whose quantiles in a sample of size ``n`` cover the next value at ``levels``.

    The next value falls into each of the n + 1 gaps of the sample with equal probability, so the upper quantile of
    level p is the value of rank (n + 1) p (Vovk et al. 2005); lower ones mirror this, and the median stays.
    """
    upper, lower = levels * (n + 1) / n, 1.0 - (1.0 - levels) * (n + 1) / n
    return np.clip(np.where(levels > 0.5, upper, np.where(levels < 0.5, lower, levels)), 0.0, 1.0)
