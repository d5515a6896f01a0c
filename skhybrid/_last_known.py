"""Series and tables in which values are missing: the last known ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd


def last_known_row(known: np.ndarray, before: int = -1) -> np.ndarray:
    """Number of the last ``known`` row (n,) up to each one, and ``before`` where there is none yet, (n,) int."""
    return np.maximum.accumulate(np.where(known, np.arange(len(known)), before))


def carried_forward(values: np.ndarray) -> np.ndarray:
    """Values (n,) in which the last known one stands where one is missing; NaN before the first."""
    return values[last_known_row(np.isfinite(values), before=0)]


def up_to_last_known(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """The rows of a table up to the last in which one of some columns is known; none where all are missing."""
    return rows[rows[list(columns)].bfill().notna().any(axis=1)]


def held_paths(paths: np.ndarray) -> np.ndarray:
    """Paths (n_origins, n_leads) in which a missing value is the last known one, or the first where none came before.

    A path of which nothing is known is 0.
    """
    return pd.DataFrame(paths).ffill(axis=1).bfill(axis=1).fillna(0.0).to_numpy()
