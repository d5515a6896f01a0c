"""What the transformers share: reading a table without losing its index and names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils.validation import validate_data


def read_input(estimator: BaseEstimator, X: Any, *, reset: bool) -> pd.DataFrame | np.ndarray:
    """A frame as it is (names checked), anything else as a float64 array; NaN is let through, inf is not."""
    if not isinstance(X, pd.DataFrame):
        return validate_data(estimator, X, reset=reset, dtype=np.float64, ensure_all_finite="allow-nan", copy=True)
    validate_data(estimator, X, reset=reset, skip_check_array=True)
    if X.shape[1] == 0:
        raise ValueError(f"0 feature(s) (shape=({len(X)}, 0)) while a minimum of 1 is required.")
    if not X.columns.is_unique:
        raise ValueError(f"column {X.columns[X.columns.duplicated()][0]!r} stands twice in X; keep one of them.")
    return X


def numeric(column: pd.Series) -> np.ndarray:
    """A column as float64, NaN where missing."""
    try:
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise ValueError(f"column {column.name!r} is not numeric ({error}); convert it to float first.") from None
