"""Data of an identification: measurements, inputs in the order of the network, and the calendar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._calendar import clock_hour
from .._table import ZoneTable, as_pandas, listed, read_targets
from ..thermal import RCNetwork


class Experiment(NamedTuple):
    """Segments of consecutive rows, one after the other."""

    y: np.ndarray  # (N,) measured temperature [degC], NaN where missing; (N, o) of o measured nodes
    inputs: np.ndarray  # (N, m) in the order of ``network.inputs(roles)``, then the heat gains (0)
    roles: tuple[str, ...]
    hours: float  # the step [h]
    hour_of_day: np.ndarray  # (N,) int, local
    weekend: np.ndarray  # (N,) bool, local
    breaks: tuple[int, ...] = (0,)  # the first row of every segment

    @property
    def outputs(self) -> np.ndarray:
        """(N, o) measured temperatures [degC]."""
        return self.y[:, None] if self.y.ndim == 1 else self.y

    @property
    def firsts(self) -> np.ndarray:
        """(o,) the first measured temperature of every output [degC]; 20 where nothing was measured."""
        seen = [column[np.isfinite(column)] for column in self.outputs.T]
        return np.array([float(column[0]) if len(column) else 20.0 for column in seen])

    @property
    def segments(self) -> tuple[Experiment, ...]:
        """The segments, each an experiment of its own."""
        if len(self.breaks) == 1:
            return (self,)
        ends = (*self.breaks[1:], len(self.y))
        return tuple(self.rows(slice(a, b)) for a, b in zip(self.breaks, ends, strict=True))

    def rows(self, rows: slice) -> Experiment:
        """Some consecutive rows of one segment."""
        each = {name: getattr(self, name)[rows] for name in ("y", "inputs", "hour_of_day", "weekend")}
        return self._replace(breaks=(0,), **each)


def read_outputs(y: Any, table: ZoneTable, network: RCNetwork, *, max_missing: Any) -> np.ndarray:
    """(N,) measured temperature, or (N, o) by the names of roles or nodes from a frame, by order from an array."""
    roles, y = network.history_roles, as_pandas(y, "y")
    if isinstance(y, pd.DataFrame) and len(roles) > 1 and any(isinstance(column, str) for column in y.columns):
        y = temperatures_by_role(y, dict(zip(network.measured_names, roles, strict=True)))
    return read_targets(y, table, roles, max_missing=max_missing)


def temperatures_by_role(y: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The measured temperatures of a frame by role; its columns are roles, or the ``names`` of nodes or zones."""
    roles = list(names.values())
    named = y if set(roles) <= set(y.columns) else y.rename(columns=names)
    for name, role in names.items():
        if list(named.columns).count(role) != 1:
            raise ValueError(
                f"y needs exactly one column {role!r} or {name!r}; give {listed(roles)} or {listed(names)}, not "
                f"{listed(y.columns)}."
            )
    return named[roles]


def make_experiment(network: RCNetwork, roles: tuple[str, ...], table: ZoneTable, y: np.ndarray) -> Experiment:
    """The experiment of a table; ``roles`` that the table lacks act as 0."""
    acting = network.inputs(roles)
    inputs = np.zeros((table.n_rows, len(acting) + len(network.disturbed_nodes)))
    for j, role in enumerate(acting):
        inputs[:, j] = table.inputs[role]
    y, hour = np.asarray(y, dtype=np.float64), clock_hour(table.time)
    return Experiment(y, inputs, roles, table.step_hours, hour, table.weekend, table.breaks)
