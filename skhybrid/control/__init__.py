"""Set-points, limits, plants and the heat that they require: plain matrices and states, no estimator."""

from .required_heat import (
    MOST_AHEAD,
    HeatedZone,
    LoadPaths,
    Plant,
    is_plant,
    load_frame,
    make_plant,
    required_heat,
    steps_ahead,
)
from .setpoints import Band, Limits, read_limits, read_setpoint

__all__ = [
    "MOST_AHEAD",
    "Band",
    "HeatedZone",
    "Limits",
    "LoadPaths",
    "Plant",
    "is_plant",
    "load_frame",
    "make_plant",
    "read_limits",
    "read_setpoint",
    "required_heat",
    "steps_ahead",
]
