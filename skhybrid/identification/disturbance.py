"""Disturbance models of the least-squares identifications: the states that they append and the gain (design 4).

Each turns a discretised network into the innovations-form predictor, together with exact derivatives by all parameters:
those of the network first, then the disturbance's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._kernels import Discrete, kalman_gains
from ..thermal import Parameter
from .experiment import Experiment

#: standard deviation of a node's temperature that was not measured at the first row [K]
HIDDEN_SD = 2.0
#: standard deviation of the measured node at the first row [K]
MEASURED_SD = 0.5
#: standard deviation of the disturbance at the first row [kW]
ZETA_SD = 1.0


def measurement_variance(hours: float) -> float:
    """Paper 2.2.2: ``0.25^2 / T_s`` with ``T_s`` in seconds [K2]."""
    return 0.25**2 / (hours * 3600.0)


class Predictor(NamedTuple):
    """Everything that the compiled predictor needs, and its derivatives by p parameters."""

    A: np.ndarray  # (s, s)
    B: np.ndarray  # (s, m)
    c: np.ndarray  # (s,)
    K: np.ndarray  # (N, s)
    s0: np.ndarray  # (s,)
    dA: np.ndarray  # (p, s, s)
    dB: np.ndarray  # (p, s, m)
    dK: np.ndarray  # (p, N, s)
    ds0: np.ndarray  # (p, s)


def append_states(discrete: Discrete, feed: bool, decay: float, n_own: int) -> tuple[np.ndarray, ...]:
    """A, B and derivatives with one state appended behind the nodes.

    ``feed``: the state is a heat gain [kW] that acts through the last column of B; else it acts on the output only.
    ``decay``: the state's own transition.  ``n_own``: parameters of the disturbance, behind the network's.
    """
    n, m = discrete.B.shape
    p = len(discrete.dA) + n_own
    A, B = np.zeros((n + 1, n + 1)), np.zeros((n + 1, m))
    dA, dB = np.zeros((p, n + 1, n + 1)), np.zeros((p, n + 1, m))
    A[:n, :n], B[:n] = discrete.A, discrete.B
    A[n, n] = decay
    dA[: len(discrete.dA), :n, :n], dB[: len(discrete.dB), :n] = discrete.dA, discrete.dB
    if feed:
        A[:n, n] = discrete.B[:, -1]
        dA[: len(discrete.dA), :n, n] = discrete.dB[:, :, -1]
    return A, B, dA, dB


def first_covariance(n_nodes: int, measured: int, zeta_sd: float | None = None) -> np.ndarray:
    """Covariance of the first row's state, with the disturbance behind the nodes where ``zeta_sd`` is given."""
    sd = np.full(n_nodes, HIDDEN_SD)
    sd[measured] = MEASURED_SD
    return np.diag(np.append(sd, zeta_sd) ** 2 if zeta_sd is not None else sd**2)


