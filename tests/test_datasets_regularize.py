"""Bringing logs to an even step, against plain resampling and hand-made cases."""

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import make_office, regularize
from skhybrid.logs.even_steps import typical_step


@pytest.fixture(scope="module")
def log():
    return make_office(3, random_state=0).X


def test_an_even_log_is_left_as_it_is(log):
    out, report = regularize(log, return_report=True)
    pd.testing.assert_frame_equal(out, log, check_freq=False, check_index_type=False)
    assert not report.filled
    assert not report.missing


@pytest.mark.parametrize(("step", "days"), [("5min", 105), ("15min", 365), ("1h", 3000)])
def test_a_long_log_keeps_its_last_row(step, days):
    index = pd.date_range("2016-01-01", periods=int(days * pd.Timedelta("1D") / pd.Timedelta(step)), freq=step)
    assert regularize(pd.DataFrame({"T_oa": 5.0}, index), step).index.equals(index)


def test_means_and_instant_values_of_a_longer_step(log):
    out = regularize(log, "1h")
    inputs = ["q_sol", "u_heat", "u_cool"]
    pd.testing.assert_frame_equal(out[inputs], log[inputs].resample("1h").mean(), check_freq=False)
    np.testing.assert_array_equal(out[["T_oa", "T_za"]], log[["T_oa", "T_za"]].iloc[::4])


def test_a_shorter_step_holds_inputs_and_never_invents_history(log):
    out = regularize(log, "5min")
    held = log["u_cool"].resample("5min").ffill()
    np.testing.assert_allclose(out["u_cool"], held)
    line = log["T_oa"].resample("5min").interpolate()
    np.testing.assert_allclose(out["T_oa"], line)
    known = out["T_za"].notna()
    assert known.sum() == len(log)
    assert out["T_za"][known].tolist() == log["T_za"].tolist()


@pytest.mark.parametrize("held", [(), ("T_heat_set", "T_heat_set_hall")])
def test_a_set_point_counts_over_the_step(held):
    """Beside the heat that it causes, not at the stamps as a temperature."""
    index = pd.date_range("2024-01-01 05:00", periods=36, freq="5min")
    wanted = np.where(np.arange(36) < 13, 17.0, 21.0)  # from 06:05 on
    log = pd.DataFrame({"T_za": 18.0, "T_heat_set": wanted, "T_heat_set_hall": wanted}, index)
    sides = ["T_heat_set", "T_heat_set_hall"]
    hourly = regularize(log, "1h", held=held)[sides]
    np.testing.assert_allclose(hourly, [[17.0] * 2, [(17 + 11 * 21) / 12] * 2, [21.0] * 2])
    rising = log[sides].iloc[::12].assign(T_heat_set=[17.0, 17.0, 21.0], T_heat_set_hall=[17.0, 17.0, 21.0])
    refined = regularize(rising.assign(T_za=18.0), "30min", held=held)[sides].dropna()
    assert refined["T_heat_set"].iloc[:5].tolist() == [17.0, 17.0, 17.0, 17.0, 21.0]
    assert refined["T_heat_set"].equals(refined["T_heat_set_hall"])


def test_a_short_gap_of_a_set_point_holds_the_last_value(log):
    """A thermostat jumps: no set-point between the two was ever in force."""
    wanted = np.where(np.arange(len(log)) < 6, 17.0, 21.0)
    out = regularize(log.assign(T_heat_set=wanted, T_cool_set_hall=wanted + 4.0).drop(log.index[4:6]))
    np.testing.assert_array_equal(out["T_heat_set"], wanted)
    np.testing.assert_array_equal(out["T_cool_set_hall"], wanted + 4.0)


def test_uneven_stamps_weigh_by_time():
    index = pd.DatetimeIndex(["2024-01-01 00:00", "2024-01-01 00:04", "2024-01-01 00:10", "2024-01-01 00:15"])
    frame = pd.DataFrame({"u_heat": [1.0, 0.0, 0.5, 0.0]}, index=index)
    out = regularize(frame, "15min")
    assert out["u_heat"].iloc[0] == pytest.approx((4 * 1.0 + 6 * 0.0 + 5 * 0.5) / 15)


