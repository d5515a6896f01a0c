"""Tables of a forecaster: the roles that it reads."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd

from .._joining import from_first_measured
from .._table import ZoneTable, as_pandas, read_table, read_target
from .._time import FEW_DAYS, rows_per_day
from .._warnings import warn_user
from ..exceptions import ExcitationWarning
from .features import mode_roles

_INPUTS = re.compile(r"(T_oa|q_sol(_\w+)?|u_\w+|Q_\w+)\Z")
_WEATHER = re.compile(r"(T_oa|q_sol(_\w+)?)\Z")


def read_case_inputs(forecaster: Any, X: Any, *, reset: bool) -> ZoneTable:
    """Read weather and history, and the plant where the forecaster's ``case_`` asks for it."""
    X, case = as_pandas(X), forecaster.case_
    wanted = set(case.features) if case is not None else set()
    modes = bool(wanted & {"i_heat", "i_cool"})
    table = _read(
        forecaster,
        X,
        reset=reset,
        fewest=2,
        required=[role for role in ("T_oa", "q_sol") if role in wanted],
        needed=(_INPUTS if modes else _WEATHER).match,
    )
    if modes and reset and isinstance(X, pd.DataFrame | ZoneTable) and not mode_roles(table.inputs):
        there = X.roles if isinstance(X, ZoneTable) else X.columns
        raise ValueError(
            f"role 'u_heat', 'u_cool' or 'Q_hvac' is missing: this case reads i_heat and i_cool, and X has "
            f"{', '.join(map(repr, there))}."
        )
    return table


def read_zone(forecaster: Any, X: Any) -> ZoneTable:
    """Read all inputs of a fitted forecaster of the temperature, and its history."""
    return _read(forecaster, X, reset=False, fewest=3)


def read_training(forecaster: Any, X: Any, y: Any) -> tuple[ZoneTable, np.ndarray]:
    """Rows that a forecaster of the temperature is fitted on, from a first measured one on, and their temperature.

    It is warned of a few rows, but not within another model, which tells its user itself.
    """
    table = _read(forecaster, X, reset=True, fewest=3)
    if table.n_rows * table.step < FEW_DAYS and not isinstance(X, ZoneTable):
        warn_user(
            f"{type(forecaster).__name__}: {table.n_rows * table.step_hours:g} h of rows are few, so that forecasts "
            "are a guess; add days.",
            ExcitationWarning,
        )
    T = read_target(y, table, max_missing=forecaster.max_missing, role="T_za")
    return from_first_measured(table, T, rows_per_day(table.step))


def _read(forecaster: Any, X: Any, *, reset: bool, fewest: int, **selected: Any) -> ZoneTable:
    """Read the selected roles by the forecaster's own settings, of at least ``fewest`` rows in ``fit``."""
    return read_table(
        forecaster,
        X,
        columns=forecaster.columns,
        sampling_time=forecaster.sampling_time,
        reset=reset,
        min_rows=fewest if reset else 1,
        expected_step=None if reset else forecaster.sampling_time_,
        holidays=forecaster.holidays,
        **selected,
    )
