"""Tables in segments: one experiment, each segment with an initial state of its own."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skhybrid import (
    ARXRegressor,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    TwoStagePredictor,
)
from skhybrid._time import segments
from skhybrid.datasets import make_office
from skhybrid.forecasting import BoostedRegressor
from skhybrid.identification.fitting.starts import random_starts

KNOWN = {"Q_h": 6.0}
MODELS = [GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID]


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=8, random_state=3)


def without(table, first, last):
    return table[(table.index < first) | (table.index >= last)]


def cut(office, first="2023-07-11 09:00", last="2023-07-12 15:00"):
    return without(office.X, first, last), without(office.y, first, last)


# ------------------------------------------------------------------------------------------------------------ the index
def test_a_long_gap_parts_the_rows():
    time = pd.date_range("2023-07-01", periods=40, freq="15min", tz="UTC")
    assert segments(time) == (0,)
    assert segments(time.delete(range(10, 22))) == (0, 10)  # 3 h 15 min from row 9 to the next
    assert segments(time.delete(range(10, 21))) == (0, 10)  # 3 h are enough
    assert segments(time.delete([*range(5, 17), *range(20, 35)])) == (0, 5, 8)


@pytest.mark.parametrize("dropped", [[10], list(range(10, 20)), [*range(1, 30)]], ids=["a row", "short", "one left"])
def test_other_jumps_are_no_gaps(dropped):
    time = pd.date_range("2023-07-01", periods=40, freq="15min", tz="UTC")
    assert segments(time.delete(dropped)) == (0,)


def test_a_gap_off_the_grid_is_no_gap():
    time = pd.date_range("2023-07-01", periods=40, freq="15min", tz="UTC")
    late = time[:20].append(time[20:] + pd.Timedelta("5h7min"))
    assert segments(late) == (0,)


def test_a_few_missing_rows_are_refused_and_named(office):
    rows = [*range(100), *range(103, 300)]
    with pytest.raises(ValueError, match=r"not evenly spaced: 2023-07-09 00:45:00 is followed by 2023-07-09 01:45:00"):
        OutputDisturbanceID().fit(office.X.iloc[rows], office.y.iloc[rows])


def test_forecasters_without_stretches_refuse_a_gap(office):
    X, y = cut(office)
    with pytest.raises(ValueError, match="not evenly spaced"):
        ARXRegressor().fit(X, y)


# ------------------------------------------------------------------------------------------------- the objective
@pytest.fixture
def problems(monkeypatch):
    """Problems that the fits of this test minimised."""
    from skhybrid.identification.least_squares import LeastSquaresIdentifier

    seen, plain = [], LeastSquaresIdentifier._minima

    def spy(self, problem, begin):
        seen.append(problem)
        return plain(self, problem, begin)

    monkeypatch.setattr(LeastSquaresIdentifier, "_minima", spy)
    return seen


@pytest.mark.parametrize("model", MODELS[:3])
def test_errors_are_those_of_the_stretches(model, office, problems):
    """The same values give the same one-step errors as in a fit of each segment by itself."""
    X, y = cut(office)
    n = int((X.index < pd.Timestamp("2023-07-11 09:00")).sum())
    for rows in (slice(None), slice(0, n), slice(n, None)):
        model(known=KNOWN, n_starts=1, random_state=0).fit(X.iloc[rows], y.iloc[rows])
    whole, *parts = problems
    x = random_starts(whole.searched, 1, np.random.RandomState(0))[0]
    values = whole.values(x) | {"T0_w": 22.0, "T0_w_2": 24.0}
    second = values | {"T0_w": 24.0}
    found = whole.residuals(np.array([p.to_free(values[p.name]) for p in whole.searched]))
    expected = [
        part.residuals(np.array([p.to_free(v[p.name]) for p in part.searched]))
        for part, v in zip(parts, (values, second), strict=True)
    ]
    np.testing.assert_allclose(found, np.concatenate(expected), rtol=1e-12, atol=1e-12)


# ------------------------------------------------------------------------------------------------- the estimators
@pytest.mark.parametrize("model", MODELS)
def test_fit_takes_stretches(model, office):
    X, y = cut(office)
    fitted = model(known=KNOWN, n_starts=4, random_state=0).fit(X, y)
    whole = model(known=KNOWN, n_starts=4, random_state=0).fit(office.X, office.y)
    if model is not GrayBoxRC:  # whose errors are those of the gain that it knows nothing of
        assert fitted.theta_["C_za"] == pytest.approx(whole.theta_["C_za"], rel=0.1)
        assert fitted.theta_["Q_c"] == pytest.approx(whole.theta_["Q_c"], rel=0.1)
    assert fitted.predict(X).shape == (len(X),)
    zeta = fitted.estimate_disturbance(X)
    assert zeta.index.equals(X.index)
    assert np.isfinite(zeta).all()
    assert list(fitted.transform(X)["zeta"]) == list(zeta)


def test_stretches_are_predicted_each_by_itself(office):
    X, y = cut(office)
    model = OutputDisturbanceID(known=KNOWN, n_starts=2, random_state=0, horizon="1D").fit(X, y)
    n = int((X.index < pd.Timestamp("2023-07-11 09:00")).sum())
    apart = np.concatenate([model.predict(X.iloc[:n]), model.predict(X.iloc[n:])])
    np.testing.assert_array_equal(model.predict(X), apart)


def test_what_follows_the_last_stretch_continues_it(office):
    """The end of the training table is the last segment's, not the whole table's row count."""
    X, y = cut(office, "2023-07-14 00:00", "2023-07-15 00:00")
    ahead = make_office(n_days=9, random_state=3)
    later = ahead.X.iloc[len(office.X) :]
    model = InputDisturbanceID(known=KNOWN, n_starts=2, random_state=0, horizon="1D").fit(X, y)
    last = model.predict(later)
    assert np.sqrt(np.mean((last - ahead.y.iloc[len(office.X) :]) ** 2)) < 2.0
    assert last[0] == pytest.approx(ahead.y.iloc[len(office.X)], abs=0.5)  # forecast from the row before it


def test_one_stretch_at_a_time_is_simulated(office):
    X, y = cut(office)
    model = OutputDisturbanceID(known=KNOWN, n_starts=2, random_state=0).fit(X, y)
    with pytest.raises(ValueError, match=r"X has a gap: 2023-07-11 08:45:00 is followed by 2023-07-12 15:00:00"):
        model.simulate(X)


def test_each_stretch_has_its_own_initial_state(office):
    X, y = cut(office)
    model = OutputDisturbanceID(known=KNOWN, n_starts=2, random_state=0).fit(X, y)
    assert {"T0_w", "T0_w_2"} <= set(model.disturbance_.index)


# -------------------------------------------------------------------------------- rows before the first measurement
LATE = {
    **{model.__name__: model(known=KNOWN, n_starts=1, random_state=0, horizon="1D") for model in MODELS},
    "ARXRegressor": ARXRegressor(intervals=False),
    "BoostedRegressor": BoostedRegressor(max_iter=5, residual_of="arx"),
    "TwoStagePredictor": TwoStagePredictor(InputDisturbanceID(known=KNOWN, n_starts=1, random_state=0)),
    "HybridPredictor": HybridPredictor(known=KNOWN, intervals=False),
}


def late(office, n_rows):
    """The log whose sensor came so many rows later."""
    y = office.y.where(np.arange(len(office.y)) >= n_rows)
    return office.X.assign(T_za=y), y


@pytest.mark.parametrize("name", LATE)
def test_rows_before_the_first_measurement_teach_nothing(name, office):
    (X, y), end, model = late(office, 2 * 96), 7 * 96, LATE[name]
    whole = clone(model).fit(X[:end], y[:end]).predict(X[end:])
    np.testing.assert_array_equal(whole, clone(model).fit(X[2 * 96 : end], y[2 * 96 : end]).predict(X[end:]))


def test_a_stretch_without_a_measurement_is_left_out(office):
    X, y = cut(office)
    y[X.index < "2023-07-12 20:00"] = np.nan
    model = GrayBoxRC(known=KNOWN, n_starts=1, random_state=0, max_missing=0.6)
    later = model.fit(X[-y.notna().sum() :], y[-y.notna().sum() :]).theta_
    pd.testing.assert_series_equal(clone(model).fit(X, y).theta_, later)


@pytest.mark.parametrize("gray_box", [InputDisturbanceID, OutputDisturbanceID])
def test_no_disturbance_is_estimated_before_the_first_measurement(gray_box, office):
    model = TwoStagePredictor(gray_box(known=KNOWN, n_starts=1, random_state=0), intervals=False)
    known = model.fit(*late(office, 60)).zeta_.notna().to_numpy()
    np.testing.assert_array_equal(np.flatnonzero(~known), np.arange(15))  # hours


def test_left_out_errors_are_of_rows_of_the_table_that_was_given(office):
    model = TwoStagePredictor(InputDisturbanceID(known=KNOWN, n_starts=1, random_state=0))
    X, y = late(office, 2 * 96)
    found, later = model.fit(X, y).left_out_errors(), clone(model).fit(X[2 * 96 :], y[2 * 96 :]).left_out_errors()
    np.testing.assert_array_equal(found.origins, later.origins + 2 * 96)
    np.testing.assert_array_equal(found.errors, later.errors)
