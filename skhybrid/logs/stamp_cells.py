"""Cells that hold a date, a time or both in any of the forms that loggers write, and their stamps."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from .stamps import blocks, cell, numbered_dates, parse_stamps

_USUAL_NAMES = re.compile(
    r"#?\s*(time ?stamps?|date[ _/-]*time|time|date|stamp|datum|zeit|uhrzeit|zeitstempel|zeitpunkt|"
    r"datum[ _/-]*(uhr)?zeit|index|ts|_time|when|epoch|utc|(local|utc|start|read)[ _-]?(time|date|datetime)|"
    r"(created|recorded|last_changed)(_at)?|dt|tijd|tijdstip|heure|date[ _]heure|horodatage)\s*(\(.*\)|\[.*\])?\s*\Z",
    re.IGNORECASE,
)
_MONTHS = {
    **dict.fromkeys(("januar", "januari", "janvier", "janv", "jän"), "Jan"),
    **dict.fromkeys(("februar", "februari", "févr", "février"), "Feb"),
    **dict.fromkeys(("märz", "mrz", "mär", "maart", "mrt", "mars"), "Mar"),
    **dict.fromkeys(("avril", "avr"), "Apr"),
    **dict.fromkeys(("mai", "mei"), "May"),
    **dict.fromkeys(("juni", "juin"), "Jun"),
    **dict.fromkeys(("juli", "juillet", "juil"), "Jul"),
    **dict.fromkeys(("augustus", "août"), "Aug"),
    **dict.fromkeys(("septembre", "sept"), "Sep"),
    **dict.fromkeys(("oktober", "okt", "octobre"), "Oct"),
    **dict.fromkeys(("novembre",), "Nov"),
    **dict.fromkeys(("dezember", "dez", "décembre", "déc"), "Dec"),
}
_ENGLISH = "Jan(?:uary)?|Feb(?:ruary)?|Mar(?:ch)?|Apr(?:il)?|May|June?|July?|Aug(?:ust)?|Sep(?:tember)?|Oct(?:ober)?"
_MONTH = rf"(?:{'|'.join(_MONTHS)}|{_ENGLISH}|Nov(?:ember)?|Dec(?:ember)?)\b\.?"
_WEEKDAY = r"(?:[A-Za-zäéöü]{2,10}\.?,?\s+)"
_TIME = r"\d{1,2}[:.h]\d{2}(?:[:.]\d{2}(?:[.,]\d+)?)?(?:\s*[ap]\.?m\.?)?"
_DATE = (
    rf"{_WEEKDAY}?(?:\d{{4}}[-/.]\d{{1,2}}[-/.]\d{{1,2}}|\d{{1,2}}[-/.]\d{{1,2}}[-/.](?:\d{{4}}|\d{{2}})|(?:19|20)\d{{6}}|"
    rf"\d{{1,2}}\.?[-\s/]*{_MONTH}[-\s/,]*\d{{2,4}}|{_MONTH}\s\d{{1,2}},?\s\d{{4}})"
)
_ZONE = r"\s*(?:Z|UTC|GMT|[A-Z]{3,4}|[+-]\d{2}(?::?\d{2})?)?"
_IS_DATE = re.compile(_DATE, re.IGNORECASE)
_IS_TIME = re.compile(_TIME, re.IGNORECASE)
_IS_EPOCH = re.compile(r"[12]\d{9}(?:\d{3}|\d{6}|\d{9})?(?:\.\d*)?")
_IS_STAMP = re.compile(
    rf"{_DATE}(?:(?:T|[\s,]+)(?:{_TIME}|\d{{4}}(?:\d{{2}})?){_ZONE})?|{_IS_EPOCH.pattern}", re.IGNORECASE
)
_EPOCH_UNITS = ((1e11, "s", 1e9), (1e14, "ms", 1e6), (1e17, "us", 1e3), (np.inf, "ns", 1.0))  # limit, unit, nanoseconds


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
                    f"time_column= names {name!r}, which is not in {where}; its columns are "
                    f"{', '.join(map(repr, names))}."
                )
        return wanted
    held = {name: _kind(sample[name]) for name in names}
    dates, times = ([name for name in names if held[name] == kind] for kind in ("date", "time"))
    if dates and times and not any(kind == "stamp" for kind in held.values()):
        return (dates[0], times[0])
    usual = [name for name in names if is_stamp_name(str(name))]
    for kind, among in (("stamp", usual), ("stamp", names), ("date", names), ("epoch", usual), (None, usual)):
        found = [name for name in among if held[name] == kind]
        if found:
            return (found[0],)
    raise ValueError(
        f"{where} has no column of time stamps among {', '.join(map(repr, names))}; pass its name as time_column=."
    )


def joined_cells(table: pd.DataFrame, stamps: Sequence[str]) -> pd.Series:
    """The cells of time stamps, date and time joined."""
    cells = table[stamps[0]]
    for other in stamps[1:]:
        cells = cells.astype(str).str.strip() + " " + table[other].astype(str).str.strip()
    return cells


def _kind(cells: pd.Series) -> str | None:
    """The kind of a column's cells: a stamp, a date, a time or seconds since 1970."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return "stamp"
    text = cells.dropna().astype(str).str.strip()
    text = text[text != ""].head(100)
    for kind, pattern in (("date", _IS_DATE), ("time", _IS_TIME), ("epoch", _IS_EPOCH), ("stamp", _IS_STAMP)):
        if len(text) and sum(pattern.fullmatch(one) is not None for one in text) > 0.5 * len(text):
            midnight = kind == "date" and text.str.contains(":").any()
            return "stamp" if midnight else kind
    return None


