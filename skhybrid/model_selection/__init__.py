"""Model selection in time order: splits, back-tests, comparisons, and the search over the design matrix."""

from .backtest import backtest, score_backtest, score_intervals
from .choice.case_rules import CaseChoice, select_case
from .choice.pattern_expressiveness import PatternExpressiveness
from .choice.robustness_comparison import RobustnessComparison
from .compare import ModelComparison, compare_models
from .scorers import DayAheadScorer, day_ahead_scorer, quantile_scorer
from .search.design_matrix import DesignMatrix, design_matrix
from .search.design_matrix_search import DesignMatrixSearchCV
from .splitters import RollingOriginSplit

__all__ = [
    "CaseChoice",
    "DayAheadScorer",
    "DesignMatrix",
    "DesignMatrixSearchCV",
    "ModelComparison",
    "PatternExpressiveness",
    "RobustnessComparison",
    "RollingOriginSplit",
    "backtest",
    "compare_models",
    "day_ahead_scorer",
    "design_matrix",
    "quantile_scorer",
    "score_backtest",
    "score_intervals",
    "select_case",
]
