"""Experiment design: information against a dense Gaussian, the thermostat against a plain loop, and the verdict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from skhybrid import GrayBoxRC, HybridPredictor, OutputDisturbanceID, RCNetwork
from skhybrid.datasets import make_office, make_prbs, make_weather
from skhybrid.exceptions import UnitWarning
from skhybrid.identification import ExperimentPlan, GainStatistics, plan_experiment
from skhybrid.identification.disturbance_models import HIDDEN_SD, MEASURED_SD
from skhybrid.identification.experiment_design.information import FilterInformation, relative_errors, walk_root
from skhybrid.identification.experiment_design.plan import _Case, _fitted_gain, _make_plan
from skhybrid.identification.experiment_design.zone import Calendar, Zone, draw_gain, run_thermostat
from skhybrid.thermal import building_network, get_network

THETA = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -5.0}
ROLES = ("T_oa", "q_sol", "u_heat", "u_cool")
GAIN = GainStatistics(tau=3.0, weekday_day=0.5, weekday_night=0.2, weekend=0.3, noise_std=0.05)
NUISANCE = ("tau", "weekday_day", "weekday_night", "weekend", "noise_std")
FREE = ("C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_c")
HOURS, N = 0.5, 60


def zone(theta=THETA, gain=GAIN):
    return Zone(get_network("2R2C"), theta, ROLES, gain)


def calendar(n=N, begin=28):
    """Half hours from a Friday 14:00 on."""
    clock = np.arange(begin, begin + n) // 2
    hour, weekend = clock % 24, clock >= 24
    klass = np.where(weekend, 2, np.where((hour >= 6) & (hour < 21), 0, 1))
    return Calendar(klass, hour + 24 * weekend)


def drawn_log(seed=0, n=N):
    rng = np.random.default_rng(seed)
    heat = rng.integers(0, 2, n)
    inputs = [15 + 5 * rng.normal(size=n), rng.uniform(0, 0.5, n), heat, 0.6 * (1 - heat)]
    inputs.append(GAIN.profile.T.ravel()[calendar(n).cell])
    y = 22 + 0.5 * np.cumsum(rng.normal(size=n))
    y[[4, 5, 21]] = np.nan
    return y, np.column_stack(inputs)


def root_of(covariance):
    """(24, 23) root by eigenvectors, in the order and with the signs that ``numpy.linalg.eigh`` gives a cyclic walk."""
    root = walk_root()
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-12)
    return root


def dense(theta, gain, z, inputs, first, base):
    """Mean (N,) and covariance (N, N) of a log, states propagated by a matrix exponential, by plain loops."""
    p = theta
    Ac, Bc = np.zeros((3, 3)), np.zeros((3, 5))
    Ac[0, :2] = np.array([-1, 1]) / (p["C_w"] * p["R_zw"])
    Ac[1, :2] = [1 / (p["C_za"] * p["R_zw"]), -(1 / p["R_zw"] + 1 / p["R_zo"]) / p["C_za"]]
    Bc[0, 1] = (1 - p["f"]) * p["A_win"] / p["C_w"]
    Bc[1] = np.array([1 / p["R_zo"], p["f"] * p["A_win"], p["Q_h"], p["Q_c"], 1.0]) / p["C_za"]
    big = np.zeros((7, 7))
    big[:2, :2], big[:2, 2:] = Ac[:2, :2], Bc[:2]
    step = expm(big * HOURS)
    A = np.zeros((3, 3))
    A[:2, :2], A[:2, 2], A[2, 2] = step[:2, :2], step[:2, 6], np.exp(-HOURS / gain.tau)
    # the profile's prior: a level, and a walk around the day whose steps are independent and sum to nothing
    ring = np.array([[min((i - j) % 24, (j - i) % 24) for i in range(24)] for j in range(24)])
    walk = (24**2 - 1) / (12 * 24) - ring * (24 - ring) / (2 * 24)
    profile = []
    for day, step_sd in enumerate((gain.profile_step, gain.weekend_step)):
        mine = z[24 * day : 24 * day + 24]
        profile.append(3.0 * mine[0] + step_sd * root_of(walk) @ mine[1:])
    profile = np.concatenate(profile)
    clock = calendar(len(inputs))
    m, P = np.array([first, first, 0.0]), np.diag([HIDDEN_SD**2, MEASURED_SD**2, base.sigma[clock.klass[0]] ** 2])
    mean, spread = [], []
    for k, v in enumerate(inputs):
        mean.append(m)
        spread.append(P)
        u = v + np.array([0, 0, 0, 0, profile[clock.cell[k]]])
        m = A @ m + np.append(step[:2, 2:] @ u, 0.0)
        P = A @ P @ A.T
        P[2, 2] += gain.sigma[clock.klass[k]] ** 2 * (1 - A[2, 2] ** 2)
    n = len(inputs)
    Sigma = np.empty((n, n))
    for j in range(n):
        cross = spread[j]
        for i in range(j, n):
            Sigma[i, j] = Sigma[j, i] = cross[1, 1]
            cross = A @ cross
    return np.array(mean)[:, 1], Sigma + gain.noise_std**2 * np.eye(n)


def moved(name, step):
    """Parameters, gain statistics and profile numbers with one unknown moved by ``step`` (in its logarithm)."""
    theta, gain, z = dict(THETA), GAIN, np.zeros(48)
    if isinstance(name, int):
        z[name] = step
    elif name in theta:
        theta[name] *= np.exp(step)
    else:
        gain = replace(gain, **{name: getattr(gain, name) * np.exp(step)})
    return theta, gain, z


UNKNOWNS = (*FREE, *NUISANCE, *range(48))


def test_scores_are_those_of_a_dense_gaussian():
    """Innovations and their variances by conditioning of the stacked Gaussian, differentiated numerically."""
    y, inputs = drawn_log()
    seen = np.isfinite(y)
    pair = np.column_stack([y, y + 1.0]), np.stack([inputs, 1.1 * inputs], axis=1)
    both, dS, S = FilterInformation(zone(), calendar(), HOURS, FREE).scores(*pair)
    de = both[:, 0]
    assert (np.abs(both[seen, 1] - de[seen]).max(axis=0)[: len(FREE)] > 0.01).all()

    def innovations(name, step):
        mean, Sigma = dense(*moved(name, step), inputs, y[0], GAIN)
        L = np.linalg.cholesky(Sigma[np.ix_(seen, seen)])
        return np.diag(L) * np.linalg.solve(L, (y - mean)[seen]), np.diag(L) ** 2

    np.testing.assert_allclose(S[seen], innovations("tau", 0.0)[1], rtol=1e-9)
    for q, name in enumerate(UNKNOWNS):
        (up, S_up), (down, S_down) = innovations(name, 1e-4), innovations(name, -1e-4)
        expected, expected_S = (up - down) / 2e-4, (S_up - S_down) / 2e-4
        if not isinstance(name, int) or name in calendar().cell:
            assert np.abs(expected).max() > 1e-6
        np.testing.assert_allclose(de[seen, q], expected, atol=1e-6 * (1 + np.abs(expected).max()), err_msg=str(name))
        np.testing.assert_allclose(dS[seen, q], expected_S, atol=1e-8, err_msg=str(name))


def test_information_averaged_over_draws_is_fishers():
    """Dense: dmu' Sigma^-1 dmu + tr(Sigma^-1 dSigma Sigma^-1 dSigma) / 2."""
    free, n = ("C_za", "R_zw"), 30
    _, inputs = drawn_log(3, n)
    mean, Sigma = dense(*moved("tau", 0.0), inputs, 22.0, GAIN)
    L = np.linalg.cholesky(Sigma)
    names, slopes = (*free, *NUISANCE), []
    for name in names:
        up, down = dense(*moved(name, 1e-4), inputs, 22.0, GAIN), dense(*moved(name, -1e-4), inputs, 22.0, GAIN)
        slopes.append([np.linalg.solve(L, (up[0] - down[0]) / 2e-4),
                       np.linalg.solve(Sigma, (up[1] - down[1]) / 2e-4)])  # fmt: skip
    expected = np.array([[a[0] @ b[0] + 0.5 * np.trace(a[1] @ b[1]) for b in slopes] for a in slopes])
    information, rng = FilterInformation(zone(), calendar(n), HOURS, free), np.random.default_rng(1)
    y = mean[:, None] + L @ rng.normal(size=(n, 500))
    logs = np.repeat(inputs[:, None], y.shape[1], axis=1)
    found = information.of_logs(y, logs, first=np.full(y.shape[1], 22.0)).mean(axis=0)[: len(names), : len(names)]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.abs(found - expected) / size).max() < 0.1


