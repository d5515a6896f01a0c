"""The forecast of a day from a saved model, a log and the weather to come."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._clock import on_clock_of
from .._table import is_plant, listed
from .._warnings import percent
from ..datasets import read_weather
from ..logs import LogReport
from ..logs import read_log as read_any_log
from ..logs.naming import PLACE_ALONE, UNPLACED, guess_role, plain, unit_in_name
from ..logs.open_meteo import answers_in
from ..logs.zone_csv import to_left_label
from ..study.day_energy import Energy, day_energy, energy_of_zones, paths_of_load
from ..study.doubts import day_beyond
from ..study.log_reading import read_even_log
from ..study.log_split import inputs_of
from ..study.plant_performance import Performance
from ..study.settings import Settings
from ..study.tariff import energy_cost
from ..study.unread_rows import BRIDGED
from ..study.zone_part import each_zone, log_columns
from .complete_rows import refuse_cut_value, refuse_stuck
from .readable_log import ReadableLog
from .rows_ahead import GivenSchedules, Schedules, rows_ahead, schedules_of
from .wanted_setpoints import idle_setpoints
from .zone_model import ZoneModel

ELECTRICITY = "electricity_kW"  # the column of it; of several zones it ends with the zone's name
_FIRST = 4  # rows on each side of the origin whose weather is compared
_LARGEST_JUMP = 12.0  # of T_oa from these to those [K]
_DARK = 0.01  # irradiance relative to its highest, below which an hour of the log is dark
_LEAST_SEEN = pd.Timedelta("3D")  # history that shows when it is
_IN_THE_DARK = 0.03  # share of the irradiance ahead that a change of season may bring to dark hours
_DAY, _HALF_DAY = pd.Timedelta("1D"), pd.Timedelta("12h")
_OLD = pd.Timedelta("28D")  # age of what a model knows, from which on it should learn anew


class DayAhead(NamedTuple):
    """The forecast of a day.

    Parameters
    ----------
    frame : DataFrame, a row per step of the day
    summary : dict, sums and ranges of the day by name
    remarks : tuple of str, what a user should know of it
    energy : tuple of Energy, heating and cooling of all zones together, where the kW have a scale
    """

    frame: pd.DataFrame
    summary: dict[str, Any]
    remarks: tuple[str, ...]
    energy: tuple[Energy, ...] = ()


def day_ahead(
    zone: ZoneModel,
    log: str | PathLike[str] | pd.DataFrame,
    weather: str | PathLike[str] | None = None,
    schedule: GivenSchedules | None = None,
) -> DayAhead:
    """Forecast temperature and load from the end of a log.

    Parameters
    ----------
    zone : ZoneModel
    log : path-like, the log up to now, with rows of weather and plan after it where there are any
        Or its rows, as :func:`skhybrid.study.read_log` returns them.
    weather : path-like, optional
        CSV, EPW, or Open-Meteo's JSON or CSV of the rows ahead.
    schedule : str, sequence of str, or mapping of zone to str, optional
        Heating and cooling set-point [degC], as ``--setpoint`` takes them: ``"21,24"``, or ``"6:00=21,22:00=17;24"``
        by the clock.  Of several zones: ``["21,24", "hall:18,26"]``, or ``{"": "21,24", "hall": "18,26"}``, where a
        text without a name is for all others.  By default set-points are those of the rows ahead in the log, then in
        the CSV, then of the settings.

    Returns
    -------
    DayAhead
        Columns: ``T_za`` [degC], ``q_0.1`` and ``q_0.9``, the set-points and the weather; under a thermostat
        ``Q_hvac`` [kW] with ``Q_hvac_0.1`` and ``Q_hvac_0.9``, and electricity [kW] where the settings have a
        coefficient of performance.  Of several zones, names end with the zone's.

    Raises
    ------
    ValueError
        If an input ends more than twelve hours before the temperatures, or weather or set-points are missing.
    """
    given = schedules_of(schedule, zone.zones)
    if isinstance(log, pd.DataFrame):
        return forecast_day(zone, zone.readable(log), weather, given)
    read = read_even_log(log, zone.settings)
    rows = zone.readable(read.frame)
    found = forecast_day(zone, rows, weather, given)
    return found._replace(remarks=(*read.filled_after(rows.origin), *found.remarks))


def forecast_day(
    zone: ZoneModel, log: ReadableLog, weather: str | PathLike[str] | None, schedule: Schedules | None
) -> DayAhead:
    """As :func:`day_ahead`, from a log that the model can read and set-points by zone."""
    settings, frame, history = zone.settings, log.frame, log.history
    origin, unread = log.origin, log.unread
    if unread is not None:
        unread.refuse_long()
    measured = settings.roles_of("T_za")
    refuse_stuck(frame, measured, origin)
    refuse_cut_value(frame, settings, origin)
    later = _not_past(frame[frame.index > origin], measured)
    end = origin + pd.Timedelta(settings.horizon)
    given = later
    if weather is not None:
        given = read_ahead(weather, settings, origin.tz, range(origin.year, end.year + 1))
        given = _from_origin(given, frame[frame.index > origin].drop(columns=measured))
    later, half_written = _without_half_rows(later, given, settings)
    given = later if weather is None else given
    inputs = [str(role) for role in inputs_of(history) if role not in (*measured, *settings.setpoints)]
    ahead, planned = rows_ahead(settings, origin, inputs, weather=given, plan=later, schedule=schedule)
    found = zone.forecast(history, ahead).drop(columns=settings.roles_of("zeta"), errors="ignore")
    weather_roles = [role for role in inputs if role.startswith("T_") or role == "q_sol"]
    idle = idle_setpoints(found, zone.parts())
    held = [role for role in settings.setpoints if role in ahead]
    shown = ahead[[*(role for role in held if role not in idle), *weather_roles]]
    out = with_electricity(found.join(shown), settings).rename_axis("time")
    remarks = [
        *half_written,
        *_unused(later, settings, schedule, {role: idle[role] for role in held if role in idle}),
        *([] if unread is None or unread.is_step else [str(unread)]),
        *log.remarks_on_outages(zone.known_until),
        *_remarks(zone, history, ahead, planned),
    ]
    paths = _paths(zone, history, ahead)
    loads = [role for role in settings.roles_of("Q_hvac") if zone.scaled and role in out]
    energy = energy_of_zones(out[loads], paths)
    return DayAhead(out, _summary(out, settings, zone.scaled, paths), tuple(remarks), tuple(energy))


def _paths(zone: ZoneModel, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame | None:
    """Paths of the loads [kW] by ``sample`` and time; None without their scale, or a thermostat that was learned."""
    if not (zone.scaled and zone.thermostat_learned):
        return None
    ahead, wanted, given = zone.asked(future)
    if wanted is None:
        return None
    return paths_of_load(zone.predictor, history, ahead, weather_error=zone.settings.weather_error, **given)


def _unused(
    later: pd.DataFrame, settings: Settings, schedule: Schedules | None, idle: Mapping[str, str]
) -> Iterator[str]:
    """Remarks on what set-points of the command line replace in the rows ahead, and on those that are ``idle``."""
    if schedule is None:
        return
    given = later.columns[later.notna().any()]
    roles = sorted(str(role) for role in given if is_plant(role) or role in settings.setpoints)
    if roles:
        yield f"{listed(roles)} of the rows ahead are not used, since --setpoint is given"
    for did in dict.fromkeys(idle.values()):
        of_it = [role for role in idle if idle[role] == did]
        verb = "is" if len(of_it) == 1 else "are"
        yield f"{', '.join(of_it)} of --setpoint {verb} left out, since nothing {did} in the training"


def _not_past(later: pd.DataFrame, measured: list[str]) -> pd.DataFrame:
    """Rows after the origin that may be weather and plans; none where the last of them has a temperature.

    Where earlier ones have one, a column without any value after them is left out: it is no plan.
    """
    past = later[measured].notna().any(axis=1).to_numpy()
    if past.any() and past[-1]:
        later = later.iloc[:0]
    elif past.any():
        after = later.iloc[int(np.flatnonzero(past)[-1]) + 1 :]
        later = later.drop(columns=[role for role in later if after[role].isna().all() and role not in measured])
    return later.drop(columns=measured)


def _without_half_rows(later: pd.DataFrame, ahead: pd.DataFrame, settings: Settings) -> tuple[pd.DataFrame, list[str]]:
    """Rows after the origin without heat and set-points that are no plan of a day, and a remark.

    These end with the first row, or within half a day and before the weather of the rows ``ahead`` and the horizon:
    they are readings, of which the temperature is still to come.
    """
    step, horizon = pd.Timedelta(settings.step), pd.Timedelta(settings.horizon)
    if later.empty or horizon <= step:
        return later, []
    early = later.index[: max(1, min(BRIDGED, horizon - step) // step)]
    known = later[[role for role in map(str, later) if is_plant(role) or role in settings.setpoints]]
    ends: dict[str, Any] = {str(role): values.last_valid_index() for role, values in known.items()}
    if not on_clock_of(ahead.index[-1], later.index) > early[-1]:
        early = early[:1]
    alone = [role for role, end in ends.items() if end in early]
    if not alone:
        return later, []
    first, last = later.index[0], max(ends[role] for role in alone)
    names = listed(log_columns(alone, settings) or alone)
    rows, seem, are = (f"row {first}", "seems", "is") if first == last else (f"rows {first} to {last}", "seem", "are")
    text = f"the {rows}, with {names} but no temperature, {seem} half written and {are} left for the next time"
    return later.drop(columns=alone), [text]


def _from_origin(given: pd.DataFrame, later: pd.DataFrame) -> pd.DataFrame:
    """Weather, with the rows of the log after the origin that come before it, as while a meter's reading is awaited."""
    if pd.DatetimeIndex(given.index).tz is None and pd.DatetimeIndex(later.index).tz is not None:
        return given  # refused later
    before = later.loc[later.index < given.index[0], later.columns.intersection(given.columns)]
    out = pd.concat([before, given]) if len(before) else given
    out.attrs = dict(given.attrs)
    return out


