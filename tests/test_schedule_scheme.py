"""The default hybrid: its blend, its black box, its loads, and that it takes whatever table it is given."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from skhybrid import ARXRegressor, HybridPredictor
from skhybrid._table import read_table
from skhybrid.control.setpoints import Band, Limits
from skhybrid.datasets import load_small_office, make_office
from skhybrid.filtering import ForecastSample
from skhybrid.hybrid.blending.blend import blend_weights, by_lead, faded, lead_groups, moments
from skhybrid.hybrid.blending.daily_profile import MeanDay, ProfileRows
from skhybrid.hybrid.blending.members import ARXMember, DailyProfileMember
from skhybrid.hybrid.blending.numbered_table import NumberedTable
from skhybrid.hybrid.blending.rolling_blend import BlendRecord, RollingBlend, residual_correction
from skhybrid.hybrid.plausible_range import PlausibleRange
from skhybrid.hybrid.schedule_predictor import make_schedule_scheme
from skhybrid.model_selection import RollingOriginSplit
from skhybrid.persistence import load_model, save_model
from skhybrid.schedule import NumberedSegment, RollingNetwork, fit_leads, loads, make_segment
from skhybrid.schedule.schedule_loads import increasing_curve
from skhybrid.thermal import get_network

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.ScaleNotIdentifiableWarning")

DAY = 48  # rows, at 30 min
N_TRAIN = 10 * DAY


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=16, sampling_time="30min", random_state=4)


@pytest.fixture(scope="module")
def X(office):
    """With a day and some hours that nobody measured."""
    out = office.X.copy()
    out.iloc[3 * DAY : 4 * DAY, out.columns.get_loc("T_za")] = np.nan
    out.iloc[12 * DAY + 5 : 12 * DAY + 20, out.columns.get_loc("T_za")] = np.nan
    return out


@pytest.fixture(scope="module")
def fitted(X):
    return HybridPredictor().fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])


def rmse(a, b):
    return float(np.sqrt(np.nanmean((np.asarray(a) - np.asarray(b)) ** 2)))


# ------------------------------------------------------------------------------------------------------------- blend
@pytest.mark.parametrize("n_models", [2, 3, 4])
def test_weights_have_the_least_penalised_error_on_the_simplex(n_models):
    rng = np.random.default_rng(n_models)
    for _ in range(10):
        E = rng.normal(size=(30, n_models)) * rng.uniform(0.3, 3.0, n_models) + rng.normal(size=(30, 1))
        S = E.T @ E
        size = n_models / np.sum(1.0 / np.diag(S))

        prior = rng.dirichlet(np.ones(n_models))

        def loss(w, S=S, size=size, prior=prior):
            return w @ S @ w / size + 0.3 * np.sum((w - prior) ** 2)

        simplex = {"type": "eq", "fun": lambda w: w.sum() - 1.0}
        start = np.full(n_models, 1.0 / n_models)
        truth = minimize(
            loss, start, method="SLSQP", bounds=[(0, None)] * n_models, constraints=[simplex], options={"ftol": 1e-14}
        )
        found = blend_weights(S[None], prior)[0]
        np.testing.assert_allclose(found, truth.x, atol=1e-5)
        assert found.sum() == pytest.approx(1.0)
        assert (found >= 0).all()


def test_where_nothing_is_known_all_count_alike_or_by_the_prior():
    np.testing.assert_array_equal(blend_weights(np.zeros((2, 3, 3))), np.full((2, 3), 1.0 / 3.0))
    prior = np.array([0.25, 0.25, 0.5])
    np.testing.assert_array_equal(blend_weights(np.zeros((2, 3, 3)), prior), [prior, prior])


def test_a_model_that_is_far_worse_counts_for_nothing():
    good, bad = np.random.default_rng(0).normal(size=(2, 500))
    E = np.column_stack([good, 30.0 * bad])
    assert blend_weights((E.T @ E)[None])[0, 1] < 0.003


def test_groups_of_leads_and_weights_between_them():
    """Of a day in hours: to 2 h, to 8 h, the rest; weights hold at 1, 5 and 16 h."""
    np.testing.assert_array_equal(lead_groups(np.array([1, 2, 3, 8, 9, 24, 30]), 24), [0, 0, 1, 1, 2, 2, 2])
    weights = np.array([[1.0, 0.0], [0.6, 0.4], [0.05, 0.95]])
    found = by_lead(weights, 24, 30)
    assert found.shape == (30, 2)
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    np.testing.assert_allclose(found[[0, 2, 4, 15, 29], 0], [1.0, 0.8, 0.6, 0.05, 0.05])
    np.testing.assert_allclose(found[9, 0], 0.6 - 0.55 * 5 / 11)


def test_errors_fade_by_half_in_a_fortnight_and_count_once_they_are_known():
    np.testing.assert_allclose(faded(np.array([-0.1, 0.0, 14.0, 28.0, 7.0])), [0.0, 1.0, 0.5, 0.25, 0.5**0.5])


def test_products_of_errors_by_plain_loops():
    rng = np.random.default_rng(0)
    errors, share = rng.normal(size=(6, 4, 2)), rng.uniform(size=(6, 4))
    errors[2, 1, 0], share[3, 2] = np.nan, 0.0
    groups, expected = np.array([0, 0, 1, 2]), np.zeros((3, 2, 2))
    for o in range(6):
        for h in range(4):
            if np.isfinite(errors[o, h]).all():
                count = {0: 2, 1: 1, 2: 1}[int(groups[h])]
                expected[groups[h]] += share[o, h] * np.outer(errors[o, h], errors[o, h]) / count
    np.testing.assert_allclose(moments(errors, groups, share), expected, atol=1e-12)


@pytest.mark.parametrize("seam", [0, -1, 3], ids=["even", "closer", "apart"])
def test_the_residual_correction_by_plain_loops(seam):
    """A share of what was missed a day, a week and two weeks ago, where known, wherever the history joins."""
    rng, leads, rows_per_day = np.random.default_rng(0), np.array([1, 5, 48, 96]), 48
    origins = np.concatenate([np.arange(48, 960, 2), np.arange(960 + seam, 1400, 2)])
    errors = rng.normal(size=(len(origins), 4))
    errors[origins % 7 == 3] = np.nan
    for row in (100, 390, 730, 731, 1250, 1251, 1398):
        expected, shares = np.zeros(4), np.array([0.05, 0.10, 0.08])
        for days, share in zip((1, 7, 14), shares, strict=True):
            past = [i for i, o in enumerate(origins) if row - days * rows_per_day - 2 < o <= row - days * rows_per_day]
            for j, lead in enumerate(leads):
                if past and origins[past[-1]] + lead <= row and np.isfinite(errors[past[-1], j]):
                    expected[j] += share * errors[past[-1], j]
        found = residual_correction(errors.__getitem__, origins, leads, row, rows_per_day, 2, shares)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_residual_correction_reads_nothing_that_ends_after_its_row():
    """Of a week of leads the ones that have ended."""
    leads, origins, shares = np.array([1, 7 * 48, 7 * 48 + 1]), np.arange(0, 1000, 2), np.array([0.0, 0.1, 0.0])
    for row in (352, 400):
        found = residual_correction(np.ones((500, 3)).__getitem__, origins, leads, row, 48, 2, shares)
        np.testing.assert_allclose(found, [0.1, 0.1, 0.0])
    assert not residual_correction(np.ones((1, 3)).__getitem__, origins[:1], leads, 400, 48, 2, shares).any()
    of_two = residual_correction(np.ones((2, 3)).__getitem__, origins[:2], leads, 338, 48, 2, shares)
    np.testing.assert_allclose(of_two, [0.1, 0.1, 0.0])


class GivenMember:
    """A member with given errors (O, L, 1) of the forecasts from ``begin`` on, and a given path."""

    def __init__(self, errors, ends, path):
        self.given, self.ends, self.path, self.row = errors, ends, path, -1

    def start(self, rows, sample, adapt):
        return self

    @property
    def errors(self):
        return np.where(self.ends <= self.row, self.given, np.nan)[..., None]

    def refits(self, origin):
        return ()

    def advance(self, view, origin):
        self.row = origin

    def forecast(self, view, n_leads, clipped=True):
        return self.path[None, :n_leads], np.zeros(n_leads)


@pytest.mark.parametrize(
    ("joined", "n_days", "trust"), [(True, 30.0, 1.0), (False, 30.0, 1.0), (True, 8.0, 0.03 + 0.97 / 7.0)]
)
def test_the_rolling_blend_by_plain_loops(joined, n_days, trust):
    """Errors count by the day on which they ended, however the rows come; the training's fade from its end on.

    In a young log those of the training count less, the prior more, and a fifth of yesterday's error comes back.
    """
    rng, leads, begin, every, per_day = np.random.default_rng(0), np.array([1, 6, 24]), 10 * 24, 2, 24
    origins = np.arange(begin, begin + 20 * per_day, every)
    trained = np.arange(0, begin - 24, every)
    errors, own = rng.normal(size=(2, len(origins), 3)) * [[[1.0]], [[2.0]]], rng.normal(size=(len(trained), 3, 2))
    errors[0, 5, 1] = np.nan
    groups, prior, paths = lead_groups(leads, 24), np.array([0.6, 0.4]), 20.0 + rng.normal(size=(2, 24))
    products = moments(own, groups, np.ones((len(trained), 3)))
    plausible = PlausibleRange(10.0, 30.0)
    sample = ForecastSample(trained, leads)
    priors = np.array([prior, prior]), 14.0
    record = BlendRecord(sample, own, np.arange(2), products, groups, *priors, n_days, 24, per_day, every, plausible)
    members = [GivenMember(e, origins[:, None] + leads, path) for e, path in zip(errors, paths, strict=True)]
    blend = RollingBlend(members, record, NumberedTable(None, None, begin, joined), "linear")
    for row in (begin - 1, begin, begin + 3, begin + 40, begin + 41, begin + 17 * per_day):
        blend.advance([None, None], row)
        expected = trust * products * 0.5 ** (max(row - begin, 0) / per_day / 14.0)
        known = n_days + (row + 1 - begin) / per_day
        youth = max(0.0, (14.0 - known) / 13.0)
        shares = np.array([0.2 * max(0.0, (28.0 - known) / 27.0), 0.1, 0.08])
        for o, origin in enumerate(origins):
            for h, lead in enumerate(leads):
                if origin + lead <= row and np.isfinite(errors[:, o, h]).all():
                    share = 0.5 ** ((row - origin - lead) / per_day / 14.0)
                    expected[groups[h]] += share * np.outer(errors[:, o, h], errors[:, o, h])  # one lead per group
        weights = blend_weights(expected, prior, 0.3 + 7.7 * youth)
        e = np.moveaxis(np.where(origins[:, None] + leads <= row, errors, np.nan), 0, -1)
        e, o = (np.concatenate([own, e]), np.append(trained, origins)) if joined else (e, origins)
        blended = np.sum(e * weights[groups], axis=-1)
        missed = residual_correction(blended.__getitem__, o, leads, row, per_day, every, shares)
        path = np.sum(paths.T * by_lead(weights, 24, 24), axis=1) + np.interp(np.arange(1, 25), leads, missed)
        np.testing.assert_allclose(blend.forecast([None, None], 24, plausible)[0], path, atol=1e-9)


# --------------------------------------------------------------------------------------------------------- black box
class PlainARX:
    """The regression written out row by row, in the units of a fitted one's training table."""

    def __init__(self, X, T, n_lags, n_input_lags, alpha):
        self.n, self.n_lags, self.alpha = len(T), n_lags, alpha
        self.T = pd.Series(T).ffill().to_numpy()
        self.measured = np.isfinite(T)
        raw = X.to_numpy()
        lagged = [
            [raw[max(k - lag, 0), j] for j in range(raw.shape[1]) for lag in range(n_input_lags)] for k in range(self.n)
        ]
        self.raw = np.array(lagged)
        self.hours = X.index.hour + 24 * (X.index.day_of_week >= 5)

    def units(self, rows):
        self.centre, self.spread = self.raw[rows].mean(axis=0), self.raw[rows].std(axis=0)
        known = self.T[rows][self.measured[rows]]
        self.mean, self.scale = known.mean(), known.std()
        return self

    def outer(self, k):
        calendar = np.zeros(48)
        calendar[self.hours[k]] = 1.0
        return np.concatenate([(self.raw[k] - self.centre) / self.spread, calendar, [1.0]])

    def row(self, k):
        own = [(self.T[k - lag] - self.mean) / self.scale for lag in range(self.n_lags)]
        return np.concatenate([own, self.outer(k)])

    def solve(self, pairs):
        """From pairs (k, k + 1) that are measured at both ends, half of whose lags are."""
        use = [
            k
            for k in pairs
            if k >= self.n_lags - 1
            and self.measured[[k, k + 1]].all()
            and self.measured[k - self.n_lags + 1 : k + 1].mean() >= 0.5
        ]
        D, d = np.array([self.row(k) for k in use]), np.array([self.T[k + 1] - self.T[k] for k in use])
        penalty = np.full(D.shape[1], self.alpha)
        penalty[-1] = 0.0
        return np.linalg.solve(D.T @ D + np.diag(penalty), D.T @ d)

    def path(self, coef, origin, n_leads):
        lags = [self.T[origin - lag] for lag in range(self.n_lags)]
        for h in range(n_leads):
            own = [(value - self.mean) / self.scale for value in lags]
            step = np.concatenate([own, self.outer(min(origin + h, self.n - 1))]) @ coef
            lags = [lags[0] + step, *lags[:-1]]
            yield lags[0]


