"""Rows of a log that a model can read: those with every input, up to a last temperature that can be right."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from .._last_known import up_to_last_known
from .._table import SETPOINT_ROLES, listed
from ..logs.standstills import room_standstills, without_standstills
from ..preprocessing.bridges import complete
from ..study.log_reading import SETPOINT
from ..study.settings import Settings
from ..study.zone_part import log_columns

_LEAP, _USUAL = 8.0, 2.0  # between two rows: what no room does [K], also where it often moves; times its largest move


def complete_rows(frame: pd.DataFrame, measured: Sequence[str] = ("T_za",)) -> pd.DataFrame:
    """Rows with every input, up to the last measured temperature; set-points are filled from the rows before.

    ``measured`` are the roles of the zones' temperatures.
    """
    return complete(up_to_measured(frame, measured), measured)


def up_to_measured(frame: pd.DataFrame, measured: Sequence[str]) -> pd.DataFrame:
    """Rows up to the last measured temperature; set-points are filled from the rows before."""
    measured = list(measured)
    for role in measured:
        if role not in frame:
            raise ValueError(f"the log has no room temperature, {role}.")
    of_zones = () if measured == ["T_za"] else tuple(f"{role}_" for role in SETPOINT_ROLES)
    set_points = [role for role in frame if role in SETPOINT_ROLES or str(role).startswith(of_zones)]
    held = {str(role): frame[role].ffill().bfill() for role in set_points}
    frame = frame.assign(**{role: without_standstills(frame, role) for role in measured}, **held)
    return up_to_last_known(frame.drop(columns=SETPOINT, errors="ignore"), measured)


def refuse_stuck(frame: pd.DataFrame, measured: Sequence[str], origin: pd.Timestamp) -> None:
    """Refuse a log that ends with temperatures of a sensor that stands still, so that its last known row is old."""
    for role in measured:
        known, found = frame[role].dropna(), room_standstills(frame, role)
        last = pd.DatetimeIndex(known.index).max()
        if len(found) and found["last"].iloc[-1] == last > origin:
            begin, value = found["first"].iloc[-1], found["value"].iloc[-1]
            raise ValueError(
                f"{role} stays at {value:.4g} degC from {begin} to {last}, which no room does: is the sensor stuck? "
                f"A forecast can start from {origin} only; mend the sensor, or leave its rows out."
            )


def refuse_cut_value(frame: pd.DataFrame, settings: Settings, origin: pd.Timestamp) -> None:
    """Refuse a last temperature that leaps from the row before, such as that of a file that is being written."""
    for role in settings.roles_of("T_za"):
        rows = frame[role].loc[:origin].iloc[-2:]
        leap = rows.diff().abs()
        if leap.iloc[-1] > max(_LEAP, _USUAL * frame[role].diff().abs().loc[: rows.index[0]].max()):
            raise ValueError(
                f"{listed(log_columns([role], settings)) or role} leaps from {rows.iloc[0]:.4g} to {rows.iloc[-1]:.4g} "
                f"degC in the last row, {origin}, which no room does: is the log still being written? Try again when "
                "it is complete, or leave that value out."
            )
