"""Checks of a target: enough of it, the rows of its table, the same quantity, and not among the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ._arguments import is_number
from ._time import same_stamps
from ._warnings import percent, warn_user
from .exceptions import ExcitationWarning, SkhybridWarning, UnitWarning

#: ``max_missing`` of rows that are taken in without learning, and of rows that forecasts are scored by
UNLIMITED, SCORED = object(), object()
#: for so long no room has one temperature, whatever the resolution of its sensor
_STILL = pd.Timedelta("1D")
#: largest usual difference between the history in X and y [degC]: two sensors of one zone
_MOST_APART = 5.0
#: rows from which on it is no coincidence how alike two columns are
_ENOUGH_ROWS = 24
#: distinct values from which on it is no coincidence that an input equals y
_ENOUGH_VALUES = 5
#: share of equal rows from which on two columns are the same, and by how much their values may differ
_ALIKE, _ROUNDING = 0.95, 1e-6


def refuse_order(given: pd.Index, index: pd.Index) -> None:
    """Refuse a y whose index says that its rows are not those of X, by position."""
    if same_stamps(given, index):
        return
    if isinstance(given, pd.DatetimeIndex) and isinstance(index, pd.DatetimeIndex):
        raise ValueError(
            f"X and y have different time stamps (X from {index[0]} to {index[-1]}, y from {given[0]} to {given[-1]}); "
            "align them first."
        )
    numbered, timed = pd.api.types.is_numeric_dtype(given), (pd.DatetimeIndex, pd.PeriodIndex, pd.TimedeltaIndex)
    if (numbered or isinstance(given, timed)) and not given.is_monotonic_increasing:
        numbers = given.to_numpy()
        row = int(np.argmax(numbers[1:] < numbers[:-1]))
        raise ValueError(
            f"the rows of y are not in time order: index {given[row]} is followed by {given[row + 1]}; bring them into "
            "the order of X, such as with y.sort_index()."
        )
    counted = any(rows.equals(pd.RangeIndex(len(rows))) for rows in (given, index))
    if numbered == pd.api.types.is_numeric_dtype(index) and not counted:
        first = [str(rows[0]) if numbered else repr(rows[0]) for rows in (index, given)]
        raise ValueError(
            f"X and y have different indices (X from {first[0]}, y from {first[1]}); align them with "
            "y.reindex(X.index), or give y the index of X."
        )


def refuse_other_quantity(history: np.ndarray, y: np.ndarray, role: str, *, scores: bool = False) -> None:
    """Refuse a history in X (n,) that is not y (n,): another unit, scaled, of other rows or of other times.

    Where one only ``scores``, other rows are a warning: the importance of the history is measured by permuted ones.
    """
    both = np.isfinite(history) & np.isfinite(y)
    if not both.any():
        return
    known, wanted = history[both], y[both]
    means = f"role {role!r} of X and y are not the same quantity: {role} is {known.mean():.4g} on average, y "
    means += f"{wanted.mean():.4g}"
    most = _MOST_APART if role.startswith("T_") else _MOST_APART * max(min(np.std(known), np.std(wanted)), 0.1)
    if np.median(np.abs(known - wanted)) > most:
        raise ValueError(f"{means}; {_cause(known, wanted, role)}.")
    if len(known) < _ENOUGH_ROWS or np.ptp(wanted) == 0:
        return
    for earlier, later, word in ((history, y, "later"), (y, history, "earlier")):
        if np.array_equal(earlier[:-1], later[1:], equal_nan=True) and not np.array_equal(known, wanted):
            raise ValueError(
                f"role {role!r} of X is y one row {word}; the values of a row in both belong to its own stamp, so give "
                "them unshifted."
            )
    together = np.corrcoef(known, wanted)[0, 1] if np.ptp(known) > 0 else 0.0
    if np.std(known - wanted) > 0.9 * np.std(wanted) and together < 0.3:
        text = f"{means}, but they do not move together; give both the same rows in the same order."
        if not scores:
            raise ValueError(text)
        warn_user(text, SkhybridWarning)


def same_values(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two columns (n,) are equal in nearly all rows where both are measured."""
    both = np.isfinite(one) & np.isfinite(other)
    equal = both & (np.abs(np.where(both, one - other, np.inf)) <= _ROUNDING)
    return bool(equal.sum() >= _ALIKE * both.sum() and len(np.unique(other[equal])) >= _ENOUGH_VALUES)


