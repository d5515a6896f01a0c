"""Settings of plant and thermostat, the saved model of a zone, and tomorrow's forecast."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid import HybridPredictor
from skhybrid.cli import main
from skhybrid.cli.forecast import _text
from skhybrid.datasets import load_small_office, make_office, weather_on_steps
from skhybrid.persistence import load_metadata, load_model, save_model
from skhybrid.study import read_log, read_settings, run_study, split_log
from skhybrid.study.log_reading import metered_heat, read_even_log
from skhybrid.study.next_day import refuse_unplanned
from skhybrid.study.plant_performance import Performance
from skhybrid.study.settings import Settings, settings_from
from skhybrid.study.thermostat import Schedule
from skhybrid.zone import ZoneModel, day_ahead
from skhybrid.zone.day_ahead import _remarks, read_ahead
from skhybrid.zone.forecast_archive import open_archive
from skhybrid.zone.posted_rows import keep_log, keep_posted, read_posted
from skhybrid.zone.rows_ahead import rows_ahead

pytestmark = pytest.mark.usefixtures("quick_fits")

COLUMNS = {"T_za": "T_za", "T_oa": "T_oa"}


def test_a_schedule_by_the_clock():
    index = pd.date_range("2024-01-05", periods=48, freq="1h")
    made = Schedule.of_tables({"heat": {"6:00": 21, "22:00": 17}, "cool": 26, "weekend": {"heat": 16}})
    band = made.band(index)
    assert band["T_heat_set"].iloc[[0, 5, 6, 21, 22, 23]].tolist() == [17, 17, 21, 21, 17, 17]
    assert (band["T_heat_set"].iloc[24:] == 16).all()
    assert (band["T_cool_set"].iloc[:24] == 26).all()
    assert (band["T_cool_set"].iloc[24:] == 26).all()  # as on weekdays
    assert Schedule.of_text("6:00=21,22:00=17;26").heat == {360: 21.0, 1320: 17.0}
    assert Schedule.of_text("21").cool == {}
    assert list(Schedule.of_text("21").band(index)) == ["T_heat_set"]


def test_a_set_point_holds_into_a_weekend_and_out_of_it():
    week, weekend = {"6:00": 21, "18:00": 16}, {"8:00": 22, "23:00": 19}
    made = Schedule.of_tables({"heat": week, "cool": 26, "weekend": {"heat": weekend}})
    clock = pd.date_range("2024-03-01 01:00", "2024-03-07 07:00", freq="1h", tz="Europe/Amsterdam")  # from a Friday
    found = made.band(clock, ["2024-03-05"])["T_heat_set"]  # a Tuesday
    expected = {"01 01": 16, "02 05": 16, "02 07": 16, "02 08": 22, "03 01": 19, "03 07": 19, "04 05": 19, "04 06": 21}
    expected |= {"05 01": 16, "05 07": 16, "05 08": 22, "06 05": 19, "06 06": 21, "07 05": 16}
    assert found[[f"{t:%d %H}" in expected for t in clock]].tolist() == list(expected.values())
    assert made.band(clock[25:26])["T_heat_set"].tolist() == [16.0]  # alone, on Saturday at 02:00
    with pytest.raises(ValueError, match="heats to 19 and cools to 18 degC at 0:00"):
        Schedule.of_tables({"heat": week, "cool": {"0:00": 18, "6:00": 26}, "weekend": {"heat": weekend, "cool": 26}})


@pytest.mark.parametrize(
    ("text", "message"),
    [("25,20", "heats to 25 and cools to 20"), ("1,2,3", "not a heating and a cooling"), ("warm", "not a set-point"),
     ("25:00=20;25", "not a clock time"), ("6:00=21,6:00=17", "a clock time twice"),
     ("99,120", "from 0 to 45"), ("", "is empty")],
)  # fmt: skip
def test_set_points_that_cannot_be(text, message):
    with pytest.raises(ValueError, match=message):
        Schedule.of_text(text)


@pytest.mark.parametrize(
    ("thermostat", "message"),
    [({"heat": 21, "weekend": 17}, "must be a table of heat"), ({"cool": 25, "weekend": {"heat": 16}}, "on weekdays"),
     ({"heat": 21, "weekend": {"weekend": {"heat": 16}}}, "as on weekdays"),
     ({"heat": 21, "weekend": {"heat": 99}}, "weekend heat at 0:00"), ({"heat": {"6:00": 21, "06:00": 17}}, "twice")],
)  # fmt: skip
def test_thermostats_that_cannot_be(thermostat, message):
    with pytest.raises(ValueError, match=message):
        settings_from({"columns": COLUMNS, "thermostat": thermostat})


def test_heat_of_electricity_by_the_outdoor_temperature():
    curve = Performance.of({"cop": [[-10, 2.0], [10, 4.0]], "eer": 3.0})
    T_oa = np.array([-10.0, 0.0, 20.0, 30.0])
    np.testing.assert_allclose(curve.heat(np.array([1.0, 1.0, 1.0, -1.0]), T_oa), [2.0, 3.0, 4.0, -3.0])
    np.testing.assert_allclose(curve.electricity(np.array([2.0, 3.0, 4.0, -3.0]), T_oa), 1.0)
    assert Performance.of({}) is None


def test_meters_of_electricity_become_heat_one_by_one():
    """Within an hour a room may be heated and cooled, each with its own performance."""
    given = settings_from({"columns": COLUMNS, "plant": {"electricity": True, "cop": 3.0, "eer": 4.0}})
    frame = pd.DataFrame({"T_oa": 10.0, "Q_heat": [1.0, 1.0, 0.0], "Q_cool": [0.5, 0.0, 0.5]})
    np.testing.assert_allclose(metered_heat(frame, given)["Q_hvac"], [3.0 - 2.0, 3.0, -2.0])
    assert list(metered_heat(frame, given)) == ["T_oa", "Q_hvac"]
    of_heat = metered_heat(frame, settings_from({"columns": COLUMNS}))
    np.testing.assert_allclose(of_heat["Q_hvac"], [0.5, 1.0, -0.5])


def test_heat_of_two_meters_that_are_logged_by_change(tmp_path):
    """They share no stamps, so that their sum is made at even steps; a set-point by the clock is held too."""
    quarters = pd.date_range("2024-05-01", periods=20 * 96, freq="15min")
    day = np.asarray(quarters.hour * 4 + quarters.minute // 15)
    heat, cool = np.where((day > 20) & (day < 30), 4.0, 0.0), np.where((day > 50) & (day < 60), 3.0, 0.0)
    wanted = np.where((day >= 24) & (day < 76), 21.0, 16.0)
    room = 20.0 + np.round(np.sin(np.arange(len(day)) / 9.0), 2)
    rows = ["time,point,value"]
    for at, point, values in (
        (0, "room", room),
        (30, "out", room - 9.0),
        (60, "heat", heat),
        (120, "cool", cool),
        (0, "set", wanted),
    ):
        kept = np.append(True, values[1:] != values[:-1])
        stamps = quarters[kept] + pd.Timedelta(seconds=at)
        rows += [f"{t},{point},{value}" for t, value in zip(stamps, values[kept], strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(rows), encoding="utf-8")
    columns = {"T_za": "room", "T_oa": "out", "Q_heat": "heat", "Q_cool": "cool", "T_heat_set": "set"}
    frame, _ = read_log(tmp_path / "log.csv", settings_from({"columns": columns, "step": "15min"}))
    known = frame["Q_hvac"].notna().to_numpy()
    assert known.mean() > 0.95
    np.testing.assert_allclose(frame["Q_hvac"][known], (heat - cool)[: len(frame)][known], atol=4.0 * 2 / 15)
    assert frame["Q_hvac"].sum() == pytest.approx(heat.sum() - cool.sum(), rel=0.02)
    np.testing.assert_array_equal(frame["T_heat_set"], wanted[: len(frame)])
    del columns["Q_cool"]
    alone, _ = read_log(tmp_path / "log.csv", settings_from({"columns": columns, "step": "15min"}))
    assert set(np.round(alone["Q_hvac"].dropna().unique(), 2)) == {0.0, 0.27, 3.73, 4.0}  # held, not a line


@pytest.mark.parametrize(
    ("plant", "message"),
    [({"electricity": True}, "needs a coefficient"), ({"cop": 0}, "between 0 and 20"), ({"cop": "3"}, "a number"),
     ({"cop": [[10, 3], [0, 2]]}, "rising"), ({"most_heat": -1}, "at least 0"), ({"cap": 1}, "unknown key"),
     ({"cop": np.nan}, "finite")],
)  # fmt: skip
def test_plants_that_cannot_be(plant, message):
    with pytest.raises(ValueError, match=message):
        settings_from({"columns": COLUMNS, "plant": plant})


def test_a_model_file_keeps_texts_beside_the_model(tmp_path):
    office = make_office(n_days=8, random_state=0)
    model = HybridPredictor(intervals=False).fit(office.X[: 96 * 7], office.y[: 96 * 7])
    save_model(model, tmp_path / "m.skops", metadata={"settings": "{}"})
    assert load_metadata(tmp_path / "m.skops") == {"settings": "{}"}
    again = load_model(tmp_path / "m.skops")
    np.testing.assert_array_equal(again.predict(office.X[:200]), model.predict(office.X[:200]))
    save_model(model, tmp_path / "n.skops")
    assert load_metadata(tmp_path / "n.skops") == {}
    with pytest.raises(ValueError, match="without the settings"):
        ZoneModel.load(tmp_path / "n.skops")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log in German with semicolons, and tomorrow's weather; the last two days are kept aside."""
    to = tmp_path_factory.mktemp("zone")
    office = load_small_office("irregular")
    frame = office.frame.drop(columns=[c for c in office.X if c in office.frame]).join(office.X)
    frame = frame.loc["2018-09-17":"2018-10-17"]
    log = pd.DataFrame(
        {
            "Zeit": frame.index.tz_localize(None),
            "Raumtemperatur [°C]": frame["T_za"],
            "Außentemperatur [°C]": frame["T_oa"],
            "Globalstrahlung [W/m²]": 1000 * frame["q_sol"],
            "Wärme HVAC [kW]": frame["Q_hvac"],
            "Sollwert Heizen [°C]": frame["set_heat"],
            "Sollwert Kühlen [°C]": frame["set_cool"],
        }
    )
    log.iloc[:-192].to_csv(to / "log.csv", sep=";", decimal=",", index=False)
    log.to_csv(to / "whole.csv", sep=";", decimal=",", index=False)
    weather = frame[["T_oa", "q_sol"]].iloc[-193:-80:4].tz_localize(None).rename_axis("time")
    weather.to_csv(to / "weather.csv")
    frame.iloc[-192:-96].tz_localize(None).to_csv(to / "truth.csv")
    assert main(["check", str(to / "log.csv"), "--config", str(to / "zone.toml"), "-q"]) == 0
    assert main(["fit", str(to / "log.csv"), "--config", str(to / "zone.toml"), "--model", str(to / "m.skops")]) == 0
    return to


