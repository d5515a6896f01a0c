"""The part of one zone in a building's settings, rows and forecasts, by the names that a single zone has.

The only zone of a study has an empty name, and its part is the whole.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple, Self

import pandas as pd

from .._table import SETPOINT_ROLES, ZoneTable, ending_zone
from ..hybrid.building.zone_columns import ZoneColumns
from ..model_selection.single_reading import read_once, takes_tables
from .log_reading import meters_of
from .log_split import StudyData, without_setpoints
from .settings import Settings

_OF_ALL = ("origin", "lead", "time", "y_true", "y_pred")  # columns that a back-test has of every zone


def each_zone(settings: Settings) -> list[str]:
    """The names of the zones; an empty one where there is one zone."""
    return settings.zones or [""]


class Study(NamedTuple):
    """A study as it goes on."""

    settings: Settings
    data: StudyData
    remarks: list[str]  # to which what is found on the way is added
    tables: tuple[ZoneTable, ...] = ()  # the training rows and those after them as all models share them; of one zone

    @classmethod
    def of(cls, settings: Settings, data: StudyData) -> Self:
        """The study of a log, with the remarks on it."""
        read = () if settings.zones else (read_once(data.train), read_once(data.later, fits=False))
        return cls(settings, data, list(data.remarks), read if all(isinstance(t, ZoneTable) for t in read) else ())

    def rows_for(self, model: Any) -> tuple[Any, Any]:
        """The training rows and those after them, as a model takes them."""
        shared = self.tables and takes_tables(model)
        train, later = self.tables if shared else (self.data.train, self.data.later)
        return train, later

    @property
    def by_zone(self) -> dict[str, Study]:
        """The study of each zone, as if it were alone."""
        return {
            zone: self._replace(
                settings=settings_of_zone(self.settings, zone), data=data_of(self.data, self.settings, zone)
            )
            for zone in each_zone(self.settings)
        }

    @property
    def without_setpoints(self) -> Study:
        """The same for models that learn no thermostat."""
        train, later = map(without_setpoints, (self.data.train, self.data.later))
        kept = ({k: v for k, v in table.inputs.items() if k not in SETPOINT_ROLES} for table in self.tables)
        tables = tuple(table.replace(inputs=inputs) for table, inputs in zip(self.tables, kept, strict=True))
        return self._replace(data=self.data._replace(train=train, later=later), tables=tables)

    @property
    def past(self) -> pd.DataFrame:
        """All rows to the end of the test."""
        return pd.concat([self.data.train, self.data.later])


def predictors_of(model: Any) -> dict[str, Any]:
    """The predictor of each zone by itself in a fitted predictor, by the zone's name."""
    return dict(getattr(model, "own_", {"": model}))


def measured_of(rows: pd.DataFrame, settings: Settings) -> Any:
    """The measured temperature of the zone; of several zones a column for each."""
    return rows[settings.roles_of("T_za")] if settings.zones else rows["T_za"]


def settings_of_zone(settings: Settings, zone: str) -> Settings:
    """The settings of one zone, as if it were alone."""
    if not zone:
        return settings
    roles = roles_of(settings.columns, settings, zone)
    columns = {own: settings.columns[role] for own, role in roles.items()}
    estimator = dict(settings.estimator)
    if "known" in estimator:
        estimator["known"] = _columns_of(settings.columns, settings).known_in_zone(zone, estimator["known"])
    return replace(settings, name=zone, adjacency=None, columns=columns, estimator=estimator)


def rows_of_zone(rows: pd.DataFrame, settings: Settings, zone: str) -> pd.DataFrame:
    """The columns of one zone and those that all share, by the roles that they have for it."""
    roles = roles_of(map(str, rows), settings, zone)
    return rows[list(roles.values())].set_axis(list(roles), axis=1)


def log_columns(wanted: Iterable[str], settings: Settings) -> list[str]:
    """The columns of the log with some roles, of which ``Q_hvac`` may be the sum of two."""
    meters = meters_of(settings.columns, settings.zones)
    roles = [role for one in wanted for role in meters.get(one, [one])]
    return [settings.columns[role] for role in roles if role in settings.columns]


def read_roles(settings: Settings) -> list[str]:
    """The roles of the settings as a model reads them: meters of heat and of cold are one, ``Q_hvac``."""
    meters = meters_of(settings.columns, settings.zones)
    parts = [role for one in meters.values() for role in one]
    return [*(role for role in settings.columns if role not in parts), *meters]


def data_of(data: StudyData, settings: Settings, zone: str) -> StudyData:
    """The spans of a study for one zone."""

    def own(rows: pd.DataFrame) -> pd.DataFrame:
        return rows_of_zone(rows, settings, zone)

    train, later, history, future = map(own, (data.train, data.later, data.history, data.future))
    setpoint = data.setpoint[zone] if zone else data.setpoint
    return data._replace(train=train, later=later, history=history, future=future, setpoint=setpoint)


def forecast_of(found: pd.DataFrame, settings: Settings, zone: str) -> pd.DataFrame:
    """The columns of a frame whose names end with the name of a zone, which is taken off."""
    if not zone:
        return found
    own = [name for name in map(str, found) if ending_zone(name, settings.zones) == zone]
    return found[own].rename(columns=lambda name: str(name).removesuffix(f"_{zone}"))


def zone_of(frame: pd.DataFrame, zone: str) -> pd.DataFrame:
    """The rows of one zone of a back-test, without the columns of the plants of others."""
    if not zone:
        return frame
    own = frame[frame["zone"] == zone].drop(columns="zone").reset_index(drop=True)
    return own[[name for name in own if name in _OF_ALL or own[name].notna().any()]]


def roles_of(roles: Iterable[str], settings: Settings, zone: str) -> dict[str, str]:
    """The building's role of each of a zone's roles."""
    columns = _columns_of(roles, settings)
    return {own: role for own, role in columns.of_zone(zone).items() if role is not None}


def _columns_of(roles: Iterable[str], settings: Settings) -> ZoneColumns:
    return ZoneColumns(tuple(settings.zones), {role: role for role in roles})
