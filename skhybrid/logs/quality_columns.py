"""Columns that say whether the values beside them are good, as data historians write them."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping

import pandas as pd

from .cell_numbers import is_error

_NAME = re.compile(r"qualit|validity|\bflag\b|\bstatus(?:[ .]\(?\d+\)?)?\Z", re.IGNORECASE)
_GOOD, _OFTEN = 192.0, 0.5  # by OPC, and above; share of the rows that shows it


def quality_columns(names: Iterable[Hashable]) -> list[str]:
    """The columns that have the usual name of one of quality."""
    return [str(name) for name in names if _NAME.search(str(name))]


def columns_judged(names: Iterable[Hashable]) -> dict[str, str]:
    """The column that each one of quality judges: the one before it, where several have one, or its name says so."""
    ordered = list(map(str, names))
    found = quality_columns(ordered)
    before = {name: ordered[ordered.index(name) - 1] for name in found if name != ordered[0]}
    pairs = {name: judged for name, judged in before.items() if judged not in found}
    return pairs if len(pairs) > 1 else {name: judged for name, judged in pairs.items() if name.startswith(judged)}


def without_bad(piece: pd.DataFrame, judged: Mapping[str, str]) -> pd.DataFrame:
    """The rows of a table with the word for a bad quality in place of each value that has one."""
    out = {}
    for name, of in judged.items():
        words, numbers = piece[name].astype(str), pd.to_numeric(piece[name], errors="coerce")
        by_number = bool((numbers == _GOOD).mean() > _OFTEN)
        bad = numbers < _GOOD if by_number else piece[name].notna() & words.map(is_error)
        if bad.any():
            out[of] = piece[of].astype(object).where(~bad, "bad" if by_number else words)
    return piece.assign(**out)
