"""Forecasts of an identified network from one origin: of a table, of a plan, and as a discrete model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._joining import (
    LAST_KNOWN,
    join_frames,
    join_tables,
    read_now,
    refuse_no_frames,
    refuse_unless_following,
    refuse_unmeasured,
    warn_if_unmeasured,
    with_measured,
)
from .._table import SCORED, UNLIMITED, ZoneTable, append_tables, by_name, listed, plant_roles, refuse_gap
from .._threads import one_blas_thread
from .._transaction import unchanged_on_failure
from ..control import (
    AffineForecast,
    ControlModel,
    Plan,
    decided_on,
    limits_of,
    planned,
    read_inputs,
    read_member,
    warn_uncovered,
)
from .experiment import read_outputs
from .filtered_network import ForecastStart, kept_end
from .loads import linear_network, plan_gain
from .network_model import NetworkModel
from .state_space import StateSpace


class _Ahead(NamedTuple):
    """Rows ahead of an origin."""

    table: ZoneTable  # with all rows before them
    origin: int
    now: np.ndarray | None  # (o,) measured in the first row ahead, which then is the origin [degC]
    n_rows: int

    @property
    def n_leads(self) -> int:
        return self.n_rows - (self.now is not None)


class ForecastingNetwork(NetworkModel):
    """``forecast``, ``affine_forecast``, ``to_state_space`` and ``update`` of the identifications."""

    state_space_: StateSpace
    sampling_time_: pd.Timedelta
    _warmup_rows: int  # of the warm-up, as it was in ``fit``
    _acts_on = "input"  # what the model expects beyond the network: heat, or (output) a temperature

    def _read_target(self, y: Any, table: ZoneTable, max_missing: Any = SCORED) -> np.ndarray:
        return read_outputs(y, table, self.network_, max_missing=max_missing)

    def _rows_remembered(self, outputs: np.ndarray) -> int:
        """Number of the last rows of ``outputs`` (N, o) that forecasts need: those of a warm-up, and the one before."""
        return self._warmup_rows + 1

    @property
    def known_until_(self) -> pd.Timestamp | None:
        """Stamp of the last row that the model knows, in the time zone of the training; None if that had no stamps."""
        check_is_fitted(self)
        return None if self._tail.utc is None else pd.Timestamp(self._tail.index[-1])

    @unchanged_on_failure
    @one_blas_thread
    def update(self, X: Any, y: Any = None) -> Self:
        """Take in new rows without learning; later forecasts start from the last of them.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Rows that follow the last known one, with time stamps and what was measured, NaN where missing.
        y : array-like of shape (n_samples,), optional
            The measured temperature, where X has none.

        Raises
        ------
        ValueError
            If the rows do not follow, or hold no measurement; the estimator is then what it was.
        """
        check_is_fitted(self)
        table, known, roles = self._read_X(X), self.filtered_network_, self.network_.history_roles
        refuse_gap(table)
        refuse_unless_following(table, self._tail, "X", LAST_KNOWN)
        if y is not None:
            target = self._read_target(y, table, UNLIMITED)
            table = table.replace(history=dict(zip(roles, np.atleast_2d(target.T), strict=True)))
        absent = [self._column_of(role) for role in roles if role not in table.history]
        if absent:
            raise ValueError(
                f"X has no column {absent[0]!r}; give what was measured there or as y, with NaN where missing."
            )
        whole = append_tables(known.rolling.tail, table)
        experiment, now = known.experiment(whole), known.rolling
        states = known.kalman.run(experiment, now.tail_start)
        path = known.open_loop(experiment, now.tail_open)
        keep = min(whole.n_rows, self._rows_remembered(experiment.outputs))
        rolling = kept_end(self.network_, whole, experiment, states, path, keep)
        self.filtered_network_ = replace(known, rolling=rolling)
        return self

    @one_blas_thread
    def forecast(self, history: Any, future: Any, T_za: float | None = None) -> pd.DataFrame:
        """Forecast from the last row of a history, under the heat of the rows ahead.

        Parameters
        ----------
        history : DataFrame or None
            Rows up to the origin, with what was measured; where it continues the known rows, those come before it.
            None: all that is known from :meth:`fit` and :meth:`update`.
        future : DataFrame
            The rows to forecast, with all inputs; it begins one step after the history.
        T_za : float, or several in the order of the measured nodes or by ``T_za_<node>`` or ``<node>``, optional
            Temperature measured at the first row of ``future``, which then is *now* [degC]: the forecast begins there,
            and the heat of that row is still to be decided.  It is not added to the history.

        Returns
        -------
        DataFrame with the index of ``future``
            ``T_za`` [degC] at each stamp, and ``zeta`` [kW, or K for an output disturbance]; a column per node where
            there are several.

        Raises
        ------
        ValueError
            If the two do not join evenly, a column is missing, or ``T_za`` is no temperature.

        Warns
        -----
        PlanWarning
            If the plan in ``future`` leaves what training covered.
        """
        check_is_fitted(self)
        ahead, _ = self._planned(history, future, (), T_za)
        roles = plant_roles(self.filtered_network_.roles)
        warn_uncovered(Plan.of(ahead.table, roles, ahead.n_rows), roles, self._ranges())
        T, zeta, _ = self._expected(ahead)
        frame = pd.DataFrame(T, future.index, list(self.network_.history_roles))
        return frame.assign(**dict(zip(self._zeta_names(self._acts_on), zeta.T, strict=True)))

    @one_blas_thread
    def affine_forecast(
        self,
        history: Any,
        future: Any,
        inputs: Sequence[str] | None = None,
        T_za: float | None = None,
        member: str = "network",
        quantiles: Sequence[float] | None = None,
    ) -> AffineForecast:
        """Forecast as an affine function of the heat that is planned: ``T = free + gain @ q``.

        Parameters
        ----------
        history, future
            As in :meth:`forecast`; columns of the ``inputs`` may be absent from ``future``.
        inputs : sequence of str, optional
            What is decided: heating and cooling of the training table, kW or stages; default is all of it, in the order
            of the table.
        T_za : float, or several in the order of the measured nodes or by ``T_za_<node>`` or ``<node>``, optional
            As in :meth:`forecast`.
        member : {"network", "blend"}, default="network"
            The same here: an identification is a network.
        quantiles : None
            An identification learns no intervals.

        Returns
        -------
        AffineForecast
            ``free`` (H,) [degC], ``gain`` (H, H, m) [K per kW or stage], ``zeta`` (H,) and ``index``, by the rows of
            ``future``; with a last axis where the network has several such nodes.

        Raises
        ------
        ValueError
            As :meth:`forecast` does, and if an input was not in training or quantiles are wanted.

        Warns
        -----
        PlanWarning
            If the plan in ``future`` leaves what training covered.
        """
        check_is_fitted(self)
        if quantiles is not None:
            raise ValueError(
                f"{type(self).__name__} learns no intervals; leave quantiles out, or take TwoStagePredictor(gray_box)."
            )
        read_member(member)
        roles = read_inputs(inputs, self._trained(), self._column_of)
        ahead, plan = self._planned(history, future, roles, T_za)
        T, zeta, _ = self._expected(ahead)
        gain = plan_gain(self.filtered_network_, roles, ahead.n_rows)
        T, zeta = (values[:, 0] if values.shape[1] == 1 else values for values in (T, zeta))
        free = T - np.tensordot(gain, plan.values, axes=((1, 2), (0, 1)))
        return AffineForecast(free, gain, zeta, future.index, roles)

    def to_state_space(self, history: Any = None, future: Any = None, T_za: Any = None) -> StateSpace | ControlModel:
        """The identified model as discrete state-space matrices, at the training's sampling time.

        Parameters
        ----------
        history, future, T_za : optional
            As in :meth:`affine_forecast`: with rows ahead the model has their state and forcing too, and the inputs are
            heating and cooling alone.

        Returns
        -------
        StateSpace, or with rows ahead ControlModel
            ``A`` (n, n), ``B`` (n, m), ``C`` (o, n), and ``x0`` (n,), ``forcing`` (H, n), ``inputs``, ``limits``
            (m, 2).
        """
        check_is_fitted(self)
        if future is None:
            if history is not None or T_za is not None:
                raise ValueError("history and T_za need rows ahead; give future too.")
            return self.state_space_
        known, roles = self.filtered_network_, decided_on(self._trained())
        acting = self.network_.inputs(known.roles)
        ahead, _ = self._planned(history, future, roles, T_za)
        _, _, start = self._expected(ahead)
        rows = known.experiment(ahead.table).inputs[ahead.origin :]
        offset = np.vstack([np.zeros_like(start.offset[0, :1]), start.offset[0, :-1]])
        network = linear_network(known, roles, rows, start.states[0], start.heat[0], offset)
        chosen = [acting.index(role) for role in roles]
        network = network.after(rows[0, chosen]) if ahead.now is None else network.measured(ahead.now)
        limits = limits_of(self._plant.most, self._ranges(), roles)
        arrays = network.A, network.B, network.C, network.state, network.forcing
        return ControlModel(*arrays, roles, limits, network.states, future.index, self.sampling_time_)

    def origin_state(self, X: Any, origin: int, kind: str) -> tuple[np.ndarray, np.ndarray]:
        """Node temperatures (n,) at a row, and inputs (N, p) of that row and those after it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        origin : int; row number of X, negative for a known row before it
        kind : {"input", "output"}; of the disturbance, for ``"output"`` the nodes follow the inputs alone
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        known, row = self.filtered_network_, np.array([origin + n_tail])
        nothing = np.zeros((1, 1, known.kalman.n_gains if kind == "input" else len(known.kalman.measured)))
        state = known.under(table, row, nothing, kind).states[0]
        return state, known.experiment(table).inputs[row[0] :]

    def _trained(self) -> list[str]:
        """Roles of the training that act on the network, in the order of its columns."""
        return [role for role in self.training_.ranges if role in self.filtered_network_.roles]

    def _ranges(self) -> dict[str, np.ndarray]:
        """Least and most of each training input."""
        return {role: np.array(ends) for role, ends in self.training_.ranges.items()}

    def _expected(self, ahead: _Ahead) -> tuple[np.ndarray, np.ndarray, ForecastStart]:
        """(H, o) temperatures, (H, d) zeta of the rows ahead, and the start at the origin."""
        known, origin = self.filtered_network_, np.array([ahead.origin])
        start = self._forecast_start(ahead.table, origin, ahead.n_leads + 1)
        T = known.drive(ahead.table, origin, start)[0, : ahead.n_leads].reshape(
            ahead.n_leads, len(known.kalman.measured)
        )
        if self._acts_on == "input":
            zeta = start.heat[0, ahead.n_leads + 1 - ahead.n_rows :]
        else:
            zeta = start.offset[0, : ahead.n_leads]
        if ahead.now is not None:
            T = np.vstack([ahead.now, T])
            if self._acts_on == "output":
                zeta = np.vstack([ahead.now - start.states[0][known.kalman.measured], zeta])
        return T, zeta, start

    def _planned(self, history: Any, future: Any, roles: tuple[str, ...], T_za: Any) -> tuple[_Ahead, Plan]:
        """The rows ahead after those before them, and the plan that they hold."""
        refuse_no_frames(history, future)
        now, n_rows = self._read_now(T_za, future.index), len(future.index)
        filled, given = planned(future, roles, self._column_of)
        past = [self._column_of(role) for role in self.network_.history_roles]
        if isinstance(filled, ZoneTable):
            tail = self.filtered_network_.rolling.tail
            whole: Any = filled if history is None else join_tables(history, filled, tail)
            whole = whole.replace(history=whole.history if history is not None else {})
        elif history is None:
            whole = filled.drop(columns=[name for name in past if name in filled])
        else:
            acting = self.network_.inputs(self.filtered_network_.roles)
            whole = join_frames(history, filled, [self._column_of(role) for role in acting], *past)
        read = self._read_X(whole)
        refuse_gap(read)
        if history is not None:
            refuse_unmeasured(read, self.network_.history_roles, self._column_of)
        table, n_tail = self._after_tail(read)
        if history is None and not n_tail:
            refuse_unless_following(table, self._tail, "future", LAST_KNOWN)
        if not n_tail and now is None:
            warn_if_unmeasured(table, self.network_.history_roles, self._column_of)
        first = table.n_rows - n_rows
        if now is not None:
            for role, value in zip(self.network_.history_roles, now, strict=True):
                table = with_measured(table, first, float(value), role)
        plan = Plan.of(table, roles, n_rows)
        warn_uncovered(plan, given, self._ranges())
        return _Ahead(table, first - (now is None), now, n_rows), plan

    def _read_now(self, T_za: Any, index: pd.Index) -> np.ndarray | None:
        """(o,) temperatures measured at the first row ahead [degC]."""
        if T_za is None:
            return None
        roles = self.network_.history_roles
        if isinstance(T_za, Mapping | pd.Series):
            T_za = pd.Series(T_za).rename(dict(zip(self.network_.measured_names, roles, strict=True)))
        values = [T_za] if len(roles) == 1 else by_name(T_za, roles, "T_za")
        if not isinstance(values, list | tuple | np.ndarray | pd.Series) or len(values) != len(roles):
            raise ValueError(f"T_za is not one temperature [degC] per measured node; give those of {listed(roles)}.")
        return np.array([read_now(value, index) for value in values])
