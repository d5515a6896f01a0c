"""The command line: ``skhybrid demo`` and ``skhybrid run``."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import __version__

if TYPE_CHECKING:
    import pandas as pd

    from .study import Settings, StudyData

#: exit codes beside 0.
FAILED, MISUSED, STOPPED = 1, 2, 130
_DEMO_NAME = "Small office, Chicago (EnergyPlus)"
#: the log of the demo ends here, so that the next day follows the tested weeks.
_DEMO_END = "2018-11-12"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; default is those of the process.

    Returns
    -------
    int
        0: done; 1: the input was refused or could not be read, with one line on stderr that says why; 2: the command
        line was misused; 130: it was interrupted (Ctrl-C or SIGTERM), and no file is half written.
    """
    parser = _parser()
    try:
        arguments = parser.parse_args(argv)
    except SystemExit as stop:  # argparse has said why
        return int(stop.code or 0)
    if argv is None and threading.current_thread() is threading.main_thread():  # run as a program: end tidily
        signal.signal(signal.SIGTERM, _stop)
        signal.signal(signal.SIGINT, _stop)
    try:
        return int(arguments.run(arguments))
    except (ValueError, TypeError, OSError) as error:
        print(f"skhybrid: error: {_one_line(error)}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("skhybrid: stopped", file=sys.stderr)
        return STOPPED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="skhybrid", description="Day-ahead forecast of room temperature and heating/cooling load from a log."
    )
    parser.add_argument("--version", action="version", version=f"skhybrid {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="{demo,run}")
    demo = commands.add_parser("demo", help="forecast a shipped log, beside the simple rivals")
    demo.add_argument("--out", type=Path, default=Path("skhybrid-demo"), help="folder to write to (%(default)s)")
    demo.add_argument("--quick", action="store_true", help="shorter spans, to see that it works")
    demo.add_argument("-q", "--quiet", action="store_true", help="no progress on stderr")
    demo.set_defaults(run=_demo)
    run = commands.add_parser("run", help="the same for a CSV of your own")
    run.add_argument("log", type=Path, metavar="LOG.csv", help="thermostat or meter log with one header line")
    run.add_argument("--config", type=Path, metavar="zone.toml", help="columns, network, spans (see --write-config)")
    run.add_argument("--out", type=Path, metavar="DIR", help="folder to write to")
    run.add_argument(
        "--write-config", action="store_true",
        help="propose a configuration from the columns of the log: to --config, or to stdout",
    )  # fmt: skip
    run.add_argument("-q", "--quiet", action="store_true", help="no progress on stderr")
    run.set_defaults(run=_run)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from .study import read_log, read_settings, split_log

    if arguments.write_config:
        return _write_config(arguments.log, arguments.config)
    for name in ("config", "out"):
        if getattr(arguments, name) is None:
            print(f"skhybrid: error: run needs --{name}; see skhybrid run --help.", file=sys.stderr)
            return MISUSED
    settings = read_settings(arguments.config)
    frame, report = read_log(arguments.log, settings)
    say = _Progress(arguments.quiet)
    for line in report.splitlines():
        say.note(line)
    return _study(settings, split_log(frame, settings), arguments.out, say)


def _write_config(log: Path, config: Path | None) -> int:
    from .persistence import atomic_path
    from .study import propose_settings

    text = propose_settings(log)
    if config is None:
        print(text, end="")
        return 0
    if config.exists():
        raise ValueError(f"{config} exists; choose another name or remove it.")
    with atomic_path(config) as made:
        made.write_text(text, encoding="utf-8")
    print(f"wrote {config}", file=sys.stderr)
    return 0


def _demo(arguments: argparse.Namespace) -> int:
    from .datasets import load_small_office
    from .study import Settings, split_log

    office = load_small_office()
    settings = Settings(
        name=_DEMO_NAME,
        columns={role: role for role in office.X},
        train={"start": "2018-09-03", "end": "2018-10-14"},
        test={"start": "2018-10-22", "end": "2018-11-11"},
    )
    if arguments.quick:
        settings = replace(
            settings,
            train={"start": "2018-09-24", "end": "2018-10-14"},
            test={"start": "2018-10-15", "end": "2018-10-21"},
        )
    frame = office.X.loc[:_DEMO_END]
    return _study(settings, split_log(frame, settings), arguments.out, _Progress(arguments.quiet), office.heat_gain)


def _study(settings: Settings, data: StudyData, out: Path, say: _Progress, truth: pd.Series | None = None) -> int:
    from .study import format_table, run_study, write_outputs

    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out} is a file; give a folder.")
    nearest = next(p for p in out.absolute().parents if p.exists())  # told now, not after minutes of work
    if not nearest.is_dir() or not os.access(out if out.exists() else nearest, os.W_OK):
        raise ValueError(f"--out {out} cannot be written to; give another folder.")
    result = run_study(settings, data, say)
    written = write_outputs(result, out, truth=None if truth is None else truth.reindex(result.zeta.index))
    for text in result.warnings:
        say.note(f"warning: {_one_line(text)}")
    print(format_table(result.table))
    print(f"\n{out}{os.sep}: {', '.join(path.name for path in written)}")
    return 0


#: signals that have come in
_STOPS: list[int] = []


def _stop(number: int, frame: Any) -> None:
    """Stop now; a compiler's callback may swallow that, so that the next step looks once more."""
    _STOPS.append(number)
    raise KeyboardInterrupt


class _Progress:
    """Steps on stderr, each with the time since the beginning."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.begun = time.perf_counter()

    def __call__(self, number: int, total: int, text: str) -> None:
        self.note(f"[{number}/{total}] {time.perf_counter() - self.begun:6.1f} s  {text}")

    def note(self, text: str) -> None:
        if _STOPS:
            raise KeyboardInterrupt
        if not self.quiet:
            print(text, file=sys.stderr, flush=True)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())
