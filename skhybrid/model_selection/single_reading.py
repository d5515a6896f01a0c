"""Tables that are read once and handed to every estimator that works on them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from typing import Any

import pandas as pd
from sklearn.base import BaseEstimator

from .._rolling import RollingForecastMixin
from .._table import read_table
from .._warnings import ignore, warnings_to


def read_once(X: Any, *, columns: Mapping[str, Any] | None = None, sampling_time: Any = None, fits: bool = True) -> Any:
    """A frame with time stamps as read by the data contract, or X itself where it cannot be read.

    Unlikely units are worth a warning only where an estimator ``fits`` on these rows.
    """
    if not isinstance(X, pd.DataFrame) or not isinstance(X.index, pd.DatetimeIndex):
        return X
    with nullcontext() if fits else warnings_to(ignore):
        try:
            return read_table(BaseEstimator(), X, columns=columns, sampling_time=sampling_time, reset=True)
        except (ValueError, TypeError):
            return X


def takes_tables(estimator: Any) -> bool:
    """Whether an estimator reads its input by the data contract, and so takes a table that was read before."""
    return isinstance(estimator, RollingForecastMixin) and getattr(estimator, "preprocess", None) is None


def reading_of(estimator: Any) -> dict[str, Any]:
    """The way an estimator reads a frame: the arguments ``columns`` and ``sampling_time`` of :func:`read_once`."""
    parts = (estimator, getattr(estimator, "gray_box", None))
    given = {name: [getattr(part, name, None) for part in parts] for name in ("columns", "sampling_time")}
    return {name: next((value for value in values if value is not None), None) for name, values in given.items()}


def read_alike(estimators: Iterable[Any], reading: Mapping[str, Any]) -> bool:
    """Whether all estimators take a table that was read in the given way."""
    return all(takes_tables(one) and reading_of(one) == reading for one in estimators)
