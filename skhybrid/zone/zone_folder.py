"""A folder per zone: configuration, model and archive, and the tick that keeps them up to date."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, Generic, NamedTuple, Self, TypeVar

import pandas as pd

from .._clock import on_clock_of
from .._files import remove_leftovers, write_text
from .._table import is_plant, listed
from .._time import LONGEST_BRIDGE
from ..exceptions import ModelFileError
from ..preprocessing.bridges import stretches
from ..study import propose_settings, read_settings
from ..study.doubts import beyond_training, drift_days, drifted
from ..study.log_reading import EvenLog, read_even_log
from ..study.settings import Settings
from ..study.unread_rows import BRIDGED
from .complete_rows import complete_rows, up_to_measured
from .corrected_rows import corrected_since
from .day_ahead import DayAhead, forecast_day
from .dead_meters import dead_meters, part_without_dead_meters, without_roles
from .forecast_archive import BEYOND, ForecastArchive, open_archive
from .other_units import refuse_other_temperatures
from .posted_rows import keep_log, keep_posted, read_posted, refuse_future
from .rows_ahead import GivenSchedules, schedules_of
from .zone_model import ZoneModel
from .zone_state import measured_rows, status_of

_REFIT_AFTER = pd.Timedelta(days=28)
_REFIT_DAYS = pd.Timedelta(days=14)  # after a long outage, that a new fit needs; fewer where the model knows fewer
_DEAD = pd.Timedelta(days=1)  # age of the last temperature, from which on that of a repeated forecast is told
#: settings that a model does not depend on
_FREE = ("name", "thermostat", "tariff", "train", "test", "load", "origin_step")


_Forecast = TypeVar("_Forecast", bound=DayAhead | None)


class Tick(NamedTuple, Generic[_Forecast]):
    """Result of a tick, or of posted rows."""

    forecast: _Forecast  # of posted rows None where no step is new, or the weather to come is not known
    n_new: int  # steps of the zone that were new
    learned: str  # why the model was fitted again, "" where it was not
    remarks: tuple[str, ...]


class ZoneFolder:
    """A folder that holds ``zone.toml``, ``model.skops`` and ``archive.sqlite``, of one zone or of a building.

    A process that writes to it may be killed at any moment: files are replaced in one step, the archive changes in one
    transaction, and the next tick repeats what was lost.

    Parameters
    ----------
    path : path-like
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self.config, self.model = self.path / "zone.toml", self.path / "model.skops"
        self.archive = self.path / "archive.sqlite"

    @property
    def zones(self) -> list[str]:
        """Names of the zones by the configuration; empty for one zone, or where there is none yet."""
        return read_settings(self.config).zones if self.config.exists() else []

    @classmethod
    def init(
        cls, path: str | PathLike[str], log: str | PathLike[str], config: str | PathLike[str] | None = None
    ) -> Self:
        """Make a folder from a log: its configuration, a fitted model, and an archive of what was measured.

        Parameters
        ----------
        path : path-like, the folder
        log : path-like, as for :func:`skhybrid.study.read_log`
        config : path-like, optional
            Configuration to copy; by default that of the folder, else a proposal, which stays for a correction if the
            fit fails.

        Raises
        ------
        FileExistsError
            If the folder has a model, or is that of a fleet.
        ValueError
            If the log or the configuration cannot be used.
        """
        folder = cls(path)
        folder._refuse_fleet()
        folder._refuse_model()
        if config is None and not folder.config.exists():
            write_text(folder.config, propose_settings(log))
        settings = read_settings(folder.config if config is None else config)
        read = _read_past(log, settings)
        folder.path.mkdir(parents=True, exist_ok=True)
        with open_archive(folder.archive) as archive, archive.transaction():
            folder._refuse_model()  # another process may have made one meanwhile
            folder._remove_leftovers()
            if config is not None:
                write_text(folder.config, Path(config).read_text(encoding="utf-8"))
            zone = ZoneModel.fit(settings, read.finished)
            origin = zone.readable(read.frame).origin
            archive.add_measured(measured_rows(read.finished, settings, origin), settings.zones)
            keep_log(archive, read.frame, origin, read.held)
            zone.save(folder.model)
        return folder

    def load(self) -> ZoneModel:
        """The model.

        Raises
        ------
        FileNotFoundError, ModelFileError
            If there is none, or it cannot be read.
        """
        self._require_model()
        try:
            return ZoneModel.load(self.model)
        except ModelFileError as error:
            raise ModelFileError(
                f"{str(error).removesuffix('.')}: remove it and run skhybrid zone init again, which keeps zone.toml "
                "and the archive."
            ) from error

    def tick(
        self,
        log: str | PathLike[str],
        weather: str | PathLike[str] | None = None,
        schedule: GivenSchedules | None = None,
        refit_after: pd.Timedelta = _REFIT_AFTER,
    ) -> Tick[DayAhead]:
        """Take in the new rows of a log, forecast from its end, and archive both; a tick that fails changes nothing.

        The model is fitted again where its errors have drifted, where it is old, where an outage of more than twelve
        hours follows what it knows (once there are two weeks of rows after one of more than four days), where three
        hours or more of its last week were corrected in the log, and where the configuration has changed.  A step that
        is under way is forecast from, and taken in when it is over.

        Parameters
        ----------
        log, weather, schedule
            As for :func:`day_ahead`; a new fit needs a log of two weeks or more.
        refit_after : Timedelta, age of the model from which on it is fitted again; sooner where it learned from less

        Raises
        ------
        BlockingIOError
            If another process is at work in the folder.
        FileNotFoundError, ValueError
            If there is no model, or the log or the weather cannot be used.
        """
        with self._at_work() as (archive, zone, settings):
            schedule = schedules_of(schedule, settings.zones)  # what cannot be read is said before a fit
            read = _read_past(log, settings)
            frame = read.frame
            archive.keep_clock(pd.DatetimeIndex(frame.index).tz, zone.known_until.tz)
            if _of_model(settings) == _of_model(zone.settings):
                refuse_other_temperatures(frame, archive.measured(frame.index[0]), settings, "the archive")
            zone, n_new, why, remarks = _learn(archive, zone, settings, read.finished, refit_after)
            rows = zone.readable(frame)
            found, origin = forecast_day(zone, rows, weather, schedule), rows.origin
            if not n_new and rows.unread is None:
                remarks += _repeated(archive, frame, origin)
            remarks += read.filled_after(origin)
            keep_log(archive, frame, origin, read.held)
            self._keep(archive, zone, read.finished, origin, found, changed=bool(n_new or why))
        return Tick(found, n_new, why, (*remarks, *found.remarks))

    def post(
        self,
        rows: str | PathLike[str],
        weather: str | PathLike[str] | None = None,
        schedule: GivenSchedules | None = None,
        refit_after: pd.Timedelta = _REFIT_AFTER,
        *,
        plain: bool = False,
    ) -> Tick[DayAhead | None]:
        """Take in rows beside the log that the archive keeps, as a tick takes in those of a log.

        Rows after the last temperature are weather and plans of the day to come.  Rows that cannot be used change
        nothing; where only the forecast cannot be made, they are kept, and a remark says why.

        Parameters
        ----------
        rows : path-like, a file with the columns of the log, of any number of rows
        weather, schedule, refit_after
            As for :meth:`tick`.
        plain : bool, whether the file is a CSV with commas and a column ``time``, whatever the log is

        Raises
        ------
        BlockingIOError
            If another process is at work in the folder.
        FileNotFoundError, ValueError
            If there is no model, or the rows cannot be used.
        """
        with self._at_work() as (archive, zone, settings):
            schedule = schedules_of(schedule, settings.zones)
            given, held = read_posted(rows, settings, archive.held(), plain=plain)
            if settings.timezone is not None:
                archive.keep_clock(pd.DatetimeIndex(given.index).tz, zone.known_until.tz)
            frame, n_ahead = keep_posted(archive, given, settings, held)
            zone, n_new, why, remarks = _learn(archive, zone, settings, frame, refit_after)
            log = zone.readable(frame)
            origin, last = log.origin, archive.last_measured()
            # a kill between model and archive leaves rows that only the model has taken in
            not_archived = last is None or on_clock_of(last, origin) < origin
            found = None
            try:
                if n_new or n_ahead or why or not_archived:
                    found = forecast_day(zone, log, weather, schedule)
                elif log.unread:
                    remarks.append(str(log.unread))
            except (ValueError, OSError) as error:
                remarks.append(f"there is no new forecast: {error}")
            self._keep(archive, zone, frame, origin, found, changed=bool(n_new or why))
        return Tick(found, n_new, why, (*remarks, *([] if found is None else found.remarks)))

    def status(self) -> dict[str, Any]:
        """Report the last row, drift, verdicts and errors of past forecasts, as plain values; of several zones by zone.

        Raises
        ------
        FileNotFoundError, OSError
            If there is no zone, or its archive cannot be read.
        """
        zone = self.load()
        with open_archive(self.archive) as archive:
            return status_of(archive, zone)

    @contextmanager
    def _at_work(self) -> Iterator[tuple[ForecastArchive, ZoneModel, Settings]]:
        """The archive in a transaction, the model, and the settings as they are now."""
        self._require_model()
        with open_archive(self.archive) as archive, archive.transaction():
            self._remove_leftovers()
            yield archive, self.load(), read_settings(self.config)

    def _keep(
        self,
        archive: ForecastArchive,
        zone: ZoneModel,
        frame: pd.DataFrame,
        origin: pd.Timestamp,
        found: DayAhead | None,
        *,
        changed: bool,
    ) -> None:
        """Archive what was measured and forecast, and save a model that has changed.

        A forecast from a log that ends before what the model has seen is not archived: it knows what it forecasts.
        """
        archive.add_measured(measured_rows(frame, zone.settings, origin, archive.last_measured()), zone.zones)
        seen = on_clock_of(zone.known_until, origin)
        if found is not None and origin >= seen:
            weather = found.frame.drop(columns=list(filter(is_plant, found.frame)))
            beyond = beyond_training(weather, zone.covered()).any(axis=1).astype(float)
            archive.add_forecast(origin, found.frame.assign(**{BEYOND: beyond}), zone.zones, found.energy)
        if changed:
            zone.save(self.model)

    def _refuse_fleet(self) -> None:
        if (self.path / "fleet.toml").exists() and not self.model.exists():
            raise FileExistsError(f"{self.path} is the folder of a fleet; use skhybrid fleet, or give another folder.")

    def _require_model(self) -> None:
        self._refuse_fleet()
        if not self.model.exists():
            raise FileNotFoundError(f"{self.path} holds no zone; make it with skhybrid zone init.")

    def _refuse_model(self) -> None:
        if self.model.exists():
            raise FileExistsError(f"{self.path} holds a zone already; use skhybrid zone tick, or give another folder.")

    def _remove_leftovers(self) -> None:
        remove_leftovers(self.path, self.config.name, self.model.name)


