"""Forecasts in which only set-points are known: the thermostat acts, temperature and load are forecast."""

import copy
import inspect
import re
import warnings
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, clone
from sklearn.dummy import DummyRegressor

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    InputDisturbanceID,
    OutputDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid._table import read_table
from skhybrid.control import Band, Limits, LoadPaths, WantedPaths
from skhybrid.datasets import make_office
from skhybrid.exceptions import MeasurementWarning, PlanWarning, UnitWarning
from skhybrid.forecasting import WeatherError
from skhybrid.forecasting.intervals import PathClock
from skhybrid.hybrid.setpoint_columns import band_of
from skhybrid.hybrid.thermostat_law import law_refits, member_intervals
from skhybrid.hybrid.thermostat_law.boosted_trees import fit_trees
from skhybrid.hybrid.thermostat_law.closed_loop import ClosedLoop
from skhybrid.hybrid.thermostat_law.law_errors import LawErrors
from skhybrid.hybrid.thermostat_law.law_features import LawRows, further_features, same_clock, same_plan
from skhybrid.hybrid.thermostat_law.member_intervals import MemberValues, StateIntervals, reaching
from skhybrid.hybrid.thermostat_law.plant_capacity import PlantCapacity
from skhybrid.hybrid.thermostat_law.plant_law import LawPairs, make_pairs
from skhybrid.hybrid.thermostat_law.possible_loads import PossibleLoads
from skhybrid.model_selection import backtest
from skhybrid.persistence import load_model, save_model
from skhybrid.thermal import RCNetwork

DAY, TRAINED = 24, 21 * 24
PLANT = ["u_heat", "u_cool"]
SIDES = ["T_heat_set", "T_cool_set"]


@pytest.fixture(scope="module")
def log():
    office = make_office(25, "chicago", start="2023-10-02", random_state=3, sampling_time="1h", excitation=None)
    return office.X.join(office.setpoints)


def fit(log):
    train = log[:TRAINED]
    return SchedulePredictor("2R2C", known={"Q_h": 6.0}).fit(train, train["T_za"])


@pytest.fixture(scope="module")
def full_model(log):
    """A model of full quality, for what is said of it."""
    return fit(log)


@pytest.fixture(scope="module", autouse=True)
def others_quick(full_model, quick_fits):
    """All other models are learned in a moment."""


@pytest.fixture(scope="module")
def model(log):
    return fit(log)


@pytest.fixture(scope="module")
def two_stages(log):
    gray_box = InputDisturbanceID("1R1C", known={"Q_h": 6.0}, n_starts=1)
    model = TwoStagePredictor(gray_box, DisturbanceForecaster("profile"), intervals=False, random_state=0)
    return model.fit(log[: 14 * DAY], log["T_za"][: 14 * DAY])


def ahead(log, first, n=DAY):
    """Rows from one on, without what is not known in advance."""
    return log[first : first + n].drop(columns=[*PLANT, "T_za"])


def test_set_points_leave_a_forecast_under_given_heat_as_it_is(log, model):
    train, later = log[:TRAINED], log[TRAINED:]
    plain = ["T_oa", "q_sol", *PLANT, "T_za"]
    without = SchedulePredictor("2R2C", known={"Q_h": 6.0}).fit(train[plain], train["T_za"])
    assert np.array_equal(model.predict(later), without.predict(later[plain]))
    assert np.array_equal(model.predict(later[plain]), without.predict(later[plain]))
    both = later[:DAY].drop(columns="T_za")
    assert "Q_hvac" not in model.forecast(None, both)  # the heat that is given wins
    assert "Q_hvac" in model.forecast(None, both, setpoint=(20.0, 24.0))


def test_a_thermostat_does_not_depend_on_the_order_of_the_training_s_columns(log, model):
    """The outdoor temperature is compared with that of a day and a week before, not whichever column comes first."""
    train = log[:TRAINED].iloc[:, ::-1]
    other = SchedulePredictor("2R2C", known={"Q_h": 6.0}).fit(train, train["T_za"])
    found, expected = (one.forecast(None, ahead(log, TRAINED), quantiles=[0.1, 0.9]) for one in (other, model))
    pd.testing.assert_frame_equal(found, expected, rtol=1e-6)


def test_origins_of_the_closed_loop_increase(log, model):
    for origins in ([20, 10], [10, 10], []):
        with pytest.raises(ValueError, match="origins must be increasing row numbers"):
            model.closed_loop_from(log[TRAINED:], origins)


@pytest.mark.parametrize("method", ["predict_from", "closed_loop_from"])
def test_boundary_temperatures_are_a_mapping_of_those_of_the_network(log, model, method):
    for wrong, match in (([20.0], r"boundary=\[20.0\] must be a mapping"), ({"T_hall": [[20.0]]}, "names 'T_hall'")):
        with pytest.raises(ValueError, match=match):
            getattr(model, method)(log[TRAINED:], [5], boundary=wrong)


def test_the_thermostat_holds_the_room_and_its_load_is_near_the_measured_one(log, full_model):
    origins = np.arange(0, 3 * DAY, 5)
    later = log[TRAINED:]
    found = full_model.closed_loop_from(later, origins, quantiles=(0.1, 0.9))
    rows = origins[:, None] + np.arange(DAY)
    known = rows + 1 < len(later)
    rows = np.minimum(rows, len(later) - 2)
    load = (6.0 * log["u_heat"] - 6.0 * log["u_cool"]).to_numpy()

    def rmse(forecast, truth):
        return float(np.sqrt(np.mean((forecast - truth)[known] ** 2)))

    measured = load[TRAINED + rows]
    assert rmse(found.paths.heat, measured) < 0.85 * rmse(load[TRAINED + rows - 7 * DAY], measured)
    assert rmse(found.paths.temperature, later["T_za"].to_numpy()[rows + 1]) < 0.8
    inside = (found.heat_bands[..., 0] <= measured) & (measured <= found.heat_bands[..., 1])
    assert 0.6 < inside[known].mean() < 0.95


def test_a_back_test_of_the_closed_loop_has_its_paths_and_what_was_measured(log, model):
    later, levels = log[TRAINED:], (0.1, 0.9)
    y = later["T_za"]
    frame = backtest(model, later, y, horizon="12h", origin_step="7h", quantiles=levels, heat_known=False)
    origins = np.arange(0, len(later) - 12, 7)
    found = model.closed_loop_from(later, origins, "12h", levels)
    assert frame["origin"].unique().tolist() == later.index[origins].tolist()
    for name, path in {
        "y_pred": found.paths.temperature,
        "u_heat_pred": found.plant["u_heat"],
        "Q_hvac_pred": found.paths.heat,
        "Q_hvac_0.9": found.heat_bands[..., 1],
        "q_0.1": found.temperature_bands[..., 0],
    }.items():
        np.testing.assert_allclose(frame[name], path.ravel(), rtol=1e-9, atol=1e-12)
    for row in frame.iloc[::37].itertuples():  # stages count over the step that ends at the stamp of the temperature
        assert row.y_true == log["T_za"][row.time]
        assert row.u_cool_true == log["u_cool"][row.time - pd.Timedelta("1h")]


