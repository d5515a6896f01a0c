"""Back-tests of the predictor of some settings on the last weeks of a log, of one zone or of several."""

from __future__ import annotations

from typing import NamedTuple

import pandas as pd

from ..study.compared_models import HYBRID, YESTERDAY, make_models
from ..study.log_split import StudyData
from ..study.run import verdicts_by_zone
from ..study.scores import coverage_of, error_table, errors_by_model, rmse_by_zone
from ..study.setpoints_known import SetpointsKnown
from ..study.settings import Settings
from ..study.tested_models import Progress, counted, needed_loads, tested_models
from ..study.verdict import Verdict, named_by_zone
from ..study.zone_loads import load_errors, loads_by_zone
from ..study.zone_part import Study

#: what the predictor of one zone is compared with, apart from the rules for the load
_COMPARED = (HYBRID, "ARX re-fitted", YESTERDAY)


class ZoneBacktest(NamedTuple):
    """Errors of a zone's predictor and of simple models."""

    table: pd.DataFrame  # index: model; rmse and mae [K], load_rmse [load_unit]
    frame: pd.DataFrame  # every forecast of the predictor
    coverage: float | None  # share inside the 80 % intervals
    verdicts: tuple[Verdict, ...]  # on the temperature and, where something heats or cools, on the load
    load_unit: str  # "kW", or "-" for stages without a known capacity
    setpoints_known: SetpointsKnown | None = None  # the same where the heat is not known ahead
    remarks: tuple[str, ...] = ()  # what could not be tested, and why


def backtest_zone(settings: Settings, data: StudyData, progress: Progress | None = None) -> ZoneBacktest:
    """Fit on the training rows, forecast from every origin of the test, and compare; of several zones also each.

    ``progress`` is called with (number, total, text) before every step.
    """
    models = [one for one in make_models(settings) if settings.zones or one.label in _COMPARED]
    say, study = counted(progress, len(models) + 1), Study.of(settings, data)
    tested = tested_models(models, study, say)
    frames = {label: one.frame for label, one in tested.items()}
    say("back-test with only the set-points known")
    held = SetpointsKnown.of(tested[HYBRID].model, study, frames[YESTERDAY])
    loads = loads_by_zone(needed_loads(tested), study)
    verdicts = verdicts_by_zone(tested, study, held, loads, of_day=held is not None)
    table = error_table(errors_by_model(frames)).sort_values("rmse")
    if settings.zones:
        table = table.join(rmse_by_zone(frames).reindex(settings.zones).T.add_prefix("rmse_"))
    errors, unit = load_errors(loads, data.test_start)
    if unit:
        table = table.reindex(list(dict.fromkeys([*table.index, *errors.index]))).assign(load_rmse=errors)
    return ZoneBacktest(
        table.rename_axis("model"),
        frames[HYBRID] if held is None else frames[HYBRID].join(held.columns),
        coverage_of(frames[HYBRID]),
        tuple(named_by_zone(verdicts) if settings.zones else verdicts[""]),
        unit if held is None else unit or held.unit,
        None if held is None else held.with_zones,
        tuple(dict.fromkeys(study.remarks)),
    )
