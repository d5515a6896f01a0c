"""Continuous matrices of a network for many parameter vectors at once, with exact derivatives.

Every heat flow is a sum of products of two factors: a conductance 1/R, a capacity Q, or an area A times a share f.  The
declaration alone says which product enters which element, and with which sign, so these coefficients are computed once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._arguments import is_number
from .declaration import Declaration, as_names


class Continuous(NamedTuple):
    """dx/dt = A x + B v of a network, with derivatives with respect to each of its p parameters.

    For S parameter vectors every field has a leading axis of length S.
    """

    A: np.ndarray  # (n, n) [1/h]
    B: np.ndarray  # (n, m); the last columns are 1 kW of heat gain on each disturbed node
    dA: np.ndarray  # (p, n, n) with respect to the values of the parameters
    dB: np.ndarray  # (p, n, m)
    capacitance: np.ndarray  # (n,) [kWh/K]


@dataclass(frozen=True)
class MatrixBuilder:
    """Constant coefficients of a network's heat flows under given inputs; turns parameter vectors into matrices.

    Attributes
    ----------
    parameters : tuple of str
        Order of the columns of ``theta``.
    columns : tuple of str
        Order of the columns of B: the inputs, then the heat gains.
    reciprocal : ndarray of shape (p + 1,)
        Whether a parameter acts by its inverse (resistances).
    first, second : ndarray of shape (F,)
        The two factors of each of F products, as indices into ``(*parameters, 1)``.
    coefficients : ndarray of shape (F, n * (n + m))
        Contribution of each product to the heat flow into each node, per state and input.
    capacitances : ndarray of shape (n,)
        Indices of the capacitances in ``parameters``.
    """

    parameters: tuple[str, ...]
    columns: tuple[str, ...]
    reciprocal: np.ndarray
    first: np.ndarray
    second: np.ndarray
    coefficients: np.ndarray
    capacitances: np.ndarray

    @classmethod
    def from_network(cls, network: Declaration, roles: Iterable[str]) -> MatrixBuilder:
        """Compute the coefficients of a network under the roles of a table.

        Parameters
        ----------
        network : RCNetwork
        roles : iterable of str
        """
        roles = as_names(roles)
        names = tuple(p.name for p in network.parameters(roles))
        columns = (*network.inputs(roles), *network.gain_names)
        flows = _heat_flows(network, roles, columns, names)
        index = {name: i for i, name in enumerate(names)}
        return cls(
            parameters=names,
            columns=columns,
            reciprocal=np.array([name in network.resistors for name in names] + [False]),
            first=np.array([a for a, _ in flows], dtype=np.intp),
            second=np.array([b for _, b in flows], dtype=np.intp),
            coefficients=np.array([flow.ravel() for flow in flows.values()]),
            capacitances=np.array([index[c] for c in network.capacitances.values()], dtype=np.intp),
        )

    def vector(self, theta: Mapping[str, float]) -> np.ndarray:
        """(p,) values by name as one row of ``theta``.

        Parameters
        ----------
        theta : mapping of parameter to value

        Raises
        ------
        ValueError
            If a parameter has no value, or one that is no number, or a capacitance or a resistance is not above 0.
        """
        missing = [name for name in self.parameters if name not in theta]
        if missing:
            raise ValueError(f"theta has no value for {', '.join(missing)}; give one for each parameter.")
        divisors = {*np.flatnonzero(self.reciprocal), *self.capacitances}
        for number, name in enumerate(self.parameters):
            if not is_number(theta[name]) or (number in divisors and theta[name] <= 0):
                above = " above 0" if number in divisors else ""
                raise ValueError(f"theta gives {name} the value {theta[name]!r}; it must be a number{above}.")
        return np.array([theta[name] for name in self.parameters], dtype=np.float64)

    def matrices(self, theta: np.ndarray) -> Continuous:
        """A (S, n, n), B (S, n, m), dA (S, p, n, n), dB (S, p, n, m) and capacitance (S, n).

        Parameters
        ----------
        theta : ndarray of shape (S, p)
            One parameter vector per row, in the order of ``parameters``.
        """
        theta = np.asarray(theta, dtype=np.float64)
        size, p, n = len(theta), len(self.parameters), len(self.capacitances)
        factor = np.ones((size, p + 1))
        factor[:, :p] = theta
        factor[:, self.reciprocal] = 1.0 / factor[:, self.reciprocal]
        slope = np.where(self.reciprocal, -(factor**2), 1.0)
        slope[:, p] = 0.0  # the constant 1
        first, second = factor[:, self.first], factor[:, self.second]
        product = np.arange(len(self.first))
        d_product = np.zeros((size, p + 1, len(product)))
        d_product[:, self.first, product] = slope[:, self.first] * second
        d_product[:, self.second, product] += first * slope[:, self.second]

        capacitance = theta[:, self.capacitances]
        rate = ((first * second)[:, None, :] @ self.coefficients).reshape(size, n, -1) / capacitance[:, :, None]
        d_rate = (d_product[:, :p] @ self.coefficients).reshape(size, p, n, -1) / capacitance[:, None, :, None]
        d_rate[:, self.capacitances, np.arange(n)] -= rate / capacitance[:, :, None]
        return Continuous(
            np.ascontiguousarray(rate[..., :n]),
            np.ascontiguousarray(rate[..., n:]),
            np.ascontiguousarray(d_rate[..., :n]),
            np.ascontiguousarray(d_rate[..., n:]),
            capacitance,
        )


def _heat_flows(
    network: Declaration, roles: tuple[str, ...], columns: tuple[str, ...], parameters: tuple[str, ...]
) -> dict[tuple[int, int], np.ndarray]:
    """Heat flow into each node [kW], per state and input (n, n + m), by each product of two factors."""
    nodes = {node: i for i, node in enumerate(network.nodes)}
    place = {name: j for j, name in enumerate((*network.nodes, *columns))}
    factors: dict[str | None, int] = {name: i for i, name in enumerate((*parameters, None))}  # None is the constant 1
    out: dict[tuple[int, int], np.ndarray] = {}

    def add(first: str | None, second: str | None, node: str, column: str, sign: float) -> None:
        flow = out.setdefault((factors[first], factors[second]), np.zeros((len(nodes), len(place))))
        flow[nodes[node], place[column]] += sign

    for name, ends in network.resistors.items():
        for here, there in (ends, ends[::-1]):
            if here in nodes:
                add(name, None, here, here, -1.0)
                if there in place:
                    add(name, None, here, there, 1.0)
    for source in network.sources(roles):
        for node, fraction in source.shares:
            add(source.parameter, fraction, node, source.role, 1.0)
            if fraction is None:  # the remainder, 1 less every fraction
                for other in filter(None, dict(source.shares).values()):
                    add(source.parameter, other, node, source.role, -1.0)
    for node, gain_name in zip(network.disturbed_nodes, network.gain_names, strict=True):
        add(None, None, node, gain_name, 1.0)
    return out