def read_ahead(path: str | PathLike[str], settings: Settings, tz: Any, years: Iterable[int]) -> pd.DataFrame:
    """Weather of the rows ahead by role, in the time zone of the log.

    Columns of a table that have the names of the log's are read as the log is; others are found by names and values.
    An EPW is that of some ``years``.
    """
    is_epw = Path(path).suffix.lower() == ".epw"
    if is_epw or answers_in(Path(path)):
        stamped: Iterable[int | None] = years if is_epw else [None]
        frame = pd.concat([read_weather(path, year=year, **dict(settings.site)) for year in stamped])
    else:
        given = {} if settings.timezone is None else {"timezone": settings.timezone}
        raw = read_any_log(path, **given)
        own = {role: column for role, column in settings.columns.items() if column in raw.frame}
        units = {role: unit for role, unit in settings.units.items() if role in own}
        scale = {role: factor for role, factor in settings.scale.items() if role in own}
        report = LogReport(raw, own, units, scale)
        if outdoor := _outdoor(report):
            report = LogReport(raw, {**report.roles, "T_oa": outdoor}, units, scale)
        frame = report.frame
        if settings.label == "right" if own else raw.label == "right":
            frame = to_left_label(frame, [role for role, column in own.items() if column in raw.held])
    index = pd.DatetimeIndex(frame.index)
    if index.tz is None:  # the hour that a clock without a time zone shows twice when it is put back, as in a log
        frame = frame.groupby(level=0).first()
    if tz is None and index.tz is not None:
        raise ValueError("the weather has a time zone and the log has none; give timezone = in the configuration.")
    return frame if tz is None or index.tz is None else frame.tz_convert(tz)


