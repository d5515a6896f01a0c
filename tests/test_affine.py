"""Forecasts for optimisers: exact, fast to renew, and what they refuse."""

from __future__ import annotations

import warnings
from copy import copy, deepcopy
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError

from skhybrid import (
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid._calendar import day_type_hour
from skhybrid._table import read_table
from skhybrid.control import LinearNetwork, heat_plan
from skhybrid.datasets import make_office
from skhybrid.exceptions import PlanWarning
from skhybrid.forecasting.quantiles import path_clock
from skhybrid.hybrid import ControlModel
from skhybrid.hybrid.affine_frames import recent_offsets
from skhybrid.hybrid.blending.rolling_blend import RollingBlend
from skhybrid.hybrid.schedule_scheme import ScheduleScheme
from skhybrid.hybrid.scheme import RecentErrors
from skhybrid.identification import StateSpace

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")

DAY = 48  # rows, at 30 min
N_TRAIN, NOW = 10 * DAY, 11 * DAY + 5
QUICK = {"n_starts": 1, "random_state": 0}
KNOWN = {"Q_h": 6.0}


def test_a_plan_of_a_table_whose_columns_have_numbers_for_names():
    future = pd.DataFrame({0: [1.0, 2.0]})
    filled, given = heat_plan.planned(future, ("u_heat", "u_cool"), {"u_heat": 0, "u_cool": 1}.__getitem__)
    assert filled.to_dict("list") == {0: [1.0, 2.0], 1: [0.0, 0.0]}
    assert given == ["u_heat"]
    assert list(future) == [0]
    for q in ([1.0], [1.0, 2.0, 3.0], [[1.0, 2.0]]):
        with pytest.raises(ValueError, match=r"the plan has shape .*, but there are 2 rows from 0 to 1 and 1 input;"):
            heat_plan.as_plan(q, ("u_heat",), future.index)
    assert heat_plan.as_plan([1.0, 2.0], ("u_heat",), future.index).tolist() == [[1.0], [2.0]]


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=14, sampling_time="30min", random_state=4)


@pytest.fixture(scope="module")
def tables(office):
    """The same rows with stages, and with the heat measured as one column or as two."""
    stages = office.X
    rest = stages.drop(columns=["u_heat", "u_cool"])
    Q_h, Q_c = 6.0 * stages["u_heat"], -5.0 * stages["u_cool"]
    return {
        "stages": stages,
        "heat": rest.assign(Q_hvac=Q_h + Q_c),
        "two": rest.assign(Q_h=Q_h, Q_c=Q_c),
    }


def _two_stage(gray_box, forecaster=None, **settings):
    return TwoStagePredictor(gray_box, forecaster or DisturbanceForecaster("profile"), random_state=0, **settings)


#: name -> estimator, its table, inputs of a plan
CASES = {
    "schedule": (lambda: SchedulePredictor(), "heat", ("Q_hvac",)),
    "schedule, two heats": (lambda: HybridPredictor(), "two", ("Q_c", "Q_h")),
    "schedule, some": (lambda: HybridPredictor(adapt="linear"), "two", ("Q_h",)),
    "two-stage": (lambda: _two_stage(InputDisturbanceID(known=KNOWN, **QUICK)), "stages", ("u_heat", "u_cool")),
    "two-stage, output": (lambda: _two_stage(OutputDisturbanceID(**QUICK), disturbance="output"), "heat", ("Q_hvac",)),
    "conventional": (lambda: GrayBoxRC(**QUICK), "two", ("Q_h", "Q_c")),
    "input": (lambda: InputDisturbanceID(known=KNOWN, **QUICK), "stages", ("u_cool",)),
    "output": (lambda: OutputDisturbanceID(**QUICK), "heat", ("Q_hvac",)),
    "periodic": (lambda: PeriodicDisturbanceID(known=KNOWN, **QUICK), "stages", ("u_heat", "u_cool")),
}


