"""Habits of scikit-learn: columns by name, rows ahead without history, scorers, summaries, signatures."""

from __future__ import annotations

import inspect
import re
from copy import deepcopy
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import sklearn
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError
from sklearn.impute import SimpleImputer
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, cross_val_score, cross_validate
from sklearn.pipeline import make_pipeline

import skhybrid
from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid._table import read_table
from skhybrid._warnings import warn_user, warnings_dropped, warnings_to
from skhybrid.datasets import make_office
from skhybrid.exceptions import GainWarning, PlanWarning, UnitWarning
from skhybrid.model_selection import (
    DayAheadScorer,
    RollingOriginSplit,
    backtest,
    day_ahead_scorer,
    quantile_scorer,
)
from skhybrid.persistence import load_model, save_model
from skhybrid.preprocessing import FacadeIrradiance, GapFiller, UnitConverter

DAY = 96
ROOT = Path(__file__).resolve().parents[1]
KNOWN = {"Q_h": 6.0}
MODELS = {
    "conventional": GrayBoxRC(n_starts=1, horizon="1D", random_state=0),
    "input": InputDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "output": OutputDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "periodic": PeriodicDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "schedule": SchedulePredictor(known=KNOWN),
    "hybrid": HybridPredictor(known=KNOWN),
    "two-stage": TwoStagePredictor(
        InputDisturbanceID(known=KNOWN, n_starts=1), DisturbanceForecaster("ridge"), random_state=0
    ),
    "arx": ARXRegressor(),
    "forecaster": DisturbanceForecaster(Ridge(), sampling_time="15min"),
}
pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=9, random_state=0)


@pytest.fixture(scope="module")
def X(office):
    """Eight days to learn from, and one ahead; the disturbance is known too."""
    return office.X.assign(zeta=office.heat_gain)


@pytest.fixture(scope="module")
def fitted(office, X):
    """One fit per model, made when it is first asked for."""
    made = {}

    def fit(name):
        if name not in made:
            y = office.heat_gain if name == "forecaster" else office.y
            made[name] = MODELS[name].fit(X[:-DAY], y[:-DAY])
        return made[name]

    return fit


# ------------------------------------------------------------------------------------------------ columns by name
@pytest.mark.parametrize("name", MODELS)
def test_columns_are_found_by_name(fitted, X, name):
    model, ahead = fitted(name), X[-DAY:]
    turned = ahead[ahead.columns[::-1]].assign(T_attic=35.0, Q_else=1.0, note="read by nobody")
    np.testing.assert_array_equal(model.predict(turned), model.predict(ahead))
    if hasattr(model, "transform"):
        pd.testing.assert_frame_equal(model.transform(turned), model.transform(ahead))
        assert list(model.transform(turned)) == list(model.get_feature_names_out())
    with pytest.raises(ValueError, match="X has no column 'T_oa', which the training table has; it has 'q_sol'"):
        model.predict(ahead.drop(columns="T_oa"))


def test_columns_that_are_given_a_role_are_found_by_their_own_name(fitted, office, X):
    named = {"T_za": "room", "T_oa": "outside"}
    log = X.rename(columns=named)
    model = ARXRegressor(columns=named).fit(log[:-DAY], office.y[:-DAY])
    ahead = log[-DAY:].drop(columns="room")[["u_cool", "outside", "u_heat", "q_sol"]].assign(T_oa=-5.0, T_za=99.0)
    np.testing.assert_allclose(model.predict(ahead), fitted("arx").predict(X[-DAY:].drop(columns="T_za")), atol=1e-9)
    with pytest.raises(ValueError, match="X has no column 'room' and does not begin one step after"):
        model.predict(ahead[8:])
    with pytest.raises(ValueError, match="X has no column 'outside', which the training table has"):
        model.predict(ahead.drop(columns="outside"))


