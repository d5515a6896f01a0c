"""Reader of thermostat and meter logs in CSV files."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from .._arguments import as_mapping
from .._table import is_instant, listed, role_of
from ..preprocessing._units import conversion_of, convert
from .even_steps import CONTIGUOUS, own_steps, typical_step, usual_step
from .named_zones import zoned_stamps
from .readers import json_log
from .stamp_cells import find_stamp_columns
from .stamp_parts import joined_cells
from .stamps import cell, in_zone, line
from .text_files import damage_refused, existing, head_of


def read_zone_csv(
    path: str | PathLike[str],
    columns: Mapping[str, str] | None = None,
    *,
    timezone: str | None = None,
    label: str = "left",
    units: Mapping[str, str] | None = None,
    time_column: str | Sequence[str] | None = None,
    dayfirst: bool | None = None,
    sep: str = ",",
    decimal: str = ".",
) -> pd.DataFrame:
    """Read a thermostat or meter log from a CSV file.

    Parameters
    ----------
    path : path-like
        CSV file with one header line; it may be compressed.
    columns : dict of role to CSV column, optional
        The columns to read and their roles; a key that is not a role becomes the name of an extra column.  By default,
        columns named after a role are read and all others are dropped.
    timezone : str, optional
        Zone of stamps without an offset (``"Europe/Amsterdam"``), or the zone to convert stamps with an offset to.
        In the hour that occurs twice in autumn, stamps are summer time until the clock goes back.
    label : {"left", "right"}
        Whether a row is stamped with the start or the end of the interval that its means cover.  Right-labelled means
        and set-points move to the start of their interval, each column by its own; temperatures are values at the
        stamp and stay there.
    units : dict of role to unit, optional
        Units of the log that differ from the contract's: ``{"T_oa": "degF", "q_sol": "W/m2", "u_heat": "percent"}``.
    time_column : str or pair of str, optional
        The column of time stamps, or those of date and time; by default found by their cells and names.
    dayfirst : bool, optional
        Whether dates such as 02/03/2024 begin with the day; only needed if no date in the file shows it.
    sep, decimal : str

    Returns
    -------
    DataFrame
        One float64 column per role, sorted by time; NaN where a cell is empty.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read with these settings; the message names the row and the column.
    """
    if label not in ("left", "right"):
        raise ValueError(f"label={label!r} must be 'left' or 'right'.")
    units = as_mapping("units", units, "roles to units")
    roles = None if columns is None else as_mapping("columns", columns, "roles to columns of the file")
    file, where = existing(path)
    if json_log.looks_like(file, head_of(file)):
        raise ValueError(f"{where} is JSON; read it with skhybrid.logs.read_log, or write it as CSV.")
    table = _read_cells(file, where, sep, decimal)
    of_stamps = find_stamp_columns(table, time_column, where)
    chosen = _columns_by_role(table, roles, of_stamps, where)
    cells = joined_cells(table, of_stamps)
    found = zoned_stamps(cells, of_stamps, where, dayfirst=dayfirst, timezone=timezone, guesses=False)
    stamps = in_zone(found.stamps, timezone, cells, where)
    frame = pd.DataFrame({role: _to_numbers(table[column], column, where) for role, column in chosen.items()})
    frame.index = stamps.rename("time")
    if stamps[0] > stamps[-1]:  # the newest row comes first
        frame = frame[::-1]
    for role, unit in units.items():
        if role not in frame:
            raise ValueError(f"units= names {role!r}, which is not among the columns: {listed(frame)}.")
        frame[role] = convert(frame[role].to_numpy(), conversion_of(unit, role))
    frame = frame.sort_index(kind="stable")
    return to_left_label(frame) if label == "right" else frame


def to_left_label(frame: pd.DataFrame, stay: Collection[str] = ()) -> pd.DataFrame:
    """Move right-labelled means to the start of their interval; temperatures stay, rows left without one are dropped.

    Parameters
    ----------
    frame : DataFrame of at least two rows
        Columns by role at the stamps that end their intervals, each stamp once.  A column may have values in some of
        the rows only: the interval of a mean is that of its column.  Set-points are those of the interval, as stages.
    stay : collection of str
        Columns whose values begin at their stamps, such as those that were logged by change.

    Returns
    -------
    DataFrame
        Temperatures but for the last row's, joined with the means at the stamps that begin their intervals.

    Raises
    ------
    ValueError
        If there are fewer than two rows, or a stamp appears twice.
    """
    if len(frame) < 2:
        raise ValueError("a right-labelled log needs at least two rows, which show its step.")
    if not frame.index.is_unique:
        twice = frame.index[frame.index.duplicated()][0]
        raise ValueError(f"the time stamp {twice} appears twice in a right-labelled log; keep one of the rows.")
    frame = frame.sort_index()
    usual, stamps = usual_step(frame), pd.DatetimeIndex(frame.index)
    means = {
        name: _from_its_start(values.dropna(), usual)
        for name, values in frame.items()
        if not is_instant(name) and name not in stay
    }
    if not means:
        return frame
    index = stamps[:-1]
    for moved in means.values():
        index = index.union(pd.DatetimeIndex(moved.index))
    index = index[(index >= stamps[0]) & (index < stamps[-1])]
    return pd.DataFrame({name: means.get(name, values).reindex(index) for name, values in frame.items()})


def _from_its_start(means: pd.Series, usual: pd.Timedelta) -> pd.Series:
    """Means that end at their stamps, at the end of the one before; after a gap one step of their own earlier."""
    ends = pd.DatetimeIndex(means.index)
    usual = typical_step(ends) if len(ends) > 2 else usual
    steps = own_steps(ends, usual.total_seconds())
    own = pd.to_timedelta(np.append(steps[:1], steps[:-1]), unit="s")
    before = ends[np.arange(len(ends)) - 1]
    follows = (ends > before) & (ends - before < CONTIGUOUS * own)
    return means.set_axis(before.where(follows, (ends - own).as_unit(ends.unit)), axis=0)


def _read_cells(file: Path, where: str, sep: str, decimal: str) -> pd.DataFrame:
    try:
        with damage_refused(where):
            table = pd.read_csv(file, sep=sep, decimal=decimal, skipinitialspace=True, encoding="utf-8-sig")
    except pd.errors.EmptyDataError:
        raise ValueError(f"{where} is empty; export it again.") from None
    except UnicodeDecodeError:
        raise ValueError(f"{where} is not encoded in UTF-8; save it as CSV UTF-8.") from None
    except pd.errors.ParserError as error:
        raise ValueError(f"{where} cannot be read as CSV ({str(error).strip()}).") from error
    table.columns = [str(c).strip() for c in table.columns]
    if table.empty:
        raise ValueError(f"{where} has a header but no rows.")
    if table.shape[1] == 1:
        raise ValueError(f"{where} has only one column, {table.columns[0]!r}; pass its separator, such as sep=';'.")
    if not isinstance(table.index, pd.RangeIndex):  # pandas has taken the first columns for labels of the rows
        raise ValueError(f"{where} has rows with more cells than its header has names; name every column.")
    if not table.columns.is_unique:
        raise ValueError(f"{where} has two columns {table.columns[table.columns.duplicated()][0]!r}; rename one.")
    return table


def _columns_by_role(
    table: pd.DataFrame, columns: Mapping[str, str] | None, of_stamps: Sequence[str], where: str
) -> dict[str, str]:
    shown = ", ".join(repr(c) for c in table.columns if c not in of_stamps)
    if columns is None:
        found = {c: c for c in table.columns if role_of(c) is not None}
        if not found:
            raise ValueError(f"no column of {where} is named after a role ({shown}); pass columns={{role: column}}.")
        return found
    for role, column in columns.items():
        if column not in table:
            raise ValueError(f"columns= assigns {role!r} to the column {column!r}, but {where} has {shown}.")
    return dict(columns)


def _to_numbers(column: pd.Series, name: str, where: str) -> np.ndarray:
    """Convert a column to float64, empty cells to NaN."""
    numbers = pd.to_numeric(column, errors="coerce").astype(np.float64)
    wrong = numbers.isna() & column.notna()
    if column.dtype == object or pd.api.types.is_string_dtype(column):
        wrong &= column.astype(str).str.strip() != ""
    if wrong.any():
        first = column[wrong].index.min()
        raise ValueError(
            f"row {line(first)} of {where}, column {name!r}: {cell(column[first])} is not a number; leave the cell "
            "empty if nothing was measured."
        )
    return numbers.to_numpy()
