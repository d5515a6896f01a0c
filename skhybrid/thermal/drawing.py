"""A network as a circuit diagram in SVG.

Nodes stand on a rail.  A resistor between neighbours lies on the rail; one to a boundary ends at the end of the rail or
rises from its node; one between nodes that are no neighbours goes over the others.  Capacitors and sources hang below.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from itertools import permutations
from typing import TYPE_CHECKING

from .equations import heat_terms

if TYPE_CHECKING:
    from .network import RCNetwork

_INK, _QUIET, _MEASURED, _HEAT, _FONT = "#1f2933", "#52606d", "#0b6bcb", "#b4540a", 14
_PORT = 52  # distance of what rises from one node [px]
_RISE = 110  # height of a resistor to a boundary above its node
_TRACK = 42  # distance of resistors that go over the others
_ZIGZAG = 48  # length of a resistor


@dataclass
class _Column:
    """What stands at a node, and the room that it takes."""

    node: str
    up: list[tuple[str, str]] = field(default_factory=list)  # (resistor, boundary)
    to_left: list[str] = field(default_factory=list)  # resistors that leave over the others
    to_right: list[str] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)
    x: float = 0.0

    @property
    def ports(self) -> list[str]:
        return [*self.to_left, *(name for name, _ in self.up), *self.to_right]

    def port(self, resistor: str) -> float:
        """Where a resistor rises, from the node's own place."""
        return _PORT * (self.ports.index(resistor) - 0.5 * (len(self.ports) - 1))

    @property
    def bus(self) -> float:
        return 0.5 * _PORT * max(len(self.ports) - 1, 0)

    def left(self) -> float:
        return max([42.0, self.bus + 20.0, *(0.5 * _width(s) for s in self.sources)])

    def right(self, capacitance: str) -> float:
        label = 12.0 + max([_width(name) for name, _ in self.up], default=0.0)
        below = max(12.0 + _width(f"T_{self.node}"), 20.0 + _width(capacitance))
        return max([below, self.bus + label, *(0.5 * _width(s) for s in self.sources)])


def draw(network: RCNetwork, roles: Iterable[str] | None = None) -> str:
    """The network as an SVG element."""
    roles = tuple(network.usual_roles if roles is None else roles)
    rail = _Rail(network, roles)
    paper = _Paper()
    for resistor, i, j in rail.neighbours:
        _resistor_on_rail(paper, rail, resistor, i, j)
    for resistor, boundary, side in rail.ends:
        _end_of_rail(paper, rail, resistor, boundary, side)
    for column in rail.columns:
        for resistor, boundary in column.up:
            _rising(paper, rail, column, resistor, boundary)
    for resistor, i, j, track in rail.over:
        _over(paper, rail, resistor, i, j, track)
    for column in rail.columns:
        _below(paper, rail, network, column)
    paper.legend(rail.x_min, rail.y_max + 26.0)
    return paper.svg(network.name, rail.x_min - 16.0, rail.y_min - 12.0, rail.x_max + 16.0, rail.y_max + 44.0)


