"""HybridPredictor: forecasts, loads, nested parameters, search, memory."""

from __future__ import annotations

import pickle
import warnings
from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    RCNetwork,
    SchedulePredictor,
    TwoStagePredictor,
    _table,
)
from skhybrid._holidays import NO_HOLIDAYS
from skhybrid._table import read_table
from skhybrid.datasets import load_small_office, make_office
from skhybrid.exceptions import MeasurementWarning, ScaleNotIdentifiableWarning, SkhybridWarning, UnitWarning
from skhybrid.hybrid.disturbance_steps import join_steps, steps_table
from skhybrid.hybrid.hourly_aggregation import HourlyAggregation
from skhybrid.hybrid.predictor import takes_two_stages
from skhybrid.hybrid.scheme import Paths
from skhybrid.hybrid.two_stage_scheme import TwoStageScheme
from skhybrid.model_selection import RollingOriginSplit
from skhybrid.persistence import load_model, save_model
from skhybrid.preprocessing import UnitConverter

DAY = 96


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=37, random_state=11)


@pytest.fixture(scope="module")
def hybrid(office):
    """The default, trained on four weeks."""
    gray_box = PeriodicDisturbanceID(known={"Q_h": 6.0}, n_starts=1)
    return HybridPredictor(gray_box, random_state=0).fit(office.X[: 28 * DAY], office.y[: 28 * DAY])


def rmse(a, b):
    return float(np.sqrt(np.mean((np.asarray(a) - np.asarray(b)) ** 2)))


def test_an_identification_alone_is_followed_by_ridge(office):
    gray_box = PeriodicDisturbanceID(known={"Q_h": 6.0}, n_starts=1)
    model = HybridPredictor(gray_box, random_state=0).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    assert isinstance(model.gray_box_, PeriodicDisturbanceID)
    assert model.forecaster_.model == "ridge"
    assert model.disturbance_step_ == pd.Timedelta("1h")


def test_the_front_takes_the_schedule_model_or_two_stages(office):
    """Each forecasts to the bit as the estimator that it stands for; a capacity never changes the scheme."""
    X, y, later = office.X[: 7 * DAY], office.y[: 7 * DAY], office.X[7 * DAY : 9 * DAY]
    known = {"Q_h": 5.0}
    gray_box, forecaster = InputDisturbanceID(n_starts=1), DisturbanceForecaster("profile")
    for front, itself, scheme in (
        (HybridPredictor(known=known), SchedulePredictor(known=known), "schedule"),
        (HybridPredictor(network="2R2C", known=known), SchedulePredictor("2R2C", known=known), "schedule"),
        (
            HybridPredictor(gray_box, forecaster, known=known, random_state=0),
            TwoStagePredictor(clone(gray_box).set_params(known=known), forecaster, random_state=0),
            "two-stage",
        ),
        (
            HybridPredictor(forecaster=forecaster, network="1R1C", known=known, random_state=0),
            TwoStagePredictor(PeriodicDisturbanceID("1R1C", known=known), forecaster, random_state=0),
            "two-stage",
        ),
    ):
        front, itself = clone(front).fit(X, y), clone(itself).fit(X, y)
        assert front.scheme_ == itself.scheme_ == scheme
        np.testing.assert_array_equal(front.predict(later), itself.predict(later))
        assert takes_two_stages(front) == (scheme == "two-stage")
        assert hasattr(front, "weights_") == (scheme == "schedule")
    assert HybridPredictor().intervals is SchedulePredictor().intervals is True


def test_the_default_blends_a_network_and_arx(office):
    model = HybridPredictor(known={"Q_h": 6.0}).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    assert model.gray_box is None
    assert model.forecaster is None
    assert set(model.weights_.columns) == {"network", "network, short memory", "ARX", "multi-step ARX", "daily profile"}
    np.testing.assert_allclose(model.weights_.sum(axis=1), 1.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"memory": "somewhere"}, "memory='somewhere' does nothing with the schedule model"),
        ({"n_jobs": 2}, "n_jobs=2 does nothing with the schedule model"),
        ({"known": {"R_zo": 4.0}}, "known= gives 'R_zo', but the schedule model takes capacities"),
        ({"known": {"Q_h": np.nan}}, "known= gives Q_h the value nan"),
        ({"known": {"Q_h": 6.0, "Q_c": 4.0}}, "known= gives Q_c the value 4.0; it must be < 0"),
        ({"known": {"Q_h": -6.0}}, "known= gives Q_h the value -6.0; it must be > 0"),
        ({"known": {"Q_hh": 6.0}}, "known= names 'Q_hh', but the capacities are Q_h, Q_c"),
        ({"gray_box": InputDisturbanceID(n_starts=1), "network": "1R1C"}, "network= does nothing beside a gray_box"),
        (
            {"gray_box": InputDisturbanceID(known={"Q_h": 6.0}), "known": {"Q_h": 5.0}},
            "known= does nothing beside a gray_box that has its own",
        ),
        (
            {"forecaster": DisturbanceForecaster("ridge", case="case03")},
            "forecaster__case='case03' does nothing with model='ridge'",
        ),
        (
            {"forecaster": DisturbanceForecaster(Ridge(), case="case03")},
            r"forecaster__case='case03' does nothing with model=Ridge\(\)",
        ),
        (
            {"forecaster": DisturbanceForecaster("ridge", hidden_size=10)},
            "forecaster__hidden_size=10 does nothing with model='ridge'; leave it out, or set forecaster__model to one",
        ),
        (
            {"forecaster": DisturbanceForecaster("lstm", n_channels=4)},
            "forecaster__n_channels=4 does nothing with model='lstm'; leave it out, or .* one of cnn",
        ),
        ({"network": "2R2C", "memory": "somewhere"}, "memory='somewhere' does nothing"),
    ],
)
def test_a_parameter_that_does_nothing_is_refused(settings, message, office):
    model = HybridPredictor(**settings)
    with pytest.raises(ValueError, match=message):
        model.fit(office.X[:DAY], office.y[:DAY])
    assert not hasattr(model, "scheme_")


