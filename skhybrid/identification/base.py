"""What the four identifications share: reading tables, tracking, forecasting, disturbances, loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_is_fitted

from .._table import HISTORY_ROLES, ZoneTable, read_table, read_targets
from .._threads import one_blas_thread
from .._time import rows_covering
from .._transaction import unchanged_on_failure
from ..control import make_plant
from ..filtering import simulate_path
from ..thermal import Parameter, RCNetwork, get_network
from .disturbance_models import measured_rows
from .experiment import Experiment, make_experiment
from .filtered_network import FilteredNetwork, checked_kind
from .fitting.excitation import unexcited, warn_scale
from .fitting.gauss_newton import Minimum
from .gain_filter import FilteredStates, FilterStart
from .loads import LoadMixin
from .uncertainty.standard_errors import UncertaintyMixin


@dataclass(frozen=True)
class StateSpace:
    """Discrete state-space model ``x[k+1] = A x[k] + B v[k]``, ``y[k] = C x[k] + D v[k]``.

    Attributes
    ----------
    A, B, C, D : ndarray
        Of shape (n, n), (n, m), (o, n) and (o, m), with one output row a measured node.
    state_names, input_names : tuple of str
        Units are those of the data contract; the last inputs are the heat gains [kW] of the disturbed nodes.
    sampling_time : Timedelta
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    sampling_time: pd.Timedelta


def state_space_of(
    network: RCNetwork, theta: Mapping[str, float], roles: tuple[str, ...], step: pd.Timedelta
) -> StateSpace:
    """The exact zero-order hold of a network under the given inputs, with named rows and columns."""
    d = network.discrete(theta, roles, step / pd.Timedelta("1h"))
    C = np.eye(len(network.nodes))[measured_rows(network)]
    names = (*network.inputs(roles), *network.gain_names)
    return StateSpace(d.A, d.B, C, np.zeros((len(C), len(names))), network.states, names, step)