@pytest.mark.parametrize(
    "given", [{}, {"weather_error": "low"}, {"heat_known": False}, {"heat_known": False, "weather_error": "low"}]
)
def test_a_back_test_goes_on_from_the_training_that_is_in_its_table(log, model, given):
    """It read the training in X as another history, and its errors under set-points were up to 15 % larger."""
    given |= {"quantiles": (0.1, 0.9)}
    later = log[TRAINED:]
    assert (model.n_known_of(log), model.n_known_of(log[: TRAINED - 1]), model.n_known_of(later)) == (TRAINED, 0, 0)
    known = log[TRAINED - 2 * DAY :]
    frame = backtest(model, known, known["T_za"], **given)
    after = frame[frame["origin"] >= later.index[0]].reset_index(drop=True)
    pd.testing.assert_frame_equal(after, backtest(model, later, later["T_za"], **given))
    assert frame["origin"].nunique() == after["origin"].nunique() + 2  # those of the training are there too
    # rows that only look like the training are another history
    warmer = known.assign(T_za=known["T_za"].where(known.index >= later.index[0], known["T_za"] + 1.0))
    assert model.n_known_of(warmer) == 0


def test_a_closed_loop_goes_on_from_the_training_that_is_in_its_table(log, model):
    levels = (0.1, 0.9)
    found = model.closed_loop_from(log[TRAINED - 2 * DAY :], [DAY, 3 * DAY], quantiles=levels)
    expected = model.closed_loop_from(log[TRAINED:], [DAY], quantiles=levels)
    for part, alike in (found.paths, expected.paths), (found[1:3], expected[1:3]):
        for values, own in zip(part, alike, strict=True):
            np.testing.assert_array_equal(values[1], own[0])


@pytest.mark.parametrize("scheme", ["model", "two_stages"])
@pytest.mark.parametrize("held", [21.0, (20.0, 24.0)])
def test_a_load_goes_on_from_the_training_that_is_in_its_table(log, scheme, held, request):
    """From the midnight before the training's end it was that of a model without history."""
    model = request.getfixturevalue(scheme)
    begin, end = (TRAINED if scheme == "model" else 14 * DAY) - 29, 3 * DAY
    X = log[begin : begin + 29 + end]
    load, limits = model.predict_load(X, held), (np.linspace(-4.0, -3.0, len(X)), 5.0)
    pd.testing.assert_frame_equal(load[29:], model.predict_load(X[29:], held))
    pd.testing.assert_frame_equal(load[:29], model.predict_load(X[:29], held))
    limited = model.predict_load(X, held, limits)
    pd.testing.assert_frame_equal(limited[29:], model.predict_load(X[29:], held, (limits[0][29:], 5.0)))


def test_quantiles_reach_a_member_by_their_distance_from_the_median():
    offsets = np.array([[-1.0, 0.1, 1.0], [-1.0, 0.1, 1.0], [-1.0, 0.1, 1.0]])
    found = reaching(offsets, np.array([4.0, -4.0, 0.5]), np.array([0.1, 0.5, 0.7]))
    np.testing.assert_allclose(found, [[-1.0, 0.1, 2.0], [-4.0, 0.1, 1.0], [-1.0, 0.1, 1.0]])


def test_an_interval_reaches_a_load_that_no_tree_has_seen(log, monkeypatch):
    """On the first cold Monday the plant gave twice what was forecast, far outside an interval of 2 kW."""
    metered = log.drop(columns=PLANT).assign(Q_hvac=6.0 * (log["u_heat"] - log["u_cool"]))
    train, future = metered[:TRAINED], metered[TRAINED : TRAINED + DAY].drop(columns=["T_za", "Q_hvac"])
    model = SchedulePredictor("2R2C").fit(train, train["T_za"])
    future["T_oa"] -= 20.0
    found = model.forecast(None, future, quantiles=(0.1, 0.9))
    assert found["Q_hvac_0.9"].max() > 1.5 * train["Q_hvac"].max()
    monkeypatch.setattr(member_intervals, "_REACHED", np.inf)
    before = model.forecast(None, future, quantiles=(0.1, 0.9))
    pd.testing.assert_frame_equal(found.drop(columns="Q_hvac_0.9"), before.drop(columns="Q_hvac_0.9"))
    wider = found["Q_hvac_0.9"] - before["Q_hvac_0.9"]
    assert wider.max() > 0.5
    assert wider.min() == 0.0
    assert (wider > 0.0).sum() < 4  # of 24 hours


def test_nothing_is_forecast_after_the_last_row(log, model):
    later = log[TRAINED : TRAINED + DAY]
    found = model.closed_loop_from(later, [DAY - 5], quantiles=(0.1, 0.9))
    heat = (found.paths.heat, found.paths.zeta, found.heat_bands, *found.plant.values(), *found.measured.values())
    for n_known, paths in ((4, (found.paths.temperature, found.temperature_bands)), (5, heat)):
        for path in paths:
            assert np.isfinite(path[0, :n_known]).all()
            assert np.isnan(path[0, n_known:]).all()
    expected = np.isfinite(model.predict_from(later, [DAY - 5]))
    np.testing.assert_array_equal(np.isfinite(found.paths.temperature), expected)


def test_errors_of_the_weather_forecast_change_a_back_test_and_widen_its_intervals(log, model):
    later, given = log[TRAINED : TRAINED + 4 * DAY], {"quantiles": (0.1, 0.9), "heat_known": False}
    exact = backtest(model, later, later["T_za"], **given)
    off = backtest(model, later, later["T_za"], weather_error="high", **given)
    assert list(off) == list(exact)
    same = ["origin", "lead", "time", "y_true", "u_heat_true"]
    pd.testing.assert_frame_equal(off[same], exact[same])
    for low, high in (("q_0.1", "q_0.9"), ("Q_hvac_0.1", "Q_hvac_0.9")):
        assert (off[high] - off[low]).mean() > 1.02 * (exact[high] - exact[low]).mean()
    # the forecast of an origin is that of a table with its weather
    origin = later.index.get_loc(off["origin"].iloc[-1])
    seen = WeatherError("high").forecast(model._read_X(later), origin, DAY)
    found = model.closed_loop_from(seen, [origin], "1D")
    np.testing.assert_allclose(off["y_pred"][-DAY:], found.paths.temperature[0], atol=1e-9)


@pytest.mark.filterwarnings("error::pandas.errors.PerformanceWarning")
def test_hundreds_of_quantiles_are_columns_like_others(log, model):
    """They were added one by one, of which pandas warned hundreds of times."""
    levels, later = np.linspace(0.005, 0.995, 199), log[TRAINED : TRAINED + 2 * DAY]
    found = model.forecast(None, ahead(log, TRAINED), quantiles=levels)
    few = model.forecast(None, ahead(log, TRAINED), quantiles=[0.1, 0.9])
    pd.testing.assert_frame_equal(found[list(few)], few)
    load = model.predict_load(later, (20.0, 24.0), quantiles=levels)
    tested = backtest(model, later, later["T_za"], quantiles=levels, heat_known=False)
    for frame in (found, load, tested):
        assert len(frame.filter(regex="^(q|Q_hvac)_0").columns) == 2 * len(levels)


