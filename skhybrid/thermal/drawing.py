"""Circuit diagram of a network in SVG.

Nodes stand in a row, the rail.  A resistor between neighbours lies on the rail; one to a boundary continues the rail or
rises from its node; one between nodes that are not neighbours crosses above.  Capacitors and sources hang below.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from itertools import permutations

from .equations import heat_inputs
from .network import RCNetwork, diagram

_INK, _QUIET, _MEASURED, _HEAT, _FONT = "#1f2933", "#52606d", "#0b6bcb", "#b4540a", 14
_PORT = 52  # horizontal distance between wires that rise from one node [px]
_RISE = 110  # height of a boundary above its node [px]
_LEVEL = 42  # vertical distance between resistors that cross above [px]
_ZIGZAG = 48  # length of a resistor [px]


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
        return 0.5 * _PORT * max(len(self.ports) - 1, 0)

    def left(self) -> float:
        """Width needed to the left of the node."""
        return max([42.0, self.half_bus + 20.0, *(0.5 * _width(s) for s in self.sources)])

    def right(self, capacitance: str) -> float:
        """Width needed to its right."""
        label = 12.0 + max([_width(name) for name, _ in self.rising], default=0.0)
        below = max(12.0 + _width(f"T_{self.node}"), 20.0 + _width(capacitance))
        return max([below, self.half_bus + label, *(0.5 * _width(s) for s in self.sources)])


@diagram.register(RCNetwork)
def draw(network: RCNetwork, roles: Iterable[str] | None = None) -> str:
    """Draw a network as a circuit diagram, a self-contained SVG element.

    Parameters
    ----------
    network : RCNetwork
    roles : iterable of str, default :attr:`usual_roles`
    """
    roles = tuple(network.usual_roles if roles is None else roles)
    rail = _Rail(network, roles)
    canvas = _Canvas()
    for resistor, i, j in rail.neighbours:
        a, b = rail.columns[i], rail.columns[j]
        canvas.resistor(a.x, 0.5 * (a.x + a.half_bus + b.x - b.half_bus), b.x, 0.0, resistor)
    for resistor, boundary, side in rail.ends:
        _draw_end_of_rail(canvas, rail, resistor, boundary, side)
    for column in rail.columns:
        for resistor, boundary in column.rising:
            _draw_rising_resistor(canvas, column, resistor, boundary)
    for resistor, i, j, level in rail.crossings:
        _draw_crossing_resistor(canvas, rail, resistor, i, j, level)
    for column in rail.columns:
        _draw_node(canvas, network, column)
    canvas.legend(rail.x_min, rail.y_max + 26.0)
    return canvas.svg(network.name, rail.x_min - 16.0, rail.y_min - 12.0, rail.x_max + 16.0, rail.y_max + 44.0)


class _Rail:
    """Positions of the nodes, and the route of each resistor."""

    def __init__(self, network: RCNetwork, roles: tuple[str, ...]) -> None:
        order = _node_order(network)
        index = {node: i for i, node in enumerate(order)}
        self.columns = [_Column(node, sources=heat_inputs(network, node, roles)) for node in order]
        self.neighbours: list[tuple[str, int, int]] = []
        self.ends: list[tuple[str, str, int]] = []  # (resistor, boundary, -1 left or 1 right)
        distant: list[tuple[str, int, int]] = []
        for name, (one, two) in network.resistors.items():
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
        self.crossings = _assign_levels(distant)
        self._place_columns(network)

    def _free_end(self, i: int, n: int) -> int:
        """Free end of the rail next to node i: -1 left, 1 right, or 0 for none."""
        taken = {side for _, _, side in self.ends}
        if i == 0 and -1 not in taken:
            return -1
        return 1 if i == n - 1 and 1 not in taken else 0

    def _place_columns(self, network: RCNetwork) -> None:
        """Set the abscissa of every node and the extent of the drawing."""
        names = {(i, j): name for name, i, j in self.neighbours}
        x = 0.0
        for i, column in enumerate(self.columns):
            if i:
                before = self.columns[i - 1]
                wire = before.half_bus + column.half_bus + _ZIGZAG + _width(names.get((i - 1, i), "")) + 16.0
                labels = before.right(network.capacitances[before.node]) + column.left() + 12.0
                x += max(120.0, wire, labels)
            column.x = x
        first, last = self.columns[0], self.columns[-1]
        left, right = first.left(), last.right(network.capacitances[last.node])
        for _, _, side in self.ends:
            if side < 0:
                left = max(left, self.reach(first) + 24.0)
            else:
                right = max(right, self.reach(last) + 24.0)
        self.x_min, self.x_max = first.x - left, max(last.x + right, first.x - left + 330.0)
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


def _node_order(network: RCNetwork) -> tuple[str, ...]:
    """Nodes along the rail: connected nodes side by side, those with a boundary at the ends."""
    nodes = network.nodes
    links = [ends for ends in network.resistors.values() if set(ends) <= set(nodes)]
    outside = {node: sum(node in ends for ends in network.resistors.values()) for node in nodes}
    for a, b in links:
        outside[a] -= 1
        outside[b] -= 1

    def cost(order: tuple[str, ...]) -> float:
        index = {node: i for i, node in enumerate(order)}
        crossed = sum(abs(index[a] - index[b]) - 1 for a, b in links)
        rising = sum(outside[node] for node in order[1:-1])
        return 10.0 * crossed + rising - 0.5 * bool(outside[order[0]])

    if len(nodes) <= 7:
        return min(permutations(nodes), key=cost)
    best = nodes
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


def _assign_levels(distant: list[tuple[str, int, int]]) -> list[tuple[str, int, int, int]]:
    """Give every crossing resistor a level, short ones lowest, so that none overlaps another."""
    out: list[tuple[str, int, int, int]] = []
    for name, i, j in sorted(distant, key=lambda link: link[2] - link[1]):
        taken = {level for _, a, b, level in out if i < b and a < j}
        out.append((name, i, j, next(t for t in range(len(distant)) if t not in taken)))
    return out


def _draw_end_of_rail(canvas: _Canvas, rail: _Rail, resistor: str, boundary: str, side: int) -> None:
    column = rail.columns[0 if side < 0 else -1]
    end = column.x + side * rail.reach(column)
    canvas.resistor(column.x, column.x + side * (column.half_bus + 0.5 * 130.0), end, 0.0, resistor)
    canvas.boundary(end, 0.0)
    canvas.text(end, 26.0, boundary, "middle")


def _draw_riser(canvas: _Canvas, column: _Column, resistor: str, to: float) -> float:
    """Draw the wire from a node up to its resistor; return its abscissa."""
    x = column.x + _PORT * (column.ports.index(resistor) - 0.5 * (len(column.ports) - 1))
    points = [(column.x, 0.0), (column.x, -26.0), (x, -26.0), (x, to)]
    canvas.wire(points if x != column.x else [points[0], points[-1]])
    if len(column.ports) > 2:
        canvas.dot(column.x, -26.0)
    return x


def _draw_rising_resistor(canvas: _Canvas, column: _Column, resistor: str, boundary: str) -> None:
    middle = -0.5 * _RISE - 10.0
    x = _draw_riser(canvas, column, resistor, middle + _ZIGZAG / 2)
    canvas.zigzag(x, middle, upright=True)
    canvas.wire([(x, middle - _ZIGZAG / 2), (x, -_RISE)])
    canvas.text(x + 12.0, middle + 5.0, resistor, "start")
    canvas.boundary(x, -_RISE)
    canvas.text(x, -_RISE - 13.0, boundary, "middle")


def _draw_crossing_resistor(canvas: _Canvas, rail: _Rail, resistor: str, i: int, j: int, level: int) -> None:
    y = -rail.first_level - _LEVEL * level
    a, b = _draw_riser(canvas, rail.columns[i], resistor, y), _draw_riser(canvas, rail.columns[j], resistor, y)
    gap = (i + j) // 2  # between two nodes, where no wire rises
    one, two = rail.columns[gap], rail.columns[gap + 1]
    canvas.resistor(a, 0.5 * (one.x + one.half_bus + two.x - two.half_bus), b, y, resistor)


def _draw_node(canvas: _Canvas, network: RCNetwork, column: _Column) -> None:
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
        canvas.arrow([(x - 30.0, 82.0), (x - 30.0, 30.0), (x - 6.5, 6.5)])
        for k, source in enumerate(column.sources):
            canvas.text(x, 98.0 + 18.0 * k, source, "middle", _HEAT if "Q_g" not in source else _QUIET)
    canvas.node(x, 0.0, column.node in network.measured_nodes)


class _Canvas:
    """SVG elements of one drawing."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def wire(self, points: list[tuple[float, float]], width: float = 1.4) -> None:
        self._line(points, f'stroke="{_INK}" stroke-width="{width}"')

    def zigzag(self, x: float, y: float, upright: bool = False) -> None:
        step, height = _ZIGZAG / 12, 7.0
        along = [(-_ZIGZAG / 2, 0.0), *((step * k, height * (-1) ** (k // 2)) for k in range(-5, 7, 2))]
        along.append((_ZIGZAG / 2, 0.0))
        points = [(x + v, y + u) if upright else (x + u, y + v) for u, v in along]
        self._line(points, f'stroke="{_INK}" stroke-width="1.6" stroke-linejoin="round"')

    def resistor(self, start: float, middle: float, end: float, y: float, label: str) -> None:
        """Draw a horizontal resistor with the wires at both sides and its label."""
        half = _ZIGZAG / 2 if start < end else -_ZIGZAG / 2
        self.wire([(start, y), (middle - half, y)])
        self.zigzag(middle, y)
        self.wire([(middle + half, y), (end, y)])
        self.text(middle, y - 13.0, label, "middle")

    def arrow(self, points: list[tuple[float, float]]) -> None:
        self._line(points, f'stroke="{_HEAT}" stroke-width="1.6" marker-end="url(#skhybrid-head)"')

    def _line(self, points: list[tuple[float, float]], style: str) -> None:
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.parts.append(f'<polyline points="{path}" fill="none" {style}/>')

    def dot(self, x: float, y: float) -> None:
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="2.6" fill="{_INK}"/>')

    def node(self, x: float, y: float, measured: bool) -> None:
        place = f'<circle cx="{x:g}" cy="{y:g}"'
        if measured:
            self.parts.append(f'{place} r="9" fill="white" stroke="{_MEASURED}" stroke-width="1.8"/>')
        fill, edge = (_MEASURED, _MEASURED) if measured else ("white", _INK)
        self.parts.append(f'{place} r="5.5" fill="{fill}" stroke="{edge}" stroke-width="1.6"/>')

    def boundary(self, x: float, y: float) -> None:
        self.parts.append(f'<rect x="{x - 6:g}" y="{y - 6:g}" width="12" height="12" fill="{_INK}"/>')

    def text(self, x: float, y: float, label: str, anchor: str, colour: str = _INK) -> None:
        spans = "".join(_tspans(word) for word in _split_words(label))
        place = f'x="{x:g}" y="{y:g}" text-anchor="{anchor}"'
        self.parts.append(f'<text {place} fill="{colour}" data-name="{escape(label)}">{spans}</text>')

    def legend(self, x: float, y: float) -> None:
        self.node(x + 10, y, True)
        self.text(x + 24, y + 4.5, "measured", "start", _QUIET)
        self.node(x + 112, y, False)
        self.text(x + 124, y + 4.5, "not measured", "start", _QUIET)
        self.boundary(x + 236, y)
        self.text(x + 248, y + 4.5, "boundary", "start", _QUIET)

    def svg(self, title: str, left: float, top: float, right: float, bottom: float) -> str:
        width, height = f"{right - left:g}", f"{bottom - top:g}"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="{left:g} {top:g} {width} {height}" style="max-width:100%;height:auto" '
            f'role="img" font-family="sans-serif" font-size="{_FONT}"><title>{escape(title)}</title>'
            '<defs><marker id="skhybrid-head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
            f'markerHeight="7" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="{_HEAT}"/></marker></defs>'
            f'<rect x="{left:g}" y="{top:g}" width="{width}" height="{height}" rx="6" fill="white"/>'
            f"{''.join(self.parts)}</svg>"
        )


def _split_words(label: str) -> list[str]:
    """Split a label into words and the characters between them, so that each word can have its own subscript."""
    return re.findall(r"\w+|\W", label)


def _tspans(word: str) -> str:
    """One word, with everything after the first underscore as its subscript."""
    head, _, rest = word.partition("_")
    if not head or not rest:
        return f'<tspan font-style="italic">{word}</tspan>' if len(word) == 1 and word.isalpha() else escape(word)
    subscript = escape(rest.replace("_", ","))
    return (
        f'<tspan font-style="italic">{escape(head)}</tspan>'
        f'<tspan dy="4" font-size="{0.72 * _FONT:g}">{subscript}</tspan>'
        '<tspan dy="-4">\u200b</tspan>'
    )


def _width(label: str) -> float:
    """Approximate width of a label [px]."""
    parts = [word.partition("_") for word in _split_words(label)]
    return sum((0.62 * _FONT * len(head) + 0.46 * _FONT * len(rest) for head, _, rest in parts), 0.0)
