"""Logs that do not determine the gain of a plant: forecasts stay plausible, and fit says which gain is a guess."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skhybrid import (
    ARXRegressor,
    GrayBoxRC,
    HybridPredictor,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    TwoStagePredictor,
)
from skhybrid.control.setpoints import Band
from skhybrid.datasets import load_small_office, make_office
from skhybrid.exceptions import ExcitationWarning
from skhybrid.hybrid.blending import members
from skhybrid.hybrid.blending.blend_members import members_beside_network
from skhybrid.hybrid.blending.without_response import WithoutResponse
from skhybrid.hybrid.plausible_range import PlausibleRange

ZONES = Path(__file__).parents[2] / "shared" / "data" / "zones"
DAY = 48  # rows, at 30 min
N_TRAIN = 12 * DAY

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")


def quiet_office(role):
    """An office whose plant gave a trace of heat once, and from the last four days on heats each morning."""
    office = make_office(n_days=16, excitation=None, sampling_time="30min", random_state=1)
    X = office.X.assign(u_heat=0.0, u_cool=0.0)
    later = np.arange(len(X)) >= N_TRAIN
    X["u_heat"] = np.where(later & (X.index.hour >= 6) & (X.index.hour < 10), 0.8, 0.0)
    X.iloc[5 * DAY + 20, X.columns.get_loc("u_heat")] = 0.02
    T = GrayBoxRC(known=office.theta).fit(office.X, office.y).simulate(X, heat_gain=office.heat_gain)
    X["T_za"] = T + np.random.default_rng(1).normal(0.0, 0.03, len(X))
    X = X.drop(columns="u_cool")
    return X if role == "u_heat" else X.drop(columns="u_heat").assign(Q_hvac=6.0 * X["u_heat"])


@pytest.fixture(scope="module", params=["Q_hvac", "u_heat"])
def quiet(request):
    return request.param, quiet_office(request.param)


def two_stage():
    return TwoStagePredictor(PeriodicDisturbanceID(n_starts=1))


def plausible(X):
    """The recipe's bounds, from the temperatures of some rows."""
    low, high = X["T_za"].min(), X["T_za"].max()
    reach = max(high - low + 2.0, 10.0)
    return low - reach, high + reach


def assert_within(bounds, temperatures):
    assert np.min(temperatures) >= bounds[0]
    assert np.max(temperatures) <= bounds[1]


# measured before: 509 K (default) and 15-64 K (two-stage), in forecasts up to a day ahead
@pytest.mark.parametrize(("make", "worst"), [(HybridPredictor, 6.0), (two_stage, 8.0)])
def test_a_plant_that_hardly_ran_is_named_and_its_forecasts_stay_plausible(make, worst, quiet):
    role, X = quiet
    train, later = X[:N_TRAIN], X[N_TRAIN:]
    with pytest.warns(ExcitationWarning, match=f"{role} ran for 0.5 h"):
        model = make().fit(train, train["T_za"])
    predicted = model.predict(later)
    assert np.abs(predicted - later["T_za"]).max() < worst
    assert_within(plausible(X), predicted)
    assert_within(plausible(X), model.predict_quantiles(later))
    assert_within(plausible(X), model.predict_load(later, 21.0)["T_za"])
    tomorrow = later[:DAY].drop(columns="T_za")
    ahead = model.forecast(None, tomorrow, quantiles=(0.05, 0.95))
    assert_within(plausible(train), ahead[["T_za", "q_0.05", "q_0.95"]])
    # the same from the last known row as from a history
    after = later[DAY : 2 * DAY].drop(columns="T_za")
    from_history = model.forecast(later[:DAY], after)["T_za"]
    np.testing.assert_allclose(model.update(later[:DAY]).forecast(None, after)["T_za"], from_history, atol=1e-6)


@pytest.mark.parametrize(
    ("role", "known", "remedy"),
    [
        ("Q_hvac", None, "a few hours; "),
        ("u_heat", None, "or give known=.'Q_h': nameplate kW"),
        ("u_heat", {"Q_h": 6.0}, "a few hours; "),
    ],
)
def test_the_remedy_depends_on_what_is_known(role, known, remedy):
    X = quiet_office(role)[N_TRAIN - 5 * DAY : N_TRAIN]
    with pytest.warns(ExcitationWarning, match=remedy):
        HybridPredictor(known=known, intervals=False).fit(X, X["T_za"])


def test_the_hours_of_a_plant_that_never_stopped_are_told_in_plain_digits():
    X = quiet_office("Q_hvac")[N_TRAIN - 5 * DAY : N_TRAIN].assign(Q_hvac=3.0)
    with pytest.warns(ExcitationWarning, match="Q_hvac ran for 120 h, does not determine its gain"):
        HybridPredictor(intervals=False).fit(X, X["T_za"])


