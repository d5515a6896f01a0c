"""What a declaration says, and what of it is refused: pure functions on a network's fields."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NoReturn

import numpy as np

if TYPE_CHECKING:
    from .network import RCNetwork

#: where heat goes: a node, or nodes with the name of the fraction that each gets (None: what is left)
Target = str | Mapping[str, str | None]
Shares = tuple[tuple[str, str | None], ...]

_NODE = re.compile(r"[A-Za-z]\w*\Z")
_BOUNDARY = re.compile(r"T_\w+\Z")
#: first letters of a parameter that only a source may have
_SOURCE_NAMES = ("A_win", "Q_")
#: what a role of each kind of heat begins with
ROLES_OF = {"solar": ("q_sol",), "heated": ("u_", "Q_")}


def as_names(value: str | Iterable[str]) -> tuple[str, ...]:
    """One name or several, as a tuple."""
    return (value,) if isinstance(value, str) else tuple(value)


def by_role(declared: object, kind: str) -> bool:
    """Whether ``solar`` or ``heated`` is a mapping of role to target."""
    return isinstance(declared, Mapping) and any(str(key).startswith(ROLES_OF[kind]) for key in declared)


def shares_of(target: Target) -> Shares:
    """(node, fraction or None) of every node that a target heats."""
    return ((target, None),) if isinstance(target, str) else tuple(target.items())


def target_of(declared: object, kind: str, role: str) -> Shares | None:
    """Where a source of this role heats, or None where the declaration does not say."""
    if by_role(declared, kind):
        found = declared.get(role)  # type: ignore[attr-defined]
        return None if found is None else shares_of(found)
    if isinstance(declared, str | Mapping):
        return shares_of(declared) or None
    named = [node for node in as_names(declared) if f"_{node}_" in f"{role}_"]  # type: ignore[arg-type]
    return ((named[0], None),) if len(named) == 1 else None


def targets(declared: object, kind: str) -> dict[str, Shares]:
    """Every target that is declared, by the role or the node that names it."""
    if by_role(declared, kind):
        return {role: shares_of(target) for role, target in declared.items()}  # type: ignore[attr-defined]
    if isinstance(declared, str | Mapping):
        return {kind: shares_of(declared)} if declared else {}
    return {f"{kind} {node}": ((node, None),) for node in as_names(declared)}  # type: ignore[arg-type]


def fractions_of(declared: object, kind: str) -> dict[str, str]:
    """Fraction -> the node that it sends heat to, in order of declaration."""
    return {
        fraction: node
        for shares in targets(declared, kind).values()
        for node, fraction in shares
        if fraction is not None
    }


# ------------------------------------------------------------------------------------------------------ what is refused
def check(network: RCNetwork) -> None:
    """Refuse a declaration that is unclear, in one sentence that names the culprit."""
    for kind in ("solar", "heated"):
        _check_keys(network, kind)
    _check_names(network)
    _check_twice(network)
    for role in ("measured", "disturbed"):
        _check_places(network, role, as_names(getattr(network, role)))
    _check_resistors(network)
    for kind in ("solar", "heated"):
        _check_targets(network, kind)
    _check_islands(network)
    _check_bounds(network)


def _refuse(network: RCNetwork, text: str) -> NoReturn:
    raise ValueError(f"network {network.name}: {text}")


def _check_names(network: RCNetwork) -> None:
    if not network.capacitances:
        _refuse(network, "it has no node; give capacitances, such as {'za': 'C_za'}.")
    for node in network.capacitances:
        if not _NODE.match(node) or node.startswith(("T_", "q_sol", "u_", "Q_")):
            _refuse(network, f"{node!r} cannot name a node; use letters, digits and _, and no prefix of a role.")
    own = [*network.capacitances.values(), *network.resistors, *_fractions(network)]
    for name in own:
        if name.startswith(_SOURCE_NAMES):
            _refuse(network, f"{name!r} cannot name this parameter: A_win... and Q_... are those of the sources.")


def _fractions(network: RCNetwork) -> list[str]:
    """Fractions, one for each (node, kind of heat) that they serve."""
    served = {
        (fraction, node, kind)
        for kind in ("solar", "heated")
        for shares in targets(getattr(network, kind), kind).values()
        for node, fraction in shares
        if fraction is not None
    }
    return [fraction for fraction, _, _ in sorted(served)]


def _check_twice(network: RCNetwork) -> None:
    names = [*network.capacitances.values(), *network.resistors, *_fractions(network)]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        _refuse(network, f"the parameter {twice[0]!r} is used twice; give each place a name of its own.")


def _check_places(network: RCNetwork, role: str, places: tuple[str, ...]) -> None:
    if not places:
        _refuse(network, f"no node is {role}; name one.")
    for node in places:
        if node not in network.capacitances:
            _refuse(network, f"the {role} node {node!r} has no capacitance.")
        if places.count(node) > 1:
            _refuse(network, f"the {role} node {node!r} is named twice.")


def _check_resistors(network: RCNetwork) -> None:
    for name, ends in network.resistors.items():
        if isinstance(ends, str) or len(ends) != 2:
            _refuse(network, f"{name} needs two ends, such as ('za', 'T_oa'); it has {ends!r}.")
        for end in ends:
            _check_end(network, name, end)
        if ends[0] == ends[1] or not set(ends) & set(network.capacitances):
            _refuse(
                network,
                f"{name} connects {ends[0]!r} and {ends[1]!r}, which carries no heat to any node; give it two ends "
                "that differ, one of them a node with a capacitance.",
            )


def _check_end(network: RCNetwork, name: str, end: str) -> None:
    if end in network.capacitances:
        return
    if not _BOUNDARY.match(end):
        _refuse(network, f"{name} ends at {end!r}, which has no capacitance and is no boundary temperature (T_...).")
    if end[2:] in network.capacitances:
        _refuse(network, f"{name} ends at {end!r}, the temperature of the node {end[2:]!r}; write {end[2:]!r}.")
    if end == "T_za":
        _refuse(
            network, f"{name} ends at 'T_za', which is the history of what is measured; name the boundary otherwise."
        )


def _check_keys(network: RCNetwork, kind: str) -> None:
    declared, begin = getattr(network, kind), ROLES_OF[kind]
    if not by_role(declared, kind):
        return
    for role, target in declared.items():
        if not role.startswith(begin):
            roles = ", ".join(f"{b}..." for b in begin)
            _refuse(network, f"{kind} names {role!r} beside roles; its keys are all roles ({roles}) or all nodes.")
        if not isinstance(target, str | Mapping):
            _refuse(network, f"{kind} gives {role!r} to {target!r}, which is no node and no mapping of node to share.")


def _check_targets(network: RCNetwork, kind: str) -> None:
    declared = getattr(network, kind)
    if kind == "heated" and not declared:
        _refuse(network, "heated names no node; heating and cooling must act on one.")
    for shares in targets(declared, kind).values():
        for node, _ in shares:
            if node not in network.capacitances:
                what = "solar needs nodes with a capacitance" if kind == "solar" else "heated needs nodes with one"
                _refuse(network, f"the {kind} node {node!r} has no capacitance; {what}.")
        if sum(fraction is None for _, fraction in shares) != 1:
            named = ", ".join(repr(node) for node, _ in shares)
            _refuse(network, f"{kind} gives {named} their shares; exactly one with None gets what is left.")


def _check_islands(network: RCNetwork) -> None:
    nodes = set(network.capacitances)
    for group in _groups(network):
        linked = [end for ends in network.resistors.values() if group & set(ends) for end in ends]
        if set(linked) <= nodes:
            first = next(node for node in network.capacitances if node in group)
            _refuse(network, f"node {first!r} is connected to no boundary temperature.")
    for group in _groups(network):
        if not group & set(as_names(network.measured)):
            named = ", ".join(repr(node) for node in network.capacitances if node in group)
            _refuse(
                network,
                f"no measured node is connected to {named}, so that no data can tell its parameters; connect it, "
                "measure it or leave it out.",
            )


def _groups(network: RCNetwork) -> list[set[str]]:
    """Nodes that are connected to each other without a boundary between them."""
    groups = [{node} for node in network.capacitances]
    for ends in network.resistors.values():
        inside = set(ends) & set(network.capacitances)
        touched = [g for g in groups if g & inside]
        groups = [g for g in groups if not g & inside] + [set().union(*touched)]
    return groups


def _check_bounds(network: RCNetwork) -> None:
    positive = {**dict.fromkeys(network.capacitances.values(), "C"), **dict.fromkeys(network.resistors, "R")}
    fractions = set(_fractions(network))
    for name, bounds in network.bounds.items():
        if name not in positive and name not in fractions and not name.startswith(_SOURCE_NAMES):
            _refuse(network, f"bounds names {name!r}, which is no parameter of it.")
        lower, upper = sorted(float(b) for b in bounds)
        if not np.isfinite([lower, upper]).all() or lower == upper:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); give two numbers that differ.")
        if not name.startswith("Q_") and lower <= 0.0:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); both must be positive.")
        if name in fractions and upper > 1.0:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); a share is at most 1.")
        if name.startswith(("Q_h", "Q_c")) and lower * upper <= 0.0:
            _refuse(network, f"bounds of {name} are ({lower:g}, {upper:g}); both must have one sign and not be zero.")
