"""Periodic disturbance: a gain inside the filter whose variance changes with time, and a smooth weekly profile.

The unmeasured gain is that of :mod:`skhybrid.identification.gain_model`, on every disturbed node.  Everything that
enters the output linearly (capacities, solar areas, the profile, the ventilation) is solved inside by ridge regression
on the filtered channels; only R, C, the time constant and the standard deviations are searched, with exact
derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from ...filtering import ChannelAdjoint, ChannelFilter, Discrete, discretize, filter_channels, filter_channels_adjoint
from ...thermal import Parameter, RCNetwork, Source
from ..disturbance_models import first_covariance, first_state, measured_rows
from ..experiment import Experiment
from ..gain_model import (
    HOUR_CLASSES,
    VENTILATION_SD,
    VarianceModel,
    own_parameters,
    own_priors,
    profile_basis,
    profile_cell,
    ventilation_series,
)
from .gauss_newton import Minimum

#: standard deviation of a log parameter's prior; the data dominate it wherever they say anything
PRIOR_LOG_SD = 1.2
#: units of what enters linearly: a weak prior in the middle of its bounds would pull it
_NO_PRIOR = ("-", "m2", "kW")
#: how far a parameter typically lies from where the data have it, on the searched scale: the search steps in these
_TYPICAL = {"kWh/K": 0.01, "K/kW": 0.02, "K": 0.03}


@dataclass(frozen=True)
class Linear:
    """The coefficients that are solved inside, at the optimum: a ridge regression on standardised columns."""

    gamma: np.ndarray  # (J - 1,) capacities and areas, then the standard normal numbers behind the gain's coefficients
    free: np.ndarray  # (J - 1,) bool, False where a sign bound holds a coefficient at 0
    normal: np.ndarray  # (J - 1, J - 1) of the normal equations, ridge included
    scale: np.ndarray  # (J - 1,) prior standard deviations, 1 for capacities and areas

    @cached_property
    def beta(self) -> np.ndarray:
        """(J - 1,) capacities and areas, then the coefficients of the gain's channels [kW]."""
        return self.gamma * self.scale

    @cached_property
    def covariance(self) -> np.ndarray:
        """(J - 1, J - 1) covariance of ``beta`` given the searched parameters."""
        inverse, chosen = np.zeros_like(self.normal), np.ix_(self.free, self.free)
        inverse[chosen] = np.linalg.pinv(self.normal[chosen])
        return inverse * np.outer(self.scale, self.scale)


class Channel(NamedTuple):
    """One input with an unknown coefficient, which heats ``node`` by ``coefficient`` kW per unit."""

    name: str
    node: int
    sign: float = 0.0  # +1: the coefficient is not negative, -1: not positive, 0: free
    sd: float = np.inf  # prior standard deviation for a plant of 6 kW
    times: str | None = None  # the parameter that multiplies ``sd``


class _Segment(NamedTuple):
    """One segment of rows, ready for the filter."""

    y: np.ndarray  # (N, o)
    series: np.ndarray  # (N, J) of every channel; column 0 is that of the measurement
    boundary: np.ndarray  # (N, k) boundary temperatures
    inputs: np.ndarray  # (N, m)
    klass: np.ndarray  # (N,)
    s0: np.ndarray  # (n + d,)


class _Model(NamedTuple):
    """Matrices of one evaluation."""

    values: dict[str, float]
    discrete: Discrete
    heat: np.ndarray  # (n, n) effect of 1 kW on each node
    phi: float
    sigma: np.ndarray  # (n_classes,) [kW]
    A: np.ndarray  # (n + d, n + d)
    columns: np.ndarray  # (n + d, J)
    Q: np.ndarray  # (n_classes, n + d, n + d)
    C: np.ndarray  # (o, n + d)
    R: np.ndarray  # (o,)


