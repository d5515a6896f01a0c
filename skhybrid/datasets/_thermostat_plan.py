"""Set-points of the synthetic office: the weekly plan and a pseudo-random binary perturbation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._arguments import check_integer, is_number
from .._holidays import NO_HOLIDAYS, Holidays
from .._time import positive_duration, rows_of
from ._random import spawn_generators

OCCUPIED_HOURS = (6, 19)  # occupied hours of a weekday (paper 2.1)
#: ranges of the uniformly drawn set-points [degC]; those for cooling are the paper's (2.1).
COOLING_RANGE = {"occupied": (23.0, 25.0), "unoccupied": (28.0, 30.0)}
HEATING_RANGE = {"occupied": (20.0, 21.0), "unoccupied": (15.0, 16.0)}
#: levels of the perturbed set-point (paper 2.1), and half the distance between the heating and cooling set-points
#: around it [degC].
PERTURBED_RANGE = (18.0, 25.0)
PERTURBED_HALF_BAND = 0.5


def make_prbs(
    order: int = 4,
    scale: Any = "2h",
    *,
    duration: Any = None,
    step: Any = "5min",
    low: float = 0.0,
    high: float = 1.0,
    random_state: Any = None,
) -> np.ndarray:
    """Draw a maximum-length pseudo-random binary sequence, for set-points that excite a building.

    The paper (2.1) takes order 4 and scale 2 h, between 18 and 25 degC.

    Parameters
    ----------
    order : int
        Order n of the shift register, 2 to 32; the sequence repeats after 2^n - 1 bits.
    scale : timedelta-like
        Duration of one bit.
    duration : timedelta-like, optional
        Length of the signal; default is one period.
    step : timedelta-like
        Sampling time; ``scale`` must be a multiple of it.
    low, high : float
        The two levels, in any unit.
    random_state : int, RandomState, Generator or None
        Seed of the position in the period at which the sequence begins.

    Returns
    -------
    ndarray of shape (duration / step,), float64

    Raises
    ------
    ValueError
        If ``order`` is out of its range, ``scale`` or ``duration`` is not a multiple of ``step``, or a level is no
        number.
    """
    from scipy.signal import max_len_seq

    check_integer("order", order, 2, 32)
    for name, level in (("low", low), ("high", high)):
        if not is_number(level):
            raise ValueError(f"{name}={level!r} must be a number.")
    delta = positive_duration(step, "step")
    hold = rows_of(scale, delta, "scale")
    n_rows = hold * (2**order - 1) if duration is None else rows_of(duration, delta, "duration")
    (rng,) = spawn_generators(random_state, 1)
    state = np.zeros(order, dtype=np.int8)
    while not state.any():  # the register must not be all zeros
        state = rng.integers(0, 2, size=order, dtype=np.int8)
    bits, _ = max_len_seq(int(order), state=state, length=-(-n_rows // hold))
    return np.where(np.repeat(bits, hold)[:n_rows] == 1, float(high), float(low))


def occupied(time: pd.DatetimeIndex, holidays: Holidays = NO_HOLIDAYS) -> np.ndarray:
    """Whether each stamp lies in the occupied hours of a weekday that is not a holiday, shape (n,) bool."""
    begin, end = OCCUPIED_HOURS
    return np.asarray(~holidays.weekend(time) & (time.hour >= begin) & (time.hour < end))


def first_weekend(time: pd.DatetimeIndex) -> np.ndarray:
    """Whether each stamp lies in the first Saturday and Sunday, shape (n,) bool; none does if there is no Saturday."""
    saturday = time.day_of_week == 5
    if not saturday.any():
        return np.zeros(len(time), dtype=bool)
    begin = time[int(np.argmax(saturday))].normalize()
    return np.asarray((time >= begin) & (time < begin + pd.Timedelta("2D")))


def plan_setpoints(
    time: pd.DatetimeIndex,
    holidays: Holidays,
    excitation: str | None,
    plan_rng: np.random.Generator,
    prbs_rng: np.random.Generator,
) -> pd.DataFrame:
    """Draw ``T_heat_set`` and ``T_cool_set`` [degC]: a level per day when occupied, and one per 24 h from 19:00 on."""
    busy = occupied(time, holidays)
    since = time - time[0].normalize()
    day = np.asarray(since.days)
    night = np.asarray((since + pd.Timedelta(hours=24 - OCCUPIED_HOURS[1])).days)
    plan = {}
    for name, ranges in (("T_heat_set", HEATING_RANGE), ("T_cool_set", COOLING_RANGE)):
        by_day = plan_rng.uniform(*ranges["occupied"], size=day[-1] + 2)[day]
        by_night = plan_rng.uniform(*ranges["unoccupied"], size=day[-1] + 3)[night]
        plan[name] = np.where(busy, by_day, by_night)
    if excitation == "weekend_prbs":
        rows = first_weekend(time)
        if rows.any():
            step = time[1] - time[0]
            low, high = PERTURBED_RANGE
            levels = make_prbs(duration="2D", step=step, low=low, high=high, random_state=prbs_rng)[: rows.sum()]
            plan["T_heat_set"][rows] = levels - PERTURBED_HALF_BAND
            plan["T_cool_set"][rows] = levels + PERTURBED_HALF_BAND
    return pd.DataFrame(plan, index=time)
