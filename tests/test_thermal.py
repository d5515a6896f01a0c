"""Thermal networks: the paper's equations by hand, derivatives by differences, steady states and energy by physics."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm_frechet

from skhybrid.thermal import MatrixBuilder, Parameter, draw, get_network
from skhybrid.thermal.catalogue import CATALOGUE

OFFICE = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}
PAPER_ROLES = ("T_oa", "q_sol", "u_heat", "u_cool")
#: inputs of every kind at once: stages, a facade, measured heat, a stage that may heat or cool
ALL_ROLES = ("T_oa", "q_sol", "q_sol_south", "u_heat_1", "u_heat_2", "u_cool", "u_fan", "Q_hvac", "T_za", "zeta")
NETWORKS = list(CATALOGUE.values())


def drawn(network, roles, seed=0, within=(0.7, 0.9)):
    rng = np.random.default_rng(seed)
    theta = {}
    for p in network.parameters(roles):
        low, high = p.free_bounds
        theta[p.name] = p.from_free(low + (high - low) * rng.uniform(*within))
    return theta


def steady_state(network, theta, inputs):
    """Node temperatures at which heat flows cancel, from Kirchhoff's law alone."""
    nodes = network.nodes
    conductance, heat = np.zeros((len(nodes), len(nodes))), np.zeros(len(nodes))
    for name, ends in network.resistors.items():
        for here, there in (ends, ends[::-1]):
            if here in nodes:
                i = nodes.index(here)
                conductance[i, i] += 1.0 / theta[name]
                if there in nodes:
                    conductance[i, nodes.index(there)] -= 1.0 / theta[name]
                else:
                    heat[i] += inputs[there] / theta[name]
    left = 1.0 - sum(theta[f] for f in network.solar.values() if f)
    for node, fraction in network.solar.items():
        heat[nodes.index(node)] += theta["A_win"] * inputs["q_sol"] * (theta[fraction] if fraction else left)
    heat[nodes.index(network.heated)] += theta["Q_h"] * inputs["u_heat"] + theta["Q_c"] * inputs["u_cool"]
    return np.linalg.solve(conductance, heat)


# --------------------------------------------------------------------------------------------------------- matrices
def test_paper_equation_gray_state():
    """C_w dT_w/dt = (T_za - T_w)/R_zw + (1-f) A q; C_za dT_za/dt = (T_w - T_za)/R_zw + (T_oa - T_za)/R_zo + ..."""
    t = OFFICE
    c = CATALOGUE["2R2C"].matrices(t, PAPER_ROLES)
    A = [
        [-1 / (t["C_w"] * t["R_zw"]), 1 / (t["C_w"] * t["R_zw"])],
        [1 / (t["C_za"] * t["R_zw"]), -(1 / t["R_zw"] + 1 / t["R_zo"]) / t["C_za"]],
    ]
    B = [
        [0, (1 - t["f"]) * t["A_win"] / t["C_w"], 0, 0, 0],
        [1 / (t["C_za"] * t["R_zo"]), t["f"] * t["A_win"] / t["C_za"], t["Q_h"], t["Q_c"], 1 / t["C_za"]],
    ]
    np.testing.assert_allclose(c.A, A, rtol=1e-14)
    np.testing.assert_allclose(c.B, B, rtol=1e-14)
    np.testing.assert_array_equal(c.capacitance, [4.0, 1.0])
    assert CATALOGUE["2R2C"].states == ("T_w", "T_za")


def test_envelope_resistance_connects_the_wall_to_the_outside():
    theta = {**OFFICE, "C_m": 2.0, "R_zm": 0.7, "R_wo": 11.0}
    c = CATALOGUE["4R3C"].matrices(theta, ("T_oa",))
    expected = [
        [-(1 / 1.2 + 1 / 11.0) / 4.0, 0.0, 1 / 1.2 / 4.0],
        [0.0, -1 / 0.7 / 2.0, 1 / 0.7 / 2.0],
        [1 / 1.2, 1 / 0.7, -(1 / 1.2 + 1 / 0.7 + 1 / 9.0)],
    ]
    np.testing.assert_allclose(c.A, expected, rtol=1e-14)
    np.testing.assert_allclose(c.B[:, 0], [1 / 44.0, 0.0, 1 / 9.0], rtol=1e-14)


