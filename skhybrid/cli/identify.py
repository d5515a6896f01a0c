"""``skhybrid identify``: the building, identified from its log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ._options import CONFIG, LOG, as_command, print_json, settings_at
from ._output import Progress


@as_command("identify", "skhybrid identify thermostat.csv --config zone.toml")
@LOG
@CONFIG
def command(log: str, config: Path | None, say: Progress, as_json: bool) -> None:
    """Describe the building by its heat loss and time constants.

    Solar aperture and capacities too, each with its standard error, or "not identified".  Of several zones also what
    each two exchange.
    """
    settings = settings_at(config, several=True)
    from ..study import read_log
    from ..study.identified_building import describe, identified_only
    from ..zone.zone_identification import describe_rooms, identify_building

    say(1, 2, "reading the log")
    frame, _ = read_log(log, settings)
    say(2, 2, "identifying the building")
    if settings.zones:
        _print_rooms(describe_rooms(settings, frame), as_json)
        return
    table = identified_only(describe(identify_building(settings, frame)))
    if as_json:
        print_json(table.to_dict(orient="index"))
    else:
        print(_text(table))


def _print_rooms(found: Any, as_json: bool) -> None:
    from ..study.identified_building import identified_only

    if as_json:
        print_json(found.as_dict())
        return
    rooms, partitions = identified_only(found.rooms), identified_only(found.partitions)
    for zone in rooms.index.get_level_values("zone").unique():
        print(f"{zone}\n{_text(rooms.loc[zone])}\n")
    how = "found in the log; adjacency in the configuration is more certain" if found.found else "by the floor plan"
    print(f"exchange between zones ({how})")
    named = partitions.set_axis([f"{a} - {b}" for a, b in partitions.index])
    print(_text(named) if len(named) else "none")


def _text(table: Any) -> str:
    """A line per quantity, with its unit beside its name."""
    named = table.set_axis([f"{name} [{unit}]" for name, unit in table["unit"].items()])
    shown = named[["value", "std", "remark"]].rename(columns={"std": "std. error"})
    return shown.to_string(na_rep="-", float_format="{:.3g}".format)
