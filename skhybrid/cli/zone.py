"""``skhybrid zone``: a folder per zone with its model, every forecast and what really happened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import CONFIG, as_command, print_json
from ._output import DONE, Progress
from .forecast import forecast_content

_DIR = click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
_LOG = click.option("--log", required=True, metavar="LOG", help="Log up to now, of two weeks or more.")


@as_command("init", "skhybrid zone init kitchen --log thermostat.csv")
@_DIR
@_LOG
@CONFIG
def init(folder: Path, log: str, config: Path | None, say: Progress, as_json: bool) -> int:
    """Make the folder of a zone: configuration, model, and an archive of what was measured.

    Without --config one is proposed from the log, as zone.toml in the folder.  If the fit fails, correct it there and
    run the command again.
    """
    from ..zone import ZoneFolder

    say(1, 1, "reading the log and learning")
    made = ZoneFolder.init(folder, log, config)
    _print({"folder": str(folder), **made.load().facts()}, as_json)
    return DONE


@as_command("tick", "skhybrid zone tick kitchen --log thermostat.csv --weather tomorrow.json --setpoint 21,24")
@_DIR
@_LOG
@click.option("--weather", type=click.Path(path_type=Path), help="CSV, EPW, or Open-Meteo's forecast JSON.")
@click.option("--setpoint", help="Heating and cooling set-point: 21,24; by the clock: 6:00=21,22:00=17;24.")
@click.option(
    "--refit-after",
    type=click.IntRange(1),
    default=28,
    show_default=True,
    metavar="DAYS",
    help="Age of the model at which it is fitted again.",
)
def tick(
    folder: Path,
    log: str,
    weather: Path | None,
    setpoint: str | None,
    refit_after: int,
    say: Progress,
    as_json: bool,
) -> int:
    """Take in the new rows of the log, forecast from its end, and archive both (for cron).

    The model is fitted again where its errors drift, or where it is old.  A tick that fails or is killed leaves the
    folder whole; the next one makes up for it.
    """
    import pandas as pd

    from ..study.thermostat import Schedule
    from ..zone import ZoneFolder

    schedule = None if setpoint is None else Schedule.of_text(setpoint)
    done = ZoneFolder(folder).tick(log, weather, schedule, pd.Timedelta(days=refit_after))
    for text in done.remarks:
        say.warn(text)
    found = {"new rows": done.n_new, "fitted again because": done.learned or None}
    if as_json:
        _print(found | forecast_content(done.forecast) | {"remarks": list(done.remarks)}, as_json)
    else:
        _print(found | done.forecast.summary, as_json)
    return DONE


@as_command("status", "skhybrid zone status kitchen")
@_DIR
def status(folder: Path, say: Progress, as_json: bool) -> int:
    """Show the verdicts on past forecasts, drift, how yesterday's forecast did, and when the model last learned."""
    from ..zone import ZoneFolder

    found = ZoneFolder(folder).status()
    if not as_json:
        found["verdicts"] = {f"{v['quantity']}: {v['level']}": v["reasons"] for v in found["verdicts"]}
    _print(found, as_json)
    return DONE


command = click.Group(
    "zone",
    commands=[init, tick, status],
    help="Keep a folder per zone: its model, every forecast and what really happened.",
    epilog="\b\nExample:\n  skhybrid zone init kitchen --log thermostat.csv",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=False,
)


def _print(found: dict[str, Any], as_json: bool) -> None:
    """Values by name, one per line."""
    print_json(found) if as_json else print("\n".join(_lines(found)))


def _lines(found: dict[str, Any], indent: str = "") -> list[str]:
    lines = []
    for name, value in found.items():
        if isinstance(value, list | tuple):
            lines += [f"{indent}{name}:" + ("" if value else " -"), *(f"{indent}  - {item}" for item in value)]
            continue
        nested = isinstance(value, dict) and value
        lines.append(f"{indent}{name}:" + ("" if nested else " -" if value in (None, {}) else f" {value}"))
        lines += _lines(value, indent + "  ") if nested else []
    return lines
