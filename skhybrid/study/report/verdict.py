"""The verdict on a comparison, in one sentence."""

from __future__ import annotations

import pandas as pd

#: relative differences below this are noise with a few dozen origins
_NOISE = 0.05


def verdict(table: pd.DataFrame, label: str = "hybrid") -> str:
    """Say in one sentence how one model compares with the best of the others.

    Parameters
    ----------
    table : DataFrame
        Index = model; column ``rmse`` [K].
    label : str
        The model that is compared with the others.

    Returns
    -------
    str
    """
    own = float(table["rmse"][label])
    others = table["rmse"].drop(label).dropna()
    if others.empty:
        return f"The day-ahead temperature error of the {label} model is {own:.2f} K (RMSE)."
    other, best = str(others.idxmin()), float(others.min())
    if own < best * (1 - _NOISE):
        less = f"{1 - own / best:.0%} less than the next best, {other} ({best:.2f} K)"
        return f"The {label} model forecasts best: its error is {own:.2f} K, {less}."
    if own <= best * (1 + _NOISE):
        return f"The {label} model ({own:.2f} K) and {other} ({best:.2f} K) forecast equally well, within the noise."
    return (
        f"Another model forecasts better here: the error of {other} is {best:.2f} K, of the {label} model {own:.2f} K."
    )
