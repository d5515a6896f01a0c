"""Set-points, limits, plants, required heat and affine forecasts: plain matrices and states, no estimator."""

from .affine import AffineForecast, ControlModel, LinearNetwork, gain_of, impulse_response
from .heat_plan import (
    Plan,
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
    WantedPaths,
    heat_column,
    load_frame,
    make_plant,
    required_heat,
    steps_ahead,
)
from .setpoints import FREE, Band, Limits, read_limits, read_plant_limits, read_setpoint, refuse_where
