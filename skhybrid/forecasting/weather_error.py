"""Errors of day-ahead weather forecasts, drawn at random for rows after an origin, and their effect on a forecast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from .._arguments import check_integer
from .._table import ZoneTable
from .._time import rows_per_day
from .._warnings import warn_once
from ..exceptions import SkhybridWarning
from .features import irradiance_roles

Level = Literal["low", "medium", "high"]
#: days before and after a row whose irradiance at the same time of day bounds a forecast of it
_DAYS_AROUND = 7
_W_PER_KW = 1000.0
_ORIGINS, _DRAWS = 6, 8  # most origins, and drawn weathers of each, that tell what errors of the weather do
_NORMAL_80 = 1.2816  # half of the 80 % interval of a standard normal error


class HourlyErrors(NamedTuple):
    """A first-order autoregressive error from hour to hour of lead, ``e <- share * e + noise``."""

    begin: float  # location of the error one hour ahead
    begin_scale: float  # its scale
    share: float  # of an error that is left an hour later
    drift: float  # location of the noise
    scale: float  # scale of the noise


#: Zheng et al. (2025), as published with BOPTEST: temperature [K], scales are standard deviations of normal draws;
#: irradiance [W/m2], scales are those of Laplace draws
_TEMPERATURE = {
    "low": HourlyErrors(0.0, 0.6, 0.92, 0.0, 0.4),
    "medium": HourlyErrors(0.15, 1.2, 0.93, 0.0, 0.6),
    "high": HourlyErrors(-0.58, 1.5, 0.95, -0.015, 0.7),
}
_IRRADIANCE = {
    "low": HourlyErrors(4.44, 57.42, 0.62, 1.86, 45.64),
    "medium": HourlyErrors(15.02, 122.6, 0.63, 4.44, 91.97),
    "high": HourlyErrors(32.09, 119.94, 0.67, 10.63, 87.44),
}


@dataclass(frozen=True)
class WeatherError:
    """Model of the error of a weather forecast: autocorrelated, and growing with the lead.

    Errors of the outdoor temperature and of the irradiance follow a first-order autoregression from hour to hour of
    lead, with normal noise for the temperature and Laplace noise for the irradiance.  Parameters are those that
    Zheng et al. fitted to forecasts of up to 48 h for Berkeley, Leuven, Berlin, Oslo and Milan [1]_.

    Parameters
    ----------
    level : {"low", "medium", "high"}, default "medium"
        The standard deviation of the temperature goes from 0.6 K one hour ahead to 1.0 K a day ahead at "low", from
        1.2 to 1.6 K at "medium" and from 1.5 to 2.2 K at "high".
    random_state : int, default 0
        Seed of the errors; those of one origin do not depend on other origins.

    Raises
    ------
    ValueError
        If there is no such level, or the seed is not an integer of at least 0.

    Notes
    -----
    Irradiance is 0 at night, and its error is the mean over three hours of draws.  A forecast of it lies between 0 and
    the most that was measured at that time of day within a week, which stands for the clear sky.  Where a table has
    several columns of irradiance, ``q_sol`` has the error, and the others change in proportion.

    References
    ----------
    .. [1] W. Zheng, L. Zabala, J. Febres, D. Blum, Z. Wang: Quantifying and simulating the weather forecast uncertainty
       for advanced building control. Journal of Building Performance Simulation (2025),
       doi:10.1080/19401493.2025.2453537.
    """

    level: Level = "medium"
    random_state: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.level, str) or self.level not in _TEMPERATURE:
            raise ValueError(f"weather_error={self.level!r} is not one of 'low', 'medium', 'high'.")
        check_integer("random_state", self.random_state, 0)

    def forecast(self, table: ZoneTable, origin: int, n_leads: int, draw: int = 0) -> ZoneTable:
        """Put a weather forecast in the place of what was measured after an origin.

        Parameters
        ----------
        table : ZoneTable
        origin, n_leads : int
            The row in which the weather forecast is made, and how many rows it has.
        draw : int, default 0
            Number of the draw; 0 is the one that back-tests use.

        Returns
        -------
        ZoneTable
            The same table, but for ``T_oa`` and irradiance in the rows after the origin.

        Warns
        -----
        SkhybridWarning
            Once, where the table has none of them.
        """
        rows = slice(origin + 1, min(origin + 1 + n_leads, table.n_rows))
        if rows.start == rows.stop:  # nothing lies ahead
            return table
        leads = np.arange(1, rows.stop - rows.start + 1) * table.step_hours
        seconds = (table.time[origin] - pd.Timestamp(0)) // pd.Timedelta("1s")
        seed = [self.random_state, draw, seconds % 2**32]
        changed = {}
        if "T_oa" in table.inputs:
            changed["T_oa"] = table.inputs["T_oa"][rows] + self._temperature(leads, seed)
        solar = irradiance_roles(table.inputs)
        if solar:
            main = "q_sol" if "q_sol" in solar else solar[0]
            share = self._irradiance_share(table, main, rows, leads, seed)
            changed |= {role: share * table.inputs[role][rows] for role in solar}
        if not changed:
            text = "weather_error= does nothing, since the model reads neither outdoor temperature nor irradiance"
            warn_once(f"{text}; leave it out.", SkhybridWarning, self)
        inputs = table.inputs | {role: table.inputs[role].copy() for role in changed}
        for role, values in changed.items():
            inputs[role][rows] = values
        return table.replace(inputs=inputs)

    def _temperature(self, leads: np.ndarray, seed: list[int]) -> np.ndarray:
        """(n_leads,) errors [K]."""
        draws = np.random.default_rng([0, *seed]).standard_normal(_n_hours(leads))
        return _at(leads, _autoregressive(_TEMPERATURE[self.level], draws))

    def _irradiance_share(
        self, table: ZoneTable, role: str, rows: slice, leads: np.ndarray, seed: list[int]
    ) -> np.ndarray:
        """(n_leads,) forecast irradiance as a share of what was measured."""
        draws = np.random.default_rng([1, *seed]).laplace(size=_n_hours(leads))
        hourly = uniform_filter1d(_autoregressive(_IRRADIANCE[self.level], draws), 3, mode="nearest")
        errors = _at(leads, hourly) / _W_PER_KW
        measured = table.inputs[role][rows]
        forecast = np.clip(measured + errors, 0.0, _most_nearby(table, role, rows))
        return np.divide(forecast, measured, out=np.ones(len(leads)), where=measured > 0)


def read_weather_error(given: Any) -> WeatherError | None:
    """A model of the error from what a user gave: a level, a model, or None for measured weather."""
    return given if given is None or isinstance(given, WeatherError) else WeatherError(given)


def weather_of_quantiles(given: Any, quantiles: Sequence[float] | None) -> WeatherError | None:
    """As :func:`read_weather_error`, for a forecast of which it changes nothing but the quantiles."""
    if given is not None and quantiles is None:
        raise ValueError("weather_error= widens quantiles, and none are asked for; give quantiles=(0.1, 0.9), say.")
    return read_weather_error(given)


def _autoregressive(model: HourlyErrors, noise: np.ndarray) -> np.ndarray:
    """(n_hours,) errors from standardised draws."""
    errors = model.drift + model.scale * noise
    errors[0] = model.begin + model.begin_scale * noise[0]
    return lfilter([1.0], [1.0, -model.share], errors)


def _n_hours(leads: np.ndarray) -> int:
    return int(np.ceil(leads[-1]))


def _at(leads: np.ndarray, hourly: np.ndarray) -> np.ndarray:
    """Errors at leads [h], between those of whole hours."""
    return np.interp(leads, np.arange(1, len(hourly) + 1), hourly)


def _most_nearby(table: ZoneTable, role: str, rows: slice) -> np.ndarray:
    """The highest value at the same time of day within a week of each row."""
    per_day, values = rows_per_day(table.step), table.inputs[role]
    at = np.arange(rows.start, rows.stop)[:, None] + per_day * np.arange(-_DAYS_AROUND, _DAYS_AROUND + 1)
    inside = (at >= 0) & (at < len(values))
    return np.where(inside, values[np.clip(at, 0, len(values) - 1)], 0.0).max(axis=1)


def weather_spreads(
    weather: WeatherError,
    table: ZoneTable,
    origins: np.ndarray,
    n_leads: int,
    paths_of: Callable[[Sequence[ZoneTable], int], np.ndarray],
) -> np.ndarray:
    """(n_origins, n_kinds, n_leads) spread of what errors of the weather change in forecasts of some kinds.

    ``paths_of`` gives (n_tables, n_kinds, n_leads) forecasts from one origin of tables that differ after it only.  The
    spread is the standard deviation of a normal error that has the same 80 % interval: changes have long tails.  It is
    found at the first, second, fourth, eighth ... origin, and holds up to the next of them.
    """

    def changes_from(origin: int) -> np.ndarray:
        known = table.rows(slice(origin + 1 + n_leads)).replace(n_history=table.n_history)  # as in a forecast
        draws = (weather.forecast(known, origin, n_leads, draw) for draw in range(1, _DRAWS + 1))
        plain, *drawn = paths_of([known, *draws], origin)
        return np.abs(np.array(drawn) - plain)

    every = np.unique(origins)
    asked = every[2 ** np.arange(len(every).bit_length()) - 1]
    changes = np.array([changes_from(int(origin)) for origin in asked])
    known = np.searchsorted(asked, origins, side="right")
    spreads = {n: _normal_spread(np.concatenate(changes[max(0, n - _ORIGINS) : n])) for n in np.unique(known)}
    return np.array([spreads[n] for n in known])


def _normal_spread(changes: np.ndarray) -> np.ndarray:
    """(n_kinds, n_leads) standard deviation of normal errors with the 80 % intervals of further changes (n, ...).

    A change is compared with the size of the others: by its own too, few draws would seem to hold more than they do.
    """
    squares = changes**2
    others = np.sqrt((squares.sum(axis=0) - squares) / (len(changes) - 1))
    shares = np.quantile(changes / np.maximum(others, 1e-12), 0.8, axis=(0, 2))
    return np.sqrt(squares.mean(axis=0)) * shares[:, None] / _NORMAL_80
