"""The three published identifications: CONV, ID and OD, least squares of prediction errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_covering
from ..thermal import Parameter, RCNetwork
from .disturbance_models import (
    Conventional,
    InputRandomWalk,
    OutputARMA,
    measurement_variance,
    take_searched,
)
from .experiment import Experiment
from .filtered_network import ForecastStart
from .fitting.prediction_errors import PredictionErrorProblem
from .gain_filter import GainFilter, without_disturbance
from .least_squares import LeastSquaresIdentifier
from .one_step_errors import (
    Innovations,
    arma_innovations,
    arma_prediction,
    scaled_innovations,
    simulation_errors,
)


class GrayBoxRC(LeastSquaresIdentifier):
    """Conventional gray box: simulation errors, no disturbance (CONV, paper 2.2.1).

    A Kalman filter over the first day sets the state, then the network is simulated; the sum of squared simulation
    errors is minimised within bounds from many random starts.  Missing measurements are left out of the sum.

    Parameters
    ----------
    network : str or RCNetwork, default="2R2C"
        A name of the catalogue, or a network of your own.
    known : dict of parameter to value, optional
        Parameters that are not searched, such as a nameplate capacity ``{"Q_h": 6.0}`` [kW].
    bounds : dict of parameter to (lower, upper), optional
        Overrides the paper's bounds.
    n_starts : int, default=50
        Random starts, log-uniform within the bounds.
    horizon : timedelta-like, optional
        How far ahead ``predict`` looks; None simulates from the first row on.
    warmup : timedelta-like, default="1D"
        Span over which the filter sets the state.
    columns : dict of role to column, optional
        Columns whose names are not their roles.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; 15 minutes by default.
    n_jobs : int, optional
        Starts run in parallel.
    random_state : int, RandomState or None
        Of the starts; the result is the same under any ``n_jobs``.
    verbose : int, default=0
        1 shows a progress bar.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.
    priors : dict of parameter to prior, optional
        What is known of a parameter before the data: ``(median, factor)`` is log-normal with 90 % of it between
        ``median / factor`` and ``median * factor``; a frozen ``scipy.stats.lognorm`` (``norm`` for a parameter of
        either sign) does as well.  The fit is then the maximum of the posterior.
    objective : {"one_step", "multi_step"}, default="one_step"
        Which errors are squared: those of the simulation (of CONV there is no other step), or those
        of forecasts at leads up to ``horizon`` (one day where that is None), made every hour behind the warm-up.
        "multi_step" is for forecasts, "one_step" for the parameters of the building; see :ref:`two_objectives`.

    Attributes
    ----------
    theta_, theta_std_ : Series
        Parameters and their standard errors, from the Hessian or the days, whichever is larger.
    theta_cov_ : DataFrame
        Covariance of the parameters; see :meth:`theta_interval`.
    disturbance_ : Series
        The disturbance model's own parameters.
    n_days_ : int
        Days behind the standard errors.
    identifiability_ : Identifiability
        Flat and weak directions, parameters at a bound, parameters that nothing moved.
    loss_ : float
        Sum of squared errors [K2].
    noise_std_ : float
        Standard deviation of the errors [K].
    starts_ : DataFrame
        One row a start.
    state_space_ : StateSpace
    initial_state_ : ndarray of shape (n_states,)
        Node temperatures at the first training row [degC].
    sampling_time_ : Timedelta
    network_ : RCNetwork

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
        return simulation_errors(self, table)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The state from a Kalman filter over the last warm-up before each origin; no disturbance."""
        span, tracker = rows_covering(self.warmup, table.step), self._filter
        experiment, start = self._experiment(table), self._open_start(table)
        plain = without_disturbance(tracker, experiment.hours)
        free_run = self._open_loop(experiment, start)
        states = np.array([self._state_at(experiment, plain, free_run, int(o), span) for o in origins])
        size = (len(origins), n)
        return ForecastStart(states, np.zeros((*size, tracker.n_gains)), np.zeros((*size, len(tracker.measured))))

    def _state_at(
        self, experiment: Experiment, plain: GainFilter, free_run: np.ndarray, origin: int, span: int
    ) -> np.ndarray:
        """Filtered over the warm-up before the origin; simulated where nothing was measured in it."""
        first = max(0, origin + 1 - span)
        rows = slice(first, origin + 1)
        last = experiment.rows(rows)
        if not np.isfinite(last.y).any():
            return free_run[origin]
        begin = plain.cold(last.firsts)
        if first == 0:
            begin = begin._replace(mean=np.append(free_run[0], np.zeros(plain.n_gains)))
        zeros = np.zeros(len(last.y), np.int64)
        return plain.track(last, zeros, zeros, begin).nodes[-1]


class InputDisturbanceID(LeastSquaresIdentifier):
    """Identification with the unmeasured heat as a random-walk state (ID, paper 2.2.2).

    A Kalman filter carries the disturbance ``zeta`` [kW] on the disturbed node; the sum of squared one-step errors is
    minimised over the network's parameters and the two noise levels.  Where measurements are missing the errors count
    by what the missing rows add to their variance.

    Parameters
    ----------
    network : str or RCNetwork, default="2R2C"
        A name of the catalogue, or a network of your own.
    known : dict of parameter to value, optional
        Parameters that are not searched; also ``sigma_x`` [K] and ``sigma_zeta`` [kW].
    bounds : dict of parameter to (lower, upper), optional
        Overrides the paper's bounds.
    n_starts : int, default=50
        Random starts, log-uniform within the bounds.
    horizon : timedelta-like, optional
        How far ahead ``predict`` looks; None simulates from the first row on.
    warmup : timedelta-like, default="1D"
        How much of the training table's end is kept as history.
    columns : dict of role to column, optional
        Columns whose names are not their roles.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; 15 minutes by default.
    n_jobs : int, optional
        Starts run in parallel.
    random_state : int, RandomState or None
        Of the starts; the result is the same under any ``n_jobs``.
    verbose : int, default=0
        1 shows a progress bar.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.
    priors : dict of parameter to prior, optional
        What is known of a parameter before the data: ``(median, factor)`` is log-normal with 90 % of it between
        ``median / factor`` and ``median * factor``; a frozen ``scipy.stats.lognorm`` (``norm`` for a parameter of
        either sign) does as well.  The fit is then the maximum of the posterior.
    measurement_sd : float, optional
        Standard deviation of the thermometer [K]; default ``0.25 / sqrt(T_s)`` with ``T_s`` in seconds, as the paper.
    objective : {"one_step", "multi_step"}, default="one_step"
        Which errors are squared: those of the next row, or those
        of forecasts at leads up to ``horizon`` (one day where that is None), made every hour behind the warm-up.
        "multi_step" is for forecasts, "one_step" for the parameters of the building; see :ref:`two_objectives`.

    Attributes
    ----------
    theta_, theta_std_ : Series
        Parameters and their standard errors, from the Hessian or the days, whichever is larger.
    theta_cov_ : DataFrame
        Covariance of the parameters; see :meth:`theta_interval`.
    disturbance_ : Series
        ``sigma_x`` [K] and ``sigma_zeta`` [kW] over a step.
    n_days_ : int
        Days behind the standard errors.
    identifiability_ : Identifiability
        Flat and weak directions, parameters at a bound, parameters that nothing moved.
    loss_, noise_std_ : float
        Sum of squared errors [K2], weighted where measurements are missing, and the standard deviation of an error
        that no missing row precedes [K].
    starts_ : DataFrame
        One row a start.
    state_space_ : StateSpace
    initial_state_ : ndarray of shape (n_states,)
        Node temperatures at the first training row [degC].
    sampling_time_ : Timedelta
    network_ : RCNetwork
    """

    def __init__(
        self,
        network="2R2C",
        *,
        known=None,
        bounds=None,
        n_starts=50,
        horizon=None,
        warmup="1D",
        columns=None,
        sampling_time=None,
        n_jobs=None,
        random_state=None,
        verbose=0,
        origin_step=None,
        max_missing=0.5,
        priors=None,
        measurement_sd=None,
        objective="one_step",
    ):
        super().__init__(
            network,
            known=known,
            bounds=bounds,
            n_starts=n_starts,
            horizon=horizon,
            warmup=warmup,
            columns=columns,
            sampling_time=sampling_time,
            n_jobs=n_jobs,
            random_state=random_state,
            verbose=verbose,
            origin_step=origin_step,
            max_missing=max_missing,
            priors=priors,
            objective=objective,
        )
        self.measurement_sd = measurement_sd

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> InputRandomWalk:
        return InputRandomWalk(self.measurement_sd)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return InputRandomWalk().own

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return scaled_innovations(self, table, segment)

    def _measurement_variance(self, hours: float) -> float:
        return self.measurement_sd**2 if self.measurement_sd else measurement_variance(hours)

    def _walk(self, tracker: GainFilter, experiment: Experiment) -> tuple[float, float]:
        return float(self.disturbance_["sigma_x"]), float(self.disturbance_["sigma_zeta"])


class OutputDisturbanceID(LeastSquaresIdentifier):
    """Identification with an ARMA(1,1) disturbance on the output (OD, paper 2.2.3).

    The network runs open loop; what the unmeasured heat does to the temperature is filtered white noise.  The predictor
    is the innovations form of Eq. od_dis, ``y_hat(k+1|k) = C x(k+1) + zeta(k+1)``, and the sum of its squared errors is
    minimised.  Where measurements are missing the errors count by their variance, which is larger behind a gap, and the
    gain of the predictor follows it: the sum is then the likelihood, its noise level at the optimum.

    Parameters
    ----------
    network : str or RCNetwork, default="2R2C"
        A name of the catalogue, or a network of your own.
    known : dict of parameter to value, optional
        Parameters that are not searched.
    bounds : dict of parameter to (lower, upper), optional
        Overrides the paper's bounds.
    n_starts : int, default=50
        Random starts, log-uniform within the bounds.
    horizon : timedelta-like, optional
        How far ahead ``predict`` looks; None simulates from the first row on.
    warmup : timedelta-like, default="1D"
        How much of the training table's end is kept as history.
    columns : dict of role to column, optional
        Columns whose names are not their roles.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; 15 minutes by default.
    n_jobs : int, optional
        Starts run in parallel.
    random_state : int, RandomState or None
        Of the starts; the result is the same under any ``n_jobs``.
    verbose : int, default=0
        1 shows a progress bar.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.
    priors : dict of parameter to prior, optional
        What is known of a parameter before the data: ``(median, factor)`` is log-normal with 90 % of it between
        ``median / factor`` and ``median * factor``; a frozen ``scipy.stats.lognorm`` (``norm`` for a parameter of
        either sign) does as well.  The fit is then the maximum of the posterior.
    rho_box : {"stable", "paper"}, default="stable"
        Search ``(rho_1, rho_1 - rho_2)``, each within (-0.999, 0.999), where the predictor is stable (``rho_1`` at 15
        minutes; its bound is the same memory at any step); or the paper's box for ``(rho_1, rho_2)``, which also holds
        unstable predictors.
    objective : {"one_step", "multi_step"}, default="one_step"
        Which errors are squared: those of the next row, or those
        of forecasts at leads up to ``horizon`` (one day where that is None), made every hour behind the warm-up.
        "multi_step" is for forecasts, "one_step" for the parameters of the building; see :ref:`two_objectives`.

    Attributes
    ----------
    theta_, theta_std_ : Series
        Parameters and their standard errors, from the Hessian or the days, whichever is larger.
    theta_cov_ : DataFrame
        Covariance of the parameters; see :meth:`theta_interval`.
    disturbance_ : Series
        ``rho_1``, ``rho_2`` [-] and the hidden nodes' first temperatures [degC].
    n_days_ : int
        Days behind the standard errors.
    identifiability_ : Identifiability
        Flat and weak directions, parameters at a bound, parameters that nothing moved.
    loss_, noise_std_ : float
        Sum of squared errors [K2], weighted where measurements are missing, and the standard deviation of an error
        that no missing row precedes [K].
    starts_ : DataFrame
        One row a start.
    state_space_ : StateSpace
    initial_state_ : ndarray of shape (n_states,)
        Node temperatures at the first training row [degC].
    sampling_time_ : Timedelta
    network_ : RCNetwork
    """

    def __init__(
        self,
        network="2R2C",
        *,
        known=None,
        bounds=None,
        n_starts=50,
        horizon=None,
        warmup="1D",
        columns=None,
        sampling_time=None,
        n_jobs=None,
        random_state=None,
        verbose=0,
        origin_step=None,
        max_missing=0.5,
        priors=None,
        rho_box="stable",
        objective="one_step",
    ):
        super().__init__(
            network,
            known=known,
            bounds=bounds,
            n_starts=n_starts,
            horizon=horizon,
            warmup=warmup,
            columns=columns,
            sampling_time=sampling_time,
            n_jobs=n_jobs,
            random_state=random_state,
            verbose=verbose,
            origin_step=origin_step,
            max_missing=max_missing,
            priors=priors,
            objective=objective,
        )
        self.rho_box = rho_box

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> OutputARMA:
        if self.rho_box not in ("stable", "paper"):
            raise ValueError(f"rho_box={self.rho_box!r} is neither 'stable' nor 'paper'.")
        hidden = tuple(node for node in network.nodes if node not in network.measured_nodes)
        firsts = tuple(segment.first for segment in experiment.segments)
        return OutputARMA(hidden, firsts, self.rho_box == "paper", experiment.hours)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return OutputARMA((), (), self.rho_box == "paper").own

    def _store(self, problem: PredictionErrorProblem, *rest: Any) -> None:
        super()._store(problem, *rest)
        own = self.disturbance_
        if "rho_2" not in own:
            own = pd.concat([own, pd.Series({"rho_2": own["rho_1"] - own["rho_gap"]})])
        self.disturbance_ = own

    def _first_state(self, smooth: Any, number: int) -> np.ndarray:
        """The fit's own first state: a measured node at its measurement, the hidden ones as they were searched."""
        state = smooth.nodes[0].copy()
        take_searched(state, self.network_, self.disturbance_, number)
        return state

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return arma_innovations(self, table, segment)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The network open loop, and the output disturbance that decays by ``rho_1``."""
        experiment, tracker = self._experiment(table), self._filter
        rho_1, rho_2 = float(self.disturbance_["rho_1"]), float(self.disturbance_["rho_2"])
        states = self._open_loop(experiment, self._open_start(table))
        free = experiment.outputs - states[:-1, tracker.measured]
        zeta = arma_prediction(free, rho_1, rho_2).states
        offset = zeta[origins + 1][:, None] * (rho_1 ** np.arange(n))[:, None]
        return ForecastStart(states[origins], np.zeros((len(origins), n, tracker.n_gains)), offset)
