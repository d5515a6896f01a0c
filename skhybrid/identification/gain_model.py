"""What is assumed of the unmeasured heat: classes of variance, a smooth weekly profile, and air that is let in by day.

The gain is ``p(t) + U(t) (T_oa - T_za) + g(t)`` [kW]: a profile by hour and day type, a conductance of the weekday's
ventilation, and a state whose standard deviation is that of the hours (three of a day type at a time) times a factor
of the day.  Which hours and which days are quiet is thus learned, and the quiet ones carry most of the information
about the building.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..thermal import Parameter
from .experiment import Experiment

DAY_TYPES = ("weekday", "weekend")
#: hours that share a variance
BLOCK_HOURS = 3
#: classes of hours that have a variance of their own: ``<day type>_<first hour>``
CLASSES = tuple(f"{kind}_{hour:02d}" for kind in DAY_TYPES for hour in range(0, 24, BLOCK_HOURS))
#: the weekday hours in which air may be let in
DAY_HOURS = (6, 21)
#: prior standard deviations, for a plant of 6 kW: of the profile's level [kW] and of the ventilation [kW/K]
LEVEL_SD, VENTILATION_SD = 3.0, 0.03
#: harmonics of the day that a profile is made of, out of twelve: the others do not earn what they cost
N_HARMONICS = 8
#: prior of a standard deviation [6 kW plant], as mean and standard deviation of its logarithm; and of a day's factor
SIGMA_PRIOR, DAY_PRIOR = (np.log(0.15), 1.5), (0.0, 0.5)
#: most days that have a factor of their own; of longer logs two or more days in a row share one
MOST_DAYS = 56
_HOURS = 24


def hour_class(hour: np.ndarray, weekend: np.ndarray) -> np.ndarray:
    """Class of every row, (N,) int, in the order of :data:`CLASSES`."""
    return (hour // BLOCK_HOURS + (_HOURS // BLOCK_HOURS) * weekend).astype(np.int64)


def profile_cell(hour: np.ndarray, weekend: np.ndarray) -> np.ndarray:
    """Cell of the weekly profile of every row: the hour on weekdays, 24 + the hour on weekends."""
    return hour + _HOURS * weekend


def cyclic_walk_root() -> np.ndarray:
    """(24, 2 N_HARMONICS) root of the covariance of a cyclic random walk with unit steps and zero mean, smoothed.

    The waves of a day diagonalise it; only the first :data:`N_HARMONICS` are kept.
    """
    angle = 2.0 * np.pi * np.outer(np.arange(_HOURS), np.arange(1, N_HARMONICS + 1)) / _HOURS
    sd = np.sqrt(2.0 / _HOURS / (2.0 - 2.0 * np.cos(angle[1])))
    return np.hstack([np.cos(angle) * sd, np.sin(angle) * sd])


def profile_basis() -> tuple[np.ndarray, tuple[float, ...], tuple[str | None, ...]]:
    """Columns (48, r) of the profile, the prior standard deviation of each, and the parameter that multiplies it."""
    one = np.column_stack([np.ones(_HOURS), cyclic_walk_root()])
    r = one.shape[1] - 1
    names = [name for kind in DAY_TYPES for name in (None, *[f"sigma_profile_{kind}"] * r)]
    return np.kron(np.eye(len(DAY_TYPES)), one), (LEVEL_SD, *[1.0] * r) * len(DAY_TYPES), tuple(names)


@dataclass(frozen=True)
class VarianceModel:
    """Standard deviation of the gain state of every row: ``exp(variance @ logarithms)`` of the row's class."""

    klass: tuple[np.ndarray, ...]  # (N,) int of every stretch
    variance: np.ndarray  # (n_classes, len(names)) of 0 and 1
    names: tuple[str, ...]  # its parameters: of the hours, then of the days
    first_rows: tuple[tuple[int, int], ...]  # stretch and row where each day's factor begins

    @classmethod
    def of(cls, pieces: Sequence[Experiment]) -> VarianceModel:
        """The classes of the rows of an experiment's stretches; a day begins where the hour falls."""
        days, count = [], 0
        for piece in pieces:
            begins = np.append(1, np.diff(piece.hour_of_day) < 0)
            days.append(count + np.cumsum(begins) - 1)
            count = int(days[-1][-1]) + 1
        together = -(-count // MOST_DAYS)
        days = [day // together for day in days]
        n_days = int(days[-1][-1]) + 1
        keys = [day * len(CLASSES) + hour_class(p.hour_of_day, p.weekend) for day, p in zip(days, pieces, strict=True)]
        used, klass = np.unique(np.concatenate(keys), return_inverse=True)
        variance = np.hstack([np.eye(len(CLASSES))[used % len(CLASSES)], np.eye(n_days)[used // len(CLASSES)]])
        where = np.concatenate([np.arange(len(p.y)) for p in pieces])
        which = np.repeat(np.arange(len(pieces)), [len(p.y) for p in pieces])
        _, first = np.unique(np.concatenate(days), return_index=True)
        return cls(
            tuple(np.split(klass.astype(np.int64), np.cumsum([len(p.y) for p in pieces])[:-1])),
            variance,
            (*(f"sigma_{c}" for c in CLASSES), *(f"day_{d}" for d in range(n_days))),
            tuple((int(which[i]), int(where[i])) for i in first),
        )


def own_parameters(n_days: int) -> tuple[Parameter, ...]:
    """Parameters of the disturbance: time constant, noise, and standard deviations in units of a 6 kW plant."""
    kw = "6 kW plant"
    out = [Parameter("tau", "h", 0.2, 120.0, "time constant of the gain state")]
    out += [Parameter(f"sigma_{c}", kw, 0.002, 12.0, f"standard deviation from {c[-2:]} h, {c[:-3]}") for c in CLASSES]
    out += [Parameter(f"day_{d}", "-", -4.0, 4.0, "logarithm of a day's factor", "identity") for d in range(n_days)]
    out += [Parameter("sigma_y", "K", 1e-3, 1.0, "measurement noise")]
    out += [Parameter(f"sigma_profile_{k}", kw, 0.005, 5.0, f"hourly step of the {k} profile") for k in DAY_TYPES]
    return tuple(out)


def own_priors(n_days: int) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation, on the searched scale, of what the disturbance's parameters are before the data."""
    return {f"sigma_{c}": SIGMA_PRIOR for c in CLASSES} | {f"day_{d}": DAY_PRIOR for d in range(n_days)}


def ventilation_series(piece: Experiment, outdoor: np.ndarray, output: int = 0) -> np.ndarray:
    """(N,) outdoor minus last measured temperature [K] in the weekday hours of :data:`DAY_HOURS`, else 0.

    A measurement of the row itself or of an earlier one is known before the next innovation, so that the likelihood
    stays exact.
    """
    y = piece.outputs[:, output]
    last = np.maximum.accumulate(np.where(np.isfinite(y), np.arange(len(y)), -1))
    room = np.where(last >= 0, y[last], np.nan)
    difference = np.where(np.isfinite(room), outdoor - room, 0.0)
    busy = ~piece.weekend & (piece.hour_of_day >= DAY_HOURS[0]) & (piece.hour_of_day < DAY_HOURS[1])
    return difference * busy
