"""Cells that hold a date, a time or both in any of the forms that loggers write, and their stamps."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from .._table import listed
from .stamp_numbers import (
    ANY,
    are_serials,
    elapsed_unit,
    is_digits,
    is_elapsed_name,
    is_epoch,
    stamps_of_elapsed,
    stamps_of_numbers,
    with_separators,
)
from .stamp_parts import hour_column, part_columns
from .stamps import blocks, cell, numbered_dates, parse_stamps, refuse_blank_stamps

_USUAL_NAMES = re.compile(
    r"(?:#|<>)?\s*((time ?stamps?|ts|epoch|unix([ _-]?time(stamp)?)?)([ _-]?(s|ms|us|ns))?|"
    r"date[ _/-]*time|time|date|stamp|datum|zeit|uhrzeit|zeitstempel|zeitpunkt|"
    r"datum[ _/-]*(uhr)?zeit|index|_time|when|utc|(local|utc|start|read)[ _-]?(time|date|datetime)|"
    r"(created|recorded|last_changed)(_at)?|dt|tijd|tijdstip|heure|date[ _]heure|horodatage|fecha|hora|data|ora|"
    r"(fecha|data)[ _/-]*(y[ _]|e[ _])?h?ora|marca temporal|aika(leima)?|päivämäärä|pvm|kello(naika)?|klo|"
    r"tid(s?punkt)?|dato|czas|godzina|čas)\s*(\(.*\)|\[.*\])?\s*\Z",
    re.IGNORECASE,
)
_MONTHS = {
    **dict.fromkeys(("januar", "januari", "janvier", "janv", "jän", "enero", "ene", "gennaio", "gen"), "Jan"),
    **dict.fromkeys(("februar", "februari", "févr", "février", "febrero", "febbraio"), "Feb"),
    **dict.fromkeys(("märz", "mrz", "mär", "maart", "mrt", "mars", "marzo"), "Mar"),
    **dict.fromkeys(("avril", "avr", "abril", "abr", "aprile"), "Apr"),
    **dict.fromkeys(("mai", "mei", "mayo", "maggio", "mag"), "May"),
    **dict.fromkeys(("juni", "juin", "junio", "giugno", "giu"), "Jun"),
    **dict.fromkeys(("juli", "juillet", "juil", "julio", "luglio", "lug"), "Jul"),
    **dict.fromkeys(("augustus", "août", "agosto", "ago"), "Aug"),
    **dict.fromkeys(("septembre", "sept", "septiembre", "settembre", "set"), "Sep"),
    **dict.fromkeys(("oktober", "okt", "octobre", "octubre", "ottobre", "ott"), "Oct"),
    **dict.fromkeys(("novembre", "noviembre"), "Nov"),
    **dict.fromkeys(("dezember", "dez", "décembre", "déc", "diciembre", "dic", "dicembre"), "Dec"),
}
_ENGLISH = "Jan(?:uary)?|Feb(?:ruary)?|Mar(?:ch)?|Apr(?:il)?|May|June?|July?|Aug(?:ust)?|Sep(?:tember)?|Oct(?:ober)?"
_MONTH = rf"(?:{'|'.join(_MONTHS)}|{_ENGLISH}|Nov(?:ember)?|Dec(?:ember)?)\b\.?"
_WEEKDAY = r"(?:[A-Za-zäéöü]{2,10}\.?,?\s+)"
_TIME = r"\d{1,2}[:.h]\d{2}(?:[:.]\d{2}(?:[.,]\d+)?)?(?:\s*[ap]\.?\s?m\.?)?"
_SPACED = r"^(\d+)\.\s?(\d+)\.\s?(\d+)\.?(?=\s|$)"  # 2. 10. 2023 and 02.10.2023. of Central Europe
_SHORT_YEAR = r"^(\d{2})([-/.])(\d{2})\2(\d{2})(?!\d)"
_BY = r"(?:[-/]|\.\s?)"
_DATE = (
    rf"{_WEEKDAY}?(?:(?:\d{{4}}{_BY}\d{{1,2}}{_BY}\d{{1,2}}|\d{{1,2}}{_BY}\d{{1,2}}{_BY}(?:\d{{4}}|\d{{2}}))\.?|"
    rf"(?:19|20)\d{{6}}|"
    rf"\d{{1,2}}\.?[-\s/]*{_MONTH}[-\s/,]*\d{{2,4}}|{_MONTH}\s\d{{1,2}},?\s\d{{4}})"
)
_CITY = r"(Z|[+-]\d{2}:\d{2})\s+[A-Z][\w/+-]*$"  # after an offset, as Haystack writes it
_ZONE = rf"\s*(?:{_CITY}|Z|UTC|GMT|[A-Z]{{3,4}}|[+-]\d{{2}}(?::?\d{{2}})?)?"
_DAY_OF_YEAR = rf"{_WEEKDAY}?(\d{{1,2}})[/-]({_MONTH})"  # of IES, without a year
_IS_DATE = re.compile(rf"{_DATE}|{_DAY_OF_YEAR}", re.IGNORECASE)
_IS_TIME = re.compile(_TIME, re.IGNORECASE)
_WITHOUT_YEAR = r"\d{1,2}/\d{1,2}\s+\d{1,2}:\d{2}(?::\d{2})?"  # of EnergyPlus
_JOINED = r"(?:DT#)?(\d{4}-\d{1,2}-\d{1,2})[-_](?=\d{1,2}:\d{2})"  # to the time, as controllers and FHEM write it
_IS_STAMP = re.compile(
    rf"{_JOINED}{_TIME}|{_DATE}(?:(?:T|[\s,]+)(?:{_TIME}|\d{{4}}(?:\d{{2}})?){_ZONE})?|{_WITHOUT_YEAR}|{_DAY_OF_YEAR}|{ANY}",
    re.IGNORECASE,
)
_POINTS = r"(?<=\d[T\s])\d{1,2}\.\d{2}(?:\.\d{2})?$"  # between hour and minute, as in Italy
_LATE = r"[T\s]24:00(?::00)?\b"
_SUNDAY, _LEAP_SUNDAY = 2017, 2012  # years that begin on a Sunday
_CALENDARS = 28  # years after which the days of the week come again


def is_stamp(text: str) -> bool:
    """Whether a cell looks like a date, with or without a time, or like seconds since 1970."""
    return _IS_STAMP.fullmatch(text) is not None


def is_stamp_name(name: str) -> bool:
    """Whether a column with this name usually holds time stamps."""
    return _USUAL_NAMES.match(name.strip()) is not None


def find_stamp_columns(sample: pd.DataFrame, chosen: str | Sequence[str] | None, where: str) -> tuple[str, ...]:
    """The column of time stamps, or those of date and time, in a table of which some rows are given."""
    names = list(sample.columns)
    if chosen is not None:
        wanted = (chosen,) if isinstance(chosen, str) else tuple(chosen)
        for name in wanted:
            if name not in names:
                raise ValueError(
                    f"time_column= names {name!r}, which is not in {where}; its columns are {listed(names)}."
                )
        return wanted
    times = [name for name in names if _IS_TIME.fullmatch(str(name))]
    if 2 * len(times) > len(names):
        raise ValueError(
            f"{where} has a row for each day and a column for each time of day, such as {times[0]!r}; write one row "
            "for each time stamp."
        )
    held = {name: _kind(sample[name], str(name)) for name in names}
    dates, times = ([name for name in names if held[name] == kind] for kind in ("date", "time"))
    if not any(kind == "stamp" for kind in held.values()):
        if dates and (times or (hour := hour_column(names, sample))):
            return (dates[0], times[0] if times else str(hour))
        if not dates and (parts := part_columns(names)):
            return parts
    usual = [name for name in names if is_stamp_name(str(name))]
    order = (
        ("stamp", usual),
        ("epoch", usual),
        ("stamp", names),
        ("date", names),
        ("serial", usual),
        ("elapsed", usual),
        (None, usual),
    )
    for kind, among in order:
        found = [name for name in among if held[name] == kind]
        if found:
            return (found[0],)
    raise ValueError(f"{where} has no column of time stamps among {listed(names)}; pass its name as time_column=.")


def holds_stamps(cells: pd.Series, name: str) -> bool:
    """Whether the cells of a column are dates with times, or numbers that stand for such."""
    kind = _kind(cells, name)
    return kind in ("stamp", "date") or (kind in ("epoch", "serial") and is_stamp_name(re.sub(r" \(\d+\)$", "", name)))


def _kind(cells: pd.Series, name: str) -> str | None:
    """The kind of a column's cells: a stamp, a date, a time, or seconds or days since some year."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return "stamp"
    text = cells.dropna().astype(str).str.strip()
    text = text[text != ""].head(100)
    if are_serials(list(text)):
        return "serial"
    if is_elapsed_name(name) and elapsed_unit(list(text), name):
        return "elapsed"
    for kind, fits in (
        ("date", _IS_DATE.fullmatch), ("time", _IS_TIME.fullmatch), ("stamp", is_digits), ("epoch", is_epoch),
        ("stamp", _IS_STAMP.fullmatch),
    ):  # fmt: skip
        if len(text) and sum(bool(fits(one)) for one in text) > 0.5 * len(text):
            if kind == "time" and not (text.str.contains(r"[:h]").any() or is_stamp_name(name)):
                return None  # 18.15 is a number
            midnight = kind == "date" and text.str.contains(":").any()
            return "stamp" if midnight else kind
    return None


