"""The load of a set-point: against a plain simulation, within limits, in a band, for plants that heat and cool."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from skhybrid import (
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
)
from skhybrid.control import load_frame, make_plant, steps_ahead
from skhybrid.datasets import make_office
from skhybrid.datasets._office import TRUE_THETA as TRUE
from skhybrid.exceptions import UnitWarning
from skhybrid.filtering import simulate_inverse
from skhybrid.thermal import RCNetwork

DAY = 96
#: rows that begin at a midnight and do not follow the training: every node starts at the first measurement
HERE = slice(16 * DAY, 17 * DAY)


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=18, start="2023-11-04", climate="chicago", random_state=4)


@pytest.fixture(scope="module")
def plain(office):
    return GrayBoxRC(known=TRUE).fit(office.X[: 14 * DAY], office.y[: 14 * DAY])


@pytest.fixture(scope="module")
def hybrid(office):
    model = HybridPredictor(
        PeriodicDisturbanceID(known=TRUE, n_starts=1), DisturbanceForecaster("profile"), random_state=0
    )
    return model.fit(office.X[: 14 * DAY], office.y[: 14 * DAY])


@pytest.fixture(scope="module")
def measured_heat(office):
    """A hybrid of a log that holds heat instead of stages."""
    X = office.X.assign(Q_hvac=6.0 * (office.X["u_heat"] - office.X["u_cool"])).drop(columns=["u_heat", "u_cool"])
    gray_box = PeriodicDisturbanceID(known={k: v for k, v in TRUE.items() if k[0] != "Q"}, n_starts=1)
    model = HybridPredictor(gray_box, DisturbanceForecaster("profile")).fit(X[: 14 * DAY], office.y[: 14 * DAY])
    return model, X


def simulate(X, heat):
    """Room temperature at every row's stamp and after the last: the TRUE network by a matrix exponential."""
    p = TRUE
    rate = np.zeros((5, 5))  # T_w, T_za, T_oa, q_sol, heat
    rate[0, :2] = np.array([-1.0, 1.0]) / (p["C_w"] * p["R_zw"])
    rate[0, 3] = (1 - p["f"]) * p["A_win"] / p["C_w"]
    rate[1] = np.array([1 / p["R_zw"], -1 / p["R_zw"] - 1 / p["R_zo"], 1 / p["R_zo"], p["f"] * p["A_win"], 1.0])
    rate[1] /= p["C_za"]
    step = expm(0.25 * rate)[:2]
    state = np.full(2, X["T_za"].iloc[0])
    room = [state[1]]
    for row, q in zip(X[["T_oa", "q_sol"]].to_numpy(), heat, strict=True):
        state = step @ np.array([*state, *row, q])
        room.append(state[1])
    return np.array(room)


def ahead(values):
    """Values at the end of every row's step."""
    return np.append(values[1:], values[-1])


def night_plan(X):
    """Set-points of an office at every stamp: (heating, cooling)."""
    busy = (X.index.hour >= 6) & (X.index.hour < 19)
    return np.where(busy, 21.0, 16.0), np.where(busy, 24.0, 28.0)


@pytest.mark.parametrize("shape", ["float", "array", "series", "list"])
def test_the_unclipped_load_holds_the_set_point(shape, hybrid, plain, office):
    X = office.X[HERE]
    wanted = 21.0 + np.sin(np.arange(DAY) / 10.0)
    given = {"float": 21.5, "array": wanted, "series": pd.Series(wanted, X.index), "list": list(wanted)}[shape]
    for model in (hybrid, plain):
        load = model.predict_load(X, given)
        zeta = load["zeta"] if model is hybrid else 0.0
        reached = simulate(X, load["Q_hvac_unclipped"] + zeta)[1:]
        np.testing.assert_allclose(reached, ahead(np.broadcast_to(given, DAY)), atol=1e-7)
    # the hybrid's load is that of the network less the heat that it expects, not that of the network alone
    assert np.abs(hybrid.predict_load(X, given)["zeta"]).max() > 0.1


