"""Readers of weather for a forecast: CSV, EPW and Open-Meteo's files; and its values on the steps of a forecast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from .._arguments import check_place
from .._ranges import check_range
from .._table import listed
from .._time import even_step
from ..logs.open_meteo import answers_in
from ..logs.stamps import YEARS, cell
from ..logs.zone_csv import read_zone_csv
from ..preprocessing._sun import split
from ..preprocessing._units import conversion_of, convert
from ._epw import checked_weather, read_epw, refuse_uncovered
from ._weather import clear_sky, tilted_irradiance

_UNITS = {"°C": "degC", "°F": "degF", "W/m²": "W/m2", "kW/m²": "kW/m2", "BTU/h/ft²": "Btu/(h ft2)"}
#: hourly variables that are read, also by their names before 2023 -> role that has their kind of unit
_KNOWN = {
    "temperature_2m": "T_oa", "shortwave_radiation": "q_sol", "direct_normal_irradiance": "q_sol",
    "diffuse_radiation": "q_sol", "cloud_cover": "u_cloud", "cloudcover": "u_cloud",
}  # fmt: skip
_LIGHT = ("shortwave_radiation", "direct_normal_irradiance", "diffuse_radiation")
_DULL, _POWER = 0.75, 3.4  # Kasten and Czeplak (1980): share of clear-sky irradiance that full cloud takes, and power
_HOUR = pd.Timedelta("1h")


def read_weather(
    path: str | PathLike[str],
    *,
    latitude: float | None = None,
    longitude: float | None = None,
    window_azimuth: float | None = None,
    window_tilt: float = 90.0,
    year: int | None = None,
    **options: Any,
) -> pd.DataFrame:
    """Read weather for a forecast from a CSV, an EPW or Open-Meteo's forecast (JSON or CSV).

    Parameters
    ----------
    path : path-like
        ``.epw``; the JSON of Open-Meteo's API, or the CSV of its page, with hourly ``temperature_2m`` and
        ``shortwave_radiation`` or ``cloud_cover``; anything else is a CSV for :func:`read_zone_csv`, with columns named
        ``T_oa`` and ``q_sol``.
    latitude, longitude : float, optional
        Site [degrees]; by default as the JSON gives it.
    window_azimuth : float, optional
        Orientation of the plane of ``q_sol`` [degrees]: 180 faces south.  By default global horizontal irradiance.  It
        must be the plane of the log that the model was fitted to.
    window_tilt : float
        Tilt of that plane [degrees]: 90 is vertical.
    year : int, optional
        Year of the stamps of an EPW file; other files have their own.
    **options
        Passed to :func:`read_zone_csv` for a CSV: ``columns``, ``units``, ``timezone``, ``label`` ...  Other files take
        none.

    Returns
    -------
    DataFrame
        ``T_oa`` [degC], the value at the stamp, and ``q_sol`` [kW/m2], the mean until the next stamp.
        ``attrs["notes"]`` is a list of sentences on what was assumed.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read, has no temperature or no irradiance, or an argument does nothing with it.

    Notes
    -----
    Open-Meteo's radiation is the mean of the preceding hour, so it moves to the row before.  Without radiation, the
    irradiance is that of a clear sky (Haurwitz) times ``1 - 0.75 N**3.4`` for a cloud cover N (Kasten and Czeplak
    1980).
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no weather file {str(file)!r}.")
    is_epw = file.suffix.lower() == ".epw"
    answers = [] if is_epw else answers_in(file)
    if year is not None and not is_epw:
        raise ValueError(f"year= does nothing with {file.name!r}, whose stamps have a year; leave it out.")
    if options and (is_epw or answers):
        kind = "an EPW" if is_epw else "a file of Open-Meteo"
        raise ValueError(f"{next(iter(options))}= does nothing with {kind} such as {file.name!r}; leave it out.")
    if is_epw:
        plane = {"window_azimuth": 180.0 if window_azimuth is None else window_azimuth, "window_tilt": window_tilt}
        weather = read_epw(file, **plane, year=year)
        if window_azimuth is None:
            weather["q_sol"] = weather["ghi"]
        weather.attrs["notes"] = []
        return weather[["T_oa", "q_sol"]]
    if answers:
        where = repr(file.name)
        return _read_open_meteo(_answer(answers, where), where, latitude, longitude, window_azimuth, window_tilt)
    if window_azimuth is not None:
        raise ValueError(
            f"window_azimuth= does nothing with the CSV {file.name!r}, whose q_sol is taken as it is; leave it out."
        )
    weather = read_zone_csv(file, **options)
    for role in ("T_oa", "q_sol"):
        if role not in weather:
            raise ValueError(
                f"{file.name!r} has no column {role!r}, only {listed(weather)}; pass columns={{role: column}}."
            )
        check_range(weather[role].to_numpy(), role, f"{role} of {file.name!r}", weather.index)
    weather.attrs["notes"] = []
    return weather[["T_oa", "q_sol"]]


