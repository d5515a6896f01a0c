"""Reading logs: labels, zones, daylight saving, units, and one sentence for every bad input."""

import gzip

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import read_zone_csv
from skhybrid.logs import to_left_label
from skhybrid.logs.stamps import _is_first_pass

SIMPLE = """time,T_za,T_oa,u_heat,note
2024-01-01 00:00,20,1,0.0,a
2024-01-01 00:15,21,2,0.5,b
2024-01-01 00:30,22,3,,c
"""


def test_roles_by_name(write):
    frame = read_zone_csv(write(SIMPLE))
    assert list(frame.columns) == ["T_za", "T_oa", "u_heat"]
    assert frame.index.tz is None
    assert frame.index.name == "time"
    assert frame.index[1] == pd.Timestamp("2024-01-01 00:15")
    assert (frame.dtypes == np.float64).all()
    assert np.isnan(frame["u_heat"].iloc[2])


def test_roles_by_columns_and_units(write):
    path = write("When,Room F,Sun,Fan %,Watt,extra\n01/13/2024 00:00,68,500,55,1500,1\n01/13/2024 00:15,50,0,0,0,1\n")
    frame = read_zone_csv(
        path,
        {"T_za": "Room F", "q_sol": "Sun", "u_fan": "Fan %", "Q_hvac": "Watt"},
        units={"T_za": "degF", "q_sol": "W/m2", "u_fan": "percent", "Q_hvac": "W"},
    )
    np.testing.assert_allclose(frame.iloc[0], [20.0, 0.5, 0.55, 1.5])
    assert list(frame.columns) == ["T_za", "q_sol", "u_fan", "Q_hvac"]


def test_named_time_column_and_european_numbers(write):
    path = write("nr;moment;T_za\n1;2024-01-01 00:00;20,5\n2;2024-01-01 01:00;21,5\n")
    frame = read_zone_csv(path, time_column="moment", sep=";", decimal=",")
    assert frame["T_za"].tolist() == [20.5, 21.5]
    found = read_zone_csv(path, sep=";", decimal=",")  # the cells give the column away
    pd.testing.assert_frame_equal(found, frame)


def test_date_and_time_in_two_columns(write):
    path = write("Date,Time,seen,T_za\n2024-01-31,00:45,1,20\n2024-01-31,01:00,1,21\n")
    assert read_zone_csv(path).index.tolist() == [pd.Timestamp("2024-01-31 00:45"), pd.Timestamp("2024-01-31 01:00")]


def test_compressed_file(tmp_path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(SIMPLE.encode()))
    assert len(read_zone_csv(path)) == 3


def test_newest_row_first_is_turned_round(write):
    lines = SIMPLE.strip().splitlines()
    turned = read_zone_csv(write("\n".join([lines[0], *lines[:0:-1]])))
    pd.testing.assert_frame_equal(turned, read_zone_csv(write(SIMPLE)))


def test_order_of_day_and_month(write):
    def first(*dates, **options):
        path = write("time,T_za\n" + "".join(f"{d},1\n" for d in dates))
        return str(read_zone_csv(path, **options).index[0].date())

    assert first("01-02-2024 00:00", "13-02-2024 00:00") == "2024-02-01"
    assert first("01/02/2024 00:00", "01/13/2024 00:00") == "2024-01-02"
    assert first("01.02.2024 00:00", dayfirst=True) == "2024-02-01"
    with pytest.raises(ValueError, match="pass dayfirst=True or dayfirst=False"):
        first("01/02/2024 00:00", "02/02/2024 00:00")
    with pytest.raises(ValueError, match=r"row 3 .*'01/13/2024 00:00' is not a date"):
        first("13/01/2024 00:00", "01/13/2024 00:00")


def test_stamps_of_mixed_precision(write):
    frame = read_zone_csv(write("time,T_za\n2024-01-01 00:00:00,1\n2024-01-01 00:15,2\n2024-01-02,3\n"))
    assert frame.index[[1, 2]].tolist() == [pd.Timestamp("2024-01-01 00:15"), pd.Timestamp("2024-01-02")]


def test_byte_order_mark(tmp_path):
    (tmp_path / "log.csv").write_text(SIMPLE, encoding="utf-8-sig")
    assert len(read_zone_csv(tmp_path / "log.csv")) == 3


