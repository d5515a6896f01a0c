"""HybridPredictor, where identification and forecasting meet (design 6)."""

from .predictor import HybridPredictor

__all__ = ["HybridPredictor"]
