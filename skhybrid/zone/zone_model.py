"""A fitted predictor with the settings that read its logs, kept in one file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import Any, Self

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, is_plant
from ..exceptions import TooFewDaysError
from ..hybrid import BuildingPredictor
from ..logs.log_findings import without_standstills
from ..persistence import load_model_and_metadata, save_model
from ..study.compared_models import make_models
from ..study.data import SETPOINT, TRAINING_DAYS, with_facades
from ..study.scores import INTERVAL
from ..study.settings import Settings, settings_from
from ..study.zone_part import settings_of

_LEAST_DAYS = 3
_HISTORY = pd.Timedelta("21D")  # least history of a forecast: what its schedules, laws and intervals look back on


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
        """Fit the predictor of the settings on the last days of a log, on their longest stretch without a gap.

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
        rows = complete_rows(with_facades(frame, settings), settings.roles_of("T_za"))
        step = pd.Timedelta(settings.step)
        if len(rows):
            rows = max(stretches(rows[rows.index > rows.index[-1] - pd.Timedelta(days=days)], step), key=len)
        if len(rows) * step < pd.Timedelta(days=_LEAST_DAYS):
            found = len(rows) * step / pd.Timedelta("1D")
            raise ValueError(
                f"the log has {found:.1f} days in a row with all of {', '.join(map(str, rows))}; a model "
                f"needs {_LEAST_DAYS} (skhybrid check shows which column is missing where)."
            )
        predictor = make_models(settings)[0].estimator
        if settings.zones:
            building = BuildingPredictor(predictor, adjacency=settings.adjacency)
            return cls(building.fit(rows, measured_of(rows, settings)), settings)
        return cls(predictor.fit(rows, measured_of(rows, settings)), settings)

    @property
    def zones(self) -> list[str]:
        """Names of the zones of a building; empty for one zone."""
        return self.settings.zones

    @property
    def _of_zones(self) -> dict[str, Any]:
        """The predictor of each zone by itself, by its name; of one zone by an empty name."""
        return dict(self.predictor.own_) if self.zones else {"": self.predictor}

    def parts(self) -> dict[str, ZoneModel]:
        """The model of each zone by itself, by its name; of one zone this one, by an empty name."""
        if not self.zones:
            return {"": self}
        return {zone: ZoneModel(one, settings_of(self.settings, zone)) for zone, one in self._of_zones.items()}

    @property
    def thermostat_learned(self) -> bool:
        """Whether the thermostats of all zones were learned."""
        return all(model.thermostat_learned_ for model in self._of_zones.values())

    @property
    def known_until(self) -> pd.Timestamp:
        """The last stamp that the model knows, in the time zone of the log."""
        stamp = pd.Timestamp(next(iter(self._of_zones.values())).known_until_)
        return stamp if stamp.tz is None else stamp.tz_convert(self.learned_until.tz)

    @property
    def learned_until(self) -> pd.Timestamp:
        """The last stamp that the model learned from."""
        return pd.Timestamp(self.predictor.training_.last)

    def covered(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each input in training, by role."""
        found = {}
        for zone, model in self._of_zones.items():
            for role, span in model.training_.ranges.items():
                own = f"{role}_{zone}"
                found[own if own in self.settings.columns else role] = span
        return found

    def facts(self) -> dict[str, Any]:
        """Name, training span and inputs, as plain values."""
        record = self.predictor.training_
        zones = {"zones": ", ".join(self.zones)} if self.zones else {}
        return {
            "name": self.settings.name,
            **zones,
            "learned from": f"{record.first} to {record.last}",
            "rows": record.n_rows,
            "inputs": ", ".join(self.covered()),
            "thermostat": "learned" if self.thermostat_learned else "ideal (no set-points in the log)",
        }

    def update(self, frame: pd.DataFrame, *, relearn: bool = False) -> int:
        """Take in the rows of a log that are new, and learn from them if wanted; returns their number.

        Parameters
        ----------
        frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
        relearn : bool, whether to fit anew on the last eight weeks

        Raises
        ------
        ValueError
            If they do not follow the known rows without a gap.
        """
        new = self.new_rows(frame)
        if len(new) and relearn:
            self.predictor.partial_fit(new, measured_of(new, self.settings))
        elif len(new):
            self.predictor.update(new)
        return len(new)

    def complete(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The rows of a log that have all that the model reads.

        Parameters
        ----------
        frame : DataFrame, one column per role
        """
        return complete_rows(with_facades(frame, self.settings), self.settings.roles_of("T_za"))

    def new_rows(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The complete rows of a log after those that the model knows.

        Parameters
        ----------
        frame : DataFrame, one column per role
        """
        rows = self.complete(frame)
        zoned = pd.DatetimeIndex(rows.index).tz is not None
        until = self.known_until if zoned else self.known_until.tz_localize(None)
        return rows[rows.index > until]

    def history(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The rows of a log that a forecast starts from: the last unbroken ones.

        Parameters
        ----------
        frame : DataFrame, one column per role
        """
        rows = self.complete(frame)
        if rows.empty:
            raise ValueError(
                "no row of the log has all inputs and a temperature; skhybrid check shows which are missing."
            )
        rows = stretches(rows, pd.Timedelta(self.settings.step))[-1]
        return rows[rows.index > rows.index[-1] - _HISTORY]

    def forecast(self, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame:
        """The day after a history, with 80 % intervals where the model has learned them.

        The thermostat acts where ``future`` has set-points and no heat.

        Parameters
        ----------
        history : DataFrame, as :meth:`history` returns
        future : DataFrame, the rows ahead with weather, and heat or set-points

        Returns
        -------
        DataFrame
            ``T_za`` [degC], ``q_0.1`` and ``q_0.9``; under a thermostat also ``Q_hvac`` [kW] and its quantiles.  Of
            several zones each name ends with the zone's.
        """
        future = with_facades(future, self.settings)
        setpoint = self._ideal_setpoint(future)
        ahead = future.drop(
            columns=[role for role in self.settings.setpoints if setpoint is not None and role in future]
        )
        if setpoint is None:
            return self._with_intervals(history, ahead)
        found = self.predictor.forecast(history, ahead, setpoint=setpoint)
        planned = future.assign(**{r: found[r] for r in self._plant() if r in found})
        bands = self._with_intervals(history, planned.drop(columns=self.settings.setpoints, errors="ignore"))
        if self.zones:  # each model of a zone has its own heat, and the temperature is that under their blend
            found = found.assign(**{role: bands[role] for role in self.settings.roles_of("T_za")})
        return found.join(bands[[c for c in bands if str(c).startswith("q_")]])

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

    def _with_intervals(self, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame:
        try:
            return self.predictor.forecast(history, future, quantiles=INTERVAL)
        except TooFewDaysError:
            return self.predictor.forecast(history, future)

    def _plant(self) -> list[str]:
        return [role for role in self.settings.columns if is_plant(role)]

    def _ideal_setpoint(self, future: pd.DataFrame) -> Any:
        """Set-points to hold by an ideal plant: where none was learned and the rows ahead have no heat."""
        given = [role for role in self.settings.setpoints if role in future]
        if not given or self.thermostat_learned or any(map(is_plant, future)):
            return None
        if not self.zones:
            return tuple(future[role].to_numpy() if role in future else None for role in SETPOINT_ROLES)
        by_zone = {zone: [f"{role}_{zone}" for role in SETPOINT_ROLES] for zone in self.zones}
        return {
            zone: tuple(future[r].to_numpy() if r in future else None for r in own) for zone, own in by_zone.items()
        }


def measured_of(rows: pd.DataFrame, settings: Settings) -> Any:
    """The temperature of the zone; of several zones a column for each."""
    return rows[settings.roles_of("T_za")] if settings.zones else rows["T_za"]


def complete_rows(frame: pd.DataFrame, measured: Sequence[str] = ("T_za",)) -> pd.DataFrame:
    """Rows with every input, up to the last measured temperature; set-points are filled from the rows before.

    ``measured`` are the roles of the zones' temperatures.
    """
    measured = list(measured)
    for role in measured:
        if role not in frame:
            raise ValueError(f"the log has no room temperature, {role}.")
    of_zones = () if measured == ["T_za"] else tuple(f"{role}_" for role in SETPOINT_ROLES)
    set_points = [role for role in frame if role in SETPOINT_ROLES or str(role).startswith(of_zones)]
    held = {str(role): frame[role].ffill().bfill() for role in set_points}
    frame = frame.assign(**{role: without_standstills(frame[role]) for role in measured}, **held)
    known = np.flatnonzero(frame[measured].notna().any(axis=1).to_numpy())
    rows = frame.drop(columns=SETPOINT, errors="ignore").iloc[: known[-1] + 1 if len(known) else 0]
    return rows[rows.drop(columns=measured).notna().all(axis=1)]


def stretches(rows: pd.DataFrame, step: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between gaps, in their order."""
    breaks = np.flatnonzero(np.diff(pd.DatetimeIndex(rows.index).as_unit("ns").asi8) != step.value) + 1
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]