def test_temperatures_of_several_zones_are_refused(office):
    with pytest.raises(ValueError, match="y has 2 columns, but HybridPredictor forecasts one zone; fit Building"):
        HybridPredictor().fit(office.X, office.X[["T_za", "T_oa"]])


def test_the_weather_is_read_whether_or_not_the_network_knows_it(office):
    """The members beside the network know what to do with it; of other temperatures only boundaries are read."""
    model, dark = SchedulePredictor(), RCNetwork("dark", {"za": "C_za"}, {"R_zo": ("za", "T_oa")})
    model.preprocess_ = None
    table = model._read(office.X.assign(T_attic=15.0), dark, reset=True)
    assert set(table.inputs) == {"T_oa", "q_sol", "u_heat", "u_cool"}


def test_the_rows_ahead_are_those_of_the_first_path():
    paths = Paths(np.array([[20.0, 21.0], [0.0, 0.0]]), np.array([[1.0, 2.0], [0.0, 0.0]]), np.array([3.0, 0.0]))
    for T_za, expected in ((None, ([20.0, 21.0], [1.0, 2.0])), (19.0, ([19.0, 20.0, 21.0], [3.0, 1.0, 2.0]))):
        found = paths.columns(T_za)
        assert (found["T_za"].tolist(), found["zeta"].tolist()) == expected


@pytest.mark.parametrize("make", [HybridPredictor, PeriodicDisturbanceID])
def test_a_capacity_in_watt_is_told(office, make):
    with pytest.warns(UnitWarning, match="known= gives Q_h 6000 kW: likely W"):
        make(known={"Q_h": 6000.0}).fit(office.X[: 5 * DAY], office.y[: 5 * DAY])


def test_a_search_cannot_compare_copies_of_the_schedule_model(office):
    grid = {"forecaster__case": ["case01", "case03"]}
    search = GridSearchCV(HybridPredictor(), grid, cv=RollingOriginSplit(train="5D", test="1D", n_splits=2))
    with pytest.raises(ValueError, match="forecaster__case does nothing with the schedule model, which has no forec"):
        search.fit(office.X[: 8 * DAY], office.y[: 8 * DAY])


def test_kw_are_relative_where_nothing_says_how_large_they_are(office):
    X, y = office.X[: 5 * DAY], office.y[: 5 * DAY]
    for model in (HybridPredictor(), SchedulePredictor()):
        with pytest.warns(ScaleNotIdentifiableWarning, match="kW are relative: u_heat is taken to give 6 kW at 1"):
            model.fit(X, y)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScaleNotIdentifiableWarning)
        SchedulePredictor(known={"Q_c": -6.0}).fit(X, y)
        measured = X.assign(Q_hvac=6.0 * (X["u_heat"] - X["u_cool"])).drop(columns=["u_heat", "u_cool"])
        SchedulePredictor().fit(measured, y)
        # no stage, no capacity to give
        SchedulePredictor().fit(X.drop(columns=["u_heat", "u_cool"]), y)
        SchedulePredictor().fit(measured.assign(Q_hvac=0.0), y)


def test_it_forecasts_better_than_without_a_disturbance(hybrid, office):
    test = slice(28 * DAY, None)
    alone = GrayBoxRC(known=office.theta, horizon="1D").fit(office.X[: 28 * DAY], office.y[: 28 * DAY])
    with_forecast = rmse(hybrid.predict(office.X[test]), office.y[test])
    without = rmse(alone.predict(office.X[test]), office.y[test])
    assert with_forecast < 0.5 * without


def test_a_forecast_of_the_true_gain_would_be_near_perfect(office):
    """The seam between gray box and forecast: true network, true gain, no forecaster."""
    exact = make_office(n_days=4, noise_std=0.0, sampling_time="5min", random_state=2)
    model = GrayBoxRC(known=exact.theta).fit(exact.X[:864], exact.y[:864])
    ahead = exact.heat_gain.to_numpy()[863:][None, :-1]
    driven = model.drive(exact.X[:864].iloc[-2:], [1], ahead[:, :1])
    assert np.isfinite(driven).all()
    path = model.drive(exact.X, [863], ahead)[0]
    np.testing.assert_allclose(path, exact.y.to_numpy()[864:], atol=0.2)
    truth = model.simulate(exact.X[863:], exact.heat_gain[863:], exact.states.iloc[863])[1:]
    np.testing.assert_allclose(truth, exact.y.to_numpy()[864:], atol=1e-6)


def test_forecast_from_one_origin(hybrid, office):
    history, future = office.X[: 30 * DAY], office.X[30 * DAY : 31 * DAY].drop(columns="T_za")
    out = hybrid.forecast(history, future)
    assert out.index.equals(future.index)
    assert list(out.columns) == ["T_za", "zeta"]
    assert rmse(out["T_za"], office.y[30 * DAY : 31 * DAY]) < 1.0
    assert np.corrcoef(out["zeta"], office.heat_gain[30 * DAY : 31 * DAY])[0, 1] > 0.7
    rolled = hybrid.predict_from(office.X, [30 * DAY - 1], horizon="1D")[0]
    np.testing.assert_allclose(out["T_za"], rolled, atol=0.1)


