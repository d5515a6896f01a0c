"""The fitted predictors of a building's zones, and their forecasts: by themselves, blended with neighbours."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from ..._joining import read_now
from ..._last_known import held_paths
from ..._table import SETPOINT_ROLES, ZoneTable, listed
from ..._time import rows_in
from ..._warnings import ignore, warn_user, warnings_to
from ...exceptions import MeasurementWarning, PlanWarning
from ...forecasting.quantiles import read_quantiles
from ...forecasting.weather_error import WeatherError
from ..base import BaseHybrid
from ..plant_run import Wanted
from .arguments_by_zone import NO_SETPOINTS, ArgumentsByZone
from .building_tables import arrays_by_name, of_zone, warn_of_usual, with_neighbour_temperatures, with_next
from .coupled_zone import CoupledZone
from .zone_columns import NEXT, ZoneColumns, carried_on

_T = TypeVar("_T")
#: columns of the forecast of a zone by one of its predictors, under the temperatures of its neighbours
_Columns = Callable[[BaseHybrid, str, Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class FittedZones:
    """The zones of a building, by the predictors that have learned them."""

    columns: ZoneColumns
    own: Mapping[str, BaseHybrid]  # of each zone by itself
    coupled: Mapping[str, CoupledZone]  # of zones with neighbours
    last: Mapping[str, float]  # known temperature of each zone [degC]

    @property
    def first(self) -> BaseHybrid:
        """The predictor of the first zone by itself."""
        return self.own[self.columns.zones[0]]

    @property
    def arguments(self) -> ArgumentsByZone:
        """Reading of what is given by zone."""
        return ArgumentsByZone(self.columns.zones, [zone for zone, model in self.own.items() if model._plant])

    def carried_on(self, T: pd.DataFrame) -> dict[str, np.ndarray]:
        """Measured temperatures (n, n_zones) by zone, the last known one where one is missing."""
        return {zone: carried_on(T[zone].to_numpy(dtype=float), self.last[zone]) for zone in self.columns.zones}

    def last_after(self, T: pd.DataFrame) -> dict[str, float]:
        """The last known temperature of each zone after measured ones (n, n_zones)."""
        return {zone: float(values[-1]) for zone, values in self.carried_on(T).items()}

    def warn_of_silent(self, measured: pd.DataFrame, n_new: int) -> None:
        """Warn of zones that are not measured in the last hour of known rows (n,), where others are.

        Of a silence that goes on, less than a day of new rows tells once: when it has lasted for an hour.
        """
        hour, day = (rows_in(hours, self.first.sampling_time_) for hours in (1.0, 24.0))
        silent = {zone: int(T.isna()[::-1].cumprod().sum()) for zone, T in measured.items()}
        for zone, n_rows in silent.items():
            if n_rows >= hour > min(silent.values()) and (n_new >= day or n_rows - n_new < hour):
                stamps = measured[zone].index
                warn_user(
                    f"zone {zone!r} has no temperature from {stamps[-n_rows]} to {stamps[-1]}: it is forecast from "
                    "what was known before and from its neighbours.",
                    MeasurementWarning,
                )

    def warn_of_unread(self, wanted: Mapping[str, Any], ahead: pd.DataFrame) -> None:
        """Warn of plans and set-points in rows ahead of zones that the ``wanted`` set-points leave out."""
        for zone, model in self.own.items():
            left_out = bool(model._plant) and wanted.get(zone) is NO_SETPOINTS
            names = map(model._column_of, (*model._plant, *SETPOINT_ROLES) if left_out else ())
            if unread := [name for name in names if name in ahead and ahead[name].any()]:
                warn_user(
                    f"setpoint leaves out zone {zone!r}, so that its plant is off and {listed(unread)} of future not "
                    "read; give the zone None to have it read.",
                    PlanWarning,
                )

    def with_measured(self, X: Any, T: pd.DataFrame | None = None) -> Any:
        """X with the measured temperatures (n, n_zones), by default its own, as boundaries of neighbours."""
        if not isinstance(X, pd.DataFrame):
            return X
        return with_next(X, self.carried_on(self.columns.known(X) if T is None else T))

    def rolled(self, X: Any, paths_of: Callable[[np.ndarray, pd.Timedelta], np.ndarray]) -> np.ndarray:
        """(n_samples, n_zones, ...) forecasts of every row from the last origin before it."""
        origins, leads = self._rolled_origins(X)
        paths = paths_of(origins, max(int(leads.max()), 1) * self.first.sampling_time_)
        out = np.full((len(X), *paths.shape[2:]), np.nan)
        if origins[0] >= 0:
            value = self.of_each(lambda model: model.predict(X[:1])[0])
            out[0] = np.reshape(list(value.values()), (-1, *[1] * (out.ndim - 2)))
        for origin, count, path in zip(origins, leads, paths, strict=True):
            out[origin + 1 : origin + 1 + count] = path[:count]
        return out

    def of_each(self, of: Callable[[BaseHybrid], _T]) -> dict[str, _T]:
        """By zone what its predictor by itself gives, whose messages name the zone."""
        found = {}
        for zone, model in self.own.items():
            with of_zone(zone):
                found[zone] = of(model)
        return found

    def _rolled_origins(self, X: Any) -> tuple[np.ndarray, np.ndarray]:
        """Origins of ``predict`` and their numbers of rows: of a zone with measurements, where any zone has some."""
        found = []
        for zone, model in self.own.items():
            with of_zone(zone):
                found.append(model.rolled_origins(X))
            if len(found[-1][0]) > 1:
                break
        return max(found, key=lambda rolled: len(rolled[0]))

    def bands(
        self, X: Any, origins: np.ndarray, horizon: Any, quantiles: Sequence[float], weather: WeatherError | None
    ) -> np.ndarray:
        """(n_origins, n_leads, n_zones, n_quantiles)."""
        own, paths = self.paths(X, origins, horizon)
        given = {"quantiles": quantiles, "horizon": horizon, "weather_error": weather}
        bands = self.of_each(lambda model: model.predict_quantiles_from(X, origins, **given))
        for j, (zone, band) in enumerate(bands.items()):
            widths = self.coupled[zone].widths(band.shape[1])[:, None] if zone in self.coupled else 1.0
            bands[zone] = paths[..., j, None] + widths * (band - own[zone][..., None])
        return np.stack(list(bands.values()), axis=2)

    def paths(self, X: Any, origins: np.ndarray, horizon: Any) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """(n_origins, n_leads) of each zone by itself, and (n_origins, n_leads, n_zones) driven by neighbours' too."""
        own = self.of_each(lambda model: model.predict_from(X, origins, horizon))
        out = np.stack(list(own.values()), axis=-1)
        if not len(origins) or not self.coupled:
            return own, out
        X = self.with_measured(X)
        ahead = {zone: held_paths(path) for zone, path in own.items()}
        for zone, one in self.coupled.items():
            boundary = {NEXT + other: ahead[other] for other in one.neighbours}
            share, j = one.share(out.shape[1]), self.columns.zones.index(zone)
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                coupled = one.model.predict_from(X, origins, horizon, boundary)
            out[..., j] = (1.0 - share) * own[zone] + share * coupled
        return own, out

    def joined(self, of: _Columns, now: Collection[str] = ()) -> dict[str, np.ndarray]:
        """Columns of all zones, some measured ``now``; those with neighbours under what was forecast of these."""
        own = {}
        for zone, model in self.own.items():
            with of_zone(zone):
                own[zone] = of(model, zone, {})
        found = dict(own)
        for zone, one in self.coupled.items():
            T = {other: own[other]["T_za"] for other in one.neighbours}
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                found[zone] = one.blended(own[zone], of(one.model, zone, T), 0 if zone in now else 1)
        return {f"{name}_{zone}": values for zone, columns in found.items() for name, values in columns.items()}


def under_heat(
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


def by_frames(
    zones: FittedZones,
    known: pd.DataFrame | None,
    ahead: pd.DataFrame,
    now: Mapping[str, Any],
    wanted: Mapping[str, Any] | None,
    limits: Mapping[str, Any],
    quantiles: Sequence[float] | None,
    weather: WeatherError | None,
) -> _Columns:
    """Forecasts for which each predictor reads history and rows ahead by itself; none ``wanted``: under heat."""
    among = known if known is None or not zones.coupled else zones.with_measured(known)
    # a zone whose thermostat was not learned has no intervals of its load; they are refused where none was
    learned = any(model.thermostat_learned_ for model in zones.own.values())

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
        return arrays_by_name(model.forecast(*given, weather_error=None if levels is None else weather, limits=within))

    return of
