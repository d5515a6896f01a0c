"""Schedule model against plain loops, differences and SciPy: channels, objective, fit, online updating."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import lsq_linear
from sklearn.base import BaseEstimator

from skhybrid._table import ZoneTable, read_table
from skhybrid.datasets import make_office
from skhybrid.filtering import ForecastSample, forecast_sample, hourly_sample, lead_rows
from skhybrid.schedule import NumberedSegment, RollingNetwork, ScheduledNetwork, fit_leads, make_segment
from skhybrid.schedule import fit as schedule_fit
from skhybrid.schedule.channels import GROUPS, known_heat, make_channels, make_plan, with_contrast
from skhybrid.schedule.constrained_ridge import gram, solve_coefficients
from skhybrid.schedule.filter_model import NOISE, FilterModel
from skhybrid.schedule.lead_problem import LeadProblem, ScoredForecasts, Shrinkage, penalty_of
from skhybrid.schedule.plant_model import emitting
from skhybrid.schedule.responses import emitter_series, emitter_slope, error_columns, simulate_responses
from skhybrid.thermal import RCNetwork, get_network

DAY = 48  # rows, at 30 min
N_TRAIN = 8 * DAY


class RolledForecasts(NamedTuple):
    """Forecasts from several origins, and the errors of the history's."""

    paths: np.ndarray  # (n_origins, n_leads) [K from the reference]
    heat: np.ndarray  # (n_origins, n_leads) unmeasured heat over the step of each row ahead [kW]
    errors: np.ndarray  # (O, L) [K], as in RollingNetwork
    states: list  # at each origin


def forecast_from_origins(fit, rows, origins, n_leads, adapt, memory=0):
    """Forecast from each of increasing ``origins`` (rows), by the memory of that index in HALF_LIVES."""
    network = RollingNetwork(fit, rows.begin, adapt)
    paths, heat = np.empty((len(origins), n_leads)), np.empty((len(origins), n_leads))
    states = []
    for i, origin in enumerate(origins):
        network.advance(rows, int(origin))
        paths[i], heat[i] = (of_memories[memory] for of_memories in network.forecast(rows, n_leads))
        states.append(network.state(memory))
    return RolledForecasts(paths, heat, network.errors[..., memory], states)


def slope(function, step):
    """Fourth-order central difference at 0 of a function of one number."""
    f = [np.asarray(function(k * step), dtype=np.float64) for k in (-2, -1, 1, 2)]
    return (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step)


def as_table(X):
    """A frame by roles as the estimators read it."""
    local = X.index if X.index.tz is None else X.index.tz_localize(None)
    utc = X.index if X.index.tz is None else X.index.tz_convert("UTC").tz_localize(None)
    inputs = {role: X[role].to_numpy(dtype=np.float64) for role in X.columns if role != "T_za"}
    return ZoneTable(inputs, {}, X.index, local, utc, utc[1] - utc[0], order=tuple(X.columns))


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=20, sampling_time="30min", random_state=3)


@pytest.fixture(scope="module")
def table(office):
    return as_table(office.X)


@pytest.fixture(scope="module")
def T(office):
    """With half a day missing within the training, and some hours missing after it."""
    y = office.y.to_numpy().copy()
    y[2 * DAY + 5 : 2 * DAY + 29] = np.nan
    y[9 * DAY + 3 : 9 * DAY + 12] = np.nan
    return y


@pytest.fixture(scope="module")
def fit(table, T):
    return fit_leads(get_network("4R3C"), table.rows(slice(N_TRAIN)), T[:N_TRAIN], DAY)


@pytest.fixture(scope="module")
def later(fit, table, T):
    return NumberedSegment(fit.make_segment(table, T), N_TRAIN, joined=True)


# ------------------------------------------------------------------------------------------------------------- model
def test_the_model_and_its_derivatives_by_logarithms():
    model = FilterModel.of(get_network("4R3C"), 0.5, 2.0)
    psi = np.log(np.linspace(0.5, 3.0, len(model.names)))
    M = model.matrices(psi)
    sigma_x, sigma_g, tau = np.exp(psi[-4:-1])
    phi = np.exp(-0.5 / tau)
    n = len(M.A)
    assert M.F[n, n] == pytest.approx(phi)
    np.testing.assert_allclose(M.F[:n, :n], M.A)
    np.testing.assert_allclose(M.F[:n, n], M.B[:, 1 + model.zone])  # the gain enters as any heat into the air does
    np.testing.assert_allclose(np.diag(M.Q), [*[sigma_x**2 * 0.5] * n, sigma_g**2 * (1 - phi**2)])
    leads = np.array([1, 3, 7])
    rows, drows = lead_rows(M.F, M.dF, model.zone, leads)
    for row, lead in zip(rows, leads, strict=True):
        np.testing.assert_allclose(row, np.linalg.matrix_power(M.F, lead)[model.zone], atol=1e-12)
    for q, unit in enumerate(np.eye(len(psi))):
        for name in "ABFQ":
            numeric = slope(lambda h, u=unit, name=name: getattr(model.matrices(psi + h * u), name), 1e-3)
            np.testing.assert_allclose(getattr(M, "d" + name)[..., q], numeric, atol=1e-8)
        numeric = slope(lambda h, u=unit: lead_rows(model.matrices(psi + h * u).F, M.dF, model.zone, leads)[0], 1e-3)
        np.testing.assert_allclose(drows[..., q], numeric, atol=1e-8)
    bare = model.matrices(psi, slopes=False)
    for name in ("A", "B", "F", "Q", "P0"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(M, name))
    assert [getattr(bare, name).shape[-1] for name in ("dA", "dB", "dF", "dQ")] == [0] * 4


def test_a_steady_kilowatt_warms_every_node_by_its_resistance():
    """Closed form: in the long run heat leaves through the resistances to the outside only."""
    model = FilterModel.of(get_network("1R1C"), 1.0, 1.0)
    M = model.matrices(np.log([2.0, 5.0, 0.1, 0.1, 1.0, 1.0]))
    assert model.names[:2] == ("C_za", "R_zo")
    np.testing.assert_allclose(np.linalg.solve(np.eye(1) - M.A, M.B), [[1.0, 5.0]], rtol=1e-10)


