"""Buildings of several rooms: their networks, gray boxes, identification room by room, and floor plans from data."""

from __future__ import annotations

import warnings
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skhybrid import (
    GrayBoxRC,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    RCNetwork,
    persistence,
)
from skhybrid.datasets import make_house
from skhybrid.exceptions import ExcitationWarning
from skhybrid.identification import find_adjacency, identify_rooms
from skhybrid.identification.rooms import _combined
from skhybrid.model_selection import backtest
from skhybrid.thermal import building_network, room_network

PAIR = ("north", "south")
AB = ["a", "b"]


@pytest.fixture(scope="module")
def house():
    return make_house(21, start="2023-10-07", random_state=1)


def with_heat(house):
    """The log with the heaters in kW."""
    return house.X[[name for name in house.X if not name.startswith("u_heat")]].join(house.heat)


# ---------------------------------------------------------------------------------------------------------- networks
def test_two_rooms_are_those_that_one_would_declare():
    flat = building_network(PAIR, [PAIR], room="2R2C")
    by_hand = RCNetwork(
        "flat",
        {"w_n": "C_w_north", "n": "C_za_north", "w_s": "C_w_south", "s": "C_za_south"},
        {
            "R_zw_north": ("n", "w_n"),
            "R_zo_north": ("n", "T_oa"),
            "R_zw_south": ("s", "w_s"),
            "R_zo_south": ("s", "T_oa"),
            "R_north_south": ("n", "s"),
        },
        {"q_sol_north": {"n": "f_north", "w_n": None}, "q_sol_south": {"s": "f_south", "w_s": None}},
        measured=("n", "s"),
        disturbed=("n", "s"),
        heated={"u_heat_north": "n", "Q_hvac_south": "s"},
    )
    roles = ["T_oa", "q_sol_north", "q_sol_south", "u_heat_north", "Q_hvac_south"]
    names = [p.name for p in flat.parameters(roles)]
    assert names == [p.name for p in by_hand.parameters(roles)]
    theta = {name: 0.5 + 0.1 * k for k, name in enumerate(names)}
    for one, two in zip(flat.matrices(theta, roles), by_hand.matrices(theta, roles), strict=True):
        np.testing.assert_array_equal(one, two)
    assert flat.history_roles == ("T_za_north", "T_za_south")
    assert flat.gain_names == ("heat_gain_north", "heat_gain_south")
    assert flat.zones == {"north": ("w_north", "za_north"), "south": ("w_south", "za_south")}


def test_rooms_with_networks_of_their_own():
    tower = building_network({"hall": "1R1C", "flat": "TiTeTh"}, [("flat", "hall")], couple=("za",))
    assert tower.nodes == ("za_hall", "e_flat", "h_flat", "za_flat")
    assert tower.resistors["R_flat_hall"] == ("za_flat", "za_hall")
    assert tower.bounds["C_h_flat"] == (0.01, 40.0)
    assert [s.shares for s in tower.sources(["u_heat_flat"])] == [(("h_flat", None),)]
    both = building_network(AB, [("a", "b")], couple=("za", "w"))
    assert both.resistors["R_w_a_b"] == ("w_a", "w_b")
    assert not [name for name in building_network(AB).resistors if name == "R_a_b"]
    assert room_network(tower, "flat").bounds["C_h_flat"] == (0.01, 40.0)


