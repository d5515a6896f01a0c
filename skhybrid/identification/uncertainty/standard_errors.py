"""Standard errors that hold for a wrong disturbance model too: the Hessian and a delete-a-day jackknife."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student

from ..._arguments import check_level
from ..._time import rows_per_day
from ...thermal import Parameter
from ...thermal.parameters import search_bounds

_MOST = 1e3  # largest standard error of a logarithm that is computed; beyond it a direction is as good as free
_BEYOND = 50.0  # an interval of more than this many e-foldings is that of all values
_AT_BOUND = 1e-6  # a parameter this share of its range from an end is at it
_PULL = 1.0  # and held there if the log-likelihood would rise by more than this over as much as the range again
MOST_PARTS = 56  # most parts that a periodic log is left without; in a longer log each is two days or more
FEW_DAYS = 3  # fewer days than this give no useful scatter


class ParameterUncertainty(NamedTuple):
    """Uncertainty of the network's parameters after a fit, on the logarithmic scale.

    The Hessian gives the right standard errors only where the disturbance model holds.  The scatter of the parameters
    without each day (a jackknife with blocks of a day) needs no model of the gain.  A standard error is the larger of
    the two; intervals take Student's t with as many degrees of freedom as days, less one.

    A parameter that a bound holds is left out: the optimum is not stationary in it, so that the Hessian says nothing of
    its error.  The others have theirs at its value.

    One step replaces the fit without a day.  Least squares takes the Gauss-Newton matrix without that day (CR3) and
    stays within the bounds; the periodic model takes the whole Hessian, which understates the move by a day that holds
    most of the information.

    Sources: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, ch. 11; Cameron and Miller, A Practitioner's
    Guide to Cluster-Robust Inference, J. Human Resources 50, 2015.
    """

    parameters: tuple[Parameter, ...]  # the k that the data decide
    sensitivity: np.ndarray  # (n, k) in units of the noise, disturbance parameters free to follow
    model: np.ndarray  # (k, k) covariance where the disturbance model holds
    jackknife: np.ndarray  # (k, k) from the fits without each day, flat directions left out; 0 where days are few
    n_days: int
    held: tuple[str, ...] = ()  # parameters of the network that a bound or the sign holds

    @property
    def growth(self) -> np.ndarray:
        """(k,) by which the standard error of every parameter exceeds that of the model."""
        model, days = np.diag(self.model), np.diag(self.jackknife)
        return np.sqrt(np.maximum(1.0, days / np.where(model > 0, model, np.inf)))

    @property
    def covariance(self) -> np.ndarray:
        """(k, k): correlations of the model, for every parameter the larger of the two variances."""
        return self.growth[:, None] * self.model * self.growth


def theta_covariance(
    found: ParameterUncertainty, theta: pd.Series, names: list[str], idle: Sequence[str]
) -> pd.DataFrame:
    """Covariance of the parameters in their units; NaN for those held, infinite for ``idle``, which no row moves."""
    chosen = [p.name for p in found.parameters]
    scale = np.array([unit(float(theta[name])) for name in chosen])
    covariance = pd.DataFrame(0.0, index=names, columns=names)
    covariance.loc[chosen, chosen] = scale[:, None] * found.covariance * scale
    for name in idle:
        covariance.loc[name, name] = np.inf
    for name in found.held:
        covariance.loc[name, name] = np.nan
    return covariance


def theta_intervals(
    parameters: Sequence[Parameter], theta: pd.Series, std: pd.Series, n_days: int, level: float
) -> pd.DataFrame:
    """Ends of every parameter's interval: columns ``lower`` and ``upper``."""
    check_level(level)
    reach = float(student.ppf(0.5 + level / 2, max(n_days - 1, 1))) * std
    ends = {p.name: _ends(p, float(theta[p.name]), float(reach[p.name])) for p in parameters}
    return pd.DataFrame(ends, index=["lower", "upper"], dtype=np.float64).T


def unit(value: float) -> float:
    """Change of a value per unit of its logarithm; 1 at zero, where there is no logarithm."""
    return value if abs(value) > 1e-9 else 1.0


def _ends(p: Parameter, value: float, reach: float) -> tuple[float, float]:
    """Ends of an interval, within the values that the parameter can have; NaN for one without a standard error."""
    if p.transform != "log" or np.isnan(reach):
        return value - reach, value + reach
    factor = float(np.exp(reach / abs(value))) if reach < _BEYOND * abs(value) else np.inf
    near, far = value / factor, value * factor
    if p.unit == "-":
        far = min(far, 1.0)
    return (near, far) if value > 0 else (far, near)


def open_places(problem: Any, free: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Places of the searched parameters that no bound holds, where the negative log-likelihood has a ``slope`` (p,)."""
    low, high = search_bounds(problem.searched)
    near = _AT_BOUND * (high - low)
    outward = np.where(free - low <= near, slope, np.where(high - free <= near, -slope, 0.0))
    return np.flatnonzero(outward * (high - low) <= _PULL)


def day_of_rows(n_rows: int, hours: float) -> np.ndarray:
    """Block of 24 hours that each row lies in, (n_rows,) int."""
    return np.arange(n_rows) // rows_per_day(hours)


def inverse_information(information: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix; a direction without any gets a huge variance, not none."""
    values, vectors = informed_directions(information)
    return (vectors / values) @ vectors.T


def informed_directions(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (k,) and eigenvectors (k, k) of an information matrix; those of directions without any are small."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    return np.maximum(values, max(1e-15 * float(values.max(initial=0.0)), _MOST**-2)), vectors


def jackknife_covariance(moves: np.ndarray, overlap: int = 0) -> np.ndarray:
    """(k, k) covariance from the moves (D, k) of the estimates without each of D blocks.

    Products of blocks up to ``overlap`` apart have Bartlett's weights (Newey and West, Econometrica 55, 1987).
    """
    D = len(moves)
    if D < FEW_DAYS:
        return np.zeros((moves.shape[1], moves.shape[1]))
    alone = (D - 1) / D * moves.T @ moves
    variance = together = (moves**2).sum(axis=0)
    for lag in range(1, min(overlap, D - 1) + 1):
        weight = 1.0 - lag / (overlap + 1.0)
        together = together + 2.0 * weight * (moves[lag:] * moves[:-lag]).sum(axis=0)
    growth = np.sqrt(np.maximum(together / np.where(variance > 0, variance, np.inf), 1.0))
    return growth[:, None] * alone * growth


def prior_precision(problem: Any) -> np.ndarray:
    """(p,) inverse variances of the priors on the searched scale; 0 where there is none."""
    return np.zeros(len(problem.searched)) if problem.spread is None else 1.0 / problem.spread**2


def prior_slope(problem: Any, free: np.ndarray) -> np.ndarray:
    """(p,) slope of the priors' share of the negative log-density."""
    return prior_precision(problem) * (free - (0.0 if problem.centre is None else problem.centre))


def log_slopes(problem: Any, free: np.ndarray) -> np.ndarray:
    """(p,) derivative of log |value| by what is searched: 1 for a logarithm."""
    pairs = zip(problem.searched, free, strict=True)
    return np.array([1.0 if p.transform == "log" else 1.0 / unit(x) for p, x in pairs])
