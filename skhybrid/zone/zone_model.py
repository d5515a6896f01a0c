"""A fitted predictor with the settings that read its logs, kept in one file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, Self

import pandas as pd

from .._table import SETPOINT_ROLES, is_plant, plant_roles
from .._time import LONGEST_BRIDGE
from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import INTERVAL, quantile_columns
from ..persistence import load_model_and_metadata, save_model
from ..study.compared_models import make_models
from ..study.log_split import with_facades
from ..study.settings import Settings, is_scaled, settings_from
from ..study.spans import NO_ROWS, TRAINING_DAYS
from ..study.zone_loads import of_whole_plant
from ..study.zone_part import measured_of, predictors_of, read_roles, roles_of, settings_of_zone
from .complete_rows import refuse_cut_value
from .dead_meters import not_learned
from .other_units import refuse_other_temperatures, refuse_other_units
from .readable_log import ReadableLog
from .training_rows import training_rows
from .wanted_setpoints import has_plant, wanted_setpoints

_NO_SET_POINTS = "no set-points{} in the log"
_NEVER_MOVED = "the log is too short, or the plant or set-points{} never moved"


@dataclass
class ZoneModel:
    """A model of one zone or of a building, as the command line fits, updates and saves it.

    Parameters
    ----------
    predictor : fitted HybridPredictor, or BuildingPredictor where the settings have several zones
    settings : Settings
    """

    predictor: Any
    settings: Settings

    @classmethod
    def fit(cls, settings: Settings, frame: pd.DataFrame, days: int = TRAINING_DAYS) -> Self:
        """Fit the predictor of the settings on the last days of a log (:func:`training_rows`).

        Parameters
        ----------
        settings : Settings
        frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
        days : int, number of days at the end of the log to learn from

        Raises
        ------
        ValueError
            If no three days of the log have all inputs and a temperature.
        """
        rows = training_rows(frame, settings, days)
        return cls(make_models(settings)[0].estimator.fit(rows, measured_of(rows, settings)), settings)

    @property
    def zones(self) -> list[str]:
        """Names of the zones of a building; empty for one zone."""
        return self.settings.zones

    @property
    def _of_zones(self) -> dict[str, Any]:
        """The predictor of each zone by itself, by its name; of one zone by an empty name."""
        return predictors_of(self.predictor)

    @property
    def _with_ideal(self) -> list[str]:
        """The zones with a plant whose thermostat was not learned."""
        return [z for z, m in self._of_zones.items() if not m.thermostat_learned_ and has_plant(m)]

    def parts(self) -> dict[str, ZoneModel]:
        """The model of each zone by itself, by its name; of one zone this one, by an empty name."""
        if not self.zones:
            return {"": self}
        return {zone: ZoneModel(one, settings_of_zone(self.settings, zone)) for zone, one in self._of_zones.items()}

    def ideal_zones(self, future: pd.DataFrame) -> list[str]:
        """The zones that an ideal thermostat holds at given set-points, as theirs was not learned.

        Parameters
        ----------
        future : DataFrame, the rows ahead, as :meth:`forecast` takes them
        """
        return self._ideal_under(wanted_setpoints(self.settings, self._of_zones, future))

    def _ideal_under(self, wanted: Mapping[str, Any] | None) -> list[str]:
        return [zone for zone in self._with_ideal if (wanted or {}).get(zone) is not None]

    @property
    def thermostat_learned(self) -> bool:
        """Whether the thermostats of all zones with a plant were learned."""
        return bool(self._plant()) and not self._with_ideal

    @property
    def known_until(self) -> pd.Timestamp:
        """The last stamp that the model knows, in the time zone of the log."""
        return pd.Timestamp(next(iter(self._of_zones.values())).known_until_)

    @property
    def learned_until(self) -> pd.Timestamp:
        """The last stamp that the model learned from."""
        return pd.Timestamp(self.predictor.training_.last)

    def covered(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each input in training, by role."""
        found: dict[str, tuple[float, float]] = {}
        roles = read_roles(self.settings)
        for zone, model in self._of_zones.items():
            names = roles_of(roles, self.settings, zone)
            found |= {names.get(role, role): span for role, span in model.training_.ranges.items()}
        return found

    @property
    def scaled(self) -> bool:
        """Whether measured heat or known capacities fix what a kW is, in every zone with a plant."""
        inputs = [(part.covered(), part.settings.capacities) for part in self.parts().values()]
        return all(is_scaled(roles, capacities) for roles, capacities in inputs if any(map(is_plant, roles)))

    def facts(self) -> dict[str, Any]:
        """Name, training span and inputs, as plain values."""
        record = self.predictor.training_
        zones = {"zones": ", ".join(self.zones)} if self.zones else {}
        some = any(model.thermostat_learned_ for model in self._of_zones.values())
        unlearned = "learned in part" if some else "ideal"
        return {
            "name": self.settings.name,
            **zones,
            "learned from": f"{record.first} to {record.last}",
            "rows": record.n_rows,
            "inputs": ", ".join(self.covered()),
            "thermostat": "learned" if self.thermostat_learned else f"{unlearned} ({self.why_ideal})",
        }

    @property
    def why_ideal(self) -> str:
        """The reason why no thermostat was learned, with the names of zones where there are several."""
        found: dict[str, list[str]] = {}
        parts = self.parts()
        for zone in self._with_ideal or [""]:
            known = any(role in parts.get(zone, self).settings.columns for role in SETPOINT_ROLES)
            found.setdefault(_NEVER_MOVED if known else _NO_SET_POINTS, []).append(zone)
        return "; ".join(why.format(f" of {', '.join(zones)}" if any(zones) else "") for why, zones in found.items())

    def update(self, frame: pd.DataFrame, *, relearn: bool = False) -> int:
        """Take in the rows of a log that are new, and learn from them if wanted; returns their number.

        Parameters
        ----------
        frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
        relearn : bool, whether to fit anew on the last eight weeks, also where no row is new

        Raises
        ------
        ValueError
            If they follow the known rows only after an outage of more than four days; if known temperatures are others
            in the log; if new rows are in another unit, or the last temperature leaps.
        """
        return self.take_in(self.readable(frame), relearn=relearn)

    def take_in(self, log: ReadableLog, *, relearn: bool = False) -> int:
        """As :meth:`update`, from a log as :meth:`readable` returns it.

        Parameters
        ----------
        log : ReadableLog
        relearn : bool, as for :meth:`update`
        """
        known = self.known_rows()
        refuse_other_temperatures(log.frame, known, self.settings, "the model")
        n_new, why = len(log.new_rows(self.known_until)), log.outage(self.known_until, LONGEST_BRIDGE)
        if why:
            raise ValueError(
                f"{why}, and it cannot go on from there: fit the model again with skhybrid fit, on rows after that."
            )
        if not n_new and not relearn:
            return 0
        new = log.following(known, self.known_until) if n_new else log.complete.dropna().iloc[-1:]
        if new.empty:
            raise ValueError(NO_ROWS)
        refuse_other_units(new, known, self.covered(), self.settings)
        refuse_cut_value(log.frame, self.settings, new.index[-1])
        if relearn:
            self.predictor.partial_fit(new, measured_of(new, self.settings))
        else:
            self.predictor.update(new)
        return n_new

    def known_rows(self) -> pd.DataFrame:
        """The last rows that the model knows, a day or more, with the columns of a log by role."""
        roles, found = read_roles(self.settings), dict[str, pd.Series]()
        for zone, model in self._of_zones.items():
            names, rows = roles_of(roles, self.settings, zone), model.known_rows_
            found |= {names.get(str(role), str(role)): rows[role] for role in rows}
        return pd.DataFrame(found)

    def readable(self, frame: pd.DataFrame) -> ReadableLog:
        """The rows of a log that the model can read.

        Parameters
        ----------
        frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
        """
        return ReadableLog(frame, self.settings, self.not_learned)

    @property
    def not_learned(self) -> dict[str, list[str]]:
        """Roles of heat that a zone was learned without, by zone: their meters had no values."""
        return not_learned(self.settings, self.covered())

    def forecast(self, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame:
        """The day after a history, with 80 % intervals where the model has learned them.

        The thermostat acts where ``future`` has set-points and no heat.

        Parameters
        ----------
        history : DataFrame, as :attr:`ReadableLog.history`
        future : DataFrame, the rows ahead with weather, and heat or set-points

        Returns
        -------
        DataFrame
            ``T_za`` [degC], ``q_0.1`` and ``q_0.9``; under a thermostat also ``Q_hvac`` [kW] and its quantiles.  Of
            several zones each name ends with the zone's.
        """
        ahead, wanted, given = self.asked(future)
        found = self._with_intervals(history, ahead, **given)
        ideal = self._ideal_under(wanted)
        if not ideal:
            return of_whole_plant(found)
        bands = self._with_intervals(history, ahead.assign(**{r: found[r] for r in self._plant() if r in found}))
        for of in (f"_{zone}" if zone else "" for zone in ideal):  # errors of the forecast, about the set-point
            own = [f"{q}{of}" for q in quantile_columns(INTERVAL) if f"{q}{of}" in bands]
            bands[own] = bands[own].add(found[f"T_za{of}"] - bands[f"T_za{of}"], axis=0)
        return of_whole_plant(found).join(bands[[c for c in bands if str(c).startswith("q_") and c not in found]])

    def asked(self, future: pd.DataFrame) -> tuple[pd.DataFrame, Mapping[str, Any] | None, dict[str, Any]]:
        """The rows ahead, set-points by zone (None under given heat), and with these what the predictor is asked for.

        Parameters
        ----------
        future : DataFrame, as for :meth:`forecast`
        """
        future = with_facades(future, self.settings)
        wanted = wanted_setpoints(self.settings, self._of_zones, future)
        ahead = future.drop(columns=self.settings.setpoints, errors="ignore")
        if wanted is None:
            return ahead, None, {}
        return ahead, wanted, {"setpoint": wanted if self.zones else wanted[""], "limits": self._limits()}

    def save(self, path: str | PathLike[str]) -> None:
        """Write predictor and settings to one file, which is replaced in one step.

        Parameters
        ----------
        path : path-like
        """
        settings = json.dumps(self.settings.as_dict(), default=str)
        save_model(self.predictor, path, metadata={"settings": settings})

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read what :meth:`save` wrote.

        Parameters
        ----------
        path : path-like

        Raises
        ------
        skhybrid.exceptions.ModelFileError
            As :func:`skhybrid.persistence.load_model`.
        ValueError
            If the file has a model without the settings of its log.
        """
        predictor, metadata = load_model_and_metadata(path)
        text = metadata.get("settings")
        if text is None:
            raise ValueError(f"{path} holds a model without the settings of a log; make it with skhybrid fit.")
        given = {key: value for key, value in json.loads(text).items() if value is not None}
        return cls(predictor, settings_from(given))

    def _with_intervals(self, history: pd.DataFrame, future: pd.DataFrame, **given: Any) -> pd.DataFrame:
        bands = {"quantiles": INTERVAL, "weather_error": self.settings.weather_error}
        try:
            return self.predictor.forecast(history, future, **given, **bands)
        except TooFewDaysError:
            return self.predictor.forecast(history, future, **given)

    def _limits(self) -> tuple[float | None, float | None] | None:
        """Limits of the plant by the settings [kW]."""
        most, cold = map(self.settings.plant.get, ("most_heat", "most_cold"))
        if (most is None and cold is None) or not self._plant():
            return None
        return (None if cold is None else -cold), most

    def _plant(self) -> list[str]:
        """Roles of the plant as the model reads them: meters of heat and cold are one, ``Q_hvac``."""
        return plant_roles(self.covered())