def test_a_forecast_under_set_points_allows_for_errors_of_the_weather(log, model):
    history, future = log[TRAINED : TRAINED + 2 * DAY], ahead(log, TRAINED + 2 * DAY)
    exact, off = (model.forecast(history, future, quantiles=(0.1, 0.9), weather_error=e) for e in (None, "medium"))
    moved = [name for name in exact if "_0." in str(name)]
    pd.testing.assert_frame_equal(exact.drop(columns=moved), off.drop(columns=moved))  # the weather is as given
    assert (off["q_0.9"] - off["q_0.1"]).mean() > 1.01 * (exact["q_0.9"] - exact["q_0.1"]).mean()


def test_rows_after_the_end_of_a_table_have_no_measured_stage(log, model):
    later = log[TRAINED : TRAINED + 2 * DAY]
    frame = backtest(model, later, later["T_za"], heat_known=False, whole=False)
    assert frame["time"].max() == later.index[-1]
    assert np.isfinite(frame[["y_pred", "u_heat_pred", "u_heat_true"]]).all(axis=None)
    measured = model.closed_loop_from(later, [len(later) - 4]).measured["u_heat"][0]
    np.testing.assert_array_equal(measured, np.append(later["u_heat"][-4:], np.full(DAY - 4, np.nan)))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"weather_error": "huge"}, "weather_error='huge' is not one of 'low', 'medium', 'high'"),
        ({"heat_known": "no"}, "heat_known='no'"),
        ({"columns": ["T_oa", "q_sol", *PLANT, "T_za"]}, "T_heat_set is missing in 96 rows"),
        ({"estimator": ARXRegressor()}, "heat_known=False needs a hybrid predictor of one zone"),
        ({"estimator": DummyRegressor()}, "heat_known=False needs a hybrid predictor of one zone"),
    ],
)
def test_a_back_test_without_heat_is_refused_where_no_thermostat_acts(log, model, given, message):
    estimator = given.pop("estimator", None)
    later = log[TRAINED:][given.pop("columns", list(log))]
    model = model if estimator is None else estimator.fit(log[:TRAINED], log["T_za"][:TRAINED])
    with pytest.raises(ValueError, match=re.escape(message)):
        backtest(model, later, later["T_za"], **{"heat_known": False, **given})


def test_nothing_after_an_origin_changes_a_forecast(log, model):
    later, origin = log[TRAINED:].copy(), 30
    other = later.copy()
    other.iloc[origin:, [other.columns.get_loc(name) for name in PLANT]] = 0.7
    other.iloc[origin + 1 :, other.columns.get_loc("T_za")] = 15.0
    other.loc[other.index[origin + DAY] :, ["T_heat_set", "T_cool_set"]] -= 3.0  # after the horizon
    one, two = (model.closed_loop_from(table, [5, origin], "1D", (0.1, 0.9)) for table in (later, other))
    bands = ("heat_bands", "temperature_bands")
    parts = ([*found.paths, *(getattr(found, name) for name in bands), *found.plant.values()] for found in (one, two))
    for first, second in zip(*parts, strict=True):
        assert np.array_equal(first, second)
    warmer = later.assign(T_heat_set=later["T_heat_set"].where(np.arange(len(later)) < origin + 3, 23.5))
    warmer["T_cool_set"] = warmer["T_cool_set"].clip(lower=24.0)
    changed = model.closed_loop_from(warmer, [origin]).paths
    assert changed.heat[0].mean() > one.paths.heat[1].mean()


@pytest.mark.parametrize("n_leads", [DAY, 7])
def test_a_path_under_a_thermostat_reads_nothing_after_its_origin(log, two_stages, n_leads):
    """The origin lies anywhere between those of the paths that only divide the rows."""
    table = two_stages._read_X(log[14 * DAY :])
    wanted = WantedPaths(band_of(table), Limits.constant(-6.0, 6.0, 1))
    for origin in range(30, 31 + n_leads):
        at = np.array([origin])
        T = table.history["T_za"] + 4.0 * (np.arange(table.n_rows) > origin)
        changed = table.replace(history={**table.history, "T_za": T})
        one, two = (two_stages._scheme.load_paths_from(t, at)(at, n_leads, wanted) for t in (table, changed))
        for first, second in zip(one, two, strict=True):
            np.testing.assert_array_equal(first, second)


def test_rows_taken_in_count_as_history(log, model):
    history, future = log[TRAINED : TRAINED + 40], ahead(log, TRAINED + 40)
    levels = (0.1, 0.9)
    at_once = model.forecast(history, future, quantiles=levels)
    updated = copy.deepcopy(model)
    updated.update(history[:17]).update(history[17:])
    pd.testing.assert_frame_equal(updated.forecast(None, future, quantiles=levels), at_once, rtol=1e-9, atol=1e-9)
    assert {"T_za", "zeta", "Q_hvac", *PLANT, "q_0.1", "q_0.9", "Q_hvac_0.1", "Q_hvac_0.9"} == set(at_once)
    assert (at_once["Q_hvac_0.1"] <= at_once["Q_hvac_0.9"]).all()
    assert (at_once["q_0.1"] <= at_once["q_0.9"]).all()


def test_one_update_is_many_of_one_row_and_a_history(log, two_stages):
    """The two-stage scheme forecasts from kept rows as they follow the training."""
    new, future = log[14 * DAY : 19 * DAY], ahead(log, 19 * DAY)
    at_once, by_row = copy.deepcopy(two_stages).update(new), copy.deepcopy(two_stages)
    for i in range(len(new)):
        by_row.update(new[i : i + 1])
    given = two_stages.forecast(new, future)
    for model in (at_once, by_row):
        pd.testing.assert_frame_equal(model.forecast(None, future), given, rtol=0, atol=1e-9)


def test_a_forecast_leaves_no_refit_on_rows_that_nobody_knew(log):
    """The week's fit was made of a disturbance that the forecast itself had guessed, and kept for that week."""
    begin, before, end = 14 * DAY, TRAINED - 5, TRAINED + DAY
    gray_box = InputDisturbanceID("1R1C", known={"Q_h": 6.0}, n_starts=1)
    model = TwoStagePredictor(gray_box, intervals=False, random_state=0).fit(log[:begin], log["T_za"][:begin])
    asked = copy.deepcopy(model).update(log[begin:before])
    asked.forecast(None, ahead(log, before))
    asked.update(log[before:end])
    expected = model.update(log[begin:end]).forecast(None, ahead(log, end))
    pd.testing.assert_frame_equal(asked.forecast(None, ahead(log, end)), expected, rtol=0, atol=1e-9)


def test_a_load_of_a_thermostat_is_the_learned_one(log, model):
    later = ahead(log, TRAINED)
    sides = later[["T_heat_set", "T_cool_set"]]
    load = model.predict_load(later, sides, quantiles=(0.1, 0.9))
    ideal = model.predict_load(later, sides, limits=(-6.0, 6.0))
    assert {"Q_hvac_0.1", "Q_hvac_0.9", "q_0.1", "Q_hvac_unclipped"} <= set(load)
    assert not np.array_equal(load["Q_hvac"], ideal["Q_hvac"])
    np.testing.assert_array_equal(load["Q_hvac_unclipped"], ideal["Q_hvac_unclipped"])
    with pytest.raises(ValueError, match="no limits"):
        model.predict_load(later, sides, limits=(-6.0, 6.0), quantiles=(0.1, 0.9))


