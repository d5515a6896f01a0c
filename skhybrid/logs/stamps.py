"""Parsing of the time stamps in a CSV file: their column, their format and their time zone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from pandas.tseries.api import guess_datetime_format

_USUAL_NAMES = ("timestamp", "time", "datetime", "date_time", "date", "stamp", "index", "utc", "local_time")
_YEARS = (1700, 2250)  # a log of another year has a slip of the pen, and pandas cannot count its nanoseconds
_OFFSET = r":\d{2}(?:[.,]\d+)?\s*([zZ]|[+-]\d{2}(?::?\d{2})?)\s*$"
_NUMBERED = r"^(\d{1,2})[-/.](\d{1,2})[-/.]\d{2,4}"


def find_stamp_column(table: pd.DataFrame, time_column: str | None, where: str) -> str:
    """Column of time stamps: the one named, one with a usual name, or the first whose cells are dates."""
    if time_column is not None:
        if time_column not in table:
            raise ValueError(
                f"time_column={time_column!r} is not in {where}; its columns are {', '.join(map(repr, table.columns))}."
            )
        return time_column
    for column in table.columns:
        if str(column).strip().lower() in _USUAL_NAMES:
            return column
    for column in table.columns:
        cells = table[column].dropna().head(3).astype(str)
        looks = cells.str.contains(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}", regex=True)
        if len(cells) and looks.all():
            return column
    raise ValueError(
        f"{where} has no column of time stamps among {', '.join(map(repr, table.columns))}; pass its name as "
        "time_column=."
    )


def parse_stamps(cells: pd.Series, timezone: str | None, dayfirst: bool | None, where: str) -> pd.DatetimeIndex:
    """Time stamps of a log, in their own zone or in ``timezone``, else naive; unclear or impossible ones refused."""
    text = cells.astype(str).str.strip()
    absent = cells.isna().to_numpy()
    offsets = text.str.extract(_OFFSET)[0]
    zoned = offsets.notna().to_numpy()
    if zoned.any() and not zoned[~absent].all():
        row = int(np.argmax(~zoned & ~absent))
        raise ValueError(
            f"row {line(text.index[row])} of {where}: the time stamp {cell(text.iloc[row])} has no offset from UTC, "
            "but others have one."
        )
    stamps = _parse(text, absent, bool(zoned.any()), _day_first(text, dayfirst, where), where)
    if not zoned.any():
        return stamps if timezone is None else _localize(stamps, _zone(timezone), text, where)
    if timezone is not None:
        return stamps.tz_convert(_zone(timezone))
    return stamps.tz_convert(pd.Timestamp(text.iloc[0]).tz) if len(offsets.unique()) == 1 else stamps


def line(row: int) -> int:
    """Return the line of the file that contains a row of data; the header is line 1."""
    return row + 2


def _day_first(text: pd.Series, dayfirst: bool | None, where: str) -> bool:
    """Whether dates begin with the day, as one such as 31/01/2024 shows."""
    numbers = text.str.extract(_NUMBERED).astype(np.float64)
    if dayfirst is not None or numbers[0].isna().all():
        return bool(dayfirst)
    if (numbers[0] > 12).any():
        return True
    if (numbers[1] > 12).any():
        return False
    raise ValueError(
        f"{where} has dates such as {cell(text.iloc[0])}, which may begin with the day or the month; pass "
        "dayfirst=True or dayfirst=False."
    )


def _parse(text: pd.Series, absent: np.ndarray, utc: bool, day_first: bool, where: str) -> pd.DatetimeIndex:
    known = text.mask(absent)
    guess = guess_datetime_format(text.iloc[0], dayfirst=day_first)
    parsed = _to_stamps(known, utc, guess or "mixed", day_first, where)
    again = parsed.isna().to_numpy() & ~absent & ~_contradicts(text, day_first)
    if again.any():  # some loggers omit the time at midnight, or seconds that are zero
        other = _to_stamps(known[again], utc, "mixed", day_first, where)
        parsed = parsed.where(~again, other)
    failed = parsed.isna().to_numpy()
    if failed.any():
        row = int(np.argmax(failed))
        found = "is empty" if absent[row] else f"{cell(text.iloc[row])} is not a date and time"
        raise ValueError(
            f"row {line(text.index[row])} of {where}: the time stamp {found}; write it as 2024-01-31 13:45."
        )
    stamps = pd.DatetimeIndex(parsed)
    strange = (stamps.year < _YEARS[0]) | (stamps.year > _YEARS[1])
    if strange.any():
        row = int(np.argmax(strange))
        raise ValueError(
            f"row {line(text.index[row])} of {where}: the time stamp {cell(text.iloc[row])} is of the year "
            f"{stamps[row].year}; write it as 2024-01-31 13:45."
        )
    return stamps


def _to_stamps(text: pd.Series, utc: bool, form: str, day_first: bool, where: str) -> pd.Series:
    try:
        stamps = pd.to_datetime(text, errors="coerce", utc=utc, format=form, dayfirst=day_first)
    except ValueError:
        stamps = text
    if not pd.api.types.is_datetime64_any_dtype(stamps) or (stamps.dt.tz is not None and not utc):  # zones by name
        raise ValueError(f"{where} has time stamps with a zone by name; give an offset from UTC, or none.")
    return stamps


def cell(text: object) -> str:
    """A cell as a message shows it."""
    shown = str(text)
    return repr(shown if len(shown) <= 40 else f"{shown[:37]}...")


def _contradicts(text: pd.Series, day_first: bool) -> np.ndarray:
    """Whether each date has a month above 12 when read like the others; it is refused, not read the other way."""
    numbers = text.str.extract(_NUMBERED).astype(np.float64)
    return (numbers[1 if day_first else 0] > 12).to_numpy()


def _zone(timezone: str) -> Any:
    try:
        return pd.Timestamp("2001-01-01").tz_localize(timezone).tz
    except Exception as error:  # the class differs between zoneinfo and pytz
        raise ValueError(f"timezone={timezone!r} is unknown; write it as 'Europe/Amsterdam' or 'UTC'.") from error


def _localize(stamps: pd.DatetimeIndex, zone: Any, text: pd.Series, where: str) -> pd.DatetimeIndex:
    """Localize wall-clock stamps; in the hour that occurs twice in autumn, the first pass is summer time."""
    skipped = stamps.tz_localize(zone, ambiguous=np.ones(len(stamps), dtype=bool), nonexistent="NaT").isna()
    if skipped.any():
        row = int(np.argmax(skipped))
        raise ValueError(
            f"row {line(text.index[row])} of {where}: {cell(text.iloc[row])} does not exist in {zone}, where daylight "
            "saving skips that hour; is the log in standard time (timezone='Etc/GMT...') or UTC?"
        )
    repeated = stamps.tz_localize(zone, ambiguous="NaT", nonexistent="NaT").isna()
    return stamps.tz_localize(zone, ambiguous=_is_first_pass(stamps, np.asarray(repeated)))


def _is_first_pass(stamps: pd.DatetimeIndex, repeated: np.ndarray) -> np.ndarray:
    """Whether each stamp precedes the change of the clock on its day, seen where stamps go back or repeat."""
    first = np.ones(len(stamps), dtype=bool)
    ticks = stamps.as_unit("ns").asi8
    days = stamps.normalize()
    for day in days[repeated].unique():
        rows = np.flatnonzero(repeated & (days == day))
        advance = np.diff(ticks[rows])
        # the stamps of an hourly log do not go back, they repeat
        turn = np.flatnonzero(advance < 0) if (advance < 0).any() else np.flatnonzero(advance == 0)
        if len(turn):
            first[rows[turn[0] + 1 :]] = False
    return first
