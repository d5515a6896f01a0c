"""The schedule model as a discrete system whose inputs are the roles of the plant, or boundary temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._table import ZoneTable
from ..control import LinearNetwork, gain_of, impulse_response
from .channels import deviation, equipment, knot_name
from .filter_model import Matrices
from .fit import LeadFit
from .online_network import OriginState
from .segment import Segment


class Bends(NamedTuple):
    """Part-load curves of stages: the heat of a plan beyond what is proportional to the stage."""

    heat: np.ndarray  # (N, m) [kW]
    slope: np.ndarray  # (N, m) [kW per unit of the stage]

    @property
    def bent(self) -> np.ndarray:
        """(m,) bool, inputs with bends."""
        return np.asarray(self.slope.any(axis=0))


def emitting(fit: LeadFit, state: OriginState) -> tuple[np.ndarray, np.ndarray]:
    """Transition (n + 1, n + 1) with the emitter's heat as one more state, and the effect (n + 1,) of 1 kW."""
    n, direct = len(state.matrices.A), into_heated(fit, state)
    delayed = state.coef[-1] if fit.plan.emitter else 0.0  # share of the heat that the emitter delays
    a = np.exp(-fit.model.step / np.exp(state.psi[-1]))
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:, n], A[n, n] = state.matrices.A, delayed * direct, a
    effect = (1.0 - delayed) * direct
    effect[n] = 1.0 - a
    return A, effect


def into_heated(fit: LeadFit, state: OriginState) -> np.ndarray:
    """(n + 1,) effect of 1 kW that reaches the heated node at once."""
    return np.append(state.matrices.of_heat[:, fit.plan.heated], 0.0)


def fitted_heat(fit: LeadFit, coef: np.ndarray, table: ZoneTable) -> np.ndarray:
    """(N,) heat [kW] of fitted capacities, and of part-load curves beyond what is proportional, in a table's rows."""
    coefs = dict(zip(fit.channel_names, coef, strict=False))
    parts = (coefs[name] * series for name, series in equipment(fit.plan, table).items())
    return sum(parts, np.zeros(table.n_rows))


def forcing_by(matrices: Matrices, segment: Segment, heat: np.ndarray) -> np.ndarray:
    """(N, n + 1) effect of boundary temperatures and of heat (N, n) [kW] into the nodes; the emitter gets none."""
    forcing = segment.boundary @ matrices.of_boundaries.T + heat @ matrices.of_heat.T
    return np.column_stack([forcing, np.zeros(len(forcing))])


def plant_inputs(fit: LeadFit, state: OriginState, roles: Sequence[str]) -> np.ndarray:
    """(n + 1, m) effect of a unit of each role over a step, in proportion; a role may be a boundary temperature."""
    _, effect = emitting(fit, state)
    direct, known, stages = into_heated(fit, state), dict(fit.plan.known), dict(fit.plan.stages)
    boundaries = fit.plan.network.boundaries

    def column(role: str) -> np.ndarray:
        if role in boundaries:
            return np.append(state.matrices.of_boundaries[:, boundaries.index(role)], 0.0)
        return known[role] * effect if role in known else stages[role] * _coef(fit, state, role) * direct

    return np.column_stack([column(role) for role in roles]) if roles else np.empty((len(effect), 0))


def bends_at(fit: LeadFit, state: OriginState, roles: Sequence[str], plan: np.ndarray) -> Bends:
    """The bends of a plan (N, m)."""
    out, largest = Bends(np.zeros(plan.shape), np.zeros(plan.shape)), dict(fit.plan.max_stages)
    for role, knot, capacity in fit.plan.knots:
        if role in roles:
            j, most = list(roles).index(role), largest[role]
            stage, size = plan[:, j], _coef(fit, state, knot_name(role, knot)) * capacity
            out.heat[:, j] += size * deviation(stage, knot, most)
            out.slope[:, j] += size * ((stage < knot) - (stage <= most) * knot / most)  # to the left at full stage
    return out


def plant_gain(fit: LeadFit, state: OriginState, roles: Sequence[str], plan: np.ndarray) -> np.ndarray:
    """(N, N, m) gain of the temperature by a plan (N, m), its tangent where stages have bends."""
    (A, _), C = emitting(fit, state), fit.model.output[None]
    gain = gain_of(impulse_response(A, plant_inputs(fit, state, roles), C, len(plan))[..., 0])
    slope = bends_at(fit, state, roles, plan).slope
    if slope.any():
        direct = impulse_response(A, into_heated(fit, state)[:, None], C, len(plan))[..., 0]
        gain = gain + gain_of(direct) * slope
    return gain


def scheduled_linear_network(
    fit: LeadFit, state: OriginState, segment: Segment, roles: Sequence[str], plan: np.ndarray
) -> LinearNetwork:
    """The network in degC from an origin on, whose row is the first of the segment.

    The plant is not in the forcing, except for the bends of the ``plan`` (N, m).
    """
    A, _ = emitting(fit, state)
    M, channels = state.matrices, segment.channels
    n = len(M.A)
    unmeasured = channels.solar | channels.scheduled
    heat = channels.heat(np.where(unmeasured, state.coef[: len(unmeasured)], 0.0), n)
    heat[:, fit.plan.zone] += state.gain * M.F[-1, -1] ** np.arange(segment.n_rows)
    bends = bends_at(fit, state, roles, plan)
    heat[:, fit.plan.heated] += bends.heat.sum(axis=1)
    reference = np.append(np.full(n, fit.reference), 0.0)
    return LinearNetwork(
        A,
        plant_inputs(fit, state, roles),
        fit.model.output[None],
        np.append(state.nodes, state.emitter) + reference,
        forcing_by(M, segment, heat) + reference - A @ reference,
        (*(f"T_{node}" for node in fit.plan.network.nodes), "Q_emitter"),
        bends.bent,
    )


def _coef(fit: LeadFit, state: OriginState, name: str) -> float:
    return float(state.coef[fit.channel_names.index(name)])
