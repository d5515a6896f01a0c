"""Experiment plan: hours of perturbed set-points that bring the parameters' errors below a target."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..._arguments import as_mapping, check_integer, draw_seed, is_number
from ..._calendar import clock_hour
from ..._holidays import NO_HOLIDAYS
from ..._ranges import check_range
from ..._table import SETPOINT_ROLES, as_numbers, float_columns
from ..._threads import one_blas_thread
from ..._time import refuse_other_stamps, rows_of, wall_clock
from ..._warnings import percent
from ...thermal import RCNetwork, get_network
from ..fitting.excitation import scaling_of
from ..gain_model import DAY_TYPES
from ..state_space import checked_theta
from .information import FilterInformation, relative_errors
from .zone import CLASSES, STAGES, Calendar, GainStatistics, Zone, draw_gain, planned_roles, run_thermostat

HALF_BAND = 0.5  # half the distance of heating and cooling set-point around a perturbed temperature [K] (paper 2.1)
_NONE = "none"


@dataclass(frozen=True)
class ExperimentPlan:
    """Expected errors of each candidate experiment, and the one to choose.

    Attributes
    ----------
    table : DataFrame
        Relative standard errors [%] by candidate (index ``perturbation``, ``hours``) and free parameter; ``worst`` (the
        parameter) and ``worst_error`` [%].
    target : float
        Relative standard error that every parameter is to reach [-].
    recommended : tuple of (str, float) or None
        Perturbation and hours: the shortest that reaches the target, if any does.
    best : tuple of (str, float)
        The recommended candidate, or else the one whose worst error is the smallest.
    obstacles : tuple of str
        Parameters that stay above the target under the best candidate, worst first; empty where one suffices.
    """

    table: pd.DataFrame
    target: float
    recommended: tuple[str, float] | None
    best: tuple[str, float]
    obstacles: tuple[str, ...]

    def _verdict(self) -> str:
        goal = f"a relative standard error of {percent(self.target, '.3g')} in every parameter"
        if self.recommended is not None:
            name, hours = self.recommended
            if hours == 0:
                return f"No perturbation is needed for {goal}."
            return f"Recommended: {hours:g} h of {name!r}, the shortest candidate that reaches {goal}."
        name, hours = self.best
        errors = self.table.loc[[self.best]].iloc[0]
        named = ", ".join(f"{p} ({_percent(errors[p])})" for p in self.obstacles)
        return f"No candidate reaches {goal}; the best, {hours:g} h of {name!r}, leaves {named}."

    def __str__(self) -> str:
        shown = self.table.reset_index().to_string(index=False, float_format=lambda v: f"{v:.3g}")
        return f"Experiment plan: relative standard errors [%]\n{shown}\n{self._verdict()}"

    def _repr_html_(self) -> str:
        shown = self.table.to_html(float_format=lambda v: f"{v:.3g}")
        return f"<p><b>Experiment plan: relative standard errors [%]</b></p>{shown}<p>{escape(self._verdict())}</p>"


class _Log(NamedTuple):
    """The clock and the weather of the planned log, at the simulation's step."""

    time: pd.DatetimeIndex  # local
    hours: float  # the simulation's step [h]
    per_row: int  # simulation steps in a row of the log
    calendar: Calendar
    inputs: np.ndarray  # (N, m)


class _Case(NamedTuple):
    """One candidate."""

    name: str
    hours: float
    setpoints: np.ndarray  # (N, 2) heating and cooling set-point [degC]


