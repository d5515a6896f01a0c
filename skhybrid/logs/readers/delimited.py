"""Reader of text tables with any separator, decimal sign, encoding and header."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ..assembly import Choice, Pieces, rows_of_piece
from ..cell_numbers import decimal_sign
from ..raw_log import RawLog
from ..stamp_cells import find_stamp_columns, is_stamp, is_stamp_name
from ..table_layout import Layout, find_layout, layout_in, separator_of, split_lines, table_of
from ..table_shapes import assemble_table
from ..text_files import damage_refused, encoding_of, head_of, open_bytes

_HEAD = 1 << 16  # characters that show the layout


class TextTable(NamedTuple):
    """A text table whose layout is known, and the first rows of it."""

    path: Path
    encoding: str
    sep: str
    decimal: str
    layout: Layout
    sample: pd.DataFrame

    def pieces(self, stamps: Sequence[str], columns: Sequence[str], text: Sequence[str] = ()) -> Iterator[pd.DataFrame]:
        """The rows of some columns, piece by piece; the stamps and the columns of ``text`` remain text."""
        read = [j for j, name in enumerate(self.layout.names) if name in {*stamps, *columns}]
        options: dict[str, Any] = {
            "sep": self.sep if self.sep != " " else r"\s+",
            "decimal": self.decimal,
            "encoding": self.encoding,
            "encoding_errors": "replace",
            "header": None,
            "names": list(self.layout.names),
            # with None, pandas refuses rows that are too wide
            "usecols": read if len(read) < len(self.layout.names) else None,
            "dtype": dict.fromkeys([*stamps, *text], str),
            "skiprows": self.layout.first,
            "skipinitialspace": True,
            "skip_blank_lines": False,  # they count in the lines that messages name
            "index_col": False,
            "low_memory": False,
            "chunksize": rows_of_piece(len(self.layout.names)),
        }
        where = repr(self.path.name)
        try:
            with damage_refused(where), open_bytes(self.path) as file, pd.read_csv(file, **options) as reader:
                while True:
                    with warnings.catch_warnings():
                        warnings.simplefilter("error", pd.errors.ParserWarning)  # it would leave cells out
                        piece = next(reader, None)
                    if piece is None:
                        return
                    yield piece
        except (pd.errors.ParserError, pd.errors.ParserWarning, IndexError) as error:
            # IndexError where the first row is too wide
            cause = str(error).strip().rpartition("error: ")[2]  # without the words of the parser
            raise ValueError(
                f"{where} cannot be read as CSV ({cause}); correct that line, or name an added column in the header."
            ) from error


def _refuse_shifted(rows: Sequence[Sequence[str]], layout: Layout, where: str) -> None:
    """Refuse names that lie one column to the right of their cells, as the name of the stamps shows."""
    stamps = [is_stamp(cell) for cell in rows[layout.first]]
    for (name, following), (here, after) in zip(pairwise(layout.names), pairwise(stamps), strict=False):
        if here and not after and not is_stamp_name(name) and is_stamp_name(following):
            raise ValueError(
                f"{where} names the column after its time stamps {following!r}, as where a header has a name more than "
                "its rows have cells; name every column once."
            )


def _refuse_statistics(sample: pd.DataFrame, where: str) -> None:
    """Refuse a raw table of Home Assistant's statistics of several sensors, whose rows would be mixed."""
    if {"metadata_id", "start_ts", "mean"} <= set(sample) and len(set(sample["metadata_id"])) > 1:
        raise ValueError(
            f"{where} is a table of Home Assistant's statistics, whose column 'metadata_id' numbers the sensors; pass "
            "format='change of value', time_column='start_ts', point_column='metadata_id' and value_column='mean', or "
            "give the database itself."
        )


def looks_like(path: Path, head: str) -> bool:
    """Whether a file is a text table with time stamps."""
    return layout_in(head) is not None


def read(path: Path, *, sep: str | None = None, decimal: str | None = None, **options: Any) -> RawLog:
    """Read a text table with one column per channel; the options beside these are those of ``Choice``."""
    choice = Choice(**options)
    table = open_table(path, sep, decimal)
    where = repr(path.name)
    _refuse_statistics(table.sample, where)
    stamps = find_stamp_columns(table.sample, choice.time_column, where)
    pieces = pieces_of(table, iter(()), stamps, "CSV")

    def rows(wanted: list[str], as_text: bool) -> Iterator[pd.DataFrame]:
        return table.pieces(stamps, wanted, wanted if as_text else ())

    return assemble_table(pieces, table.sample, choice, rows, headless=table.layout.headless)


def pieces_of(table: TextTable, frames: Iterator[pd.DataFrame], stamps: tuple[str, ...], name: str) -> Pieces:
    """Pieces of a text table for the format ``name``."""
    layout = table.layout
    notes = [f"there is no header: the columns are {', '.join(layout.names)}"] if layout.headless else []
    units = {column: unit for column, unit in layout.units.items() if column not in stamps}
    return Pieces(frames, stamps, repr(table.path.name), name, units, table.decimal, layout.first + 1, notes)


def open_table(path: Path, sep: str | None = None, decimal: str | None = None) -> TextTable:
    """Find the layout of a text table in its first rows."""
    where = repr(path.name)
    head = head_of(path, _HEAD)
    if not head.strip():
        raise ValueError(f"{where} is {'empty' if not path.stat().st_size else 'no text file'}.")
    lines = head.splitlines()
    sep = sep or separator_of(lines)
    if sep is None:
        quoted = sum(line.count('"') == 2 and line.startswith('"') for line in lines) > 0.9 * len(lines)
        remedy = "take the quotes around each row away" if quoted else "pass its separator, such as sep=';'"
        raise ValueError(f"{where} has no rows of two or more cells; {remedy}.")
    rows = split_lines(lines, sep)
    layout = find_layout(rows)
    if layout is None and len(rows) == 1:
        raise ValueError(f"{where} has one line only, and no row with a time stamp below it.")
    if layout is None:
        raise ValueError(
            f"{where} has no cell that is a time stamp in its first {len(rows)} lines; write them as 2024-01-31 13:45."
        )
    above = [cell for cell in rows[layout.first - 1] if cell] if layout.headless and layout.first else []
    if len(above) > 1 and sum(map(is_stamp, above)) == 0:
        raise ValueError(
            f"line {layout.first} of {where} names {len(above)} columns, but the rows have {len(layout.names)} cells; "
            "put numbers with a decimal comma in quotes, or pass the separator, such as sep=';'."
        )
    if layout.n_stamps == 1 and 2 * sum(map(is_stamp, rows[layout.first])) > max(len(layout.names), len(rows)):
        raise ValueError(
            f"line {layout.first + 1} of {where} holds all time stamps; exchange rows and columns, so that each row "
            "begins with its own."
        )
    _refuse_shifted(rows, layout, where)
    data = [row for row in rows[layout.first :] if any(row)]
    sign = decimal or decimal_sign([cell for row in data for cell in row], sep)
    return TextTable(path, encoding_of(path) or "utf-8", sep, sign, layout, table_of(data, layout.names))
