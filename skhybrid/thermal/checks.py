"""Checks of a declared network: each refuses an unclear declaration in one sentence that names the culprit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NoReturn

import numpy as np

from .declaration import ROLE_PREFIXES, Declaration, all_shares, is_by_role

_NODE = re.compile(r"[A-Za-z]\w*\Z")
_BOUNDARY = re.compile(r"T_\w+\Z")
#: prefixes of the parameters of sources
_SOURCE_PARAMETERS = ("A_win", "Q_")


def check(network: Declaration) -> None:
    """Raise a ValueError if the declaration is unclear."""
    for kind in ("solar", "heated"):
        _check_keys(network, kind)
    _check_names(network)
    _check_parameters_are_unique(network)
    _check_nodes(network, "measured", network.measured_nodes)
    _check_nodes(network, "disturbed", network.disturbed_nodes)
    _check_resistors(network)
    for kind in ("solar", "heated"):
        _check_shares(network, kind)
    _check_connections(network)
    _check_bounds(network)


def _refuse(network: Declaration, text: str) -> NoReturn:
    raise ValueError(f"network {network.name}: {text}")


def _check_names(network: Declaration) -> None:
    if not network.capacitances:
        _refuse(network, "it has no node; give capacitances, such as {'za': 'C_za'}.")
    for node in network.capacitances:
        if not _NODE.match(node) or node.startswith(("T_", "q_sol", "u_", "Q_")):
            _refuse(
                network,
                f"{node!r} cannot name a node; use letters, digits and _, and no prefix of a role (T_, q_sol, u_, Q_).",
            )
    own = [*network.capacitances.values(), *network.resistors, *_fractions(network)]
    for name in own:
        if name.startswith(_SOURCE_PARAMETERS):
            _refuse(network, f"{name!r} cannot name this parameter: A_win... and Q_... are reserved for the sources.")


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


def _check_parameters_are_unique(network: Declaration) -> None:
    names = [*network.capacitances.values(), *network.resistors, *_fractions(network)]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        _refuse(network, f"the parameter {twice[0]!r} is used twice; give every parameter its own name.")


def _check_nodes(network: Declaration, role: str, nodes: tuple[str, ...]) -> None:
    if not nodes:
        _refuse(network, f"no node is {role}; name at least one.")
    for node in nodes:
        if node not in network.capacitances:
            _refuse(network, f"the {role} node {node!r} has no capacitance.")
        if nodes.count(node) > 1:
            _refuse(network, f"the {role} node {node!r} is named twice; name it once.")


def _check_resistors(network: Declaration) -> None:
    for name, ends in network.resistors.items():
        if isinstance(ends, str) or len(ends) != 2:
            _refuse(network, f"{name} needs two ends, such as ('za', 'T_oa'); it has {ends!r}.")
        for end in ends:
            _check_end(network, name, end)
        if ends[0] == ends[1] or not set(ends) & set(network.capacitances):
            _refuse(
                network,
                f"{name} connects {ends[0]!r} and {ends[1]!r}, so it carries no heat to any node; give it two "
                "different ends, at least one of them a node with a capacitance.",
            )


def _check_end(network: Declaration, name: str, end: str) -> None:
    if end in network.capacitances:
        return
    if not _BOUNDARY.match(end):
        _refuse(network, f"{name} ends at {end!r}, which has no capacitance and is no boundary temperature (T_...).")
    if end[2:] in network.capacitances:
        _refuse(network, f"{name} ends at {end!r}, the temperature of the node {end[2:]!r}; write {end[2:]!r}.")
    if end == "T_za":
        _refuse(network, f"{name} ends at 'T_za', the role of the measured temperature; rename the boundary.")


def _check_keys(network: Declaration, kind: str) -> None:
    declared, prefixes = getattr(network, kind), ROLE_PREFIXES[kind]
    if not is_by_role(declared, kind):
        return
    for role, target in declared.items():
        if not role.startswith(prefixes):
            roles = ", ".join(f"{prefix}..." for prefix in prefixes)
            _refuse(network, f"{kind} mixes {role!r} with roles; its keys must be all roles ({roles}) or all nodes.")
        if not isinstance(target, str | Mapping):
            _refuse(
                network, f"{kind} gives {role!r} to {target!r}, which is neither a node nor a mapping of node to share."
            )


def _check_shares(network: Declaration, kind: str) -> None:
    declared = getattr(network, kind)
    if kind == "heated" and not declared:
        _refuse(network, "heated names no node; name the one that heating and cooling act on.")
    for shares in all_shares(declared, kind):
        for node, _ in shares:
            if node not in network.capacitances:
                _refuse(
                    network, f"the {kind} node {node!r} has no capacitance; heat can only go to nodes that have one."
                )
        if sum(fraction is None for _, fraction in shares) != 1:
            named = ", ".join(repr(node) for node, _ in shares)
            _refuse(
                network, f"{kind} shares its heat among {named}; exactly one of them must have None, for the remainder."
            )


def _check_connections(network: Declaration) -> None:
    nodes = set(network.capacitances)
    for group in _connected_nodes(network):
        linked = [end for ends in network.resistors.values() if group & set(ends) for end in ends]
        if set(linked) <= nodes:
            first = next(node for node in network.capacitances if node in group)
            _refuse(network, f"node {first!r} is connected to no boundary temperature; add a resistor to one.")
    for group in _connected_nodes(network):
        if not group & set(network.measured_nodes):
            named = ", ".join(repr(node) for node in network.capacitances if node in group)
            _refuse(
                network,
                f"no measured node is connected to {named}, so no data can identify its parameters; connect it, "
                "measure it or leave it out.",
            )


def _connected_nodes(network: Declaration) -> list[set[str]]:
    """Nodes that are connected to each other without a boundary between them."""
    groups = [{node} for node in network.capacitances]
    for ends in network.resistors.values():
        inside = set(ends) & set(network.capacitances)
        joined = [group for group in groups if group & inside]
        groups = [group for group in groups if not group & inside] + [set().union(*joined)]
    return groups


def _check_bounds(network: Declaration) -> None:
    fractions = set(_fractions(network))
    own = {*network.capacitances.values(), *network.resistors, *fractions}
    for name, bounds in network.bounds.items():
        if name not in own and not name.startswith(_SOURCE_PARAMETERS):
            _refuse(network, f"bounds names {name!r}, which is not one of its parameters.")
        lower, upper = sorted(float(b) for b in bounds)
        if not np.isfinite([lower, upper]).all() or lower == upper:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); give two different finite numbers.")
        if not name.startswith("Q_") and lower <= 0.0:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); both must be positive.")
        if name in fractions and upper > 1.0:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); a share is at most 1.")
        if name.startswith(("Q_h", "Q_c")) and lower * upper <= 0.0:
            _refuse(
                network, f"bounds of {name} are ({lower:g}, {upper:g}); both must have the same sign and not be zero."
            )
