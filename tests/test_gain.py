"""The response of a forecast to a kW: what jumps say of it, the pull, the blend made for planning, and its error."""

from __future__ import annotations

import re
import warnings
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm
from sklearn.base import clone

from skhybrid import HybridPredictor, SchedulePredictor
from skhybrid.datasets import make_office
from skhybrid.exceptions import ExcitationWarning, GainWarning
from skhybrid.hybrid.blending.gain_report import disagreement
from skhybrid.persistence import load_model, save_model
from skhybrid.schedule import (
    LITTLE_ERROR,
    NumberedSegment,
    days_to_determine,
    gain_error,
    rolling_network,
    step_gain,
    step_gain_error,
)
from skhybrid.schedule.lead_problem import LeadProblem
from skhybrid.schedule.network_response import NetworkResponse
from skhybrid.schedule.step_gain import KNOWN_HEAT, GainPull, ResponseShape, is_delayed, is_usual, observed_gains

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")

DAY = 48  # rows, at 30 min
N_TRAIN = 12 * DAY
#: relative errors of a normal variable lie within two standard errors in 95 of 100 cases
COVERED = 0.95


def office_of(seed, climate="oakland", n_days=26, step=0.5):
    """A log with the heat measured, and the response of the office to a kW [K/kW] by row, over a day."""
    office = make_office(n_days, climate, sampling_time=pd.Timedelta(step, "h"), random_state=seed)
    theta = office.theta
    X = office.X.assign(Q_hvac=theta["Q_h"] * office.X["u_heat"] + theta["Q_c"] * office.X["u_cool"])
    C, inside, outside = np.array([theta["C_w"], theta["C_za"]]), 1.0 / theta["R_zw"], 1.0 / theta["R_zo"]
    A = np.array([[-inside, inside], [inside, -inside - outside]]) / C[:, None]
    steps = [
        np.linalg.solve(A, (expm(A * step * k) - np.eye(2)) @ [0.0, 1.0 / C[1]])[1]
        for k in range(1, round(24.0 / step) + 1)
    ]
    return X.drop(columns=["u_heat", "u_cool"]), np.array(steps)


@pytest.fixture(scope="module")
def log():
    return office_of(4)


@pytest.fixture(scope="module")
def plan(log):
    X, _ = log
    return HybridPredictor(purpose="plan", intervals=False).fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])


@pytest.fixture(scope="module")
def stages():
    """A fit for planning in which heating has a known capacity and cooling has not."""
    office = make_office(20, "oakland", start="2023-06-05", sampling_time="30min", random_state=2)
    return SchedulePredictor(known={"Q_h": 6.0}, purpose="plan", intervals=False).fit(office.X, office.y)


def network(model):
    return model._scheme._physics.fit_


# ------------------------------------------------------------------------------------------------- what jumps say
def stepped(model, heat, seed=0):
    """The training rows of a fit under other heat and the temperature of a room that answers it, with a little noise.

    A kW more warms it by 1 K in the first row and by half as much again in every later one, up to 3 K.
    """
    segment = network(model).segment
    shape = np.minimum(1.0 + 0.5 * np.arange(5), 3.0)
    impulse = np.append(shape[0], np.diff(shape))
    T = np.convolve(heat, impulse)[: len(heat) - 1]
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(heat))
    n = len(heat)
    return segment.between(0, n)._replace(heat=heat, y=np.append(0.0, T) + noise, seen=np.ones(n, dtype=bool))


def test_gains_are_read_from_jumps_of_the_heat(plan):
    heat = np.repeat(np.tile([0.0, 2.0], 20), 12)
    gains = {g.lead: g for g in observed_gains(stepped(plan, heat)) if g.source == KNOWN_HEAT}
    assert gains[1].gain == pytest.approx(1.0, abs=0.02)
    assert gains[2].gain == pytest.approx(1.5, abs=0.02)
    assert gains[1].n_jumps == 39
    assert 0.0 < gains[1].error < 0.01


@pytest.mark.parametrize("heat", [np.zeros(480), np.repeat(np.tile([0.0, 2.0], 3), 80), np.tile([0.0, 2.0, 1.0], 160)])
def test_no_heat_or_few_jumps_tell_nothing(plan, heat):
    assert not [g for g in observed_gains(stepped(plan, heat)) if g.lead == 2]


