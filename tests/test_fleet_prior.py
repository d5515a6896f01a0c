"""Priors from fitted zones: what they say of a new zone, how much, and when they are refused."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal
from sklearn.base import clone

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor, SchedulePredictor
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.filtering import learn_normal
from skhybrid.fleet import FleetPrior
from skhybrid.forecasting.arx_design import Moments
from skhybrid.forecasting.arx_prior import ARXPrior
from skhybrid.persistence import load_model, save_model
from skhybrid.schedule.channels import UA_DIFFERENCE
from skhybrid.schedule.network_prior import NetworkSums, _shared_sums
from skhybrid.thermal import get_network

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
SIZES = (1.0, 2.0, 4.0)  # of the zones of the fleet, relative to the office
PER_DAY = 24


def zone(seed: int, size: float = 1.0, n_days: int = 10, step: str = "1h") -> pd.DataFrame:
    """Rows of an office that is so many times larger, with measured heat."""
    X = make_office(n_days, "chicago", start="2023-11-06", sampling_time=step, random_state=seed).X
    return X[["T_oa", "q_sol", "T_za"]].assign(Q_hvac=6.0 * size * (X["u_heat"] - X["u_cool"]))


def fitted(model, rows):
    return clone(model).fit(rows, rows["T_za"])


ARX = ARXRegressor(n_lags=3, n_input_lags=2, calendar=False)
SCHEDULE = SchedulePredictor("2R2C", intervals=False)


@pytest.fixture(scope="module")
def arx_prior():
    return FleetPrior.learn([fitted(ARX, zone(seed, size)) for seed, size in enumerate(SIZES)], SIZES)


@pytest.fixture(scope="module")
def schedules():
    return [fitted(SCHEDULE, zone(seed, size)) for seed, size in enumerate(SIZES)]


@pytest.fixture(scope="module")
def prior(schedules):
    return FleetPrior.learn(schedules, [6.0 * size for size in SIZES])


def heat_response(model, n_leads=6):
    """Response to a unit of heat over one step [K/kW]."""
    return model.design_.input_response("Q_hvac", model.coef_, n_leads)


# --------------------------------------------------------------------------------------------------------- learning
def test_the_normal_distribution_of_coefficients_is_found():
    rng = np.random.default_rng(0)
    mean, covariance = np.array([1.0, -2.0]), np.array([[0.5, 0.3], [0.3, 0.4]])
    D = rng.normal(size=(400, 60, 2))
    theta = rng.multivariate_normal(mean, covariance, size=400)
    d = np.einsum("nij,nj->ni", D, theta) + rng.normal(size=(400, 60))
    found, precision = learn_normal(D.swapaxes(1, 2) @ D, np.einsum("nij,ni->nj", D, d), 0.0)
    np.testing.assert_allclose(found, mean, atol=0.1)
    np.testing.assert_allclose(np.linalg.inv(precision), covariance, atol=0.1)


def test_a_size_is_as_likely_as_the_rows_under_it():
    """The evidence of a map from shared coefficients to those of a zone, against the density of the zone's rows."""
    rng = np.random.default_rng(1)
    mean, covariance, noise = np.array([1.0, -2.0]), np.array([[0.5, 0.3], [0.3, 0.4]]), 0.2
    D = rng.normal(size=(30, 2))
    d = D @ np.array([0.6, -1.5]) + np.sqrt(noise) * rng.normal(size=30)
    prior = ARXPrior(None, mean, np.linalg.inv(covariance), noise, 10.0)
    maps = [np.diag([1.0 / size, 1.0]) for size in (0.5, 1.0, 2.0)]
    found = [prior._evidence(A, Moments(D.T @ D, D.T @ d), noise) for A in maps]
    spread = [noise * np.eye(30) + D @ A @ covariance @ A.T @ D.T for A in maps]
    exact = [multivariate_normal(D @ A @ mean, S).logpdf(d) for A, S in zip(maps, spread, strict=True)]
    np.testing.assert_allclose(np.diff(found), np.diff(exact), rtol=1e-9)


