"""Scorers of forecasts whose measurements may be missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class MeasuredRmse:
    """Root-mean-square error of ``predict`` over the measured rows, in the unit of y; with ``sign=-1`` a score."""

    sign: float = 1.0

    def __call__(self, estimator: Any, X: Any, y: Any) -> float:
        """Score a fitted estimator on a table and its target (n_samples,), NaN where missing."""
        error = np.asarray(estimator.predict(X), dtype=np.float64) - np.asarray(y, dtype=np.float64)
        return self.sign * float(np.sqrt(np.nanmean(error**2)))
