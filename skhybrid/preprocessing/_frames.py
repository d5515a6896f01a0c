"""Base class of the transformers, which see every table as a frame."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from .._table import HISTORY_ROLES, as_pandas, read_array, refuse_infinite_columns, refuse_shape, role_of
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
        self._fit_table(_framed(_read_columns(self, X, reset=True)))
        return self

    def transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Transform a table; the result, (n_samples, n_features_out), has the type of ``X``; what changes is float64.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        """
        return self._transformed(X, self._transform_table)

    def _transformed(self, X: Any, change: Callable[[pd.DataFrame], pd.DataFrame]) -> pd.DataFrame | np.ndarray:
        """A table that has the columns of ``fit``, changed; an array remains one."""
        check_is_fitted(self)
        table = _read_columns(self, X, reset=False)
        return change(table) if isinstance(table, pd.DataFrame) else change(_framed(table)).to_numpy()

    @abstractmethod
    def _fit_table(self, table: pd.DataFrame) -> None:
        """Set the fitted attributes."""

    @abstractmethod
    def _transform_table(self, table: pd.DataFrame) -> pd.DataFrame:
        """Transform a table that has the columns of ``fit``."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def _read_columns(estimator: BaseEstimator, X: Any, *, reset: bool) -> pd.DataFrame | np.ndarray:
    """Return a frame, its names checked, and anything else as a float64 array; NaN is allowed, inf is not."""
    X = as_pandas(X)
    if not isinstance(X, pd.DataFrame):
        values = read_array(estimator, X, reset=reset, ensure_all_finite=False, copy=True)
        refuse_infinite_columns(values)
        return values
    refuse_shape(X, 1)
    if not reset:
        X = _in_fitted_order(estimator, X)
    validate_data(estimator, X, reset=reset, skip_check_array=True)
    refuse_infinite_columns(X)
    return X


def _in_fitted_order(estimator: BaseEstimator, X: pd.DataFrame) -> pd.DataFrame:
    """The columns of ``fit``, found by name; frames without any role are left to scikit-learn's check."""
    names = list(getattr(estimator, "feature_names_in_", ()))
    if not any(role_of(name) for name in names):
        return X
    absent = [name for name in names if name not in X.columns]
    if absent:
        hint = "; for rows ahead take preprocess= of a predictor, or give NaN" if absent[0] in HISTORY_ROLES else ""
        raise ValueError(f"X has no column {absent[0]!r}, which {type(estimator).__name__} was fitted on{hint}.")
    return X[names]


def roles_by_position(n_columns: int) -> list[str]:
    """Roles of the columns of an array, by the data contract."""
    return [("T_oa", "q_sol")[j] if j < 2 else f"u_{j}" for j in range(n_columns)]


def _framed(table: pd.DataFrame | np.ndarray) -> pd.DataFrame:
    """A frame as it is; the columns of an array are named by their roles."""
    return table if isinstance(table, pd.DataFrame) else pd.DataFrame(table, columns=roles_by_position(table.shape[1]))


def position_of(column: Any, names: list[Any]) -> int | None:
    """Position of a column given by its name or its position; None if there is no such column."""
    if column in names:
        return names.index(column)
    if isinstance(column, int | np.integer) and 0 <= column < len(names):
        return int(column)
    return None
