"""Forecasts of several zones: no leak between them, one meaning of every method, and what open doors are worth."""

from __future__ import annotations

import copy
import io
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from skhybrid import (
    BuildingPredictor,
    DisturbanceForecaster,
    HybridPredictor,
    InputDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid.datasets import make_house
from skhybrid.exceptions import MeasurementWarning, PlanWarning, RoleWarning, ScaleNotIdentifiableWarning, UnitWarning
from skhybrid.forecasting.quantiles import LeftOut
from skhybrid.hybrid import frames_reading
from skhybrid.hybrid.blending.rolling_blend import RollingBlend
from skhybrid.hybrid.building import base, building_predictor
from skhybrid.hybrid.building.building_forecast import FittedZones
from skhybrid.hybrid.building.coupled_zone import CoupledZone, couple
from skhybrid.hybrid.building.zone_columns import ZoneColumns, found_neighbours
from skhybrid.model_selection import backtest, score_intervals
from skhybrid.persistence import load_model, save_model
from skhybrid.preprocessing import GapFiller

sys.path.insert(0, str(Path(__file__).parent / "rooms"))
from three_rooms import DOORS, ZONES, make_rooms

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning"),
    pytest.mark.usefixtures("quick_fits"),
]
N_TRAIN, DAY = 14 * 24, 24
T_OF = [f"T_za_{zone}" for zone in ZONES]


@pytest.fixture(scope="module")
def rooms() -> tuple[pd.DataFrame, pd.DataFrame]:
    return make_rooms()


@pytest.fixture(scope="module")
def building(rooms) -> BuildingPredictor:
    X, y = rooms
    return BuildingPredictor(adjacency=DOORS).fit(X[:N_TRAIN], y[:N_TRAIN])


@pytest.fixture(scope="module")
def later(rooms) -> pd.DataFrame:
    return rooms[0][N_TRAIN:]


@pytest.fixture(scope="module")
def tomorrow(later) -> pd.DataFrame:
    return later[:DAY].drop(columns=T_OF)


def by_themselves(**settings) -> BuildingPredictor:
    """Zones of the two-stage scheme, which are fitted in a second."""
    gray_box, forecaster = InputDisturbanceID("1R1C", n_starts=1), DisturbanceForecaster("profile")
    return BuildingPredictor(TwoStagePredictor(gray_box, forecaster, random_state=0, **settings))


def test_the_share_of_a_forecast_with_neighbours_begins_after_the_measured_origin():
    shares = np.array([0.2, 0.5, 0.9])
    zone = CoupledZone(("b",), None, np.column_stack([1.0 - shares, shares]), np.ones(24))
    ahead = zone.share(24)
    assert ahead[0] == 0.2
    np.testing.assert_array_equal(zone.share_by_row(24, 1), ahead)
    np.testing.assert_array_equal(zone.share_by_row(25, 0), np.append(0.0, ahead))


def test_intervals_with_neighbours_are_narrower_by_what_their_errors_are():
    rng, origins = np.random.default_rng(0), np.arange(200)
    alone = LeftOut(rng.normal(size=(200, 6)), origins)
    model = SimpleNamespace(left_out_errors=lambda: LeftOut(0.5 * rng.normal(size=(200, 6)), origins))
    zone, found = couple(model, "a", ("b",), {"a": alone, "b": alone}, np.zeros((6, 6, 1)))
    spread = [np.sqrt(np.mean(one.errors**2, axis=0)) for one in (found, alone)]
    np.testing.assert_allclose(zone.ratio, spread[0] / spread[1])
    assert zone.ratio.max() < 0.9


def test_zones_whose_temperatures_have_nothing_in_common_are_no_neighbours():
    rng = np.random.default_rng(0)
    a, alone = rng.normal(size=(2, 1000)).cumsum(axis=1)
    T = pd.DataFrame({"a": a, "b": a + rng.normal(size=1000) * 0.1, "c": alone})
    T.index = pd.date_range("2024-01-01", periods=1000, freq="1h")
    assert found_neighbours(T) == {"a": ("b",), "b": ("a",), "c": ()}


def test_a_target_without_stamps_or_as_text_finds_the_same_neighbours():
    """Rows of y without stamps, as polars has them, made all zones neighbours; text was a TypeError of pandas."""
    X = make_house(9, sampling_time="30min", random_state=0).X
    y = X[[name for name in X if name.startswith("T_za_")]]
    model = BuildingPredictor()
    expected = model.fit(X[:-48], y[:-48]).predict(X[-48:])
    assert any(len(zone.neighbours) < y.shape[1] - 1 for zone in model.coupled_.values())
    for given in (y.reset_index(drop=True), y.map(repr).astype("string")):
        pd.testing.assert_frame_equal(model.fit(X[:-48], given[:-48]).predict(X[-48:]), expected)


def test_the_last_known_temperature_of_each_zone_is_kept():
    zones = FittedZones(ZoneColumns(("a", "b"), {}), {}, {}, {"a": np.nan, "b": 19.0})
    measured = pd.DataFrame({"a": [20.0, 21.0, np.nan], "b": np.nan})
    assert zones.last_after(measured) == {"a": 21.0, "b": 19.0}


@pytest.fixture(scope="module")
def two_stages(rooms) -> BuildingPredictor:
    return by_themselves().fit(rooms[0][:N_TRAIN], rooms[1][:N_TRAIN])


def temperatures(frame: pd.DataFrame) -> np.ndarray:
    return frame[T_OF].to_numpy()


@pytest.mark.slow
def test_a_preprocess_is_applied_to_the_whole_table(rooms, later):
    """Gaps of inputs are filled, those of measurements are not; rows ahead need no measurements."""
    X, y = rooms[0][:N_TRAIN].copy(), rooms[1][:N_TRAIN].copy()
    filled = X.copy()
    X.iloc[50:52, X.columns.get_loc("T_oa")] = np.nan
    filled["T_oa"] = X["T_oa"].interpolate()
    for frame in (X, filled):
        frame.iloc[80:82, frame.columns.get_loc(T_OF[0])] = np.nan
    y.iloc[80:82, 0] = np.nan
    quick = {"network": "1R1C", "intervals": False}
    model = BuildingPredictor(HybridPredictor(preprocess=GapFiller("2h"), **quick), adjacency=DOORS).fit(X, y)
    plain = BuildingPredictor(HybridPredictor(**quick), adjacency=DOORS).fit(filled, y)
    pd.testing.assert_frame_equal(model.predict(X), plain.predict(filled))
    for one in (model, plain):
        one.update(later[:DAY])
    ahead = later[DAY : 2 * DAY].drop(columns=T_OF)
    pd.testing.assert_frame_equal(model.forecast(None, ahead), plain.forecast(None, ahead))


@pytest.mark.parametrize("method", ["predict_from", "predict_quantiles_from"])
def test_a_horizon_without_a_unit_is_refused(building, later, method):
    with pytest.raises(ValueError, match="24"):
        getattr(building, method)(later, [0], horizon=24)


def test_neighbours_help_where_doors_are_open(building, rooms, later):
    origins = np.arange(-1, len(later) - DAY - 1, 5)
    measured = rooms[1][N_TRAIN:].to_numpy()[origins[:, None] + np.arange(1, DAY + 1)]
    alone = np.stack([building.own_[zone].predict_from(later, origins) for zone in ZONES], axis=-1)
    errors = [np.sqrt(np.mean((paths - measured) ** 2)) for paths in (building.predict_from(later, origins), alone)]
    assert errors[0] < 0.9 * errors[1]
    assert (building.shares_ > 0.2).to_numpy().all()


def test_nothing_measured_after_an_origin_is_read(building, later):
    origins = np.array([0, 30, 60])
    before = building.predict_from(later, origins)
    for value in (np.nan, 45.0):
        changed = later.copy()
        changed.iloc[61:, [changed.columns.get_loc(c) for c in T_OF]] = value
        np.testing.assert_array_equal(building.predict_from(changed, origins), before)
    changed = later.copy()
    changed.iloc[31:, changed.columns.get_loc("T_za_hall")] = 45.0
    after = building.predict_from(changed, origins)
    np.testing.assert_array_equal(after[:2], before[:2])
    assert np.abs(after[2] - before[2]).max() > 1.0, "a measured neighbour is read"


