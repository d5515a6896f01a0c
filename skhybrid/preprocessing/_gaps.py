"""Transformer that fills short gaps in inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import OneToOneFeatureMixin

from .._table import checked_columns, is_history, is_set_point, listed, numeric, role_of
from .._time import duration_from_zero, read_index
from ._frames import TableTransformer, position_of


class GapFiller(OneToOneFeatureMixin, TableTransformer):
    """Fill short gaps in inputs and leave long gaps missing: set-points hold, all else is interpolated linearly.

    Parameters
    ----------
    max_gap : timedelta-like
        Longest gap to fill: the number of missing rows times the step.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps, which is refused without it.
    columns : mapping of role to column, optional
        As of the estimator: the columns of history, and of set-points, that have other names, such as
        ``{"T_za": "indoor"}``.

    Attributes
    ----------
    max_gap_ : Timedelta
    roles_ : dict of int to str
        Role of each column, by its position; the name of one without a role.
    n_features_in_, feature_names_in_ : int, ndarray of str

    Notes
    -----
    Interpolation uses the value after the gap.  That is no leak for inputs, which a forecast may know in advance, but
    it would be one for history: ``T_za``, ``T_za_<zone>`` and ``zeta`` are never filled (filters skip missing values).
    Gaps at either end of the table stay missing, as do those of columns that neither are numeric nor have a role.  Rows
    that are absent altogether are restored by :func:`skhybrid.datasets.regularize`.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid.preprocessing import GapFiller
    >>> log = pd.DataFrame({"T_oa": [1.0, None, 3.0]}, index=pd.date_range("2024-01-01", periods=3, freq="15min"))
    >>> GapFiller(max_gap="1h").fit_transform(log)["T_oa"].tolist()
    [1.0, 2.0, 3.0]
    """

    def __init__(
        self, max_gap: Any = "1h", sampling_time: Any = None, columns: Mapping[str, Any] | None = None
    ) -> None:
        self.max_gap = max_gap
        self.sampling_time = sampling_time
        self.columns = columns

    def _fit_table(self, table: pd.DataFrame) -> None:
        self.max_gap_ = duration_from_zero(self.max_gap, "max_gap")
        names = list(table.columns)
        self.roles_ = {j: str(name) for j, name in enumerate(names)}
        for role, column in checked_columns(self.columns).items():
            position = position_of(column, names)
            if position is None and column is not None:
                raise ValueError(f"columns= gives {role!r} the column {column!r}, but X has {listed(names)}.")
            if position is not None:
                self.roles_[position] = role

    def _transform_table(self, table: pd.DataFrame) -> pd.DataFrame:
        if isinstance(table.index, pd.DatetimeIndex):
            hours = stamp_hours(table.index)
        else:
            step = read_index(table.index, self.sampling_time, None, X=table)[0]
            hours = np.arange(len(table)) * (step / pd.Timedelta("1h"))
        filled = table.copy()
        for j, role in self.roles_.items():
            numbers = pd.api.types.is_numeric_dtype(table.dtypes.iloc[j]) or role_of(role)  # estimators read any type
            if numbers and not is_history(role):
                values = fill_gaps(numeric(table.iloc[:, j]), hours, self.max_gap_, hold=is_set_point(role))
                filled.isetitem(j, values)
        return filled


def stamp_hours(index: pd.DatetimeIndex) -> np.ndarray:
    """Hours since the first stamp, shape (n,); stamps that are out of order are refused."""
    if not index.is_monotonic_increasing:
        wrong = index.isna() | np.append(False, index[1:] < index[:-1])
        raise ValueError(
            f"the time stamps are not in order: row {int(np.argmax(wrong))} has {index[wrong][0]}; sort the rows by "
            "time and drop NaT, or localize the index if this is daylight saving."
        )
    ticks = index.as_unit("ns").asi8
    return (ticks - ticks[0]) / 3.6e12 if len(ticks) else np.zeros(0)


def fill_gaps(values: np.ndarray, hours: np.ndarray, max_gap: pd.Timedelta, *, hold: bool) -> np.ndarray:
    """(n,) values with gaps up to ``max_gap`` interpolated, or the last value held; a gap begins one step after it."""
    known = np.flatnonzero(np.isfinite(values))
    filled = values.astype(np.float64, copy=True)
    if len(known) < 2 or len(known) == len(values):
        return filled
    step = float(np.median(np.diff(hours)))
    missing = np.flatnonzero(np.isnan(values))
    after = np.searchsorted(known, missing)
    inside = (after > 0) & (after < len(known))
    missing, after = missing[inside], after[inside]
    length = hours[known[after]] - hours[known[after - 1]] - step
    short = length <= max_gap / pd.Timedelta("1h") + 1e-9
    last, rows = values[known[after - 1]], missing[short]
    filled[rows] = last[short] if hold else np.interp(hours[rows], hours[known], values[known])
    return filled
