"""Epochs of stacks through compiled kernels (:mod:`skhybrid.filtering.dense`, ``convolution``, ``recurrent``).

A step of a small network is dozens of torch's operations, each of which takes longer to call than to compute.  Members
take turns: what stands beside a member does not change its numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..filtering import AdamStep
from .cases import RECURRENT
from .compiled import kernels_of, table_of
from .nets import NetworkStack
from .windows import Windows

_INPUTS = ("zeta", "past", "future")
_TARGETS = ("base", "target", "known")
#: windows are laid out one behind the other up to this size [numbers]; of more, so many at a time.
_MOST_NUMBERS = 2**24
#: windows that are validated at once, of a table that is not laid out whole.
_VALIDATED = 1024


class Tables:
    """The windows of a data set as the kernels read them.

    Parameters
    ----------
    windows : Windows
        Of one table for all members, or of one each.
    kind : {"mlp", "cnn", "rnn", "lstm"}
        The networks.
    reads_zeta : bool
        Whether they read the disturbance's history.
    room : ndarray of float32, optional
        Memory for the kernels to work in (:func:`~skhybrid.forecasting.compiled.room_of`).
    """

    def __init__(self, windows: Windows, kind: str, reads_zeta: bool, room: np.ndarray | None = None) -> None:
        self.chosen = windows.chosen
        self._parts, self._kind, self._reads_zeta, self._room = windows.parts, kind, reads_zeta, room
        self._tables: dict[int, Any] = {}

    def pieces(self, member: int, order: Tensor, batch_size: int) -> Iterator[tuple[Any, np.ndarray]]:
        """Tables and the rows of them that are next: one whole, or, where that were too large, some batches each."""
        number = member if len(self._parts) > 1 else 0
        part = self._parts[number]
        width = sum(part[name][0].numel() for name in _INPUTS)
        if len(part["target"]) * width <= _MOST_NUMBERS:
            if number not in self._tables:
                self._tables[number] = self._table(part, torch.arange(len(part["target"])))
            yield self._tables[number], order.numpy()
            return
        for rows in order.split(batch_size * max(1, _MOST_NUMBERS // (batch_size * width))):
            yield self._table(part, rows), np.arange(len(rows))

    def _table(self, part: dict[str, Tensor], rows: Tensor) -> Any:
        inputs, targets = ([part[name].index_select(0, rows) for name in names] for names in (_INPUTS, _TARGETS))
        return table_of(self._kind, self._reads_zeta, inputs, targets, self._room)


def train_epoch(
    stack: NetworkStack, tables: Tables, optimizer: torch.optim.Adam, batch_size: int, max_norm: float
) -> list[float]:
    """One shuffled epoch of every member; Adam's state stays with ``optimizer``.

    Parameters
    ----------
    stack : NetworkStack
        Its members.
    tables : Tables
        What they learn from.
    optimizer : torch.optim.Adam
        Of ``stack.flat``.
    batch_size : int
        Windows of a batch.
    max_norm : float
        To which a member's gradient is clipped.

    Returns
    -------
    list of float
        Mean squared error of each member, before the steps.
    """
    flat = stack.flat.detach()
    state = optimizer.state[stack.flat]
    if not state:
        state |= {"step": torch.tensor(0.0), "exp_avg": torch.zeros_like(flat), "exp_avg_sq": torch.zeros_like(flat)}
    rate, n_done = optimizer.param_groups[0]["lr"], int(state["step"])
    epoch, _ = kernels_of(stack.spec.kind)
    n, means = len(tables.chosen), []
    for i, (shape, generator) in enumerate(zip(stack.shapes(), stack.generators, strict=True)):
        order = tables.chosen[torch.randperm(n, generator=generator)]
        drawn = _draws(stack, stack.specs[i].dropout, n, generator)
        moments = (state["exp_avg"][i].numpy(), state["exp_avg_sq"][i].numpy())
        found, done = [], 0
        for table, rows in tables.pieces(stack.members[i], order, batch_size):
            adam = AdamStep(rate, n_done + done // batch_size, max_norm)
            part = drawn if len(rows) == n else np.ascontiguousarray(drawn[_of_windows(stack, done, len(rows))])
            found.append(epoch(flat[i].numpy(), moments, shape, table, rows, part, batch_size, adam))
            done += len(rows)
        means.append(_mean(found))
    state["step"] += -(-n // batch_size)
    return means


def _draws(stack: NetworkStack, share: float, n: int, generator: torch.Generator) -> np.ndarray:
    """Uniform draws for the dropout of an epoch; none if nothing drops.

    They are (n_layers, n, width), of a CNN's head one layer, and of a recurrent network (n_leads, width, n).
    """
    spec, width = stack.spec, int(stack.places[-1, 1])
    shape = (1 if spec.kind == "cnn" else spec.n_layers, n, width)
    if spec.kind in RECURRENT:
        shape = (spec.n_leads, width, n)
    return torch.empty(shape if share else (0, 0, 0)).uniform_(generator=generator).numpy()


def _of_windows(stack: NetworkStack, first: int, n: int) -> tuple[slice, ...]:
    """Which of the draws belong to these windows of an epoch."""
    these = slice(first, first + n)
    return (slice(None), slice(None), these) if stack.spec.kind in RECURRENT else (slice(None), these)


def validate(stack: NetworkStack, tables: Tables) -> list[float]:
    """Mean squared error of each member over the chosen windows, without dropout."""
    _, forecast = kernels_of(stack.spec.kind)
    means = []
    for i, shape in enumerate(stack.shapes()):
        row, found = stack.flat[i].detach().numpy(), []
        for table, rows in tables.pieces(stack.members[i], tables.chosen, _VALIDATED):
            known = table.known[rows]
            errors = (forecast(row, shape, table, rows) - table.target[rows]) * known
            found.append((float(np.vdot(errors, errors)), float(known.sum())))
        means.append(_mean(found))
    return means


def _mean(found: Sequence[tuple[float, float]]) -> float:
    total, count = np.sum(found, axis=0)
    return float(total / max(count, 1.0))