def _outdoor(report: LogReport) -> str | None:
    """The column of weather without an outdoor temperature that is one, as only its file says."""
    why = report.columns["reason"]
    unplaced = list(map(str, why.index[why == UNPLACED]))
    placed = map(str, why.index[why == PLACE_ALONE])
    outdoors = [name for name in placed if guess_role(f"{name} temp", unit_in_name(name)).role == "T_oa"]
    known = [name for name in unplaced if plain(name) in ("temp", "temperature")] or unplaced or outdoors
    return known[0] if "T_oa" not in report.frame and len(known) == 1 else None


def with_electricity(found: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """The forecast with the plant's electricity [kW], where its coefficient of performance is known."""
    performance = Performance.of(settings.plant)
    if performance is None:
        return found
    loads = [role for role in settings.roles_of("Q_hvac") if role in found]
    electricity = {role: performance.electricity(found[role].to_numpy(), found["T_oa"].to_numpy()) for role in loads}
    return found.assign(**{role.replace("Q_hvac", ELECTRICITY): values for role, values in electricity.items()})


def _summary(out: pd.DataFrame, settings: Settings, scaled: bool, paths: pd.DataFrame | None = None) -> dict[str, Any]:
    """Sums and ranges of the day, those of heat where its kW are ``scaled``, with intervals by ``paths`` of it."""
    hours = (out.index[1] - out.index[0]) / pd.Timedelta("1h") if len(out) > 1 else 1.0
    found: dict[str, Any] = {"from": str(out.index[0]), "to": str(out.index[-1])}
    zones = each_zone(settings)
    for zone, role in zip(zones, settings.roles_of("T_za"), strict=True):
        of = f" of {zone}" if zone else ""
        found[f"lowest temperature{of} [degC]"] = round(float(out[role].min()), 2)
        found[f"highest temperature{of} [degC]"] = round(float(out[role].max()), 2)
    loads = {z: role for z, role in zip(zones, settings.roles_of("Q_hvac"), strict=True) if role in out}
    if not loads or not scaled:
        return found  # a sum of kW without a scale would mislead
    for zone, role in loads.items():
        of = f" of {zone}" if zone else ""
        for kind, energy, interval in day_energy(out[role], None if paths is None else paths[role]):
            found[f"{kind}{of} [kWh]"] = round(energy, 2)
            if interval is not None:
                found[f"{kind}{of}, 80 % interval [kWh]"] = [round(end, 2) for end in interval]
    found["largest load [kW]"] = round(float(out[list(loads.values())].sum(axis=1).abs().max()), 2)
    if electricity := [role for role in settings.roles_of(ELECTRICITY) if role in out]:
        found["electricity [kWh]"] = round(float(out[electricity].to_numpy().sum() * hours), 2)
    cost = energy_cost(out, settings.tariff, settings.plant, settings.holidays, settings.zones, paths)
    return found if cost is None else found | cost.entries()


def _weather_remarks(history: pd.DataFrame, ahead: pd.DataFrame) -> Iterator[str]:
    """Remarks on weather ahead that is not about that of the log."""
    has_both = "T_oa" in history and "T_oa" in ahead
    jump = abs(ahead["T_oa"].iloc[:_FIRST].mean() - history["T_oa"].iloc[-_FIRST:].mean()) if has_both else 0.0
    if jump > _LARGEST_JUMP:
        text = f"T_oa jumps by {jump:.0f} K from the end of the log to the weather ahead"
        yield f"{text}; check the unit and the stamps of both"
    day = history.index > history.index[-1] - _DAY
    for now, past, what in ((history[day], history[~day], "of the last day of the log"), (ahead, history, "ahead")):
        usual, most = _sun_of(now, past)
        if most < _DARK * usual:
            text = f"the sun {what} reaches {1000 * most:.2g} W/m2, and at these hours {1000 * usual:.0f} W/m2 before"
            yield f"{text}; check the unit of its column"
    share = _sun_at_night(history, ahead)
    if share > _IN_THE_DARK:
        text = f"{percent(share)} of the sun ahead shines at hours of the day at which the log has none"
        yield f"{text}; check the time zone of the weather, and timezone = in the configuration"


def _sun_at_night(history: pd.DataFrame, ahead: pd.DataFrame) -> float:
    """Share of the irradiance ahead at hours of the day at which the log is dark; of the day in UTC, if known."""
    if "q_sol" not in history or "q_sol" not in ahead or history.index[-1] - history.index[0] < _LEAST_SEEN:
        return 0.0
    sun, coming = (frame["q_sol"].clip(lower=0.0) for frame in (history, ahead))
    highest = sun.groupby(_hours(sun)).max()
    dark = _hours(coming).isin(highest.index[highest <= _DARK * highest.max()])
    return float(coming[dark].sum() / coming.sum()) if coming.sum() > 0.0 else 0.0


def _sun_of(rows: pd.DataFrame, before: pd.DataFrame) -> tuple[float, float]:
    """Highest irradiance [kW/m2] at the hours of some rows: in the rows before them, and in these rows."""
    if "q_sol" not in rows or "q_sol" not in before or len(rows) < 2 or rows.index[-1] - rows.index[0] < _HALF_DAY:
        return 0.0, 0.0
    highest = before["q_sol"].groupby(_hours(before["q_sol"])).max()
    return float(highest.reindex(_hours(rows["q_sol"])).max()), float(rows["q_sol"].max())


def _hours(values: pd.Series) -> pd.Index:
    index = pd.DatetimeIndex(values.index)
    return (index if index.tz is None else index.tz_convert("UTC")).hour


def _remarks(zone: ZoneModel, history: pd.DataFrame, ahead: pd.DataFrame, planned: bool) -> list[str]:
    """Remarks on this forecast for its user."""
    out = []
    for one, roles in zone.not_learned.items():
        names = listed(log_columns(roles, zone.settings))
        out.append(f"{one} was learned without its heat, since {names} had no values: its load is not known")
    if not planned and (ideal := zone.ideal_zones(ahead)):
        of = f" of {', '.join(ideal)}" if any(ideal) else ""
        out.append(f"the thermostat{of} is an ideal one and the load has no interval: {zone.why_ideal}")
    known = on_clock_of(zone.known_until, history.index)
    if history.index[-1] < known:
        out.append(
            f"the last complete row of the log is {history.index[-1]}, and the model has seen rows to {known}: it has "
            "learned from what it forecasts"
        )
    out += _weather_remarks(history, ahead)
    if not planned and not zone.scaled:
        out.append(
            "no capacity of the plant is known, so its kW have no certain scale; give known = { Q_h = ... } in "
            "[estimator]"
        )
    if (age := history.index[-1] - zone.learned_until) > _OLD:
        out.append(f"the model last learned {age.days} days ago; learn anew with skhybrid update --relearn")
    out += day_beyond(ahead.drop(columns=zone.settings.setpoints, errors="ignore"), zone.covered())
    return out
