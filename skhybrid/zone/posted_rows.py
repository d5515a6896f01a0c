"""Rows that are posted to a zone one by one, beside those of the log that the zone was made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from .._ranges import check_range
from .._table import listed, refuse_infinite_columns, role_of
from .._time import SHORTEST_GAP, wall_clock
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from ..logs.blank_setpoints import filled_setpoints
from ..logs.conversion import TIMES, Channel, is_energy
from ..logs.even_steps import typical_step, usual_step
from ..logs.raw_log import RawLog
from ..logs.zone_csv import to_left_label
from ..preprocessing import GapFiller
from ..study.log_reading import (
    SETPOINT,
    by_role,
    metered_heat,
    meters_of,
    on_even_steps,
    read_raw_log,
    refuse_mixed_units,
)
from ..study.settings import Settings
from .forecast_archive import AHEAD, EVEN, POSTED, ForecastArchive

_TAIL = pd.Timedelta(days=1)  # of posted rows, which are kept as they came: later ones may fall into the same step
_KEPT = pd.Timedelta(days=63)  # of the log, more than a new fit reads
_CLOCK_AHEAD = pd.Timedelta(days=1)  # by which a sender's clock, or its time zone, may be ahead
_NO_GAP = pd.Timedelta(0)
_SEED = 3  # even rows before the first posted one, from which on values are interpolated or held


def read_posted(
    path: str | PathLike[str], settings: Settings, known: Sequence[str] | None = None, *, plain: bool = False
) -> tuple[pd.DataFrame, list[str]]:
    """Rows of a file by role, at their own stamps, and the roles that are logged by change.

    ``known`` are those of the log, which a few rows do not show; without a change they need no value.  ``plain``: a
    CSV with commas and ``time``, whatever the log is.  Of several values of a stamp the last counts.  A ValueError says
    what cannot be read by the settings, or which value is beyond physics; a warning, which column was not read, or
    which value was taken as missing.
    """
    if plain:
        settings = replace(settings, time_column="time", sep=",", decimal=".", dayfirst=None, format="CSV", log={})
    raw = read_raw_log(path, settings)
    _remark_repeated_hour(raw, path, settings)
    log = by_role(raw, _with_changes(raw, settings, known or ()))
    for channel in log.channels:
        _refuse_sums(channel)
    unread = raw.frame.columns.difference([channel.name for channel in log.channels])
    if plain and len(unread):
        warn_user(f"the posted {listed(unread)} was not read; the columns are those of zone.toml.", SkhybridWarning)
    for remark in log.remarks:
        warn_user(f"posted {remark}.", SkhybridWarning)
    held = log.held if known is None else list(known)
    if held and settings.label == "right":
        raise ValueError(
            f"{held[0]} is logged by change, which the posted rows of a right-labelled log do not determine; let "
            "skhybrid zone tick read the log."
        )
    of_heat = meters_of(settings.columns, settings.zones)
    meters = [whole for whole, parts in of_heat.items() if not set(held).isdisjoint(parts)]
    even = bool(held) if known is None else bool(meters)  # meters that are logged by change share no stamps
    frame = metered_heat(on_even_steps(log.frame, settings, held)[0] if even else log.frame, settings)
    refuse_infinite_columns(frame)
    for role in frame:
        if role_of(str(role)) is not None:
            check_range(frame[role].to_numpy(dtype=np.float64), str(role), str(role), frame.index)
    frame = frame.sort_index(kind="stable").dropna(how="all")
    if frame.empty:
        raise ValueError("no posted row has a value; the columns are those of zone.toml.")
    return frame.groupby(level=0).last(), [*held, *meters]


def _remark_repeated_hour(raw: RawLog, path: str | PathLike[str], settings: Settings) -> None:
    """Warn of stamps without an offset in the hour that comes twice in autumn, if no other shows which pass it is."""
    clock = wall_clock(pd.DatetimeIndex(raw.frame.index))
    if settings.timezone is None or not len(_repeated(clock, settings.timezone)):
        return
    written = pd.DatetimeIndex(read_raw_log(path, replace(settings, timezone=None)).frame.index)
    if written.tz is None and len(once := _repeated(written, settings.timezone)) and once.is_unique:
        warn_user(
            f"{once[0]} comes twice in {settings.timezone} and is read as summer time; post stamps with an offset.",
            SkhybridWarning,
        )


def _repeated(stamps: pd.DatetimeIndex, timezone: str) -> pd.DatetimeIndex:
    """Stamps of a clock that it shows twice."""
    return stamps[np.asarray(stamps.tz_localize(timezone, ambiguous="NaT", nonexistent="shift_forward").isna())]


def _with_changes(raw: RawLog, settings: Settings, known: Sequence[str]) -> Settings:
    """The settings without the roles of ``known`` that did not change; of two meters both are needed for their sum."""
    free = set(known).difference(*meters_of(settings.columns, settings.zones).values())
    columns = {r: c for r, c in settings.columns.items() if r not in free or c in raw.frame}
    return replace(settings, columns=columns)


def _refuse_sums(channel: Channel) -> None:
    """Refuse what is read with the help of the rows around it."""
    if is_energy(channel.unit) or (channel.unit in TIMES and channel.scale == 1.0):
        raise ValueError(
            f"{channel.role} is logged in {channel.unit}, which a posted row alone does not determine; let skhybrid "
            "zone tick read the log."
        )


def keep_log(
    archive: ForecastArchive, frame: pd.DataFrame, origin: pd.Timestamp, held: Sequence[str] | None = None
) -> None:
    """Keep the rows of a log at even steps, up to an origin and ahead of it, and the roles logged by change."""
    if held is not None:
        archive.keep_held(held)
    archive.keep_log(frame[frame.index > origin - _KEPT].loc[:origin], EVEN)
    archive.keep_log(frame[frame.index > origin], AHEAD)
    archive.forget_log(EVEN, origin - _KEPT)


def refuse_future(rows: pd.DataFrame, what: str) -> None:
    """Refuse rows with a measured temperature that end in the future; ``what`` a user may check."""
    if len(rows) and rows.index[-1] > pd.Timestamp.now(pd.DatetimeIndex(rows.index).tz) + _CLOCK_AHEAD:
        raise ValueError(f"{rows.index[-1]} has a temperature and lies in the future; check {what}.")


def keep_posted(
    archive: ForecastArchive, rows: pd.DataFrame, settings: Settings, held: Sequence[str] = ()
) -> tuple[pd.DataFrame, int]:
    """Keep posted rows; the log that the archive has by now, at the step of the settings, and the number of rows ahead.

    Values of ``held`` roles hold until the next one, also from the log that was known before.  Rows after the last
    posted temperature are weather and plans.  A ValueError says that only one of rows and kept log has a time zone, or
    that a measurement lies in the future.
    """
    n_measured = _n_measured(rows, settings, held)
    refuse_future(rows.iloc[:n_measured], "the sender's clock")
    tz = pd.DatetimeIndex(rows.index).tz
    even = _kept_log(archive, EVEN, tz, settings)
    if len(even) and (pd.DatetimeIndex(even.index).tz is None) != (tz is None):
        have, give = ("no", "without an offset") if tz is not None else ("a", "with an offset, such as +01:00")
        raise ValueError(
            f"the log of this zone has {have} time zone; post stamps {give}, or give timezone in zone.toml."
        )
    archive.keep_log(rows.iloc[:n_measured], POSTED)
    archive.keep_log(rows.iloc[n_measured:], AHEAD)
    posted = _kept_log(archive, POSTED, tz, settings)
    if len(posted):
        row = _row_step(posted, rows, held)
        found, bridged = _on_steps(even, posted, row, settings, held)
        # what the log or an earlier post gave stays where these rows give nothing; only what is left is bridged
        even = found.combine_first(even).combine_first(bridged)
        refuse_mixed_units(even)
        archive.keep_log(even[even.index.isin(found.index)], EVEN)
        archive.forget_log(EVEN, posted.index[-1] - _KEPT)
        whole = found.index[found.index <= posted.index[-1] - _TAIL]
        if len(whole):
            archive.forget_log(POSTED, whole[-1])
    ahead = _kept_log(archive, AHEAD, tz, settings)
    if len(even):
        last = even.index[-1]
        archive.forget_log(AHEAD, last + pd.Timedelta("1s"))
        ahead = ahead[ahead.index > last]
    if len(ahead) > 1:
        ahead = on_even_steps(ahead, settings)[0]
        ahead = ahead[ahead.index > even.index[-1]] if len(even) else ahead
    filled, _ = filled_setpoints(even)  # of the whole log, of which a post is too short a part
    return pd.concat([filled, ahead]).rename_axis("time"), len(rows) - n_measured


def _n_measured(rows: pd.DataFrame, settings: Settings, held: Sequence[str]) -> int:
    """Number of rows up to the last measured one: with a temperature, or with a change of a held role until now."""
    known = rows.reindex(columns=settings.roles_of("T_za")).notna().any(axis=1).to_numpy()
    now = pd.Timestamp.now(pd.DatetimeIndex(rows.index).tz)
    known = known | (rows.reindex(columns=list(held)).notna().any(axis=1).to_numpy() & (rows.index <= now))
    return int(np.flatnonzero(known)[-1]) + 1 if known.any() else 0


def _row_step(posted: pd.DataFrame, rows: pd.DataFrame, held: Sequence[str]) -> pd.Timedelta | None:
    """The usual distance of posted rows, of one row that of the ``rows`` it came with; None where that is one alone.

    Rows of ``held`` roles alone do not count.
    """
    posted, rows = (part.drop(columns=list(held), errors="ignore").dropna(how="all") for part in (posted, rows))
    if len(posted) > 1:
        return usual_step(posted)
    return typical_step(pd.DatetimeIndex(rows.index)) if len(rows) > 1 else None


def _on_steps(
    even: pd.DataFrame, posted: pd.DataFrame, row: pd.Timedelta | None, settings: Settings, held: Sequence[str]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Posted rows, one per ``row``, at even steps, up to the last step that they fill; none where that is not known.

    As they are, and with short gaps of inputs filled.
    """
    if settings.label == "right":
        posted = to_left_label(posted) if len(posted) > 1 else posted.iloc[:0]
    if posted.empty:
        return posted, posted
    before = even[even.index < posted.index[0]].iloc[-_SEED:]
    rows = pd.concat([before, posted])
    if len(rows) < 2:
        raise ValueError(
            "the archive has no rows of the log yet; run skhybrid zone tick once, or post two weeks of it."
        )
    if row is None:  # it may be a part of a step, or a whole one
        return posted.iloc[:0], posted.iloc[:0]
    found, report = on_even_steps(rows, settings, held, _NO_GAP)
    filled = (
        GapFiller(SHORTEST_GAP).fit_transform(found).assign(**{role: found[role] for role in held if role in found})
    )
    new = found.index <= posted.index[-1] + row - report.step
    if len(before):
        new &= found.index > before.index[-1]
    return found[new], filled[new]


def _kept_log(archive: ForecastArchive, kind: int, tz: Any, settings: Settings) -> pd.DataFrame:
    """The rows of one kind in a time zone, where they have one, without roles that left the settings."""
    frame = archive.log(kind)
    if frame.empty:
        return frame.set_axis(pd.DatetimeIndex([], tz=tz), axis=0)
    roles = {*settings.columns, SETPOINT, *meters_of(settings.columns, settings.zones)}
    frame = frame[[role for role in frame if role in roles]]
    aware = pd.DatetimeIndex(frame.index).tz is not None
    return frame.tz_convert(tz) if aware and tz is not None else frame