def test_jitter_disorder_duplicates_and_gaps_are_mended_and_reported(log):
    rng = np.random.default_rng(0)
    worn = log.set_axis(log.index + pd.to_timedelta(rng.integers(-20, 20, len(log)), unit="s"), axis=0)
    worn = worn.drop(worn.index[10:13]).drop(worn.index[40:60])
    worn = pd.concat([worn, worn.iloc[100:102]])
    before = worn.copy()
    out, report = regularize(worn, return_report=True)
    pd.testing.assert_frame_equal(worn, before)
    assert out.index.equals(log.index.rename(out.index.name))
    assert (report.rows_before, report.rows_after, report.duplicates) == (len(worn), len(log), 2)
    assert report.out_of_order == 1
    assert report.filled == dict.fromkeys(["T_oa", "q_sol", "u_heat", "u_cool"], 3)
    assert report.missing == {**dict.fromkeys(["T_oa", "q_sol", "u_heat", "u_cool"], 20), "T_za": 23}
    assert report.first_missing["T_za"] == log.index[10]
    assert report.first_missing["T_oa"] == log.index[40]
    known = out["T_za"].notna()
    np.testing.assert_array_equal(out["T_za"][known], log["T_za"][known])
    np.testing.assert_allclose(out["q_sol"].dropna(), log["q_sol"][out["q_sol"].notna()], atol=0.03)
    text = str(report)
    assert out.attrs["report"] == text
    for words in ("2 rows with a duplicate stamp: the first value", "q_sol: 3 rows", "T_za: 23 rows left missing"):
        assert words in text


def test_rows_with_one_stamp_are_put_together():
    stamps = pd.date_range("2024-01-01", periods=4, freq="15min").repeat(2)
    cells = {"T_oa": [1.0, np.nan, 2.0, 9.0, 3.0, np.nan, 4.0, np.nan], "u_heat": [np.nan, 1.0] * 4}
    out = regularize(pd.DataFrame(cells, index=stamps))
    assert out["T_oa"].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert out["u_heat"].tolist() == [1.0] * 4


def test_max_gap(log):
    holed = log.drop(log.index[20:26])  # an hour and a half
    assert regularize(holed)["u_cool"].isna().sum() == 6
    assert regularize(holed, max_gap="90min")["u_cool"].isna().sum() == 0
    assert regularize(holed, max_gap="1D")["T_za"].isna().sum() == 6  # history is never filled


def test_history_knows_nothing_later(log):
    """A change of a later measurement changes no earlier one."""
    changed = log.copy()
    changed.iloc[50:, changed.columns.get_loc("T_za")] += 5
    for step in ("5min", "15min", "1h"):
        a, b = (regularize(frame, step)["T_za"] for frame in (log, changed))
        early = a.index < log.index[50]
        pd.testing.assert_series_equal(a[early], b[early])


@pytest.mark.parametrize("start", ["2023-10-28", "2024-03-30"])
def test_daylight_saving(start):
    index = pd.date_range(start, periods=200, freq="15min", tz="Europe/Amsterdam")
    frame = pd.DataFrame({"T_za": np.arange(200.0), "u_heat": 1.0}, index=index)
    out = regularize(frame.drop(index[95:97]))
    assert (out.index == index).all()
    assert (out["u_heat"] == 1).all()


def test_zone_of_a_half_hour():
    index = pd.date_range("2024-01-01", periods=50, freq="15min", tz="Asia/Kolkata")
    out = regularize(pd.DataFrame({"T_za": 1.0}, index=index), "1h")
    assert out.index[0] == index[0]
    assert (out.index.minute == 0).all()


