"""From the channels of a log to columns by role, in the units of the data contract."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import listed, role_of
from ..preprocessing._units import CONTRACT_UNIT, UNITS, conversion_of, convert
from .raw_log import RawLog
from .unit_names import COUNTERS, ENERGY

#: times that a plant ran in each row, in seconds
TIMES = {"s": 1.0, "min": 60.0}
_FEW_RESETS = 0.01  # share of a counter's readings that fall at most, when it is reset or replaced
_SLOW = 0.1  # rise of a counter, relative to its readings, that an energy per row cannot have without ever falling


class Channel(NamedTuple):
    """A channel of a log in the role it plays."""

    role: str
    name: str
    unit: str | None = None  # None: that of the data contract
    scale: float = 1.0  # factor after the unit


def contract_unit(role: str) -> str:
    """Unit of a role in the data contract."""
    for prefix, kind in (("q_sol", "irradiance"), ("T_", "temperature"), ("u_", "fraction"), ("Q_", "power")):
        if role.startswith(prefix):
            return CONTRACT_UNIT[kind]
    return "-"


def channels_of(
    raw: RawLog,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
) -> list[Channel]:
    """The channels to read: as given by role, else as the format defines them; units and factors likewise.

    A unit that the log states counts where it can be that of the role.

    Raises
    ------
    ValueError
        If a channel is not in the log, or ``units`` or ``scale`` name a role without one.
    """
    chosen = dict(raw.roles) | dict(columns or {})
    if not chosen:
        raise ValueError(
            f"no column of the log has a role ({listed(raw.frame.columns)}); give columns={{role: column}}."
        )
    for role, name in chosen.items():
        if name not in raw.frame:
            raise ValueError(f"{role} is to be the column {name!r}, but the log has {listed(raw.frame.columns)}.")
    for what, given in (("unit", units or {}), ("scale", scale or {})):
        for role in given:
            if role not in chosen:
                raise ValueError(f"a {what} is given for {role!r}, which has no column ({', '.join(chosen)}).")
    return [
        Channel(
            role,
            name,
            (units or {}).get(role, fitting_unit(raw.units.get(name), role)),
            (scale or {}).get(role, raw.scale.get(name, 1.0)),
        )
        for role, name in chosen.items()
    ]


def fitting_unit(unit: str | None, role: str) -> str | None:
    """The unit, where it can be that of the role: only a power is logged as an energy, only a stage as a time."""
    prefix = "Q_" if is_energy(unit) else "u_" if unit in TIMES else ""
    return unit if role.startswith(prefix) else None


def is_energy(unit: str | None) -> bool:
    """Whether values in a unit become powers by the rows around them."""
    return unit in ENERGY or unit in COUNTERS


def to_roles(raw: RawLog, channels: list[Channel], label: str = "left") -> pd.DataFrame:
    """Columns by role in the units of the data contract, at the stamps of the log.

    Energies per row and counters become mean powers [kW], times that a plant ran become stages.  A role that the
    contract does not have keeps its numbers.  With the ``label`` "right" a counter's power stands in the row that ends
    it, as all other means do.

    Raises
    ------
    ValueError
        If a unit does not suit its role.
    """
    return pd.DataFrame({c.role: _converted(raw, c, label) for c in channels}, index=raw.frame.index)


def _converted(raw: RawLog, channel: Channel, label: str) -> np.ndarray:
    series, unit = raw.frame[channel.name], channel.unit
    if channel.role.startswith("Q_") and unit in COUNTERS:
        values = COUNTERS[unit] * _power_of_counter(series, label)
    elif channel.role.startswith("Q_") and unit in ENERGY:
        power = _power_of_counter(series, label) if is_counter(series) else series.to_numpy(float) / row_hours(series)
        values = ENERGY[unit] * power
    elif unit in TIMES and channel.role.startswith("u_"):
        # a factor of the format says it all, such as 1/300 for the seconds of five minutes
        known = channel.scale != 1.0
        values = series.to_numpy(dtype=np.float64) * (1.0 if known else TIMES[unit] / (3600.0 * row_hours(series)))
    elif unit is None or (role_of(channel.role) is None and unit not in UNITS):
        values = series.to_numpy(dtype=np.float64)
    else:
        values = convert(series.to_numpy(dtype=np.float64), conversion_of(unit, channel.role))
    return values * channel.scale


def is_counter(values: pd.Series) -> bool:
    """Whether readings only rise, but for a few resets, as those of a meter do."""
    readings = values.dropna().to_numpy(dtype=np.float64)
    steps = np.diff(readings)
    if len(steps) <= 20 or not (steps > 0).any():
        return False
    slow = (steps >= 0).all() and readings[-1] - readings[0] < _SLOW * readings[0]
    return bool(slow or ((steps > 0).sum() > 10 and (steps < 0).mean() <= _FEW_RESETS))


def _power_of_counter(readings: pd.Series, label: str) -> np.ndarray:
    """Readings of a counter as mean power over each row: energy unit per hour."""
    known = readings.dropna()
    used = np.append(np.diff(known.to_numpy(dtype=np.float64)), np.nan)
    hours = np.append(_hours_between(known), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        power = pd.Series(np.where(used < 0.0, np.nan, used / hours), index=known.index)
    power = power[~power.index.duplicated()].reindex(readings.index)
    return (power.shift() if label == "right" else power).to_numpy()


def row_hours(values: pd.Series) -> float:
    """Usual distance of two values [h]; other columns of the log may have more of them."""
    between = _hours_between(values.dropna())
    return float(np.median(between)) if len(between) else 1.0


def _hours_between(values: pd.Series) -> np.ndarray:
    return np.diff(pd.DatetimeIndex(values.index).as_unit("ns").asi8) / 3.6e12
