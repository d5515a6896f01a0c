"""A call that fails leaves an estimator exactly as it was: every estimator, many bad tables, faults at any depth."""

from __future__ import annotations

import copy
import importlib
import pkgutil
import sys
from importlib.util import find_spec
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator

import skhybrid
from skhybrid import (
    ARXRegressor,
    BuildingPredictor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid.datasets import make_office
from skhybrid.fleet import ZoneFleet
from skhybrid.forecasting import BoostedRegressor, forecaster
from skhybrid.model_selection import DesignMatrixSearchCV, PatternExpressiveness, RobustnessComparison, design_matrix
from skhybrid.model_selection.choice import pattern_expressiveness, robustness_comparison
from skhybrid.preprocessing import FacadeIrradiance, GapFiller, UnitConverter
from skhybrid.study.compared_models import Yesterday

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning"),
    pytest.mark.filterwarnings("ignore:.*failed:sklearn.exceptions.FitFailedWarning"),
]
ONE = {"n_starts": 1, "random_state": 0}
CASES = {
    "conventional": GrayBoxRC(**ONE),
    "conventional, multi-step": GrayBoxRC(**ONE, objective="multi_step", horizon="6h"),
    "input": InputDisturbanceID(**ONE),
    "output": OutputDisturbanceID(**ONE),
    "periodic": PeriodicDisturbanceID(**ONE, known={"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "Q_h": 6.0}),
    "ARX": ARXRegressor(adapt="refit", horizon="12h"),
    "ARX, multi-step": ARXRegressor(adapt="refit", objective="multi_step", horizon="12h"),
    "boosting": BoostedRegressor(residual_of="arx", horizon="12h", max_iter=20, random_state=0),
    "forecaster": DisturbanceForecaster("ridge"),
    "hybrid": HybridPredictor(),
    "schedule": SchedulePredictor(),
    "building": BuildingPredictor(SchedulePredictor("1R1C")),
    "two-stage": TwoStagePredictor(GrayBoxRC(**ONE), DisturbanceForecaster("ridge"), random_state=0),
    "units": UnitConverter(),
    "gaps": GapFiller(),
    "facades": FacadeIrradiance(42.0, -88.0, timezone="Etc/GMT+6"),
    "search": DesignMatrixSearchCV(
        TwoStagePredictor(GrayBoxRC(**ONE), random_state=0), design_matrix(["profile"], disturbance="input"), verbose=0
    ),
    "yesterday": Yesterday(),
}
if find_spec("torch") and find_spec("skorch"):
    CASES["network"] = DisturbanceForecaster("lstm", max_epochs=2, hidden_size=3, random_state=0)
#: their posterior takes seconds to sample; see the last test
SAMPLED = {PatternExpressiveness, RobustnessComparison}
#: takes tables of many zones, and keeps its models in files; see test_fleet.py
FLEETS = {ZoneFleet}
TRANSFORMERS = {"units", "gaps", "facades"}
TRAIN, AHEAD = slice(0, 240), slice(240, 288)


def test_every_estimator_of_the_package_is_here():
    found, package = set(), Path(skhybrid.__file__).parent
    for module in pkgutil.walk_packages([str(package)], "skhybrid."):
        if not module.name.startswith(("skhybrid.forecasting.networks", "skhybrid.__main__")):  # torch
            members = vars(importlib.import_module(module.name)).values()
            found |= {c for c in members if isinstance(c, type) and issubclass(c, BaseEstimator)}
    found = {c for c in found if c.__module__.startswith("skhybrid.")}
    bases = {base for c in found for base in c.__mro__[1:]}
    assert found - bases == {type(model) for model in CASES.values()} | SAMPLED | FLEETS


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=12, sampling_time="1h", start="2023-01-09", random_state=0)


@pytest.fixture(scope="module")
def fitted(office):
    """Every estimator after its fit."""
    return {name: copy.deepcopy(model).fit(office.X[TRAIN], office.y[TRAIN]) for name, model in CASES.items()}


# ------------------------------------------------------------------------------------------------------- what may fail
def _set(X, column, row, value):
    out = X.copy()
    out.iloc[row, out.columns.get_loc(column)] = value
    return out


BAD = {
    "NaN": lambda X, y: (_set(X, "T_oa", 5, np.nan), y),
    "inf": lambda X, y: (_set(X, "q_sol", 7, np.inf), y),
    "fill value": lambda X, y: (_set(X, "T_oa", slice(3, 9), 9.97e36), y),
    "fill value in y": lambda X, y: (X, y.where(np.arange(len(y)) > 2, 9.97e36)),
    "inf in y": lambda X, y: (X, y.where(np.arange(len(y)) > 2, np.inf)),
    "other step": lambda X, y: (X[::2], y[::2]),
    "uneven steps": lambda X, y: (X.drop(X.index[4]), y.drop(y.index[4])),
    "another column instead": lambda X, y: (X.rename(columns={"T_oa": "outside"}), y),
    "no rows": lambda X, y: (X[:0], y[:0]),
    "one row": lambda X, y: (X[:1], y[:1]),
    "column twice": lambda X, y: (pd.concat([X, X[["q_sol"]]], axis=1), y),
    "y too short": lambda X, y: (X, y[:-3]),
    "y all NaN": lambda X, y: (X, y * np.nan),
    "text": lambda X, y: (X.astype({"q_sol": object}).replace({"q_sol": {0.0: "dark"}}), y),
    "no table": lambda X, y: (None, y),
}
#: what a fit refuses at least, where that is not everything: any column is an input of a black box, the heat that a
#: forecaster learns has no range, and transformers learn nothing from values
REFUSED = {name: {"column twice", "no table"} for name in ("units", "gaps", "facades")} | {
    "ARX": set(BAD) - {"other step", "another column instead"},
    "forecaster": set(BAD) - {"other step", "another column instead", "fill value in y"},
    "yesterday": set(),
}
REFUSED["network"] = REFUSED["forecaster"]
REFUSED["ARX, multi-step"] = REFUSED["boosting"] = REFUSED["ARX"]
CALLS = {
    "fit": lambda model, X, y: model.fit(X, y),
    "partial_fit": lambda model, X, y: model.partial_fit(X, y),
    "update": lambda model, X, y: model.update(X, y),
    "predict": lambda model, X, y: model.predict(X),
    "predict_from": lambda model, X, y: model.predict_from(X, [3, 20], "6h"),
    "predict_quantiles": lambda model, X, y: model.predict_quantiles(X),
    "predict_load": lambda model, X, y: model.predict_load(X, 21.0),
    "forecast": lambda model, X, y: model.forecast(None, X),
    "drift": lambda model, X, y: model.drift(X),
    "simulate": lambda model, X, y: model.simulate(X),
    "estimate_disturbance": lambda model, X, y: model.estimate_disturbance(X, kind="output", smooth=True),
    "transform": lambda model, X, y: model.transform(X),
}
LEARNING = ("fit", "partial_fit", "update")


def calls_of(model):
    return [name for name in CALLS if hasattr(model, name)]


def outputs(model, office):
    """Everything that a fitted estimator returns for later rows, as hashes of its bits."""
    X, y = office.X[AHEAD], office.y[AHEAD]
    found = {name: CALLS[name](model, X, y) for name in calls_of(model) if name not in LEARNING}
    return {name: joblib.hash(value) for name, value in found.items()}


def held(model):
    """The attributes, by identity."""
    return {name: id(value) for name, value in vars(model).items()}


def assert_unfitted(model):
    assert not [name for name in vars(model) if name.endswith("_") or name.startswith("_")]


@pytest.mark.parametrize("name", CASES)
def test_a_refused_table_changes_nothing(name, fitted, office):
    known, fresh = copy.deepcopy(fitted[name]), copy.deepcopy(CASES[name])
    expected, refused = outputs(known, office), set()
    before, unfitted = held(known), held(fresh)
    for call in calls_of(known):
        rows = TRAIN if call == "fit" else AHEAD
        for table, spoiled in BAD.items():
            bad = spoiled(office.X[rows], office.y[rows])
            for model, was in ((known, before), (fresh, unfitted)):
                tried = copy.copy(model) if call in LEARNING else model  # one that accepts it becomes another
                try:
                    CALLS[call](tried, *bad)
                except Exception:
                    refused.add((call, table))
                    assert held(tried) == was, (call, table)
    assert {table for call, table in refused if call == "fit"} >= REFUSED.get(name, set(BAD) - {"other step"})
    assert held(known) == before
    assert outputs(known, office) == expected
    assert_unfitted(fresh)


class Interrupt:
    """Counts the calls of the package's functions, and interrupts one of them."""

    def __init__(self, at=None):
        self.at, self.count = at, 0

    def __call__(self, frame, event, arg):
        code = frame.f_code
        if event != "call" or "skhybrid/" not in code.co_filename or code.co_filename.endswith(OWN):
            return
        self.count += 1
        if self.count == self.at:
            raise KeyboardInterrupt(f"in {code.co_name}")

    def during(self, call):
        sys.setprofile(self)
        try:
            call()
        finally:
            sys.setprofile(None)


#: the decorators themselves
OWN = ("_transaction.py", "_threads.py")


@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_an_interrupt_at_any_depth_changes_nothing(name, fitted, office):
    known, fresh = copy.deepcopy(fitted[name]), copy.deepcopy(CASES[name])
    expected = outputs(known, office)
    before, unfitted = held(known), held(fresh)
    for call in calls_of(known):
        X, y = (part[TRAIN if call == "fit" else AHEAD] for part in (office.X, office.y))
        counter, other = Interrupt(), copy.deepcopy(known)
        counter.during(lambda call=call, X=X, y=y, other=other: CALLS[call](other, X, y))
        missed = 0
        for share in (0.3, 0.95) if call in LEARNING else (0.8,):
            for model, was in ((known, before), (fresh, unfitted))[: 1 + (call == "fit" and share > 0.9)]:
                tried = copy.copy(model)  # what it shares with the model shows below whether it was modified
                interrupt = Interrupt(max(1, int(share * counter.count)))
                try:
                    interrupt.during(lambda call=call, X=X, y=y, tried=tried: CALLS[call](tried, X, y))
                except KeyboardInterrupt:
                    assert held(tried) == was, (call, share)
                else:
                    missed += 1
        assert missed < 2, call  # what is computed once leaves fewer calls to later runs
    assert outputs(known, office) == expected
    assert_unfitted(fresh)


def interrupt(*args):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("make", "target", "step"),
    [(GrayBoxRC, GrayBoxRC, "_store"), (DisturbanceForecaster, forecaster, "fit_baseline")],
)
def test_a_random_generator_is_set_back(make, target, step, office, monkeypatch):
    rng = np.random.RandomState(0)
    model = make(**({"n_starts": 1} if make is GrayBoxRC else {"model": "ridge"}), random_state=rng)
    monkeypatch.setattr(target, step, interrupt)  # after the draws
    with pytest.raises(KeyboardInterrupt):
        model.fit(office.X, office.y)
    assert rng.uniform() == np.random.RandomState(0).uniform()