@pytest.mark.parametrize("begin", [0, 13, 20, 27])
def test_forecast_wherever_the_history_begins(begin, hybrid, office):
    """A history that begins within the kept end of the training, at its start, or with the training table."""
    history, future = office.X[begin * DAY : 29 * DAY + 7], office.X[29 * DAY + 7 : 30 * DAY]
    out = hybrid.forecast(history, future)
    assert rmse(out["T_za"], office.y[29 * DAY + 7 : 30 * DAY]) < 1.0


def test_forecast_refuses_what_does_not_join(hybrid, office):
    past, ahead = office.X[: 2 * DAY], office.X[2 * DAY : 3 * DAY].drop(columns="T_za")
    for model in (hybrid, hybrid.gray_box_):
        with pytest.raises(ValueError, match=r"begins at 2023-07-11 .* ends at 2023-07-09 .* 15 min later"):
            model.forecast(past, office.X[3 * DAY : 4 * DAY])
        with pytest.raises(ValueError, match=r"future begins at 2023-07-10 00.* history ends at 2023-07-10 01"):
            model.forecast(office.X[: 2 * DAY + 5], ahead)
        with pytest.raises(ValueError, match=r"not evenly spaced: .* where most steps are 15 min"):
            model.forecast(past, ahead[::4])
        with pytest.raises(ValueError, match="future has no time stamps; give it a DatetimeIndex"):
            model.forecast(past, ahead.reset_index(drop=True))
        with pytest.raises(ValueError, match="future has no column 'T_oa'"):
            model.forecast(past, ahead.drop(columns="T_oa"))


def test_a_history_and_a_load_need_the_measured_temperature(hybrid, office):
    past, ahead = office.X[: 30 * DAY].drop(columns="T_za"), office.X[30 * DAY : 31 * DAY].drop(columns="T_za")
    for model in (hybrid, hybrid.gray_box_):
        with pytest.raises(ValueError, match="history has no column 'T_za'; give what was measured"):
            model.forecast(past, ahead)
        with pytest.raises(ValueError, match="history has no column 'T_za'"):
            model.affine_forecast(past, ahead, inputs=["u_heat"])
        with pytest.raises(ValueError, match="X has no column 'T_za' and does not begin one step after"):
            model.predict_load(ahead, 21.0)


def test_a_forecast_from_nothing_is_told(hybrid, office):
    """It begins at the mean of the training; in silence, where the column was there without a value."""
    past, ahead = office.X[30 * DAY : 31 * DAY].assign(T_za=np.nan), office.X[31 * DAY : 32 * DAY].drop(columns="T_za")
    words = "T_za is missing in all rows, which do not follow the last known"
    for model in (hybrid, hybrid.gray_box_):
        for call in (
            model.predict,
            lambda X, m=model: m.predict_load(X, 21.0),
            lambda X, m=model: m.forecast(X, ahead),
        ):
            with pytest.warns(MeasurementWarning, match=words):
                call(past)
    with warnings.catch_warnings():
        warnings.simplefilter("error", MeasurementWarning)
        hybrid.predict(past.assign(T_za=office.X["T_za"].where(office.X.index == past.index[3])))
        hybrid.predict(office.X[28 * DAY : 29 * DAY].assign(T_za=np.nan))  # follows the training
        hybrid.forecast(past, ahead, T_za=21.0)
        hybrid.forecast(past, ahead, T_za=20.0)


def test_future_needs_no_temperature_under_any_name(office):
    named = {"T_za": "room", "T_oa": "outside"}
    X, y = office.X[: 8 * DAY].rename(columns=named), office.y[: 7 * DAY]
    gray_box = PeriodicDisturbanceID(known=office.theta, n_starts=1, columns=dict(named))
    model = HybridPredictor(gray_box).fit(X[: 7 * DAY], y)
    ahead = X[7 * DAY :]
    without = model.forecast(X[: 7 * DAY], ahead.drop(columns="room"))
    pd.testing.assert_frame_equal(without, model.forecast(X[: 7 * DAY], ahead))


def test_tables_that_were_read_are_forecast_as_frames_are(hybrid, office):
    whole = _table.read_table(BaseEstimator(), office.X[: 31 * DAY], reset=True)
    history, future = whole.rows(slice(30 * DAY)), whole.rows(slice(30 * DAY, None))
    frames = office.X[: 30 * DAY], office.X[30 * DAY : 31 * DAY]
    pd.testing.assert_frame_equal(hybrid.forecast(history, future), hybrid.forecast(*frames))
    with pytest.raises(ValueError, match=r"future begins at 2023-.*, but history ends at"):
        hybrid.forecast(history, future.rows(slice(1, None)))
    with pytest.raises(ValueError, match="future has no role 'q_sol'"):
        hybrid.forecast(history, future.replace(inputs={"T_oa": future.inputs["T_oa"]}))
    now = deepcopy(hybrid).update(office.X[28 * DAY : 30 * DAY])
    pd.testing.assert_frame_equal(now.forecast(None, future), deepcopy(now).forecast(None, frames[1]))


