"""CONV, ID and OD: a sum of squared errors over bounded parameters, from many random starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from .._table import ZoneTable
from .._time import rows_covering, rows_of
from ..thermal import Parameter, RCNetwork
from .base import NetworkIdentifier, SearchResult, store_arguments
from .disturbance_models import Conventional, InputRandomWalk, OutputARMA, measurement_variance, take_searched
from .experiment import Experiment
from .filtered_network import ForecastStart
from .fitting.forecast_errors import MultiStepProblem
from .fitting.gauss_newton import Minimum
from .fitting.prediction_errors import ROUGH, PredictionErrorProblem
from .fitting.priors import normal_priors
from .fitting.starts import random_starts, start_at, starts_table
from .gain_filter import GainFilter, fit_walk_noise, walk_noise, without_disturbance
from .one_step_errors import Innovations, arma_innovations, arma_prediction, scaled_innovations, simulation_errors
from .shared_docs import shared_docs
from .uncertainty.identifiability import at_bounds
from .uncertainty.least_squares_errors import least_squares_uncertainty


class LeastSquaresIdentifier(NetworkIdentifier):
    """Sum of squared errors over bounded parameters, from many random starts."""

    objective: Any

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        objective="one_step",
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
        return MultiStepProblem(*parts, n_leads=n_leads, first=rows_covering(self.warmup, step))

    def _minima(self, problem: PredictionErrorProblem, begin: Mapping[str, float] | None) -> list[Minimum]:
        if not problem.searched:
            loss = float(np.sum(problem.residuals(np.zeros(0)) ** 2))
            return [Minimum(np.zeros(0), loss, 1, True)]
        starts = random_starts(problem.searched, self.n_starts, check_random_state(self.random_state))
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
        if one_step.weighted:  # the residuals are larger than errors that no missing row precedes
            self.noise_std_ /= float(np.sqrt(one_step.mean_variance(best.free)))
        return self._make_filter(problem)

    def _make_filter(self, problem: PredictionErrorProblem) -> GainFilter:
        network, experiment = problem.network, problem.experiment
        d = network.discrete(self._theta, experiment.roles, experiment.hours)
        R = self._measurement_variance(experiment.hours)
        plain = GainFilter(network, d.A, d.B, 1.0, walk_noise(network, 0.0, 0.0), R)
        return replace(plain, Q=walk_noise(network, *self._walk(plain, experiment)))

    def _measurement_variance(self, hours: float) -> float:
        return measurement_variance(hours)

    def _walk(self, kalman: GainFilter, experiment: Experiment) -> tuple[float, float]:
        return fit_walk_noise(kalman, experiment)


@shared_docs
class GrayBoxRC(LeastSquaresIdentifier):
    """Conventional gray box: simulation errors, no disturbance (CONV, paper 2.2.1).

    A Kalman filter over the first day sets the state, then the network is simulated; the sum of squared simulation
    errors is minimised within bounds from many random starts.  Missing measurements are left out of the sum.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        Empty: there is no disturbance model.
    loss_ : float
        Sum of squared errors [K2].
    noise_std_ : float
        Standard deviation of the errors [K].
    %(fitted)s

    Examples
    --------
    >>> from skhybrid import GrayBoxRC
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=4, random_state=0)
    >>> model = GrayBoxRC(known=office.theta).fit(office.X, office.y)
    >>> float(model.theta_["C_za"])
    1.0
    """

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> Conventional:
        return Conventional(rows_covering(self.warmup, pd.Timedelta(hours=experiment.hours)))

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return simulation_errors(self.filtered_network_, table, self.warmup, self.noise_std_)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The state from a Kalman filter over the last warm-up before each origin; no disturbance."""
        known, span = self.filtered_network_, rows_covering(self.warmup, table.step)
        kalman, experiment = known.kalman, known.experiment(table)
        free_run, size = known.open_loop(experiment, known.open_start(table)), (len(origins), n)
        plain = without_disturbance(kalman, experiment.hours)
        states = [_state_at(plain, experiment, free_run, int(origin), span) for origin in origins]
        nothing = np.zeros((*size, kalman.n_gains)), np.zeros((*size, len(kalman.measured)))
        return ForecastStart(np.array(states), *nothing)


def _state_at(plain: GainFilter, experiment: Experiment, free_run: np.ndarray, origin: int, span: int) -> np.ndarray:
    """Filtered over the warm-up before the origin; simulated where nothing was measured in it."""
    first = max(0, origin + 1 - span)
    last = experiment.rows(slice(first, origin + 1))
    if not np.isfinite(last.y).any():
        return free_run[origin]
    begin = plain.cold(last.firsts)
    if first == 0:
        begin = begin._replace(mean=np.append(free_run[0], np.zeros(plain.n_gains)))
    return plain.run(last, begin).nodes[-1]


