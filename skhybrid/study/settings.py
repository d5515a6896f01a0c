"""Settings of a study: read from TOML, checked, and proposed from a log's columns."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

#: name in the TOML -> class that identifies.
ESTIMATORS = {
    "conventional": "GrayBoxRC",
    "input": "InputDisturbanceID",
    "output": "OutputDisturbanceID",
    "periodic": "PeriodicDisturbanceID",
}
_TABLES = ("columns", "units", "scale", "network", "estimator", "forecaster", "train", "test", "load")
_SPAN = ("start", "end")
_NETWORK = ("name", "capacitances", "resistors", "solar", "measured", "disturbed", "heated", "bounds")


@dataclass(frozen=True)
class Settings:
    """Settings of a study.

    Parameters
    ----------
    name : str
        Of the zone, for the report.
    timezone : str, optional
        Local time zone, such as ``"Europe/Amsterdam"``.
    label : {"left", "right"}
        Whether a row is stamped with the start or the end of its step.
    step : str
        Sampling time that the log is brought to.
    horizon, origin_step : str
        How far ahead is forecast in the back-test, and the distance of its origins.
    random_state : int
        Seed of the random starts.
    columns : mapping of role to column
        Columns of the log; ``T_za`` and ``T_oa`` are needed.
    units : mapping of role to unit
        Units of columns that are not those of the data contract.
    scale : mapping of role to number
        Factors on columns, after the units.
    network : mapping
        ``name`` of the catalogue, or a declaration as :class:`skhybrid.thermal.RCNetwork` takes it.
    estimator : mapping
        ``name`` (conventional, input, output, periodic) and settings of that class.
    forecaster : mapping
        Settings of :class:`skhybrid.forecasting.DisturbanceForecaster`.
    train, test : mapping
        ``start`` and ``end`` (a whole day where no time is given).
    load : mapping
        ``setpoint``: ``"measured"``, a temperature [degC], or a column of the log.
    """

    name: str = "zone"
    timezone: str | None = None
    label: str = "left"
    step: str = "15min"
    horizon: str = "1D"
    origin_step: str = "1D"
    random_state: int = 0
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    network: Mapping[str, Any] = field(default_factory=lambda: {"name": "2R2C"})
    estimator: Mapping[str, Any] = field(default_factory=lambda: {"name": "periodic"})
    forecaster: Mapping[str, Any] = field(default_factory=lambda: {"model": "ridge"})
    train: Mapping[str, Any] = field(default_factory=dict)
    test: Mapping[str, Any] = field(default_factory=dict)
    load: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.label not in ("left", "right"):
            raise ValueError(f"label = {self.label!r} must be 'left' or 'right'.")
        for name in ("step", "horizon", "origin_step"):
            _check_duration(name, getattr(self, name))
        _check_keys("train", self.train, _SPAN)
        _check_keys("test", self.test, _SPAN)
        _check_keys("load", self.load, ("setpoint",))
        _check_keys("network", self.network, _NETWORK)
        if self.estimator.get("name", "periodic") not in ESTIMATORS:
            raise ValueError(f"[estimator] name = {self.estimator['name']!r} is none of {', '.join(ESTIMATORS)}.")
        for role, factor in self.scale.items():
            if isinstance(factor, bool) or not isinstance(factor, int | float) or not factor:
                raise ValueError(f"[scale] {role} = {factor!r} must be a number other than 0.")

    def as_dict(self) -> dict[str, Any]:
        """All settings as plain values, for ``metrics.json``."""
        return asdict(self)


def read_settings(path: str | PathLike[str]) -> Settings:
    """Read settings from a TOML file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Settings

    Raises
    ------
    FileNotFoundError, ValueError
        In one sentence that names the file and the key.
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no configuration {str(file)!r}.")
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{file.name} is not valid TOML: {error}.") from None
    try:
        return settings_from(content)
    except ValueError as error:
        raise ValueError(f"{file.name}: {error}") from None


