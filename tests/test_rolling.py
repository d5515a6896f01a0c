"""Rolling forecasts: their origins, the rows that they know, and daylight saving."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator
from sklearn.exceptions import NotFittedError
from sklearn.inspection import permutation_importance

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor
from skhybrid._rolling import RollingForecastMixin
from skhybrid._table import read_table
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=4, random_state=0)


def gray_box(office, X=None, y=None, **settings):
    """A fit with all parameters known, which takes no time."""
    X, y = (office.X if X is None else X), (office.y if y is None else y)
    return GrayBoxRC(known=office.theta, **settings).fit(X, y)


class Clock(RollingForecastMixin, BaseEstimator):
    """Forecasts row of the origin + lead / 1000 on a table of :func:`clocked`: each value shows its origin."""

    def __init__(self, horizon=None, origin_step=None):
        self.horizon = horizon
        self.origin_step = origin_step

    def fit(self, X):
        self._tail = read_table(self, X, reset=True).rows(slice(-4, None))
        self.is_fitted_ = True
        return self

    def _read_X(self, X):
        return read_table(self, X, reset=False)

    def _forecast(self, table, origins, n_leads):
        return 10 * table.measured()[origins][:, None] + np.arange(1, n_leads + 1) / 1000

    def _cold_value(self, table):
        return -1.0


def clocked(n, start="2023-07-08 21:00"):
    """A table whose T_za is a tenth of the row number."""
    index = pd.date_range(start, periods=n, freq="15min")
    return pd.DataFrame({"T_oa": 10.0, "T_za": np.arange(n) / 10}, index=index)


@pytest.mark.parametrize(
    ("horizon", "step", "every"), [("1D", None, 96), ("1D", "3h", 12), ("2h", None, 8), (None, None, 0)]
)
def test_each_row_is_predicted_from_the_last_origin_before_it(horizon, step, every):
    X = clocked(250)
    found = Clock(horizon, step).fit(X).predict(X)
    assert found[0] == -1.0
    origins = {0} | {row for row in range(250) if every and (row - 12) % every == 0}  # row 12 is midnight
    for row in range(1, 250):
        origin = max(o for o in origins if o < row)
        assert found[row] == pytest.approx(origin + (row - origin) / 1000)


def test_a_table_after_training_has_the_end_of_training_as_history():
    X = clocked(300)
    model = Clock("1D").fit(X[:150])
    found = model.predict(X[150:])
    # the first row is forecast from the row before; the row at 150 is an origin itself
    assert found[0] == pytest.approx(149 + 0.001)
    assert found[1] == pytest.approx(150 + 0.001)
    assert (found >= 0).all()
    assert model.predict(X[151:])[0] == -1.0
    paths = model.predict_from(X[150:], [0, 10, 149], horizon="1h")
    expected = np.array([150.0, 160.0, 299.0])[:, None] + np.arange(1, 5) / 1000
    expected[2] = np.nan
    np.testing.assert_allclose(paths, expected)


def test_forecasts_of_chosen_origins():
    X = clocked(200)
    model = Clock().fit(X)
    paths = model.predict_from(X, [5, 190, 199, 5])
    assert paths.shape == (4, 96)
    assert paths.dtype == np.float64
    np.testing.assert_allclose(paths[0], 5 + np.arange(1, 97) / 1000)
    np.testing.assert_array_equal(np.isnan(paths[1]), np.arange(96) >= 9)
    assert np.isnan(paths[2]).all()
    np.testing.assert_array_equal(paths[3], paths[0])
    assert model.predict_from(X, [], horizon="1h").shape == (0, 4)
    assert model.predict_from(X, np.array([7], dtype=np.uint8), "15min").shape == (1, 1)


@pytest.mark.parametrize("origins", [[-1], [200], [1.5], [True, False], 3, [[1, 2]]])
def test_origins_that_are_no_rows_are_refused(origins):
    X = clocked(200)
    with pytest.raises(ValueError, match="origins must be row numbers of X, from 0 to 199"):
        Clock().fit(X).predict_from(X, origins)
    with pytest.raises(ValueError, match=r"199\.$" if origins != [-1] else "199; X does not continue the known rows"):
        Clock().fit(X).predict_from(X, origins)


def test_predict_and_predict_from_agree(office):
    model = gray_box(office, horizon="12h")
    predicted = model.predict(office.X)
    rows = np.arange(0, len(office.X), 48)
    np.testing.assert_allclose(model.predict_from(office.X, rows).ravel()[:-1], predicted[1:], atol=1e-9)


def test_score_leaves_out_what_was_not_measured(office):
    model = gray_box(office, horizon="1D")
    y = office.y.copy()
    y.iloc[::3] = np.nan
    seen = np.isfinite(y)
    residual = (y - model.predict(office.X))[seen]
    expected = 1 - (residual**2).sum() / ((y[seen] - y[seen].mean()) ** 2).sum()
    assert model.score(office.X, y) == pytest.approx(expected)
    weight = np.linspace(0, 1, len(y))
    assert model.score(office.X, y, sample_weight=weight) != pytest.approx(expected)
    with pytest.raises(ValueError, match="no measured row"):
        model.score(office.X, np.full(len(y), np.nan))


def test_the_importance_of_a_column_is_measured_by_permuting_it(office):
    """A permuted T_za was refused as another quantity than y, although it shows what the history is worth."""
    X = office.X[["T_oa", "u_heat", "T_za"]]
    model = ARXRegressor().fit(X, office.y)
    with pytest.warns(SkhybridWarning, match="they do not move together"):
        found = permutation_importance(model, X, office.y, n_repeats=2, random_state=0)
    assert (found.importances_mean[1:] > 0.1).all()  # the weather of four days says little


@pytest.mark.parametrize("model", [GrayBoxRC(), HybridPredictor(intervals=False)])
def test_update_refuses_a_history_that_is_not_y(model, office):
    X, y = office.X, office.y
    model, later = model.fit(X[:-96], y[:-96]), X[-96:]
    other = later.assign(T_za=later["T_za"].sample(frac=1.0, random_state=0).to_numpy())
    with pytest.raises(ValueError, match="they do not move together"):
        model.update(other, y[-96:])


def test_an_estimator_is_not_fitted_after_a_refused_fit(office):
    model = GrayBoxRC(known=office.theta)
    with pytest.raises(ValueError, match="'T_oa' is empty: it contains NaN in all"):
        model.fit(office.X.assign(T_oa=np.nan), office.y)
    with pytest.raises(NotFittedError):
        model.predict(office.X)


def test_a_horizon_that_is_no_multiple_of_the_step_is_refused(office):
    with pytest.raises(ValueError, match="horizon='20min' is not a positive multiple of the sampling time of 15 min"):
        gray_box(office, horizon="20min")
    model = gray_box(office)
    with pytest.raises(ValueError, match="horizon='20min' is not a positive multiple"):
        model.predict_from(office.X, [0], horizon="20min")
    with pytest.raises(ValueError, match="horizon='20min' is not a positive multiple"):
        gray_box(office).set_params(horizon="20min").predict(office.X)
    with pytest.raises(ValueError, match="origin_step='20min' is not a positive multiple"):
        gray_box(office, horizon="1D", origin_step="20min").predict(office.X)


def test_an_origin_step_longer_than_the_horizon_is_refused(office):
    """``predict`` forecasts every row from the last origin, so that it would reach beyond the horizon in silence."""
    message = "origin_step='1D' is longer than horizon='6h', so predict would reach beyond the horizon; give"
    for model in (ARXRegressor(horizon="6h", origin_step="1D"), HybridPredictor(horizon="6h", origin_step="1D")):
        with pytest.raises(ValueError, match=message):
            model.fit(office.X, office.y)
    model = gray_box(office, horizon="6h")
    _, counts = model.rolled_origins(office.X)
    assert counts.max() <= 24
    with pytest.raises(ValueError, match=message):
        model.set_params(origin_step="1D").predict(office.X)
    gray_box(office, horizon="6h", origin_step="6h")
    gray_box(office, horizon=None, origin_step="1D")  # a simulation has one origin


@pytest.mark.parametrize(("step", "horizon"), [("15min", "30min"), ("15min", "1h"), ("1h", "1h"), ("1h", "6h")])
def test_no_path_is_longer_than_the_horizon_where_clocks_go_back(step, horizon):
    """An hour whose rows repeat is a block of its own, not a longer one."""
    X = pd.DataFrame(
        {"T_oa": 10.0, "T_za": 20.0}, pd.date_range("2024-10-26", "2024-10-29", freq=step, tz="Europe/Berlin")
    )
    model = Clock(horizon=horizon).fit(X[:24])
    origins, counts = model.rolled_origins(X[24:])
    assert counts.max() == pd.Timedelta(horizon) / pd.Timedelta(step)
    np.testing.assert_array_equal(np.diff(origins), counts[:-1])


def test_origins_of_a_day_and_a_half_are_counted_from_midnight(office):
    X = office.X[20:]  # from 05:00 on
    origins, _ = gray_box(office, X, office.y[20:], horizon="36h").rolled_origins(X.assign(T_za=np.nan))
    assert list(X.index[origins[1:]] - X.index[0].normalize()) == [pd.Timedelta("36h"), pd.Timedelta("72h")]


@pytest.mark.parametrize(
    ("tz", "day", "length"),
    [("Europe/Berlin", "2023-03-25", 23), ("Europe/Berlin", "2023-10-28", 25), ("America/Havana", "2023-11-04", 25)],
)
def test_every_row_is_forecast_across_a_clock_change(office, tz, day, length):
    X = office.X.set_axis(pd.date_range(day, periods=len(office.X), freq="15min", tz=tz))
    y = office.y.set_axis(X.index)
    model = gray_box(office, X, y, horizon="1D")
    predicted = model.predict(X)
    assert np.isfinite(predicted).all()
    whole = model.predict_from(X, [96], horizon=f"{length}h")
    np.testing.assert_allclose(predicted[97 : 97 + 4 * length], whole[0])
    with pytest.raises(AssertionError):  # the next row has another origin
        np.testing.assert_allclose(predicted[97 + 4 * length], model.predict_from(X, [96], horizon="2D")[0, 4 * length])
    half = gray_box(office, X[:200], y[:200], horizon="1D")
    assert np.isfinite(half.predict(X[200:])).all()
