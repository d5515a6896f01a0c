"""A folder per zone: what a tick keeps, when the model is fitted again, and that kills leave the folder whole."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import signal
import sqlite3
from contextlib import closing

import numpy as np
import pandas as pd
import pytest

from skhybrid import _sqlite
from skhybrid.cli import main
from skhybrid.exceptions import ModelFileError
from skhybrid.zone import DayAhead, ZoneFolder, ZoneModel, forecast_archive, readable_log, zone_folder

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.ExcitationWarning"),  # few days of heat
    pytest.mark.usefixtures("quick_fits"),
]
FILES = {"zone.toml", "model.skops", "archive.sqlite"}
DAYS = 10  # of the log that the zone is made from
SCHEDULE = "20,25"
CHILDREN = multiprocessing.get_context("forkserver" if os.name == "posix" else "spawn")
CHILDREN.set_forkserver_preload(["skhybrid.zone.zone_folder", "skops.io"])


@pytest.fixture(scope="module")
def log(hourly_office):
    return hourly_office.iloc[: 24 * 45]


def write(log, path, until, *, without=None):
    """A log up to the end of a day, with the weather of the day after it."""
    rows = log.iloc[: 24 * (until + 1)].copy()
    rows.loc[rows.index[24 * until] :, rows.columns.difference(["T_oa", "q_sol"])] = np.nan
    if without is not None:
        rows = rows.drop(rows.index[without])
    rows.to_csv(path)
    return path


@pytest.fixture(scope="module")
def made(log, tmp_path_factory):
    """A zone from ten days of log."""
    path = tmp_path_factory.mktemp("made")
    arguments = ["zone", "init", str(path / "kitchen"), "--log", str(write(log, path / "log.csv", DAYS))]
    assert main([*arguments, "-q"]) == 0
    return path / "kitchen"


@pytest.fixture
def zone(made, tmp_path):
    shutil.copytree(made, tmp_path / "kitchen")
    return ZoneFolder(tmp_path / "kitchen")


def _names(folder):
    return {path.name for path in folder.path.iterdir()}


def _same_as_now(zone, log, weather=None, schedule=None):
    """A forecast that costs nothing."""
    now = log.history.iloc[-1]
    index = pd.date_range(now.name, periods=25, freq="1h")[1:]
    return DayAhead(pd.DataFrame({"T_za": now["T_za"], "Q_hvac": 0.0}, index), {}, ())


@pytest.fixture
def cheap(monkeypatch):
    monkeypatch.setattr(zone_folder, "forecast_day", _same_as_now)


def tables(folder):
    with closing(sqlite3.connect(folder.archive)) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return [database.execute(f"SELECT * FROM {name}").fetchall() for name in ("forecast", "measured")]


@pytest.mark.slow
def test_init_tick_and_status_from_the_command_line(log, zone, tmp_path, capsys):
    assert _names(zone) == FILES
    assert main(["zone", "init", str(zone.path), "--log", str(tmp_path)]) == 1
    assert "holds a zone already" in capsys.readouterr().err
    tick = ["zone", "tick", str(zone.path), "--setpoint", "20,25", "--log"]
    made = []
    for day, n_new in ((DAYS, 0), (DAYS + 1, 24), (DAYS + 2, 24), (DAYS + 2, 0)):
        before = tables(zone), zone.model.read_bytes()
        assert main([*tick, str(write(log, tmp_path / "log.csv", day)), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["new rows"] == n_new
        made.append(pd.DataFrame(found["forecast"]).set_index("time"))
        made[-1].index = pd.to_datetime(made[-1].index)
        assert len(made[-1]) == 24
    assert main(["zone", "status", str(zone.path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (tables(zone), zone.model.read_bytes()) == before  # the last tick repeated the one before
    assert [len(rows) for rows in before[0]] == [3 * 24, (DAYS + 2) * 24]
    forecast, truth = made[1], log.loc[made[1].index]
    error = forecast["T_za"] - truth["T_za"]
    yesterday = found["yesterday's forecast"]
    assert yesterday["from"] == str(made[1].index[0])
    assert found["last forecast from"] == str(made[2].index[0])  # as a tick has it, and not the row before
    assert yesterday["temperature [K]"] == {
        "rmse": pytest.approx(np.sqrt((error**2).mean()), abs=2e-3),
        "bias": pytest.approx(error.mean(), abs=2e-3),
        "coverage": pytest.approx(truth["T_za"].between(forecast["q_0.1"], forecast["q_0.9"]).mean(), abs=2e-3),
    }
    assert yesterday["load [kW]"]["rmse"] == pytest.approx(
        np.sqrt(((forecast["Q_hvac"] - truth["Q_hvac"]) ** 2).mean()), abs=2e-3
    )
    assert found["last four weeks"]["forecasts"] == 2
    assert found["last row"] == str(log.index[24 * (DAYS + 2) - 1])
    assert found["drift"]["drifted"] is False
    assert main(["zone", "status", str(zone.path)]) == 0
    out = capsys.readouterr().out
    assert "drift: none (" in out
    assert f"temperature [K]: RMSE {yesterday['temperature [K]']['rmse']}, bias " in out
    assert "% of the measurements inside the 80 % interval" in out


def test_a_forecast_from_an_older_log_is_not_archived(log, zone, cheap, tmp_path):
    """Its model has seen the day that it forecasts, which would be scored."""
    zone.tick(write(log, tmp_path / "log.csv", DAYS + 2), schedule=SCHEDULE)
    before = tables(zone)
    zone.tick(write(log, tmp_path / "log.csv", DAYS + 1), schedule=SCHEDULE)
    assert tables(zone) == before
    zone.tick(write(log, tmp_path / "log.csv", DAYS + 2), schedule=SCHEDULE)
    assert tables(zone) == before


def test_a_tick_of_a_log_without_a_new_temperature_says_so(log, zone, cheap, tmp_path):
    """A dead sensor, or a dead logger, otherwise repeats a forecast of days ago every day."""
    remarks = [zone.tick(write(log, tmp_path / "log.csv", DAYS)).remarks]
    rows, origin = log.iloc[: 24 * (DAYS + 3)].copy(), log.index[24 * DAYS - 1]
    rows.loc[rows.index > origin, "T_za"] = np.nan
    for until in (origin, rows.index[-1]):
        rows[:until].to_csv(tmp_path / "log.csv")
        remarks.append(zone.tick(tmp_path / "log.csv").remarks)
    again = f"no room temperature was measured after {origin}{{}}: the last forecast, from there, is made again"
    assert remarks == [(), (again.format(""),), (again.format(f", although the log goes on to {rows.index[-1]}"),)]
    assert zone.tick(write(log, tmp_path / "log.csv", DAYS + 1)).remarks == ()


def test_a_fit_leaves_out_the_step_that_is_under_way(log, zone, tmp_path):
    """An update would not correct the mean over its beginning."""
    source, config, model = (tmp_path / name for name in ("log.csv", "two_hours.toml", "m.skops"))
    log.iloc[: 24 * 6 + 7].to_csv(source)
    config.write_text(
        zone.config.read_text(encoding="utf-8").replace('step = "60min"', 'step = "2h"'), encoding="utf-8"
    )
    assert main(["fit", str(source), "--config", str(config), "--model", str(model), "-q"]) == 0
    assert ZoneModel.load(model).known_until == log.index[24 * 6 + 4]


@pytest.mark.parametrize("right", [0, 1])
def test_a_step_under_way_is_forecast_from_and_taken_in_when_it_is_over(right, log, zone, cheap, tmp_path):
    """The mean over its beginning would stay in the model."""
    config, source = tmp_path / "zone.toml", tmp_path / "log.csv"
    text = zone.config.read_text(encoding="utf-8").replace('step = "60min"', 'step = "2h"')
    config.write_text(text.replace('label = "left"', 'label = "right"') if right else text, encoding="utf-8")
    begin = 24 * DAYS + 6
    assert abs(log["Q_hvac"].iloc[begin] - log["Q_hvac"].iloc[begin + 1]) > 0.1
    rows = log.assign(**{role: log[role].shift(right) for role in ("q_sol", "Q_hvac", "T_heat_set", "T_cool_set")})
    rows.iloc[right : 24 * DAYS].to_csv(source)
    hall, found = ZoneFolder.init(tmp_path / "hall", source, config), []
    for n_rows in (begin + 1 + right, begin + 2 + right, begin + 2 + right):
        rows.iloc[right:n_rows].to_csv(source)
        done = hall.tick(source)
        found.append((done.n_new, done.forecast.frame.index[0] - pd.Timedelta("1h")))
    assert [n for n, _ in found][1:] == [1, 0]
    assert {first for _, first in found} == {log.index[begin]}
    known = hall.load().known_rows().iloc[-1]
    assert known["Q_hvac"] == pytest.approx(log["Q_hvac"].iloc[begin : begin + 2].mean())


def test_a_tick_finds_the_complete_rows_twice(log, zone, cheap, monkeypatch, tmp_path):
    """Those that the model takes in, and those that the forecast starts from: each costs a pass over the whole log."""
    passes, found = [], readable_log.up_to_measured
    monkeypatch.setattr(readable_log, "up_to_measured", lambda *given: passes.append(1) or found(*given))
    zone.tick(write(log, tmp_path / "log.csv", DAYS))
    assert len(passes) == 2


def test_a_status_says_that_other_set_points_were_in_force(log, zone, cheap, monkeypatch, tmp_path):
    """Errors of a forecast under other set-points are none of the model."""
    told = []
    for first, moved in ((DAYS, 0.1), (DAYS + 1, -3.0125)):

        def at_a_set_point(zone, log_read, weather=None, schedule=None, moved=moved):
            frame = _same_as_now(zone, log_read).frame
            return DayAhead(frame.assign(T_heat_set=log["T_heat_set"].reindex(frame.index) + moved), {}, ())

        monkeypatch.setattr(zone_folder, "forecast_day", at_a_set_point)
        for day in (first, first + 1):
            zone.tick(write(log, tmp_path / "log.csv", day))
        told.append([why for one in zone.status()["verdicts"] for why in one["reasons"] if "set-points" in why])
    last = log.iloc[24 * (DAYS + 2) - 1]
    assert told[0] == []
    assert told[1] == 2 * [
        "in 50 % of the hours forecast other set-points were in force than forecast with, such as T_heat_set "
        f"{last['T_heat_set']:.1f} for {last['T_heat_set'] - 3.0125:.1f} degC at {last.name}"
    ]


def test_a_tick_that_fails_changes_nothing(log, zone, tmp_path):
    source = write(log, tmp_path / "log.csv", DAYS + 1)
    before = tables(zone), zone.model.read_bytes()
    with pytest.raises(ValueError, match="give --setpoint"):
        zone.tick(source)
    assert (tables(zone), zone.model.read_bytes()) == before


def test_a_row_that_is_measured_in_the_future_is_refused_with_its_stamp(log, zone, tmp_path):
    rows = log.iloc[: 24 * (DAYS + 1)]
    late = rows.iloc[-1:].set_axis([pd.Timestamp.now("UTC").ceil("h").tz_convert(rows.index.tz) + pd.Timedelta("10D")])
    pd.concat([rows, late]).rename_axis("time").to_csv(tmp_path / "log.csv")
    before = tables(zone)
    with pytest.raises(ValueError, match=f"{late.index[0]:%Y-%m-%d %H}.* lies in the future; check the stamps at the"):
        zone.tick(tmp_path / "log.csv", schedule=SCHEDULE)
    assert tables(zone) == before
    with pytest.raises(ValueError, match="lies in the future"):
        ZoneFolder.init(tmp_path / "hall", tmp_path / "log.csv", zone.config)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda T: 1.8 * T + 32.0, r"T_za of the log is \d\d K from what the archive has of the same rows"),
        (
            lambda T: T.where(np.arange(len(T)) < 24 * (DAYS - 1), T.iloc[24 * (DAYS - 1) - 1]),
            "T_za stays at .* from 2018-09-25 23:00:00-06:00 to 2018-09-27 23:00:00-06:00, .* is the sensor stuck",
        ),
        (
            lambda T: T.where(np.arange(len(T)) != 24 * (DAYS + 1) - 1, T // 10.0),
            r"'T_za' leaps from 2\d\S* to 2 degC in the last row, 2018-09-27 23:00:00-06:00, .* is the log still being",
        ),
    ],
)
def test_a_log_in_another_unit_of_a_stuck_sensor_or_half_written_is_refused(change, words, log, zone, tmp_path):
    before = tables(zone), zone.model.read_bytes()
    with pytest.raises(ValueError, match=words):
        zone.tick(write(log.assign(T_za=change(log["T_za"])), tmp_path / "log.csv", DAYS + 1), schedule=SCHEDULE)
    assert (tables(zone), zone.model.read_bytes()) == before


def test_an_outdoor_temperature_in_another_unit_is_refused(log, zone, tmp_path):
    """It was warned of, and learned."""
    before = tables(zone), zone.model.read_bytes()
    spoilt = write(log.assign(T_oa=1.8 * log["T_oa"] + 32.0), tmp_path / "log.csv", DAYS + 1)
    with pytest.raises(ValueError, match=r"T_oa of the log is \d\d K from what the model has of the same rows"):
        zone.tick(spoilt, schedule=SCHEDULE)
    assert (tables(zone), zone.model.read_bytes()) == before


@pytest.mark.parametrize(
    ("n_rows", "blank"),
    [(1, ["T_za"]), (3, ["T_za"]), (12, ["T_za"]), (1, ["T_za", "T_oa", "q_sol"]), (3, ["T_za", "T_oa", "q_sol"])],
)
def test_rows_that_are_half_written_are_left_for_the_next_tick(n_rows, blank, log, zone, tmp_path):
    """Their heat was taken for a plan of the day to come, of which all other rows were missing."""
    path, half = tmp_path / "log.csv", log.index[24 * (DAYS + 1) - n_rows : 24 * (DAYS + 1)]
    rows = pd.read_csv(write(log, path, DAYS + 1), index_col=0)
    with zone.config.open("a", encoding="utf-8") as config:
        config.write("\n[thermostat]\nheat = 20\ncool = 25\n")
    rows.loc[half.astype(str), blank] = np.nan
    rows.to_csv(path)
    found = zone.tick(path)
    assert found.n_new == 24 - n_rows
    assert len(found.forecast.frame) == 24
    said = [text for text in found.remarks if "half written" in text]
    of = "'Q_hvac', 'T_heat_set', 'T_cool_set'"
    told = f"row {half[0]}, with {of} but no temperature, seems half written and is"
    if n_rows > 1:
        told = f"rows {half[0]} to {half[-1]}, with {of} but no temperature, seem half written and are"
    assert said == [f"the {told} left for the next time"]
    write(log, path, DAYS + 1)
    found = zone.tick(path)
    assert (found.n_new, [text for text in found.remarks if "half written" in text]) == (n_rows, [])


def _without_heat(rows):
    return rows.assign(Q_hvac=0.0)


def _silent(rows):
    return rows.assign(T_za=np.nan)


@pytest.mark.parametrize(
    ("mistake", "hours", "learns"), [(_without_heat, 12, True), (_silent, 5, True), (_without_heat, 2, False)]
)
def test_rows_that_the_log_corrects_are_learned_anew_once(mistake, hours, learns, log, zone, cheap, tmp_path):
    wrong, corrected = log.copy(), log.index[24 * (DAYS + 1) - 14]
    mistaken = slice(corrected, corrected + pd.Timedelta(hours=hours - 1))
    assert (log.loc[mistaken, "Q_hvac"].abs() > 0.3).all()
    wrong.loc[mistaken] = mistake(wrong.loc[mistaken])
    assert zone.tick(write(wrong, tmp_path / "log.csv", DAYS + 1), schedule=SCHEDULE).learned == ""
    found = zone.tick(write(log, tmp_path / "log.csv", DAYS + 2), schedule=SCHEDULE)
    assert found.n_new == 24
    assert found.learned == (f"rows from {corrected} on were corrected in the log" if learns else "")
    assert zone.tick(write(log, tmp_path / "log.csv", DAYS + 2), schedule=SCHEDULE).learned == ""


# --------------------------------------------------------------------------------------------------------------- kills
def _die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)


def _after(function):
    def run(*args, **kwargs):
        function(*args, **kwargs)
        _die()

    return run


MOMENTS = {
    "before a row is written": lambda: setattr(forecast_archive.ForecastArchive, "add_measured", _die),
    "between the tables": lambda: setattr(forecast_archive.ForecastArchive, "add_forecast", _die),
    "before the model is replaced": lambda: setattr(os, "replace", _die),
    "between the model and the end of the transaction": lambda: setattr(ZoneModel, "save", _after(ZoneModel.save)),
}


def _tick_until(moment, path, source):
    MOMENTS[moment]()
    zone_folder.forecast_day = _same_as_now
    ZoneFolder(path).tick(source)


def _init_until_it_learns(path, source):
    ZoneModel.fit = _die
    ZoneFolder.init(path, source)


def _hold(path, ready):
    with forecast_archive.open_archive(path) as archive, archive.transaction():
        ready.set()
        signal.pause()


def _killed(target, *arguments):
    child = CHILDREN.Process(target=target, args=arguments)
    child.start()
    child.join(60)
    assert child.exitcode == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kills by SIGKILL")
def test_a_kill_at_any_moment_leaves_a_folder_that_the_next_tick_completes(log, zone, cheap, tmp_path):
    source = write(log, tmp_path / "log.csv", DAYS + 1)
    shutil.copytree(zone.path, tmp_path / "whole")
    whole = ZoneFolder(tmp_path / "whole")
    whole.tick(source)
    before = tables(zone)
    for moment in MOMENTS:
        _killed(_tick_until, moment, zone.path, source)
        assert tables(zone) == before
        assert zone.status()["last forecast from"] is None
    assert zone.tick(source).n_new == 0  # the last kill came after the model was saved
    assert tables(zone) == tables(whole)
    assert zone.load().known_until == whole.load().known_until
    assert _names(zone) == FILES


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kills by SIGKILL")
def test_init_is_repeated_after_a_kill(log, tmp_path):
    source = write(log, tmp_path / "log.csv", DAYS, without=slice(24 * 7, 24 * 7 + 9))
    _killed(_init_until_it_learns, tmp_path / "kitchen", source)
    folder = ZoneFolder(tmp_path / "kitchen")
    with pytest.raises(FileNotFoundError, match="make it with skhybrid zone init"):
        folder.tick(source)
    ZoneFolder.init(folder.path, source)
    assert _names(folder) == FILES
    assert folder.load().learned_until == log.index[24 * DAYS - 1]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kills by SIGKILL")
def test_a_second_tick_is_told_of_the_first_whose_lock_ends_with_it(log, zone, cheap, tmp_path, capsys):
    source, ready = write(log, tmp_path / "log.csv", DAYS), CHILDREN.Event()
    child = CHILDREN.Process(target=_hold, args=(zone.archive, ready))
    child.start()
    assert ready.wait(60)
    assert main(["zone", "tick", str(zone.path), "--log", str(source), "--setpoint", "20,25"]) == 1
    assert "another command is at work" in capsys.readouterr().err
    assert zone.status()["last row"] == str(log.index[24 * DAYS - 1])  # reading needs no lock
    child.kill()
    child.join()
    zone.tick(source)


# --------------------------------------------------------------------------------------------------- fitting it again
def test_the_model_is_fitted_again_where_its_errors_grow(log, zone, cheap, tmp_path):
    changed = log.copy()
    hours = (changed.index >= changed.index[24 * DAYS]) & (changed.index.hour >= 8) & (changed.index.hour < 20)
    changed.loc[hours, "T_za"] -= 4.0
    reasons = {}
    for day in range(DAYS + 1, DAYS + 8):
        done = zone.tick(write(changed, tmp_path / "log.csv", day))
        if done.learned:
            reasons[day] = done.learned
            break
    assert reasons
    assert "its errors have grown since 2018-09-2" in done.learned
    assert zone.load().learned_until == zone.load().known_until
    assert zone.status()["drift"] == {}


def test_an_old_model_is_fitted_again(log, zone, cheap, tmp_path):
    source = write(log, tmp_path / "log.csv", DAYS + 2)
    assert zone.tick(source, refit_after=pd.Timedelta(days=2)).learned == ""
    assert "2 days ago" in zone.tick(source, refit_after=pd.Timedelta(days=1)).learned
    assert zone.load().learned_until == log.index[24 * (DAYS + 2) - 1]


def test_rows_after_an_outage_of_hours_are_learned_from_at_once(log, zone, cheap, tmp_path):
    gap = slice(24 * DAYS - 2, 24 * DAYS + 12)
    done = zone.tick(write(log, tmp_path / "log.csv", DAYS + 2, without=gap))
    assert "rows are missing after" in done.learned
    assert zone.load().learned_until == log.index[24 * (DAYS + 2) - 1]
    assert zone.tick(tmp_path / "log.csv").learned == ""


def test_a_log_too_short_for_a_new_fit_is_taken_in_over_an_outage(log, zone, cheap, tmp_path):
    source = write(log[24 * (DAYS - 2) :], tmp_path / "log.csv", 4, without=slice(48, 70))
    done = zone.tick(source)
    assert "rows are missing after" in done.remarks[0]
    assert zone.load().known_until == log.index[24 * (DAYS + 2) - 1]
    assert not any("rows are missing" in text for text in zone.tick(source).remarks)


def test_rows_after_an_outage_of_days_are_learned_from_when_there_are_enough(log, zone, cheap, tmp_path):
    gap = slice(24 * DAYS - 2, 24 * DAYS + 100)
    done = zone.tick(write(log, tmp_path / "log.csv", DAYS + 6, without=gap))
    assert len(done.forecast.frame) == 24
    assert any("rows are missing after" in text and "1.8 days without a long" in text for text in done.remarks)
    done = zone.tick(write(log, tmp_path / "log.csv", 2 * DAYS + 5, without=gap))
    assert "rows are missing after" in done.learned
    assert zone.tick(tmp_path / "log.csv").learned == ""


def test_a_changed_configuration(log, zone, cheap, tmp_path):
    source = write(log, tmp_path / "log.csv", DAYS)
    text = zone.config.read_text(encoding="utf-8")
    zone.config.write_text(text + "\n[thermostat]\nheat = 20\ncool = 25\n", encoding="utf-8")
    assert zone.tick(source).learned == ""
    zone.config.write_text(
        zone.config.read_text(encoding="utf-8").replace("T_cool_set =", "# T_cool_set ="), encoding="utf-8"
    )
    done = zone.tick(write(log, tmp_path / "later.csv", DAYS + 1))
    assert (done.learned, done.n_new) == ("zone.toml has changed", 24)
    assert "T_cool_set" not in zone.load().settings.columns
    zone.config.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"zone.toml has changed, so the model must be fitted again, but the log ends"):
        zone.tick(write(log, tmp_path / "short.csv", DAYS, without=slice(0, 24 * (DAYS - 4))))


@pytest.mark.slow
def test_a_log_that_loses_and_gets_its_time_zone(log, zone, cheap, tmp_path):
    """The archive has one clock, so that later ticks read it and past forecasts are scored."""
    with_zone = zone.config.read_text(encoding="utf-8")
    zone.tick(write(log, tmp_path / "log.csv", DAYS))
    for day, local in ((DAYS + 1, True), (DAYS + 3, False)):
        zone.config.write_text(
            with_zone.replace("timezone =", "# timezone =") if local else with_zone, encoding="utf-8"
        )
        rows = log.tz_localize(None) if local else log
        assert zone.tick(write(rows, tmp_path / "log.csv", day)).learned == "zone.toml has changed"
        zone.tick(write(rows, tmp_path / "log.csv", day + 1))
        with forecast_archive.open_archive(zone.archive) as archive:
            known = archive.measured(rows.index[0])
            assert known.index.tolist() == rows.index[: 24 * (day + 1)].tolist()
            assert archive.finished(rows.index[0])["origin"].nunique() == day + 1 - DAYS


def test_a_full_disk_is_named_and_the_archive_stays(tmp_path):
    index = pd.date_range("2024-01-01", periods=20_000, freq="1h")
    rows = pd.DataFrame({"T_za": 20.0, "Q_hvac": 0.0}, index)
    path = tmp_path / "archive.sqlite"

    def add(rows):
        with forecast_archive.open_archive(path) as archive:
            archive.database.execute("PRAGMA max_page_count = 20")
            with archive.transaction():
                archive.add_measured(rows)

    add(rows[:10])
    with pytest.raises(OSError, match="database or disk is full"):
        add(rows)
    with forecast_archive.open_archive(path) as archive:
        assert archive.last_measured() == index[9]


def test_an_archive_that_is_none_is_refused(log, zone, tmp_path):
    zone.archive.write_bytes(b"not a database" * 100)
    with pytest.raises(OSError, match=r"archive.sqlite cannot be used \(.*move the file away"):
        zone.tick(write(log, tmp_path / "log.csv", DAYS))


def test_a_database_of_another_program_is_refused_and_left_as_it_is(tmp_path):
    path = tmp_path / "archive.sqlite"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE photos (name TEXT)")
    before = path.read_bytes()
    with (
        pytest.raises(OSError, match=r"archive.sqlite is a database of another program, with a table 'photos'; move"),
        forecast_archive.open_archive(path),
    ):
        pass
    assert path.read_bytes() == before


def test_a_model_that_cannot_be_read_may_be_made_again(zone):
    zone.model.write_bytes(zone.model.read_bytes()[:-9])
    with pytest.raises(ModelFileError, match=r"truncated .* remove it and run skhybrid zone init again"):
        zone.status()


def test_a_log_without_a_time_zone_and_without_set_points(log, cheap, tmp_path):
    local = log.tz_localize(None).drop(columns=["T_heat_set", "T_cool_set"])
    folder = ZoneFolder.init(tmp_path / "kitchen", write(local, tmp_path / "log.csv", 5))
    for day in (6, 8):
        assert folder.tick(write(local, tmp_path / "log.csv", day)).learned == ""
    found = folder.status()
    assert found["last row"] == str(local.index[24 * 8 - 1])
    assert found["drift"] == {}  # five days are too few to compare with
    assert found["yesterday's forecast"]["load [kW]"]["coverage"] is None
    done = folder.tick(write(local, tmp_path / "log.csv", 11))
    assert "6 days ago" in done.learned  # more than it learned from


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.slow
def test_stages_are_scored_in_their_unit_and_in_kw_where_a_capacity_is_known(log, cheap, monkeypatch, tmp_path, scaled):
    stages = log.assign(u_heat=log["Q_hvac"].clip(lower=0) / 6.0).drop(columns=["Q_hvac", "T_cool_set"])
    source = write(stages, tmp_path / "log.csv", 8)
    known = "[estimator]\nknown = { Q_h = 6.0 }\n" if scaled else ""
    columns = "".join(f'{role} = "{role}"\n' for role in stages)
    (tmp_path / "zone.toml").write_text(f'step = "1h"\n{known}[columns]\n{columns}', encoding="utf-8")
    folder = ZoneFolder.init(tmp_path / "kitchen", source, tmp_path / "zone.toml")

    def half(zone, log, weather=None, schedule=None):
        found = _same_as_now(zone, log).frame.assign(u_heat=0.5, Q_hvac=3.0, T_oa=99.0)
        return DayAhead(found.assign(**{"Q_hvac_0.1": -20.0, "Q_hvac_0.9": 20.0}), {}, ())

    monkeypatch.setattr(zone_folder, "forecast_day", half)
    for day in (8, 9, 10):
        folder.tick(write(stages, tmp_path / "log.csv", day))
    found, truth = folder.status(), stages["u_heat"].iloc[24 * 8 : 24 * 10]
    last = found["last four weeks"]
    assert last["u_heat [-]"]["rmse"] == pytest.approx(np.sqrt(((0.5 - truth) ** 2).mean()), abs=1e-3)
    assert ("load [kW]" in last) == scaled
    if scaled:
        assert last["load [kW]"]["rmse"] == pytest.approx(6.0 * last["u_heat [-]"]["rmse"], abs=4e-3)
        assert last["load [kW]"]["coverage"] == 1.0
    temperature, load = found["verdicts"]
    for one in (temperature, load):
        assert any("100 % of the last forecast lies beyond what training covered" in text for text in one["reasons"])
        assert "tested on 2 forecasts only" in " ".join(one["reasons"])
    assert ("no certain scale" in " ".join(load["reasons"])) != scaled


def test_a_failed_init_leaves_the_configuration_to_correct(log, tmp_path):
    (tmp_path / "log.csv").write_text(log.iloc[: 24 * 2].to_csv(), encoding="utf-8")
    with pytest.raises(ValueError, match="a model needs 3"):
        ZoneFolder.init(tmp_path / "kitchen", tmp_path / "log.csv")
    given = tmp_path / "mine.toml"
    given.write_text(
        (tmp_path / "kitchen" / "zone.toml").read_text(encoding="utf-8").replace('name = "log"', 'name = "mine"'),
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match="a model needs 3"):
        ZoneFolder.init(tmp_path / "kitchen", tmp_path / "log.csv", given)
    assert (tmp_path / "kitchen" / "zone.toml").read_text(encoding="utf-8") == given.read_text(encoding="utf-8")


@pytest.mark.parametrize("command", ["init", "tick", "status"])
def test_the_folder_of_a_fleet_is_refused(command, log, tmp_path, capsys):
    (tmp_path / "fleet.toml").touch()
    option = [] if command == "status" else ["--log", str(write(log, tmp_path / "log.csv", DAYS))]
    assert main(["zone", command, str(tmp_path), *option]) == 1
    assert "is the folder of a fleet; use skhybrid fleet, or give another folder" in capsys.readouterr().err
    assert not (tmp_path / "zone.toml").exists()


def test_an_init_that_is_refused_leaves_nothing(log, tmp_path):
    given = tmp_path / "mine.toml"
    given.write_text('[columns]\nT_za = "no such column"\nT_oa = "neither"\n', encoding="utf-8")
    source = write(log, tmp_path / "log.csv", DAYS)
    none = tmp_path / "none.csv"
    for call in ((none,), (none, given), (source, given), (source, tmp_path / "none.toml")):
        with pytest.raises((ValueError, OSError)):
            ZoneFolder.init(tmp_path / "kitchen", *call)
        assert not (tmp_path / "kitchen").exists()


def test_a_configuration_that_cannot_be_used_does_not_replace_that_of_the_folder(log, tmp_path):
    own, given = tmp_path / "kitchen" / "zone.toml", tmp_path / "mine.toml"
    own.parent.mkdir()
    own.write_text('[columns]\nT_za = "corrected by hand"\n', encoding="utf-8")
    given.write_text('[columns]\nT_zone = "room"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="does not say which column is T_za"):
        ZoneFolder.init(own.parent, write(log, tmp_path / "log.csv", DAYS), given)
    assert own.read_text(encoding="utf-8") == '[columns]\nT_za = "corrected by hand"\n'


def test_zones_that_differ_in_case_only_are_refused(tmp_path):
    rows = pd.DataFrame({"T_za_Hall": 20.0, "T_za_hall": 21.0}, pd.date_range("2024-01-01", periods=2, freq="1h"))
    with (
        forecast_archive.open_archive(tmp_path / "archive.sqlite") as archive,
        pytest.raises(ValueError, match="the zones Hall and hall differ in upper and lower case only; rename one"),
    ):
        archive.add_measured(rows, ["Hall", "hall", "attic"])


def test_a_locked_archive_asks_to_try_again(tmp_path, monkeypatch):
    monkeypatch.setattr(_sqlite, "_PATIENCE", 0.0)
    path = tmp_path / "forecasts.db"
    with forecast_archive.open_archive(path) as archive:
        assert archive.last_origin() is None
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(BlockingIOError, match="another command is at work"), forecast_archive.open_archive(path):
            pass