@pytest.fixture(scope="module")
def fitted(tables, office):
    made = {}

    def get(name):
        if name not in made:
            make, table, _ = CASES[name]
            made[name] = make().fit(tables[table][:N_TRAIN], office.y[:N_TRAIN])
        return deepcopy(made[name])

    return get


@pytest.fixture(scope="module")
def bent(tables, office):
    """A default whose stage of known capacity has a part-load curve, after an update."""
    model = HybridPredictor(known=KNOWN).fit(tables["stages"][:N_TRAIN], office.y[:N_TRAIN])
    return model.update(tables["stages"][N_TRAIN:NOW])


def _rows(tables, name):
    X = tables[CASES[name][1]]
    return X, X[NOW : NOW + DAY].drop(columns="T_za"), float(X["T_za"].iloc[NOW])


def _plans(X, future, inputs, n=2):
    """Random plans within the range of training."""
    rng, names = np.random.default_rng(0), list(inputs)
    ends = X[names][:N_TRAIN].to_numpy()
    for _ in range(n):
        q = rng.uniform(ends.min(axis=0), ends.max(axis=0), (len(future), len(names)))
        yield q, future.assign(**dict(zip(names, q.T, strict=True)))


# ---------------------------------------------------------------------------------------------------------- exactness
@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_the_forecast_is_affine_in_the_plan(name, known, measured, fitted, tables):
    """From known rows or a history, with and without the present temperature; the blend and the network."""
    model, (X, future, T), inputs = fitted(name), _rows(tables, name), CASES[name][2]
    history, now = None if known else X[N_TRAIN:NOW], T if measured else None
    if known:
        model.update(X[N_TRAIN:NOW])
    found = model.affine_forecast(history, future.drop(columns=list(inputs)), inputs, T_za=now)
    assert found.gain.shape == (DAY, DAY, len(inputs))
    assert found.inputs == inputs
    assert found.index.equals(future.index)
    assert not np.triu(np.moveaxis(found.gain, 2, 0)).any()
    network = model.affine_forecast(history, future, inputs, T_za=now, member="network")
    for q, planned in _plans(X, future, inputs):
        forecast = model.forecast(history, planned, T_za=now)
        np.testing.assert_allclose(found.temperature(q), forecast["T_za"], rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.zeta, forecast["zeta"], rtol=0, atol=1e-9)
        space = model.to_state_space(history, planned, T_za=now)
        path = space.simulate(planned[list(space.inputs)].to_numpy())
        np.testing.assert_allclose(path[:-1, 0], network.temperature(q), rtol=0, atol=1e-9)
    if now is not None:
        assert forecast["T_za"].iloc[0] == now == space.C[0] @ space.x0


def test_the_state_space_is_plain_arrays(fitted, tables):
    X, future, T = _rows(tables, "two-stage")
    space = fitted("two-stage").update(X[N_TRAIN:NOW]).to_state_space(None, future, T_za=T)
    n, m = space.B.shape
    assert (space.A.shape, space.C.shape, space.x0.shape, space.forcing.shape) == ((n, n), (1, n), (n,), (DAY, n))
    assert all(type(a) is np.ndarray and a.dtype == np.float64 for a in (space.A, space.B, space.C, space.limits))
    assert set(space.inputs) == {"u_heat", "u_cool"}
    np.testing.assert_array_equal(space.limits, [[0.0, 1.0]] * m)
    assert len(space.states) == n
    assert np.abs(np.linalg.eigvals(space.A)).max() < 1.0


def test_what_an_optimiser_gets_is_shown_in_a_line(fitted, tables):
    X, future, T = _rows(tables, "two-stage")
    model = fitted("two-stage").update(X[N_TRAIN:NOW])
    rows = f"{DAY} rows from {future.index[0]} to {future.index[-1]}, inputs=('u_heat', 'u_cool')"
    ahead, space = (make(None, future, T_za=T) for make in (model.affine_forecast, model.to_state_space))
    assert (repr(ahead), repr(space)) == (f"AffineForecast({rows})", f"ControlModel({rows})")
    assert ahead == ahead
    assert ahead != model.affine_forecast(None, future, T_za=T)  # arrays would be asked whether they are true


