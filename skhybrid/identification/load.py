"""The heating and cooling that holds a set-point (paper Eqs. inverseQ1 and inverseQ2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._contract import ZoneTable
from ..thermal import RCNetwork


class Plant(NamedTuple):
    """What heats and cools the zone, and how much of it there is."""

    heating: tuple[tuple[str, float], ...]  # (role, capacity [kW]) of the stages that heat
    cooling: tuple[tuple[str, float], ...]  # the same of those that cool, capacity < 0
    most: Mapping[str, float]  # highest stage of each role
    lower: float  # [kW], 0 or less; -inf where only the heat was measured
    upper: float  # [kW], 0 or more; inf where only the heat was measured

    def limited(self, limits: tuple[float, float] | None) -> Plant:
        """The same plant within other limits.

        Raises
        ------
        ValueError
            If the lower limit is not below the upper one.
        """
        if limits is None:
            return self
        lower, upper = float(limits[0]), float(limits[1])
        if not lower < upper:
            raise ValueError(f"limits=({lower}, {upper}) [kW]: the first is the lowest heat, below the second.")
        return self._replace(lower=lower, upper=upper)


def make_plant(network: RCNetwork, theta: Mapping[str, float], table: ZoneTable) -> Plant:
    """The plant of a training table: stages up to 1 or the highest seen; a measured heat tells of no limit."""
    capacity = {
        s.role: theta[s.parameter] for s in network.sources(table.inputs) if s.role.startswith("u_") and s.parameter
    }
    most = {role: max(1.0, float(table.inputs[role].max())) for role in capacity}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    beyond = np.inf if any(role.startswith("Q_") for role in table.inputs) else 0.0
    lower = sum(q * most[role] for role, q in cooling) - beyond
    upper = sum(q * most[role] for role, q in heating) + beyond
    return Plant(heating, cooling, most, lower, upper)


def is_plant(role: str) -> bool:
    """Whether a role is heating or cooling."""
    return role.startswith(("u_", "Q_"))


def read_setpoint(setpoint: Any, table: ZoneTable) -> np.ndarray:
    """The set-point at the end of every row's step, (N,) [degC].

    Raises
    ------
    ValueError
        If it has another length or other stamps than X, or a NaN.
    """
    if isinstance(setpoint, pd.Series) and isinstance(table.index, pd.DatetimeIndex):
        if not setpoint.index.equals(table.index):
            raise ValueError("setpoint bears other time stamps than X; align it with setpoint.reindex(X.index).")
        setpoint = setpoint.to_numpy(dtype=np.float64)
    wanted = np.asarray(setpoint, dtype=np.float64)
    if wanted.ndim == 0:
        wanted = np.full(table.n_rows, float(wanted))
    if wanted.shape != (table.n_rows,):
        raise ValueError(f"setpoint has shape {wanted.shape}, but X has {table.n_rows} rows; give one value a row.")
    if not np.isfinite(wanted).all():
        row = int(np.argmax(~np.isfinite(wanted)))
        raise ValueError(f"setpoint contains NaN or inf (first at {table.index[row]}); fill it first.")
    return np.append(wanted[1:], wanted[-1])


def load_frame(plant: Plant, index: pd.Index, clipped: np.ndarray, unclipped: np.ndarray) -> pd.DataFrame:
    """Heat [kW] and the stages [-] that deliver it, clipped to the plant and as the set-point would need."""
    out: dict[str, np.ndarray] = {}
    for suffix, heat in (("", clipped), ("_unclipped", unclipped)):
        for side, stages in ((np.maximum, plant.heating), (np.minimum, plant.cooling)):
            wanted = side(heat, 0.0)
            full = sum(q * plant.most[role] for role, q in stages)
            for role, _ in stages:
                out[role + suffix] = wanted / full * plant.most[role]
    out["Q_hvac"], out["Q_hvac_unclipped"] = clipped, unclipped
    return pd.DataFrame(out, index=index)
