"""``skhybrid demo``: a study of the office log that ships with the package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ._output import Progress, add_quiet

_NAME = "Small office, Chicago (EnergyPlus)"
_END = "2018-11-12"  # last day of the log that is used, the day after the tested weeks
_SPANS = {"train": {"start": "2018-09-03", "end": "2018-10-14"}, "test": {"start": "2018-10-22", "end": "2018-11-11"}}
_QUICK_SPANS = {
    "train": {"start": "2018-09-24", "end": "2018-10-14"},
    "test": {"start": "2018-10-15", "end": "2018-10-21"},
}


def add_parser(commands: Any) -> None:
    """Add the command to the subparsers of ``skhybrid``."""
    parser = commands.add_parser("demo", help="forecast the log that ships with the package, next to simple baselines")
    parser.add_argument("--out", type=Path, default=Path("skhybrid-demo"), help="folder to write to (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="shorter spans, to see that it works")
    add_quiet(parser)
    parser.set_defaults(execute=execute)


def execute(arguments: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    # imported here so that --help and --version need not wait for it
    from ..datasets import load_small_office
    from ._study import study_to_folder

    settings, data = office_study(quick=arguments.quick)
    return study_to_folder(settings, data, arguments.out, Progress(arguments.quiet), load_small_office().heat_gain)


def office_study(*, quick: bool = False, **settings: Any) -> tuple[Any, Any]:
    """Settings and data of the study, with further ``settings``."""
    from ..datasets import load_small_office
    from ..study import Settings, split_log

    office, spans = load_small_office(), _QUICK_SPANS if quick else _SPANS
    columns = {role: role for role in office.X}
    study = Settings(name=_NAME, columns=columns, train=spans["train"], test=spans["test"], **settings)
    return study, split_log(office.X.loc[:_END], study)