# ------------------------------------------------------------------------------------------------------------- zones
@pytest.mark.parametrize("newest_first", [False, True])
def test_rows_of_one_stamp_keep_their_order(write, newest_first):
    lines = ["2024-01-01 00:00,1", "2024-01-01 01:00,2", "2024-01-01 01:00,3", "2024-01-01 02:00,4"]
    frame = read_zone_csv(write("\n".join(["time,T_za", *(lines[::-1] if newest_first else lines)])))
    assert frame["T_za"].tolist() == [1.0, 2.0, 3.0, 4.0]


def wall_clock_log(start, end, zone="Europe/Amsterdam", freq="15min"):
    """A log as a local logger writes it, and the true stamps."""
    truth = pd.date_range(start, end, freq=freq, tz=zone)
    rows = [f"{t:%Y-%m-%d %H:%M},{k}" for k, t in enumerate(truth)]
    return "time,T_za\n" + "\n".join(rows) + "\n", truth


@pytest.mark.parametrize("freq", ["15min", "1h"])
@pytest.mark.parametrize(("start", "end"), [("2023-10-28", "2023-10-30"), ("2024-03-30", "2024-04-01")])
def test_daylight_saving_of_naive_stamps(write, freq, start, end):
    text, truth = wall_clock_log(start, end, freq=freq)
    frame = read_zone_csv(write(text), timezone="Europe/Amsterdam")
    assert (frame.index == truth).all()
    assert frame["T_za"].tolist() == list(range(len(truth)))


def test_daylight_saving_of_a_log_that_runs_backwards(write):
    text, truth = wall_clock_log("2023-10-28", "2023-10-30")
    lines = text.strip().splitlines()
    frame = read_zone_csv(write("\n".join([lines[0], *lines[:0:-1]])), timezone="Europe/Amsterdam")
    assert (frame.index == truth).all()


def test_direction_of_a_log_with_the_day_first(write):
    truth = pd.date_range("2024-10-05", "2024-11-04", freq="1h", tz="Europe/Berlin")  # with months first: May to April
    rows = [f"{t:%d.%m.%Y %H:%M},{k}" for k, t in enumerate(truth)]
    frame = read_zone_csv(write("\n".join(["time,T_za", *rows])), timezone="Europe/Berlin", dayfirst=True)
    assert (frame.index == truth).all()
    assert frame["T_za"].tolist() == list(range(len(truth)))


def test_log_that_lacks_the_repeated_hour(write):
    text, truth = wall_clock_log("2023-10-28", "2023-10-30")
    kept = ~((truth >= "2023-10-29 02:00+01:00") & (truth < "2023-10-29 03:00+01:00"))
    lines = text.strip().splitlines()
    short = "\n".join([lines[0], *np.array(lines[1:])[kept]])
    assert (read_zone_csv(write(short), timezone="Europe/Amsterdam").index == truth[kept]).all()


def test_hour_that_does_not_exist(write):
    path = write("time,T_za\n2024-03-31 01:45,1\n2024-03-31 02:15,2\n")
    with pytest.raises(ValueError, match=r"row 3 of 'log.csv': '2024-03-31 02:15' does not exist in Europe/Amsterdam"):
        read_zone_csv(path, timezone="Europe/Amsterdam")
    newest_first = write("time,T_za\n2024-03-31 03:15,3\n2024-03-31 02:15,2\n2024-03-31 01:45,1\n")
    with pytest.raises(ValueError, match=r"row 3 of 'log.csv': '2024-03-31 02:15' does not exist"):
        read_zone_csv(newest_first, timezone="Europe/Amsterdam")


def test_stamps_with_an_offset(write):
    path = write("time,T_za\n2023-10-29T02:30:00+02:00,1\n2023-10-29T02:30:00+01:00,2\n")
    utc = pd.DatetimeIndex(["2023-10-29T00:30Z", "2023-10-29T01:30Z"])
    bare = read_zone_csv(path)
    assert (bare.index == utc).all()
    assert str(bare.index.tz) == "UTC"  # two offsets and no zone named
    named = read_zone_csv(path, timezone="Europe/Amsterdam")
    assert (named.index == utc).all()
    assert named.index.hour.tolist() == [2, 2]


def test_short_offsets(write):
    frame = read_zone_csv(write("time,T_za\n2024-01-01 00:00:00+01,1\n2024-01-01 00:15:00+01,2\n"))
    assert frame.index[0] == pd.Timestamp("2023-12-31T23:00Z")


