"""Display of networks: the equations match the matrices; the drawing labels everything once, without overlaps."""

from __future__ import annotations

import ast
import re
from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from skhybrid.thermal import RCNetwork, building_network, draw
from skhybrid.thermal.catalogue import CATALOGUE

ROOMS = ("north", "south")
FLAT = RCNetwork(
    "flat",
    {"w_north": "C_w", "north": "C_n", "south": "C_s"},
    {"R_nw": ("north", "w_north"), "R_ns": ("north", "south"), "R_no": ("north", "T_oa"), "R_so": ("south", "T_oa")},
    {"q_sol_north": {"north": "f_n", "w_north": None}, "q_sol_south": "south"},
    measured=ROOMS,
    disturbed=ROOMS,
    heated=ROOMS,
)
#: parallel resistors, three boundaries at one node, chords, two shares
MESH = RCNetwork(
    "mesh <1>",
    {"a": "C_a", "b": "C_b", "za": "C_za", "d": "C_d", "e": "C_e"},
    {
        "R_1": ("a", "b"),
        "R_2": ("b", "za"),
        "R_3": ("za", "d"),
        "R_4": ("d", "e"),
        "R_5": ("e", "a"),
        "R_6": ("za", "T_oa"),
        "R_7": ("za", "T_ground"),
        "R_8": ("a", "d"),
        "R_9": ("za", "T_oa"),
        "R_10": ("za", "e"),
        "R_11": ("a", "T_oa"),
        "R_12": ("a", "b"),
    },
    {"za": "f_1", "b": "f_2", "e": None},
)
CHAIN = RCNetwork(
    "chain",
    {"za": "C_za", **{f"m{i}": f"C_{i}" for i in range(8)}},
    {**{f"R_{i}": (f"m{i}", f"m{i + 1}") for i in range(7)}, "R_z": ("za", "m3"), "R_o": ("m7", "T_oa")},
)
#: a core that touches four rooms, which touch in a ring
RING = ("south", "east", "north", "west")
OFFICE = building_network(
    ("core", *RING),
    [*(("core", room) for room in RING), *zip(RING, RING[1:] + RING[:1], strict=True)],
    heated={"core": ()},
    name="office",
)
SIX = building_network(list("abcdef"), list(combinations("abcdef", 2))[:9], room="4R3C", solar="q_sol", name="six")
ALL = [*CATALOGUE.values(), FLAT, MESH, CHAIN, OFFICE, SIX]
SVG = "{http://www.w3.org/2000/svg}"


def values(network, seed=0):
    rng = np.random.default_rng(seed)
    theta = {}
    for p in network.parameters():
        low, high = p.free_bounds
        theta[p.name] = p.from_free(low + (high - low) * rng.uniform(0.5, 0.9))
    return theta


# -------------------------------------------------------------------------------------------------------- equations
def test_equations_are_those_of_the_paper():
    assert CATALOGUE["2R2C"].equations() == (
        "C_w dT_w/dt = (T_za - T_w)/R_zw + (1 - f) A_win q_sol\n"
        "C_za dT_za/dt = (T_w - T_za)/R_zw + (T_oa - T_za)/R_zo + f A_win q_sol + Q_h u_heat + Q_c u_cool + Q_g"
    )
    assert CATALOGUE["1R1C"].equations(("T_oa", "Q_hvac")) == "C_za dT_za/dt = (T_oa - T_za)/R_zo + Q_hvac + Q_g"
    assert CATALOGUE["1R1C"].equations(("T_oa", "q_sol_east", "u_heat_2"), latex=True) == (
        r"C_{\mathrm{za}} \frac{dT_{\mathrm{za}}}{dt} &= \frac{T_{\mathrm{oa}} - T_{\mathrm{za}}}{R_{\mathrm{zo}}} + "
        r"A_{\mathrm{win,east}} q_{\mathrm{sol,east}} + Q_{\mathrm{h,2}} u_{\mathrm{heat,2}} + Q_{\mathrm{g}}"
    )


@pytest.mark.parametrize("network", ALL, ids=lambda n: n.name)
def test_equations_match_the_matrices(network):
    """Read as a formula, every printed heat balance gives the slope that A and B give."""
    theta, rng = values(network), np.random.default_rng(1)
    inputs = dict.fromkeys(network.inputs(network.usual_roles), 0.0)
    inputs = {role: rng.normal() for role in inputs}
    gains = rng.normal(size=len(network.gain_names))
    x = rng.normal(20, 3, len(network.nodes))
    c = network.matrices(theta, network.usual_roles)
    slope = c.A @ x + c.B @ [*inputs.values(), *gains]
    named = {"Q_g": gains[0]} | {f"Q_g_{name}": g for name, g in zip(network.disturbed_names, gains, strict=True)}
    scope = {**theta, **inputs, **dict(zip(network.states, x, strict=True)), **named}
    lines = network.equations().split("\n")
    assert len(lines) == len(network.nodes)
    for line, node, expected in zip(lines, network.nodes, slope, strict=True):
        left, right = line.split(" = ")
        capacitance, rate = left.split(" ")
        assert rate == f"dT_{node}/dt"
        formula = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", right)  # factors stand side by side
        assert eval(formula, {}, scope) / theta[capacitance] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("network", [CATALOGUE["4R3C"], FLAT], ids=lambda n: n.name)
