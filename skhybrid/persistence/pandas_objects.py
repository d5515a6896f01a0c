"""pandas objects, dates, durations, paths and large arrays as plain data, for model files."""

from __future__ import annotations

from datetime import date, datetime, timedelta
from math import isqrt
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pandas as pd

from .._time import zone_name

_MOST_ROWS, _MOST_STAMPS = 10**8, 10**6  # of an index that is not written out, in which stamps take memory
_SIZE = 1000  # values of an array that is worth packing


def _datetimes_to_data(value: pd.DatetimeIndex) -> dict[str, Any]:
    freq = None if value.freq is None else value.freq.freqstr
    ns: Any = value.as_unit("ns").asi8
    if 2 < len(ns) <= _MOST_STAMPS and len(steps := np.unique(np.diff(ns))) == 1 and steps[0] > 0:
        ns = pd.RangeIndex(ns[0], ns[-1] + 1, steps[0])
    return {"ns": ns, "unit": value.unit, "tz": zone_name(value.tz), "freq": freq, "name": value.name}


def _data_to_datetimes(ns: Any, unit: Any, tz: str | None, freq: Any, name: Any) -> pd.DatetimeIndex:
    if isinstance(ns, pd.RangeIndex) and len(ns) > _MOST_STAMPS:
        raise ValueError(f"an index has more than {_MOST_STAMPS:,} stamps")
    made = pd.DatetimeIndex(np.asarray(ns, dtype=np.int64).view("M8[ns]")).as_unit(unit)
    made = made if tz is None else made.tz_localize("UTC").tz_convert(tz)
    return pd.DatetimeIndex(made, freq=freq, name=name)


def _data_to_date(text: str) -> date:
    return datetime.fromisoformat(text) if "T" in text else date.fromisoformat(text)


def _frame_to_data(value: pd.DataFrame) -> dict[str, Any]:
    return {"index": value.index, "columns": value.columns, "values": [_column_values(c) for _, c in value.items()]}


def _data_to_range(start: int, stop: int, step: int, name: Any) -> pd.RangeIndex:
    if len(range(start, stop, step)) > _MOST_ROWS:
        raise ValueError(f"an index has more than {_MOST_ROWS:,} rows")
    return pd.RangeIndex(start, stop, step, name=name)


def _data_to_series(values: Any, index: pd.Index, name: Any) -> pd.Series:
    return pd.Series(_per_row(values, index), index=index, name=name)


def _per_row(values: Any, index: pd.Index) -> Any:
    """The values, which pandas would repeat for every row if they were one number."""
    if not isinstance(values, np.ndarray | pd.Index) or len(values) != len(index):
        raise ValueError("the values and the index of a table differ in length")
    return values


def _data_to_frame(index: pd.Index, columns: pd.Index, values: list[Any]) -> pd.DataFrame:
    made = pd.DataFrame({number: _per_row(column, index) for number, column in enumerate(values)}, index=index)
    made.columns = columns
    return made


def _column_values(column: pd.Series) -> Any:
    """(n,) values as an array, or as an index if they are dates or durations, which keeps time zones."""
    if pd.api.types.is_datetime64_any_dtype(column) or pd.api.types.is_timedelta64_dtype(column):
        return pd.Index(column).rename(None)
    return column.to_numpy()


#: kind -> (types, object to parts, parts to object); searched in this order, so subclasses come first.
PANDAS_KINDS: dict[str, tuple[Any, Any, Any]] = {
    "Timedelta": (pd.Timedelta, lambda v: {"ns": v.as_unit("ns").value}, lambda ns: pd.Timedelta(ns, unit="ns")),
    "Timestamp": (
        pd.Timestamp,
        lambda v: {"ns": v.as_unit("ns").value, "tz": zone_name(v.tz)},
        lambda ns, tz: pd.Timestamp(ns, unit="ns", tz=tz),
    ),
    "timedelta": (  # after Timedelta, which is one
        timedelta,
        lambda v: {"days": v.days, "seconds": v.seconds, "microseconds": v.microseconds},
        timedelta,
    ),
    "path": (PurePath, lambda v: {"text": str(v)}, lambda text: Path(text)),
    "date": (date, lambda v: {"text": v.isoformat()}, _data_to_date),  # after Timestamp, which is one
    "DatetimeIndex": (pd.DatetimeIndex, _datetimes_to_data, _data_to_datetimes),
    "TimedeltaIndex": (
        pd.TimedeltaIndex,
        lambda v: {"ns": v.as_unit("ns").asi8, "unit": v.unit, "name": v.name},
        lambda ns, unit, name: pd.TimedeltaIndex(ns.view("m8[ns]"), name=name).as_unit(unit),
    ),
    "RangeIndex": (
        pd.RangeIndex,
        lambda v: {"start": v.start, "stop": v.stop, "step": v.step, "name": v.name},
        _data_to_range,
    ),
    "MultiIndex": (
        pd.MultiIndex,
        lambda v: {"tuples": v.to_list(), "names": list(v.names)},
        lambda tuples, names: pd.MultiIndex.from_tuples(tuples, names=names),
    ),
    "Index": (
        pd.Index,
        lambda v: {"values": v.to_numpy(), "name": v.name},
        lambda values, name: pd.Index(values, name=name),
    ),
    "Series": (pd.Series, lambda v: {"values": _column_values(v), "index": v.index, "name": v.name}, _data_to_series),
    "DataFrame": (pd.DataFrame, _frame_to_data, _data_to_frame),
}


def pack(value: np.ndarray) -> tuple[str, dict[str, Any]] | None:
    """Kind and parts of a packed array; None where it stays as it is.

    Of a symmetric matrix half is kept.  Of other arrays the bytes of all values are sorted by their place, since signs
    and exponents are alike and compress.
    """
    if type(value) is not np.ndarray or value.dtype != np.float64 or value.ndim < 2 or value.size < _SIZE:
        return None
    if not value.flags.c_contiguous:  # products of an array in another order may differ in their last bits
        return None
    if value.ndim == 2 and value.shape[0] == value.shape[1] and value.tobytes() == value.T.tobytes():
        return "symmetric", {"half": value[np.triu_indices(len(value))]}
    planes = value.reshape(-1).view(np.uint8).reshape(-1, value.itemsize).T
    return "planes", {"planes": np.ascontiguousarray(planes), "shape": list(value.shape)}


def unpack(kind: str, parts: dict[str, Any]) -> np.ndarray:
    """The array that was packed."""
    if not all(isinstance(parts[name], np.ndarray) for name in ("planes", "half") if name in parts):
        raise ValueError("the values of a packed array are not an array")  # an index would be unfolded
    if kind == "planes":
        return np.ascontiguousarray(parts["planes"].T).view(np.float64).reshape(parts["shape"])
    half = parts["half"]
    n = (isqrt(8 * len(half) + 1) - 1) // 2
    made = np.empty((n, n))
    made[np.triu_indices(n)] = half
    made.T[np.triu_indices(n)] = half
    return made
