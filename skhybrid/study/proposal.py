"""A proposal for the settings of a study, made from the columns of a log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .._table import listed
from ..datasets import read_zone_csv
from .settings import SCHEDULE

#: (role, pattern of column names that suggest it), the most certain first
_HINTS: tuple[tuple[str, str], ...] = (
    ("T_za", r"^t_?(za|zone|in|indoor|room|air_in)\b|^t_in|^t_za|indoor|room|zone_?temp|inside|thermostat|binnen"),
    ("T_oa", r"^t_?(oa|out|outdoor|amb|ext)\b|^t_out|^t_oa|outdoor|outside|ambient|exterior|dry_?bulb|buiten"),
    ("q_sol", r"^q_sol$|\bghi|^ghi|global_?hor|solar|irradi|radiation"),
    ("Q_hvac", r"^q_hvac|hvac.*kw|heat.*_kw$|thermal_?power|delivered"),
    ("u_heat", r"^u_heat|heat_?cmd|heat.*(stage|cmd|run|valve|duty)|(stage|cmd|run|valve|duty).*heat|boiler|furnace"),
    ("u_cool", r"^u_cool|cool_?cmd|cool.*(stage|cmd|run|valve|duty)|(stage|cmd|run|valve|duty).*cool|compressor"),
)
_LONGEST_GAP = pd.Timedelta("1h")  # longest gap of an input inside the proposed spans; shorter ones are filled
_SHORTEST_LOG = 4  # fewest days to train and test on
_STEPS = tuple(pd.Timedelta(minutes=m) for m in (5, 10, 15, 20, 30, 60))  # steps to choose from; each divides a day
_NEVER = re.compile(r"set|truth|humid|target|number|co2|occup|people", re.IGNORECASE)


def propose_settings(log: str | PathLike[str]) -> str:
    """Propose a configuration from the columns of a log, as TOML with comments on what to check.

    Parameters
    ----------
    log : path-like, CSV file with one header line

    Raises
    ------
    FileNotFoundError, ValueError
        If the log cannot be read, or no column looks like the room and the outdoor temperature.
    """
    file = Path(log)
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}.")
    sep, decimal = _guess_separators(file)
    try:
        table = pd.read_csv(file, sep=sep, decimal=decimal, skipinitialspace=True, encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{file.name} is not written in UTF-8; save it as CSV UTF-8.") from None
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise ValueError(f"{file.name} cannot be read as CSV ({str(error).strip()}).") from None
    chosen = _guess_columns(table.rename(columns=lambda name: str(name).strip()))
    for role, what in (("T_za", "room"), ("T_oa", "outdoor")):
        if role not in chosen:
            raise ValueError(
                f"no column of {file.name} looks like the {what} temperature ({listed(table.columns)}); name it as "
                f"{role} in the configuration."
            )
    frame = read_zone_csv(file, chosen, sep=sep, decimal=decimal).replace([np.inf, -np.inf], np.nan)
    return _proposal(file, frame, chosen, (sep, decimal))


def _guess_separators(file: Path) -> tuple[str, str]:
    """The cell separator and the decimal sign, judged by the first lines of a log."""
    with open(file, encoding="utf-8-sig", errors="replace") as lines:
        head, *rows = list(islice(lines, 200)) or [""]
    sep = max((",", ";", "\t"), key=head.count)
    cells = [cell.strip() for row in rows for cell in row.split(sep)]
    comma = sep != "," and any(re.fullmatch(r"-?\d+,\d+", cell) for cell in cells)
    return sep, "," if comma else "."


def _guess_columns(table: pd.DataFrame) -> dict[str, str]:
    numbers = table.apply(pd.to_numeric, errors="coerce")
    mostly = numbers.notna().sum() >= 0.5 * table.notna().sum()  # other cells, such as a logger's "ERR", come later
    numeric = [c for c in table.columns[mostly] if not _NEVER.search(c)]
    chosen: dict[str, str] = {}
    for role, pattern in _HINTS:
        for column in numeric:
            if column not in chosen.values() and re.search(pattern, column, re.IGNORECASE):
                chosen[role] = column
                break
    if "Q_hvac" in chosen:  # the stages add nothing to the heat that they delivered
        chosen.pop("u_heat", None)
        chosen.pop("u_cool", None)
    return chosen


def _guess_units(frame: pd.DataFrame, chosen: Mapping[str, str]) -> dict[str, str]:
    units = {}
    for role, column in chosen.items():
        values = frame[role].dropna()
        if role.startswith("T_") and (re.search(r"deg_?f|_f$|fahr", column, re.IGNORECASE) or values.median() > 45):
            units[role] = "degF"
        elif role == "q_sol" and values.max() > 2.0:
            units[role] = "W/m2"
        elif role.startswith("Q_") and values.abs().max() > 2000:
            units[role] = "W"
    return units


def _guess_scale(frame: pd.DataFrame) -> dict[str, float]:
    """Factors that scale commands to stages between 0 and 1."""
    top = {str(role): float(frame[role].max()) for role in frame if str(role).startswith("u_")}
    return {role: round(1.0 / highest, 6) for role, highest in top.items() if highest > 1.5}


def _segment(frame: pd.DataFrame, name: str) -> pd.DatetimeIndex:
    """Stamps of the longest segment without a long gap in any input, up to the last known temperature."""
    known = np.flatnonzero(frame["T_za"].notna().to_numpy())
    frame = frame.iloc[: known[-1] + 1 if len(known) else None]
    found = pd.DatetimeIndex(frame.index[frame.drop(columns="T_za").notna().all(axis=1)])
    if len(found) < 2:
        raise ValueError(f"{name} has fewer than two rows with every input; check the columns.")
    broken = found[1:] - found[:-1] > max(_LONGEST_GAP, 2 * _usual(found))
    segment = np.concatenate([[0], np.cumsum(broken)])
    return found[segment == np.bincount(segment).argmax()]


def _usual(index: pd.DatetimeIndex) -> pd.Timedelta:
    return pd.Timedelta((index[1:] - index[:-1]).to_series().median())


def _proposal(file: Path, frame: pd.DataFrame, chosen: Mapping[str, str], separators: tuple[str, str]) -> str:
    index = _segment(frame, file.name)
    source = _usual(index)
    if not source > pd.Timedelta(0):
        raise ValueError(
            f"most stamps of {file.name} occur twice, such as {index[0]}; give date and time in one column."
        )
    guessed: dict[str, Mapping[str, Any]] = {"units": _guess_units(frame, chosen), "scale": _guess_scale(frame)}
    blocks = [
        _log_lines(file, index, source, separators),
        _column_lines(chosen),
        *[_table_lines(title, table) for title, table in guessed.items() if table],
        *_model_lines(chosen),
        *_span_lines(file, index),
        ["[load]", 'setpoint = "measured"  # or a temperature [degC]'],
    ]
    if "q_sol" in chosen:
        where = "# [site]  # where the building is, for the sun on its facades"
        blocks.append([where, "# latitude = 52.4", "# longitude = 4.9"])
    return "\n\n".join("\n".join(lines) for lines in blocks) + "\n"


def _log_lines(file: Path, index: pd.DatetimeIndex, source: pd.Timedelta, separators: tuple[str, str]) -> list[str]:
    """Format of the log: its clock, its separators and its step."""
    step = next((s for s in _STEPS if s >= 0.9 * source), _STEPS[-1])
    label = "right" if index[0] - index[0].normalize() == source else "left"  # a day that begins one step late
    # pandas writes a fixed offset as "UTC-06:00", and reads "-06:00"
    zone = "UTC" if index.tz is None else str(index.tz).removeprefix("UTC") or "UTC"
    twice = index[index.duplicated()] if index.tz is None else index[:0]
    return [
        f"# Proposed for {file.name}; check every line.",
        f"name = {_quoted(file.stem)}",
        f'timezone = "{zone}"  # better the local zone, such as "Europe/Amsterdam"',
        '# holidays = "NL"  # a country, a state or a list of dates: days on which the building is used as on a Sunday',
        *([f"# the stamp {twice[0]} occurs twice: a local clock with daylight saving?"] if len(twice) else []),
        f'label = "{label}"  # whether a stamp marks the start (left) or the end (right) of the means in its row',
        *([f"sep = {_quoted(separators[0])}"] if separators[0] != "," else []),
        *([f"decimal = {_quoted(separators[1])}"] if separators[1] != "." else []),
        f'step = "{step.total_seconds() / 60:g}min"',
        'origin_step = "1D"  # a forecast from every local midnight of the test span',
    ]


def _column_lines(chosen: Mapping[str, str]) -> list[str]:
    lines = ["[columns]", *[f"{role} = {_quoted(column)}" for role, column in chosen.items()]]
    if not any(role.startswith(("u_", "Q_")) for role in chosen):
        lines.append(
            '# u_heat = "..."  # no column looks like heating or cooling: add a stage (u_heat) or heat [kW] (Q_hvac)'
        )
    return lines


def _table_lines(title: str, table: Mapping[str, Any]) -> list[str]:
    return [f"[{title}]", *[f"{key} = {_quoted(value)}" for key, value in table.items()]]


def _model_lines(chosen: Mapping[str, str]) -> list[list[str]]:
    network = ["[network]", '# name = "2R2C"  # of the catalogue, for all models; best left to them']
    estimator = ["[estimator]", 'name = "periodic"  # the identification that gives the parameters']
    capacities = [parameter for role, parameter in (("u_heat", "Q_h"), ("u_cool", "Q_c")) if role in chosen]
    if capacities:
        estimator.append(
            f"# known = {{ {capacities[0]} = 6.0 }}  # nameplate capacity [kW]: without it no kW is certain"
        )
    return [network, estimator, ["[forecaster]", f'model = "{SCHEDULE}"  # the default; "ridge" is a two-stage model']]


def _span_lines(file: Path, index: pd.DatetimeIndex) -> list[list[str]]:
    """Training and test spans of whole days, before the last day of the log."""
    day, last = pd.Timedelta("1D"), index[-1].normalize()
    days = (last - index[0].normalize()).days
    if days < _SHORTEST_LOG:
        raise ValueError(
            f"{file.name} has no more than {index[0]} to {index[-1]} without a long gap; a study needs {_SHORTEST_LOG} "
            "whole days to train and test on, and one more to forecast."
        )
    n_test = max(min(days // 3, 28), 2)  # the first row of the next day belongs to the forecast of a day
    n_train = min(days - n_test, 42)
    test, train = last - n_test * day, last - (n_test + n_train) * day
    return [
        ["[train]", f"start = {train:%Y-%m-%d}", f"end = {test - day:%Y-%m-%d}"],
        ["[test]", f"start = {test:%Y-%m-%d}", f"end = {last - day:%Y-%m-%d}"],
    ]


def _quoted(value: Any) -> str:
    if not isinstance(value, str):
        return str(value)
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t") + '"'
