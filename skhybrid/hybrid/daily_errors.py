"""Daily disturbance, as estimated and as forecast at midnight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from .._table import ZoneTable
from .tables import fit_forecaster, forecast_steps

_DAY = pd.Timedelta("1D")


def by_days(steps: ZoneTable, forecaster: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Estimated and forecast disturbance of every whole local day but the first.

    Parameters
    ----------
    steps : ZoneTable
        Steps of the forecaster with ``zeta`` as history.
    forecaster : estimator
        Fitted; forecasts from the last step before each midnight.

    Returns
    -------
    measured, forecast : DataFrame of shape (n_days, n_steps_per_day)
        Stamped by the day.
    """
    day = steps.time.normalize()
    per_day = round(_DAY / steps.step)
    begins = np.flatnonzero(day[1:] != day[:-1]) + 1
    begins = begins[begins + per_day <= steps.n_rows]
    at = begins[:, None] + np.arange(per_day)
    measured = pd.DataFrame(steps.history["zeta"][at], index=day[begins])
    paths = forecast_steps(forecaster, steps, begins - 1, per_day)
    return measured, pd.DataFrame(paths, index=measured.index)


def reference_days(steps: ZoneTable, forecaster: Any, refit: bool) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The same of the training: where ``refit``, each half is forecast by a fit to the other half."""
    if not refit:
        return by_days(steps, forecaster)
    half = steps.n_rows // 2
    halves = [steps.rows(slice(0, half)), steps.rows(slice(half, None))]
    fits = [fit_forecaster(clone(forecaster), other) for other in reversed(halves)]
    parts = [by_days(part, fit) for part, fit in zip(halves, fits, strict=True)]
    measured, forecast = (pd.concat(tables) for tables in zip(*parts, strict=True))
    return measured, forecast
