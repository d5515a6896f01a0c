"""Reader of the EPA's connected-thermostat data: hourly intervals, and the older format of days."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from ..raw_log import RawLog
from ..stamps import in_zone
from ..text_files import existing
from .known_table import header_names, numeric_columns, read_text_cells, refuse_absent, sorted_frame, stamps_of
from .plant_stages import COMPRESSOR_LOW, FURNACE_LOW, full_load

_MINUTES = 60.0  # most minutes of running in an hour
_TEMPERATURES = {"T_za": "temp_in", "T_heat_set": "heating_setpoint", "T_cool_set": "cooling_setpoint"}
_OUTDOOR = ("temp_out", "outdoor_temp")
_AUXILIARY = ("auxiliary_heat_runtime", "auxiliary_heat", "emergency_heat_runtime", "emergency_heat")
_BOTH = "auxiliary_runtime with emergency heat"


def looks_like(path: Path, head: str) -> bool:
    """Whether the header is that of the EPA's thermostat data."""
    names = set(map(str.lower, header_names(head)))
    hourly = names & {"datetime", "date"} and any(re.fullmatch(r"(heat|cool)_runtime_(stg1|equiv)", n) for n in names)
    daily = "date" in names and "temp_in_00" in names
    return bool(hourly or daily)


def read(
    path: Path, metadata: Path | str | None = None, utc_offset: str | None = None, timezone: str | None = None
) -> RawLog:
    """Read minutes of running and degF per hour of one thermostat, or the older format with a row per day.

    A plant of two stages has its full-load equivalent as its role, or else its running time at full load, for which the
    first stage counts as 0.65 (furnace) or 0.72 (compressor) of both, as in the EPA's software.  Auxiliary and
    emergency heat are a plant of their own (``u_aux``) beside the heat pump.
    """
    where = repr(path.name)
    table = read_text_cells(path, where)
    table.columns = [name.lower() for name in table.columns]
    table, notes = _one_thermostat(table, where)
    offset = utc_offset or _offset_of(path, metadata)
    if offset is None and timezone is None:
        notes.append("the stamps have no zone; give utc_offset= or the metadata file.")
    if "temp_in_00" in table:
        return _read_days(table, offset, timezone, notes, where)
    stamp = "datetime" if "datetime" in table else "date"
    refuse_absent([stamp, "temp_in"], table, where, "export it again")
    stamps = _in_zone(stamps_of(table[stamp], None, None, where), offset, timezone, table.index, where)
    known = [c for c in map(str, table) if "runtime" in c or c in (*_TEMPERATURES.values(), *_AUXILIARY, *_OUTDOOR)]
    columns, _ = numeric_columns(table[known], known, where)
    frame = sorted_frame(columns, stamps, where)  # with blank columns, which have values in another month
    runtimes = [c for c in map(str, frame) if "runtime" in c or c in _AUXILIARY]
    over = [c for c in runtimes if (frame[c] > _MINUTES).any()]
    if over:
        first = frame.index[int(np.argmax((frame[over[0]] > _MINUTES).to_numpy()))]
        raise ValueError(
            f"{where}, column {over[0]!r} has {frame[over[0]].max():g} minutes in an hour, first at {first}; if they "
            "are seconds, divide them by 60."
        )
    plants = _plants(frame, notes)
    idle = {role for role, plant in (("T_heat_set", "u_heat"), ("T_cool_set", "u_cool")) if plant not in plants}
    roles = {role: c for role, c in _temperatures(frame).items() if role not in idle} | plants
    scale = dict.fromkeys([c for c in map(str, frame) if "runtime" in c or c in _AUXILIARY], 1.0 / _MINUTES)
    notes.append("temp_in is the mean of its hour, not the value at the stamp.")
    return RawLog(frame, "EPA thermostat", _units(frame), roles, scale, label="left", notes=tuple(notes))


def _one_thermostat(table: pd.DataFrame, where: str) -> tuple[pd.DataFrame, list[str]]:
    if "thermostat_id" not in table:
        return table, []
    names = table["thermostat_id"].str.strip().unique()
    if len(names) > 1:
        raise ValueError(
            f"{where} holds {len(names)} thermostats, such as {names[0]!r}; write one file per thermostat."
        )
    return table.drop(columns="thermostat_id"), [f"thermostat {names[0]}."]


def _offset_of(file: Path, metadata: Path | str | None) -> str | None:
    """Offset from UTC that the metadata gives this file, None where there is no metadata of it."""
    given = file.with_name("metadata.csv") if metadata is None else existing(metadata)[0]
    if not given.is_file():
        return None
    table = read_text_cells(given, repr(given.name))
    table.columns = [name.lower() for name in table.columns]
    if metadata is not None:
        refuse_absent(["interval_data_filename", "utc_offset"], table, repr(given.name), "give the metadata file")
    elif not {"interval_data_filename", "utc_offset"} <= set(table.columns):
        return None
    rows = table[table["interval_data_filename"].map(lambda name: Path(name.strip()).name) == file.name]
    if rows.empty and metadata is not None:
        raise ValueError(f"{given.name!r} does not name the file {file.name!r} as interval_data_filename.")
    return None if rows.empty else rows["utc_offset"].iloc[0].strip() or None


