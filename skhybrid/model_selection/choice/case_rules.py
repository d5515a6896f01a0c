"""The choice of a disturbance model by the paper's rules (3.3, 4.2), with its reasons."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..._arguments import check_level
from ..._warnings import several
from ...forecasting import ModelCase
from ..search.design_matrix import IDENTITY
from .pattern_expressiveness import PatternExpressiveness
from .regression_terms import framework_label
from .results_table import case_of, finished, ingredients
from .robustness_comparison import RobustnessComparison

_BY = ("name", "disturbance")
#: ingredients that a case has or has not
_INGREDIENTS = {"time": "time features", "past-w": "past weather", "future-w": "future weather"}
#: columns that are not sizes, besides those that end with _rmse, _time or _score
_NO_SIZE = (*IDENTITY, "rmse", "error", "n_epochs", "stopped_at")
_KIND = {"input": "ID", "output": "OD"}


@dataclass(frozen=True)
class CaseChoice:
    """The choice of :func:`select_case` and its reasons.

    Attributes
    ----------
    name : str, the case in the paper's spelling, such as ``"DEEP_AR_LSTM_FORECAST-case01"``
    framework, case, disturbance : str, the parts of the name
    size : dict, size of its best candidate, by parameter
    median : float, median error of the case over its sizes [K]
    reasons : tuple of str, one sentence per rule, in the order in which they were applied
    sufficient_baseline : str or None
        Baseline with the lowest error among those that the choice does not beat; None if it beats them all.
    table : DataFrame
        Cases and baselines in order of median error: ``framework``, ``case``, ``disturbance``, ``name``, ``kind``
        ("case" or "baseline"), ``median`` [K], ``n_sizes``, ``history`` [d], ``probability`` (for a case that the best
        case is better, for a baseline that the choice is better) and ``verdict``.
    expressiveness : PatternExpressiveness or None
        The regression; None if the cases do not differ in their ingredients.
    robustness : RobustnessComparison, the comparison of the cases that have all helpful ingredients
    """

    name: str
    framework: str
    case: str
    disturbance: str
    size: dict[str, Any]
    median: float
    reasons: tuple[str, ...]
    sufficient_baseline: str | None
    table: pd.DataFrame
    expressiveness: PatternExpressiveness | None
    robustness: RobustnessComparison

    def __str__(self) -> str:
        numbered = [f"{i}. {reason}" for i, reason in enumerate(self.reasons, 1)]
        return "\n".join([f"{self.name} ({_KIND[self.disturbance]}), median error {self.median:.3f} K", *numbered])


def select_case(
    results: pd.DataFrame,
    *,
    cases: Iterable[ModelCase] = (),
    level: float = 0.95,
    best_sizes: int | None = 3,
    group: str | Sequence[str] | None = _BY,
    draws: int = 500,
    tune: int = 500,
    chains: int = 4,
    random_state: int | None = None,
) -> CaseChoice:
    """Choose a disturbance model by the paper's rules (3.3, 4.2), and compare it with the baselines.

    1. *Ingredients*: cases are dropped if they lack an ingredient that reduces the error with probability ``level``, or
       have the kind of disturbance (ID, OD) that is worse with that probability (:class:`PatternExpressiveness`).
    2. *Robustness*: of the others, those indistinguishable from the best are kept (:class:`RobustnessComparison`).
    3. *History*: of these, the ones with the shortest history are kept.
    4. *Disturbance*: of these, ID is preferred to OD.
    5. *Framework*: of these, the one with the best effect in the regression is chosen.
    6. *Time*: of these, cases by hour of week are preferred to those by day of week or weekday (paper 4.2).
    7. Of the rest, the lowest median error decides.

    Parameters
    ----------
    results : DataFrame
        One row per candidate: ``framework``, ``case``, ``disturbance``, ``name``, sizes and ``rmse`` [K], such as
        ``DesignMatrixSearchCV.results_``.  Rows without a case are baselines.  Candidates without an error are left
        out, with a warning.
    cases : iterable of ModelCase, default=(), the caller's own cases in the table
    level : float, default=0.95, probability from which an effect or a difference counts as shown
    best_sizes : int, optional
        Use only this many sizes of each case in the regression, the best ones; None uses all.
    group : str or sequence of str, optional
        As in :class:`PatternExpressiveness`; None is the paper's regression, which counts each size as an observation.
    draws, tune, chains, random_state : int, of both samplers

    Returns
    -------
    CaseChoice
        The case, a sentence per rule, a table of all cases, and a baseline that is enough, if any is.

    Raises
    ------
    ValueError
        If a column is missing, no row has a case, or no case has two sizes.
    """
    check_level(level, 0.5)
    table = finished(results, IDENTITY).reset_index(drop=True)
    is_case = table["case"].notna()
    candidates = table[is_case]
    if candidates.empty:
        raise ValueError("no row of results has a case; there is nothing but baselines to choose from.")
    overview = _overview(candidates, tuple(cases))
    if (overview["n_sizes"] < 2).all():
        raise ValueError("every case of results has one size; robustness needs cases with several.")
    sampler: dict[str, Any] = {"draws": draws, "tune": tune, "chains": chains, "random_state": random_state}
    regression = _regression(candidates, overview, cases=tuple(cases), best_sizes=best_sizes, group=group, **sampler)
    kept, demanded, reasons = _with_helpful_ingredients(overview, regression, level)
    robust = RobustnessComparison(by=_BY, level=level, **sampler).fit(candidates[_keys(candidates).isin(kept)])
    chosen, rules = _choose_by_rules(overview, robust, _framework_effects(overview, regression))
    baselines = _baselines(table[~is_case], robust, chosen, level)
    sufficient, last = _verdict_on_baselines(baselines, overview["median"][chosen])
    identity: dict[str, Any] = {part: str(overview[part][chosen]) for part in IDENTITY}
    return CaseChoice(
        **identity,
        size=_size(candidates[_keys(candidates) == chosen]),
        median=float(overview["median"][chosen]),
        reasons=(*reasons, *rules, last),
        sufficient_baseline=sufficient,
        table=_table(overview, baselines, robust, demanded, chosen),
        expressiveness=regression,
        robustness=robust,
    )


def _keys(table: pd.DataFrame) -> pd.Series:
    """Name and kind of disturbance of each row; a baseline of the temperature itself has no such kind."""
    kind = table["disturbance"].map(lambda value: f" {value}" if isinstance(value, str) else "")
    return table["name"].astype(str) + kind


def _overview(candidates: pd.DataFrame, cases: tuple[ModelCase, ...]) -> pd.DataFrame:
    """One row per case: identity, ``history`` [d], ``week`` feature, ingredients, ``median`` [K] and ``n_sizes``."""
    overview = _by_key(candidates)
    found = [case_of(f, c, cases) for f, c in zip(overview["framework"], overview["case"], strict=True)]
    overview["history"], overview["week"] = [case.history for case in found], [_week_feature(case) for case in found]
    return overview.join(ingredients(candidates, cases).groupby(_keys(candidates)).first())


def _by_key(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per case or baseline in order of error: identity, ``median`` [K] and ``n_sizes``."""
    groups = rows.groupby(_keys(rows))
    found = groups[list(IDENTITY)].first().rename_axis("key")
    return found.assign(median=groups["rmse"].median(), n_sizes=groups.size()).sort_values("median", kind="stable")


