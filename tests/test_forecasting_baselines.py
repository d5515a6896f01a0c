"""The baselines against hand computation, and the linear forecaster against what it must find."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import Ridge

from skhybrid._last_known import carried_forward, last_known_row
from skhybrid._table import read_table
from skhybrid._time import rows_per_day
from skhybrid.forecasting import BoostedRegressor, DisturbanceForecaster
from skhybrid.forecasting.features import clock_changes, lag_features, same_slot
from skhybrid.forecasting.ridge import ALPHAS, _solve, ridge_by_blocks, time_blocks, training_origins


def _weeks(n_days, seed=0):
    rng = np.random.default_rng(seed)
    time = pd.date_range("2023-07-03", periods=24 * n_days, freq="1h", tz="UTC")
    X = pd.DataFrame({"T_oa": rng.normal(15, 5, len(time)), "q_sol": rng.uniform(0, 1, len(time))}, index=time)
    return X, pd.Series(rng.normal(size=len(time)), index=time)


def test_profile_is_the_mean_by_hour_of_week():
    X, y = _weeks(21)
    model = DisturbanceForecaster("profile").fit(X, y)
    later = _weeks(28)[0].iloc[21 * 24 :]
    by_hand = y.groupby([y.index.day_of_week, y.index.hour]).mean()
    expected = [by_hand[d, h] for d, h in zip(later.index.day_of_week, later.index.hour, strict=True)]
    np.testing.assert_allclose(model.predict(later), expected, rtol=1e-12)


def test_profile_falls_back_to_day_type_and_then_to_the_mean():
    X, y = _weeks(9)  # two Mondays and Tuesdays, one of every other day
    later = _weeks(28)[0].iloc[21 * 24 :]
    predicted = pd.Series(DisturbanceForecaster("profile").fit(X, y).predict(later), index=later.index)
    at_nine = y[y.index.hour == 9]
    weekend = at_nine.index.day_of_week >= 5
    assert predicted.iloc[9] == pytest.approx(at_nine[at_nine.index.day_of_week == 0].mean())  # seen twice
    assert predicted.iloc[3 * 24 + 9] == pytest.approx(at_nine[~weekend].mean())  # a Thursday
    assert predicted.iloc[6 * 24 + 9] == pytest.approx(at_nine[weekend].mean())  # a Sunday
    short = DisturbanceForecaster("profile").fit(X.iloc[:24], y.iloc[:24])
    np.testing.assert_allclose(short.predict(later), y.iloc[:24].mean())


def test_a_value_is_carried_forward_and_never_back():
    values = np.array([np.nan, 5.0, np.nan, 7.0, np.nan])
    np.testing.assert_array_equal(carried_forward(values), [np.nan, 5.0, 5.0, 7.0, 7.0])
    assert last_known_row(np.isfinite(values)).tolist() == [-1, 1, 1, 3, 3]


@pytest.mark.parametrize("missing", range(7))
def test_the_profile_of_a_day_never_measured_is_that_of_its_kind(missing):
    X, y = _weeks(14)
    y = y.mask(y.index.day_of_week == missing)
    predicted = DisturbanceForecaster("profile").fit(X, y).predict(_weeks(21)[0].iloc[14 * 24 :])
    alike = y[(y.index.day_of_week >= 5) == (missing >= 5)]
    by_hand = alike.groupby(alike.index.hour).mean()
    np.testing.assert_allclose(predicted[24 * missing : 24 * (missing + 1)], by_hand)


def test_profile_follows_local_time_and_the_step():
    index = pd.date_range(
        "2023-10-02", periods=96 * 35, freq="15min", tz="Europe/Amsterdam"
    )  # clocks go back on 29 Oct
    X = pd.DataFrame({"T_oa": 10.0, "q_sol": 0.0}, index=index)
    local = index.tz_localize(None)
    y = pd.Series(((local.hour * 4 + local.minute // 15) + 1000 * local.day_of_week).astype(float), index=index)
    model = DisturbanceForecaster("profile").fit(X.iloc[: 96 * 21], y.iloc[: 96 * 21])
    later = X.iloc[96 * 25 :]
    np.testing.assert_array_equal(model.predict(later)[1:], y.loc[later.index][1:])


@pytest.mark.parametrize("begin", ["2024-02-26", "2024-10-21"])  # the clocks change after 13 days
def test_the_same_hour_of_an_earlier_day_is_that_of_the_local_clock(begin):
    index = pd.date_range(begin, periods=28 * 24, freq="1h", tz="America/Chicago")
    X = pd.DataFrame({"T_oa": 5.0, "q_sol": 0.0}, index=index)
    by_week = pd.Series(index.hour + 100.0 * index.day_of_week, index=index)
    begins = np.flatnonzero(index.hour == 0)
    model = DisturbanceForecaster("last_week").fit(X[: begins[8]], by_week[: begins[8]])
    found = model.predict_from(X.assign(zeta=by_week), begins[9:27] - 1)
    beside = index.hour == 2  # there is none when the clocks go forward
    rows = (begins[9:27] - 1)[:, None] + np.arange(1, 25)
    assert ((found == by_week.to_numpy()[rows]) | beside[rows]).all()

    by_day = pd.Series(index.hour.to_numpy(float), index=index)
    lately = X.assign(zeta=by_day.where(index >= index[begins[11]]))  # last week is not known
    assert ((model.predict_from(lately, begins[12:18] - 1) == by_day.to_numpy()[rows[3:9]]) | beside[rows[3:9]]).all()
    table = read_table(BaseEstimator(), X, reset=True)
    features = lag_features(table, by_day.to_numpy(), begins[12:18] - 1, 24)
    for same in (features[..., 6] + features[..., 7], features[..., 8]):
        assert ((same == by_day.to_numpy()[rows[3:9]]) | beside[rows[3:9]]).all()


@pytest.mark.parametrize("begin", ["2024-01-29", "2024-09-23"])  # the clocks change after six weeks, on a Sunday
def test_boosting_reads_the_day_before_by_the_local_clock(begin):
    index = pd.date_range(begin, periods=44 * 24, freq="1h", tz="America/Chicago")
    week = (index.tz_localize(None) - index[0].tz_localize(None)).days // 7
    T = 20.0 + np.random.default_rng(0).normal(size=(7, 24))[week, index.hour]  # every week has another day
    X, n = pd.DataFrame({"T_oa": 5.0, "T_za": T}, index=index), 40 * 24
    model = BoostedRegressor(random_state=0).fit(X[:n], X["T_za"][:n])
    origin = np.flatnonzero(index.hour == 0)[41] - 1
    errors = model.predict_from(X, [origin])[0, 5:23] - T[origin + 6 : origin + 24]
    assert np.abs(errors).mean() < 0.3
    table, origins, leads = read_table(BaseEstimator(), X, reset=True), np.array([origin]), np.arange(1, 25)
    base = T[origin] + leads[None] / 8.0
    features = model._features(table, origins, leads, base)
    np.testing.assert_allclose(features[:, 3:5], np.column_stack([np.full(24, T[origin]), leads / 8.0]))


def test_the_row_of_an_earlier_day_is_known_wherever_the_table_begins():
    index = pd.date_range("2024-03-01", "2024-11-30", freq="15min", tz="America/Chicago")  # both changes of the clock
    table = read_table(BaseEstimator(), pd.DataFrame({"T_oa": 5.0}, index=index), reset=True)
    origins = np.arange(96, table.n_rows - 96)
    rows = origins[:, None] + np.arange(1, 97, 5)
    found = same_slot(rows, origins, 96, clock_changes(table))
    assert (found <= origins[:, None]).all()
    hour, minute = index.hour.to_numpy(), index.minute.to_numpy()
    assert ((hour[found] == hour[rows]) & (minute[found] == minute[rows]) | (hour[rows] == 2)).all()
    first = int(np.flatnonzero(index >= "2024-07-01")[0])
    later = origins >= first + 96
    of_later = clock_changes(table.rows(slice(first, None)))
    moved = same_slot(rows[later] - first, origins[later] - first, 96, of_later)
    np.testing.assert_array_equal(moved + first, found[later])


def test_last_week_repeats_it_and_falls_back_to_the_day_before():
    X, y = _weeks(21)
    zeta = y.copy()
    zeta.iloc[10 * 24 + 5] = np.nan
    model = DisturbanceForecaster("last_week").fit(X.assign(zeta=zeta).iloc[: 14 * 24], y.iloc[: 14 * 24])
    paths = model.predict_from(X.assign(zeta=zeta).iloc[14 * 24 :], [0, 3 * 24 - 1])
    np.testing.assert_array_equal(paths[0], y.iloc[7 * 24 + 1 : 8 * 24 + 1])
    expected = y.iloc[10 * 24 : 11 * 24].to_numpy().copy()
    expected[5] = y.iloc[16 * 24 + 5]  # the value a week before is missing: that of the day before
    np.testing.assert_array_equal(paths[1], expected)
    zeta[(zeta.index.hour == 6) & (zeta.index >= "2023-07-14")] = np.nan  # known eight days before
    profile = DisturbanceForecaster("profile").fit(X.iloc[: 14 * 24], y.iloc[: 14 * 24]).predict(X.iloc[14 * 24 :])
    path = model.predict_from(X.assign(zeta=zeta), [18 * 24 - 1])[0]
    assert path[6] == profile[4 * 24 + 6]


def test_the_end_of_the_training_table_holds_the_last_day_of_each_kind():
    """A Monday after a Monday of holidays is like the one two weeks before, also where no history is given."""
    X, _ = _weeks(36)
    y = pd.Series(X.index.day_of_week.astype(float), X.index)
    y.loc["2023-07-31"] = 6.0  # counts as a Sunday
    model = DisturbanceForecaster("last_week", holidays=["2023-07-31"])
    model.fit(X.assign(zeta=y).loc[:"2023-08-06"], y.loc[:"2023-08-06"])
    np.testing.assert_array_equal(model.forecast(None, X.loc["2023-08-07":"2023-08-07"]), np.zeros(24))


def test_last_week_beyond_a_week_repeats_the_last_known_one():
    X, y = _weeks(35)
    table = X.assign(zeta=y)
    model = DisturbanceForecaster("last_week").fit(table.iloc[: 14 * 24], y.iloc[: 14 * 24])
    path = model.predict_from(table.iloc[14 * 24 :], [0], horizon="9D")[0]
    last = y.iloc[7 * 24 + 1 : 14 * 24 + 1].to_numpy()
    np.testing.assert_array_equal(path, np.concatenate([last, last])[: 9 * 24])


def test_none_expects_nothing_and_corrects_nothing():
    X, y = _weeks(14)
    model = DisturbanceForecaster("none").fit(X, y)
    assert (model.predict_from(X.assign(zeta=y), [30, 60]) == 0.0).all()
    with pytest.raises(ValueError, match="residual_of='none' is not known"):
        DisturbanceForecaster("mlp", residual_of="none").fit(X, y)


def test_persistence_holds_the_last_known_value():
    X, y = _weeks(14)
    zeta = y.copy()
    zeta.iloc[250:253] = np.nan
    model = DisturbanceForecaster("persistence").fit(X.iloc[:200], y.iloc[:200])
    paths = model.predict_from(X.assign(zeta=zeta).iloc[200:][["T_oa", "q_sol"]], [50])
    profile = DisturbanceForecaster("profile").fit(X.iloc[:200], y.iloc[:200])
    np.testing.assert_array_equal(paths[0], np.full(24, y.iloc[199]))  # no zeta in X: the training end is the last
    cold = X.set_axis(X.index + pd.Timedelta("70D"))
    np.testing.assert_array_equal(model.predict(cold), profile.predict(cold))
    model.fit(X.assign(zeta=zeta).iloc[:200], y.iloc[:200])
    paths = model.predict_from(X.assign(zeta=zeta).iloc[200:], [52, 53])
    np.testing.assert_array_equal(paths[:, 0], [y.iloc[249], y.iloc[253]])
    first = model.predict_from(cold.assign(zeta=y.to_numpy()), [0, 1])  # the first row is the only one known, or not
    np.testing.assert_array_equal(first[:, 0], y.iloc[:2])


# ------------------------------------------------------------------------------------------------------------- linear
def test_the_ridge_by_moments_is_scikit_learn_s_ridge():
    rng = np.random.default_rng(0)
    D, blocks = rng.normal(size=(120, 7)) + 3.0, np.repeat(np.arange(4), 30)
    y = D @ rng.normal(size=7) + rng.normal(size=120)
    fit, left_out = ridge_by_blocks(D, y, blocks)
    assert fit.alpha in ALPHAS
    whole = Ridge(fit.alpha).fit(D, y)
    np.testing.assert_allclose(fit.coef, whole.coef_, rtol=1e-8)
    np.testing.assert_allclose(fit.predict(D), whole.predict(D), rtol=1e-8)
    for b in range(4):
        part = Ridge(fit.alpha).fit(D[blocks != b], y[blocks != b])
        np.testing.assert_allclose(left_out[blocks == b], part.predict(D[blocks == b]), rtol=1e-8)


def test_the_penalty_is_the_one_with_the_least_left_out_error():
    rng = np.random.default_rng(1)
    D, blocks = rng.normal(size=(60, 20)), np.repeat(np.arange(3), 20)
    y = D[:, 0] + 3 * rng.normal(size=60)
    errors = []
    for alpha in ALPHAS:
        parts = [Ridge(alpha).fit(D[blocks != b], y[blocks != b]).predict(D[blocks == b]) for b in range(3)]
        errors.append(np.mean((np.concatenate(parts) - y) ** 2))
    assert ridge_by_blocks(D, y, blocks)[0].alpha == ALPHAS[int(np.argmin(errors))]
    assert _solve(np.eye(4), ALPHAS)[1].shape == (len(ALPHAS), 2)


def test_blocks_of_time_are_weeks_from_the_end_or_days_of_a_short_table():
    for n_days, expected in ((24, [2] * 10 + [1] * 7 + [0] * 7), (3, [2, 1, 0])):
        table = read_table(BaseEstimator(), _weeks(n_days)[0], reset=True)
        np.testing.assert_array_equal(time_blocks(table), np.repeat(expected, 24))


def _regular(n_days, seed=0):
    """Weekday gains, an effect of weather and a slow deviation."""
    X, noise = _weeks(n_days, seed)
    hour, weekend = X.index.hour, X.index.day_of_week >= 5
    slow = noise.ewm(halflife=12).mean()
    y = 2.0 * ((hour >= 8) & (hour < 18) & ~weekend) - 0.2 * (X["T_oa"] - 15) + 3 * X["q_sol"] + 2 * slow
    return X, y, slow


def test_ridge_finds_calendar_and_weather_and_corrects_by_what_is_known():
    X, y, slow = _regular(56)
    cut = 42 * 24
    table = X.assign(zeta=y)
    model = DisturbanceForecaster("ridge").fit(table.iloc[:cut], y.iloc[:cut])
    origins = np.arange(0, 13 * 24, 5)
    rows = origins[:, None] + np.arange(1, 25)
    truth = y.iloc[cut:].to_numpy()[rows]
    warm = model.predict_from(table.iloc[cut:], origins) - truth
    cold = model.predict_from(table.iloc[cut:].assign(zeta=np.nan), origins) - truth
    unknown = 2 * slow.iloc[cut:].to_numpy()[rows]
    assert np.sqrt((cold**2).mean()) < 1.05 * np.sqrt((unknown**2).mean())  # all but the slow part is found
    assert np.sqrt((warm[:, 0] ** 2).mean()) < 0.8 * np.sqrt((cold[:, 0] ** 2).mean())
    assert np.sqrt((warm**2).mean()) < np.sqrt((cold**2).mean())


def test_the_recent_past_is_the_mean_of_what_is_known_of_it():
    X, zeta = _weeks(14)
    table = read_table(BaseEstimator(), X, reset=True)
    known, origin, leads = zeta.where(zeta.index.hour != 3), 10 * 24 + 8, np.arange(1.0, 25.0)
    features = lag_features(table, known.to_numpy(), np.array([origin]), 24)[0]
    last, hours, day, week = (known.iloc[max(origin + 1 - n, 0) : origin + 1].mean() for n in (1, 6, 24, 7 * 24))
    expected = [last * np.exp(-leads / 2), last * np.exp(-leads / 8), hours * np.exp(-leads / 8)]
    expected += [day * np.exp(-leads / 24), np.full(24, day), np.full(24, week)]
    np.testing.assert_allclose(features[:, :6].T, expected)
    begun = lag_features(table, known.to_numpy(), np.array([3]), 1)[0, 0]  # the row itself is not known
    np.testing.assert_allclose(begun[[0, 4, 5]], [0.0, known.iloc[:3].mean(), known.iloc[:3].mean()])


def test_a_day_ahead_is_compared_with_the_kind_of_the_day_that_is_known():
    """From a Friday on, all of the weekend is compared with Friday, Monday to Friday too, and Saturday week apart."""
    X, zeta = _weeks(14)
    table = read_table(BaseEstimator(), X, reset=True)
    friday = np.array([5 * 24 - 1])  # its last row
    same, unlike = lag_features(table, zeta.to_numpy(), friday, 8 * 24)[0, :, 6:8].T
    known = np.tile(zeta.to_numpy()[4 * 24 : 5 * 24], 8)
    weekend = np.repeat([True, True, False, False, False, False, False, True], 24)
    np.testing.assert_array_equal(same, np.where(weekend, 0.0, known))
    np.testing.assert_array_equal(unlike, np.where(weekend, known, 0.0))


@pytest.mark.parametrize("step", ["15min", "1h", "2h"])
@pytest.mark.parametrize("n_rows", [500, 9_000, 40_000])
def test_origins_that_are_learned_from_are_of_every_hour(n_rows, step):
    stamps = pd.date_range("2023-01-02", periods=n_rows, freq=step)
    table = read_table(BaseEstimator(), pd.DataFrame({"T_oa": 5.0}, stamps), reset=True)
    n_leads = rows_per_day(table.step)
    origins = training_origins(table, n_leads)
    assert len(origins) * n_leads <= 150_000
    assert set(stamps[origins].hour) == set(stamps.hour)


def test_a_regressor_is_cloned_seeded_and_near_the_linear_one():
    X, y, _ = _regular(42)
    table, cut = X.assign(zeta=y), 35 * 24
    given = Ridge(1.0)
    model = DisturbanceForecaster(given, random_state=3).fit(table.iloc[:cut], y.iloc[:cut])
    assert not hasattr(given, "coef_")
    assert given.random_state is None
    assert model.regressor_.random_state == 3
    linear = DisturbanceForecaster("ridge").fit(table.iloc[:cut], y.iloc[:cut])
    errors = [np.sqrt(((m.predict(table.iloc[cut:]) - y.iloc[cut:]) ** 2).mean()) for m in (model, linear)]
    assert errors[0] < 1.2 * errors[1]
    assert model.set_params(model__alpha=5.0).model.alpha == 5.0
    assert not hasattr(model.set_params(model="profile").fit(table, y), "regressor_")


class Predicts(RegressorMixin, BaseEstimator):
    """Predicts what ``values`` makes of the number of rows."""

    def __init__(self, values):
        self.values = values

    def fit(self, X, y):
        return self

    def predict(self, X):
        return self.values(len(X))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            lambda n: np.zeros(n - 1),
            r"what Predicts predicts for \d+ rows has the shape \(\d+,\); return a number per row",
        ),
        (lambda n: None, "what Predicts predicts is None"),
        (lambda n: np.where(np.arange(n) < 2, np.nan, 0.0), r"Predicts predicts NaN or inf in 2 of \d+ rows"),
    ],
    ids=["short", "none", "missing"],
)
def test_a_regressor_of_ones_own_forecasts_every_row(values, said):
    X, y = _weeks(2)
    forecaster = DisturbanceForecaster(Predicts(values)).fit(X, y)
    with pytest.raises(ValueError, match=said):
        forecaster.predict(X)
