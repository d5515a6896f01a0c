"""A study of several zones: forecasts with neighbours, of each zone by itself and by simple models, zone by zone."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import is_plant, plant_roles
from .._warnings import recorded_warnings, warnings_dropped
from ..exceptions import PlanWarning
from ..hybrid import BuildingPredictor
from ..model_selection import backtest
from .building_setpoints import ZonesSetpointsKnown, unusable_day, zone_of
from .compared_models import HYBRID, YESTERDAY, make_models
from .identified_rooms import IdentifiedRooms, identify_zones
from .judgement import Doubts, Load, judge_load, judge_temperature, load_of, loads_by_rule
from .load_rules import YESTERDAY as YESTERDAYS_LOAD
from .log_split import StudyData, setpoints_of, without_setpoints
from .run import Progress, counted, each_once, is_under_setpoints, refuse_holes
from .scores import backtest_with_intervals, coverage_of, error_table, errors_by_model, interval_asked
from .settings import Settings, is_scaled
from .verdict import WORST_FIRST, Verdict
from .zone_part import data_of, forecast_of, log_columns, rows_of_zone, settings_of_zone

ALONE = "hybrid, each zone by itself"
#: models of single zones that a building is compared with
_COMPARED = ("ARX re-fitted", "ARX, multi-step, re-fitted", YESTERDAY)
N_STEPS = len(_COMPARED) + 2  # of the back-tests
_NOTES = {HYBRID: "each zone under its neighbours' forecasts", ALONE: "the same model, without neighbours"}


@dataclass
class BuildingResult:
    """Results of a study of several zones."""

    settings: Settings
    data: StudyData
    model: Any  # fitted BuildingPredictor
    frames: dict[str, pd.DataFrame]  # back-tests by label, with a column ``zone``
    table: pd.DataFrame  # as that of :class:`StudyResult`, over all zones together
    #: by zone, the worst verdict first: ``level``, errors [K] by model, ``coverage``, and ``load_rmse`` of the model
    #: and ``load_yesterday`` with their ``unit``
    zones: pd.DataFrame
    forecast: pd.DataFrame  # the next day; names end with the zone's
    verdicts: dict[str, list[Verdict]]  # by zone, in the order of ``zones``
    identified: IdentifiedRooms | None = None  # None where the rooms could not be identified
    setpoints_known: ZonesSetpointsKnown | None = None  # None without set-points
    warnings: list[str] = field(default_factory=list)  # each once
    seconds: float = 0.0

    @property
    def scaled(self) -> bool:
        """Whether the log fixes what a kW is, in every zone."""
        return bool((self.zones["unit"] != "-").all())

    @property
    def best(self) -> str:
        """Label of the model with the lowest day-ahead error."""
        return str(self.table.index[0])

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


class ZoneLoads(NamedTuple):
    """Loads of a zone over the rows after training."""

    own: Load  # that would have held the measured temperature
    delivered: Load
    rules: dict[str, pd.Series]

    def errors(self, start: pd.Timestamp) -> pd.DataFrame:
        """Errors of the model's load and of those of rules in the test."""
        loads = pd.DataFrame({HYBRID: self.own.values, **self.rules})
        return loads.sub(self.delivered.values, axis=0)[start:].dropna()