def _week_feature(case: ModelCase) -> str:
    """``"day"`` for a case that reads day of week or weekday, ``"hour"`` for hour of week alone, else ``""``."""
    if {"dow", "weekday"} & set(case.features):
        return "day"
    return "hour" if "how" in case.features else ""


def _size(candidates: pd.DataFrame) -> dict[str, Any]:
    """Size of the best candidate: the columns that are neither identity nor result."""
    best = candidates.sort_values("rmse", kind="stable").iloc[0]
    known = [c for c in candidates if c not in _NO_SIZE and not str(c).endswith(("_rmse", "_time", "_score"))]
    return {str(c): _plain(best[str(c)]) for c in known if pd.notna(best[str(c)])}


def _plain(value: Any) -> Any:
    """A plain number; whole ones became floats in columns with empty cells."""
    value = value.item() if isinstance(value, np.generic) else value
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _regression(candidates: pd.DataFrame, overview: pd.DataFrame, **settings: Any) -> PatternExpressiveness | None:
    if len(overview[["framework", "time", "pattern", "past-w", "future-w", "ID"]].drop_duplicates()) == 1:
        return None
    if settings["best_sizes"] == 1:
        settings["group"] = None  # with one row per case there are no groups
    return PatternExpressiveness(**settings).fit(candidates)


def _with_helpful_ingredients(
    overview: pd.DataFrame, regression: PatternExpressiveness | None, level: float
) -> tuple[pd.Index, dict[str, int], list[str]]:
    """Cases with all helpful ingredients, these ingredients (ID is 0 where OD is better), and the reasons."""
    if regression is None:
        return overview.index, {}, ["The cases do not differ in their ingredients, so there is no regression."]
    summary = regression.summary_["probability_reduces"]
    probability = summary[[name for name in (*_INGREDIENTS, "ID") if name in summary]]
    wanted = {str(name): 1 for name, p in probability.items() if p >= level}
    if "ID" in probability and probability["ID"] <= 1.0 - level:
        wanted["ID"] = 0
    certainty = probability.where(probability >= 0.5, 1.0 - probability)
    shown = [f"{_ingredient(name, value)} ({certainty[name]:.3f})" for name, value in wanted.items()]
    reasons = [
        f"These reduce the error (with their probabilities): {', '.join(shown)}; cases without them are dropped."
        if wanted
        else f"No ingredient reduces the error with a probability of {level:g} or more, so all cases stay."
    ]
    reasons += [f"The effect of {name} cannot be estimated: {why}" for name, why in regression.left_out_.items()]
    while wanted:
        has_all = (overview[list(wanted)] == pd.Series(wanted)).all(axis=1)
        if has_all.any():
            return overview.index[has_all], wanted, reasons
        weakest = min(wanted, key=lambda name: float(certainty[name]))
        reasons.append(f"No case has all of these, so {_ingredient(weakest, wanted[weakest])} is not required.")
        del wanted[weakest]
    return overview.index, wanted, reasons


