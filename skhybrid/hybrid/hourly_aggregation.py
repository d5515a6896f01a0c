"""What the forecaster of the disturbance reads, gathered into its steps as rows come in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .tables import Bins

#: complete steps that are kept before a buffer is made longer
_ROOM = 512


class _Sums(NamedTuple):
    """Steps gathered from rows: their labels, and sums and counts of what is known in them."""

    labels: np.ndarray  # (n,) int, begin of each step [ns]
    total: np.ndarray  # (n, p)
    known: np.ndarray  # (n, p)
    of_row: np.ndarray  # (n_rows,) step of every row

    @property
    def means(self) -> np.ndarray:
        """(n, p), NaN where nothing is known."""
        return np.where(self.known > 0, self.total / np.maximum(self.known, 1), np.nan)


class HourlyAggregation:
    """Complete steps of the disturbance and the inputs, and the step that is still open.

    Adding rows takes a time that does not depend on how many were added before.

    Parameters
    ----------
    names : list of str
        Columns of the rows.
    step : Timedelta
        Step of the forecaster.
    fine : bool
        Whether rows are shorter than that, so that stamps are rounded down to it.
    zone : tzinfo or None
        Of the stamps.
    """

    def __init__(self, names: list[str], step: pd.Timedelta, fine: bool, zone: object) -> None:
        self.names = names
        self.step = step
        self._width = step.value if fine else 0
        self._zone = None if zone is None else str(zone)
        self._labels = np.empty(_ROOM, dtype=np.int64)
        self._means = np.empty((_ROOM, len(names)))
        self._n = 0
        self._open: _Sums | None = None

    @property
    def labels(self) -> np.ndarray:
        """(n,) begins of the complete steps [ns]."""
        return self._labels[: self._n]

    @property
    def means(self) -> np.ndarray:
        """(n, p) means of the complete steps."""
        return self._means[: self._n]

    def add(self, stamps: np.ndarray, rows: np.ndarray) -> None:
        """Take in rows (n, p) stamped (n,) [ns]; the step of the last one stays open, since a row may still follow."""
        sums = self._joined(stamps, rows)
        done = len(sums.labels) - 1
        self._make_room(done)
        self._labels[self._n : self._n + done] = sums.labels[:-1]
        self._means[self._n : self._n + done] = sums.means[:-1]
        self._n += done
        self._open = _Sums(sums.labels[-1:], sums.total[-1:].copy(), sums.known[-1:].copy(), np.zeros(1, np.int64))

    def drop_before(self, label: int) -> None:
        """Forget complete steps that begin before a label [ns]."""
        first = int(np.searchsorted(self.labels, label))
        self._labels, self._means = self.labels[first:].copy(), self._means[first : self._n].copy()
        self._n -= first

    def extended(self, stamps: np.ndarray, rows: np.ndarray, n_kept: int) -> Bins:
        """The last complete steps, and behind them the open one and those of further rows, which are not kept.

        Row 0 of ``of_row`` is the last row that was added, row j + 1 the j-th further one.  A first step, of which
        nothing is known of the disturbance (the last column), stands for what came before.
        """
        sums = self._joined(stamps, rows)
        first = max(self._n - n_kept, 0)
        means = sums.means
        labels = np.concatenate([self._labels[first : self._n], sums.labels])
        values = np.concatenate([self._means[first : self._n], means])
        before = np.append(values[:1, :-1], [[np.nan]], axis=1)
        frame = self.frame(np.append(labels[0] - self.step.value, labels), np.concatenate([before, values]))
        return Bins(frame, np.append(0, sums.of_row) + 1 + self._n - first)

    def since(self, label: int) -> pd.DataFrame:
        """The complete steps that begin after a label [ns]."""
        first = int(np.searchsorted(self.labels, label, side="right"))
        return self.frame(self.labels[first:], self._means[first : self._n])

    def frame(self, labels: np.ndarray, values: np.ndarray) -> pd.DataFrame:
        """Steps as a table in the time zone of the rows."""
        index = pd.DatetimeIndex(labels.view("M8[ns]"))
        index = index if self._zone is None else index.tz_localize("UTC").tz_convert(self._zone)
        return pd.DataFrame(values, index=index, columns=self.names)

    def _joined(self, stamps: np.ndarray, rows: np.ndarray) -> _Sums:
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
        return _Sums(labels[first], np.add.reduceat(total, first), np.add.reduceat(count, first), of_row)

    def _make_room(self, more: int) -> None:
        if self._n + more <= len(self._labels):
            return
        size = 2 * (self._n + more)
        labels, means = np.empty(size, dtype=np.int64), np.empty((size, len(self.names)))
        labels[: self._n], means[: self._n] = self.labels, self._means[: self._n]
        self._labels, self._means = labels, means
