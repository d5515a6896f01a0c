"""Unmeasured heat gains of a synthetic room of 57 m2: people, plugs, lights, air exchange.

The paper (2.1) lumps them into one stochastic term.  Here sensible gains of the office come from ten persons who
arrive, lunch and leave at times of their own, with an attendance that wanders from day to day; the outdoor air that
ventilation and infiltration bring is a conductance, whose heat depends on the room's temperature and so is found in
the simulation.  A home and a shop may use the room instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from ._random import ar1
from .excitation import occupied

N_DESKS = 10
PERSON_KW, DESK_KW, LIGHTS_KW, STANDBY_KW = 0.1, 0.11, 0.55, 0.16
#: conductance of the outdoor air [kW/K]: about 25 l/s of ventilation, 0.15 air changes/h of infiltration.
VENTILATION_KW_K, INFILTRATION_KW_K = 0.03, 0.008
#: the home: persons, what each adds when awake, the share of days on which nobody is there, and the air of airing
N_INHABITANTS, INHABITANT_KW, HOME_STANDBY_KW, HOME_LIGHTS_KW = 3, 0.09, 0.12, 0.25
VACANT_SHARE, AIRING_KW_K = 0.07, 0.05
#: meals at home: power [kW], mean begin [h], duration [h], chance on a weekday
HOME_MEALS = ((0.8, 7.3, 0.3, 0.7), (1.2, 12.5, 0.6, 0.3), (1.8, 18.6, 0.8, 0.85))
#: the shop: hours, lights of 25 W/m2, refrigerated cabinets, till and screens, mean customers at a quiet hour (twice)
SHOP_HOURS, SHOP_LIGHTS_KW, CABINETS_KW, TILL_KW, CUSTOMERS = (9.0, 20.0), 1.4, 0.4, 0.3, 3.0
_PLUG_HOURS = 1.0  # how long a plug load stays above or below its mean [h]


class Gains(NamedTuple):
    """Gains at every step, each of shape (n,)."""

    people: np.ndarray  # [kW]
    plugs: np.ndarray  # [kW]
    lights: np.ndarray  # [kW]
    air: np.ndarray  # conductance of ventilation and infiltration [kW/K]

    @property
    def sensible(self) -> np.ndarray:
        """What people, plugs and lights give off [kW]."""
        return self.people + self.plugs + self.lights


def draw_gains(time: pd.DatetimeIndex, rng: np.random.Generator, pattern: str = "office") -> Gains:
    """Draw the gains of every step of a run, for one of :data:`PATTERNS`."""
    return PATTERNS[pattern](time, rng)


def _wind(n: int, step_hours: float, rng: np.random.Generator) -> np.ndarray:
    """Infiltration relative to its mean, shape (n,)."""
    return np.exp(0.4 * ar1(rng, n, float(np.exp(-step_hours / 6.0))) - 0.08)


def _office(time: pd.DatetimeIndex, rng: np.random.Generator) -> Gains:
    step_hours = (time[1] - time[0]) / pd.Timedelta("1h")
    day = np.asarray((time - time[0].normalize()).days)
    n_days = int(day[-1]) + 1
    present = _head_count(time, day, n_days, rng)
    phi = float(np.exp(-step_hours / _PLUG_HOURS))
    plugs = (STANDBY_KW + DESK_KW * present) * np.exp(0.2 * ar1(rng, len(time), phi) - 0.02)
    dimmed = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.2)[day]
    lights = LIGHTS_KW * dimmed * np.minimum(1.0, present / 3.0)
    fan = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.3)[day]
    air = VENTILATION_KW_K * fan * occupied(time) + INFILTRATION_KW_K * _wind(len(time), step_hours, rng)
    return Gains(PERSON_KW * present, plugs, lights, air)


def _head_count(time: pd.DatetimeIndex, day: np.ndarray, n_days: int, rng: np.random.Generator) -> np.ndarray:
    """Persons in the room at every step: none at weekends, on weekdays each by their own hours."""
    attendance = np.clip(0.82 + 0.13 * ar1(rng, n_days, 0.5), 0.25, 1.0)
    weekday = np.asarray(time[0].normalize().day_of_week + np.arange(n_days)) % 7 < 5
    size = (n_days, N_DESKS)
    comes = (rng.uniform(size=size) < attendance[:, None]) & weekday[:, None]
    arrival = np.clip(rng.normal(8.3, 0.7, size=size), 6.0, 12.0)
    leaving = np.clip(rng.normal(17.3, 0.8, size=size), 13.0, 19.0)
    lunch = rng.normal(12.2, 0.4, size=size)
    lunch_hours = np.where(rng.uniform(size=size) < 0.6, rng.uniform(0.4, 1.0, size=size), 0.0)
    hour = np.asarray((time - time.normalize()) / pd.Timedelta("1h"))
    count = np.zeros(len(time))
    for desk in range(N_DESKS):
        begin, end, out, away = (a[day, desk] for a in (arrival, leaving, lunch, lunch_hours))
        count += comes[day, desk] & (hour >= begin) & (hour < end) & ~((hour >= out) & (hour < out + away))
    return count


def _spells(time: pd.DatetimeIndex, day: np.ndarray, begin: np.ndarray, hours: np.ndarray) -> np.ndarray:
    """Whether a step lies within its day's spell from ``begin`` [h] on for ``hours``, shape (n,) bool."""
    hour = np.asarray((time - time.normalize()) / pd.Timedelta("1h"))
    return (hour >= begin[day]) & (hour < begin[day] + hours[day])


