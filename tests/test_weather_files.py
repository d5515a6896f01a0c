"""Weather of a forecast from CSV, EPW and Open-Meteo's files, and its values on the steps of a forecast."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import read_weather, weather_on_steps

SAMPLE = Path(__file__).parent / "log_samples" / "open_meteo.json"
ANSWER = json.loads(SAMPLE.read_text(encoding="utf-8"))


def _written(folder: Path, answer: object, name: str = "tomorrow.json") -> Path:
    path = folder / name
    path.write_text(answer if isinstance(answer, str) else json.dumps(answer), encoding="utf-8")
    return path


def _changed(**changes: object) -> dict:
    return ANSWER | changes


def _hourly(**changes: object) -> dict:
    hourly = {k: v for k, v in (ANSWER["hourly"] | changes).items() if v is not None}
    return _changed(hourly=hourly)


def test_open_meteo_radiation_moves_to_the_hour_that_it_covers():
    weather = read_weather(SAMPLE)
    assert list(weather) == ["T_oa", "q_sol"]
    assert weather.index[0] == pd.Timestamp("2024-03-30 00:00", tz="Europe/Berlin")
    hourly = ANSWER["hourly"]
    assert weather["T_oa"].iloc[10] == hourly["temperature_2m"][10]
    assert weather["q_sol"].iloc[10] == pytest.approx(hourly["shortwave_radiation"][11] / 1000.0)
    assert len(weather) == 47  # nothing is known of the irradiance after the last stamp
    assert weather.attrs["notes"] == []


def test_open_meteo_stamps_have_one_offset_and_its_zone_changes_the_clock():
    index = read_weather(SAMPLE).index
    assert (index[1:] - index[:-1] == pd.Timedelta("1h")).all()
    assert index[26] == pd.Timestamp("2024-03-31 03:00", tz="Europe/Berlin")  # 02:00 at the fixed offset


def _as_csv(answer: dict) -> str:
    """The CSV of Open-Meteo's page."""
    names = ("latitude", "longitude", "elevation", "utc_offset_seconds", "timezone")
    place = ",".join(str(answer.get(name, 0.0)) for name in names)
    units, hourly = answer["hourly_units"], answer["hourly"]
    head = ",".join("time" if name == "time" else f"{name} ({units[name]})" for name in hourly)
    rows = [
        ",".join("NaN" if cell is None else str(cell) for cell in row) for row in zip(*hourly.values(), strict=True)
    ]
    return f"{','.join(names)},timezone_abbreviation\n{place},X\n\n{head}\n" + "\n".join(rows) + "\n"


def test_the_csv_of_open_meteo_is_its_json(tmp_path):
    """Its stamps have the offset of its second line, and its radiation is of the hour before."""
    found = read_weather(_written(tmp_path, _as_csv(ANSWER), "open-meteo-52.50N13.42E38m.csv"))
    pd.testing.assert_frame_equal(found, read_weather(SAMPLE))
    times = [str(pd.Timestamp(t) - pd.Timedelta(hours=1))[:16].replace(" ", "T") for t in ANSWER["hourly"]["time"]]
    greenwich = _hourly(time=times) | {"utc_offset_seconds": 0, "timezone": "GMT"}
    found = read_weather(_written(tmp_path, _as_csv(greenwich), "utc.csv"))
    pd.testing.assert_frame_equal(found.tz_convert("Europe/Berlin"), read_weather(SAMPLE))
    with pytest.raises(ValueError, match="it has 2 places; request the forecast of one place"):
        read_weather(_written(tmp_path, _as_csv(ANSWER).replace("X\n", "X\n1.0,2.0,3,0,GMT,X\n"), "two.csv"))
    days = "\n\ntime,temperature_2m_max (°C)\n2024-03-30,14.1\n"
    for tables in ("", days):
        with pytest.raises(ValueError, match=r"'none\.csv' is not a forecast of Open-Meteo with hourly values"):
            read_weather(_written(tmp_path, _as_csv(ANSWER).partition("\n\n")[0] + tables, "none.csv"))