def test_a_boiler_for_all_and_one_sun():
    """A shared stage has a capacity per room, shared heat shares, and a window of each room sees the common sun."""
    three = building_network(
        list("abc"), solar={"a": "q_sol", "b": ("q_sol", "q_sol_b"), "c": ()}, heated={"c": "u_heat_c"}
    )
    sources = {s.parameter: (s.role, s.shares) for s in three.sources(["q_sol", "q_sol_b", "u_heat", "u_heat_a"])}
    assert sources["Q_h_to_a"] == ("u_heat", (("za_a", None),))
    assert sources["Q_h_to_b"] == ("u_heat", (("za_b", None),))
    assert sources["Q_h_a"][0] == "u_heat_a"
    assert "Q_h_to_c" not in sources
    assert three.required_roles == ("T_oa", "q_sol", "q_sol_b")
    roles = ["T_oa", "q_sol", "q_sol_b", "u_heat", "Q_hvac"]
    assert three.inputs(roles) == ("T_oa", "q_sol", "q_sol_b", "u_heat", "Q_hvac")
    theta = {p.name: 2.0 for p in three.parameters(roles)} | {"A_win_to_a": 5.0, "Q_h_to_b": 3.0, "f_hvac_a": 0.25}
    B = dict(zip(three.inputs(roles), (2.0 * three.matrices(theta, roles).B).T, strict=False))  # C = 2: heat [kW]
    at = {node: i for i, node in enumerate(three.nodes)}
    assert B["u_heat"][at["za_a"]] == 2.0
    assert B["u_heat"][at["za_b"]] == 3.0
    assert B["u_heat"][at["za_c"]] == 0.0
    assert B["Q_hvac"][[at["za_a"], at["za_b"], at["za_c"]]].tolist() == [0.25, 0.75, 0.0]
    assert B["q_sol"].sum() == pytest.approx(5.0 + 2.0)
    assert "A_win_to_a q_sol" in three.equations(roles)
    assert "Q_h_to_b u_heat" in three.equations(roles)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([],), r"zones=\[\] has 0 of the two or more zones"),
        ((["a"],), r"zones=\['a'\] has 1 of the two or more"),
        ((["a", "b", "a"],), "names a zone twice"),
        ((["a", "the hall"],), "zones has 'the hall', which cannot be part of a column's name"),
        ((AB, [("a", "c")]), "adjacency names 'c', which is not one of the zones a, b"),
        ((AB, [("a", "a")]), "adjacency couples 'a' with itself"),
        ((AB, [("a", "b"), ("b", "a")]), "adjacency has the pair 'b', 'a' twice"),
        ((AB, ["ab"]), "adjacency has 'ab'; give pairs of zones"),
        ((["a", "b_c", "a_b", "c"], [("a", "b_c"), ("a_b", "c")]), "'a_b' and 'c' would be a second 'R_a_b_c'"),
        ((["zo", "a"], [("zo", "a")]), "'zo' and 'a' would be a second 'R_zo_a'; rename"),
        ((AB, [("a", "b", "a")]), r"adjacency has \('a', 'b', 'a'\); give pairs"),
        (
            ({"a": "2R2C", "b": "1R1C"}, [("a", "b")], {"couple": "w"}),
            "couple names the node 'w', which zone 'b' lacks",
        ),
        ((AB, None, {"heated": {"c": ()}}), "heated names 'c', which is not one of the zones"),
        ((AB, None, {"solar": {"c": ()}}), "solar names 'c', which is not one of the zones"),
        ((AB, None, {"solar": {"a": "sun"}}), "solar names 'sun', which is not an irradiance"),
        ((AB, None, {"solar": "sun"}), "solar names 'sun', which is not an irradiance"),
        ((AB, None, {"solar": ["q_sol"]}), "solar=.* must be a mapping of zones to roles, or one role"),
        (
            (AB, None, {"solar": {"a": {"q_sol": "za"}}}),
            "solar of zone 'a' is {'q_sol': 'za'}; give one name or several",
        ),
        ((AB, None, {"heated": "u_heat"}), "heated='u_heat' must be a mapping of zones to roles"),
        ((AB, None, {"heated": {"a": [1]}}), r"heated of zone 'a' is \[1\]; give one name or several"),
        ((AB, [("a", "b")], {"couple": None}), "couple is None; give one name or several, as text"),
        ((3,), "zones is 3; give one name or several, as text"),
        (([["a"], ["b"]],), r"zones is \[\['a'\], \['b'\]\]; give one name or several"),
        ((AB, 5), "adjacency has 5; give pairs of zones"),
        ((AB, "ab"), "adjacency has 'ab'; give pairs of zones"),
        ((AB, [("a", ["b"])]), r"adjacency has \('a', \['b'\]\); give pairs of zones"),
        ((AB, None, {"room": "5R1C"}), "room='5R1C' is not in the catalogue"),
        (({"a": "1R1C", "b": "5R1C"},), r"zones\['b'\]='5R1C' is not in the catalogue"),
        (({"a": "1R1C", "b": building_network(["c", "d"])},), r"network building of zone 'b' names .* as measured"),
    ],
)
def test_what_is_no_building_is_refused(arguments, message):
    *positional, last = arguments
    settings = last if isinstance(last, dict) and len(arguments) == 3 else {}
    with pytest.raises(ValueError, match=message):
        building_network(*(positional if settings else arguments), **settings)


