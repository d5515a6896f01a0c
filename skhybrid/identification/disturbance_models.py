"""Disturbance models of the least-squares identifications: the states that they append, and the gain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..filtering import Discrete, Model
from ..thermal import Parameter, RCNetwork
from .experiment import Experiment

OwnValues = Mapping[str, np.ndarray]  # (S,) of every parameter by name

# Each model turns discretised networks, one per start, into innovations-form predictors with exact derivatives by all
# parameters: those of the network first, then the disturbance's own.

HIDDEN_SD = 2.0  # standard deviation of a node's temperature that was not measured at the first row [K]
MEASURED_SD = 0.5  # standard deviation of the measured node at the first row [K]
PROCESS_SD = 0.05  # of each node over a step while the filter of CONV runs [K]
ZETA_SD = 1.0  # standard deviation of the disturbance at the first row [kW]
FIRST = "T0_"  # begins the name of a hidden node's temperature at the first row of a segment


def measurement_variance(hours: float, sd: float | None = None) -> float:
    """Variance of a thermometer [K2]: ``sd^2``, or ``0.25^2 / T_s`` with ``T_s`` in seconds (paper 2.2.2)."""
    return 0.25**2 / (hours * 3600.0) if sd is None else sd**2


def measured_states(network: RCNetwork) -> np.ndarray:
    """(o,) places of the measured nodes among the states."""
    return np.array([network.nodes.index(node) for node in network.measured_nodes])


def first_covariance(network: RCNetwork, zeta_sd: float | None = None) -> np.ndarray:
    """Covariance of the first row's state, with the disturbances after the nodes where ``zeta_sd`` is given."""
    sd = np.full(len(network.nodes), HIDDEN_SD)
    sd[measured_states(network)] = MEASURED_SD
    disturbances = np.full(0 if zeta_sd is None else len(network.disturbed_nodes), zeta_sd, dtype=np.float64)
    return np.diag(np.append(sd, disturbances) ** 2)


def first_state(network: RCNetwork, temperatures: np.ndarray, appended: int = 0) -> np.ndarray:
    """Mean of the first row's state: measured nodes at their (o,) ``temperatures``, hidden ones at the mean of these.

    What is ``appended`` is 0.
    """
    state = np.full(len(network.nodes), float(np.mean(temperatures)))
    state[measured_states(network)] = temperatures
    return np.append(state, np.zeros(appended))


def _appended(d: Discrete, decay: np.ndarray, feed: int, n_own: int, C: np.ndarray, s0: np.ndarray, R: float) -> Model:
    """Model with appended states of transitions ``decay`` (S, a); gain, noise and first covariance are still zero.

    The appended states feed the last ``feed`` columns of B (heat gains [kW]); with 0 they act on the output only.  The
    ``n_own`` parameters of the disturbance follow the network's.  ``C`` (o, s) are the output rows, ``s0`` (s,) is the
    first state.
    """
    (S, n, m), p, a, o = d.B.shape, d.dA.shape[1], decay.shape[1], len(C)
    s, q = n + a, p + n_own
    A, B = np.zeros((S, s, s)), np.zeros((S, s, m))
    dA, dB = np.zeros((S, s, s, q)), np.zeros((S, s, m, q))
    A[:, :n, :n], B[:, :n] = d.A, d.B
    A[:, n + np.arange(a), n + np.arange(a)] = decay
    dA[:, :n, :n, :p] = d.dA.transpose(0, 2, 3, 1)
    dB[:, :n, :, :p] = d.dB.transpose(0, 2, 3, 1)
    if feed:
        A[:, :n, n:] = d.B[:, :, m - feed :]
        dA[:, :n, n:] = dB[:, :n, m - feed :]
    gain = {"K": np.zeros((S, s, o)), "dK": np.zeros((S, s, o, q))}
    noise = {"Q": np.zeros((S, s, s)), "dQ": np.zeros((S, s, s, q)), "R": np.full(o, R)}
    first = {"s0": np.tile(s0, (S, 1)), "ds0": np.zeros((S, s, q))}
    return Model(A=A, B=B, C=C, dA=dA, dB=dB, P0=np.zeros((s, s)), **gain, **noise, **first)


class _Disturbance:
    """Defaults: no Kalman filter runs, and all errors count."""

    weighted: ClassVar[bool] = True  # where the variances of errors differ, errors count by them

    def filtered(self, n_rows: int) -> int:
        """Rows over which a Kalman filter runs."""
        return 0

    def first_counted(self, n_rows: int) -> int:
        """Errors count from this row on."""
        return 0


