"""Identification of a thermal network in spite of heat that nobody measures."""

from .base import StateSpace
from .identifiability import Identifiability
from .least_squares import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID
from .periodic_estimator import PeriodicDisturbanceID

__all__ = [
    "GrayBoxRC",
    "Identifiability",
    "InputDisturbanceID",
    "OutputDisturbanceID",
    "PeriodicDisturbanceID",
    "StateSpace",
]