def test_one_fixed_offset_is_kept(write):
    frame = read_zone_csv(write("timestamp,T_za\n2018-01-01T00:15:00-06:00,1\n2018-01-01T00:30:00-06:00,2\n"))
    assert frame.index[0].utcoffset() == pd.Timedelta(hours=-6)
    assert frame.index.hour[0] == 0


@pytest.mark.parametrize("name", ["columns", "units"])
def test_a_list_in_place_of_a_mapping_is_named(write, name):
    with pytest.raises(ValueError, match=rf"{name}=\['T_za'\] must be a mapping of roles to"):
        read_zone_csv(write(SIMPLE), **{name: ["T_za"]})


# ------------------------------------------------------------------------------------------------------------ labels
def test_right_labels_move_means_and_keep_temperatures(write):
    rows = [f"2024-01-01 {k // 4:02}:{k % 4 * 15:02},{k},{100 + k},{k / 10}" for k in range(1, 6)]
    path = write("time,T_za,T_oa,u_heat\n" + "\n".join(rows) + "\n")
    frame = read_zone_csv(path, label="right")
    assert frame.index[0] == pd.Timestamp("2024-01-01 00:15")
    assert frame["T_za"].tolist() == [1, 2, 3, 4]
    assert frame["T_oa"].tolist() == [101, 102, 103, 104]
    np.testing.assert_allclose(frame["u_heat"], [0.2, 0.3, 0.4, 0.5])  # the mean that ends a step later


def test_right_label_round_trip(write):
    index = pd.date_range("2023-10-28 12:00", periods=150, freq="15min", tz="Europe/Amsterdam")
    rng = np.random.default_rng(0)
    truth = pd.DataFrame({c: rng.uniform(size=150) for c in ("T_za", "q_sol", "u_heat")}, index=index)
    logged = truth.assign(q_sol=truth["q_sol"].shift(1), u_heat=truth["u_heat"].shift(1))  # stamped with the end
    path = write(logged.to_csv(index_label="time"))
    frame = read_zone_csv(path, timezone="Europe/Amsterdam", label="right")
    pd.testing.assert_frame_equal(frame, truth.iloc[:-1], check_freq=False, check_names=False, check_index_type=False)


def test_right_labels_across_a_gap(write):
    stamps = ["00:15", "00:30", "00:45", "02:00", "02:15"]
    rows = [f"2024-01-01 {t},{k},{k}" for k, t in enumerate(stamps)]
    frame = read_zone_csv(write("time,T_za,u_heat\n" + "\n".join(rows) + "\n"), label="right")
    expected = {"00:15": (0, 1), "00:30": (1, 2), "00:45": (2, np.nan), "01:45": (np.nan, 3), "02:00": (3, 4)}
    assert [f"{t:%H:%M}" for t in frame.index] == list(expected)
    np.testing.assert_allclose(frame.to_numpy(), np.array(list(expected.values())))


def test_right_labels_move_each_column_by_its_own_interval(write):
    index = pd.date_range("2024-03-30", periods=193, freq="15min", tz="Europe/Amsterdam")
    late, n = index[4:], np.arange(189.0)
    log = pd.DataFrame({"T_za": n, "Q_hvac": n, "q_sol": n, "u_heat": n}, late)
    log["q_sol"] = log["q_sol"].where(late.minute == 0)  # an hour's mean at the end of the hour
    log["u_heat"] = log["u_heat"].where(late.minute % 30 == 0)
    log.loc[late[[4, 5, 8]], ["u_heat", "q_sol"]] = np.nan
    frame = read_zone_csv(write(log.to_csv(index_label="time")), timezone="Europe/Amsterdam", label="right")
    for name, hours in (("T_za", 0.0), ("Q_hvac", 0.25), ("u_heat", 0.5), ("q_sol", 1.0)):
        moved = log[name].dropna()
        moved.index -= pd.Timedelta(hours=hours)
        moved = moved[(moved.index >= late[0]) & (moved.index < late[-1])]
        assert frame[name].dropna().equals(moved.rename_axis("time")), name
    assert (frame.index == late[:-1]).all()


def test_right_labels_move_set_points_and_leave_what_stays():
    index = pd.date_range("2024-01-01 01:00", periods=4, freq="1h")
    wanted = [17.0, 17.0, 21.0, 21.0]
    log = pd.DataFrame({"T_heat_set": wanted, "T_cool_set_hall": wanted, "T_oa": wanted, "u_heat": wanted}, index)
    moved = to_left_label(log[::-1], ["u_heat"])
    assert moved["T_heat_set"].tolist() == moved["T_cool_set_hall"].tolist() == [17.0, 21.0, 21.0]
    assert moved["T_oa"].tolist() == moved["u_heat"].tolist() == [17.0, 17.0, 21.0]
    pd.testing.assert_frame_equal(to_left_label(log, list(log)), log)


