"""Pieces of a table, wide or long, put together to a log."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from .._arguments import check_integer
from .._table import listed
from .._warnings import several
from .cell_numbers import NumberColumn, columns_judged, number_in, quality_columns, without_bad
from .log_findings import stamps_going_back
from .named_zones import zoned_stamps
from .naming import unit_in_name
from .paired_columns import ROW
from .raw_log import RawLog
from .stamp_cells import is_stamp, is_stamp_name
from .stamp_parts import joined_cells
from .stamps import YEARS, as_written, in_zone, line, localize, read_day_first
from .unit_names import is_unit, unit_or_energy, unit_text

_EVEN = 0.5  # share of intervals about as long as the usual one, below which a channel is logged by change
_SPARSE = 10.0  # times the shortest usual interval of the others, from which on a channel is sparse; then also if
_EVEN_OF_SPARSE = 0.75  # fewer than this share are even, or it has
_FEW_A_DAY = (pd.Timedelta("3h").value, pd.Timedelta("20h").value)  # a few values a day; daily readings are samples
_REPEATS, _OFTEN, _SKIPPED = 0.01, 10, 0.2  # equal neighbours; long intervals: their number, their share of the time
_DENSE = 0.8  # share of the rows of a wide table, from which on a channel is sampled with them
_UNIT_COLUMN = re.compile(r"units?([ _]of[ _]measure(ment)?)?|uom|einheit|eenheid|unit[ée]", re.IGNORECASE)
_ENDS = re.compile(r"(?i)(period|interval|hour|time|date)s?[ _-]?end(ing|s|ed)?|end[ _-]?(time|date)|bis|hasta|fin|tot")
_LONG_BACK = pd.Timedelta("2h")  # stamps go back by an hour in autumn
_CLASHING = 0.1  # share of a channel's values that others at the same stamps replace
_CELLS = 1 << 19  # cells of a piece


@dataclass(frozen=True)
class Choice:
    """Options that all readers of general tables take."""

    columns: Sequence[str] | None = None  # channels to read; all by default
    time_column: str | Sequence[str] | None = None  # that of time stamps, or those of date and time
    timezone: str | None = None  # of stamps without an offset, or to convert stamps with an offset to
    dayfirst: bool | None = None  # whether dates such as 02/03/2024 begin with the day
    held: bool | Sequence[str] | None = None  # channels that keep their value; by default those logged by change
    year: int | None = None  # of the first stamp, where stamps have none

    def __post_init__(self) -> None:
        for name, given in (("columns", self.columns), ("held", None if isinstance(self.held, bool) else self.held)):
            if isinstance(given, str) or not isinstance(given, Iterable | None):
                what = "one text" if isinstance(given, str) else "no list"
                raise ValueError(f"{name}={given!r} is {what}; give a list of channels.")
        if self.year is not None:
            check_integer("year", self.year, *YEARS)

    def wanted(self, names: Iterable[str], stamps: Sequence[str], where: str) -> list[str]:
        """The channels to read among the columns of a table, in its order."""
        channels = [name for name in names if name not in stamps]
        if self.columns is None:
            return channels
        for name in self.columns:
            if name not in channels:
                raise ValueError(
                    f"columns= names {name!r}, which is not in {where}; its channels are {listed(channels)}."
                )
        return [name for name in channels if name in set(self.columns)]


@dataclass
class Pieces:
    """Pieces of a table, and what is known of it before they are read."""

    frames: Iterable[pd.DataFrame]  # rows of the table, cells as text, numbers or dates
    stamps: tuple[str, ...]  # columns of the time stamp, or of date and time
    where: str  # the source as messages name it
    format: str
    units: dict[str, str] = field(default_factory=dict)  # beside those in the names, as the source writes them
    decimal: str = "."
    first_line: int = 2  # of the file, that holds the first row
    notes: list[str] = field(default_factory=list)
    label: str | None = None  # "right" where stamps show that they end their rows
    first: pd.Timestamp | None = None  # the earliest stamp as it is written
    day_first: bool | None = None  # whether dates begin with the day, where they tell


def assemble(pieces: Pieces, choice: Choice) -> RawLog:
    """The log of a wide table, one column per channel."""
    channels: dict[str, NumberColumn] = {}
    texts = []
    for kept in _with_stamps(pieces):
        texts.append(joined_cells(kept, pieces.stamps))
        kept = without_bad(kept, columns_judged(kept.columns.drop(list(pieces.stamps))))
        for name in kept.columns.drop(list(pieces.stamps)):
            channels.setdefault(str(name), NumberColumn()).add(kept[name], pieces.decimal)
    stamps, order = _stamps(texts, pieces, choice)
    kept_channels = _numeric_channels(channels, pieces)
    frame = pd.DataFrame({n: c.values()[order] for n, c in kept_channels.items()}, index=stamps, copy=False)
    if not frame.index.is_monotonic_increasing:
        if len(back := stamps_going_back(stamps)):
            hint = "; if clocks were put back then, pass timezone=" if stamps.tz is None else ""
            pieces.notes.append(f"stamps go back {several(len(back), 'time')}, first at {back[0]}: sorted{hint}")
        frame = frame.sort_index(kind="stable")
    return _finish(frame, kept_channels, pieces, choice, sparse_only=True)


def assemble_long(pieces: Pieces, point: str, value: str, choice: Choice) -> RawLog:
    """The log of a long table, one row per value of a channel; a column may name the unit of each."""
    channels: dict[str, NumberColumn] = {}
    places: dict[str, list[np.ndarray]] = {}
    texts, n_rows = [], 0
    wanted = None if choice.columns is None else set(choice.columns)
    for kept in _with_stamps(pieces):
        kept = kept[kept[point].notna() if wanted is None else kept[point].astype(str).str.strip().isin(wanted)]
        texts.append(joined_cells(kept, pieces.stamps))
        kept = without_bad(kept, dict.fromkeys(quality_columns(kept), value))
        for name, own in kept.groupby(point, sort=False, observed=True).indices.items():
            channel = channels.setdefault(str(name).strip(), NumberColumn())
            channel.add(kept[value].iloc[own], pieces.decimal)
            for units in (kept[column].iloc[own].dropna() for column in unit_columns(kept)):
                channel.units.update(text for text in units.astype(str).unique() if is_unit(text))
            places.setdefault(str(name).strip(), []).append(np.asarray(own) + n_rows)
        n_rows += len(kept)
    if wanted is not None:
        choice.wanted(channels, (), pieces.where)
    places_of = {name: np.concatenate(parts) for name, parts in places.items()}
    stamps = _long_stamps(texts, places_of, pieces, choice)
    kept_channels = _numeric_channels(channels, pieces)
    index = stamps.unique().sort_values()
    ticks, found = index.asi8, stamps.as_unit(index.unit).asi8
    frame = {}
    for name, channel in kept_channels.items():
        column = np.full(len(index), np.nan)
        rows = places_of[name if name in places_of else name.rpartition(": ")[0]]  # of two made of one column of words
        at: np.ndarray = np.searchsorted(ticks, found[rows])
        column[at] = channel.values()
        if n := _n_replaced(name, channel.values(), column[at], pieces.where):
            pieces.notes.append(f"{name!r} has two values at {several(n, 'stamp')}: the last one is read")
        frame[name] = column
    return _finish(pd.DataFrame(frame, index=index.rename("time"), copy=False), kept_channels, pieces, choice)


def _n_replaced(name: str, values: np.ndarray, kept: np.ndarray, where: str) -> int:
    """Values of a channel that others at their stamps replace; refused where many are, as of a column of rooms."""
    other = np.isfinite(values) & np.isfinite(kept) & (values != kept)
    if other.mean() > _CLASHING:
        raise ValueError(
            f"{where} has two or more values of {name!r} at {several(int(other.sum()), 'stamp')}; if another column "
            "tells them apart, such as one of rooms, name that as point_column, or join both in one column."
        )
    return int(other.sum())


def rows_of_piece(n_columns: int) -> int:
    """Rows of a table of so many columns to read at a time."""
    return max(1000, _CELLS // max(n_columns, 1))


def unit_columns(names: Iterable[Hashable]) -> list[str]:
    """The columns of a long table that have the usual name of one of units."""
    return [str(name) for name in names if _UNIT_COLUMN.fullmatch(str(name).strip())]


def columns_beside(names: Iterable[Hashable]) -> list[str]:
    """The columns of a long table that are read beside those of points and values: units and qualities."""
    names = list(names)
    return [*unit_columns(names), *quality_columns(names)]


def _with_stamps(pieces: Pieces) -> Iterator[pd.DataFrame]:
    """The rows of each piece that have a time stamp, numbered so that messages name their line of the file."""
    begin, date = pieces.first_line - 2, None
    for rows in pieces.frames:
        at = rows.index + pieces.first_line - 2 if rows.index.name == ROW else range(begin, begin + len(rows))
        piece = rows.set_axis(at, axis=0)
        if len(pieces.stamps) == 2 and len(piece):
            piece, date = _with_dates(piece, pieces, date)
        yield _with_stamp(piece, pieces)
        begin += len(piece)


def _with_dates(piece: pd.DataFrame, pieces: Pieces, date: Any) -> tuple[pd.DataFrame, Any]:
    """The rows with the date above them where they have a time alone, and the last date; merged cells leave such."""
    day, time = pieces.stamps
    blank = piece[day].isna() | (piece[day].astype(str).str.strip() == "")
    alone = blank & piece[time].astype(str).str.contains(r"\d:\d")
    dates = piece[day].where(~blank).ffill()
    dates = dates if date is None else dates.fillna(date)
    if alone.any():
        pieces.notes.append(f"{several(int(alone.sum()), 'row')} without a date taken as of the date above")
    return piece.assign(**{day: piece[day].where(~alone, dates)}), dates.iloc[-1]


def _with_stamp(piece: pd.DataFrame, pieces: Pieces) -> pd.DataFrame:
    """The rows that have a time stamp; a footer such as "Total" or "Page 3 of 9" and a repeated header have none."""
    cells = piece[pieces.stamps[0]]
    known = cells.notna()
    if not (pd.api.types.is_datetime64_any_dtype(cells) or pd.api.types.is_numeric_dtype(cells)):
        known &= cells.astype(str).str.contains(r"\d", regex=True)
        rest = piece.drop(columns=list(pieces.stamps))
        alone = known & (rest.isna() | (rest == "")).all(axis=1)
        known &= ~alone | cells.where(alone, "").map(lambda cell: is_stamp(str(cell).strip()))
    if known.all():
        return piece
    _refuse_other_header(piece[~known], pieces.where, pieces.stamps[0])
    filled = piece[~known].replace(r"^\s*$", np.nan, regex=True).notna().any(axis=1)
    if filled.any():
        pieces.notes.append(f"{several(int(filled.sum()), 'row')} without a time stamp left out")
    return piece[known]


def _refuse_other_header(rows: pd.DataFrame, where: str, stamp: str) -> None:
    """Refuse a row that names other columns, or at other places, as where exports were put one below the other."""
    names = list(map(str, rows.columns))
    for row, cells in zip(rows.index, rows.to_numpy(dtype=object), strict=True):
        found = [str(cell).strip() for cell in cells]
        other = {cell: name for name, cell in zip(names, found, strict=True) if cell not in (name, "", "nan")}
        moved = [cell for cell in other if cell in names]
        anew = f"line {line(row)} of {where} names the columns anew, and"
        if moved:
            raise ValueError(
                f"{anew} {moved[0]!r} at another place; split the file there, or put the columns in one order."
            )
        new = [cell for cell, name in other.items() if name != stamp and number_in(cell) is None and not is_stamp(cell)]
        if new and is_stamp_name(found[names.index(stamp)]):
            raise ValueError(f"{anew} {new[0]!r} in place of {other[new[0]]!r}; split the file there.")


def _read(texts: list[pd.Series], pieces: Pieces, choice: Choice) -> tuple[pd.Series, pd.DatetimeIndex]:
    """The cells of time stamps of all pieces, and the stamps as they are written."""
    cells = pd.concat(texts) if texts else pd.Series(dtype=object)
    texts.clear()
    if cells.empty:
        raise ValueError(f"{pieces.where} has no rows with a time stamp.")
    if cells.dtype == object and not isinstance(first := cells.iloc[0], str) and hasattr(first, "year"):
        mixed = any(getattr(one, "tzinfo", None) is not None for one in (first, cells.iloc[-1]))
        cells = pd.Series(pd.to_datetime(cells, utc=mixed), index=cells.index)
    found = zoned_stamps(
        cells, pieces.stamps, pieces.where, dayfirst=choice.dayfirst, timezone=choice.timezone, year=choice.year
    )
    pieces.notes.extend(found.notes)
    ends = found.ends_rows or any(map(_ENDS.fullmatch, pieces.stamps))
    pieces.label = "right" if ends else None
    pieces.day_first = read_day_first(cells, found.stamps)
    earliest = int(found.stamps.argmin())
    pieces.first = as_written(found.stamps[earliest], cells.iloc[earliest])
    return cells, found.stamps


def _stamps(texts: list[pd.Series], pieces: Pieces, choice: Choice) -> tuple[pd.DatetimeIndex, slice]:
    """Stamps in the order of time as far as the file has one, and the order of the rows: forwards or backwards."""
    cells, stamps = _read(texts, pieces, choice)
    order = slice(None, None, -1 if stamps[0] > stamps[-1] else 1)
    return in_zone(stamps, choice.timezone, cells, pieces.where)[order].rename("time"), order


def _long_stamps(
    texts: list[pd.Series], places: Mapping[str, np.ndarray], pieces: Pieces, choice: Choice
) -> pd.DatetimeIndex:
    """Stamps of all rows of a long table, which may follow each other by time or by channel."""
    cells, stamps = _read(texts, pieces, choice)
    by_channel = (stamps[1:] - stamps[:-1] < -_LONG_BACK).any()
    if choice.timezone is None or stamps.tz is not None or not by_channel:
        return in_zone(stamps, choice.timezone, cells, pieces.where)
    ticks = np.empty(len(stamps), dtype=np.int64)
    for rows in places.values():  # one channel after the other: each has its own hour that occurs twice
        part = localize(stamps[rows], choice.timezone, cells.iloc[rows], pieces.where)
        ticks[rows] = part.as_unit("ns").asi8
    return pd.DatetimeIndex(ticks.astype("datetime64[ns]"), tz="UTC").tz_convert(choice.timezone)


def _numeric_channels(channels: dict[str, NumberColumn], pieces: Pieces) -> dict[str, NumberColumn]:
    """The channels of numbers, and notes on words that were found."""
    kept: dict[str, NumberColumn] = {}
    for name, channel in channels.items():
        word, n = channel.usual_word
        if found := channel.channels(name):
            kept |= found
            if name not in found:
                pieces.notes.append(f"the words of {name!r} are read as the stages {' and '.join(map(repr, found))}")
        elif channel.is_text:
            hint = "; if it says when the plant ran, write columns of 1 and 0 for heating and cooling"
            text = f"{name!r} is left out, since it holds text such as {word!r}"
            pieces.notes.append(text + hint * channel.tells_plant)
        elif channel.n_numbers or not name.startswith("column "):
            kept[name] = channel
            if n:
                pieces.notes.append(f"{name!r}: {several(n, 'cell')} such as {word!r} taken as missing")
            if 0 < channel.n_switches < channel.n_numbers / 2:
                pieces.notes.append(
                    f"{name!r}: {several(channel.n_switches, 'cell')} such as {channel.switch!r} read as 1 or 0, and "
                    "as missing in a temperature"
                )
            if channel.thousands:
                pieces.notes.append(
                    f"{name!r}: cells such as {channel.thousands!r} are read as thousands; if they are decimals, pass "
                    "decimal=',' for a CSV, or store them as numbers in Excel"
                )
    if not kept:
        words = [channel.usual_word[0] for channel in channels.values() if channel.usual_word[1]]
        such = f"; its cells are such as {words[0]!r}" if words else ""
        raise ValueError(f"{pieces.where} has no column of numbers beside its time stamps{such}.")
    return kept


def _finish(
    frame: pd.DataFrame, channels: Mapping[str, NumberColumn], pieces: Pieces, choice: Choice, sparse_only: bool = False
) -> RawLog:
    """The log, with its units, its held channels and the notes."""
    written = {n: text for n in frame if (text := unit_text(str(n)))}
    written |= {n: text for n, text in pieces.units.items() if n not in written or unit_or_energy(text)}
    written |= {n: _unit_of_cells(c, n, pieces.where) for n, c in channels.items() if c.units}
    units = {str(name): unit for name in frame if (unit := unit_or_energy(written.get(name, ""))) is not None}
    others = [f"{n!r} in {written[n]}" for n in frame if n in written and n not in units and not unit_in_name(str(n))]
    if others:
        pieces.notes.append(f"units that are not converted: {', '.join(others)}")
    if choice.held is None:
        held = frozenset(held_channels(frame, sparse_only))
        if held:
            pieces.notes.append(f"logged by change, so held until the next value: {', '.join(map(repr, sorted(held)))}")
    elif isinstance(choice.held, bool):
        held = frozenset(map(str, frame) if choice.held else ())
    else:
        held = frozenset(choice.held)
        for name in held - set(frame):
            raise ValueError(f"held= names {name!r}, which is not a channel of {pieces.where}.")
    notes = tuple(note if n == 1 else f"{note} ({n} times)" for note, n in Counter(pieces.notes).items())
    if held and not frame.index.is_unique:
        frame = frame.groupby(level=0).last()  # of each channel the last value that was written
    switches = frozenset(str(name) for name, channel in channels.items() if channel.n_switches)
    modes = frozenset(str(name) for name, channel in channels.items() if channel.is_mode)
    found = pieces.label, notes, switches, modes, pieces.first, pieces.day_first
    return RawLog(frame, pieces.format, units, {}, {}, held, *found)


def _unit_of_cells(channel: NumberColumn, name: str, where: str) -> str:
    """The unit that is written in the cells of a channel, refused where there are several."""
    first, *others = {unit_or_energy(text): text for text in channel.units}.values()
    if others:
        raise ValueError(f"{where} has cells in {first} and in {others[0]} in the column {name!r}; export one unit.")
    return first


def held_channels(frame: pd.DataFrame, sparse_only: bool) -> list[str]:
    """Channels whose values come at uneven times, as in a log of changes; with ``sparse_only``, only sparse columns.

    Among channels with many values, one with a few a day is held too: a schedule changes its set-point at even times.
    In a wide table whose cells are blank where nothing changed, no channel repeats a value, and all are held.
    So is one of a long table that never repeats a value and often skips some: it is polled and written on change.
    """
    if sparse_only and _has_changes_only(frame):
        return list(map(str, frame))
    ticks = pd.DatetimeIndex(frame.index).as_unit("ns").asi8
    spacings: dict[Hashable, np.ndarray] = {
        name: np.diff(np.unique(ticks[frame[name].notna().to_numpy()])) for name in frame
    }
    shortest = min((np.median(spacing) for spacing in spacings.values() if len(spacing) > 2), default=0.0)
    found = []
    for name, spacing in spacings.items():
        known = frame[name].notna().to_numpy()
        if sparse_only and known.mean() > _DENSE:
            continue
        if len(spacing) < 3:
            found += [str(name)] if known.any() and len(ticks) > 10 else []
            continue
        usual = np.median(spacing)
        even = (np.abs(spacing - usual) <= 0.1 * usual).mean()
        sparse = usual >= _SPARSE * shortest
        polled = not sparse_only and _is_change_of_polled(frame[name].to_numpy()[known], spacing, usual)
        if even < _EVEN or polled or (sparse and (even < _EVEN_OF_SPARSE or _FEW_A_DAY[0] < usual < _FEW_A_DAY[1])):
            found.append(str(name))
    return found


def _has_changes_only(frame: pd.DataFrame) -> bool:
    """Whether no channel of a wide table ever repeats a value, and two or more are often blank."""
    values = [frame[name].dropna().to_numpy() for name in frame]
    sparse = sum(_OFTEN < len(known) <= _DENSE * len(frame) for known in values)
    return sparse > 1 and all((np.diff(known) == 0.0).mean() < _REPEATS for known in values if len(known) > _OFTEN)


def _is_change_of_polled(values: np.ndarray, spacing: np.ndarray, usual: float) -> bool:
    """Whether values never repeat, and often keep others waiting for a good part of the time."""
    long = spacing > 1.5 * usual
    repeats = (np.diff(values) == 0.0).mean()
    return bool(repeats < _REPEATS and long.sum() >= _OFTEN and spacing[long].sum() > _SKIPPED * spacing.sum())
