"""A given weather table, brought to the simulation step of the synthetic office."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pandas as pd

from ._epw import place_typical_year


def resample_weather(weather: pd.DataFrame, time: pd.DatetimeIndex) -> pd.DataFrame:
    """``T_oa`` and ``q_sol`` of a weather table at the stamps ``time``, by straight lines.

    The air temperature runs through its values at the stamps, the irradiance (a mean over each row's step) through
    the middles of the steps.  A typical year of :func:`read_epw` serves any year by month, day and hour.

    Raises
    ------
    ValueError
        If a column is absent or holds gaps, or the table does not cover the span (which is named).
    """
    for column in ("T_oa", "q_sol"):
        if column not in weather:
            raise ValueError(f"weather has no column {column!r}, only {', '.join(map(str, weather.columns))}.")
        if not np.isfinite(weather[column].to_numpy(dtype=np.float64)).all():
            raise ValueError(
                f"weather column {column!r} contains NaN or inf; fill it (GapFiller) or choose another span."
            )
    if not isinstance(weather.index, pd.DatetimeIndex) or len(weather) < 2:
        raise ValueError("weather needs a DatetimeIndex of at least two stamps.")
    frame = weather[["T_oa", "q_sol"]]
    frame = frame.set_axis(_standard_time(weather.index), axis=0)
    if not (frame.index.is_monotonic_increasing and frame.index.is_unique):
        raise ValueError("the stamps of weather must increase; sort them and drop duplicates first.")
    if weather.attrs.get("typical_year"):
        frame = place_typical_year(frame, time)
    have = pd.DatetimeIndex(frame.index)
    step = pd.Timedelta(np.median(np.diff(have.as_unit("ns").asi8)), unit="ns")
    _refuse_uncovered(have, time, step)
    mine, theirs = _seconds(time), _seconds(have)
    half_mine, half_theirs = (time[1] - time[0]).total_seconds() / 2, step.total_seconds() / 2
    return pd.DataFrame(
        {
            "T_oa": np.interp(mine, theirs, frame["T_oa"].to_numpy(dtype=np.float64)),
            "q_sol": np.interp(mine + half_mine, theirs + half_theirs, frame["q_sol"].to_numpy(dtype=np.float64)),
        },
        index=time,
    )


def _standard_time(stamps: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Local standard time without zone: no hour is skipped and none comes twice."""
    if stamps.tz is None:
        return stamps
    none = timedelta(0)
    offset = (stamps[0].utcoffset() or none) - (stamps[0].dst() or none)
    return stamps.tz_convert("UTC").tz_localize(None) + offset


def _seconds(stamps: pd.DatetimeIndex) -> np.ndarray:
    return stamps.as_unit("ns").asi8 / 1e9


def _refuse_uncovered(have: pd.DatetimeIndex, need: pd.DatetimeIndex, step: pd.Timedelta) -> None:
    end = need[-1] + (need[1] - need[0])
    missing = []
    if have[0] > need[0]:
        missing.append(f"{need[0]} to {min(have[0], end)}")
    if have[-1] + step < end:
        missing.append(f"{max(have[-1] + step, need[0])} to {end}")
    gaps = np.diff(have.as_unit("ns").asi8)
    holes = np.flatnonzero((gaps > 3 * step.value) & (have[1:] > need[0]) & (have[:-1] < end))
    missing += [f"{have[row] + step} to {have[row + 1]}" for row in holes[:1]]
    if missing:
        raise ValueError(
            f"weather does not cover {' and '.join(missing)} of the simulation ({need[0]} to {end}); "
            "give a longer table or another start."
        )
