"""Which identification, which network: every candidate on the same rows, in one table, with a recommendation."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy import stats
from sklearn.base import clone

from ..identification import Diagnostics, diagnose
from .backtest import backtest
from .nested import likelihood_ratio, nesting
from .splitters import RollingOriginSplit, default_blocks

#: columns of the table and how many digits they need
_FORMATS = {
    "n_parameters": "{:.0f}",
    "log_likelihood": "{:.1f}",
    "aic": "{:.1f}",
    "bic": "{:.1f}",
    "cv_log_score": "{:.3f}",
    "cv_rmse": "{:.3f}",
    "whiteness_p": "{:.2g}",
    "acf_outside": "{:.2f}",
    "condition": "{:.2g}",
    "seconds": "{:.1f}",
}
_PURPOSES = ("parameters", "forecast")


@dataclass(frozen=True)
class ModelComparison:
    """Candidates side by side.

    Attributes
    ----------
    table : DataFrame
        One row a model, the recommended one first, then by what decides: ``n_parameters``, ``log_likelihood``, ``aic``
        and ``bic`` of the one-step errors on rows that all models predict; ``cv_log_score`` (mean log density of a
        held-out row, one step ahead) and ``cv_rmse`` (of held-out forecasts over the horizon) [K]; ``whiteness_p`` and
        ``acf_outside`` of the training errors; ``condition`` of the sensitivity, ``at_bound``, ``flat`` and
        ``not_excited`` parameters; ``seconds`` of the fit.
    tests : DataFrame
        One row a nested pair: ``smaller``, ``larger``, ``extra`` parameters, ``statistic``, ``distribution`` and
        ``p_value`` of the likelihood ratio, and whether the errors of either are ``white``, which it presumes.
    recommended : str or None
        Name of the recommended model; None where all failed.
    reason : str
        Why, in words.
    errors : dict of name to str
        What stopped a model, or a part of its assessment.
    estimators : dict of name to fitted estimator
    diagnostics : dict of name to Diagnostics
    """

    table: pd.DataFrame
    tests: pd.DataFrame
    recommended: str | None
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
        for column, form in _FORMATS.items():
            shown[column] = [form.format(v) if np.isfinite(v) else "-" for v in shown[column].astype(float)]
        return shown.drop(columns="not_excited") if not any(shown["not_excited"]) else shown


@dataclass(frozen=True)
class _Assessed:
    """What one candidate gave."""

    row: dict[str, Any] = field(default_factory=dict)
    estimator: Any = None
    density: pd.Series | None = None  # log density of every measured training row
    held_out: pd.Series | None = None  # of every held-out row
    forecasts: pd.DataFrame | None = None
    diagnostics: Diagnostics | None = None
    error: str = ""


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
    """Fit candidates on the same rows and say which to take.

    Parameters
    ----------
    estimators : mapping of name to identification, or iterable of identifications
        Not fitted; the classes, networks and settings to choose from.  They are cloned.
    X : DataFrame or array-like of shape (n_samples, n_features)
        Consecutive rows; a DataFrame without ``T_za`` gets it from y.
    y : array-like of shape (n_samples,)
        Measured zone temperature [degC]; NaN where missing.
    cv : splitter, optional
        With ``split(X)`` into consecutive rows.  By default two test blocks at the end, each a sixth of the table in
        whole days, behind all rows before them; none where the table is too short for that.
    horizon, origin_step : timedelta-like, default="1D" and "6h"
        Of the held-out forecasts, as in :func:`backtest`.
    purpose : {"parameters", "forecast"}
        What decides among models that no test relates: the held-out log score one step ahead, by which parameters are
        found, or the held-out error over the horizon.
    level : float, default=0.05
        Of the likelihood-ratio tests.
    n_jobs : int, optional
        Models assessed in parallel; all but ``seconds`` is the same under any number.

    Returns
    -------
    ModelComparison
        Print it.  A model that fails is named in ``errors``; the others go on.

    Raises
    ------
    ValueError
        If there is no estimator, two bear one name, or ``purpose`` is unknown.

    Notes
    -----
    *Likelihood.*  The log density of the errors of each model's own predictor, ``innovations``, as independent normal
    with the model's own standard deviations, over the rows that all models predict.  CONV does not predict one step
    ahead: its errors are those of a simulation, its density that of white noise around it, which is what its least
    squares presume.  Where unmeasured heat comes and goes that density is low, and rightly so.  Of several measured
    temperatures the densities are added as if independent.

    *Parameters.*  Those of the network and of the disturbance that were searched or solved, the variance of the errors,
    and every cell of a weekly profile, although a profile is smooth: AIC and BIC are hard on it.  The held-out columns
    need no count.

    *Likelihood ratio.*  For pairs of one class and settings where the smaller network is the larger one without some
    resistors (a resistance of infinity), or the smaller one has more parameters ``known``.  A resistance at infinity
    is at the edge of what it can be, so that the statistic of one is 0 half of the time: a mixture of chi-squares
    (Self and Liang, 1987), binomial for several.  It presumes white errors, and is conservative where the upper bound
    of the resistance (``bounds=``) lies well short of infinity.

    *Held out.*  A model that is fitted on a training block predicts the rows behind it, one step ahead or from origins
    within the test block, and reads no measurement after the row or the origin from which it predicts.

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
    if purpose not in _PURPOSES:
        raise ValueError(f"purpose={purpose!r} is neither 'parameters' nor 'forecast'.")
    splits = _splits(cv, X, horizon)
    found = Parallel(n_jobs=n_jobs)(
        delayed(_assess)(estimator, X, y, splits, horizon, origin_step) for estimator in candidates.values()
    )
    done = dict(zip(candidates, found, strict=True))
    errors = {name: one.error for name, one in done.items() if one.error}
    fitted = {name: one for name, one in done.items() if one.density is not None}
    if not fitted:
        empty = pd.DataFrame(columns=[*_FORMATS, "at_bound", "flat", "not_excited"])
        return ModelComparison(empty, _tests({}, empty), None, "no model could be fitted.", errors)
    table = _table(fitted)
    tests = _tests(fitted, table)
    name, reason = _recommend(fitted, table, tests, purpose, level)
    column, rising = _decisive(table, purpose)
    order = table.sort_values(column, ascending=rising, kind="stable").index
    table = table.loc[[name, *(other for other in order if other != name)]]
    return ModelComparison(
        table,
        tests,
        name,
        reason,
        errors,
        {name: one.estimator for name, one in fitted.items()},
        {name: one.diagnostics for name, one in fitted.items() if one.diagnostics is not None},
    )


