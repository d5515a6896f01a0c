"""Bayesian comparison of the errors of cases over their sizes (paper 3.3, Eqs. 24 and 25)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import ndtr
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..._arguments import check_level, draw_seed, store_arguments
from ..._table import listed
from ..._transaction import unchanged_on_failure
from ..._warnings import warn_user
from ...exceptions import SkhybridWarning
from ...forecasting.quantiles import quantile_columns
from ...identification.uncertainty import posterior
from .results_table import finished

_ADVICE = "or give the cases more sizes"
_FEW = 6
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_ONE_PER_CASE = ("framework", "disturbance")  # columns of a results table that must not differ within a case


class RobustnessComparison(BaseEstimator):
    """Compare the errors of each case over its sizes with those of the best case (paper 3.3).

    The errors of a case over its sizes are log-normal, ``log(rmse) ~ Normal(mu, sigma)``, with the paper's priors
    ``mu ~ Normal(0, 10)`` and ``sigma ~ HalfNormal(1)`` (Eq. 24).  The best case is the one with the lowest
    median; it is compared with each other case by the posterior predictive probability that its error is lower
    (Eq. 25).  All cases are sampled in one PyMC model.

    Parameters
    ----------
    by : str or sequence of str, default="case"
        Columns that name the case of a row; ``("name", "disturbance")`` for the table of a search.
    level : float, default=0.95
        A case is indistinguishable from the best if the probability is below this.
    draws, tune, chains : int, default=500, 500 and 4
        Draws kept from each chain, draws before them that tune the sampler, and chains (at least 2).
    random_state : int or RandomState, optional
        Seed; global random states are neither read nor changed.

    Attributes
    ----------
    best_ : str
        Case with the lowest median error; with several columns in ``by``, their values joined by a blank.
    probability_ : Series
        P(best case < case), by case in order of median error; 0.5 for the best itself.
    indistinguishable_ : list of str
        The best case and those that are indistinguishable from it, in order of median error.
    median_ : Series, median error of each case over its sizes [K], in increasing order
    difference_ : DataFrame, quantiles of the predicted error of the best case minus that of each case [K]
    summary_ : DataFrame
        One row per case: ``mu`` and ``sigma`` (posterior means), ``n_sizes``, the worse ``r_hat`` and ``ess`` of both.
    draws_ : dict of str to DataFrame, ``"mu"`` and ``"sigma"``: one column per case, index (``chain``, ``draw``)
    errors_ : Series, the compared errors [K], by case

    Notes
    -----
    The probability compares two *new* errors, each of a size not yet tried, not two medians: cases that overlap much
    stay indistinguishable for any number of sizes.  It is averaged over the draws in closed form.
    """

    def __init__(
        self, *, by: str | Sequence[str] = "case", level: float = 0.95, draws: int = 500, tune: int = 500,
        chains: int = 4, random_state: int | None = None,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    @unchanged_on_failure
    def fit(self, results: pd.DataFrame) -> RobustnessComparison:
        """Sample the posterior of all cases and compare them with the best.

        Parameters
        ----------
        results : DataFrame
            One row per candidate: the columns of ``by``, and ``rmse`` [K].  Candidates without an error are left out,
            with a warning.

        Raises
        ------
        ValueError
            If a column is missing, an error is not positive, all errors of a case are equal, or a case contains
            candidates of several frameworks or kinds of disturbance.
        RuntimeError
            If the chains disagree, have too few effective draws, or diverge even with small steps.
        """
        check_level(self.level, 0.5)
        posterior.check_sampling(self.draws, self.tune, self.chains)
        errors = _errors_by_case(results, [self.by] if isinstance(self.by, str) else list(self.by))
        spreads = _spreads(errors)
        drawn, summary = self._sample(spreads)
        self.errors_, self.median_, self.draws_, self.summary_ = errors, spreads.medians, drawn, summary
        self.best_ = str(spreads.medians.index[0])
        mu, sigma = drawn["mu"], drawn["sigma"]
        self.probability_ = _probability_of_lower(mu, sigma, self.best_)
        below = self.probability_ < self.level
        self.indistinguishable_ = list(below.index[below])
        self.difference_ = _difference(mu, sigma, self.best_, np.random.default_rng(draw_seed(self.random_state)))
        return self

    def probability_below(self, case: str, error: float) -> float:
        """Posterior predictive probability that a case has an error below a given one.

        Parameters
        ----------
        case : str, one of those in ``median_``
        error : float, such as that of a baseline without sizes [K]

        Raises
        ------
        ValueError
            If the case is unknown, or the error is not a positive number.
        """
        check_is_fitted(self)
        if case not in self.median_.index:
            raise ValueError(f"case {case!r} is not one of those compared: {listed(self.median_.index)}.")
        if not 0.0 < error < np.inf:
            raise ValueError(f"error={error!r} is not a positive number [K].")
        mu, sigma = (self.draws_[name][case].to_numpy() for name in ("mu", "sigma"))
        return float(ndtr((np.log(error) - mu) / sigma).mean())

    def _sample(self, spreads: _Spreads) -> tuple[dict[str, pd.DataFrame], pd.DataFrame]:
        """Draws of ``mu`` and ``sigma`` of every case, and the summary; bad chains raise."""
        model, start = _model(spreads)
        data, n_divergent = posterior.draw_without_divergence(
            model,
            start,
            draws=self.draws,
            tune=self.tune,
            chains=self.chains,
            random_state=self.random_state,
            # few sizes leave the spread a skewed posterior, which takes smaller steps
            accept=(0.8, 0.99) if spreads.n.min() >= _FEW else (0.97, 0.995),
        )
        index = posterior.draws_index(self.chains, self.draws)
        cases = spreads.medians.index
        drawn = {
            name: pd.DataFrame(data.posterior[name].to_numpy().reshape(len(index), -1), index=index, columns=cases)
            for name in ("mu", "sigma")
        }
        mu, sigma = (posterior.summarise_chains(drawn[name]) for name in ("mu", "sigma"))
        both = pd.concat([mu.rename(index="mu of {}".format), sigma.rename(index="sigma of {}".format)])
        posterior.refuse_bad_chains(both, _ADVICE, n_divergent)
        summary = {
            "mu": mu["mean"],
            "sigma": sigma["mean"],
            "n_sizes": spreads.n.astype(int),
            "r_hat": np.maximum(mu["r_hat"], sigma["r_hat"]),
            "ess": np.minimum(mu["ess"], sigma["ess"]),
        }
        return drawn, pd.DataFrame(summary)


class _Spreads(NamedTuple):
    """Sufficient statistics of the logarithms of the errors, by case in order of median error."""

    medians: pd.Series  # of the errors themselves [K]
    n: np.ndarray  # (n_cases,)
    mean: np.ndarray  # (n_cases,)
    squares: np.ndarray  # (n_cases,) sum of squares about the mean


def _errors_by_case(results: pd.DataFrame, by: list[str]) -> pd.Series:
    table = finished(results, by)
    for column in by:
        if table[column].isna().any():
            row = table[column].isna().idxmax()
            raise ValueError(f"{column} of row {row!r} is empty; leave out rows without a case, such as baselines.")
    keys = table[by].astype(str).agg(" ".join, axis=1)
    for column in set(_ONE_PER_CASE) & set(table.columns) - set(by):
        mixed = table[column].groupby(keys).nunique()
        if (mixed > 1).any():
            raise ValueError(
                f"{' '.join(by)} {mixed.idxmax()!r} contains candidates with {mixed.max()} values of {column!r}; pass "
                "by=('name', 'disturbance')."
            )
    return pd.Series(table["rmse"].to_numpy(), index=pd.Index(keys, name="case"), name="rmse")


def _spreads(errors: pd.Series) -> _Spreads:
    medians = errors.groupby(level=0).median().sort_values(kind="stable")
    groups = np.log(errors).groupby(level=0)
    n = groups.size().reindex(medians.index)
    squares = ((n - 1) * groups.var()).fillna(0.0).reindex(medians.index)
    equal = (n > 1) & (squares < 1e-18 * n)
    if equal.any():
        case = equal.idxmax()
        raise ValueError(
            f"all {n[case]} errors of {case!r} are equal, as where no size uses the correction by its network, but a "
            "log-normal distribution needs a spread; leave the case out, or search with residual_of=None."
        )
    if (n == 1).all():
        warn_user(
            "every case has one size, so that the spread of its errors is the prior's; give the cases more sizes.",
            SkhybridWarning,
        )
    return _Spreads(medians, n.to_numpy(float), groups.mean().reindex(medians.index).to_numpy(), squares.to_numpy())


def _model(spreads: _Spreads) -> tuple[Any, dict[str, np.ndarray]]:
    """The PyMC model of Eq. 24, and the start of its chains.

    The sufficient statistics ``mean ~ Normal(mu, sigma / sqrt(n))`` and ``squares / sigma^2 ~ chi2(n - 1)`` replace the
    ``n`` errors.  ``mu`` is sampled as ``mean + sigma z / sqrt(n)``, so that a case of few sizes has no funnel.
    """
    pm = posterior.import_pymc()
    n, mean, squares = spreads.n, spreads.mean, spreads.squares
    spread = np.flatnonzero(n > 1)
    with pm.Model() as model:
        sigma = pm.HalfNormal("sigma", 1.0, shape=len(n))
        z = pm.Normal("z", shape=len(n))
        mu = pm.Deterministic("mu", mean + sigma * z / np.sqrt(n))
        pm.Potential("prior_of_mu", pm.logp(pm.Normal.dist(0.0, 10.0), mu))
        if len(spread):
            pm.Gamma("squares", 0.5 * (n[spread] - 1.0), 0.5 / sigma[spread] ** 2, observed=squares[spread])
    guess = np.sqrt(np.maximum(squares, 1e-12) / np.maximum(n - 1.0, 1.0))
    return model, {"sigma": np.where(n > 1, guess, 0.5), "z": np.zeros(len(n))}


def _probability_of_lower(mu: pd.DataFrame, sigma: pd.DataFrame, best: str) -> pd.Series:
    """P(best case < case): given a draw of mu and sigma, the difference of two log errors is normal."""
    ahead = mu.to_numpy() - mu[[best]].to_numpy()
    wide = np.hypot(sigma.to_numpy(), sigma[[best]].to_numpy())
    return pd.Series(ndtr(ahead / wide).mean(axis=0), index=mu.columns, name="probability")


def _difference(mu: pd.DataFrame, sigma: pd.DataFrame, best: str, rng: np.random.Generator) -> pd.DataFrame:
    """Quantiles of the predicted error of the best case minus that of each case [K]."""
    of_best = np.exp(mu[best].to_numpy() + sigma[best].to_numpy() * rng.standard_normal(len(mu)))
    others = np.exp(mu.to_numpy() + sigma.to_numpy() * rng.standard_normal(mu.shape))
    quantiles = np.quantile(of_best[:, None] - others, _QUANTILES, axis=0).T
    return pd.DataFrame(quantiles, index=mu.columns, columns=quantile_columns(_QUANTILES))
