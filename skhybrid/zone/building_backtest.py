"""Back-test of a building of several zones: with neighbours, each zone by itself, and as yesterday."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

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
    given: dict[str, Any] = {"horizon": settings.horizon, "origin_step": settings.origin_step, "start": test.index[0]}
    frames = {
        HYBRID: backtest(building, later, later[measured], **given),
        ALONE: backtest(building.without_neighbours(), later, later[measured], **given),
    }
    rules = (
        backtest(Yesterday().fit(later, train[role]), later.assign(T_za=later[role]), later[role], **given)
        for role in measured
    )
    by_zone = zip(rules, settings.zones, strict=True)
    frames[YESTERDAY] = pd.concat([frame.assign(zone=zone) for frame, zone in by_zone], ignore_index=True)
    of = {name: dict(iter(found.groupby("zone", sort=False))) for name, found in frames.items()}
    verdicts = [
        judge_temperature(of[HYBRID][zone], of[YESTERDAY][zone])._replace(quantity=f"temperature of {zone}")
        for zone in settings.zones
    ]
    return ZoneBacktest(_table(frames), frames[HYBRID], None, tuple(verdicts), "")


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