def weather_on_steps(weather: pd.DataFrame, time: pd.DatetimeIndex) -> pd.DataFrame:
    """Put weather on the steps of a forecast.

    Parameters
    ----------
    weather : DataFrame
        ``T_oa`` and ``q_sol``, as :func:`read_weather` returns them.
    time : DatetimeIndex
        Stamps of the forecast, evenly spaced; with a zone if the weather has one.

    Returns
    -------
    DataFrame
        ``T_oa`` [degC] interpolated linearly at the stamps, ``q_sol`` [kW/m2] the mean of each step: over a row of the
        weather its energy is kept.  Missing rows are interpolated linearly, over 3 h or two rows.

    Raises
    ------
    ValueError
        If the weather does not cover the steps, these are not even, or only one of the two has a time zone.
    """
    known = checked_weather(weather)
    if not isinstance(time, pd.DatetimeIndex) or len(time) < 2 or time.hasnans:
        raise ValueError("time must be a DatetimeIndex of at least two stamps, without NaT.")
    step = even_step(time) / _HOUR
    if weather.attrs.get("typical_year"):
        raise ValueError("the weather is that of a typical year; give year= to stamp it.")
    if (pd.DatetimeIndex(known.index).tz is None) != (time.tz is None):
        lacks, other = ("forecast", "weather") if time.tz is None else ("weather", "forecast")
        raise ValueError(f"the {lacks} has no time zone, but the {other} has one; give timezone= when reading it.")
    known = _with_missing_rows(
        known, refuse_uncovered(pd.DatetimeIndex(known.index), time, "forecast", "a log whose last complete row is")
    )
    hours, wanted = (np.asarray((pd.DatetimeIndex(i) - time[0]) / _HOUR, np.float64) for i in (known.index, time))
    # a value at the last stamp holds to the end of its row; nothing is known beyond it
    edges = np.append(hours, hours[-1] + float(np.median(np.diff(hours))))
    energy = np.concatenate([[0.0], np.cumsum(known["q_sol"].to_numpy() * np.diff(edges))])
    asked = np.append(wanted, wanted[-1] + step)
    until = PchipInterpolator(edges, energy)(asked)  # monotone: no irradiance below zero, none at night
    light = (np.diff(until) / np.diff(asked)).clip(min=0.0)
    return pd.DataFrame({"T_oa": np.interp(wanted, hours, known["T_oa"].to_numpy()), "q_sol": light}, index=time)


def _with_missing_rows(weather: pd.DataFrame, row: pd.Timedelta) -> pd.DataFrame:
    """Weather in which the rows that are missing among even ones are interpolated linearly."""
    index = pd.DatetimeIndex(weather.index)
    even = pd.date_range(index[0], index[-1], freq=row)
    return weather.reindex(even).interpolate() if index.isin(even).all() else weather


def _read_open_meteo(
    answer: Mapping[str, Any],
    where: str,
    latitude: float | None,
    longitude: float | None,
    azimuth: float | None,
    tilt: float,
) -> pd.DataFrame:
    hourly = answer["hourly"]
    stamps = _stamps(answer, where)
    units = answer.get("hourly_units") or {}
    named = {n: _quantity(hourly[n], n, units, len(stamps), where) for n in hourly if n in _KNOWN}
    named |= {"cloud_cover": named["cloudcover"]} if "cloudcover" in named else {}
    if "temperature_2m" not in named:
        raise ValueError(f"{where} has no hourly temperature_2m; request it with hourly=temperature_2m.")
    notes: list[str] = []
    # radiation is the mean of the hour before its stamp: the row before has it, and the last row has none
    light = {name: named[name][1:] for name in _LIGHT if name in named}
    if azimuth is not None or "shortwave_radiation" not in light:
        sun = _sun(stamps[:-1] + _HOUR / 2, answer, latitude, longitude, where)
        if "shortwave_radiation" not in light:
            light = {"shortwave_radiation": _from_clouds(named, sun["zenith"].to_numpy(), where)}
            notes.append("no radiation in the file: q_sol comes from its cloud cover and a clear sky.")
    q_sol = light["shortwave_radiation"] if azimuth is None else _on_plane(light, sun, azimuth, tilt)
    weather = pd.DataFrame({"T_oa": named["temperature_2m"][:-1], "q_sol": q_sol}, index=stamps[:-1].rename("time"))
    for role in ("T_oa", "q_sol"):
        check_range(weather[role].to_numpy(), role, f"{role} of {where}", weather.index)
    known = np.flatnonzero(weather.notna().all(axis=1).to_numpy())  # the last hours of a forecast may be null
    if not len(known):
        raise ValueError(f"{where} has no hour with a temperature and an irradiance; request it again.")
    weather = weather.iloc[: known[-1] + 1]
    weather.attrs["notes"] = notes
    return weather


