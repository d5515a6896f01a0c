"""Our extension: a gain state with time-varying variance and a smooth weekly profile."""

from __future__ import annotations

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from .._table import ZoneTable
from ..thermal import Parameter, RCNetwork
from .base import NetworkIdentifier
from .experiment import Experiment
from .fitting.gauss_newton import Minimum
from .fitting.periodic_likelihood import PeriodicProblem
from .fitting.priors import normal_priors
from .fitting.starts import search, starts_table
from .gain_filter import GainFilter
from .gain_model import DAY_TYPES, HOUR_CLASSES, HourClasses, VarianceModel, own_parameters, profile_basis, profile_cell
from .uncertainty.identifiability import at_bounds
from .uncertainty.standard_errors import periodic_doubt

#: how much wider than the paper's box the search is; a prior holds it together
_WIDER = 10.0


class PeriodicDisturbanceID(NetworkIdentifier):
    """Identification with a gain state of time-varying variance and a smooth weekly gain profile.

    The unmeasured heat is a weekly profile (an hour of a weekday or weekend day), the heat of a ventilation by day,
    and an Ornstein-Uhlenbeck state whose standard deviation is that of a class of hours times a factor of the day.
    Capacities, solar areas, the profile and the ventilation are solved inside; the negative log marginal likelihood is
    minimised over the rest with exact derivatives.  Where a network without any unmeasured heat is as likely, it is
    taken instead.

    Parameters
    ----------
    network : str or RCNetwork, default="2R2C"
        A name of the catalogue, or a network of your own.
    known : dict of parameter to value, optional
        Parameters that are not searched, such as a nameplate capacity ``{"Q_h": 6.0}`` [kW].
    bounds : dict of parameter to (lower, upper), optional
        Overrides the bounds, which are ten times wider than the paper's on either side.
    n_starts : int, default=4
        Most starts: the middle of the prior, then random draws from it.  Two that end at the same best minimum spare
        the others.
    horizon : timedelta-like, optional
        How far ahead ``predict`` looks; None simulates from the first row on.
    warmup : timedelta-like, default="1D"
        How much of the training table's end is kept as history.
    columns : dict of role to column, optional
        Columns whose names are not their roles.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; 15 minutes by default.
    n_jobs : int, optional
        Starts run in parallel.
    random_state : int, RandomState or None
        Of the starts; the result is the same under any ``n_jobs``.
    verbose : int, default=0
        1 shows a progress bar.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.
    priors : dict of parameter to prior, optional
        What is known of a parameter before the data: ``(median, factor)`` is log-normal with 90 % of it between
        ``median / factor`` and ``median * factor``; a frozen ``scipy.stats.lognorm`` (``norm`` for a parameter of
        either sign) does as well.  The fit is then the maximum of the posterior.
    variance : {"day_night", "3h"}, default="day_night"
        Hours that share a standard deviation: weekdays by day, weekdays by night, weekends; or three hours of a
        weekday or weekend day.  The finer ones find the solar shares of homes better, and mistake what a network is
        too simple for more easily for unmeasured heat.

    Attributes
    ----------
    theta_, theta_std_ : Series
        Parameters and their standard errors, from the Hessian or the days, whichever is larger.
    theta_cov_ : DataFrame
        Covariance of the parameters; see :meth:`theta_interval`.
    disturbance_ : Series
        ``tau`` [h]; ``sigma_<class of hours>`` [kW] of the gain around its profile, on a middling day;
        ``sigma_y`` [K]; ``sigma_profile_<day type>`` [kW], the hourly step of the profile.
    day_factors_ : Series
        By how much every day's gain varies more than on a middling day [-]; the index is the row where each begins.
    ventilation_ : float or Series
        Conductance of the air let in between 6 and 21 h on weekdays [kW/K], by node where several are disturbed; it
        has no sign bound, so that a negative one says that the network or the weather is otherwise than assumed.
    profile_ : DataFrame of shape (24, 2)
        Weekly gain profile [kW], ventilation included at its mean; columns ``weekday`` and ``weekend``, with the node
        above them where several are disturbed.
    n_days_ : int
        Days behind the standard errors.
    gain_found_ : bool
        Whether unmeasured heat was found.  If not, the network is that of the fit without any, the profile and the
        ventilation are zero, and ``disturbance_`` says how much a gain may still vary.
    identifiability_ : Identifiability
        Flat and weak directions, parameters at a bound, parameters that nothing moved.
    loss_ : float
        Negative log marginal likelihood, prior included, of the model that was taken.
    noise_std_ : float
        Standard deviation of the thermometer [K].
    starts_ : DataFrame
        One row a start, with unmeasured heat.
    state_space_ : StateSpace
    initial_state_ : ndarray of shape (n_states,)
        Node temperatures at the first training row [degC].
    sampling_time_ : Timedelta
    network_ : RCNetwork

    Notes
    -----
    It is not in the paper; it extends the input-disturbance model (2.2.2).

    Air that comes in at all hours (infiltration) cannot be told from the conductance ``1 / R_zo``, of which it becomes
    a part.
    """

    def __init__(
        self,
        network="2R2C",
        *,
        known=None,
        bounds=None,
        n_starts=4,
        horizon=None,
        warmup="1D",
        columns=None,
        sampling_time=None,
        n_jobs=None,
        random_state=None,
        verbose=0,
        origin_step=None,
        max_missing=0.5,
        priors=None,
        variance="day_night",
    ):
        super().__init__(
            network,
            known=known,
            bounds=bounds,
            n_starts=n_starts,
            horizon=horizon,
            warmup=warmup,
            columns=columns,
            sampling_time=sampling_time,
            n_jobs=n_jobs,
            random_state=random_state,
            verbose=verbose,
            origin_step=origin_step,
            max_missing=max_missing,
            priors=priors,
        )
        self.variance = variance

    def _widened(self, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
        def widen(p: Parameter) -> Parameter:
            if p.unit == "-" or p.transform != "log":
                return p
            low, high = sorted((abs(p.lower), abs(p.upper)))
            ends = (p.sign * low / _WIDER, p.sign * high * _WIDER)
            return p.bounded((min(ends), max(ends)))

        return tuple(widen(p) for p in parameters)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return own_parameters(0, self._hours)

    @property
    def _hours(self) -> HourClasses:
        if self.variance not in HOUR_CLASSES:
            raise ValueError(f"variance={self.variance!r} is none of {', '.join(map(repr, HOUR_CLASSES))}.")
        return HOUR_CLASSES[self.variance]

    # --------------------------------------------------------------------------------------------------------- fit
    def _make_problem(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> tuple[PeriodicProblem, tuple[str, ...]]:
        known, bounds = dict(self.known or {}), dict(self.bounds or {})
        own = tuple(p.bounded(bounds.get(p.name)) for p in self._all_own(experiment))
        priors = normal_priors(self.priors, (*parameters, *own), known)
        idle = self._excited(network, table, parameters, priors)
        fixed = idle | {k: float(v) for k, v in known.items()}
        inner = _inner(network, table, fixed, {*bounds, *priors})
        searched = tuple(p for p in (*parameters, *own) if p.name not in fixed and p.name not in inner)
        searched = tuple(p for p in searched if p.name not in _solved_fractions(network, inner))
        scale = _heat_scale(network, table, known)
        return PeriodicProblem(network, experiment, searched, fixed, inner, scale, priors, self.variance), tuple(idle)

    def _identify(
        self, network: RCNetwork, table: ZoneTable, experiment: Experiment, parameters: tuple[Parameter, ...]
    ) -> None:
        super()._identify(network, table, experiment, parameters)
        self.day_factors_.index = table.index[self.day_factors_.index]

    def _all_own(self, experiment: Experiment) -> tuple[Parameter, ...]:
        return own_parameters(len(VarianceModel.of(experiment.segments, self._hours).first_rows), self._hours)

    def _minima(self, problem: PeriodicProblem) -> list[Minimum]:
        if not problem.searched:
            return [problem.minimise(np.zeros(0))]
        starts = _prior_starts(problem, self.n_starts, check_random_state(self.random_state))
        return search(
            lambda batch: [problem.minimise(start) for start in batch],
            self._from_known(problem.searched, starts),
            problem.drop,
            per_round=2,
            enough=2,
            n_jobs=self.n_jobs,
            verbose=self.verbose,
            name=type(self).__name__,
        )

    def _store(
        self,
        problem: PeriodicProblem,
        best: Minimum,
        minima: list[Minimum],
        parameters: tuple[Parameter, ...],
        idle: tuple[str, ...],
    ) -> None:
        self._store_variances(problem, best)
        self.starts_ = starts_table(minima, problem.searched, problem.drop)
        quiet = self._without_gain(problem, best)
        self.gain_found_ = quiet is None
        if quiet is not None:
            problem, best = quiet
        values = problem.values(best.free)
        linear = problem.evaluate(best.free)[2]
        theta, turn = physical(problem, values, linear.beta)
        self.network_, self.parameters_ = problem.network, parameters
        self.theta_ = pd.Series({p.name: theta[p.name] for p in parameters}, name="theta")
        self.loss_, self.noise_std_ = best.loss, float(values["sigma_y"])
        self.disturbance_["sigma_y"] = self.noise_std_
        self._store_gain(problem, linear.beta[problem.n_plain :])
        doubt = periodic_doubt(problem, best.free, theta, turn, parameters)
        self._keep_doubt(doubt, at_bounds(best.free, problem.searched), idle)
        self._filter = self._make_filter(problem)

    def _without_gain(self, problem: PeriodicProblem, best: Minimum) -> tuple[PeriodicProblem, Minimum] | None:
        """The fit without unmeasured heat, where that is as likely and nothing was said of the heat.

        Both losses hold the same priors of what both have, so that the smaller one is the model to take: a gain that
        is not there costs the full model its priors and the determinant of its profile, and leaves the building less
        sure.
        """
        said = {*problem.fixed, *dict(self.bounds or {}), *problem.priors}
        own = {p.name for p in self._own_parameters()} - {"sigma_y"}
        if own & said:
            return None
        quiet = problem.without_gain()
        kept = {p.name for p in quiet.searched}
        start = best.free[[i for i, p in enumerate(problem.searched) if p.name in kept]]
        found = quiet.minimise(start)
        return (quiet, found) if found.loss <= best.loss else None

    def _store_variances(self, problem: PeriodicProblem, best: Minimum) -> None:
        """How much the gain varies; where none is found, how much it still may, by which the filter goes."""
        values = problem.values(best.free)
        own = {p.name: values[p.name] for p in self._own_parameters()}
        in_kw = {n: v * problem.heat_scale for n, v in own.items() if n not in ("tau", "sigma_y")}
        self.disturbance_ = pd.Series({**own, **in_kw})
        begins = np.cumsum([0, *(len(segment.y) for segment in problem.experiment.segments)])
        rows = [begins[segment] + row for segment, row in problem.variance.first_rows]
        self.day_factors_ = pd.Series(problem.day_factors(values), index=rows, name="day_factor")

    def _store_gain(self, problem: PeriodicProblem, beta: np.ndarray) -> None:
        """The weekly profile and the ventilation of every disturbed node."""
        nodes = problem.network.disturbed_nodes
        basis, parts = profile_basis()[0], beta.reshape(len(nodes), -1)
        profiles = [basis @ part[: basis.shape[1]] for part in parts]
        if problem.ventilated:
            cells = np.concatenate([profile_cell(p.hour_of_day, p.weekend) for p in problem.experiment.segments])
            for profile, part, series in zip(profiles, parts, problem.ventilation.T, strict=True):
                total = np.bincount(cells, weights=series, minlength=len(profile))
                profile += part[-1] * total / np.maximum(np.bincount(cells, minlength=len(profile)), 1)
        tables = [pd.DataFrame(profile.reshape(2, 24).T, columns=list(DAY_TYPES)) for profile in profiles]
        self.profile_ = tables[0] if len(nodes) == 1 else pd.concat(dict(zip(nodes, tables, strict=True)), axis=1)
        self.profile_.index = pd.RangeIndex(24, name="hour")
        air = [float(part[-1]) if problem.ventilated else 0.0 for part in parts]
        self.ventilation_ = air[0] if len(nodes) == 1 else pd.Series(air, index=nodes, name="ventilation")

    def _make_filter(self, problem: PeriodicProblem) -> GainFilter:
        """The filter of a middling day: a day to come has no factor yet."""
        d = problem.network.discrete(self._theta, problem.experiment.roles, problem.experiment.hours)
        n, m, own = len(d.A), len(problem.disturbed), self.disturbance_
        phi = float(np.exp(-problem.experiment.hours / own["tau"]))
        middling = float(np.sqrt(np.mean(self.day_factors_**2)))
        hours = self._hours
        sigma = middling * own[[f"sigma_{c}" for c in hours.names]].to_numpy(copy=True)
        Q = np.zeros((len(sigma), n + m, n + m))
        for i in range(n, n + m):
            Q[:, i, i] = sigma**2 * (1.0 - phi**2)
        profile = self.profile_.to_numpy().reshape(24, m, 2).transpose(2, 0, 1).reshape(48, m).copy()
        R, most = float(own["sigma_y"] ** 2), float(sigma.max())
        return GainFilter(problem.network, d.A, d.B, phi, Q, R, most, profile, hours.of_cell)


def _heat_scale(network: RCNetwork, table: ZoneTable, known: dict[str, float]) -> float:
    """How large the plant is, in units of the 6 kW that the priors were made for."""
    measured = [v for role, v in table.inputs.items() if role.startswith("Q_")]
    if measured:
        return max(float(np.quantile(np.abs(np.sum(measured, axis=0)), 0.98)), 0.05) / 6.0
    capacities = [abs(float(v)) for name, v in known.items() if name.startswith("Q_")]
    return max(capacities) / 6.0 if capacities else 1.0


def _inner(network: RCNetwork, table: ZoneTable, fixed: dict[str, float], bounded: set[str]) -> tuple[str, ...]:
    """Network parameters that are solved inside: free capacities, and the solar gains where nothing constrains them."""
    sources = [s for s in network.sources(table.inputs) if s.parameter is not None]
    out = [s.parameter for s in sources if s.role.startswith("u_") and len(s.shares) == 1]
    solar = [s.parameter for s in sources if not s.role.startswith("u_")]
    fractions = network.solar_fractions
    if len(solar) == 1 and len(fractions) <= 1 and not any(f in fixed or f in bounded for f in fractions):
        out += solar
    return tuple(p for p in out if p is not None and p not in fixed and p not in bounded)


def _solved_fractions(network: RCNetwork, inner: tuple[str, ...]) -> set[str]:
    return set(network.solar_fractions) if any(p.startswith("A_win") for p in inner) else set()


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
            start = np.log((1.0 if p.name == "C_za" else 4.0) * scale)
        elif p.unit == "K/kW":
            start = np.log((6.0 if p.name.endswith("o") else 1.2) / scale)
        centre.append(min(max(start, low), high))
    # a draw far out in what is not the building only takes longer
    spread = [0.0 if p.transform != "log" else 0.3 if p.name in guess else 1.0 for p in problem.searched]
    draws = rng.normal(size=(n_starts, len(centre))) * np.array(spread)
    draws[0] = 0.0
    bounds = np.array([p.free_bounds for p in problem.searched]).T
    return np.clip(np.array(centre) + draws, *bounds)


def physical(
    problem: PeriodicProblem, values: dict[str, float], beta: np.ndarray
) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Network parameters from searched values and inner coefficients, and their derivatives by the coefficients."""
    theta = dict(values)
    turn: dict[str, np.ndarray] = {}
    unit = np.eye(len(beta))
    areas: dict[str, list[int]] = {}
    for j, channel in enumerate(problem.channels[: problem.n_plain]):
        name, _, fraction = channel.name.partition(":")
        areas.setdefault(name, []).append(j)
        theta[name] = theta.get(name, 0.0) + float(beta[j]) if areas[name][1:] else float(beta[j])
        turn[name] = turn[name] + unit[j] if areas[name][1:] else unit[j]
        if fraction:
            theta[fraction], turn[fraction] = float(beta[j]), unit[j]
    for name, parts in areas.items():
        if len(parts) < 2:
            continue
        total = max(theta[name], 1e-9)
        for channel in (problem.channels[j] for j in parts):
            fraction = channel.name.partition(":")[2]
            if fraction:
                share = theta[fraction] / total if theta[name] > 0 else 0.5
                turn[fraction] = (turn[fraction] - share * turn[name]) / total
                theta[fraction] = share
    return theta, turn
