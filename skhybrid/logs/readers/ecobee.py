"""Readers of ecobee thermostats: the portal's export, the API's runtime report and Donate Your Data."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ..raw_log import RawLog
from ..stamp_parts import joined_cells
from ..stamps import time_zone_named
from ..text_files import damage_refused, open_text
from .known_table import header_names, numeric_columns, read_text_cells, refuse_absent, sorted_frame, stamps_of
from .plant_stages import COMPRESSOR_LOW, FURNACE_LOW, full_load

_STEP = 300.0  # seconds in a row: all of ecobee's records are of five minutes
_TENTHS = 150.0  # no zone and no set-point has a median of 150 degF: such numbers are tenths
_UNIT = {"F": "degF", "C": "degC", "%RH": "percent"}
_NO_SUN = "ecobee logs no irradiance: add it from a weather file."
_WHOLE = ("heating at full load", "auxiliary heat at full load", "cooling at full load")


class _Layout(NamedTuple):
    """Names of one of ecobee's formats."""

    name: str
    stamps: tuple[str, ...]
    temperatures: dict[str, str]  # role -> column, without its unit
    stages: tuple[str, str, str]  # regular expressions of heating, auxiliary heat and cooling
    zone: str | None


_PORTAL = _Layout(
    "ecobee portal",
    ("Date", "Time"),
    {"T_za": "Current Temp", "T_oa": "Outdoor Temp", "T_heat_set": "Heat Set Temp", "T_cool_set": "Cool Set Temp"},
    (r"Heat Stage \d \(sec\)", r"Aux Heat \d \(sec\)", r"Cool Stage \d \(sec\)"),
    None,
)
_STAGES = (r"compHeat\d", r"auxHeat\d", r"compCool\d")
_API = _Layout(
    "ecobee API",
    ("date", "time"),
    {"T_za": "zoneAveTemp", "T_oa": "outdoorTemp", "T_heat_set": "zoneHeatTemp", "T_cool_set": "zoneCoolTemp"},
    _STAGES,
    None,
)
_DONATED = _Layout(
    "Donate Your Data",
    ("DateTime",),
    {"T_za": "T_ctrl", "T_oa": "T_out", "T_heat_set": "T_stp_heat", "T_cool_set": "T_stp_cool"},
    _STAGES,
    "UTC",
)


def looks_like(path: Path, head: str) -> bool:
    """Whether the beginning of a file is one of ecobee's formats."""
    return _layout(head) is not None


def _layout(head: str) -> _Layout | None:
    header = next((line for line in head.splitlines() if line.strip() and not line.startswith("#")), "")
    names = [name.split(" [")[0] for name in header_names(header)]
    if names[:2] == ["Date", "Time"] and re.search(r"(Stage|Heat) \d \(sec\)|Current Temp \([FC]\)", header):
        return _PORTAL
    if "DateTime" in names and ("T_ctrl" in names or "T_stp_heat" in names):
        return _DONATED
    runtimes = any(re.fullmatch("|".join(_STAGES), name) for name in names)
    if names[:2] == ["date", "time"] and ("zoneAveTemp" in names or runtimes):
        return _API
    return _API if head.lstrip().startswith("{") and '"rowList"' in head and '"reportList"' in head else None


def read(path: Path, timezone: str | None = None, dayfirst: bool | None = None) -> RawLog:
    """Read the CSV of the portal, the API's runtime report (JSON, or CSV with its names), or Donate Your Data.

    Portal and API write the thermostat's local time without a zone, Donate Your Data is UTC.  Every stage stays a
    channel of its own.  Where more than one stage of a plant ran, its role has a further channel, the running time at
    full load: a network has one capacity per plant, and a first stage gives 0.65 (furnace) or 0.72 (compressor) of it,
    as the EPA's software takes it.  A plain sum of the stages would count the first as half.  Auxiliary heat beside a
    heat pump is a plant of its own (``u_aux``), since its capacity differs and does not fall with the outdoor
    temperature; without a heat pump it is the furnace, ``u_heat``.
    """
    where = repr(path.name)
    table, layout, notes = _open(path, where)
    known = {role: _column_of(table, name) for role, name in layout.temperatures.items()}
    if known["T_za"] is None:
        refuse_absent([layout.temperatures["T_za"]], table, where, "include the zone's temperature in the export")
    stamps, more = _stamps(table, layout, timezone, dayfirst, where)
    cells = table.drop(columns=list(layout.stamps))
    stages = [c for c in map(str, cells) if re.fullmatch("|".join(layout.stages), c)]
    columns, text = numeric_columns(cells, [*stages, *filter(None, known.values())], where)
    frame = sorted_frame(columns, stamps, where)
    units = {c: u for c in map(str, frame) if (u := _unit(c, layout, known.values()))}
    notes += more + _tenths(frame, [c for c, unit in units.items() if unit == "degF"])
    roles, scale, plants = _plants(frame, layout)
    temperatures = {role: c for role, c in known.items() if c is not None and frame[c].notna().any()}
    for role, plant, what in (("T_heat_set", "u_heat", "heating"), ("T_cool_set", "u_cool", "cooling")):
        if role in temperatures and plant not in roles:
            notes.append(f"{temperatures.pop(role)!r} is not used, because this log shows no {what}.")
    if text:
        notes.append(f"left out, because they hold text: {', '.join(text)}.")
    return RawLog(
        frame, layout.name, units, temperatures | roles, scale, label="left", notes=(*notes, *plants, _NO_SUN)
    )


