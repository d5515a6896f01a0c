"""Generator of synthetic weather; ``benchmarks/data/fit_climate.py`` fits its constants to TMY3 weather files."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit

from .._arguments import is_number
from .._time import positive_duration
from ._random import ar1, spawn_generators

MAX_CLEARNESS = 1.1  # largest fraction of the clear-sky irradiance; above 1, as thin broken cloud reflects more light
ALBEDO = 0.2  # albedo of the ground in front of the window [-]
_CLOUD_HOURS = 1.0  # time constant of passing clouds [h]
_AIR_HOURS, _AIR_STD = 3.0, 0.4  # time constant [h] and standard deviation [K] of random changes of air temperature


@cache
def climates() -> dict[str, dict[str, Any]]:
    """Return the embedded climates by name: site and monthly constants."""
    return json.loads(files("skhybrid.datasets").joinpath("data", "climate.json").read_text(encoding="utf-8"))


def make_weather(
    n_days: int = 14,
    climate: str = "oakland",
    *,
    start: Any = "2023-07-08",
    step: Any = "5min",
    window_azimuth: float = 180.0,
    window_tilt: float = 90.0,
    random_state: Any = None,
) -> pd.DataFrame:
    """Draw synthetic weather: seasonal and daily cycles, autocorrelated days and clouds.

    Parameters
    ----------
    n_days : int; length [days]
    climate : {"oakland", "chicago"}
    start : timestamp-like; first day, in local standard time
    step : timedelta-like
    window_azimuth, window_tilt : float; orientation of the window [degrees]: 180 faces south, 90 is vertical
    random_state : int, RandomState, Generator or None

    Returns
    -------
    DataFrame of shape (n_days / step, 5)
        ``T_oa`` [degC], ``q_sol`` (on the window), ``ghi``, ``dni`` and ``dhi`` [kW/m2]; the index has no time zone.

    Raises
    ------
    ValueError
        If ``climate`` is unknown, ``n_days`` or ``step`` is not positive, ``start`` is no date or has a time zone, or
        an angle is impossible.
    """
    known = climates()
    if climate not in known:
        raise ValueError(f"climate={climate!r} is unknown; choose one of {', '.join(map(repr, known))}.")
    if not (is_number(n_days) and n_days > 0):
        raise ValueError(f"n_days={n_days!r} must be a positive number.")
    site = known[climate]
    delta = positive_duration(step, "step")
    first = first_midnight(start)
    time = pd.date_range(first, first + pd.Timedelta(days=n_days), freq=delta, inclusive="left")
    day_rng, cloud_rng, air_rng, anomaly_rng = spawn_generators(random_state, 4)
    clear_day = ar1(day_rng, int(np.ceil(n_days)) + 1, site["cloud_ar1"])
    air = air_temperature(site, time, clear_day, anomaly_rng, air_rng)
    middle = time + delta / 2
    beam = _irradiance(site, middle, clear_day, cloud_rng, delta)
    beam.index = time
    window = window_irradiance(middle, beam, site, window_azimuth, window_tilt)
    return pd.DataFrame({"T_oa": air, "q_sol": window, **beam}, index=time)


def first_midnight(start: Any) -> pd.Timestamp:
    """Midnight of the first day of a simulation, which runs on local standard time; a time zone is refused."""
    try:
        if isinstance(start, Real):  # pandas counts it as nanoseconds since 1970
            raise TypeError
        first = pd.Timestamp(start).normalize()
    except (AttributeError, TypeError, ValueError):  # NaT has no midnight
        raise ValueError(f"start={start!r} is not a date; give one, such as '2023-07-08'.") from None
    if first.tzinfo is not None:
        raise ValueError(
            f"start={start!r} has a time zone; the simulation runs on local standard time, so give a date without one."
        )
    return first


def air_temperature(
    site: dict[str, Any],
    time: pd.DatetimeIndex,
    clear_day: np.ndarray,
    anomaly_rng: np.random.Generator,
    air_rng: np.random.Generator,
) -> np.ndarray:
    """Draw outdoor air temperature [degC]: season, daily cycle (larger on clear days), autocorrelated days, noise."""
    season = _monthly(time, np.asarray(site["T_anchor"]))
    angle = 2 * np.pi * (time - time.normalize()).total_seconds().to_numpy() / 86400.0
    c1, s1, c2, s2 = (_monthly(time, np.asarray(column)) for column in zip(*site["diurnal"], strict=True))
    cycle = c1 * np.cos(angle) + s1 * np.sin(angle) + c2 * np.cos(2 * angle) + s2 * np.sin(2 * angle)
    day = np.asarray((time.normalize() - time[0].normalize()).days)
    swing = 1.0 + 0.3 * np.tanh(clear_day[day])
    elapsed = (time - time[0].normalize()) / pd.Timedelta("1D")
    anomaly = ar1(anomaly_rng, day[-1] + 3, site["T_day_ar1"])
    slow = np.interp(elapsed, np.arange(-0.5, day[-1] + 2), anomaly)  # each day's value applies at noon
    spread = _monthly(time, np.asarray(site["T_day_std"]))
    step_hours = (time[1] - time[0]) / pd.Timedelta("1h") if len(time) > 1 else 1.0
    noise = _AIR_STD * ar1(air_rng, len(time), float(np.exp(-step_hours / _AIR_HOURS)))
    return season + swing * cycle + spread * slow + noise


def _irradiance(
    site: dict[str, Any], middle: pd.DatetimeIndex, clear_day: np.ndarray, rng: np.random.Generator, delta: pd.Timedelta
) -> pd.DataFrame:
    """Draw global, beam and diffuse irradiance [kW/m2]: Haurwitz clear sky under clouds, split by the Erbs model."""
    from pvlib.irradiance import erbs

    zenith = sun(site, middle)["zenith"].to_numpy()
    day = np.asarray((middle.normalize() - middle[0].normalize()).days)
    fast = ar1(rng, len(middle), float(np.exp(-(delta / pd.Timedelta("1h")) / _CLOUD_HOURS)))
    share = site["cloud_day_share"]
    latent = np.sqrt(share) * clear_day[day] + np.sqrt(1 - share) * fast
    month = middle.month.to_numpy() - 1
    level, spread = np.asarray(site["clear_level"])[month], np.asarray(site["clear_spread"])[month]
    ghi = MAX_CLEARNESS * expit(level + spread * latent) * clear_sky(zenith)
    parts = erbs(ghi, zenith, middle.day_of_year.to_numpy())
    return pd.DataFrame({"ghi": ghi, "dni": np.asarray(parts["dni"]), "dhi": np.asarray(parts["dhi"])}) / 1000.0


def clear_sky(zenith: np.ndarray) -> np.ndarray:
    """Clear-sky global horizontal irradiance [W/m2] by the Haurwitz model, from the solar zenith angle [degrees]."""
    from pvlib.clearsky import haurwitz

    return haurwitz(pd.Series(zenith))["ghi"].to_numpy()


def sun(site: dict[str, Any], standard_time: pd.DatetimeIndex) -> pd.DataFrame:
    """Solar position (``zenith``, ``azimuth`` [degrees]) at naive stamps in local standard time."""
    from pvlib.solarposition import get_solarposition

    utc = (standard_time - pd.Timedelta(hours=site["utc_offset"])).tz_localize("UTC")
    return get_solarposition(utc, site["latitude"], site["longitude"], method="ephemeris")


def window_irradiance(
    middle: pd.DatetimeIndex, light: pd.DataFrame, site: dict[str, Any], azimuth: float, tilt: float
) -> np.ndarray:
    """(n,) irradiance on a tilted plane [units of ``light``]; ``middle`` is that of each step, in standard time."""
    dni, ghi, dhi = (light[name].to_numpy() for name in ("dni", "ghi", "dhi"))
    return np.nan_to_num(tilted_irradiance(sun(site, middle), dni, ghi, dhi, azimuth, tilt))


def tilted_irradiance(
    position: pd.DataFrame, dni: np.ndarray, ghi: np.ndarray, dhi: np.ndarray, azimuth: float, tilt: float
) -> np.ndarray:
    """(n,) irradiance on a tilted plane under an isotropic sky, by the ``position`` of the sun; not negative."""
    from pvlib.irradiance import get_total_irradiance

    if not is_number(azimuth) or abs(azimuth) > 360.0:
        raise ValueError(f"window_azimuth={azimuth!r} must be a number of degrees up to 360, such as 180 for south.")
    if not is_number(tilt) or not 0.0 <= tilt <= 180.0:
        raise ValueError(f"window_tilt={tilt!r} must be a number of degrees from 0 to 180, such as 90 for a wall.")
    zenith, facing = position["zenith"].to_numpy(), position["azimuth"].to_numpy()
    total = get_total_irradiance(tilt, azimuth, zenith, facing, dni, ghi, dhi, albedo=ALBEDO, model="isotropic")
    return np.asarray(total["poa_global"]).clip(min=0.0)


def _monthly(time: pd.DatetimeIndex, anchors: np.ndarray) -> np.ndarray:
    """Interpolate twelve values, each at the middle of its month, linearly and periodically."""
    return np.interp(year_position(time), np.arange(-0.5, 13.0), anchors[np.arange(-1, 13) % 12])


def year_position(time: pd.DatetimeIndex) -> np.ndarray:
    """Position of each stamp in the year [months]: 0 at New Year, 0.5 in the middle of January."""
    into = (time.day - 1) + (time - time.normalize()) / pd.Timedelta("1D")
    return np.asarray(time.month - 1 + into / time.days_in_month, dtype=np.float64)
