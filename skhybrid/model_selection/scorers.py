"""Scorers of day-ahead forecasts, for the ``scoring`` of scikit-learn's searches and cross-validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .._time import spell
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from .backtest import backtest, score_backtest, score_intervals


@dataclass(frozen=True)
class DayAheadScorer:
    """Score of the forecasts from every origin of a test block; greater is better.

    Every estimator is asked for the same forecasts, whatever its own ``horizon``: from each origin over the horizon, of
    which the end of the block cuts off the last.  They read ``T_za`` in X up to their origin only; a regressor without
    ``predict_from`` may not read it (:func:`backtest`).  A warning says where no forecast of a block reaches half of
    the horizon, as in blocks of one day that do not begin at midnight.

    ``day_ahead_scorer`` is ``DayAheadScorer()``, the error of day-ahead forecasts; ``quantile_scorer`` is that of their
    quantiles 0.1, 0.5 and 0.9.

    Parameters
    ----------
    horizon, origin_step : timedelta-like, default="1D"
        As in :func:`backtest`.
    quantiles : tuple of float, optional
        At least two quantiles: their mean pinball loss counts, instead of the error of the forecast.

    Examples
    --------
    >>> from sklearn.model_selection import cross_val_score
    >>> from skhybrid import ARXRegressor
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.model_selection import RollingOriginSplit, day_ahead_scorer
    >>> office = make_office(n_days=10, random_state=0)
    >>> cv = RollingOriginSplit(train="7D", test="1D")
    >>> cross_val_score(ARXRegressor(), office.X, office.y, cv=cv, scoring=day_ahead_scorer).shape
    (3,)
    """

    horizon: Any = "1D"
    origin_step: Any = "1D"
    quantiles: tuple[float, ...] | None = None

    def __call__(self, estimator: Any, X: Any, y: Any) -> float:
        """Minus the root mean square error, or minus the mean pinball loss [K]."""
        if self.quantiles is not None and np.size(self.quantiles) < 2:
            raise ValueError(f"quantiles={self.quantiles!r} must be at least two, such as (0.1, 0.9), or None.")
        spans = {"horizon": self.horizon, "origin_step": self.origin_step}
        frame = backtest(estimator, X, y, **spans, quantiles=self.quantiles, whole=False)
        longest, horizon = frame["lead"].max(), pd.Timedelta(self.horizon)
        if longest < horizon / 2:
            warn_user(
                f"the test block from {frame['origin'].iloc[0]} on is short: its forecasts are scored over "
                f"{spell(longest)} of their horizon of {spell(horizon)}; make test blocks longer, or "
                "begin them at midnight, as RollingOriginSplit in days does if the table begins at midnight.",
                SkhybridWarning,
            )
        scores: Any = score_backtest(frame) if self.quantiles is None else score_intervals(frame)
        return -float(scores["rmse" if self.quantiles is None else "pinball"])


#: minus the root mean square error of day-ahead forecasts [K]
day_ahead_scorer = DayAheadScorer()
#: minus the mean pinball loss of the quantiles 0.1, 0.5 and 0.9 of day-ahead forecasts [K]
quantile_scorer = DayAheadScorer(quantiles=(0.1, 0.5, 0.9))
