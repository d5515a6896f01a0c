"""``skhybrid report``: the report of a log alone, one HTML page."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import CONFIG, LOG, as_command, settings_at
from ._output import DONE, Progress


@as_command("report", "skhybrid report thermostat.csv --config zone.toml --out report.html")
@LOG
@CONFIG
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", required=True, help="HTML file to write.")
def command(log: str, config: Path | None, out: Path, say: Progress, as_json: bool) -> int:
    """Write the report of a study of a log, and nothing else."""
    settings = settings_at(config)
    from ..study import read_log, run_study, split_log
    from ..study.outputs import metrics_text, write_page
    from ._study import print_result, refuse_unwritable

    refuse_unwritable(out, "file")
    frame, report = read_log(log, settings)
    for line in report.splitlines():
        say.note(line)
    result = run_study(settings, split_log(frame, settings), say)
    write_page(result, out)
    for text in result.warnings:
        say.warn(text)
    if as_json:
        print(metrics_text(result))
        return DONE
    print_result(result)
    print(f"\n{out}")
    return DONE
