"""Quantiles of path forecasts: arithmetic against plain loops, coverage of a known law, nothing from later."""

from __future__ import annotations

import copy

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skhybrid import ARXRegressor, DisturbanceForecaster, GrayBoxRC, HybridPredictor, InputDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.forecasting.intervals import (
    LeadIntervals,
    PathClock,
    finite_sample_levels,
    weighted_quantiles,
)
from skhybrid.forecasting.quantiles import (
    LeftOut,
    block_origins,
    errors_inside,
    intervals_from,
    joined_blocks,
    left_out_blocks,
    measured_ahead,
    path_clock,
)
from skhybrid.model_selection import backtest, score_backtest, score_intervals
from skhybrid.persistence import load_model, save_model

DAY = 24
LEVELS = np.array([0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95])
LEADS = np.arange(1.0, DAY + 1)


def clock_of(n_days, per_day=8, spread=None):
    """Hourly paths of a day from every third hour of a log that begins on a Monday."""
    origins = np.arange(0, n_days * DAY, DAY // per_day)
    hours = origins[:, None] + np.arange(1, DAY + 1)
    slots = hours % 24 + 24 * ((hours // 24) % 7 >= 5)
    return PathClock(np.broadcast_to(LEADS, hours.shape), slots, hours / 24.0, spread)


def true_scale(clock):
    """Grows with the lead, and is three times as large from 8 to 18 h."""
    hour = clock.slot % 24
    return 0.2 * np.sqrt(clock.lead) * np.where((hour >= 8) & (hour < 18), 3.0, 1.0)


@pytest.fixture(scope="module")
def learned():
    """Skew errors of a known law, on 60 days, and the intervals learned from them."""
    clock = clock_of(60)
    draws = np.random.default_rng(0).exponential(size=clock.lead.shape) - 1.0
    return LeadIntervals().fit(true_scale(clock) * draws, clock)


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=56, random_state=3)


@pytest.fixture(scope="module")
def arx(office):
    return ARXRegressor(adapt="refit").fit(office.X[: 28 * 96], office.y[: 28 * 96])


# --------------------------------------------------------------------------------------------------- the arithmetic
def test_a_weighted_quantile_is_that_of_a_plain_loop():
    rng = np.random.default_rng(1)
    values, weights = rng.normal(size=30), rng.uniform(0.1, 2.0, 30)
    pairs = sorted(zip(values, weights, strict=True))
    total, middles, reached = sum(weights), [], 0.0
    for _, w in pairs:
        middles.append((reached + w / 2) / total)
        reached += w
    for level in LEVELS:
        above = next((i for i, m in enumerate(middles) if m > level), len(pairs))
        if above in (0, len(pairs)):
            expected = pairs[min(above, len(pairs) - 1)][0]
        else:
            part = (level - middles[above - 1]) / (middles[above] - middles[above - 1])
            expected = (1 - part) * pairs[above - 1][0] + part * pairs[above][0]
        assert weighted_quantiles(values, weights, np.array([level]))[0] == pytest.approx(expected, rel=1e-12)
    equal = weighted_quantiles(values, np.full(30, 0.7), LEVELS)
    np.testing.assert_allclose(equal, np.quantile(values, LEVELS, method="hazen"), rtol=1e-12)


def test_levels_of_a_finite_sample():
    """Of nine values, the largest covers the next one with probability 9/10; the median stays, many change nothing."""
    np.testing.assert_allclose(finite_sample_levels(np.array([0.1, 0.5, 0.9]), 9), [0.0, 0.5, 1.0], atol=1e-12)
    np.testing.assert_allclose(finite_sample_levels(LEVELS, 1e9), LEVELS, atol=1e-8)
    assert (np.diff(finite_sample_levels(LEVELS, 7)) >= 0).all()


def test_the_scale_of_lead_and_hour_is_found(learned):
    clock = clock_of(14, per_day=1)
    ratio = learned.scale(clock) / true_scale(clock)
    inner = ~np.isin(clock.slot % 24, (6, 7, 8, 9, 16, 17, 18, 19))  # where the hours are smoothed into each other
    ratio /= np.exp(np.log(ratio[inner]).mean())
    assert np.exp(np.abs(np.log(ratio[inner])).mean()) < 1.12


def test_skew_errors_are_covered_at_every_level(learned):
    clock = clock_of(200, per_day=1)
    draws = np.random.default_rng(2).exponential(size=clock.lead.shape) - 1.0
    errors = true_scale(clock) * draws
    bands = np.stack([learned.offsets(clock.rows(slice(i, i + 1)), LEVELS) for i in range(len(errors))])
    np.testing.assert_allclose((errors[..., None] <= bands).mean(axis=(0, 1)), LEVELS, atol=0.03)
    assert (np.diff(bands, axis=-1) >= 0).all()


def test_a_spread_that_a_model_states_scales_its_intervals():
    rng = np.random.default_rng(3)
    spread = rng.uniform(0.5, 2.0, (480, DAY))
    clock = clock_of(60, spread=spread)
    found = LeadIntervals().fit(spread * rng.normal(size=spread.shape), clock)
    one = clock.rows(slice(0, 1))
    doubled = one._replace(spread=2.0 * spread[:1])
    np.testing.assert_allclose(found.offsets(doubled, LEVELS), 2.0 * found.offsets(one, LEVELS), rtol=1e-12)
    width = np.ptp(found.offsets(one, [0.1, 0.9]), axis=1)
    np.testing.assert_allclose(width, 2 * 1.2816 * spread[0], rtol=0.2)


def recent_days(n, factor=1.0, shift=0.0, seed=4):
    """Errors of the law above over some days, one path a day, made ``factor`` times as large and shifted."""
    clock = clock_of(n, per_day=1)
    draws = np.random.default_rng(seed).exponential(size=clock.lead.shape) - 1.0
    return true_scale(clock) * (factor * draws + shift), clock


def test_offsets_are_those_of_plain_loops(learned):
    """Location, width, pool and levels of one group of leads, written out for one lead at its centre (4 h)."""
    errors, past = recent_days(6, factor=2.0, shift=0.5)
    now, one = 5.3, clock_of(1, per_day=1)
    scale_past, shape = learned.scale(past), learned.shape_[1]
    total = location = 0.0
    entries, by_day = [], []
    for d in range(6):
        in_group = [j for j in range(DAY) if 2.0 < past.lead[d, j] <= 8.0]
        of_day = 0.0
        for j in in_group:
            if past.day[d, j] <= now:
                w = np.exp(-(now - past.day[d, j]) / 10.0) / len(in_group)
                entries.append((errors[d, j] / scale_past[d, j], w))
                of_day += w
        by_day.append(of_day)
    total = sum(w for _, w in entries)
    location = sum(w * z for z, w in entries) / (total + 5.0)
    sizes = sum(w * abs(z - location) for z, w in entries) / np.mean(np.abs(shape))
    width = (sizes + 2.0) / (total + 2.0)
    pool = np.array([*shape, *((z - location) / width for z, _ in entries)])
    weights = np.array([*[5.0 / 200] * 200, *(w for _, w in entries)])
    n = 2.0 * (5.0 + total) ** 2 / (5.0**2 / learned.n_days_ + sum(w**2 for w in by_day))
    quantiles = weighted_quantiles(pool, weights, finite_sample_levels(LEVELS, n))
    expected = learned.scale(one)[0, 3] * (location + width * quantiles)
    np.testing.assert_allclose(learned.offsets(one, LEVELS, (errors, past), now)[3], expected, rtol=1e-12)


def test_recent_errors_move_the_interval_and_later_ones_do_not(learned):
    one = clock_of(1, per_day=1)
    plain = learned.offsets(one, LEVELS)
    wide = learned.offsets(one, LEVELS, recent_days(14, factor=3.0), 14.0)
    assert (np.ptp(wide, axis=1) > 1.5 * np.ptp(plain, axis=1)).all()
    shifted = learned.offsets(one, LEVELS, recent_days(14, shift=2.0), 14.0)
    assert (shifted[:, 3] > plain[:, 3] + 0.1 * np.ptp(plain, axis=1)).all()
    errors, past = recent_days(14)
    late = np.where(past.day > 9.0, 1e6, errors)
    known = learned.offsets(one, LEVELS, (errors, past), 9.0)
    np.testing.assert_array_equal(learned.offsets(one, LEVELS, (late, past), 9.0), known)
    assert not np.array_equal(learned.offsets(one, LEVELS, (late, past), 10.0), known)


def test_the_factor_scores_the_intervals_of_the_last_days_by_what_was_known_then(learned):
    errors, past = recent_days(14, factor=2.0)
    scores, weights = [], []
    for d in range(4, 14):  # days less than ten before
        known = past.rows(slice(0, d))
        low, middle, high = learned.offsets(
            past.rows(slice(d, d + 1)), [0.1, 0.5, 0.9], (errors[:d], known), d + 1 / 24 - 1e-6
        ).T
        off = errors[d] - middle
        scores += list(np.where(off > 0, off / (high - middle), off / (low - middle)))
        weights += list(np.exp(-(14.0 - past.day[d]) / 10.0) / DAY)
    raw = weighted_quantiles(np.array(scores), np.array(weights), np.array([0.8]))[0]
    expected = raw ** (sum(weights) / (sum(weights) + 5.0))
    assert learned.factor_at((errors, past), 14.0) == pytest.approx(expected, rel=1e-4)
    late = np.where(past.day > 9.0, 1e6, errors)
    assert learned.factor_at((late, past), 9.0) == learned.factor_at((errors, past), 9.0)


def test_a_factor_stretches_an_interval_about_its_median(learned):
    one, recent = clock_of(1, per_day=1), recent_days(14)
    low, middle, high = learned.offsets(one, [0.1, 0.5, 0.9], recent, 14.0).T
    wide = learned.offsets(one, [0.1, 0.5, 0.9], recent, 14.0, factor=1.5)
    expected = np.stack([middle + 1.5 * (low - middle), middle, middle + 1.5 * (high - middle)], axis=1)
    np.testing.assert_allclose(wide, expected, rtol=1e-12)


@pytest.mark.parametrize("spread", [0.3, 3.0])
def test_a_further_error_leaves_the_share_that_an_interval_holds(spread):
    """Loads are nearly zero for most of the time, so that their errors have a centre of no width and long tails."""
    clock, rng = clock_of(80), np.random.default_rng(1)
    own = rng.exponential(size=(2, *clock.lead.shape)) * (rng.random((2, *clock.lead.shape)) < 0.3)
    intervals, further = LeadIntervals().fit(own[0], clock), np.full(DAY, spread)
    both = own[1] + rng.normal(0.0, spread, clock.lead.shape)
    held = []
    for i in range(len(both)):
        low, high = intervals.offsets(clock.rows(slice(i, i + 1)), [0.1, 0.9], further=further).T
        held.append((both[i] >= low) & (both[i] <= high))
    assert 0.76 < np.mean(held) < 0.86


def test_intervals_of_what_was_always_right_have_no_width():
    """Such as the load of a plant that was off, until it runs."""
    past, one = clock_of(14, per_day=1), clock_of(1, per_day=1)
    exact = LeadIntervals().fit(np.zeros_like(past.lead), past)
    np.testing.assert_allclose(exact.offsets(one, LEVELS), 0.0, atol=1e-6)
    np.testing.assert_allclose(exact.offsets(one, LEVELS, (np.zeros_like(past.lead), past), 14.0), 0.0, atol=1e-6)
    off = np.where(past.day > 12.0, 2.0, 0.0)
    found = exact.offsets(one, LEVELS, (off, past), 14.0, factor=exact.factor_at((off, past), 14.0))
    assert (found[:, -1] > 0.1).all()
    assert (np.diff(found, axis=1) >= 0.0).all()


def test_too_few_errors_teach_no_intervals(arx, office):
    table, errors = arx._read_X(office.X[: 3 * 96]), np.full((1, 96), np.nan)
    errors[0, :19] = 1.0
    assert intervals_from(LeftOut(errors, np.array([96])), table) is None
    errors[0, 19] = 1.0
    assert intervals_from(LeftOut(errors, np.array([96])), table).n_days_ == 1


# ------------------------------------------------------------------------------------------------- errors left out
def left_out_errors(estimator, X, y):
    """Errors in weeks that are left out in turn, each by a clone that is fitted with ``y`` missing in that week."""
    target, found = y.to_numpy(), []
    for block in left_out_blocks(len(target), 96):
        hidden = target.copy()
        hidden[slice(*block)] = np.nan
        origins = block_origins(block, 96)
        paths = clone(estimator).fit(X, hidden).predict_from(X, origins)
        found.append(LeftOut(errors_inside(target, origins, paths, block[1]), origins))
    return joined_blocks(found)


def test_left_out_errors_come_from_models_that_did_not_see_their_week(office):
    """y alone moves by 4 K in one week: the forecasts of that week stay, so its errors move by 4 K exactly."""
    X, y = office.X[: 21 * 96], office.y[: 21 * 96]
    week = np.arange(len(y)) // (7 * 96)
    clean = left_out_errors(ARXRegressor(alpha=10.0), X, y)
    moved = left_out_errors(ARXRegressor(alpha=10.0), X, y + 4.0 * (week == 1))
    own = week[clean.origins] == 1
    np.testing.assert_allclose(moved.errors[own], clean.errors[own] + 4.0, rtol=0, atol=1e-9)
    assert not np.allclose(moved.errors[~own], clean.errors[~own], equal_nan=True)
    # no error reaches into the next week
    last = clean.origins[own][-1]
    assert np.isfinite(clean.errors[own][-1, : 14 * 96 - 1 - last]).all()
    assert np.isnan(clean.errors[own][-1, 14 * 96 - 1 - last :]).all()


def test_arx_takes_its_weeks_out_by_moments(office, arx):
    """Nearly what refits without each week give: those also move the means and scales of the columns."""
    X, y = office.X[: 28 * 96], office.y[: 28 * 96]
    refits = left_out_errors(ARXRegressor(alpha=arx.alpha_), X, y)
    table = arx._read_X(X)
    paths = arx.left_out_paths(table, y.to_numpy(), refits.origins, 96, refits.origins // (7 * 96))
    own = measured_ahead(table, refits.origins, 96) - paths
    known = np.isfinite(refits.errors)
    assert np.sqrt(np.mean((own - refits.errors)[known] ** 2)) < 0.1 * np.sqrt(np.mean(refits.errors[known] ** 2))
    clock = path_clock(table, refits.origins, 96)
    one = clock.rows(slice(0, 1))
    expected = LeadIntervals().fit(own, clock).offsets(one, LEVELS)
    np.testing.assert_allclose(arx.intervals_.offsets(one, LEVELS), expected, rtol=1e-9)


def test_the_two_stage_scheme_leaves_weeks_out(office):
    """Its own errors in the training are larger than those of the forecaster that saw the week."""
    X, y = office.X[: 21 * 96], office.y[: 21 * 96]
    model = HybridPredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1), adapt=None, random_state=0).fit(X, y)
    left_out = model._scheme.left_out_errors(96)
    seen = y.to_numpy()[np.minimum(left_out.origins[:, None] + np.arange(1, 97), len(y) - 1)]
    seen = seen - model._scheme.forecast(model._scheme.rows.training, left_out.origins, 96).temperature
    known = np.isfinite(left_out.errors)
    assert left_out.errors.shape == (len(left_out.origins), 96)
    assert np.mean(left_out.errors[known] ** 2) > 1.02 * np.mean(seen[known] ** 2)
    history, future = office.X[21 * 96 : 25 * 96], office.X[25 * 96 : 26 * 96]
    day = model.forecast(history, future, quantiles=(0.1, 0.5, 0.9))
    assert list(day.columns) == ["T_za", "zeta", "q_0.1", "q_0.5", "q_0.9"]
    both = pd.concat([history, future])
    rolled = model.predict_quantiles_from(both, [len(history) - 1], (0.1, 0.5, 0.9))[0]
    np.testing.assert_array_equal(day[["q_0.1", "q_0.5", "q_0.9"]].to_numpy(), rolled)


def test_quantiles_from_where_the_filter_stands_are_those_of_the_history(office):
    """Rows that update took in tell as much of the last days as a history that is given."""
    model = HybridPredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=1), random_state=0)
    model.fit(office.X[: 14 * 96], office.y[: 14 * 96])
    history, future = office.X[14 * 96 : 21 * 96], office.X[21 * 96 : 22 * 96].drop(columns="T_za")
    given = model.forecast(history, future, quantiles=LEVELS)
    untold = model.forecast(history[-96:].tz_localize(None), future.tz_localize(None), quantiles=LEVELS)
    live = model.update(history).forecast(None, future, quantiles=LEVELS)
    bands = [name for name in live.columns if name.startswith("q_")]
    width = np.ptp(given[bands].to_numpy(), axis=1, keepdims=True)
    assert (np.abs(live[bands] - given[bands]) < 0.1 * width).all(axis=None)
    assert (np.abs(untold[bands] - given[bands]) > 0.1 * width).any(axis=None)


