"""Displays of fitted models and back-tests, made with ``from_estimator`` or ``from_predictions`` as in scikit-learn.

Matplotlib is imported when a figure is drawn, not when this module is imported.
"""

from ._day import DayAheadDisplay
from ._disturbance import DisturbanceWeekDisplay, ScheduleDisplay
from ._forecast import ForecastDisplay, LeadErrorDisplay
from ._posterior import PosteriorDisplay, RobustnessDisplay
from ._profile import ProfileDisplay
from ._residuals import ResidualDisplay
from ._response_display import BodeDisplay, StepResponseDisplay
from ._style import blank_axes

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
    "ScheduleDisplay",
    "StepResponseDisplay",
    "blank_axes",
]
