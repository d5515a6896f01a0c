"""Ratios of the errors of two models at the same origins, with bootstrap intervals."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from _forecast_store import Errors

#: errors within one spell of weather or absence are correlated, so they are drawn together
BLOCK = pd.Timedelta("3D")
N_DRAWS, LEVEL = 2000, 0.90


class Ratio(NamedTuple):
    """A ratio of root mean squared errors."""

    value: float
    low: float  # of the 90 % interval
    high: float
    draws: np.ndarray  # (N_DRAWS,) bootstrap draws

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def drawn_rows(n: int, length: int, n_draws: int, rng: np.random.Generator) -> np.ndarray:
    """(n_draws, n) origins drawn in blocks of ``length`` consecutive ones; the last is followed by the first."""
    starts = rng.integers(n, size=(n_draws, -(-n // length)))
    rows = starts[:, :, None] + np.arange(min(length, n))
    return rows.reshape(n_draws, -1)[:, :n] % n


@lru_cache(maxsize=64)
def draw_counts(n: int, length: int, seed: int) -> np.ndarray:
    """(N_DRAWS, n) how often each draw contains each origin; a product with it sums over a draw."""
    rows = drawn_rows(n, length, N_DRAWS, np.random.default_rng(seed))
    flat = (rows + n * np.arange(N_DRAWS)[:, None]).ravel()
    return np.bincount(flat, minlength=N_DRAWS * n).reshape(N_DRAWS, n).astype(np.float64)


def blocks_of(origin: pd.Index) -> int:
    """Number of consecutive origins in a block."""
    stamps = pd.to_datetime(pd.Series(origin), utc=True)
    return max(1, round(BLOCK / stamps.diff().median()))


def paired(mine: Errors, other: Errors) -> tuple[np.ndarray, np.ndarray, pd.Index]:
    """Sums of squared errors (n,) of two models at their common origins.

    Raises
    ------
    ValueError
        If the two models were not compared with the same measurements.
    """
    common = mine.origin[mine.origin.isin(other.origin)]
    rows = [errors.origin.get_indexer(common) for errors in (mine, other)]
    if not np.array_equal(mine.count[rows[0]], other.count[rows[1]]):
        raise ValueError("two models have forecasts of different rows; run both again.")
    return mine.square[rows[0]].sum(axis=1), other.square[rows[1]].sum(axis=1), common


def ratio(mine: Sequence[Errors], other: Sequence[Errors], key: str) -> Ratio:
    """Ratio of the errors of two models over realisations, each of which is drawn separately.

    Parameters
    ----------
    mine, other : sequence of Errors
        One per realisation (seed); a single one is used for all.
    key : str
        Data sets with the same key (a building and its season) draw the same origins, because they share their weather.
    """
    size = max(len(mine), len(other))
    sums, draws = np.zeros(2), np.zeros((2, N_DRAWS))
    for i in range(size):
        first, second, origin = paired(mine[i % len(mine)], other[i % len(other)])
        counts = draw_counts(len(origin), blocks_of(origin), zlib.crc32(f"{key} {i}".encode()))
        for j, squares in enumerate((first, second)):
            sums[j] += squares.sum()
            draws[j] += counts @ squares
    return with_interval(float(np.sqrt(sums[0] / sums[1])), np.sqrt(draws[0] / draws[1]))


def geometric_mean(ratios: Sequence[Ratio]) -> Ratio:
    """The geometric mean of ratios; its draws are those of the ratios, combined."""
    value = np.exp(np.mean([np.log(r.value) for r in ratios]))
    return with_interval(float(value), np.exp(np.mean([np.log(r.draws) for r in ratios], axis=0)))


def with_interval(value: float, draws: np.ndarray) -> Ratio:
    """A ratio with the percentile interval of its draws."""
    low, high = np.quantile(draws, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return Ratio(value, float(low), float(high), draws)
