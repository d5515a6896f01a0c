"""One long table of the tables of zones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

#: by whether most zones have a time zone
_OTHER_CLOCK = {
    True: "its stamps have no time zone, but those of other zones have one; give it one.",
    False: "its stamps have a time zone, but those of most zones have none; give all of them one.",
}


def joined_zones(tables: Mapping[Any, pd.DataFrame], key: str) -> tuple[pd.DataFrame, dict[Any, str]]:
    """The tables of zones, one after the other, with the key as first column; and why some are not among them.

    Stamps of several time zones become UTC.  Stamps with a time zone and without one cannot stand in one table, so
    those of which there are fewer are left out.
    """
    clocks = {zone: _clock_of(table) for zone, table in tables.items()}
    aware = [clock for clock in clocks.values() if clock is not None]
    with_clock = 2 * len(aware) >= len(clocks)
    failed, parts = {}, []
    for zone, table in tables.items():
        if key in table:
            raise ValueError(f"the forecasts of a zone have a column {key!r} themselves; give the fleet another key.")
        if aware and (clocks[zone] is not None) != with_clock:
            failed[zone] = _OTHER_CLOCK[with_clock]
            continue
        parts.append(
            (_in_utc(table) if with_clock and len(set(aware)) > 1 else table).assign(**{key: [zone] * len(table)})
        )
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
