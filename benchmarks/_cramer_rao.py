"""Cramer-Rao bound of the office's parameters if the gain is not measured, but its statistics are known.

The measurements are jointly Gaussian: the mean follows from the parameters, the inputs, a weekly profile of unknown
level and shape and an unknown ventilation; the covariance from the rest of the gain (its variance depends on the hour,
its memory is a mixture of time constants), the unknown first state and the thermometer.  Profile and ventilation have
wide priors, but stand in the mean, at what they truly are: with them in the covariance the bound would be that of
profiles drawn from +-3 kW, which move the room far more than the true ones and so tell more of it.

The statistics are those of the TRUE gains of many other draws; an estimator has to find them out, which the bound does
not charge.
Dense matrices and SciPy only: nothing of the estimator is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import block_diag, cho_factor, cho_solve, toeplitz
from scipy.optimize import nnls
from scipy.signal import cont2discrete, lfilter, ss2tf

from skhybrid.datasets import make_office
from skhybrid.datasets._gains import INFILTRATION_KW_K, VENTILATION_KW_K

NAMES = ("C_w", "C_za", "R_zw", "R_zo", "f", "A_win", "Q_c")
FIRST_SD = np.array([2.0, 0.5])  # of the wall and of the room [K]
LEVEL_SD, VENTILATION_SD = 3.0, 0.03  # [kW], [kW/K]
_BLOCK = 3  # hours that share a standard deviation


_TAUS = np.array([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])  # [h]
_LAGS = np.unique(np.round(np.geomspace(1, 192, 30)).astype(int))  # rows


class GainStatistics(NamedTuple):
    """Statistics of a gain, known before the measurements."""

    sigma: np.ndarray  # (16,) by three hours of a weekday, then of a weekend day [kW]
    busy: np.ndarray  # (16,) bool, classes whose remainder is of the large kind
    shares: np.ndarray  # (2, 9) of every time constant in the variance of a quiet and of a busy hour
    steps: np.ndarray  # (2,) of the hourly profile [kW]
    profile: np.ndarray  # (48,) by hour of a weekday, then of a weekend day [kW]


def _split(office) -> tuple[np.ndarray, np.ndarray]:
    """The gain without mean infiltration and ventilation [kW], and the outdoor-room difference by day [K]."""
    time = office.X.index
    difference = (office.X["T_oa"] - office.states["T_za"]).to_numpy()
    busy = np.asarray((time.day_of_week < 5) & (time.hour >= 6) & (time.hour < 19))
    air = INFILTRATION_KW_K + VENTILATION_KW_K * busy
    by_day = np.asarray((time.day_of_week < 5) & (time.hour >= 6) & (time.hour < 21))
    return office.heat_gain.to_numpy() - air * difference, difference * by_day


def statistics(seeds: range, **settings) -> GainStatistics:
    """Of the gains of many draws, around the mean that all of them have at that hour of the week."""
    offices = [make_office(random_state=seed, **settings) for seed in seeds]
    time = offices[0].X.index
    gains = np.array([_split(office)[0] for office in offices])
    cell = np.asarray(time.hour + 24 * (time.day_of_week >= 5))
    mean = pd.Series(gains.mean(axis=0)).groupby(cell).mean().to_numpy()
    rest, klass = gains - mean[cell], _classes(time)
    sigma = np.sqrt([np.mean(rest[:, klass == k] ** 2) for k in range(16)])
    busy = sigma > 0.3 * sigma.max()
    scaled = rest / sigma[klass]
    shares = np.array([_memory(scaled, busy[klass] == kind, time) for kind in (False, True)])
    days = mean.reshape(2, 24)
    steps = np.sqrt(np.mean((days - np.roll(days, 1, axis=1)) ** 2, axis=1))
    return GainStatistics(sigma, busy, shares, steps, mean)


def _classes(time: pd.DatetimeIndex) -> np.ndarray:
    return np.asarray(time.hour // _BLOCK + 8 * (time.day_of_week >= 5))


def _memory(scaled: np.ndarray, rows: np.ndarray, time: pd.DatetimeIndex) -> np.ndarray:
    """Shares of the time constants that explain the autocorrelation of the chosen rows."""
    if not rows.any():
        return np.zeros(len(_TAUS))
    hours = (time[1] - time[0]) / pd.Timedelta("1h")
    left, right = [np.ones(len(_TAUS)) * 10.0], [10.0]  # they sum to 1
    for lag in _LAGS:
        both = rows[lag:] & rows[:-lag]
        if both.any():
            left.append(np.exp(-lag * hours / _TAUS))
            right.append(float(np.mean(scaled[:, lag:][:, both] * scaled[:, :-lag][:, both])))
    return nnls(np.array(left), np.array(right))[0]


def rest_covariance(time: pd.DatetimeIndex, known: GainStatistics) -> np.ndarray:
    """(N, N) covariance of the gain around its profile [kW2]."""
    klass = _classes(time)
    lags = (time[1] - time[0]) / pd.Timedelta("1h") * np.arange(len(time))
    out = np.zeros((len(time), len(time)))
    for kind, shares in enumerate(known.shares):
        sigma = np.where(known.busy[klass] == kind, known.sigma[klass], 0.0)
        out += np.outer(sigma, sigma) * toeplitz(np.exp(-lags[:, None] / _TAUS) @ shares)
    return out


def coefficient_precision(known: GainStatistics) -> np.ndarray:
    """(49, 49) inverse prior covariance of the profile's hours and of the ventilation."""
    difference = np.eye(24) - np.roll(np.eye(24), 1, axis=0)
    walk = np.linalg.pinv(difference.T @ difference)
    profile = np.kron(np.eye(2), np.full((24, 24), LEVEL_SD**2)) + np.kron(np.diag(known.steps**2), walk)
    return block_diag(np.linalg.inv(profile + 1e-10 * np.eye(48)), VENTILATION_SD**-2)


