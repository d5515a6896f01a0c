"""The paper's office: exact physics, thermostat, excitation, gains, reproducibility."""

import time

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete

from skhybrid.datasets import make_house, make_office, make_prbs, make_weather
from skhybrid.datasets._gains import HOME_STANDBY_KW
from skhybrid.datasets._thermostat_plan import first_weekend

INPUTS = ["T_oa", "q_sol", "u_heat", "u_cool"]


def true_matrices(theta):
    """The continuous 2R2C of design section 3, written out again."""
    p = theta
    a = [
        [-1 / (p["C_w"] * p["R_zw"]), 1 / (p["C_w"] * p["R_zw"])],
        [1 / (p["C_za"] * p["R_zw"]), -(1 / p["R_zw"] + 1 / p["R_zo"]) / p["C_za"]],
    ]
    b = [
        [0, (1 - p["f"]) * p["A_win"] / p["C_w"], 0, 0, 0],
        [1 / (p["R_zo"] * p["C_za"]), p["f"] * p["A_win"] / p["C_za"], p["Q_h"], p["Q_c"], 1 / p["C_za"]],
    ]
    return np.array(a, dtype=float), np.array(b, dtype=float)


@pytest.fixture(scope="module")
def office():
    return make_office(random_state=0)


@pytest.fixture(scope="module")
def fine():
    return make_office(7, sampling_time="5min", noise_std=0.0, random_state=0)


def test_shape_names_and_truth(office):
    assert list(office.X.columns) == [*INPUTS, "T_za"]
    assert list(office.states.columns) == ["T_w", "T_za"]
    assert office.theta == {"C_w": 4, "C_za": 1, "R_zw": 1.2, "R_zo": 9, "f": 0.3, "A_win": 3, "Q_h": 6, "Q_c": -6}
    assert (office.y.name, office.heat_gain.name) == ("T_za", "heat_gain")
    assert len(office.X) == 14 * 96
    for table in (office.X, office.y, office.heat_gain, office.states, office.setpoints, office.gain_parts):
        assert table.index.equals(office.X.index)
        assert not np.isnan(table.to_numpy()).any()
    assert office.X.index.tz is None
    assert (office.X.dtypes == np.float64).all()


def test_no_truth_among_the_inputs(office):
    pd.testing.assert_series_equal(office.X["T_za"], office.y)
    hidden = [office.heat_gain, office.states["T_w"], office.states["T_za"], *office.gain_parts.items()]
    for truth in hidden:
        values = truth[1] if isinstance(truth, tuple) else truth
        assert not any(np.allclose(values, office.X[c]) for c in office.X)


def test_noise_is_that_of_the_measurement_only(office):
    noise = office.y - office.states["T_za"]
    assert noise.std() == pytest.approx(0.03, rel=0.1)
    assert abs(noise.mean()) < 0.003
    quiet = make_office(noise_std=0.0, random_state=0)
    pd.testing.assert_series_equal(quiet.y, quiet.states["T_za"])
    pd.testing.assert_frame_equal(quiet.states, office.states)


def test_zero_order_hold_is_exact_at_the_simulation_step(fine):
    a, b = true_matrices(fine.theta)
    transition, effect, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 5))), 5 / 60)
    v = np.column_stack([fine.X[INPUTS], fine.heat_gain])
    x = fine.states.to_numpy()
    one_step = x[:-1] @ transition.T + v[:-1] @ effect.T
    np.testing.assert_allclose(one_step, x[1:], atol=1e-9)
    path = x[0]
    for k in range(len(v) - 1):  # and errors do not accumulate over a week
        path = transition @ path + effect @ v[k]
    np.testing.assert_allclose(path, x[-1], atol=1e-9)


def test_physics_against_an_ode_solver(fine):
    a, b = true_matrices(fine.theta)
    v = np.column_stack([fine.X[INPUTS], fine.heat_gain])
    rows = range(100, 112)
    state = fine.states.iloc[100].to_numpy()
    for k in rows:
        solved = solve_ivp(lambda _, x, k=k: a @ x + b @ v[k], (0, 5 / 60), state, rtol=1e-10, atol=1e-12)
        state = solved.y[:, -1]
    np.testing.assert_allclose(state, fine.states.iloc[112], atol=1e-7)


