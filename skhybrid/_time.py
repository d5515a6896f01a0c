"""Time stamps, durations and forecast origins of the data contract."""

from __future__ import annotations

import warnings
from datetime import timezone, tzinfo
from functools import cache
from typing import Any, Literal

import numpy as np
import pandas as pd

#: a jump over missing rows divides a table into segments from this length on; a shorter one is an error of the log
SHORTEST_GAP = pd.Timedelta("3h")
#: longest outage within a training that is bridged: without its other side, errors are larger (benchmarks/outages.py)
LONGEST_BRIDGE = pd.Timedelta("4D")
#: a table shorter than this shows no storage of heat from one day to the next
FEW_DAYS = pd.Timedelta("2D")
#: assumed time of row 0 where there are no time stamps [local wall clock], a Monday
ASSUMED_START = pd.Timestamp("2001-01-01 00:00")
_HOUR, _DAY = pd.Timedelta("1h"), pd.Timedelta("1D")
_FINEST = pd.Timedelta("1s")  # no building is logged more often
_ROUNDING = 0.2  # most by which steps in decimals differ, as a share: hours are often written with few digits
_SHUFFLED = 10  # steps back in time among others, or of other lengths, from which on rows may have been drawn
_SPLIT = "split rows with skhybrid.model_selection.RollingOriginSplit"
_IN_ORDER = f"{_SPLIT}, never shuffled (a halving search over n_samples shuffles them; use GridSearchCV)"
_STAMPS = (
    "give a DataFrame with a DatetimeIndex (a step before this one in a Pipeline keeps it with "
    ".set_output(transform='pandas')), or pass sampling_time=, such as '15min'"
)


def read_index(
    index: pd.Index,
    sampling_time: Any,
    expected: pd.Timedelta | None,
    gaps: bool = False,
    X: Any = None,
    name: str = "X",
) -> tuple[pd.Timedelta, pd.DatetimeIndex, pd.DatetimeIndex | None, tuple[int, ...]]:
    """Step, local wall clock, stamps in UTC and first rows of the segments; without ``gaps`` there is one segment.

    An index without stamps, or of one row, needs a given or an expected step; a column of ``X``, which messages call
    ``name``, may hold stamps.
    """
    given = None if sampling_time is None else positive_duration(sampling_time, "sampling_time")
    if given is not None and given < _FINEST:
        raise ValueError(f"sampling_time={sampling_time!r} is {spell(given)}, but steps are of a second or more.")
    if not isinstance(index, pd.DatetimeIndex):
        refuse_disorder(index)
        step = given or expected
        if step is None:
            raise ValueError(f"X has no time stamps; {_STAMPS if X is None else _how_to_stamp(X, name)}.")
        return step, assumed_clock(index, step), None, (0,)
    if index.hasnans:
        raise ValueError(f"the index holds NaT at row {int(np.argmax(index.isna()))}; every row needs a time stamp.")
    utc = index.tz_convert("UTC") if index.tz is not None else index.tz_localize("UTC")
    breaks = segments(utc) if gaps and len(utc) > 1 else (0,)
    first = slice(breaks[1] if len(breaks) > 1 else None)  # all segments have its step
    known = even_step(index[first]) if len(utc) > 1 else given or expected
    if known is None:
        raise ValueError(f"the step of X is unknown, since it has {len(utc)} row(s); pass sampling_time='15min'.")
    step = known
    if given is not None and step != given:
        raise ValueError(
            f"the index steps by {spell(step)}, but sampling_time={spell(given)} was given; drop the argument or "
            "resample with skhybrid.datasets.regularize."
        )
    return step, wall_clock(index), utc, breaks


def assumed_clock(index: pd.Index, step: pd.Timedelta) -> pd.DatetimeIndex:
    """Local times of rows without stamps; the numbers of consecutive rows tell how far into the week they begin."""
    first, week = first_row_number(index), pd.Timedelta("7D").as_unit("ns").value
    begin = pd.Timedelta(first * step.as_unit("ns").value % week, unit="ns").as_unit(step.unit)
    return pd.DatetimeIndex(ASSUMED_START + begin + np.arange(len(index)) * step)


