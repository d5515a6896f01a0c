"""Stamps of the rows of tables; what follows from them is found once for all tables on one clock."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from functools import wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from ._time import per_hour, wall_clock

_FEW_ROWS, _MOST_KEPT = 10_000, 16  # of stamps for which results are kept
_T = TypeVar("_T")
_Stamps = TypeVar("_Stamps", pd.Timestamp, pd.DatetimeIndex)


def kept_by_stamps(function: Callable[..., _T]) -> Callable[..., _T]:
    """Keep the last results of a function of stamps and other arguments: zones on one clock share their stamps.

    Arrays among the results are read-only.
    """
    kept: OrderedDict[Hashable, tuple[pd.Index, _T]] = OrderedDict()

    @wraps(function)
    def kept_result(stamps: pd.Index, *others: Hashable) -> _T:
        key = (id(stamps), *others)  # the stamps themselves are kept too, so that no others get their id
        if (found := kept.get(key)) is not None:
            return found[1]
        result = function(stamps, *others)
        if isinstance(result, np.ndarray):
            result.setflags(write=False)
        if len(stamps) <= _FEW_ROWS:
            _keep(kept, key, (stamps, result))
        return result

    return kept_result


def _keep(kept: OrderedDict[Hashable, Any], key: Hashable, result: Any) -> None:
    """Keep a result and forget the oldest of many."""
    kept[key] = result
    while len(kept) > _MOST_KEPT:
        kept.popitem(last=False)


class Stamps(NamedTuple):
    """The stamps of consecutive rows."""

    shown: pd.Index  # the caller's own
    time: pd.DatetimeIndex  # local, without zone
    utc: pd.DatetimeIndex | None

    def rows(self, chosen: slice) -> Stamps:
        """The stamps of some consecutive rows."""
        between = chosen.start, chosen.stop
        utc = None if self.utc is None else _between(self.utc, *between)
        return Stamps(_between(self.shown, *between), _between(self.time, *between), utc)

    def n_until(self, last: pd.Timestamp | None) -> int:
        """Number of rows up to the stamp ``last``; 0 where there are no stamps."""
        return 0 if self.utc is None or last is None else int((self.utc <= last).sum())


@kept_by_stamps
def _between(stamps: pd.Index, begin: int | None, end: int | None) -> Any:
    return stamps[begin:end]


def refuse_one_zone(earlier: Any, later: Any, names: tuple[str, str]) -> None:
    """Refuse stamps of which only one has a time zone: those without would count as UTC, hours off."""
    zone, other = (getattr(stamps, "tz", None) for stamps in (earlier, later))
    if (zone is None) != (other is None):
        raise ValueError(f"{names[0]} has the time zone {zone}, {names[1]} {other}; localize the one without.")


def clock_of_training(stamps: Stamps, training: Any) -> pd.DatetimeIndex:
    """Local times of rows in the zone of an estimator's training span; refused where only one of them has a zone."""
    first = getattr(training, "first", None)
    if isinstance(first, pd.Timestamp) and isinstance(stamps.shown, pd.DatetimeIndex):
        refuse_one_zone(first, stamps.shown, ("the training table", "X"))
    zone, own = (getattr(stamp, "tz", None) for stamp in (first, stamps.shown))
    if zone is None or stamps.utc is None or str(zone) == str(own):
        return stamps.time
    return wall_clock(stamps.utc.tz_convert(zone))


#: of the tables that were joined last: zones on one clock share their stamps
_joined: OrderedDict[Hashable, Stamps] = OrderedDict()


def joined_stamps(parts: Sequence[Stamps]) -> Stamps:
    """The stamps of tables that follow each other as one, shown in the time zone of the last."""
    zone = getattr(parts[-1].shown, "tz", None)
    parts = [part._replace(shown=in_time_zone(part.shown, zone)) for part in parts]
    if any(part.utc is None for part in parts):
        return Stamps(_joined_index([p.shown for p in parts]), _joined_index([p.time for p in parts]), None)
    kinds = tuple(dict.fromkeys((p.shown.dtype, p.shown.name, p.time.unit, getattr(p.utc, "unit", "")) for p in parts))
    # all stamps: two zones may have the same hours at both ends, and others between
    key = (kinds, *(b"".join(getattr(part, name).asi8.tobytes() for part in parts) for name in ("utc", "time")))
    found = _joined.get(key)
    if found is None:
        found = Stamps(*(_joined_index(list(part)) for part in zip(*parts, strict=True)))
        if len(found.time) <= _FEW_ROWS:
            _keep(_joined, key, found)
    return found


def in_time_zone(shown: Any, zone: Any) -> pd.Index:
    """Stamps in a time zone; those without a zone of their own stay as they are."""
    own = getattr(shown, "tz", None)
    return shown if zone is None or own is None or own == zone else shown.tz_convert(zone)


def on_clock_of(stamp: _Stamps, other: Any) -> _Stamps:
    """A stamp, or several, by the clock of others: in their time zone, or as local time where they have none."""
    tz = getattr(other, "tz", None)
    if tz is None:
        return stamp.tz_localize(None)
    return stamp.tz_localize(tz) if stamp.tz is None else stamp.tz_convert(tz)


def _joined_index(parts: Sequence[Any]) -> Any:
    """The parts of an index as one; stamps of one kind by their numbers, which takes a fifth of the time."""
    first = parts[0]
    kinds = {(type(p), p.name, getattr(p, "dtype", None)) for p in parts}
    if len(kinds) > 1 or not isinstance(first, pd.DatetimeIndex):
        return first.append(list(parts[1:]))
    stamps = pd.DatetimeIndex(np.concatenate([p.asi8 for p in parts]).view(f"M8[{first.unit}]"), name=first.name)
    return stamps if first.tz is None else stamps.tz_localize("UTC").tz_convert(first.tz)


@kept_by_stamps
def hour_of_day(time: pd.DatetimeIndex) -> np.ndarray:
    """Local hour of day, with its fraction, (n,) float64."""
    hour = per_hour(time.unit)
    return np.asarray((time.asi8 % (24 * hour)) / np.float64(hour))
