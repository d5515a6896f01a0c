"""From the channels of a log to columns by role, in the units of the data contract."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import is_stage, listed, role_of
from .._warnings import several
from ..preprocessing._units import CONTRACT_UNIT, KIND_OF_PREFIX, UNITS, conversion_of, convert
from .counters import hours_between, is_counter, power_of_counter
from .even_steps import own_steps
from .fill_values import HUGE, fill_values, sensor_failures, zeros_left_blank
from .naming import factor_in_name
from .raw_log import RawLog
from .setpoint_modes import in_force, shared_zones
from .unit_names import COUNTERS, ENERGY, IRRADIATION

#: times that a plant ran in each row, in seconds
TIMES = {"s": 1.0, "min": 60.0}


class Channel(NamedTuple):
    """A channel of a log in the role it plays."""

    role: str
    name: str
    unit: str | None = None  # None: that of the data contract
    scale: float = 1.0  # factor after the unit


def contract_unit(role: str) -> str:
    """Unit of a role in the data contract."""
    return next((CONTRACT_UNIT[kind] for prefix, kind in KIND_OF_PREFIX if role.startswith(prefix)), "-")


def channels_of(
    raw: RawLog,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
) -> list[Channel]:
    """The channels to read: as given by role, else as the format defines them; units and factors likewise.

    A unit that the log states counts where it can be that of the role.  A ValueError names a channel that the log
    lacks, or a unit or factor of a role that has none.
    """
    chosen = dict(raw.roles) | dict(columns or {})
    if not chosen:
        raise ValueError(
            f"no column of the log has a role ({listed(raw.frame.columns)}); give columns={{role: column}}."
        )
    refuse_unlogged(raw, chosen)
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


def refuse_unlogged(raw: RawLog, columns: Mapping[str, str]) -> None:
    """Refuse columns by role of which the log lacks one."""
    for role, name in columns.items():
        if name not in raw.frame:
            raise ValueError(f"{role} is to be the column {name!r}, but the log has {listed(raw.frame.columns)}.")


def fitting_unit(unit: str | None, role: str) -> str | None:
    """The unit, where it can be that of the role: only a power is logged as an energy, only a stage as a time."""
    prefix = "q_sol" if unit in IRRADIATION else "Q_" if is_energy(unit) else "u_" if unit in TIMES else ""
    return unit if role.startswith(prefix) else None


def is_energy(unit: str | None) -> bool:
    """Whether values in a unit become powers by the rows around them."""
    return unit in ENERGY or unit in COUNTERS or unit in IRRADIATION


def to_roles(raw: RawLog, channels: list[Channel]) -> pd.DataFrame:
    """Columns by role in the units of the data contract, at the stamps of the log; a unit must suit its role.

    Energies per row and counters become mean powers [kW], times that a plant ran become stages.  A role that the
    contract does not have keeps its numbers.  A counter's power begins at its reading, whatever the label of the log.
    A set-point that the mode does not follow is one at which no plant runs.
    """
    frame, _ = _measured(raw, channels)
    zeros = _blank_zeros(raw, channels, frame)
    frame = frame.assign(**{c.role: frame[c.role].mask(is_zero, 0.0) for c, is_zero in zeros})
    shared = shared_zones({c.role: c.name for c in channels})
    return in_force(frame, shared, [c.role for c in channels if c.name in raw.held])


def factor_remarks(channels: list[Channel], scaled: Collection[str]) -> dict[str, str]:
    """A remark on each channel whose name has a factor that is not applied; ``scaled`` are the roles with one given."""
    found = {}
    for role, name in ((c.role, c.name) for c in channels if c.scale == 1.0 and c.role not in scaled):
        if (factor := factor_in_name(name)) is not None:
            found[name] = (
                f"the factor {factor:g} in its name is not applied; under [scale] give {role} = {factor:g} to multiply "
                f"by it, {1.0 / factor:g} to divide by it, or 1 if the values are right"
            )
    return found


def fill_remarks(raw: RawLog, channels: list[Channel]) -> dict[str, str]:
    """A remark on each channel with numbers that stand for a missing value or a failed sensor, or blanks for 0."""
    found = {}
    frame, failed = _measured(raw, channels)
    for channel in channels:
        series = raw.frame[channel.name]
        filled = fill_values(series, channel.role, counter_of(raw, channel) is not None) | failed[channel.role]
        if filled.any():
            code = series[filled.to_numpy()].iloc[0]
            found[channel.name] = f"{several(int(filled.sum()), 'value')} such as {code:.6g} taken as missing"
    for channel, zeros in _blank_zeros(raw, channels, frame):
        text = f"blank in {several(int(zeros.sum()), 'row')} and hardly ever 0: taken as 0 there"
        found[channel.name] = "; ".join(filter(None, (found.get(channel.name), text)))
    return found


def _measured(raw: RawLog, channels: list[Channel]) -> tuple[pd.DataFrame, dict[str, np.ndarray]]:
    """Columns by role without what failed sensors show, and the rows (N,) in which they do, by role."""
    columns = {c.role: _converted(raw, c) for c in channels}
    failed = {role: sensor_failures(values, role) for role, values in columns.items()}
    measured = {role: np.where(failed[role], np.nan, values) for role, values in columns.items()}
    return pd.DataFrame(measured, index=raw.frame.index), failed


def _blank_zeros(raw: RawLog, channels: list[Channel], frame: pd.DataFrame) -> Iterator[tuple[Channel, np.ndarray]]:
    """The channels that are blank where they are 0, and these rows."""
    for channel in channels:
        if channel.name not in raw.held and (zeros := zeros_left_blank(frame, channel.role)).any():
            yield channel, zeros


def _converted(raw: RawLog, channel: Channel) -> np.ndarray:
    series, unit, counter = raw.frame[channel.name], channel.unit, counter_of(raw, channel)
    series = series.mask(fill_values(series, channel.role, counter is not None))
    if channel.role.startswith("T_") and channel.name in raw.switches:
        series = series.where(~series.isin((0.0, 1.0)))
    values = series.to_numpy(dtype=np.float64)
    if counter is not None:
        values = power_of_counter(counter)
    elif (of_row := _energy_units(channel.role).get(str(unit))) is not None:
        values = of_row * values / _hours_of_rows(series)
    elif unit in TIMES and is_stage(channel.role):
        # a factor of the format says it all, such as 1/300 for the seconds of five minutes
        known = channel.scale != 1.0
        values = values * (1.0 if known else TIMES[unit] / (3600.0 * _hours_of_rows(series)))
    elif unit is not None and (role_of(channel.role) is not None or unit in UNITS):
        values = convert(values, conversion_of(unit, channel.role))
    return values * channel.scale


def _energy_units(role: str) -> Mapping[str, float]:
    """Units of an energy per row that a role may be logged in; columns without a role may be of irradiance too."""
    if role.startswith("Q_"):
        return ENERGY
    return IRRADIATION if role.startswith("q_sol") or role_of(role) is None else {}


def roles_without_label(raw: RawLog, channels: list[Channel]) -> list[str]:
    """Roles whose values begin at their stamps, whatever the label: those logged by change, and powers of counters."""
    return [c.role for c in channels if c.name in raw.held or counter_of(raw, c) is not None]


def counter_of(raw: RawLog, channel: Channel) -> pd.Series | None:
    """The readings of a channel that is a counter [kWh]; None for any other."""
    series, unit = raw.frame[channel.name], channel.unit or ""
    series = series.where(series.abs() < HUGE)
    if not channel.role.startswith("Q_") or not (unit in COUNTERS or (unit in ENERGY and is_counter(series))):
        return None
    return (COUNTERS | ENERGY)[unit] * series


def _hours_of_rows(values: pd.Series) -> np.ndarray:
    """Hours of the interval of each value, which a log may change; 1 where there is no value."""
    known = values.dropna()
    found = np.ones(len(values))
    found[values.notna()] = own_steps(pd.DatetimeIndex(known.index), 3600.0 * row_hours(values)) / 3600.0
    return found


def row_hours(values: pd.Series) -> float:
    """Usual distance of two values [h]; other columns of the log may have more of them."""
    between = hours_between(values.dropna())
    between = between[between > 0.0]
    return float(np.median(between)) if len(between) else 1.0
