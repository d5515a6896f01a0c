"""Rows of a building as the predictors of its zones read them: parsed once for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..._ranges import is_in_watts
from ..._table import HISTORY_ROLES, SETPOINT_ROLES, ZoneTable
from ..._warnings import raise_warning, warnings_to
from ...exceptions import SkhybridWarning
from ..base import BaseHybrid
from .zone_columns import NEXT, ZoneColumns


def tables_of_zones(
    models: Mapping[str, BaseHybrid], columns: ZoneColumns, X: Any, *, measured: bool = False
) -> dict[str, ZoneTable] | None:
    """Each zone's table of rows that follow the known ones, without its neighbours' temperatures.

    None where the rows are not read by name, or something in them is refused or warned of: each zone's predictor then
    reads them itself, so that the message names its columns.  With ``measured`` every zone must
    have a column of its temperature.
    """
    first = next(iter(models.values()))
    if not isinstance(X, pd.DataFrame) or not hasattr(first, "feature_names_in_"):
        return None
    past = [role for role in columns.columns if columns.is_history(role)]
    try:
        with warnings_to(raise_warning):
            whole = first._read_building(X, columns.columns, (*HISTORY_ROLES, *SETPOINT_ROLES, *past))
    except (ValueError, SkhybridWarning):
        return None
    role_of = {column: role for role, column in columns.columns.items()}
    tables = {zone: model._part_of_zone(whole, role_of) for zone, model in models.items()}
    if measured and not all("T_za" in table.history for table in tables.values()):
        return None
    for zone, table in tables.items():
        trained = models[zone].training_.ranges
        if any(role.startswith("Q_") and is_in_watts(v, trained.get(role)) for role, v in table.inputs.items()):
            return None
    return tables


def with_neighbour_temperatures(table: ZoneTable, T: Mapping[str, np.ndarray]) -> ZoneTable:
    """A zone's table with temperatures (n,) of its neighbours as boundaries."""
    if not T:
        return table
    return table.replace(inputs={**table.inputs, **{NEXT + zone: values for zone, values in T.items()}})
