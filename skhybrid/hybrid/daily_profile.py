"""Mean temperature by step of the day and type of day, as it was known at each of the last rows."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable

_A_MIDNIGHT = pd.Timestamp(0)
_KEPT = 0.5 ** (1.0 / 7.0)  # a day counts half after a week


class ProfileRows(NamedTuple):
    """Rows that are known by their numbers from ``first`` on."""

    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    seen: np.ndarray  # (n_rows,) int, the last row with a measurement, -1 where there is none
    place: np.ndarray  # (n_rows,) int, steps of the local clock since a midnight
    weekend: np.ndarray  # (n_rows,) int, 1 on weekends and holidays
    first: int

    @classmethod
    def of(cls, table: ZoneTable, T: np.ndarray, first: int = 0) -> Self:
        seen = np.maximum.accumulate(np.where(np.isfinite(T), np.arange(len(T)), -1))
        place = ((table.time - _A_MIDNIGHT) // table.step).to_numpy()
        return cls(T, seen, place, table.weekend.astype(np.int64), first)


class MeanDay:
    """Mean temperature of the days so far, ``mean`` where there is none."""

    def __init__(self, per_day: int, mean: float) -> None:
        self._per_day, self._mean = per_day, mean
        self._last = -1  # the last place
        #: (n, 2, 2) sum and number of measurements up to each of the last places at its step of the day, by type of day
        self._sums = np.zeros((per_day, 2, 2))

    def starting_at(self, place: int) -> MeanDay:
        """A mean day that has seen the same and is to go through rows from a place on."""
        other, moved = copy(self), self._last + 1 - place
        if moved:
            other._last, other._sums = place - 1, np.roll(self._sums[-self._per_day :], moved, axis=0)
        return other

    def extend(self, rows: ProfileRows, begin: int, end: int) -> None:
        """Take in the rows from ``begin`` on, before ``end``."""
        chosen = slice(begin - rows.first, end - rows.first)
        T, place, weekend = rows.T[chosen], rows.place[chosen], rows.weekend[chosen]
        n, day = len(self._sums), self._per_day
        at = place - self._last - 1 + n
        new = np.isfinite(T) & (at >= n)  # the hour that comes twice in autumn counts once
        sums = np.concatenate([self._sums, np.zeros((max(int(at.max(initial=0)) + 1 - n, 0), 2, 2))])
        sums[at[new], 0, weekend[new]], sums[at[new], 1, weekend[new]] = T[new], 1.0
        for k in range(n, len(sums), day):
            sums[k : k + day] += _KEPT * sums[k - day : min(k, len(sums) - day)]
        self._sums, self._last = sums, self._last + len(sums) - n

    def forget(self, n_places: int) -> None:
        """Drop what is older than some places and two days."""
        self._sums = self._sums[-n_places - 2 * self._per_day :]

    def at(self, rows: ProfileRows, chosen: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Mean of the days up to the places ``known``, at chosen rows: of their type of day, else of any."""
        place, weekend = rows.place[chosen], rows.weekend[chosen]
        day = self._per_day
        total, count = np.moveaxis(self._sums[place + (known - place) // day * day - self._last - 1], -2, 0)
        own = np.eye(2, dtype=bool)[weekend]
        alike = own | ~(count > 0.0)[own].reshape(weekend.shape)[..., None]
        total, count = np.sum(total * alike, axis=-1), np.sum(count * alike, axis=-1)
        return np.where(count > 0.0, total / np.where(count > 0.0, count, 1.0), self._mean)
