"""Forecasts of all zones from many origins under their set-points, in which learned thermostats act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..._table import ZoneTable
from ..._warnings import ignore, warnings_to
from ...control import LoadPaths
from ...forecasting.weather_error import WeatherError, read_weather_error
from ..base import BaseHybrid
from ..thermostat_law.closed_loop_paths import ClosedLoopPaths
from .building_forecast import BuildingForecastMixin
from .building_tables import with_neighbour_temperatures
from .coupled_zone import CoupledZone
from .zone_columns import NEXT, held
from .zone_messages import of_zone, warn_of_usual


class BuildingClosedLoopMixin(BuildingForecastMixin):
    """``closed_loop_from`` of :class:`BuildingPredictor`."""

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
        check_is_fitted(self)
        self._refuse_shared_plants()
        self._refuse_without_plant("heat_known=False")
        X, rows = self._prepared(self._read(X)), np.asarray(origins)
        asked = horizon, quantiles, read_weather_error(weather_error)
        tables, own = {}, {}
        for zone, model in self.own_.items():
            with of_zone(zone):
                warn_of_usual(model)
                tables[zone] = model._read_X(X)
                own[zone] = _paths(model, tables[zone], rows, *asked, {})
        known, found = self._carried_on(self._known(X)), dict(own)
        for zone, one in self.coupled_.items():
            table = with_neighbour_temperatures(tables[zone], {other: known[other] for other in one.neighbours})
            ahead = {NEXT + other: held(own[other].paths.temperature) for other in one.neighbours}
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                found[zone] = _blended(own[zone], _paths(one.model, table, rows, *asked, ahead), one)
        return found


def _paths(
    model: BaseHybrid,
    table: ZoneTable,
    origins: np.ndarray,
    horizon: Any,
    quantiles: Sequence[float] | None,
    weather: WeatherError | None,
    boundary: Mapping[str, np.ndarray],
) -> ClosedLoopPaths:
    """Forecasts of a zone by one of its predictors; without a plant it is free."""
    if model._plant:
        return model._running().closed_loop_from(table, origins, horizon, quantiles, boundary, weather)
    T = model.predict_from(table, origins, horizon, boundary or None)
    paths = LoadPaths(np.zeros(T.shape), T, np.full(T.shape, np.nan))
    if quantiles is None or boundary:  # quantiles with neighbours are made from those of the zone by itself
        return ClosedLoopPaths(paths)
    bands = model.predict_quantiles_from(table, origins, quantiles, horizon, weather_error=weather)
    return ClosedLoopPaths(paths, None, bands)


def _blended(own: ClosedLoopPaths, coupled: ClosedLoopPaths, one: CoupledZone) -> ClosedLoopPaths:
    """The blend of a zone's paths by itself and with neighbours, with quantiles as :meth:`CoupledZone.blended`."""
    n_leads = own.paths.temperature.shape[1]
    share = one.share(n_leads)
    over_step = np.append(0.0, share[:-1])  # heat that acts before the first temperature is that by itself

    def heat(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1.0 - over_step) * a + over_step * b

    T = (1.0 - share) * own.paths.temperature + share * coupled.paths.temperature
    bands, loads = own.temperature_bands, own.heat_bands
    if bands is not None:
        bands = T[..., None] + (bands - own.paths.temperature[..., None]) * one.widths(n_leads)[:, None]
    if loads is not None and coupled.heat_bands is not None:
        loads = heat(loads.swapaxes(1, 2), coupled.heat_bands.swapaxes(1, 2)).swapaxes(1, 2)
    plant = {name: heat(values, coupled.plant[name]) for name, values in own.plant.items()}
    paths = LoadPaths(heat(own.paths.heat, coupled.paths.heat), T, heat(own.paths.zeta, coupled.paths.zeta))
    return own._replace(paths=paths, heat_bands=loads, temperature_bands=bands, plant=plant)
