"""The network and its filter at given nonlinear parameters, with exact derivatives by their logarithms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..filtering import discretize
from ..thermal import MatrixBuilder, RCNetwork

#: standard deviation of the thermometer [K]; only the others' ratios to it matter
NOISE = 0.05
#: what is unknown of the temperatures of a first row: of all together, and of each [K]
_FIRST, _FIRST_EACH = 4.0, 1.0
#: parameters beside the network's: walk of its temperatures [K/sqrt(h)], tracked heat [kW], its memory [h], and the lag
#: of an emitter [h]
OWN = ("sigma_x", "sigma_g", "tau_g", "tau_e")


class Matrices(NamedTuple):
    """Discrete network, and the filter that has the tracked heat as one more state."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, nb + n): boundary temperatures, then 1 kW on every node
    dA: np.ndarray  # (n, n, p)
    dB: np.ndarray  # (n, nb + n, p)
    F: np.ndarray  # (m, m), m = n + 1
    Q: np.ndarray  # (m, m)
    dF: np.ndarray  # (m, m, p)
    dQ: np.ndarray  # (m, m, p)
    P0: np.ndarray  # (m, m)


@dataclass(frozen=True)
class LeadModel:
    """A network whose every node can be heated, and the disturbance that its filter tracks.

    Parameters
    ----------
    network : RCNetwork
    builder : MatrixBuilder
        Of the network without sources.
    step : float
        [h].
    heat_scale : float
        Spread of the known heat [kW], the unit of what is unknown.
    """

    network: RCNetwork
    builder: MatrixBuilder
    step: float
    heat_scale: float

    @classmethod
    def of(cls, network: RCNetwork, step: float, heat_scale: float) -> LeadModel:
        """The model of a network's walls and air; what heats it comes as heat by node."""
        bare = replace(network, solar={}, disturbed=network.nodes, heated=network.nodes[0])
        return cls(network, bare.matrix_builder(network.boundaries), step, heat_scale)

    @property
    def names(self) -> tuple[str, ...]:
        """Nonlinear parameters, in the order of psi."""
        return (*self.builder.parameters, *OWN)

    @property
    def zone(self) -> int:
        """Place of the measured node."""
        return self.network.nodes.index(self.network.measured_nodes[0])

    @property
    def output(self) -> np.ndarray:
        """(m,) what is measured of the filter's state."""
        return np.eye(len(self.network.nodes) + 1)[self.zone]

    def matrices(self, psi: np.ndarray) -> Matrices:
        """Everything at the logarithms ``psi`` (p,)."""
        k = len(self.builder.parameters)
        values = np.exp(psi)
        theta, (sigma_x, sigma_g, tau, _) = values[:k], values[k:]
        c = self.builder.matrices(theta[None])
        d = discretize(c.A[0], c.B[0], c.dA[0], c.dB[0], c.capacitance[0], self.step)
        n, p = len(d.A), len(psi)
        dA, dB = np.zeros((n, n, p)), np.zeros((*d.B.shape, p))
        dA[..., :k] = np.moveaxis(d.dA * theta[:, None, None], 0, -1)
        dB[..., :k] = np.moveaxis(d.dB * theta[:, None, None], 0, -1)
        gain = d.B.shape[1] - n + self.network.nodes.index(self.network.disturbed_nodes[0])
        phi = np.exp(-self.step / tau)
        dphi = phi * self.step / tau
        F, dF = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1, p))
        F[:n, :n], F[:n, n], F[n, n] = d.A, d.B[:, gain], phi
        dF[:n, :n], dF[:n, n], dF[n, n, k + 2] = dA, dB[:, gain], dphi
        walk, moved = sigma_x**2 * self.step, sigma_g**2 * (1.0 - phi**2)
        Q, dQ = np.diag(np.append(np.full(n, walk), moved)), np.zeros((n + 1, n + 1, p))
        node = np.arange(n)
        dQ[node, node, k] = 2.0 * walk
        dQ[n, n, k + 1] = 2.0 * moved
        dQ[n, n, k + 2] = -2.0 * sigma_g**2 * phi * dphi
        P0 = np.diag(np.append(np.full(n, _FIRST_EACH**2), self.heat_scale**2))
        P0[:n, :n] += _FIRST**2
        return Matrices(d.A, d.B, dA, dB, F, Q, dF, dQ, P0)
