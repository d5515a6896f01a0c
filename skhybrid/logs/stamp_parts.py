"""Stamps over several columns: date and time, date and hour, or year, month, day, hour and minute."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import takewhile

import pandas as pd

_PARTS = tuple(
    re.compile(rf"(?:{words})\s*(\(.*\)|\[.*\])?", re.IGNORECASE)
    for words in (
        "year|yyyy|jahr|ann[ée]e|jaar|año|anno",
        "month|monat|mois|maand|mes|mese",
        "day|tag|jour|dag|d[ií]a|giorno",
        r"hours?(?:[ _-]?(?:ending|beginning|of[ _-]?day))?|hrs?|hh|he|stunde|heure|uur|hora|ora",
        "minutes?|mins?|minuten|minuto",
    )
)
_LEAST_PARTS = 3  # of which a date has three
#: whether a cell is a year
is_year = re.compile(r"(19|20)\d{2}(?:\.0+)?").fullmatch
_HOUR = re.compile(r"\d{1,2}(?:\.0+)?")


def part_columns(names: Sequence[str]) -> tuple[str, ...]:
    """The columns of year, month and day, with those of hour and minute where a table has them; empty where not."""
    found = [next((name for name in names if part.fullmatch(str(name).strip())), None) for part in _PARTS]
    known = tuple(name for name in takewhile(lambda name: name is not None, found) if name is not None)
    return known if len(known) >= _LEAST_PARTS else ()


def hour_column(names: Sequence[str], sample: pd.DataFrame) -> str | None:
    """The column of the hour of the day, where its cells are whole numbers of it."""
    for name in names:
        if _PARTS[3].fullmatch(str(name).strip()):
            cells = sample[name].dropna().astype(str).str.strip()
            if len(cells) and cells.str.fullmatch(_HOUR.pattern).all() and pd.to_numeric(cells).between(0, 24).all():
                return name
    return None


def joined_cells(table: pd.DataFrame, stamps: Sequence[str]) -> pd.Series:
    """The cells of time stamps; date and time, or the parts of both, are joined."""
    if len(stamps) == 1:
        return table[stamps[0]]
    cells = [table[name].astype(str).str.strip() for name in stamps]
    if len(cells) == 2:
        date, time = cells
        return date + " " + time.where(~time.str.fullmatch(_HOUR.pattern), _whole(time) + ":00")
    zero = pd.Series("0", table.index)
    year, month, day, hour, minute = map(_whole, [*cells, zero, zero][:5])
    return year + "-" + month + "-" + day + " " + hour + ":" + minute


def _whole(cells: pd.Series) -> pd.Series:
    return cells.str.replace(r"\.0+$", "", regex=True).str.zfill(2)
