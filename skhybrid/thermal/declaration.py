"""The declaration of a network as data: its fields, and the names, sources and parameters that follow from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from .._arguments import as_mapping
from .._table import is_cooling, is_stage
from .parameters import Parameter, make_parameter

#: where heat goes: a node, or nodes with the name of the fraction that each gets (None: the remainder)
Target = str | Mapping[str, str | None]
Shares = tuple[tuple[str, str | None], ...]
Part = tuple[str | None, Shares]  # an area or capacity of its own (None: the role's usual one), and where its heat goes

ROLE_PREFIXES = {"solar": ("q_sol",), "heated": ("u_", "Q_")}  # prefixes of the roles of each kind of heat
#: fields that must be mappings, of what
_MAPPINGS = {
    "capacitances": "nodes to parameters, such as {'za': 'C_za'}",
    "resistors": "parameters to two ends, such as {'R_zo': ('za', 'T_oa')}",
    "bounds": "parameters to (lower, upper), such as {'C_za': (0.1, 40.0)}",
    "zones": "zones to their nodes, such as {'hall': ('za_hall', 'w_hall')}",
}
SOURCE_PARAMETERS = ("A_win", "Q_")  # prefixes of the parameters of sources
_ROUNDING = 1e-9  # of a sum of shares


class Source(NamedTuple):
    """One input as a heat source: each share is ``parameter * fraction`` kW per unit of the input.

    Attributes
    ----------
    role : str
    parameter : str or None; None where the input is in kW already
    shares : tuple of (node, fraction parameter or None); None stands for the remainder
    """

    role: str
    parameter: str | None
    shares: Shares

    @property
    def nameplate(self) -> str:
        """The argument that gives the capacity of a stage."""
        sign = "-" if is_cooling(self.role) else ""
        return f"known={{{self.parameter!r}: {sign}nameplate kW}}"


@dataclass(frozen=True)
class Declaration:
    """Fields of a network, described in :class:`~skhybrid.thermal.RCNetwork`, and what follows from them alone."""

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
    zones: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, content in _MAPPINGS.items():
            as_mapping(f"network {self.name}: {name}", getattr(self, name), content)
        for name in (*_MAPPINGS, "solar", "heated"):
            object.__setattr__(self, name, _copied(getattr(self, name)))
        for name in ("measured", "disturbed", "solar", "heated"):
            given = getattr(self, name)
            if not isinstance(given, Iterable):
                raise ValueError(f"network {self.name}: {name}={given!r} must be the name of a node, or several.")
            if not isinstance(given, str | Mapping):
                nodes = tuple(given)
                one = len(nodes) == 1 and isinstance(nodes[0], str)
                object.__setattr__(self, name, nodes[0] if one else nodes)

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
        names = self.disturbed_names
        return ("heat_gain",) if len(names) == 1 else tuple(f"heat_gain_{name}" for name in names)

    @property
    def history_roles(self) -> tuple[str, ...]:
        """Roles of the measured temperatures: ``T_za`` of one; ``T_<node>`` of several, ``T_za_<zone>`` of zones."""
        names = self.measured_names
        return ("T_za",) if len(names) == 1 else tuple(f"T_za_{n}" if self.zones else f"T_{n}" for n in names)

    @property
    def measured_names(self) -> tuple[str, ...]:
        """Names of the measured nodes: of their zones where the network has zones, else their own."""
        return self._names(self.measured_nodes)

    @property
    def disturbed_names(self) -> tuple[str, ...]:
        """Names of the disturbed nodes, as :attr:`measured_names`."""
        return self._names(self.disturbed_nodes)

    def _names(self, nodes: tuple[str, ...]) -> tuple[str, ...]:
        zone = {node: name for name, inside in self.zones.items() for node in inside}
        return tuple(zone.get(node, node) for node in nodes)

    @property
    def fractions(self) -> dict[str, str]:
        """Node that each fraction parameter sends heat to; fractions of the sun first, then of the plant."""
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
        """Roles that a table must have to drive the network."""
        return (*self.boundaries, *self._solar_roles)

    @property
    def usual_roles(self) -> tuple[str, ...]:
        """Required roles, and those of the heating and cooling stages (one of each where none is named)."""
        if is_by_role(self.heated, "heated"):
            own = [role for role in self.heated if role.endswith(tuple(f"_{zone}" for zone in self.zones))]
            stages = [role for role in own if is_stage(role)]
            return (*self.required_roles, *(stages or own or self.heated))
        nodes = self.heated if isinstance(self.heated, tuple) else ()
        stages = [f"{u}_{node}" for node in nodes for u in ("u_heat", "u_cool")] or ["u_heat", "u_cool"]
        return (*self.required_roles, *stages)

    @property
    def _solar_roles(self) -> tuple[str, ...]:
        if is_by_role(self.solar, "solar"):
            return tuple(self.solar)
        if isinstance(self.solar, tuple):
            return tuple(f"q_sol_{node}" for node in self.solar)
        return ("q_sol",) if self.solar else ()

    def reads(self, role: str) -> bool:
        """Whether a column of this role acts on the network; other columns are ignored.

        Parameters
        ----------
        role : str
        """
        return role in self.boundaries or bool(self.sources([role]))

    def sources(self, roles: Iterable[str]) -> tuple[Source, ...]:
        """Heat sources among the given roles, in the order of the inputs; a plant role without a node is refused.

        Parameters
        ----------
        roles : iterable of str
        """
        out = []
        for role in sorted(set(as_names(roles)), key=_role_order):
            if role.startswith(ROLE_PREFIXES["solar"]):
                usual: str | None = "A_win" + role[len("q_sol") :]
                parts = parts_of_role(self.solar, "solar", role)
            elif role.startswith(ROLE_PREFIXES["heated"]):
                usual = capacity_name(role) if is_stage(role) else None
                parts = parts_of_role(self.heated, "heated", role)
                if not parts:
                    raise ValueError(
                        f"network {self.name} does not say which node {role!r} heats; name it in heated={{{role!r}: "
                        f"node}}, or leave the column out by columns={{{role!r}: None}}."
                    )
            else:
                continue
            out += [Source(role, usual if own is None else own, shares) for own, shares in parts]
        return tuple(out)

    def inputs(self, roles: Iterable[str]) -> tuple[str, ...]:
        """Roles that act on the network, in the order of the columns of B.

        Parameters
        ----------
        roles : iterable of str
        """
        roles = set(as_names(roles))
        return tuple(
            dict.fromkeys([*(b for b in self.boundaries if b in roles), *(s.role for s in self.sources(roles))])
        )

    def parameters(self, roles: Iterable[str] | None = None) -> tuple[Parameter, ...]:
        """Parameters of the network under the given inputs, in the order of ``theta``.

        Parameters
        ----------
        roles : iterable of str, default :attr:`usual_roles`
        """
        sources = self.sources(self.usual_roles if roles is None else roles)
        used = {fraction for source in sources for _, fraction in source.shares}
        named = [(c, "C", f"capacitance of node {node}") for node, c in self.capacitances.items()]
        named += [(r, "R", f"resistance between {a} and {b}") for r, (a, b) in self.resistors.items()]
        for fraction, node in self.fractions.items():
            if fraction in used:
                heat = "solar heat" if fraction in self.solar_fractions else "heating and cooling"
                named.append((fraction, "f", f"share of {heat} to {node}"))
        for source in sources:
            if source.parameter is not None:
                area = source.parameter.startswith("A_win")
                text = "effective window area for" if area else "capacity of"
                to = f" to {source.shares[0][0]}" if self.zones else ""
                named.append((source.parameter, "A" if area else "Q", f"{text} {source.role}{to}"))
        return tuple(make_parameter(name, kind, text).bounded(self.bounds.get(name)) for name, kind, text in named)


def _copied(declared: Any) -> Any:
    """A mapping, and those in it, apart from the caller's own; anything else as it is."""
    return {k: _copied(v) for k, v in declared.items()} if isinstance(declared, Mapping) else declared


