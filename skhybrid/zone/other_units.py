"""Rows of a log that are in other units, or on another clock, than those that the zone knows."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._clock import on_clock_of
from .._table import listed
from ..study.changed_units import refuse_changed_units
from ..study.settings import Settings
from ..study.zone_part import log_columns

_OTHER = 5.0  # median difference of the same temperatures, beyond what a sensor is corrected by [K]
_SAME, _FEWEST = 0.01, 12  # difference of equal temperatures [K]; rows that tell a clock
_SHIFTED, _SAME_ELSEWHERE = 0.5, 0.9  # shares of equal temperatures at their stamps, and at shifted ones
_SHIFTS = [pd.Timedelta(minutes=30 * k) for k in range(-28, 29) if k]  # that time zones and daylight saving make


def refuse_other_temperatures(frame: pd.DataFrame, known: pd.DataFrame, settings: Settings, whose: str) -> None:
    """Refuse a log whose temperatures are others than those ``known`` of the same rows, or those of other hours."""
    known = known.set_axis(on_clock_of(pd.DatetimeIndex(known.index), frame.index))
    for role in (role for role in (*settings.roles_of("T_za"), "T_oa") if role in frame and role in known):
        away = (frame[role] - known[role]).abs()
        if away.median() > _OTHER:
            raise ValueError(
                f"{role} of the log is {away.median():.0f} K from what {whose} has of the same rows: has its column or "
                "its unit changed? Correct the log, or say in the configuration how it is read now."
            )
        if not _share_same(away) <= _SHIFTED:
            continue
        for shift in _SHIFTS:
            if _share_same((frame[role] - known[role].shift(freq=shift)).abs()) > _SAME_ELSEWHERE:
                hours = shift / pd.Timedelta("1h")
                raise ValueError(
                    f"{role} of the log is that which {whose} has {abs(hours):g} h "
                    f"{'earlier' if hours > 0 else 'later'}: has the clock or the time zone of its stamps changed? "
                    "Correct the stamps, or give timezone = in the configuration."
                )


def _share_same(away: pd.Series) -> float:
    """Share of some differences of temperatures that are none; NaN where there are few."""
    both = away.dropna()
    return float((both < _SAME).mean()) if len(both) >= _FEWEST else np.nan


def refuse_other_units(
    new: pd.DataFrame, known: pd.DataFrame, covered: dict[str, tuple[float, float]], settings: Settings
) -> None:
    """Refuse new rows in degF, W/m2 or W beside what the model learned from, usually and not at a single spike."""
    named = {str(role): listed(log_columns([str(role)], settings)) for role in new}
    refuse_changed_units(new, known, covered, named, "give the unit under [units] of the configuration")
