"""Splitting a log into training rows, test rows and the next day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._last_known import up_to_last_known
from .._table import (
    HISTORY_ROLES,
    SETPOINT_ROLES,
    is_set_point,
    numeric,
    plant_roles,
    refuse_infinite_columns,
    refuse_shape,
)
from .._time import even_step, rows_per_day
from ..logs.column_spans import one_after_the_other
from ..logs.log_findings import doubts_on_log
from ..logs.standstills import without_standstills
from ..preprocessing import FacadeIrradiance
from .log_reading import SETPOINT
from .settings import Settings
from .spans import cut_spans, over_outages, train_and_test

FACADES = ("q_sol_east", "q_sol_south", "q_sol_west", "q_sol_north")  # columns of the facades of a site
_HISTORY = pd.Timedelta("14D")  # least history for a forecast of the next day: the longest lag of any forecaster
_SHORTEST_FUTURE = pd.Timedelta("1h")  # T_za missing at the end for less is a failed sensor, else the next day


class StudyData(NamedTuple):
    """The rows of a study; every frame has roles as columns and ``T_za``, or that of each zone, as history.

    Parameters
    ----------
    train : DataFrame, rows to fit on
    later : DataFrame, rows after the training rows, to the end of the test rows
    test_start : Timestamp, first stamp of the test rows in ``later``
    history, future : DataFrame, rows before the next day, and the next day, with ``T_za`` as far as it was measured
    setpoint : Series, temperature to hold [degC], over history and future; of several zones a DataFrame by zone
    held_out : bool, whether the next day is the last day of the log, and so was measured
    remarks : tuple of str, what was found on the way
    """

    train: pd.DataFrame
    later: pd.DataFrame
    test_start: pd.Timestamp
    history: pd.DataFrame
    future: pd.DataFrame
    setpoint: Any
    held_out: bool
    remarks: tuple[str, ...] = ()

    @property
    def unplanned(self) -> list[str]:
        """The plants of a next day for which no heat is planned: they follow its set-points."""
        return [] if self.held_out else unplanned(self.future)

    def spans(self, frame: pd.DataFrame) -> dict[str, Any]:
        """The spans of a study, and the number of forecasts of a back-test.

        Parameters
        ----------
        frame : DataFrame, the back-test
        """
        return {
            "train": f"{self.train.index[0]} to {self.train.index[-1]}",
            "test": f"{self.test_start} to {self.later.index[-1]}",
            "forecasts compared": frame["origin"].nunique(),
        }


def split_log(frame: pd.DataFrame, settings: Settings) -> StudyData:
    """Split a log into training rows, test rows and the next day: a :class:`StudyData`.

    If the log ends with rows without ``T_za``, these are the next day; else the last whole local day is held out as the
    next day.  With a site, there are columns for the irradiance on its facades.

    Parameters
    ----------
    frame : DataFrame, one column per role, at an even step, and ``setpoint`` where the log has it
    settings : Settings

    Raises
    ------
    ValueError
        If a span has no rows, the test begins before the training ends, or there is no set-point where one is named.
    """
    temperatures = settings.roles_of("T_za")
    frame = _checked(frame, temperatures)
    doubts = tuple(doubts_on_log(frame, temperatures))
    frame = _usable(frame, settings)
    inputs = inputs_of(frame, temperatures)
    measured = up_to_last_known(frame, temperatures)
    if measured.empty:
        raise ValueError(f"the log has no measured temperature ({', '.join(temperatures)}) at all.")
    train, test = train_and_test(measured, settings)
    for role in temperatures:
        _refuse_constant(train[role], least=0)
    roles = frame[[*inputs, *temperatures]]
    later = roles.loc[train.index[-1] : test.index[-1]].iloc[1:]
    before = later.loc[later.index < test.index[0]]
    begin, end, held_out = _next_day(frame, measured.index[-1], pd.Timedelta(settings.horizon))
    earliest = min(train.index[-1], begin - _HISTORY)
    history = _unbroken(roles.loc[earliest:begin].iloc[1:-1], temperatures)
    future = roles.loc[begin:end]
    return StudyData(
        over_outages(roles.loc[train.index[0] : train.index[-1]], settings),
        later.iloc[len(before) - len(_unbroken(before, temperatures)) :],  # back-tests refuse one missing in the test
        test.index[0],
        history,
        future,
        _setpoints(frame, settings, history, future),
        held_out,
        (*doubts, *cut_spans(measured, settings)),
    )


def _usable(frame: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """The rows from the first to the last with all inputs, without standstills of T_za, with the facades of a site.

    Rows ahead may lack set-points or heat: a day to come is forecast under its planned heat, else its set-points.
    """
    temperatures = settings.roles_of("T_za")
    for role in temperatures:
        _refuse_constant(frame[role].dropna(), least=2)
    inputs = inputs_of(frame, temperatures)
    _refuse_empty_ahead(frame[temperatures], inputs)
    complete = np.flatnonzero(inputs.notna().all(axis=1).to_numpy())
    if not len(complete):
        never = one_after_the_other(inputs) or "check the columns."
        raise ValueError(f"no row of the log has all of {', '.join(map(str, inputs))}; {never}")
    last = complete[-1]
    ahead = slice(last + 1, None)
    if frame[temperatures].iloc[ahead].isna().all(axis=None):
        unknown = unplanned(inputs.iloc[ahead])
        needed = inputs[[role for role in inputs if not is_set_point(role) and role not in unknown]]
        last = np.flatnonzero(needed.notna().all(axis=1).to_numpy())[-1]
    moving = {role: without_standstills(frame, role) for role in temperatures}
    return with_facades(frame.assign(**moving).iloc[complete[0] : last + 1], settings)


def _refuse_constant(temperature: pd.Series, least: int) -> None:
    """Refuse a temperature of at least ``least`` rows that never changes, or is never known."""
    if len(temperature) >= least and temperature.nunique() < 2:
        raise ValueError(
            f"{temperature.name} is the same in all rows from {temperature.index[0]!s} to {temperature.index[-1]!s}; "
            "choose another column or span."
        )


def with_facades(frame: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """The rows with the irradiance on the facades of the site, where the settings have one.

    All zones share them: beside a zone that is named south, that of the south is ``q_sol_south_facade``.
    """
    if not settings.site or "q_sol" not in frame or any(str(c).startswith("q_sol_") for c in frame):
        return frame
    found = FacadeIrradiance(settings.site["latitude"], settings.site["longitude"]).fit_transform(frame)
    return found.rename(columns={f"q_sol_{zone}": f"q_sol_{zone}_facade" for zone in settings.zones})


def _checked(frame: Any, temperatures: Sequence[str]) -> pd.DataFrame:
    """A log of numbers, refused where it cannot be split."""
    for role in temperatures:
        if not isinstance(frame, pd.DataFrame) or role not in frame:
            raise ValueError(f"the log must be a DataFrame with a column {role}; read_log returns one.")
    if not isinstance(frame.index, pd.DatetimeIndex):
        raise ValueError("the log has no time stamps as its index; read_log gives it one.")
    refuse_shape(frame, 1)
    frame = pd.DataFrame({name: numeric(frame[name]) for name in frame}, frame.index)
    refuse_infinite_columns(frame)
    return frame


def inputs_of(frame: pd.DataFrame, temperatures: Sequence[str] = ()) -> pd.DataFrame:
    """The columns that a model must know ahead: all but the temperatures of zones and what has no role."""
    return frame.drop(columns=[*HISTORY_ROLES, SETPOINT, *temperatures], errors="ignore")


def setpoints_of(rows: pd.DataFrame) -> pd.DataFrame:
    """The set-points of a thermostat; no columns where there are none."""
    return rows[[role for role in SETPOINT_ROLES if role in rows]]


def without_setpoints(rows: pd.DataFrame) -> pd.DataFrame:
    """The columns without the set-points of a thermostat, which a model that learns none takes for inputs."""
    return rows.drop(columns=list(SETPOINT_ROLES), errors="ignore")


def unplanned(ahead: pd.DataFrame) -> list[str]:
    """The plants of rows ahead with set-points and no heat; none where some of the heat is planned."""
    plants = plant_roles(ahead)
    follow = ahead[list(filter(is_set_point, ahead))].notna().any(axis=None) and ahead[plants].isna().all(axis=None)
    return plants if follow else []


def _refuse_empty_ahead(measured: pd.DataFrame, inputs: pd.DataFrame) -> None:
    """Refuse rows ahead with weather but no heat: they would be dropped, and a past day would be forecast instead."""
    ahead = inputs.loc[measured.last_valid_index() :].iloc[1:]
    weather = ahead.drop(columns=[*plant_roles(ahead), *filter(is_set_point, ahead)])
    for role in plant_roles(ahead.columns.difference(unplanned(ahead), sort=False)):
        step = ahead.index[1] - ahead.index[0] if len(ahead) > 1 else pd.Timedelta(0)
        if ahead[role].isna().all() and weather.notna().any(axis=1).sum() * step >= _SHORTEST_FUTURE:
            raise ValueError(
                f"{role} is empty in the rows ahead, from {ahead.index[0]}: fill in what is planned, or the set-points "
                "that the thermostat is to hold."
            )


def _next_day(
    frame: pd.DataFrame, last_known: pd.Timestamp, horizon: pd.Timedelta
) -> tuple[pd.Timestamp, pd.Timestamp, bool]:
    """First and last stamp of the day to forecast, and whether it was measured."""
    index = pd.DatetimeIndex(frame.index)
    step = even_step(index)
    if index[-1] - last_known >= _SHORTEST_FUTURE:
        return last_known + step, index[-1], False
    midnights = index[index == index.normalize()]
    whole = midnights[midnights + horizon - step <= last_known]
    begin = whole[-1] if len(whole) and whole[-1] > index[0] + horizon else last_known - horizon + step
    if begin <= index[0]:
        raise ValueError(f"the log spans {index[0]} to {index[-1]}, which leaves no history before its last day.")
    return begin, begin + horizon - step, True


def _unbroken(rows: pd.DataFrame, temperatures: Sequence[str]) -> pd.DataFrame:
    """The rows after the last one with a missing input."""
    broken = np.flatnonzero(inputs_of(rows, temperatures).isna().any(axis=1).to_numpy())
    return rows.iloc[broken[-1] + 1 :] if len(broken) else rows


def _setpoints(frame: pd.DataFrame, settings: Settings, history: pd.DataFrame, future: pd.DataFrame) -> Any:
    """The temperature to hold; of several zones a column for each."""
    if not settings.zones:
        return _setpoint(frame, "T_za", settings.load, history, future)
    by_zone = zip(settings.zones, settings.roles_of("T_za"), strict=True)
    return pd.DataFrame({zone: _setpoint(frame, role, settings.load, history, future) for zone, role in by_zone})


def _setpoint(
    frame: pd.DataFrame, role: str, load: Mapping[str, Any], history: pd.DataFrame, future: pd.DataFrame
) -> pd.Series:
    """The temperature to hold in a zone: given, logged, or measured (a day before, where it was not)."""
    index = history.index.append(future.index)
    wanted = load.get("setpoint", "measured")
    if not isinstance(wanted, str):
        return pd.Series(float(wanted), index=index, name=SETPOINT)
    if wanted != "measured":
        if SETPOINT not in frame or frame[SETPOINT].reindex(index).isna().all():
            raise ValueError(
                f"the set-point, column {wanted!r}, has no value from {index[0]} to {index[-1]}; give another [load] "
                "setpoint."
            )
        return frame[SETPOINT].reindex(index).ffill().bfill().rename(SETPOINT)
    measured = frame[role].reindex(index).interpolate(limit_area="inside")
    day = rows_per_day(index[1] - index[0])
    return measured.fillna(measured.shift(day)).ffill().bfill().rename(SETPOINT)
