"""Base class of the transformers, and reading of tables that keeps index and names."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from .._transaction import unchanged_on_failure


class TableTransformer(TransformerMixin, BaseEstimator):
    """Base of the transformers, which learn nothing from values and accept missing ones."""

    @unchanged_on_failure
    def fit(self, X: Any, y: Any = None) -> Self:
        """Check the parameters against the table; nothing is learned from its values.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : ignored
        """
        self._fit_table(read_input(self, X, reset=True))
        return self

    def transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Transform a table; the result, (n_samples, n_features_out), has the type of ``X``; what changes is float64.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        """
        check_is_fitted(self)
        return self._transform_table(read_input(self, X, reset=False))

    @abstractmethod
    def _fit_table(self, table: pd.DataFrame | np.ndarray) -> None:
        """Set the fitted attributes."""

    @abstractmethod
    def _transform_table(self, table: pd.DataFrame | np.ndarray) -> pd.DataFrame | np.ndarray:
        """Transform a table that has the columns of ``fit``."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def read_input(estimator: BaseEstimator, X: Any, *, reset: bool) -> pd.DataFrame | np.ndarray:
    """Return a frame as it is, its names checked, and anything else as a float64 array without inf; NaN is allowed."""
    if not isinstance(X, pd.DataFrame):
        return validate_data(estimator, X, reset=reset, dtype=np.float64, ensure_all_finite="allow-nan", copy=True)
    validate_data(estimator, X, reset=reset, skip_check_array=True)
    if X.shape[1] == 0:
        raise ValueError(f"0 feature(s) (shape=({len(X)}, 0)) while a minimum of 1 is required.")
    if not X.columns.is_unique:
        raise ValueError(f"column {X.columns[X.columns.duplicated()][0]!r} appears twice in X; keep one of them.")
    return X


def numeric(column: pd.Series) -> np.ndarray:
    """Convert a column to float64, missing values to NaN."""
    try:
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise ValueError(f"column {column.name!r} is not numeric ({error}); convert it to float first.") from None


def roles_by_position(n_columns: int) -> list[str]:
    """Roles of the columns of an array, by the data contract."""
    return [("T_oa", "q_sol")[j] if j < 2 else f"u_{j}" for j in range(n_columns)]


def position_of(column: Any, names: list[Any]) -> int | None:
    """Position of a column given by its name or its position; None if there is no such column."""
    if column in names:
        return names.index(column)
    if isinstance(column, int | np.integer) and 0 <= column < len(names):
        return int(column)
    return None
