"""Growing array of the errors of successive forecasts."""

from __future__ import annotations

import numpy as np


class ErrorHistory:
    """Errors of successive forecasts at some leads; NaN until they are known.

    Parameters
    ----------
    n_leads : int
    n_kinds : int
        Forecasts made at each origin, such as one per memory.
    """

    def __init__(self, n_leads: int, n_kinds: int) -> None:
        self._buffer = np.empty((0, n_leads, n_kinds))
        self._n = 0

    @property
    def values(self) -> np.ndarray:
        """(n, n_leads, n_kinds), to be read and written."""
        return self._buffer[: self._n]

    def extend(self, n: int) -> None:
        """Make room for ``n`` forecasts in all."""
        if n > len(self._buffer):
            buffer = np.full((2 * n, *self._buffer.shape[1:]), np.nan)
            buffer[: self._n] = self.values
            self._buffer = buffer
        self._n = max(n, self._n)
