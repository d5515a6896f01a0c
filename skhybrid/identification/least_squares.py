"""Base of CONV, ID and OD: a sum of squared errors over bounded parameters, from many random starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
import pandas as pd

from .._arguments import store_arguments
from .._table import ZoneTable
from .._time import rows_covering, rows_of
from ..thermal import Parameter, RCNetwork
from .base import NetworkIdentifier, SearchResult
from .disturbance_models import measurement_variance
from .experiment import Experiment
from .fitting.forecast_errors import ForecastErrorProblem
from .fitting.gauss_newton import Minimum
from .fitting.prediction_errors import ROUGH, PredictionErrorProblem
from .fitting.priors import normal_priors
from .fitting.starts import random_starts, start_at, starts_table
from .gain_filter import GainFilter, fit_walk_noise, walk_noise
from .uncertainty.identifiability import at_bounds
from .uncertainty.least_squares_errors import least_squares_uncertainty


class LeastSquaresIdentifier(NetworkIdentifier):
    """Sum of squared errors over bounded parameters, from many random starts."""

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        objective: Literal["one_step", "multi_step"] = "one_step",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> Any:
        """The disturbance model: the states that it appends to the network, and their gain."""
        raise NotImplementedError

    def _make_problem(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> tuple[PredictionErrorProblem, tuple[str, ...]]:
        known, disturbance = dict(self.known or {}), self._disturbance(network, experiment)
        own = tuple(p.bounded(dict(self.bounds or {}).get(p.name)) for p in disturbance.own)
        priors = normal_priors(self.priors, (*parameters, *own), known)
        fixed = idle = self._excited(network, table, parameters, priors)
        fixed = fixed | {k: float(v) for k, v in known.items() if k in {p.name for p in (*parameters, *own)}}
        searched = tuple(p for p in (*parameters, *own) if p.name not in fixed)
        problem = self._problem(table.step, network, experiment, disturbance, searched, fixed)
        if priors:
            normal = np.array([priors.get(p.name, (0.0, np.inf)) for p in searched]).reshape(-1, 2)
            problem = replace(problem, centre=normal[:, 0], spread=normal[:, 1])
        return problem, tuple(idle)

    def _problem(self, step: pd.Timedelta, *parts: Any) -> PredictionErrorProblem:
        """The sum of squares of the errors that ``objective`` names."""
        if self.objective == "one_step":
            return PredictionErrorProblem(*parts)
        if self.objective != "multi_step":
            raise ValueError(f"objective={self.objective!r} is neither 'one_step' nor 'multi_step'.")
        n_leads = rows_covering("1D", step) if self.horizon is None else rows_of(self.horizon, step)
        return ForecastErrorProblem(*parts, n_leads=n_leads, first=rows_covering(self.warmup, step))

    def _minima(self, problem: PredictionErrorProblem, begin: Mapping[str, float] | None) -> list[Minimum]:
        if not problem.searched:
            return problem.minimise(np.zeros((1, 0)))
        if not problem.n_counted:  # of CONV only, for the others count every measurement
            raise ValueError(
                f"{type(self).__name__}: y has no measurement after the rows that set the first state "
                f"(warmup={self.warmup!r}, at most half of the rows), so nothing can be identified; give a shorter "
                "warmup, or rows with measurements."
            )
        starts = random_starts(problem.searched, self.n_starts, self._start_draws())
        starts = starts if begin is None else start_at(problem.searched, begin, starts[0])
        rough = partial(problem.minimise, max_evaluations=ROUGH[0], tolerance=ROUGH[1])
        return self._search(rough, starts, problem.drop, polish=problem.minimise)

    def _store(self, found: SearchResult) -> GainFilter:
        problem, best, minima, _, parameters, idle = found
        values, names = problem.values(best.free), [p.name for p in parameters]
        self.network_ = problem.network
        self.parameters_ = parameters
        self.theta_ = pd.Series({n: values[n] for n in names}, name="theta")
        self.disturbance_ = pd.Series({n: v for n, v in values.items() if n not in names}, dtype=np.float64)
        self.loss_ = best.loss
        self.starts_ = starts_table(minima, problem.searched, problem.drop)
        noise = problem.noise(best.free)
        uncertainty = least_squares_uncertainty(problem, best.free, noise, names, problem.days, problem.overlap)
        self._store_uncertainty(uncertainty, at_bounds(best.free, problem.searched), idle)
        one_step = problem.one_step
        self.noise_std_ = float(np.sqrt(noise if one_step is problem else one_step.noise(best.free)))
        kalman = self._make_filter(problem)
        if one_step.weighted:  # the residuals are larger than errors that many measured rows precede
            self.noise_std_ *= float(np.sqrt(self._steady_variance(kalman) / one_step.mean_variance(best.free)))
        return kalman

    def _make_filter(self, problem: PredictionErrorProblem) -> GainFilter:
        network, experiment = problem.network, problem.experiment
        d = network.discrete(self._theta, experiment.roles, experiment.hours)
        R = self._measurement_variance(experiment.hours)
        plain = GainFilter(network, d.A, d.B, 1.0, walk_noise(network, 0.0, 0.0), R)
        return replace(plain, Q=walk_noise(network, *self._walk(plain, experiment)))

    def _measurement_variance(self, hours: float) -> float:
        return measurement_variance(hours)

    def _steady_variance(self, kalman: GainFilter) -> float:
        """Variance of an error that many measured rows precede, in the unit of the problem's variances."""
        return 1.0

    def _walk(self, kalman: GainFilter, experiment: Experiment) -> tuple[float, float]:
        return fit_walk_noise(kalman, experiment)
