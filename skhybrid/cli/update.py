"""``skhybrid update``: take new rows into a saved model."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import MODEL, as_command, log_option, print_values
from ._output import Progress


@as_command("update", "skhybrid update --model zone.skops --log today.csv")
@MODEL
@log_option("Log with rows after those that the model knows.")
@click.option("--relearn", is_flag=True, help="Also learn from them: the model is fitted on the last eight weeks.")
def command(model: Path, log: str, relearn: bool, say: Progress, as_json: bool) -> None:
    """Add the new rows of a log to a saved model."""
    from .._clock import on_clock_of
    from ..study.log_reading import read_even_log
    from ..zone import ZoneModel

    zone = ZoneModel.load(model)
    known = zone.known_until
    frame = read_even_log(log, zone.settings).finished
    rows = zone.readable(frame)
    n_new = zone.take_in(rows, relearn=relearn)
    if n_new or relearn:
        zone.save(model)
    if (unread := rows.unread) and not unread.is_step:
        say.warn(str(unread))
    elif not (n_new or unread) and frame.index[-1] > on_clock_of(known, frame.index):
        say.warn(f"no row is new: the log goes on to {frame.index[-1]}, but has no temperature after {known}")
    until = {"known until": str(zone.known_until), "learned until": str(zone.learned_until)}
    print_values({"new rows": n_new, **until}, as_json)
