"""Reader of Excel workbooks."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile, is_zipfile

import pandas as pd

from ..assembly import Choice, Pieces, assemble_long, columns_beside
from ..cell_numbers import decimal_sign
from ..paired_columns import POINT, STAMP, VALUE, is_value_name
from ..raw_log import RawLog
from ..stamp_cells import find_stamp_columns, is_stamp
from ..table_layout import Layout, find_layout, table_of
from ..table_shapes import assemble_table
from ..unit_names import unit_text
from .change_of_value import long_columns

_HEAD, _PIECE = 200, 20_000  # rows


def looks_like(path: Path, head: str) -> bool:
    """Whether a file is an Excel workbook of the kind that Excel has written since 2007."""
    if head or not is_zipfile(path):
        return False
    try:
        with ZipFile(path) as file:
            return "xl/workbook.xml" in file.namelist()
    except BadZipFile:
        return False


def read(path: Path, *, sheet: str | int | None = None, **options: Any) -> RawLog:
    """Read a sheet of a workbook, by default that with the most stamps, and those that go on from it.

    The options beside ``sheet`` are those of ``Choice``.
    """
    choice = Choice(**options)
    book = _open(path)
    try:
        found = _find_tables(book, sheet, repr(path.name))
        if points := _points_of(found):
            return _read_points(book, found, points, repr(path.name), choice)
        read, layout, where, notes = _one_table(book, found, repr(path.name))
        names = layout.names
        head = list(islice(_rows_of(book, found, read), _HEAD))
        sample = table_of(head, names)
        stamps = find_stamp_columns(sample, choice.time_column, where)
        units = {name: unit for name, unit in layout.units.items() if name not in stamps}
        pieces = Pieces((), stamps, where, "Excel", units, _decimal_of(head), layout.first + 1, notes)

        def rows(wanted: list[str], as_text: bool) -> Iterator[pd.DataFrame]:
            return (piece[wanted] for piece in _pieces(_rows_of(book, found, read), names))

        return assemble_table(pieces, sample, choice, rows, long_columns(names))
    finally:
        book.close()


def _open(path: Path) -> Any:
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise ImportError(
            'reading an Excel file needs openpyxl; install it with pip install "skhybrid[files]".'
        ) from None
    try:
        return load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # openpyxl passes on errors of zip, XML and its own
        raise ValueError(
            f"{path.name!r} cannot be read as an Excel workbook ({error}); save it again as .xlsx."
        ) from None


def _find_tables(book: Any, sheet: str | int | None, file: str) -> dict[str, tuple[Layout, str]]:
    """The layout and the first stamp of the chosen sheet, or of each that holds a table."""
    names = [one.title for one in book.worksheets]
    if isinstance(sheet, int) and 0 <= sheet < len(names):
        sheet = names[sheet]
    if sheet is not None and sheet not in names:
        raise ValueError(f"{file} has no sheet {sheet!r}; its sheets are {', '.join(map(repr, names))}.")
    found: dict[str, tuple[Layout, str]] = {}
    for name in names if sheet is None else [str(sheet)]:
        head = list(islice(_rows(book[name]), _HEAD))
        layout = find_layout(head)
        if layout is not None:
            found[name] = layout, next((cell for cell in head[layout.first] if is_stamp(cell)), "")
    if not found:
        which = f"sheet {sheet!r} of {file}" if sheet else file
        raise ValueError(f"{which} has no table with time stamps in its first {_HEAD} rows.")
    return found


def _points_of(found: Mapping[str, tuple[Layout, str]]) -> dict[str, tuple[str, str]]:
    """The point of each sheet and its column, where each sheet has one beside stamps, units and qualities; else empty.

    A point has the name of its column, or of its sheet where that says nothing.  Sheets with the same column that all
    begin on other days are one log, as those of months.
    """
    names = {sheet: table.names for sheet, (table, _) in found.items() if table.n_stamps > 1}
    values = {sheet: [name for name in own[1:] if name not in columns_beside(own)] for sheet, own in names.items()}
    if len(names) < 2 or any(len(own) != 1 for own in values.values()):
        return {}
    different, days = {own[0] for own in values.values()}, {found[sheet][1].split(" ")[0] for sheet in names}
    if len(different) < len(names) and not (all(map(is_value_name, different)) and len(days) < len(names)):
        return {}
    return {sheet: (sheet if is_value_name(name) else name, name) for sheet, (name,) in values.items()}


def _read_points(
    book: Any, found: Mapping[str, tuple[Layout, str]], points: Mapping[str, tuple[str, str]], file: str, choice: Choice
) -> RawLog:
    """The log of a workbook with a sheet for each point."""
    heads, frames, units = [], [], {}
    for sheet, (point, column) in points.items():
        layout = found[sheet][0]
        rows = islice(_rows(book[sheet]), layout.first, None)
        heads += (head := list(islice(rows, _HEAD)))
        named = {layout.names[0]: STAMP, column: VALUE}
        pieces_of_sheet = _pieces(chain(head, rows), layout.names)
        frames += [piece.rename(columns=named).assign(**{POINT: point}) for piece in pieces_of_sheet]
        if unit := layout.units.get(column) or unit_text(column):
            units[point] = unit
    pieces = Pieces(frames, (STAMP,), file, "Excel", units, _decimal_of(heads), found[next(iter(points))][0].first + 1)
    pieces.notes.append(f"read from sheets {', '.join(map(repr, points))}, one for each point")
    return assemble_long(pieces, POINT, VALUE, choice)


def _one_table(
    book: Any, found: Mapping[str, tuple[Layout, str]], file: str
) -> tuple[list[str], Layout, str, list[str]]:
    """The sheets of the largest table, and of those with the same names and other stamps; layout, name, and notes."""
    names = [one.title for one in book.worksheets]
    best, begin = max(found.values(), key=lambda one: one[0].n_stamps)
    same = {name: one[1] for name, one in found.items() if one[0].names == best.names}
    goes_on = len(set(same.values())) == len(same)  # as one sheet per month; rooms have the same stamps
    read = list(same) if goes_on else [next(name for name in same if same[name] == begin)]
    which = ("sheet " if len(read) == 1 else "sheets ") + ", ".join(map(repr, read))
    notes = [f"read from {which}"] if len(names) > 1 else []
    others = [repr(name) for name, (table, _) in found.items() if name not in read and table.n_stamps > 1]
    if others:
        notes.append(
            f"not read: {', '.join(others)}, which also hold tables; put all columns in one sheet, or choose by sheet ="
        )
    return read, found[read[0]][0], f"{which} of {file}", notes


def _rows_of(book: Any, found: Mapping[str, tuple[Layout, str]], sheets: Sequence[str]) -> Iterator[list[str]]:
    """The rows of data of some sheets, one after the other."""
    return chain.from_iterable(islice(_rows(book[name]), found[name][0].first, None) for name in sheets)


def _rows(sheet: Any) -> Iterator[list[str]]:
    sheet.reset_dimensions()  # some programs write a wrong size
    for row in sheet.iter_rows(values_only=True):
        cells = [_text(cell) for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        yield cells


def _text(cell: Any) -> str:
    """A cell as text; Excel keeps times as fractions of a day, so seconds are rounded."""
    if cell is None:
        return ""
    if isinstance(cell, dt.datetime):
        return str((cell + dt.timedelta(microseconds=500_000)).replace(microsecond=0)).removesuffix(" 00:00:00")
    return str(cell).strip()


def _decimal_of(rows: Sequence[Sequence[str]]) -> str:
    """A comma where numbers are stored as text that has one, and no cell has a point, as numbers have."""
    cells = [cell for row in rows for cell in row]
    return "." if any(re.fullmatch(r"-?\d+\.\d+", cell) for cell in cells) else decimal_sign(cells, ";")


def _pieces(rows: Iterator[list[str]], names: tuple[str, ...]) -> Iterator[pd.DataFrame]:
    while part := list(islice(rows, _PIECE)):
        yield table_of(part, names)
