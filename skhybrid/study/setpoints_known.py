"""Back-test of the task that users have: weather and set-points are known ahead, the heat of the plant is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import plant_roles
from ..forecasting.quantiles import INTERVAL, load_quantile_columns, quantile_columns
from .compared_models import HYBRID, YESTERDAY
from .doubts import Doubts
from .load_rules import LAST_WEEK, USUAL, past_loads
from .load_rules import YESTERDAY as YESTERDAYS_LOAD
from .log_split import setpoints_of
from .scores import backtest_with_intervals, coverage_of, error_table, errors_by_model, has_intervals
from .settings import Settings
from .verdict import Verdict, judge_load_errors, judge_temperature
from .zone_loads import load_of
from .zone_part import Study, log_columns, predictors_of, zone_of

#: rows of the table that are rules, with a note on each
_NOTES = {
    HYBRID: "network, thermostat and plant as learned, blended with a direct regression and last week",
    YESTERDAY: "the temperature at this time of the last day before",
    YESTERDAYS_LOAD: "that at this time of the last day before",
    LAST_WEEK: "that at this time of the last week before",
    USUAL: "mean of all earlier working days, or weekends",
}
LOAD_INTERVAL = tuple(load_quantile_columns(INTERVAL))


class SetpointsKnown(NamedTuple):
    """Forecasts of temperature and load under set-points, beside simple rules: of a zone, or of several together."""

    frame: pd.DataFrame  # the back-test, with the columns of the plant
    load: pd.Series  # measured, in the rows of ``frame`` [unit]
    loads: dict[str, pd.Series]  # of the hybrid, and of each rule
    unit: str  # of the load: "kW", or "-" for stages without a known capacity
    table: pd.DataFrame  # index: model; rmse and mae [K], load_rmse [unit], note
    coverage: float | None  # share of the temperatures inside the 80 % intervals
    load_coverage: float | None  # the same of a load that is one meter's
    weather: str  # what was known of it ahead
    as_usual: bool = False  # whether no thermostat was learned, and the plant ran as usual

    zones: Mapping[str, SetpointsKnown] = MappingProxyType({})  # each of several zones by its name

    @classmethod
    def of(cls, model: Any, study: Study, yesterday: pd.DataFrame) -> Self | None:
        """Back-test a fitted model at the origins of the back-test of ``yesterday``.

        None where no zone has set-points and a plant, or zones share a plant.  A remark says so of zones that share
        one, where no thermostat was learned, and where something is wrong with the set-points.
        """
        settings, parts = study.settings, study.by_zone
        rows = [own.data.later for own in parts.values()]
        has_thermostat = any(plant_roles(own) and not setpoints_of(own).empty for own in rows)
        if shared := getattr(model, "shared_plants_", ()):
            what = "loads and forecasts with only the set-points known" if has_thermostat else "loads"
            column = " and ".join(log_columns(shared[:1], settings))
            study.remarks.append(f"{what} are left out: the zones share the plant of the column {column}")
        if shared or not has_thermostat:
            return None
        try:
            frame = backtest_with_intervals(model, study, heat_known=False, weather_error=settings.weather_error)
        except ValueError as error:
            study.remarks.append(f"forecasts with only the set-points known were not tested: {error}")
            return None
        zones = {}
        for zone, predictor in predictors_of(model).items():
            as_usual = bool(plant_roles(parts[zone].past)) and not predictor.thermostat_learned_
            own = cls._of_zone(zone_of(frame, zone), parts[zone], zone_of(yesterday, zone))
            zones[zone] = own._replace(as_usual=as_usual)
        return cls.together(zones, yesterday) if settings.zones else zones[""]

    @classmethod
    def _of_zone(cls, frame: pd.DataFrame, study: Study, yesterday: pd.DataFrame) -> Self:
        """A back-test of one zone beside the rules, which know its past rows; without a plant it has no load."""
        past, settings = study.past, study.settings
        roles = plant_roles(past)
        load, level = load_of(past, settings, roles), settings.weather_error
        weather = "the weather" if level is None else f"a forecast of the weather ({level} errors)"
        if load is None:
            unknown = pd.Series(np.nan, frame.index)
            return cls._beside(yesterday, frame, unknown, {}, unit="kW", load_coverage=None, weather=weather)
        measured, own = (_load_in(frame, ending, settings, roles) for ending in ("_true", "_pred"))
        coverage = None
        if roles == ["Q_hvac"] and has_intervals(frame):
            low, high = (frame[name] for name in LOAD_INTERVAL)
            coverage = float(measured.between(low, high)[measured.notna()].mean())
        loads = {HYBRID: own, **past_loads(load.values, frame, settings.holidays)}
        given: dict[str, Any] = {"unit": load.unit, "load_coverage": coverage, "weather": weather}
        return cls._beside(yesterday, frame, measured, loads, **given)

    @classmethod
    def together(cls, zones: Mapping[str, Self], yesterday: pd.DataFrame) -> Self:
        """Zones as one, whose back-test has a column ``zone``; without loads where those have several units."""
        frame = pd.concat([one.frame.assign(zone=zone) for zone, one in zones.items()], ignore_index=True)
        parts = list(zones.values())
        loaded = [one for one in parts if one.loads]
        units = {one.unit for one in loaded}
        names = loaded[0].loads if len(units) == 1 else {}

        def joined(name: str) -> pd.Series:
            return pd.concat([one.loads.get(name, one.load) for one in parts], ignore_index=True)

        loads = {name: joined(name) for name in names}
        measured = pd.concat([one.load for one in parts], ignore_index=True)
        contained = [one.load_coverage for one in loaded if one.load_coverage is not None]
        known = [one.load.notna().sum() for one in loaded]
        whole = len(contained) == len(loaded) > 0 and sum(known) > 0
        coverage = float(np.average(contained, weights=known)) if whole else None
        unit = units.pop() if len(units) == 1 else "kW"
        given: dict[str, Any] = {"unit": unit, "load_coverage": coverage, "weather": parts[0].weather}
        return cls._beside(yesterday, frame, measured, loads, **given, zones=dict(zones))

    @classmethod
    def _beside(
        cls, yesterday: pd.DataFrame, frame: pd.DataFrame, load: pd.Series, loads: dict[str, pd.Series], **known: Any
    ) -> Self:
        """A back-test with the errors of its loads, and of the temperature of a day before."""
        table = error_table(errors_by_model({HYBRID: frame, YESTERDAY: yesterday}))
        table = table.reindex(list(dict.fromkeys([HYBRID, *loads, YESTERDAY])))
        errors = pd.DataFrame(loads, frame.index).sub(load, axis=0).dropna(axis=1, how="all").dropna()
        table = table.assign(load_rmse=np.sqrt((errors**2).mean()), note=pd.Series(_NOTES))
        table = table.sort_values(["rmse", "load_rmse"]).rename_axis("model")
        return cls(frame=frame, load=load, loads=loads, table=table, coverage=coverage_of(frame), **known)

    @property
    def load_name(self) -> str:
        """Name of the load: heat, or stages where no capacity is known."""
        return "load" if self.unit == "kW" else "stage"

    @property
    def usual_words(self) -> str:
        """The zones whose plant ran as usual, in a sentence; empty where there are none."""
        named = ", ".join(zone for zone, one in self.zones.items() if one.as_usual)
        return f"No thermostat was learned of {named}; their heat is forecast as it usually was." if named else ""

    @property
    def words(self) -> str:
        """Errors of temperature and load in one sentence, beside those of the best rules."""
        rules = self.table.drop(index=HYBRID)
        own, unit = self.table.loc[HYBRID], f" {self.unit}".removesuffix(" -")
        of_temperature = (
            f"With {self.weather} and the set-points known, and the heat not, the {HYBRID} model errs by "
            f"{own['rmse']:.2f} K (the temperature a day before: {rules['rmse'].min():.2f} K)"
        )
        if not self.loads:
            return f"{of_temperature}."
        best = rules["load_rmse"].idxmin()
        return (
            f"{of_temperature}, and its {self.load_name} by {own['load_rmse']:.2f}{unit} "
            f"({best}: {rules['load_rmse'].min():.2f}{unit})."
        )

    @property
    def columns(self) -> pd.DataFrame:
        """The forecasts of the back-test, to be put beside those under known heat."""
        of_temperature = {"y_pred": HYBRID} | {name: name for name in quantile_columns(INTERVAL)}
        names = {name: f"{shown}, set-points known" for name, shown in of_temperature.items()}
        shared = ["origin", "lead", "time", "y_true", "zone"]
        return self.frame.drop(columns=shared, errors="ignore").rename(columns=names)

    def as_dict(self) -> dict[str, Any]:
        """Errors and coverage as plain values."""
        return {
            "models": self.table.drop(columns="note").to_dict(orient="index"),
            "load_unit": self.unit,
            "interval_80_coverage": self.coverage,
            "load_interval_80_coverage": self.load_coverage,
            **({"zones": {zone: one.as_dict() for zone, one in self.zones.items()}} if self.zones else {}),
        }

    @property
    def with_zones(self) -> Self:
        """All zones together, with a column of the table for each."""
        errors = {f"rmse_{zone}": one.table["rmse"] for zone, one in self.zones.items()}
        errors |= {f"load_rmse_{zone}": one.table["load_rmse"] for zone, one in self.zones.items() if one.loads}
        return self._replace(table=self.table.assign(**errors), zones={})

    @property
    def by_zone(self) -> pd.DataFrame:
        """Errors and coverage of each zone beside the rules, by the names of a table to be read."""
        rows = {}
        for zone, one in self.zones.items():
            rmse, load, unit = one.table["rmse"], one.table["load_rmse"], one.unit if one.loads else ""
            rows[zone] = {
                f"{HYBRID} [K]": rmse[HYBRID],
                f"{YESTERDAY} [K]": rmse[YESTERDAY],
                "in 80 % interval": one.coverage,
            }
            names = {HYBRID: one.load_name} | {name: name for name in one.loads if name != HYBRID}
            rows[zone] |= {f"{shown} [{unit}]": load[name] for name, shown in names.items() if unit}
            if one.load_coverage is not None:
                rows[zone]["load in 80 % interval"] = one.load_coverage
        return pd.DataFrame.from_dict(rows, orient="index", dtype=float)

    def verdicts(self, yesterday: pd.DataFrame, doubts: Doubts, *, scaled: bool) -> list[Verdict]:
        """The verdicts on temperature and load, beside the back-test of ``yesterday`` and the rules."""
        errors = {name: load - self.load for name, load in self.loads.items()}
        given: dict[str, Any] = {"scaled": scaled, "coverage": self.load_coverage, "doubts": doubts.load}
        found = [judge_temperature(self.frame, yesterday, self.coverage, doubts.temperature)]
        if errors:
            found.append(judge_load_errors(errors.pop(HYBRID), errors, self.frame["origin"], **given))
        known = f"{self.weather} and the set-points were known ahead, the heat was not"
        if self.as_usual:
            known = f"{self.weather} was known ahead; no thermostat was learned, so the heat was forecast as usual"
        return [one._replace(reasons=(known, *one.reasons)) for one in found]


def _load_in(frame: pd.DataFrame, ending: str, settings: Settings, roles: Sequence[str]) -> pd.Series:
    """The load of the plant's columns with an ending, in the unit that the log allows."""
    rows = frame[[f"{role}{ending}" for role in roles]].set_axis(list(roles), axis=1)
    load = load_of(rows, settings, roles)
    assert load is not None  # as there are roles
    return load.values