@pytest.mark.parametrize("limits", [None, (-1.0, 2.7), (0.0, 2.8), "night off"])
def test_the_clipped_load_is_within_its_limits_and_its_temperature_is_simulated(limits, hybrid, office):
    X = office.X[HERE]
    if limits == "night off":
        limits = (0.0, pd.Series(np.where(X.index.hour < 5, 0.0, 3.0), X.index))
    load = hybrid.predict_load(X, 16.0, limits)
    lower, upper = limits if limits is not None else (-6.0, 6.0)
    assert (load["Q_hvac"] >= lower - 1e-12).all()
    assert (load["Q_hvac"] <= upper + 1e-12).all()
    np.testing.assert_allclose(load["Q_hvac"], 6.0 * (load["u_heat"] - load["u_cool"]), atol=1e-12)
    reached = simulate(X, load["Q_hvac"] + load["zeta"])
    np.testing.assert_allclose(load["T_za"], reached[:-1], atol=1e-7)
    # a row that is not at a limit ends at the set-point; the clipped state, not the unclipped one, is followed
    free = (load["Q_hvac"] > np.asarray(lower) + 1e-9) & (load["Q_hvac"] < np.asarray(upper) - 1e-9)
    np.testing.assert_allclose(reached[1:][free], 16.0, atol=1e-7)
    if limits is not None:
        assert 5 < (~free).sum() < DAY


def test_limits_beyond_the_plant_change_nothing(hybrid, office):
    X = office.X[HERE]
    pd.testing.assert_frame_equal(hybrid.predict_load(X, 30.0, (-50.0, 50.0)), hybrid.predict_load(X, 30.0))
    assert hybrid.predict_load(X, 30.0)["u_heat"].max() == 1.0


def test_a_set_point_may_leap_for_one_row(hybrid, office, recwarn):
    X = office.X[14 * DAY : 17 * DAY]
    hybrid.predict_load(X, np.where(np.arange(len(X)) == 9, 30.0, 18.0))
    assert not [str(w.message) for w in recwarn if "leaps" in str(w.message)]


def test_a_plant_of_two_sides_never_does_both(hybrid, office):
    rng = np.random.default_rng(0)
    X = office.X[14 * DAY :]
    load = hybrid.predict_load(X, rng.uniform(16.0, 28.0, len(X)))
    for suffix in ("", "_unclipped"):
        heat, cool = load["u_heat" + suffix], load["u_cool" + suffix]
        assert (heat >= 0).all()
        assert (cool >= 0).all()
        assert (heat * cool == 0).all()
        assert heat.gt(0).sum() > 20
        assert cool.gt(0).sum() > 20


def test_stages_share_the_load_up_to_the_highest_seen_of_each(office):
    """Two stages that heat, seen up to 1.5 and 2, against a plain loop over the rows."""
    capacity, most = {"u_heat_1": 2.0, "u_heat_2": 1.5}, {"u_heat_1": 1.5, "u_heat_2": 2.0}
    staged = {role: most[role] * office.X["u_heat"] for role in most}  # flat out they give 2 x 1.5 + 1.5 x 2 = 6 kW
    X = office.X.drop(columns="u_heat").assign(**staged, u_cool=0.5 * office.X["u_cool"])
    known = {k: v for k, v in TRUE.items() if k not in ("Q_h", "Q_c")} | {"Q_h_1": 2.0, "Q_h_2": 1.5, "Q_c": -12.0}
    model = GrayBoxRC(known=known).fit(X[: 14 * DAY], office.y[: 14 * DAY])
    wanted = np.where(np.arange(DAY) % 32 < 16, 24.0, 12.0)
    load = model.predict_load(X[HERE], wanted)
    for suffix in ("", "_unclipped"):
        for k, heat in enumerate(load["Q_hvac" + suffix]):
            for role in most:
                expected = most[role] * max(heat, 0.0) / 6.0
                assert load[role + suffix].iloc[k] == pytest.approx(expected, abs=1e-12)
            assert load["u_cool" + suffix].iloc[k] == pytest.approx(max(-heat, 0.0) / 12.0, abs=1e-12)
        delivered = sum(capacity[role] * load[role + suffix] for role in most) - 12.0 * load["u_cool" + suffix]
        np.testing.assert_allclose(delivered, load["Q_hvac" + suffix], atol=1e-12)
    assert load["Q_hvac"].max() == pytest.approx(6.0)
    assert load["Q_hvac_unclipped"].max() > 6.0
    assert load["Q_hvac"].min() < -6.0  # cooling was never seen above 0.5, but 1 is what a stage can do
    assert {role: load[role].max() for role in most} == pytest.approx(most)


