"""Resampling of a log to an even step, with a report of what was changed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from .._table import is_history, is_instant, is_plant, is_set_point, listed, numeric
from .._time import SHORTEST_GAP, duration_from_zero, positive_duration, spell
from .._warnings import several
from ..preprocessing._gaps import fill_gaps, stamp_hours

#: common logging steps [min]; an uneven log is taken to mean the nearest of them.
_COMMON_MINUTES = (1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60, 120, 180, 240, 360, 720, 1440)
CONTIGUOUS = 1.5  # longest time to the next row, in source steps, over which a row is held; beyond it there is a gap
_STEADY = 24  # rows at one distance, from which on a log has changed its step
_SET_POINT_HOLD = pd.Timedelta("7D")  # a set-point stays in force until the next, also over a weekend
#: times all but the longest hundredth of the distances of rows, from which on a log of changes is silent
_SILENCE = 10.0
_MOST_ROWS = 40_000_000  # more than a year of one-second steps comes from a mistaken step or stamp


@dataclass(frozen=True)
class RegularizeReport:
    """Report of what :func:`regularize` changed; ``str(report)`` gives readable text.

    Attributes
    ----------
    step : Timedelta
    source_step : Timedelta
        Typical spacing of the stamps in the log.
    rows_before, rows_after : int
        Number of rows in the log and in the result.
    out_of_order, duplicates : int
        Number of rows that were sorted, and of rows that were merged into the one before with the same stamp.
    filled, missing : dict of column to int
        Number of rows in short gaps that were filled, and of rows that are still NaN.
    first_missing : dict of column to Timestamp
        Stamp of the first row that is still NaN.
    """

    step: pd.Timedelta
    source_step: pd.Timedelta
    rows_before: int
    rows_after: int
    out_of_order: int
    duplicates: int
    filled: dict[str, int] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    first_missing: dict[str, pd.Timestamp] = field(default_factory=dict)

    def __str__(self) -> str:
        minutes, before = (span.total_seconds() / 60 for span in (self.step, self.source_step))
        after = several(self.rows_after, "row")
        lines = [f"{self.rows_before} rows about {before:g} min apart -> {after} of {minutes:g} min"]
        if self.out_of_order:
            lines.append(f"{several(self.out_of_order, 'row')} out of order: sorted")
        if self.duplicates:
            repeated = several(self.duplicates, "row")
            lines.append(f"{repeated} with a duplicate stamp: the first value of each column is kept")
        lines += [f"{name}: {several(n, 'row')} of short gaps filled" for name, n in self.filled.items()]
        lines += [
            f"{name}: {several(n, 'row')} left missing, first {self.first_missing[name]}"
            for name, n in self.missing.items()
        ]
        return "\n".join(lines)


def regularize(
    frame: pd.DataFrame,
    step: Any = None,
    max_gap: Any = "1h",
    *,
    held: Collection[str] = (),
    max_hold: Any = "1D",
    return_report: bool = False,
) -> pd.DataFrame | tuple[pd.DataFrame, RegularizeReport]:
    """Resample a log to an even step.

    Parameters
    ----------
    frame : DataFrame
        Left-labelled log with a DatetimeIndex; rows in any order, gaps and duplicate stamps are accepted.
    step : timedelta-like, optional
        Step of the result; default is the typical spacing of the stamps.
    max_gap : timedelta-like
        Longest gap in an input to fill, in a set-point with its last value, else by linear interpolation; longer gaps
        stay NaN.
    held : collection of str
        Columns that were logged by change (``held`` of a :class:`~skhybrid.logs.RawLog`): a value holds until the next.
    max_hold : timedelta-like
        Longest time for which a value of a held column holds; after it the column is missing.  A set-point
        (``T_heat_set``, ``T_cool_set``) holds for a week, or for ``max_hold`` if that is longer, and a plant that is
        off (0) until it is logged otherwise.
    return_report : bool

    Returns
    -------
    DataFrame
        The same columns, float64, at every multiple of ``step``; ``attrs["report"]`` is the report as text.
    report : RegularizeReport
        Only with ``return_report=True``.

    Raises
    ------
    ValueError
        If the frame has no two stamps or a row without one, ``held`` is not among its columns, a duration is not
        positive, or the result would have more than 40 million rows.

    Notes
    -----
    An input (a set-point, or anything but a temperature) becomes its time-weighted mean over the step: a row holds
    until the next one, or for one source step before a gap, and a step that is less than half covered is missing.  A
    boundary temperature (``T_...``) is interpolated linearly.  History (``T_za``, ``T_za_<zone>``, ``zeta``) takes the
    measurement nearest to the stamp and is never filled, so no later measurement leaks into it.  A held temperature is
    the last value at the stamp; where no column has a row for hours, though the log usually has many, it is an outage,
    and held history is missing in it.
    """
    _check(frame, held)
    hold = positive_duration(max_hold, "max_hold")
    span = duration_from_zero(max_gap, "max_gap")
    ordered, out_of_order, duplicates = _sort_and_deduplicate(frame)
    names = list(ordered.columns)
    stamps = pd.DatetimeIndex(ordered.index)
    source = _source_step(ordered, held, step)
    target = source if step is None else positive_duration(step, "step")
    slack = pd.Timedelta(0) if len(held) == len(names) else min(target, source) / 2
    grid = _even_index(stamps, target, source, slack)
    raw = {
        n: resample_column(n, numeric(ordered[n]), stamps, grid, target, source, hold if n in held else None)
        for n in names
    }
    silent = _silent(stamps, grid) if len(held) else np.zeros(len(grid), dtype=bool)
    raw = {n: np.where(silent, np.nan, v) if n in held and is_history(n) else v for n, v in raw.items()}
    hours = stamp_hours(grid)
    full = {
        n: v if n in held or is_history(n) else fill_gaps(v, hours, span, hold=is_set_point(n)) for n, v in raw.items()
    }
    out = pd.DataFrame(full, index=grid, columns=names)
    counted = _filled_and_missing(raw, out)
    report = RegularizeReport(target, source, len(frame), len(out), out_of_order, duplicates, *counted)
    out.attrs["report"] = str(report)
    return (out, report) if return_report else out


def _filled_and_missing(
    raw: dict[str, np.ndarray], out: pd.DataFrame
) -> tuple[dict[str, int], dict[str, int], dict[str, pd.Timestamp]]:
    """Number of rows by column that were filled, and that are missing, and the first of these."""
    gone = {name: out[name].isna().to_numpy() for name in raw}
    filled = {name: n for name, known in raw.items() if (n := int(np.isnan(known).sum() - gone[name].sum()))}
    missing = {name: int(rows.sum()) for name, rows in gone.items() if rows.any()}
    return filled, missing, {name: out.index[int(np.argmax(gone[name]))] for name in missing}


def _check(frame: pd.DataFrame, held: Collection[str]) -> None:
    if not isinstance(frame, pd.DataFrame) or not isinstance(frame.index, pd.DatetimeIndex):
        raise ValueError("regularize needs a DataFrame with a DatetimeIndex; read_zone_csv returns one.")
    if len(frame) < 2:
        raise ValueError(f"a log of {several(len(frame), 'row')} has no step; give two rows or more.")
    if frame.index.hasnans:
        raise ValueError(
            f"the index contains NaT at row {int(np.argmax(frame.index.isna()))}; every row needs a time stamp."
        )
    if not frame.columns.is_unique:
        raise ValueError(f"column {frame.columns[frame.columns.duplicated()][0]!r} appears twice; keep one of them.")
    if isinstance(held, str):
        raise ValueError(f"held={held!r} is one text; give a list of columns.")
    for name in held:
        if name not in frame:
            raise ValueError(f"held= names {name!r}, which is not among the columns: {listed(frame)}.")


def usual_step(frame: pd.DataFrame) -> pd.Timedelta:
    """Shortest of the columns' usual distances of two values; columns logged at different moments share no rows."""
    ordered = frame.sort_index(kind="stable")
    own = [pd.DatetimeIndex(ordered.index[ordered[name].notna()]).unique() for name in ordered]
    steps = [typical_step(index) for index in own if len(index) > 2]
    return min(steps, default=typical_step(pd.DatetimeIndex(ordered.index).unique()))


