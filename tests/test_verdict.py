"""The verdict on a forecast, from comparisons with simple rules by a bootstrap over blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office
from skhybrid.identification import OutputDisturbanceID
from skhybrid.study import Settings, split_log
from skhybrid.study.compared_models import HYBRID
from skhybrid.study.doubts import Doubts, at_ends, day_beyond, drift_days, drifted, in_words, ranges_of
from skhybrid.study.identified_building import describe, identified_only, parameter_table
from skhybrid.study.load_rules import RIDGE, YESTERDAY, rule_loads
from skhybrid.study.log_split import StudyData
from skhybrid.study.settings import is_scaled
from skhybrid.study.verdict import CARE, NOT, USABLE, compare_errors, judge
from skhybrid.study.zone_loads import Load, ZoneLoads, load_of, of_whole_plant
from skhybrid.zone.zone_backtest import backtest_zone

pytestmark = pytest.mark.usefixtures("quick_fits")


def _errors(size, n_blocks=20, seed=0):
    drawn = np.random.default_rng(seed).normal(size=24 * n_blocks)
    return pd.Series(size * drawn / np.sqrt(np.mean(drawn**2)))


BLOCKS = pd.Series(np.repeat(np.arange(20), 24))


def test_a_ratio_and_its_interval():
    found = compare_errors(_errors(0.5), _errors(1.0, seed=1), BLOCKS, "yesterday")
    assert found.ratio == pytest.approx(0.5)
    assert found.low < found.ratio < found.high < 0.7
    own = _errors(0.5).mask(np.arange(480) < 24)
    assert compare_errors(own, own * 2, BLOCKS, "twice").ratio == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("size", "given", "level", "words"),
    [
        (0.5, {}, USABLE, "times that of yesterday"),
        (1.0, {}, CARE, "not surely better"),
        (2.0, {}, NOT, "yesterday is better"),
        (0.5, {"coverage": 0.8}, USABLE, "times that of yesterday"),
        (0.5, {"coverage": 0.6}, CARE, "contained 60 %"),
        (0.5, {"coverage": 0.4}, NOT, "contained 40 %"),
        (0.5, {"doubts": ["its kW have no certain scale"]}, CARE, "no certain scale"),
        (0.5, {"n_origins": 3}, CARE, "3 forecasts only"),
    ],
)
def test_levels_and_their_reasons(size, given, level, words):
    compared = compare_errors(_errors(size), _errors(1.0, seed=1), BLOCKS, "yesterday")
    found = judge("temperature", [compared], **{"n_origins": 20, **given})
    assert found.level == level
    assert words in str(found)


def test_few_forecasts_are_no_ground_for_a_verdict():
    own, rule = _errors(2.0)[:24], _errors(1.0, seed=1)[:24]
    compared = compare_errors(own, rule, BLOCKS[:24], "yesterday")
    found = judge("load", [compared], n_origins=1, coverage=0.2)
    assert found.level == CARE
    assert "over too few forecasts to judge by" in str(found)
    assert "90 % interval" not in str(found)


def test_the_hardest_rule_counts():
    easy = compare_errors(_errors(0.5), _errors(4.0, seed=1), BLOCKS, "last week")
    hard = compare_errors(_errors(0.5), _errors(0.2, seed=1), BLOCKS, "yesterday")
    assert judge("load", [easy, hard], n_origins=20).level == NOT


def test_a_rule_without_error_is_the_hardest_one():
    easy = compare_errors(_errors(0.5), _errors(4.0, seed=1), BLOCKS, "last week")
    right = compare_errors(_errors(0.5), _errors(1.0) * 0.0, BLOCKS, "yesterday")
    found = judge("load", [easy, right], n_origins=20)
    assert found.level == CARE
    assert "yesterday makes no error" in str(found)
    few = compare_errors(_errors(0.5)[:24], _errors(1.0)[:24] * 0.0, BLOCKS[:24], "yesterday")
    assert judge("load", [few], n_origins=1).level == CARE
    assert "nothing to compare" in str(judge("load", [compare_errors(*[_errors(0.0)] * 2, BLOCKS, "")], n_origins=20))


def test_a_rule_that_errs_in_one_block_alone_is_not_surely_worse():
    rule = _errors(40.0, seed=1).where(BLOCKS == 3, 0.0)
    found = compare_errors(_errors(0.5), rule, BLOCKS, "yesterday")
    assert found.high == np.inf
    assert judge("load", [found], n_origins=20).level == CARE


def test_rules_for_the_load():
    index = pd.date_range("2024-01-01", periods=24 * 20, freq="1h")
    T_oa = pd.Series(5.0 + 5.0 * np.sin(np.arange(480) / 9.0), index=index)
    held = pd.Series(20.0, index=index)
    heat = 0.2 * (held - T_oa)
    frame = pd.DataFrame({"T_oa": T_oa})
    rules = rule_loads(frame[:360], frame[360:], heat, held)
    pd.testing.assert_series_equal(rules[YESTERDAY], heat.shift(24)[360:], check_names=False, check_freq=False)
    np.testing.assert_allclose(rules[RIDGE], heat[360:], atol=0.01)
    apart = rule_loads(frame[:336], frame[350:], heat.drop(index[336:350]), held)[YESTERDAY]  # rows lack in between
    pd.testing.assert_series_equal(
        apart.dropna(), heat.shift(24)[apart.dropna().index], check_names=False, check_freq=False
    )
    assert apart.isna().sum() == 14  # whose day before lacks
    heat[360:] = 99.0  # what was delivered after training is not learned from
    np.testing.assert_allclose(rule_loads(frame[:360], frame[360:], heat, held)[RIDGE], rules[RIDGE])


def test_a_load_is_judged_by_its_error_from_the_test_rows_on():
    stamps = pd.date_range("2024-01-01", periods=24 * 12, freq="1h")
    delivered = pd.Series(2.0 + np.sin(np.arange(len(stamps))), stamps)
    noise = pd.Series(np.random.default_rng(0).normal(size=len(stamps)), stamps)
    own = (delivered + 0.5 * noise).where(stamps >= pd.Timestamp("2024-01-03"), 1e6)  # no row before counts
    rules = {"twice as wrong": delivered + noise}
    loads = ZoneLoads({HYBRID: own}, delivered, rules, "kW")
    found = loads.verdict(pd.Timestamp("2024-01-03"), scaled=True)
    assert found.level == USABLE
    assert "0.50 times that of twice as wrong" in str(found)
    assert loads.verdict(pd.Timestamp("2024-01-03"), scaled=False).level == CARE


def test_a_load_counts_in_rows_at_whose_ends_the_temperature_is_known():
    stamps = pd.date_range("2024-01-01", periods=24 * 20, freq="1h")
    rows = pd.DataFrame({"T_za": 20.0, "T_oa": 5.0, "Q_hvac": 2.0}, stamps)
    rows.iloc[24 * 15 + 3, 0] = np.nan
    data = StudyData(rows[: 24 * 10], rows[24 * 10 :], stamps[24 * 10], *[rows[:0]] * 2, rows["T_za"][:0], False)
    loads = ZoneLoads.of({HYBRID: pd.Series(3.0, stamps)}, Load(rows["Q_hvac"], "kW"), data)
    errors = loads.errors(stamps[24 * 15])[HYBRID]
    assert list(errors.index[errors.isna()]) == [*stamps[24 * 15 + 2 : 24 * 15 + 4], stamps[-1]]
    assert (errors.dropna() == 1.0).all()


def test_a_day_beyond_what_training_covered_is_told_with_its_columns():
    train = pd.DataFrame({"T_oa": [0.0, 10.0], "q_sol": [0.0, 0.5]})
    day = pd.DataFrame({"T_oa": [5.0] * 7 + [-0.4, -3.0, -4.0], "q_sol": 0.1})
    (reason,) = day_beyond(day, ranges_of(train))
    assert reason.startswith("20 % of the day to come lies beyond what training covered")
    assert "(the outdoor temperature reaches -4 degC, training had 0 to 10)" in reason
    assert not day_beyond(day[:8], ranges_of(train))  # within the margin
    assert not day_beyond(day.assign(T_oa=[5.0] * 9 + [-4.0]), ranges_of(train))  # one row in ten


@pytest.mark.parametrize(
    ("held_out", "named"),
    [(True, "100 % of the last complete day, 2024-01-11, lies"), (False, "of the day to come lies")],
)
def test_a_measured_day_beyond_training_is_named(held_out, named, monkeypatch):
    """Nobody takes it for tomorrow."""
    for name in ("drift_days", "drifted", "at_ends"):
        monkeypatch.setattr(f"skhybrid.study.doubts.{name}", lambda *_: [])
    stamps = pd.date_range("2024-01-01", periods=24 * 11, freq="1h")
    rows = pd.DataFrame({"T_za": 20.0, "T_oa": np.arange(len(stamps)) % 24.0, "Q_hvac": 2.0}, stamps)
    day = rows[-24:].assign(T_oa=-20.0)
    data = StudyData(rows[:192], rows[192:240], stamps[192], rows[:240], day, day["T_za"], held_out)
    doubts = Doubts.of(SimpleNamespace(gray_box_=None), data.later, data)
    assert named in doubts.temperature[0]
    assert named in doubts.load[0]


@pytest.mark.parametrize(
    ("kind", "words"), [("level", "at all hours"), ("schedule", "change of use"), ("quiet", "closure")]
)
def test_grown_errors_are_a_reason_in_plain_words(kind, words):
    since = pd.Timestamp("2024-03-04")
    days = pd.DataFrame({"drifted": [False, True], "since": [pd.NaT, since], "kind": ["", kind]})
    (reason,) = drifted(days)
    assert reason.startswith("its errors have grown since 2024-03-04")
    assert words in reason
    assert drifted(days[:1]) == drifted(days[:0]) == []


def test_drift_that_a_short_training_cannot_tell_is_none():
    office = make_office(n_days=6, random_state=0)
    model = HybridPredictor(known={"Q_h": 6.0}, intervals=False).fit(office.X[: 96 * 5], office.y[: 96 * 5])
    assert drift_days(model, office.X[96 * 5 :]).empty


def test_a_parameter_at_an_end_of_its_range_is_not_identified():
    office = make_office(n_days=5, random_state=0)
    bounds = {"C_w": (20.0, 40.0)}  # the office has 4 kWh/K
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, bounds=bounds, n_starts=2, random_state=0)
    gray_box.fit(office.X, office.y)
    reasons = at_ends(gray_box)
    assert "the heat capacity of the walls (C_w) is at the lower end of its range: not identified" in reasons
    for table, name in ((parameter_table(gray_box), "C_w"), (describe(gray_box), "heat capacity C_w")):
        assert table.loc[name, "remark"] == "not identified: at the lower end of its range"
        assert identified_only(table).loc[name, ["value", "std"]].isna().all()
        assert identified_only(table)["value"].notna().any()
    assert in_words("resistance between za and T_oa") == "thermal resistance between the room and outdoors"


def test_a_back_test_judges_stages_in_their_unit_and_in_kw_where_a_capacity_is_known():
    office = make_office(n_days=12, random_state=0)
    X = office.X.resample("1h").mean()
    made = {}
    for known in ({}, {"Q_h": 6.0, "Q_c": -6.0}):
        estimator = {"known": known} if known else {}
        settings = Settings(columns={role: role for role in X}, estimator=estimator, step="1h")
        made[bool(known)] = backtest_zone(settings, split_log(X, settings))
    assert [found.load_unit for found in made.values()] == ["-", "kW"]
    for scaled, found in made.items():
        temperature, load = found.verdicts
        assert (temperature.quantity, load.quantity) == ("temperature", "load")
        assert ("no certain scale" in str(load)) != scaled
        assert found.table.loc[[YESTERDAY, RIDGE], "load_rmse"].notna().all()
    of_stages, of_kw = (found.table.loc[YESTERDAY, "load_rmse"] for found in made.values())
    assert of_kw == pytest.approx(6.0 * of_stages, rel=0.1)


@pytest.mark.parametrize(
    ("roles", "known", "scaled"),
    [
        (["T_oa", "Q_hvac"], {}, True),
        (["T_oa", "u_heat"], {}, False),
        (["u_heat"], {"Q_h": 6.0}, True),
        (["u_cool"], {"Q_h": 6.0}, False),
        (["u_heat_2"], {"Q_h_2": 2.0}, True),
        (["u_heat"], {"C_za": 1.0}, True),
        (["u_heat"], {"f": 0.3}, False),
    ],
)
def test_heat_or_a_given_parameter_fixes_the_scale(roles, known, scaled):
    assert is_scaled(roles, known) == scaled


def test_a_load_of_stages_and_a_meter_is_that_of_the_whole_plant():
    rows = pd.DataFrame({"u_heat": [0.5, 1.0], "Q_hvac": [-1.0, 0.0]})
    known, unknown = Settings(columns={}, estimator={"known": {"Q_h": 6.0}}), Settings(columns={})
    assert load_of(rows, known, list(rows)).values.tolist() == [2.0, 6.0]
    assert load_of(rows, unknown, list(rows)).values.tolist() == [-1.0, 0.0]  # what is known in kW
    load = rows.assign(Q_hvac_unclipped=-1.0, Q_total=[2.0, 6.0], Q_total_unclipped=9.0)
    assert of_whole_plant(load)[["Q_hvac", "Q_hvac_unclipped"]].to_numpy().tolist() == [[2.0, 9.0], [6.0, 9.0]]
    pd.testing.assert_frame_equal(of_whole_plant(rows), rows)
    meters = pd.DataFrame({"Q_floor": [1.0, 2.0], "Q_air": [0.5, -3.0]})
    assert load_of(meters, unknown, list(meters)).values.tolist() == [1.5, -1.0]


def test_a_load_of_further_stages_is_in_kilowatts_by_their_capacities():
    rows = pd.DataFrame({"u_heat": [0.5, 1.0], "u_heat_2": [0.0, 1.0]})
    known = {"Q_h": 6.0, "Q_h_2": 2.0}
    load = load_of(rows, Settings(columns={}, estimator={"known": known}), list(rows))
    assert load.unit == "kW"
    assert load.values.tolist() == [3.0, 8.0]
    assert load_of(rows, Settings(columns={}, estimator={"known": {"Q_h": 6.0}}), list(rows)).unit == "-"
