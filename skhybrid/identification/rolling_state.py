"""An identified network row by row: its filter goes on with new rows, and a forecast starts where it stands."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from sklearn.base import clone

from .._table import ZoneTable
from .experiment import Experiment
from .filtered_network import FilteredNetwork, checked_kind
from .gain_filter import FilteredStates, FilterStart
from .gain_model import profile_cell


class RollingState(NamedTuple):
    """Where the filter and the open loop stand."""

    nodes: np.ndarray  # (n,) filtered node temperatures at the last known row [degC]
    ahead: FilterStart  # what is known of the row behind it
    open_nodes: np.ndarray  # (n,) node temperatures at the last known row by the inputs alone [degC]
    open_ahead: np.ndarray  # (n,) the same of the row behind it
    inputs: np.ndarray  # (m,) of the last known row, which act until the next one


def advance(model: FilteredNetwork, table: ZoneTable, kind: str = "input") -> np.ndarray:
    """Take rows into the state of a fitted model, in a time that does not depend on what came before them.

    Parameters
    ----------
    model : FilteredNetwork
        Its kept tail becomes the last of the rows.
    table : ZoneTable
        Rows that follow the last known one, with what was measured as history.
    kind : {"input", "output"}

    Returns
    -------
    ndarray of shape (n_rows, d)
        The disturbance of each row, causal, as :meth:`estimate_disturbance` gives it.
    """
    now = rolling_state(model)
    experiment, tracker = model._experiment(table), model._filter
    track, path = _follow(model, experiment, now.ahead, now.open_ahead)
    last = table.rows(slice(table.n_rows - 1, None))
    last = last.replace(
        inputs={role: last.inputs[role].copy() for role in model._roles},
        history={role: last.history[role].copy() for role in model.network_.history_roles if role in last.history},
    )
    means, covariances = track.starts
    model._tail, model._tail_open = last, path[-2].copy()
    model._tail_start = FilterStart(means[-1].copy(), covariances[-1].copy())
    model._rolling_state = RollingState(
        track.nodes[-1].copy(), track.end, path[-2], path[-1], experiment.inputs[-1].copy()
    )
    if checked_kind(kind) == "input":
        return track.gain
    return experiment.outputs - path[:-1, tracker.measured]


def rolling_state(model: FilteredNetwork) -> RollingState:
    """Where a fitted model stands: behind its training table, or the rows that it was advanced by."""
    known = getattr(model, "_rolling_state", None)
    if known is not None:
        return known
    tail = model._tail
    experiment = model._experiment(tail)
    track, path = _follow(model, experiment, model._tail_start, model._tail_open)
    return RollingState(track.nodes[-1], track.end, path[-2], path[-1], experiment.inputs[-1])


def _follow(
    model: FilteredNetwork, experiment: Experiment, start: FilterStart, open_start: np.ndarray
) -> tuple[FilteredStates, np.ndarray]:
    """The filter over some rows, and the (N + 1, n) node temperatures by the inputs alone."""
    cells = profile_cell(experiment.hour_of_day, experiment.weekend)
    track = model._filter.track(experiment, cells, model._filter.classes[cells], start)
    return track, model._open_loop(experiment, open_start)


def drive_on(model: FilteredNetwork, future: ZoneTable, disturbance: np.ndarray, kind: str = "input") -> np.ndarray:
    """Forecast the rows behind the last known one under a given disturbance, as ``drive`` does from any origin.

    Parameters
    ----------
    model : FilteredNetwork
        With one measured and one disturbed node.
    future : ZoneTable
        The rows, with their known inputs.
    disturbance : ndarray of shape (n_rows,)
        ``kind="input"``: heat [kW] of the last known row, then of all rows but the last; ``"output"``: temperature [K]
        added to each row.
    kind : {"input", "output"}

    Returns
    -------
    ndarray of shape (n_rows,)
        Temperature of the measured node [degC].
    """
    now, tracker = rolling_state(model), model._filter
    experiment = model._experiment(future)
    acting = experiment._replace(inputs=np.vstack([now.inputs, experiment.inputs[:-1]]))
    inward = checked_kind(kind) == "input"
    heat = disturbance[:, None] if inward else np.zeros((len(disturbance), tracker.n_gains))
    path = tracker.drive(acting, 0, now.nodes if inward else now.open_nodes, heat)[:, tracker.measured[0]]
    return path if inward else path + disturbance


def identify_again(model: Any, X: Any, y: Any) -> Any:
    """A copy of a fitted identification fitted to another table, from one start: the parameters that it has.

    Parameters
    ----------
    model : fitted identification
    X, y : as in ``fit``

    Returns
    -------
    fitted identification
    """
    again = clone(model)
    again._begin = {**model.theta_, **model.disturbance_}
    return again.fit(X, y)