@pytest.mark.parametrize(
    ("model", "fails", "last"),
    [
        (PatternExpressiveness(["framework"]), pattern_expressiveness, "_priors_as_text"),
        (RobustnessComparison(by="framework"), robustness_comparison, "_difference"),
    ],
)
def test_an_interrupted_comparison_changes_nothing(model, fails, last, monkeypatch):
    rng = np.random.default_rng(0)
    results = pd.DataFrame({"framework": ["mlp", "lstm", "rnn"] * 4, "rmse": 0.5 + rng.uniform(size=12)})

    def sampled(self, *args):  # without the sampler
        drawn = pd.DataFrame(rng.normal(size=(50, 5)), columns=["mlp", "lstm", "rnn", "intercept", "sigma"])
        return {"mu": drawn, "sigma": drawn.abs()}, drawn

    monkeypatch.setattr(RobustnessComparison, "_sample", sampled)
    monkeypatch.setattr(PatternExpressiveness, "_sample", lambda self, terms, *args: _draws(terms, rng))
    monkeypatch.setattr(pattern_expressiveness.posterior, "refuse_bad_chains", lambda *args: None)
    fitted = copy.deepcopy(model).fit(results)
    monkeypatch.setattr(fails, last, interrupt)
    for one in (fitted, model):
        before = held(one)
        with pytest.raises(KeyboardInterrupt):
            one.fit(results)
        assert held(one) == before
    assert_unfitted(model)


def _draws(terms, rng):
    index = pd.MultiIndex.from_product([range(4), range(50)], names=["chain", "draw"])
    names = [*terms.columns, "intercept", "sigma"]
    return pd.DataFrame(rng.normal(size=(200, len(names))), index, names), 0