def run_building(settings: Settings, data: StudyData, progress: Progress | None = None) -> BuildingResult:
    """Fit a building and simple models of its zones, back-test them at the same origins, forecast the next day.

    ``progress`` is called with (number, total, text) before every step.  A ValueError says that the building cannot be
    fitted or tested, or misses an input of the next day; a simple model that fails is left out, with a warning.
    """
    refuse_holes(data, settings)
    begun = time.perf_counter()
    remarks = list(data.remarks)
    say = counted(progress, N_STEPS + 3)
    with recorded_warnings() as caught:
        model, frames, seconds = backtest_zones(settings, data.train, data.later, data.test_start, say, remarks)
        say("back-test with only the set-points known")
        held = under_setpoints(model, settings, (data.train, data.later), data.test_start, frames, remarks)
        say("identification of the rooms")
        identified = None
        try:
            identified = identify_zones(settings, data.train)
        except ValueError as error:
            remarks.append(f"the rooms were not identified: {error}")
        say("loads, and forecast of the next day")
        loads = _loads(model, settings, data)
        of_day = is_under_setpoints(held, unusable_day(data.future, settings), data, remarks)
        forecast = _next_day(model, settings, data, interval_asked(frames[HYBRID], settings), of_day)
        verdicts = {
            zone: _judged(model, settings, data, frames, zone, loads.get(zone), held, of_day) for zone in settings.zones
        }
    zones = zone_table(frames, verdicts).join(_load_table(loads, data, settings))
    return BuildingResult(
        settings,
        data,
        model,
        frames,
        _of_all(settings, frames, seconds, loads, data.test_start),
        zones,
        forecast,
        {str(zone): verdicts[str(zone)] for zone in zones.index},
        identified,
        held,
        each_once(remarks, caught),
        time.perf_counter() - begun,
    )


def backtest_zones(
    settings: Settings,
    train: pd.DataFrame,
    later: pd.DataFrame,
    start: pd.Timestamp,
    say: Callable[[str], None],
    remarks: list[str],
) -> tuple[BuildingPredictor, dict[str, pd.DataFrame], dict[str, float]]:
    """A fitted building, and back-tests by label with a column ``zone``, beside those of single zones; seconds of each.

    What is worth a remark is added to ``remarks``.
    """
    temperatures = settings.roles_of("T_za")
    given: dict[str, Any] = {"horizon": settings.horizon, "origin_step": settings.origin_step, "start": start}
    frames: dict[str, pd.DataFrame] = {}
    seconds = {}
    say(f"{HYBRID}: fit of all zones")
    begun = time.perf_counter()
    building = BuildingPredictor(make_models(settings)[0].estimator, adjacency=settings.adjacency)
    building.fit(train, train[temperatures])
    say(f"{HYBRID}: back-test")
    frames[HYBRID] = backtest_with_intervals(building, later, later[temperatures], remarks, **given)
    seconds[HYBRID] = time.perf_counter() - begun
    begun = time.perf_counter()
    if building.coupled_:
        frames[ALONE] = backtest(building.without_neighbours(), later, later[temperatures], **given)
        seconds[ALONE] = time.perf_counter() - begun
    for label in _COMPARED:
        say(f"{label}: fit and back-test")
        begun = time.perf_counter()
        try:
            frames[label] = _of_zones(settings, label, train, later, given)
            seconds[label] = time.perf_counter() - begun
        except ValueError as error:
            remarks.append(f"{label} was left out: {error}")
    return building, frames, seconds


def _of_zones(
    settings: Settings, label: str, train: pd.DataFrame, later: pd.DataFrame, given: Mapping[str, Any]
) -> pd.DataFrame:
    """Back-test of a model of one zone, fitted to each of them."""
    parts = []
    for zone in settings.zones:
        before, after = (without_setpoints(rows_of_zone(rows, settings, zone)) for rows in (train, later))
        one = next(one for one in make_models(settings_of_zone(settings, zone)) if one.label == label)
        model = one.estimator.fit(before, before["T_za"])
        parts.append(backtest(model, after, after["T_za"], **given).assign(zone=zone))
    return pd.concat(parts, ignore_index=True)


def zone_table(frames: Mapping[str, pd.DataFrame], verdicts: Mapping[str, list[Verdict]]) -> pd.DataFrame:
    """Level of the verdicts, errors [K] by model and coverage of each zone, the worst first."""
    errors, own = errors_by_model(frames), frames[HYBRID]
    table = (errors**2).groupby(own["zone"][errors.index], sort=False).mean() ** 0.5
    table = table.reindex(list(verdicts))
    level = pd.Series({name: worst(found) for name, found in verdicts.items()})
    coverage = pd.Series({name: coverage_of(own[own["zone"] == name]) for name in verdicts}, dtype=float)
    by_error = table[HYBRID].sort_values(ascending=False, kind="stable").index
    order = worst_first({str(zone): [level[zone]] for zone in by_error})
    return table.assign(level=level, coverage=coverage).loc[order].rename_axis("zone")