# --------------------------------------------------------------------------------------------------------------- layout
class _Rail:
    """Order and places of the nodes, and which way each resistor goes."""

    def __init__(self, network: RCNetwork, roles: tuple[str, ...]) -> None:
        order = _order(network)
        place = {node: i for i, node in enumerate(order)}
        self.columns = [_Column(node, sources=heat_terms(network, node, roles)) for node in order]
        self.neighbours: list[tuple[str, int, int]] = []
        self.ends: list[tuple[str, str, int]] = []  # (resistor, boundary, -1 left or 1 right)
        long: list[tuple[str, int, int]] = []
        for name, (one, two) in network.resistors.items():
            if one in place and two in place:
                i, j = sorted((place[one], place[two]))
                if j == i + 1 and (i, j) not in [(a, b) for _, a, b in self.neighbours]:
                    self.neighbours.append((name, i, j))
                else:
                    long.append((name, i, j))
                continue
            node, boundary = (one, two) if one in place else (two, one)
            side = self._free_end(place[node], len(order))
            if side:
                self.ends.append((name, boundary, side))
            else:
                self.columns[place[node]].up.append((name, boundary))
        for name, i, j in long:
            self.columns[i].to_right.append(name)
            self.columns[j].to_left.append(name)
        self.over = _tracks(long)
        self._set_places(network)

    def _free_end(self, i: int, n: int) -> int:
        """Which end of the rail a boundary of node i can take: -1, 1, or 0 for none."""
        taken = {side for _, _, side in self.ends}
        if i == 0 and -1 not in taken:
            return -1
        return 1 if i == n - 1 and 1 not in taken else 0

    def _set_places(self, network: RCNetwork) -> None:
        named = {(i, j): name for name, i, j in self.neighbours}
        x = 0.0
        for i, column in enumerate(self.columns):
            if i:
                before = self.columns[i - 1]
                lying = before.bus + column.bus + _ZIGZAG + _width(named.get((i - 1, i), "")) + 16.0
                room = before.right(network.capacitances[before.node]) + column.left() + 12.0
                x += max(120.0, lying, room)
            column.x = x
        first, last = self.columns[0], self.columns[-1]
        left, right = first.left(), last.right(network.capacitances[last.node])
        for _, _, side in self.ends:
            if side < 0:
                left = max(left, self.reach(first) + 24.0)
            else:
                right = max(right, self.reach(last) + 24.0)
        self.x_min, self.x_max = first.x - left, max(last.x + right, first.x - left + 330.0)
        rises = any(column.up for column in self.columns)
        self.first_track = _RISE + 52.0 if rises else 52.0
        tracks = max((track for *_, track in self.over), default=-1) + 1
        top = self.first_track + _TRACK * (tracks - 1) + 30.0 if tracks else 40.0
        self.y_min = -max(top, _RISE + 34.0 if rises else 40.0)
        self.y_max = 92.0 + 18.0 * max(len(column.sources) for column in self.columns) + 10.0

    @staticmethod
    def reach(column: _Column) -> float:
        """How far from an outermost node its boundary stands on the rail."""
        return column.bus + 130.0


def _order(network: RCNetwork) -> tuple[str, ...]:
    """Nodes along the rail: neighbours side by side, those with a boundary at the ends."""
    nodes = network.nodes
    links = [ends for ends in network.resistors.values() if set(ends) <= set(nodes)]
    outside = {node: sum(node in ends for ends in network.resistors.values()) for node in nodes}
    for a, b in links:
        outside[a] -= 1
        outside[b] -= 1

    def cost(order: tuple[str, ...]) -> float:
        place = {node: i for i, node in enumerate(order)}
        over = sum(abs(place[a] - place[b]) - 1 for a, b in links)
        rising = sum(outside[node] for node in order[1:-1])
        return 10.0 * over + rising - 0.5 * bool(outside[order[0]])

    if len(nodes) <= 7:
        return min(permutations(nodes), key=cost)
    best = nodes
    while True:  # exchange two nodes as long as that helps
        swaps = [
            tuple(best[j] if k == i else best[i] if k == j else node for k, node in enumerate(best))
            for i in range(len(best))
            for j in range(i)
        ]
        found = min(swaps, key=cost)
        if cost(found) >= cost(best):
            return best
        best = found


def _tracks(long: list[tuple[str, int, int]]) -> list[tuple[str, int, int, int]]:
    """Heights of the resistors that go over the others, short ones lowest, so that none lies on another."""
    out: list[tuple[str, int, int, int]] = []
    for name, i, j in sorted(long, key=lambda one: one[2] - one[1]):
        taken = {track for _, a, b, track in out if i < b and a < j}
        out.append((name, i, j, next(t for t in range(len(long)) if t not in taken)))
    return out


