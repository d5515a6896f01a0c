"""Discrete state-space model of a network, with named states and inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..thermal import RCNetwork
from ..thermal.parameters import check_known
from .disturbance_models import measured_states


@dataclass(frozen=True)
class StateSpace:
    """Discrete state-space model ``x[k+1] = A x[k] + B v[k]``, ``y[k] = C x[k] + D v[k]``.

    Attributes
    ----------
    A, B, C, D : ndarray
        Of shape (n, n), (n, m), (o, n) and (o, m), with one output row per measured node.
    state_names, input_names : tuple of str
        Units are those of the data contract; the last inputs are the heat gains [kW] of the disturbed nodes.
    sampling_time : Timedelta
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    sampling_time: pd.Timedelta


def checked_theta(network: RCNetwork, theta: Mapping[str, float], roles: Iterable[str]) -> dict[str, float]:
    """The value of every parameter under the given inputs; refused where one is absent or impossible."""
    parameters = network.parameters(roles)
    if absent := [p.name for p in parameters if p.name not in theta]:
        raise ValueError(f"theta lacks {', '.join(absent)}: network {network.name} needs a value of each.")
    check_known(parameters, theta, "theta", may_be_0=("-", "m2", "kW"))
    return {p.name: float(theta[p.name]) for p in parameters}


def state_space_of(
    network: RCNetwork, theta: Mapping[str, float], roles: tuple[str, ...], step: pd.Timedelta
) -> StateSpace:
    """The exact zero-order hold of a network under the given inputs, with named rows and columns."""
    d = network.discrete(theta, roles, step / pd.Timedelta("1h"))
    C = np.eye(len(network.nodes))[measured_states(network)]
    names = (*network.inputs(roles), *network.gain_names)
    return StateSpace(d.A, d.B, C, np.zeros((len(C), len(names))), network.states, names, step)