def test_heat_that_answers_people_tells_nothing_of_the_gain(plan):
    heat = np.repeat(np.tile([0.0, 2.0], 20), 12)
    segment = stepped(plan, heat)
    y, answers = segment.y.copy(), np.arange(60, 480, 96)  # jumps that leave the temperature where it was
    for k in answers:
        y[k + 1 : k + 12] -= y[k + 1] - y[k]
        y[k + 12 :] -= y[k + 12] - y[k + 11] - (segment.y[k + 12] - segment.y[k + 11])
    first = observed_gains(segment._replace(y=y))[0]
    assert first.gain == pytest.approx(1.0, abs=0.05)
    assert first.n_jumps == 39 - len(answers)


def test_heat_that_changes_after_a_jump_is_accounted_for(plan):
    heat = np.repeat(np.tile([0.0, 2.0], 20), 12)
    heat[13::24] -= 0.5
    gains = {g.lead: g for g in observed_gains(stepped(plan, heat)) if g.source == KNOWN_HEAT}
    assert gains[1].gain == pytest.approx(1.0, abs=0.05)
    assert gains[2].gain == pytest.approx(1.5, abs=0.05)


def test_rows_that_are_left_out_do_not_count(plan):
    heat = np.repeat(np.tile([0.0, 2.0], 20), 12)
    segment = stepped(plan, heat)
    segment.y[240:] *= 5.0
    first = observed_gains(segment, (np.arange(480) < 238) * 1.0)
    assert first[0].gain == pytest.approx(1.0, abs=0.02)
    assert first[0].n_jumps == 19


def test_the_first_two_gains_tell_a_radiator_from_heated_air(plan):
    heat = np.repeat(np.tile([0.0, 2.0], 20), 12)
    first, second = (g for g in observed_gains(stepped(plan, heat)) if g.source == KNOWN_HEAT)
    for ratio, usual, delayed in ((1.17, True, False), (1.9, False, False), (2.5, False, True)):
        pair = first, second._replace(gain=ratio * first.gain)
        assert (is_usual(pair, 0.25), is_delayed(pair)) == (usual, delayed)
    assert not is_usual((first,), 0.25)
    assert not is_delayed((first,))


# --------------------------------------------------------------------------------------------------------- the pull
def problem_of(model, *, lags):
    """The problem of a fit with a pull on every kind of row, and a point off its minimum."""
    fit = network(model)
    plan_ = fit.plan._replace(lags=lags)
    scored = fit.problem.forecasts[0]
    sample = scored.sample._replace(origins=scored.sample.origins[::8])
    scored = scored._replace(segment=scored.segment._replace(plan=plan_), sample=sample)
    pull = GainPull(fit.problem.pull.observed, ResponseShape.usual(fit.model.step), fit.model.step)
    psi = fit.psi + np.random.default_rng(0).normal(0.0, 0.1, len(fit.psi))
    return LeadProblem(fit.model, (scored,), fit.psi, fit.problem.precision, fit.problem.shrinkage, pull), psi


@pytest.mark.parametrize("lags", [False, True])
def test_the_slopes_of_the_pull_are_exact(stages, lags):
    problem, psi = problem_of(stages, lags=lags)
    segment, pull = problem.forecasts[0].segment, problem.pull
    assert {g.source for g in pull.observed} > {KNOWN_HEAT}  # of the cooling stage, too
    coef = np.linspace(0.2, 1.0, len(problem.positive))
    found = pull.sensitivities(problem.model, psi, coef, segment)
    assert found.shape == (pull.n_rows, len(psi))
    for i, unit in enumerate(np.eye(len(psi))):
        after, before = (
            pull.design(problem.model, psi + h * unit, segment) @ np.append(-coef, 1.0) for h in (1e-6, -1e-6)
        )
        np.testing.assert_allclose(found[:, i], (after - before) / 2e-6, rtol=1e-5, atol=1e-5)


def test_the_gradient_of_the_loss_has_the_pull(stages):
    problem, psi = problem_of(stages, lags=True)
    gradient, _ = problem.slopes(problem.evaluate(psi))
    without, _ = replace(problem, pull=None).slopes(replace(problem, pull=None).evaluate(psi))
    difference = [
        (problem.evaluate(psi + h).loss - problem.evaluate(psi - h).loss) / 2e-5 for h in 1e-5 * np.eye(len(psi))
    ]
    np.testing.assert_allclose(gradient, difference, rtol=1e-4, atol=1e-3)
    assert np.abs(gradient - without).max() > 1.0


