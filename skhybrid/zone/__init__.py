"""Daily work with one zone: a fitted model with the settings that read its log, and tomorrow's forecast."""

from .model import ZoneModel
from .tomorrow import RowsAhead, rows_ahead

__all__ = ["RowsAhead", "ZoneModel", "rows_ahead"]