def _open(file: Path, where: str) -> tuple[pd.DataFrame, _Layout, list[str]]:
    """Cells as text, the layout, and notes from the lines before the header."""
    try:
        with damage_refused(where), open_text(file) as stream:
            text = stream.read()
    except UnicodeDecodeError:
        raise ValueError(f"{where} is not encoded in UTF-8; download it again.") from None
    layout = _layout(text)
    if layout is None:
        raise ValueError(
            f"{where} is not a log of an ecobee thermostat: it has no header such as 'Date,Time,System Setting,...', "
            "'DateTime,...,T_ctrl' or 'date,time,zoneAveTemp'."
        )
    if text.lstrip().startswith("{"):
        text = _rows_of_report(text, where)
    lines = text.splitlines()
    before = next(i for i, line in enumerate(lines) if line.strip() and not line.startswith("#"))
    comments = [" ".join(line.lstrip("# ").replace(",", " ").split()) for line in lines[:before]]
    table = read_text_cells(io.StringIO("\n".join(lines[before:])), where)
    table.index = table.index + before
    table.columns = [name.split(" [")[0] for name in table.columns]
    return table, layout, [f"the file says: {line}." for line in comments if "ermostat" in line]


def _rows_of_report(text: str, where: str) -> str:
    """The CSV text of a runtime report in JSON."""
    try:
        report: dict[str, Any] = json.loads(text)
        reports = report["reportList"]
        rows = reports[0]["rowList"]
        header = f"date,time,{report['columns']}"
    except (json.JSONDecodeError, KeyError, IndexError, TypeError) as error:
        raise ValueError(
            f"{where} is not a complete runtime report (columns and reportList with rowList); request it again."
        ) from error
    if len(reports) > 1:
        raise ValueError(f"{where} holds {len(reports)} thermostats; request a report of one of them.")
    return "\n".join([header, *rows])


def _stamps(
    table: pd.DataFrame, layout: _Layout, timezone: str | None, dayfirst: bool | None, where: str
) -> tuple[pd.DatetimeIndex, list[str]]:
    refuse_absent(layout.stamps, table, where, "export it again")
    text = joined_cells(table, layout.stamps).str.strip()
    if layout.zone is not None:
        utc = stamps_of(text.str.replace(r"\s*(UTC|Z)$", "", regex=True), layout.zone, dayfirst, where)
        return (utc if timezone is None else utc.tz_convert(time_zone_named(timezone))), []
    naive = stamps_of(text, None, dayfirst, where)
    if timezone is None:
        return naive, ["the stamps are the thermostat's local time; give timezone= to make daylight saving right."]
    try:
        return stamps_of(text, timezone, dayfirst, where), []
    except ValueError as error:
        if "does not exist" not in str(error):
            raise
    winter = pd.Timestamp(f"{naive[0].year}-01-01").tz_localize(timezone)
    offset = (winter.utcoffset() or pd.Timedelta(0)) - (winter.dst() or pd.Timedelta(0))
    utc = (naive - offset).tz_localize("UTC")
    return utc.tz_convert(timezone), ["the clock was not set forward in spring: the stamps are standard time."]


def _column_of(table: pd.DataFrame, name: str) -> str | None:
    """The column with that name, whatever its unit."""
    return next((c for c in table.columns if c == name or re.fullmatch(rf"{re.escape(name)} \([FC]\)", c)), None)


def _unit(column: str, layout: _Layout, temperatures: Any) -> str | None:
    """Unit of a column: the portal names it, the other formats are in degF."""
    if layout is _PORTAL:
        found = re.search(r"\((F|C|%RH)\)$", column)
        return _UNIT[found[1]] if found else None
    if column in temperatures or column.endswith("_Temperature"):
        return "degF"
    return "percent" if re.fullmatch(r"Humidity|RH_out|zoneHumidity|outdoorHumidity", column) else None


def _tenths(frame: pd.DataFrame, temperatures: list[str]) -> list[str]:
    """Divide temperatures in tenths of degF by ten, in place."""
    if not (frame[temperatures].median() > _TENTHS).any():
        return []
    frame[temperatures] /= 10.0
    return [f"{', '.join(temperatures)} were in tenths of degF and have been divided by 10."]


def _plants(frame: pd.DataFrame, layout: _Layout) -> tuple[dict[str, str], dict[str, float], list[str]]:
    """Roles and scales of the plants that ran, and notes; adds a column for each that has several stages."""
    stages = [sorted(c for c in map(str, frame) if re.fullmatch(pattern, c)) for pattern in layout.stages]
    ran = [[c for c in columns if (frame[c] > 0).any()] for columns in stages]
    scale = {c: 1.0 / _STEP for columns in stages for c in columns}
    names = ("u_heat", "u_aux" if ran[0] else "u_heat", "u_cool")
    # without auxiliary heat, what the portal calls heat stages is a furnace
    lows = (COMPRESSOR_LOW if stages[1] else FURNACE_LOW, FURNACE_LOW, COMPRESSOR_LOW)
    roles, notes = {}, []
    for whole, columns, running, role, low in zip(_WHOLE, stages, ran, names, lows, strict=True):
        if columns and not running:
            notes.append(f"this log shows no run of {', '.join(columns)}.")
        if len(columns) > 1:  # in every log, so that new rows without the second stage, or without any, fit too
            frame[whole], said = full_load(frame[columns], _STEP, low)
            scale[whole] = 1.0 / _STEP
        if running:
            roles[role] = running[0]
        if running and running[-1] != columns[0]:
            roles[role] = whole
            notes.append(f"{whole!r} is {' and '.join(running)} {said}.")
    if "u_aux" in roles:
        notes.append("u_heat is the heat pump's compressor, u_aux the auxiliary heat, each with its own capacity.")
    return roles, scale, notes
