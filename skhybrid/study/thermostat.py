"""Set-points of a day to come: two numbers, a daily schedule, or columns of a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES
from .._time import wall_clock
from .clock_values import at_minute, by_clock, free_days, minutes
from .keys import check_keys

_KINDS = ("heat", "cool", "weekend")


class Schedule(NamedTuple):
    """Set-points by the minute of the day; a day begins with the last of the day before."""

    heat: dict[int, float]  # minute of the day -> heating set-point [degC]; empty: not heated
    cool: dict[int, float]
    weekend: Any = None  # Schedule of weekends and holidays, where they differ; of the same sides

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any], where: str = "[thermostat]") -> Self | None:
        """The schedule of ``[thermostat]``, or of what else errors name; None if it is empty.

        A ValueError says what cannot be read, where heating is above cooling, or what only the weekend has.
        """
        if not tables:
            return None
        check_keys("thermostat", tables, _KINDS)
        sides = [by_clock(f"{where} {name}", tables.get(name), "set-point", (0, 45)) for name in ("heat", "cool")]
        if not any(sides):
            raise ValueError("[thermostat] needs heat or cool, such as heat = 21.")
        own = {name: tables[name] for name in ("heat", "cool") if name in tables}
        weekend = tables.get("weekend", {})
        if not isinstance(weekend, Mapping) or not set(weekend) <= set(own):
            raise ValueError(
                f"[thermostat] weekend = {weekend!r} must be a table of {' and '.join(own)}, as on weekdays."
            )
        at_weekend = cls.of_tables(own | dict(weekend), "[thermostat] weekend") if weekend else None
        found = cls(sides[0], sides[1], at_weekend)
        before, free, minute = np.indices((2, 2, 1440)).reshape(3, -1)
        heat, cool = (found._side(side, minute, free == 1, before == 1) for side in (0, 1))
        if (heat > cool).any():
            row = int(np.argmax(heat > cool))
            at = minute[row]
            raise ValueError(
                f"the thermostat heats to {heat[row]:g} and cools to {cool[row]:g} degC at {at // 60}:{at % 60:02d}; "
                "swap or mend them."
            )
        return found

    @classmethod
    def of_text(cls, text: str) -> Self:
        """Set-points as on the command line: ``21``, ``21,24``, or ``6:00=21,22:00=17;24``."""
        if not isinstance(text, str):
            raise ValueError(
                f"the set-points {text!r} are not text; give them as on the command line, such as '21,24'."
            )
        sides = text.replace(" ", "").split(";") if ";" in text or "=" in text else text.replace(" ", "").split(",")
        if len(sides) > 2:
            raise ValueError(f"--setpoint {text!r} is not a heating and a cooling set-point, such as 21,24.")
        names = dict(zip(("heat", "cool"), sides, strict=False))
        made = cls.of_tables({name: _of_text(side) for name, side in names.items() if side}, where="--setpoint,")
        if made is None:
            raise ValueError("--setpoint is empty; give the heating and the cooling set-point, such as 21,24.")
        return made

    def band(self, index: pd.DatetimeIndex, holidays: Any = None) -> pd.DataFrame:
        """``T_heat_set`` and ``T_cool_set`` [degC] of rows in local time, without a column for a side not given.

        ``holidays``, as for :class:`skhybrid.hybrid.HybridPredictor`, are days of the weekend.
        """
        local = wall_clock(index)
        free, before = (free_days(holidays, days) for days in (local, local - pd.Timedelta("1D")))
        roles = [(role, side) for side, role in enumerate(SETPOINT_ROLES) if self[side]]
        columns = {role: self._side(side, minutes(index), free, before) for role, side in roles}
        return pd.DataFrame(columns, index=index)

    def _side(self, side: int, minute: np.ndarray, free: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Set-points (n,) of a side, by whether the days (n,) and those before them are of the weekend."""
        week, weekend = self[side], (self.weekend or self)[side]
        if not week:
            return np.full(len(minute), np.nan)
        early = minute < np.where(free, min(weekend), min(week))
        clock = np.where(early, -1, minute)  # the last of a day
        return np.where(np.where(early, before, free), at_minute(weekend, clock), at_minute(week, clock))


def _of_text(side: str) -> Any:
    """A number, or clock times with set-points."""
    try:
        if "=" not in side:
            return float(side)
        pairs = [(clock, float(value)) for clock, value in (part.split("=") for part in side.split(","))]
    except ValueError:
        raise ValueError(f"--setpoint {side!r} is not a set-point such as 21, or 6:00=21,22:00=17.") from None
    if len(dict(pairs)) < len(pairs):
        raise ValueError(f"--setpoint {side!r} has a clock time twice; remove one.")
    return dict(pairs)
