"""Hybrid predictors: a thermal network joined to a forecast of its disturbance, and a drift monitor."""

from ..control import AffineForecast, ControlModel
from .building.building_predictor import BuildingPredictor
from .drift import DriftMonitor
from .predictor import HybridPredictor
from .schedule_predictor import SchedulePredictor
from .two_stage_predictor import TwoStagePredictor

__all__ = [
    "AffineForecast",
    "BuildingPredictor",
    "ControlModel",
    "DriftMonitor",
    "HybridPredictor",
    "SchedulePredictor",
    "TwoStagePredictor",
]
