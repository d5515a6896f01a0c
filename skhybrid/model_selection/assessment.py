"""Assessment of one identification: its fit, its diagnosis, and its forecasts of held-out rows."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from sklearn.base import clone
from sklearn.utils import _safe_indexing

from ..identification import Diagnostics, diagnose
from .backtest import backtest


@dataclass
class Assessment:
    """Results of one candidate, as far as it came."""

    row: dict[str, Any] = field(default_factory=dict)
    estimator: Any = None
    density: pd.Series | None = None  # log density of every measured training row
    held_out: pd.Series | None = None  # log density of every held-out row
    forecasts: pd.DataFrame | None = None
    diagnostics: Diagnostics | None = None
    error: str = ""


def assess(
    estimator: Any, X: Any, y: Any, splits: list[tuple[np.ndarray, np.ndarray]], horizon: Any, origin_step: Any
) -> Assessment:
    """Fit and diagnose a candidate, and forecast held-out rows; errors are recorded."""
    done = Assessment()
    try:
        has_target = isinstance(X, pd.DataFrame) and ("T_za" in X or "T_za" in dict(estimator.columns or {}))
        if isinstance(X, pd.DataFrame) and not has_target and np.size(y) == len(X):
            X = X.assign(T_za=np.asarray(y, dtype=np.float64).ravel())
        begin = time.perf_counter()
        model = clone(estimator).fit(X, y)
        seconds = time.perf_counter() - begin
        density, found = log_density(model.innovations(X)), diagnose(model, X)
        of_errors = {"whiteness_p": found.whiteness, "acf_outside": found.share_outside}
        done = Assessment(_facts(model) | of_errors | {"seconds": seconds}, model, density, diagnostics=found)
        parts = [hold_out(estimator, X, y, *split, horizon, origin_step) for split in splits]
        if parts:
            done.held_out, done.forecasts = map(pd.concat, zip(*parts, strict=True))
    except Exception as problem:  # one model's failure must not end the comparison
        part = "" if done.density is None else "held-out part: "
        done.error = f"{part}{type(problem).__name__}: {problem}"
    return done


def log_density(innovations: pd.DataFrame) -> pd.Series:
    """Log density of every row's errors, as independent normal with the model's own standard deviations."""
    half = innovations.shape[1] // 2  # one column per output, then their standard deviations
    error, std = innovations.to_numpy()[:, :half], innovations.to_numpy()[:, half:]
    each = stats.norm.logpdf(error, scale=std)
    total = np.where(np.isfinite(each).any(axis=1), np.nansum(each, axis=1), np.nan)
    return pd.Series(total, index=innovations.index)


def hold_out(
    estimator: Any, X: Any, y: Any, train: np.ndarray, test: np.ndarray, horizon: Any, origin_step: Any
) -> tuple[pd.Series, pd.DataFrame]:
    """Log densities of the test rows, and forecasts from origins among them, by a model of the training rows."""
    model = clone(estimator).fit(_safe_indexing(X, train), _safe_indexing(y, train))
    span = np.arange(train[0], test[-1] + 1)
    shown, first = _safe_indexing(X, span), int(test[0] - train[0])
    score = log_density(model.innovations(shown)).iloc[first:]
    start = shown.index[first] if isinstance(getattr(shown, "index", None), pd.DatetimeIndex) else first
    measured = _safe_indexing(y, span)
    return score, backtest(model, shown, measured, horizon=horizon, origin_step=origin_step, start=start)


def _facts(model: Any) -> dict[str, Any]:
    """Number of parameters of a fitted model, and what its data leave open."""
    found, known = model.identifiability_, set(dict(model.known or {}))
    own = [name for name in model.disturbance_.index if name not in known]
    if "rho_gap" in own:  # rho_2 follows from it
        own.remove("rho_2")
    searched = [name for name in model.theta_.index if name not in known and name not in found.not_excited]
    cells = int(np.size(getattr(model, "profile_", ())))
    variance = 0 if "sigma_y" in model.disturbance_.index else 1
    singular = found.singular_values
    return {
        "n_parameters": len(searched) + len(own) + cells + variance,
        "condition": float(singular.iloc[0] / max(singular.iloc[-1], 1e-300)) if len(singular) else 1.0,
        "at_bound": ", ".join(found.at_bound),
        "flat": "; ".join(map(str, found.flat_directions)),
        "not_excited": ", ".join(found.not_excited),
    }