def test_a_plant_gives_no_more_than_its_stages_can(log, model):
    """Far set-points ask for all that it has; the corrections of the law do not add to it."""
    future = ahead(log, TRAINED)
    for sides in ((18.0, 19.0), (27.0, 28.0)):
        found = model.forecast(None, future, setpoint=sides, quantiles=(0.1, 0.9))
        assert found["u_heat"].max() <= 1.0 + 1e-9
        assert found["u_cool"].max() <= 1.0 + 1e-9
        assert found["Q_hvac_0.9"].max() <= 6.0 + 1e-9


@pytest.mark.parametrize("learned", [True, False])
@pytest.mark.parametrize("scheme", [SchedulePredictor, TwoStagePredictor])
def test_a_forecast_begins_under_the_heat_that_was_delivered(log, scheme, learned):
    """The heat of the last known row acts until the first row ahead, whatever its set-points."""
    columns = list(log) if learned else [name for name in log if name not in SIDES]
    if scheme is TwoStagePredictor:
        identified = InputDisturbanceID("2R2C", known={"Q_h": 6.0}, n_starts=1)
        own = TwoStagePredictor(identified, intervals=False, random_state=0)
    else:
        own = SchedulePredictor("2R2C", known={"Q_h": 6.0}, intervals=False)
    own.fit(log[columns][:TRAINED], log["T_za"][:TRAINED])
    history, future = log[columns][TRAINED : TRAINED + 30], ahead(log[columns], TRAINED + 30)
    first = []
    for stage in (0.0, 1.0):
        known = history.assign(u_cool=0.0, u_heat=np.append(history["u_heat"][:-1], stage))
        found = own.forecast(known, future, setpoint=(21.0, 25.0))
        given_back = own.forecast(known, future.assign(**found[PLANT]))
        assert found["T_za"].iloc[0] == pytest.approx(given_back["T_za"].iloc[0], abs=0.6)
        first.append(found["T_za"].iloc[0])
        assert own.forecast(known, future, T_za=20.0, setpoint=(21.0, 25.0))["T_za"].iloc[0] == 20.0
    assert first[1] - first[0] > 1.0


def test_a_side_without_a_set_point_is_free(log, model):
    """A plant with a learned thermostat does not act on a side that is left free."""
    future = ahead(log, TRAINED)
    heated, cooled = (model.forecast(None, future, setpoint=pair) for pair in ((19.0, None), (None, 24.0)))
    assert (heated["Q_hvac"] >= 0.0).all()
    assert heated["Q_hvac"].sum() > 0.0
    for name, value, other in (("T_heat_set", 19.0, heated), ("T_cool_set", 24.0, cooled)):
        alone = pd.DataFrame({name: value}, index=future.index)
        pd.testing.assert_frame_equal(model.forecast(None, future, setpoint=alone), other)
    assert (cooled["Q_hvac"] <= 0.0).all()
    high = model.forecast(None, future, setpoint=(19.0, 60.0))
    np.testing.assert_allclose(heated["T_za"], high["T_za"], atol=1e-9)
    assert (model.forecast(None, future, setpoint=(None, None))["Q_hvac"] == 0.0).all()
    assert (model.predict_load(future, (19.0, None))["Q_hvac"] >= 0.0).all()


def test_set_points_ahead_hold_whether_or_not_the_history_has_any(log, model):
    """They were dropped as columns that the history lacks, and the plant never ran."""
    history, future = log[TRAINED + DAY : TRAINED + 2 * DAY], ahead(log, TRAINED + 2 * DAY)
    bare = history.drop(columns=SIDES)
    found = model.forecast(bare, future)
    pd.testing.assert_frame_equal(found, model.forecast(bare, future, setpoint=future[SIDES]))
    assert found["Q_hvac"].sum() == pytest.approx(model.forecast(history, future)["Q_hvac"].sum(), rel=0.2)


def test_a_history_of_known_rows_is_known_without_its_set_points_too(log, model):
    """It started cold: what the model knew of these rows was not used."""
    known, day = copy.deepcopy(model).update(log[TRAINED : TRAINED + DAY]), slice(TRAINED + DAY, TRAINED + 2 * DAY)
    bare = log[TRAINED - DAY : TRAINED + DAY].drop(columns=SIDES)
    for future in (log[day].drop(columns=["T_za", *SIDES]), ahead(log, day.start)):
        pd.testing.assert_frame_equal(known.forecast(bare, future), known.forecast(None, future))


@pytest.mark.parametrize("side", SIDES)
def test_a_set_point_that_was_learned_with_is_needed_ahead(log, model, side):
    """Without that of heating the plant never heated, where no known row came before the table."""
    lacking = log[TRAINED + DAY : TRAINED + 3 * DAY].drop(columns=side)
    message = rf"{side} is missing in \d+ rows, but the thermostat was learned with it .first at 2023-10-2[45]"
    with pytest.raises(ValueError, match=message):
        model.closed_loop_from(lacking, [5])
    with pytest.raises(ValueError, match=message):
        model.forecast(lacking[:DAY], lacking[DAY:].drop(columns=[*PLANT, "T_za"]))


def test_rows_without_the_set_points_that_were_learned_with_are_taken_in_with_a_warning(log, model):
    """They counted as free running without a word: after two weeks the load was twice what it is with them."""
    rows, said = log[TRAINED : TRAINED + DAY], "have no T_heat_set and T_cool_set, with which the thermostat"
    lacking = copy.deepcopy(model)
    with pytest.warns(MeasurementWarning, match=said):
        lacking.update(rows.drop(columns=SIDES))
    with warnings.catch_warnings():
        warnings.simplefilter("error", MeasurementWarning)
        lacking.update(log[TRAINED + DAY : TRAINED + 2 * DAY].drop(columns=SIDES))  # once per fit
        copy.deepcopy(model).update(rows)
    with pytest.warns(MeasurementWarning, match="have no T_cool_set, with which"):
        copy.deepcopy(model).update(rows.drop(columns="T_cool_set"))


def test_a_set_point_that_the_training_lacks_is_not_used(log):
    """The law has learned that the plant cools without it; it cooled twice, and the room was kelvins too cold."""
    model = SchedulePredictor(known={"Q_h": 6.0}).fit(
        log[: 14 * DAY].drop(columns="T_cool_set"), log["T_za"][: 14 * DAY]
    )
    future = ahead(log, 14 * DAY)
    one = model.forecast(None, future.drop(columns="T_cool_set"))
    for given in ({}, {"setpoint": (future["T_heat_set"], future["T_cool_set"])}):
        with pytest.warns(PlanWarning, match="T_cool_set is not used, since the training has none"):
            pd.testing.assert_frame_equal(model.forecast(None, future, **given), one)


