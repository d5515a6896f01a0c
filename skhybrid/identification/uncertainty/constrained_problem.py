"""The problem behind a fitted identification, posed again: for profiles and posteriors."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from ..._threads import one_blas_thread
from ..fitting.periodic_likelihood import PeriodicProblem


@dataclass(frozen=True)
class ConstrainedProblem:
    """A fitted identification and the table that it was fitted on.

    Where a parameter is held, everything else about the problem stays as it was in the fit: the same bounds, the same
    priors on the others and, in the periodic model, the same unit of heat, so that losses can be compared.
    """

    estimator: Any
    X: Any
    y: Any

    @classmethod
    def of(cls, estimator: Any, X: Any, y: Any) -> ConstrainedProblem:
        """With the estimator fitted, which is done here where it is not.

        Raises
        ------
        ValueError
            If what the estimator minimises is no likelihood.
        """
        if getattr(estimator, "objective", "one_step") != "one_step":
            raise ValueError(
                f'{type(estimator).__name__} with objective="multi_step" has no likelihood, as its errors overlap; '
                'take theta_interval, or fit with objective="one_step".'
            )
        if not hasattr(estimator, "theta_"):
            estimator = clone(estimator).fit(X, y)
        check_is_fitted(estimator)
        return cls(estimator, X, y)

    def refuse_unsearched(self, parameter: str) -> None:
        """Raise where a parameter was not identified."""
        fitted = self.estimator
        if parameter not in fitted.theta_.index:
            names = ", ".join(fitted.theta_.index)
            raise ValueError(f"{parameter!r} is no parameter of the network, which has {names}.")
        if parameter in (fitted.known or {}):
            raise ValueError(f"{parameter} is given by known=, so the data have no say in it; drop it there.")
        if parameter in fitted.identifiability_.not_excited:
            raise ValueError(f"{parameter} is moved by no row of the table, so there is nothing to profile.")

    @one_blas_thread
    def problem(self, held: Mapping[str, float] | None = None, *, search_all: bool = False) -> Any:
        """The problem with some parameters held; ``search_all`` leaves none to be solved inside."""
        held, fitted = dict(held or {}), self.estimator
        probe = clone(fitted)
        probe.set_params(known={**(fitted.known or {}), **held})
        probe.set_params(priors={k: v for k, v in (fitted.priors or {}).items() if k not in held})
        if search_all:
            bounds = {p.name: (p.lower, p.upper) for p in fitted.parameters_ if p.name not in probe.known}
            probe.set_params(bounds={**bounds, **(fitted.bounds or {})})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the fit has said it
            problem, _ = probe._make_problem(*probe._prepare(self.X, self.y))
        if isinstance(problem, PeriodicProblem):
            problem = replace(problem, heat_scale=self._heat_scale)
            problem = problem if fitted.gain_found_ else problem.without_gain()
        return problem

    @cached_property
    def _heat_scale(self) -> float:
        """Unit of heat of the fit, read from the table once."""
        probe = clone(self.estimator)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            problem, _ = probe._make_problem(*probe._prepare(self.X, self.y))
        return float(problem.heat_scale)

    def values(self) -> dict[str, float]:
        """Everything that the fit found, in the units that are searched."""
        fitted = self.estimator
        found = {**fitted.theta_.to_dict(), **fitted.disturbance_.to_dict()}
        if hasattr(fitted, "day_factors_"):
            found |= {f"day_{d}": value for d, value in enumerate(np.log(fitted.day_factors_))}
        own = fitted._own_parameters()
        scaled = [p.name for p in own if p.unit == "6 kW plant"]
        if scaled:
            scale = self._heat_scale
            found |= {name: found[name] / scale for name in scaled}
        return {name: float(value) for name, value in found.items()}


def free_point(problem: Any, values: Mapping[str, float]) -> np.ndarray:
    """(p,) values by name on the searched scale, within the bounds."""
    out = []
    for p in problem.searched:
        low, high = p.free_bounds
        value = values.get(p.name, p.default)
        usable = p.transform != "log" or value * p.sign > 0
        out.append(min(max(p.to_free(value if usable else p.default), low), high))
    return np.array(out)


def minimum_near(problem: Any, start: np.ndarray) -> tuple[np.ndarray, float]:
    """The minimum that one start leads to, and minus twice the log-likelihood there, up to a constant."""
    if isinstance(problem, PeriodicProblem):
        found = problem.minimise(start) if len(start) else None
        loss = found.loss if found else problem.evaluate(start)[0]
        return found.free if found else start, 2.0 * float(loss)
    if not len(start):
        return start, problem.n_counted * float(np.log(np.sum(problem.residuals(start) ** 2)))
    (least,) = problem.minimise(start[None])
    return least.free, problem.n_counted * float(np.log(least.loss))


def all_values(problem: Any, free: np.ndarray) -> dict[str, float]:
    """Values of searched, fixed and inner parameters at a point."""
    values = problem.values(free)
    if isinstance(problem, PeriodicProblem):
        from ..periodic import physical

        values = physical(problem, values, problem.evaluate(free)[2].beta)[0]
    return {name: float(value) for name, value in values.items()}
