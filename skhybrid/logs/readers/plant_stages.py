"""Running times of the stages of a plant, as one running time at full load."""

from __future__ import annotations

import numpy as np
import pandas as pd

#: share of the full capacity that the first of two stages has, of furnaces and of compressors: the values that the
#: EPA's software for connected thermostats takes (github.com/EPAENERGYSTAR/epathermostat)
FURNACE_LOW, COMPRESSOR_LOW = 0.65, 0.72


def full_load(stages: pd.DataFrame, longest: float, low: float) -> tuple[np.ndarray, str]:
    """Running time at full load (n,) of a plant whose stages are columns, lowest first, and how it was counted.

    ``longest`` is the length of a row, ``low`` the share of the first of two stages; three and more count as equal.
    A lower stage runs on while a higher one does, or only the highest is counted: the values show which.
    """
    values = stages.to_numpy(np.float64)
    ran = np.flatnonzero((values > 0.0).any(axis=0))
    n = max(2, int(ran[-1]) + 1) if len(ran) else 2
    known, values = np.isfinite(values).any(axis=1), np.nan_to_num(values[:, :n])
    shares = np.array([low, 1.0]) if n == 2 else np.arange(1.0, n + 1.0) / n
    upper = values[:, 1] > 0.0
    together = bool((values.sum(axis=1) > 1.02 * longest).any() or (upper.any() and (values[upper, 0] > 0.0).all()))
    alone = values.copy()
    if together:
        alone[:, :-1] = (values[:, :-1] - values[:, 1:]).clip(min=0.0)
    shown = ", ".join(f"{share:.2g}" for share in shares)
    how = "lower stages run on with higher ones" if together or not upper.any() else "only the highest stage is counted"
    return np.where(known, alone @ shares, np.nan), f"at {shown} of the full capacity ({how})"
