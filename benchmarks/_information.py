"""Cramer-Rao bound of the office's parameters if the gain is unknown and follows the estimator's model of it.

The measurements are jointly Gaussian.  Besides the network's parameters, everything that describes the gain is unknown,
up to the estimator's priors: the profile and the ventilation, which are in the mean, and the time constant, the sixteen
standard deviations, the factors of the days and the thermometer's noise, which are in the covariance.  Their values are
those that fit the office's true building best.  The bound is for data with such a gain; the true gain differs.

Dense matrices and SciPy only.  ``python benchmarks/_information.py`` compares the bound with the spread of
estimates from drawn measurements.
"""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
from _cramer_rao import LEVEL_SD, NAMES, VENTILATION_SD, _classes, _moments, _split
from scipy.linalg import cho_factor, cho_solve, toeplitz

from skhybrid import PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning

HARMONICS = 8
DAY_TYPES = ("weekday", "weekend")
SIGMAS = [f"sigma_{kind}_{hour:02d}" for kind in DAY_TYPES for hour in range(0, 24, 3)]
STEPS = [f"sigma_profile_{kind}" for kind in DAY_TYPES]
#: standard deviations of the priors of the logarithms
SIGMA_SD, DAY_SD, WEAK_SD = 1.5, 0.5, 1.2


def profile_columns() -> np.ndarray:
    """(24, 16) waves of a day whose standard normal coefficients make a smoothed cyclic walk of unit steps."""
    angle = 2 * np.pi * np.outer(np.arange(24), np.arange(1, HARMONICS + 1)) / 24
    sd = 1 / np.sqrt(24 * (1 - np.cos(angle[1])))
    return np.hstack([np.cos(angle) * sd, np.sin(angle) * sd])


