"""Samples of the posterior: PyMC's NUTS on the exact likelihood and its exact gradient."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit, logit

from ..._arguments import check_integer, draw_seed
from ..._threads import one_blas_thread
from ...thermal.parameters import search_bounds
from .constrained_problem import ConstrainedProblem, free_point

WORST_R_HAT, FEWEST_EFFECTIVE = 1.05, 100.0  # a chain is refused above this R-hat, or below this many effective draws
_MARGIN = 1e-3  # how near a bound the search for the starting point may come, as a share of the range
_STEP = 1e-4  # of the sampler's coordinates, for differences of gradients
_WIDEST = 3.0  # largest standard deviation that the scaling of the sampler assumes along any direction


@dataclass(frozen=True)
class Posterior:
    """Draws of :func:`sample_posterior`, and their summary.

    Attributes
    ----------
    draws : DataFrame of shape (n_chains * n_draws, n_parameters)
        Network and disturbance parameters, index (``chain``, ``draw``).
    summary : DataFrame
        One row per parameter: ``mean``, ``std``, ``median``, ``lower`` and ``upper`` (90 %), ``r_hat``, ``ess``.
    inference_data : arviz.InferenceData
        The same with the sampler's own statistics, for ArviZ.
    """

    draws: pd.DataFrame
    summary: pd.DataFrame
    inference_data: Any


class _Density:
    """Log posterior of a problem, and its gradient, over unbounded coordinates ``z``, about standard normal for NUTS.

    The searched scale is ``x = low + (high - low) * expit(centre + root @ z)``.
    """

    def __init__(self, problem: Any, start: np.ndarray) -> None:
        self.problem = problem
        self.low, self.high = search_bounds(problem.searched)
        share = np.clip((start - self.low) / (self.high - self.low), _MARGIN, 1.0 - _MARGIN)
        self.centre, self.root = logit(share), np.eye(len(start))
        self.root = self._scaling()

    def free(self, z: np.ndarray) -> np.ndarray:
        """(..., p) on the searched scale."""
        return self.low + (self.high - self.low) * expit(self.centre + z @ self.root.T)

    def __call__(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        share = expit(self.centre + self.root @ z)
        slope = (self.high - self.low) * share * (1.0 - share)
        value, gradient = self.problem.log_density(self.low + (self.high - self.low) * share)
        if not np.isfinite(value):
            return -np.inf, np.zeros_like(z)
        volume = float(np.log(np.maximum(slope, 1e-300)).sum())
        return value + volume, self.root.T @ (gradient * slope + 1.0 - 2.0 * share)

    def _scaling(self) -> np.ndarray:
        """(p, p) root of the inverse Hessian at the start, by differences of exact gradients."""
        p = len(self.centre)
        hessian = np.empty((p, p))
        for q, shift in enumerate(_STEP * np.eye(p)):
            hessian[q] = (self(-shift)[1] - self(shift)[1]) / (2.0 * _STEP)
        values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
        return vectors / np.sqrt(np.maximum(values, _WIDEST**-2))


@one_blas_thread
def sample_posterior(
    estimator: Any,
    X: Any,
    y: Any,
    *,
    draws: int = 1000,
    tune: int = 500,
    chains: int = 4,
    random_state: int | None = None,
    progressbar: bool = False,
) -> Posterior:
    """Sample the posterior of all parameters under the estimator's ``priors``.

    Parameters
    ----------
    estimator : identification of a network
        Fitted on ``X`` and ``y``; one that is not fitted is cloned and fitted.
    X, y : array-like
        As in ``fit``.
    draws, tune : int
        Draws of each chain that are kept, and those before them that adapt the sampler.
    chains : int, default=4
        At least 2, else ValueError: only a second chain shows whether the first one mixes.
    random_state : int or RandomState, optional
        Seed of the sampler.
    progressbar : bool, default=False

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        If a number of draws is impossible, there is one chain only, or the estimator searches no parameter or has no
        likelihood (``objective="multi_step"``).
    RuntimeError
        If the chains disagree (R-hat above 1.05) or amount to fewer than 100 independent draws.

    Notes
    -----
    PyMC comes with ``pip install "skhybrid[bayes]"``.  A parameter without a prior has a uniform one on the searched
    scale within its bounds.  The noise of CONV, ID and OD is integrated out under ``1 / sigma``, as is the weekly
    profile of the periodic model.  The posterior assumes that the disturbance model holds; ``theta_interval`` does not.
    """
    check_sampling(draws, tune, chains)
    import_pymc()  # before a search that may take minutes
    constrained = ConstrainedProblem.of(estimator, X, y)
    problem = constrained.problem(search_all=True)
    if not problem.searched:
        raise ValueError("the estimator searches no parameter, so nothing can be sampled; leave some out of known=.")
    start, _ = problem.minimum_near(free_point(problem, constrained.estimator._searched_values()))
    density = _Density(problem, start)
    settings = {"draws": draws, "tune": tune, "chains": chains, "progressbar": progressbar}
    data = _run_nuts(density, random_state=random_state, **settings)
    free = density.free(data.posterior["z"].to_numpy())
    columns = {
        p.name: (p.sign * np.exp(x) if p.transform == "log" else x).ravel()
        for p, x in zip(problem.searched, np.moveaxis(free, -1, 0), strict=True)
    }
    table = constrained.estimator._reported(pd.DataFrame(columns, index=draws_index(chains, draws)))
    for name in table:
        data.posterior[name] = (("chain", "draw"), table[name].to_numpy().reshape(chains, draws))
    summary = summarise_chains(table)
    refuse_bad_chains(summary, "or give a prior to what identifiability_ calls flat or at a bound")
    return Posterior(table, summary, data)


def _run_nuts(density: _Density, **settings: Any) -> Any:
    pm = import_pymc()
    import pytensor.tensor as pt

    log_density = _make_op(density)
    with pm.Model() as model:
        z = pm.Flat("z", shape=len(density.centre))
        pm.Potential("log_density", log_density(pt.as_tensor_variable(z)))
    return draw_chains(model, {"z": np.zeros(len(density.centre))}, **settings)


def draws_index(chains: int, draws: int) -> pd.MultiIndex:
    """Index (``chain``, ``draw``) of a table of draws, one chain after the other."""
    return pd.MultiIndex.from_product([range(chains), range(draws)], names=["chain", "draw"])


def check_sampling(draws: int, tune: int, chains: int) -> None:
    """Refuse numbers of draws that no sampler can make, and a lone chain."""
    for name, value, least in (("draws", draws, 1), ("tune", tune, 0), ("chains", chains, 1)):
        check_integer(name, value, least)
    if chains < 2:
        raise ValueError(f"chains={chains} is less than 2; only a second chain shows whether the first one mixes.")


def import_pymc() -> Any:
    """PyMC, or an error that says how to install it."""
    try:
        with warnings.catch_warnings():
            # PyMC imports ArviZ, which announces its next version once a day
            warnings.filterwarnings("ignore", message=r"\s*ArviZ is undergoing", category=FutureWarning)
            import pymc
    except ImportError as error:
        raise ImportError('sampling needs PyMC; install it with pip install "skhybrid[bayes]".') from error
    return pymc


def draw_chains(model: Any, start: Mapping[str, Any], *, random_state: int | None, **settings: Any) -> Any:
    """Run NUTS, chain by chain so that draws do not depend on the cores; ``settings`` are those of ``pymc.sample``."""
    settings = {"progressbar": False, "compute_convergence_checks": False, "cores": 1, "init": "adapt_diag", **settings}
    pm = import_pymc()
    log = logging.getLogger("pymc")
    level = log.level
    log.setLevel(logging.WARNING)  # else PyMC announces every sampler
    try:
        with warnings.catch_warnings():
            # these models have next to no matrix products, so that a missing BLAS costs nothing
            warnings.filterwarnings("ignore", message="PyTensor could not link to a BLAS")
            return pm.sample(model=model, initvals=dict(start), random_seed=draw_seed(random_state), **settings)
    finally:
        log.setLevel(level)


def _make_op(density: _Density) -> Any:
    """PyTensor Ops of the log density and of its gradient, which share one evaluation per point."""
    import pytensor.tensor as pt
    from pytensor.graph.op import Op

    last: dict[bytes, tuple[float, np.ndarray]] = {}

    def evaluated(z: np.ndarray) -> tuple[float, np.ndarray]:
        key = z.tobytes()
        if key not in last:
            last.clear()
            last[key] = density(z)
        return last[key]

    class Gradient(Op):
        itypes, otypes = [pt.dvector], [pt.dvector]

        def perform(self, node, inputs, outputs):
            outputs[0][0] = evaluated(inputs[0])[1].copy()

    class LogDensity(Op):
        itypes, otypes = [pt.dvector], [pt.dscalar]

        def perform(self, node, inputs, outputs):
            outputs[0][0] = np.array(evaluated(inputs[0])[0])

        def grad(self, inputs, output_gradients):
            return [output_gradients[0] * gradient(inputs[0])]

    gradient = Gradient()
    return LogDensity()


def draw_without_divergence(
    model: Any, start: Mapping[str, Any], *, accept: Sequence[float] = (0.8, 0.99), **settings: Any
) -> tuple[Any, int]:
    """Run :func:`draw_chains` with each ``target_accept`` of ``accept`` until no draw diverges.

    Returns the draws of the last run, and how many of them diverged.
    """
    for target in accept:
        data = draw_chains(model, start, target_accept=target, **settings)
        n_divergent = int(data.sample_stats["diverging"].sum())
        if not n_divergent:
            break
    return data, n_divergent


def summarise_chains(table: pd.DataFrame, level: float = 0.9) -> pd.DataFrame:
    """Statistics by row of every column of a table indexed (``chain``, ``draw``); the interval has ``level``."""
    import arviz as az

    tail, chains = 0.5 * (1.0 - level), table.index.get_level_values("chain").nunique()
    out = {}
    for name, column in table.items():
        by_chain = column.to_numpy().reshape(chains, -1)
        spread = column.mean(), column.std(), column.median(), column.quantile(tail), column.quantile(1.0 - tail)
        out[name] = (*spread, float(az.rhat(by_chain)), float(az.ess(by_chain)))
    names = ["mean", "std", "median", "lower", "upper", "r_hat", "ess"]
    return pd.DataFrame.from_dict(out, orient="index", columns=names)


def refuse_bad_chains(summary: pd.DataFrame, advice: str, n_divergent: int = 0) -> None:
    """Raise RuntimeError, with ``advice``, where chains disagree, have too few effective draws or diverged."""
    worst, fewest = summary["r_hat"].idxmax(), summary["ess"].idxmin()
    r_hat, ess = float(summary["r_hat"].max(skipna=False)), float(summary["ess"].min(skipna=False))
    if not r_hat <= WORST_R_HAT:
        found = f"the chains disagree about {worst} (R-hat {r_hat:.2f}, at most {WORST_R_HAT})"
        raise RuntimeError(f"{found}; raise tune= and draws=, {advice}.")
    if not ess >= FEWEST_EFFECTIVE:
        found = f"the draws of {fewest} are worth {ess:.0f} independent ones, fewer than {FEWEST_EFFECTIVE:.0f}"
        raise RuntimeError(f"{found}; raise draws=.")
    if n_divergent:
        found = f"{n_divergent} draws diverged, so that the chains may have missed a part of the posterior"
        raise RuntimeError(f"{found}; raise tune=, {advice}.")