# ------------------------------------------------------------------------------------------------------------ errors
HEAD = "time,T_za,T_oa\n"


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", {}, "'log.csv' is empty; export it again"),
        (HEAD, {}, "has a header but no rows"),
        ("a;b\n1;2\n", {}, "only one column, 'a;b'; pass its separator"),
        ("T_za,T_oa\n1,2\n", {}, "no column of time stamps among 'T_za', 'T_oa'; pass its name as time_column="),
        (HEAD + "2024-01-01,1,2\n", {"time_column": "zeit"}, "time_column= names 'zeit', which is not in 'log.csv'"),
        ("time,room\n2024-01-01,1\n", {}, r"named after a role \('room'\); pass columns="),
        (
            HEAD + "2024-01-01,1,2\n",
            {"columns": {"T_za": "room"}},
            "column 'room', but 'log.csv' has 'T_za', 'T_oa'",
        ),
        (HEAD + "2024-01-01 00:00,1,2\nlater,1,2\n", {}, "row 3 of 'log.csv': the time stamp 'later' is not a date"),
        (HEAD + "2024-01-01 00:00,1,2\n,1,2\n", {}, "row 3 of 'log.csv': the time stamp is empty"),
        (HEAD + "2024-01-01 00:00Z,1,2\n2024-01-01 01:00,1,2\n", {}, "row 3 .* has no offset from UTC"),
        (HEAD + "2024-01-01 00:00,1,2\n2024-01-01 01:00,off,2\n", {}, "row 3 .*, column 'T_za': 'off' is not a number"),
        (HEAD + "2024-01-01 00:00,1,2\n", {"timezone": "Mars/Base"}, "timezone='Mars/Base' is unknown"),
        (HEAD + "2024-01-01 00:00,1,2\n", {"label": "centre"}, "label='centre' must be 'left' or 'right'"),
        (HEAD + "2024-01-01 00:00,1,2\n", {"label": "right"}, "at least two rows"),
        (HEAD + 2 * "2024-01-01 00:00,1,2\n", {"label": "right"}, "2024-01-01 00:00:00 appears twice"),
        (HEAD + "2024-01-01 00:00,1,2\n", {"units": {"T_za": "degX"}}, "unit 'degX', which is not one of"),
        (
            HEAD + "2024-01-01 00:00,1,2\n",
            {"units": {"T_za": "W/m2"}},
            "that role needs a unit of temperature, such as 'degC'",
        ),
        (
            HEAD + "2024-01-01 00:00,1,2\n",
            {"units": {"q_sol": "W/m2"}},
            "units= names 'q_sol', which is not among the columns: 'T_za', 'T_oa'",
        ),
    ],
)
def test_one_sentence_for_a_bad_file(write, text, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_zone_csv(write(text), **options)
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_zone_csv(tmp_path / "none.csv")


def test_row_numbers_of_a_log_that_runs_backwards(write):
    text = "time,T_za\n2024-01-01 02:00,3\n2024-01-01 01:00,off\n2024-01-01 00:00,1\n"
    with pytest.raises(ValueError, match="row 3 "):
        read_zone_csv(write(text))


# -------------------------------------------------------------------------------------------------------- real tables
def test_dutch_home(shared_data):
    frame = read_zone_csv(
        shared_data / "dutch_home_2.csv",
        {"T_za": "T_in_degC", "T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd"},
        timezone="Europe/Amsterdam",
        units={"u_heat": "percent"},
    )
    assert frame.index[0] == pd.Timestamp("2021-10-25T00:00Z")
    assert frame["u_heat"].max() <= 0.78
    assert set(np.diff(frame.index.as_unit("ns").asi8)) == {15 * 60 * 10**9}


def test_all_stamps_after_the_first_turn_are_of_the_second_pass():
    minutes = [90, 120, 150, 120, 150, 130, 180]
    stamps = pd.Timestamp("2023-10-29") + pd.to_timedelta(minutes, unit="min")
    first = _is_first_pass(stamps, np.array([120 <= m < 180 for m in minutes]))
    assert first.tolist() == [True, True, True, False, False, False, True]
