"""Shapes of the four networks: their sizes, their layers, and the initial draw of a layer's weights."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor

#: gates of a cell
N_GATES = {"rnn": 1, "lstm": 4}
#: Weights and dropout of hidden and output values are drawn for widths rounded up to a multiple of this.  Those beyond
#: the width are dropped; another sequence of draws would give every seed another network.
_DRAWN_IN = 4


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

    @property
    def flat_width(self) -> int:
        """Length of the one-dimensional input vector of MLP and CNN."""
        return self.n_past * (self.n_past_columns + self.reads_zeta) + self.n_leads * self.n_future_columns

    @property
    def shape(self) -> NetworkSpec:
        """Key that networks of one stack share: all but activation, share of dropout and, of MLPs, number of layers."""
        return self._replace(activation="", dropout=0.0, n_layers=0 if self.kind == "mlp" else self.n_layers)

    @property
    def n_dropping(self) -> int:
        """Number of places that drop hidden values: every layer of an MLP, every lead of a cell, once in a CNN."""
        if self.kind in N_GATES:
            return self.n_leads
        return 1 if self.kind == "cnn" else self.n_layers

    def kept_shape(self, n_windows: int) -> tuple[int, int, int]:
        """Shape of the drawn factors of dropout: (n_dropping, rounded width, n_windows)."""
        return self.n_dropping, rounded_up(self.hidden_size), n_windows

    def draw_uniform(self, out: Tensor, generator: torch.Generator) -> None:
        """Fill a tensor of :meth:`kept_shape`; but in cells, windows are drawn before values."""
        if self.kind in N_GATES:
            out.uniform_(generator=generator)
            return
        drawn = torch.empty(out.transpose(1, 2).shape, device=out.device).uniform_(generator=generator)
        for layer, values in zip(out, drawn, strict=True):
            layer.copy_(values.T)  # one by one, torch transposes in blocks


class Layer(NamedTuple):
    """One layer of a network: its weight, dense (n_out, n_in) or convolution (n_out, n_in, width), and its bias."""

    name: str
    shape: tuple[int, ...]  # of the weight
    fan_in: int  # weights and biases are drawn within 1 / sqrt(fan_in)
    drawn_inputs: Tensor  # bool: the drawn inputs and outputs that a dense weight keeps
    drawn_outputs: Tensor

    def draw(self, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Weight and bias, uniform as torch's own default."""
        bound = self.fan_in**-0.5
        if len(self.shape) == 3:
            weight = torch.empty(self.shape).uniform_(-bound, bound, generator=generator)
        else:
            drawn = torch.empty(len(self.drawn_inputs), len(self.drawn_outputs))
            weight = drawn.uniform_(-bound, bound, generator=generator)[self.drawn_inputs][:, self.drawn_outputs].T
        bias = torch.empty(len(self.drawn_outputs)).uniform_(-bound, bound, generator=generator)
        return weight, bias[self.drawn_outputs]


def rounded_up(width: int) -> int:
    """The width for which numbers are drawn."""
    return -(-width // _DRAWN_IN) * _DRAWN_IN


def _kept(*widths: int) -> Tensor:
    """Whether each value is kept (bool) of those that are drawn for rounded widths, part after part."""
    return torch.cat([torch.arange(rounded_up(width)) < width for width in widths])


def _all(width: int) -> Tensor:
    return torch.ones(width, dtype=torch.bool)


def _dense(name: str, inputs: Tensor, outputs: Tensor, fan_in: int | None = None) -> Layer:
    shape = (int(outputs.sum()), int(inputs.sum()))
    return Layer(name, shape, max(shape[1] if fan_in is None else fan_in, 1), inputs, outputs)


def _mlp_layers(spec: NetworkSpec) -> list[Layer]:
    hidden = _kept(spec.hidden_size)
    inputs = [_all(spec.flat_width), *[hidden] * spec.n_layers]
    layers = [_dense(f"hidden{i}", inputs[i], hidden) for i in range(spec.n_layers)]
    return [*layers, _dense("out", hidden, _kept(spec.n_leads))]


def pooled(length: int, spec: NetworkSpec) -> int:
    """Length after max-pooling; a vector shorter than the pool is left as it is."""
    return length // spec.pool_size if 1 < spec.pool_size <= length else length


def _cnn_layers(spec: NetworkSpec) -> list[Layer]:
    """``n_layers + 1`` convolutions over the one-dimensional input vector, as in Eq. 20, then the head."""
    layers, length, channels = [], spec.flat_width, 1
    for i in range(spec.n_layers + 1):
        shape = (spec.n_channels, channels, spec.filter_size)
        layers.append(Layer(f"conv{i}", shape, channels * spec.filter_size, _all(0), _all(spec.n_channels)))
        length = pooled(length + 2 * (spec.filter_size // 2) - spec.filter_size + 1, spec)
        channels = spec.n_channels
    return layers + _head_layers(_all(length * channels), spec.n_leads, spec)


def _recurrent_layers(spec: NetworkSpec) -> list[Layer]:
    """Cells, whose weights read what comes from below and then their own hidden state, and the head."""
    n = spec.hidden_size
    gates = _kept(*[n] * N_GATES[spec.kind])
    below = [_all(spec.n_past_columns + spec.reads_zeta), *[_kept(n)] * (spec.n_layers - 1)]
    cells = [_dense(f"cell{i}", torch.cat([inputs, _kept(n)]), gates, fan_in=n) for i, inputs in enumerate(below)]
    return cells + _head_layers(_kept(n), 1, spec)


def _head_layers(inputs: Tensor, n_out: int, spec: NetworkSpec) -> list[Layer]:
    hidden = _kept(spec.hidden_size)
    return [_dense("hidden", inputs, hidden), _dense("out", hidden, _kept(n_out))]


@lru_cache(maxsize=256)
def layers_of(spec: NetworkSpec) -> tuple[Layer, ...]:
    """The layers of a network, in the order in which they are drawn."""
    return tuple({"mlp": _mlp_layers, "cnn": _cnn_layers}.get(spec.kind, _recurrent_layers)(spec))
