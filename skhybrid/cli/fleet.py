"""``skhybrid fleet``: many zones in one folder, each with its own model."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import click

from ._options import DIR, MOST_JOBS, as_command, as_group, lines_of, print_json
from ._output import Progress, one_line

_MOST_SHOWN, _MOST_NAMED = 20, 5  # lines, and zones in one of them
#: what messages advise to those who call the package, and what to those who keep the folder of a fleet
_ADVICE = (
    (
        r"convert (it|the column) with skhybrid\.preprocessing\.UnitConverter",
        r"write \1 to data in the unit of its role",
    ),
    (r"the estimator's columns=\{'T_za': \.\.\.\}, or give y", "columns = { T_za = ... } in [estimator] of fleet.toml"),
)


def _some(context: click.Context, option: click.Parameter, jobs: int) -> int:
    if jobs == 0:
        raise click.BadParameter("0 processes do no work; give 1 or more, or -1 for every core")
    return jobs


_JOBS = click.option(
    "--jobs",
    type=click.IntRange(max=MOST_JOBS),
    default=1,
    callback=_some,
    metavar="N",
    help="Number of processes; -1 uses every core.",
)


@as_command("fit", "skhybrid fleet fit houses --jobs -1")
@DIR
@_JOBS
def fit(folder: Path, jobs: int, say: Progress, as_json: bool) -> None:
    """Fit a model per zone of DIR/data.

    DIR/data is a Parquet dataset with a folder per zone, such as data/zone=kitchen.  DIR/fleet.toml is made where there
    is none.  Zones without new rows are not fitted again, so a fit that was stopped goes on where it was.
    """
    from ..fleet import FleetFolder

    say(1, 1, "fitting the zones")
    with _told_by_zone():
        fleet = FleetFolder(folder, jobs).fit()
    _show({"folder": str(folder), "zones": len(fleet.zones_)}, fleet.errors_, fleet.warnings_, say, as_json)


@as_command("tick", "skhybrid fleet tick houses")
@DIR
@_JOBS
def tick(folder: Path, jobs: int, say: Progress, as_json: bool) -> None:
    """Take in new rows of DIR/data and forecast (for cron).

    Measurements since the last tick are taken in, and the rows after the last temperature are forecast: they hold the
    weather to come, and heat or set-points.  The forecasts of all zones are written to DIR/forecast.parquet.
    """
    from ..fleet import FleetFolder

    with _told_by_zone():
        found = FleetFolder(folder, jobs).tick()
    key = str(found.forecast.columns[0])
    facts = {"forecast zones": int(found.forecast[key].nunique()), "rows": len(found.forecast)}
    _show(facts, found.errors, found.warnings, say, as_json)


@as_command("status", "skhybrid fleet status houses")
@DIR
@_JOBS
def status(folder: Path, jobs: int, say: Progress, as_json: bool) -> None:
    """Show how each zone is doing, the worst first, and why.

    The page DIR/status.html has all zones, each with a small chart.
    """
    from ..fleet import FleetFolder
    from ..study.verdict import USABLE

    made = FleetFolder(folder, jobs)
    table = made.status()
    if as_json:
        print_json(table.astype(object).where(table.notna(), None).to_dict("records"))
        return
    shown = table.head(_MOST_SHOWN)
    print(shown.drop(columns="reasons").to_string(index=False, float_format="{:.2f}".format, na_rep="-"))
    for zone, verdict, *_, reasons in shown.itertuples(index=False):
        if verdict != USABLE:
            print(f"{zone}: {_advice(reasons)}")
    if len(table) > _MOST_SHOWN:
        print(f"and {len(table) - _MOST_SHOWN} more")
    print(f"see {made.page}")


command = as_group(
    "fleet",
    [fit, tick, status],
    "Keep a folder of many zones: data, models and forecasts.",
    "skhybrid fleet fit houses",
)


def _told_by_zone() -> AbstractContextManager[None]:
    """Leave out the warning of the zones that failed, which :func:`_show` names."""
    from .._warnings import warnings_dropped
    from ..exceptions import FleetWarning

    return warnings_dropped(FleetWarning)


def _advice(text: str) -> str:
    """A message in a line, with what its reader can do to the folder."""
    for said, shown in _ADVICE:
        text = re.sub(said, shown, text)
    return one_line(text)


def _show(
    found: dict[str, Any],
    errors: Mapping[Any, str],
    warnings: Mapping[Any, Sequence[str]],
    say: Progress,
    as_json: bool,
) -> None:
    """Facts on stdout; why zones failed, and then warnings, on stderr: what is said of several zones, once."""
    told: dict[str, list[str]] = {}
    for zone, text in [*errors.items(), *((zone, text) for zone, texts in warnings.items() for text in texts)]:
        told.setdefault(_advice(text), []).append(str(zone))
    for text, zones in list(told.items())[:_MOST_SHOWN]:
        more = f" and {len(zones) - _MOST_NAMED} more" if len(zones) > _MOST_NAMED else ""
        say.warn(f"{', '.join(zones[:_MOST_NAMED])}{more}: {text}")
    if len(told) > _MOST_SHOWN:
        say.warn(f"and {len(told) - _MOST_SHOWN} more warnings")
    found |= {"failed": len(errors), "with warnings": len(warnings)}
    if as_json:
        shown = {"errors": errors, "warnings": {zone: list(texts) for zone, texts in warnings.items()}}
        print_json(found | shown)
    else:
        print("\n".join(lines_of(found)))