def _answer(answers: Sequence[Any], where: str) -> Mapping[str, Any]:
    if len(answers) > 1:
        raise ValueError(f"{where} holds {len(answers)} places; request the forecast of one place.")
    (answer,) = answers
    if answer.get("error"):
        raise ValueError(f"{where} holds an error message of Open-Meteo: {str(answer.get('reason')).rstrip('.')}.")
    hourly = answer.get("hourly")
    times = hourly.get("time") if isinstance(hourly, dict) else None
    if not isinstance(times, list) or not times or not isinstance(answer.get("hourly_units") or {}, dict):
        raise ValueError(
            f"{where} is not a forecast of Open-Meteo with hourly values; request it with "
            "hourly=temperature_2m,shortwave_radiation,direct_normal_irradiance,diffuse_radiation."
        )
    return answer


def _stamps(answer: Mapping[str, Any], where: str) -> pd.DatetimeIndex:
    """Stamps in the zone of the answer; they are local time at one fixed offset, or seconds since 1970."""
    times, zone = answer["hourly"]["time"], str(answer.get("timezone") or "UTC")
    if all(isinstance(time, int | float) for time in times):
        utc = pd.to_datetime(pd.Series(times), unit="s", utc=True, errors="coerce")
    else:
        offset = answer.get("utc_offset_seconds") or 0
        if not isinstance(offset, int) or abs(offset) > 86400:
            raise ValueError(f"{where} has the utc_offset_seconds {cell(offset)}; download it again.")
        local = pd.to_datetime(pd.Series(times, dtype=str), format="ISO8601", errors="coerce", utc=True)
        utc = local - pd.Timedelta(seconds=offset)
    wrong = ~utc.dt.year.between(*YEARS).to_numpy()
    if wrong.any():
        raise ValueError(f"{where} has the time stamp {cell(times[int(np.argmax(wrong))])}; download it again.")
    try:
        stamps = pd.DatetimeIndex(utc).tz_convert("UTC" if zone == "GMT" else zone)
    except Exception as error:  # the class differs between zoneinfo and pytz
        raise ValueError(f"{where} has the unknown timezone {cell(zone)}; request it with timezone=auto.") from error
    if len(stamps) < 3 or not ((stamps[1:] - stamps[:-1]) == _HOUR).all():
        raise ValueError(f"{where} has {len(stamps)} hourly stamps that are not one hour apart; request it again.")
    return stamps


def _quantity(values: Any, name: str, units: Mapping[str, Any], n: int, where: str) -> np.ndarray:
    """Hourly values (n,) in the contract's unit; null is NaN."""
    role = _KNOWN[name]
    unit = str(units.get(name, {"T_oa": "°C", "q_sol": "W/m²"}.get(role, "%")))
    try:
        numbers = np.array([np.nan if v is None else float(v) for v in values])
        if np.isinf(numbers).any():
            raise ValueError
    except (TypeError, ValueError):
        raise ValueError(f"{where} has a {name} with values that are not numbers; download it again.") from None
    if len(numbers) != n:
        raise ValueError(f"{where} has {len(numbers)} values of {name} for {n} stamps; download it again.")
    return convert(numbers, conversion_of(_UNITS.get(unit, unit), role))


def _sun(
    middle: pd.DatetimeIndex, answer: Mapping[str, Any], latitude: float | None, longitude: float | None, where: str
) -> pd.DataFrame:
    """Zenith and azimuth of the sun [degrees] at the place that is given, or else that of the file."""
    from pvlib.solarposition import get_solarposition

    place = [answer.get(n) if of is None else of for n, of in (("latitude", latitude), ("longitude", longitude))]
    if not all(isinstance(of, int | float) for of in place):
        raise ValueError(f"{where} names no place, which its irradiance needs; give latitude= and longitude=.")
    check_place(place[0], place[1])
    return get_solarposition(middle, place[0], place[1], method="ephemeris")


def _from_clouds(named: Mapping[str, np.ndarray], zenith: np.ndarray, where: str) -> np.ndarray:
    """Global horizontal irradiance (n,) [kW/m2] of each hour from its cloud cover."""
    if "cloud_cover" not in named:
        raise ValueError(
            f"{where} has neither shortwave_radiation nor cloud_cover; request it with hourly=shortwave_radiation."
        )
    cover = named["cloud_cover"].clip(0.0, 1.0)
    mean = 0.5 * (cover[:-1] + cover[1:])
    return clear_sky(zenith) / 1000.0 * (1.0 - _DULL * mean**_POWER)


def _on_plane(light: Mapping[str, np.ndarray], sun: pd.DataFrame, azimuth: float, tilt: float) -> np.ndarray:
    """Irradiance (n,) [kW/m2] on a tilted plane."""
    zenith, day = sun["zenith"].to_numpy(), pd.DatetimeIndex(sun.index).day_of_year.to_numpy()
    direct, diffuse, total = split(light[_LIGHT[0]], light.get(_LIGHT[1]), light.get(_LIGHT[2]), zenith, day)
    return tilted_irradiance(sun, direct, total, diffuse, azimuth, tilt)
