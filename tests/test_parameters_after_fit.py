"""A parameter set after ``fit`` changes no forecast, but for those that the data contract names as read again."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from sklearn.linear_model import Ridge

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
from skhybrid.datasets import make_office
from skhybrid.forecasting import BoostedRegressor

pytestmark = pytest.mark.usefixtures("quick_fits")

N_TRAIN = 14 * 96
#: as docs/reference/data_contract.rst says; those of the second line say how a table is read, or refuse it
READ_AGAIN = {"horizon", "origin_step", "adapt"}
OF_TABLES = {"columns", "sampling_time"}
#: another valid value of each parameter
OTHERS = {
    "activation": "gelu",
    "alpha": 3.0,
    "batch_size": 32,
    "bounds": {"R_zo": (0.5, 2.0)},
    "calendar": False,
    "case": "case02",
    "device": "cpu:0",
    "disturbance": "output",
    "dropout": 0.3,
    "filter_size": 3,
    "forecaster": DisturbanceForecaster("last_week"),
    "gray_box": GrayBoxRC("1R1C", n_starts=1),
    "hidden_size": 6,
    "holidays": ["2023-07-14", "2023-07-15", "2023-07-17", "2023-07-18", "2023-07-19"],
    "intervals": False,
    "known": {"Q_h": 3.0},
    "learning_rate": 0.01,
    "max_epochs": 3,
    "max_iter": 15,
    "max_missing": 0.1,
    "measurement_sd": 0.3,
    "memory": "elsewhere",
    "model": "profile",
    "n_channels": 3,
    "n_input_lags": 4,
    "n_jobs": 2,
    "n_lags": 12,
    "n_layers": 2,
    "n_repeats": 2,
    "n_starts": 2,
    "network": "3R2C",
    "objective": "multi_step",
    "patience": 3,
    "pool_size": 2,
    "preprocess": Ridge(),
    "prior": "one",
    "priors": {"R_zo": (5.0, 1.5)},
    "purpose": "plan",
    "random_state": 7,
    "refit": True,
    "repeats": "mean",
    "residual_of": "last_week",
    "rho_box": "paper",
    "time_encoding": "onehot",
    "validation_fraction": 0.3,
    "variance": "3h",
    "verbose": 1,
    "warmup": "6h",
}
ONE = {"n_starts": 1, "random_state": 0}
MODELS = [
    *[
        method(horizon="1D", **ONE)
        for method in (GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID)
    ],
    ARXRegressor(),
    ARXRegressor(objective="multi_step", adapt="refit"),
    BoostedRegressor(residual_of="arx", max_iter=10, random_state=0),
    *[DisturbanceForecaster(model) for model in ("ridge", "profile", "last_week", "persistence", Ridge())],
    DisturbanceForecaster("mlp", max_epochs=2, hidden_size=4, random_state=0),
    HybridPredictor(network="1R1C", adapt="linear"),
    SchedulePredictor("2R2C", adapt=None),
    TwoStagePredictor(InputDisturbanceID(**ONE), DisturbanceForecaster("profile")),
]


@pytest.fixture(scope="module")
def rows():
    """Rows of the room, and hourly ones of its unmeasured heat."""
    office = make_office(n_days=17, random_state=0)
    room = office.X.assign(T_za=office.y)
    heat = room[["T_oa", "q_sol"]].assign(zeta=office.heat_gain + 0.01 * np.arange(len(room)) / 96)
    return room, heat.resample("1h").mean()


def _forecasts(model, X, n):
    """All that the fitted model says of rows that follow the training, and of rows that do not."""
    first, ahead = X[:n], X[n:]
    found = {"predict": model.predict(ahead), "cold": model.predict(first)}
    if hasattr(model, "forecast"):
        found["forecast"] = model.forecast(ahead[:-24], ahead[-24:].drop(columns=["T_za", "zeta"], errors="ignore"))
    if hasattr(model, "predict_load"):
        found["load"] = model.predict_load(ahead, 21.0)
    if hasattr(model, "predict_quantiles"):
        found["quantiles"] = model.predict_quantiles(ahead, [0.1, 0.9])
    if hasattr(model, "transform"):
        found["transform"] = model.transform(ahead)
    if hasattr(model, "update"):
        found["updated"] = deepcopy(model).update(ahead[:48]).predict(ahead[48:])
    return {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@pytest.mark.parametrize("model", MODELS, ids=lambda model: " ".join(repr(model).split())[:60])
def test_parameters_set_after_fit_change_no_forecast(model, rows):
    X, n = (rows[1], N_TRAIN // 4) if isinstance(model, DisturbanceForecaster) else (rows[0], N_TRAIN)
    model = deepcopy(model).fit(X[:n], X["zeta" if "zeta" in X else "T_za"][:n])
    expected = _forecasts(model, X, n)
    for name in set(model.get_params(deep=False)) - READ_AGAIN - OF_TABLES:
        found = _forecasts(deepcopy(model).set_params(**{name: OTHERS[name]}), X, n)
        for kind, values in expected.items():
            np.testing.assert_array_equal(found[kind], values, err_msg=f"{kind} after set_params({name}=...)")


def test_the_adaptation_of_arx_is_checked_when_it_is_read(rows):
    """Any word counted as ``"refit"``."""
    model = ARXRegressor(intervals=False).fit(rows[0][:N_TRAIN], rows[0]["T_za"][:N_TRAIN]).set_params(adapt="full")
    with pytest.raises(ValueError, match="adapt='full' is not known; use None or 'refit'"):
        model.predict(rows[0][N_TRAIN:])
