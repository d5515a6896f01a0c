"""``skhybrid fit``: learn a model of a zone from its log."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import CONFIG, LOG, MODEL, MOST_DAYS, as_command, lines_of, print_json, settings_at
from ._output import Progress


@as_command("fit", "skhybrid fit thermostat.csv --config zone.toml --model zone.skops")
@LOG
@CONFIG
@MODEL
@click.option("--days", type=click.IntRange(3, MOST_DAYS), default=56, help="Days at the end of the log to learn from.")
def command(log: str, config: Path | None, model: Path, days: int, say: Progress, as_json: bool) -> None:
    """Learn a model from the last weeks of a log, and save it."""
    settings = settings_at(config, several=True)
    from ..study.log_reading import read_even_log
    from ..zone import ZoneModel
    from ._study import refuse_unwritable

    refuse_unwritable(model, "file", "--model")
    say(1, 2, "reading the log")
    read = read_even_log(log, settings)
    for line in read.report.splitlines():
        say.note(line)
    say(2, 2, "learning")
    zone = ZoneModel.fit(settings, read.finished, days)
    zone.save(model)
    facts = zone.facts()
    if as_json:
        print_json({"model": str(model), **facts})
    else:
        print("\n".join([*lines_of(facts), f"wrote {model}"]))
