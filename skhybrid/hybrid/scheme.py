"""The seam between the estimator, which knows tables, and what forecasts a building."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable
from ..control.setpoints import Band, Limits
from ..forecasting.quantiles import LeftOut


class Paths(NamedTuple):
    """Forecasts from some origins; column j is the row ``origin + 1 + j``."""

    temperature: np.ndarray  # (n_origins, n_leads) at the stamp of each row [degC]
    zeta: np.ndarray  # (n_origins, n_leads) over the step that begins there [kW, or K for an output disturbance]


class Scheme(Protocol):
    """What :class:`~skhybrid.hybrid.HybridPredictor` delegates to.

    What a scheme needs comes through its constructor; what it learned is in attributes that end in ``_``, which the
    estimator shows as its own.  A table behind the training begins with the estimator's kept tail of it: those are its
    first ``n_history`` rows, and origins count from the first of them.
    """

    adapt: str | None  # what a forecast takes in from the history up to its origin; may be changed after ``fit``

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Learn from a training table and its measured temperature (n_rows,) [degC], NaN where missing."""

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> Paths:
        """Forecast from each origin; anything at rows beyond the table."""

    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps every row from the first origin on within its set-points, (n_rows - n_history) rows.

        ``setpoint`` and ``limits`` hold one value for each of these rows.  Each origin is forecast up to the next one.
        Columns as :meth:`~skhybrid.hybrid.HybridPredictor.predict_load`.
        """

    def advance(self, table: ZoneTable, target: np.ndarray) -> None:
        """Take in rows that follow the last known one, in a time that does not depend on what came before them."""

    def forecast_live(self, future: ZoneTable) -> Paths:
        """Forecast the rows of ``future``, which follow the last known one: (1, n_rows) paths."""

    def learn(self, table: ZoneTable, target: np.ndarray) -> None:
        """Take in rows that follow the last known one (there may be none), and recalibrate on all that is known."""

    def calibration_errors(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> LeftOut:
        """Errors of forecasts of parts of the training table, each by what has not learned from that part.

        ``table`` is that of ``fit``, with ``target`` as its history ``T_za``.
        """

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Day by day, whether what was learned still holds (see :class:`DriftMonitor`); None: the rows since then."""
