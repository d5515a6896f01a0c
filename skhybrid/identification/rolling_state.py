"""Rolling state of an identified network: it follows new rows, and forecasts start from the last one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from sklearn.base import clone

from .._table import ZoneTable
from ..thermal import RCNetwork
from .disturbance_models import checked_kind
from .experiment import Experiment
from .gain_filter import FilteredStates, FilterStart


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
