"""Declared networks: the catalogue, several zones, staged equipment, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from skhybrid import OutputDisturbanceID
from skhybrid.thermal import RCNetwork, get_network, list_networks
from skhybrid.thermal.catalogue import CATALOGUE

OFFICE = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0}
PAPER_ROLES = ("T_oa", "q_sol", "u_heat", "u_cool")
LONE = {"za": "C_za"}, {"R_zo": ("za", "T_oa")}
WALLED = {"za": "C_za", "w": "C_w"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}


# ------------------------------------------------------------------------------------------------------ own networks
def test_own_network():
    attic = RCNetwork(
        "attic",
        {"za": "C_za", "attic": "C_attic"},
        {"R_za": ("za", "attic"), "R_roof": ("attic", "T_oa"), "R_ground": ("za", "T_ground")},
        {"attic": None},
        bounds={"C_attic": (0.5, 2.0)},
    )
    assert attic.required_roles == ("T_oa", "T_ground", "q_sol")
    assert attic.parameter_table().loc["C_attic", ["lower", "upper"]].tolist() == [0.5, 2.0]
    theta = {"C_za": 2.0, "C_attic": 1.0, "R_za": 4.0, "R_roof": 1.0, "R_ground": 2.0, "A_win": 3.0}
    c = attic.matrices(theta, ("T_oa", "T_ground", "q_sol"))
    np.testing.assert_allclose(c.A, [[-(0.25 + 0.5) / 2, 0.125], [0.25, -1.25]], rtol=1e-14)
    np.testing.assert_allclose(c.B, [[0, 0.25, 0, 0.5], [1, 0, 3, 0]], rtol=1e-14)
    assert "(T_ground - T_za)/R_ground" in str(attic)


def test_catalogue_by_name():
    assert list(CATALOGUE)[:5] == ["1R1C", "2R2C", "3R2C", "3R3C", "4R3C"]
    for name, network in CATALOGUE.items():
        assert get_network(name) is network
        assert get_network(network) is network
        if re.fullmatch(r"\dR\dC", name):
            assert (len(network.resistors), len(network.nodes)) == (int(name[0]), int(name[2]))
        else:  # Ti, Te ...: a letter a node; Ria, Ae: what the family names besides
            assert len(network.nodes) == len(re.findall("T[iemhs]", name))
            assert ("R_zo" in network.resistors) == ("Ria" in name or "Te" not in name)
            assert ("f" in network.fractions) == ("Ae" in name)
            assert network.heated == ("h" if "Th" in name else "za")
            assert network.measured == ("s" if "Ts" in name else "za")
    with pytest.raises(ValueError, match="'5R5C' is not in the catalogue: 1R1C, 2R2C"):
        get_network("5R5C")


def test_list_of_networks():
    table = list_networks()
    assert list(table.index) == list(CATALOGUE)
    assert table.loc["2R2C", ["states", "n_resistors", "n_parameters"]].tolist() == [("T_w", "T_za"), 2, 8]
    assert table["reference"].str.len().min() > 20
    assert table["description"].is_unique


def test_the_family_of_bacher_and_madsen():
    """TiTeThRia by the equations of their paper, in its own letters."""
    Ci, Ce, Ch, Rie, Rea, Rih, Ria, Aw, Ph = 0.9, 3.3, 0.5, 0.9, 4.4, 0.15, 11.0, 5.6, 2.0
    theta = {"C_za": Ci, "C_e": Ce, "C_h": Ch, "R_ze": Rie, "R_eo": Rea, "R_zh": Rih, "R_zo": Ria, "A_win": Aw}
    c = CATALOGUE["TiTeThRia"].matrices({**theta, "Q_h": Ph}, ("T_oa", "q_sol", "u_heat"))
    Te, Th, Ti = 15.0, 40.0, 21.0
    Ta, Ps, u = 3.0, 0.4, 0.7
    dTi = (Te - Ti) / (Rie * Ci) + (Th - Ti) / (Rih * Ci) + (Ta - Ti) / (Ria * Ci) + Aw * Ps / Ci
    dTe = (Ti - Te) / (Rie * Ce) + (Ta - Te) / (Rea * Ce)
    dTh = (Ti - Th) / (Rih * Ch) + Ph * u / Ch
    assert CATALOGUE["TiTeThRia"].states == ("T_e", "T_h", "T_za")
    np.testing.assert_allclose(c.A @ [Te, Th, Ti] + c.B @ [Ta, Ps, u, 0.0], [dTe, dTh, dTi], rtol=1e-13)


# ------------------------------------------------------------------------------------------------------ several zones
ROOMS = ("north", "south")


def two_zones(**changed):
    declared = {
        "name": "two zones",
        "capacitances": {"w": "C_w", "north": "C_n", "south": "C_s"},
        "resistors": {
            "R_nw": ("north", "w"),
            "R_sw": ("south", "w"),
            "R_no": ("north", "T_oa"),
            "R_so": ("south", "T_oa"),
        },
        "solar": {"q_sol_north": {"north": "f_n", "w": None}, "q_sol_south": "south"},
        "measured": ROOMS,
        "disturbed": ROOMS,
        "heated": {"u_heat_north": "north", "u_cool": {"north": "f_c", "south": None}, "Q_south": "south"},
    }
    return RCNetwork(**{**declared, **changed})


TRUTH = {
    "C_w": 6.0,
    "C_n": 0.8,
    "C_s": 1.2,
    "R_nw": 1.5,
    "R_sw": 1.1,
    "R_no": 8.0,
    "R_so": 6.0,
    "f_n": 0.4,
    "f_c": 0.3,
    "A_win_north": 2.0,
    "A_win_south": 4.0,
    "Q_h_north": 5.0,
    "Q_c": -7.0,
}


def by_hand(t):
    """A and B of the two zones; inputs T_oa, q_sol_north, q_sol_south, u_heat_north, u_cool, Q_south, two gains."""
    C = np.array([t["C_w"], t["C_n"], t["C_s"]])
    nw, sw, no, so = (1.0 / t[name] for name in ("R_nw", "R_sw", "R_no", "R_so"))
    A = np.array([[-nw - sw, nw, sw], [nw, -nw - no, 0.0], [sw, 0.0, -sw - so]]) / C[:, None]
    wall = [0.0, (1 - t["f_n"]) * t["A_win_north"], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    north = [no, t["f_n"] * t["A_win_north"], 0.0, t["Q_h_north"], t["f_c"] * t["Q_c"], 0.0, 1.0, 0.0]
    south = [so, 0.0, t["A_win_south"], 0.0, (1 - t["f_c"]) * t["Q_c"], 1.0, 0.0, 1.0]
    return A, np.array([wall, north, south]) / C[:, None]


def test_two_zones_against_the_matrix_exponential():
    network = two_zones()
    roles = network.usual_roles
    assert network.inputs(roles) == ("T_oa", "q_sol_north", "q_sol_south", "u_heat_north", "u_cool", "Q_south")
    assert network.gain_names == ("heat_gain_north", "heat_gain_south")
    assert {p.name for p in network.parameters()} == set(TRUTH)
    A, B = by_hand(TRUTH)
    c = network.matrices(TRUTH, roles)
    np.testing.assert_allclose(c.A, A, rtol=1e-14)
    np.testing.assert_allclose(c.B, B, rtol=1e-14)
    hours, n, m = 0.25, *B.shape
    block = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * hours)
    d = network.discrete(TRUTH, roles, hours)
    rng = np.random.default_rng(3)
    v = np.column_stack([rng.normal(5, 4, 200), rng.uniform(0, 0.5, (200, 2)), rng.uniform(size=(200, 5))])
    x = z = np.array([18.0, 21.0, 20.0])
    measured = [network.nodes.index(node) for node in network.measured_nodes]
    for k in range(200):
        x = d.A @ x + d.B @ v[k]
        z = block[:n, :n] @ z + block[:n, n:] @ v[k]
        np.testing.assert_allclose(x[measured], z[[1, 2]], rtol=1e-10)


def test_derivatives_of_two_zones_are_exact():
    network, roles = two_zones(), two_zones().usual_roles
    c = network.matrices(TRUTH, roles)
    for q, p in enumerate(network.parameters(roles)):
        h = 1e-4 * abs(TRUTH[p.name])
        above, below = (by_hand({**TRUTH, p.name: TRUTH[p.name] + sign * h}) for sign in (1, -1))
        np.testing.assert_allclose(c.dA[q], (above[0] - below[0]) / (2 * h), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(c.dB[q], (above[1] - below[1]) / (2 * h), rtol=1e-6, atol=1e-9)


def test_names_tell_the_zone():
    network = two_zones(solar=ROOMS, heated=ROOMS)
    assert network.measured == ROOMS
    assert network.measured_nodes == network.disturbed_nodes == ROOMS
    assert network.history_roles == ("T_north", "T_south")
    assert network.required_roles == ("T_oa", "q_sol_north", "q_sol_south")
    sources = {s.role: (s.parameter, s.shares) for s in network.sources(["q_sol_south", "u_heat_north_2", "Q_south"])}
    assert sources == {
        "q_sol_south": ("A_win_south", (("south", None),)),
        "u_heat_north_2": ("Q_h_north_2", (("north", None),)),
        "Q_south": (None, (("south", None),)),
    }
    assert not network.reads("q_sol")  # irradiance that no window sees
    with pytest.raises(ValueError, match="network two zones does not say which node 'u_heat' heats; name it"):
        network.inputs(["u_heat"])


def test_a_node_whose_name_contains_another():
    """Neither the window nor the heater of the longer name is lost, or given to the shorter one."""
    rooms = ("hall", "hall_2", "sol")
    network = RCNetwork(
        "nested",
        {room: f"C_{room}" for room in rooms},
        {f"R_{room}": (room, "T_oa") for room in rooms},
        solar=rooms,
        measured=rooms,
        disturbed=rooms,
        heated=rooms,
    )
    for kind in ("q_sol", "u_heat", "Q"):
        roles = [f"{kind}_{room}" for room in rooms]
        assert {s.role: s.shares for s in network.sources(roles)} == {
            role: ((room, None),) for role, room in zip(roles, rooms, strict=True)
        }


def test_a_network_keeps_what_was_declared():
    capacitances, solar, bounds = {"za": "C_za"}, {"q_sol": {"za": None}}, {"C_za": (1.0, 2.0)}
    network = RCNetwork("kept", capacitances, {"R_zo": ("za", "T_oa")}, solar, bounds=bounds)
    before = network.equations(), network.parameters()
    capacitances["w"] = "C_w"
    solar["q_sol"]["w"] = "f"
    bounds["C_za"] = (-1.0, 2.0)
    assert (network.equations(), network.parameters()) == before


@pytest.mark.parametrize("dt", [0.0, -0.25, np.nan, pd.Timedelta("15min")])
def test_a_step_that_is_no_number_of_hours_is_refused(dt):
    with pytest.raises(ValueError, match=r"dt=.* is outside"):
        RCNetwork("lone", *LONE).discrete({"C_za": 2.0, "R_zo": 3.0}, ["T_oa"], dt)


def test_a_missing_value_is_named():
    with pytest.raises(ValueError, match="theta has no value for R_zo"):
        RCNetwork("lone", *LONE).matrices({"C_za": 1.0}, ["T_oa"])


@pytest.mark.filterwarnings("error")
def test_numbers_of_32_bits_are_numbers():
    theta = {"C_za": np.float32(2.0), "R_zo": np.float32(4.0)}
    np.testing.assert_array_equal(RCNetwork("lone", *LONE).matrices(theta, ["T_oa"]).A, [[-0.125]])
    with pytest.raises(ValueError, match=r"theta gives R_zo the value .*inf"):
        RCNetwork("lone", *LONE).matrices(theta | {"R_zo": np.float32(np.inf)}, ["T_oa"])


@pytest.mark.parametrize(("value", "above"), [(0.0, " above 0"), (-1.0, ""), (None, ""), (np.nan, ""), ("5", "")])
def test_an_impossible_value_is_named(value, above):
    """Matrices of NaN or inf came of it."""
    for name in ("C_za", "R_zo"):
        with pytest.raises(ValueError, match=f"theta gives {name} the value {value!r}; it must be a number{above}"):
            RCNetwork("lone", *LONE).matrices({"C_za": 1.0, "R_zo": 3.0, name: value}, ["T_oa"])


def test_one_node_is_named_by_a_name_or_a_tuple():
    one = RCNetwork("one", *LONE, measured=("za",), disturbed=["za"], heated=("za",), solar=("za",))
    assert (one.measured, one.disturbed, one.heated, one.solar) == ("za", "za", "za", "za")
    assert one.measured_nodes == one.disturbed_nodes == ("za",)
    assert one.gain_names == ("heat_gain",)
    assert one.history_roles == ("T_za",)
    alike = RCNetwork("one", *LONE, {"za": None})
    theta = {"C_za": 2.0, "R_zo": 3.0, "A_win": 4.0, "Q_h": 5.0, "Q_c": -6.0}
    for here, there in zip(one.matrices(theta, PAPER_ROLES), alike.matrices(theta, PAPER_ROLES), strict=True):
        np.testing.assert_array_equal(here, there)


def test_a_radiator_heats_air_and_wall():
    network = RCNetwork(
        "radiator",
        {"w": "C_w", "za": "C_za"},
        {"R_zw": ("za", "w"), "R_wo": ("w", "T_oa")},
        heated={"w": "f_r", "za": None},
    )
    assert [p.name for p in network.parameters(("T_oa", "u_heat"))] == ["C_w", "C_za", "R_zw", "R_wo", "f_r", "Q_h"]
    assert "f_r" not in [p.name for p in network.parameters(("T_oa",))]
    theta = {"C_w": 4.0, "C_za": 2.0, "R_zw": 1.0, "R_wo": 1.0, "f_r": 0.25, "Q_h": 8.0}
    c = network.matrices(theta, ("T_oa", "u_heat", "Q_hvac"))
    np.testing.assert_allclose(c.B[:, 1:], [[0.5, 0.25 / 4, 0.0], [3.0, 0.75 / 2, 0.5]], rtol=1e-14)


def test_two_stages_are_told_apart():
    """A fit on simulated data finds the capacity of either stage."""
    roles, hours, n = ("T_oa", "q_sol", "u_heat_1", "u_heat_2"), 0.25, 4 * 96
    truth = OFFICE | {"Q_h_1": 3.0, "Q_h_2": 5.0}
    rng = np.random.default_rng(0)
    stages = np.repeat(rng.integers(0, 3, n // 4), 4)  # off, low, high
    t = np.arange(n) * hours
    v = np.column_stack(
        [
            6 + 4 * np.sin(t / 24 * 2 * np.pi - 2),
            0.3 * np.maximum(np.sin(t / 24 * 2 * np.pi - 1.6), 0),
            stages > 0,
            stages > 1,
        ]
    ).astype(float)
    d = get_network("2R2C").discrete(truth, roles, hours)
    x, y = np.full(2, 20.0), np.empty(n)
    for k in range(n):
        y[k] = x[1] + 0.02 * rng.normal()
        x = d.A @ x + d.B[:, :4] @ v[k]
    X = pd.DataFrame(v, columns=roles, index=pd.date_range("2026-01-05", periods=n, freq="15min"))
    known = {k: v for k, v in truth.items() if k not in ("Q_h_1", "Q_h_2", "R_zo")}
    model = OutputDisturbanceID("2R2C", known=known, n_starts=2, random_state=0).fit(X, y)
    assert model.theta_["Q_h_1"] == pytest.approx(3.0, rel=0.03)
    assert model.theta_["Q_h_2"] == pytest.approx(5.0, rel=0.03)


# ------------------------------------------------------------------------------------------------------ what is refused


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        (({"za": "C_za", "m": "C_m"}, {"R_zo": ("za", "T_oa")}), "node 'm' is connected to no boundary"),
        (
            ({"za": "C_za", "m": "C_m", "n": "C_n"}, {"R_zo": ("za", "T_oa"), "R_mn": ("m", "n")}),
            "node 'm' is connected to no boundary",
        ),
        (({"za": "C", "w": "C"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}), "parameter 'C' is used twice"),
        (({"za": "R_zo"}, {"R_zo": ("za", "T_oa")}), "parameter 'R_zo' is used twice"),
        (({"za": "C_za"}, {"R_zo": ("za", "T_oa"), "R_zw": ("za", "w")}), "R_zw ends at 'w', which has no capacitance"),
        (({"za": "C_za"}, {"R_zo": ("za", "T_oa"), "R_zz": ("za", "za")}), "R_zz connects 'za' and 'za'"),
        (({"za": "C_za"}, {"R_zo": ("za", "T_oa"), "R_og": ("T_oa", "T_g")}), "R_og connects 'T_oa' and 'T_g'"),
        ((*LONE, {"w": None}), "the solar node 'w' has no capacitance; heat can only go"),
        ((*LONE, {"za": "f"}), "exactly one of them must have None"),
        (
            ({"za": "C_za", "w": "C_w"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}, {"za": None, "w": None}),
            "solar shares its heat among 'za', 'w'; exactly one",
        ),
        ((*LONE, {}, "attic"), "measured node 'attic' has no capacitance"),
        ((*LONE, {}, ("za", "attic")), "measured node 'attic' has no capacitance"),
        ((*LONE, {}, ("za", "za")), "measured node 'za' is named twice"),
        ((*LONE, {}, ()), "no node is measured"),
        ((*LONE, {}, "za", "attic"), "disturbed node 'attic' has no capacitance"),
        ((*LONE, {}, "za", "za", "attic"), "heated node 'attic' has no capacitance"),
        ((*LONE, {}, "za", "za", {"u_heat": "attic"}), "heated node 'attic' has no capacitance"),
        ((*LONE, {}, "za", "za", {"u_heat": "za", "T_oa": "za"}), "heated mixes 'T_oa' with roles"),
        (
            (*LONE, {}, "za", "za", {"za": "f_r"}),
            "heated shares its heat among 'za'; exactly one of them must have None",
        ),
        ((*LONE, {}, "za", "za", {}), "heated names no node"),
        ((*LONE, {"q_sol": "za", "za": None}), "solar mixes 'za' with roles"),
        ((*LONE, {"q_sol": None}), "solar gives 'q_sol' to None"),
        ((*WALLED, {"za": "f", "w": None}, "za", "za", {"za": "f", "w": None}), "parameter 'f' is used twice"),
        (
            (*WALLED, {"q_sol": {"za": "f", "w": None}, "q_sol_s": {"w": "f", "za": None}}),
            "parameter 'f' is used twice",
        ),
        (({}, {}), "it has no node"),
        ((["za"], {}), r"capacitances=\['za'\] must be a mapping of nodes to parameters"),
        (({"za": "C_za"}, [("za", "T_oa")]), "resistors=.* must be a mapping of parameters to two ends"),
        ((*LONE, {}, "za", "za", "za", 5.0), "bounds=5.0 must be a mapping"),
        ((*LONE, {}, None), "measured=None must be the name of a node, or several"),
        ((*LONE, {}, [5]), "measured node 5 has no capacitance"),
        ((*LONE, {}, [["za"]]), r"measured node \['za'\] has no capacitance"),
        ((*LONE, [5]), "solar names the node 5; give the name of one"),
        ((*LONE, {"za": 0.5}), "solar gives 'za' the share 0.5; give the name of a parameter"),
        ((*LONE, {}, "za", "za", {"u_heat": {"za": []}}), r"heated gives 'za' the share \[\]; give the name"),
        ((*LONE, {}, "za", "za", {"u_heat": "za", 5: "za"}), "heated mixes 5 with roles"),
        ((*LONE, 3), "solar=3 must be the name of a node, or several"),
        (({"T_za": "C_za"}, {"R_zo": ("T_za", "T_oa")}), "'T_za' cannot name a node"),
        (({"zone 1": "C_za"}, {"R_zo": ("zone 1", "T_oa")}), "'zone 1' cannot name a node"),
        (({"za": "Q_h"}, {"R_zo": ("za", "T_oa")}), "'Q_h' cannot name this parameter"),
        (({"za": ("C_za",)}, {"R_zo": ("za", "T_oa")}), "is not a name of a parameter"),
        (({"za": "C_za"}, {"R_zo": ("za", "T_oa", "T_ground")}), "R_zo needs two ends"),
        (({"za": "C_za"}, {"R_zo": ("za", 5)}), "R_zo needs two ends"),
        (({"za": "C_za"}, {"R_zo": 5}), "R_zo needs two ends"),
        (({"za": "C_za", 1: "C_1"}, {"R_zo": ("za", "T_oa")}), "1 cannot name a node"),
        ((*LONE, {}, "za", "za", "za", {1: (1.0, 2.0)}), "bounds names 1, which is not one of its parameters"),
        ((*LONE, {}, "za", "za", "za", {"C_za": 5.0}), "bounds of C_za are 5.0; give two finite numbers"),
        ((*LONE, {}, "za", "za", "za", {"C_za": (1.0, 2.0, 3.0)}), r"bounds of C_za are .*; give two finite numbers"),
        (
            ({"za": "C_za", "w": "C_w"}, {"R_zw": ("za", "T_w"), "R_wo": ("w", "T_oa")}),
            "R_zw ends at 'T_w', the temperature",
        ),
        (
            ({"room": "C"}, {"R": ("room", "T_za")}, {}, "room", "room", "room"),
            "R ends at 'T_za', the role of the measured temperature",
        ),
        (
            ({"za": "C_za", "m": "C_m"}, {"R_zo": ("za", "T_oa"), "R_mo": ("m", "T_oa")}),
            "no measured node is connected to 'm'",
        ),
        (
            (*LONE, {}, "za", "za", "za", {"R_zw": (1.0, 2.0)}),
            "bounds names 'R_zw', which is not one of its parameters",
        ),
        ((*LONE, {}, "za", "za", "za", {"R_zo": (0.0, 2.0)}), r"bounds of R_zo are \(0, 2\); both must be > 0"),
        ((*LONE, {}, "za", "za", "za", {"A_win": (-1.0, 2.0)}), "bounds of A_win are .* must be > 0"),
        ((*LONE, {}, "za", "za", "za", {"Q_h": (-1.0, 2.0)}), "bounds of Q_h are .* must be > 0"),
        (
            (*LONE, {}, "za", "za", "za", {"C_za": (2.0, 2.0)}),
            "bounds of C_za are .* must be less than the upper",
        ),
        (
            (*LONE, {}, "za", "za", "za", {"C_za": (2.0, 1.0)}),
            "bounds of C_za are .* must be less than the upper",
        ),
        ((*LONE, {}, "za", "za", "za", {"Q_c": (1.0, 2.0)}), r"bounds of Q_c are \(1, 2\); both must be < 0"),
        ((*WALLED, {"za": "f", "w": None}, "za", "za", "za", {"f": (0.1, 1.5)}), "bounds of f are .* at most 1"),
        ((*LONE, {}, "za", "za", "za", {}, "", "", {"hall": "za"}), "the zone 'hall' is 'za'; give a tuple"),
        (
            (*LONE, {}, "za", "za", "za", {}, "", "", {"hall": ("za", "wall")}),
            "zones names the node 'wall', which has no capacitance",
        ),
    ],
)
def test_unclear_networks_are_refused(declared, message):
    with pytest.raises(ValueError, match=f"network odd: .*{message}"):
        RCNetwork("odd", *declared)
