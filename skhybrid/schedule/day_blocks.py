"""Blocks of days of the training, which are left out in turn."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..filtering import ForecastSample
from .constrained_ridge import gram

_DAY = 24.0
_MOST_BLOCKS, _LEAST_BLOCKS = 6, 3  # numbers of blocks of days that are left out in turn


def blocks_of_days(sample: ForecastSample, step: float) -> np.ndarray:
    """(O,) block of days of each origin: weeks where there are enough; a single block where none can be left out."""
    hours = (sample.origins - sample.origins[:1]) * step
    days = hours.max(initial=0.0) / _DAY
    length = max(1.0, min(7.0, days / _MOST_BLOCKS)) if days < 7.0 * _LEAST_BLOCKS else 7.0
    count = max(1, round(days / length))
    if count < _LEAST_BLOCKS:
        return np.zeros(len(hours), dtype=np.int64)
    return np.minimum((hours / _DAY / length).astype(np.int64), count - 1)


def can_leave_out(blocks: np.ndarray) -> bool:
    """Whether there is more than one block of days, so that one can be left out."""
    return bool(len(blocks) and blocks.max())


def block_grams(E: np.ndarray, sample: ForecastSample, blocks: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Sums of products (J, J) of each block of days, and of the forecasts that touch none of its days.

    ``E`` (O L, J) are rows of the forecasts of a sample, ``blocks`` (O,) the block of each origin, in their order.
    """
    by_origin = E.reshape(len(blocks), -1, E.shape[1])

    def gram_between(begin: int, end: int) -> np.ndarray:
        return gram(by_origin[begin:end].reshape(-1, E.shape[1]))

    edges = np.searchsorted(blocks, np.arange(blocks.max() + 2)).tolist()
    # forecasts from just before a block have their targets in it
    longest = int(sample.leads[-1])
    meeting = np.searchsorted(sample.origins, sample.origins[edges[:-1]] - longest, side="right").tolist()
    grams = [gram_between(*ends) for ends in pairwise(edges)]
    total = np.sum(grams, axis=0)
    into = [gram_between(first, begin) for first, begin in zip(meeting, edges, strict=False)]
    return [(own, total - own - before) for own, before in zip(grams, into, strict=True)]
