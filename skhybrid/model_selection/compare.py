"""Comparison of identifications on the same rows, in one table, with a recommendation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from .._arguments import check_level, check_n_jobs
from .._warnings import first_sentence
from ..identification import Diagnostics
from .assessment import assess
from .recommendation import FORMATS, comparison_table, likelihood_ratio_tests, ranked, recommend
from .splitters import default_split


@dataclass(frozen=True)
class ModelComparison:
    """Comparison of several identifications.

    Attributes
    ----------
    table : DataFrame
        One row per model, the recommended one first, then by the deciding column: ``n_parameters``;
        ``log_likelihood``, ``aic`` and ``bic`` of the one-step errors on rows that all models predict;
        ``cv_log_score`` (mean log density of a held-out row, one step ahead) and ``cv_rmse`` (of held-out forecasts
        over the horizon) [K]; ``whiteness_p`` and ``acf_outside`` of the training errors; ``condition`` of the
        sensitivity, ``at_bound``, ``flat`` and ``not_excited`` parameters; ``seconds`` of the fit.
    tests : DataFrame
        One row per nested pair: ``smaller``, ``larger``, ``extra`` parameters, ``statistic``, ``distribution`` and
        ``p_value`` of the likelihood ratio, and whether the errors of at least one are ``white``, as it presumes.
    recommended : str
        Name of the recommended model.
    reason : str, why it is recommended
    errors : dict of name to str, why a model, or a part of its assessment, failed
    estimators : dict of name to fitted estimator
    diagnostics : dict of name to Diagnostics
    """

    table: pd.DataFrame
    tests: pd.DataFrame
    recommended: str
    reason: str
    errors: dict[str, str] = field(default_factory=dict)
    estimators: dict[str, Any] = field(default_factory=dict)
    diagnostics: dict[str, Diagnostics] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [self._shown().to_string()]
        if len(self.tests):
            parts.append("nested pairs:\n" + self.tests.to_string(index=False, float_format=lambda v: f"{v:.3g}"))
        parts += [f"{name} failed: {what}" for name, what in self.errors.items()]
        return "\n".join([*parts, f"recommended: {self.recommended}. {self.reason}"])

    def _repr_html_(self) -> str:
        html = f"<p><b>{escape(str(self.recommended))}</b>: {escape(self.reason)}</p>{self._shown().to_html(border=0)}"
        if len(self.tests):
            html += self.tests.to_html(border=0, index=False, float_format=lambda v: f"{v:.3g}")
        return html + "".join(f"<p>{escape(name)} failed: {escape(what)}</p>" for name, what in self.errors.items())

    def _shown(self) -> pd.DataFrame:
        shown = self.table.copy()
        for column, form in FORMATS.items():
            shown[column] = [form.format(v) if np.isfinite(v) else "-" for v in shown[column].astype(float)]
        return shown.drop(columns="not_excited") if not any(shown["not_excited"]) else shown


def compare_models(
    estimators: Mapping[str, Any] | Iterable[Any],
    X: Any,
    y: Any,
    *,
    cv: Any = None,
    horizon: Any = "1D",
    origin_step: Any = "6h",
    purpose: str = "parameters",
    level: float = 0.05,
    n_jobs: int | None = None,
) -> ModelComparison:
    """Fit identifications on the same rows, compare them and recommend one; one that fails does not stop the others.

    Parameters
    ----------
    estimators : mapping of name to identification, or iterable of identifications
        The classes, networks and settings to choose from, not fitted.  They are cloned.
    X : DataFrame or array-like of shape (n_samples, n_features)
        Consecutive rows; a DataFrame without ``T_za`` gets it from y.
    y : array-like of shape (n_samples,)
        Measured zone temperature [degC]; NaN where missing.
    cv : splitter, optional
        With ``split(X)`` into consecutive rows, the test after the training.  By default two test blocks at the end,
        each a sixth of the table in whole days, each with all rows before it as training; none where the table is too
        short for that.
    horizon, origin_step : timedelta-like, default="1D" and "6h"
        Horizon and distance of the origins of the held-out forecasts, as in :func:`backtest`.
    purpose : {"parameters", "forecast"}
        What decides between models that are not nested: the held-out log score one step ahead, as parameters are found
        by one-step errors, or the held-out error over the horizon.
    level : float, default=0.05
        Level of the likelihood-ratio tests.
    n_jobs : int, optional
        Number of models assessed in parallel; it changes nothing but ``seconds``.

    Returns
    -------
    ModelComparison
        The table, the tests, the recommended model and the reason.

    Raises
    ------
    ValueError
        If there is no estimator, two have the same name, ``purpose`` is unknown, ``level`` is not between 0 and 1, X
        has no time stamps and ``cv`` is not given, the splits of ``cv`` are not in time order, or no model can be
        fitted.

    Notes
    -----
    *Likelihood.*  The log density of the errors of each model's own predictor, ``innovations``, as independent normal
    with the model's own standard deviations, over the rows that all models predict.  CONV does not predict one step
    ahead: its density assumes white noise around its simulation, which unmeasured heat violates and so lowers.

    *Parameters.*  All parameters of the network and of the disturbance that are not known, the variance of the errors,
    and every cell of a weekly profile, which AIC and BIC penalise too much since it is smooth.

    *Likelihood ratio.*  For pairs of the same class and settings where the smaller network is the larger one without
    some resistors, or has more parameters ``known``.  An infinite resistance is at the edge of its range, so that the
    statistic for one resistor is 0 half of the time: a mixture of chi-squares (Self and Liang, 1987), binomial for
    several.  The test presumes white errors, and is conservative if the upper bound of the resistance is low.

    Examples
    --------
    >>> from skhybrid import OutputDisturbanceID
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.model_selection import compare_models
    >>> office = make_office(n_days=8, random_state=0)
    >>> sizes = {name: OutputDisturbanceID(name, known={"Q_h": 6.0}, n_starts=2, random_state=0)
    ...          for name in ("1R1C", "2R2C")}
    >>> compare_models(sizes, office.X, office.y).recommended
    '2R2C'
    """
    candidates = _named(estimators)
    if purpose not in ("parameters", "forecast"):
        raise ValueError(f"purpose={purpose!r} is neither 'parameters' nor 'forecast'.")
    check_level(level)
    check_n_jobs(n_jobs)
    if isinstance(cv, str) or not (cv is None or hasattr(cv, "split")):
        raise ValueError(f"cv={cv!r} must be a splitter into consecutive rows, such as RollingOriginSplit().")
    splitter = default_split(X, horizon) if cv is None else cv
    splits = [] if splitter is None else list(splitter.split(X))
    _refuse_disorder(splits, cv)
    found = Parallel(n_jobs=n_jobs)(
        delayed(assess)(estimator, X, y, splits, horizon, origin_step) for estimator in candidates.values()
    )
    done = dict(zip(candidates, found, strict=True))
    errors = {name: one.error for name, one in done.items() if one.error}
    fitted = {name: one for name, one in done.items() if one.density is not None}
    if not fitted:
        name, cause = next(iter(errors.items()))
        raise ValueError(f"no model could be fitted, not even {name} ({first_sentence(cause)}).")
    table = comparison_table(fitted)
    tests = likelihood_ratio_tests(fitted, table)
    name, reason = recommend(fitted, table, tests, purpose, level)
    table = table.loc[[name, *(other for other in ranked(table, purpose) if other != name)]]
    models = {name: one.estimator for name, one in fitted.items()}
    diagnostics = {name: one.diagnostics for name, one in fitted.items() if one.diagnostics is not None}
    return ModelComparison(table, tests, name, reason, errors, models, diagnostics)


def _refuse_disorder(splits: Iterable[tuple[np.ndarray, np.ndarray]], cv: Any) -> None:
    """Refuse splits whose blocks have gaps, or whose training does not end before the test."""
    for train, test in splits:
        in_order = all(len(rows) and (np.diff(rows) == 1).all() for rows in (train, test))
        if not in_order or train[-1] >= test[0]:
            raise ValueError(
                f"cv={cv!r} does not test on consecutive rows after those of the training, which are consecutive too; "
                "give a splitter in time order, such as RollingOriginSplit()."
            )


def _named(estimators: Mapping[str, Any] | Iterable[Any]) -> dict[str, Any]:
    """Candidates by name: the given one, or class and network."""
    if hasattr(estimators, "fit") or not isinstance(estimators, Iterable):
        raise ValueError(f"estimators is one {type(estimators).__name__}; give a list of those to compare.")
    estimators = [estimators] if isinstance(estimators, str) else estimators
    given = dict(estimators) if isinstance(estimators, Mapping) else dict(enumerate(estimators))
    if not given:
        raise ValueError("there is no estimator to compare: pass at least one.")
    for estimator in given.values():
        if not hasattr(estimator, "innovations"):
            shown = repr(estimator) if isinstance(estimator, str) else f"a {type(estimator).__name__}"
            raise TypeError(
                f"estimators holds {shown}, which identifies no network; give identifications, such as "
                "PeriodicDisturbanceID('2R2C'), or compare forecasts with backtest."
            )
    if isinstance(estimators, Mapping):
        return {str(name): estimator for name, estimator in given.items()}
    names = [f"{type(e).__name__} {getattr(e.network, 'name', e.network)}" for e in given.values()]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"two estimators are called {twice[0]}: pass a mapping of name to estimator.")
    return dict(zip(names, given.values(), strict=True))