def test_units_and_unix_time(tmp_path):
    expected = read_weather(SAMPLE)
    seconds = [int(pd.Timestamp(t).timestamp()) - 3600 for t in ANSWER["hourly"]["time"]]
    answer = _hourly(temperature_2m=[1.8 * t + 32.0 for t in ANSWER["hourly"]["temperature_2m"]], time=seconds)
    answer["hourly_units"] = ANSWER["hourly_units"] | {"temperature_2m": "°F", "time": "unixtime"}
    pd.testing.assert_frame_equal(read_weather(_written(tmp_path, answer)), expected)


def test_irradiance_from_cloud_cover(tmp_path):
    path = _written(tmp_path, _hourly(shortwave_radiation=None))
    weather = read_weather(path)
    assert "cloud cover" in weather.attrs["notes"][0]
    day = weather["q_sol"].iloc[:23]
    assert day.iloc[11] == pytest.approx(0.58, abs=0.06)  # end of March in Berlin, 40 % cover
    assert (day.iloc[[0, 3, 21]] == 0.0).all()
    assert weather["q_sol"].iloc[24 + 11] / day.iloc[11] == pytest.approx(0.25 / (1 - 0.75 * 0.4**3.4), rel=0.02)
    other = read_weather(path, latitude=0.0, longitude=13.4)["q_sol"].iloc[11]
    assert other > 1.3 * day.iloc[11]


def test_irradiance_on_a_window():
    south, north = (read_weather(SAMPLE, window_azimuth=azimuth)["q_sol"] for azimuth in (180.0, 0.0))
    assert south.iloc[11] > 2.0 * north.iloc[11] > 0.0


def test_the_parts_of_global_irradiance_add_up_on_a_flat_plane(tmp_path):
    path = _written(tmp_path, _hourly(direct_normal_irradiance=None, diffuse_radiation=None))
    flat = read_weather(path, window_azimuth=180.0, window_tilt=0.0)["q_sol"]
    np.testing.assert_allclose(flat, read_weather(path)["q_sol"], atol=1e-9)


def test_a_csv(tmp_path):
    rows = ["time,outdoor,sun", *(f"2024-01-0{1 + h // 24} {h % 24:02d}:00,{h},{100 * h}" for h in range(4))]
    path = _written(tmp_path, "\n".join(rows), "tomorrow.csv")
    weather = read_weather(
        path,
        columns={"T_oa": "outdoor", "q_sol": "sun"},
        units={"q_sol": "W/m2"},
        timezone="Europe/Berlin",
        label="right",
    )
    assert weather["q_sol"].iloc[:2].tolist() == [0.1, 0.2]
    with pytest.raises(ValueError, match=r"'tomorrow\.csv' has no column 'q_sol', only 'T_oa'"):
        read_weather(path, columns={"T_oa": "outdoor"})
    with pytest.raises(ValueError, match="window_azimuth= does nothing"):
        read_weather(path, window_azimuth=180.0)


def test_an_epw(shared_data):
    path = next(shared_data.glob("*Oakland*.epw"))
    weather = read_weather(path, year=2024)
    assert len(weather) == 8784
    window = read_weather(path, year=2024, window_azimuth=180.0)
    assert weather["q_sol"].max() > 0.9
    assert not np.allclose(window["q_sol"], weather["q_sol"])
    steps = weather_on_steps(weather, pd.date_range("2024-02-28", periods=96, freq="30min", tz="Etc/GMT+8"))
    assert np.isfinite(steps).all(axis=None)


# ------------------------------------------------------------------------------------------------------- on the steps
def test_steps_keep_the_energy_of_each_hour_and_interpolate_temperature():
    weather = read_weather(SAMPLE)
    time = pd.date_range("2024-03-30 00:00", periods=4 * 46, freq="15min", tz="Europe/Berlin")
    steps = weather_on_steps(weather, time)
    np.testing.assert_allclose(steps["q_sol"].resample("1h").mean(), weather["q_sol"].iloc[:46], atol=1e-12)
    assert (steps["q_sol"] >= 0.0).all()
    assert (steps["q_sol"].iloc[:16] == 0.0).all()
    assert steps["T_oa"].iloc[2] == pytest.approx(weather["T_oa"].iloc[:2].mean())
    hour = steps["q_sol"].iloc[4 * 8 : 4 * 9]
    assert hour.is_monotonic_increasing
    assert hour.iloc[3] > hour.iloc[0] + 0.01  # the sun rises within the hour too
    longer = weather_on_steps(weather, time[::8])
    np.testing.assert_allclose(longer["q_sol"], steps["q_sol"].to_numpy().reshape(-1, 8).mean(axis=1), atol=1e-12)


