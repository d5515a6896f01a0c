"""The capacity of a plant, by what was measured of it and whether its set-point was met."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np

from ..._table import ZoneTable, plant_roles
from ...control import Limits
from ..scheme import Scheme
from .law_features import LawRows

_WIDER = 1.03  # loads may be so much larger than the largest known of a plant that was at its limit
_UNSEEN = 2.0  # of one that was not, by how many times it may grow, over the number of days on which it was so large
_USUAL = 1.1  # of one whose limit is not told, as usual temperatures stand for its set-points
_FULL, _MISSED = 0.9, 0.1  # share of the largest heat, and distance from the set-point [K], that show a limit
_LEAST_ROWS, _PER_DAY = 2, 48  # that it must last: so many rows, and half an hour; a jump of set-points takes one row


class _Days(NamedTuple):
    """Heating, or cooling, of days before some origins."""

    most: np.ndarray  # (O, D) largest heat of each day [kW]
    missed: np.ndarray  # (O, D) largest that did not drop while the set-point was missed row after row

    def largest(self) -> np.ndarray:
        """(O,) largest heat of all days."""
        return np.asarray(self.most.max(axis=1, initial=0.0))

    def followed_by(self, since: _Days) -> _Days:
        """These days, which are the same before each origin, and those that came since."""
        n, pairs = len(since.most), zip(self, since, strict=True)
        return _Days(*(np.hstack([np.broadcast_to(of, (n, of.shape[1])), new]) for of, new in pairs))


class PlantCapacity:
    """The least and most heat of a plant [kW]: by full stages, or by the heat that was measured.

    It is little more than the largest where the set-point stayed missed under that, as then the plant was at its limit.
    Else a deeper set-back or a colder day may ask for more than was ever measured, and get it; less so the more days
    came near the largest.
    """

    def __init__(
        self, stages: tuple[float, float] | None, training: tuple[_Days, ...] = (), is_usual: bool = False
    ) -> None:
        self._stages, self._training, self._is_usual = stages, training, is_usual

    @classmethod
    def of(cls, scheme: Scheme, training: ZoneTable, rows: LawRows, is_usual: bool = False) -> Self:
        """Of the plant of a training, of whose set-points some may be usual temperatures."""
        stages, roles = scheme.stages(), plant_roles(training.inputs)
        if set(roles) - set(stages):
            return cls(None, _days(rows, 0, np.array([training.n_rows])), is_usual)
        off = training.rows(slice(0, 1))
        off = off.replace(inputs={**off.inputs, **dict.fromkeys(roles, np.zeros(1))})
        full = [off.replace(inputs={**off.inputs, role: np.array([stages[role]])}) for role in roles]
        each = [float(scheme.plant_heat(one)[0]) for one in full]
        return cls((sum(min(h, 0.0) for h in each), sum(max(h, 0.0) for h in each)))

    @property
    def acts(self) -> tuple[bool, bool]:
        """Whether the plant heated, and cooled, in the training."""
        if self._stages is not None:
            return self._stages[1] > 0.0, self._stages[0] < 0.0
        cooling, heating = (bool((side.most > 0.0).any()) for side in self._training)
        return heating, cooling

    def at(self, rows: LawRows, begin: int, origins: np.ndarray) -> Limits:
        """The least and most heat (O,) as known at origins, by the training and the rows from ``begin`` on."""
        return self._limits(rows, begin, origins, self._most)

    def seen(self, rows: LawRows, begin: int, origins: np.ndarray) -> Limits:
        """The least and most heat (O,) that was measured before origins; of stages what they can give."""
        return self._limits(rows, begin, origins, _Days.largest)

    def _limits(self, rows: LawRows, begin: int, origins: np.ndarray, most: Callable[[_Days], np.ndarray]) -> Limits:
        """Limits (O,) of full stages; else the ``most`` of each side by the days of the training and since."""
        if self._stages is not None:
            return Limits.constant(*self._stages, len(origins))
        sides = zip(self._training, _days(rows, begin, origins), strict=True)
        cooling, heating = (most(training.followed_by(since)) for training, since in sides)
        return Limits(-cooling, heating)

    def _most(self, days: _Days) -> np.ndarray:
        """The most heat (O,) on one side."""
        largest = days.largest()
        large = _FULL * largest[:, None]
        growth = 1.0 + _UNSEEN / np.maximum((days.most >= large).sum(axis=1), 1)
        growth[(days.missed >= large).any(axis=1)] = 1.0
        return largest * (_USUAL if self._is_usual else np.maximum(growth, _WIDER))


def _days(rows: LawRows, begin: int, origins: np.ndarray) -> tuple[_Days, ...]:
    """Days of cooling and of heating, by the rows from ``begin`` on that are known at each origin."""
    heat, T = rows.heat[begin:], np.append(rows.T[begin + 1 :], np.nan)  # at the end of each row
    above, below = T - rows.band.cooling[begin:], rows.band.heating[begin:] - T
    n_days = max(-(-(int(origins.max(initial=begin)) - begin) // rows.per_day), 0)
    known = np.clip((origins - begin)[:, None] - rows.per_day * np.arange(n_days), 0, rows.per_day)

    def largest(values: np.ndarray) -> np.ndarray:
        padded = np.zeros(n_days * rows.per_day)
        padded[: len(values)] = values[: len(padded)]
        rising = np.maximum.accumulate(padded.reshape(n_days, rows.per_day), axis=1)
        return np.column_stack([np.zeros(n_days), rising])[np.arange(n_days), known]

    def lasting(values: np.ndarray) -> np.ndarray:
        n_rows = max(_LEAST_ROWS, rows.per_day // _PER_DAY)
        return np.minimum.reduce([np.append(np.zeros(i), values)[: len(values)] for i in range(n_rows)])

    return tuple(
        _Days(largest(side), largest(lasting(np.where(by > _MISSED, side, 0.0))))
        for side, by in ((-heat, above), (heat, below))
    )
