"""History and rows ahead of a forecast: joined to one table, with what is measured now."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ._arguments import is_number
from ._clock import in_time_zone, refuse_one_zone
from ._ranges import check_range
from ._table import SETPOINT_ROLES, ZoneTable, concatenate_tables
from ._time import spell
from ._warnings import warn_user
from .exceptions import MeasurementWarning

_HISTORY_ENDS, LAST_KNOWN = "history ends at", "the last known row is"  # after which other rows must begin


def in_zone_of(future: pd.Index, history: pd.Index, names: tuple[str, str] = ("history", "future")) -> pd.Index:
    """The stamps of ``future`` in the time zone of ``history``; refused where only one of the two has a zone."""
    if not isinstance(future, pd.DatetimeIndex) or not isinstance(history, pd.DatetimeIndex):
        return future
    refuse_one_zone(history, future, names)
    return in_time_zone(future, history.tz)


def join_frames(history: pd.DataFrame, future: pd.DataFrame, names: Sequence[Any], *pasts: Any) -> pd.DataFrame:
    """History and future as one frame of the columns ``names`` and ``pasts``, which are missing in the future."""
    stamps = in_zone_of(future.index, history.index)
    _refuse_apart(history.index, stamps)
    refuse_absent_ahead([name for name in names if name in history.columns], future, "history")
    whole = pd.concat([history, future.reindex(columns=history.columns).set_axis(stamps)])
    for past in [name for name in pasts if name in whole]:
        whole[past] = whole[past].where(np.arange(len(whole)) < len(history))
    return whole


def join_tables(history: ZoneTable, future: ZoneTable, training: ZoneTable) -> ZoneTable:
    """History and future, which must follow it, as one table in which nothing of the future is measured."""
    refuse_unless_following(future, history)
    return concatenate_tables([history, unmeasured(future, training)])


def _refuse_apart(history: pd.Index, future: pd.Index) -> None:
    """Raise a ValueError if stamps of one step do not go on from history to future, or only one of them has stamps."""
    dated = [isinstance(index, pd.DatetimeIndex) for index in (history, future)]
    if any(dated) and not all(dated):
        raise ValueError(f"{'future' if dated[0] else 'history'} has no time stamps; give it a DatetimeIndex.")
    steps = {index[-1] - index[-2] for index in (history, future) if all(dated) and len(index) > 1}
    if len(steps) == 1 and (step := steps.pop()) > pd.Timedelta(0) and future[0] != history[-1] + step:
        raise _not_adjacent(future, history, step, "future", _HISTORY_ENDS)


def _not_adjacent(ahead: pd.Index, known: pd.Index, step: pd.Timedelta, name: str, last: str) -> ValueError:
    how = ""
    if not isinstance(ahead, pd.DatetimeIndex):
        how = ", with time stamps"
    elif last == LAST_KNOWN and ahead[0] > known[-1]:
        how = ": give update the rows between first, after an outage those of skhybrid.datasets.regularize"
    return ValueError(
        f"{name} begins at {ahead[0]}, but {last} {known[-1]}; it must begin one step of {spell(step)} later{how}."
    )


def refuse_unmeasured(history: ZoneTable, roles: Sequence[str], column_of: Callable[[str], Any]) -> None:
    """Raise a ValueError if a history lacks what is measured, the columns of some ``roles``."""
    if absent := [column_of(role) for role in roles if role not in history.history]:
        raise ValueError(f"history has no column {absent[0]!r}; give what was measured, NaN where nothing was.")


def refuse_unless_following(
    ahead: ZoneTable, known: ZoneTable, name: str = "future", last: str = _HISTORY_ENDS
) -> None:
    """Raise a ValueError if rows, the argument ``name``, do not begin one step after the known ones."""
    if not ahead.follows(known):
        raise _not_adjacent(ahead.index, known.index, known.step, name, last)


def warn_if_unmeasured(table: ZoneTable, roles: Iterable[str], column_of: Callable[[str], Any]) -> None:
    """Warn where nothing is measured of some ``roles`` in a table before which no row is known."""
    for role in roles:
        if np.isnan(table.history.get(role, np.zeros(1))).all():
            warn_user(
                f"{column_of(role)} is missing in all rows, which do not follow the last known one: the forecast "
                "begins at the mean of the training; give what was measured.",
                MeasurementWarning,
            )


def refuse_absent_ahead(names: Sequence[Any], future: pd.DataFrame, where: str) -> None:
    """Raise a ValueError if the future lacks one of the columns ``names``."""
    absent = [name for name in names if name not in future.columns]
    if absent:
        raise ValueError(f"future has no column {absent[0]!r}, which {where} has.")


def unmeasured(future: ZoneTable, training: ZoneTable) -> ZoneTable:
    """The rows to forecast, of which nothing is measured; refused where an input of the training table is missing."""
    absent = [role for role in training.inputs if role not in future.inputs]
    if absent:
        raise ValueError(f"future has no role {absent[0]!r}, which the training table has.")
    return future.replace(history={k: v for k, v in future.history.items() if k in SETPOINT_ROLES})


def read_now(T_za: Any, index: pd.Index) -> float:
    """The temperature that is measured now [degC], at the first of some rows ahead."""
    if not is_number(T_za):
        given = repr(T_za) if np.ndim(T_za) == 0 else f"({type(T_za).__name__})"
        raise ValueError(
            f"T_za={given} is not a number; give the temperature [degC] measured at {index[0]}, or leave it out where "
            "there is none."
        )
    value = float(T_za)
    check_range(np.array([value]), "T_za", "T_za", index[:1])
    return value


def refuse_no_frames(history: Any, future: Any) -> None:
    """Refuse a history or rows ahead that are not tables, or have no rows."""
    for name, rows in (("history", history), ("future", future)):
        if not isinstance(rows, pd.DataFrame | ZoneTable) and (name == "future" or rows is not None):
            raise ValueError(f"{name} is a {type(rows).__name__}; give a pandas DataFrame with time stamps.")
    if (history is not None and not len(history.index)) or not len(future.index):
        raise ValueError("history and future need at least one row each.")


def with_measured(table: ZoneTable, row: int, T: float, role: str = "T_za") -> ZoneTable:
    """A table in which the temperature of one row is measured."""
    values = table.measured(role).copy()
    values[row] = T
    return table.replace(history={**table.history, role: values})


def from_first_measured(table: ZoneTable, target: np.ndarray, multiple: int = 1) -> tuple[ZoneTable, np.ndarray]:
    """A training table and its target (n,) or (n, o) from the first measured row on.

    Rows before it tell a model nothing, but it would have to guess a state or a disturbance for them.  A ``multiple``
    of rows is left out, and every segment keeps at least two.
    """
    measured = np.isfinite(target).reshape(table.n_rows, -1).any(axis=1)
    first = int(np.argmax(measured)) // multiple * multiple
    if first + 1 in (*table.breaks, table.n_rows):
        first -= multiple
    if first <= 0:
        return table, target
    breaks = (0, *(row - first for row in table.breaks if row > first))
    return table.rows(slice(first, None)).replace(breaks=breaks), target[first:]
