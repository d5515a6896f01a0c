"""HybridPredictor, where identification and forecasting meet (design 6), and what tells that it no longer holds."""

from .drift import DriftMonitor
from .predictor import HybridPredictor

__all__ = ["DriftMonitor", "HybridPredictor"]
