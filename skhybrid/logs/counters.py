"""Counters of energy: how they are known, and the mean power between their readings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd

from .._ranges import range_of

_FEW_RESETS = 0.03  # falls of a counter at most, relative to its rises, when it is reset or replaced, and
_RESETS = 2  # so many more, where it rises seldom, not counting
_SHORT_DIP = 3  # failed readings in a row, after which it goes on
_DAILY = pd.Timedelta("75min").value  # a counter of the day falls at the same time, but for daylight saving,
_MORE_RISES = 3.0  # rises more often than it falls by this factor at least, and
_LEFT = 0.2  # keeps at most this share of its reading
_SLOW = 0.1  # rise of a counter, relative to its readings, that an energy per row cannot have without ever falling
_FAR_ABOVE = 20.0  # a rise this many times above all others is a replaced meter
_BACK_ABOVE = 2.0  # and one this many times above them, that makes up for a fall, ends a failed reading
_LEAST_JUMP = 20.0  # [kW]; a plant that starts may rise that much above its losses at rest
_FEWEST_RISES = 10  # that show what is usual
_OFF_TICK, _ALONE = 0.01, 0.8  # of a step of a coarse counter; share of its steps that come alone
_LONGEST_DIP = 1000  # failed readings in a row


def is_counter(values: pd.Series) -> bool:
    """Whether readings only rise, but for a few resets, or one at the same time of each day, as those of a meter do."""
    known = values.dropna()
    readings = known.to_numpy(dtype=np.float64)
    steps = np.diff(readings)
    rises, falls = int((steps > 0).sum()), int((steps < 0).sum())
    if len(steps) <= 20 or not rises:
        return False
    slow = not falls and readings[-1] - readings[0] < _SLOW * readings[0]
    if slow or rises <= 10 or rises < _MORE_RISES * falls:
        return bool(slow)
    short = sum(back - fall <= _SHORT_DIP for fall, back in _dips(readings))
    return falls - short <= _RESETS + _FEW_RESETS * rises or _is_set_to_zero_daily(known)


def _is_set_to_zero_daily(known: pd.Series) -> bool:
    """Whether readings fall to about zero, and always at about the same time of the day."""
    readings = known.to_numpy(dtype=np.float64)
    at = np.flatnonzero(np.diff(readings) < 0.0) + 1
    return _at_one_time(known.index[at]) and bool((readings[at] <= _LEFT * readings[at - 1]).all())


def _at_one_time(stamps: pd.Index) -> bool:
    """Whether stamps are at about the same time of the day."""
    ticks, day = pd.DatetimeIndex(stamps).as_unit("ns").asi8, pd.Timedelta("1D").value
    return bool(np.ptp((ticks - ticks[0] + day // 2) % day - day // 2) <= _DAILY)


def power_of_counter(readings: pd.Series) -> np.ndarray:
    """Readings of a counter [kWh] as mean power from each to the next [kW].

    What :func:`counter_jumps` finds is missing, as are falls: the counter was set to zero, or replaced.  The steps of a
    coarse counter are spread over the time since the one before, so that energy is conserved.
    """
    known = readings.dropna()
    known = known[~known.index.duplicated()]
    failed, replaced = _jumps(known)
    known, replaced = _between_ticks(known[~failed], replaced[~failed]), replaced[~failed]
    used = np.append(np.diff(known.to_numpy(dtype=np.float64)), np.nan)
    hours = np.append(hours_between(known), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        power = pd.Series(np.where((used < 0.0) | replaced, np.nan, used / hours), index=known.index)
    return power.reindex(readings.index).to_numpy()


def counter_jumps(readings: pd.Series) -> pd.DatetimeIndex:
    """Stamps at which a counter [kWh] falls and comes back, as by a failed reading, or rises far above all else."""
    known = readings.dropna()
    failed, replaced = _jumps(known)
    begins = failed & ~np.append(False, failed[:-1])
    return pd.DatetimeIndex(known.index[begins | np.append(False, replaced[:-1])])


def counter_tick(readings: pd.Series) -> tuple[float, float] | None:
    """Step of a coarse counter [kWh] and its usual time [h]; None for one that counts finely enough for its rows."""
    known = readings.dropna()
    rises = np.diff(known.to_numpy(dtype=np.float64))
    at = np.flatnonzero(rises > 0.0)
    if len(at) < _FEWEST_RISES:
        return None
    tick = float(f"{rises[at].min():.3g}")
    whole = np.abs(rises[at] / tick - np.round(rises[at] / tick)) < _OFF_TICK
    alone = (np.diff(at) > 1).mean()  # a plant that goes on and off rises in rows that follow each other
    if f"{tick:.0e}"[0] not in "125" or not whole.all() or alone < _ALONE or _at_one_time(known.index[at]):
        return None
    hours = hours_between(known).cumsum()[at]
    return tick, float(np.median(np.diff(hours)))


def _between_ticks(known: pd.Series, replaced: np.ndarray) -> pd.Series:
    """Readings of a coarse counter on the lines between its steps; others as they are."""
    found = counter_tick(known)
    if found is None:
        return known
    values, hours = known.to_numpy(dtype=np.float64).copy(), np.append(0.0, hours_between(known).cumsum())
    at = np.append(0, np.flatnonzero(np.diff(values) != 0.0) + 1)
    power = 0.0
    for a, b in pairwise(at):
        if values[b] > values[a] and not replaced[b - 1]:
            power = (values[b] - values[a]) / (hours[b] - hours[a])
            values[a:b] = values[a] + power * (hours[a:b] - hours[a])
    rest = hours[at[-1] :] - hours[at[-1]]
    most = found[0] / rest[-1] if rest[-1] > 0.0 else 0.0  # as the next step has not come yet
    values[at[-1] :] += min(power, most) * rest
    return pd.Series(values, known.index)


def counter_resets(readings: pd.Series) -> pd.DatetimeIndex:
    """Stamps at which a counter [kWh] falls and goes on from there."""
    known = readings.dropna()
    good = known[~_jumps(known)[0]]
    return pd.DatetimeIndex(good.index[np.append(False, np.diff(good.to_numpy(dtype=np.float64)) < 0.0)])


def _jumps(known: pd.Series) -> tuple[np.ndarray, np.ndarray]:
    """Whether each reading has failed, and whether the rise from it to the next good one is that to another meter."""
    values = known.to_numpy(dtype=np.float64)
    power, dips = _power_of_rises(known), _dips(values)
    failed, replaced = np.zeros((2, len(values)), dtype=bool)
    others = np.delete(power, [back - 1 for _, back in dips])
    usual = usual_peak(others[others > 0.0])
    for fall, back in dips:
        failed[fall:back] |= power[back - 1] > _BACK_ABOVE * usual
    good, highest = np.flatnonzero(~failed), range_of("Q_").highest
    limit = max(_FAR_ABOVE * usual, _LEAST_JUMP)
    if (others > 0.0).sum() >= _FEWEST_RISES and len(good) > 1:
        replaced[good[:-1]] = _power_of_rises(known.iloc[good]) > (min(limit, highest) if usual < highest else limit)
    return failed, replaced


def _power_of_rises(known: pd.Series) -> np.ndarray:
    """Mean power between readings (n - 1,); a rise at once, as in a log of changes, took as long as they usually do."""
    steps, hours = np.diff(known.to_numpy(dtype=np.float64)), hours_between(known)
    usual = np.median(hours[steps > 0.0]) if (steps > 0.0).any() else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(steps / np.maximum(hours, usual))


def _dips(values: np.ndarray) -> list[tuple[int, int]]:
    """Positions of the first reading after each fall, and of the one that makes up for it in one rise."""
    found = []
    for fall in np.flatnonzero(np.diff(values) < 0.0) + 1:
        high = values[fall : fall + _LONGEST_DIP] >= values[fall - 1]
        back = int(fall + high.argmax())
        if high.any() and 2.0 * (values[back] - values[back - 1]) >= values[fall - 1] - values[fall]:
            found.append((int(fall), back))
    return found


def usual_peak(rises: np.ndarray) -> float:
    """The largest of some rises, but for the few that may be faults; 0 where there is none."""
    n = len(rises)
    left_out = max(min(1 + n // 100, 3), n // 1000) if n >= _FEWEST_RISES else 0
    return float(np.sort(rises)[-1 - left_out]) if n else 0.0


def hours_between(values: pd.Series) -> np.ndarray:
    """Distances of the stamps of values (n,) [h], (n - 1,)."""
    return np.diff(pd.DatetimeIndex(values.index).as_unit("ns").asi8) / 3.6e12