def test_a_log_reaches_tomorrow_without_an_edit(folder, capsys):
    truth = pd.read_csv(folder / "truth.csv", index_col=0, parse_dates=True)
    heat, cool = truth["set_heat"], truth["set_cool"]
    zone = ZoneModel.load(folder / "m.skops")
    schedule = Schedule(
        {60 * t.hour + t.minute: float(v) for t, v in heat.items()},
        {60 * t.hour + t.minute: float(v) for t, v in cool.items()},
    )
    zone.settings = replace(zone.settings, tariff={"price": {"6:00": 0.4, "20:00": 0.2}, "currency": "EUR"})
    forecast = day_ahead(zone, folder / "log.csv", folder / "weather.csv", schedule)
    found = forecast.frame
    assert found.index.equals(truth.index.as_unit(found.index.unit))
    assert np.sqrt(((found["T_za"] - truth["T_za"]) ** 2).mean()) < 1.0
    assert np.sqrt(((found["Q_hvac"] - truth["Q_hvac"]) ** 2).mean()) < 2.5
    inside = found["T_za"].between(found["q_0.1"], found["q_0.9"]).mean()
    assert inside > 0.9
    assert (found["Q_hvac_0.1"] <= found["Q_hvac_0.9"]).all()
    price = np.where((found.index.hour >= 6) & (found.index.hour < 20), 0.4, 0.2)
    cost = forecast.summary["cost of heat [EUR]"]
    assert cost == pytest.approx(float((price * found["Q_hvac"].abs()).sum()) / 4.0, abs=0.01)
    low, high = forecast.summary["cost of heat, 80 % interval [EUR]"]
    assert low < cost < high
    low, high = forecast.summary["cooling, 80 % interval [kWh]"]  # more than heating on that day
    assert "heating, 80 % interval [kWh]" not in forecast.summary
    assert low < forecast.summary["cooling [kWh]"] < high
    least, most = (found[end].clip(upper=0.0).abs().sum() / 4.0 for end in ("Q_hvac_0.9", "Q_hvac_0.1"))
    assert least < low < high < most  # not every row is at one end of its interval


