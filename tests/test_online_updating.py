"""Online updating: after ``update`` and ``partial_fit`` the state is that of the whole table."""

from __future__ import annotations

import pickle
from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    TwoStagePredictor,
)
from skhybrid._table import read_table
from skhybrid.datasets import make_office
from skhybrid.hybrid.hourly_aggregation import HourlyAggregation
from skhybrid.hybrid.known_rows import KnownRows, _fewer
from skhybrid.hybrid.weekly_refit import WeeklyRefit
from skhybrid.persistence import load_model, save_model

pytestmark = pytest.mark.usefixtures("quick_fits")

DAY = 96
#: the training ends within an hour, so that the first step is one of training rows and new ones
N_TRAIN = 9 * DAY + 2
KNOWN = {"Q_h": 6.0}


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=30, random_state=3)


def _hybrid(gray_box=None, forecaster=None, **settings):
    gray_box = gray_box if gray_box is not None else InputDisturbanceID(known=KNOWN, n_starts=1)
    return HybridPredictor(gray_box, forecaster, random_state=0, **{"adapt": "linear"} | settings)


@pytest.fixture(scope="module")
def fitted(office):
    return _hybrid().fit(office.X[:N_TRAIN], office.y[:N_TRAIN])


def _blocks(n, sizes):
    """(begin, end) of blocks of rows of the given sizes, over and over, up to n rows."""
    at, i = 0, 0
    while at < n:
        size = min(sizes[i % len(sizes)], n - at)
        yield at, at + size
        at, i = at + size, i + 1


def _follow(model, X, begin, end, sizes):
    for a, b in _blocks(end - begin, sizes):
        model.update(X[begin + a : begin + b])
    return model