@pytest.mark.parametrize("roles", [("T_oa",), PAPER_ROLES, ("T_oa", "Q_hvac"), ALL_ROLES], ids=len)
@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_derivatives_are_exact(network, roles):
    theta = drawn(network, roles)
    c = network.matrices(theta, roles)
    assert len(c.dA) == len(c.dB) == len(network.parameters(roles))
    for q, p in enumerate(network.parameters(roles)):
        h = 1e-3 * abs(theta[p.name])
        at = [network.matrices({**theta, p.name: theta[p.name] + k * h}, roles) for k in (-2, -1, 1, 2)]
        for exact, f in ((c.dA[q], [m.A for m in at]), (c.dB[q], [m.B for m in at])):
            difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h)
            np.testing.assert_allclose(exact, difference, rtol=1e-8, atol=1e-9 * np.abs(c.A).max())


@pytest.mark.parametrize("hours", [0.25, 24.0])
@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_derivatives_of_a_step_are_those_of_the_matrix_exponential(network, hours):
    """Frechet derivatives of exp([[A, B], [0, 0]] t), also where one node is a thousand times faster than another."""
    theta = drawn(network, PAPER_ROLES, seed=4, within=(0.05, 0.9))
    c, d = network.matrices(theta, PAPER_ROLES), network.discrete(theta, PAPER_ROLES, hours)
    n, m = c.B.shape
    for q, p in enumerate(network.parameters(PAPER_ROLES)):
        block, slope = np.zeros((2, n + m, n + m))
        block[:n, :n], block[:n, n:], slope[:n, :n], slope[:n, n:] = c.A, c.B, c.dA[q], c.dB[q]
        step, by = expm_frechet(block * hours, slope * hours)
        for found, whole, truth in ((d.dA[q], d.A, by[:n, :n]), (d.dB[q], d.B, by[:n, n:])):
            scale = 1e-11 * max(np.abs(truth).max(), np.abs(whole).max() / abs(theta[p.name]))
            np.testing.assert_allclose(found, truth, rtol=0, atol=scale, err_msg=p.name)
        np.testing.assert_allclose(d.A, step[:n, :n], rtol=0, atol=1e-12)


@pytest.mark.parametrize("roles", [("T_oa",), ALL_ROLES], ids=len)
@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_a_batch_equals_single_vectors(network, roles):
    builder = network.matrix_builder(roles)
    assert builder is network.matrix_builder(tuple(reversed(roles)))
    assert builder.parameters == tuple(p.name for p in network.parameters(roles))
    assert builder.columns == (*network.inputs(roles), "heat_gain")
    each = [{**drawn(network, roles, seed), **({"Q_fan": 0.0} if len(roles) > 1 else {})} for seed in range(4)]
    batch = builder.matrices(np.array([builder.vector(theta) for theta in each]))
    for s, theta in enumerate(each):
        for many, one in zip(batch, network.matrices(theta, roles), strict=True):
            np.testing.assert_allclose(many[s], one, rtol=1e-14, atol=0)


def test_cached_coefficients_are_not_pickled():
    """The pickle of a network, and so its joblib hash, does not depend on which matrices were computed before."""
    network = get_network("2R2C")
    network.matrices(OFFICE, PAPER_ROLES)
    fresh = replace(network)
    assert pickle.dumps(network.__getstate__()) == pickle.dumps(fresh.__getstate__())
    again = pickle.loads(pickle.dumps(network))
    assert again == network
    np.testing.assert_array_equal(again.matrices(OFFICE, PAPER_ROLES).A, network.matrices(OFFICE, PAPER_ROLES).A)


