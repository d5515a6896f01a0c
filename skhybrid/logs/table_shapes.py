"""The log of a table of any shape: a column per channel, a row per value, or a row for each zone and stamp."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import pandas as pd

from .._table import listed
from . import rows_by_zone
from .assembly import Choice, Pieces, assemble, assemble_long, columns_beside
from .paired_columns import POINT, VALUE, as_long, is_value_name, paired_columns
from .raw_log import RawLog

SAMPLE = 1000  # first rows of a table, by which readers tell its shape
#: gives the rows of some columns piece by piece, anew at each call; as text where it is told so and may choose
Read = Callable[[list[str], bool], Iterable[pd.DataFrame]]


def assemble_table(
    pieces: Pieces,
    sample: pd.DataFrame,
    choice: Choice,
    read: Read,
    long: tuple[str, str] | None = None,
    headless: bool = False,
) -> RawLog:
    """The log of a table whose first rows are given; ``long`` are its columns of points and values, if any."""
    names, stamps = list(map(str, sample.columns)), pieces.stamps
    if long is not None:
        pieces.frames = read([*stamps, *long, *columns_beside(names)], True)
        return assemble_long(pieces, *long, choice)
    if blocks := paired_columns(sample, stamps):
        wanted = choice.wanted(names, tuple(blocks), pieces.where)
        named = listed(name for channels in list(blocks.values())[:2] for name in channels)
        pieces.notes.append(f"{len(blocks)} columns of stamps: each column, such as {named}, has those before it")
        pieces.frames = as_long(read([*blocks, *wanted], True), blocks)
        return assemble_long(pieces, POINT, VALUE, choice)
    if zone := _zone_column(sample, stamps, read):
        return _by_zone(pieces, [name for name in names if name not in stamps], zone, choice, read, headless)
    pieces.frames = read([*stamps, *choice.wanted(names, stamps, pieces.where)], False)
    return assemble(pieces, choice)


def _by_zone(pieces: Pieces, names: Sequence[str], zone: str, choice: Choice, read: Read, headless: bool) -> RawLog:
    """The log of a table with a row for each zone and stamp; one column of values needs no name beside that."""
    stamps, values = pieces.stamps, [name for name in names if name != zone and (headless or is_value_name(name))]
    pieces.notes.append(f"a row for each {zone!r} and stamp: read as a column for each quantity and {zone!r}")
    if len(values) == 1:
        pieces.frames = read([*stamps, zone, *values, *columns_beside(names)], True)
        return assemble_long(pieces, zone, values[0], choice)
    pieces.frames = rows_by_zone.long_of_zones(read([*stamps, *names], True), stamps, zone, pieces.units)
    return assemble_long(pieces, POINT, VALUE, choice)


def _zone_column(sample: pd.DataFrame, stamps: Sequence[str], read: Read) -> str | None:
    """The column that names the zone of each row, if any; where zones follow one another, all rows tell."""
    among, n_columns = rows_by_zone.may_name_zones(sample, stamps), sample.shape[1]
    found = rows_by_zone.zone_column(sample, stamps, among, n_columns)
    alike = [name for name in among if (sample[name] != sample[name].shift()).sum() == sample[name].nunique()]
    if found or not alike:
        return found
    return rows_by_zone.zone_column(pd.concat(read([*stamps, *alike], True)), stamps, alike, n_columns)
