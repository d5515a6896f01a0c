"""Prediction-error identification: sum of squared one-step errors, exact Jacobian, many starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import least_squares

from .._kernels import one_step_errors, one_step_sensitivities
from ..thermal import Parameter, RCNetwork
from .experiment import Experiment

#: evaluations and tolerance of the rough search of every start, and how many of the best are then polished
_ROUGH, _POLISHED = (30, 1e-5), 5


class Minimum(NamedTuple):
    """Where one start ended."""

    free: np.ndarray  # (p,) on the searched scale
    loss: float
    n_evaluations: int
    converged: bool


@dataclass(frozen=True)
class PredictionErrorProblem:
    """Least-squares problem of CONV, ID or OD.

    ``searched`` are the parameters that the data decide, in the order of the vector ``free``; ``fixed`` holds the
    values of all others.
    """

    network: RCNetwork
    experiment: Experiment
    disturbance: Any
    searched: tuple[Parameter, ...]
    fixed: Mapping[str, float]

    @property
    def measured(self) -> int:
        return self.network.nodes.index(self.network.measured)

    def values(self, free: np.ndarray) -> dict[str, float]:
        """All parameters by name."""
        return {**self.fixed, **{p.name: p.from_free(x) for p, x in zip(self.searched, free, strict=True)}}

    def _predictor(self, values: dict[str, float]) -> Any:
        d = self.network.discrete(values, self.experiment.roles, self.experiment.hours)
        return self.disturbance.build(d, values, self.measured, self.experiment)

    def residuals(self, free: np.ndarray) -> np.ndarray:
        """Errors that count, (n,) [K]."""
        e = self.experiment
        m = self._predictor(self.values(free))
        errors = one_step_errors(m.A, e.inputs @ m.B.T, m.K, m.c, e.y, m.s0).errors
        return np.nan_to_num(errors[self.disturbance.first_row(len(e.y)) :], nan=1e6, posinf=1e6, neginf=-1e6)

    def jacobian(self, free: np.ndarray) -> np.ndarray:
        """Exact derivatives of the residuals by ``free``, (n, p)."""
        e, values = self.experiment, self.values(free)
        m = self._predictor(values)
        names = [p.name for p in self.network.parameters(e.roles)] + [p.name for p in self.disturbance.own]
        chosen = [names.index(p.name) for p in self.searched]
        dforcing = np.einsum("kj,qij->qki", e.inputs, m.dB[chosen])
        result = one_step_sensitivities(
            m.A, e.inputs @ m.B.T, m.K, m.c, e.y, m.s0, m.dA[chosen], dforcing, m.dK[chosen], m.ds0[chosen]
        )
        slopes = np.array([p.slope(values[p.name]) for p in self.searched])
        return np.nan_to_num(result.derrors[self.disturbance.first_row(len(e.y)) :] * slopes)

    def minimise(self, start: np.ndarray, max_evaluations: int = 150, tolerance: float = 1e-9) -> Minimum:
        """Bounded Gauss-Newton (trust region) from one start."""
        low, high = np.array([p.free_bounds for p in self.searched]).T
        found = least_squares(
            self.residuals,
            np.clip(start, low, high),
            self.jacobian,
            bounds=(low, high),
            max_nfev=max_evaluations,
            ftol=tolerance,
            xtol=tolerance,
        )
        return Minimum(found.x, 2.0 * float(found.cost), int(found.nfev), bool(found.success))


def random_starts(searched: Sequence[Parameter], n_starts: int, rng: np.random.RandomState) -> np.ndarray:
    """(n_starts, p) uniform on the searched scale, which is log-uniform for the physical parameters."""
    low, high = np.array([p.free_bounds for p in searched]).reshape(-1, 2).T
    return low + (high - low) * rng.uniform(size=(n_starts, len(searched)))


def run_starts(
    minimise: Callable[[np.ndarray], Minimum], starts: np.ndarray, n_jobs: int | None, verbose: int, name: str
) -> list[Minimum]:
    """Every start's minimum, in the order of the starts whatever ``n_jobs`` is, with a progress bar."""
    runs = Parallel(n_jobs=n_jobs, return_as="generator")(delayed(minimise)(start) for start in starts)
    return list(_progress(runs, len(starts), verbose, name))


def search(
    problem: PredictionErrorProblem, starts: np.ndarray, n_jobs: int | None, verbose: int, name: str
) -> list[Minimum]:
    """Every start's minimum: all roughly, then the best few to the end, since most end in the same few basins."""
    rough = partial(problem.minimise, max_evaluations=_ROUGH[0], tolerance=_ROUGH[1])
    minima = run_starts(rough, starts, n_jobs, verbose, name)
    best = np.argsort([m.loss for m in minima], kind="stable")[:_POLISHED]
    polished = run_starts(problem.minimise, np.array([minima[i].free for i in best]), n_jobs, 0, name)
    for i, end in zip(best, polished, strict=True):
        minima[i] = end._replace(n_evaluations=end.n_evaluations + minima[i].n_evaluations)
    return minima


def _progress(runs: Any, total: int, verbose: int, name: str) -> Any:
    if not verbose:
        return runs
    from tqdm.auto import tqdm  # only where somebody watches

    return tqdm(runs, total=total, desc=f"{name} starts", unit="start")
