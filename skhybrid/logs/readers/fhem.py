"""Reader of the file logs of FHEM: lines of a stamp, a device, and readings with their values."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from ..._warnings import several
from ..assembly import Choice, Pieces, assemble_long, rows_of_piece
from ..paired_columns import POINT, STAMP, VALUE, numbered_values
from ..raw_log import RawLog
from ..text_files import numbered_lines

_LINE = re.compile(r"(\d{4}-\d{2}-\d{2})_(\d{2}:\d{2}:\d{2})(?:\.\d+)? (\S+) (.*?)\s*")
_READING = re.compile(r"(\S+): +(.*?)(?=\s+\S+: |\Z)")  # of several on a line, as T: 21.3 H: 45


def looks_like(path: Path, head: str) -> bool:
    """Whether most lines of a file are those of a log of FHEM."""
    lines = [line for line in head.splitlines() if line.strip()]
    return 2 * sum(map(bool, map(_LINE.fullmatch, lines))) > len(lines)


def read(path: Path, **options: Any) -> RawLog:
    """Read a file log into one column per device and reading; the options are those of ``Choice``."""
    pieces = Pieces((), (STAMP,), repr(path.name), "FHEM", first_line=1)
    pieces.frames = _frames(path, pieces)
    return assemble_long(pieces, POINT, VALUE, Choice(**options))


def _frames(path: Path, pieces: Pieces) -> Iterator[pd.DataFrame]:
    """The rows of each piece with one value each, its name and its stamp; other lines are counted in a note."""
    n_others = 0
    for lines in numbered_lines(path, rows_of_piece(3)):
        known = [(row, found) for row, line in lines if (found := _LINE.fullmatch(line.rstrip("\r\n")))]
        n_others += len(lines) - len(known)
        rows = [(row, f"{one[1]} {one[2]}", *pair) for row, one in known for pair in _values(one[3], one[4])]
        yield numbered_values(rows)
    if n_others:
        pieces.notes.append(f"{several(n_others, 'line')} that FHEM does not write so left out")


def _values(device: str, event: str) -> list[tuple[str, str]]:
    """The names and values of an event: of its readings, or of the device's state where it has none."""
    return [(f"{device} {name}", value) for name, value in _READING.findall(event)] or [(device, event)]
