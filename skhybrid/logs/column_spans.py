"""Columns that end, or begin, long before or after the others of a log."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from .._table import is_plant

_LOST, _LOST_ROOM = pd.Timedelta("1D"), pd.Timedelta("4D")  # weather may come later, and heat be planned ahead


def lost_columns(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Roles that end or begin days from the temperatures of rooms, or these from plants, and a sentence on each.

    Rows ahead have weather, set-points and perhaps heat, but no temperature of a room.
    """
    known = _known_stamps(frame)
    rooms = [role for role in known if role == "T_za" or role.startswith("T_za_")]
    for role, rows in known.items():
        others = [one for one in known if one != role and (one in rooms or (role in rooms and is_plant(one)))]
        if not others:
            continue
        longest = max(others, key=lambda one: known[one][-1])
        first = min(others, key=lambda one: known[one][0])
        if rows[-1] + (_LOST_ROOM if role in rooms else _LOST) < known[longest][-1]:
            text = f"has no value after {rows[-1]}, but {longest} goes on to {known[longest][-1]}"
            yield role, f"{text}: was the column lost, or is it under another name there?"
        elif known[first][0] + _LOST < rows[0]:
            text = f"has no value before {rows[0]}, but {first} begins at {known[first][0]}"
            yield role, f"{text}: is it under another name there?"


def one_after_the_other(frame: pd.DataFrame) -> str | None:
    """A sentence on a column that ends before another one begins, so that no row has both; None where none does."""
    known = _known_stamps(frame)
    if not known:
        return None
    begins, ends = ({name: rows[at] for name, rows in known.items()} for at in (0, -1))
    first, last = min(ends, key=ends.__getitem__), max(begins, key=begins.__getitem__)
    end, begin = ends[first], begins[last]
    if end >= begin:
        return None
    what = f"{first} ends at {end} and {last} begins at {begin}, so that no row has both"
    return f"{what}: is this one room under two names? Join their columns, or leave one of them out."


def _known_stamps(frame: pd.DataFrame) -> dict[str, pd.DatetimeIndex]:
    """The stamps at which each column has a value; columns without any are left out."""
    return {str(c): pd.DatetimeIndex(frame.index[frame[c].notna()]) for c in frame if frame[c].notna().any()}
