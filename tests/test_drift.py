"""The drift signal: false alarms, what it finds and how it calls it."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError

from skhybrid import DisturbanceForecaster, HybridPredictor, InputDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.hybrid import DriftMonitor
from skhybrid.hybrid.drift import threshold

DAY = 96
HOURS = np.arange(24)
#: what a working day looks like, Saturdays and Sundays at rest
WORK = 2.0 * ((HOURS >= 8) & (HOURS < 18))


def _days(n, rng, correlation=0.0, start="2023-01-02"):
    """A forecast and a measured series of days, whose errors grow and shrink from day to day."""
    index = pd.date_range(start, periods=n, freq="D")
    forecast = np.where(index.day_of_week.to_numpy()[:, None] < 5, WORK, 0.0)
    size, errors = rng.normal(), np.empty((n, 24))
    for day in range(n):
        size = correlation * size + np.sqrt(1 - correlation**2) * rng.normal()
        level = 0.0
        for hour in range(24):
            level = 0.8 * level + 0.6 * rng.normal()
            errors[day, hour] = 0.2 * np.exp(0.3 * size) * level
    return pd.DataFrame(forecast + errors, index=index), pd.DataFrame(forecast, index=index)


def test_siegmunds_threshold_has_its_run_length():
    """Plain sums of independent normal steps, run until they cross."""
    rng, wanted = np.random.default_rng(0), 60.0
    limit, lengths = threshold(wanted), []
    for _ in range(400):
        total, n = 0.0, 0
        while total <= limit:
            total, n = max(0.0, total + rng.normal() - 0.5), n + 1
        lengths.append(n)
    assert np.mean(lengths) == pytest.approx(wanted, rel=0.2)


@pytest.mark.parametrize("correlation", [0.0, 0.6])
@pytest.mark.slow
def test_a_building_that_stays_raises_few_alarms(correlation):
    """One a year is meant; with four weeks of reference and errors that resemble those of yesterday at most three."""
    rng, alarms, years = np.random.default_rng(1), 0, 20
    for _ in range(2 * years):
        measured, forecast = _days(28 + 182, rng, correlation)
        drifted = DriftMonitor().fit(measured[:28], forecast[:28]).watch(measured[28:], forecast[28:])["drifted"]
        alarms += int((drifted & ~drifted.shift(fill_value=False)).sum())
    assert alarms / years <= 3.0


def _level(measured):
    return measured + 1.0


def _schedule(measured):
    return pd.DataFrame(np.roll(measured, 3, axis=1), index=measured.index)


def _quiet(measured):
    return 0.1 * measured


@pytest.mark.parametrize(("change", "kind"), [(_level, "level"), (_schedule, "schedule"), (_quiet, "quiet")])
def test_a_change_is_found_within_a_week_and_called_by_its_kind(change, kind):
    measured, forecast = _days(28 + 56, np.random.default_rng(2))
    measured = pd.concat([measured[:56], change(measured[56:])])
    monitor = DriftMonitor().fit(measured[:28], forecast[:28])
    found = monitor.watch(measured[28:], forecast[28:])
    first = found.index[found["drifted"]][0]
    at = measured.index[56]
    assert at <= first < at + pd.Timedelta("7D")
    assert abs(found.loc[first, "since"] - at) <= pd.Timedelta("2D")
    assert set(found.loc[first + pd.Timedelta("3D") :, "kind"]) - {""} == {kind}  # a closed weekend is a usual one
    assert not found.loc[: at - pd.Timedelta("1D"), "drifted"].any()
    early = monitor.watch(measured[28:70], forecast[28:70])
    pd.testing.assert_frame_equal(early, found[:42])  # a day's row knows nothing of later ones


def test_what_comes_back_is_found_where_the_size_says_little():
    """Days of very unlike sizes, then the same error at the same hours of every day, as large as the mean before."""
    rng = np.random.default_rng(5)
    index = pd.date_range("2023-01-02", periods=28 + 56, freq="D")
    size = np.exp(rng.normal(0.0, 0.8, len(index)))
    errors = size[:, None] * rng.normal(0.0, 0.3, (len(index), 24))
    forecast = pd.DataFrame(np.zeros_like(errors), index=index)
    usual = np.sqrt(np.mean(errors[:28] ** 2))
    errors[56:] = usual * np.sign(np.sin(2 * np.pi * HOURS / 24) + 0.01)
    measured = forecast + errors
    monitor = DriftMonitor().fit(measured[:28], forecast[:28])
    found = monitor.watch(measured[28:], forecast[28:])
    first = found.index[found["drifted"]][0]
    assert index[56] <= first < index[56] + pd.Timedelta("5D")
    assert found.loc[first, "kind"] == "schedule"
    products, means = [], {}
    for day in range(28):
        weekend = index[day].day_of_week >= 5
        if weekend in means:
            products.append(np.mean(errors[day] * means[weekend]) / usual**2)
        own = np.sqrt(np.mean(errors[day] ** 2)) / usual
        counted = errors[day] * min(1.0, 3.0 / own)
        means[weekend] = counted if weekend not in means else 0.7 * means[weekend] + 0.3 * counted
    np.testing.assert_allclose(monitor.recurrence_, [np.mean(products), np.std(products, ddof=1)], rtol=1e-9)


def test_an_alarm_ends_when_the_errors_are_small_again_and_missing_days_say_nothing():
    measured, forecast = _days(28 + 70, np.random.default_rng(3))
    measured[40:50] += 1.5
    found = DriftMonitor().fit(measured[:28], forecast[:28]).watch(measured[28:], forecast[28:])
    assert found["drifted"].iloc[21]
    assert not found["drifted"].iloc[-1]
    measured[50:60] = np.nan
    held = DriftMonitor().fit(measured[:28], forecast[:28]).watch(measured[28:], forecast[28:])["statistic"]
    np.testing.assert_array_equal(held.iloc[22:32], held.iloc[22])
    with pytest.raises(ValueError, match="the reference has 5 days"):
        DriftMonitor().fit(measured[:5], forecast[:5])


def test_the_hybrid_sees_a_schedule_move():
    office = make_office(n_days=42, random_state=0)
    n, at = 28 * DAY, 33 * DAY
    moved = make_office(n_days=14, start=office.X.index[at] - pd.Timedelta("1D"), random_state=7).X.shift(
        20, freq="15min"
    )
    X = pd.concat([office.X[:at], moved[moved.index >= office.X.index[at]]])
    gray_box = InputDisturbanceID(known={"Q_h": 6.0}, n_starts=2)
    model = HybridPredictor(gray_box, DisturbanceForecaster("ridge"), random_state=0).fit(X[:n], X["T_za"][:n])
    days = model.drift(X[n:])
    before, after = days[: X.index[at] - pd.Timedelta("1D")], days[X.index[at] :]
    assert not before["drifted"].any()
    assert after["drifted"].iloc[3:].all()
    assert (after["kind"].iloc[3:] == "schedule").all()
    live = deepcopy(model).update(X[n:]).drift()  # the last day is not over while no row follows it
    pd.testing.assert_frame_equal(live, days[: len(live)])
    assert len(live) >= len(days) - 1


def test_the_default_takes_its_reference_wherever_its_table_begins():
    """At 02:15 there is no forecast from midnight itself; the first one behind it stands for the day."""
    X = make_office(n_days=20, sampling_time="15min", random_state=3).X[9:]
    n = 14 * DAY
    days = HybridPredictor(adapt=None).fit(X[:n], X["T_za"][:n]).drift(X[n:])
    assert len(days) == 4  # of the last one no row follows
    assert not days["drifted"].any()


def test_a_shorter_horizon_raises_no_alarms_of_its_own():
    """The reference has errors of forecasts over the horizon, and so must the days that are tested."""
    office = make_office(41, random_state=2)
    model = HybridPredictor(horizon="5h").fit(office.X[: 28 * DAY], office.y[: 28 * DAY]).update(office.X[28 * DAY :])
    days = model.drift()
    assert len(days) == 12
    assert not days["drifted"].any()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (lambda days: days[days.columns[::-1]], "step 0 of the days is the column 23, but that of fit is 0; "),
        (lambda days: days.rename(columns={5: "05:00"}), "step 5 of the days is the column '05:00', but that of fit"),
        (lambda days: days[days.columns[:12]], "the days have 12 steps, but those of fit have 24; "),
    ],
)
def test_days_with_other_columns_than_the_reference_are_refused(changed, said):
    measured, forecast = _days(40, np.random.default_rng(0))
    monitor = DriftMonitor().fit(measured[:30], forecast[:30])
    with pytest.raises(ValueError, match=said):
        monitor.watch(changed(measured[30:]), changed(forecast[30:]))


def test_what_a_monitor_cannot_read_is_refused():
    days = _days(30, np.random.default_rng(0))
    with pytest.raises(NotFittedError, match="call fit first"):
        DriftMonitor().watch(*days)
    for rate in (0.0, -1.0, np.nan, np.inf, "one", True):
        with pytest.raises(ValueError, match=r"false_alarms_per_year=.* must be a positive number"):
            DriftMonitor(rate).fit(*days)
    with pytest.raises(ValueError, match="needs increasing days"):
        DriftMonitor().fit(*(part[::-1] for part in days))
