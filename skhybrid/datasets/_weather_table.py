"""Resampling of a given weather table to the simulation step of the synthetic office."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pandas as pd

from ._epw import repeat_typical_year


def resample_weather(weather: pd.DataFrame, time: pd.DatetimeIndex) -> pd.DataFrame:
    """Interpolate ``T_oa`` and ``q_sol`` of a weather table linearly to the stamps ``time``.

    Air temperatures are values at the stamps; irradiance is a mean over each row's step, so it is placed at the middle
    of the step.  A typical year from :func:`read_epw` is used for any year, by month, day and hour.

    Raises
    ------
    ValueError
        If a column is absent or has gaps, or the table does not cover the span; the message names what is missing.
    """
    for column in ("T_oa", "q_sol"):
        if column not in weather:
            raise ValueError(f"weather has no column {column!r}, only {', '.join(map(str, weather.columns))}.")
        if not np.isfinite(weather[column].to_numpy(dtype=np.float64)).all():
            raise ValueError(
                f"weather column {column!r} contains NaN or inf; fill it (GapFiller) or choose another span."
            )
    if not isinstance(weather.index, pd.DatetimeIndex) or len(weather) < 2:
        raise ValueError("weather needs a DatetimeIndex of at least two time stamps.")
    frame = weather[["T_oa", "q_sol"]].set_axis(_standard_time(weather.index), axis=0)
    if not (frame.index.is_monotonic_increasing and frame.index.is_unique):
        raise ValueError("the time stamps of weather must increase; sort them and drop duplicates.")
    if weather.attrs.get("typical_year"):
        frame = repeat_typical_year(frame, time)
    given = pd.DatetimeIndex(frame.index)
    step = pd.Timedelta(np.median(np.diff(given.as_unit("ns").asi8)), unit="ns")
    _check_coverage(given, time, step)
    wanted, known = _seconds(time), _seconds(given)
    half_wanted, half_known = (time[1] - time[0]).total_seconds() / 2, step.total_seconds() / 2
    return pd.DataFrame(
        {
            "T_oa": np.interp(wanted, known, frame["T_oa"].to_numpy(dtype=np.float64)),
            "q_sol": np.interp(wanted + half_wanted, known + half_known, frame["q_sol"].to_numpy(dtype=np.float64)),
        },
        index=time,
    )


def _standard_time(stamps: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Convert to local standard time without a zone, in which no hour is skipped or repeated."""
    if stamps.tz is None:
        return stamps
    none = timedelta(0)
    offset = (stamps[0].utcoffset() or none) - (stamps[0].dst() or none)
    return stamps.tz_convert("UTC").tz_localize(None) + offset


def _seconds(stamps: pd.DatetimeIndex) -> np.ndarray:
    return stamps.as_unit("ns").asi8 / 1e9


def _check_coverage(given: pd.DatetimeIndex, need: pd.DatetimeIndex, step: pd.Timedelta) -> None:
    end = need[-1] + (need[1] - need[0])
    missing = []
    if given[0] > need[0]:
        missing.append(f"{need[0]} to {min(given[0], end)}")
    if given[-1] + step < end:
        missing.append(f"{max(given[-1] + step, need[0])} to {end}")
    gaps = np.diff(given.as_unit("ns").asi8)
    holes = np.flatnonzero((gaps > 3 * step.value) & (given[1:] > need[0]) & (given[:-1] < end))
    missing += [f"{given[row] + step} to {given[row + 1]}" for row in holes[:1]]
    if missing:
        raise ValueError(
            f"weather does not cover {' and '.join(missing)} of the simulation ({need[0]} to {end}); "
            "give a longer table or another start."
        )
