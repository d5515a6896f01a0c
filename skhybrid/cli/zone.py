"""``skhybrid zone``: a folder per zone with its model, every forecast and what really happened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import (
    CONFIG_IF_ANY,
    DIR,
    MOST_DAYS,
    SETPOINT,
    WEATHER,
    as_command,
    as_group,
    lines_of,
    log_option,
    print_values,
)
from ._output import Progress
from .forecast import forecast_content, summary_lines

_LOG = log_option("Log up to now, of two weeks or more.")


@as_command("init", "skhybrid zone init kitchen --log thermostat.csv")
@DIR
@_LOG
@CONFIG_IF_ANY
def init(folder: Path, log: str, config: Path | None, say: Progress, as_json: bool) -> None:
    """Make the folder of a zone: configuration, model and archive.

    Without --config one is proposed from the log, as zone.toml in the folder.  If the fit fails, correct it there and
    run the command again.
    """
    from ..zone import ZoneFolder
    from ._study import refuse_unwritable

    refuse_unwritable(folder, option="DIR")
    say(1, 1, "reading the log and learning")
    made = ZoneFolder.init(folder, log, config)
    print_values({"folder": str(folder), **made.load().facts()}, as_json)


@as_command("tick", "skhybrid zone tick kitchen --log thermostat.csv --weather tomorrow.json --setpoint 21,24")
@DIR
@_LOG
@WEATHER
@SETPOINT
@click.option(
    "--refit-after",
    type=click.IntRange(1, MOST_DAYS),
    default=28,
    metavar="DAYS",
    help="Age of the model at which it is fitted again.",
)
def tick(
    folder: Path,
    log: str,
    weather: Path | None,
    setpoint: tuple[str, ...],
    refit_after: int,
    say: Progress,
    as_json: bool,
) -> None:
    """Take in new rows, forecast, and archive both (for cron).

    The forecast starts from the end of the log.  The model is fitted again where its errors drift, or where it is old.
    A tick that fails or is killed leaves the folder intact; the next one catches up.
    """
    import pandas as pd

    from ..zone import ZoneFolder

    done = ZoneFolder(folder).tick(log, weather, setpoint, pd.Timedelta(days=refit_after))
    for text in done.remarks:
        say.warn(text)
    found = {"new rows": done.n_new, "fitted again because": done.learned or None}
    if as_json:
        print_values(found | forecast_content(done.forecast) | {"remarks": list(done.remarks)}, as_json)
    else:
        print("\n".join([*lines_of(found), *summary_lines(done.forecast.summary)]))


@as_command("status", "skhybrid zone status kitchen")
@DIR
def status(folder: Path, say: Progress, as_json: bool) -> None:
    """Show how past forecasts did, and whether the model drifts.

    Verdicts on temperature and load come first; of several zones, the worst zone.
    """
    from ..zone import ZoneFolder

    found = ZoneFolder(folder).status()
    if not as_json and "zones" in found:
        found |= {"zones": {zone: _in_words(state) for zone, state in found["zones"].items()}}
    elif not as_json:
        found = _in_words(found)
    print_values(found, as_json)


command = as_group(
    "zone",
    [init, tick, status],
    "Keep a folder per zone: model, forecasts and what happened.",
    "skhybrid zone init kitchen --log thermostat.csv",
)


def _in_words(found: dict[str, Any]) -> dict[str, Any]:
    """The status of a zone for those who read it."""
    none_yet = "no forecast is over yet"
    found = {name: value for name, value in found.items() if name != "last measured" or value is not None}
    drift = found["drift"]
    grown = f"errors have grown since {drift['since']}" if drift.get("drifted") else "none"
    verdicts = {f"{v['quantity']}: {v['level']}": v["reasons"] for v in found["verdicts"]}
    words = {
        "drift": f"{grown} ({drift['statistic']} of {drift['threshold']})"
        if drift
        else "not known before a whole day is measured",
        "verdicts": verdicts or none_yet,
    }
    for span in ("yesterday's forecast", "last four weeks"):
        errors = {k: _errors(v) if isinstance(v, dict) else v for k, v in (found[span] or {}).items()}
        words[span] = errors or none_yet
    return found | words


def _errors(found: dict[str, Any]) -> str:
    inside = found["coverage"]
    return f"RMSE {found['rmse']}, bias {found['bias']}" + (
        "" if inside is None else f", {100 * inside:.0f} % of the measurements inside the 80 % interval"
    )