def test_averaging_to_the_step(fine):
    coarse = make_office(7, sampling_time="15min", noise_std=0.0, random_state=0)
    expected = fine.X[INPUTS].resample("15min").mean()
    pd.testing.assert_frame_equal(coarse.X[INPUTS], expected, check_freq=False)
    pd.testing.assert_series_equal(coarse.heat_gain, fine.heat_gain.resample("15min").mean(), check_freq=False)
    pd.testing.assert_frame_equal(coarse.states, fine.states.iloc[::3], check_freq=False)


def test_thermostat_switches_fully_and_never_both(fine):
    assert set(np.unique(fine.X[["u_heat", "u_cool"]])) == {0.0, 1.0}
    assert not (fine.X["u_heat"] * fine.X["u_cool"]).any()


@pytest.mark.parametrize(("climate", "start"), [("oakland", "2023-07-08"), ("chicago", "2024-01-06")])
def test_thermostat_holds_the_set_points(climate, start):
    log = make_office(climate=climate, start=start, noise_std=0.0, sampling_time="5min", random_state=1)
    settled = log.setpoints.diff().abs().sum(axis=1).rolling(72).max() == 0  # six hours without a change
    room = log.states["T_za"][settled]
    assert len(room) > 1000
    assert (room - log.setpoints["T_cool_set"][settled]).quantile(0.999) < 0.8
    assert (log.setpoints["T_heat_set"][settled] - room).quantile(0.999) < 0.8


def test_set_points_of_the_plan(office):
    plan, hours = office.setpoints[192:], office.X.index[192:].hour  # after the perturbed weekend
    weekday = office.X.index[192:].day_of_week < 5
    busy = weekday & (hours >= 6) & (hours < 19)
    assert plan["T_cool_set"][busy].between(23, 25).all()
    assert plan["T_cool_set"][~busy].between(28, 30).all()
    assert plan["T_heat_set"][busy].between(20, 21).all()
    assert plan["T_heat_set"][~busy].between(15, 16).all()
    assert plan["T_cool_set"][busy].nunique() == 10  # drawn anew every day


@pytest.mark.parametrize("climate", ["oakland", "chicago"])
@pytest.mark.parametrize("start", ["2023-07-08", "2024-01-03"])
def test_perturbed_weekend_drives_heating_and_cooling(climate, start):
    log = make_office(climate=climate, start=start, random_state=2)
    stamps = log.X.index
    first = stamps[stamps.day_of_week == 5][0]
    weekend = (stamps >= first) & (stamps < first + pd.Timedelta("2D"))
    middle = log.setpoints[weekend].mean(axis=1)
    assert set(middle.round(9)) == {18.0, 25.0}
    changes = np.flatnonzero(np.diff(middle))
    assert (np.diff(changes) % 8 == 0).all()  # bits of two hours
    assert log.X["u_heat"][weekend].sum() > 8
    assert log.X["u_cool"][weekend].sum() > 8
    still = make_office(climate=climate, start=start, random_state=2, excitation=None)
    assert still.setpoints["T_cool_set"][weekend].min() >= 28
    pd.testing.assert_series_equal(still.X["T_oa"], log.X["T_oa"])  # all else is the same run
    pd.testing.assert_frame_equal(still.setpoints[~weekend], log.setpoints[~weekend])


def test_the_first_weekend_of_a_log_that_begins_on_a_sunday_is_the_next():
    time = pd.date_range("2023-07-09", periods=24 * 15, freq="1h")
    found = time[first_weekend(time)]
    assert (found[0], found[-1], len(found)) == (pd.Timestamp("2023-07-15 00:00"), pd.Timestamp("2023-07-16 23:00"), 48)


def test_gains_follow_the_week():
    log = make_office(56, random_state=3)
    hour, weekday = log.X.index.hour, log.X.index.day_of_week < 5
    day = log.heat_gain[weekday & (hour >= 10) & (hour < 16)]
    quiet = log.heat_gain[~weekday | (hour < 5) | (hour >= 20)]
    assert 1.5 < day.mean() < 3.0
    assert 0.05 < quiet.mean() < 0.3
    assert day.groupby(day.index.date).mean().std() > 0.15  # days differ
    np.testing.assert_allclose(log.gain_parts.sum(axis=1), log.heat_gain, atol=1e-12)
    assert (log.gain_parts[["people", "plugs", "lights"]] >= 0).all(axis=None)