def test_predict_is_predict_from_at_each_day(building, later):
    predicted = building.predict(later)
    assert list(predicted) == list(ZONES)
    assert predicted.index.equals(later.index)
    paths = building.predict_from(later, [-1, 0, DAY], "1D")  # the first row is midnight
    np.testing.assert_array_equal(predicted[:1], paths[0][:1])
    np.testing.assert_array_equal(predicted[1 : 2 * DAY + 1], np.concatenate(paths[1:]))


def test_quantiles_and_back_tests_are_those_of_predict_from(building, rooms, later):
    days = later[: 5 * DAY]
    measured = rooms[1][N_TRAIN:][: 5 * DAY]
    frame = backtest(building, days, measured, quantiles=(0.1, 0.9))
    assert frame["y_true"].equals(backtest(building, days, measured[list(ZONES[::-1])])["y_true"])
    with pytest.raises(ValueError, match=r"y has no column of zone 'hall'; name one 'hall' or 'T_za_hall'"):
        backtest(building, days, measured.rename(columns={"hall": "corridor"}))
    assert list(frame["zone"].unique()) == list(ZONES)
    hall = frame[frame["zone"] == "hall"]
    origins = np.arange(0, 4 * DAY, DAY)
    np.testing.assert_array_equal(hall["y_pred"], building.predict_from(days, origins)[..., 1].ravel())
    np.testing.assert_array_equal(hall["y_true"], rooms[1]["hall"].loc[hall["time"]])
    bands = building.predict_quantiles_from(days, origins, (0.1, 0.9))
    np.testing.assert_array_equal(hall["q_0.9"], bands[:, :, 1, 1].ravel())
    rolled = building.predict_quantiles(days, (0.1, 0.9))[1 : DAY + 1]
    np.testing.assert_allclose(rolled, bands[0], atol=1e-9)
    future = days[:DAY].drop(columns=T_OF)
    found = building.forecast(None, future, quantiles=(0.1, 0.9))[[f"q_0.1_{zone}" for zone in ZONES]]
    np.testing.assert_allclose(found, building.predict_quantiles_from(days, [-1], (0.1, 0.9))[0, :, :, 0], atol=1e-9)
    assert 0.5 < score_intervals(frame)["coverage"] < 1.0


def test_intervals_of_all_zones_allow_for_errors_of_the_weather(building, later, tomorrow):
    exact, off = (building.forecast(None, tomorrow, quantiles=(0.1, 0.9), weather_error=e) for e in (None, "high"))
    np.testing.assert_array_equal(temperatures(exact), temperatures(off))
    for zone in ZONES:
        low, high = f"q_0.1_{zone}", f"q_0.9_{zone}"
        assert (off[high] - off[low]).mean() > 1.05 * (exact[high] - exact[low]).mean()
    whole = building.predict_quantiles_from(later[:DAY], [-1], (0.1, 0.9), weather_error="high")[0]
    np.testing.assert_allclose(off[[f"q_0.9_{zone}" for zone in ZONES]], whole[:, :, 1], atol=1e-9)
    with pytest.raises(ValueError, match="weather_error= widens quantiles, and none are asked for"):
        building.forecast(None, tomorrow, weather_error="high")


def test_update_and_forecast_are_predict_from(building, later, tomorrow):
    model = copy.deepcopy(building)
    np.testing.assert_allclose(
        temperatures(model.forecast(None, tomorrow)), model.predict_from(later, [-1])[0], atol=1e-9
    )
    known, future = later[: 2 * DAY], later[2 * DAY : 3 * DAY].drop(columns=T_OF)
    expected = building.predict_from(later, [2 * DAY - 1])[0]
    np.testing.assert_allclose(temperatures(building.forecast(known, future)), expected, atol=1e-9)
    model.update(known)
    np.testing.assert_allclose(temperatures(model.forecast(None, future)), expected, atol=1e-9)


def test_after_a_forecast_an_update_learns_at_once(building, later, tomorrow, monkeypatch):
    learned, advance = [], RollingBlend.advance
    monkeypatch.setattr(RollingBlend, "advance", lambda blend, *to: learned.append(to[1]) or advance(blend, *to))
    model = copy.deepcopy(building)
    model.forecast(None, tomorrow)
    learned.clear()
    model.update(later[:5])
    assert learned == [N_TRAIN + 4] * 6  # by two predictors of three zones
    learned.clear()
    model.forecast(None, later[5 : 5 + DAY].drop(columns=T_OF))
    assert not learned


def test_rows_that_are_read_once_give_what_rows_read_by_zone_give(building, later, tomorrow, monkeypatch):
    """Whether a building parses a table for all of its zones, or each predictor by itself, changes nothing."""
    n_read, read = [], frames_reading.read_table

    def counted(*args, **kwargs):
        n_read.append(1)
        return read(*args, **kwargs)

    def step(model):
        n_read.clear()
        model = copy.deepcopy(model).update(later[:5])
        frames = [model.forecast(None, later[5 : 5 + DAY].drop(columns=T_OF), **given) for given in ({}, NOW, BANDS)]
        return pd.concat(frames), len(n_read)

    NOW, BANDS = {"T_za": [20.0, 18.0, 19.0]}, {"quantiles": (0.1, 0.9)}
    monkeypatch.setattr(frames_reading, "read_table", counted)
    at_once, n_at_once = step(building)
    for module in (base, building_predictor):
        monkeypatch.setattr(module, "tables_of_zones", lambda *args, **kwargs: None)
    by_zone, n_by_zone = step(building)
    pd.testing.assert_frame_equal(at_once, by_zone, rtol=0.0, atol=1e-10)
    assert (n_at_once, n_by_zone) == (4, 4 * 6)  # an update and three forecasts, by two predictors of three zones


def test_what_is_measured_now_starts_the_forecast(building, tomorrow):
    now = {"kitchen": 20.5, "hall": 18.5, "study": 19.5}
    frame = building.forecast(None, tomorrow, T_za=now)
    np.testing.assert_array_equal(temperatures(frame)[0], list(now.values()))
    row = pd.DataFrame(now, tomorrow.index[:1]).add_prefix("T_za_")
    pd.testing.assert_frame_equal(building.forecast(None, tomorrow, T_za=row), frame)
    for wrong, said in (
        ({}, "T_za has no temperature of any zone; the zones are 'kitchen', 'hall', 'study'"),
        ([np.nan, None, np.nan], "T_za has no temperature of any zone.* or leave T_za out"),
        (20.0, "T_za has 1 value; give one for each of 'kitchen'"),
        ([20.0, 19.0, 18.0, 17.0], "T_za has 4 values; give one for each of 'kitchen'"),
        ({**now, "attic": 3.0}, "T_za names 'attic', which is not a zone; the zones are"),
    ):
        with pytest.raises(ValueError, match=said):
            building.forecast(None, tomorrow, T_za=wrong)


@pytest.mark.parametrize("now", [{"kitchen": 20.5, "study": 19.5}, [20.5, np.nan, 19.5]])
def test_a_room_without_a_temperature_now_goes_on_from_its_last_one_among_others_that_have_one(
    building, rooms, tomorrow, now
):
    alone = building.without_neighbours()
    for history in (None, rooms[0][N_TRAIN - 4 * DAY : N_TRAIN]):
        found, measured, free = (alone.forecast(history, tomorrow, T) for T in (now, [20.5, 18.5, 19.5], None))
        pd.testing.assert_frame_equal(found, measured.assign(**free.filter(like="_hall")))
        hall, usual = (building.forecast(history, tomorrow, T)["T_za_hall"].to_numpy() for T in (now, None))
        assert hall[0] == pytest.approx(usual[0])  # on which the rooms beside it act later
        assert np.abs(hall - usual).max() > 0.01
        T = building.affine_forecast(history, tomorrow, T_za=now)
        planned = T.temperature(tomorrow[list(T.inputs)].to_numpy())
        np.testing.assert_allclose(planned, temperatures(building.forecast(history, tomorrow, now)), atol=1e-9)
    first = building.sample(None, tomorrow, 5, now, random_state=0).xs(tomorrow.index[0], level="time")
    assert (first.nunique() == [1, 5, 1]).all()