def test_measured_heat_is_limited_by_what_training_covered(fitted, tables):
    X, future, _ = _rows(tables, "schedule")
    space = fitted("schedule").to_state_space(X[N_TRAIN:NOW], future)
    heat = X["Q_hvac"][:N_TRAIN]
    np.testing.assert_allclose(space.limits, [[heat.min(), heat.max()]])


def test_a_bend_gives_the_tangent_and_says_so(bent, tables):
    """Exact between the knots of the part-load curve, and at the plan for the state space."""
    X = tables["stages"]
    future = X[NOW : NOW + DAY].drop(columns="T_za").assign(u_heat=0.3)
    with pytest.warns(PlanWarning, match="u_heat bends"):
        found = bent.affine_forecast(None, future, ("u_heat", "u_cool"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", PlanWarning)
        copy(bent).update(X[NOW : NOW + 1]).affine_forecast(None, future[1:], ("u_heat",))  # a controller's next step
    for stage in (0.21, 0.3, 0.44):  # knots are at 0.2 and 0.45
        planned = future.assign(u_heat=stage)
        T = bent.forecast(None, planned)["T_za"]
        np.testing.assert_allclose(found.temperature(planned[["u_heat", "u_cool"]]), T, rtol=0, atol=1e-9)
    beyond = future.assign(u_heat=0.9)
    off = found.temperature(beyond[["u_heat", "u_cool"]]) - bent.forecast(None, beyond)["T_za"]
    assert np.abs(off).max() > 1e-3
    network = bent.affine_forecast(None, future, ("u_heat",), member="network")
    space = bent.to_state_space(None, future)
    path = space.simulate(future[list(space.inputs)].to_numpy())[:-1, 0]
    np.testing.assert_allclose(path, network.temperature(future["u_heat"]), rtol=0, atol=1e-9)


def test_a_state_space_says_that_a_stage_bends(bent, tables):
    future = tables["stages"][NOW : NOW + DAY].drop(columns=["T_za", "u_heat", "u_cool"])
    with pytest.warns(PlanWarning, match="u_heat bends"):
        deepcopy(bent).to_state_space(None, future)


def test_a_plan_of_pandas_goes_by_its_names_and_stamps(fitted, tables):
    X, future, _ = _rows(tables, "two-stage")
    model = fitted("two-stage")
    space = model.to_state_space(X[N_TRAIN:NOW], future)
    found = model.affine_forecast(X[N_TRAIN:NOW], future, ("u_heat", "u_cool"))
    plan = pd.DataFrame({"u_cool": 0.1, "u_heat": 0.8}, future.index)
    for respond, inputs in ((found.temperature, found.inputs), (space.simulate, space.inputs)):
        np.testing.assert_array_equal(respond(plan), respond(plan[list(inputs)].to_numpy()))
        with pytest.raises(ValueError, match="the plan has other time stamps than future"):
            respond(plan.shift(freq="30min"))
        with pytest.raises(ValueError, match="the plan has the columns 'cool', 'heat'; give it those of the inputs"):
            respond(plan.set_axis(["cool", "heat"], axis=1))  # by place they would be exchanged
        on = plan > 0.5
        np.testing.assert_array_equal(respond(on), respond(on.astype(float)))
        for hole in (np.nan, np.inf):  # all rows were NaN, also those before
            with pytest.raises(ValueError, match=f"the plan contains NaN or inf .first at {future.index[3]}"):
                respond(plan.assign(u_heat=np.where(np.arange(len(plan)) < 3, 0.8, hole)))
        with pytest.raises(ValueError, match="the plan is None; look at the status of the solver"):
            respond(None)
        with pytest.raises(ValueError, match="the plan is not numeric"):
            respond(plan.assign(u_heat="off"))


@pytest.mark.parametrize("name", ["two-stage", "conventional", "input", "periodic"])
def test_inputs_have_the_order_of_the_training_table(name, fitted, tables):
    """A controller that takes heating for the first column would cool with a model that sorts them by name."""
    X, future, _ = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    heating, cooling = expected = ("Q_h", "Q_c") if name == "conventional" else ("u_heat", "u_cool")
    found = model.affine_forecast(None, future.drop(columns=[heating, cooling]))
    assert found.inputs == model.to_state_space(None, future).inputs == expected
    assert found.gain[1, 0, 0] > 0


def test_the_tangent_at_full_stage_is_that_of_smaller_stages(bent, tables):
    future = tables["stages"][NOW : NOW + DAY].drop(columns="T_za").assign(u_heat=1.0, u_cool=1.0)
    with pytest.warns(PlanWarning, match="u_heat bends"):
        found = deepcopy(bent).affine_forecast(None, future, ("u_heat",))
    less = future.assign(u_heat=0.9)
    T = bent.forecast(None, less)["T_za"]
    np.testing.assert_allclose(found.temperature(less["u_heat"]), T, rtol=0, atol=1e-9)


def test_a_forecast_that_would_be_clipped_is_not(fitted, tables):
    X, future, _ = _rows(tables, "schedule")
    model = fitted("schedule").update(X[N_TRAIN:NOW])
    q = np.full(DAY, 20.0)
    affine, clipped = (
        model.affine_forecast(None, future).temperature(q),
        model.forecast(None, future.assign(Q_hvac=q))["T_za"],
    )
    assert affine[-1] > clipped.iloc[-1] + 1.0
    np.testing.assert_allclose(affine[:2], clipped[:2], rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------------------------- measured at present
@pytest.mark.parametrize("name", ["schedule", "two-stage", "two-stage, output", "input", "conventional"])
def test_the_present_temperature_is_not_added_to_the_history(name, fitted, tables):
    X, future, T = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    before = model.forecast(None, future)
    found = model.forecast(None, future, T_za=T)
    pd.testing.assert_frame_equal(model.forecast(None, future), before)
    later = deepcopy(model).update(X[NOW : NOW + 1])
    tolerance = {"rtol": 0, "atol": 1e-9}
    np.testing.assert_allclose(found.iloc[1:], later.forecast(None, future.iloc[1:]), **tolerance)
    model.forecast(None, future, T_za=T + 3.0)  # a wrong one leaves no trace
    now = model.update(X[NOW : NOW + 1])
    np.testing.assert_allclose(now.forecast(None, future.iloc[1:]), later.forecast(None, future.iloc[1:]), **tolerance)


@pytest.mark.parametrize("name", ["schedule", "two-stage", "input"])
def test_one_row_ahead(name, fitted, tables):
    X, future, T = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    assert model.forecast(None, future[:1], T_za=T)["T_za"].to_list() == [T]
    found = model.affine_forecast(None, future[:1], CASES[name][2], T_za=T)
    np.testing.assert_allclose(found.temperature(np.ones(len(CASES[name][2]))[None]), [T], rtol=0, atol=1e-12)
    assert model.to_state_space(None, future[:1], T_za=T).forcing.shape[0] == 1


@pytest.mark.parametrize("name", ["schedule", "two-stage"])
def test_a_thermostat_begins_at_the_present_temperature(name, tables, fitted):
    X, future, T = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    found = model.forecast(None, future, T_za=T, setpoint=(20.0, 24.0))
    assert found["T_za"].iloc[0] == T
    later = model.update(X[NOW : NOW + 1]).forecast(None, future.iloc[1:], setpoint=(20.0, 24.0))
    assert len(found) == len(later) + 1


# -------------------------------------------------------------------------------------------------------- quantiles
def test_offsets_are_near_those_of_the_forecast(fitted, tables):
    """They come from recorded errors, so that they take milliseconds."""
    X, future, T = _rows(tables, "schedule")
    model, levels = fitted("schedule").update(X[N_TRAIN:NOW]), (0.1, 0.5, 0.9)
    found = model.affine_forecast(None, future, T_za=T, quantiles=levels)
    forecast = model.forecast(None, future, T_za=T, quantiles=levels)
    beyond = forecast.filter(like="q_").to_numpy() - forecast["T_za"].to_numpy()[:, None]
    assert found.offsets.shape == (DAY, 3)
    assert not found.offsets[0].any()
    assert (np.diff(found.offsets[1:], axis=1) > 0).all()
    assert np.abs(found.offsets - beyond).mean() < 0.35 * np.ptp(beyond[1:], axis=1).mean()
    frozen = model.set_params(adapt=None)  # records nothing
    offsets = frozen.affine_forecast(None, future, T_za=T, quantiles=levels).offsets
    forecast = frozen.forecast(None, future, T_za=T, quantiles=levels)
    beyond = forecast.filter(like="q_").to_numpy() - forecast["T_za"].to_numpy()[:, None]
    np.testing.assert_allclose(offsets, beyond, rtol=0, atol=1e-9)
    model, first = fitted("schedule"), X[N_TRAIN : N_TRAIN + DAY].drop(columns="T_za")  # no error is known yet
    forecast = model.forecast(None, first, quantiles=levels)
    beyond = forecast.filter(like="q_").to_numpy() - forecast["T_za"].to_numpy()[:, None]
    np.testing.assert_allclose(model.affine_forecast(None, first, quantiles=levels).offsets, beyond, atol=1e-9)


def test_recorded_errors_count_by_the_hour_at_which_they_ended(office):
    table = read_table(HybridPredictor(), office.X[: 5 * DAY], reset=True)
    leads, back, origin = np.array([1, 7, 30]), np.array([DAY, 2 * DAY + 5]), 4 * DAY + 9
    recent, met = RecentErrors(np.zeros((2, 3)), back, leads), []
    intervals = SimpleNamespace(factor_at=lambda errors, share: met.append(errors[1]), offsets=lambda *_: "offsets")
    clock = path_clock(table, np.array([origin]), table.n_rows - 1 - origin)
    assert recent_offsets(intervals, clock, table, recent, np.array([0.5])) == "offsets"
    np.testing.assert_array_equal(met[0].slot, day_type_hour(table)[origin + leads - back[:, None]])


def test_offsets_under_a_weather_forecast_are_wider_as_those_of_a_forecast(fitted, tables):
    """By an independent error: the squares of what is beyond the median add up."""
    X, future, T = _rows(tables, "schedule")
    model, levels = fitted("schedule").update(X[N_TRAIN:NOW]), (0.1, 0.5, 0.9)
    plain, wider = (
        model.affine_forecast(None, future, T_za=T, quantiles=levels, weather_error=error).offsets
        for error in (None, "high")
    )
    forecast, under = (
        model.forecast(None, future, T_za=T, quantiles=levels, weather_error=error) for error in (None, "high")
    )
    assert (np.ptp(wider, axis=1)[2:] > np.ptp(plain, axis=1)[2:]).all()  # the weather of now is known
    beyond, own = (
        np.diff((frame.filter(like="q_").to_numpy() - frame[["T_za"]].to_numpy())[1:], axis=1) ** 2
        for frame in (forecast, under)
    )
    np.testing.assert_allclose(
        np.diff(wider[1:], axis=1) ** 2 - np.diff(plain[1:], axis=1) ** 2, own - beyond, atol=1e-9
    )
    with pytest.raises(ValueError, match="weather_error= widens quantiles"):
        model.affine_forecast(None, future, T_za=T, weather_error="high")


def test_offsets_from_a_history_and_of_two_stages(fitted, tables):
    X, future, T = _rows(tables, "two-stage")
    model, inputs = fitted("two-stage"), ("u_heat", "u_cool")
    for now, error in ((None, None), (T, None), (T, "low")):
        wanted = {"T_za": now, "quantiles": [0.1, 0.9], "weather_error": error}
        found = model.affine_forecast(X[N_TRAIN:NOW], future, inputs, **wanted)
        forecast = model.forecast(X[N_TRAIN:NOW], future, **wanted)
        beyond = forecast.filter(like="q_").to_numpy() - forecast["T_za"].to_numpy()[:, None]
        np.testing.assert_allclose(found.offsets, beyond, rtol=0, atol=1e-9)


# ----------------------------------------------------------------------------------------------------- running state
def test_copies_and_another_adapt_go_on_from_the_running_state(fitted, tables, monkeypatch):
    """Nothing goes through the training rows again."""
    X, future, _ = _rows(tables, "schedule")
    model = fitted("schedule").update(X[N_TRAIN:NOW])
    for adapt in ("linear", None, "full"):
        model.set_params(adapt=adapt).forecast(None, future)
    monkeypatch.setattr(ScheduleScheme, "_joined", lambda *given: pytest.fail("went through all rows again"))
    for made in (model, copy(model), deepcopy(model)):
        now = made.update(X[NOW : NOW + 1])
        for adapt in ("full", "linear", None):
            now.set_params(adapt=adapt).forecast(None, future.iloc[1:])


def test_what_follows_the_training_does_not_go_through_it_again(fitted, tables, monkeypatch):
    """Quantiles, back-tests, plans and loads after the first forecast."""
    X, future, _ = _rows(tables, "schedule")
    model = fitted("schedule").update(X[N_TRAIN:NOW])
    model.forecast(None, future)
    monkeypatch.setattr(ScheduleScheme, "_joined", lambda *given: pytest.fail("went through all rows again"))
    model.forecast(None, future, quantiles=[0.1, 0.9])
    model.predict_from(X[N_TRAIN:], [3, 5, DAY])
    model.predict_load(X[NOW:].drop(columns="Q_hvac"), 21.0)
    model.affine_forecast(X[N_TRAIN:NOW], future)


def test_intervals_of_later_days_go_on_from_some_weeks_back(monkeypatch):
    """The cost of a day does not grow with the days since the training."""
    office, day, n_train = make_office(n_days=36, sampling_time="1h", random_state=4), 24, 7 * 24
    X, rows = office.X.drop(columns="T_za"), []
    made = SchedulePredictor().fit(office.X[:n_train], office.y[:n_train])
    model, advance = deepcopy(made), RollingBlend.advance
    monkeypatch.setattr(
        RollingBlend, "advance", lambda self, views, row: (rows.append(row - self.row), advance(self, views, row))[1]
    )
    known, of_day = n_train, {}
    for n_days in (24, 25, 26):
        end = n_train + n_days * day
        model.update(office.X[known:end])
        found = model.forecast(None, X[end : end + day], quantiles=[0.1, 0.9])
        known, of_day[n_days], rows = end, max(rows), []
    assert of_day[24] > day
    assert of_day[25] == of_day[26] == day
    at_once = made.forecast(office.X[n_train:end], X[end : end + day], quantiles=[0.1, 0.9])
    pd.testing.assert_frame_equal(found, at_once, rtol=0, atol=1e-8)


def test_copies_do_not_change_each_other(fitted, tables):
    X, future, T = _rows(tables, "schedule")
    model = fitted("schedule").update(X[N_TRAIN:NOW])
    before = model.forecast(None, future)
    for other in (copy(model), deepcopy(model)):
        other.update(X[NOW : NOW + 3].assign(T_za=T + 5.0)).forecast(None, X[NOW + 3 : NOW + DAY])
    pd.testing.assert_frame_equal(model.forecast(None, future), before)
    along = fitted("schedule").forecast(X[N_TRAIN:NOW], future)
    np.testing.assert_allclose(before, along, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["conventional", "input", "periodic"])
def test_a_gray_box_follows_new_rows(name, fitted, tables):
    """Row by row and in blocks, with nothing measured for a while."""
    X, future, _ = _rows(tables, name)
    X = X.copy()
    X.iloc[N_TRAIN + 20 : N_TRAIN + 27, X.columns.get_loc("T_za")] = np.nan
    model, whole = fitted(name), fitted(name)
    for begin, end in ((0, 1), (1, 2), (2, 30), (30, NOW - N_TRAIN)):
        assert model.update(X[N_TRAIN + begin : N_TRAIN + end]) is model
    along = whole.forecast(X[N_TRAIN:NOW], future)
    np.testing.assert_allclose(model.forecast(None, future), along, rtol=0, atol=1e-8)
    np.testing.assert_allclose(model.predict(future.assign(T_za=np.nan)), along["T_za"], rtol=0, atol=1e-8)


def test_a_short_warm_up_is_the_same_after_the_training_and_in_a_history(tables):
    X, future = tables["stages"], tables["stages"][N_TRAIN : N_TRAIN + DAY]
    model = GrayBoxRC("3R3C", known=KNOWN, warmup="3h", **QUICK).fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    along = model.forecast(X[:N_TRAIN], future)
    np.testing.assert_allclose(model.forecast(None, future), along, rtol=0, atol=1e-8)


@pytest.mark.parametrize("share", [-0.3, 0.97])  # of what the predictor knew that a measured row leaves
@pytest.mark.parametrize("missing", [slice(N_TRAIN + 2, NOW), slice(N_TRAIN - DAY - 5, N_TRAIN)])
def test_an_output_disturbance_is_not_forgotten_in_an_outage(missing, share, tables, office):
    """Of more than a day, after the training or at its end; nor does a slow predictor forget what it knew."""
    X, future, _ = _rows(tables, "output")
    X = X.copy()
    X.iloc[missing, X.columns.get_loc("T_za")] = np.nan
    model = OutputDisturbanceID(known={"rho_1": 0.99, "rho_gap": share}, **QUICK).fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    along = model.forecast(X[:NOW], future)
    for begin in range(N_TRAIN, NOW):
        model.update(X[begin : begin + 1])
    np.testing.assert_allclose(model.forecast(None, future), along, rtol=0, atol=1e-8)


# ----------------------------------------------------------------------------------------------------------- refused
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"inputs": ("Q_x",)}, "'Q_x', which was not in the training table"),
        ({"inputs": ("u_heat",)}, "'u_heat', which was not in the training table; .* heating and cooling 'Q_hvac'"),
        ({"inputs": ("T_oa",)}, "'T_oa', which is neither heating nor cooling"),
        ({"inputs": ()}, r"inputs=\(\) must be a list of different names"),
        ({"inputs": ("Q_hvac", "Q_hvac")}, "list of different names"),
        ({"inputs": 3}, "list of different names"),
        ({"T_za": "warm"}, "T_za='warm' is not a number"),
        ({"T_za": pd.Series([21.0, 22.0])}, r"T_za=\(Series\) is not a number; give"),
        ({"T_za": np.nan}, r"T_za=nan is not a number.*or leave it out"),
        ({"T_za": [21.0]}, "is not (a number|one temperature)"),
        ({"T_za": -9999.0}, "T_za holds -9999"),
        ({"member": "ARX"}, "member='ARX' is neither"),
        ({"quantiles": (0.9, 0.1)}, "in increasing order|learns no intervals"),
        ({"future": slice(0, 0)}, "at least one row each"),
    ],
)
@pytest.mark.parametrize("name", ["schedule", "two-stage, output", "output"])
def test_what_cannot_be_is_refused(name, given, message, fitted, tables):
    X, future, _ = _rows(tables, name)
    model, given = fitted(name).update(X[N_TRAIN:NOW]), dict(given)
    future = future.iloc[given.pop("future", slice(None))]
    with pytest.raises(ValueError, match=message):
        model.affine_forecast(None, future, **given)


