"""Errors that past forecasts made together along a day, after which the samples of a forecast are ordered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from .._arguments import check_integer
from .._clock import hour_of_day
from .._last_known import held_paths
from .._time import wall_clock

_NEAR = 1.5  # hours of the day within which errors are drawn
_LEAST_DRAWN = 10  # forecasts from about that hour of the day, below which those of any are drawn


class JointErrors(NamedTuple):
    """Errors of past forecasts of one or several quantities: how long they last, and which come together."""

    values: np.ndarray  # (n_origins, n_leads, n_quantities) float16, of which the order counts
    hours: np.ndarray  # (n_origins,) hour of the day of each origin

    @classmethod
    def of(cls, errors: np.ndarray, index: pd.Index, origins: np.ndarray) -> Self | None:
        """Of forecasts (n_origins, n_leads, n_quantities) from some rows; None where there are none.

        An error that is not known is the last known one before it.
        """
        if not len(origins):
            return None
        values = np.stack([held_paths(of_one) for of_one in np.moveaxis(errors, -1, 0)], axis=-1)
        return cls(values.astype(np.float16), origin_hours(index)[origins])

    def samples(self, bands: Mapping[str, pd.DataFrame], hour: float, rng: np.random.RandomState) -> pd.DataFrame:
        """A row per sample and row ahead, by the quantiles (n_rows, n_samples) of each quantity."""
        paths = self.in_order(np.stack([band.to_numpy() for band in bands.values()], axis=-1), hour, rng)
        index = next(iter(bands.values())).index
        each = [pd.Index(range(len(paths)), name="sample"), index.rename(index.name or "time")]
        return pd.DataFrame(paths.reshape(-1, len(bands)), pd.MultiIndex.from_product(each), list(bands))

    def in_order(self, bands: np.ndarray, hour: float, rng: np.random.RandomState) -> np.ndarray:
        """(n_samples, n_rows, n_quantities) paths from as many quantiles of each row (n_rows, n_samples, n_quantities).

        Each has in every row the rank that the error of one past forecast from about that ``hour`` has among those
        that are drawn (the Schaake shuffle, Clark et al. 2004, J. Hydrometeorology 5, 243-262).  After the last lead
        its error holds on.
        """
        n_rows, n_samples, _ = bands.shape
        near = np.flatnonzero(np.abs((self.hours - hour + 12) % 24 - 12) <= _NEAR)
        near = near if len(near) >= _LEAST_DRAWN else np.arange(len(self.hours))
        leads = np.minimum(np.arange(n_rows), self.values.shape[1] - 1)
        drawn = self.values[rng.choice(near, n_samples)][:, leads]
        by_size = np.lexsort((rng.random_sample(drawn.shape), drawn), axis=0)  # equal errors, as of no load, by chance
        return np.take_along_axis(bands.swapaxes(0, 1), np.argsort(by_size, axis=0), axis=0)


def sample_levels(n_samples: int) -> list[float]:
    """Levels of the quantiles that many samples have in each row."""
    check_integer("n_samples", n_samples)
    return list((np.arange(n_samples) + 0.5) / n_samples)


def origin_hours(index: pd.Index) -> np.ndarray:
    """(n,) hour of the day, 0 without stamps."""
    if not isinstance(index, pd.DatetimeIndex):
        return np.zeros(len(index))
    return hour_of_day(wall_clock(index))
