"""Mean temperature by step of the day and type of day, as it was known at each of the last rows."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ..._last_known import last_known_row
from ..._shallow import shallow_copy
from ..._table import ZoneTable

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
        place = table.time.as_unit("ns").asi8 // table.step.value  # the epoch is a midnight
        return cls(T, last_known_row(np.isfinite(T)), place, table.weekend.astype(np.int64), first)


class MeanDay:
    """Mean temperature of the days so far by step of the day and type of day, of which a week ago counts half."""

    def __init__(self, per_day: int, mean: float, place: int) -> None:
        self._per_day, self._mean = per_day, mean  # the mean where no day is known
        self._last = place - 1  # the last place
        #: (n, 3, 2) weighted sum, weight and mean of the days up to each of the last places, by type of day
        self._days = np.zeros((per_day, 3, 2))
        self._days[:, 2] = mean

    def starting_at(self, place: int) -> MeanDay:
        """A copy that goes through rows from another place on."""
        other, moved = shallow_copy(self), self._last + 1 - place
        if moved:
            other._last, other._days = place - 1, np.roll(self._days[-self._per_day :], moved, axis=0)
        return other

    def extend(self, rows: ProfileRows, begin: int, end: int) -> None:
        """Take in the rows from ``begin`` on, before ``end``."""
        chosen = slice(begin - rows.first, end - rows.first)
        T, place, weekend = rows.T[chosen], rows.place[chosen], rows.weekend[chosen]
        n, day = len(self._days), self._per_day
        at = place - self._last - 1 + n
        # of the hour that comes twice in autumn the first counts, in however many calls the rows come
        new = np.isfinite(T) & (at > np.maximum.accumulate(np.append(n - 1, at[:-1])))
        days = np.concatenate([self._days, np.zeros((max(int(at.max(initial=0)) + 1 - n, 0), 3, 2))])
        days[at[new], 0, weekend[new]], days[at[new], 1, weekend[new]] = T[new], 1.0
        for k in range(n, len(days), day):
            days[k : k + day, :2] += _KEPT * days[k - day : min(k, len(days) - day), :2]
        total, weight = days[n:, 0], days[n:, 1]
        any_total, any_weight = total.sum(axis=1, keepdims=True), weight.sum(axis=1, keepdims=True)
        of_any = np.divide(any_total, any_weight, out=np.full_like(any_total, self._mean), where=any_weight > 0.0)
        days[n:, 2] = np.divide(total, weight, out=np.repeat(of_any, 2, axis=1), where=weight > 0.0)
        self._days, self._last = days, self._last + len(days) - n

    def forget(self, n_places: int) -> None:
        """Drop what is older than some places and two days."""
        self._days = self._days[-n_places - 2 * self._per_day :]

    def at(self, rows: ProfileRows, chosen: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Mean of the days up to the places ``known``, at chosen rows: of their type of day, else of any."""
        place, day = rows.place[chosen], self._per_day
        return self._days[place + (known - place) // day * day - self._last - 1, 2, rows.weekend[chosen]]
