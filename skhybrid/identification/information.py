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

from .._kernels import Discrete, kalman_gains, one_step_sensitivities
from ..thermal import RCNetwork
from .disturbance import first_covariance
from .periodic import CLASSES, LEVEL_SD, cyclic_walk_root

#: parameters of the gain and of the thermometer that an identification has to find beside the network's
NUISANCE = ("tau", *(f"sigma_{c}" for c in CLASSES), "sigma_y")
_HOURS = 24
#: from the heat of 6 kW plants, for which the widths were chosen
_PLANT = 6.0


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
    profile_step : float
        How much the unknown profile changes from hour to hour, one standard deviation [kW].
    noise_std : float
        Standard deviation of the thermometer [K].
    """

    tau: float = 2.0
    weekday_day: float = 0.4
    weekday_night: float = 0.05
    weekend: float = 0.05
    profile: np.ndarray = field(default_factory=_office_profile)
    profile_step: float = 0.3
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
    cell: np.ndarray  # (N,) int, cell of the weekly profile

    def every(self, rows: int) -> Calendar:
        """The calendar of every ``rows``-th row."""
        return Calendar(self.klass[::rows].copy(), self.cell[::rows].copy())


@dataclass(frozen=True)
class Zone:
    """The prior model of a zone: network, parameters, expected gain."""

    network: RCNetwork
    theta: Mapping[str, float]
    roles: tuple[str, ...]
    gain: GainStatistics

    @property
    def measured(self) -> int:
        return self.network.nodes.index(self.network.measured)

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
        walk = self.zone.gain.profile_step * cyclic_walk_root()
        one = np.column_stack([np.full(_HOURS, LEVEL_SD * plant / _PLANT), walk])
        return np.kron(np.eye(2), one)

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

    def scores(
        self, y: np.ndarray, inputs: np.ndarray, first: float | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of the innovations and of their variances, and the variances.

        Parameters
        ----------
        y : ndarray of shape (N,)
            Measured temperature [degC], NaN where missing.
        inputs : ndarray of shape (N, m)
            In the order of the network, the mean gain [kW] last.
        first : float, optional
            Mean of every node's temperature at the first row [degC]; the first measurement by default.

        Returns
        -------
        de, dS, S : ndarray of shape (N, q), (N, q) and (N,)
        """
        (A, B, dA, dB), Q, dQ = self._system
        n, total, p = len(A) - 1, len(dA), len(self.free)
        c, R = np.eye(n + 1)[self.zone.measured], self.zone.gain.noise_std**2
        dR = np.zeros(total)
        dR[p + len(NUISANCE) - 1] = 2.0 * R
        klass, seen = self.calendar.klass, np.isfinite(y)
        P0 = first_covariance(n, self.zone.measured, float(self.zone.gain.sigma[klass[0]]))
        g = kalman_gains(A, Q, klass, c, R, P0, seen, dA, dQ, dR)
        dforcing = np.einsum("kj,qij->qki", inputs, dB)
        cells = np.zeros((len(y), 2 * _HOURS))
        cells[np.arange(len(y)), self.calendar.cell] = 1.0
        dforcing[-2 * _HOURS :] = np.einsum("kc,cz,i->zki", cells, self._profile_root, B[:, -1])
        s0 = np.append(np.full(n, float(y[seen][0]) if first is None else first), 0.0)
        de = one_step_sensitivities(A, inputs @ B.T, g.K, c, y, s0, dA, dforcing, g.dK, np.zeros((total, n + 1)))
        return de.derrors, g.dS.T, g.S

    def of_rows(self, y: np.ndarray, inputs: np.ndarray, first: float | None = None) -> np.ndarray:
        """Information (q, q), the profile's prior included; arguments as in :meth:`scores`."""
        de, dS, S = self.scores(y, inputs, first)
        seen = np.isfinite(y)
        by_mean, by_spread = de[seen] / np.sqrt(S[seen])[:, None], dS[seen] / S[seen][:, None]
        out = by_mean.T @ by_mean + 0.5 * by_spread.T @ by_spread
        profile = np.arange(len(out) - 2 * _HOURS, len(out))
        out[profile, profile] += 1.0  # standard normal numbers
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
