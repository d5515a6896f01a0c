"""Windows of a table as tensors in memory, and batches of them: a batch is one slice, not a row at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.lib.stride_tricks import sliding_window_view
from torch import Tensor

from .nets import NetworkStack

#: windows to train on are laid out in memory up to this size [numbers], which slices faster; more of them stay views.
_LAID_OUT = 2**24


class Batch(NamedTuple):
    """Windows of every member of a stack."""

    inputs: dict[str, Tensor]  # (n_members, n_windows, ...)
    target: Tensor  # (n_members, n_windows, n_leads), 0 where unknown
    known: Tensor  # the same shape: 1 where the target is known, else 0
    n_known: Tensor  # (n_members,)


class Windows(torch.utils.data.Dataset):
    """Windows of one table for all members of a stack, or of one table each.

    Parameters
    ----------
    views : sequence of dict of str to Tensor
        ``zeta``, ``past``, ``future``, ``base``, each with one entry a window; one dict for all, or one a member.
    targets : sequence of Tensor
        (n_windows, n_leads), NaN where unknown; as many as ``views``.
    chosen : Tensor of int64
        The windows that this data set holds.
    """

    def __init__(self, views: Sequence[dict[str, Tensor]], targets: Sequence[Tensor], chosen: Tensor) -> None:
        self.parts = [
            {name: _laid_out(view) for name, view in part.items()}
            | {"target": torch.nan_to_num(target), "known": torch.isfinite(target).to(torch.float32)}
            for part, target in zip(views, targets, strict=True)
        ]
        self.chosen = chosen

    @classmethod
    def of(cls, each: Sequence[Windows]) -> Windows:
        """One data set for a stack of which each member has its own; the same window numbers are chosen in all."""
        shared = all(one is each[0] for one in each)
        return each[0]._with([one.parts[0] for one in (each[:1] if shared else each)], each[0].chosen)

    def choosing(self, chosen: Tensor) -> Windows:
        """Other windows of the same table."""
        return self._with(self.parts, chosen)

    def _with(self, parts: list[dict[str, Tensor]], chosen: Tensor) -> Windows:
        other = Windows.__new__(Windows)
        other.parts, other.chosen = parts, chosen
        return other

    def to(self, device: str | torch.device) -> Windows:
        """The same windows on a device."""
        parts = [{name: view.to(device) for name, view in part.items()} for part in self.parts]
        return self._with(parts, self.chosen.to(device))

    def whole(self) -> dict[str, Tensor]:
        """All chosen windows of the first table, in order, with ``target`` and ``known``."""
        return {name: view[self.chosen] for name, view in self.parts[0].items()}

    def __len__(self) -> int:
        return len(self.chosen)

    def take(self, order: Tensor, members: Sequence[int]) -> Batch:
        """The windows ``order`` (n_members, n_windows) of the members."""
        rows = self.chosen[order]
        if len(self.parts) == 1:
            flat = rows.flatten()
            taken = {k: v.index_select(0, flat).unflatten(0, rows.shape) for k, v in self.parts[0].items()}
        else:
            each = [(self.parts[member], row) for member, row in zip(members, rows, strict=True)]
            taken = {k: torch.stack([part[k].index_select(0, row) for part, row in each]) for k in self.parts[0]}
        target, known = taken.pop("target"), taken.pop("known")
        return Batch(taken, target, known, known.flatten(1).sum(dim=1))


def _laid_out(view: Tensor) -> Tensor:
    return view.contiguous() if view.numel() <= _LAID_OUT else view


class Batches:
    """Slices of a data set for a stack, in an order that each member's generator draws where they are shuffled."""

    def __init__(self, windows: Windows, size: int, stack: NetworkStack, shuffled: bool = False) -> None:
        self.windows = windows
        self.size = size
        self.stack = stack
        self.shuffled = shuffled
        self._plain: tuple[list[int], list[Batch]] = ([], [])  # for which members, and their batches in the plain order

    def __len__(self) -> int:
        return -(-len(self.windows) // self.size)

    def __iter__(self) -> Iterator[Batch]:
        n, generators = len(self.windows), self.stack.generators
        if self.shuffled:
            order = torch.stack([torch.randperm(n, generator=g) for g in generators])
            yield from self._slices(order.to(self.windows.chosen.device))
            return
        if self._plain[0] != self.stack.members:
            self._plain = (self.stack.members, list(self._slices(self._in_order(n, len(generators)))))
        yield from self._plain[1]

    def _in_order(self, n: int, n_members: int) -> Tensor:
        return torch.arange(n, device=self.windows.chosen.device).expand(n_members, n)

    def _slices(self, order: Tensor) -> Iterator[Batch]:
        for rows in order.split(self.size, dim=1):
            yield self.windows.take(rows, self.stack.members)


def padded_windows(values: np.ndarray, before: int, after: int, width: int) -> Tensor:
    """All windows of ``width`` rows (n_windows, [n_columns,] width) of a series padded with z-score 0."""
    padding = [(before, after)] + [(0, 0)] * (values.ndim - 1)
    series = np.ascontiguousarray(np.pad(values, padding).astype(np.float32).T)  # rows last: a window is a run of them
    windows = sliding_window_view(series, width, axis=-1, writeable=True)
    return torch.from_numpy(np.moveaxis(windows, -2, 0))
