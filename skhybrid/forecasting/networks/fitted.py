"""Fitted networks as plain arrays, and their forecasts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..._table import ZoneTable
from ..cases import ModelCase
from .modules import CNNStack, MLPStack, NetworkStack
from .recurrent import RecurrentStack
from .spec import NetworkSpec
from .training import one_thread
from .windows import Scaler, WindowViews, network_inputs, scaled_views, window_columns

#: Windows that are forecast at once.
_WINDOWS_AT_ONCE = 2048
_STACKS = {"mlp": MLPStack, "cnn": CNNStack, "rnn": RecurrentStack, "lstm": RecurrentStack}


def make_stack(specs: Sequence[NetworkSpec]) -> NetworkStack:
    """A stack of networks of equal shape, with weights of 0."""
    return _STACKS[specs[0].kind](specs)


@dataclass(eq=False)
class FittedNetwork:
    """One fitted network, or several whose mean forecasts; ``weights`` as :meth:`NetworkStack.weights` names them."""

    spec: NetworkSpec
    case: ModelCase
    encoding: str  # of time
    scaler: Scaler  # z-scores of the training block
    weights: dict[str, np.ndarray]

    def forecast(
        self, table: ZoneTable, origins: np.ndarray, n_leads: int, base: Any = None, expected: np.ndarray | None = None
    ) -> np.ndarray:
        """Forecasts (n_origins, n_leads) that correct ``base``; ``expected`` (n_rows,) replaces missing history."""
        spec, scaler = self.spec, self.scaler
        # beyond the trained horizon its own forecasts become history
        n_rounds = -(-n_leads // spec.n_leads)
        columns = window_columns(table, self.case, spec.kind, self.encoding)
        after = (n_rounds + 1) * spec.n_leads
        views = scaled_views(table, columns, scaler, expected, spec.n_past, spec.n_leads, after)
        scaled = np.zeros((len(origins), n_leads)) if base is None else (base - scaler.zeta_mean) / scaler.zeta_std
        whole = np.pad(scaled, [(0, 0), (0, n_rounds * spec.n_leads - n_leads)], mode="edge").astype(np.float32)
        stack, rows = self.build(), torch.from_numpy(np.asarray(origins, dtype=np.int64))
        parts = zip(rows.split(_WINDOWS_AT_ONCE), torch.from_numpy(whole).split(_WINDOWS_AT_ONCE), strict=True)
        with torch.no_grad(), one_thread():
            paths = torch.cat([_forecast_rounds(stack, views, *part) for part in parts], dim=1)
        out = paths[..., :n_leads].numpy().astype(np.float64).mean(axis=0)
        return out * scaler.zeta_std + scaler.zeta_mean

    def build(self) -> NetworkStack:
        """The torch module of these weights."""
        weights = {name: torch.from_numpy(value) for name, value in self.weights.items()}
        n = len(next(iter(weights.values())))
        return make_stack([self.spec] * n).set_weights(weights)


def _forecast_rounds(stack: NetworkStack, views: WindowViews, rows: Tensor, base: Tensor) -> Tensor:
    """Forecasts (n_networks, n_windows, n_rounds * n_leads): each round reads the forecasts of the rounds before it."""
    spec, n = stack.spec, len(stack.numbers)
    zeta = views.zeta[rows].expand(n, -1, -1)
    paths = []
    for block in base.split(spec.n_leads, dim=1):
        past, future = (view[rows].expand(n, -1, -1, -1) for view in (views.past, views.future))
        inputs = network_inputs(spec.kind, spec.reads_zeta, zeta, past, future)
        paths.append(stack(inputs, block.expand(n, -1, -1)))
        zeta = torch.cat([zeta, paths[-1]], dim=2)[:, :, -(spec.n_past + 1) :]
        rows = rows + spec.n_leads
    return torch.cat(paths, dim=2)
