"""Decoding by RNN and LSTM stacks from torch's operators (paper Eqs. RNN and LSTM).

Step k consumes zeta(k - 1) and the columns of row k.  The past is run with the measured disturbance; over the horizon
the network's own outputs stand in for it.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


def decode(
    weights: dict[str, Tensor],
    kind: str,
    reads_zeta: bool,
    phi: Callable[[Tensor], Tensor],
    mask: Tensor | None,
    zeta: Tensor,
    past: Tensor,
    future: Tensor,
    base: Tensor,
) -> Tensor:
    """Forecasts (n_members, n_windows, n_leads).

    Parameters
    ----------
    weights : dict of str to Tensor
        As :meth:`NetworkStack.weights` names them.
    kind : {"rnn", "lstm"}
        The cell.
    reads_zeta : bool
        Whether the disturbance is read.
    phi : callable
        Activation of the head.
    mask : Tensor of shape (n_members, n_leads, width, n_windows) or None
        Factors of dropout.
    zeta, past, future, base : Tensor
        Inputs, each (n_members, n_windows, ...).
    """
    cells = [name.removesuffix(".weight") for name in weights if name.startswith("cell") and name.endswith(".weight")]
    n = weights["hidden.weight"].shape[1]
    n_past, n_leads = past.shape[3], future.shape[3]
    h = [base.new_zeros(*base.shape[:2], n) for _ in cells]
    c, outputs = list(h), list[Tensor]()
    for k in range(n_past + n_leads):
        lead = k - n_past
        x = past[..., k] if lead < 0 else future[..., lead]
        if reads_zeta:
            before = zeta[..., k] if lead <= 0 else outputs[-1]
            x = torch.cat([before[..., None], x], dim=2)
        for i, name in enumerate(cells):
            h[i], c[i] = _cell(kind, linear(weights, name, torch.cat([x, h[i]], dim=2)), c[i])
            x = h[i]
        if lead >= 0:
            z = phi(linear(weights, "hidden", x))
            if mask is not None:
                z = z * mask[:, lead].transpose(1, 2)
            outputs.append(base[..., lead] + linear(weights, "out", z)[..., 0])
    return torch.stack(outputs, dim=2)


def _cell(kind: str, gates: Tensor, c: Tensor) -> tuple[Tensor, Tensor]:
    """Torch's documented RNN cell (tanh) or LSTM cell, gates in the order i, f, o, g."""
    if kind == "rnn":
        return torch.tanh(gates), c
    i, f, o, g = gates.chunk(4, dim=2)
    c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(g)
    return torch.sigmoid(o) * torch.tanh(c), c


def linear(weights: dict[str, Tensor], name: str, z: Tensor) -> Tensor:
    """``W z + b`` of every member, (n_members, n_windows, n_out)."""
    return torch.baddbmm(weights[f"{name}.bias"][:, None], z, weights[f"{name}.weight"])