def test_the_table_of_a_forecast_has_units_and_intervals():
    index = pd.date_range("2024-01-05", periods=9, freq="1h", tz="Europe/Amsterdam")
    columns = {"T_za": 20.0, "Q_hvac": -1.5, "q_0.1": 19.5, "q_0.9": 20.5, "T_cool_set": np.nan, "u_other": 1.0}
    frame = pd.DataFrame(columns, index=index)
    found = SimpleNamespace(frame=frame, summary={"largest load [kW]": 1.5, "cost [EUR]": [1.1, 2.4]})
    lines = _text(found).splitlines()
    assert lines[0].split() == ["room", "80", "%", "of", "room", "heat", "cool", "to"]
    assert lines[1].split() == ["[degC]", "[degC]", "[kW]", "[degC]"]
    assert lines[2].split() == ["Fri", "00:00", "20.0", "19.5", "to", "20.5", "-1.50", "-"]
    assert [line[:9] for line in lines[3:5]] == ["Fri 03:00", "Fri 06:00"]
    assert lines[-1] == "cost [EUR]: 1.1 to 2.4"
    assert "[relative]" in _text(SimpleNamespace(frame=frame, summary={}))


def test_update_and_forecast_from_the_command_line(folder, tmp_path, capsys):
    model = tmp_path / "m.skops"
    model.write_bytes((folder / "m.skops").read_bytes())
    forecast = ["forecast", "--model", str(model), "--log", str(folder / "log.csv"), "--weather"]
    out = tmp_path / "f.csv"
    assert main([*forecast, str(folder / "weather.csv"), "--setpoint", "20,25", "--out", str(out), "--json"]) == 0
    text = capsys.readouterr().out
    assert '"heating [kWh]"' in text
    assert len(pd.read_csv(out)) == 96
    assert main(["update", "--model", str(model), "--log", str(folder / "whole.csv")]) == 0
    assert "new rows: 192" in capsys.readouterr().out
    silent = pd.read_csv(folder / "whole.csv", sep=";", dtype=str)
    silent.loc[silent.index[-192:], "Raumtemperatur [°C]"] = ""
    silent.to_csv(tmp_path / "silent.csv", sep=";", index=False)
    model.write_bytes((folder / "m.skops").read_bytes())
    assert main(["update", "--model", str(model), "--log", str(tmp_path / "silent.csv")]) == 0
    assert "no row is new: the log goes on to" in capsys.readouterr().err
    assert main(["update", "--model", str(model), "--log", str(folder / "whole.csv")]) == 0
    capsys.readouterr()
    assert main(["forecast", "--model", str(model), "--log", str(folder / "whole.csv"), "--setpoint", "20,25"]) == 1
    assert "T_oa is not known for the rows ahead" in capsys.readouterr().err
    short = pd.read_csv(folder / "weather.csv").iloc[:10]
    short.to_csv(tmp_path / "short.csv", index=False)
    assert main([*forecast, str(tmp_path / "short.csv"), "--setpoint", "20,25"]) == 1
    assert "give weather for all of it" in capsys.readouterr().err
    assert main([*forecast, str(folder / "weather.csv")]) == 1
    assert "give --setpoint" in capsys.readouterr().err