def _source_step(frame: pd.DataFrame, held: Collection[str], step: Any) -> pd.Timedelta:
    """The typical spacing of the rows of columns that are not held: a log of changes has no step of its own."""
    rows = frame.drop(columns=list(held)).dropna(how="all") if held else frame
    if len(rows) > 1:
        return usual_step(rows)
    if step is None:
        raise ValueError("all columns are held, and a log of changes has no step of its own; pass step='15min'.")
    return positive_duration(step, "step")


def _sort_and_deduplicate(frame: pd.DataFrame) -> tuple[pd.DataFrame, int, int]:
    """Rows with increasing stamps, each once with the first value of every column; how many were late, and twice."""
    backwards = int((frame.index[1:] < frame.index[:-1]).sum())
    ordered = frame.sort_index(kind="stable")
    twice = ordered.index.duplicated()
    if len(ordered) - twice.sum() < 2:
        raise ValueError("regularize needs at least two distinct stamps.")
    return ordered.groupby(level=0).first() if twice.any() else ordered, backwards, int(twice.sum())


def typical_step(index: pd.DatetimeIndex) -> pd.Timedelta:
    """The median spacing of the stamps, rounded to a common step if it is within 10 % of one."""
    seconds = float(np.median(np.diff(index.as_unit("ns").asi8))) / 1e9
    if seconds < 1e-3:
        raise ValueError(f"most stamps are {seconds:g} s apart, beginning with {index[0]}; give stamps in other units.")
    common = np.array(_COMMON_MINUTES) * 60.0
    nearest = float(common[int(np.argmin(np.abs(np.log(common / seconds))))])
    return pd.Timedelta(seconds=nearest if abs(nearest - seconds) <= 0.1 * nearest else round(seconds, 3))