def test_the_network_takes_the_gain_that_jumps_show(plan, log):
    _, truth = log
    observed = next(g for g in network(plan).problem.pull.observed if g.source == KNOWN_HEAT and g.lead == 1)
    assert step_gain(network(plan), 1)[0] == pytest.approx(observed.gain, rel=0.05)
    assert observed.gain == pytest.approx(truth[0], rel=0.1)
    assert not network(plan).plan.emitter  # the air of this office is heated
    np.testing.assert_allclose(step_gain(network(plan), DAY)[[1, 7, 23]], truth[[1, 7, 23]], rtol=0.25)


def test_the_usual_response_gives_way_where_the_rows_contradict_it():
    """By the hour, jumps cannot tell the office from rooms with the usual response; other rows can, and refits too."""
    X, truth = office_of(0, n_days=26, step=1.0)
    train, later = X[: 14 * 24], X[14 * 24 :]
    model = SchedulePredictor(purpose="plan", intervals=False).fit(train, train["T_za"])
    fit, rows = network(model), [0, 3, 11, 23]
    assert is_usual(fit.problem.pull.observed, 1.0) is None
    np.testing.assert_allclose(step_gain(fit, 24)[rows], truth[rows], rtol=0.3)
    model.update(later).forecast(None, later[:2].drop(columns="T_za").shift(freq="12D"))
    psi = model._scheme._kept.running["full"].network.psi
    assert not np.array_equal(psi, fit.psi)
    np.testing.assert_allclose(step_gain(replace(fit, psi=psi), 24)[rows], truth[rows], rtol=0.3)


def test_rows_that_agree_keep_the_usual_response():
    usual = 1.0 + 0.24 * np.log(2.0 * np.arange(1, DAY + 1))
    heat = np.repeat(0.3 * (np.random.default_rng(1).random(80) > 0.5), 12)
    X, _ = heated(lambda hour, row: heat, truth=usual)
    fit = network(SchedulePredictor(purpose="plan", adapt=None, intervals=False).fit(X, X["T_za"]))
    assert is_usual(fit.problem.pull.observed, 0.5) is None  # the jumps are small, and leave it open
    np.testing.assert_array_equal(fit.problem.pull.shape.relative, ResponseShape.usual(0.5).relative)


# -------------------------------------------------------------------------------------------------------- the blend
def response(model, X, rows):
    """Response [K/kW] of the forecast of rows to a kW in all of them."""
    model = deepcopy(model)
    if rows.start > N_TRAIN:
        model.update(X[N_TRAIN : rows.start])
    ahead = X[rows].drop(columns="T_za")
    warm = model.forecast(None, ahead.assign(Q_hvac=ahead["Q_hvac"] + 0.1))
    return (warm["T_za"] - model.forecast(None, ahead)["T_za"]).to_numpy()[1:] / 0.1


@pytest.mark.parametrize("adapt", [None, "linear"])
def test_the_blend_answers_to_a_kw_as_the_network_does(plan, log, adapt):
    X, _ = log
    model = deepcopy(plan).set_params(adapt=adapt)
    found = response(model, X, slice(N_TRAIN, N_TRAIN + DAY))
    np.testing.assert_allclose(found, step_gain(network(plan), DAY - 1), atol=1e-8)
    assert (np.ptp(plan.gain_.to_numpy(), axis=1) < 1e-9).all()


def test_an_optimiser_gets_the_gain_of_the_network(plan, log):
    X, _ = log
    ahead = X[N_TRAIN : N_TRAIN + DAY].drop(columns="T_za")
    affine, alone = (plan.affine_forecast(None, ahead, member=member) for member in ("blend", "network"))
    np.testing.assert_allclose(affine.gain, alone.gain, atol=1e-10)
    np.testing.assert_allclose(affine.gain.sum(axis=(1, 2))[1:], step_gain(network(plan), DAY - 1), atol=1e-8)
    found = affine.temperature(ahead["Q_hvac"].to_numpy())
    np.testing.assert_allclose(found, plan.forecast(None, ahead)["T_za"], atol=1e-9)


