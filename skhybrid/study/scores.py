"""Errors of back-tested models, coverage of their intervals, and all their forecasts in one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import INTERVAL, quantile_columns
from ..model_selection import backtest
from .settings import Settings
from .zone_part import Study, measured_of


def backtest_of(model: Any, study: Study, **given: Any) -> pd.DataFrame:
    """A back-test of a fitted model on the test rows, with arguments of :func:`skhybrid.model_selection.backtest`."""
    settings, rows = study.settings, study.rows_for(model)[1]
    given |= {"horizon": settings.horizon, "origin_step": settings.origin_step, "start": study.data.test_start}
    return backtest(model, rows, measured_of(study.data.later, settings), **given)


def backtest_with_intervals(model: Any, study: Study, **given: Any) -> pd.DataFrame:
    """The same with the quantiles of :data:`INTERVAL` where the model has learned them; else a remark says why not."""
    try:
        return backtest_of(model, study, quantiles=INTERVAL, **given)
    except TooFewDaysError as error:
        study.remarks.append(f"no intervals are given: {error}")
        return backtest_of(model, study, **given)


def errors_by_model(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Errors [K] of the forecasts that every model made and that meet a measurement, one column per model."""
    errors = pd.DataFrame({name: frame["y_pred"] - frame["y_true"] for name, frame in frames.items()}).dropna()
    if errors.empty:
        raise ValueError("no forecast of the test span meets a measurement; choose another [test] span.")
    return errors


def rmse_by_zone(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Errors [K] of each zone (rows) by model, over the forecasts that every model made."""
    errors, zones = errors_by_model(frames), next(iter(frames.values()))["zone"]
    return (errors**2).groupby(zones[errors.index], sort=False).mean() ** 0.5


def error_table(errors: pd.DataFrame) -> pd.DataFrame:
    """``rmse`` and ``mae`` of each column of errors."""
    return pd.DataFrame({"rmse": np.sqrt((errors**2).mean()), "mae": errors.abs().mean()})


def has_intervals(frame: pd.DataFrame) -> bool:
    """Whether a back-test or a forecast holds the quantiles of :data:`INTERVAL`."""
    return quantile_columns(INTERVAL)[0] in frame


def interval_asked(frame: pd.DataFrame, settings: Settings) -> dict[str, Any]:
    """Arguments of a forecast that has intervals where a back-test has them."""
    return {"quantiles": INTERVAL, "weather_error": settings.weather_error} if has_intervals(frame) else {}


def coverage_of(frame: pd.DataFrame) -> float | None:
    """Share of the measurements inside the intervals of a back-test; None without intervals or measurements."""
    known = frame.dropna(subset="y_true")
    if not has_intervals(frame) or known.empty:
        return None
    low, high = quantile_columns(INTERVAL)
    return float(known["y_true"].between(known[low], known[high]).mean())


def side_by_side(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Back-tests in one table: origin, zone if several, lead [h], time, measured, and one column per model."""
    first = next(iter(frames.values()))
    shared = first.reindex(columns=[c for c in ("origin", "zone", "lead", "time", "y_true") if c in first])
    shared["lead"] = shared["lead"].dt.total_seconds() / 3600
    return shared.assign(**{label: frame["y_pred"].to_numpy() for label, frame in frames.items()})