def test_zeta_of_a_load_is_that_of_the_forecast_under_it(log):
    """The disturbance stands in the row over whose step it acts, whatever its kind."""
    plain = log.drop(columns=SIDES)
    for gray_box in (InputDisturbanceID, OutputDisturbanceID):
        kind = "input" if gray_box is InputDisturbanceID else "output"
        identified = gray_box("1R1C", known={"Q_h": 6.0}, n_starts=1)
        model = TwoStagePredictor(identified, disturbance=kind, intervals=False, random_state=0)
        model.fit(plain[:TRAINED], plain["T_za"][:TRAINED])
        future = ahead(plain, TRAINED)
        found = model.forecast(None, future, setpoint=(20.0, 24.0))
        given_back = model.forecast(None, future.assign(**found[PLANT]))
        pd.testing.assert_series_equal(found["zeta"], given_back["zeta"])


def test_limits_of_a_forecast_reach_its_temperature(log, model):
    future = ahead(log, TRAINED).assign(T_heat_set=23.0, T_cool_set=26.0)
    free, held = (model.forecast(None, future, limits=limits) for limits in (None, (None, 1.5)))
    assert free["Q_hvac"].max() > 2.0
    assert held["Q_hvac"].max() <= 1.5
    assert (held["T_za"] - free["T_za"]).min() < -0.2
    pd.testing.assert_frame_equal(model.forecast(None, future, limits=(-50.0, 50.0)), free)
    ideal = [model.forecast(None, future.drop(columns=["T_heat_set", "T_cool_set"]), setpoint=23.0, limits=limits)
             for limits in (None, (0.0, 1.5))]  # fmt: skip
    assert ideal[1]["Q_hvac"].max() <= 1.5 < ideal[0]["Q_hvac"].max()
    with pytest.raises(ValueError, match="with given heat leave limits=None"):
        model.forecast(None, log[TRAINED : TRAINED + DAY].drop(columns="T_za"), limits=(0.0, 1.0))
    for wrong in ((1.0, 2.0), 3.0, (0.0, np.ones(DAY))):
        with pytest.raises(ValueError, match="limits"):
            model.forecast(None, future, limits=wrong)
    for most in (5000.0, 6000.0):
        with pytest.warns(UnitWarning, match=f"the upper limit is {most:.0f}: likely W"):
            model.forecast(None, future, limits=(0.0, most))


def test_a_plant_may_give_more_than_was_measured_unless_its_most_left_a_set_point_missed():
    """After one day near the largest heat three times that heat, after two twice; at a limit 3 % more.

    A plant is at a limit where it misses a set-point for two rows; a jump of the set-point takes it one.
    """
    two_days = np.tile([0.0, 6.0, 5.9, 0.0, -2.8, -3.0], 2)

    def capacity(T, is_usual=False, heat=two_days):
        return plant_limits(heat, T, 12, [12], is_usual)[0]

    met = np.full(13, 22.0)
    cold, hot, one_row, other = (met.copy() for _ in range(4))
    cold[8:10], hot[5:7] = 19.5, 25.5  # after 6 kW, and after -3 kW
    one_row[8], other[3:5] = 19.5, 19.5  # after the first row with 6 kW, and after one row with heat and one without
    for T in (met, one_row, other):
        np.testing.assert_allclose(capacity(T), (-6.0, 12.0))
    np.testing.assert_allclose(capacity(cold), (-6.0, 6.18))
    np.testing.assert_allclose(capacity(hot), (-3.09, 12.0))
    one_day = np.append(0.8 * two_days[:6], two_days[6:])
    np.testing.assert_allclose(capacity(met, heat=one_day), (-9.0, 18.0))
    np.testing.assert_allclose(capacity(met, is_usual=True), (-3.3, 6.6))


def test_a_limit_of_a_plant_is_known_once_it_has_left_a_set_point_missed():
    """A training of a day with 4 kW; then 6 kW on two days, the last of them too little."""
    heat = np.array([0.0, 4.0, 2.0, 0.0, 0.0, 0.0, 0.0, 6.0, 2.0, 0.0, 0.0, 0.0, 0.0, 6.0, 5.9, 0.0, 0.0, 0.0])
    T = np.full(19, 22.0)
    T[14:16] = 18.0
    found = plant_limits(heat, T, 6, [6, 7, 8, 12, 13, 14, 15, 18])
    np.testing.assert_allclose(found[:, 1], [12.0, 12.0, 18.0, 18.0, 18.0, 12.0, 6.18, 6.18])
    np.testing.assert_allclose(plant_limits(heat, np.full(19, 22.0), 6, [14, 18])[:, 1], 12.0)  # met on two days
    np.testing.assert_allclose(found[:, 0], 0.0)


def plant_limits(heat, T, n_trained, origins, is_usual=False):
    """Least and most heat (O, 2) of a plant whose heat is measured, with set-points of 20 and 25 degC."""
    n = len(T)
    heat = np.append(heat, 0.0)
    rows = LawRows(T, heat, Band(np.full(n, 20.0), np.full(n, 25.0)), np.empty((n, 0)), np.empty((n, 3)), 6)
    seen = LawRows(*(part[:n_trained] for part in rows[:2]), rows.band.rows(slice(n_trained)), *rows[3:])
    training = SimpleNamespace(inputs={"Q_hvac": heat}, n_rows=n_trained)
    found = PlantCapacity.of(SimpleNamespace(stages=dict), training, seen, is_usual)
    return np.column_stack(found.at(rows, n_trained, np.array(origins)))


def rows_of_loads(heat, T, band):
    n = len(heat)
    return LawRows(np.broadcast_to(T, n), heat, band, np.empty((n, 0)), np.empty((n, 3)), DAY)


def test_the_first_step_of_a_plant_is_found_on_both_sides_where_it_rests():
    heat = np.repeat([0.0, 2.0, 2.01, 4.0, -1.0], [500, 40, 10, 450, 90])
    free = Band(*np.tile([[-np.inf], [np.inf]], len(heat)))
    possible = PossibleLoads.of(rows_of_loads(heat, 21.0, free))
    assert possible == ((1.0, 2.0), (False, False))
    assert PossibleLoads.of(rows_of_loads(np.maximum(heat, 0.0), 21.0, free)).least == (0.0, 2.0)
    many = heat + np.where(heat > 0.0, np.linspace(0.0, 9.0, len(heat)), 0.0)
    assert PossibleLoads.of(rows_of_loads(many, 21.0, free)).least == (1.0, 0.0)
    never_rests = PossibleLoads.of(rows_of_loads(heat[heat != 0.0], 21.0, free.rows(heat != 0.0)))
    assert never_rests.least == (0.0, 0.0)
    loads, T = np.array([[-3.0, -0.6, -0.4, 0.0], [0.9, 1.1, 2.0, 5.0]]), np.full(2, 21.0)
    found = possible.nearest(loads, free.rows(slice(2)), 21.0, T, T)
    np.testing.assert_array_equal(found, [[-3.0, -1.0, 0.0, 0.0], [0.0, 2.0, 2.0, 5.0]])
    np.testing.assert_array_equal(never_rests.nearest(loads, free.rows(slice(2)), 21.0, T, T), loads)


