"""Inputs that are blank where they are 0: a plant that is off, and the sun at night."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .even_steps import typical_step

_ZERO = ("q_sol", "u_", "Q_")
_BLANK = 0.2  # share of the rows of the log that are blank, at least
_ZEROS = 0.02  # share of the values that are 0, at most
_BESIDE = 0.9  # share of the values that have a temperature beside them, at least
_SPELLS = 0.5  # blanks per day that has values, at least: an outage does not come so often
_FEWEST = 20  # values


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
