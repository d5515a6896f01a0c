"""Forecasts from every origin: with the heat known, under weather forecasts, or under set-points with the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_of
from .._warnings import warnings_dropped
from ..exceptions import PlanWarning
from ..forecasting import WeatherError
from ..forecasting.features import irradiance_roles
from ..forecasting.quantiles import load_quantile_columns, quantile_columns
from ..hybrid.thermostat_law.closed_loop_paths import ClosedLoopPaths
from .single_reading import takes_tables


class Asked(NamedTuple):
    """Properties of the forecasts from every origin."""

    horizon: pd.Timedelta
    quantiles: Sequence[float] | None
    weather: WeatherError | None
    heat_known: bool


def target_roles(forecaster: Any) -> list[str]:
    """Roles of what is forecast: one, or those of the zones of a building or of the measured nodes of a network."""
    if hasattr(forecaster, "zones_"):
        return [f"T_za_{zone}" for zone in forecaster.zones_]
    measured = list(getattr(getattr(forecaster, "network_", None), "history_roles", ()))
    return measured if len(measured) > 1 else [getattr(forecaster, "_target_role", "T_za")]


def columns_from(forecaster: Any, table: Any, origins: np.ndarray, asked: Asked) -> dict[str, np.ndarray]:
    """Columns (n_origins, n_leads, ...) of forecasts from increasing origins of a table; NaN after its last row.

    After the rows that a model knows, its forecasts go on from them, as in use.
    """
    n_known = forecaster.n_known_of(table) if hasattr(forecaster, "n_known_of") else 0
    after = origins >= n_known
    if not n_known or not after.any():
        return _columns(forecaster, table, origins, asked)
    later = table.rows(slice(n_known, None)) if isinstance(table, ZoneTable) else table.iloc[n_known:]
    parts = [_columns(forecaster, later, origins[after] - n_known, asked)]
    if not after.all():
        parts.insert(0, _columns(forecaster, table, origins[~after], asked))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _columns(forecaster: Any, table: Any, origins: np.ndarray, asked: Asked) -> dict[str, np.ndarray]:
    """The columns of :func:`columns_from`, all read in one way."""
    quantiles, bands, loads = asked.quantiles, None, dict[str, np.ndarray]()
    if not asked.heat_known:
        paths, bands, loads = _paths_under_setpoints(forecaster, table, origins, asked)
    elif asked.weather is not None:
        if len(target_roles(forecaster)) > 1:
            raise ValueError(
                "weather_error with the heat known is for one zone; back-test the own_ estimators of a building, or "
                "its set-points with heat_known=False."
            )
        paths, bands = _paths_under(forecaster, table, origins, asked, asked.weather)
    else:
        paths = forecaster.predict_from(table, origins, horizon=asked.horizon)
        if quantiles is not None:
            bands = forecaster.predict_quantiles_from(table, origins, quantiles, horizon=asked.horizon)
    columns = {"y_pred": paths}
    if quantiles is not None and bands is not None:
        columns |= dict(zip(quantile_columns(quantiles), np.moveaxis(bands, -1, 0), strict=True))
    return columns | loads


def _paths_under(
    forecaster: Any, table: Any, origins: np.ndarray, asked: Asked, weather: WeatherError
) -> tuple[np.ndarray, np.ndarray | None]:
    """Forecasts from increasing origins of a table, with intervals that allow for errors of the weather forecast.

    Returns temperatures (n_origins, n_leads) and, where there are any, quantiles (n_origins, n_leads, n_quantiles)
    [degC]; NaN after the last row.  An estimator with ``update`` goes through rows that follow its training; any other
    sees the whole table, origin by origin.
    """
    if not takes_tables(forecaster) or not isinstance(table, ZoneTable):
        raise ValueError(
            "weather_error needs an estimator of this package without preprocess=, and X as a DataFrame with time "
            "stamps; leave weather_error=None."
        )
    horizon, quantiles = asked.horizon, asked.quantiles
    walker, begin = _walker(forecaster, table, int(origins[0]))
    bands_asked = {} if quantiles is None else {"quantiles": quantiles, "weather_error": weather}
    n_leads = rows_of(horizon, table.step)
    shape = (len(origins), n_leads)
    paths, bands = np.full(shape, np.nan), None if quantiles is None else np.full((*shape, len(quantiles)), np.nan)
    for i, origin in enumerate(origins.tolist()):
        there = min(n_leads, table.n_rows - 1 - origin)
        seen = weather.forecast(table, origin, n_leads)
        if walker is None:
            paths[i] = forecaster.predict_from(seen, [origin], horizon=horizon)[0]
            if bands is not None:
                bands[i] = forecaster.predict_quantiles_from(seen, [origin], horizon=horizon, **bands_asked)[0]
            continue
        if origin >= begin:
            walker.update(table.rows(slice(begin, origin + 1)))
            begin = origin + 1
        ahead = seen.rows(slice(origin + 1, origin + 1 + there))
        with warnings_dropped(PlanWarning):  # the heat is what was measured
            found = walker.forecast(None, ahead, **bands_asked)
        paths[i, :there] = found["T_za"]
        if quantiles is not None and bands is not None:
            bands[i, :there] = found[quantile_columns(quantiles)]
    return paths, bands


def _walker(forecaster: Any, table: ZoneTable, first: int) -> tuple[Any, int]:
    """A copy that has taken in the rows up to the first origin, and the next row; None where it cannot."""
    if not hasattr(forecaster, "update"):
        return None, 0
    walker = deepcopy(forecaster)
    try:
        walker.update(table.rows(slice(0, first + 1)))
    except ValueError:  # the rows do not follow those that it knows
        return None, 0
    return walker, first + 1


def _paths_under_setpoints(
    forecaster: Any, table: Any, origins: np.ndarray, asked: Asked
) -> tuple[np.ndarray, np.ndarray | None, dict[str, np.ndarray]]:
    """Forecasts from increasing origins of a table, where learned thermostats act.

    Returns temperatures (n_origins, n_leads, n_zones), quantiles (n_origins, n_leads, n_zones, n_quantiles) [degC]
    where there are any, and columns (n_origins, n_leads, n_zones) of the plants over the step before each temperature:
    measured as ``Q_hvac_true`` (NaN after the last row), forecast as ``Q_hvac_pred``, and quantiles such as
    ``Q_hvac_0.1`` of the whole load [kW]; NaN in zones without them.  With a model of the error of a ``weather``
    forecast, each origin has a forecast of its own.
    """
    acts = hasattr(forecaster, "closed_loop_from") and getattr(forecaster, "preprocess_", None) is None
    if not acts or not isinstance(table, ZoneTable | pd.DataFrame):
        raise ValueError(
            "heat_known=False needs a hybrid predictor of one zone, or of a building, without preprocess=, and X as a "
            "DataFrame with time stamps; leave heat_known=True."
        )
    horizon, quantiles, weather, _ = asked
    if weather is None:
        parts = [forecaster.closed_loop_from(table, origins, horizon, quantiles)]
    else:
        models = getattr(forecaster, "own_", {"": forecaster}).values()
        read = [(model, table if isinstance(table, ZoneTable) else model._read_X(table)) for model in models]
        parts = []
        for origin in origins.tolist():
            seen = [(model, weather.forecast(rows, origin, rows_of(horizon, rows.step))) for model, rows in read]
            ahead = seen[0][1] if isinstance(table, ZoneTable) else table.assign(**_weather_of(seen))
            parts.append(forecaster.closed_loop_from(ahead, [origin], horizon, quantiles, weather_error=weather))
    by_zone = [part.values() if isinstance(part, Mapping) else [part] for part in parts]
    zones: list[Any] = [ClosedLoopPaths.joined(of_zone) for of_zone in zip(*by_zone, strict=True)]
    loads = [_loads(one, quantiles) for one in zones]
    unknown = np.full(zones[0].paths.temperature.shape, np.nan)
    names = dict.fromkeys(name for own in loads for name in own)
    columns = {name: np.stack([own.get(name, unknown) for own in loads], axis=-1) for name in names}
    bands = None if quantiles is None else np.stack([one.temperature_bands for one in zones], axis=2)
    return np.stack([one.paths.temperature for one in zones], axis=-1), bands, columns


def _weather_of(tables: Sequence[tuple[Any, ZoneTable]]) -> dict[str, np.ndarray]:
    """The weather of tables, each as read by a model, by column."""
    return {
        model._column_of(role): values
        for model, rows in tables
        for role, values in rows.inputs.items()
        if role == "T_oa" or role in irradiance_roles(rows.inputs)
    }


def _loads(found: Any, quantiles: Sequence[float] | None) -> dict[str, np.ndarray]:
    """Columns (n_origins, n_leads) of the plant of one zone."""
    loads = {f"{role}_true": path for role, path in found.measured.items()}
    loads |= {f"{name}_pred": path for name, path in found.plant.items()}
    if quantiles is not None and found.heat_bands is not None:
        loads |= dict(zip(load_quantile_columns(quantiles), np.moveaxis(found.heat_bands, -1, 0), strict=True))
    return loads