@pytest.mark.parametrize(("network", "zone"), [("2R2C", "a"), (building_network(AB), ["a"])])
def test_a_room_of_what_is_no_building_is_refused(network, zone):
    with pytest.raises(ValueError, match=r"is not the network of a building|has no zone"):
        room_network(network, zone)


@pytest.mark.parametrize(
    ("heated", "message"),
    [
        ({"u_heat": {"Q_h": "a", "A_win": "b"}}, "gives 'u_heat' the parameter 'A_win'"),
        ({"Q_hvac": {"Q_h": "a", "Q_c": "b"}}, "gives 'Q_hvac' the capacity 'Q_h'; it is in kW already"),
        ({"u_heat": {"Q_h_2": "a", "Q_h": "b"}, "u_heat_2": "a"}, "gives 'Q_h_2' to two sources"),
        ({"u_heat": {"Q_h": 3.0}}, "gives 'Q_h' to 3.0, which is neither a node nor shares"),
    ],
)
def test_unclear_capacities_are_refused(heated, message):
    with pytest.raises(ValueError, match=message):
        RCNetwork(
            "x",
            {"a": "C_a", "b": "C_b"},
            {"R": ("a", "b"), "R_o": ("a", "T_oa")},
            measured="a",
            disturbed="a",
            heated=heated,
        )


def test_a_room_alone_has_its_neighbours_as_boundaries():
    three = building_network(list("abc"), [("a", "b"), ("b", "c")], solar="q_sol")
    room = room_network(three, "b")
    roles = ["T_oa", "q_sol", "u_heat", "Q_hvac_b"]
    assert room.boundaries == ("T_oa", "T_za_a", "T_za_c")
    theta = {p.name: 0.4 + 0.1 * k for k, p in enumerate(three.parameters([*roles, "u_heat_a"]))}
    whole, alone = three.matrices(theta, roles), room.matrices(theta, [*roles, *room.boundaries])
    own = [three.nodes.index(node) for node in room.nodes]
    np.testing.assert_allclose(alone.A, whole.A[np.ix_(own, own)], rtol=1e-14)
    columns = dict(zip(room.inputs([*roles, *room.boundaries]), alone.B.T, strict=False))
    np.testing.assert_allclose(columns["T_za_a"], whole.A[own, three.nodes.index("za_a")], rtol=1e-14)
    for role, column in zip(three.inputs(roles), whole.B.T, strict=False):
        np.testing.assert_allclose(columns[role], column[own], rtol=1e-14)
    with pytest.raises(ValueError, match="has no zone 'd': a, b, c"):
        room_network(three, "d")


@pytest.mark.parametrize(
    ("solar", "role", "area"),
    [
        (None, "q_sol_a", "A_win_a"),
        ("q_sol", "q_sol", "A_win_to_a"),
        ({"a": "q_sol_south"}, "q_sol_south", "A_win_south"),
    ],
)
def test_bounds_of_a_source_hold_in_the_building_and_in_its_room(solar, role, area):
    bounds = {"A_win": (1.0, 2.0), "Q_h": (3.0, 4.0)}
    room = RCNetwork("lone", {"za": "C_za"}, {"R_zo": ("za", "T_oa")}, {"za": None}, bounds=bounds)
    both = building_network({"a": room, "b": room}, solar=solar)
    for network in (both, room_network(both, "a")):
        table = network.parameter_table([role, "u_heat", "u_heat_a"])[["lower", "upper"]]
        assert table.loc[area].tolist() == [1.0, 2.0]
        assert table.loc[["Q_h_to_a", "Q_h_a"]].to_numpy().tolist() == [[3.0, 4.0]] * 2


