"""Unit conversion inside a Pipeline."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, OneToOneFeatureMixin, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from ._frames import numeric, read_input
from ._units import Conversion, conversion_of, convert, convert_back


class UnitConverter(OneToOneFeatureMixin, TransformerMixin, BaseEstimator):
    """Convert logged units to those of the data contract (degC, kW/m2, fraction, kW).

    Parameters
    ----------
    units : dict of column to unit, optional
        Logged unit of each column that needs conversion: temperatures in ``"degF"`` or ``"K"``, irradiance in
        ``"W/m2"``, stages in ``"percent"``, powers in ``"W"``, ``"MW"``, ``"Btu/h"``.  For an array a column is its
        position or, by the contract, its role (``"T_oa"`` is column 0, ``"q_sol"`` 1, ``"u_2"`` 2 ...).

    Attributes
    ----------
    conversions_ : dict
        Position of a column -> (kind, scale, offset).
    n_features_in_ : int
    feature_names_in_ : ndarray of str
        Only where fitted on a DataFrame.

    Notes
    -----
    A DataFrame comes back as a DataFrame with its index, names and order; columns without a unit are as they were.

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

    def fit(self, X: Any, y: Any = None) -> UnitConverter:
        """Check the columns against ``units``; nothing is learned from the values.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If a column is absent, or a unit is unknown or none of the column's role.
        """
        table = read_input(self, X, reset=True)
        names = list(table.columns) if isinstance(table, pd.DataFrame) else _names_by_position(table.shape[1])
        self.conversions_ = {_position(c, names): conversion_of(unit, c) for c, unit in (self.units or {}).items()}
        return self

    def transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Convert the columns named in ``units``.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features), as given; converted columns are float64
        """
        return self._apply(X, convert)

    def inverse_transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Convert back to the logged units.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features)
        """
        return self._apply(X, convert_back)

    def _apply(self, X: Any, change: Callable[[np.ndarray, Conversion], np.ndarray]) -> pd.DataFrame | np.ndarray:
        check_is_fitted(self)
        table = read_input(self, X, reset=False)
        if isinstance(table, pd.DataFrame):
            changed = table.copy()
            for j, how in self.conversions_.items():
                changed[table.columns[j]] = change(numeric(table.iloc[:, j]), how)
            return changed
        for j, how in self.conversions_.items():
            table[:, j] = change(table[:, j], how)
        return table

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def _names_by_position(n_columns: int) -> list[str]:
    return [("T_oa", "q_sol")[j] if j < 2 else f"u_{j}" for j in range(n_columns)]


def _position(column: Any, names: list[Any]) -> int:
    if column in names:
        return names.index(column)
    if isinstance(column, int | np.integer) and 0 <= column < len(names):
        return int(column)
    raise ValueError(f"units= names the column {column!r}, but X has {', '.join(repr(str(n)) for n in names)}.")
