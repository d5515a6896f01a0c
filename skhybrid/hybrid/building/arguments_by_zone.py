"""Temperatures, set-points and limits that are given by zone, or one for all zones of a building."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..._arguments import row_of
from ..._table import as_numbers, listed
from ..._warnings import several
from .zone_columns import MEASURED, setpoints_by_zone

#: of a zone without a plant, or one that is left out: ``is`` tells the latter from a zone that was given (None, None)
NO_SETPOINTS = (None, None)


@dataclass(frozen=True)
class ArgumentsByZone:
    """Arguments of the zones of a building, some of which have a plant."""

    zones: Sequence[str]
    heated: Sequence[str]  # that were heated or cooled in training

    def now(self, T_za: Any) -> dict[str, float]:
        """Temperatures that are measured now, given by zone or in the order of zones, without zones that have none."""
        if T_za is None:
            return {}
        T_za = row_of(T_za)  # of a log
        if isinstance(T_za, Mapping | pd.Series):
            by_zone = self._by_zone(T_za, "T_za")
        else:
            values = np.atleast_1d(as_numbers(T_za, "T_za"))
            if len(values) != len(self.zones):
                found = several(len(values), "value")
                raise ValueError(f"T_za has {found}; give one for each of {listed(self.zones)}.")
            by_zone = dict(zip(self.zones, values, strict=True))
        known = {zone: T for zone, T in by_zone.items() if not (isinstance(T, float | None) and pd.isna(T))}
        if not known:
            raise ValueError(
                f"T_za has no temperature of any zone; the zones are {listed(self.zones)}: give those that are "
                "measured, or leave T_za out, so that the forecast begins at the last known row."
            )
        return known

    def setpoints(self, setpoint: Any) -> dict[str, Any]:
        """The set-points of each zone, where some are given; a zone that they leave out is free."""
        if setpoint is None:
            return {}
        setpoint = setpoints_by_zone(setpoint)
        names = setpoint.columns if isinstance(setpoint, pd.DataFrame) else ()
        by_column = {str(name).removeprefix(MEASURED) for name in names}
        if not isinstance(setpoint, Mapping) and not (by_column and by_column <= set(self.zones)):
            self.refuse_without_plant("setpoint")
            return dict.fromkeys(self.zones, setpoint)
        by_zone = self._by_zone(setpoint, "setpoint")
        self.refuse_without_plant("setpoint", by_zone)
        return dict.fromkeys(self.zones, NO_SETPOINTS) | by_zone

    def limits(self, limits: Any) -> dict[str, Any]:
        """Limits of the plant of each zone, where some are given; a zone that they leave out is not limited."""
        if limits is None:
            return {}
        by_zone = self._by_zone(limits, "limits") if isinstance(limits, Mapping) else {}
        self.refuse_without_plant("limits", by_zone)
        return by_zone if isinstance(limits, Mapping) else dict.fromkeys(self.zones, limits)

    def _by_zone(self, given: Mapping[Any, Any] | pd.Series | pd.DataFrame, name: str) -> dict[str, Any]:
        """Values that are given for some zones, by zone; a name of none is refused."""
        by_zone = {str(zone).removeprefix(MEASURED): value for zone, value in given.items()}
        unknown = [zone for zone in by_zone if zone not in self.zones]
        if unknown:
            raise ValueError(f"{name} names {unknown[0]!r}, which is not a zone; the zones are {listed(self.zones)}.")
        return by_zone

    def refuse_without_plant(self, name: str, zones: Iterable[str] = ()) -> None:
        """Refuse a set-point or limits of zones without a plant, or where no zone has one."""
        wrong = [zone for zone in zones if zone not in self.heated]
        if wrong:
            raise ValueError(
                f"{name} names {wrong[0]!r}, which had no heating or cooling in training; name {listed(self.heated)} "
                "only."
            )
        if not self.heated:
            raise ValueError(f"no zone had heating or cooling in training, so that {name} does nothing; leave it out.")