def test_more_rows_never_worsen_an_error():
    y, inputs = drawn_log(1)
    errors = []
    for n in (20, 30, 45, 60):
        information = FilterInformation(zone(), Calendar(*(c[:n] for c in calendar())), HOURS, FREE)
        errors.append(relative_errors(information.of_logs(y[:n, None], inputs[:n, None])[0], len(FREE)))
    errors = np.array(errors)
    assert np.isfinite(errors).all()
    assert (np.diff(errors, axis=0) < 0).all()


def test_rows_without_a_measurement_tell_nothing():
    y, inputs = drawn_log(2)
    short = FilterInformation(zone(), Calendar(*(c[:45] for c in calendar())), HOURS, FREE).of_logs(
        y[:45, None], inputs[:45, None]
    )
    y[45:] = np.nan
    full = FilterInformation(zone(), calendar(), HOURS, FREE).of_logs(y[:, None], inputs[:, None])
    np.testing.assert_allclose(full, short, rtol=1e-9, atol=1e-12)


# ------------------------------------------------------------------------------------------------------ relative errors
def test_errors_of_a_known_information():
    information = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 16.0]])
    np.testing.assert_allclose(relative_errors(information, 2), np.sqrt(np.diag(np.linalg.inv(information)))[:2])


def test_what_no_row_moves_has_no_finite_error():
    twins = np.array([[1.0, 1.0], [1.0, 1.0]])  # two unknowns of which only the sum is seen
    information = np.zeros((4, 4))
    information[:2, :2], information[2, 2] = twins, 25.0
    np.testing.assert_allclose(relative_errors(information, 4), [np.inf, np.inf, 0.2, np.inf])