def _named(estimators: Mapping[str, Any] | Iterable[Any]) -> dict[str, Any]:
    """Candidates by name: as given, or the class and its network."""
    if isinstance(estimators, Mapping):
        out = {str(name): estimator for name, estimator in estimators.items()}
    else:
        given = list(estimators)
        names = [f"{type(e).__name__} {getattr(e.network, 'name', e.network)}" for e in given]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two estimators are a {twice[0]}: pass a mapping of name to estimator.")
        out = dict(zip(names, given, strict=True))
    if not out:
        raise ValueError("there is no estimator to compare: pass at least one.")
    return out


def _splits(cv: Any, X: Any, horizon: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    if cv is not None:
        return list(cv.split(X))
    blocks = default_blocks(X, horizon)
    if blocks is None:
        return []
    train, test = blocks
    return list(RollingOriginSplit(train=train, test=test, n_splits=2, expanding=True).split(X))


# ------------------------------------------------------------------------------------------------------ one candidate
def _assess(
    estimator: Any,
    X: Any,
    y: Any,
    splits: list[tuple[np.ndarray, np.ndarray]],
    horizon: Any,
    origin_step: Any,
) -> _Assessed:
    """Fit, diagnose and hold out; what stops one of these is recorded."""
    try:
        table = _with_target(estimator, X, y)
        begin = time.perf_counter()
        model = clone(estimator).fit(table, y)
        seconds = time.perf_counter() - begin
        density = log_density(model.innovations(table))
        found = diagnose(model, table)
    except Exception as problem:  # one model's failure must not end the comparison
        return _Assessed(error=f"{type(problem).__name__}: {problem}")
    row = _facts(model) | {"whiteness_p": found.whiteness, "acf_outside": found.share_outside, "seconds": seconds}
    scores, frames = [], []
    try:
        for train, test in splits:
            score, frame = _hold_out(estimator, table, y, train, test, horizon, origin_step)
            scores.append(score)
            frames.append(frame)
    except Exception as problem:
        error = f"held-out part: {type(problem).__name__}: {problem}"
        return _Assessed(row, model, density, diagnostics=found, error=error)
    if not splits:
        return _Assessed(row, model, density, diagnostics=found)
    return _Assessed(row, model, density, pd.concat(scores), pd.concat(frames), found)


def _with_target(estimator: Any, X: Any, y: Any) -> Any:
    if not isinstance(X, pd.DataFrame) or "T_za" in X or "T_za" in dict(estimator.columns or {}) or np.ndim(y) != 1:
        return X
    return X.assign(T_za=np.asarray(y, dtype=np.float64))


def log_density(innovations: pd.DataFrame) -> pd.Series:
    """Log density of every row's errors, as independent normal with the model's own standard deviations."""
    half = innovations.shape[1] // 2  # a column an output, then their standard deviations
    error, std = innovations.to_numpy()[:, :half], innovations.to_numpy()[:, half:]
    each = stats.norm.logpdf(error, scale=std)
    total = np.where(np.isfinite(each).any(axis=1), np.nansum(each, axis=1), np.nan)
    return pd.Series(total, index=innovations.index)


def _hold_out(
    estimator: Any, X: Any, y: Any, train: np.ndarray, test: np.ndarray, horizon: Any, origin_step: Any
) -> tuple[pd.Series, pd.DataFrame]:
    """Log densities of the test rows and forecasts from origins among them, by a model that saw the training rows."""
    model = clone(estimator).fit(_rows(X, train), _rows(y, train))
    span = np.arange(train[0], test[-1] + 1)
    shown, first = _rows(X, span), int(test[0] - train[0])
    score = log_density(model.innovations(shown)).iloc[first:]
    start = shown.index[first] if isinstance(getattr(shown, "index", None), pd.DatetimeIndex) else first
    frame = backtest(model, shown, _rows(y, span), horizon=horizon, origin_step=origin_step, start=start)
    return score, frame


def _rows(values: Any, rows: np.ndarray) -> Any:
    return values.iloc[rows] if hasattr(values, "iloc") else np.asarray(values)[rows]


def _facts(model: Any) -> dict[str, Any]:
    """What a fitted model says of itself."""
    told, known = model.identifiability_, set(dict(model.known or {}))
    own = [name for name in model.disturbance_.index if name not in known]
    if "rho_gap" in own:  # rho_2 follows from it
        own.remove("rho_2")
    searched = [name for name in model.theta_.index if name not in known and name not in told.not_excited]
    cells = int(np.size(getattr(model, "profile_", ())))
    variance = 0 if "sigma_y" in model.disturbance_.index else 1
    singular = told.singular_values
    return {
        "n_parameters": len(searched) + len(own) + cells + variance,
        "condition": float(singular.iloc[0] / max(singular.iloc[-1], 1e-300)) if len(singular) else 1.0,
        "at_bound": ", ".join(told.at_bound),
        "flat": "; ".join(map(str, told.flat_directions)),
        "not_excited": ", ".join(told.not_excited),
    }


# ------------------------------------------------------------------------------------------------------- all together
def _table(fitted: Mapping[str, _Assessed]) -> pd.DataFrame:
    common = pd.concat([one.density for one in fitted.values()], axis=1).notna().all(axis=1).to_numpy()
    n, rows = int(common.sum()), {}
    for name, one in fitted.items():
        assert one.density is not None  # only such models are passed
        value, k = float(one.density[common].sum()), one.row["n_parameters"]
        rows[name] = one.row | {
            "log_likelihood": value,
            "aic": 2.0 * k - 2.0 * value,
            "bic": np.log(n) * k - 2.0 * value,
            "cv_log_score": np.nan if one.held_out is None else float(one.held_out.mean()),
            "cv_rmse": np.nan if one.forecasts is None else float(np.sqrt(_squares(one.forecasts).mean())),
        }
    columns = [*(c for c in _FORMATS if c != "seconds"), "at_bound", "flat", "not_excited", "seconds"]
    return pd.DataFrame.from_dict(rows, orient="index")[columns].rename_axis("model")


def _squares(frame: pd.DataFrame) -> pd.Series:
    return (frame["y_pred"] - frame["y_true"]) ** 2


def _tests(fitted: Mapping[str, _Assessed], table: pd.DataFrame) -> pd.DataFrame:
    rows = []
    for small, first in fitted.items():
        for large, second in fitted.items():
            extra = nesting(first.estimator, second.estimator) if small != large else None
            if extra is None:
                continue
            gain = _number(table, large, "log_likelihood") - _number(table, small, "log_likelihood")
            statistic, distribution, p_value = likelihood_ratio(gain, len(extra.at_edge), len(extra.inside))
            white = max(_number(table, name, "whiteness_p") for name in (small, large)) > 0.01
            names = ", ".join((*extra.at_edge, *extra.inside))
            rows.append((small, large, names, statistic, distribution, p_value, white))
    columns = ["smaller", "larger", "extra", "statistic", "distribution", "p_value", "white"]
    return pd.DataFrame(rows, columns=columns)


def _number(table: pd.DataFrame, name: str, column: str) -> float:
    return float(table[column].to_numpy(dtype=np.float64)[table.index.get_loc(name)])


def _decisive(table: pd.DataFrame, purpose: str) -> tuple[str, bool]:
    """The column that decides, and whether less is better."""
    column, rising = ("cv_rmse", True) if purpose == "forecast" else ("cv_log_score", False)
    return (column, rising) if table[column].notna().all() else ("bic", True)


def _recommend(
    fitted: Mapping[str, _Assessed], table: pd.DataFrame, tests: pd.DataFrame, purpose: str, level: float
) -> tuple[str, str]:
    """Nested ones by their tests, the others by what decides, the simpler one where the difference is no larger than
    its standard error."""
    said, left = [], list(table.index)
    for test in tests.to_dict("records"):
        larger = test["p_value"] < level
        loser = test["smaller"] if larger else test["larger"]
        if loser in left and len(left) > 1:
            left.remove(loser)
        doubt = "" if test["white"] or not larger else ", overstated since their errors are not white"
        what = f"need {test['extra']}" if larger else f"do not need {test['extra']}"
        said.append(f"The data {what} ({test['larger']} against {test['smaller']}, p = {test['p_value']:.2g}{doubt}).")
    column, rising = _decisive(table, purpose)
    best = str(table.loc[left, column].sort_values(ascending=rising, kind="stable").index[0])
    chosen = best
    for other in sorted(left, key=lambda name: _number(table, name, "n_parameters")):
        if _number(table, other, "n_parameters") >= _number(table, best, "n_parameters"):
            break
        if _as_good(fitted[other], fitted[best], column):
            chosen = other
            break
    value = _number(table, best, column)
    words = {
        "cv_rmse": f"smallest held-out forecast error, {value:.3g} K",
        "cv_log_score": f"highest held-out log score one step ahead, {value:.3f} a row",
        "bic": f"lowest BIC, {value:.1f} (nothing was held out for every model)",
    }[column]
    among = "Of those left, " if len(left) < len(table) else ""
    said.append(f"{among}{best} has the {words}.")
    if chosen != best:
        said.append(f"{chosen} has fewer parameters and is as good within the standard error of the difference.")
    return chosen, " ".join([*said, *_caveats(chosen, table, purpose)])


def _caveats(chosen: str, table: pd.DataFrame, purpose: str) -> list[str]:
    row, out = table.loc[[chosen]].to_dict("records")[0], []
    if row["whiteness_p"] < 0.01:
        out.append("Its errors are not white: see diagnose().")
    if row["flat"]:
        out.append(f"The data do not fix {row['flat']}.")
    if row["at_bound"]:
        out.append(f"At a bound: {row['at_bound']}.")
    if purpose == "parameters" and table["cv_rmse"].notna().all():
        other = str(table["cv_rmse"].idxmin())
        if other != chosen:
            told = f"{table['cv_rmse'].min():.3g} K against {row['cv_rmse']:.3g} K"
            out.append(f"For forecasts alone {other} did better ({told}).")
    return out


def _as_good(other: _Assessed, best: _Assessed, column: str) -> bool:
    """Whether the mean difference, by days (log score) or by origins (forecasts), is within one standard error."""
    if column == "cv_log_score" and other.held_out is not None and best.held_out is not None:
        worse = (best.held_out.to_numpy() - other.held_out.to_numpy()).astype(np.float64)
        index = best.held_out.index
        group = index.normalize() if isinstance(index, pd.DatetimeIndex) else np.arange(len(index)) // 96
    elif column == "cv_rmse" and other.forecasts is not None and best.forecasts is not None:
        worse = (_squares(other.forecasts) - _squares(best.forecasts)).to_numpy()
        group = best.forecasts["origin"].to_numpy()
    else:
        return False
    means = pd.Series(worse).groupby(np.asarray(group)).mean().dropna()
    return len(means) > 2 and float(means.mean()) < float(means.std() / np.sqrt(len(means)))
