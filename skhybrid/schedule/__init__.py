"""A network with schedules of gains and conductance, fitted on the errors of forecasts at all leads (design 6)."""

from .fit import LeadFit, fit_leads
from .online_updating import GrowingErrors, Later, Learner, follow
from .required_heat import loads
from .responses import Stretch, make_stretch
from .scheduled_network import ScheduledNetwork

__all__ = [
    "GrowingErrors",
    "Later",
    "LeadFit",
    "Learner",
    "ScheduledNetwork",
    "Stretch",
    "fit_leads",
    "follow",
    "loads",
    "make_stretch",
]