def fitted_gain(office) -> dict[str, float]:
    """Parameters of the gain that make the measurements most likely, given the true building.

    Logarithms of time constant, standard deviations and factors; levels [kW], standardised waves, ventilation [kW/K].
    """
    model = PeriodicDisturbanceID(known=office.theta_effective, variance="3h", n_starts=2, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model.fit(office.X, office.y)
    out = {name: float(np.log(value)) for name, value in model.disturbance_.items()}
    out |= {f"day_{d}": float(np.log(factor)) for d, factor in enumerate(model.day_factors_)}
    time, air = office.X.index, _split(office)[1]
    by_hour = pd.Series(air).groupby([time.day_of_week >= 5, time.hour]).mean().to_numpy().reshape(2, 24)
    for kind, hours, mean_air in zip(DAY_TYPES, model.profile_.to_numpy().T, by_hour, strict=True):
        hours = hours - model.ventilation_ * mean_air
        step = np.exp(out[f"sigma_profile_{kind}"])
        waves = np.linalg.lstsq(profile_columns() * step, hours - hours.mean(), rcond=None)[0]
        out[f"level_{kind}"] = float(hours.mean())
        out |= {f"wave_{kind}_{j}": float(z) for j, z in enumerate(waves)}
    return out | {"ventilation": float(model.ventilation_)}


def prior_precision(name: str) -> float:
    """Of one number of :func:`fitted_gain`, as the estimator has it; 0 of the building's parameters."""
    if name in NAMES:
        return 0.0
    if name == "ventilation":
        return VENTILATION_SD**-2
    kinds = {"level": LEVEL_SD**-2, "wave": 1.0, "day": DAY_SD**-2}
    return kinds.get(name.split("_")[0], SIGMA_SD**-2 if name in SIGMAS else WEAK_SD**-2)


def mean_gain(office, gain: dict[str, float]) -> np.ndarray:
    """(N,) profile and ventilation [kW]."""
    days = []
    for kind in DAY_TYPES:
        waves = np.array([gain[f"wave_{kind}_{j}"] for j in range(2 * HARMONICS)])
        days.append(gain[f"level_{kind}"] + np.exp(gain[f"sigma_profile_{kind}"]) * profile_columns() @ waves)
    time = office.X.index
    return np.concatenate(days)[time.hour + 24 * (time.day_of_week >= 5)] + gain["ventilation"] * _split(office)[1]


def state_covariance(time: pd.DatetimeIndex, gain: dict[str, float]) -> np.ndarray:
    """(N, N) covariance of the gain state [kW2]."""
    n, hours = len(time), (time[1] - time[0]) / pd.Timedelta("1h")
    day = np.asarray((time.normalize() - time[0].normalize()).days)
    log_sigma = np.array([gain[name] for name in SIGMAS])[_classes(time)]
    sigma = np.exp(log_sigma + np.array([gain[f"day_{d}"] for d in range(day[-1] + 1)])[day])
    phi = np.exp(-hours / np.exp(gain["tau"]))
    variance = np.empty(n)
    variance[0] = sigma[0] ** 2
    for k in range(n - 1):
        variance[k + 1] = phi**2 * variance[k] + sigma[k] ** 2 * (1 - phi**2)
    rows = np.arange(n)
    return toeplitz(phi**rows) * variance[np.minimum.outer(rows, rows)]


def model_moments(office, theta: dict[str, float], gain: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the measurements."""
    time = office.X.index
    inputs = np.column_stack([office.X[["T_oa", "q_sol", "u_heat", "u_cool"]], mean_gain(office, gain)])
    hours, first = (time[1] - time[0]) / pd.Timedelta("1h"), float(office.states["T_za"].iloc[0])
    mean, V = _moments(theta, inputs, state_covariance(time, gain), first, hours)
    V[np.diag_indices(len(V))] += np.exp(2 * gain["sigma_y"])
    return mean, V


def information(office, gain: dict[str, float], step: float = 1e-3) -> pd.DataFrame:
    """Expected Fisher information: of logarithms of the building's parameters, and of the gain's; without priors."""
    theta = office.theta_effective
    factor = cho_factor(model_moments(office, theta, gain)[1], lower=True)
    names, slopes, turned = [*NAMES, *gain], [], []
    for name in names:
        at = []
        for shift in (step, -step):
            moved = {**theta, name: theta[name] * np.exp(shift)} if name in theta else theta
            at.append(model_moments(office, moved, {**gain, name: gain[name] + shift} if name in gain else gain))
        slopes.append((at[0][0] - at[1][0]) / (2 * step))
        change = at[0][1] - at[1][1]
        turned.append(cho_solve(factor, change) / (2 * step) if change.any() else None)
    out = pd.DataFrame(0.0, index=names, columns=names)
    for a, rows in zip(names, turned, strict=True):
        for b, columns in zip(names, turned, strict=True):
            if rows is not None and columns is not None and out.loc[b, a] == 0.0:
                out.loc[a, b] = out.loc[b, a] = 0.5 * np.vdot(rows, columns.T)
    D = np.array(slopes).T
    return out + D.T @ cho_solve(factor, D)


def bound(office, gain: dict[str, float] | None = None) -> pd.Series:
    """Standard deviations of the relative errors [%] if the parameters of the gain are unknown too."""
    found = information(office, fitted_gain(office) if gain is None else gain)
    total = found.to_numpy() + np.diag([prior_precision(name) for name in found])
    return pd.Series(100 * np.sqrt(np.diag(np.linalg.inv(total)))[: len(NAMES)], index=list(NAMES))


def check(draws: int = 30, seed: int = 900) -> pd.DataFrame:
    """The bound of one office, and the spread of the estimates [%] from measurements that the fitted model makes."""
    office = make_office(random_state=seed)
    gain, rng, truth = fitted_gain(office), np.random.default_rng(0), pd.Series(office.theta_effective)
    mean, V = model_moments(office, office.theta_effective, gain)
    root, errors = np.linalg.cholesky(V), []
    for _ in range(draws):
        y = mean + root @ rng.normal(size=len(mean))
        model = PeriodicDisturbanceID(known={"Q_h": 6.0}, variance="3h", random_state=0).fit(office.X.assign(T_za=y), y)
        errors.append(100 * np.log(model.theta_ / truth))
    found = pd.DataFrame(errors)[list(NAMES)]
    rows = {"bound": bound(office, gain), "standard deviation": found.std(), "mean": found.mean()}
    return pd.DataFrame({**rows, "median error": found.abs().median()}).T


if __name__ == "__main__":
    print(check().round(2).to_string())
