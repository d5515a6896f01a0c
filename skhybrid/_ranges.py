"""Physical ranges of the roles: values that cannot be are refused, values that are unlikely are warned of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from ._warnings import several, warn_user
from .exceptions import UnitWarning


class PhysicalRange(NamedTuple):
    """Possible and usual values of a quantity, in its unit."""

    unit: str
    lowest: float
    highest: float
    usual_lowest: float
    usual_highest: float
    others: tuple[OtherUnit, ...]


class OtherUnit(NamedTuple):
    """A unit that a whole column may be in by mistake, and what its values are then."""

    name: str
    lowest: float
    highest: float
    least_maximum: float = -np.inf  # a column with a lower maximum is not in this unit

    def fits(self, low: float, high: float) -> bool:
        return self.lowest <= low and self.least_maximum <= high <= self.highest


_KELVIN = OtherUnit("K rather than degC", 173.0, 333.0)
_FAHRENHEIT = OtherUnit("degF rather than degC", -130.0, 140.0)
_WATT = (OtherUnit("W rather than kW", -5e6, 5e6),)
_PER_AREA = (OtherUnit("W/m2 rather than kW/m2", -50.0, 1600.0, 20.0),)
_PERCENT = (OtherUnit("percent rather than a fraction or stage", -5.0, 105.0),)
_ROOM = PhysicalRange("degC", -30.0, 60.0, -10.0, 55.0, (_FAHRENHEIT, _KELVIN))
#: beginning of a role -> its range; the first that fits holds
RANGES: dict[str, PhysicalRange] = {
    "T_za": _ROOM,
    "T_heat_set": _ROOM,
    "T_cool_set": _ROOM,
    "T_oa": PhysicalRange("degC", -90.0, 60.0, -60.0, 55.0, (_FAHRENHEIT, _KELVIN)),
    "T_": PhysicalRange("degC", -90.0, 200.0, -60.0, 55.0, (_FAHRENHEIT, _KELVIN)),  # hot water and steam too
    "q_sol": PhysicalRange("kW/m2", -0.05, 1.6, -0.05, 1.6, _PER_AREA),
    "u_": PhysicalRange("-", -0.05, 10.0, -0.05, 4.0, _PERCENT),  # plants of several stages count them
    "Q_": PhysicalRange("kW", -5e3, 5e3, -5e3, 5e3, _WATT),
    "zeta": PhysicalRange("kW", -5e3, 5e3, -5e3, 5e3, _WATT),
}
#: fill values of loggers and file formats
_FILL_VALUES = (-999.0, -999.9, -9999.0, -99999.0, 9999.0, 99999.0)
_LEAST_FILL = min(map(abs, _FILL_VALUES))
#: beyond every unit that any role is logged in: refused even where no role was named
_BEYOND_UNITS = 900.0
#: least share of the values other than 0, and least number of rows, to be taken for a unit and not for a failed sensor
_LEAST_SHARE, _LEAST_ROWS = 0.05, 4
#: a temperature that is otherwise above this is never exactly 0 [degC]
_FAR_FROM_ZERO = 5.0
#: of one temperature of a room, and back [K], and the share of its values, at most, that so leap
_LEAP, _FEW_LEAPS = 10.0, 0.01
#: no building is that warm all the time [degC]
_WARMEST_MEDIAN = 42.0
#: no zone takes more than a large hall does while its plant runs [kW], by the median, or has so much unmeasured heat
_MOST_HEAT = 400.0
#: no zone has so much unmeasured heat for nine hours of ten [kW]
_MOST_BASE = 100.0
#: heat is in W if it exceeds both this multiple of the largest in training and so many kW; training with less than the
#: last number [kW] tells nothing
_MOST_GROWTH, _LEAST_WATTS, _LEAST_TRAINED = 20.0, 30.0, 0.1


def range_of(role: str) -> PhysicalRange:
    """The range of a role."""
    return next(found for beginning, found in RANGES.items() if role.startswith(beginning))


def check_range(
    v: np.ndarray,
    role: str,
    name: str,
    index: pd.Index,
    *,
    named: bool = True,
    warns: bool = True,
    trained: tuple[float, float] | None = None,
    measured: bool = False,
) -> None:
    """Refuse values (n,) that no sensor of a role can have measured, and warn of those that suggest another unit.

    Where no role was ``named``, since an array has its roles by position, only what is beyond every unit is refused.
    ``trained`` are the lowest and highest value of the training.  ``measured``: the rows of a sensor, in their order.
    """
    kind, known = range_of(role), v[np.isfinite(v)]
    if not len(known):
        return
    low, high = float(known.min()), float(known.max())
    unit = next((unit.name for unit in kind.others if unit.fits(low, high)), None)
    lowest, highest = (kind.lowest, kind.highest) if named else (-_BEYOND_UNITS, _BEYOND_UNITS)
    if low < lowest or high > highest or max(-low, high) >= _LEAST_FILL:
        with np.errstate(invalid="ignore"):
            bad = ((v < lowest) | (v > highest)) & np.isfinite(v) | np.isin(v, _FILL_VALUES)
        if bad.any() and not (named and unit and _is_unit(known, kind)):
            raise ValueError(_refusal(v, bad, kind, name, index))
    if warns and named and role.startswith(("T_za", "T_oa")):
        _warn_of_zeros(v, name, index)
    if warns and named and measured and role.startswith("T_za") and high - low > _LEAP:
        _warn_of_leaps(v, name, index)
    warm = kind.unit == "degC" and high > _WARMEST_MEDIAN and np.median(known) > _WARMEST_MEDIAN
    watts = role.startswith("Q_") and is_in_watts(known, trained)
    if role.startswith("zeta"):  # people and sun are there for some hours only
        watts = is_in_watts(known, trained, 0.9) or bool(np.quantile(np.abs(known), 0.1) > _MOST_BASE)
    if warns and (warm or watts or low < kind.usual_lowest or high > kind.usual_highest):
        likely = f"likely {unit}" if unit and (warm or watts or high > kind.usual_highest) else "unusual"
        before = f", in training from {trained[0]:.4g} to {trained[1]:.4g}" if watts and trained else ""
        of = f" (role {role})" if name.startswith("column") else ""
        values = f"is {low:.4g}" if low == high else f"ranges from {low:.4g} to {high:.4g}"
        warn_user(
            f"{name}{of} {values}{before}: {likely}; convert it with "
            "skhybrid.preprocessing.UnitConverter, or check the sensor.",
            UnitWarning,
        )


def _warn_of_zeros(T: np.ndarray, name: str, index: pd.Index) -> None:
    """Warn of 0 degC among temperatures (n,) that are otherwise far from it, as in a file that is filled with 0."""
    zeros, others = T == 0.0, T[np.isfinite(T) & (T != 0.0)]
    if zeros.any() and len(others) and others.min() > _FAR_FROM_ZERO:
        warn_user(
            f"{name} is 0 degC in {several(int(zeros.sum()), 'row')} (first at {index[int(np.argmax(zeros))]}) and "
            f"otherwise never below {others.min():.4g}: likely a fill value; set such values to NaN.",
            UnitWarning,
        )


def single_leaps(T: np.ndarray) -> np.ndarray:
    """Temperatures (n,) of a room that leap from the one before, and back, as no room does [degC]; none if many do."""
    known, leaps = np.flatnonzero(np.isfinite(T)), np.zeros(len(T), dtype=bool)
    change = np.diff(T[known])
    there, back = change[:-1], change[1:]
    least = np.minimum(np.abs(there), np.abs(back))
    leaps[known[1:-1]] = (least > _LEAP) & (np.abs(there + back) < least / 2.0)
    return leaps if leaps.sum() <= _FEW_LEAPS * len(known) else np.zeros(len(T), dtype=bool)


def _warn_of_leaps(T: np.ndarray, name: str, index: pd.Index) -> None:
    """Warn of single leaps of a room (n,), which a log is read without; not of 0, of which is warned already."""
    rows = np.flatnonzero(single_leaps(np.where(T == 0.0, np.nan, T)))
    if len(rows):
        more = f" and in {several(len(rows) - 1, 'row')} more" if len(rows) > 1 else ""
        warn_user(
            f"{name} leaps to {T[rows[0]]:.4g} degC and back at {index[rows[0]]}{more}, as no room does: likely "
            "a failed sensor; set such values to NaN.",
            UnitWarning,
        )


def is_in_watts(heat: np.ndarray, trained: tuple[float, float] | None, share: float = 0.5) -> bool:
    """Whether heat (n,) is too much to be in kW, given the lowest and highest value of the training where known.

    Where they are not known, the quantile ``share`` of what is not 0 is judged by itself.
    """
    running = np.abs(heat[np.isfinite(heat) & (heat != 0.0)])
    if not len(running):
        return False
    if trained is None:
        return bool(running.max() > _MOST_HEAT and np.quantile(running, share) > _MOST_HEAT)
    most = max(map(abs, trained))
    return bool(most >= _LEAST_TRAINED and running.max() > max(_MOST_GROWTH * most, _LEAST_WATTS))


def _is_unit(known: np.ndarray, kind: PhysicalRange) -> bool:
    """Whether so many values are above the range that the column is in another unit, and the sensor sound."""
    above = np.abs(known) > kind.highest
    moving = int((known != 0.0).sum())  # a plant that is off and the sun at night are 0 in every unit
    return int((above & ~np.isin(known, _FILL_VALUES)).sum()) >= max(_LEAST_ROWS, _LEAST_SHARE * moving)


def _refusal(v: np.ndarray, bad: np.ndarray, kind: PhysicalRange, name: str, index: pd.Index) -> str:
    """One sentence: what was found, where, the likely cause and the remedy."""
    worst = float(v[bad][np.argmax(np.abs(v[bad]))])
    if worst in _FILL_VALUES or abs(worst) > _BEYOND_UNITS:
        likely = "a fill value of the file, or another unit"
    else:
        unit = next((unit.name for unit in kind.others if unit.fits(worst, worst)), "another unit")
        likely = f"{unit}, scaled values or a failed sensor"
    value = f"{worst:.4g}" if kind.unit == "-" else f"{worst:.4g} {kind.unit}"
    return (
        f"{name} holds {value} in {several(int(bad.sum()), 'row')} (first at {index[int(np.argmax(bad))]}), beyond "
        f"{kind.lowest:g} to {kind.highest:g}: likely {likely}; set such values to NaN, or convert the column with "
        "skhybrid.preprocessing.UnitConverter."
    )
