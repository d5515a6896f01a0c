"""Networks of buildings: one room network per zone, joined by the resistors of partitions."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from .._arguments import as_mapping
from .._table import is_stage
from .catalogue import get_network
from .declaration import ROLE_PREFIXES, SOURCE_PARAMETERS, Target, as_names, capacity_name, is_by_role, own_parameters
from .network import RCNetwork

#: bounds of a partition [K/kW]: from an open door to nearly nothing
_PARTITION = (0.05, 400.0)


def building_network(
    zones: Sequence[str] | Mapping[str, str | RCNetwork],
    adjacency: Iterable[tuple[str, str]] | None = None,
    *,
    room: str | RCNetwork = "2R2C",
    couple: Sequence[str] = ("za",),
    solar: str | Mapping[str, str | Sequence[str]] | None = None,
    heated: Mapping[str, str | Sequence[str]] | None = None,
    name: str = "building",
) -> RCNetwork:
    """Network of a building: a room network per zone, joined by a partition between each two adjacent zones.

    Parameters
    ----------
    zones : sequence of str, or mapping of zone to network
        Two names or more; with a mapping, each zone has a network of its own.
    adjacency : iterable of (zone, zone), optional
        The pairs that share a partition, from the floor plan or :func:`~skhybrid.identification.find_adjacency`.  By
        default none: a coupling on a wrong path does more harm than a missing one.
    room : str or RCNetwork
        Network of a zone, by its name in the catalogue; it measures, heats and disturbs one node each.
    couple : sequence of str
        Nodes of the rooms that a partition joins: ``("za",)`` the air, ``("za", "w")`` air and walls too.
    solar : str, or mapping of zone to role or roles, optional
        Irradiance on the windows of each zone, by default its own, ``q_sol_<zone>``.  ``"q_sol"`` is one for all; in a
        mapping ``()`` stands for a zone without windows, and zones that it does not name have their own.
    heated : mapping of zone to role or roles, optional
        What heats and cools each zone; ``()`` stands for nothing.  A zone that is not named has its own
        ``u_heat_<zone>``, ``u_cool_<zone>`` and ``Q_hvac_<zone>``, and shares ``u_heat``, ``u_cool`` and ``Q_hvac``
        with the others, as far as the table has them.
    name : str

    Returns
    -------
    RCNetwork
        Nodes ``za_<zone>``, ``w_<zone>`` ...; parameters ``C_za_<zone>``, ``R_zo_<zone>`` ...; partitions ``R_<a>_<b>``
        between air nodes and ``R_w_<a>_<b>`` between others, in the order of the pair.  A stage that several zones
        share has a capacity per zone, ``Q_h_to_<zone>``; heat [kW] that they share has shares ``f_hvac_<zone>``, whose
        remainder goes to the last; irradiance that they share has an area per zone, ``A_win_to_<zone>``.

    Raises
    ------
    ValueError
        If there are less than two zones, a name is unusual or given twice, a pair is unknown, given twice or a zone
        with itself, two resistors would have one name, or a room network measures, heats or disturbs several nodes.

    Examples
    --------
    >>> from skhybrid.thermal import building_network
    >>> flat = building_network(["north", "south"], [("north", "south")], solar="q_sol", room="1R1C")
    >>> print(flat.equations(["q_sol", "u_heat_north", "Q_hvac_south"]).replace(" + ", "\\n   + "))
    C_za_north dT_za_north/dt = (T_oa - T_za_north)/R_zo_north
       + (T_za_south - T_za_north)/R_north_south
       + A_win_to_north q_sol
       + Q_h_north u_heat_north
       + Q_g_north
    C_za_south dT_za_south/dt = (T_oa - T_za_south)/R_zo_south
       + (T_za_north - T_za_south)/R_north_south
       + A_win_to_south q_sol
       + Q_hvac_south
       + Q_g_south
    >>> flat.history_roles
    ('T_za_north', 'T_za_south')
    """
    rooms = {zone: _checked_room(zone, network) for zone, network in _rooms(zones, room).items()}
    pairs = checked_pairs(adjacency, rooms)
    renamed = {zone: {node: f"{node}_{zone}" for node in network.nodes} for zone, network in rooms.items()}
    own = {f"{r}_{z}": _ends(ends, renamed[z]) for z, network in rooms.items() for r, ends in network.resistors.items()}
    joined = _partitions(rooms, pairs, couple, own)
    building = RCNetwork(
        name,
        {f"{node}_{z}": f"{c}_{z}" for z, network in rooms.items() for node, c in network.capacitances.items()},
        own | joined,
        _solar(rooms, solar),
        measured=tuple(f"{network.measured}_{zone}" for zone, network in rooms.items()),
        disturbed=tuple(f"{network.disturbed}_{zone}" for zone, network in rooms.items()),
        heated=_heated(rooms, heated),
        zones={zone: tuple(nodes.values()) for zone, nodes in renamed.items()},
    )
    return replace(building, bounds=_bounds(rooms, building) | dict.fromkeys(joined, _PARTITION))


def _rooms(zones: Any, room: str | RCNetwork) -> dict[str, RCNetwork]:
    names = _names("zones", tuple(zones) if isinstance(zones, Mapping) else zones)
    if len(set(names)) < len(names):
        raise ValueError(f"zones={list(names)!r} names a zone twice; give every zone its own name.")
    if len(names) < 2:
        raise ValueError(f"zones={zones!r} has {len(names)} of the two or more zones that a building joins.")
    for zone in names:
        if not re.fullmatch(r"\w+", zone, re.ASCII):
            raise ValueError(f"zones has {zone!r}, which cannot be part of a column's name; use letters, digits and _.")
    if isinstance(zones, Mapping):
        return {zone: get_network(zones[zone], f"zones[{zone!r}]") for zone in names}
    return dict.fromkeys(names, get_network(room, "room"))


def _names(argument: str, given: Any) -> tuple[str, ...]:
    """One name or several, refused where they are no text."""
    names = as_names(given) if isinstance(given, Iterable) and not isinstance(given, Mapping) else (given,)
    if not all(isinstance(name, str) for name in names):
        raise ValueError(f"{argument} is {given!r}; give one name or several, as text.")
    return names


def _checked_room(zone: str, network: RCNetwork) -> RCNetwork:
    for what in ("measured", "disturbed", "heated"):
        if not isinstance(getattr(network, what), str):
            raise ValueError(
                f"the network {network.name} of zone {zone!r} names {getattr(network, what)!r} as {what}; "
                "give a room network with one such node."
            )
    if is_by_role(network.solar, "solar") or isinstance(network.solar, tuple):
        raise ValueError(
            f"the network {network.name} of zone {zone!r} has several windows; give one, and its irradiance in "
            f"solar={{{zone!r}: roles}}."
        )
    return network


def checked_pairs(adjacency: Any, zones: Collection[str]) -> list[tuple[str, str]]:
    """The pairs of neighbours, refused where they are no pairs of two different zones."""
    pairs: list[tuple[str, str]] = []
    several = isinstance(adjacency, Iterable) and not isinstance(adjacency, str)
    for pair in () if adjacency is None else adjacency if several else (adjacency,):
        both = tuple(pair) if isinstance(pair, Iterable) and not isinstance(pair, str) else ()
        if len(both) != 2 or not all(isinstance(zone, str) for zone in both):
            raise ValueError(f"adjacency has {pair!r}; give pairs of zones, such as ('north', 'south').")
        for zone in both:
            if zone not in zones:
                raise ValueError(f"adjacency names {zone!r}, which is not one of the zones {', '.join(zones)}.")
        if both[0] == both[1]:
            raise ValueError(f"adjacency couples {both[0]!r} with itself; leave the pair out.")
        if both in pairs or both[::-1] in pairs:
            raise ValueError(f"adjacency has the pair {both[0]!r}, {both[1]!r} twice; give it once.")
        pairs.append(both)
    return pairs


def _partitions(
    rooms: Mapping[str, RCNetwork], pairs: Iterable[tuple[str, str]], couple: Sequence[str], taken: Collection[str]
) -> dict[str, tuple[str, str]]:
    """Resistors between the rooms of each pair, with their ends; ``taken`` are the names of other resistors."""
    out: dict[str, tuple[str, str]] = {}
    for kind, (a, b) in product(dict.fromkeys(_names("couple", couple)), pairs):
        for zone in (a, b):
            if kind not in rooms[zone].nodes:
                raise ValueError(
                    f"couple names the node {kind!r}, which zone {zone!r} lacks; its nodes are "
                    f"{', '.join(rooms[zone].nodes)}."
                )
        name = f"R_{a}_{b}" if kind == "za" else f"R_{kind}_{a}_{b}"
        if name in taken or name in out:
            raise ValueError(f"the partition of {a!r} and {b!r} would be a second {name!r}; rename one of the zones.")
        out[name] = f"{kind}_{a}", f"{kind}_{b}"
    return out


def _ends(ends: tuple[str, str], renamed: Mapping[str, str]) -> tuple[str, str]:
    return renamed.get(ends[0], ends[0]), renamed.get(ends[1], ends[1])


def _bounds(rooms: Mapping[str, RCNetwork], building: RCNetwork) -> dict[str, tuple[float, float]]:
    """Bounds of the rooms by the building's names; those of a source hold for each of its roles, shared or not."""
    out = {f"{p}_{zone}": given for zone, network in rooms.items() for p, given in network.bounds.items()}
    zone_of = {node: zone for zone, inside in building.zones.items() for node in inside}
    for source in building.sources({*building.solar, *building.heated}):
        for p, given in rooms[zone_of[source.shares[0][0]]].bounds.items():
            if p.startswith(SOURCE_PARAMETERS) and f"{source.parameter}_".startswith(f"{p}_"):
                out[str(source.parameter)] = given
    return out


