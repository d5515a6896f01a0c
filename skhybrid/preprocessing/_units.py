"""Conversion of units to those of the data contract, and the transformer that applies it."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import OneToOneFeatureMixin

from .._arguments import as_mapping
from .._table import listed, numeric
from ._frames import TableTransformer, position_of

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
    "kcal/h": Conversion("power", 1.163e-3),
    "kJ/h": Conversion("power", 1.0 / 3600.0),
    "MJ/h": Conversion("power", 1.0 / 3.6),
    "GJ/h": Conversion("power", 1e3 / 3.6),
    "Gcal/h": Conversion("power", 1163.0),
    "MMBtu/h": Conversion("power", 293.0710702),
    "tons": Conversion("power", 3.516852842),  # of refrigeration
}
KIND_OF_PREFIX = (("T_", "temperature"), ("q_sol", "irradiance"), ("u_", "fraction"), ("Q_", "power"))


def conversion_of(unit: str, column: object) -> Conversion:
    """Conversion of a column logged in ``unit``, which must be known and suit the column's role."""
    if not isinstance(unit, str) or unit not in UNITS:
        near = difflib.get_close_matches(str(unit), UNITS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        raise ValueError(f"units= gives {column!r} the unit {unit!r}, which is not one of {', '.join(UNITS)}{hint}")
    conversion = UNITS[unit]
    for prefix, kind in KIND_OF_PREFIX:
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


class UnitConverter(OneToOneFeatureMixin, TableTransformer):
    """Convert units to those of the data contract (degC, kW/m2, fraction, kW).

    Parameters
    ----------
    units : dict of column to unit, optional
        Unit of each column that needs conversion: temperatures in ``"degF"`` or ``"K"``, irradiance in ``"W/m2"``,
        stages in ``"percent"``, powers in ``"W"``, ``"MW"`` or ``"Btu/h"``.  A column of an array is given by its
        position, or by the role that the contract gives to it (``"T_oa"`` is column 0, ``"q_sol"`` 1, ``"u_2"`` 2 ...).

    Attributes
    ----------
    conversions_ : dict of int to tuple
        Kind, scale and offset of each conversion, by the position of the column.
    n_features_in_, feature_names_in_ : int, ndarray of str

    Notes
    -----
    A DataFrame keeps its index, its names and their order; columns that are not in ``units`` are not changed.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid.preprocessing import UnitConverter
    >>> UnitConverter({"T_oa": "degF"}).fit_transform(pd.DataFrame({"T_oa": [68.0], "u_cool": [0.5]}))
       T_oa  u_cool
    0  20.0     0.5
    """

    def __init__(self, units: dict[Any, str] | None = None) -> None:
        self.units = units

    def _fit_table(self, table: pd.DataFrame) -> None:
        names = list(table.columns)
        self.conversions_: dict[int, Conversion] = {}
        for column, unit in as_mapping("units", self.units, "columns to units, such as {'T_oa': 'degF'}").items():
            position = position_of(column, names)
            if position is None:
                raise ValueError(f"units= names the column {column!r}, but X has {listed(names)}.")
            if position in self.conversions_:
                raise ValueError(f"units= names the column {names[position]!r} twice, by name and by position.")
            self.conversions_[position] = conversion_of(unit, column)

    def _transform_table(self, table: pd.DataFrame) -> pd.DataFrame:
        return self._apply(table, convert)

    def inverse_transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Convert back to the original units.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        """
        return self._transformed(X, lambda table: self._apply(table, convert_back))

    def _apply(self, table: pd.DataFrame, function: Callable[[np.ndarray, Conversion], np.ndarray]) -> pd.DataFrame:
        converted = table.copy()
        for j, conversion in self.conversions_.items():
            converted[table.columns[j]] = function(numeric(table.iloc[:, j]), conversion)
        return converted
