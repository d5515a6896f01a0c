"""The four networks (paper Eqs. MLP, CNN, RNN, LSTM) as torch modules that own their randomness.

All of them map the same window to the forecast of every lead, in z-scores:

====== ============================ =========================================================
zeta   (n_windows, n_past + 1)      disturbance of the rows origin - n_past ... origin
past   (n_windows, n_columns, n_past) columns of the rows origin - n_past + 1 ... origin
future (n_windows, n_columns, n_leads) columns of the rows origin + 1 ... origin + n_leads
base   (n_windows, n_leads)         baseline forecast that the network corrects; 0 where there is none
====== ============================ =========================================================

Initial weights and dropout are drawn from an explicit generator: torch's global state is neither read nor changed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

_ACTIVATIONS: dict[str, type[nn.Module]] = {"relu": nn.ReLU, "selu": nn.SELU, "gelu": nn.GELU}


class NetworkSpec(NamedTuple):
    """Everything that fixes the shape of a network."""

    kind: str  # "mlp", "cnn", "rnn", "lstm"
    n_past: int  # rows of history
    n_leads: int  # rows ahead
    n_past_columns: int
    n_future_columns: int
    reads_zeta: bool
    n_layers: int
    hidden_size: int
    activation: str
    dropout: float
    n_channels: int
    filter_size: int
    pool_size: int


class LocalDropout(nn.Module):
    """Dropout whose mask comes from a generator of one's own."""

    def __init__(self, share: float, generator: torch.Generator) -> None:
        super().__init__()
        self.share = share
        self.generator = generator

    def forward(self, z: Tensor) -> Tensor:
        """Drop and rescale in training; pass through otherwise."""
        if not self.training or self.share == 0.0:
            return z
        kept = torch.rand(z.shape, generator=self.generator) >= self.share
        return z * kept / (1.0 - self.share)


def _bare(layer: type[nn.Module], *args: Any, **kwargs: Any) -> nn.Module:
    """A layer without initial weights, which torch would draw from its global generator."""
    return layer(*args, device="meta", **kwargs).to_empty(device="cpu")


@torch.no_grad()
def _initialise(module: nn.Module, generator: torch.Generator) -> None:
    """Torch's own default: every weight and bias uniform within 1 / sqrt(fan-in), in the order of the layers."""
    for layer in module.modules():
        if isinstance(layer, nn.Linear | nn.Conv1d):
            fan_in = layer.weight[0].numel()
        elif isinstance(layer, nn.RNNBase):
            fan_in = layer.hidden_size
        else:
            continue
        for parameter in layer.parameters(recurse=False):
            parameter.uniform_(-(fan_in**-0.5), fan_in**-0.5, generator=generator)


def _head(n_in: int, spec: NetworkSpec, n_out: int, generator: torch.Generator) -> nn.Sequential:
    """``W_xi dropout(phi(W z + b)) + b_xi``, with which CNN, RNN and LSTM end."""
    return nn.Sequential(
        _bare(nn.Linear, n_in, spec.hidden_size),
        _ACTIVATIONS[spec.activation](),
        LocalDropout(spec.dropout, generator),
        _bare(nn.Linear, spec.hidden_size, n_out),
    )


def _flat_width(spec: NetworkSpec) -> int:
    width = spec.n_past * (spec.n_past_columns + spec.reads_zeta) + spec.n_leads * spec.n_future_columns
    return max(width, 1)


class FeedForward(nn.Module):
    """MLP and CNN: all features of past and future, one after the other, in; all leads out."""

    def __init__(self, spec: NetworkSpec, generator: torch.Generator) -> None:
        super().__init__()
        self.spec = spec
        body = _mlp_body if spec.kind == "mlp" else _cnn_body
        self.body = body(spec, generator)

    def forward(self, zeta: Tensor, past: Tensor, future: Tensor, base: Tensor) -> Tensor:
        """Forecast (n_windows, n_leads)."""
        parts = [zeta[:, 1:]] if self.spec.reads_zeta else []
        psi = torch.cat([*parts, past.flatten(1), future.flatten(1)], dim=1)
        return base + self.body(psi)