@pytest.mark.parametrize(
    ("start", "periods", "zone", "says"),
    [
        (
            "2024-03-29 23:00",
            10,
            "Europe/Berlin",
            r"reaches from 2024-03-30 00:00:00.*a log whose last complete row is no earlier",
        ),
        ("2024-03-31 20:00", 5, "Europe/Berlin", r"give weather for all of it\."),
        ("2024-03-30 00:00", 1, "Europe/Berlin", "at least two stamps"),
        ("2024-03-30 00:00", 5, None, "the forecast has no time zone, but the weather has one"),
    ],
)
def test_steps_that_the_weather_does_not_serve(start, periods, zone, says):
    with pytest.raises(ValueError, match=says):
        weather_on_steps(read_weather(SAMPLE), pd.date_range(start, periods=periods, freq="1h", tz=zone))


def test_hours_without_weather_are_interpolated():
    """In a row of 15 min of which eight followed, a forecast was refused."""
    time = pd.date_range("2024-05-01", periods=96, freq="15min", tz="Europe/Berlin")
    hour = np.arange(96) / 4
    sun = 0.8 * np.clip(np.sin(np.pi * (hour - 6.0) / 12.0), 0.0, None)
    whole = pd.DataFrame({"T_oa": 10.0 + 5.0 * np.sin(np.pi * hour / 12.0), "q_sol": sun}, time)
    missing = time[36:47]
    found = weather_on_steps(whole.drop(missing), time)
    np.testing.assert_allclose(found["T_oa"], whole["T_oa"], atol=0.4)
    np.testing.assert_allclose(found["q_sol"], weather_on_steps(whole, time)["q_sol"], atol=0.07)
    with pytest.raises(ValueError, match="has nothing between 2024-05-01 08:45"):
        weather_on_steps(whole.drop([*missing, time[47]]), time)


def test_a_gap_in_the_weather_is_refused():
    weather = read_weather(SAMPLE)
    gap = weather.drop(weather.index[10:15])
    time = pd.date_range("2024-03-30 00:00", periods=24, freq="1h", tz="Europe/Berlin")
    with pytest.raises(ValueError, match="has nothing between 2024-03-30 09:00"):
        weather_on_steps(gap, time)
    assert len(weather_on_steps(gap, time[:8])) == 8


# ---------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (json.dumps(ANSWER)[:-300], "is no complete JSON"),
        ([ANSWER, ANSWER], "holds 2 places; request the forecast of one place"),
        (
            {"error": True, "reason": "Cannot initialize WeatherVariable."},
            "Open-Meteo: Cannot initialize WeatherVariable.",
        ),
        ({"latitude": 1.0, "daily": {}}, "not a forecast of Open-Meteo with hourly values"),
        (_hourly(time=5), "not a forecast of Open-Meteo with hourly values"),
        (_changed(hourly_units=["C"]), "not a forecast of Open-Meteo with hourly values"),
        (_hourly(temperature_2m=None), "has no hourly temperature_2m"),
        (_hourly(shortwave_radiation=None, cloud_cover=None), "neither shortwave_radiation nor cloud_cover"),
        (_hourly(shortwave_radiation=[0.0] * 12), "has 12 values of shortwave_radiation for 48 stamps"),
        (_hourly(shortwave_radiation=["a"] * 48), "has a shortwave_radiation with values that are not numbers"),
        (_hourly(shortwave_radiation=[1e400] * 48), "has a shortwave_radiation with values that are not numbers"),
        (_changed(utc_offset_seconds=10**9), "has the utc_offset_seconds '1000000000'"),
        (_hourly(shortwave_radiation=[None] * 48), "has no hour with a temperature and an irradiance"),
        (_hourly(time=["2024-03-30T00:00"] * 48), "48 hourly stamps that are not one hour apart"),
        (_hourly(time=["noon"] * 48), "has the time stamp 'noon'; download it again"),
        (_changed(timezone="Mars/Olympus"), "has the unknown timezone 'Mars/Olympus'"),
        (_changed(hourly_units={"temperature_2m": "furlong"}), "'furlong', which is not one of"),
    ],
)
def test_open_meteo_that_cannot_be_read(tmp_path, answer, says):
    with pytest.raises(ValueError, match=says):
        read_weather(_written(tmp_path, answer))