def test_no_load_while_the_temperature_floats_in_the_band(hybrid, office):
    X = office.X[HERE]
    heat, cool = night_plan(X)
    load = hybrid.predict_load(X, (heat, cool))
    reached = simulate(X, load["Q_hvac"] + load["zeta"])
    low, high = heat, cool
    for k, q in enumerate(load["Q_hvac"]):
        # what this row would come to without a load
        without = load["Q_hvac"].to_numpy().copy()
        without[k] = 0.0
        free = simulate(X, without + load["zeta"])[k + 1]
        if q == 0.0:
            assert low[k] - 1e-7 <= free <= high[k] + 1e-7
        elif q > 0:
            assert free < low[k]
            assert q == 6.0 or reached[k + 1] == pytest.approx(low[k], abs=1e-7)
        else:
            assert free > high[k]
            assert q == -6.0 or reached[k + 1] == pytest.approx(high[k], abs=1e-7)
    assert 10 < (load["Q_hvac"] == 0.0).sum() < DAY - 10


def test_all_spellings_of_a_band_are_one(hybrid, plain, office):
    X = office.X[HERE]
    heat, cool = night_plan(X)
    frame = pd.DataFrame({"set_cool": cool, "set_heat": heat}, X.index)  # by name, whatever the order
    expected = hybrid.predict_load(X, (heat, cool))
    for given in (
        frame,
        frame.set_axis(["T_cool_set", "T_heat_set"], axis=1),
        pd.DataFrame({"low": heat, "high": cool}, X.index),
        np.column_stack([heat, cool]),
        (pd.Series(heat, X.index), pd.Series(cool, X.index)),
    ):
        pd.testing.assert_frame_equal(hybrid.predict_load(X, given), expected)
    numbers = plain.predict_load(X, (21.0, 24.0))
    pd.testing.assert_frame_equal(plain.predict_load(X, (np.full(DAY, 21.0), 24.0)), numbers)
    pd.testing.assert_frame_equal(plain.predict_load(X, (22.0, 22.0)), plain.predict_load(X, 22.0))
    assert (plain.predict_load(X, (None, 24.0))["Q_hvac_unclipped"] <= 0).all()
    heating = plain.predict_load(X, (21.0, None))
    assert (heating["Q_hvac_unclipped"] >= 0).all()
    assert (heating["u_cool"] == 0).all()


def test_arrays_without_stamps(plain, office):
    """Rows by position: the same loads as with names and stamps."""
    X = office.X[HERE]
    bare = X.reset_index(drop=True)
    np.testing.assert_array_equal(
        plain.predict_load(bare, pd.Series(22.0, bare.index)).to_numpy(), plain.predict_load(X, 22.0).to_numpy()
    )


def test_a_temperature_is_met_at_its_stamp_and_a_setting_within_its_row(plain, office):
    X = office.X[HERE]
    step = np.where(np.arange(DAY) < 30, 17.0, 18.0)
    trajectory, setting = (plain.predict_load(X, given)["Q_hvac_unclipped"] for given in (step, (step, step)))
    assert np.argmax(trajectory.diff()) == 29
    assert np.argmax(setting.diff()) == 30
    np.testing.assert_allclose(simulate(X, setting)[1:], step, atol=1e-7)