@one_blas_thread
def plan_experiment(
    network: Any,
    theta: Mapping[str, float] | None = None,
    *,
    weather: pd.DataFrame,
    perturbations: Mapping[str, Any],
    known: Iterable[str] | None = None,
    hours: float | Sequence[float] = (0, 12, 24, 48),
    target: float = 0.1,
    when: Any = "weekend",
    setpoints: Any = (20.0, 25.0),
    gain: GainStatistics | None = None,
    sampling_time: Any = None,
    hysteresis: float | None = 0.3,
    n_draws: int = 4,
    random_state: Any = None,
) -> ExperimentPlan:
    """Find how many hours of which set-point perturbation bring every parameter's error below a target.

    The zone is simulated under a thermostat over all of ``weather`` for every candidate; the information of each log
    follows from exact sensitivities of a Kalman filter that also estimates the unmeasured gain, its statistics and its
    weekly profile, as :class:`PeriodicDisturbanceID` does.

    Parameters
    ----------
    network : str, RCNetwork or fitted identification
        A fitted identification brings its parameters, those it knew, and the statistics of its gain, if any.
    theta : mapping of parameter to value, optional
        Prior guess of the network's parameters; a plant heats where a capacity of ``u_heat``, such as ``Q_h``, is
        given, and cools where one of ``u_cool`` is.
    weather : DataFrame
        ``T_oa`` [degC], ``q_sol`` [kW/m2] and what else the network needs, at the step of the simulation; its rows are
        the log that will be identified, the unperturbed days included.
    perturbations : mapping of name to array-like
        Wanted temperature [degC] of every step, (n,), held within 0.5 K; or heating and cooling set-point, (n, 2), of
        a DataFrame by name.  Repeated where shorter than the hours asked for; :func:`skhybrid.datasets.make_prbs`.
    known : iterable of str, optional
        Parameters that the identification will be given, such as ``["Q_h"]``; one of them must fix the network's scale.
    hours : float or sequence of float
        Hours of perturbation to compare, whole steps of ``weather``; 0, the log without one, is always looked at.
    target : float
        Relative standard error that every parameter is to reach [-].
    when : {"weekend", "any"} or array-like of bool
        Rows of ``weather`` that may be perturbed, the first of them first.
    setpoints : pair of float or DataFrame
        Unperturbed heating and cooling set-point [degC]; or ``T_heat_set`` and ``T_cool_set`` in the rows of weather.
    gain : GainStatistics, optional
        The unmeasured gain; that of the synthetic office by default.
    sampling_time : timedelta-like, optional
        Step of the log, a multiple of the step of ``weather``, which is the default.
    hysteresis : float or None
        How far beyond the set-point an on/off plant switches [K]; None: a plant that modulates.
    n_draws : int
        Draws of gain and noise over which the information is averaged; all candidates see the same.
    random_state : int, RandomState, Generator or None
        Of the draws.

    Returns
    -------
    ExperimentPlan

    Raises
    ------
    ValueError
        If a parameter has no value or is unknown, nothing known fixes the scale, nothing is left to identify, weather
        is uneven, incomplete or impossible, stamps differ, or a perturbation does not fit into the rows it may take.

    Notes
    -----
    The errors are a lower bound, without the bias of too simple a network.  The perturbation of the paper (2.1) is a
    PRBS of order 4 and scale 2 h, 18-25 degC.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid.datasets import make_prbs, make_weather
    >>> from skhybrid.identification import plan_experiment
    >>> theta = {"C_za": 1.0, "R_zo": 5.0, "A_win": 2.0, "Q_h": 6.0}
    >>> weather = make_weather(7, "chicago", start="2023-01-02", step="30min", random_state=0)
    >>> prbs = make_prbs(4, "2h", step="30min", low=18, high=25)
    >>> plan = plan_experiment("1R1C", theta, weather=weather, perturbations={"prbs": prbs}, known=["Q_h"],
    ...                        hours=[24], n_draws=1, random_state=0)
    >>> list(plan.table.columns)
    ['C_za', 'R_zo', 'A_win', 'worst', 'worst_error']
    """
    zone, known = _zone(network, theta, weather, known, gain)
    log = _read_weather(zone, weather, sampling_time)
    usual = _usual_setpoints(setpoints, weather.index, log)
    cases = [_Case(_NONE, 0.0, usual)]
    allowed = _allowed(when, weather.index, log)
    perturbed = [h for h in _checked_hours(hours, log) if h > 0]
    for name, wanted in as_mapping("perturbations", perturbations, "names to temperatures [degC]").items():
        levels = _levels(name, wanted)
        cases += [_Case(name, h, _perturbed(usual, levels, allowed, h, log)) for h in perturbed]
    if not (is_number(target) and 0 < target <= 1):
        raise ValueError(f"target={target!r} must be a relative error above 0 and up to 1, such as 0.1 for 10 %.")
    if hysteresis is not None and not (is_number(hysteresis) and hysteresis >= 0):
        raise ValueError(f"hysteresis={hysteresis!r} must be 0 K or more, or None for a plant that modulates.")
    check_integer("n_draws", n_draws)
    free = tuple(name for name in zone.order if name not in known)
    if not free:
        raise ValueError("known= names every parameter, so nothing is left to identify; leave out what is to be found.")
    own = random_state if isinstance(random_state, np.random.Generator) else draw_seed(random_state)
    errors = _expected_errors(zone, log, cases, free, hysteresis, n_draws, np.random.default_rng(own))
    return _make_plan(cases, free, errors, float(target))


