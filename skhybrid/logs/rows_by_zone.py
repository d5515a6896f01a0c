"""Tables with a row for each zone and stamp, which a column names, and a column for each quantity."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pandas as pd
from pandas.api.types import is_hashable

from .cell_numbers import NumberColumn
from .naming import guess_role, unit_in_name
from .paired_columns import POINT, VALUE, number_rows

_OFTEN = 0.5  # share of the rows, from which on stamps occur again by design
_FEW_ROWS = 2  # of each zone, at least
_IN_TURN = 0.3  # share of the rows from which on another zone than the row before is the rule
_RARELY = 0.01  # share of the rows up to which a zone may have a stamp again, as in autumn
#: names of columns that tell zones apart, also by numbers
_ZONE = re.compile(
    r"(zone|room|raum|zimmer|kamer|ruimte|piece|pièce|stanza|habitaci[oó]n|thermostat|device|sensor)"
    r"([ _-]?(id|name|no|nr|number))?",
    re.IGNORECASE,
)


def may_name_zones(sample: pd.DataFrame, stamps: Sequence[str]) -> list[str]:
    """The columns beside some of time stamps that hold words, or the numbers of zones; a list or mapping is no word."""
    rest = [name for name in map(str, sample.columns.drop(list(stamps))) if sample[name].map(is_hashable).all()]
    return [name for name in rest if _ZONE.fullmatch(name) or _are_words(sample[name])]


def zone_column(rows: pd.DataFrame, stamps: Sequence[str], among: Iterable[str], n_columns: int) -> str | None:
    """The column that tells rows of several zones apart, ``among`` some of a table of ``n_columns``; None for none.

    Most stamps must have several rows, or words stand in a column that is named after zones and change from row to row,
    where those of a state would last.
    """
    often = rows.duplicated(list(stamps), keep=False).mean() > _OFTEN
    for name in among if n_columns > len(stamps) + 1 else ():
        known = rows[_is_filled(rows[name])]
        n_zones, again = known[name].nunique(), known.duplicated([*stamps, name]).mean()
        in_turn = n_zones > 1 and (known[name] != known[name].shift()).mean() > _IN_TURN
        by_name = in_turn and _ZONE.fullmatch(name) is not None and _are_words(known[name])
        if (often or by_name) and again < _RARELY and _FEW_ROWS * n_zones <= len(known):
            return name
    return None


def long_of_zones(
    frames: Iterable[pd.DataFrame], stamps: Sequence[str], zone: str, units: dict[str, str]
) -> Iterator[pd.DataFrame]:
    """The values of each piece one below the other, each named after its zone and column; weather has no zone.

    Names of points get the ``units`` of their columns.
    """
    found = _ZONE.fullmatch(zone)
    number = rf"{found[1] if found else zone} \g<0>"
    for rows in number_rows(frames):
        piece = rows[_is_filled(rows[zone])]
        zones = piece[zone].astype(str).str.strip().str.replace(r"^\d+$", number, regex=True)
        parts = []
        for name in map(str, piece.columns.drop([*stamps, zone])):
            of_weather = guess_role(name, unit_in_name(name)).role in ("T_oa", "q_sol")
            points = name if of_weather else zones + " " + name
            parts.append(piece[list(stamps)].assign(**{POINT: points, VALUE: piece[name]}))
            units.update(dict.fromkeys(parts[-1][POINT].unique(), units[name]) if name in units else {})
        cells = pd.concat(parts)  # with the numbers of their rows
        yield cells[_is_filled(cells[VALUE])]


def _is_filled(cells: pd.Series) -> np.ndarray:
    """(n,) bool, cells that are not empty."""
    return (cells.notna() & (cells != "")).to_numpy()


def _are_words(cells: pd.Series) -> bool:
    """Whether the cells of a column are words, and not on and off, those of a mode, or the halves of a day."""
    column = NumberColumn()
    column.add(cells, ".")
    halves = cells.astype(str).str.fullmatch(r"\s*[AaPp]\.?[Mm]\.?\s*").any()
    return column.is_text and not halves and not column.channels(str(cells.name))
