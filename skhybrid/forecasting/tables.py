"""Tables of a forecaster: the roles that it reads, and frames with the columns of its training table."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable, read_table
from .features import plant_roles

_INPUTS = re.compile(r"(T_oa|q_sol(_\w+)?|u_\w+|Q_\w+)\Z")
_WEATHER = re.compile(r"(T_oa|q_sol(_\w+)?)\Z")


def read_weather(forecaster: Any, X: Any, reset: bool) -> ZoneTable:
    """Read weather and history, and the plant where a case asks for it.

    Parameters
    ----------
    forecaster : DisturbanceForecaster
        With its ``case_``, None where it has none.
    X : DataFrame or array-like of shape (n_samples, n_features)
        The table.
    reset : bool
        Whether it is the training table.

    Raises
    ------
    ValueError
        If the table is refused (design 9), or a role that the case needs is missing.
    """
    case = forecaster.case_
    wanted = set(case.features) if case is not None else set()
    modes = bool(wanted & {"i_heat", "i_cool"})
    table = read_table(
        forecaster,
        X,
        columns=forecaster.columns,
        required=[role for role in ("T_oa", "q_sol") if role in wanted],
        needed=(_INPUTS if modes else _WEATHER).match,
        sampling_time=forecaster.sampling_time,
        default_step="1h",
        reset=reset,
        min_rows=2 if reset else 1,
        expected_step=None if reset else forecaster.sampling_time_,
    )
    if modes and reset and isinstance(X, pd.DataFrame | ZoneTable) and not plant_roles(table.inputs):
        there = X.roles if isinstance(X, ZoneTable) else X.columns
        raise ValueError(
            f"role 'u_heat', 'u_cool' or 'Q_hvac' is missing: this case reads i_heat and i_cool, and X has "
            f"{', '.join(map(repr, there))}."
        )
    return table


def as_fitted(frame: pd.DataFrame, names: Any, columns: Mapping[str, Any] | None) -> pd.DataFrame:
    """A frame with the columns of the training table; history that it lacks is NaN.

    Parameters
    ----------
    frame : DataFrame
        History or future.
    names : sequence of str or None
        Columns of the training table; None: it had no names.
    columns : mapping of role to column or None
        Names of roles.

    Raises
    ------
    ValueError
        If it is no DataFrame, or a column is missing that is not history.
    """
    if not isinstance(frame, pd.DataFrame):
        raise ValueError(f"history and future must be DataFrames, but one is a {type(frame).__name__}.")
    if names is None:
        return frame
    mapped = columns or {}
    optional = {mapped.get(role, role) for role in ("zeta", "T_za")}
    frame = frame.assign(**{name: np.nan for name in names if name in optional and name not in frame})
    absent = [name for name in names if name not in frame]
    if absent:
        raise ValueError(f"column {absent[0]!r} of the training table is missing; add it to history and future.")
    return frame[list(names)]