@pytest.mark.parametrize(("days", "hours", "keeps"), [(8, 20.0, True), (6, 20.0, False), (8, 8.0, False)])
def test_arx_keeps_the_heat_of_a_plant_that_ran_for_hours_in_a_week(days, hours, keeps):
    """A plant ran and the network cannot tell its gain: the network is at fault, not the log."""
    X = make_office(8, "chicago", start="2023-10-02", sampling_time="30min", excitation=None, random_state=1).X
    heat = np.where(np.arange(len(X)) >= len(X) - 2 * hours, 1.0, 0.0)
    X = X.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=heat)[-days * DAY :]
    scheme = HybridPredictor(intervals=False).fit(X, X["T_za"])._scheme
    for undetermined in ((), ("Q_hvac",)):
        fit = replace(scheme._physics.fit_, undetermined=undetermined)
        others = members_beside_network(fit, scheme.rows.training, "forecast")
        assert all(isinstance(member, WithoutResponse) for member in others) == bool(undetermined and not keeps)
    for n_rows, n_lags in ((2 * DAY, 24), (2 * DAY - 1, 4)):
        arx, *_ = members_beside_network(replace(fit, undetermined=()), scheme.rows.training.rows(slice(n_rows)), "")
        assert arx.n_lags == n_lags  # few after less than two days


def test_arx_does_not_believe_a_trace_of_heat():
    X = quiet_office("Q_hvac")
    later = X[N_TRAIN:]
    predicted = ARXRegressor().fit(X[:N_TRAIN], X["T_za"][:N_TRAIN]).predict(later)
    assert np.abs(predicted - later["T_za"]).max() < 8.0  # it knows of no heat; before: 21 K


def test_a_stage_that_hardly_ran_keeps_its_default_capacity():
    X = quiet_office("u_heat")[:N_TRAIN]
    with pytest.warns(ExcitationWarning, match="u_heat ran for 0.5 h only, so Q_h cannot be identified"):
        model = OutputDisturbanceID(n_starts=1).fit(X, X["T_za"])
    assert "Q_h" in model.identifiability_.not_excited
    assert model.theta_["Q_h"] == next(p.default for p in model.parameters_ if p.name == "Q_h")


def test_a_stage_that_ran_for_half_an_hour_tells_its_capacity_where_the_model_has_a_disturbance():
    office = make_office(n_days=6, excitation=None, random_state=1)
    X = office.X.assign(u_heat=0.0)
    X.iloc[3 * 96 + 20 : 3 * 96 + 22, X.columns.get_loc("u_heat")] = 1.0
    T = GrayBoxRC(known=office.theta).fit(X, office.y).simulate(X, heat_gain=office.heat_gain)
    y = T + np.random.default_rng(1).normal(0.0, 0.03, len(X))
    known = {"Q_c": office.theta["Q_c"]}
    with pytest.warns(ExcitationWarning, match="u_heat ran for 0.5 h only, so Q_h can hardly be identified"):
        model = OutputDisturbanceID(known=known, n_starts=1).fit(X, y)
    assert model.theta_["Q_h"] == pytest.approx(office.theta["Q_h"], rel=0.15)
    with pytest.warns(ExcitationWarning, match="Q_h cannot be identified and stays at its default"):
        GrayBoxRC(known=known, n_starts=1).fit(X, y)


def test_heat_that_was_measured_as_a_trace_is_named_by_the_identifications():
    X = quiet_office("Q_hvac")[:N_TRAIN]
    with pytest.warns(ExcitationWarning, match="Q_hvac ran for 0.5 h only, so C_w, C_za, R_zw, R_zo can hardly"):
        PeriodicDisturbanceID(n_starts=1).fit(X, X["T_za"])


@pytest.mark.slow
@pytest.mark.skipif(not ZONES.is_dir(), reason="reference data (../shared/data) is not on this machine")
@pytest.mark.parametrize(("make", "worst"), [(HybridPredictor, 1.5), (two_stage, 2.5)])
def test_the_quiet_zone_is_forecast(make, worst):
    """Before: 608 K (default) and 41 K (two-stage)."""
    log = pd.read_csv(ZONES / "quiet_west_strong_base_1.csv.gz", index_col=0, parse_dates=True)
    names = {"T_out_degC": "T_oa", "ghi_kW_m2": "q_sol", "Q_west_kW": "Q_hvac", "T_west_degC": "T_za"}
    X = log[list(names)].rename(columns=names)
    train, later = X["2018-10-08":"2018-11-18"], X["2018-11-19":"2018-11-29"]
    with pytest.warns(ExcitationWarning, match="Q_hvac ran for 0.25 h"):
        model = make().set_params(intervals=False).fit(train, train["T_za"])
    assert np.abs(model.predict(later) - later["T_za"]).max() < worst


