"""The matrices of a network for many parameter vectors at once, with exact derivatives.

Heat flows are linear in a few *terms*: a conductance 1/R, a capacity Q, an area A times a share f.  Which term enters
which element, and with which sign, is fixed by the declaration: it is worked out once, as a constant tensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from .network import RCNetwork


class Continuous(NamedTuple):
    """dx/dt = A x + B v of a network, with derivatives by each of its p parameters.

    A batch of S parameter vectors has a leading axis of length S in every field.

    Attributes
    ----------
    A : ndarray of shape (n, n)
        [1/h].
    B : ndarray of shape (n, m)
        The last columns are 1 kW of heat gain on each disturbed node.
    dA : ndarray of shape (p, n, n)
        Derivatives by the values of the parameters.
    dB : ndarray of shape (p, n, m)
    capacitance : ndarray of shape (n,)
        [kWh/K].
    """

    A: np.ndarray
    B: np.ndarray
    dA: np.ndarray
    dB: np.ndarray
    capacitance: np.ndarray


@dataclass(frozen=True)
class Stencil:
    """Constant coefficients of a network's heat flows under given inputs.

    Attributes
    ----------
    parameters : tuple of str
        Order of the columns of ``theta``.
    columns : tuple of str
        Order of the columns of B: the inputs, then the heat gains.
    reciprocal : ndarray of shape (p + 1,)
        Whether a parameter acts by its inverse (resistances).
    first, second : ndarray of shape (F,)
        The two factors of each of F terms, as places in ``(parameters, 1)``.
    flow : ndarray of shape (F, n * (n + m))
        What each term adds to the heat flow into a node by state and by input.
    stored : ndarray of shape (n,)
        Places of the capacitances in ``parameters``.
    """

    parameters: tuple[str, ...]
    columns: tuple[str, ...]
    reciprocal: np.ndarray
    first: np.ndarray
    second: np.ndarray
    flow: np.ndarray
    stored: np.ndarray

    @classmethod
    def of(cls, network: RCNetwork, roles: Iterable[str]) -> Stencil:
        """Work out the coefficients of a network.

        Parameters
        ----------
        network : RCNetwork
        roles : iterable of str
            Roles that a table has.

        Returns
        -------
        Stencil
        """
        roles = tuple(roles)
        names = tuple(p.name for p in network.parameters(roles))
        columns = (*network.inputs(roles), *network.gain_names)
        place = {name: i for i, name in enumerate(names)}
        terms = _Terms(network.nodes, columns, len(names))
        for name, ends in network.resistors.items():
            terms.connect(place[name], ends)
        for source in network.sources(roles):
            gain = terms.one if source.parameter is None else place[source.parameter]
            named = [(node, place[fraction]) for node, fraction in source.shares if fraction is not None]
            for node, fraction in source.shares:
                if fraction is not None:
                    terms.add(gain, place[fraction], node, source.role, 1.0)
                    continue
                terms.add(gain, terms.one, node, source.role, 1.0)
                for _, other in named:  # every named share takes from what is left
                    terms.add(gain, other, node, source.role, -1.0)
        for node, gain_name in zip(network.disturbed_nodes, network.gain_names, strict=True):
            terms.add(terms.one, terms.one, node, gain_name, 1.0)
        return cls(
            parameters=names,
            columns=columns,
            reciprocal=np.array([name in network.resistors for name in names] + [False]),
            first=np.array([a for a, _ in terms.flows], dtype=np.intp),
            second=np.array([b for _, b in terms.flows], dtype=np.intp),
            flow=np.array([flow.ravel() for flow in terms.flows.values()]),
            stored=np.array([place[c] for c in network.capacitances.values()], dtype=np.intp),
        )

    def vector(self, theta: Mapping[str, float]) -> np.ndarray:
        """Values by name as one row of ``theta``.

        Parameters
        ----------
        theta : mapping of parameter to value

        Returns
        -------
        ndarray of shape (p,)
        """
        return np.array([theta[name] for name in self.parameters], dtype=np.float64)

    def matrices(self, theta: np.ndarray) -> Continuous:
        """Continuous state-space matrices and their derivatives.

        Parameters
        ----------
        theta : ndarray of shape (S, p)
            Values, one row a parameter vector, in the order of ``parameters``.

        Returns
        -------
        Continuous
            With a leading axis of length S: A (S, n, n), B (S, n, m), dA (S, p, n, n), dB (S, p, n, m),
            capacitance (S, n).
        """
        theta = np.asarray(theta, dtype=np.float64)
        size, p, n = len(theta), len(self.parameters), len(self.stored)
        factor = np.ones((size, p + 1))
        factor[:, :p] = theta
        factor[:, self.reciprocal] = 1.0 / factor[:, self.reciprocal]
        slope = np.where(self.reciprocal, -(factor**2), 1.0)
        slope[:, p] = 0.0  # the constant 1
        one, two = factor[:, self.first], factor[:, self.second]
        term = np.arange(len(self.first))
        by = np.zeros((size, p + 1, len(term)))
        by[:, self.first, term] = slope[:, self.first] * two
        by[:, self.second, term] += one * slope[:, self.second]

        capacitance = theta[:, self.stored]
        flow = ((one * two)[:, None, :] @ self.flow).reshape(size, n, -1) / capacitance[:, :, None]
        d_flow = (by[:, :p] @ self.flow).reshape(size, p, n, -1) / capacitance[:, None, :, None]
        node = np.arange(n)
        d_flow[:, self.stored, node] -= flow / capacitance[:, :, None]
        return Continuous(
            np.ascontiguousarray(flow[..., :n]),
            np.ascontiguousarray(flow[..., n:]),
            np.ascontiguousarray(d_flow[..., :n]),
            np.ascontiguousarray(d_flow[..., n:]),
            capacitance,
        )


class _Terms:
    """Collects what each product of two factors adds to the heat flow into a node [kW], by state and by input."""

    def __init__(self, nodes: tuple[str, ...], columns: tuple[str, ...], one: int) -> None:
        self.nodes = {node: i for i, node in enumerate(nodes)}
        self.place = {**self.nodes, **{name: len(nodes) + j for j, name in enumerate(columns)}}
        self.one = one  # place of the constant 1
        self.flows: dict[tuple[int, int], np.ndarray] = {}

    def add(self, first: int, second: int, node: str, source: str, sign: float) -> None:
        flow = self.flows.setdefault((first, second), np.zeros((len(self.nodes), len(self.place))))
        flow[self.nodes[node], self.place[source]] += sign

    def connect(self, resistor: int, ends: tuple[str, str]) -> None:
        for here, there in (ends, ends[::-1]):
            if here in self.nodes:
                self.add(resistor, self.one, here, here, -1.0)
                if there in self.place:
                    self.add(resistor, self.one, here, there, 1.0)