def test_the_ramp_at_a_step_of_the_set_point(plain, office):
    """Flat out until the room is there and never beyond, from the row on in which the thermostat is set."""
    X = office.X[HERE]
    at = 24
    wanted = np.where(np.arange(DAY) < at, 13.0, 17.0)
    load = plain.predict_load(X, (wanted, None), (0.0, 5.5))
    full = np.flatnonzero(load["Q_hvac"] == 5.5)
    assert full[0] == at
    assert (np.diff(full) == 1).all()
    room = simulate(X, load["Q_hvac"])
    arrived = full[-1] + 2  # stamp after the row in which it gets there
    assert len(full) > 2
    assert (room[at:arrived] < 17.0).all()
    assert (np.diff(room[at:arrived]) > 0).all()
    np.testing.assert_allclose(room[arrived:-1], 17.0, atol=1e-7)
    later = load["Q_hvac"].iloc[full[-1] + 1 :]
    assert (later < 5.5).all()
    assert load["Q_hvac_unclipped"].iloc[at] > 2 * 5.5  # which does it in the one row


def test_measured_heat_has_no_limit_but_the_given_one(measured_heat, office):
    model, X = measured_heat
    there = X[HERE]
    free = model.predict_load(there, 25.0)
    np.testing.assert_array_equal(free["Q_hvac"], free["Q_hvac_unclipped"])
    night = there.index.hour < 6
    held = model.predict_load(there, (25.0, None), (0.0, np.where(night, 0.0, 5.0)))
    assert (held["Q_hvac"][night] == 0).all()
    assert held["Q_hvac"].max() == 5.0
    assert list(held.columns) == ["Q_hvac", "Q_hvac_unclipped", "T_za", "zeta"]
    np.testing.assert_allclose(held["T_za"], simulate(there, held["Q_hvac"] + held["zeta"])[:-1], atol=1e-7)


def test_every_day_starts_from_its_own_measurements(plain, office):
    X = office.X[15 * DAY :]
    whole = plain.set_params(horizon="1D").predict_load(X, 21.0)
    # what is done on the second day does not hang on the set-point of the first
    other = plain.predict_load(X, np.where(np.arange(len(X)) < DAY, 17.0, 21.0))
    np.testing.assert_array_equal(whole["Q_hvac"][DAY:], other["Q_hvac"][DAY:])
    assert not np.allclose(whole["Q_hvac"][:DAY], other["Q_hvac"][:DAY])


@pytest.mark.parametrize("measured", [True, False])
def test_an_output_disturbance_stands_in_the_row_to_whose_temperature_it_is_added(measured, office):
    model = OutputDisturbanceID(known={**TRUE, "rho_1": 0.9}, n_starts=1)
    model.fit(office.X[: 14 * DAY], office.y[: 14 * DAY])
    X = office.X[14 * DAY : 15 * DAY]
    load = model.predict_load(X if measured else X.drop(columns="T_za"), (21.0, 23.0))
    now = float(X["T_za"].iloc[0]) if measured else None
    under = model.forecast(None, X.assign(u_heat=load["u_heat"], u_cool=load["u_cool"]), now)
    np.testing.assert_allclose(load[["T_za", "zeta"]], under, atol=1e-9)


def test_a_heater_of_its_own_does_not_make_the_load_ring(office):
    theta = {"C_za": 1.0, "C_h": 0.5, "R_zh": 0.6, "R_zo": 6.0, "A_win": 2.0, "Q_h": 6.0, "Q_c": -6.0}
    model = InputDisturbanceID("TiTh", known=theta, n_starts=1).fit(office.X[: 14 * DAY], office.y[: 14 * DAY])
    load = model.predict_load(office.X[HERE].assign(T_oa=0.0, q_sol=0.0), 21.0)
    heat = load["Q_hvac_unclipped"].to_numpy()
    assert (heat[:20] > 0).all()  # an exact inverse begins with +88, -74, +54, -29 kW
    swings = np.sign(np.diff(heat[:20].round(6)))
    assert (swings[1:] * swings[:-1] < 0).sum() < 3
    np.testing.assert_allclose(load["T_za"][20:], 21.0, atol=1e-3)


