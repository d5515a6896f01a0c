"""The black box that a data scientist would write instead of a gray box: ARX on the temperature itself."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.linalg import solve
from sklearn.base import BaseEstimator, RegressorMixin

from .._table import ZoneTable, read_table, read_target
from .._threads import one_blas_thread
from .._time import rows_of
from .._transaction import unchanged_on_failure
from ..filtering import iterate_lags
from .features import day_type_hour, one_hot, rows_per_day, target_rows
from .intervals import LEAST_ERRORS, LeadIntervals
from .quantiles import (
    LeftOut,
    QuantileForecastMixin,
    block_origins,
    intervals_from,
    left_out_blocks,
    measured_ahead,
)

_ALPHAS = (0.1, 1.0, 10.0, 100.0, 1000.0)
_DEFAULT_ALPHA = 10.0
_MOST_BLOCKS = 6
_LEAST_KNOWN = 0.5
#: penalty of the constant, which is free: only where no pair is known it keeps the equations regular
_FREE = 1e-9


class _Moments(NamedTuple):
    """Sums over (k, k + 1) pairs of rows: they add over rows, which is what makes refitting cheap."""

    gram: np.ndarray  # (p, p)
    cross: np.ndarray  # (p,)

    def plus(self, D: np.ndarray, d: np.ndarray, sign: float = 1.0) -> _Moments:
        return _Moments(self.gram + sign * (D.T @ D), self.cross + sign * (D.T @ d))

    def ridge(self, penalty: np.ndarray) -> np.ndarray:
        """Coefficients (p,) under the penalty's diagonal (p,)."""
        return solve(self.gram + np.diag(penalty), self.cross, assume_a="pos")


class ARXData(NamedTuple):
    """The rows of a table as the regression sees them, known by their numbers from ``first`` on."""

    exogenous: np.ndarray  # (n_rows, p - n_lags) standardised inputs with lags, calendar and constant
    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    held: np.ndarray  # (n_rows,) the same with the last known one where missing
    first: int

    @property
    def end(self) -> int:
        """The row behind the last one."""
        return self.first + len(self.T)