WALLED = {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}, {"za": "f", "w": None}


@pytest.mark.parametrize("own", [{"bounds": {"f": (0.1, 0.9)}}, {"zones": {"room": ("w", "za")}}], ids=str)
def test_bounds_of_a_share_and_a_named_zone_do_no_harm(own):
    """The model's own network has no sources, and every node of it is disturbed."""
    psi = np.linspace(0.1, 0.8, 8)
    plain, found = (FilterModel.of(RCNetwork("own", *WALLED, **with_own), 0.5, 1.0) for with_own in ({}, own))
    np.testing.assert_array_equal(found.matrices(psi).F, plain.matrices(psi).F)


# ---------------------------------------------------------------------------------------------------------- channels
@pytest.mark.parametrize(
    ("field", "nodes"),
    [
        ("heated", {"u_heat": "w", "u_cool": "za"}),
        ("heated", {"w": "f_h", "za": None}),
        ("disturbed", ("w", "za")),
    ],
    ids=str,
)
def test_several_heated_or_disturbed_nodes_are_refused(table, field, nodes):
    """All known heat is one series, and all unmeasured heat another."""
    network = RCNetwork("odd", *WALLED, **{field: nodes})
    with pytest.raises(ValueError, match=f"network odd has the {field} nodes 'w', 'za', but .* takes one"):
        make_plan(network, table, {"Q_h": 6.0}, calendar=True)


@pytest.mark.parametrize("heated", ["w", {"u_heat": "w", "u_cool": "w"}, ("w",)], ids=str)
def test_the_heated_node_in_each_form(table, heated):
    plan = make_plan(RCNetwork("own", *WALLED, heated=heated), table, {"Q_h": 6.0}, calendar=True)
    assert (plan.heated, plan.zone) == (0, 1)


def test_lag_of_an_emitter():
    rng = np.random.default_rng(0)
    heat, step, tau = rng.uniform(0, 3, 50), 0.5, 2.0
    z, expected = heat[0], np.empty(50)
    for k in range(50):
        expected[k] = z - heat[k]
        z += (1.0 - np.exp(-step / tau)) * (heat[k] - z)
    found = emitter_series(heat, step, tau)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    numeric = slope(lambda h: emitter_series(heat, step, tau * np.exp(h)), 1e-3)
    np.testing.assert_allclose(emitter_slope(found, step, tau), numeric, atol=1e-8)


def test_all_heat_of_an_emitter_arrives_in_the_end():
    """Closed form: a steady kW warms the nodes as it does without an emitter, which then gives what it takes."""
    model = FilterModel.of(get_network("2R2C"), 1.0, 1.0)
    psi = np.append(np.zeros(len(model.names) - 1), np.log(0.5))
    fit = SimpleNamespace(plan=SimpleNamespace(emitter=True, heated=1), model=model)
    state = SimpleNamespace(matrices=model.matrices(psi), coef=np.array([0.3, 0.6]), psi=psi)
    A, effect = emitting(fit, state)
    n = len(state.matrices.A)
    steady = np.linalg.solve(np.eye(n) - state.matrices.A, state.matrices.of_heat[:, 1])
    np.testing.assert_allclose(np.linalg.solve(np.eye(n + 1) - A, effect), np.append(steady, 1.0), rtol=1e-10)


def test_names_groups_and_places_of_the_channels(table):
    plan = make_plan(get_network("4R3C"), table, {}, calendar=True)
    channels = make_channels(plan, table)
    group = pd.Series([GROUPS[g] for g in channels.group], channels.names)
    node = pd.Series([plan.network.nodes[i] for i in channels.node], channels.names)
    kinds = {"gain_hour": "gain_hour_", "gain_day_type": "gain_day_type_", "ua_day_type": "ua_day_type_"}
    for kind, start in kinds.items():
        assert list(group.index[group == kind]) == [f"{start}{h}" for h in range(24)]
    assert list(group.index[group == "ua_hour"]) == ["ua", *(f"ua_hour_{h}" for h in range(24))]
    assert group["gain"] == group["u_cool"] == "free"
    zone = plan.network.measured_nodes[0]
    assert (node[[n for n in node.index if n.startswith(("gain", "ua", "u_"))]] == zone).all()
    sun = [f"q_sol_{part}->{n}" for part in ("morning", "noon", "afternoon") for n in plan.network.nodes]
    assert list(channels.names[: len(sun)]) == sun
    assert [n.split("->")[1] for n in sun] == list(node[sun])
    positive = {name for name, p in zip(channels.names, channels.positive, strict=True) if p}
    assert positive == {*sun, "u_cool"}
    own = dict(zip(channels.names, channels.series.T, strict=True))
    np.testing.assert_array_equal(own["u_cool"], -table.inputs["u_cool"])
    away = (table.inputs["T_oa"] - table.inputs["T_oa"].mean()) / 10.0
    np.testing.assert_allclose(own["ua"], away, atol=1e-12)
    np.testing.assert_allclose(sum(own[f"ua_hour_{h}"] for h in range(24)), away, atol=1e-12)


def test_a_swapped_day_is_one_of_the_other_type(table):
    """With every day swapped the schedules are those of a calendar whose weekends and weekdays have changed places."""
    rng, plan = np.random.default_rng(0), make_plan(get_network("4R3C"), table, {}, calendar=True)
    names = make_channels(plan, table).names
    coef = dict(zip(names, rng.normal(size=len(names)), strict=True))
    plan = with_contrast(plan, names, np.array(list(coef.values())))
    channels = make_channels(plan, table)
    assert channels.names[: len(names)] == names
    days = table.time.day_of_week.to_numpy()
    for d in range(7):
        own = channels.series[:, channels.names.index(f"gain_swapped_{d}")]
        for row in (5, 3 * DAY + 17, 5 * DAY + 20, 9 * DAY + 1):
            stamp, expected = table.time[row], 0.0
            if stamp.day_of_week == d:
                swing = 2.0 if d < 5 else -2.0  # of the contrast, which is +1 on weekends
                away = (table.inputs["T_oa"][row] - table.inputs["T_oa"].mean()) / 10.0
                expected = swing * (coef[f"gain_day_type_{stamp.hour}"] + coef[f"ua_day_type_{stamp.hour}"] * away)
            assert own[row] == pytest.approx(expected, abs=1e-12)
        assert own[days == d].any()
    flat = with_contrast(plan._replace(contrast=()), names, np.zeros(len(names)))
    assert make_channels(flat, table).names == names


