"""Reader of EPW weather files, and resampling of a weather table to the simulation step of the synthetic office."""

from __future__ import annotations

from datetime import timedelta, timezone
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .._arguments import check_integer
from .._ranges import check_range
from .._table import numeric, refuse_infinite_columns
from .._time import SHORTEST_GAP
from ..logs.stamps import YEARS
from ._weather import window_irradiance

TYPICAL_YEAR = 2001  # stamp of a typical year if no year is given: not a leap year, and it begins on a Monday


def read_epw(
    path: str | PathLike[str], *, window_azimuth: float = 180.0, window_tilt: float = 90.0, year: int | None = None
) -> pd.DataFrame:
    """Read an EnergyPlus weather file.

    Parameters
    ----------
    path : path-like
    window_azimuth, window_tilt : float
        Orientation of the window that receives ``q_sol`` [degrees]: 180 faces south, 90 is vertical.
    year : int, optional
        Year of the time stamps; a 29 February repeats the 28th.  By default the rows are a typical year (stamped 2001),
        which ``make_office(weather=...)`` uses for any year.

    Returns
    -------
    DataFrame
        Hourly rows: ``T_oa`` [degC], the value at the stamp; ``q_sol`` (isotropic sky), ``ghi``, ``dni``, ``dhi``
        [kW/m2], means over [t, t + 1 h).  The index is local standard time with a fixed offset from UTC.
        ``attrs`` contains the site and whether the year is typical.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read, does not have 8760 hours or lacks values, or ``year`` is not from 1700 to 2250.
    """
    if year is not None:
        check_integer("year", year, *YEARS)
    frame, site = _read_typical_year(Path(path))
    if year is not None:
        frame = _with_year(frame, year)
    stamps = pd.DatetimeIndex(frame.index)
    middle = stamps + pd.Timedelta("30min")
    frame.insert(1, "q_sol", window_irradiance(middle, frame, site, window_azimuth, window_tilt))
    frame.index = stamps.tz_localize(timezone(timedelta(hours=site["utc_offset"])))
    frame.attrs = {"typical_year": year is None, "site": site}
    return frame