def test_a_column_that_is_logged_less_often():
    index = pd.date_range("2024-01-01", periods=49, freq="5min")
    frame = pd.DataFrame({"u_heat": 1.0, "q_sol": np.nan, "T_oa": np.nan}, index=index)
    frame.loc[frame.index.minute == 0, ["q_sol", "T_oa"]] = np.arange(5.0)[:, None]
    out = regularize(frame, "15min").iloc[:16]
    assert out["q_sol"].tolist() == np.repeat(np.arange(4.0), 4).tolist()  # an hour's mean holds for the hour
    np.testing.assert_allclose(out["T_oa"], np.arange(16) / 4)


def test_missing_cells_of_an_input():
    index = pd.date_range("2024-01-01", periods=12, freq="5min")
    values = np.ones(12)
    values[[3, 4]] = np.nan  # two thirds of the second quarter
    values[[7]] = np.nan  # one third of the third
    out = regularize(pd.DataFrame({"u_heat": values}, index=index), "15min", max_gap="0min")
    assert out["u_heat"].isna().tolist() == [False, True, False, False]


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (lambda f: f.reset_index(drop=True), {}, "needs a DataFrame with a DatetimeIndex"),
        (lambda f: f.iloc[:1], {}, "a log of 1 row has no step; give two rows or more"),
        (lambda f: f.iloc[[0, 0]], {}, "two distinct stamps"),
        (lambda f: f.set_axis(f.index.where(f.index != f.index[3]), axis=0), {}, "NaT at row 3"),
        (lambda f: f, {"step": "0min"}, "step='0min'"),
        (lambda f: f, {"step": "soon"}, "step='soon' is not a duration"),
        (
            lambda f: f,
            {"step": "1ns"},
            r"a step of 1e-09 s from .* makes .*e\+1\d rows, but the log has one per 15 min",
        ),
        (lambda f: f.assign(T_oa=f.index), {}, "column 'T_oa' holds times"),
        (lambda f: f.assign(T_oa="cold"), {}, "column 'T_oa' is not numeric"),
        (lambda f: pd.concat([f, f[["T_oa"]]], axis=1), {}, "column 'T_oa' appears twice"),
    ],
)
def test_refused(log, make, options, message):
    with pytest.raises(ValueError, match=message):
        regularize(make(log), **options)


# ------------------------------------------------------------------------------------------------ logged by change
CHANGES = pd.DataFrame(
    {"T_za": [20.0, np.nan, 20.5, np.nan], "u_heat": [1.0, 0.0, np.nan, 1.0], "T_oa": [5.0, np.nan, np.nan, 6.0]},
    index=pd.DatetimeIndex(["2024-01-01 00:00", "2024-01-01 00:20", "2024-01-01 01:10", "2024-01-01 04:45"]),
)


def test_a_held_value_holds_until_the_next_one():
    out = regularize(CHANGES, "1h", held=list(CHANGES))
    assert out["T_za"].tolist() == [20.0, 20.0, 20.5, 20.5, 20.5]
    assert out["T_oa"].tolist() == [5.0] * 5  # the value at 04:45 is not known at 04:00
    np.testing.assert_allclose(out["u_heat"], [1 / 3, 0.0, 0.0, 0.0, 0.25])


def test_a_held_value_ends_after_the_longest_hold():
    out, report = regularize(CHANGES, "1h", held=list(CHANGES), max_hold="90min", return_report=True)
    np.testing.assert_array_equal(out["T_za"], [20.0, 20.0, 20.5, np.nan, np.nan])
    np.testing.assert_allclose(out["u_heat"], [1 / 3, 0.0, 0.0, 0.0, 0.25])  # a plant stays off
    on = regularize(1.0 - CHANGES[["u_heat"]], "1h", held=["u_heat"], max_hold="90min")["u_heat"]
    # known from 00:20 to 01:50, then for the last quarter of the last hour only
    np.testing.assert_allclose(on, [2 / 3, 1.0, np.nan, np.nan, np.nan])
    assert report.missing == {"T_za": 2, "T_oa": 3}
    assert not report.filled