def read_stamps(
    cells: pd.Series, dayfirst: bool | None, where: str, year: int | None = None, guesses: bool = True
) -> tuple[pd.DatetimeIndex, list[str], bool]:
    """Stamps of cells of any kind, remarks on how they were read, and whether one is 24:00, the end of a day.

    ``cells`` are indexed by the rows of the file; ``year`` is that of the first where they have none.  What only their
    order tells, or nothing, is refused without ``guesses``.
    """
    if pd.api.types.is_datetime64_any_dtype(cells):
        return pd.DatetimeIndex(cells), [], False
    refuse_blank_stamps(cells, where)
    if (numbers := stamps_of_numbers(cells, where)) is not None:
        return *numbers, False
    if (guesses or year) and (elapsed := stamps_of_elapsed(cells, year or _SUNDAY, where)) is not None:
        return *elapsed, False
    text, notes = _with_years(cells, year) if guesses or year is not None else (cells, [])
    text, next_day = _plain(text)
    if guesses and dayfirst is None and _year_first_by_order(text):
        notes.append(f"dates such as {cell(text.iloc[0])} are read with the year first")
        text = "20" + text
    if dayfirst is None and re.match(r"\d{1,2}\.\d{1,2}\.", text.iloc[0]):
        dayfirst = True  # nobody writes the month first with points
    if guesses and dayfirst is None and (dayfirst := _day_first_by_order(text)) is not None:
        first = "day" if dayfirst else "month"
        notes.append(f"dates such as {cell(text.iloc[0])} are read with the {first} first")
    return parse_stamps(text, dayfirst, where, next_day), notes, bool(next_day.any())


