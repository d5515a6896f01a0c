"""RNN and LSTM stacks step by step, with the gradient written out (paper Eqs. RNN and LSTM).

torch's automatic gradient remembers some twenty tensors a step and adds up a gradient of the weights at each; here a
step is one product of matrices a layer and one pass over the gates (:mod:`skhybrid._kernels.gates`), and what the
gradient needs is kept in memory that the next batch uses again.  Numbers lie as (n_members, n_rows, n_windows): windows
last, so that every gate of a member is one run of memory.

A layer's product reads at every step the column ``[own state, 1, input, filling]``, of which the 1 multiplies the bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor

from .._kernels import lstm_backward, lstm_forward, rnn_backward, rnn_forward
from .activations import Activations

_GATES = {"rnn": 1, "lstm": 4}
#: rows of a column come in multiples of this.
_FILLED = 4


class Shape(NamedTuple):
    """What fixes the memory of a run."""

    kind: str  # "rnn" or "lstm"
    n_layers: int
    n_members: int
    width: int  # of a hidden state, filling included
    n_inputs: int  # of the lowest layer
    n_past: int
    n_leads: int
    n_windows: int

    @property
    def n_steps(self) -> int:
        """Rows of history and horizon."""
        return self.n_past + self.n_leads

    @property
    def n_numbers(self) -> int:
        """How many numbers a run keeps."""
        kept = self.width * (_GATES[self.kind] + (2 if self.kind == "lstm" else 0))
        each = sum(self.rows(layer) + kept for layer in range(self.n_layers))
        return self.n_members * self.n_windows * self.n_steps * each

    def rows(self, layer: int) -> int:
        """Length of a layer's column."""
        n = self.width + 1 + (self.width if layer else self.n_inputs)
        return -(-n // _FILLED) * _FILLED


class Space:
    """Memory of a run, which the next run of equal shape uses again.

    Parameters
    ----------
    shape : Shape
        Of the run.
    """

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self.n_runs = 0
        m, n, w, steps = shape.n_members, shape.width, shape.n_windows, shape.n_steps
        layers = range(shape.n_layers)
        self.columns = [torch.zeros(steps + 1, m, shape.rows(i), w) for i in layers]
        gates = [torch.empty(steps, m, n * _GATES[shape.kind], w) for i in layers]
        memories = layers if shape.kind == "lstm" else ()
        c = [torch.zeros(steps + 1, m, n, w) for _ in memories]
        tanh_c = [torch.empty(steps, m, n, w) for _ in memories]
        # step by step, as torch and as numpy sees them: to make a view takes longer than a small product
        self.column = [whole.unbind() for whole in self.columns]
        self.own = [[step[:, :n] for step in layer] for layer in self.column]
        self.above = [[step[:, n + 1 : 2 * n + 1] for step in layer] for layer in self.column[1:]]
        self.gate = [whole.unbind() for whole in gates]
        self.column_array = [[step.numpy() for step in layer] for layer in self.column]
        self.gate_array, self.c_array, self.tanh_c_array = (
            [[step.numpy() for step in whole.unbind()] for whole in kept] for kept in (gates, c, tanh_c)
        )
        self.z = torch.empty(shape.n_leads, m, n, w)  # of the head, before phi
        self.q = torch.zeros(shape.n_leads, m, n + _FILLED, w)  # after it, and the 1 of the bias
        self.q[:, :, n] = 1.0
        self.outputs = torch.empty(shape.n_leads, m, w)
        for columns in self.columns:
            columns[:, :, n] = 1.0

    def load(self, zeta: Tensor | None, past: Tensor, future: Tensor) -> None:
        """Lay out the inputs (n_members, n_windows, [n_columns,] n_steps) of the lowest layer."""
        self.n_runs += 1
        first, n_past = self.shape.width + 1, self.shape.n_past
        columns = self.columns[0]
        if zeta is not None:
            columns[: n_past + 1, :, first] = zeta.permute(2, 0, 1)
            first += 1
        rows = slice(first, first + past.shape[2])
        columns[:n_past, :, rows] = past.permute(3, 0, 2, 1)
        columns[n_past:-1, :, rows] = future.permute(3, 0, 2, 1)


class Weights(NamedTuple):
    """Weights as a run reads them: the bias is a row of each matrix."""

    cells: list[Tensor]  # (n_members, rows of the column, n_gates)
    hidden: Tensor  # (n_members, width + 1, width)
    out: Tensor  # (n_members, width + _FILLED, n_out)


def packed(named: Sequence[Tensor], width: int) -> Weights:
    """Weights and biases, layer by layer, as a run reads them."""
    pairs = list(zip(named[::2], named[1::2], strict=True))
    cells = []
    for weight, bias in pairs[:-2]:
        n_inputs = weight.shape[1] - width
        parts = [weight[:, n_inputs:], bias[:, None], weight[:, :n_inputs]]
        cells.append(_filled(torch.cat(parts, dim=1)))
    (hidden, hidden_bias), (out, out_bias) = pairs[-2:]
    head = torch.cat([hidden, hidden_bias[:, None]], dim=1)
    return Weights(cells, head, _filled(torch.cat([out, out_bias[:, None]], dim=1)))


def _filled(weight: Tensor) -> Tensor:
    return torch.nn.functional.pad(weight, (0, 0, 0, -weight.shape[1] % _FILLED))


def _unpacked(gradient: Tensor, width: int, n_inputs: int) -> tuple[Tensor, Tensor]:
    """The gradient of a cell's weight and bias, from that of its packed matrix."""
    own, bias = gradient[:, :width], gradient[:, width]
    return torch.cat([gradient[:, width + 1 : width + 1 + n_inputs], own], dim=1), bias


class Decoded(torch.autograd.Function):
    """Forecasts (n_leads, n_members, n_windows) from inputs that :meth:`Space.load` laid out."""

    @staticmethod
    def forward(
        ctx: Any, space: Space, base: Tensor, reads: bool, mask: Tensor | None, phi: Activations, *named: Tensor
    ) -> Tensor:
        """Run the past, then the horizon, over which the network's own outputs stand in for ``zeta``."""
        weights = packed(named, space.shape.width)
        ctx.context = space, space.n_runs, reads, mask, phi, weights
        shape, top = space.shape, space.shape.n_layers - 1
        turned = [cell.transpose(1, 2).contiguous() for cell in weights.cells]
        hidden, out = weights.hidden.transpose(1, 2), weights.out.transpose(1, 2)
        n = shape.width
        for step in range(shape.n_steps):
            for layer in range(shape.n_layers):
                _advance(space, turned[layer], layer, step)
            lead = step - shape.n_past
            if lead < 0:
                continue
            z, q = space.z[lead], space.q[lead]
            torch.bmm(hidden, space.columns[top][step + 1][:, : n + 1], out=z)
            phi(z, mask if mask is None else mask[lead], q[:, :n])
            forecast = torch.add(torch.bmm(out, q)[:, 0], base[lead], out=space.outputs[lead])
            if reads:
                space.columns[0][step + 1][:, n + 1] = forecast
        return space.outputs.clone()

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Any, ...]:
        """The gradient of the weights, from the last step to the first."""
        space, run, reads, mask, phi, weights = ctx.context
        if run != space.n_runs:
            raise RuntimeError("the stack has run again since; call backward before the next forward.")
        shape, (gradient,) = space.shape, gradients
        n, top = shape.width, shape.n_layers - 1
        state = _Backward(space, weights)
        for step in reversed(range(shape.n_steps)):
            lead = step - shape.n_past
            if lead >= 0:
                given = gradient[lead]
                if reads and lead + 1 < shape.n_leads:
                    given = given + state.of_zeta
                state.d_out[:, 0] = given
                state.d_head.out.baddbmm_(space.q[lead], state.d_out.transpose(1, 2))
                dz = torch.bmm(weights.out[:, :n], state.d_out)
                dz = phi.backward(dz, space.z[lead], mask if mask is None else mask[lead])
                state.d_head.hidden.baddbmm_(space.columns[top][step + 1][:, : n + 1], dz.transpose(1, 2))
                state.dh[top].baddbmm_(weights.hidden[:, :n], dz)
            for layer in reversed(range(shape.n_layers)):
                state.step(layer, step)
        found: list[Tensor] = []
        for layer, d_cell in enumerate(state.d_head.cells):
            found += _unpacked(d_cell, n, n if layer else shape.n_inputs)
        for d in (state.d_head.hidden, state.d_head.out):
            found += (d[:, :n], d[:, n])
        return (None, None, None, None, None, *found)