def test_a_room_is_not_known_while_a_whole_log_of_changes_is_silent():
    index = pd.date_range("2024-01-01", periods=600, freq="5min")
    log = pd.DataFrame({"T_za": 20.0, "u_heat": np.nan}, index)
    log.iloc[::50, 1] = 1.0
    broken = log.drop(index[100:200])  # 8.4 hours
    out = regularize(broken, "15min", held=["T_za", "u_heat"])
    assert out["u_heat"].notna().all()
    assert out.index[out["T_za"].isna()].equals(out.index[(out.index > index[99]) & (out.index < index[200])])
    brief = log.drop(index[100:120])  # shorter than three hours
    assert regularize(brief, "15min", held=["T_za", "u_heat"])["T_za"].notna().all()
    rare = log[::24].drop(index[96:192], errors="ignore")  # a change every two hours: eight without one say little
    assert regularize(rare, "15min", held=["T_za", "u_heat"])["T_za"].notna().all()


def test_a_room_is_known_in_the_last_step_of_a_log_after_an_outage():
    index = pd.date_range("2024-01-01", periods=300, freq="30min").append(pd.DatetimeIndex(["2024-01-07 16:50"]))
    out = regularize(pd.DataFrame({"T_za": 20.0, "T_oa": 5.0}, index), "1h", held=["T_za"])
    assert out.index[-1] == pd.Timestamp("2024-01-07 17:00")
    assert out["T_za"].iloc[-1] == 20.0
    assert np.isnan(out["T_za"].iloc[-2])


def test_a_set_point_holds_over_a_weekend():
    index = pd.date_range("2024-01-05 19:00", "2024-01-15 19:00", freq="1h")  # from a Friday
    log = pd.DataFrame({"T_oa": 5.0, "T_heat_set": np.nan, "T_cool_set": np.nan, "u_heat": np.nan}, index)
    log.iloc[0, 1:] = [16.0, 26.0, 1.0]
    out = regularize(log, held=["T_heat_set", "T_cool_set", "u_heat"])
    assert out[["T_heat_set", "T_cool_set"]].notna().sum().tolist() == [7 * 24] * 2
    assert out["u_heat"].notna().sum() == 24
    off = regularize(log.assign(u_heat=0.0 * log["u_heat"]), held=["u_heat"])  # it may be off all summer
    assert (off["u_heat"] == 0.0).all()
    assert regularize(log, held=["T_heat_set"], max_hold="9D")["T_heat_set"].notna().sum() == 9 * 24


def test_held_columns_beside_sampled_ones(log):
    changes = log["u_heat"].where(log["u_heat"] != log["u_heat"].shift())
    worn = log.assign(u_heat=changes)
    pd.testing.assert_frame_equal(regularize(worn, held=["u_heat"], max_hold="10D"), regularize(log), check_freq=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"held": ["x"]}, "held= names 'x', which is not among the columns: 'T_za', 'u_heat', 'T_oa'"),
        ({"held": "T_za"}, "held='T_za' is one text"),
        ({"held": ["T_za"], "max_hold": "0h", "step": "1h"}, "max_hold='0h' is not a positive duration"),
        ({"held": ["T_za", "u_heat", "T_oa"]}, "a log of changes has no step of its own; pass step="),
    ],
)
def test_refusals_of_held_columns(options, message):
    with pytest.raises(ValueError, match=message):
        regularize(CHANGES, **options)


@pytest.mark.parametrize(("logged", "meant"), [(890.0, 900.0), (1100.0, 1200.0), (1000.0, 1000.0)])
def test_a_step_near_a_common_one_is_meant(logged, meant):
    index = pd.Timestamp("2024-01-01") + pd.to_timedelta(np.arange(10) * logged, unit="s")
    assert typical_step(index) == pd.Timedelta(seconds=meant)


def test_a_value_is_held_for_a_step_and_a_half_at_most():
    index = pd.Timestamp("2024-01-01") + pd.to_timedelta([0, 15, 37, 52, 67, 97, 112], unit="min")
    out = regularize(pd.DataFrame({"u_heat": 1.0, "T_oa": 1.0}, index), "15min", max_gap="0min")
    for name in out:  # 67 is held until 82, and 75 is too far from it
        assert out.index[out[name].isna()].strftime("%H:%M").tolist() == ["01:15"]
