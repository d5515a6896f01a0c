"""Displays of fitted models and back-tests, made with ``from_estimator`` or ``from_predictions`` as in scikit-learn.

Matplotlib is imported when a figure is drawn, not when this module is imported.
"""

from ._bode import BodeDisplay
from ._day import DayAheadDisplay
from ._disturbance import DisturbanceWeekDisplay
from ._forecast import ForecastDisplay
from ._lead import LeadErrorDisplay
from ._posterior import PosteriorDisplay
from ._profile import ProfileDisplay
from ._residuals import ResidualDisplay
from ._robustness import RobustnessDisplay
from ._schedule import ScheduleDisplay
from ._step_response import StepResponseDisplay
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
