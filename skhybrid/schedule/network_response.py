"""Response of a fitted network to its plant and its neighbours, which is taken out of what other members learn from."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .._table import ZoneTable, is_plant
from ..filtering import simulate_path
from .channels import known_heat
from .fit import LeadFit
from .online_network import OriginState
from .plant_model import emitting, fitted_heat, into_heated, plant_gain, plant_inputs


@dataclass(frozen=True)
class NetworkResponse:
    """A network at some parameters, at rest, under the heat of plants and boundary temperatures less their means."""

    fit: LeadFit  # without rows and what was learned from them
    roles: frozenset[str]  # of the plants and the boundary temperatures
    rest: OriginState
    mean: np.ndarray  # (2 + nb,) in the training [kW, degC]

    @classmethod
    def of(cls, fit: LeadFit, roles: Collection[str], training: ZoneTable) -> Self:
        """Response to the plants and boundary temperatures ``roles``."""
        nothing = np.empty((0, 0))
        bare = replace(fit.without_rows(), gram=nothing, blocks=np.empty(0, dtype=np.int64), left_out=nothing)
        made = cls(bare, frozenset(roles), _at_rest(fit, fit.psi, fit.coef), np.zeros(1))
        return replace(made, mean=made.drive(training).mean(axis=0))

    def at(self, psi: np.ndarray, coef: np.ndarray) -> Self:
        """The response of the same network at other parameters."""
        return replace(self, rest=_at_rest(self.fit, psi, coef))

    @property
    def _boundaries(self) -> list[str]:
        return [role for role in self.fit.plan.network.boundaries if role in self.roles]

    def drive(self, table: ZoneTable) -> np.ndarray:
        """(N, 2 + nb) heat [kW], known, which an emitter may delay, and of fitted capacities, and temperatures [degC].

        Each is less its mean in the training.
        """
        others = set(filter(is_plant, table.inputs)) - self.roles
        idle = table.replace(inputs={r: np.zeros(table.n_rows) if r in others else v for r, v in table.inputs.items()})
        fitted = fitted_heat(self.fit, self.rest.coef, idle)
        boundaries = [table.inputs[role] for role in self._boundaries]
        return np.column_stack([known_heat(self.fit.plan, idle), fitted, *boundaries]) - self.mean

    def without_roles(self, table: ZoneTable) -> ZoneTable:
        """A table without the columns that are responded to."""
        return table.replace(inputs=self.without_inputs(table.inputs))

    def without_inputs(self, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Inputs without those that are responded to."""
        return {role: v for role, v in inputs.items() if role not in self.roles}

    def simulate(self, drive: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """(N + 1, n + 1) states from ``state`` on under :meth:`drive`, by default from rest."""
        A, effect = emitting(self.fit, self.rest)
        begin = np.zeros(len(A)) if state is None else state
        of_boundaries = plant_inputs(self.fit, self.rest, self._boundaries)
        effects = np.column_stack([effect, into_heated(self.fit, self.rest), of_boundaries])
        return simulate_path(A, drive @ effects.T, begin)

    def temperature(self, table: ZoneTable) -> np.ndarray:
        """(N,) temperature [K] that the rows of a table make, from rest."""
        return self.output(self.simulate(self.drive(table)))[:-1]

    def step(self, n_leads: int) -> np.ndarray:
        """(n_leads,) temperature after 1, 2 ... rows of 1 kW of known heat [K/kW]."""
        drive = np.zeros((n_leads, len(self.mean)))
        drive[:, 0] = 1.0
        return self.output(self.simulate(drive))[1:]

    def output(self, states: np.ndarray) -> np.ndarray:
        """Temperature of the zone [K] in states (..., n + 1)."""
        return states[..., self.fit.model.zone]

    def gain(self, roles: Sequence[str], plan: np.ndarray) -> np.ndarray:
        """(N, N, m) gain by a plan (N, m), 0 for what is not responded to."""
        return plant_gain(self.fit, self.rest, roles, plan) * [role in self.roles for role in roles]


def _at_rest(fit: LeadFit, psi: np.ndarray, coef: np.ndarray) -> OriginState:
    nodes = np.zeros(len(fit.plan.network.nodes))
    return OriginState(psi, fit.model.matrices(psi, slopes=False), coef, nodes, 0.0, 0.0)
