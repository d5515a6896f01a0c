"""Conversion of units to those of the data contract."""

from __future__ import annotations

import difflib
from typing import NamedTuple

import numpy as np

#: unit of each kind of quantity in the data contract.
CONTRACT_UNIT = {"temperature": "degC", "irradiance": "kW/m2", "fraction": "-", "power": "kW"}


class Conversion(NamedTuple):
    """``value_in_contract_unit = scale * value + offset``."""

    kind: str
    scale: float
    offset: float = 0.0


#: unit -> conversion.
UNITS: dict[str, Conversion] = {
    "degC": Conversion("temperature", 1.0),
    "degF": Conversion("temperature", 5.0 / 9.0, -160.0 / 9.0),
    "K": Conversion("temperature", 1.0, -273.15),
    "kW/m2": Conversion("irradiance", 1.0),
    "W/m2": Conversion("irradiance", 1e-3),
    "Btu/(h ft2)": Conversion("irradiance", 0.00315459075),
    "-": Conversion("fraction", 1.0),
    "fraction": Conversion("fraction", 1.0),
    "percent": Conversion("fraction", 1e-2),
    "%": Conversion("fraction", 1e-2),
    "kW": Conversion("power", 1.0),
    "W": Conversion("power", 1e-3),
    "MW": Conversion("power", 1e3),
    "Btu/h": Conversion("power", 2.930710702e-4),
    "kBtu/h": Conversion("power", 0.2930710702),
}
_KIND_OF_PREFIX = (("T_", "temperature"), ("q_sol", "irradiance"), ("u_", "fraction"), ("Q_", "power"))


def conversion_of(unit: str, column: object) -> Conversion:
    """Return the conversion of a column logged in ``unit``.

    Raises
    ------
    ValueError
        If the unit is unknown, or is not one for the column's role.
    """
    if unit not in UNITS:
        near = difflib.get_close_matches(str(unit), UNITS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        raise ValueError(f"units= gives {column!r} the unit {unit!r}, which is not one of {', '.join(UNITS)}{hint}")
    conversion = UNITS[unit]
    for prefix, kind in _KIND_OF_PREFIX:
        if isinstance(column, str) and column.startswith(prefix) and conversion.kind != kind:
            raise ValueError(
                f"units= gives {column!r} the unit {unit!r}, but that role needs a unit of {kind}, such as "
                f"{CONTRACT_UNIT[kind]!r}."
            )
    return conversion


def convert(values: np.ndarray, conversion: Conversion) -> np.ndarray:
    """Convert values to the contract's unit, float64."""
    return conversion.scale * np.asarray(values, dtype=np.float64) + conversion.offset


def convert_back(values: np.ndarray, conversion: Conversion) -> np.ndarray:
    """Convert values from the contract's unit back to the original one, float64."""
    return (np.asarray(values, dtype=np.float64) - conversion.offset) / conversion.scale
