"""A proposal for the settings of a log, made from the report on it."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import pandas as pd

from .._last_known import up_to_last_known
from .._table import SETPOINT_ROLES
from .._time import LONGEST_BRIDGE, SHORTEST_GAP, wall_clock
from ..logs import LogReport, read_log, to_left_label
from ..logs.log_findings import is_local
from ..logs.setpoint_modes import MODE
from ..preprocessing.bridges import stretches
from ..thermal.declaration import capacity_name
from .settings import SCHEDULE, as_toml

_SHORTEST_LOG = 4  # fewest days to train and test on
_LEAST_TEST = 2  # days: the first row of the next day belongs to the forecast of a day
#: roles that a proposal names even where no column was found, with what they are
_WANTED = {
    "T_za": "room temperature",
    "T_oa": "outdoor temperature",
    "q_sol": "global horizontal irradiance",
    "T_heat_set": "heating set-point",
    "T_cool_set": "cooling set-point",
}
_PLANTS = ("u_heat", "u_cool", "Q_hvac", "Q_heat", "Q_cool")


def propose_settings(log: str | PathLike[str], report: LogReport | None = None) -> str:
    """Propose a configuration for a log, as TOML with comments on what to check.

    What was not found is a comment to fill in, so that there is a proposal for every log.

    Parameters
    ----------
    log : path-like, a file in any format of :func:`skhybrid.logs.read_log`, or the URL of a database
    report : LogReport, optional, of this log, where it has been made

    Raises
    ------
    FileNotFoundError, ValueError
        If the log cannot be read, or has no two rows with time stamps.
    """
    report = report or LogReport(read_log(log))
    name = Path(str(log).rpartition("/")[2]).stem or "zone"
    blocks = [
        _log_lines(report, name),
        _column_lines(report),
        *_unit_lines(report),
        *_model_lines(report),
        *_span_lines(report),
        *_plant_lines(report),
    ]
    if "q_sol" in report.roles:
        where = "# [site]  # where the building is, for the sun on its facades"
        blocks.append([where, "# latitude = 52.4", "# longitude = 4.9"])
    return "\n\n".join("\n".join(lines) for lines in blocks if lines) + "\n"


def _log_lines(report: LogReport, name: str) -> list[str]:
    index = pd.DatetimeIndex(report.raw.frame.index)
    # pandas writes a fixed offset as "UTC-06:00", and reads "-06:00"
    zone = "..." if index.tz is None else str(index.tz).removeprefix("UTC") or "UTC"
    better = "" if index.tz is None else "better "
    hint = "" if is_local(index) else f'  # {better}the local zone, such as "Europe/Amsterdam"'
    lines = [
        f"# Proposed for {name} ({report.raw.format}); check every line.",
        f"name = {as_toml(name)}",
        f"{'' if index.tz is not None else '# '}timezone = {as_toml(zone)}{hint}",
        '# holidays = "NL"  # a country, a state or a list of dates: days on which the building is used as on a Sunday',
        f"label = {as_toml(report.assumed_label)}  # whether a stamp marks the start (left) or the end (right) of the "
        "means in its row",
        f'step = "{report.even_step.total_seconds() / 60:g}min"',
        'origin_step = "1D"  # a forecast from every local midnight of the test span',
        '# weather_error = "medium"  # or "low", "high": intervals allow for errors of the weather forecast',
    ]
    if (day_first := report.raw.day_first) is not None:  # which a file of one day would not show
        value, first = ("true", "day") if day_first else ("false", "month")
        lines.insert(3, f"dayfirst = {value}  # dates begin with the {first}")
    if zones := report.zones:
        pairs = "pairs of rooms that exchange heat, by the floor plan; without it"
        lines.append(f"# {pairs} they are found by likeness of temperatures")
        lines.append(f"# adjacency = [[{as_toml(zones[0])}, {as_toml(zones[-1])}]]")
    return lines


def _column_lines(report: LogReport) -> list[str]:
    roles, lines = report.roles, ["[columns]"]
    for role, name in roles.items():
        reason = report.columns.loc[name, "reason"]
        lines.append(f"{role} = {as_toml(name)}" + ("" if role == name else f"  # {reason!s}"))
    free = report.columns[report.columns["role"].isna()]
    for role, what in _WANTED.items():
        if role not in roles and not any(f"{role}_{zone}" in roles for zone in report.zones):
            near = _candidates(report, free, role)
            lines.append(f'# {role} = "..."  # {what}: not found' + (f"; perhaps {near}" if near else ""))
    if not report.zones and not any(role in _PLANTS for role in roles):
        lines.append(
            '# u_heat = "..."  # no column looks like heating or cooling: add a stage (u_heat) or heat [kW] (Q_hvac)'
        )
    return lines


def _candidates(report: LogReport, free: pd.DataFrame, role: str) -> str:
    """Unused columns whose values could be those of a role."""
    if not role.startswith("T_"):
        return ""
    names = []
    for name in free.index:
        values = report.raw.frame[name].dropna()
        if len(values) > 1 and values.nunique() > 2 and -30 < values.median() < 90 and values.std() > 0.05:
            names.append(f"{name!r} ({values.quantile(0.05):.3g} to {values.quantile(0.95):.3g})")
    return ", ".join(names[:3])


def _unit_lines(report: LogReport) -> list[list[str]]:
    """Tables of the units that are not those of the data contract, and of factors."""
    used = report.columns[report.columns["role"].notna()]
    used = used.assign(role=used["role"].str.split(", ")).explode("role").set_index("role")
    used = used.drop(index=[role for role in used.index if role.startswith(MODE)])
    units = used["unit"][~used["unit"].isin(["degC", "kW", "kW/m2", "-"])]
    scale = used["scale"][used["scale"] != 1.0].astype(float).round(9)
    tables = ((name, table) for name, table in (("units", units), ("scale", scale)) if len(table))
    return [[f"[{name}]", *(f"{role} = {as_toml(value)}" for role, value in one.items())] for name, one in tables]


def _model_lines(report: LogReport) -> list[list[str]]:
    estimator = ["[estimator]", 'name = "periodic"  # the identification that gives the parameters']
    sides = (("u_heat", "6.0"), ("u_cool", "-5.0"))
    capacities = [f"{capacity_name(role)} = {kw}" for u, kw in sides for role in report.roles if role.startswith(u)]
    if capacities:
        note = "nameplate capacity [kW]: without one no kW is certain"
        estimator.append(f"# known = {{ {', '.join(capacities)} }}  # {note}")
    return [estimator, ["[forecaster]", f'model = "{SCHEDULE}"  # the default; "ridge" is a two-stage model']]


def _plant_lines(report: LogReport) -> list[list[str]]:
    """Tables of the plant, and of the set-points of a day to come."""
    electric = report.electricity()
    thermostat = ["# [thermostat]  # set-points of a day to come", "# heat = 21", "# cool = 25"]
    plant = ["[plant]" if electric else "# [plant]"]
    if electric:
        seems = f"  # {electric[0]} seems to be electricity; false if it is heat"
        plant += [
            f"electricity = true{seems}",
            "cop = 3.0  # heat per electricity: check it, or [[-10, 2.2], [10, 3.5]]",
        ]
    else:
        plant += ["# electricity = true  # where the plant's columns are electricity", "# cop = 3.0"]
    if not report.zones:
        plant.append("# most_heat = 8.0  # what the plant can deliver [kW]")
    tariff = ["# [tariff]  # of electricity, or of heat where there is no cop"]
    tariff += ['# price = 0.30  # of a kWh; by the clock: { "7:00" = 0.35, "22:00" = 0.22 }', '# currency = "EUR"']
    return [plant, tariff, thermostat]


def _span_lines(report: LogReport) -> list[list[str]]:
    """Training and test spans of whole days, before the last day of the log; comments where there are too few."""
    day, short = pd.Timedelta("1D"), max(SHORTEST_GAP, 2 * report.step)
    found = wall_clock(_complete(report))  # days between its midnights have 24 h
    index = max(_segments(found, LONGEST_BRIDGE), key=len)
    tail = _whole_days(_segments(index, short)[-1])  # the test has no gap
    if tail < _LEAST_TEST:
        index = max(_segments(found, short), key=len)
        tail = _whole_days(index)
    days = _whole_days(index)
    if days < _SHORTEST_LOG:
        first = f"from {index[0]} to {index[-1]}" if len(index) else "no row"
        text = (
            f"# too few days without a long gap ({first}): a back-test needs {_SHORTEST_LOG}, and one more to forecast"
        )
        return [[text, "# [train]", "# start = 2024-01-01", "# end = 2024-01-28"], ["# [test]", "# start = 2024-01-29"]]
    last = index[-1].normalize()
    n_test = min(max(min(days // 3, 28), _LEAST_TEST), tail)
    n_train = min(days - n_test, 42)
    test, train = last - n_test * day, last - (n_test + n_train) * day
    return [
        ["[train]", f"start = {train:%Y-%m-%d}", f"end = {test - day:%Y-%m-%d}"],
        ["[test]", f"start = {test:%Y-%m-%d}", f"end = {last - day:%Y-%m-%d}"],
    ]


def _complete(report: LogReport) -> pd.DatetimeIndex:
    """Stamps of the rows with all inputs, up to the last known temperature."""
    frame = report.even
    if report.assumed_label == "right" and frame.index.is_unique:
        frame = to_left_label(frame)
    rooms = [f"T_za_{zone}" for zone in report.zones] or [role for role in ("T_za",) if role in frame]
    frame = up_to_last_known(frame, rooms) if rooms else frame
    inputs = frame[[role for role in frame if role not in rooms and not str(role).startswith(SETPOINT_ROLES)]]
    return pd.DatetimeIndex(frame.index[inputs.notna().all(axis=1)]).unique()


def _segments(stamps: pd.DatetimeIndex, longest: pd.Timedelta) -> list[pd.DatetimeIndex]:
    """Stamps between gaps of more than the longest."""
    return [pd.DatetimeIndex(part.index) for part in stretches(pd.DataFrame(index=stamps), longest)]


def _whole_days(stamps: pd.DatetimeIndex) -> int:
    """Number of days between the first and the last midnight."""
    return (stamps[-1].normalize() - stamps[0].ceil("D")).days if len(stamps) else 0
