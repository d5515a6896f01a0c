"""Daily work with one zone: a fitted model with the settings that read its log, and tomorrow's forecast."""

from .day_ahead import DayAhead, day_ahead
from .zone_model import ZoneModel

__all__ = ["DayAhead", "ZoneModel", "day_ahead"]
