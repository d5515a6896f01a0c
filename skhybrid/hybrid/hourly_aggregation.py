"""Hourly aggregation: means of rows over the forecaster's steps, as the rows come in."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._holidays import NO_HOLIDAYS, Holidays
from .._table import ZoneTable
from .disturbance_steps import Steps, steps_table

_ROOM = 512  # complete steps for which there is room before a buffer is made longer


class _StepSums(NamedTuple):
    """Rows summed by steps: labels of the steps, and sums and counts of what is known in them."""

    labels: np.ndarray  # (n,) int, beginning of each step [ns]
    total: np.ndarray  # (n, p)
    known: np.ndarray  # (n, p)
    of_row: np.ndarray  # (n_rows,) step of every row

    @property
    def means(self) -> np.ndarray:
        """(n, p), NaN where nothing is known."""
        return np.where(self.known > 0, self.total / np.maximum(self.known, 1), np.nan)


class HourlyAggregation:
    """Complete steps of ``names``, the last of which is the disturbance, and the step that is still open.

    Stamps are rounded down to the step where rows are shorter (``fine``).
    """

    def __init__(
        self, names: list[str], step: pd.Timedelta, fine: bool, zone: object, holidays: Holidays = NO_HOLIDAYS
    ) -> None:
        self.names, self.step, self._holidays = names, step, holidays
        self._width = step.value if fine else 0
        self._zone = None if zone is None else str(zone)
        self._labels, self._means, self._n = np.empty(_ROOM, dtype=np.int64), np.empty((_ROOM, len(names))), 0
        self._written = [0]  # steps that the buffers hold, by whichever object that shares them
        self._open: _StepSums | None = None

    @property
    def labels(self) -> np.ndarray:
        """(n,) beginnings of the complete steps [ns]."""
        return self._labels[: self._n]

    def added(self, stamps: np.ndarray, rows: np.ndarray) -> HourlyAggregation:
        """These steps and rows (n, p) stamped (n,) [ns], in a time that does not depend on how many came before.

        The last row's step stays open.  Buffers are shared as long as one object alone goes on from here.
        """
        sums = self._joined(stamps, rows)
        done = len(sums.labels) - 1
        made = self._with_room(done)
        made._labels[self._n : self._n + done] = sums.labels[:-1]
        made._means[self._n : self._n + done] = sums.means[:-1]
        made._n += done
        made._written[0] = made._n
        made._open = _StepSums(sums.labels[-1:], sums.total[-1:].copy(), sums.known[-1:].copy(), np.zeros(1, np.int64))
        return made

    def since(self, label: int) -> HourlyAggregation:
        """Without the complete steps that begin before a label [ns]."""
        first = int(np.searchsorted(self.labels, label))
        made = copy(self)
        made._labels, made._means = self._labels[first : self._n].copy(), self._means[first : self._n].copy()
        made._n -= first
        made._written = [made._n]
        return made

    def extended(self, stamps: np.ndarray, rows: np.ndarray, n_kept: int) -> Steps:
        """The last complete steps, then the open one and those of further rows, which are not kept.

        Row 0 of ``of_row`` is the last row that was added, row j + 1 the j-th further one.  The table begins with one
        more step of unknown disturbance, so that a forecast has a step to start from.
        """
        sums = self._joined(stamps, rows)
        first = max(self._n - n_kept, 0)
        labels = np.concatenate([self._labels[first : self._n], sums.labels])
        values = np.concatenate([self._means[first : self._n], sums.means])
        before = np.append(values[:1, :-1], [[np.nan]], axis=1)
        table = self._table(np.append(labels[0] - self.step.value, labels), np.concatenate([before, values]))
        return Steps(table, np.append(0, sums.of_row) + 1 + self._n - first)

    def table(self) -> ZoneTable:
        """All complete steps."""
        return self._table(self.labels, self._means[: self._n])

    def after(self, label: int) -> ZoneTable:
        """The complete steps that begin after a label [ns]."""
        first = int(np.searchsorted(self.labels, label, side="right"))
        return self._table(self.labels[first:], self._means[first : self._n])

    def _table(self, labels: np.ndarray, values: np.ndarray) -> ZoneTable:
        stamps = pd.DatetimeIndex(labels.view("M8[ns]")).tz_localize("UTC")
        inputs = {role: values[:, j].copy() for j, role in enumerate(self.names[:-1])}
        return steps_table(stamps, self._zone, inputs, values[:, -1].copy(), self.step, self._holidays)

    def _joined(self, stamps: np.ndarray, rows: np.ndarray) -> _StepSums:
        """Sums of rows by steps, the first of which is the open one."""
        labels = stamps - stamps % self._width if self._width else stamps
        known = np.isfinite(rows)
        total, count = np.where(known, rows, 0.0), known.astype(np.int64)
        if self._open is not None:
            labels = np.append(self._open.labels, labels)
            total, count = np.concatenate([self._open.total, total]), np.concatenate([self._open.known, count])
        begins = np.append(True, labels[1:] != labels[:-1])
        first = np.flatnonzero(begins)
        of_row = (np.cumsum(begins) - 1)[0 if self._open is None else 1 :]
        return _StepSums(labels[first], np.add.reduceat(total, first), np.add.reduceat(count, first), of_row)

    def _with_room(self, more: int) -> HourlyAggregation:
        made, size = copy(self), 2 * (self._n + more)
        if self._n + more > len(self._labels) or self._written[0] != self._n:  # another one has gone on from here
            made._written = [self._n]
            made._labels, made._means = np.empty(size, dtype=np.int64), np.empty((size, len(self.names)))
            made._labels[: self._n], made._means[: self._n] = self.labels, self._means[: self._n]
        return made
