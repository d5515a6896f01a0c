"""``skhybrid report``: the report of a log alone, one HTML page."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import CONFIG, LOG, PATH, as_command, settings_at
from ._output import Progress


@as_command("report", "skhybrid report thermostat.csv --config zone.toml --out report.html")
@LOG
@CONFIG
@click.option("--out", type=PATH, metavar="FILE", required=True, help="HTML file to write.")
def command(log: str, config: Path | None, out: Path, say: Progress, as_json: bool) -> None:
    """Write the report of a study of a log, and nothing else."""
    settings = settings_at(config, several=True)
    from ..study import run_study, write_report
    from ._study import print_result, read_study, refuse_unwritable

    refuse_unwritable(out, "file")
    result = run_study(settings, read_study(log, settings, say), say)
    write_report(out, result)
    print_result(result, say, str(out), as_json=as_json)
