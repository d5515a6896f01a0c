"""Public methods of the hybrid predictors, over a scheme that forecasts the building."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .._arguments import check_bool
from .._joining import from_first_measured
from .._summary import TrainingRecord, network_tables
from .._table import SETPOINT_ROLES, UNLIMITED, ZoneTable, checked_columns, read_target
from .._threads import one_blas_thread
from .._time import rows_per_day
from .._transaction import unchanged_on_failure
from ..forecasting.quantiles import LeftOut, intervals_from
from .affine_frames import AffineFramesMixin
from .joint_errors import JointErrors
from .parts import fit_preprocess
from .scheme import Boundary, Scheme
from .setpoint_columns import UsualTemperature, check_setpoints, setpoints_in
from .thermostat_law.closed_loop import ClosedLoop

#: what a forecast takes in from the history up to its origin
Adapt = Literal["linear", "full"] | None


def _of_scheme(name: str, doc: str) -> Any:
    """Property of a fitted predictor that its scheme has under the same name."""

    def read(self: BaseHybrid) -> Any:
        check_is_fitted(self)
        return getattr(self._scheme, name)

    return property(read, doc=doc)


class BaseHybrid(AffineFramesMixin, RegressorMixin, BaseEstimator):
    """Base of the hybrid predictors; a subclass gives ``_make_scheme``."""

    preprocess: Any
    origin_step: Any
    max_missing: float
    intervals: bool  # whether fit learns them
    _law: ClosedLoop | None  # of thermostat and plant; None where the training had no set-points
    _n_before = 0  # rows of the training table before those that were learned from
    _usual_law: ClosedLoop | None = None  # of a plant without set-points, where those of other zones are known

    def _make_scheme(self) -> Scheme:
        """The scheme, unfitted, by the parameters, which it checks."""
        raise NotImplementedError

    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any, like: BaseHybrid | None = None) -> Self:
        """Learn from a training table.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows by the data contract.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.
        like : estimator, optional
            A fitted predictor of the same zone with other inputs; its choices of penalties are taken over, which
            halves the time.

        Raises
        ------
        ValueError
            If a parameter is unknown or does nothing in the scheme, the table or the target is refused, or the network
            has several measured nodes.
        """
        self._check_adapt()
        check_bool("intervals", self.intervals)
        checked_columns(self._reading()["columns"])
        scheme = self._make_scheme()
        network = scheme.network
        self.preprocess_ = fit_preprocess(self.preprocess, X, y)
        if len(network.measured_nodes) > 1:
            raise ValueError(
                f"network {network.name} has several measured temperatures; {type(self).__name__} forecasts one zone, "
                "so fit the identification itself."
            )
        shape: tuple[int, ...] = getattr(y, "shape", ())
        if len(shape) == 2 and shape[1] > 1:
            raise ValueError(
                f"y has {shape[1]} columns, but {type(self).__name__} forecasts one zone; fit BuildingPredictor, "
                "which forecasts all zones of a building."
            )
        table = self._read(X, network, reset=True)
        target = read_target(y, table, max_missing=self.max_missing, role="T_za")
        n_rows = table.n_rows
        table, target = from_first_measured(table, target, rows_per_day(table.step))  # origins stay at their hours
        self._check_spans(table.step)
        check_setpoints(table, self._column_of)
        fitted = scheme.fit(_measured(table, target), _scheme_of(like))
        self._n_before = n_rows - table.n_rows
        self._take(fitted, intervals=self.intervals)
        return self

    def _take(self, scheme: Scheme, *, intervals: bool) -> None:
        """Forecast with a scheme that was just fitted, and learn the intervals of its forecasts."""
        training = scheme.rows.training
        self._scheme, self.scheme_, self.sampling_time_ = scheme, scheme.name, training.step
        self._mean = float(np.nanmean(training.history["T_za"]))
        self._learned_to = scheme.rows.last_stamp
        self.training_ = TrainingRecord.of(training)
        self._law, self._usual_law = ClosedLoop.fit(scheme, self._most_leads(training.step)), None
        left_out = scheme.left_out_errors(self._most_leads(training.step)) if intervals else None
        self._intervals = self._joint = None
        if left_out is not None:
            self._intervals = intervals_from(left_out, training)
            self._joint = JointErrors.of(left_out.errors[..., None], training.index, left_out.origins)

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_scheme")

    gray_box_ = _of_scheme("gray_box_", "The fitted network.")
    forecaster_ = _of_scheme("forecaster_", "The fitted forecaster of the disturbance.")
    zeta_ = _of_scheme("zeta_", "The training disturbance [kW, or K for an output disturbance].")
    disturbance_step_ = _of_scheme("disturbance_step_", "Step of the disturbance.")
    weights_ = _of_scheme("weights_", "Shares of the blend's members by group of leads (schedule model only).")
    evidence_ = _of_scheme("evidence_", "What a FleetPrior is learned from (schedule model only).")
    gain_ = _of_scheme("gain_", "Temperature after a step of 1 kW by lead and member [K/kW] (schedule model only).")
    gain_std_ = _of_scheme(
        "gain_std_", "Relative standard error of the network's response by lead (schedule model only)."
    )

    @property
    def known_until_(self) -> pd.Timestamp | None:
        """Stamp of the last row that the model knows, in the time zone of the training; None if that had no stamps."""
        check_is_fitted(self)
        latest = self._scheme.rows.latest
        return None if latest.utc is None else pd.Timestamp(latest.index[-1])

    @property
    def known_rows_(self) -> pd.DataFrame:
        """The last rows that the model knows, a day or more, with a column for each role."""
        check_is_fitted(self)
        end = self._scheme.rows.end()
        return pd.DataFrame({**end.inputs, **end.history}, index=end.index)

    def n_known_of(self, X: Any) -> int:
        """Count the first rows of a table that the model knows from :meth:`fit`, :meth:`update` or :meth:`partial_fit`.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        int
            0 where X has no stamps, begins after the known rows or ends before they do, or has other values in them.
        """
        check_is_fitted(self)
        return self._n_known(self._read_X(X))

    @property
    def thermostat_learned_(self) -> bool:
        """Whether the training had set-points, so that a thermostat was learned."""
        check_is_fitted(self)
        return self._law is not None

    def _learn_usual(self) -> None:
        """Learn how the plant usually runs, to forecast it without set-points."""
        usual = UsualTemperature.of(self._scheme.rows.training)
        self._usual_law = ClosedLoop.fit(self._scheme, self._most_leads(self.sampling_time_), usual)

    @property
    def _has_usual_plant(self) -> bool:
        """Whether no thermostat was learned, but how the plant usually runs."""
        return self._law is None and self._usual_law is not None

    def _running(self) -> Self:
        """This predictor, or where no thermostat was learned a copy whose plant runs as it usually did."""
        if not self._has_usual_plant:
            return self
        made = copy(self)
        made._law = self._usual_law
        return made

    def _read_building(self, X: pd.DataFrame, columns: Mapping[str, Any], past: Sequence[str]) -> ZoneTable:
        """Rows of a building that follow the known ones, by the columns of all its zones; ``past`` may be missing."""
        rows, network = self._scheme.rows, self._scheme.network
        table = self._read(rows.in_own_zone(X), network, reset=False, columns=columns, history_roles=past)
        table = rows.with_own_clock(table)
        rows.refuse_unless_following(table)
        return table

    def _part_of_zone(self, whole: ZoneTable, role_of: Mapping[Any, str]) -> ZoneTable:
        """The part of one zone of a building's table, whose roles are ``role_of`` columns."""

        def values(wanted: Iterable[str], given: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            roles = {role: role_of.get(self._column_of(role)) for role in wanted}
            return {role: given[name] for role, name in roles.items() if name is not None and name in given}

        inputs, history = values(self._scheme.rows.training.inputs, whole.inputs), ("T_za", *SETPOINT_ROLES)
        return whole.replace(inputs=inputs, history=values(history, whole.history))

    def _copy_after(self, table: ZoneTable) -> Self:
        """A copy that has gone through rows that follow the known ones, with their temperature as history."""
        check_setpoints(table, self._column_of)
        self._warn_without_setpoints(table)
        made = copy(self)
        made._scheme = self._scheme.advanced(_measured(table, table.history["T_za"]))
        made._scheme.go_on()
        return made

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int, boundary: Boundary = None) -> np.ndarray:
        return self._present_scheme().forecast(table, origins, n_leads, boundary).temperature

    @one_blas_thread
    def predict_from(
        self,
        X: Any,
        origins: Sequence[int] | np.ndarray,
        horizon: Any = None,
        boundary: Mapping[str, np.ndarray] | None = None,
    ) -> np.ndarray:
        """Forecast the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; history is read only up to each origin.  Where they begin with known rows
            (:meth:`n_known_of`), forecasts from the last of these on go on from them; to those from earlier rows X is
            another history.
        origins : sequence of int
            Row numbers of X; -1 is the last known row, where X follows it.
        horizon : timedelta-like, optional
            How far ahead; default is the estimator's own, or one day.
        boundary : mapping of role to array of shape (n_origins, n_leads), optional
            Boundary temperatures of the network, such as a neighbour's, as forecast from each origin [degC], in place
            of those in X (schedule model only).

        Returns
        -------
        ndarray of shape (n_origins, n_leads), float64
            Forecasts of the rows ``origin + 1, origin + 2, ...`` [degC]; NaN after the last row of X.
        """
        check_is_fitted(self)
        shape = np.size(origins), self._leads(horizon, self.sampling_time_)
        given = self._scheme.read_boundary(boundary, shape)
        return self._paths_from(X, origins, horizon, self._forecast, (), given)

    @one_blas_thread
    def left_out_errors(self) -> LeftOut:
        """Errors of forecasts of training days by models that have not learned from these days.

        Returns
        -------
        LeftOut
            ``errors`` (n_origins, n_leads), measured less forecast [K], and ``origins`` (n_origins,), training rows.
        """
        check_is_fitted(self)
        found = self._scheme.left_out_errors(self._most_leads(self.sampling_time_))
        return found._replace(origins=found.origins + self._n_before)

    @unchanged_on_failure
    @one_blas_thread
    def update(self, X: Any, y: Any = None) -> Self:
        """Take in new rows without learning; later forecasts are as if these had been part of their history.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, with ``T_za`` as measured, NaN where missing.
        y : array-like of shape (n_samples,), optional
            The measured temperature, where X has no ``T_za``.

        Raises
        ------
        ValueError
            If the rows do not follow, or hold no measurement; the estimator is then what it was.
        """
        check_is_fitted(self)
        table = self._read_following(X)
        rows = self._scheme.rows
        rows.refuse_unless_following(table)
        if y is not None:
            target = read_target(rows.in_own_zone(y), table, max_missing=UNLIMITED, role="T_za")
        elif "T_za" in table.history:
            target = table.history["T_za"]
        else:
            raise ValueError(
                f"X has no column {self._column_of('T_za')!r}; give what was measured there or as y, with NaN where "
                "missing (rows ahead are for predict and forecast)."
            )
        check_setpoints(table, self._column_of)
        self._warn_without_setpoints(table)
        self._scheme = self._scheme.advanced(_measured(table, target))
        return self

    @unchanged_on_failure
    @one_blas_thread
    def partial_fit(self, X: Any, y: Any) -> Self:
        """Learn from new rows: the first call fits, later ones recalibrate on all rows since.

        The schedule model is fitted anew on the last eight weeks, or as many rows as its first training had where those
        are more.  In the two-stage scheme baselines such as ``"ridge"`` are fitted again on training and new rows, or
        the last weeks alone where those are clearly better; the rest only with ``adapt="full"``.  The intervals stay.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, or a later part of those that :meth:`update` has taken in; what is
            known already is not taken in twice.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.

        Raises
        ------
        ValueError
            As :meth:`fit` does, if the rows do not follow, or if ``y`` differs in a row that is known already; the
            estimator is then what it was.
        """
        if not self.__sklearn_is_fitted__():
            return self.fit(X, y)
        table, rows = self._read_following(X), self._scheme.rows
        target = read_target(rows.in_own_zone(y), table, max_missing=self.max_missing, role="T_za")
        check_setpoints(table, self._column_of)
        measured = _measured(table, target)
        rows.refuse_other_values(measured, self._column_of("T_za"))
        new = rows.without_known(measured)
        if new.n_rows:
            rows.refuse_unless_following(new)
        self._scheme = self._present_scheme().relearned(new if new.n_rows else None)
        self._learned_to, self._n_before = self._scheme.rows.last_stamp, 0
        self._law, self._usual_law = ClosedLoop.fit(self._scheme, self._most_leads(table.step)), None
        self.training_ = TrainingRecord.of(self._scheme.rows.training, self._scheme.rows.latest)
        return self

    def _facts(self) -> dict[str, str]:
        known, intervals = self._scheme.rows.latest.index[-1], "no" if self._intervals is None else "yes"
        facts = {"scheme": self.scheme_, "network": self._scheme.network.name, "adapt": str(self.adapt)}
        return facts | {"last known row": str(known), "intervals": intervals}

    def _tables(self) -> dict[str, pd.DataFrame]:
        weights = getattr(self._scheme, "weights_", None)
        return network_tables(self.gray_box_) | ({} if weights is None else {"weights": weights})

    @one_blas_thread
    def drift(self, X: Any = None) -> pd.DataFrame:
        """Report day by day whether what was learned still holds; nothing is taken in.

        Each day's temperature (schedule model) or disturbance (two-stage scheme) is compared with its forecast from
        midnight, without adaptation; left-out training days are the reference (:class:`~skhybrid.hybrid.DriftMonitor`).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features), optional
            Rows with ``T_za``, after the training or elsewhere.  By default the rows that :meth:`update` has taken in,
            of which the two-stage scheme reports a day once a row after it is known.

        Returns
        -------
        DataFrame
            One row per whole local day: ``statistic``, ``threshold``, ``drifted``, ``since`` and ``kind``
            (``"level"``, ``"schedule"``, ``"quiet"``), as known at its end.
        """
        check_is_fitted(self)
        return self._scheme.drift(None if X is None else self._with_history(X)[0])


def _scheme_of(like: Any) -> Scheme | None:
    """The scheme of a fitted predictor, or None."""
    if like is None:
        return None
    if not isinstance(like, BaseHybrid):
        raise ValueError(f"like={like!r} must be a fitted hybrid predictor; give one, or leave it out.")
    check_is_fitted(like)
    return like._present_scheme()


def _measured(table: ZoneTable, target: np.ndarray) -> ZoneTable:
    """A table with what a scheme learns from as history: temperature and set-points."""
    return table.replace(history={**setpoints_in(table), "T_za": target})
