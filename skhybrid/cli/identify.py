"""``skhybrid identify``: the building as its log tells it."""

from __future__ import annotations

from pathlib import Path

from ._options import CONFIG, LOG, as_command, print_json, settings_at
from ._output import DONE, Progress


@as_command("identify", "skhybrid identify thermostat.csv --config zone.toml")
@LOG
@CONFIG
def command(log: str, config: Path | None, say: Progress, as_json: bool) -> int:
    """Identify the thermal network: heat loss, time constants, solar aperture and capacities, with standard errors."""
    settings = settings_at(config)
    from ..study import read_log
    from ..study.identified_building import told
    from ..zone.building import describe_building

    frame, _ = read_log(log, settings)
    table = told(describe_building(settings, frame))
    if as_json:
        print_json(table.to_dict(orient="index"))
    else:
        print(table.to_string(na_rep="-", float_format="{:.3g}".format))
    return DONE