def heated_in(office, heated, plants):
    """A network of TRUE whose plants, columns of the log, heat the nodes that ``heated`` names; and its next day."""
    walled = {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}, {"za": "f", "w": None}
    X = office.X.drop(columns=["u_heat", "u_cool"]).assign(**{role: plants[role] for role in heated})
    network = RCNetwork("own", *walled, heated=heated)
    known = {p.name: (TRUE | {"Q_h_2": 3.0})[p.name] for p in network.parameters(X.columns)}
    return GrayBoxRC(network, known=known).fit(X[: 14 * DAY], office.y[: 14 * DAY]), X[HERE]


@pytest.mark.parametrize(
    "heated",
    [
        {"u_heat": "w", "u_cool": "za"},
        {"u_heat": {"Q_h": "za", "Q_h_2": "w"}, "u_cool": "w"},
        {"u_heat": "w", "u_heat_2": "za", "u_cool": "za"},
        {"Q_floor": "w", "Q_coil": "za"},
        {"Q_floor": "w", "u_cool": "za"},
    ],
    ids=["floor and air", "one valve of two", "two stages", "meters", "meter and stage"],
)
def test_a_load_of_plants_in_several_nodes_is_what_the_forecast_makes_of_them(heated, office):
    heat, cool = office.X["u_heat"], office.X["u_heat"].shift(48, fill_value=0.0)
    plants = {"u_heat": heat, "u_heat_2": 2.0 * heat, "u_cool": cool, "Q_floor": 6.0 * heat, "Q_coil": -6.0 * cool}
    model, day = heated_in(office, heated, plants)
    load = model.predict_load(day, np.where(np.arange(DAY) % 48 < 24, 24.0, 12.0))
    assert load["Q_hvac"].max() > 2.0
    assert load["Q_hvac"].min() < -2.0
    parts = {"Q_floor": load["Q_hvac"].clip(lower=0.0), "Q_coil": load["Q_hvac"].clip(upper=0.0)} | dict(load)
    T = model.simulate(day.assign(**{role: parts[role] for role in heated}))
    np.testing.assert_allclose(load["T_za"], T, atol=1e-7)


def test_a_load_of_a_stage_and_a_meter_in_different_nodes_is_refused(office):
    heat = office.X["u_heat"]
    model, day = heated_in(office, {"u_heat": "za", "Q_floor": "w"}, {"u_heat": heat, "Q_floor": 6.0 * heat})
    with pytest.raises(ValueError, match=r"network own: 'u_heat', 'Q_floor' act on different nodes.* in heated="):
        model.predict_load(day, 21.0)


def test_a_meter_can_heat_after_known_rows_in_which_it_did_not_run(office):
    heat = office.X["u_heat"]
    model, day = heated_in(office, {"Q_hvac": "za", "u_cool": "za"}, {"Q_hvac": 6.0 * heat, "u_cool": 0.0})
    still = model.with_rows(day.assign(Q_hvac=0.0), office.y[HERE])
    assert still.plant == model.plant
    assert still.predict_load(day, (24.0, 26.0))["Q_hvac"].max() > 1.0


@pytest.mark.parametrize("held", [0.9, 1.0, 1.1, 1.3])
def test_a_load_does_not_run_away_where_heat_is_felt_late(held):
    """Room [degC] and the store of an emitter that gives back ``held`` of its heat later; more than all at 1.1."""
    A, heat = np.array([[0.98, 0.2 * held], [0.0, 0.6]]), np.array([0.2 * (1.0 - held), 0.4])
    c, forcing = np.array([1.0, 0.0]), np.tile([-0.02, 0.0], (DAY, 1))
    wanted, free = np.full(DAY, 1.0), np.full(DAY, np.inf)
    both = np.stack([heat, heat])
    load, path = simulate_inverse(
        A, forcing, both, c, wanted, wanted, -free, free, np.zeros(2), steps_ahead(A, both, c)
    )
    # at rest 1 K takes (1 - 0.98) / 0.2 kW, and the forcing 0.02 / 0.2
    np.testing.assert_allclose(load[-20:], 0.2, atol=1e-2)
    np.testing.assert_allclose(path[-20:], 1.0, atol=1e-2)


