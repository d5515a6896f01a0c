"""States and disturbances from measurements: a Kalman filter around an identified network, and forecasts from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from .._kernels import Discrete, kalman_gains, kalman_track, one_step_errors, simulate_path, smooth_states
from .disturbance import ZETA_SD, append_states, first_covariance, walk_noise
from .experiment import Experiment


class Start(NamedTuple):
    """What is known of the first row before its own measurement."""

    mean: np.ndarray  # (s,) nodes [degC], then the gain state [kW]
    covariance: np.ndarray  # (s, s)


class Track(NamedTuple):
    """Filtered (or smoothed) states of every row."""

    nodes: np.ndarray  # (N, n) [degC]
    gain: np.ndarray  # (N,) the unmeasured heat, profile included [kW]
    end: Start  # what is known of the row behind the last
    starts: tuple[np.ndarray, np.ndarray]  # predicted means (N, s) and covariances (N, s, s)


@dataclass(frozen=True)
class GainTracker:
    """A network with the unmeasured heat as a filter state: ``profile + g``, ``g[k+1] = phi g[k] + w``.

    ``phi = 1`` is the random walk of the input-disturbance model (paper Eq. ID_filter).
    """

    A: np.ndarray  # (n, n) over one step
    B: np.ndarray  # (n, m) with the heat gain last
    measured: int
    phi: float
    Q: np.ndarray  # (n_classes, n + 1, n + 1)
    R: float
    g_sd: float = ZETA_SD
    profile: np.ndarray = field(default_factory=lambda: np.zeros(48))  # [kW] by cell of the week

    @property
    def n(self) -> int:
        return len(self.A)

    def augmented(self) -> tuple[np.ndarray, np.ndarray]:
        """Transition with the gain state, and the output row."""
        A = np.zeros((self.n + 1, self.n + 1))
        A[: self.n, : self.n], A[: self.n, self.n], A[self.n, self.n] = self.A, self.B[:, -1], self.phi
        return A, np.eye(self.n + 1)[self.measured]

    def cold(self, temperature: float) -> Start:
        """A start about which nothing but a temperature is known."""
        return Start(np.append(np.full(self.n, temperature), 0.0), first_covariance(self.n, self.measured, self.g_sd))

    def forcing(self, experiment: Experiment, cells: np.ndarray) -> np.ndarray:
        """(N, n) effect of all known inputs and of the profile over each step."""
        return experiment.inputs @ self.B.T + np.outer(self.profile[cells], self.B[:, -1])

    def track(
        self, experiment: Experiment, cells: np.ndarray, klass: np.ndarray, start: Start, smooth: bool = False
    ) -> Track:
        """Filter (causal) or smooth (by all rows) the states."""
        A, c = self.augmented()
        forcing = np.zeros((len(experiment.y), self.n + 1))
        forcing[:, : self.n] = self.forcing(experiment, cells)
        run = kalman_track(A, forcing, self.Q, klass, c, self.R, experiment.y, start.mean, start.covariance)
        filtered, covariances, predicted, before = run
        states = smooth_states(A, filtered, covariances, predicted, before).states if smooth else filtered
        end = Start(A @ filtered[-1] + forcing[-1], A @ covariances[-1] @ A.T + self.Q[klass[-1]])
        gain = states[:, self.n] + self.profile[cells]
        return Track(states[:, : self.n].copy(), gain, end, (predicted, before))

    def drive(self, experiment: Experiment, origin: int, state: np.ndarray, heat: np.ndarray) -> np.ndarray:
        """(H, n) node temperatures of the rows after an origin; ``heat`` [kW] is that of the rows origin ...."""
        rows = experiment.inputs[origin : origin + len(heat)]
        forcing = rows @ self.B.T + np.outer(heat[: len(rows)], self.B[:, -1])
        path = simulate_path(self.A, forcing, state)[1:]
        short = len(heat) - len(rows)
        return np.vstack([path, np.repeat(path[-1:], short, axis=0)]) if short and len(path) else path


def fit_walk_noise(A: np.ndarray, B: np.ndarray, measured: int, R: float, experiment: Experiment) -> np.ndarray:
    """Most likely (sigma_x [K], sigma_zeta [kW]) of the random-walk filter around a given network.

    The identifications without a gain state need them to estimate the input disturbance.
    """
    n, N = len(A), len(experiment.y)
    empty = Discrete(A, B, np.zeros((0, n, n)), np.zeros((0, *B.shape)))
    big, _, _, _ = append_states(empty, feed=True, decay=1.0, n_own=0)
    c, none = np.eye(n + 1)[measured], np.zeros((0, n + 1, n + 1))
    forcing = np.zeros((N, n + 1))
    forcing[:, :n] = experiment.inputs @ B.T
    s0 = np.append(np.full(n, experiment.first), 0.0)
    seen = np.isfinite(experiment.y)
    P0 = first_covariance(n, measured, ZETA_SD)

    def negative_log_likelihood(logs: np.ndarray) -> float:
        Q, _ = walk_noise(n, float(np.exp(logs[0])), float(np.exp(logs[1])), 0)
        g = kalman_gains(big, Q, np.zeros(N, np.int64), c, R, P0, seen, none, none[:, None], np.zeros(0))
        e = one_step_errors(big, forcing, g.K, c, experiment.y, s0).errors[seen]
        value = float((np.log(g.S[seen]) + e**2 / g.S[seen]).sum())
        return value if np.isfinite(value) else 1e12

    bounds = [(np.log(1e-4), np.log(0.5)), (np.log(1e-3), np.log(30.0))]
    grid = [(np.log(x), np.log(z)) for x in (0.003, 0.03) for z in (0.05, 0.5, 3.0)]
    best = min(grid, key=lambda point: negative_log_likelihood(np.array(point)))
    found = minimize(
        negative_log_likelihood, best, method="Nelder-Mead", bounds=bounds, options={"maxfev": 60, "xatol": 0.05}
    )
    return np.exp(found.x)