def _with_years(cells: pd.Series, year: int | None) -> tuple[pd.Series, list[str]]:
    """Stamps that have a month and a day alone, with a year, and a remark on it; others as they are."""
    head, days = cells.iloc[:1000].astype(str).str.strip(), None
    named = head.str.match(rf"(?i){_DAY_OF_YEAR}\s+\d").all()
    if not named and not head.str.fullmatch(_WITHOUT_YEAR).all():
        return cells, []
    text = cells.astype(str).str.strip()
    if named:
        days = text.str.extract(r"(?i)^(mon|tue|wed|thu|fri|sat|sun)")[0]
        text = text.str.replace(rf"(?i)^{_DAY_OF_YEAR}", _in_numbers, regex=True)
    apart = text.str.extract(r"^(\d{1,2})/(\d{1,2})\s+(.*)$")
    month = pd.to_numeric(apart[0])
    dates = pd.DataFrame({"year": (month.diff() < -6).cumsum(), "month": month, "day": pd.to_numeric(apart[1])})
    leap = ((month == 2) & (dates["day"] == 29)).any()
    dated = None if year or days is None else _year_of_weekdays(dates.assign(weekday=days.str.lower()))
    first = year or dated or (_LEAP_SUNDAY if leap else _SUNDAY)
    why = "is the last one with these days of the week" if dated else "is assumed, which begins on a Sunday"
    notes = [] if year else [f"the stamps have no year: {first} {why}; give year = in [log]"]
    years = (first + dates["year"]).astype(str)
    return years + "-" + apart[0].str.zfill(2) + "-" + apart[1].str.zfill(2) + " " + apart[2], notes


