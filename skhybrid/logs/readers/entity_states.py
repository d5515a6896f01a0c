"""States of Home Assistant's entities as numbers, and their values on an even grid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..counters import is_counter
from ..setpoint_modes import code_of
from ..stamps import time_zone_named
from .known_table import numbers_in

#: states that are 1 or 0; any other state that is not a number is missing
ON_OFF = {"on": 1.0, "off": 0.0, "open": 1.0, "closed": 0.0, "true": 1.0, "false": 0.0, "home": 1.0, "not_home": 0.0}
MISSING = ("unavailable", "unknown", "none", "")
MOST_CELLS = 60_000_000  # half a gigabyte
_LISTED, _DAY = 12, 86400.0


def states_to_numbers(states: Iterable[object]) -> tuple[np.ndarray, int]:
    """States (n,) as float64, NaN where one is missing or no number, and how many were other text."""
    text = pd.Series(list(states), dtype=object).astype(str).str.strip()
    numbers = numbers_in(text, ON_OFF)
    numbers[~np.isfinite(numbers)] = np.nan
    left = text[np.isnan(numbers)].str.lower()
    return numbers, int((~left.isin((*MISSING, "nan", "inf", "-inf"))).sum())


def climate_values(attributes: Iterable[Mapping[str, Any] | None], states: Iterable[object]) -> dict[str, np.ndarray]:
    """Channels of a climate entity from its attributes: temperatures, set-points, heating, cooling and its mode."""
    rows, modes = list(attributes), [str(state).lower() for state in states]
    gone = np.array([mode in MISSING for mode in modes], dtype=bool)
    found = {}
    for name in ("current_temperature", "temperature", "target_temp_low", "target_temp_high", "current_humidity"):
        values = np.array([_number((row or {}).get(name)) for row in rows])
        found[name] = np.where(gone, np.nan, values)
    actions = [None if row is None else row.get("hvac_action") for row in rows]
    known = np.array([isinstance(action, str) for action in actions], dtype=bool) & ~gone
    can = {str(mode) for row in rows for mode in ((row or {}).get("hvac_modes") or [])} | set(modes)
    for name, running, able in (
        ("heating", ("heating", "preheating"), {"heat", "heat_cool", "auto"}),
        ("cooling", ("cooling",), {"cool", "heat_cool"}),
    ):
        on = np.array([action in running for action in actions], dtype=np.float64)
        if on.any() or can & able:
            found[name] = np.where(known, on, np.nan)
    codes = {mode: np.nan if (code := code_of(mode)) is None else code for mode in set(modes)}
    found["mode"] = np.where(gone, np.nan, [codes[mode] for mode in modes])
    return {name: values for name, values in found.items() if np.isfinite(values).any()}


def climate_roles(entities: list[str], channels: Iterable[str]) -> dict[str, str]:
    """Roles of the only climate entity; none where there are several, which only the user can tell apart."""
    if len(entities) != 1:
        return {}
    (entity,), names = entities, set(channels)
    wanted = {"T_za": "current_temperature", "u_heat": "heating", "u_cool": "cooling"}
    single = f"{entity}.temperature" in names and f"{entity}.target_temp_low" not in names
    if single:
        plants = {"T_heat_set": "heating", "T_cool_set": "cooling"}
        runs = {role: "temperature" for role, plant in plants.items() if f"{entity}.{plant}" in names}
        wanted |= {"mode": "mode"} | (runs or {"T_heat_set": "temperature"})
    else:
        wanted |= {"T_heat_set": "target_temp_low", "T_cool_set": "target_temp_high"}
    return {role: f"{entity}.{name}" for role, name in wanted.items() if f"{entity}.{name}" in names}


def on_even_rows(
    series: dict[str, tuple[np.ndarray, np.ndarray]], step: pd.Timedelta, timezone: str | None, where: str
) -> tuple[pd.DataFrame, np.ndarray]:
    """The values in force at each multiple of ``step``, and its seconds since 1970; empties the ``series``.

    These are the stamps [s] and values of each channel, whose first and last rows bound the result.
    """
    first, last = min(at[0] for at, _ in series.values()), max(at[-1] for at, _ in series.values())
    grid = _even_grid(first, last, step, len(series), where)
    held = {name: hold(*series.pop(name), grid) for name in list(series)}  # both would take twice the memory
    return pd.DataFrame(held, index=utc_index(grid, timezone)), grid


def _even_grid(first: float, last: float, step: pd.Timedelta, n_channels: int, where: str) -> np.ndarray:
    """Seconds since 1970 of the multiples of ``step`` between two stamps."""
    seconds = step.total_seconds()
    begin, end = np.ceil(first / seconds), np.floor(last / seconds)
    n_rows = int(end - begin) + 1
    if n_rows < 1:
        raise ValueError(f"{where} covers less than one step of {step}; give a shorter step.")
    if n_rows * n_channels > MOST_CELLS:
        raise ValueError(
            f"{where} makes {n_rows} rows of {step} for {n_channels} channels, too many to hold; name those that are "
            "needed (entities=), or give a longer step (step='5min')."
        )
    return seconds * (begin + np.arange(n_rows))


def hold(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The value in force at each stamp of the grid: the last one at or before it, NaN where that one is missing.

    A counter rises evenly to its next reading, but for longer than it usually takes: held, all the heat of some
    minutes would come in one.
    """
    if not len(stamps):
        return np.full(len(grid), np.nan)
    last = np.searchsorted(stamps, grid, side="right") - 1
    held = np.where(last >= 0, values[last.clip(min=0)], np.nan)
    known = np.isfinite(values)
    at, readings = stamps[known], values[known]
    # within a day a temperature may only rise too
    if not known.any() or at[-1] - at[0] < _DAY or not is_counter(pd.Series(readings, utc_index(at, None))):
        return held
    rises, apart = np.diff(readings) > 0.0, np.diff(at)
    begins = at[1:] - np.where(rises, np.minimum(apart, np.median(apart[rises])), 0.0)
    corners, heights = np.insert(at, slice(1, None), begins), np.repeat(readings, 2)[:-1]
    return np.where(np.isnan(held), np.nan, np.interp(grid, corners, heights))


def utc_index(grid: np.ndarray, timezone: str | None) -> pd.DatetimeIndex:
    """Stamps in UTC, or in the zone that is wanted."""
    index = pd.DatetimeIndex(pd.to_datetime(np.round(grid * 1e3).astype(np.int64), unit="ms", utc=True), name="time")
    return index if timezone is None else index.tz_convert(time_zone_named(timezone))


def some_of(names: Iterable[str]) -> str:
    """The first few names, and how many more there are."""
    known = sorted(names)
    more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
    return ", ".join(known[:_LISTED]) + more


def refuse_unknown(wanted: Iterable[str], known: Iterable[str], where: str) -> None:
    """Refuse a list of entities with one that the source does not have."""
    names = set(known)
    for name in wanted:
        if name not in names:
            raise ValueError(f"{where} has no entity {name!r}, only {some_of(names)}.")


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else np.nan
