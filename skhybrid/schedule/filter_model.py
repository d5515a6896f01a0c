"""Discrete network and filter at given nonlinear parameters, with exact derivatives by their logarithms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..filtering import discretize
from ..thermal import MatrixBuilder, RCNetwork

NOISE = 0.05  # standard deviation of the thermometer [K]; only ratios of the others to it matter
_COMMON_START, _NODE_START = 4.0, 1.0  # standard deviation at the first row, common and of each node [K]
#: parameters beside the network's: random walk of its temperatures [K/sqrt(h)], gain of the filter [kW] and its time
#: constant [h], time constant of the emitter [h]
FILTER_PARAMETERS = ("sigma_x", "sigma_g", "tau_g", "tau_e")


class Matrices(NamedTuple):
    """Discrete network, and the filter whose last state is the unmeasured gain."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, nb + n): boundary temperatures, then 1 kW into each node
    dA: np.ndarray  # (n, n, p)
    dB: np.ndarray  # (n, nb + n, p)
    F: np.ndarray  # (m, m), m = n + 1
    Q: np.ndarray  # (m, m)
    dF: np.ndarray  # (m, m, p)
    dQ: np.ndarray  # (m, m, p)
    P0: np.ndarray  # (m, m)

    @property
    def of_heat(self) -> np.ndarray:
        """(n, n) effect of 1 kW into each node over a step."""
        return self.B[:, -len(self.A) :]

    @property
    def of_boundaries(self) -> np.ndarray:
        """(n, nb) effect of the boundary temperatures."""
        return self.B[:, : -len(self.A)]


@dataclass(frozen=True)
class FilterModel:
    """A network that can be heated at each node, with a filter that estimates the unmeasured gain."""

    network: RCNetwork
    builder: MatrixBuilder  # of the network without sources
    step: float  # [h]
    heat_scale: float  # spread of the known heat [kW], the unit of unknown heat

    @classmethod
    def of(cls, network: RCNetwork, step: float, heat_scale: float) -> FilterModel:
        """Model of a network's capacitances and resistors; its sources are replaced by heat into each node."""
        bare = replace(network, solar={}, disturbed=network.nodes, heated=network.nodes[0], bounds={}, zones={})
        return cls(network, bare.matrix_builder(network.boundaries), step, heat_scale)

    @property
    def names(self) -> tuple[str, ...]:
        """Nonlinear parameters, in the order of psi."""
        return (*self.builder.parameters, *FILTER_PARAMETERS)

    @property
    def zone(self) -> int:
        """Index of the measured node."""
        return self.network.nodes.index(self.network.measured_nodes[0])

    @property
    def output(self) -> np.ndarray:
        """(m,) row that measures the filter's state."""
        return np.eye(len(self.network.nodes) + 1)[self.zone]

    def matrices(self, psi: np.ndarray, slopes: bool = True) -> Matrices:
        """Matrices at the logarithms ``psi`` (p,) of the parameters; without ``slopes`` derivatives by none of them."""
        A, B, dA, dB = self._discrete(psi, slopes)
        n, p, k = len(A), dA.shape[-1], len(self.builder.parameters)
        sigma_x, sigma_g, tau, _ = np.exp(psi)[k:]
        gain = B.shape[1] - n + self.network.nodes.index(self.network.disturbed_nodes[0])
        phi = np.exp(-self.step / tau)
        F, dF = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1, p))
        F[:n, :n], F[:n, n], F[n, n] = A, B[:, gain], phi
        dF[:n, :n], dF[:n, n] = dA, dB[:, gain]
        walk, drive = sigma_x**2 * self.step, sigma_g**2 * (1.0 - phi**2)
        Q, dQ = np.diag(np.append(np.full(n, walk), drive)), np.zeros((n + 1, n + 1, p))
        if slopes:
            dphi, node = phi * self.step / tau, np.arange(n)
            dF[n, n, k + 2] = dphi
            dQ[node, node, k] = 2.0 * walk
            dQ[n, n, k + 1] = 2.0 * drive
            dQ[n, n, k + 2] = -2.0 * sigma_g**2 * phi * dphi
        P0 = np.diag(np.append(np.full(n, _NODE_START**2), self.heat_scale**2))
        P0[:n, :n] += _COMMON_START**2
        return Matrices(A, B, dA, dB, F, Q, dF, dQ, P0)

    def _discrete(self, psi: np.ndarray, slopes: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A, B, dA, dB of the network over one step, with the derivatives by psi in the last axis."""
        k = len(self.builder.parameters)
        theta = np.exp(psi)[:k]
        c, own = self.builder.matrices(theta[None]), slice(k if slopes else 0)
        d = discretize(c.A[0], c.B[0], c.dA[0, own], c.dB[0, own], c.capacitance[0], self.step)
        p, unit = len(psi) * slopes, theta[own, None, None]
        dA, dB = np.zeros((*d.A.shape, p)), np.zeros((*d.B.shape, p))
        dA[..., own] = np.moveaxis(d.dA * unit, 0, -1)
        dB[..., own] = np.moveaxis(d.dB * unit, 0, -1)
        return d.A, d.B, dA, dB
