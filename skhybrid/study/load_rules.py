"""Simple rules for the load, beside which a model's load is judged."""

from __future__ import annotations

import numpy as np
import pandas as pd
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from .._time import rows_per_day

_ALPHAS = np.logspace(-3, 3, 13)
YESTERDAY, RIDGE = "yesterday's load", "ridge on T_oa and set-point"


def rule_loads(train: pd.DataFrame, later: pd.DataFrame, heat: pd.Series, held: pd.Series) -> dict[str, pd.Series]:
    """Loads [kW] of the ``later`` rows by simple rules, which know the weather and the temperature to hold.

    ``heat`` is delivered [kW], ``held`` the temperature to hold [degC], of all rows.
    """
    step = later.index[1] - later.index[0]
    day = rows_per_day(step)
    yesterday = heat.reindex(later.index - day * step).set_axis(later.index)  # rows may lack between train and later
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