def _solar(rooms: Mapping[str, RCNetwork], given: Any) -> dict[str, Any]:
    """Role -> where its heat goes, with an area per zone where several share it."""
    sunny = [zone for zone, network in rooms.items() if network.solar]
    asked = dict.fromkeys(sunny, given) if isinstance(given, str) else _checked_roles("solar", given, rooms)
    served = _zones_by_role({zone: asked.get(zone, f"q_sol_{zone}") for zone in sunny})
    out: dict[str, Any] = {}
    for role, zones in served.items():
        if not role.startswith(ROLE_PREFIXES["solar"]):
            raise ValueError(f"solar names {role!r}, which is not an irradiance; its role begins with q_sol.")
        shares = {zone: _shares(rooms[zone].solar, zone) for zone in zones}
        suffix = role.removeprefix("q_sol")
        apart = {f"A_win{suffix}_to_{zone}": target for zone, target in shares.items()}
        out[role] = apart if len(zones) > 1 else shares[zones[0]]
    return out


def _heated(rooms: Mapping[str, RCNetwork], given: Any) -> dict[str, Any]:
    """Role -> node; capacities of a stage that several zones share, shares of heat that they share."""
    asked, kinds = _checked_roles("heated", given, rooms), ("u_heat", "u_cool", "Q_hvac")
    usual = {zone: (*(f"{kind}_{zone}" for kind in kinds), *kinds) for zone in rooms}
    out: dict[str, Any] = {}
    for role, zones in _zones_by_role(usual | asked).items():
        nodes = {zone: f"{rooms[zone].heated}_{zone}" for zone in zones}
        if len(zones) == 1:
            out[role] = nodes[zones[0]]
        elif is_stage(role):
            out[role] = {f"{capacity_name(role)}_to_{zone}": node for zone, node in nodes.items()}
        else:
            last = zones[-1]
            out[role] = {node: None if z == last else f"f_{role[2:]}_{z}" for z, node in nodes.items()}
    return out


