"""Roles, units and scales of a log's columns: as given, by their names, or guessed from their values."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import pandas as pd

from .._table import SETPOINT_ROLES, is_stage
from .assumed_units import assumed_unit, outdoor_as_room, reread_values
from .conversion import Channel, contract_unit, fitting_unit, to_roles
from .counters import is_counter
from .fill_values import fill_values
from .log_findings import Finding
from .naming import FOR_HEATING, NAMED_BY_ROLE, TAKEN, Guess, guess_role, unit_in_name
from .raw_log import RawLog
from .setpoint_modes import MODE, further_roles, one_role_each, shared_zones
from .unit_names import ENERGY
from .zone_names import assign_zone_roles, further_rooms, guess_in_zone, zone_guesses, zone_roles, zones_of


class ColumnRoles:
    """The roles, units and scales of a log's columns: as given, else as the columns of ``raw``, in time order, show.

    ``scaled`` are the roles of stages whose capacity is known, and of meters that are known to be heat or electricity.

    Attributes
    ----------
    channels : list of Channel, one for each role
    guesses : dict of Guess, by column
    assumed : dict of str, why the unit or scale of a role is what its values suggest
    zones : list of str, the rooms of a log with several; empty for one
    further_rooms : list of str, columns of rooms beside the one that is taken
    one_for_both : dict of Finding, by column: set-points that are, or may be, for heating and cooling
    """

    def __init__(
        self,
        raw: RawLog,
        columns: Mapping[str, str],
        units: Mapping[str, str],
        scale: Mapping[str, float],
        scaled: set[str],
    ) -> None:
        self.raw, self._scaled = raw, scaled
        self.assumed: dict[str, str] = {}
        self.one_for_both: dict[str, Finding] = {}
        given = {**raw.roles, **columns}
        stated = {
            str(c): raw.units.get(str(c), unit_in_name(str(c)))
            for c in raw.frame
            if c not in raw.modes or c in given.values()
        }
        blank = {c for c, unit in stated.items() if c not in given.values() and self._is_blank_input(c, unit)}
        rooms = {} if given else {role: c for role, c in zone_roles(stated).items() if c not in blank}
        stated = {c: unit for c, unit in stated.items() if c not in blank}
        own = [one_role_each(one) for one in (columns, raw.roles)]
        guesses = zone_guesses(stated, rooms) if rooms else assign_zone_roles(stated, *own)
        self.guesses = reread_values(guesses, stated, raw.frame)
        self.zones = zones_of(columns or rooms)
        channels = [
            self._channel(name, guess, stated[name], units, scale)
            for name, guess in self.guesses.items()
            if guess.role is not None
        ]
        self.guesses |= {c: Guess(None, 0, "no row has a number") for c in raw.frame if c in blank}
        self.further_rooms = [] if given or rooms else further_rooms(stated, {c.role: c.name for c in channels})
        channels = self._of_known_scale(channels, set(given))
        by_name = {c.role for c in channels if self.guesses[c.name].reason == NAMED_BY_ROLE}
        channels, why = outdoor_as_room(channels, raw.frame, self.assumed, by_name)
        self.assumed |= {"T_oa": why} if why else {}
        self.channels = self._with_modes(channels, given)

    @property
    def rooms(self) -> list[str]:
        """The roles of the temperatures of the rooms."""
        return [f"T_za_{zone}" for zone in self.zones] or ["T_za"]

    def table(self) -> pd.DataFrame:
        """Role, unit, scale and reason of each column, and whether the unit or the scale is assumed."""
        rows = {}
        for name, guess in self.guesses.items():
            own = [c for c in self.channels if c.name == name]
            c = own[0] if own else None
            why = "" if c is None else self.assumed.get(c.role, "")
            rows[name] = {
                "role": ", ".join(one.role for one in own) or None,
                "unit": None if c is None else (c.unit or contract_unit(c.role)),
                "scale": None if c is None else c.scale,
                "assumed": bool(why),
                "reason": guess.reason + (f"; {why}" if why else ""),
            }
        names = ["role", "unit", "scale", "assumed", "reason"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=names).rename_axis("column")

    def taken(self) -> dict[str, str]:
        """The roles of columns that are not used since others were taken for them."""
        guesses = () if self.raw.roles else self.guesses.items()
        taken = [name for name, guess in guesses if guess.role is None and guess.reason.endswith(TAKEN)]
        units = {name: self.raw.units.get(name, unit_in_name(name)) for name in taken}
        found = {name: guess_in_zone(name, unit, self.zones) for name, unit in units.items()}
        sure = {guess.role: guess.certainty for _, guess in guesses}
        alike = {n: g for n, g in found.items() if not g.is_electricity and g.certainty >= sure.get(g.role, 0)}
        return {name: str(guess.role) for name, guess in alike.items()}

    def is_unsure(self, channel: Channel) -> bool:
        """Whether the heat of a channel may be electricity, or its scale is not known."""
        return self.seems_electric(channel) or "scale" in self.assumed.get(channel.role, "")

    def seems_electric(self, channel: Channel) -> bool:
        """Whether a channel seems to be electricity and is not known to be anything else."""
        return self.guesses[channel.name].is_electricity and channel.role not in self._scaled

    def _is_blank_input(self, name: str, unit: str | None) -> bool:
        """Whether a column may have a role, other than a model's temperatures, but has no value in this log."""
        return bool(self.raw.frame[name].isna().all()) and guess_role(name, unit).role not in (None, "T_za", "T_oa")

    def _channel(
        self, name: str, guess: Guess, stated: str | None, units: Mapping[str, str], scale: Mapping[str, float]
    ) -> Channel:
        """The channel of a role, with the unit that is given or stated, or that its values suggest."""
        role = str(guess.role)
        unit, factor = units.get(role, fitting_unit(stated, role)), scale.get(role, self.raw.scale.get(name, 1.0))
        if unit is None:
            series = self.raw.frame[name]
            values = series.mask(fill_values(series, role, is_counter(series)))
            unit, factor, why = assumed_unit(values, role, factor, guess.reason == NAMED_BY_ROLE)
            self.assumed |= {role: why} if why else {}
        if unit in ENERGY and role not in units and role.startswith("Q_") and is_counter(self.raw.frame[name]):
            unit = f"{unit} counter"
        return Channel(role, name, unit, factor)

    def _of_known_scale(self, channels: list[Channel], given: set[str]) -> list[Channel]:
        """The channels without switches as heat, and stages of no known scale, that only a name suggests."""
        kept = []
        for c in channels:
            is_switch = c.name in self.raw.switches and self.raw.frame[c.name].dropna().isin((0.0, 1.0)).all()
            if c.role.startswith("Q_") and is_switch and c.role not in given:
                self.assumed.pop(c.role, None)
                self.guesses[c.name] = Guess(None, 0, "it is on or off; give u_heat or u_cool if it is the plant's")
            elif is_stage(c.role) and c.unit is None and c.role in self.assumed and c.role not in given:
                self.guesses[c.name] = Guess(None, 0, self.assumed.pop(c.role))
            else:
                kept.append(c)
        return kept

    def _with_modes(self, channels: list[Channel], given: Mapping[str, str]) -> list[Channel]:
        """The channels with those of modes, and with cooling set-points that are those of heating too."""
        heat, cool = SETPOINT_ROLES
        found = {cool + zone: given[cool + zone] for zone in shared_zones(given)}
        if not given:
            frame, modes = cache(lambda: to_roles(self.raw, channels)), self.raw.frame[sorted(self.raw.modes)]
            found, reasons, doubts = further_roles({c.role: c.name for c in channels}, frame, modes)
            self.one_for_both = {name: Finding("warning", name, text) for name, text in doubts.items()}
            for name, why in reasons.items():
                reason = self.guesses[name].reason.removesuffix(FOR_HEATING).rstrip(", ")
                self.guesses[name] = self.guesses[name]._replace(reason=f"{reason}; {why}")
                self.one_for_both[name] = Finding("note", name, f"is one set-point for heating and cooling; {why}.")
        for name in self.raw.modes.difference(self.guesses):
            self.guesses[name] = Guess(None, 0, "it says when a thermostat heats and cools")
        by_role = {c.role: c for c in channels}
        twins = [by_role[role.replace(cool, heat)]._replace(role=role) for role in found if role.startswith(cool)]
        return [*channels, *twins, *(Channel(role, name) for role, name in found.items() if role.startswith(MODE))]