def _advance(space: Space, turned: Tensor, layer: int, step: int) -> None:
    """One step of one layer: torch's documented RNN cell (tanh) or LSTM cell, gates in the order i, f, o, g."""
    torch.bmm(turned, space.column[layer][step], out=space.gate[layer][step])
    gates, column = space.gate_array[layer][step], space.column_array[layer][step + 1]
    if space.shape.kind == "rnn":
        rnn_forward(gates, column)
    else:
        c = space.c_array[layer]
        lstm_forward(gates, c[step], c[step + 1], space.tanh_c_array[layer][step], column)
    if layer + 1 < space.shape.n_layers:
        space.above[layer][step].copy_(space.own[layer][step + 1])


class _Backward:
    """What the gradient carries from a step to the one before."""

    def __init__(self, space: Space, weights: Weights) -> None:
        shape = space.shape
        m, n, w = shape.n_members, shape.width, shape.n_windows
        self.space, self.weights = space, weights
        self.dh = [torch.zeros(m, n, w) for _ in range(shape.n_layers)]
        self.dc = [torch.zeros(m, n, w).numpy() for _ in range(shape.n_layers)]
        self.dz = torch.empty(m, n * _GATES[shape.kind], w)
        self.dz_turned = self.dz.transpose(1, 2)
        self.dh_array, self.dz_array = [dh.numpy() for dh in self.dh], self.dz.numpy()
        self.d_column = [torch.empty(m, shape.rows(layer), w) for layer in range(shape.n_layers)]
        self.d_own = [d_column[:, :n] for d_column in self.d_column]
        self.d_out = torch.zeros(m, weights.out.shape[2], w)
        self.d_head = Weights(
            [torch.zeros_like(cell) for cell in weights.cells],
            torch.zeros_like(weights.hidden),
            torch.zeros_like(weights.out),
        )

    @property
    def of_zeta(self) -> Tensor:
        """What the later step's input ``zeta`` had."""
        return self.d_column[0][:, self.space.shape.width + 1]

    def step(self, layer: int, step: int) -> None:
        """Take one layer one step back."""
        n, space = self.space.shape.width, self.space
        gates, dh, dz = space.gate_array[layer][step], self.dh_array[layer], self.dz_array
        if space.shape.kind == "rnn":
            rnn_backward(gates, dh, dz)
        else:
            c, tanh_c = space.c_array[layer][step], space.tanh_c_array[layer][step]
            lstm_backward(gates, c, tanh_c, dh, self.dc[layer], dz)
        self.d_head.cells[layer].baddbmm_(space.column[layer][step], self.dz_turned)
        torch.bmm(self.weights.cells[layer], self.dz, out=self.d_column[layer])
        self.dh[layer].copy_(self.d_own[layer])
        if layer:
            self.dh[layer - 1].add_(self.d_column[layer][:, n + 1 : 2 * n + 1])
