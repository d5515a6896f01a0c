"""Holidays: what is read as one, the kind of day that it makes, and what it is worth to a forecast."""

from __future__ import annotations

import sys
from datetime import date, datetime

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, clone

from skhybrid import ARXRegressor, DisturbanceForecaster, HybridPredictor, SchedulePredictor
from skhybrid import _holidays as holidays_module
from skhybrid._calendar import day_type_hour, day_type_hours
from skhybrid._holidays import read_holidays
from skhybrid._table import read_table
from skhybrid.datasets import make_office
from skhybrid.forecasting.features import encode_time
from skhybrid.hybrid import DriftMonitor
from skhybrid.identification import InputDisturbanceID, PeriodicDisturbanceID
from skhybrid.identification.experiment import make_experiment
from skhybrid.persistence import load_model, save_model
from skhybrid.study.compared_models import make_models
from skhybrid.study.settings import settings_from
from skhybrid.thermal import get_network

DAY = 96
YEAR = pd.date_range("2018-01-01", "2018-12-31 23:00", freq="1h", tz="America/Chicago")
US_2018 = [
    "2018-01-01", "2018-01-15", "2018-02-19", "2018-05-28", "2018-07-04", "2018-09-03", "2018-10-08", "2018-11-11",
    "2018-11-12", "2018-11-22", "2018-12-25",
]  # fmt: skip
#: Wednesdays, of which the last one is forecast
AWAY = ["2023-07-19", "2023-08-09"]


@pytest.fixture(scope="module")
def office():
    """Five weeks from a Monday, and the day that is forecast, in the middle of the fifth."""
    found = make_office(n_days=35, start="2023-07-10", holidays=AWAY, random_state=3)
    at = found.X.index.get_loc(pd.Timestamp(AWAY[1]))
    return found, at


def _table(index, holidays, **columns):
    X = pd.DataFrame({"T_oa": np.zeros(len(index))} | columns, index=index)
    return read_table(BaseEstimator(), X, reset=True, holidays=holidays)


# ------------------------------------------------------------------------------------------------- what is read as one
@pytest.mark.parametrize(
    "given",
    [
        "US",
        US_2018,
        tuple(map(date.fromisoformat, US_2018)),
        np.array(US_2018, dtype="datetime64[D]"),
        pd.DatetimeIndex(US_2018),
        pd.DatetimeIndex(US_2018, tz="America/Chicago"),
        pd.Series(pd.to_datetime(US_2018)),
    ],
)
def test_dates_and_a_country_say_the_same(given):
    day = read_holidays(given, YEAR).day_of_week(YEAR)
    holiday = pd.Index(YEAR.strftime("%Y-%m-%d")).isin(US_2018)
    np.testing.assert_array_equal(day, np.where(holiday, 6, YEAR.day_of_week))
    assert holiday.sum() == 24 * len(US_2018)  # whole local days, from local midnight on


def test_holidays_of_every_year_are_found_in_any_order():
    days = pd.DatetimeIndex(["2025-01-02", "2024-12-25", "2025-01-01", "2023-12-25", "2025-01-03"])
    known = read_holidays("US", days)
    assert known.weekend(days).tolist() == [False, True, True, True, False]
    assert known.weekend(days[::-1]).tolist() == [False, True, True, True, False]


def test_states_differ_from_their_country_and_years_from_each_other():
    pulaski = pd.DatetimeIndex(["2018-03-05", "2019-03-04"])
    np.testing.assert_array_equal(read_holidays("US-IL", YEAR).day_of_week(pulaski), [6, 6])
    np.testing.assert_array_equal(read_holidays("US", YEAR).day_of_week(pulaski), [0, 0])
    turn = pd.date_range("2021-12-30", "2022-01-03", freq="1D")  # New Year's Day, a Saturday, is kept on Friday
    np.testing.assert_array_equal(read_holidays("US", YEAR).day_of_week(turn), [3, 6, 6, 6, 0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("Utopia", "holidays='Utopia' is unknown to the package holidays; give a country or state such as 'US'"),
        ("US-XX", "holidays='US-XX' is unknown"),
        ("utils", "holidays='utils' is unknown"),  # a module of the package
        (7, r"holidays= \(int\) is neither a name nor dates"),
        ({"2018-12-25": "Christmas"}, r"holidays= \(dict\) is neither a name nor dates"),
        (np.array([US_2018]), r"holidays= \(ndarray\) is neither a name nor dates"),
        (["2018-12"], "holidays= has '2018-12', which is not a date"),
        (["25/12/2018"], "holidays= has '25/12/2018', which is not a date"),
        ([2018], "holidays= has 2018, which is not a date"),
        ([["2018-12-25"]], r"holidays= has \['2018-12-25'\], which is not a date"),
        ([pd.NaT], "holidays= has NaT, which is not a date"),
        (["2018-12-25 08:00"], "holidays= has 2018-12-25 08:00, which has a time of day"),
        (YEAR[:30], "which has a time of day"),
        (pd.DatetimeIndex(US_2018, tz="UTC"), r"in the time zone UTC, but X has America/Chicago; give local dates"),
    ],
)
def test_what_is_no_holiday_is_refused_in_one_sentence(given, message):
    with pytest.raises(ValueError, match=message) as refusal:
        _table(YEAR, given)
    assert str(refusal.value).count(". ") == 0