# ---------------------------------------------------------------------------------------------------------------- parts
def _resistor_on_rail(paper: _Paper, rail: _Rail, resistor: str, i: int, j: int) -> None:
    a, b = rail.columns[i], rail.columns[j]
    middle = 0.5 * (a.x + a.bus + b.x - b.bus)
    paper.wire([(a.x, 0.0), (middle - _ZIGZAG / 2, 0.0)])
    paper.zigzag(middle, 0.0)
    paper.wire([(middle + _ZIGZAG / 2, 0.0), (b.x, 0.0)])
    paper.text(middle, -13.0, resistor, "middle")


def _end_of_rail(paper: _Paper, rail: _Rail, resistor: str, boundary: str, side: int) -> None:
    column = rail.columns[0 if side < 0 else -1]
    end = column.x + side * rail.reach(column)
    middle = column.x + side * (column.bus + 0.5 * 130.0)
    paper.wire([(column.x, 0.0), (middle - side * _ZIGZAG / 2, 0.0)])
    paper.zigzag(middle, 0.0)
    paper.wire([(middle + side * _ZIGZAG / 2, 0.0), (end, 0.0)])
    paper.text(middle, -13.0, resistor, "middle")
    paper.boundary(end, 0.0)
    paper.text(end, 26.0, boundary, "middle")


def _rise(paper: _Paper, column: _Column, resistor: str, to: float) -> float:
    """The wire from a node up to where a resistor leaves."""
    x = column.x + column.port(resistor)
    points = [(column.x, 0.0), (column.x, -26.0), (x, -26.0), (x, to)]
    paper.wire(points if x != column.x else [points[0], points[-1]])
    if len(column.ports) > 2:
        paper.dot(column.x, -26.0)
    return x


def _rising(paper: _Paper, rail: _Rail, column: _Column, resistor: str, boundary: str) -> None:
    middle = -0.5 * _RISE - 10.0
    x = _rise(paper, column, resistor, middle + _ZIGZAG / 2)
    paper.zigzag(x, middle, upright=True)
    paper.wire([(x, middle - _ZIGZAG / 2), (x, -_RISE)])
    paper.text(x + 12.0, middle + 5.0, resistor, "start")
    paper.boundary(x, -_RISE)
    paper.text(x, -_RISE - 13.0, boundary, "middle")


def _over(paper: _Paper, rail: _Rail, resistor: str, i: int, j: int, track: int) -> None:
    y = -rail.first_track - _TRACK * track
    a, b = _rise(paper, rail.columns[i], resistor, y), _rise(paper, rail.columns[j], resistor, y)
    half = (i + j) // 2  # in the gap between two nodes, where nothing rises
    one, two = rail.columns[half], rail.columns[half + 1]
    middle = 0.5 * (one.x + one.bus + two.x - two.bus)
    paper.wire([(a, y), (middle - _ZIGZAG / 2, y)])
    paper.zigzag(middle, y)
    paper.wire([(middle + _ZIGZAG / 2, y), (b, y)])
    paper.text(middle, y - 13.0, resistor, "middle")


def _below(paper: _Paper, rail: _Rail, network: RCNetwork, column: _Column) -> None:
    x = column.x
    paper.wire([(x, 0.0), (x, 40.0)])
    paper.wire([(x - 14, 40.0), (x + 14, 40.0)], width=2.4)
    paper.wire([(x - 14, 47.0), (x + 14, 47.0)], width=2.4)
    paper.wire([(x, 47.0), (x, 64.0)])
    for k, half in enumerate((11, 7, 3)):
        paper.wire([(x - half, 64.0 + 4 * k), (x + half, 64.0 + 4 * k)])
    paper.text(x + 20.0, 49.0, network.capacitances[column.node], "start")
    paper.text(x + 12.0, 19.0, f"T_{column.node}", "start")
    if column.sources:
        paper.arrow([(x - 30.0, 82.0), (x - 30.0, 30.0), (x - 6.5, 6.5)])
        for k, source in enumerate(column.sources):
            paper.text(x, 98.0 + 18.0 * k, source, "middle", _HEAT if "Q_g" not in source else _QUIET)
    paper.node(x, 0.0, column.node in network.measured_nodes)


