"""Answers of Open-Meteo: the JSON of its API, and the CSV of its page as that."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

from .readers import json_log
from .text_files import head_of, text_of

_PLACE = "latitude,longitude,elevation,utc_offset_seconds,timezone"  # the first line of the CSV begins so
_PARTS = {"hourly", "daily", "reason"}  # of an answer, or of an error; records have none
_NUMBER = re.compile(r"-?\d+(\.\d+)?")
_NAME = re.compile(r"(\w+)(?: \((.*)\))?")  # of a variable, with its unit


def answers_in(path: Path) -> list[Any]:
    """The answers of Open-Meteo that a file holds, one for each place; none where it is another file, or there is none.

    Stamps of the CSV have the offset of its second line.
    """
    head = head_of(path) if path.is_file() else ""
    if head.startswith(_PLACE):
        return [_answer_of_csv(text_of(path))]
    items = json_log.json_items(path, repr(path.name)) if json_log.looks_like(path, head) else []
    return items if any(isinstance(item, dict) and _PARTS & item.keys() for item in items) else []


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
