"""What a table of results says, in a sentence."""

from __future__ import annotations

import pandas as pd

#: differences below this are noise at a few dozen origins.
_NOISE = 0.05


def verdict(table: pd.DataFrame, label: str = "hybrid") -> str:
    """Say how one model compares with the best of the others.

    Parameters
    ----------
    table : DataFrame
        Index = model; column ``rmse`` [K].
    label : str
        The model that is spoken of.

    Returns
    -------
    str
        One sentence.
    """
    own = float(table["rmse"][label])
    others = table["rmse"].drop(label).dropna()
    if others.empty:
        return f"The {label} model misses the day-ahead temperature by {own:.2f} K (RMSE)."
    rival, best = str(others.idxmin()), float(others.min())
    if own < best * (1 - _NOISE):
        less = f"{1 - own / best:.0%} less than the next, {rival} ({best:.2f} K)"
        return f"The {label} model forecasts best: {own:.2f} K, {less}."
    if own <= best * (1 + _NOISE):
        return f"The {label} model ({own:.2f} K) and {rival} ({best:.2f} K) forecast equally well within the noise."
    return f"A rival forecasts better here: {rival} misses by {best:.2f} K, the {label} model by {own:.2f} K."
