"""An identified network at work on a table: filtered states, and forecasts from them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .._rolling import RollingForecastMixin
from .._table import ZoneTable
from ..filtering import simulate_path
from .experiment import Experiment, make_experiment
from .gain_filter import FilteredStates, FilterStart, GainFilter
from .gain_model import profile_cell
from .one_step_errors import InnovationsMixin


class ForecastStart(NamedTuple):
    """What a model expects after each origin, apart from the known inputs."""

    states: np.ndarray  # (n_origins, n) node temperatures at the origin [degC]
    heat: np.ndarray  # (n_origins, H, d) unmeasured heat of the rows origin, origin + 1, ... [kW]
    offset: np.ndarray  # (n_origins, H, o) added to the outputs of the rows origin + 1, ... [K]


class FilteredNetwork(InnovationsMixin, RollingForecastMixin, RegressorMixin, BaseEstimator):
    """What an identified network does with a table; a subclass identifies it and may give ``_forecast_start``."""

    def _experiment(self, table: ZoneTable) -> Experiment:
        return make_experiment(self.network_, self._roles, table, self._measurements(table))

    def _measurements(self, table: ZoneTable) -> np.ndarray:
        """What the table holds of the measured temperatures: (N,), or (N, o) of o nodes; NaN where it has none."""
        missing = np.full(table.n_rows, np.nan)
        columns = [table.history.get(role, missing) for role in self.network_.history_roles]
        return columns[0] if len(columns) == 1 else np.column_stack(columns)

    @property
    def _roles(self) -> tuple[str, ...]:
        return tuple(sorted(self._tail.inputs))

    @staticmethod
    def _cells(table: ZoneTable) -> np.ndarray:
        return profile_cell(table.time.hour.to_numpy(np.int64), np.asarray(table.time.day_of_week >= 5))

    def _classes(self, table: ZoneTable) -> np.ndarray:
        return self._filter.classes[self._cells(table)]

    def _cold_value(self, table: ZoneTable) -> Any:
        first = self._measurements(table)[0]
        return np.where(np.isfinite(first), first, self._mean)[()]

    def _start(self, table: ZoneTable) -> FilterStart:
        """What is known of the first row: the training's own start, its end, or no more than a temperature."""
        if self._is_tail(table):
            return self._tail_start
        if self._is_training(table):
            return self._train_start
        return self._filter.cold(np.atleast_1d(self._cold_value(table)))

    def _is_tail(self, table: ZoneTable) -> bool:
        return table.utc is not None and self._tail.utc is not None and table.utc[0] == self._tail.utc[0]

    def _is_training(self, table: ZoneTable) -> bool:
        return table.utc is not None and self._train_first is not None and table.utc[0] == self._train_first

    def _open_start(self, table: ZoneTable) -> np.ndarray:
        return self._tail_open if self._is_tail(table) else self._start(table).mean[: self._filter.n]

    def _open_loop(self, experiment: Experiment, state: np.ndarray) -> np.ndarray:
        """(N + 1, n) node temperatures by the known inputs alone."""
        return simulate_path(self._filter.A, experiment.inputs @ self._filter.B.T, state)

    def _track(self, table: ZoneTable, smooth: bool = False) -> FilteredStates:
        experiment = self._experiment(table)
        return self._filter.track(experiment, self._cells(table), self._classes(table), self._start(table), smooth)

    # ---------------------------------------------------------------------------------------------------- forecasts
    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The filter's own expectation: the gain state decays towards the profile."""
        track, cells = self._track(table), self._cells(table)
        tracker: GainFilter = self._filter
        g = track.gain[origins] - tracker.profile[cells[origins]]
        rows = np.minimum(origins[:, None] + np.arange(n), table.n_rows - 1)
        decay = tracker.phi ** np.arange(n)
        heat = g[:, None] * decay[:, None] + tracker.profile[cells[rows]]
        return ForecastStart(track.nodes[origins], heat, np.zeros((len(origins), n, len(tracker.measured))))

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        return self._run(table, origins, self._forecast_start(table, origins, n_leads))

    def _run(self, table: ZoneTable, origins: np.ndarray, outlook: ForecastStart) -> np.ndarray:
        experiment, tracker = self._experiment(table), self._filter
        paths = [
            tracker.drive(experiment, int(o), state, heat)[:, tracker.measured]
            for o, state, heat in zip(origins, outlook.states, outlook.heat, strict=True)
        ]
        out = np.array(paths).reshape(outlook.offset.shape) + outlook.offset
        return out[..., 0] if out.shape[2] == 1 else out

    def _given(self, table: ZoneTable, origins: np.ndarray, disturbance: np.ndarray, kind: str) -> ForecastStart:
        tracker, size = self._filter, disturbance.shape[:2]
        wanted = tracker.n_gains if checked_kind(kind) == "input" else len(tracker.measured)
        given = disturbance[..., None] if disturbance.ndim == 2 else disturbance
        if given.shape[2:] != (wanted,):
            raise ValueError(
                f"disturbance has shape {disturbance.shape}, but network {self.network_.name} has {wanted} of kind "
                f"{kind!r}: give (n_origins, n_leads{f', {wanted}' if wanted > 1 else ''})."
            )
        if kind == "input":
            return ForecastStart(self._track(table).nodes[origins], given, np.zeros((*size, len(tracker.measured))))
        states = self._open_loop(self._experiment(table), self._open_start(table))[origins]
        return ForecastStart(states, np.zeros((*size, tracker.n_gains)), given)

    def drive(self, X: Any, origins: Any, disturbance: Any, kind: str = "input") -> np.ndarray:
        """Forecast the rows after each origin under a given disturbance (paper Eqs. ID_hybrid and od_hybrid).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; ``T_za`` is read up to each origin only.
        origins : sequence of int
            Row numbers of X.
        disturbance : array-like of shape (n_origins, n_leads)
            With a third axis where a network has several disturbed (measured) nodes.
            ``kind="input"``: heat [kW] of the rows origin, origin + 1, ...;
            ``kind="output"``: temperature [K] added to the rows origin + 1, origin + 2, ...
        kind : {"input", "output"}

        Returns
        -------
        ndarray of shape (n_origins, n_leads)
            Temperature of the rows origin + 1, ... [degC], with a third axis where several nodes are measured; a row
            beyond X repeats the last one.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        rows = np.asarray(origins, dtype=np.int64) + n_tail
        given = np.asarray(disturbance, dtype=np.float64)
        return self._run(table, rows, self._given(table, rows, given, kind))


def checked_kind(kind: str) -> str:
    if kind not in ("input", "output"):
        raise ValueError(f"kind={kind!r} is neither 'input' nor 'output'.")
    return kind