def test_a_weekend_that_moves_is_learned_by_its_days():
    """Closed on Fridays and Saturdays from the fourth week on: Fridays and Sundays are swapped, the others are not."""
    office = make_office(n_days=35, sampling_time="30min", random_state=5)
    X, at = office.X, 21 * DAY
    early = X.set_axis(X.index - pd.Timedelta("1D"))  # the same days, a day earlier on the calendar
    moved = pd.concat([X[:at], early[early.index >= X.index[at]]])
    table, T = as_table(moved), moved["T_za"].to_numpy()
    fit = fit_leads(get_network("4R3C"), table.rows(slice(at)), T[:at], DAY)
    assert len(fit.plan.contrast) == 2
    swapped = [f"gain_swapped_{d}" for d in range(7)]
    before = pd.Series(fit.coef[: len(fit.channel_names)], fit.channel_names)[swapped]
    assert before.abs().max() < 0.15
    later = NumberedSegment(fit.make_segment(table, T), at, joined=True)
    last = np.array([len(T) - 1])
    coef = forecast_from_origins(fit, later, last, 1, "linear").states[0].coef
    after = pd.Series(coef[: len(fit.channel_names)], fit.channel_names)[swapped].to_numpy() - before
    assert set(after.nlargest(2).index) == {"gain_swapped_4", "gain_swapped_6"}
    assert after.nlargest(2).min() > 0.15
    assert after.nsmallest(5).max() < 0.1


def test_without_a_calendar_there_are_levels_only(table):
    plan = make_plan(get_network("4R3C"), table, {}, calendar=False)
    names = make_channels(plan, table).names
    assert [n for n in names if n.startswith(("gain", "ua"))] == ["gain", "ua"]


def test_schedules_follow_the_clock_on_the_wall():
    """Across the end of daylight saving, where the hour that begins at 2 comes twice."""
    stamps = pd.date_range("2023-10-27", periods=5 * 24 + 1, freq="1h", tz="Europe/Berlin")  # Friday ... Tuesday
    X = pd.DataFrame({"T_oa": 10.0, "Q_hvac": 0.0}, stamps)
    table = as_table(X)
    channels = make_channels(make_plan(get_network("4R3C"), table, {}, calendar=True), table)
    own = dict(zip(channels.names, channels.series.T, strict=True))
    for row, stamp in enumerate(stamps):
        sign = 1.0 if stamp.day_name() in ("Saturday", "Sunday") else -1.0
        for hour in range(24):
            here = float(stamp.hour == hour)
            assert own[f"gain_hour_{hour}"][row] == here
            assert own[f"gain_day_type_{hour}"][row] == sign * here
    assert own["gain_hour_2"].sum() == 6


def test_parts_of_the_day_lie_around_the_suns_noon():
    """A site whose sun is highest at 13:00 by its clock."""
    stamps = pd.date_range("2023-06-01", periods=4 * 48, freq="30min")
    hour = np.asarray(stamps.hour + stamps.minute / 60.0)
    X = pd.DataFrame({"T_oa": 10.0, "q_sol": np.maximum(np.cos((hour - 13.0) * np.pi / 15.0), 0.0)}, stamps)
    table = as_table(X)
    plan = make_plan(get_network("4R3C"), table, {}, calendar=False)
    assert plan.noon == pytest.approx(13.0, abs=1e-6)
    channels, own = make_channels(plan, table), {}
    for name, series in zip(channels.names, channels.series.T, strict=True):
        own.setdefault(name.split("->")[0], series)
    for part, centre in (("morning", 9.5), ("noon", 13.0), ("afternoon", 16.5)):
        tent = np.maximum(1.0 - np.abs(hour - centre) / 3.5, 0.0)
        np.testing.assert_allclose(own[f"q_sol_{part}"], X["q_sol"] * tent, atol=1e-9)
    inside = np.abs(hour - 13.0) <= 3.5
    total = own["q_sol_morning"] + own["q_sol_noon"] + own["q_sol_afternoon"]
    np.testing.assert_allclose(total[inside], X["q_sol"][inside], atol=1e-9)


def test_facades_are_taken_as_they_are(table):
    inputs = {"T_oa": table.inputs["T_oa"], "q_sol_E": table.inputs["q_sol"], "q_sol_W": 2.0 * table.inputs["q_sol"]}
    facades = table.replace(inputs=inputs)
    channels = make_channels(make_plan(get_network("4R3C"), facades, {}, calendar=False), facades)
    nodes = get_network("4R3C").nodes
    sun = [name for name in channels.names if name.startswith("q_sol")]
    assert sun == [f"q_sol_{side}->{node}" for side in "EW" for node in nodes]
    for name, series in zip(channels.names, channels.series.T, strict=True):
        if name.startswith("q_sol"):
            np.testing.assert_array_equal(series, inputs[name.split("->")[0]])


def test_a_plan_for_measured_heat(table):
    inputs = {
        "T_oa": table.inputs["T_oa"],
        "Q_hvac": 5.0 * table.inputs["u_heat"],
        "Q_fan": 0.1 * np.ones(table.n_rows),
    }
    measured = table.replace(inputs=inputs)
    plan = make_plan(get_network("4R3C"), measured, {}, calendar=False)
    assert plan.stages == plan.knots == ()
    np.testing.assert_allclose(known_heat(plan, measured), inputs["Q_hvac"] + 0.1, atol=1e-12)
    assert not any(n.startswith(("u_", "Q_")) for n in make_channels(plan, measured).names)


def test_a_plan_for_a_given_capacity(table):
    plan = make_plan(get_network("4R3C"), table, {"Q_h": 4.0}, calendar=False)
    assert plan.known == (("u_heat", 4.0),)
    assert plan.stages == (("u_cool", -1.0),)
    np.testing.assert_allclose(known_heat(plan, table), 4.0 * table.inputs["u_heat"])
    both = make_plan(get_network("4R3C"), table, {"Q_h": 4.0, "Q_c": -3.0}, calendar=False)
    np.testing.assert_allclose(known_heat(both, table), 4.0 * table.inputs["u_heat"] - 3.0 * table.inputs["u_cool"])
    assert both.stages == ()


