"""Base of the fitted identifications: simulations, forecasts, disturbances, innovations and loads of their network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, OneToOneFeatureMixin, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from .._arguments import check_bool
from .._ranges import check_range
from .._rolling import RollingForecastMixin, checked_origins
from .._table import ZoneTable, as_numbers, as_pandas, by_name, is_plant, listed
from .._threads import one_blas_thread
from .._time import refuse_other_stamps
from ..control import Plant
from ..filtering import simulate_path
from ..thermal import RCNetwork
from .disturbance_models import checked_kind
from .filtered_network import FilteredNetwork, ForecastStart
from .loads import network_load
from .one_step_errors import Innovations, kalman_innovations


class NetworkModel(TransformerMixin, RollingForecastMixin, BaseEstimator):
    """Methods of an identified network; the hooks are those of its Kalman filter where a subclass gives no others."""

    network_: RCNetwork
    filtered_network_: FilteredNetwork
    _plant: Plant
    _reads_clock = False

    @property
    def _tail(self) -> ZoneTable:  # type: ignore[override]
        return self.filtered_network_.rolling.tail

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The states at each origin, and the disturbance that the model expects over the next ``n`` rows."""
        return self.filtered_network_.expected(table, origins, n)

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        """Of one segment of rows; ``segment`` is its number in the training table, None where it is not from there."""
        return kalman_innovations(self.filtered_network_, table, segment)

    def _past_roles(self) -> tuple[str, ...]:
        return self.network_.history_roles

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        return self.filtered_network_.drive(table, origins, self._forecast_start(table, origins, n_leads))

    def _cold_value(self, table: ZoneTable) -> Any:
        return self.filtered_network_.cold_value(table)

    def _measured_table(self, X: Any, purpose: str) -> ZoneTable:
        """X with every measured temperature, or an error that says what it is needed for."""
        table = self._read_X(X)
        for role in self.network_.history_roles:
            if role not in table.history:
                raise ValueError(f"role {role!r} is missing: {purpose}.")
        return table

    def simulate(self, X: Any, heat_gain: Any = None, initial_state: Any = None) -> np.ndarray:
        """Simulate the temperature from the inputs alone.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        heat_gain : array-like of shape (n_samples,), optional
            Unmeasured heat on the disturbed node [kW]; 0 by default.  One column per node where there are several, of a
            frame by name (``zeta_<node>``, ``heat_gain_<node>`` or ``<node>``), of an array in their order.
        initial_state : array-like of shape (n_states,), or mapping or Series by ``T_<node>``, optional
            Node temperatures at the first row [degC], in the order of the nodes or by name.  By default the fitted
            state where X begins as the training table did, the filtered state where X follows it, else all nodes at the
            first ``T_za`` (or the training mean).

        Returns
        -------
        ndarray of shape (n_samples,)
            Temperature of the measured node at every row's stamp [degC]; a column per node where several are measured.
        """
        check_is_fitted(self)
        states = self.simulate_states(X, heat_gain, initial_state).to_numpy(copy=True)
        rows = self.filtered_network_.kalman.measured
        return states[:, rows[0]].copy() if len(rows) == 1 else states[:, rows]

    def simulate_states(self, X: Any, heat_gain: Any = None, initial_state: Any = None) -> pd.DataFrame:
        """Simulate every node, as :meth:`simulate` does the measured one.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        heat_gain, initial_state : array-like, optional
            As in :meth:`simulate`.

        Returns
        -------
        DataFrame of shape (n_samples, n_states)
            Columns ``T_<node>`` [degC].
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        here, known = table.rows(slice(n_tail, None)), self.filtered_network_
        heat = _checked_heat(heat_gain, here, self.network_)
        if initial_state is not None:
            state = _checked_state(initial_state, self.network_)
        elif n_tail:
            state = known.rolling.ahead.mean[: known.kalman.n]
        else:
            state = known.start(table).mean[: known.kalman.n]
        forcing = known.experiment(here).inputs @ known.kalman.B.T + heat @ known.kalman.heat.T
        path = simulate_path(known.kalman.A, forcing, state)
        return pd.DataFrame(path[: here.n_rows], index=here.index, columns=list(self.network_.states))

    def estimate_disturbance(self, X: Any, kind: str = "input", smooth: bool = False) -> Any:
        """Estimate the disturbance from the measured temperature.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            With the measured temperature as column ``T_za``, else ValueError.
        kind : {"input", "output"}
            ``"input"``: heat on the disturbed node [kW] (paper Eq. 9); ``"output"``: what the measured
            temperature has beyond the simulated one [K] (paper Eq. 13).
        smooth : bool
            False: from rows up to each row, as a forecast may use it; True: from all rows, for ``"input"`` only, as the
            other kind is measured less simulated.

        Returns
        -------
        Series of length n_samples, named ``zeta``
            Where a network has several disturbed (measured) nodes, a DataFrame with one column ``zeta_<node>`` each.
        """
        check_is_fitted(self)
        check_bool("smooth", smooth)
        names = self._zeta_names(kind)
        table = self._measured_table(X, "a disturbance is estimated from the measured temperature")
        frame = pd.DataFrame(self._zeta(table, kind, smooth), index=table.index, columns=names)
        return frame[names[0]] if len(names) == 1 else frame

    def _zeta_names(self, kind: str = "input") -> list[str]:
        names = self.network_.disturbed_names if checked_kind(kind) == "input" else self.network_.measured_names
        return ["zeta"] if len(names) == 1 else [f"zeta_{name}" for name in names]

    def _zeta(self, table: ZoneTable, kind: str, smooth: bool = False) -> np.ndarray:
        """(N, d) disturbance of every row, each segment after the training table's end or from a cold start."""
        parts = []
        for segment in table.segments:
            whole, n_tail = self._after_tail(segment)
            parts.append(self.filtered_network_.disturbance(whole, kind, smooth)[n_tail:])
        return np.concatenate(parts)

    def transform(self, X: Any) -> Any:
        """X with the causal input disturbance ``zeta`` [kW] as a further column (of each disturbed node).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Without ``T_za`` the disturbance is what the model expects without measurements.
        """
        check_is_fitted(self)
        X = as_pandas(X)
        zeta = self._zeta(self._read_X(X), "input")
        columns = dict(zip(self._zeta_names(), zeta.T, strict=True))
        if isinstance(X, ZoneTable):
            return X.replace(history={**X.history, **columns})
        if not isinstance(X, pd.DataFrame):
            return np.column_stack([np.asarray(X, float), zeta])
        kept = [name for name in getattr(self, "feature_names_in_", X.columns) if name in X]
        return X[kept].assign(**columns)

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Names of the columns that :meth:`transform` returns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of X's columns where it had none in ``fit``; ValueError if they are not those that ``fit`` saw.
        """
        names = OneToOneFeatureMixin.get_feature_names_out(self, input_features)
        return np.array(list(dict.fromkeys([*names, *self._zeta_names()])), dtype=object)

    @one_blas_thread
    def innovations(self, X: Any) -> pd.DataFrame:
        """Errors of the model's own predictor, one step ahead.

        CONV predicts by simulation, OD by its ARMA model, ID and the periodic model by their Kalman filters; a right
        model has white ``innovation / std`` of N(0, 1).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            With column ``T_za``, else ValueError.  Where X begins as the training table did (by its time stamps) the
            predictor starts as in ``fit``; where X follows it, from its end; else cold.

        Returns
        -------
        DataFrame of length n_samples
            ``innovation`` and ``std`` [K] (``innovation_<node>`` and ``std_<node>`` where several nodes are measured);
            NaN where ``T_za`` is missing, and in the warm-up from which CONV takes its first state.

        Notes
        -----
        CONV, ID and OD minimise squares, so that ``std`` is scaled to the training errors (``noise_std_``).  After
        missing rows, and in the first rows of ID, ``std`` is larger; a fit of ID or OD weighs its errors by it.
        """
        check_is_fitted(self)
        table = self._measured_table(X, "innovations compare predictions with the measurements")
        in_training, errors, stds = self.filtered_network_.is_training(table), [], []
        for number, segment in enumerate(table.segments):
            longer, n_tail = self._after_tail(segment) if number == 0 else (segment, 0)
            found = self._innovations(longer, number if in_training else None)
            errors.append(found.error[n_tail:])
            stds.append(np.where(np.isfinite(errors[-1]), found.std[n_tail:], np.nan))
        names = self.network_.measured_names
        ends = [""] if len(names) == 1 else [f"_{name}" for name in names]
        columns = [f"{value}{end}" for value in ("innovation", "std") for end in ends]
        return pd.DataFrame(np.hstack([np.concatenate(errors), np.concatenate(stds)]), table.index, columns)

    def drive(self, X: Any, origins: Any, disturbance: Any, kind: str = "input") -> np.ndarray:
        """Forecast the rows after each origin under a given disturbance (paper Eqs. 17 and 18).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; ``T_za`` is read up to each origin only.
        origins : sequence of int
            Row numbers of X.
        disturbance : array-like of shape (n_origins, n_leads)
            ``kind="input"``: heat [kW] of the rows origin, origin + 1, ...; ``kind="output"``: temperature [K] added to
            the rows origin + 1, origin + 2, ...  A third axis where a network has several disturbed (measured) nodes.
        kind : {"input", "output"}

        Returns
        -------
        ndarray of shape (n_origins, n_leads)
            Temperature of the rows origin + 1, ... [degC], of each measured node; rows beyond X repeat the last one.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        rows = checked_origins(origins, table.n_rows - n_tail, n_tail) + n_tail
        start = self.filtered_network_.under(table, rows, _checked_disturbance(disturbance), kind)
        return self.filtered_network_.drive(table, rows, start)

    def predict_load(self, X: Any, setpoint: Any, limits: Any = None) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point at the end of every row (paper Eq. 16).

        States are taken at each origin, as in :meth:`predict`; heating and cooling columns are read up to there, and
        rows ahead need none.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float, array-like of shape (n_samples,), pair or DataFrame of two columns
            Wanted temperature at each row's stamp [degC].  Or a thermostat's heating and cooling set-point over each
            row's step, a pair ``(heat, cool)`` of numbers or values by row, None to leave a side free, or two columns.
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; each a number or one value per row, such as 0 when the plant
            is off.  The capacity of its stages holds too.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW] over each row's step, clipped to what the plant can do, and ``T_za``
            [degC] at each row's stamp under them; stages and heat with ``_unclipped`` as the set-point would need, and
            the expected disturbance ``zeta`` [kW, or K of an output disturbance].  Where the training has stages and a
            metered ``Q_hvac``, that is the meter's part, and ``Q_total`` the sum.

        Notes
        -----
        Where the plant heats another node than the measured one, meeting the set-point at every step needs a load that
        swings.  There the load is sought as if held for the next few steps, and the temperature only comes near it.
        """
        check_is_fitted(self)
        table, n_tail, origins = self._load_rows(X, filter(is_plant, self._tail.inputs))
        longest = int(np.diff(np.append(origins, table.n_rows - n_tail)).max())
        start = self._forecast_start(table, origins + n_tail, longest)
        return network_load(self.filtered_network_, self._plant, table, origins + n_tail, start, setpoint, limits)

    def required_heat(
        self, X: Any, setpoint: Any, origins: Any, disturbance: Any, kind: str = "input", limits: Any = None
    ) -> pd.DataFrame:
        """As :meth:`predict_load`, under a given disturbance.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float, array-like, pair or DataFrame of two columns
        origins : sequence of int
            Increasing rows of X at which the state is taken from the measurements, negative for known rows before X;
            set-points, limits and loads begin at the first.
        disturbance : array-like of shape (n_origins, n_leads)
            As in :meth:`drive`; long enough to reach the next origin.
        kind : {"input", "output"}
        limits : tuple of (lowest, highest), optional
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        rows = checked_origins(origins, table.n_rows - n_tail, n_tail) + n_tail
        if not len(rows) or (np.diff(rows) <= 0).any():
            raise ValueError(f"origins={origins!r} must increase; give one row number or more.")
        start = self.filtered_network_.under(table, rows, _checked_disturbance(disturbance), kind)
        given, needed = start.heat.shape[1], int(np.diff(rows, append=table.n_rows).max())
        if given < needed:
            raise ValueError(f"disturbance has {given} leads, but {needed} rows lie up to the next origin or the end.")
        return network_load(self.filtered_network_, self._plant, table, rows, start, setpoint, limits)

    @property
    def plant(self) -> Plant:
        """Stages of the training table and their capacities."""
        check_is_fitted(self)
        return self._plant


