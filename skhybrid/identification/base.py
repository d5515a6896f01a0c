"""Base of the four identifications: reading a table, the search, and what a fit keeps."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._arguments import as_mapping, check_integer, check_n_jobs, check_verbose, random_numbers
from .._joining import from_first_measured
from .._summary import TrainingRecord, network_tables
from .._table import HISTORY_ROLES, ZoneTable, read_table
from .._threads import one_blas_thread
from .._time import rows_covering
from .._transaction import unchanged_on_failure
from .._warnings import warn_user
from ..exceptions import ExcitationWarning
from ..thermal import Parameter, RCNetwork, get_network
from ..thermal.declaration import excessive_shares
from ..thermal.parameters import check_known, known_values
from .experiment import Experiment, make_experiment, read_outputs
from .filtered_network import FirstState, filter_training
from .fitting.excitation import unexcited, warn_scale
from .fitting.gauss_newton import Minimum
from .fitting.starts import Minimise, check_start, search
from .forecast_ahead import ForecastingNetwork
from .gain_filter import FilteredStates, GainFilter
from .loads import plant_of
from .state_space import state_space_of
from .uncertainty.identifiability import find_directions
from .uncertainty.standard_errors import ParameterUncertainty, theta_covariance, theta_intervals


class SearchResult(NamedTuple):
    """Minima of a search, and the problem that it solved."""

    problem: Any
    best: Minimum
    minima: list[Minimum]  # of every start that was made
    table: ZoneTable
    parameters: tuple[Parameter, ...]  # the network's
    idle: tuple[str, ...]  # those that no row moves


class NetworkIdentifier(ForecastingNetwork):
    """Base of the identifications; a subclass defines the problem, minimises it and stores what it found."""

    _has_disturbance: ClassVar[bool] = True
    parameters_: tuple[Parameter, ...]
    theta_: pd.Series
    theta_std_: pd.Series
    noise_std_: float
    loss_: float

    def _make_problem(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> tuple[Any, tuple[str, ...]]:
        """The optimisation problem, and the parameters that no row moves."""
        raise NotImplementedError

    def _search(self, minimise: Minimise, starts: np.ndarray, drop: Any, **settings: Any) -> list[Minimum]:
        own = {"n_jobs": self.n_jobs, "verbose": self.verbose, "name": type(self).__name__}
        return search(minimise, starts, drop, **own, **settings)

    def _start_draws(self) -> np.random.RandomState:
        # without a seed always the same ones: searches from other starts stop at slightly different places
        return random_numbers(0 if self.random_state is None else self.random_state)

    def _minima(self, problem: Any, begin: Mapping[str, float] | None) -> list[Minimum]:
        """Minima from the random starts, or from the one start at ``begin``."""
        raise NotImplementedError

    def _store(self, found: SearchResult) -> GainFilter:
        """Set the fitted attributes; returns the Kalman filter of the identified network."""
        raise NotImplementedError

    def _widened(self, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
        """The network's parameters with the bounds that this identification searches by default."""
        return parameters

    def _own_parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the disturbance model."""
        return ()

    def _is_own(self, name: str) -> bool:
        """Whether ``disturbance_`` may have a name."""
        return name in {p.name for p in self._own_parameters()}

    def _first_state(self, smooth: FilteredStates, number: int) -> np.ndarray:
        """(n,) node temperatures at the first row of a segment of the training table."""
        return smooth.nodes[0].copy()

    def _begin_at(self, experiment: Experiment, kalman: GainFilter) -> None:
        """Take the first rows of another table in place of those that were searched."""

    def _problem_of(self, other: Any, *prepared: Any) -> Any:
        """The problem of a copy with ``other`` settings, whose loss compares with that of this fit."""
        return other._make_problem(*prepared)[0]

    def _reported(self, searched: pd.DataFrame) -> pd.DataFrame:
        """Searched values by column, in the units of the fitted attributes."""
        return searched

    def _searched_values(self) -> dict[str, float]:
        """Everything that the fit found, in the units of the search."""
        return {name: float(value) for name, value in {**self.theta_, **self.disturbance_}.items()}

    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any = None, theta_init: Mapping[str, float] | None = None) -> NetworkIdentifier:
        """Identify the network.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows by the data contract: ``T_oa`` [degC], ``q_sol`` [kW/m2], stages ``u_*`` [-] and measured heat ``Q_*``
            [kW]. Segments with gaps of three hours or more between them each have an initial state of their own.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.  One column per node where a network has several
            measured nodes: of a frame by name (``T_za_<zone>`` or ``<zone>``; ``T_<node>``), of an array in its order.
        theta_init : mapping of parameter to value, optional
            Values of an earlier fit: the only start, instead of ``n_starts`` random ones; other names are refused.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If a table, a setting or a start cannot be what it should be; the estimator is then what it was.

        Warns
        -----
        ScaleNotIdentifiableWarning, ExcitationWarning
            If nothing fixes the scale of the network, rows tell nothing of a parameter, or the shares found of one heat
            sum to more than 1.
        """
        network, table, experiment, parameters = self._prepare(X, y)
        problem, idle = self._make_problem(network, table, experiment, parameters)
        if theta_init is not None:
            names = {p.name for p in (*parameters, *problem.searched)} | set(self.known or {})
            check_start(theta_init, names, self._is_own)
        minima = self._minima(problem, theta_init)
        best = min(minima, key=lambda m: m.loss)
        kalman = self._store(SearchResult(problem, best, minima, table, parameters, idle))
        self._warn_shares(network)
        self.sampling_time_ = table.step
        self._warmup_rows = rows_covering(self.warmup, table.step)
        self.training_ = TrainingRecord.of(table)
        self.state_space_ = state_space_of(network, self._theta, experiment.roles, table.step)
        self._plant = plant_of(network, self._theta, table)
        self._know(kalman, table, experiment, self._first_state)
        return self

    def _warn_shares(self, network: RCNetwork) -> None:
        """Warn of shares that leave a negative remainder: each is bounded, their sum is not."""
        if excessive := excessive_shares(network, self._theta):
            total = self.theta_[[*excessive]].sum()
            warn_user(
                f"{type(self).__name__}: {', '.join(excessive)} sum to {total:.3g}, so that the remainder of the heat "
                "is negative; share the heat among fewer nodes, or give one share in known= or less in bounds=.",
                ExcitationWarning,
            )

    def _know(self, kalman: GainFilter, table: ZoneTable, experiment: Experiment, first_state: FirstState) -> None:
        """Take a table as the known rows, from which forecasts go on."""
        keep = self._rows_remembered(experiment.segments[-1].outputs)
        self.filtered_network_ = filter_training(kalman, table, experiment, first_state, keep)
        self.initial_state_ = self.filtered_network_.training_start.mean[: kalman.n].copy()

    def _prepare(self, X: Any, y: Any) -> tuple[RCNetwork, ZoneTable, Experiment, tuple[Parameter, ...]]:
        """Read and check what ``fit`` is given."""
        network = get_network(self.network)
        check_integer("n_starts", self.n_starts)
        check_n_jobs(self.n_jobs)
        check_verbose(self.verbose)
        settings = self._given()
        table = self._read(X, network, reset=True)
        target = read_outputs(y, table, network, max_missing=self.max_missing)
        table, target = from_first_measured(table, target)
        self._check_spans(table.step)
        rows_covering(self.warmup, table.step)  # refuses what is no duration before the search
        experiment = make_experiment(network, tuple(sorted(table.inputs)), table, target)
        return network, table, experiment, self._bounded_parameters(network, table, *settings)

    def _given(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """``known`` and ``bounds``; refuses those, and ``priors``, that are no mappings or contradict each other."""
        known = known_values(self.known)
        bounds = as_mapping("bounds", self.bounds, "parameters to (lower, upper), such as {'C_za': (0.1, 40.0)}")
        as_mapping("priors", self.priors, "parameters to distributions, such as {'R_zo': (5.0, 1.5)}")
        for name in bounds:
            if name in known:
                raise ValueError(f"bounds= and known= both name {name!r}; give one of them.")
        return known, bounds

    def _bounded_parameters(
        self, network: RCNetwork, table: ZoneTable, known: Mapping[str, Any], bounds: Mapping[str, Any]
    ) -> tuple[Parameter, ...]:
        """The network's parameters with the bounds that the user gave; refuses settings that name no parameter."""
        parameters = self._widened(network.parameters(table.inputs))
        own = self._own_parameters()
        names = [p.name for p in (*parameters, *own)]
        under_other_inputs = {p.name for p in network.parameters()}
        for setting, given in (("known", known), ("bounds", bounds)):
            for name in given:
                if name not in names and name not in under_other_inputs:
                    raise ValueError(f"{setting}= names {name!r}, but the parameters are {', '.join(names)}.")
        out = tuple(p.bounded(bounds.get(p.name)) for p in parameters)
        check_known((*out, *(p for p in own if p.transform == "log")), known)
        if excessive := excessive_shares(network, {p.name: known[p.name] for p in out if p.name in known}):
            total = sum(known[name] for name in excessive)
            raise ValueError(
                f"known= gives {', '.join(excessive)} the sum {total:g}; shares of one heat are at most 1."
            )
        return out

    def _read(self, X: Any, network: RCNetwork, *, reset: bool) -> ZoneTable:
        table = read_table(
            self,
            X,
            columns=self.columns,
            required=network.required_roles,
            needed=network.reads,
            sampling_time=self.sampling_time,
            reset=reset,
            min_rows=2 if reset else 1,
            expected_step=None if reset else self.sampling_time_,
            gaps=True,
            history_roles=(*HISTORY_ROLES, *network.history_roles),
            holidays=getattr(self, "holidays", None),
        )
        absent = [b for b in network.boundaries if b not in table.inputs]
        if absent:
            raise ValueError(f"role {absent[0]!r} is missing: network {network.name} needs this boundary temperature.")
        return table

    def _read_X(self, X: Any) -> ZoneTable:
        return self._read(X, self.network_, reset=False)

    def _excited(
        self, network: RCNetwork, table: ZoneTable, parameters: tuple[Parameter, ...], priors: Mapping[str, Any]
    ) -> dict[str, float]:
        """Values of the parameters that no row moves; warns of what the table cannot identify."""
        name, known = type(self).__name__, dict(self.known or {})
        if any(p.name not in known for p in parameters):
            warn_scale(network, table, {*known, *priors}, name)
        idle = unexcited(network, table, known, name, disturbed=self._has_disturbance)
        return {
            p.name: p.from_free(priors[p.name][0]) if p.name in priors else p.default
            for p in parameters
            if p.name in idle
        }

    def _facts(self) -> dict[str, str]:
        return {"network": self.network_.name, "noise": f"{self.noise_std_:.3g} K", "loss": f"{self.loss_:.6g}"}

    def _tables(self) -> dict[str, pd.DataFrame]:
        return network_tables(self)

    @property
    def _theta(self) -> dict[str, float]:
        return {p.name: float(self.theta_[p.name]) for p in self.parameters_}

    def _store_uncertainty(self, found: ParameterUncertainty, at_bound: tuple[str, ...], idle: tuple[str, ...]) -> None:
        names = [p.name for p in self.parameters_]
        self.theta_cov_ = theta_covariance(found, self.theta_, names, idle)
        variances = np.maximum(np.diag(self.theta_cov_), 0.0)  # rounding may leave one below zero
        self.theta_std_ = pd.Series(np.sqrt(variances), index=names, name="std")
        self.n_days_ = found.n_days
        self._growth = {p.name: float(growth) for p, growth in zip(found.parameters, found.growth, strict=True)}
        self.identifiability_ = find_directions(found, tuple(dict.fromkeys((*at_bound, *found.held))), idle)

    def theta_interval(self, level: float = 0.9) -> pd.DataFrame:
        """Intervals that hold each parameter with the given probability.

        Parameters
        ----------
        level : float, default=0.9
            Between 0 and 1, else ValueError.

        Returns
        -------
        DataFrame
            One row per parameter, columns ``lower`` and ``upper`` [its unit]: ``theta * exp(+- t * std / theta)`` where
            its logarithm is searched; t is Student's quantile with ``n_days_ - 1`` degrees of freedom.  A known
            parameter is its own interval; one that a bound holds has none, so that its ends are NaN.
        """
        check_is_fitted(self)
        return theta_intervals(self.parameters_, self.theta_, self.theta_std_, self.n_days_, level)

    @one_blas_thread
    def with_rows(self, X: Any, y: Any) -> Any:
        """A copy with the same parameters and plant whose forecasts continue another table.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            At the sampling time of ``fit``, else ValueError.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.

        Returns
        -------
        identification of the same class
        """
        check_is_fitted(self)
        table = self._read_X(X)
        target = read_outputs(y, table, self.network_, max_missing=self.max_missing)
        table, target = from_first_measured(table, target)
        experiment = make_experiment(self.network_, self.filtered_network_.roles, table, target)
        made, kalman = copy(self), self.filtered_network_.kalman
        made._begin_at(experiment, kalman)
        made._know(kalman, table, experiment, made._first_state)
        return made
