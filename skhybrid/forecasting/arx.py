"""ARX: a black-box regression of the temperature itself, the baseline that a gray box must beat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .._arguments import check_bool, check_integer, check_rate, store_arguments
from .._summary import TrainingRecord
from .._table import ZoneTable
from .._threads import one_blas_thread
from .._time import rows_per_day
from .._transaction import unchanged_on_failure
from .arx_design import ARXData, ARXDesign, Moments, Pairs, RecursiveARX, coefs_at
from .arx_multi_step import MultiStepFit, RecursiveMultiStep, fit_multi_step
from .arx_prior import ZoneEvidence, ZoneSums, prior_of
from .features import target_rows
from .intervals import LeadIntervals
from .quantiles import LeftOut, QuantileForecastMixin, block_origins, intervals_from, left_out_blocks, measured_ahead
from .reading import read_training, read_zone

_ALPHAS = (0.1, 1.0, 10.0, 100.0, 1000.0)
_DEFAULT_ALPHA = 10.0
_MIN_BLOCKS, _MAX_BLOCKS = 3, 6  # left-out blocks of the choice of alpha
_USUAL_LAGS = 24
_MOST_DAYS = 2  # longest lead of the multi-step objective [days]


class ARXRegressor(QuantileForecastMixin, RegressorMixin, BaseEstimator):
    """Ridge regression of the temperature step on lags, iterated over the horizon.

    With the temperature T of row k, the inputs v (T_oa, q_sol, ...) and hour x weekday/weekend h(k)::

        T[k+1] - T[k] = sum_i a_i T[k-i] + sum_j b_j' v[k-j] + c_h(k) + d + e[k]

    for i < ``n_lags`` and j < ``n_input_lags``.  It is the baseline that a gray box must beat; the strongest form
    is fitted on errors at many leads (``objective="multi_step"``) and again as rows become known (``adapt="refit"``).

    Parameters
    ----------
    horizon : timedelta-like or None, default "1D"
        How far ahead ``predict`` looks; None simulates from the first row on.
    adapt : {None, "refit"}, default None
        ``"refit"`` solves the regression again at each origin, on the training pairs and all pairs known at the origin;
        with ``objective="multi_step"`` once a day, where errors of the rows after the training count three times and
        half as much after 30 days.
    intervals : bool, default True
        Whether ``fit`` learns the intervals of :meth:`predict_quantiles`.
    n_lags, n_input_lags : int, default 24 and 8
        Rows of temperature, and of every input; more than 24 may be at most half of the rows of the training table.
    calendar : bool, default True
        Whether to use hour x weekday/weekend dummies.
    alpha : float, optional
        Penalty on standardised columns.  Default: of 0.1, 1, 10, 100 and 1000 the one with the lowest forecast error
        over the horizon in left-out blocks of the training table; 10 where the table is too short for three blocks.
        With ``objective="multi_step"`` of 1 and 1000 the better one on the last third.
    columns : mapping of role to column, optional
        Overrides the names of the columns of X.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps, which is refused without it.
    holidays : str or sequence of dates, optional
        A country or state as the ``holidays`` package names it, such as ``"US-IL"``, or local dates, which count as
        Sundays.
    origin_step : timedelta-like, optional
        Distance of origins in ``predict``, at most ``horizon``, which is the default.
    max_missing : float, default 0.5
        Largest share of missing temperatures in ``y``.
    objective : {"one_step", "multi_step"}, default "one_step"
        ``"one_step"`` minimises the squared error of e.  ``"multi_step"`` minimises squared errors of forecasts from
        every hour, at 18 leads up to the horizon (two days at most), which count with lead^-0.3, plus those of one
        step, by damped Gauss-Newton steps; from more than two weeks, every second hour and 9 leads.  It has further
        columns: inputs filtered over 6 h and 24 h, irradiance before and after noon, outdoor temperature by hour of
        day.  Its penalties, also a further one on calendar columns, are those that forecast the last third of the
        training table best.
    prior : FleetPrior, optional
        Knowledge of the coefficients from fitted zones with the same columns and step; it replaces all penalties.

    Attributes
    ----------
    coef_ : ndarray of shape (n_columns,)
        Coefficients of the standardised columns: temperatures (newest first), inputs, calendar, constant.
    alpha_ : float
    calendar_alpha_, one_step_weight_ : float
        With ``objective="multi_step"``: the further penalty on calendar columns, and the weight of squared one-step
        errors, in units of the ratio of the two sums of squares at the one-step solution.
    design_ : ARXDesign
        Columns of the regression, in units of the training table.
    input_names_ : list of str
        Roles of the inputs, in the order of ``coef_``.
    intervals_ : LeadIntervals
        Learned from errors in weeks of the training table that are left out in turn.
    sampling_time_ : Timedelta
    n_features_in_, feature_names_in_ : int, ndarray of str
    """

    _fit: MultiStepFit

    def __init__(
        self, *, horizon: Any = "1D", adapt: Literal["refit"] | None = None, intervals: bool = True, n_lags: int = 24,
        n_input_lags: int = 8, calendar: bool = True, alpha: float | None = None,
        columns: Mapping[str, Any] | None = None, sampling_time: Any = None, holidays: Any = None,
        origin_step: Any = None, max_missing: float = 0.5, objective: Literal["one_step", "multi_step"] = "one_step",
        prior: Any = None,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any, like: ARXRegressor | None = None) -> Self:
        """Fit the regression.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Inputs by role; a column ``T_za`` is not read here.
        y : Series or array-like of shape (n_samples,)
            Zone temperature [degC], NaN where missing.
        like : ARXRegressor, optional
            A fitted one with the same ``objective``, whose penalties are taken in place of choosing them.

        Raises
        ------
        ValueError
            If a parameter is impossible, the table cannot be read, or ``prior`` belongs to other columns or steps.
        """
        self._check_parameters(like)
        table, T = read_training(self, X, y)
        self._check_spans(table.step)
        self._check_lags(table.n_rows)
        self.input_names_ = list(table.inputs)
        self.sampling_time_, self.training_ = table.step, TrainingRecord.of(table)
        self._solve(table, T, like)
        self._mean = self.design_.T_mean
        self._intervals = self._left_out_intervals(table, T) if self.intervals else None
        end = slice(-self.design_.warmup, None)
        self._tail = table.rows(end).replace(history={"T_za": T[end]}).owned()
        return self

    def _solve(self, table: ZoneTable, T: np.ndarray, like: ARXRegressor | None) -> None:
        """Set the coefficients; the data matrix, which a year of minutes makes half a gigabyte, ends here."""
        daily = self.objective == "multi_step"
        prior = None if self.prior is None else prior_of(self.prior, self.objective)
        lags = int(self.n_lags), int(self.n_input_lags)
        self.design_ = ARXDesign.of_training(table, T, *lags, self.calendar, daily, prior is not None)
        view = self.design_.view(table, T)
        if daily:
            n_leads = min(self._leads_of_horizon(table.step), _MOST_DAYS * rows_per_day(table.step))
            penalties, refits = self.alpha if like is None else like._fit.penalties, self.adapt is not None
            self._fit = fit_multi_step(self.design_, table, view, n_leads, penalties, refits, prior)
            self.coef_, (self.alpha_, self.calendar_alpha_, self.one_step_weight_) = self._fit.coef, self._fit.penalties
            return
        for name in ("_fit", "calendar_alpha_", "one_step_weight_"):  # of an earlier fit with the other objective
            self.__dict__.pop(name, None)
        pairs = self.design_.pairs(view)
        self._moments, squares = Moments.of(pairs), float(pairs.d @ pairs.d)
        given = self.alpha if like is None else like.alpha_
        self._prior = None
        if prior is not None:
            self._prior, given = prior.pseudo_rows(self.design_, table.step, self._moments, squares, len(pairs.d)), 0.0
        self.alpha_ = self._choose_alpha(view, pairs) if given is None else float(given)
        self.coef_ = self._moments.ridge(self.alpha_, self._prior)
        self._noise = pairs.squares(self.coef_) / max(len(pairs.d), 1)

    @property
    def evidence_(self) -> ZoneEvidence:
        """Normal equations of the fit, from which a :class:`~skhybrid.fleet.FleetPrior` is learned."""
        check_is_fitted(self)
        many = self._has_multi_step
        found = (self._fit.information(), self._fit.noise) if many else (self._moments, self._noise)
        return ZoneEvidence({self.objective: ZoneSums(self.design_, self.sampling_time_, *found)})

    @property
    def _has_multi_step(self) -> bool:
        """Whether it was fitted on errors at many leads."""
        return self.design_.daily is not None

    def _facts(self) -> dict[str, str]:
        return {"inputs": ", ".join(self.input_names_), "alpha": f"{self.alpha_:g}"}

    def _check_parameters(self, like: Any) -> None:
        if like is not None and (not isinstance(like, ARXRegressor) or like.objective != self.objective):
            raise ValueError(f"like={like!r} must be an ARXRegressor with the same objective; leave it out.")
        if like is not None:
            check_is_fitted(like)
        self._check_adapt()
        if self.objective not in ("one_step", "multi_step"):
            raise ValueError(f"objective={self.objective!r} is not known; use 'one_step' or 'multi_step'.")
        for name in ("n_lags", "n_input_lags"):
            check_integer(name, getattr(self, name))
        for name in ("intervals", "calendar"):
            check_bool(name, getattr(self, name))
        if self.alpha is None:
            return
        check_rate("alpha", self.alpha)
        if self.prior is not None:
            raise ValueError(f"alpha={self.alpha!r} does nothing beside prior=, which takes its place; leave one out.")

    def _check_lags(self, n_rows: int) -> None:
        """Refuse lags that leave less than half of the rows to learn from; the usual ones are taken of any table."""
        for name in ("n_lags", "n_input_lags"):
            if (lags := getattr(self, name)) > max(n_rows // 2, _USUAL_LAGS):
                raise ValueError(
                    f"{name}={lags} is more than half of the {n_rows} rows of the training table; give fewer lags, or "
                    "more rows."
                )

    def _check_adapt(self) -> None:
        if self.adapt not in (None, "refit"):
            raise ValueError(f"adapt={self.adapt!r} is not known; use None or 'refit'.")

    def _choose_alpha(self, view: ARXData, pairs: Pairs) -> float:
        """The penalty with the lowest forecast error in left-out blocks, each at least two horizons long."""
        n_leads = self._leads_of_horizon(self.sampling_time_)
        n_blocks = min(_MAX_BLOCKS, view.end // (2 * n_leads))
        if n_blocks < _MIN_BLOCKS:
            return _DEFAULT_ALPHA
        edges = np.linspace(0, view.end, n_blocks + 1).astype(np.int64)
        errors = np.zeros(len(_ALPHAS))
        for start, stop in pairwise(edges):
            rest = self._moments.with_pairs(pairs.between(start, stop), sign=-1)
            origins = np.arange(start, stop - n_leads, max(1, n_leads // 6))
            truth = view.T[target_rows(origins, n_leads)]
            for i, alpha in enumerate(_ALPHAS):
                paths = self.design_.iterate(view, origins, n_leads, rest.ridge(alpha)[None, :])
                errors[i] += np.nansum((paths - truth) ** 2)
        return _ALPHAS[int(np.argmin(errors))]

    def left_out_paths(
        self, table: ZoneTable, T: np.ndarray, origins: np.ndarray, n_leads: int, blocks: np.ndarray
    ) -> np.ndarray:
        """Forecasts (n_origins, n_leads) [degC] within the training table, each fitted without its block of rows.

        Parameters
        ----------
        table, T : ZoneTable, ndarray of shape (n_rows,)
            The training table and its temperature [degC], NaN where missing.
        origins, n_leads : ndarray of int, shape (n_origins,), and int
            Rows of the table, increasing, and rows to forecast.
        blocks : ndarray of int, shape (n_origins,)
            The block of every origin, from its first origin to its last target; NaN where no other rows are left.
        """
        view = self.design_.view(table, T)
        pairs = self.design_.pairs(view)
        out = np.full((len(origins), n_leads), np.nan)
        for block in np.unique(blocks):
            mine = np.flatnonzero(blocks == block)
            begin, end = int(origins[mine[0]]), int(origins[mine[-1]]) + n_leads
            left_out = pairs.between(begin, end)
            if len(left_out.rows) == len(pairs.rows):
                continue
            if self._has_multi_step:
                coef = self._fit.without(view, begin, end, left_out)
            else:
                coef = self._moments.with_pairs(left_out, sign=-1).ridge(self.alpha_, self._prior)
            out[mine] = self.design_.iterate(view, origins[mine], n_leads, coef[None, :])
        return out

    def _left_out_intervals(self, table: ZoneTable, T: np.ndarray) -> LeadIntervals | None:
        """Intervals from weeks that are left out in turn; None where the table is too short."""
        known, per_day = table.replace(history={"T_za": T}), rows_per_day(table.step)
        n_leads = max(per_day, self._leads_of_horizon(self.sampling_time_))
        origins = [block_origins(block, per_day) for block in left_out_blocks(table.n_rows, per_day)]
        blocks = np.repeat(np.arange(len(origins)), [len(rows) for rows in origins])
        rows = np.concatenate(origins)
        paths = self.left_out_paths(table, T, rows, n_leads, blocks)
        return intervals_from(LeftOut(measured_ahead(known, rows, n_leads) - paths, rows), known)

    def _read_X(self, X: Any) -> ZoneTable:
        return read_zone(self, X)

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        self._check_adapt()  # which may have been set since ``fit``
        view = self.design_.view(table, table.measured())
        return self.design_.iterate(view, origins, n_leads, self._coefs(table, view, origins))

    def _coefs(self, table: ZoneTable, view: ARXData, origins: np.ndarray) -> np.ndarray:
        """Coefficients (n_origins, n_columns) as known at each origin of a table, or (1, n_columns) of all."""
        if self.adapt is None:
            return self.coef_[None, :]
        n_learned = table.stamps.n_until(None if self._tail.utc is None else self._tail.utc[-1])
        return self.refitted(view, origins, n_learned)

    def _each_path(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        """Forecasts from one origin; up to there all tables are alike, so that one fit serves them."""
        views, at = [self.design_.view(table, table.measured()) for table in tables], np.array([origin])
        coefs = self._coefs(tables[0], views[0], at)
        return np.array([self.design_.iterate(view, at, n_leads, coefs) for view in views])

    def recursive(self, begin: int = 0) -> RecursiveARX | RecursiveMultiStep:
        """The regression, ready to be updated by later rows.

        Parameters
        ----------
        begin : int; first row after the training table
        """
        if self._has_multi_step:
            return RecursiveMultiStep(self._fit, begin)
        return RecursiveARX(self.design_, self._moments, self.alpha_, begin, self._prior)

    def refitted(self, view: ARXData, origins: np.ndarray, begin: int = 0) -> np.ndarray:
        """Coefficients (n_origins, n_columns) from the training rows and those of ``view`` up to each origin.

        Parameters
        ----------
        view, origins : ARXData, ndarray of int, shape (n_origins,)
        begin : int; first row after the training table
        """
        return coefs_at(self.recursive(begin), view, origins)
