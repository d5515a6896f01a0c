"""Loads that a plant can have, by those of its training."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ...control import Band
from .law_features import LawRows

_STEP, _OFTEN = 1.01, 0.05  # loads up to so many times the least one are a step, if a plant that runs has it so often
_RARE = 0.01  # share of the rows in which a plant ran that may be farther from its set-point than what counts
#: distance from its set-point in training up to which that of a plant is limited, and by which it may be farther [K]
_NEAR, _MARGIN = 1.0, 1.0


class PossibleLoads(NamedTuple):
    """No load or at least the least one, and heating and cooling only with a room that is near their set-point."""

    least: tuple[float, float]  # first step of cooling and of heating [kW], both positive; 0 where there are no steps
    reach: tuple[float, float]  # how far below the set-point of cooling, and above that of heating, one may be [K]

    @classmethod
    def of(cls, rows: LawRows) -> Self:
        """By the loads that were measured.

        A side may act anywhere if it was never used, has no set-points, or acted far from them, as ventilation
        does, and the plants of several rooms of which the mean is measured.
        """
        loads = -rows.heat, rows.heat
        ends = np.append(rows.T[1:], np.nan)
        off = _off(rows.band, np.fmin(rows.T, ends), np.fmax(rows.T, ends))
        least = [_first_step(load[load > 0.0]) if (rows.heat == 0.0).any() else 0.0 for load in loads]
        reach = [_farthest(by[load > 0.0]) for load, by in zip(loads, off, strict=True)]
        return cls((least[0], least[1]), (reach[0], reach[1]))

    def nearest(
        self, loads: np.ndarray, band: Band, begin: float, lowest: np.ndarray, highest: np.ndarray
    ) -> np.ndarray:
        """The nearest possible loads (L, n) [kW] for set-points (L,) and a range of temperatures (L,) [degC].

        The temperatures are those at the ends of the rows; the first row begins with a known one.
        """
        lowest = np.fmin(lowest, np.append(begin, lowest[:-1]))
        highest = np.fmax(highest, np.append(begin, highest[:-1]))
        cools, heats = (by <= reach for by, reach in zip(_off(band, lowest, highest), self.reach, strict=True))
        loads = np.clip(loads, np.where(cools, -np.inf, 0.0)[:, None], np.where(heats, np.inf, 0.0)[:, None])
        least, size = np.where(loads < 0.0, *self.least), np.abs(loads)
        return np.where(size < 0.5 * least, 0.0, np.copysign(np.maximum(size, least), loads))


def _off(band: Band, lowest: np.ndarray, highest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(L,) how far rooms with these temperatures are below the set-point of cooling, and above that of heating [K]."""
    return band.cooling - highest, lowest - band.heating


def _first_step(loads: np.ndarray) -> float:
    """The least of the loads of a plant that runs, where it often has that one; else 0."""
    least = float(loads.min(initial=np.inf))
    return least if (loads <= _STEP * least).sum() > _OFTEN * len(loads) else 0.0


def _farthest(off: np.ndarray) -> float:
    """How far rooms may be off a set-point [K], by how far they were."""
    known = off[np.isfinite(off)]
    farthest = float(np.quantile(known, 1.0 - _RARE)) if len(known) else np.inf
    return farthest + _MARGIN if farthest <= _NEAR else np.inf
