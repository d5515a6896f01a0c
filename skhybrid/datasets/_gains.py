"""Unmeasured heat gains of the synthetic room of 57 m2: people, plugs, lights and air exchange.

The paper (2.1) lumps them into one stochastic term.  Here ten people arrive, have lunch and leave at individual times,
with an attendance that varies from day to day.  Ventilation and infiltration are a conductance to outdoor air, whose
heat depends on the room temperature and is computed by the simulation.  The room can also be used as a home or a shop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from .._clock import hour_of_day
from .._holidays import NO_HOLIDAYS, Holidays
from ._random import ar1
from ._thermostat_plan import occupied

N_DESKS = 10
PERSON_KW, DESK_KW, LIGHTS_KW, STANDBY_KW = 0.1, 0.11, 0.55, 0.16
#: conductance to the outdoor air [kW/K]: about 25 l/s of ventilation, 0.15 air changes/h of infiltration.
VENTILATION_KW_K, INFILTRATION_KW_K = 0.03, 0.008
#: the home: people, plug load of each when awake, standby, lights, share of days away, conductance of open windows
N_INHABITANTS, INHABITANT_KW, HOME_STANDBY_KW, HOME_LIGHTS_KW = 3, 0.09, 0.12, 0.25
VACANT_SHARE, AIRING_KW_K = 0.07, 0.05
#: meals at home: power [kW], mean start [h], duration [h], probability on a weekday
HOME_MEALS = ((0.8, 7.3, 0.3, 0.7), (1.2, 12.5, 0.6, 0.3), (1.8, 18.6, 0.8, 0.85))
#: the shop: opening hours, lights of 25 W/m2, cabinets, till and screens, twice the customers of a quiet hour
SHOP_HOURS, SHOP_LIGHTS_KW, CABINETS_KW, TILL_KW, CUSTOMERS = (9.0, 20.0), 1.4, 0.4, 0.3, 3.0
_PLUG_HOURS = 1.0  # time constant of plug loads [h]


class Gains(NamedTuple):
    """Gains at every step, each of shape (n,)."""

    people: np.ndarray  # [kW]
    plugs: np.ndarray  # [kW]
    lights: np.ndarray  # [kW]
    air: np.ndarray  # conductance of ventilation and infiltration [kW/K]

    @property
    def sensible(self) -> np.ndarray:
        """Sensible heat of people, plugs and lights [kW]."""
        return self.people + self.plugs + self.lights


def draw_gains(
    time: pd.DatetimeIndex, rng: np.random.Generator, pattern: str = "office", holidays: Holidays = NO_HOLIDAYS
) -> Gains:
    """Draw the gains at every step for one of :data:`PATTERNS`."""
    return PATTERNS[pattern](_calendar(time, holidays), rng)


class _Calendar(NamedTuple):
    """Time of the simulation steps and days of the run."""

    step_hours: float  # [h]
    day: np.ndarray  # day of the run at every step, (n,)
    hour: np.ndarray  # hour of the day at every step, (n,) float
    day_of_week: np.ndarray  # of every day of the run, Monday is 0, a holiday is a Sunday, (n_days,)
    occupied: np.ndarray  # whether a step lies in office hours, (n,) bool


def _calendar(time: pd.DatetimeIndex, holidays: Holidays) -> _Calendar:
    first = time[0].normalize()
    day = np.asarray((time - first).days)
    return _Calendar(
        step_hours=(time[1] - time[0]) / pd.Timedelta("1h"),
        day=day,
        hour=hour_of_day(time),
        day_of_week=holidays.day_of_week(pd.date_range(first, periods=int(day[-1]) + 1)),
        occupied=occupied(time, holidays),
    )


def _noise(
    calendar: _Calendar, rng: np.random.Generator, time_constant: float, spread: float, shift: float
) -> np.ndarray:
    """Draw log-normal noise with a time constant [h], shape (n,); ``shift`` makes its mean about 1."""
    return np.exp(spread * ar1(rng, len(calendar.day), float(np.exp(-calendar.step_hours / time_constant))) - shift)


def _infiltration(calendar: _Calendar, rng: np.random.Generator) -> np.ndarray:
    """Conductance of infiltration [kW/K], which varies with the wind, shape (n,)."""
    return INFILTRATION_KW_K * _noise(calendar, rng, 6.0, 0.4, 0.08)


def _during(calendar: _Calendar, begin: np.ndarray, hours: np.ndarray) -> np.ndarray:
    """Whether each step lies within ``hours`` after ``begin`` [h] of its day, both (n_days,); shape (n,) bool."""
    day, hour = calendar.day, calendar.hour
    return (hour >= begin[day]) & (hour < begin[day] + hours[day])


def _office(calendar: _Calendar, rng: np.random.Generator) -> Gains:
    """Ten desks on weekdays; plugs and lights follow the people, ventilation the occupied hours."""
    day, n_days = calendar.day, len(calendar.day_of_week)
    present = _head_count(calendar, rng)
    plugs = (STANDBY_KW + DESK_KW * present) * _noise(calendar, rng, _PLUG_HOURS, 0.2, 0.02)
    dimmed = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.2)[day]
    lights = LIGHTS_KW * dimmed * np.minimum(1.0, present / 3.0)
    fan = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.3)[day]
    air = VENTILATION_KW_K * fan * calendar.occupied + _infiltration(calendar, rng)
    return Gains(PERSON_KW * present, plugs, lights, air)


def _head_count(calendar: _Calendar, rng: np.random.Generator) -> np.ndarray:
    """Number of people in the office at every step: nobody at weekends, individual hours on weekdays."""
    day, hour, weekday = calendar.day, calendar.hour, calendar.day_of_week < 5
    attendance = np.clip(0.82 + 0.13 * ar1(rng, len(weekday), 0.5), 0.25, 1.0)
    size = (len(weekday), N_DESKS)
    comes = (rng.uniform(size=size) < attendance[:, None]) & weekday[:, None]
    arrival = np.clip(rng.normal(8.3, 0.7, size=size), 6.0, 12.0)
    leaving = np.clip(rng.normal(17.3, 0.8, size=size), 13.0, 19.0)
    lunch = rng.normal(12.2, 0.4, size=size)
    lunch_hours = np.where(rng.uniform(size=size) < 0.6, rng.uniform(0.4, 1.0, size=size), 0.0)
    count = np.zeros(len(day))
    for desk in range(N_DESKS):
        begin, end, out, away = (a[day, desk] for a in (arrival, leaving, lunch, lunch_hours))
        count += comes[day, desk] & (hour >= begin) & (hour < end) & ~((hour >= out) & (hour < out + away))
    return count


def _home(calendar: _Calendar, rng: np.random.Generator) -> Gains:
    """Three people: out on most weekdays, at home in the evening, at night and at weekends; on some days nobody."""
    hour, weekday = calendar.hour, calendar.day_of_week < 5
    n_days = len(weekday)
    awake, asleep = _inhabitants(calendar, rng)
    at_home = np.minimum(1.0, awake)
    plugs = (HOME_STANDBY_KW + INHABITANT_KW * awake) * _noise(calendar, rng, _PLUG_HOURS, 0.3, 0.045)
    for kw, begin, hours, chance in HOME_MEALS:
        cooks = rng.uniform(size=n_days) < np.where(weekday, chance, min(1.0, chance + 0.3))
        length = np.where(cooks, rng.uniform(0.7, 1.3, n_days) * hours, 0.0)
        plugs += kw * at_home * _during(calendar, rng.normal(begin, 0.5, n_days), length)
    dark = np.clip(np.abs(hour - 13.0) - 5.0, 0.0, 1.0)
    airing = AIRING_KW_K * at_home * _during(calendar, rng.normal(7.8, 0.7, n_days), rng.uniform(0.1, 0.6, n_days))
    air = airing + _infiltration(calendar, rng)
    return Gains(PERSON_KW * (awake + 0.7 * asleep), plugs, HOME_LIGHTS_KW * dark * at_home, air)


def _inhabitants(calendar: _Calendar, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Number of people at home at every step, awake and asleep."""
    day, hour, weekday = calendar.day, calendar.hour, calendar.day_of_week < 5
    n_days = len(weekday)
    inhabited = rng.uniform(size=n_days) >= VACANT_SHARE
    awake, asleep = np.zeros(len(day)), np.zeros(len(day))
    for _ in range(N_INHABITANTS):
        works = weekday & (rng.uniform(size=n_days) < 0.8)
        leaves = np.where(works, rng.normal(8.0, 0.5, n_days), rng.normal(13.0, 2.0, n_days))
        away = np.where(works, rng.normal(9.5, 1.0, n_days), rng.uniform(0.0, 5.0, n_days))
        out = _during(calendar, leaves, away)
        up, bed = rng.normal(np.where(weekday, 6.8, 8.5), 0.4), rng.normal(22.8, 0.5, n_days)
        sleeps = (hour < up[day]) | (hour >= bed[day])
        awake += inhabited[day] & ~out & ~sleeps
        asleep += inhabited[day] & ~out & sleeps
    return awake, asleep