def test_the_sums_of_shared_coefficients_are_those_of_the_rows_in_shared_units():
    """By a regression of so many rows: a coefficient that is not shared keeps its value, and takes its part away."""
    rng, size, mean_outdoor = np.random.default_rng(0), 2.0, 4.0
    D, d, coef = rng.normal(size=(30, 4)), rng.normal(size=30), np.array([0.5, 0.2, 0.8, 0.3])
    rows, channels = np.column_stack([D, d]), ("gain", "sun", "ua", "emitter")
    network, names = get_network("1R1C"), ("C_za", "R_zo")
    psi = np.log([size, 1.0 / size])
    zone = NetworkSums(network, 1.0, names, psi, channels, coef, rows.T @ rows, mean_outdoor, np.ones(1), np.ones(1))
    assert zone.log_size == pytest.approx(np.log(size))
    gain, ua, emitter = D[:, 0], D[:, 2], D[:, 3]
    colder = (mean_outdoor - 10.0) / UA_DIFFERENCE  # ua heats by the difference from another temperature outdoors
    expected = np.column_stack([size * gain, size * (ua + colder * gain), emitter, d - coef[1] * D[:, 1]])
    found = _shared_sums(zone, ("gain", "ua", "emitter"))
    np.testing.assert_allclose(found, expected.T @ expected, rtol=1e-12)


def test_zones_of_one_size_differ_less_than_zones_of_all(arx_prior):
    unscaled = FleetPrior.learn([fitted(ARX, zone(seed, size)) for seed, size in enumerate(SIZES)])
    spread = [np.linalg.inv(p.arx["one_step"].precision).diagonal()[:2].max() for p in (arx_prior, unscaled)]
    assert spread[0] < 0.5 * spread[1]  # the first columns by name are those of the heat


def test_a_prior_is_no_longer_than_it_must_be_to_say_what_it_is(prior):
    assert repr(prior) == "FleetPrior(3 zones)"
    assert repr(prior.for_nameplate(8.0)) == "FleetPrior(3 zones, nameplate=8 kW)"


# ---------------------------------------------------------------------------------------------------------- strength
@pytest.mark.parametrize("objective", ["one_step", "multi_step"])
def test_a_weak_prior_is_none_and_a_tight_one_pins_the_response(objective):
    model = clone(ARX).set_params(objective=objective, horizon="6h")
    zones = [fitted(model, zone(seed)) for seed in range(3)]
    learned = FleetPrior.learn(zones)
    rows = [zone(seed, n_days=4) for seed in (7, 8)]
    alpha = {"one_step": 1.0, "multi_step": 1e-9}[objective]  # of one step a ridge stays
    usual = [heat_response(fitted(clone(model).set_params(alpha=alpha), r)) for r in rows]
    found = {}
    for factor in (1e-8, 1e10):
        part = {objective: _scaled(learned.regressions[objective], factor)}
        given = FleetPrior(3, part, None, learned.ratio, learned.nameplates)
        found[factor] = [heat_response(fitted(clone(model).set_params(prior=given), r)) for r in rows]
    apart = np.abs(usual[0] - usual[1]).max()
    assert np.abs(found[1e10][0] - found[1e10][1]).max() < 0.01 * apart  # the rows say nothing any more
    assert max(np.abs(f - u).max() for f, u in zip(found[1e-8], usual, strict=True)) < 0.3 * apart  # and here all


def _scaled(part, factor):
    return replace(part, precision=factor * part.precision)


@pytest.mark.parametrize("sizes", [SIZES, [1.0, 1.0, 1.0]])
def test_a_zone_of_twice_the_size_answers_half(sizes):
    prior = FleetPrior.learn([fitted(ARX, zone(seed, size)) for seed, size in enumerate(sizes)], sizes)
    rows = zone(9, n_days=2).assign(Q_hvac=0.0)  # the heat never ran: the prior alone says what it does
    answers = [
        heat_response(fitted(clone(ARX).set_params(prior=prior.for_nameplate(size)), rows)) for size in (1.0, 2.0)
    ]
    assert answers[0].max() > 0.05
    np.testing.assert_allclose(answers[1], 0.5 * answers[0], rtol=1e-3)  # up to the ridge that stays


def test_a_day_is_forecast_better_with_a_fleet():
    model = ARXRegressor(objective="multi_step")
    learned = FleetPrior.learn([fitted(model, zone(seed, n_days=21)) for seed in range(4)])
    ratios = []
    for seed in (11, 12, 13):
        rows = zone(seed, n_days=5)
        train, test = rows.iloc[:PER_DAY], rows.iloc[PER_DAY:]
        away = [fitted(m, train).predict(test) - test["T_za"] for m in (clone(model).set_params(prior=learned), model)]
        ratios.append(np.linalg.norm(away[0]) / np.linalg.norm(away[1]))
    assert np.mean(ratios) < 0.7