def test_a_plan_for_cooling_only(table):
    """Also where a heating column never moves: the scale is fixed by what runs."""
    cooling = table.replace(inputs={k: v for k, v in table.inputs.items() if k != "u_heat"})
    idle = table.replace(inputs=table.inputs | {"u_heat": np.zeros(table.n_rows)})
    for one in (cooling, idle):
        plan = make_plan(get_network("4R3C"), one, {}, calendar=False)
        assert plan.known == (("u_cool", -6.0),)
        np.testing.assert_allclose(known_heat(plan, one), -6.0 * table.inputs["u_cool"])


def test_a_plan_without_a_plant(table):
    bare = table.replace(inputs={"T_oa": table.inputs["T_oa"]})
    plan = make_plan(get_network("4R3C"), bare, {}, calendar=False)
    assert not plan.emitter
    assert make_channels(plan, bare).names == ("gain", "ua")
    assert not known_heat(plan, bare).any()


# ------------------------------------------------------------------------------------------------------ coefficients
@pytest.mark.parametrize("seed", range(5))
def test_coefficients_solve_the_bounded_ridge(seed):
    rng = np.random.default_rng(seed)
    E, penalty = rng.normal(size=(60, 13)) * 3.0, rng.uniform(0.1, 2.0, 12)
    E[:, -1] += E[:, :-1] @ rng.normal(size=12)
    positive = rng.uniform(size=12) < 0.6
    design = np.vstack([E[:, :-1], np.diag(np.sqrt(penalty))])
    target = np.append(E[:, -1], np.zeros(12))
    lowest = np.where(positive, 0.0, -np.inf)
    truth = lsq_linear(design, target, (lowest, np.inf), method="bvls", tol=1e-14)
    found = solve_coefficients(gram(E), penalty, positive)
    assert (truth.active_mask < 0).any()  # a bound does hold something
    np.testing.assert_allclose(found.coef, truth.x, atol=1e-7)
    np.testing.assert_array_equal(found.free, truth.active_mask == 0)
    assert found.loss == pytest.approx(truth.cost, rel=1e-9)


# --------------------------------------------------------------------------------------------------------- objective
def lagging_problem(table, network="2R2C", n_rows=6 * DAY, shrinkage=None):
    """A segment whose temperature was made by a network with an emitter that delays 60 %, with gaps."""
    network, part = get_network(network), table.rows(slice(n_rows))
    plan = make_plan(network, part, {}, calendar=True)
    model = FilterModel.of(network, 0.5, 2.0)
    psi = np.log([*[3.0] * len(network.capacitances), *[2.0] * len(network.resistors), 0.05, 0.5, 6.0, 1.5])
    M, channels = model.matrices(psi), make_channels(plan, part)
    heat = known_heat(plan, part)
    lag = emitter_series(heat, 0.5, 1.5)
    rng = np.random.default_rng(0)
    x, T = np.zeros(len(M.A)), np.empty(n_rows)
    for k in range(n_rows):
        T[k] = 20.0 + x[model.zone] + rng.normal(0.0, 0.03)
        air = heat[k] + 0.6 * lag[k] + 0.3 * (channels.series[k, channels.names.index("gain_hour_9")] > 0)
        x = M.A @ x + M.B[:, 0] * (part.inputs["T_oa"][k] - 20.0) + M.B[:, 1 + plan.heated] * air
    T[50:70], T[200] = np.nan, np.nan
    segment = make_segment(plan, part, T, 20.0)
    sample = ForecastSample(np.arange(30, n_rows - 1, 3), np.array([1, 4, 12, 40]))
    precision = np.array([4.0, 3.0, 2.0, 1.0])
    parts = (
        ScoredForecasts(segment, sample),
        ScoredForecasts(segment.between(0, 150), ForecastSample(np.arange(60, 140, 7), sample.leads), 2.0),
    )
    return LeadProblem(model, parts, psi + 0.1, precision, shrinkage or Shrinkage()), psi


def test_the_objective_is_that_of_weighted_forecast_errors(table):
    """Loss from the forecasts themselves, with the weights written out."""
    problem, psi = lagging_problem(table)
    point, loss = problem.evaluate(psi), 0.0
    for part, count in zip(problem.forecasts, (1.5 / 8.0, 2.0 * 3.5 / 8.0), strict=True):
        ones = np.ones((len(part.sample.origins), 4))
        rows = part.sample.origins[:, None] + part.sample.leads
        ones[rows >= part.segment.n_rows] = 0.0
        found = simulate_responses(problem.model, psi, part.segment, part.sample.origins)
        E = error_columns(problem.model, found, part.sample, ones)
        e = (E[:, -1] - E[:, :-1] @ point.solution.coef).reshape(ones.shape)
        for (o, h), error in np.ndenumerate(e):
            if rows[o, h] < part.segment.n_rows and part.segment.seen[rows[o, h]]:
                loss += 0.5 * error**2 * problem.precision[h] * count / 4.0
    loss += 0.5 * np.sum(problem.penalty * point.solution.coef**2) + 0.5 * np.sum(((psi - problem.centre) / 1.2) ** 2)
    assert point.loss == pytest.approx(loss, rel=1e-8)


def test_a_single_origin_counts_as_it_will_among_hourly_ones(table):
    problem, _ = lagging_problem(table)
    scored = problem.forecasts[0]
    first, few = scored.sample.origins[0], scored._replace(weight=1.0)
    alone, hourly = (few._replace(sample=scored.sample._replace(origins=first + 2 * np.arange(n))) for n in (1, 5))
    np.testing.assert_array_equal(problem.root_weights(alone)[0], problem.root_weights(hourly)[0])


