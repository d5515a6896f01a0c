"""Estimators that stand in the leaderboard beside the default: what ships with the package, and two of scikit-learn."""

from __future__ import annotations

from sklearn.base import BaseEstimator
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from skhybrid.forecasting import ARXRegressor, BoostedRegressor


def multi_step_arx() -> BaseEstimator:
    """ARX fitted on errors at many leads, and fitted again at every origin."""
    return ARXRegressor(objective="multi_step", adapt="refit")


def boosting_on_arx() -> BaseEstimator:
    """Boosted trees on what ARX leaves."""
    return BoostedRegressor(residual_of="arx", random_state=0)


def boosting() -> BaseEstimator:
    """Boosted trees by lead, with the temperatures up to the origin."""
    return BoostedRegressor(random_state=0)


def plain_boosting() -> BaseEstimator:
    """scikit-learn's boosted trees on weather and heat of the same row."""
    return HistGradientBoostingRegressor(random_state=0)


def plain_ridge() -> Pipeline:
    """scikit-learn's ridge regression on weather and heat of the same row."""
    return make_pipeline(StandardScaler(), RidgeCV())
