"""A zone under a thermostat, and the information that its log holds about the parameters.

The information is that of a Kalman filter with a gain state: the sum over rows of the conditional expectation of the
score's square given the rows before.  It is right in closed loop too, where the plant answers to the measured room,
and its mean over runs is Fisher's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ...filtering import Discrete
from ...thermal import RCNetwork
from ..disturbance_models import first_covariance

#: classes of hours that have a variance of their own, and the weekday hours of the first
CLASSES, DAY_HOURS = ("weekday_day", "weekday_night", "weekend"), (6, 21)
#: standard deviation of the profile's level [kW] for a plant of 6 kW
LEVEL_SD, _PLANT = 3.0, 6.0
#: parameters of the gain and of the thermometer that an identification has to find beside the network's
NUISANCE = ("tau", *(f"sigma_{c}" for c in CLASSES), "sigma_y")
_HOURS = 24


def _office_profile() -> np.ndarray:
    """Mean gain of the synthetic office by hour [kW], (24, 2)."""
    profile = np.full((_HOURS, 2), 0.1)
    profile[8, 0], profile[9:17, 0], profile[17, 0] = 1.35, 2.05, 1.05
    return profile


@dataclass(frozen=True)
class GainStatistics:
    """What is expected of the heat that nobody measures: a weekly profile, and a wandering around it.

    The defaults are those of the synthetic office, rounded (``python benchmarks/experiment_design.py --statistics``).

    Attributes
    ----------
    tau : float
        Time constant of the wandering [h].
    weekday_day, weekday_night, weekend : float
        Standard deviation around the profile on weekdays from 6 to 21 h, on the other weekday hours, and on weekends
        [kW].
    profile : ndarray of shape (24, 2)
        Mean gain by hour on weekdays and on weekends [kW].
    profile_step, weekend_step : float
        How much the unknown profile changes from hour to hour on weekdays and on weekends, one standard deviation [kW].
    noise_std : float
        Standard deviation of the thermometer [K].
    """

    tau: float = 2.0
    weekday_day: float = 0.4
    weekday_night: float = 0.05
    weekend: float = 0.05
    profile: np.ndarray = field(default_factory=_office_profile)
    profile_step: float = 0.3
    weekend_step: float = 0.05
    noise_std: float = 0.03

    def __post_init__(self) -> None:
        numbers = {k: v for k, v in vars(self).items() if k != "profile"}
        for name, value in numbers.items():
            if not np.isfinite(value) or value <= 0:
                raise ValueError(f"GainStatistics: {name}={value!r} must be a positive number.")
        if np.shape(self.profile) != (_HOURS, 2) or not np.isfinite(self.profile).all():
            raise ValueError(
                f"GainStatistics: profile has shape {np.shape(self.profile)}; give (24, 2) finite numbers [kW], by "
                "hour on weekdays and on weekends."
            )

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviation of every class of hours [kW], shape (3,)."""
        return np.array([self.weekday_day, self.weekday_night, self.weekend])


class Calendar(NamedTuple):
    """What the clock says of every row."""

    klass: np.ndarray  # (N,) int, class of the gain's variance
    cell: np.ndarray  # (N,) int, cell of the weekly profile: the hour on weekdays, 24 + the hour on weekends

    @classmethod
    def of(cls, hour: np.ndarray, weekend: np.ndarray) -> Calendar:
        """The calendar of rows with these local hours (int) and day types (bool)."""
        day = (hour >= DAY_HOURS[0]) & (hour < DAY_HOURS[1])
        return cls(np.where(weekend, 2, np.where(day, 0, 1)), hour + _HOURS * weekend)

    def every(self, rows: int) -> Calendar:
        """The calendar of every ``rows``-th row."""
        return Calendar(self.klass[::rows].copy(), self.cell[::rows].copy())


def cyclic_walk_root() -> np.ndarray:
    """(24, 23) root of the covariance of a cyclic first-order random walk with unit steps and zero mean."""
    steps = np.eye(_HOURS) - np.roll(np.eye(_HOURS), 1, axis=1)
    values, vectors = np.linalg.eigh(steps.T @ steps)
    return vectors[:, 1:] / np.sqrt(values[1:])


