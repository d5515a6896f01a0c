"""Negative log marginal likelihood of the periodic model, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from ...filtering import ChannelAdjoint, ChannelFilter, Discrete, discretize, filter_channels, filter_channels_adjoint
from ...thermal import Parameter, RCNetwork
from ...thermal.parameters import search_bounds
from ..disturbance_models import first_covariance, measured_states
from ..experiment import Experiment
from ..gain_model import HOUR_CLASSES, HourClasses, VarianceModel, gain_noise, gain_parameters, own_priors
from .gauss_newton import Minimum
from .inner_solution import GainPriors, Linear, solve_inner
from .periodic_channels import ChannelLayout, SegmentSeries, physical

PRIOR_LOG_SD = 1.2  # standard deviation of a log parameter's prior; the data dominate it wherever they are informative
_NO_PRIOR = ("-", "m2", "kW")  # units of what enters linearly: a weak prior in the middle of its bounds would pull it
#: typical uncertainty of a parameter on the searched scale, the unit of the search's steps
_TYPICAL = {"kWh/K": 0.01, "K/kW": 0.02, "K": 0.03}
_STEP = 1e-4  # of the searched parameters, for differences of gradients


class PeriodicMatrices(NamedTuple):
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


class Slopes:
    """Derivatives of the objective by every parameter, gathered over the segments."""

    def __init__(self, layout: ChannelLayout, model: PeriodicMatrices) -> None:
        self.layout, self.model = layout, model
        n = len(model.heat)
        self.A, self.Q = np.zeros_like(model.A), np.zeros(len(model.sigma))
        self.boundary = np.zeros((n, len(layout.network.boundaries)))
        self.heat = np.zeros((n, n))
        self.log_sigma, self.R = np.zeros(len(model.sigma)), 0.0
        self.by_value = dict.fromkeys(model.values, 0.0)

    def add(self, segment: SegmentSeries, adjoint: ChannelAdjoint, known_heat: np.ndarray) -> None:
        """Add a segment's share."""
        model, n = self.model, len(self.model.heat)
        known = adjoint.known[:, :n]
        self.A += adjoint.A
        self.boundary += known.T @ segment.boundary
        self.heat += known.T @ known_heat
        for j, channel in enumerate(self.layout.channels):
            self.heat[:, channel.node] += adjoint.columns[:n, j + 1]
        self.Q += np.trace(adjoint.Q[:, n:, n:], axis1=1, axis2=2)
        first = segment.klass[0]
        self.log_sigma[first] += 2.0 * model.sigma[first] ** 2 * np.trace(adjoint.P0[n:, n:])
        self.R += float(adjoint.R.sum())
        self._add_known(segment, known @ model.heat)

    def _add_known(self, segment: SegmentSeries, heat_by: np.ndarray) -> None:
        """Searched capacities, areas and fractions that act through the known heat."""
        layout, values, by_value = self.layout, self.model.values, self.by_value
        for source, gain, left in layout.known_sources(values):
            flows = heat_by.T @ segment.inputs[:, layout.columns[source.role]]
            rest = next(flows[layout.place[node]] for node, fraction in source.shares if fraction is None)
            for node, fraction in source.shares:
                flow = float(flows[layout.place[node]])
                if source.parameter is not None:
                    by_value[source.parameter] += flow * (values[fraction] if fraction else left)
                if fraction:
                    by_value[fraction] += gain * (flow - float(rest))

    def by_free(self, searched: Sequence[Parameter], variance: VarianceModel, hours: float) -> np.ndarray:
        """(p,) derivatives on the searched scale; ``hours`` is the step."""
        network, (values, d, _, phi, sigma, *_) = self.layout.network, self.model
        n, by_value = len(self.heat), self.by_value
        heat = self.heat.copy()
        for i, node in enumerate(self.layout.disturbed):
            heat[:, node] += self.A[:n, n + i]
        B = np.hstack([self.boundary, heat])
        for q, p in enumerate(network.parameters(network.boundaries)):
            by_value[p.name] = float(np.sum(self.A[:n, :n] * d.dA[q]) + np.sum(B * d.dB[q]))
        phi_bar = float(np.trace(self.A[n:, n:])) - 2.0 * phi * float(self.Q @ sigma**2)
        by_value["tau"] = phi_bar * phi * hours / values["tau"] ** 2
        by_value["sigma_y"] = 2.0 * values["sigma_y"] * self.R
        logs = (self.log_sigma + 2.0 * sigma**2 * (1.0 - phi**2) * self.Q) @ variance.variance
        by_log = dict(zip(variance.names, logs, strict=True))
        out = [by_log.get(p.name, by_value[p.name] * p.slope(values[p.name])) for p in searched]
        return np.array(out, dtype=np.float64)


