"""Splitting and scoring in time order: cross-validation blocks and day-ahead back-tests, and the choice of a model."""

from .backtest import backtest, score_backtest, score_intervals
from .compare import ModelComparison, compare_models
from .expressiveness import PatternExpressiveness
from .robustness import RobustnessComparison
from .select_case import CaseChoice, select_case
from .splitters import RollingOriginSplit

__all__ = [
    "CaseChoice",
    "ModelComparison",
    "PatternExpressiveness",
    "RobustnessComparison",
    "RollingOriginSplit",
    "backtest",
    "compare_models",
    "score_backtest",
    "score_intervals",
    "select_case",
]
