"""One long table of the tables of zones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd


def joined(tables: Mapping[Any, pd.DataFrame], key: str) -> tuple[pd.DataFrame, dict[Any, str]]:
    """The tables of zones, one after the other, with the key as first column; and why some are not among them.

    Stamps of several time zones become UTC; those without one cannot stand beside others.
    """
    clocks = {zone: _clock_of(table) for zone, table in tables.items()}
    aware = {clock for clock in clocks.values() if clock is not None}
    failed, parts = {}, []
    for zone, table in tables.items():
        if key in table:
            raise ValueError(f"the forecasts of a zone have a column {key!r} themselves; give the fleet another key.")
        if aware and clocks[zone] is None and isinstance(table.index, pd.DatetimeIndex):
            failed[zone] = "its stamps have no time zone, but those of other zones have one; give it one."
            continue
        parts.append((_in_utc(table) if len(aware) > 1 else table).assign(**{key: zone}))
    if not parts:
        return pd.DataFrame(columns=[key]), failed
    made = pd.concat(parts)
    return made[[key, *made.columns.drop(key)]], failed


def _clock_of(table: pd.DataFrame) -> str | None:
    """The time zone of a table's stamps, in its index or a column."""
    index = table.index if isinstance(table.index, pd.DatetimeIndex) else table.get("time")
    tz = getattr(index, "tz", None) or getattr(getattr(index, "dt", None), "tz", None)
    return None if tz is None else str(tz)


def _in_utc(table: pd.DataFrame) -> pd.DataFrame:
    if isinstance(table.index, pd.DatetimeIndex):
        table = table.set_axis(table.index.tz_convert("UTC"), axis=0)
    stamped = [str(c) for c in table if isinstance(table[c].dtype, pd.DatetimeTZDtype)]
    return table.assign(**{c: table[c].dt.tz_convert("UTC") for c in stamped})
