"""An identified network with its Kalman filter: states, disturbances and forecasts, and how it follows new rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import clone

from .._table import ZoneTable
from ..filtering import simulate_path
from ..thermal import RCNetwork
from .disturbance_models import checked_kind
from .experiment import Experiment, make_experiment
from .gain_filter import FilteredStates, FilterStart, GainFilter
from .gain_model import week_cells

#: (n,) node temperatures at the first row of a segment, from its smoothed states and its number
FirstState = Callable[[FilteredStates, int], np.ndarray]


class ForecastStart(NamedTuple):
    """States and expected disturbance from which forecasts are made."""

    states: np.ndarray  # (n_origins, n) node temperatures at the origin [degC]
    heat: np.ndarray  # (n_origins, H, d) unmeasured heat of the rows origin, origin + 1, ... [kW]
    offset: np.ndarray  # (n_origins, H, o) added to the outputs of the rows origin + 1, ... [K]
    offset_now: np.ndarray  # (n_origins, o) added to the outputs of the origin, where it is not measured [K]

    @classmethod
    def of_heat(cls, states: np.ndarray, heat: np.ndarray, n_outputs: int) -> ForecastStart:
        """Under unmeasured heat alone."""
        return cls(states, heat, np.zeros((*heat.shape[:2], n_outputs)), np.zeros((len(heat), n_outputs)))


class RollingState(NamedTuple):
    """The last known rows, and the states at their first row and after their last."""

    tail: ZoneTable  # the rows that are kept, with the measured temperatures as history
    tail_start: FilterStart  # what is known of the first of them
    tail_open: np.ndarray  # (n,) node temperatures at the first of them by the inputs alone [degC]
    nodes: np.ndarray  # (n,) filtered node temperatures at the last known row [degC]
    ahead: FilterStart  # what is known of the row after it
    open_nodes: np.ndarray  # (n,) node temperatures at the last known row by the inputs alone [degC]
    open_ahead: np.ndarray  # (n,) the same at the row after it
    inputs: np.ndarray  # (m,) of the last known row, which act until the next one


@dataclass(frozen=True)
class FilteredNetwork:
    """A network, its Kalman filter, and what is kept of the training table; :meth:`advanced` returns another one."""

    kalman: GainFilter
    roles: tuple[str, ...]  # inputs of the training table
    mean: float  # of the training measurements [degC]
    training_start: FilterStart  # what the fit found of the first training row
    training_first: pd.Timestamp | None  # UTC stamp of that row
    rolling: RollingState  # the last known rows

    @property
    def network(self) -> RCNetwork:
        return self.kalman.network

    def experiment(self, table: ZoneTable) -> Experiment:
        """The inputs and measurements of a table."""
        return make_experiment(self.network, self.roles, table, self.measurements(table))

    def measurements(self, table: ZoneTable) -> np.ndarray:
        """The measured temperatures that a table holds: (N,), or (N, o) of o nodes; NaN where it has none."""
        columns = [table.measured(role) for role in self.network.history_roles]
        return columns[0] if len(columns) == 1 else np.column_stack(columns)

    def cold_value(self, table: ZoneTable) -> Any:
        """The first measured temperature of a table without history, or the training mean."""
        first = self.measurements(table)[0]
        return np.where(np.isfinite(first), first, self.mean)[()]

    def is_tail(self, table: ZoneTable) -> bool:
        """Whether a table begins with the kept end of the known rows."""
        tail = self.rolling.tail
        return table.utc is not None and tail.utc is not None and table.utc[0] == tail.utc[0]

    def is_training(self, table: ZoneTable) -> bool:
        """Whether a table begins where the training table did."""
        return table.utc is not None and self.training_first is not None and table.utc[0] == self.training_first

    def start(self, table: ZoneTable) -> FilterStart:
        """Start at the first row: that of the training, that of its kept end, or from the first temperature alone."""
        if self.is_tail(table):
            return self.rolling.tail_start
        if self.is_training(table):
            return self.training_start
        return self.kalman.cold(np.atleast_1d(self.cold_value(table)))

    def open_start(self, table: ZoneTable) -> np.ndarray:
        """(n,) node temperatures of the open-loop run at the first row."""
        return self.rolling.tail_open if self.is_tail(table) else self.start(table).mean[: self.kalman.n]

    def open_loop(self, experiment: Experiment, state: np.ndarray) -> np.ndarray:
        """(N + 1, n) node temperatures by the known inputs alone."""
        return simulate_path(self.kalman.A, experiment.inputs @ self.kalman.B.T, state)

    def run(self, table: ZoneTable, smooth: bool = False) -> FilteredStates:
        """Filter or smooth the states of one segment of rows."""
        return self.kalman.run(self.experiment(table), self.start(table), smooth)

    def disturbance(self, table: ZoneTable, kind: str, smooth: bool = False) -> np.ndarray:
        """(N, d) heat [kW] of one segment of rows, or (N, o) what the output has beyond the open loop [K]."""
        if checked_kind(kind) == "input":
            return self.run(table, smooth).gain
        experiment = self.experiment(table)
        return experiment.outputs - self.open_loop(experiment, self.open_start(table))[:-1, self.kalman.measured]

    def advanced(self, table: ZoneTable) -> tuple[FilteredNetwork, FilteredStates, np.ndarray]:
        """The network after the rows that follow the last, their states, and (N, o) output beyond the open loop [K]."""
        experiment, now = self.experiment(table), self.rolling
        states, path = self.kalman.run(experiment, now.ahead), self.open_loop(experiment, now.open_ahead)
        rolling = kept_end(self.network, table, experiment, states, path, 1)
        return replace(self, rolling=rolling), states, experiment.outputs - path[:-1, self.kalman.measured]

    def expected(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """Forecasts of the filter itself: the gain state decays towards the profile."""
        experiment, kalman = self.experiment(table), self.kalman
        states, cells = kalman.run(experiment, self.start(table)), week_cells(experiment)
        g = states.gain[origins] - kalman.profile[cells[origins]]
        rows = np.minimum(origins[:, None] + np.arange(n), table.n_rows - 1)
        decay = kalman.phi ** np.arange(n)
        heat = g[:, None] * decay[:, None] + kalman.profile[cells[rows]]
        return ForecastStart.of_heat(states.nodes[origins], heat, len(kalman.measured))

    def under(self, table: ZoneTable, origins: np.ndarray, disturbance: Any, kind: str) -> ForecastStart:
        """The start of forecasts under a given disturbance, (n_origins, H) or (n_origins, H, d)."""
        kalman, disturbance = self.kalman, np.asarray(disturbance, dtype=np.float64)
        wanted = kalman.n_gains if checked_kind(kind) == "input" else len(kalman.measured)
        given = disturbance[..., None] if disturbance.ndim == 2 else disturbance
        if given.shape[2:] != (wanted,) or len(given) != len(origins) or not given.shape[1]:
            raise ValueError(
                f"disturbance has shape {disturbance.shape}, but there are {len(origins)} origins and network "
                f"{self.network.name} has {wanted} of kind {kind!r}: give (n_origins, n_leads"
                f"{f', {wanted}' if wanted > 1 else ''})."
            )
        if kind == "input":
            return ForecastStart.of_heat(self.run(table).nodes[origins], given, len(kalman.measured))
        states = self.open_loop(self.experiment(table), self.open_start(table))[origins]
        return ForecastStart(states, np.zeros((*given.shape[:2], kalman.n_gains)), given, given[:, 0])

    def drive(self, table: ZoneTable, origins: np.ndarray, start: ForecastStart) -> np.ndarray:
        """(n_origins, H) temperatures after each origin [degC], with a third axis where several are measured."""
        experiment, kalman = self.experiment(table), self.kalman
        paths = [
            kalman.drive(experiment, int(o), state, heat)[:, kalman.measured]
            for o, state, heat in zip(origins, start.states, start.heat, strict=True)
        ]
        out = np.array(paths).reshape(start.offset.shape) + start.offset
        return out[..., 0] if out.shape[2] == 1 else out


def filter_training(
    kalman: GainFilter, table: ZoneTable, experiment: Experiment, first_state: FirstState, keep: int
) -> FilteredNetwork:
    """Run a filter over its training table, of which the last ``keep`` rows are kept."""

    def begin(number: int) -> FilterStart:
        rows = experiment.segments[number]
        cold = kalman.cold(rows.firsts)
        smooth = kalman.run(rows, cold, smooth=True)
        gain = smooth.gain[0] - kalman.profile[week_cells(rows)[0]]
        return FilterStart(np.append(first_state(smooth, number), gain), cold.covariance)

    last = len(table.segments) - 1
    first, segment, rows = begin(0), table.segments[last], experiment.segments[last]
    start = begin(last) if last else first
    path = simulate_path(kalman.A, rows.inputs @ kalman.B.T, start.mean[: kalman.n])
    rolling = kept_end(kalman.network, segment, rows, kalman.run(rows, start), path, min(segment.n_rows, keep))
    mean = float(np.nanmean(experiment.y)) if np.isfinite(experiment.y).any() else 20.0
    begins = None if table.utc is None else table.utc[0]
    return FilteredNetwork(kalman, experiment.roles, mean, first, begins, rolling)


def kept_end(
    network: RCNetwork, table: ZoneTable, experiment: Experiment, states: FilteredStates, path: np.ndarray, keep: int
) -> RollingState:
    """The last ``keep`` rows of a segment; ``path`` (N + 1, n) is its open-loop run."""
    tail = table.rows(slice(table.n_rows - keep, None))
    tail = tail.replace(
        inputs={role: tail.inputs[role].copy() for role in experiment.roles},
        history=dict(zip(network.history_roles, experiment.outputs[-keep:].T.copy(), strict=True)),
    )
    begin = FilterStart(*(values[-keep].copy() for values in states.starts))
    opened = path[-keep - 1].copy()  # the last row of the path is one step after the table
    now, last = states.nodes[-1].copy(), experiment.inputs[-1].copy()
    return RollingState(tail, begin, opened, now, states.end, path[-2].copy(), path[-1].copy(), last)


def advance(model: Any, table: ZoneTable, kind: str = "input") -> np.ndarray:
    """Let a fitted identification follow new rows after the last known one, with what was measured as history.

    Returns the causal disturbance (n_rows, d) of each, [kW] or [K] by ``kind``.
    """
    model.filtered_network_, states, beyond = model.filtered_network_.advanced(table)
    return states.gain if checked_kind(kind) == "input" else beyond


def drive_on(model: Any, future: ZoneTable, disturbance: np.ndarray, kind: str = "input") -> np.ndarray:
    """(n_rows,) temperature [degC] of one measured node after the last known row, under a disturbance (n_rows,).

    ``kind="input"``: heat [kW] of the last known row and all others but the last; ``"output"``: [K] added to each row.
    """
    network = model.filtered_network_
    now, kalman, experiment = network.rolling, network.kalman, network.experiment(future)
    acting = experiment._replace(inputs=np.vstack([now.inputs, experiment.inputs[:-1]]))
    if checked_kind(kind) == "input":
        return kalman.drive(acting, 0, now.nodes, disturbance[:, None])[:, kalman.measured[0]]
    nothing = np.zeros((len(disturbance), kalman.n_gains))
    return kalman.drive(acting, 0, now.open_nodes, nothing)[:, kalman.measured[0]] + disturbance


def identify_again(model: Any, X: Any, y: Any) -> Any:
    """A copy of a fitted identification fitted to another table, from one start: the parameters that it has."""
    return clone(model).fit(X, y, theta_init={**model.theta_, **model.disturbance_})
