"""Unmeasured heat gains of the synthetic office (57 m2, ten desks): people, plugs, lights, air exchange.

The paper (2.1) lumps them into one stochastic term.  Here sensible gains come from persons who arrive, lunch and
leave at times of their own, with an attendance that wanders from day to day; the outdoor air that ventilation and
infiltration bring is a conductance, whose heat depends on the room's temperature and so is found in the simulation.
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


def draw_gains(time: pd.DatetimeIndex, rng: np.random.Generator) -> Gains:
    """Draw the gains of every step of a run."""
    step_hours = (time[1] - time[0]) / pd.Timedelta("1h")
    day = np.asarray((time - time[0].normalize()).days)
    n_days = int(day[-1]) + 1
    present = _head_count(time, day, n_days, rng)
    phi = float(np.exp(-step_hours / _PLUG_HOURS))
    plugs = (STANDBY_KW + DESK_KW * present) * np.exp(0.2 * ar1(rng, len(time), phi) - 0.02)
    dimmed = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.2)[day]
    lights = LIGHTS_KW * dimmed * np.minimum(1.0, present / 3.0)
    fan = np.clip(rng.normal(1.0, 0.1, size=n_days), 0.7, 1.3)[day]
    wind = np.exp(0.4 * ar1(rng, len(time), float(np.exp(-step_hours / 6.0))) - 0.08)
    air = VENTILATION_KW_K * fan * occupied(time) + INFILTRATION_KW_K * wind
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
