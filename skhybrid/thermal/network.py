"""RC networks declared as data, and the matrices that follow from the declaration.

Time is in hours, capacitance in kWh/K, resistance in K/kW, heat in kW.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import Any, NamedTuple

import pandas as pd

from ..filtering import Discrete, discretize
from .declaration import Shares, as_names, by_role, check, fractions_of, target_of
from .drawing import draw
from .equations import equations
from .parameters import Parameter, parameter_table
from .stencil import Continuous, Stencil

#: paper 2.2.1: bounds of every capacitance and resistance, of f and of A_win; capacities are wide
_BOUNDS = {"C": (0.1, 40.0), "R": (0.1, 40.0), "f": (1e-6, 1.0), "A": (0.1, 25.0), "Q": (0.05, 100.0)}


class Source(NamedTuple):
    """How one input heats the nodes: ``parameter * share`` kW per unit of the input.

    Attributes
    ----------
    role : str
    parameter : str or None
        None where the input is in kW already.
    shares : tuple of (node, fraction parameter or None)
        None stands for all that is left.
    """

    role: str
    parameter: str | None
    shares: Shares


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
    solar : mapping of node to fraction parameter or None, str, tuple of str, or mapping of role to these
        Where solar heat goes: the named fraction [-] to a node, and what is left to the node whose fraction is None.
        With several windows, a mapping of role to node or to such shares, ``{"q_sol_north": "north", ...}``, or a tuple
        of nodes, each of which has a role of its own, ``q_sol_<node>``.  Other irradiance columns are not read.
    measured, disturbed : str or tuple of str
        The nodes whose temperature is measured, and those that unmeasured heat enters.
    heated : str, tuple of str, or mapping
        The node that all heating and cooling acts on; a tuple of nodes, where a role tells by its name which one it is
        (``u_heat_north``, ``Q_north``); shares as in ``solar``; or a mapping of role to node or shares.  A column of
        heating or cooling whose node remains unclear is refused.
    bounds : mapping of parameter to (lower, upper), optional
        Overrides the paper's bounds.
    description, reference : str, optional
        What the network is for, and where it is from.

    Raises
    ------
    ValueError
        In one sentence that names the culprit: a name used twice, an end that is no node and no boundary, nodes that
        no boundary or no measured node is connected to, an unclear share, an impossible bound.

    Notes
    -----
    Paper Eq. gray_state is ``RCNetwork("2R2C", {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za",
    "T_oa")}, {"za": "f", "w": None})``.

    Examples
    --------
    >>> from skhybrid.thermal import RCNetwork
    >>> shed = RCNetwork("shed", {"za": "C_za"}, {"R_zo": ("za", "T_oa")}, {"za": None})
    >>> print(shed.equations())
    C_za dT_za/dt = (T_oa - T_za)/R_zo + A_win q_sol + Q_h u_heat + Q_c u_cool + Q_g

    Two rooms, each with a thermostat, a window, a heater and people:

    >>> rooms = ("north", "south")
    >>> flat = RCNetwork(
    ...     "flat",
    ...     capacitances={"north": "C_n", "south": "C_s"},
    ...     resistors={"R_ns": ("north", "south"), "R_no": ("north", "T_oa"), "R_so": ("south", "T_oa")},
    ...     solar=rooms, measured=rooms, disturbed=rooms, heated=rooms,
    ... )
    >>> flat.inputs(["T_oa", "q_sol_north", "q_sol_south", "u_heat_north", "Q_south"])
    ('T_oa', 'q_sol_north', 'q_sol_south', 'u_heat_north', 'Q_south')
    >>> flat.gain_names
    ('heat_gain_north', 'heat_gain_south')
    """

    name: str
    capacitances: Mapping[str, str]
    resistors: Mapping[str, tuple[str, str]]
    solar: str | tuple[str, ...] | Mapping[str, Any] = field(default_factory=dict)
    measured: str | tuple[str, ...] = "za"
    disturbed: str | tuple[str, ...] = "za"
    heated: str | tuple[str, ...] | Mapping[str, Any] = "za"
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    description: str = field(default="", compare=False)
    reference: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for role in ("measured", "disturbed", "solar", "heated"):
            given = getattr(self, role)
            if not isinstance(given, str | Mapping):
                one_or_more = tuple(given)
                object.__setattr__(self, role, one_or_more[0] if len(one_or_more) == 1 else one_or_more)
        check(self)

    # ------------------------------------------------------------------------------------------------ what it has
    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes in the order of the states."""
        return tuple(self.capacitances)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, ``T_<node>`` [degC]."""
        return tuple(f"T_{node}" for node in self.nodes)

    @property
    def measured_nodes(self) -> tuple[str, ...]:
        """Nodes whose temperature is measured, in the order of the outputs."""
        return as_names(self.measured)

    @property
    def disturbed_nodes(self) -> tuple[str, ...]:
        """Nodes that unmeasured heat enters, in the order of the last columns of B."""
        return as_names(self.disturbed)

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Names of the last columns of B: ``heat_gain``, or ``heat_gain_<node>`` where several nodes are disturbed."""
        nodes = self.disturbed_nodes
        return ("heat_gain",) if len(nodes) == 1 else tuple(f"heat_gain_{node}" for node in nodes)

    @property
    def history_roles(self) -> tuple[str, ...]:
        """Roles of the measured temperatures: ``T_za`` of the one measured node, ``T_<node>`` of several."""
        nodes = self.measured_nodes
        return ("T_za",) if len(nodes) == 1 else tuple(f"T_{node}" for node in nodes)

    @property
    def fractions(self) -> dict[str, str]:
        """Fraction parameter -> the node whose share it is; of the sun first, then of heating and cooling."""
        return {**fractions_of(self.solar, "solar"), **fractions_of(self.heated, "heated")}

    @property
    def solar_fractions(self) -> tuple[str, ...]:
        """Fraction parameters of the sun."""
        return tuple(fractions_of(self.solar, "solar"))

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Boundary temperatures, in order of first use."""
        ends = [end for pair in self.resistors.values() for end in pair if end not in self.capacitances]
        return tuple(dict.fromkeys(ends))

    @property
    def required_roles(self) -> tuple[str, ...]:
        """Roles without which a table cannot drive the network."""
        return (*self.boundaries, *self._solar_roles)

    @property
    def usual_roles(self) -> tuple[str, ...]:
        """Roles of a table that drives the network: what is required, and a heating and a cooling stage where any."""
        if by_role(self.heated, "heated"):
            return (*self.required_roles, *self.heated)
        nodes = self.heated if isinstance(self.heated, tuple) else ()
        stages = [f"{u}_{node}" for node in nodes for u in ("u_heat", "u_cool")] or ["u_heat", "u_cool"]
        return (*self.required_roles, *stages)

    @property
    def _solar_roles(self) -> tuple[str, ...]:
        if by_role(self.solar, "solar"):
            return tuple(self.solar)
        if isinstance(self.solar, tuple):
            return tuple(f"q_sol_{node}" for node in self.solar)
        return ("q_sol",) if self.solar else ()

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

        Raises
        ------
        ValueError
            If the network does not say which node a heating or cooling role acts on.
        """
        out = []
        for role in sorted(set(roles), key=_role_order):
            if role.startswith("q_sol"):
                shares = target_of(self.solar, "solar", role)
                if shares is not None:
                    out.append(Source(role, "A_win" + role[len("q_sol") :], shares))
            elif role.startswith(("u_", "Q_")):
                shares = target_of(self.heated, "heated", role)
                if shares is None:
                    raise ValueError(
                        f"network {self.name} does not say which node {role!r} heats; name it in heated={{{role!r}: "
                        f"node}}, or do without the column by columns={{{role!r}: None}}."
                    )
                out.append(Source(role, capacity_name(role) if role.startswith("u_") else None, shares))
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

    def parameters(self, roles: Iterable[str] | None = None) -> tuple[Parameter, ...]:
        """Parameters of the network under the given inputs, in the order of ``theta``.

        Parameters
        ----------
        roles : iterable of str, optional
            Roles that a table has; by default :attr:`usual_roles`.

        Returns
        -------
        tuple of Parameter
        """
        sources = self.sources(self.usual_roles if roles is None else roles)
        used = {fraction for source in sources for _, fraction in source.shares}
        out = [self._make(c, "C", "kWh/K", f"capacitance of node {node}") for node, c in self.capacitances.items()]
        out += [self._make(r, "R", "K/kW", f"resistance between {a} and {b}") for r, (a, b) in self.resistors.items()]
        for fraction, node in self.fractions.items():
            if fraction in used:
                heat = "solar heat" if fraction in self.solar_fractions else "heating and cooling"
                out.append(self._make(fraction, "f", "-", f"share of {heat} to {node}"))
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

    def parameter_table(self, roles: Iterable[str] | None = None) -> pd.DataFrame:
        """Name, unit, bounds and meaning of every parameter under the given inputs.

        Parameters
        ----------
        roles : iterable of str, optional
            Roles that a table has; by default :attr:`usual_roles`.

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
            The inputs; columns of B are in the order of :meth:`inputs`, then 1 kW of each of :attr:`gain_names`.

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

    # ------------------------------------------------------------------------------------------------ how it shows
    def equations(self, roles: Iterable[str] | None = None, *, latex: bool = False) -> str:
        """The heat balance of every node, in the paper's form.

        Parameters
        ----------
        roles : iterable of str, optional
            Roles that a table has; by default :attr:`usual_roles`.
        latex : bool
            As the lines of an ``aligned`` environment instead of text.

        Returns
        -------
        str
            One line a node.
        """
        return equations(self, roles, latex=latex)

    def to_svg(self, roles: Iterable[str] | None = None) -> str:
        """A drawing of the network.

        Parameters
        ----------
        roles : iterable of str, optional
            Roles that a table has; by default :attr:`usual_roles`.

        Returns
        -------
        str
            An SVG element that stands alone.
        """
        return draw(self, roles)

    def _repr_svg_(self) -> str:
        return self.to_svg()

    def _repr_html_(self) -> str:
        title = escape(f"{self.name}: {self.description}" if self.description else self.name)
        return (
            f"<div><p><b>{title}</b></p>{self.to_svg()}<pre>{escape(self.equations())}</pre>"
            f"{self.parameter_table().to_html(border=0)}</div>"
        )

    def __str__(self) -> str:
        title = f"{self.name}: {len(self.resistors)} resistors, {len(self.capacitances)} capacitances"
        lines = [title, *(text for text in (self.description, self.reference) if text), "", self.equations(), ""]
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
