"""``predict_quantiles`` for rolling forecasters, and errors on data that a forecaster was not fitted on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from sklearn.utils.validation import check_is_fitted

from .._calendar import day_type_hour
from .._last_known import last_known_row
from .._rolling import RollingForecastMixin
from .._table import ZoneTable, as_numbers
from .._threads import one_blas_thread
from .._time import rows_per_day
from ..exceptions import TooFewDaysError
from .features import held_target_rows, known_before, target_rows
from .intervals import DAYS_BACK, LEAST_ERRORS, LeadIntervals, PathClock
from .weather_error import WeatherError, read_weather_error, weather_spreads

INTERVAL = (0.1, 0.9)  # quantiles of the intervals that are shown: 80 % lie between them
DEFAULT_QUANTILES = (INTERVAL[0], 0.5, INTERVAL[1])
_DAYS_PER_BLOCK = 7
_MIN_BLOCKS = 3
_ORIGINS_PER_DAY = 8  # origins per day whose errors are learned from: each lead then meets every third hour of the day


class LeftOut(NamedTuple):
    """Errors of forecasts in blocks of a training table, each by a fit without that block."""

    errors: np.ndarray  # (n_origins, n_leads) measured - forecast; NaN where unknown
    origins: np.ndarray  # (n_origins,) rows of the training table


class QuantileForecastMixin(RollingForecastMixin):
    """``predict_quantiles``; ``fit`` sets ``_intervals``, None where it was too short or did not learn them."""

    _intervals: LeadIntervals | None
    _no_intervals = (
        "the training table was too short to learn intervals from; fit on two days or more, with T_za measured."
    )

    def _first_past(self, table: ZoneTable) -> int:
        """The first row of a table whose forecasts tell about the present: the first one after the training."""
        return table.n_history

    @property
    def intervals_(self) -> LeadIntervals:
        """Intervals learned from errors on left-out training data."""
        check_is_fitted(self)
        if self._intervals is None:  # the error is an AttributeError too: dir() and hasattr() ask for it
            unwanted = "no intervals were learned with intervals=False; fit again with intervals=True."
            raise TooFewDaysError(self._no_intervals if getattr(self, "intervals", True) else unwanted)
        return self._intervals

    @one_blas_thread
    def predict_quantiles(
        self, X: Any, quantiles: Sequence[float] = DEFAULT_QUANTILES, *, weather_error: Any = None
    ) -> np.ndarray:
        """Forecast quantiles of every row from the last origin before it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            As in :meth:`predict`.  Errors of forecasts before an origin set how wide its intervals are.
        quantiles : sequence of float, default (0.1, 0.5, 0.9)
            In (0, 1), increasing.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default None
            How far the weather in X after an origin may be off, which widens the intervals; None: it was measured.

        Returns
        -------
        ndarray of shape (n_samples, n_quantiles), float64
            Increasing along each row.  The median is the forecast, shifted by its recent errors.

        Raises
        ------
        ValueError
            If the quantiles do not increase within (0, 1), or ``weather_error`` is no level.
        TooFewDaysError
            If no intervals were learned, because the training table was too short or ``intervals=False``.
        """
        check_is_fitted(self)
        levels = read_quantiles(quantiles)
        paths_of = partial(self._quantile_paths, levels=levels, weather=read_weather_error(weather_error))
        first_of = partial(self._first_quantiles, levels=levels)
        return np.concatenate([self._roll(segment, paths_of, first_of) for segment in self._read_X(X).segments])

    def _first_quantiles(self, segment: ZoneTable, levels: np.ndarray) -> np.ndarray:
        """Quantiles of the first row of a segment without history: its measured value, or a wide interval."""
        value = self._cold_value(segment)
        if np.isfinite(segment.measured()[0]):
            return np.full(len(levels), value)
        return value + self.intervals_.offsets(path_clock(segment, np.array([-1]), 1), levels)[0]

    @one_blas_thread
    def predict_quantiles_from(
        self,
        X: Any,
        origins: Sequence[int] | np.ndarray,
        quantiles: Sequence[float] = DEFAULT_QUANTILES,
        horizon: Any = None,
        *,
        weather_error: Any = None,
    ) -> np.ndarray:
        """Forecast quantiles of the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        origins : sequence of int; row numbers of X
        quantiles : sequence of float, default (0.1, 0.5, 0.9); in (0, 1), increasing
        horizon : timedelta-like, optional
        weather_error : {None, "low", "medium", "high"} or WeatherError, default None

        Returns
        -------
        ndarray of shape (n_origins, n_leads, n_quantiles), float64
            Quantiles of the rows ``origin + 1, origin + 2, ...``; NaN after the last row of X.

        Raises
        ------
        ValueError, TooFewDaysError
            As :meth:`predict_quantiles`; also if an origin is no row of X.
        """
        levels = read_quantiles(quantiles)
        paths_of = partial(self._quantile_paths, levels=levels, weather=read_weather_error(weather_error))
        return self._paths_from(X, origins, horizon, paths_of, levels.shape)

    def _quantile_paths(self, table: ZoneTable, origins: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        """(n_origins, n_leads, n_levels) quantiles of the rows origin + 1 ...; see :meth:`_quantile_offsets`."""
        paths, offsets = self._quantile_offsets(table, origins, *args, **kwargs)
        return paths[..., None] + offsets

    def _quantile_offsets(
        self,
        table: ZoneTable,
        origins: np.ndarray,
        n_leads: int,
        levels: np.ndarray,
        weather: WeatherError | None = None,
        paths: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Forecasts (n_origins, n_leads), and what their quantiles have beyond them (n_origins, n_leads, n_levels).

        The table has its history; forecasts ``paths`` that are known are not made again.
        """
        intervals, per_day = self.intervals_, rows_per_day(table.step)
        # forecasts made whole days before an origin have the same hour at the same lead
        earlier = origins[:, None] - per_day * np.arange(1, DAYS_BACK + 1)
        past = np.unique(earlier[earlier >= self._first_past(table)])
        if paths is None:  # from the origins and from the earlier rows in one call
            every, where = np.unique(np.concatenate([origins, past]), return_inverse=True)
            both = self._forecast(table, every, max(n_leads, per_day))[where]
            paths, past_paths = both[: len(origins), :n_leads], both[len(origins) :, :per_day]
        else:
            past_paths = self._forecast(table, past, per_day) if len(past) else np.empty((0, per_day))
        errors = measured_ahead(table, past, per_day) - past_paths
        clock, past_clock = path_clock(table, origins, n_leads), path_clock(table, past, per_day)
        further: Any = None
        if weather is not None and len(origins):
            further = self._weather_spread(weather, table, origins, n_leads)
        out = np.empty((*paths.shape, len(levels)))
        for i, origin in enumerate(origins):
            own = np.flatnonzero(np.isin(past, earlier[i]))
            now = origin * table.step_hours / 24.0
            recent = (errors[own], past_clock.rows(own))
            factor = intervals.factor_at(recent, now)
            wider = None if further is None else further[i]
            out[i] = intervals.offsets(clock.rows(slice(i, i + 1)), levels, recent, now, wider, factor)
        return paths, out

    def _weather_spread(self, weather: WeatherError, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """(n_origins, n_leads) standard deviation of what errors of the weather change [K]."""
        return weather_spreads(weather, table, origins, n_leads, partial(self._each_path, n_leads=n_leads))[:, 0]

    def _each_path(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        """(n_tables, 1, n_leads) forecasts from one origin of tables that differ after it only."""
        return np.array([self._forecast(table, np.array([origin]), n_leads) for table in tables])


def read_quantiles(quantiles: Sequence[float] | np.ndarray) -> np.ndarray:
    """Quantiles as an array (n_quantiles,), which must increase within (0, 1)."""
    try:
        levels = np.atleast_1d(as_numbers(quantiles, "quantiles"))
    except ValueError:  # words, or rows of unequal lengths
        levels = np.empty(0)
    if levels.ndim != 1 or not levels.size or not ((levels > 0) & (levels < 1)).all() or (np.diff(levels) <= 0).any():
        raise ValueError(f"quantiles={quantiles!r} must be numbers between 0 and 1, in increasing order.")
    return levels


def quantile_columns(levels: Sequence[float] | np.ndarray) -> list[str]:
    """Names of the columns that hold quantiles: ``q_0.1`` ..."""
    return [f"q_{level:g}" for level in np.atleast_1d(levels)]


def quantile_levels(columns: Iterable[object]) -> dict[str, float]:
    """Levels of the columns that :func:`quantile_columns` names, by name and increasing; others are left out."""
    named = (found for name in columns if (found := re.fullmatch(r"q_(\d*\.?\d+(?:e-\d+)?)", str(name))))
    levels = {found[0]: float(found[1]) for found in named if 0.0 < float(found[1]) < 1.0}
    return dict(sorted(levels.items(), key=lambda item: item[1]))


def load_quantile_columns(levels: Sequence[float] | np.ndarray) -> list[str]:
    """The same of the whole load: ``Q_hvac_0.1`` ..."""
    return [name.replace("q_", "Q_hvac_", 1) for name in quantile_columns(levels)]


def path_clock(table: ZoneTable, origins: np.ndarray, n_leads: int) -> PathClock:
    """Leads (since the last measurement), hours and days of the rows after each origin (-1: before the first row)."""
    long_ago = -rows_per_day(table.step)
    last = last_known_row(np.isfinite(table.measured()), long_ago)
    seen = np.where(origins < 0, long_ago, last[np.maximum(origins, 0)])
    rows = target_rows(origins, n_leads)
    slots = day_type_hour(table)[held_target_rows(table, origins, n_leads)]
    return PathClock((rows - seen[:, None]) * table.step_hours, slots, rows * table.step_hours / 24.0)


def measured_ahead(table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
    """(n_origins, n_leads) measurements of the rows after each origin; NaN where there is none."""
    return known_before(table.measured(), target_rows(origins, n_leads), table.n_rows)


def intervals_from(left_out: LeftOut, table: ZoneTable) -> LeadIntervals | None:
    """Intervals learned from errors on left-out parts of a training table with its target as history; None: too few."""
    if np.isfinite(left_out.errors).sum() < LEAST_ERRORS:
        return None
    return LeadIntervals().fit(left_out.errors, path_clock(table, left_out.origins, left_out.errors.shape[1]))


def left_out_blocks(n_rows: int, per_day: int) -> list[tuple[int, int]]:
    """Blocks (begin, end) of rows to leave out in turn: weeks, or thirds of a table of less than three weeks."""
    n_blocks = max(_MIN_BLOCKS, round(n_rows / (_DAYS_PER_BLOCK * per_day)))
    return list(pairwise(np.linspace(0, n_rows, n_blocks + 1).astype(int).tolist()))


def block_origins(block: tuple[int, int], per_day: int) -> np.ndarray:
    """Rows of a block that are origins: every third hour, at the same hours in every block."""
    apart = max(1, per_day // _ORIGINS_PER_DAY)
    rows = np.arange(*block)
    return rows[(rows % apart == 0) & (rows < block[1] - 1)]


def joined_blocks(found: Sequence[LeftOut]) -> LeftOut:
    """The errors of several blocks as one."""
    if not found:
        return LeftOut(np.empty((0, 1)), np.empty(0, dtype=np.int64))
    return LeftOut(np.concatenate([f.errors for f in found]), np.concatenate([f.origins for f in found]))


def errors_inside(target: np.ndarray, origins: np.ndarray, paths: np.ndarray, end: int) -> np.ndarray:
    """Errors of paths, NaN from the end of their block on: the forecaster was fitted on those rows."""
    return known_before(target, target_rows(origins, paths.shape[1]), end) - paths
