"""Settings of a study, read from TOML and checked."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from .._arguments import check_place, is_integer, is_number
from .._holidays import read_holidays
from .._table import ROLES, SETPOINT_ROLES, is_stage, listed, role_of
from .._time import positive_duration
from ..exceptions import SettingsError
from ..forecasting.weather_error import read_weather_error
from ..hybrid.building.zone_columns import neighbours_of
from ..logs.setpoint_modes import MODE
from ..logs.stamps import time_zone_named
from ..logs.zone_names import zones_of
from ..thermal.declaration import capacity_name
from .keys import check_keys
from .plant_performance import Performance
from .tariff import Tariff
from .thermostat import Schedule

SCHEDULE = "schedule"  # `[forecaster] model` of the default HybridPredictor, the schedule model
#: `[estimator] name` -> class of the identification
ESTIMATORS = {
    "conventional": "GrayBoxRC",
    "input": "InputDisturbanceID",
    "output": "OutputDisturbanceID",
    "periodic": "PeriodicDisturbanceID",
}
_TABLES = (
    "columns", "units", "scale", "log", "network", "estimator", "forecaster", "train", "test", "load", "site", "plant",
    "thermostat", "tariff",
)  # fmt: skip
_SPAN = ("start", "end")
_NETWORK = ("name", "capacitances", "resistors", "solar", "measured", "disturbed", "heated", "bounds")
_SITE = ("latitude", "longitude")


@dataclass(frozen=True)
class Settings:
    """Settings of a study.

    Parameters
    ----------
    name : str, name of the zone, for the report
    timezone : str, optional, local time zone, such as ``"Europe/Amsterdam"``
    label : {"left", "right"}, whether a row is stamped with the start or the end of its step
    time_column, dayfirst, sep, decimal
        Format of stamps and cells, where the log does not show it by itself, as for :func:`skhybrid.logs.read_log`.
    step : str, sampling time to which the log is resampled
    horizon, origin_step : str, how far ahead the back-test forecasts, and the distance of its origins
    random_state : int, seed of the random starts
    holidays : str or list of dates, optional
        A country or state as the ``holidays`` package names it, such as ``"US-IL"``, or dates; for all models with a
        calendar.
    adjacency : list of pairs of zones, optional, which zones exchange heat, where there are several
    weather_error : {"low", "medium", "high"}, optional
        How far forecasts of the weather are off (:class:`skhybrid.forecasting.WeatherError`), which widens the
        intervals of days to come; by default the weather is taken to be right.
    columns : mapping of role to column
        Columns of the log; ``T_za`` and ``T_oa`` are needed.  Of several zones: ``T_za_<zone>`` of each, with its
        plants and set-points, as for :class:`skhybrid.hybrid.BuildingPredictor`.  ``mode`` (or ``mode_<zone>``) says
        which set-points are in force: words such as heat, cool, auto and off, or 1, -1, 2 and 0.  One thermostat that
        heats in winter and cools in summer may have one column for both set-points.
    units : mapping of role to unit, units of columns, where they are not those of the data contract
    scale : mapping of role to number, factors on columns, applied after the units
    network : mapping
        ``name`` of the catalogue, or a declaration as for :class:`skhybrid.thermal.RCNetwork`; by default the
        identifications take 2R2C and the hybrid the network of :class:`skhybrid.hybrid.HybridPredictor`.
    estimator : mapping
        ``name`` of the identification (conventional, input, output, periodic), and parameters of that class.  Of
        several zones, a parameter in ``known`` and ``bounds`` is that of a zone, as ``Q_h_<zone>``, or of all.
    forecaster : mapping
        ``model``: ``"schedule"`` is the default of :class:`~skhybrid.hybrid.HybridPredictor`, which takes from the
        estimator's settings only the capacities in ``known``; with any other model the hybrid is the two-stage scheme,
        and these are parameters of :class:`~skhybrid.forecasting.DisturbanceForecaster`.
    train, test : mapping, ``start`` and ``end`` (a whole day where no time is given)
    load : mapping, ``setpoint``: ``"measured"``, a temperature [degC], or a column of the log
        What the load of the next day holds, where that day is not forecast under its own set-points.
    site : mapping
        ``latitude`` and ``longitude`` [deg]; with them the irradiance on four facades is computed from ``q_sol``, for
        the schedule model and for ARX.
    format : str, optional
        Format of the log, as :func:`skhybrid.logs.read_log` names it; by default found from its content.
    log : mapping
        Options of the reader of that format, such as ``sheet`` of an Excel file or ``table`` of a database.
    plant : mapping
        ``electricity`` (whether the columns of the plant are electricity, not heat), ``cop`` of heating and ``eer`` of
        cooling (a number, or pairs ``[T_oa, value]``; one of them alone counts for both), and what it can deliver:
        ``most_heat`` and ``most_cold`` [kW], of one zone.
    thermostat : mapping
        ``heat`` and ``cool``, the set-points of a day to come [degC]: numbers, or tables of clock time and set-point;
        ``weekend``, a table of those that differ on weekends and holidays.
    tariff : mapping
        ``price`` of a kWh of electricity, or of heat where there is no ``cop``: a number, or a table of clock time and
        price; ``weekend``, that of weekends and holidays, where it differs; ``currency``.
    """

    name: str = "zone"
    timezone: str | None = None
    label: str = "left"
    time_column: str | None = None
    dayfirst: bool | None = None
    sep: str | None = None
    decimal: str | None = None
    step: str = "15min"
    horizon: str = "1D"
    origin_step: str = "1D"
    random_state: int = 0
    holidays: Any = None
    adjacency: Any = None
    weather_error: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    network: Mapping[str, Any] = field(default_factory=dict)
    estimator: Mapping[str, Any] = field(default_factory=lambda: {"name": "periodic"})
    forecaster: Mapping[str, Any] = field(default_factory=lambda: {"model": SCHEDULE})
    train: Mapping[str, Any] = field(default_factory=dict)
    test: Mapping[str, Any] = field(default_factory=dict)
    load: Mapping[str, Any] = field(default_factory=dict)
    site: Mapping[str, float] = field(default_factory=dict)
    format: str | None = None
    log: Mapping[str, Any] = field(default_factory=dict)
    plant: Mapping[str, Any] = field(default_factory=dict)
    thermostat: Mapping[str, Any] = field(default_factory=dict)
    tariff: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_plain(self)
        if self.label not in ("left", "right"):
            raise ValueError(f"label = {self.label!r} must be 'left' or 'right'.")
        for name in ("step", "horizon", "origin_step"):
            _check_duration(name, getattr(self, name))
        check_keys("train", self.train, _SPAN)
        check_keys("test", self.test, _SPAN)
        check_keys("load", self.load, ("setpoint",))
        check_keys("network", self.network, _NETWORK)
        if self.estimator.get("name", "periodic") not in list(ESTIMATORS):  # a TOML list cannot be hashed
            raise ValueError(f"[estimator] name = {self.estimator['name']!r} is not one of {', '.join(ESTIMATORS)}.")
        for role, factor in self.scale.items():
            if not is_number(factor) or not factor:
                raise ValueError(f"[scale] {role} = {factor!r} must be a number other than 0.")
        _check_tables(self)
        check_keys("plant", self.plant, ("electricity", "cop", "eer", "most_heat", "most_cold"))
        Performance.of(self.plant)
        for key in ("most_heat", "most_cold"):
            if key in self.plant and not (is_number(self.plant[key]) and self.plant[key] >= 0):
                raise ValueError(f"[plant] {key} = {self.plant[key]!r} must be a number of at least 0.")
        Schedule.of_tables(self.thermostat)
        Tariff.of(self.tariff)
        _check_site(self.site, self.columns)
        _check_zones(self)
        _check_cold(self)

    @property
    def zones(self) -> list[str]:
        """Names of the zones; empty for one zone, ``T_za``."""
        return zones_of(self.columns)

    def roles_of(self, role: str) -> list[str]:
        """The roles of a quantity that each zone has: ``T_za``, or ``T_za_<zone>`` of several.

        Parameters
        ----------
        role : str, of one zone
        """
        return [f"{role}_{zone}" for zone in self.zones] or [role]

    @property
    def setpoints(self) -> list[str]:
        """Roles of set-points: those of the zones, and ``T_heat_set`` and ``T_cool_set``."""
        return list(dict.fromkeys([*SETPOINT_ROLES, *(own for role in SETPOINT_ROLES for own in self.roles_of(role))]))

    @property
    def capacities(self) -> dict[str, float]:
        """Given capacities of the plant, by parameter."""
        return {name: kw for name, kw in self.estimator.get("known", {}).items() if name.startswith("Q_")}

    @property
    def scaled_roles(self) -> list[str]:
        """Roles of stages with a given capacity, and of meters that are said to be electricity, or not to be."""
        ends = [f"_{zone}" for zone in self.zones]
        stages = {role: [role, *map(role.removesuffix, ends)] for role in self.columns if is_stage(role)}
        known = [role for role, names in stages.items() if any(capacity_name(n) in self.capacities for n in names)]
        return known + [role for role in self.columns if role.startswith("Q_") and "electricity" in self.plant]

    def as_dict(self) -> dict[str, Any]:
        """All settings as plain values."""
        return asdict(self)


def is_scaled(roles: Iterable[object], known: Iterable[str]) -> bool:
    """Whether measured heat or a given parameter fixes what a kW is in a model of these roles.

    ``known`` are given parameters, such as :attr:`Settings.capacities`.
    """
    names = set(map(str, roles))
    capacities = {capacity_name(role) for role in names if is_stage(role)}
    return any(r.startswith("Q_") for r in names) or any(p in capacities or p[0] in "CRA" for p in known)


def read_settings(path: str | PathLike[str]) -> Settings:
    """Read settings from a TOML file.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    FileNotFoundError, skhybrid.exceptions.SettingsError
        If the file does not exist or cannot be used; the message names the file and the key.
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no configuration {str(file)!r}; skhybrid check LOG --config proposes one.")
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{file.name} is not valid TOML ({error}); correct it.") from None
    try:
        return settings_from(content)
    except ValueError as error:
        raise SettingsError(f"{file.name}: {error}") from None


