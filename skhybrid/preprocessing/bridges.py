"""Complete rows, those between outages, and bridges over outages: inputs that are interpolated, and no temperature."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from .._table import is_plant


def stretches(rows: pd.DataFrame, longest: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between distances of more than the ``longest``, in their order; a step is the least."""
    breaks = np.flatnonzero(rows.index.to_series().diff() > longest)
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]


def complete(rows: pd.DataFrame, measured: Sequence[str]) -> pd.DataFrame:
    """Rows with every input, whether the zones' temperatures are ``measured`` there or not."""
    return rows[rows.drop(columns=list(measured)).notna().all(axis=1)]


def bridged(rows: pd.DataFrame, step: pd.Timedelta, measured: Sequence[str], held: Sequence[str]) -> pd.DataFrame:
    """Rows at every step: where an input was not known it is interpolated, and no temperature is known there.

    ``measured`` are the columns of temperatures, ``held`` those that keep their last value.
    """
    whole = rows.reindex(pd.date_range(rows.index[0], rows.index[-1], freq=step))
    whole = whole.assign(**{role: whole[role].ffill() for role in held if role in whole})
    inputs = with_known_heat(whole.drop(columns=[*measured, *held], errors="ignore"))
    out = inputs.isna().any(axis=1)
    if not out.any():
        return rows
    filled = inputs.interpolate("time")
    return whole.assign(
        **{str(role): filled[role] for role in filled}, **{role: whole[role].mask(out) for role in measured}
    )


def with_known_heat(inputs: pd.DataFrame) -> pd.DataFrame:
    """Inputs by role, but none of rows whose heat is not known.

    What was measured while the weather was out stays.  A guess of the heat goes with a guess of the weather: with the
    measured one, forecasts are worse.
    """
    return inputs.mask(inputs[[role for role in inputs if is_plant(role)]].isna().any(axis=1))