def test_rooms_whose_sun_is_not_declared_by_role_are_not_taken_apart():
    nodes, resistors = {"a": "C_a", "b": "C_b"}, {"R_a": ("a", "T_oa"), "R_b": ("b", "T_oa")}
    zones = {"A": ("a",), "B": ("b",)}
    flat = RCNetwork("flat", nodes, resistors, ("a", "b"), ("a", "b"), ("a", "b"), ("a", "b"), zones=zones)
    with pytest.raises(ValueError, match=r"flat has solar=.*which does not say what each room has"):
        room_network(flat, "A")


# ----------------------------------------------------------------------------------------------------------- the house
def test_the_house_is_its_network():
    """From 5-min means and the true gains the network gives the states to rounding."""
    house = make_house(3, zones=3, sampling_time="5min", noise_std=0.0, random_state=0)
    model = GrayBoxRC(house.network, known=house.theta).fit(house.X, house.y)
    states = model.simulate_states(house.X, heat_gain=house.heat_gain, initial_state=house.states.iloc[0])
    np.testing.assert_allclose(states, house.states, atol=1e-9)
    assert house.adjacency == [("living", "kitchen"), ("living", "bedroom")]
    pd.testing.assert_frame_equal(
        make_house(3, zones=3, sampling_time="5min", noise_std=0.0, random_state=0).X, house.X
    )
    assert house.heat["Q_hvac_living"].max() == pytest.approx(house.theta["Q_h_living"])
    assert (house.y.max() > house.setpoints.max().to_numpy() - 1.0).all()


def test_states_and_temperatures_go_by_their_names():
    """A Series was read by position, so that states in another order took each other's places."""
    house = make_house(2, zones=2, noise_std=0.0, random_state=0)
    model = GrayBoxRC(house.network, known=house.theta).fit(house.X[:-8], house.y[:-8])
    state, ahead = house.states.iloc[0], house.X[-8:].filter(regex="^(T_oa|q_sol|u_)")
    expected = model.simulate(house.X, initial_state=state.to_numpy())
    for given in (state, state[::-1], state[::-1].to_dict(), house.states.iloc[[0], ::-1]):
        np.testing.assert_array_equal(model.simulate(house.X, initial_state=given), expected)
    now = house.y.iloc[-8]
    path = model.forecast(None, ahead, T_za=list(now))
    by_zone = now.rename(lambda name: name.removeprefix("T_za_"))
    for given in (now[::-1], now.to_dict(), by_zone[::-1], by_zone.to_dict(), pd.Series(now.to_numpy())):
        pd.testing.assert_frame_equal(model.forecast(None, ahead, T_za=given), path)
    with pytest.raises(ValueError, match=r"initial_state has the names 'T_attic', 'T_za_living', .*; give a value for"):
        model.simulate(house.X, initial_state=state.rename({"T_w_living": "T_attic"}))
    with pytest.raises(ValueError, match="give those of 'T_za_living', 'T_za_kitchen'"):
        model.forecast(None, ahead, T_za=20.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"zones": 1}, "zones=1 must be an integer from 2 to 8"),
        ({"n_days": 0}, "n_days=0 must be an integer of at least 1"),
        ({"partition": 0.0}, r"partition=0.0 must be a positive resistance \[K/kW\]"),
        ({"pattern": "bar"}, "pattern='bar' is unknown"),
        ({"excitation": "step"}, "excitation='step' is unknown"),
        ({"noise_std": np.nan}, "noise_std=nan must be zero or a positive"),
        ({"sampling_time": "7h"}, "sampling_time='7h' does not divide a day"),
    ],
)
def test_a_house_that_cannot_be_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        make_house(**{"n_days": 1, **settings})