def own_steps(index: pd.DatetimeIndex, usual: float) -> np.ndarray:
    """The step of each stamp [s]: the usual one, or that of a long stretch of stamps at another distance."""
    spacing = np.diff(index.as_unit("ns").asi8) / 1e9
    if len(spacing) < _STEADY:
        return np.full(len(index), usual)
    as_usual = np.abs(spacing - usual) <= 0.1 * usual
    stretch = np.append(0, np.cumsum(np.abs(np.diff(spacing)) > 0.1 * spacing[:-1]))
    is_long = np.bincount(stretch)[stretch] >= _STEADY
    steady = as_usual | (is_long & (spacing <= max(usual, SHORTEST_GAP.total_seconds())))
    steps = pd.Series(np.where(as_usual, usual, spacing)).where(steady).ffill().fillna(usual).to_numpy()
    return np.append(steps, steps[-1])


def _even_index(
    index: pd.DatetimeIndex, step: pd.Timedelta, source: pd.Timedelta, slack: pd.Timedelta
) -> pd.DatetimeIndex:
    """Every multiple of the step that the log covers, counted from local midnight of the first day.

    A stamp that is up to ``slack`` before the start of a step still belongs to that step.
    """
    shift = pd.Timedelta((index[0] + slack).utcoffset() or 0).value
    ends = index.as_unit("ns").asi8[[0, -1]]
    begin, end = (ends + slack.value + shift) // step.value * step.value - shift
    n_rows = (end - begin) // step.value + 1
    if n_rows > _MOST_ROWS:
        raise ValueError(
            f"a step of {spell(step)} from {index[0]} to {index[-1]} makes {n_rows:.3g} rows, but the log has one per "
            f"{spell(source)}; give a longer step, or drop rows whose stamps are wrong."
        )
    even = begin + step.value * np.arange(n_rows)  # np.arange(begin, end + 1, step) loses the last row after 104 days
    stamps = pd.DatetimeIndex(even.astype("datetime64[ns]"), name=index.name).as_unit(index.unit)
    return stamps if index.tz is None else stamps.tz_localize("UTC").tz_convert(index.tz)


