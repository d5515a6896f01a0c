"""One-step errors of an identified network, each with the standard deviation that the model expects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .._table import ZoneTable
from ..filtering import Model, Prediction, kalman_filter, one_step_errors, simulate_path
from .disturbance_models import Conventional, first_state, take_searched
from .filtered_network import FilteredNetwork
from .gain_filter import GainFilter, without_disturbance

_LONG = 5000  # rows, after which a filter knows what it will
_SETTLED = 1e-9  # relative change of the innovation variance from row to row, below which it is that of the limit


class Innovations(NamedTuple):
    """Errors of every row and measured node; NaN where nothing was measured."""

    error: np.ndarray  # (N, o) [K]
    std: np.ndarray  # (N, o) [K]


def kalman_innovations(filtered: FilteredNetwork, table: ZoneTable, segment: int | None) -> Innovations:
    """Of the filter with the gain state, which starts as in ``fit`` or from the end of the training table."""
    kalman, experiment = filtered.kalman, filtered.experiment(table)
    follows = segment is None and filtered.is_tail(table)
    start = filtered.start(table) if follows else kalman.cold(experiment.firsts)
    error, variance = kalman.innovations(experiment, start)
    return Innovations(error, np.sqrt(variance))


def scaled_innovations(
    filtered: FilteredNetwork, table: ZoneTable, segment: int | None, noise_std: float
) -> Innovations:
    """Kalman innovations whose variance, in the steady state, is that of the training errors."""
    found = kalman_innovations(filtered, table, segment)
    return Innovations(found.error, found.std * noise_std / np.sqrt(steady_variance(filtered.kalman)))


def steady_variance(kalman: GainFilter) -> float:
    """Innovation variance of a filter that has measured every row for long, the mean of several outputs [K2]."""
    A, C = kalman.augmented()
    measured, R = np.zeros((_LONG, len(C))), np.full(len(C), kalman.R)
    start, every = kalman.cold(measured[0]), np.zeros(_LONG, dtype=np.int64)
    found = kalman_filter(A, np.zeros((_LONG, len(A))), kalman.Q, every, C, R, measured, start.mean, start.covariance)
    mean = np.einsum("os,kst,ot->k", C, found.predicted_covariances, C) / len(C) + kalman.R
    settled = np.abs(np.diff(mean)) < _SETTLED * mean[1:]
    return float(mean[1 + np.argmax(settled)] if settled.any() else mean[-1])


def simulation_errors(filtered: FilteredNetwork, table: ZoneTable, warmup_rows: int, noise_std: float) -> Innovations:
    """CONV: a Kalman filter over the warm-up sets the state, then the network is simulated (paper 2.2.1)."""
    kalman, experiment = filtered.kalman, filtered.experiment(table)
    setting, n_rows = Conventional(warmup_rows), len(experiment.y)
    plain = without_disturbance(kalman, experiment.hours)
    warm, state = setting.filtered(n_rows), first_state(kalman.network, experiment.firsts)
    if warm:
        early = experiment.rows(slice(0, warm))
        state = plain.run(early, plain.cold(experiment.firsts)).end.mean[: kalman.n]
    predicted = np.full(experiment.outputs.shape, np.nan)
    path = simulate_path(kalman.A, experiment.inputs[warm:] @ kalman.B.T, state)
    predicted[warm:] = path[: n_rows - warm, kalman.measured]
    return Innovations(experiment.outputs - predicted, np.full(predicted.shape, noise_std))


def arma_innovations(
    filtered: FilteredNetwork, table: ZoneTable, segment: int | None, found: Mapping[str, float], noise_std: float
) -> Innovations:
    """OD: what the open loop leaves over, predicted by the ARMA(1,1) disturbance ``found`` (paper Eq. 13)."""
    experiment, network = filtered.experiment(table), filtered.network
    if segment is None:
        state = np.array(filtered.open_start(table), dtype=np.float64)
    else:  # as it was searched
        state = first_state(network, experiment.firsts)
        take_searched(state, network, found, segment)
    free = experiment.outputs - filtered.open_loop(experiment, state)[:-1, filtered.kalman.measured]
    ahead = arma_prediction(free, float(found["rho_1"]), float(found["rho_2"]))
    return Innovations(np.where(np.isfinite(free), ahead.errors, np.nan), noise_std * np.sqrt(ahead.variances))


def arma_prediction(free: np.ndarray, rho_1: float, rho_2: float) -> Prediction:
    """Prediction of ``z[k+1] = rho_1 z[k] + rho_2 e[k]`` from ``free = z + e`` (N, o), NaN where missing."""
    N, o = free.shape
    one, nothing, zeros, no_slopes = np.eye(o), np.zeros((o, o)), np.zeros(o), np.empty((o, o, 0))
    slopes = (no_slopes, np.empty((o, 0, 0)), no_slopes, no_slopes, np.empty((o, 0)))
    model = Model(rho_1 * one, np.empty((o, 0)), one, rho_2 * one, nothing, zeros, nothing, zeros, *slopes)
    return one_step_errors(model, np.empty((N, 0)), np.ascontiguousarray(free))
