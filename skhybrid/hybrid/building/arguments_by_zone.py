"""Temperatures, set-points and limits that are given by zone, or one for all zones of a building."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..._table import as_numbers, is_plant, listed
from .building_tables import BuildingTablesMixin
from .zone_columns import MEASURED, setpoints_by_zone


class ArgumentsByZoneMixin(BuildingTablesMixin):
    """Reading of arguments of :class:`BuildingPredictor` that each zone has of its own."""

    @property
    def shared_plants_(self) -> list[str]:
        """Columns of stages and heat of plants that serve several zones."""
        check_is_fitted(self)
        shared = [role for role in self._columns.columns if is_plant(role) and self._columns.owner(role) is None]
        return [str(self._columns.columns[role]) for role in shared if len(self.zones_) > 1]

    def _refuse_shared_plants(self) -> None:
        if self.shared_plants_:
            raise ValueError(
                f"column {self.shared_plants_[0]!r} is of a plant that several zones share, which cannot hold the "
                "set-points of each; give its stages or heat ahead to forecast, or plan them with affine_forecast and "
                "an optimiser."
            )

    def _now_by_zone(self, T_za: Any) -> dict[str, float]:
        """Temperatures that are measured now, given by zone or in the order of zones; empty where there are none."""
        if T_za is None:
            return {}
        if not isinstance(T_za, Mapping | pd.Series):
            values = np.atleast_1d(as_numbers(T_za, "T_za"))
            if len(values) != len(self.zones_):
                raise ValueError(f"T_za has {len(values)} values; give one for each of {listed(self.zones_)}.")
            return dict(zip(self.zones_, values, strict=True))
        by_zone = self._by_zone(T_za, "T_za")
        absent = [zone for zone in self.zones_ if zone not in by_zone]
        if absent:
            raise ValueError(f"T_za lacks the zone {absent[0]!r}; the zones are {listed(self.zones_)}.")
        return by_zone

    def _setpoints_by_zone(self, setpoint: Any) -> dict[str, Any]:
        """The set-points of each zone, where some are given; a zone that they leave out is free."""
        if setpoint is None:
            return {}
        setpoint = setpoints_by_zone(setpoint)
        names = setpoint.columns if isinstance(setpoint, pd.DataFrame) else ()
        by_column = {str(name).removeprefix(MEASURED) for name in names}
        if not isinstance(setpoint, Mapping) and not (by_column and by_column <= set(self.zones_)):
            self._refuse_without_plant("setpoint")
            return dict.fromkeys(self.zones_, setpoint)
        by_zone = self._by_zone(setpoint, "setpoint")
        self._refuse_without_plant("setpoint", by_zone)
        return dict.fromkeys(self.zones_, (None, None)) | by_zone

    def _limits_by_zone(self, limits: Any) -> dict[str, Any]:
        """Limits of the plant of each zone, where some are given; a zone that they leave out is not limited."""
        if limits is None:
            return {}
        by_zone = self._by_zone(limits, "limits") if isinstance(limits, Mapping) else {}
        self._refuse_without_plant("limits", by_zone)
        return by_zone if isinstance(limits, Mapping) else dict.fromkeys(self.zones_, limits)

    def _by_zone(self, given: Mapping[Any, Any] | pd.Series | pd.DataFrame, name: str) -> dict[str, Any]:
        """Values that are given for some zones, by zone; a name of none is refused."""
        by_zone = {str(zone).removeprefix(MEASURED): value for zone, value in given.items()}
        unknown = [zone for zone in by_zone if zone not in self.zones_]
        if unknown:
            raise ValueError(f"{name} names {unknown[0]!r}, which is not a zone; the zones are {listed(self.zones_)}.")
        return by_zone

    def _refuse_without_plant(self, name: str, zones: Iterable[str] = ()) -> None:
        """Refuse a set-point or limits of zones without a plant, or where no zone has one."""
        heated = [zone for zone, model in self.own_.items() if model._plant]
        wrong = [zone for zone in zones if zone not in heated]
        if wrong:
            raise ValueError(
                f"{name} names {wrong[0]!r}, which had no heating or cooling in training; name {listed(heated)} only."
            )
        if not heated:
            raise ValueError(f"no zone had heating or cooling in training, so that {name} does nothing; leave it out.")