def _zone(
    network: Any, theta: Mapping[str, float] | None, weather: pd.DataFrame, known: Any, gain: GainStatistics | None
) -> tuple[Zone, set[str]]:
    """The prior model, and what will be known of it."""
    if hasattr(network, "theta_"):
        theta = dict(network.theta_) if theta is None else theta
        known = {*(network.known or ())} & {*network.theta_.index} if known is None else known
    if not isinstance(net := getattr(network, "network_", network), str | RCNetwork):  # the gain of a hybrid leads here
        what = f"{type(network).__name__} is neither a network nor a fitted identification"
        raise ValueError(f"{what}; give one, such as a PeriodicDisturbanceID fitted to the log.")
    net = get_network(net)
    if len(net.measured_nodes) > 1 or len(net.disturbed_nodes) > 1:
        raise ValueError(f"network {net.name} has several measured or disturbed nodes; plan for one zone at a time.")
    if theta is None:
        raise ValueError("theta is missing: give a prior guess of every parameter, or a fitted identification.")
    known = {known} if isinstance(known, str) else set(known or ())
    gain = _fitted_gain(network) if gain is None else gain
    if not isinstance(gain, GainStatistics | None):
        raise ValueError(f"gain={gain!r} must be a GainStatistics, or None for that of the synthetic office.")
    roles = planned_roles(net, theta, getattr(network, "filtered_network_", None), weather)
    values = checked_theta(net, theta, roles)
    for what, names in (("theta", theta.keys()), ("known=", known)):
        if strange := sorted(map(str, set(names) - set(values))):
            raise ValueError(f"{what} names {strange[0]!r}, but the parameters are {', '.join(values)}.")
    if not any(scaling_of(p) for p in net.parameters(roles) if p.name in known):
        raise ValueError(
            "known= fixes no capacitance, resistance, area or capacity, so no log tells the scale of the network; name "
            "one that the identification will be given, such as known=['Q_h']."
        )
    return Zone(net, values, roles, GainStatistics() if gain is None else gain), known


def _fitted_gain(model: Any) -> GainStatistics | None:
    """Statistics of the gain that a fitted periodic identification found; None where it has none."""
    own, profile = dict(getattr(model, "disturbance_", {})), getattr(model, "profile_", None)
    found: dict[str, list[float]] = {}
    for name, value in own.items():
        klass = name.removeprefix("sigma_")
        kind, _, hour = klass.partition("_")
        if kind in DAY_TYPES and hour.isdigit():  # of variance="3h"
            klass = CLASSES.names[Calendar.of(np.array([int(hour)]), np.array([kind == "weekend"])).klass[0]]
        if klass in CLASSES.names:
            found.setdefault(klass, []).append(float(value))
    if profile is None or len(found) < len(CLASSES.names):
        return None
    return GainStatistics(
        tau=float(own["tau"]),
        **{name: float(np.sqrt(np.mean(np.square(values)))) for name, values in found.items()},
        profile=profile.to_numpy(),
        profile_step=float(own["sigma_profile_weekday"]),
        weekend_step=float(own["sigma_profile_weekend"]),
        noise_std=float(own["sigma_y"]),
    )


