"""Heat that could be expected at an origin: what tells it, its part in forecast errors, and the gain it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from skhybrid import SchedulePredictor
from skhybrid.schedule import fit as fit_module
from skhybrid.schedule import step_gain
from skhybrid.schedule.expected_heat import heat_surprise
from skhybrid.schedule.lead_problem import ScoredForecasts

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")

STEP, DAY, N_DAYS = 1.0, 24, 28  # [h], rows, days
UA, C = 0.15, 1.2  # [kW/K], [kWh/K] of the zone


def zone(seed):
    """A zone of one node that a thermostat holds between set-points by the clock, beside gains that wander."""
    rng, n = np.random.default_rng(seed), N_DAYS * DAY
    index = pd.date_range("2023-01-02", periods=n, freq="1h")
    hour = index.hour.to_numpy()
    T_oa = 2.0 + 4.0 * np.sin(2 * np.pi * (hour - 9) / DAY) + np.repeat(rng.normal(0.0, 4.0, N_DAYS), DAY)
    set_to = np.where((hour >= 6) & (hour < 20), 21.0, 17.0) + np.repeat(rng.normal(0.0, 1.0, N_DAYS), DAY)
    gains, T, Q, wanders = np.zeros(n), np.empty(n), np.zeros(n), 0.0
    T_now, a = 18.0, np.exp(-STEP * UA / C)
    for k in range(n):
        wanders = 0.9 * wanders + rng.normal(0.0, 0.25)
        gains[k], T[k] = 0.5 + wanders, T_now
        rest = T_oa[k] + gains[k] / UA
        Q[k] = np.clip(UA * ((set_to[k] - a * T_now) / (1.0 - a) - rest), 0.0, 8.0)
        T_now = a * T_now + (1.0 - a) * (rest + Q[k] / UA)
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": np.zeros(n), "Q_hvac": Q}, index)
    truth = (1.0 - a ** np.arange(1, DAY + 1)) / UA
    return X.assign(T_za=T + rng.normal(0.0, 0.02, n)), truth


@pytest.fixture(scope="module")
def log():
    return zone(0)


@pytest.fixture(scope="module")
def plan(log):
    return fitted(log[0], "plan")


def fitted(X, purpose):
    model = SchedulePredictor(purpose=purpose, adapt=None, intervals=False).fit(X, X["T_za"])
    return model._scheme._physics.fit_


def surprise_of(fit, heat):
    """Surprise of the training rows under other heat, and that heat at the rows of each lead."""
    segment = fit.segment._replace(heat=heat)
    rows = np.minimum(fit.sample.origins[:, None] + np.arange(fit.sample.leads[-1]), len(heat) - 1)
    return heat_surprise(segment, fit.sample, fit.blocks, STEP), heat[rows]


# ------------------------------------------------------------------------------------------------ what is expected
def test_what_weather_and_calendar_tell_is_expected(plan):
    rng, n = np.random.default_rng(1), plan.segment.n_rows
    told = 3.0 - 0.3 * plan.segment.boundary[:, 0] + 2.0 * (np.arange(n) % DAY == 6)
    noise = rng.normal(0.0, 0.5, n)
    surprise, whole = surprise_of(plan, told + noise)
    _, wanted = surprise_of(plan, noise)
    known = plan.sample.origins + plan.sample.leads[-1] < n
    assert np.corrcoef(whole[known].ravel(), wanted[known].ravel())[0, 1] < 0.5
    assert np.corrcoef(surprise[known].ravel(), wanted[known].ravel())[0, 1] > 0.8
    # rows after the last one have no part
    assert not surprise[-1, 2:].any()


def test_heat_at_random_tells_nothing_of_itself(plan):
    heat = 3.0 * (np.random.default_rng(2).random(plan.segment.n_rows) < 0.5)
    assert surprise_of(plan, heat)[0] is None


def test_a_block_of_days_has_no_part_in_what_is_expected_of_it(plan):
    heat = plan.segment.heat.copy()
    before, _ = surprise_of(plan, heat)
    own = plan.blocks == 2
    inside = plan.sample.origins[own]
    # other heat in the middle of the block, long after any other block's and its own first origins
    middle = slice(inside[0] + 3 * DAY, inside[0] + 3 * DAY + 2)
    heat[middle] += 5.0
    after, _ = surprise_of(plan, heat)
    rows = plan.sample.origins[:, None] + np.arange(before.shape[1])
    first = own & (plan.sample.origins < middle.start)
    hit = first[:, None] & (rows >= middle.start) & (rows < middle.stop)
    # but for the units of the regressors
    assert hit.any()
    np.testing.assert_allclose((after - before)[hit], 5.0, atol=0.01)


# -------------------------------------------------------------------------------------- its part in forecast errors
def problem_with(plan, lags):
    """The problem of a fit under a random surprise, at every 40th origin."""
    scored = plan.problem.forecasts[0].every(40)
    scored = scored._replace(segment=scored.segment._replace(plan=plan.plan._replace(lags=lags)))
    size = len(scored.sample.origins), int(scored.sample.leads[-1])
    surprise = np.random.default_rng(3).normal(0.0, 1.0, size)
    return replace(plan.problem, forecasts=(scored._replace(surprise=surprise),))


@pytest.mark.parametrize("lags", [False, True])
def test_errors_are_those_of_forecasts_with_the_expected_heat(plan, lags):
    problem = problem_with(plan, lags)
    scored = problem.forecasts[0]
    coef = np.linspace(0.1, 0.5, len(problem.positive))
    found, _ = problem.sensitivities(plan.psi, coef, scored)
    for i, origin in enumerate(scored.sample.origins[:-1]):
        heat = scored.segment.heat.copy()
        ahead = slice(origin, origin + scored.surprise.shape[1])
        heat[ahead] -= scored.surprise[i][: len(heat[ahead])]
        one = ScoredForecasts(
            scored.segment._replace(heat=heat), scored.sample._replace(origins=scored.sample.origins[[i]])
        )
        wanted, _ = problem.sensitivities(plan.psi, coef, one)
        inside = origin + scored.sample.leads < scored.segment.n_rows
        np.testing.assert_allclose(found[i, inside], wanted[0, inside], atol=1e-8)


@pytest.mark.parametrize("lags", [False, True])
def test_columns_and_slopes_are_those_of_the_errors(plan, lags):
    problem = problem_with(plan, lags)
    scored, psi = problem.forecasts[0], plan.psi + 0.05
    coef = np.linspace(0.1, 0.5, len(problem.positive))
    e, slopes = problem.sensitivities(psi, coef, scored)
    by_columns = problem.design(psi, scored) @ np.append(-coef, 1.0)
    np.testing.assert_allclose(by_columns, (problem.root_weights(scored) * e).ravel(), atol=1e-8)
    for i, unit in enumerate(1e-5 * np.eye(len(psi))):
        after, before = (problem.sensitivities(psi + d, coef, scored)[0] for d in (unit, -unit))
        np.testing.assert_allclose(slopes[..., i], (after - before) / 2e-5, rtol=1e-4, atol=1e-5)


# ------------------------------------------------------------------------------------------------- the gain it gives
@pytest.fixture(scope="module")
def pulled_by_jumps_alone(log):
    """Ratios to the plant's gain after 4, 12 and 24 h of a fit on delivered heat."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit_module, "heat_surprise", lambda *_: None)
        patch.setattr(fit_module, "_toward_one_hour", lambda model, scored, pull: pull)
        return ratio_to_plant(fitted(log[0], "plan"), log[1])


def ratio_to_plant(fit, truth):
    at = [3, 11, 23]
    return step_gain(fit, DAY)[at] / truth[at]


def test_expected_heat_brings_the_gain_nearer_to_the_plants(log, plan, pulled_by_jumps_alone):
    ratio = ratio_to_plant(plan, log[1])
    assert (ratio > 1.15 * pulled_by_jumps_alone).all()
    assert (ratio < 1.15).all()


def test_so_do_forecasts_over_an_hour_where_the_heat_cannot_be_expected(log, pulled_by_jumps_alone, monkeypatch):
    X, truth = log
    monkeypatch.setattr(fit_module, "heat_surprise", lambda *_: None)
    fit = fitted(X, "plan")
    ratio = ratio_to_plant(fit, truth)
    assert (ratio > 1.15 * pulled_by_jumps_alone).all()
    assert (ratio < 1.15).all()
    assert (fit.problem.pull.shape.spread > 0.03).all()  # what the rows leave open is added


def test_schedules_and_blend_learn_from_delivered_heat(plan):
    assert plan.problem.forecasts[0].surprise is None
