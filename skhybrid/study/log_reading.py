"""Reading a log by its configuration: roles, units, even steps and metered heat."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from os import PathLike
from typing import NamedTuple, cast

import pandas as pd

from .._table import SETPOINT_ROLES, is_instant
from .._time import SHORTEST_GAP, spell
from .._warnings import warn_user
from ..exceptions import UnitWarning
from ..logs import RawLog, regularize
from ..logs import read_log as read_any_log
from ..logs.assumed_units import outdoor_as_room
from ..logs.blank_setpoints import BlankRows, filled_setpoints
from ..logs.conversion import Channel, channels_of, factor_remarks, fill_remarks, roles_without_label, to_roles
from ..logs.even_steps import RegularizeReport
from ..logs.log_findings import clash, has_both_signs, unit_switch
from ..logs.setpoint_modes import with_actions
from ..logs.zone_csv import to_left_label
from .plant_performance import Performance
from .settings import Settings

SETPOINT = "setpoint"  # column of the set-point in a log, which has no role
_HEAT, _COLD = "Q_heat", "Q_cool"  # roles of meters that a model reads as one, Q_hvac
_FAHRENHEIT, _KELVIN = 45.0, 200.0  # set-points without a unit are in degF, or in K, if their median is above


def read_log(path: str | PathLike[str], settings: Settings) -> tuple[pd.DataFrame, str]:
    """Read a log by its settings: one column per role at an even step, and a report of what was filled or dropped.

    A step that is under way at the end, of which only the beginning is known, is left out unless rows ahead follow it.

    Parameters
    ----------
    path : path-like, a file in any format of :func:`skhybrid.logs.read_log`, or the URL of a database
    settings : Settings

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist or cannot be read with these settings.
    """
    read = read_even_log(path, settings)
    only_under_way = len(read.frame) == len(read.finished) + 1
    return read.finished if only_under_way else read.frame, read.report


class EvenLog(NamedTuple):
    """A log with one column per role at an even step."""

    frame: pd.DataFrame
    report: str
    held: list[str]  # roles that were logged by change
    finished: pd.DataFrame  # its steps that are over by the last measured row; all where none is
    blank: list[BlankRows]  # of set-points, that were filled

    def filled_after(self, origin: pd.Timestamp) -> list[str]:
        """Remarks on set-points of a plan after some row that were blank."""
        return [one.remark for one in self.blank if one.last > origin]


def read_even_log(path: str | PathLike[str], settings: Settings) -> EvenLog:
    """As :func:`read_log`, with the roles that are logged by change and the steps that are over."""
    log = by_role(read_raw_log(path, settings), settings)
    frame = log.frame
    if (text := clash(frame)) is not None:
        raise ValueError(text)
    if settings.label == "right":
        frame = to_left_label(frame, log.without_label)
    raw, (frame, report) = frame, on_even_steps(frame, settings, log.held)
    if 2 * report.step < report.source_step:  # then T_za is missing in most rows
        given, logged = spell(report.step), spell(report.source_step)
        raise ValueError(
            f"step = {given!r} is finer than the log, which has a row every {logged}; give step = {logged!r}."
        )
    frame, blank = filled_setpoints(metered_heat(frame, settings))
    text = "\n".join([str(report), *log.remarks, *(one.remark for one in blank)])
    return EvenLog(frame, text, log.held, _finished(frame, raw, settings, log.held, report), blank)


def _finished(
    frame: pd.DataFrame, raw: pd.DataFrame, settings: Settings, held: Sequence[str], report: RegularizeReport
) -> pd.DataFrame:
    """The even rows of a ``raw`` log but those of a longer step that is under way: means of a part of it."""
    past, rooms = raw.sort_index(), [role for role in settings.roles_of("T_za") if role in raw]
    if set(rooms).isdisjoint(held):  # else a temperature holds, and all rows up to the last are past
        past = past.loc[: past[rooms].dropna(how="all").index.max()]
    means = [role for role in past if role not in held and not is_instant(role)]
    ends = past[means].dropna(how="all").index if means else past.index
    row = report.source_step if means else pd.Timedelta(0)
    if row >= report.step or ends.empty:
        return frame
    over = frame[pd.DatetimeIndex(frame.index) + report.step <= ends[-1] + 1.5 * row]
    return frame if over.empty else over


class LogByRole(NamedTuple):
    """A log with one column per role, at its own stamps."""

    frame: pd.DataFrame
    channels: list[Channel]
    held: list[str]  # roles that were logged by change
    without_label: list[str]  # roles whose values begin at their stamps, whatever the label
    remarks: list[str]  # on values that were taken as missing


def by_role(raw: RawLog, settings: Settings) -> LogByRole:
    """One column per role at the stamps of the log.

    :func:`metered_heat` comes after the even steps: meters that are logged by change share no stamps.
    """
    columns = dict(settings.columns)
    wanted = settings.load.get("setpoint", "measured")
    if isinstance(wanted, str) and wanted != "measured":
        columns[SETPOINT] = wanted
    channels = channels_of(raw, columns, settings.units, settings.scale)
    if outdoor_as_room(channels, raw.frame, {}, [c.role for c in channels if c.role == c.name])[1]:
        warn_user(
            "T_oa has no unit and is read in degC, but the room is in degF; give T_oa = 'degF' (or 'degC') under "
            "[units] of the configuration.",
            UnitWarning,
        )
    for name, text in factor_remarks(channels, settings.scale).items():
        warn_user(f"{name!r}: {text}.", UnitWarning)
    frame = to_roles(raw, _with_setpoint_units(channels, raw))
    refuse_mixed_units(frame)
    if settings.timezone is not None and pd.DatetimeIndex(frame.index).tz is not None:
        frame = frame.tz_convert(settings.timezone)
    held = [c.role for c in channels if c.name in raw.held]
    remarks = [f"{name}: {text}" for name, text in fill_remarks(raw, channels).items()]
    return LogByRole(frame, channels, held, roles_without_label(raw, channels), remarks)


def read_raw_log(path: str | PathLike[str], settings: Settings) -> RawLog:
    """The channels of a log as its source has them, in the format that the settings name or its content shows."""
    given = {name: getattr(settings, name) for name in ("timezone", "time_column", "dayfirst", "sep", "decimal")}
    options = {name: value for name, value in given.items() if value is not None} | dict(settings.log)
    options.pop("max_hold", None)
    raw = read_any_log(path, settings.format, **options)
    return replace(raw, frame=with_actions(raw.frame, settings.columns.values()))


def refuse_mixed_units(frame: pd.DataFrame) -> None:
    """Refuse a temperature that is in degC on one side of a stamp and in degF on the other."""
    for role in frame:
        switch = unit_switch(frame[role].dropna()) if str(role).startswith("T_") else None
        if switch is not None:
            raise ValueError(
                f"{role} changes its unit at {switch}, degC on one side and degF on the other; split the log there, or "
                "correct the column."
            )


def on_even_steps(
    frame: pd.DataFrame, settings: Settings, held: Sequence[str] = (), max_gap: pd.Timedelta = SHORTEST_GAP
) -> tuple[pd.DataFrame, RegularizeReport]:
    """The rows at the step of the settings, with values that are logged by change held until the next.

    Gaps of inputs are filled up to ``max_gap``: by default, the length from which an identification begins a new
    stretch.
    """
    held = [role for role in held if role in frame]
    longest = settings.log.get("max_hold", "1D")
    made = regularize(frame, settings.step, max_gap, return_report=True, held=held, max_hold=longest)
    return cast("tuple[pd.DataFrame, RegularizeReport]", made)


def _with_setpoint_units(channels: list[Channel], raw: RawLog) -> list[Channel]:
    """The channels with the unit of set-points that have none of their own, by their values."""
    found = []
    for channel in channels:
        if channel.unit is None and channel.scale == 1.0 and channel.role.startswith((*SETPOINT_ROLES, SETPOINT)):
            median = raw.frame[channel.name].median()
            unit = "K" if median > _KELVIN else "degF" if median > _FAHRENHEIT else None
            channel = channel._replace(unit=unit)
        found.append(channel)
    return found


def metered_heat(frame: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """The heat of each plant as one column, ``Q_hvac`` [kW]: of meters of heat and cold, or of electricity."""
    meters = meters_of(list(map(str, frame)), settings.zones)
    single = [role for role in ("Q_hvac", *(f"Q_hvac_{zone}" for zone in settings.zones)) if role in frame]
    wholes = meters | {role: [role] for role in single}
    heat = {whole: _net_heat(frame, whole, parts, settings) for whole, parts in wholes.items()}
    return frame.drop(columns=[role for parts in meters.values() for role in parts]).assign(**heat)


def meters_of(roles: Collection[str], zones: Sequence[str]) -> dict[str, list[str]]:
    """The meters of heat and of cold among some roles, by the role of their sum, such as ``Q_hvac_<zone>``.

    That of a room may also be named ``Q_<zone>``.
    """
    found = {}
    for end in ("", *(f"_{zone}" for zone in zones)):
        parts = [meter + end for meter in (_HEAT, _COLD) if meter + end in roles]
        if end and not parts and f"Q{end}" in roles:
            parts = [f"Q{end}"]
        if parts and f"Q_hvac{end}" not in roles:
            found[f"Q_hvac{end}"] = parts
    return found


def _net_heat(frame: pd.DataFrame, whole: str, meters: Sequence[str], settings: Settings) -> pd.Series:
    """The heat [kW] of the meters of a ``whole``, such as ``Q_hvac``, of which cold counts as negative."""
    powers = frame[list(meters)]
    performance = Performance.of(settings.plant)
    cold = whole.replace("Q_hvac", _COLD, 1)
    for role in (role for role in meters if role == cold):  # Q_cool_room may be the heat of a room, cool_room
        if has_both_signs(powers[role].dropna()):
            raise ValueError(
                f"{settings.columns.get(role, role)} ({role}) is often positive and often negative; if it heats and "
                f"cools, give it as {whole}, positive where it heats."
            )
        powers = powers.assign(**{role: -powers[role].abs()})
    if performance is not None and settings.plant.get("electricity"):  # each by itself: both may run within a step
        T_oa = frame["T_oa"].interpolate(limit_direction="both").to_numpy()
        powers = powers.apply(lambda power: performance.heat(power.to_numpy(), T_oa))
    return powers.sum(axis=1, skipna=False)
