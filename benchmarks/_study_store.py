"""Reading what the study has kept, while it runs or after."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pandas as pd

_COLUMNS = ["id", "rmse", "fit_time", "score_time", "n_epochs", "error", "finished"]


def read_results(path: Path) -> pd.DataFrame:
    """One row a finished candidate of a store (empty where there is none); nothing is written."""
    if not path.is_file():
        return pd.DataFrame(columns=_COLUMNS)
    query = "SELECT candidate, rmse, fit_time, score_time, n_epochs, error, finished FROM result WHERE split = 0"
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=60.0)) as db:
        return pd.DataFrame(db.execute(query).fetchall(), columns=_COLUMNS)


def n_finished(path: Path) -> int:
    """How many candidates of a store are finished."""
    return len(read_results(path))