def settings_from(content: Mapping[str, Any]) -> Settings:
    """Settings from the content of a TOML file; a ValueError names a key that is unknown or cannot be used."""
    types = {f.name: f.name in _TABLES for f in fields(Settings)}
    check_keys("", content, tuple(types))
    for key, value in content.items():
        if types[key] != isinstance(value, dict):
            raise ValueError(f"{key} must be {'a table, [' + key + ']' if types[key] else 'a single value'}.")
    given = content.get("columns", {})
    missing = [role for role in ("T_za", "T_oa") if role not in given and not (role == "T_za" and zones_of(given))]
    if missing:
        raise ValueError(f"[columns] does not say which column is {missing[0]}.")
    return Settings(**content)


def _check_plain(settings: Settings) -> None:
    """Check the values outside tables."""
    optional = ("timezone", "time_column", "format", "sep", "decimal")
    for key in ("name", "label", *optional):
        value = getattr(settings, key)
        if not isinstance(value, str) and (value is not None or key not in optional):
            raise ValueError(f"{key} = {value!r} must be text in quotes.")
    if settings.timezone is not None:
        time_zone_named(settings.timezone)  # refuses an unknown one
    for key in ("sep", "decimal"):
        if getattr(settings, key) is not None and len(getattr(settings, key)) != 1:
            raise ValueError(f"{key} = {getattr(settings, key)!r} must be one character.")
    seed = settings.random_state
    if not is_integer(seed) or not 0 <= seed < 2**32:
        raise ValueError(f"random_state = {seed!r} must be an integer from 0 to 4294967295.")
    if not isinstance(settings.dayfirst, bool | None):
        raise ValueError(f"dayfirst = {settings.dayfirst!r} must be true or false.")
    read_weather_error(settings.weather_error)
    read_holidays(settings.holidays, pd.DatetimeIndex(["2000-01-01"]))  # refuses what is neither a place nor dates


