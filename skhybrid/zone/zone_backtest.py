"""Back-test of the predictor of some settings on the last weeks of a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..model_selection import backtest
from ..study.compared_models import HYBRID, YESTERDAY, make_models
from ..study.data import StudyData
from ..study.judgement import judge_temperature
from ..study.run import INTERVAL
from ..study.settings import Settings
from ..study.verdict import Verdict

#: what the predictor is compared with, apart from the rules for the load
_COMPARED = (HYBRID, "ARX re-fitted", YESTERDAY)


class ZoneBacktest(NamedTuple):
    """Errors of a zone's predictor and of simple models."""

    table: pd.DataFrame  # index: model; rmse and mae [K]
    frame: pd.DataFrame  # every forecast of the predictor
    coverage: float | None  # share inside the 80 % intervals
    verdict: Verdict  # on the temperature


def backtest_zone(
    settings: Settings, data: StudyData, progress: Callable[[int, int, str], None] | None = None
) -> ZoneBacktest:
    """Fit on the training rows, forecast from every origin of the test, and compare.

    Parameters
    ----------
    settings : Settings
    data : StudyData
    progress : callable, optional, called with (number, total, text) before every step
    """
    models = [one for one in make_models(settings) if one.label in _COMPARED]
    frames: dict[str, pd.DataFrame] = {}
    for number, one in enumerate(models, 1):
        if progress is not None:
            progress(number, len(models), f"{one.label}: fit and back-test")
        frames[one.label] = _forecasts(one.estimator, one.label, settings, data)
    errors = pd.DataFrame({name: frame["y_pred"] - frame["y_true"] for name, frame in frames.items()}).dropna()
    if errors.empty:
        raise ValueError("no forecast of the test span meets a measurement; choose another [test] span.")
    table = pd.DataFrame({"rmse": np.sqrt((errors**2).mean()), "mae": errors.abs().mean()})
    own = frames[HYBRID]
    low, high = (f"q_{level:g}" for level in INTERVAL)
    known = own.dropna(subset="y_true")
    coverage = float(known["y_true"].between(known[low], known[high]).mean()) if low in own else None
    verdict = judge_temperature(own, frames[YESTERDAY], data, coverage)
    return ZoneBacktest(table.sort_values("rmse").rename_axis("model"), own, coverage, verdict)


def _forecasts(estimator: Any, label: str, settings: Settings, data: StudyData) -> pd.DataFrame:
    model = estimator.fit(data.train, data.train["T_za"])
    given: dict[str, Any] = {
        "horizon": settings.horizon,
        "origin_step": settings.origin_step,
        "start": data.test_start,
    }
    if label == HYBRID:
        try:
            return backtest(model, data.later, data.later["T_za"], quantiles=INTERVAL, **given)
        except ValueError as error:
            if "interval" not in str(error):
                raise
    return backtest(model, data.later, data.later["T_za"], **given)
