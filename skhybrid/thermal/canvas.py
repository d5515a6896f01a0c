"""SVG elements of circuit diagrams: wires, resistors, nodes, frames and labels with subscripts."""

from __future__ import annotations

import re
from html import escape

_INK, _MEASURED, _GROUND, _FONT = "#1f2933", "#0b6bcb", "#f7f9fb", 14
QUIET, HEAT = "#52606d", "#b4540a"  # colours of legends and of heat
ZIGZAG = 48  # length of a resistor [px]
_WORDS = re.compile(r"\w+|\W")  # of a label, each of which has its own subscript, and the characters between them


class Canvas:
    """SVG elements of one drawing."""

    def __init__(self) -> None:
        self.parts: list[str] = []
        self.origin = (0.0, 0.0)  # of what is drawn next

    def wire(self, points: list[tuple[float, float]], width: float = 1.4) -> None:
        self._line(points, f'stroke="{_INK}" stroke-width="{width}"')

    def zigzag(self, x: float, y: float, upright: bool = False) -> None:
        step, height = ZIGZAG / 12, 7.0
        along = [(-ZIGZAG / 2, 0.0), *((step * k, height * (-1) ** (k // 2)) for k in range(-5, 7, 2))]
        along.append((ZIGZAG / 2, 0.0))
        points = [(x + v, y + u) if upright else (x + u, y + v) for u, v in along]
        self._line(points, f'stroke="{_INK}" stroke-width="1.6" stroke-linejoin="round"')

    def resistor(self, start: float, middle: float, end: float, y: float, label: str) -> None:
        """Draw a horizontal resistor with the wires at both sides and its label."""
        half = ZIGZAG / 2 if start < end else -ZIGZAG / 2
        self.wire([(start, y), (middle - half, y)])
        self.zigzag(middle, y)
        self.wire([(middle + half, y), (end, y)])
        self.text(middle, y - 13.0, label, "middle")

    def arrow(self, points: list[tuple[float, float]]) -> None:
        self._line(points, f'stroke="{HEAT}" stroke-width="1.6" marker-end="url(#skhybrid-head)"')

    def frame(self, left: float, top: float, right: float, bottom: float, title: str) -> None:
        """Draw the frame of a room, with its name."""
        x, y = self._place(left, top)
        self.parts.append(
            f'<rect x="{x:g}" y="{y:g}" width="{right - left:g}" height="{bottom - top:g}" rx="10" '
            f'fill="{_GROUND}" stroke="{QUIET}" stroke-width="1.2"/>'
            f'<text x="{x + 12:g}" y="{y + 20:g}" text-anchor="start" font-weight="bold" fill="{QUIET}" '
            f'data-name="{escape(title)}">{escape(title)}</text>'
        )

    def _place(self, x: float, y: float) -> tuple[float, float]:
        return self.origin[0] + x, self.origin[1] + y

    def _line(self, points: list[tuple[float, float]], style: str) -> None:
        path = " ".join("{:g},{:g}".format(*self._place(x, y)) for x, y in points)
        self.parts.append(f'<polyline points="{path}" fill="none" {style}/>')

    def dot(self, x: float, y: float) -> None:
        x, y = self._place(x, y)
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="2.6" fill="{_INK}"/>')

    def node(self, x: float, y: float, measured: bool) -> None:
        x, y = self._place(x, y)
        place = f'<circle cx="{x:g}" cy="{y:g}"'
        if measured:
            self.parts.append(f'{place} r="9" fill="white" stroke="{_MEASURED}" stroke-width="1.8"/>')
        fill, edge = (_MEASURED, _MEASURED) if measured else ("white", _INK)
        self.parts.append(f'{place} r="5.5" fill="{fill}" stroke="{edge}" stroke-width="1.6"/>')

    def boundary(self, x: float, y: float) -> None:
        x, y = self._place(x, y)
        self.parts.append(f'<rect x="{x - 6:g}" y="{y - 6:g}" width="12" height="12" fill="{_INK}"/>')

    def text(self, x: float, y: float, label: str, anchor: str, colour: str = _INK) -> None:
        x, y = self._place(x, y)
        spans = "".join(_tspans(word) for word in _WORDS.findall(label))
        place = f'x="{x:g}" y="{y:g}" text-anchor="{anchor}"'
        self.parts.append(f'<text {place} fill="{colour}" data-name="{escape(label)}">{spans}</text>')

    def legend(self, x: float, y: float) -> None:
        self.node(x + 10, y, True)
        self.text(x + 24, y + 4.5, "measured", "start", QUIET)
        self.node(x + 112, y, False)
        self.text(x + 124, y + 4.5, "not measured", "start", QUIET)
        self.boundary(x + 236, y)
        self.text(x + 248, y + 4.5, "boundary", "start", QUIET)

    def svg(self, title: str, left: float, top: float, right: float, bottom: float) -> str:
        width, height = f"{right - left:g}", f"{bottom - top:g}"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="{left:g} {top:g} {width} {height}" style="max-width:100%;height:auto" '
            f'role="img" font-family="sans-serif" font-size="{_FONT}"><title>{escape(title)}</title>'
            '<defs><marker id="skhybrid-head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
            f'markerHeight="7" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="{HEAT}"/></marker></defs>'
            f'<rect x="{left:g}" y="{top:g}" width="{width}" height="{height}" rx="6" fill="white"/>'
            f"{''.join(self.parts)}</svg>"
        )


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


def width(label: str) -> float:
    """Approximate width of a label [px]."""
    parts = [word.partition("_") for word in _WORDS.findall(label)]
    return sum((0.62 * _FONT * len(head) + 0.46 * _FONT * len(rest) for head, _, rest in parts), 0.0)