def test_dates_need_stamps():
    with pytest.raises(ValueError, match="holidays= needs dates, but X has no time stamps"):
        ARXRegressor(holidays="US", sampling_time="15min").fit(np.zeros((400, 2)), np.zeros(400))


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "holidays", None)
    holidays_module._holidays_of.cache_clear()
    with pytest.raises(ImportError, match=r'holidays=\'NL\' needs the package holidays; .*"skhybrid\[holidays\]"'):
        _table(YEAR, "NL")
    assert _table(YEAR, US_2018).weekend.any()  # dates need none


# ------------------------------------------------------------------------------------------------------ kinds of days
def test_a_holiday_is_a_sunday_to_every_feature():
    hours = pd.date_range("2023-07-03", periods=14 * 24, freq="1h")  # a Monday
    plain, with_one = _table(hours, None), _table(hours, ["2023-07-11"])
    tuesday, sunday = slice(8 * 24, 9 * 24), slice(6 * 24, 7 * 24)
    for feature in ("how", "dow", "weekday"):
        usual, found = encode_time(plain, feature, "cyclic"), encode_time(with_one, feature, "cyclic")
        np.testing.assert_array_equal(found[tuesday], usual[sunday])
        assert not np.array_equal(found[tuesday], usual[tuesday])
        np.testing.assert_array_equal(np.delete(found, tuesday, axis=0), np.delete(usual, tuesday, axis=0))
    np.testing.assert_array_equal(encode_time(with_one, "hod", "onehot"), encode_time(plain, "hod", "onehot"))
    np.testing.assert_array_equal(day_type_hour(with_one)[tuesday], 24 + np.arange(24))
    assert with_one.rows(tuesday).weekend.all()


def test_the_kind_of_a_row_beside_a_table_is_that_of_the_table_with_it():
    """Rows are counted from the last one, also over a change of the clocks, which is a Sunday."""
    whole = _table(YEAR, ["2018-03-09"])
    last = YEAR.get_loc(pd.Timestamp("2018-03-08 12:00", tz=YEAR.tz))
    rows = np.arange(-30, 24 * 5)
    found = day_type_hours(whole.rows(slice(0, last + 1)), rows)
    np.testing.assert_array_equal(found, day_type_hour(whole)[last + rows])


def test_last_week_and_profile_take_days_of_the_same_kind():
    """Each day's disturbance is its number; the holiday is a Tuesday, the Sunday before it is day 13."""
    hours = pd.date_range("2023-07-03", periods=24 * 24, freq="1h")
    zeta = pd.Series(np.repeat(np.arange(24.0), 24), hours)
    X = pd.DataFrame({"T_oa": 10.0, "zeta": zeta})
    last = DisturbanceForecaster("last_week", holidays=["2023-07-18"]).fit(X, zeta)
    at = [i * 24 - 1 for i in (15, 16, 20, 22)]
    np.testing.assert_array_equal(last.predict_from(X, at)[:, 0], [13, 9, 15, 8])
    plain = DisturbanceForecaster("last_week").fit(X, zeta)
    np.testing.assert_array_equal(plain.predict_from(X, at)[:, 0], [8, 9, 13, 15])
    profile = DisturbanceForecaster("profile", holidays=["2023-07-18"]).fit(X, zeta)
    np.testing.assert_allclose(profile.predict_from(X, [15 * 24 - 1])[0], np.mean([6, 13, 15, 20]))


def test_the_drift_monitor_compares_a_holiday_with_weekends():
    days = pd.date_range("2018-11-01", periods=28, freq="1D")
    rng = np.random.default_rng(0)
    size = np.where(days.day_of_week >= 5, 0.1, 1.0)
    size[21] = 0.1  # 2018-11-22
    error = pd.DataFrame(size[:, None] * rng.normal(size=(28, 24)), index=days)
    plain, told = (DriftMonitor(holidays=h).fit(error, 0.0 * error) for h in (None, ["2018-11-22"]))
    assert told.std_ < 0.8 * plain.std_


# ------------------------------------------------------------------------------------------------- what it is worth
def _day_ahead(model, office, at):
    """Errors of the day ahead from midnight [K]."""
    X, y = office.X, office.y
    model.fit(X[: at - DAY], y[: at - DAY])
    history, future = X[at - DAY : at], X[at : at + DAY]
    paths = model.predict_from(pd.concat([history, future]), [DAY - 1])[0]
    return paths - y[at : at + DAY].to_numpy()


@pytest.mark.parametrize(
    "make",
    [ARXRegressor, lambda holidays: SchedulePredictor(known={"Q_h": 6.0}, intervals=False, holidays=holidays)],
    ids=["ARX", "schedule"],
)
def test_a_holiday_that_is_known_is_forecast_better(make, office):
    log, at = office
    told = _day_ahead(make(holidays=AWAY), log, at)
    untold = _day_ahead(make(holidays=None), log, at)
    assert np.sqrt(np.mean(told**2)) < 0.8 * np.sqrt(np.mean(untold**2))


