"""Tables of a building, read once for the predictors of all zones, and messages that name the zone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pandas as pd

from ..._ranges import is_in_watts
from ..._table import HISTORY_ROLES, SETPOINT_ROLES, ZoneTable
from ..._warnings import raise_warning, warn_once, warnings_of_zone, warnings_to
from ...exceptions import SkhybridWarning
from ..base import BaseHybrid
from .zone_columns import NEXT, ZoneColumns


@contextmanager
def of_zone(zone: str) -> Iterator[None]:
    """Name the zone in errors and warnings of its predictor."""
    try:
        with warnings_of_zone(zone):
            yield
    except ValueError as error:
        raise type(error)(f"zone {zone!r}: {error}") from None


def warn_of_usual(model: BaseHybrid) -> None:
    """Warn, once per fit, of a plant that is forecast without set-points."""
    if model._has_usual_plant:
        warn_once(
            "no thermostat was learned, as the training had no set-points or the plant never ran: heat and temperature "
            "are forecast as they usually were at that hour and in that weather.",
            SkhybridWarning,
            model.training_,
        )


def with_next(X: pd.DataFrame, T: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """X with temperatures (n,) of zones as boundaries of their neighbours."""
    return X.assign(**{NEXT + zone: values for zone, values in T.items()})


def tables_of_zones(
    models: Mapping[str, BaseHybrid], columns: ZoneColumns, X: Any, *, measured: bool = False
) -> dict[str, ZoneTable] | None:
    """Each zone's table of rows that follow the known ones, without its neighbours' temperatures.

    None where the rows are not read by name, or something in them is refused or warned of: each zone's predictor then
    reads them itself, so that the message names its columns.  With ``measured`` every zone must have a column of its
    temperature.
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


def arrays_by_name(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    """The columns of a frame by name."""
    return {str(name): values.to_numpy() for name, values in frame.items()}