# ------------------------------------------------------------------------------------------------------ update
MODELS = {
    "ridge": lambda: _hybrid(),
    "periodic, frozen": lambda: _hybrid(PeriodicDisturbanceID(known=KNOWN, n_starts=1), adapt=None),
    "output disturbance": lambda: _hybrid(
        OutputDisturbanceID(known=KNOWN, n_starts=1), DisturbanceForecaster("last_week"), disturbance="output"
    ),
    "conventional": lambda: _hybrid(GrayBoxRC(known=KNOWN, n_starts=1), DisturbanceForecaster("profile")),
    "lstm": lambda: _hybrid(forecaster=DisturbanceForecaster("lstm", max_epochs=2, hidden_size=4)),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_state_is_that_of_the_whole_table(name, office):
    """Row by row, in hours and in days, over more than a full week, after which the baselines are re-fitted."""
    X = office.X.copy()
    X.loc[X.index[N_TRAIN : N_TRAIN + 7], "T_za"] = np.nan  # not measured at first,
    X.loc[X.index[N_TRAIN + 300 : N_TRAIN + 350], "T_za"] = np.nan  # and for half a day later
    model = MODELS[name]().fit(X[:N_TRAIN], office.y[:N_TRAIN])
    whole, now = deepcopy(model), N_TRAIN
    for n_rows, sizes in ((3, [1]), (5 * DAY, [1, 4, 95]), (1, [1]), (4 * DAY + 50, [96, 7])):
        _follow(model, X, now, now + n_rows, sizes)
        now += n_rows
        future = X[now : now + DAY].drop(columns="T_za")
        ahead, along = model.forecast(None, future), whole.forecast(X[N_TRAIN:now], future)
        assert ahead.index.equals(along.index)
        np.testing.assert_allclose(ahead, along, rtol=0, atol=1e-8)
        origins = np.array([2, DAY])
        np.testing.assert_allclose(
            model.predict_from(X[now : now + 3 * DAY], origins),
            whole.predict_from(X[N_TRAIN : now + 3 * DAY], origins + now - N_TRAIN),
            rtol=0,
            atol=1e-8,
        )


def test_a_forecast_goes_on_from_the_last_one_late_in_a_day(office):
    """A regression learns at the end of each day, from forecasts that began up to a day before."""
    X, now = office.X, N_TRAIN
    model = HybridPredictor().fit(X[:now], office.y[:now])
    whole = deepcopy(model)
    for n_rows in (90, 90, 95):
        model.update(X[now : now + n_rows])
        now += n_rows
        future = X[now : now + DAY].drop(columns="T_za")
        ahead, along = model.forecast(None, future), whole.forecast(X[N_TRAIN:now], future)
        np.testing.assert_allclose(ahead, along, rtol=0, atol=1e-8)


def test_update_returns_itself_and_forgets_no_more_than_it_should(office, fitted):
    """Beyond the kept fortnight, and under a later change of ``adapt``."""
    model = deepcopy(fitted)
    assert model.update(office.X[N_TRAIN : N_TRAIN + 1]) is model
    now = N_TRAIN + 18 * DAY
    model.update(office.X[N_TRAIN + 1 : now])
    future = office.X[now : now + DAY].drop(columns="T_za")
    for adapt in ("linear", None):
        along = deepcopy(fitted).set_params(adapt=adapt).forecast(office.X[N_TRAIN:now], future)
        np.testing.assert_allclose(model.set_params(adapt=adapt).forecast(None, future), along, rtol=0, atol=1e-8)
    load = model.predict_load(office.X[now : now + DAY], 22.0)
    assert np.isfinite(load["Q_hvac"]).all()


def test_nothing_grows_but_the_record_of_what_is_to_be_learned(office, fitted):
    model = _follow(deepcopy(fitted), office.X, N_TRAIN, N_TRAIN + 12 * DAY, [5])
    rows = model._scheme.rows
    assert rows.n_rows - rows.training.n_rows <= 15 * DAY + DAY
    assert rows.end().n_rows <= 15 * DAY + DAY
    assert model.gray_box_._tail.n_rows == 1
    assert len(model._scheme._aggregation.labels) <= 24 * 22


def test_a_forecast_from_now_reads_no_temperature_ahead(office, fitted):
    model = deepcopy(fitted).update(office.X[N_TRAIN : N_TRAIN + 30])
    future = office.X[N_TRAIN + 30 : N_TRAIN + 30 + DAY]
    clean = model.forecast(None, future)
    np.testing.assert_array_equal(clean, model.forecast(None, future.assign(T_za=99.0)))
    np.testing.assert_array_equal(clean, model.forecast(None, future.drop(columns="T_za")))


@pytest.mark.parametrize("start", ["2023-03-25", "2023-10-28"], ids=["spring", "autumn"])
def test_across_daylight_saving_and_in_another_zone(start, office):
    """The clocks change while rows come in; their stamps may be those of UTC."""
    stamps = pd.date_range(pd.Timestamp(start, tz="Europe/Berlin"), periods=len(office.X), freq="15min")
    stamps = stamps - pd.Timedelta("9D")
    X = office.X.set_axis(stamps)
    model = _hybrid().fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    whole, now = deepcopy(model), N_TRAIN + 3 * DAY
    model = _follow(model, X.tz_convert("UTC"), N_TRAIN, now, [1, 30])
    future = X[now : now + DAY].drop(columns="T_za")
    along = whole.forecast(X[N_TRAIN:now], future)
    np.testing.assert_allclose(model.forecast(None, future), along, rtol=0, atol=1e-8)
    in_utc = model.forecast(None, future.tz_convert("UTC"))
    np.testing.assert_array_equal(in_utc, model.forecast(None, future))
    assert str(in_utc.index.tz) == "UTC"
    in_utc = X[now : now + DAY].tz_convert("UTC")
    model.partial_fit(in_utc, in_utc["T_za"])
    assert str(model.zeta_.index.tz) == "Europe/Berlin"
    with pytest.raises(ValueError, match="the training table has the time zone Europe/Berlin, X None"):
        model.update(X[now + DAY : now + DAY + 1].tz_localize(None))


def test_rows_that_do_not_follow_are_refused(office, fitted):
    model, X = deepcopy(fitted), office.X
    for begin in (N_TRAIN + 1, N_TRAIN - 1):
        words = f"X begins at {X.index[begin]}, but the last known row is {X.index[N_TRAIN - 1]}; it must begin one"
        with pytest.raises(ValueError, match=words):
            model.update(X[begin : begin + 4])
    with pytest.raises(ValueError, match=r"^future begins at .* but the last known row is .* give update the rows"):
        model.forecast(None, X[N_TRAIN + 1 : N_TRAIN + 9])
    with pytest.raises(ValueError, match="future has no column 'T_oa'"):
        model.forecast(None, X[N_TRAIN : N_TRAIN + 9].drop(columns="T_oa"))
    with pytest.raises(ValueError, match=r"column 'T_oa' contains NaN in 1 row .first at"):
        model.update(X[N_TRAIN : N_TRAIN + 1].assign(T_oa=np.nan))
    model.update(X[N_TRAIN : N_TRAIN + 4])  # what was refused left nothing behind
    assert model.forecast(None, X[N_TRAIN + 4 : N_TRAIN + 8]).shape == (4, 2)


def test_a_table_without_stamps_goes_on_with_its_clock(office, fitted):
    """Arrays hold no temperature, which then comes as y; the stamped office begins on another weekday."""
    inputs = ["T_oa", "q_sol", "u_heat", "u_cool"]
    stamped = office.X[inputs].set_axis(pd.date_range("2001-01-01", periods=len(office.X), freq="15min"))
    names = {"q_sol": "q_sol", "u_2": "u_heat", "u_3": "u_cool"}
    gray_box = InputDisturbanceID(known={"Q_2": 6.0}, n_starts=1, sampling_time="15min")
    model = _hybrid(gray_box).fit(stamped.to_numpy()[:N_TRAIN], office.y[:N_TRAIN].to_numpy())
    named = stamped.rename(columns={v: k for k, v in names.items()})
    other = _hybrid(clone(gray_box)).fit(named[:N_TRAIN], office.y[:N_TRAIN].to_numpy())
    with pytest.raises(ValueError, match="X has no column 'T_za'"):
        model.update(stamped.to_numpy()[N_TRAIN : N_TRAIN + 1])
    for a, b in ((N_TRAIN, N_TRAIN + 1), (N_TRAIN + 1, N_TRAIN + DAY)):
        model.update(stamped.to_numpy()[a:b], office.y[a:b].to_numpy())
        other.update(named[a:b], office.y[a:b].to_numpy())
    future = named[N_TRAIN + DAY : N_TRAIN + 2 * DAY]
    ahead = model.forecast(None, future.reset_index(drop=True).set_axis(range(4), axis=1))
    np.testing.assert_allclose(ahead["T_za"], other.forecast(None, future)["T_za"], rtol=0, atol=1e-10)


def test_an_updated_model_can_be_saved(office, fitted, tmp_path):
    model = deepcopy(fitted).update(office.X[N_TRAIN : N_TRAIN + 8 * DAY + 3])
    future = office.X[N_TRAIN + 8 * DAY + 4 : N_TRAIN + 9 * DAY]
    save_model(model, tmp_path / "zone.skops")
    for again in (load_model(tmp_path / "zone.skops"), pickle.loads(pickle.dumps(model))):
        row = office.X[N_TRAIN + 8 * DAY + 3 : N_TRAIN + 8 * DAY + 4]
        ahead = deepcopy(again).update(row).forecast(None, future)
        np.testing.assert_array_equal(ahead, deepcopy(model).update(row).forecast(None, future))


# ------------------------------------------------------------------------------------------------ what is refused
SCHEMES = {
    "schedule": lambda: HybridPredictor(known=KNOWN),
    "two-stage": lambda: _hybrid(adapt="linear"),
    "two-stage, identified again": lambda: _hybrid(adapt="full"),
}


@pytest.fixture(scope="module", params=SCHEMES)
def either(request, office):
    model = SCHEMES[request.param]().fit(office.X[:N_TRAIN], office.y[:N_TRAIN])
    return model.update(office.X[N_TRAIN : N_TRAIN + 5])


@pytest.fixture(scope="module")
def said(either, office):
    return _all_that_it_says(either, office)


@pytest.fixture
def places(request, either):
    return PLACES[request.node.callspec.params["either"]]


def _all_that_it_says(model, office):
    first = N_TRAIN + 5
    X = office.X[first : first + 2 * DAY]
    return {
        "predict": model.predict(X),
        "quantiles": model.predict_quantiles(X),
        "ahead": model.forecast(None, X[:DAY]),
        "load": model.predict_load(X, 21.0),
        "drift": model.drift(X)["statistic"],
        "theta": model.gray_box_.theta_,
        "zeta": model.zeta_,
    }


def _assert_unchanged(model, before, office):
    # to rounding: the first forecast after new rows looks back on more of them than the next one
    for name, found in _all_that_it_says(model, office).items():
        np.testing.assert_allclose(found, before[name], rtol=1e-13, atol=1e-13, err_msg=name)


@pytest.mark.parametrize("bad", [9.96921e36, -9999.0, 1e300])
@pytest.mark.parametrize("method", ["update", "partial_fit", "fit", "predict"])
def test_a_temperature_that_cannot_be_leaves_the_model_as_it_was(method, bad, either, said, office):
    """Such as the fill value of netCDF files."""
    model = deepcopy(either)
    attributes = dict(vars(model))
    for column in ("T_za", "T_oa"):
        X = office.X[N_TRAIN + 5 : N_TRAIN + 25].copy()
        X.iloc[7, X.columns.get_loc(column)] = bad
        given = (X,) if method in ("update", "predict") else (X, X["T_za"])
        stamp = str(X.index[7])
        with pytest.raises(ValueError, match=f"'{column}' holds .* in 1 row .first at {stamp}.*fill value"):
            getattr(model, method)(*given)
    if method in ("partial_fit", "fit"):
        X = office.X[N_TRAIN + 5 : N_TRAIN + 25]
        y = X["T_za"].copy()
        y.iloc[3] = bad
        with pytest.raises(ValueError, match=r"^y holds .* in 1 row"):
            getattr(model, method)(X, y)
    assert vars(model).keys() == attributes.keys()
    assert all(vars(model)[name] is value for name, value in attributes.items())
    _assert_unchanged(model, said, office)


PLACES = {
    "schedule": (
        ("blending.members.ARXMember.fit", "fit"),
        ("schedule_scheme.BlendRecord", "fit"),
        ("known_rows.KnownRows.appended", "update"),
        ("schedule_scheme.KnownRows.of", "partial_fit"),
        ("blending.members.ARXMember.fit", "partial_fit"),
        ("known_rows.KnownRows.retrained", "partial_fit"),
    ),
    "two-stage": (
        ("two_stage_scheme.fit_forecaster", "fit"),
        ("base.intervals_from", "fit"),
        ("known_rows.KnownRows.appended", "update"),
        ("hourly_aggregation.HourlyAggregation.added", "update"),
        ("weekly_refit.fit_forecaster", "partial_fit"),
        ("two_stage_scheme.HourlyAggregation.since", "partial_fit"),
    ),
    "two-stage, identified again": (
        ("known_rows.KnownRows.appended", "partial_fit"),
        ("two_stage_scheme.identify_again", "partial_fit"),
        ("two_stage_scheme.fit_forecaster", "partial_fit"),
        ("two_stage_scheme.HourlyAggregation.since", "partial_fit"),
    ),
}


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
@pytest.mark.slow
def test_an_interrupted_call_leaves_the_model_as_it_was(error, either, said, places, office, monkeypatch):
    """Wherever it is interrupted, and however much it has done by then."""
    model = deepcopy(either)
    attributes = dict(vars(model))
    rows = slice(N_TRAIN + 5, N_TRAIN + 5 + DAY)
    warmer = office.X[rows].assign(T_za=office.y[rows] + 1.0)  # nothing of these rows must stay

    def interrupted(*args, **kwargs):
        raise error

    for place, method in places:
        given = (warmer,) if method == "update" else (warmer, warmer["T_za"])
        with monkeypatch.context() as patch:
            patch.setattr(f"skhybrid.hybrid.{place}", interrupted)
            with pytest.raises(error):
                getattr(model, method)(*given)
        assert vars(model).keys() == attributes.keys(), place
        assert all(vars(model)[name] is value for name, value in attributes.items()), place
    _assert_unchanged(model, said, office)
    twin = deepcopy(either).partial_fit(office.X[rows], office.y[rows])
    model.partial_fit(office.X[rows], office.y[rows])
    later = office.X[rows.stop : rows.stop + DAY]
    np.testing.assert_array_equal(model.predict(later), twin.predict(later))


# ------------------------------------------------------------------------------------------------- partial_fit
def test_partial_fit_learns_the_new_weeks(office, fitted):
    """The forecaster becomes that of all steps, the gray box stays."""
    now = N_TRAIN + 10 * DAY
    model = deepcopy(fitted)
    theta = model.gray_box_.theta_.copy()
    model.partial_fit(office.X[N_TRAIN:now], office.y[N_TRAIN:now])
    pd.testing.assert_series_equal(model.gray_box_.theta_, theta)
    causal = fitted.gray_box_.estimate_disturbance(office.X[:now].assign(T_za=office.y[:now]))
    weather = office.X[:now].drop(columns="T_za").assign(zeta=causal)
    first, rest = weather[:N_TRAIN].resample("1h").mean(), weather.resample("1h").mean()
    hours = pd.concat([first, rest[rest.index > first.index[-1]]])[:-1]  # the last hour is not over
    truth = DisturbanceForecaster("ridge", random_state=0).fit(hours, hours["zeta"])
    np.testing.assert_allclose(model.zeta_, hours["zeta"], atol=1e-6)
    np.testing.assert_allclose(
        model.forecaster_._base.static_.fit_.coef, truth._base.static_.fit_.coef, rtol=1e-5, atol=1e-6
    )
    assert not np.allclose(model.forecaster_._base.static_.fit_.coef, fitted.forecaster_._base.static_.fit_.coef)


def test_what_update_has_seen_is_learned_once(office, fitted):
    now = N_TRAIN + 6 * DAY
    seen = deepcopy(fitted).update(office.X[N_TRAIN : now - 5])
    seen.partial_fit(office.X[N_TRAIN + DAY : now], office.y[N_TRAIN + DAY : now])
    fresh = deepcopy(fitted).partial_fit(office.X[N_TRAIN:now], office.y[N_TRAIN:now])
    future = office.X[now : now + DAY]
    np.testing.assert_allclose(seen.forecast(None, future), fresh.forecast(None, future), rtol=0, atol=1e-8)
    with pytest.raises(ValueError, match="but the last known row is"):
        seen.partial_fit(office.X[now + 1 : now + 5], office.y[now + 1 : now + 5])


def test_a_measurement_that_comes_after_its_row_is_refused(office, fitted):
    """Known rows are not taken in again, so that it would be lost."""
    new, y = office.X[N_TRAIN : N_TRAIN + DAY].copy(), office.y[N_TRAIN : N_TRAIN + DAY].copy()
    new.iloc[5:, new.columns.get_loc("T_za")] = np.nan
    seen = deepcopy(fitted).update(new[:40])
    for row, value in ((7, "nan"), (3, f"{new['T_za'].iloc[3]:g}")):
        late = y.where((np.arange(DAY) >= 40) | (np.arange(DAY) == row)) + 0.1
        stamp = new.index[row]
        with pytest.raises(ValueError, match=rf"^y is .* at {stamp}, a row that was taken in with T_za = {value}; "):
            seen.partial_fit(new, late)
    seen.partial_fit(new, y.where((np.arange(DAY) >= 40) | (np.arange(DAY) < 5)))


def test_a_network_keeps_its_weights_unless_asked(office):
    quick = DisturbanceForecaster("mlp", max_epochs=2, hidden_size=4, residual_of=None)
    now = N_TRAIN + 4 * DAY
    for adapt in ("linear", "full"):
        model = _hybrid(forecaster=clone(quick), adapt=adapt).fit(office.X[:N_TRAIN], office.y[:N_TRAIN])
        before, theta = model.forecaster_, model.gray_box_.theta_.copy()
        model.partial_fit(office.X[N_TRAIN:now], office.y[N_TRAIN:now])
        assert (model.forecaster_ is before) == (adapt == "linear")
        assert model.gray_box_.theta_.equals(theta) == (adapt == "linear")


@pytest.mark.parametrize("gray_box", [InputDisturbanceID, PeriodicDisturbanceID])
@pytest.mark.slow
def test_full_identifies_again_from_where_it_was(gray_box, office):
    """One start, at the known parameters; the result is as likely as that of a fit of everything."""
    n, now = 8 * DAY, 12 * DAY
    model = _hybrid(gray_box(known=KNOWN, n_starts=3), adapt="full").fit(office.X[:n], office.y[:n])
    for a, b in _blocks(now - n, [1, 100]):
        model.update(office.X[n + a : n + b])
    model.partial_fit(office.X[n:now], office.y[n:now])
    whole = _hybrid(gray_box(known=KNOWN, n_starts=3)).fit(office.X[:now], office.y[:now])
    assert len(model.gray_box_.starts_) == 1
    assert model.gray_box_.loss_ == pytest.approx(whole.gray_box_.loss_, rel=1e-3, abs=0.5)
    late = deepcopy(whole).set_params(adapt="full")
    late.partial_fit(office.X[now : now + DAY], office.y[now : now + DAY])
    assert len(late.gray_box_.starts_) == 1  # it was identified again, though it was fitted with another adapt


def test_the_first_partial_fit_fits(office, fitted):
    model = clone(fitted).partial_fit(office.X[:N_TRAIN], office.y[:N_TRAIN])
    X = office.X[N_TRAIN : N_TRAIN + DAY]
    np.testing.assert_array_equal(model.predict(X), fitted.predict(X))


# --------------------------------------------------------------------------------------------- hourly aggregation
def test_hours_are_averaged_as_by_a_plain_loop():
    rng = np.random.default_rng(0)
    stamps = np.arange(300) * 15 * 60 * 10**9 + 7 * 60 * 10**9
    rows = rng.normal(size=(300, 2))
    rows[rng.uniform(size=300) < 0.4, 1] = np.nan
    hourly = HourlyAggregation(["T_oa", "zeta"], pd.Timedelta("1h"), True, None)
    for a, b in _blocks(260, [1, 2, 9, 31]):
        hourly = hourly.added(stamps[a:b], rows[a:b])
    hours = stamps // (3600 * 10**9)
    with np.errstate(invalid="ignore"):
        truth = {h: [np.mean(c[np.isfinite(c)]) if np.isfinite(c).any() else np.nan for c in rows[hours == h].T]
                 for h in np.unique(hours)}  # fmt: skip
    np.testing.assert_array_equal(hourly.labels // (3600 * 10**9), np.unique(hours[:260])[:-1])
    steps = hourly.extended(stamps[260:], rows[260:], 10)
    shown = steps.table.utc.as_unit("ns").asi8 // pd.Timedelta("1h").value
    found = np.column_stack([steps.table.inputs["T_oa"], steps.table.history["zeta"]])
    np.testing.assert_allclose(found[1:], [truth[h] for h in shown[1:]], atol=1e-12)
    np.testing.assert_array_equal(shown[steps.of_row], hours[259:])
    assert len(shown) == 1 + 10 + len(np.unique(hours[259:]))
    assert len(hourly.since(int(hourly.labels[-3])).labels) == 3
    assert len(hourly.labels) > 3


@pytest.mark.parametrize("adapt", [None, "linear", "full"])
def test_after_weeks_of_updates_a_two_stage_model_still_knows_its_errors_and_rows(adapt):
    log, trained = make_office(n_days=34, sampling_time="1h", random_state=0), 14 * 24
    gray_box = InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1)
    model = TwoStagePredictor(gray_box, DisturbanceForecaster(Ridge()), adapt=adapt, random_state=0)
    model.fit(log.X[:trained], log.y[:trained])
    ahead, levels = log.X[33 * 24 :].drop(columns="T_za"), [0.1, 0.9]
    expected = model.forecast(log.X[trained : 33 * 24], ahead, quantiles=levels)
    for first in range(14, 33):
        model.update(log.X[first * 24 : (first + 1) * 24])
    pd.testing.assert_frame_equal(model.forecast(None, ahead, quantiles=levels), expected, atol=1e-6)
    if adapt is None:  # and may be identified again
        model.set_params(adapt="full").partial_fit(log.X[32 * 24 : 33 * 24], log.y[32 * 24 : 33 * 24])
        assert model.zeta_.index[0] == log.X.index[0]
        assert model.zeta_.index[-1] == log.X.index[33 * 24 - 1]


def test_known_rows_end_with_the_last_stamp(office):
    table = read_table(ARXRegressor(), office.X[: 2 * DAY], reset=True)
    table = table.replace(history={"T_za": office.y[: 2 * DAY].to_numpy()})
    rows = KnownRows.of(table.rows(slice(0, DAY)))
    assert rows.last_stamp == office.X.index[DAY - 1].tz_localize("UTC")
    assert rows.without_known(table.rows(slice(DAY - 5, DAY + 5))).index.equals(office.X.index[DAY : DAY + 5])
    bare = read_table(ARXRegressor(), office.X[:DAY].reset_index(drop=True), sampling_time="15min", reset=True)
    bare = bare.replace(history={"T_za": office.y[:DAY].to_numpy()})
    rows = KnownRows.of(bare)
    assert rows.last_stamp is None
    assert rows.without_known(bare) is bare
    assert rows.without_known(table) is table  # which is refused later


def test_tables_of_one_length_are_joined(office):
    table = read_table(GrayBoxRC(), office.X, reset=True)
    rows = [table.rows(slice(i, i + 1)) for i in range(12)]
    (joined,) = _fewer(tuple(rows))
    np.testing.assert_array_equal(joined.inputs["T_oa"], office.X["T_oa"][:12])
    for others in (rows[1:], [*rows[1:], table.rows(slice(12, 14))]):
        assert _fewer(tuple(others)) == tuple(others)


@pytest.mark.parametrize(("changed", "days"), [(14, 21), (19, 14), (40, None)])
def test_a_refit_is_made_on_the_span_that_forecast_the_last_week_best(changed, days):
    """The disturbance is 5 kW instead of 1 kW from a day on; the week to forecast begins at day 35."""
    index = pd.date_range("2024-01-01", periods=42 * 24, freq="1h")
    table = read_table(ARXRegressor(), pd.DataFrame({"T_oa": np.zeros(len(index))}, index), reset=True)
    steps = table.replace(history={"zeta": np.where(np.arange(len(index)) < 24 * changed, 1.0, 5.0)})
    refit = WeeklyRefit(DisturbanceForecaster("profile"))
    assert refit._span(steps) == (None if days is None else pd.Timedelta(days=days))
    assert refit._span(steps.rows(slice(0, 20 * 24))) is None  # all of it is no more than 14 days


@pytest.mark.parametrize("make", [HybridPredictor, lambda: TwoStagePredictor(random_state=0)])
def test_a_history_that_repeats_the_known_rows_adds_nothing(make):
    """It may be all of them, their end, or these and the rows after them; other values are another room's."""
    office = make_office(n_days=13, random_state=0)
    X, y, end = office.X, office.y, 10 * 96
    model = make().fit(X[:end], y[:end])
    ahead, levels = X[end : end + 96].drop(columns="T_za"), (0.1, 0.9)
    expected = model.forecast(None, ahead, quantiles=levels)
    for history in (X[:end], X[end - 300 : end], X[:end].astype(np.float32).astype(np.float64)):
        pd.testing.assert_frame_equal(model.forecast(history, ahead, quantiles=levels), expected, rtol=1e-12)
    later, grown = X[end + 96 : end + 192].drop(columns="T_za"), deepcopy(model).update(X[end : end + 96])
    expected = grown.forecast(None, later)
    for history in (X[: end + 96], X[end : end + 96]):
        pd.testing.assert_frame_equal(model.forecast(history, later), expected, rtol=1e-12)
    moved = X[:end].assign(T_za=X["T_za"][:end] + 1.0)
    assert not np.allclose(model.forecast(moved, ahead)["T_za"], model.forecast(None, ahead)["T_za"], atol=0.1)


@pytest.mark.parametrize("make", [HybridPredictor, lambda: TwoStagePredictor(random_state=0)])
def test_rows_after_the_known_ones_of_a_table_go_on_from_these(make):
    """A table that began within the training was read as another history, while forecast knew these rows."""
    office = make_office(n_days=13, random_state=0)
    X, y, end, levels = office.X, office.y, 10 * 96, (0.1, 0.9)
    model, begin = make().fit(X[:end], y[:end]), end - 300
    origins = [100, 299, 299 + 96, 299 + 150]
    paths = model.predict_from(X[begin:], origins)
    assert np.array_equal(paths[1:], model.predict_from(X[end:], [-1, 95, 149]), equal_nan=True)
    assert np.array_equal(paths[:1], model.predict_from(X[begin : end - 1], origins[:1]))
    bands = model.predict_quantiles_from(X[begin:], origins, levels)
    assert np.array_equal(bands[1:], model.predict_quantiles_from(X[end:], [-1, 95, 149], levels), equal_nan=True)
    expected = model.forecast(X[:end], X[end : end + 96].drop(columns="T_za"))["T_za"]
    np.testing.assert_allclose(paths[1], expected, rtol=1e-12)
    for predict in (model.predict, lambda X: model.predict_quantiles(X, levels)):
        np.testing.assert_allclose(predict(X[begin:])[301:], predict(X[end:])[1:], rtol=1e-14)  # origins are midnights


@pytest.mark.parametrize("days", [(5, 9), (2, 10)])
def test_an_outage_of_the_training_may_fill_most_of_a_part(days, office):
    """Intervals need forecasters that are fitted without a week, of what is left more may be missing than of ``y``."""
    X, y = office.X[: 21 * 96], office.y[: 21 * 96].copy()
    y.iloc[slice(*(96 * day for day in days))] = np.nan
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=1, random_state=0)
    model = TwoStagePredictor(gray_box, disturbance="output").fit(X.assign(T_za=y), y)
    assert model.predict_quantiles(office.X[21 * 96 :][:96]).shape == (96, 3)


def test_a_forecast_after_weeks_without_a_measurement(office):
    """A span of the weekly refits in which no disturbance is known is not compared."""
    (X, y), end, days = (office.X, office.y), 7 * 96, 22
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=1, random_state=0)
    model = TwoStagePredictor(gray_box, disturbance="output", intervals=False).fit(X[:end], y[:end])
    gone = X[end : end + 96 * days].assign(T_za=np.nan)
    model.update(gone)
    assert np.isfinite(model.forecast(None, X[end + 96 * days :][:96])["T_za"]).all()
