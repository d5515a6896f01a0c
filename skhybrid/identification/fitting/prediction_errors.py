"""Sum of squared one-step errors of CONV, ID and OD, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...filtering import Model, Sensitivity, discretize, one_step_sensitivities
from ...thermal import MatrixBuilder, Parameter, RCNetwork
from ...thermal.parameters import search_bounds
from ..experiment import Experiment
from .gauss_newton import Minimum, minimise_together

#: evaluations and tolerance of the search from every start, and those that carry the best ones to the end
ROUGH, FINE = (40, 1e-5), (150, 1e-10)
_MEMORY = 2**25  # memory that the sensitivities of starts evaluated together may take [bytes]


@dataclass(frozen=True)
class PredictionErrorProblem:
    """Least-squares problem of CONV, ID or OD.

    Where some errors are expected to be larger than others, ID and OD divide each by its standard deviation, and
    multiply all by the geometric mean of these: those of a filter's first rows, and those after a missing row.  n/2
    times the logarithm of the sum is then the negative Gaussian log-likelihood, its noise level at the optimum, up to a
    constant.  Elsewhere the plain sum of squares is the paper's.  Several measured nodes count as if independent.

    ``free`` are the values of ``searched``; ``fixed`` holds all others.  ``centre`` and ``spread`` are means and
    standard deviations of normal priors on the searched scale, infinite where there is none.
    """

    network: RCNetwork
    experiment: Experiment
    disturbance: Any
    searched: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    centre: np.ndarray | None = None
    spread: np.ndarray | None = None

    def values(self, free: np.ndarray) -> dict[str, float]:
        """All parameters by name."""
        return {**self.fixed, **{p.name: p.from_free(x) for p, x in zip(self.searched, free, strict=True)}}

    all_values = values  # nothing is solved inside

    @cached_property
    def _matrix_builder(self) -> MatrixBuilder:
        return self.network.matrix_builder(self.experiment.roles)

    @cached_property
    def _names(self) -> tuple[list[str], list[str]]:
        """Names of the network's and of the disturbance's parameters, in the order of the derivatives."""
        network = [p.name for p in self.network.parameters(self.experiment.roles)]
        return network, [p.name for p in self.disturbance.own]

    @cached_property
    def _chosen(self) -> np.ndarray:
        names = [*self._names[0], *self._names[1]]
        return np.array([names.index(p.name) for p in self.searched], dtype=np.int64)

    @cached_property
    def n_counted(self) -> int:
        """Measurements whose errors count."""
        return int(sum(np.isfinite(segment.outputs[first:]).sum() for segment, first in self._counted))

    @cached_property
    def _counted(self) -> tuple[tuple[Experiment, int], ...]:
        segments = self.experiment.segments
        return tuple((segment, self.disturbance.first_counted(len(segment.y))) for segment in segments)

    def models(self, free: np.ndarray, derive: bool = True) -> list[Model]:
        """The predictors of S points, one of each segment of rows, with derivatives by the searched scale."""
        S = len(free)
        columns = {name: np.full(S, value) for name, value in self.fixed.items()}
        slopes = np.ones((S, len(self.searched)))
        for q, p in enumerate(self.searched):
            columns[p.name] = p.sign * np.exp(free[:, q]) if p.transform == "log" else free[:, q]
            if p.transform == "log":
                slopes[:, q] = columns[p.name]
        c = self._matrix_builder.matrices(np.column_stack([columns[name] for name in self._names[0]]).reshape(S, -1))
        dA, dB = (c.dA, c.dB) if derive else (c.dA[:, :0], c.dB[:, :0])
        d = discretize(c.A, c.B, dA, dB, c.capacitance, self.experiment.hours)
        chosen = self._chosen if derive else self._chosen[:0]
        slopes = slopes[:, None, None, : len(chosen)]
        out = []
        for number, (segment, _) in enumerate(self._counted):
            m = self.disturbance.build(d, columns, self.network, segment, number)
            names = ("dA", "dB", "dK", "dQ")
            scaled = {name: np.ascontiguousarray(getattr(m, name)[..., chosen] * slopes) for name in names}
            ds0 = np.ascontiguousarray(m.ds0[..., chosen] * slopes[:, 0])
            out.append(m._replace(ds0=ds0, **scaled))
        return out

    @cached_property
    def weighted(self) -> bool:
        """Whether errors count by their variance: a filter's do, others if a measurement between others is missing."""
        if self.disturbance.weighted and self.disturbance.filtered(len(self.experiment.y)):
            return True
        seen = [np.flatnonzero(np.isfinite(y)) for segment, first in self._counted for y in segment.outputs[first:].T]
        return self.disturbance.weighted and any(len(rows) and np.ptp(rows) + 1 > len(rows) for rows in seen)

    def _run(self, free: np.ndarray, derive: bool) -> Sensitivity:
        """Rows that count, of all segments and outputs: errors (S, n), their derivatives, and their variances."""
        S, parts = len(free), []
        for m, (segment, first) in zip(self.models(free, derive), self._counted, strict=True):
            filtered = self.disturbance.filtered(len(segment.y))
            run = one_step_sensitivities(m, segment.inputs, segment.outputs, filtered, self.weighted)
            kept = (values[:, first:] for values in run)
            parts.append([v.reshape(S, v.shape[1] * v.shape[2], *v.shape[3:]) for v in kept])
        if len(parts) == 1:
            return Sensitivity(*parts[0])
        return Sensitivity(*(np.concatenate(values, axis=1) for values in zip(*parts, strict=True)))

    def _errors(self, free: np.ndarray, derive: bool) -> tuple[np.ndarray, np.ndarray]:
        """Errors that count (S, n), weighted where their variances differ, and their derivatives (S, n, p)."""
        errors, derrors, variances, dvariances = self._run(free, derive)
        if not self.weighted:
            return errors, derrors
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # rows without a measurement have variance 1 and error 0
            root = np.sqrt(self._mean_variance(variances)[:, None] / variances)
            errors = root * errors
            dvariances /= variances[..., None]
            mean = dvariances.sum(axis=1, keepdims=True) / self.n_counted
            derrors = root[..., None] * derrors + 0.5 * errors[..., None] * (mean - dvariances)
        return errors, derrors

    def _mean_variance(self, variances: np.ndarray) -> np.ndarray:
        """(S,) geometric means over the measurements that count."""
        return np.exp(np.log(variances).sum(axis=1) / self.n_counted)

    @property
    def one_step(self) -> PredictionErrorProblem:
        """The problem whose errors are those of the next row; of CONV, of its simulation."""
        return self

    @property
    def days(self) -> np.ndarray | None:
        """(n,) day of every error; None where the errors follow each other as the rows do."""
        return None

    @property
    def overlap(self) -> int:
        """Days over which the errors of one day are correlated with those of another."""
        return 0

    @property
    def n_entries(self) -> int:
        """Errors of one point, including those of rows that were not measured."""
        return self.experiment.outputs.size

    def noise(self, free: np.ndarray) -> float:
        """Sum of squares per error that counts [K2]; the Gauss-Newton matrix divided by it is an information."""
        return float(np.sum(self.residuals(free) ** 2)) / max(self.n_counted - len(free), 1)

    def mean_variance(self, free: np.ndarray) -> float:
        """Geometric mean of the variances that the model expects of the errors; 1 where they count as they are."""
        if not self.weighted:
            return 1.0
        return float(self._mean_variance(self._run(np.asarray(free)[None], False).variances)[0])

    def residuals(self, free: np.ndarray) -> np.ndarray:
        """Errors that count, (n,) [K]; weighted where their variances differ."""
        return self._errors(np.asarray(free)[None], False)[0][0]

    def linearised(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n,) and their exact derivatives (n, p), of one run."""
        errors, derrors = self._errors(np.asarray(free)[None], True)
        return errors[0], derrors[0]

    def evaluate(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Merit (S,), Gauss-Newton matrix (S, p, p) and half gradient (S, p) of S points (S, p).

        The merit is the sum of squared residuals; a prior multiplies it by exp(penalty / n), which leaves the maximum
        of the posterior, concentrated over the noise, where it is.
        """
        errors, derrors = self._errors(free, True)
        turned = np.swapaxes(derrors, 1, 2)
        with np.errstate(over="ignore", invalid="ignore"):
            merit = (errors * errors).sum(axis=1)
            matrix, slope = turned @ derrors, (turned @ errors[..., None])[..., 0]
        if self.centre is not None and self.spread is not None:
            away, n = (free - self.centre) / self.spread, self.n_counted
            share = merit[:, None] / n / self.spread
            lift = np.exp((away**2).sum(axis=1) / n)
            slope = (slope + share * away) * lift[:, None]
            matrix = (matrix + (share / self.spread)[:, None, :] * np.eye(len(self.searched))) * lift[:, None, None]
            merit = merit * lift
        return np.where(np.isfinite(merit) & np.isfinite(matrix).all(axis=(1, 2)), merit, np.inf), matrix, slope

    def log_density(self, free: np.ndarray) -> tuple[float, np.ndarray]:
        """Log posterior density on the searched scale, the noise integrated out, and its gradient."""
        merit, _, half = self.evaluate(free[None])
        return -0.5 * self.n_counted * float(np.log(merit[0])), -self.n_counted * half[0] / merit[0]

    def minimum_near(self, start: np.ndarray) -> tuple[np.ndarray, float]:
        """The minimum that one start leads to, and minus twice the log-likelihood there, up to a constant."""
        (least,) = self.minimise(start[None])
        return least.free, 2.0 * self.drop(least.loss, 1.0)

    def drop(self, loss: float, best: float) -> float:
        """By how much the log-likelihood of one loss lies below that of the best."""
        return 0.5 * self.n_counted * float(np.log(max(loss, 1e-300) / max(best, 1e-300)))

    def minimise(self, starts: np.ndarray, max_evaluations: int = FINE[0], tolerance: float = FINE[1]) -> list[Minimum]:
        """Bounded Gauss-Newton from every start (S, p), together as far as memory allows."""
        one = 8 * self.n_entries * (len(self.searched) + 1) * (1 + self.weighted)
        together = max(1, _MEMORY // one)
        low, high = search_bounds(self.searched)
        out: list[Minimum] = []
        for i in range(0, len(starts), together):
            out += minimise_together(self.evaluate, starts[i : i + together], low, high, max_evaluations, tolerance)
        return out
