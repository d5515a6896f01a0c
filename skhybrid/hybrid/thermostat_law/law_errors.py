"""Errors of the members of a forecast under set-points."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from .law_features import LawRows
from .plant_law import PRIOR


class LawErrors(NamedTuple):
    """Errors of the members from origins of a table."""

    origins: np.ndarray  # (O,) int
    leads: np.ndarray  # (K,) int, counted from 0
    values: np.ndarray  # (O, K, 2, M) of load [kW] and temperature [K]
    runs: np.ndarray  # (O, K) whether the plant was forecast to run

    @classmethod
    def of(cls, rows: LawRows, origins: np.ndarray, leads: np.ndarray, values: np.ndarray, least: float) -> Self:
        """With the rows in which members forecast, on the whole, at least some heat [kW]."""
        at = np.minimum(origins[:, None] + leads, len(rows.heat) - 1)
        return cls(origins, leads, values, runs(rows.heat[at][..., None] - values[:, :, 0], least))

    @property
    def ends(self) -> np.ndarray:
        """(O, K) row at which each was known."""
        return self.origins[:, None] + self.leads + 1

    def at(self, chosen: np.ndarray) -> Self:
        """Those at some of all leads."""
        return self._replace(leads=chosen, values=self.values[:, chosen], runs=self.runs[:, chosen])

    def until(self, row: int, oldest: int) -> Self:
        """Those of forecasts from ``oldest`` on that were known at a row; the others are NaN."""
        chosen = (self.origins >= oldest) & (self.origins < row)
        own = self._replace(origins=self.origins[chosen], values=self.values[chosen], runs=self.runs[chosen])
        return own._replace(values=np.where((own.ends <= row)[..., None, None], own.values, np.nan))


def runs(loads: np.ndarray, least: float) -> np.ndarray:
    """True where loads (..., M) by the members [kW] say that the plant runs."""
    return np.abs(loads @ PRIOR) >= least
