"""Numbers, days, leads and settings of a report as text."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from ..._warnings import percent as plain_percent


def number(value: Any, digits: int) -> str:
    """A number of so many digits, or a dash."""
    if value is None or not np.isfinite(float(value)):
        return "–"
    number = float(value)
    return f"{number:.{digits}f}" if abs(number) >= 10.0**-digits or number == 0 else f"{number:.2g}"


def percent(share: float | None) -> str:
    """A share as a percentage, or a dash."""
    return "–" if share is None or not np.isfinite(share) else plain_percent(share).replace(" ", "\u00a0")


def day_words(index: pd.Index) -> str:
    """The day of some rows in words."""
    if not isinstance(index, pd.DatetimeIndex):
        return "the next day"
    return f"{index[0]:%A} {index[0].day} {index[0]:%B %Y}"


def lead_groups(frame: pd.DataFrame) -> list[str]:
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
            out[name] = value
    return out
