"""Bayesian regression of the error on the ingredients of a disturbance model (paper 3.3, Eq. 23)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..._arguments import check_bool, check_integer, check_level, check_rate, store_arguments
from ..._transaction import unchanged_on_failure
from ...forecasting import ModelCase
from ...identification.uncertainty import posterior
from .regression_terms import RegressionTerms, build_terms
from .results_table import finished

_ADVICE = "or leave out terms that the table hardly separates"


class PatternExpressiveness(BaseEstimator):
    """Regress the error of candidates on their ingredients or sizes (paper 3.3 and 4.2).

    ``rmse = level + sum(effect * term) + noise``, sampled with PyMC.  The share of an effect's draws below zero is the
    probability that the term reduces the error.

    Parameters
    ----------
    terms : "ingredients", "sizes" or sequence of str, default="ingredients"
        ``"ingredients"`` is Eq. 23: ``framework`` (one term for each but the reference), ``time``,
        ``pattern``, ``past-w``, ``future-w`` and ``ID``.  ``"sizes"`` takes the size hyper-parameters in the table.
        A list names ingredients or columns of the table; a column of categories has one term for each category but
        the first.
    interactions : "all" or sequence of (str, str), default=()
        Pairs of entries of ``terms`` with a joint effect, such as ``[("framework", "time")]``.
    cases : iterable of ModelCase, default=()
        The caller's own cases in the table; the paper's are known.
    best_sizes : int, optional
        Use only this many candidates of each framework, case and disturbance, those with the lowest errors.
    group : str or sequence of str, optional
        Columns whose rows share an unexplained part of their error, such as ``("name", "disturbance")``.  By default
        none, as in the paper: each size of a case counts as a separate observation, so intervals are too narrow.
    log : bool, default=False
        Regress log(rmse): ``exp(effect)`` is then the factor by which a term changes the error.
    prior_scale : float, default=10.0
        Width of the priors; see Notes.
    level : float, default=0.9
        Probability of the interval from ``lower`` to ``upper``.
    draws, tune, chains : int, default=1000, 500 and 4
        Draws kept from each chain, draws before them that tune the sampler, and chains (at least 2).
    random_state : int or RandomState, optional
        Seed; global random states are neither read nor changed.

    Attributes
    ----------
    summary_ : DataFrame
        One row per term: ``mean``, ``std``, ``median``, ``lower``, ``upper`` of its effect [K per unit of the term],
        ``probability_reduces``, ``r_hat``, ``ess``.
    draws_ : DataFrame
        Effects, ``intercept`` (the error where every term is at its average), ``sigma`` (of the noise), and
        ``sigma_group`` where there are groups; index (``chain``, ``draw``).
    reference_ : dict of str to str
        Category that the terms of a column are compared with, such as ``{"framework": "mlp"}``.
    left_out_ : dict of str to str, terms whose effect cannot be estimated from the table, and why
    priors_ : dict of str to str, the priors as text
    n_candidates_ : int, number of rows used

    Notes
    -----
    *Priors.*  Terms are centred and, for the prior, scaled to standard deviation one.  Effects and intercept (less the
    mean error) are ``Normal(0, prior_scale * sigma)``, ``sigma^2 ~ InverseGamma(1/2, s^2/2)`` with ``s`` the standard
    deviation of the errors: the conjugate normal-inverse-gamma, worth one observation.  With groups,
    ``sigma_group ~ HalfNormal(s)``, and effects are ``Normal(0, prior_scale * sqrt(sigma^2 + sigma_group^2))``.
    """

    def __init__(
        self, terms: str | Sequence[str] = "ingredients", *, interactions: str | Sequence[tuple[str, str]] = (),
        cases: Iterable[ModelCase] = (), best_sizes: int | None = None, group: str | Sequence[str] | None = None,
        log: bool = False, prior_scale: float = 10.0, level: float = 0.9, draws: int = 1000, tune: int = 500,
        chains: int = 4, random_state: int | None = None,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    @unchanged_on_failure
    def fit(self, results: pd.DataFrame) -> PatternExpressiveness:
        """Sample the posterior of the effects.

        Parameters
        ----------
        results : DataFrame
            One row per candidate: ``rmse`` [K], and the columns for ``terms``: ``framework``, ``case`` and
            ``disturbance`` for ingredients, else the named ones.  Rows without a case (baselines) have no ingredients
            and are left out; so are candidates without an error, with a warning.

        Raises
        ------
        ValueError
            If a name is unknown, an error is not positive, or there are fewer candidates than terms.
        RuntimeError
            If the chains disagree, have too few effective draws, or diverge even with small steps.
        """
        self._check_parameters()
        table = finished(results).reset_index(drop=True)
        terms = build_terms(table, self.terms, self.interactions, tuple(self.cases), self.best_sizes)
        y = np.log(terms.rmse) if self.log else terms.rmse
        y_scale = float(y.std(ddof=1))
        if not y_scale > 0.0:
            raise ValueError(f"all {len(y)} errors are equal; there is nothing to explain.")
        groups = self._groups(table, terms)
        draws, n_divergent = self._sample(terms, y, y_scale, groups)
        summary = posterior.summarise_chains(draws, self.level)
        posterior.refuse_bad_chains(summary, _ADVICE, n_divergent)
        effects = summary.loc[list(terms.columns)]
        effects.insert(5, "probability_reduces", (draws[list(terms.columns)] < 0.0).mean())
        self.draws_, self.summary_ = draws, effects
        self.reference_, self.left_out_ = terms.reference, terms.left_out
        self.n_candidates_ = len(y)
        self.priors_ = _priors_as_text(self.prior_scale, y_scale, groups is not None)
        return self

    def _check_parameters(self) -> None:
        posterior.check_sampling(self.draws, self.tune, self.chains)
        check_level(self.level)
        check_rate("prior_scale", self.prior_scale)
        if self.best_sizes is not None:
            check_integer("best_sizes", self.best_sizes)
        check_bool("log", self.log)

    def _groups(self, table: pd.DataFrame, terms: RegressionTerms) -> np.ndarray | None:
        """Number of the group of each row, or None without groups."""
        if self.group is None:
            return None
        columns = [self.group] if isinstance(self.group, str) else list(self.group)
        for column in columns:
            if column not in table:
                raise ValueError(f"group names {column!r}, which is not a column of results.")
        groups = table.loc[terms.used].groupby(columns, dropna=False).ngroup().to_numpy()
        n_groups = groups.max() + 1
        if not 2 <= n_groups < len(groups):
            raise ValueError(
                f"group makes {n_groups} groups of {len(groups)} candidates; give columns that make at least two "
                "groups, one of them with several rows."
            )
        return groups

    def _sample(
        self, terms: RegressionTerms, y: pd.Series, y_scale: float, groups: np.ndarray | None
    ) -> tuple[pd.DataFrame, int]:
        """Draws by name, in the units of the table, and the number of divergences."""
        centred = terms.columns - terms.columns.mean()
        scale = centred.std(ddof=0)
        X = np.column_stack([np.ones(len(y)), centred / scale])
        y_mean = float(y.mean())
        model, start = regression_model(X, y.to_numpy() - y_mean, y_scale, self.prior_scale, groups)
        data, n_divergent = posterior.draw_without_divergence(
            model, start, draws=self.draws, tune=self.tune, chains=self.chains, random_state=self.random_state
        )
        index = posterior.draws_index(self.chains, self.draws)
        drawn = {name: data.posterior[name].to_numpy().reshape(len(index), -1) for name in data.posterior}
        draws = pd.DataFrame(drawn["coefficients"][:, 1:] / scale.to_numpy(), index=index, columns=list(scale.index))
        draws["intercept"] = drawn["coefficients"][:, 0] + y_mean
        draws["sigma"] = np.sqrt(drawn["variance"][:, 0])
        if groups is not None:
            draws["sigma_group"] = drawn["sigma_group"][:, 0]
        return draws, n_divergent


def regression_model(
    X: np.ndarray, y: np.ndarray, y_scale: float, prior_scale: float, groups: np.ndarray | None = None
) -> tuple[Any, dict[str, Any]]:
    """The PyMC model of Eq. 23, and the start of its chains.

    X (n_candidates, 1 + n_terms) is a column of ones and the standardised terms, y (n_candidates,) the errors less
    their mean, and ``y_scale`` their standard deviation.  The unexplained part of each group is integrated out:
    deviations from the group means have the variance ``variance``, the means ``sigma_group^2 + variance / n``.
    """
    pm = posterior.import_pymc()
    with pm.Model() as model:
        variance = pm.InverseGamma("variance", 0.5, 0.5 * y_scale**2)
        start = {"variance": y_scale**2, "coefficients": np.zeros(X.shape[1])}
        if groups is None:
            total = variance
        else:
            sigma_group = pm.HalfNormal("sigma_group", y_scale)
            total, start["sigma_group"] = variance + sigma_group**2, 0.5 * y_scale
        coefficients = pm.Normal("coefficients", 0.0, prior_scale * total**0.5, shape=X.shape[1])
        if groups is None:
            _observe_rows(pm, X, y, len(y), coefficients, variance)
        else:
            n = np.bincount(groups).astype(float)
            X_mean = np.column_stack([np.bincount(groups, column) / n for column in X.T])
            y_mean = np.bincount(groups, y) / n
            spread = (sigma_group**2 + variance / n) ** 0.5
            pm.Normal("means", (X_mean * coefficients).sum(axis=1), spread, observed=y_mean)
            _observe_rows(pm, X - X_mean[groups], y - y_mean[groups], len(y) - len(n), coefficients, variance)
    return model, start


def _observe_rows(pm: Any, X: np.ndarray, y: np.ndarray, n_free: int, coefficients: Any, variance: Any) -> None:
    """``y ~ Normal(X @ coefficients, variance)`` of ``n_free`` independent rows, by ``Q.T y`` and the residual of y."""
    Q, s, Vt = np.linalg.svd(X, full_matrices=False)
    rank = int((s > 1e-10 * max(s[0], 1.0)).sum())
    if rank:
        Q, R = Q[:, :rank], s[:rank, None] * Vt[:rank]
        pm.Normal("fitted", (R * coefficients).sum(axis=1), variance**0.5, observed=Q.T @ y)
        y = y - Q @ (Q.T @ y)
    if n_free > rank:
        pm.Gamma("residual", 0.5 * (n_free - rank), 0.5 / variance, observed=y @ y)


def _priors_as_text(prior_scale: float, y_scale: float, grouped: bool) -> dict[str, str]:
    noise = "sqrt(sigma^2 + sigma_group^2)" if grouped else "sigma"
    priors = {
        "effects": f"Normal(0, {prior_scale:g} {noise}) for one standard deviation of the term",
        "intercept": f"Normal(mean error, {prior_scale:g} {noise})",
        "sigma": f"sigma^2 ~ InverseGamma(0.5, {0.5 * y_scale**2:.4g})",
    }
    return priors | ({"sigma_group": f"HalfNormal({y_scale:.4g})"} if grouped else {})
