"""RC networks declared as data, and the matrices that follow from the declaration.

Time is in hours, capacitance in kWh/K, resistance in K/kW, heat in kW.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import pandas as pd

from .._kernels import Discrete, discretize
from .parameters import Parameter, parameter_table
from .stencil import Continuous, Stencil

#: paper 2.2.1: bounds of every capacitance and resistance, of f and of A_win; capacities are wide
_BOUNDS = {"C": (0.1, 40.0), "R": (0.1, 40.0), "f": (1e-6, 1.0), "A": (0.1, 25.0), "Q": (0.05, 100.0)}


class Source(NamedTuple):
    """How one input heats the nodes: ``parameter * share`` kW per unit of the input."""

    role: str
    parameter: str | None  # None: the input is in kW already
    shares: tuple[tuple[str, str | None], ...]  # (node, fraction parameter or None for all that is left)


@dataclass(frozen=True)
class RCNetwork:
    """A thermal network as data.

    Parameters
    ----------
    name : str
        Such as ``"2R2C"``.
    capacitances : mapping of node to parameter
        The nodes, in the order of the states, and the parameter [kWh/K] of each.
    resistors : mapping of parameter to (end, end)
        An end is a node or a boundary temperature, such as ``T_oa`` [K/kW].
    solar : mapping of node to fraction parameter or None
        Where solar heat goes: the named fraction [-] to a node, and what is left to the node whose fraction is None.
    measured, disturbed, heated : str
        The node whose temperature is measured, that the unmeasured heat enters, and that heating and cooling act on.
    bounds : mapping of parameter to (lower, upper), optional
        Overrides the paper's bounds.

    Raises
    ------
    ValueError
        If a name is used twice, an end is no node and no boundary, a node is not connected, or a share is unclear.

    Notes
    -----
    Paper Eq. gray_state is ``RCNetwork("2R2C", {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za",
    "T_oa")}, {"za": "f", "w": None})``.

    Examples
    --------
    >>> from skhybrid.thermal import RCNetwork
    >>> shed = RCNetwork("shed", {"za": "C_za"}, {"R_zo": ("za", "T_oa")}, {"za": None})
    >>> shed.states
    ('T_za',)
    """

    name: str
    capacitances: Mapping[str, str]
    resistors: Mapping[str, tuple[str, str]]
    solar: Mapping[str, str | None] = field(default_factory=dict)
    measured: str = "za"
    disturbed: str = "za"
    heated: str = "za"
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [*self.capacitances.values(), *self.resistors, *(f for f in self.solar.values() if f)]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"network {self.name}: the parameter {twice[0]!r} is used twice.")
        for role, node in (("measured", self.measured), ("disturbed", self.disturbed), ("heated", self.heated)):
            if node not in self.capacitances:
                raise ValueError(f"network {self.name}: the {role} node {node!r} has no capacitance.")
        for name, ends in self.resistors.items():
            for end in ends:
                if end not in self.capacitances and not end.startswith("T_"):
                    raise ValueError(
                        f"network {self.name}: {name} ends at {end!r}, which has no capacitance and is no boundary "
                        "temperature (T_...)."
                    )
            if ends[0] == ends[1] or not set(ends) & set(self.capacitances):
                raise ValueError(
                    f"network {self.name}: {name} connects {ends[0]!r} and {ends[1]!r}, which carries no heat to any "
                    "node; give it two ends that differ, one of them a node with a capacitance."
                )
        left_over = [node for node, fraction in self.solar.items() if fraction is None]
        if self.solar and (len(left_over) != 1 or any(node not in self.capacitances for node in self.solar)):
            raise ValueError(f"network {self.name}: solar needs nodes with a capacitance, exactly one with None.")
        self._refuse_islands()

    def _refuse_islands(self) -> None:
        reached = {end for ends in self.resistors.values() for end in ends if end not in self.capacitances}
        for _ in self.capacitances:
            reached |= {end for ends in self.resistors.values() if reached & set(ends) for end in ends}
        lost = [node for node in self.capacitances if node not in reached]
        if lost:
            raise ValueError(f"network {self.name}: node {lost[0]!r} is connected to no boundary temperature.")

    # ------------------------------------------------------------------------------------------------ what it has
    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes in the order of the states."""
        return tuple(self.capacitances)

    @property
    def measured_nodes(self) -> tuple[str, ...]:
        """Nodes whose temperature is measured."""
        return (self.measured,)

    @property
    def disturbed_nodes(self) -> tuple[str, ...]:
        """Nodes that unmeasured heat enters."""
        return (self.disturbed,)

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Names of the inputs of unmeasured heat, behind all others."""
        return ("heat_gain",)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, ``T_<node>`` [degC]."""
        return tuple(f"T_{node}" for node in self.nodes)

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Boundary temperatures, in order of first use."""
        ends = [end for pair in self.resistors.values() for end in pair if end not in self.capacitances]
        return tuple(dict.fromkeys(ends))

    @property
    def required_roles(self) -> tuple[str, ...]:
        """Roles without which a table cannot drive the network."""
        return (*self.boundaries, "q_sol") if self.solar else self.boundaries

    def reads(self, role: str) -> bool:
        """Whether a column of this role acts on the network; others are left unread.

        Parameters
        ----------
        role : str

        Returns
        -------
        bool
        """
        return role in self.boundaries or bool(self.sources([role]))

    def sources(self, roles: Iterable[str]) -> tuple[Source, ...]:
        """Heat sources among the given roles, in the order of the inputs.

        Parameters
        ----------
        roles : iterable of str

        Returns
        -------
        tuple of Source
        """
        present = sorted(set(roles), key=_role_order)
        shares = tuple(self.solar.items())
        heated: tuple[tuple[str, str | None], ...] = ((self.heated, None),)
        out = []
        for role in present:
            if role == "q_sol" or role.startswith("q_sol_"):
                if shares:
                    out.append(Source(role, "A_win" + role[len("q_sol") :], shares))
            elif role.startswith("u_"):
                out.append(Source(role, capacity_name(role), heated))
            elif role.startswith("Q_"):
                out.append(Source(role, None, heated))
        return tuple(out)

    def inputs(self, roles: Iterable[str]) -> tuple[str, ...]:
        """Roles that act on the network, in the order of the columns of B.

        Parameters
        ----------
        roles : iterable of str
            Roles that a table has.

        Returns
        -------
        tuple of str
        """
        roles = set(roles)
        return (*(b for b in self.boundaries if b in roles), *(s.role for s in self.sources(roles)))

    def parameters(self, roles: Iterable[str] = ("q_sol", "u_heat", "u_cool")) -> tuple[Parameter, ...]:
        """Parameters of the network under the given inputs, in the order of ``theta``.

        Parameters
        ----------
        roles : iterable of str
            Roles that a table has.

        Returns
        -------
        tuple of Parameter
        """
        sources = self.sources(roles)
        out = [self._make(c, "C", "kWh/K", f"capacitance of node {node}") for node, c in self.capacitances.items()]
        out += [self._make(r, "R", "K/kW", f"resistance between {a} and {b}") for r, (a, b) in self.resistors.items()]
        if any(s.parameter and s.parameter.startswith("A_win") for s in sources):
            out += [self._make(f, "f", "-", f"share of solar heat to {n}") for n, f in self.solar.items() if f]
        for source in sources:
            if source.parameter is None:
                continue
            if source.parameter.startswith("A_win"):
                out.append(self._make(source.parameter, "A", "m2", f"effective window area for {source.role}"))
            else:
                out.append(self._make(source.parameter, "Q", "kW", f"capacity of {source.role}"))
        return tuple(out)

    def _make(self, name: str, kind: str, unit: str, description: str) -> Parameter:
        lower, upper = _BOUNDS[kind]
        transform = "log"
        if kind == "Q" and name.startswith("Q_c"):
            lower, upper = -upper, -lower
        elif kind == "Q" and not name.startswith("Q_h"):  # a stage that may heat or cool
            lower, transform = -upper, "identity"
        return Parameter(name, unit, lower, upper, description, transform).bounded(self.bounds.get(name))

    def parameter_table(self, roles: Iterable[str] = ("q_sol", "u_heat", "u_cool")) -> pd.DataFrame:
        """Name, unit, bounds and meaning of every parameter under the given inputs.

        Parameters
        ----------
        roles : iterable of str
            Roles that a table has.

        Returns
        -------
        DataFrame
            One row a parameter.
        """
        return parameter_table(self.parameters(roles))

    # -------------------------------------------------------------------------------------------------- matrices
    def matrices(self, theta: Mapping[str, float], roles: Iterable[str]) -> Continuous:
        """Continuous state-space matrices and their derivatives.

        Parameters
        ----------
        theta : mapping of parameter to value
        roles : iterable of str
            The inputs; columns of B are in the order of :meth:`inputs`, then the heat gain of 1 kW.

        Returns
        -------
        Continuous
            Derivatives are by the values, in the order of :meth:`parameters`.
        """
        stencil = self.stencil(roles)
        return Continuous(*(part[0] for part in stencil.matrices(stencil.vector(theta)[None])))

    def stencil(self, roles: Iterable[str]) -> Stencil:
        """What turns many parameter vectors into matrices at once; worked out once for each set of inputs.

        Parameters
        ----------
        roles : iterable of str
            Roles that a table has.

        Returns
        -------
        Stencil
        """
        key = tuple(sorted(set(roles)))
        if key not in self._stencils:
            self._stencils[key] = Stencil.of(self, key)
        return self._stencils[key]

    @cached_property
    def _stencils(self) -> dict[tuple[str, ...], Stencil]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_stencils"}

    def discrete(self, theta: Mapping[str, float], roles: Iterable[str], dt: float) -> Discrete:
        """Exact zero-order hold, with exact derivatives by the parameters.

        Parameters
        ----------
        theta : mapping of parameter to value
        roles : iterable of str
            Roles that a table has.
        dt : float
            The step [h].

        Returns
        -------
        Discrete
            ``A``, ``B`` over one step and ``dA``, ``dB`` by each parameter.
        """
        c = self.matrices(theta, tuple(roles))
        return discretize(c.A, c.B, c.dA, c.dB, c.capacitance, dt)

    def __str__(self) -> str:
        lines = [f"{self.name}: {len(self.resistors)} resistors, {len(self.capacitances)} capacitances"]
        lines += [f"  {c} at node {node}" for node, c in self.capacitances.items()]
        lines += [f"  {r} between {a} and {b}" for r, (a, b) in self.resistors.items()]
        lines += [f"  solar heat: {f or 'what is left'} to {node}" for node, f in self.solar.items()]
        return "\n".join([*lines, self.parameter_table().to_string()])


def capacity_name(role: str) -> str:
    """Parameter of a stage, such as ``Q_h`` of ``u_heat``, ``Q_c`` of ``u_cool`` and ``Q_h_2`` of ``u_heat_2``."""
    name = role[len("u_") :]
    for long, short in (("heat", "h"), ("cool", "c")):
        if name == long or name.startswith(long + "_"):
            return "Q_" + short + name[len(long) :]
    return "Q_u_" + name if name[:1] in "hc" else "Q_" + name


def _role_order(role: str) -> tuple[int, int, str]:
    """Irradiance, then heating, cooling, further stages, then measured heat."""
    if role.startswith("q_sol"):
        return (0, 0, role)
    if role.startswith("u_"):
        kind = 0 if role.startswith("u_heat") else 1 if role.startswith("u_cool") else 2
        return (1, kind, role)
    return (2, 0, role)