def _check_tables(settings: Settings) -> None:
    """Check the values inside tables that the estimators do not check themselves."""
    for table in ("columns", "units"):
        for role, value in getattr(settings, table).items():
            is_mode = table == "columns" and role.partition("_")[0] == MODE
            if role_of(role) is None and not is_mode and (table, role) != ("units", "setpoint"):
                raise ValueError(f"[{table}] {role} is not a role; roles are {', '.join(name for name, *_ in ROLES)}.")
            if not isinstance(value, str):
                raise ValueError(f"[{table}] {role} = {value!r} must be text in quotes.")
    role_of_column: dict[str, str] = {}
    for role in ("T_oa", *settings.roles_of("T_za")):
        column = settings.columns.get(role)
        if column is not None and (other := role_of_column.setdefault(column, role)) != role:
            raise ValueError(f"[columns] {other} and {role} are both {column!r}; give each a column of its own.")
    n_starts = settings.estimator.get("n_starts", 1)
    if not is_integer(n_starts) or n_starts < 1:
        raise ValueError(f"[estimator] n_starts = {n_starts!r} must be an integer of at least 1.")
    for name, value in _inner_table(settings.estimator, "estimator", "known").items():
        if not is_number(value):
            raise ValueError(f"[estimator] known: {name} = {value!r} must be a number.")
    for name, value in _inner_table(settings.estimator, "estimator", "bounds").items():
        if not isinstance(value, list | tuple) or len(value) != 2 or not all(map(is_number, value)):
            raise ValueError(f"[estimator] bounds: {name} = {value!r} must be two numbers, [lower, upper].")
    for key in ("capacitances", "resistors", "solar"):
        _inner_table(settings.network, "network", key)
    held = settings.load.get("setpoint", "measured")
    if not isinstance(held, str) and not (is_number(held) and 0 <= held <= 45):
        raise ValueError(f"[load] setpoint = {held!r} must be a temperature [degC], 'measured' or a column in quotes.")


