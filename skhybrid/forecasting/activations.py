"""Activations of a stack whose members may differ in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

import torch
from torch import Tensor
from torch.nn import functional as F

from ..filtering import ACTIVATIONS

_PHI: dict[str, Callable[[Tensor], Tensor]] = {"relu": F.relu, "selu": F.selu, "gelu": F.gelu}


class Activations:
    """``phi`` by member; neighbours of one kind are computed together.

    Parameters
    ----------
    names : sequence of {"relu", "selu", "gelu"}
        One a member.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.codes = [ACTIVATIONS[name] for name in names]  # as kernels know them
        self.runs: list[tuple[str, slice]] = []
        start = 0
        for name, group in groupby(names):
            stop = start + len(list(group))
            self.runs.append((name, slice(start, stop)))
            start = stop

    def apply(self, z: Tensor) -> Tensor:
        """``phi(z)``, with torch's own gradient."""
        if len(self.runs) == 1:
            return _PHI[self.runs[0][0]](z)
        return torch.cat([_PHI[name](z[rows]) for name, rows in self.runs])