ROLLING = {
    "schedule": lambda: HybridPredictor(network="1R1C", known={"Q_h": 6.0}),
    "two-stage": lambda: HybridPredictor(
        GrayBoxRC("1R1C", known={"Q_h": 6.0}, n_starts=1), DisturbanceForecaster("ridge"), disturbance="output"
    ),
}


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@pytest.mark.parametrize("scheme", ROLLING)
def test_quantiles_after_updates_are_those_of_a_back_test(scheme):
    """Also where more rows were taken in than those whose errors count."""
    X = make_office(34, "chicago", random_state=5, sampling_time="1h").X
    train, later = X[: 9 * 24], X[9 * 24 :]
    model = ROLLING[scheme]().fit(train, train["T_za"])
    whole, bands = copy.deepcopy(model), ["q_0.1", "q_0.5", "q_0.9"]
    ends = [30, 24 * 24 + 5]
    expected = whole.predict_quantiles_from(later, np.array(ends) - 1)
    for begin, end, rolled in zip([0, ends[0]], ends, expected, strict=True):
        model.update(later[begin : end - 1]).update(later[end - 1 : end])
        future = later[end : end + 24].drop(columns="T_za")
        found = [model.forecast(None, future, quantiles=(0.1, 0.5, 0.9))]
        if end < 100:
            found.append(whole.forecast(later[:end], future, quantiles=(0.1, 0.5, 0.9)))
        for frame in found:
            np.testing.assert_allclose(frame[bands], rolled[: len(future)], rtol=0, atol=1e-8)
    found = model.predict_quantiles_from(later[end:], [3], horizon="6h")
    np.testing.assert_allclose(found, whole.predict_quantiles_from(later, [end + 3], horizon="6h"), rtol=0, atol=1e-8)


