"""Batches of windows for a stack, with the order and the dropout that each network's generator draws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

from .modules import NetworkStack
from .windows import Windows

Batch = tuple[dict[str, Tensor], Tensor]


class WindowBatches:
    """Slices of a data set for the networks of a stack: shuffled and with dropout if there are generators.

    Parameters
    ----------
    windows : Windows
        The data set.
    size : int
        Windows of a batch.
    stack : NetworkStack
        Its networks.
    generators : sequence of torch.Generator, optional
        One per network by its number; None: windows come in order, and nothing is dropped.
    """

    def __init__(
        self, windows: Windows, size: int, stack: NetworkStack, generators: Sequence[torch.Generator] | None = None
    ) -> None:
        self.windows = windows
        self.size = size
        self.stack = stack
        self.generators = generators
        self._in_order: tuple[list[int], list[Batch]] = ([], [])  # numbers of networks and their batches

    def __len__(self) -> int:
        return -(-len(self.windows) // self.size)

    def __iter__(self) -> Iterator[Batch]:
        numbers = self.stack.numbers
        if self.generators is not None:
            yield from self._shuffled([self.generators[number] for number in numbers])
            return
        if self._in_order[0] != numbers:
            order = torch.arange(len(self.windows), device=self.windows.chosen.device)
            self._in_order = numbers, [self.windows.take(rows, numbers) for rows in order.split(self.size)]
        yield from self._in_order[1]

    def _shuffled(self, generators: list[torch.Generator]) -> Iterator[Batch]:
        """An epoch: the order of windows, then all dropout, from each generator."""
        n, device = len(self.windows), self.windows.chosen.device
        order = torch.stack([torch.randperm(n, generator=g, device=g.device) for g in generators]).to(device)
        kept = draw_kept(self.stack, n, generators)
        for start in range(0, n, self.size):
            part = slice(start, start + self.size)
            inputs, target = self.windows.take(order[:, part], self.stack.numbers)
            if kept is not None:
                inputs["kept"] = kept.factors(part)
            yield inputs, target


class Kept:
    """The hidden values that dropout keeps in an epoch.

    Parameters
    ----------
    values : Tensor of bool, shape (n_networks, n_layers, width, n_windows)
        Whether a value is kept.
    shares : Tensor of shape (n_networks,)
        Share of values that each network drops.
    """

    def __init__(self, values: Tensor, shares: Tensor) -> None:
        self._values = values
        self._scales = 1.0 / (1.0 - shares[:, None, None, None])

    def factors(self, part: slice) -> Tensor:
        """Factors of the hidden values of some windows: 0, or 1 / (1 - share)."""
        return self._values[..., part] * self._scales


def draw_kept(stack: NetworkStack, n_windows: int, generators: Sequence[torch.Generator]) -> Kept | None:
    """Draw the dropout of an epoch.

    Parameters
    ----------
    stack : NetworkStack
        Its networks.
    n_windows : int
        Windows of the epoch.
    generators : sequence of torch.Generator
        One per row of the stack; a network that drops nothing draws nothing.

    Returns
    -------
    Kept or None
        None where no network drops.
    """
    shares = [spec.dropout for spec in stack.specs]
    if not any(shares):
        return None
    dropped = [
        stack.spec.draw_dropped(n_windows, share, generator) if share else None
        for share, generator in zip(shares, generators, strict=True)
    ]
    like = next(one for one in dropped if one is not None)
    values = torch.stack([torch.zeros_like(like) if one is None else one for one in dropped])
    return Kept(~values, torch.tensor(shares, device=values.device))
