"""A fitted predictor with the settings that read its logs, kept in one file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import Any, Self

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, is_plant
from ..exceptions import TooFewDaysError
from ..logs.log_findings import without_standstills
from ..persistence import load_model_and_metadata, save_model
from ..study.compared_models import make_models
from ..study.data import SETPOINT, with_facades
from ..study.run import INTERVAL
from ..study.settings import Settings, settings_from

_DAYS = 56  # of training: longer logs bring seasons that tomorrow does not have
_LEAST_DAYS = 3
_HISTORY = pd.Timedelta("21D")  # least history of a forecast: what its schedules, laws and intervals look back on


@dataclass
class ZoneModel:
    """A model of one zone, as the command line fits, updates and saves it.

    Parameters
    ----------
    predictor : fitted HybridPredictor
    settings : Settings
    """

    predictor: Any
    settings: Settings

    @classmethod
    def fit(cls, settings: Settings, frame: pd.DataFrame, days: int = _DAYS) -> Self:
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
        rows = complete_rows(with_facades(frame, settings))
        step = pd.Timedelta(settings.step)
        if len(rows):
            rows = max(stretches(rows[rows.index > rows.index[-1] - pd.Timedelta(days=days)], step), key=len)
        if len(rows) * step < pd.Timedelta(days=_LEAST_DAYS):
            found = len(rows) * step / pd.Timedelta("1D")
            raise ValueError(
                f"the log has {found:.1f} days in a row with all of {', '.join(map(str, rows))}; a model "
                f"needs {_LEAST_DAYS} (skhybrid check tells which column is missing where)."
            )
        predictor = make_models(settings)[0].estimator
        return cls(predictor.fit(rows, rows["T_za"]), settings)

    @property
    def known_until(self) -> pd.Timestamp:
        """The last stamp that the model knows, in the time zone of the log."""
        stamp = pd.Timestamp(self.predictor.known_until_)
        return stamp if stamp.tz is None else stamp.tz_convert(self.learned_until.tz)

    @property
    def learned_until(self) -> pd.Timestamp:
        """The last stamp that the model learned from."""
        return pd.Timestamp(self.predictor.training_.last)

    def covered(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each input in training, by role."""
        return dict(self.predictor.training_.ranges)

    def facts(self) -> dict[str, Any]:
        """Name, training span and inputs, as plain values."""
        record = self.predictor.training_
        return {
            "name": self.settings.name,
            "learned from": f"{record.first} to {record.last}",
            "rows": record.n_rows,
            "inputs": ", ".join(self.covered()),
            "thermostat": "learned" if self.predictor.thermostat_learned_ else "ideal (no set-points in the log)",
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
            self.predictor.partial_fit(new, new["T_za"])
        elif len(new):
            self.predictor.update(new)
        return len(new)

    def complete(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The rows of a log that have all that the model reads.

        Parameters
        ----------
        frame : DataFrame, one column per role
        """
        return complete_rows(with_facades(frame, self.settings))

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
                "no row of the log has all inputs and a temperature; skhybrid check tells which are missing."
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
            ``T_za`` [degC], ``q_0.1`` and ``q_0.9``; under a thermostat also ``Q_hvac`` [kW] and its quantiles.
        """
        future = with_facades(future, self.settings)
        setpoint = self._ideal_setpoint(future)
        ahead = future.drop(columns=[role for role in SETPOINT_ROLES if setpoint is not None and role in future])
        if setpoint is None:
            return self._with_intervals(history, ahead)
        found = self.predictor.forecast(history, ahead, setpoint=setpoint)
        planned = future.assign(**{r: found[r] for r in self._plant() if r in found})
        bands = self._with_intervals(history, planned.drop(columns=list(SETPOINT_ROLES), errors="ignore"))
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
        given = [role for role in SETPOINT_ROLES if role in future]
        if not given or self.predictor.thermostat_learned_ or any(map(is_plant, future)):
            return None
        return tuple(future[role].to_numpy() if role in future else None for role in SETPOINT_ROLES)


def complete_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows with every input, up to the last measured temperature; set-points are filled from the rows before."""
    if "T_za" not in frame:
        raise ValueError("the log has no room temperature, T_za.")
    held = {role: frame[role].ffill().bfill() for role in SETPOINT_ROLES if role in frame}
    frame = frame.assign(T_za=without_standstills(frame["T_za"]), **held)
    known = np.flatnonzero(frame["T_za"].notna().to_numpy())
    rows = frame.drop(columns=SETPOINT, errors="ignore").iloc[: known[-1] + 1 if len(known) else 0]
    return rows[rows.drop(columns="T_za").notna().all(axis=1)]


def stretches(rows: pd.DataFrame, step: pd.Timedelta) -> list[pd.DataFrame]:
    """The rows between gaps, in their order."""
    breaks = np.flatnonzero(np.diff(pd.DatetimeIndex(rows.index).as_unit("ns").asi8) != step.value) + 1
    return [rows.iloc[a:b] for a, b in pairwise([0, *breaks, len(rows)])]
