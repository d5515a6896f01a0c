"""Forecasts of all zones of a building from those of each zone: by itself, then under its neighbours' forecasts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..._joining import read_now, refuse_no_frames
from ..._table import ZoneTable, is_plant
from ..._threads import one_blas_thread
from ..._warnings import ignore, warnings_to
from ...forecasting.quantiles import DEFAULT_QUANTILES, read_quantiles
from ...forecasting.weather_error import WeatherError, read_weather_error, weather_of_quantiles
from ..base import BaseHybrid
from ..frames_forecast import Wanted
from .arguments_by_zone import ArgumentsByZone
from .building_tables import (
    BuildingTablesMixin,
    arrays_by_name,
    of_zone,
    tables_of_zones,
    warn_of_usual,
    with_neighbour_temperatures,
    with_next,
)
from .zone_columns import NEXT, held

_T = TypeVar("_T")
#: columns of the forecast of a zone by one of its predictors, under the temperatures of its neighbours
_Columns = Callable[[BaseHybrid, str, Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]


class BuildingForecastMixin(BuildingTablesMixin):
    """``predict``, ``forecast`` and their kin of :class:`BuildingPredictor`."""

    @property
    def shared_plants_(self) -> list[str]:
        """Columns of stages and heat of plants that serve several zones."""
        check_is_fitted(self)
        shared = [role for role in self._columns.columns if is_plant(role) and self._columns.owner(role) is None]
        return [str(self._columns.columns[role]) for role in shared if len(self.zones_) > 1]

    def _refuse_shared_plants(self) -> None:
        if self.shared_plants_:
            raise ValueError(
                f"column {self.shared_plants_[0]!r} is of a plant that several zones share, which cannot hold the "
                "set-points of each; give its stages or heat ahead to forecast, or plan them with affine_forecast and "
                "an optimiser."
            )

    @property
    def _arguments(self) -> ArgumentsByZone:
        return ArgumentsByZone(self.zones_, [zone for zone, model in self.own_.items() if model._plant])

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
        check_is_fitted(self)
        X = self._prepared(self._read(X))
        out = self._rolled(X, lambda origins, n_leads: self._paths(X, origins, self._span(n_leads)))
        if self._single:
            return out[:, 0]
        return pd.DataFrame(out, X.index, self.zones_) if isinstance(X, pd.DataFrame) else out

    def _rolled(self, X: Any, paths_of: Callable[[np.ndarray, int], np.ndarray]) -> np.ndarray:
        """(n_samples, n_zones, ...) forecasts of every row from the last origin before it."""
        origins, leads = self._rolled_origins(X)
        paths = paths_of(origins, max(int(leads.max()), 1))
        out = np.full((len(X), *paths.shape[2:]), np.nan)
        if origins[0] >= 0:
            value = self._of_each(lambda model: model.predict(X[:1])[0])
            out[0] = np.reshape(list(value.values()), (-1, *[1] * (out.ndim - 2)))
        for origin, count, path in zip(origins, leads, paths, strict=True):
            out[origin + 1 : origin + 1 + count] = path[:count]
        return out

    def _of_each(self, of: Callable[[BaseHybrid], _T]) -> dict[str, _T]:
        """By zone what its predictor by itself gives, whose messages name the zone."""
        found = {}
        for zone, model in self.own_.items():
            with of_zone(zone):
                found[zone] = of(model)
        return found

    def _rolled_origins(self, X: Any) -> tuple[np.ndarray, np.ndarray]:
        """Origins of ``predict`` and their numbers of rows: of a zone with measurements, where any zone has some."""
        found = []
        for zone, model in self.own_.items():
            with of_zone(zone):
                found.append(model.rolled_origins(X))
            if len(found[-1][0]) > 1:
                break
        return max(found, key=lambda rolled: len(rolled[0]))

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
        check_is_fitted(self)
        X = self._prepared(self._read(X))
        given = quantiles, read_weather_error(weather_error)
        return self._rolled(X, lambda origins, n_leads: self._bands(X, origins, self._span(n_leads), *given))

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
        check_is_fitted(self)
        weather = read_weather_error(weather_error)
        return self._bands(self._prepared(self._read(X)), np.asarray(origins), horizon, quantiles, weather)

    def _bands(
        self, X: Any, origins: np.ndarray, horizon: Any, quantiles: Sequence[float], weather: WeatherError | None
    ) -> np.ndarray:
        """(n_origins, n_leads, n_zones, n_quantiles)."""
        own = self._own_paths(X, origins, horizon)
        paths = self._among_neighbours(X, origins, horizon, own)
        given = {"quantiles": quantiles, "horizon": horizon, "weather_error": weather}
        bands = self._of_each(lambda model: model.predict_quantiles_from(X, origins, **given))
        for j, (zone, band) in enumerate(bands.items()):
            widths = self.coupled_[zone].widths(band.shape[1])[:, None] if zone in self.coupled_ else 1.0
            bands[zone] = paths[..., j, None] + widths * (band - own[zone][..., None])
        return np.stack(list(bands.values()), axis=2)

    def _span(self, n_rows: int) -> pd.Timedelta:
        return n_rows * self._first.sampling_time_

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
        check_is_fitted(self)
        return self._paths(self._prepared(self._read(X)), np.asarray(origins), horizon)

    def _paths(self, X: Any, origins: np.ndarray, horizon: Any) -> np.ndarray:
        """(n_origins, n_leads, n_zones)."""
        return self._among_neighbours(X, origins, horizon, self._own_paths(X, origins, horizon))

    def _own_paths(self, X: Any, origins: np.ndarray, horizon: Any) -> dict[str, np.ndarray]:
        """(n_origins, n_leads) of each zone by itself."""
        return self._of_each(lambda model: model.predict_from(X, origins, horizon))

    def _among_neighbours(self, X: Any, origins: np.ndarray, horizon: Any, own: Mapping[str, np.ndarray]) -> np.ndarray:
        """(n_origins, n_leads, n_zones) blended with the forecasts that neighbours' paths drive."""
        out = np.stack(list(own.values()), axis=-1)
        if not len(origins) or not self.coupled_:
            return out
        X = self._with_measured(X, self._known(X))
        ahead = {zone: held(path) for zone, path in own.items()}
        for zone, one in self.coupled_.items():
            boundary = {NEXT + other: ahead[other] for other in one.neighbours}
            share, j = one.share(out.shape[1]), self.zones_.index(zone)
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                coupled = one.model.predict_from(X, origins, horizon, boundary)
            out[..., j] = (1.0 - share) * own[zone] + share * coupled
        return out

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
        T_za : mapping of zone to float, Series or sequence, optional
            Temperatures measured at the first row of ``future``, which then is *now* [degC].
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
            As there.
        SkhybridWarning
            Of plants that run as usual, once per fit.
        """
        check_is_fitted(self)
        refuse_no_frames(history, future)
        known, ahead = None if history is None else self._prepared(history), self._prepared(future)
        given = self._arguments
        now, wanted, within = given.now(T_za), given.setpoints(setpoint), given.limits(limits)
        asked = quantiles, weather_of_quantiles(weather_error, quantiles)
        setpoints = wanted or any(model._has_setpoints_only(ahead) for model in self.own_.values())
        if setpoints:
            self._refuse_shared_plants()
        alone = known is None and not setpoints and not within
        tables = tables_of_zones(self.own_, self._columns, ahead) if alone else None
        if tables is None:
            of = self._by_frames(known, ahead, now, wanted if setpoints else None, within, *asked)
        else:
            of = self._under_heat(tables, ahead.index, now, *asked)
        return pd.DataFrame(self._joined(of, first_lead=0 if now else 1), future.index)

    def _under_heat(
        self,
        tables: Mapping[str, ZoneTable],
        index: pd.Index,
        now: Mapping[str, Any],
        quantiles: Sequence[float] | None,
        weather: WeatherError | None,
    ) -> _Columns:
        """Forecasts under given heat of rows that follow the known ones, by zone in ``tables``."""
        levels = None if quantiles is None else read_quantiles(quantiles)
        T_now = {}
        for zone, T in now.items():
            with of_zone(zone):
                T_now[zone] = read_now(T, index)

        def of(model: BaseHybrid, zone: str, T: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
            table = with_neighbour_temperatures(tables[zone], T)
            if not T:
                model._warn_of_plan(table, len(index))
            return model._columns_ahead(table, Wanted(T_now.get(zone), None if T else levels, weather))

        return of

    def _by_frames(
        self,
        known: pd.DataFrame | None,
        ahead: pd.DataFrame,
        now: Mapping[str, Any],
        wanted: Mapping[str, Any] | None,
        limits: Mapping[str, Any],
        quantiles: Sequence[float] | None,
        weather: WeatherError | None,
    ) -> _Columns:
        """Forecasts for which each predictor reads history and rows ahead by itself; none ``wanted``: under heat."""
        among = known if known is None or not self.coupled_ else self._with_measured(known, self._known(known))
        # a zone whose thermostat was not learned has no intervals of its load; they are refused where none was
        learned = any(model.thermostat_learned_ for model in self.own_.values())

        def of(model: BaseHybrid, zone: str, T: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
            history, rows = (among, with_next(ahead, T)) if T else (known, ahead)
            band = wanted.get(zone) if model._plant and wanted else None
            if band is None and wanted is not None and model._running()._has_setpoints_only(rows):
                warn_of_usual(model)
                model = model._running()
            # of a forecast with neighbours only the quantiles of a load are used; see CoupledZone.blended
            under_heat = band is None and not model._has_setpoints_only(rows)
            within = limits.get(zone) if model._plant and (wanted is None or not under_heat) else None
            without = bool(T) if under_heat else band is not None and learned and not model.thermostat_learned_
            levels = None if without else quantiles
            given = history, rows, now.get(zone), band, levels
            return arrays_by_name(
                model.forecast(*given, weather_error=None if levels is None else weather, limits=within)
            )

        return of

    def _joined(self, of: _Columns, first_lead: int) -> dict[str, np.ndarray]:
        """Columns of all zones; those with neighbours under what was forecast of these."""
        own = {}
        for zone, model in self.own_.items():
            with of_zone(zone):
                own[zone] = of(model, zone, {})
        found = dict(own)
        for zone, one in self.coupled_.items():
            T = {other: own[other]["T_za"] for other in one.neighbours}
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                found[zone] = one.blended(own[zone], of(one.model, zone, T), first_lead)
        return {f"{name}_{zone}": values for zone, columns in found.items() for name, values in columns.items()}