class NetworkIdentifier(UncertaintyMixin, LoadMixin, TransformerMixin, FilteredNetwork):
    """Base of the identifications; a subclass gives ``_identify`` and may give ``_forecast_start``."""

    sampling_time_: pd.Timedelta
    #: parameters that the search begins at, where another fit has found them
    _begin: Mapping[str, float] | None = None

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
    ):
        self.network = network
        self.known = known
        self.bounds = bounds
        self.n_starts = n_starts
        self.horizon = horizon
        self.warmup = warmup
        self.columns = columns
        self.sampling_time = sampling_time
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose
        self.origin_step = origin_step
        self.max_missing = max_missing
        self.priors = priors

    # --------------------------------------------------------------------------------------------------------- fit
    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> NetworkIdentifier:
        """Identify the network.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows by the data contract: ``T_oa`` [degC], ``q_sol`` [kW/m2], stages ``u_*`` [-] and measured heat ``Q_*``
            [kW].  Consecutive, or in segments with gaps of three hours or more between them: those are one
            experiment, and each has an initial state of its own.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.  A column a measured node, in the network's order,
            where it has several.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If a role is missing, the rows are not evenly spaced, an input has NaN, or a setting names no parameter.
        """
        network, table, experiment, parameters = self._prepare(X, y)
        self._identify(network, table, experiment, parameters)
        self.sampling_time_ = table.step
        self.state_space_ = state_space_of(network, self._theta, experiment.roles, table.step)
        self._finish(table, experiment)
        return self

    def _prepare(self, X: Any, y: Any) -> tuple[RCNetwork, ZoneTable, Experiment, tuple[Parameter, ...]]:
        """Read and check what ``fit`` is given."""
        network = get_network(self.network)
        if not isinstance(self.n_starts, int | np.integer) or self.n_starts < 1:
            raise ValueError(f"n_starts={self.n_starts!r} is not a whole number from 1.")
        table = self._read(X, network, reset=True)
        target = read_targets(y, table, network.history_roles, max_missing=self.max_missing)
        self._check_spans(table.step)
        parameters = self._bounded_parameters(network, table)
        experiment = make_experiment(network, tuple(sorted(table.inputs)), table, target)
        return network, table, experiment, parameters

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
        )
        absent = [b for b in network.boundaries if b not in table.inputs]
        if absent:
            raise ValueError(f"role {absent[0]!r} is missing: network {network.name} needs this boundary temperature.")
        return table

    def _read_X(self, X: Any) -> ZoneTable:
        return self._read(X, self.network_, reset=False)

    def _bounded_parameters(self, network: RCNetwork, table: ZoneTable) -> tuple[Parameter, ...]:
        known, bounds = dict(self.known or {}), dict(self.bounds or {})
        parameters = self._widened(network.parameters(table.inputs))
        names = [p.name for p in parameters] + [p.name for p in self._own_parameters()]
        for setting, given in (("known", known), ("bounds", bounds)):
            for name in given:
                if name not in names and name not in {p.name for p in network.parameters()}:
                    raise ValueError(f"{setting}= names {name!r}, but the parameters are {', '.join(names)}.")
        out = tuple(p.bounded(bounds.get(p.name)) for p in parameters)
        for p in out:
            value = known.get(p.name)
            if value is None:
                continue
            if not isinstance(value, int | float | np.number) or not np.isfinite(value):
                raise ValueError(f"known= gives {p.name} the value {value!r}; it must be a number [{p.unit}].")
            if p.transform == "log" and value * p.sign <= 0:
                raise ValueError(f"known= gives {p.name} the value {value}; it must be {'<' if p.sign < 0 else '>'} 0.")
            if p.unit == "-" and value > 1:
                raise ValueError(f"known= gives {p.name} the value {value}; it is a share, at most 1.")
        return out

    def _widened(self, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
        return parameters

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return ()

    def _identify(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> None:
        problem, idle = self._make_problem(network, table, experiment, parameters)
        minima = self._minima(problem)
        self._store(problem, min(minima, key=lambda m: m.loss), minima, parameters, idle)

    def _excited(
        self, network: RCNetwork, table: ZoneTable, parameters: tuple[Parameter, ...], priors: Mapping[str, Any]
    ) -> dict[str, float]:
        """Values of the parameters that no row moves; with warnings of what the table cannot tell."""
        name, known = type(self).__name__, dict(self.known or {})
        if any(p.name not in known for p in parameters):
            warn_scale(network, table, {*known, *priors}, name)
        idle = unexcited(network, table, known, name)
        return {
            p.name: p.from_free(priors[p.name][0]) if p.name in priors else p.default
            for p in parameters
            if p.name in idle
        }

    def _make_problem(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> tuple[Any, tuple[str, ...]]:
        """The optimisation problem, and the parameters that no row moves."""
        raise NotImplementedError

    def _minima(self, problem: Any) -> list[Minimum]:
        raise NotImplementedError

    def _from_known(self, searched: tuple[Parameter, ...], starts: np.ndarray) -> np.ndarray:
        """The starts, or the one start at what is known."""
        if self._begin is None:
            return starts
        known = [
            p.to_free(self._begin[p.name]) if p.name in self._begin else starts[0, i] for i, p in enumerate(searched)
        ]
        return np.clip([known], *np.array([p.free_bounds for p in searched]).T)

    def _store(self, problem: Any, best: Minimum, minima: list[Minimum], parameters: Any, idle: Any) -> None:
        raise NotImplementedError

    def _finish(self, table: ZoneTable, experiment: Experiment) -> None:
        """Keep the end of the training table and what was known at its first row."""
        segments, last = table.segments, len(table.segments) - 1
        self._train_start = self._segment_start(segments[0], experiment.segments[0], 0)
        self._train_first = None if table.utc is None else table.utc[0]
        self.initial_state_ = self._train_start.mean[: self._filter.n].copy()
        begin = self._segment_start(segments[last], experiment.segments[last], last) if last else self._train_start
        self._keep_tail(segments[last], experiment.segments[last], begin)
        self._mean = float(np.nanmean(experiment.y)) if np.isfinite(experiment.y).any() else 20.0
        self._plant = make_plant(self._capacities(table), table.inputs)

    def _segment_start(self, segment: ZoneTable, experiment: Experiment, number: int) -> FilterStart:
        """What the fit knows of the first row of a segment of the training table."""
        tracker, cells = self._filter, self._cells(segment)
        cold = tracker.cold(experiment.firsts)
        smooth = tracker.track(experiment, cells, self._classes(segment), cold, smooth=True)
        nodes = self._first_state(smooth, number)
        return FilterStart(np.append(nodes, smooth.gain[0] - tracker.profile[cells[0]]), cold.covariance)

    def _keep_tail(self, segment: ZoneTable, experiment: Experiment, begin: FilterStart) -> None:
        causal = self._filter.track(experiment, self._cells(segment), self._classes(segment), begin)
        keep = min(segment.n_rows, rows_covering(self.warmup, segment.step))
        tail = segment.rows(slice(segment.n_rows - keep, None))
        measured = zip(self.network_.history_roles, experiment.outputs[-keep:].T, strict=True)
        history = {**tail.history, **{role: column.copy() for role, column in measured}}
        self._tail = tail.replace(history=history, inputs={k: v.copy() for k, v in tail.inputs.items()})
        means, covariances = causal.starts
        self._tail_start = FilterStart(means[-keep].copy(), covariances[-keep].copy())
        free_run = self._open_loop(experiment, begin.mean[: self._filter.n])
        self._tail_open = free_run[-keep - 1].copy()  # the last row of the run lies one step behind the table

    def _capacities(self, table: ZoneTable) -> dict[str, float]:
        """Heat of every stage at 1 [kW]."""
        sources = self.network_.sources(table.inputs)
        return {s.role: self._theta[s.parameter] for s in sources if s.role.startswith("u_") and s.parameter}

    @property
    def _theta(self) -> dict[str, float]:
        return {p.name: float(self.theta_[p.name]) for p in self.parameters_}

    def _first_state(self, smooth: FilteredStates, number: int) -> np.ndarray:
        """(n,) node temperatures at the first row of a segment."""
        return smooth.nodes[0].copy()

    # -------------------------------------------------------------------------------------------------- simulation
    def simulate(self, X: Any, heat_gain: Any = None, initial_state: Any = None) -> np.ndarray:
        """Simulate the temperature from the inputs alone.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        heat_gain : array-like of shape (n_samples,), optional
            Unmeasured heat on the disturbed node [kW], a column each where there are several; 0 by default.
        initial_state : array-like of shape (n_states,), optional
            Node temperatures at the first row [degC], in the order of ``network_.nodes``.  By default the fitted
            initial state where X begins as the training table did, the tracked state where X follows it, else all
            nodes at the first ``T_za`` (or the training mean).

        Returns
        -------
        ndarray of shape (n_samples,)
            Temperature of the measured node at every row [degC], a column each where several are measured; the first
            is that of the initial state.

        Raises
        ------
        ValueError
            If ``heat_gain`` or ``initial_state`` has another length or a NaN, or ``heat_gain`` other stamps.
        """
        check_is_fitted(self)
        states = self.simulate_states(X, heat_gain, initial_state).to_numpy(copy=True)
        rows = self._filter.measured
        return states[:, rows[0]].copy() if len(rows) == 1 else states[:, rows]

    def simulate_states(self, X: Any, heat_gain: Any = None, initial_state: Any = None) -> pd.DataFrame:
        """Simulate every node, as :meth:`simulate` does the measured one.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        heat_gain : array-like of shape (n_samples,), optional
            Unmeasured heat on the disturbed node [kW], a column each where there are several.
        initial_state : array-like of shape (n_states,), optional
            Node temperatures at the first row [degC].

        Returns
        -------
        DataFrame of shape (n_samples, n_states)
            Columns ``T_<node>`` [degC].
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        here = table.rows(slice(n_tail, None))
        n, tracker = here.n_rows, self._filter
        stamps = getattr(heat_gain, "index", None)
        if isinstance(stamps, pd.DatetimeIndex) and here.utc is not None and not stamps.equals(here.index):
            raise ValueError("heat_gain bears other time stamps than X; align it with heat_gain.reindex(X.index).")
        d = tracker.n_gains
        heat = np.zeros((n, d)) if heat_gain is None else np.asarray(heat_gain, dtype=np.float64)
        heat = heat.reshape(-1, 1) if d == 1 else heat
        if heat.shape != (n, d):
            each = f" for each of {', '.join(self.network_.disturbed_nodes)}" if d > 1 else ""
            raise ValueError(f"heat_gain has {len(heat)} values, but X has {n} rows; give one [kW] a row{each}.")
        if initial_state is None:
            state = self._default_state(table, n_tail)
        else:
            state = np.asarray(initial_state, dtype=np.float64).reshape(-1)
        if state.shape != (tracker.n,):
            raise ValueError(f"initial_state has {len(state)} values, but the states are {self.network_.states}.")
        for name, values in (("heat_gain", heat), ("initial_state", state)):
            if not np.isfinite(values).all():
                raise ValueError(f"{name} contains NaN or inf at place {int(np.argmin(np.isfinite(values)))}; fill it.")
        path = simulate_path(tracker.A, self._experiment(here).inputs @ tracker.B.T + heat @ tracker.heat.T, state)
        return pd.DataFrame(path[:n], index=here.index, columns=list(self.network_.states))

    def _default_state(self, table: ZoneTable, n_tail: int) -> np.ndarray:
        if n_tail:
            past = table.rows(slice(0, n_tail))
            return self._track(past).end.mean[: self._filter.n]
        return self._start(table).mean[: self._filter.n]

    # ------------------------------------------------------------------------------------------------ disturbances
    def estimate_disturbance(self, X: Any, kind: str = "input", smooth: bool = False) -> Any:
        """Estimate what is not measured, from the measured temperature.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            With the measured temperature as column ``T_za``.
        kind : {"input", "output"}
            ``"input"``: heat on the disturbed node [kW] (paper Eq. ID_filter); ``"output"``: what the measured
            temperature has beyond the simulated one [K] (paper Eq. od_pred).
        smooth : bool
            False: from rows up to each row, as a forecast may use it; True: from all rows.  An output disturbance is
            the same either way.

        Returns
        -------
        Series of length n_samples, named ``zeta``
            A DataFrame with a column ``zeta_<node>`` each where a network has several disturbed (measured) nodes.

        Raises
        ------
        ValueError
            If X has no ``T_za``.
        """
        check_is_fitted(self)
        table = self._read_X(X)
        for role in self.network_.history_roles:
            if role not in table.history:
                raise ValueError(f"role {role!r} is missing: a disturbance is estimated from the measured temperature.")
        names = self._zeta_names(kind)
        frame = pd.DataFrame(self._zeta(table, kind, smooth), index=table.index, columns=names)
        return frame[names[0]] if len(names) == 1 else frame

    def _zeta_names(self, kind: str = "input") -> list[str]:
        nodes = self.network_.disturbed_nodes if kind == "input" else self.network_.measured_nodes
        return ["zeta"] if len(nodes) == 1 else [f"zeta_{node}" for node in nodes]

    def _zeta(self, table: ZoneTable, kind: str, smooth: bool = False) -> np.ndarray:
        """(N, d) disturbance of every row, each segment behind the training table's end or from a cold start."""
        parts = []
        for segment in table.segments:
            whole, n_tail = self._after_tail(segment)
            if checked_kind(kind) == "input":
                parts.append(self._track(whole, smooth).gain[n_tail:])
                continue
            experiment = self._experiment(whole)
            path = self._open_loop(experiment, self._open_start(whole))[:-1, self._filter.measured]
            parts.append((experiment.outputs - path)[n_tail:])
        return np.concatenate(parts)

    def transform(self, X: Any) -> Any:
        """X with the causal input disturbance ``zeta`` [kW] as a further column (of each disturbed node).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Without ``T_za`` the disturbance is what the model expects without measurements.

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features + 1)
        """
        check_is_fitted(self)
        zeta = self._zeta(self._read_X(X), "input")
        if isinstance(X, pd.DataFrame):
            return X.assign(**dict(zip(self._zeta_names(), zeta.T, strict=True)))
        return np.column_stack([np.asarray(X, dtype=np.float64), zeta])

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Names of the columns that :meth:`transform` returns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of X's columns where it had none in ``fit``.

        Returns
        -------
        ndarray of str

        Raises
        ------
        ValueError
            If ``input_features`` are not the columns that ``fit`` saw.
        """
        check_is_fitted(self)
        names = getattr(self, "feature_names_in_", None)
        if input_features is not None:
            if names is not None and list(input_features) != list(names):
                raise ValueError("input_features is not equal to feature_names_in_, the columns that fit saw.")
            if len(input_features) != self.n_features_in_:
                raise ValueError(
                    f"input_features should have length equal to number of features ({self.n_features_in_}), "
                    f"got {len(input_features)}."
                )
            names = input_features
        if names is None:
            names = [f"x{j}" for j in range(self.n_features_in_)]
        return np.array([*names, *self._zeta_names()], dtype=object)

    # ------------------------------------------------------------------------------------------------------- others
    def to_state_space(self) -> StateSpace:
        """The identified model as discrete state-space matrices.

        Returns
        -------
        StateSpace
            With named states and inputs, at the training's sampling time.
        """
        check_is_fitted(self)
        return self.state_space_
