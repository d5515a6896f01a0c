"""DesignMatrixSearchCV in one process: it is GridSearchCV, with a memory and without repeated identifications."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.compose import make_column_transformer
from sklearn.exceptions import FitFailedWarning
from sklearn.linear_model import Lasso, LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from skhybrid import ARXRegressor, DisturbanceForecaster, HybridPredictor, OutputDisturbanceID, _table
from skhybrid.datasets import make_office
from skhybrid.forecasting import ModelCase, list_cases
from skhybrid.model_selection import DesignMatrixSearchCV, RollingOriginSplit, design_matrix
from skhybrid.model_selection.search import candidates, runner, tasks
from skhybrid.parallel import shared
from skhybrid.persistence import load_model, save_model

CV = RollingOriginSplit(train="8D", test="2D", n_splits=2)
SIZE = {"hidden_size": [3, 4]}
RMSE = "neg_root_mean_squared_error"


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=12, sampling_time="1h", random_state=1)


@pytest.fixture(scope="module")
def estimator(office):
    gray_box = OutputDisturbanceID(known=office.theta, n_starts=1, random_state=0)
    return HybridPredictor(gray_box, DisturbanceForecaster(max_epochs=2, residual_of=None), random_state=0)


@pytest.fixture
def count(monkeypatch):
    """Number of calls in this process, by kind."""
    counts = {"identify": 0, "tasks": 0, "networks": 0}

    def counted(name, function, weight):
        def call(*args, **kwargs):
            counts[name] += weight(*args)
            return function(*args, **kwargs)

        return call

    monkeypatch.setattr(runner, "identify", counted("identify", runner.identify, lambda *args: 1))
    monkeypatch.setattr(
        runner, "evaluate", counted("tasks", runner.evaluate, lambda p, network, given, *rest: len(given))
    )
    fit = counted("networks", OutputDisturbanceID.fit, lambda *args: 1)
    monkeypatch.setattr(OutputDisturbanceID, "fit", fit)
    return counts


def assert_same_scores(found, wanted):
    names = [name for name in wanted if "_test_" in name or name == "params" or name.startswith("param_")]
    assert len(names) >= 7
    for name in names:
        if name.startswith("param"):
            assert repr(list(found[name])) == repr(list(wanted[name]))
        else:
            np.testing.assert_array_equal(found[name], wanted[name], err_msg=name)


class Breaks(RegressorMixin, BaseEstimator):
    """A regressor that fails on some tables."""

    def __init__(self, message="no luck", from_rows=0):
        self.message = message
        self.from_rows = from_rows

    def fit(self, X, y):
        if len(X) >= self.from_rows:
            raise RuntimeError(self.message)
        self.mean_ = y.mean()
        return self

    def predict(self, X):
        return np.full(len(X), self.mean_)


# ------------------------------------------------------------------------------------------------ against GridSearchCV
def test_it_equals_grid_search_to_the_bit(office, estimator, count):
    matrix = design_matrix(["mlp", "lstm", "ridge"], ["case01"], size=SIZE)
    search = DesignMatrixSearchCV(estimator, matrix, cv=CV, scoring=RMSE, verbose=0).fit(office.X, office.y)
    assert count == {"identify": 2, "tasks": 2 * len(matrix), "networks": 3}  # one a split, and the refit
    grid = GridSearchCV(estimator, matrix.param_grid(), cv=CV, scoring=RMSE).fit(office.X, office.y)
    assert_same_scores(search.cv_results_, grid.cv_results_)
    assert (search.best_index_, search.best_params_, search.best_score_) == (
        grid.best_index_,
        grid.best_params_,
        grid.best_score_,
    )
    assert list(search.cv_results_) == list(grid.cv_results_)
    np.testing.assert_array_equal(search.predict(office.X), grid.predict(office.X))
    assert search.score(office.X, office.y) == grid.score(office.X, office.y)
    pd.testing.assert_frame_equal(search.results_[matrix.table.columns], matrix.table)
    np.testing.assert_allclose(search.results_["rmse"], -grid.cv_results_["mean_test_score"], rtol=1e-12)
    np.testing.assert_allclose(search.results_["split1_rmse"], -grid.cv_results_["split1_test_score"], rtol=1e-12)
    assert search.results_["n_epochs"][:8].tolist() == [2.0] * 8
    assert search.results_["n_epochs"][8:].isna().all()


def test_parts_by_default_and_an_adapting_scheme_equal_too(office, estimator):
    estimator = HybridPredictor(clone(estimator.gray_box), adapt="linear", random_state=3)
    matrix = design_matrix(["ridge", "profile", "mlp"], ["case01"], "output", {"hidden_size": [3], "max_epochs": [2]})
    given = {"cv": CV, "scoring": [RMSE, "r2"], "refit": "r2"}
    search = DesignMatrixSearchCV(estimator, matrix, **given, verbose=0).fit(office.X, office.y)
    grid = GridSearchCV(estimator, matrix.param_grid(), **given).fit(office.X, office.y)
    assert_same_scores(search.cv_results_, grid.cv_results_)
    assert search.best_params_ == grid.best_params_
    assert set(search.scorer_) == {RMSE, "r2"}


def test_a_pipeline_and_any_regressor_equal_too(office, estimator, count):
    pipeline = make_pipeline(FunctionTransformer(lambda X: X.assign(T_oa=X["T_oa"].round())), clone(estimator))
    matrix = design_matrix(["mlp"], ["case01"], size=SIZE)
    search = DesignMatrixSearchCV(pipeline, matrix, cv=CV, scoring=RMSE, refit=False, verbose=0).fit(office.X, office.y)
    assert count["networks"] == 2
    grid = matrix.param_grid("hybridpredictor__forecaster__")
    assert_same_scores(
        search.cv_results_,
        GridSearchCV(pipeline, grid, cv=CV, scoring=RMSE, refit=False).fit(office.X, office.y).cv_results_,
    )
    grid = [{"alpha": [0.1, 1.0]}, {"alpha": [2.0], "fit_intercept": [False]}]
    search = DesignMatrixSearchCV(Ridge(), grid, cv=3, scoring="r2", verbose=0).fit(office.X, office.y)
    wanted = GridSearchCV(Ridge(), grid, cv=3, scoring="r2").fit(office.X, office.y)
    assert_same_scores(search.cv_results_, wanted.cv_results_)
    assert search.results_.columns[:2].tolist() == ["alpha", "fit_intercept"]
    assert search.results_["fit_intercept"].isna().tolist() == [True, True, False]


def test_folds_that_train_on_later_rows_are_refused(office):
    search = DesignMatrixSearchCV(ARXRegressor(), {"alpha": [1.0]}, cv=2, verbose=0)
    with pytest.raises(ValueError, match="cv=2 also trains on rows after those of the test"):
        search.fit(office.X, office.y)


def test_a_forecaster_alone_has_no_kind_of_disturbance(office):
    X, y = office.X.drop(columns="T_za"), office.heat_gain
    matrix = design_matrix({"mlp": "mlp", "lasso": Lasso()}, ["case01"], size={"mlp": SIZE, "lasso": {"alpha": [1, 2]}})
    forecaster = DisturbanceForecaster(max_epochs=2, random_state=0)
    search = DesignMatrixSearchCV(forecaster, matrix, cv=CV, scoring=RMSE, verbose=0).fit(X, y)
    grid = GridSearchCV(forecaster, matrix.param_grid(""), cv=CV, scoring=RMSE).fit(X, y)
    assert_same_scores(search.cv_results_, grid.cv_results_)
    assert search.results_["framework"].tolist() == ["mlp", "mlp", "lasso", "lasso"]
    assert search.results_["alpha"].tolist()[2:] == [1, 2]


def test_a_default_split_and_missing_measurements(office, estimator):
    y = office.y.copy()
    y.iloc[-5] = np.nan
    X = office.X.assign(T_za=y)
    search = DesignMatrixSearchCV(estimator, design_matrix(["ridge"]), verbose=0).fit(X, y)
    assert search.n_splits_ == 2
    own = clone(estimator).set_params(forecaster__model="ridge", disturbance="input").fit(X[: 8 * 24], y[: 8 * 24])
    error = own.predict(X[8 * 24 : 10 * 24]) - y[8 * 24 : 10 * 24]
    assert search.results_["split0_rmse"][0] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert search.results_["rmse"].notna().all()


# ------------------------------------------------------------------------------------------- many forecasters, one fit
def test_estimators_that_share_a_network_live_apart(office, estimator):
    rows, later = slice(0, 10 * 24), slice(10 * 24, 11 * 24)
    fitted = clone(estimator).fit(office.X[rows], office.y[rows])
    forecasters = [DisturbanceForecaster("ridge"), DisturbanceForecaster("profile")]
    made = fitted.with_forecasters(forecasters, "output")
    alone = [clone(estimator).set_params(forecaster=f, disturbance="output") for f in forecasters]
    alone = [one.fit(office.X[rows], office.y[rows]) for one in alone]
    made[0].update(office.X[later])  # must change no other
    alone[0].update(office.X[later])
    after = office.X[11 * 24 :].drop(columns="T_za")
    pd.testing.assert_frame_equal(made[0].forecast(None, after), alone[0].forecast(None, after))
    now = office.X[later].drop(columns="T_za")
    pd.testing.assert_frame_equal(made[1].forecast(None, now), alone[1].forecast(None, now))
    pd.testing.assert_frame_equal(
        fitted.forecast(None, now), clone(estimator).fit(office.X[rows], office.y[rows]).forecast(None, now)
    )
    assert [one.scheme_ for one in made] == ["two-stage"] * 2
    with pytest.raises(TypeError, match=r"must be a sequence of forecasters; give \[forecaster\]"):
        fitted.with_forecasters(DisturbanceForecaster("ridge"))
    with pytest.raises(ValueError, match="rows were taken in"):
        made[0].with_forecasters(forecasters)
    with pytest.raises(ValueError, match="the schedule model learns network and disturbance as one"):
        HybridPredictor(known={"Q_h": 6.0}).fit(office.X[rows], office.y[rows]).with_forecasters(forecasters)


# ------------------------------------------------------------------------------------------------------------ failures
def test_a_candidate_that_fails_is_recorded_and_the_others_go_on(office, estimator, count, tmp_path):
    frameworks = {"mlp": "mlp", "bad": Breaks(), "second split": Breaks("only there", 8 * 24 * 24), "ridge": "ridge"}
    matrix = design_matrix(frameworks, ["case01"], "output", SIZE)
    assert len(matrix) == 5
    given = {"cv": CV, "store": tmp_path / "r.sqlite", "verbose": 0}
    with pytest.warns(FitFailedWarning, match="of 5 candidates failed.*RuntimeError: no luck"):
        search = DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y)
    table = search.results_.set_index("framework")
    assert "RuntimeError: no luck" in table.loc["bad", "error"]
    assert "Traceback" in table.loc["bad", "error"]
    assert np.isnan(table.loc["bad", "rmse"])
    assert table.loc[["mlp", "ridge"], "error"].isna().all()
    assert table.loc[["mlp", "ridge"], "rmse"].notna().all()
    assert np.isnan(search.cv_results_["mean_test_score"][2])
    assert search.best_params_["forecaster__model"] in ("mlp", "ridge")
    before = dict(count)
    with pytest.warns(FitFailedWarning):
        DesignMatrixSearchCV(estimator, matrix, **given, error_score=-9.0).fit(office.X, office.y)
    assert count["tasks"] == before["tasks"]  # a failure is a result
    n_failed = int(search.results_.filter(like="split").isna().sum().sum())
    again = DesignMatrixSearchCV(estimator, matrix, **given, error_score=-9.0, retry_failed=True, refit=False)
    with pytest.warns(FitFailedWarning):
        again.fit(office.X, office.y)
    assert count["tasks"] == before["tasks"] + n_failed
    assert again.cv_results_["mean_test_score"][2] == -9.0


def test_a_failure_ends_the_search_when_asked(office, estimator):
    matrix = design_matrix({"bad": Breaks()}, disturbance="output")
    with pytest.raises(RuntimeError, match="no luck"):
        DesignMatrixSearchCV(estimator, matrix, cv=CV, error_score="raise", verbose=0).fit(office.X, office.y)
    with pytest.raises(ValueError, match=r"every candidate failed(.|\n)*no luck"):
        DesignMatrixSearchCV(estimator, matrix, cv=CV, verbose=0).fit(office.X, office.y)


def test_a_stored_failure_is_raised_when_asked(office, tmp_path):
    given = {"matrix": {"from_rows": [0, 10**6]}, "cv": CV, "store": tmp_path / "store.sqlite", "verbose": 0}
    with pytest.warns(FitFailedWarning):
        DesignMatrixSearchCV(Breaks(), **given).fit(office.X, office.y)
    with pytest.raises(RuntimeError, match="no luck"):
        DesignMatrixSearchCV(Breaks(), **given, error_score="raise").fit(office.X, office.y)


def test_a_forecast_of_nan_fails_its_candidate(office):
    class Silent(Breaks):
        def predict(self, X):
            return np.where(np.arange(len(X)) < self.from_rows, np.nan, 20.0)

    matrix = {"message": ["a", "b"], "from_rows": [300]}
    with pytest.raises(ValueError, match=r"every candidate failed.*Silent predicts NaN in measured rows"):
        DesignMatrixSearchCV(Silent(), matrix, cv=CV, verbose=0).fit(office.X, office.y)


def test_a_target_in_one_column_is_scored_as_a_vector(office):
    given = {"matrix": {"from_rows": [10**6]}, "cv": CV, "verbose": 0, "refit": False}
    scores = [
        DesignMatrixSearchCV(Breaks(), **given).fit(office.X, y).best_score_
        for y in (office.y.to_numpy(), office.y.to_numpy()[:, None])
    ]
    assert scores[0] == scores[1]


def test_halving_ends_with_one_network_left(office, estimator, count):
    matrix = design_matrix(["mlp"], ["case01"], "output", {"hidden_size": [1]})
    estimator = clone(estimator).set_params(forecaster__max_epochs=9)
    search = DesignMatrixSearchCV(estimator, matrix, cv=CV, refit=False, verbose=0, halving=1)
    assert search.fit(office.X, office.y).halving_.empty
    assert count["tasks"] == 2


def test_a_network_that_cannot_be_identified_fails_its_candidates(office, estimator):
    grid = {"gray_box__network": ["2R2C", "9R9C"], "forecaster__model": ["ridge", "profile"]}
    with pytest.warns(FitFailedWarning, match="2 of 4 candidates failed"):
        search = DesignMatrixSearchCV(estimator, grid, cv=CV, verbose=0).fit(office.X, office.y)
    assert search.results_["error"].notna().tolist() == (search.results_["gray_box__network"] == "9R9C").tolist()


# -------------------------------------------------------------------------------------------------------------- store
def test_a_finished_search_is_read_from_its_store_and_a_larger_one_goes_on(office, estimator, count, tmp_path):
    small = design_matrix(["mlp"], ["case01"], "output", SIZE)
    large = design_matrix(["mlp", "ridge"], ["case01", "case02"], "output", SIZE)
    given = {"cv": CV, "store": tmp_path / "r.sqlite", "refit": False, "verbose": 0}
    first = DesignMatrixSearchCV(estimator, small, **given).fit(office.X, office.y)
    assert (count["tasks"], count["identify"]) == (4, 2)
    again = DesignMatrixSearchCV(estimator, small, **given).fit(office.X, office.y)
    assert (count["tasks"], count["identify"]) == (4, 2)
    pd.testing.assert_frame_equal(first.results_, again.results_)
    more = DesignMatrixSearchCV(estimator, large, **given).fit(office.X, office.y)
    assert count["tasks"] == 10
    same = more.results_["case"] == "case01"
    np.testing.assert_array_equal(more.results_.loc[same, "rmse"], first.results_["rmse"])


def test_a_store_of_other_data_or_settings_is_refused(office, estimator, tmp_path):
    given = {"cv": CV, "store": tmp_path / "r.sqlite", "refit": False, "verbose": 0}
    matrix = design_matrix(["profile"], disturbance="output")
    DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y)
    with pytest.raises(ValueError, match=r"values of y is .* there and .* here; give another store"):
        DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y + 1e-9)
    other = clone(estimator).set_params(gray_box__n_starts=2)
    with pytest.raises(ValueError, match=r"parameter gray_box__n_starts is 1 there and 2 here; give"):
        DesignMatrixSearchCV(other, matrix, **given).fit(office.X, office.y)
    with pytest.raises(ValueError, match="scoring is None there and 'r2' here"):
        DesignMatrixSearchCV(estimator, matrix, **given, scoring="r2").fit(office.X, office.y)
    given["cv"] = RollingOriginSplit(train="7D", test="2D", n_splits=2)
    with pytest.raises(ValueError, match="cv is 2 splits"):
        DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y)


def test_functions_made_by_one_function_are_candidates_of_their_own(office):
    def only(name):
        return lambda X: X[[name]]

    steps = make_pipeline(FunctionTransformer(), LinearRegression())
    grid = {"functiontransformer__func": [only("T_oa"), only("q_sol")]}
    search = DesignMatrixSearchCV(steps, grid, cv=CV, refit=False, verbose=0).fit(office.X[["T_oa", "q_sol"]], office.y)
    assert search.results_["rmse"].nunique() == 2


def test_a_search_that_is_interrupted_keeps_what_is_finished(office, estimator, monkeypatch, tmp_path):
    matrix = design_matrix(["mlp"], ["case01"], size=SIZE)
    given = {"cv": CV, "store": tmp_path / "r.sqlite", "refit": False, "verbose": 0, "chunk_size": 1}
    evaluate, calls = runner.evaluate, []

    def stopped(*args, **kwargs):
        calls.append(args)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return evaluate(*args, **kwargs)

    monkeypatch.setattr(runner, "evaluate", stopped)
    with pytest.raises(KeyboardInterrupt):
        DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y)
    search = DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y)
    assert len(calls) == 2 * len(matrix) + 1
    whole = DesignMatrixSearchCV(estimator, matrix, **given | {"store": None}).fit(office.X, office.y)
    pd.testing.assert_frame_equal(search.results_.drop(columns="fit_time"), whole.results_.drop(columns="fit_time"))


# ------------------------------------------------------------------------------------------------------------- halving
@pytest.mark.slow
def test_halving_stops_the_worst_and_says_so(office, estimator, count):
    estimator = clone(estimator).set_params(forecaster__max_epochs=9)
    matrix = design_matrix(["mlp", "ridge"], ["case01"], "output", {"hidden_size": [1, 2, 3, 4, 5, 6]})
    given = {"cv": CV, "refit": False, "verbose": 0}
    with pytest.warns(UserWarning, match="halving stopped 5 of 7 candidates early"):
        search = DesignMatrixSearchCV(estimator, matrix, **given, halving=(2, 3)).fit(office.X, office.y)
    short = clone(estimator).set_params(forecaster__max_epochs=2)
    first = DesignMatrixSearchCV(short, matrix, **given).fit(office.X, office.y).results_["rmse"][:6]
    middle = clone(estimator).set_params(forecaster__max_epochs=6)
    second = DesignMatrixSearchCV(middle, matrix, **given).fit(office.X, office.y).results_["rmse"][:6]
    kept = first.sort_values().index[:2]
    last = second[kept].idxmin()
    full = DesignMatrixSearchCV(estimator, matrix, **given).fit(office.X, office.y).results_
    table = search.results_
    assert table["stopped_at"].isna().tolist() == [i in (last, 6) for i in range(7)]
    for i in range(7):
        wanted = full["rmse"] if i in (last, 6) else second if i in kept else first
        assert table["rmse"][i] == wanted[i]
    rungs = search.halving_
    assert rungs[["max_epochs", "n_candidates", "n_stopped"]].to_numpy().tolist() == [[2, 6, 4], [6, 2, 1]]
    assert rungs["worst_kept"].tolist() == [first[kept].max(), second[last]]
    assert search.best_index_ in (last, 6)
    assert sorted(search.cv_results_["rank_test_score"][[last, 6]]) == [1, 2]


def test_a_progress_bar_tells_rate_and_time_left(office, estimator, capsys):
    matrix = design_matrix(["profile"], disturbance="output")
    DesignMatrixSearchCV(estimator, matrix, cv=CV, refit=False).fit(office.X, office.y)
    shown = capsys.readouterr().err
    assert "2/2" in shown
    assert "fit/s" in shown or "s/fit" in shown
    DesignMatrixSearchCV(estimator, matrix, cv=CV, refit=False, verbose=0).fit(office.X, office.y)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"matrix": design_matrix(["ridge"]), "estimator": Ridge()}, "Ridge has no forecaster"),
        ({"matrix": {"alpha": []}}, "alpha|empty"),
        ({"halving": 0}, "halving"),
        ({"halving": (5, 1)}, "halving"),
        ({"halving": True}, "halving"),
        ({"halving": (5, 3, 3)}, "halving"),
        ({"retry_failed": "no"}, "retry_failed='no' must be True or False"),
        ({"verbose": "a"}, "verbose='a' must be True, False or an integer; 0 shows nothing"),
        ({"verbose": None}, "verbose=None must be True"),
        ({"baselines": [Ridge()]}, r"baselines=\[Ridge\(\)\] must be a mapping of names to regressors"),
        ({"matrix": {"nope": [1]}}, "every candidate failed .*, the first with ValueError: Invalid parameter 'nope'"),
        ({"chunk_size": 0}, "chunk_size=0 must be an integer of at least 1"),
        ({"error_score": "oops"}, "error_score='oops' must be a number, such as NaN, or 'raise'"),
        ({"refit": "zz"}, "refit='zz' is no metric of scoring=None; give True, False or a callable"),
        ({"refit": 2, "scoring": RMSE}, "refit=2 is no metric of scoring='neg_root"),
    ],
)
def test_what_cannot_be_searched_is_refused(changed, said, office, estimator):
    given = {"estimator": estimator, "matrix": design_matrix(["ridge"]), "cv": CV, "verbose": 0} | changed
    with pytest.raises(ValueError, match=said):
        DesignMatrixSearchCV(**given).fit(office.X, office.y)


def test_a_refit_by_the_name_of_the_only_metric_is_one(office):
    grid = {"model": ["profile"]}
    for scoring, refit in ((RMSE, RMSE), (RMSE, "score"), (None, "score"), ([RMSE], RMSE)):
        search = DesignMatrixSearchCV(DisturbanceForecaster(), grid, cv=CV, scoring=scoring, refit=refit, verbose=0)
        assert search.fit(office.X, office.heat_gain).best_index_ == 0


def test_the_schedule_model_shares_no_network(estimator):
    assert candidates.shares_network(estimator, {"forecaster__model": "ridge", "disturbance": "output"})
    assert not candidates.shares_network(HybridPredictor(), {"known": {"Q_h": 6.0}})
    assert not candidates.shares_network(estimator, {"forecaster__no_such": 1})
    assert not candidates.shares_network(Ridge(), {"alpha": 1.0})


def test_what_trains_as_one_stack_is_handed_over_together():
    matrix = design_matrix(["lstm"], disturbance="input")
    order = sorted(matrix.candidates(), key=candidates.stack_key)
    shapes = [(list_cases("lstm").set_index("name")["pattern_days"][c["forecaster__case"]],) for c in order]
    shapes = [
        (*days, c["forecaster__n_layers"], c["forecaster__hidden_size"]) for days, c in zip(shapes, order, strict=True)
    ]
    changes = sum(one != other for one, other in pairwise(shapes))
    assert changes + 1 == len(set(shapes)) == 4 * 3 * 4  # histories, layers, widths
    order = sorted(design_matrix(["mlp"], disturbance="input").candidates(), key=candidates.stack_key)
    shapes = [(c["forecaster__case"], c["forecaster__hidden_size"]) for c in order]  # layers of any number
    assert sum(one != other for one, other in pairwise(shapes)) + 1 == len(set(shapes))
    assert len({candidates.stack_key(c)[:2] for c in order}) == len(set(shapes))


def test_a_stack_that_fits_into_a_chunk_is_not_cut():
    stacks = {"abc": "1", "de": "2", "fghijkl": "3", "m": "4"}
    keys = {name: ("1 d", shape, name) for names, shape in stacks.items() for name in names}
    assert ["".join(part) for part in runner._parts(keys, 4)] == ["abc", "de", "fghi", "jkl", "m"]
    assert ["".join(part) for part in runner._parts(keys, 10)] == ["abcde", "fghijkl", "m"]  # joined up to half


def test_what_takes_longest_is_begun_first(office, estimator, monkeypatch):
    begun = []

    def noted(problem, network, given, split, catch_errors=True):
        begun.append(sorted(params["forecaster__hidden_size"] for params in given.values()))
        return tasks.evaluate(problem, network, given, split, catch_errors)

    monkeypatch.setattr("skhybrid.model_selection.search.runner.evaluate", noted)
    matrix = design_matrix(["mlp"], ["case01"], disturbance="input", size={"mlp": SIZE | {"hidden_size": [2, 5, 3, 4]}})
    DesignMatrixSearchCV(estimator, matrix, cv=CV, chunk_size=1, refit=False, verbose=0).fit(office.X, office.y)
    assert begun == [[size] for size in (5, 4, 3, 2) for _ in range(CV.get_n_splits(office.X))]
    week, day = ({"model": "lstm", "case": case, "hidden_size": 5} for case in ("case09", "case01"))
    assert candidates.effort_of(week) > candidates.effort_of(day) > candidates.effort_of({"model": "ridge"})


def test_baselines_are_scored_on_the_same_splits_as_the_matrix(office, estimator, tmp_path):
    matrix = design_matrix(["ridge", "profile"], disturbance="input")
    baselines = {"arx": ARXRegressor(), "broken": Breaks()}
    settings = {"cv": CV, "verbose": 0, "store": tmp_path / "store.sqlite"}
    with pytest.warns(FitFailedWarning, match="1 of 4 candidates failed"):
        search = DesignMatrixSearchCV(estimator, matrix, baselines=baselines, **settings).fit(office.X, office.y)
    results = search.results_
    assert results["framework"].tolist() == results["name"].tolist() == ["ridge", "profile", "arx", "broken"]
    assert results["disturbance"].tolist() == ["input", "input", None, None]
    assert results["case"].isna().all()
    for i, (train, test) in enumerate(CV.split(office.X)):
        model = ARXRegressor().fit(office.X.iloc[train], office.y.iloc[train])
        error = model.predict(office.X.iloc[test]) - office.y.iloc[test]
        assert results.loc[2, f"split{i}_rmse"] == pytest.approx(float(np.sqrt((error**2).mean())), rel=1e-9)
    assert "no luck" in results.loc[3, "error"]
    assert len(search.cv_results_["params"]) == 2
    alone = DesignMatrixSearchCV(estimator, matrix, **settings).fit(office.X, office.y)
    wanted, found = (table.drop(columns="error") for table in (alone.results_, results[:2]))
    pd.testing.assert_frame_equal(found, wanted, check_dtype=False)


def test_a_baseline_that_reads_the_temperature_it_predicts_has_failed(office):
    weather = make_pipeline(make_column_transformer(("passthrough", ["T_oa", "q_sol"])), LinearRegression())
    baselines = {"leaky": make_pipeline(StandardScaler(), LinearRegression()), "weather": weather}
    with pytest.warns(FitFailedWarning, match="1 of 3 candidates failed"):
        search = DesignMatrixSearchCV(
            ARXRegressor(), {"alpha": [1.0]}, cv=CV, baselines=baselines, refit=False, verbose=0
        ).fit(office.X, office.y)
    assert "its predict reads column 'T_za'" in search.results_.loc[1, "error"]
    assert search.results_.loc[[0, 2], "error"].isna().all()


def test_a_fitted_search_is_saved_with_its_tables(office, estimator, tmp_path):
    matrix = design_matrix(["profile", "mlp"], ["case01"], "output", {"hidden_size": [2], "max_epochs": [1]})
    search = DesignMatrixSearchCV(estimator, matrix, cv=CV, verbose=0).fit(office.X, office.y)
    save_model(search, tmp_path / "search.skhybrid")
    loaded = load_model(tmp_path / "search.skhybrid")
    np.testing.assert_array_equal(loaded.predict(office.X), search.predict(office.X))
    assert loaded.score(office.X, office.y) == search.score(office.X, office.y)
    assert repr(loaded.cv_results_) == repr(search.cv_results_)
    np.testing.assert_array_equal(loaded.results_["rmse"], search.results_["rmse"])


def test_something_shared_tells_its_size_and_travels_as_its_key():
    large = shared.Shared({"table": np.zeros(10_000)})
    assert large.__sizeof__() > 80_000
    assert large.get()["table"].shape == (10_000,)


# --------------------------------------------------------------------------------------------------- reads of a table
@pytest.fixture
def reads(monkeypatch):
    """Lengths of the frames that are parsed."""
    lengths, parse = [], _table._parse

    def counted(estimator, X, *args):
        lengths.append(len(X))
        return parse(estimator, X, *args)

    monkeypatch.setattr(_table, "_parse", counted)
    return lengths


SPLIT, WHOLE = 10 * 24, 12 * 24
SIX = {"frameworks": ["mlp", "ridge", "profile"], "cases": ["case01"]}


def test_a_search_over_forecasters_reads_each_split_once_and_the_table_for_the_refit(office, reads):
    matrix = design_matrix(**SIX, size={"hidden_size": [3, 4], "dropout": [0.0, 0.1]})
    forecaster, X = DisturbanceForecaster(max_epochs=2, random_state=0), office.X.drop(columns="T_za")
    DesignMatrixSearchCV(forecaster, matrix, cv=CV, verbose=0).fit(X, office.heat_gain)
    assert len(matrix.candidates("")) == 6
    assert reads == [SPLIT, SPLIT, WHOLE]


def test_a_search_over_hybrids_reads_each_split_once_and_the_table_for_the_refit(office, estimator, reads):
    matrix = design_matrix(**SIX, size={"hidden_size": [3]})
    DesignMatrixSearchCV(estimator, matrix, cv=CV, verbose=0).fit(office.X, office.y)
    assert len(matrix) == 6
    assert reads == [SPLIT, SPLIT, WHOLE]


def test_baselines_share_the_reading_of_a_split(office, reads):
    grid, baselines = {"alpha": [1.0, 10.0]}, {"arx": ARXRegressor()}
    search = DesignMatrixSearchCV(ARXRegressor(), grid, cv=CV, baselines=baselines, refit=False, verbose=0)
    search.fit(office.X, office.y)
    assert reads == [SPLIT, SPLIT]


def test_what_is_not_ours_gets_frames(office):
    seen = []

    def scoring(estimator, X, y):
        seen.append(type(X))
        return -float(np.sqrt(np.nanmean((estimator.predict(X) - y) ** 2)))

    given = {"cv": CV, "refit": False, "verbose": 0}
    own = DesignMatrixSearchCV(ARXRegressor(), {"horizon": ["1D"]}, scoring=scoring, **given).fit(office.X, office.y)
    assert set(seen) == {pd.DataFrame}
    ours = DesignMatrixSearchCV(ARXRegressor(), {"horizon": ["1D"]}, scoring=RMSE, **given).fit(office.X, office.y)
    np.testing.assert_array_equal(own.cv_results_["mean_test_score"], ours.cv_results_["mean_test_score"])


def test_a_column_that_no_candidate_reads_may_hold_anything(office):
    X, y = office.X.drop(columns="T_za"), office.heat_gain
    search = DesignMatrixSearchCV(DisturbanceForecaster(), {"model": ["ridge"]}, cv=CV, refit=False, verbose=0)
    expected = clone(search).fit(X, y).cv_results_["mean_test_score"]
    found = search.fit(X.assign(u_heat=np.nan), y).cv_results_["mean_test_score"]
    np.testing.assert_array_equal(found, expected)


def test_a_case_without_its_columns_fails_as_it_does_outside_a_search(office):
    X = office.X[["T_oa", "q_sol"]]
    case = ModelCase("heating", 1, ("zeta", "i_heat"), ("i_heat",))
    forecaster = DisturbanceForecaster("mlp", case, max_epochs=1)
    with pytest.raises(ValueError, match="reads i_heat and i_cool") as alone:
        forecaster.fit(X, office.heat_gain)
    search = DesignMatrixSearchCV(forecaster, {"dropout": [0.0]}, cv=CV, error_score="raise", verbose=0)
    with pytest.raises(ValueError, match="reads i_heat and i_cool") as searched:
        search.fit(X, office.heat_gain)
    assert str(searched.value) == str(alone.value)


def test_a_network_without_its_libraries_is_refused_before_anything_is_fitted(office, estimator, count, monkeypatch):
    monkeypatch.setattr("skhybrid.forecasting.named_models.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"model='mlp' needs torch and skorch; .*skhybrid\[networks\]"):
        DesignMatrixSearchCV(estimator, design_matrix(**SIX), cv=CV, verbose=0).fit(office.X, office.y)
    assert count == {"identify": 0, "tasks": 0, "networks": 0}
    search = DesignMatrixSearchCV(estimator, design_matrix(["ridge"]), cv=CV, refit=False, verbose=0)
    assert search.fit(office.X, office.y).results_["rmse"].notna().all()


@pytest.mark.slow
def test_kinds_of_disturbance_are_told_apart_where_parts_are_the_defaults(office):
    grid = {"disturbance": ["output", "input"]}  # the first identifies a network, the second is the schedule model
    search = DesignMatrixSearchCV(HybridPredictor(), grid, cv=CV, refit=False, verbose=0).fit(office.X, office.y)
    assert search.results_["error"].isna().all()


def test_a_matrix_of_forecasters_is_refused_for_the_schedule_model(office):
    for estimator in (HybridPredictor(), make_pipeline(HybridPredictor(known={"Q_h": 6.0}))):
        search = DesignMatrixSearchCV(estimator, design_matrix(["ridge", "profile"]), cv=CV, verbose=0)
        with pytest.raises(
            ValueError, match=r"HybridPredictor is the schedule model, .*; give one of them, or a TwoStage"
        ):
            search.fit(office.X, office.y)
    outputs = design_matrix(["ridge", "profile"], disturbance="output")
    search = DesignMatrixSearchCV(HybridPredictor(), outputs, cv=CV, refit=False, verbose=0)
    assert search.fit(office.X, office.y).results_["error"].isna().all()
