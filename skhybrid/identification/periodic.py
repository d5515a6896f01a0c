"""Periodic disturbance: a gain inside the filter whose variance changes with time, and a smooth weekly profile.

The unmeasured gain is ``p(t) + g(t)`` [kW] on the disturbed node: ``p`` a smooth profile by hour and day type, ``g`` an
Ornstein-Uhlenbeck state whose variance depends on the class of the hour.  The quiet hours then carry the information
that they have about the building, which a single variance would drown.

Everything that enters the output linearly (capacities, solar areas, the profile) is solved inside by ridge regression
on the filtered channels; only R, C, the time constant and the standard deviations are searched, with exact derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from .._kernels import Discrete, discretize, filter_channels, filter_channels_adjoint
from ..thermal import Parameter, RCNetwork
from ..thermal.network import Source
from .disturbance import first_covariance
from .experiment import Experiment
from .gauss_newton import Minimum

#: classes of hours that have a variance of their own
CLASSES = ("weekday_day", "weekday_night", "weekend")
#: the weekday hours of the first class
DAY_HOURS = (6, 21)
#: standard deviation of a log parameter's prior; the data dominate it wherever they say anything
PRIOR_LOG_SD = 1.2
#: prior standard deviation of the profile's level, for a plant of 6 kW [kW]
LEVEL_SD = 3.0
_HOURS = 24


def hour_class(hour: np.ndarray, weekend: np.ndarray) -> np.ndarray:
    """Class of every row, (N,) int, in the order of :data:`CLASSES`."""
    day = (hour >= DAY_HOURS[0]) & (hour < DAY_HOURS[1])
    return np.where(weekend, 2, np.where(day, 0, 1)).astype(np.int64)


def profile_cell(hour: np.ndarray, weekend: np.ndarray) -> np.ndarray:
    """Cell of the weekly profile of every row: the hour on weekdays, 24 + the hour on weekends."""
    return hour + _HOURS * weekend


def cyclic_walk_root() -> np.ndarray:
    """(24, 23) root of the covariance of a cyclic first-order random walk with unit steps and zero mean."""
    steps = np.eye(_HOURS) - np.roll(np.eye(_HOURS), 1, axis=1)
    values, vectors = np.linalg.eigh(steps.T @ steps)
    return vectors[:, 1:] / np.sqrt(values[1:])


@dataclass(frozen=True)
class Linear:
    """The coefficients that are solved inside, at the optimum: a ridge regression on standardised columns."""

    gamma: np.ndarray  # (J - 1,) capacities and areas, then the standard normal numbers behind the profile
    free: np.ndarray  # (J - 1,) bool, False where a sign bound holds a coefficient at 0
    design: np.ndarray  # (N, J - 1)
    ridge: np.ndarray  # (J - 1,)
    root: np.ndarray  # (48, 48) of the profile's prior covariance

    @cached_property
    def _turn(self) -> np.ndarray:
        turn, k = np.eye(len(self.gamma)), len(self.gamma) - len(self.root)
        turn[k:, k:] = self.root
        return turn

    @cached_property
    def beta(self) -> np.ndarray:
        """(J - 1,) capacities and areas, then the profile [kW]."""
        return self._turn @ self.gamma

    @cached_property
    def covariance(self) -> np.ndarray:
        """(J - 1, J - 1) covariance of ``beta`` given the searched parameters."""
        columns = self.design[:, self.free]
        inverse = np.zeros((len(self.gamma), len(self.gamma)))
        normal = columns.T @ columns + np.diag(self.ridge[self.free])
        inverse[np.ix_(self.free, self.free)] = np.linalg.pinv(normal)
        return self._turn @ inverse @ self._turn.T


class _Channel(NamedTuple):
    """One input with an unknown coefficient: ``series`` heats ``node`` by ``coefficient`` kW per unit."""

    name: str
    series: np.ndarray
    node: int
    sign: float  # +1: the coefficient is not negative, -1: not positive, 0: free


@dataclass(frozen=True)
class PeriodicProblem:
    """Negative log marginal likelihood of the periodic model, as a function of the searched parameters.

    ``inner`` names the network parameters that are solved inside; ``searched`` are all others that are free, the
    disturbance's own among them; ``fixed`` holds the values of those that are known.
    """

    network: RCNetwork
    experiment: Experiment
    searched: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    inner: tuple[str, ...]
    heat_scale: float = 1.0

    # ------------------------------------------------------------------------------------------------- fixed parts
    @cached_property
    def measured(self) -> int:
        return self.network.nodes.index(self.network.measured)

    @cached_property
    def disturbed(self) -> int:
        return self.network.nodes.index(self.network.disturbed)

    @cached_property
    def klass(self) -> np.ndarray:
        return hour_class(self.experiment.hour_of_day, self.experiment.weekend)

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        return self.network.sources(self.experiment.roles)

    def _series(self, role: str) -> np.ndarray:
        return self.experiment.inputs[:, self.network.inputs(self.experiment.roles).index(role)]

    @cached_property
    def channels(self) -> tuple[_Channel, ...]:
        """Inputs with a coefficient that is solved inside: capacities and areas, then the profile's cells."""
        place = {node: i for i, node in enumerate(self.network.nodes)}
        out = []
        for source in self.sources:
            if source.parameter not in self.inner:
                continue
            for node, fraction in source.shares:
                sign = -1.0 if source.parameter.startswith("Q_c") else 1.0
                sign = sign if source.parameter.startswith(("A_win", "Q_h", "Q_c")) else 0.0
                name = f"{source.parameter}:{fraction or ''}" if len(source.shares) > 1 else source.parameter
                out.append(_Channel(name, self._series(source.role), place[node], sign))
        cell = profile_cell(self.experiment.hour_of_day, self.experiment.weekend)
        for j in range(2 * _HOURS):
            out.append(_Channel(f"profile_{j}", (cell == j).astype(np.float64), self.disturbed, 0.0))
        return tuple(out)

    @cached_property
    def _series_matrix(self) -> np.ndarray:
        columns = [np.zeros(len(self.experiment.y)), *(c.series for c in self.channels)]
        return np.ascontiguousarray(np.array(columns).T)

    @cached_property
    def _nodes_of_channels(self) -> np.ndarray:
        return np.array([c.node for c in self.channels])

    @property
    def n_plain(self) -> int:
        """Coefficients without the profile."""
        return len(self.channels) - 2 * _HOURS

    @cached_property
    def _walk(self) -> np.ndarray:
        return cyclic_walk_root()

    # ------------------------------------------------------------------------------------------------ one evaluation
    def values(self, free: np.ndarray) -> dict[str, float]:
        """Searched and fixed parameters by name."""
        return {**self.fixed, **{p.name: p.from_free(x) for p, x in zip(self.searched, free, strict=True)}}

    def _discrete(self, values: Mapping[str, float]) -> Discrete:
        """The network's zero-order hold with one heat input a node, and derivatives by R and C."""
        net = self.network
        full = {**values, **{p.name: 1.0 for p in net.parameters(net.boundaries) if p.name not in values}}
        c = net.matrices(full, net.boundaries)
        n, k = len(net.nodes), len(net.boundaries)
        B, dB = np.zeros((n, k + n)), np.zeros((len(c.dA), n, k + n))
        B[:, :k], dB[:, :, :k] = c.B[:, :k], c.dB[:, :, :k]
        names = [p.name for p in net.parameters(net.boundaries)]
        for i, name in enumerate(net.capacitances.values()):
            B[i, k + i] = 1.0 / c.capacitance[i]
            dB[names.index(name), i, k + i] = -1.0 / c.capacitance[i] ** 2
        return discretize(c.A, B, c.dA, dB, c.capacitance, self.experiment.hours)

    def _known_heat(self, values: Mapping[str, float]) -> np.ndarray:
        """(N, n) heat into every node by inputs whose coefficient is not solved inside [kW]."""
        place = {node: i for i, node in enumerate(self.network.nodes)}
        heat = np.zeros((len(self.experiment.y), len(place)))
        for source in self.sources:
            if source.parameter in self.inner:
                continue
            gain = 1.0 if source.parameter is None else values[source.parameter]
            left = 1.0 - sum(values[f] for _, f in source.shares if f)
            for node, fraction in source.shares:
                share = values[fraction] if fraction else left
                heat[:, place[node]] += gain * share * self._series(source.role)
        return heat

    def _root(self, values: Mapping[str, float]) -> np.ndarray:
        """(48, 48) root L of the profile's prior covariance: a level and a cyclic walk for each day type."""
        one = np.column_stack(
            [np.full(_HOURS, LEVEL_SD * self.heat_scale), values["sigma_profile"] * self.heat_scale * self._walk]
        )
        return np.kron(np.eye(2), one)

    def evaluate(self, free: np.ndarray) -> tuple[float, np.ndarray, Linear]:
        """Objective, its exact gradient and the inner coefficients."""
        values = self.values(free)
        d, e = self._discrete(values), self.experiment
        n, k = len(self.network.nodes), len(self.network.boundaries)
        heat_columns = d.B[:, k:]
        phi = float(np.exp(-e.hours / values["tau"]))
        A = np.zeros((n + 1, n + 1))
        A[:n, :n], A[:n, n], A[n, n] = d.A, heat_columns[:, self.disturbed], phi
        columns = np.zeros((len(self.channels) + 1, n + 1))
        columns[1:, :n] = heat_columns[:, self._nodes_of_channels].T
        known_heat = self._known_heat(values)
        known = np.zeros((len(e.y), n + 1))
        known[:, :n] = self._boundary_inputs @ d.B[:, :k].T + known_heat @ heat_columns.T
        sigma = np.array([values[f"sigma_{c}"] for c in CLASSES]) * self.heat_scale
        Q = np.zeros((len(CLASSES), n + 1, n + 1))
        Q[:, n, n] = sigma**2 * (1.0 - phi**2)
        P0 = first_covariance(self.network, float(sigma[self.klass[0]]))
        c, R = np.eye(n + 1)[self.measured], values["sigma_y"] ** 2
        s0 = np.append(np.full(n, e.first), 0.0)
        r = filter_channels(A, columns, self._series_matrix, known, Q, self.klass, c, R, e.y, s0, P0)

        loss, linear, errors_bar, S_bar, profile_slope = self._solve_inner(r.errors, r.S, self._root(values))
        adjoint = filter_channels_adjoint(
            A, self._series_matrix, self.klass, c, e.y, len(CLASSES), r, errors_bar, S_bar
        )

        by_value = dict.fromkeys(values, 0.0)
        heat_bar = np.zeros((n, n))
        for j, node in enumerate(self._nodes_of_channels):
            heat_bar[:, node] += adjoint.columns[j + 1, :n]
        heat_bar += adjoint.known[:, :n].T @ known_heat
        heat_bar[:, self.disturbed] += adjoint.A[:n, n]
        B_bar = np.hstack([adjoint.known[:, :n].T @ self._boundary_inputs, heat_bar])
        for q, p in enumerate(self.network.parameters(self.network.boundaries)):
            by_value[p.name] = float(np.sum(adjoint.A[:n, :n] * d.dA[q]) + np.sum(B_bar * d.dB[q]))
        self._add_known_slopes(by_value, values, adjoint.known[:, :n] @ heat_columns)
        Q_bar = adjoint.Q[:, n, n]
        phi_bar = adjoint.A[n, n] - 2.0 * phi * float(Q_bar @ sigma**2)
        by_value["tau"] = phi_bar * phi * e.hours / values["tau"] ** 2
        sigma_bar = 2.0 * sigma * (1.0 - phi**2) * Q_bar
        sigma_bar[self.klass[0]] += 2.0 * sigma[self.klass[0]] * adjoint.P0[n, n]
        for i, name in enumerate(CLASSES):
            by_value[f"sigma_{name}"] = float(sigma_bar[i]) * self.heat_scale
        by_value["sigma_y"] = 2.0 * values["sigma_y"] * adjoint.R
        by_value["sigma_profile"] = profile_slope / values["sigma_profile"]
        gradient = np.array([by_value[p.name] * p.slope(values[p.name]) for p in self.searched])
        pull = (free - self._centre) / PRIOR_LOG_SD**2 * self._has_prior
        return loss + 0.5 * float(pull @ (free - self._centre)), gradient + pull, linear

    @cached_property
    def _boundary_inputs(self) -> np.ndarray:
        return np.ascontiguousarray(self.experiment.inputs[:, : len(self.network.boundaries)])

    @cached_property
    def _centre(self) -> np.ndarray:
        return np.array([sum(p.free_bounds) / 2.0 for p in self.searched])

    @cached_property
    def _has_prior(self) -> np.ndarray:
        return np.array([float(p.transform == "log") for p in self.searched])

    def _add_known_slopes(self, by_value: dict[str, float], values: Mapping[str, float], heat_by: np.ndarray) -> None:
        """Derivatives by searched capacities, areas and fractions that act through the known heat."""
        place = {node: i for i, node in enumerate(self.network.nodes)}
        for source in self.sources:
            if source.parameter in self.inner or source.parameter is None:
                continue
            left = 1.0 - sum(values[f] for _, f in source.shares if f)
            series, gain = self._series(source.role), values[source.parameter]
            rest = next(node for node, fraction in source.shares if fraction is None)
            for node, fraction in source.shares:
                flow = float(heat_by[:, place[node]] @ series)
                by_value[source.parameter] += flow * (values[fraction] if fraction else left)
                if fraction:
                    by_value[fraction] += gain * (flow - float(heat_by[:, place[rest]] @ series))

    def _solve_inner(
        self, errors: np.ndarray, S: np.ndarray, root: np.ndarray
    ) -> tuple[float, Linear, np.ndarray, np.ndarray, float]:
        """Ridge solution of the linear coefficients, the objective, its derivatives by innovations and variances."""
        # a response enters the innovation with the sign of a prediction: e = e_y + sum_j beta_j e_j
        weight = np.outer(1.0 / np.sqrt(S), np.append(1.0, np.full(len(self.channels), -1.0)))
        scaled = errors * weight
        y, plain, cells = scaled[:, 0], scaled[:, 1 : 1 + self.n_plain], scaled[:, 1 + self.n_plain :]
        Z = cells @ root  # the profile as a linear map of standard normal numbers
        design = np.hstack([plain, Z])
        ridge = np.concatenate([np.full(self.n_plain, 1e-9), np.ones(Z.shape[1])])
        signs = np.array([c.sign for c in self.channels[: self.n_plain]])
        gamma, free = _signed_ridge(design, y, ridge, signs)
        residual = y - design @ gamma
        H = cho_factor(np.eye(Z.shape[1]) + Z.T @ Z, lower=True)
        logdet = 2.0 * float(np.log(np.diag(H[0])).sum())
        z = gamma[self.n_plain :]
        seen = float(np.log(S).sum())
        loss = 0.5 * (seen + float(residual @ residual) + float(z @ z) + logdet)

        # envelope theorem: the coefficients are at their optimum; the log-determinant depends on the design itself
        Z_bar = -np.outer(residual, z) + cho_solve(H, Z.T).T
        root_bar = cells.T @ Z_bar
        scaled_bar = np.hstack([residual[:, None], -np.outer(residual, gamma[: self.n_plain]), Z_bar @ root.T])
        S_bar = 0.5 / S - 0.5 * (scaled_bar * scaled).sum(axis=1) / S
        is_walk = np.tile(np.arange(_HOURS) > 0, 2)
        profile_slope = float((root_bar * root)[:, is_walk].sum())
        linear = Linear(gamma, free, design, ridge, root)
        return loss, linear, scaled_bar * weight, S_bar, profile_slope

    # -------------------------------------------------------------------------------------------------------- search
    def minimise(self, start: np.ndarray) -> Minimum:
        """Bounded quasi-Newton from one start."""
        found = minimize(
            lambda x: self.evaluate(x)[:2],
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=[p.free_bounds for p in self.searched],
            options={"maxiter": 300, "maxcor": 30, "ftol": 1e-9, "gtol": 1e-3},
        )
        return Minimum(found.x, float(found.fun), int(found.nfev), bool(found.success))

    def drop(self, loss: float, best: float) -> float:
        """By how much the log-likelihood of one loss lies below that of the best."""
        return loss - best

    def hessian(self, free: np.ndarray, step: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
        """Hessian of the objective and derivative of the inner coefficients, by central differences of exact ones."""
        p = len(free)
        H, dbeta = np.empty((p, p)), np.empty((len(self.channels), p))
        for q in range(p):
            shift = step * np.eye(p)[q]
            _, up, above = self.evaluate(free + shift)
            _, down, below = self.evaluate(free - shift)
            H[:, q] = (up - down) / (2.0 * step)
            dbeta[:, q] = (above.beta - below.beta) / (2.0 * step)
        return 0.5 * (H + H.T), dbeta


def _signed_ridge(
    design: np.ndarray, y: np.ndarray, ridge: np.ndarray, signs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ridge solution whose first coefficients have the given signs (0: free), by an active set; and who is free."""
    normal, right = design.T @ design + np.diag(ridge), design.T @ y
    free = np.ones(len(right), dtype=bool)
    gamma = np.zeros(len(right))
    for _ in range(2 * len(signs) + 1):
        gamma = np.zeros(len(right))
        gamma[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right[free], rcond=1e-13)[0]
        wrong = np.flatnonzero((gamma[: len(signs)] * signs < 0) & free[: len(signs)])
        if len(wrong):
            free[wrong[np.argmax(np.abs(gamma[wrong]))]] = False
            continue
        pull = (right - normal @ gamma)[: len(signs)] * signs
        inward = np.flatnonzero((pull > 1e-9) & ~free[: len(signs)])
        if not len(inward):
            break
        free[inward[np.argmax(pull[inward])]] = True
    return gamma, free


def own_parameters() -> tuple[Parameter, ...]:
    """Parameters of the disturbance: time constant, noise, and standard deviations in units of a 6 kW plant."""
    out = [Parameter("tau", "h", 0.2, 120.0, "time constant of the gain state")]
    out += [Parameter(f"sigma_{c}", "6 kW plant", 0.002, 12.0, f"standard deviation, {c}") for c in CLASSES]
    out += [Parameter("sigma_y", "K", 1e-3, 1.0, "measurement noise")]
    out += [Parameter("sigma_profile", "6 kW plant", 0.005, 5.0, "hourly step of the weekly profile")]
    return tuple(out)
