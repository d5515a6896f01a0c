"""What users of scikit-learn expect: columns by name, rows ahead without history, scorers, summaries, signatures."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid.datasets import make_office

DAY = 96
KNOWN = {"Q_h": 6.0}
MODELS = {
    "conventional": GrayBoxRC(n_starts=1, horizon="1D", random_state=0),
    "input": InputDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "output": OutputDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "periodic": PeriodicDisturbanceID(n_starts=1, horizon="1D", random_state=0),
    "schedule": SchedulePredictor(known=KNOWN),
    "hybrid": HybridPredictor(known=KNOWN),
    "two-stage": TwoStagePredictor(
        InputDisturbanceID(known=KNOWN, n_starts=1), DisturbanceForecaster("ridge"), random_state=0
    ),
    "arx": ARXRegressor(),
    "forecaster": DisturbanceForecaster(Ridge(), sampling_time="15min"),
}
pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=9, random_state=0)


@pytest.fixture(scope="module")
def X(office):
    """Eight days to learn from, and one ahead; the disturbance is known too."""
    return office.X.assign(zeta=office.heat_gain)


@pytest.fixture(scope="module")
def fitted(office, X):
    """One fit per model, made when it is first asked for."""
    made = {}

    def fit(name):
        if name not in made:
            y = office.heat_gain if name == "forecaster" else office.y
            made[name] = MODELS[name].fit(X[:-DAY], y[:-DAY])
        return made[name]

    return fit


# ------------------------------------------------------------------------------------------------ columns by name
@pytest.mark.parametrize("name", MODELS)
def test_columns_are_found_by_name(fitted, X, name):
    model, ahead = fitted(name), X[-DAY:]
    turned = ahead[ahead.columns[::-1]].assign(T_attic=35.0, Q_else=1.0, note="read by nobody")
    np.testing.assert_array_equal(model.predict(turned), model.predict(ahead))
    if hasattr(model, "transform"):
        pd.testing.assert_frame_equal(model.transform(turned), model.transform(ahead))
        assert list(model.transform(turned)) == list(dict.fromkeys(model.get_feature_names_out()))
    with pytest.raises(ValueError, match="X has no column 'T_oa', which the training table has; it has 'q_sol'"):
        model.predict(ahead.drop(columns="T_oa"))


# ------------------------------------------------------------------------------------- rows ahead without history
@pytest.mark.parametrize("name", MODELS)
def test_rows_ahead_need_no_measurement(fitted, X, name):
    """They continue from the last known row; a column of nothing but NaN says the same."""
    model, past = fitted(name), "zeta" if name == "forecaster" else "T_za"
    known, ahead = X[:-DAY], X[-DAY:].drop(columns=["T_za", "zeta"])
    found = model.predict(ahead)
    np.testing.assert_array_equal(found, model.predict(ahead.assign(**{past: np.nan})))
    if hasattr(model, "forecast"):
        out = model.forecast(None, ahead)
        np.testing.assert_allclose(found, out if name == "forecaster" else out["T_za"], atol=1e-8)
    else:
        whole = pd.concat([known, ahead])
        np.testing.assert_allclose(found, model.predict_from(whole, [len(known) - 1], horizon="1D")[0], atol=0.05)
    if hasattr(model, "predict_load"):
        assert np.isfinite(model.predict_load(ahead, 21.0)).all(axis=None)
    if hasattr(model, "predict_quantiles"):
        assert np.isfinite(model.predict_quantiles(ahead)).all()


@pytest.mark.parametrize("name", MODELS)
def test_rows_elsewhere_need_their_history(fitted, X, name):
    model, past = fitted(name), "zeta" if name == "forecaster" else "T_za"
    elsewhere = X[-DAY // 2 :]
    hint = "there is forecast\\(history, future\\)" if hasattr(model, "forecast") else "nothing was\\."
    for forecast in (model.predict, lambda table: model.predict_from(table, [0])):
        with pytest.raises(ValueError, match=f"X has no column '{past}' and does not begin one step after .*{hint}"):
            forecast(elsewhere.drop(columns=past))
    assert np.isfinite(model.predict(elsewhere.assign(**{past: np.nan}))).all()  # a cold start, asked for


def test_an_update_by_name_and_without_a_measurement(fitted, X, office):
    model, new = deepcopy(fitted("schedule")), X[-DAY : -DAY // 2]
    other = deepcopy(model).update(new[new.columns[::-1]].assign(note="b"))
    ahead = X[-DAY // 2 :].drop(columns="T_za")
    np.testing.assert_array_equal(other.predict(ahead), deepcopy(model).update(new).predict(ahead))
    with pytest.raises(ValueError, match="rows ahead are for predict and forecast"):
        model.update(new.drop(columns="T_za"))
    model.update(new.drop(columns="T_za"), office.y[-DAY : -DAY // 2])
    np.testing.assert_array_equal(model.predict(ahead), other.predict(ahead))
