"""Spells in which a temperature does not change, as that of a stuck sensor."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES
from .zone_names import plants_of_room

_STANDSTILL = pd.Timedelta("1D")  # the temperature of no room rests for so long, nor that outdoors
_HELD = 0.05  # farthest from its set-point that a room without a free degree is held, as in a simulation [K]
_CONTROLLED = 0.5  # share of a spell in which the heat moves, so that it is the control that holds the temperature


def standstills(role: str, values: pd.Series, controlled: pd.Series | None = None) -> pd.DataFrame:
    """Spells in which a temperature (n,) does not change for longer than one can: first and last stamp, value.

    Equal values before and after an outage are no spell, nor are ``controlled`` rows, those of a room that its plant
    holds.
    """
    known = values.dropna()
    if role not in ("T_za", "T_oa") or known.empty:
        return pd.DataFrame({"first": [], "last": [], "value": []})
    stamps = pd.Series(known.index, index=known.index)
    spells = ((known != known.shift()) | (stamps.diff() > _STANDSTILL / 2)).cumsum()
    by_spell = stamps.groupby(spells)
    found = pd.DataFrame({"first": by_spell.first(), "last": by_spell.last(), "value": known.groupby(spells).first()})
    stuck = found["last"] - found["first"] >= _STANDSTILL
    if controlled is not None:
        held = controlled.to_numpy()[values.notna().to_numpy()]
        stuck &= pd.Series(held, known.index).groupby(spells).mean() < _CONTROLLED
    return found[stuck].reset_index(drop=True)


def room_standstills(frame: pd.DataFrame, role: str) -> pd.DataFrame:
    """Standstills of a room's temperature, a column of ``frame``, but those in which its plant holds it."""
    return standstills("T_za", frame[role], controlled_rows(frame, role))


def without_standstills(frame: pd.DataFrame, role: str) -> pd.Series:
    """A room's temperature, a column of ``frame``, whose standstills are missing, but for their first value."""
    out = frame[role].copy()
    for first, last, _ in room_standstills(frame, role).itertuples(index=False):
        out[(out.index > first) & (out.index <= last)] = np.nan
    return out


def controlled_rows(frame: pd.DataFrame, role: str) -> pd.Series:
    """Whether a room has the temperature of a set-point while heat flows that changes, by row; columns are roles.

    A sensor that is stuck at its set-point lets no control change the heat.
    """
    zone = role.removeprefix("T_za")
    set_points = [name for name in (*(s + zone for s in SETPOINT_ROLES), *SETPOINT_ROLES, "setpoint") if name in frame]
    heat = frame[plants_of_room(frame, zone)].ffill()
    held = (frame[set_points].ffill().sub(frame[role], axis=0).abs() <= _HELD).any(axis=1)
    return held & (heat.diff().abs() > 0.0).any(axis=1)
