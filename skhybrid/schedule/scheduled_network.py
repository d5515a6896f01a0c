"""Parameters of a fitted schedule model in the user's terms: network, filter, schedules of gain and conductance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .._table import ZoneTable
from ..thermal import RCNetwork
from .channels import UA_DIFFERENCE, ChannelPlan, make_channels
from .filter_model import FILTER_PARAMETERS
from .fit import LeadFit

_HOURS = 24


@dataclass(frozen=True)
class ScheduledNetwork:
    """A network with schedules of unmeasured heat, fitted on the errors of forecasts at all leads.

    Its parameters serve forecasts: they are not the building's, for which the identifications are made.

    Attributes
    ----------
    network_ : RCNetwork
    theta_ : Series
        Resistances [K/kW] and capacitances [kWh/K].
    disturbance_ : Series
        Of the filter: ``sigma_x`` [K/sqrt(h)], ``sigma_g`` [kW], ``tau_g`` [h], and an emitter's lag ``tau_e`` [h].
    coef_ : Series
        Each linear coefficient, by channel.
    schedule_ : DataFrame
        Unmeasured heat ``gain`` [kW], and conductance to the outside beyond the network's own, ``ua`` [kW/K], by day
        type and hour: the mean of the five weekdays or of the two days of the weekend.  Both may be negative.
    plan_ : ChannelPlan
        Channels of the model.
    """

    network_: RCNetwork
    theta_: pd.Series
    disturbance_: pd.Series
    coef_: pd.Series
    schedule_: pd.DataFrame
    plan_: ChannelPlan

    @classmethod
    def of(cls, fit: LeadFit) -> ScheduledNetwork:
        values = pd.Series(np.exp(fit.psi), fit.model.names)
        coef, of_filter = pd.Series(fit.coef, fit.problem.channels), list(FILTER_PARAMETERS)
        schedule = _schedule(coef, fit.plan)
        return cls(fit.model.network, values.drop(of_filter), values[of_filter], coef, schedule, fit.plan)

    def heat_at(self, table: ZoneTable) -> pd.Series:
        """Scheduled heat over the rows of a table [kW]."""
        channels = make_channels(self.plan_, table)
        return pd.Series(channels.scheduled_heat(self.coef_.to_numpy()), table.index, name="zeta")


def _schedule(coef: pd.Series, plan: ChannelPlan) -> pd.DataFrame:
    index = pd.MultiIndex.from_product([("weekday", "weekend"), range(_HOURS)], names=["day", "hour"])
    out = pd.DataFrame(0.0, index, ["gain", "ua"])
    swapped = np.array([coef.get(f"gain_swapped_{d}", 0.0) for d in range(7)])
    toward_other = 2.0 * np.array([swapped[:5].mean(), -swapped[5:].mean()])
    fitted = np.array(plan.contrast) if plan.contrast else np.zeros((2, _HOURS))
    for (kind, unit), of_kind in zip((("gain", 1.0), ("ua", UA_DIFFERENCE)), fitted, strict=True):
        if kind not in coef:
            continue
        hours = [coef.get(f"{kind}_hour_{h}", 0.0) for h in range(_HOURS)]
        contrast = np.array([coef.get(f"{kind}_day_type_{h}", 0.0) for h in range(_HOURS)])
        level = coef[kind] + np.array(hours)
        weekday = level - contrast + toward_other[0] * of_kind
        weekend = level + contrast + toward_other[1] * of_kind
        out[kind] = np.concatenate([weekday, weekend]) / unit
    return out
