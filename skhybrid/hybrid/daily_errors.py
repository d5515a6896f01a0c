"""A day's disturbance beside what was forecast for it at midnight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

_DAY = pd.Timedelta("1D")


def by_days(rows: pd.DataFrame, forecaster: Any, step: pd.Timedelta) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measured and forecast disturbance of every whole local day but the first.

    Parameters
    ----------
    rows : DataFrame
        Steps of the forecaster with ``zeta``.
    forecaster : estimator
        Fitted; forecasts from the last step before each midnight.
    step : Timedelta

    Returns
    -------
    measured, forecast : DataFrame of shape (n_days, n_steps_a_day)
        Stamped by the day.
    """
    index = pd.DatetimeIndex(rows.index)
    day = (index if index.tz is None else index.tz_localize(None)).normalize()
    per_day = round(_DAY / step)
    begins = np.flatnonzero(day[1:] != day[:-1]) + 1
    begins = begins[begins + per_day <= len(rows)]
    at = begins[:, None] + np.arange(per_day)
    measured = pd.DataFrame(rows["zeta"].to_numpy()[at], index=day[begins])
    paths = forecaster.predict_from(rows, begins - 1, horizon=per_day * step)
    return measured, pd.DataFrame(paths, index=measured.index)


def reference_days(rows: pd.DataFrame, forecaster: Any, step: pd.Timedelta, again: bool):
    """The same of the training, each half forecast by a fit of the other; by the given fit unless ``again``."""
    half = len(rows) // 2
    halves = [rows.iloc[:half], rows.iloc[half:]]
    if not again:
        return by_days(rows, forecaster, step)
    fits = [clone(forecaster).fit(other, other["zeta"]) for other in reversed(halves)]
    parts = [by_days(part, fit, step) for part, fit in zip(halves, fits, strict=True)]
    measured, forecast = (pd.concat(tables) for tables in zip(*parts, strict=True))
    return measured, forecast
