"""The four networks (paper Eqs. MLP, CNN, RNN, LSTM), several of one shape side by side.

A network that is trained alone is a stack of one member.  All of them map the same window to the forecast of every
lead, in z-scores; the first axis counts members, the second windows:

====== ======================================== =====================================================
zeta   (n_members, n_windows, n_past + 1)         disturbance of the rows origin - n_past ... origin
past   (n_members, n_windows, n_columns, n_past)  columns of the rows origin - n_past + 1 ... origin
future (n_members, n_windows, n_columns, n_leads) columns of the rows origin + 1 ... origin + n_leads
base   (n_members, n_windows, n_leads)            baseline forecast that is corrected; 0 where there is none
====== ======================================== =====================================================

Initial weights and dropout of a member are drawn from its own generator: torch's global state is neither read nor
changed.  On the CPU compiled kernels train and forecast, member after member, so that each is to the bit what it would
be alone; torch's own operators, here, serve other devices, and hold the kernels to account in tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..filtering import ConvShape, DenseShape, RecurrentShape
from .activations import Activations
from .compiled import DEVICE, forecast_members
from .recurrent import decode, linear

#: Weights of a layer begin at a multiple of this, four vector registers' worth of numbers.
_ALIGNMENT = 32
#: Hidden and output widths are stored in multiples of this.  The weights of the filling are 0, and so are their
#: gradients.
_FILLED = 4
_GATES = {"rnn": 1, "lstm": 4}


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
        """What members of a stack must share: all but the activation and the share of dropout."""
        return self._replace(activation="", dropout=0.0)


class _Layer(NamedTuple):
    """Weights of one layer of one member."""

    name: str
    shape: tuple[int, ...]  # of the weight, as stored
    fan_in: int  # what torch's own default draws by
    rows: Tensor  # which inputs and outputs of a dense layer are no filling, bool
    columns: Tensor


def _live(*widths: int) -> Tensor:
    """Which numbers of filled vectors, one behind the other, are no filling."""
    return torch.cat([torch.arange(-(-width // _FILLED) * _FILLED) < width for width in widths])


def _every(width: int) -> Tensor:
    return torch.ones(width, dtype=torch.bool)


def _dense(name: str, rows: Tensor, columns: Tensor, fan_in: int | None = None) -> _Layer:
    n_in = int(rows.sum()) if fan_in is None else fan_in
    return _Layer(name, (len(rows), len(columns)), max(n_in, 1), rows, columns)


def _mlp_layers(spec: NetworkSpec) -> list[_Layer]:
    hidden = _live(spec.hidden_size)
    inputs = [_every(spec.flat_width), *[hidden] * spec.n_layers]
    return [
        *(_dense(f"hidden{i}", inputs[i], hidden) for i in range(spec.n_layers)),
        _dense("out", hidden, _live(spec.n_leads)),
    ]


def _pooled(length: int, spec: NetworkSpec) -> int:
    """Length after max-pooling; a vector shorter than the pool is left as it is."""
    return length // spec.pool_size if 1 < spec.pool_size <= length else length


def _conv_lengths(spec: NetworkSpec) -> list[tuple[int, int, int]]:
    """Of each of the ``n_layers + 1`` convolutions: places of its input, of its output, and of what is pooled."""
    lengths, n_in = [], spec.flat_width
    for _ in range(spec.n_layers + 1):
        n_out = n_in + 2 * (spec.filter_size // 2) - spec.filter_size + 1
        lengths.append((n_in, n_out, _pooled(n_out, spec)))
        n_in = lengths[-1][-1]
    return lengths


def _cnn_layers(spec: NetworkSpec) -> list[_Layer]:
    """``n_layers + 1`` convolutions over the one-dimensional input vector, as in Eq. CNN, then the head."""
    layers, lengths, channels = [], _conv_lengths(spec), 1
    for i in range(len(lengths)):
        shape = (spec.n_channels, channels, spec.filter_size)
        layers.append(_Layer(f"conv{i}", shape, channels * spec.filter_size, _every(0), _every(spec.n_channels)))
        channels = spec.n_channels
    return layers + _head_layers(_every(lengths[-1][-1] * channels), spec.n_leads, spec)


def _recurrent_layers(spec: NetworkSpec) -> list[_Layer]:
    n = spec.hidden_size
    gates = _live(*[n] * _GATES[spec.kind])
    below = [_every(spec.n_past_columns + spec.reads_zeta), *[_live(n)] * (spec.n_layers - 1)]
    # the rows of a weight: what comes from below, then the layer's own hidden state
    cells = [_dense(f"cell{i}", torch.cat([rows, _live(n)]), gates, fan_in=n) for i, rows in enumerate(below)]
    return cells + _head_layers(_live(n), 1, spec)


def _head_layers(rows: Tensor, n_out: int, spec: NetworkSpec) -> list[_Layer]:
    hidden = _live(spec.hidden_size)
    return [_dense("hidden", rows, hidden), _dense("out", hidden, _live(n_out))]


_LAYERS = {"mlp": _mlp_layers, "cnn": _cnn_layers, "rnn": _recurrent_layers, "lstm": _recurrent_layers}


class NetworkStack(nn.Module):
    """Networks of one shape side by side, whose weights are the rows of one matrix.

    Parameters
    ----------
    specs : NetworkSpec or sequence of NetworkSpec
        Of every member, or one a member: they may differ in activation and dropout.
    generators : sequence of torch.Generator
        One a member: source of its initial weights and, later, of its dropout and batches.
    corrects : bool, default False
        Whether members correct a baseline: then their last layer begins at zero, which is the baseline itself.

    Attributes
    ----------
    flat : Parameter of shape (n_members, n_weights)
        All weights; the layers are views of it, so that an optimiser has one tensor to step.
    members : list of int
        The number of each row, which stays when others are taken out.
    """

    def __init__(
        self,
        specs: NetworkSpec | Sequence[NetworkSpec],
        generators: Sequence[torch.Generator],
        corrects: bool = False,
    ) -> None:
        super().__init__()
        self.generators = list(generators)
        self.members = list(range(len(self.generators)))
        self._elsewhere: dict[int, torch.Generator] = {}
        self.specs = [specs] * len(self.members) if isinstance(specs, NetworkSpec) else list(specs)
        spec = self.specs[0]
        if spec.kind in _GATES and spec.n_past_columns != spec.n_future_columns:
            raise ValueError("a recurrent network needs the same columns in past and future.")
        if any(one.shape != spec.shape for one in self.specs):
            raise ValueError("members of a stack must be of one shape.")
        self.spec = spec
        self._phi = Activations([one.activation for one in self.specs])
        self.layers = _LAYERS[spec.kind](spec)
        self._width = len(_live(spec.hidden_size))
        self._sizes: list[int] = []  # of each weight and of what fills it up
        for layer in self.layers:
            for size in (torch.Size(layer.shape).numel(), len(layer.columns)):
                self._sizes += [size, -size % _ALIGNMENT]
        self.flat = nn.Parameter(torch.zeros(len(self.generators), sum(self._sizes)))
        self._initialise(corrects)

    # -------------------------------------------------------------------------------------------------------- weights
    @torch.no_grad()
    def _initialise(self, corrects: bool) -> None:
        """Torch's own default: every weight and bias uniform within 1 / sqrt(fan-in), in the order of the layers."""
        weights = self.weights()
        for layer in self.layers[:-1] if corrects else self.layers:
            bound = layer.fan_in**-0.5
            live = _every(1) if layer.name.startswith("conv") else layer.rows[:, None] & layer.columns
            for part, where in (("weight", live), ("bias", layer.columns)):
                for member, generator in zip(weights[f"{layer.name}.{part}"], self.generators, strict=True):
                    member.uniform_(-bound, bound, generator=generator).mul_(where)

    @cached_property
    def places(self) -> np.ndarray:
        """Of dense layers: where a weight begins in a member's row, its inputs and outputs, where its bias begins."""
        begins = np.cumsum([0, *self._sizes])[:-1:2]
        shapes = [(layer.shape[0], layer.shape[-1]) for layer in self.layers]
        return np.array([(w, *s, b) for w, s, b in zip(begins[::2], shapes, begins[1::2], strict=True)])

    def weights(self) -> dict[str, Tensor]:
        """Views of the weights by name.

        Returns
        -------
        dict of str to Tensor
            ``<layer>.weight`` (n_members, n_in, n_out), of a convolution (n_members, n_out, n_in, width), and
            ``<layer>.bias`` (n_members, n_out), with the filling.
        """
        pieces = self.flat.split(self._sizes, dim=1)[::2]
        n = len(self.flat)
        named = {}
        for layer, weight, bias in zip(self.layers, pieces[::2], pieces[1::2], strict=True):
            named[f"{layer.name}.weight"] = weight.view(n, *layer.shape)
            named[f"{layer.name}.bias"] = bias
        return named

    @torch.no_grad()
    def set_weights(self, weights: dict[str, Tensor]) -> NetworkStack:
        """Take weights named as :meth:`weights` names them."""
        for name, view in self.weights().items():
            view.copy_(weights[name])
        return self

    def keep(self, rows: list[int]) -> None:
        """Take the other members out; ``flat`` is another parameter after it."""
        self.generators = [self.generators[row] for row in rows]
        self.members = [self.members[row] for row in rows]
        self.specs = [self.specs[row] for row in rows]
        self._phi = Activations([one.activation for one in self.specs])
        self.flat = nn.Parameter(self.flat.detach()[rows])

    # ------------------------------------------------------------------------------------------------------- equations
    def forward(self, zeta: Tensor, past: Tensor, future: Tensor, base: Tensor) -> Tensor:
        """Forecast (n_members, n_windows, n_leads)."""
        spec = self.spec
        if not (torch.is_grad_enabled() or self.training) and self.flat.device.type == DEVICE:
            members = (self.flat, spec.kind, spec.reads_zeta, self.shapes())
            return forecast_members(*members, zeta, past, future, base)
        weights = self.weights()
        if spec.kind in _GATES:
            mask = self._mask(spec.n_leads, self._width, base.shape[1])
            return decode(weights, spec.kind, spec.reads_zeta, self._phi.apply, mask, zeta, past, future, base)
        parts = [zeta[..., 1:]] if spec.reads_zeta else []
        psi = torch.cat([*parts, past.flatten(2), future.flatten(2)], dim=2)
        body = self._mlp if spec.kind == "mlp" else self._cnn
        return base + body(weights, psi)[..., : spec.n_leads]

    def _mask(self, *shape: int) -> Tensor | None:
        """Factors of dropout (n_members, *shape), each member's from its own generator; None where nothing drops."""
        shares = [spec.dropout for spec in self.specs]
        if not self.training or not any(shares):
            return None
        mask = torch.ones(len(shares), *shape, device=self.flat.device)
        for member, share, generator in zip(mask, shares, self._droppers(), strict=True):
            if share:
                member.uniform_(generator=generator).ge_(share).mul_(1.0 / (1.0 - share))
        return mask

    def _droppers(self) -> list[torch.Generator]:
        """Generators of dropout: the members' own, or on another device one that each of them has seeded."""
        device = self.flat.device
        if device.type == "cpu":
            return self.generators
        for member, own in zip(self.members, self.generators, strict=True):
            if member not in self._elsewhere:
                seed = int(torch.randint(2**62, (), generator=own))
                self._elsewhere[member] = torch.Generator(device).manual_seed(seed)
        return [self._elsewhere[member] for member in self.members]

    def _hidden(self, weights: dict[str, Tensor], name: str, z: Tensor, mask: Tensor | None) -> Tensor:
        """``dropout(phi(W z + b))``."""
        z = self._phi.apply(linear(weights, name, z))
        return z if mask is None else z * mask

    def _mlp(self, weights: dict[str, Tensor], psi: Tensor) -> Tensor:
        """Eq. MLP."""
        z = psi
        for i in range(self.spec.n_layers):
            z = self._hidden(weights, f"hidden{i}", z, self._mask(z.shape[1], self._width))
        return linear(weights, "out", z)

    def _cnn(self, weights: dict[str, Tensor], psi: Tensor) -> Tensor:
        """Eq. CNN: members are groups of one convolution."""
        n_members, z = len(psi), psi.transpose(0, 1)
        for name in [layer.name for layer in self.layers if layer.name.startswith("conv")]:
            weight, bias = weights[f"{name}.weight"].flatten(0, 1), weights[f"{name}.bias"].flatten()
            z = F.conv1d(z, weight, bias, padding=self.spec.filter_size // 2, groups=n_members)
            if _pooled(z.shape[2], self.spec) != z.shape[2]:
                z = F.max_pool1d(z, self.spec.pool_size)
            z = self._phi.apply(z.unflatten(1, (n_members, -1)).transpose(0, 1)).transpose(0, 1).flatten(1, 2)
        z = z.unflatten(1, (n_members, -1)).transpose(0, 1).flatten(2)
        return self._head(weights, z, self._mask(z.shape[1], self._width))

    def _head(self, weights: dict[str, Tensor], z: Tensor, mask: Tensor | None) -> Tensor:
        """``W_xi dropout(phi(W z + b)) + b_xi``, with which CNN, RNN and LSTM end."""
        return linear(weights, "out", self._hidden(weights, "hidden", z, mask))

    def shapes(self) -> list[Any]:
        """The members as their kernels know them."""
        if self.spec.kind in _GATES:
            return self._recurrent_shapes()
        return self._conv_shapes() if self.spec.kind == "cnn" else self._dense_shapes()

    def _recurrent_shapes(self) -> list[RecurrentShape]:
        n_gates, reads = _GATES[self.spec.kind], self.spec.reads_zeta
        each = zip(self._phi.codes, self.specs, strict=True)
        return [RecurrentShape(self.places, n_gates, code, float(spec.dropout), reads) for code, spec in each]

    def _dense_shapes(self) -> list[DenseShape]:
        """MLPs, or the heads of CNNs, as their kernels know them."""
        n_layers = len([layer for layer in self.layers if not layer.name.startswith("conv")])
        each = zip(self._phi.codes, self.specs, strict=True)
        return [DenseShape(self.places[-n_layers:], code, float(spec.dropout)) for code, spec in each]

    def _conv_shapes(self) -> list[ConvShape]:
        spec, lengths = self.spec, _conv_lengths(self.spec)
        places = self.places[: len(lengths)].copy()
        places[:, 1] = [layer.fan_in for layer in self.layers[: len(lengths)]]
        places[:, 2] = spec.n_channels
        sizes = (spec.filter_size, spec.pool_size)
        return [ConvShape(places, np.array(lengths), *sizes, head) for head in self._dense_shapes()]