def test_affine_forecast_is_the_forecast(building, tomorrow):
    found = building.affine_forecast(None, tomorrow)
    assert found.gain.shape == (DAY, DAY, 3, 3)
    plan = tomorrow.assign(Q_hvac_hall=tomorrow["Q_hvac_hall"] + np.linspace(0.0, 0.6, DAY))
    for rows in (tomorrow, plan):
        T = found.temperature(rows[list(found.inputs)].to_numpy())
        np.testing.assert_allclose(T, temperatures(building.forecast(None, rows)), atol=1e-9)
    i, j = np.triu_indices(DAY)
    assert not found.gain[i, j].any(), "heat acts after its step has begun"
    hall = building.affine_forecast(None, tomorrow, "Q_hvac_hall")
    np.testing.assert_array_equal(hall.gain[:, :, 0], found.gain[:, :, 1])
    for wrong in (["Q_hvac_hall", "Q_hvac_hall"], (), ["T_oa"], ["Q_hvac_attic"]):
        with pytest.raises(ValueError, match=r"^inputs"):
            building.affine_forecast(None, tomorrow, wrong)
    one = building.affine_forecast(None, tomorrow.drop(columns="Q_hvac_hall"), ["Q_hvac_hall"], T_za=[20.0, 18.0, 19.0])
    frame = building.forecast(None, plan, T_za=[20.0, 18.0, 19.0])
    np.testing.assert_allclose(one.temperature(plan["Q_hvac_hall"].to_numpy()), temperatures(frame), atol=1e-9)


def test_a_zone_is_warned_of_once(building, later, tomorrow):
    """Predictors with neighbours repeated what was said, or named columns that nobody had given."""
    hot, far = later.assign(T_oa=57.0), tomorrow.assign(Q_hvac_hall=20.0)
    calls = {
        UnitWarning: ("zones 'kitchen', 'hall', 'study': ", lambda: building.predict_from(hot, [5])),  # of T_oa
        PlanWarning: ("zone 'hall': ", lambda: building.affine_forecast(None, far)),
    }
    for category, (beginning, call) in calls.items():
        with pytest.warns(category) as told:
            call()
        (said,) = [str(one.message) for one in told if issubclass(one.category, PlanWarning | UnitWarning)]
        assert said.startswith(beginning)
        assert "T_next" not in said


def test_a_plan_in_words_is_refused_by_its_column(building, tomorrow):
    with pytest.raises(ValueError, match=r"^Q_hvac_hall is not numeric"):
        building.affine_forecast(None, tomorrow.assign(Q_hvac_hall="off"))


def test_heat_of_a_room_reaches_the_next_one(building, tomorrow):
    """A kW in the hall warms the hall most, and the rooms beside it."""
    found = building.affine_forecast(None, tomorrow, ["Q_hvac_hall"])
    step = found.gain[6, :6, 0, :].sum(axis=0)
    assert step[1] > 2.0 * max(step[0], step[2]) > 0.0


def test_heat_never_cools_another_room_where_it_is_planned(rooms, tomorrow):
    """ARX among neighbours has made a kW in the kitchen cool the hall by 0.9 K."""
    X, y = rooms
    plan = BuildingPredictor(SchedulePredictor(purpose="plan", intervals=False), adjacency=DOORS)
    found = plan.fit(X[:N_TRAIN], y[:N_TRAIN]).affine_forecast(None, tomorrow)
    assert found.gain.min() >= 0.0
    step = found.gain[-1].sum(axis=0)  # by input and zone
    assert (step.diagonal() > 2.0 * step.sum(axis=1) / 3.0).all()
    assert step[[0, 1, 1, 2], [1, 0, 2, 1]].min() > 0.1
    T = found.temperature(tomorrow[list(found.inputs)].to_numpy())
    np.testing.assert_allclose(T, temperatures(plan.forecast(None, tomorrow)), atol=1e-9)


def test_loads_hold_the_set_points_and_share_a_plant(building, later):
    rows = later[:DAY]
    wanted = {"kitchen": (20.5, None), "study": (20.5, None)}
    free = building.predict_load(rows, wanted)
    assert free["T_za_kitchen"][1:].min() > 20.5 - 0.5
    np.testing.assert_allclose(free["Q_hvac_hall"], 0.0, atol=1e-9)
    heat = [f"Q_hvac_{zone}" for zone in ZONES]
    most = 0.5 * free[heat].sum(axis=1).max()
    limited = building.predict_load(rows, wanted, (0.0, most))
    assert limited[heat].sum(axis=1).max() <= most + 1e-9
    assert limited["T_za_kitchen"].min() < free["T_za_kitchen"].min() + 1e-9
    apart = building.predict_load(rows, wanted, {"kitchen": (0.0, 0.1)})
    assert apart["Q_hvac_kitchen"].max() <= 0.1 + 1e-9
    with pytest.raises(ValueError, match="limits names 'attic', which is not a zone"):
        building.predict_load(rows, wanted, {"attic": (0.0, 0.1)})
    with pytest.raises(ValueError, match="setpoint names 'attic', which is not a zone"):
        building.predict_load(rows, {"attic": 20.0})


def test_limits_of_a_forecast_may_be_those_of_some_zones(building, tomorrow):
    wanted = {"kitchen": (20.5, None), "study": (20.5, None)}
    free, all_limited, limited = (
        building.forecast(None, tomorrow, setpoint=wanted, limits=limits)
        for limits in (None, (0.0, 0.1), {"kitchen": (0.0, 0.1)})
    )
    assert limited["Q_hvac_kitchen"].max() <= 0.1 < free["Q_hvac_kitchen"].max()
    assert all_limited["Q_hvac_study"].max() <= 0.1 < limited["Q_hvac_study"].max()
    with pytest.raises(ValueError, match="limits names 'attic', which is not a zone"):
        building.forecast(None, tomorrow, setpoint=wanted, limits={"attic": (0.0, 0.1)})


def test_rows_to_take_in_have_a_temperature_each(building, rooms, later):
    new, y = later[:4], rooms[1][N_TRAIN : N_TRAIN + 3]
    for call in (copy.deepcopy(building).update, copy.deepcopy(building).partial_fit, building.score):
        with pytest.raises(ValueError, match=r"inconsistent numbers of samples: \[4, 3\]"):
            call(new, y)


def test_a_shared_plant_binds_only_where_all_zones_together_need_more(building, later):
    rows, heat = later[:DAY], [f"Q_hvac_{zone}" for zone in ZONES]
    own = building.predict_load(rows, 15.0, dict.fromkeys(ZONES, (-30.0, 60.0)))
    assert own[heat].to_numpy().min() < -0.1, "training never saw that rooms are cooled"
    pd.testing.assert_frame_equal(building.predict_load(rows, 15.0, (-30.0, 60.0)), own)
    alone = building.predict_load(rows, (21.0, 24.0), dict.fromkeys(ZONES, (None, 60.0)))
    most = 0.6 * alone[heat].sum(axis=1).max()
    alone = building.predict_load(rows, (21.0, 24.0), dict.fromkeys(ZONES, (None, most)))
    shared = building.predict_load(rows, (21.0, 24.0), (None, most))
    total, needed = shared[heat].sum(axis=1).to_numpy(), alone[heat].sum(axis=1).to_numpy()
    assert total.max() <= most + 1e-9
    first = int(np.argmax(needed > most))
    np.testing.assert_allclose(shared[heat][:first], alone[heat][:first], atol=1e-9)
    np.testing.assert_allclose(shared[heat].iloc[first], alone[heat].iloc[first] * most / needed[first], atol=1e-6)
    short = (21.0 - temperatures(shared)[1:]).max(axis=1) > 0.1
    assert 0 < short.sum() < DAY - 1
    np.testing.assert_allclose(total[:-1][short], most, atol=0.1)


def test_samples_have_the_quantiles_and_the_correlation(building, rooms, later):
    tomorrow = later[:DAY].drop(columns=T_OF)
    drawn = paths_of(building.sample(None, tomorrow, 200, random_state=0))
    frame = building.forecast(None, tomorrow, quantiles=[0.1, 0.9])
    for level in (0.1, 0.9):
        band = frame[[f"q_{level}_{zone}" for zone in ZONES]].to_numpy()
        np.testing.assert_allclose(np.quantile(drawn, level, axis=0), band, atol=0.02)
    np.testing.assert_array_equal(drawn, paths_of(building.sample(None, tomorrow, 200, random_state=0)))
    position = np.random.get_state()[2]  # noqa: NPY002
    assert not np.array_equal(*(building.sample(None, tomorrow, 5) for _ in range(2)))
    assert np.random.get_state()[2] == position  # noqa: NPY002
    with pytest.raises(ValueError, match="random_state='a' must be an integer from 0"):
        building.sample(None, tomorrow, 5, random_state="a")


