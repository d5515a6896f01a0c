"""Response of a fitted network to the heat of its plant, which is taken out of what other members learn from."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .._table import ZoneTable
from ..filtering import simulate_path
from .channels import ChannelPlan, heat_of_plants
from .fit import LeadFit
from .schedule_loads import with_lag


@dataclass(frozen=True)
class HeatResponse:
    """A network at its fitted parameters, under the heat of some plants less its mean in the training."""

    plan: ChannelPlan
    coefs: dict[str, float]  # by channel of the equipment
    zone: int  # index of the measured node
    roles: frozenset[str]
    mean: float  # [kW]
    psi: np.ndarray  # (p,)
    A: np.ndarray  # (n + 1, n + 1); the last state is the emitter's heat
    effect: np.ndarray  # (n + 1,) of 1 kW

    @classmethod
    def of(cls, fit: LeadFit, roles: Collection[str], training: ZoneTable) -> Self:
        """Response to the heat of the plants ``roles``."""
        rest = np.empty(0)
        made = cls(fit.plan, {}, fit.model.zone, frozenset(roles), 0.0, rest, rest, rest).at(fit, fit.psi, fit.coef)
        return replace(made, mean=float(made.heat(training).mean()))

    def at(self, fit: LeadFit, psi: np.ndarray, coef: np.ndarray) -> Self:
        """The response of the same network at other parameters."""
        A, effect = with_lag(fit.plan, fit.model.matrices(psi), psi, coef, fit.model.step)
        coefs = {name: float(c) for name, c in zip(fit.channel_names, coef, strict=False) if name.startswith("u_")}
        return replace(self, coefs=coefs, psi=psi, A=A, effect=effect)

    def heat(self, table: ZoneTable) -> np.ndarray:
        """(N,) heat of the plants [kW] less the training's mean."""
        other = {role for role in table.inputs if role[:2] in ("u_", "Q_")} - self.roles
        idle = table.replace(inputs={r: np.zeros(table.n_rows) if r in other else v for r, v in table.inputs.items()})
        return heat_of_plants(self.plan, self.coefs, idle) - self.mean

    def without_plants(self, table: ZoneTable) -> ZoneTable:
        """A table without the columns of the plants."""
        return table.replace(inputs={role: v for role, v in table.inputs.items() if role not in self.roles})

    def simulate(self, heat: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """(N + 1, n + 1) states from ``state`` on under heat (N,), by default from rest."""
        begin = np.zeros(len(self.A)) if state is None else state
        return np.asarray(simulate_path(self.A, np.outer(heat, self.effect), begin))

    def output(self, states: np.ndarray) -> np.ndarray:
        """Temperature of the zone [K] in states (..., n + 1)."""
        return states[..., self.zone]