def test_the_network_takes_the_size_of_its_nameplate(prior):
    rows = zone(12, n_days=2)
    C_za = [
        fitted(
            clone(SCHEDULE).set_params(prior=prior.for_nameplate(6.0 * size)), rows.assign(Q_hvac=0.0)
        ).gray_box_.theta_["C_za"]
        for size in (1.0, 3.0)
    ]
    assert 2.0 < C_za[1] / C_za[0] < 4.0


@pytest.mark.parametrize(("n_days", "counts"), [(6, True), (7, False)])
def test_the_network_of_other_zones_counts_for_less_than_a_week(prior, n_days, counts):
    rows = zone(7, n_days=n_days + 1)
    known, ahead = rows[: n_days * PER_DAY], rows[n_days * PER_DAY :]
    forecasts = [
        fitted(clone(SCHEDULE).set_params(prior=given), known).forecast(known, ahead)["T_za"]
        for given in (prior, replace(prior, resistances=None))
    ]
    assert forecasts[0].equals(forecasts[1]) is not counts


def test_with_a_fleet_the_daily_profile_hands_over_within_a_week(prior):
    """After 4 of 7 days it is halfway from 0.75 to 0.1; without a fleet the way takes two weeks."""
    rows = zone(7, n_days=4)
    of_rule = [
        fitted(clone(SCHEDULE).set_params(prior=given), rows)._scheme._record.caution(more)[0][-1]
        for given in (prior, None)
        for more in (0.0, 3.0)
    ]
    np.testing.assert_allclose(of_rule, [0.425, 0.1, 0.6, 0.45])


def test_the_front_takes_the_same_prior(prior):
    rows = zone(13, n_days=3)
    front = HybridPredictor(network="2R2C", intervals=False, prior=prior)
    paths = [fitted(model, rows).predict(rows) for model in (front, clone(SCHEDULE).set_params(prior=prior))]
    np.testing.assert_array_equal(*paths)


def test_a_gray_box_takes_it_as_priors(prior):
    assert set(prior) == {"C_w", "C_za", "R_zw", "R_zo"}
    rows = zone(14, n_days=3)
    free, held = (GrayBoxRC(n_starts=1, random_state=0, priors=p).fit(rows, rows["T_za"]) for p in (None, prior))
    median, factor = prior["C_w"]
    away = [abs(np.log(model.theta_["C_w"] / median)) for model in (free, held)]
    assert factor > 1.0
    assert away[1] <= away[0] + 1e-6


# ------------------------------------------------------------------------------------------------------------ files
def test_a_prior_and_a_model_with_one_are_saved(prior, tmp_path):
    save_model(prior, tmp_path / "prior.skops")
    loaded, rows = load_model(tmp_path / "prior.skops"), zone(15, n_days=2)
    models = [fitted(clone(SCHEDULE).set_params(prior=p), rows) for p in (prior, loaded)]
    np.testing.assert_array_equal(*(model.predict(rows) for model in models))
    save_model(models[0], tmp_path / "model.skops")
    np.testing.assert_array_equal(load_model(tmp_path / "model.skops").predict(rows), models[0].predict(rows))


# ---------------------------------------------------------------------------------------------------------- refusals
def refused(message, call):
    with pytest.raises(ValueError, match=message):
        call()


def test_another_kind_of_zone_is_refused(arx_prior, prior):
    coarse = zone(16, n_days=4, step="30min")
    refused("learned at 1 h, this log has 30 min", lambda: fitted(clone(ARX).set_params(prior=arx_prior), coarse))
    refused("learned at 1 h, this log has 30 min", lambda: fitted(clone(SCHEDULE).set_params(prior=prior), coarse))
    rows = zone(16, n_days=4)
    stage = rows.assign(u_heat=rows["Q_hvac"].clip(lower=0.0) / 6.0).drop(columns="Q_hvac")
    refused(
        "from the columns Q_hvac, T_oa, q_sol, this log has T_oa, q_sol, u_heat",
        lambda: fitted(clone(ARX).set_params(prior=arx_prior), stage),
    )
    refused("from the columns Q_hvac", lambda: fitted(clone(SCHEDULE).set_params(prior=prior), stage))
    refused("with n_lags=3, this", lambda: fitted(clone(ARX).set_params(prior=arx_prior, n_lags=4), rows))
    other = SchedulePredictor("1R1C", intervals=False, prior=prior)
    refused("learned with network='2R2C', this one is '1R1C'", lambda: fitted(other, rows))
    given = prior.network
    same = SimpleNamespace(step=given.step, names=given.names, network=given.network)
    given.refuse_other(same)
    same.network = replace(
        given.network, resistors={name: ends[::-1] for name, ends in given.network.resistors.items()}
    )
    with pytest.raises(ValueError, match="give a prior of zones with the same network"):
        given.refuse_other(same)