def _ingredient(name: str, value: int) -> str:
    return _INGREDIENTS.get(name, "ID" if value else "OD")


def _framework_effects(overview: pd.DataFrame, regression: PatternExpressiveness | None) -> dict[str, float]:
    """Mean effect of each framework [K]; 0 for the reference."""
    means = {} if regression is None else regression.summary_["mean"].to_dict()
    return {name: float(means.get(framework_label(name), 0.0)) for name in overview["framework"].unique()}


def _choose_by_rules(
    overview: pd.DataFrame, robust: RobustnessComparison, effects: dict[str, float]
) -> tuple[str, list[str]]:
    """The case that the rules choose, and one sentence per rule."""
    left = overview.loc[robust.indistinguishable_]
    best = overview.loc[robust.best_]
    reasons = [
        f"Of {several(len(robust.probability_), 'case')} left, {best['name']} ({_KIND[str(best['disturbance'])]}) has "
        f"the lowest median error, {best['median']:.3f} K; indistinguishable from it: {len(left) - 1}."
    ]
    if len(left) > 1:
        least = left["history"].min()
        left = left[left["history"] == least]
        count = "one case needs" if len(left) == 1 else f"{len(left)} cases need"
        reasons.append(f"The shortest history among these is {least} d; {count} no more.")
    if left["ID"].any() and not left["ID"].all():
        left = left[left["ID"] == 1]
        reasons.append("ID is as good as OD and is preferred, since its output is heat and easier to interpret.")
    elif overview["ID"].any() and not left["ID"].any():
        reasons.append("Only OD is left; ID is worse or needs more history.")
    frameworks = list(left["framework"].unique())
    if len(frameworks) > 1:
        framework = min(frameworks, key=lambda name: effects[name])
        left = left[left["framework"] == framework]
        reasons.append(f"Of the remaining frameworks, {framework} has the best effect ({effects[framework]:+.3f} K).")
    if {"hour", "day"} <= set(left["week"]):
        left = left[left["week"] != "day"]
        reasons.append("Hour of week tells a weekly pattern better than day of week or weekday and is preferred.")
    if len(left) > 1:
        reasons.append(f"Of the remaining {len(left)} cases, the one with the lowest median error is chosen.")
    return str(left.index[0]), reasons


def _baselines(rows: pd.DataFrame, robust: RobustnessComparison, chosen: str, level: float) -> pd.DataFrame:
    """One row per baseline in order of error: identity, median, n_sizes, ``probability`` that the choice is better."""
    found = _by_key(rows)
    beaten = np.array([robust.probability_below(chosen, error) for error in found["median"]], dtype=float)
    return found.assign(probability=beaten, sufficient=beaten < level)


def _verdict_on_baselines(baselines: pd.DataFrame, median: float) -> tuple[str | None, str]:
    """The best baseline that the choice does not beat, if any, and a sentence."""
    if baselines.empty:
        return None, "The table has no baseline, so it does not show whether a network is needed at all."
    sufficient = baselines[baselines["sufficient"]]
    best = baselines.iloc[0]
    if sufficient.empty:
        return None, (
            f"No baseline is sufficient: the error of the best, {baselines.index[0]}, is {best['median']:.3f} K, and "
            f"the choice is better with probability {best['probability']:.3f}."
        )
    better = "is better than" if best["median"] < median else "is as good as"
    return str(sufficient.index[0]), (
        f"A baseline is sufficient: {sufficient.index[0]}, with {best['median']:.3f} K, {better} the choice, which has "
        f"the lower error with a probability of only {best['probability']:.3f}."
    )


def _table(
    overview: pd.DataFrame, baselines: pd.DataFrame, robust: RobustnessComparison, demanded: dict[str, int], chosen: str
) -> pd.DataFrame:
    columns = [*IDENTITY, "kind", "median", "n_sizes", "history", "probability", "verdict"]
    verdicts = []
    for key, row in overview.iterrows():
        lacks = [_ingredient(name, value) for name, value in demanded.items() if row[name] != value]
        if lacks:
            verdicts.append(f"lacks {', '.join(lacks)}")
        elif key == chosen:
            verdicts.append("chosen")
        else:
            verdicts.append("as good as the best" if key in robust.indistinguishable_ else "worse than the best")
    cases = overview.assign(kind="case", probability=robust.probability_, verdict=verdicts)
    verdict = np.where(baselines["sufficient"].astype(bool), "sufficient", "worse than the choice")
    others = baselines.assign(kind="baseline", history=np.nan, verdict=verdict)
    return pd.concat([part[columns] for part in (cases, others) if len(part)]).sort_values("median", kind="stable")
