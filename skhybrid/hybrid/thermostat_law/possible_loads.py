"""Loads that a plant can have, by those of its training."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ...control import Band
from .law_features import LawRows

_STEP, _OFTEN = 1.01, 0.05  # loads up to so many times the least one are a step, if a plant that runs has it so often
_RARE = 0.001  # share of the rows in which a plant ran that counts as none


class PossibleLoads(NamedTuple):
    """Of a switched plant: none or at least its first step, and no cooling where heating is nearer, nor the reverse."""

    least: tuple[float, float]  # first step of cooling and of heating [kW], both positive; 0 where there are no steps
    keeps: tuple[bool, bool]  # whether it is switched, and cooled, and heated, only rooms nearer to that set-point

    @classmethod
    def of(cls, rows: LawRows) -> Self:
        """By the loads that were measured; a plant that modulates, often one of several rooms, may have any."""
        loads, ends = (-rows.heat, rows.heat), np.append(rows.T[1:], np.nan)
        far = _nearer_to_other(rows.band, np.fmin(rows.T, ends), np.fmax(rows.T, ends))
        known = np.isfinite(rows.band.cooling - rows.band.heating)
        least = [_first_step(load[load > 0.0]) if (rows.heat == 0.0).any() else 0.0 for load in loads]
        switched = max(least) > 0.0
        keeps = [switched and _never(off[known & (load > 0.0)]) for load, off in zip(loads, far, strict=True)]
        return cls((least[0], least[1]), (keeps[0], keeps[1]))

    def nearest(
        self, loads: np.ndarray, band: Band, begin: float, lowest: np.ndarray, highest: np.ndarray
    ) -> np.ndarray:
        """The nearest possible loads (L, n) [kW] for set-points (L,) and a range of temperatures (L,) [degC].

        The temperatures are those at the ends of the rows; the first row begins with a known one.
        """
        lowest = np.fmin(lowest, np.append(begin, lowest[:-1]))
        highest = np.fmax(highest, np.append(begin, highest[:-1]))
        far = _nearer_to_other(band, lowest, highest)
        rests = [keeps & off for keeps, off in zip(self.keeps, far, strict=True)]
        loads = np.clip(loads, np.where(rests[0], 0.0, -np.inf)[:, None], np.where(rests[1], 0.0, np.inf)[:, None])
        least, size = np.where(loads < 0.0, *self.least), np.abs(loads)
        return np.where(size < 0.5 * least, 0.0, np.copysign(np.maximum(size, least), loads))


def _nearer_to_other(band: Band, lowest: np.ndarray, highest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(L,) whether rooms with these temperatures are nearer to the other set-point than cooling, and than heating."""
    with np.errstate(invalid="ignore"):  # without set-points no room is
        middle = 0.5 * (band.heating + band.cooling)
    return highest < middle, lowest > middle


def _first_step(loads: np.ndarray) -> float:
    """The least of the loads of a plant that runs, where it often has that one; else 0."""
    least = float(loads.min(initial=np.inf))
    return least if (loads <= _STEP * least).sum() > _OFTEN * len(loads) else 0.0


def _never(happened: np.ndarray) -> bool:
    """True where something hardly ever happened, in rows of which there are any."""
    return len(happened) > 0 and bool(happened.mean() <= _RARE)