def test_the_response_that_members_do_not_learn_is_that_to_each_kilowatt_before(plan):
    training = plan._scheme.rows.training
    response, n = NetworkResponse.of(network(plan), ["Q_hvac"], training), training.n_rows
    impulse = np.diff(response.step(n), prepend=0.0)
    heat = training.inputs["Q_hvac"] - training.inputs["Q_hvac"].mean()
    expected = np.append(0.0, np.convolve(heat, impulse)[: n - 1])
    np.testing.assert_allclose(response.temperature(training), expected, atol=1e-8)


def test_beyond_the_last_row_the_heat_of_a_plan_is_held(plan, log):
    later = log[0][N_TRAIN : N_TRAIN + 10]
    found = plan.predict_from(later, [5])[0]
    assert np.isfinite(found[:4]).all()
    held = pd.concat([later, later.iloc[[-1] * 4].set_axis(later.index[-4:] + 4 * (later.index[1] - later.index[0]))])
    np.testing.assert_allclose(plan.predict_from(held, [5])[0, :4], found[:4], atol=1e-9)


def test_a_refit_keeps_the_shape_of_the_response_that_the_training_told(plan, monkeypatch):
    fit, pulls = network(plan), []
    monkeypatch.setattr(rolling_network, "minimise", lambda problem, at, **_: pulls.append(problem.pull) or at)
    n = fit.segment.n_rows
    rolling_network._refit_psi(fit, fit.psi, NumberedSegment(fit.segment, n, joined=True), n)
    assert pulls[0].observed
    assert pulls[0].shape is fit.problem.pull.shape is not None


def test_the_blend_follows_a_network_that_was_fitted_again(plan, log):
    X, _ = log
    later = slice(N_TRAIN + 11 * DAY, N_TRAIN + 12 * DAY)
    found, before = response(plan, X, later), step_gain(network(plan), DAY - 1)
    scheme = deepcopy(plan).update(X[N_TRAIN : later.start])._scheme
    scheme.forecast_ahead(scheme.rows.latest.replace(index=scheme.rows.latest.index))
    assert np.abs(found - before).max() > 1e-4
    psi = scheme._kept.running["full"].network.psi
    np.testing.assert_allclose(found, step_gain(replace(network(plan), psi=psi), DAY - 1), atol=1e-8)


def test_rows_taken_in_one_by_one_forecast_as_rows_of_a_history(plan, log):
    X, _ = log
    end = N_TRAIN + 2 * DAY
    ahead = X[end : end + DAY].drop(columns="T_za")
    expected = plan.forecast(X[N_TRAIN:end], ahead)["T_za"]
    model = deepcopy(plan)
    for first in range(N_TRAIN, end, 7):
        model.update(X[first : min(first + 7, end)])
        found = model.forecast(None, ahead if first + 7 >= end else X[first + 7 : first + 9].drop(columns="T_za"))
    np.testing.assert_allclose(found["T_za"], expected, atol=1e-9)


def test_a_model_for_planning_is_cloned_and_saved_whole(plan, log, tmp_path):
    X, _ = log
    assert clone(plan).get_params() == plan.get_params()
    assert clone(plan).purpose == "plan"
    save_model(plan, tmp_path / "plan.skops")
    loaded = load_model(tmp_path / "plan.skops")
    ahead = X[N_TRAIN : N_TRAIN + DAY].drop(columns="T_za")
    pd.testing.assert_frame_equal(loaded.forecast(None, ahead), plan.forecast(None, ahead))
    pd.testing.assert_frame_equal(loaded.gain_, plan.gain_)
    pd.testing.assert_series_equal(loaded.gain_std_, plan.gain_std_)


# ------------------------------------------------------------------------------------------------------------ refits
def test_a_refit_is_the_same_however_the_rows_came(plan, log):
    """Ten days after the training: what the others learn without the heat follows the network from that row on."""
    X, _ = log
    end = N_TRAIN + 11 * DAY
    ahead, daily = X[end : end + DAY].drop(columns="T_za"), deepcopy(plan)
    for day in range(N_TRAIN, end, DAY):
        daily.update(X[day : day + DAY]).forecast(None, X[day + DAY : day + DAY + 2].drop(columns="T_za"))
    at_once = deepcopy(plan).update(X[N_TRAIN:end])
    assert not np.array_equal(daily._scheme._kept.running["full"].network.psi, network(plan).psi)
    np.testing.assert_allclose(daily.forecast(None, ahead), at_once.forecast(None, ahead), rtol=0, atol=1e-8)


