"""Torch modules of the paper's networks (Eqs. 19, 20, 21, 22): stacks of networks of equal shape.

A network that is trained alone is a stack of one.  The first axis of every tensor counts networks, the second windows:

====== ================================== =====================================================
inputs (n_networks, n_windows, ...)       what a window reads (:func:`~.windows.network_inputs`)
base   (n_networks, n_windows, n_leads)   baseline forecast that is corrected; 0 where there is none
kept   (n_networks, n_layers, width,      factors of dropout: 0, or 1 / (1 - share); None drops nothing
       n_windows)
====== ================================== =====================================================

Inside, windows are the last axis: products of narrow layers are faster so, and each gate of a cell is one run of
memory.  Inputs and forecasts are z-scores.  No network's forecast or gradient contains anything of another's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby, pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .spec import NetworkSpec, layers_of, pooled

_ACTIVATIONS: dict[str, Callable[[Tensor], Tensor]] = {"relu": F.relu, "selu": F.selu, "gelu": F.gelu}


class NetworkStack(nn.Module):
    """Networks of equal shape; they may differ in activation, dropout and, if MLPs, in depth; the deepest come last."""

    def __init__(self, specs: Sequence[NetworkSpec]) -> None:
        super().__init__()
        self.spec = specs[-1]
        if any(one.shape != self.spec.shape for one in specs):
            raise ValueError("networks of a stack must be of equal shape.")
        if any(a.n_layers > b.n_layers for a, b in pairwise(specs)):
            raise ValueError("the deepest networks of a stack must come last.")
        self.numbers = list(range(len(specs)))  # of the network in each row, which stays when others leave the stack
        self.specs = list(specs)
        self.layers = layers_of(self.spec)
        self._shapes = [shape for layer in self.layers for shape in (layer.shape, layer.shape[:1])]
        self._sizes = [torch.Size(shape).numel() for shape in self._shapes]
        self._names = [f"{layer.name}.{part}" for layer in self.layers for part in ("weight", "bias")]
        # (n_networks, n_weights) all weights; those of the layers are views, so that an optimiser steps one tensor.
        # Those of layers that a network does not have are 0.
        self.flat = nn.Parameter(torch.zeros(len(specs), sum(self._sizes)))

    @torch.no_grad()
    def draw_weights(self, generators: Sequence[torch.Generator], corrects: bool = False) -> NetworkStack:
        """Draw initial weights, each network's from its own generator; a correction of a baseline begins at zero."""
        weights = self.weights()
        for row, (spec, generator) in enumerate(zip(self.specs, generators, strict=True)):
            layers = layers_of(spec)
            for layer in layers[:-1] if corrects else layers:
                weight, bias = layer.draw(generator)
                weights[f"{layer.name}.weight"][row] = weight
                weights[f"{layer.name}.bias"][row] = bias
        return self

    def weights(self) -> dict[str, Tensor]:
        """Views ``<layer>.weight`` (n_networks, n_out, n_in[, width]) and ``<layer>.bias`` (n_networks, n_out)."""
        n, pieces = len(self.specs), self.flat.split(self._sizes, dim=1)
        named = zip(self._names, pieces, self._shapes, strict=True)
        return {name: piece.view(n, *shape) for name, piece, shape in named}

    def weights_by_network(self) -> list[dict[str, Tensor]]:
        """Copies of the weights of each network, without those of layers that it does not have."""
        own = [{layer.name for layer in layers_of(spec)} for spec in self.specs]
        named = [(name, name.partition(".")[0], values.detach().clone()) for name, values in self.weights().items()]
        return [{name: v[row] for name, layer, v in named if layer in names} for row, names in enumerate(own)]

    @torch.no_grad()
    def set_weights(self, weights: dict[str, Tensor]) -> NetworkStack:
        """Copy weights named as :meth:`weights` names them into the stack, which is returned."""
        for name, view in self.weights().items():
            view.copy_(weights[name])
        return self

    def keep(self, rows: list[int]) -> None:
        """Remove the networks of all other rows; ``flat`` becomes another parameter."""
        self.numbers = [self.numbers[row] for row in rows]
        self.specs = [self.specs[row] for row in rows]
        self.flat = nn.Parameter(self.flat.detach()[rows])

    def activate(self, z: Tensor) -> Tensor:
        """The activation of each of the last networks; neighbours of one kind are computed together."""
        runs = [(name, len(list(run))) for name, run in groupby(spec.activation for spec in self.specs[-len(z) :])]
        parts = z.split([length for _, length in runs])
        return torch.cat([_ACTIVATIONS[name](part) for (name, _), part in zip(runs, parts, strict=True)])


class MLPStack(NetworkStack):
    """Eq. 19 over the one-dimensional input vectors (n_networks, n_windows, flat_width)."""

    def forward(self, inputs: Tensor, base: Tensor, kept: Tensor | None = None) -> Tensor:
        """Forecasts (n_networks, n_windows, n_leads)."""
        weights, z = self.weights(), inputs.transpose(1, 2)
        ended: list[Tensor] = []  # hidden values of networks that have no further layer
        depths = [spec.n_layers for spec in self.specs]
        for i in range(depths[-1]):
            z = self.activate(dense(weights, f"hidden{i}", z))
            z = z if kept is None else z * kept[-len(z) :, i]
            n_ended = depths.count(i + 1)
            done, z = z.split([n_ended, len(z) - n_ended])
            ended.append(done)
        return base + dense(weights, "out", torch.cat(ended)).transpose(1, 2)


class CNNStack(NetworkStack):
    """Eq. 20 over the one-dimensional input vectors (n_networks, n_windows, flat_width)."""

    def forward(self, inputs: Tensor, base: Tensor, kept: Tensor | None = None) -> Tensor:
        """Forecasts (n_networks, n_windows, n_leads)."""
        weights, z = self.weights(), inputs[:, :, None]
        for i in range(self.spec.n_layers + 1):
            z = self._convolve(z, weights[f"conv{i}.weight"], weights[f"conv{i}.bias"])
            z = self.activate(self._pool(z))
        z = self.activate(dense(weights, "hidden", z.flatten(2).transpose(1, 2)))
        return base + dense(weights, "out", z if kept is None else z * kept[:, 0]).transpose(1, 2)

    def _convolve(self, z: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """Convolutions (n_networks, n_windows, n_channels, length), on a GPU as groups of one."""
        padding = self.spec.filter_size // 2
        if z.device.type == "cpu":  # grouped convolutions take twice the time there
            return torch.stack([F.conv1d(*one, padding=padding) for one in zip(z, weight, bias, strict=True)])
        joined = z.transpose(0, 1).flatten(1, 2)
        joined = F.conv1d(joined, weight.flatten(0, 1), bias.flatten(), padding=padding, groups=len(z))
        return joined.unflatten(1, (len(z), -1)).transpose(0, 1)

    def _pool(self, z: Tensor) -> Tensor:
        if pooled(z.shape[3], self.spec) == z.shape[3]:
            return z
        return F.max_pool1d(z.flatten(0, 1), self.spec.pool_size).unflatten(0, z.shape[:2])


def dense(weights: dict[str, Tensor], name: str, z: Tensor) -> Tensor:
    """``W z + b`` of the last networks, (n_networks, n_out, n_windows)."""
    weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    if len(z) < len(weight):
        weight, bias = weight[-len(z) :], bias[-len(z) :]
    return torch.baddbmm(bias[:, :, None], weight, z)