def test_columns_follow_the_inputs():
    network = CATALOGUE["2R2C"]
    names = network.inputs(ALL_ROLES)
    assert names == ("T_oa", "q_sol", "q_sol_south", "u_heat_1", "u_heat_2", "u_cool", "u_fan", "Q_hvac")
    assert names == network.inputs(reversed(ALL_ROLES))
    theta = {**OFFICE, "A_win_south": 2.0, "Q_h_1": 4.0, "Q_h_2": 5.0, "Q_fan": -1.5}
    B = network.matrices(theta, ALL_ROLES).B
    on_zone = dict(zip((*names, "heat_gain"), B[1], strict=True))
    on_wall = dict(zip((*names, "heat_gain"), B[0], strict=True))
    assert on_zone == pytest.approx(
        {
            "T_oa": 1 / 9.0,
            "q_sol": 0.9,
            "q_sol_south": 0.6,
            "u_heat_1": 4.0,
            "u_heat_2": 5.0,
            "u_cool": -6.0,
            "u_fan": -1.5,
            "Q_hvac": 1.0,
            "heat_gain": 1.0,
        }
    )
    assert {r for r, v in on_wall.items() if v} == {"q_sol", "q_sol_south"}
    assert on_wall["q_sol_south"] == pytest.approx(0.7 * 2.0 / 4.0)


# ------------------------------------------------------------------------------------------------------------ physics
@pytest.mark.parametrize("hours", [1 / 12, 1.0])
@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_constant_inputs_lead_to_the_steady_state(network, hours):
    theta = drawn(network, PAPER_ROLES, seed=1)
    inputs = {"T_oa": 3.0, "q_sol": 0.25, "u_heat": 0.5, "u_cool": 0.1}
    d = network.discrete(theta, PAPER_ROLES, hours)
    v = np.array([*(inputs[r] for r in network.inputs(PAPER_ROLES)), 0.0])
    expected = steady_state(network, theta, inputs)
    x = np.full(len(network.nodes), 20.0)
    far = np.linalg.matrix_power(d.A, 10**7)
    np.testing.assert_allclose(far, 0.0, atol=1e-12)  # forgets where it began
    np.testing.assert_allclose(d.A @ expected + d.B @ v, expected, rtol=1e-10)  # stays where heat flows cancel
    for _ in range(3):
        nearer = d.A @ x + d.B @ v
        assert np.linalg.norm((nearer - expected) * np.sqrt([theta[c] for c in network.capacitances.values()])) < (
            np.linalg.norm((x - expected) * np.sqrt([theta[c] for c in network.capacitances.values()]))
        )
        x = nearer


@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_step_keeps_the_energy(network):
    """The heat stored over a step is what came in: sources plus the integral of the flows through the envelope."""
    theta, hours = drawn(network, PAPER_ROLES, seed=2), 0.5
    capacity = np.array([theta[c] for c in network.capacitances.values()])
    v = np.array([5.0, 0.3, 0.4, 0.2, 0.7])
    x = 20.0 + np.arange(len(network.nodes))
    d = network.discrete(theta, PAPER_ROLES, hours)
    stored = capacity @ (d.A @ x + d.B @ v - x)
    # mean temperatures over the step, by Gauss-Legendre over exact states within it
    nodes, weights = np.polynomial.legendre.leggauss(12)
    within = [network.discrete(theta, PAPER_ROLES, hours * (s + 1) / 2) for s in nodes]
    mean = sum(w / 2 * (m.A @ x + m.B @ v) for w, m in zip(weights, within, strict=True))
    envelope = 0.0
    for name, ends in network.resistors.items():
        inside = [e for e in ends if e in network.nodes]
        if len(inside) == 1:
            envelope += (v[0] - mean[network.nodes.index(inside[0])]) / theta[name]
    sources = theta["A_win"] * v[1] + theta["Q_h"] * v[2] + theta["Q_c"] * v[3] + v[4]
    assert stored == pytest.approx(hours * (envelope + sources), rel=1e-9)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: n.name)
def test_a_room_at_outdoor_temperature_stays_there(network):
    d = network.discrete(drawn(network, PAPER_ROLES), PAPER_ROLES, 0.25)
    np.testing.assert_allclose(d.A.sum(axis=1) + d.B[:, 0], 1.0, rtol=1e-12)
    assert (d.A >= 0).all()  # warmth never cools a neighbour


