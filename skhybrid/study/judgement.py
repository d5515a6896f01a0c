"""The verdicts of a study: on its temperatures, and on its loads."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from .data import StudyData
from .load_rules import rule_loads
from .settings import Settings
from .verdict import Verdict, compare_errors, judge

_MARGIN = 0.05  # of a range, beyond which a value lies outside of it


def judge_temperature(
    own: pd.DataFrame, yesterday: pd.DataFrame, data: StudyData, coverage: float | None = None
) -> Verdict:
    """The verdict on a back-test beside that of the day before, at the same origins."""
    error, rule = ((frame["y_pred"] - frame["y_true"]).reset_index(drop=True) for frame in (own, yesterday))
    compared = compare_errors(error, rule, own["origin"].reset_index(drop=True), "yesterday's temperature")
    n_origins = own.loc[own["y_true"].notna(), "origin"].nunique()
    return judge("temperature", [compared], n_origins=n_origins, coverage=coverage, outside=share_outside(data))


def judge_load(
    own: pd.Series, rules: Mapping[str, pd.Series], delivered: pd.Series, data: StudyData, *, scaled: bool
) -> Verdict:
    """The verdict on loads [kW] beside those of simple rules.

    Parameters
    ----------
    own : Series, load of the model
    rules : mapping of name to Series, loads of simple rules
    delivered : Series, measured heat
    data : StudyData
    scaled : bool, whether the log fixes what a kW is
    """
    at = delivered.index[(delivered.index >= data.test_start) & own.reindex(delivered.index).notna()]
    days = pd.Series(pd.DatetimeIndex(at).normalize(), index=at)
    error = own.reindex(at) - delivered[at]
    compared = [compare_errors(error, load.reindex(at) - delivered[at], days, name) for name, load in rules.items()]
    doubts = [] if scaled else ["its kW have no certain scale, since no capacity of the plant is known"]
    return judge("load", compared, n_origins=days.nunique(), outside=share_outside(data), doubts=doubts)


def loads_by_rule(data: StudyData, delivered: pd.Series) -> dict[str, pd.Series]:
    """Loads of simple rules for the temperature that was held, over the rows after training."""
    held = pd.concat([data.train["T_za"], data.later["T_za"]]).shift(-1).ffill()
    return rule_loads(data.train, data.later, delivered, held)


def share_outside(data: StudyData) -> float:
    """Share of the rows ahead of which an input lies beyond what training covered."""
    ahead = data.future.drop(columns="T_za", errors="ignore")
    low, high = data.train[list(ahead)].min(), data.train[list(ahead)].max()
    margin = _MARGIN * (high - low)
    outside = (ahead < low - margin) | (ahead > high + margin)
    return float(np.mean(outside.any(axis=1))) if len(ahead) else 0.0


def is_scaled(settings: Settings, roles: Iterable[object]) -> bool:
    """Whether a log with these roles fixes what a kW is: heat is measured, or the capacity of a stage is known."""
    known = settings.estimator.get("known", {})
    capacity = {"u_heat": "Q_h", "u_cool": "Q_c"}
    return any(str(role).startswith("Q_") or capacity.get(str(role), role) in known for role in roles)
