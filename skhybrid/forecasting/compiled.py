"""Forecasts of stacks through compiled kernels (:mod:`skhybrid.filtering.dense`, ``convolution``, ``recurrent``)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..filtering import (
    DenseWindows,
    RecurrentWindows,
    conv_epoch,
    conv_forecasts,
    dense_epoch,
    dense_forecasts,
    recurrent_epoch,
    recurrent_forecasts,
    recurrent_room,
)
from .cases import RECURRENT

#: the device that kernels run on; on others torch's own operators do.
DEVICE = "cpu"


def kernels_of(kind: str) -> tuple[Callable[..., Any], Callable[..., np.ndarray]]:
    """The epoch of a kind of network, and its forecasts."""
    if kind in RECURRENT:
        return recurrent_epoch, recurrent_forecasts
    return (conv_epoch, conv_forecasts) if kind == "cnn" else (dense_epoch, dense_forecasts)


def room_of(kind: str, shape: Any, n_past: int, n_leads: int) -> np.ndarray:
    """Memory for the kernels of a network to work in from call to call; none where they need little.

    Parameters
    ----------
    kind : {"mlp", "cnn", "rnn", "lstm"}
        The network.
    shape : NamedTuple
        As its kernels know it.
    n_past, n_leads : int
        Rows of its windows.
    """
    return np.empty(recurrent_room(shape, n_past, n_leads) if kind in RECURRENT else 0, dtype=np.float32)


def table_of(
    kind: str, reads_zeta: bool, inputs: Sequence[Tensor], targets: Sequence[Tensor], room: np.ndarray | None = None
) -> Any:
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
    room : ndarray of float32, optional
        What :func:`room_of` gives.
    """
    zeta, past, future = inputs
    base, target, known = (tensor.contiguous().numpy() for tensor in targets)
    if kind in RECURRENT:
        room = np.empty(0, dtype=np.float32) if room is None else room
        zetas, pasts, futures = (tensor.contiguous().numpy() for tensor in inputs)
        return RecurrentWindows(zetas, pasts, futures, base, target, known, room)
    pieces = [zeta[:, 1:]] if reads_zeta else []
    psi = torch.cat([*pieces, past.flatten(1), future.flatten(1)], dim=1).numpy()
    return DenseWindows(psi, base, target, known)


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
