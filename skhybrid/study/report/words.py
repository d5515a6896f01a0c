"""Numbers, days, leads and settings of a report as text, and what a comparison of models says."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from ..._warnings import percent

_NOISE = 0.05  # relative differences below this are noise with a few dozen origins


def number(value: Any, digits: int) -> str:
    """A number of so many digits, or a dash."""
    if value is None or not np.isfinite(float(value)):
        return "–"
    number = float(value)
    return f"{number:.{digits}f}" if abs(number) >= 10.0**-digits or number == 0 else f"{number:.2g}"


def percent_or_dash(share: float | None) -> str:
    """A share as a percentage, or a dash."""
    return "–" if share is None or not np.isfinite(share) else percent(share).replace(" ", "\u00a0")


def day_words(index: pd.Index) -> str:
    """The day of some rows in words."""
    if not isinstance(index, pd.DatetimeIndex):
        return "the next day"
    return f"{index[0]:%A} {index[0].day} {index[0]:%B %Y}"


def lead_group_names(frame: pd.DataFrame) -> list[str]:
    """The groups of leads that a blend has weights for, in hours, of a back-test."""
    hours = frame["lead"].max() / pd.Timedelta("1h")
    ends = [f"{hours * share:.3g}" for share in (0, 1 / 12, 1 / 3, 1)]
    return [f"{first} to {last}\u00a0h" for first, last in pairwise(ends)]


def flat(settings: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Nested settings as one level with names such as ``load.setpoint``."""
    out: dict[str, Any] = {}
    for key, value in settings.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping):
            out |= flat(value, f"{name}.")
        elif value is not None:
            is_days = isinstance(value, list) and all(isinstance(day, date) for day in value)
            out[name] = ", ".join(map(str, value)) if is_days else value
    return out


def verdict(table: pd.DataFrame, label: str = "hybrid") -> str:
    """Say in one sentence how the ``rmse`` [K] of one model compares with the best of the others, by model."""
    own = float(table["rmse"][label])
    others = table["rmse"].drop(label).dropna()
    if others.empty:
        return f"The day-ahead temperature error of the {label} model is {own:.2f} K (RMSE)."
    other, best = str(others.idxmin()), float(others.min())
    if own < best * (1 - _NOISE):
        less = f"{percent(1 - own / best)} less than the next best, {other} ({best:.2f} K)"
        return f"The {label} model forecasts best: its error is {own:.2f} K, {less}."
    if own <= best * (1 + _NOISE):
        return f"The {label} model ({own:.2f} K) and {other} ({best:.2f} K) forecast equally well, within the noise."
    return (
        f"Another model forecasts better here: the error of {other} is {best:.2f} K, of the {label} model {own:.2f} K."
    )
