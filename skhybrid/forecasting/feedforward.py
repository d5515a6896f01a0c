"""Epochs of MLP stacks through compiled kernels, member by member (:mod:`skhybrid._kernels.dense`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from .._kernels import ACTIVATIONS, AdamStep, DenseShape, DenseWindows, dense_epoch, dense_errors
from .nets import NetworkStack
from .windows import Windows

_INPUTS = ("zeta", "past", "future")
#: windows that are validated at once.
_VALIDATED = 1024
#: windows are laid out one behind the other up to this size [numbers]; of more, so many at a time.
_MOST_NUMBERS = 2**24


class DenseTables:
    """The windows of a data set as the kernels read them: one flat row each.

    Parameters
    ----------
    windows : Windows
        Of one table for all members, or of one each.
    reads_zeta : bool
        Whether networks read the disturbance's history.
    """

    def __init__(self, windows: Windows, reads_zeta: bool) -> None:
        self.chosen = windows.chosen
        self._parts, self._reads_zeta = windows.parts, reads_zeta
        self._tables: dict[int, DenseWindows] = {}

    def pieces(self, member: int, order: Tensor, batch_size: int) -> Iterator[tuple[DenseWindows, np.ndarray]]:
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

    def _table(self, part: dict[str, Tensor], rows: Tensor) -> DenseWindows:
        taken = {name: part[name].index_select(0, rows) for name in (*_INPUTS, "base", "target", "known")}
        pieces = [taken["zeta"][:, 1:]] if self._reads_zeta else []
        psi = torch.cat([*pieces, taken["past"].flatten(1), taken["future"].flatten(1)], dim=1)
        return DenseWindows(psi.numpy(), *(taken[name].numpy() for name in ("base", "target", "known")))


def _shapes(stack: NetworkStack) -> list[DenseShape]:
    return [DenseShape(stack.places, ACTIVATIONS[spec.activation], float(spec.dropout)) for spec in stack.specs]


def train_epoch(
    stack: NetworkStack, tables: DenseTables, optimizer: torch.optim.Adam, batch_size: int, max_norm: float
) -> list[float]:
    """One shuffled epoch of every member; Adam's state stays with ``optimizer``.

    Parameters
    ----------
    stack : NetworkStack
        MLPs.
    tables : DenseTables
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
    n, means = len(tables.chosen), []
    for i, (shape, generator) in enumerate(zip(_shapes(stack), stack.generators, strict=True)):
        order = tables.chosen[torch.randperm(n, generator=generator)]
        drawn = _draws(shape, n, generator)
        moments = (state["exp_avg"][i].numpy(), state["exp_avg_sq"][i].numpy())
        found, done = [], 0
        for table, rows in tables.pieces(stack.members[i], order, batch_size):
            adam = AdamStep(rate, n_done + done // batch_size, max_norm)
            part = np.ascontiguousarray(drawn[:, done : done + len(rows)])
            found.append(dense_epoch(flat[i].numpy(), moments, shape, table, rows, part, batch_size, adam))
            done += len(rows)
        means.append(_mean(found))
    state["step"] += -(-n // batch_size)
    return means


def _draws(shape: DenseShape, n: int, generator: torch.Generator) -> np.ndarray:
    """Uniform draws (n_layers, n, width) for the dropout of an epoch; none where nothing drops."""
    n_layers, width = (len(shape.places) - 1, int(shape.places[0, 2])) if shape.share else (0, 0)
    return torch.empty(n_layers, n if n_layers else 0, width).uniform_(generator=generator).numpy()


def validate(stack: NetworkStack, tables: DenseTables) -> list[float]:
    """Mean squared error of each member over the chosen windows, without dropout."""
    means = []
    for i, shape in enumerate(_shapes(stack)):
        row, pieces = stack.flat[i].detach().numpy(), tables.pieces(stack.members[i], tables.chosen, _VALIDATED)
        means.append(_mean([dense_errors(row, shape, table, rows) for table, rows in pieces]))
    return means


def _mean(found: Sequence[tuple[float, float]]) -> float:
    total, count = np.sum(found, axis=0)
    return float(total / max(count, 1.0))
