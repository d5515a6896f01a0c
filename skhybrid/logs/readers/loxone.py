"""Reader of the statistics of Loxone: XML of one block, or files of several put one below the other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import pandas as pd

from ..assembly import Choice, Pieces, assemble_long, rows_of_piece
from ..paired_columns import POINT, STAMP, VALUE, numbered_values
from ..raw_log import RawLog
from ..text_files import numbered_lines

_ELEMENT = re.compile(r"<(?:Statistics|S)\s([^>]*)>")
_ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')


def looks_like(path: Path, head: str) -> bool:
    """Whether a file begins with a statistic of Loxone."""
    return re.match(r"\s*(<\?xml[^>]*>\s*)?<Statistics\s[^>]*\bOutputs=", head) is not None


def read(path: Path, **options: Any) -> RawLog:
    """Read statistics into a column for each block, or for each of its outputs; the options are those of ``Choice``."""
    pieces = Pieces(_frames(path), (STAMP,), repr(path.name), "Loxone", first_line=1)
    return assemble_long(pieces, POINT, VALUE, Choice(**options))


def _frames(path: Path) -> Iterator[pd.DataFrame]:
    """The rows of each piece with one value each, its name and its stamp."""
    points: list[str] = []
    for part in numbered_lines(path, rows_of_piece(3)):
        rows: list[tuple[int, str, str, str]] = []
        for row, line in part:
            for element in _ELEMENT.findall(line):
                found = {key: unescape(text) for key, text in _ATTRIBUTE.findall(element)}
                if "T" in found:
                    stamp = found.pop("T")
                    rows += [(row, stamp, *pair) for pair in zip(points, found.values(), strict=False)]
                else:
                    points = _points(found.get("Name", ""), found.get("Outputs", "").split(","))
        yield numbered_values(rows)


def _points(name: str, outputs: list[str]) -> list[str]:
    """The name of a block, with that of each output where it has several."""
    return [name] if len(outputs) == 1 else [f"{name} {output.strip()}" for output in outputs]