@dataclass(frozen=True)
class Conventional:
    """CONV (paper 2.2.1): no disturbance; a Kalman filter over the first rows sets the state, then pure simulation."""

    warmup_rows: int
    process_sd: float = 0.05  # of each node over a step while the filter runs [K]
    own: tuple[Parameter, ...] = ()

    def first_row(self, n_rows: int) -> int:
        """Errors count from this row on."""
        return min(self.warmup_rows, n_rows // 2)

    def noise(self, n: int) -> np.ndarray:
        """(1, n + 1, n + 1) process noise while the filter runs; the state behind the nodes has none."""
        return np.diag(np.append(np.full(n, self.process_sd**2), 0.0))[None]

    def build(self, d: Discrete, values: dict[str, float], measured: int, experiment: Experiment) -> Predictor:
        n, p, N = d.A.shape[0], len(d.dA), len(experiment.y)
        c = np.eye(n)[measured]
        warm = self.first_row(N)
        Q = self.noise(n)[:, :n, :n]
        gains = kalman_gains(
            d.A,
            Q,
            np.zeros(warm, np.int64),
            c,
            measurement_variance(experiment.hours),
            first_covariance(n, measured),
            np.isfinite(experiment.y[:warm]),
            d.dA,
            np.zeros((p, 1, n, n)),
            np.zeros(p),
        )
        K, dK = np.zeros((N, n)), np.zeros((p, N, n))
        K[:warm], dK[:, :warm] = gains.K, gains.dK
        return Predictor(d.A, d.B, c, K, np.full(n, experiment.first), d.dA, d.dB, dK, np.zeros((p, n)))


@dataclass(frozen=True)
class InputRandomWalk:
    """ID (paper 2.2.2): the disturbance is a heat gain that follows a random walk; the gain is Kalman's."""

    measurement_sd: float | None = None
    own: tuple[Parameter, ...] = (
        Parameter("sigma_x", "K", 1e-9, 1.0, "noise of each node over a step"),
        Parameter("sigma_zeta", "kW", 1e-9, 1.0, "noise of the disturbance over a step"),
    )

    def first_row(self, n_rows: int) -> int:
        return 0

    def build(self, d: Discrete, values: dict[str, float], measured: int, experiment: Experiment) -> Predictor:
        n, N = d.A.shape[0], len(experiment.y)
        A, B, dA, dB = append_states(d, feed=True, decay=1.0, n_own=2)
        p = len(dA)
        Q, dQ = walk_noise(n, values["sigma_x"], values["sigma_zeta"], p)
        c = np.eye(n + 1)[measured]
        R = self.measurement_sd**2 if self.measurement_sd else measurement_variance(experiment.hours)
        P0 = first_covariance(n, measured, ZETA_SD)
        seen = np.isfinite(experiment.y)
        gains = kalman_gains(A, Q, np.zeros(N, np.int64), c, R, P0, seen, dA, dQ, np.zeros(p))
        s0 = np.append(np.full(n, experiment.first), 0.0)
        return Predictor(A, B, c, gains.K, s0, dA, dB, gains.dK, np.zeros((p, n + 1)))


def walk_noise(n: int, sigma_x: float, sigma_zeta: float, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Process noise diag(sigma_x^2, ..., sigma_zeta^2) and derivatives; the two sigmas are the last of p parameters."""
    Q, dQ = np.zeros((1, n + 1, n + 1)), np.zeros((p, 1, n + 1, n + 1))
    nodes = np.arange(n)
    Q[0, nodes, nodes], Q[0, n, n] = sigma_x**2, sigma_zeta**2
    if p:
        dQ[p - 2, 0, nodes, nodes], dQ[p - 1, 0, n, n] = 2.0 * sigma_x, 2.0 * sigma_zeta
    return Q, dQ


@dataclass(frozen=True)
class OutputARMA:
    """OD (paper 2.2.3): ARMA(1,1) on the output; the network itself is never corrected.

    The search is over ``rho_1`` and ``rho_gap = rho_1 - rho_2``, the two roots whose size decides stability (ruling 1);
    with ``paper_box`` over ``rho_1`` and ``rho_2`` as the paper prints.  Temperatures of hidden nodes at the first row
    are parameters too.
    """

    hidden: tuple[str, ...]  # nodes that are not measured
    first: float
    paper_box: bool = False

    @property
    def own(self) -> tuple[Parameter, ...]:
        second = "rho_2" if self.paper_box else "rho_gap"
        rho = tuple(Parameter(name, "-", -0.999, 0.999, "", "identity") for name in ("rho_1", second))
        start = tuple(
            Parameter(f"T0_{node}", "degC", self.first - 20.0, self.first + 20.0, "", "identity")
            for node in self.hidden
        )
        return rho + start

    def first_row(self, n_rows: int) -> int:
        return 0

    def build(self, d: Discrete, values: dict[str, float], measured: int, experiment: Experiment) -> Predictor:
        n, N = d.A.shape[0], len(experiment.y)
        A, B, dA, dB = append_states(d, feed=False, decay=values["rho_1"], n_own=len(self.own))
        p, base = len(dA), len(d.dA)
        dA[base, n, n] = 1.0
        rho_2 = values["rho_2"] if self.paper_box else values["rho_1"] - values["rho_gap"]
        K, dK = np.zeros((N, n + 1)), np.zeros((p, N, n + 1))
        K[:, n] = rho_2
        dK[base, :, n], dK[base + 1, :, n] = (0.0, 1.0) if self.paper_box else (1.0, -1.0)
        c = np.eye(n + 1)[measured] + np.eye(n + 1)[n]
        s0, ds0 = np.append(np.full(n, experiment.first), 0.0), np.zeros((p, n + 1))
        places = [i for i in range(n) if i != measured]
        for q, (i, node) in enumerate(zip(places, self.hidden, strict=True)):
            s0[i] = values[f"T0_{node}"]
            ds0[base + 2 + q, i] = 1.0
        return Predictor(A, B, c, K, s0, dA, dB, dK, ds0)
