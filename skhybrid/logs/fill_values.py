"""Numbers where nothing was measured, such as -9999 and 85 degC, and blanks where an input is 0."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._ranges import range_of, single_leaps
from .._table import SETPOINT_ROLES
from .counters import usual_peak
from .even_steps import typical_step

_CODES = (-999.0, -999.9, -9999.0, -9999.9, -99999.0, 999.0, 999.9, 9999.0, 9999.9, 99999.0)
_REGISTER = (65535.0, 32767.0, -32768.0)  # ends of the range of 16 bits, which meters show where they have no value
_DECIMALS = (1.0, 10.0, 100.0, 1000.0)  # by which a register is divided; by the last of W in kW alone
_ABOVE = 1.5  # times all but the few largest of the others, beyond which an end of a register is none of them
HUGE = 1e15  # beyond every quantity; NetCDF fills with 9.97e36
_FAR = 5.0  # times the range of all but the few largest and smallest of the others, from their middle
_NEVER_NEGATIVE = ("q_sol", "u_")
_FARTHEST = 30.0  # air does not leave nine tenths of its other temperatures by more [K]
_FEW_CODES = 2  # a failed sensor shows one value, or two by turns
_NEAR = 2.0  # of the usual temperatures, which values are in that are degF [K]
_SPIKE, _LEAST_SPIKE = 20.0, 20.0  # times the usual peak of heat, and kW, beyond which a meter has failed
_FAR_FROM_ZERO = 5.0  # no temperature falls to exactly 0 that is else above this [degC]
#: inputs that a plant that is off, and the sun at night, leave blank
_ZERO = ("q_sol", "u_", "Q_")
_BLANK = 0.2  # share of the rows of the log that are blank, at least
_ZEROS = 0.02  # share of the values that are 0, at most
_BESIDE = 0.9  # share of the values that have a temperature beside them, at least
_SPELLS = 0.5  # blanks per day that has values, at least: an outage does not come so often
_FEWEST = 20  # values


def fill_values(series: pd.Series, role: str, is_counter: bool) -> pd.Series:
    """Whether each value of a column is a code that is far from all others; those of a counter may come by."""
    values = series.to_numpy(dtype=np.float64)
    filled = np.abs(values) >= HUGE
    codes = np.isin(values, _CODES)
    registers = np.isin(values, np.divide.outer(_REGISTER, _DECIMALS if role.startswith("Q_") else _DECIMALS[:-1]))
    if (codes | registers).any() and not is_counter:
        others = values[np.isfinite(values) & ~codes & ~registers & ~filled]
        low, middle, high = np.quantile(others, [0.01, 0.5, 0.99]) if len(others) else np.zeros(3)
        far = np.abs(values - middle) > _FAR * (high - low)
        filled |= registers & (np.abs(values) > _ABOVE * np.quantile(np.abs([*others, 0.0]), 0.99))
        filled |= codes & (far | ((values < 0.0) & role.startswith(_NEVER_NEGATIVE)))
    return pd.Series(filled, series.index)


def sensor_failures(values: np.ndarray, role: str) -> np.ndarray:
    """Whether each value (n,) is one that only a failed sensor shows: air of 85 degC or 0, a spike."""
    known = np.isfinite(values)
    if role.startswith(("T_za", "T_oa", *SETPOINT_ROLES)) and known.any():
        return _failed_temperatures(values, known, role)
    moving = known & (values != 0.0)
    if not role.startswith(("q_sol", "Q_")) or not moving.any():
        return np.zeros(len(values), dtype=bool)
    usual, sizes = usual_peak(np.abs(values[moving])), np.abs(values)
    if role.startswith("q_sol"):
        return (sizes > range_of(role).highest) & bool(usual <= range_of(role).highest)
    return sizes > max(_SPIKE * usual, _LEAST_SPIKE)


def _failed_temperatures(values: np.ndarray, known: np.ndarray, role: str) -> np.ndarray:
    """Temperatures (n,) [degC] far from the others, or 0 among others that are never near it.

    Values that move, and those that are usual ones in degF, are of another unit.  A heating set-point of 0 is off.
    """
    low, high = np.quantile(values[known], [0.1, 0.9])
    celsius = (values - 32.0) / 1.8
    far = (values < low - _FARTHEST) | (values > high + _FARTHEST)
    far &= (celsius < low - _NEAR) | (celsius > high + _NEAR)
    spells = np.cumsum(np.diff(far, prepend=False))
    failed = far & (pd.Series(values).groupby(spells).transform("nunique").to_numpy() <= _FEW_CODES)
    zero = (values == 0.0) & (role.partition("_set")[0] != "T_heat")
    others = values[known & ~failed & ~zero]
    failed |= zero & bool(len(others) and others.min() > _FAR_FROM_ZERO)
    return failed | (single_leaps(np.where(failed, np.nan, values)) if role.startswith("T_za") else False)


def zeros_left_blank(frame: pd.DataFrame, role: str) -> np.ndarray:
    """Whether a role is blank in each row because it is 0: often blank beside a temperature, and else never 0.

    A role that is logged less often than the temperature is blank for another reason.
    """
    beside = next((name for name in frame if str(name).startswith("T_za")), "T_oa")
    index, values = pd.DatetimeIndex(frame.index), frame[role].to_numpy()
    known, none = np.isfinite(values), np.zeros(len(frame), dtype=bool)
    if not role.startswith(_ZERO) or beside not in frame or known.sum() < _FEWEST or not index.is_monotonic_increasing:
        return none
    measured = frame[beside].notna().to_numpy()
    blank = measured & ~known
    spells = (np.diff(blank.astype(np.int8), prepend=0) > 0).sum()
    often = blank.sum() >= _BLANK * measured.sum() and spells >= _SPELLS * index[known].normalize().nunique()
    never = (values[known] == 0.0).mean() < _ZEROS
    if not (often and never and (known & measured).sum() >= _BESIDE * known.sum()):
        return none
    return blank if typical_step(index[known]) <= typical_step(index[measured]) else none
