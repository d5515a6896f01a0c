"""What an identification sees: measurements, inputs in the order of the network, and the calendar."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._contract import ZoneTable
from ..thermal import RCNetwork


class Experiment(NamedTuple):
    """One stretch of consecutive rows."""

    y: np.ndarray  # (N,) measured temperature [degC], NaN where missing
    inputs: np.ndarray  # (N, m) in the order of ``network.inputs(roles)``, then the heat gain (0)
    roles: tuple[str, ...]
    hours: float  # the step [h]
    hour_of_day: np.ndarray  # (N,) int, local
    weekend: np.ndarray  # (N,) bool, local

    @property
    def first(self) -> float:
        """The first measured temperature [degC]; 20 where nothing was measured."""
        seen = self.y[np.isfinite(self.y)]
        return float(seen[0]) if len(seen) else 20.0


def make_experiment(network: RCNetwork, roles: tuple[str, ...], table: ZoneTable, y: np.ndarray) -> Experiment:
    """The experiment of a table; ``roles`` that the table lacks act as 0."""
    return Experiment(
        np.asarray(y, dtype=np.float64),
        input_matrix(network, roles, table),
        roles,
        table.step_hours,
        table.time.hour.to_numpy(dtype=np.int64),
        np.asarray(table.time.day_of_week >= 5),
    )


def input_matrix(network: RCNetwork, roles: tuple[str, ...], table: ZoneTable) -> np.ndarray:
    """(N, m) inputs in the order of the network, the heat gain column (0) last."""
    acting = network.inputs(roles)
    out = np.zeros((table.n_rows, len(acting) + 1))
    for j, role in enumerate(acting):
        out[:, j] = table.inputs[role]
    return out
