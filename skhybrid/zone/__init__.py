"""Daily work with one zone: a fitted model with the settings that read its log, tomorrow's forecast, and a folder."""

from .day_ahead import DayAhead, day_ahead
from .zone_folder import ZoneFolder
from .zone_model import ZoneModel

__all__ = ["DayAhead", "ZoneFolder", "ZoneModel", "day_ahead"]
