"""Tables whose columns have stamps of their own before them, as exports of several trends side by side."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import pandas as pd

from .stamp_cells import holds_stamps

STAMP, POINT, VALUE = "time", "point", "value"  # columns of a long table that a reader makes
ROW = "row of the file"  # the name of an index of numbers of rows, from 0 on, which may occur again
_LEAST_BLOCKS = 3  # of stamps with names of their own
_IS_VALUE = re.compile(
    r"_?(((present|object|actual)[ _]?)?value|payload|val|reading|state|wert|messwert|waarde|valeur|valore?|mean)",
    re.IGNORECASE,
)


def paired_columns(sample: pd.DataFrame, stamps: Sequence[str]) -> dict[str, list[str]]:
    """The channels after each column of stamps, where a table repeats these for groups of equal size; else empty."""
    blocks: dict[str, list[str]] = {}
    for name in map(str, sample.columns):
        if holds_stamps(sample[name], name):
            blocks[name] = []
        elif not blocks:
            return {}
        else:
            blocks[list(blocks)[-1]].append(name)
    bases = {name.partition(" (")[0] for name in blocks}
    alike = len({len(channels) for channels in blocks.values()}) == 1 and all(blocks.values())
    several = len(blocks) > 1 and (len(bases) == 1 or len(blocks) >= _LEAST_BLOCKS)
    return blocks if tuple(stamps) == tuple(blocks)[:1] and alike and several else {}


def as_long(frames: Iterable[pd.DataFrame], blocks: dict[str, list[str]]) -> Iterator[pd.DataFrame]:
    """The rows of each piece with one value each, its name and its own stamp."""
    first = next(iter(blocks))
    for piece in number_rows(frames):
        parts = []
        for stamp, channels in blocks.items():
            for name in channels if stamp in piece else ():
                if name in piece:
                    part = piece[[stamp, name]].set_axis([first, VALUE], axis=1)
                    logged = part[first].notna() & (part[first] != "") & (part[VALUE] != name)  # no header again
                    parts.append(part[logged].assign(**{POINT: name}))
        yield pd.concat(parts)


def number_rows(frames: Iterable[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Pieces of a table whose index numbers their rows in the file."""
    first = 0
    for piece in frames:
        yield piece.set_axis(pd.RangeIndex(first, first + len(piece), name=ROW), axis=0)
        first += len(piece)


def numbered_values(rows: Sequence[tuple[int, str, str, str]]) -> pd.DataFrame:
    """Numbers of rows, their stamps, points and values as a piece of a long table."""
    return pd.DataFrame(rows, columns=[ROW, STAMP, POINT, VALUE]).astype({ROW: int}).set_index(ROW)


def is_value_name(name: str) -> bool:
    """Whether a column is named after values as such, and not after what they are of."""
    return _IS_VALUE.fullmatch(re.sub(r"\s*[\[(].*", "", name).strip()) is not None
