"""Schedule model: an RC network with schedules of gain and conductance, fitted on forecast errors at all leads.

Reading order: ``channels`` (inputs with a coefficient), ``segment`` (rows), ``filter_model`` (matrices), ``responses``
(simulation and filter), ``constrained_ridge`` and ``lead_problem`` (objective), ``fit`` and ``days_off``; online,
``online_network`` and ``rolling_network``; then ``schedule_loads`` and ``scheduled_network`` (a fit in the user's
terms).  The equations are in ``docs/explanation/schedule_model.rst``.
"""

from .days_off import warn_of_days_off
from .fit import LeadFit, fit_leads
from .gain_error import LITTLE_ERROR, days_to_determine, step_gain, step_gain_error
from .network_prior import NetworkPrior, NetworkSums
from .network_response import NetworkResponse
from .online_network import OriginState
from .plant_model import bends_at, plant_gain, scheduled_linear_network
from .rolling_network import ErrorHistory, RollingNetwork
from .schedule_loads import heat_frame, load_paths, loads, plant_heat
from .scheduled_network import ScheduledNetwork
from .segment import NumberedSegment, Segment, make_segment

__all__ = [
    "LITTLE_ERROR",
    "ErrorHistory",
    "LeadFit",
    "NetworkPrior",
    "NetworkResponse",
    "NetworkSums",
    "NumberedSegment",
    "OriginState",
    "RollingNetwork",
    "ScheduledNetwork",
    "Segment",
    "bends_at",
    "days_to_determine",
    "fit_leads",
    "heat_frame",
    "load_paths",
    "loads",
    "make_segment",
    "plant_gain",
    "plant_heat",
    "scheduled_linear_network",
    "step_gain",
    "step_gain_error",
    "warn_of_days_off",
]
