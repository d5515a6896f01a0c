"""A log as its source wrote it, which every reader returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd


@dataclass(frozen=True)
class RawLog:
    """A log before anything is chosen, converted or resampled.

    Parameters
    ----------
    frame : DataFrame of shape (n_rows, n_channels)
        Float64 channels under their own names, in the order of the source; NaN where nothing was logged.  The index is
        a DatetimeIndex named ``time``, increasing, with a zone where the source tells one; rows may be uneven.
        On/off and open/closed are 1 and 0; other text has no place here, and a note says which channels were left out.
    format : str
        Name of the format, as users know it: ``"CSV"``, ``"ecobee portal"``.
    units : mapping of channel to unit
        Units that the source states, as :class:`skhybrid.preprocessing.UnitConverter` names them, and ``"kWh"``,
        ``"Wh"``, ``"MWh"``, ``"kBtu"``, ``"MJ"`` and ``"GJ"`` of energies; a channel without a unit is absent.
    roles : mapping of role to channel
        Roles that the format itself defines; empty where channels have free names.
    scale : mapping of channel to number
        Factors that make a stage between 0 and 1 of a channel, known from the format: 1/300 for the seconds of heating
        in five minutes.
    held : frozenset of str
        Channels that keep their value until the next row that has one (change of value).
    label : {"left", "right"}, optional
        Whether a stamp begins or ends the interval of its row; None where the format does not say.
    notes : tuple of str
        Sentences on what was found or left out, for the report on the log.
    switches : frozenset of str
        Channels with words such as on and off, which are 1 and 0; a temperature has no value there.
    modes : frozenset of str
        Channels that say whether a thermostat heats (1), cools (-1), does both (2) or is off (0).
    first : Timestamp, optional
        The earliest stamp in the zone in which the source writes it, where the index may be in another one.
    day_first : bool, optional
        Whether dates such as 31/01/2024 begin with the day; None where they are others, or do not tell.
    """

    frame: pd.DataFrame
    format: str
    units: Mapping[str, str] = field(default_factory=dict)
    roles: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    held: frozenset[str] = frozenset()
    label: str | None = None
    notes: tuple[str, ...] = ()
    switches: frozenset[str] = frozenset()
    modes: frozenset[str] = frozenset()
    first: pd.Timestamp | None = None
    day_first: bool | None = None
