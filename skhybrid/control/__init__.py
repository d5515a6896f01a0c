"""Set-points, limits and plants: the parts of load prediction that know matrices and states, but no estimator."""

from .hold import MOST_AHEAD, steps_ahead
from .plant import Plant, is_plant, load_frame, make_plant
from .setpoints import Band, Limits, read_limits, read_setpoint

__all__ = [
    "MOST_AHEAD",
    "Band",
    "Limits",
    "Plant",
    "is_plant",
    "load_frame",
    "make_plant",
    "read_limits",
    "read_setpoint",
    "steps_ahead",
]
