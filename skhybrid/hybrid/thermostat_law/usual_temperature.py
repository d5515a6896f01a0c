"""The usual temperature of a zone whose set-points are not logged, by which its plant is taken to run."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ..._calendar import day_type_hour
from ..._table import ZoneTable
from ...control import Band
from ...forecasting.baselines import means_by_hour
from ..setpoint_columns import with_band


class UsualTemperature(NamedTuple):
    """The mean temperature by hour and kind of day, in place of the set-points that a thermostat may have."""

    by_hour: np.ndarray  # (48,) [degC]

    @classmethod
    def of(cls, training: ZoneTable) -> Self:
        """That of the measured temperature of a training."""
        return cls(means_by_hour(training, training.history["T_za"]))

    def held(self, table: ZoneTable) -> ZoneTable:
        """The table with it as set-points of heating and cooling, whatever set-points it has."""
        usual = self.by_hour[day_type_hour(table)]
        return with_band(table, Band(usual, usual))