def refuse_exchanged(history: Mapping[str, np.ndarray], y: Mapping[str, np.ndarray]) -> None:
    """Refuse targets (n,) of zones of which one is the history (n,) of another zone, and not its own."""
    for zone, wanted in y.items():
        if zone not in history or same_values(history[zone], wanted):
            continue
        others = [other for other in history if other != zone and other in y and same_values(history[other], wanted)]
        if others:
            raise ValueError(
                f"y of {zone!r} is what X has measured in {others[0]!r}, and not in {zone!r} itself: give y as a "
                "DataFrame with the column of each zone under its name."
            )


def _cause(known: np.ndarray, wanted: np.ndarray, role: str) -> str:
    """Why two measurements differ, and what to do."""
    if not role.startswith("T_"):
        return "give both in kW, and unscaled"
    for unit, scale, offset in (("degF", 1.8, 32.0), ("K", 1.0, 273.15)):
        for name, a, b in ((role, known, wanted), ("y", wanted, known)):
            if np.median(np.abs(a - (scale * b + offset))) < 1.0:
                return f"likely {name} is in {unit}; convert it with skhybrid.preprocessing.UnitConverter"
    return (
        "give both in degC and leave them unscaled (no StandardScaler, no TransformedTargetRegressor): the estimators "
        "scale what they need to"
    )


def refuse_target_among(inputs: Mapping[str, np.ndarray], y: np.ndarray, *, columns: Mapping[str, int] | None) -> None:
    """Refuse an input (n,) that is y (n,); in an array, of which ``columns`` are the positions, scaled or not."""
    for role, values in inputs.items():
        if is_target(values, y, scaled=columns is not None):
            where = f"column {columns[role]} of X, taken as {role!r}," if columns else f"column {role!r} of X"
            remedy = f"columns={{'T_za': {columns[role]}}}" if columns else f"columns={{'T_za': {role!r}}}"
            raise ValueError(
                f"{where} is y itself, scaled or not, which no forecast knows ahead; keep the names of the columns "
                f"in the steps before (.set_output(transform='pandas')), or pass {remedy}."
            )


def warn_if_temperature(history: Mapping[str, np.ndarray], y: np.ndarray) -> None:
    """Warn of a disturbance y (n,) that is the measured temperature of X."""
    if "T_za" in history and is_target(history["T_za"], y, scaled=False):
        warn_user(
            "y is the temperature T_za of X, where the disturbance is expected; give that, such as "
            "estimate_disturbance(X) of an identification; HybridPredictor and ARXRegressor forecast temperatures.",
            UnitWarning,
        )


def warn_if_still(y: np.ndarray, step: pd.Timedelta) -> None:
    """Warn of a temperature (n,) that never changes, from which nothing can be learned."""
    known = y[np.isfinite(y)]
    if len(known) >= _ENOUGH_ROWS and len(known) * step >= _STILL and np.ptp(known) == 0:
        warn_user(
            f"y is {known[0]:.4g} in all {len(known)} measured rows: is the sensor stuck? Nothing can be learned from "
            "them; give rows in which it worked.",
            ExcitationWarning,
        )


def is_target(values: np.ndarray, y: np.ndarray, *, scaled: bool) -> bool:
    """Whether values (n,) are y (n,), or ``scaled`` a multiple of it and an offset, wherever both are known."""
    both = np.isfinite(values) & np.isfinite(y)
    known, wanted = values[both], y[both]
    if len(wanted) < _ENOUGH_ROWS or not (scaled or np.array_equal(known, wanted)):
        return False
    return len(np.unique(wanted)) >= _ENOUGH_VALUES and (not scaled or _scaled(known, wanted))


def _scaled(values: np.ndarray, wanted: np.ndarray) -> bool:
    """Whether values (n,) are a multiple of others, and an offset."""
    v, w = values - values.mean(), wanted - wanted.mean()
    scale = (v @ w) / (w @ w)
    return bool(scale and np.abs(v - scale * w).max() <= 1e-6 * np.abs(v).max())


def read_max_missing(most: Any) -> float:
    """Share of the rows of a target that may be missing."""
    if not is_number(most) or not 0.0 <= most <= 1.0:
        raise ValueError(f"max_missing={most!r} must be a share of the rows, from 0 to 1.")
    return float(most)


def refuse_missing(target: np.ndarray, max_missing: Any) -> None:
    """Refuse a target of which all, or more than ``max_missing``, is missing."""
    most = read_max_missing(max_missing)
    missing = float(np.isnan(target).mean()) if len(target) else 1.0
    if missing == 1.0 or missing > most:
        allowed = "" if missing == 1.0 else f", more than max_missing={most:g}"
        raise ValueError(
            f"Input y contains NaN in {percent(missing)} of its rows{allowed}; choose a span with more measurements."
        )
