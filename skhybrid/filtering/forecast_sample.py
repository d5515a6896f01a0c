"""Origins and leads at which forecast errors are evaluated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: scored leads, as shares of the horizon
_LEADS = np.array([1, 2, 4, 6, 8, 12, 16, 20, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96]) / 96.0

_MANY = 336  # origins: hourly ones of two weeks


class ForecastSample(NamedTuple):
    """Origins and leads of the forecasts that are scored."""

    origins: np.ndarray  # (O,) int, increasing
    leads: np.ndarray  # (L,) int, increasing

    @property
    def stride(self) -> int:
        """Step between the origins and leads that a fit needs: neighbours among many overlap and say little more."""
        return 2 if len(self.origins) > _MANY else 1

    @property
    def main_leads(self) -> np.ndarray:
        """(ceil(L / stride),) leads of such a fit, with the longest among them."""
        return self.leads[:: -self.stride][::-1]

    def targets(self, n_rows: int) -> tuple[np.ndarray, np.ndarray]:
        """(O, L) target rows, held at the last row, and whether they lie within ``n_rows``."""
        rows = self.origins[:, None] + self.leads
        return np.minimum(rows, n_rows - 1), rows < n_rows


def hourly_sample(n_rows: int, n_leads: int, step: float, first: int) -> ForecastSample:
    """Scored leads, and hourly origins from row ``first`` on, or from an earlier one in a short table.

    Where the ``step`` [h] is longer than an hour, every row is an origin.
    """
    leads = np.unique(np.maximum(np.round(_LEADS * n_leads), 1).astype(np.int64))
    leads = leads[leads <= max(1, n_rows // 2)]
    every = max(1, round(1.0 / step))
    return ForecastSample(np.arange(min(first, n_rows // 4), n_rows - 1, every), leads)
