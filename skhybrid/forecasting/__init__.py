"""Forecasts of the disturbance (networks, ridge, baselines) and, for comparison, of the temperature itself."""

from .arx import ARXRegressor
from .boosting import BoostedRegressor
from .cases import ModelCase, list_cases, list_sizes
from .forecaster import DisturbanceForecaster
from .joint_fit import fit_many
from .weather_error import WeatherError

__all__ = [
    "ARXRegressor",
    "BoostedRegressor",
    "DisturbanceForecaster",
    "ModelCase",
    "WeatherError",
    "fit_many",
    "list_cases",
    "list_sizes",
]
