"""Reader of the file logs of FHEM: lines of a stamp, a device, and readings with their values."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd

from ..._warnings import several
from ..assembly import Choice, Pieces, assemble_long, rows_of_piece
from ..paired_columns import POINT, ROW, VALUE
from ..raw_log import RawLog
from ..text_files import damage_refused, encoding_of, open_bytes

_LINE = re.compile(r"(\d{4}-\d{2}-\d{2})_(\d{2}:\d{2}:\d{2})(?:\.\d+)? (\S+) (.*?)\s*")
_READING = re.compile(r"(\S+): +(.*?)(?=\s+\S+: |\Z)")  # of several on a line, as T: 21.3 H: 45
_STAMP = "time"


def looks_like(path: Path, head: str) -> bool:
    """Whether most lines of a file are those of a log of FHEM."""
    lines = [line for line in head.splitlines() if line.strip()]
    return 2 * sum(map(bool, map(_LINE.fullmatch, lines))) > len(lines)


def read(path: Path, **options: Any) -> RawLog:
    """Read a file log into one column per device and reading; the options are those of ``Choice``."""
    pieces = Pieces((), (_STAMP,), repr(path.name), "FHEM", first_line=1)
    pieces.frames = _frames(path, pieces)
    return assemble_long(pieces, POINT, VALUE, Choice(**options))


def _frames(path: Path, pieces: Pieces) -> Iterator[pd.DataFrame]:
    """The rows of each piece with one value each, its name and its stamp; other lines are counted in a note."""
    n_others, begin = 0, 0
    with damage_refused(pieces.where), open_bytes(path) as file:
        text = TextIOWrapper(file, encoding_of(path) or "utf-8", errors="replace")
        while lines := list(islice(text, rows_of_piece(3))):
            found = {row: _LINE.fullmatch(line.rstrip("\r\n")) for row, line in enumerate(lines, begin)}
            known = {row: one for row, one in found.items() if one}
            n_others, begin = n_others + len(lines) - len(known), begin + len(lines)
            rows = [
                (row, f"{one[1]} {one[2]}", *pair) for row, one in known.items() for pair in _values(one[3], one[4])
            ]
            yield pd.DataFrame(rows, columns=[ROW, _STAMP, POINT, VALUE], dtype=str).astype({ROW: int}).set_index(ROW)
    if n_others:
        pieces.notes.append(f"{several(n_others, 'line')} that FHEM does not write so left out")


def _values(device: str, event: str) -> list[tuple[str, str]]:
    """The names and values of an event: of its readings, or of the device's state where it has none."""
    return [(f"{device} {name}", value) for name, value in _READING.findall(event)] or [(device, event)]
