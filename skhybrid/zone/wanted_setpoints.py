"""The set-points under which the zones of a model are forecast, by the rows ahead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from .._table import SETPOINT_ROLES, is_plant
from ..study.settings import Settings
from ..study.zone_part import roles_of, rows_of_zone


def wanted_setpoints(settings: Settings, models: Mapping[str, Any], future: pd.DataFrame) -> dict[str, Any] | None:
    """Heating and cooling set-point by zone, of one zone by an empty name; None where all heat is planned.

    That of a zone is None under planned heat, and where it has no set-points and its thermostat was not learned.
    ``models`` are the predictors of the zones.
    """
    heated = {zone for zone, model in models.items() if not zone or has_plant(model)}
    rows = {zone: rows_of_zone(future, settings, zone) for zone in models if zone in heated}
    wanted: dict[str, Any] = dict.fromkeys(rows)
    for zone, own in rows.items():
        if any(map(is_plant, own)) or not any(role in future for role in settings.setpoints):
            continue
        _refuse_one_side(settings, zone, own, learned=models[zone].thermostat_learned_)
        if any(role in own for role in SETPOINT_ROLES):
            wanted[zone] = tuple(own[role].to_numpy() if role in own else None for role in SETPOINT_ROLES)
    return None if all(band is None for band in wanted.values()) else wanted


def _refuse_one_side(settings: Settings, zone: str, future: pd.DataFrame, *, learned: bool) -> None:
    """Refuse the rows ahead of a zone that lack a set-point with which its thermostat was ``learned``."""
    names = roles_of(settings.columns, settings, zone)
    sides = [role for role in SETPOINT_ROLES if role in names]
    absent = [role for role in sides if role not in future]
    if absent and learned:
        example = {"T_heat_set": "21", "T_cool_set": ",24"}
        raise ValueError(
            f"{names[absent[0]]} is not given for the rows ahead, but the thermostat was learned with it; give it, "
            f"such as --setpoint {zone and zone + ':'}{''.join(example[role] for role in sides)}."
        )


def has_plant(model: Any) -> bool:
    """Whether a fitted predictor learned from a plant."""
    return any(map(is_plant, model.training_.ranges))


def idle_setpoints(found: pd.DataFrame, parts: Mapping[str, Any]) -> dict[str, str]:
    """The set-points of a side that the log does not have and no plant holds, each with what it never did.

    The plant of a zone, of which ``parts`` has the model, acts where it did in the training or does in the forecast.
    """
    idle: dict[str, str] = {}
    for zone, part in parts.items():
        end, spans = f"_{zone}" if zone else "", part.covered().items()
        heat = [-x if role.startswith("u_cool") else x for role, span in spans if is_plant(role) for x in span]
        if heat:
            heat += [*found.get(f"Q_hvac{end}", [])]
            acts = {"heated": max(heat) > 0.0, "cooled": min(heat) < 0.0}
            sides = zip(SETPOINT_ROLES, acts.items(), strict=True)
            idle |= {role + end: did for role, (did, runs) in sides if not runs and role not in part.settings.columns}
    return idle