def test_latex_equals_the_text(network):
    """Taken back to text, the LaTeX lines are the text lines."""
    plain = network.equations(latex=True).replace(" \\\\\n", "\n")
    plain = re.sub(r"_\{\\mathrm\{([^}]*)\}\}", lambda m: "_" + m[1].replace(",", "_"), plain)
    plain = re.sub(r"\\frac\{([^}]*)\}\{([^}]*)\}", r"(\1)/\2", plain)
    assert re.sub(r"\((dT_\w+)\)/dt &=", r"\1/dt =", plain) == network.equations()


def test_print_shows_equations_and_parameters():
    text = str(CATALOGUE["TiTeTh"])
    for part in ("TiTeTh: 3 resistors, 3 capacitances", "Bacher and Madsen", CATALOGUE["TiTeTh"].equations(), "K/kW"):
        assert part in text


# ---------------------------------------------------------------------------------------------------------- drawing
def labels(network):
    """(label, left, top, right, bottom) of every label, from its anchor and a generous width of its letters."""
    out = []
    for text in ET.fromstring(draw(network)).iter(f"{SVG}text"):
        words = "".join(text.itertext()).replace("\u200b", "")
        below = sum(len(t.text) for t in text.iter(f"{SVG}tspan") if t.get("dy") == "4")
        width = 7.2 * (len(words) - below) + 5.6 * below
        x, y = float(text.get("x")), float(text.get("y"))
        left = {"start": x, "middle": x - width / 2, "end": x - width}[text.get("text-anchor")]
        out.append((text.get("data-name"), left, y - 11.0, left + width, y + 4.0))
    return out


@pytest.mark.parametrize("network", ALL, ids=lambda n: n.name)
def test_drawing_names_everything(network):
    names = [name for name, *_ in labels(network)]
    for resistor, ends in network.resistors.items():
        assert names.count(resistor) == 1
        assert all(end in names for end in ends if end not in network.nodes)
    for capacitance, state in zip(network.capacitances.values(), network.states, strict=True):
        assert names.count(capacitance) == names.count(state) == 1
    shown = " + ".join(name for name in names)
    for node, line in zip(network.nodes, network.equations().split("\n"), strict=True):
        for term in line.split(" = ")[1].split(" + "):
            assert term in shown or "/R_" in term, node
    svg = draw(network)
    assert svg.count('r="9"') == len(network.measured_nodes) + 1  # and one in the legend
    assert network._repr_svg_() == svg
    assert svg in network._repr_html_()


@pytest.mark.parametrize("network", ALL, ids=lambda n: n.name)
def test_no_label_overlaps_another_or_leaves_the_frame(network):
    left, top, width, height = map(float, ET.fromstring(draw(network)).get("viewBox").split())
    found = labels(network)
    for name, *box in found:
        assert left <= box[0], name
        assert top <= box[1], name
        assert box[2] <= left + width, name
        assert box[3] <= top + height, name
    for (one, *a), (two, *b) in combinations(found, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1], (one, two)


@pytest.mark.parametrize("network", ALL, ids=lambda n: n.name)
def test_no_wire_runs_through_a_label(network):
    """Straight pieces of wires against the boxes of the labels."""
    boxes = labels(network)
    for line in ET.fromstring(draw(network)).iter(f"{SVG}polyline"):
        points = [tuple(map(float, pair.split(","))) for pair in line.get("points").split()]
        for (x0, y0), (x1, y1) in pairwise(points):
            for t in np.linspace(0, 1, 41):
                x, y = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
                for name, left, top, right, bottom in boxes:
                    assert not (left < x < right and top < y < bottom), (name, x, y)


# ------------------------------------------------------------------------------------------------------------ imports
#: modules of the folder; each may import only those before it, so there is no cycle and none imports the drawing
MODULES = (
    "parameters", "declaration", "checks", "matrices", "equations", "network", "catalogue", "joined_rooms", "canvas",
    "circuit", "drawing",
)  # fmt: skip
FOLDER = Path(__file__).parents[1] / "skhybrid" / "thermal"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_imports_in_the_folder_go_one_way(path):
    """Imports in functions and under TYPE_CHECKING count too."""
    before = MODULES if path.stem == "__init__" else MODULES[: MODULES.index(path.stem)]
    imports = [
        node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.ImportFrom)
    ]
    assert {node.module for node in imports if node.level == 1} <= set(before)
