"""``skhybrid backtest``: how well a model would have forecast the last weeks of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import CONFIG, LOG, PATH, as_command, print_json, settings_at, write_out
from ._output import Progress


@as_command("backtest", "skhybrid backtest thermostat.csv --config zone.toml --out backtest.csv")
@LOG
@CONFIG
@click.option("--out", type=PATH, metavar="backtest.csv", help="File to write all forecasts to.")
def command(log: str, config: Path | None, out: Path | None, say: Progress, as_json: bool) -> None:
    """Forecast past days, and compare with simple rules.

    The model is fitted on [train] of the configuration and forecasts every day of [test].
    """
    settings = settings_at(config, several=True)
    from ..zone.zone_backtest import backtest_zone
    from ._study import read_study, refuse_unwritable

    refuse_unwritable(out, "file")
    found = backtest_zone(settings, read_study(log, settings, say), say)
    if out is not None:
        write_out(out, found.frame.to_csv(index=False, float_format="%.6g"), say)
    for text in found.remarks:
        say.warn(text)
    held = found.setpoints_known
    if as_json:
        content: dict[str, Any] = {"verdicts": [one._asdict() for one in found.verdicts]}
        content |= {"table": found.table.to_dict(orient="index"), "load_unit": found.load_unit or None}
        content |= {"setpoints_known": None if held is None else held.as_dict()}
        print_json(content | {"coverage": found.coverage})
        return
    units = {"rmse": "RMSE [K]", "mae": "MAE [K]", "load_rmse": f"load RMSE [{found.load_unit}]"}
    for zone in settings.zones:
        units |= {f"rmse_{zone}": f"{zone} [K]", f"load_rmse_{zone}": f"load of {zone} [{found.load_unit}]"}
    tables = {"with the heat known:": (found.table, found.coverage)}
    if held is not None:
        known = f"with only {held.weather} and the set-points known:"
        tables = {known: (held.table.drop(columns="note"), held.coverage)} | tables
    print("\n".join(map(str, found.verdicts)))
    for head, (table, coverage) in tables.items():
        print(f"\n{head}" if held is not None else "")
        print(table.rename(columns=units).round(3).to_string(na_rep="-"))
        if coverage is not None:
            print(f"\n80 % intervals of the hybrid hold {100 * coverage:.0f} % of the measurements")