def _read_weather(zone: Zone, weather: pd.DataFrame, sampling_time: Any) -> _Log:
    roles = [role for role in zone.roles if role not in STAGES]
    known = float_columns(weather, roles, "weather")
    index = weather.index
    if not isinstance(index, pd.DatetimeIndex) or len(index) < 2:
        raise ValueError("weather needs a DatetimeIndex of two rows or more: the hour decides about the gain.")
    steps = np.diff(index.to_numpy())
    if (steps != steps[0]).any() or steps[0] <= np.timedelta64(0):
        raise ValueError(f"weather is not evenly spaced (first at {index[1 + int(np.argmax(steps != steps[0]))]}).")
    inputs = np.zeros((len(index), len(zone.network.inputs(zone.roles))))
    for role in roles:
        values = known[role].to_numpy()
        if (bad := ~np.isfinite(values)).any():
            raise ValueError(f"weather column {role!r} has NaN or inf (first at {index[bad][0]}); fill it first.")
        check_range(values, role, f"weather column {role!r}", index)
        inputs[:, zone.column(role)] = values
    step = pd.Timedelta(steps[0])
    per_row = 1 if sampling_time is None else rows_of(sampling_time, step, "sampling_time")
    n_rows = len(index) // per_row * per_row
    time = wall_clock(index[:n_rows])
    calendar = Calendar.of(clock_hour(time), NO_HOLIDAYS.weekend(time))
    return _Log(time, step / pd.Timedelta("1h"), per_row, calendar, inputs[:n_rows])


def _usual_setpoints(setpoints: Any, index: pd.Index, log: _Log) -> np.ndarray:
    if isinstance(setpoints, pd.Series | pd.DataFrame):
        refuse_other_stamps(setpoints, index, "setpoints", "weather")
    if isinstance(setpoints, pd.DataFrame):
        wanted = as_numbers(setpoints.reindex(columns=list(SETPOINT_ROLES)), "setpoints")[: len(log.time)]
    else:
        wanted = np.tile(as_numbers(setpoints, "setpoints").reshape(1, -1), (len(log.time), 1))
    if wanted.shape != (len(log.time), 2) or not np.isfinite(wanted).all() or (wanted[:, 0] > wanted[:, 1]).any():
        raise ValueError(
            "setpoints must be a pair of heating and cooling set-point [degC], the first not above the second, or a "
            "DataFrame of T_heat_set and T_cool_set in the rows of weather."
        )
    check_range(wanted.ravel(), "T_za", "setpoints", log.time.repeat(2))
    return wanted


def _allowed(when: Any, index: pd.Index, log: _Log) -> np.ndarray:
    """Numbers of the rows that may be perturbed."""
    if isinstance(when, str):
        if when not in ("weekend", "any"):
            raise ValueError(f"when={when!r} is unknown; choose 'weekend', 'any', or a bool for every row of weather.")
        return np.flatnonzero(NO_HOLIDAYS.weekend(log.time) | (when == "any"))
    if isinstance(when, pd.Series | pd.DataFrame):
        refuse_other_stamps(when, index, "when", "weather")
    mask = np.asarray(when)
    if mask.dtype != bool or mask.shape != index.shape:
        raise ValueError(f"when has shape {mask.shape} and type {mask.dtype}; give a bool for every row of weather.")
    return np.flatnonzero(mask[: len(log.time)])


def _levels(name: str, wanted: Any) -> np.ndarray:
    """Heating and cooling set-points of a perturbation, (n, 2)."""
    if isinstance(wanted, pd.DataFrame) and set(wanted) == set(SETPOINT_ROLES):
        wanted = wanted[list(SETPOINT_ROLES)]
    levels = as_numbers(wanted, f"perturbation {name!r}")
    if levels.ndim == 1 and len(levels):
        levels = levels[:, None] + np.array([-HALF_BAND, HALF_BAND])
    if levels.ndim != 2 or levels.shape[1] != 2 or not len(levels) or not np.isfinite(levels).all():
        raise ValueError(
            f"perturbation {name!r} has shape {np.shape(wanted)}; give finite temperatures [degC], (n,), or heating "
            "and cooling set-points, (n, 2)."
        )
    check_range(levels.ravel(), "T_za", f"perturbation {name!r}", pd.RangeIndex(len(levels)).repeat(2))
    if (crossed := levels[:, 0] > levels[:, 1]).any():
        raise ValueError(
            f"perturbation {name!r} has the heating set-point above the cooling one in row {int(np.argmax(crossed))}; "
            "swap or mend them."
        )
    return levels


