"""Parts that a user gives a predictor: cloned, and refused if unsuitable; the transformer and columns of its tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pandas as pd
from sklearn.base import clone

from .._table import as_pandas
from ..thermal import RCNetwork


def clone_part(name: str, given: Any, needed: Iterable[str], wanted: str) -> Any:
    """A clone of what was given for a part; refused unless it is an estimator with all ``needed`` attributes."""
    if isinstance(given, type) or not all(hasattr(given, one) for one in ("get_params", *needed)):
        raise ValueError(f"{name}={given!r} must be {wanted}.")
    return clone(given)


def fit_preprocess(given: Any, X: Any, y: Any) -> Any:
    """A fitted clone of a transformer, or None; its output keeps index and names where it can."""
    if given is None:
        return None
    step = clone_part("preprocess", given, ("fit", "transform"), "a transformer; give one such as GapFiller()")
    X = as_pandas(X)
    if isinstance(X, pd.DataFrame) and hasattr(step, "set_output"):
        step.set_output(transform="pandas")
    return step.fit(X, y)


def is_read(role: str, network: Any) -> bool:
    """True for a column that a predictor reads; of further temperatures, those that a declared network reads."""
    further = role.startswith("T_") and role != "T_oa"
    return not further or (isinstance(network, RCNetwork) and network.reads(role))


def preprocessed(step: Any, X: Any, past: Sequence[Any]) -> Any:
    """A table as a fitted transformer gives it, or as it is without one.

    The columns ``past`` are measurements: they may be absent, and what is missing in them stays missing.
    """
    if step is None:
        return X
    X = as_pandas(X)
    if not isinstance(X, pd.DataFrame):
        if hasattr(X, "inputs"):
            raise ValueError("a table that was read before cannot go through preprocess=; pass the DataFrame itself.")
        return step.transform(X)
    seen = getattr(step, "feature_names_in_", None)
    names = list(X.columns if seen is None else seen)
    absent = [name for name in names if name not in X.columns and name not in past]
    if absent:
        raise ValueError(f"X has no column {absent[0]!r}, which preprocess= was fitted on.")
    out = step.transform(X[names] if set(names) <= set(X.columns) else X.reindex(columns=names))
    if not isinstance(out, pd.DataFrame):
        raise ValueError("preprocess= must return a DataFrame; use a transformer with set_output.")
    out = out.copy(deep=False)
    for name in past:
        if name not in X.columns:
            out = out.drop(columns=name, errors="ignore")
        elif name in out.columns:
            out[name] = out[name].where(X[name].notna().to_numpy())
        elif name not in names:
            out[name] = X[name]
    return out
