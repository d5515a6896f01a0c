"""Simulation of a house of several rooms: a known network of rooms and partitions, a thermostat and people in each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils import Bunch

from .._arguments import check_integer
from .._clock import hour_of_day
from ..thermal import RCNetwork, building_network
from ._gains import draw_gains
from ._office import HYSTERESIS, SIMULATION_STEP, check_arguments
from ._random import spawn_generators
from ._thermostat_plan import first_weekend, make_prbs
from ._weather import first_midnight, make_weather

_ROOMS = ("living", "kitchen", "bedroom", "study", "bath", "hall", "guest", "attic")
#: a usual room: C [kWh/K], R [K/kW], f [-], A_win [m2], Q [kW]
_ROOM = {"C_w": 2.5, "C_za": 0.5, "R_zw": 1.5, "R_zo": 14.0, "f": 0.3, "A_win": 2.5, "Q_h": 2.5}
#: hour at which the sun is on the windows of a room, by turns, and its width [h]; at noon and 12 h: all day
_WINDOWS = ((12.0, 5.0), (8.5, 3.0), (15.5, 3.0), (12.0, 12.0))
_GAIN_SHARE = 0.35  # of the people and plugs of the whole home, in each room

_DESCR = """A house of {n} rooms whose true parameters are known: {names}.

