"""Spread of what errors of a weather forecast change in a forecast, by drawn weathers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._table import ZoneTable
from .weather_error import WeatherError

_ORIGINS, _DRAWS = 6, 8  # most origins, and drawn weathers of each, that tell what errors of the weather do
_NORMAL_80 = 1.2816  # half of the 80 % interval of a standard normal error


def weather_spreads(
    weather: WeatherError,
    table: ZoneTable,
    origins: np.ndarray,
    n_leads: int,
    paths_of: Callable[[ZoneTable, np.ndarray], np.ndarray],
) -> np.ndarray:
    """(n_origins, n_kinds, n_leads) spread of what errors of the weather change in forecasts of some kinds.

    ``paths_of`` gives (n_kinds, n_leads) forecasts of a table from one origin.  The spread is the standard deviation of
    a normal error that has the same 80 % interval: changes have long tails.  It is found at the first, second, fourth,
    eighth ... origin, and holds up to the next of them.
    """

    def changes_from(origin: int) -> np.ndarray:
        known = table.rows(slice(origin + 1 + n_leads)).replace(n_history=table.n_history)  # as in a forecast
        draws = (weather.forecast(known, origin, n_leads, draw) for draw in range(1, _DRAWS + 1))
        plain, *drawn = (paths_of(rows, np.array([origin])) for rows in (known, *draws))
        return np.abs(np.array(drawn) - plain)

    every = np.unique(origins)
    asked = every[2 ** np.arange(len(every).bit_length()) - 1]
    changes = np.array([changes_from(int(origin)) for origin in asked])
    known = np.searchsorted(asked, origins, side="right")
    spreads = {n: _normal_spread(np.concatenate(changes[max(0, n - _ORIGINS) : n])) for n in np.unique(known)}
    return np.array([spreads[n] for n in known])


def _normal_spread(changes: np.ndarray) -> np.ndarray:
    """(n_kinds, n_leads) standard deviation of normal errors with the 80 % intervals of the changes (n, ...)."""
    size = np.sqrt(np.mean(changes**2, axis=0))
    shares = np.quantile(changes / np.maximum(size, 1e-12), 0.8, axis=(0, 2))
    return size * shares[:, None] / _NORMAL_80
