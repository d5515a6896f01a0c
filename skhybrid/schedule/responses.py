"""Simulated and filtered responses of a network to each channel: forecasts are linear in the coefficients.

A forecast is the simulated response plus the filtered difference of the measurement from it.  Both are linear in the
inputs, so each channel is simulated by itself and filtered with the gains of the measurement.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..filtering import (
    ForecastSample,
    filter_gains,
    filter_series,
    lead_errors,
    lead_rows,
    lead_sensitivities,
    low_pass,
    simulate_inputs,
)
from .channels import ChannelPlan
from .filter_model import NOISE, FilterModel, Matrices
from .segment import Segment


class Responses(NamedTuple):
    """Simulated series of a segment and their filtered states at some origins.

    The columns are the channels (the emitter's is the last) and then the measurement less all known inputs.
    """

    matrices: Matrices
    series: np.ndarray  # (N, J + 1)
    states: np.ndarray  # (n_origins, m, J + 1)


class EmitterState(NamedTuple):
    """State of an emitter (a radiator, a heated floor) between two segments of rows."""

    output: float  # heat that it gave off in the last row [kW]
    input: float  # heat that it was given in that row [kW]


def emitter_series(
    heat: np.ndarray, step: float, time_constant: float, state: EmitterState | None = None
) -> np.ndarray:
    """``z - heat`` (N,) [kW] of a lagging emitter that gives off ``z``.

    ``z[k+1] = a z[k] + (1 - a) heat[k]`` with ``a = exp(-step / time_constant)``, both [h].  ``state`` is that of the
    row before the first; by default the first row's heat has always been given.
    """
    output, given = state if state is not None else (heat[0], heat[0])
    return low_pass(np.append(given, heat[:-1]), np.exp(-step / time_constant), output) - heat


def emitter_slope(lag: np.ndarray, step: float, time_constant: float) -> np.ndarray:
    """(N,) slope of an :func:`emitter_series` (N,) by the log of the time constant."""
    a = np.exp(-step / time_constant)
    return lfilter([1.0], [1.0, -a], a * step / time_constant * np.append(0.0, lag[:-1]))


class ResponseFilter:
    """Simulation and filter of all channels that go on from one segment to the next; ``node`` (J,) is that of each.

    At the last row, ``filtered`` (m, J + 1) are the filtered states given it, and ``emitter`` the emitter's, if any.
    """

    def __init__(self, model: FilterModel, psi: np.ndarray, plan: ChannelPlan, node: np.ndarray) -> None:
        self.model, self.psi, self.plan = model, psi, plan
        M = self.matrices = model.matrices(psi, slopes=False)
        n, unit = len(M.A), M.of_heat
        # inputs are simulated in three groups: channels, emitter, known inputs
        self._effects = (
            np.ascontiguousarray(unit[:, node]),
            np.ascontiguousarray(unit[:, [plan.heated] * plan.emitter]),
            np.hstack([M.of_boundaries, unit[:, [plan.heated]]]),
        )
        self._next = self._last = [np.zeros((n, effect.shape[1])) for effect in self._effects]
        self._variance = M.P0
        self.filtered = self._predicted = np.zeros((n + 1, len(node) + plan.emitter + 1))
        self.emitter: EmitterState | None = None

    def run(self, segment: Segment, origins: np.ndarray) -> Responses:
        """Simulate and filter the next rows; ``origins`` count from the first of them."""
        M, zone = self.matrices, self.model.zone
        lag = np.empty((segment.n_rows, 0))
        if self.plan.emitter:
            series = emitter_series(segment.heat, self.model.step, np.exp(self.psi[-1]), self.emitter)
            lag = series[:, None]
            self.emitter = EmitterState(series[-1] + segment.heat[-1], segment.heat[-1])
        inputs = (segment.channels.series, lag, np.column_stack([segment.boundary, segment.heat]))
        n_channels = len(segment.channels.names)
        J = n_channels + lag.shape[1]
        S, known = np.empty((segment.n_rows, J + 1)), np.empty((segment.n_rows, inputs[2].shape[1]))
        outputs = (S[:, :n_channels], S[:, n_channels:J], known)
        states = [
            simulate_inputs(M.A, B, V, zone, begin, out)
            for B, V, begin, out in zip(self._effects, inputs, self._next, outputs, strict=True)
        ]
        self._last, self._next = [last for last, _ in states], [after for _, after in states]
        S[:, J] = segment.y - known.sum(axis=1)
        gains, _, self._variance = filter_gains(
            M.F, M.Q, self.model.output, NOISE**2, self._variance, M.dF, M.dQ, segment.seen
        )
        at_origins, self.filtered, self._predicted = filter_series(M.F, gains, zone, S, origins, self._predicted)
        return Responses(M, S, at_origins)

    @property
    def last_states(self) -> np.ndarray:
        """(n, J + 1) simulated states at the last row, before its inputs; the known inputs together last."""
        return _with_known_summed(self._last)

    @property
    def next_states(self) -> np.ndarray:
        """(n, J + 1) simulated states at the row after the last one."""
        return _with_known_summed(self._next)


def _with_known_summed(states: list[np.ndarray]) -> np.ndarray:
    return np.column_stack([*states[:-1], states[-1].sum(axis=1)])


def simulate_responses(model: FilterModel, psi: np.ndarray, segment: Segment, origins: np.ndarray) -> Responses:
    """Simulate and filter all series of a segment."""
    return ResponseFilter(model, psi, segment.plan, segment.channels.node).run(segment, origins)


def error_columns(model: FilterModel, responses: Responses, sample: ForecastSample, root: np.ndarray) -> np.ndarray:
    """(O L, J + 1) errors of each channel and of the measurement less known inputs, by root weights ``root`` (O, L)."""
    M = responses.matrices
    P, _ = lead_rows(M.F, M.dF, model.zone, sample.leads)
    return lead_errors(responses.series, responses.states, P, sample.origins, sample.leads, root)


def node_inputs(segment: Segment, coef: np.ndarray, lag: np.ndarray) -> np.ndarray:
    """(N, nb + n) boundary temperatures [K] and heat into each node [kW]; ``lag`` (N,) is the emitter's series."""
    channels, plan = segment.channels, segment.plan
    heat = channels.heat(coef[: len(channels.names)], len(plan.network.nodes))
    heat[:, plan.heated] += segment.heat
    if plan.emitter:
        heat[:, plan.heated] += coef[-1] * lag
    return np.hstack([segment.boundary, heat])


def error_sensitivities(
    model: FilterModel, psi: np.ndarray, coef: np.ndarray, segment: Segment, sample: ForecastSample
) -> tuple[np.ndarray, np.ndarray]:
    """Errors (O, L) [K] at fixed coefficients, and their derivatives (O, L, p) by psi."""
    M = model.matrices(psi)
    plan = segment.plan
    lag = emitter_series(segment.heat, model.step, np.exp(psi[-1]))
    v = node_inputs(segment, coef, lag)
    dforcing = np.tensordot(v, M.dB, axes=(1, 1))
    if plan.emitter:
        dlag = emitter_slope(lag, model.step, np.exp(psi[-1]))
        dforcing[:, :, -1] += np.outer(coef[-1] * dlag, M.of_heat[:, plan.heated])
    gains, dgains, _ = filter_gains(M.F, M.Q, model.output, NOISE**2, M.P0, M.dF, M.dQ, segment.seen)
    s = lead_sensitivities(
        M.A, M.dA, v @ M.B.T, dforcing, M.F, M.dF, gains, dgains, model.zone, segment.y, sample.origins
    )
    P, dP = lead_rows(M.F, M.dF, model.zone, sample.leads)
    rows, _ = sample.targets(segment.n_rows)
    e = segment.y[rows] - s.response[rows] - s.states @ P.T
    dfiltered = np.tensordot(s.states, dP, axes=(1, 1)) + np.einsum("omq,hm->ohq", s.dstates, P, optimize=True)
    return e, -s.dresponse[rows] - dfiltered
