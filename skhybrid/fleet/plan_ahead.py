"""The plan of a zone's plant in the rows that a tick forecasts."""

from __future__ import annotations

from typing import Any

import pandas as pd

from .._table import SETPOINT_ROLES, listed, plant_roles
from ..hybrid.base import BaseHybrid


def refuse_without_plan(model: Any, future: pd.DataFrame, now: pd.Timestamp) -> None:
    """Refuse rows after ``now`` that do not say what the plant does: a tick is given no set-points beside them."""
    if not isinstance(model, BaseHybrid) or model.preprocess is not None:
        return
    names = dict(model.columns or {})
    plant = [names.get(role, role) for role in plant_roles(model.training_.ranges)]
    absent = [column for column in plant if column not in future]
    held = [column for role in SETPOINT_ROLES if (column := names.get(role, role)) in future]
    learned = model.thermostat_learned_
    if not absent or (learned and held and absent == plant) or names.get("T_oa", "T_oa") not in future:
        return  # the last are columns by position
    instead = "set-points" if learned else "fit the zone again on a week or more of rows with heat and set-points"
    raise ValueError(f"nothing says what the plant does after {now}: fill in {listed(absent)} there, or {instead}.")