@pytest.mark.parametrize("network", ["2R2C", "4R3C"])
def test_the_gradient_is_exact(table, network):
    problem, psi = lagging_problem(table, network)
    psi = psi + np.random.default_rng(1).normal(0.0, 0.05, len(psi))
    point = problem.evaluate(psi)
    assert point.solution.coef[-1] > 0.1  # the emitter's
    g, H = problem.slopes(point)
    numeric = [slope(lambda h, u=u: problem.evaluate(psi + h * u).loss, 2e-3) for u in np.eye(len(psi))]
    np.testing.assert_allclose(g, numeric, rtol=1e-5, atol=1e-6 * np.abs(g).max())
    assert np.linalg.eigvalsh(H).min() > 0


def test_the_hessian_is_that_of_the_projected_residuals(table):
    """Gauss-Newton by hand: derivatives at fixed coefficients, less what the free coefficients can take up."""
    problem, psi = lagging_problem(table)
    point = problem.evaluate(psi)
    coef, free = point.solution.coef, point.solution.free

    def residuals(t):
        E = np.vstack([problem.design(t, part) for part in problem.forecasts])
        return np.concatenate([E[:, -1] - E[:, :-1] @ coef, -np.sqrt(problem.penalty) * coef])

    J = np.column_stack([slope(lambda h, u=u: residuals(psi + h * u), 1e-3) for u in np.eye(len(psi))])
    D = np.vstack([*point.designs, np.zeros((0, len(coef) + 1))])[:, :-1]
    D = np.vstack([D, np.diag(np.sqrt(problem.penalty))])[:, free]
    rest = J - D @ np.linalg.lstsq(D, J, rcond=None)[0]
    H = rest.T @ rest + np.eye(len(psi)) / 1.2**2
    np.testing.assert_allclose(problem.slopes(point)[1], H, rtol=1e-5, atol=1e-6 * np.abs(H).max())


def test_penalties_are_in_units_of_the_heat(table):
    problem, _ = lagging_problem(table, shrinkage=Shrinkage(0.5, 2.0, 3.0))
    names = problem.forecasts[0].segment.channels.names
    penalty = dict(zip(names, penalty_of(problem.forecasts[0].segment, problem.shrinkage, 2.0), strict=False))
    assert penalty["gain_hour_3"] == pytest.approx(0.5 / 4.0)
    assert penalty["gain_day_type_3"] == pytest.approx(1.5 / 4.0)
    assert penalty["ua"] == penalty["ua_hour_3"] == pytest.approx(2.0 / 4.0)
    assert penalty["ua_day_type_3"] == pytest.approx(6.0 / 4.0)
    assert penalty["q_sol_noon->za"] == pytest.approx(1e-3 / 100.0)


# ------------------------------------------------------------------------------------------------------------ fitting
def test_hourly_origins_and_shares_of_the_horizon():
    sample = hourly_sample(1000, 96, 0.25, 96)
    assert sample.origins[0] == 96
    assert (np.diff(sample.origins) == 4).all()
    assert sample.origins[-1] < 999
    assert list(sample.leads) == [1, 2, 4, 6, 8, 12, 16, 20, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96]
    assert hourly_sample(998, 96, 0.25, 96).origins[-1] == 996
    short = hourly_sample(5, 96, 0.25, 96)
    assert list(short.leads) == [1, 2]


def test_a_fit_takes_every_second_of_many_leads():
    many, few = hourly_sample(1500, 96, 0.25, 96), hourly_sample(1400, 96, 0.25, 96)
    assert (many.stride, few.stride) == (2, 1)
    assert list(many.main_leads) == [2, 6, 12, 20, 32, 48, 64, 80, 96]
    assert list(few.main_leads) == list(few.leads)