def resample_column(
    name: str,
    values: np.ndarray,
    index: pd.DatetimeIndex,
    grid: pd.DatetimeIndex,
    step: pd.Timedelta,
    source: pd.Timedelta,
    hold: pd.Timedelta | None = None,
) -> np.ndarray:
    """One column at even stamps, from rows about ``source`` apart; NaN where the log has no data.

    If it was logged by change, each value holds until the next, at most for ``hold``.
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(grid), np.nan)
    ticks, seconds = index.as_unit("ns").asi8, step.total_seconds()
    wanted, logged, values = (grid.as_unit("ns").asi8 - ticks[0]) / 1e9, (ticks[known] - ticks[0]) / 1e9, values[known]
    if hold is not None:
        return _held(name, wanted, logged, values, seconds, hold)
    if is_history(name):
        return _nearest(wanted, logged, values, min(step, source).total_seconds() / 2)
    # a column may be logged less often than the others
    own = own_steps(index[known], (typical_step(index[known]) if known.sum() > 2 else source).total_seconds())
    if is_instant(name):
        return _interpolated(wanted, logged, values, own)
    spacing = np.append(np.diff(logged), own[-1])
    return _means(wanted, logged, values, seconds, np.where(spacing <= CONTIGUOUS * own, spacing, own))


def _held(
    name: str, wanted: np.ndarray, logged: np.ndarray, values: np.ndarray, step: float, hold: pd.Timedelta
) -> np.ndarray:
    """Values that were logged by change, at the wanted times [s]."""
    longest = (max(hold, _SET_POINT_HOLD) if is_set_point(name) else hold).total_seconds()
    if is_instant(name) or is_history(name):
        last = np.searchsorted(logged, wanted, side="right") - 1
        inside = (last >= 0) & (wanted - logged[last] <= longest)
        return np.where(inside, values[last], np.nan)
    held = np.where(is_plant(name) & (values == 0.0), np.inf, longest)  # it is off until it is logged otherwise
    spans = np.minimum(np.diff(logged, append=wanted[-1] + step), held)  # the last one holds to the end
    return _means(wanted, logged, values, step, spans)


def _silent(index: pd.DatetimeIndex, grid: pd.DatetimeIndex) -> np.ndarray:
    """Even stamps within an outage of the whole log: at least three hours without a row, unusual for it."""
    ticks, even = index.as_unit("ns").asi8, grid.as_unit("ns").asi8
    spacing = np.diff(ticks)
    outage = spacing >= max(SHORTEST_GAP.value, _SILENCE * float(np.quantile(spacing, 0.99)))
    before = np.clip(np.searchsorted(ticks, even, side="right") - 1, 0, len(spacing) - 1)
    return outage[before] & (even > ticks[before]) & (even < ticks[before + 1])


def _nearest(wanted: np.ndarray, logged: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
    """The value logged nearest to each wanted time; NaN if none lies within the tolerance [s]."""
    after = np.clip(np.searchsorted(logged, wanted), 1, max(len(logged) - 1, 1))
    if len(logged) == 1:
        row = np.zeros(len(wanted), dtype=np.int64)
    else:
        row = np.where(wanted - logged[after - 1] <= logged[after] - wanted, after - 1, after)
    return np.where(np.abs(logged[row] - wanted) <= tolerance, values[row], np.nan)


def _interpolated(wanted: np.ndarray, logged: np.ndarray, values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Linear interpolation; NaN in gaps and outside the log, except within half a step of a logged value."""
    line = np.interp(wanted, logged, values)
    after = np.searchsorted(logged, wanted)
    source = steps[np.clip(after - 1, 0, None)]
    left, right = logged[np.clip(after - 1, 0, None)], logged[np.clip(after, None, len(logged) - 1)]
    near = np.minimum(np.abs(wanted - left), np.abs(right - wanted)) <= source / 2
    inside = (after > 0) & (after < len(logged)) & (right - left <= CONTIGUOUS * source)
    return np.where(inside | near, line, np.nan)


def _means(wanted: np.ndarray, logged: np.ndarray, values: np.ndarray, step: float, held: np.ndarray) -> np.ndarray:
    """Means over [t, t + step) of a signal that holds each logged value for its time; NaN where half is not covered."""
    edges = np.column_stack([logged, logged + held]).ravel()

    def integral(signal: np.ndarray) -> np.ndarray:
        total = np.concatenate([[0.0], np.cumsum(signal * held)])
        at_edges = np.column_stack([total[:-1], total[1:]]).ravel()
        return np.interp(wanted + step, edges, at_edges) - np.interp(wanted, edges, at_edges)

    covered = integral(np.ones(len(values)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(covered >= 0.5 * step - 1e-6, integral(values) / covered, np.nan)
