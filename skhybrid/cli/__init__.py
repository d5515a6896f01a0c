"""The command line: one module per command."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from ._output import (
    DONE,
    FAILED,
    MISUSED,
    end_on_signals,
    is_stopped,
    one_line,
    report_error,
    report_stop,
    stop_on_signals,
)

__all__ = ["main"]

#: modules of the commands, in the order in which a user needs them
_COMMANDS = (
    "check", "fit", "forecast", "update", "backtest", "identify", "run", "report", "search", "zone", "fleet", "serve",
    "export", "demo",
)  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line with the given arguments, by default those of the process.

    Returns 0: done; 1: the input was refused or could not be read, with one line on stderr that says why, or with
    ``--strict`` something was warned of; 2: the command line was misused; 130: it was interrupted (Ctrl-C or SIGTERM),
    and no file is half written.
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
    import click  # here, since signals are handled by now

    try:
        found = _group().main(None if argv is None else list(argv), prog_name="skhybrid", standalone_mode=False)
        return int(found or DONE)
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.UsageError as error:
        report_error(_misuse(error))
        return MISUSED
    except SystemExit as end:  # by a signal, or after click has written what completes a word
        return report_stop() if is_stopped() else int(end.code or DONE)
    except (KeyboardInterrupt, click.Abort):
        return report_stop()
    except Exception as error:
        if is_stopped():  # it may have arrived inside an import, or have ended a worker
            return report_stop()
        if not isinstance(error, ValueError | TypeError | OSError | ImportError):
            raise
        report_error(one_line(error))
        return FAILED


def _misuse(error: Any) -> str:
    """An error of the command line in a sentence; for an option that is none, those there are, not close spellings."""
    import click

    where, said = error.ctx, error.format_message()
    if where is not None and isinstance(error, click.NoSuchOption):
        options = [option for one in where.command.params for option in one.opts if option.startswith("--")]
        said, hint = error.message, f"; {where.command_path} takes {', '.join([*options, '--help'])}"
    else:
        hint = "" if where is None else f"; see {where.command_path} --help"
    return f"{one_line(said).removesuffix('.')}{hint}."


def _group() -> Any:
    """The commands, each loaded when it is called or asked for help."""
    from importlib import import_module

    import click

    from .. import __version__

    class Commands(click.Group):
        def list_commands(self, ctx: click.Context) -> list[str]:
            return list(_COMMANDS)

        def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
            return import_module(f".{name}", __name__).command if name in _COMMANDS else None

    doc = (
        "Day-ahead forecast of room temperature and heating or cooling load from a log.\n\n"
        "\b\nA log to tomorrow's forecast:\n"
        "  skhybrid check LOG --config zone.toml\n"
        "  skhybrid fit LOG --config zone.toml --model zone.skops\n"
        "  skhybrid forecast --model zone.skops --log LOG --weather WEATHER --setpoint 21,24"
    )
    context = {"help_option_names": ["-h", "--help"], "show_default": True}  # of all commands
    group = Commands("skhybrid", help=doc, no_args_is_help=False, context_settings=context)
    return click.version_option(__version__, message="skhybrid %(version)s")(group)
