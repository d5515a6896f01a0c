"""``skhybrid demo``: a study of the office log that ships with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import PATH, as_command
from ._output import Progress

_NAME = "Small office, Chicago (EnergyPlus)"
_END = "2018-11-12"  # last day of the log that is used, the day after the tested weeks
_SPANS = {"train": {"start": "2018-09-03", "end": "2018-10-14"}, "test": {"start": "2018-10-22", "end": "2018-11-11"}}
_QUICK_SPANS = {
    "train": {"start": "2018-09-24", "end": "2018-10-14"},
    "test": {"start": "2018-10-15", "end": "2018-10-21"},
}


@as_command("demo", "skhybrid demo --quick")
@click.option("--out", type=PATH, default=Path("skhybrid-demo"), help="Folder to write to.")
@click.option("--quick", is_flag=True, help="Take shorter spans, only to see that it works.")
def command(out: Path, quick: bool, say: Progress, as_json: bool) -> None:
    """Study the office log that ships with the package."""
    # imported here so that --help need not wait for it
    from ..datasets import load_small_office
    from ._study import study_to_folder

    settings, data = office_study(quick=quick)
    study_to_folder(settings, data, out, say, load_small_office().heat_gain, as_json=as_json)


def office_study(*, quick: bool = False, **settings: Any) -> tuple[Any, Any]:
    """Settings and data of the study, with further ``settings``."""
    from ..datasets import load_small_office
    from ..study import Settings, split_log

    office, spans = load_small_office(), _QUICK_SPANS if quick else _SPANS
    log = office.X.assign(T_heat_set=office.frame["set_heat"], T_cool_set=office.frame["set_cool"])
    columns = {role: role for role in log}
    study = Settings(name=_NAME, columns=columns, train=spans["train"], test=spans["test"], **settings)
    return study, split_log(log.loc[:_END], study)
