"""Estimators with small budgets, and the same fitted on the training table."""

from __future__ import annotations

from functools import cache
from typing import Any

from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from zone_tables import training

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
from skhybrid.forecasting import BoostedRegressor
from skhybrid.model_selection import DesignMatrixSearchCV, RollingOriginSplit
from skhybrid.preprocessing import FacadeIrradiance, GapFiller, UnitConverter

ONE_NODE = {"n_starts": 1, "random_state": 0}
_KNOWN = {"C_za": 3.0, "R_zo": 3.0, "A_win": 2.0, "Q_h": 6.0, "Q_c": -6.0}
_TINY = {"max_epochs": 1, "hidden_size": 2, "n_channels": 2, "random_state": 0}
NETWORKS = tuple(f"DisturbanceForecaster, {kind}" for kind in ("mlp", "cnn", "rnn", "lstm"))
ESTIMATORS: dict[str, Any] = {
    "GrayBoxRC": GrayBoxRC("1R1C", **ONE_NODE),
    "GrayBoxRC, all known": GrayBoxRC("1R1C", known=_KNOWN, **ONE_NODE),
    "InputDisturbanceID": InputDisturbanceID("1R1C", **ONE_NODE),
    "OutputDisturbanceID": OutputDisturbanceID("1R1C", **ONE_NODE),
    "PeriodicDisturbanceID": PeriodicDisturbanceID("1R1C", **ONE_NODE),
    "ARXRegressor": ARXRegressor(n_lags=3, n_input_lags=2, calendar=False),
    "ARXRegressor, refit": ARXRegressor(n_lags=2, n_input_lags=1, adapt="refit"),
    "ARXRegressor, multi-step": ARXRegressor(n_lags=2, n_input_lags=1, calendar=False, objective="multi_step"),
    "BoostedRegressor": BoostedRegressor(max_iter=3),
    "DisturbanceForecaster, profile": DisturbanceForecaster("profile"),
    "DisturbanceForecaster, last week": DisturbanceForecaster("last_week"),
    "DisturbanceForecaster, persistence": DisturbanceForecaster("persistence"),
    "DisturbanceForecaster, ridge": DisturbanceForecaster("ridge"),
    "DisturbanceForecaster, regressor": DisturbanceForecaster(Ridge()),
    **{name: DisturbanceForecaster(name.split(", ")[1], **_TINY) for name in NETWORKS},
    "HybridPredictor": HybridPredictor(network="1R1C"),
    "SchedulePredictor": SchedulePredictor(network="1R1C", adapt=None),
    "SchedulePredictor, set-points": SchedulePredictor(network="1R1C"),
    "BuildingPredictor": BuildingPredictor(SchedulePredictor(network="1R1C", adapt=None)),
    "TwoStagePredictor": TwoStagePredictor(InputDisturbanceID("1R1C", **ONE_NODE), DisturbanceForecaster("profile")),
    "Pipeline": make_pipeline(UnitConverter(), GapFiller(), ARXRegressor(n_lags=3, n_input_lags=2, calendar=False)),
    "DesignMatrixSearchCV, ARXRegressor": DesignMatrixSearchCV(
        ARXRegressor(n_lags=3, n_input_lags=2, calendar=False, horizon="6h"),
        {"alpha": [0.1, 10.0]},
        cv=RollingOriginSplit(train="1D", test="12h", n_splits=2),
        verbose=0,
    ),
    "GapFiller": GapFiller("3h"),
    "UnitConverter": UnitConverter({"T_oa": "degF"}),
    "FacadeIrradiance": FacadeIrradiance(52.4, 4.9),
}
SETPOINTS = ", set-points"  # end of the names of estimators that learn a thermostat
TRANSFORMERS = ("GapFiller", "UnitConverter", "FacadeIrradiance")


@cache
def fitted(name: str) -> Any:
    """An estimator, fitted on the training table."""
    X, y = training().with_setpoints if name.endswith(SETPOINTS) else training().X, training().y
    if name.startswith("DisturbanceForecaster"):
        return clone(ESTIMATORS[name]).fit(X, y - 22.0)
    return clone(ESTIMATORS[name]).fit(X, y)
