"""Public forecasts of a building, over the fitted predictors of its zones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from ..._joining import refuse_no_frames
from ..._summary import SummaryMixin
from ..._table import as_pandas, checked_columns, read_array, refuse_shape
from ..._threads import one_blas_thread
from ..._warnings import warnings_joined
from ...control import AffineForecast, read_inputs
from ...forecasting.quantiles import DEFAULT_QUANTILES, load_quantile_columns, quantile_columns
from ...forecasting.weather_error import read_weather_error, weather_of_quantiles
from ..base import BaseHybrid
from ..joint_errors import JointErrors, SampleMixin
from ..parts import preprocessed
from ..thermostat_law.closed_loop_paths import ClosedLoopPaths
from .building_forecast import FittedZones, by_frames, under_heat
from .building_plans import affine_of_zones, closed_loops, loads_of_zones
from .building_tables import of_zone, tables_of_zones
from .coupled_zone import CoupledZone
from .zone_columns import ZoneColumns


class BaseBuilding(SampleMixin, SummaryMixin, MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Base of :class:`BuildingPredictor`: its forecasts, over what that has fitted."""

    estimator: Any
    preprocess_: Any
    zones_: list[str]
    own_: dict[str, BaseHybrid]
    coupled_: dict[str, CoupledZone]
    _columns: ZoneColumns
    _last: dict[str, float]
    _single: bool
    _joint: JointErrors | None

    @property
    def _zones(self) -> FittedZones:
        """The fitted zones, over which all forecasts are made."""
        check_is_fitted(self)
        return FittedZones(self._columns, self.own_, self.coupled_, self._last)

    @property
    def shared_plants_(self) -> list[str]:
        """Columns of stages and heat of plants that serve several zones."""
        return self._zones.columns.shared_plants

    def _read(self, X: Any, *, reset: bool = False) -> Any:
        if not isinstance(X := as_pandas(X), pd.DataFrame):
            return read_array(self, X, reset=reset, ensure_all_finite=False)
        refuse_shape(X, 0)
        if reset:
            validate_data(self, X, skip_check_array=True)
        return X

    def _prepared(self, X: Any) -> Any:
        """A table after the estimator's ``preprocess``."""
        names = dict.fromkeys([*getattr(self.preprocess_, "feature_names_in_", ()), *getattr(X, "columns", ())])
        role_of = {column: role for role, column in checked_columns(getattr(self.estimator, "columns", None)).items()}
        return preprocessed(self.preprocess_, X, [n for n in names if str(role_of.get(n, n)).startswith("T_za")])

    @warnings_joined()
    def predict(self, X: Any) -> Any:
        """Forecast every row from the last origin before it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; what was measured is read only up to each origin.

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_zones), float64
            [degC]; a frame by zone where X is one, and of shape (n_samples,) after a one-dimensional ``y``.
        """
        zones, X = self._zones, self._prepared(self._read(X))
        out = zones.rolled(X, lambda origins, span: zones.paths(X, origins, span)[1])
        if self._single:
            return out[:, 0]
        return pd.DataFrame(out, X.index, self.zones_) if isinstance(X, pd.DataFrame) else out

    @warnings_joined()
    def predict_quantiles(
        self, X: Any, quantiles: Sequence[float] = DEFAULT_QUANTILES, *, weather_error: Any = None
    ) -> np.ndarray:
        """Forecast quantiles of every row from the last origin before it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        quantiles : sequence of float, default (0.1, 0.5, 0.9)
            In (0, 1), increasing.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`HybridPredictor.predict_quantiles`.

        Returns
        -------
        ndarray of shape (n_samples, n_zones, n_quantiles), float64
            [degC]; of several zones together :meth:`sample` draws.
        """
        zones, X = self._zones, self._prepared(self._read(X))
        given = quantiles, read_weather_error(weather_error)
        return zones.rolled(X, lambda origins, span: zones.bands(X, origins, span, *given))

    @warnings_joined()
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
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`HybridPredictor.predict_quantiles`.

        Returns
        -------
        ndarray of shape (n_origins, n_leads, n_zones, n_quantiles), float64
            [degC]; NaN after the last row of X.
        """
        zones, weather = self._zones, read_weather_error(weather_error)
        return zones.bands(self._prepared(self._read(X)), np.asarray(origins), horizon, quantiles, weather)

    @warnings_joined()
    def predict_from(self, X: Any, origins: Sequence[int] | np.ndarray, horizon: Any = None) -> np.ndarray:
        """Forecast the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        origins : sequence of int
            Row numbers of X; -1 is the last known row, where X follows it.
        horizon : timedelta-like, optional

        Returns
        -------
        ndarray of shape (n_origins, n_leads, n_zones), float64
            Forecasts of the rows ``origin + 1, origin + 2, ...`` [degC]; NaN after the last row of X.
        """
        return self._zones.paths(self._prepared(self._read(X)), np.asarray(origins), horizon)[1]

    @warnings_joined()
    @one_blas_thread
    def forecast(
        self,
        history: pd.DataFrame | None,
        future: pd.DataFrame,
        T_za: Any = None,
        setpoint: Any = None,
        quantiles: Sequence[float] | None = None,
        *,
        weather_error: Any = None,
        limits: Any = None,
    ) -> pd.DataFrame:
        """Forecast all zones from the last row of a history, under given heat or under their thermostats.

        Parameters
        ----------
        history : DataFrame or None
            Rows up to the origin, with ``T_za_<zone>``; None: all that is known.
        future : DataFrame
            The rows to forecast, with the known future inputs.
        T_za : mapping of zone to float, Series, row of a frame or sequence, optional
            Temperatures measured at the first row of ``future``, which then is *now* [degC].  A zone that they leave
            out, or of which they are NaN, is forecast there as in later rows.
        setpoint : mapping or DataFrame of zone to set-point, or one for all zones, optional
            As in :meth:`HybridPredictor.forecast`; a zone that a mapping leaves out is free, and one without a plant is
            so always.  Columns of a frame may also be ``T_heat_set_<zone>`` and ``T_cool_set_<zone>``.  Without it, or
            with None for a zone, these columns of ``future`` count where it has no heat.  Where it has neither, a plant
            of which no thermostat was learned runs as usual.
        quantiles : sequence of float, optional
            Of each zone's temperature, and of its load under a thermostat; a zone under ``setpoint`` whose thermostat
            was not learned (``thermostat_learned_``) has none.  See also :meth:`sample`.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`HybridPredictor.forecast`.
        limits : tuple of (lowest, highest), or mapping of zone to such pairs, optional
            What the plant of each zone can do, as in :meth:`HybridPredictor.forecast`; :meth:`predict_load` has limits
            that zones share.

        Returns
        -------
        DataFrame with the index of ``future``
            The columns of :meth:`HybridPredictor.forecast` with the zone's name: ``T_za_<zone>`` [degC],
            ``zeta_<zone>`` [kW], ``q_0.1_<zone>`` [degC], ``Q_hvac_<zone>`` [kW] ...

        Raises
        ------
        ValueError
            As there; the message names the zone.  Also under set-points where zones share a plant (``shared_plants_``).

        Warns
        -----
        PlanWarning
            As there, and of heat and set-points in ``future`` of a zone that ``setpoint`` leaves out.
        MeasurementWarning
            Of zones that are not measured in the last hour of the history, where others are.
        SkhybridWarning
            Of plants that run as usual, once per fit.
        """
        zones = self._zones
        refuse_no_frames(history, future)
        known, ahead = None if history is None else self._prepared(history), self._prepared(future)
        given = zones.arguments
        now, wanted, within = given.now(T_za), given.setpoints(setpoint), given.limits(limits)
        asked = quantiles, weather_of_quantiles(weather_error, quantiles)
        setpoints = wanted or any(model._has_setpoints_only(ahead) for model in self.own_.values())
        if setpoints:
            zones.columns.refuse_shared_plants()
            zones.warn_of_unread(wanted, ahead)
        alone = known is None and not setpoints and not within
        tables = tables_of_zones(self.own_, self._columns, ahead) if alone else None
        if tables is None:
            of = by_frames(zones, known, ahead, now, wanted if setpoints else None, within, *asked)
        else:
            of = under_heat(tables, ahead.index, now, *asked)
        found = zones.joined(of, now)
        if known is not None:
            zones.warn_of_silent(zones.columns.known(known), len(known))
        return pd.DataFrame(found, future.index)

    @warnings_joined()
    def closed_loop_from(
        self,
        X: pd.DataFrame,
        origins: Sequence[int] | np.ndarray,
        horizon: Any = None,
        quantiles: Sequence[float] | None = None,
        weather_error: Any = None,
    ) -> dict[str, ClosedLoopPaths]:
        """Forecast all zones from given rows, under the set-points of X and their learned thermostats.

        Parameters
        ----------
        X : DataFrame of n_samples rows
            Weather and set-points are known in advance; heat of every zone is read before each origin, ``T_za_<zone>``
            up to it.  After it, neighbours are as forecast.
        origins : sequence of int
            Row numbers of X, increasing.
        horizon : timedelta-like, optional
        quantiles : sequence of float, optional
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`forecast`.

        Returns
        -------
        dict of str to ClosedLoopPaths
            By zone, as :meth:`HybridPredictor.closed_loop_from` has it; a zone without a plant is free, and a plant of
            which no thermostat was learned runs as usual.

        Raises
        ------
        ValueError
            As there, in the name of the zone; also where zones share a plant, or none has one.

        Warns
        -----
        SkhybridWarning
            Of plants that run as usual, once per fit.
        """
        zones = self._zones
        zones.columns.refuse_shared_plants()
        zones.arguments.refuse_without_plant("heat_known=False")
        X, rows = self._prepared(self._read(X)), np.asarray(origins)
        return closed_loops(zones, X, rows, horizon, quantiles, read_weather_error(weather_error))

    @warnings_joined()
    def predict_load(self, X: pd.DataFrame, setpoint: Any, limits: Any = None) -> pd.DataFrame:
        """Heating and cooling that brings each zone to its set-points, under the forecast disturbances.

        Parameters
        ----------
        X : DataFrame of n_samples rows
            As in :meth:`HybridPredictor.predict_load`.
        setpoint : mapping or DataFrame of zone to set-point, or one for all zones
            As there; a zone that a mapping leaves out is free, and one without a plant is so always.
        limits : tuple of (lowest, highest), or mapping of zone to such pairs, optional
            What one plant gives to all zones together [kW], each a number or one value per row, with 0 between them; or
            what each zone's own plant can do.  Where all zones together need more, every zone gets the same share of
            what it would take if the plant were its own.

        Returns
        -------
        DataFrame of length n_samples
            The columns of :meth:`HybridPredictor.predict_load` with the zone's name, such as ``Q_hvac_<zone>`` [kW];
            without a plant ``T_za_<zone>`` and ``zeta_<zone>`` only.

        Raises
        ------
        ValueError
            As there; the message names the zone.  Also if limits of all zones together exclude 0 kW, or zones share the
            column of a plant (``shared_plants_``).
        """
        zones = self._zones
        zones.columns.refuse_shared_plants()
        wanted = zones.arguments.setpoints(setpoint)
        rows = zones.with_measured(self._prepared(self._read(X)))
        return loads_of_zones(zones, rows, wanted, limits)

    @warnings_joined()
    def affine_forecast(
        self, history: pd.DataFrame | None, future: pd.DataFrame, inputs: Sequence[str] | None = None, T_za: Any = None
    ) -> AffineForecast:
        """Forecast as an affine function of the heat that is planned for the zones: ``T = free + gain @ q``.

        Parameters
        ----------
        history, future
            As in :meth:`forecast`; columns of the ``inputs`` may be absent from ``future``.
        inputs : sequence of str, optional
            What is decided: roles of heating and cooling, such as ``"Q_hvac_north"``; default is all of them.
        T_za
            As in :meth:`forecast`.

        Returns
        -------
        AffineForecast
            ``free`` (H, n_zones) [degC], ``gain`` (H, H, n_inputs, n_zones) [K per kW or stage], ``zeta`` (H, n_zones).

        Raises
        ------
        ValueError
            As in :meth:`forecast`, and if an input was not in training.
        """
        zones, columns = self._zones, self._columns.columns
        refuse_no_frames(history, future)
        roles = list(read_inputs(inputs, list(columns), columns.__getitem__))
        ahead, now = self._prepared(future), zones.arguments.now(T_za)
        known = None if history is None else self._prepared(history)
        found = affine_of_zones(zones, known, ahead, roles, now)
        if known is not None:
            zones.warn_of_silent(zones.columns.known(known), len(known))
        return AffineForecast(*found, future.index, tuple(roles))

    def _samples(self, frame: pd.DataFrame, levels: list[float], T_za: Any, rng: np.random.RandomState) -> pd.DataFrame:
        """Paths of all zones by a forecast with quantiles; the first row may be *now*."""
        load, names = load_quantile_columns(levels)[0], quantile_columns(levels)
        if self._joint is not None and not any(f"{load}_{zone}" in frame for zone in self.zones_):
            bands = {f"T_za_{zone}": frame[[f"{name}_{zone}" for name in names]] for zone in self.zones_}
            return self._joint.samples(bands, self._zones.first._origin_hour(frame, T_za), rng)
        seed, found = rng.randint(2**31 - 1), []
        for zone, model in self.own_.items():  # with one seed, errors of one time are drawn for all of them
            with of_zone(zone):
                found.append(model._samples(frame, levels, T_za, np.random.RandomState(seed), f"_{zone}"))
        return pd.concat(found, axis=1)