def _home(time: pd.DatetimeIndex, rng: np.random.Generator) -> Gains:
    """Three persons: out on most weekdays, at home in the evening, at night and at weekends; now and then nobody."""
    step_hours = (time[1] - time[0]) / pd.Timedelta("1h")
    day = np.asarray((time - time[0].normalize()).days)
    hour = np.asarray((time - time.normalize()) / pd.Timedelta("1h"))
    n_days = int(day[-1]) + 1
    weekday = np.asarray(time[0].normalize().day_of_week + np.arange(n_days)) % 7 < 5
    inhabited = rng.uniform(size=n_days) >= VACANT_SHARE
    awake, asleep = np.zeros(len(time)), np.zeros(len(time))
    for _ in range(N_INHABITANTS):
        works = weekday & (rng.uniform(size=n_days) < 0.8)
        leaves = np.where(works, rng.normal(8.0, 0.5, n_days), rng.normal(13.0, 2.0, n_days))
        away = np.where(works, rng.normal(9.5, 1.0, n_days), rng.uniform(0.0, 5.0, n_days))
        out = _spells(time, day, leaves, away)
        up, bed = rng.normal(np.where(weekday, 6.8, 8.5), 0.4), rng.normal(22.8, 0.5, n_days)
        sleeps = (hour < up[day]) | (hour >= bed[day])
        awake += inhabited[day] & ~out & ~sleeps
        asleep += inhabited[day] & ~out & sleeps
    at_home = np.minimum(1.0, awake)
    phi = float(np.exp(-step_hours / _PLUG_HOURS))
    plugs = (HOME_STANDBY_KW + INHABITANT_KW * awake) * np.exp(0.3 * ar1(rng, len(time), phi) - 0.045)
    for kw, begin, hours, chance in HOME_MEALS:
        cooks = rng.uniform(size=n_days) < np.where(weekday, chance, min(1.0, chance + 0.3))
        length = np.where(cooks, rng.uniform(0.7, 1.3, n_days) * hours, 0.0)
        plugs += kw * at_home * _spells(time, day, rng.normal(begin, 0.5, n_days), length)
    dark = np.clip(np.abs(hour - 13.0) - 5.0, 0.0, 1.0)
    airing = AIRING_KW_K * at_home * _spells(time, day, rng.normal(7.8, 0.7, n_days), rng.uniform(0.1, 0.6, n_days))
    air = airing + INFILTRATION_KW_K * _wind(len(time), step_hours, rng)
    return Gains(PERSON_KW * (awake + 0.7 * asleep), plugs, HOME_LIGHTS_KW * dark * at_home, air)


def _shop(time: pd.DatetimeIndex, rng: np.random.Generator) -> Gains:
    """Open six days a week: bright lights, cold cabinets, two at work, customers who come at noon and after work."""
    step_hours = (time[1] - time[0]) / pd.Timedelta("1h")
    day = np.asarray((time - time[0].normalize()).days)
    hour = np.asarray((time - time.normalize()) / pd.Timedelta("1h"))
    n_days = int(day[-1]) + 1
    weekday = np.asarray(time[0].normalize().day_of_week + np.arange(n_days)) % 7
    hours = np.where(weekday == 6, 0.0, SHOP_HOURS[1] - SHOP_HOURS[0])
    opens = rng.normal(SHOP_HOURS[0], 0.1, n_days)
    opened = _spells(time, day, opens, hours)
    staffed = _spells(time, day, opens - 0.7, np.where(hours > 0, hours + 1.2, 0.0))
    business = np.where(weekday == 5, 1.5, 1.0) * np.exp(0.2 * rng.normal(size=n_days))
    rush = 0.5 + np.exp(-0.5 * ((hour - 12.3) / 1.0) ** 2) + np.exp(-0.5 * ((hour - 17.5) / 1.2) ** 2)
    come_and_go = np.exp(0.5 * ar1(rng, len(time), float(np.exp(-step_hours / 0.5))) - 0.125)
    people = 2.0 * staffed + CUSTOMERS * business[day] * rush * come_and_go * opened
    phi = float(np.exp(-step_hours / _PLUG_HOURS))
    plugs = (CABINETS_KW + TILL_KW * staffed) * np.exp(0.15 * ar1(rng, len(time), phi) - 0.011)
    door = 1.0 + 0.3 * come_and_go
    air = VENTILATION_KW_K * door * opened + INFILTRATION_KW_K * _wind(len(time), step_hours, rng)
    return Gains(PERSON_KW * people, plugs, SHOP_LIGHTS_KW * staffed, air)


def _none(time: pd.DatetimeIndex, rng: np.random.Generator) -> Gains:
    """No gain at all, and no air: the room is the network itself."""
    return Gains(*(np.zeros(len(time)) for _ in Gains._fields))


#: who uses the room
PATTERNS = {"office": _office, "home": _home, "shop": _shop, "none": _none}
