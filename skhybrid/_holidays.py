"""Holidays, which count as Sundays wherever a model tells the days of a week apart."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, time
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from ._clock import kept_by_stamps
from ._time import per_hour, wall_clock

_THURSDAY, _SATURDAY, _SUNDAY = 3, 5, 6
_HOW = "give a country or state such as 'US' or 'DE-BY', or a list of dates such as '2018-12-25'"


@dataclass(frozen=True)
class Holidays:
    """The holidays of a country or state, and given dates; by default none."""

    place: str | None = None  # as the ``holidays`` package names it
    dates: tuple[str, ...] = ()  # such as "2018-12-25"

    def __bool__(self) -> bool:
        return self.place is not None or bool(self.dates)

    def day_of_week(self, stamps: pd.DatetimeIndex) -> np.ndarray:
        """Kind of day (n,) of local stamps: Monday is 0, a Sunday or holiday 6."""
        return _day_of_week(stamps, self)

    def weekend(self, stamps: pd.DatetimeIndex) -> np.ndarray:
        """Whether local stamps lie on a weekend day or a holiday, (n,) bool."""
        return np.asarray(_day_of_week(stamps, self) >= _SATURDAY)


NO_HOLIDAYS = Holidays()


@kept_by_stamps
def _day_of_week(stamps: pd.DatetimeIndex, holidays: Holidays) -> np.ndarray:
    stamps = wall_clock(stamps)
    dates = stamps.asi8 // (24 * per_hour(stamps.unit))
    day = np.asarray((dates + _THURSDAY) % 7)  # the first of all dates is one
    if not holidays or not len(stamps):
        return day
    local = dates.astype("M8[D]")
    known = _dates_between(holidays, stamps.min().year, stamps.max().year)
    place = np.searchsorted(known, local)
    return np.where(known[np.minimum(place, len(known) - 1)] == local, _SUNDAY, day)


@lru_cache(maxsize=256)
def _dates_between(holidays: Holidays, first: int, last: int) -> np.ndarray:
    """Dates (m,) of all holidays in some years, in order, and one that never comes."""
    found = [np.array(holidays.dates, dtype="M8[D]")]
    if holidays.place is not None:
        found += [_holidays_of(holidays.place, year) for year in range(first, last + 1)]
    return np.unique(np.concatenate([*found, [np.datetime64("9999-12-31")]]))


def read_holidays(given: Any, index: pd.Index) -> Holidays:
    """Holidays as a user gives them, for a table with this index; None is none."""
    if given is None or isinstance(given, Holidays):
        return given or NO_HOLIDAYS
    if not isinstance(index, pd.DatetimeIndex):
        raise ValueError("holidays= needs dates, but X has no time stamps; give X a DatetimeIndex, or holidays=None.")
    if isinstance(given, str):
        _holidays_of(given, index[0].year)
        return Holidays(place=given)
    dates = isinstance(given, list | tuple | set | frozenset | np.ndarray | pd.Index | pd.Series)
    if not dates or (isinstance(given, np.ndarray) and given.ndim != 1):
        raise ValueError(f"holidays= ({type(given).__name__}) is neither a name nor dates; {_HOW}.")
    return Holidays(dates=tuple(sorted({_read_date(value, index.tz) for value in given})))


def _read_date(value: Any, zone: Any) -> str:
    """A date as text; refused where it is not midnight, or of another time zone than that of the table."""
    try:
        stamp = _as_stamp(value)
        text, hour = stamp.date().isoformat(), stamp.time()
    except (TypeError, ValueError, AttributeError):
        raise ValueError(f"holidays= has {value!r}, which is not a date; write dates such as '2018-12-25'.") from None
    if stamp.tzinfo is not None and str(stamp.tzinfo) != str(zone):
        raise ValueError(
            f"holidays= has {value} in the time zone {stamp.tzinfo}, but X has {zone}; give local dates without a time "
            "zone (.tz_localize(None))."
        )
    if hour != time(0):
        raise ValueError(f"holidays= has {value}, which has a time of day; give whole days such as '2018-12-25'.")
    return text


def _as_stamp(value: Any) -> Any:
    if isinstance(value, str):
        return datetime.fromisoformat(value)
    if isinstance(value, np.datetime64):
        value = value.astype("M8[us]").item()
    return datetime.combine(value, time(0)) if type(value) is date else value


@lru_cache(maxsize=1024)
def _holidays_of(place: str, year: int) -> np.ndarray:
    """Dates (m,) of a year's holidays in a country or state, in order, with the days on which they are observed."""
    try:
        from holidays import country_holidays, list_supported_countries
    except ImportError:
        raise ImportError(
            f'holidays={place!r} needs the package holidays; install it with pip install "skhybrid[holidays]", or '
            "give a list of dates."
        ) from None
    country, _, state = place.partition("-")
    try:
        if country not in list_supported_countries(include_aliases=True):
            raise NotImplementedError
        found = country_holidays(country, subdiv=state or None, years=year)
    except NotImplementedError:
        raise ValueError(f"holidays={place!r} is unknown to the package holidays; {_HOW}.") from None
    return np.array(sorted(found), dtype="M8[D]")