def read_stamps(cells: pd.Series, dayfirst: bool | None, where: str) -> tuple[pd.DatetimeIndex, list[str]]:
    """Stamps of cells of any kind, and remarks on how they were read; ``cells`` are indexed by the rows of the file."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return pd.DatetimeIndex(cells), []
    numbers = pd.to_numeric(cells.iloc[:1000], errors="coerce")
    if cells.iloc[:1000].astype(str).str.fullmatch(_IS_EPOCH.pattern).all() and (numbers > 0).all():
        return _from_epoch(cells, where)
    text, next_day = _plain(cells)
    notes = []
    if dayfirst is None and re.match(r"\d{1,2}\.\d{1,2}\.", text.iloc[0]):
        dayfirst = True  # nobody writes the month first with points
    if dayfirst is None and (dayfirst := _day_first_by_order(text)) is not None:
        first = "day" if dayfirst else "month"
        notes.append(f"dates such as {cell(text.iloc[0])} are read with the {first} first")
    return parse_stamps(text, dayfirst, where, next_day), notes


def _from_epoch(cells: pd.Series, where: str) -> tuple[pd.DatetimeIndex, list[str]]:
    numbers = pd.to_numeric(cells, errors="coerce")
    known = numbers.notna().to_numpy()
    if not known.all():
        row = int(np.argmax(~known))
        raise ValueError(f"row {cells.index[row] + 2} of {where}: the stamp {cell(cells.iloc[row])} is not a number.")
    unit, scale = next((unit, scale) for limit, unit, scale in _EPOCH_UNITS if numbers.iloc[0] < limit)
    ticks = numbers.astype(np.int64) * int(scale) if (numbers % 1 == 0).all() else (numbers * scale).round()
    if not (ticks.abs() < 9e18).all():
        raise ValueError(f"{where} has time stamps beyond the year 2250; are they {unit} since 1970?")
    stamps = pd.DatetimeIndex(ticks.to_numpy(dtype=np.int64).astype("datetime64[ns]"), tz="UTC")
    return stamps, [f"stamps are {unit} since 1970, UTC"]


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
    text = cells.astype(str).str.strip()
    late[:] = text.str.contains(r"[T\s]24:00(?::00)?\b", regex=True).to_numpy(dtype=bool)
    if late.any():
        text = text.where(~late, text.str.replace(r"([T\s])24:", r"\g<1>00:", regex=True))
    if not text.iloc[:1000].str.contains(r"[A-SU-Ya-su-y]", regex=True).any():  # other than T and Z
        return text if late.any() else None
    for old, new in (
        (rf"(?i)^(?!{_MONTH}){_WEEKDAY}(?=\d|{_MONTH})", ""),
        (r"(?i)\s*([ap])\.?m\.?(?=\W|$)", r" \1M"),
        (r"(?i)(?<=\d)\s*(UTC|GMT)$", "Z"),
        (r"^(\d{1,2})\.\s*(?=[^\W\d])", r"\1 "),
    ):
        text = text.str.replace(old, new, regex=True)
    for old, new in _MONTHS.items():
        if text.iloc[0] and text.str.contains(old, case=False, regex=False).any():
            text = text.str.replace(rf"(?i)\b{old}\b\.?", new, regex=True)
    return text.str.replace(r"([^\W\d]{3,})\.", r"\1", regex=True)


def _day_first_by_order(text: pd.Series) -> bool | None:
    """Whether dates such as 01/02/2024 begin with the day, which changes more often; None if unclear."""
    numbers = numbered_dates(text)
    if numbers.isna().any(axis=None) or (numbers > 12).any(axis=None) or len(numbers) < 2:
        return None
    changes = [(numbers[j] != numbers[j].shift()).sum() for j in (0, 1)]
    return None if changes[0] == changes[1] else bool(changes[0] > changes[1])
