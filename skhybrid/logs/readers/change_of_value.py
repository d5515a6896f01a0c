"""Reader of long tables: one row per value of a point, as logs of changes have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ..._table import listed
from ..assembly import Choice, assemble_long, columns_beside
from ..paired_columns import is_value_name
from ..raw_log import RawLog
from ..stamp_cells import find_stamp_columns
from ..table_layout import layout_in
from .delimited import open_table, pieces_of

_POINT = re.compile(
    r"(data)?point[ _]?(name|id)?|tag[ _]?(name|id)?|sensor[ _]?(name|id)?|channel([ _]name)?|variable|entity_id|"
    r"metric|series|name|object[ _]?(name|id)?|signal|register|datenpunkt|parameter|_field|statistic_id",
    re.IGNORECASE,
)
#: names of the column of points where none has one of those above, which may be beside them
_OF_POINTS = re.compile(
    r"item([ _]?name)?|topic|device([ _]?name)?|key|kanal|trend([ _]?(log|name|point))?|description|beschreibung|"
    r"attribute|quantity|(group[ _]?)?address|property|location",
    re.IGNORECASE,
)


def looks_like(path: Path, head: str) -> bool:
    """Whether a text table has one row per value, with its point beside it."""
    layout = layout_in(head)
    return layout is not None and long_columns(layout.names) is not None


def read(
    path: Path,
    *,
    point_column: str | None = None,
    value_column: str | None = None,
    sep: str | None = None,
    decimal: str | None = None,
    **options: Any,
) -> RawLog:
    """Read a long text table into one column per point; the options beside these are those of ``Choice``."""
    choice = Choice(**options)
    table = open_table(path, sep, decimal)
    where = repr(path.name)
    point, value = chosen_columns(table.layout.names, point_column, value_column, where)
    others = table.sample.drop(columns=[point, value])
    stamps = find_stamp_columns(others, choice.time_column, where)
    text = (point, value, *columns_beside(others))
    frames = table.pieces(stamps, text, text)
    return assemble_long(pieces_of(table, frames, stamps, "change of value"), point, value, choice)


def chosen_columns(names: Sequence[str], point: str | None, value: str | None, where: str) -> tuple[str, str]:
    """The columns of points and values: those named, else those with usual names."""
    both = []
    for kind, given, usual in zip(("point", "value"), (point, value), _usual_columns(names), strict=True):
        name = given or usual
        if name is None or name not in names:
            said = f"has no column {name!r}" if name else f"has no column that is surely the {kind}"
            raise ValueError(f"{where} {said} among {listed(names)}; pass {kind}_column=.")
        both.append(name)
    return both[0], both[1]


def point_and_value(names: Sequence[str], point: str | None, value: str | None, where: str) -> tuple[str, str] | None:
    """The columns of points and values of a table that is long by its names, or by those given; None for another."""
    return chosen_columns(names, point, value, where) if point or value else long_columns(names)


def long_columns(names: Sequence[str] | pd.Index) -> tuple[str, str] | None:
    """The columns of points and values of a long table, by their usual names; None where it has none."""
    point, value = _usual_columns(names)
    return (point, value) if point and value else None


def _usual_columns(names: Sequence[str] | pd.Index) -> tuple[str | None, str | None]:
    """The column with a usual name of points, and the only one with such a name of values; None where there is none."""
    points = [name for usual in (_POINT, _OF_POINTS) for name in names if usual.fullmatch(name.strip())]
    values = [name for name in names if is_value_name(name)]
    return points[0] if points else None, values[0] if len(values) == 1 else None
