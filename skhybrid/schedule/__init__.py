"""Schedule model: an RC network with schedules of gain and conductance, fitted on forecast errors at all leads.

Files, in the order in which they build on one another: ``part_load`` and ``channels`` (inputs with a coefficient),
``emitter``, ``segment`` (rows), ``filter_model`` (matrices), ``responses`` (simulation and filter),
``constrained_ridge`` and ``lead_problem`` (objective), ``left_out_blocks`` (shrinkage), ``fit``; online,
``completed_forecasts``, ``coefficient_memory``, ``online_network``, ``network_refit`` and ``rolling_network``; then
``schedule_loads`` and ``scheduled_network`` (a fit in the user's terms).  The equations are in
``docs/user_guide/hybrid.rst``.
"""

from .error_history import ErrorHistory
from .fit import LeadFit, fit_leads
from .rolling_network import RollingNetwork, forecast_from_origins
from .schedule_loads import loads
from .scheduled_network import ScheduledNetwork
from .segment import NumberedSegment, Segment, make_segment

__all__ = [
    "ErrorHistory",
    "LeadFit",
    "NumberedSegment",
    "RollingNetwork",
    "ScheduledNetwork",
    "Segment",
    "fit_leads",
    "forecast_from_origins",
    "loads",
    "make_segment",
]