def _read_past(log: str | PathLike[str], settings: Settings) -> EvenLog:
    """A log, in which nothing may be measured in the future."""
    found = read_even_log(log, settings)
    refuse_future(up_to_measured(found.frame, settings.roles_of("T_za")), "the stamps at the end of the log")
    return found


def _repeated(archive: ForecastArchive, frame: pd.DataFrame, origin: pd.Timestamp) -> list[str]:
    """A remark where the last forecast began at the same row: the logger or the room's sensor may be dead."""
    last = archive.last_origin()
    late = pd.Timestamp.now(origin.tz) - origin > _DEAD
    if not late or last is None or on_clock_of(last, origin) != origin:
        return []
    end = f", although the log goes on to {frame.index[-1]}" if frame.index[-1] > origin else ""
    return [f"no room temperature was measured after {origin}{end}: the last forecast, from there, is made again"]


def _take_in(
    archive: ForecastArchive, zone: ZoneModel, frame: pd.DataFrame, refit_after: pd.Timedelta
) -> tuple[int, str]:
    """Advance a model by the new rows where they follow; their number, and why the model should be fitted again."""
    dead = {z: r for z, r in dead_meters(frame, zone.settings).items() if z not in zone.not_learned}
    if dead:
        alive = zone.readable(without_roles(frame, dead))
        return len(alive.new_rows(zone.known_until)), f"the heat of {listed(dead)} is logged no more"
    log, known, step = zone.readable(frame), zone.known_until, pd.Timedelta(zone.settings.step)
    n_new, why = len(log.new_rows(known)), log.outage(known, BRIDGED)
    if not log.outage(known, LONGEST_BRIDGE):
        zone.take_in(log)
    if why:
        return n_new, why
    if (corrected := corrected_since(frame, archive, zone.settings)) is not None:
        return n_new, f"rows from {corrected} on were corrected in the log"
    age = log.origin - zone.learned_until
    if age > min(refit_after, zone.predictor.training_.n_rows * step):
        return n_new, f"it last learned {age.days} days ago"
    grown = [(name, reason) for name, part in zone.parts().items() for reason in drifted(drift_days(part.predictor))]
    return n_new, "; ".join(f"{name}: {reason}" if name else reason for name, reason in grown)


