"""Stamps that are numbers: since 1970, since 1900 as in Excel, since a year began, and digits such as 2024013113."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from .stamps import cell, line

_EPOCH = r"[12]\d{9}(?:\d{3}|\d{6}|\d{9})?(?:\.\d*)?"
_DIGITS = r"(?:19|20)\d{2}(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])[ :T]?(?:[01]\d|2[0-4])(?:[0-5]\d){0,2}Z?"
_SERIAL = r"[2-6]\d{4}(?:[.,]\d+)?"  # of 1954 to 2091
#: whether a cell looks like parts of seconds since 1970, a date with its time in digits alone, or days since 1900
is_epoch, is_digits, is_serial = (re.compile(form).fullmatch for form in (_EPOCH, _DIGITS, _SERIAL))
_EPOCH_UNITS = ((1e11, "s", 1e9), (1e14, "ms", 1e6), (1e17, "us", 1e3), (np.inf, "ns", 1.0))  # limit, unit, nanoseconds
_ELAPSED_UNITS = (("s", 1.0, np.inf), ("h", 3600.0, 1.0), ("d", 86400.0, 1.0))  # seconds, longest step in the unit
_NAMED_UNITS = {"s": ("s", 1.0), "m": ("min", 60.0), "h": ("h", 3600.0), "d": ("d", 86400.0)}
_LONGEST = 2.0 * 366.0 * 86400.0  # seconds of a simulation
_IS_ELAPSED_NAME = re.compile(r"(?:#\s*)?(?:time|zeit|tijd)\s*(?:[(\[].*[)\]])?", re.IGNORECASE)
_UNIT_OF_TIME = re.compile(r"[(\[]\s*(s(ec(onds?)?)?|min(utes?)?|h((ou)?rs?)?|d(ays?)?)\s*[)\]]\s*$", re.IGNORECASE)
_EXCEL = "1899-12-30"  # the day 0 of Excel
_UNEVEN = 0.1  # share of the steps, and part of a step, by which those of a simulation may differ
_SAMPLE = 1000  # rows that show what all are
ANY = f"{_EPOCH}|{_DIGITS}"


def are_serials(cells: Sequence[str]) -> bool:
    """Whether cells look like the days since 1900 of consecutive rows."""
    if len(cells) < 2 or not all(map(is_serial, cells)):
        return False
    steps = np.diff([float(one.replace(",", ".")) for one in cells])
    return bool((np.abs(steps) <= 1.0).mean() > 0.9 and (steps != 0.0).any())


def elapsed_unit(cells: Sequence[str], name: str) -> tuple[str, float] | None:
    """The unit of the time of a simulation in even steps, and its seconds; None where cells are no such time.

    A unit in the name of the column counts, and without one what makes steps of whole minutes.
    """
    values = pd.to_numeric(pd.Series(cells, dtype=object), errors="coerce").to_numpy(dtype=np.float64)
    steps = np.diff(values)
    step = np.median(steps) if len(steps) > 1 else np.nan
    if not (step > 0.0 and values.min() >= 0.0 and (np.abs(steps - step) < _UNEVEN * step).mean() > 1.0 - _UNEVEN):
        return None
    if named := _UNIT_OF_TIME.search(name):
        unit, seconds = _NAMED_UNITS[named[1][0].lower()]
        return (unit, seconds) if values.max() * seconds <= _LONGEST else None
    for unit, seconds, longest in _ELAPSED_UNITS:
        minutes = step * seconds / 60.0
        whole = minutes > 1.0 - _UNEVEN and abs(minutes - round(minutes)) < _UNEVEN / 10.0
        if whole and step <= longest and values.max() * seconds <= _LONGEST:
            return unit, seconds
    return None


def is_elapsed_name(name: str) -> bool:
    """Whether a column with this name may hold the time of a simulation."""
    return _IS_ELAPSED_NAME.fullmatch(name.strip()) is not None


def stamps_of_elapsed(cells: pd.Series, year: int, where: str) -> tuple[pd.DatetimeIndex, list[str]] | None:
    """Stamps of the seconds, hours or days since a year began, and a remark; None where the cells are others."""
    if (found := elapsed_unit(list(cells.iloc[:_SAMPLE]), str(cells.name))) is None:
        return None
    unit, seconds = found
    numbers = _numbers(cells, where)
    begin = float(unit == "d" and numbers.min() >= 1.0)  # days of the year count from 1
    stamps = pd.Timestamp(year, 1, 1) + pd.to_timedelta(((numbers - begin) * seconds).round(), unit="s")
    said = f"stamps such as {cell(cells.iloc[0])} are read as {unit} of the year {year}; give year = in [log]"
    return pd.DatetimeIndex(stamps), [said]


def stamps_of_numbers(cells: pd.Series, where: str) -> tuple[pd.DatetimeIndex, list[str]] | None:
    """Stamps of numbers since 1970 or 1900, and a remark; None where the cells are others."""
    head = cells.iloc[:_SAMPLE].astype(str).str.strip()
    if head.str.fullmatch(_EPOCH).all() and not head.str.fullmatch(_DIGITS).all():
        return _from_epoch(cells, where)
    return _from_excel(cells, where) if are_serials(list(head)) else None


def with_separators(text: pd.Series) -> pd.Series:
    """Stamps of digits alone with separators between their parts; others as they are."""
    if not text.iloc[:_SAMPLE].str.fullmatch(_DIGITS).any():
        return text
    apart = r"(\d{4})(\d{2})(\d{2})[ :T]?(\d{2})(\d{2})?(\d{2})?(Z?)"
    return text.str.replace(
        apart, lambda m: f"{m[1]}-{m[2]}-{m[3]} {m[4]}:{m[5] or '00'}:{m[6] or '00'}{m[7]}", regex=True
    )


def _from_epoch(cells: pd.Series, where: str) -> tuple[pd.DatetimeIndex, list[str]]:
    numbers = _numbers(cells, where)
    unit, scale = next((unit, scale) for limit, unit, scale in _EPOCH_UNITS if numbers.iloc[0] < limit)
    ticks = numbers.astype(np.int64) * int(scale) if (numbers % 1 == 0).all() else (numbers * scale).round()
    if not (ticks.abs() < 9e18).all():
        raise ValueError(f"{where} has time stamps beyond the year 2250; are they {unit} since 1970?")
    stamps = pd.DatetimeIndex(ticks.to_numpy(dtype=np.int64).astype("datetime64[ns]"), tz="UTC")
    return stamps, [f"stamps are {unit} since 1970, UTC"]


def _from_excel(cells: pd.Series, where: str) -> tuple[pd.DatetimeIndex, list[str]]:
    seconds = (_numbers(cells.astype(str).str.replace(",", "."), where) * 86400.0).round()
    stamps = pd.DatetimeIndex(pd.to_datetime(seconds, unit="s", origin=_EXCEL))
    return stamps, [f"stamps such as {cell(cells.iloc[0])} are days since 1900, as Excel counts them"]


def _numbers(cells: pd.Series, where: str) -> pd.Series:
    numbers = pd.to_numeric(cells, errors="coerce")
    known = numbers.notna().to_numpy()
    if not known.all():
        row = int(np.argmax(~known))
        raise ValueError(f"row {line(cells.index[row])} of {where}: the stamp {cell(cells.iloc[row])} is not a number.")
    return numbers
