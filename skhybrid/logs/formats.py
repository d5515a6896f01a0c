"""Formats of logs, and the reader that tells them apart."""

from __future__ import annotations

import inspect
import re
from codecs import BOM_UTF8
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

from .assembly import Choice
from .raw_log import RawLog
from .readers import (
    change_of_value,
    columnar,
    delimited,
    ecobee,
    epa_thermostat,
    fhem,
    home_assistant,
    influx,
    json_log,
    loxone,
    spreadsheet,
    sql_table,
)
from .text_files import existing, head_of

#: what begins a file that is no table, with what it is and what to do
_NO_TABLES = (
    (re.compile(rb"\xd0\xcf\x11\xe0"), "a workbook of Excel before 2007; open it in Excel and save it as .xlsx or CSV"),
    (re.compile(rb"PK\x03\x04"), "a ZIP archive; unpack it and give the log in it"),
    (re.compile(rb"%PDF"), "a PDF; export the log as CSV"),
    (re.compile(rb"\s*<"), "a web page or XML; open it in Excel and save it as .xlsx, or export the log as CSV"),
    (re.compile(rb"\S+ [^=\s]+=[^\n]* \d{10,19}\s"), "InfluxDB's line protocol; query it as annotated CSV (--raw)"),
    (re.compile(rb'[^\n{"]+[ \t;]\{"'), "lines with JSON in them; write a column for each of its values, as CSV"),
)
_BLANK = 1 << 16  # bytes without any character, after which a file is taken as empty
#: the module of each format, which offers ``looks_like(path, head)`` and ``read(path, ...)``; the first that fits is
#: taken, so that special formats come before general ones
FORMATS: dict[str, ModuleType] = {
    "Home Assistant": home_assistant,
    "ecobee": ecobee,
    "EPA thermostat": epa_thermostat,
    "InfluxDB": influx,
    "FHEM": fhem,
    "Loxone": loxone,
    "Excel": spreadsheet,
    "Parquet": columnar,
    "JSON": json_log,
    "SQL": sql_table,
    "change of value": change_of_value,
    "CSV": delimited,
}


def read_log(source: str | PathLike[str], format: str | None = None, **options: Any) -> RawLog:
    """Read a log in any known format, as its source has it.

    Parameters
    ----------
    source : path-like or str
        A file, or the SQLAlchemy URL of a database (``"sqlite:///file.db"``).
    format : str, optional
        Name of the format; by default found from the content of the file.
    **options
        Of general tables: ``columns`` (channels to read), ``time_column`` (the column of time stamps, or a pair of
        date and time), ``timezone`` (of stamps without an offset, or to convert to), ``dayfirst``, ``year`` (of the
        first stamp, where stamps have none) and ``held`` (channels that keep their value until the next one).  CSV
        takes ``sep`` and ``decimal`` besides, Excel ``sheet``, a database ``table`` or ``query``; a long CSV, JSON or
        database takes ``point_column`` and ``value_column``.

        Home Assistant takes ``table`` (``"states"``, or the means of ``"statistics"`` per hour or of
        ``"statistics_short_term"`` per five minutes; by default states, or the hourly means where there are none),
        ``entities`` (by default all whose states are numbers, on or off), ``step`` (of the rows of states, by default
        1 min) and ``timezone``; ecobee ``timezone`` (that of the thermostat) and ``dayfirst``; the EPA's data
        ``metadata`` (the file with the offset from UTC, by default a ``metadata.csv`` in the same folder that names
        the log), ``utc_offset`` (such as ``"-0600"``, in place of it) and ``timezone``; InfluxDB ``timezone``.

    Returns
    -------
    RawLog

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ImportError
        If the format needs a library that is not installed.
    ValueError
        If the format is unknown, or the file cannot be read with these options.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from skhybrid.logs import read_log
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "log.csv"
    ...     _ = path.write_text("Datum;Raum [°C]\\n01.02.2024 00:00;20,5\\n01.02.2024 01:00;20,7\\n", encoding="utf-8")
    ...     log = read_log(path)
    >>> log.format, log.units
    ('CSV', {'Raum [°C]': 'degC'})
    """
    name = None if format is None else _named(format)
    if isinstance(source, str) and "://" in source:
        if name not in (None, "SQL"):
            raise ValueError(f"a URL is read as SQL, but format={format!r} was given.")
        return _call("SQL", source, options)
    path, _ = existing(source)
    return _call(name or format_of(path), path, options)


def format_of(path: Path) -> str:
    """The name of the first format that a file looks like."""
    with path.open("rb") as file:
        start = file.read(_BLANK)
    if not start.strip():
        raise ValueError(f"{path.name!r} is empty; export it again.")
    head = head_of(path)
    for name, module in FORMATS.items():
        if module.looks_like(path, head):
            return name
    if found := next((what for begins, what in _NO_TABLES if begins.match(start.removeprefix(BOM_UTF8))), None):
        raise ValueError(f"{path.name!r} is {found}.")
    if head.strip():
        return "CSV"  # its reader says what is wrong
    raise ValueError(f"the format of {path.name!r} is not one of {', '.join(FORMATS)}; export the log as CSV.")


def _named(format: str) -> str:
    """The name of a format as :data:`FORMATS` spells it, in upper or lower case."""
    for name in FORMATS:
        if name.casefold() == str(format).casefold():
            return name
    raise ValueError(f"format={format!r} is not one of {', '.join(map(repr, FORMATS))}.")


def _call(name: str, source: Path | str, options: dict[str, Any]) -> RawLog:
    """Read with options that the format takes."""
    module = FORMATS[name]
    parameters = list(inspect.signature(module.read).parameters.values())[1:]
    known = [one.name for one in parameters if one.kind is not one.VAR_KEYWORD]
    if any(one.kind is one.VAR_KEYWORD for one in parameters):
        known += inspect.signature(Choice).parameters
    for option in options:
        if option not in known:
            raise ValueError(f"a log in the format {name} takes no option {option!r}; it takes {', '.join(known)}.")
    return module.read(source, **options)
