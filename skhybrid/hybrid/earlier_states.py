"""The two-stage scheme as it was some days ago, from which kept rows are forecast, and loads from many origins."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from .._table import ZoneTable, append_tables, concatenate_tables, last_rows
from .._time import rows_per_day
from ..control import Limits, LoadPaths, WantedPaths, heat_column
from .hourly_aggregation import HourlyAggregation
from .known_rows import KnownRows
from .scheme import LoadsFrom, Scheme
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
        self._settled = False  # whether all rows up to an origin were taken in, so that its steps do not change
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_earlier": {}}

    def _before(self, table: ZoneTable, origins: np.ndarray) -> tuple[Self, ZoneTable, int]:
        """The scheme as it was before origins in a table's history, and all rows that follow those it knew then.

        The third value is the number of rows by which the origins move.  Where an origin lies within the training, it
        is this scheme, and the table stands alone.
        """
        n_since = self.rows.n_rows - table.n_history + int(origins.min(initial=table.n_history)) - self._start.n_rows
        if n_since < 0:
            return self, table.replace(n_history=0), 0
        per_day = rows_per_day(table.step)  # by days, so that one serves many forecasts
        scheme = self._as_of(self._start.n_rows + n_since // per_day * per_day)
        later = last_rows(self.rows.tables, self.rows.n_rows - scheme.rows.n_rows)
        following = concatenate_tables([later, table.rows(slice(table.n_history, None))])
        earlier = append_tables(scheme.rows.end(), following)
        return scheme, earlier, earlier.n_rows - table.n_rows

    def _as_of(self, n_rows: int) -> Self:
        """The scheme as it was when it knew so many rows; what it has learned stays."""
        found = max((n for n in self._earlier if n <= n_rows), default=None)
        scheme = self._at_training_end() if found is None else self._earlier[found]
        if n_rows > scheme.rows.n_rows:
            later = last_rows(self.rows.tables, self.rows.n_rows - scheme.rows.n_rows)
            scheme = scheme.advanced(later.rows(slice(0, n_rows - scheme.rows.n_rows)))
        self._earlier[n_rows] = scheme
        while len(self._earlier) > _MOST_EARLIER:
            del self._earlier[next(iter(self._earlier))]
        return scheme._with(adapt=self.adapt, _refit=self._refit, _settled=True)

    def _at_training_end(self) -> Self:
        start, gray_box = self._start, copy(self.gray_box_)
        gray_box.filtered_network_ = replace(gray_box.filtered_network_, rolling=start.rolling)
        rows = KnownRows.of(self.rows.whole().rows(slice(0, start.n_rows)))
        return self._with(gray_box_=gray_box, rows=rows, _aggregation=start.aggregation, _seen_since=False, _earlier={})

    def load_paths_from(self, table: ZoneTable, origins: np.ndarray) -> LoadsFrom:
        def paths(chosen: np.ndarray, n_leads: int, wanted: WantedPaths) -> LoadPaths:
            out = LoadPaths(*np.full((3, len(chosen), n_leads), np.nan))
            kept = chosen < table.n_history
            for part in (kept, ~kept):
                scheme, rows, moved = self._before(table, chosen[kept]) if part is kept else (self, table, 0)
                own = wanted._replace(band=wanted.band.moved(moved))
                for group in spans_apart(chosen, np.flatnonzero(part), n_leads + 1):
                    scheme._fill(out, group, rows, chosen + moved, own)
            return out

        return paths

    def _fill(
        self, out: LoadPaths, group: np.ndarray, table: ZoneTable, origins: np.ndarray, wanted: WantedPaths
    ) -> None:
        """Write the paths of origins that lie so far apart that one call of ``required_heat`` has them all."""
        n_leads, begin, own = out.heat.shape[1], table.n_history, origins[group]
        # no start comes after the last wanted one: rows from there on may be unknown, and a refit on them would be kept
        table = table.rows(slice(None, min(table.n_rows, int(own[-1]) + n_leads + 1)))
        n = table.n_rows
        # a path ends where the next one starts: more starts keep paths short, but none may lie within a wanted path
        between = np.arange(begin, n, n_leads + 1)
        since = between[:, None] - own
        starts = np.union1d(own, between[~((since > 0) & (since <= n_leads)).any(axis=1)])
        band, within = wanted.band.rows(slice(begin, n)), Limits.constant(-np.inf, np.inf, n - begin)
        for side, limit in zip(within, wanted.limits, strict=True):
            for i in group:
                side[origins[i] - begin :][:n_leads] = limit[i]
            if wanted.delivered is not None:
                side[own - begin] = wanted.delivered[group]
        found = self.required_heat(table, starts, band, within)
        load = found[[heat_column(found), "T_za", "zeta"]].to_numpy().T
        for i in group:
            rows = np.minimum(origins[i] - begin + np.arange(n_leads), n - begin - 1)
            out.heat[i], out.zeta[i] = load[0, rows], load[2, rows]
            out.temperature[i] = load[1, np.minimum(rows + 1, n - begin - 1)]


def spans_apart(origins: np.ndarray, chosen: np.ndarray, least: int) -> list[np.ndarray]:
    """Groups of the ``chosen`` among origins; in each of them they lie at least so many rows apart."""
    groups: list[list[int]] = []
    for i in sorted(chosen, key=lambda i: origins[i]):
        place = next((group for group in groups if origins[i] - origins[group[-1]] >= least), None)
        if place is None:
            groups.append([i])
        else:
            place.append(i)
    return [np.array(group) for group in groups]
