"""The loads of the zones of a study: what was delivered, and what models and rules say was needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import is_cooling, is_stage, plant_roles
from ..thermal.declaration import capacity_name
from .compared_models import HYBRID
from .load_rules import rule_loads
from .log_split import StudyData
from .settings import Settings
from .verdict import Verdict, judge_load_errors
from .zone_part import Study, forecast_of


class Load(NamedTuple):
    """Delivered heat or stages over some rows, in the unit that a log allows."""

    values: pd.Series
    unit: str  # "kW", or "-" for stages without a known capacity


class ZoneLoads(NamedTuple):
    """Loads of a zone over the rows after training, in one unit."""

    needed: Mapping[str, pd.Series]  # by model: it would have held the measured temperature
    delivered: pd.Series  # NaN where the temperature is not known at both ends of a row
    rules: Mapping[str, pd.Series]
    unit: str  # "kW", or "-" for stages without a known capacity

    @classmethod
    def of(cls, needed: Mapping[str, pd.Series], delivered: Load, data: StudyData) -> Self:
        """The loads of models beside what was ``delivered``, and those of rules."""
        T = data.later["T_za"]
        known = (T.notna() & T.shift(-1).notna()).reindex(delivered.values.index, fill_value=False)
        held = pd.concat([data.train["T_za"], T]).shift(-1).ffill()
        rules = rule_loads(data.train, data.later, delivered.values, held)
        return cls(needed, delivered.values.where(known), rules, delivered.unit)

    def errors(self, start: pd.Timestamp) -> pd.DataFrame:
        """Errors of models and rules in the test, NaN where unknown."""
        return pd.DataFrame({**self.needed, **self.rules}).sub(self.delivered, axis=0)[start:]

    def verdict(self, start: pd.Timestamp, doubts: Sequence[str] = (), *, scaled: bool) -> Verdict:
        """The verdict on the load of the hybrid in the test beside those of the rules.

        ``scaled`` tells whether the log fixes what a kW is; ``doubts`` are further reasons to take care.
        """
        errors = self.errors(start).dropna(subset=HYBRID)
        days = pd.Series(pd.DatetimeIndex(errors.index).normalize(), index=errors.index)
        rules = {name: errors[name] for name in self.rules}
        return judge_load_errors(errors[HYBRID], rules, days, scaled=scaled, doubts=doubts)


def loads_by_zone(needed: Mapping[str, pd.DataFrame], study: Study) -> dict[str, ZoneLoads]:
    """The loads of the zones that something heats or cools, ``needed`` by model."""
    loads = {}
    for zone, own in study.by_zone.items():
        roles = plant_roles(own.data.later)
        delivered = load_of(own.past, own.settings, roles)
        of_zone = {label: forecast_of(load, study.settings, zone) for label, load in needed.items()}
        found = {label: load_of(rows, own.settings, roles) for label, rows in of_zone.items()}
        known = {label: load.values for label, load in found.items() if load is not None}
        if HYBRID in known and delivered is not None:
            loads[zone] = ZoneLoads.of(known, delivered, own.data)
    return loads


def load_errors(loads: Mapping[str, ZoneLoads], start: pd.Timestamp) -> tuple[pd.Series, str]:
    """RMSE of the loads of all zones together by model and rule, and their unit; none where they have several units.

    All are compared over the same rows.
    """
    units = {one.unit for one in loads.values()}
    if len(units) != 1:
        return pd.Series(dtype=float), ""
    errors = pd.concat([one.errors(start).dropna() for one in loads.values()])
    return np.sqrt((errors**2).mean()), units.pop()


def load_of(rows: pd.DataFrame, settings: Settings, roles: Sequence[str]) -> Load | None:
    """The load of a plant with these roles: measured heat and stages by their known capacities, else as they are.

    Where stages have no known capacity, those of cooling count as negative, and beside measured heat they are left out;
    None where nothing heats or cools.
    """
    stages, known = [role for role in roles if is_stage(role)], settings.capacities
    scaled = all(capacity_name(role) in known for role in stages)
    signs = {role: -1.0 if is_cooling(role) else 1.0 for role in stages}
    factors = {role: float(known[capacity_name(role)]) for role in stages} if scaled else signs
    parts = rows[stages] * pd.Series(factors, dtype=float)
    if len(stages) < len(roles):
        heat = ["Q_hvac"] if "Q_hvac" in rows else [role for role in roles if role.startswith("Q_")]
        return Load((rows[heat].join(parts) if scaled else rows[heat]).sum(axis=1, skipna=False), "kW")
    return Load(parts.sum(axis=1, skipna=False), "kW" if scaled else "-") if roles else None


def delivered_in_kw(rows: pd.DataFrame, settings: Settings) -> pd.Series | None:
    """Delivered heat [kW] of a zone; None where it is not known."""
    load = load_of(rows, settings, plant_roles(rows))
    return None if load is None or load.unit != "kW" else load.values


def of_whole_plant(load: pd.DataFrame) -> pd.DataFrame:
    """A load whose ``Q_hvac`` is the heat of the whole plant also where a meter beside stages has that name.

    The same holds for ``Q_hvac_<zone>`` of several zones.
    """
    totals = [str(name) for name in load if str(name).startswith("Q_total")]
    whole = {total.replace("Q_total", "Q_hvac", 1): total for total in totals}
    return load.drop(columns=list(whole)).rename(columns={total: name for name, total in whole.items()})