# ------------------------------------------------------------------------------------------------------- the thermostat
def plain_thermostat(weather, gain, low, high, hours, hysteresis):
    d = get_network("2R2C").discrete(THETA, ROLES, hours)
    x, heating, cooling, out = np.full(2, (low[0] + high[0]) / 2), False, False, []
    for k, v in enumerate(weather):
        room = x[1]
        heating = bool(room < low[k] + (hysteresis if heating else -hysteresis))
        cooling = bool(not heating and room > high[k] + (-hysteresis if cooling else hysteresis))
        out.append((heating, cooling, room))
        x = d.A @ x + d.B @ [*v[:2], heating, cooling, gain[k]]
    return np.array(out, dtype=float)


def thermostat_case(n=600):
    rng = np.random.default_rng(5)
    weather = np.column_stack([10 + 12 * rng.random(n).cumsum() / n, 0.5 * rng.random(n), np.zeros((n, 2))])
    gain = 2.0 * rng.random(n)
    wanted = make_prbs(4, "1h", duration=f"{5 * n}min", step="5min", low=19, high=25, random_state=0)
    return weather, gain, np.column_stack([wanted - 0.5, wanted + 0.5])


def test_on_off_plant_is_that_of_a_plain_loop():
    weather, gain, levels = thermostat_case()
    still = np.tile([20.0, 26.0], (len(gain), 1))
    run = run_thermostat(
        zone(), weather, np.column_stack([gain, gain]), np.stack([levels, still], axis=2), 1 / 12, hysteresis=0.3
    )
    for case, plan in enumerate((levels, still)):
        expected = plain_thermostat(weather, gain, plan[:, 0], plan[:, 1], 1 / 12, 0.3)
        np.testing.assert_array_equal(run.stages[:, :, case], expected[:, :2])
        np.testing.assert_allclose(run.room[:, case], expected[:, 2], atol=1e-9)
    assert run.stages[:, 0].any()
    assert run.stages[:, 1].any()


