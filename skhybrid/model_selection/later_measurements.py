"""Refusal of regressors whose predictions read what was measured after the origin of a forecast."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

from .._table import is_history, is_instant, is_target, listed, numeric, role_of

_ROUNDING = 1e-9  # by which two predictions from the same numbers may differ


def unwrapped(estimator: Any, X: Any) -> tuple[Any, Any]:
    """The estimator inside searches and pipelines, and X as it sees it."""
    while True:
        if hasattr(estimator, "best_estimator_"):
            estimator = estimator.best_estimator_
        elif isinstance(estimator, Pipeline):
            if len(estimator.steps) > 1:
                X = estimator[:-1].transform(X)
            estimator = estimator.steps[-1][1]
        else:
            return estimator, X


def refuse_later_measurements(
    estimator: Any, X: Any, y: np.ndarray, predicted: np.ndarray, origins: np.ndarray, n_leads: int
) -> None:
    """Refuse an estimator without ``predict_from`` that reads measurements of X after an origin.

    It reads them where its last step names a measured column, or where other measurements after one of a few origins
    change what is ``predicted`` (n_samples,) of the ``n_leads`` rows after it.  Measured are the columns of history and
    those that are y (n_samples,), in any unit, or y some rows earlier.  What is lagged by the horizon or more, in X
    or by a step of a pipeline, is not read after the origin.
    """
    forecaster, _ = unwrapped(estimator, X)
    name = type(forecaster).__name__
    if not _holds_forecaster(forecaster):
        for column in getattr(forecaster, "feature_names_in_", ()):
            if is_history(column):
                raise ValueError(_message(name, f"column {column!r}"))
    measured, last = _measured(X, y, n_leads), len(origins) - 1
    if not measured:
        return
    for origin in origins[sorted({0, min(1, last), last // 2, last})].tolist():
        ahead = slice(origin + 1, origin + 1 + n_leads)
        if _differ(predicted, _predicted(estimator, _changed_after(X, measured, origin)), ahead):
            alone = {j: _predicted(estimator, _changed_after(X, {j: lag}, origin)) for j, lag in measured.items()}
            read = [j for j, other in alone.items() if _differ(predicted, other, ahead)]
            raise ValueError(_message(name, f"column {listed(_as_frame(X).columns[read or list(measured)], most=3)}"))


def _predicted(estimator: Any, X: Any) -> np.ndarray:
    forecaster, table = unwrapped(estimator, X)
    return np.asarray(forecaster.predict(table), dtype=np.float64)


def _differ(one: np.ndarray, other: np.ndarray, rows: slice) -> bool:
    return not np.allclose(one[rows], other[rows], rtol=_ROUNDING, atol=_ROUNDING, equal_nan=True)


def _message(name: str, column: str) -> str:
    return (
        f"{name} has no predict_from, and its predict reads {column} of X, which is measured and so unknown after the "
        "origin of a forecast: drop it, or give it lagged by the horizon or more, under a name without T_za."
    )


def _holds_forecaster(estimator: Any) -> bool:
    """Whether an estimator is made of others that read measurements only up to their origins, as a vote of them is."""
    parts = estimator.get_params().values() if hasattr(estimator, "get_params") else ()
    return any(hasattr(part, "predict_from") for part in parts)


def _measured(X: Any, y: np.ndarray, n_leads: int) -> dict[int, int]:
    """Columns of X, by position, that hold history, y, or y some rows earlier; and by how many rows they lag."""
    found, frame = {}, _as_frame(X)
    for j, (name, dtype) in enumerate(frame.dtypes.items()):
        if not pd.api.types.is_numeric_dtype(dtype):
            continue
        if is_history(name):
            found[j] = 0
            continue
        values = numeric(frame.iloc[:, j])
        in_any_unit = role_of(name) is None or (is_instant(name) and name != "T_oa")  # the others are inputs
        lags = range(min(n_leads, len(y)))
        lag = next((k for k in lags if is_target(values[k:], y[: len(y) - k], scaled=in_any_unit and k == 0)), None)
        if lag is not None:
            found[j] = lag
    return found


def _as_frame(X: Any) -> pd.DataFrame:
    """X, or an array as a frame whose columns have their positions as names."""
    return X if isinstance(X, pd.DataFrame) else pd.DataFrame(np.asarray(X))


def _changed_after(X: Any, lags: Mapping[int, int], origin: int) -> Any:
    """A copy of X whose columns are higher and lower in turn where they hold measurements after a row.

    ``lags`` says by how many rows each column lags; what is missing stays missing.
    """
    frame = _as_frame(X).copy(deep=False)
    rows = np.arange(len(frame))
    for j, lag in lags.items():
        values = numeric(frame.iloc[:, j])
        by = (1.0 + 3.0 * np.nanstd(values)) * np.where(rows % 2, 1.0, -1.0)
        frame.isetitem(j, np.where(rows > origin + lag, values + by, values))
    return frame if isinstance(X, pd.DataFrame) else frame.to_numpy(dtype=np.float64)
