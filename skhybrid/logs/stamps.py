"""Time stamps of cells of text: their format and their time zone."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
from pandas.tseries.api import guess_datetime_format

from .._arguments import check_bool

YEARS = (1700, 2250)  # another year is a slip of the pen, and its nanoseconds overflow
_OFFSET = r":\d{2}(?:[.,]\d+)?\s*([zZ]|[+-]\d{2}(?::?\d{2})?)\s*$"
_HAS_OFFSET = re.sub(r"\((?!\?)", "(?:", _OFFSET)  # without groups, of which pandas warns
_BLOCK = 50_000  # rows
_TELLING = 2000  # rows of a log that tell how its dates are written
_NUMBERED = r"^(\d{1,2})[-/.](\d{1,2})[-/.]\d{2,4}"
_YEAR_FIRST = r"\d{4}[-/.]"
_HALF_DAYS = re.compile(
    r"(\d{1,2}|\d{4})([-/.])(\d{1,2}|[A-Z][a-z]{2})\2(\d{4}|\d{1,2}) \d{1,2}:\d{2}(:\d{2})?( ?[AP]M)?", re.ASCII
)
_ZONE_BY_NAME = "has time stamps with a zone by name; give an offset from UTC, or none."


def parse_stamps(
    cells: pd.Series, dayfirst: bool | None, where: str, next_day: np.ndarray | None = None
) -> pd.DatetimeIndex:
    """Time stamps of a log, none blank, in their own zone or naive; unclear or impossible ones are refused.

    Rows of ``next_day`` are a day later than they say.
    """
    if dayfirst is not None:
        check_bool("dayfirst", dayfirst)
    text = cells.astype(str)
    zoned = np.zeros(len(text), dtype=bool)
    offsets: set[str] = set()
    for rows in blocks(len(text)):
        part = text.iloc[rows]
        zoned[rows] = ends = part.str.contains(_HAS_OFFSET, regex=True).to_numpy(dtype=bool)
        offsets.update(part[ends].str.extract(_OFFSET)[0])
    if zoned.any() and not zoned.all():
        row = int(np.argmin(zoned))
        raise ValueError(
            f"row {line(text.index[row])} of {where}: the time stamp {cell(text.iloc[row])} has no offset from UTC, "
            "but others have one."
        )
    day_first, form = _day_first(text, dayfirst, where), text.iloc[0].strip()
    parts = [
        _parse(text.iloc[rows].str.strip(), bool(zoned.any()), day_first, form, where) for rows in blocks(len(text))
    ]
    stamps = pd.DatetimeIndex(parts[0].append(parts[1:]) if len(parts) > 1 else parts[0])
    if next_day is not None and next_day.any():
        stamps = pd.DatetimeIndex(stamps.where(~next_day, stamps + pd.Timedelta("1D")))
    return stamps.tz_convert(_zone_of_offset(*offsets)) if len(offsets) == 1 else stamps


def refuse_blank_stamps(cells: pd.Series, where: str) -> None:
    """Refuse cells of time stamps of which one is empty."""
    empty = cells.isna().to_numpy()
    if empty.any():
        raise _bad_stamp(cells.index[int(np.argmax(empty))], "is empty", where)


def _bad_stamp(row: int, what: str, where: str) -> ValueError:
    return ValueError(f"row {line(row)} of {where}: the time stamp {what}; write it as 2024-01-31 13:45.")


def blocks(n: int) -> list[slice]:
    """Blocks of rows, so that the regular expressions on millions of stamps take little memory."""
    return [slice(i, i + _BLOCK) for i in range(0, max(n, 1), _BLOCK)]


def line(row: int) -> int:
    """Return the line of the file that contains a row of data; the header is line 1."""
    return row + 2


def numbered_dates(text: pd.Series) -> pd.DataFrame:
    """First and second number of dates such as 31/01/2024, one row per different pair, in the order of the log."""
    pairs = [_numbered(text.iloc[rows].str.strip()).drop_duplicates() for rows in blocks(len(text))]
    return pd.concat(pairs).drop_duplicates().astype(np.float64)


def _numbered(text: pd.Series) -> pd.DataFrame:
    """First and second number of each date; of the first row alone where no date has them, which is found sooner."""
    has_any = re.match(_NUMBERED, text.iloc[0]) is not None or text.str.match(_NUMBERED).any()
    return (text if has_any else text.iloc[:1]).str.extract(_NUMBERED)


def read_day_first(cells: pd.Series, stamps: pd.DatetimeIndex) -> bool | None:
    """Whether dates such as 31/01/2024 were read with the day first; None where they do not tell, or are others."""
    some = slice(None, None, max(len(cells) // _TELLING, 1))
    pairs = cells.iloc[some].astype(str).str.strip().str.extract(r"^(\d{1,2})[-/](\d{1,2})[-/]\d").astype(np.float64)
    dates = np.stack([stamps[some].day, stamps[some].month], axis=1)
    day, month = (bool((pairs[order].to_numpy() == dates).all(axis=1).mean() > 0.9) for order in ([0, 1], [1, 0]))
    return None if day == month else day


def _day_first(text: pd.Series, dayfirst: bool | None, where: str) -> bool:
    """Whether dates begin with the day, as one such as 31/01/2024 shows; those that begin with the year do not."""
    numbers = numbered_dates(text)
    known = numbers[0].notna()
    if not known.any():
        return bool(dayfirst) and re.match(_YEAR_FIRST, text.iloc[0].strip()) is None
    plain = text if known.all() else text.str.strip()
    if not known.all() and (year_first := plain[plain.str.match(_YEAR_FIRST)]).size:
        both = f"{cell(year_first.iloc[0])} and {cell(plain[plain.str.match(_NUMBERED)].iloc[0])}"
        raise ValueError(
            f"{where} has dates such as {both}; Excel exchanges day and month where it can, so export the log again, "
            "with dates such as 2024-01-31."
        )
    if dayfirst is not None:
        return bool(dayfirst)
    if (numbers[0] > 12).any():
        return True
    if (numbers[1] > 12).any():
        return False
    raise ValueError(
        f"{where} has dates such as {cell(text.iloc[0])}, which may begin with the day or the month; pass "
        "dayfirst=True or dayfirst=False."
    )


def _parse(text: pd.Series, utc: bool, day_first: bool, form: str, where: str) -> pd.DatetimeIndex:
    """Stamps of a block of rows; ``form`` is the first stamp of the log."""
    if _has_named_zone(form):  # pandas before 3 drops the name
        raise ValueError(f"{where} {_ZONE_BY_NAME}")
    cells = text.reset_index(drop=True)  # rows of a file may come again
    guess = guess_datetime_format(form, dayfirst=day_first) or _format_of(form, day_first) or "mixed"
    parsed = _to_stamps(cells, utc, guess, day_first, where)
    again = parsed.isna().to_numpy()
    if again.any():
        again = again & ~_contradicts(text, day_first)
    if again.any():  # some loggers omit the time at midnight, or seconds that are zero
        other = _to_stamps(cells[again], utc, "mixed", day_first, where)
        parsed = parsed.where(~again, other)
    failed = parsed.isna().to_numpy()
    if failed.any():
        row = int(np.argmax(failed))
        if _has_named_zone(text.iloc[row]):
            raise ValueError(f"{where} {_ZONE_BY_NAME}")
        raise _bad_stamp(text.index[row], f"{cell(text.iloc[row])} is not a date and time", where)
    stamps = pd.DatetimeIndex(parsed)
    strange = (stamps.year < YEARS[0]) | (stamps.year > YEARS[1])
    if strange.any():
        row = int(np.argmax(strange))
        raise ValueError(
            f"row {line(text.index[row])} of {where}: the time stamp {cell(text.iloc[row])} is of the year "
            f"{stamps[row].year}; write it as 2024-01-31 13:45."
        )
    return stamps


def _format_of(stamp: str, day_first: bool) -> str | None:
    """The format of a stamp with AM or PM, or a year of two digits, which pandas would guess anew in each row."""
    if (found := _HALF_DAYS.fullmatch(stamp)) is None:
        return None
    first, by, second, last, seconds, half = found.groups()
    year = "%Y" if len(first + last) > 4 else "%y"
    month, order = ("%b" if second.isalpha() else "%m"), day_first or second.isalpha()
    date = (year, month, "%d") if len(first) == 4 else ("%d", month, year) if order else (month, "%d", year)
    return f"{by.join(date)} {'%I' if half else '%H'}:%M{':%S' * bool(seconds)}{f'{half[:-2]}%p' if half else ''}"


def as_written(stamp: pd.Timestamp, written: object) -> pd.Timestamp:
    """The stamp in the offset from UTC of its cell, or as it is where the cell has none."""
    found = re.search(_OFFSET, str(written))
    if found is None or stamp.tz is None:
        return stamp
    return stamp.tz_convert(_zone_of_offset(found[1]))


def _zone_of_offset(offset: str) -> Any:
    """The time zone of an offset such as ``+01:00`` or ``Z``; that of a stamp in another form has no name."""
    return pd.Timestamp(f"2001-01-01 00:00{offset}").tz


def _has_named_zone(stamp: str) -> bool:
    """Whether a stamp ends with a zone such as CET, which says no offset for certain."""
    return re.search(r":\d{2}\s*(?!UTC|GMT)[A-Z]{3,5}$", stamp) is not None


def _to_stamps(text: pd.Series, utc: bool, form: str, day_first: bool, where: str) -> pd.Series:
    try:
        stamps = pd.to_datetime(text, errors="coerce", utc=utc, format=form, dayfirst=day_first)
    except ValueError:
        stamps = text
    if not pd.api.types.is_datetime64_any_dtype(stamps) or (stamps.dt.tz is not None and not utc):  # zones by name
        raise ValueError(f"{where} {_ZONE_BY_NAME}")
    return stamps


def cell(text: object) -> str:
    """A cell as a message shows it."""
    shown = str(text).strip()
    return repr(shown if len(shown) <= 40 else f"{shown[:37]}...")


def _contradicts(text: pd.Series, day_first: bool) -> np.ndarray:
    """Whether each date has a month above 12 when read like the others; it is refused, not read the other way."""
    numbers = text.str.extract(_NUMBERED).astype(np.float64)
    return (numbers[1 if day_first else 0] > 12).to_numpy()


def time_zone_named(timezone: str) -> Any:
    """The time zone of a name."""
    try:
        if isinstance(timezone, int | float):  # pandas means seconds from UTC
            raise TypeError
        return pd.Timestamp("2001-01-01").tz_localize(timezone).tz
    except Exception as error:  # the class differs between zoneinfo and pytz
        raise ValueError(f"timezone={timezone!r} is unknown; write it as 'Europe/Amsterdam' or 'UTC'.") from error


def in_zone(stamps: pd.DatetimeIndex, timezone: str | None, cells: pd.Series, where: str) -> pd.DatetimeIndex:
    """Stamps in a zone, as they are without one; wall-clock stamps are localized, others converted."""
    if timezone is None:
        return stamps
    if stamps.tz is None:
        return localize(stamps, timezone, cells, where)
    return stamps.tz_convert(time_zone_named(timezone))


def localize(stamps: pd.DatetimeIndex, timezone: str, cells: pd.Series, where: str) -> pd.DatetimeIndex:
    """Localize wall-clock stamps; in the hour that occurs twice in autumn, the first pass is summer time."""
    if stamps[0] > stamps[-1]:  # the newest row comes first
        return localize(stamps[::-1], timezone, cells.iloc[::-1], where)[::-1]
    zone = time_zone_named(timezone)
    skipped = stamps.tz_localize(zone, ambiguous=np.ones(len(stamps), dtype=bool), nonexistent="NaT").isna()
    if skipped.any():
        row = int(np.argmax(skipped))
        raise ValueError(
            f"row {line(cells.index[row])} of {where}: {cell(cells.iloc[row])} does not exist in {zone}, where "
            "daylight saving skips that hour; is the log in standard time (timezone='Etc/GMT...') or UTC?"
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
