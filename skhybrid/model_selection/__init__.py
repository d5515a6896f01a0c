"""Splitting and scoring in time order: cross-validation blocks and day-ahead back-tests, and the choice of a model."""

from .backtest import backtest, score_backtest, score_intervals
from .compare import ModelComparison, compare_models
from .design_matrix import DesignMatrix, design_matrix
from .expressiveness import PatternExpressiveness
from .robustness import RobustnessComparison
from .search import DesignMatrixSearchCV
from .select_case import CaseChoice, select_case
from .splitters import RollingOriginSplit

__all__ = [
    "CaseChoice",
    "DesignMatrix",
    "DesignMatrixSearchCV",
    "ModelComparison",
    "PatternExpressiveness",
    "RobustnessComparison",
    "RollingOriginSplit",
    "backtest",
    "compare_models",
    "design_matrix",
    "score_backtest",
    "score_intervals",
    "select_case",
]