def test_the_disturbance_of_a_holiday_is_forecast_better(office):
    log, at = office
    hourly = log.X.assign(zeta=log.heat_gain).resample("1h").mean()
    begin, errors = at // 4, []
    for holidays in (AWAY, None):
        model = DisturbanceForecaster("ridge", holidays=holidays)
        model.fit(hourly[: begin - 24], hourly["zeta"][: begin - 24])
        path = model.predict_from(hourly[begin - 24 :], [23])[0]
        errors.append(np.sqrt(np.mean((path - hourly["zeta"][begin : begin + 24]) ** 2)))
    assert errors[0] < 0.7 * errors[1]


def test_the_two_stages_pass_holidays_on(office):
    log, at = office
    parts = HybridPredictor(PeriodicDisturbanceID(), holidays=AWAY)._make_scheme()
    assert parts.gray_box.holidays == parts.forecaster.holidays == AWAY
    gray_box = InputDisturbanceID(known=log.theta_effective, n_starts=1)
    model = HybridPredictor(gray_box, holidays=AWAY, adapt=None, intervals=False)
    told = _day_ahead(model, log, at)
    assert model._scheme.steps.weekend.sum() == (8 + 1) * 24
    untold = _day_ahead(clone(model).set_params(holidays=None), log, at)
    assert np.sqrt(np.mean(told**2)) < 0.9 * np.sqrt(np.mean(untold**2))


def test_an_identification_reads_a_holiday_as_a_weekend_day():
    table = _table(YEAR, "US", T_za=np.zeros(len(YEAR)))
    experiment = make_experiment(get_network("1R1C"), ("T_oa",), table, table.measured())
    assert experiment.weekend.sum() == 24 * (104 + len(US_2018) - 1)  # Veterans Day was a Sunday


# ----------------------------------------------------------------------------------------------------- over the days
def test_holidays_stay_through_updates_files_and_new_fits(office, tmp_path):
    log, at = office
    begin = at - 2 * DAY
    model = SchedulePredictor(known={"Q_h": 6.0}, holidays=tuple(AWAY), intervals=False)
    model.fit(log.X[:begin], log.y[:begin])
    future = log.X[at + DAY // 2 : at + DAY].drop(columns="T_za")
    along = model.forecast(log.X[begin : at + DAY // 2], future)  # across the midnight before the holiday
    for a, b in ((begin, begin + 1), (begin + 1, at - 7), (at - 7, at + DAY // 2)):
        model.update(log.X[a:b])
    pd.testing.assert_frame_equal(model.forecast(None, future), along)
    save_model(model, tmp_path / "model.skops")
    loaded = load_model(tmp_path / "model.skops")
    assert loaded.holidays == tuple(AWAY)
    pd.testing.assert_frame_equal(loaded.forecast(None, future), along)
    rows = slice(at + DAY // 2, at + 2 * DAY)
    model.partial_fit(log.X[rows], log.y[rows])
    assert model._scheme.rows.training.weekend.sum() == 10 * DAY


@pytest.mark.parametrize("holidays", [[date(2023, 7, 19)], [datetime(2023, 7, 19)], pd.DatetimeIndex(AWAY), "US-IL"])
def test_every_kind_of_holidays_can_be_saved(holidays, office, tmp_path):
    X, y = office[0].X[: 7 * DAY], office[0].y[: 7 * DAY]
    model = ARXRegressor(holidays=holidays).fit(X, y)
    save_model(model, tmp_path / "model.skops")
    loaded = load_model(tmp_path / "model.skops")
    assert list(loaded.holidays) == list(holidays)
    np.testing.assert_array_equal(loaded.predict(X), model.predict(X))


def test_a_holiday_outside_the_rows_changes_nothing(office):
    log, _ = office
    X, y = log.X[: 20 * DAY], log.y[: 20 * DAY]
    plain, told = (ARXRegressor(holidays=h).fit(X, y) for h in (None, ["2030-01-01"]))
    np.testing.assert_array_equal(plain.predict(X), told.predict(X))
    assert clone(told).get_params()["holidays"] == ["2030-01-01"]


def test_a_study_reads_holidays():
    content = {"columns": {"T_za": "room", "T_oa": "outdoor"}, "forecaster": {"model": "ridge"}}
    models = {m.label: m.estimator for m in make_models(settings_from(content | {"holidays": "NL"}))}
    for label in (
        "hybrid",
        "ARX re-fitted",
        "ARX, multi-step, re-fitted",
        "boosting on ARX",
        "hybrid, two-stage (last_week)",
    ):
        assert models[label].holidays == "NL"
    assert settings_from(content | {"holidays": [date(2021, 12, 27)]}).holidays == [date(2021, 12, 27)]
    with pytest.raises(ValueError, match="holidays='Utopia' is unknown"):
        settings_from(content | {"holidays": "Utopia"})