# ---------------------------------------------------------------------------------------------------------- gray boxes
@pytest.mark.parametrize("estimator", [GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID])
def test_gray_boxes_fit_a_building(house, estimator, tmp_path):
    X, y = with_heat(house)[::4][:168], house.y[::4][:168]
    own = {"tau": 2.0} if estimator is PeriodicDisturbanceID else {}
    model = estimator(house.network, known={**house.theta, **own}, n_starts=1, horizon="1D").fit(X, y)
    zones = list(house.network.zones)
    assert model.predict(X).shape == (168, 4)
    assert list(model.estimate_disturbance(X).columns) == [f"zeta_{zone}" for zone in zones]
    assert list(model.forecast(X[:-24], X[-24:]).columns)[:4] == list(house.y)
    assert list(model.innovations(X).columns)[:4] == [f"innovation_{zone}" for zone in zones]
    persistence.save_model(model, tmp_path / "house.skops")
    again = persistence.load_model(tmp_path / "house.skops")
    np.testing.assert_array_equal(again.predict(X), model.predict(X))


def test_targets_by_the_names_of_zones(house):
    X, y = with_heat(house)[:200], house.y[:200]
    zones = list(house.network.zones)
    fit = lambda y: GrayBoxRC(house.network, known=house.theta).fit(X, y).initial_state_  # noqa: E731
    expected = fit(y)
    by_zone = y.set_axis(zones, axis=1)
    for other in (
        y[y.columns[::-1]],
        by_zone[zones[::-1]],
        y.to_numpy(),
        by_zone.rename(columns={"bedroom": "T_za_bedroom"}),
    ):
        np.testing.assert_array_equal(fit(other), expected)
    for wrong in (by_zone.rename(columns={"study": "office"}), by_zone[zones[:3]]):
        with pytest.raises(
            ValueError, match=r"exactly one column 'T_za_study' or 'study'; give .* or 'living', 'kitchen'"
        ):
            fit(wrong)


def test_a_back_test_of_rooms_is_their_forecast_from_each_origin(house):
    X, y = house.X, house.y
    model = GrayBoxRC(house.network, known=house.theta).fit(X[:192], y[:192])
    found = backtest(model, X[192:480], y[192:480], horizon="6h")
    assert list(found["zone"].unique()) == list(house.network.zones)
    origins = [X.index[192:480].get_loc(stamp) for stamp in found["origin"].unique()]
    paths = model.predict_from(X[192:480], origins, horizon="6h")
    np.testing.assert_array_equal(found["y_pred"], paths.transpose(2, 0, 1).ravel())
    kitchen = found[found["zone"] == "kitchen"]
    np.testing.assert_array_equal(kitchen["y_true"], y["T_za_kitchen"].loc[kitchen["time"]])
    with pytest.raises(ValueError, match="weather_error with the heat known is for one zone"):
        backtest(model, X[192:480], y[192:480], weather_error="low")


def test_exchanged_rooms_are_refused(house):
    """A target in another order than its names was fitted, and scored, without a word."""
    X, y = house.X[:288], house.y[:288]
    exchanged = y.iloc[:, [1, 0, 2, 3]].set_axis(y.columns, axis=1)
    model = GrayBoxRC(house.network, known=house.theta).fit(X, y)
    for method in (model.fit, model.score, partial(backtest, model)):
        with pytest.raises(ValueError, match="y of 'T_za_living' is what X has measured in 'T_za_kitchen'"):
            method(X, exchanged)


