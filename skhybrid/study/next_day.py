"""The forecast of the next day of a study, under its set-points or under its known heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, ZoneTable, is_plant, plant_roles
from .._warnings import warnings_dropped
from ..exceptions import PlanWarning
from ..model_selection.single_reading import read_once
from .day_energy import paths_of_load
from .log_split import StudyData, inputs_of, setpoints_of
from .setpoints_known import LOAD_INTERVAL
from .settings import Settings
from .zone_loads import delivered_in_kw, of_whole_plant
from .zone_part import Study, each_zone, rows_of_zone

_NOT_LEARNED = "no thermostat was learned"


def refuse_holes(study: Study) -> None:
    """Refuse a next day that cannot be forecast, before models are fitted for minutes; set-points may be missing."""
    data = study.data
    ahead = inputs_of(data.future, study.settings.roles_of("T_za")).drop(columns=data.unplanned)
    holed = [one for name, one in ahead.items() if one.isna().any() and not str(name).startswith(SETPOINT_ROLES)]
    if holed or data.history.empty:
        what = f"{holed[0].name} is missing at {holed[0].isna().idxmax()}" if holed else "an input is missing before it"
        raise ValueError(f"the next day begins at {ahead.index[0]}, and {what}; fill it in or end the log earlier.")


def refuse_unplanned(data: StudyData, why_not: str) -> None:
    """Refuse a next day without heat that cannot be forecast under its set-points, and say ``why_not``."""
    if data.unplanned and why_not:
        raise ValueError(
            f"{data.unplanned[0]} is empty in the next day, from {data.future.index[0]}, which cannot be forecast "
            f"under its set-points: {why_not}; fill in the heat that is planned."
        )


def is_under_setpoints(held: object, study: Study) -> bool:
    """True if the next day is forecast under its set-points; a day to come is under heat that is planned.

    ``held`` is the back-test under set-points, None where no thermostat was learned.
    """
    why_not = _NOT_LEARNED if held is None else unusable_setpoints(study.data.future, study.settings)
    refuse_unplanned(study.data, why_not)
    if held is None or not (study.data.held_out or study.data.unplanned):
        return False
    if why_not:
        study.remarks.append(f"the next day is forecast under its known heat: {why_not}")
    return not why_not


def unusable_setpoints(day: pd.DataFrame, settings: Settings) -> str:
    """Why a day cannot be forecast under the set-points of all zones; empty where it can."""
    for zone in each_zone(settings):
        rows = rows_of_zone(day, settings, zone)
        if plant_roles(rows) and (why_not := _unusable(setpoints_of(rows))):
            return f"zone {zone!r}: {why_not}" if zone else why_not
    return ""


def _unusable(given: pd.DataFrame) -> str:
    """Why set-points of a zone cannot be used; without any, its plant runs as usual."""
    for role, missing in given.isna().items():
        if missing.any():
            return f"{role} is missing at {missing.idxmax()}"
    crossed = pd.Series(False, given.index) if given.empty else given.iloc[:, 0] > given.iloc[:, -1]
    return f"T_heat_set is above T_cool_set at {crossed.idxmax()}" if crossed.any() else ""


def forecast_next_day(
    model: Any, study: Study, asked: Mapping[str, Any], gray_box: Any = None, *, of_day: bool
) -> pd.DataFrame:
    """The forecast of the next day, with intervals as ``asked``, and what was measured of it.

    Under its set-points where ``of_day``, else under its heat, beside the load that holds the set-point of ``[load]``.
    An identified ``gray_box`` gives the capacities of stages; without it those of the settings count.  Of several
    zones, names end with the zone's.
    """
    data = study.data
    ahead = data.future.drop(columns=study.settings.roles_of("T_za"))
    with warnings_dropped(PlanWarning):  # the verdict says what lies beyond the training
        if of_day:
            plant = plant_roles(ahead)
            out = in_kilowatts(model.forecast(data.history, ahead.drop(columns=plant), **asked), gray_box, ahead)
            if not _has_own_kilowatts(gray_box, plant):
                out = out.drop(columns=list(LOAD_INTERVAL), errors="ignore")
        else:
            whole, *parts = _read_day(study)
            out = model.forecast(*parts, **asked)
            load = in_kilowatts(_required(model, study, whole), gray_box, ahead)
            out = out.join(load[[name for name in load if is_plant(name) and name not in out]])
    for zone, own in study.by_zone.items():
        future = own.data.future
        shown = setpoints_of(future) if of_day else own.data.setpoint.loc[future.index].to_frame("setpoint")
        if data.held_out:
            shown = shown.assign(T_za_measured=future["T_za"])
            heat = delivered_in_kw(future, own.settings) if gray_box is None else delivered_heat(gray_box, future)
            shown = shown if heat is None else shown.assign(Q_hvac_delivered=heat)
        out = out.join(shown.add_suffix(f"_{zone}" if zone else ""))
    return out.rename_axis("time")


def paths_of_next_day(model: Any, study: Study, gray_box: Any = None) -> pd.DataFrame | None:
    """Paths of the loads of the next day under its set-points [kW]; None where the model has none in kW.

    Arguments as for :func:`forecast_next_day`.
    """
    settings, future = study.settings, study.data.future
    plant = plant_roles(future)
    if not _has_own_kilowatts(gray_box, plant):
        return None
    ahead = future.drop(columns=[*settings.roles_of("T_za"), *plant])
    return paths_of_load(model, study.data.history, ahead, weather_error=settings.weather_error)


def _has_own_kilowatts(gray_box: Any, plant: list[str]) -> bool:
    """True where intervals and paths are in kW; beside an identification, those of stages have the model's scale."""
    return gray_box is None or plant == ["Q_hvac"]


