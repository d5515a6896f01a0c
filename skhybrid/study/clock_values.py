"""Values by the clock of a configuration, such as set-points and prices, and the days that have others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from .._arguments import is_number
from .._holidays import read_holidays
from .._time import wall_clock

_CLOCK = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)")


def by_clock(where: str, given: Any, what: str, span: tuple[float, float] | None = None) -> dict[int, float]:
    """Values by the minute of the day, of a number or a table of clock times; empty if nothing is given."""
    if given is None:
        return {}
    if isinstance(given, int | float) and not isinstance(given, bool):
        given = {"0:00": given}
    if not isinstance(given, Mapping) or not given:
        raise ValueError(f"{where} = {given!r} must be a {what}, or a table of clock times.")
    low, high = span or (-np.inf, np.inf)
    out: dict[int, float] = {}
    for clock, value in given.items():
        found = _CLOCK.fullmatch(str(clock))
        if found is None:
            raise ValueError(f"{where} has {clock!r}, which is not a clock time such as 6:30.")
        plain = is_number(value)
        if not plain or not low <= value <= high:
            allowed = f" from {low:g} to {high:g} degC" if span else ""
            allowed += " (degF must be converted)" if span and plain and high < value < 120 else ""
            raise ValueError(f"{where} at {clock} is {value!r}, which is not a {what}{allowed}.")
        minute = 60 * int(found[1]) + int(found[2])
        if minute in out:
            raise ValueError(f"{where} has {clock} twice; remove one.")
        out[minute] = float(value)
    return dict(sorted(out.items()))


def at_minute(values: dict[int, float], minute: np.ndarray) -> np.ndarray:
    """Values at some minutes of the day, before the first clock time the last; NaN where there are none."""
    if not values:
        return np.full(len(minute), np.nan)
    starts, held = np.array(list(values)), np.array(list(values.values()))
    return held[np.searchsorted(starts, minute, side="right") - 1]


def minutes(index: pd.DatetimeIndex) -> np.ndarray:
    """Minute of the day of rows in local time."""
    return np.asarray(index.hour * 60 + index.minute)


def free_days(holidays: Any, index: pd.DatetimeIndex) -> np.ndarray:
    """(n,) bool, whether rows in local time lie on a weekend or a holiday."""
    local = wall_clock(index)
    return read_holidays(holidays, local).weekend(local)