def _shop(calendar: _Calendar, rng: np.random.Generator) -> Gains:
    """Open six days a week: bright lights, refrigerated cabinets, two staff, customers at noon and after work."""
    day, hour, day_of_week = calendar.day, calendar.hour, calendar.day_of_week
    n_days = len(day_of_week)
    hours = np.where(day_of_week == 6, 0.0, SHOP_HOURS[1] - SHOP_HOURS[0])
    opens = rng.normal(SHOP_HOURS[0], 0.1, n_days)
    opened = _during(calendar, opens, hours)
    staffed = _during(calendar, opens - 0.7, np.where(hours > 0, hours + 1.2, 0.0))
    business = np.where(day_of_week == 5, 1.5, 1.0) * np.exp(0.2 * rng.normal(size=n_days))
    rush = 0.5 + np.exp(-0.5 * ((hour - 12.3) / 1.0) ** 2) + np.exp(-0.5 * ((hour - 17.5) / 1.2) ** 2)
    visits = _noise(calendar, rng, 0.5, 0.5, 0.125)
    people = 2.0 * staffed + CUSTOMERS * business[day] * rush * visits * opened
    plugs = (CABINETS_KW + TILL_KW * staffed) * _noise(calendar, rng, _PLUG_HOURS, 0.15, 0.011)
    door = 1.0 + 0.3 * visits
    air = VENTILATION_KW_K * door * opened + _infiltration(calendar, rng)
    return Gains(PERSON_KW * people, plugs, SHOP_LIGHTS_KW * staffed, air)


def _none(calendar: _Calendar, rng: np.random.Generator) -> Gains:
    """No gains and no air exchange: the room is the thermal network alone."""
    return Gains(*(np.zeros(len(calendar.day)) for _ in Gains._fields))


PATTERNS = {"office": _office, "home": _home, "shop": _shop, "none": _none}  # who uses the room
