"""``skhybrid forecast``: tomorrow's temperature and load."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import MODEL, PATH, SETPOINT, WEATHER, as_command, log_option, print_json, write_out
from ._output import Progress

_HOURS = 3  # of a row of the table on the terminal
#: columns of that table, with their units
_TITLES = {
    "T_za": ("room", "[degC]"), "Q_hvac": ("heat", "[kW]"), "electricity_kW": ("electricity", "[kW]"),
    "T_heat_set": ("heat to", "[degC]"), "T_cool_set": ("cool to", "[degC]"), "T_oa": ("outdoors", "[degC]"),
    "q_sol": ("sun", "[kW/m2]"),
}  # fmt: skip
_ENDS = {"T_za": ("q_0.1", "q_0.9"), "Q_hvac": ("Q_hvac_0.1", "Q_hvac_0.9")}  # of the 80 % intervals
_SHARED = ("T_heat_set", "T_cool_set", "T_oa", "q_sol")  # by zones that have none of their own


@as_command("forecast", "skhybrid forecast --model zone.skops --log today.csv --weather tomorrow.csv --setpoint 21,24")
@MODEL
@log_option("Log up to now; rows after it may hold what is planned.")
@WEATHER
@SETPOINT
@click.option("--out", type=PATH, metavar="forecast.csv", help="File to write all rows to.")
def command(
    model: Path,
    log: str,
    weather: Path | None,
    setpoint: tuple[str, ...],
    out: Path | None,
    say: Progress,
    as_json: bool,
) -> None:
    """Forecast the day after a log: room temperature and heat.

    With set-points, the forecast includes what the thermostat does, within the limits of the plant.  Heat or stages
    that are planned in the rows ahead of the log are used as they are.  The model learns nothing new.
    """
    from ..zone import ZoneModel, day_ahead
    from ._study import refuse_unwritable

    refuse_unwritable(out, "file")
    zone = ZoneModel.load(model)
    found = day_ahead(zone, log, weather, setpoint)
    for text in found.remarks:
        say.warn(text)
    if out is not None:
        write_out(out, found.frame.to_csv(float_format="%.6g"), say)
    if as_json:
        print_json(forecast_content(found))
    else:
        print(_text(found, zone.settings))


def forecast_content(found: Any) -> dict[str, Any]:
    """A forecast as plain values."""
    frame = found.frame
    rows = [
        {"time": stamp.isoformat(), **row} for stamp, row in zip(frame.index, frame.to_dict("records"), strict=True)
    ]
    return {"summary": found.summary, "remarks": list(found.remarks), "forecast": rows}


def _text(found: Any, settings: Any = None) -> str:
    """A table of each zone, and the sums of the day."""
    from ..study.zone_part import forecast_of

    frame, lines = found.frame, []
    power = "[kW]" if "largest load [kW]" in found.summary else "[relative]"
    for zone in (settings and settings.zones) or [""]:
        own = forecast_of(frame, settings, zone)
        shared = [name for name in _SHARED if name in frame and name not in own]
        lines += [*([zone] if zone else []), _table(own.join(frame[shared]), power), ""]
    return "\n".join([*lines, *summary_lines(found.summary)])


def _table(frame: Any, power: str) -> str:
    """A row for some hours of one zone, with the units on top."""
    import pandas as pd

    hours = (frame.index[1] - frame.index[0]).total_seconds() / 3600.0 if len(frame) > 1 else 1.0
    shown = frame.iloc[:: max(1, round(_HOURS / hours))]
    cells = {}
    for name, (title, unit) in _TITLES.items():
        if name in shown:
            top, digits = unit.replace("[kW]", power), 1 if unit == "[degC]" else 2
            cells[title, top] = [_numbers(value, digits=digits) for value in shown[name]]
            if name in _ENDS and set(_ENDS[name]) <= set(shown):
                ends = zip(*(shown[end] for end in _ENDS[name]), strict=True)
                cells[f"80 % of {title}", top] = [_numbers(*pair, digits=digits) for pair in ends]
    return pd.DataFrame(cells, index=shown.index.strftime("%a %H:%M")).rename_axis(None).to_string()


def _numbers(*values: float, digits: int) -> str:
    """A number, or the ends of an interval; a dash where one is missing."""
    return "-" if any(value != value for value in values) else " to ".join(f"{value:z.{digits}f}" for value in values)


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """Sums and ranges of the day, one per line."""
    spans = {name: " to ".join(map(str, value)) for name, value in summary.items() if isinstance(value, list | tuple)}
    return [f"{name}: {value}" for name, value in (summary | spans).items()]