def worst_first(levels: Mapping[str, list[str]]) -> list[str]:
    """Zones by the worst of their levels, those without any last; else in their order."""
    return sorted(levels, key=lambda zone: min(map(WORST_FIRST.index, levels[zone]), default=len(WORST_FIRST)))


def worst(verdicts: list[Verdict]) -> str:
    """The worst level of some verdicts."""
    return min((one.level for one in verdicts), key=WORST_FIRST.index)


def verdicts_by_zone(verdicts: Mapping[str, Sequence[Verdict]]) -> list[Verdict]:
    """The verdicts of all zones in their order, each with the zone in its quantity."""
    pairs = ((zone, one) for zone, found in verdicts.items() for one in found)
    return [one._replace(quantity=f"{one.quantity} of {zone}") for zone, one in pairs]


def judge_zone(frames: Mapping[str, pd.DataFrame], zone: str, doubts: list[str] | None = None) -> Verdict:
    """The verdict on a zone's temperature."""
    own, yesterday = (frames[label][frames[label]["zone"] == zone] for label in (HYBRID, YESTERDAY))
    return judge_temperature(own, yesterday, coverage_of(own), doubts or ())


def _judged(
    model: BuildingPredictor,
    settings: Settings,
    data: StudyData,
    frames: Mapping[str, pd.DataFrame],
    zone: str,
    loads: ZoneLoads | None,
    held: ZonesSetpointsKnown | None,
    of_day: bool,
) -> list[Verdict]:
    """The verdicts on a zone's temperature and, where something heats or cools it, its load."""
    own = data_of(data, settings, zone)
    doubts = Doubts.of(model.own_[zone], data.later, own, setpoints_known=of_day)
    scaled = is_scaled(own.train, settings_of_zone(settings, zone).capacities)
    if held is not None:
        return held.zones[zone].verdicts(zone_of(frames[YESTERDAY], zone), doubts, scaled=scaled)
    out = [judge_zone(frames, zone, doubts.temperature)]
    if loads is not None:
        given: dict[str, Any] = {"scaled": scaled, "doubts": doubts.load}
        out.append(judge_load(loads.own.values, loads.rules, loads.delivered.values, data.test_start, **given))
    return out


def under_setpoints(
    model: BuildingPredictor,
    settings: Settings,
    spans: tuple[pd.DataFrame, pd.DataFrame],
    start: pd.Timestamp,
    frames: Mapping[str, pd.DataFrame],
    remarks: list[str],
) -> ZonesSetpointsKnown | None:
    """The back-test in which the heat is not known, of two ``spans``: training, and the rows after it.

    Of zones that share a plant a remark says that there is none.
    """
    if model.shared_plants_:
        has_setpoints = any(role in spans[1] for role in settings.setpoints)
        what = "loads and forecasts with only the set-points known" if has_setpoints else "loads"
        column = " and ".join(log_columns(model.shared_plants_[:1], settings))
        remarks.append(f"{what} are left out: the zones share the plant of the column {column}")
    return ZonesSetpointsKnown.of(model, spans, start, frames[YESTERDAY], settings, remarks)


def _loads(model: BuildingPredictor, settings: Settings, data: StudyData) -> dict[str, ZoneLoads]:
    """Loads that would have held the measured temperatures, of the zones that something heats or cools."""
    rows = {zone: rows_of_zone(data.later, settings, zone) for zone in settings.zones}
    heated = {zone: plant_roles(own) for zone, own in rows.items() if plant_roles(own)}
    if not heated or model.shared_plants_:
        return {}
    held = {zone: rows[zone]["T_za"].interpolate(limit_direction="both") for zone in heated}
    found, out = model.predict_load(data.later, held), {}
    for zone, roles in heated.items():
        spans, of_zone = data_of(data, settings, zone), settings_of_zone(settings, zone)
        delivered = load_of(pd.concat([spans.train, spans.later]), of_zone, roles)
        own = load_of(forecast_of(found, settings, zone), of_zone, roles)
        assert own is not None  # as the zone has a plant
        assert delivered is not None
        out[zone] = ZoneLoads(own, delivered, loads_by_rule(spans, delivered.values))
    return out


