"""``skhybrid identify``: the building as its log tells it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ._options import CONFIG, LOG, as_command, print_json, settings_at
from ._output import DONE, Progress


@as_command("identify", "skhybrid identify thermostat.csv --config zone.toml")
@LOG
@CONFIG
def command(log: str, config: Path | None, say: Progress, as_json: bool) -> int:
    """Describe the building by its heat loss and time constants.

    Solar aperture and capacities too, each with its standard error, or "not identified".
    """
    settings = settings_at(config)
    from ..study import read_log
    from ..study.identified_building import told
    from ..zone.building import describe_building

    say(1, 2, "reading the log")
    frame, _ = read_log(log, settings)
    say(2, 2, "identifying the building")
    table = told(describe_building(settings, frame))
    if as_json:
        print_json(table.to_dict(orient="index"))
    else:
        print(_text(table))
    return DONE


def _text(table: Any) -> str:
    """A line per quantity, with its unit beside its name."""
    named = table.set_axis([f"{name} [{unit}]" for name, unit in table["unit"].items()])
    shown = named[["value", "std", "remark"]].rename(columns={"std": "std. error"})
    return shown.to_string(na_rep="-", float_format="{:.3g}".format)
