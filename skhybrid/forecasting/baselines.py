"""The baselines that any claim must be measured against: hour-of-week mean, last week, persistence, 0."""

from __future__ import annotations

from typing import Self

import numpy as np

from .._calendar import N_CELLS, day_type_hour, slot_of_day
from .._last_known import carried_forward
from .._table import ZoneTable
from .._time import rows_per_day
from .features import clock_changes, held_target_rows, last_same_slot, target_rows

SAME_KIND_DAYS = 14  # days before an origin in which the last one of a kind is looked for
MIN_COUNT = 2  # a mean over fewer values than this is left to the next coarser one


def _means(levels: np.ndarray, target: np.ndarray, n_levels: int, fallback: np.ndarray) -> np.ndarray:
    """Mean of the known targets of each level, the fallback where a level has fewer than MIN_COUNT."""
    known = np.isfinite(target)
    counts = np.bincount(levels[known], minlength=n_levels)
    sums = np.bincount(levels[known], weights=target[known], minlength=n_levels)
    return np.where(counts >= MIN_COUNT, sums / np.maximum(counts, 1), fallback)


def means_by_hour(table: ZoneTable, target: np.ndarray) -> np.ndarray:
    """(48,) mean of the known targets by hour and kind of day, that of all where an hour has fewer than MIN_COUNT."""
    return _means(day_type_hour(table), target, N_CELLS, np.full(N_CELLS, np.nanmean(target)))


class WeeklyProfile:
    """``"profile"``: the mean by hour (or step) of week, else by hour of weekday or weekend, else of all."""

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Average the training target."""
        slots, self.n_slots_ = slot_of_day(table.time, table.step), rows_per_day(table.step)
        by_hour = means_by_hour(table, target)
        hours = np.floor(np.arange(self.n_slots_) * 24.0 / self.n_slots_ + 1e-9).astype(np.int64)
        day_types = np.repeat([0, 0, 0, 0, 0, 24, 24], self.n_slots_)
        fallback = by_hour[np.tile(hours, 7) + day_types]
        levels = table.day_of_week * self.n_slots_ + slots
        self.profile_ = _means(levels, target, 7 * self.n_slots_, fallback)
        return self

    def expected(self, table: ZoneTable) -> np.ndarray:
        """Expectation of each row when no past disturbance is known: the profile."""
        return self.profile_[table.day_of_week * self.n_slots_ + slot_of_day(table.time, table.step)]

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """The profile at each row ahead, whatever the past."""
        return self.expected(table)[held_target_rows(table, origins, n_leads)]


class NoDisturbance:
    """``"none"``: 0, what the paper's conventional approach expects."""

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        return self

    def expected(self, table: ZoneTable) -> np.ndarray:
        return np.zeros(table.n_rows)

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        return np.zeros((len(origins), n_leads))


class LastWeek(WeeklyProfile):
    """``"last_week"``: the value seven days before, else the last known one of that time of day, else the profile.

    Days and times of day are those of the local clock.  With holidays the first is that of the last known day of
    the same kind: of a Sunday for a holiday.
    """

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        zeta, rows = table.measured("zeta"), target_rows(origins, n_leads)
        per_day, changes = rows_per_day(table.step), clock_changes(table)
        out = last_same_slot(zeta, rows, origins, 7 * per_day, 1, changes)
        if table.holidays:
            day = table.day_of_week
            ahead = day[held_target_rows(table, origins, n_leads)]
            for kind in np.unique(ahead):
                of_kind = np.where(day == kind, zeta, np.nan)
                alike = last_same_slot(of_kind, rows, origins, per_day, SAME_KIND_DAYS, changes)
                out = np.where(ahead == kind, alike, out)
        out = np.where(np.isnan(out), last_same_slot(zeta, rows, origins, per_day, 7, changes), out)
        return np.where(np.isnan(out), super().forecast(table, origins, n_leads), out)


class Persistence(WeeklyProfile):
    """``"persistence"``: the last known value at or before the origin, at all leads; else the profile."""

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        last = carried_forward(table.measured("zeta"))[origins, None]
        return np.where(np.isnan(last), super().forecast(table, origins, n_leads), last)
