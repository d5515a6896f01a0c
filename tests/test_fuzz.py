"""A small budget of the fuzzing in ``tests/fuzz``: all outcomes are accepted and finite, or refused in one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from sklearn.base import clone

sys.path.insert(0, str(Path(__file__).with_name("fuzz")))

from calls import Call, calls
from entry_points import entries, forgotten
from estimators import ESTIMATORS
from file_readers import READERS, good_files_are_read, mutant
from outcomes import ACCEPTED, REFUSED, observe, wrong_numbers
from zone_tables import WITH_SETPOINTS, Spoilt, Table, training

pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.usefixtures("quick_fits")]
#: methods and estimators that a learned thermostat serves
LAW = ("forecast", "sample", "closed_loop_from", "predict_load")
HYBRIDS = ("HybridPredictor", "SchedulePredictor", "TwoStagePredictor")
#: entry points that take seconds, or have numba compile for seconds; the large budget has them
SLOW = ("PeriodicDisturbanceID", "profile_likelihood", "compare_models", "skhybrid run")


@pytest.fixture(scope="module")
def names():
    return tuple(name for name in entries() if not name.startswith(SLOW))


def test_every_public_name_is_called():
    assert forgotten() == set()


@pytest.mark.slow
def test_every_entry_point_accepts_a_good_table(names):
    with_setpoints = Table(columns=WITH_SETPOINTS)
    outcomes = {
        name: (Call(name, with_setpoints) if entries()[name].of_thermostat else Call(name)).outcome() for name in names
    }
    refused = {name: o for name, o in outcomes.items() if o.kind != ACCEPTED}
    # the training table has no set-points, from which a thermostat would be learned; the usual call asks for one
    of_thermostat = {name for name in names if entries()[name].method in LAW and entries()[name].estimator in HYBRIDS}
    # the usual set-point is one number, which an ideal plant holds, and quantiles are asked for
    of_thermostat |= {"SchedulePredictor, set-points.predict_load"}
    of_thermostat |= {f"BuildingPredictor.{method}" for method in ("forecast", "sample", "closed_loop_from")}
    affine = {name for name in names if entries()[name].method == "affine_forecast"}
    no_intervals = {name for name in affine if not name.startswith((*HYBRIDS, "BuildingPredictor"))}
    assert refused.keys() == of_thermostat | no_intervals, refused
    assert all("thermostat" in refused[name].detail for name in of_thermostat)
    assert all("learns no intervals" in refused[name].detail for name in no_intervals)


_WORDS_WITH_NA = Table(spoilt=(Spoilt(change="string NA", where="last"),), container="series")
_COMPLEX = Table(
    columns=("T_oa", "q_sol", "u_heat", "u_cool"), spoilt=(Spoilt(column="q_sol", change="complex", where="last"),)
)
#: what was found by fuzzing, and words of the refusal that it gets now
FOUND = {
    Call("ljung_box", _COMPLEX): "must be real",
    Call("make_office", _COMPLEX): "weather column 'q_sol' is not numeric",
    Call("compare_models", Table(spoilt=(Spoilt("q_sol", "-1e300", "every seventh"),))): "no model could be fitted",
    Call("DesignMatrixSearchCV, ARXRegressor.score", target="some 1e300"): "y holds numbers beyond 1e100",
    Call("skhybrid check", Table(container="dict")): "time stamp",
    Call("InputDisturbanceID.simulate_states", _WORDS_WITH_NA): "X is a Series",
    Call("DesignMatrixSearchCV, ARXRegressor.fit", Table(96, container="series")): "every candidate failed",
    Call("GrayBoxRC.drive", arguments=(("origins", "empty"),)): "0 origins",
    Call("GrayBoxRC.drive", arguments=(("origins", "twice"),)): "2 origins",
    Call("GrayBoxRC.drive", arguments=(("origins", "word"),)): "row numbers of X",
    Call("GrayBoxRC.drive", arguments=(("disturbance", "nan"),)): "disturbance contains NaN",
    Call("GrayBoxRC.required_heat", arguments=(("origins", "unsorted"),)): "must increase",
    Call("GrayBoxRC.required_heat", arguments=(("disturbance", "short"),)): "48 rows lie",
    Call("GrayBoxRC.simulate", arguments=(("heat_gain", "word"),)): "heat_gain is text",
    Call("GrayBoxRC.simulate", arguments=(("initial_state", "word"),)): "initial_state is text",
    Call("GrayBoxRC.predict_load", arguments=(("limits", "words"),)): "the lower limit is text",
    Call("InputDisturbanceID.fit", arguments=(("theta_init", "nan"),)): "theta_init gives R_zo the value nan",
    Call("InputDisturbanceID.fit", arguments=(("theta_init", "word"),)): "must be a mapping",
    Call("OutputDisturbanceID.fit", arguments=(("theta_init", "unknown"),)): "which is not one of",
    Call("OutputDisturbanceID.fit_transform", target="None"): "requires y to be passed",
    Call("DisturbanceForecaster, regressor.fit", Table(step="1ns")): "steps are of a second or more",
    Call("TwoStagePredictor.fit", Table(step="1D", index="text")): "looks like a time stamp",
    Call("diagnose", arguments=(("level", "word"),)): "is not between 0 and 1",
    Call("backtest", arguments=(("origin_step", "word"),)): "origin_step=",
    Call("split_log", Table(spoilt=(Spoilt("T_za", "inf", "last"),))): "column 'T_za' contains inf in 1 row",
    Call("FacadeIrradiance.transform", Table(spoilt=(Spoilt("q_sol", "inf", "all"),))): "'q_sol' contains inf in",
    Call("split_log", Table(names="twice the same")): "appears twice in X",
    Call("split_log", Table(index="two levels")): "no time stamps as its index",
    Call("HybridPredictor.drift", Table(spoilt=(Spoilt("q_sol", "complex"),), container="masked array")): (
        "Complex data not supported"
    ),
    Call("Pipeline.fit", Table(spoilt=(Spoilt(change="words", where="every seventh"),), container="series")): (
        "X is a Series"
    ),
    Call("backtest", target="some inf"): "y contains inf in",
    Call("backtest", arguments=(("start", "word"),)): "is not a time stamp",
    Call("split_log", Table(spoilt=(Spoilt("u_cool", "inf"),))): "column 'u_cool' contains inf in",
    Call("backtest", arguments=(("start", "row"),)): "is a number, but X has time stamps",
    Call("HybridPredictor.fit", Table(spoilt=(Spoilt("T_za", "sparse", "last"),) * 2)): "do not move together",
    Call("ARXRegressor.fit", Table(spoilt=(Spoilt("q_sol", "boolean NA", "last"),), container="masked array")): (
        "not numeric"
    ),
    Call("ARXRegressor.predict_quantiles", arguments=(("quantiles", "word"),)): "quantiles='median'",
    Call("ARXRegressor.score", arguments=(("sample_weight", "short"),)): "sample_weight",
    Call("HybridPredictor.forecast", Table(container="masked array")): "give a pandas DataFrame",
    Call("regularize", arguments=(("step", "word"),)): "step='step' is not a duration",
    Call("regularize", arguments=(("max_gap", "word"),)): "max_gap='gap' is not a duration",
    Call("regularize", Table(step="1ns")): "most stamps are 1e-09 s apart",
    Call("split_log", Table(spoilt=(Spoilt("T_za", "complex", "last"),))): "column 'T_za' is not numeric",
    Call("split_log", Table(columns=("T_oa", "q_sol"))): "with a column T_za",
    Call("DesignMatrixSearchCV, ARXRegressor.fit", Table(96), target="some 9.97e36"): "every candidate failed",
    Call("make_office", Table(spoilt=(Spoilt("q_sol", "string NA", "first"),))): "weather column 'q_sol'",
    Call("autocorrelation", Table(spoilt=(Spoilt("T_za", "1e300", "last"),))): "beyond 1e100",
    Call("score_intervals", arguments=(("by", "word"),)): "is not a column of the back-test",
    Call("score_intervals", Table(container="text")): "has no interval",
    Call("score_backtest", Table(columns=("T_oa", "q_sol"))): "no column 'y_true'",
    Call("DriftMonitor.watch", Table(columns=("T_oa", "q_sol"))): "2 steps",
    Call("DriftMonitor.watch", Table(container="masked array")): "give a DataFrame",
    Call("DriftMonitor.fit", Table(columns=())): "at least one column",
    Call("diagnose_residuals", Table(columns=("T_oa",))): "no column 'innovation'",
}


@pytest.mark.parametrize("call", FOUND, ids=repr)
def test_what_was_found_is_refused_now(call):
    outcome = call.outcome()
    assert outcome.kind == REFUSED, outcome
    assert any(words in outcome.detail for words in FOUND[call].split(" | ")), outcome.detail


def test_the_r2_of_one_row_is_nan_as_in_scikit_learn():
    assert Call("InputDisturbanceID.score", Table(1)).outcome().kind == ACCEPTED


def test_residuals_of_part_of_a_day_are_diagnosed():
    assert Call("diagnose_residuals", Table(step="1min")).outcome().kind == ACCEPTED


def test_an_array_has_the_columns_of_the_training_table():
    assert Call("InputDisturbanceID.transform", Table(container="list")).outcome().kind == ACCEPTED


def test_attributes_can_be_asked_for_where_no_intervals_were_learned():
    short = clone(ESTIMATORS["ARXRegressor"]).fit(training().X[:9], training().y[:9])
    assert not hasattr(short, "intervals_")
    assert "predict" in dir(short)


@pytest.mark.parametrize("n_calls", [100, pytest.param(400, marks=pytest.mark.slow)])
def test_odd_tables_are_accepted_or_refused(n_calls):
    @settings(max_examples=n_calls, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @seed(0)
    @given(calls(SLOW))
    def accepted_or_refused(call):
        outcome = call.outcome()
        assert not outcome.failed, f"{call!r}: {outcome}"

    accepted_or_refused()


@pytest.mark.parametrize("name", sorted(READERS))
def test_mutants_of_files_are_read_or_refused(name, tmp_path):
    for number in range(60):
        content, choice = mutant(name, number, tmp_path)
        outcome = READERS[name].read(content, choice, tmp_path)
        assert not outcome.failed, f"{name} {number}: {outcome}"


@pytest.mark.parametrize(("name", "number"), [("toml", 8950), ("toml", 10891), ("store", 11946)])
def test_mutants_that_were_found_are_refused_now(name, number, tmp_path):
    content, choice = mutant(name, number, tmp_path)
    assert READERS[name].read(content, choice, tmp_path).kind == REFUSED


def test_good_files_are_read(tmp_path):
    outcomes = good_files_are_read(tmp_path)
    refused = {name: o for name, o in outcomes.items() if o.kind != ACCEPTED}
    assert not refused


# ------------------------------------------------------------------------------------------- the judge can say no
def test_bare_errors_are_not_taken_for_refusals():
    def bare():
        np.zeros(3) + np.zeros(4)

    assert "broadcast" in observe(bare, lambda r, w: None).kind
    assert observe(lambda: {}["x"], lambda r, w: None).kind.startswith("KeyError")
    assert observe(lambda: np.zeros(1) / 0.0, lambda r, w: None).kind.startswith("RuntimeWarning")
    assert observe(lambda: int("warm"), lambda r, w: None).failed


def test_wrong_numbers_are_seen():
    assert "NaN" in wrong_numbers(np.array([1.0, np.nan]))
    assert "inf" in wrong_numbers(np.array([1.0, np.inf]), missing=True)
    assert "beyond" in wrong_numbers(np.array([1.0, 101.0]), temperature=("",))
    assert wrong_numbers(np.array([21.0, np.nan]), missing=True, temperature=("",)) is None


def test_slow_calls_are_seen():
    def forever():
        while True:
            pass

    assert observe(forever, lambda r, w: None, seconds=0.05).kind.startswith("takes longer")
