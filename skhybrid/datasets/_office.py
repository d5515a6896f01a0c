"""Simulation of the paper's office: a known 2R2C network with an on/off thermostat and unmeasured gains (2.1)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numba import njit
from scipy.signal import cont2discrete
from sklearn.utils import Bunch

from .._arguments import check_integer
from .._holidays import read_holidays
from .._time import rows_of
from ._epw import resample_weather
from ._gains import INFILTRATION_KW_K, PATTERNS, Gains, draw_gains
from ._random import spawn_generators
from ._thermostat_plan import plan_setpoints
from ._weather import first_midnight, make_weather

#: the TRUE parameters (paper 2.1): C [kWh/K], R [K/kW], f [-], A_win [m2], Q [kW].
TRUE_THETA = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}
#: simulation step, which is also the shortest time that heating or cooling stays on or off (paper 2.1).
SIMULATION_STEP = pd.Timedelta("5min")
HYSTERESIS = 0.3  # distance from the set-point, on either side, at which the thermostat switches [K]

_DESCR = """The office of Ham & Kim, section 2.1: a synthetic thermostat log whose true parameters are known.

{n_days} days from {start}, unmeasured gains: {pattern}, weather: {weather}, set-point perturbation: {excitation},
step {step}.
X: T_oa [degC], q_sol [kW/m2], u_heat, u_cool [-] are means over [t, t + step); T_za [degC] is the value at t, with
measurement noise of {noise_std} K, and equals y.  heat_gain [kW] is the mean unmeasured heat into the zone over the
step (the truth, never an input); states are the noise-free T_w and T_za at t; theta are the true parameters;
theta_effective are the same with the mean infiltration included in R_zo, since measurements cannot separate the two.
"""


def make_office(
    n_days: int = 14,
    climate: str = "oakland",
    *,
    start: Any = "2023-07-08",
    pattern: str = "office",
    excitation: str | None = "weekend_prbs",
    noise_std: float = 0.03,
    sampling_time: Any = "15min",
    weather: pd.DataFrame | None = None,
    holidays: Any = None,
    random_state: Any = None,
) -> Bunch:
    """Simulate the paper's office at 5 min (exact zero-order hold); return its thermostat log together with the truth.

    See paper section 2.1, Eqs. 1 and 2.

    Parameters
    ----------
    n_days : int
        Length [days].
    climate : {"oakland", "chicago"}
        Climate of the embedded weather generator.
    start : timestamp-like
        First day, in any year; the run begins at 00:00 local standard time.
    pattern : {"office", "home", "shop", "none"}
        Use of the room: ten desks, five days a week; a family of three; a shop, open six days a week; or no
        unmeasured heat at all.  The set-points are those of the office in every case.
    excitation : {"weekend_prbs", "none"} or None
        Whether the set-point of the first weekend follows a PRBS of order 4 and scale 2 h between 18 and 25 degC,
        with both heating and cooling.
    noise_std : float
        Standard deviation of the measurement noise [K].
    sampling_time : timedelta-like
        Step of the log: a multiple of 5 min that divides a day.
    weather : DataFrame, optional
        ``T_oa`` [degC] and ``q_sol`` [kW/m2] that cover the run, such as a table from :func:`read_epw`; replaces the
        generator.
    holidays : str or sequence of dates, optional
        A country, a state or dates, as for :class:`~skhybrid.hybrid.HybridPredictor`: days that are like Sundays.
    random_state : int, RandomState, Generator or None
        Seed of weather, gains, set-points and noise, each of which has its own stream.

    Returns
    -------
    Bunch
        ``X`` DataFrame [T_oa, q_sol, u_heat, u_cool, T_za]; ``y`` Series T_za [degC], with noise; ``heat_gain``
        Series [kW]; ``states`` DataFrame [T_w, T_za], noise-free at the stamps; ``theta`` dict; ``theta_effective``
        dict, see Notes; ``setpoints`` DataFrame [T_heat_set, T_cool_set]; ``gain_parts`` DataFrame [people, plugs,
        lights, air] [kW], whose sum is ``heat_gain``; ``DESCR``.  The index has no time zone.

    Raises
    ------
    ValueError
        If an argument is out of its range, ``start`` has a time zone, or ``weather`` does not cover the run.

    Notes
    -----
    With ``sampling_time="5min"`` every input is constant over a step, so ``X`` and ``heat_gain`` reproduce ``states``.

    Infiltration is a conductance of 0.008 kW/K on average in parallel with ``R_zo``, and measurements cannot separate
    the two.  ``theta_effective`` has ``R_zo = 1 / (1 / 9 + 0.008)`` K/kW (-6.7 %), the value that an exact
    identification without ``heat_gain`` finds.  With ``pattern="none"`` there is no infiltration.

    Examples
    --------
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=2, random_state=0)
    >>> list(office.X.columns)
    ['T_oa', 'q_sol', 'u_heat', 'u_cool', 'T_za']
    """
    per_step = check_arguments(n_days, pattern, excitation, noise_std, sampling_time)
    weather_rng, gain_rng, plan_rng, prbs_rng, noise_rng = spawn_generators(random_state, 5)
    first = first_midnight(start)
    time = pd.date_range(first, periods=n_days * 288, freq=SIMULATION_STEP)
    if weather is None:
        outside = make_weather(n_days, climate, start=first, step=SIMULATION_STEP, random_state=weather_rng)
    else:
        outside = resample_weather(weather, time)
    away = read_holidays(holidays, time)
    setpoints = plan_setpoints(time, away, excitation, plan_rng, prbs_rng)
    run = _simulate_office(outside, setpoints, draw_gains(time, gain_rng, pattern, away))
    arguments = {"n_days": n_days, "pattern": pattern, "excitation": excitation, "noise_std": noise_std}
    origin = "as given" if weather is not None else climate
    description = _DESCR.format(**arguments, start=first.date(), weather=origin, step=sampling_time)
    noise = noise_std * noise_rng.standard_normal(len(time) // per_step)
    infiltration = 0.0 if pattern == "none" else INFILTRATION_KW_K
    theta_effective = TRUE_THETA | {"R_zo": 1.0 / (1.0 / TRUE_THETA["R_zo"] + infiltration)}
    return _make_log(run, setpoints, per_step, noise, theta_effective, description)


def check_arguments(n_days: int, pattern: str, excitation: str | None, noise_std: float, sampling_time: Any) -> int:
    """Refuse arguments that are out of range; return the number of simulation steps per step of the log."""
    check_integer("n_days", n_days)
    if pattern not in PATTERNS:
        raise ValueError(f"pattern={pattern!r} is unknown; choose one of {', '.join(map(repr, PATTERNS))}.")
    if excitation not in ("weekend_prbs", "none", None):
        raise ValueError(f"excitation={excitation!r} is unknown; choose 'weekend_prbs' or None.")
    if not (np.isfinite(noise_std) and noise_std >= 0):
        raise ValueError(f"noise_std={noise_std!r} must be zero or a positive number of kelvin.")
    per_step = rows_of(sampling_time, SIMULATION_STEP, "sampling_time")
    if 288 % per_step:
        raise ValueError(f"sampling_time={sampling_time!r} does not divide a day.")
    return per_step


def _simulate_office(
    outside: pd.DataFrame, setpoints: pd.DataFrame, gains: Gains, replay: np.ndarray | None = None
) -> pd.DataFrame:
    """Simulate the office at the simulation step; one row per step.

    ``replay`` (n, 2) are stages of heating and cooling; where they are NaN, as everywhere by default, the thermostat
    acts.
    """
    transition, effect = true_system(SIMULATION_STEP / pd.Timedelta("1h"))
    air = outside["T_oa"].to_numpy()
    levels = setpoints[["T_heat_set", "T_cool_set"]].to_numpy()
    begin = np.full(2, np.clip(air[:288].mean() + 4.0, levels[0, 0] + 1.0, levels[0, 1] - 1.0))
    weather = outside[["T_oa", "q_sol"]].to_numpy()
    replay = np.full(levels.shape, np.nan) if replay is None else replay
    states, heat, cool, gain = _simulate(
        transition, effect, weather, levels, gains.sensible, gains.air, begin, HYSTERESIS, replay
    )
    run = outside[["T_oa", "q_sol"]].assign(
        u_heat=heat, u_cool=cool, heat_gain=gain, T_w=states[:, 0], T_za=states[:, 1]
    )
    return run.assign(people=gains.people, plugs=gains.plugs, lights=gains.lights, air=gain - gains.sensible)


def true_system(step_hours: float) -> tuple[np.ndarray, np.ndarray]:
    """Exact discrete (A, B) of the TRUE model: states T_w, T_za; inputs T_oa, q_sol, u_heat, u_cool, heat gain."""
    p = TRUE_THETA
    to_wall, to_air = p["C_w"] * p["R_zw"], p["C_za"] * p["R_zw"]
    a = np.array([[-1 / to_wall, 1 / to_wall], [1 / to_air, -1 / to_air - 1 / (p["C_za"] * p["R_zo"])]])
    b = np.array(
        [
            [0.0, (1 - p["f"]) * p["A_win"] / p["C_w"], 0.0, 0.0, 0.0],
            np.array([1 / p["R_zo"], p["f"] * p["A_win"], p["Q_h"], p["Q_c"], 1.0]) / p["C_za"],
        ]
    )
    discrete = cont2discrete((a, b, np.eye(2), np.zeros((2, 5))), step_hours, method="zoh")
    return np.ascontiguousarray(discrete[0]), np.ascontiguousarray(discrete[1])


@njit(cache=True)
def _simulate(transition, effect, outside, setpoints, sensible, air, begin, hysteresis, replay):
    """States (n, 2) at the start of every step, and on/off signals and gain [kW] over it."""
    n = len(sensible)
    states, heat, cool, gain = np.empty((n, 2)), np.zeros(n), np.zeros(n), np.empty(n)
    wall, room = begin[0], begin[1]
    heating, cooling = False, False
    v = np.empty(5)
    for k in range(n):
        states[k, 0], states[k, 1] = wall, room
        heating = room < setpoints[k, 0] + (hysteresis if heating else -hysteresis)
        cooling = (not heating) and room > setpoints[k, 1] + (-hysteresis if cooling else hysteresis)
        heat[k] = 1.0 if heating else 0.0
        cool[k] = 1.0 if cooling else 0.0
        if not np.isnan(replay[k, 0]):
            heat[k], cool[k] = replay[k, 0], replay[k, 1]
        gain[k] = sensible[k] + air[k] * (outside[k, 0] - room)
        v[0], v[1], v[2], v[3], v[4] = outside[k, 0], outside[k, 1], heat[k], cool[k], gain[k]
        wall_next = transition[0, 0] * wall + transition[0, 1] * room
        room_next = transition[1, 0] * wall + transition[1, 1] * room
        for j in range(5):
            wall_next += effect[0, j] * v[j]
            room_next += effect[1, j] * v[j]
        wall, room = wall_next, room_next
    return states, heat, cool, gain


def _make_log(
    run: pd.DataFrame,
    setpoints: pd.DataFrame,
    per_step: int,
    noise: np.ndarray,
    theta_effective: dict[str, float],
    description: str,
) -> Bunch:
    """Convert the run to the step of the log: means of inputs, and temperatures at the stamps."""
    index = pd.DatetimeIndex(run.index.to_numpy()[::per_step])

    def means(frame: pd.DataFrame) -> pd.DataFrame:
        columns = {name: frame[name].to_numpy().reshape(-1, per_step).mean(axis=1) for name in frame}
        return pd.DataFrame(columns, index=index)

    states = pd.DataFrame({name: run[name].to_numpy()[::per_step] for name in ("T_w", "T_za")}, index=index)
    X = means(run[["T_oa", "q_sol", "u_heat", "u_cool"]])
    X["T_za"] = states["T_za"] + noise
    return Bunch(
        X=X,
        y=X["T_za"].copy(),
        heat_gain=means(run[["heat_gain"]])["heat_gain"],
        states=states,
        theta=dict(TRUE_THETA),
        theta_effective=theta_effective,
        setpoints=means(setpoints),
        gain_parts=means(run[["people", "plugs", "lights", "air"]]),
        DESCR=description,
    )