def test_a_modulating_plant_holds_the_band_as_far_as_it_reaches():
    weather, gain, levels = thermostat_case()
    run = run_thermostat(zone(), weather, gain[:, None], levels[:, :, None], 1 / 12, hysteresis=None)
    heat, cool, ends = run.stages[:-1, 0, 0], run.stages[:-1, 1, 0], run.room[1:, 0]
    between = (heat > 0) & (heat < 1)
    assert between.any()
    np.testing.assert_allclose(ends[between], levels[:-1][between, 0], atol=1e-9)
    between = (cool > 0) & (cool < 1)
    assert between.any()
    np.testing.assert_allclose(ends[between], levels[:-1][between, 1], atol=1e-9)
    assert (ends[heat == 1] <= levels[:-1][heat == 1, 0] + 1e-9).all()
    assert (heat * cool == 0).all()


def test_drawn_gains_have_the_statistics_asked_for():
    clock, rng = calendar(n=1), np.random.default_rng(0)
    clock = Calendar(np.zeros(40_000, np.int64), np.zeros(40_000, np.int64))
    gain = draw_gain(zone(), clock, HOURS, rng) - GAIN.profile[0, 0]
    assert gain.std() == pytest.approx(GAIN.weekday_day, rel=0.05)
    assert np.corrcoef(gain[1:], gain[:-1])[0, 1] == pytest.approx(np.exp(-HOURS / GAIN.tau), abs=0.01)


# ------------------------------------------------------------------------------------------------------------- the plan
WEATHER = make_weather(8, "chicago", start="2023-10-07", step="30min", random_state=0)
SET_POINTS = pd.DataFrame(
    {"T_heat_set": np.where(WEATHER.index.hour < 6, 15.0, 20.0), "T_cool_set": 25.0}, WEATHER.index
)
PRBS = make_prbs(4, "2h", step="30min", low=18, high=25, random_state=0)
SETTINGS = {"weather": WEATHER, "perturbations": {"prbs": PRBS}, "known": ["Q_h"], "n_draws": 1, "random_state": 0}


@pytest.fixture(scope="module")
def plan():
    return plan_experiment("2R2C", THETA, hours=[12, 36], **SETTINGS)


def test_plan_compares_every_candidate_with_none(plan):
    assert isinstance(plan, ExperimentPlan)
    assert list(plan.table.index) == [("none", 0.0), ("prbs", 12.0), ("prbs", 36.0)]
    assert list(plan.table.columns) == [*FREE, "worst", "worst_error"]
    errors = plan.table[list(FREE)]
    assert (errors.max(axis=1) == plan.table["worst_error"]).all()
    assert (errors.idxmax(axis=1) == plan.table["worst"]).all()
    for name in ("C_w", "C_za", "R_zw", "Q_c"):  # what the perturbation is for
        assert errors[name].is_monotonic_decreasing


def test_plan_is_reproducible_and_averages_draws(plan):
    again = plan_experiment("2R2C", THETA, hours=[12, 36], **SETTINGS)
    pd.testing.assert_frame_equal(plan.table, again.table)
    more = plan_experiment("2R2C", THETA, hours=[12], **{**SETTINGS, "n_draws": 3})
    assert (more.table.loc[("prbs", 12.0), "C_za"] != plan.table.loc[("prbs", 12.0), "C_za"]).all()


def test_verdict_takes_the_shortest_that_suffices():
    cases = [_Case(*c, np.zeros((1, 2))) for c in (("none", 0.0), ("a", 12.0), ("b", 12.0), ("a", 24.0))]
    errors = np.array([[0.5, 0.3], [0.09, 0.02], [0.05, 0.08], [0.01, 0.01]])
    plan = _make_plan(cases, ("C_za", "R_zo"), errors, 0.1)
    assert plan.recommended == plan.best == ("b", 12.0)
    assert plan.obstacles == ()
    assert "12 h of 'b'" in str(plan)
    assert "12 h of &#x27;b&#x27;" in plan._repr_html_()
    assert _make_plan(cases, ("C_za", "R_zo"), errors, 0.6).recommended == ("none", 0.0)
    assert "No perturbation is needed" in str(_make_plan(cases, ("C_za", "R_zo"), errors, 0.6))


