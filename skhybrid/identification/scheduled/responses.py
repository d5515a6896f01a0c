"""Responses of a network to every channel, filtered as the measurement is: forecasts are linear in the coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._contract import ZoneTable
from ..._kernels import filter_gains, filter_series, lead_errors, lead_sensitivities, simulate_inputs
from .channels import Channels, Plan, emitter_series, heat_of, make_channels
from .model import NOISE, LeadModel, Matrices, lead_rows


class Stretch(NamedTuple):
    """Consecutive rows, in deviations from a reference temperature."""

    plan: Plan
    channels: Channels
    boundary: np.ndarray  # (N, nb) [K]
    heat: np.ndarray  # (N,) known heat into the heated node [kW]
    y: np.ndarray  # (N,) [K], 0 where missing
    seen: np.ndarray  # (N,) bool

    @property
    def n_rows(self) -> int:
        """How many rows there are."""
        return len(self.y)

    def until(self, row: int) -> Stretch:
        """The rows before ``row``."""
        channels = self.channels._replace(series=self.channels.series[:row])
        return Stretch(self.plan, channels, self.boundary[:row], self.heat[:row], self.y[:row], self.seen[:row])


class Sample(NamedTuple):
    """Which forecasts of a stretch are looked at."""

    origins: np.ndarray  # (O,) int, increasing
    leads: np.ndarray  # (L,) int, increasing

    def targets(self, n_rows: int) -> tuple[np.ndarray, np.ndarray]:
        """(O, L) target rows, held at the last row, and whether they lie within ``n_rows``."""
        rows = self.origins[:, None] + self.leads
        return np.minimum(rows, n_rows - 1), rows < n_rows


class Responses(NamedTuple):
    """Simulated series of a stretch and what the filter holds of them at some origins.

    The columns are the channels (the emitter's last), the known inputs together, and the measurement.
    """

    matrices: Matrices
    series: np.ndarray  # (N, J + 2)
    origins: np.ndarray  # (n_origins,) increasing
    states: np.ndarray  # (n_origins, m, J + 2)

    def at(self, origins: np.ndarray) -> Responses:
        """The same at some of the origins."""
        if origins is self.origins:
            return self
        return self._replace(origins=origins, states=self.states[np.searchsorted(self.origins, origins)])

    def forecasts(self, model: LeadModel, sample: Sample, coef: np.ndarray) -> np.ndarray:
        """(O, L) forecasts under coefficients (J,), or (O, J) of each origin, in deviations from the reference."""
        rows, _ = sample.targets(len(self.series))
        P, _ = lead_rows(self.matrices.F, model.zone, sample.leads)
        share = np.broadcast_to(np.atleast_2d(coef), (len(rows), self.series.shape[1] - 2))
        share = np.hstack([share, np.ones((len(rows), 1))])
        out = np.empty(rows.shape)
        for i, (chosen, own) in enumerate(zip(rows, share, strict=True)):
            held = self.states[i, :, -1] - self.states[i, :, :-1] @ own
            out[i] = self.series[chosen, :-1] @ own + P @ held
        return out

    def unmeasured(self, stretch: Stretch, sample: Sample, coefs: np.ndarray) -> np.ndarray:
        """(O, L) heat of the schedules and of what the filter tracks, over the step of each row ahead [kW]."""
        rows, _ = sample.targets(len(self.series))
        scheduled = np.flatnonzero([name.startswith(("gain", "ua")) for name in stretch.channels.names])
        out = np.empty(rows.shape)
        for i, (chosen, coef) in enumerate(zip(rows, coefs, strict=True)):
            tracked = self.states[i, -1, -1] - self.states[i, -1, :-1] @ np.append(coef, 1.0)
            planned = stretch.channels.series[np.ix_(chosen, scheduled)] @ coef[scheduled]
            out[i] = planned + tracked * self.matrices.F[-1, -1] ** sample.leads
        return out


def make_stretch(plan: Plan, table: ZoneTable, T: np.ndarray, reference: float) -> Stretch:
    """A table and its measured temperature (N,) [degC] as a stretch."""
    columns = [table.inputs[b] - reference for b in plan.network.boundaries]
    boundary = np.column_stack(columns) if columns else np.empty((table.n_rows, 0))
    seen = np.isfinite(T)
    measured = np.where(seen, T - reference, 0.0)
    return Stretch(plan, make_channels(plan, table), boundary, heat_of(plan, table), measured, seen)


def respond(model: LeadModel, psi: np.ndarray, stretch: Stretch, origins: np.ndarray) -> Responses:
    """Simulate and filter every series of a stretch."""
    M = model.matrices(psi)
    nb = stretch.boundary.shape[1]
    unit, plan = M.B[:, nb:], stretch.plan
    V, node = stretch.channels.series, stretch.channels.node
    if plan.emitter:
        V = np.column_stack([V, emitter_series(stretch.heat, model.step, np.exp(psi[-1]))[0]])
        node = np.append(node, plan.heated)
    known = np.hstack([M.B[:, :nb], unit[:, [plan.heated]]])
    inputs = np.column_stack([stretch.boundary, stretch.heat])
    N, J = V.shape
    S = np.empty((N, J + 2))
    S[:, :J] = simulate_inputs(M.A, unit[:, node], V, model.zone)
    S[:, J] = simulate_inputs(M.A, known, inputs, model.zone).sum(axis=1)
    S[:, J + 1] = stretch.y
    gains, _ = filter_gains(M.F, M.Q, model.output, NOISE**2, M.P0, M.dF[..., :0], M.dQ[..., :0], stretch.seen)
    return Responses(M, S, origins, filter_series(M.F, gains, model.zone, S, origins))


def error_columns(model: LeadModel, found: Responses, sample: Sample, root: np.ndarray) -> np.ndarray:
    """Errors of every channel and of the measurement less the known inputs, (O L, J + 1), times the root weights."""
    found = found.at(sample.origins)
    P, _ = lead_rows(found.matrices.F, model.zone, sample.leads)
    E = lead_errors(found.series, found.states, P, sample.origins, sample.leads, root)
    E[:, -2] = E[:, -1] - E[:, -2]
    return E[:, :-1]


def error_sensitivities(
    model: LeadModel, psi: np.ndarray, coef: np.ndarray, stretch: Stretch, sample: Sample
) -> tuple[np.ndarray, np.ndarray]:
    """Errors (O, L) at fixed coefficients, and their derivatives (O, L, p) by psi."""
    M = model.matrices(psi)
    channels, plan, nb = stretch.channels, stretch.plan, stretch.boundary.shape[1]
    heat = np.zeros((stretch.n_rows, len(M.A)))
    for i in range(len(M.A)):
        mine = np.flatnonzero(channels.node == i)
        heat[:, i] = channels.series[:, mine] @ coef[mine]
    heat[:, plan.heated] += stretch.heat
    if plan.emitter:
        lag, dlag = emitter_series(stretch.heat, model.step, np.exp(psi[-1]))
        heat[:, plan.heated] += coef[-1] * lag
    v = np.hstack([stretch.boundary, heat])
    dforcing = np.tensordot(v, M.dB, axes=(1, 1))
    if plan.emitter:
        dforcing[:, :, -1] += np.outer(coef[-1] * dlag, M.B[:, nb + plan.heated])
    gains, dgains = filter_gains(M.F, M.Q, model.output, NOISE**2, M.P0, M.dF, M.dQ, stretch.seen)
    s = lead_sensitivities(
        M.A, M.dA, v @ M.B.T, dforcing, M.F, M.dF, gains, dgains, model.zone, stretch.y, sample.origins
    )
    P, dP = lead_rows(M.F, model.zone, sample.leads, M.dF)
    rows, _ = sample.targets(stretch.n_rows)
    e = stretch.y[rows] - s.response[rows] - s.states @ P.T
    held = np.tensordot(s.states, dP, axes=(1, 1)) + np.einsum("omq,hm->ohq", s.dstates, P, optimize=True)
    return e, -s.dresponse[rows] - held