def test_infiltration_follows_the_temperatures():
    log = make_office(3, "chicago", start="2024-01-10", sampling_time="5min", noise_std=0, random_state=0)
    conductance = log.gain_parts["air"] / (log.X["T_oa"] - log.states["T_za"])
    assert (conductance > 0).all()
    busy = (log.X.index.hour >= 6) & (log.X.index.hour < 19)
    assert conductance[busy].mean() > 3 * conductance[~busy].mean()  # the fan runs


def test_reproducible_from_every_kind_of_seed():
    def drawn(seed):
        return make_office(2, random_state=seed).X

    pd.testing.assert_frame_equal(drawn(5), drawn(5))
    pd.testing.assert_frame_equal(drawn(5), drawn(np.random.RandomState(5)))
    pd.testing.assert_frame_equal(drawn(np.random.default_rng(5)), drawn(np.random.default_rng(5)))
    assert not drawn(5).equals(drawn(6))
    assert not drawn(None).equals(drawn(None))


def test_the_global_random_state_is_left_alone():
    np.random.seed(0)  # noqa: NPY002
    _, before, position, *_ = np.random.get_state()  # noqa: NPY002
    for seed in (0, None):
        make_office(1, random_state=seed)
        _, after, found, *_ = np.random.get_state()  # noqa: NPY002
        assert (after == before).all()
        assert found == position


@pytest.mark.parametrize("start", ["2024-02-28", "2023-12-30", "2000-02-29", "1972-12-31", "2099-12-31"])
def test_any_start(start):
    log = make_office(4, start=start, random_state=0)
    assert log.X.index[0] == pd.Timestamp(start)
    assert (np.diff(log.X.index.to_numpy()) == np.timedelta64(15, "m")).all()
    assert np.isfinite(log.X.to_numpy()).all()


def test_a_year_takes_seconds():
    make_office(1, random_state=0)  # compiles
    begin = time.perf_counter()
    log = make_office(365, "chicago", start="2024-01-01", random_state=0)
    assert time.perf_counter() - begin < 10
    assert log.X["u_heat"].groupby(log.X.index.month).mean()[1] > 0.2
    assert log.X["u_cool"].groupby(log.X.index.month).mean()[7] > 0.1


@pytest.mark.parametrize("step", ["5min", "30min", "1h"])
def test_other_steps(step):
    assert len(make_office(2, sampling_time=step, random_state=0).X) == pd.Timedelta("2D") / pd.Timedelta(step)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_days": 0}, "n_days=0 must be an integer of at least 1"),
        ({"n_days": 1.5}, "n_days=1.5"),
        ({"climate": "paris"}, "climate='paris' is unknown; choose one of 'oakland', 'chicago'"),
        ({"excitation": "prbs"}, "excitation='prbs' is unknown"),
        ({"noise_std": -1.0}, "noise_std=-1.0"),
        ({"sampling_time": "7min"}, "sampling_time='7min' is not a positive multiple"),
        ({"sampling_time": "25min"}, "sampling_time='25min' does not divide a day"),
        ({"start": "2024-01-01T00:00+01:00"}, "has a time zone"),
    ],
)
def test_refused_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_office(**arguments)


@pytest.mark.parametrize("make", [make_weather, make_house])
def test_a_start_with_a_zone_or_that_is_no_date_is_refused(make):
    with pytest.raises(ValueError, match=r"has a time zone; the simulation runs on local standard time"):
        make(2, start="2024-01-01T00:00+01:00")
    for wrong in ("spring", None, [2024], 2024):  # a number was taken for 1970
        with pytest.raises(ValueError, match=r"^start=.* is not a date; give one, such as '2023-07-08'"):
            make(2, start=wrong)


# -------------------------------------------------------------------------------------------------------------- PRBS
def test_prbs_is_a_maximum_length_sequence():
    bits = 2 * make_prbs(order=4, scale="2h", step="2h", random_state=0) - 1
    assert len(bits) == 15
    assert bits.sum() == 1  # one more high than low
    correlation = [bits @ np.roll(bits, lag) for lag in range(1, 15)]
    np.testing.assert_allclose(correlation, -1)