def _checked_hours(hours: Any, log: _Log) -> list[float]:
    hours = [hours] if isinstance(hours, str) or not isinstance(hours, Iterable) else list(hours)
    for h in hours:
        if not is_number(h) or h < 0 or abs(h / log.hours - round(h / log.hours)) > 1e-9:
            raise ValueError(f"hours has {h!r}; give 0 or a multiple of the step of weather, {log.hours:g} h.")
    return [float(h) for h in hours]


def _perturbed(usual: np.ndarray, levels: np.ndarray, allowed: np.ndarray, hours: float, log: _Log) -> np.ndarray:
    n_rows = round(hours / log.hours)
    if n_rows > len(allowed):
        raise ValueError(
            f"hours has {hours:g} h of perturbation, but when= and weather leave {len(allowed) * log.hours:g} h for "
            "it; give a longer weather or other rows."
        )
    rows, out = allowed[:n_rows], usual.copy()
    out[rows] = levels[np.arange(n_rows) % len(levels)]
    return out


def _expected_errors(
    zone: Zone,
    log: _Log,
    cases: Sequence[_Case],
    free: tuple[str, ...],
    hysteresis: float | None,
    n_draws: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """(cases, free) relative standard errors, from the information averaged over draws of gain and noise."""
    setpoints = np.stack([c.setpoints for c in cases], axis=2)
    calendar = Calendar(*(part[:: log.per_row] for part in log.calendar))
    information = FilterInformation(zone, calendar, log.hours * log.per_row, free)
    mean_gain = zone.gain.profile.T.ravel()[calendar.cell]
    total = np.zeros(())
    for _ in range(n_draws):
        gain = draw_gain(zone, log.calendar, log.hours, rng)
        gains = np.repeat(gain[:, None], len(cases), axis=1)
        run = run_thermostat(zone, log.inputs, gains, setpoints, log.hours, hysteresis)
        inputs = np.repeat(np.column_stack([log.inputs, gain])[:, None], len(cases), axis=1)
        for j, role in enumerate(STAGES):
            if role in zone.roles:
                inputs[:, :, zone.column(role)] = run.stages[:, j]
        rows = inputs.reshape(-1, log.per_row, *inputs.shape[1:]).mean(axis=1)
        rows[:, :, -1] = mean_gain[:, None]  # what the identification expects of it
        noise = zone.gain.noise_std * rng.standard_normal((len(rows), 1))
        total = total + information.of_logs(run.room[:: log.per_row] + noise, rows) / n_draws
    return np.array([relative_errors(one, len(free)) for one in total])


def _make_plan(cases: Sequence[_Case], free: tuple[str, ...], errors: np.ndarray, target: float) -> ExperimentPlan:
    index = pd.MultiIndex.from_tuples([(c.name, c.hours) for c in cases], names=["perturbation", "hours"])
    table = pd.DataFrame(100.0 * errors, index=index, columns=list(free))
    worst = errors.max(axis=1, initial=0.0)
    table["worst"] = [free[i] for i in errors.argmax(axis=1)]
    table["worst_error"] = 100.0 * worst
    if enough := [i for i in range(len(cases)) if worst[i] <= target]:
        chosen = cases[min(enough, key=lambda i: (cases[i].hours, worst[i]))][:2]
        return ExperimentPlan(table, target, chosen, chosen, ())
    finite = np.where(np.isfinite(errors), errors, 0.0)  # of two that leave one unmoved, the better for the rest
    best = min(range(len(cases)), key=lambda i: (worst[i], finite[i].sum()))
    above = [i for i in np.argsort(-errors[best], kind="stable") if errors[best, i] > target]
    return ExperimentPlan(table, target, None, cases[best][:2], tuple(free[i] for i in above))


def _percent(value: float) -> str:
    return f"{value:.3g} %" if np.isfinite(value) else "not moved by any row"
