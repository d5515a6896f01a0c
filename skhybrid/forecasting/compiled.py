"""Forecasts of stacks through compiled kernels (:mod:`skhybrid._kernels.dense`, ``convolution``, ``recurrent``)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .._kernels import (
    DenseWindows,
    RecurrentWindows,
    conv_epoch,
    conv_forecasts,
    dense_epoch,
    dense_forecasts,
    recurrent_epoch,
    recurrent_forecasts,
)
from .cases import RECURRENT

#: the device that kernels run on; on others torch's own operators do.
DEVICE = "cpu"


def kernels_of(kind: str) -> tuple[Callable[..., Any], Callable[..., np.ndarray]]:
    """The epoch of a kind of network, and its forecasts."""
    if kind in RECURRENT:
        return recurrent_epoch, recurrent_forecasts
    return (conv_epoch, conv_forecasts) if kind == "cnn" else (dense_epoch, dense_forecasts)


def table_of(kind: str, reads_zeta: bool, inputs: Sequence[Tensor], targets: Sequence[Tensor]) -> Any:
    """Windows as the kernels of a network read them.

    Parameters
    ----------
    kind : {"mlp", "cnn", "rnn", "lstm"}
        The network.
    reads_zeta : bool
        Whether it reads the disturbance's history.
    inputs : sequence of Tensor
        ``zeta``, ``past`` and ``future``, (n_windows, ...) each.
    targets : sequence of Tensor
        ``base``, ``target`` and ``known``, (n_windows, n_leads) each.
    """
    zeta, past, future = inputs
    of_leads = [tensor.contiguous().numpy() for tensor in targets]
    if kind in RECURRENT:
        return RecurrentWindows(*(tensor.contiguous().numpy() for tensor in inputs), *of_leads)
    pieces = [zeta[:, 1:]] if reads_zeta else []
    return DenseWindows(torch.cat([*pieces, past.flatten(1), future.flatten(1)], dim=1).numpy(), *of_leads)


def forecast_members(flat: Tensor, kind: str, reads_zeta: bool, shapes: Sequence[Any], *inputs: Tensor) -> Tensor:
    """Forecasts (n_members, n_windows, n_leads); nothing drops.

    Parameters
    ----------
    flat : Tensor of shape (n_members, n_weights)
        Weights.
    kind : {"mlp", "cnn", "rnn", "lstm"}
        The networks.
    reads_zeta : bool
        Whether they read the disturbance's history.
    shapes : sequence of NamedTuple
        The members as their kernels know them.
    *inputs : Tensor
        ``zeta``, ``past``, ``future`` and ``base``, each (n_members, n_windows, ...).
    """
    _, forecast = kernels_of(kind)
    found = []
    for row, shape, *of, base in zip(flat.detach(), shapes, *inputs, strict=True):
        table = table_of(kind, reads_zeta, of, (base, base, base))
        found.append(torch.from_numpy(forecast(row.numpy(), shape, table, np.arange(len(base)))))
    return torch.stack(found)
