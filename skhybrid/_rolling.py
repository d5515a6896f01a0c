"""Rolling-origin prediction, shared by all forecasters: origin row ``o`` knows rows up to and with ``o``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import RegressorMixin
from sklearn.metrics import r2_score
from sklearn.utils import Tags
from sklearn.utils.validation import _check_sample_weight, check_is_fitted

from ._joining import warn_if_unmeasured
from ._summary import SummaryMixin
from ._table import SCORED, ZoneTable, append_tables, fill_ahead, read_targets, refuse_gap, refuse_other_clock
from ._threads import one_blas_thread
from ._time import origin_rows, rows_of

#: forecasts (n_origins, n_leads, ...) of the rows after the given origins of a table
_Paths = Callable[..., np.ndarray]


def checked_origins(origins: Any, n_rows: int, n_before: int = 0) -> np.ndarray:
    """(n_origins,) row numbers of a table with ``n_rows`` rows, negative for the ``n_before`` known rows before it."""
    rows = np.asarray(origins)
    if not rows.size:
        rows = rows.astype(np.int64)
    if rows.ndim != 1 or rows.dtype.kind not in "iu" or (rows < -n_before).any() or (rows >= n_rows).any():
        before = rows.dtype.kind == "i" and (rows < 0).any() and not n_before
        cold = "; X does not continue the known rows, so that none lies before it" if before else ""
        raise ValueError(f"origins must be row numbers of X, from {-n_before} to {n_rows - 1}{cold}.")
    return rows.astype(np.int64)


def r2_of_measured(measured: np.ndarray, predicted: np.ndarray, sample_weight: Any) -> float:
    """Coefficient of determination by the rows (n,) or (n, n_measured) that were measured; refused without any."""
    seen = np.isfinite(measured).reshape(len(measured), -1).all(axis=1)
    if not seen.any():
        raise ValueError("y has no measured row to score by; give rows in which it was measured.")
    weight = None if sample_weight is None else _check_sample_weight(sample_weight, measured)[seen]
    return float(r2_score(measured[seen], predicted[seen], sample_weight=weight))


class RollingForecastMixin(SummaryMixin, RegressorMixin):
    """``predict``, ``predict_from`` and ``score``; a subclass sets ``horizon`` and ``_tail``, and has the hooks."""

    _tail: ZoneTable
    _mean: float  # of the training target
    _target_role = "T_za"  # of what is forecast
    _reads_clock = True  # whether forecasts depend on the hour of the day

    def _read_X(self, X: Any) -> ZoneTable:
        raise NotImplementedError

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """(n_origins, n_leads) forecasts of the rows origin + 1 ...; values after the last row do not matter."""
        raise NotImplementedError

    def _cold_value(self, table: ZoneTable) -> float:
        """Value of the first row of a table without history: the measured one, or the training mean."""
        first = float(table.measured(self._target_role)[0])
        return first if np.isfinite(first) else self._mean

    def _past_roles(self) -> tuple[str, ...]:
        """Roles of what is forecast, which are known in the past only."""
        return ("T_za",)

    def _column_of(self, role: str) -> Any:
        """The column that has a role in a frame."""
        return (getattr(self, "columns", None) or {}).get(role, role)

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_tail")  # fit sets it last

    @one_blas_thread
    def predict(self, X: Any) -> np.ndarray:
        """Forecast every row from the last origin before it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; measured history (``T_za``, ``zeta``) is read only up to each origin.  Columns are found
            by name.  Rows that follow the last known one need no history: all are forecast from that one.

        Returns
        -------
        ndarray of shape (n_samples,), float64
            One column per measured node where there are several.  With ``horizon=None`` the rows are simulated from
            the first one on.  Otherwise an origin begins every ``origin_step``, by default every ``horizon``, counted
            in local time from the midnight before the first row: every day with ``"1D"``, every day and a half with
            ``"36h"``.  A first row without history takes its measured value.  Where the estimator accepts long gaps,
            each segment is predicted by itself.
        """
        check_is_fitted(self)
        return self._predicted(self._read_X(X))

    def _predicted(self, table: ZoneTable) -> np.ndarray:
        """The forecasts of :meth:`predict`."""
        return np.concatenate([self._roll(part, self._forecast, self._cold_value) for part in table.segments])

    @one_blas_thread
    def predict_from(self, X: Any, origins: Sequence[int] | np.ndarray, horizon: Any = None) -> np.ndarray:
        """Forecast the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; history is read only up to each origin.
        origins : sequence of int
            Row numbers of X; -1 is the last known row, where X follows it.
        horizon : timedelta-like, optional
            How far ahead; default is the estimator's own, or one day.

        Returns
        -------
        ndarray of shape (n_origins, n_leads), float64
            Forecasts of the rows ``origin + 1, origin + 2, ...``; NaN after the last row of X.
        """
        return self._paths_from(X, origins, horizon, self._forecast, ())

    @one_blas_thread
    def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
        """Coefficient of determination of :meth:`predict`; rows without a measurement are left out.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : array-like of shape (n_samples,) or (n_samples, n_measured)
            Measured values, NaN where missing; several columns of a frame are found by role.
        sample_weight : array-like of shape (n_samples,), optional

        Raises
        ------
        ValueError
            If no row of ``y`` was measured, or X or ``y`` cannot be read.
        """
        check_is_fitted(self)
        table = self._read_X(X)
        predicted = self._predicted(table)
        measured = self._read_target(y, table)
        return r2_of_measured(measured, predicted, sample_weight)

    def _read_target(self, y: Any, table: ZoneTable) -> np.ndarray:
        """(n_rows,) or (n_rows, n_measured) measured values, of which any may be missing."""
        return read_targets(y, table, self._past_roles(), max_missing=SCORED)

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        # scikit-learn's checks draw rows that are not consecutive time steps, where the past says nothing
        tags.regressor_tags.poor_score = True
        return tags

    def _roll(self, segment: ZoneTable, paths_of: _Paths, first_of: Callable[[ZoneTable], Any]) -> np.ndarray:
        """(n_rows, ...) forecasts of a segment, each row from the last origin before it."""
        table, n_tail = self._after_tail(segment)
        self._refuse_lost_past(segment, n_tail)
        origins, leads = self._rolled_origins(segment, n_tail)
        if not leads.max():  # a single row without history
            return np.array([first_of(segment)], dtype=np.float64)
        paths = self._paths_in(table, n_tail, origins, int(leads.max()), paths_of)
        out = np.full((segment.n_rows, *paths.shape[2:]), np.nan)
        if not n_tail:
            out[0] = first_of(segment)
        for origin, count, path in zip(origins, leads, paths, strict=True):
            out[origin + 1 : origin + 1 + count] = path[:count]
        return out

    def _rolled_origins(self, segment: ZoneTable, n_tail: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows of a segment that are origins of ``predict``, and the number of rows that each of them covers."""
        self._check_spans(segment.step)  # which may have been set since ``fit``
        origins = origin_rows(segment.time, self.horizon, getattr(self, "origin_step", None), segment.step)
        if n_tail:  # the row before the segment is an origin too: it forecasts the first row
            past = [segment.history[role] for role in self._past_roles() if role in segment.history]
            measured = any(np.isfinite(values).any() for values in past)
            origins = np.concatenate([[-1], origins]) if measured else np.array([-1])
        return origins, np.append(origins[1:], segment.n_rows - 1) - origins

    def rolled_origins(self, X: Any) -> tuple[np.ndarray, np.ndarray]:
        """Rows of X from which :meth:`predict` forecasts, and the number of rows that each of them covers.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows without gaps.

        Returns
        -------
        origins, counts : ndarray of shape (n_origins,), int
            -1 is the last known row, where X follows it.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        self._refuse_lost_past(table, n_tail)
        return self._rolled_origins(table.rows(slice(n_tail, None)), n_tail)

    def _paths_from(
        self,
        X: Any,
        origins: Sequence[int] | np.ndarray,
        horizon: Any,
        paths_of: _Paths,
        shape: tuple[int, ...],
        boundary: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> np.ndarray:
        """(n_origins, n_leads, *shape) forecasts from given rows of X; NaN after its last row."""
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        self._refuse_lost_past(table, n_tail)
        n_here = table.n_rows - n_tail
        rows = checked_origins(origins, n_here, min(n_tail, 1))
        n_leads = self._leads(horizon, table.step)
        if not len(rows):
            return np.empty((0, n_leads, *shape))
        paths = self._paths_in(table, n_tail, rows, n_leads, paths_of, boundary)
        paths[rows[:, None] + np.arange(1, n_leads + 1) >= n_here] = np.nan
        return paths

    def _paths_in(
        self,
        table: ZoneTable,
        n_tail: int,
        origins: np.ndarray,
        n_leads: int,
        paths_of: _Paths,
        boundary: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> np.ndarray:
        """(n_origins, n_leads, ...) forecasts from rows of a table that come after its history of ``n_tail`` rows."""
        found, chosen = [], []
        for part, rows, of in self._parts(table, n_tail, origins):
            given = {"boundary": {role: values[of] for role, values in boundary.items()}} if boundary else {}
            found.append(np.asarray(paths_of(part, rows, n_leads, **given), dtype=np.float64))
            chosen.append(of)
        return np.concatenate(found)[np.argsort(np.concatenate(chosen))]

    def _parts(
        self, table: ZoneTable, n_tail: int, origins: np.ndarray
    ) -> Iterator[tuple[ZoneTable, np.ndarray, np.ndarray]]:
        """Tables from which some origins are forecast, their rows there, and which they are.

        From the last known row on, a table that begins with known rows follows these.  To earlier rows it is another
        history, from which a forecast may not know what came later.
        """
        n_known = 0 if n_tail else self._n_known(table)
        late = (origins >= n_known - 1) & (0 < n_known < table.n_rows)
        if not late.all():
            yield table, origins[~late] + n_tail, np.flatnonzero(~late)
        if late.any():
            part, n_tail = self._after_tail(table.rows(slice(n_known, None)))
            yield part, origins[late] - n_known + n_tail, np.flatnonzero(late)

    def _n_known(self, table: ZoneTable) -> int:
        """Number of the first rows of a table that are known already."""
        return 0

    def _refuse_lost_past(self, table: ZoneTable, n_tail: int) -> None:
        """Refuse rows without the history that the training table had, where they do not follow the known rows.

        Where nothing of it was measured, warn.
        """
        names = [self._column_of(role) for role in self._past_roles() if role not in table.history]
        lost = [name for name in names if name in getattr(self, "feature_names_in_", ())]
        if lost and not n_tail:
            other = "; for rows ahead of a history there is forecast(history, future)" * hasattr(self, "forecast")
            raise ValueError(
                f"X has no column {lost[0]!r} and does not begin one step after the last known row; give what was "
                f"measured, NaN where nothing was{other}."
            )
        if not n_tail:
            warn_if_unmeasured(table, self._past_roles(), self._column_of)

    def _check_spans(self, step: pd.Timedelta) -> None:
        """Refuse spans that are no multiples of the step, or an ``origin_step`` that leaves rows beyond the horizon."""
        spans = {name: getattr(self, name, None) for name in ("horizon", "origin_step")}
        rows = {name: rows_of(span, step, name) for name, span in spans.items() if span is not None}
        if len(rows) == 2 and rows["origin_step"] > rows["horizon"]:
            raise ValueError(
                f"origin_step={spans['origin_step']!r} is longer than horizon={self.horizon!r}, so predict would reach "
                "beyond the horizon; give a shorter origin_step, or leave it out."
            )

    def _leads(self, horizon: Any, step: pd.Timedelta) -> int:
        """Number of rows of a horizon, or of the estimator's own where it is None."""
        return self._leads_of_horizon(step) if horizon is None else rows_of(horizon, step)

    def _leads_of_horizon(self, step: pd.Timedelta) -> int:
        """Number of rows of the horizon, or of one day where it is None."""
        return rows_of("1D" if self.horizon is None else self.horizon, step)

    def _with_history(self, X: Any) -> tuple[ZoneTable, int]:
        """X, which must have no gap, after its history; and the number of rows of that history."""
        table = self._read_X(X)
        refuse_gap(table)
        return self._after_tail(table)

    def _load_rows(self, X: Any, plant: Iterable[str]) -> tuple[ZoneTable, int, np.ndarray]:
        """X after its history, the number of rows of that, and the origins in X of a load.

        No origin comes after the row from which heating or cooling (the roles ``plant``) is missing to the end.
        """
        fitted = getattr(getattr(self, "preprocess_", None) or self, "feature_names_in_", ())
        names = [self._column_of(role) for role in plant]
        filled, n_known = fill_ahead(X, [name for name in names if name in fitted])
        table, n_tail = self._with_history(filled)
        self._refuse_lost_past(table, n_tail)
        origins = origin_rows(table.time[n_tail:], self.horizon, getattr(self, "origin_step", None), table.step)
        return table, n_tail, origins[origins <= n_known]

    def _after_tail(self, table: ZoneTable) -> tuple[ZoneTable, int]:
        """A table after the end of the training table, where it continues it; and the number of rows before it."""
        tail = getattr(self, "_tail", None)
        if tail is not None and self._reads_clock:
            refuse_other_clock(table, tail)
        if tail is not None and table.follows(tail):
            return append_tables(tail, table), tail.n_rows
        return table, 0
