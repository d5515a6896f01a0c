"""Back-test of several zones of which the weather and the set-points are known ahead, the heat is not."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import pandas as pd

from .._table import plant_roles
from ..hybrid import BuildingPredictor
from .compared_models import HYBRID, YESTERDAY
from .log_split import setpoints_of
from .setpoints_known import SetpointsKnown, backtest_under_setpoints, unusable_setpoints
from .settings import Settings
from .zone_part import rows_of_zone, settings_of_zone

_OF_ALL = ("origin", "lead", "time", "y_true", "y_pred", "zone")


class ZonesSetpointsKnown(NamedTuple):
    """Forecasts of all zones under their set-points, beside simple rules."""

    whole: SetpointsKnown  # all zones together
    zones: dict[str, SetpointsKnown]

    @classmethod
    def of(
        cls,
        model: BuildingPredictor,
        spans: tuple[pd.DataFrame, pd.DataFrame],
        start: pd.Timestamp,
        yesterday: pd.DataFrame,
        settings: Settings,
        remarks: list[str],
    ) -> Self | None:
        """Back-test a fitted building from a ``start`` in the second of two ``spans`` of rows, training and later.

        None where no zone has set-points and a plant, or zones share a plant; where something is wrong with the
        set-points, a remark says it.
        """
        train, later = spans
        if model.shared_plants_ or not any(_has_thermostat(later, settings, zone) for zone in settings.zones):
            return None
        T = later[settings.roles_of("T_za")]
        frame = backtest_under_setpoints(model, later, T, start, settings, remarks)
        if frame is None:
            return None
        zones, whole = {}, pd.concat([train, later])
        for zone in settings.zones:
            past, before = rows_of_zone(whole, settings, zone), zone_of(yesterday, zone)
            as_usual = bool(plant_roles(past)) and not model.thermostat_learned_[zone]
            given = zone_of(frame, zone), past, before, settings_of_zone(settings, zone)
            zones[zone] = SetpointsKnown.of_backtest(*given, as_usual=as_usual)
        return cls(SetpointsKnown.together(zones, yesterday), zones)

    @property
    def as_usual(self) -> str:
        """The zones whose plant ran as usual, in a sentence; empty where there are none."""
        named = ", ".join(zone for zone, one in self.zones.items() if one.as_usual)
        return f"No thermostat was learned of {named}; their heat is forecast as it usually was." if named else ""

    @property
    def with_zones(self) -> SetpointsKnown:
        """All zones together, with a column of the table for each."""
        errors = {f"rmse_{zone}": one.table["rmse"] for zone, one in self.zones.items()}
        errors |= {f"load_rmse_{zone}": one.table["load_rmse"] for zone, one in self.zones.items() if one.loads}
        table = self.whole.table
        return self.whole._replace(table=table.assign(**pd.DataFrame(errors).reindex(table.index)))

    def as_dict(self) -> dict[str, Any]:
        """Errors and coverage as plain values, of all zones and of each."""
        return self.whole.as_dict() | {"zones": {zone: one.as_dict() for zone, one in self.zones.items()}}


def zones_setpoints_known(held: ZonesSetpointsKnown) -> pd.DataFrame:
    """Errors and coverage of each zone beside the rules, by the names of a table to be read."""
    rows = {}
    for zone, one in held.zones.items():
        rmse, load, unit = one.table["rmse"], one.table["load_rmse"], one.unit if one.loads else ""
        rows[zone] = {
            f"{HYBRID} [K]": rmse[HYBRID],
            f"{YESTERDAY} [K]": rmse[YESTERDAY],
            "in 80 % interval": one.coverage,
        }
        names = {HYBRID: one.load_name} | {name: name for name in one.loads if name != HYBRID}
        rows[zone] |= {f"{shown} [{unit}]": load[name] for name, shown in names.items() if unit}
        if one.load_coverage is not None:
            rows[zone]["load in 80 % interval"] = one.load_coverage
    return pd.DataFrame.from_dict(rows, orient="index", dtype=float)


def zone_of(frame: pd.DataFrame, zone: str) -> pd.DataFrame:
    """The rows of one zone of a back-test, without the columns of the plants of others."""
    own = frame[frame["zone"] == zone].drop(columns="zone").reset_index(drop=True)
    return own[[name for name in own if name in _OF_ALL or own[name].notna().any()]]


def unusable_day(day: pd.DataFrame, settings: Settings) -> str:
    """Why a day cannot be forecast under the set-points of all zones; empty where it can."""
    for zone in settings.zones:
        rows = rows_of_zone(day, settings, zone)
        if plant_roles(rows) and (why_not := unusable_setpoints(rows)):
            return f"zone {zone!r}: {why_not}"
    return ""


def _has_thermostat(rows: pd.DataFrame, settings: Settings, zone: str) -> bool:
    own = rows_of_zone(rows, settings, zone)
    return bool(plant_roles(own)) and not setpoints_of(own).empty