def test_joint_samples_score_better_than_independent_ones(building, rooms, later):
    """Energy score of the sum over zones, against the same margins in any order."""
    rng, scores = np.random.default_rng(0), []
    for begin in range(0, 8 * DAY, DAY):
        known, future = later[:begin], later[begin : begin + DAY].drop(columns=T_OF)
        drawn = paths_of(building.sample(known if begin else None, future, 100, random_state=1))
        apart = np.stack([rng.permuted(drawn[..., j], axis=0) for j in range(len(ZONES))], axis=-1)
        truth = rooms[1][N_TRAIN + begin : N_TRAIN + begin + DAY].to_numpy()
        scores.append([energy_score(paths.mean(axis=(1, 2))[:, None], truth.mean()) for paths in (drawn, apart)])
    assert np.mean(scores, axis=0)[0] < np.mean(scores, axis=0)[1]


def paths_of(samples):
    """(n_samples, n_rows, n_zones)"""
    return samples.to_numpy().reshape(samples.index.levshape[0], -1, samples.shape[1])


def energy_score(drawn: np.ndarray, truth: np.ndarray | float) -> float:
    apart = np.linalg.norm(drawn[:, None] - drawn[None], axis=-1).mean()
    return float(np.linalg.norm(drawn - truth, axis=-1).mean() - 0.5 * apart)


def test_temperatures_of_the_zones_may_come_in_y_alone(building, rooms, later, tomorrow):
    X, y = rooms
    alone = BuildingPredictor(adjacency=DOORS).fit(X.drop(columns=T_OF)[:N_TRAIN], y[:N_TRAIN])
    pd.testing.assert_frame_equal(alone.forecast(X[:N_TRAIN], tomorrow), building.forecast(X[:N_TRAIN], tomorrow))


def test_a_zone_without_neighbours_is_its_own_predictor(rooms, later, tomorrow):
    X, y = rooms
    model = BuildingPredictor(HybridPredictor(intervals=False), adjacency=[]).fit(X[:N_TRAIN], y[:N_TRAIN])
    assert not model.coupled_
    room = X.rename(columns={"Q_hvac_hall": "Q_hvac", "T_za_hall": "T_za"})[["T_oa", "q_sol", "Q_hvac", "T_za"]]
    alone = HybridPredictor(intervals=False).fit(room[:N_TRAIN], room["T_za"][:N_TRAIN])
    np.testing.assert_array_equal(model.predict(later)["hall"], alone.predict(room[N_TRAIN:]))


def test_a_zone_whose_thermometer_fails_is_forecast_from_the_others(building, later):
    known, future = later[: 2 * DAY], later[2 * DAY : 3 * DAY].drop(columns=T_OF)
    silent = known.assign(T_za_hall=np.nan)
    with pytest.warns(MeasurementWarning, match="zone 'hall'.*no temperature"):
        model = copy.deepcopy(building).update(silent)
    with pytest.warns(MeasurementWarning, match="zone 'hall'.*no temperature"):
        building.forecast(silent, future)
    with pytest.warns(MeasurementWarning, match="zone 'hall'.*no temperature"):
        building.affine_forecast(silent, future)
    found = temperatures(model.forecast(None, future))
    assert np.isfinite(found).all()
    whole = copy.deepcopy(building).update(known)
    assert np.abs(found - temperatures(whole.forecast(None, future)))[:, 1].max() < 4.0


def test_a_silence_is_told_once_however_few_rows_come_at_a_time(building, later):
    model, hour = copy.deepcopy(building).update(later[:DAY]), DAY // 24
    for begin in range(DAY, DAY + 3 * hour):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            model.update(later[begin : begin + 1].assign(T_za_hall=np.nan))
        said = [str(one.message) for one in told if one.category is MeasurementWarning]
        assert len(said) == (begin == DAY + hour - 1), said
    with pytest.warns(MeasurementWarning, match=f"from {later.index[DAY]} to "):  # a day of rows tells it anew
        model.update(later[begin + 1 : begin + 1 + DAY].assign(T_za_hall=np.nan))


@pytest.mark.parametrize("zone", ZONES)
def test_zones_are_forecast_from_every_day_whichever_of_them_is_not_measured(two_stages, later, zone):
    with_all, without = (two_stages.predict(X) for X in (later, later.assign(**{f"T_za_{zone}": np.nan})))
    others = [other for other in ZONES if other != zone]
    pd.testing.assert_frame_equal(without[others], with_all[others])
    blind = two_stages.predict(later.drop(columns=T_OF))
    assert not np.allclose(blind[others][DAY:], with_all[others][DAY:], atol=1e-3)
    alone = two_stages.predict(later[DAY : DAY + 1])  # a row that is an origin, after which there is none
    np.testing.assert_allclose(alone, [[model.predict(later[DAY : DAY + 1])[0] for model in two_stages.own_.values()]])


@pytest.fixture(scope="module")
def with_unheated_hall(rooms):
    """A building whose hall has no plant, and the day after its training."""
    X, y = rooms
    X = X.drop(columns="Q_hvac_hall")
    model = BuildingPredictor(HybridPredictor(intervals=False), adjacency=DOORS)
    return model.fit(X[:N_TRAIN], y[:N_TRAIN]), X[N_TRAIN : N_TRAIN + DAY]


def test_a_room_without_heating(with_unheated_hall):
    model, tomorrow = with_unheated_hall
    found = model.affine_forecast(None, tomorrow)
    T = found.temperature(tomorrow[list(found.inputs)].to_numpy())
    np.testing.assert_allclose(T, temperatures(model.forecast(None, tomorrow)), atol=1e-9)
    assert found.gain[6, :6, 0, 1].sum() > 0.0, "the kitchen's heat reaches the hall"
    load = model.predict_load(tomorrow, {"kitchen": (20.0, None)}, {"kitchen": (0.0, 1.0)})
    assert load["Q_hvac_kitchen"].max() <= 1.0
    assert [name for name in load if name.endswith("hall")] == ["T_za_hall", "zeta_hall"]
    pd.testing.assert_frame_equal(
        *(model.predict_load(tomorrow, held) for held in (20.0, {"kitchen": 20.0, "study": 20.0}))
    )


def test_what_a_plant_would_do_is_refused_of_a_room_without_one(with_unheated_hall):
    model, tomorrow = with_unheated_hall
    plan = tomorrow.drop(columns="Q_hvac_kitchen")
    for call, given in (
        (lambda: model.predict_load(tomorrow, {"hall": 20.0}), "setpoint"),
        (lambda: model.predict_load(tomorrow, {"kitchen": 20.0}, {"hall": (0.0, 1.0)}), "limits"),
        (lambda: model.forecast(None, plan, setpoint={"kitchen": 20.0, "hall": 20.0}), "setpoint"),
    ):
        with pytest.raises(ValueError, match=f"{given} names 'hall', which had no heating or cooling in training"):
            call()
    with pytest.raises(ValueError, match="the training has no heating or cooling, so that there is no load"):
        model.own_["hall"].predict_load(tomorrow, 20.0)
    with pytest.raises(ValueError, match="the training has no heating or cooling, so that set-points do nothing"):
        model.own_["hall"].forecast(None, tomorrow, setpoint=20.0)


def test_rooms_of_which_none_has_a_plant_are_forecast_without_limits(rooms):
    X = rooms[0].filter(regex="^(?!Q_|u_)")[: N_TRAIN + DAY]
    model = by_themselves(intervals=False).fit(X[:N_TRAIN], rooms[1][:N_TRAIN])
    tomorrow = X[N_TRAIN:].drop(columns=T_OF)
    assert np.isfinite(temperatures(model.forecast(None, tomorrow))).all()
    with pytest.raises(ValueError, match="no zone had heating or cooling in training, so that limits does nothing"):
        model.forecast(None, tomorrow, limits=(0.0, 1.0))