@shared_docs
class InputDisturbanceID(LeastSquaresIdentifier):
    """Identification with the unmeasured heat as a random-walk state (ID, paper 2.2.2).

    A Kalman filter carries the disturbance ``zeta`` [kW] on the disturbed node; the sum of squared one-step errors is
    minimised over the network's parameters and the two noise levels.  Where measurements are missing, each error is
    weighted by what the missing rows add to its variance.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    measurement_sd : float, optional
        Standard deviation of the thermometer [K]; default ``0.25 / sqrt(T_s)`` with ``T_s`` in seconds, as the paper.
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        ``sigma_x`` [K] and ``sigma_zeta`` [kW] over a step.
    %(weighted_loss)s
    %(fitted)s
    """

    measurement_sd: Any

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        measurement_sd=None, objective="one_step",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> InputRandomWalk:
        return InputRandomWalk(self.measurement_sd)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return InputRandomWalk().own

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return scaled_innovations(self.filtered_network_, table, segment, self.noise_std_)

    def _measurement_variance(self, hours: float) -> float:
        return self.measurement_sd**2 if self.measurement_sd else measurement_variance(hours)

    def _walk(self, kalman: GainFilter, experiment: Experiment) -> tuple[float, float]:
        return float(self.disturbance_["sigma_x"]), float(self.disturbance_["sigma_zeta"])


@shared_docs
class OutputDisturbanceID(LeastSquaresIdentifier):
    """Identification with an ARMA(1,1) disturbance on the output (OD, paper 2.2.3).

    The network runs open loop; what the unmeasured heat does to the temperature is filtered white noise.  The predictor
    is the innovations form of Eq. od_dis, ``y_hat(k+1|k) = C x(k+1) + zeta(k+1)``, and the sum of its squared errors is
    minimised.  Where measurements are missing, errors are weighted by their variance, which is larger after a gap, and
    the gain of the predictor follows it: the sum is then the likelihood, its noise level at the optimum.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    rho_box : {"stable", "paper"}, default="stable"
        Search ``(rho_1, rho_1 - rho_2)``, each within (-0.999, 0.999), where the predictor is stable (``rho_1`` at 15
        minutes; its bound is the same memory at any step); or the paper's box for ``(rho_1, rho_2)``, which also holds
        unstable predictors.
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        ``rho_1``, ``rho_2`` [-] and the hidden nodes' first temperatures [degC].
    %(weighted_loss)s
    %(fitted)s
    """

    rho_box: Any

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        rho_box="stable", objective="one_step",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> OutputARMA:
        if self.rho_box not in ("stable", "paper"):
            raise ValueError(f"rho_box={self.rho_box!r} is neither 'stable' nor 'paper'.")
        hidden = tuple(node for node in network.nodes if node not in network.measured_nodes)
        firsts = tuple(segment.first for segment in experiment.segments)
        return OutputARMA(hidden, firsts, self.rho_box == "paper", experiment.hours)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return OutputARMA((), (), self.rho_box == "paper").own

    def _store(self, found: SearchResult) -> GainFilter:
        kalman = super()._store(found)
        own = self.disturbance_
        if "rho_2" not in own:
            self.disturbance_ = pd.concat([own, pd.Series({"rho_2": own["rho_1"] - own["rho_gap"]})])
        return kalman

    def _first_state(self, smooth: Any, number: int) -> np.ndarray:
        """The fit's own first state: a measured node at its measurement, the hidden ones as they were searched."""
        state = smooth.nodes[0].copy()
        take_searched(state, self.network_, self.disturbance_, number)
        return state

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return arma_innovations(self.filtered_network_, table, segment, dict(self.disturbance_), self.noise_std_)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The network open loop, and the output disturbance that decays by ``rho_1``."""
        known = self.filtered_network_
        experiment, kalman = known.experiment(table), known.kalman
        rho_1, rho_2 = float(self.disturbance_["rho_1"]), float(self.disturbance_["rho_2"])
        states = known.open_loop(experiment, known.open_start(table))
        free = experiment.outputs - states[:-1, kalman.measured]
        zeta = arma_prediction(free, rho_1, rho_2).states
        offset = zeta[origins + 1][:, None] * (rho_1 ** np.arange(n))[:, None]
        return ForecastStart(states[origins], np.zeros((len(origins), n, kalman.n_gains)), offset)
