"""Cells of a CSV file whose columns are defined by its format, as text and as numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ..._last_known import up_to_last_known
from ..._table import listed
from ..stamps import YEARS, cell, in_zone, parse_stamps, refuse_blank_stamps
from ..text_files import damage_refused, open_text

_NO_VALUE = ("", "-", "nan", "null", "none", "n/a", "na", "unavailable", "unknown")


def read_text_cells(source: Path | io.StringIO, where: str) -> pd.DataFrame:
    """Every cell as text, '' where it is empty; the index counts the lines from 1."""
    names: list[str] = []
    rows, lines = [], []
    try:
        with damage_refused(where), open_text(source) if isinstance(source, Path) else source as stream:
            reader = csv.reader(stream, skipinitialspace=True)
            names = [name.strip() for name in next(reader, [])]
            for row in reader:
                if any(row) and [name.strip() for name in row] != names:  # no header again
                    rows.append(_fitted(row, len(names), reader.line_num, where))
                    lines.append(reader.line_num)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{where} cannot be read as CSV in UTF-8 ({str(error).strip()}); export it again.") from error
    if not names:
        raise ValueError(f"{where} is empty; export it again.")
    if not rows:
        raise ValueError(f"{where} has a header but no rows.")
    table = pd.DataFrame(rows, columns=names, index=pd.Index(lines), dtype=str)
    return table.loc[:, ~table.columns.duplicated() & (table.columns != "")]


def _fitted(row: list[str], n: int, line: int, where: str) -> list[str]:
    """A row with as many cells as the header; rows of some exports end with a comma that the header lacks."""
    if len(row) < n and any(row[2:]):
        raise ValueError(
            f"line {line} of {where} has {len(row)} cells, but the header has {n}; the file may be cut off there: "
            "export it again."
        )
    if any(row[n:]):
        raise ValueError(f"line {line} of {where} has {len(row)} cells, but the header has {n}; export it again.")
    return row[:n] + [""] * (n - len(row))


def header_names(head: str) -> list[str]:
    """The names in the first line of a CSV file with commas."""
    return [name.strip().strip('"') for name in head.partition("\n")[0].split(",")]


def numbers_in(text: pd.Series, words: Mapping[str, float]) -> np.ndarray:
    """Numbers (n,) that texts without blanks around them spell, or that words stand for; NaN for any other."""
    numbers = pd.to_numeric(text, errors="coerce").to_numpy(np.float64, copy=True)
    left = np.isnan(numbers)
    numbers[left] = text[left].str.lower().map(words).to_numpy(np.float64)
    return numbers


def to_numbers(cells: pd.Series, what: str, where: str, words: Mapping[str, float] | None = None) -> np.ndarray:
    """Cells as float64, NaN where nothing was logged; what is neither a number nor one of the words is refused."""
    text = cells.astype(str).str.strip()
    numbers = numbers_in(text, words or {})
    wrong = np.isnan(numbers) & ~text.str.lower().isin(_NO_VALUE).to_numpy()
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"line {cells.index[row]} of {where}, {what}: {cell(cells.iloc[row])} is not a number; the file may be cut "
            "off there: export it again."
        )
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def numeric_columns(table: pd.DataFrame, known: Iterable[str], where: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of numbers, and the names of those with other text; a ``known`` column must have none."""
    must, found, text = set(known), {}, []
    for name in map(str, table):
        try:
            numbers = to_numbers(table[name], f"column {name!r}", where)
            if name in must or np.isfinite(numbers).any():
                found[name] = numbers
        except ValueError:
            if name in must:
                raise
            text.append(name)
    return found, text


def stamps_of(cells: pd.Series, timezone: str | None, dayfirst: bool | None, where: str) -> pd.DatetimeIndex:
    """Stamps of cells whose index counts the lines of the file."""
    rows = cells.set_axis(cells.index - 2)  # rows are counted after a header
    refuse_blank_stamps(rows, where)
    return in_zone(parse_stamps(rows, dayfirst, where), timezone, rows, where)


def utc_ticks(cells: pd.Series, where: str) -> np.ndarray:
    """Stamps of RFC 3339 in nanoseconds since 1970; the index counts the lines of the file."""
    stamps = pd.to_datetime(cells, errors="coerce", utc=True, format="ISO8601")
    # a date alone has been cut off
    wrong = (~stamps.dt.year.between(*YEARS) | ~cells.str.contains(":")).to_numpy()
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"line {cells.index[row]} of {where}: {cell(cells.iloc[row])} is not a time stamp; the file may be cut off "
            "there: export it again."
        )
    return stamps.dt.as_unit("ns").astype("int64").to_numpy()


def refuse_absent(names: Iterable[str], table: pd.DataFrame, where: str, remedy: str) -> None:
    """Refuse a table without one of the columns that its format must have."""
    for name in names:
        if name not in table:
            raise ValueError(f"{where} has no column {name!r}, only {listed(table)}; {remedy}.")


def sorted_frame(columns: dict[str, np.ndarray], stamps: pd.DatetimeIndex, where: str) -> pd.DataFrame:
    """A frame with increasing stamps; rows without any value at its end are dropped."""
    frame = pd.DataFrame(columns, index=stamps.rename("time"), dtype=np.float64).sort_index(kind="stable")
    frame = up_to_last_known(frame, list(columns))
    if frame.empty:
        raise ValueError(f"{where} has no row with a number.")
    return frame