@dataclass(frozen=True)
class PeriodicProblem:
    """Negative log marginal likelihood of the periodic model, as a function of the searched parameters.

    ``inner`` names the network parameters that are solved inside; ``searched`` are all others that are free, the
    disturbance's own among them; ``fixed`` holds the values of those that are known.  ``priors`` are mean and standard
    deviation on the searched scale, in place of those that every parameter has.  ``hours`` names the classes of hours
    that have a variance of their own.
    """

    network: RCNetwork
    experiment: Experiment
    searched: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    inner: tuple[str, ...]
    heat_scale: float = 1.0
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    hours: str = "day_night"

    # ------------------------------------------------------------------------------------------------- fixed parts
    @cached_property
    def _place(self) -> dict[str, int]:
        return {node: i for i, node in enumerate(self.network.nodes)}

    @cached_property
    def disturbed(self) -> list[int]:
        """Places of the disturbed nodes; each has a gain state and a profile."""
        return [self._place[node] for node in self.network.disturbed_nodes]

    @cached_property
    def variance(self) -> VarianceModel:
        """Classes of variance of the rows."""
        return VarianceModel.of(self.experiment.segments, HOUR_CLASSES[self.hours])

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        return self.network.sources(self.experiment.roles)

    @cached_property
    def _columns(self) -> dict[str, int]:
        return {role: j for j, role in enumerate(self.network.inputs(self.experiment.roles))}

    @cached_property
    def plain(self) -> tuple[tuple[Channel, str], ...]:
        """Capacities and areas that are solved inside, with the role of each."""
        out = []
        for source in self.sources:
            if source.parameter not in self.inner:
                continue
            for node, fraction in source.shares:
                sign = -1.0 if source.parameter.startswith("Q_c") else 1.0
                sign = sign if source.parameter.startswith(("A_win", "Q_h", "Q_c")) else 0.0
                name = f"{source.parameter}:{fraction or ''}" if len(source.shares) > 1 else source.parameter
                out.append((Channel(name, self._place[node], sign), source.role))
        return tuple(out)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Inputs with a coefficient that is solved inside: :attr:`plain`, then the gain of every disturbed node."""
        basis, sd, times = profile_basis()
        out = [channel for channel, _ in self.plain]
        for node in self.disturbed:
            out += [Channel(f"profile_{j}", node, 0.0, sd[j], times[j]) for j in range(basis.shape[1])]
            if self.ventilated:
                out.append(Channel("ventilation", node, 0.0, VENTILATION_SD))
        return tuple(out)

    @property
    def ventilated(self) -> bool:
        """Whether an outdoor temperature is there to let in."""
        return "T_oa" in self._columns

    @property
    def ventilation(self) -> np.ndarray:
        """(N, d) outdoor less room temperature of the rows in which air may be let in, of every disturbed node [K]."""
        places = [j + 1 for j, c in enumerate(self.channels) if c.name == "ventilation"]
        return np.concatenate([segment.series[:, places] for segment in self._segments])

    def day_factors(self, values: Mapping[str, float]) -> np.ndarray:
        """Factors of the days by which their gain varies more or less."""
        return np.exp([values[f"day_{d}"] for d in range(len(self.variance.first_rows))])

    @property
    def n_plain(self) -> int:
        """Coefficients without those of the gain."""
        return len(self.plain)

    @cached_property
    def _segments(self) -> tuple[_Segment, ...]:
        return tuple(
            self._segment(p, klass) for p, klass in zip(self.experiment.segments, self.variance.klass, strict=True)
        )

    def _segment(self, segment: Experiment, klass: np.ndarray) -> _Segment:
        cells = profile_basis()[0][profile_cell(segment.hour_of_day, segment.weekend)]
        columns = [np.zeros(len(cells)), *(segment.inputs[:, self._columns[role]] for _, role in self.plain)]
        outputs = list(measured_rows(self.network))
        for node in self.disturbed:
            columns += list(cells.T)
            if self.ventilated:
                output = outputs.index(node) if node in outputs else 0
                columns.append(ventilation_series(segment, segment.inputs[:, self._columns["T_oa"]], output))
        boundary = np.ascontiguousarray(segment.inputs[:, : len(self.network.boundaries)])
        series = np.ascontiguousarray(np.array(columns).T)
        s0 = first_state(self.network, segment, len(self.disturbed))
        return _Segment(np.ascontiguousarray(segment.outputs), series, boundary, segment.inputs, klass, s0)

    @cached_property
    def _sd(self) -> tuple[np.ndarray, np.ndarray]:
        """Prior standard deviations of the gain's coefficients, and which searched parameter multiplies each."""
        names = [p.name for p in self.searched]
        gain = self.channels[self.n_plain :]
        which = np.array([names.index(c.times) if c.times in names else -1 for c in gain])
        fixed = [self.fixed.get(c.times or "", 1.0) for c in gain]
        return np.array([c.sd for c in gain]) * np.array(fixed) * self.heat_scale, which

    @cached_property
    def centre(self) -> np.ndarray:
        """(p,) means of the priors on the searched scale."""
        priors = own_priors(len(self.variance.first_rows), HOUR_CLASSES[self.hours]) | dict(self.priors)
        return np.array([priors.get(p.name, (sum(p.free_bounds) / 2.0, 0.0))[0] for p in self.searched])

    @cached_property
    def spread(self) -> np.ndarray:
        """(p,) standard deviations of the priors on the searched scale; infinite where there is none."""
        priors = own_priors(len(self.variance.first_rows), HOUR_CLASSES[self.hours]) | dict(self.priors)
        weak = [PRIOR_LOG_SD if p.transform == "log" and p.unit not in _NO_PRIOR else np.inf for p in self.searched]
        return np.array([priors.get(p.name, (0.0, sd))[1] for p, sd in zip(self.searched, weak, strict=True)])

    # ------------------------------------------------------------------------------------------------ one evaluation
    def values(self, free: np.ndarray) -> dict[str, float]:
        """Searched and fixed parameters by name."""
        return {**self.fixed, **{p.name: p.from_free(x) for p, x in zip(self.searched, free, strict=True)}}

    def _discrete(self, values: Mapping[str, float]) -> Discrete:
        """The network's zero-order hold with one heat input a node, and derivatives by R and C."""
        net = self.network
        full = {**{p.name: 1.0 for p in net.parameters(net.boundaries)}, **values}
        c = net.matrices(full, net.boundaries)
        n, k = len(net.nodes), len(net.boundaries)
        B, dB = np.zeros((n, k + n)), np.zeros((len(c.dA), n, k + n))
        B[:, :k], dB[:, :, :k] = c.B[:, :k], c.dB[:, :, :k]
        names = [p.name for p in net.parameters(net.boundaries)]
        for i, name in enumerate(net.capacitances.values()):
            B[i, k + i] = 1.0 / c.capacitance[i]
            dB[names.index(name), i, k + i] = -1.0 / c.capacitance[i] ** 2
        return discretize(c.A, B, c.dA, dB, c.capacitance, self.experiment.hours)

    def _log_sigma(self, values: Mapping[str, float]) -> np.ndarray:
        """(k,) logarithms behind the standard deviations: of the hours, then of the days."""
        return np.array([values[n] if n.startswith("day_") else np.log(values[n]) for n in self.variance.names])

    def _model(self, values: dict[str, float]) -> _Model:
        d, (n, k, m) = self._discrete(values), (len(self._place), len(self.network.boundaries), len(self.disturbed))
        heat = d.B[:, k:]
        phi = float(np.exp(-self.experiment.hours / values["tau"]))
        sigma = np.exp(self.variance.variance @ self._log_sigma(values)) * self.heat_scale
        A, Q = np.zeros((n + m, n + m)), np.zeros((len(sigma), n + m, n + m))
        A[:n, :n], A[:n, n:], A[n:, n:] = d.A, heat[:, self.disturbed], phi * np.eye(m)
        for i in range(n, n + m):
            Q[:, i, i] = sigma**2 * (1.0 - phi**2)
        columns = np.zeros((n + m, len(self.channels) + 1))
        columns[:n, 1:] = heat[:, [c.node for c in self.channels]]
        C = np.eye(n + m)[measured_rows(self.network)]
        return _Model(values, d, heat, phi, sigma, A, columns, Q, C, np.full(len(C), values["sigma_y"] ** 2))

    def _known_heat(self, segment: _Segment, values: Mapping[str, float]) -> np.ndarray:
        """(N, n) heat into every node by inputs whose coefficient is not solved inside [kW]."""
        heat = np.zeros((len(segment.y), len(self._place)))
        for source in self.sources:
            if source.parameter in self.inner:
                continue
            gain = 1.0 if source.parameter is None else values[source.parameter]
            left = 1.0 - sum(values[f] for _, f in source.shares if f)
            for node, fraction in source.shares:
                share = values[fraction] if fraction else left
                heat[:, self._place[node]] += gain * share * segment.inputs[:, self._columns[source.role]]
        return heat

    def _filter(self, segment: _Segment, model: _Model) -> tuple[ChannelFilter, np.ndarray]:
        """The filtered channels of a segment, and the known heat (N, n) that drove its first."""
        n, k = len(self._place), len(self.network.boundaries)
        known_heat = self._known_heat(segment, model.values)
        known = np.zeros((len(segment.y), len(model.A)))
        known[:, :n] = segment.boundary @ model.discrete.B[:, :k].T + known_heat @ model.heat.T
        P0 = first_covariance(self.network, float(model.sigma[segment.klass[0]]))
        run = filter_channels(
            model.A,
            model.columns,
            segment.series,
            known,
            model.Q,
            segment.klass,
            model.C,
            model.R,
            segment.y,
            segment.s0,
            P0,
        )
        return run, known_heat

    def evaluate(self, free: np.ndarray) -> tuple[float, np.ndarray, Linear]:
        """Objective, its exact gradient and the inner coefficients."""
        values = self.values(free)
        model = self._model(values)
        runs = [self._filter(segment, model) for segment in self._segments]
        J = len(self.channels) + 1
        errors = np.concatenate([run.errors.reshape(-1, J) for run, _ in runs])
        S = np.concatenate([run.S.ravel() for run, _ in runs])
        loss, linear, errors_bar, S_bar, sd_bar = self._solve_inner(errors, S, free)
        slopes = _Slopes(self, model)
        begin = 0
        for segment, (run, known_heat) in zip(self._segments, runs, strict=True):
            rows = slice(begin, begin + run.S.size)
            begin = rows.stop
            adjoint = filter_channels_adjoint(
                model.A,
                segment.series,
                segment.klass,
                model.C,
                segment.y,
                len(model.Q),
                run,
                errors_bar[rows].reshape(run.errors.shape),
                S_bar[rows].reshape(run.S.shape),
            )
            slopes.add(segment, adjoint, known_heat)
        gradient = slopes.by_free() + sd_bar
        pull = (free - self.centre) / self.spread**2
        return loss + 0.5 * float(pull @ (free - self.centre)), gradient + pull, linear

    def _solve_inner(
        self, errors: np.ndarray, S: np.ndarray, free: np.ndarray
    ) -> tuple[float, Linear, np.ndarray, np.ndarray, np.ndarray]:
        """Ridge solution of the linear coefficients, the objective, its derivatives by innovations, variances, sd."""
        # a response enters the innovation with the sign of a prediction: e = e_y + sum_j beta_j e_j
        k = self.n_plain
        fixed, which = self._sd
        sd = np.where(which >= 0, np.exp(free[which]), 1.0) * fixed if len(free) else fixed
        scale = np.concatenate([np.ones(k), sd])
        scaled = errors / np.sqrt(S)[:, None]
        M = scaled.T @ scaled
        normal = M[1:, 1:] * np.outer(scale, scale)
        normal[np.diag_indices(len(scale))] += np.concatenate([np.full(k, 1e-9), np.ones(len(sd))])
        signs = np.array([c.sign for c in self.channels[:k]])
        gamma, unbound = _signed_ridge(normal, -M[1:, 0] * scale, signs)
        u, z = np.append(1.0, gamma * scale), gamma[k:]
        H = cho_factor(normal[k:, k:], lower=True)
        inverse = cho_solve(H, np.eye(len(z)))
        logdet = 2.0 * float(np.log(np.diag(H[0])).sum())
        loss = 0.5 * (float(np.log(S).sum()) + float(u @ M @ u) + float(z @ z) + logdet)

        # envelope theorem: the coefficients are at their optimum; the log-determinant depends on M and sd themselves
        M_bar = np.outer(u, u)
        M_bar[1 + k :, 1 + k :] += inverse * np.outer(sd, sd)
        scaled_bar = scaled @ M_bar
        S_bar = 0.5 / S - 0.5 * np.einsum("kj,kj->k", scaled_bar, scaled) / S
        sd_bar = np.zeros(len(free))
        np.add.at(sd_bar, which[which >= 0], (1.0 - np.diag(inverse) - z**2)[which >= 0])
        return loss, Linear(gamma, unbound, normal, scale), scaled_bar / np.sqrt(S)[:, None], S_bar, sd_bar

    def without_gain(self) -> PeriodicProblem:
        """The same likelihood where nothing but the known inputs heats the network."""
        own = {p.name for p in own_parameters(len(self.variance.first_rows), HOUR_CLASSES[self.hours])} - {"sigma_y"}
        fixed = {**self.fixed, **{name: 0.0 if name.startswith("day_") else 1.0 for name in own}}
        searched = tuple(p for p in self.searched if p.name not in own)
        return replace(self, searched=searched, fixed=fixed, heat_scale=0.0)

    # -------------------------------------------------------------------------------------------------------- search
    @cached_property
    def _typical(self) -> np.ndarray:
        return np.array([_TYPICAL.get(p.unit, 0.3) for p in self.searched])

    def minimise(self, start: np.ndarray) -> Minimum:
        """Bounded quasi-Newton from one start, in steps that are about as large for every parameter."""
        scale = self._typical
        if not self.searched:
            return Minimum(start, self.evaluate(start)[0], 1, True)

        def objective(x: np.ndarray) -> tuple[float, np.ndarray]:
            loss, gradient, _ = self.evaluate(x * scale)
            return loss, gradient * scale

        found = minimize(
            objective,
            start / scale,
            jac=True,
            method="L-BFGS-B",
            bounds=np.array([p.free_bounds for p in self.searched]) / scale[:, None],
            options={"maxiter": 400, "maxcor": 40, "ftol": 1e-9, "gtol": 1e-3},
        )
        return Minimum(found.x * scale, float(found.fun), int(found.nfev), bool(found.success))

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