X: T_oa [degC], q_sol_<zone> [kW/m2], u_heat_<zone> [-] are means over [t, t + step); T_za_<zone> [degC] is the value at
t, with measurement noise of {noise_std} K, and equals y.  heat is the heat of the heaters [kW], heat_gain the mean
unmeasured heat into each room over the step (the truth, never an input); states are noise-free; theta are the
parameters of network, whose partitions are in adjacency.
"""


def make_house(
    n_days: int = 28,
    zones: int = 4,
    climate: str = "chicago",
    *,
    start: Any = "2023-11-04",
    partition: float = 6.0,
    pattern: str = "home",
    excitation: str | None = "weekend_prbs",
    noise_std: float = 0.03,
    sampling_time: Any = "15min",
    random_state: Any = None,
) -> Bunch:
    """Simulate a house of several rooms at 5 min (exact zero-order hold); return its log together with the truth.

    Rooms are 2R2C networks that stand in two rows, each with partitions to those beside and across.  Every room has its
    own windows, people, heater, hours and set-points.

    Parameters
    ----------
    n_days : int
        Length [days].
    zones : int
        Rooms, 2 to 8.
    climate : {"oakland", "chicago"}
        Climate of the embedded weather generator.
    start : timestamp-like
        First day; the run begins at 00:00 local standard time.
    partition : float
        Usual resistance of a partition [K/kW]; each differs by about a fifth.
    pattern : {"home", "office", "shop", "none"}
        Use of each room, as in :func:`make_office`, with a third of its people and plugs.
    excitation : {"weekend_prbs", "none"} or None
        Whether the set-point of every room follows a pseudo-random sequence of its own in the first weekend.
    noise_std : float
        Standard deviation of the measurement noise [K].
    sampling_time : timedelta-like
        Step of the log: a multiple of 5 min that divides a day.
    random_state : int, RandomState, Generator or None
        Seed of the parameters, the weather, the gains, the set-points and the noise.

    Returns
    -------
    Bunch
        ``X`` DataFrame [T_oa, q_sol_<zone>, u_heat_<zone>, T_za_<zone>]; ``y`` DataFrame [T_za_<zone>] [degC];
        ``heat`` DataFrame [Q_hvac_<zone>] [kW], which may replace the stages; ``heat_gain`` DataFrame by zone [kW];
        ``states`` DataFrame, noise-free; ``theta`` dict; ``network`` RCNetwork; ``adjacency`` list of pairs;
        ``setpoints`` DataFrame [T_heat_set_<zone>]; ``DESCR``.

    Raises
    ------
    ValueError
        If an argument is out of its range, or ``start`` has a time zone.

    Notes
    -----
    Ventilation and infiltration are conductances to outdoor air in parallel with ``R_zo_<zone>`` and part of
    ``heat_gain``; an identification without it finds a smaller ``R_zo``, ``theta_effective``, with their mean included.

    Examples
    --------
    >>> from skhybrid.datasets import make_house
    >>> house = make_house(n_days=2, zones=2, random_state=0)
    >>> list(house.X.columns)[:4]
    ['T_oa', 'q_sol_living', 'q_sol_kitchen', 'u_heat_living']
    >>> house.adjacency
    [('living', 'kitchen')]
    """
    check_integer("zones", zones, 2, len(_ROOMS))
    per_step = check_arguments(n_days, pattern, excitation, noise_std, sampling_time)
    names = _ROOMS[:zones]
    theta_rng, weather_rng, noise_rng, *room_rngs = spawn_generators(random_state, 3 + 3 * zones)
    time = pd.date_range(first_midnight(start), periods=n_days * 288, freq=SIMULATION_STEP)
    outside = make_weather(n_days, climate, start=time[0], step=SIMULATION_STEP, random_state=weather_rng)
    adjacency = _floor_plan(names)
    network = building_network(names, adjacency, name="house")
    theta = _draw_theta(network, partition, theta_rng)
    plans = {zone: _plan(time, k, excitation, *room_rngs[3 * k : 3 * k + 2]) for k, zone in enumerate(names)}
    gains = [draw_gains(time, rng, pattern) for rng in room_rngs[2::3]]
    sensible = _GAIN_SHARE * np.column_stack([g.sensible for g in gains])
    air = _GAIN_SHARE * np.column_stack([g.air for g in gains])
    X = _inputs(outside, names)
    states, stages, heat_gain = _simulate(network, theta, X, np.column_stack(list(plans.values())), sensible, air)
    X = X.assign(**{f"u_heat_{zone}": stages[:, k] for k, zone in enumerate(names)})
    index = pd.DatetimeIndex(time.to_numpy()[::per_step])

    def means(frame: pd.DataFrame) -> pd.DataFrame:
        values = frame.to_numpy().reshape(len(index), per_step, -1).mean(axis=1)
        return pd.DataFrame(values, index=index, columns=frame.columns)

    X = means(X)
    at_stamps = pd.DataFrame(states[::per_step], index=index, columns=list(network.states))
    y = at_stamps[list(network.history_roles)] + noise_std * noise_rng.standard_normal((len(index), zones))
    mean_air = dict(zip(names, air.mean(axis=0), strict=True))
    effective = {f"R_zo_{zone}": 1.0 / (1.0 / theta[f"R_zo_{zone}"] + mean_air[zone]) for zone in names}
    return Bunch(
        X=X.assign(**y),
        y=y,
        heat=pd.DataFrame({f"Q_hvac_{z}": theta[f"Q_h_{z}"] * X[f"u_heat_{z}"] for z in names}),
        heat_gain=means(pd.DataFrame(heat_gain, columns=list(names))),
        states=at_stamps,
        theta=theta,
        theta_effective=theta | effective,
        network=network,
        adjacency=adjacency,
        setpoints=means(pd.DataFrame(plans).add_prefix("T_heat_set_")),
        DESCR=_DESCR.format(n=zones, names=", ".join(names), noise_std=noise_std),
    )


def _floor_plan(names: tuple[str, ...]) -> list[tuple[str, str]]:
    """Pairs of rooms that stand in two rows: those beside each other and those across."""
    places = [divmod(k, 2) for k in range(len(names))]
    return [
        (names[i], names[j])
        for i, (row, column) in enumerate(places)
        for j, (other_row, other_column) in enumerate(places)
        if i < j and abs(row - other_row) + abs(column - other_column) == 1
    ]


def _draw_theta(network: RCNetwork, partition: float, rng: np.random.Generator) -> dict[str, float]:
    """Parameters of a usual room, a fifth larger or smaller."""
    if not (np.isfinite(partition) and partition > 0):
        raise ValueError(f"partition={partition!r} must be a positive resistance [K/kW].")
    names = [p.name for p in network.parameters() if not p.name.startswith("Q_c")]
    usual = {p: next((v for name, v in _ROOM.items() if p.startswith(f"{name}_")), partition) for p in names}
    return {p: float(v * np.exp(0.2 * rng.standard_normal())) for p, v in usual.items()}


def _plan(
    time: pd.DatetimeIndex, k: int, excitation: str | None, rng: np.random.Generator, prbs_rng: np.random.Generator
) -> np.ndarray:
    """(n,) set-point of room k [degC]: hours, level and set-back of its own, a little different every day."""
    hour = hour_of_day(time)
    day = np.asarray((time - time[0]).days)
    n = int(day[-1]) + 1
    begin, length = 6.0 + 1.5 * k + rng.normal(0.0, 0.7, n), rng.uniform(7.0, 14.0, n)
    level, setback = 20.0 + rng.uniform(0.0, 2.5) + rng.normal(0.0, 0.4, n), rng.uniform(16.0, 18.0, n)
    plan = np.where((hour >= begin[day]) & (hour < (begin + length)[day]), level[day], setback[day])
    if excitation == "weekend_prbs":
        rows = first_weekend(time)
        bits = make_prbs(order=5, duration="2D", step=SIMULATION_STEP, low=17.0, high=23.0, random_state=prbs_rng)
        plan[rows] = bits[: rows.sum()]
    return plan


def _inputs(outside: pd.DataFrame, names: tuple[str, ...]) -> pd.DataFrame:
    """Outdoor temperature, and the sun on the windows of every room."""
    time = pd.DatetimeIndex(outside.index)
    hour = hour_of_day(time)
    X = outside[["T_oa"]].copy()
    for k, zone in enumerate(names):
        middle, width = _WINDOWS[k % len(_WINDOWS)]
        X[f"q_sol_{zone}"] = outside["q_sol"] * np.exp(-0.5 * ((hour - middle) / width) ** 2)
    return X


def _simulate(
    network: RCNetwork,
    theta: dict[str, float],
    X: pd.DataFrame,
    setpoints: np.ndarray,
    sensible: np.ndarray,
    air: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (n, 2 z) at every step, and stages and gains (n, z) over it, under a thermostat in every room."""
    z, stages = setpoints.shape[1], [f"u_heat_{zone}" for zone in network.zones]
    d = network.discrete(theta, [*X.columns, *stages], SIMULATION_STEP / pd.Timedelta("1h"))
    acting = network.inputs([*X.columns, *stages])
    rooms = [network.nodes.index(node) for node in network.measured_nodes]
    forcing = X[list(acting[:-z])].to_numpy() @ d.B[:, : len(acting) - z].T
    heater, people = d.B[:, [acting.index(stage) for stage in stages]], d.B[:, len(acting) :]
    T_oa = X["T_oa"].to_numpy()
    states, on, gain = np.empty((len(X), len(d.A))), np.zeros((len(X), z)), np.empty((len(X), z))
    state, heating = np.full(len(d.A), 19.0), np.zeros(z, dtype=bool)
    for k in range(len(X)):
        states[k], T = state, state[rooms]
        heating = setpoints[k] + np.where(heating, HYSTERESIS, -HYSTERESIS) > T
        on[k], gain[k] = heating, sensible[k] + air[k] * (T_oa[k] - T)
        state = d.A @ state + forcing[k] + heater @ on[k] + people @ gain[k]
    return states, on, gain