class _Paper:
    """Collects SVG elements."""

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

    def arrow(self, points: list[tuple[float, float]]) -> None:
        self._line(points, f'stroke="{_HEAT}" stroke-width="1.6" marker-end="url(#skhybrid-head)"')

    def _line(self, points: list[tuple[float, float]], style: str) -> None:
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.parts.append(f'<polyline points="{path}" fill="none" {style}/>')

    def dot(self, x: float, y: float) -> None:
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="2.6" fill="{_INK}"/>')

    def node(self, x: float, y: float, measured: bool) -> None:
        if measured:
            self.parts.append(
                f'<circle cx="{x:g}" cy="{y:g}" r="9" fill="white" stroke="{_MEASURED}" stroke-width="1.8"/>'
            )
        fill = _MEASURED if measured else "white"
        edge = _MEASURED if measured else _INK
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="5.5" fill="{fill}" stroke="{edge}" stroke-width="1.6"/>')

    def boundary(self, x: float, y: float) -> None:
        self.parts.append(f'<rect x="{x - 6:g}" y="{y - 6:g}" width="12" height="12" fill="{_INK}"/>')

    def text(self, x: float, y: float, words: str, anchor: str, colour: str = _INK) -> None:
        spans = "".join(_spans(word) for word in _pieces(words))
        place = f'x="{x:g}" y="{y:g}" text-anchor="{anchor}"'
        self.parts.append(f'<text {place} fill="{colour}" data-name="{escape(words)}">{spans}</text>')

    def legend(self, x: float, y: float) -> None:
        self.node(x + 10, y, True)
        self.text(x + 24, y + 4.5, "measured", "start", _QUIET)
        self.node(x + 112, y, False)
        self.text(x + 124, y + 4.5, "not measured", "start", _QUIET)
        self.boundary(x + 236, y)
        self.text(x + 248, y + 4.5, "boundary", "start", _QUIET)

    def svg(self, title: str, left: float, top: float, right: float, bottom: float) -> str:
        width, height = f"{right - left:g}", f"{bottom - top:g}"
        box = f'x="{left:g}" y="{top:g}" width="{width}" height="{height}"'
        return "".join(
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" ',
                f'viewBox="{left:g} {top:g} {width} {height}" style="max-width:100%;height:auto" ',
                f'role="img" font-family="sans-serif" font-size="{_FONT}"><title>{escape(title)}</title>',
                '<defs><marker id="skhybrid-head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" ',
                f'markerHeight="7" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="{_HEAT}"/></marker></defs>',
                f'<rect {box} rx="6" fill="white"/>',
                *self.parts,
                "</svg>",
            )
        )


# ----------------------------------------------------------------------------------------------------------------- text
def _pieces(words: str) -> list[str]:
    """Words and what stands between them, so that each can have its own subscript."""
    out, word = [], ""
    for letter in words:
        if letter.isalnum() or letter == "_":
            word += letter
            continue
        out += [word, letter]
        word = ""
    return [piece for piece in (*out, word) if piece]


def _spans(word: str) -> str:
    head, _, rest = word.partition("_")
    if not head or not rest:
        return f'<tspan font-style="italic">{word}</tspan>' if len(word) == 1 and word.isalpha() else escape(word)
    below = escape(rest.replace("_", ","))
    return (
        f'<tspan font-style="italic">{escape(head)}</tspan><tspan dy="4" font-size="{0.72 * _FONT:g}">{below}</tspan>'
        '<tspan dy="-4">\u200b</tspan>'
    )


def _width(words: str) -> float:
    """About how wide a label is [px]."""
    total = 0.0
    for piece in _pieces(words):
        head, _, rest = piece.partition("_")
        total += 0.62 * _FONT * len(head) + 0.46 * _FONT * len(rest)
    return total
