"""The table of a comparison, its likelihood-ratio tests, and the recommendation."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from .._time import rows_per_day
from .assessment import Assessment

#: numbers of the table and their formats
FORMATS = {
    "n_parameters": "{:.0f}", "log_likelihood": "{:.1f}", "aic": "{:.1f}", "bic": "{:.1f}", "cv_log_score": "{:.3f}",
    "cv_rmse": "{:.3f}", "whiteness_p": "{:.2g}", "acf_outside": "{:.2f}", "condition": "{:.2g}", "seconds": "{:.1f}",
}  # fmt: skip


def comparison_table(fitted: Mapping[str, Assessment]) -> pd.DataFrame:
    """One row per model; likelihoods over the rows that all models predict."""
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
    columns = [*(c for c in FORMATS if c != "seconds"), "at_bound", "flat", "not_excited", "seconds"]
    return pd.DataFrame.from_dict(rows, orient="index")[columns].rename_axis("model")


def _squares(frame: pd.DataFrame) -> pd.Series:
    return (frame["y_pred"] - frame["y_true"]) ** 2


def likelihood_ratio_tests(fitted: Mapping[str, Assessment], table: pd.DataFrame) -> pd.DataFrame:
    """One row per nested pair."""
    rows = []
    for small, large in permutations(fitted, 2):
        extra = nesting(fitted[small].estimator, fitted[large].estimator)
        if extra is not None:
            gain = table["log_likelihood"][large] - table["log_likelihood"][small]
            found = likelihood_ratio(gain, len(extra.at_edge), len(extra.inside))
            white = max(table["whiteness_p"][small], table["whiteness_p"][large]) > 0.01
            rows.append((small, large, ", ".join((*extra.at_edge, *extra.inside)), *found, white))
    return pd.DataFrame(rows, columns=["smaller", "larger", "extra", "statistic", "distribution", "p_value", "white"])


def ranked(table: pd.DataFrame, purpose: str) -> pd.Index:
    """Names of all models, the best by the deciding column first."""
    column, rising = _decisive(table, purpose)
    return table.sort_values(column, ascending=rising, kind="stable").index


def _decisive(table: pd.DataFrame, purpose: str) -> tuple[str, bool]:
    """The deciding column, and whether less is better."""
    column, rising = ("cv_rmse", True) if purpose == "forecast" else ("cv_log_score", False)
    return (column, rising) if table[column].notna().all() else ("bic", True)


def recommend(
    fitted: Mapping[str, Assessment], table: pd.DataFrame, tests: pd.DataFrame, purpose: str, level: float
) -> tuple[str, str]:
    """Name of the recommended model, and the reason: tests decide between nested models, else the deciding column."""
    reasons, left = [], list(table.index)
    for test in tests.to_dict("records"):
        larger = test["p_value"] < level
        loser = test["smaller"] if larger else test["larger"]
        if loser in left and len(left) > 1:
            left.remove(loser)
        doubt = "" if test["white"] or not larger else ", overstated since their errors are not white"
        what = f"need {test['extra']}" if larger else f"do not need {test['extra']}"
        reasons.append(
            f"The data {what} ({test['larger']} against {test['smaller']}, p = {test['p_value']:.2g}{doubt})."
        )
    column, rising = _decisive(table, purpose)
    best = str(table.loc[left, column].sort_values(ascending=rising, kind="stable").index[0])
    among = "Of those left, " if len(left) < len(table) else ""
    reasons.append(f"{among}{best} has the {_in_words(column, table[column][best])}.")
    chosen = _simplest(fitted, table, left, best, column)
    if chosen != best:
        reasons.append(f"{chosen} has fewer parameters and is as good within the standard error of the difference.")
    return chosen, " ".join([*reasons, *_caveats(chosen, table, purpose)])


def _simplest(fitted: Mapping[str, Assessment], table: pd.DataFrame, left: list[str], best: str, column: str) -> str:
    """The model with the fewest parameters that is as good as the best."""
    for other in table.loc[left, "n_parameters"].sort_values(kind="stable").index:
        if table["n_parameters"][other] >= table["n_parameters"][best]:
            break
        if _within_standard_error(fitted[other], fitted[best], column):
            return other
    return best


def _in_words(column: str, value: float) -> str:
    return {
        "cv_rmse": f"smallest held-out forecast error, {value:.3g} K",
        "cv_log_score": f"highest held-out log score one step ahead, {value:.3f} per row",
        "bic": f"lowest BIC, {value:.1f} (not every model has held-out results)",
    }[column]


def _caveats(chosen: str, table: pd.DataFrame, purpose: str) -> list[str]:
    row, out = table.loc[[chosen]].to_dict("records")[0], []
    if row["whiteness_p"] < 0.01:
        out.append("Its errors are not white: see diagnose().")
    if row["flat"]:
        out.append(f"The data do not determine {row['flat']}.")
    if row["at_bound"]:
        out.append(f"At a bound: {row['at_bound']}.")
    if purpose == "parameters" and table["cv_rmse"].notna().all():
        other = str(table["cv_rmse"].idxmin())
        if other != chosen:
            errors = f"{table['cv_rmse'].min():.3g} K against {row['cv_rmse']:.3g} K"
            out.append(f"For forecasts alone {other} is better ({errors}).")
    return out


def _within_standard_error(other: Assessment, best: Assessment, column: str) -> bool:
    """Whether the mean difference, by days (log score) or by origins (forecasts), is within one standard error."""
    if column == "cv_log_score" and other.held_out is not None and best.held_out is not None:
        worse = (best.held_out.to_numpy() - other.held_out.to_numpy()).astype(np.float64)
        group = _days(best.held_out.index, best.estimator)
    elif column == "cv_rmse" and other.forecasts is not None and best.forecasts is not None:
        worse = (_squares(other.forecasts) - _squares(best.forecasts)).to_numpy()
        group = best.forecasts["origin"].to_numpy()
    else:
        return False
    means = pd.Series(worse).groupby(np.asarray(group)).mean().dropna()
    return len(means) > 2 and float(means.mean()) < float(means.std() / np.sqrt(len(means)))


def _days(index: pd.Index, estimator: Any) -> np.ndarray:
    """The day of each row; without time stamps they are counted from the first row."""
    if isinstance(index, pd.DatetimeIndex):
        return index.normalize().to_numpy()
    return np.arange(len(index)) // rows_per_day(estimator.sampling_time_)


class Nesting(NamedTuple):
    """Parameters that are free in the larger model only."""

    at_edge: tuple[str, ...]  # resistances, infinite in the smaller
    inside: tuple[str, ...]  # parameters that the smaller takes as known


def nesting(smaller: Any, larger: Any) -> Nesting | None:
    """The difference of two fitted identifications if the first is a special case of the second; else None."""
    if type(smaller) is not type(larger):
        return None
    first, second = (model.get_params(deep=False) for model in (smaller, larger))
    free = {"network", "known", "bounds", "n_starts", "n_jobs", "random_state", "verbose"}
    if any(repr(first[name]) != repr(second[name]) for name in first if name not in free):
        return None
    within, also_within = (dict(model.bounds or {}) for model in (smaller, larger))
    if any(within.get(name) != also_within.get(name) for name in (*smaller.theta_.index, *smaller.disturbance_.index)):
        return None
    resistors = _without_resistors(smaller.network_, larger.network_)
    known, also = (dict(model.known or {}) for model in (smaller, larger))
    if resistors is None or any(name in resistors or known.get(name) != value for name, value in also.items()):
        return None
    inside = tuple(name for name in known if name not in also and name in larger.theta_.index)
    return Nesting(resistors, inside) if resistors or inside else None


def _without_resistors(small: Any, large: Any) -> tuple[str, ...] | None:
    """Resistors of the larger network that the smaller one lacks; None where they differ in more than that."""
    same = ("capacitances", "solar", "measured", "disturbed", "heated")
    if any(getattr(small, name) != getattr(large, name) for name in same):
        return None
    ends = {name: frozenset(pair) for name, pair in large.resistors.items()}
    if any(ends.get(name) != frozenset(pair) for name, pair in small.resistors.items()):
        return None
    shared = [name for name in small.bounds if name in large.bounds]
    if any(small.bounds[name] != large.bounds[name] for name in shared):
        return None
    return tuple(name for name in large.resistors if name not in small.resistors)


def likelihood_ratio(gain: float, n_edge: int, n_inside: int) -> tuple[float, str, float]:
    """Statistic, its distribution as text, and p-value of a gain in log-likelihood.

    The smaller model fixes ``n_edge`` of the additional parameters at the edge of their range, ``n_inside`` within it.
    """
    statistic = max(2.0 * gain, 0.0)
    weights = {n_inside + j: float(stats.binom.pmf(j, n_edge, 0.5)) for j in range(n_edge + 1)}
    # chi2(0) is the constant 0
    p_value = sum(w * (stats.chi2.sf(statistic, d) if d else float(statistic <= 0.0)) for d, w in weights.items())
    words = " + ".join(f"{w:g} chi2({d})" if w < 1.0 else f"chi2({d})" for d, w in weights.items())
    return statistic, words, float(p_value)
