"""State of a zone folder: what was measured, and how past forecasts did, of one zone or of each of several."""

from __future__ import annotations

from typing import Any

import pandas as pd

from .._clock import on_clock_of
from .._table import SETPOINT_ROLES
from .._warnings import several
from ..logs.standstills import without_standstills
from ..study.doubts import drift_days
from ..study.settings import Settings
from ..study.verdict import CARE, Verdict, worst_first
from ..study.zone_loads import delivered_in_kw
from ..study.zone_part import each_zone, forecast_of, rows_of_zone, settings_of_zone
from .forecast_archive import BEYOND, ForecastArchive
from .forecast_scores import errors_of, verdicts_of
from .zone_model import ZoneModel

_CORRECTED = pd.Timedelta(days=7)  # age up to which rows of the log may still change
_SILENT = pd.Timedelta(days=1)  # age from which on the last temperature of a zone is old
_SCORED = pd.Timedelta(days=28)
_MEASURED = "_measured"  # how columns of a finished forecast end that were measured


class ZoneArchive(ForecastArchive):
    """The part of one zone in the archive of a building, by the names that a single zone has."""

    def __init__(self, archive: ForecastArchive, settings: Settings, zone: str) -> None:
        super().__init__(archive.database)
        self._settings, self._zone = settings, zone  # of the building; name

    def last_temperature(self, zone: str = "") -> pd.Timestamp | None:
        """Stamp of the zone's last temperature, None where there is none."""
        return super().last_temperature(zone or self._zone)

    def finished(self, since: pd.Timestamp) -> pd.DataFrame:
        """The forecasts whose rows are all in the past, with what was measured."""
        rows = super().finished(since)
        ends = {str(name): str(name).removesuffix(_MEASURED) for name in rows if str(name).endswith(_MEASURED)}
        measured = self._own(rows[list(ends)].rename(columns=ends)).add_suffix(_MEASURED)
        return pd.concat([rows[["origin", "time"]], self._own(rows.drop(columns=list(ends))), measured], axis=1)

    def measured(self, since: pd.Timestamp) -> pd.DataFrame:
        """Measured temperature and delivered heat by time."""
        return self._own(super().measured(since))

    def latest(self) -> pd.DataFrame:
        """The rows of the last forecast by time."""
        return self._own(super().latest())

    def _own(self, rows: pd.DataFrame) -> pd.DataFrame:
        own = forecast_of(rows, self._settings, self._zone)
        shared = [name for name in (BEYOND, *SETPOINT_ROLES) if name in rows and name not in own]
        return own.join(rows[shared])


def archives_of(archive: ForecastArchive, zone: ZoneModel) -> dict[str, ForecastArchive]:
    """The archive of each zone by its name; of one zone by an empty name."""
    return {name: ZoneArchive(archive, zone.settings, name) for name in zone.zones} or {"": archive}


def status_of(archive: ForecastArchive, zone: ZoneModel) -> dict[str, Any]:
    """Report the last row, drift, verdicts and errors, as plain values; of several zones the worst zone first."""
    forecast = archive.latest()
    found = {
        "name": zone.settings.name,
        "last row": _shown(archive.last_measured(), zone),
        "last forecast from": _shown(None if forecast.empty else forecast.index[0], zone),
        "learned until": str(zone.learned_until),
    }
    parts, archives = zone.parts(), archives_of(archive, zone)
    states = {name: _state_of(archives[name], part) for name, part in parts.items()}
    if not zone.zones:
        return found | states[""]
    levels = {name: [one["level"] for one in state["verdicts"]] for name, state in states.items()}
    return found | {"zones": {name: states[name] for name in worst_first(levels)}}


def _state_of(archive: ForecastArchive, zone: ZoneModel) -> dict[str, Any]:
    """Drift, verdicts, and errors of the last forecast that has been measured and of those of the last four weeks."""
    last, silent = archive.last_measured(), _silent(archive, zone)
    days = drift_days(zone.predictor) if silent is None else pd.DataFrame()  # later days say nothing of the errors
    found: dict[str, Any] = {"last measured": silent, "drift": drift_of(days)}
    doubts = [] if silent is None else [f"no temperature was measured since {silent}"]
    rows = archive.finished(pd.Timestamp(0) if last is None else last - _SCORED)
    if rows.empty or rows["T_za"].isna().all():
        verdicts = [Verdict("temperature", CARE, tuple(doubts))._asdict()] if doubts else []
        return found | {"verdicts": verdicts, "yesterday's forecast": None, "last four weeks": None}
    newest = rows[rows["origin"] == rows["origin"].iloc[-1]]
    return found | {
        "verdicts": [one._asdict() for one in verdicts_of(archive, zone, rows, days, doubts)],
        "yesterday's forecast": {"from": _shown(pd.Timestamp(newest["time"].iloc[0]), zone), **errors_of(newest)},
        "last four weeks": {"forecasts": rows["origin"].nunique(), **errors_of(rows)},
    }


def _silent(archive: ForecastArchive, zone: ZoneModel) -> str | None:
    """The last temperature and its age, where other zones were measured for a day after it."""
    last, own = archive.last_measured(), archive.last_temperature()
    if last is None or own is None or last - own < _SILENT:
        return None
    return f"{_shown(own, zone)} ({several((last - own).days, 'day')} ago)"


def drift_of(days: pd.DataFrame) -> dict[str, Any]:
    """The drift by the last of some days: ``drifted``, ``since``, ``kind`` and the statistic.

    Empty where no whole day has passed since the training, or it has too few days to compare with.
    """
    if days.empty:
        return {}
    last = days.iloc[-1]
    since = None if pd.isna(last["since"]) else f"{last['since']:%Y-%m-%d}"
    return {"drifted": bool(last["drifted"]), "since": since, "kind": last["kind"] or None} | {
        name: round(float(last[name]), 2) for name in ("statistic", "threshold")
    }


def measured_rows(
    frame: pd.DataFrame, settings: Settings, origin: pd.Timestamp, last: pd.Timestamp | None = None
) -> pd.DataFrame:
    """Temperatures and heat up to an origin: of all rows, or of those after the ``last`` archived and a week before."""
    moving = {role: without_standstills(frame, role) for role in settings.roles_of("T_za")}
    rows = frame.assign(**moving).loc[:origin]
    heat = {
        role: delivered_in_kw(rows_of_zone(rows, settings, zone), settings_of_zone(settings, zone))
        for zone, role in zip(each_zone(settings), settings.roles_of("Q_hvac"), strict=True)
    }
    rows = rows.assign(**{role: values for role, values in heat.items() if values is not None})
    return rows if last is None else rows[rows.index > on_clock_of(last, rows.index) - _CORRECTED]


def _shown(stamp: pd.Timestamp | None, zone: ZoneModel) -> str | None:
    """A stamp of the archive as the log shows it."""
    return None if stamp is None else str(on_clock_of(stamp, zone.learned_until))