@pytest.fixture(scope="module")
def arx(X):
    frame = X[:N_TRAIN].drop(columns="T_za")
    return ARXRegressor(n_lags=4, n_input_lags=2, alpha=1.0).fit(frame, X["T_za"][:N_TRAIN])


def plain(X, n_rows):
    out = PlainARX(X[:n_rows].drop(columns="T_za"), X["T_za"].to_numpy()[:n_rows], 4, 2, 1.0)
    return out.units(slice(N_TRAIN))


def test_forecasts_without_a_block_are_of_a_fit_without_its_pairs(arx, X):
    """Left out are the steps from the block's first origin to its last target, and nothing else."""
    origins = np.array([DAY, DAY + 20, 2 * DAY, 5 * DAY, 7 * DAY + 7, 9 * DAY + 30])
    blocks = np.array([0, 0, 0, 1, 1, 2])
    T = X["T_za"].to_numpy()[:N_TRAIN]
    found = arx.left_out_paths(arx._read_X(X[:N_TRAIN].drop(columns="T_za")), T, origins, DAY, blocks)
    own = plain(X, N_TRAIN)
    for block in range(3):
        mine = origins[blocks == block]
        pairs = [k for k in range(N_TRAIN - 1) if not mine[0] <= k < mine[-1] + DAY]
        coef = own.solve(pairs)
        for i in np.flatnonzero(blocks == block):
            np.testing.assert_allclose(found[i], list(own.path(coef, origins[i], DAY)), atol=1e-8)