@dataclass(frozen=True)
class Zone:
    """The prior model of a zone: network, parameters, expected gain."""

    network: RCNetwork
    theta: Mapping[str, float]
    roles: tuple[str, ...]
    gain: GainStatistics

    @property
    def measured(self) -> int:
        return self.network.nodes.index(self.network.measured_nodes[0])

    def discrete(self, hours: float) -> Discrete:
        """The network over a step, the heat gain as the last input."""
        return self.network.discrete(self.theta, self.roles, hours)

    @cached_property
    def order(self) -> tuple[str, ...]:
        """Network parameters in the order of the derivatives."""
        return tuple(p.name for p in self.network.parameters(self.roles))

    def column(self, role: str) -> int:
        """Column of a role among the inputs."""
        return self.network.inputs(self.roles).index(role)


# ------------------------------------------------------------------------------------------------------- the thermostat
class Run(NamedTuple):
    """A simulated log of M cases side by side, at the simulation's step."""

    stages: np.ndarray  # (N, 2, M) heating and cooling [-]
    room: np.ndarray  # (N, M) true temperature of the measured node at the row's stamp [degC]


def draw_gain(zone: Zone, calendar: Calendar, hours: float, rng: np.random.Generator) -> np.ndarray:
    """One gain [kW], (N,): the profile and an Ornstein-Uhlenbeck walk around it."""
    phi = float(np.exp(-hours / zone.gain.tau))
    sd = zone.gain.sigma[calendar.klass]
    pushes = sd * np.sqrt(1.0 - phi**2) * rng.standard_normal(len(sd))
    out, level = np.empty(len(sd)), sd[0] * rng.standard_normal()
    for k, push in enumerate(pushes):
        out[k] = level
        level = phi * level + push
    return out + zone.gain.profile.T.ravel()[calendar.cell]


def run_thermostat(
    zone: Zone,
    inputs: np.ndarray,
    gains: np.ndarray,
    setpoints: np.ndarray,
    hours: float,
    hysteresis: float | None,
) -> Run:
    """Simulate M cases under a thermostat.

    Parameters
    ----------
    zone : Zone
    inputs : ndarray of shape (N, m)
        In the order of the network; the columns of the stages are not read.
    gains : ndarray of shape (N, M)
        Unmeasured heat [kW].
    setpoints : ndarray of shape (N, 2, M)
        Heating and cooling set-point [degC].
    hours : float
        The step [h].
    hysteresis : float or None
        How far beyond the set-point an on/off plant switches [K]; None: a plant that modulates, and holds it.

    Returns
    -------
    Run
    """
    d = zone.discrete(hours)
    stages = [(j, zone.column(r) if r in zone.roles else None) for j, r in enumerate(("u_heat", "u_cool"))]
    effects = {j: d.B[:, column] for j, column in stages if column is not None}
    weather = inputs @ d.B[:, :-1].T
    N, M = gains.shape
    u, room = np.zeros((N, 2, M)), np.empty((N, M))
    x = np.repeat(setpoints[0].mean(axis=0)[None], len(d.A), axis=0)
    on, band = np.zeros((2, M)), np.array([[1.0], [-1.0]])
    for k in range(N):
        here = x[zone.measured]
        room[k] = here
        x = d.A @ x + weather[k][:, None] + np.outer(d.B[:, -1], gains[k])
        if hysteresis is not None:  # short[0]: too cold for heating to rest, short[1]: too warm for cooling to
            short = band * (setpoints[k] - here) + hysteresis * (2.0 * on - 1.0)
            on = (short > 0).astype(np.float64)
            on[1] *= 1.0 - on[0]
        else:
            reach = np.array([effects[j][zone.measured] if j in effects else np.inf for j in (0, 1)])[:, None]
            on = np.clip((setpoints[k] - x[zone.measured]) / reach, 0.0, 1.0)
        for j, effect in effects.items():
            u[k, j] = on[j]
            x = x + np.outer(effect, on[j])
    return Run(u, room)


# ------------------------------------------------------------------------------------------------------- information
class _Gains(NamedTuple):
    """Gains ``A P c / S`` and innovation variances of every row, and derivatives by q unknowns."""

    K: np.ndarray  # (N, n)
    S: np.ndarray  # (N,)
    dK: np.ndarray  # (N, q, n)
    dS: np.ndarray  # (N, q)