def _system(theta: dict[str, float], hours: float) -> tuple[np.ndarray, np.ndarray]:
    """Discrete (A, B): states T_w, T_za; inputs T_oa, q_sol, u_heat, u_cool, heat gain."""
    p = theta
    a = np.array([[-1 / p["R_zw"], 1 / p["R_zw"]], [1 / p["R_zw"], -1 / p["R_zw"] - 1 / p["R_zo"]]])
    b = np.zeros((2, 5))
    b[0, 1] = (1 - p["f"]) * p["A_win"]
    b[1] = 1 / p["R_zo"], p["f"] * p["A_win"], p["Q_h"], p["Q_c"], 1.0
    C = np.array([[p["C_w"]], [p["C_za"]]])
    return cont2discrete((a / C, b / C, np.eye(2), np.zeros((2, 5))), hours, method="zoh")[:2]


def _response(theta: dict[str, float], gain: np.ndarray, hours: float) -> np.ndarray:
    """Room temperature [K] after gains [kW], by column."""
    A, B = _system(theta, hours)
    top, bottom = ss2tf(A, B[:, 4:], np.array([[0.0, 1.0]]), np.zeros((1, 1)))
    return lfilter(top[0], bottom, gain, axis=0)


def _through(theta: dict[str, float], gain: np.ndarray, hours: float) -> np.ndarray:
    """Covariance of the room temperature by that of the gain."""
    out = _response(theta, _response(theta, gain, hours).T, hours)
    return 0.5 * (out + out.T)


def _moments(theta: dict[str, float], inputs: np.ndarray, gain: np.ndarray, first: float, hours: float):
    """Mean and covariance of the room temperature at all rows; ``inputs`` may end in a known heat gain [kW]."""
    A, B = _system(theta, hours)
    mean, free = np.empty(len(inputs)), np.empty((len(inputs), 2))
    x, power = np.full(2, first), np.eye(2)
    for k, row in enumerate(inputs):
        mean[k], free[k] = x[1], power[1]
        x, power = A @ x + B[:, : len(row)] @ row, A @ power
    return mean, _through(theta, gain, hours) + (free * FIRST_SD**2) @ free.T


def bound(office, known: GainStatistics, noise: float = 0.03, step: float = 1e-3) -> pd.Series:
    """Standard deviations of the relative errors [%] below which no unbiased estimate can come."""
    time = office.X.index
    hours = (time[1] - time[0]) / pd.Timedelta("1h")
    by_day = _split(office)[1]
    cells = np.eye(48)[time.hour + 24 * (time.day_of_week >= 5)]
    mean_gain = cells @ known.profile + VENTILATION_KW_K * by_day
    inputs = np.column_stack([office.X[["T_oa", "q_sol", "u_heat", "u_cool"]], mean_gain])
    gain = rest_covariance(time, known)
    first, theta, unit = float(office.states["T_za"].iloc[0]), office.theta_effective, np.eye(len(time))
    factor = cho_factor(_moments(theta, inputs, gain, first, hours)[1] + noise**2 * unit, lower=True)
    slopes, turned = [], []
    for name in NAMES:
        up, down = ({**theta, name: theta[name] * np.exp(s)} for s in (step, -step))
        (m1, V1), (m0, V0) = (_moments(t, inputs, gain, first, hours) for t in (up, down))
        slopes.append((m1 - m0) / (2 * step))
        turned.append(cho_solve(factor, (V1 - V0) / (2 * step)))
    D = np.column_stack([*slopes, _response(theta, np.column_stack([cells, by_day]), hours)])
    information, k = D.T @ cho_solve(factor, D), len(NAMES)
    information[:k, :k] += 0.5 * np.array([[np.vdot(a, b.T) for b in turned] for a in turned])
    information[k:, k:] += coefficient_precision(known)
    return pd.Series(100.0 * np.sqrt(np.diag(np.linalg.inv(information))[:k]), index=list(NAMES))