def test_records_are_refused_by_the_reader_of_their_own(tmp_path):
    records = json.dumps([{"time": f"2024-03-30 0{hour}:00", "T_oa": 5.0, "q_sol": 0.0} for hour in range(4)])
    with pytest.raises(ValueError, match=r"'tomorrow\.json' is JSON; read it with skhybrid\.logs\.read_log"):
        read_weather(_written(tmp_path, records))


@pytest.mark.parametrize(
    ("name", "given", "says"),
    [
        ("w.json", {"yaer": 2024}, "yaer= does nothing with a file of Open-Meteo such as 'w.json'; leave it out"),
        ("w.json", {"year": 2024}, "year= does nothing with 'w.json', whose stamps have a year"),
        ("w.epw", {"timezone": "UTC"}, "timezone= does nothing with an EPW such as 'w.epw'; leave it out"),
        ("w.csv", {"year": 2024}, "year= does nothing with 'w.csv', whose stamps have a year"),
    ],
)
def test_what_does_nothing_is_refused(tmp_path, name, given, says):
    """A unit, a time zone or a misspelt year was left out in silence."""
    with pytest.raises(ValueError, match=says):
        read_weather(_written(tmp_path, ANSWER, name), **given)


@pytest.mark.parametrize("coding", ["cp1252", "utf-16"])
def test_an_answer_is_known_by_what_it_holds(tmp_path, coding):
    """Not by the end of its name, nor by its encoding."""
    for number, text in enumerate((_as_csv(ANSWER), json.dumps([ANSWER], ensure_ascii=False))):
        path = tmp_path / f"weather {number}.txt"
        path.write_bytes(text.replace("\n", "\r\n").encode(coding))
        pd.testing.assert_frame_equal(read_weather(path), read_weather(SAMPLE))


def test_units_may_be_null(tmp_path):
    found = read_weather(_written(tmp_path, _changed(hourly_units=None)))
    pd.testing.assert_frame_equal(found, read_weather(SAMPLE))


@pytest.mark.parametrize(
    ("rows", "says"),
    [([0, 1, 1, 2], "has duplicates"), ([3, 2, 1], "goes back"), ([0, 1, 2, 5], "not evenly"), ([0, -1], "NaT")],
)
def test_steps_that_are_not_even_are_refused(rows, says):
    """Twice the same stamp gave an irradiance of NaN, and uneven ones the mean of other spans."""
    time = pd.date_range("2024-03-30 10:00", periods=8, freq="15min", tz="Europe/Berlin").append(
        pd.DatetimeIndex(["NaT"], tz="Europe/Berlin")
    )
    with pytest.raises(ValueError, match=says):
        weather_on_steps(read_weather(SAMPLE), time[rows])


def test_a_place_that_is_none_on_earth_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"latitude=5230 must be a number of degrees from -90 to 90"):
        read_weather(_written(tmp_path, ANSWER), latitude=5230, window_azimuth=180.0)


def test_a_place_is_needed_for_a_window(tmp_path):
    answer = {k: v for k, v in ANSWER.items() if k != "latitude"}
    path = _written(tmp_path, answer)
    assert len(read_weather(path)) == 47
    with pytest.raises(ValueError, match="names no place"):
        read_weather(path, window_azimuth=180.0)
    assert len(read_weather(path, window_azimuth=180.0, latitude=52.5)) == 47