def test_a_plant_cools_no_room_that_is_nearer_to_the_set_point_of_heating():
    heat, T = np.tile([0.0, 0.0, 2.0, 0.0, 0.0, -1.0, 0.0], 20), np.tile([22.0, 21.0, 20.5, 21.0, 24.0, 24.8, 24.0], 20)
    band = Band(*np.tile([[20.0], [25.0]], len(T)))
    possible = PossibleLoads.of(rows_of_loads(heat, T, band))
    assert possible.keeps == (True, True)
    loads, one = np.tile([-4.0, 4.0], (5, 1)), band.rows(slice(5))
    lowest, highest = np.array([21.4, 22.6, 22.6, 24.0, 21.0]), np.array([21.6, 23.0, 23.0, 24.0, 22.4])
    found = possible.nearest(loads, one, 22.0, lowest, highest)
    np.testing.assert_array_equal(found, [[0.0, 4.0], [-4.0, 4.0], [-4.0, 0.0], [-4.0, 0.0], [-4.0, 4.0]])
    only_heating = Band(one.heating, np.full(5, np.inf))
    assert (possible.nearest(loads, only_heating, 22.0, lowest, highest) == [0.0, 4.0]).all()
    nothing_held = Band(np.full(5, -np.inf), np.full(5, np.inf))
    assert (possible.nearest(loads, nothing_held, 22.0, lowest, highest) == loads).all()
    found = possible.nearest(loads, one, np.nan, lowest, highest)  # the first row by the temperature of its end
    assert found[0].tolist() == [0.0, 4.0]
    modulating = np.where(heat == 0.0, 0.0, heat * np.linspace(1.0, 9.0, len(heat)))
    assert PossibleLoads.of(rows_of_loads(modulating, T, band)).keeps == (False, False)
    T[4:7] = 21.0  # once of 20 times it cooled a cold room, as ventilation does
    assert PossibleLoads.of(rows_of_loads(heat, T, band)).keeps == (False, True)


def test_quantiles_of_a_load_are_0_or_what_the_plant_gives_at_least(log, model):
    """They had loads near 0, which no day has, and cooling in a cold night."""
    possible = model._law._possible
    assert min(possible.least) > 0.1
    assert possible.keeps == (True, True)
    levels = list((np.arange(50) + 0.5) / 50)
    found = model.forecast(None, ahead(log, TRAINED), quantiles=levels)
    loads = found.filter(regex=r"^Q_hvac_0").to_numpy()
    assert loads.shape == (DAY, 50)
    assert (np.diff(loads) >= 0.0).all()
    assert (loads == 0.0).any()
    assert (loads[loads > 0.0] >= possible.least[1]).all()
    assert (loads[loads < 0.0] <= -possible.least[0]).all()
    cold = found["q_0.99"] < log[SIDES][TRAINED : TRAINED + DAY].mean(axis=1) - 0.5
    assert cold[1:].any()
    assert (loads[1:][cold[1:]] >= 0.0).all()


def test_limits_of_an_ideal_plant_are_reached(log):
    plain = log.drop(columns=SIDES)  # no thermostat is learned
    model = SchedulePredictor("2R2C", known={"Q_h": 6.0}, intervals=False).fit(plain[:TRAINED], plain["T_za"][:TRAINED])
    for setpoint, side in ((23.0, 1), (16.0, 0)):
        loads = [model.forecast(None, ahead(plain, TRAINED), setpoint=setpoint, limits=limits)["Q_hvac"]
                 for limits in (None, (-0.5, 1.5))]  # fmt: skip
        free, held = ((load.min(), load.max())[side] for load in loads)
        assert abs(free) > abs((-0.5, 1.5)[side]) == pytest.approx(abs(held))


def test_what_cannot_be_right_is_refused(log, model):
    train, future = log[:TRAINED], ahead(log, TRAINED)
    broken = train.assign(T_heat_set=train["T_heat_set"].where(np.arange(TRAINED) != 40))
    with pytest.raises(ValueError, match=r"T_heat_set is missing in 1 row .first at 2023-10-03 16:00"):
        SchedulePredictor().fit(broken, train["T_za"])
    with pytest.raises(ValueError, match=r"T_heat_set is above T_cool_set .first at 2023-10-02"):
        SchedulePredictor().fit(train.assign(T_heat_set=27.0, T_cool_set=24.0), train["T_za"])
    names = dict(zip(SIDES, ["low", "high"], strict=True))
    for rows, match in ((broken, "low is missing in 1 row"), (train.assign(T_heat_set=27.0), "low is above high")):
        with pytest.raises(ValueError, match=match):
            SchedulePredictor(columns=names).fit(rows.rename(columns=names), train["T_za"])
    before = model.forecast(None, future)
    with pytest.raises(ValueError, match="T_cool_set is missing"):
        model.forecast(None, future.assign(T_cool_set=np.nan))
    crossed = log[TRAINED : TRAINED + 5].assign(T_heat_set=30.0)
    with pytest.raises(ValueError, match="above T_cool_set"):
        model.update(crossed)
    pd.testing.assert_frame_equal(model.forecast(None, future), before)
    with pytest.warns(UnitWarning, match="degF"), pytest.raises(ValueError, match="above"):
        model.forecast(None, future.assign(T_heat_set=58.0))
    with pytest.raises(ValueError, match="set-point"):
        RCNetwork("odd", {"za": "C_za"}, {"R_zo": ("za", "T_heat_set")})


def test_without_a_learned_thermostat_the_plant_is_ideal(log):
    plain = log[: 8 * DAY].drop(columns=["T_heat_set", "T_cool_set"])
    model = SchedulePredictor("2R2C", known={"Q_h": 6.0}, intervals=False).fit(plain, plain["T_za"])
    future = ahead(log, 8 * DAY)
    with pytest.raises(ValueError, match="no thermostat was learned"):
        model.forecast(None, future)
    with pytest.raises(ValueError, match="need a learned thermostat"):
        model.forecast(None, future, quantiles=(0.1, 0.9), setpoint=(20.0, 24.0))
    found = model.forecast(None, future, setpoint=(20.0, 24.0))
    assert (found["T_za"][2:] > 19.5).all()
    assert {"T_za", "zeta", "Q_hvac", *PLANT} == set(found)


def test_one_side_and_other_schemes(log):
    heated = log.drop(columns=["T_cool_set", "u_cool"])
    train = heated[: 8 * DAY]
    gray_box = InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1)
    model = TwoStagePredictor(gray_box, intervals=False, random_state=0).fit(train, train["T_za"])
    future = heated[8 * DAY : 9 * DAY].drop(columns=["u_heat", "T_za"])
    found = model.forecast(None, future)
    assert np.isfinite(found.to_numpy()).all()
    assert (found["u_heat"] >= 0).all()


def test_a_saved_model_forecasts_the_same(log, full_model, tmp_path):
    save_model(full_model, tmp_path / "model.skops")
    future = ahead(log, TRAINED)
    found = load_model(tmp_path / "model.skops").forecast(None, future)
    pd.testing.assert_frame_equal(found, full_model.forecast(None, future))