def test_forecast_in_time_zones(office):
    X, y = (table.tz_localize("America/Chicago") for table in (office.X[: 9 * DAY], office.y[: 9 * DAY]))
    past, ahead = X[: 8 * DAY], X[8 * DAY :]
    model = HybridPredictor(PeriodicDisturbanceID(known=office.theta, n_starts=1)).fit(past, y[: 8 * DAY])
    in_utc = model.forecast(past, ahead.tz_convert("UTC"))
    assert str(in_utc.index.tz) == "UTC"
    np.testing.assert_array_equal(in_utc.to_numpy(), model.forecast(past, ahead).to_numpy())
    with pytest.raises(ValueError, match="history has the time zone America/Chicago, future None"):
        model.forecast(past, ahead.tz_localize(None))
    local = pd.Series(np.linspace(18.0, 22.0, len(ahead)), ahead.index)
    held = model.forecast(past, ahead, setpoint=local).to_numpy()
    in_utc = model.forecast(past, ahead.tz_convert("UTC"), setpoint=local.tz_convert("UTC"))  # of its own rows
    np.testing.assert_array_equal(in_utc.to_numpy(), held)
    with pytest.raises(ValueError, match="setpoint has other time stamps"):
        model.forecast(past, ahead, setpoint=local.tz_localize(None))


def test_load_for_the_measured_temperature(hybrid, office):
    test = slice(28 * DAY, 33 * DAY)
    load = hybrid.predict_load(office.X[test], office.y[test])
    measured = 6.0 * office.X["u_heat"][test] - 6.0 * office.X["u_cool"][test]
    assert {"u_heat", "u_cool", "Q_hvac", "Q_hvac_unclipped", "zeta"} <= set(load.columns)
    assert load.index.equals(office.X.index[test])
    conventional = hybrid.gray_box_.predict_load(office.X[test].assign(), office.y[test])
    assert rmse(load["Q_hvac"], measured) < 1.2 * rmse(conventional["Q_hvac"], measured)
    assert rmse(load["Q_hvac"], measured) < 1.5


def test_load_reads_no_plant_columns(hybrid, office):
    test = slice(28 * DAY, 29 * DAY)
    one = hybrid.predict_load(office.X[test], 23.0)
    other = hybrid.predict_load(office.X[test].assign(u_heat=0.5), 23.0)
    np.testing.assert_allclose(one["Q_hvac"][:DAY], other["Q_hvac"][:DAY], atol=1e-9)


@pytest.mark.parametrize("disturbance", ["input", "output"])
def test_both_disturbances_with_a_published_gray_box(disturbance, office):
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=4)
    model = HybridPredictor(
        gray_box, DisturbanceForecaster(model="profile"), disturbance=disturbance, random_state=0
    ).fit(office.X[: 21 * DAY], office.y[: 21 * DAY])
    test = slice(21 * DAY, 28 * DAY)
    predicted = model.predict(office.X[test])
    assert np.isfinite(predicted).all()
    assert rmse(predicted, office.y[test]) < rmse(
        model.gray_box_.set_params(horizon="1D").predict(office.X[test]), office.y[test]
    )


def test_adaptation_refits_on_full_weeks_only(hybrid, office):
    still = clone(hybrid).set_params(adapt=None)
    still.__dict__.update({k: v for k, v in hybrid.__dict__.items() if k.endswith("_") or k.startswith("_")})
    X = office.X[28 * DAY :]
    adapted, frozen = hybrid.predict(X), still.predict(X)
    np.testing.assert_array_equal(adapted[: 6 * DAY], frozen[: 6 * DAY])
    # only what came after the training is new, wherever the table begins
    late = [36 * DAY - 1]
    assert not np.array_equal(hybrid.predict_from(office.X, late), still.predict_from(office.X, late))
    assert not np.array_equal(adapted[8 * DAY :], frozen[8 * DAY :])
    assert np.isfinite(adapted).all()
    far = make_office(n_days=16, start="2024-01-15", random_state=1).X  # months after the training
    assert np.isfinite(hybrid.predict(far)).all()
    assert not np.array_equal(hybrid.predict(far)[10 * DAY :], still.predict(far)[10 * DAY :])


def test_a_forecaster_is_refitted_at_the_last_step_of_a_full_week():
    index = pd.date_range("2024-01-01", periods=10 * 24, freq="1h")
    steps = SimpleNamespace(table=read_table(BaseEstimator(), pd.DataFrame({"T_oa": 0.0}, index), reset=True))
    scheme = SimpleNamespace(
        adapt="linear", forecaster_=SimpleNamespace(model="profile"), disturbance_step_=pd.Timedelta("1h"),
        _aggregation=SimpleNamespace(labels=index[:0].asi8), _learned_to=index[23].as_unit("ns").value, _settled=True,
        _refit=SimpleNamespace(fitted_once=lambda n_steps, until: n_steps), _steps_until=print,
    )  # fmt: skip
    known = np.array([23, 8 * 24 - 2, 8 * 24 - 1, 9 * 24])  # the training ends with the first day
    (first, before), (n_steps, after) = TwoStageScheme._forecasters(scheme, steps, known, False)
    assert first is scheme.forecaster_
    assert (before.tolist(), n_steps, after.tolist()) == ([0, 1], 7 * 24, [2, 3])


def test_other_steps_and_time_zones(office):
    hourly = office.X.resample("1h").mean()
    hourly.index = hourly.index.tz_localize("America/Los_Angeles")
    model = HybridPredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=2), random_state=0)
    model.fit(hourly[: 28 * 24], hourly["T_za"][: 28 * 24])
    assert model.disturbance_step_ == pd.Timedelta("1h")
    assert np.isfinite(model.predict(hourly[28 * 24 :])).all()
    odd = office.X.resample("25min").mean()
    model = clone(model).set_params(horizon="5h").fit(odd[:800], odd["T_za"][:800])
    assert model.disturbance_step_ == pd.Timedelta("25min")
    assert np.isfinite(model.predict(odd[800:])).all()