def test_a_boiler_that_rooms_share(rooms):
    X, y = rooms
    boiler = X.drop(columns=[f"Q_hvac_{zone}" for zone in ZONES]).assign(u_heat=X.filter(like="Q_").sum(axis=1) / 7.5)
    model = BuildingPredictor(HybridPredictor(intervals=False, known={"Q_h": 2.5}), adjacency=DOORS)
    tomorrow = boiler[N_TRAIN : N_TRAIN + DAY].drop(columns=T_OF)
    found = model.fit(boiler[:N_TRAIN], y[:N_TRAIN]).affine_forecast(None, tomorrow)
    assert found.inputs == ("u_heat",)
    assert (found.gain[12, :12, 0].sum(axis=0) > 0.0).all(), "the boiler warms every room"
    np.testing.assert_allclose(found.temperature(tomorrow["u_heat"]), temperatures(model.forecast(None, tomorrow)))
    assert model.shared_plants_ == ["u_heat"]
    only_set = tomorrow.drop(columns="u_heat").assign(T_heat_set=20.0)
    for call in (
        lambda: model.predict_load(tomorrow, 20.0),
        lambda: model.predict_load(tomorrow, {"hall": 20.0}, (0.0, 3.0)),
        lambda: model.forecast(None, tomorrow, setpoint=20.0),
        lambda: model.forecast(None, only_set),
    ):  # no stage of a boiler holds all set-points
        with pytest.raises(ValueError, match="'u_heat' is of a plant that several zones share, which cannot hold"):
            call()


@pytest.mark.slow
def test_a_search_goes_over_parameters_of_the_zones(rooms):
    X, y = rooms
    model = BuildingPredictor(HybridPredictor(intervals=False), adjacency=[])
    search = GridSearchCV(model, {"estimator__network": ["1R1C", "2R2C"]}, cv=[(np.arange(200), np.arange(200, 248))])
    assert search.fit(X[:248], y[:248]).best_score_ > 0.5
    assert search.predict(X[248:260]).shape == (12, 3)


def test_names_of_zones(rooms):
    X, y = rooms
    model = BuildingPredictor(HybridPredictor(intervals=False, network="1R1C"), adjacency=[])
    by_role = clone(model).fit(X[:200], y[:200].add_prefix("T_za_"))
    shuffled = clone(model).fit(X[:200], y[:200][["study", "kitchen", "hall"]])
    np.testing.assert_array_equal(by_role.predict(X[200:248]), shuffled.predict(X[200:248])[list(ZONES)])
    short = X.rename(columns={"Q_hvac_hall": "Q_hall"})
    np.testing.assert_array_equal(
        clone(model).fit(short[:200], y[:200]).predict(short[200:248]), by_role.predict(X[200:248])
    )
    other = X.rename(columns={"T_oa": "outside"})
    mapped = BuildingPredictor(model.estimator.set_params(columns={"T_oa": "outside"}), adjacency=[])
    np.testing.assert_array_equal(mapped.fit(other[:200], y[:200]).predict(other[200:248]), by_role.predict(X[200:248]))


@pytest.mark.parametrize("hours", [24, 30])
def test_a_day_of_training_is_enough(rooms, hours):
    X, y = rooms
    model = BuildingPredictor(adjacency=DOORS).fit(X[:hours], y[:hours])
    found = model.forecast(None, X[hours : hours + 24])
    assert found[[f"T_za_{zone}" for zone in ZONES]].notna().all(axis=None)


def test_set_points_in_columns_of_the_zones_are_those_of_each(building, later, rooms):
    """Of two zones they were read as a thermostat's heating and cooling set-point, of all zones alike."""
    wanted = rooms[1][N_TRAIN : N_TRAIN + DAY][["kitchen", "hall"]]
    expected = building.predict_load(later[:DAY], {zone: wanted[zone] for zone in wanted})
    for given in (wanted, wanted.add_prefix("T_za_")):
        pd.testing.assert_frame_equal(building.predict_load(later[:DAY], given), expected)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "Q_hvac_hal",
            "'Q_hvac_hal' ends with the name of no zone and counts as a plant that all zones share; the zones",
        ),
        ("T_heat_set_hal", "'T_heat_set_hal' ends with the name of no zone and is not read; the zones are"),
    ],
)
def test_a_column_that_is_named_after_no_zone_is_told(rooms, name, said):
    X, y = rooms
    X = X.rename(columns={"Q_hvac_hall": name})[:N_TRAIN]
    model = BuildingPredictor(HybridPredictor(intervals=False, network="1R1C"), adjacency=[])
    with pytest.warns(RoleWarning, match=said):
        model.fit(X, y[:N_TRAIN])
    with warnings.catch_warnings():
        warnings.simplefilter("error", RoleWarning)
        model.fit(X.rename(columns={name: "Q_oven"}), y[:N_TRAIN])


def test_zones_of_one_sensor_are_no_neighbours(rooms):
    """They were found to be the closest, and refused, as the temperature beside each was its own."""
    X, y = rooms
    X = X[["T_oa", "q_sol", "Q_hvac_kitchen", "T_za_kitchen"]].assign(Q_hvac_hall=X["Q_hvac_kitchen"])
    X, y = X.assign(T_za_hall=X["T_za_kitchen"])[:N_TRAIN], y[["kitchen"]].assign(hall=y["kitchen"])[:N_TRAIN]
    model = BuildingPredictor(HybridPredictor(intervals=False, network="1R1C"))
    found = clone(model).fit(X, y).coupled_
    assert found == {}
    for given in (y, y.reset_index(drop=True)):
        assert found_neighbours(given) == {"kitchen": (), "hall": ()}
    with pytest.raises(ValueError, match="the zones 'hall', 'kitchen' of adjacency have the same temperature"):
        model.set_params(adjacency=DOORS[:1]).fit(X, y)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X, y, m: (X, y.drop(columns="hall"), m), "y has no temperature of the zone 'hall'"),
        (lambda X, y, m: (X.drop(columns="T_za_hall"), y, m), "X has no temperature of the zone 'hall'"),
        (lambda X, y, m: (X, y.rename(columns={"hall": "the hall"}), m), "zone 'the hall'"),
        (
            lambda X, y, m: (X, y, m.set_params(adjacency=[("hall", "attic")])),
            "adjacency names 'attic', which is not one of",
        ),
        (lambda X, y, m: (X, y, m.set_params(adjacency=[("hall", "hall")])), "couples 'hall' with itself"),
        (lambda X, y, m: (X, y, m.set_params(adjacency=["hall"])), "adjacency has 'hall'; give pairs of zones"),
        (lambda X, y, m: (X, y, m.set_params(adjacency="hall")), "adjacency has 'hall'; give pairs of zones"),
        (lambda X, y, m: (X, y, m.set_params(n_jobs="a")), "n_jobs='a' must be a number of workers"),
        (lambda X, y, m: (X, y.assign(hall=np.nan), m), "zone 'hall': Input y contains NaN"),
        (lambda X, y, m: (X.drop(columns="T_oa"), y, m), "role 'T_oa' is missing: X has [^;]*'T_za_study'; name a"),
        (lambda X, y, m: (X.assign(Q_hvac_hall=np.nan), y, m), "zone 'hall'.*Q_hvac_hall.*NaN"),
        (lambda X, y, m: (X, y[:-1], m), "inconsistent numbers of samples"),
        (lambda X, y, m: (X, y.to_numpy()[:, :2], m), "y has 2 columns, X 3"),
        (lambda X, y, m: (X, y, m.set_params(estimator=TwoStagePredictor(), adjacency=DOORS)), "two-stage"),
        (lambda X, y, m: (X, y, m.set_params(estimator=object())), "must be a hybrid predictor"),
        (
            lambda X, y, m: (X, y, m.set_params(estimator=HybridPredictor(columns=["T_oa"]))),
            r"^columns=\['T_oa'\] must be a mapping of roles to columns",
        ),
    ],
)
def test_what_cannot_be_right_is_refused(rooms, change, message):
    X, y, model = change(rooms[0][:96], rooms[1][:96], BuildingPredictor(HybridPredictor(network="1R1C")))
    with pytest.raises(ValueError, match=message):
        model.fit(X, y)
    assert not hasattr(model, "own_")


def test_a_setpoint_in_degf_is_told_once(building, later):
    """The second forecasts, with neighbours, repeated it, and named columns that the user does not have."""
    with pytest.warns(UnitWarning) as caught:
        building.predict_load(later[:DAY], 70.0)
    (said,) = [str(w.message) for w in caught if w.category is UnitWarning]
    assert said.startswith(f"zones {', '.join(map(repr, ZONES))}: setpoint is 70: likely degF rather than degC")