def test_trees_as_arrays_are_those_of_scikit_learn():
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.ensemble._hist_gradient_boosting.binning import _BinMapper

    from skhybrid.hybrid.thermostat_law import boosted_trees

    rng = np.random.default_rng(0)
    unknown = fit_trees(np.full((60, 2), np.nan), np.arange(60.0))
    assert np.ptp(unknown.predict(np.zeros((3, 2)))) == 0
    X = rng.normal(size=(400, 4))
    X[rng.random(X.shape) < 0.1] = np.nan
    y = np.nan_to_num(X[:, 0]) + np.nan_to_num(X[:, 1]) ** 2
    weight = rng.uniform(0.5, 2.0, 400)
    trees = fit_trees(X, y, weight)
    assert len(fit_trees(X, rng.normal(size=400)).feature) == 90  # all of them, whatever they gain
    bins_weighted = "sample_weight" in inspect.signature(_BinMapper.fit).parameters  # in newer versions
    for given in (None, weight) if bins_weighted else (None,):
        booster = HistGradientBoostingRegressor(**boosted_trees.SETTINGS).fit(X, y, given)
        found = fit_trees(X, y, given).predict(X)
        np.testing.assert_allclose(found, booster.predict(X), rtol=0, atol=1e-7)  # leaves are float32
    with pytest.raises(ValueError, match="do not fit"):
        trees.predict(X[:, :1])


def test_refits_stand_on_a_weekly_grid_and_none_is_made_twice(log, model, monkeypatch):
    made, law = [], model._law._refits.law
    monkeypatch.setattr(law_refits, "learn", lambda *args: made.append(1) or law)
    office = make_office(40, "chicago", start="2023-10-02", random_state=3, sampling_time="1h", excitation=None)
    later = office.X.join(office.setpoints)[TRAINED:]
    updated = copy.deepcopy(model)
    for first, stop in ((0, 16 * DAY), (16 * DAY, 17 * DAY)):  # more than the days of history that are kept
        updated.update(later[first:stop])
        found = updated.forecast(None, ahead(later, stop))
        assert len(made) == 2  # of the second week and of the third
    at_once = model.forecast(later[:stop], ahead(later, stop))
    pd.testing.assert_frame_equal(found, at_once, rtol=1e-9, atol=1e-9)


def test_a_refit_does_not_depend_on_the_calls_in_which_the_rows_came(log, monkeypatch):
    """The rows that are kept set the blocks of its cross-fitting: temperatures differed by 0.07 K, quantiles by 0.5."""
    train, end, made, learn = log[: 14 * DAY], 14 * DAY + 185, [], law_refits.learn
    model = SchedulePredictor("2R2C", known={"Q_h": 6.0}).fit(train, train["T_za"])
    monkeypatch.setattr(law_refits, "learn", lambda pairs, *args: made.append(pairs) or learn(pairs, *args))
    for step in (7, DAY, 9 * DAY):
        follower = copy.deepcopy(model)
        for begin in range(14 * DAY, end, step):
            follower.update(log[begin : min(begin + step, end)])
        follower.forecast(None, ahead(log, end))
    assert len(made) == 3
    for pairs in made[1:]:
        for part, expected in zip(pairs, made[0], strict=True):
            np.testing.assert_allclose(part, expected, atol=1e-4)


def test_weeks_begin_at_the_same_dates_however_much_is_kept():
    weeks = law_refits.Weeks(zero=-100, begin=0, per_day=24)
    assert weeks.learned_from(1) is None  # four days of the first week are missing
    assert weeks.learned_from(2) == (1, 236)
    assert law_refits.Weeks(100, 100, 24).learned_from(0) is None
    assert law_refits.Weeks(100, 100, 24).learned_from(12) == (4, 2116)
    assert (weeks.origins(0, 50, 3) - weeks.zero).tolist() == list(range(102, 150, 3))


def test_rows_ahead_without_heat_are_told_that_set_points_would_do(log, model):
    future = ahead(log, TRAINED).drop(columns=["T_heat_set", "T_cool_set"])
    with pytest.raises(ValueError, match=r"no column 'u_heat'.*setpoint=, or columns T_heat_set and T_cool_set"):
        model.forecast(None, future)
    with pytest.raises(ValueError, match="no column 'u_heat'"):
        model.forecast(log[TRAINED - 5 : TRAINED], future)


@pytest.mark.parametrize(("columns", "said"), [(SIDES[:1], "setpoint=, or columns T_heat_set."), ([], "setpoint=.")])
def test_rows_ahead_without_heat_are_told_of_learned_set_points_only(columns, said, log, two_stages):
    """Columns of others would be refused in their turn, or not be read."""
    train = log[: 14 * DAY].drop(columns=[side for side in SIDES if side not in columns])
    model = clone(two_stages).fit(train, train["T_za"])
    with pytest.raises(ValueError, match=re.escape(said) + "$"):
        model.forecast(None, ahead(log, 14 * DAY).drop(columns=SIDES))


def test_only_what_was_known_at_a_row_is_learned_from():
    errors = LawErrors(np.array([0, 10, 20, 30]), np.array([0, 4]), np.ones((4, 2, 2, 1)), np.eye(4, 2, dtype=bool))
    found = errors.until(25, oldest=10)
    assert found.origins.tolist() == [10, 20]
    assert found.runs.tolist() == [[False, True], [False, False]]
    assert np.isfinite(found.values).all()
    assert np.isnan(errors.until(24, oldest=20).values[0, :, 0, 0]).tolist() == [False, True]
    rows = np.arange(3)
    pairs = LawPairs(*(rows[:, None] for _ in range(4)), ends=np.array([5, 7, 9]))
    assert pairs.before(7).ends.tolist() == [5]
    assert pairs.before(8).heat.tolist() == [[0], [1]]


def test_a_plant_runs_where_its_members_forecast_some_heat():
    """Heat is measured in the row that a lead ends; an error is what was measured less a forecast."""
    rows = SimpleNamespace(heat=np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]))
    errors = np.zeros((2, 2, 2, 4))
    errors[:, :, 0] = np.array([[1.0, 2.95], [1.0, 0.0]])[..., None]  # forecasts of 0, 0.05, 1 and 5 kW
    found = LawErrors.of(rows, np.array([1, 2]), np.array([0, 2]), errors, 0.1)
    assert found.runs.tolist() == [[False, False], [True, True]]
    one = found.at(np.array([1]))
    assert (one.runs.tolist(), one.values.shape) == ([[False], [True]], (2, 1, 2, 4))


