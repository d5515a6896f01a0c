"""Activations of a stack whose members may differ in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

import torch
from torch import Tensor
from torch.nn import functional as F

_PHI: dict[str, Callable[[Tensor], Tensor]] = {"relu": F.relu, "selu": F.selu, "gelu": F.gelu}
_SELU = (1.6732632423543772, 1.0507009873554805, 1.0)  # alpha, scale and that of the input, as torch documents it


def _slope(name: str, gradient: Tensor, z: Tensor) -> Tensor:
    """``gradient * phi'(z)``."""
    aten = torch.ops.aten
    if name == "relu":
        return aten.threshold_backward(gradient, z, 0.0)
    if name == "gelu":
        return aten.gelu_backward(gradient, z)
    return aten.elu_backward(gradient, *_SELU, False, z)


class Activations:
    """``phi`` by member; neighbours of one kind are computed together.

    Parameters
    ----------
    names : sequence of {"relu", "selu", "gelu"}
        One a member.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = list(names)
        self.runs: list[tuple[str, slice]] = []
        start = 0
        for name, group in groupby(names):
            stop = start + len(list(group))
            self.runs.append((name, slice(start, stop)))
            start = stop

    def of(self, member: int) -> Callable[[Tensor], Tensor]:
        """``phi`` of one member."""
        return _PHI[self.names[member]]

    def apply(self, z: Tensor) -> Tensor:
        """``phi(z)``, with torch's own gradient."""
        if len(self.runs) == 1:
            return _PHI[self.runs[0][0]](z)
        return torch.cat([_PHI[name](z[rows]) for name, rows in self.runs])

    def __call__(self, z: Tensor, mask: Tensor | None, out: Tensor) -> None:
        """``phi(z) * mask`` into ``out``."""
        for name, rows in self.runs:
            value = _PHI[name](z[rows])
            if mask is None:
                out[rows] = value
            else:
                torch.mul(value, mask[rows], out=out[rows])

    def backward(self, gradient: Tensor, z: Tensor, mask: Tensor | None) -> Tensor:
        """The gradient before ``phi`` and ``mask``; ``gradient`` is used up."""
        if mask is not None:
            gradient.mul_(mask)
        if len(self.runs) == 1:
            return _slope(self.runs[0][0], gradient, z)
        return torch.cat([_slope(name, gradient[rows], z[rows]) for name, rows in self.runs])
