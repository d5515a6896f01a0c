"""No forecast may know what came after its origin: the temperature after it is replaced by noise, bit for bit."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from sklearn.base import clone

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
)
from skhybrid.datasets import make_office
from skhybrid.forecasting import BoostedRegressor

DAY = 96
KNOWN = {"Q_h": 6.0}


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=24, random_state=5)


def temperature_models():
    quick = DisturbanceForecaster(model="lstm", max_epochs=2, hidden_size=4)
    return [
        GrayBoxRC(known=KNOWN, n_starts=1, random_state=0, horizon="1D"),
        InputDisturbanceID(known=KNOWN, n_starts=1, random_state=0, horizon="1D"),
        OutputDisturbanceID(known=KNOWN, n_starts=1, random_state=0, horizon="1D"),
        PeriodicDisturbanceID(known=KNOWN, n_starts=1, random_state=0, horizon="1D"),
        ARXRegressor(),
        ARXRegressor(adapt="refit"),
        ARXRegressor(adapt="refit", objective="multi_step"),
        HybridPredictor(),
        HybridPredictor(PeriodicDisturbanceID(known=KNOWN, n_starts=1), random_state=0),
        HybridPredictor(OutputDisturbanceID(known=KNOWN, n_starts=1), disturbance="output", random_state=0),
        HybridPredictor(InputDisturbanceID(known=KNOWN, n_starts=1), quick, random_state=0),
        *[
            HybridPredictor(InputDisturbanceID(known=KNOWN, n_starts=1), DisturbanceForecaster(model=m), random_state=0)
            for m in ("profile", "last_week", "persistence")
        ],
        BoostedRegressor(residual_of="arx", max_iter=30, random_state=0),
    ]


MODELS = {f"{i}-{type(model).__name__}": model for i, model in enumerate(temperature_models())}


@pytest.fixture(scope="module")
def fitted(office):
    """A function that gives a model by its name, fitted on fourteen days when it is first asked for."""
    return cache(lambda name: clone(MODELS[name]).fit(office.X[: 14 * DAY], office.y[: 14 * DAY]))


def noisy_after(X, row, columns, seed=0):
    """A copy whose history columns are noise after a row."""
    rng = np.random.default_rng(seed)
    out = X.copy()
    for column in columns:
        out.iloc[row + 1 :, out.columns.get_loc(column)] = rng.uniform(-29.0, 59.0, len(out) - row - 1)
    return out


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("following", [True, False], ids=["after-training", "elsewhere"])
def test_temperature_after_an_origin_is_not_read(name, following, fitted, office):
    """Every origin of nine days, so that weekly re-fits happen too."""
    model = fitted(name)
    X = office.X[14 * DAY if following else 14 * DAY + 37 :]
    clean = model.predict(X)
    origins = [0, 60, 3 * DAY + 5, 8 * DAY]
    rolled = model.predict_from(X, origins, horizon="1D")
    for i, origin in enumerate(origins):
        noisy = noisy_after(X, origin, ["T_za"])
        np.testing.assert_array_equal(
            model.predict_from(noisy, [origin], horizon="1D")[0], model.predict_from(X, [origin], horizon="1D")[0]
        )
        np.testing.assert_array_equal(model.predict_from(noisy, origins, horizon="1D")[: i + 1], rolled[: i + 1])
        # whatever predict gives for rows up to the next local midnight is forecast from an origin up to here
        midnight = int(np.argmax((X.index > X.index[origin]) & (X.index == X.index.normalize())))
        end = midnight + 1 if midnight else len(X)
        np.testing.assert_array_equal(model.predict(noisy)[: min(end, origin + 1)], clean[: min(end, origin + 1)])
        if X.index[origin] == X.index[origin].normalize() or origin == 0:
            np.testing.assert_array_equal(model.predict(noisy)[:end], clean[:end])


#: all of ARX, and the hybrid with an input disturbance, an output one and the profile
QUANTILE_MODELS = [name for name in MODELS if name.split("-")[0] in ("4", "5", "6", "7", "8", "10")]


@pytest.mark.parametrize("name", QUANTILE_MODELS)
def test_quantiles_do_not_read_the_temperature_after_an_origin(name, fitted, office):
    """Nor do the errors of the last days that they follow."""
    model, X = fitted(name), office.X[14 * DAY :]
    clean, origins = model.predict_quantiles(X), [0, 3 * DAY + 5, 8 * DAY - 1]
    rolled = model.predict_quantiles_from(X, origins)
    for i, origin in enumerate(origins):
        noisy = noisy_after(X, origin, ["T_za"])
        one, other = (model.predict_quantiles_from(table, [origin])[0] for table in (X, noisy))
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(model.predict_quantiles_from(noisy, origins)[: i + 1], rolled[: i + 1])
        last = int(np.flatnonzero(X.index[: origin + 1] == X.index[: origin + 1].normalize())[-1])
        np.testing.assert_array_equal(model.predict_quantiles(noisy)[: last + DAY + 1], clean[: last + DAY + 1])
        assert not np.array_equal(model.predict_quantiles(noisy)[origin + DAY :], clean[origin + DAY :])


@pytest.mark.parametrize("name", list(MODELS)[7:11], ids=["default", "input", "output", "lstm"])
def test_load_does_not_read_the_temperature_after_its_origin(name, fitted, office):
    model, X = fitted(name), office.X[14 * DAY : 16 * DAY]
    noisy = noisy_after(X, 0, ["T_za"])
    one, other = model.predict_load(X, 23.0), model.predict_load(noisy, 23.0)
    np.testing.assert_array_equal(one[:DAY].to_numpy(), other[:DAY].to_numpy())


def test_the_guard_would_see_a_leak(office):
    """The test above can fail: the smoothed disturbance reads the future, and is seen to."""
    model = InputDisturbanceID(known=KNOWN, n_starts=1, random_state=0).fit(office.X, office.y)
    noisy = noisy_after(office.X, 500, ["T_za"])
    causal = [model.estimate_disturbance(X)[:501] for X in (office.X, noisy)]
    smooth = [model.estimate_disturbance(X, smooth=True)[:501] for X in (office.X, noisy)]
    np.testing.assert_array_equal(*causal)
    assert not np.array_equal(*smooth)


def test_whether_the_sensor_wakes_up_later_is_not_known(office):
    """A history without a measurement is forecast alike, whether or not measurements come after the origin."""
    gray_box = PeriodicDisturbanceID(known=KNOWN, n_starts=1)
    fitted = HybridPredictor(gray_box, random_state=0).fit(office.X[: 14 * DAY], office.y[: 14 * DAY])
    for begin in (14 * DAY, 14 * DAY + 37):
        silent = office.X[begin:].assign(T_za=np.nan)
        waking = silent.copy()
        waking.iloc[2 * DAY :, waking.columns.get_loc("T_za")] = office.X["T_za"].iloc[begin + 2 * DAY :]
        origins = [0, DAY, 2 * DAY - 1]
        np.testing.assert_array_equal(fitted.predict_from(waking, origins), fitted.predict_from(silent, origins))
