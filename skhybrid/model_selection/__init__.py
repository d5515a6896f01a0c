"""Splitting and scoring in time order: cross-validation blocks and day-ahead back-tests, and the choice of a model."""

from .backtest import backtest, score_backtest, score_intervals
from .compare import ModelComparison, compare_models
from .design_matrix import DesignMatrix, design_matrix
from .search import DesignMatrixSearchCV
from .splitters import RollingOriginSplit

__all__ = [
    "DesignMatrix",
    "DesignMatrixSearchCV",
    "ModelComparison",
    "RollingOriginSplit",
    "backtest",
    "compare_models",
    "design_matrix",
    "score_backtest",
    "score_intervals",
]
