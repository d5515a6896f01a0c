"""Heating and cooling of a day, with intervals by paths of its load."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._warnings import ignore, warnings_to
from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import INTERVAL

_SAMPLES = 200  # paths of a day, whose sums make an interval
_SIGNS = {"heating": 1.0, "cooling": -1.0}  # of a load


class Energy(NamedTuple):
    """Energy that a plant gives or takes in a day."""

    kind: str  # heating or cooling
    value: float  # [kWh]
    interval: tuple[float, float] | None  # that holds it with 80 %, of the larger kind where paths are known [kWh]

    def card(self) -> tuple[str, str]:
        """Value and words for a report."""
        words = f"{self.kind} needed that day"
        if self.interval is not None:
            words += "; 80 % interval {:.0f} to {:.0f} kWh".format(*self.interval)
        return f"{self.value:.0f}\u00a0kWh", words


def day_energy(load: pd.Series, paths: pd.Series | None = None) -> list[Energy]:
    """Heating, and cooling where there is any, of a load [kW], cooling negative.

    ``paths`` of the load are as :func:`paths_of_load` draws them.
    """
    hours = (load.index[1] - load.index[0]) / pd.Timedelta("1h") if len(load) > 1 else 1.0
    sums = {kind: float(load.mul(sign).clip(lower=0.0).sum() * hours) for kind, sign in _SIGNS.items()}
    larger, interval = max(sums, key=sums.__getitem__), None
    if paths is not None:
        interval = interval_of(paths.mul(_SIGNS[larger]).clip(lower=0.0).groupby("sample").sum() * hours)
    shown = [kind for kind in sums if kind == "heating" or round(sums[kind], 2)]
    return [Energy(kind, sums[kind], interval if kind == larger else None) for kind in shown]


def energy_of_zones(loads: pd.DataFrame, paths: pd.DataFrame | None = None) -> list[Energy]:
    """Heating and cooling of the day by the loads of all zones together [kW], and their ``paths``."""
    if loads.empty or len(loads) < 2:
        return []
    return day_energy(loads.sum(axis=1), None if paths is None else paths[list(loads)].sum(axis=1))


def paths_of_load(model: Any, history: pd.DataFrame, future: pd.DataFrame, **given: Any) -> pd.DataFrame | None:
    """Paths of a day's loads [kW] by ``sample`` and time, which a predictor draws; None where it has no intervals."""
    try:
        with warnings_to(ignore):  # the forecast has told them
            paths = model.sample(history, future, _SAMPLES, random_state=0, **given)
    except TooFewDaysError:
        return None
    return pd.DataFrame(paths.filter(like="Q_hvac"))


def interval_of(drawn: pd.Series | np.ndarray) -> tuple[float, float]:
    """Ends of the interval that holds a quantity with 80 %, by values of it that were drawn."""
    low, high = np.quantile(drawn, INTERVAL).tolist()
    return low, high