def _read_day(study: Study) -> tuple[Any, Any, Any]:
    """The rows of the history and the next day, then those of each; of one zone they are read once."""
    data, measured = study.data, study.settings.roles_of("T_za")
    whole = pd.concat([data.history, data.future.assign(**dict.fromkeys(measured, np.nan))])
    table = whole if study.settings.zones else read_once(whole, fits=False)
    if not isinstance(table, ZoneTable):
        return whole, data.history, data.future.drop(columns=measured)
    n_past = len(data.history)
    return table, table.rows(slice(n_past)), table.rows(slice(n_past, None))


def _required(model: Any, study: Study, whole: Any) -> pd.DataFrame:
    """The loads of the next day that hold the set-points of ``[load]``; no columns where zones share a plant."""
    data, settings = study.data, study.settings
    heated = {zone: own.data for zone, own in study.by_zone.items() if plant_roles(own.data.future)}
    if not heated or getattr(model, "shared_plants_", False):
        return pd.DataFrame(index=data.future.index)
    held = {zone: own.setpoint.to_numpy() for zone, own in heated.items()}
    return model.predict_load(whole, held if settings.zones else held[""]).loc[data.future.index]


def in_kilowatts(load: pd.DataFrame, gray_box: Any, rows: pd.DataFrame) -> pd.DataFrame:
    """A load of stages in kW by an identification's capacities, if any, since other models have no certain scale."""
    load, stages = of_whole_plant(load), plant_roles(rows)
    if gray_box is None or not stages or any(role.startswith("Q_") for role in stages):
        return load
    heat = {}
    for end in ("", "_unclipped") if f"{stages[0]}_unclipped" in load else ("",):
        by_role = load[[role + end for role in stages]].set_axis(stages, axis=1)
        heat["Q_hvac" + end] = delivered_heat(gray_box, by_role)
    return load.assign(**heat)


def delivered_heat(gray_box: Any, rows: pd.DataFrame) -> pd.Series | None:
    """Measured heat, or the stages times their identified capacities [kW]; None where nothing heats or cools."""
    theta = gray_box.theta_
    plant = [s for s in gray_box.network_.sources(rows.columns) if is_plant(s.role)]
    parts = [rows[s.role] * (1.0 if s.parameter is None else theta[s.parameter]) for s in plant]
    return sum(parts[1:], parts[0]) if parts else None
