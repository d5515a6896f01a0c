"""Blends at rows that forecasts went through, from which later forecasts go on."""

from __future__ import annotations

from typing import Self

from .rolling_blend import RollingBlend

_MOST_EARLIER = 4  # blends at rows some weeks ago


class KeptBlends:
    """Blends by what they adapt; none of them is ever changed.

    ``trained`` are those at the last training row, ``running`` those as far as the last forecast from a last known row
    went.  Others lie some weeks back, where the forecasts begin whose errors tell how wide an interval is.
    """

    def __init__(self) -> None:
        self.trained: dict[str | None, RollingBlend] = {}
        self.running: dict[str | None, RollingBlend] = {}
        self._earlier: dict[tuple[str | None, int], RollingBlend] = {}

    def fork(self) -> Self:
        """The same for a scheme that goes on by itself; what the training gives is shared."""
        made = type(self)()
        made.trained, made.running, made._earlier = self.trained, dict(self.running), dict(self._earlier)
        return made

    def last_before(self, adapt: str | None, row: int) -> RollingBlend:
        """The last one that is not beyond a row; the one of the training where all are."""
        found = self.trained[adapt]
        kept = [blend for (of, _), blend in self._earlier.items() if of == adapt]
        for blend in (*kept, self.running.get(adapt, found)):
            if found.row < blend.row <= row:
                found = blend
        return found

    def keep(self, blend: RollingBlend) -> None:
        """Keep one for forecasts of later days, and forget the oldest of many."""
        self._earlier[blend.adapt, blend.row] = blend
        while len(self._earlier) > _MOST_EARLIER:
            del self._earlier[next(iter(self._earlier))]