# -------------------------------------------------------------------------------------------------------- parameters
def test_parameter_table():
    table = CATALOGUE["2R2C"].parameter_table()
    assert list(table.index) == ["C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_h", "Q_c"]
    assert list(table["unit"]) == ["kWh/K", "kWh/K", "K/kW", "K/kW", "-", "m2", "kW", "kW"]
    # paper 2.2.1
    assert tuple(table.loc["C_w", ["lower", "upper"]]) == (0.1, 40.0)
    assert tuple(table.loc["R_zo", ["lower", "upper"]]) == (0.1, 40.0)
    assert tuple(table.loc["A_win", ["lower", "upper"]]) == (0.1, 25.0)
    assert table.loc["Q_c", "upper"] < 0 < table.loc["Q_h", "lower"]
    assert table["description"].str.len().min() > 5
    for name, row in table.iterrows():
        assert row["lower"] <= OFFICE[name] <= row["upper"]


def test_one_role_is_a_name_and_not_letters():
    network = CATALOGUE["2R2C"]
    theta = {p.name: p.default for p in network.parameters()}
    for role in ("T_oa", "q_sol", "u_heat"):
        assert network.inputs(role) == (role,)
        assert network.sources(role) == network.sources([role])
        assert network.parameters(role) == network.parameters([role])
        assert network.equations(role) == network.equations([role])
        assert draw(network, role) == draw(network, [role])
        assert network.matrix_builder(role).columns == (role, "heat_gain")
        assert MatrixBuilder.from_network(network, role).columns == (role, "heat_gain")
        np.testing.assert_array_equal(network.discrete(theta, role, 0.25).B, network.discrete(theta, [role], 0.25).B)


def test_parameters_are_those_of_the_inputs_at_hand():
    network = CATALOGUE["3R3C"]
    names = lambda roles: [p.name for p in network.parameters(roles)]  # noqa: E731
    rc = ["C_w", "C_m", "C_za", "R_zm", "R_zw", "R_wo"]
    assert names(("T_oa", "Q_hvac")) == rc
    assert names(("T_oa", "q_sol_south")) == [*rc, "f", "A_win_south"]
    assert names(("T_oa", "u_heat_2", "u_heat_1")) == [*rc, "Q_h_1", "Q_h_2"]
    # a stage of another name may heat or cool: its capacity must not be taken for Q_h or Q_c, which have a sign
    others = network.parameters(("T_oa", "u_2", "u_fan", "u_hood", "u_cooler"))[len(rc) :]
    assert {p.name for p in others} == {"Q_2", "Q_fan", "Q_u_hood", "Q_u_cooler"}
    assert all(p.lower < 0 < p.upper for p in others)


@pytest.mark.parametrize("p", CATALOGUE["4R3C"].parameters(ALL_ROLES), ids=lambda p: p.name)
def test_search_scale_and_back(p):
    low, high = p.free_bounds
    for free in np.linspace(low, high, 5):
        value = p.from_free(free)
        assert value * p.sign > 0 or p.transform == "identity"
        assert p.to_free(value) == pytest.approx(free, abs=1e-12)
        h = 1e-6
        assert p.slope(value) == pytest.approx((p.from_free(free + h) - p.from_free(free - h)) / (2 * h), rel=1e-8)
    assert sorted((p.from_free(low), p.from_free(high))) == pytest.approx([p.lower, p.upper])
    assert p.lower < p.default < p.upper


def test_bounds_of_a_parameter():
    p = CATALOGUE["2R2C"].parameters()[-1]
    assert p.name == "Q_c"
    assert p.bounded((-3.0, -9.0)).free_bounds == pytest.approx((np.log(3.0), np.log(9.0)))
    assert p.bounded(None) is p
    with pytest.raises(ValueError, match="both must be < 0"):
        p.bounded((-3.0, 3.0))
    for wrong, message in (
        ((3.0, 9.0), r"bounds of Q_c are \(3, 9\); both must be < 0"),
        ((-3.0, -3.0), "the lower must be less than the upper"),
        ("39", "bounds of Q_c are '39'; give two finite numbers"),
        ((-np.inf, -1.0), "give two finite numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            p.bounded(wrong)
    with pytest.raises(ValueError, match="the lower must be less than the upper"):
        Parameter("x", "-", 2.0, 2.0)
