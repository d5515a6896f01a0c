"""Splits keep the order of time, and a back-test forecasts what the estimator forecasts."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import HistGradientBoostingRegressor, VotingRegressor
from sklearn.exceptions import NotFittedError
from sklearn.experimental import enable_halving_search_cv  # noqa: F401 - makes the class below importable
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, HalvingGridSearchCV, cross_val_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from skhybrid import ARXRegressor
from skhybrid.exceptions import SkhybridWarning, UnitWarning
from skhybrid.model_selection import DayAheadScorer, RollingOriginSplit, backtest, day_ahead_scorer, score_backtest
from skhybrid.model_selection.backtest import _origins

PER_DAY = 24


def _table(n_days=10, start="2024-01-01", tz=None, freq="1h"):
    index = pd.date_range(start, periods=n_days * PER_DAY, freq=freq, tz=tz)
    rows = np.arange(len(index), dtype=float)
    return pd.DataFrame({"T_oa": rows, "T_za": rows + 100}, index=index), pd.Series(rows + 100, index=index)


class CountsFromOrigin(RegressorMixin, BaseEstimator):
    """Forecasts 1000 * (history at the origin) + lead: shows from which row a forecast was made."""

    sampling_time = "1h"

    def fit(self, X, y):
        self.fitted_ = True
        return self

    def predict_from(self, X, origins, horizon=None):
        n_leads = round(pd.Timedelta(horizon) / pd.Timedelta("1h"))
        column = X["T_za"] if isinstance(X, pd.DataFrame) else pd.Series(X[:, 1])
        known = column.to_numpy()[np.asarray(origins)]
        return 1000 * known[:, None] + np.arange(1, n_leads + 1)


# ------------------------------------------------------------------------------------------------------------ splits
@pytest.mark.parametrize("expanding", [False, True])
def test_blocks_are_contiguous_ordered_and_apart(expanding):
    X, _ = _table(20)
    cv = RollingOriginSplit(train="7D", test="2D", gap="1D", expanding=expanding)
    splits = list(cv.split(X))
    assert len(splits) == cv.get_n_splits(X) == 6
    for k, (train, test) in enumerate(splits):
        first = 0 if expanding else 2 * PER_DAY * k
        np.testing.assert_array_equal(train, np.arange(first, (7 + 2 * k) * PER_DAY))
        np.testing.assert_array_equal(test, np.arange((8 + 2 * k) * PER_DAY, (10 + 2 * k) * PER_DAY))


def test_lengths_may_be_numbers_of_rows_and_the_newest_splits_are_kept():
    every = list(RollingOriginSplit(train=10, test=3, gap=2, step=4).split(np.zeros((40, 1))))
    newest = list(RollingOriginSplit(train=10, test=3, gap=2, step=4, n_splits=2).split(np.zeros((40, 1))))
    assert [int(test[0]) for _, test in every] == [12, 16, 20, 24, 28, 32, 36]
    assert [test.tolist() for _, test in newest] == [test.tolist() for _, test in every[-2:]]


@pytest.mark.parametrize(("begin", "of_change"), [("2024-03-01", PER_DAY - 1), ("2024-10-25", PER_DAY + 1)])
def test_blocks_of_days_keep_the_time_of_day_when_the_clocks_change(begin, of_change):
    X, _ = _table(20, begin, "America/Chicago")
    splits = list(RollingOriginSplit(train="7D", test="1D", gap="1D").split(X))
    for k, (train, test) in enumerate(splits):
        begins = [X.index[rows[0]] for rows in (train, test)]
        assert begins == [X.index[0] + pd.DateOffset(days=days) for days in (k, k + 8)]
        assert k == 0 or test[0] == splits[k - 1][1][-1] + 1
    assert {len(test) for _, test in splits} == {PER_DAY, of_change}
    in_rows = list(RollingOriginSplit(train=7 * PER_DAY, test=PER_DAY).split(X))
    assert [len(test) for _, test in in_rows] == [PER_DAY] * 13
    numpys = list(RollingOriginSplit(train=np.timedelta64(7, "D"), test="1D", gap="1D").split(X))
    assert [len(train) for train, _ in numpys] == [len(train) for train, _ in splits]


def test_a_block_that_is_scored_for_an_hour_is_warned_of():
    X, y = _table(3)
    model = CountsFromOrigin().fit(X, y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        day_ahead_scorer(model, X, y)
    with pytest.warns(SkhybridWarning, match=r"from 20.* on is short: .* over 1 h of their horizon of 24 h; make"):
        day_ahead_scorer(model, X[22:26], y[22:26])
    with pytest.warns(SkhybridWarning, match="over 10 h of their horizon of 24 h"):
        day_ahead_scorer(model, X[22:35], y[22:35])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        day_ahead_scorer(model, X[22:37], y[22:37])  # half of it


def test_a_scorer_of_quantiles_needs_two():
    X, y = _table(2)
    with pytest.raises(ValueError, match=r"quantiles=\(0.5,\) must be at least two, such as \(0.1, 0.9\), or None"):
        DayAheadScorer(quantiles=(0.5,))(None, X, y)


def test_an_array_takes_the_given_sampling_time_and_a_table_its_own():
    X, _ = _table(4)
    by_index = list(RollingOriginSplit(train="2D", test="1D", sampling_time="15min").split(X))
    with pytest.raises(ValueError, match=r"no two time stamps, by which test='1D' would be rows; .*sampling_time="):
        list(RollingOriginSplit(train="2D", test="1D").split(X.to_numpy()))
    with pytest.raises(ValueError, match="give it a DatetimeIndex and more rows"):
        list(RollingOriginSplit(train="2D", test="1D").split(X[:1]))
    by_argument = list(RollingOriginSplit(train="2D", test="1D", sampling_time="1h").split(X.to_numpy()))
    for (a, b), (c, d) in zip(by_index, by_argument, strict=True):
        np.testing.assert_array_equal(a, c)
        np.testing.assert_array_equal(b, d)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"train": "28D"}, r"too short.*29 days.*28D.*10 days"),
        ({"train": "5D", "n_splits": 9}, "9 splits need"),
        ({"train": "90min"}, "train='90min' is not a positive multiple"),
        ({"train": 0}, "train=0 must be at least 1"),
        ({"gap": -1}, "gap=-1"),
        ({"n_splits": 0}, "n_splits=0"),
        ({"train": "5D", "n_splits": 2.7}, "n_splits=2.7 must be an integer"),
        ({"train": "5D", "n_splits": "a"}, "n_splits='a' must be an integer"),
        ({"train": "5D", "n_splits": True}, "n_splits=True must be an integer"),
        ({"train": "5D", "expanding": "no"}, "expanding='no' must be True or False"),
    ],
)
def test_a_split_that_cannot_be_made_says_why(kwargs, message):
    X, _ = _table(10)
    with pytest.raises(ValueError, match=message):
        list(RollingOriginSplit(**kwargs).split(X))


def test_the_number_of_splits_needs_a_table_or_a_number():
    assert RollingOriginSplit(n_splits=3).get_n_splits() == 3
    with pytest.raises(ValueError, match="pass X"):
        RollingOriginSplit().get_n_splits()
    with pytest.raises(ValueError, match=r"n_splits=2\.7 must be an integer"):
        RollingOriginSplit(n_splits=2.7).get_n_splits()


def test_it_serves_a_grid_search_in_two_processes():
    X, y = _table(10)
    cv = RollingOriginSplit(train="5D", test="1D")
    scores = [
        GridSearchCV(Ridge(), {"alpha": [0.1, 10.0]}, cv=cv, n_jobs=n).fit(X, y).cv_results_["mean_test_score"]
        for n in (1, 2)
    ]
    np.testing.assert_array_equal(*scores)
    assert "train='5D'" in repr(cv)


# --------------------------------------------------------------------------------------------------------- back-tests
def test_every_origin_and_lead_has_a_row_and_the_right_measurement():
    X, y = _table(5)
    frame = backtest(CountsFromOrigin().fit(X, y), X, y)
    assert list(frame.columns) == ["origin", "lead", "time", "y_true", "y_pred"]
    assert len(frame) == 4 * PER_DAY  # the fifth day's horizon ends beyond X
    assert (frame["time"] == frame["origin"] + frame["lead"]).all()
    np.testing.assert_array_equal(frame["y_true"], y.loc[frame["time"]])
    expected = 1000 * y.loc[frame["origin"]].to_numpy() + frame["lead"] / pd.Timedelta("1h")
    np.testing.assert_array_equal(frame["y_pred"], expected)


@pytest.mark.parametrize(
    ("origin_step", "expected_hours"),
    [("1D", [19, 43]), ("12h", [19, 31, 43, 55]), ("2D", [19]), ("25h", [0, 25, 50]), ("5h", list(range(0, 56, 5)))],
)
def test_origins_follow_the_stated_rule(origin_step, expected_hours):
    X, y = _table(n_days=4, start="2024-01-01 05:00")
    X, y = X[:80], y[:80]
    frame = backtest(CountsFromOrigin().fit(X, y), X, y, origin_step=origin_step)
    hours = (pd.Index(frame["origin"].unique()) - X.index[0]) / pd.Timedelta("1h")
    assert list(hours) == expected_hours


@pytest.mark.parametrize("day", ["2024-03-31", "2024-10-27"])
def test_origins_are_local_midnights_across_a_change_of_clocks(day):
    index = pd.date_range(pd.Timestamp(day, tz="Europe/Amsterdam") - pd.Timedelta("2D"), periods=6 * 24, freq="1h")
    X = pd.DataFrame({"T_oa": 0.0, "T_za": 1.0}, index=index)
    frame = backtest(CountsFromOrigin().fit(X, None), X, X["T_za"])
    origins = pd.DatetimeIndex(frame["origin"].unique())
    assert (origins == origins.normalize()).all()
    assert len(origins) == (6 if day == "2024-03-31" else 5)  # a day of 23 hours, or one of 25


def test_rows_before_the_start_are_history_only():
    X, y = _table(6)
    frame = backtest(CountsFromOrigin().fit(X, y), X, y, origin_step="25h", start="2024-01-03 02:00")
    assert frame["origin"].iloc[0] == pd.Timestamp("2024-01-03 02:00")
    assert frame["y_pred"].iloc[0] == 1000 * y.loc["2024-01-03 02:00"] + 1


def test_an_array_is_numbered_by_rows():
    X, y = _table(3)
    frame = backtest(CountsFromOrigin().fit(X, y), X.to_numpy(), y.to_numpy())
    assert frame["origin"].unique().tolist() == [0, 24]
    assert frame["time"].iloc[0] == 1
    assert frame["lead"].iloc[1] == pd.Timedelta("2h")


def test_a_number_by_itself_is_not_taken_for_rows():
    with pytest.raises(TypeError, match="positional"):
        RollingOriginSplit(2)  # the number of splits comes first elsewhere


def test_a_pipeline_and_a_search_are_looked_into():
    X, y = _table(6)
    doubled = Pipeline([("scale", StandardScaler(with_mean=False).set_output(transform="pandas"))])
    pipe = Pipeline([*doubled.steps, ("model", CountsFromOrigin())]).fit(X, y)
    frame = backtest(pipe, X, y)
    scaled = pipe[:-1].transform(X)["T_za"]
    expected = 1000 * scaled.loc[frame["origin"]].to_numpy() + frame["lead"] / pd.Timedelta("1h")
    np.testing.assert_allclose(frame["y_pred"], expected)
    weather = X[["T_oa"]]
    search = GridSearchCV(Ridge(), {"alpha": [1e-9]}, cv=RollingOriginSplit(train="3D", test="1D")).fit(weather, y)
    frame = backtest(search, weather, y)
    np.testing.assert_allclose(frame["y_pred"], frame["y_true"], atol=1e-6)


def test_a_plain_regressor_gives_its_predictions_at_every_lead():
    X, y = _table(4)
    frame = backtest(LinearRegression().fit(X[["T_oa"]], y), X[["T_oa"]], y, horizon="6h", origin_step="6h")
    np.testing.assert_allclose(frame["y_pred"], frame["y_true"])


class Predicts(RegressorMixin, BaseEstimator):
    """Predicts what ``values`` makes of the number of rows."""

    def __init__(self, values):
        self.values = values

    def fit(self, X, y):
        self.fitted_ = True
        return self

    def predict(self, X):
        return self.values(len(X))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (lambda n: np.zeros(n - 1), r"for 96 rows has the shape \(95,\); return a number per row"),
        (lambda n: np.zeros((n, 2)), r"for 96 rows has the shape \(96, 2\)"),
        (lambda n: None, "is None"),
        (lambda n: ["warm"] * n, "is text"),
    ],
    ids=["short", "wide", "none", "text"],
)
def test_a_plain_regressor_predicts_a_number_per_row(values, said):
    X, y = _table(4)
    with pytest.raises(ValueError, match=f"what Predicts predicts {said}"):
        backtest(Predicts(values).fit(X, y), X[["T_oa"]], y)
    frame = backtest(Predicts(lambda n: np.full((n, 1), 20.0)).fit(X, y), X[["T_oa"]], y)
    assert (frame["y_pred"] == 20.0).all()


class ReadsTheRoom(RegressorMixin, BaseEstimator):
    """Gives the measured temperature of the row that it forecasts, or of a row before, and names no columns."""

    def __init__(self, rows_before=0):
        self.rows_before = rows_before

    def fit(self, X, y):
        self.fitted_ = True
        return self

    def predict(self, X):
        known = X["T_za"] if isinstance(X, pd.DataFrame) else pd.Series(X[:, 1])
        return known.shift(self.rows_before).bfill().to_numpy()


def _room(n_days=6):
    """A table whose room temperature follows nothing else."""
    X, _ = _table(n_days)
    rng = np.random.default_rng(0)
    X["T_oa"] = 5.0 * rng.normal(size=len(X))
    X["T_za"] = 20.0 + 0.1 * rng.normal(size=len(X)).cumsum()
    return X, X["T_za"].rename("y")


def _lagged(n_rows):
    return FunctionTransformer(lambda X: X.assign(lag=X["T_za"].shift(n_rows).bfill()).drop(columns="T_za"))


@pytest.mark.parametrize(
    "model",
    [
        LinearRegression(),
        make_pipeline(StandardScaler(), LinearRegression()),
        make_pipeline(StandardScaler().set_output(transform="pandas"), LinearRegression()),
        GridSearchCV(make_pipeline(StandardScaler(), Ridge()), {"ridge__alpha": [1e-9]}, cv=2),
        make_pipeline(_lagged(PER_DAY - 1), LinearRegression()),
        HistGradientBoostingRegressor(max_iter=3),
        ReadsTheRoom(),
        ReadsTheRoom(PER_DAY - 1),
    ],
    ids=["regressor", "array", "frame", "search", "lag", "trees", "own", "own, lagged"],
)
def test_a_plain_regressor_may_not_read_what_is_measured_after_an_origin(model):
    X, y = _room()
    model.fit(X, y)
    with pytest.raises(
        ValueError, match=r"has no predict_from, .* reads column 'T_za' of X, .*: drop it, or give it lag"
    ):
        backtest(model, X, y)
    with pytest.raises(ValueError, match="reads column 'T_za' of X"):
        day_ahead_scorer(model, X, y)


def test_the_measured_temperature_is_known_by_its_values_too():
    X, y = _room()
    named = X.rename(columns={"T_za": "room"})
    with pytest.raises(ValueError, match="reads column 'room' of X"):
        backtest(LinearRegression().fit(named, y), named, y)
    model = LinearRegression().fit(X.to_numpy(), y)
    model.sampling_time = "1h"
    with pytest.raises(ValueError, match="reads column '1' of X"):
        backtest(model, X.to_numpy(), y.to_numpy())
    fahrenheit = X.to_numpy() * [1.0, 1.8] + [0.0, 32.0]
    with pytest.raises(ValueError, match="reads column '1' of X"):
        backtest(model, fahrenheit, y.to_numpy())
    named["room"] = 1.8 * named["room"] + 32.0
    with pytest.raises(ValueError, match="reads column 'room' of X"):
        backtest(LinearRegression().fit(named, y), named, y)


def test_a_column_that_holds_an_earlier_measurement_must_lag_by_the_horizon():
    X, y = _room()
    for lag in (1, PER_DAY - 1):
        lagged = X.drop(columns="T_za").assign(earlier=y.shift(lag).bfill())
        model = LinearRegression().fit(lagged, y)
        with pytest.raises(ValueError, match="reads column 'earlier' of X"):
            backtest(model, lagged, y)
        assert len(backtest(model, lagged, y, horizon=lag * pd.Timedelta("1h")))
        lagged.loc[:, "earlier"] = lagged["earlier"].mean()
        assert len(backtest(LinearRegression().fit(lagged, y), lagged, y))
    lagged["earlier"] = y.shift(PER_DAY).bfill()
    assert len(backtest(LinearRegression().fit(lagged, y), lagged, y))


@pytest.mark.parametrize(
    "model",
    [
        make_pipeline(_lagged(PER_DAY), LinearRegression()),
        make_pipeline(ColumnTransformer([("weather", "passthrough", ["T_oa"])]), LinearRegression()),
        ReadsTheRoom(PER_DAY),
        VotingRegressor([("arx", ARXRegressor(sampling_time="1h")), ("same", ARXRegressor(sampling_time="1h"))]),
    ],
    ids=["lag", "selection", "own, lagged", "vote"],
)
def test_a_plain_regressor_may_read_what_was_measured_up_to_the_origin(model):
    X, y = _room()
    frame = backtest(model.fit(X, y), X, y)
    assert len(frame) == 5 * PER_DAY
    assert score_backtest(frame)["rmse"] > 0.01


@pytest.mark.parametrize(
    "model", [ARXRegressor(), CountsFromOrigin(), LinearRegression()], ids=lambda m: type(m).__name__
)
def test_a_target_of_one_column_is_a_target(model):
    X, y = _room()
    rows = X[["T_oa"]] if isinstance(model, LinearRegression) else X
    wanted = backtest(model.fit(rows, y), rows, y)
    pd.testing.assert_frame_equal(backtest(model, rows, y.to_frame()), wanted)
    pd.testing.assert_frame_equal(backtest(model.fit(rows, y.to_frame()), rows, y.to_numpy()[:, None]), wanted)
    with pytest.raises(ValueError, match=r"y has the shape \(144, 2\)"):
        backtest(model, rows, y.to_frame().assign(twice=y))
    cv = RollingOriginSplit(train="3D", test="2D")
    scores = [cross_val_score(model, rows, target, cv=cv, scoring=day_ahead_scorer) for target in (y, y.to_frame())]
    assert np.isfinite(scores[0]).all()
    np.testing.assert_array_equal(*scores)


def test_missing_measurements_are_kept_and_not_scored():
    X, y = _table(4)
    y.iloc[30:35] = np.nan
    weather = X[["T_oa"]]
    frame = backtest(LinearRegression().fit(weather, X["T_oa"]), weather, y)
    assert frame["y_true"].isna().sum() == 5
    assert score_backtest(frame)["n"] == len(frame) - 5


def test_a_backtest_compares_with_the_rows_of_x():
    X, y = _table(6)
    model = CountsFromOrigin().fit(X, y)
    with pytest.raises(ValueError, match="different time stamps"):
        backtest(model, X, y.shift(1, freq="1h"))
    hidden = np.ma.masked_array(y.to_numpy(), np.arange(len(y)) % 2 == 0)
    assert backtest(model, X, hidden)["y_true"].isna().mean() == 0.5


def test_a_backtest_warns_of_measurements_in_another_unit():
    X, y = _room()
    model = ARXRegressor().fit(X, y)
    with pytest.warns(UnitWarning, match="^y ranges from .*: likely degF rather than degC"):
        backtest(model, X.assign(T_za=np.nan), y * 1.8 + 32.0)
    with pytest.raises(ValueError, match="y holds -999 degC in 1 row"):
        backtest(model, X, y.where(np.arange(len(y)) != 50, -999.0))


def test_a_backtest_refuses_measurements_that_are_not_the_past_in_x():
    """Forecasts begin from T_za of X, so that y of other rows gave errors of nothing; ``score`` refused it."""
    X, y = _room()
    model = ARXRegressor().fit(X, y)
    for wrong, match in (
        (y * 1.8 + 32.0, "likely y is in degF"),
        (y.shift(1).bfill(), "role 'T_za' of X is y one row later"),
    ):
        for scored in (lambda y: backtest(model, X, y), lambda y: model.score(X, y)):
            with pytest.raises(ValueError, match=match):
                scored(wrong)
    shuffled, match = y.sample(frac=1.0, random_state=0).set_axis(y.index), "they do not move together"
    with pytest.raises(ValueError, match=match):
        backtest(model, X, shuffled)
    with pytest.warns(SkhybridWarning, match=match):
        assert model.score(X, shuffled) < 0.0


def test_a_halving_search_over_rows_is_told_that_it_shuffles_them():
    """The splitter to which the refusal pointed was in use already: the search itself draws rows from its splits."""
    X, y = _room()
    search = HalvingGridSearchCV(ARXRegressor(), {"alpha": [0.1, 1.0]}, cv=RollingOriginSplit(train="2D"), factor=2)
    with pytest.raises(ValueError, match=r"shuffled \(a halving search over n_samples .*use GridSearchCV"):
        search.fit(X, y)


def test_a_backtest_that_cannot_be_made_says_why():
    X, y = _table(4)
    with pytest.raises(NotFittedError):
        backtest(CountsFromOrigin(), X, y)
    model = CountsFromOrigin().fit(X, y)
    with pytest.raises(ValueError, match="X has 96 rows, but y has the shape"):
        backtest(model, X, y[:-1])
    with pytest.raises(
        ValueError, match=r"too short to be forecast: 19 rows follow the first origin, row 0, and .* needs 24"
    ):
        backtest(model, X[:20], y[:20])
    with pytest.raises(ValueError, match="y has no value in 96 rows"):
        backtest(model, X, y * np.nan)
    with pytest.raises(ValueError, match="origin_step='90min'"):
        backtest(model, X, y, origin_step="90min")
    with pytest.raises(ValueError, match="whole='no' must be True or False"):
        backtest(model, X, y, whole="no")


def test_a_start_that_the_clock_repeats_says_why():
    X, y = _table(4)
    index = pd.date_range("2023-10-28", periods=len(X), freq="1h", tz="Europe/Berlin")
    X, y = X.set_axis(index), y.set_axis(index)
    with pytest.raises(ValueError, match="02:30' is skipped or repeated by the clock of Europe/Berlin; give"):
        backtest(CountsFromOrigin().fit(X, y), X, y, start="2023-10-29 02:30")


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ("NaT", "start='NaT' is not a time stamp; give one, such as '2024-01-01 00:00:00'."),
        ("noon", "start='noon' is not a time stamp; "),
        ("2024-01-02 00:00+01:00", "has a time zone, but X has none; "),
        ("2024-02-01", "start='2024-02-01' comes after the last row of X; "),
        ("2024-01-04 01:00", "X has no local midnight (from start on), from which origins are counted; "),
    ],
)
def test_a_start_that_is_no_row_says_why(start, said):
    X, y = _table(4)
    with pytest.raises(ValueError) as error:
        backtest(CountsFromOrigin().fit(X, y), X, y, start=start)
    assert said in str(error.value)


def test_stamps_beside_midnight_are_named():
    X, y = _table(4, start="2024-01-01 00:07")
    model = CountsFromOrigin().fit(X, y)
    with pytest.raises(ValueError, match="X has no local midnight"):
        backtest(model, X, y)
    assert backtest(model, X, y, origin_step="25h")["origin"].iloc[0] == X.index[0]
    model = CountsFromOrigin().fit(X.to_numpy(), y.to_numpy())
    with pytest.raises(ValueError, match="start='2024' is not a row number, but X has no time stamps"):
        backtest(model, X.to_numpy(), y.to_numpy(), start="2024")


def test_errors_are_those_of_their_definition():
    lead = pd.to_timedelta([1, 2, 1, 2], unit="h")
    frame = pd.DataFrame({"origin": [0, 0, 1, 1], "lead": lead, "y_true": [0.0] * 4, "y_pred": [3.0, -4.0, 0.0, 1.0]})
    whole = score_backtest(frame)
    assert whole["rmse"] == pytest.approx(np.sqrt(26 / 4))
    assert whole["mae"] == pytest.approx(2.0)
    by_lead = score_backtest(frame, by="lead")
    np.testing.assert_allclose(by_lead["rmse"], [np.sqrt(4.5), np.sqrt(8.5)])
    np.testing.assert_allclose(by_lead["n"], [2, 2])
    with pytest.raises(ValueError, match="by='day'"):
        score_backtest(frame, by="day")


def test_a_table_without_a_midnight_has_origins_by_the_row_only():
    X, _ = _table(2, start="2024-01-01 00:30")
    step = pd.Timedelta("1h")
    assert len(_origins(X.index, step, "1D", 0)) == 0
    assert _origins(X.index, step, "25h", 3).tolist() == [3, 28]
