"""Response of a fitted network to the heat of its plant, which is taken out of what other members learn from."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .._table import ZoneTable, is_plant
from ..filtering import simulate_path
from .channels import equipment, known_heat
from .fit import LeadFit
from .online_network import OriginState
from .plant_model import emitting, into_heated, plant_gain


@dataclass(frozen=True)
class HeatResponse:
    """A network at some parameters, at rest, under the heat of some plants less its mean in the training."""

    fit: LeadFit  # without rows and what was learned from them
    roles: frozenset[str]
    rest: OriginState
    mean: np.ndarray  # (2,) [kW]

    @classmethod
    def of(cls, fit: LeadFit, roles: Collection[str], training: ZoneTable) -> Self:
        """Response to the heat of the plants ``roles``."""
        nothing = np.empty((0, 0))
        bare = replace(fit.without_rows(), gram=nothing, blocks=np.empty(0, dtype=np.int64), left_out=nothing)
        made = cls(bare, frozenset(roles), _at_rest(fit, fit.psi, fit.coef), np.zeros(2))
        return replace(made, mean=made.heat(training).mean(axis=0))

    def at(self, psi: np.ndarray, coef: np.ndarray) -> Self:
        """The response of the same network at other parameters."""
        return replace(self, rest=_at_rest(self.fit, psi, coef))

    def heat(self, table: ZoneTable) -> np.ndarray:
        """(N, 2) heat [kW] less the training's mean: known, which an emitter may delay, and of fitted capacities."""
        others = set(filter(is_plant, table.inputs)) - self.roles
        idle = table.replace(inputs={r: np.zeros(table.n_rows) if r in others else v for r, v in table.inputs.items()})
        coefs = dict(zip(self.fit.channel_names, self.rest.coef, strict=False))
        fitted = sum((coefs[one.name] * one.series for one in equipment(self.fit.plan, idle)), np.zeros(table.n_rows))
        return np.column_stack([known_heat(self.fit.plan, idle), fitted]) - self.mean

    def without_plants(self, table: ZoneTable) -> ZoneTable:
        """A table without the columns of the plants."""
        return table.replace(inputs=self.without_plant_inputs(table.inputs))

    def without_plant_inputs(self, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Inputs without those of the plants."""
        return {role: v for role, v in inputs.items() if role not in self.roles}

    def simulate(self, heat: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """(N + 1, n + 1) states from ``state`` on under heat (N, 2), by default from rest."""
        A, effect = emitting(self.fit, self.rest)
        begin = np.zeros(len(A)) if state is None else state
        forcing = np.outer(heat[:, 0], effect) + np.outer(heat[:, 1], into_heated(self.fit, self.rest))
        return np.asarray(simulate_path(A, forcing, begin))

    def output(self, states: np.ndarray) -> np.ndarray:
        """Temperature of the zone [K] in states (..., n + 1)."""
        return states[..., self.fit.model.zone]

    def gain(self, roles: Sequence[str], plan: np.ndarray) -> np.ndarray:
        """(N, N, m) gain by a plan (N, m) of plants, 0 for other ones."""
        return plant_gain(self.fit, self.rest, roles, plan) * [role in self.roles for role in roles]


def _at_rest(fit: LeadFit, psi: np.ndarray, coef: np.ndarray) -> OriginState:
    return OriginState(psi, fit.model.matrices(psi), coef, np.zeros(len(fit.plan.network.nodes)), 0.0, 0.0)
