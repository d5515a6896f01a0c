"""Windows of a table as views of tensors in memory, and batches of them: nothing is copied before a batch is taken."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.lib.stride_tricks import sliding_window_view
from torch import Tensor


class Windows(torch.utils.data.Dataset):
    """Windows of a table, one an origin, as views: nothing is copied before a batch is taken.

    Parameters
    ----------
    views : dict of str to Tensor
        ``zeta``, ``past``, ``future``, ``base``, each with one entry a window.
    target : Tensor or None
        (n_windows, n_leads), NaN where unknown.
    chosen : Tensor of int64
        The windows that this data set holds.
    """

    def __init__(self, views: dict[str, Tensor], target: Tensor | None, chosen: Tensor) -> None:
        self.views = views
        self.target = target
        self.chosen = chosen

    def __len__(self) -> int:
        return len(self.chosen)

    def __getitem__(self, index: Any) -> tuple[dict[str, Tensor], Tensor]:
        """The windows of an index array at once."""
        rows = self.chosen[index]
        target = torch.empty(len(rows)) if self.target is None else self.target[rows]
        return {name: view[rows] for name, view in self.views.items()}, target


class Batches:
    """Slices of a data set, shuffled by a generator where one is given."""

    def __init__(self, windows: Windows, size: int, generator: torch.Generator | None = None) -> None:
        self.windows = windows
        self.size = size
        self.generator = generator

    def __len__(self) -> int:
        return -(-len(self.windows) // self.size)

    def __iter__(self) -> Iterator[tuple[dict[str, Tensor], Tensor]]:
        n = len(self.windows)
        order = torch.arange(n) if self.generator is None else torch.randperm(n, generator=self.generator)
        for chosen in order.split(self.size):
            yield self.windows[chosen]


def padded_windows(values: np.ndarray, before: int, after: int, width: int) -> Tensor:
    """All windows of ``width`` rows (n_windows, [n_columns,] width) of a series padded with z-score 0."""
    padding = [(before, after)] + [(0, 0)] * (values.ndim - 1)
    padded = np.pad(values, padding).astype(np.float32)
    return torch.from_numpy(sliding_window_view(padded, width, axis=0, writeable=True))
