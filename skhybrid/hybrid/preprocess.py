"""The transformer that a predictor applies to every table before it reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._table import as_pandas
from .parts import clone_part


def fit_preprocess(given: Any, X: Any, y: Any) -> Any:
    """A fitted clone of a transformer, or None; its output keeps index and names where it can."""
    if given is None:
        return None
    step = clone_part("preprocess", given, ("fit", "transform"), "a transformer; give one such as GapFiller()")
    X = as_pandas(X)
    if isinstance(X, pd.DataFrame) and hasattr(step, "set_output"):
        step.set_output(transform="pandas")
    return step.fit(X, y)


def preprocessed(step: Any, X: Any, past: Sequence[Any]) -> Any:
    """A table as a fitted transformer gives it, or as it is without one.

    The columns ``past`` are measurements: they may be absent, and what is missing in them stays missing.
    """
    X = as_pandas(X)
    if step is None:
        return X
    if not isinstance(X, pd.DataFrame):
        if hasattr(X, "inputs"):
            raise ValueError("a table that was read before cannot go through preprocess=; pass the DataFrame itself.")
        return step.transform(X)
    seen = getattr(step, "feature_names_in_", None)
    names = list(X.columns if seen is None else seen)
    absent = [name for name in names if name not in X.columns and name not in past]
    if absent:
        raise ValueError(f"X has no column {absent[0]!r}, which preprocess= was fitted on.")
    measured = {name: X[name] if name in X.columns else pd.Series(np.nan, X.index) for name in past}
    out = step.transform(_with_columns(X, {name: measured[name] for name in past if name in names})[names])
    if not isinstance(out, pd.DataFrame):
        raise ValueError("preprocess= must return a DataFrame; use a transformer with set_output.")
    kept = {
        name: out[name].where(known.notna().to_numpy()) if name in out.columns else known
        for name, known in measured.items()
        if name in X.columns and (name in out.columns or name not in names)
    }
    return _with_columns(out, kept).drop(columns=[name for name in past if name not in X.columns], errors="ignore")


def _with_columns(X: pd.DataFrame, columns: Mapping[Any, pd.Series]) -> pd.DataFrame:
    """X with other columns, whose names need not be strings as those of ``assign``."""
    out = X.copy(deep=False)
    for name, values in columns.items():
        out[name] = values
    return out
