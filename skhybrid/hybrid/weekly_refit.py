"""Which past a forecaster is fitted again on: all of it, or recent weeks where they forecast the last one better."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from .tables import KEPT

#: how much of the past a new fit may be made on; None is all of it
SPANS: tuple[pd.Timedelta | None, ...] = (None, pd.Timedelta("21D"), pd.Timedelta("14D"))
#: share of the error by all rows below which fewer rows are believed
_CLEARLY = 0.9
_WEEK, _DAY = pd.Timedelta("7D"), pd.Timedelta("1D")


class WeeklyRefit:
    """New fits of a forecaster at the ends of weeks.

    A fit at the end of a week takes the span whose fit a week earlier forecast that week best, a day ahead: a choice
    made on days that it had not seen.

    Parameters
    ----------
    forecaster : estimator
        Cloned for every fit.
    step : Timedelta
        Of its rows.
    """

    def __init__(self, forecaster: Any, step: pd.Timedelta) -> None:
        self._forecaster = forecaster
        self._step = step
        self._fits: dict[tuple[int, int], Any] = {}
        #: the latest fit by the steps since the training, where those are known for good
        self.kept: dict[int, Any] = {}

    def fitted(self, rows: pd.DataFrame) -> Any:
        """The forecaster fitted on rows that end with a week."""
        return self._fit(rows, self.span(rows))

    def span(self, rows: pd.DataFrame) -> pd.Timedelta | None:
        """The span to fit the rows by."""
        before = rows.iloc[: len(rows) - int(_WEEK / self._step)]
        long_enough = [s for s in SPANS if s is None or int(s / self._step) < len(before)]
        if len(long_enough) < 2:
            return None
        errors = [self._error(self._fit(before, span), rows) for span in long_enough]
        best = int(np.argmin(errors))
        return long_enough[best] if errors[best] < _CLEARLY * errors[0] else None

    def _fit(self, rows: pd.DataFrame, span: pd.Timedelta | None) -> Any:
        length = len(rows) if span is None else min(len(rows), int(span / self._step))
        key = (len(rows), length)
        if key not in self._fits:
            chosen = rows.iloc[len(rows) - length :]
            self._fits[key] = clone(self._forecaster).fit(chosen, chosen["zeta"])
            # only the fits of this week and of the one before are wanted again
            week = int(_WEEK / self._step)
            self._fits = {k: v for k, v in self._fits.items() if k[0] >= len(rows) - week}
        return self._fits[key]

    def _error(self, forecaster: Any, rows: pd.DataFrame) -> float:
        """RMS error a day ahead over the last week."""
        day, week = int(_DAY / self._step), int(_WEEK / self._step)
        recent = rows.iloc[-(week + int(KEPT / self._step)) :]
        origins = np.arange(len(recent) - week - 1, len(recent) - day, day)
        paths = forecaster.predict_from(recent, origins, horizon=day * self._step)
        truth = recent["zeta"].to_numpy()[origins[:, None] + np.arange(1, day + 1)]
        error = (paths - truth) ** 2
        return float(np.sqrt(np.nanmean(error))) if np.isfinite(error).any() else np.inf
