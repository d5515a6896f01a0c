"""Checks of a declared network: each refuses an unclear declaration in one sentence that names the culprit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from .declaration import ROLE_PREFIXES, SOURCE_PARAMETERS, Declaration, all_shares, is_by_role, own_parameters
from .parameters import make_parameter

_NODE = re.compile(r"[A-Za-z]\w*\Z")
_BOUNDARY = re.compile(r"T_\w+\Z")


def check(network: Declaration) -> None:
    """Raise a ValueError if the declaration is unclear."""
    for problem in _problems(network):
        raise ValueError(f"network {network.name}: {problem}")


def _problems(network: Declaration) -> Iterator[str]:
    """The unclear points; a check relies on those before it, so the first point is raised before the next is sought."""
    for kind in ("solar", "heated"):
        yield from _key_problems(network, kind)
        yield from _target_problems(network, kind)
    yield from _name_problems(network)
    yield from _node_problems(network, "measured", network.measured_nodes)
    yield from _node_problems(network, "disturbed", network.disturbed_nodes)
    yield from _resistor_problems(network)
    for kind in ("solar", "heated"):
        yield from _share_problems(network, kind)
    yield from _connection_problems(network)
    yield from _bound_problems(network)
    yield from _zone_problems(network)


def _name_problems(network: Declaration) -> Iterator[str]:
    if not network.capacitances:
        yield "it has no node; give capacitances, such as {'za': 'C_za'}."
    for node in network.capacitances:
        if not isinstance(node, str) or not _NODE.match(node) or node.startswith(("T_", "q_sol", "u_", "Q_")):
            yield (
                f"{node!r} cannot name a node; use letters, digits and _, and no prefix of a role (T_, q_sol, u_, Q_)."
            )
    own = [*network.capacitances.values(), *network.resistors, *_fractions(network)]
    for name in own:
        if not isinstance(name, str):
            yield f"{name!r} is not a name of a parameter; give text, such as 'C_za'."
        elif name.startswith(SOURCE_PARAMETERS):
            yield f"{name!r} cannot name this parameter: A_win... and Q_... are reserved for the sources."
    twice = sorted({str(name) for name in own if own.count(name) > 1})
    if twice:
        yield f"the parameter {twice[0]!r} is used twice; give every parameter its own name."


def _fractions(network: Declaration) -> list[str]:
    """Fraction parameters, each as often as there are pairs of a node and a kind of heat that use it."""
    uses = {
        (fraction, node, kind)
        for kind in ("solar", "heated")
        for shares in all_shares(getattr(network, kind), kind)
        for node, fraction in shares
        if fraction is not None
    }
    return [fraction for fraction, _, _ in sorted(uses)]


def _node_problems(network: Declaration, role: str, nodes: tuple[str, ...]) -> Iterator[str]:
    if not nodes:
        yield f"no node is {role}; name at least one."
    for node in nodes:
        if not isinstance(node, str) or node not in network.capacitances:
            yield f"the {role} node {node!r} has no capacitance."
        if nodes.count(node) > 1:
            yield f"the {role} node {node!r} is named twice; name it once."


def _resistor_problems(network: Declaration) -> Iterator[str]:
    for name, ends in network.resistors.items():
        if not isinstance(ends, tuple | list) or len(ends) != 2 or not all(isinstance(end, str) for end in ends):
            yield f"{name} needs two ends, such as ('za', 'T_oa'); it has {ends!r}."
        for end in ends:
            yield from _end_problems(network, name, end)
        if ends[0] == ends[1] or not set(ends) & set(network.capacitances):
            yield (
                f"{name} connects {ends[0]!r} and {ends[1]!r}, so it carries no heat to any node; give it two "
                "different ends, at least one of them a node with a capacitance."
            )


def _end_problems(network: Declaration, name: str, end: str) -> Iterator[str]:
    if end in network.capacitances:
        return
    if not _BOUNDARY.match(end):
        yield f"{name} ends at {end!r}, which has no capacitance and is not a boundary temperature (T_...)."
    if end[2:] in network.capacitances:
        yield f"{name} ends at {end!r}, the temperature of the node {end[2:]!r}; write {end[2:]!r}."
    if end in ("T_heat_set", "T_cool_set"):
        yield f"{name} ends at {end!r}, the role of a thermostat's set-point; rename the boundary."
    if end == "T_za":
        yield f"{name} ends at 'T_za', the role of the measured temperature; rename the boundary."


def _key_problems(network: Declaration, kind: str) -> Iterator[str]:
    declared, prefixes = getattr(network, kind), ROLE_PREFIXES[kind]
    if not is_by_role(declared, kind):
        return
    for role, target in declared.items():
        if not str(role).startswith(prefixes):
            roles = ", ".join(f"{prefix}..." for prefix in prefixes)
            yield f"{kind} mixes {role!r} with roles; its keys must be all roles ({roles}) or all nodes."
        if not isinstance(target, str | Mapping):
            yield f"{kind} gives {role!r} to {target!r}, which is neither a node nor a mapping of node to share."
        for parameter in own_parameters(target):
            if role.startswith("Q_"):
                yield f"{kind} gives {role!r} the capacity {parameter!r}; it is in kW already, so give shares of it."
            if not parameter.startswith(SOURCE_PARAMETERS[kind == "heated"]):
                yield f"{kind} gives {role!r} the parameter {parameter!r}; an area is A_win..., a capacity Q_...."
            if not isinstance(target[parameter], str | Mapping):
                yield f"{kind} gives {parameter!r} to {target[parameter]!r}, which is neither a node nor shares."
    sources = Counter(source.parameter for source in network.sources(declared) if source.parameter is not None)
    for parameter, count in sources.items():
        if count > 1:
            yield f"{kind} gives {parameter!r} to two sources; give every source its own."


def _target_problems(network: Declaration, kind: str) -> Iterator[str]:
    for shares in all_shares(getattr(network, kind), kind):
        for node, fraction in shares:
            if not isinstance(node, str):
                yield f"{kind} names the node {node!r}; give the name of one with a capacitance."
            if not isinstance(fraction, str | None):
                yield (
                    f"{kind} gives {node!r} the share {fraction!r}; give the name of a parameter, such as 'f', or None "
                    "for the remainder."
                )


def _share_problems(network: Declaration, kind: str) -> Iterator[str]:
    declared = getattr(network, kind)
    if kind == "heated" and not declared:
        yield "heated names no node; name the one that heating and cooling act on."
    for shares in all_shares(declared, kind):
        for node, _ in shares:
            if node not in network.capacitances:
                yield f"the {kind} node {node!r} has no capacitance; heat can only go to nodes that have one."
        if sum(fraction is None for _, fraction in shares) != 1:
            named = ", ".join(repr(node) for node, _ in shares)
            yield f"{kind} shares its heat among {named}; exactly one of them must have None, for the remainder."


def _connection_problems(network: Declaration) -> Iterator[str]:
    nodes = set(network.capacitances)
    for group in _connected_nodes(network):
        linked = [end for ends in network.resistors.values() if group & set(ends) for end in ends]
        if set(linked) <= nodes:
            first = next(node for node in network.capacitances if node in group)
            yield f"node {first!r} is connected to no boundary temperature; add a resistor to one."
    for group in _connected_nodes(network):
        if not group & set(network.measured_nodes):
            named = ", ".join(repr(node) for node in network.capacitances if node in group)
            yield (
                f"no measured node is connected to {named}, so no data can identify its parameters; connect it, "
                "measure it or leave it out."
            )


def _connected_nodes(network: Declaration) -> list[set[str]]:
    """Nodes that are connected to each other without a boundary between them."""
    groups = [{node} for node in network.capacitances]
    for ends in network.resistors.values():
        inside = set(ends) & set(network.capacitances)
        joined = [group for group in groups if group & inside]
        groups = [group for group in groups if not group & inside] + [set().union(*joined)]
    return groups


def _bound_problems(network: Declaration) -> Iterator[str]:
    kinds = {"C": network.capacitances.values(), "R": network.resistors, "f": network.fractions}
    kind_of = {name: kind for kind, names in kinds.items() for name in names}
    for name, bounds in network.bounds.items():
        if name not in kind_of and not str(name).startswith(SOURCE_PARAMETERS):
            yield f"bounds names {name!r}, which is not one of its parameters."
        try:
            make_parameter(name, kind_of.get(name, name[0]), "").bounded(bounds)
        except ValueError as error:
            yield str(error)


def _zone_problems(network: Declaration) -> Iterator[str]:
    for name, inside in network.zones.items():
        if not isinstance(inside, tuple | list):
            yield f"the zone {name!r} is {inside!r}; give a tuple of its nodes, such as ('za_hall', 'w_hall')."
    zone = Counter(node for inside in network.zones.values() for node in inside)
    for node in zone:
        if node not in network.capacitances:
            yield f"zones names the node {node!r}, which has no capacitance; leave it out."
    for node in network.capacitances if network.zones else ():
        if zone[node] != 1:
            yield f"the node {node!r} is in {zone[node]} of its zones; name it in one."
    for name, inside in network.zones.items():
        if len(set(inside) & set(network.measured_nodes)) != 1 or len(set(inside) & set(network.disturbed_nodes)) != 1:
            yield f"the zone {name!r} needs one measured and one disturbed node."
