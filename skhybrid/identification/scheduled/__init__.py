"""A network with schedules of gains and conductance, fitted on the errors of forecasts at all leads (design 6)."""

from .adaptation import GrowingErrors, Later, Learner, follow
from .fit import LeadFit, fit_leads
from .load import loads
from .network import ScheduledNetwork
from .responses import Sample, Stretch, make_stretch

__all__ = [
    "GrowingErrors",
    "Later",
    "LeadFit",
    "Learner",
    "Sample",
    "ScheduledNetwork",
    "Stretch",
    "fit_leads",
    "follow",
    "loads",
    "make_stretch",
]
