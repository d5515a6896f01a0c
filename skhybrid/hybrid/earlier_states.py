"""The two-stage scheme as it was some days ago, from which kept rows are forecast as they follow the training."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from .._table import ZoneTable, append_tables, concatenate_tables, last_rows
from .._time import rows_per_day
from .hourly_aggregation import HourlyAggregation
from .known_rows import KnownRows
from .scheme import Scheme
from .weekly_refit import WeeklyRefit

_MOST_EARLIER = 4  # states of some days ago that are remembered


class _Start(NamedTuple):
    """Knowledge of a scheme before the first row from which it has not learned."""

    rolling: Any  # state of the filter
    aggregation: HourlyAggregation
    n_rows: int


class EarlierStates(Scheme):
    """Base of a scheme whose filter and steps are remembered as they were."""

    _aggregation: HourlyAggregation
    _refit: WeeklyRefit

    def _begin(self) -> Self:
        """Remember where rows begin from which nothing was learned."""
        self._start = _Start(self.gray_box_.filtered_network_.rolling, self._aggregation, self.rows.n_rows)
        #: number of known rows -> the scheme as it was then
        self._earlier: dict[int, Self] = {}
        self._settled = False  # whether all steps up to an origin are ones that were taken in
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_earlier": {}}

    def _before(self, table: ZoneTable, origins: np.ndarray) -> tuple[Scheme, ZoneTable, int]:
        n_since = self.rows.n_rows - table.n_history + int(origins.min(initial=table.n_history)) - self._start.n_rows
        if n_since < 0:
            return super()._before(table, origins)
        per_day = rows_per_day(table.step)  # by days, so that one serves many forecasts
        scheme = self._as_of(self._start.n_rows + n_since // per_day * per_day)
        later = last_rows(self.rows.tables, self.rows.n_rows - scheme.rows.n_rows)
        following = concatenate_tables([later, table.rows(slice(table.n_history, None))])
        earlier = append_tables(scheme.rows.end(), following)
        return scheme, earlier, earlier.n_rows - table.n_rows

    def _as_of(self, n_rows: int) -> Self:
        """The scheme as it was when it knew so many rows; what it has learned stays."""
        found = max((n for n in self._earlier if n <= n_rows), default=None)
        scheme = self._as_it_began() if found is None else self._earlier[found]
        if n_rows > scheme.rows.n_rows:
            later = last_rows(self.rows.tables, self.rows.n_rows - scheme.rows.n_rows)
            scheme = scheme.advanced(later.rows(slice(0, n_rows - scheme.rows.n_rows)))
        self._earlier[n_rows] = scheme
        while len(self._earlier) > _MOST_EARLIER:
            del self._earlier[next(iter(self._earlier))]
        return scheme._with(adapt=self.adapt, _refit=self._refit, _settled=True)

    def _as_it_began(self) -> Self:
        start, gray_box = self._start, copy(self.gray_box_)
        gray_box.filtered_network_ = replace(gray_box.filtered_network_, rolling=start.rolling)
        rows = KnownRows.of(self.rows.whole().rows(slice(0, start.n_rows)))
        return self._with(gray_box_=gray_box, rows=rows, _aggregation=start.aggregation, _seen_since=False, _earlier={})