def _learn(
    archive: ForecastArchive, zone: ZoneModel, settings: Settings, frame: pd.DataFrame, refit_after: pd.Timedelta
) -> tuple[ZoneModel, int, str, list[str]]:
    """A model with the new rows, their number, why it was fitted again, and remarks."""
    changed, known = _of_model(settings) != _of_model(zone.settings), zone.known_until
    zone.settings = settings
    n_new, why = (0, "zone.toml has changed") if changed else _take_in(archive, zone, frame, refit_after)
    if not why:
        return zone, n_new, "", []
    try:
        fitted = _fitted_anew(zone, frame)
    except ValueError as error:
        if changed:
            raise ValueError(f"{why}, so the model must be fitted again, but {error}") from error
        return zone, n_new, "", [f"the model should be fitted again, because {why}, but {error}"]
    if changed:
        n_new = len(fitted.readable(frame).new_rows(known))
    return fitted, n_new, why, []


def _fitted_anew(zone: ZoneModel, frame: pd.DataFrame) -> ZoneModel:
    """A model of the rows after the last long outage of a log."""
    step = pd.Timedelta(zone.settings.step)
    alive, _ = part_without_dead_meters(frame, zone.settings)
    rows = stretches(complete_rows(alive, zone.settings.roles_of("T_za")), LONGEST_BRIDGE)[-1]
    needed = min(_REFIT_DAYS, zone.predictor.training_.n_rows * step)
    if len(rows) * step < needed:
        raise ValueError(
            f"the log ends with {len(rows) * step / pd.Timedelta('1D'):.1f} days without a long outage, and "
            f"{needed / pd.Timedelta('1D'):.1f} are needed."
        )
    return ZoneModel.fit(zone.settings, frame.loc[rows.index[0] :])


def _of_model(settings: Settings) -> str:
    """The settings that a model depends on, as text."""
    return json.dumps({k: v for k, v in settings.as_dict().items() if k not in _FREE}, default=str, sort_keys=True)