def _load_table(loads: Mapping[str, ZoneLoads], data: StudyData, settings: Settings) -> pd.DataFrame:
    """Error of each zone's load and of that of a day before, and their unit."""
    rows = {}
    for zone in settings.zones:
        rows[zone] = {"load_rmse": np.nan, "load_yesterday": np.nan, "unit": ""}
        if zone in loads:
            errors = loads[zone].errors(data.test_start)
            rmse = np.sqrt((errors**2).mean())
            rows[zone] = {
                "load_rmse": rmse[HYBRID],
                "load_yesterday": rmse[YESTERDAYS_LOAD],
                "unit": loads[zone].delivered.unit,
            }
    return pd.DataFrame.from_dict(rows, orient="index")


def _of_all(
    settings: Settings,
    frames: Mapping[str, pd.DataFrame],
    seconds: Mapping[str, float],
    loads: Mapping[str, ZoneLoads],
    start: pd.Timestamp,
) -> pd.DataFrame:
    """Errors by model over all zones together, the best first."""
    table = error_table(errors_by_model(frames))
    notes = _NOTES | {one.label: one.note for one in make_models(settings) if one.label in _COMPARED}
    table = table.assign(load_rmse=np.nan, seconds=pd.Series(seconds), note=pd.Series(notes)[table.index])
    table = table.sort_values("rmse")
    if loads and all(one.delivered.unit == "kW" for one in loads.values()):
        missed = pd.concat([one.errors(start) for one in loads.values()])
        for name, value in np.sqrt((missed**2).mean()).items():
            table.loc[name, "load_rmse"] = value
            if name not in frames:
                table.loc[name, "note"] = "a rule for the load alone"
    return table.rename_axis("model")


def _next_day(
    model: BuildingPredictor, settings: Settings, data: StudyData, asked: Mapping[str, Any], of_day: bool
) -> pd.DataFrame:
    """Temperatures and loads under the set-points where ``of_day``, else under the known control.

    With intervals as ``asked``.
    """
    temperatures = settings.roles_of("T_za")
    ahead = data.future.drop(columns=temperatures)
    if of_day:
        out = model.forecast(data.history, ahead.drop(columns=plant_roles(ahead)), **asked)
    else:
        with warnings_dropped(PlanWarning):  # the verdict says what lies beyond the training
            out = model.forecast(data.history, ahead, **asked)
        out = out.join(_required(model, settings, data).drop(columns=out.columns, errors="ignore"))
    for zone, role in zip(settings.zones, temperatures, strict=True):
        rows = rows_of_zone(data.future, settings, zone)
        held = setpoints_of(rows) if of_day else data.setpoint[[zone]].loc[ahead.index].set_axis(["setpoint"], axis=1)
        out = out.join(held.add_suffix(f"_{zone}"))
        if data.held_out:
            out[f"T_za_measured_{zone}"] = data.future[role]
            delivered = load_of(rows, settings_of_zone(settings, zone), plant_roles(rows))
            if delivered is not None and delivered.unit == "kW":
                out[f"Q_hvac_delivered_{zone}"] = delivered.values
    return out.rename_axis("time")


def _required(model: BuildingPredictor, settings: Settings, data: StudyData) -> pd.DataFrame:
    """The loads of the next day that hold the set-points of ``[load]``; no columns where zones share a plant."""
    heated = [zone for zone in settings.zones if plant_roles(rows_of_zone(data.future, settings, zone))]
    if not heated or model.shared_plants_:
        return pd.DataFrame(index=data.future.index)
    unmeasured = data.future.assign(**dict.fromkeys(settings.roles_of("T_za"), np.nan))
    held = {zone: data.setpoint[zone].to_numpy() for zone in heated}
    found = model.predict_load(pd.concat([data.history, unmeasured]), held).loc[data.future.index]
    return found[[name for name in found if is_plant(str(name))]]
