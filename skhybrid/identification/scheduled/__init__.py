"""A network with schedules of gains and conductance, fitted on the errors of forecasts at all leads (design 6)."""

from .adaptation import Followed, Later, follow
from .fit import LeadFit, fit_leads
from .load import loads
from .network import ScheduledNetwork
from .responses import Sample, make_stretch

__all__ = ["Followed", "Later", "LeadFit", "Sample", "ScheduledNetwork", "fit_leads", "follow", "loads", "make_stretch"]
