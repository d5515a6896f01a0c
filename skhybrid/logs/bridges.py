"""Rows between outages, and bridges over outages: inputs that are interpolated, and no temperature."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd


def stretches(rows: pd.DataFrame, longest: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between distances of more than the ``longest``, in their order; a step is the least."""
    breaks = np.flatnonzero(rows.index.to_series().diff() > longest)
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]


def bridged(rows: pd.DataFrame, step: pd.Timedelta, measured: Sequence[str], held: Sequence[str]) -> pd.DataFrame:
    """Rows at every step: where an input was not known it is interpolated, and no temperature is known there.

    What was measured in an outage stays, such as the weather while the meter of the heat is silent.  ``measured`` are
    the columns of temperatures, ``held`` those that keep their last value.
    """
    whole = rows.reindex(pd.date_range(rows.index[0], rows.index[-1], freq=step))
    whole = whole.assign(**{role: whole[role].ffill() for role in held if role in whole})
    inputs = whole.drop(columns=list(measured))
    out = inputs.isna().any(axis=1)
    if not out.any():
        return rows
    filled = inputs.interpolate("time")
    return whole.assign(
        **{str(role): filled[role] for role in filled}, **{role: whole[role].mask(out) for role in measured}
    )