def test_half_hour_offsets_and_odd_stamps(office):
    X = office.X.set_axis(office.X.index.tz_localize("Asia/Kolkata") + pd.Timedelta("7min"))
    model = HybridPredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1), random_state=0)
    model.fit(X[: 14 * DAY], X["T_za"][: 14 * DAY])
    assert np.isfinite(model.predict(X[14 * DAY : 16 * DAY])).all()
    assert np.isfinite(model.predict(X[20 * DAY + 5 : 22 * DAY])).all()


def test_arrays_and_columns_by_role(office):
    renamed = office.X.rename(columns={"T_oa": "outdoor", "T_za": "room"})
    model = HybridPredictor(
        InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1, columns={"T_oa": "outdoor", "T_za": "room"}), random_state=0
    )
    model.fit(renamed[: 7 * DAY], office.y[: 7 * DAY])
    plain = clone(model).set_params(gray_box__columns=None).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    np.testing.assert_array_equal(model.predict(renamed[7 * DAY : 9 * DAY]), plain.predict(office.X[7 * DAY : 9 * DAY]))
    array = office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy()
    blind = HybridPredictor(InputDisturbanceID(n_starts=1), random_state=0, sampling_time="15min")
    blind.fit(array[: 7 * DAY], office.y[: 7 * DAY])
    assert np.isfinite(blind.predict(array[7 * DAY : 9 * DAY])).all()


@pytest.mark.slow
def test_pipeline_grid_search_is_the_same_in_parallel(office):
    """The search that the package is made for: transformer, nested parameters, rolling splits, two processes."""
    X = office.X[: 16 * DAY].assign(q_sol=office.X["q_sol"][: 16 * DAY] * 1000.0)
    pipeline = Pipeline(
        [
            ("units", UnitConverter(units={"q_sol": "W/m2"}).set_output(transform="pandas")),
            (
                "hybrid",
                HybridPredictor(
                    InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1),
                    DisturbanceForecaster(max_epochs=2, patience=2),
                    random_state=0,
                ),
            ),
        ]
    )
    grid = {
        "hybrid__forecaster__model": ["lstm", "mlp"],
        "hybrid__forecaster__case": ["case01"],
        "hybrid__forecaster__hidden_size": [4, 6],
    }
    cv = RollingOriginSplit(train="10D", test="2D", gap="0D", n_splits=2)
    one = GridSearchCV(pipeline, grid, cv=cv, n_jobs=1, error_score="raise").fit(X, office.y[: 16 * DAY])
    two = GridSearchCV(pipeline, grid, cv=cv, n_jobs=2, error_score="raise").fit(X, office.y[: 16 * DAY])
    for key in ("split0_test_score", "split1_test_score"):
        np.testing.assert_allclose(one.cv_results_[key], two.cv_results_[key], rtol=1e-12)  # equal but in old torch
    assert np.isfinite(one.cv_results_["mean_test_score"]).all()
    assert one.best_params_ == two.best_params_


def test_settings_of_default_parts_can_be_set():
    for model in (TwoStagePredictor(horizon="6h"), HybridPredictor(horizon="6h", disturbance="output")):
        model.set_params(forecaster__model="lstm", forecaster__case="case03", gray_box__network="1R1C")
        assert (model.forecaster.model, model.forecaster.case) == ("lstm", "case03")
        for horizon in ("6h", "3h"):  # a part that was not given goes on following
            assert clone(model).set_params(horizon=horizon)._forecaster_part().horizon == horizon
        assert isinstance(model.gray_box, PeriodicDisturbanceID)
        assert model.gray_box.network == "1R1C"
    assert HybridPredictor().set_params(forecaster=None).forecaster is None
    with pytest.raises(ValueError, match="Invalid parameter 'cases'"):
        TwoStagePredictor().set_params(forecaster__cases="case03")
    model = HybridPredictor().set_params(disturbance="output", forecaster__model="profile")
    assert model.forecaster.model == "profile"
    model = HybridPredictor().set_params(forecaster=DisturbanceForecaster(), forecaster__case="case03")
    assert model.forecaster.case == "case03"


def test_a_default_gray_box_is_tuned_beside_its_network(office):
    """Also after a clone: what was set for a part that nobody gave does not count as a gray box of one's own."""
    given = {"network": "1R1C", "known": {"Q_h": 6.0}, "disturbance": "output"}
    for make in (HybridPredictor, TwoStagePredictor):
        model = clone(make(**given, intervals=False).set_params(gray_box__n_starts=1))
        assert model._make_scheme().network.name == "1R1C"
        model.set_params(network="2R2C").fit(office.X[: 5 * DAY], office.y[: 5 * DAY])
        assert (model.gray_box_.network_.name, model.gray_box_.n_starts) == ("2R2C", 1)
        assert model.gray_box_.theta_["Q_h"] == 6.0
        with pytest.raises(ValueError, match="network= does nothing beside a gray_box, which has its own"):
            model.set_params(gray_box__network="1R1C")._make_scheme()


@pytest.mark.parametrize("given", [{}, {"gray_box": InputDisturbanceID(), "forecaster": DisturbanceForecaster()}])
def test_refused_parameters_leave_the_estimator_as_it_was(given):
    model = TwoStagePredictor(**given)
    parts, before = (model.gray_box, model.forecaster), model.get_params()
    for name in ("gray_box__bogus", "forecaster__bogus", "bogus"):
        wrong = {"horizon": "6h", "gray_box__n_starts": 3, "forecaster__hidden_size": 7, name: 1}
        with pytest.raises(ValueError, match="Invalid parameter 'bogus'"):
            model.set_params(**wrong)
        assert model.get_params() == before
        assert (model.gray_box, model.forecaster) == parts


def test_a_missing_role_names_the_callers_columns(office):
    with pytest.raises(ValueError, match="role 'T_oa' is missing: X has 'outside', 'q_sol'"):
        HybridPredictor().fit(office.X.rename(columns={"T_oa": "outside"}), office.y)


