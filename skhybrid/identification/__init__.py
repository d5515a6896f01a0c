"""Identification of a thermal network in spite of heat that nobody measures."""

from .base import StateSpace
from .identifiability import Identifiability
from .least_squares import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID
from .periodic_estimator import PeriodicDisturbanceID
from .response import frequency_response, make_state_space, step_response

__all__ = [
    "GrayBoxRC",
    "Identifiability",
    "InputDisturbanceID",
    "OutputDisturbanceID",
    "PeriodicDisturbanceID",
    "StateSpace",
    "frequency_response",
    "make_state_space",
    "step_response",
]