def _read_typical_year(file: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Temperature and irradiance of a file, stamped with the typical year, and its site."""
    from pvlib.iotools import read_epw as pvlib_read_epw

    if not file.is_file():
        raise FileNotFoundError(f"there is no weather file {str(file)!r}.")
    try:
        raw, meta = pvlib_read_epw(str(file))
        raw = raw[~((raw.index.month == 2) & (raw.index.day == 29))]
        site = {
            "latitude": float(meta["latitude"]),
            "longitude": float(meta["longitude"]),
            "utc_offset": float(meta["TZ"]),
            "altitude": meta["altitude"],
            "city": str(meta["city"]),
        }
        timezone(timedelta(hours=site["utc_offset"]))
        T_oa, ghi, dni, dhi = raw[["temp_air", "ghi", "dni", "dhi"]].to_numpy(dtype=np.float64).T
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, StopIteration, OverflowError) as error:
        cause = " ".join(str(error).split())
        raise ValueError(f"{str(file)!r} is not a readable EPW weather file ({cause}); download it again.") from error
    if len(raw) != 8760:
        raise ValueError(f"{str(file)!r} has {len(raw)} hourly rows, but a typical year has 8760.")
    columns = {
        "T_oa": np.roll(T_oa, 1),  # pvlib stamps a row with the start of its hour, but this is the value at the end
        **{name: v / 1000.0 for name, v in (("ghi", ghi), ("dni", dni), ("dhi", dhi))},
    }
    frame = pd.DataFrame(columns, index=pd.date_range(f"{TYPICAL_YEAR}-01-01", periods=8760, freq="1h"))
    refuse_infinite_columns(frame)
    for name, values in columns.items():  # 99.9 degC and 9999 Wh/m2 stand for missing values
        check_range(values, name if name == "T_oa" else "q_sol", f"{name} of {str(file)!r}", frame.index)
    return frame, site


def _with_year(frame: pd.DataFrame, year: int) -> pd.DataFrame:
    """Stamp a typical year with ``year``, matching rows by month, day and hour."""
    hours = pd.date_range(f"{year}-01-01", f"{year + 1}-01-01", freq="1h", inclusive="left")
    leap_day = (hours.month == 2) & (hours.day == 29)
    source = hours.where(~leap_day, hours - pd.Timedelta("1D"))
    rows = pd.Series(np.arange(len(frame)), index=_hour_key(pd.DatetimeIndex(frame.index))).reindex(_hour_key(source))
    if rows.isna().any():
        first = hours[int(np.argmax(rows.isna().to_numpy()))]
        raise ValueError(f"the typical year has no row for {first:%d %B %H:%M}; pass the whole year.")
    return frame.iloc[rows.to_numpy(dtype=np.int64)].set_axis(hours, axis=0)


def _hour_key(stamps: pd.DatetimeIndex) -> np.ndarray:
    return np.asarray((stamps.month * 100 + stamps.day) * 100 + stamps.hour)


def checked_weather(weather: pd.DataFrame) -> pd.DataFrame:
    """``T_oa`` and ``q_sol`` as finite numbers at increasing stamps; what cannot be used is refused."""
    if not isinstance(weather, pd.DataFrame):
        raise ValueError(f"weather is a {type(weather).__name__}; give a DataFrame with columns T_oa and q_sol.")
    for column in ("T_oa", "q_sol"):
        if (weather.columns == column).sum() > 1:
            raise ValueError(f"weather has two columns {column!r}; keep one of them.")
        if column not in weather:
            raise ValueError(f"weather has no column {column!r}, only {', '.join(map(str, weather.columns))}.")
        if not np.isfinite(_numbers(weather[column])).all():
            raise ValueError(
                f"weather column {column!r} contains NaN or inf; fill it (GapFiller) or choose another span."
            )
    if not isinstance(weather.index, pd.DatetimeIndex) or len(weather) < 2:
        raise ValueError("weather needs a DatetimeIndex of at least two time stamps.")
    if not (weather.index.is_monotonic_increasing and weather.index.is_unique):
        raise ValueError("the time stamps of weather must increase; sort them and drop duplicates.")
    return weather[["T_oa", "q_sol"]].apply(_numbers)


def resample_weather(weather: pd.DataFrame, time: pd.DatetimeIndex) -> pd.DataFrame:
    """``T_oa`` (at the stamps) and ``q_sol`` (at the middle of the steps), interpolated linearly to ``time``."""
    frame = checked_weather(weather)
    for role, values in frame.items():
        check_range(values.to_numpy(), str(role), f"weather column {role!r}", weather.index)
    frame.index = _standard_time(pd.DatetimeIndex(frame.index))
    frame.attrs |= weather.attrs
    if weather.attrs.get("typical_year"):
        begin, end = time[0] - pd.Timedelta("1D"), time[-1] + pd.Timedelta("1D")
        frame = pd.concat([_with_year(frame, year) for year in range(begin.year, end.year + 1)]).loc[begin:end]
    given = pd.DatetimeIndex(frame.index)
    row = refuse_uncovered(given, time, "simulation", "a start")
    wanted, known = _seconds(time), _seconds(given)
    half_wanted, half_known = (time[1] - time[0]).total_seconds() / 2, row.total_seconds() / 2
    return pd.DataFrame(
        {
            "T_oa": np.interp(wanted, known, frame["T_oa"].to_numpy(dtype=np.float64)),
            "q_sol": np.interp(wanted + half_wanted, known + half_known, frame["q_sol"].to_numpy(dtype=np.float64)),
        },
        index=time,
    )


def _numbers(column: pd.Series) -> pd.Series:
    return pd.Series(numeric(column, f"weather column {column.name!r}"), column.index)


def _standard_time(stamps: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Convert to local standard time without a zone, in which no hour is skipped or repeated."""
    if stamps.tz is None:
        return stamps
    none = timedelta(0)
    offset = (stamps[0].utcoffset() or none) - (stamps[0].dst() or none)
    return stamps.tz_convert("UTC").tz_localize(None) + offset


def _seconds(stamps: pd.DatetimeIndex) -> np.ndarray:
    return stamps.as_unit("ns").asi8 / 1e9


def refuse_uncovered(given: pd.DatetimeIndex, time: pd.DatetimeIndex, what: str, other: str) -> pd.Timedelta:
    """The length of a row of weather; refused if it begins late, ends early or lacks more than two rows and 3 h."""
    lengths = np.diff(given.as_unit("ns").asi8)
    row = pd.Timedelta(np.median(lengths), unit="ns")
    end = time[-1] + (time[1] - time[0])
    longest = max(3 * row, SHORTEST_GAP).value
    gap = np.flatnonzero((lengths > longest) & (given[1:] > time[0]) & (given[:-1] < end))
    if given[0] > time[0] or given[-1] + row < end or len(gap):
        first, last = (given[gap[0]], given[gap[0] + 1]) if len(gap) else (given[0], given[-1])
        covers = f"has nothing between {first} and {last}" if len(gap) else f"reaches from {first} to {last}"
        later = f", or {other} no earlier than {first}" if given[0] > time[0] else ""
        raise ValueError(
            f"the weather {covers}, but the {what} needs {time[0]} to {time[-1]} and the step after it; give weather "
            f"for all of it{later}."
        )
    return row
