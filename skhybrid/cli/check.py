"""``skhybrid check``: what a log holds, before anything is fitted."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import LOG, PATH, as_command, print_json, write_out
from ._output import Progress


@as_command("check", "skhybrid check thermostat.csv --config zone.toml")
@LOG
@click.option("--config", type=PATH, metavar="zone.toml", help="Configuration to write, or to read if it exists.")
@click.option("--format", "format_", help="Format of the log, if its content does not show it.")
@click.option("--timezone", help="Time zone of stamps without an offset, such as Europe/Amsterdam.")
@click.option("--overwrite", is_flag=True, help="Replace the configuration if it exists.")
def command(
    log: str,
    config: Path | None,
    format_: str | None,
    timezone: str | None,
    overwrite: bool,
    say: Progress,
    as_json: bool,
) -> None:
    """Check a log before anything is fitted.

    It lists columns, units, gaps and sensors, and says what can be learned.

    With --config, a configuration is written there; what could not be found is a comment in it.  A configuration that
    exists is used instead, and left as it is.
    """
    known = config is not None and config.is_file() and not overwrite
    if known:
        overruled = [name for name, value in (("--format", format_), ("--timezone", timezone)) if value is not None]
        if overruled:
            raise click.UsageError(f"{config} exists and says how the log is read: correct it, without {overruled[0]}")
    # imported here so that --help need not wait for it
    from .._warnings import without_python
    from ..logs import LogReport
    from ..logs import read_log as read_any_log
    from ..study import propose_settings, read_settings
    from ..study.log_reading import SETPOINT, read_raw_log
    from ._study import refuse_unwritable

    refuse_unwritable(None if known else config, "file", "--config")
    if config is not None and known:
        settings = read_settings(config)
        report = LogReport(
            read_raw_log(log, settings),
            settings.columns,
            {role: unit for role, unit in settings.units.items() if role != SETPOINT},  # which has no role
            settings.scale,
            label=settings.label,
            holidays=settings.holidays,
            scaled=settings.scaled_roles,
        )
    else:
        given = {} if timezone is None else {"timezone": timezone}
        report = LogReport(read_any_log(log, format_, **given))
        if config is not None:
            write_out(config, propose_settings(log, report), say)
    if as_json:
        content = report.to_dict()
        findings = [finding | {"text": without_python(finding["text"])} for finding in content["findings"]]
        print_json(content | {"findings": findings})
    else:
        print(without_python(report))
    say.n_warnings += sum(finding.level != "note" for finding in report.findings)
