"""Set-points and limits by row: a temperature, a band of two set-points, what a plant can do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._ranges import check_range
from .._table import ZoneTable, as_numbers, numeric
from .._time import refuse_other_stamps

#: lower and upper end where there is none: of set-points [degC], and of the heat of a plant [kW]
FREE = (-np.inf, np.inf)


class Band(NamedTuple):
    """Band in which the temperature is kept at the end of every row's step; one temperature where both are equal."""

    heating: np.ndarray  # (N,) lowest [degC]; -inf where it is not held
    cooling: np.ndarray  # (N,) highest [degC]; inf where it is not held

    def rows(self, chosen: slice | np.ndarray) -> Band:
        """The band of some of the rows."""
        return Band(*(side[chosen] for side in self))

    def moved(self, n_rows: int) -> Band:
        """The band of a table that begins so many rows earlier, where nothing is held; later where negative."""
        if n_rows < 0:
            return self.rows(slice(-n_rows, None))
        return Band(*(np.append(np.full(n_rows, free), side) for side, free in zip(self, FREE, strict=True)))


class Limits(NamedTuple):
    """Least and most heat of a plant over every row's step."""

    lower: np.ndarray  # (N,) [kW], cooling negative; -inf where nothing is known
    upper: np.ndarray  # (N,) [kW]

    @classmethod
    def constant(cls, lowest: float, highest: float, n_rows: int) -> Limits:
        """The same limits in all rows."""
        return cls(np.full(n_rows, lowest), np.full(n_rows, highest))

    def rows(self, chosen: slice) -> Limits:
        """The limits of some of the rows."""
        return Limits(*(side[chosen] for side in self))

    def within(self, lowest: float, highest: float) -> Limits:
        """The narrower of these limits and a range [kW]."""
        return Limits(*(np.clip(side, lowest, highest) for side in self))


def read_setpoint(setpoint: Any, table: ZoneTable) -> Band:
    """A set-point, or a band of a heating and a cooling set-point, by the rows of a table.

    One value or column is the temperature [degC] wanted at the stamp, which the row before must reach.  Two are a
    thermostat's heating and cooling set-point, which the row itself must reach by its end; columns of a DataFrame go by
    name where one contains "heat" and the other "cool", or one alone does; a side that is None is not held.
    """
    if isinstance(setpoint, Band):
        return setpoint
    if setpoint is None:
        raise ValueError("setpoint=None holds nothing; give a temperature, or a heating and a cooling set-point.")
    sides: Sequence[Any]
    if isinstance(setpoint, pd.DataFrame):
        sides = _columns(setpoint)
    elif isinstance(setpoint, tuple) and len(setpoint) == 2:
        sides = setpoint
    elif np.ndim(setpoint) == 2:
        sides = list(as_numbers(setpoint, "setpoint").T)
    elif isinstance(setpoint, list) and as_numbers(setpoint, "setpoint").shape == (2,) != (table.n_rows,):
        raise ValueError(f"setpoint={setpoint!r} is no pair; give a heating and a cooling set-point, such as (21, 24).")
    else:
        sides = [setpoint]
    if len(sides) not in (1, 2):
        raise ValueError(f"setpoint has {len(sides)} columns; give one, or the heating and the cooling set-point.")
    if len(sides) == 1:
        held = _by_row(sides[0], table, "setpoint", np.nan, "T_za")
        refuse_where(~np.isfinite(held), table, "setpoint contains NaN or inf", "fill it first")
        held = np.append(held[1:], held[-1])
        return Band(held, held)
    given = list(zip(sides, ("heating", "cooling"), FREE, strict=True))
    band = Band(*(_by_row(side, table, f"the {name} set-point", free, "T_za") for side, name, free in given))
    for held, (_, name, free) in zip(band, given, strict=True):
        refuse_where(~np.isfinite(held) & (held != free), table, f"the {name} set-point contains NaN or inf", "fill it")
    refuse_where(
        band.heating > band.cooling, table, "the heating set-point is above the cooling one", "swap or mend them"
    )
    return band


def read_limits(limits: Any, table: ZoneTable) -> Limits:
    """Least and most heat of a plant [kW] by row, from a pair of numbers or series; None is no limit.

    Those that have been read are taken as they are, so that a user is warned of them once.
    """
    if isinstance(limits, Limits):
        return limits
    given = (None, None) if limits is None else limits
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise ValueError("limits is a pair (lowest, highest) [kW], each a number or one value per row.")
    out = Limits(
        _by_row(given[0], table, "the lower limit", -np.inf, "Q_hvac"),
        _by_row(given[1], table, "the upper limit", np.inf, "Q_hvac"),
    )
    refuse_where(np.isnan(out.lower) | np.isnan(out.upper), table, "limits contain NaN", "fill them")
    refuse_where(out.lower > out.upper, table, "limits have the lowest heat above the highest", "swap or mend them")
    return out


def read_plant_limits(limits: Any, table: ZoneTable) -> tuple[float, float] | None:
    """Least and most heat of a plant [kW] in all rows, from a pair of numbers or None; None without limits."""
    if limits is None:
        return None
    if not isinstance(limits, tuple | list) or len(limits) != 2 or any(np.ndim(side) for side in limits):
        raise ValueError("limits is a pair of numbers (lowest, highest) [kW]; those by row are for predict_load.")
    lowest, highest = (float(side[0]) for side in read_limits(limits, table))
    if not lowest <= 0.0 <= highest:
        raise ValueError(f"limits=({limits[0]}, {limits[1]}) must have 0 kW, a plant that is off, between them.")
    return lowest, highest


def _columns(frame: pd.DataFrame) -> list[pd.Series | None]:
    """The columns of a frame, that of heating first where their names contain "heat" and "cool"; None for one alone."""
    columns: list[pd.Series | None] = [frame.iloc[:, j] for j in range(frame.shape[1])]
    heat, cool = ([j for j, name in enumerate(frame) if word in str(name).lower()] for word in ("heat", "cool"))
    if len(columns) == 2 and len(heat) == len(cool) == 1 and heat != cool:
        return [columns[heat[0]], columns[cool[0]]]
    if len(columns) == 1 and len(heat) != len(cool):
        return [*columns, None] if heat else [None, *columns]
    return columns


def _by_row(given: Any, table: ZoneTable, name: str, absent: float, role: str) -> np.ndarray:
    """(N,) float64 of a number, one value per row, or None, within the range of a role."""
    if isinstance(given, pd.Series):
        if isinstance(table.index, pd.DatetimeIndex):
            refuse_other_stamps(given, table.index, name)
        given = given if given.dtype == bool else numeric(given, name)
    values = as_numbers(absent if given is None else given, name)
    if values.ndim == 0:
        values = np.full(table.n_rows, float(values))
    if values.shape != (table.n_rows,):
        raise ValueError(f"{name} has shape {values.shape}, but X has {table.n_rows} rows; give one value per row.")
    check_range(values, role, name, table.index)
    return values


def refuse_where(wrong: np.ndarray, table: ZoneTable, what: str, remedy: str) -> None:
    """Refuse a table with rows that are ``wrong`` (n_rows,) bool, and name the first of them."""
    if wrong.any():
        raise ValueError(f"{what} (first at {table.index[int(np.argmax(wrong))]}); {remedy}.")
