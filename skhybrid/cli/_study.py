"""A study from the command line: run it, write its files, print its table."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd

from ..study import Settings, StudyData, StudyResult, run_study, write_outputs
from ..study.outputs import format_table
from ._output import DONE, Progress, check_stopped


def study_to_folder(
    settings: Settings,
    data: StudyData,
    out: Path,
    progress: Progress,
    heat_gain: pd.Series | None = None,
    *,
    as_json: bool = False,
) -> int:
    """Run a study, write its files to a folder (with the true ``heat_gain`` [kW]), print its table; the exit code."""
    refuse_unwritable(out)
    result = run_study(settings, data, progress)
    truth = None if heat_gain is None else heat_gain.reindex(result.zeta.index)
    written = write_outputs(result, out, truth=truth, before_swap=check_stopped)
    for text in result.warnings:
        progress.warn(text)
    if as_json:
        print((out / "metrics.json").read_text(encoding="utf-8"))
        return DONE
    print_result(result)
    print(f"\n{out}{os.sep}: {', '.join(path.name for path in written)}")
    return DONE


def print_result(result: StudyResult) -> None:
    """Print the verdicts and the comparison of a study."""
    print("\n".join(map(str, result.verdicts)) + "\n")
    print(format_table(result.table, scaled=result.scaled))


def refuse_unwritable(out: Path, kind: str = "folder") -> None:
    """Refuse a folder, or a file, before minutes of work, not after them."""
    if out.exists() and out.is_dir() != (kind == "folder"):
        raise ValueError(f"--out {out} is a {'file' if kind == 'folder' else 'folder'}; give a {kind}.")
    nearest = next(p for p in out.absolute().parents if p.exists())
    if not nearest.is_dir() or not os.access(out if out.exists() else nearest, os.W_OK):
        raise ValueError(f"--out {out} cannot be written to; give another {kind}.")