def _checked_heat(heat_gain: Any, here: ZoneTable, network: RCNetwork) -> np.ndarray:
    """(N, d) unmeasured heat of every row [kW]."""
    n, d = here.n_rows, len(network.disturbed_nodes)
    heat_gain = as_pandas(heat_gain, "heat_gain")
    if isinstance(getattr(heat_gain, "index", None), pd.DatetimeIndex) and here.utc is not None:
        refuse_other_stamps(heat_gain, here.index, "heat_gain")
    if d > 1 and isinstance(heat_gain, pd.DataFrame) and any(isinstance(column, str) for column in heat_gain):
        heat_gain = _by_node(heat_gain, network.disturbed_names)
    given = np.zeros((n, d)) if heat_gain is None else as_numbers(heat_gain, "heat_gain")
    heat = given[:, None] if d == 1 and given.ndim == 1 else given
    if heat.shape != (n, d):
        each = f" for each of {', '.join(network.disturbed_names)}" if d > 1 else ""
        raise ValueError(f"heat_gain has shape {given.shape}, but X has {n} rows; give one value [kW] per row{each}.")
    _refuse_missing("heat_gain", heat)
    for column in heat.T:
        check_range(column, "zeta", "heat_gain", here.index)
    return heat


def _by_node(heat_gain: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The columns of unmeasured heat in the order of the nodes, whose ``names`` may follow ``zeta_`` or such."""
    found = [[c for c in heat_gain if c in (name, f"zeta_{name}", f"heat_gain_{name}")] for name in names]
    chosen = [column for columns in found for column in columns]
    if any(len(columns) != 1 for columns in found) or len(chosen) < heat_gain.shape[1]:
        raise ValueError(
            f"heat_gain has the columns {listed(heat_gain)}; give one for each of {listed(names)}, by that name, "
            f"zeta_{names[0]} or heat_gain_{names[0]}."
        )
    return heat_gain[chosen]


def _checked_disturbance(disturbance: Any) -> np.ndarray:
    """Disturbance by origin, lead and node [kW or K]."""
    values = as_numbers(disturbance, "disturbance")
    _refuse_missing("disturbance", values)
    check_range(values.ravel(), "zeta", "disturbance", pd.RangeIndex(values.size))
    return values


def _checked_state(initial_state: Any, network: RCNetwork) -> np.ndarray:
    """(n,) node temperatures [degC]."""
    named = by_name(initial_state, network.states, "initial_state")
    state = as_numbers(named, "initial_state").reshape(-1)
    if state.shape != (len(network.nodes),):
        raise ValueError(f"initial_state has {len(state)} values, but the states are {network.states}.")
    _refuse_missing("initial_state", state)
    check_range(state, "T_za", "initial_state", pd.Index(network.states))
    return state


def _refuse_missing(name: str, values: np.ndarray) -> None:
    if not np.isfinite(values).all():
        raise ValueError(f"{name} contains NaN or inf at place {int(np.argmin(np.isfinite(values)))}; fill it.")
