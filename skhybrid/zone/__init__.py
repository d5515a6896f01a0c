"""Daily work with one zone: a fitted model with the settings that read its log, tomorrow's forecast, and a folder."""

from .day_ahead import DayAhead, day_ahead
from .emhass import EmhassExport, emhass_parameters
from .zone_folder import ZoneFolder
from .zone_model import ZoneModel

__all__ = ["DayAhead", "EmhassExport", "ZoneFolder", "ZoneModel", "day_ahead", "emhass_parameters"]