def test_a_role_and_its_column_are_one_input(tables, office):
    X = tables["stages"][:N_TRAIN].rename(columns={"u_heat": "boiler"})
    model = GrayBoxRC(known=office.theta, columns={"u_heat": "boiler"}).fit(X, office.y[:N_TRAIN])
    future = tables["stages"][N_TRAIN : N_TRAIN + 4].drop(columns="T_za").rename(columns={"u_heat": "boiler"})
    assert (
        model.affine_forecast(None, future).inputs == ("u_cool", "u_heat") == model.to_state_space(None, future).inputs
    )
    assert model.affine_forecast(None, future, ("boiler",)).inputs == ("u_heat",)
    with pytest.raises(ValueError, match=r"inputs=\('u_heat', 'boiler'\) names a role and its column"):
        model.affine_forecast(None, future, ("u_heat", "boiler"))


@pytest.mark.parametrize("name", ["schedule", "output"])
def test_bad_rows_ahead_are_refused(name, fitted, tables):
    X, future, T = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    missing = future.copy()
    missing.iloc[3, missing.columns.get_loc("T_oa")] = np.nan
    for call in (model.affine_forecast, model.to_state_space, model.forecast):
        with pytest.raises(ValueError, match=r"T_oa.*NaN"):
            call(None, missing)
        with pytest.raises(ValueError, match="begins at"):
            call(None, future.iloc[2:], T_za=T)
        with pytest.raises(ValueError, match="T_oa"):
            call(None, future.drop(columns="T_oa"))
    found = model.affine_forecast(None, future)
    with pytest.raises(ValueError, match=f"there are {DAY} rows .* more rows in future for a longer horizon"):
        found.temperature(np.zeros(DAY + 1))


