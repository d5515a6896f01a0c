"""Rows, paths and features by which the behaviour of a thermostat and its plant is learned."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ..._clock import hour_of_day
from ..._last_known import carried_forward
from ..._table import ZoneTable
from ..._time import rows_per_day
from ...control import Band, LoadPaths
from ...forecasting.features import clock_changes, rows_back, same_slot, span_means
from ..scheme import NEXT

_WEEK = 7  # days
#: spans over which inputs are averaged, and back and ahead to which set-points are compared [h]
_MEANS, _BACK, _AHEAD = (6.0, 24.0), (0.25, 1.0, 4.0), 1.0
_NEVER = (0.0, 60.0)  # set-points of heating and cooling at which no room is heated or cooled [degC]
_OTHER_PLAN, _PLAN_HOURS = 0.3, 4.0  # mean difference of set-points [K] over hours, at which a plan is another one


class LawRows(NamedTuple):
    """Consecutive rows; of the heat and the temperature only what is known at an origin is read."""

    T: np.ndarray  # (N,) measured temperature [degC], NaN where missing
    heat: np.ndarray  # (N,) delivered heat [kW]
    band: Band  # set-points (N,); infinite where a side has none or it is not known
    weather: np.ndarray  # (N, m) outdoor temperature and irradiance
    clock: np.ndarray  # (N, 3) hour, day of the week, whether it is a weekend
    per_day: int
    changes: np.ndarray | None = None  # (N,) steps by which the local clock has changed; None: never
    beside: tuple[np.ndarray, ...] = ()  # (N,) temperature of each neighbour [degC], which the network reads

    @classmethod
    def of(cls, table: ZoneTable, heat: np.ndarray, band: Band) -> Self:
        # T_oa is the first of them, whatever the order of the columns
        chosen = [table.inputs[role] for role in sorted(table.inputs) if role == "T_oa" or role.startswith("q_sol")]
        weather = np.column_stack(chosen) if chosen else np.empty((table.n_rows, 0))
        beside = tuple(v for role, v in table.inputs.items() if role.startswith(NEXT))
        clock = np.column_stack([hour_of_day(table.time), table.day_of_week, table.weekend])
        per_day, changes = rows_per_day(table.step), clock_changes(table)
        return cls(table.measured(), heat, band, weather, clock, per_day, changes, beside)


def same_clock(rows: LawRows, origins: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heat, and temperature at the end, of the row at the same time a week before; else a day or any full days.

    Only rows before the origin are read; NaN where there is none.
    """
    week, day = (same_slot(targets, origins - 1, n * rows.per_day, rows.changes) for n in (_WEEK, 1))
    at = np.where(week >= 0, week, day)
    known, at = at >= 0, np.maximum(at, 0)
    return np.where(known, rows.heat[at], np.nan), np.where(known, rows.T[at + 1], np.nan)


def same_plan(rows: LawRows, targets: np.ndarray) -> np.ndarray:
    """(n,) bool, whether the set-points of the last hours are those of the same hours a week before."""
    before = rows_back(np.arange(len(rows.T)), _WEEK * rows.per_day, rows.changes)
    change = np.sum([np.abs(side - side[np.maximum(before, 0)]) for side in _finite(rows.band)], axis=0)
    change[before < 0] = 0.0
    first = np.maximum(targets + 1 - _hours(rows, _PLAN_HOURS), 0)
    return np.asarray(span_means(change, first, targets + 1) < _OTHER_PLAN)


def network_features(rows: LawRows, paths: LoadPaths, origins: np.ndarray, lead: np.ndarray) -> np.ndarray:
    """(n, k) features that a new plan of set-points leaves meaningful; ``lead`` (n,) counts from 0 at the origin's row.

    ``paths`` hold the network's ideal thermostat, a path per row of the features.
    """
    at = np.arange(len(lead))
    rows_at = np.minimum(origins + lead, len(rows.T) - 1)
    T, before = paths.temperature[at, lead], paths.temperature[at, np.maximum(lead - 1, 0)]
    heating, cooling = _finite(rows.band)
    last = np.minimum(origins + paths.heat.shape[1], len(rows.T)) - 1  # nothing is read after the horizon
    ahead = np.minimum(rows_at + _hours(rows, _AHEAD), last)
    columns = [paths.heat[at, lead], paths.heat[at, np.maximum(lead - 1, 0)], paths.zeta[at, lead]]
    columns += [T - heating[rows_at], T - cooling[rows_at], before - heating[rows_at], cooling[rows_at] - before]
    for side in (heating, cooling):
        columns += [side[rows_at] - side[np.maximum(rows_at - _hours(rows, h), 0)] for h in _BACK]
        columns.append(side[ahead] - side[rows_at])
    return np.column_stack([*columns, rows.clock[rows_at][:, [0, 2]], rows.weather[rows_at]])


def further_features(rows: LawRows, origins: np.ndarray, lead: np.ndarray) -> np.ndarray:
    """(n, k) features of a direct regression beside those of the network: levels, means, and what was seen before."""
    at = np.minimum(origins + lead, len(rows.T) - 1)
    heating, cooling = _finite(rows.band)
    series = np.column_stack([rows.weather, heating, cooling])
    means = [span_means(series, np.maximum(at + 1 - _hours(rows, hours), 0), at + 1) for hours in _MEANS]
    day, week = rows.per_day, _WEEK * rows.per_day
    T = carried_forward(rows.T)[origins]
    heat_before, T_before = same_clock(rows, origins, at)
    yesterday = same_slot(at, origins - 1, day, rows.changes)
    columns = [lead, rows.clock[at][:, 1], heating[at], cooling[at], T, T - heating[at], T - cooling[at]]
    columns += [np.where(origins > 0, rows.heat[np.maximum(origins - 1, 0)], np.nan), heat_before, T_before]
    columns += [np.where(yesterday >= 0, rows.heat[np.maximum(yesterday, 0)], np.nan)]
    for back in (day, week):
        earlier = rows_back(at, back, rows.changes)
        columns += [
            np.where(earlier >= 0, v[at] - v[np.maximum(earlier, 0)], np.nan)
            for v in (heating, cooling, *rows.weather.T[:1])
        ]
    return np.column_stack([*columns, *means])


def _finite(band: Band) -> tuple[np.ndarray, np.ndarray]:
    """Set-points, and where a side has none, one at which the plant never acts."""
    heating, cooling = (np.where(np.isfinite(s), s, never) for s, never in zip(band, _NEVER, strict=True))
    return heating, cooling


def _hours(rows: LawRows, hours: float) -> int:
    return max(1, round(hours / 24.0 * rows.per_day))
