"""Forecasts from every origin under a weather forecast of its own."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._warnings import warnings_dropped
from ..exceptions import PlanWarning
from ..forecasting import WeatherError
from ..forecasting.quantiles import quantile_columns
from .single_reading import takes_tables


def paths_under(
    forecaster: Any,
    table: Any,
    origins: np.ndarray,
    n_leads: int,
    quantiles: Sequence[float] | None,
    weather: WeatherError,
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
    walker, begin = _walker(forecaster, table, int(origins[0]))
    bands_asked = {} if quantiles is None else {"quantiles": quantiles, "weather_error": weather}
    shape = (len(origins), n_leads)
    paths, bands = np.full(shape, np.nan), None if quantiles is None else np.full((*shape, len(quantiles)), np.nan)
    for i, origin in enumerate(origins.tolist()):
        there = min(n_leads, table.n_rows - 1 - origin)
        seen = weather.forecast(table, origin, n_leads)
        if walker is None:
            span = pd.Timedelta(n_leads * table.step)
            paths[i] = forecaster.predict_from(seen, [origin], span)[0]
            if bands is not None:
                bands[i] = forecaster.predict_quantiles_from(seen, [origin], quantiles, span, weather_error=weather)[0]
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
