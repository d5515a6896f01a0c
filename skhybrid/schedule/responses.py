"""Responses of a network to every channel, filtered as the measurement is: forecasts are linear in the coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._table import ZoneTable
from ..filtering import (
    ForecastSample,
    filter_gains,
    filter_series,
    lead_errors,
    lead_rows,
    lead_sensitivities,
    simulate_inputs,
)
from .channels import ChannelPlan, Channels, EmitterStore, emitter_series, heat_of, make_channels
from .filter_model import NOISE, LeadModel, Matrices


class Segment(NamedTuple):
    """Consecutive rows, in deviations from a reference temperature."""

    plan: ChannelPlan
    channels: Channels
    boundary: np.ndarray  # (N, nb) [K]
    heat: np.ndarray  # (N,) known heat into the heated node [kW]
    y: np.ndarray  # (N,) [K], 0 where missing
    seen: np.ndarray  # (N,) bool

    @property
    def n_rows(self) -> int:
        """How many rows there are."""
        return len(self.y)

    def between(self, begin: int, end: int) -> Segment:
        """The rows from ``begin`` on, before ``end``."""
        rows = slice(begin, end)
        channels = self.channels._replace(series=self.channels.series[rows])
        return Segment(self.plan, channels, self.boundary[rows], self.heat[rows], self.y[rows], self.seen[rows])


class Responses(NamedTuple):
    """Simulated series of a segment and what the filter holds of them at some origins.

    The columns are the channels (the emitter's last), and the measurement less all known inputs.
    """

    matrices: Matrices
    series: np.ndarray  # (N, J + 1)
    states: np.ndarray  # (n_origins, m, J + 1)


def make_segment(plan: ChannelPlan, table: ZoneTable, T: np.ndarray, reference: float) -> Segment:
    """A table and its measured temperature (N,) [degC] as a segment."""
    columns = [table.inputs[b] - reference for b in plan.network.boundaries]
    boundary = np.column_stack(columns) if columns else np.empty((table.n_rows, 0))
    seen = np.isfinite(T)
    measured = np.where(seen, T - reference, 0.0)
    return Segment(plan, make_channels(plan, table), boundary, heat_of(plan, table), measured, seen)


class ResponseFilter:
    """A network on its way through rows: simulated responses to every channel, filtered as the measurement is.

    The rows may come in several segments, one behind the other; what was before is a state.

    Parameters
    ----------
    model : LeadModel
    psi : ndarray of shape (p,)
    plan : ChannelPlan
    node : ndarray of int, shape (J,)
        Node of every channel, without the emitter's.
    """

    def __init__(self, model: LeadModel, psi: np.ndarray, plan: ChannelPlan, node: np.ndarray) -> None:
        self.model, self.psi, self.plan = model, psi, plan
        M = self.matrices = model.matrices(psi)
        n, nb = len(M.A), M.B.shape[1] - len(M.A)
        unit = M.B[:, nb:]
        self._effect = np.ascontiguousarray(unit[:, node])
        self._known_effect = np.hstack([M.B[:, :nb], unit[:, [plan.heated]]])
        self._lag_effect = np.ascontiguousarray(unit[:, [plan.heated] * plan.emitter])
        J = len(node) + plan.emitter
        self._parts = [np.zeros((n, k)) for k in (len(node), int(plan.emitter), nb + 1)]
        self._here = self._parts
        self._variance = M.P0
        self._filtered = np.zeros((n + 1, J + 1))
        self._last = self._filtered
        self.store: EmitterStore | None = None

    def run(self, segment: Segment, origins: np.ndarray) -> Responses:
        """Go through the next rows; origins count from the first of them."""
        M, zone = self.matrices, self.model.zone
        lag = np.empty((segment.n_rows, 0))
        if self.plan.emitter:
            series, _ = emitter_series(segment.heat, self.model.step, np.exp(self.psi[-1]), self.store)
            lag = series[:, None]
            self.store = EmitterStore(series[-1] + segment.heat[-1], segment.heat[-1])
        inputs = (segment.channels.series, lag, np.column_stack([segment.boundary, segment.heat]))
        effects = (self._effect, self._lag_effect, self._known_effect)
        J = len(segment.channels.names) + lag.shape[1]
        S, known = np.empty((segment.n_rows, J + 1)), np.empty((segment.n_rows, inputs[2].shape[1]))
        outputs = (S[:, : J - lag.shape[1]], S[:, J - lag.shape[1] : J], known)
        states = [
            simulate_inputs(M.A, B, V, zone, begin, out)
            for B, V, begin, out in zip(effects, inputs, self._parts, outputs, strict=True)
        ]
        self._here, self._parts = [here for here, _ in states], [ahead for _, ahead in states]
        S[:, J] = segment.y - known.sum(axis=1)
        gains, self._variance = filter_gains_only(self.model, M, self._variance, segment.seen)
        held, self._last, self._filtered = filter_series(M.F, gains, zone, S, origins, self._filtered)
        return Responses(M, S, held)

    @property
    def here(self) -> np.ndarray:
        """(n, J + 1) simulated states at the last row, before its inputs; the known inputs together last."""
        return _together(self._here)

    @property
    def ahead(self) -> np.ndarray:
        """(n, J + 1) simulated states behind the last row."""
        return _together(self._parts)

    @property
    def held(self) -> np.ndarray:
        """(m, J + 1) what the filter holds at the last row, given it."""
        return self._last


def _together(parts: list[np.ndarray]) -> np.ndarray:
    return np.column_stack([*parts[:-1], parts[-1].sum(axis=1)])


def filter_gains_only(
    model: LeadModel, M: Matrices, variance: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gains (N, m) without derivatives, and the variance behind the last row."""
    gains, _, behind = filter_gains(M.F, M.Q, model.output, NOISE**2, variance, M.dF[..., :0], M.dQ[..., :0], seen)
    return gains, behind


def respond(model: LeadModel, psi: np.ndarray, segment: Segment, origins: np.ndarray) -> Responses:
    """Simulate and filter every series of a segment."""
    return ResponseFilter(model, psi, segment.plan, segment.channels.node).run(segment, origins)


def error_columns(model: LeadModel, found: Responses, sample: ForecastSample, root: np.ndarray) -> np.ndarray:
    """Errors of every channel and of the measurement less the known inputs, (O L, J + 1), times the root weights."""
    M = found.matrices
    P, _ = lead_rows(M.F, M.dF[..., :0], model.zone, sample.leads)
    return lead_errors(found.series, found.states, P, sample.origins, sample.leads, root)


def error_sensitivities(
    model: LeadModel, psi: np.ndarray, coef: np.ndarray, segment: Segment, sample: ForecastSample
) -> tuple[np.ndarray, np.ndarray]:
    """Errors (O, L) at fixed coefficients, and their derivatives (O, L, p) by psi."""
    M = model.matrices(psi)
    channels, plan, nb = segment.channels, segment.plan, segment.boundary.shape[1]
    heat = channels.heat(coef[: len(channels.names)], len(M.A))
    heat[:, plan.heated] += segment.heat
    if plan.emitter:
        lag, dlag = emitter_series(segment.heat, model.step, np.exp(psi[-1]))
        heat[:, plan.heated] += coef[-1] * lag
    v = np.hstack([segment.boundary, heat])
    dforcing = np.tensordot(v, M.dB, axes=(1, 1))
    if plan.emitter:
        dforcing[:, :, -1] += np.outer(coef[-1] * dlag, M.B[:, nb + plan.heated])
    gains, dgains, _ = filter_gains(M.F, M.Q, model.output, NOISE**2, M.P0, M.dF, M.dQ, segment.seen)
    s = lead_sensitivities(
        M.A, M.dA, v @ M.B.T, dforcing, M.F, M.dF, gains, dgains, model.zone, segment.y, sample.origins
    )
    P, dP = lead_rows(M.F, M.dF, model.zone, sample.leads)
    rows, _ = sample.targets(segment.n_rows)
    e = segment.y[rows] - s.response[rows] - s.states @ P.T
    held = np.tensordot(s.states, dP, axes=(1, 1)) + np.einsum("omq,hm->ohq", s.dstates, P, optimize=True)
    return e, -s.dresponse[rows] - held
