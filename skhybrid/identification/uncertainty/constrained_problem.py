"""Constrained problem of a fitted identification: some parameters held, all else as in the fit."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.base import clone

from ..._arguments import refuse_without
from ..._table import ZoneTable
from ..._threads import one_blas_thread
from ..._warnings import ignore, warnings_to
from ...thermal import get_network


@dataclass(frozen=True)
class ConstrainedProblem:
    """A fitted identification and its training table; with a parameter held, all else stays as in the fit."""

    estimator: Any
    table: ZoneTable
    y: Any

    @classmethod
    def of(cls, estimator: Any, X: Any, y: Any) -> ConstrainedProblem:
        """With the estimator fitted, which is done here where it is not; refuses one that minimises no likelihood."""
        refuse_without(estimator, "innovations", "an identification, such as OutputDisturbanceID")
        if getattr(estimator, "objective", "one_step") != "one_step":
            raise ValueError(
                f'{type(estimator).__name__} with objective="multi_step" has no likelihood, as its errors overlap; '
                'take theta_interval, or fit with objective="one_step".'
            )
        fitted = hasattr(estimator, "theta_")
        with warnings_to(ignore) if fitted else nullcontext():  # the fit has warned of it
            table = clone(estimator)._read(X, get_network(estimator.network), reset=True)
        if not fitted:
            estimator = clone(estimator).fit(table, y)
        return cls(estimator, table, y)

    @one_blas_thread
    def problem(self, held: Mapping[str, float] | None = None, *, search_all: bool = False) -> Any:
        """The problem with some parameters held; ``search_all`` leaves none to be solved inside."""
        held, fitted = dict(held or {}), self.estimator
        priors = {k: v for k, v in (fitted.priors or {}).items() if k not in held}
        bounds = dict(fitted.bounds or {})
        probe = clone(fitted).set_params(known={**(fitted.known or {}), **held}, priors=priors)
        if search_all:
            bounds = {p.name: (p.lower, p.upper) for p in fitted.parameters_} | bounds
        probe.set_params(bounds={name: ends for name, ends in bounds.items() if name not in probe.known})
        with warnings_to(ignore):  # the fit has warned of it
            return fitted._problem_of(probe, *probe._prepare(self.table, self.y))


def free_point(problem: Any, values: Mapping[str, float]) -> np.ndarray:
    """(p,) values by name on the searched scale, within the bounds."""
    out = []
    for p in problem.searched:
        low, high = p.free_bounds
        value = values.get(p.name, p.default)
        usable = p.transform != "log" or value * p.sign > 0
        out.append(min(max(p.to_free(value if usable else p.default), low), high))
    return np.array(out)