# ------------------------------------------------------------------------------------------------------- estimators
def test_four_fifths_of_an_office_are_covered(office, arx):
    X, y = office.X[28 * 96 :], office.y[28 * 96 :].to_numpy()
    low, middle, high = arx.predict_quantiles(X).T
    assert 0.75 <= np.mean((low <= y) & (y <= high)) <= 0.85
    assert (low <= middle).all()
    assert (middle <= high).all()


def test_rolled_quantiles_are_those_from_their_origins(office, arx):
    X = office.X[28 * 96 :]
    rolled = arx.predict_quantiles(X, LEVELS)
    assert rolled.shape == (len(X), 7)
    origins = [0, 3 * 96, 20 * 96]
    for origin, path in zip(origins, arx.predict_quantiles_from(X, origins, LEVELS), strict=True):
        np.testing.assert_allclose(rolled[origin + 1 : origin + 97], path, rtol=0, atol=1e-9)


def test_the_interval_grows_while_nothing_is_measured(office, arx):
    X = office.X[28 * 96 : 31 * 96]
    silent = X.assign(T_za=X["T_za"].where(np.arange(len(X)) < 86))
    shown, hidden = (np.ptp(arx.predict_quantiles_from(t, [95], (0.1, 0.9))[0], axis=1) for t in (X, silent))
    assert hidden[0] > 2.0 * shown[0]
    np.testing.assert_allclose(hidden[-1], shown[-1], rtol=0.3)


