"""Hybrid predictors: a thermal network joined to a forecast of its disturbance (design 6), and a drift monitor."""

from .drift import DriftMonitor
from .predictor import HybridPredictor
from .schedule_predictor import SchedulePredictor
from .two_stage_predictor import TwoStagePredictor

__all__ = ["DriftMonitor", "HybridPredictor", "SchedulePredictor", "TwoStagePredictor"]