@pytest.fixture(scope="module")
def frozen(office):
    """A gray box identified on one week, and a predictor of the fortnight after it."""
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=2, random_state=0).fit(
        office.X[: 7 * DAY], office.y[: 7 * DAY]
    )
    model = HybridPredictor(FrozenEstimator(gray_box), DisturbanceForecaster("ridge"), adapt=None)
    return gray_box, model.fit(office.X[9 * DAY : 23 * DAY], office.y[9 * DAY : 23 * DAY])


def test_a_frozen_gray_box_is_used_as_it_is(frozen, office, tmp_path):
    gray_box, model = frozen
    end = gray_box.filtered_network_.rolling.tail.index[-1]
    assert end == office.X.index[7 * DAY - 1]  # the given one is as it was
    pd.testing.assert_series_equal(model.gray_box_.theta_, gray_box.theta_)
    found, given = (one.disturbance_.drop("T0_w") for one in (model.gray_box_, gray_box))  # T0_w is that of its rows
    pd.testing.assert_series_equal(found, given)
    rows = office.X[23 * DAY : 24 * DAY]
    drive = model.gray_box_.drive(rows, [0], np.zeros((1, 8)))
    whole = gray_box.drive(office.X[9 * DAY : 24 * DAY], [14 * DAY], np.zeros((1, 8)))
    np.testing.assert_allclose(drive, whole, atol=1e-3)  # the same state, from another start a fortnight before
    unmeasured = rows.drop(columns="T_za")
    ahead = model.forecast(None, unmeasured)["T_za"]
    np.testing.assert_allclose(ahead, model.predict(unmeasured), atol=1e-9)
    assert rmse(ahead, office.y[rows.index]) < 1.0
    path = tmp_path / "model.skops"
    save_model(model, path)
    np.testing.assert_array_equal(load_model(path).predict(rows), model.predict(rows))


def test_a_frozen_gray_box_is_not_identified_again(frozen, office):
    gray_box, model = frozen
    later = deepcopy(model).set_params(adapt="full")
    later = later.fit(office.X[9 * DAY : 23 * DAY], office.y[9 * DAY : 23 * DAY])
    later.partial_fit(office.X[23 * DAY : 30 * DAY], office.y[23 * DAY : 30 * DAY])
    pd.testing.assert_series_equal(later.gray_box_.theta_, gray_box.theta_)
    assert later.forecaster_.training_ != model.forecaster_.training_
    with pytest.raises(NotFittedError):
        clone(model).set_params(gray_box=FrozenEstimator(GrayBoxRC())).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    with pytest.raises(ValueError, match="known= does nothing beside a frozen gray_box"):
        clone(model).set_params(known={"Q_h": 6.0}).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    hourly = office.X[::4]
    with pytest.raises(ValueError, match="sampling time of 1 h"):
        clone(model).fit(hourly, hourly["T_za"])


@pytest.mark.parametrize("kind", [GrayBoxRC, OutputDisturbanceID])
def test_the_conventional_approach_expects_no_disturbance(kind, office):
    train, test = slice(0, 7 * DAY), slice(7 * DAY, 9 * DAY)
    gray_box = kind(known={"Q_h": 6.0}, n_starts=1, random_state=0)
    model = TwoStagePredictor.conventional(gray_box).fit(office.X[train], office.y[train])
    X, origins = office.X[test], np.array([0, DAY // 2])
    driven = model.gray_box_.drive(X, origins, np.zeros((2, DAY)))
    np.testing.assert_allclose(model.predict_from(X, origins), driven)
    assert not np.allclose(driven, model.gray_box_.predict_from(X, origins, horizon="1D"), atol=0.01)
    load = model.gray_box_.required_heat(X, office.y[test], [0, DAY], np.zeros((2, DAY)))
    held = model.predict_load(X, office.y[test])
    np.testing.assert_allclose(held["u_heat"], load["u_heat"], atol=1e-9)
    assert (held["zeta"] == 0.0).all()
    later = model.gray_box_.required_heat(X, office.y[test][DAY:], [DAY], np.zeros((1, DAY)))
    pd.testing.assert_frame_equal(later, load[DAY:])


def test_memory_identifies_once(office, tmp_path):
    model = HybridPredictor(
        InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1), DisturbanceForecaster(model="ridge"), memory=str(tmp_path)
    ).set_params(random_state=0)
    first = model.fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    kept = sorted(p.name for p in tmp_path.rglob("output.pkl"))
    other = clone(model).set_params(forecaster__model="profile").fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    assert sorted(p.name for p in tmp_path.rglob("output.pkl")) == kept
    assert len(kept) == 1
    pd.testing.assert_series_equal(first.gray_box_.theta_, other.gray_box_.theta_)
    clone(model).set_params(gray_box__n_starts=2).fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    assert len(list(tmp_path.rglob("output.pkl"))) == 2


def test_pickle(hybrid, office):
    again = pickle.loads(pickle.dumps(hybrid))
    X = office.X[28 * DAY :]
    np.testing.assert_array_equal(again.predict(X), hybrid.predict(X))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"disturbance": "both"}, "disturbance='both'"),
        ({"adapt": "daily"}, "adapt='daily'"),
        ({"intervals": "no"}, "intervals='no' must be True or False"),
        ({"verbose": "a"}, "verbose='a' must be True, False or an integer"),
        ({"verbose": "a", "disturbance": "output"}, "verbose='a' must be True, False or an integer"),
        ({"forecaster": DisturbanceForecaster("ridge", verbose="a")}, "verbose='a' must be True, False or an integer"),
        ({"n_jobs": 0, "disturbance": "output"}, "n_jobs=0 must be a number of workers"),
        ({"horizon": "50min"}, "horizon='50min' is not a positive multiple"),
        ({"known": 6.0}, "known=6.0 must be a mapping of parameters to values"),
        ({"known": {"Q_h": None}}, "known= gives Q_h no value; give a number, or leave it out"),
        ({"forecaster": DisturbanceForecaster(), "memory": 3}, "memory=3 must be a folder or a joblib.Memory"),
        (
            {"forecaster": "ridge"},
            r"forecaster='ridge' must be a DisturbanceForecaster; give DisturbanceForecaster\('ridge'\)",
        ),
        ({"forecaster": Ridge()}, r"forecaster=Ridge\(\) must be .*; give DisturbanceForecaster\(Ridge\(\)\)"),
        ({"forecaster": DisturbanceForecaster}, "forecaster=<class .* must be a DisturbanceForecaster; give"),
        ({"gray_box": "2R2C"}, "gray_box='2R2C' must be an identification; give one such as PeriodicDisturbanceID"),
        ({"gray_box": ARXRegressor()}, r"gray_box=ARXRegressor\(\) must be an identification"),
        ({"gray_box": InputDisturbanceID}, "gray_box=<class .* must be an identification"),
        ({"preprocess": "abc"}, "preprocess='abc' must be a transformer; give one such as GapFiller"),
        ({"preprocess": Ridge()}, r"preprocess=Ridge\(\) must be a transformer"),
    ],
)
def test_bad_settings_are_refused(settings, message, office):
    with pytest.raises(ValueError, match=message):
        HybridPredictor(**settings).fit(office.X[:DAY], office.y[:DAY])


