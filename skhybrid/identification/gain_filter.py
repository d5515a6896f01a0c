"""Kalman filter around a network: its node temperatures and the unmeasured heat, from measurements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from .._calendar import N_CELLS
from ..filtering import kalman_filter, simulate_path, smooth_states
from ..thermal import RCNetwork
from .disturbance_models import (
    PROCESS_SD,
    ZETA_SD,
    first_covariance,
    first_state,
    measured_states,
    measurement_variance,
)
from .experiment import Experiment
from .gain_model import week_cells


class FilterStart(NamedTuple):
    """State and covariance at the first row, before its own measurement."""

    mean: np.ndarray  # (s,) nodes [degC], then the gain states [kW]
    covariance: np.ndarray  # (s, s)


class FilteredStates(NamedTuple):
    """Filtered (or smoothed) states of every row."""

    nodes: np.ndarray  # (N, n) [degC]
    gain: np.ndarray  # (N, d) the unmeasured heat of every disturbed node, profile included [kW]
    end: FilterStart  # what is known of the row after the last
    starts: tuple[np.ndarray, np.ndarray]  # predicted means (N, s) and covariances (N, s, s)


@dataclass(frozen=True)
class GainFilter:
    """A network with the unmeasured heat as filter states: ``profile + g``, ``g[k+1] = phi g[k] + w``.

    ``phi = 1`` is the random walk of the input-disturbance model (paper Eq. 9).
    """

    network: RCNetwork
    A: np.ndarray  # (n, n) over one step
    B: np.ndarray  # (n, m) with the heat gains last
    phi: float
    Q: np.ndarray  # (n_classes, n + d, n + d)
    R: float
    g_sd: float = ZETA_SD
    profile: np.ndarray = field(default_factory=lambda: np.zeros((N_CELLS, 1)))  # (48, d or 1) [kW] by cell of the week
    classes: np.ndarray = field(default_factory=lambda: np.zeros(N_CELLS, dtype=np.int64))  # of Q, by cell of the week

    @property
    def n(self) -> int:
        return len(self.A)

    @property
    def n_gains(self) -> int:
        return len(self.network.disturbed_nodes)

    @property
    def measured(self) -> np.ndarray:
        """(o,) places of the measured nodes."""
        return measured_states(self.network)

    @property
    def heat(self) -> np.ndarray:
        """(n, d) effect of 1 kW over a step on each disturbed node."""
        return self.B[:, self.B.shape[1] - self.n_gains :]

    def augmented(self) -> tuple[np.ndarray, np.ndarray]:
        """Transition with the gain states, and the output rows."""
        n, d = self.n, self.n_gains
        A = np.zeros((n + d, n + d))
        A[:n, :n], A[:n, n:], A[n:, n:] = self.A, self.heat, self.phi * np.eye(d)
        return A, np.eye(n + d)[self.measured]

    def cold(self, temperatures: np.ndarray) -> FilterStart:
        """The start of rows of which only the first (o,) measured temperatures are known."""
        mean = first_state(self.network, temperatures, self.n_gains)
        return FilterStart(mean, first_covariance(self.network, self.g_sd))

    def run(self, experiment: Experiment, start: FilterStart, smooth: bool = False) -> FilteredStates:
        """Filter (causal) or smooth (by all rows) the states of one segment of rows."""
        A, C = self.augmented()
        cells = week_cells(experiment)
        classes, profile = self.classes[cells], np.broadcast_to(self.profile[cells], (len(cells), self.n_gains))
        forcing = np.zeros((len(cells), len(A)))
        forcing[:, : self.n] = experiment.inputs @ self.B.T + profile @ self.heat.T
        R = np.full(len(C), self.R)
        found = kalman_filter(A, forcing, self.Q, classes, C, R, experiment.outputs, start.mean, start.covariance)
        filtered, covariances, predicted, before = found
        states = smooth_states(A, C, R, experiment.outputs, found) if smooth else filtered
        end = FilterStart(A @ filtered[-1] + forcing[-1], A @ covariances[-1] @ A.T + self.Q[classes[-1]])
        return FilteredStates(states[:, : self.n].copy(), states[:, self.n :] + profile, end, (predicted, before))

    def innovations(self, experiment: Experiment, start: FilterStart) -> tuple[np.ndarray, np.ndarray]:
        """(N, o) one-step errors of one segment of rows [K], and their variances [K2]."""
        C = self.augmented()[1]
        means, covariances = self.run(experiment, start).starts
        return experiment.outputs - means @ C.T, np.einsum("os,kst,ot->ko", C, covariances, C) + self.R

    def drive(self, experiment: Experiment, origin: int, state: np.ndarray, heat: np.ndarray) -> np.ndarray:
        """(H, n) node temperatures of the rows after an origin; ``heat`` (H, d) [kW] is that of the rows origin ....

        Rows beyond the experiment repeat the last one.
        """
        rows = experiment.inputs[origin : origin + len(heat)]
        path = simulate_path(self.A, rows @ self.B.T + heat[: len(rows)] @ self.heat.T, state)[1:]
        return np.vstack([path, np.repeat(path[-1:], len(heat) - len(rows), axis=0)])


def without_disturbance(kalman: GainFilter, hours: float) -> GainFilter:
    """The filter that gives CONV its states: noise on every node, no unmeasured heat."""
    Q = walk_noise(kalman.network, PROCESS_SD, 0.0)
    return replace(kalman, phi=0.0, Q=Q, R=measurement_variance(hours), g_sd=0.0)


def fit_walk_noise(kalman: GainFilter, experiment: Experiment) -> tuple[float, float]:
    """Most likely (sigma_x [K], sigma_zeta [kW]) of the random-walk filter, for CONV and OD to estimate the gain."""

    def negative_log_likelihood(logs: np.ndarray) -> float:
        trial, value = replace(kalman, Q=walk_noise(kalman.network, *np.exp(logs))), 0.0
        for segment in experiment.segments:
            e, S = trial.innovations(segment, trial.cold(segment.firsts))
            seen = np.isfinite(e)
            value += float((np.log(S[seen]) + e[seen] ** 2 / S[seen]).sum())
        return value if np.isfinite(value) else 1e12

    bounds = [(np.log(1e-4), np.log(0.5)), (np.log(1e-3), np.log(30.0))]
    grid = [(np.log(x), np.log(z)) for x in (0.003, 0.03) for z in (0.05, 0.5, 3.0)]
    best = min(grid, key=lambda point: negative_log_likelihood(np.array(point)))
    options = {"maxfev": 60, "xatol": 0.05}
    found = minimize(negative_log_likelihood, best, method="Nelder-Mead", bounds=bounds, options=options)
    sigma_x, sigma_zeta = np.exp(found.x)
    return float(sigma_x), float(sigma_zeta)


def walk_noise(network: RCNetwork, sigma_x: float, sigma_zeta: float) -> np.ndarray:
    """(1, n + d, n + d) process noise of a random-walk filter over a step."""
    n, d = len(network.nodes), len(network.disturbed_nodes)
    return np.diag(np.repeat([sigma_x**2, sigma_zeta**2], [n, d]))[None]
