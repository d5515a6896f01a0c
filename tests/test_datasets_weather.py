"""Weather: the embedded generator against the EPW files that it was fitted to, EPW reading, given tables."""

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import make_office, make_weather, read_epw
from skhybrid.exceptions import UnitWarning

EPW = {
    "oakland": "USA_CA_Oakland.Intl.AP.724930_TMY3.epw",
    "chicago": "USA_IL_Chicago-OHare.Intl.AP.725300_TMY3.epw",
}


@pytest.mark.parametrize("climate", ["oakland", "chicago"])
@pytest.mark.slow
def test_monthly_means_are_those_of_the_epw(shared_data, climate):
    truth = read_epw(shared_data / EPW[climate]).tz_localize(None)
    monthly = truth.groupby(truth.index.month).mean()
    years = 100  # Chicago's days are 6 K apart and autocorrelated: the mean needs them
    drawn = make_weather(365 * years, climate, start="2001-01-01", step="1h", random_state=0)
    means = drawn.groupby(drawn.index.month).mean()
    assert (means["T_oa"] - monthly["T_oa"]).abs().max() < 0.5
    assert (means["ghi"] / monthly["ghi"] - 1).abs().max() < 0.05
    window = means["q_sol"] / monthly["q_sol"] - 1
    assert window.abs().median() < 0.06
    assert window.abs().max() < 0.16


def test_days_are_autocorrelated_and_cycle():
    drawn = make_weather(365, "chicago", start="2023-01-01", step="1h", random_state=1)
    daily = drawn["T_oa"].resample("1D").mean()
    season = daily.rolling(31, center=True, min_periods=1).mean()
    assert 0.3 < (daily - season).autocorr(1) < 0.9
    by_hour = drawn["T_oa"].groupby(drawn.index.hour).mean()
    assert by_hour.idxmax() in range(13, 18)
    assert by_hour.idxmin() in range(3, 8)


def test_irradiance_is_physical():
    drawn = make_weather(30, "oakland", start="2024-06-01", random_state=2)
    assert (drawn[["q_sol", "ghi", "dni", "dhi"]] >= 0).all(axis=None)
    assert (drawn["ghi"] < 1.2).all()
    assert (drawn.loc[drawn.index.hour < 4, ["q_sol", "ghi", "dni", "dhi"]] == 0).all(axis=None)
    assert drawn["ghi"].groupby(drawn.index.hour).mean().idxmax() in (11, 12)


def test_the_window_faces_where_it_is_told():
    options = {"n_days": 20, "climate": "chicago", "start": "2024-07-01", "random_state": 0}
    by_hour = {
        side: (w := make_weather(**options, window_azimuth=azimuth))["q_sol"].groupby(w.index.hour).mean().idxmax()
        for side, azimuth in (("east", 90.0), ("south", 180.0), ("west", 270.0))
    }
    assert by_hour["east"] < by_hour["south"] < by_hour["west"]
    flat = make_weather(**options, window_tilt=0.0)
    np.testing.assert_allclose(flat["q_sol"].resample("1D").sum(), flat["ghi"].resample("1D").sum(), rtol=0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"climate": "x"}, "climate='x'"),
        ({"n_days": 0}, "n_days=0"),
        ({"n_days": "7"}, "n_days='7' must be a positive number"),
        ({"window_azimuth": "south"}, "window_azimuth='south' must be a number of degrees up to 360"),
        ({"window_tilt": -90.0}, "window_tilt=-90.0 must be a number of degrees from 0 to 180"),
    ],
)
def test_refused_weather_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_weather(**arguments)


# --------------------------------------------------------------------------------------------------------------- EPW
def test_epw_labels(shared_data):
    path = shared_data / EPW["chicago"]
    frame = read_epw(path)
    raw = np.genfromtxt(path, delimiter=",", skip_header=8, usecols=(3, 6, 13), dtype=float)  # hour, T, ghi
    assert raw[0, 0] == 1  # an EPW row is labelled with the hour that ends
    np.testing.assert_allclose(frame["ghi"], raw[:, 2] / 1000)  # the mean begins an hour earlier
    np.testing.assert_allclose(frame["T_oa"].iloc[1:], raw[:-1, 1])  # the temperature is that at the hour's end
    assert frame.index[0].utcoffset() == pd.Timedelta(hours=-6)
    assert list(frame.columns) == ["T_oa", "q_sol", "ghi", "dni", "dhi"]


def test_epw_agrees_with_the_energyplus_log(shared_data):
    """EnergyPlus read the same file: its log, converted by our reader, must show the same hours."""
    from skhybrid.datasets import load_small_office

    log = load_small_office().X
    epw = read_epw(shared_data / EPW["chicago"], year=2018)
    hourly = log["T_oa"][log.index.minute == 0]
    np.testing.assert_allclose(hourly, epw["T_oa"].reindex(hourly.index), atol=0.01)
    sun = log["q_sol"].resample("1h").mean()
    assert (sun - epw["ghi"].reindex(sun.index)).abs().mean() < 0.02


def test_epw_of_a_leap_year(shared_data):
    frame = read_epw(shared_data / EPW["oakland"], year=2024)
    assert len(frame) == 8784
    assert (np.diff(frame.index.as_unit("ns").asi8) == 3600 * 10**9).all()
    leap, before = frame.loc["2024-02-29"], frame.loc["2024-02-28"]
    np.testing.assert_array_equal(leap["T_oa"], before["T_oa"])