@pytest.mark.slow
@pytest.mark.parametrize("purpose", ["forecast", "plan"])
def test_the_network_of_a_long_training_is_searched_at_half_of_the_leads(monkeypatch, purpose):
    """Not with a gain to learn; coefficients and left-out errors are those of all forecasts."""
    office, searched = make_office(n_days=21, sampling_time="1h", random_state=1), []
    table = read_table(BaseEstimator(), office.X, reset=True)

    def fitted():
        return fit_leads(get_network("2R2C"), table, office.y.to_numpy(), 24, {"Q_h": 6.0}, purpose=purpose)

    def recorded(problem, *args, **kwargs):
        searched.append(problem.forecasts[0].sample)
        return minimise(problem, *args, **kwargs)

    minimise = schedule_fit.minimise
    monkeypatch.setattr(schedule_fit, "minimise", recorded)
    half = fitted()
    monkeypatch.setattr(forecast_sample, "_MANY", np.inf)
    whole = fitted()
    n_searched = [len(sample.leads) for sample in searched if len(sample.leads) > 1]  # but for those over an hour
    assert len(n_searched) == 4
    assert n_searched[0] == -(-n_searched[2] // (2 if purpose == "forecast" else 1))
    np.testing.assert_array_equal(half.sample.origins, whole.sample.origins)
    np.testing.assert_array_equal(half.sample.leads, whole.sample.leads)
    assert len(half.problem.precision) == len(half.sample.leads)
    spread = [np.sqrt(np.nanmean(fit.left_out**2)) for fit in (half, whole)]
    assert spread[0] == pytest.approx(spread[1], rel=0.02 if purpose == "forecast" else 1e-12)


def test_a_fit_improves_on_its_start_and_shows_what_it_found(fit):
    start = fit.problem.evaluate(fit.problem.centre)
    assert fit.problem.evaluate(fit.psi).loss < start.loss
    np.testing.assert_allclose(fit.gram, gram(fit.problem.design(fit.psi, fit.problem.forecasts[0])), rtol=1e-12)
    shown = ScheduledNetwork.of(fit)
    assert list(shown.theta_.index) == list(fit.model.names[:-4])
    np.testing.assert_allclose([*shown.theta_, *shown.disturbance_], np.exp(fit.psi))
    assert (shown.coef_[[n for n in shown.coef_.index if n.startswith("q_sol")]] >= 0).all()


def test_a_fit_without_rows_gets_them_back_from_its_table(fit, table, T):
    """Bit by bit, and without them it is small."""
    saved = fit.without_rows()
    assert saved.segment.n_rows == 0
    assert saved.plan == fit.plan
    assert saved.channel_names == fit.channel_names
    again = saved.with_rows(saved.make_segment(table.rows(slice(N_TRAIN)), T[:N_TRAIN]))
    for mine, its in zip(again.segment, fit.segment, strict=True):
        if isinstance(its, np.ndarray):
            np.testing.assert_array_equal(mine, its)
    np.testing.assert_array_equal(again.segment.channels.series, fit.segment.channels.series)
    np.testing.assert_array_equal(again.problem.evaluate(again.psi).gram, fit.problem.evaluate(fit.psi).gram)
    assert len(pickle.dumps(saved)) < 0.4 * len(pickle.dumps(fit))


def test_the_schedule_is_the_mean_heat_of_its_days(fit):
    """Of a week at one outdoor temperature, and of one at another."""
    shown, mean = ScheduledNetwork.of(fit), fit.plan.mean_outdoor
    stamps = pd.date_range("2024-01-01", periods=7 * DAY, freq="30min")
    for away in (0.0, -7.0):
        X = pd.DataFrame({"T_oa": mean + away, "q_sol": 0.0, "u_heat": 0.0, "u_cool": 0.0}, stamps)
        heat = shown.heat_at(as_table(X))
        for day, days in (("weekday", range(5)), ("weekend", (5, 6))):
            for hour in (0, 7, 15, 23):
                gain, ua = shown.schedule_.loc[(day, hour)]
                of_hour = [heat.iloc[d * DAY + 2 * hour] for d in days]
                assert np.mean(of_hour) == pytest.approx(gain + ua * away, abs=1e-10)
    assert np.ptp([heat.iloc[d * DAY + 20] for d in range(5)]) > 0  # no two days are quite alike


def test_left_out_errors_are_by_coefficients_without_the_block(fit):
    part, E = fit.problem.forecasts[0], fit.problem.design(fit.psi, fit.problem.forecasts[0])
    blocks = np.repeat(fit.blocks, len(part.sample.leads))
    assert len(np.unique(blocks)) >= 3
    penalty = np.diag(np.sqrt(fit.problem.penalty))
    lowest = np.where(fit.problem.positive, 0.0, -np.inf)
    root = fit.problem.root_weights(part)
    origins = np.repeat(part.sample.origins, len(part.sample.leads))
    for block in np.unique(blocks)[:2]:
        begin = origins[blocks == block].min()
        # of an origin just before the block all leads are left out, as the longest ends in it
        into = (origins < begin) & (origins + part.sample.leads[-1] > begin)
        rest = E[(blocks != block) & ~into]
        design, target = np.vstack([rest[:, :-1], penalty]), np.append(rest[:, -1], np.zeros(len(penalty)))
        coef = lsq_linear(design, target, (lowest, np.inf), method="bvls", tol=1e-14).x
        e = (E[:, -1] - E[:, :-1] @ coef).reshape(root.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            expected = np.where(root > 0, e / root, np.nan)[fit.blocks == block]
        np.testing.assert_allclose(fit.left_out[fit.blocks == block], expected, atol=1e-5)


# --------------------------------------------------------------------------------------------- forecasts and learning
def brute_force(fit, psi, coef, segment, origin, n_leads):
    """Everything in one state space: Kalman's filter on temperatures and gain, then the network runs free.

    Returns the path, and the gain at the origin.
    """
    M, model, channels = fit.model.matrices(psi), fit.model, segment.channels
    n = len(M.A)
    heat = np.zeros((segment.n_rows, n))
    for j, node in enumerate(channels.node):
        heat[:, node] += coef[j] * channels.series[:, j]
    z = segment.heat[0]
    for k in range(segment.n_rows):
        heat[k, segment.plan.heated] += segment.heat[k] + coef[-1] * (z - segment.heat[k])
        z += (1.0 - np.exp(-model.step / np.exp(psi[-1]))) * (segment.heat[k] - z)
    v = np.hstack([segment.boundary, heat]) @ M.B.T
    x, P, c = np.zeros(n + 1), M.P0, np.eye(n + 1)[model.zone]
    for k in range(origin + 1):
        if k:
            x, P = M.F @ x, M.F @ P @ M.F.T + M.Q
            x[:n] += v[k - 1]
        if segment.seen[k]:
            gain = P @ c / (c @ P @ c + NOISE**2)
            x, P = x + gain * (segment.y[k] - x[model.zone]), P - np.outer(gain, c @ P)
    path, gain_at_origin = np.empty(n_leads), x[n]
    for h in range(n_leads):
        x = M.F @ x
        x[:n] += v[origin + h]
        path[h] = x[model.zone]
    return path, gain_at_origin


@pytest.mark.parametrize("origin", [0, N_TRAIN - 1, 9 * DAY + 5, 12 * DAY + 7], ids=["first", "seam", "gap", "later"])
def test_forecasts_are_those_of_the_whole_state_space(fit, later, origin):
    found = forecast_from_origins(fit, later, np.array([origin]), DAY, None)
    coef = fit.coef
    expected, _ = brute_force(fit, fit.psi, coef, later.segment, origin, DAY)
    np.testing.assert_allclose(found.paths[0], expected, atol=1e-7)
    assert not len(found.errors)


def test_the_unmeasured_heat_of_a_forecast_is_schedule_and_filtered_gain(fit, later, table):
    """The filter's gain decays from the origin on; far ahead the schedule is left."""
    origin = 10 * DAY
    found = forecast_from_origins(fit, later, np.array([origin]), 4 * DAY, None)
    shown = ScheduledNetwork.of(fit)
    planned = shown.heat_at(table).to_numpy()[origin + 1 : origin + 1 + 4 * DAY]
    _, gain_at_origin = brute_force(fit, fit.psi, fit.coef, later.segment, origin, 1)
    assert abs(gain_at_origin) > 1e-3
    fading = np.exp(-0.5 / shown.disturbance_["tau_g"]) ** np.arange(1, 4 * DAY + 1)
    np.testing.assert_allclose(found.heat[0], planned + gain_at_origin * fading, atol=1e-9)


def history(later, origins, leads, every=2):
    return ForecastSample(np.arange(later.begin, max(later.begin, int(origins[-1])), every), leads)


@pytest.mark.parametrize(("memory", "days"), [(0, 30.0), (1, 7.0)], ids=["long", "short"])
def test_linear_adaptation_is_a_direct_solve(fit, later, memory, days):
    """Training forecasts, and three times those of the history that had ended by the origin, halved per half-life."""
    leads = fit.sample.leads
    origins = np.array([N_TRAIN, N_TRAIN + 30, 10 * DAY + 3])
    sample = history(later, origins, leads)
    found = forecast_from_origins(fit, later, origins, DAY, "linear", memory)
    problem, psi, segment = fit.problem, fit.psi, later.segment
    training = problem.design(psi, problem.forecasts[0])
    rows = sample.origins[:, None] + leads
    responses = simulate_responses(fit.model, psi, segment, sample.origins)
    E = error_columns(fit.model, responses, sample, (rows < segment.n_rows).astype(float))
    penalty, lowest = np.diag(np.sqrt(problem.penalty)), np.where(problem.positive, 0.0, -np.inf)
    weight = np.sqrt(3.0 * problem.precision * (1.0 / 8.0) / len(leads))  # hourly origins of which eight hours overlap
    for i, origin in enumerate(origins):
        use = (rows <= origin) & segment.seen[np.minimum(rows, segment.n_rows - 1)]
        fade = 0.5 ** ((origin - rows) / (days * DAY) / 2.0)
        own = (E.reshape(*rows.shape, -1) * weight[:, None] * fade[..., None])[use]
        old = 0.5 ** ((origin - later.begin) / (days * DAY) / 2.0)
        design = np.vstack([old * training, own])
        matrix, target = np.vstack([design[:, :-1], penalty]), np.append(design[:, -1], np.zeros(len(penalty)))
        coef = lsq_linear(matrix, target, (lowest, np.inf), method="bvls", tol=1e-14).x
        np.testing.assert_allclose(found.states[i].coef, coef, atol=1e-5 * np.abs(coef).max())
        expected, _ = brute_force(fit, psi, found.states[i].coef, segment, origin, DAY)
        np.testing.assert_allclose(found.paths[i], expected, atol=1e-7)
    assert not np.allclose(found.states[0].coef, found.states[2].coef, atol=1e-3)


@pytest.mark.parametrize(("adapt", "memory"), [("linear", 0), ("full", 0), ("full", 1)])
def test_nothing_after_an_origin_changes_a_forecast(fit, later, adapt, memory):
    origins = np.array([N_TRAIN + 1, 12 * DAY, N_TRAIN + 11 * DAY])
    sample = history(later, origins, fit.sample.leads)
    clean = forecast_from_origins(fit, later, origins, DAY, adapt, memory)
    rng = np.random.default_rng(0)
    for i, origin in enumerate(origins):
        y, seen = later.segment.y.copy(), later.segment.seen.copy()
        y[origin + 1 :] = rng.normal(0.0, 30.0, len(y) - origin - 1)
        seen[origin + 1 :] |= True
        changed = later._replace(segment=later.segment._replace(y=y, seen=seen))
        other = forecast_from_origins(fit, changed, origins, DAY, adapt, memory)
        np.testing.assert_array_equal(other.paths[: i + 1], clean.paths[: i + 1])
        np.testing.assert_array_equal(other.states[i].coef, clean.states[i].coef)
        np.testing.assert_array_equal(other.states[i].psi, clean.states[i].psi)
        known = sample.origins[:, None] + sample.leads <= origin
        np.testing.assert_array_equal(other.errors[:-1][known], clean.errors[:-1][known])


@pytest.mark.parametrize("adapt", [None, "linear", "full"])
def test_forecasts_do_not_depend_on_the_other_origins(fit, later, adapt):
    origins = np.array([N_TRAIN, N_TRAIN + 1, N_TRAIN + 2, N_TRAIN + 3, N_TRAIN + 50, N_TRAIN + 11 * DAY])
    together = forecast_from_origins(fit, later, origins, DAY, adapt)
    for i, origin in enumerate(origins):
        one = np.array([origin])
        alone = forecast_from_origins(fit, later, one, DAY, adapt)
        np.testing.assert_allclose(alone.paths[0], together.paths[i], atol=1e-6)


@pytest.mark.parametrize("adapt", ["linear", "full"])
def test_rows_may_come_in_pieces_and_old_ones_be_forgotten(fit, later, adapt):
    """Given the last rows only, and all of them at a refit, a network forecasts what one with all rows does."""
    origins = N_TRAIN + np.array([0, 3, 7 * DAY, 8 * DAY + 2, 9 * DAY - 3, 9 * DAY])
    whole = [forecast_from_origins(fit, later, origins, DAY, adapt, memory) for memory in range(2)]
    network, asked = RollingNetwork(fit, later.begin, adapt), []
    for i, origin in enumerate(origins):
        first, end = network.row, int(origin) + 1 + DAY

        def rows(origin=int(origin)):
            asked.append(origin)
            return later.segment.between(0, origin + 1)

        window = later._replace(segment=later.segment.between(first, end), first=first, whole=rows)
        network.advance(window, int(origin))
        paths, heats = network.forecast(window, DAY)
        np.testing.assert_allclose(paths, [known.paths[i] for known in whole], atol=1e-9)
        np.testing.assert_allclose(heats, [known.heat[i] for known in whole], atol=1e-9)
    np.testing.assert_allclose(network.errors, np.stack([known.errors for known in whole], axis=-1), atol=1e-9)
    assert set(asked) == ({int(origins[3])} if adapt == "full" else set())
    targets = later.begin + network.every * np.arange(len(network.errors))[:, None] + fit.sample.leads
    ended = (targets <= origins[-1]) & later.segment.seen[np.minimum(targets, origins[-1])]
    np.testing.assert_array_equal(np.isfinite(network.errors[..., 0]), ended)  # those from before a refit too


@pytest.mark.parametrize("memory", [0, 1])
def test_errors_of_the_history_are_by_what_was_known_that_morning(fit, later, memory):
    origins = np.array([11 * DAY])
    sample = history(later, origins, fit.sample.leads)
    found = forecast_from_origins(fit, later, origins, DAY, "linear", memory)
    morning = N_TRAIN + 2 * DAY
    that_day = forecast_from_origins(fit, later, np.array([morning]), DAY, "linear", memory)
    for place in np.flatnonzero((sample.origins >= morning) & (sample.origins < morning + DAY))[::7]:
        origin = sample.origins[place]
        path, _ = brute_force(fit, fit.psi, that_day.states[0].coef, later.segment, origin, DAY)
        target = np.minimum(origin + sample.leads, later.segment.n_rows - 1)
        known = later.segment.seen[target] & (target <= origins[-1])
        expected = np.where(known, later.segment.y[target] - path[sample.leads - 1], np.nan)
        np.testing.assert_allclose(found.errors[place], expected, atol=1e-6)


def test_full_adaptation_fits_the_network_on_rows_up_to_its_mark(fit, later):
    """When the log of eight days has doubled; the row of the mark is the last one that counts."""
    later = later._replace(begin=N_TRAIN + 3)  # so that a lead of the sample ends at the row after the mark
    mark = N_TRAIN + 3 + 8 * DAY
    origins = np.array([mark - 1, mark, mark + 20])

    def learned(y):
        return forecast_from_origins(
            fit, later._replace(segment=later.segment._replace(y=y)), origins, 1, "full"
        ).states

    y = later.segment.y
    before, at, after = (known.psi for known in learned(y))
    np.testing.assert_array_equal(before, fit.psi)
    assert not np.array_equal(at, before)
    np.testing.assert_array_equal(at, after)
    changed = y.copy()
    changed[mark + 1 :] += 5.0
    np.testing.assert_array_equal(learned(changed)[2].psi, at)
    changed = y.copy()
    changed[mark] += 5.0
    assert not np.array_equal(learned(changed)[1].psi, at)


@pytest.mark.parametrize(
    ("trained", "days"), [(0.9, [1, 3, 7, 15, 25, 35]), (3.0, [3, 9, 19, 29]), (8.0, [8, 18, 28]), (28.0, [10, 20, 30])]
)
def test_refits_come_every_ten_days_and_in_a_young_log_as_it_doubles(trained, days):
    one = SimpleNamespace(segment=SimpleNamespace(n_rows=round(trained * DAY)))
    network = SimpleNamespace(adapt="full", fit=one, begin=5, row=0, _per_day=DAY)
    marks = [5 + day * DAY for day in days]
    assert RollingNetwork.refits(network, marks[-1]) == marks
    network.row = marks[1]
    assert RollingNetwork.refits(network, marks[-1] - 1) == marks[1:-1]
    network.adapt = "linear"
    assert not RollingNetwork.refits(network, marks[-1])


def test_rows_elsewhere_are_fitted_beside_the_training(fit, table, T):
    """A refit sees rows that do not follow the training, the training, and nothing after its mark."""
    part = table.rows(slice(2 * DAY + 3, None))
    y = T[2 * DAY + 3 :]
    mark, found = 8 * DAY, []
    for changed in (None, mark + 1, mark):
        own = y.copy()
        if changed is not None:
            own[changed:] += 3.0
        elsewhere = NumberedSegment(fit.make_segment(part, own), 0, joined=False)
        origins = np.array([mark - 1, mark])
        found.append(forecast_from_origins(fit, elsewhere, origins, 1, "full").states)
    np.testing.assert_array_equal(found[0][0].psi, fit.psi)
    assert not np.array_equal(found[0][1].psi, fit.psi)
    np.testing.assert_array_equal(found[1][1].psi, found[0][1].psi)
    np.testing.assert_array_equal(found[1][1].coef, found[0][1].coef)
    assert not np.array_equal(found[2][1].psi, found[0][1].psi)


def test_full_adaptation_is_a_fit_on_the_window(fit, later):
    """The refitted point beats the one before on the rows that it was fitted on."""
    mark = N_TRAIN + 8 * DAY
    psi = forecast_from_origins(fit, later, np.array([mark]), 1, "full").states[0].psi
    origins = np.arange(DAY, mark, 4)
    weight = np.where(origins >= N_TRAIN, 2.0, 1.0)
    window = replace(
        fit.problem,
        forecasts=(
            ScoredForecasts(later.segment.between(0, mark + 1), ForecastSample(origins, fit.sample.leads), weight),
        ),
    )
    assert window.evaluate(psi).loss < window.evaluate(fit.psi).loss


@pytest.mark.parametrize("purpose", ["forecast", "plan"])
@pytest.mark.parametrize("role", ["u_heat", "u_cool"])
def test_the_loss_without_a_plant_is_that_of_rows_in_which_it_stood_still(table, T, role, purpose):
    """With a capacity its heat is known and delayed, without one it is a channel."""
    rows, T = table.rows(slice(N_TRAIN)), T[:N_TRAIN]
    fit = fit_leads(get_network("2R2C"), rows, T, DAY, {"Q_h": 6.0}, purpose=purpose)
    assert ("u_heat" in dict(fit.plan.known), "u_cool" in dict(fit.plan.stages)) == (True, True)
    best = fit.problem.evaluate(fit.psi)
    idle = fit.make_segment(rows.replace(inputs={**rows.inputs, role: np.zeros(N_TRAIN)}), T)
    made = fit.problem.with_other_heat(best, idle)
    from_rows = fit.with_rows(idle).problem.evaluate(fit.psi)
    assert made.loss == pytest.approx(from_rows.loss, rel=1e-9)
    assert made.loss > best.loss + 1.0
    np.testing.assert_allclose(made.solution.coef, from_rows.solution.coef, rtol=1e-5, atol=1e-7)


def test_no_point_is_evaluated_twice(monkeypatch):
    """The search for undetermined sources knows the evaluation of the fit."""
    office, seen, evaluate = make_office(n_days=4, sampling_time="1h", random_state=0), [], LeadProblem.evaluate

    def recorded(problem, psi):
        seen.append((problem, psi.tobytes()))
        return evaluate(problem, psi)

    monkeypatch.setattr(LeadProblem, "evaluate", recorded)
    table = read_table(BaseEstimator(), office.X, reset=True)
    fit_leads(get_network("2R2C"), table, office.y.to_numpy(), 24, {"Q_h": 6.0})
    points = [(id(problem), psi) for problem, psi in seen]
    assert len(points) == len(set(points)) > 20
