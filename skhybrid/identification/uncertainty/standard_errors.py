"""Standard errors that are true although the disturbance model is not: delete-a-day jackknife beside the Hessian.

The Hessian of a likelihood (or the Gauss-Newton matrix of a sum of squares) gives the right standard errors only where
the disturbance model holds.  People do not read it: gains of a day go together, and differ from one day to the next.
So every fit is also asked how far its parameters would move without each of its days; the scatter of these moves
(the jackknife with blocks of a day, equivalent to a sandwich covariance with scores clustered by day, and kinder to
few days) needs no model of the gain.  A standard error is the larger of the two, and an interval takes the quantile
of Student's t with as many degrees of freedom as there are days, less one.

One Newton step stands for the fit without a day: it costs one evaluation a day instead of a search (of long logs of
the periodic model, one for every two days or more).  Least squares
takes the Hessian without that day (CR3); the periodic model takes the whole one, which understates the move that a day
with most of the information would cause.

References
----------
Efron and Tibshirani, An Introduction to the Bootstrap, 1993, ch. 11; Cameron and Miller, A Practitioner's Guide to
Cluster-Robust Inference, J. Human Resources 50, 2015 (CR3 and t with G - 1 degrees of freedom).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import null_space
from scipy.stats import t as student
from sklearn.utils.validation import check_is_fitted

from ...thermal import Parameter
from .identifiability import assess, held_subspace

#: largest standard error of a logarithm that is computed; beyond it a direction is as good as free
_MOST = 1e3
#: an interval of more than this many e-foldings is that of all values
_BEYOND = 50.0
#: most fits without a part of a periodic log; of longer logs a part is two or more days, else the cost would be
#: quadratic in the length
MOST_PARTS = 56
#: fewer days than this have no scatter to speak of
_FEW_DAYS = 3


class ParameterUncertainty(NamedTuple):
    """What a fit leaves open about its k network parameters, on the logarithmic scale."""

    parameters: tuple[Parameter, ...]  # the k that the data decide
    sensitivity: np.ndarray  # (n, k) in units of the noise, disturbance parameters free to follow
    model: np.ndarray  # (k, k) covariance if the disturbance model were true
    jackknife: np.ndarray  # (k, k) from the fits without each day, flat directions left out; 0 where days are few
    n_days: int

    @property
    def growth(self) -> np.ndarray:
        """(k,) by which the standard error of every parameter exceeds that of the model."""
        model, days = np.diag(self.model), np.diag(self.jackknife)
        return np.sqrt(np.maximum(1.0, days / np.where(model > 0, model, np.inf)))

    @property
    def covariance(self) -> np.ndarray:
        """(k, k): correlations of the model, for every parameter the larger of the two variances."""
        return self.growth[:, None] * self.model * self.growth


class UncertaintyMixin:
    """Standard errors and intervals of an identification; ``_keep_doubt`` is called by its ``fit``."""

    theta_: pd.Series
    theta_std_: pd.Series
    parameters_: tuple[Parameter, ...]

    def _keep_doubt(self, doubt: ParameterUncertainty, bound: tuple[str, ...], idle: tuple[str, ...]) -> None:
        names = [p.name for p in self.parameters_]
        chosen = [p.name for p in doubt.parameters]
        scale = np.array([_unit(float(self.theta_[name])) for name in chosen])
        self.theta_cov_ = pd.DataFrame(0.0, index=names, columns=names)
        self.theta_cov_.loc[chosen, chosen] = scale[:, None] * doubt.covariance * scale
        for name in idle:
            if name in names:
                self.theta_cov_.loc[name, name] = np.inf
        self.theta_std_ = pd.Series(np.sqrt(np.diag(self.theta_cov_)), index=names, name="std")
        self.n_days_ = doubt.n_days
        self._growth = dict(zip(chosen, doubt.growth.tolist(), strict=True))
        self.identifiability_ = assess(
            doubt.sensitivity, doubt.model, doubt.growth, doubt.parameters, doubt.n_days, bound, idle
        )

    def theta_interval(self, level: float = 0.9) -> pd.DataFrame:
        """Intervals that hold each parameter with the given probability.

        Parameters
        ----------
        level : float, default=0.9
            Between 0 and 1.

        Returns
        -------
        DataFrame
            One row a parameter, columns ``lower`` and ``upper`` [the parameter's unit].  A parameter that is searched
            by its logarithm has an interval of factors, ``theta * exp(+- t * std / theta)``; t is the quantile of
            Student's distribution with ``n_days_ - 1`` degrees of freedom.  A known parameter is its own interval.

        Raises
        ------
        ValueError
            If ``level`` is not between 0 and 1.
        """
        check_is_fitted(self)
        if not 0.0 < level < 1.0:
            raise ValueError(f"level={level!r} is not between 0 and 1; give 0.9 for intervals of 90 %.")
        reach = float(student.ppf(0.5 + level / 2, max(self.n_days_ - 1, 1))) * self.theta_std_
        ends = {p.name: _ends(p, float(self.theta_[p.name]), float(reach[p.name])) for p in self.parameters_}
        return pd.DataFrame(ends, index=["lower", "upper"], dtype=np.float64).T


def _unit(value: float) -> float:
    """What one unit of a logarithm is worth; 1 at zero, where there is none."""
    return value if abs(value) > 1e-9 else 1.0


def _ends(p: Parameter, value: float, reach: float) -> tuple[float, float]:
    """Ends of an interval, within what the parameter can be at all."""
    if p.transform != "log":
        return value - reach, value + reach
    if value == 0.0:  # held at 0 by the sign that it must have
        return tuple(sorted((0.0, p.sign * reach)))  # type: ignore[return-value]
    factor = float(np.exp(reach / abs(value))) if reach < _BEYOND * abs(value) else np.inf
    near, far = value / factor, value * factor
    if p.unit == "-":
        far = min(far, 1.0)
    return (near, far) if value > 0 else (far, near)


def day_of_rows(n_rows: int, hours: float) -> np.ndarray:
    """Block of 24 hours that each row lies in, (n_rows,) int."""
    return np.arange(n_rows) // max(round(24.0 / hours), 1)


def inverse_information(information: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix; a direction without any gets a huge variance, not none."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    floor = max(1e-15 * float(values.max(initial=0.0)), _MOST**-2)
    return (vectors / np.maximum(values, floor)) @ vectors.T


def jackknife_covariance(moves: np.ndarray, overlap: int = 0) -> np.ndarray:
    """Covariance from the moves (D, k) of the estimates when each of D blocks is left out.

    Where blocks up to ``overlap`` apart go together, their products count with Bartlett's weights; no variance is
    smaller than without them (Newey and West, Econometrica 55, 1987).
    """
    D = len(moves)
    if D < _FEW_DAYS:
        return np.zeros((moves.shape[1], moves.shape[1]))
    alone = (D - 1) / D * moves.T @ moves
    variance = together = (moves**2).sum(axis=0)
    for lag in range(1, min(overlap, D - 1) + 1):
        weight = 1.0 - lag / (overlap + 1.0)
        together = together + 2.0 * weight * (moves[lag:] * moves[:-lag]).sum(axis=0)
    growth = np.sqrt(np.maximum(together / np.where(variance > 0, variance, np.inf), 1.0))
    return growth[:, None] * alone * growth


# ------------------------------------------------------------------------------------------------------ least squares
def least_squares_doubt(
    problem: Any, free: np.ndarray, noise: float, names: Sequence[str], days: np.ndarray | None = None, overlap: int = 0
) -> ParameterUncertainty:
    """What a fit of CONV, ID or OD leaves open.

    Parameters
    ----------
    problem : PredictionErrorProblem
    free : ndarray of shape (p,)
        Its optimum on the searched scale.
    noise : float
        Variance of the errors [K2].
    names : sequence of str
        The network's parameters.
    days : ndarray of int, shape (n,), optional
        Day of every error, from 0; by default they follow each other evenly.
    overlap : int, default=0
        Days over which errors go together.

    Returns
    -------
    ParameterUncertainty

    Notes
    -----
    The exact Hessian is the central difference of exact gradients, by day; where it is not positive definite, the
    Gauss-Newton matrix stands in.
    """
    p = len(problem.searched)
    place = [i for i, q in enumerate(problem.searched) if q.name in set(names)]
    n_rows, hours = len(problem.experiment.y), problem.experiment.hours
    n_days = int(day_of_rows(n_rows, hours)[-1]) + 1
    if not p:
        none = np.zeros((0, 0))
        return ParameterUncertainty((), none, none, none, n_days)
    noise = max(noise, 1e-300)
    errors, jacobian = problem.linearised(free)
    share = n_rows / max(len(errors), 1) if len(errors) > n_rows else 1.0
    day = day_of_rows(len(errors), hours * share) if days is None else days
    gauss = np.array([jacobian[day == d].T @ jacobian[day == d] for d in range(day[-1] + 1)])
    scores = _day_scores(errors, jacobian, day)
    prior = noise * prior_precision(problem)
    exact = _day_hessians(problem, free, day)
    by_day = exact if _positive(exact.sum(axis=0) + np.diag(prior)) else gauss
    total = by_day.sum(axis=0) + np.diag(prior)
    bread = inverse_information(total / noise)
    model = bread @ (gauss.sum(axis=0) / noise + np.diag(prior) / noise) @ bread if by_day is exact else bread
    moves = []
    for own, own_gauss, score in zip(by_day, gauss, scores, strict=True):
        left = total - own if _positive(total - own) else gauss.sum(axis=0) + np.diag(prior) - own_gauss
        moves.append(inverse_information(left / noise) @ (score / noise))
    scale = _log_slopes(problem, free)[place]
    model = model[np.ix_(place, place)] * scale[:, None] * scale
    return ParameterUncertainty(
        tuple(problem.searched[i] for i in place),
        _without(jacobian, place) / np.sqrt(noise) / scale,
        model,
        jackknife_covariance(np.array(moves)[:, place] * scale @ held_subspace(model), overlap),
        n_days,
    )


def prior_precision(problem: Any) -> np.ndarray:
    """(p,) inverse variances of the priors on the searched scale; 0 where there is none."""
    if getattr(problem, "spread", None) is None:
        return np.zeros(len(problem.searched))
    return 1.0 / np.asarray(problem.spread) ** 2


def _log_slopes(problem: Any, free: np.ndarray) -> np.ndarray:
    """(p,) derivative of log |value| by what is searched: 1 for a logarithm."""
    return np.array(
        [1.0 if p.transform == "log" else 1.0 / _unit(x) for p, x in zip(problem.searched, free, strict=True)]
    )


def _day_scores(errors: np.ndarray, jacobian: np.ndarray, day: np.ndarray) -> np.ndarray:
    """(D, p) half gradient of every day's sum of squares."""
    rows = jacobian * errors[:, None]
    return np.array([rows[day == d].sum(axis=0) for d in range(day[-1] + 1)])


def _day_hessians(problem: Any, free: np.ndarray, day: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """(D, p, p) half Hessian of every day's sum of squares, from differences of exact gradients."""
    out = np.empty((day[-1] + 1, len(free), len(free)))
    for q in range(len(free)):
        shift = step * np.eye(len(free))[q]
        above, below = problem.linearised(free + shift), problem.linearised(free - shift)
        up, down = _day_scores(above[0], above[1], day), _day_scores(below[0], below[1], day)
        out[:, :, q] = (up - down) / (2.0 * step)
    return 0.5 * (out + out.transpose(0, 2, 1))


def _positive(matrix: np.ndarray) -> bool:
    """Whether a matrix is positive definite by more than rounding, whatever the units of its rows."""
    diagonal = np.diag(matrix)
    if not (np.isfinite(matrix).all() and (diagonal > 0).all()):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(scale[:, None] * matrix * scale)[0] > 1e-9)


def _without(jacobian: np.ndarray, place: Sequence[int]) -> np.ndarray:
    """Columns ``place`` of a Jacobian, less what the other columns can follow."""
    others = [j for j in range(jacobian.shape[1]) if j not in set(place)]
    chosen = jacobian[:, list(place)]
    if not others:
        return chosen
    rest = jacobian[:, others]
    norms = np.linalg.norm(rest, axis=0)
    rest = rest / np.where(norms > 0, norms, 1.0)
    return chosen - rest @ np.linalg.lstsq(rest, chosen, rcond=1e-10)[0]


# ----------------------------------------------------------------------------------------------------------- periodic
def periodic_doubt(
    problem: Any,
    free: np.ndarray,
    theta: Mapping[str, float],
    turn: Mapping[str, np.ndarray],
    parameters: Sequence[Parameter],
) -> ParameterUncertainty:
    """What a fit of the periodic model leaves open.

    Parameters
    ----------
    problem : PeriodicProblem
    free : ndarray of shape (p,)
        Its optimum on the searched scale.
    theta : mapping of parameter to value
        Searched, fixed and inner parameters at the optimum.
    turn : mapping of parameter to ndarray of shape (J,)
        Derivatives of the parameters that are solved inside, by the inner coefficients.
    parameters : sequence of Parameter
        The network's.

    Returns
    -------
    ParameterUncertainty
    """
    _, _, linear = problem.evaluate(free)
    p, J = len(free), len(linear.beta)
    hessian, dbeta = problem.hessian(free) if p else (np.zeros((0, 0)), np.zeros((J, 0)))
    outer = inverse_information(hessian)
    searched = {q.name: i for i, q in enumerate(problem.searched)}
    decided = tuple(q for q in parameters if q.name in searched or np.any(turn.get(q.name, 0.0)))
    by_free, by_beta = np.zeros((len(decided), p)), np.zeros((len(decided), J))
    slopes = _log_slopes(problem, free)
    for i, q in enumerate(decided):
        if q.name in searched:
            by_free[i, searched[q.name]] = slopes[searched[q.name]]
        else:
            by_beta[i] = turn[q.name] / _unit(theta[q.name])
    by_beta *= linear.free  # a coefficient that its sign holds at 0 stays there
    chain = by_free + by_beta @ dbeta
    model = chain @ outer @ chain.T + by_beta @ linear.covariance @ by_beta.T
    days = day_of_rows(len(problem.experiment.y), problem.experiment.hours)
    n_days = int(days[-1]) + 1
    moves = np.zeros((0, len(decided)))
    if len(decided) and n_days >= _FEW_DAYS:
        parts = days // -(-n_days // MOST_PARTS)
        moves = _moves_without_days(problem, free, linear.beta, outer, parts) @ np.hstack([chain, by_beta]).T
    data = hessian - np.diag(prior_precision(problem))
    information = _joint_information(data, dbeta, linear, problem.n_plain, by_free, by_beta)
    information = _without_scale(information, problem, decided)
    values, vectors = np.linalg.eigh(information) if len(decided) else (np.zeros(0), np.zeros((0, 0)))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return ParameterUncertainty(decided, root, model, jackknife_covariance(moves @ held_subspace(model)), n_days)


def _without_scale(information: np.ndarray, problem: Any, decided: Sequence[Parameter]) -> np.ndarray:
    """Without what the prior of the gain says of the scale of the building, where no row and no user fixes it."""
    experiment = problem.experiment
    columns = dict(zip(problem.network.inputs(experiment.roles), experiment.inputs.T, strict=False))
    idle = {s.parameter for s in problem.network.sources(experiment.roles) if not np.any(columns[s.role])}
    fixes = [name for name in problem.fixed if name[0] in "CRAQ" and name not in idle]
    if fixes or any(role.startswith("Q_") and np.any(columns[role]) for role in columns):
        return information
    way = np.array([-1.0 if p.name[0] == "R" else 1.0 if p.name[0] in "CAQ" else 0.0 for p in decided])
    way /= max(float(np.linalg.norm(way)), 1.0)
    across = np.eye(len(way)) - np.outer(way, way)
    return across @ information @ across


def _moves_without_days(
    problem: Any, free: np.ndarray, beta: np.ndarray, outer: np.ndarray, days: np.ndarray
) -> np.ndarray:
    """(D, p + J) moves of the searched parameters, and of the inner coefficients beyond what those explain."""
    moves = []
    for d in range(days[-1] + 1):
        y = problem.experiment.y.copy()
        if not np.isfinite(y[days == d]).any():
            continue
        y[days == d] = np.nan
        left = replace(problem, experiment=problem.experiment._replace(y=y))
        _, slope, linear = left.evaluate(free)
        moves.append(np.concatenate([-outer @ slope, linear.beta - beta]))
    return np.array(moves)


def _joint_information(
    data: np.ndarray, dbeta: np.ndarray, linear: Any, n_plain: int, by_free: np.ndarray, by_beta: np.ndarray
) -> np.ndarray:
    """(k, k) information of the data about the logarithms of the network's parameters, all others free to follow.

    ``data`` (p, p) is the Hessian of the objective with the inner coefficients at their optimum, without the prior.
    """
    plain = np.flatnonzero(linear.free[:n_plain])
    normal = linear.normal
    rest = np.arange(n_plain, len(normal))
    cross = normal[np.ix_(plain, rest)]
    inner = normal[np.ix_(plain, plain)] - cross @ np.linalg.solve(normal[np.ix_(rest, rest)], cross.T)
    D = dbeta[plain]
    joint = np.block([[data + D.T @ inner @ D, -D.T @ inner], [-inner @ D, inner]])
    turn = np.hstack([by_free, by_beta[:, plain]])
    if not len(turn):
        return np.zeros((0, 0))
    back = np.hstack([np.linalg.pinv(turn), null_space(turn)])
    turned, k = back.T @ joint @ back, len(turn)
    cross = turned[:k, k:]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(turned)[k:], 1e-12))
    nuisance = scale[:, None] * turned[k:, k:] * scale
    values, vectors = np.linalg.eigh(nuisance)
    held = values > 1e-9
    reduced = (cross * scale) @ vectors[:, held]
    return turned[:k, :k] - (reduced / values[held]) @ reduced.T