def _in_zone(
    stamps: pd.DatetimeIndex, offset: str | None, timezone: str | None, lines: pd.Index, where: str
) -> pd.DatetimeIndex:
    """Stamps at an offset, where it is known, in a time zone, where one is given; ``lines`` (n,) of the file."""
    if offset is not None and stamps.tz is None:
        found = re.fullmatch(r"([+-]?)(\d{1,2}):?([0-5]\d)?", {"Z": "+0"}.get(offset, str(offset)))
        if not found or int(found[2]) > 14:
            raise ValueError(f"the offset from UTC of {where} is {offset!r}; write it as -0600.")
        zone = f"{found[1] or '+'}{int(found[2]):02d}:{found[3] or '00'}"
        stamps = stamps.tz_localize(pd.Timestamp(f"2001-01-01T00:00{zone}").tz)
    return in_zone(stamps, timezone, pd.Series(stamps, lines - 2), where)


def _temperatures(frame: pd.DataFrame) -> dict[str, str]:
    logged = {str(c) for c in frame if frame[c].notna().any()}
    roles = {role: c for role, c in _TEMPERATURES.items() if c in logged}
    outdoor = [c for c in _OUTDOOR if c in logged]
    return roles | ({"T_oa": outdoor[0]} if outdoor else {})


def _units(frame: pd.DataFrame) -> dict[str, str]:
    return {c: "degF" for c in map(str, frame) if c in (*_TEMPERATURES.values(), *_OUTDOOR)}


def _plants(frame: pd.DataFrame, notes: list[str]) -> dict[str, str]:
    """Roles of the plants that ran; adds columns for two stages and for auxiliary heat, and notes on them.

    The columns are also those of a log in which a stage never ran, or is blank: the configuration of another month may
    name them.
    """
    roles = {}
    ran = {c for c in map(str, frame) if (frame[c] > 0).any()}
    auxiliary = [c for c in _AUXILIARY if c in ran]
    for kind in ("heat", "cool"):
        first, second, equivalent = (f"{kind}_runtime_{s}" for s in ("stg1", "stg2", "equiv"))
        name, said = f"{kind}_runtime at full load", ""
        if {first, second} <= set(frame) and equivalent not in ran:
            low = FURNACE_LOW if kind == "heat" and not auxiliary else COMPRESSOR_LOW
            frame[name], said = full_load(frame[[first, second]], _MINUTES, low)
        if equivalent in ran:
            roles[f"u_{kind}"] = equivalent
        elif said and second in ran:
            roles[f"u_{kind}"] = name
            notes.append(f"{name!r} is {first} and {second} {said}.")
        elif first in ran:
            roles[f"u_{kind}"] = first
        else:
            notes.append(f"this log shows no {kind}ing, so its set-point is not used.")
    both = [c for c in _AUXILIARY if c in frame]
    if len(both) > 1:
        frame[_BOTH] = frame[both].sum(axis=1, min_count=1).clip(upper=_MINUTES)
    if auxiliary:
        role = "u_aux" if "u_heat" in roles else "u_heat"
        roles[role] = _BOTH if len(auxiliary) > 1 else auxiliary[0]
        notes.append(f"{role} is {' and '.join(auxiliary)}.")
    return roles


def _read_days(table: pd.DataFrame, offset: str | None, timezone: str | None, notes: list[str], where: str) -> RawLog:
    """The format with a row per day: 24 columns of each hourly quantity, and the day's minutes of running."""
    refuse_absent(["date"], table, where, "export it again")
    days = stamps_of(table["date"], None, None, where)
    columns, _ = numeric_columns(table.drop(columns="date"), table.columns, where) if len(table) else ({}, [])
    hours = [f"{hour:02d}" for hour in range(24)]
    hourly: dict[str, np.ndarray] = {}
    for name in sorted({m[1] for c in columns if (m := re.fullmatch(r"(.+)_\d{2}", c))}):
        refuse_absent([f"{name}_{hour}" for hour in hours], table, where, "export it again")
        hourly[name] = np.column_stack([columns[f"{name}_{hour}"] for hour in hours]).ravel()
    daily = [c for c in columns if not re.search(r"_\d{2}$", c)]
    hourly |= {c: np.repeat(columns[c] / 24.0, 24) for c in daily}
    stamps = (days.normalize().repeat(24) + pd.to_timedelta(np.tile(np.arange(24), len(days)), unit="h")).rename("time")
    frame = sorted_frame(hourly, _in_zone(stamps, offset, timezone, table.index.repeat(24), where), where)
    if daily:
        notes.append(
            f"{', '.join(daily)} are minutes per day, spread evenly over its hours: too coarse for a role; assign it "
            "only if you know what you do."
        )
    scale = {c: 1.0 / _MINUTES for c in frame if c in (*daily, *_AUXILIARY)}
    roles = _temperatures(frame)
    return RawLog(frame, "EPA thermostat, days", _units(frame), roles, scale, label="left", notes=tuple(notes))