def test_a_refit_at_the_present_row_sees_its_temperature(plan, log):
    X, _ = log
    now = N_TRAIN + 10 * DAY
    ahead, model = X[now : now + DAY].drop(columns="T_za"), deepcopy(plan).update(X[N_TRAIN:now])
    model.forecast(None, ahead)
    found = model.forecast(None, ahead, T_za=X["T_za"].iloc[now])
    later = model.update(X[now : now + 1]).forecast(None, ahead[1:])
    np.testing.assert_allclose(found[1:], later, rtol=0, atol=1e-8)


# ------------------------------------------------------------------------------------------------ error and warnings
def test_the_stated_error_covers_the_truth():
    inside = []
    for seed, climate in ((0, "oakland"), (1, "chicago")):
        X, truth = office_of(seed, climate, n_days=14)
        model = SchedulePredictor(purpose="plan", adapt=None, intervals=False).fit(X, X["T_za"])
        rows = np.asarray(model.gain_.index // pd.Timedelta("30min"))
        ratio = np.log(model.gain_["network"].to_numpy() / truth[rows - 1])
        inside.append(np.abs(ratio) < 2.0 * model.gain_std_.to_numpy())
        assert (model.gain_std_ < 0.6).all()  # it tells something
    assert np.mean(inside) >= COVERED


def heated(heat, n_days=20, truth=None):
    """A zone that answers heat, given by hour and row, as the office does or by ``truth``, and that response [K/kW]."""
    X, office = office_of(1, n_days=n_days)
    truth = office if truth is None else truth
    Q = heat(X.index.hour.to_numpy(), np.arange(len(X)))
    impulse = np.append(truth[0], np.diff(np.append(truth, np.full(400, truth[-1]))))
    T = 21.0 + 0.2 * (X["T_oa"] - X["T_oa"].mean()) + np.append(0.0, np.convolve(Q, impulse)[: len(Q) - 1])
    return X.assign(Q_hvac=Q, T_za=T + np.random.default_rng(0).normal(0.0, 0.05, len(T))), truth


def trace(hour, row):
    """0.03 kW in the evenings, and 2 kW each morning after the training."""
    morning = (row >= N_TRAIN) & (hour >= 6) & (hour < 10)
    return np.where(morning, 2.0, np.where((hour >= 18) & (hour < 20), 0.03, 0.0))


@pytest.mark.parametrize("purpose", ["forecast", "plan"])
def test_a_trace_of_heat_is_not_extrapolated(purpose):
    X, truth = heated(trace)
    train, later = X[:N_TRAIN], X[N_TRAIN:]
    with pytest.warns(ExcitationWarning, match=r"even 28 days of random set-points .*plan_experiment"):
        model = SchedulePredictor(purpose=purpose, intervals=False).fit(train, train["T_za"])
    # the gain of every member is that of a network of the usual size
    assert (np.ptp(model.gain_.to_numpy(), axis=1) < 1e-9).all()
    assert 0.05 < model.gain_["network"].iloc[-1] / truth[-1] < 20.0
    assert model.gain_std_.iloc[-1] > 0.5
    assert np.abs(model.predict(later) - later["T_za"]).max() < 8.0


def errors_and_days(most, n_random=0):
    """Error of the gain at 24 h of a zone whose heat goes up to about a kW times ``most``, and what is foreseen."""
    rng, n = np.random.default_rng(1), (10 + n_random) * DAY
    drawn = np.repeat(rng.uniform(0.0, most, n), rng.integers(4, 13, n))[:n]

    def heat(hour, row):
        by_the_clock = most * np.where((hour >= 6) & (hour < 20), 1.0, 0.3) * (1.0 + 0.2 * np.sin(row / 30.0))
        return np.where(row < 10 * DAY, by_the_clock, drawn)

    X, _ = heated(heat, n_days=10 + n_random)
    fit = network(SchedulePredictor(adapt=None, intervals=False).fit(X, X["T_za"]))
    return step_gain_error(fit, np.array([DAY]))[0], *days_to_determine(fit, "Q_hvac")


def test_strong_heat_needs_fewer_days_of_random_setpoints():
    error, days, foreseen = errors_and_days(3.0)
    assert days < 28
    assert foreseen < LITTLE_ERROR < error
    assert errors_and_days(3.0, n_random=days)[0] < LITTLE_ERROR
    quiet_error, quiet_days, quiet_foreseen = errors_and_days(0.5)
    assert quiet_days > days
    assert LITTLE_ERROR < quiet_foreseen < quiet_error


def test_random_heat_of_a_fitted_stage_is_in_its_series_and_in_the_temperature(stages):
    fit = network(stages)
    days, error = days_to_determine(fit, "u_cool")
    assert (error < LITTLE_ERROR) == (days < 28)
    stage, coef = fit.channel_names.index("u_cool"), np.where(fit.coef > 0.0, fit.coef, 2.0)
    excited = gain_error._randomly_heated(fit, stage, coef)
    change = coef[stage] * (excited.channels.series - fit.segment.channels.series)[:, stage]
    T = gain_error._temperature_change(fit, change, delayed=False)
    np.testing.assert_allclose(excited.y, fit.segment.y + T, atol=1e-10)
    assert 0.5 < np.std(T) < 4.0  # 1.5 K of random heat, and that of the plant taken out


def test_members_that_disagree_are_named(log):
    X, _ = log
    model = SchedulePredictor(intervals=False).fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    assert model._scheme.gain_doubt is None
    gains = model.gain_.assign(ARX=0.4 * model.gain_["network"])
    found = disagreement(network(model), model._scheme._members, gains, "Q_hvac")
    assert re.search(r"after 24 h a kW warms .* \(network\) or .* \(ARX\).*\d+ days of random set-points", found)


def test_who_wants_a_forecast_is_not_warned_and_who_plans_is(log, monkeypatch):
    X, _ = log
    train, ahead = X[:N_TRAIN], X[N_TRAIN : N_TRAIN + DAY]
    monkeypatch.setattr("skhybrid.hybrid.schedule_scheme.disagreement", lambda *_: "they disagree.")
    with warnings.catch_warnings():
        warnings.simplefilter("error", GainWarning)
        model = SchedulePredictor(intervals=False).fit(train, train["T_za"])
        model.forecast(None, ahead)
    for use in ("affine_forecast", "to_state_space"):
        planner = deepcopy(model)
        with pytest.warns(GainWarning, match="they disagree"):
            getattr(planner, use)(None, ahead)
        with warnings.catch_warnings():
            warnings.simplefilter("error", GainWarning)
            planner.update(ahead[:1]).to_state_space(None, ahead[1:])  # a controller's next step


def test_heat_of_the_reversed_sign_is_warned_of(log):
    X = log[0][:N_TRAIN]
    reversed_ = X.assign(Q_hvac=-X["Q_hvac"])
    with pytest.warns(GainWarning, match=r"a kW of Q_hvac cools the zone, by .* is its sign reversed\?"):
        SchedulePredictor(intervals=False).fit(reversed_, X["T_za"])


def test_a_plan_without_jumps_is_warned_of():
    X, _ = heated(lambda hour, row: 1.0 + np.sin(row / 8.0), n_days=8)
    with pytest.warns(GainWarning, match=r"hardly jumped .* days of random set-points"):
        model = SchedulePredictor(purpose="plan", intervals=False).fit(X, X["T_za"])
    assert (model.gain_std_ >= 0.5).all()


def test_what_has_no_gain_says_so(log):
    X, _ = log
    idle = X.drop(columns="Q_hvac")[: 4 * DAY]
    model = SchedulePredictor(purpose="plan", intervals=False).fit(idle, idle["T_za"])
    with pytest.raises(AttributeError, match="no plant"):
        model.gain_  # noqa: B018
    with pytest.raises(AttributeError, match="no plant"):
        model.gain_std_  # noqa: B018
    with pytest.raises(ValueError, match="purpose='plan' does nothing with the two-stage scheme"):
        HybridPredictor(disturbance="output", purpose="plan").fit(X, X["T_za"])
    with pytest.raises(ValueError, match="purpose='control' is neither 'forecast' nor 'plan'"):
        SchedulePredictor(purpose="control").fit(X, X["T_za"])
