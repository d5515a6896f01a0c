"""Set-points that come as columns of a table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._table import SETPOINT_ROLES, ZoneTable
from .._warnings import several
from ..control import FREE, Band, refuse_where


def band_of(table: ZoneTable) -> Band:
    """The set-points (n_rows,) of a table; infinite where a side has none."""
    sides = (
        np.where(np.isfinite(table.history[role]), table.history[role], free)
        if role in table.history
        else np.full(table.n_rows, free)
        for role, free in zip(SETPOINT_ROLES, FREE, strict=True)
    )
    return Band(*sides)


def with_band(table: ZoneTable, band: Band) -> ZoneTable:
    """The table with these set-points in its last rows, NaN where a side has none."""
    first = table.n_rows - len(band.heating)
    whole = (np.append(known[:first], side) for known, side in zip(band_of(table), band, strict=True))
    given = {role: np.where(np.isfinite(side), side, np.nan) for role, side in zip(SETPOINT_ROLES, whole, strict=True)}
    return table.replace(history={**table.history, **given})


def setpoints_in(table: ZoneTable) -> dict[str, np.ndarray]:
    """The columns of a table that hold set-points."""
    return {role: table.history[role] for role in SETPOINT_ROLES if role in table.history}


def check_setpoints(table: ZoneTable, column_of: Callable[[str], Any]) -> None:
    """Refuse set-points that are missing in some rows, or of which the heating one is above the cooling one."""
    given = setpoints_in(table)
    for role, values in given.items():
        missing = np.isnan(values)
        what = f"{column_of(role)} is missing in {several(int(missing.sum()), 'row')}"
        refuse_where(missing, table, what, "fill in the set-point that was in force, or leave the column out")
    if len(given) == len(SETPOINT_ROLES):
        heating, cooling = given.values()
        what = " is above ".join(str(column_of(role)) for role in given)
        refuse_where(heating > cooling, table, what, "swap or mend them")