@pytest.mark.parametrize("horizon", [None, "2D", "1h"])
def test_every_horizon_has_quantiles(office, horizon):
    model = ARXRegressor(horizon=horizon).fit(office.X[: 8 * 96], office.y[: 8 * 96])
    for X in (office.X[8 * 96 : 12 * 96], office.X[9 * 96 : 12 * 96], office.X[9 * 96 : 9 * 96 + 1]):
        bands = model.predict_quantiles(X)
        assert np.isfinite(bands).all()
        assert (np.diff(bands, axis=1) >= 0).all()


def test_a_table_without_stamps_or_history_has_quantiles(office):
    X = office.X[["T_oa", "q_sol", "u_heat"]].to_numpy()
    model = ARXRegressor(sampling_time="15min").fit(X[: 8 * 96], office.y[: 8 * 96])
    bands = model.predict_quantiles(X[8 * 96 : 10 * 96])
    assert np.isfinite(bands).all()
    assert (np.diff(bands, axis=1) > 0).all()  # nothing is known, so nothing is certain, the first row included


@pytest.mark.parametrize("quantiles", [(), (0.0, 0.5), (0.9, 0.1), (0.5, 0.5), (0.1, 1.2), [[0.1, 0.9]]])
def test_quantiles_that_are_none_are_refused(office, arx, quantiles):
    with pytest.raises(ValueError, match="between 0 and 1, in increasing order"):
        arx.predict_quantiles(office.X[28 * 96 :], quantiles)


