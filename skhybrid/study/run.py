"""Run a study: fit, back-test, compare, forecast the next day."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from .._table import is_stage, plant_roles
from .._warnings import recorded_warnings, without_python
from .compared_models import HYBRID, YESTERDAY, identified_by, make_models
from .doubts import Doubts
from .identified_building import describe, parameter_table
from .identified_rooms import identify_zones
from .log_split import StudyData
from .next_day import (
    delivered_heat,
    forecast_next_day,
    in_kilowatts,
    is_under_setpoints,
    paths_of_next_day,
    refuse_holes,
)
from .results import BuildingResult, StudyResult, zone_table
from .scores import coverage_of, error_table, errors_by_model, interval_asked
from .setpoints_known import SetpointsKnown
from .settings import Settings, is_scaled
from .tested_models import Progress, TestedModel, counted, needed_loads, tested_models
from .verdict import Verdict, judge_temperature
from .zone_loads import Load, ZoneLoads, load_errors, loads_by_zone
from .zone_part import Study, predictors_of, zone_of


def run_study(settings: Settings, data: StudyData, progress: Progress | None = None) -> StudyResult | BuildingResult:
    """Fit the hybrid and the models it is compared with, back-test them at the same origins, forecast the next day.

    Parameters
    ----------
    settings : Settings
    data : StudyData
    progress : callable, optional, called with (number, total, text) before every step

    Returns
    -------
    StudyResult
        Errors, back-tests, the forecast of the next day, and what was identified; :func:`write_outputs` writes them.
        Of several zones a result with verdicts and errors of each zone.

    Raises
    ------
    ValueError
        If an input of the next day is missing, or the hybrid or the identification cannot be fitted or tested; any
        other model that fails is left out, with a warning.
    """
    begun, study = time.perf_counter(), Study.of(settings, data)
    refuse_holes(study)
    with tempfile.TemporaryDirectory() as folder, recorded_warnings() as caught:
        models = make_models(settings, memory=folder)
        say = counted(progress, len(models) + 2)
        tested = tested_models(models, study, say)
        model, frames = tested[HYBRID].model, {label: one.frame for label, one in tested.items()}
        say("back-test with only the set-points known")
        held = SetpointsKnown.of(model, study, frames[YESTERDAY])
        say("identification, and forecast of the next day")
        identified = _identified_rooms(study) if settings.zones else _identified_zone(tested, study)
        gray_box = identified.get("identification")
        loads = _loads(tested, gray_box, study)
        of_day = is_under_setpoints(held, study)
        asked = interval_asked(held.frame if held is not None and of_day else frames[HYBRID], settings)
        forecast = forecast_next_day(model, study, asked, gray_box, of_day=of_day)
        verdicts = verdicts_by_zone(tested, study, held, loads, gray_box, of_day=of_day)
    common = {
        "settings": settings,
        "data": data,
        "model": model,
        "frames": frames,
        "table": _compared(tested, load_errors(loads, data.test_start)[0]),
        "forecast": forecast,
        "setpoints_known": held,
        "warnings": _each_once(study.remarks, caught),
        **identified,
    }
    result: StudyResult | BuildingResult
    if settings.zones:
        zones = zone_table(frames, verdicts, loads, data.test_start)
        by_zone = {str(zone): verdicts[str(zone)] for zone in zones.index}
        result = BuildingResult(**common, zones=zones, zone_verdicts=by_zone)
    else:
        result = StudyResult(**common, verdicts=verdicts[""])
    if of_day and result.scaled:  # of other loads no page shows an energy
        result.load_paths = paths_of_next_day(model, study, gray_box)
    result.seconds = time.perf_counter() - begun
    return result


def _identified_zone(tested: Mapping[str, TestedModel], study: Study) -> dict[str, Any]:
    """The identification of one zone, its disturbance, and what it says of the building."""
    gray_box = tested[identified_by(study.settings)].model.gray_box_
    tested[HYBRID].model.set_params(memory=None)  # the folder ends with the study
    return {
        "identification": gray_box,
        "zeta": gray_box.estimate_disturbance(study.without_setpoints.rows_for(gray_box)[0], smooth=True),
        "parameters": parameter_table(gray_box),
        "building": describe(gray_box),
    }


def _identified_rooms(study: Study) -> dict[str, Any]:
    """The rooms of several zones; a remark says why they could not be identified."""
    try:
        return {"identified": identify_zones(study.settings, study.data.train)}
    except ValueError as error:
        study.remarks.append(f"the rooms were not identified: {error}")
        return {}


def _loads(tested: Mapping[str, TestedModel], gray_box: Any, study: Study) -> dict[str, ZoneLoads]:
    """The loads of models by zone; of one zone in kW by the capacities of an identified ``gray_box``."""
    needed = needed_loads(tested)
    if gray_box is None:
        return loads_by_zone(needed, study)
    delivered = delivered_heat(gray_box, study.past)
    if delivered is None:
        return {}
    own = {label: in_kilowatts(load, gray_box, study.data.later)["Q_hvac"] for label, load in needed.items()}
    return {"": ZoneLoads.of(own, Load(delivered, "kW"), study.data)}


def verdicts_by_zone(
    tested: Mapping[str, TestedModel],
    study: Study,
    held: SetpointsKnown | None,
    loads: Mapping[str, ZoneLoads],
    gray_box: Any = None,
    *,
    of_day: bool,
) -> dict[str, list[Verdict]]:
    """The verdicts on each zone's temperature and load: with only the set-points known where that was tested.

    An identified ``gray_box`` gives the capacities of stages, where it is not the hybrid's; ``of_day``: the day to come
    is known by its set-points.
    """
    of_stages = any(map(is_stage, plant_roles(study.data.train)))
    parts, found = study.by_zone, {}
    for zone, model in predictors_of(tested[HYBRID].model).items():
        data, scale = parts[zone].data, gray_box if of_stages else None
        doubts = Doubts.of(model, study.rows_for(model)[1], data, scale, setpoints_known=of_day)
        scaled = is_scaled(data.train, parts[zone].settings.capacities)
        own, yesterday = (zone_of(tested[label].frame, zone) for label in (HYBRID, YESTERDAY))
        if held is not None:
            found[zone] = held.zones.get(zone, held).verdicts(yesterday, doubts, scaled=scaled)
            continue
        found[zone] = [judge_temperature(own, yesterday, coverage_of(own), doubts.temperature)]
        if zone in loads:
            found[zone].append(loads[zone].verdict(data.test_start, doubts.load, scaled=scaled))
    return found


def _each_once(remarks: Sequence[str], caught: Sequence[warnings.WarningMessage]) -> list[str]:
    """Remarks and the warnings for a user, each once."""
    said = (w.message for w in caught if issubclass(w.category, UserWarning))
    return list(dict.fromkeys(map(without_python, [*remarks, *said])))


def _compared(tested: Mapping[str, TestedModel], of_loads: pd.Series) -> pd.DataFrame:
    """The table of results, over the forecasts that every model made, the best first; then rules for the load alone."""
    table = error_table(errors_by_model({label: one.frame for label, one in tested.items()}))
    table = table.assign(
        load_rmse=of_loads,
        seconds=pd.Series({label: one.seconds for label, one in tested.items()}),
        note=pd.Series({label: one.note for label, one in tested.items()}),
    ).sort_values("rmse")
    for name, error in of_loads.items():
        if name not in table.index:
            table.loc[name, ["load_rmse", "note"]] = error, "a rule for the load alone"
    return table.rename_axis("model")
