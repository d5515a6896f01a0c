"""Back-test of a building of several zones: with neighbours, each zone by itself, and by simple models."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from ..study.building_study import N_STEPS, backtest_zones, judge_zone, verdicts_by_zone, zone_table
from ..study.compared_models import HYBRID
from ..study.data import train_and_test, with_facades
from ..study.run import counted
from ..study.scores import coverage_of, error_table, errors_by_model
from ..study.settings import Settings
from .outages import complete_rows
from .zone_backtest import ZoneBacktest


def backtest_building(
    settings: Settings, frame: pd.DataFrame, progress: Callable[[int, int, str], None] | None = None
) -> ZoneBacktest:
    """Fit on the training rows, forecast from every origin of the test, and compare, zone by zone.

    The result has the errors of all zones together and of each, without loads.  ``progress`` as for :func:`run_study`.
    """
    measured = settings.roles_of("T_za")
    rows = complete_rows(with_facades(frame, settings), measured)
    train, test = train_and_test(rows, settings)
    later = rows.loc[train.index[-1] : test.index[-1]].iloc[1:]
    say = counted(progress, N_STEPS)
    _, frames, _ = backtest_zones(settings, train, later, test.index[0], say, [])
    verdicts = {zone: [judge_zone(frames, zone)] for zone in settings.zones}
    of_each = zone_table(frames, verdicts)[list(frames)].loc[settings.zones].T.add_prefix("rmse_")
    table = error_table(errors_by_model(frames)).join(of_each).sort_values("rmse").rename_axis("model")
    return ZoneBacktest(table, frames[HYBRID], coverage_of(frames[HYBRID]), tuple(verdicts_by_zone(verdicts)), "")
