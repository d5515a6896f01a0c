"""Profile likelihood of one parameter: it is held at one value after another, and all others are identified anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.stats import t as student

from ..._arguments import check_integer, check_level
from ..._warnings import percent
from ...thermal import Parameter
from ...thermal.parameters import check_known
from .constrained_problem import ConstrainedProblem, free_point

_STEPS, _GROWTH = 8, 1.6  # most steps outward to an end of the interval, and the ratio of each to the last
_NEAR = 0.01  # a deviance this near the threshold, as a share of it, is at an end of the interval


@dataclass(frozen=True)
class ProfileLikelihood:
    """Profile of one parameter, and the interval that it gives.

    Attributes
    ----------
    parameter, unit : str
    best : float
        Value at the least deviance [unit].
    level, lower, upper : float
        The interval [unit]; its ends are 0 or infinite where the data set none.
    threshold, inflation : float
        Deviance at the ends, which is the squared quantile of Student's t times the inflation: the squared ratio of the
        parameter's standard error to that of the disturbance model alone.
    curve : DataFrame
        One row per value that was tried, in their order: column ``deviance`` [-], then every parameter re-identified.
    """

    parameter: str
    unit: str
    best: float
    level: float
    lower: float
    upper: float
    threshold: float
    inflation: float
    curve: pd.DataFrame

    def __str__(self) -> str:
        return (
            f"{self.parameter} = {self.best:.4g} {self.unit}, {percent(self.level, '.3g')} between {self.lower:.4g} "
            f"and {self.upper:.4g} ({len(self.curve)} values tried)"
        )


@dataclass
class _Search:
    """Values tried so far, on the searched scale, with the deviance and the parameters that each gave."""

    constrained: ConstrainedProblem
    parameter: Parameter
    tried: dict[float, tuple[float, dict[str, float]]] = field(default_factory=dict)

    def deviance(self, x: float) -> float:
        """Minus twice the log-likelihood with the parameter held at ``x``, up to a constant."""
        if x not in self.tried:
            warm = self.constrained.estimator._searched_values()
            if self.tried:
                warm |= self.tried[min(self.tried, key=lambda known: abs(known - x))][1]
            problem = self.constrained.problem({self.parameter.name: self.parameter.from_free(x)})
            free, deviance = problem.minimum_near(free_point(problem, warm))
            self.tried[x] = deviance, problem.all_values(free)
        return self.tried[x][0]

    def least(self) -> float:
        return min(deviance for deviance, _ in self.tried.values())

    def ends(self, start: float, step: float, threshold: float) -> list[float | None]:
        """Both ends of the interval, as :meth:`end`; where a better minimum turns up, from there anew."""
        while True:
            self.deviance(start)
            found = [self.end(start, sign * step, threshold) for sign in (-1.0, 1.0)]
            best = min(self.tried, key=lambda x: self.tried[x][0])
            if self.tried[start][0] - self.tried[best][0] <= _NEAR * threshold:
                return found
            start, self.tried = best, {best: self.tried[best]}

    def end(self, start: float, step: float, threshold: float) -> float | None:
        """Value at which the deviance passes the threshold on one side; None where it does not within the bounds."""
        low, high = self.parameter.free_bounds
        inside = start
        for _ in range(_STEPS):
            x = min(max(inside + step, low), high)
            if self.deviance(x) - self.least() > threshold:
                return self._crossing(inside, x, threshold)
            if x in (low, high):
                return None
            inside, step = x, _GROWTH * step
        return None

    def _crossing(self, inside: float, outside: float, threshold: float) -> float:
        least = self.least()

        def beyond(x: float) -> float:
            away = self.deviance(x) - least - threshold
            return 0.0 if abs(away) < _NEAR * threshold else away

        if beyond(inside) >= 0.0:  # a better minimum turned up on the way
            return inside
        return float(brentq(beyond, inside, outside, xtol=1e-4 * abs(outside - inside)))


def profile_likelihood(
    estimator: Any, X: Any, y: Any, parameter: str, *, values: Any = None, level: float = 0.9
) -> ProfileLikelihood:
    """Hold one parameter at value after value, identify all others anew, and see how the likelihood falls.

    Parameters
    ----------
    estimator : identification of a network
        Fitted on ``X`` and ``y``; one that is not fitted is cloned and fitted.
    X, y : array-like
        As in ``fit``.
    parameter : str
        Such as ``"C_w"``; one that was not identified is refused.
    values : sequence of float or int, optional
        Further values to try [the parameter's unit], such as for a picture; an int: how many within the interval.
    level : float, default=0.9
        Of the interval, between 0 and 1.

    Returns
    -------
    ProfileLikelihood

    Raises
    ------
    ValueError
        If the parameter was not identified, a value or the level is impossible, or the estimator has no likelihood
        (``objective="multi_step"``).

    Notes
    -----
    The deviance is ``n log(SSE / SSE_min)`` for the sums of squares (the noise is profiled too) and twice the
    difference of the negative log-likelihood for the periodic model, without a prior on the parameter itself.

    Examples
    --------
    >>> from skhybrid import OutputDisturbanceID
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.identification import profile_likelihood
    >>> office = make_office(n_days=4, random_state=0)
    >>> model = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=5, random_state=0).fit(office.X, office.y)
    >>> profile = profile_likelihood(model, office.X, office.y, "C_za")
    >>> bool(profile.lower < profile.best < profile.upper)
    True
    """
    check_level(level)
    tried, n_inside = (list(values), 0) if np.ndim(values) else ([], values or 0)
    check_integer("values", n_inside, 0)
    constrained = ConstrainedProblem.of(estimator, X, y)
    fitted = constrained.estimator
    known = _checked(fitted, parameter, tried)
    inflation = float(fitted._growth.get(parameter, 1.0)) ** 2
    quantile = float(student.ppf(0.5 + level / 2, max(fitted.n_days_ - 1, 1)))
    search = _Search(constrained, known)
    theta = float(fitted.theta_[parameter])
    usable = known.transform != "log" or theta * known.sign > 0
    start = float(np.clip(known.to_free(theta) if usable else known.free_bounds[0], *known.free_bounds))
    step = quantile * _standard_error(fitted, known)
    threshold = inflation * quantile**2
    ends = search.ends(start, step, threshold)
    more = [known.to_free(float(value)) for value in tried]
    reached = [x for x in ends if x is not None]
    more += np.linspace(reached[0], reached[1], n_inside + 2)[1:-1].tolist() if len(reached) == 2 else []
    for x in more:
        search.deviance(x)
    return _collected(search, ends, level, threshold, inflation, list(fitted.theta_.index))


def _checked(fitted: Any, parameter: str, values: Sequence[float]) -> Parameter:
    """The parameter to hold, which the data must have decided."""
    if not isinstance(parameter, str) or parameter not in fitted.theta_.index:
        names = ", ".join(fitted.theta_.index)
        raise ValueError(f"{parameter!r} is not a parameter of the network, which has {names}.")
    if parameter in (fitted.known or {}):
        raise ValueError(f"{parameter} is given by known=, so the data have no say in it; drop it there.")
    if parameter in fitted.identifiability_.not_excited:
        raise ValueError(f"{parameter} has no effect on any row of the table, so there is nothing to profile.")
    (found,) = (p for p in fitted.parameters_ if p.name == parameter)
    for value in values:
        check_known([found], {parameter: value}, "values=")
    return found


def _standard_error(fitted: Any, p: Parameter) -> float:
    """On the searched scale, within reason: the first step of the search for an end."""
    value = max(abs(float(fitted.theta_[p.name])), 1e-300) if p.transform == "log" else 1.0  # a sign may hold it at 0
    error = float(fitted.theta_std_[p.name]) / value
    low, high = p.free_bounds
    return float(np.clip(np.nan_to_num(error, nan=np.inf), 1e-5 * (high - low), 0.1 * (high - low)))


def _collected(
    search: _Search, ends: list[float | None], level: float, threshold: float, inflation: float, names: list[str]
) -> ProfileLikelihood:
    p, least = search.parameter, search.least()
    rows = []
    for x, (deviance, found) in search.tried.items():
        others = {name: found[name] for name in names if name != p.name}
        rows.append({p.name: p.from_free(x), "deviance": deviance - least, **others})
    curve = pd.DataFrame(rows).set_index(p.name).sort_index()
    open_ends = (0.0, 1.0 if p.unit == "-" else np.inf) if p.transform == "log" else (-np.inf, np.inf)
    if p.sign < 0:
        open_ends = (-0.0, -np.inf)
    reached = sorted(o if x is None else p.from_free(x) for x, o in zip(ends, open_ends, strict=True))
    best = float(curve.index[int(np.argmin(curve["deviance"]))])
    return ProfileLikelihood(p.name, p.unit, best, level, reached[0], reached[1], threshold, inflation, curve)