def test_a_load_has_the_intervals_of_the_state_that_is_forecast():
    """Rows of rest, in which all members are right, do not narrow the intervals of those in which the plant runs."""
    rng, shape = np.random.default_rng(0), (60, 8)
    runs = np.arange(8) % 2 == np.arange(60)[:, None] % 2
    values = np.where(runs, rng.normal(size=shape), 0.01 * rng.normal(size=shape))[..., None]
    clock = PathClock(
        np.tile(np.arange(1.0, 9.0), (60, 1)), np.zeros(shape, dtype=int), np.arange(60.0)[:, None] + np.zeros(8)
    )
    errors = MemberValues(values, np.ones((8, 1)), clock, runs)
    learned = StateIntervals.learn(errors, 24.0)
    for row in (0, 1):
        path = MemberValues(
            values[row : row + 1], np.ones((8, 1)), clock.rows(slice(row, row + 1)), runs[row : row + 1]
        )
        low, high = learned.offsets(path, np.array([0.1, 0.9]), None, 60.0, None).T
        width = np.where(runs[row], 2.56, 0.0256)
        np.testing.assert_allclose(high - low, width, rtol=0.3)
    always = StateIntervals.learn(errors._replace(runs=np.ones(shape, dtype=bool)), 24.0)
    assert always.resting is always.running  # no row of rest to learn from
    assert StateIntervals.learn(errors._replace(values=np.full((*shape, 1), np.nan)), 24.0) is None


def test_a_plan_is_that_of_the_week_before_by_a_plain_loop():
    rng, n = np.random.default_rng(0), 10 * DAY
    heating = np.where(rng.random(n) < 0.1, 18.0, 21.0)
    band = Band(heating, np.full(n, np.inf))
    rows = LawRows(np.zeros(n), np.zeros(n), band, np.zeros((n, 0)), np.zeros((n, 3)), DAY)
    targets = np.arange(7 * DAY + 4, n)
    expected = [
        np.mean(np.abs(heating[k - 3 : k + 1] - heating[k - 3 - 7 * DAY : k + 1 - 7 * DAY])) < 0.3 for k in targets
    ]
    assert 0.2 < np.mean(expected) < 0.8
    np.testing.assert_array_equal(same_plan(rows, targets), expected)


def test_the_same_time_of_an_earlier_day_by_a_plain_loop():
    """A week before, else any full days before; rows from the origin on are not read."""
    rng, n = np.random.default_rng(0), 10 * DAY
    rows = LawRows(rng.random(n + 1), rng.random(n), Band(np.zeros(n), np.zeros(n)), np.zeros((n, 0)), None, DAY)
    origins = np.array([0, 1, 30, 7 * DAY, 7 * DAY, 8 * DAY])
    targets = np.array([5, 2, 50, 7 * DAY, 9 * DAY, 8 * DAY + 3])
    expected = []
    for origin, target in zip(origins, targets, strict=True):
        found = [k for k in (*range(target - 7 * DAY, -1, -7 * DAY), *range(target, -1, -DAY)) if k < origin]
        expected.append((rows.heat[found[0]], rows.T[found[0] + 1]) if found else (np.nan, np.nan))
    assert np.isfinite(expected).all(axis=1).tolist() == [False, False, True, True, True, True]
    np.testing.assert_array_equal(np.transpose(same_clock(rows, origins, targets)), expected)


def test_pairs_that_are_learned_from_spread_over_all_leads():
    rng, n = np.random.default_rng(0), 20 * DAY
    flat = np.zeros((n, 1))
    rows = LawRows(rng.random(n), rng.random(n), Band(flat[:, 0], flat[:, 0]), flat, np.zeros((n, 3)), DAY)
    origins = np.arange(DAY, 11 * DAY, DAY)
    ideal = LoadPaths(*rng.random((3, len(origins), DAY)))
    pairs = make_pairs(rows, origins, ideal, n)
    origin, lead = np.repeat(np.arange(len(origins)), DAY), (pairs.ends - 1) % DAY
    assert all(set(lead[origin == i] // 4) == set(range(DAY // 4)) for i in range(len(origins)))
    np.testing.assert_array_equal(pairs.heat, np.column_stack([rows.heat[pairs.ends - 1], ideal.heat[origin, lead]]))
    measured = np.column_stack([rows.T[pairs.ends], ideal.temperature[origin, lead]])
    np.testing.assert_array_equal(pairs.temperature, measured)


def test_a_side_that_never_had_a_set_point_may_always_act():
    infinite = np.array([20.0, np.inf, np.inf])
    found = ClosedLoop._acting(SimpleNamespace(_sides=(True, False)), Band(infinite, infinite))
    assert [side.tolist() for side in found] == [[True, False, False], [True, True, True]]


def test_a_law_is_known_by_the_rows_that_it_learns_from():
    T, n, weeks = np.zeros(700), 700, law_refits.Weeks(90, 94, 24)

    def key(T):
        return law_refits._key(LawRows(T, T, Band(T, T), T, None, 24), weeks, 3)

    changed = [row for row in range(n) if key(np.arange(n) == row) != key(T != 0.0)]
    assert changed == list(range(90 + 24, 90 + 3 * 7 * 24))


@pytest.mark.parametrize("begin", ["2024-02-26", "2024-10-21"])  # the clocks change after 13 days
def test_a_thermostat_s_week_before_is_that_of_the_local_clock(begin):
    index = pd.date_range(begin, periods=20 * 24, freq="1h", tz="America/Chicago")
    hour = index.hour.to_numpy(dtype=np.float64)
    X = pd.DataFrame({"T_oa": hour, "Q_hvac": hour, "T_za": hour}, index=index)
    table = read_table(BaseEstimator(), X, reset=True)
    band = Band(np.where((hour >= 6) & (hour < 20), 21.0, 15.0), np.full(len(hour), np.inf))
    rows, origins = LawRows.of(table, hour, band), np.flatnonzero(hour == 0)[8:19]
    targets, lead = (origins[:, None] + np.arange(3, 23)).ravel(), np.tile(np.arange(3, 23), len(origins))
    begins = np.repeat(origins, 20)
    assert same_plan(rows, targets).all()
    heat, _ = same_clock(rows, begins, targets)
    np.testing.assert_array_equal(heat, hour[targets])
    features = further_features(rows, begins, lead)
    np.testing.assert_array_equal(features[:, 10], hour[targets])  # heat of the day before
    np.testing.assert_array_equal(features[:, 11:17], 0.0)  # set-points and outdoor temperature less those before


def test_a_refit_learns_from_what_was_known_at_the_begin_of_its_week(monkeypatch):
    def pairs(n):
        return LawPairs(*(np.zeros((n, 2)) for _ in range(4)), ends=np.zeros(n, dtype=int))

    def made(rows, origins, paths, n_known):
        assert (origins.min(), origins.max(), n_known) == (102, 597, 601)
        return pairs(3)

    def learned(all_pairs, per_day, weight):
        assert (len(all_pairs.ends), per_day) == (5, 24)
        assert weight.tolist() == [1.0, 1.0, 2.0, 2.0, 2.0]
        return "a law"

    monkeypatch.setattr(law_refits, "make_pairs", made)
    monkeypatch.setattr(law_refits, "learn", learned)
    rows = LawRows(np.zeros(900), np.zeros(900), Band(np.zeros(900), np.zeros(900)), np.zeros((900, 1)), None, 24)
    weeks, refits = law_refits.Weeks(96, 100, 24), law_refits.LawRefits("of the training", pairs(2))
    assert refits.learn(rows, weeks, [3], 3, SimpleNamespace(of=lambda origins: None)) == {3: "a law"}
    assert refits.known(rows, weeks, np.array([0, 3])) == {0: "of the training", 3: "a law"}
