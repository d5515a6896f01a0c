"""Torch modules of RNN and LSTM (paper Eqs. 21 and 22): stacks that decode autoregressively over the horizon.

Step k reads zeta(k - 1) and the columns of row k.  The past is run with the measured disturbance; over the horizon the
network's own outputs stand in for it.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from .modules import NetworkStack, dense

_State = tuple[Tensor, Tensor]
_MINUS_ONE = torch.tensor(-1.0)


class RNNStep(torch.autograd.Function):
    """A step of torch's documented RNN cell, ``h' = tanh(W z)``, for every network.

    Gradients of this step and of :class:`LSTMStep` are written: autograd would keep and pass over several times as
    many tensors.  Shapes: weight (n_networks, n_gates, n_z), z (n_networks, n_z, n_windows), which holds the inputs, a
    1 for the bias and the hidden state.  ``doubled`` is made from the weight by :func:`doubled_for_tanh`.
    """

    @staticmethod
    def forward(ctx: Any, weight: Tensor, doubled: Tensor, z: Tensor, c: Tensor) -> _State:
        h = _finish_tanh_(torch.bmm(doubled, z).sigmoid_())
        ctx.save_for_backward(weight, z, h)
        return h, c

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dh: Tensor, dc: Tensor) -> tuple[Tensor, None, Tensor, Tensor]:
        weight, z, h = ctx.saved_tensors
        dgates = torch.ops.aten.tanh_backward(dh, h)
        return *_product_gradients(weight, z, dgates), dc


class LSTMStep(torch.autograd.Function):
    """A step of torch's LSTM cell, ``c' = f c + i g`` and ``h' = o tanh(c')``; gates in the order i, f, o, g."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, doubled: Tensor, z: Tensor, c: Tensor) -> _State:
        gates = torch.bmm(doubled, z).sigmoid_()
        i, f, o, g = gates.chunk(4, dim=1)
        c_next = (f * c).addcmul_(i, _finish_tanh_(g))
        squashed = _finish_tanh_(c_next.mul(2.0).sigmoid_())
        ctx.save_for_backward(weight, z, c, gates, squashed)
        return o * squashed, c_next

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dh: Tensor, dc_next: Tensor) -> tuple[Tensor, None, Tensor, Tensor]:
        weight, z, c, gates, squashed = ctx.saved_tensors
        i, f, o, g = gates.chunk(4, dim=1)
        dc = torch.ops.aten.tanh_backward(dh * o, squashed).add_(dc_next)
        dgates = torch.empty_like(gates)
        for part, factors in zip(dgates.chunk(4, dim=1), ((dc, g), (dc, c), (dh, squashed), (dc, i)), strict=True):
            torch.mul(*factors, out=part)
        dsigmoids, dg = dgates.split([3 * c.shape[1], c.shape[1]], dim=1)
        torch.ops.aten.sigmoid_backward(dsigmoids, gates[:, : 3 * c.shape[1]], grad_input=dsigmoids)
        torch.ops.aten.tanh_backward(dg, g, grad_input=dg)
        return *_product_gradients(weight, z, dgates), dc.mul_(f)


def doubled_for_tanh(weight: Tensor, n: int) -> Tensor:
    """A copy whose last ``n`` gates, those of tanh, are doubled: the sigmoid of all gates is then one call.

    ``tanh(x) = 2 sigmoid(2 x) - 1``; torch's sigmoid takes a fifth of the time of its tanh on a CPU.
    """
    doubled = weight.detach().clone()
    doubled[:, -n:] *= 2.0
    return doubled


def _finish_tanh_(x: Tensor) -> Tensor:
    """``2 x - 1`` in place and in one pass."""
    return torch.add(_MINUS_ONE, x, alpha=2.0, out=x)


def _product_gradients(weight: Tensor, z: Tensor, dgates: Tensor) -> tuple[Tensor, None, Tensor]:
    """Gradients of the weight, of its doubled copy (none) and of z."""
    # the transposed product is faster: its rows are as long as there are gates
    dweight = torch.bmm(z, dgates.transpose(1, 2)).transpose(1, 2)
    return dweight, None, torch.bmm(weight.transpose(1, 2), dgates)


class RecurrentStack(NetworkStack):
    """Eqs. 21 and 22 over sequences (n_networks, n_windows, n_columns + 1, n_past + n_leads), the last column 1."""

    def forward(self, inputs: Tensor, base: Tensor, kept: Tensor | None = None) -> Tensor:
        """Forecasts (n_networks, n_windows, n_leads)."""
        spec, weights = self.spec, self.weights()
        columns = inputs.permute(3, 0, 2, 1).contiguous().unbind()
        own = [self._cell_weight(weights, i) for i in range(spec.n_layers)]
        cells = [(weight, doubled_for_tanh(weight, spec.hidden_size)) for weight in own]
        zero = base.new_zeros(len(base), spec.hidden_size, base.shape[1])
        states, one = [(zero, zero)] * spec.n_layers, base.new_ones(len(base), 1, base.shape[1])
        offsets = (base.transpose(1, 2) + weights["out.bias"][:, :, None]).split(1, dim=1)
        outputs: list[Tensor] = []
        for k, x in enumerate(columns):
            lead = k - spec.n_past
            # from the second lead on, the last output stands in for zeta
            below = [outputs[-1], x[:, 1:]] if lead > 0 and spec.reads_zeta else [x]
            states = self._step(cells, below, one, states)
            if lead >= 0:
                factors = None if kept is None else kept[:, lead]
                outputs.append(self._head(weights, states[-1][0], offsets[lead], factors))
        return torch.cat(outputs, dim=1).transpose(1, 2)

    def _cell_weight(self, weights: dict[str, Tensor], i: int) -> Tensor:
        """Weight (n_networks, n_gates, n_z) of a layer over its inputs, a 1 for the bias, and its hidden state."""
        weight, bias = weights[f"cell{i}.weight"], weights[f"cell{i}.bias"]
        n = self.spec.hidden_size
        below, hidden = weight.split([weight.shape[2] - n, n], dim=2)
        return torch.cat([below, bias[:, :, None], hidden], dim=2)

    def _step(self, cells: list[_State], below: list[Tensor], one: Tensor, states: list[_State]) -> list[_State]:
        """States of all layers after a step; ``below`` is what the first of them reads, with the 1 of its bias."""
        step = LSTMStep if self.spec.kind == "lstm" else RNNStep
        after: list[_State] = []
        for cell, (h, c) in zip(cells, states, strict=True):
            after.append(step.apply(*cell, torch.cat([*below, h], dim=1), c))
            below = [after[-1][0], one]
        return after

    def _head(self, weights: dict[str, Tensor], h: Tensor, offset: Tensor, factors: Tensor | None) -> Tensor:
        """``offset + W_xi dropout(phi(W h + b))``, (n_networks, 1, n_windows)."""
        z = self.activate(dense(weights, "hidden", h))
        return torch.baddbmm(offset, weights["out.weight"], z if factors is None else z * factors)
