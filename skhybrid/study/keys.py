"""Keys of a configuration."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable


def check_keys(table: str, given: Iterable[str], known: Collection[str]) -> None:
    """Refuse a key that a table of the configuration does not have; ``table`` is "" at its top."""
    for key in given:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}."
            raise ValueError(f"unknown key {key!r}{f' in [{table}]' if table else ''}; {hint}")