@pytest.mark.parametrize(
    "call",
    [
        lambda model, rows: model.predict_load(rows, 21.0),
        lambda model, rows: model.affine_forecast(None, rows),
        lambda model, rows: copy.deepcopy(model).update(rows),
        lambda model, rows: model.drift(rows),
    ],
)
def test_what_zones_share_is_told_once_of_plans_and_new_rows_too(building, later, call):
    with pytest.warns(UnitWarning) as caught:
        call(building, later[:DAY].assign(T_oa=57.0))
    (said,) = [str(w.message) for w in caught if w.category is UnitWarning]
    assert said.startswith(f"zones {', '.join(map(repr, ZONES))}: ")


def test_exchanged_rooms_are_refused(two_stages, rooms):
    """An array has its zones in the order of the columns of X; a frame may name them wrongly."""
    X, y = rooms
    turned, learned = X[X.columns[::-1]], slice(0, N_TRAIN)
    said = r"y of '(kitchen|study)' is what X has measured in '(?!\1)\w+', and not in '\1' itself: give y as a Data"
    with pytest.raises(ValueError, match=said):
        by_themselves().fit(turned[learned], y[learned].to_numpy())
    exchanged = y.set_axis(["study", "hall", "kitchen"], axis=1)
    gaps = y.mask(np.random.default_rng(0).random(y.shape) < 0.3)
    rows = slice(N_TRAIN, N_TRAIN + DAY)
    for wrong in (exchanged[rows], gaps[rows].to_numpy()):
        at = X if isinstance(wrong, pd.DataFrame) else turned
        for method in ("partial_fit", "update", "score"):
            with pytest.raises(ValueError, match=said):
                getattr(copy.deepcopy(two_stages), method)(at[rows], wrong)


def test_rooms_that_only_look_alike_are_not_exchanged(two_stages, rooms):
    """A target measured by a second sensor, a room that is constant, and rooms that share a sensor are accepted."""
    X, y = rooms[0][N_TRAIN : N_TRAIN + DAY], rooms[1][N_TRAIN : N_TRAIN + DAY]
    assert two_stages.score(X, y + 0.1) > -np.inf
    shared = X.assign(T_za_study=X["T_za_hall"])
    assert two_stages.score(shared, y.assign(study=y["hall"])[["study", "kitchen", "hall"]]) > -np.inf
    assert two_stages.score(X.assign(T_za_hall=20.0), y.assign(study=20.0)) > -np.inf
    bare = X.drop(columns=T_OF)
    assert copy.deepcopy(two_stages).update(bare, y.to_numpy()).known_until_ == X.index[-1]


def test_a_score_needs_a_measured_row_and_a_weight_for_each(two_stages, rooms, later):
    X, y = later[:DAY], rooms[1][N_TRAIN : N_TRAIN + DAY]
    weight = np.arange(1.0, DAY + 1.0)
    assert two_stages.score(X, y, weight) != two_stages.score(X, y)
    with pytest.raises(ValueError, match="no measured row"):
        two_stages.score(X, y.assign(**{ZONES[0]: np.nan}))
    with pytest.raises(ValueError, match="sample_weight"):
        two_stages.score(X, y, weight[1:])


def test_tables_and_targets_of_no_shape_are_refused(two_stages, later):
    with pytest.raises(ValueError, match=r"y=21\.0 is a single value; give a temperature for each row"):
        two_stages.update(later, 21.0)
    with pytest.raises(ValueError, match=r"X is not numeric .*convert it to float first"):
        two_stages.predict_load("X", 21.0)
    with pytest.raises(ValueError, match="X is a Series; give a DataFrame"):
        two_stages.predict_load(later.iloc[:, 0], 21.0)


