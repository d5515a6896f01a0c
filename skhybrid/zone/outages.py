"""Rows of a log between outages, and the bridges over short ones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd


def stretches(rows: pd.DataFrame, step: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between gaps, in their order."""
    breaks = np.flatnonzero(np.diff(pd.DatetimeIndex(rows.index).as_unit("ns").asi8) != step.value) + 1
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]


def bridged(
    parts: Sequence[pd.DataFrame], step: pd.Timedelta, measured: Sequence[str], held: Sequence[str]
) -> pd.DataFrame:
    """Stretches of rows as one: in between the inputs are interpolated, and no temperature is known.

    ``measured`` are the columns of temperatures that stay missing there, ``held`` those that keep their last value.
    """
    if len(parts) == 1:
        return parts[0]
    index = pd.date_range(parts[0].index[0], parts[-1].index[-1], freq=step)
    whole = pd.concat(parts).reindex(index)
    whole = whole.assign(**{role: whole[role].ffill() for role in held if role in whole})
    inputs = whole.drop(columns=list(measured)).interpolate("time")
    return whole.assign(**{str(role): inputs[role] for role in inputs})


def like_index(stamp: pd.Timestamp, index: pd.Index) -> pd.Timestamp:
    """A stamp in the time zone of an index, or without one."""
    tz = pd.DatetimeIndex(index).tz
    if tz is None:
        return stamp.tz_localize(None)
    return stamp.tz_localize(tz) if stamp.tz is None else stamp.tz_convert(tz)
