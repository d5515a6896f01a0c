"""Gradient-boosted trees of the temperature, or of the errors of ARX, directly at every lead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import HistGradientBoostingRegressor

from .._arguments import check_integer, check_rate, store_arguments
from .._clock import hour_of_day
from .._last_known import carried_forward
from .._rolling import RollingForecastMixin
from .._summary import TrainingRecord
from .._table import ZoneTable
from .._threads import one_blas_thread, one_openmp_thread
from .._time import rows_per_day, rows_per_hour
from .._transaction import unchanged_on_failure
from ..filtering import ForecastSample, hourly_sample
from .arx import ARXRegressor
from .features import clock_changes, same_slot, span_means
from .quantiles import left_out_blocks
from .reading import read_training, read_zone

_HOURS_BACK = (1, 3, 6)  # changes of temperature before the origin [h]
_RECENT_HOURS = 3  # of the recent mean of an input before the target [h]
_LEAST_PAIRS = 200  # fewest pairs of the last third that choose the number of trees; of others 100 are grown
_FEW_TREES = 100


class BoostedRegressor(RollingForecastMixin, RegressorMixin, BaseEstimator):
    """Gradient boosting (scikit-learn's) over pairs of origin and lead: a baseline from machine learning.

    One model forecasts the change of temperature since the origin at every lead.  It reads the lead, hour and day of
    the target, the temperature at the origin, 1, 3 and 6 h before it and a whole day before the target, and every
    input at the target and its means since the origin and over three hours.  It is trained on hourly origins and 18
    leads; the number of trees is the best one on the last third of the training table.

    Trees follow the control they were trained on: heat and hour tell the set-point, so they forecast well under the
    same control and badly under another one.

    Parameters
    ----------
    residual_of : {None, "arx"}, default None
        ``"arx"`` learns the errors of an :class:`ARXRegressor` in weeks of the training table that are left out in
        turn, and corrects the forecasts of that ARX, which is fitted again at each origin.
    horizon : timedelta-like or None, default "1D"
        How far ahead ``predict`` looks; None simulates from the first row on.
    max_iter : int, default 400
        Largest number of trees.
    columns : mapping of role to column, optional
        Overrides the names of the columns of X.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps, which is refused without it.
    holidays : str or sequence of dates, optional
        A country or state as the ``holidays`` package names it, or local dates, which count as Sundays.
    random_state : int, RandomState or None, default None
    learning_rate : float, default 0.06
    origin_step : timedelta-like, optional
        Distance of origins in ``predict``, at most ``horizon``, which is the default.
    max_missing : float, default 0.5
        Largest share of missing temperatures in ``y``.

    Attributes
    ----------
    booster_ : HistGradientBoostingRegressor or None
        None where the training table has no pair of origin and lead.
    n_iter_ : int
        Number of trees.
    arx_ : ARXRegressor or None
    sampling_time_ : Timedelta
    n_features_in_, feature_names_in_ : int, ndarray of str

    Notes
    -----
    Tree ensembles cannot be written by :func:`skhybrid.persistence.save_model`.
    """

    def __init__(
        self, *, residual_of: Literal["arx"] | None = None, horizon: Any = "1D", max_iter: int = 400,
        columns: Mapping[str, Any] | None = None, sampling_time: Any = None, holidays: Any = None,
        random_state: Any = None, learning_rate: float = 0.06, origin_step: Any = None, max_missing: float = 0.5,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> Self:
        """Grow the trees.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Inputs by role; a column ``T_za`` is not read here.
        y : Series or array-like of shape (n_samples,)
            Zone temperature [degC], NaN where missing.

        Raises
        ------
        ValueError
            If a parameter is not known or impossible, or the table cannot be read.
        """
        if self.residual_of not in (None, "arx"):
            raise ValueError(f"residual_of={self.residual_of!r} is not known; use None or 'arx'.")
        check_integer("max_iter", self.max_iter)
        check_rate("learning_rate", self.learning_rate)
        table, T = read_training(self, X, y)
        self._check_spans(table.step)
        self.sampling_time_, self.training_ = table.step, TrainingRecord.of(table)
        self._roles, self._mean = list(table.inputs), float(np.nanmean(T))
        known = table.replace(history={"T_za": T})
        sample = hourly_sample(table.n_rows, self._leads_of_horizon(table.step), table.step_hours, 0)
        self.arx_ = None
        if self.residual_of:
            arx = ARXRegressor(horizon=self.horizon, adapt="refit", max_missing=1.0, intervals=False)
            self.arx_ = arx.fit(table.replace(history={}), T)
        with one_openmp_thread():
            self._grow(known, sample)
        n_kept = rows_per_day(table.step) + 1
        self._tail = known.rows(slice(-max(n_kept, self.arx_._tail.n_rows if self.arx_ else 0), None)).owned()
        return self

    def _grow(self, known: ZoneTable, sample: ForecastSample) -> None:
        """Set the booster; the number of trees is the best one on the last third."""
        rows, inside = sample.targets(known.n_rows)
        base = self._training_base(known, sample)
        errors = np.where(inside, known.history["T_za"][rows], np.nan) - base
        features = self._features(known, sample.origins, sample.leads, base)
        seen = np.isfinite(errors).ravel()
        later = (np.repeat(sample.origins, len(sample.leads)) >= 2 * known.n_rows // 3) & seen
        earlier = (rows.ravel() < 2 * known.n_rows // 3) & seen
        self.n_iter_ = min(_FEW_TREES, self.max_iter)
        if min(earlier.sum(), later.sum()) >= _LEAST_PAIRS:
            trial = self._booster(self.max_iter).fit(features[earlier], errors.ravel()[earlier])
            stages = trial.staged_predict(features[later])
            squares = [np.sum((errors.ravel()[later] - stage) ** 2) for stage in stages]
            self.n_iter_ = int(np.argmin(squares)) + 1
        booster = self._booster(self.n_iter_)
        self.booster_ = booster.fit(features[seen], errors.ravel()[seen]) if seen.sum() > 1 else None

    def _booster(self, n_trees: int) -> HistGradientBoostingRegressor:
        return HistGradientBoostingRegressor(
            max_iter=n_trees, learning_rate=self.learning_rate, early_stopping=False, random_state=self.random_state
        )

    def _training_base(self, known: ZoneTable, sample: ForecastSample) -> np.ndarray:
        """(O, L) forecasts to which the trees add [degC]: the temperature at the origin, or left-out ARX."""
        if self.arx_ is None:
            return np.repeat(self._carried_forward(known)[sample.origins][:, None], len(sample.leads), axis=1)
        ends = [end for _, end in left_out_blocks(known.n_rows, rows_per_day(known.step))]
        blocks = np.searchsorted(ends, sample.origins, side="right")
        longest = int(sample.leads[-1])
        paths = self.arx_.left_out_paths(known, known.history["T_za"], sample.origins, longest, blocks)
        return paths[:, sample.leads - 1]

    def _carried_forward(self, table: ZoneTable) -> np.ndarray:
        """(n_rows,) the last known temperature at each row [degC], the training mean before the first."""
        T = carried_forward(table.measured())
        return np.where(np.isfinite(T), T, self._mean)

    def _features(self, table: ZoneTable, origins: np.ndarray, leads: np.ndarray, base: np.ndarray) -> np.ndarray:
        """(n_origins * n_leads, n_features) of forecasts at increasing leads, whose base is (n_origins, n_leads)."""
        T, per_hour, per_day = self._carried_forward(table), rows_per_hour(table.step), rows_per_day(table.step)
        ahead = origins[:, None] + leads
        targets = np.minimum(ahead, table.n_rows - 1)
        here = np.broadcast_to(T[origins][:, None], targets.shape)
        day_before = np.maximum(same_slot(ahead, origins, per_day, clock_changes(table)), 0)
        columns = [np.broadcast_to(leads * table.step_hours, targets.shape), hour_of_day(table.time)[targets]]
        columns += [table.day_of_week[targets], here, base - here, T[day_before] - here]
        for hours in _HOURS_BACK:
            back = np.maximum(origins - hours * per_hour, 0)
            columns.append(here - T[back][:, None])
        for role in self._roles:
            for first in (targets - 1, origins[:, None], np.maximum(targets - _RECENT_HOURS * per_hour, 0)):
                since = np.maximum(np.minimum(first, targets - 1), 0)  # an input acts over the step after its stamp
                columns.append(span_means(table.inputs[role], since, targets))
        stacked = np.stack([np.broadcast_to(column, targets.shape) for column in columns], axis=-1)
        return stacked.reshape(targets.size, len(columns))

    def _read_X(self, X: Any) -> ZoneTable:
        return read_zone(self, X)

    def _facts(self) -> dict[str, str]:
        return {"inputs": ", ".join(self._roles), "trees": str(self.n_iter_)}

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        if self.arx_ is None:
            base = np.repeat(self._carried_forward(table)[origins][:, None], n_leads, axis=1)
        else:
            base = self.arx_._forecast(table, origins, n_leads)
        if self.booster_ is None:
            return base
        leads = np.arange(1, n_leads + 1)
        with one_openmp_thread():
            return base + self.booster_.predict(self._features(table, origins, leads, base)).reshape(base.shape)
