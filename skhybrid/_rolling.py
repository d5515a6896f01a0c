"""Rolling-origin prediction, the meaning of ``predict`` that every forecaster of this package shares (design 2).

A forecast from origin row ``o`` knows every row up to and including ``o`` and, of later rows, the known future inputs.
It covers the rows ``o + 1 ... o + n_leads``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import RegressorMixin
from sklearn.metrics import r2_score
from sklearn.utils import Tags
from sklearn.utils.validation import check_is_fitted

from ._table import ZoneTable, append_tables
from ._threads import one_blas_thread
from ._time import origin_rows, rows_of


class RollingForecastMixin(RegressorMixin):
    """``predict`` and ``predict_from`` over one hook.

    A subclass sets ``horizon`` (and may set ``origin_step``), keeps the end of its training table in ``_tail``, and
    gives the hooks ``_read_X``, ``_forecast`` and ``_cold_value``.
    """

    horizon: Any
    _tail: ZoneTable

    # ------------------------------------------------------------------------------------------------------- hooks
    def _read_X(self, X: Any) -> ZoneTable:
        raise NotImplementedError

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """(n_origins, n_leads) forecasts of the rows origin + 1 ...; anything at rows beyond the table."""
        raise NotImplementedError

    def _cold_value(self, table: ZoneTable) -> float:
        """Value of the first row of a table that has no history: what is known there, or the training mean."""
        raise NotImplementedError

    def __sklearn_is_fitted__(self) -> bool:
        # a refused fit leaves what it read of X's columns: only the end of a fit makes a forecaster
        return hasattr(self, "_tail")

    # ------------------------------------------------------------------------------------------------------ public
    @one_blas_thread
    def predict(self, X: Any) -> np.ndarray:
        """Forecast every row from the last origin before it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; measured history (``T_za``, ``zeta``) is read only up to each origin.

        Returns
        -------
        ndarray of shape (n_samples,), float64
            A column each where several nodes are measured.  With ``horizon=None`` simulated from the first row on;
            else rolled, with an origin at the start of each local day (and of each ``origin_step``).  A first row
            without history is taken as known.  Segments of rows that a long gap parts are predicted each by itself,
            where the estimator takes them.
        """
        check_is_fitted(self)
        return np.concatenate([self._predict_segment(segment) for segment in self._read_X(X).segments])

    def _predict_segment(self, segment: ZoneTable) -> np.ndarray:
        table, n_tail = self._after_tail(segment)
        here = table.rows(slice(n_tail, None))
        origins, leads = self._rolled_origins(table, n_tail)
        if not leads.max():
            return np.array([self._cold_value(here)], dtype=np.float64)
        paths = np.asarray(self._forecast(table, origins, int(leads.max())))
        out = np.full((here.n_rows, *paths.shape[2:]), np.nan)
        if not n_tail:
            out[0] = self._cold_value(here)
        for origin, count, path in zip(origins - n_tail, leads, paths, strict=True):
            out[origin + 1 : origin + 1 + count] = path[:count]
        return out

    def _rolled_origins(self, table: ZoneTable, n_tail: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows of a table that are origins of ``predict``, and how many rows each of them covers."""
        here = table.rows(slice(n_tail, None))
        origins = origin_rows(here.time, self.horizon, getattr(self, "origin_step", None), here.step)
        if self.horizon is not None:
            rows_of(self.horizon, here.step)
        if n_tail:  # the row before X is an origin too: it forecasts the first row
            origins = np.concatenate([[-1], origins])
        return origins + n_tail, np.append(origins[1:], here.n_rows - 1) - origins

    @one_blas_thread
    def predict_from(self, X: Any, origins: Sequence[int] | np.ndarray, horizon: Any = None) -> np.ndarray:
        """Forecast the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; history is read only up to each origin.
        origins : sequence of int
            Row numbers of X.
        horizon : timedelta-like, optional
            How far ahead; default is the estimator's own, or one day.

        Returns
        -------
        ndarray of shape (n_origins, n_leads), float64
            Forecasts of the rows ``origin + 1, origin + 2, ...``; NaN where X has ended.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        rows, n_leads = self._checked_origins(table, n_tail, origins, horizon)
        if not len(rows):
            return np.empty((0, n_leads))
        paths = np.array(self._forecast(table, rows + n_tail, n_leads), dtype=np.float64)
        paths[rows[:, None] + np.arange(1, n_leads + 1) >= table.n_rows - n_tail] = np.nan
        return paths

    def _checked_origins(
        self, table: ZoneTable, n_tail: int, origins: Sequence[int] | np.ndarray, horizon: Any
    ) -> tuple[np.ndarray, int]:
        """Row numbers of X as an array, and how many rows a horizon is."""
        rows = np.asarray(origins)
        n_here = table.n_rows - n_tail
        if not rows.size:
            rows = rows.astype(np.int64)
        if rows.ndim != 1 or rows.dtype.kind not in "iu" or (rows < 0).any() or (rows >= n_here).any():
            raise ValueError(f"origins must be row numbers of X, from 0 to {n_here - 1}.")
        span = horizon if horizon is not None else (self.horizon if self.horizon is not None else "1D")
        return rows, rows_of(span, table.step)

    def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
        """Coefficient of determination of :meth:`predict`; rows without a measurement are left out.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : array-like of shape (n_samples,)
            Measured values, NaN where missing.
        sample_weight : array-like of shape (n_samples,), optional

        Returns
        -------
        float
        """
        predicted = self.predict(X)
        measured = np.asarray(y, dtype=np.float64).reshape(predicted.shape)
        seen = np.isfinite(measured).reshape(len(measured), -1).all(axis=1)
        weight = None if sample_weight is None else np.asarray(sample_weight)[seen]
        return float(r2_score(measured[seen], predicted[seen], sample_weight=weight))

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        # rows of a scikit-learn check are not consecutive time steps, so that no past says anything about them
        tags.regressor_tags.poor_score = True
        return tags

    def _check_spans(self, step: pd.Timedelta) -> None:
        """Refuse a horizon or an ``origin_step`` that is not a multiple of the step."""
        for name in ("horizon", "origin_step"):
            span = getattr(self, name, None)
            if span is not None:
                rows_of(span, step, name)

    def _with_history(self, X: Any) -> tuple[ZoneTable, int]:
        """X as one segment, behind the kept end of the training table where it follows that; and the rows of that."""
        table = self._read_X(X)
        if len(table.breaks) > 1:
            row = table.breaks[1]
            raise ValueError(
                f"X has a gap: {table.index[row - 1]} is followed by {table.index[row]}; give one segment at a time."
            )
        return self._after_tail(table)

    def _after_tail(self, table: ZoneTable) -> tuple[ZoneTable, int]:
        tail = getattr(self, "_tail", None)
        if tail is not None and table.follows(tail):
            return append_tables(tail, table), tail.n_rows
        return table, 0
