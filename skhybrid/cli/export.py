"""``skhybrid export``: what was identified, in the form that other programs take."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from ._options import CONFIG_IF_ANY, PATH, as_command, as_group, print_json, refuse_zones, settings_at, write_out
from ._output import Progress


@as_command("emhass", "skhybrid export emhass thermostat.csv --config zone.toml --out emhass.json")
@click.argument("source", metavar="LOG|MODEL|DIR", type=click.Path())
@CONFIG_IF_ANY
@click.option(
    "--log",
    type=click.Path(),
    metavar="LOG",
    help="Log to identify on, where a model file or a zone's folder is given.",
)
@click.option("--sense", type=click.Choice(["heat", "cool"]), default="heat", help="Whether the load heats or cools.")
@click.option(
    "--block",
    type=click.Choice(["thermal_config", "thermal_battery"]),
    default="thermal_config",
    help="The kind of load to write.",
)
@click.option("--step", type=click.FloatRange(1), default=30, metavar="MINUTES", help="EMHASS's time step.")
@click.option("--hours", type=float, default=6.0, help="How long the load stays on or off at a time.")
@click.option("--out", type=PATH, metavar="emhass.json", help="File of runtime parameters.")
def emhass(
    source: str,
    config: Path | None,
    log: str | None,
    sense: str,
    block: str,
    step: float,
    hours: float,
    out: Path | None,
    say: Progress,
    as_json: bool,
) -> None:
    """Write EMHASS's thermal_config or thermal_battery.

    Each value has its standard error.  The source is a log with --config, a model file or a zone's folder with --log,
    or a two-stage model alone.  What the data do not determine is left out, with the reason.
    """
    from ..zone.emhass import check_plan, emhass_parameters
    from ._study import refuse_unwritable

    refuse_unwritable(out, "file")
    check_plan(step / 60.0, hours)
    gray_box, settings, rows = _identified(source, config, log)
    found = emhass_parameters(gray_box, settings, rows, sense=sense, step=step / 60.0, hours=hours)
    for name in ("heating_rate", "cooling_constant") if block == "thermal_config" else ("volume", "u_value"):
        if name in found.left_out:
            say.warn(f"{name}, which EMHASS needs, is left out: {found.left_out[name]}")
    written = found.runtime_parameters(block)
    if out is not None:
        write_out(out, json.dumps(written, indent=2) + "\n", say)
    if as_json:
        values = found.values.to_dict(orient="index")
        rest = {"left_out": found.left_out, "misfit [K]": found.misfit, "warmed [K]": found.warmed}
        print_json({"runtime_parameters": written, "values": values, **rest})
    else:
        print(_text(found, written, hours))


command = as_group(
    "export",
    [emhass],
    "Write identified parameters for other programs (EMHASS).",
    "skhybrid export emhass thermostat.csv --config zone.toml",
)


def _identified(source: str, config: Path | None, log: str | None) -> tuple[Any, Any, Any]:
    """A gray box with standard errors, its settings, and the log that it was identified on."""
    from ..study import read_log
    from ..zone import ZoneFolder, ZoneModel
    from ..zone.zone_identification import identify_building

    path = Path(source)
    if not path.is_dir() and path.suffix != ".skops":
        if log is not None:
            raise click.UsageError(f"{source} is a log itself; give --log only with a model file or a zone's folder")
        settings, log = settings_at(config), source
    else:
        zone = ZoneFolder(path).load() if path.is_dir() else ZoneModel.load(path)
        refuse_zones(zone.settings, source)
        if config is None and path.is_dir():
            config = ZoneFolder(path).config
        settings = zone.settings if config is None else settings_at(config)
        if log is None:
            gray_box = zone.predictor.gray_box_
            if not hasattr(gray_box, "theta_cov_"):
                raise ValueError(
                    f"the network of {source} was fitted for forecasts and has no standard errors; give its log with "
                    "--log, to identify the building on."
                )
            return gray_box, settings, None
    frame, _ = read_log(log, settings)
    return identify_building(settings, frame), settings, frame


def _text(found: Any, written: dict[str, Any], hours: float) -> str:
    """The values, what is left out, and what EMHASS takes."""
    change = (
        f"In {hours:g} h at nominal power the network's temperature changes by {found.warmed:.1f} K; EMHASS's law with "
        f"one time constant differs from it by {found.misfit:.1f} K (root mean square)."
    )
    reasons = [f"- {name}: {reason}." for name, reason in found.left_out.items()]
    table = found.values.rename(columns={"std": "std. error"}).to_string(na_rep="-", float_format="{:.4g}".format)
    return "\n".join(
        [table, "", change, "", "What the log does not determine:", *reasons, "", json.dumps(written, indent=2)]
    )