def test_ordinary_logs_are_neither_clipped_nor_warned_of(monkeypatch):
    clipped = []
    clip, clip_errors = PlausibleRange.clip, PlausibleRange.clip_errors

    def watched(method):
        def run(self, values):
            out = method(self, values)
            clipped.append(not np.array_equal(out, values, equal_nan=True))
            return out

        return run

    monkeypatch.setattr(PlausibleRange, "clip", watched(clip))
    monkeypatch.setattr(PlausibleRange, "clip_errors", watched(clip_errors))
    small = load_small_office()
    logs = [
        (small.X.assign(T_za=small.y), 96, 28),
        *((make_office(21, c, random_state=2).X, 96, 14) for c in ("oakland", "chicago")),
    ]
    for X, day, n_days in logs:
        n = n_days * day
        with warnings.catch_warnings():
            warnings.simplefilter("error", ExcitationWarning)
            model = HybridPredictor().fit(X[:n], X["T_za"][:n])
        model.predict_quantiles(X[n : n + 7 * day])
    assert len(clipped) > 50
    assert not any(clipped)


def test_a_member_that_runs_away_is_clipped_before_it_enters_the_blend(monkeypatch):
    office = make_office(n_days=9, sampling_time="1h", random_state=3)
    train, later = office.X[: 8 * 24], office.X[8 * 24 :]
    model = HybridPredictor(adapt="linear").fit(train, train["T_za"])
    ordinary, run = model.predict(later), members.RollingSchedule.forecast

    def runaway(self, view, n_leads, clipped=True):
        path, heat = run(self, view, n_leads, clipped)
        return path + 1e6, heat

    monkeypatch.setattr(members.RollingSchedule, "forecast", runaway)
    low, high = plausible(train)
    share = model.weights_.to_numpy()[:, :2].sum(axis=1).max()
    excess = model.predict(later) - ordinary
    assert excess.min() > 0.0
    assert excess.max() <= share * (high - low)


def test_update_grows_the_range_that_is_known():
    office = make_office(n_days=9, sampling_time="1h", random_state=3)
    train, later = office.X[: 8 * 24], office.X[8 * 24 :].copy()
    model = HybridPredictor(intervals=False).fit(train, train["T_za"])
    later.iloc[3, later.columns.get_loc("T_za")] = 32.0
    model.update(later)
    known = model._scheme.rows.plausible
    assert (known.lowest, known.highest) == (min(train["T_za"].min(), later["T_za"].min()), 32.0)


def test_the_range_by_rows():
    T = np.array([np.nan, 20.0, 24.0, np.nan, 18.0])
    found = PlausibleRange(np.nan, np.nan).at(T, np.arange(5))
    np.testing.assert_array_equal(found.lowest[:, 0], [np.nan, 20.0, 20.0, 20.0, 18.0])
    np.testing.assert_array_equal(found.highest[:, 0], [np.nan, 20.0, 24.0, 24.0, 24.0])
    paths = np.tile([-1e3, 21.0, 1e3], (5, 1))
    clipped = found.clip(paths)
    np.testing.assert_array_equal(clipped[0], paths[0])  # nothing is known
    np.testing.assert_array_equal(clipped[1:, 1], 21.0)
    np.testing.assert_array_equal(clipped[1:, 0], [10.0, 10.0, 10.0, 8.0])
    wide = PlausibleRange.of(np.array([0.0, 20.0, np.nan]))
    np.testing.assert_array_equal(wide.clip(np.array([-99.0, 99.0])), [-22.0, 42.0])
    np.testing.assert_array_equal(wide.clip_errors(np.array([-99.0, 5.0, 99.0])), [-64.0, 5.0, 64.0])
    held = Band(np.array([-np.inf, 21.0]), np.array([26.0, np.inf]))
    assert PlausibleRange(20.0, 22.0).around(held) == (20.0, 26.0)
    assert PlausibleRange(10.0, 12.0).clip_errors(np.array([99.0])) == [22.0]  # from exactly 0 degC on


@pytest.mark.parametrize("make", [PeriodicDisturbanceID, OutputDisturbanceID])
def test_two_fits_without_a_seed_agree_to_the_bit(make):
    X = make_office(n_days=4, sampling_time="1h", random_state=0).X
    one, other = (make(known={"Q_h": 6.0}, n_starts=3).fit(X, X["T_za"]) for _ in range(2))
    pd.testing.assert_series_equal(one.theta_, other.theta_, check_exact=True)
    pd.testing.assert_series_equal(one.disturbance_, other.disturbance_, check_exact=True)
    np.testing.assert_array_equal(one.predict(X), other.predict(X))
