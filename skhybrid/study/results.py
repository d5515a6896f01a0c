"""Results of a study, of one zone or of several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from .compared_models import HYBRID
from .identified_rooms import IdentifiedRooms
from .load_rules import YESTERDAY as YESTERDAYS_LOAD
from .log_split import StudyData
from .scores import coverage_of, rmse_by_zone
from .setpoints_known import SetpointsKnown
from .settings import Settings, is_scaled
from .tariff import Cost, energy_cost
from .verdict import Verdict, named_by_zone, worst, worst_first
from .zone_loads import ZoneLoads


@dataclass(kw_only=True)
class BaseStudyResult:
    """Results that a study of one zone and one of several have in common."""

    settings: Settings
    data: StudyData
    model: Any
    frames: dict[str, pd.DataFrame]
    table: pd.DataFrame
    forecast: pd.DataFrame
    load_paths: pd.DataFrame | None = None
    setpoints_known: SetpointsKnown | None = None
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def best(self) -> str:
        """Label of the model with the lowest day-ahead error."""
        return str(self.table.index[0])

    @property
    def coverage(self) -> float | None:
        """Share of the test measurements inside the intervals; None without intervals."""
        return coverage_of(self.frames[HYBRID])

    @property
    def scaled(self) -> bool:
        """True where the log fixes what a kW is, in every zone."""
        raise NotImplementedError

    @cached_property
    def next_day_cost(self) -> Cost | None:
        """Cost of the load of the next day; None without a tariff, or where its kW have no scale."""
        if not self.scaled:
            return None
        given, forecast = self.settings, self.forecast.assign(T_oa=self.data.future["T_oa"])
        return energy_cost(forecast, given.tariff, given.plant, given.holidays, given.zones, self.load_paths)


@dataclass(kw_only=True)
class StudyResult(BaseStudyResult):
    """Results of a study.

    Parameters
    ----------
    settings : Settings
    data : StudyData
    model : fitted HybridPredictor, the model whose forecast is shown
    frames : dict of label to DataFrame
        Back-tests; the hybrid's with quantiles where there are intervals.
    table : DataFrame
        Index = label; ``rmse``, ``mae`` [K], ``load_rmse`` [kW], ``seconds``, ``note``; the best first.
    forecast : DataFrame, the next day
    load_paths : DataFrame, optional
        Paths of its loads by ``sample`` and time [kW]; None where it is not forecast under set-points, or its kW have
        no scale.
    setpoints_known : SetpointsKnown, optional
        The back-test in which the heat is not known ahead; None for a log without set-points.
    warnings : list of str, all warnings, each once
    seconds : float
    identification : fitted estimator
        The identification whose parameters describe the building: the model's own, or with the schedule model that of
        the two-stage model next to it.
    zeta : Series, disturbance of the training rows as the identification estimates it [kW]
    parameters : DataFrame
        Index = name; ``value``, ``std``, ``unit``, ``lower``, ``upper``, ``description``, ``remark``.
    verdicts : list of Verdict
        On temperature and, where the plant's heat is known, on the load; where set-points were tested, on that test.
    building : DataFrame
        Index = quantity, such as "heat loss"; ``value``, ``std``, ``unit``, ``remark``.
    """

    identification: Any
    zeta: pd.Series
    parameters: pd.DataFrame
    verdicts: list[Verdict] = field(default_factory=list)
    building: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def scaled(self) -> bool:
        """Whether the log fixes what a kW is."""
        return is_scaled(self.data.train, self.settings.capacities)


@dataclass(kw_only=True)
class BuildingResult(BaseStudyResult):
    """Results of a study of several zones.

    ``model`` is a fitted BuildingPredictor, ``frames`` have a column ``zone``, the names of ``forecast`` end with the
    zone's, and ``table`` is over all zones together.
    """

    #: by zone, the worst verdict first: ``level``, errors [K] by model, ``coverage``, and ``load_rmse`` of the model
    #: and ``load_yesterday`` with their ``unit``
    zones: pd.DataFrame
    zone_verdicts: dict[str, list[Verdict]]  # by zone, in the order of ``zones``
    identified: IdentifiedRooms | None = None  # None where the rooms could not be identified

    @property
    def verdicts(self) -> list[Verdict]:
        """The verdicts of all zones, each with the zone in its quantity."""
        return named_by_zone(self.zone_verdicts)

    @property
    def scaled(self) -> bool:
        """Whether the log fixes what a kW is, in every zone."""
        return bool((self.zones["unit"] != "-").all())

    @property
    def parameters(self) -> pd.DataFrame:
        """Quantities of the rooms, and what each two exchange; empty where the rooms were not identified."""
        columns = ["zone", "value", "std", "unit", "remark"]
        if self.identified is None:
            return pd.DataFrame(columns=columns).rename_axis("quantity")
        return self.identified.table[columns]

    def pairs(self) -> dict[tuple[str, str], float | None]:
        """The pairs of zones whose forecasts know each other, with their conductance [W/K] where it is known."""
        known: dict[frozenset[str], float] = {}
        if self.identified is not None:
            table = self.identified.partitions
            table = table[table["remark"].isin(["", "uncertain"])]
            ends = (table.index.get_level_values(level) for level in ("zone", "neighbour"))
            known = {frozenset((a, b)): float(v) for a, b, v in zip(*ends, table["value"], strict=True)}
        beside = [frozenset((zone, other)) for zone, one in self.model.coupled_.items() for other in one.neighbours]
        drawn = dict.fromkeys([*beside, *known])
        order = {zone: k for k, zone in enumerate(self.settings.zones)}
        named = (tuple(sorted(pair, key=lambda zone: order[zone])) for pair in drawn)
        return {(a, b): known.get(frozenset((a, b))) for a, b in named}


def zone_table(
    frames: Mapping[str, pd.DataFrame],
    verdicts: Mapping[str, list[Verdict]],
    loads: Mapping[str, ZoneLoads],
    test_start: pd.Timestamp,
) -> pd.DataFrame:
    """Level of the verdicts, errors [K] by model, coverage, and errors of the load of each zone, the worst first."""
    table, own = rmse_by_zone(frames).reindex(list(verdicts)), frames[HYBRID]
    level = pd.Series({name: worst(found) for name, found in verdicts.items()})
    coverage = pd.Series({name: coverage_of(own[own["zone"] == name]) for name in verdicts}, dtype=float)
    by_error = table[HYBRID].sort_values(ascending=False, kind="stable").index
    order = worst_first({str(zone): [level[zone]] for zone in by_error})
    rmse = {zone: np.sqrt((one.errors(test_start).dropna() ** 2).mean()) for zone, one in loads.items()}
    of_loads = pd.DataFrame(rmse, [HYBRID, YESTERDAYS_LOAD], dtype=float).set_axis(["load_rmse", "load_yesterday"])
    unit = pd.Series({zone: loads[zone].unit if zone in loads else "" for zone in verdicts})
    table = table.assign(level=level, coverage=coverage).join(of_loads.T).assign(unit=unit)
    return table.loc[order].rename_axis("zone")
