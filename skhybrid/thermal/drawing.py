"""Diagram of a network in SVG: the circuit of one room, or the circuits of several, joined by their partitions.

The rooms of a building stand in two columns.  Between them runs a wire from every room, and partitions join these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import permutations
from typing import NamedTuple

from .canvas import ZIGZAG, Canvas, width
from .catalogue import get_network
from .circuit import Rail, assign_levels
from .declaration import as_names
from .joined_rooms import resistors_of
from .network import RCNetwork, diagram

_NARROWEST = 330.0  # width of the legend [px]
_BAND = 120.0  # least vertical distance between the wires of two rooms [px]
_TITLE = 24.0  # height of a room's name above its circuit [px]
_MARGIN = 26.0  # distance from a room's frame to the next, and to the wires between [px]


@diagram.register(RCNetwork)
def draw(network: str | RCNetwork, roles: Iterable[str] | None = None) -> str:
    """Draw a network as a circuit diagram, a self-contained SVG element.

    Parameters
    ----------
    network : RCNetwork, or a name of the catalogue
        The rooms of a :func:`building_network` are drawn apart, joined by their partitions.
    roles : iterable of str, optional
        Columns whose inputs are drawn; default :attr:`RCNetwork.usual_roles`.
    """
    network = get_network(network)
    roles = network.usual_roles if roles is None else as_names(roles)
    canvas = Canvas()
    if network.zones:
        return _draw_rooms(canvas, network, roles)
    rail = Rail(network, roles, network.nodes, network.resistors)
    rail.draw(canvas)
    canvas.legend(rail.x_min, rail.y_max + 26.0)
    right = max(rail.x_max, rail.x_min + _NARROWEST)
    return canvas.svg(network.name, rail.x_min - 16.0, rail.y_min - 12.0, right + 16.0, rail.y_max + 44.0)


class _Room(NamedTuple):
    """A room's circuit and its place."""

    zone: str
    rail: Rail
    side: int  # 1 in the left column, whose wires go to the right, -1 in the right one
    y: float  # of the rail

    @property
    def top(self) -> float:
        return self.y + self.rail.y_min - _TITLE

    @property
    def bottom(self) -> float:
        return self.y + self.rail.y_max

    @property
    def size(self) -> float:
        """Width of the frame."""
        return self.rail.x_max - self.rail.x_min + 2 * 12.0


def _draw_rooms(canvas: Canvas, network: RCNetwork, roles: tuple[str, ...]) -> str:
    ports, partitions = _partitions(network)
    rooms = _place_rooms(network, roles, ports, partitions)
    place = {room.zone: i for i, room in enumerate(rooms)}
    rows = [(name, min(place[a], place[b]), max(place[a], place[b])) for name, (a, b) in partitions.items()]
    lanes = assign_levels(rows)
    left = max((room.size for room in rooms if room.side > 0), default=0.0)
    pitch = 2 * 14.0 + max((width(name) for name in partitions), default=0.0) + 10.0
    lane_x = {name: left + _MARGIN + 14.0 + pitch * level for name, *_, level in lanes}
    middle = pitch * (1 + max((level for *_, level in lanes), default=-1)) + 2 * _MARGIN
    for room in rooms:
        canvas.origin = (0.0, 0.0)
        begin = left - room.size if room.side > 0 else left + middle
        canvas.frame(begin, room.top, begin + room.size, room.bottom, room.zone)
        canvas.origin = (begin + 12.0 - room.rail.x_min, room.y)
        own = [lane_x[name] for name, pair in partitions.items() if room.zone in pair]
        if own:
            port = room.rail.columns[-1 if room.side > 0 else 0].x
            canvas.wire([(port, 0.0), (max(own, key=lambda x: room.side * x) - canvas.origin[0], 0.0)])
        room.rail.draw(canvas)
    canvas.origin = (0.0, 0.0)
    for name, i, j in rows:
        _draw_partition(canvas, name, lane_x[name], rooms[i].y, rooms[i + 1].y, rooms[j].y)
    end = left + middle + max((room.size for room in rooms if room.side < 0), default=0.0)
    bottom = max(room.bottom for room in rooms)
    canvas.legend(0.0, bottom + 26.0)
    return canvas.svg(network.name, -16.0, min(r.top for r in rooms) - 12.0, max(end, _NARROWEST) + 16.0, bottom + 44.0)


def _draw_partition(canvas: Canvas, name: str, x: float, top: float, following: float, bottom: float) -> None:
    """Draw the resistor of a partition between two rooms' wires, above that of the room ``following`` the first."""
    middle = 0.5 * (top + following)
    canvas.wire([(x, top), (x, middle - ZIGZAG / 2)])
    canvas.zigzag(x, middle, upright=True)
    canvas.wire([(x, middle + ZIGZAG / 2), (x, bottom)])
    canvas.text(x + 13.0, middle + 5.0, name, "start")
    canvas.dot(x, top)
    canvas.dot(x, bottom)


def _partitions(network: RCNetwork) -> tuple[dict[str, str], dict[str, tuple[str, str]]]:
    """The node at which each room is joined to most others, and the resistors between such nodes with their zones."""
    zone = {node: name for name, inside in network.zones.items() for node in inside}
    between = {n: ends for n, ends in network.resistors.items() if len({zone.get(end) for end in ends} - {None}) == 2}
    counts = Counter(end for ends in between.values() for end in ends)
    measured = dict(zip(network.measured_names, network.measured_nodes, strict=True))
    ports = {
        name: max(inside, key=lambda node: (counts[node], node == measured[name]))
        for name, inside in network.zones.items()
    }
    joined = {n: (zone[a], zone[b]) for n, (a, b) in between.items() if a == ports[zone[a]] and b == ports[zone[b]]}
    return ports, joined


def _place_rooms(
    network: RCNetwork, roles: tuple[str, ...], ports: Mapping[str, str], partitions: Mapping[str, tuple[str, str]]
) -> list[_Room]:
    """Rooms from top to bottom, left and right by turns; those that share a partition near each other."""
    rooms: list[_Room] = []
    for k, zone in enumerate(_room_order(tuple(network.zones), list(partitions.values()))):
        side, nodes = 1 if k % 2 == 0 else -1, network.zones[zone]
        resistors = {name: ends for name, ends in resistors_of(nodes, network).items() if name not in partitions}
        rail = Rail(network, roles, nodes, resistors, (ports[zone], side))
        y = rooms[-1].y + _BAND if rooms else 0.0
        if k > 1:
            y = max(y, rooms[-2].bottom + _MARGIN + _TITLE - rail.y_min)
        rooms.append(_Room(zone, rail, side, y))
    return rooms


def _room_order(zones: tuple[str, ...], pairs: list[tuple[str, str]]) -> tuple[str, ...]:
    def cost(order: tuple[str, ...]) -> int:
        return sum(abs(order.index(a) - order.index(b)) for a, b in pairs)

    return min(permutations(zones), key=cost) if len(zones) <= 6 else zones
