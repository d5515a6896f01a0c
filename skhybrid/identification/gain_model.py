"""Model of the unmeasured heat: classes of variance, a smooth weekly profile, and ventilation by day."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._calendar import one_hot, profile_cell
from .._last_known import carried_forward
from ..thermal import Parameter
from .experiment import Experiment

# The gain is ``p(t) + U(t) (T_oa - T_za) + g(t)`` [kW]: a profile by hour and day type, a conductance of the weekday's
# ventilation, and a state whose standard deviation is that of a class of hours times a factor of the day.  The quiet
# hours and days are thus learned, and they carry most of the information about the building.

DAY_TYPES = ("weekday", "weekend")
DAY_HOURS = (6, 21)  # weekday hours of ventilation
#: prior standard deviations, for a plant of 6 kW: of the profile's level [kW] and of the ventilation [kW/K]
LEVEL_SD, VENTILATION_SD = 3.0, 0.03
N_HARMONICS = 8  # harmonics of the day in a profile, out of twelve; the others cost more time than they gain
#: prior of a standard deviation [6 kW plant], as mean and standard deviation of its logarithm; and of a day's factor
SIGMA_PRIOR, DAY_PRIOR = (np.log(0.15), 1.5), (0.0, 0.5)
MOST_DAYS = 56  # most days that have a factor of their own; in longer logs two or more days in a row share one
PLANT = "6 kW plant"  # unit in which standard deviations of the gain are searched
_HOURS = 24


def week_cells(experiment: Experiment) -> np.ndarray:
    """(N,) cell of the weekly profile of every row."""
    return profile_cell(experiment.hour_of_day, experiment.weekend)


class HourClasses(NamedTuple):
    """Hours of the week that share a variance."""

    names: tuple[str, ...]
    of_cell: np.ndarray  # (48,) class of every cell of the weekly profile


def _day_and_night() -> HourClasses:
    day = (np.arange(_HOURS) >= DAY_HOURS[0]) & (np.arange(_HOURS) < DAY_HOURS[1])
    names = ("weekday_day", "weekday_night", "weekend")
    return HourClasses(names, np.concatenate([np.where(day, 0, 1), np.full(_HOURS, 2)]).astype(np.int64))


def _blocks(hours: int) -> HourClasses:
    names = tuple(f"{kind}_{hour:02d}" for kind in DAY_TYPES for hour in range(0, _HOURS, hours))
    return HourClasses(names, np.arange(len(DAY_TYPES) * _HOURS) // hours)


def smooth_walk_root() -> np.ndarray:
    """(24, 2 N_HARMONICS) root of the covariance of a cyclic random walk with unit steps, of its slowest waves."""
    # the waves of a day diagonalise it
    angle = 2.0 * np.pi * np.outer(np.arange(_HOURS), np.arange(1, N_HARMONICS + 1)) / _HOURS
    sd = np.sqrt(2.0 / _HOURS / (2.0 - 2.0 * np.cos(angle[1])))
    return np.hstack([np.cos(angle) * sd, np.sin(angle) * sd])


def profile_basis() -> tuple[np.ndarray, tuple[float, ...], tuple[str | None, ...]]:
    """Columns (48, r) of the profile, the prior standard deviation of each, and the parameter that multiplies it."""
    one = np.column_stack([np.ones(_HOURS), smooth_walk_root()])
    r = one.shape[1] - 1
    names = [name for kind in DAY_TYPES for name in (None, *[f"sigma_profile_{kind}"] * r)]
    return np.kron(np.eye(len(DAY_TYPES)), one), (LEVEL_SD, *[1.0] * r) * len(DAY_TYPES), tuple(names)


#: few classes are robust to a network that is too simple; many tell quiet hours apart
HOUR_CLASSES = {"day_night": _day_and_night(), "3h": _blocks(3)}


@dataclass(frozen=True)
class VarianceModel:
    """Standard deviation of the gain state of every row: ``exp(variance @ logarithms)`` of the row's class."""

    klass: tuple[np.ndarray, ...]  # (N,) int of every segment
    variance: np.ndarray  # (n_classes, len(names)) of 0 and 1
    names: tuple[str, ...]  # its parameters: of the hours, then of the days
    first_rows: np.ndarray  # (n_days,) where each day's factor begins

    @classmethod
    def of(cls, experiment: Experiment, hours: HourClasses) -> VarianceModel:
        """The classes of an experiment's rows; a day begins where the hour falls, and with every segment."""
        begins, size = np.append(True, np.diff(experiment.hour_of_day) < 0), len(hours.names)
        begins[list(experiment.breaks)] = True
        day = np.cumsum(begins) - 1
        together = -(-(int(day[-1]) + 1) // MOST_DAYS)
        days, first, day = np.unique(day // together, return_index=True, return_inverse=True)
        used, klass = np.unique(day * size + hours.of_cell[week_cells(experiment)], return_inverse=True)
        variance = np.hstack([one_hot(used % size, size), one_hot(used // size, len(days))])
        by_segment = tuple(np.split(klass.astype(np.int64), experiment.breaks[1:]))
        names = (*(f"sigma_{c}" for c in hours.names), *(f"day_{d}" for d in days))
        return cls(by_segment, variance, names, first)


def gain_noise(sigma: np.ndarray, phi: float, n: int, m: int) -> np.ndarray:
    """(k, n + m, n + m) covariance of a step's noise in k classes, which only the last m states, of the gain, have.

    Each is an Ornstein-Uhlenbeck process of standard deviation ``sigma`` (k,), of which ``phi`` is left after a step.
    """
    Q = np.zeros((len(sigma), n + m, n + m))
    for i in range(n, n + m):
        Q[:, i, i] = sigma**2 * (1.0 - phi**2)
    return Q


def gain_parameters(n_days: int, hours: HourClasses) -> tuple[Parameter, ...]:
    """Parameters of the disturbance: time constant, noise, and standard deviations in units of a 6 kW plant."""
    out = [Parameter("tau", "h", 0.2, 120.0, "time constant of the gain state")]
    out += [Parameter(f"sigma_{c}", PLANT, 0.002, 12.0, f"standard deviation, {c}") for c in hours.names]
    out += [Parameter(f"day_{d}", "-", -4.0, 4.0, "logarithm of a day's factor", "identity") for d in range(n_days)]
    out += [Parameter("sigma_y", "K", 1e-3, 1.0, "measurement noise")]
    out += [Parameter(f"sigma_profile_{k}", PLANT, 0.005, 5.0, f"hourly step of the {k} profile") for k in DAY_TYPES]
    return tuple(out)


def own_priors(n_days: int, hours: HourClasses) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation, on the searched scale, of what the disturbance's parameters are before the data."""
    return {f"sigma_{c}": SIGMA_PRIOR for c in hours.names} | {f"day_{d}": DAY_PRIOR for d in range(n_days)}


def ventilation_series(segment: Experiment, outdoor: np.ndarray, output: int = 0) -> np.ndarray:
    """(N,) outdoor minus last measured temperature [K] in the weekday hours of :data:`DAY_HOURS`, else 0."""
    # what is measured up to a row is known before its next innovation, so that the likelihood stays exact
    room = carried_forward(segment.outputs[:, output])
    difference = np.where(np.isfinite(room), outdoor - room, 0.0)
    busy = ~segment.weekend & (segment.hour_of_day >= DAY_HOURS[0]) & (segment.hour_of_day < DAY_HOURS[1])
    return difference * busy
