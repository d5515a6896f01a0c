"""Temperatures that a log makes plausible: forecasts are clipped to them, so that no member of a blend runs away."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from ..control import Band

#: a forecast may leave the known temperatures by their range and so much more, and at least by so much [K]: a room that
#: a thermostat holds has a small range, and cools far below it once its plant is off
_BEYOND, _LEAST = 2.0, 10.0


class PlausibleRange(NamedTuple):
    """The lowest and highest temperature known [degC], NaN where none is; numbers, or arrays by row."""

    lowest: Any
    highest: Any

    @classmethod
    def of(cls, T: np.ndarray) -> Self:
        """The range of measured temperatures (n,), NaN where missing."""
        known = T[np.isfinite(T)]
        return cls(float(known.min()), float(known.max())) if len(known) else cls(np.nan, np.nan)

    def extended(self, T: np.ndarray) -> Self:
        """The range with further temperatures."""
        other = type(self).of(T)
        return type(self)(np.fmin(self.lowest, other.lowest), np.fmax(self.highest, other.highest))

    def at(self, T: np.ndarray, rows: np.ndarray) -> Self:
        """The ranges (n_rows, 1) that are known at some rows of a table with temperatures (n,), after this one."""
        lowest, highest = (
            extreme.accumulate(np.append(end, T))[rows + 1, None]
            for extreme, end in zip((np.fmin, np.fmax), self, strict=True)
        )
        return type(self)(lowest, highest)

    def of_row(self, i: int) -> Self:
        """One of the ranges."""
        return type(self)(self.lowest[i], self.highest[i])

    def clip(self, paths: np.ndarray) -> np.ndarray:
        """Temperatures [degC], clipped to what is plausible."""
        low, high = self._ends
        return np.clip(paths, np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))

    def errors_of_clipped(self, errors: np.ndarray, T: np.ndarray) -> np.ndarray:
        """Errors [K] of forecasts of temperatures [degC] as they are once the forecasts are clipped."""
        forecast = T - errors
        clipped = self.clip(forecast)
        return np.where(clipped == forecast, errors, errors + forecast - clipped)

    def clip_errors(self, errors: np.ndarray) -> np.ndarray:
        """Errors [K], clipped to those that a clipped forecast can have."""
        low, high = self._ends
        return np.clip(errors, low - high, high - low) if np.isfinite(high - low) else errors

    def around(self, band: Band) -> Self:
        """The range with the set-points of a band, to which a plant may bring the room."""
        return self.extended(np.concatenate(band))

    @property
    def _ends(self) -> tuple[Any, Any]:
        reach = np.maximum(self.highest - self.lowest + _BEYOND, _LEAST)
        return self.lowest - reach, self.highest + reach