def test_plans_of_zones_that_set_points_leave_out_are_told(building, tomorrow):
    """The planned heat of the other zones was taken for 0 in silence."""
    plan = tomorrow.assign(Q_hvac_hall=0.0)
    with pytest.warns(PlanWarning) as told:
        free = building.forecast(None, plan, setpoint={"kitchen": 20.0})
    assert {str(w.message) for w in told if "leaves out" in str(w.message)} == {
        "setpoint leaves out zone 'study', so that its plant is off and 'Q_hvac_study' of future not read; give the "
        "zone None to have it read."
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error", PlanWarning)
        bare = plan.drop(columns="Q_hvac_study")
        pd.testing.assert_frame_equal(building.forecast(None, bare, setpoint={"kitchen": 20.0}), free)
        kept = building.forecast(None, plan, setpoint={"kitchen": 20.0, "study": None})
    assert (kept["T_za_study"] > free["T_za_study"]).any()


def test_set_points_in_a_frame_go_by_the_columns_of_the_zones(building, tomorrow):
    """``T_heat_set_hall`` and ``T_heat_set_study`` were read as the heating and the cooling set-point of all zones."""
    rows = tomorrow.drop(columns=[name for name in tomorrow if name.startswith("Q_hvac")])
    frame = pd.DataFrame({"T_heat_set_hall": 18.0, "T_heat_set_study": 21.0, "T_cool_set_study": 24.0}, rows.index)
    expected = building.forecast(None, rows, setpoint={"hall": (18.0, None), "study": (21.0, 24.0)})
    pd.testing.assert_frame_equal(building.forecast(None, rows, setpoint=frame), expected)
    loads = building.predict_load(rows, {"hall": (18.0, None), "study": (21.0, 24.0)})
    pd.testing.assert_frame_equal(building.predict_load(rows, frame), loads)
    for wrong, match in (
        (frame.rename(columns={"T_heat_set_hall": "T_heat_set_attic"}), "setpoint names 'attic', which is not a zone"),
        (frame.assign(hall=20.0), r"give T_heat_set_<zone> and T_cool_set_<zone> only, each once"),
    ):
        with pytest.raises(ValueError, match=match):
            building.forecast(None, rows, setpoint=wrong)


def test_a_back_test_refuses_zones_that_are_exchanged(building, later):
    y = later.filter(like="T_za_")
    for wrong in (y.to_numpy()[:, ::-1], y.set_axis(y.columns[::-1], axis=1)):
        with pytest.raises(ValueError, match="is what X has measured in"):
            backtest(building, later, wrong)


@pytest.mark.parametrize("column", ["T_oa", "T_za_hall"])
def test_a_column_that_comes_twice_is_named(building, later, column):
    X = pd.concat([later, later[[column]]], axis=1)
    for call in (
        lambda: BuildingPredictor().fit(X, later.filter(like="T_za_")),
        lambda: building.predict(X),
        lambda: building.predict_load(X, 21.0),
        lambda: copy.deepcopy(building).update(X),
    ):
        with pytest.raises(ValueError, match=f"^column '{column}' appears twice in X; keep one of them"):
            call()


def test_a_failed_update_changes_nothing(building, later):
    model = copy.deepcopy(building)
    before = model.predict(later[:30])
    for rows in (later[5:40], later[:40].assign(T_za_study=1e30), later[:40].drop(columns="T_oa")):
        with pytest.raises(ValueError):
            model.update(rows)
        pd.testing.assert_frame_equal(model.predict(later[:30]), before)


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_what_is_warned_of_several_zones_is_told_once(rooms, n_jobs):
    """At the line of the user, with the zones' names, and of the third zone, whose heat is measured, not at all.

    Workers do not know who receives the warnings, be they threads or processes.
    """
    X = rooms[0][:N_TRAIN].copy()
    for zone in ZONES[:2]:
        X[f"u_heat_{zone}"] = X.pop(f"Q_hvac_{zone}").clip(lower=0.0) / 6.0
    model = by_themselves().set_params(n_jobs=n_jobs)
    for learn in (model.fit, model.partial_fit):
        with pytest.warns(ScaleNotIdentifiableWarning) as caught, parallel_config(backend="threading"):
            learn(X, rooms[1][:N_TRAIN])
        (found,) = [w for w in caught if w.category is ScaleNotIdentifiableWarning]
        assert str(found.message).startswith(f"zones {ZONES[0]!r}, {ZONES[1]!r}: InputDisturbanceID: the scale")
        assert found.filename == __file__


def test_errors_and_warnings_name_the_zone(building, later, tomorrow):
    with pytest.raises(ValueError, match=r"zone 'hall': column 'Q_hvac_hall' is empty"):
        building.forecast(None, tomorrow.assign(Q_hvac_hall=np.nan))
    with pytest.raises(ValueError, match=r"zone 'study': .*T_za_study"):
        copy.deepcopy(building).update(later[:5].assign(T_za_study=1e30))
    in_watts = tomorrow.assign(q_sol=400.0)
    for call in (lambda: building.forecast(None, in_watts), lambda: building.predict(later.assign(q_sol=400.0))):
        with pytest.warns(UnitWarning) as given:
            call()
        (said,) = [str(one.message) for one in given if issubclass(one.category, UnitWarning)]
        assert said.startswith(f"zones {', '.join(map(repr, ZONES))}: ")
    meters = [f"Q_hvac_{zone}" for zone in ZONES]
    plan, measured = (rows.assign(**{name: 1000.0 * rows[name] for name in meters}) for rows in (tomorrow, later[:DAY]))
    for call in (lambda: building.forecast(None, plan), lambda: copy.deepcopy(building).update(measured)):
        with pytest.warns(UnitWarning, match="in training from .*: likely W rather than kW") as given:
            call()
        messages = [str(one.message) for one in given if issubclass(one.category, UnitWarning)]
        assert {text.partition(":")[0] for text in messages} == {f"zone '{zone}'" for zone in ZONES}


def test_what_is_known_and_learned_of_each_zone(building, rooms, later):
    assert building.known_until_ == rooms[0].index[N_TRAIN - 1]
    model = copy.deepcopy(building).update(later[:3])
    assert model.known_until_ == later.index[2]
    assert model.thermostat_learned_ == dict.fromkeys(ZONES, False)
    X = rooms[0].assign(T_heat_set_hall=rooms[0]["T_za_hall"].round())
    model = BuildingPredictor(HybridPredictor(intervals=False, network="1R1C"), adjacency=[])
    model.fit(X[:N_TRAIN], rooms[1][:N_TRAIN])
    assert model.thermostat_learned_ == {"kitchen": False, "hall": True, "study": False}
    found = model.forecast(None, later[:DAY], setpoint=(20.0, 26.0), quantiles=[0.1, 0.9])
    bands = [f"{name}_hall" for name in ("q_0.1", "q_0.9", "Q_hvac_0.1", "Q_hvac_0.9")]
    assert [name for name in found if "0." in name] == bands  # the others have none, and take none from it


def test_quantiles_of_a_load_stay_within_the_plant():
    house = make_house(15, 2, sampling_time="1h", random_state=3)
    X, y = house.X.assign(T_heat_set=20.0), house.X[["T_za_living", "T_za_kitchen"]]
    model = BuildingPredictor(HybridPredictor(network="1R1C", known={"Q_h": 3.0}), adjacency=[("living", "kitchen")])
    model.fit(X[:N_TRAIN], y[:N_TRAIN])
    ahead = X[N_TRAIN:].drop(columns=[*y])
    found = model.forecast(None, ahead, setpoint=(21.0, None), quantiles=(0.01, 0.1, 0.9, 0.99))
    for zone in ("living", "kitchen"):
        assert model.shares_.loc[zone].min() > 0.1  # the neighbour counts
        loads = found[[f"Q_hvac{of}_{zone}" for of in ("_0.01", "_0.1", "", "_0.9", "_0.99")]].to_numpy()
        assert loads.min() >= 0.0  # a heater does not cool
        assert loads.max() <= 3.0 + 1e-9
        assert (np.diff(loads[:, [0, 1, 3, 4]], axis=1) >= 0.0).all()


def test_each_zone_may_have_a_capacity_of_its_own():
    """A capacity was that of all zones, and one of a single zone was refused."""
    house = make_house(12, 2, sampling_time="1h", random_state=3)
    X, y = house.X[: 10 * DAY], house.X[["T_za_living", "T_za_kitchen"]][: 10 * DAY]
    given = {"Q_h": 2.0, "Q_h_living": 3.0}
    template = HybridPredictor(network="1R1C", known=given, intervals=False)
    model = BuildingPredictor(template, adjacency=[("living", "kitchen")]).fit(X, y)
    for zone, known in (("living", {"Q_h": 3.0}), ("kitchen", {"Q_h": 2.0})):
        own = X[["T_oa", f"q_sol_{zone}"]].assign(u_heat=X[f"u_heat_{zone}"], T_za=y[f"T_za_{zone}"])
        alone = clone(template).set_params(known=known).fit(own, own["T_za"])
        np.testing.assert_allclose(model.own_[zone].predict(X[-DAY:]), alone.predict(own[-DAY:]))
        assert model.own_[zone].known == model.coupled_[zone].model.known == known
    with pytest.raises(ValueError, match="zone 'living': known= names 'Q_h_attic', but the capacities are"):
        clone(model).set_params(estimator__known={"Q_h_attic": 1.0}).fit(X, y)


@pytest.mark.slow
def test_new_rows_are_learned_by_each_zone(rooms, later, tomorrow):
    """The predictors learn as they do by themselves, whether the rows were taken in before or not."""
    X, y = rooms
    model = BuildingPredictor(HybridPredictor(intervals=False, network="1R1C"), adjacency=DOORS)
    first, both = 10 * DAY, slice(10 * DAY, N_TRAIN)
    model.partial_fit(X[:first], y[:first])
    alone, shares = copy.deepcopy(model.own_["hall"]), model.shares_
    updated = copy.deepcopy(model).update(X[both][: 2 * DAY]).partial_fit(X[both], y[both])
    model.partial_fit(X[both], y[both])
    assert model.known_until_ == updated.known_until_ == X.index[N_TRAIN - 1]
    learned = model.forecast(None, tomorrow)
    np.testing.assert_allclose(updated.forecast(None, tomorrow), learned, atol=1e-9)
    pd.testing.assert_frame_equal(model.shares_, shares)
    alone.partial_fit(X[both].drop(columns=[c for c in X if c.startswith("T_next")]), y["hall"][both])
    found = model.without_neighbours().forecast(None, tomorrow)["T_za_hall"]
    np.testing.assert_array_equal(found, alone.forecast(None, tomorrow)["T_za"])
    before = model.forecast(None, tomorrow)
    with pytest.raises(ValueError, match=r"zone 'kitchen': X begins at"):
        model.partial_fit(later[5:40], y[N_TRAIN:][5:40])
    with pytest.raises(ValueError, match=r"zone 'study': Input y contains NaN"):
        model.partial_fit(later[:40], y[N_TRAIN:][:40].assign(study=np.nan))
    pd.testing.assert_frame_equal(model.forecast(None, tomorrow), before)


def test_one_zone_of_an_array(rooms):
    X, y = rooms
    frame = X[["T_oa", "q_sol"]].assign(Q_hvac=X["Q_hvac_hall"], T_za=X["T_za_hall"])
    model = BuildingPredictor(HybridPredictor(intervals=False)).fit(frame[:200], y["hall"][:200])
    alone = HybridPredictor(intervals=False).fit(frame[:200], y["hall"][:200])
    np.testing.assert_array_equal(model.predict(frame[200:248]), alone.predict(frame[200:248]))
    with pytest.raises(ValueError, match="y has 3 columns, but HybridPredictor forecasts one zone"):
        HybridPredictor().fit(X, y)


def test_a_saved_building_forecasts_the_same(building, tomorrow, tmp_path):
    save_model(building, tmp_path / "building.skops")
    pd.testing.assert_frame_equal(
        load_model(tmp_path / "building.skops").forecast(None, tomorrow), building.forecast(None, tomorrow)
    )
    assert (tmp_path / "building.skops").stat().st_size < 1e6 * len(building.own_ | building.coupled_) * 2


def test_summary_and_drift_tell_the_zones(building, later):
    shown = io.StringIO()
    print(building.summary(), file=shown)
    assert "kitchen" in shown.getvalue()
    assert set(building.drift(later).index.get_level_values("zone")) == set(ZONES)
    assert 0.5 < building.score(later, make_rooms()[1][N_TRAIN:]) <= 1.0


def test_measured_temperatures_go_by_the_zones_names(two_stages, rooms, later):
    X, y = later[:48], rooms[1][N_TRAIN:][:48]
    assert two_stages.score(X, y[["study", "kitchen", "hall"]]) == two_stages.score(X, y)
    for given, message in (
        (y.rename(columns={"hall": "attic"}), "y has the columns 'kitchen', 'attic', 'study'"),
        (y[["hall", "study"]], "y has the columns 'hall', 'study'"),
    ):
        for call in (two_stages.partial_fit, two_stages.update, two_stages.score):
            with pytest.raises(ValueError, match=message):
                call(X, given)
    for rows, column in ((X.drop(columns=T_OF), "T_za_kitchen"), (X.drop(columns="T_za_hall"), "T_za_hall")):
        with pytest.raises(ValueError, match=f"X has no column '{column}'"):
            two_stages.update(rows)


def test_zones_of_an_array(rooms):
    X, y = rooms[0][["T_oa", "q_sol"]].to_numpy(), rooms[1].to_numpy()
    model = by_themselves(sampling_time="1h", intervals=False).fit(X[:200], y[:200])
    with pytest.raises(ValueError, match="X has no column 'T_za_zone_0'"):
        model.update(X[200:224])
    assert model.update(X[200:224], y[200:224]).predict(X[224:248]).shape == (24, 3)


def test_new_rows_do_not_change_the_shape_of_a_forecast(rooms):
    X, y = rooms[0][["T_oa", "q_sol"]], rooms[1][["hall"]]
    model = by_themselves(intervals=False).fit(X[:200], y[:200])
    assert isinstance(model.update(X[200:224], y["hall"][200:224]).predict(X[224:248]), pd.DataFrame)


def test_limits_that_zones_share_hold_a_plant_that_is_off(building, later):
    rows, wanted = later[:DAY], (20.5, None)
    for limits in ((0.5, 3.0), (-3.0, -0.5)):
        with pytest.raises(ValueError, match="limits of all zones together must have 0 kW"):
            building.predict_load(rows, wanted, limits)
    with pytest.raises(ValueError, match="the upper limit has shape"):
        building.predict_load(rows, wanted, (0.0, np.ones(5)))
    with pytest.raises(ValueError, match="zone 'kitchen': setpoint"):
        building.predict_load(rows, None)


@pytest.mark.parametrize("call", ["predict_load", "forecast"])
def test_limits_that_may_be_watts_are_warned_of_once_for_all_zones(two_stages, later, tomorrow, call):
    rows = (later[:DAY],) if call == "predict_load" else (None, tomorrow)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", UnitWarning)
        getattr(two_stages, call)(*rows, setpoint=(20.5, None), limits=(0.0, 6000.0))
    (said,) = [str(w.message) for w in told if issubclass(w.category, UnitWarning)]
    assert "the upper limit is 6000: likely W" in said


def test_a_zone_without_limits_loads_as_if_none_had_any(two_stages, later):
    """A plant that never cooled in training does not, whatever the limits of other zones."""
    rows, wanted = later[:DAY], (10.0, 15.0)
    free = two_stages.predict_load(rows, wanted)
    limited = two_stages.predict_load(rows, wanted, {"kitchen": (0.0, 0.1)})
    np.testing.assert_array_equal(limited["Q_hvac_hall"], free["Q_hvac_hall"])


def test_samples_do_not_depend_on_the_time_zone_of_the_rows_ahead(rooms):
    X, y = (part.tz_localize("America/Chicago") for part in rooms)
    ahead = X[N_TRAIN : N_TRAIN + DAY].drop(columns=T_OF)
    model = by_themselves().fit(X[:N_TRAIN], y[:N_TRAIN])
    drawn = [model.sample(None, rows, 20, random_state=0) for rows in (ahead, ahead.tz_convert("UTC"))]
    np.testing.assert_array_equal(*drawn)


def test_errors_that_are_unknown_order_no_samples(two_stages):
    assert np.isfinite(two_stages._joint.values).all()


def test_the_drift_report_reads_rows_as_a_forecast_does(rooms, later):
    X = rooms[0].copy()
    X.iloc[100:103, X.columns.get_loc("T_oa")] = np.nan
    model = by_themselves(preprocess=GapFiller("6h"), intervals=False).fit(X[:N_TRAIN], rooms[1][:N_TRAIN])
    holed = later.copy()
    holed.iloc[30:32, holed.columns.get_loc("T_oa")] = np.nan
    assert set(model.drift(holed).index.get_level_values("zone")) == set(ZONES)


def test_measured_temperatures_of_other_names_stay_missing_in_a_preprocess(rooms, later):
    columns = {f"T_za_{zone}": f"{zone} [degC]" for zone in ZONES}
    X, rows = rooms[0].rename(columns=columns), later.rename(columns=columns)
    model = by_themselves(preprocess=GapFiller("6h"), columns=columns, intervals=False)
    model.fit(X[:N_TRAIN], rooms[1][:N_TRAIN])
    rows.iloc[2:4, rows.columns.get_loc("hall [degC]")] = np.nan
    model.update(rows[:DAY])
    assert np.isnan(model.own_["hall"]._scheme.rows.latest.history["T_za"][2:4]).all()
    assert np.isfinite(model.forecast(None, rows[DAY : 2 * DAY].drop(columns=columns.values()))).all(axis=None)


def test_a_plant_of_its_own_beside_a_shared_one(rooms):
    X = rooms[0].assign(Q_hvac=0.3 * rooms[0]["Q_hvac_hall"].to_numpy()[::-1])
    columns = ZoneColumns.of(X, ZONES, None)
    assert columns.input_of("Q_hvac_hall") == [("hall", "Q_hvac_hall")]
    assert columns.input_of("Q_hvac") == [(zone, "Q_hvac") for zone in ZONES]
    model = by_themselves(intervals=False).fit(X[:N_TRAIN], rooms[1][:N_TRAIN])
    tomorrow = X[N_TRAIN : N_TRAIN + DAY].drop(columns=T_OF)
    found = model.affine_forecast(None, tomorrow, ["Q_hvac_hall"])
    more = tomorrow.assign(Q_hvac_hall=tomorrow["Q_hvac_hall"] + 0.1)
    T = found.temperature(more[["Q_hvac_hall"]].to_numpy())
    np.testing.assert_allclose(T, temperatures(model.forecast(None, more)), atol=1e-9)


def test_set_points_of_a_zone_hold_in_place_of_shared_ones(rooms):
    X = rooms[0].assign(T_heat_set=19.0, T_heat_set_hall=21.0)
    columns = ZoneColumns.of(X, ZONES, None)
    assert columns.of_zone("hall")["T_heat_set"] == "T_heat_set_hall"
    assert columns.of_zone("study")["T_heat_set"] == "T_heat_set"
    model = by_themselves(intervals=False).fit(X[: 6 * DAY], rooms[1][: 6 * DAY])
    held = {zone: one._scheme.rows.training.history["T_heat_set"][0] for zone, one in model.own_.items()}
    assert held == {"kitchen": 19.0, "hall": 21.0, "study": 19.0}


def test_tables_of_other_libraries_are_read_by_name(two_stages, rooms, later):
    pa = pytest.importorskip("pyarrow")
    X, y = rooms[0][:N_TRAIN], rooms[1][:N_TRAIN]
    turned = pa.table(y[[*ZONES[::-1]]])
    model = by_themselves().fit(pa.table(X), turned)
    assert set(model.zones_) == set(ZONES)
    pd.testing.assert_frame_equal(
        model.predict(pa.table(later))[[*ZONES]], two_stages.predict(later), check_freq=False, rtol=1e-9
    )
    model.update(pa.table(later[:DAY].drop(columns=T_OF)), pa.table(rooms[1][N_TRAIN:][:DAY]))
    assert model.known_until_ == copy.deepcopy(two_stages).update(later[:DAY]).known_until_


def test_rows_with_a_time_zone_do_not_follow_a_training_without_one(two_stages, rooms, later):
    abroad, y = later.tz_localize("UTC"), rooms[1][N_TRAIN:].tz_localize("UTC")
    day, model = abroad[:DAY], copy.deepcopy(two_stages)
    calls = [
        lambda: model.predict(day),
        lambda: model.predict_from(day, [3]),
        lambda: model.score(day, y[:DAY]),
        lambda: model.forecast(None, day),
        lambda: model.predict_load(day, 21.0),
        lambda: model.update(day),
        lambda: model.partial_fit(day, y[:DAY]),
        lambda: model.drift(abroad),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="the training table has the time zone None, X UTC; localize the one"):
            call()