def test_frames_without_roles_follow_the_rule_of_scikit_learn(office, X):
    plain = X[:-DAY].reset_index(drop=True)[["T_oa", "q_sol", "u_heat"]].set_axis(["a", "b", "c"], axis=1)
    model = ARXRegressor(sampling_time="15min").fit(plain, office.y[:-DAY].to_numpy())
    with pytest.raises(ValueError, match="Feature names must be in the same order as they were in fit"):
        model.predict(plain[["b", "a", "c"]])


# ------------------------------------------------------------------------------------- rows ahead without history
@pytest.mark.parametrize("name", MODELS)
def test_rows_ahead_need_no_measurement(fitted, X, name):
    """They continue from the last known row; a column of nothing but NaN says the same."""
    model, past = fitted(name), "zeta" if name == "forecaster" else "T_za"
    known, ahead = X[:-DAY], X[-DAY:].drop(columns=["T_za", "zeta"])
    found = model.predict(ahead)
    np.testing.assert_array_equal(found, model.predict(ahead.assign(**{past: np.nan})))
    if hasattr(model, "forecast"):
        out = model.forecast(None, ahead)
        np.testing.assert_allclose(found, out if name == "forecaster" else out["T_za"], atol=1e-8)
    else:
        whole = pd.concat([known, ahead])
        np.testing.assert_allclose(found, model.predict_from(whole, [len(known) - 1], horizon="1D")[0], atol=0.05)
    if hasattr(model, "predict_load"):
        assert np.isfinite(model.predict_load(ahead, 21.0)).all(axis=None)
    if hasattr(model, "predict_quantiles"):
        assert np.isfinite(model.predict_quantiles(ahead)).all()


