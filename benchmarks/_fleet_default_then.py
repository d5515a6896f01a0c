"""Errors of an earlier version's default on the new zones of the study of fleet priors, kept in ``data``.

Rows are read by today's package.  This file, run as a script with an earlier version on ``PYTHONPATH``, scores them in
a process of its own and imports nothing of today's.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

THEN = "the default of 2026-11-22"
PATH = Path(__file__).parent / "data" / "fleet_default_2026_11_22.csv"
_HEAD = """\
# RMSE [K] of the default of 2026-11-22 (commit c9fddf9d), without clipping and daily profile, on the new zones of the
# study of fleet priors; empty where it refuses the training, with its message.
# Made by "python benchmarks/fleet_prior.py --buildings FOLDER --default-at WORKTREE", where WORKTREE is that commit,
# checked out, on logs of make_buildings.py and make_step_tests.py (EnergyPlus 25.2).
"""


def errors_at(worktree: Path, cases: list[tuple[pd.DataFrame, pd.DataFrame]]) -> list[dict[str, Any]]:
    """Error of the default of a checkout after each training, on its test; ``refused`` where it learns nothing."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cases.pickle"
        pd.to_pickle(cases, path)
        command, env = [sys.executable, __file__, str(path)], os.environ | {"PYTHONPATH": str(worktree.resolve())}
        done = subprocess.run(command, env=env, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def read() -> pd.DataFrame:
    """The errors that are kept, a row per case."""
    return pd.read_csv(PATH, comment="#")


def write(table: pd.DataFrame) -> None:
    """Keep errors, completely or not at all."""
    part = PATH.with_suffix(".part")
    part.write_text(_HEAD + table.to_csv(index=False, float_format="%.4g", lineterminator="\n"), encoding="utf-8")
    part.replace(PATH)


def _error(train: pd.DataFrame, test: pd.DataFrame) -> dict[str, Any]:
    from skhybrid import HybridPredictor
    from skhybrid.model_selection import backtest

    try:
        model = HybridPredictor().fit(train, train["T_za"])
    except ValueError as error:
        return {"rmse": None, "refused": str(error)}
    frame = backtest(model, test, test["T_za"], origin_step="7h")
    return {"rmse": float(np.sqrt(np.nanmean((frame["y_pred"] - frame["y_true"]) ** 2))), "refused": None}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print(json.dumps([_error(train, test) for train, test in pd.read_pickle(sys.argv[1])]))
