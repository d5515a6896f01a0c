"""Transformer that converts units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import OneToOneFeatureMixin
from sklearn.utils.validation import check_is_fitted

from ._frames import TableTransformer, numeric, position_of, read_input, roles_by_position
from ._units import Conversion, conversion_of, convert, convert_back


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
    n_features_in_ : int
        Number of columns.
    feature_names_in_ : ndarray of str
        Names of the columns, if fitted on a DataFrame.

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

    def _fit_table(self, table: pd.DataFrame | np.ndarray) -> None:
        names = list(table.columns) if isinstance(table, pd.DataFrame) else roles_by_position(table.shape[1])
        self.conversions_ = {_find(c, names): conversion_of(unit, c) for c, unit in (self.units or {}).items()}

    def transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Convert the columns named in ``units``.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features), of the type of ``X``; converted columns are float64
        """
        return self._apply(X, convert)

    def inverse_transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Convert back to the original units.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features)
        """
        return self._apply(X, convert_back)

    def _apply(self, X: Any, function: Callable[[np.ndarray, Conversion], np.ndarray]) -> pd.DataFrame | np.ndarray:
        check_is_fitted(self)
        table = read_input(self, X, reset=False)
        if isinstance(table, pd.DataFrame):
            converted = table.copy()
            for j, conversion in self.conversions_.items():
                converted[table.columns[j]] = function(numeric(table.iloc[:, j]), conversion)
            return converted
        for j, conversion in self.conversions_.items():
            table[:, j] = function(table[:, j], conversion)
        return table


def _find(column: Any, names: list[Any]) -> int:
    position = position_of(column, names)
    if position is not None:
        return position
    raise ValueError(f"units= names the column {column!r}, but X has {', '.join(repr(str(n)) for n in names)}.")