@dataclass(frozen=True)
class Conventional(_Disturbance):
    """CONV (paper 2.2.1): no disturbance; a Kalman filter over the first rows sets the state, then pure simulation."""

    warmup_rows: int
    own: tuple[Parameter, ...] = ()
    weighted: ClassVar[bool] = False  # a simulation is no less certain after a missing row

    def filtered(self, n_rows: int) -> int:
        return min(self.warmup_rows, n_rows // 2)

    first_counted = filtered

    def build(self, d: Discrete, own: OwnValues, network: RCNetwork, segment: Experiment, number: int) -> Model:
        S, n = d.A.shape[:2]
        s0, R = first_state(network, segment.firsts), measurement_variance(segment.hours)
        model = _appended(d, np.zeros((S, 0)), 0, 0, np.eye(n)[measured_states(network)], s0, R)
        Q = np.tile(PROCESS_SD**2 * np.eye(n), (S, 1, 1))
        return model._replace(Q=Q, P0=first_covariance(network))


@dataclass(frozen=True)
class InputRandomWalk(_Disturbance):
    """ID (paper 2.2.2): the heat gain of each disturbed node follows a random walk; the gain is Kalman's."""

    measurement_sd: float | None = None
    own: tuple[Parameter, ...] = (
        Parameter("sigma_x", "K", 1e-9, 1.0, "noise of each node over a step"),
        Parameter("sigma_zeta", "kW", 1e-9, 1.0, "noise of the disturbance over a step"),
    )

    def filtered(self, n_rows: int) -> int:
        return n_rows

    def build(self, d: Discrete, own: OwnValues, network: RCNetwork, segment: Experiment, number: int) -> Model:
        (S, n), a = d.A.shape[:2], len(network.disturbed_nodes)
        s0, R = first_state(network, segment.firsts, a), measurement_variance(segment.hours, self.measurement_sd)
        model = _appended(d, np.ones((S, a)), a, 2, np.eye(n + a)[measured_states(network)], s0, R)
        nodes, walks = np.arange(n), n + np.arange(a)
        model.Q[:, nodes, nodes] = own["sigma_x"][:, None] ** 2
        model.Q[:, walks, walks] = own["sigma_zeta"][:, None] ** 2
        model.dQ[:, nodes, nodes, -2] = 2.0 * own["sigma_x"][:, None]
        model.dQ[:, walks, walks, -1] = 2.0 * own["sigma_zeta"][:, None]
        return model._replace(P0=first_covariance(network, ZETA_SD))


@dataclass(frozen=True)
class OutputARMA(_Disturbance):
    """OD (paper 2.2.3): ARMA(1,1) on the output; the network itself is never corrected.

    Parameters are ``rho_1``, ``rho_gap = rho_1 - rho_2`` (the two roots that decide stability, ruling 1; the paper's
    ``rho_2`` with ``paper_box``), and the temperatures of hidden nodes at the first row of every segment.
    """

    hidden: tuple[str, ...]  # nodes that are not measured
    firsts: tuple[float, ...]  # a temperature around which those of each segment are searched
    paper_box: bool = False
    hours: float = 0.25  # the step; the paper's bound of rho_1 at 15 minutes is a longest memory, the same at any step

    @cached_property
    def own(self) -> tuple[Parameter, ...]:
        second = "rho_2" if self.paper_box else "rho_gap"
        longest = 0.999 if self.paper_box else 0.999 ** (self.hours / 0.25)
        ends = (("rho_1", longest), (second, 0.999))
        rho = tuple(Parameter(name, "-", -end, end, "", "identity") for name, end in ends)
        start = tuple(
            Parameter(first_name(node, number), "degC", first - 20.0, first + 20.0, "", "identity")
            for number, first in enumerate(self.firsts)
            for node in self.hidden
        )
        return rho + start

    def build(self, d: Discrete, own: OwnValues, network: RCNetwork, segment: Experiment, number: int) -> Model:
        n, o, base = len(network.nodes), len(network.measured_nodes), d.dA.shape[1]
        C = np.hstack([np.eye(n)[measured_states(network)], np.eye(o)])
        s0 = first_state(network, segment.firsts, o)
        model = _appended(d, np.repeat(own["rho_1"][:, None], o, axis=1), 0, len(self.own), C, s0, 0.0)
        each, outputs = n + np.arange(o), np.arange(o)
        model.dA[:, each, each, base] = 1.0
        rho_2 = own["rho_2"] if self.paper_box else own["rho_1"] - own["rho_gap"]
        model.K[:, each, outputs] = rho_2[:, None]
        model.dK[:, each, outputs, base : base + 2] = (0.0, 1.0) if self.paper_box else (1.0, -1.0)
        for q, node in enumerate(self.hidden):
            i = network.nodes.index(node)
            model.s0[:, i] = own[first_name(node, number)]
            model.ds0[:, i, base + 2 + number * len(self.hidden) + q] = 1.0
        return model


def take_searched(state: np.ndarray, network: RCNetwork, found: Any, number: int) -> None:
    """Put what a fit found of the first row of a segment into its (n,) state, in place."""
    for i, node in enumerate(network.nodes):
        state[i] = found.get(first_name(node, number), state[i])


def first_name(node: str, number: int) -> str:
    """Name of a hidden node's temperature at the first row of a segment: ``T0_w``, of further ones ``T0_w_2`` ...."""
    return f"{FIRST}{node}" if number == 0 else f"{FIRST}{node}_{number + 1}"


def checked_kind(kind: Any) -> str:
    """Refuse what is neither ``"input"`` nor ``"output"``."""
    if not isinstance(kind, str) or kind not in ("input", "output"):
        given = f"kind={kind!r}" if np.ndim(kind) == 0 else f"kind, a {type(kind).__name__},"
        raise ValueError(f"{given} is neither 'input' nor 'output'.")
    return kind
