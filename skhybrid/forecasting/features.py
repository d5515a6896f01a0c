"""Features of a forecaster: calendar, weather, plant modes, and the past as known at an origin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._calendar import one_hot
from .._clock import hour_of_day
from .._table import ZoneTable
from .._time import rows_per_day
from .cases import TIME_FEATURES

TIME_ENCODINGS = ("cyclic", "onehot", "ordinal")
#: feature -> (levels, harmonics); the day is the seventh harmonic of the week
_CYCLES = {"how": (168, (1, 7)), "hod": (24, (1,)), "dow": (7, (1,))}
_DECAYS_H = (2.0, 8.0, 24.0)  # in which 1/e of a deviation is left [h]


def encode_time(table: ZoneTable, feature: str, encoding: str) -> np.ndarray:
    """(n, n_columns) of how, hod or dow (sines and cosines, one-hot, or the plain number), or of weekday (0 or 1)."""
    if feature == "weekday":
        return (~table.weekend).astype(np.float64)[:, None]
    day, hour = table.day_of_week.astype(np.float64), hour_of_day(table.time)
    value = {"how": 24.0 * day + hour, "hod": hour, "dow": day}[feature]
    n_levels, harmonics = _CYCLES[feature]
    if encoding == "ordinal":
        return value[:, None]
    if encoding == "onehot":
        return one_hot(np.floor(value).astype(np.int64), n_levels)
    angles = 2.0 * np.pi * value[:, None] * np.array(harmonics) / n_levels
    return np.hstack([np.sin(angles), np.cos(angles)])


def irradiance_roles(inputs: dict[str, Any]) -> list[str]:
    """The roles ``q_sol`` and ``q_sol_<name>`` of a table, in its order."""
    return [role for role in inputs if role == "q_sol" or role.startswith("q_sol_")]


def mode_roles(inputs: dict[str, Any]) -> list[str]:
    """The roles of plant stages and measured heat, which show whether the plant heats or cools."""
    return [role for role in inputs if role.startswith(("u_heat", "u_cool", "Q_"))]


def plant_mode(inputs: dict[str, np.ndarray], mode: str, n_rows: int) -> np.ndarray:
    """(n,) 0 or 1: whether the plant heats (``mode="heat"``) or cools, by its stages or else the sign of ``Q_...``."""
    stages = [v for role, v in inputs.items() if role.startswith(f"u_{mode}")]
    if stages:
        return (np.max(stages, axis=0) > 0).astype(np.float64)
    heats = [v for role, v in inputs.items() if role.startswith("Q_")]
    if heats:
        total = np.sum(heats, axis=0)
        return ((total > 0) if mode == "heat" else (total < 0)).astype(np.float64)
    return np.zeros(n_rows)


def row_features(table: ZoneTable, features: tuple[str, ...], encoding: str) -> np.ndarray:
    """(n_rows, n_columns) float64 columns of features but ``zeta``; none for a feature whose role the table lacks."""
    blocks = [np.empty((table.n_rows, 0))]
    for feature in features:
        if feature in TIME_FEATURES:
            blocks.append(encode_time(table, feature, encoding))
        elif feature == "T_oa" and "T_oa" in table.inputs:
            blocks.append(table.inputs["T_oa"][:, None])
        elif feature == "q_sol":
            blocks.extend(table.inputs[role][:, None] for role in irradiance_roles(table.inputs))
        elif feature in ("i_heat", "i_cool"):
            blocks.append(plant_mode(table.inputs, feature.removeprefix("i_"), table.n_rows)[:, None])
    return np.hstack(blocks)


def target_rows(origins: np.ndarray, n_leads: int) -> np.ndarray:
    """(n_origins, n_leads) row numbers origin + 1, origin + 2, ..."""
    return origins[:, None] + np.arange(1, n_leads + 1)


def held_target_rows(table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
    """(n_origins, n_leads) target rows, held at the last row beyond the table."""
    return np.minimum(target_rows(origins, n_leads), table.n_rows - 1)


def known_at(series: np.ndarray, rows: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """Values of ``series`` at ``rows`` (n_origins, n); NaN after the origin and before the table."""
    inside = (rows >= 0) & (rows <= origins[:, None])
    return np.where(inside, series[np.clip(rows, 0, len(series) - 1)], np.nan)


def known_before(series: np.ndarray, rows: np.ndarray, end: int) -> np.ndarray:
    """Values of ``series`` at ``rows`` of any shape; NaN from row ``end`` on."""
    return np.where(rows < end, series[np.minimum(rows, len(series) - 1)], np.nan)


def clock_changes(table: ZoneTable) -> np.ndarray | None:
    """(n_rows,) steps by which the local clock of each row is ahead of the first row's; None where it never changes."""
    if table.utc is None:
        return None
    ahead = (table.time.as_unit("ns").asi8 - table.utc.as_unit("ns").asi8) // table.step.as_unit("ns").value
    return None if (ahead == ahead[:1]).all() else ahead - ahead[0]