def test_verdict_names_the_obstacle_where_no_candidate_suffices():
    cases = [_Case(*c, np.zeros((1, 2))) for c in (("none", 0.0), ("a", 12.0))]
    plan = _make_plan(cases, ("C_za", "R_zo", "f"), np.array([[0.5, 0.6, 0.3], [0.02, 0.2, 0.3]]), 0.1)
    assert plan.recommended is None
    assert plan.best == ("a", 12.0)
    assert plan.obstacles == ("f", "R_zo")
    assert "12 h of 'a', leaves f (30 %), R_zo (20 %)" in str(plan)


def test_a_plant_that_never_runs_is_the_obstacle():
    settings = {**SETTINGS, "perturbations": {"heat": np.full((4, 2), (24.0, 45.0))}}
    cold = plan_experiment("2R2C", THETA, hours=[12], setpoints=(20.0, 45.0), **settings)
    assert np.isinf(cold.table["Q_c"]).all()
    assert np.isfinite(cold.table["C_za"]).all()
    assert cold.recommended is None
    assert cold.obstacles[0] == "Q_c"
    assert "Q_c (not moved by any row)" in str(cold)


def test_perturbation_acts_in_the_allowed_rows_only():
    """Errors with all rows of the weekend allowed by mask and by name agree; with none allowed the plan is refused."""
    weekend = np.asarray(WEATHER.index.day_of_week >= 5)
    by_mask = plan_experiment("2R2C", THETA, hours=[12], when=weekend, **SETTINGS)
    by_name = plan_experiment("2R2C", THETA, hours=[12], when="weekend", **SETTINGS)
    pd.testing.assert_frame_equal(by_mask.table, by_name.table)
    with pytest.raises(ValueError, match=r"73 h of perturbation, but .* leave 72 h"):
        plan_experiment("2R2C", THETA, hours=[73], **SETTINGS)


def test_a_fitted_identification_brings_its_model():
    """Parameters, what was known, and the gain's statistics, root mean square by class."""
    own = {f"sigma_{kind}_{hour:02d}": 0.1 + 0.01 * hour for kind in ("weekday", "weekend") for hour in range(0, 24, 3)}
    own |= {"tau": 3.0, "sigma_y": 0.04, "sigma_profile_weekday": 0.2, "sigma_profile_weekend": 0.1}
    profile = pd.DataFrame({"weekday": np.linspace(0, 1, 24), "weekend": np.full(24, 0.1)})
    fit = SimpleNamespace(
        theta_=pd.Series(THETA), known={"Q_h": 6.0}, network_=get_network("2R2C"), disturbance_=pd.Series(own),
        profile_=profile,
    )  # fmt: skip
    settings = {k: v for k, v in SETTINGS.items() if k != "known"}
    by_fit = plan_experiment(fit, hours=[12], **settings)
    assert "Q_h" not in by_fit.table
    day, night = np.array([0.16, 0.19, 0.22, 0.25, 0.28]), np.array([0.10, 0.13, 0.31])
    rms = [float(np.sqrt(np.mean(v**2))) for v in (day, night, np.concatenate([day, night]))]
    gain = GainStatistics(3.0, *rms, profile.to_numpy(), 0.2, 0.1, 0.04)
    by_hand = plan_experiment("2R2C", THETA, hours=[12], gain=gain, **SETTINGS)
    np.testing.assert_allclose(by_fit.table[list(FREE)].to_numpy(), by_hand.table[list(FREE)].to_numpy(), rtol=1e-6)


def test_the_default_periodic_identification_brings_the_statistics_of_its_gain():
    own = {"tau": 3.0, "sigma_weekday_day": 0.4, "sigma_weekday_night": 0.1, "sigma_weekend": 0.2, "sigma_y": 0.04}
    own |= {"sigma_profile_weekday": 0.3, "sigma_profile_weekend": 0.1}
    fit = SimpleNamespace(disturbance_=pd.Series(own), profile_=pd.DataFrame(np.zeros((24, 2))))
    found = _fitted_gain(fit)
    np.testing.assert_array_equal(found.sigma, [0.4, 0.1, 0.2])
    assert (found.tau, found.profile_step, found.weekend_step, found.noise_std) == (3.0, 0.3, 0.1, 0.04)