def test_a_block_that_is_all_there_is_cannot_be_left_out(arx, X):
    table = arx._read_X(X[:N_TRAIN].drop(columns="T_za"))
    T = X["T_za"].to_numpy()[:N_TRAIN]
    assert np.isnan(arx.left_out_paths(table, T, np.array([0, N_TRAIN - DAY]), DAY, np.zeros(2, dtype=int))).all()


def test_refitted_coefficients_are_of_training_and_what_is_known(arx, X):
    table, T = arx._read_X(X.drop(columns="T_za")), X["T_za"].to_numpy()
    origins = np.array([13 * DAY, N_TRAIN - 1, N_TRAIN + 4])  # in any order
    view = arx.design_.view(table, T)
    found = arx.refitted(view, origins, N_TRAIN)
    own = plain(X, len(X))
    np.testing.assert_allclose(found[1], arx.coef_, atol=1e-10)
    for coef, origin in zip(found, origins, strict=True):
        np.testing.assert_allclose(coef, own.solve(range(origin)), atol=1e-8)
    paths = arx.design_.iterate(view, origins, DAY, found)
    for path, coef, origin in zip(paths, found, origins, strict=True):
        np.testing.assert_allclose(path, list(own.path(coef, origin, DAY)), atol=1e-8)


@pytest.mark.parametrize("name", ["ARX", "multi-step ARX"])
def test_the_black_boxes_know_their_errors_as_of_the_morning(name, fitted, X):
    """Coefficients of a day of the history are those at its start; errors are those of its forecasts."""
    scheme = fitted._scheme
    box = next(m for m in scheme._others if m.names == (name,))
    rows, _ = scheme._numbered(fitted._with_history(X[N_TRAIN:])[0])
    assert rows.table.index[rows.begin] == X.index[N_TRAIN]
    origin, leads = rows.begin + 3 * DAY, np.array([1, 8, 48])
    rolling = box.start(rows, ForecastSample(np.empty(0, dtype=np.int64), leads), "linear")
    view = box.view(rows)
    for stop in (rows.begin + 2, rows.begin + 50, origin):  # in pieces
        rolling.advance(view, stop)
    assert len(rolling.errors) == 3 * DAY // 2 + 1
    for place in (0, 30, len(rolling.errors) - 26, len(rolling.errors) - 3):
        o = rows.begin + 2 * place
        morning = rows.begin + (o - rows.begin) // DAY * DAY
        coef = box.arx_.refitted(view, np.array([morning]), rows.begin)
        path = box.arx_.design_.iterate(view, np.array([o]), DAY, coef)[0]
        expected = np.where(o + leads <= origin, rows.T[o + leads] - path[leads - 1], np.nan)
        np.testing.assert_allclose(rolling.errors[place, :, 0], expected, atol=1e-10)