class _Slopes:
    """Derivatives of the objective by every parameter, gathered over the segments."""

    def __init__(self, problem: PeriodicProblem, model: _Model) -> None:
        self.problem, self.model = problem, model
        n = len(model.heat)
        self.A, self.Q = np.zeros_like(model.A), np.zeros(len(model.sigma))
        self.boundary = np.zeros((n, len(problem.network.boundaries)))
        self.heat = np.zeros((n, n))
        self.log_sigma, self.R = np.zeros(len(model.sigma)), 0.0
        self.by_value = dict.fromkeys(model.values, 0.0)

    def add(self, segment: _Segment, adjoint: ChannelAdjoint, known_heat: np.ndarray) -> None:
        """Add a segment's share."""
        model, n = self.model, len(self.model.heat)
        known = adjoint.known[:, :n]
        self.A += adjoint.A
        self.boundary += known.T @ segment.boundary
        self.heat += known.T @ known_heat
        for j, channel in enumerate(self.problem.channels):
            self.heat[:, channel.node] += adjoint.columns[:n, j + 1]
        self.Q += np.trace(adjoint.Q[:, n:, n:], axis1=1, axis2=2)
        first = segment.klass[0]
        self.log_sigma[first] += 2.0 * model.sigma[first] ** 2 * np.trace(adjoint.P0[n:, n:])
        self.R += float(adjoint.R.sum())
        self._add_known(segment, known @ model.heat)

    def _add_known(self, segment: _Segment, heat_by: np.ndarray) -> None:
        """Searched capacities, areas and fractions that act through the known heat."""
        problem, values, by_value = self.problem, self.model.values, self.by_value
        for source in problem.sources:
            if source.parameter in problem.inner or source.parameter is None:
                continue
            left = 1.0 - sum(values[f] for _, f in source.shares if f)
            flows = heat_by.T @ segment.inputs[:, problem._columns[source.role]]
            gain = values[source.parameter]
            rest = next(flows[problem._place[node]] for node, fraction in source.shares if fraction is None)
            for node, fraction in source.shares:
                flow = float(flows[problem._place[node]])
                by_value[source.parameter] += flow * (values[fraction] if fraction else left)
                if fraction:
                    by_value[fraction] += gain * (flow - float(rest))

    def by_free(self) -> np.ndarray:
        """(p,) derivatives on the searched scale."""
        problem, (values, d, _, phi, sigma, *_) = self.problem, self.model
        n, by_value = len(self.heat), self.by_value
        heat = self.heat.copy()
        for i, node in enumerate(problem.disturbed):
            heat[:, node] += self.A[:n, n + i]
        B = np.hstack([self.boundary, heat])
        for q, p in enumerate(problem.network.parameters(problem.network.boundaries)):
            by_value[p.name] = float(np.sum(self.A[:n, :n] * d.dA[q]) + np.sum(B * d.dB[q]))
        hours = problem.experiment.hours
        phi_bar = float(np.trace(self.A[n:, n:])) - 2.0 * phi * float(self.Q @ sigma**2)
        by_value["tau"] = phi_bar * phi * hours / values["tau"] ** 2
        by_value["sigma_y"] = 2.0 * values["sigma_y"] * self.R
        logs = (self.log_sigma + 2.0 * sigma**2 * (1.0 - phi**2) * self.Q) @ problem.variance.variance
        by_log = dict(zip(problem.variance.names, logs, strict=True))
        out = [by_log.get(p.name, by_value[p.name] * p.slope(values[p.name])) for p in problem.searched]
        return np.array(out, dtype=np.float64)


def _signed_ridge(normal: np.ndarray, right: np.ndarray, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ridge solution whose first coefficients have the given signs (0: free), by an active set; and who is free."""
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
