"""Numbers that files and loggers write where nothing was measured, such as -9999."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._warnings import several

_CODES = (-999.0, -999.9, -9999.0, -9999.9, -99999.0, 999.0, 999.9, 9999.0, 9999.9, 99999.0)
_HUGE = 1e15  # beyond every quantity; NetCDF fills with 9.97e36
_FAR = 5.0  # times the range of all but the few largest and smallest of the others, from their middle
_NEVER_NEGATIVE = ("q_sol", "u_")


def fill_values(series: pd.Series, role: str, is_counter: bool) -> pd.Series:
    """Whether each value of a column is a code that is far from all others; those of a counter may come by."""
    values = series.to_numpy(dtype=np.float64)
    filled = np.abs(values) >= _HUGE
    codes = np.isin(values, _CODES)
    if codes.any() and not is_counter:
        others = values[np.isfinite(values) & ~codes & ~filled]
        low, middle, high = np.quantile(others, [0.01, 0.5, 0.99]) if len(others) else np.zeros(3)
        far = np.abs(values - middle) > _FAR * (high - low)
        filled |= codes & (far | ((values < 0.0) & role.startswith(_NEVER_NEGATIVE)))
    return pd.Series(filled, series.index)


def without_huge(series: pd.Series) -> pd.Series:
    """The values without those beyond every quantity."""
    return series.where(series.abs() < _HUGE)


def fill_remark(series: pd.Series, filled: pd.Series) -> str:
    """A remark on the values that are codes."""
    return f"{several(int(filled.sum()), 'value')} such as {series[filled.to_numpy()].iloc[0]:.6g} taken as missing"
