"""Simple rules for the load, beside which a model's load is judged."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from .._time import rows_per_day
from .clock_values import free_days, minutes

_ALPHAS = np.logspace(-3, 3, 13)
YESTERDAY, RIDGE = "yesterday's load", "ridge on T_oa and set-point"
LAST_WEEK, USUAL = "last week's load", "mean load by hour and kind of day"


def rule_loads(train: pd.DataFrame, later: pd.DataFrame, heat: pd.Series, held: pd.Series) -> dict[str, pd.Series]:
    """Loads [kW] of the ``later`` rows by simple rules, which know the weather and the temperature to hold.

    ``heat`` is delivered [kW], ``held`` the temperature to hold [degC], of all rows.
    """
    step = later.index[1] - later.index[0]
    day = rows_per_day(step)
    yesterday = heat.reindex(later.index - day * step).set_axis(later.index)  # between the spans rows may be absent
    roles = [role for role in train if str(role) == "T_oa" or str(role).startswith("q_sol")]
    X = pd.concat([train[roles], later[roles]])
    X = X.assign(held=held.reindex(X.index).ffill().bfill(), before=held.reindex(X.index).shift().ffill().bfill())
    known = train.index[heat.reindex(train.index).notna() & X.loc[train.index].notna().all(axis=1)]
    if len(known) < day:
        return {YESTERDAY: yesterday}
    # a temperature that is always held says nothing, and RidgeCV of scikit-learn 1.6 halves the rest
    learned = X.loc[known]
    moving = (learned != learned.iloc[0]).any() | (X.columns == roles[0])
    ridge = make_pipeline(StandardScaler(), RidgeCV(_ALPHAS)).fit(learned.loc[:, moving], heat[known])
    ahead = X.loc[later.index, moving]
    whole = ahead.notna().all(axis=1)
    found = pd.Series(np.nan, index=later.index)
    found[whole] = ridge.predict(ahead[whole])
    return {YESTERDAY: yesterday, RIDGE: found}


def past_loads(heat: pd.Series, frame: pd.DataFrame, holidays: Any) -> dict[str, pd.Series]:
    """Loads in the rows of a back-test by rules that know nothing but the past: each over the step before ``time``.

    ``heat`` is the load of all rows, before the test too; NaN where a rule knows no such load.  ``holidays``, as for
    :class:`skhybrid.hybrid.HybridPredictor`, count as weekends.
    """
    step = heat.index[1] - heat.index[0]
    begin = pd.DatetimeIndex(frame["time"]) - step

    def before(days: int) -> pd.Series:
        period = pd.Timedelta(days=days)
        back = pd.TimedeltaIndex(frame["lead"]).ceil(period)
        return pd.Series(heat.reindex(begin - back).to_numpy(), frame.index)

    return {YESTERDAY: before(1), LAST_WEEK: before(7), USUAL: _usual(heat, begin, frame["origin"], holidays)}


def _usual(heat: pd.Series, begin: pd.DatetimeIndex, origin: pd.Series, holidays: Any) -> pd.Series:
    """Means, before each origin, of the loads at the same time of day on days of the same kind."""
    known = heat.dropna()
    at = pd.DatetimeIndex(known.index)
    past = pd.DataFrame({"slot": _slots(at, holidays), "heat": known.to_numpy(), "at": at})
    past["mean"] = past.groupby("slot")["heat"].transform(lambda one: one.expanding().mean())
    wanted = pd.DataFrame({"slot": _slots(begin, holidays), "at": pd.DatetimeIndex(origin), "row": origin.index})
    found = pd.merge_asof(wanted.sort_values("at"), past, on="at", by="slot", allow_exact_matches=False)
    return found.set_index("row")["mean"].reindex(origin.index)


def _slots(index: pd.DatetimeIndex, holidays: Any) -> np.ndarray:
    """Minute of the day, counted on from that of working days on weekends and holidays."""
    return minutes(index) + 1440 * free_days(holidays, index)
