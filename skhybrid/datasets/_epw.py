"""EPW weather files: typical years, read to the data contract (left-labelled rows, kW/m2)."""

from __future__ import annotations

from datetime import timedelta, timezone
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from .weather import window_irradiance

#: the year that a typical year is stamped with unless another is asked for: not leap, begins on a Monday.
TYPICAL_YEAR = 2001


def read_epw(
    path: str | PathLike[str],
    *,
    window_azimuth: float = 180.0,
    window_tilt: float = 90.0,
    year: int | None = None,
) -> pd.DataFrame:
    """Read an EnergyPlus weather file.

    Parameters
    ----------
    path : path-like
        The EPW file.
    window_azimuth, window_tilt : float
        Orientation of the window that ``q_sol`` falls on [degrees]: 180 faces south, 90 is vertical.
    year : int, optional
        Year that the stamps bear; a 29 February takes the values of the 28th.  By default the rows are a typical year
        (stamped 2001), which ``make_office(weather=...)`` places at any date by month, day and hour.

    Returns
    -------
    DataFrame
        Hourly rows: ``T_oa`` [degC], the value at the stamp; ``q_sol`` (isotropic sky), ``ghi``, ``dni``, ``dhi``
        [kW/m2], means over [t, t + 1 h).  The index is local standard time with its fixed offset from UTC.
        ``attrs`` holds the site and whether the year is typical.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it is no EPW file of whole hours of a year.

    Notes
    -----
    An EPW row bears the hour that *ends*: powers are means over the hour before, temperatures values at its end.
    """
    from pvlib.iotools import read_epw as pvlib_read_epw

    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no weather file {str(file)!r}.")
    try:
        raw, meta = pvlib_read_epw(str(file))
    except (ValueError, KeyError, IndexError, UnicodeDecodeError, StopIteration) as error:
        raise ValueError(f"{str(file)!r} is not a readable EPW weather file ({error}).") from error
    raw = raw[~((raw.index.month == 2) & (raw.index.day == 29))]
    if len(raw) != 8760:
        raise ValueError(f"{str(file)!r} holds {len(raw)} hourly rows, where a typical year has 8760.")
    site = {
        "latitude": meta["latitude"],
        "longitude": meta["longitude"],
        "utc_offset": meta["TZ"],
        "altitude": meta["altitude"],
        "city": str(meta["city"]),
    }
    frame = pd.DataFrame(
        {
            # pvlib stamps the row with the hour's start; the temperature is the one at the hour's end
            "T_oa": np.roll(raw["temp_air"].to_numpy(dtype=np.float64), 1),
            **{name: raw[name].to_numpy(dtype=np.float64) / 1000.0 for name in ("ghi", "dni", "dhi")},
        },
        index=pd.date_range(f"{TYPICAL_YEAR}-01-01", periods=8760, freq="1h"),
    )
    if year is not None:
        frame = _with_year(frame, year)
    stamps = pd.DatetimeIndex(frame.index)
    middle = stamps + pd.Timedelta("30min")
    q_sol = window_irradiance(
        middle, frame["ghi"], frame["dni"], frame["dhi"], site, azimuth=window_azimuth, tilt=window_tilt
    )
    frame.insert(1, "q_sol", q_sol)
    frame.index = stamps.tz_localize(timezone(timedelta(hours=site["utc_offset"])))
    frame.attrs = {"typical_year": year is None, "site": site}
    return frame


def place_typical_year(frame: pd.DataFrame, time: pd.DatetimeIndex) -> pd.DataFrame:
    """The typical year repeated over every year that ``time`` touches, with a day to spare at both ends."""
    spare = pd.Timedelta("1D")
    years = range((time[0] - spare).year, (time[-1] + spare).year + 1)
    placed = pd.concat([_with_year(frame, year) for year in years])
    return placed.loc[time[0] - spare : time[-1] + spare]


def _with_year(frame: pd.DataFrame, year: int) -> pd.DataFrame:
    """The rows of a typical year at every hour of ``year``, found by month, day and hour."""
    hours = pd.date_range(f"{year}-01-01", f"{year + 1}-01-01", freq="1h", inclusive="left")
    leap_day = (hours.month == 2) & (hours.day == 29)
    source = hours.where(~leap_day, hours - pd.Timedelta("1D"))
    key = _hour_key(pd.DatetimeIndex(frame.index))
    rows = pd.Series(np.arange(len(frame)), index=key).reindex(_hour_key(source))
    if rows.isna().any():
        first = hours[int(np.argmax(rows.isna().to_numpy()))]
        raise ValueError(f"the typical year has no row for {first:%d %B %H:%M}; pass it whole.")
    placed = frame.iloc[rows.to_numpy(dtype=np.int64)]
    return placed.set_axis(hours, axis=0)


def _hour_key(stamps: pd.DatetimeIndex) -> np.ndarray:
    return np.asarray((stamps.month * 100 + stamps.day) * 100 + stamps.hour)
