"""The members of the default's blend beside its network, and their shares where nothing is known of their errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..._table import ZoneTable, is_plant
from ...forecasting.arx_prior import ZoneEvidence, ZoneSums
from ...schedule import LeadFit, NetworkResponse
from .members import ARXMember, DailyProfileMember, Member
from .without_response import WithoutResponse

#: temperatures that the black box regresses on, and those after less than two days, when an hourly log has few rows
_LAGS, _FEW_LAGS, _TWO_DAYS = 24, 4, pd.Timedelta("2D")
#: least training, hours of a plant at full load, and spread of what it did to the room by the network [K], from which
#: ARX learns a gain: a trace of heat runs for hours too
_A_WEEK, _MANY_HOURS, _MOVES = pd.Timedelta("7D"), 10.0, 0.03
_RULE_SHARES = (0.75, 0.1)  # of the simple rule where no error is known, after a day of training, and settled
#: share of the network beside a regression that has a fleet's prior (EnergyPlus rooms on dates that are not in
#: benchmarks/fleet_prior.py)
_BESIDE_FLEET = 0.5


def members_beside_network(
    fit: LeadFit, training: ZoneTable, purpose: str, like: Sequence[Member] = (), prior: Any = None
) -> list[Member]:
    """The members beside the network; heat and neighbours whose gain they are not to learn are taken out of them.

    ARX takes the penalties of the fitted one among the members ``like``, where there is one, or a prior, which also
    knows of heat that hardly ran.
    """
    if prior is not None:
        of = prior.arx
        return [
            ARXMember(_LAGS, prior=of.get("one_step")),
            ARXMember(_LAGS, multi_step=True, prior=of.get("multi_step")),
            DailyProfileMember(),
        ]
    plan, n_lags = purpose == "plan", _LAGS if training.n_rows * training.step >= _TWO_DAYS else _FEW_LAGS
    fitted = {m.multi_step: m.arx_ for m in like if isinstance(m, ARXMember)}
    # errors at many leads do not determine what a trace of heat did, and large coefficients look as good as small ones
    has_trace = any(training.hardly_ran(role) and v.any() for role, v in training.inputs.items())
    multi_step = [] if has_trace and not plan else [ARXMember(n_lags, multi_step=True, like=fitted.get(True))]
    others: list[Member] = [ARXMember(n_lags, like=fitted.get(False)), *multi_step, DailyProfileMember()]
    if plan:
        neighbours = set(fit.plan.network.boundaries) - {"T_oa"}
        roles: Sequence[str] = [role for role in training.inputs if is_plant(role) or role in neighbours]
    else:  # after a day or two nothing is determined, and no error has been seen that would weigh the network
        roles = [role for role in fit.undetermined if fit.blocks.any() and not _tells_gain(fit, training, role)]
    if not roles:
        return others
    response = NetworkResponse.of(fit, roles, training)
    return [WithoutResponse(member, response) for member in others]


def evidence_of(fit: LeadFit, others: Sequence[Member]) -> ZoneEvidence:
    """Evidence of the network and of the regressions; not those from which the heat was taken out."""
    regressions: dict[str, ZoneSums] = {}
    for member in others:
        if isinstance(member, ARXMember):
            regressions |= member.arx_.evidence_.regressions
    return ZoneEvidence(regressions, fit.sums)


def first_shares(members: Sequence[Member], has_prior: bool) -> np.ndarray:
    """Shares (2, K) where no error is known, after a day and settled, of the network and the members beside it."""
    is_rule, needs_days = np.array([(m.is_rule, m.needs_days) for m in members]).T
    n_ways, found = np.array([len(m.names) for m in members]), []
    counts = np.append(_BESIDE_FLEET if has_prior else 1.0, np.ones(len(members) - 1))
    for of_rules, learned in zip(_RULE_SHARES, (~is_rule & ~needs_days, ~is_rule), strict=True):
        own = counts * learned
        shares = np.where(is_rule, of_rules / is_rule.sum(), (1.0 - of_rules) / own.sum() * own)
        found.append(np.repeat(shares / n_ways, n_ways))
    return np.array(found)


def _tells_gain(fit: LeadFit, training: ZoneTable, role: str) -> bool:
    """True if ARX may learn a gain that the network cannot tell: the network fits badly, the log is fine."""
    if training.n_rows * training.step < _A_WEEK or training.hours_run(role) < _MANY_HOURS:
        return False
    return bool(NetworkResponse.of(fit, (role,), training).temperature(training).std() > _MOVES)