def first_row_number(index: pd.Index) -> int:
    """Number of the first of some rows; 0 where their index does not number consecutive rows."""
    numbered = len(index) and pd.api.types.is_integer_dtype(index) and index[-1] - index[0] == len(index) - 1
    return int(index[0]) if numbered else 0


def zone_name(tz: tzinfo | None) -> str | None:
    """The name from which pandas makes a time zone again, refused where there is none."""
    name = getattr(tz, "key", None) or getattr(tz, "zone", None)  # of zoneinfo and of pytz
    if name is None and tz is not None:
        offset = tz.utcoffset(None)  # of a fixed one
        name = str(tz if offset is None else timezone(offset))
    try:
        pd.DatetimeIndex([], tz=name)
    except (KeyError, ValueError):
        raise ValueError(
            f"the time zone {name} cannot be saved; give stamps one by its name, such as tz_convert('Europe/Berlin')."
        ) from None
    return name


def wall_clock(index: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Local time of stamps, without their zone."""
    return index if index.tz is None else index.tz_localize(None)


def segments(utc: pd.DatetimeIndex) -> tuple[int, ...]:
    """First rows of the segments between gaps of whole steps; (0,) where the index is not evenly spaced otherwise."""
    # A gap below SHORTEST_GAP is better filled, since each segment needs an initial state of its own.
    jumps = np.diff(utc.as_unit("ns").asi8)
    usual = int(np.median(jumps))
    long = jumps >= max(SHORTEST_GAP.value, 2 * usual)
    ends = np.flatnonzero(long)
    whole = usual > 0 and (jumps[long] % usual == 0).all() and (jumps[~long] == usual).all()
    lengths = np.diff([0, *(ends + 1), len(utc)])
    if not len(ends) or not whole or (lengths < 2).any():
        return (0,)
    return (0, *(int(i) for i in ends + 1))


def even_step(index: pd.DatetimeIndex) -> pd.Timedelta:
    """The step of an evenly spaced index; a ValueError names the first stamps out of order or unevenly spaced."""
    gaps = np.diff(index.as_unit("ns").asi8)
    hint = ", or localize it if this is daylight saving" if index.tz is None else ""
    if (gaps <= 0).any():
        if min((gaps < 0).sum(), (gaps > 0).sum()) >= _SHUFFLED:
            raise ValueError(f"the index is shuffled: {index[0]} is followed by {index[1]}; {_IN_ORDER}.")
        row = int(np.argmax(gaps <= 0))
        what = "has duplicates" if gaps[row] == 0 else "goes back in time"
        raise ValueError(
            f"the index {what}: {index[row]} is followed by {index[row + 1]}; sort it and drop duplicates "
            f"(skhybrid.datasets.regularize does){hint}."
        )
    usual = int(np.median(gaps))
    if (gaps != usual).any():
        row = int(np.argmax(gaps != usual))
        if gaps[row] >= _DAY.value or (gaps != usual).sum() >= _SHUFFLED:
            hint = f", or in cross-validation {_SPLIT}"
        raise ValueError(
            f"the index is not evenly spaced: {index[row]} is followed by {index[row + 1]}, where most steps are "
            f"{spell(pd.Timedelta(usual, unit='ns'))}; use skhybrid.datasets.regularize{hint}."
        )
    step = pd.Timedelta(usual, unit="ns")
    if step < _FINEST:
        raise ValueError(
            f"the index steps by {spell(step)}, but steps are of a second or more; numbers that were parsed as stamps "
            "need their unit, such as pd.to_datetime(..., unit='s')."
        )
    return step


def _looks_like_time(index: pd.Index) -> bool:
    if isinstance(index, pd.PeriodIndex | pd.TimedeltaIndex):
        return True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no common format: not a time
        return bool(pd.to_datetime(index[:3].astype(str), errors="coerce", utc=True).notna().all())


def _how_to_stamp(X: pd.DataFrame, name: str) -> str:
    """A remedy for a frame without time stamps, by its column that holds them where there is one."""
    for column in X:
        values = X[column].dropna()
        text = values.dtype == object or isinstance(values.dtype, pd.StringDtype)
        if values.dtype.kind == "M" or (text and len(values) and _looks_like_time(pd.Index(values[:3]))):
            parse = f".assign(**{{{column!r}: pd.to_datetime({name}[{column!r}])}})"
            parsed = name if values.dtype.kind == "M" else name + parse
            return f"its column {column!r} holds them, so give {parsed}.set_index({column!r})"
    return _STAMPS


def refuse_disorder(index: pd.Index) -> None:
    """Refuse an index of time stamps as text, or of numbers that do not belong to consecutive rows."""
    if isinstance(index, pd.MultiIndex):
        raise ValueError(
            f"the index has {index.nlevels} levels ({', '.join(map(str, index.names))}); rows are the steps of one "
            "zone, so give one zone at a time, with the time stamps as the only level (X.xs, X.droplevel)."
        )
    if not pd.api.types.is_numeric_dtype(index):
        if _looks_like_time(index):
            raise ValueError(
                f"the index begins with {index[0]!r}, which looks like a time stamp but is not one; convert it "
                "with pd.to_datetime (periods with .to_timestamp(); to durations add the first stamp)."
            )
        return  # labels without a meaning in time: the rows are taken in their order
    if index.hasnans:
        raise ValueError(f"the index holds NaN at row {int(np.argmax(index.isna()))}; every row needs a number.")
    gaps = np.diff(index.to_numpy(dtype=np.float64))
    if (gaps <= 0).any():
        row = int(np.argmax(gaps <= 0))
        raise ValueError(
            f"the rows are not in time order: index {index[row]} is followed by {index[row + 1]}; rows are consecutive "
            f"time steps, so {_IN_ORDER}."
        )
    usual = np.median(gaps) if len(gaps) else 1.0
    uneven = np.abs(gaps - usual) > (0.0 if pd.api.types.is_integer_dtype(index) else _ROUNDING * usual)
    if uneven.any():
        row = int(np.argmax(uneven))
        what = "rows are missing" if gaps[row] > usual else "the rows are not evenly spaced"
        raise ValueError(
            f"{what}: index {index[row]} is followed by {index[row + 1]}; give every time step one row, with NaN "
            "where y was not measured."
        )


def read_duration(value: Any, name: str) -> pd.Timedelta:
    """A duration; a ValueError names the argument, also where a number has no unit."""
    if _is_number(value):  # pandas means nanoseconds
        raise ValueError(f"{name}={value!r} has no unit; give a duration such as '15min' or '1D'.")
    try:
        span: pd.Timedelta | None = pd.Timedelta(value)
    except (TypeError, ValueError):
        span = None
    if span is None or pd.isna(span):
        raise ValueError(f"{name}={value!r} is not a duration such as '15min' or '1D'.")
    return span


def _is_number(value: Any) -> bool:
    """Whether a value is a number, or the text of one."""
    if isinstance(value, str):
        return value.strip().lstrip("+-").replace(".", "", 1).isdigit()
    return isinstance(value, int | float | np.number) and not isinstance(value, np.timedelta64)


def duration_from_zero(value: Any, name: str) -> pd.Timedelta:
    """A duration that is not negative; a ValueError names the argument."""
    span = read_duration(value, name)
    if span < pd.Timedelta(0):
        raise ValueError(f"{name}={value!r} must not be negative; give a duration such as '15min' or '1D'.")
    return span


def positive_duration(value: Any, name: str) -> pd.Timedelta:
    """A duration above zero; a ValueError names the argument."""
    span = read_duration(value, name)
    if not span > pd.Timedelta(0):
        raise ValueError(f"{name}={value!r} is not a positive duration such as '15min' or '1D'.")
    return span


def rows_of(duration: Any, step: pd.Timedelta, name: str = "horizon") -> int:
    """Number of steps in a duration such as "1D", which must be a positive multiple of the step."""
    rows = read_duration(duration, name) / step
    if not rows >= 1 or abs(rows - round(rows)) > 1e-9:
        raise ValueError(f"{name}={duration!r} is not a positive multiple of the sampling time of {spell(step)}.")
    return round(rows)


def rows_in(hours: float, step: pd.Timedelta | float) -> int:
    """Number of steps in some hours, rounded, at least 1; the step is a duration, or in hours."""
    return max(1, round(hours / (step / _HOUR if isinstance(step, pd.Timedelta) else step)))


def rows_per_day(step: pd.Timedelta | float) -> int:
    """Number of steps in 24 hours, as of :func:`rows_in`."""
    return rows_in(24.0, step)


def rows_per_hour(step: pd.Timedelta | float) -> int:
    """Number of steps in an hour, as of :func:`rows_in`."""
    return rows_in(1.0, step)


@cache
def per_hour(unit: Literal["s", "ms", "us", "ns"]) -> int:
    """Number of units of a stamp, such as "ns", in an hour."""
    return int(np.timedelta64(1, "h") // np.timedelta64(1, unit))


def rows_covering(duration: Any, step: pd.Timedelta, name: str = "warmup") -> int:
    """Number of steps that cover a positive duration, which need not be a multiple of the step."""
    return max(1, int(np.ceil(positive_duration(duration, name) / step - 1e-9)))


def origin_rows(time: pd.DatetimeIndex, horizon: Any, origin_step: Any = None, step: Any = None) -> np.ndarray:
    """(n_origins,) increasing rows that are forecast origins: row 0, the starts of days and of each ``origin_step``.

    ``time`` is local wall-clock time; ``origin_step`` (default ``horizon``) is counted from the midnight before the
    first row and must be a multiple of ``step``.  Spans of less than a day begin again where clocks go back.  Without a
    horizon row 0 is the only origin.
    """
    if horizon is None:
        return np.zeros(1, dtype=np.int64)
    name, given = ("horizon", horizon) if origin_step is None else ("origin_step", origin_step)
    every = positive_duration(given, name)
    if step is not None:
        rows_of(given, pd.Timedelta(step), name)
    since = time - time[0].normalize()
    block = (since // every).to_numpy()
    begins = np.diff(block) > 0
    if every < _DAY:  # a block whose hour repeats would be longer than its span
        begins |= np.diff(time.asi8) <= 0
    return np.concatenate([[0], np.flatnonzero(begins) + 1]).astype(np.int64)


def same_stamps(one: pd.Index, other: pd.Index) -> bool:
    """Whether two indices are equal, or hold the same instants in two time zones."""
    if not (isinstance(one, pd.DatetimeIndex) and isinstance(other, pd.DatetimeIndex)):
        return one.equals(other)
    return len(one) == len(other) and (one.tz is None) == (other.tz is None) and bool((one == other).all())


def refuse_other_stamps(given: pd.Series | pd.DataFrame, index: pd.Index, name: str, of: str = "X") -> None:
    """Refuse values whose index is not that of the table that they belong to."""
    if not same_stamps(given.index, index):
        raise ValueError(f"{name} has other time stamps than {of}; align it with .reindex({of}.index).")


def spell(step: pd.Timedelta) -> str:
    """A duration as text, such as "15 min"."""
    seconds = step / pd.Timedelta("1s")  # total_seconds() of pandas 2 has no nanoseconds
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds % size == 0:
            return f"{int(seconds // size)} {unit}"
    return f"{seconds:g} s"


def read_instant(value: Any, index: pd.Index, name: str, where: str) -> Any:
    """A time stamp by the clock of an index, or a row number where the index has no stamps; else refused.

    The message names the argument, and ``where`` the index is.
    """
    is_number = isinstance(value, int | float | np.number)
    if not isinstance(index, pd.DatetimeIndex):
        if not is_number:
            raise ValueError(f"{name}={value!r} is not a row number, but {where} has no time stamps; give a number.")
        return value
    such = f"give one, such as {str(index[0])!r}."
    if is_number:
        raise ValueError(f"{name}={value!r} is a number, but {where} has time stamps; {such}")
    try:
        stamp: pd.Timestamp | None = pd.Timestamp(value)
    except (TypeError, ValueError):
        stamp = None
    if stamp is None or pd.isna(stamp):
        raise ValueError(f"{name}={value!r} is not a time stamp; {such}")
    if index.tz is not None and stamp.tz is None:
        local = stamp.tz_localize(index.tz, ambiguous="NaT", nonexistent="NaT")
        if pd.isna(local):
            raise ValueError(f"{name}={value!r} is skipped or repeated by the clock of {index.tz}; {such}")
        return local
    if index.tz is None and stamp.tz is not None:
        raise ValueError(f"{name}={value!r} has a time zone, but {where} has none; {such}")
    return stamp
