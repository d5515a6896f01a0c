"""Periodic identification: a gain state with time-varying variance and a smooth weekly profile."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any, Literal

import numpy as np
import pandas as pd

from .._arguments import store_arguments
from .._table import ZoneTable, is_stage
from ..thermal import Parameter, RCNetwork
from ..thermal.parameters import as_bounds, search_bounds
from .base import NetworkIdentifier, SearchResult
from .experiment import Experiment
from .fitting.gauss_newton import Minimum
from .fitting.periodic_likelihood import PeriodicProblem
from .fitting.priors import normal_priors
from .fitting.starts import start_at, starts_table
from .gain_filter import GainFilter
from .gain_model import (
    DAY_TYPES,
    HOUR_CLASSES,
    PLANT,
    HourClasses,
    VarianceModel,
    gain_noise,
    gain_parameters,
    profile_basis,
    week_cells,
)
from .shared_docs import shared_docs
from .uncertainty.identifiability import at_bounds
from .uncertainty.periodic_errors import periodic_uncertainty

_WIDER = 10.0  # factor by which the search reaches beyond the paper's bounds; a prior keeps it from going astray


@shared_docs
class PeriodicDisturbanceID(NetworkIdentifier):
    """Identification with a gain state of time-varying variance and a smooth weekly gain profile.

    The unmeasured heat is a weekly profile (by hour, for weekdays and weekend days), a ventilation by day, and an
    Ornstein-Uhlenbeck state whose standard deviation is that of a class of hours times a factor of the day.  The
    negative log marginal likelihood is minimised, with capacities, solar areas, profile and ventilation solved inside.
    If a network without any unmeasured heat explains the log as well, it is used instead.

    Parameters
    ----------
    %(network)s
    bounds : dict of parameter to (lower, upper), optional
        Overrides the bounds, ten times wider than the paper's on either side.
    n_starts : int, default=4
        Most starts: the middle of the prior, then draws from it, until two reach the same best minimum.
    %(data)s
    holidays : str or sequence of dates, optional
        A country or state as the ``holidays`` package names it, such as ``"US-IL"``, or local dates, which count as
        weekend days.
    %(runs)s
    variance : {"day_night", "3h"}, default="day_night"
        Hours that share a standard deviation: weekdays by day, weekdays by night, weekends; or three hours of a day,
        which find solar shares better but may mistake the errors of too simple a network for unmeasured heat.

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        ``tau`` [h]; ``sigma_<hours>`` [kW] of the gain around its profile, on a middling day; ``sigma_y`` [K];
        ``sigma_profile_<day type>`` [kW], the hourly step of the profile.
    day_factors_ : Series
        Factor by which the gain varies more than on a middling day [-], by each day's first row.
    ventilation_ : float or Series
        Conductance of the air let in between 6 and 21 h on weekdays [kW/K], by node where several are disturbed; a
        negative one is a sign of a wrong network or weather.
    profile_ : DataFrame of shape (24, 2)
        Weekly gain profile [kW], with the mean ventilation; columns ``weekday`` and ``weekend``, of each node.
    gain_found_ : bool
        Whether unmeasured heat was found.  If not, the network, profile and ventilation are those of the fit without
        any, and ``disturbance_`` says how much a gain may still vary.
    loss_ : float
        Negative log marginal likelihood, prior included, of the model that was taken.
    noise_std_ : float
        Standard deviation of the thermometer [K].
    %(fitted)s

    Notes
    -----
    An extension of the paper's input-disturbance model (2.2.2).  Infiltration at all hours is a part of ``1 / R_zo``.
    """

    _reads_clock = True

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=4, horizon=None, warmup="1D", columns=None,
        sampling_time=None, holidays=None, n_jobs=None, random_state=None, verbose=0, origin_step=None,
        max_missing=0.5, priors=None, variance: Literal["day_night", "3h"] = "day_night",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _widened(self, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
        def wider(p: Parameter) -> tuple[float, float]:
            low, high = sorted((abs(p.lower), abs(p.upper)))
            ends = (p.sign * low / _WIDER, p.sign * high * _WIDER)
            return min(ends), max(ends)

        return tuple(p if p.unit == "-" or p.transform != "log" else p.bounded(wider(p)) for p in parameters)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return gain_parameters(0, self._hours)

    def _units(self, heat_scale: float) -> dict[str, float]:
        """Unit [kW] of the standard deviations of the gain, on the scale on which they are searched."""
        return {p.name: heat_scale for p in self._own_parameters() if p.unit == PLANT}

    def _reported(self, searched: pd.DataFrame) -> pd.DataFrame:
        units = self._units(self._heat_scale).items()
        return searched.assign(**{name: searched[name] * unit for name, unit in units if name in searched})

    @property
    def _hours(self) -> HourClasses:
        if self.variance not in tuple(HOUR_CLASSES):
            raise ValueError(f"variance={self.variance!r} is not one of {', '.join(map(repr, HOUR_CLASSES))}.")
        return HOUR_CLASSES[self.variance]

    def _make_problem(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> tuple[PeriodicProblem, tuple[str, ...]]:
        scale = _heat_scale(table, dict(self.known or {}))
        return self._problem_in(scale, network, table, experiment, parameters)

    def _problem_in(
        self, heat_scale: float, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: Any
    ) -> tuple[PeriodicProblem, tuple[str, ...]]:
        """The problem whose gain is searched in a unit of heat, and the parameters that no row moves."""
        known, bounds = dict(self.known or {}), dict(self.bounds or {})
        n_days = len(VarianceModel.of(experiment, self._hours).first_rows)
        units = self._units(heat_scale)

        def bounded(p: Parameter) -> Parameter:
            ends, unit = bounds.get(p.name), units.get(p.name, 1.0)
            if ends is None:
                return p
            lower, upper = as_bounds(p.name, ends)
            return p.bounded((lower / unit, upper / unit))

        own = tuple(bounded(p) for p in gain_parameters(n_days, self._hours))
        priors = normal_priors(self.priors, (*parameters, *own), known, units)
        idle = self._excited(network, table, parameters, priors)
        fixed = idle | {name: float(value) / units.get(name, 1.0) for name, value in known.items()}
        inner = _inner(network, table, fixed, {*bounds, *priors})
        solar = any(p.startswith("A_win") for p in inner)  # then its fractions are solved inside too
        elsewhere = {*fixed, *inner, *(network.solar_fractions if solar else ())}
        searched = tuple(p for p in (*parameters, *own) if p.name not in elsewhere)
        settings = {"heat_scale": heat_scale, "priors": priors, "hours": self.variance}
        return PeriodicProblem(network, experiment, searched, fixed, inner, **settings), tuple(idle)

    def _minima(self, problem: PeriodicProblem, begin: Mapping[str, float] | None) -> list[Minimum]:
        if not problem.searched:
            return [problem.minimise(np.zeros(0))]
        starts = _prior_starts(problem, self.n_starts, self._start_draws())
        if begin is not None:
            units = self._units(problem.heat_scale)
            start = {n: v / units.get(n, 1.0) if isinstance(v, Real) else v for n, v in begin.items()}
            starts = start_at(problem.searched, start, starts[0])

        def each(batch: np.ndarray) -> list[Minimum]:
            return [problem.minimise(start) for start in batch]

        return self._search(each, starts, problem.drop, per_round=2, enough=2)

    def _store(self, found: SearchResult) -> GainFilter:
        problem, best, minima, table, parameters, idle = found
        self._heat_scale = problem.heat_scale
        self._store_variances(problem, best, table)
        self.starts_ = self._reported(starts_table(minima, problem.searched, problem.drop))
        quiet = self._without_gain(problem, best)
        self.gain_found_ = quiet is None
        if quiet is not None:
            problem, best = quiet
        linear = problem.evaluate(best.free)[2]
        theta, turn = problem.theta(best.free, linear)
        self.network_, self.parameters_ = problem.network, parameters
        self.theta_ = pd.Series({p.name: theta[p.name] for p in parameters}, name="theta")
        self.loss_, self.noise_std_ = best.loss, float(theta["sigma_y"])
        self.disturbance_["sigma_y"] = self.noise_std_
        self._store_gain(problem, linear.beta[problem.layout.n_plain :])
        uncertainty = periodic_uncertainty(problem, best.free, theta, turn, parameters)
        self._store_uncertainty(uncertainty, at_bounds(best.free, problem.searched), idle)
        return self._make_filter(problem)

    def _without_gain(self, problem: PeriodicProblem, best: Minimum) -> tuple[PeriodicProblem, Minimum] | None:
        """The fit without unmeasured heat, where it is as likely and the user set nothing about the heat."""
        own = {p.name for p in self._own_parameters()} - {"sigma_y"}
        if own & {*problem.fixed, *dict(self.bounds or {}), *problem.priors}:
            return None
        quiet = problem.without_gain()
        found = quiet.minimise(best.free[[p in quiet.searched for p in problem.searched]])
        return (quiet, found) if found.loss <= best.loss else None

    def _store_variances(self, problem: PeriodicProblem, best: Minimum, table: ZoneTable) -> None:
        """Standard deviations of the gain; where no gain is found, those that it may still have, for the filter."""
        values = problem.values(best.free)
        units = self._units(problem.heat_scale)
        self.disturbance_ = pd.Series({p.name: values[p.name] * units.get(p.name, 1.0) for p in self._own_parameters()})
        begins = table.index[problem.variance.first_rows]
        self.day_factors_ = pd.Series(problem.day_factors(values), index=begins, name="day_factor")

    def _store_gain(self, problem: PeriodicProblem, beta: np.ndarray) -> None:
        """The weekly profile and the ventilation of every disturbed node."""
        nodes = problem.network.disturbed_names
        basis, parts = profile_basis()[0], beta.reshape(len(nodes), -1)
        profiles = [basis @ part[: basis.shape[1]] for part in parts]
        if problem.layout.ventilated:
            cells = week_cells(problem.experiment)
            for profile, part, series in zip(profiles, parts, problem.ventilation.T, strict=True):
                total = np.bincount(cells, weights=series, minlength=len(profile))
                profile += part[-1] * total / np.maximum(np.bincount(cells, minlength=len(profile)), 1)
        tables = [pd.DataFrame(profile.reshape(2, 24).T, columns=list(DAY_TYPES)) for profile in profiles]
        self.profile_ = tables[0] if len(nodes) == 1 else pd.concat(dict(zip(nodes, tables, strict=True)), axis=1)
        self.profile_.index = pd.RangeIndex(24, name="hour")
        air = [float(part[-1]) if problem.layout.ventilated else 0.0 for part in parts]
        self.ventilation_ = air[0] if len(nodes) == 1 else pd.Series(air, index=nodes, name="ventilation")

    def _problem_of(self, other: Any, *prepared: Any) -> PeriodicProblem:
        """In the same unit of heat, and without the gain where none was found."""
        problem, _ = other._problem_in(self._heat_scale, *prepared)
        return problem if self.gain_found_ else problem.without_gain()

    def _searched_values(self) -> dict[str, float]:
        values = super()._searched_values()
        for name, unit in self._units(self._heat_scale).items():
            values[name] /= unit
        return values | {f"day_{d}": float(value) for d, value in enumerate(np.log(self.day_factors_))}

    def _make_filter(self, problem: PeriodicProblem) -> GainFilter:
        """The filter of a middling day, as the factor of a future day is unknown."""
        d = problem.network.discrete(self._theta, problem.experiment.roles, problem.experiment.hours)
        n, m, own = len(d.A), len(problem.layout.disturbed), self.disturbance_
        phi = float(np.exp(-problem.experiment.hours / own["tau"]))
        middling = float(np.sqrt(np.mean(self.day_factors_**2)))
        hours = self._hours
        sigma = middling * own[[f"sigma_{c}" for c in hours.names]].to_numpy(copy=True)
        Q = gain_noise(sigma, phi, n, m)
        profile = self.profile_.to_numpy().reshape(24, m, 2).transpose(2, 0, 1).reshape(48, m).copy()
        R, most = float(own["sigma_y"] ** 2), float(sigma.max())
        return GainFilter(problem.network, d.A, d.B, phi, Q, R, most, profile, hours.of_cell)


def _heat_scale(table: ZoneTable, known: dict[str, float]) -> float:
    """Size of the plant, in units of the 6 kW for which the priors were chosen."""
    measured = [v for role, v in table.inputs.items() if role.startswith("Q_") and not table.hardly_ran(role)]
    if measured:
        return max(float(np.quantile(np.abs(np.sum(measured, axis=0)), 0.98)), 0.05) / 6.0
    capacities = [abs(float(v)) for name, v in known.items() if name.startswith("Q_")]
    return max(capacities) / 6.0 if capacities else 1.0


def _inner(network: RCNetwork, table: ZoneTable, fixed: dict[str, float], bounded: set[str]) -> tuple[str, ...]:
    """Network parameters that are solved inside: free capacities, and the solar gains where nothing constrains them."""
    sources = [s for s in network.sources(table.inputs) if s.parameter is not None]
    out = [s.parameter for s in sources if is_stage(s.role) and len(s.shares) == 1]
    solar = [s.parameter for s in sources if not is_stage(s.role)]
    fractions = network.solar_fractions
    if len(solar) == 1 and len(fractions) <= 1 and not any(f in fixed or f in bounded for f in fractions):
        out += solar
    return tuple(p for p in out if p is not None and p not in fixed and p not in bounded)


def _kind(p: Parameter) -> str:
    """Name of a parameter without its zone, such as ``R_zo`` of ``R_zo_north``."""
    return "_".join(p.name.split("_")[:2])


def _prior_starts(problem: PeriodicProblem, n_starts: int, rng: np.random.RandomState) -> np.ndarray:
    """(n_starts, p): a small-building guess, then draws around it."""
    guess = {"tau": 4.0, "sigma_y": 0.05} | {f"sigma_{c}": 0.3 for c in HOUR_CLASSES[problem.hours].names}
    guess |= {f"sigma_profile_{kind}": 0.3 for kind in DAY_TYPES}
    scale = problem.heat_scale
    centre = []
    for p in problem.searched:
        low, high = p.free_bounds
        start = 0.5 * (low + high)
        if p.name in guess:
            start = p.to_free(guess[p.name])
        elif p.unit == "kWh/K":
            start = np.log((1.0 if _kind(p) == "C_za" else 4.0) * scale)
        elif p.unit == "K/kW":
            start = np.log((6.0 if _kind(p).endswith("o") else 1.2) / scale)
        centre.append(min(max(start, low), high))
    # a wide spread of the disturbance's parameters only makes the search longer
    spread = [0.0 if p.transform != "log" else 0.3 if p.name in guess else 1.0 for p in problem.searched]
    draws = rng.normal(size=(n_starts, len(centre))) * np.array(spread)
    draws[0] = 0.0
    return np.clip(np.array(centre) + draws, *search_bounds(problem.searched))