@pytest.mark.parametrize(
    ("setpoint", "limits", "message"),
    [
        (np.full(95, 21.0), None, "setpoint has shape .95,., but X has 96 rows"),
        (None, None, "setpoint=None holds nothing"),
        (True, None, "setpoint is true or false; give numbers"),
        ((np.bool_(False), 25.0), None, "the heating set-point is true or false"),
        (21.0, (False, None), "the lower limit is true or false"),
        (np.nan, None, "setpoint contains NaN or inf .first at 2023-11-20 00:00"),
        ([21.0, 24.0], None, r"setpoint=\[21.0, 24.0\] is no pair; give a heating and a cooling set-point"),
        ((24.0, 21.0), None, "the heating set-point is above the cooling one .first at 2023-11-20"),
        ((np.full(3, 21.0), 24.0), None, "the heating set-point has shape .3,."),
        ((21.0, np.nan), None, "the cooling set-point contains NaN"),
        (np.full((96, 3), 21.0), None, "setpoint has 3 columns"),
        ((pd.Series(21.0, range(96)), 24.0), None, "the heating set-point has other time stamps than X"),
        (21.0, 5.0, "limits is a pair"),
        (21.0, (1.0, -1.0), "limits have the lowest heat above the highest .first at 2023-11-20"),
        (21.0, (0.0, np.nan), "limits contain NaN"),
        (21.0, (0.0, np.ones(5)), "the upper limit has shape .5,."),
        (-9999.0, None, r"setpoint holds -9999 degC in 96 rows .first at 2023-11-20 00:00:00.*fill value"),
        ((21.0, -299.5), None, "the cooling set-point holds -299.5 degC"),
        (pd.Series("warm", range(96)), None, "setpoint has other"),
        (["warm"] * 96, None, "setpoint is text; give numbers"),
        (np.ma.masked_values(np.where(np.arange(96) == 7, -1.0, 21.0), -1.0), None, "setpoint contains NaN.*01:45"),
        (21.0, (-9999.0, 5.0), "the lower limit holds -9999 kW in 96 rows"),
    ],
)
def test_what_is_refused(setpoint, limits, message, hybrid, plain, office):
    for model in (hybrid, plain):
        with pytest.raises(ValueError, match=message):
            model.predict_load(office.X[HERE], setpoint, limits)


@pytest.mark.parametrize(
    ("setpoint", "limits", "message"),
    [
        (72.0, None, "setpoint is 72: likely degF"),
        ((68.0, None), None, "the heating set-point .* likely degF"),
        (295.0, None, "setpoint .* likely K"),
        (21.0, (0.0, 6000.0), "the upper limit is 6000: likely W rather than kW"),
    ],
)
def test_other_units_are_warned_of(setpoint, limits, message, hybrid, plain, office):
    for model in (hybrid, plain):
        with pytest.warns(UnitWarning, match=message):
            model.predict_load(office.X[HERE], setpoint, limits)


def test_stages_are_listed_by_kind_and_limited_by_what_was_seen():
    inputs = {"u_cool": np.array([0.0, 0.5]), "u_heat": np.array([1.0, 2.0]), "u_heat_2": np.array([0.0, 1.0])}
    plant = make_plant({"u_cool": -5.0, "u_heat_2": 2.0, "u_heat": 6.0}, inputs)
    assert list(plant.most.items()) == [("u_heat", 2.0), ("u_heat_2", 1.0), ("u_cool", 1.0)]
    assert (plant.lower, plant.upper) == (-5.0, 14.0)


