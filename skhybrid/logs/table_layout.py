"""Layout of a table in a file: its separator, its header, a line of units, and the first row of data."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd

from .stamp_cells import is_stamp, is_stamp_name
from .stamp_numbers import are_serials, elapsed_unit, is_elapsed_name, is_serial
from .stamp_parts import is_year, part_columns
from .unit_names import is_unit, unit_named, unit_or_energy

_RULE = re.compile(r"\s*:?-{3,}:?\s*")  # below the names of a Markdown table
_SEPARATORS = ("\t", ";", "|", ",")
_is_number = re.compile(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?").fullmatch


class Layout(NamedTuple):
    """Layout of a table, as its first rows show it."""

    names: tuple[str, ...]
    units: dict[str, str]  # of a line of units, by name, as they are written
    first: int  # position of the first row of data
    headless: bool
    n_stamps: int  # in the given rows


def split_lines(lines: Sequence[str], sep: str) -> list[list[str]]:
    """The cells of lines, without blanks around them."""
    if sep == " ":  # names may follow a sign of remarks
        lines = [line.strip().removeprefix("#") for line in lines]
    try:
        rows = csv.reader((f"{line}\n" for line in lines), delimiter=sep, skipinitialspace=True)
        cells = ([cell.strip().replace("\n", " ") for cell in row] for row in rows)  # a name may have two lines
        return [["" if _RULE.fullmatch(cell) else cell for cell in row] for row in cells]
    except csv.Error:
        return []


def table_of(rows: Sequence[Sequence[str]], names: Sequence[str]) -> pd.DataFrame:
    """Rows of cells as a table of text; short rows are filled, what is beyond the names is left out."""
    width = len(names)
    return pd.DataFrame([[*row, *[""] * (width - len(row))][:width] for row in rows], columns=list(names), dtype=str)


def separator_of(lines: Sequence[str]) -> str | None:
    """The separator between the cells of most lines; one that sets stamps apart comes first."""
    possible = []
    for sep in _SEPARATORS:
        rows = [row for row in split_lines(lines, sep) if any(row)]
        width, n = usual_width(rows)
        if width > 1 and n >= 0.5 * len(rows):
            possible.append(sep)
            if any(map(is_stamp, rows[-1])) or sum(is_stamp(cell) for row in rows for cell in row) > len(rows) / 2:
                return sep
    if not possible and find_layout(split_lines(lines, " ")) is not None:
        return " "  # of columns in line, as programs of simulation write them
    return possible[0] if possible else None


def layout_in(head: str) -> Layout | None:
    """Layout of the table that a text begins with; None where it is none, or no row holds a time stamp."""
    lines = head.splitlines()
    sep = separator_of(lines)
    return None if sep is None else find_layout(split_lines(lines, sep))


def usual_width(rows: Sequence[Sequence[str]]) -> tuple[int, int]:
    """The most frequent number of cells of a row, and the number of rows that have it."""
    return Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)


def find_layout(rows: Sequence[Sequence[str]]) -> Layout | None:
    """Layout of a table whose first rows are given; None where no row holds a time stamp."""
    width, _ = usual_width([row for row in rows if any(row)])
    places = Counter(j for row in rows if len(row) >= width for j, cell in enumerate(row) if is_stamp(cell))
    if width < 2:
        return None
    if places:
        most = max(places.values())
        place = min(j for j, n in places.items() if n == most)
        long = (i for i, row in enumerate(rows) if len(row) > place and len(row) >= width - 1)
        first = next(i for i in long if is_stamp(rows[i][place]))
    elif (found := _below_names(rows, width)) is not None:
        place, first, most = found
    else:
        return None
    header, units = _header(rows, first, width, place)
    unnamed = place == 0 and len(header) == width - 1 and bool(rows[first][-1]) and not is_stamp_name(header[0])
    names = _names(["time", *header] if unnamed else header, width, place)
    stated = {name: text for name, text in zip(names, units, strict=False) if text and is_unit(text)}
    stated.pop(names[place], None)
    explained = _explained(rows[:first], names)
    lists = (row for row in rows[:first] if len(row) > 2 and is_unit(row[2]))
    stated |= {explained[name]: row[2] for row in lists if (name := row[0].rstrip(":")) in explained}
    return Layout(tuple(explained.get(name, name) for name in names), stated, first, not header, most)


def _explained(above: Sequence[Sequence[str]], names: Sequence[str]) -> dict[str, str]:
    """The names that a list of points above the table gives to its columns, as ``Point_1:,ZONE TEMP``; often none."""
    lists = [row for row in above if len(row) > 1 and row[1] and row[1] not in names]
    found = {row[0].rstrip(":"): row[1] for row in lists if row[0].rstrip(":") in names}
    own = [*found.values(), *(name for name in names if name not in found)]
    return found if len(set(own)) == len(names) and len(found) > 1 else {}


def _below_names(rows: Sequence[Sequence[str]], width: int) -> tuple[int, int, int] | None:
    """Place, first row and number of stamps whose cells alone do not show that they are: only their names do.

    These are years beside months and days, days since 1900 as Excel counts them, and the time of a simulation.
    """
    for i, row in enumerate(rows[:-1]):
        parts = part_columns(row) if len(row) >= width - 1 else ()
        places = [row.index(parts[0])] if parts else [j for j, cell in enumerate(row) if is_stamp_name(cell)]
        for place in places:
            below = [row[place] for row in rows[i + 1 :] if len(row) > place]
            numbers = [one for one in below if _is_number(one)]
            elapsed = not parts and is_elapsed_name(row[place]) and elapsed_unit(numbers, row[place])
            fits = is_year if parts else _is_number if elapsed else is_serial
            at = [k for k in range(i + 1, len(rows)) if len(rows[k]) > place and fits(rows[k][place])]
            if 2 * len(at) > len(rows) - i and (parts or elapsed or are_serials([rows[k][place] for k in at])):
                return place, at[0], len(at)
    return None


def _header(rows: Sequence[Sequence[str]], first: int, width: int, place: int) -> tuple[list[str], list[str]]:
    """The names above the first row of data, and the units between them and it, or right above the names."""
    units: list[str] = []
    for i in range(first - 1, -1, -1):
        row = list(rows[i])
        rest = [cell for j, cell in enumerate(row) if cell and j != place]
        if not any(row) or (i and _lacks_stamp(row, rows[i - 1], place)):
            continue
        if _are_units(row, place):
            # below the units there may be a line of "Avg", "Max"
            units = row if sum(unit_named(cell) is not None for cell in row) or not units else units
            continue
        if len(row) >= width - 1 and len(rest) >= 0.4 * (width - 1):
            above = list(rows[i - 1]) if i else []
            if not units and len(above) >= width - 1 and _are_units(above, place):
                units, above = above, []
            return _grouped(row, above, place), _beside_stamps(units, width, place)
        break
    return units if len(units) >= width - 1 else [], []  # a channel may be called "kW"


def _lacks_stamp(row: Sequence[str], above: Sequence[str], place: int) -> bool:
    """Whether a row right below the names is one of numbers, whose stamp is empty."""
    rest = [cell for cell in row if cell]
    named = len(row) == len(above) and is_stamp_name(above[place])
    return named and not row[place] and all(map(_is_number, rest))


def _are_units(row: Sequence[str], place: int) -> bool:
    """Whether most cells of a line that are not blank are units, that of the stamps aside."""
    rest = [cell for j, cell in enumerate(row) if cell and j != place]
    return sum(map(is_unit, rest)) > 0.5 * len(rest)


def _beside_stamps(units: list[str], width: int, place: int) -> list[str]:
    """The units with a cell for the time stamps, at ``place``, where the line has a unit there and ends early."""
    own = unit_or_energy(units[place]) if len(units) > place else None
    return [*units[:place], "", *units[place:]] if own not in (None, "-") and not any(units[width - 1 :]) else units


def _grouped(header: list[str], above: Sequence[str], place: int) -> list[str]:
    """The names after those of their groups, such as rooms in merged cells above them.

    They are joined if names occur twice or some are units; a line with units may have empty cells below names.
    """
    named = [cell for j, cell in enumerate(header) if cell and j != place]
    groups = [cell for j, cell in enumerate(above) if cell and j != place]
    alone = len(set(named)) == len(named) and not any(map(unit_or_energy, named))
    if alone or len(groups) < 2 or len(above) < 0.5 * len(header):
        return header
    out, group = [], ""
    for j, cell in enumerate(header):
        own = above[j] if j < len(above) else ""
        group = own or group
        out.append(cell if j == place else f"{group} {cell}".strip() if cell else own)
    return out


def _names(header: Sequence[str], width: int, place: int) -> tuple[str, ...]:
    """One name per column: the header's, numbered where it is empty or has a name twice."""
    header = [*header, *[""] * (width - len(header))]
    header[0] = header[0].lstrip("# ")
    names: list[str] = []
    for j, cell in enumerate(header):
        name = cell.strip() or ("time" if j == place and "time" not in header else f"column {j + 1}")
        again = 2
        while name in names:
            name, again = f"{cell.strip()} ({again})", again + 1
        names.append(name)
    return tuple(names)
