"""Back-tests of the predictor of some settings on the last weeks of a log, of one zone or of several."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import plant_roles
from ..study.building_setpoints import zone_of
from ..study.building_study import (
    N_STEPS,
    ZoneLoads,
    backtest_zones,
    judge_zone,
    under_setpoints,
    verdicts_by_zone,
    zone_table,
)
from ..study.compared_models import HYBRID, YESTERDAY, make_models
from ..study.judgement import Doubts, judge_load, judge_temperature, load_of, loads_by_rule
from ..study.log_split import StudyData, with_facades
from ..study.run import Progress, StudySpan, counted, tested_model
from ..study.scores import coverage_of, error_table, errors_by_model
from ..study.setpoints_known import SetpointsKnown
from ..study.settings import Settings, is_scaled
from ..study.spans import train_and_test
from ..study.verdict import Verdict
from ..study.zone_part import rows_of_zone, settings_of_zone
from .dead_meters import without_dead_meters
from .outages import complete_rows

#: what the predictor is compared with, apart from the rules for the load
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
    """Fit on the training rows, forecast from every origin of the test, and compare.

    ``progress`` is called with (number, total, text) before every step.
    """
    models = [one for one in make_models(settings) if one.label in _COMPARED]
    spans = StudySpan.of(data.train), StudySpan.of(data.later, fits=False)
    say, remarks = counted(progress, len(models)), list[str]()
    tested = {}
    for one in models:
        say(f"{one.label}: fit and back-test")
        tested[one.label] = tested_model(one, settings, data.test_start, spans, remarks)
    frames = {label: one.frame for label, one in tested.items()}
    table = error_table(errors_by_model(frames)).sort_values("rmse")
    own, (predictor, _, load, _) = frames[HYBRID], tested[HYBRID]
    coverage, rows = coverage_of(own), spans[1].given_to(predictor)
    held = SetpointsKnown.of(predictor, rows, data, frames[YESTERDAY], settings, remarks)
    doubts = Doubts.of(predictor, rows, data, setpoints_known=held is not None)
    verdicts = [judge_temperature(own, frames[YESTERDAY], coverage, doubts.temperature)]
    scaled = is_scaled(data.train, settings.capacities)
    past, roles, unit = pd.concat([data.train, data.later]), plant_roles(data.train), ""
    delivered, needed = (None if rows is None else load_of(rows, settings, roles) for rows in (past, load))
    if delivered is not None and needed is not None:
        loads, unit = ZoneLoads(needed, delivered, loads_by_rule(data, delivered.values)), delivered.unit
        given: dict[str, Any] = {"scaled": scaled, "doubts": doubts.load}
        verdicts.append(judge_load(needed.values, loads.rules, delivered.values, data.test_start, **given))
        rmse = np.sqrt((loads.errors(data.test_start) ** 2).mean())
        table = table.reindex([*table.index, *loads.rules]).assign(load_rmse=rmse)
    if held is not None:
        verdicts, own = held.verdicts(frames[YESTERDAY], doubts, scaled=scaled), own.join(held.columns)
    table, said = table.rename_axis("model"), tuple(dict.fromkeys(remarks))
    return ZoneBacktest(table, own, coverage, tuple(verdicts), unit, held, said)


def backtest_building(settings: Settings, frame: pd.DataFrame, progress: Progress | None = None) -> ZoneBacktest:
    """Fit on the training rows, forecast from every origin of the test, and compare, zone by zone.

    The result has the errors of all zones together and of each; loads only with the set-points known.  ``progress`` as
    for :func:`run_study`.
    """
    alive = without_dead_meters(frame, settings)
    rows = complete_rows(with_facades(alive, settings), settings.roles_of("T_za"))
    train, test = train_and_test(rows, settings)
    later = rows.loc[train.index[-1] : test.index[-1]].iloc[1:]
    say, remarks = counted(progress, N_STEPS + 1), list[str]()
    model, frames, _ = backtest_zones(settings, train, later, test.index[0], say, remarks)
    say("back-test with only the set-points known")
    held = under_setpoints(model, settings, (train, later), test.index[0], frames, remarks)
    verdicts = {zone: [judge_zone(frames, zone)] for zone in settings.zones}
    of_each = zone_table(frames, verdicts)[list(frames)].loc[settings.zones].T.add_prefix("rmse_")
    table = error_table(errors_by_model(frames)).join(of_each).sort_values("rmse").rename_axis("model")
    own, coverage, whole = frames[HYBRID], coverage_of(frames[HYBRID]), None
    if held is not None:
        own, whole = own.join(held.whole.columns), held.with_zones
        for zone, one in held.zones.items():
            scaled = is_scaled(rows_of_zone(train, settings, zone), settings_of_zone(settings, zone).capacities)
            verdicts[zone] = one.verdicts(zone_of(frames[YESTERDAY], zone), Doubts([], []), scaled=scaled)
    found, unit = tuple(verdicts_by_zone(verdicts)), "" if whole is None else whole.unit
    return ZoneBacktest(table, own, coverage, found, unit, whole, tuple(dict.fromkeys(remarks)))
