"""Windows of a table in z-scores as tensors: the columns of a case, its history and its horizon from every origin."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np
import torch
from numpy.lib.stride_tricks import sliding_window_view
from torch import Tensor
from torch.nn import functional as F

from ..._table import ZoneTable
from ..cases import RECURRENT, ModelCase
from ..features import row_features

#: Inputs of all windows are kept in memory up to this size [numbers]; larger tables are cut batch by batch.
_MOST_IN_MEMORY = 2**24
#: The number of columns of a recurrent network, with zeta and the bias, is a multiple of this: the hour of week (four),
#: two of weather, zeta and 1.
_COLUMNS = 8


class Scaler(NamedTuple):
    """Z-scores that the training block gave."""

    zeta_mean: float
    zeta_std: float
    past_mean: np.ndarray
    past_std: np.ndarray
    future_mean: np.ndarray
    future_std: np.ndarray

    @classmethod
    def of(cls, target: np.ndarray, past: np.ndarray, future: np.ndarray) -> Scaler:
        """The z-scores of a target (n,), NaN where missing, and of the columns (n, n_columns) of past and future."""
        known = target[np.isfinite(target)]
        level, spread = float(known.mean()), float(known.std())
        spread = spread if spread > 1e-9 else 1.0
        return cls(level, spread, past.mean(axis=0), _spread(past), future.mean(axis=0), _spread(future))


def _spread(columns: np.ndarray) -> np.ndarray:
    spread = columns.std(axis=0)
    return np.where(spread > 1e-9, spread, np.inf)  # a constant column says nothing


class WindowViews(NamedTuple):
    """Overlapping views of a table; window i has row i as its origin."""

    zeta: Tensor  # (n_windows, n_past + 1), the disturbance of the rows origin - n_past ... origin
    past: Tensor  # (n_windows, n_columns, n_past), columns of the rows origin - n_past + 1 ... origin
    future: Tensor  # (n_windows, n_columns, n_leads), columns of the rows origin + 1 ... origin + n_leads

    def take(self, rows: Tensor) -> WindowViews:
        """Copies of some windows."""
        return WindowViews(*(view.index_select(0, rows) for view in self))


class WindowTable:
    """The windows of one table as a network reads them."""

    def __init__(self, kind: str, reads_zeta: bool, views: WindowViews, base: Tensor, target: Tensor) -> None:
        self.base = base  # (n_windows, n_leads) baseline forecast that is corrected, 0 where there is none
        self.target = target  # (n_windows, n_leads) disturbance, NaN where unknown
        self._kind, self._reads_zeta = kind, reads_zeta
        self._views = views = WindowViews(*(view[: len(target)] for view in views))
        fits = len(target) * sum(view[0].numel() for view in views) <= _MOST_IN_MEMORY
        self._inputs = network_inputs(kind, reads_zeta, *views) if fits else None

    def inputs(self, rows: Tensor) -> Tensor:
        """The network's inputs of some windows, (n_rows, ...)."""
        if self._inputs is not None:
            return self._inputs.index_select(0, rows)
        return network_inputs(self._kind, self._reads_zeta, *self._views.take(rows))

    def to(self, device: str) -> WindowTable:
        """The same windows on a device."""
        views = WindowViews(*(view.to(device) for view in self._views))
        return WindowTable(self._kind, self._reads_zeta, views, self.base.to(device), self.target.to(device))


class Windows(torch.utils.data.Dataset):
    """The chosen windows of one table for all networks of a stack, or of several tables."""

    def __init__(self, tables: Sequence[WindowTable], chosen: Tensor, table_of: Sequence[int] = ()) -> None:
        self.tables = list(tables)
        self.chosen = chosen
        self.table_of = list(table_of)  # the number of each network's table, where there are several

    @classmethod
    def joined(cls, each: Sequence[Windows]) -> Windows:
        """One data set for a stack of which each network has its own; the same windows are chosen in all."""
        tables = list(dict.fromkeys(one.tables[0] for one in each))
        numbers = {table: number for number, table in enumerate(tables)}
        return cls(tables, each[0].chosen, [numbers[one.tables[0]] for one in each])

    def to(self, device: str) -> Windows:
        """The same windows on a device."""
        if device == "cpu":
            return self
        return Windows([table.to(device) for table in self.tables], self.chosen.to(device), self.table_of)

    def __len__(self) -> int:
        return len(self.chosen)

    @cached_property
    def all_known(self) -> bool:
        """Whether no target of a chosen window is missing."""
        return not any(bool(torch.isnan(table.target[self.chosen]).any()) for table in self.tables)

    def take(self, rows: Tensor, numbers: Sequence[int]) -> tuple[dict[str, Tensor], Tensor]:
        """A batch: inputs of a stack by name, and targets.

        ``rows`` (n_networks, n_windows) or (n_windows,) are windows of each network or of all; ``numbers`` are the
        networks'.
        """
        if rows.ndim == 1 and len(self.tables) == 1:
            inputs, base, target = (part.expand(len(numbers), *part.shape) for part in _cut(self.tables[0], rows))
            return {"inputs": inputs, "base": base}, target
        of = [self.table_of[number] if self.table_of else 0 for number in numbers]
        runs = [(self.tables[table], len(list(run))) for table, run in groupby(of)]  # neighbours are cut together
        parts = rows.expand(len(numbers), -1).split([length for _, length in runs])
        each = [_cut(table, part) for (table, _), part in zip(runs, parts, strict=True)]
        inputs, base, target = (torch.cat(same) if len(runs) > 1 else same[0] for same in zip(*each, strict=True))
        return {"inputs": inputs, "base": base}, target


