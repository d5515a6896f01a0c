"""Options that several commands share, and how a command runs: its warnings, its JSON and its exit code."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import click

from .._files import write_text
from .._json import strict_json
from ._output import DONE, FAILED, Progress, one_line

MOST_DAYS, MOST_JOBS = 36_500, 4096  # a century; above them a number is a slip of the pen
PATH = click.Path(path_type=Path)
LOG = click.argument("log", metavar="LOG", type=click.Path())  # or a URL; the type completes names of files
DIR = click.argument("folder", metavar="DIR", type=PATH)


def log_option(text: str) -> Callable[[Any], Any]:
    """The option ``--log`` with its help."""
    return click.option("--log", type=click.Path(), required=True, metavar="LOG", help=text)


def _config(remark: str = "") -> Callable[[Any], Any]:
    text = f"Configuration of the log; skhybrid check LOG --config zone.toml proposes one.{remark}"
    return click.option("--config", type=PATH, metavar="zone.toml", help=text)


CONFIG_IF_ANY = _config()
CONFIG = _config("  [required]")  # click's own error would not say how to get one: see settings_at
SETPOINT = click.option(
    "--setpoint",
    multiple=True,
    help="Heating and cooling set-point [degC]: 21,24; by the clock: '6:00=21,22:00=17;24'; of one zone of several: "
    "hall:21,24.  Repeat the option for each zone.",
)
WEATHER = click.option(
    "--weather",
    type=PATH,
    help="Weather to come: a table as of a log (with set-points, if it has them), EPW, or Open-Meteo's JSON or CSV.",
)
#: options that name files, in words
_FILES = {"log": "the log", "source": "the source", "weather": "the weather"}
_FILES |= {name: f"--{name}" for name in ("config", "model", "out")}
MODEL = click.option("--model", type=PATH, metavar="zone.skops", required=True, help="Model file.")


class InOrder(click.Group):
    """Commands as a user needs them, not by the alphabet."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.commands)


def as_command(name: str, example: str) -> Callable[[Callable[..., None]], click.Command]:
    """A command with ``--json``, ``--strict`` and ``--quiet``, whose help ends with an example.

    The function gets ``say`` (a :class:`Progress`) and ``as_json`` besides its own options.  Warnings are written to
    stderr, once each.
    """

    def decorate(function: Callable[..., None]) -> click.Command:
        @functools.wraps(function)
        def run(*, as_json: bool, strict: bool, quiet: bool, **options: Any) -> int:
            say = Progress(quiet)
            _refuse_one_file_twice(options)
            if options.get("weather") is not None:  # which is read after minutes of work, or at the first post
                from ..logs.text_files import existing

                existing(options["weather"])
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                try:
                    function(say=say, as_json=as_json, **options)
                finally:
                    told = [one_line(w.message) for w in caught if issubclass(w.category, UserWarning)]
                    texts = list(dict.fromkeys(told))
                    for text in texts:
                        say.note(f"warning: {text}")
            return FAILED if strict and (texts or say.n_warnings) else DONE

        for option in (
            click.option("-q", "--quiet", is_flag=True, help="Write no progress and no warnings to stderr."),
            click.option("--strict", is_flag=True, help="Exit with code 1 if there is any warning."),
            click.option("--json", "as_json", is_flag=True, help="Write the result to stdout as JSON."),
        ):
            run = option(run)
        made = click.command(name, epilog=_epilog(example))(run)
        made.params = made.params[3:] + made.params[:3]  # help begins with what only this command has
        return made

    return decorate


def _refuse_one_file_twice(options: Mapping[str, Any]) -> None:
    """Refuse one file for two options, which would be written over what is read; a log may have the weather to come."""
    named = {words: Path(options[name]).resolve() for name, words in _FILES.items() if options.get(name) is not None}
    for one, other in combinations(named, 2):
        if named[one] == named[other] and {one, other} != {_FILES["log"], _FILES["weather"]}:
            raise click.UsageError(f"{named[one]} is named as {one} and as {other}; give each a file of its own")


def as_group(name: str, commands: Sequence[click.Command], summary: str, example: str) -> InOrder:
    """A group of commands, whose help ends with an example."""
    return InOrder(name, commands=list(commands), help=summary, epilog=_epilog(example), no_args_is_help=False)


def _epilog(example: str) -> str:
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in example.splitlines())


def print_json(content: Any) -> None:
    """Write plain values to stdout as JSON; a NaN is null.  A program that reads them from a pipe need not wait."""
    print(strict_json(content), flush=True)


def print_values(found: Mapping[str, Any], as_json: bool) -> None:
    """Write values by name to stdout, as JSON or one per line."""
    print_json(found) if as_json else print("\n".join(lines_of(found)))


def lines_of(found: Mapping[str, Any], indent: str = "") -> list[str]:
    """Values by name, one per line; what a mapping or a list holds stands below its name."""
    lines = []
    for name, value in found.items():
        if isinstance(value, list | tuple):
            lines += [f"{indent}{name}:" + ("" if value else " -"), *(f"{indent}  - {item}" for item in value)]
            continue
        nested = isinstance(value, dict) and value
        lines.append(f"{indent}{name}:" + ("" if nested else " -" if value in (None, {}) else f" {value}"))
        lines += lines_of(value, indent + "  ") if nested else []
    return lines


def write_out(out: Path, text: str, say: Progress) -> None:
    """Write a file, and say so."""
    write_text(out, text)
    say.note(f"wrote {out}")


def settings_at(config: Path | None, *, several: bool = False) -> Any:
    """The settings of a file, which are refused where they have several zones, unless ``several``.

    Without a file a usage error says how to get one.
    """
    from ..study import read_settings

    if config is None:
        raise click.UsageError("--config is missing: skhybrid check LOG --config zone.toml proposes one")
    settings = read_settings(config)
    if not several:
        refuse_zones(settings, config)
    return settings


def refuse_zones(settings: Any, source: Any) -> None:
    """Refuse settings of several zones."""
    if settings.zones:
        raise ValueError(
            f"{source} describes several zones ({', '.join(settings.zones)}), and this command is for one; give a "
            "configuration of one of them, with T_za."
        )