class ARXRegressor(QuantileForecastMixin, RegressorMixin, BaseEstimator):
    """Ridge regression of the temperature step on lags, iterated over the horizon.

    ``T[k + 1] - T[k]`` is regressed on ``n_lags`` temperatures up to ``T[k]``, on ``n_input_lags`` rows of every input
    up to row k, and on hour x weekday/weekend dummies.  It is the rival that a gray box must beat; re-fitted at each
    origin (``adapt="refit"``) it is the one to name.

    Parameters
    ----------
    horizon : timedelta-like or None, default "1D"
        How far ahead ``predict`` looks; None simulates from the first row on.
    adapt : {None, "refit"}, default None
        ``"refit"`` re-solves the regression at each origin from the training pairs and all pairs known at the origin.
    n_lags : int, default 24
        Rows of temperature.
    n_input_lags : int, default 8
        Rows of every input.
    calendar : bool, default True
        Whether to use hour x weekday/weekend dummies.
    alpha : float, optional
        Penalty on standardised columns.  Default: of 0.1, 1, 10, 100, 1000 the one with the least forecast error over
        the horizon in blocks of the training table that are left out in turn; 10 where the table is too short for that.
    origin_step : timedelta-like, optional
        Distance of origins in ``predict``; default ``horizon``.
    columns : mapping of role to column, optional
        Overrides the names of the columns of X.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps; default 15 min.
    max_missing : float, default 0.5
        Largest share of missing temperatures in ``y``.

    Attributes
    ----------
    coef_ : ndarray of shape (n_columns,)
        Coefficients of the standardised columns: temperatures (the newest first), inputs, calendar, constant.
    alpha_ : float
        The penalty.
    input_names_ : list of str
        Roles of the inputs, in the order of ``coef_``.
    sampling_time_ : Timedelta
        Step of the training table.
    n_features_in_ : int
        Columns of X.
    feature_names_in_ : ndarray of str
        Their names, where X has names.
    """

    def __init__(
        self,
        horizon: Any = "1D",
        adapt: str | None = None,
        *,
        n_lags: int = 24,
        n_input_lags: int = 8,
        calendar: bool = True,
        alpha: float | None = None,
        origin_step: Any = None,
        columns: Mapping[str, Any] | None = None,
        sampling_time: Any = None,
        max_missing: float = 0.5,
    ) -> None:
        self.horizon = horizon
        self.adapt = adapt
        self.n_lags = n_lags
        self.n_input_lags = n_input_lags
        self.calendar = calendar
        self.alpha = alpha
        self.origin_step = origin_step
        self.columns = columns
        self.sampling_time = sampling_time
        self.max_missing = max_missing

    # ------------------------------------------------------------------------------------------------------------ fit
    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> Self:
        """Fit the regression.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Inputs by role; a column ``T_za`` is not read here.
        y : Series or array-like of shape (n_samples,)
            Zone temperature [degC], NaN where missing.

        Returns
        -------
        ARXRegressor
            Itself.

        Raises
        ------
        ValueError
            If a parameter, the table or the target is refused (design 9).
        """
        self._check_parameters()
        table = read_table(self, X, columns=self.columns, sampling_time=self.sampling_time, reset=True, min_rows=3)
        T = read_target(y, table, max_missing=self.max_missing, role="T_za")
        self._check_spans(table.step)
        self.input_names_ = list(table.inputs)
        self.sampling_time_ = table.step
        self._set_scales(table, T)
        view = self.view(table, T)
        D, d, rows = self._pairs(view)
        self._moments = _Moments(np.zeros((D.shape[1],) * 2), np.zeros(D.shape[1])).plus(D, d)
        self.alpha_ = float(self.alpha) if self.alpha is not None else self._choose_alpha(view, D, d, rows)
        self.coef_ = self._moments.ridge(self._penalty(self.alpha_))
        self._intervals = self._left_out_intervals(table.replace(history={"T_za": T}))
        self._tail = table.rows(slice(-self._warmup, None)).replace(history={"T_za": T[-self._warmup :]})
        return self

    def _check_parameters(self) -> None:
        if self.adapt not in (None, "refit"):
            raise ValueError(f"adapt={self.adapt!r} is not known; use None or 'refit'.")
        for name in ("n_lags", "n_input_lags"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
                raise ValueError(f"{name}={value!r} is not a whole number from 1.")
        if self.alpha is not None and not self.alpha > 0:
            raise ValueError(f"alpha={self.alpha!r} is not a positive penalty.")

    def _set_scales(self, table: ZoneTable, T: np.ndarray) -> None:
        """Means and spreads of the training table, kept for good: a refit moves coefficients, not units."""
        known = T[np.isfinite(T)]
        self._T_mean, self._T_scale = float(known.mean()), max(float(known.std()), 1e-3)
        # A linear recursion can run away where the data say little: nothing far outside what was seen is forecast.
        reach = 3.0 * max(float(np.ptp(known)), 1.0)
        self._T_range = (float(known.min()) - reach, float(known.max()) + reach)
        numbers = self._lagged_inputs(table)
        spread = numbers.std(axis=0)
        self._input_mean = numbers.mean(axis=0)
        self._input_scale = np.where(spread > 1e-9, spread, np.inf)  # a constant input has no effect

    @property
    def _warmup(self) -> int:
        return max(int(self.n_lags), int(self.n_input_lags)) + 1

    # -------------------------------------------------------------------------------------------------------- columns
    def _lagged_inputs(self, table: ZoneTable) -> np.ndarray:
        """(n_rows, n_inputs * n_input_lags); rows before the first are held at it."""
        rows = np.arange(table.n_rows)
        lags = [np.maximum(rows - lag, 0) for lag in range(self.n_input_lags)]
        columns = [table.inputs[role][chosen] for role in self.input_names_ for chosen in lags]
        return np.column_stack(columns) if columns else np.empty((table.n_rows, 0))

    def view(self, table: ZoneTable, T: np.ndarray, first: int = 0) -> ARXData:
        """A table as the regression sees it.

        Parameters
        ----------
        table : ZoneTable
        T : ndarray of shape (n_rows,)
            Its measured temperature [degC], NaN where missing.
        first : int
            Number of its first row.

        Returns
        -------
        ARXData
        """
        blocks = [(self._lagged_inputs(table) - self._input_mean) / self._input_scale]
        if self.calendar:
            blocks.append(one_hot(day_type_hour(table.time), 48))
        return ARXData(np.hstack([*blocks, np.ones((table.n_rows, 1))]), T, _held(T), first)

    def _pairs(
        self, view: ARXData, begin: int = 0, end: int | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Columns (m, p), temperature steps (m,) and first rows (m,) of pairs (k, k + 1) of measured temperatures.

        Of the rows k from ``begin`` on, before ``end``.  A lag that is missing is held at the one before it, as in a
        forecast; of most lags, some must be known.
        """
        earliest = min(self.n_lags, view.end - 1) - 1
        rows = np.arange(max(begin, earliest), view.end - 1 if end is None else min(end, view.end - 1))
        here = rows - view.first
        steps = view.T[here + 1] - view.T[here]
        known = np.isfinite(self._windows(view, view.T, rows)).mean(axis=1)
        windows = _causally_filled(self._windows(view, view.held, rows), self._T_mean)
        use = (known >= _LEAST_KNOWN) & np.isfinite(steps)
        D = np.hstack([(windows[use] - self._T_mean) / self._T_scale, view.exogenous[here[use]]])
        return D, steps[use], rows[use]

    def _windows(self, view: ARXData, T: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(n_rows, n_lags) temperatures at and before rows, newest first; row 0 stands for those before."""
        return T[np.maximum(rows[:, None] - np.arange(self.n_lags), 0) - view.first]

    def _penalty(self, alpha: float) -> np.ndarray:
        penalty = np.full(len(self._moments.cross), alpha)
        penalty[-1] = _FREE
        return penalty

    # -------------------------------------------------------------------------------------------------------- penalty
    def _choose_alpha(self, view: ARXData, D: np.ndarray, d: np.ndarray, rows: np.ndarray) -> float:
        """The penalty with the least forecast error in left-out blocks of time, each at least two horizons long."""
        n_leads = rows_of(self.horizon if self.horizon is not None else "1D", self.sampling_time_)
        n_blocks = min(_MOST_BLOCKS, view.end // (2 * n_leads))
        if n_blocks < 3:
            return _DEFAULT_ALPHA
        edges = np.linspace(0, view.end, n_blocks + 1).astype(np.int64)
        errors = np.zeros(len(_ALPHAS))
        for start, stop in pairwise(edges):
            inside = (rows >= start) & (rows < stop)
            rest = self._moments.plus(D[inside], d[inside], sign=-1.0)
            origins = np.arange(start, stop - n_leads, max(1, n_leads // 6))
            truth = view.T[target_rows(origins, n_leads)]
            for i, alpha in enumerate(_ALPHAS):
                paths = self.iterate(view, origins, n_leads, rest.ridge(self._penalty(alpha))[None, :])
                errors[i] += np.nansum((paths - truth) ** 2)
        return _ALPHAS[int(np.argmin(errors))]

    def left_out_paths(
        self, table: ZoneTable, T: np.ndarray, origins: np.ndarray, n_leads: int, blocks: np.ndarray
    ) -> np.ndarray:
        """Forecasts within the training table, each by coefficients that were fitted without its block of time.

        Parameters
        ----------
        table : ZoneTable
            The training table.
        T : ndarray of shape (n_rows,)
            Its temperature [degC], NaN where missing.
        origins : ndarray of int, shape (n_origins,)
            Rows of the table, increasing.
        n_leads : int
        blocks : ndarray of int, shape (n_origins,)
            The block of every origin; a block's rows reach from its first origin to its last target.

        Returns
        -------
        ndarray of shape (n_origins, n_leads)
            [degC]; NaN where nothing else was measured to fit on.
        """
        view, penalty = self.view(table, T), self._penalty(self.alpha_)
        D, d, rows = self._pairs(view)
        out = np.full((len(origins), n_leads), np.nan)
        for block in np.unique(blocks):
            mine = np.flatnonzero(blocks == block)
            inside = (rows >= origins[mine[0]]) & (rows < origins[mine[-1]] + n_leads)
            if inside.all():
                continue
            coef = self._moments.plus(D[inside], d[inside], sign=-1.0).ridge(penalty)
            out[mine] = self.iterate(view, origins[mine], n_leads, coef[None, :])
        return out

    # ------------------------------------------------------------------------------------------------------ intervals
    def _left_out_intervals(self, table: ZoneTable) -> LeadIntervals | None:
        """Learned from weeks that are left out in turn; None where the table is too short."""
        T, per_day = table.history["T_za"], rows_per_day(table.step)
        n_leads = max(per_day, rows_of(self.horizon if self.horizon is not None else "1D", table.step))
        origins = [block_origins(block, per_day) for block in left_out_blocks(table.n_rows, per_day)]
        blocks = np.repeat(np.arange(len(origins)), [len(rows) for rows in origins])
        rows = np.concatenate(origins)
        paths = self.left_out_paths(table, T, rows, n_leads, blocks)
        left_out = LeftOut(measured_ahead(table, rows, n_leads) - paths, rows)
        return intervals_from(left_out, table) if np.isfinite(left_out.errors).sum() >= LEAST_ERRORS else None

    def _learn_intervals(self) -> LeadIntervals:
        raise ValueError(
            "the training table was too short to learn intervals from; fit on two days or more, with T_za measured."
        )

    # ----------------------------------------------------------------------------------------------------- prediction
    def _read_X(self, X: Any) -> ZoneTable:
        return read_table(
            self,
            X,
            columns=self.columns,
            sampling_time=self.sampling_time,
            reset=False,
            expected_step=self.sampling_time_,
        )

    def _cold_value(self, table: ZoneTable) -> float:
        T = table.T_za
        return float(T[0]) if T is not None and np.isfinite(T[0]) else self._T_mean

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        view = self.view(table, np.full(table.n_rows, np.nan) if table.T_za is None else table.T_za)
        coefs = self.coef_[None, :] if self.adapt is None else self.refitted(view, origins, self._learned(table))
        return self.iterate(view, origins, n_leads, coefs)

    def _learned(self, table: ZoneTable) -> int:
        """How many rows of a table the training has seen."""
        if self._tail.utc is None or table.utc is None:
            return 0
        return int((table.utc <= self._tail.utc[-1]).sum())

    def recursive(self, begin: int = 0) -> RecursiveARX:
        """The regression on its way through rows.

        Parameters
        ----------
        begin : int
            The first row that the training has not seen.

        Returns
        -------
        RecursiveARX
        """
        return RecursiveARX(self, begin)

    def refitted(self, view: ARXData, origins: np.ndarray, begin: int = 0) -> np.ndarray:
        """Coefficients from the training pairs and the pairs of ``view`` that end by each origin.

        Parameters
        ----------
        view : ARXData
        origins : ndarray of int, shape (n_origins,)
        begin : int
            The first row that the training has not seen.

        Returns
        -------
        ndarray of shape (n_origins, n_columns)
        """
        learner = self.recursive(begin)
        coefs = np.empty((len(origins), len(self.coef_)))
        for i in np.argsort(origins, kind="stable"):
            learner.advance(view, int(origins[i]))
            coefs[i] = learner.coef()
        return coefs

    def iterate(self, view: ARXData, origins: np.ndarray, n_leads: int, coefs: np.ndarray) -> np.ndarray:
        """Run the recursion from each origin.

        Parameters
        ----------
        view : ARXData
            Its temperature is read up to each origin; inputs behind its last row are held.
        origins : ndarray of int, shape (n_origins,)
        n_leads : int
        coefs : ndarray of shape (n_origins, n_columns) or (1, n_columns)

        Returns
        -------
        ndarray of shape (n_origins, n_leads)
            [degC].
        """
        known = _causally_filled(self._windows(view, view.held, origins), self._T_mean)
        rows = np.minimum(origins[:, None] + np.arange(n_leads), view.end - 1) - view.first
        lag_coefs, drive = coefs[:, : self.n_lags], coefs[:, self.n_lags :]
        if len(coefs) == 1:
            driven = (view.exogenous @ drive[0])[rows]
        else:
            driven = np.stack([view.exogenous[r] @ c for r, c in zip(rows, drive, strict=True)])
        low, high = ((bound - self._T_mean) / self._T_scale for bound in self._T_range)
        begin = np.ascontiguousarray((known[:, ::-1] - self._T_mean) / self._T_scale)
        each = np.ascontiguousarray(np.broadcast_to(lag_coefs[:, ::-1] / self._T_scale, begin.shape))
        return iterate_lags(begin, each, driven / self._T_scale, low, high) * self._T_scale + self._T_mean


class RecursiveARX:
    """A regression that takes in pairs of rows as they become known.

    Parameters
    ----------
    model : ARXRegressor
        Fitted.
    begin : int
        The first row that its training has not seen.
    """

    def __init__(self, model: ARXRegressor, begin: int) -> None:
        self._model = model
        self._moments = model._moments
        self._next = begin - 1  # the pair that ends at the first new row
        self._coef: np.ndarray | None = None

    def advance(self, view: ARXData, row: int) -> None:
        """Take in the pairs that end by ``row``."""
        if row > max(self._next, 0):
            D, d, _ = self._model._pairs(view, max(self._next, 0), row)
            self._moments, self._next, self._coef = self._moments.plus(D, d), row, None

    def coef(self) -> np.ndarray:
        """(n_columns,) by what has been taken in."""
        if self._coef is None:
            self._coef = self._moments.ridge(self._model._penalty(self._model.alpha_))
        return self._coef


def _held(T: np.ndarray) -> np.ndarray:
    """Missing values replaced by the last known one, NaN before the first."""
    last = np.maximum.accumulate(np.where(np.isfinite(T), np.arange(len(T)), -1))
    return np.where(last >= 0, T[np.maximum(last, 0)], np.nan)


def _causally_filled(windows: np.ndarray, default: float) -> np.ndarray:
    """What is unknown in a window (the newest first) held at its oldest known value, or at the default."""
    known = np.isfinite(windows)
    oldest = windows.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    held = np.where(known.any(axis=1), windows[np.arange(len(windows)), oldest], default)
    return np.where(known, windows, held[:, None])