def test_an_identification_without_a_gain_state_brings_its_network():
    office = make_office(3, random_state=0)
    fit = OutputDisturbanceID(known={"Q_h": 6.0, "rho_1": 0.95}, n_starts=2, random_state=0).fit(office.X, office.y)
    settings = {k: v for k, v in SETTINGS.items() if k != "known"}
    by_fit = plan_experiment(fit, hours=[12], **settings)
    pd.testing.assert_frame_equal(by_fit.table, plan_experiment("2R2C", dict(fit.theta_), hours=[12], **SETTINGS).table)


def test_a_fitted_identification_reads_the_irradiance_of_its_training():
    """Another facade in the weather is left alone, and so is the sun where none was in the training."""
    office = make_office(3, random_state=0)
    settings = {k: v for k, v in SETTINGS.items() if k != "known"} | {"hours": [12]}
    fit = GrayBoxRC(known={"Q_h": 6.0}, n_starts=1).fit(office.X, office.y)
    more = plan_experiment(fit, **settings | {"weather": WEATHER.assign(q_sol_south=WEATHER["q_sol"])})
    pd.testing.assert_frame_equal(more.table, plan_experiment(fit, **settings).table)
    dark = GrayBoxRC(known={"Q_h": 6.0}, n_starts=1, columns={"q_sol": None}).fit(office.X, office.y)
    assert "A_win" not in plan_experiment(dark, **settings).table


def test_a_plan_from_measured_heat_is_that_with_a_capacity():
    office = make_office(3, random_state=0)
    heat = office.X.assign(Q_hvac=6.0 * (office.X["u_heat"] - office.X["u_cool"])).drop(columns=["u_heat", "u_cool"])
    fit = GrayBoxRC(n_starts=1).fit(heat, office.y)
    with pytest.raises(ValueError, match="add it to theta, also where the heat was measured"):
        plan_experiment(fit, hours=[12], **SETTINGS)
    plan = plan_experiment(fit, {**fit.theta_, "Q_h": 6.0}, hours=[12], **SETTINGS)
    assert np.isfinite(plan.table.loc[("prbs", 12.0), "C_za"]).all()


def test_set_points_of_a_frame_go_by_name():
    named = pd.DataFrame({"T_cool_set": PRBS + 0.5, "T_heat_set": PRBS - 0.5})
    by_name = plan_experiment("2R2C", THETA, hours=[12], **{**SETTINGS, "perturbations": {"prbs": named}})
    pd.testing.assert_frame_equal(by_name.table, plan_experiment("2R2C", THETA, hours=[12], **SETTINGS).table)


def test_a_stage_with_capacities_of_its_own_heats_as_one_that_is_shared():
    """A radiator that heats the air and a floor by 4 and 2 kW, declared as capacities and as a share of 6 kW."""
    known = {name: value for name, value in THETA.items() if name[0] != "Q"}
    shares = {"by_part": {"Q_h_air": "za", "Q_h_floor": "w"}, "by_share": {"za": "g", "w": None}}
    values = {"by_part": {"Q_h_air": 4.0, "Q_h_floor": 2.0}, "by_share": {"Q_h": 6.0, "g": 4.0 / 6.0}}
    tables = {}
    for name, heated in shares.items():
        network = replace(get_network("2R2C"), heated={"u_heat": heated})
        settings = {**SETTINGS, "theta": {**known, **values[name]}, "known": list(values[name])}
        tables[name] = plan_experiment(network, **settings).table[list(known)]
    np.testing.assert_allclose(tables["by_part"], tables["by_share"], rtol=0.02)
    with pytest.raises(ValueError, match=r"no capacity of u_heat or u_cool \(Q_h_air, Q_h_floor\)"):
        plan_experiment(replace(network, heated={"u_heat": shares["by_part"]}), **{**SETTINGS, "theta": known})


def test_several_zones_that_were_identified_are_refused_by_their_network():
    pair = building_network(["north", "south"], [("north", "south")])
    own = {"tau": 3.0, "sigma_weekday_day": 0.4, "sigma_weekday_night": 0.1, "sigma_weekend": 0.2, "sigma_y": 0.04}
    own |= {"sigma_profile_weekday": 0.3, "sigma_profile_weekend": 0.1}
    fit = SimpleNamespace(
        theta_=pd.Series({"R_zo_north": 1.0}),
        known=None,
        network_=pair,
        disturbance_=pd.Series(own),
        profile_=pd.DataFrame(np.zeros((24, 4))),
    )
    with pytest.raises(ValueError, match="network building has several measured or disturbed nodes"):
        plan_experiment(fit, **SETTINGS)


