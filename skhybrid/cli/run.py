"""``skhybrid run``: a study of a log, with a back-test beside simple models and a report."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import CONFIG, LOG, PATH, as_command, settings_at
from ._output import Progress


@as_command("run", "skhybrid run thermostat.csv --config zone.toml --out study")
@LOG
@CONFIG
@click.option("--out", type=PATH, metavar="DIR", required=True, help="Folder to write to.")
def command(log: str, config: Path | None, out: Path, say: Progress, as_json: bool) -> None:
    """Study a log: back-test, next day, building, and a report.

    The hybrid and the models that it is compared with are fitted on [train] and scored on [test].
    """
    settings = settings_at(config, several=True)
    from ._study import read_study, study_to_folder

    study_to_folder(settings, read_study(log, settings, say), out, say, as_json=as_json)