@pytest.mark.slow
def test_rooms_are_identified_one_by_one(house):
    """The partitions of a house of four rooms within a fifth, and all else but the sun's share within 15 %."""
    X = with_heat(house).rename(columns={"T_oa": "outdoors"})
    model = PeriodicDisturbanceID(house.network, n_starts=1, variance="3h", columns={"T_oa": "outdoors"})
    found = identify_rooms(model, X[: 14 * 96], house.y[: 14 * 96].set_axis(list(house.network.zones), axis=1))
    assert list(found.rooms) == list(house.network.zones)
    error = (found.theta / pd.Series(house.theta_effective) - 1).dropna().abs()
    partitions = [f"R_{a}_{b}" for a, b in house.adjacency]
    assert error[partitions].max() < 0.20
    assert error[[n for n in error.index if not n.startswith("f_")]].median() < 0.05
    assert error[[n for n in error.index if not n.startswith("f_")]].max() < 0.25
    sides = [room.theta_std_["R_living_kitchen"] for zone, room in found.rooms.items() if zone in ("living", "kitchen")]
    assert found.theta_std["R_living_kitchen"] < min(sides)
    assert set(found.theta.index) == {p.name for p in house.network.parameters(list(with_heat(house).columns))}


def test_a_partition_that_no_room_tells_has_no_standard_error():
    names = ["R_told", "R_held", "R_unmoved", "R_once"]
    stds = ([0.3, np.nan, np.inf, np.nan], [0.4, np.nan, np.nan, 0.5])
    rooms = [SimpleNamespace(theta_=pd.Series(2.0, names), theta_std_=pd.Series(std, names)) for std in stds]
    theta, std = _combined(rooms)
    np.testing.assert_allclose(theta, 2.0)
    np.testing.assert_allclose(std[names], [0.24, np.nan, np.inf, 0.5], rtol=1e-6)


def test_rooms_that_cannot_be_identified_apart(house):
    X, y = with_heat(house), house.y
    with pytest.raises(ValueError, match=r"estimator=Ridge\(\) is no identification, such as"):
        identify_rooms(Ridge(), X, y)
    with pytest.raises(ValueError, match="the network 2R2C has no zones"):
        identify_rooms(InputDisturbanceID(), X, y)
    walls = building_network(list(house.network.zones), house.adjacency, couple=("za", "w"))
    with pytest.raises(
        ValueError, match="R_w_living_kitchen joins rooms at w_kitchen, w_living, which is not measured"
    ):
        identify_rooms(InputDisturbanceID(walls), X, y)
    with pytest.raises(ValueError, match="column 'Q_hvac' is heat that rooms share"):
        identify_rooms(InputDisturbanceID(house.network), X.assign(Q_hvac=1.0), y)
    with pytest.raises(ValueError, match="y needs exactly one column 'T_za_study'"):
        identify_rooms(InputDisturbanceID(house.network), X, y.iloc[:, :3])
    with pytest.raises(ValueError, match="X must be a DataFrame"):
        identify_rooms(InputDisturbanceID(house.network), X.to_numpy(), y)
    with pytest.raises(ValueError, match="the columns of X have 2 levels; give each column one name"):
        identify_rooms(InputDisturbanceID(house.network), pd.concat({"house": X}, axis=1), y)
    for other in (y.tz_localize("UTC"), y[:-1]):
        with pytest.raises(ValueError, match=r"X and y have different time stamps \(X from .* to .*, y from .* to "):
            identify_rooms(InputDisturbanceID(house.network), X, other)
    with pytest.raises(ValueError, match=f"X has {len(X)} rows, but y has {len(y) - 1}"):
        identify_rooms(InputDisturbanceID(house.network), X, y[:-1].reset_index(drop=True))


def test_measurements_without_stamps_belong_to_the_rows_in_their_order(house):
    X, y = with_heat(house)[: 2 * 96], house.y[: 2 * 96]
    model = InputDisturbanceID(house.network, n_starts=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExcitationWarning)
        found = [identify_rooms(model, X, given).theta for given in (y, y.reset_index(drop=True))]
    pd.testing.assert_series_equal(*found)


