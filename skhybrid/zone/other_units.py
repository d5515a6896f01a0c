"""Rows of a log that are in other units, or on another clock, than those that the zone knows."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._ranges import is_in_watts
from .._table import is_plant, listed
from ..study.settings import Settings
from ..study.zone_part import log_columns
from .outages import like_index

_OTHER = 5.0  # median difference of the same temperatures, beyond what a sensor is corrected by [K]
_SAME, _FEWEST = 0.01, 12  # difference of equal temperatures [K]; rows that tell a clock
_SHIFTED, _SAME_ELSEWHERE = 0.5, 0.9  # shares of equal temperatures at their stamps, and at shifted ones
_SHIFTS = [pd.Timedelta(minutes=30 * k) for k in range(-28, 29) if k]  # that time zones and daylight saving make
_BRIGHTER = 20.0  # times the highest sun that is known, which sun in W/m2 usually exceeds, and no summer does
_BEYOND = 20.0  # by which degF exceed the highest temperature that is known in degC [K]


def refuse_other_temperatures(frame: pd.DataFrame, known: pd.DataFrame, settings: Settings, whose: str) -> None:
    """Refuse a log whose temperatures are others than those ``known`` of the same rows, or those of other hours."""
    known = known.set_axis(like_index(pd.DatetimeIndex(known.index), frame.index))
    for role in (role for role in settings.roles_of("T_za") if role in frame and role in known):
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
    roles = list(map(str, new))
    for role in (role for role in roles if role.startswith(("T_za", "T_oa")) and role in known):
        values, most = new[role], max(known[role].max(), covered.get(role, (0.0, -np.inf))[1])
        if values.median() > most + _BEYOND:
            raise _other_unit(values, settings, "degC", f"{most:.4g} degC in what the model knows", "degF")
    for role in (role for role in roles if role.startswith("q_sol") and role in covered):
        sun, most = new[role][new[role] > 0.0], covered[role][1]
        if sun.median() > _BRIGHTER * most > 0.0:
            raise _other_unit(new[role], settings, "kW/m2", f"{most:.4g} kW/m2 in what the model learned from", "W/m2")
    for role in (role for role in roles if is_plant(role) and role.startswith("Q_") and role in covered):
        heat = new[role].abs()
        running = heat[heat > 0.0]
        if len(running) and is_in_watts(np.array([running.median()]), covered[role]):
            most = max(map(abs, covered[role]))
            raise _other_unit(heat, settings, "kW", f"{most:.4g} kW in what the model learned from", "W")


def _other_unit(new: pd.Series, settings: Settings, unit: str, known: str, likely: str) -> ValueError:
    """The refusal of new values of a role, which are to be in a unit, beside those that are ``known``."""
    return ValueError(
        f"{listed(log_columns([str(new.name)], settings)) or new.name} reaches {new.max():.4g} {unit} from "
        f"{new.index[0]} on, and {known}: likely {likely} rather than {unit}; correct the rows, or give the unit under "
        "[units] of the configuration."
    )