def as_names(value: str | Iterable[str]) -> tuple[str, ...]:
    """One name or several, as a tuple."""
    return (value,) if isinstance(value, str) else tuple(value)


def is_by_role(declared: object, kind: str) -> bool:
    """Whether ``solar`` or ``heated`` is a mapping of role to target."""
    return isinstance(declared, Mapping) and any(str(key).startswith(ROLE_PREFIXES[kind]) for key in declared)


def parts_of_role(declared: object, kind: str, role: str) -> tuple[Part, ...]:
    """Targets of the heat of one role; none where the declaration does not say."""
    if is_by_role(declared, kind):
        found = declared.get(role)  # type: ignore[attr-defined]
        return () if found is None else _parts(found)
    if isinstance(declared, str | Mapping):
        return _parts(declared) if declared else ()
    suffix = f"{role.removeprefix('q_sol') if kind == 'solar' else role[1:]}_"
    named = [node for node in as_names(declared) if f"_{node}_" in suffix]  # type: ignore[arg-type]
    longest = max(named, key=len, default="")  # q_sol_hall_2 names hall_2 where there is a node hall too
    clear = bool(named) and all(f"_{node}_" in f"_{longest}_" for node in named)
    return ((None, ((longest, None),)),) if clear else ()


def all_shares(declared: object, kind: str) -> list[Shares]:
    """Shares of the heat of every role or node that ``solar`` or ``heated`` names."""
    if is_by_role(declared, kind):
        return [shares for target in declared.values() for _, shares in _parts(target)]  # type: ignore[attr-defined]
    if isinstance(declared, str | Mapping):
        return [_as_shares(declared)] if declared else []
    return [((node, None),) for node in as_names(declared)]  # type: ignore[arg-type]


