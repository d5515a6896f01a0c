"""The command line: ``skhybrid demo`` and ``skhybrid run``."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from ._output import DONE, FAILED, end_on_signals, is_stopped, one_line, report_error, report_stop, stop_on_signals

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line with the given arguments, by default those of the process.

    Returns 0: done; 1: the input was refused or could not be read, with one line on stderr that says why; 2: the
    command line was misused; 130: it was interrupted (Ctrl-C or SIGTERM), and no file is half written.
    """
    if argv is not None or threading.current_thread() is not threading.main_thread():
        return _run(argv)
    try:
        stop_on_signals()  # before the imports of a command, which take seconds
        code = _run(argv)
    except (KeyboardInterrupt, SystemExit):
        code = report_stop()
    end_on_signals(code)
    return code


def _run(argv: Sequence[str] | None) -> int:
    """Run the command line and return its exit code."""
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as stop:  # argparse has said why
        return report_stop() if is_stopped() else int(stop.code or DONE)
    try:
        return int(arguments.execute(arguments))
    except (KeyboardInterrupt, SystemExit):
        return report_stop()
    except Exception as error:
        if is_stopped():  # it may have arrived inside an import, or have ended a worker
            return report_stop()
        if not isinstance(error, ValueError | TypeError | OSError | ImportError):
            raise
        report_error(one_line(error))
        return FAILED


def _parser() -> Any:
    # imported here, since signals are handled by now; a command has ``add_parser(commands)`` and ``execute(arguments)``
    import argparse

    from .. import __version__
    from . import demo, run

    modules = (demo, run)
    parser = argparse.ArgumentParser(
        prog="skhybrid", description="Day-ahead forecast of room temperature and heating/cooling load from a log."
    )
    parser.add_argument("--version", action="version", version=f"skhybrid {__version__}")
    names = ",".join(command.__name__.rpartition(".")[2] for command in modules)
    commands = parser.add_subparsers(dest="command", required=True, metavar=f"{{{names}}}")
    for command in modules:
        command.add_parser(commands)
    return parser
