"""HybridPredictor: a thermal network and a forecast of what nobody measures, joined by one of two schemes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy, deepcopy
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.utils.validation import check_is_fitted

from .._table import ZoneTable, append_tables, read_table, read_target
from .._threads import one_blas_thread
from .._time import origin_rows, rows_of
from .._transaction import unchanged_on_failure
from ..control.setpoints import read_limits, read_setpoint
from ..forecasting import DisturbanceForecaster
from ..forecasting.features import rows_per_day
from ..forecasting.intervals import LeadIntervals
from ..forecasting.quantiles import QuantileForecastMixin, intervals_from, quantile_columns, read_quantiles
from ..identification import PeriodicDisturbanceID
from ..thermal import RCNetwork, get_network
from .online_updating import OnlineUpdatingMixin
from .schedule_scheme import ScheduleScheme
from .scheme import Paths, Scheme
from .tables import in_zone_of
from .two_stage_scheme import TwoStageScheme

#: network of the scheme that learns the disturbance through it
DEFAULT_NETWORK = "4R3C"


class HybridPredictor(OnlineUpdatingMixin, QuantileForecastMixin, RegressorMixin, BaseEstimator):
    """Day-ahead forecast of temperature and load: a thermal network and a forecast of its unmeasured heat.

    Without arguments it takes the *linear* scheme: schedules of gain and of conductance are learned through the
    network, on the errors of its forecasts at all leads, and the forecast is blended with ARX.  With a gray box or a
    forecaster it takes the *published* one: the gray box is identified, the disturbance that it leaves is estimated
    (causally, as later in use), gathered into hours and learned by the forecaster; a forecast drives the network with
    the forecast disturbance (paper Eqs. ID_hybrid and od_hybrid).  The user guide has the equations of both.

    Parameters
    ----------
    gray_box : estimator, optional
        An identification of this package, for the published scheme; there the default is ``PeriodicDisturbanceID()``.
        The linear scheme takes its ``network`` (default 4R3C), ``columns``, ``sampling_time`` and of ``known`` the
        capacities, and identifies nothing.
    forecaster : estimator, optional
        A regressor of the disturbance.  ``DisturbanceForecaster("linear")`` takes the linear scheme, whatever the gray
        box; any other the published one, whose default is ``DisturbanceForecaster("ridge")`` with the same horizon.
    disturbance : {"input", "output"}, default="input"
        Whether the disturbance is heat on the zone [kW] or an addition to its temperature [K] (published scheme only).
    horizon : timedelta-like, default="1D"
        How far ahead ``predict`` looks; None forecasts from the first row on.
    adapt : {None, "linear", "full"}, default="full"
        What a forecast takes in from the history up to its origin.  None: the state, and in the published scheme the
        recent disturbance.

        ``"linear"``: in the linear scheme also schedules, other linear coefficients and ARX, solved again at every
        origin, weights by recent errors, and a share of what was missed one and two weeks ago.  In the published one a
        linear forecaster or baseline is re-fitted on training and history for every full week of history (on its last
        weeks alone where those forecast the latest one clearly better); networks of neurons and other regressors stay
        as trained.

        ``"full"``: in the linear scheme the network and its filter too are fitted again every ten days of history.  In
        the published one a forecast acts as with ``"linear"``; :meth:`partial_fit` also identifies the network again
        and trains any forecaster anew, for which the measured rows are kept.
    memory : str or joblib.Memory, optional
        Where identifications are kept, so that candidates of a search that share one identify it once (published).
    n_jobs : int, optional
        Passed to parts that take it and have none (published).
    random_state : int, RandomState or None
        Passed to parts that take it and have none (published); the linear scheme draws nothing at random.
    verbose : int, default=0
        1 shows progress.
    columns : dict of role to column, optional
        Columns whose names are not their roles; default is the gray box's own ``columns``.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; default is the gray box's own.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.

    Attributes
    ----------
    gray_box_ : estimator
        The identified network.  In the linear scheme the fitted network with ``theta_`` (resistances [K/kW],
        capacitances [kWh/K]), ``disturbance_`` (of its filter), ``coef_`` (by channel) and ``schedule_`` (``gain`` [kW]
        and ``ua`` [kW/K] by day type and hour).
    forecaster_ : estimator
        The fitted disturbance model; in the linear scheme the same as ``gray_box_``, whose schedules it is.
    weights_ : DataFrame
        Shares of network and ARX by group of leads, as the training has them (linear scheme only).
    sampling_time_, disturbance_step_ : Timedelta
        Steps of the table and of the disturbance.
    zeta_ : Series
        The training disturbance by steps of the forecaster [kW or K]; in the linear scheme that of the schedules.
    intervals_ : LeadIntervals
        What quantiles are made of; learned when first asked for.

    Examples
    --------
    >>> from skhybrid import HybridPredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=14, random_state=0)
    >>> model = HybridPredictor().fit(office.X[:-96], office.y[:-96])
    >>> tomorrow = model.predict(office.X[-96:])
    >>> tomorrow.shape
    (96,)
    """

    def __init__(
        self,
        gray_box=None,
        forecaster=None,
        *,
        disturbance="input",
        horizon="1D",
        adapt="full",
        memory=None,
        n_jobs=None,
        random_state=None,
        verbose=0,
        columns=None,
        sampling_time=None,
        origin_step=None,
        max_missing=0.5,
    ):
        self.gray_box = gray_box
        self.forecaster = forecaster
        self.disturbance = disturbance
        self.horizon = horizon
        self.adapt = adapt
        self.memory = memory
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose
        self.columns = columns
        self.sampling_time = sampling_time
        self.origin_step = origin_step
        self.max_missing = max_missing

    # --------------------------------------------------------------------------------------------------------- fit
    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> HybridPredictor:
        """Learn from a training table, by the scheme that the parameters ask for.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows by the data contract.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As the parts do, if ``disturbance`` or ``adapt`` is unknown, and if the network has several measured nodes.
        """
        if self.disturbance not in ("input", "output"):
            raise ValueError(f"disturbance={self.disturbance!r} is neither 'input' nor 'output'.")
        if self.adapt not in (None, "linear", "full"):
            raise ValueError(f"adapt={self.adapt!r} is none of None, 'linear', 'full'.")
        scheme = self._make_scheme()
        table = self._read(X, reset=True)
        target = read_target(y, table, max_missing=self.max_missing, role="T_za")
        self._check_spans(table.step)
        self._scheme = scheme.fit(table, target)
        self.sampling_time_ = table.step
        self._mean = float(np.nanmean(target)) if np.isfinite(target).any() else 20.0
        self._training = table.replace(history={"T_za": target})  # intervals are learned from it, if ever asked for
        self._intervals, self._learned_to = None, None if table.utc is None else table.utc[-1]
        self._keep(table, target, behind=False)
        return self

    @one_blas_thread
    def with_forecasters(self, forecasters: Sequence[Any], disturbance: str | None = None) -> list[HybridPredictor]:
        """Fit other forecasters on the disturbance of this fitted estimator's network, which is not identified again.

        To the bit what a fit with each of them on the same training table gives (published scheme only).

        Parameters
        ----------
        forecasters : sequence of estimator
            Regressors of the disturbance, unfitted; they are cloned.
        disturbance : {"input", "output"}, optional
            Of which kind; default is this estimator's own.

        Returns
        -------
        list of HybridPredictor
            Fitted, one a forecaster, that share nothing that changes with this estimator or each other.

        Raises
        ------
        ValueError
            If the scheme of this estimator or of a forecaster is the linear one, or rows were taken in since ``fit``.
        """
        check_is_fitted(self)
        kind = self.disturbance if disturbance is None else disturbance
        made = [clone(self).set_params(forecaster=one, disturbance=kind) for one in forecasters]
        if not isinstance(self._scheme, TwoStageScheme) or any(one._is_linear() for one in made):
            raise ValueError("the linear scheme learns network and disturbance as one; fit it by itself.")
        training = self._training
        if self._last_rows.time[-1] != training.time[-1]:
            raise ValueError("rows were taken in since fit; fit again before other forecasters are fitted.")
        parts = [one._part(one.forecaster, one._default_forecaster()) for one in made]
        learned = {
            name: value for name, value in vars(self).items() if name not in {*self.get_params(False), "_scheme"}
        }
        for one, scheme in zip(made, self._scheme.with_forecasters(training, parts, kind), strict=True):
            vars(one).update(deepcopy(learned), _scheme=scheme, _intervals=None)
        return made

    def _make_scheme(self) -> Scheme:
        """What forecasts the building, unfitted: the one place that decides it."""
        if self._is_linear():
            given = self.gray_box
            network = get_network(getattr(given, "network", DEFAULT_NETWORK))
            self._refuse_zones(network)
            known = dict(getattr(given, "known", None) or {})
            return ScheduleScheme(network, known=known, horizon=self.horizon, adapt=self.adapt)
        gray_box = self._part(self.gray_box, self._default_gray_box())
        self._refuse_zones(get_network(gray_box.network))
        forecaster = self._part(self.forecaster, self._default_forecaster())
        return TwoStageScheme(gray_box, forecaster, disturbance=self.disturbance, adapt=self.adapt, memory=self.memory)

    @property
    def scheme(self) -> str:
        """Which scheme the parameters ask for: ``"linear"`` or ``"published"``."""
        return "linear" if self._is_linear() else "published"

    def _is_linear(self) -> bool:
        """Whether the disturbance is learned through the network, which is what happens when nothing is said."""
        if self.forecaster is None:
            return self.gray_box is None and self.disturbance == "input"
        linear = isinstance(self.forecaster, DisturbanceForecaster) and self.forecaster.model == "linear"
        if linear and self.disturbance != "input":
            raise ValueError("forecaster 'linear' is heat on the zone; use disturbance='input', or another forecaster.")
        return linear

    @staticmethod
    def _refuse_zones(network: RCNetwork) -> None:
        if len(network.measured_nodes) > 1:
            raise ValueError(
                f"network {network.name} has several measured temperatures; HybridPredictor "
                "forecasts one zone, so fit the identification itself."
            )

    def _present_scheme(self) -> Scheme:
        """The fitted scheme; ``adapt`` may have been set since, as ``horizon`` may."""
        scheme = self._scheme
        if scheme.adapt != self.adapt:
            scheme = copy(scheme)
            scheme.adapt = self.adapt
        return scheme

    def __getattr__(self, name: str) -> Any:
        # what the scheme has learned (gray_box_, zeta_ ...) is shown here too, whatever scheme it is
        scheme = vars(self).get("_scheme")
        if scheme is not None and name.endswith("_") and not name.startswith("_"):
            return getattr(scheme, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def set_params(self, **params: Any) -> HybridPredictor:
        """Set parameters, also those of parts (``forecaster__case``), of the default part where none was given.

        Parameters
        ----------
        **params : dict

        Returns
        -------
        self
        """
        for name, make in (("gray_box", self._default_gray_box), ("forecaster", self._default_forecaster)):
            if getattr(self, name) is None and name not in params and any(p.startswith(f"{name}__") for p in params):
                setattr(self, name, make())
        return super().set_params(**params)

    def _default_gray_box(self) -> PeriodicDisturbanceID:
        return PeriodicDisturbanceID()

    def _default_forecaster(self) -> DisturbanceForecaster:
        model = "linear" if self.gray_box is None and self.disturbance == "input" else "ridge"
        return DisturbanceForecaster(model=model, horizon=self.horizon or "1D")

    def _part(self, given: Any, default: Any) -> Any:
        """A clone of a part, with what it can take over from this estimator."""
        part = clone(given if given is not None else default)
        params = part.get_params(deep=False)
        passed = {"n_jobs": self.n_jobs, "random_state": self.random_state, "verbose": self.verbose or None}
        wanted = {k: v for k, v in passed.items() if k in params and not params[k] and v is not None}
        return part.set_params(**wanted)

    # ----------------------------------------------------------------------------------------------- tables at hand
    def _read(self, X: Any, *, reset: bool) -> ZoneTable:
        step = self.sampling_time if self.sampling_time is not None else getattr(self.gray_box, "sampling_time", None)
        return read_table(
            self,
            X,
            columns=self._columns(),
            required=self._network().required_roles,
            needed=self._reads,
            sampling_time=step,
            reset=reset,
            min_rows=2 if reset else 1,
            expected_step=None if reset else self.sampling_time_,
        )

    def _reads(self, role: str) -> bool:
        """Weather and plant, and of further boundary temperatures those that the network names."""
        return not role.startswith("T_") or role == "T_oa" or self._network().reads(role)

    def _network(self) -> RCNetwork:
        return get_network(getattr(self.gray_box, "network", DEFAULT_NETWORK))

    def _columns(self) -> Mapping[str, Any] | None:
        return self.columns if self.columns is not None else getattr(self.gray_box, "columns", None)

    def _read_X(self, X: Any) -> ZoneTable:
        table = self._read(X, reset=False)
        # a measured disturbance is not a thing that this estimator reads
        return table.replace(history={k: v for k, v in table.history.items() if k == "T_za"})

    def _cold_value(self, table: ZoneTable) -> float:
        return self._mean if table.T_za is None or not np.isfinite(table.T_za[0]) else float(table.T_za[0])

    # ----------------------------------------------------------------------------------------------------- forecast
    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        return self._present_scheme().forecast(table, origins, n_leads).temperature

    def _learn_intervals(self) -> LeadIntervals:
        table = self._training
        n_leads = max(rows_per_day(table.step), rows_of(self.horizon or "1D", table.step))
        left_out = self._present_scheme().calibration_errors(table, table.history["T_za"], n_leads)
        return intervals_from(left_out, table)

    def _first_past(self, table: ZoneTable) -> int:
        if table.utc is None or self._learned_to is None:
            return table.n_history
        # what was taken in since, and not learned from, tells as well, once the filter has had a day to find the state
        behind = int((table.utc <= self._learned_to).sum())
        return min(max(behind, rows_per_day(table.step)), table.n_history)

    def forecast(
        self, history: pd.DataFrame | None, future: pd.DataFrame, quantiles: Sequence[float] | None = None
    ) -> pd.DataFrame:
        """Forecast from the last row of a history.

        Parameters
        ----------
        history : DataFrame or None
            Rows up to the origin, with ``T_za``; where it continues the training table, that is taken as its history.
            None: all that is known from :meth:`fit`, :meth:`update` and :meth:`partial_fit`; both schemes go on from
            where they stand.
        future : DataFrame
            The rows to forecast, with the known future inputs; it begins one step after the history.
        quantiles : sequence of float, optional
            As in :meth:`predict_quantiles`; the more days of history, the better the intervals know the present.

        Returns
        -------
        DataFrame
            Index of ``future``; ``T_za`` [degC] at each stamp and ``zeta`` [kW, or K for an output disturbance] over
            the step that begins there; with ``quantiles`` a column ``q_0.1`` [degC] for each of them.  In the linear
            scheme ``zeta`` is what the network reckons with; the temperature is that of the blend.

        Raises
        ------
        ValueError
            If the two do not join evenly or a column is missing.
        """
        check_is_fitted(self)
        if (history is not None and not len(history)) or not len(future):
            raise ValueError("history and future need at least one row each.")
        levels = None if quantiles is None else read_quantiles(quantiles)
        if history is None:
            paths, table = self._from_now(future), None
        else:
            paths, table = self._from_history(history, future)
        found = {"T_za": paths.temperature[0], "zeta": paths.zeta[0]}
        if levels is not None:
            table = append_tables(self._known_end(), self._read_future(future)) if table is None else table
            origin = np.array([table.n_rows - len(future) - 1])
            bands = self._quantile_paths(table, origin, len(future), levels)[0]
            found |= dict(zip(quantile_columns(levels), bands.T, strict=True))
        return pd.DataFrame(found, index=future.index)

    @one_blas_thread
    def _from_now(self, future: pd.DataFrame) -> Paths:
        return self._present_scheme().forecast_live(self._read_future(future))

    def _read_future(self, future: pd.DataFrame) -> ZoneTable:
        names = list(getattr(self, "feature_names_in_", future.columns))
        past = {"T_za", (self._columns() or {}).get("T_za", "T_za")}
        absent = [name for name in names if name not in future.columns and name not in past]
        if absent:
            raise ValueError(f"future has no column {absent[0]!r}, which the training table has.")
        table = self._read_following(future.reindex(columns=names))
        self._refuse_unless_following(table)
        return table

    def _from_history(self, history: pd.DataFrame, future: pd.DataFrame) -> tuple[Paths, ZoneTable]:
        stamps = in_zone_of(future.index, history.index)
        names = list(getattr(self, "feature_names_in_", history.columns))
        absent = [n for n in names if n not in future.columns and n in history.columns]
        past = {"T_za", (self._columns() or {}).get("T_za", "T_za")}
        if [n for n in absent if n not in past]:
            raise ValueError(f"future has no column {next(n for n in absent if n not in past)!r}, which history has.")
        whole = pd.concat([history, future.reindex(columns=history.columns).set_axis(stamps)])
        for name in past & set(whole.columns):
            whole[name] = whole[name].where(np.arange(len(whole)) < len(history))
        table, n_tail = self._with_history(whole)
        origin = np.array([n_tail + len(history) - 1])
        return self._present_scheme().forecast(table, origin, len(future)), table

    # ---------------------------------------------------------------------------------------------------------- load
    def predict_load(self, X: Any, setpoint: Any, limits: Any = None) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point, under the forecast disturbance.

        The linear scheme asks its network alone, for ARX knows no plant.  It holds a temperature that moves smoothly;
        of one that does not, such as a measured one, it follows what is not noise (see the user guide).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Heating and cooling columns are read up to each origin only; after it they are what is sought.
        setpoint : float, array-like of shape (n_samples,), pair or DataFrame of two columns
            Wanted temperature at each row's stamp [degC].  Or a thermostat's heating and cooling set-point over each
            row's step, as a pair ``(heat, cool)`` of numbers or of values by row, or as two columns: between the two
            there is no load, and None as one of a pair leaves that side free.
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; each a number or one value a row, such as 0 at hours when the
            plant is off.  The capacity of its stages holds beside them; where only its heat is measured there is no
            other limit.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW] over each row's step, clipped to what the plant can do, and ``T_za``
            [degC] at each row's stamp under them; stages and heat with ``_unclipped`` as the set-point would need
            (paper Eq. inverseQ2), and ``zeta`` as forecast.

        Raises
        ------
        ValueError
            If a set-point or limit has another length or other stamps than X or a NaN, or if the lower of two is above
            the higher.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        here = table.rows(slice(n_tail, None))
        wanted, within = read_setpoint(setpoint, here), read_limits(limits, here)
        origins = origin_rows(here.time, self.horizon, self.origin_step, here.step)
        return self._present_scheme().required_heat(table, origins + n_tail, wanted, within).set_axis(here.index)
