"""Circuit of one room: its nodes in a row, the rail, with what is drawn at each.

A resistor between neighbours lies on the rail; one to a boundary continues the rail or rises from its node; one between
nodes that are not neighbours crosses above.  Capacitors and sources hang below.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations

from .canvas import HEAT, QUIET, ZIGZAG, Canvas, width
from .declaration import Declaration
from .equations import heat_inputs

_PORT = 52  # least horizontal distance between wires that rise from one node [px]
_RISE = 110  # height of a boundary above its node [px]
_LEVEL = 42  # vertical distance between resistors that cross above [px]


@dataclass
class _Column:
    """A node with everything drawn at it, and the width that this takes."""

    node: str
    rising: list[tuple[str, str]] = field(default_factory=list)  # (resistor, boundary above the node)
    to_left: list[str] = field(default_factory=list)  # resistors that cross above to the left
    to_right: list[str] = field(default_factory=list)  # and to the right
    sources: list[str] = field(default_factory=list)
    x: float = 0.0

    @property
    def ports(self) -> list[str]:
        """Resistors that rise from the node, from left to right."""
        return [*self.to_left, *(name for name, _ in self.rising), *self.to_right]

    @property
    def half_bus(self) -> float:
        """Half the width of the horizontal wire that joins the rising ones."""
        return 0.5 * self.pitch * max(len(self.ports) - 1, 0)

    @property
    def pitch(self) -> float:
        """Distance between the rising wires, with room for their labels."""
        return max([_PORT, *(28.0 + width(name) for name, _ in self.rising)])

    def left(self) -> float:
        """Width needed to the left of the node."""
        return max([42.0, self.half_bus + 20.0, *(0.5 * width(s) for s in self.sources)])

    def right(self, capacitance: str) -> float:
        """Width needed to its right."""
        label = 12.0 + max([width(name) for name, _ in self.rising], default=0.0)
        below = max(12.0 + width(f"T_{self.node}"), 20.0 + width(capacitance))
        return max([below, self.half_bus + label, *(0.5 * width(s) for s in self.sources)])


class Rail:
    """Positions of the nodes, and the route of each resistor."""

    def __init__(
        self,
        network: Declaration,
        roles: tuple[str, ...],
        nodes: Sequence[str],
        resistors: Mapping[str, tuple[str, str]],
        port: tuple[str, int] | None = None,  # a node and the end of the rail where it goes on: -1 left, 1 right
    ) -> None:
        self.network = network
        order, self.port = _node_order(nodes, resistors, port), port
        index = {node: i for i, node in enumerate(order)}
        self.columns = [_Column(node, sources=heat_inputs(network, node, roles)) for node in order]
        self.neighbours: list[tuple[str, int, int]] = []
        self.ends: list[tuple[str, str, int]] = []  # (resistor, boundary, -1 left or 1 right)
        distant: list[tuple[str, int, int]] = []
        for name, (one, two) in resistors.items():
            if one in index and two in index:
                i, j = sorted((index[one], index[two]))
                if j == i + 1 and (i, j) not in [(a, b) for _, a, b in self.neighbours]:
                    self.neighbours.append((name, i, j))
                else:
                    distant.append((name, i, j))
                continue
            node, boundary = (one, two) if one in index else (two, one)
            side = self._free_end(index[node], len(order))
            if side:
                self.ends.append((name, boundary, side))
            else:
                self.columns[index[node]].rising.append((name, boundary))
        for name, i, j in distant:
            self.columns[i].to_right.append(name)
            self.columns[j].to_left.append(name)
        self.crossings = assign_levels(distant)
        self._place_columns()

    def draw(self, canvas: Canvas) -> None:
        """Draw the circuit, its rail at the canvas's origin."""
        for resistor, i, j in self.neighbours:
            a, b = self.columns[i], self.columns[j]
            canvas.resistor(a.x, 0.5 * (a.x + a.half_bus + b.x - b.half_bus), b.x, 0.0, resistor)
        for resistor, boundary, side in self.ends:
            _draw_end_of_rail(canvas, self, resistor, boundary, side)
        for column in self.columns:
            for resistor, boundary in column.rising:
                _draw_rising_resistor(canvas, column, resistor, boundary)
        for resistor, i, j, level in self.crossings:
            _draw_crossing_resistor(canvas, self, resistor, i, j, level)
        for column in self.columns:
            _draw_node(canvas, self.network, column)

    def _free_end(self, i: int, n: int) -> int:
        """Free end of the rail next to node i: -1 left, 1 right, or 0 for none."""
        taken = {side for _, _, side in self.ends} | ({self.port[1]} if self.port else set())
        if i == 0 and -1 not in taken:
            return -1
        return 1 if i == n - 1 and 1 not in taken else 0

    def _place_columns(self) -> None:
        """Set the abscissa of every node and the extent of the drawing."""
        names = {(i, j): name for name, i, j in self.neighbours}
        x = 0.0
        for i, column in enumerate(self.columns):
            if i:
                before = self.columns[i - 1]
                wire = before.half_bus + column.half_bus + ZIGZAG + width(names.get((i - 1, i), "")) + 16.0
                labels = before.right(self.network.capacitances[before.node]) + column.left() + 12.0
                x += max(120.0, wire, labels)
            column.x = x
        first, last = self.columns[0], self.columns[-1]
        left, right = first.left(), last.right(self.network.capacitances[last.node])
        for _, _, side in self.ends:
            if side < 0:
                left = max(left, self.reach(first) + 24.0)
            else:
                right = max(right, self.reach(last) + 24.0)
        self.x_min, self.x_max = first.x - left, last.x + right
        rises = any(column.rising for column in self.columns)
        self.first_level = _RISE + 52.0 if rises else 52.0
        levels = max((level for *_, level in self.crossings), default=-1) + 1
        top = self.first_level + _LEVEL * (levels - 1) + 30.0 if levels else 40.0
        self.y_min = -max(top, _RISE + 34.0 if rises else 40.0)
        self.y_max = 92.0 + 18.0 * max(len(column.sources) for column in self.columns) + 10.0

    @staticmethod
    def reach(column: _Column) -> float:
        """Distance on the rail from an outermost node to its boundary."""
        return column.half_bus + 130.0


