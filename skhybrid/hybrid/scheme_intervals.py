"""Intervals of the hybrid predictors: learned from left-out training rows, within what is plausible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_of, rows_per_day
from ..forecasting.intervals import DAYS_BACK, LEAST_ERRORS
from ..forecasting.quantiles import QuantileForecastMixin, intervals_from
from .plausible_range import PlausibleRange
from .scheme import Scheme


class HybridQuantilesMixin(QuantileForecastMixin):
    """``predict_quantiles`` over a scheme."""

    adapt: str | None
    _scheme: Scheme
    _learned_to: pd.Timestamp | None  # the last stamp that was learned from
    _no_intervals = (
        "no intervals were learned: the training table was too short, or the model is a candidate of a search; fit on "
        "more days, with T_za measured."
    )

    def _check_adapt(self) -> None:
        if self.adapt not in (None, "linear", "full"):
            raise ValueError(f"adapt={self.adapt!r} is not one of None, 'linear', 'full'.")

    def _present_scheme(self) -> Scheme:
        """The fitted scheme; ``adapt`` may have been set since, as ``horizon`` may."""
        self._check_adapt()
        return self._scheme if self._scheme.adapt == self.adapt else self._scheme.adapting(self.adapt)

    def _most_leads(self, step: pd.Timedelta) -> int:
        """Leads of a day, or of a longer horizon."""
        return max(rows_per_day(step), rows_of(self.horizon or "1D", step))

    def _learn_intervals(self, wanted: bool) -> None:
        self._intervals = None
        if not wanted:
            return
        training = self._scheme.rows.training
        left_out = self._scheme.left_out_errors(self._most_leads(training.step))
        if np.isfinite(left_out.errors).sum() >= LEAST_ERRORS:
            self._intervals = intervals_from(left_out, training)

    def _quantile_paths(self, table: ZoneTable, origins: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        bands = super()._quantile_paths(table, origins, *args, **kwargs)
        lowest, highest = self._present_scheme().plausible(table, origins)
        return PlausibleRange(lowest[..., None], highest[..., None]).clip(bands)

    def _quantile_offsets(
        self, table: ZoneTable, origins: np.ndarray, *args: Any, **kwargs: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        # of the kept rows all whose errors count, as if the table followed the training
        missing = DAYS_BACK * rows_per_day(table.step) - int(origins.min(initial=table.n_rows))
        longer = self._scheme.rows.with_earlier(table, table.n_history + missing)
        return super()._quantile_offsets(longer, origins + longer.n_rows - table.n_rows, *args, **kwargs)

    def _each_path(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        return self._present_scheme().forecast_each(tables, origin, n_leads)[:, None]

    def _first_past(self, table: ZoneTable) -> int:
        if table.utc is None or self._learned_to is None:
            return table.n_history
        return min(int((table.utc <= self._learned_to).sum()), table.n_history)  # rows taken in since count too
