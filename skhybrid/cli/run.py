"""``skhybrid run``: a study of a log in a CSV file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from ._output import DONE, MISUSED, Progress, add_quiet, report_error


def add_parser(commands: Any) -> None:
    """Add the command to the subparsers of ``skhybrid``."""
    parser = commands.add_parser("run", help="do the same for your own log (CSV)")
    parser.add_argument("log", type=Path, metavar="LOG.csv", help="thermostat or meter log with one header line")
    parser.add_argument("--config", type=Path, metavar="zone.toml", help="columns, network, spans (see --write-config)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder to write to")
    parser.add_argument(
        "--write-config",
        action="store_true",
        help="propose a configuration from the columns of the log, and write it to --config or to stdout",
    )
    add_quiet(parser)
    parser.set_defaults(execute=execute)


def execute(arguments: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    if arguments.write_config:
        return _write_config(arguments.log, arguments.config)
    for name in ("config", "out"):
        if getattr(arguments, name) is None:
            report_error(f"run needs --{name}; see skhybrid run --help.")
            return MISUSED
    # imported here so that --help and --version need not wait for it
    from ..study import read_log, read_settings, split_log
    from ._study import study_to_folder

    settings = read_settings(arguments.config)
    frame, report = read_log(arguments.log, settings)
    progress = Progress(arguments.quiet)
    for line in report.splitlines():
        progress.note(line)
    return study_to_folder(settings, split_log(frame, settings), arguments.out, progress)


def _write_config(log: Path, config: Path | None) -> int:
    from .._files import atomic_path
    from ..study import propose_settings

    text = propose_settings(log)
    if config is None:
        print(text, end="")
        return DONE
    if config.exists():
        raise ValueError(f"{config} exists; choose another name or remove it.")
    with atomic_path(config) as made:
        made.write_text(text, encoding="utf-8")
    print(f"wrote {config}", file=sys.stderr)
    return DONE
