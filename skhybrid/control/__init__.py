"""Set-points, limits, plants, required heat and affine forecasts: plain matrices and states, no estimator."""

from .affine import AffineForecast, ControlModel, LinearNetwork, gain_of, impulse_response
from .heat_plan import (
    Plan,
    covered_by,
    decided_on,
    limits_of,
    planned,
    read_inputs,
    read_member,
    refuse_boundary,
    warn_bent,
    warn_uncovered,
)
from .required_heat import (
    MOST_AHEAD,
    HeatedZone,
    LoadPaths,
    Plant,
    load_frame,
    make_plant,
    required_heat,
    steps_ahead,
)
from .setpoints import Band, Limits, read_limits, read_setpoint

__all__ = [
    "MOST_AHEAD",
    "AffineForecast",
    "Band",
    "ControlModel",
    "HeatedZone",
    "Limits",
    "LinearNetwork",
    "LoadPaths",
    "Plan",
    "Plant",
    "covered_by",
    "decided_on",
    "gain_of",
    "impulse_response",
    "limits_of",
    "load_frame",
    "make_plant",
    "planned",
    "read_inputs",
    "read_limits",
    "read_member",
    "read_setpoint",
    "refuse_boundary",
    "required_heat",
    "steps_ahead",
    "warn_bent",
    "warn_uncovered",
]