@pytest.mark.parametrize("name", ["schedule", "output"])
def test_a_plan_beyond_training_is_warned_of(name, fitted, tables, recwarn):
    X, future, _ = _rows(tables, name)
    model = fitted(name).update(X[N_TRAIN:NOW])
    model.affine_forecast(None, future)
    model.affine_forecast(None, future.drop(columns="Q_hvac"))
    model.forecast(None, future)
    assert not [w for w in recwarn if issubclass(w.category, PlanWarning)]
    for n in (1, DAY // 4):
        wild = future.copy()
        wild.iloc[:n, wild.columns.get_loc("Q_hvac")] = 40.0
        for call in (model.forecast, model.affine_forecast, model.to_state_space):
            with pytest.warns(PlanWarning, match=f"Q_hvac outside of .* in {n} of {DAY} rows ahead"):
                call(None, wild)


def test_a_state_at_an_origin_needs_a_fit(tables):
    with pytest.raises(NotFittedError):
        GrayBoxRC().origin_state(tables["stages"], 0, "input")


def test_a_gray_box_says_what_its_new_methods_need(fitted, tables):
    X, future, T = _rows(tables, "output")
    model = fitted("output")
    assert isinstance(model.to_state_space(), StateSpace)
    assert isinstance(model.to_state_space(X[N_TRAIN:NOW], future), ControlModel)
    with pytest.raises(ValueError, match="need rows ahead"):
        model.to_state_space(T_za=T)
    with pytest.raises(ValueError, match="learns no intervals"):
        model.affine_forecast(X[N_TRAIN:NOW], future, quantiles=[0.5])
    with pytest.raises(ValueError, match="has no column 'T_za'"):
        model.update(X[N_TRAIN:NOW].drop(columns="T_za"))
    with pytest.raises(ValueError, match=r"^X begins at .*the last known row is"):
        model.update(X[N_TRAIN + 1 : NOW])
    with pytest.raises(ValueError, match=r"^future begins at .*the last known row is"):
        model.forecast(None, X[N_TRAIN + 1 : NOW])


def test_a_measured_state_changes_nothing_after_it():
    rng = np.random.default_rng(0)
    A, B = rng.uniform(-0.4, 0.4, (3, 3)), rng.normal(size=(3, 1))
    network = LinearNetwork(A, B, np.eye(3)[[1]], rng.normal(size=3), rng.normal(size=(4, 3)), ("a", "b", "c"))
    measured = network.measured(np.array([7.0]))
    assert measured.state[1] == 7.0
    u = np.array([0.5])
    np.testing.assert_allclose(measured.after(u).state, network.after(u).state, rtol=0, atol=1e-12)