def _mlp_body(spec: NetworkSpec, generator: torch.Generator) -> nn.Sequential:
    layers: list[nn.Module] = []
    width = _flat_width(spec)
    for _ in range(spec.n_layers):
        layers += [_bare(nn.Linear, width, spec.hidden_size), _ACTIVATIONS[spec.activation]()]
        layers.append(LocalDropout(spec.dropout, generator))
        width = spec.hidden_size
    return nn.Sequential(*layers, _bare(nn.Linear, width, spec.n_leads))


def _cnn_body(spec: NetworkSpec, generator: torch.Generator) -> nn.Sequential:
    """``n_layers + 1`` convolutions over the one-dimensional input vector, as in Eq. CNN, then the head."""
    layers: list[nn.Module] = [nn.Unflatten(1, (1, _flat_width(spec)))]
    length, channels = _flat_width(spec), 1
    padding = spec.filter_size // 2
    for _ in range(spec.n_layers + 1):
        layers.append(_bare(nn.Conv1d, channels, spec.n_channels, spec.filter_size, padding=padding))
        length, channels = length + 2 * padding - spec.filter_size + 1, spec.n_channels
        if 1 < spec.pool_size <= length:  # a vector shorter than the pool is left as it is
            layers.append(nn.MaxPool1d(spec.pool_size))
            length //= spec.pool_size
        layers.append(_ACTIVATIONS[spec.activation]())
    return nn.Sequential(*layers, nn.Flatten(), _head(length * channels, spec, spec.n_leads, generator))


class Recurrent(nn.Module):
    """RNN and LSTM: step k consumes zeta(k - 1) and the columns of row k.

    The past is run with the measured disturbance; over the horizon the network's own outputs stand in for it.
    """

    def __init__(self, spec: NetworkSpec, generator: torch.Generator) -> None:
        super().__init__()
        if spec.n_past_columns != spec.n_future_columns:
            raise ValueError("a recurrent network needs the same columns in past and future.")
        self.spec = spec
        cell = nn.RNN if spec.kind == "rnn" else nn.LSTM
        width = max(spec.n_past_columns + spec.reads_zeta, 1)
        self.cell = _bare(cell, width, spec.hidden_size, num_layers=spec.n_layers, batch_first=True)
        self.head = _head(spec.hidden_size, spec, 1, generator)

    def _inputs(self, zeta: Tensor, columns: Tensor) -> Tensor:
        """(n_windows, n_steps, width) from zeta (n_windows, n_steps) and columns (n_windows, n_columns, n_steps)."""
        steps = columns.transpose(1, 2)
        return torch.cat([zeta[:, :, None], steps], dim=2) if self.spec.reads_zeta else steps

    def forward(self, zeta: Tensor, past: Tensor, future: Tensor, base: Tensor) -> Tensor:
        """Forecast (n_windows, n_leads), decoded lead by lead."""
        _, hidden = self.cell(self._inputs(zeta[:, :-1], past))
        previous, outputs = zeta[:, -1:], []
        for lead in range(base.shape[1]):
            h, hidden = self.cell(self._inputs(previous, future[:, :, lead : lead + 1]), hidden)
            previous = base[:, lead : lead + 1] + self.head(h[:, 0])
            outputs.append(previous)
        return torch.cat(outputs, dim=1)


def build_network(spec: NetworkSpec, generator: torch.Generator, corrects: bool = False) -> nn.Module:
    """A network with initial weights.

    Parameters
    ----------
    spec : NetworkSpec
        Its shape.
    generator : torch.Generator
        Source of the initial weights and, later, of dropout.
    corrects : bool, default False
        Whether it corrects a baseline: then its last layer begins at zero, which is the baseline itself.

    Returns
    -------
    torch.nn.Module
        Takes ``zeta``, ``past``, ``future``, ``base``.
    """
    module = (FeedForward if spec.kind in ("mlp", "cnn") else Recurrent)(spec, generator)
    _initialise(module, generator)
    if corrects:
        last = [layer for layer in module.modules() if isinstance(layer, nn.Linear)][-1]
        with torch.no_grad():
            last.weight.zero_()
            last.bias.zero_()
    return module
