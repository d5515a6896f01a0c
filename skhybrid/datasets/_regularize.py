"""Bringing a log to an even step: means for inputs, instant values for temperatures, and a report of what was done."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from .._table import HISTORY_ROLES
from ..preprocessing._frames import numeric
from ..preprocessing._gaps import fill_gaps, stamp_hours

#: steps that a log is likely to mean, in minutes.
_USUAL_MINUTES = (1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60, 120, 180, 240, 360, 720, 1440)
#: a row stands for the time to the next one if that is at most so many source steps away.
_CONTIGUOUS = 1.5


@dataclass(frozen=True)
class RegularizeReport:
    """What :func:`regularize` did; ``str()`` of it is a text to read.

    Attributes
    ----------
    step : Timedelta
        Step of the result.
    source_step : Timedelta
        Usual distance of the stamps before.
    rows_before, rows_after : int
    out_of_order, duplicates : int
        Rows that were sorted, and rows dropped because their stamp stood before.
    filled : dict of column to int
        Rows of short gaps that were filled.
    missing : dict of column to int
        Rows that are still NaN.
    first_missing : dict of column to Timestamp
        The first of them.
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
        lines = [f"{self.rows_before} rows about {before:g} min apart -> {self.rows_after} rows of {minutes:g} min"]
        if self.out_of_order:
            lines.append(f"{self.out_of_order} rows out of order: sorted")
        if self.duplicates:
            lines.append(f"{self.duplicates} rows with a stamp that stood before: dropped")
        lines += [f"{name}: {n} rows of short gaps filled" for name, n in self.filled.items()]
        lines += [
            f"{name}: {n} rows left missing, first {self.first_missing[name]}" for name, n in self.missing.items()
        ]
        return "\n".join(lines)


def regularize(
    frame: pd.DataFrame, step: Any = None, max_gap: Any = "1h", *, return_report: bool = False
) -> pd.DataFrame | tuple[pd.DataFrame, RegularizeReport]:
    """Resample a log to an even step.

    Parameters
    ----------
    frame : DataFrame
        Left-labelled log with a DatetimeIndex, in any order, with gaps and repeated stamps.
    step : timedelta-like, optional
        Step of the result; default = the usual distance of the stamps.
    max_gap : timedelta-like
        The longest gap of an input that is filled by a straight line; longer ones stay NaN.
    return_report : bool
        Whether to return the report too.

    Returns
    -------
    DataFrame
        The same columns, float64, at every multiple of ``step``; ``attrs["report"]`` holds the report as text.
    report : RegularizeReport
        Only with ``return_report=True``.

    Raises
    ------
    ValueError
        If there is no DatetimeIndex, a stamp is missing, a column is not numeric, or the step is not positive.

    Notes
    -----
    An input (``q_sol``, ``u_...``, ``Q_...``, anything that is no temperature) becomes its mean over the step, weighted
    by time: a row holds until the next one, or for one source step before a gap; a step covered by less than half is
    missing.  A boundary temperature (``T_oa``, ``T_...``) becomes its value at the stamp, on the line between its
    neighbours.  History (``T_za``, ``zeta``) becomes the value measured nearest to the stamp and is never filled, so
    that nothing measured later enters it.
    """
    _refuse(frame)
    span = pd.Timedelta(max_gap)
    tidy, out_of_order, duplicates = _tidy(frame)
    names = list(tidy.columns)
    stamps = pd.DatetimeIndex(tidy.index)
    source = _usual_step(stamps)
    target = source if step is None else pd.Timedelta(step)
    if not target > pd.Timedelta(0):
        raise ValueError(f"step={step!r} is not a positive duration such as '15min'.")
    grid = _even_index(stamps, target, source)
    raw = {name: _at_grid(name, numeric(tidy[name]), stamps, grid, target, source) for name in names}
    hours = stamp_hours(grid)
    full = {name: v if name in HISTORY_ROLES else fill_gaps(v, hours, span) for name, v in raw.items()}
    out = pd.DataFrame(full, index=grid, columns=names)
    missing = out.isna()
    report = RegularizeReport(
        step=target,
        source_step=source,
        rows_before=len(frame),
        rows_after=len(out),
        out_of_order=out_of_order,
        duplicates=duplicates,
        filled={n: k for n in names if (k := int(np.isnan(raw[n]).sum() - missing[n].sum()))},
        missing={n: int(missing[n].sum()) for n in names if missing[n].any()},
        first_missing={n: out.index[int(np.argmax(missing[n].to_numpy()))] for n in names if missing[n].any()},
    )
    out.attrs["report"] = str(report)
    return (out, report) if return_report else out


def _refuse(frame: pd.DataFrame) -> None:
    if not isinstance(frame, pd.DataFrame) or not isinstance(frame.index, pd.DatetimeIndex):
        raise ValueError("regularize needs a DataFrame with a DatetimeIndex; read_zone_csv returns one.")
    if len(frame) < 2:
        raise ValueError(f"regularize needs at least two rows, found {len(frame)}.")
    if frame.index.hasnans:
        raise ValueError(
            f"the index holds NaT at row {int(np.argmax(frame.index.isna()))}; every row needs a time stamp."
        )
    if not frame.columns.is_unique:
        raise ValueError(f"column {frame.columns[frame.columns.duplicated()][0]!r} stands twice; keep one of them.")