@pytest.mark.parametrize("name", MODELS)
def test_rows_elsewhere_need_their_history(fitted, X, name):
    model, past = fitted(name), "zeta" if name == "forecaster" else "T_za"
    elsewhere = X[-DAY // 2 :]
    hint = "there is forecast\\(history, future\\)" if hasattr(model, "forecast") else "nothing was\\."
    for forecast in (model.predict, lambda table: model.predict_from(table, [0])):
        with pytest.raises(ValueError, match=f"X has no column '{past}' and does not begin one step after .*{hint}"):
            forecast(elsewhere.drop(columns=past))
    assert np.isfinite(model.predict(elsewhere.assign(**{past: np.nan}))).all()  # a cold start, asked for


def test_an_update_by_name_and_without_a_measurement(fitted, X, office):
    model, new = deepcopy(fitted("schedule")), X[-DAY : -DAY // 2]
    other = deepcopy(model).update(new[new.columns[::-1]].assign(note="b"))
    ahead = X[-DAY // 2 :].drop(columns="T_za")
    np.testing.assert_array_equal(other.predict(ahead), deepcopy(model).update(new).predict(ahead))
    with pytest.raises(ValueError, match="rows ahead are for predict and forecast"):
        model.update(new.drop(columns="T_za"))
    model.update(new.drop(columns="T_za"), office.y[-DAY : -DAY // 2])
    assert "(768 rows of 15 min)" in str(model.summary())
    np.testing.assert_array_equal(model.predict(ahead), other.predict(ahead))
    model.partial_fit(new, office.y[-DAY : -DAY // 2])  # what update has taken in is learned
    assert f"{X.index[0]} to {new.index[-1]} (816 rows of 15 min)" in str(model.summary())


# --------------------------------------------------------------------------------------------------- time zones
def _calls(model, X, y):
    """Calls of the methods of a model that read a table after ``fit``."""
    ahead = X[-DAY:]
    called = {
        "predict": lambda: model.predict(ahead),
        "predict_from": lambda: model.predict_from(ahead, [3]),
        "score": lambda: model.score(ahead, y[-DAY:]),
        "rolled_origins": lambda: model.rolled_origins(ahead),
        "predict_quantiles": lambda: model.predict_quantiles(ahead),
        "predict_load": lambda: model.predict_load(ahead, 21.0),
        "forecast": lambda: model.forecast(X[: -DAY // 2], X[-DAY // 2 :]),
        "update": lambda: deepcopy(model).update(ahead, y[-DAY:]),
        "transform": lambda: model.transform(ahead),
        "innovations": lambda: model.innovations(ahead),
        "simulate": lambda: model.simulate(ahead),
        "with_rows": lambda: model.with_rows(X, y),
        "drift": lambda: model.drift(X),
    }
    called = {name: call for name, call in called.items() if hasattr(model, name)}
    if hasattr(model, "forecast"):
        called["forecast(None)"] = lambda: model.forecast(None, ahead)
    if hasattr(model, "partial_fit"):
        called["partial_fit"] = lambda: deepcopy(model).partial_fit(ahead, y[-DAY:])
    return called


@pytest.mark.parametrize("name", MODELS)
def test_rows_with_a_time_zone_do_not_follow_a_training_without_one(fitted, X, office, name):
    """Without a zone stamps would count as UTC, and rows would be joined to a history of other hours."""
    abroad, y = X.tz_localize("America/Chicago"), office.y.tz_localize("America/Chicago")
    for call in _calls(fitted(name), abroad, y).values():
        with pytest.raises(ValueError, match=r"^the training table has the time zone None, X America/Chicago; local"):
            call()


@pytest.mark.parametrize("name", ["input", "hybrid", "arx", "forecaster"])
def test_rows_without_a_time_zone_do_not_follow_a_training_with_one(X, office, name):
    y = office.heat_gain if name == "forecaster" else office.y
    abroad, target = X[:-DAY].tz_localize("UTC"), y[:-DAY].tz_localize("UTC")
    model = clone(MODELS[name]).fit(abroad, target)
    for call in _calls(model, X, y).values():
        with pytest.raises(ValueError, match=r"^the training table has the time zone UTC, X None; localize the"):
            call()
    elsewhere = X.tz_localize("UTC")[-DAY:]
    np.testing.assert_array_equal(
        np.isfinite(model.predict(elsewhere.tz_convert("Asia/Tokyo"))), np.isfinite(model.predict(elsewhere))
    )
    model.fit(X[:-DAY], y[:-DAY])  # another training may have none
    model.predict(X[-DAY:])


# ------------------------------------------------------------------------------------------------- preprocess=
def in_the_units_of_the_log(X):
    """A table as a logger wrote it: degF and W/m2."""
    return X.assign(T_oa=32.0 + 1.8 * X["T_oa"], T_za=32.0 + 1.8 * X["T_za"], q_sol=1e3 * X["q_sol"])


@pytest.fixture(scope="module")
def log(X):
    return in_the_units_of_the_log(X)


CONVERTED = make_pipeline(UnitConverter({"T_oa": "degF", "T_za": "degF", "q_sol": "W/m2"}), GapFiller("1h"))


def test_every_method_of_a_predictor_works_after_a_transformer(fitted, office, X, log, tmp_path):
    plain = fitted("schedule")
    model = clone(plain).set_params(preprocess=clone(CONVERTED)).fit(log[:-DAY], office.y[:-DAY])
    assert not hasattr(CONVERTED[-1], "max_gap_")
    save_model(model, tmp_path / "zone.skops")
    ahead, raw = X[-DAY:].drop(columns="T_za"), log[-DAY:].drop(columns="T_za")
    turned, past = raw[raw.columns[::-1]].assign(note="b"), slice(-2 * DAY, -DAY)
    expected = plain.forecast(None, ahead)
    pd.testing.assert_frame_equal(model.forecast(None, turned), expected)
    pd.testing.assert_frame_equal(load_model(tmp_path / "zone.skops").forecast(None, turned), expected)
    pd.testing.assert_frame_equal(
        model.forecast(log[past], turned, quantiles=[0.5]), plain.forecast(X[past], ahead, quantiles=[0.5])
    )
    np.testing.assert_allclose(model.predict(turned), plain.predict(ahead), atol=1e-8)
    np.testing.assert_allclose(model.predict_quantiles(raw), plain.predict_quantiles(ahead), atol=1e-8)
    pd.testing.assert_frame_equal(model.predict_load(raw, 21.0), plain.predict_load(ahead, 21.0))
    new, other = deepcopy(model).update(log[-DAY:-9]), deepcopy(plain).update(X[-DAY:-9])
    np.testing.assert_allclose(new.predict(log[-9:]), other.predict(X[-9:]), atol=1e-8)
    assert new.score(log[-9:], office.y[-9:]) == pytest.approx(other.score(X[-9:], office.y[-9:]))
    assert model.get_params()["preprocess__gapfiller__max_gap"] == "1h"
    with pytest.raises(ValueError, match="X has no column 'q_sol', which preprocess= was fitted on"):
        model.predict(raw.drop(columns="q_sol"))
    with pytest.raises(ValueError, match="future has no column 'q_sol'"):
        model.forecast(None, raw.drop(columns="q_sol"))
    with pytest.raises(ValueError, match="X has no column 'T_za' and does not begin one step after"):
        model.predict(raw[10:])
    with pytest.raises(ValueError, match="pass the DataFrame itself"):
        model.predict(read_table(BaseEstimator(), X[-DAY:], reset=True))
    later = slice(-2 * DAY, None)
    frame = backtest(model, log[later], office.y[later], quantiles=[0.1, 0.9])
    pd.testing.assert_frame_equal(frame, backtest(plain, X[later], office.y[later], quantiles=[0.1, 0.9]))


def test_what_a_transformer_fills_is_no_measurement(fitted, office, X):
    """An imputer would put the mean of the training into the rows ahead, as if it had been measured."""
    plain = fitted("two-stage")
    filled = clone(plain).set_params(preprocess=SimpleImputer()).fit(X[:-DAY], office.y[:-DAY])
    unknown = X[-DAY:].assign(T_za=X["T_za"].where(X.index < X.index[-50]))
    np.testing.assert_allclose(filled.predict(unknown), plain.predict(unknown), atol=1e-9)
    with pytest.raises(ValueError, match="preprocess= must return a DataFrame"):
        clone(plain).set_params(preprocess=AsArray()).fit(X[:-DAY], office.y[:-DAY])


class AsArray(BaseEstimator):
    def fit(self, X, y=None):
        return self

    def transform(self, X):
        return X.to_numpy()


# ------------------------------------------------------------------------------------------------------- scorers
def test_scorers_of_cross_validation_and_search(office, X, tmp_path):
    cv = RollingOriginSplit(train="5D", test="1D")
    scores = cross_validate(
        ARXRegressor(), X, office.y, cv=cv, scoring={"rmse": day_ahead_scorer, "pinball": quantile_scorer}
    )
    assert (scores["test_rmse"] < 0).all()
    assert (scores["test_pinball"] < 0).all()
    train, test = next(iter(cv.split(X)))
    model = ARXRegressor().fit(X.iloc[train], office.y.iloc[train])
    paths = model.predict_from(X.iloc[test], [0], horizon="1D")[0, :-1]  # the last lead is after the block
    expected = np.sqrt(np.mean((paths - office.y.iloc[test[1:]]) ** 2))
    assert scores["test_rmse"][0] == pytest.approx(-expected)
    search = GridSearchCV(ARXRegressor(), {"alpha": [1.0, 1e6]}, cv=cv, scoring=day_ahead_scorer).fit(X, office.y)
    means = [cross_val_score(ARXRegressor(alpha=a), X, office.y, cv=cv, scoring=day_ahead_scorer) for a in (1.0, 1e6)]
    np.testing.assert_array_equal(search.cv_results_["mean_test_score"], np.mean(means, axis=1))
    save_model(search, tmp_path / "search.skops")
    assert load_model(tmp_path / "search.skops").scoring == day_ahead_scorer
    simulated = GrayBoxRC(known=office.theta).fit(X, office.y)  # its own predict has no origins
    rolled = clone(simulated).set_params(horizon="1D").fit(X, office.y)
    assert day_ahead_scorer(simulated, X, office.y) == day_ahead_scorer(rolled, X, office.y)


@pytest.mark.parametrize("scorer", [day_ahead_scorer, quantile_scorer, DayAheadScorer("6h", "6h")])
def test_a_scorer_reads_no_temperature_after_the_origin(office, X, scorer):
    """With one origin in the block, what the column says later changes nothing, but y does."""
    model, block = ARXRegressor().fit(X[:-DAY], office.y[:-DAY]), slice(-DAY, -DAY + 24)
    y = office.y[block]
    other = X[block].assign(T_za=X["T_za"][block] + 2.0 * (np.arange(24) > 0))
    assert scorer(model, other, y) == scorer(model, X[block], y)
    assert scorer(model, X[block], y + 1.0) != scorer(model, X[block], y)


# ----------------------------------------------------------------------------------------------------- summaries
@pytest.mark.parametrize("name", MODELS)
def test_a_summary_as_text_and_html(fitted, name, X, tmp_path):
    model = fitted(name)
    summary = model.summary()
    text, html = str(summary), model._repr_mimebundle_()["text/html"]
    assert text.startswith(type(model).__name__)
    assert f"{X.index[0]} to {X.index[-DAY - 1]} ({len(X) - DAY} rows of 15 min)" in text
    for shown in (text, html):
        assert f"skhybrid {skhybrid.__version__}, scikit-learn {sklearn.__version__}" in shown
    assert summary._repr_html_() in html
    assert summary._repr_html_() in model._repr_html_()
    if hasattr(model, "theta_"):
        table = summary.tables["parameters"]
        pd.testing.assert_series_equal(table["std"], model.theta_std_, check_names=False)
        assert table.loc["C_za", "unit"] == "kWh/K"
    if name in ("schedule", "hybrid"):
        pd.testing.assert_frame_equal(summary.tables["weights"], model.weights_)
        assert set(summary.tables["parameters"]["unit"]) == {"K/kW", "kWh/K"}
    assert "trained on" not in clone(model)._repr_mimebundle_()["text/html"]
    with pytest.raises(NotFittedError):
        clone(model).summary()
    save_model(model, tmp_path / "model.skops")
    assert str(load_model(tmp_path / "model.skops").summary()) == text


# ------------------------------------------------------------------------------------------------ predict_load
def test_a_load_has_the_same_columns_whatever_ran(office, X, fitted):
    """Also where a stage never ran, so that its capacity is 0 or a guess."""
    stages = ["u_heat", "u_cool"]
    columns = [*stages, *(f"{s}_unclipped" for s in stages), "Q_hvac", "Q_hvac_unclipped", "T_za", "zeta"]
    quiet = X.assign(u_cool=0.0)
    for name in ("conventional", "output", "periodic", "schedule", "two-stage"):
        assert list(fitted(name).predict_load(X[-DAY:], 21.0)) == columns
    for name in ("input", "schedule"):
        model = clone(MODELS[name]).fit(quiet[:-DAY], office.y[:-DAY])
        assert list(model.predict_load(quiet[-DAY:], 21.0)) == columns


LOADS = ("conventional", "input", "output", "periodic", "schedule", "hybrid", "two-stage")


@pytest.mark.parametrize("name", LOADS)
def test_rows_ahead_of_a_load_need_no_plant_columns(fitted, X, name):
    """Nobody knows tomorrow's stages: without them the load is the same to the bit."""
    plant = ["u_heat", "u_cool"]
    model, ahead = fitted(name), X[-DAY:].drop(columns=["T_za", "zeta"])
    load = model.predict_load(ahead, 21.0)
    pd.testing.assert_frame_equal(model.predict_load(ahead.drop(columns=plant), 21.0), load, check_exact=True)
    pd.testing.assert_frame_equal(model.predict_load(ahead.drop(columns="u_heat"), 21.0), load, check_exact=True)
    pd.testing.assert_frame_equal(model.predict_load(ahead.assign(u_heat=np.nan), 21.0), load, check_exact=True)
    with pytest.raises(ValueError, match="X has no column 'u_heat', which the training table has"):
        model.predict(ahead.drop(columns=plant))
    table = read_table(BaseEstimator(), ahead, reset=True)
    pd.testing.assert_frame_equal(model.predict_load(table, 21.0), load, check_exact=True)
    with pytest.raises(ValueError, match="X is None; give a DataFrame or an array"):
        model.predict_load(None, 21.0)


def test_a_load_after_the_last_known_stage_has_no_later_origin(fitted, X):
    """Rows with known stages, then rows without: the last midnight with known stages before it is the last origin."""
    model, log = fitted("input"), X[-DAY - 40 :]
    known = model.predict_load(log, 21.0)
    ends = log.copy()
    ends.loc[ends.index[60:], ["u_heat", "T_za"]] = np.nan
    pd.testing.assert_frame_equal(model.predict_load(ends, 21.0), known, check_exact=True)  # midnight is row 40
    ends.loc[ends.index[20:], ["u_heat", "T_za"]] = np.nan
    one_origin = deepcopy(model).set_params(horizon=None).predict_load(log, 21.0)
    pd.testing.assert_frame_equal(model.predict_load(ends, 21.0), one_origin, check_exact=True)
    assert not known.equals(one_origin)
    ends.loc[ends.index[3], "u_cool"] = np.nan
    with pytest.raises(ValueError, match="column 'u_cool' contains NaN in 1 row"):
        model.predict_load(ends, 21.0)


def test_a_load_through_a_preprocess_needs_no_plant_columns_ahead(office, X):
    X = X.drop(columns="zeta")
    model = HybridPredictor(known=KNOWN, preprocess=GapFiller()).fit(X[:-DAY], office.y[:-DAY])
    ahead = X[-DAY:].drop(columns="T_za")
    load = model.predict_load(ahead, 21.0)
    bare = ahead.drop(columns=["u_heat", "u_cool"])
    pd.testing.assert_frame_equal(model.predict_load(bare, 21.0), load, check_exact=True)


# --------------------------------------------------------------------------------------------- types and signatures
SNIPPET = """
import skhybrid as sk
sk.HybridPredictor(disturbance="output", adapt=None)
sk.HybridPredictor(adapt=3)
sk.TwoStagePredictor(disturbance="heat")
sk.SchedulePredictor(adapt="refit")
sk.ARXRegressor(adapt="linear")
sk.DisturbanceForecaster(activation="tanh")
sk.DisturbanceForecaster(residual_of="lstm")
sk.DisturbanceForecaster(time_encoding="sine")
sk.DisturbanceForecaster(repeats="all")
sk.GrayBoxRC(objective="one")
sk.InputDisturbanceID(objective="one")
sk.OutputDisturbanceID(rho_box="wide")
sk.PeriodicDisturbanceID(variance="day")
"""


@pytest.mark.slow
def test_a_type_checker_rejects_an_unknown_choice(tmp_path, monkeypatch):
    api = pytest.importorskip("mypy.api")
    (tmp_path / "snippet.py").write_text(SNIPPET, encoding="utf-8")
    monkeypatch.setenv("MYPYPATH", str(Path(skhybrid.__file__).parents[1]))
    monkeypatch.chdir(tmp_path)  # the cache and any settings of the folder
    flags = ["--follow-imports=silent", "--ignore-missing-imports", "--no-site-packages"]
    found, _, _ = api.run([*flags, "snippet.py"])
    lines = [int(line.split(":")[1]) for line in found.splitlines() if "[arg-type]" in line]
    assert lines == list(range(4, len(SNIPPET.splitlines()) + 1)), found


ESTIMATORS = [type(model) for model in MODELS.values()]
#: parameters that may be given by position: the parts that an estimator is made of
PARTS = {"network", "gray_box", "forecaster", "model", "case"}


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda cls: cls.__name__)
def test_only_the_parts_of_an_estimator_are_given_by_position(estimator):
    parameters = list(inspect.signature(estimator).parameters.values())
    by_position = {p.name for p in parameters if p.kind is not p.KEYWORD_ONLY}
    assert by_position <= PARTS


@pytest.mark.parametrize("one", ESTIMATORS, ids=lambda cls: cls.__name__)
def test_estimators_name_their_parameters_in_the_same_order(one):
    names = list(inspect.signature(one).parameters)
    for other in ESTIMATORS:
        shared = [name for name in inspect.signature(other).parameters if name in names]
        assert [name for name in names if name in shared] == shared


def test_methods_of_the_same_name_take_the_same_arguments():
    """The first are alike; what an estimator adds is optional."""
    first = {
        "fit": ["X", "y"],
        "partial_fit": ["X", "y"],
        "predict": ["X"],
        "predict_from": ["X", "origins", "horizon"],
        "predict_quantiles": ["X", "quantiles"],
        "predict_quantiles_from": ["X", "origins", "quantiles", "horizon"],
        "predict_load": ["X", "setpoint", "limits"],
        "forecast": ["history", "future"],
        "update": ["X", "y"],
        "summary": [],
    }
    seen = set()
    for estimator in ESTIMATORS:
        for method, expected in first.items():
            if hasattr(estimator, method):
                names = [p for p in inspect.signature(getattr(estimator, method)).parameters if p != "self"]
                assert names[: len(expected)] == expected, f"{estimator.__name__}.{method}"
                parameters = inspect.signature(getattr(estimator, method)).parameters
                assert all(parameters[p].default is not inspect.Parameter.empty for p in names[len(expected) :])
                seen.add(method)
    assert seen == set(first)


# -------------------------------------------------------------------------------------------------- public names
DOCUMENTED = re.findall(r"^   (skhybrid\.\w+)$", (ROOT / "docs" / "api.rst").read_text(encoding="utf-8"), re.MULTILINE)


def test_the_reference_lists_every_public_module():
    modules = {f"skhybrid.{name}" for name in skhybrid.__all__ if inspect.ismodule(getattr(skhybrid, name))}
    assert {*modules, "skhybrid.hybrid"} == set(DOCUMENTED)
    for name in ("autosummary", "autosummary_ignore_module_all = False"):  # the reference follows __all__
        assert name in (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")


@pytest.mark.parametrize("module", DOCUMENTED)
def test_a_name_without_underscore_is_in_the_reference(module):
    """And so has a documented signature (test_docstrings); helpers lie in modules that the reference leaves out."""
    found = import_module(module)
    public = [name for name, value in vars(found).items() if not name.startswith("_") and is_own(value, found)]
    assert sorted(public) == sorted(set(found.__all__))
    helpers = {"blank_axes", "warn_user", "atomic_path", "Continuous", "settings_from", "takes_two_stages"}
    assert not helpers & set(public)


def is_own(value, module):
    """Whether a value is of this package: no module, and defined in the one that is looked at, if that is a file."""
    home = str(getattr(value, "__module__", type(value).__module__))
    if not hasattr(module, "__path__"):
        return home == module.__name__
    return not inspect.ismodule(value) and home.startswith(("skhybrid", "builtins"))


def test_a_transformer_finds_its_columns_by_name_too(log):
    raw, ahead = log[:-DAY], log[-DAY:]
    for transformer in (
        clone(CONVERTED).fit(raw),
        GapFiller().fit(raw),
        FacadeIrradiance(40.0, 0.0, timezone="UTC").fit(raw),
    ):
        turned = ahead[ahead.columns[::-1]].assign(note="b")
        pd.testing.assert_frame_equal(transformer.transform(turned), transformer.transform(ahead))
        with pytest.raises(ValueError, match=r"X has no column 'T_za'.*; for rows ahead take preprocess="):
            transformer.transform(ahead.drop(columns="T_za"))


def test_what_a_block_drops_stays_dropped_in_a_block_within():
    told = []
    with warnings_to(told.append), warnings_dropped(GainWarning):
        with warnings_dropped(PlanWarning):
            for category in (GainWarning, PlanWarning, UnitWarning):
                warn_user("said", category)
        warn_user("said", PlanWarning)
    assert list(map(type, told)) == [UnitWarning, PlanWarning]
