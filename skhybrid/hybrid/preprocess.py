"""The transformer that a predictor applies to every table before it reads it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone


def fit_preprocess(given: Any, X: Any, y: Any) -> Any:
    """A fitted clone of a transformer, or None; its output keeps index and names where it can."""
    if given is None:
        return None
    step = clone(given)
    if isinstance(X, pd.DataFrame) and hasattr(step, "set_output"):
        step.set_output(transform="pandas")
    return step.fit(X, y)


def preprocessed(step: Any, X: Any, past: Any) -> Any:
    """A table as a fitted transformer gives it; measurements in the column ``past`` that are missing stay missing."""
    if not isinstance(X, pd.DataFrame):
        if hasattr(X, "inputs"):
            raise ValueError("a table that was read before cannot go through preprocess=; pass the DataFrame itself.")
        return step.transform(X)
    seen = getattr(step, "feature_names_in_", None)
    names = list(X.columns if seen is None else seen)
    absent = [name for name in names if name not in X.columns and name != past]
    if absent:
        raise ValueError(f"X has no column {absent[0]!r}, which preprocess= was fitted on.")
    known = X[past] if past in X.columns else pd.Series(np.nan, X.index)
    out = step.transform(X.assign(**{past: known})[names] if past in names else X[names])
    if not isinstance(out, pd.DataFrame):
        raise ValueError("preprocess= must return a DataFrame; use a transformer with set_output.")
    if past in out.columns:
        out = out.assign(**{past: out[past].where(known.notna().to_numpy())})
    elif past not in names:
        out = out.assign(**{past: known})
    return out if past in X.columns else out.drop(columns=past, errors="ignore")
