"""A planned zone: its prior model, the calendar of its log, and a simulation under a thermostat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..._arguments import is_number
from ..._calendar import profile_cell
from ..._table import as_numbers
from ...filtering import Discrete
from ...thermal import RCNetwork
from ...thermal.declaration import parts_of_role
from ..gain_model import HOUR_CLASSES

CLASSES = HOUR_CLASSES["day_night"]  # classes of hours that have a variance of their own, by cell of the weekly profile
STAGES = ("u_heat", "u_cool")  # of the thermostat
_HOURS = 24


def _office_profile() -> np.ndarray:
    """Mean gain of the synthetic office by hour [kW], (24, 2)."""
    profile = np.full((_HOURS, 2), 0.1)
    profile[8, 0], profile[9:17, 0], profile[17, 0] = 1.35, 2.05, 1.05
    return profile


@dataclass(frozen=True)
class GainStatistics:
    """Expected statistics of the unmeasured heat: a weekly profile, and random variation around it.

    The defaults are those of the synthetic office, rounded (``python benchmarks/experiment_design.py --statistics``).

    Attributes
    ----------
    tau : float
        Time constant of the variation [h].
    weekday_day, weekday_night, weekend : float
        Standard deviation around the profile on weekdays from 6 to 21 h and otherwise, and on weekends [kW].
    profile : ndarray of shape (24, 2)
        Mean gain by hour on weekdays and on weekends [kW].
    profile_step, weekend_step : float
        Standard deviation of the profile's change from hour to hour on weekdays and on weekends [kW].
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
        for name, value in vars(self).items():
            if name != "profile" and not (is_number(value) and value > 0):
                raise ValueError(f"GainStatistics: {name}={value!r} must be a positive number.")
        profile = as_numbers(self.profile, "profile of GainStatistics")
        if profile.shape != (_HOURS, 2) or not np.isfinite(profile).all():
            raise ValueError(
                f"GainStatistics: profile has shape {profile.shape}; give (24, 2) finite numbers [kW], by hour on "
                "weekdays and on weekends."
            )
        object.__setattr__(self, "profile", profile)

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviation of every class of hours [kW], shape (3,)."""
        return np.array([self.weekday_day, self.weekday_night, self.weekend])


class Calendar(NamedTuple):
    """Class of variance and cell of the weekly profile of every row."""

    klass: np.ndarray  # (N,) int, class of the gain's variance
    cell: np.ndarray  # (N,) int, cell of the weekly profile: the hour on weekdays, 24 + the hour on weekends

    @classmethod
    def of(cls, hour: np.ndarray, weekend: np.ndarray) -> Calendar:
        """The calendar of rows with these local hours (int) and day types (bool)."""
        cell = profile_cell(hour, weekend)
        return cls(CLASSES.of_cell[cell], cell)


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


def planned_stages(network: RCNetwork, theta: Mapping[str, float]) -> list[str]:
    """Stages of a network that have a capacity in ``theta``; refused where none has."""
    heated = [role for role in STAGES if parts_of_role(network.heated, "heated", role)]
    capacities = {role: [str(source.parameter) for source in network.sources([role])] for role in heated}
    stages = [role for role, names in capacities.items() if any(name in theta for name in names)]
    if not stages:
        wanted = ", ".join(name for names in capacities.values() for name in names)
        raise ValueError(
            f"theta has no capacity of u_heat or u_cool ({wanted or f'network {network.name} reads neither'}) [kW]: "
            "without heating or cooling no set-point can be held; add it to theta, also where the heat was measured."
        )
    return stages


def planned_roles(network: RCNetwork, theta: Mapping[str, float], fitted: Any, weather: Any) -> tuple[str, ...]:
    """Roles of the log: boundaries, the sun (as in the training of a ``fitted`` network, else the weather), stages."""
    here = getattr(weather, "columns", ()) if fitted is None else fitted.roles
    sun = [str(column) for column in here if str(column).startswith("q_sol")]
    if not sun and fitted is None and network.solar:
        sun = ["q_sol"]
    return (*network.boundaries, *(sun if network.solar else ()), *planned_stages(network, theta))


class Run(NamedTuple):
    """A simulated log of M cases side by side, at the simulation's step."""

    stages: np.ndarray  # (N, 2, M) heating and cooling [-]
    room: np.ndarray  # (N, M) true temperature of the measured node at the row's stamp [degC]


def draw_gain(zone: Zone, calendar: Calendar, hours: float, rng: np.random.Generator) -> np.ndarray:
    """One gain [kW], (N,): the profile and an Ornstein-Uhlenbeck walk around it."""
    phi = float(np.exp(-hours / zone.gain.tau))
    sd = zone.gain.sigma[calendar.klass]
    pushes = sd * np.sqrt(1.0 - phi**2) * rng.standard_normal(len(sd))
    first = sd[0] * rng.standard_normal()
    return lfilter([1.0], [1.0, -phi], np.append(first, pushes[:-1])) + zone.gain.profile.T.ravel()[calendar.cell]


def run_thermostat(
    zone: Zone, inputs: np.ndarray, gains: np.ndarray, setpoints: np.ndarray, hours: float, hysteresis: float | None
) -> Run:
    """Simulate M cases under a thermostat: ``inputs`` (N, m), ``gains`` (N, M) [kW], ``setpoints`` (N, 2, M) [degC].

    An on/off plant switches at ``hysteresis`` [K] beyond the set-point; None: it modulates.  Input stages are unread.
    """
    d = zone.discrete(hours)
    stages = [(j, zone.column(r) if r in zone.roles else None) for j, r in enumerate(STAGES)]
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