def _cut(table: WindowTable, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Inputs, baseline and target of windows of any shape."""
    flat = rows.flatten()
    cut = table.inputs(flat), table.base.index_select(0, flat), table.target.index_select(0, flat)
    inputs, base, target = (part.view(*rows.shape, *part.shape[1:]) for part in cut)
    return inputs, base, target


def network_inputs(kind: str, reads_zeta: bool, zeta: Tensor, past: Tensor, future: Tensor) -> Tensor:
    """Windows as a network reads them, from the parts of :class:`WindowViews`, before which further axes may come.

    MLP and CNN read vectors (..., flat_width).  RNN and LSTM read sequences (..., n_columns + 1, n_past + n_leads):
    first zeta of the row before, 0 where it is not known, and last a 1 for the bias.
    """
    if kind not in RECURRENT:
        parts = [zeta[..., 1:]] if reads_zeta else []
        return torch.cat([*parts, past.flatten(-2), future.flatten(-2)], dim=-1)
    columns = torch.cat([past, future], dim=-1)
    parts = [F.pad(zeta, (0, future.shape[-1] - 1))[..., None, :]] if reads_zeta else []
    return torch.cat([*parts, columns, torch.ones_like(columns[..., :1, :])], dim=-2)


def scaled_views(
    table: ZoneTable,
    columns: tuple[np.ndarray, np.ndarray],
    scaler: Scaler,
    expected: np.ndarray | None,
    n_past: int,
    n_leads: int,
    after: int,
) -> WindowViews:
    """Windows in z-scores, ``after`` rows padded; ``expected`` (n_rows,) or else its mean replaces missing zeta."""
    zeta = table.measured("zeta")
    filled = np.where(np.isfinite(zeta), zeta, scaler.zeta_mean if expected is None else expected)
    past = (columns[0] - scaler.past_mean) / scaler.past_std
    future = (columns[1] - scaler.future_mean) / scaler.future_std
    return WindowViews(
        padded_windows((filled - scaler.zeta_mean) / scaler.zeta_std, n_past, after, n_past + 1),
        padded_windows(past, n_past - 1, after, n_past),
        padded_windows(future, 0, after, n_leads)[1:],
    )


def padded_windows(values: np.ndarray, before: int, after: int, width: int) -> Tensor:
    """All windows of ``width`` rows (n_windows, [n_columns,] width) of a series padded with z-score 0."""
    padding = [(before, after)] + [(0, 0)] * (values.ndim - 1)
    series = np.ascontiguousarray(np.pad(values, padding).astype(np.float32).T)  # rows last: a window is a run of them
    windows = sliding_window_view(series, width, axis=-1, writeable=True)
    return torch.from_numpy(np.moveaxis(windows, -2, 0))


def window_columns(table: ZoneTable, case: ModelCase, kind: str, encoding: str) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the past and of the future, (n_rows, n_columns) each, without ``zeta``.

    A recurrent network reads the same columns in both: one that a part does not name is 0 there.  Further columns of 0
    make their number the same for all of the paper's cases, so that networks of several cases fit into one stack.
    """
    past, future = (tuple(f for f in part if f != "zeta") for part in (case.past, case.future))
    if kind not in RECURRENT:
        return row_features(table, past, encoding), row_features(table, future, encoding)
    both = [f for f in case.features if f != "zeta"]
    blocks = [row_features(table, (feature,), encoding) for feature in both]
    n_read = sum(block.shape[1] for block in blocks) + 2  # with zeta and the bias
    empty = [np.zeros((table.n_rows, -n_read % _COLUMNS))]

    def read_by(part: tuple[str, ...]) -> np.ndarray:
        return np.hstack([block * (feature in part) for feature, block in zip(both, blocks, strict=True)] + empty)

    return read_by(past), read_by(future)
