"""Reader of the results that the study has stored, while it runs or afterwards."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pandas as pd

_COLUMNS = ["id", "rmse", "fit_time", "score_time", "n_epochs", "error", "finished"]


def read_results(path: Path) -> pd.DataFrame:
    """One row per finished candidate of a store, read-only; empty if there is no store."""
    if not path.is_file():
        return pd.DataFrame(columns=_COLUMNS)
    query = "SELECT candidate, rmse, fit_time, score_time, n_epochs, error, finished FROM result WHERE split = 0"
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=60.0)) as db:
        return pd.DataFrame(db.execute(query).fetchall(), columns=_COLUMNS)


def n_finished(path: Path) -> int:
    """Number of finished candidates of a store."""
    return len(read_results(path))