def test_settings_of_parts_are_not_passed_over():
    """A seed of 0 is a seed; what a part lacks it takes from the predictor."""
    parts = InputDisturbanceID(random_state=0), DisturbanceForecaster(random_state=0)
    for own, wanted in ((0, 0), (None, 7)):
        model = TwoStagePredictor(*(part.set_params(random_state=own) for part in parts), random_state=7)
        scheme = model._make_scheme()
        assert (scheme.gray_box.random_state, scheme.forecaster.random_state) == (wanted, wanted)


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({}, ImportError, "model='lstm' needs torch and skorch"),
        ({"case": "case21"}, ValueError, "case='case21' is not known for model='lstm'"),
        ({"device": "nowhere"}, ValueError, "device='nowhere' cannot be used here"),
    ],
)
def test_a_network_that_cannot_be_trained_is_refused_before_the_identification(
    settings, error, message, office, monkeypatch
):
    pytest.importorskip("torch")
    if not settings:
        monkeypatch.setattr("skhybrid.forecasting.named_models.find_spec", lambda name: None)
    monkeypatch.setattr(InputDisturbanceID, "fit", lambda *args: pytest.fail("an identification has begun"))
    with pytest.raises(error, match=message):
        TwoStagePredictor(InputDisturbanceID(), DisturbanceForecaster("lstm", **settings)).fit(office.X, office.y)


def test_an_unknown_adapt_is_refused_after_fit_too(hybrid, office):
    model = deepcopy(hybrid).set_params(adapt="daily")
    for call in (model.predict, lambda X: model.forecast(None, X), lambda X: model.predict_load(X, 20.0)):
        with pytest.raises(ValueError, match="adapt='daily'"):
            call(office.X[28 * DAY : 29 * DAY])


def test_set_point_of_another_index_is_refused(hybrid, office):
    with pytest.raises(ValueError, match="setpoint has other time stamps"):
        hybrid.predict_load(office.X[28 * DAY : 29 * DAY], office.y[:DAY])


# --------------------------------------------------------------------------------------------- reads and model size
@pytest.mark.parametrize("scheme", ["schedule", "two-stage"])
def test_a_table_is_read_once_per_call(scheme, office, monkeypatch):
    reads = []
    parse = _table._parse
    monkeypatch.setattr(_table, "_parse", lambda *args: reads.append(args) or parse(*args))
    gray_box = None if scheme == "schedule" else InputDisturbanceID(n_starts=1)
    model = HybridPredictor(gray_box, known={"Q_h": 6.0}, random_state=0)
    X, n = office.X, 12 * DAY

    def count(call):
        reads.clear()
        call()
        return len(reads)

    assert count(lambda: model.fit(X[:n], office.y[:n])) == 1
    assert model.scheme_ == scheme
    history, future = X[n : n + 9 * DAY], X[n + 9 * DAY : n + 10 * DAY]
    for name, call in {
        "predict": lambda: model.predict(history),
        "predict_from": lambda: model.predict_from(history, [3, DAY]),
        "quantiles": lambda: model.predict_quantiles(history),
        "load": lambda: model.predict_load(history, 21.0),
        "drift": lambda: model.drift(history),
        "forecast": lambda: model.forecast(history, future, quantiles=(0.1, 0.9)),
        "update": lambda: model.update(history),
        "forecast from now": lambda: model.forecast(None, future, quantiles=(0.1, 0.9)),
        "partial_fit": lambda: model.partial_fit(future, future["T_za"]),
    }.items():
        assert count(call) == 1, name


