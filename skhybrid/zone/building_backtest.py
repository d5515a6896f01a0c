"""Back-test of a building of several zones: with neighbours, each zone by itself, and as yesterday."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..hybrid import BuildingPredictor
from ..model_selection import backtest
from ..study.compared_models import HYBRID, YESTERDAY, Yesterday, make_models
from ..study.data import train_and_test, with_facades
from ..study.judgement import judge_temperature
from ..study.settings import Settings
from .zone_backtest import ZoneBacktest
from .zone_model import complete_rows

ALONE = "hybrid, each zone by itself"


def backtest_building(
    settings: Settings, frame: pd.DataFrame, progress: Callable[[int, int, str], None] | None = None
) -> ZoneBacktest:
    """Fit on the training rows, forecast from every origin of the test, and compare, zone by zone.

    Parameters
    ----------
    settings : Settings, of several zones
    frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
    progress : callable, optional, called with (number, total, text) before every step

    Returns
    -------
    ZoneBacktest
        Errors of all zones together and of each; without loads and intervals.
    """
    measured = settings.roles_of("T_za")
    rows = complete_rows(with_facades(frame, settings), measured)
    train, test = train_and_test(rows, settings)
    later = rows.loc[train.index[-1] : test.index[-1]].iloc[1:]
    say = progress or (lambda number, total, text: None)
    say(1, 2, "fit of all zones")
    building = BuildingPredictor(make_models(settings)[0].estimator, adjacency=settings.adjacency)
    building.fit(train, train[measured])
    say(2, 2, "back-test")
    own = [(model, later) for model in building.own_.values()]
    rule = [(Yesterday().fit(later, train[role]), later.assign(T_za=later[role])) for role in measured]
    made = {HYBRID: _Paths([(building, later)]), ALONE: _Paths(own), YESTERDAY: _Paths(rule)}
    frames = {name: _frame(paths, settings, later, test.index[0]) for name, paths in made.items()}
    of = {name: dict(iter(found.groupby("zone", sort=False))) for name, found in frames.items()}
    verdicts = [
        judge_temperature(of[HYBRID][zone], of[YESTERDAY][zone])._replace(quantity=f"temperature of {zone}")
        for zone in settings.zones
    ]
    return ZoneBacktest(_table(frames), frames[HYBRID], None, tuple(verdicts), "")


class _Paths(BaseEstimator):
    """Forecasts of all zones by predictors of one or of all; a back-test sees the first zone's."""

    def __init__(self, parts: list[tuple[Any, pd.DataFrame]]) -> None:
        self.parts = parts

    def __sklearn_is_fitted__(self) -> bool:
        return True

    def fit(self, X: Any, y: Any = None) -> _Paths:
        """Nothing: the predictors are fitted."""
        return self

    def predict_from(self, X: Any, origins: np.ndarray, horizon: Any = None) -> np.ndarray:
        """(n_origins, n_leads) of the first zone."""
        found = [model.predict_from(rows, origins, horizon) for model, rows in self.parts]
        self.paths_ = found[0] if found[0].ndim == 3 else np.stack(found, axis=-1)
        return self.paths_[..., 0]


def _frame(model: _Paths, settings: Settings, later: pd.DataFrame, start: pd.Timestamp) -> pd.DataFrame:
    """The back-test of all zones, with a column ``zone``."""
    given: dict[str, Any] = {"horizon": settings.horizon, "origin_step": settings.origin_step, "start": start}
    measured = settings.roles_of("T_za")
    first = backtest(model, later, later[measured[0]], **given)
    parts = []
    for j, (zone, role) in enumerate(zip(settings.zones, measured, strict=True)):
        true = later[role].reindex(first["time"]).to_numpy()
        parts.append(first.assign(y_true=true, y_pred=model.paths_[..., j].ravel()))
        parts[-1].insert(0, "zone", zone)
    return pd.concat(parts, ignore_index=True)


def _table(frames: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Errors by model, of all zones together and of each zone."""
    errors = pd.DataFrame({name: frame["y_pred"] - frame["y_true"] for name, frame in frames.items()})
    zone = next(iter(frames.values()))["zone"][errors.notna().all(axis=1)]
    errors = errors.dropna()
    if errors.empty:
        raise ValueError("no forecast of the test span meets a measurement; choose another [test] span.")
    of_each = ((errors**2).groupby(zone, sort=False).mean() ** 0.5).T.add_prefix("rmse_")
    of_all = pd.DataFrame({"rmse": np.sqrt((errors**2).mean()), "mae": errors.abs().mean()})
    return of_all.join(of_each).sort_values("rmse").rename_axis("model")
