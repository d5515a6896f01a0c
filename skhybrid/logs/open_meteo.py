"""The CSV of Open-Meteo's page, as the JSON of its API."""

from __future__ import annotations

import csv
import json
import re
from codecs import BOM_UTF8
from os import PathLike
from pathlib import Path
from typing import Any

_PLACE = "latitude,longitude,elevation,utc_offset_seconds,timezone"  # its first line begins so
_NUMBER = re.compile(r"-?\d+(\.\d+)?")
_NAME = re.compile(r"(\w+)(?: \((.*)\))?")  # of a variable, with its unit


def is_open_meteo_csv(path: str | PathLike[str]) -> bool:
    """Whether a file is a CSV of Open-Meteo, whose stamps have the offset of its second line."""
    if not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        return file.read(len(BOM_UTF8) + len(_PLACE)).removeprefix(BOM_UTF8).startswith(_PLACE.encode())


def answer_of(text: str) -> Any:
    """The content of a file of Open-Meteo, as its JSON has it."""
    return _answer_of_csv(text) if text.startswith(_PLACE) else json.loads(text)


def _answer_of_csv(text: str) -> dict[str, Any]:
    """The CSV of Open-Meteo as its JSON: a table of the place, and one of hours, apart by an empty line."""
    place, *tables = (list(csv.reader(table.splitlines())) for table in text.strip().split("\n\n"))
    if len(place) > 2:
        return {"error": True, "reason": f"it has {len(place) - 1} places; request the forecast of one place"}
    said = dict(zip(place[0], place[-1], strict=False))
    numbers = {
        name: float(text) if "." in text else int(text) for name, text in said.items() if _NUMBER.fullmatch(text)
    }
    none: list[list[str]] = [[], []]
    hours = next((table for table in tables if len(table) > 1 and "T" in table[1][0]), none)
    names = [_NAME.fullmatch(name) for name in hours[0]]
    columns = [[cell or None for cell in column] for column in zip(*hours[1:], strict=False)]
    return (said | numbers) | {
        "hourly": {name[1]: column for name, column in zip(names, columns, strict=False) if name},
        "hourly_units": {name[1]: name[2] for name in names if name and name[2]},
    }
