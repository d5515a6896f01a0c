"""An identified network as a discrete system whose inputs are those of a plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..control import LinearNetwork, gain_of, impulse_response
from .filtered_network import FilteredNetwork


def plan_gain(known: FilteredNetwork, roles: Sequence[str], n_rows: int) -> np.ndarray:
    """(H, H, m) gain of the temperature by a plan [K per kW or stage], with a last axis of several measured nodes."""
    kalman = known.kalman
    C = np.eye(kalman.n)[kalman.measured]
    gain = gain_of(impulse_response(kalman.A, kalman.B[:, input_places(known, roles)], C, n_rows))
    return gain[..., 0] if len(C) == 1 else gain


def linear_network(
    known: FilteredNetwork,
    roles: Sequence[str],
    inputs: np.ndarray,
    nodes: np.ndarray,
    heat: np.ndarray,
    offset: np.ndarray,
) -> LinearNetwork:
    """The network from an origin on, under ``inputs`` (N, p) of which those of a plan are left out.

    ``nodes`` (n,) [degC] at the origin; ``heat`` (N, d) [kW] is the disturbance over each step, ``offset`` (N, o) [K]
    what the output has beyond the network at each row.  An output disturbance is one more state per output.
    """
    kalman, chosen = known.kalman, input_places(known, roles)
    others = inputs.copy()
    others[:, chosen] = 0.0
    A, B, C = kalman.A, kalman.B[:, chosen], np.eye(kalman.n)[kalman.measured]
    forcing, names = others @ kalman.B.T + heat @ kalman.heat.T, known.network.states
    if offset.any():
        o = len(C)
        A = np.pad(A, (0, o))
        B, C = np.pad(B, ((0, o), (0, 0))), np.hstack([C, np.eye(o)])
        forcing, nodes = np.hstack([forcing, np.vstack([offset[1:], offset[-1:]])]), np.append(nodes, offset[0])
        names = (*names, *(f"zeta_{name}" for name in known.network.measured_names))
    return LinearNetwork(A, B, C, nodes, forcing, tuple(names))


def input_places(known: FilteredNetwork, roles: Sequence[str]) -> list[int]:
    """Columns of the network's inputs."""
    names = list(known.network.inputs(known.roles))
    return [names.index(role) for role in roles]