def settings_from(content: Mapping[str, Any]) -> Settings:
    """Settings from what a TOML file holds.

    Parameters
    ----------
    content : mapping
        Keys as the fields of :class:`Settings`.

    Returns
    -------
    Settings

    Raises
    ------
    ValueError
        If a key is unknown or a value cannot be used.
    """
    types = {f.name: f.name in _TABLES for f in fields(Settings)}
    _check_keys("", content, tuple(types))
    for key, value in content.items():
        if types[key] != isinstance(value, dict):
            raise ValueError(f"{key} must be {'a table, [' + key + ']' if types[key] else 'a single value'}.")
    missing = [role for role in ("T_za", "T_oa") if role not in content.get("columns", {})]
    if missing:
        raise ValueError(f"[columns] does not say which column is {missing[0]}.")
    return Settings(**content)


def _check_keys(table: str, given: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in given:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}."
            raise ValueError(f"unknown key {key!r}{f' in [{table}]' if table else ''}; {hint}")


def _check_duration(name: str, value: Any) -> None:
    try:
        positive = isinstance(value, str) and pd.Timedelta(value) > pd.Timedelta(0)
    except ValueError:
        positive = False
    if not positive:
        raise ValueError(f"{name} = {value!r} is not a duration such as '15min' or '1D'.")


# ----------------------------------------------------------------------------------------------------------- proposal
#: role -> pattern of column names that suggest it, in order of trust.
_HINTS: tuple[tuple[str, str], ...] = (
    ("T_za", r"^t_?(za|zone|in|indoor|room|air_in)\b|^t_in|^t_za|indoor|room|zone_?temp|inside|thermostat|binnen"),
    ("T_oa", r"^t_?(oa|out|outdoor|amb|ext)\b|^t_out|^t_oa|outdoor|outside|ambient|exterior|dry_?bulb|buiten"),
    ("q_sol", r"^q_sol$|\bghi|^ghi|global_?hor|solar|irradi|radiation"),
    ("Q_hvac", r"^q_hvac|hvac.*kw|heat.*_kw$|thermal_?power|delivered"),
    ("u_heat", r"^u_heat|heat_?cmd|heat.*(stage|cmd|run|valve|duty)|(stage|cmd|run|valve|duty).*heat|boiler|furnace"),
    ("u_cool", r"^u_cool|cool_?cmd|cool.*(stage|cmd|run|valve|duty)|(stage|cmd|run|valve|duty).*cool|compressor"),
)
_NEVER = re.compile(r"set|truth|humid|target", re.IGNORECASE)


def propose_settings(log: str | PathLike[str]) -> str:
    """Propose a configuration from the columns of a log.

    Parameters
    ----------
    log : path-like
        CSV file with one header line.

    Returns
    -------
    str
        TOML, with comments on what to check.

    Raises
    ------
    FileNotFoundError, ValueError
        If the log cannot be read, or no column looks like the room and the outdoor temperature.
    """
    file = Path(log)
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}.")
    try:
        table = pd.read_csv(file)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{file.name} cannot be read as CSV ({error}).") from None
    chosen = _guess_columns(table)
    for role, what in (("T_za", "room"), ("T_oa", "outdoor")):
        if role not in chosen:
            shown = ", ".join(map(repr, table.columns))
            raise ValueError(f"no column of {file.name} looks like the {what} temperature ({shown}).")
    stamps = _guess_stamps(table, file.name)
    return _proposal(file, chosen, _guess_units(table, chosen), _guess_scale(table, chosen), stamps)


def _guess_columns(table: pd.DataFrame) -> dict[str, str]:
    numeric = [c for c in table.columns if pd.api.types.is_numeric_dtype(table[c]) and not _NEVER.search(c)]
    chosen: dict[str, str] = {}
    for role, pattern in _HINTS:
        for column in numeric:
            if column not in chosen.values() and re.search(pattern, column, re.IGNORECASE):
                chosen[role] = column
                break
    if "Q_hvac" in chosen:  # measured heat makes the stages that delivered it superfluous
        chosen.pop("u_heat", None)
        chosen.pop("u_cool", None)
    return chosen


def _guess_units(table: pd.DataFrame, chosen: Mapping[str, str]) -> dict[str, str]:
    units = {}
    for role, column in chosen.items():
        values = table[column].dropna()
        if role.startswith("T_") and (re.search(r"deg_?f|_f$|fahr", column, re.IGNORECASE) or values.median() > 45):
            units[role] = "degF"
        elif role == "q_sol" and values.max() > 2.0:
            units[role] = "W/m2"
        elif role.startswith("Q_") and values.abs().max() > 2000:
            units[role] = "W"
    return units


