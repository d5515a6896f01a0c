"""What was fitted, in the terms of its user: parameters, schedules of gains and of conductance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .._table import ZoneTable
from ..thermal import RCNetwork
from .channels import UA_DIFFERENCE, ChannelPlan, make_channels
from .filter_model import OWN
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
        Every linear coefficient, by channel.
    schedule_ : DataFrame
        Unmeasured heat ``gain`` [kW] and conductance to the outside beside the network's ``ua`` [kW/K] by day type and
        hour, the mean of the five or two days; both may be negative, as they are deviations from what the network has.
    """

    network_: RCNetwork
    theta_: pd.Series
    disturbance_: pd.Series
    coef_: pd.Series
    schedule_: pd.DataFrame
    _fit: LeadFit

    @classmethod
    def of(cls, fit: LeadFit) -> ScheduledNetwork:
        """Read a fit."""
        values = pd.Series(np.exp(fit.point.psi), fit.model.names)
        names = [*fit.segment.channels.names, *(["emitter"] if fit.segment.plan.emitter else [])]
        coef = pd.Series(fit.point.solution.coef, names)
        own = list(OWN)
        return cls(fit.model.network, values.drop(own), values[own], coef, _schedule(coef, fit.segment.plan), fit)

    def heat_at(self, table: ZoneTable) -> pd.Series:
        """Scheduled heat over the rows of a table [kW]."""
        channels = make_channels(self._fit.segment.plan, table)
        return pd.Series(channels.scheduled_heat(self._fit.point.solution.coef), table.index, name="zeta")


def _schedule(coef: pd.Series, plan: ChannelPlan) -> pd.DataFrame:
    index = pd.MultiIndex.from_product([("weekday", "weekend"), range(_HOURS)], names=["day", "hour"])
    out = pd.DataFrame(0.0, index, ["gain", "ua"])
    turned = np.array([coef.get(f"gain_turned_{d}", 0.0) for d in range(7)])
    into = 2.0 * np.array([turned[:5].mean(), -turned[5:].mean()])
    learned = np.array(plan.contrast) if plan.contrast else np.zeros((2, _HOURS))
    for (kind, unit), own in zip((("gain", 1.0), ("ua", UA_DIFFERENCE)), learned, strict=True):
        if kind not in coef:
            continue
        hours = [coef.get(f"{kind}_hour_{h}", 0.0) for h in range(_HOURS)]
        contrast = np.array([coef.get(f"{kind}_day_type_{h}", 0.0) for h in range(_HOURS)])
        level = coef[kind] + np.array(hours)
        out[kind] = np.concatenate([level - contrast + into[0] * own, level + contrast + into[1] * own]) / unit
    return out
