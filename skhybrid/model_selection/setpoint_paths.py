"""Forecasts from every origin under set-points, with the load of the plant beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable, is_plant
from ..forecasting import WeatherError
from ..forecasting.quantiles import load_quantile_columns
from ..hybrid.thermostat_law.closed_loop import ClosedLoopPaths
from .single_reading import takes_tables


def paths_under_setpoints(
    forecaster: Any,
    table: Any,
    origins: np.ndarray,
    n_leads: int,
    quantiles: Sequence[float] | None,
    weather: WeatherError | None,
) -> tuple[np.ndarray, np.ndarray | None, dict[str, np.ndarray]]:
    """Forecasts from increasing origins of a table, where a learned thermostat acts.

    Returns temperatures (n_origins, n_leads), quantiles (n_origins, n_leads, n_quantiles) [degC] where there are any,
    and columns (n_origins, n_leads) of the plant over the step before each temperature: measured as ``Q_hvac_true``
    (NaN after the last row), forecast as ``Q_hvac_pred``, and quantiles such as ``Q_hvac_0.1`` of the whole load [kW].
    With a model of the error of a ``weather`` forecast, each origin has a forecast of its own.
    """
    read = hasattr(forecaster, "closed_loop_from") and takes_tables(forecaster)
    if not read or not isinstance(table, ZoneTable | pd.DataFrame):
        raise ValueError(
            "heat_known=False needs a hybrid predictor of one zone without preprocess=, and X as a DataFrame with time "
            "stamps; leave heat_known=True."
        )
    if not isinstance(table, ZoneTable):  # that could not be read by itself: a set-point may be missing
        table = forecaster._read_X(table)
    span = n_leads * table.step
    if weather is None:
        found = forecaster.closed_loop_from(table, origins, span, quantiles)
    else:
        found = ClosedLoopPaths.joined(
            [
                forecaster.closed_loop_from(
                    weather.forecast(table, origin, n_leads), [origin], span, quantiles, weather
                )
                for origin in origins.tolist()
            ]
        )
    rows = origins[:, None] + np.arange(n_leads)
    there = rows < table.n_rows
    measured = {
        f"{role}_true": np.where(there, values[np.minimum(rows, table.n_rows - 1)], np.nan)
        for role, values in table.inputs.items()
        if is_plant(role)
    }
    loads = measured | {f"{name}_pred": path for name, path in found.plant.items()}
    if quantiles is not None:
        loads |= dict(zip(load_quantile_columns(quantiles), np.moveaxis(found.heat_bands, -1, 0), strict=True))
    return found.paths.temperature, found.temperature_bands, loads