def _checked_roles(argument: str, given: Any, rooms: Mapping[str, RCNetwork]) -> dict[str, Any]:
    out, content = {}, {"solar": "zones to roles, or one role", "heated": "zones to roles"}
    for zone, roles in as_mapping(argument, given, content[argument]).items():
        if zone not in rooms:
            raise ValueError(f"{argument} names {zone!r}, which is not one of the zones {', '.join(rooms)}.")
        out[zone] = () if roles is None else _names(f"{argument} of zone {zone!r}", roles)
    return out


def _zones_by_role(roles: Mapping[str, Any]) -> dict[str, list[str]]:
    out: dict[str, list[str]] = {}
    for zone, named in roles.items():
        for role in as_names(named):
            out.setdefault(role, []).append(zone)
    return out


def _shares(target: Any, zone: str) -> Target:
    """Nodes that the sun of a room network heats, renamed."""
    if isinstance(target, str):
        return f"{target}_{zone}"
    return {f"{node}_{zone}": None if share is None else f"{share}_{zone}" for node, share in target.items()}


def room_network(network: RCNetwork, zone: str) -> RCNetwork:
    """Network of one zone of a building, with its neighbours' temperatures, ``T_<node>``, as boundaries.

    Parameters
    ----------
    network : RCNetwork
        From :func:`building_network`.
    zone : str

    Returns
    -------
    RCNetwork
        With the names of the building's parameters, without heat [kW] that several zones share.

    Raises
    ------
    ValueError
        If the network has no such zone, or its sun or plant is not declared by role.
    """
    if not isinstance(network, RCNetwork):
        raise ValueError(f"network={network!r} is not the network of a building; give one made by building_network.")
    if zone not in list(network.zones):
        raise ValueError(
            f"the network {network.name} has no zone {zone!r}: {', '.join(network.zones) or 'it has none'}."
        )
    for kind in ("solar", "heated"):
        if (declared := getattr(network, kind)) and not is_by_role(declared, kind):
            raise ValueError(
                f"the network {network.name} has {kind}={declared!r}, which does not say what each room has; give a "
                "mapping of role to node, as building_network does."
            )
    nodes = network.zones[zone]
    capacitances, resistors = {node: network.capacitances[node] for node in nodes}, resistors_of(nodes, network)
    own = {*capacitances.values(), *resistors, *(f for f, node in network.fractions.items() if node in nodes)}
    return RCNetwork(
        zone,
        capacitances,
        resistors,
        _of_room(network.solar, nodes),
        measured=tuple(set(network.measured_nodes) & set(nodes)),
        disturbed=tuple(set(network.disturbed_nodes) & set(nodes)),
        heated=_of_room(network.heated, nodes) or nodes[-1],
        bounds={p: given for p, given in network.bounds.items() if p in own or p.startswith(SOURCE_PARAMETERS)},
    )


def resistors_of(nodes: tuple[str, ...], network: RCNetwork) -> dict[str, tuple[str, str]]:
    """Resistors at the nodes of one room; a node of another room is the boundary ``T_<node>``."""
    seen = {node: f"T_{node}" for node in network.nodes if node not in nodes}
    return {name: _ends(ends, seen) for name, ends in network.resistors.items() if set(ends) & set(nodes)}


def _of_room(declared: Any, nodes: tuple[str, ...]) -> dict[str, Any]:
    """Sun or plant of the nodes of one room, by role."""
    out: dict[str, Any] = {}
    for role, target in declared.items():
        parts = {p: inside for p, inside in target.items() if _goes_to(inside, nodes)} if own_parameters(target) else {}
        if parts:
            out[role] = parts
        elif not own_parameters(target) and _goes_to(target, nodes):
            out[role] = target
    return out


def _goes_to(target: Any, nodes: tuple[str, ...]) -> bool:
    return bool(target) and set(as_names(target)) <= set(nodes)