def test_a_forecaster_of_another_kind_is_given_frames(office):
    """A regressor that knows no tables of this package, by the methods that a forecaster needs."""
    model = TwoStagePredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1), _MeanOfDay(), adapt="linear")
    model.fit(office.X[: 7 * DAY], office.y[: 7 * DAY])
    assert model.forecaster_.columns_ == ["T_oa", "q_sol", "u_heat", "u_cool", "zeta"]
    assert np.isfinite(model.predict(office.X[7 * DAY : 9 * DAY])).all()
    assert np.isfinite(model.predict_quantiles(office.X[7 * DAY : 9 * DAY])).all()
    model.update(office.X[7 * DAY : 8 * DAY])
    assert np.isfinite(model.forecast(None, office.X[8 * DAY : 9 * DAY])).all(axis=None)


class _MeanOfDay(BaseEstimator):
    def fit(self, X, y):
        assert isinstance(X, pd.DataFrame)
        assert X.index.equals(y.index)
        self.columns_, self.mean_ = list(X.columns), float(y.mean())
        return self

    def predict_from(self, X, origins, horizon):
        assert isinstance(X, pd.DataFrame)
        return np.full((len(origins), int(horizon / (X.index[1] - X.index[0]))), self.mean_)


def test_a_saved_default_of_four_weeks_is_small_and_the_same(office, tmp_path):
    """One copy of the training rows and nothing that can be computed from them."""
    n = 28 * DAY
    model = HybridPredictor(known={"Q_h": 6.0}).fit(office.X[:n], office.y[:n])
    save_model(model, tmp_path / "zone.skops")
    assert (tmp_path / "zone.skops").stat().st_size < 1.0e6
    assert len(pickle.dumps(model)) < 1.3e6
    X, y = office.X[n:], office.y[n:]
    calls = (
        lambda m: m.predict(X),
        lambda m: m.predict_quantiles(X),
        lambda m: m.predict_load(X, (20.0, 24.0)),
        lambda m: m.drift(X)["statistic"],
        lambda m: m.forecast(None, X[:DAY]),
        lambda m: m.update(X[:50]).forecast(None, X[50 : 2 * DAY]),
        lambda m: m.partial_fit(X[50:DAY], y[50:DAY]).predict(X[DAY:]),
        lambda m: m.weights_,
        lambda m: m.gray_box_.coef_,
        lambda m: m.zeta_,
    )
    for again in (load_model(tmp_path / "zone.skops"), pickle.loads(pickle.dumps(model))):
        one = deepcopy(model)
        for call in calls:
            np.testing.assert_array_equal(call(again), call(one))


@pytest.mark.parametrize("make", [HybridPredictor, lambda: TwoStagePredictor(random_state=0), ARXRegressor])
def test_hours_are_those_of_the_training_s_time_zone(make):
    """A database gives UTC: the same rows have the same forecast, whether or not they follow the training."""
    X = load_small_office().X.resample("1h").mean().tz_convert("America/Chicago")
    train, later = X["2018-10-05":"2018-11-02"], X["2018-11-10":"2018-11-20"]  # winter time begins in between
    model = make().fit(train, train["T_za"])
    assert_array_equal = np.testing.assert_array_equal
    assert_array_equal(model.predict(later), model.predict(later.tz_convert("UTC")))
    if not isinstance(model, ARXRegressor):
        history, ahead = train[-14 * 24 :], X["2018-11-03":"2018-11-04"].drop(columns="T_za")
        local, utc = model.forecast(history, ahead), model.forecast(history.tz_convert("UTC"), ahead.tz_convert("UTC"))
        assert_array_equal(local.to_numpy(), utc.to_numpy())
        assert str(utc.index.tz) == "UTC"


def test_training_that_is_moved_by_weeks_keeps_its_hours():
    """Steps of a winter before those of a summer: 9 h is 9 h."""
    zone = "America/Chicago"

    def steps(first, n_days):
        index = pd.date_range(first, periods=24 * n_days, freq="1h", tz=zone)
        return steps_table(
            index.tz_convert("UTC"), zone, {"T_oa": np.zeros(len(index))}, index.hour.to_numpy(float),
            pd.Timedelta("1h"), NO_HOLIDAYS,
        )  # fmt: skip

    joined = join_steps(steps("2024-01-01", 21), steps("2024-06-03", 7))
    known = np.isfinite(joined.history["zeta"])
    assert known.sum() == 28 * 24
    np.testing.assert_array_equal(joined.history["zeta"][known], joined.time.hour[known])


def test_means_by_hours_go_on_from_one_beginning_in_two_ways():
    """The two do not share the rows that they were given; a third one goes on from each of them."""
    quarters = pd.date_range("2024-01-01", periods=40, freq="15min").as_unit("ns").asi8
    first = HourlyAggregation(["T_oa", "zeta"], pd.Timedelta("1h"), True, None).added(quarters[:9], np.ones((9, 2)))
    one = first.added(quarters[9:25], np.full((16, 2), 2.0))
    other = first.added(quarters[9:25], np.full((16, 2), 3.0))
    for found, value in ((one, 2.0), (other, 3.0)):
        zeta = found.added(quarters[25:], np.full((15, 2), 9.0)).table().history["zeta"]
        np.testing.assert_allclose(
            zeta, [1.0, 1.0, (1.0 + 3 * value) / 4, value, value, value, (value + 27.0) / 4, 9, 9]
        )


def test_a_short_table_of_two_stages_is_warned_of_once():
    pytest.importorskip("torch")
    office = make_office(n_days=3, sampling_time="1h", random_state=1)
    forecaster = DisturbanceForecaster("mlp", max_epochs=2)
    with pytest.warns(SkhybridWarning) as caught:
        TwoStagePredictor(None, forecaster, network="1R1C", known={"Q_h": 6.0, "Q_c": -6.0}, random_state=0).fit(
            office.X, office.y
        )
    assert [str(one.message)[:35] for one in caught] == ["validation_fraction=0.2 of 72 rows "]