def excessive_shares(network: Declaration, theta: Mapping[str, float]) -> tuple[str, ...]:
    """Fractions in ``theta`` of one heat that sum to more than 1, so that its remainder is negative."""
    for shares in (*all_shares(network.solar, "solar"), *all_shares(network.heated, "heated")):
        given = tuple(fraction for _, fraction in shares if fraction is not None and fraction in theta)
        if sum(theta[fraction] for fraction in given) > 1.0 + _ROUNDING:
            return given
    return ()


def own_parameters(target: object) -> tuple[str, ...]:
    """Areas or capacities that a target of a role names, one per part of its heat."""
    keys = tuple(map(str, target)) if isinstance(target, Mapping) else ()
    return keys if keys and all(key.startswith(SOURCE_PARAMETERS) for key in keys) else ()


def fractions_of(declared: object, kind: str) -> dict[str, str]:
    """Node that each fraction sends heat to, in order of declaration."""
    return {
        fraction: node for shares in all_shares(declared, kind) for node, fraction in shares if fraction is not None
    }


def _parts(target: Any) -> tuple[Part, ...]:
    if own_parameters(target):
        return tuple((parameter, _as_shares(inside)) for parameter, inside in target.items())
    return ((None, _as_shares(target)),)


def _as_shares(target: Target) -> Shares:
    return ((target, None),) if isinstance(target, str) else tuple(target.items())


def capacity_name(role: str) -> str:
    """Parameter of a stage, such as ``Q_h`` of ``u_heat``, ``Q_c`` of ``u_cool`` and ``Q_h_2`` of ``u_heat_2``."""
    name = role[len("u_") :]
    for long, short in (("heat", "h"), ("cool", "c")):
        if name == long or name.startswith(long + "_"):
            return "Q_" + short + name[len(long) :]
    return "Q_u_" + name if name[:1] in "hc" else "Q_" + name  # Q_h... and Q_c... have a sign; this one has none


def _role_order(role: str) -> tuple[int, str]:
    """Sort key: irradiance, then heating, cooling, further stages, then measured heat."""
    begins = [role.startswith(prefix) for prefix in ("q_sol", "u_heat", "u_cool", "u_", "")]
    return begins.index(True), role
