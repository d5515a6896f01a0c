"""The plant of a zone: which stages heat and cool, their capacities, and the table of a predicted load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from .setpoints import Limits


class Plant(NamedTuple):
    """Stages that heat and cool the zone, and their capacities."""

    heating: tuple[tuple[str, float], ...]  # (role, capacity [kW]) of the stages that heat
    cooling: tuple[tuple[str, float], ...]  # the same of those that cool, capacity < 0
    most: Mapping[str, float]  # highest stage of each role
    lower: float  # [kW], 0 or less; -inf where only the heat was measured
    upper: float  # [kW], 0 or more; inf where only the heat was measured

    def within(self, limits: Limits) -> Limits:
        """The narrower of given limits and the capacity of the stages."""
        return Limits(np.clip(limits.lower, self.lower, self.upper), np.clip(limits.upper, self.lower, self.upper))


def make_plant(capacity: Mapping[str, float], inputs: Mapping[str, np.ndarray]) -> Plant:
    """The plant of a training table, from the heat [kW] of each stage at 1, cooling negative.

    Stages reach 1 or the highest seen; measured heat sets no limit.
    """
    most = {role: max(1.0, float(inputs[role].max())) for role in capacity}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    beyond = np.inf if any(role.startswith("Q_") for role in inputs) else 0.0
    lower = sum(q * most[role] for role, q in cooling) - beyond
    upper = sum(q * most[role] for role, q in heating) + beyond
    return Plant(heating, cooling, most, lower, upper)


def is_plant(role: str) -> bool:
    """Whether a role is heating or cooling."""
    return role.startswith(("u_", "Q_"))


def load_frame(
    plant: Plant, index: pd.Index, clipped: np.ndarray, unclipped: np.ndarray, temperature: np.ndarray
) -> pd.DataFrame:
    """Heat [kW] and the stages [-] that deliver it, clipped to the plant and as the set-point would need.

    ``temperature`` (N,) [degC] is that at every row's stamp under the clipped load.
    """
    out: dict[str, np.ndarray] = {}
    for suffix, heat in (("", clipped), ("_unclipped", unclipped)):
        for side, stages in ((np.maximum, plant.heating), (np.minimum, plant.cooling)):
            full = sum(q * plant.most[role] for role, q in stages)
            for role, _ in stages:
                out[role + suffix] = np.abs(side(heat, 0.0) / full) * plant.most[role]
    out["Q_hvac"], out["Q_hvac_unclipped"], out["T_za"] = clipped, unclipped, temperature
    return pd.DataFrame(out, index=index)