def test_what_does_not_go_together_is_refused(arx_prior, prior):
    rows = zone(17, n_days=3)
    refused(
        "objective='multi_step'", lambda: fitted(clone(ARX).set_params(prior=arx_prior, objective="multi_step"), rows)
    )
    refused(
        "alpha=1.0 does nothing beside prior=", lambda: fitted(clone(ARX).set_params(prior=arx_prior, alpha=1.0), rows)
    )
    refused("purpose='plan'", lambda: fitted(clone(SCHEDULE).set_params(prior=prior, purpose="plan"), rows))
    refused("must be a FleetPrior", lambda: fitted(clone(SCHEDULE).set_params(prior={"C_w": 4.0}), rows))
    refused("two-stage", lambda: fitted(HybridPredictor(GrayBoxRC(), prior=prior), rows))
    refused("from ARX alone", lambda: dict(arx_prior))


def test_learning_refuses_what_says_nothing(schedules):
    one = fitted(ARX, zone(0))
    refused("models holds 1 zone that learned from two days", lambda: FleetPrior.learn([one]))
    refused("mixes predictors with a network", lambda: FleetPrior.learn([one, schedules[0]]))
    refused("holds a GrayBoxRC", lambda: FleetPrior.learn([GrayBoxRC(), GrayBoxRC()]))
    refused("2 numbers for 3 models", lambda: FleetPrior.learn(schedules, [1.0, 2.0]))
    refused("gives model 1 the size -2", lambda: FleetPrior.learn(schedules, [1.0, -2.0, 3.0]))
    coarse = fitted(ARX, zone(1, step="30min"))
    refused("^model 0 was learned at 1 h, model 1 has 30 min; give zones of", lambda: FleetPrior.learn([one, coarse]))
    refused("^hall was learned at 1 h, attic has", lambda: FleetPrior.learn([one, coarse], names=["hall", "attic"]))
    refused("gives model 0 the size '6'", lambda: FleetPrior.learn(schedules, ["6", 2.0, 3.0]))
    plain = FleetPrior.learn([one, fitted(ARX, zone(1))])
    refused("without sizes", lambda: plain.for_nameplate(6.0))
    for size in (float("nan"), "6", None, True, [6.0]):
        refused("size=.* must be a positive number", lambda size=size: plain.for_nameplate(size))


@pytest.mark.parametrize("rows", [18, 24])
@pytest.mark.parametrize("objective", ["one_step", "multi_step"])
def test_a_zone_of_a_day_is_left_out(rows, objective):
    """Its regression leaves nothing, so that it seemed known for certain: it was the whole prior, or a singular one."""
    arx = clone(ARX).set_params(objective=objective, calendar=True)
    models = [fitted(arx, zone(seed)) for seed in range(2)]
    short = fitted(arx, zone(2).iloc[:rows])
    with pytest.warns(SkhybridWarning, match="1 zone of 3 learned from less than two days.*model 1"):
        found = FleetPrior.learn([models[0], short, models[1]], [6.0, 1.0, 7.0])
    expected = FleetPrior.learn(models, [6.0, 7.0])
    np.testing.assert_array_equal(found.arx[objective].mean, expected.arx[objective].mean)
    assert (found.n_zones, found.nameplates) == (2, expected.nameplates)


def test_a_nameplate_in_another_unit_is_warned_of(arx_prior):
    arx_prior.for_nameplate(20.0)
    with pytest.warns(SkhybridWarning, match="size=6000 is far from the sizes of the fleet, 2 on average"):
        arx_prior.for_nameplate(6000.0)
