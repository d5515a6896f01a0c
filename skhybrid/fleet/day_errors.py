"""Errors of day-ahead forecasts by day, which show how a zone is doing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import INTERVAL, quantile_columns

_KEPT_DAYS, _KEPT_ROWS = 28, pd.Timedelta("3D")
_DAY = pd.Timedelta("1D")


def forecasts_from_midnight(model: Any, X: pd.DataFrame) -> pd.DataFrame:
    """Forecasts of rows from the midnights before them: ``y_pred`` and, where they were learned, quantiles [degC]."""
    found = pd.DataFrame({"y_pred": np.asarray(model.predict(X))}, index=X.index)
    try:
        bands = model.predict_quantiles(X, INTERVAL)
    except (AttributeError, TooFewDaysError):
        return found
    return found.assign(**dict(zip(quantile_columns(INTERVAL), np.asarray(bands).T, strict=True)))


def scored_days(
    known: pd.DataFrame, new: pd.DataFrame, days: list[dict[str, Any]]
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """The last rows with their forecasts, and the errors by day, after new rows ``y_true``, ``y_pred`` and quantiles.

    A day has its date, root-mean-square errors of the forecast and of the temperature a day before [K], the number
    of forecasts compared, and the share of measurements inside the interval [-].
    """
    rows = pd.concat([known[~known.index.isin(new.index)], new]) if len(known) else new
    stamps = pd.DatetimeIndex(rows.index)
    before = rows["y_true"].reindex(stamps - _DAY).to_numpy()
    dates, touched = stamps.strftime("%Y-%m-%d"), set(pd.DatetimeIndex(new.index).strftime("%Y-%m-%d"))
    frame = pd.DataFrame({"own": rows["y_pred"] - rows["y_true"], "rule": before - rows["y_true"]})
    low, high = (rows.get(name, pd.Series(np.nan, rows.index)) for name in quantile_columns(INTERVAL))
    frame["inside"] = ((rows["y_true"] >= low) & (rows["y_true"] <= high)).astype(float).where(low.notna())
    frame = frame[frame["own"].notna()]
    found = {day["day"]: day for day in days}
    for date, part in frame.groupby(dates[rows["y_true"].notna() & rows["y_pred"].notna()]):
        if date in touched:
            rms = (part[["own", "rule"]] ** 2).mean() ** 0.5
            shares = {"rmse": rms["own"], "rule": rms["rule"], "inside": part["inside"].mean()}
            shares = {name: None if pd.isna(value) else float(value) for name, value in shares.items()}
            found[str(date)] = {"day": str(date), "n": len(part), **shares}
    return rows[stamps > stamps[-1] - _KEPT_ROWS], sorted(found.values(), key=lambda d: d["day"])[-_KEPT_DAYS:]
