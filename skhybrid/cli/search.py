"""``skhybrid search``: choose the disturbance model from the design matrix."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import CONFIG, LOG, MOST_JOBS, PATH, as_command, print_json, settings_at
from ._output import Progress

#: columns of the table on the terminal
_TITLES = {"framework": "model", "name": "case", "rmse": "RMSE [K]", "fit_time": "time [s]", "error": "failed with"}


@as_command("search", "skhybrid search thermostat.csv --config zone.toml --store search --models mlp,ridge")
@LOG
@CONFIG
@click.option("--store", type=PATH, required=True, metavar="DIR", help="Folder of results.")
@click.option("--models", default="mlp", help="Any of mlp,cnn,rnn,lstm,ridge,profile, separated by commas.")
@click.option(
    "--size", type=click.Choice(["small", "paper"]), default="small", help="Sizes to try: a few, or all of the paper."
)
@click.option("--jobs", type=click.IntRange(1, MOST_JOBS), default=1, help="Processes that train at a time.")
def command(
    log: str, config: Path | None, store: Path, models: str, size: str, jobs: int, say: Progress, as_json: bool
) -> None:
    """Choose a disturbance model from the design matrix.

    Its cases are trained on [train] and scored on [test]; a stopped search goes on.
    """
    settings = settings_at(config)
    from ..model_selection import design_matrix
    from ..zone.zone_search import search_zone
    from ._study import read_study, refuse_unwritable

    refuse_unwritable(store, option="--store")
    matrix = design_matrix([name.strip() for name in models.split(",")], size=size, disturbance="input")
    table = search_zone(settings, read_study(log, settings, say), store, matrix, jobs, verbose=not say.quiet)
    if as_json:
        print_json(table.to_dict(orient="records"))
    else:
        shown = table.head(20)[list(_TITLES)].rename(columns=_TITLES).dropna(axis=1, how="all")
        print(shown.to_string(index=False, float_format="{:.3g}".format, na_rep="-"))