def _check_site(site: Mapping[str, Any], columns: Mapping[str, str]) -> None:
    check_keys("site", site, _SITE)
    if not site:
        return
    for key in _SITE:
        if key not in site:
            raise ValueError(f"[site] does not say {key}.")
    check_place(site["latitude"], site["longitude"], "[site]")
    if "q_sol" not in columns:
        raise ValueError("[site] needs the irradiance on the horizontal, q_sol, in [columns].")


def _check_zones(settings: Settings) -> None:
    """Refuse what a building of several zones does not have, and what only it has."""
    zones, pairs = settings.zones, settings.adjacency
    if pairs is not None and not zones:
        raise ValueError("adjacency is of several zones, T_za_<zone> in [columns], but there is one, T_za; remove it.")
    if pairs is not None and not (
        isinstance(pairs, list | tuple) and all(isinstance(p, list | tuple) and len(p) == 2 for p in pairs)
    ):
        raise ValueError(f'adjacency = {pairs!r} must be a list of pairs of zones, such as [["kitchen", "hall"]].')
    neighbours_of(zones, pairs or ())
    of_one = next((key for key in ("most_heat", "most_cold") if zones and key in settings.plant), None)
    if of_one:
        raise ValueError(
            f"[plant] {of_one} is of one zone, but [columns] has {listed(zones)}; remove it, and give the limits of "
            "zones in Python: BuildingPredictor.predict_load(limits=)."
        )


def _check_cold(settings: Settings) -> None:
    """Refuse a meter of cold beside the whole heat of a plant: it would count as heat."""
    for end in ("", *(f"_{zone}" for zone in settings.zones)):
        whole, cold = f"Q_hvac{end}", f"Q_cool{end}"
        if {whole, cold} <= set(settings.columns) and cold.removeprefix("Q_") not in settings.zones:
            raise ValueError(
                f"[columns] has {whole} and {cold}, and a model reads one heat of a plant; give meters of both sides "
                f"as Q_heat{end} and {cold}, or {whole} alone, negative where it cools."
            )


def _inner_table(table: Mapping[str, Any], name: str, key: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise ValueError(f"[{name}] {key} = {value!r} must be a table, such as {{ name = value }}.")
    return value


def _check_duration(name: str, value: Any) -> None:
    with suppress(ValueError):
        if isinstance(value, str) and positive_duration(value, name):
            return
    raise ValueError(f"{name} = {value!r} is not a duration such as '15min' or '1D'.")


def as_toml(value: Any) -> str:
    """A value as TOML."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value)
