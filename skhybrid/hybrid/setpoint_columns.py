"""Set-points that come as columns of a table, and the usual temperature in their place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from .._calendar import day_type_hour
from .._table import SETPOINT_ROLES, ZoneTable
from .._warnings import several
from ..control import FREE, Band, refuse_where
from ..forecasting.baselines import means_by_hour


def band_of(table: ZoneTable) -> Band:
    """The set-points (n_rows,) of a table; infinite where a side has none."""
    sides = zip(map(table.measured, SETPOINT_ROLES), FREE, strict=True)
    return Band(*(np.where(np.isfinite(side), side, free) for side, free in sides))


def with_band(table: ZoneTable, band: Band) -> ZoneTable:
    """The table with these set-points in its last rows, NaN where a side has none."""
    first = table.n_rows - len(band.heating)
    whole = (np.append(known[:first], side) for known, side in zip(band_of(table), band, strict=True))
    given = {role: np.where(np.isfinite(side), side, np.nan) for role, side in zip(SETPOINT_ROLES, whole, strict=True)}
    return table.replace(history={**table.history, **given})


class UsualTemperature(NamedTuple):
    """The mean temperature by hour and kind of day, of a zone whose set-points are not logged but whose plant runs."""

    by_hour: np.ndarray  # (48,) [degC]

    @classmethod
    def of(cls, training: ZoneTable) -> Self:
        """That of the measured temperature of a training."""
        return cls(means_by_hour(training, training.history["T_za"]))

    def held(self, table: ZoneTable) -> ZoneTable:
        """The table with it as set-points of heating and cooling, whatever set-points it has."""
        usual = self.by_hour[day_type_hour(table)]
        return with_band(table, Band(usual, usual))


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
