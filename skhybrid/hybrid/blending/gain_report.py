"""Responses of a blend's members to 1 kW, how well the training determines them, and doubts about them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from ..._table import ZoneTable, is_stage
from ..._warnings import percent, warn_user
from ...exceptions import ExcitationWarning, GainWarning, ScaleNotIdentifiableWarning
from ...schedule import LITTLE_ERROR, LeadFit, days_to_determine, step_gain_error
from .blend import by_lead
from .members import Member
from .rolling_blend import BlendRecord

_LEADS = ("1h", "4h", "12h", "24h")  # beside that of one row
#: relative error beyond what the data determine, and where jumps of the heat tell the gain to a fit for planning: found
#: in 11 step tests of EnergyPlus rooms
_BEYOND_DATA, _BEYOND_JUMPS = 0.5, 0.25
_DISAGREE = 2.0  # ratio of two members' gains


def rows_of_leads(record: BlendRecord, step: pd.Timedelta) -> np.ndarray:
    """Rows after a step at which gains are stated."""
    rows = np.array([1, *(round(pd.Timedelta(lead) / step) for lead in _LEADS)])
    return np.unique(rows[(rows >= 1) & (rows <= record.n_leads)])


def main_source(fit: LeadFit, training: ZoneTable) -> tuple[str, float] | None:
    """The role that gave most of the known heat, with its capacity [kW]; None without a plant."""
    known = fit.plan.known
    return max(known, key=lambda one: float(np.abs(one[1] * training.inputs[one[0]]).mean())) if known else None


def determined_plant(fit: LeadFit, training: ZoneTable) -> str | None:
    """The role that gave most of the known heat, where the training determines its effect."""
    plant = main_source(fit, training)
    return plant[0] if plant and plant[0] not in fit.undetermined else None


def gain_table(
    members: Sequence[Member], record: BlendRecord, training: ZoneTable, plant: tuple[str, float]
) -> pd.DataFrame:
    """Gain of each way to forecast and of their blend [K/kW], by lead."""
    rows = rows_of_leads(record, training.step)
    n = int(rows[-1])
    by_member = [member.step_gain(training, plant, n)[rows - 1] for member in members]
    names = [name for member in members for name in member.names]
    gains = np.column_stack([g for g, m in zip(by_member, members, strict=True) for _ in m.names])
    index = pd.Index(rows * training.step, name="lead")
    blend = np.sum(gains * by_lead(record.weights(), record.n_leads, n)[rows - 1], axis=1)
    return pd.DataFrame(gains, index, names).assign(blend=blend)


def gain_errors(fit: LeadFit, record: BlendRecord, step: pd.Timedelta) -> pd.Series:
    """Relative standard error of the network's gain, by lead."""
    rows, pull = rows_of_leads(record, step), fit.problem.pull
    beyond = _BEYOND_JUMPS if pull is not None and pull.observed else _BEYOND_DATA
    error = np.hypot(step_gain_error(fit, rows), beyond)
    return pd.Series(error, pd.Index(rows * step, name="lead"), name="gain_std")


def disagreement(fit: LeadFit, members: Sequence[Member], gains: pd.DataFrame, role: str) -> str | None:
    """Doubt about a gain of a plant on which the members of a blend disagree; None where they agree."""
    lead, last = gains.index[-1], gains.iloc[-1]
    own = members[0].names[0]
    others = [name for member in members[1:] if not member.is_rule for name in member.names]
    apart = [abs(np.log(max(gain, 1e-9) / last[own])) for gain in last[others]]
    worst = others[int(np.argmax(apart))]
    if 1.0 / _DISAGREE < last[worst] / last[own] < _DISAGREE:
        return None
    return (
        f"the members of the blend disagree on what heat does: after {lead / pd.Timedelta('1h'):g} h a kW warms "
        f"the zone by {last[own]:.2g} K ({own}) or {last[worst]:.2g} K ({worst}), so do not plan with it; fit with "
        f"purpose='plan'; {_experiment(fit, role)}."
    )


def warn_of_gain(
    fit: LeadFit, training: ZoneTable, known: Mapping[str, float], gains_of: Callable[[], pd.DataFrame]
) -> None:
    """Warn of plants whose effect the training hardly shows, or shows reversed, and of a plan without jumps of heat."""
    _warn_of_scale(fit, training, known)
    sources = {source.role: source for source in fit.plan.network.sources(training.inputs)}
    for role in fit.undetermined:
        free = sources[role].parameter is not None and sources[role].parameter not in known
        remedy = f", or give {sources[role].nameplate}" if free else ""
        ran = float(f"{training.hours_run(role):.2g}")
        warn_user(
            f"the training, in which {role} ran for {ran:g} h, does not determine its gain, so "
            f"that forecasts with it are a guess; train on a log in which it goes on and off for a few hours{remedy}; "
            f"{_experiment(fit, role)}.",
            ExcitationWarning,
        )
    plant, pull = determined_plant(fit, training), fit.problem.pull
    if plant and (gains := gains_of()["blend"]).max() < 0.0:
        warn_user(
            f"in the training a kW of {plant} cools the zone, by {-gains.iloc[-1]:.2g} K after "
            f"{gains.index[-1] / pd.Timedelta('1h'):g} h, so that loads and plans are wrong: is its sign reversed? "
            "Heat into the zone is positive, cooling negative.",
            GainWarning,
        )
    if plant and pull is not None and not pull.observed:
        warn_user(
            "the heat hardly jumped in the training, so its effect is learned from forecast errors alone and is often "
            f"too small; {_experiment(fit, plant)}.",
            GainWarning,
        )


def _experiment(fit: LeadFit, role: str) -> str:
    """Days of an experiment, and how far they would lower the error of a plant's gain."""
    days, error = days_to_determine(fit, role)
    often, reached = f"{days} days", f"below {percent(LITTLE_ERROR)}"
    if error >= LITTLE_ERROR:
        often, reached = f"even {often}", f"only to {percent(error)}"
    return (
        f"{often} of random set-points (skhybrid.identification.plan_experiment) would bring the statistical error of "
        f"the gain of {role} after 24 h {reached}"
    )


def _warn_of_scale(fit: LeadFit, training: ZoneTable, known: Mapping[str, float]) -> None:
    """Warn where neither a capacity nor a measured heat fixes what a kW is."""
    stages = fit.plan.network.sources([role for role in training.inputs if is_stage(role)])
    given = any(stage.parameter in known for stage in stages)
    measured = any(np.ptp(v) > 0 for role, v in training.inputs.items() if role.startswith("Q_"))
    if given or measured or not stages:
        return
    assumed = [f": {role} is taken to give {kw:g} kW at 1" for role, kw in fit.plan.known]
    warn_user(
        f"no capacity is known and no heat is measured, so that kW are relative{''.join(assumed[:1])}; pass one, "
        f"such as {stages[0].nameplate}, or give a measured Q_hvac.",
        ScaleNotIdentifiableWarning,
    )