@pytest.mark.parametrize("model", [HybridPredictor(), GrayBoxRC()])
def test_a_model_that_is_not_identified_is_refused(model):
    with pytest.raises(ValueError, match=f"{type(model).__name__} is neither a network nor a fitted identif"):
        plan_experiment(model, **SETTINGS)


BAD = {
    "no theta": ({"theta": None}, "theta is missing"),
    "short theta": ({"theta": {k: v for k, v in THETA.items() if k != "R_zo"}}, "theta lacks R_zo"),
    "unknown theta": ({"theta": {**THETA, "q_c": -5.0}}, "theta names 'q_c', but the parameters are C_w"),
    "no plant": (
        {"theta": {k: v for k, v in THETA.items() if k[0] != "Q"}},
        "no capacity of u_heat or u_cool \\(Q_h, Q_c\\)",
    ),
    "scale": ({"known": []}, "fixes no capacitance"),
    "share known": ({"known": ["f"]}, "fixes no capacitance"),
    "unknown known": ({"known": ["Q_x"]}, "known= names 'Q_x'"),
    "no irradiance": ({"weather": WEATHER[["T_oa"]]}, "no column 'q_sol'"),
    "no stamps": ({"weather": WEATHER.reset_index(drop=True)}, "DatetimeIndex"),
    "uneven": ({"weather": WEATHER.drop(WEATHER.index[5])}, "not evenly spaced"),
    "gap in weather": ({"weather": WEATHER.assign(T_oa=WEATHER["T_oa"].where(WEATHER["T_oa"] > 12))}, "'T_oa' has NaN"),
    "crossed set-points": ({"setpoints": (25.0, 20.0)}, "setpoints must be"),
    "when": ({"when": "sunday"}, "when='sunday'"),
    "short mask": ({"when": np.ones(3, dtype=bool)}, "when has shape"),
    "empty perturbation": ({"perturbations": {"p": []}}, "perturbation 'p'"),
    "target": ({"target": 0.0}, "target=0.0"),
    "target in words": ({"target": "10 %"}, "target='10 %' must be a relative error"),
    "target in percent": ({"target": 9}, "target=9 must be a relative error above 0 and up to 1, such as 0.1 for 10 %"),
    "step": ({"sampling_time": "45min"}, "sampling_time"),
    "no draws": ({"n_draws": 0}, "n_draws=0 must be an integer of at least 1"),
    "half a draw": ({"n_draws": 1.5}, "n_draws=1.5 must be an integer of at least 1"),
    "a seed in words": ({"random_state": "a"}, "random_state='a' must be an integer from 0"),
    "negative seed": ({"random_state": -1}, "random_state=-1 must be an integer from 0"),
    "negative theta": ({"theta": THETA | {"C_za": -1.0}}, "theta gives C_za the value -1"),
    "cooling that heats": ({"theta": THETA | {"Q_c": 6.0}}, "theta gives Q_c the value 6.0; it must be < 0"),
    "absent number": ({"theta": THETA | {"f": np.nan}}, "theta gives f the value nan"),
    "other stamps": ({"setpoints": SET_POINTS[::-1]}, "setpoints has other time stamps than weather"),
    "no columns": ({"setpoints": SET_POINTS[["T_heat_set"]]}, "setpoints must be a pair"),
    "mask of other stamps": ({"when": pd.Series(True, WEATHER.index)[::-1]}, "when has other time stamps"),
    "long mask": ({"when": np.ones(len(WEATHER) + 1, dtype=bool)}, "when has shape"),
    "fill value of set-points": ({"setpoints": SET_POINTS.replace(15.0, -9999.0)}, "setpoints holds -9999 degC"),
    "fill value of levels": ({"perturbations": {"p": [20.0, -9999.0]}}, "perturbation 'p' holds -1e.04 degC"),
    "negative hours": ({"hours": [12, -5]}, "hours has -5; give 0 or a multiple of the step of weather, 0.5 h"),
    "hours in words": ({"hours": "24h"}, "hours has '24h'; give 0 or a multiple"),
    "a duration": ({"hours": pd.Timedelta("24h")}, r"hours has Timedelta\(.*; give 0 or a multiple"),
    "hours off the step": ({"hours": [3.7]}, "hours has 3.7"),
    "all known": ({"known": list(THETA)}, "known= names every parameter"),
    "crossed levels": ({"perturbations": {"p": [[18.0, 25.0], [25.0, 18.0]]}}, "perturbation 'p' has .* in row 1"),
    "negative hysteresis": ({"hysteresis": -0.3}, "hysteresis=-0.3 must be"),
    "absent hysteresis": ({"hysteresis": np.nan}, "hysteresis=nan must be"),
    "no weather": ({"weather": None}, "weather is a NoneType; give a DataFrame"),
    "weather in words": ({"weather": WEATHER.assign(T_oa="mild")}, "column 'T_oa' of weather is not numeric"),
    "true for weather": ({"weather": WEATHER.assign(T_oa=WEATHER["T_oa"] > 12)}, "'T_oa' of weather is true or false"),
    "a column twice": ({"weather": pd.concat([WEATHER, WEATHER[["T_oa"]]], axis=1)}, "weather has 2 columns 'T_oa'"),
    "nameless levels": ({"perturbations": [20.0]}, r"perturbations=\[20.0\] must be a mapping of names"),
    "levels in words": ({"perturbations": {"p": "warm"}}, "perturbation 'p' is text; give numbers"),
    "true for a level": ({"perturbations": {"p": [True, False]}}, "perturbation 'p' is true or false"),
    "set-points in words": ({"setpoints": "warm"}, "setpoints is text; give numbers"),
    "gain": ({"gain": 3.0}, "gain=3.0 must be a GainStatistics"),
    "fill value": ({"weather": WEATHER.assign(T_oa=9999.0)}, "weather column 'T_oa' holds 9999 degC"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_request_is_refused_with_its_name(case):
    change, message = BAD[case]
    with pytest.raises(ValueError, match=message):
        plan_experiment("2R2C", **{"theta": THETA, "hours": [12], **SETTINGS, **change})


def test_hours_may_be_one_number():
    one, several = (plan_experiment("2R2C", THETA, hours=hours, **SETTINGS) for hours in (12, [12]))
    pd.testing.assert_frame_equal(one.table, several.table)


def test_a_perturbation_in_degf_is_told():
    with pytest.warns(UnitWarning, match="perturbation 'prbs' .* likely degF"):
        plan_experiment("2R2C", THETA, hours=[12], **{**SETTINGS, "perturbations": {"prbs": 1.8 * PRBS + 32.0}})


def test_a_network_with_names_of_its_own_is_planned_by_their_units():
    """``mass`` stores and ``wall`` resists heat, whatever letters their names begin with."""
    network = RCNetwork("shed", {"za": "mass"}, {"wall": ("za", "T_oa")}, {"za": None})
    theta, usual = {"A_win": 3.0, "Q_h": 6.0}, {"mass": "C_za", "wall": "R_zo"}
    settings = {**SETTINGS, "hours": [12], "n_draws": 1}
    own = plan_experiment(network, theta | {"mass": 1.0, "wall": 5.0}, **settings | {"known": ["wall"]})
    other = plan_experiment("1R1C", theta | {"C_za": 1.0, "R_zo": 5.0}, **settings | {"known": ["R_zo"]})
    pd.testing.assert_frame_equal(own.table.rename(columns=usual).replace(usual), other.table)


@pytest.mark.parametrize(
    ("field", "value"), [("tau", 0.0), ("weekend", -1.0), ("noise_std", np.nan), ("profile", np.zeros(24))]
)
def test_impossible_gain_is_refused(field, value):
    with pytest.raises(ValueError, match=field):
        GainStatistics(**{field: value})


def test_a_profile_may_be_a_list():
    np.testing.assert_array_equal(GainStatistics(profile=[[0.5, 0.1]] * 24).profile, np.tile([0.5, 0.1], (24, 1)))