def test_a_table_that_is_too_short_is_refused_when_quantiles_are_asked(office):
    model = ARXRegressor().fit(office.X[:4], office.y[:4])
    with pytest.raises(ValueError, match="too short to learn intervals"):
        model.predict_quantiles(office.X[4:20])


def test_intervals_that_were_not_wanted_are_named(office):
    model = ARXRegressor(intervals=False).fit(office.X, office.y)
    np.testing.assert_array_equal(model.coef_, ARXRegressor().fit(office.X, office.y).coef_)
    with pytest.raises(ValueError, match="with intervals=False; fit again with intervals=True"):
        model.predict_quantiles(office.X[-96:])


def test_a_saved_model_has_the_same_quantiles(office, arx, tmp_path):
    save_model(arx, tmp_path / "model.skops")
    X = office.X[28 * 96 : 33 * 96]
    np.testing.assert_array_equal(load_model(tmp_path / "model.skops").predict_quantiles(X), arx.predict_quantiles(X))


# ----------------------------------------------------------------------------------------------------- back-tests
def test_a_backtest_carries_quantiles_and_scores_them(office, arx):
    X, y = office.X[28 * 96 : 38 * 96], office.y[28 * 96 : 38 * 96]
    frame = backtest(arx, X, y, quantiles=(0.1, 0.5, 0.9))
    assert list(frame.columns[-3:]) == ["q_0.1", "q_0.5", "q_0.9"]
    pd.testing.assert_frame_equal(frame[frame.columns[:5]], backtest(arx, X, y))
    frame.loc[5:20, "y_true"] = np.nan
    scores = score_intervals(frame)
    inside, widths, losses = [], [], []
    for row in frame.itertuples():
        truth, bands = row.y_true, row[6:9]
        if np.isfinite(truth):
            inside.append(bands[0] <= truth <= bands[2])
            widths.append(bands[2] - bands[0])
            for level, band in zip((0.1, 0.5, 0.9), bands, strict=True):
                losses.append(level * (truth - band) if truth >= band else (1 - level) * (band - truth))
    expected = [0.8, np.mean(inside), np.mean(widths), np.mean(losses), len(inside)]
    np.testing.assert_allclose(scores[["nominal", "coverage", "width", "pinball", "n"]], expected, rtol=1e-9)
    by_lead = score_intervals(frame, by="lead")
    assert by_lead["n"].sum() == scores["n"]
    night = score_intervals(frame, by=(frame["time"].dt.hour < 6).to_numpy())
    assert list(night.index) == [False, True]
    assert score_backtest(frame)["n"] == scores["n"]


