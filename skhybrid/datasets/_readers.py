"""Logs in CSV files, read to the data contract."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from .._table import role_of
from ..preprocessing._units import conversion_of, convert
from ._stamps import find_stamp_column, line, parse_stamps


def read_zone_csv(
    path: str | PathLike[str],
    columns: Mapping[str, str] | None = None,
    *,
    timezone: str | None = None,
    label: str = "left",
    units: Mapping[str, str] | None = None,
    time_column: str | None = None,
    dayfirst: bool | None = None,
    sep: str = ",",
    decimal: str = ".",
) -> pd.DataFrame:
    """Read a thermostat or meter log.

    Parameters
    ----------
    path : path-like
        CSV file with one header line, compressed or not.
    columns : dict of role to CSV column, optional
        What to read and which role it has; a name that is no role is kept as a further column.  By default the
        columns that bear a role's name are read; all others are dropped.
    timezone : str, optional
        Zone of stamps without an offset (``"Europe/Amsterdam"``), or the zone that stamps with an offset are shown
        in.  In the hour that autumn repeats, stamps are summer time until the clock goes back.
    label : {"left", "right"}
        Whether a row is stamped with the start or the end of the time that its means cover.  Right-labelled means
        move to the start of their step; temperatures are values at the stamp and stay.
    units : dict of role to unit, optional
        Logged units that differ from the contract's: ``{"T_oa": "degF", "q_sol": "W/m2", "u_heat": "percent"}``.
    time_column : str, optional
        The column of stamps; found by its name or cells if not given.
    dayfirst : bool, optional
        Whether dates such as 02/03/2024 begin with the day; needed only where no date tells.
    sep, decimal : str
        Separator of cells and decimal sign.

    Returns
    -------
    DataFrame
        One float64 column a role, sorted by time; NaN where a cell is empty.

    Raises
    ------
    FileNotFoundError, ValueError
        In one sentence with the row and column where the file cannot be read as asked.
    """
    if label not in ("left", "right"):
        raise ValueError(f"label={label!r} must be 'left' or 'right'.")
    file = Path(path)
    where = repr(file.name)
    table = _read_cells(file, where, sep, decimal)
    stamp_column = find_stamp_column(table, time_column, where)
    chosen = _choose(table, columns, stamp_column, where)
    if _runs_backwards(table[stamp_column]):
        table = table[::-1]  # the index keeps the row of the file
    stamps = parse_stamps(table[stamp_column], timezone, dayfirst, where)
    frame = pd.DataFrame({role: _numbers(table[column], column, where) for role, column in chosen.items()})
    frame.index = stamps.rename("time")
    for role, unit in (units or {}).items():
        if role not in frame:
            raise ValueError(f"units= names {role!r}, which is not read; the roles are {', '.join(map(repr, frame))}.")
        frame[role] = convert(frame[role].to_numpy(), conversion_of(unit, role))
    frame = frame.sort_index(kind="stable")
    return to_left_label(frame) if label == "right" else frame


def to_left_label(frame: pd.DataFrame) -> pd.DataFrame:
    """Move right-labelled means to the start of their step; temperatures (``T_...``) stay at their stamp.

    Rows whose means or temperatures lie outside the log (one at either end) are dropped.
    """
    instant = [c for c in frame if str(c).startswith("T_")]
    means = frame.drop(columns=instant)
    if len(frame) < 2:
        raise ValueError("a right-labelled log needs at least two rows to know its step.")
    if not frame.index.is_unique:
        twice = frame.index[frame.index.duplicated()][0]
        raise ValueError(f"the stamp {twice} stands twice in a right-labelled log; keep one of the rows.")
    stamps = pd.DatetimeIndex(frame.index)
    ticks = stamps.as_unit("ns").asi8
    step = int(np.median(np.diff(ticks)))
    # a stamp about one step back is the row before; behind a gap the mean gets a row of its own
    begin = np.where(np.diff(ticks) < 1.5 * step, ticks[:-1], ticks[1:] - step)
    start = pd.DatetimeIndex(begin.astype("datetime64[ns]"), tz=None if stamps.tz is None else "UTC")
    start = (start if stamps.tz is None else start.tz_convert(stamps.tz)).as_unit(stamps.unit).rename(stamps.name)
    moved = means.iloc[1:].set_axis(start, axis=0)
    if not instant:
        return moved
    return frame[instant].iloc[:-1].join(moved, how="outer")[list(frame.columns)]


def _read_cells(file: Path, where: str, sep: str, decimal: str) -> pd.DataFrame:
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}.")
    try:
        table = pd.read_csv(file, sep=sep, decimal=decimal, skipinitialspace=True, encoding="utf-8-sig")
    except pd.errors.EmptyDataError:
        raise ValueError(f"{where} is empty.") from None
    except UnicodeDecodeError:
        raise ValueError(f"{where} is not written in UTF-8; save it as CSV UTF-8.") from None
    except pd.errors.ParserError as error:
        raise ValueError(f"{where} cannot be read as CSV ({str(error).strip()}).") from error
    table.columns = [str(c).strip() for c in table.columns]
    if table.empty:
        raise ValueError(f"{where} has a header but no rows.")
    if table.shape[1] == 1:
        raise ValueError(f"{where} has one column only, {table.columns[0]!r}; pass the separator as sep=';'.")
    return table


def _choose(table: pd.DataFrame, columns: Mapping[str, str] | None, stamp_column: str, where: str) -> dict[str, str]:
    there = ", ".join(repr(c) for c in table.columns if c != stamp_column)
    if columns is None:
        found = {c: c for c in table.columns if role_of(c) is not None}
        if not found:
            raise ValueError(f"no column of {where} bears a role's name ({there}); pass columns={{role: column}}.")
        return found
    for role, column in columns.items():
        if column not in table:
            raise ValueError(f"columns= gives {role!r} the column {column!r}, but {where} has {there}.")
    return dict(columns)


def _numbers(column: pd.Series, name: str, where: str) -> np.ndarray:
    """A column as float64; empty cells are NaN."""
    numbers = pd.to_numeric(column, errors="coerce").astype(np.float64)
    wrong = numbers.isna() & column.notna()
    if column.dtype == object or pd.api.types.is_string_dtype(column):
        wrong &= column.astype(str).str.strip() != ""
    if wrong.any():
        first = column[wrong].index.min()
        raise ValueError(
            f"row {line(first)} of {where}, column {name!r}: {column[first]!r} is not a number; leave the cell empty "
            "if nothing was measured."
        )
    return numbers.to_numpy()


def _runs_backwards(cells: pd.Series) -> bool:
    """Whether a log lists its newest row first, seen from its ends."""
    ends = pd.to_datetime(cells.iloc[[0, -1]].astype(str), errors="coerce", utc=True, format="mixed")
    return bool(ends.iloc[0] > ends.iloc[1])