def _guess_scale(table: pd.DataFrame, chosen: Mapping[str, str]) -> dict[str, float]:
    """Factors that bring a command to a stage between 0 and 1."""
    top = {r: float(table[c].max()) for r, c in chosen.items() if r.startswith("u_")}
    return {role: round(1.0 / highest, 6) for role, highest in top.items() if highest > 1.5}


def _guess_stamps(table: pd.DataFrame, name: str) -> tuple[pd.DatetimeIndex, str | None]:
    """Stamps and, where they bear an offset, a time zone."""
    for column in table.columns:
        if pd.api.types.is_numeric_dtype(table[column]):
            continue
        text = table[column].astype(str)
        parsed = pd.to_datetime(text, errors="coerce", utc=True, format="ISO8601")
        if parsed.notna().mean() > 0.99:
            found = pd.DatetimeIndex(parsed.dropna()).sort_values()
            return found, _guess_zone(text)
    raise ValueError(f"no column of {name} holds time stamps such as 2021-10-25T00:15:00.")


def _guess_zone(stamps: pd.Series) -> str | None:
    """The one offset that all stamps bear, UTC if it changes with the season, None if there is none."""
    offsets = stamps.str.extract(r"(Z|[+-]\d\d:?\d\d)$")[0].unique()
    if pd.isna(offsets[0]):
        return None
    only = offsets[0] if len(offsets) == 1 and offsets[0] != "Z" else "+00:00"
    return "UTC" if only in ("+00:00", "+0000") else str(only)


def _proposal(
    file: Path,
    chosen: Mapping[str, str],
    units: Mapping[str, str],
    scale: Mapping[str, float],
    stamps: tuple[pd.DatetimeIndex, str | None],
) -> str:
    index, zone = stamps
    step = pd.Timedelta((index[1:] - index[:-1]).to_series().median())
    last = index[-1].normalize()
    days = max((last - index[0].normalize()).days, 3)
    local = index[0] if zone is None else index[0].tz_convert(zone)
    label = "right" if local - local.normalize() == step else "left"  # a day that begins one step late
    n_test = max(min(days // 3, 28), 1)
    n_train = min(days - n_test, 42)
    test, train = last - pd.Timedelta(days=n_test), last - pd.Timedelta(days=n_test + n_train)
    lines = [
        f"# Proposed for {file.name}; check every line.",
        f"name = {_quoted(file.stem)}",
        f'timezone = {_quoted(zone or "UTC")}  # better the local zone, such as "Europe/Amsterdam"',
        f'label = "{label}"  # whether a row is stamped with the start (left) or end (right) of what its means cover',
        f'step = "{step.total_seconds() / 60:g}min"',
        'origin_step = "1D"  # a forecast from every local midnight of the test span',
        "",
        "[columns]",
        *[f"{role} = {_quoted(column)}" for role, column in chosen.items()],
    ]
    if not any(r.startswith(("u_", "Q_")) for r in chosen):
        lines.append(
            '# u_heat = "..."  # no column looks like heating or cooling: add a stage (u_heat) or heat [kW] (Q_hvac)'
        )
    for title, table in (("units", units), ("scale", scale)):
        if table:
            lines += ["", f"[{title}]", *[f"{k} = {_quoted(v)}" for k, v in table.items()]]
    lines += ["", "[network]", 'name = "2R2C"', "", "[estimator]", 'name = "periodic"']
    for role, parameter in (("u_heat", "Q_h"), ("u_cool", "Q_c")):
        if role in chosen:
            lines.append(f"# known = {{ {parameter} = 6.0 }}  # nameplate capacity [kW]: without it no kW is certain")
            break
    lines += ["", "[forecaster]", 'model = "ridge"']
    day = pd.Timedelta("1D")
    lines += ["", "[train]", f"start = {train:%Y-%m-%d}", f"end = {test - day:%Y-%m-%d}"]
    lines += ["", "[test]", f"start = {test:%Y-%m-%d}", f"end = {last - day:%Y-%m-%d}"]
    lines += ["", "[load]", 'setpoint = "measured"  # or a temperature [degC]']
    return "\n".join(lines) + "\n"


def _quoted(value: Any) -> str:
    if not isinstance(value, str):
        return str(value)
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
