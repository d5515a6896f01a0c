"""A study from the command line: run it, write its files, print its table."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd

from ..study import Settings, StudyData, StudyResult, read_log, run_study, split_log, write_outputs
from ..study.outputs import format_result, metrics_text
from ..study.results import BuildingResult
from ..zone.dead_meters import part_without_dead_meters
from ._output import Progress, check_stopped


def study_to_folder(
    settings: Settings,
    data: StudyData,
    out: Path,
    progress: Progress,
    heat_gain: pd.Series | None = None,
    *,
    as_json: bool = False,
) -> None:
    """Run a study, write its files to a folder (with the true ``heat_gain`` [kW]), print its table."""
    refuse_unwritable(out)
    result = run_study(settings, data, progress)
    written = write_outputs(result, out, truth=heat_gain, before_swap=check_stopped)
    print_result(result, progress, f"{out}{os.sep}: {', '.join(path.name for path in written)}", as_json=as_json)


def read_study(log: str, settings: Settings, progress: Progress) -> StudyData:
    """A log in its spans, with notes on what was read."""
    frame, report = read_log(log, settings)
    for line in report.splitlines():
        progress.note(line)
    alive, remarks = part_without_dead_meters(frame, settings)
    data = split_log(alive, settings)
    return data._replace(remarks=(*remarks, *data.remarks))


def print_result(result: StudyResult | BuildingResult, progress: Progress, written: str, *, as_json: bool) -> None:
    """Print the warnings, the verdicts and the comparison of a study, and what was written."""
    for text in result.warnings:
        progress.warn(text)
    if as_json:
        print(metrics_text(result))
    else:
        print("\n".join([*map(str, result.verdicts), "", format_result(result), "", written]))


def refuse_unwritable(out: Path | None, kind: str = "folder", option: str = "--out") -> None:
    """Refuse a folder or a file that cannot be written to, before minutes of work and not after them."""
    if out is None:
        return
    if out.exists() and out.is_dir() != (kind == "folder"):
        raise ValueError(f"{option} {out} is a {'file' if kind == 'folder' else 'folder'}; give a {kind}.")
    nearest = next(p for p in out.absolute().parents if p.exists())
    if not nearest.is_dir() or not os.access(out if out.exists() else nearest, os.W_OK):
        raise ValueError(f"{option} {out} cannot be written to; give another {kind}.")
