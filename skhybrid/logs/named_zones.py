"""Time stamps that end with the name of their zone, such as CDT, which a time zone gives an offset."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import listed
from .stamp_cells import read_stamps
from .stamps import cell, line, time_zone_named

_NAME = r"(?:\d|\d\s*[AaPp]\.?[Mm]\.?)\s*([A-Z]{3,5})$"
_NAME_AFTER_TIME = r"\s*(?![AP]M)[A-Z]{3,5}$"
_OFFSET = r"(?i)(?<![a-z])(?:utc|gmt)(?:\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?)?(?![a-z])"
_UTC = {"UTC", "GMT"}  # names that say an offset by themselves
_SHORTEST = 300  # seconds of the shortest rows that may be stamped with their last one
_GERMAN = {"MEZ": "CET", "MESZ": "CEST"}


def offset_in_name(columns: Sequence[str]) -> str | None:
    """The offset from UTC that the names of the columns of stamps state, such as ``Time (UTC+1)``; None where none."""
    found = re.search(_OFFSET, " ".join(columns))
    if found is None or re.search(r"(?i)local", " ".join(columns)):
        return None
    sign, hours, minutes = found.groups()
    return "UTC" if sign is None else f"{sign}{int(hours):02d}:{minutes or '00'}"


class ZonedStamps(NamedTuple):
    """Stamps as they are written, in the zone that they name."""

    stamps: pd.DatetimeIndex
    notes: list[str]
    ends_rows: bool  # whether stamps end their rows, as 24:00 and 23:59:59 show


def zoned_stamps(
    cells: pd.Series,
    columns: Sequence[str],
    where: str,
    *,
    dayfirst: bool | None = None,
    timezone: str | None = None,
    year: int | None = None,
    guesses: bool = True,
) -> ZonedStamps:
    """The stamps of cells from some columns: naive where neither the cells nor the columns' names tell a zone."""
    names = zone_names(cells)
    plain = cells if names is None else cells.astype(str).str.strip().str.replace(_NAME_AFTER_TIME, "", regex=True)
    stamps, notes, ends = read_stamps(plain, dayfirst, where, year, guesses)
    if (stamps.as_unit("s").asi8 % _SHORTEST == _SHORTEST - 1).all():
        notes = [*notes, f"stamps such as {cell(cells.iloc[0])} are the last second of their rows: a second is added"]
        stamps, ends = stamps + pd.Timedelta("1s"), True
    if names is not None:
        stamps = in_named_zones(stamps, names, timezone, cells, where)
    elif stamps.tz is None and (offset := offset_in_name(columns)) is not None:
        notes = [*notes, f"stamps are UTC{offset.removeprefix('UTC')}, as {listed(columns)} says"]
        stamps = stamps.tz_localize(offset)
    return ZonedStamps(stamps, notes, ends)


def zone_names(cells: pd.Series) -> pd.Series | None:
    """The name of the zone at the end of each stamp; None where the first has none, or all are in UTC."""
    if not re.search(_NAME, str(cells.iloc[0]).strip()):
        return None
    names = cells.astype(str).str.strip().str.extract(_NAME)[0].replace(_GERMAN)
    return None if _UTC.issuperset(names.unique()) else names


def in_named_zones(
    stamps: pd.DatetimeIndex, names: pd.Series, timezone: str | None, cells: pd.Series, where: str
) -> pd.DatetimeIndex:
    """Wall-clock stamps in a time zone; names tell the passes of the hour that occurs twice in autumn apart.

    A ValueError says that a time zone is needed, or names a stamp whose name it does not have at that time.
    """
    if timezone is None:
        raise ValueError(
            f"{where} has time stamps with a zone by name ({names.iloc[0]}), which may be of many places; give that of "
            "the log as timezone=, such as 'America/Chicago' (skhybrid check --timezone)."
        )
    zone, named = time_zone_named(timezone), names.to_numpy(dtype=object)
    first, second = (
        stamps.tz_localize(zone, ambiguous=np.full(len(stamps), is_first), nonexistent="shift_forward")
        for is_first in (True, False)
    )
    in_first, in_second = (_names_of(each, stamps) == named for each in (first, second))
    found, agree = first.where(in_first, second), in_first | in_second
    if not agree.all():
        row = int(np.argmin(agree))
        raise ValueError(
            f"row {line(cells.index[row])} of {where}: {cell(cells.iloc[row])} is in {named[row]}, but {timezone} has "
            f"{found[row].tzname()} then; give the time zone of the log, or leave the names out of the stamps."
        )
    return found


def _names_of(stamps: pd.DatetimeIndex, naive: pd.DatetimeIndex) -> np.ndarray:
    """The name of the zone at each stamp, which its offset tells."""
    offsets = naive.as_unit("s").asi8 - stamps.as_unit("s").asi8
    _, first, of_each = np.unique(offsets, return_index=True, return_inverse=True)
    return np.array([stamps[row].tzname() for row in first], dtype=object)[of_each]