def test_prbs_levels_step_and_phase():
    signal = make_prbs(order=4, scale="2h", duration="2D", step="15min", low=18, high=25, random_state=1)
    assert signal.shape == (192,)
    assert set(signal) == {18.0, 25.0}
    np.testing.assert_array_equal(signal.reshape(24, 8), np.repeat(signal[::8, None], 8, axis=1))
    phases = {tuple(make_prbs(step="2h", random_state=seed)) for seed in range(40)}
    assert len(phases) > 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 1}, "order=1"),
        ({"scale": "7min"}, "scale='7min'"),
        ({"duration": "-1D"}, "duration='-1D'"),
        ({"low": "18"}, "low='18' must be a number"),
    ],
)
def test_prbs_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_prbs(**arguments)


# --------------------------------------------------------------------------------------------------------- patterns
def test_no_gain_is_no_gain():
    log = make_office(7, pattern="none", random_state=0)
    assert (log.heat_gain == 0).all()
    assert (log.gain_parts == 0).all(axis=None)
    assert log.theta_effective == log.theta


@pytest.mark.parametrize("pattern", ["office", "home", "shop"])
def test_a_pattern_changes_nothing_but_the_gain(pattern):
    log, office = make_office(7, pattern=pattern, random_state=1), make_office(7, random_state=1)
    for role in ("T_oa", "q_sol"):
        pd.testing.assert_series_equal(log.X[role], office.X[role])
    pd.testing.assert_frame_equal(log.setpoints, office.setpoints)
    sensible = log.gain_parts[["people", "plugs", "lights"]]
    assert (sensible >= 0).all(axis=None)
    np.testing.assert_allclose(log.gain_parts.sum(axis=1), log.heat_gain)
    assert pattern in log.DESCR


def test_infiltration_lies_in_parallel_with_the_direct_conductance():
    """At night and at weekends the office's air is infiltration alone: its mean conductance is what is stated."""
    log = make_office(56, noise_std=0.0, sampling_time="5min", random_state=2)
    quiet = (log.X.index.day_of_week >= 5) | (log.X.index.hour < 6) | (log.X.index.hour >= 19)
    air = log.gain_parts["air"] / (log.X["T_oa"] - log.states["T_za"])
    extra = 1 / log.theta_effective["R_zo"] - 1 / log.theta["R_zo"]
    assert air[quiet].mean() == pytest.approx(extra, rel=0.1)
    assert {k: v for k, v in log.theta_effective.items() if k != "R_zo"} == {
        k: v for k, v in log.theta.items() if k != "R_zo"
    }


def test_a_home_is_lived_in_when_the_office_is_empty():
    log = make_office(84, pattern="home", random_state=3)
    people = log.gain_parts["people"]
    hour, weekday = log.X.index.hour, log.X.index.day_of_week < 5
    assert people[weekday & (hour == 21)].mean() > 2 * people[weekday & (hour == 14)].mean()
    assert people[~weekday & (hour == 10)].mean() > 2 * people[weekday & (hour == 10)].mean()
    plugs = log.gain_parts["plugs"]
    assert plugs[hour == 19].mean() > 2 * plugs[hour == 15].mean()  # somebody cooks
    assert plugs[hour == 3].mean() == pytest.approx(HOME_STANDBY_KW, rel=0.1)
    by_day = people.groupby(people.index.date).sum()
    assert 0.01 < (by_day == 0).mean() < 0.2  # nobody is there now and then


def test_a_shop_is_open_on_saturdays_and_closed_on_sundays():
    log = make_office(28, pattern="shop", random_state=3)
    hour, day = log.X.index.hour, log.X.index.day_of_week
    lights, people = log.gain_parts["lights"], log.gain_parts["people"]
    assert (people[day == 6] == 0).all()
    assert (lights[day == 6] == 0).all()
    assert (people[(hour < 7) | (hour >= 22)] == 0).all()
    assert lights[(day == 5) & (hour == 12)].min() > 1.0
    assert people[(day == 5) & (hour == 12)].mean() > people[(day == 2) & (hour == 15)].mean()


def test_an_unknown_pattern_is_refused():
    with pytest.raises(ValueError, match="pattern='factory'"):
        make_office(7, pattern="factory")