def _node_order(
    nodes: Sequence[str], resistors: Mapping[str, tuple[str, str]], port: tuple[str, int] | None
) -> tuple[str, ...]:
    """Nodes along the rail: connected nodes side by side, those with a boundary or the port at the ends."""
    links = [ends for ends in resistors.values() if set(ends) <= set(nodes)]
    outside = {node: sum(node in ends for ends in resistors.values()) for node in nodes}
    for a, b in links:
        outside[a] -= 1
        outside[b] -= 1

    def cost(order: tuple[str, ...]) -> float:
        index = {node: i for i, node in enumerate(order)}
        crossed = sum(abs(index[a] - index[b]) - 1 for a, b in links)
        rising = sum(outside[node] for node in order[1:-1])
        away = port is not None and order[0 if port[1] < 0 else -1] != port[0]
        return 10.0 * crossed + rising - 0.5 * bool(outside[order[0]]) + 100.0 * away

    if len(nodes) <= 7:
        return min(permutations(nodes), key=cost)
    best = tuple(nodes)
    while True:  # swap two nodes as long as that helps
        swaps = [
            tuple(best[j] if k == i else best[i] if k == j else node for k, node in enumerate(best))
            for i in range(len(best))
            for j in range(i)
        ]
        found = min(swaps, key=cost)
        if cost(found) >= cost(best):
            return best
        best = found


def assign_levels(distant: list[tuple[str, int, int]]) -> list[tuple[str, int, int, int]]:
    """Give every crossing resistor a level, short ones lowest, so that none overlaps another."""
    out: list[tuple[str, int, int, int]] = []
    for name, i, j in sorted(distant, key=lambda link: link[2] - link[1]):
        taken = {level for _, a, b, level in out if i < b and a < j}
        out.append((name, i, j, next(t for t in range(len(distant)) if t not in taken)))
    return out


def _draw_end_of_rail(canvas: Canvas, rail: Rail, resistor: str, boundary: str, side: int) -> None:
    column = rail.columns[0 if side < 0 else -1]
    end = column.x + side * rail.reach(column)
    canvas.resistor(column.x, column.x + side * (column.half_bus + 0.5 * 130.0), end, 0.0, resistor)
    canvas.boundary(end, 0.0)
    canvas.text(end, 26.0, boundary, "middle")


def _draw_riser(canvas: Canvas, column: _Column, resistor: str, to: float) -> float:
    """Draw the wire from a node up to its resistor; return its abscissa."""
    x = column.x + column.pitch * (column.ports.index(resistor) - 0.5 * (len(column.ports) - 1))
    points = [(column.x, 0.0), (column.x, -26.0), (x, -26.0), (x, to)]
    canvas.wire(points if x != column.x else [points[0], points[-1]])
    if len(column.ports) > 2:
        canvas.dot(column.x, -26.0)
    return x


def _draw_rising_resistor(canvas: Canvas, column: _Column, resistor: str, boundary: str) -> None:
    middle = -0.5 * _RISE - 10.0
    x = _draw_riser(canvas, column, resistor, middle + ZIGZAG / 2)
    canvas.zigzag(x, middle, upright=True)
    canvas.wire([(x, middle - ZIGZAG / 2), (x, -_RISE)])
    canvas.text(x + 12.0, middle + 5.0, resistor, "start")
    canvas.boundary(x, -_RISE)
    canvas.text(x, -_RISE - 13.0, boundary, "middle")


def _draw_crossing_resistor(canvas: Canvas, rail: Rail, resistor: str, i: int, j: int, level: int) -> None:
    y = -rail.first_level - _LEVEL * level
    a, b = _draw_riser(canvas, rail.columns[i], resistor, y), _draw_riser(canvas, rail.columns[j], resistor, y)
    gap = (i + j) // 2  # between two nodes, where no wire rises
    one, two = rail.columns[gap], rail.columns[gap + 1]
    canvas.resistor(a, 0.5 * (one.x + one.half_bus + two.x - two.half_bus), b, y, resistor)


def _draw_node(canvas: Canvas, network: Declaration, column: _Column) -> None:
    """Draw the capacitor, the heat sources and the node itself."""
    x = column.x
    canvas.wire([(x, 0.0), (x, 40.0)])
    canvas.wire([(x - 14, 40.0), (x + 14, 40.0)], width=2.4)
    canvas.wire([(x - 14, 47.0), (x + 14, 47.0)], width=2.4)
    canvas.wire([(x, 47.0), (x, 64.0)])
    for k, half in enumerate((11, 7, 3)):
        canvas.wire([(x - half, 64.0 + 4 * k), (x + half, 64.0 + 4 * k)])
    canvas.text(x + 20.0, 49.0, network.capacitances[column.node], "start")
    canvas.text(x + 12.0, 19.0, f"T_{column.node}", "start")
    if column.sources:
        unmeasured = len(column.sources) - 1 if column.node in network.disturbed_nodes else None  # it is the last
        canvas.arrow([(x - 30.0, 82.0), (x - 30.0, 30.0), (x - 6.5, 6.5)])
        for k, source in enumerate(column.sources):
            canvas.text(x, 98.0 + 18.0 * k, source, "middle", QUIET if k == unmeasured else HEAT)
    canvas.node(x, 0.0, column.node in network.measured_nodes)
