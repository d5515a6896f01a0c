"""Rows between outages, and bridges over outages: interpolated inputs, and no temperature."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd


def stretches(rows: pd.DataFrame, longest: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between distances of more than the ``longest``, in their order; a step is the least."""
    breaks = np.flatnonzero(rows.index.to_series().diff() > longest)
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]


def bridged(
    parts: Sequence[pd.DataFrame], step: pd.Timedelta, measured: Sequence[str], held: Sequence[str]
) -> pd.DataFrame:
    """Stretches of rows as one: in between the inputs are interpolated, and no temperature is known.

    ``measured`` are the columns of temperatures that stay missing there, ``held`` those that keep their last value.
    """
    if len(parts) == 1:
        return parts[0]
    index = pd.date_range(parts[0].index[0], parts[-1].index[-1], freq=step)
    whole = pd.concat(parts).reindex(index)
    whole = whole.assign(**{role: whole[role].ffill() for role in held if role in whole})
    inputs = whole.drop(columns=list(measured)).interpolate("time")
    return whole.assign(**{str(role): inputs[role] for role in inputs})