def rows_back(rows: np.ndarray, n_steps: Any, changes: np.ndarray | None) -> np.ndarray:
    """Rows that lie ``n_steps`` before others by the local clock, whose ``changes`` are those of :func:`clock_changes`.

    Where the clock repeats an hour it is the first of the two; where the clock skips one, the row after.
    """
    if changes is None:
        return rows - n_steps
    clock = np.maximum.accumulate(np.arange(len(changes)) + changes)
    earlier = rows + changes[np.clip(rows, 0, len(changes) - 1)] - n_steps
    return np.where(earlier < 0, earlier, np.searchsorted(clock, earlier))


def same_slot(
    rows: np.ndarray, origins: np.ndarray, period: int, changes: np.ndarray | None = None, back: int = 0
) -> np.ndarray:
    """Rows whole periods before ``rows`` (n_origins, ...): the last ones up to the origin, or ``back`` earlier.

    A period is a number of steps by the local clock, of which ``changes`` are those of :func:`clock_changes`.
    """
    limit = origins.reshape((-1,) + (1,) * (rows.ndim - 1))
    ahead = rows - limit
    if changes is not None:
        at, last = (changes[np.clip(each, 0, len(changes) - 1)] for each in (rows, limit))
        ahead = ahead + at - last
    return rows_back(rows, (back + -(-ahead // period)) * period, changes)


def last_same_slot(
    series: np.ndarray,
    rows: np.ndarray,
    origins: np.ndarray,
    period: int,
    n_back: int,
    changes: np.ndarray | None = None,
) -> np.ndarray:
    """(n_origins, n_leads) value at :func:`same_slot`, the last known one of ``n_back``; NaN if none."""
    out = np.full(rows.shape, np.nan)
    for back in range(n_back):
        missing = np.isnan(out)
        if not missing.any():
            break
        out = np.where(missing, known_at(series, same_slot(rows, origins, period, changes, back), origins), out)
    return out


def span_means(series: np.ndarray, first: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Means of the rows ``first`` ... ``stop - 1`` of series (N,) or (N, m); 0 where there is none."""
    total = np.concatenate([np.zeros((1, *series.shape[1:])), np.cumsum(series, axis=0)])
    count = np.maximum(stop - first, 1)
    return (total[stop] - total[first]) / count.reshape(count.shape + (1,) * (series.ndim - 1))


def lag_features(table: ZoneTable, deviation: np.ndarray, origins: np.ndarray, n_leads: int) -> np.ndarray:
    """(n_origins, n_leads, n_features) known at each origin of the deviation from a model of the calendar and weather.

    The last value and means of the last hours, each fading with the lead; the last day's mean and the week's; the last
    known value at the same time of day, apart for pairs of unlike day types; and a week before.  Unknown values are 0,
    which is the deviation to expect.
    """
    per_day = rows_per_day(table.step)
    hours = np.arange(1, n_leads + 1) * table.step_hours
    rows = target_rows(origins, n_leads)
    series, widths = pd.Series(deviation), (1, max(1, per_day // 4), per_day, 7 * per_day)
    means = [series.rolling(width, min_periods=1).mean().to_numpy() for width in widths]
    now = [known_at(mean, origins[:, None], origins) for mean in means]
    fade = [np.exp(-hours / decay)[None, :] for decay in _DECAYS_H]
    changes, weekend = clock_changes(table), table.weekend
    day_before, week_before = (same_slot(rows, origins, n * per_day, changes) for n in (1, 7))
    same, week = (known_at(deviation, before, origins) for before in (day_before, week_before))
    alike = weekend[np.minimum(rows, table.n_rows - 1)] == weekend[np.maximum(day_before, 0)]
    flat = np.ones((1, n_leads))
    features = [now[0] * fade[0], now[0] * fade[1], now[1] * fade[1], now[2] * fade[2], now[2] * flat, now[3] * flat]
    features += [same * alike, same * ~alike, week]
    return np.nan_to_num(np.stack(features, axis=-1))