def test_empty_heat_ahead_is_not_yesterday(folder, tmp_path):
    settings = read_settings(folder / "zone.toml")
    frame, _ = read_log(folder / "whole.csv", settings)
    frame.iloc[-96:, frame.columns.get_indexer(["T_za", "Q_hvac"])] = np.nan
    for absent in ([], ["T_oa"]):
        with pytest.raises(ValueError, match="Q_hvac is empty in the rows ahead"):
            split_log(frame.drop(columns=["T_heat_set", "T_cool_set", *absent], errors="ignore"), settings)
    frame = frame.assign(T_heat_set=20.0)
    data = split_log(frame, settings)
    assert data.unplanned == ["Q_hvac"]
    assert list(data.future.index) == list(frame.index[-96:])
    refuse_unplanned(data, "")
    with pytest.raises(ValueError, match=r"Q_hvac is empty in the next day, .*: no thermostat was learned; fill in"):
        refuse_unplanned(data, "no thermostat was learned")
    frame.iloc[-50, frame.columns.get_loc("Q_hvac")] = 1.0  # planned in part: the next day is that with a plan
    assert not split_log(frame, settings).unplanned


def test_numbers_in_a_split_log_are_read_as_text_too_and_words_are_refused(folder):
    settings = read_settings(folder / "zone.toml")
    frame, _ = read_log(folder / "whole.csv", settings)
    as_text = frame.assign(T_oa=frame["T_oa"].astype(str), Q_hvac=frame["Q_hvac"].astype("float16"))
    found, expected = (split_log(one, settings).train["T_oa"] for one in (as_text, frame))
    pd.testing.assert_series_equal(found, expected)
    with pytest.raises(ValueError, match=r"column 'q_sol' is not numeric .*could not convert string to float: 'fine'"):
        split_log(frame.assign(q_sol="fine"), settings)


@pytest.mark.parametrize(("back", "says"), [(40, "T_oa is missing at"), (97, "an input is missing before it")])
def test_a_next_day_that_cannot_be_forecast_is_refused_before_the_fits(folder, back, says):
    """It was refused at the very end of a study, after minutes of fits; a back-test needs no next day."""
    settings = read_settings(folder / "zone.toml")
    frame, _ = read_log(folder / "whole.csv", settings)

    def stop(*step):
        raise InterruptedError

    frame.iloc[-96:, frame.columns.get_loc("T_za")] = np.nan
    frame = frame.assign(T_heat_set=20.0)
    frame.iloc[-30, frame.columns.get_loc("T_heat_set")] = np.nan
    with pytest.raises(InterruptedError):
        run_study(settings, split_log(frame, settings), stop)
    frame.iloc[-back, frame.columns.get_loc("T_oa")] = np.nan
    with pytest.raises(ValueError, match=f"the next day begins at .*, and {says}"):
        run_study(settings, split_log(frame, settings), stop)


def test_set_points_in_the_unit_of_the_room(folder, tmp_path):
    log = pd.read_csv(folder / "log.csv", sep=";", decimal=",")
    temperatures = [c for c in log if "°C" in c]
    log[temperatures] = log[temperatures] * 1.8 + 32
    log.columns = ["time", "room", "outdoor", "ghi", "heat", "low", "high"]
    log.to_csv(tmp_path / "f.csv", index=False)
    settings = settings_from(
        {
            "columns": {"T_za": "room", "T_oa": "outdoor", "Q_hvac": "heat", "T_heat_set": "low", "T_cool_set": "high"},
            "units": {"T_za": "degF", "T_oa": "degF"},
        }
    )
    frame, _ = read_log(tmp_path / "f.csv", settings)
    assert frame["T_cool_set"].max() < 35.0
    assert frame["T_heat_set"].min() > 10.0