@pytest.mark.parametrize("start", ["2024-02-27", "2023-12-29", "2031-07-04"])
def test_a_typical_year_serves_any_start(shared_data, start):
    epw = read_epw(shared_data / EPW["oakland"])
    log = make_office(6, start=start, weather=epw, random_state=0, sampling_time="1h")
    stamp = log.X.index[30]
    twin = epw["T_oa"].tz_localize(None).loc[stamp.replace(year=2001, day=28 if stamp.day == 29 else stamp.day)]
    assert abs(log.X["T_oa"].iloc[30] - twin) < 2.5  # the log has the mean of the hour, the file its first value
    daily = log.X["q_sol"].resample("1D").sum()
    source = epw["q_sol"].groupby(epw.index.strftime("%m-%d")).sum().reindex(daily.index.strftime("%m-%d"))
    known = source.notna().to_numpy()
    np.testing.assert_allclose(daily[known], source[known], rtol=0.03)


def test_epw_errors(tmp_path):
    with pytest.raises(FileNotFoundError, match="no weather file"):
        read_epw(tmp_path / "none.epw")
    (tmp_path / "bad.epw").write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"not a readable EPW .*; download it again"):
        read_epw(tmp_path / "bad.epw")
    for year in ("2024", 2024.0, 99999):  # of which pandas made an error of its own
        with pytest.raises(ValueError, match=rf"year={year!r} "):
            read_epw(tmp_path / "bad.epw", year=year)


# -------------------------------------------------------------------------------------------------------- given table
@pytest.fixture
def table():
    index = pd.date_range("2024-05-01", periods=4 * 24, freq="1h")
    return pd.DataFrame({"T_oa": np.arange(96.0) % 24, "q_sol": np.arange(96.0) % 7 / 10}, index=index)


def test_a_given_table_is_interpolated(table):
    log = make_office(3, start="2024-05-01", weather=table, sampling_time="5min", random_state=0)
    on_the_hour = log.X.index.minute == 0
    np.testing.assert_allclose(log.X["T_oa"][on_the_hour], table["T_oa"].iloc[:72])
    assert log.X["T_oa"].iloc[6] == pytest.approx(0.5)  # half past midnight
    at_five = table.resample("5min").ffill()
    again = make_office(3, start="2024-05-01", weather=at_five, sampling_time="5min", random_state=0)
    np.testing.assert_allclose(again.X[["T_oa", "q_sol"]], at_five.iloc[: 3 * 288])


def test_a_zoned_table_is_taken_in_standard_time():
    index = pd.date_range("2024-10-26", periods=24 * 4, freq="1h", tz="Europe/Amsterdam")
    weather = pd.DataFrame({"T_oa": np.arange(96.0) / 4, "q_sol": 0.0}, index=index)
    log = make_office(2, start="2024-10-26", weather=weather, sampling_time="1h", random_state=0)
    local_standard = log.X.index.tz_localize("Etc/GMT-1")
    expected = weather["T_oa"].reindex(local_standard.tz_convert(index.tz)) + 11 / 96  # mean of the 5-min values
    np.testing.assert_allclose(log.X["T_oa"], expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.iloc[10:],
            "simulation needs 2024-05-01 00:00:00 to .* no earlier than 2024-05-01 10:00:00",
        ),
        (lambda t: t.iloc[:48], "reaches from 2024-05-01 00:00:00 to 2024-05-02 23:00:00, but the simulation needs"),
        (lambda t: t.drop(t.index[20:30]), "has nothing between 2024-05-01 19:00:00 and 2024-05-02 06:00:00"),
        (lambda t: t.drop(columns="q_sol"), "weather has no column 'q_sol'"),
        (lambda t: t.where(t["T_oa"] != 3), "weather column 'T_oa' contains NaN"),
        (lambda t: t[::-1], "must increase"),
        (lambda t: t.reset_index(drop=True), "needs a DatetimeIndex"),
    ],
)
def test_refused_tables(table, change, message):
    with pytest.raises(ValueError, match=message):
        make_office(3, start="2024-05-01", weather=change(table), random_state=0)


@pytest.mark.parametrize(("column", "change"), [("T_oa", lambda v: v + 273.15), ("q_sol", lambda v: v + 200.0)])
def test_a_table_in_other_units_is_warned_of(table, column, change):
    """The simulated room had thousands of degrees."""
    with pytest.warns(UnitWarning, match=f"weather column '{column}' ranges from .*: likely (K|W/m2) rather than"):
        make_office(3, start="2024-05-01", weather=table.assign(**{column: change(table[column])}), random_state=0)


@pytest.mark.parametrize(("value", "words"), [("inf", "contains inf in 1 row"), ("99.9", "holds 99.9 degC in 1 row")])
def test_epw_values_that_stand_for_none_are_refused(tmp_path, value, words):
    fields = ["2001", "1", "1", "1", "60", "A7", *["5.1"] * 29]
    stamps = pd.date_range("2001-01-01", periods=8760, freq="1h")
    rows = [[str(t.year), str(t.month), str(t.day), str(t.hour + 1), *fields[4:]] for t in stamps]
    rows[100][6] = value
    head = ["LOCATION,Amsterdam,-,NLD,IWEC,062400,52.30,4.77,1.0,-2.0", *["COMMENTS"] * 7]
    path = tmp_path / "year.epw"
    path.write_text("\n".join(head + [",".join(row) for row in rows]) + "\n", encoding="utf-8")
    with pytest.raises(ValueError, match=words):
        read_epw(path)