@pytest.mark.parametrize("adapt", ["linear", None])
def test_a_forecast_goes_on_from_the_training_as_through_all_rows(adapt, fitted, X):
    """Also where nothing was measured at the rows that are looked back on, and without rows ahead."""
    scheme = fitted._scheme.adapting(adapt)
    table = fitted._with_history(X[N_TRAIN:])[0]
    rows, moved = scheme._numbered(table)
    for origins in (rows.begin - 1 - moved + np.array([0, 30]), rows.begin - moved + 2 * DAY + np.array([25, 6, 185])):
        whole = RollingBlend(scheme._members, scheme._record, rows, adapt)
        expected, found = scheme._paths(whole, rows, origins + moved, DAY), scheme.forecast(table, origins, DAY)
        for part, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(part, other, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------------------------- tables of all sorts
def test_it_forecasts_better_than_the_mean_and_than_what_was(fitted, X, office):
    later = slice(N_TRAIN, None)
    truth = office.y[later]
    found = rmse(fitted.predict(X[later]), truth)
    assert found < 0.8 * truth.std()
    assert found < rmse(office.y.shift(DAY)[later], truth)


def test_gaps_of_the_history_leave_no_gaps_in_forecasts(fitted, X):
    predicted = fitted.predict(X[N_TRAIN:])
    assert np.isfinite(predicted).all()
    blind = fitted.predict(X[N_TRAIN:].assign(T_za=np.nan))
    assert np.isfinite(blind).all()
    np.testing.assert_array_equal(predicted[:1], blind[:1])  # the row before X is measured in both


def test_a_cold_table(fitted, X, office):
    """Rows that do not follow the training: nothing is known before them."""
    cold = X[N_TRAIN + 9 :]
    predicted = fitted.predict(cold)
    assert predicted[0] == cold["T_za"].iloc[0]
    assert rmse(predicted, office.y[N_TRAIN + 9 :]) < 1.5
    without = fitted.predict(cold.assign(T_za=np.nan))
    assert np.isfinite(without).all()


def test_an_array_without_names(X):
    frame = X[["T_oa", "q_sol", "u_heat", "u_cool"]]
    array, y = frame.to_numpy(), X["T_za"].to_numpy()
    model = HybridPredictor(sampling_time="30min").fit(array[:N_TRAIN], y[:N_TRAIN])
    predicted = model.predict(array[N_TRAIN:])
    assert predicted.shape == (len(X) - N_TRAIN,)
    assert np.isfinite(predicted).all()


def test_hourly_rows(office):
    hourly = office.X.resample("1h").mean()
    model = HybridPredictor().fit(hourly[: 10 * 24], hourly["T_za"][: 10 * 24])
    predicted = model.predict(hourly[10 * 24 :])
    assert rmse(predicted, hourly["T_za"][10 * 24 :]) < 1.5


@pytest.mark.parametrize("n_rows", [5, DAY, 3 * DAY], ids=["five rows", "one day", "three days"])
def test_short_tables(n_rows, office):
    X, y = office.X, office.y
    model = HybridPredictor().fit(X[:n_rows], y[:n_rows])
    assert np.isfinite(model.predict(X[n_rows : n_rows + 2 * DAY])).all()
    assert np.isfinite(model.predict(X[5 * DAY : 6 * DAY])).all()
    np.testing.assert_allclose(model.weights_.sum(axis=1), 1.0)
    assert list(model.weights_)[-1] == "daily profile"  # nothing can be left out
    share = max(n_rows / DAY - 1.0, 0.0) / 13.0  # of what holds from two weeks on
    prior = (1.0 - share) * np.array([0.0, 0.0, 0.125, 0.125, 0.75]) + share * np.array([0.15, 0.15, 0.3, 0.3, 0.1])
    np.testing.assert_allclose(model.weights_, [prior] * 3)
    first = model.predict_from(X[n_rows : n_rows + 2 * DAY], [0])[0]
    model.adapt = None
    tolerance = {5: 0.6, DAY: 0.06}.get(n_rows, 0.01)  # a row more moves an ARX that has seen few
    np.testing.assert_allclose(model.predict_from(X[n_rows : n_rows + 2 * DAY], [0])[0], first, atol=tolerance)
    model.adapt = "full"
    now = model.update(X[n_rows : n_rows + 3]).forecast(None, X[n_rows + 3 : n_rows + 20])
    assert np.isfinite(now).all(axis=None)


def test_after_a_day_of_an_hourly_log_a_simple_rule_is_not_much_better():
    """24 rows do not determine a regression on 24 temperatures; the rule returns to the mean day in half a day."""
    whole = load_small_office().X
    hourly = whole.resample("1h").mean().assign(T_za=whole["T_za"].resample("1h").first())
    ratios, leads = [], np.arange(1, 25)
    for day in (8, 20, 33, 48, 60, 73):
        log = hourly[24 * day : 24 * (day + 8)]
        train, later, T = log[:24], log[24:], log["T_za"].to_numpy()
        origins = np.arange(0, len(later) - 24, 5)
        rule = np.empty((len(origins), 24))
        for i, last in enumerate(24 + origins):
            usual = np.array([T[hour : last + 1 : 24].mean() for hour in range(24)])
            rule[i] = usual[(last + leads) % 24] + (T[last] - usual[last % 24]) * np.exp(-leads / 12.0)
        measured = T[24 + origins[:, None] + leads]
        found = HybridPredictor().fit(train, train["T_za"]).predict_from(later, origins)
        ratios.append(rmse(found, measured) / rmse(rule, measured))
    assert np.exp(np.mean(np.log(ratios))) < 1.06


@pytest.mark.parametrize(
    ("days", "rule", "network", "pull"),
    [(7.5, 0.425, 0.15, 4.15), (10.75, 0.2625, 0.225, 2.225), (14, 0.1, 0.3, 0.3), (16, 0.1, 0.3, 0.3)],
)
def test_a_short_training_trusts_what_it_learned_less(days, rule, network, pull, office):
    """The share of the daily profile, and how hard weights are drawn to it, fall up to two weeks."""
    n_rows = int(days * DAY)
    model = HybridPredictor().fit(office.X[:n_rows], office.y[:n_rows])
    record = model._scheme._record
    prior, found = record.caution(0.0)
    black = (1.0 - network - rule) / 2.0
    np.testing.assert_allclose(prior, [network / 2.0] * 2 + [black, black, rule])
    assert found == pytest.approx(pull)
    own = np.diagonal(record.products, axis1=1, axis2=2)
    size = len(own[0]) / np.sum(1.0 / own, axis=1)
    weights = model.weights_.to_numpy()

    def loss(w):
        quadratic = np.einsum("gi,gij,gj->g", w, record.products, w) / size
        return quadratic + pull * np.sum((w - prior) ** 2, axis=1)

    for other in np.random.default_rng(0).dirichlet(np.ones(5), 50):
        assert (loss(weights) <= loss(np.tile(other, (3, 1))) + 1e-9).all()


def test_the_daily_profile_by_plain_loops():
    """The mean of the days known at the origin, by local hour and type of day, and what is left of the last error."""
    n_train, n = 3 * 24, 14 * 24
    index = pd.date_range("2023-03-20", periods=n, freq="1h", tz="Europe/Amsterdam")  # summer time begins on the 26th
    rng = np.random.default_rng(0)
    T = 20.0 + rng.normal(size=n)
    T[[3, 50, 51, 200]] = np.nan
    X = pd.DataFrame({"T_oa": rng.normal(size=n), "u_heat": rng.random(n), "T_za": T}, index=index)
    table = read_table(HybridPredictor(holidays=["2023-03-28"]), X, reset=True)
    training = table.rows(slice(n_train)).replace(history={"T_za": T[:n_train]})
    hour, kind = table.time.hour, table.weekend
    days = (table.time.normalize() - table.time[0].normalize()).days.to_numpy()

    def mean(row, end):
        alike = [k for k in range(end) if hour[k] == hour[row] and np.isfinite(T[k])]
        alike = [k for k in alike if kind[k] == kind[row]] or alike
        return np.average(T[alike], weights=0.5 ** (-days[alike] / 7.0)) if alike else np.nanmean(T[:n_train])

    def forecast(origin, lead):
        seen = max(k for k in range(origin + 1) if np.isfinite(T[k]))
        left = np.exp(-(origin + lead - seen) / 12.0)
        return mean(origin + lead, origin + 1) + (T[seen] - mean(seen, origin)) * left

    rule, leads = DailyProfileMember().fit(training, 24), np.array([1, 5, 24])
    none = ForecastSample(np.empty(0, dtype=np.int64), leads)
    rolling = rule.start(NumberedTable(table, T, n_train, joined=True), none, "linear")
    for origin in (n_train - 1, n_train + 3, 80, 140, 201, 250):
        first = max(0, origin - 130)  # the last rows are enough
        view = rule.view(NumberedTable(table.rows(slice(first, None)), T[first:], n_train, True, first))
        rolling.advance(view, origin)
        path, _ = rolling.forecast(view, 48)
        np.testing.assert_allclose(path[0], [forecast(origin, h) for h in range(1, 49)], atol=1e-9)
    for place, errors in enumerate(rolling.errors[..., 0]):
        o = n_train + place
        expected = [T[o + h] - forecast(o, h) if o + h <= 250 else np.nan for h in leads]
        np.testing.assert_allclose(errors, expected, atol=1e-9)
    sample = ForecastSample(np.arange(0, 48, 5), leads)
    errors = rule.left_out(training, sample, np.zeros(len(sample.origins), dtype=int))
    np.testing.assert_allclose(errors[7], [T[35 + h] - forecast(35, h) for h in leads], atol=1e-9)


def test_the_hour_that_comes_twice_counts_once_in_however_many_calls_it_comes():
    """At once the second hour counted, row by row the first: forecasts differed for as long as a day is remembered."""
    index = pd.date_range("2023-10-28", periods=72, freq="1h", tz="Europe/Berlin")
    T = np.arange(72.0)
    X = pd.DataFrame({"T_oa": T, "T_za": T}, index=index)
    rows = ProfileRows.of(read_table(HybridPredictor(), X, reset=True), T)
    at_once, by_row = (MeanDay(24, 20.0, int(rows.place[0])) for _ in range(2))
    at_once.extend(rows, 0, 72)
    for i in range(72):
        by_row.extend(rows, i, i + 1)
    twice, ends = np.array([24 + 2]), rows.place[[25, 26, 27, 71]]
    found = [[mean.at(rows, twice, end)[0] for end in ends] for mean in (at_once, by_row)]
    of_both = (26.0 + 2.0 * 0.5 ** (1 / 7)) / (1.0 + 0.5 ** (1 / 7))
    np.testing.assert_allclose(found, [[2.0, *[of_both] * 3]] * 2, rtol=1e-12)


def test_the_daily_profile_of_the_training_serves_a_table_elsewhere(office):
    """The training's errors count by local hour where a table begins elsewhere."""
    table = read_table(HybridPredictor(), office.X[: 7 * DAY], reset=True)
    training = table.rows(slice(2 * DAY, 5 * DAY)).replace(history={"T_za": office.y.to_numpy()[2 * DAY : 5 * DAY]})
    later = table.rows(slice(6 * DAY + 17, None))  # both on working days
    rows = NumberedTable(later, np.full(later.n_rows, np.nan), 0, joined=False)
    rule, none = DailyProfileMember().fit(training, DAY), ForecastSample(np.empty(0, dtype=np.int64), np.array([1, 2]))
    rolling, view = rule.start(rows, none, None), rule.view(rows)
    rolling.advance(view, 0)
    days = training.history["T_za"].reshape(3, DAY)
    usual = np.average(days, axis=0, weights=0.5 ** (np.array([2, 1, 0]) / 7.0))
    np.testing.assert_allclose(rolling.forecast(view, 9)[0][0], usual[18:27], atol=1e-9)


def test_rows_with_other_boundaries_begin_where_the_room_was_measured(office):
    table = read_table(HybridPredictor(), office.X[:100], reset=True)
    T = np.where((np.arange(100) > 36) & (np.arange(100) < 57), np.nan, 20.0)
    rows = NumberedTable(table, T, 60, True).with_boundary({"T_oa": np.full(5, 3.0)}, 66, 10)
    assert (rows.first, rows.table.n_rows) == (36, 66 - 36 + 1 + 5)  # 56 and 46 were not measured
    expected = np.append(table.inputs["T_oa"][36:67], np.full(5, 3.0))
    np.testing.assert_array_equal(rows.table.inputs["T_oa"], expected)
    np.testing.assert_array_equal(rows.before["T_oa"], table.inputs["T_oa"][:36])


def test_a_thermometer_that_tells_every_other_row(office):
    """No two rows follow one another: the black box has nothing to learn from, and holds the temperature."""
    X = office.X.copy()
    X.iloc[1::2, X.columns.get_loc("T_za")] = np.nan
    model = HybridPredictor().fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    assert rmse(model.predict(X[N_TRAIN:]), office.y[N_TRAIN:]) < 1.0
    box = ARXRegressor().fit(X[:N_TRAIN], X["T_za"][:N_TRAIN])
    paths = box.predict_from(X[N_TRAIN:], [0, 100], horizon="1D")
    np.testing.assert_allclose(paths, np.repeat(X["T_za"].to_numpy()[N_TRAIN + np.array([[0], [100]])], DAY, axis=1))


def test_no_plant(office):
    bare = office.X[["T_oa", "q_sol", "T_za"]]
    model = HybridPredictor().fit(bare[:N_TRAIN], office.y[:N_TRAIN])
    assert np.isfinite(model.predict(bare[N_TRAIN:])).all()
    assert "emitter" not in model.gray_box_.coef_


def test_constant_inputs(office):
    still = office.X.assign(q_sol=0.0, u_heat=0.5, u_cool=0.0, T_oa=12.0)
    model = HybridPredictor().fit(still[:N_TRAIN], office.y[:N_TRAIN])
    assert np.isfinite(model.predict(still[N_TRAIN:])).all()
    flat = HybridPredictor().fit(office.X[: 4 * DAY], np.full(4 * DAY, 21.0))
    predicted = flat.predict(office.X[4 * DAY : 6 * DAY].assign(T_za=21.0))
    np.testing.assert_allclose(predicted, 21.0, atol=0.2)


def test_a_longer_horizon_than_the_trained_one(fitted, X):
    """The first day stays as it is; the second one goes on."""
    day, two = (fitted.predict_from(X[N_TRAIN:], [5, 2 * DAY], horizon=span) for span in ("1D", "2D"))
    assert two.shape == (2, 2 * DAY)
    assert np.isfinite(two).all()
    np.testing.assert_allclose(two[:, :DAY], day, atol=1e-9)
    still = deepcopy(fitted).set_params(horizon=None)
    assert np.isfinite(still.predict(X[N_TRAIN:])).all()


@pytest.mark.parametrize("adapt", [None, "linear", "full"])
@pytest.mark.parametrize("following", [True, False])
def test_forecasts_do_not_hang_on_the_other_origins(adapt, following, fitted, X):
    model = deepcopy(fitted).set_params(adapt=adapt)
    table = X[N_TRAIN + (0 if following else 3) :]
    origins = [0, 1, 2, 3, 60, 2 * DAY + 4]
    together = model.predict_from(table, origins)
    for origin, path in zip(origins, together, strict=True):
        np.testing.assert_allclose(model.predict_from(table, [origin])[0], path, atol=1e-6)
    shuffled = model.predict_from(table, origins[::-1])
    np.testing.assert_allclose(shuffled[::-1], together, atol=1e-6)


# ----------------------------------------------------------------------------------------------- online updating
@pytest.mark.parametrize("adapt", [None, "linear", "full"])
def test_the_forecast_from_now_is_that_of_the_history(adapt, fitted, X):
    model = deepcopy(fitted).set_params(adapt=adapt)
    whole, now = deepcopy(model), N_TRAIN
    for n_rows in (1, 3, 2 * DAY + 5, *[1] * 110):
        model.update(X[now : now + n_rows])
        now += n_rows
    future = X[now : now + DAY].drop(columns="T_za")
    ahead, along = model.forecast(None, future), whole.forecast(X[N_TRAIN:now], future)
    assert ahead.index.equals(along.index)
    np.testing.assert_allclose(ahead, along, atol=1e-8)
    rolled = whole.predict_from(X[N_TRAIN:], [now - N_TRAIN - 1])[0]
    np.testing.assert_allclose(ahead["T_za"], rolled, atol=1e-6)


def test_partial_fit_learns_what_came_since(fitted, X):
    model = deepcopy(fitted)
    model.update(X[N_TRAIN : 12 * DAY])
    model.partial_fit(X[12 * DAY : 14 * DAY], X["T_za"][12 * DAY : 14 * DAY])
    assert len(model.zeta_) == 14 * DAY
    fresh = HybridPredictor().fit(X[: 14 * DAY], X["T_za"][: 14 * DAY])
    np.testing.assert_allclose(model.predict(X[14 * DAY :]), fresh.predict(X[14 * DAY :]), atol=1e-6)
    assert np.isfinite(model.predict_quantiles(X[14 * DAY :])).all()
    assert np.isfinite(model.predict(X[14 * DAY + 5 :])).all()


def test_a_file_gives_the_same_forecasts(fitted, X, tmp_path):
    model = deepcopy(fitted).update(X[N_TRAIN : N_TRAIN + 7])
    save_model(model, tmp_path / "hybrid.skhybrid")
    again = load_model(tmp_path / "hybrid.skhybrid")
    later = X[N_TRAIN + 7 :]
    for table in (later, later[11:]):
        np.testing.assert_array_equal(again.predict(table), model.predict(table))
    np.testing.assert_array_equal(again.predict_load(later, 21.0), model.predict_load(later, 21.0))
    np.testing.assert_array_equal(again.predict_quantiles(later), model.predict_quantiles(later))
    more = X[13 * DAY : 14 * DAY]
    for one in (again, model):
        one.update(X[N_TRAIN + 7 : 13 * DAY]).partial_fit(more, more["T_za"])
    np.testing.assert_array_equal(again.predict(X[14 * DAY :]), model.predict(X[14 * DAY :]))
    pd.testing.assert_frame_equal(again.weights_, model.weights_)


def test_clone_and_a_search_over_what_the_model_takes(fitted, X):
    assert clone(fitted).get_params()["adapt"] == fitted.adapt
    splits = RollingOriginSplit(train="7D", test="1D", n_splits=2, sampling_time="30min")
    y = X["T_za"].interpolate()
    search = GridSearchCV(
        HybridPredictor(known={"Q_h": 6.0}),
        {"network": ["2R2C", "4R3C"]},
        cv=splits,
        scoring="neg_root_mean_squared_error",
        error_score="raise",
    )
    search.fit(X[:N_TRAIN], y[:N_TRAIN])
    scores = search.cv_results_["mean_test_score"]
    assert np.isfinite(scores).all()
    assert scores[0] != scores[1]
    assert search.best_estimator_.scheme_ == "schedule"


def test_quantiles_rise(fitted, X):
    assert (np.diff(fitted.predict_quantiles(X[N_TRAIN:]), axis=1) >= 0).all()


# ---------------------------------------------------------------------------------------------------------------- load
class Piece:
    """A network fitted on measured heat, and rows after its training."""

    def __init__(self, X, network="4R3C"):
        frame = X.assign(Q_hvac=6.0 * X["u_heat"] - 6.0 * X["u_cool"]).drop(columns=["u_heat", "u_cool"])
        self.reader = HybridPredictor()
        self.table = read_table(self.reader, frame, reset=True)
        self.T = X["T_za"].to_numpy()
        self.fit = fit_leads(get_network(network), self.table.rows(slice(N_TRAIN)), self.T[:N_TRAIN], DAY)

    def later(self, heat=None, first=0):
        table = self.table
        if heat is not None:
            new = table.inputs["Q_hvac"].copy()
            new[first:] = heat
            table = table.replace(inputs=table.inputs | {"Q_hvac": new})
        return NumberedSegment(make_segment(self.fit.segment.plan, table, self.T, self.fit.reference), N_TRAIN, True)

    def learned(self, origins):
        later = self.later()
        return [self.rolled(later, origin).state() for origin in origins]

    def rolled(self, later, origin):
        network = RollingNetwork(self.fit, later.begin, None)
        network.advance(later, int(origin))
        return network

    def path(self, heat, origin):
        """Forecast [degC] of the rows after an origin under the heat from it on."""
        n = self.table.n_rows - origin - 1
        later = self.later(heat[: n + 1], origin)
        paths, _ = self.rolled(later, origin).forecast(later, n)
        return paths[0] + self.fit.reference


@pytest.fixture(scope="module")
def piece(X):
    return Piece(X)


def load_for(piece, wanted, learned=None, band=None, fit=None):
    """Load from the rows' first origin after the training, with no limits."""
    first, n = len(piece.T) - len(wanted), len(wanted)
    free, origins = Limits(np.full(n, -np.inf), np.full(n, np.inf)), np.array([first])
    learned = piece.learned(origins) if learned is None else learned
    band = Band(wanted, wanted) if band is None else band
    return loads(fit or piece.fit, piece.later().segment, origins, learned, piece.table, band, free), first


def test_the_load_holds_the_set_point(piece):
    """Put where the measured heat was, it gives the set-point on the network's own path, whose emitter lags."""
    n = len(piece.T) - 12 * DAY - 3
    assert piece.fit.coef[-1] > 0.01
    for wanted in (np.full(n, 21.0), 21.0 + np.sin(np.arange(n) / 7.0)):
        load, first = load_for(piece, wanted)
        found = piece.path(load["Q_hvac"].to_numpy(), first)
        np.testing.assert_allclose(found, wanted[:-1], atol=0.01)
        np.testing.assert_allclose(load["T_za"].to_numpy()[1:], found, atol=1e-6)
        np.testing.assert_array_equal(load["Q_hvac"], load["Q_hvac_unclipped"])


def test_the_load_does_not_answer_to_the_noise_of_a_measured_path(piece):
    """Noise is not followed where the training was not forecast to the last digit and its plant moved little."""
    n = len(piece.T) - 12 * DAY
    smooth, noise = 21.0 + np.sin(np.arange(n) / 7.0), np.random.default_rng(1).normal(0.0, 0.1, n)
    still = piece.fit.segment._replace(heat=0.2 * piece.fit.segment.heat)
    vague = replace(piece.fit.with_rows(still), left_out=np.full_like(piece.fit.left_out, 0.5))
    clean, rough = (load_for(piece, w, fit=vague)[0] for w in (smooth, smooth + noise))
    # a band as narrow as nothing is met at every row, noise and all
    met, first = load_for(piece, smooth, band=Band(smooth + noise, smooth + noise + 1e-9))
    np.testing.assert_allclose(piece.path(met["Q_hvac"].to_numpy(), first), (smooth + noise)[:-1], atol=1e-6)
    errors = [rmse(load["Q_hvac"], clean["Q_hvac"]) for load in (rough, met)]
    assert errors[0] < 0.7 * errors[1]
    assert rmse(rough["T_za"][1:], smooth[:-1]) < 0.1
    np.testing.assert_allclose(clean["T_za"][1:], smooth[:-1], atol=0.02)


@pytest.mark.parametrize("kind", ["temperature", "band"])
@pytest.mark.parametrize("held", [0.99, 1.2, 1.5])
def test_the_load_does_not_run_away_where_heat_is_felt_late(kind, held, piece):
    """An emitter that gives back more than it takes moves the room the other way at first."""
    n = 2 * DAY
    known = piece.learned(np.array([len(piece.T) - n]))[0]
    late = known._replace(coef=np.append(known.coef[:-1], held))
    wanted = np.full(n, 21.0)
    band = Band(wanted, wanted + 1e-9) if kind == "band" else None
    load, _ = load_for(piece, wanted, [late], band)
    usual = np.abs(load_for(piece, wanted)[0]["Q_hvac"][8:]).max()
    assert np.abs(load["Q_hvac"][8:]).max() < 2.0 * usual
    np.testing.assert_allclose(load["T_za"][8:], 21.0, atol=0.25)


@pytest.mark.parametrize("given", ["flat", "falling", "steep", "above"])
def test_a_curve_that_does_not_rise_is_mended_as_little_as_can_be(given):
    stage = np.linspace(0.0, 1.0, 21)
    curve = {
        "flat": np.interp(stage, [0.0, 0.1, 0.5, 1.0], [0.0, 0.3, 0.3, 1.0]),
        "falling": np.interp(stage, [0.0, 0.1, 0.4, 1.0], [0.0, 0.4, 0.1, 1.0]),
        "above": np.interp(stage, [0.0, 0.7, 1.0], [0.0, 1.4, 1.0]),
        "steep": np.interp(stage, [0.0, 0.5, 1.0], [0.0, 0.3, 1.0]),
    }[given]
    steps = {"type": "ineq", "fun": lambda x: np.diff(x) - 0.5 * np.diff(stage)}
    ends = {"type": "eq", "fun": lambda x: x[[0, -1]] - [0.0, 1.0]}
    truth = minimize(
        lambda x: np.sum((x - curve) ** 2), stage, method="SLSQP", constraints=[steps, ends], options={"ftol": 1e-12}
    )
    np.testing.assert_allclose(increasing_curve(curve, stage), truth.x, atol=1e-4)
    if given == "steep":
        np.testing.assert_allclose(increasing_curve(curve, stage), curve, atol=1e-12)


def test_the_load_keeps_within_a_band_and_within_limits(piece):
    first, n = 12 * DAY, len(piece.T) - 12 * DAY
    origins = np.array([first])
    low, high = np.full(n, 20.5), np.full(n, 22.0)
    limits = Limits(np.where(np.arange(n) % 7 == 0, 0.0, -1.0), np.where(np.arange(n) % 7 == 0, 0.0, 1.5))
    load = loads(
        piece.fit, piece.later().segment, origins, piece.learned(origins), piece.table, Band(low, high), limits
    )
    heat = load["Q_hvac"].to_numpy()
    assert (heat >= limits.lower).all()
    assert (heat <= limits.upper).all()
    np.testing.assert_allclose(piece.path(heat, first), load["T_za"].to_numpy()[1:], atol=1e-6)
    unclipped = piece.path(load["Q_hvac_unclipped"].to_numpy(), first)
    assert unclipped.min() > 20.5 - 1e-6
    assert unclipped.max() < 22.0 + 1e-6
    inside = (unclipped > 20.5 + 1e-6) & (unclipped < 22.0 - 1e-6)
    np.testing.assert_allclose(load["Q_hvac_unclipped"].to_numpy()[:-1][inside], 0.0, atol=1e-9)


def test_each_origin_begins_with_what_is_measured_there(piece):
    """The load from a later origin is that of this origin alone."""
    first, second, n = 12 * DAY, 13 * DAY, len(piece.T) - 12 * DAY
    band, free = Band(np.full(n, 21.0), np.full(n, 21.0)), Limits(np.full(n, -np.inf), np.full(n, np.inf))
    origins = np.array([first, second])
    both = loads(piece.fit, piece.later().segment, origins, piece.learned(origins), piece.table, band, free)
    rest = tuple(side[DAY:] for side in band)
    alone = loads(
        piece.fit,
        piece.later().segment,
        origins[1:],
        piece.learned(origins[1:]),
        piece.table,
        Band(*rest),
        Limits(*(side[DAY:] for side in free)),
    )
    np.testing.assert_allclose(both["Q_hvac"][DAY:], alone["Q_hvac"], atol=1e-9)
    np.testing.assert_allclose(both["zeta"][DAY:], alone["zeta"], atol=1e-12)


def test_load_of_the_default_keeps_to_its_stages_and_limits(fitted, X):
    table = X[N_TRAIN:]
    load = fitted.predict_load(table, 21.0)
    assert load.index.equals(table.index)
    assert {"u_heat", "u_cool", "Q_hvac", "Q_hvac_unclipped", "T_za", "zeta"} <= set(load.columns)
    for stage in ("u_heat", "u_cool"):
        assert load[stage].between(0.0, 1.0 + 1e-12).all()
    assert not ((load["u_heat"] > 0) & (load["u_cool"] > 0)).any()
    narrow = fitted.predict_load(table, 21.0, limits=(-1.0, 0.5))["Q_hvac"]
    assert narrow.between(-1.0, 0.5).all()
    assert (narrow == 0.5).any()
    off = fitted.predict_load(table, 21.0, limits=(0.0, 0.0))
    assert not off["Q_hvac"].any()


def test_load_reads_no_plant_after_its_origin(fitted, X):
    for begin in (N_TRAIN, N_TRAIN + 11):  # behind the training, and cold
        table = X[begin : N_TRAIN + DAY]
        one, other = (fitted.predict_load(x, 21.0) for x in (table, table.assign(u_heat=0.9, u_cool=0.4)))
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_stages_give_the_heat_that_is_asked_of_them(fitted, X):
    """A stage's heat is not in proportion: read the curve that the model has, at the stages that it says."""
    model = deepcopy(fitted).set_params(adapt=None)
    load, coef = model.predict_load(X[N_TRAIN:], 21.5), model.gray_box_.coef_
    knots = [name for name in coef.index if name.startswith("u_heat_")]
    assert len(knots) == 2
    heat = 6.0 * load["u_heat"] - coef["u_cool"] * load["u_cool"]
    top = X["u_heat"][:N_TRAIN].max()
    for share in (0.2, 0.45):
        name = next(n for n in knots if n.endswith(f"_{share * top:.2g}"))
        bend = np.minimum(load["u_heat"], share * top) - np.minimum(load["u_heat"], top) * share
        heat = heat + coef[name] * 6.0 * bend
    assert (load["u_heat"] > 0.1).any()
    np.testing.assert_allclose(heat, load["Q_hvac"], atol=1e-6)


def test_a_capacity_of_none_is_refused():
    with pytest.raises(ValueError, match="known= gives Q_c no value; give a number, or leave it out"):
        make_schedule_scheme(HybridPredictor(known={"Q_h": 6.0, "Q_c": None}))


@pytest.mark.parametrize(("hours", "n_lags"), [(47, 4), (48, 24)])
def test_less_than_two_days_are_regressed_on_few_temperatures(hours, n_lags, office):
    rows = slice(0, 2 * hours)
    members = HybridPredictor(intervals=False).fit(office.X[rows], office.y[rows])._scheme._members
    assert {member.arx_.n_lags for member in members if isinstance(member, ARXMember)} == {n_lags}