@dataclass(frozen=True)
class PeriodicProblem:
    """Negative log marginal likelihood of the periodic model, as a function of the searched parameters.

    The unmeasured gain is that of :mod:`skhybrid.identification.gain_model`, on every disturbed node.  What enters the
    output linearly (``inner``: capacities, solar areas; the profile, the ventilation) is solved inside by ridge
    regression on the filtered channels.  ``fixed`` holds the known values; ``priors`` are mean and standard deviation
    on the searched scale, in place of the usual ones; ``hours`` names a set of classes of hours.
    """

    network: RCNetwork
    experiment: Experiment
    searched: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    inner: tuple[str, ...]
    heat_scale: float = 1.0
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    hours: str = "day_night"

    @cached_property
    def variance(self) -> VarianceModel:
        """Classes of variance of the rows."""
        return VarianceModel.of(self.experiment, self.classes)

    @cached_property
    def layout(self) -> ChannelLayout:
        """Heat sources whose coefficients are solved inside, and the others."""
        return ChannelLayout(self.network, self.experiment.roles, self.inner)

    @property
    def classes(self) -> HourClasses:
        """Classes of hours that have a variance of their own."""
        return HOUR_CLASSES[self.hours]

    @property
    def n_days(self) -> int:
        """Days that have a factor of their own."""
        return len(self.variance.first_rows)

    @property
    def ventilation(self) -> np.ndarray:
        """(N, d) outdoor less room temperature of the rows in which air may be let in, of every disturbed node [K]."""
        places = [j + 1 for j, c in enumerate(self.layout.channels) if c.name == "ventilation"]
        return np.concatenate([segment.series[:, places] for segment in self._segments])

    def day_factors(self, values: Mapping[str, float]) -> np.ndarray:
        """Factors of the days, by which their gain varies more or less."""
        return np.exp([values[f"day_{d}"] for d in range(self.n_days)])

    @cached_property
    def _segments(self) -> tuple[SegmentSeries, ...]:
        parts = zip(self.experiment.segments, self.variance.klass, strict=True)
        return tuple(self.layout.series(segment, klass) for segment, klass in parts)

    @cached_property
    def _gain_priors(self) -> GainPriors:
        names = [p.name for p in self.searched]
        gain = self.layout.channels[self.layout.n_plain :]
        which = np.array([names.index(c.times) if c.times in names else -1 for c in gain])
        fixed = [self.fixed.get(c.times or "", 1.0) for c in gain]
        return GainPriors(np.array([c.sd for c in gain]) * np.array(fixed) * self.heat_scale, which)

    @cached_property
    def centre(self) -> np.ndarray:
        """(p,) means of the priors on the searched scale."""
        priors = own_priors(self.n_days, self.classes) | dict(self.priors)
        return np.array([priors.get(p.name, (sum(p.free_bounds) / 2.0, 0.0))[0] for p in self.searched])

    @cached_property
    def spread(self) -> np.ndarray:
        """(p,) standard deviations of the priors on the searched scale; infinite where there is none."""
        priors = own_priors(self.n_days, self.classes) | dict(self.priors)
        weak = [PRIOR_LOG_SD if p.transform == "log" and p.unit not in _NO_PRIOR else np.inf for p in self.searched]
        return np.array([priors.get(p.name, (0.0, sd))[1] for p, sd in zip(self.searched, weak, strict=True)])

    def values(self, free: np.ndarray) -> dict[str, float]:
        """Searched and fixed parameters by name."""
        return {**self.fixed, **{p.name: p.from_free(x) for p, x in zip(self.searched, free, strict=True)}}

    def _discrete(self, values: Mapping[str, float]) -> Discrete:
        """The network's zero-order hold with one heat input per node, and derivatives by R and C."""
        net = self.network
        c = net.matrices(values, net.boundaries)
        n, k = len(net.nodes), len(net.boundaries)
        B, dB = np.zeros((n, k + n)), np.zeros((len(c.dA), n, k + n))
        B[:, :k], dB[:, :, :k] = c.B[:, :k], c.dB[:, :, :k]
        each = np.arange(n)  # the capacitances are the first parameters
        B[each, k + each] = 1.0 / c.capacitance
        dB[each, each, k + each] = -1.0 / c.capacitance**2
        return discretize(c.A, B, c.dA, dB, c.capacitance, self.experiment.hours)

    def _matrices(self, values: dict[str, float]) -> PeriodicMatrices:
        layout, d = self.layout, self._discrete(values)
        n, k, m = len(layout.place), len(self.network.boundaries), len(layout.disturbed)
        heat = d.B[:, k:]
        phi = float(np.exp(-self.experiment.hours / values["tau"]))
        # logarithms of the hours, then of the days, which add up
        logs = np.array([values[n] if n.startswith("day_") else np.log(values[n]) for n in self.variance.names])
        sigma = np.exp(self.variance.variance @ logs) * self.heat_scale
        A, Q = np.zeros((n + m, n + m)), gain_noise(sigma, phi, n, m)
        A[:n, :n], A[:n, n:], A[n:, n:] = d.A, heat[:, layout.disturbed], phi * np.eye(m)
        columns = np.zeros((n + m, len(layout.channels) + 1))
        columns[:n, 1:] = heat[:, [c.node for c in layout.channels]]
        C = np.eye(n + m)[measured_states(self.network)]
        return PeriodicMatrices(values, d, heat, phi, sigma, A, columns, Q, C, np.full(len(C), values["sigma_y"] ** 2))

    def _filter(self, segment: SegmentSeries, model: PeriodicMatrices) -> tuple[ChannelFilter, np.ndarray]:
        """The filtered channels of a segment, and the known heat (N, n) that drove its first."""
        n, k = len(self.layout.place), len(self.network.boundaries)
        known_heat = self.layout.known_heat(segment, model.values)
        known = np.zeros((len(segment.y), len(model.A)))
        known[:, :n] = segment.boundary @ model.discrete.B[:, :k].T + known_heat @ model.heat.T
        P0 = first_covariance(self.network, float(model.sigma[segment.klass[0]]))
        system, rows = (model.A, model.columns, segment.series, known, model.Q), (segment.y, segment.s0, P0)
        return filter_channels(*system, segment.klass, model.C, model.R, *rows), known_heat

    def evaluate(self, free: np.ndarray) -> tuple[float, np.ndarray, Linear]:
        """Objective, its exact gradient and the inner coefficients."""
        model = self._matrices(self.values(free))
        runs = [self._filter(segment, model) for segment in self._segments]
        errors = np.concatenate([run.errors.reshape(-1, len(self.layout.channels) + 1) for run, _ in runs])
        S = np.concatenate([run.S.ravel() for run, _ in runs])
        inner = solve_inner(errors, S, self._gain_priors, self.layout.signs, free)
        slopes, begin = Slopes(self.layout, model), 0
        for segment, (run, known_heat) in zip(self._segments, runs, strict=True):
            rows = slice(begin, begin + run.S.size)
            begin = rows.stop
            bars = inner.errors_bar[rows].reshape(run.errors.shape), inner.S_bar[rows].reshape(run.S.shape)
            system = (model.A, segment.series, segment.klass, model.C, segment.y, len(model.Q))
            slopes.add(segment, filter_channels_adjoint(*system, run, *bars), known_heat)
        gradient = slopes.by_free(self.searched, self.variance, self.experiment.hours) + inner.sd_bar
        pull = (free - self.centre) / self.spread**2
        return inner.loss + 0.5 * float(pull @ (free - self.centre)), gradient + pull, inner.linear

    def theta(self, free: np.ndarray, linear: Linear) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """All parameters by name, and the derivatives by the coefficients of those that are solved inside."""
        return physical(self.layout.channels[: self.layout.n_plain], self.values(free), linear.beta)

    def all_values(self, free: np.ndarray) -> dict[str, float]:
        """Searched, fixed and inner parameters by name."""
        return self.theta(free, self.evaluate(free)[2])[0]

    def log_density(self, free: np.ndarray) -> tuple[float, np.ndarray]:
        """Log posterior density on the searched scale, up to a constant, and its gradient."""
        loss, gradient, _ = self.evaluate(free)
        return -float(loss), -gradient

    def without_gain(self) -> PeriodicProblem:
        """The same likelihood where nothing but the known inputs heats the network."""
        own = {p.name for p in gain_parameters(self.n_days, self.classes)} - {"sigma_y"}
        fixed = {**self.fixed, **{name: 0.0 if name.startswith("day_") else 1.0 for name in own}}
        searched = tuple(p for p in self.searched if p.name not in own)
        return replace(self, searched=searched, fixed=fixed, heat_scale=0.0)

    def minimise(self, start: np.ndarray) -> Minimum:
        """Bounded quasi-Newton from one start, in steps that are about as large for every parameter."""
        scale = np.array([_TYPICAL.get(p.unit, 0.3) for p in self.searched])
        if not self.searched:
            return Minimum(start, self.evaluate(start)[0], 1, True)

        def objective(x: np.ndarray) -> tuple[float, np.ndarray]:
            loss, gradient, _ = self.evaluate(x * scale)
            return loss, gradient * scale

        bounds = np.column_stack(search_bounds(self.searched)) / scale[:, None]
        options = {"maxiter": 400, "maxcor": 40, "ftol": 1e-9, "gtol": 1e-3}
        found = minimize(objective, start / scale, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        return Minimum(found.x * scale, float(found.fun), int(found.nfev), bool(found.success))

    def minimum_near(self, start: np.ndarray) -> tuple[np.ndarray, float]:
        """The minimum that one start leads to, and minus twice the log-likelihood there, up to a constant."""
        found = self.minimise(start)
        return found.free, 2.0 * found.loss

    def drop(self, loss: float, best: float) -> float:
        """By how much the log-likelihood of one loss lies below that of the best."""
        return loss - best

    def hessian(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Hessian of the objective and derivative of the inner coefficients, by central differences of exact ones."""
        p = len(free)
        H, dbeta = np.empty((p, p)), np.empty((len(self.layout.channels), p))
        for q, shift in enumerate(_STEP * np.eye(p)):
            _, up, above = self.evaluate(free + shift)
            _, down, below = self.evaluate(free - shift)
            H[:, q] = (up - down) / (2.0 * _STEP)
            dbeta[:, q] = (above.beta - below.beta) / (2.0 * _STEP)
        return 0.5 * (H + H.T), dbeta
