"""A network with schedules of gains and conductance, fitted on the errors of forecasts at all leads (design 6)."""

from .fit import LeadFit, fit_leads
from .lead_problem import Part
from .online_updating import ErrorHistory, NumberedSegment, RollingNetwork, follow
from .required_heat import loads
from .responses import Segment, make_segment
from .scheduled_network import ScheduledNetwork

__all__ = [
    "ErrorHistory",
    "LeadFit",
    "NumberedSegment",
    "Part",
    "RollingNetwork",
    "ScheduledNetwork",
    "Segment",
    "fit_leads",
    "follow",
    "loads",
    "make_segment",
]