@pytest.mark.parametrize(("known", "setpoint"), [("Q_h", (18.0, 20.0)), ("Q_c", (26.0, 30.0)), ("Q_h", 20.0)])
def test_a_load_of_known_and_fitted_stages_is_what_the_forecast_makes_of_them(known, setpoint):
    """Only the stage of known capacity goes through the emitter; the affine forecast of the network is the truth."""
    office = make_office(n_days=13, sampling_time="30min", random_state=3)
    n, stages = 12 * 48, ["u_heat", "u_cool"]
    model = HybridPredictor(known={known: TRUE[known]}, intervals=False).fit(office.X[:n], office.y[:n])
    day = office.X[n : n + 48].drop(columns="T_za")
    load = model.predict_load(day, setpoint)
    given = day.assign(**load[stages])
    T = model.affine_forecast(None, given, stages, member="network").temperature(given[stages].to_numpy())
    # what is left is the part-load curve, which no emitter delays: 0.28 and 0.35 K if one delays the fitted stage
    np.testing.assert_allclose(load["T_za"], T, atol=0.005)


def test_stages_go_before_a_meter_which_does_only_what_it_did_in_training():
    """A heating stage of 6 kW beside the meter of a boiler that heats, or of a chiller that cools."""
    seen, index = {"u_heat": np.ones(2), "u_cool": np.zeros(2)}, pd.RangeIndex(4)
    heat = np.array([-3.0, 0.0, 4.0, 9.0])
    for metered, clipped, stage in (([0.0, 2.0], [0.0, 0.0, 4.0, 9.0], 1.0), ([-2.0, 0.0], [-3.0, 0.0, 4.0, 6.0], 1.5)):
        plant = make_plant({"u_heat": 6.0, "u_cool": 0.0}, seen | {"Q_hvac": np.array(metered)})
        found = load_frame(plant, index, heat, heat, heat, heat)
        np.testing.assert_array_equal(found["Q_total"], clipped)
        np.testing.assert_allclose(found["u_heat"], [0.0, 0.0, 4.0 / 6.0, 1.0])
        np.testing.assert_allclose(found["u_heat_unclipped"], [0.0, 0.0, 4.0 / 6.0, stage])
        np.testing.assert_allclose(found["Q_hvac"], clipped - 6.0 * found["u_heat"], atol=1e-12)
        assert (found["u_cool"] == 0.0).all()
    two = {"Q_radiator": np.array([0.0, 3.0]), "Q_floor": np.array([0.0, 1.0])}
    found = load_frame(make_plant({"u_heat": 6.0}, {"u_heat": np.ones(2), **two}), index, heat, heat, heat, heat)
    np.testing.assert_allclose(found[["Q_hvac", "Q_radiator", "Q_floor"]].iloc[-1], [9.0, 2.25, 0.75])


@pytest.mark.parametrize("setpoint", [(24.0, 26.0), (35.0, 36.0)])
def test_a_load_of_a_stage_and_a_meter_can_be_given_back(setpoint):
    """A heating stage never exceeds its capacity, a chiller's meter does not heat, and no heat counts twice."""
    office = make_office(n_days=14, sampling_time="30min", random_state=0)
    n, plant = 12 * 48, ["u_heat", "Q_hvac"]
    X = office.X.drop(columns="u_cool").assign(Q_hvac=-6.0 * office.X["u_cool"])
    model = HybridPredictor(known={"Q_h": 6.0}, intervals=False).fit(X[:n], office.y[:n])
    day = X[n : n + 48].drop(columns="T_za")
    found = model.forecast(None, day, setpoint=setpoint)
    assert 0.4 < found["u_heat"].max() <= 1.0
    assert found["Q_hvac"].max() <= 0.0
    np.testing.assert_allclose(found["Q_total"], found["Q_hvac"] + 6.0 * found["u_heat"], atol=0.5)  # and the part load
    given = day.assign(**found[plant])
    T = model.affine_forecast(None, given, plant, member="network").temperature(given[plant].to_numpy())
    np.testing.assert_allclose(found["T_za"], T, atol=0.05)