@pytest.mark.parametrize("units", [{}, {"T_za": "degC"}])
def test_set_points_without_a_unit_are_read_by_their_values(tmp_path, units):
    index = pd.date_range("2024-01-01", periods=48, freq="1h", name="time")
    log = pd.DataFrame({"room": 20.0, "out": 5.0, "low": 68.0, "high": 295.15, "middle": 21.0}, index)
    log.to_csv(tmp_path / "log.csv")
    columns = {"T_za": "room", "T_oa": "out", "T_heat_set": "low", "T_cool_set": "high", "T_cool_set_hall": "middle"}
    frame, _ = read_log(tmp_path / "log.csv", settings_from({"columns": columns, "units": units, "step": "1h"}))
    np.testing.assert_allclose(frame[["T_heat_set", "T_cool_set", "T_cool_set_hall"]].iloc[0], [20.0, 22.0, 21.0])


def test_columns_of_a_right_labelled_log_keep_their_own_time(tmp_path):
    """An hourly mean moves by its hour, a stage and its set-point by a row; a meter and what is held do not move."""
    index = pd.date_range("2024-01-01", periods=20 * 96 + 1, freq="15min", name="time")
    row = np.arange(len(index))
    heats, sun = (row // 7) % 3 == 1, np.clip(np.sin((row - 24) / 48 * np.pi), 0.0, None)
    log = pd.DataFrame({"room": 20.0, "out": 5.0}, index)
    log["stage"], log["low"] = np.append(0, heats[:-1]), np.where(np.append(False, heats[:-1]), 21.0, 17.0)
    log["sun"] = pd.Series(sun, index).rolling(4).mean().shift().where(index.minute == 0)
    log["meter"] = pd.Series(np.append(0.0, np.cumsum(heats[:-1])) + 500.0, index).where(index.minute % 30 == 0)
    log["high"] = np.where(row % 32 == 9, 26.0 + row // 32 % 2, np.nan)  # by change
    log.to_csv(tmp_path / "log.csv")
    columns = {"T_za": "room", "T_oa": "out", "u_heat": "stage", "T_heat_set": "low", "q_sol": "sun"}
    columns |= {"Q_fan": "meter", "T_cool_set": "high"}
    given = {"columns": columns, "units": {"Q_fan": "kWh counter"}, "step": "15min", "label": "right"}
    frame = read_log(tmp_path / "log.csv", settings_from(given))[0].iloc[96:-96]
    stage = heats[96 : 96 + len(frame)]
    np.testing.assert_array_equal(frame["u_heat"], stage)
    np.testing.assert_array_equal(frame["T_heat_set"], np.where(stage, 21.0, 17.0))
    np.testing.assert_allclose(frame["Q_fan"], 4.0 * np.repeat(stage.reshape(-1, 2).mean(1), 2))
    hourly = sun[96 : 96 + len(frame)].reshape(-1, 4).mean(1)
    np.testing.assert_allclose(frame["q_sol"], np.repeat(hourly, 4), atol=1e-9)
    assert (frame.index[1:][np.diff(frame["T_cool_set"]) != 0.0] == index[96:-96][row[96:-96] % 32 == 9]).all()


@pytest.mark.slow
@pytest.mark.parametrize("hours", [36, 4, 0.25])
def test_posted_changes_hold_from_the_log_on_and_right_labelled_ones_are_refused(hours, tmp_path):
    """Until the first posted change the last known value is in force, not a line between the two.

    A few rows do not show what is logged by change, and may hold no change.
    """
    n_days = 6 if hours > 1 else 5  # row by row for half a day, which has each change of the stage
    index = pd.date_range("2024-01-01", periods=n_days * 96, freq="15min", name="time")
    known, row = index <= "2024-01-05 12:00", np.arange(len(index))
    stage = pd.Series((row // 10) % 3 == 1, index).astype(float)
    points = {"room": pd.Series(20.0 + np.round(np.sin(row / 9.0), 2), index), "out": pd.Series(5.0 + row % 7, index)}
    points["stage"] = stage[stage.diff() != 0.0]
    rows = pd.concat([p.rename("value").to_frame().assign(point=name) for name, p in points.items()]).sort_index()
    before = rows.index.isin(index[known])
    rows[before].to_csv(tmp_path / "past.csv")
    settings = settings_from({"columns": {"T_za": "room", "T_oa": "out", "u_heat": "stage"}, "step": "15min"})
    past, _, held, *_ = read_even_log(tmp_path / "past.csv", settings)
    posted = rows[~before]
    with open_archive(tmp_path / "archive.sqlite") as archive, archive.transaction():
        keep_log(archive, past, past.index[-1], held if hours < 36 else None)
        for _, piece in posted.groupby((posted.index - posted.index[0]) // pd.Timedelta(hours=hours)):
            piece.to_csv(tmp_path / "posted.csv")
            given, held = read_posted(tmp_path / "posted.csv", settings, archive.held())
            found, _ = keep_posted(archive, given, settings, held)
    for role, name in settings.columns.items():
        np.testing.assert_allclose(found[role], stage if role == "u_heat" else points[name], err_msg=role)
    posted.to_csv(tmp_path / "posted.csv")
    with pytest.raises(ValueError, match="u_heat is logged by change"):
        read_posted(tmp_path / "posted.csv", replace(settings, label="right"))


def test_blank_set_points_of_posted_rows_are_those_of_a_plant_that_is_off(tmp_path):
    """As in a log that is read at once; they stayed missing, and a new fit would have left the nights out."""
    index = pd.date_range("2024-01-01", periods=10 * 24, freq="1h", name="time")
    day = (index.hour >= 7) & (index.hour < 19)
    log = pd.DataFrame(
        {"T_za": 20.0 + day, "T_oa": 5.0 + index.hour % 7, "T_heat_set": np.where(day, 21.0, np.nan)}, index
    )
    log["u_heat"] = np.where(day, 0.2 + 0.1 * (index.hour % 4), 0.0)
    settings = settings_from({"columns": {name: name for name in log}, "step": "1h"})
    paths = {name: tmp_path / f"{name}.csv" for name in ("whole", "past", "posted")}
    log.to_csv(paths["whole"])
    log[:-60].to_csv(paths["past"])
    past, _, held, *_ = read_even_log(paths["past"], settings)
    with open_archive(tmp_path / "archive.sqlite") as archive, archive.transaction():
        keep_log(archive, past, past.index[-1], held)
        for first in range(len(log) - 60, len(log), 12):
            log[first : first + 12].to_csv(paths["posted"])
            found, _ = keep_posted(archive, *read_posted(paths["posted"], settings, archive.held())[:1], settings)
    expected = read_even_log(paths["whole"], settings)[0]
    pd.testing.assert_frame_equal(found[expected.columns], expected, check_freq=False)


def test_a_step_under_way_is_no_row_of_a_study_and_the_first_ahead_of_it_is_forecast(monkeypatch, tmp_path):
    """Its mean was taken for that of the whole step by identify, export, run, backtest and search."""
    index = pd.date_range("2024-01-01", periods=2 * 96 - 3, freq="15min", name="time")
    row, path = np.arange(len(index)), tmp_path / "log.csv"
    log = pd.DataFrame({"T_za": 20.0 + np.sin(row / 9.0), "T_oa": 5.0 + row % 7, "Q_hvac": row % 5.0}, index)
    settings = settings_from({"columns": {name: name for name in log}, "step": "1h"})
    log.to_csv(path)
    assert read_log(path, settings)[0].index[-1] == index[-1] - pd.Timedelta("1h")
    begins = []
    monkeypatch.setattr(ZoneModel, "readable", lambda _, frame: begins.append(frame.index[-1]) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        day_ahead(ZoneModel(None, settings), path)
    assert begins == [index[-1]]
    log.assign(T_za=log["T_za"][:-50]).to_csv(path)  # weather and plan follow
    assert read_log(path, settings)[0].index[-1] == index[-1]


def test_strict_counts_warnings(folder, capsys):
    arguments = ["check", str(folder / "log.csv")]
    assert main(arguments) == 0
    assert main([*arguments, "--strict"]) == 1  # the log has no time zone


def test_a_log_that_changes_its_unit_is_refused(folder, tmp_path):
    log = pd.read_csv(folder / "log.csv", sep=";", decimal=",")
    log.iloc[1000:, 1] = log.iloc[1000:, 1] * 1.8 + 32
    log.to_csv(tmp_path / "mixed.csv", index=False)
    with pytest.raises(ValueError, match="T_za changes its unit at 2018-09-27 10:00:00"):
        read_log(tmp_path / "mixed.csv", read_settings(folder / "zone.toml"))


def test_a_plant_that_never_cooled_does_not_cool():
    office = make_office(n_days=15, random_state=1)
    heated = office.X.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=6.0 * office.X["u_heat"])
    rows = 96 * 14
    model = HybridPredictor(intervals=False).fit(heated[:rows], office.y[:rows])
    load = model.predict_load(heated[rows:], (15.0, 16.0))  # the room is warmer than both
    assert load["Q_hvac"].min() == 0.0
    assert load["Q_hvac_unclipped"].min() < 0.0
    ahead = heated[rows:].drop(columns=["Q_hvac", "T_za"])
    assert model.forecast(None, ahead, setpoint=(15.0, 16.0))["Q_hvac"].min() == 0.0
    assert model.predict_load(heated[rows:], (15.0, 16.0), (-5.0, 5.0))["Q_hvac"].min() < 0.0


def test_electricity_becomes_heat_and_comes_back(folder, tmp_path):
    log = pd.read_csv(folder / "log.csv", sep=";", decimal=",")
    log.columns = ["time", "room", "outdoor", "ghi", "power", "low", "high"]
    log["power"] = log["power"].clip(lower=0) / 4.0
    log.to_csv(tmp_path / "e.csv", index=False)
    given = {
        "columns": {"T_za": "room", "T_oa": "outdoor", "q_sol": "ghi", "Q_hvac": "power"},
        "units": {"q_sol": "W/m2"},
        "plant": {"electricity": True, "cop": 4.0, "most_heat": 5.0},
        "tariff": {"price": 0.3, "currency": "EUR"},
    }
    frame, _ = read_log(tmp_path / "e.csv", settings_from(given))
    np.testing.assert_allclose(frame["Q_hvac"], 4.0 * log["power"], atol=1e-9)
    zone = ZoneModel.fit(settings_from(given), frame)
    found = day_ahead(zone, tmp_path / "e.csv", folder / "weather.csv", Schedule.of_text("22,27"))
    assert found.frame["Q_hvac"].max() <= 5.0
    np.testing.assert_allclose(found.frame["electricity_kW"], found.frame["Q_hvac"] / 4.0)
    assert found.summary["cost of electricity [EUR]"] == pytest.approx(
        0.3 * found.summary["electricity [kWh]"], abs=0.01
    )
    hours = pd.Timedelta("15min") / pd.Timedelta("1h")
    assert found.summary["electricity [kWh]"] == pytest.approx(found.frame["electricity_kW"].sum() * hours, abs=0.01)
    assert found.frame.index[0] == frame.index[-1] + pd.Timedelta("15min")
    assert any("ideal one" in text for text in found.remarks)


@pytest.mark.slow
def test_a_typical_year_goes_on_into_the_next_one(tmp_path):
    stamps = pd.date_range("2001-01-01", periods=8760, freq="1h")
    rows = [[t.year, t.month, t.day, t.hour + 1, 60, "A7", *[5.1] * 29] for t in stamps]
    head = ["LOCATION,Amsterdam,-,NLD,IWEC,062400,52.30,4.77,1.0,-2.0", *["COMMENTS"] * 7]
    path = tmp_path / "year.epw"
    path.write_text("\n".join([*head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    weather = read_ahead(path, Settings(name="room", columns={}), "Europe/Amsterdam", range(2023, 2025))
    ahead = pd.date_range("2023-12-31 12:00", periods=24, freq="1h", tz="Europe/Amsterdam")
    assert np.allclose(weather_on_steps(weather, ahead)["T_oa"], 5.1)


def test_weather_by_a_clock_that_was_put_back_has_each_hour_once(tmp_path):
    hours = ["2024-10-27 01:00", "2024-10-27 02:00", "2024-10-27 02:00", "2024-10-27 03:00"]
    rows = pd.DataFrame({"T_oa": [8.0, 7.5, 7.0, 6.5], "q_sol": 0.0}, pd.Index(hours, name="time"))
    rows.to_csv(tmp_path / "weather.csv")
    found = read_ahead(tmp_path / "weather.csv", Settings(name="room", columns=COLUMNS), None, [2024])
    assert found.index.tolist() == pd.to_datetime(hours[:2] + hours[3:]).tolist()
    assert found["T_oa"].tolist() == [8.0, 7.5, 6.5]


def test_weather_in_json_is_read_as_the_csv_of_the_same_table(tmp_path):
    index = pd.date_range("2024-10-27", periods=30, freq="1h", name="time")
    columns = {"Outdoor [°F]": 40.0 + np.arange(30) % 7, "GHI [W/m²]": np.arange(30.0), "T_heat_set": 21.0}
    rows = pd.DataFrame(columns, index)
    rows.to_csv(tmp_path / "weather.csv")
    rows.reset_index().to_json(tmp_path / "weather.json", orient="records", date_format="iso")
    one, other = (
        read_ahead(tmp_path / f"weather.{kind}", Settings(name="room", columns=COLUMNS), None, [2024])
        for kind in ("csv", "json")
    )
    pd.testing.assert_frame_equal(one, other, check_freq=False)
    assert set(one) == {"T_oa", "q_sol", "T_heat_set"}


def test_a_log_without_sun_reaches_tomorrow(folder, tmp_path, capsys):
    log = pd.read_csv(folder / "log.csv", sep=";", decimal=",").drop(columns="Globalstrahlung [W/m²]")
    log.to_csv(tmp_path / "dark.csv", index=False)
    given = [str(tmp_path / name) for name in ("dark.csv", "zone.toml", "m.skops")]
    assert main(["check", given[0], "--config", given[1], "-q"]) == 0
    assert "irradiance" in capsys.readouterr().out
    assert main(["fit", given[0], "--config", given[1], "--model", given[2], "-q"]) == 0
    weather = str(folder / "weather.csv")
    assert main(["forecast", "--model", given[2], "--log", given[0], "--weather", weather, "--setpoint", "20,25"]) == 0


@pytest.mark.slow
def test_a_back_test_begins_with_a_verdict(folder, tmp_path, capsys):
    config = (folder / "zone.toml").read_text(encoding="utf-8")
    (tmp_path / "zone.toml").write_text(config, encoding="utf-8")
    out = tmp_path / "b.csv"
    given = ["backtest", str(folder / "log.csv"), "--config", str(tmp_path / "zone.toml"), "--out", str(out), "-q"]
    assert main(given) == 0
    text = capsys.readouterr().out
    assert text.startswith("temperature: ")
    assert "yesterday's temperature" in text
    assert {"origin", "lead", "y_true", "y_pred"} <= set(pd.read_csv(out))


def test_rows_ahead_by_a_plan_or_by_the_clock():
    settings = settings_from({"step": "15min", "horizon": "2h", "columns": COLUMNS})
    origin, hours = pd.Timestamp("2024-01-05 12:00"), pd.date_range("2024-01-05 10:00", periods=6, freq="1h")
    weather = pd.DataFrame({"T_oa": np.arange(6.0), "q_sol": 0.1}, hours)
    inputs = ["T_oa", "q_sol", "q_sol_south", "Q_hvac"]
    found = rows_ahead(settings, origin, inputs, weather=weather, schedule=Schedule.of_text("21"))
    assert not found.planned
    assert set(found.frame) == {"T_oa", "q_sol", "T_heat_set"}
    assert found.frame.index.equals(pd.date_range("2024-01-05 12:15", periods=8, freq="15min"))
    np.testing.assert_allclose(found.frame["T_oa"], 2.0 + np.arange(1, 9) / 4)
    ground = weather.assign(T_ground=np.arange(6.0))
    held = rows_ahead(settings, origin, [*inputs, "T_ground"], weather=ground, schedule=Schedule.of_text("21"))
    np.testing.assert_allclose(held.frame["T_ground"], found.frame["T_oa"])
    only = r"q_sol is not known for the rows ahead, after 2024-01-05 12:00:00 \(only 'T_oa'\); give .*q_sol or as in"
    with pytest.raises(ValueError, match=only):
        rows_ahead(settings, origin, inputs, weather=weather[["T_oa"]])
    with pytest.raises(ValueError, match="the weather reaches from"):  # a boundary is not held beyond what is known
        rows_ahead(settings, origin, ["T_oa", "T_ground"], weather=ground.assign(T_ground=ground["T_ground"].iloc[:3]))
    plan = pd.DataFrame({"Q_hvac": 3.0}, found.frame.index)
    planned = rows_ahead(settings, origin, inputs, weather=weather, plan=plan)
    assert planned.planned
    assert rows_ahead(settings, origin, inputs[:2], weather=weather).planned  # of a room without a plant
    hourly = weather.assign(T_heat_set=[15.0, 16.0, 17.0, 21.0, 22.0, 23.0])  # at 10:00 ... 15:00
    of_weather = rows_ahead(settings, origin, inputs, weather=hourly, plan=plan[[]]).frame["T_heat_set"]
    assert of_weather.tolist() == [17.0] * 3 + [21.0] * 4 + [22.0]
    finer = hourly.resample("5min").interpolate()  # a step has the mean of its rows
    of_finer = rows_ahead(settings, origin, inputs, weather=finer, plan=plan[[]]).frame["T_heat_set"]
    np.testing.assert_allclose(of_finer, finer["T_heat_set"].resample("15min").mean().reindex(of_finer.index))
    of_log = rows_ahead(settings, origin, inputs, weather=hourly, plan=plan[[]].assign(T_heat_set=19.0))
    assert (of_log.frame["T_heat_set"] == 19.0).all()
    with pytest.raises(ValueError, match=r"T_heat_set \(set-point\) is missing in 5 of the rows ahead.*13:00"):
        rows_ahead(settings, origin, inputs, weather=hourly.assign(T_heat_set=hourly["T_heat_set"].iloc[:3]))
    assert (planned.frame["Q_hvac"] == 3.0).all()


def test_kilowatts_of_a_building_are_scaled_where_those_of_each_heated_zone_are():
    inputs = {"hall": ["T_oa"], "office": ["T_oa", "Q_hvac"], "kitchen": ["T_oa", "u_heat"]}
    trained = {zone: SimpleNamespace(ranges=dict.fromkeys(roles)) for zone, roles in inputs.items()}
    own = {zone: SimpleNamespace(training_=record) for zone, record in trained.items()}
    columns = ["T_oa", *(f"T_za_{zone}" for zone in inputs), "Q_hvac_office", "u_heat_kitchen"]
    given = {"columns": {name: name for name in columns}}
    known = {"estimator": {"known": {"Q_h": 6.0}}}
    assert not ZoneModel(SimpleNamespace(own_=own), settings_from(given)).scaled
    assert ZoneModel(SimpleNamespace(own_=own), settings_from(given | known)).scaled


def test_what_a_user_is_told_of_weather_that_training_did_not_have():
    zone = SimpleNamespace(
        settings=settings_from({"columns": COLUMNS}),
        ideal_zones=lambda ahead: [],
        not_learned={},
        covered=lambda: {"T_oa": (0.0, 10.0), "u_heat": (0.0, 1.0)},
        scaled=True,
        learned_until=pd.Timestamp("2024-01-01"),
        known_until=pd.Timestamp("2024-01-02"),
    )
    history = pd.DataFrame({"T_za": 20.0}, [pd.Timestamp("2024-01-02")])
    ahead = pd.DataFrame({"T_oa": np.r_[np.full(8, 5.0), 10.6, 10.6]})
    (said,) = _remarks(zone, history, ahead, planned=False)
    assert said == (
        "20 % of the day to come lies beyond what training covered (the outdoor temperature reaches 10.6 degC, "
        "training had 0 to 10)"
    )
    assert _remarks(zone, history, ahead.clip(upper=10.4), planned=False) == []