class Scores(NamedTuple):
    """What the score of M logs is made of."""

    de: np.ndarray  # (N, M, q) derivatives of the innovations
    dS: np.ndarray  # (N, q) derivatives of their variances
    S: np.ndarray  # (N,) the variances


@dataclass(frozen=True)
class FilterInformation:
    """Information in a log about network, gain and thermometer, by a filter at the prior model.

    The order of the unknowns is that of ``free`` (network parameters), :data:`NUISANCE`, and 48 standard normal numbers
    behind the weekly profile.  All but the last are logarithms.
    """

    zone: Zone
    calendar: Calendar
    hours: float
    free: tuple[str, ...]

    @cached_property
    def _profile_root(self) -> np.ndarray:
        plant = max((abs(v) for k, v in self.zone.theta.items() if k.startswith("Q_")), default=_PLANT)
        level = np.full((_HOURS, 1), LEVEL_SD * plant / _PLANT)
        steps = (self.zone.gain.profile_step, self.zone.gain.weekend_step)
        return block_diag(*(np.hstack([level, step * cyclic_walk_root()]) for step in steps))

    @cached_property
    def _system(self) -> tuple[Discrete, np.ndarray, np.ndarray]:
        """The network with the gain as a last state, derivatives by all unknowns, and the gain's own noise."""
        zone, d = self.zone, self.zone.discrete(self.hours)
        n, m = d.B.shape
        chosen = [zone.order.index(name) for name in self.free]
        p, q = len(chosen), len(chosen) + len(NUISANCE)
        total = q + 2 * _HOURS
        A, B = np.zeros((n + 1, n + 1)), np.zeros((n + 1, m))
        dA, dB = np.zeros((total, n + 1, n + 1)), np.zeros((total, n + 1, m))
        scale = np.array([zone.theta[name] for name in self.free]).reshape(-1, 1, 1)
        A[:n, :n], A[:n, n], B[:n] = d.A, d.B[:, -1], d.B
        dA[:p, :n, :n], dA[:p, :n, n] = scale * d.dA[chosen], scale[:, :, 0] * d.dB[chosen, :, -1]
        dB[:p, :n] = scale * d.dB[chosen]
        phi = float(np.exp(-self.hours / zone.gain.tau))
        A[n, n], dA[p, n, n] = phi, phi * self.hours / zone.gain.tau
        Q, dQ = np.zeros((len(CLASSES), n + 1, n + 1)), np.zeros((total, len(CLASSES), n + 1, n + 1))
        variance = zone.gain.sigma**2
        Q[:, n, n] = variance * (1.0 - phi**2)
        dQ[p, :, n, n] = -2.0 * variance * phi * dA[p, n, n]
        for i in range(len(CLASSES)):
            dQ[p + 1 + i, i, n, n] = 2.0 * Q[i, n, n]
        return Discrete(A, B, dA, dB), Q, dQ

    def _gains(self, seen: np.ndarray) -> _Gains:
        """The filter's covariance recursion with derivatives; it does not depend on what was measured, only when."""
        (A, _, dA, _), Q, dQ = self._system
        at, klass, R = self.zone.measured, self.calendar.klass, self.zone.gain.noise_std**2
        dR = np.zeros(len(dA))
        dR[len(self.free) + len(NUISANCE) - 1] = 2.0 * R
        P, dP = first_covariance(self.zone.network, float(self.zone.gain.sigma[klass[0]])), np.zeros_like(dA)
        N, n, q = len(klass), len(A), len(dA)
        out = _Gains(np.zeros((N, n)), np.empty(N), np.zeros((N, q, n)), np.empty((N, q)))
        for k in range(N):
            S, dS = P[at, at] + R, dP[:, at, at] + dR
            out.S[k], out.dS[k] = S, dS
            if seen[k]:
                gain = P[at] / S
                dgain = (dP[:, at] - dS[:, None] * gain) / S
                out.K[k], out.dK[k] = A @ gain, dA @ gain + dgain @ A.T
                cross = dgain[:, :, None] * gain
                dP = dP - S * (cross + cross.transpose(0, 2, 1)) - dS[:, None, None] * np.outer(gain, gain)
                P = P - S * np.outer(gain, gain)
            turned = dA @ P @ A.T
            dP = turned + turned.transpose(0, 2, 1) + A @ dP @ A.T + dQ[:, klass[k]]
            P = A @ P @ A.T + Q[klass[k]]
        return out

    def scores(self, y: np.ndarray, inputs: np.ndarray, first: np.ndarray | None = None) -> Scores:
        """Derivatives of the innovations and of their variances, of M logs that miss the same rows.

        Parameters
        ----------
        y : ndarray of shape (N, M)
            Measured temperature [degC], NaN where missing.
        inputs : ndarray of shape (N, M, m)
            In the order of the network, the mean gain [kW] last.
        first : ndarray of shape (M,), optional
            Mean of every node's temperature at the first row [degC]; the first measurement by default.

        Returns
        -------
        Scores
        """
        A, B, dA, dB = self._system[0]
        n, q, at = len(A), len(dA), self.zone.measured
        seen = np.isfinite(y[:, 0])
        gains = self._gains(seen)
        by_state = dA.transpose(2, 0, 1).reshape(n, q * n)  # for one product a row instead of one a parameter
        by_input = dB.transpose(2, 0, 1).reshape(-1, q * n)
        M = y.shape[1]
        s = np.zeros((M, n))
        s[:, :-1] = (y[seen][0] if first is None else first)[:, None]
        ds, de = np.zeros((M, q, n)), np.zeros((len(y), M, q))
        for k, (measured, v) in enumerate(zip(y, inputs, strict=True)):
            e = measured - s[:, at] if seen[k] else np.zeros(M)
            if seen[k]:
                de[k] = -ds[:, :, at]
            pushed = (s @ by_state + v @ by_input).reshape(M, q, n)
            pushed[:, -2 * _HOURS :] += np.outer(self._profile_root[self.calendar.cell[k]], B[:, -1])
            ds = ds @ A.T + pushed + e[:, None, None] * gains.dK[k] + de[k][:, :, None] * gains.K[k]
            s = s @ A.T + v @ B.T + np.outer(e, gains.K[k])
        return Scores(de, gains.dS, gains.S)

    def of_logs(self, y: np.ndarray, inputs: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
        """Information (M, q, q) of every log, the profile's prior included; arguments as in :meth:`scores`."""
        scores, seen = self.scores(y, inputs, first), np.isfinite(y[:, 0])
        by_mean = (scores.de[seen] / np.sqrt(scores.S[seen])[:, None, None]).transpose(1, 0, 2)
        by_spread = scores.dS[seen] / scores.S[seen][:, None]
        out = by_mean.transpose(0, 2, 1) @ by_mean + 0.5 * by_spread.T @ by_spread
        profile = np.arange(out.shape[1] - 2 * _HOURS, out.shape[1])
        out[:, profile, profile] += 1.0  # standard normal numbers
        return out


def relative_errors(information: np.ndarray, n_free: int, flat: float = 1e-9) -> np.ndarray:
    """Standard errors of the first ``n_free`` unknowns; infinite where the rows do not move them.

    Parameters
    ----------
    information : ndarray of shape (q, q)
    n_free : int
    flat : float
        An eigenvalue of the information, scaled to a unit diagonal, below this says nothing.

    Returns
    -------
    ndarray of shape (n_free,)
    """
    scale = np.sqrt(np.diag(information))
    moved = scale > 1e-12 * scale.max(initial=0.0)
    scaled = information[np.ix_(moved, moved)] / np.outer(scale[moved], scale[moved])
    values, vectors = np.linalg.eigh(scaled)
    weak = values < flat
    lost = (vectors[:, weak] ** 2).sum(axis=1) > 1e-6
    variance = (vectors[:, ~weak] ** 2 / values[~weak]).sum(axis=1)
    variance[lost] = np.inf
    errors = np.full(len(information), np.inf)
    errors[moved] = np.sqrt(variance) / scale[moved]
    return errors[:n_free]


def stack_inputs(zone: Zone, weather: Mapping[str, np.ndarray], n_rows: int) -> np.ndarray:
    """(N, m) inputs in the order of the network, 0 for those that the weather lacks."""
    out = np.zeros((n_rows, len(zone.network.inputs(zone.roles))))
    for role, series in weather.items():
        out[:, zone.column(role)] = series
    return out


def mean_over(values: np.ndarray, rows: int) -> np.ndarray:
    """Means over every ``rows`` consecutive rows."""
    return values.reshape(-1, rows, *values.shape[1:]).mean(axis=1)