# ----------------------------------------------------------------------------------------------------------- adjacency
def test_the_floor_plan_of_a_house_is_found(house):
    found = find_adjacency(with_heat(house), house.y)
    assert found.index[found["kept"]].tolist() == house.adjacency
    true = np.array([1.0 / house.theta[f"R_{a}_{b}"] for a, b in house.adjacency])
    np.testing.assert_allclose(found.loc[house.adjacency, "conductance"], true, rtol=0.5)
    assert (found.loc[~found["kept"], "conductance"] == 0.0).all()
    assert (found["std"] > 0).all()
    again = find_adjacency(with_heat(house), house.y.set_axis(list(house.network.zones), axis=1)[["study", "kitchen"]])
    assert again.index.tolist() == [("study", "kitchen")]
    assert (
        building_network(list(house.network.zones), found.index[found["kept"]]).resistors.keys()
        == house.network.resistors.keys()
    )


def test_rooms_without_partitions_have_few_couplings():
    apart = make_house(28, partition=1e6, start="2023-10-07", random_state=3)
    found = find_adjacency(with_heat(apart), apart.y)
    assert found["kept"].sum() <= 1
    assert found["conductance"].max() < 0.03


def test_stages_and_missing_rows_do(house):
    """Without heat in kW the conductances are relative; rows that lack a temperature are left out."""
    y = house.y.copy()
    y.iloc[300:400, 1] = np.nan
    found = find_adjacency(house.X, y)
    assert found.loc[house.adjacency, "kept"].all()


@pytest.mark.parametrize(("data", "false"), [("strong_shift", 1), ("ref_base", 0)])
def test_the_floor_plan_of_five_rooms_in_energyplus(shared_data, data, false):
    log = pd.read_csv(
        shared_data / "zones" / f"small_office_zones_{data}_1.csv.gz", index_col=0, parse_dates=True, nrows=72 * 96
    )[30 * 96 :]
    rooms = ["core", "south", "east", "north", "west"]
    X = pd.DataFrame({"T_oa": log["T_out_degC"], "q_sol": log["ghi_kW_m2"], "q_sol_direct": log["dni_kW_m2"]})
    X = X.join(log[[f"Q_{z}_kW" for z in rooms]].set_axis([f"Q_hvac_{z}" for z in rooms], axis=1))
    found = find_adjacency(X, log[[f"T_{z}_degC" for z in rooms]].set_axis(rooms, axis=1))["kept"]
    wrong = [("south", "north"), ("east", "west")]
    assert found[wrong].sum() <= false
    assert found.drop(wrong).sum() >= 7


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X, y: (X, y.iloc[:, :1]), "y needs the temperatures of two zones or more"),
        (lambda X, y: (X, y.to_numpy()), "y needs the temperatures of two zones or more"),
        (lambda X, y: (X[:500], y[:500]), "X has 5.21 days; give 10 or more"),
        (lambda X, y: (X.drop(columns="T_oa"), y[1:]), "X has 2016 rows, y 2015"),
        (lambda X, y: (X.resample("3h").mean(), y.resample("3h").first()), "a step of 3 h, which does not divide an"),
        (
            lambda X, y: (X, y.where(np.arange(len(y))[:, None] // 4 % 2 == np.arange(4) % 2)),
            "measured at once on 0 days",
        ),
        (lambda X, y: (X, y[np.arange(len(y)) // 4 % 2 == 0].reindex(y.index)), "measured at once on 0 days"),
    ],
)
def test_what_tells_no_floor_plan_is_refused(house, change, message):
    X, y = change(with_heat(house), house.y)
    with pytest.raises(ValueError, match=message):
        find_adjacency(X, y)
    with pytest.raises(ValueError, match="y needs exactly one column 'T_za_x' or 'x'"):
        find_adjacency(house.X, house.y, zones=["living", "x"])
    with pytest.raises(ValueError, match="two zones or more"):
        find_adjacency(house.X, house.y, zones=["living", "living"])
    for zones in (5, "living"):
        with pytest.raises(ValueError, match=f"zones={zones!r} must be the names of two zones or more"):
            find_adjacency(house.X, house.y, zones=zones)
