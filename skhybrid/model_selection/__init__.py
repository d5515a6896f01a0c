"""Splitting and scoring in time order: cross-validation blocks and day-ahead back-tests."""

from .backtest import backtest, score_backtest
from .splitters import RollingOriginSplit

__all__ = ["RollingOriginSplit", "backtest", "score_backtest"]
