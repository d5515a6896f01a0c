"""Weekly refits of a thermostat's law, at dates that do not depend on how much of the history is kept."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np

from ...control import LoadPaths
from .law_features import LawRows
from .plant_law import LawPairs, PlantLaw, learn, make_pairs

WEEKS = 8  # weeks of history that a refit learns from, at most
_REFIT_DAYS = 7
_HISTORY_WEIGHT = 2.0  # of a pair of the history, relative to one of the training
_MOST_REFITS = 12  # refits that are kept


class Weeks(NamedTuple):
    """Weeks since the training, whose first begins at row ``zero`` of a table (before it where negative)."""

    zero: int
    begin: int  # the first row that the training has not seen
    per_day: int

    @property
    def length(self) -> int:
        """Rows of a week."""
        return _REFIT_DAYS * self.per_day

    def numbers(self, origins: np.ndarray) -> np.ndarray:
        """The week of each origin."""
        return (origins - self.zero) // self.length

    def origins(self, first: int, stop: int, spacing: int) -> np.ndarray:
        """Origins every ``spacing`` rows from the first week on, within first ... stop - 1."""
        return np.arange(first + (self.zero - first) % spacing, stop, spacing)

    def learning_origins(self, number: int, spacing: int) -> np.ndarray:
        """Origins whose paths a week's law learns from."""
        span = self.learned_from(number)
        if span is None:
            return np.empty(0, dtype=np.int64)
        return self.origins(max(self.begin, self.zero + span[0] * self.length), span[1], spacing)

    def learned_from(self, number: int) -> tuple[int, int] | None:
        """First week and last row of the history known at the beginning of a week; None where it is too short."""
        complete = -(-(self.begin - self.zero - self.per_day) // self.length)  # a first week may lack a day
        first = max(complete, number - WEEKS)
        return None if first >= number else (first, self.zero + number * self.length)


class LawRefits:
    """The law of the training, and those of later weeks, each of which is learned once."""

    def __init__(self, law: PlantLaw, pairs: LawPairs) -> None:
        self.law, self._pairs = law, pairs
        self._found: dict[tuple[int, bytes], PlantLaw] = {}

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_found": {}}

    def known(self, rows: LawRows, weeks: Weeks, numbers: np.ndarray) -> dict[int, PlantLaw | None]:
        """The laws of some weeks; None where one has yet to be learned."""
        keys = {int(number): _key(rows, weeks, int(number)) for number in numbers}
        return {number: self.law if key is None else self._found.get(key) for number, key in keys.items()}

    def learn(
        self, rows: LawRows, weeks: Weeks, numbers: list[int], spacing: int, ideal: IdealPaths
    ) -> dict[int, PlantLaw]:
        """Learn the laws of some weeks from the training and what was known at the beginning of each."""
        found, made = {}, {}
        for number in numbers:
            own = weeks.learning_origins(number, spacing)
            new = make_pairs(rows, own, ideal.of(own), weeks.zero + number * weeks.length + 1)
            new = new._replace(ends=new.ends - weeks.zero)  # the blocks of the cross-fitting go by these
            weight = np.repeat([1.0, _HISTORY_WEIGHT], [len(self._pairs.ends), len(new.ends)])
            found[number] = learn(self._pairs.joined_with(new), weeks.per_day, weight)
            key = _key(rows, weeks, number)
            assert key is not None
            made[key] = found[number]
        self._found = dict(list({**self._found, **made}.items())[-_MOST_REFITS:])
        return found


def _key(rows: LawRows, weeks: Weeks, number: int) -> tuple[int, bytes] | None:
    """A key of the law of a week: the rows that it learns from; None for that of the training."""
    span = weeks.learned_from(number)
    if span is None:
        return None
    # the first day of these may be missing
    of = slice(max(weeks.zero + span[0] * weeks.length + weeks.per_day, 0), span[1])
    read = (rows.T, rows.heat, *rows.band, rows.weather, *rows.beside)
    return number, hashlib.sha256(b"".join(np.ascontiguousarray(part[of]).tobytes() for part in read)).digest()


class IdealPaths(NamedTuple):
    """The network's ideal paths from increasing origins."""

    origins: np.ndarray
    paths: LoadPaths

    def of(self, origins: np.ndarray) -> LoadPaths:
        """The paths from some of the origins."""
        return self.paths.rows(np.searchsorted(self.origins, origins))