def _tidy(frame: pd.DataFrame) -> tuple[pd.DataFrame, int, int]:
    """Sorted rows of distinct stamps, how many were out of order, how many were dropped (the first one is kept)."""
    backwards = int((np.diff(pd.DatetimeIndex(frame.index).as_unit("ns").asi8) < 0).sum())
    ordered = frame.sort_index(kind="stable")
    twice = ordered.index.duplicated()
    if len(ordered) - twice.sum() < 2:
        raise ValueError("regularize needs at least two distinct stamps.")
    return ordered[~twice], backwards, int(twice.sum())


def _usual_step(index: pd.DatetimeIndex) -> pd.Timedelta:
    """The median distance of the stamps, brought to the nearest usual step where it is close to one."""
    seconds = float(np.median(np.diff(index.as_unit("ns").asi8))) / 1e9
    usual = np.array(_USUAL_MINUTES) * 60.0
    nearest = float(usual[int(np.argmin(np.abs(np.log(usual / seconds))))])
    return pd.Timedelta(seconds=nearest if abs(nearest - seconds) <= 0.1 * nearest else round(seconds, 3))


def _even_index(index: pd.DatetimeIndex, step: pd.Timedelta, source: pd.Timedelta) -> pd.DatetimeIndex:
    """Every multiple of the step, counted from local midnight of the first day, over the log."""
    slack = min(step, source) / 2  # a clock that runs a little early still belongs to its step
    first = index[0] + slack
    offset = first.utcoffset() or pd.Timedelta(0)
    ticks = index.as_unit("ns").asi8
    shift = pd.Timedelta(offset).value
    begin = (ticks[0] + slack.value + shift) // step.value * step.value - shift
    end = (ticks[-1] + slack.value + shift) // step.value * step.value - shift
    stamps = pd.DatetimeIndex(np.arange(begin, end + 1, step.value).astype("datetime64[ns]"), name=index.name)
    stamps = stamps.as_unit(index.unit)
    return stamps if index.tz is None else stamps.tz_localize("UTC").tz_convert(index.tz)


def _at_grid(
    name: str,
    values: np.ndarray,
    index: pd.DatetimeIndex,
    grid: pd.DatetimeIndex,
    step: pd.Timedelta,
    source: pd.Timedelta,
) -> np.ndarray:
    """One column at the even stamps; NaN where the log says nothing."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(grid), np.nan)
    ticks = index.as_unit("ns").asi8
    mine, theirs = (grid.as_unit("ns").asi8 - ticks[0]) / 1e9, (ticks[known] - ticks[0]) / 1e9
    if name in HISTORY_ROLES:
        return _nearest(mine, theirs, values[known], min(step, source).total_seconds() / 2)
    # a column may be logged less often than others
    own = (_usual_step(index[known]) if known.sum() > 2 else source).total_seconds()
    if str(name).startswith("T_"):
        return _between(mine, theirs, values[known], own)
    return _means(mine, theirs, values[known], step.total_seconds(), own)


def _nearest(mine: np.ndarray, theirs: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
    after = np.clip(np.searchsorted(theirs, mine), 1, max(len(theirs) - 1, 1))
    if len(theirs) == 1:
        row = np.zeros(len(mine), dtype=np.int64)
    else:
        row = np.where(mine - theirs[after - 1] <= theirs[after] - mine, after - 1, after)
    return np.where(np.abs(theirs[row] - mine) <= tolerance, values[row], np.nan)


def _between(mine: np.ndarray, theirs: np.ndarray, values: np.ndarray, source: float) -> np.ndarray:
    """On the line between neighbours; NaN inside gaps, the nearest value within half a source step of the ends."""
    line = np.interp(mine, theirs, values)
    after = np.searchsorted(theirs, mine)
    left, right = theirs[np.clip(after - 1, 0, None)], theirs[np.clip(after, None, len(theirs) - 1)]
    near = np.minimum(np.abs(mine - left), np.abs(right - mine)) <= source / 2
    inside = (after > 0) & (after < len(theirs)) & (right - left <= _CONTIGUOUS * source)
    return np.where(inside | near, line, np.nan)


def _means(mine: np.ndarray, theirs: np.ndarray, values: np.ndarray, step: float, source: float) -> np.ndarray:
    """Means over [t, t + step) of a signal that every row holds until the next one."""
    gap = np.append(np.diff(theirs), source)
    lasts = np.where(gap <= _CONTIGUOUS * source, gap, source)
    edges = np.column_stack([theirs, theirs + lasts]).ravel()

    def over(weight: np.ndarray) -> np.ndarray:
        """The integral of a held signal over every step."""
        total = np.concatenate([[0.0], np.cumsum(weight * lasts)])
        at_edges = np.column_stack([total[:-1], total[1:]]).ravel()
        return np.interp(mine + step, edges, at_edges) - np.interp(mine, edges, at_edges)

    covered = over(np.ones(len(values)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(covered >= 0.5 * step - 1e-6, over(values) / covered, np.nan)
