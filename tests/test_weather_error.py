"""Errors of weather forecasts, and forecasts and intervals under them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import BaseEstimator
from sklearn.linear_model import Ridge

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor
from skhybrid._table import ZoneTable, append_tables, read_table
from skhybrid.datasets import make_office
from skhybrid.exceptions import PlanWarning, SkhybridWarning
from skhybrid.forecasting import WeatherError
from skhybrid.forecasting.weather_error import _most_nearby, _normal_spread
from skhybrid.model_selection import backtest, score_backtest

N_LEADS = 96


def _table(n_days: int = 16, **inputs: np.ndarray) -> ZoneTable:
    time = pd.date_range("2024-03-04", periods=96 * n_days, freq="15min")
    sun = np.maximum(0.0, np.sin((time.hour + time.minute / 60 - 6) * np.pi / 12)) * 0.8
    inputs = {"T_oa": np.full(len(time), 5.0), "q_sol": np.asarray(sun), **inputs}
    return ZoneTable(inputs, {}, time, time, time.tz_localize("UTC"), pd.Timedelta("15min"))


def _errors(level: str, role: str, origin: int, n_draws: int) -> np.ndarray:
    table, rows = _table(), slice(origin + 1, origin + 1 + N_LEADS)
    drawn = [WeatherError(level).forecast(table, origin, N_LEADS, draw) for draw in range(n_draws)]
    return np.array([t.inputs[role][rows] - table.inputs[role][rows] for t in drawn])


def test_temperature_error_is_the_published_autoregression():
    errors = _errors("medium", "T_oa", 95, 2000)[:, 3::4]  # at whole hours
    variance, mean = [1.2**2], [0.15]
    for _ in range(23):
        variance.append(0.93**2 * variance[-1] + 0.6**2)
        mean.append(0.93 * mean[-1])
    np.testing.assert_allclose(errors.std(axis=0), np.sqrt(variance), rtol=0.06)
    np.testing.assert_allclose(errors.mean(axis=0), mean, atol=0.12)
    after = [np.corrcoef(errors[:, k], errors[:, k + 1])[0, 1] for k in range(23)]
    expected = [0.93 * np.sqrt(a / b) for a, b in pairwise(variance)]
    np.testing.assert_allclose(after, expected, atol=0.03)


def test_levels_are_ordered():
    sizes = [np.abs(_errors(level, "T_oa", 95, 300)).mean() for level in ("low", "medium", "high")]
    assert sizes[0] < 0.75 * sizes[1] < sizes[2]


def test_irradiance_stays_between_night_and_clear_sky():
    table, noon = _table(), 8 * 96 + 47
    errors = _errors("high", "q_sol", noon, 200)
    forecast = errors + table.inputs["q_sol"][noon + 1 : noon + 1 + N_LEADS]
    night = table.inputs["q_sol"][noon + 1 : noon + 1 + N_LEADS] == 0
    assert (errors[:, night] == 0).all()
    assert forecast.min() >= 0
    assert forecast.max() <= table.inputs["q_sol"].max() + 1e-12  # this sky is always clear
    assert errors.min() < -0.1


def test_the_clear_sky_of_a_row_is_the_highest_within_a_week_by_a_plain_loop():
    sun = np.random.default_rng(0).random(96 * 20)
    table, rows = _table(20, q_sol=sun), (5, 96 * 9 + 3, 96 * 18 + 1)
    for row in rows:
        near = [sun[row + 96 * d] for d in range(-7, 8) if 0 <= row + 96 * d < len(sun)]
        assert _most_nearby(table, "q_sol", slice(row, row + 1)) == [max(near)]


def test_only_the_weather_of_the_horizon_changes():
    table = _table(T_ground=np.full(96 * 16, 10.0), u_heat=np.full(96 * 16, 0.3))
    seen = WeatherError().forecast(table, 500, N_LEADS)
    for role, values in table.inputs.items():
        same = seen.inputs[role] == values
        assert same[:501].all()
        assert same[501 + N_LEADS :].all()
        assert same.all() == (role in ("T_ground", "u_heat"))


def test_facades_change_in_proportion():
    table = _table(q_sol_south=0.4 * _table().inputs["q_sol"])
    seen = WeatherError().forecast(table, 500, N_LEADS).inputs
    np.testing.assert_allclose(seen["q_sol_south"], 0.4 * seen["q_sol"], atol=1e-12)


def test_errors_belong_to_their_origin():
    table = _table()
    one, again = (WeatherError().forecast(table, 500, N_LEADS).inputs["T_oa"] for _ in range(2))
    later = WeatherError().forecast(table.rows(slice(96, None)), 500 - 96, N_LEADS).inputs["T_oa"]
    np.testing.assert_array_equal(one, again)
    np.testing.assert_array_equal(one[96:], later)
    assert not np.array_equal(one, WeatherError(random_state=1).forecast(table, 500, N_LEADS).inputs["T_oa"])


def test_errors_belong_to_their_origin_after_a_change_of_clocks():
    stamps = pd.date_range("2023-03-20", "2023-04-05", freq="1h", tz="Europe/Amsterdam")
    table = read_table(BaseEstimator(), pd.DataFrame({"T_oa": 5.0}, stamps), reset=True)
    origin = stamps.get_loc(pd.Timestamp("2023-03-30", tz="Europe/Amsterdam"))
    whole = WeatherError().forecast(table, origin, 24).inputs["T_oa"][origin:]
    part = WeatherError().forecast(table.rows(slice(origin, None)), 0, 24).inputs["T_oa"]
    np.testing.assert_array_equal(whole, part)


@pytest.mark.parametrize("seed", [None, -1, 0.5])
def test_a_seed_of_the_weather_is_an_integer(seed):
    with pytest.raises(ValueError, match=f"random_state={seed} must be an integer"):
        WeatherError(random_state=seed)


def test_the_last_row_has_no_weather_ahead(office):
    """Neither as an origin of a back-test, nor where rows end at midnight."""
    table = _table()
    last = WeatherError().forecast(table, table.n_rows - 1, N_LEADS)
    np.testing.assert_array_equal(last.inputs["q_sol"], table.inputs["q_sol"])
    model = ARXRegressor(alpha=10.0).fit(office.X[: 8 * 96], office.y[: 8 * 96])
    days = office.X[8 * 96 : 10 * 96 + 1]  # origins: the last known row, and three midnights
    assert np.isfinite(model.predict_quantiles(days, weather_error="low")).all()


def test_an_unknown_level_is_refused(office, models):
    with pytest.raises(ValueError, match="not one of 'low', 'medium', 'high'"):
        models["arx"].predict_quantiles(office.X[-96:], weather_error="huge")


def test_an_error_of_the_weather_without_quantiles_is_refused_as_it_would_do_nothing(office, models):
    with pytest.raises(ValueError, match="weather_error= widens quantiles, and none are asked for"):
        models["hybrid"].forecast(office.X[:96], office.X[96:192], weather_error="high")


@pytest.fixture(scope="module")
def office():
    return make_office(18, "chicago", random_state=3)


@pytest.fixture(scope="module")
def models(office):
    train, y = office.X[: 12 * 96], office.y[: 12 * 96]
    return {
        "arx": ARXRegressor().fit(train, y),
        "hybrid": HybridPredictor(adapt=None, network="2R2C", known={"Q_h": 6.0}).fit(train, y),
        "gray box": GrayBoxRC("2R2C", known={"Q_h": 6.0}, n_starts=1, random_state=0).fit(train, y),
    }


def _rows(office):
    return office.X[12 * 96 :], office.y[12 * 96 :]


@pytest.mark.parametrize("name", ["arx", "hybrid"])
def test_backtest_under_a_weather_forecast(office, models, name):
    X, y = _rows(office)
    exact = backtest(models[name], X, y, quantiles=(0.1, 0.9))
    off = backtest(models[name], X, y, quantiles=(0.1, 0.9), weather_error="high")
    pd.testing.assert_frame_equal(
        exact[["origin", "lead", "time", "y_true"]], off[["origin", "lead", "time", "y_true"]]
    )
    assert score_backtest(off)["rmse"] != score_backtest(exact)["rmse"]
    assert (off["q_0.9"] - off["q_0.1"]).mean() > (exact["q_0.9"] - exact["q_0.1"]).mean()


def test_one_quantile_may_be_a_number(office, models):
    X, y = _rows(office)
    one, other = (backtest(models["arx"], X, y, quantiles=q, weather_error="low") for q in (0.9, [0.9]))
    pd.testing.assert_frame_equal(one, other)


def test_the_measured_heat_of_a_back_test_is_no_plan(office, models, recwarn):
    X, y = _rows(office)
    backtest(models["hybrid"], X.assign(u_heat=X["u_heat"] + 1.3), y, weather_error="medium")
    assert not [w for w in recwarn if issubclass(w.category, PlanWarning)]
    models["hybrid"].forecast(X[:96], X[96:192].assign(u_heat=1.3))
    assert [w for w in recwarn if issubclass(w.category, PlanWarning)]


@pytest.mark.parametrize("name", ["hybrid", "gray box"])
def test_going_through_rows_equals_the_whole_table(office, models, name):
    X, y = _rows(office)
    walked = backtest(models[name], X, y, weather_error="medium")
    rows = X.index.get_indexer(walked["origin"].unique())
    whole = read_table(BaseEstimator(), X, columns=None, sampling_time=None, reset=True)
    seen = [WeatherError().forecast(whole, int(row), N_LEADS) for row in rows]
    paths = [models[name].predict_from(t, [int(row)], "1D")[0] for t, row in zip(seen, rows, strict=True)]
    np.testing.assert_allclose(walked["y_pred"], np.concatenate(paths), atol=1e-8)


def test_a_forecast_reads_no_weather_but_its_own(office, models):
    """Measurements after an origin do not reach the forecast through the history."""
    X, y = _rows(office)
    before = backtest(models["arx"], X, y, weather_error="medium")
    changed = X.assign(T_za=X["T_za"] + 2.0 * (X.index >= X.index[2 * 96]))
    after = backtest(models["arx"], changed, y, weather_error="medium")
    known = (before["origin"] < X.index[2 * 96]).to_numpy()
    np.testing.assert_array_equal(before["y_pred"][known], after["y_pred"][known])
    assert known.any()
    assert not known.all()


def test_intervals_read_no_temperature_after_their_origin(office, models):
    """The spread of the weather is of origins so far."""
    X, n = _rows(office)[0], 2 * 96
    model = ARXRegressor(adapt="refit").fit(office.X[: 12 * 96], office.y[: 12 * 96])
    whole = model.predict_quantiles(X, weather_error="high")
    changed = X.assign(T_za=X["T_za"].where(np.arange(len(X)) < n, X["T_za"] + 3.0 * np.sin(np.arange(len(X)))))
    np.testing.assert_array_equal(model.predict_quantiles(changed, weather_error="high")[:n], whole[:n])


@pytest.mark.parametrize("name", ["arx", "hybrid"])
def test_intervals_read_no_weather_after_the_horizon(office, models, name):
    """A sunny day within the week after it, as a back-test has it, was taken for the clear sky."""
    X, end = _rows(office)[0], 100 + 96 + 1
    sunny = X.assign(q_sol=X["q_sol"].where(np.arange(len(X)) < end, X["q_sol"] + 0.5))
    found = [models[name].predict_quantiles_from(rows, [100], weather_error="high") for rows in (X, sunny)]
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("taken_in", [0, 3 * 96])
def test_forecasts_under_other_weather_are_those_of_each_table(office, taken_in):
    """They adapt to the history as the forecast does whose intervals they widen."""
    model = HybridPredictor(network="2R2C", known={"Q_h": 6.0}).fit(office.X[: 12 * 96], office.y[: 12 * 96])
    if taken_in:
        model.update(office.X[12 * 96 : 12 * 96 + taken_in])
    scheme, later = model._present_scheme(), model._read_X(office.X[12 * 96 + taken_in :])
    following = append_tables(scheme.rows.end(), later)
    last = following.n_history - 1  # the last known row
    for table, origin in ((following, last), (following, last + 40), (following, last + 97), (later, 97)):
        tables = [table, *(WeatherError("high").forecast(table, origin, N_LEADS, draw) for draw in (1, 2))]
        each = [scheme.forecast(one, np.array([origin]), N_LEADS).temperature[0] for one in tables]
        assert np.abs(each[1] - each[0]).max() > 0.1
        np.testing.assert_allclose(scheme.forecast_each(tables, origin, N_LEADS), each, rtol=0, atol=1e-9)


@pytest.mark.parametrize("objective", ["one_step", "multi_step"])
def test_an_arx_is_fitted_again_once_for_all_drawn_weathers(office, monkeypatch, objective):
    model = ARXRegressor(adapt="refit", objective=objective, n_lags=6, n_input_lags=2)
    model.fit(office.X[: 12 * 96], office.y[: 12 * 96])
    table, origin, fitted = read_table(model, office.X, reset=False), 14 * 96 + 10, []
    tables = [WeatherError().forecast(table, origin, N_LEADS, draw) for draw in range(3)]
    refitted = ARXRegressor.refitted
    expected = [model._forecast(one, np.array([origin]), N_LEADS) for one in tables]
    monkeypatch.setattr(ARXRegressor, "refitted", lambda *given: fitted.append(1) or refitted(*given))
    np.testing.assert_array_equal(model._each_path(tables, origin, N_LEADS), expected)
    assert len(fitted) == 1
    assert not np.array_equal(expected[0], expected[1])


@pytest.mark.parametrize("n_draws", [8, 48])
def test_few_draws_tell_how_far_a_further_one_may_be_off(n_draws):
    rng, held, share = np.random.default_rng(0), [], 0.95
    for _ in range(300):
        drawn = lfilter([1.0], [1.0, -share], rng.normal(size=(n_draws + 20, 1, N_LEADS))) * np.sqrt(1 - share**2)
        spread = _normal_spread(np.abs(drawn[:n_draws]))
        held.append(np.abs(drawn[n_draws:]) <= 1.2816 * spread)
    assert np.mean(held) == pytest.approx(0.8, abs=0.015)


def test_an_error_of_the_weather_that_no_input_has_is_told_once(office):
    (X, y), roles = _rows(office), ["u_heat", "u_cool", "T_za"]
    model = ARXRegressor().fit(office.X[roles][: 12 * 96], office.y[: 12 * 96])
    for call in (
        lambda: model.predict_quantiles(X[roles], weather_error="low"),
        lambda: backtest(model, X[roles], y, weather_error=WeatherError("low")),
    ):
        with pytest.warns(SkhybridWarning, match="weather_error= does nothing, since the model reads neither") as told:
            call()
        assert len(told) == 1


def test_two_equal_errors_of_the_weather_are_told_of_apart(office):
    errors, roles = [WeatherError("low"), WeatherError("low")], ["u_heat", "u_cool", "T_za"]
    table = read_table(ARXRegressor().fit(office.X[roles], office.y), office.X[roles], reset=False)
    for error in errors:
        with pytest.warns(SkhybridWarning, match="weather_error= does nothing"):
            error.forecast(table, 96, N_LEADS, 0)


def test_other_regressors_are_refused(office, models):
    X, y = _rows(office)
    with pytest.raises(ValueError, match="weather_error needs"):
        backtest(Ridge().fit(X, y), X, y, weather_error="low")
    with pytest.raises(ValueError, match="GrayBoxRC forecasts no quantiles"):
        backtest(models["gray box"], X, y, quantiles=(0.1, 0.9), weather_error="low")