def test_what_has_no_quantiles_says_so(office, arx):
    X, y = office.X[28 * 96 : 31 * 96], office.y[28 * 96 : 31 * 96]
    with pytest.raises(ValueError, match="has no interval"):
        score_intervals(backtest(arx, X, y))
    box = GrayBoxRC(known={"Q_h": 6.0}, n_starts=1, random_state=0).fit(office.X[: 5 * 96], office.y[: 5 * 96])
    with pytest.raises(ValueError, match="GrayBoxRC forecasts no quantiles"):
        backtest(box, X, y, quantiles=(0.1, 0.9))


def test_one_quantile_may_be_given_alone(office, arx):
    X, y = office.X[28 * 96 :], office.y[28 * 96 :]
    pd.testing.assert_frame_equal(backtest(arx, X, y, quantiles=0.5), backtest(arx, X, y, quantiles=[0.5]))


def test_other_columns_of_a_back_test_are_no_quantiles(office, arx):
    frame = backtest(arx, office.X[28 * 96 :], office.y[28 * 96 :], quantiles=(0.1, 0.9))
    pd.testing.assert_series_equal(score_intervals(frame.assign(q_e=1.0, q_5=1.0)), score_intervals(frame))


@pytest.mark.parametrize("by", [3, ["lead"], ("lead", "origin")])
def test_labels_that_are_not_one_per_row_are_refused(office, arx, by):
    frame = backtest(arx, office.X[28 * 96 :], office.y[28 * 96 :], quantiles=(0.1, 0.9))
    with pytest.raises(ValueError, match=rf"^by has the shape .*; give a label for each of {len(frame)} rows"):
        score_intervals(frame, by=by)
