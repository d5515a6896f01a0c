"""Logs without what no model reads, and without the heat of rooms that is logged no more: the others go on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from .._table import is_instant, is_plant, listed
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from ..hybrid.parts import is_read
from ..study.compared_models import make_network
from ..study.settings import Settings
from ..study.unread_rows import BRIDGED
from ..study.zone_part import log_columns, read_roles, roles_of
from .complete_rows import up_to_measured


def without_dead_meters(frame: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """The log of :func:`part_without_dead_meters`, with a warning for each of its remarks."""
    alive, remarks = part_without_dead_meters(frame, settings)
    for remark in remarks:
        warn_user(remark, SkhybridWarning)
    return alive


def part_without_dead_meters(frame: pd.DataFrame, settings: Settings) -> tuple[pd.DataFrame, list[str]]:
    """A log without the heat of rooms that ends more than twelve hours before the temperatures, and remarks on it."""
    dead = dead_meters(frame, settings)
    named = {zone: listed(log_columns(roles, settings) or roles) for zone, roles in dead.items()}
    remarks = [
        f"zone {zone!r} is learned without its heat, since {names} had no values at the end: its "
        "temperature is forecast as if it were heated and cooled as usual, and its load is not known."
        for zone, names in named.items()
    ]
    return without_roles(without_further_temperatures(frame, settings), dead), remarks


def without_further_temperatures(frame: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """A log without further temperatures than those that the network of the settings names."""
    network, measured = make_network(settings.network), settings.roles_of("T_za")
    further = [role for role in map(str, frame) if is_instant(role) and role not in measured]
    return frame.drop(columns=[role for role in further if not is_read(role, network)])


def without_roles(frame: pd.DataFrame, by_zone: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """A log without some roles of its zones."""
    return frame.drop(columns=[role for roles in by_zone.values() for role in roles], errors="ignore")


def dead_meters(frame: pd.DataFrame, settings: Settings) -> dict[str, list[str]]:
    """Roles of heat that end more than twelve hours before the temperatures, by zone; none where all of them do."""
    rows = up_to_measured(frame, settings.roles_of("T_za"))
    own = {zone: _own_plant(map(str, rows), settings, zone) for zone in settings.zones}
    found = {zone: [role for role in roles if _ends_early(rows[role])] for zone, roles in own.items()}
    if [roles for roles in found.values() if roles] == [roles for roles in own.values() if roles]:
        return {}
    return {zone: roles for zone, roles in found.items() if roles}


def not_learned(settings: Settings, learned: Any) -> dict[str, list[str]]:
    """Roles of heat by the settings that are not among those ``learned``, by zone."""
    own = {zone: _own_plant(read_roles(settings), settings, zone) for zone in settings.zones}
    found = {zone: [role for role in roles if role not in learned] for zone, roles in own.items()}
    return {zone: roles for zone, roles in found.items() if roles}


def _own_plant(roles: Any, settings: Settings, zone: str) -> list[str]:
    """Roles of heat that a zone has for itself."""
    return [role for own, role in roles_of(roles, settings, zone).items() if is_plant(own) and own != role]


def _ends_early(values: pd.Series) -> bool:
    last = values.last_valid_index()
    return bool(len(values)) and (last is None or values.index[-1] - last > BRIDGED)
