"""Displays of fitted models and back-tests, as in scikit-learn; matplotlib is imported when a figure is drawn."""

from ._disturbance import DisturbanceWeekDisplay, ScheduleDisplay
from ._forecast import DayAheadDisplay, ForecastDisplay, LeadErrorDisplay
from ._identification_displays import ProfileDisplay, ResidualDisplay
from ._posterior import PosteriorDisplay, RobustnessDisplay
from ._response_display import BodeDisplay, StepResponseDisplay
from ._room_map import RoomMapDisplay

__all__ = [
    "BodeDisplay",
    "DayAheadDisplay",
    "DisturbanceWeekDisplay",
    "ForecastDisplay",
    "LeadErrorDisplay",
    "PosteriorDisplay",
    "ProfileDisplay",
    "ResidualDisplay",
    "RobustnessDisplay",
    "RoomMapDisplay",
    "ScheduleDisplay",
    "StepResponseDisplay",
]