def _year_of_weekdays(days: pd.DataFrame) -> int | None:
    """The latest year, not in the future, in which all days fall on their day of the week; None where there is none.

    The column ``year`` counts from that of the first row.
    """
    days, now = days.drop_duplicates(), pd.Timestamp.now()
    for year in range(now.year, now.year - _CALENDARS, -1):
        dates = pd.to_datetime(days[["year", "month", "day"]].assign(year=year + days["year"]), errors="coerce")
        if dates.iloc[-1] <= now and (dates.dt.day_name().str[:3].str.lower() == days["weekday"]).all():
            return year
    return None


def _in_numbers(day: re.Match[str]) -> str:
    """A day such as Mon 01/Oct as 10/01."""
    name = day[2].rstrip(".").lower()
    return f"{pd.Timestamp(f'2000 {_MONTHS.get(name, name)} 1').month}/{day[1]}"


def _plain(cells: pd.Series) -> tuple[pd.Series, np.ndarray]:
    """Stamps with English months and without the day of the week; and which of them are written as 24:00."""
    late = np.zeros(len(cells), dtype=bool)
    parts = [_plain_block(cells.iloc[rows], late[rows]) for rows in blocks(len(cells))]
    if all(part is None for part in parts):
        return cells.astype(str), late
    both = zip(parts, blocks(len(cells)), strict=True)
    return pd.concat([cells.iloc[rows].astype(str) if part is None else part for part, rows in both]), late


def _plain_block(cells: pd.Series, late: np.ndarray) -> pd.Series | None:
    """The stamps of a block, None where they need no change; marks those at 24:00 in ``late``."""
    plain = cells.astype(str).str.strip()
    text = with_separators(plain)
    if text.iloc[:1000].str.match(_JOINED).any():
        text = text.str.replace(f"^{_JOINED}", r"\1 ", regex=True)
    if text.iloc[:1000].str.contains(r"\.\s|\.$", regex=True).any():
        text = text.str.replace(_SPACED, r"\1.\2.\3", regex=True)
    if text.iloc[:1000].str.contains(_POINTS, regex=True).any():
        text = text.str.replace(_POINTS, lambda m: m[0].replace(".", ":"), regex=True)
    late[:] = text.str.contains(_LATE, regex=True).to_numpy(dtype=bool)
    if late.any():
        text = text.where(~late, text.str.replace(r"([T\s])24:", r"\g<1>00:", regex=True))
    if not text.iloc[:1000].str.contains(r"[A-SU-Ya-su-y]", regex=True).any():  # other than T and Z
        return None if text is plain else text
    for old, new in (
        (_CITY, r"\1"),
        (rf"(?i)^(?!{_MONTH}){_WEEKDAY}(?=\d|{_MONTH})", ""),
        (r"(?i)\s*([ap])\.?\s?m\.?(?=\W|$)", r" \1M"),
        (r"(?i)(?<=\d)\s*(UTC|GMT)$", "Z"),
        (r"(?i)(?<=\d)\s*Uhr$", ""),
        (r"^(\d{1,2})\.\s*(?=[^\W\d])", r"\1 "),
    ):
        text = text.str.replace(old, new, regex=True)
    if text.str.contains("|".join(_MONTHS), case=False, regex=True).any():
        for old, new in _MONTHS.items():
            if text.str.contains(old, case=False, regex=False).any():
                text = text.str.replace(rf"(?i)\b{old}\b\.?", new, regex=True)
    return text.str.replace(r"([^\W\d]{3,})\.", r"\1", regex=True)


def _year_first_by_order(text: pd.Series) -> bool:
    """Whether the last of three numbers of two digits, as in 24-01-31, changes most often."""
    if re.match(_SHORT_YEAR, text.iloc[0].strip()) is None:
        return False
    numbers = text.str.strip().str.extract(_SHORT_YEAR)[[0, 2, 3]]
    changes = (numbers != numbers.shift()).sum().to_numpy()
    return bool(numbers.notna().all(axis=None) and changes[2] > changes[:2].max())


def _day_first_by_order(text: pd.Series) -> bool | None:
    """Whether dates such as 01/02/2024 begin with the day, which changes more often; None if unclear."""
    numbers = numbered_dates(text)
    if numbers.isna().any(axis=None) or (numbers > 12).any(axis=None) or len(numbers) < 2:
        return None
    changes = [(numbers[j] != numbers[j].shift()).sum() for j in (0, 1)]
    return None if changes[0] == changes[1] else bool(changes[0] > changes[1])
