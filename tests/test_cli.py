"""The command line does the whole path, and refuses bad input in one line."""

from __future__ import annotations

import errno
import importlib
import io
import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

import skhybrid
from skhybrid import HybridPredictor, PeriodicDisturbanceID, _table
from skhybrid._json import strict_json
from skhybrid._warnings import recorded_warnings, warn_user
from skhybrid.cli import _group, _output, _study, main
from skhybrid.cli._options import as_command
from skhybrid.cli.forecast import _text
from skhybrid.datasets import make_office
from skhybrid.exceptions import ExcitationWarning
from skhybrid.forecasting.quantiles import INTERVAL
from skhybrid.logs import LogReport
from skhybrid.logs import read_log as read_any_log
from skhybrid.model_selection import backtest
from skhybrid.persistence import load_model
from skhybrid.preprocessing import FacadeIrradiance
from skhybrid.schedule import ScheduledNetwork
from skhybrid.study import (
    Settings,
    Yesterday,
    make_models,
    propose_settings,
    read_log,
    read_settings,
    run_study,
    split_log,
    write_outputs,
)
from skhybrid.study.outputs import format_table, metrics_text
from skhybrid.study.report import verdict
from skhybrid.study.results import StudyResult
from skhybrid.study.settings import as_toml, settings_from
from skhybrid.study.spans import TRAINING_DAYS
from skhybrid.zone.zone_identification import describe_rooms, identify_building

pytestmark = pytest.mark.usefixtures("quick_fits")
FILES = {
    "forecast.csv", "backtest.csv", "parameters.csv", "metrics.json", "model.skops", "report.html", "forecast.png",
}  # fmt: skip


def _log(n_days=14, step="1h", tz=None):
    """A room under a thermostat's schedule, by one resistor and one capacitor."""
    index = pd.date_range("2024-01-01", periods=int(pd.Timedelta(days=n_days) / pd.Timedelta(step)), freq=step, tz=tz)
    rng = np.random.default_rng(0)
    hours = (index - index[0]) / pd.Timedelta("1h")
    outside = 5 + 4 * np.sin(2 * np.pi * (hours - 9) / 24) + rng.normal(0, 0.3, len(index))
    sun = np.clip(np.sin(2 * np.pi * (hours - 6) / 24), 0, None) * 0.3
    heat = np.where((index.hour >= 6) & (index.hour < 20), 3.0, 0.8) + rng.normal(0, 0.3, len(index)).clip(-0.5, 0.5)
    gain = np.where((index.day_of_week < 5) & (index.hour >= 8) & (index.hour < 17), 0.8, 0.1)
    room = np.empty(len(index))
    room[0] = 20.0
    for k in range(len(index) - 1):
        room[k + 1] = room[k] + ((outside[k] - room[k]) / 6.0 + heat[k] + gain[k] + 2 * sun[k]) / 4.0
    room = room + rng.normal(0, 0.03, len(index))
    return pd.DataFrame(
        {"room_temp": room, "outdoor_temp": outside, "solar_W_m2": 1000 * sun, "hvac_kW": heat}, index=index
    ).rename_axis("timestamp")


CONFIG = """
name = "Test room"
step = "1h"
random_state = 1
[columns]
T_za = "room_temp"
T_oa = "outdoor_temp"
q_sol = "solar_W_m2"
Q_hvac = "hvac_kW"
[units]
q_sol = "W/m2"
[network]
name = "1R1C"
[estimator]
name = "input"
n_starts = 2
[forecaster]
model = "profile"
[train]
end = 2024-01-10
[test]
start = 2024-01-11
"""


@pytest.fixture
def files(tmp_path):
    _log().to_csv(tmp_path / "log.csv")
    (tmp_path / "zone.toml").write_text(CONFIG, encoding="utf-8")
    return tmp_path


def _run(folder, *more):
    return main(
        ["run", str(folder / "log.csv"), "--config", str(folder / "zone.toml"), "--out", str(folder / "out"), *more]
    )


class Ran(NamedTuple):
    """A run of the whole path: its folder, what it printed, and the result of its study."""

    out: Path
    said: str
    told: str
    result: StudyResult


@pytest.fixture(scope="module")
def ran(tmp_path_factory, quick_fits):
    folder, results, study = tmp_path_factory.mktemp("study"), [], _study.run_study
    _log().to_csv(folder / "log.csv")
    (folder / "zone.toml").write_text(CONFIG, encoding="utf-8")
    said, told = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(told):
        patch.setattr(_study, "run_study", lambda *given: results.append(study(*given)) or results[0])
        assert _run(folder) == 0
    return Ran(folder / "out", said.getvalue(), told.getvalue(), results[0])


# ------------------------------------------------------------------------------------------------------ the whole path
def test_a_log_is_run_end_to_end(ran):
    assert {p.name for p in ran.out.iterdir()} == FILES
    assert "hybrid" in ran.said
    assert "ARX" in ran.said
    assert "[1/" in ran.told
    metrics = json.loads((ran.out / "metrics.json").read_text(encoding="utf-8"))
    assert set(metrics["models"]) >= {
        "hybrid",
        "building model alone",
        "building model, no disturbance",
        "ARX",
        "ARX, multi-step, re-fitted",
        "boosting on ARX",
        "yesterday",
        "hybrid, two-stage (persistence)",
    }
    assert metrics["models"]["hybrid"]["rmse"] < metrics["models"]["yesterday"]["rmse"]
    assert metrics["verdict"] in ran.said
    assert next(iter(metrics["models"])) == metrics["best"]


def test_the_files_agree_with_one_another(ran):
    out = ran.out
    backtest = pd.read_csv(out / "backtest.csv")
    rmse = np.sqrt(((backtest["hybrid"] - backtest["y_true"]) ** 2).mean())
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert rmse == pytest.approx(metrics["models"]["hybrid"]["rmse"], abs=1e-3)
    assert backtest["lead"].max() == 24
    assert backtest["origin"].min().startswith("2024-01-11T00:00")
    forecast = pd.read_csv(out / "forecast.csv")
    assert len(forecast) == 24
    assert forecast["time"].iloc[0].startswith("2024-01-14T00:00")
    assert {"T_za", "zeta", "Q_hvac", "setpoint", "T_za_measured"} <= set(forecast)
    model = load_model(out / "model.skops")
    parameters = pd.read_csv(out / "parameters.csv", index_col="parameter")
    np.testing.assert_allclose(parameters["value"], model.gray_box_.theta_, rtol=1e-5)
    assert parameters.loc["C_za", "value"] == pytest.approx(4.0, rel=0.3)
    assert "Test room" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("empty_pictures")
def test_rows_without_a_temperature_are_the_next_day(files):
    log = _log()
    log.iloc[-24:, log.columns.get_loc("room_temp")] = np.nan
    log.to_csv(files / "log.csv")
    (files / "zone.toml").write_text(CONFIG + "[load]\nsetpoint = 21.0\n", encoding="utf-8")
    assert _run(files, "-q") == 0
    forecast = pd.read_csv(files / "out" / "forecast.csv")
    assert len(forecast) == 24
    assert "T_za_measured" not in forecast
    assert (forecast["setpoint"] == 21.0).all()
    assert not json.loads((files / "out" / "metrics.json").read_text(encoding="utf-8"))["next_day_held_out"]


@pytest.mark.slow
@pytest.mark.usefixtures("empty_pictures")
def test_two_temperatures_are_enough(files, capsys):
    config = CONFIG.replace('q_sol = "solar_W_m2"', "").replace('Q_hvac = "hvac_kW"', "").replace("[units]", "")
    (files / "zone.toml").write_text(config.replace('q_sol = "W/m2"', ""), encoding="utf-8")
    assert _run(files, "-q") == 0
    metrics = json.loads((files / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["models"]["hybrid"]["load_rmse"] is None
    assert "Q_hvac" not in pd.read_csv(files / "out" / "forecast.csv")
    assert "needed that day" not in (files / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("empty_pictures")
def test_the_schedule_model_is_compared_with_two_stage_models(files, capsys):
    (files / "zone.toml").write_text(CONFIG.replace('[forecaster]\nmodel = "profile"\n', ""), encoding="utf-8")
    assert _run(files, "-q") == 0
    assert capsys.readouterr().err == ""
    out = files / "out"
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert set(metrics["models"]) >= {
        "hybrid",
        "hybrid, two-stage (ridge)",
        "hybrid, two-stage (profile)",
        "ARX re-fitted",
    }
    assert metrics["settings"]["forecaster"] == {"model": "schedule"}
    forecast = pd.read_csv(out / "forecast.csv")
    assert (forecast["q_0.1"] < forecast["q_0.9"]).all()
    model = load_model(out / "model.skops")
    assert isinstance(model.gray_box_, ScheduledNetwork)
    assert model.gray_box_.network_.states == ("T_za",)  # the network that the settings name
    # the parameters are the building's, by the identification
    parameters = pd.read_csv(out / "parameters.csv", index_col="parameter")
    assert parameters.loc["C_za", "value"] == pytest.approx(4.0, rel=0.3)
    backtest = pd.read_csv(out / "backtest.csv")
    assert {"hybrid", "hybrid, two-stage (ridge)"} <= set(backtest)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "separate identification (InputDisturbanceID)" in page
    assert "Learned schedules" in page
    assert f"contained {100 * metrics['interval_80_coverage']:.0f}\u00a0% of the" in page


@pytest.mark.slow
@pytest.mark.usefixtures("empty_pictures")
def test_loads_of_stages_are_in_kw_of_the_identification(files):
    log = _log()
    log["burner"] = (log.pop("hvac_kW") / 5.0).clip(0, 1)
    log.to_csv(files / "log.csv")
    config = CONFIG.replace('Q_hvac = "hvac_kW"', 'u_heat = "burner"').replace('[forecaster]\nmodel = "profile"\n', "")
    (files / "zone.toml").write_text(
        config.replace("n_starts = 2", "n_starts = 2\nknown = { Q_h = 5.0 }"), encoding="utf-8"
    )
    assert _run(files, "-q") == 0
    forecast = pd.read_csv(files / "out" / "forecast.csv")
    np.testing.assert_allclose(forecast["Q_hvac"], 5.0 * forecast["u_heat"], atol=1e-3)
    np.testing.assert_allclose(forecast["Q_hvac_delivered"], 5.0 * log["burner"].iloc[-24:], atol=1e-3)
    assert load_model(files / "out" / "model.skops").known == {"Q_h": 5.0}


def test_the_sun_on_facades_enters_the_hybrid_and_the_black_boxes(files):
    (files / "zone.toml").write_text(CONFIG + "[site]\nlatitude = 52.4\nlongitude = 4.9\n", encoding="utf-8")
    settings = read_settings(files / "zone.toml")
    settings = replace(settings, forecaster={"model": "schedule"}, timezone="UTC")
    data = split_log(read_log(files / "log.csv", settings)[0], settings)
    facades = {"q_sol_east", "q_sol_south", "q_sol_west", "q_sol_north"}
    for table in (data.train, data.later, data.history, data.future):
        assert facades < set(table)
    expected = FacadeIrradiance(52.4, 4.9).fit_transform(data.train[["q_sol"]])
    pd.testing.assert_frame_equal(data.train[sorted(facades)], expected[sorted(facades)])
    models = {one.label: one.estimator for one in make_models(settings)}
    fitted = {name: models[name].fit(data.train, data.train["T_za"]) for name in ("hybrid", "simple building model")}
    assert "q_sol_south->za" in fitted["hybrid"].gray_box_.coef_
    assert [name for name in fitted["simple building model"].theta_.index if name.startswith("A_win")] == ["A_win"]


@pytest.mark.slow
@pytest.mark.usefixtures("empty_pictures")
def test_a_log_too_short_for_intervals_goes_without(files, capsys):
    (files / "zone.toml").write_text(
        CONFIG.replace("[train]", "[train]\nstart = 2024-01-09").replace('"profile"', '"schedule"'), encoding="utf-8"
    )
    assert _run(files) == 0
    assert "no intervals are given" in capsys.readouterr().err
    assert "q_0.1" not in pd.read_csv(files / "out" / "forecast.csv")
    assert json.loads((files / "out" / "metrics.json").read_text(encoding="utf-8"))["interval_80_coverage"] is None


@pytest.mark.slow
def test_the_demo_prints_the_table_and_writes_the_report(tmp_path, capsys):
    assert main(["demo", "--quick", "-q", "--out", str(tmp_path / "demo")]) == 0
    out, said = capsys.readouterr()
    assert "the plan has" not in said, "the verdict says what lies beyond the training"
    assert {p.name for p in (tmp_path / "demo").iterdir()} == FILES
    gray_boxes = ("building model alone", "building model, no disturbance", "simple building model")
    for row in ("hybrid", *gray_boxes, "ARX", "hybrid, two-stage (ridge)", "hybrid, two-stage (profile)"):
        assert row in out
    for column in ("RMSE [K]", "MAE [K]", "load RMSE [kW]", "time [s]"):
        assert column in out
    assert out.startswith("temperature: ")
    assert out.index("known: weather, set-points") < out.index("known: weather, heat")
    page = re.sub(r'<img src="[^"]*"', "", (tmp_path / "demo" / "report.html").read_text(encoding="utf-8"))
    assert "heat loss" in page
    for text in (page, out):  # words of the paper that a reader of a report need not know
        assert not re.search(r"\b(CONV|OD)\b", text)


def test_the_module_runs_and_tells_its_version():
    done = subprocess.run(
        [sys.executable, "-m", "skhybrid", "--version"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0
    assert done.stdout.startswith("skhybrid ")


# --------------------------------------------------------------------------------------------------------- bad input
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('step = "1h"', 'stepp = "1h"', "zone.toml: unknown key 'stepp'; did you mean 'step'?"),
        ("n_starts", "n_startz", "unknown key 'n_startz' in [estimator]"),
        ('model = "profile"', 'modl = "profile"', "unknown key 'modl' in [forecaster]"),
        ('model = "profile"', "patience = 3", "[forecaster] patience has no effect with model = 'schedule'"),
        ('model = "profile"', 'model = "prophet"', "[forecaster] model='prophet' is not known; use "),
        ("end = 2024-01-10", "ende = 2024-01-10", "unknown key 'ende' in [train]"),
        ('"room_temp"', '"temperature"', "'temperature'"),
        ('T_oa = "outdoor_temp"', "", "does not say which column is T_oa"),
        ('name = "input"', 'name = "magic"', "[estimator] name = 'magic'"),
        ('name = "1R1C"', 'name = "9R9C"', "'9R9C'"),
        (
            'step = "1h"',
            'step = "10s"',
            "step = '10 s' is finer than the log, which has a row every 1 h; give step = '1 h'",
        ),
        ('step = "1h"', 'step = "1ns"', "a step of 1e-09 s from "),
        ('step = "1h"', 'step = "soon"', "step = 'soon' is not a duration"),
        ('q_sol = "W/m2"', 'q_sol = "lux"', "'lux'"),
        ("start = 2024-01-11", "start = 2031-01-11", "[test] from 2031-01-11"),
        ("start = 2024-01-11", "start = 2024-01-05", "[train] ends at"),
        ('step = "1h"', "step = ", "; correct it."),
        ("[units]", "[scale]\nu_heat = 0.1\n[units]", "a scale is given for 'u_heat'"),
        ('step = "1h"', 'step = "1h"\nlabel = "middle"', "label = 'middle'"),
        ('step = "1h"', 'step = "1h"\norigin_step = "90min"', "origin_step="),
        ('name = "Test room"', "name = 5", "name = 5 must be text"),
        ('step = "1h"', 'step = "1h"\ntimezone = 5', "timezone = 5 must be text"),
        ('step = "1h"', 'step = "1h"\ntimezone = "Europe/Berln"', "timezone = 'Europe/Berln' is unknown; write it as"),
        ('step = "1h"', 'step = "1h"\ndayfirst = "yes"', "dayfirst = 'yes' must be true or false"),
        ('step = "1h"', 'step = "1h"\ndecimal = ",,"', "decimal = ',,' must be one character"),
        ("random_state = 1", "random_state = 1.5", "random_state = 1.5"),
        ('"room_temp"', '["room_temp"]', "[columns] T_za = ['room_temp']"),
        ('"room_temp"', '"outdoor_temp"', "[columns] T_oa and T_za are both 'outdoor_temp'"),
        ("[units]", 'heat = "hvac_kW"\n[units]', "[columns] heat is not a role"),
        ("n_starts = 2", "n_starts = 0", "n_starts = 0"),
        ("n_starts = 2", 'known = { C_za = "x" }', "known: C_za = 'x' must be a number"),
        ("n_starts = 2", "bounds = { C_za = 3 }", "bounds: C_za = 3"),
        ('name = "input"', 'name = ["input"]', "[estimator] name = ['input']"),
        ('name = "1R1C"', 'capacitances = "C"', "[network] capacitances = 'C' must be a table"),
        ("[train]", "[load]\nsetpoint = 70\n[train]", "[load] setpoint = 70"),
        ("[train]", "[site]\nlatitude = 95\nlongitude = 0\n[train]", "[site] latitude = 95 must be a number"),
        ("[train]", "[site]\nlatitude = 52\n[train]", "[site] does not say longitude"),
        ("[train]", "[site]\nlatitude = 52\nlongitude = 5\n[train]", "have no time zone"),
        ("[train]", "[site]\nlattitude = 52\n[train]", "did you mean 'latitude'?"),
    ],
)
def test_a_wrong_setting_is_refused_in_one_line(files, capsys, old, new, message):
    assert old in CONFIG
    (files / "zone.toml").write_text(CONFIG.replace(old, new, 1), encoding="utf-8")
    assert _run(files, "-q") == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("skhybrid: error: ")
    assert err.count("\n") == 1
    assert message in err
    assert not (files / "out").exists()


def test_a_missing_file_and_a_wrong_command_are_told(files, capsys):
    assert main(["run", str(files / "none.csv"), "--config", str(files / "zone.toml"), "--out", str(files / "o")]) == 1
    assert "none.csv" in capsys.readouterr().err
    assert main(["run", str(files / "log.csv"), "--out", str(files / "o")]) == 2
    assert "--config is missing" in capsys.readouterr().err
    assert main(["fly"]) == 2
    assert main([]) == 2
    assert "Missing command; see skhybrid --help." in capsys.readouterr().err
    assert main(["run", "--help"]) == 0


def test_an_option_that_is_none_is_told_with_those_that_are(capsys):
    """``--quiet`` was proposed in place of ``--out``."""
    assert main(["fit", "log.csv", "--out", "zone.skops"]) == 2
    assert capsys.readouterr().err.replace("option: --out", "option '--out'") == (  # as before Click 8.2
        "skhybrid: error: No such option '--out'; skhybrid fit takes --config, --model, --days, --json, --strict, "
        "--quiet, --help.\n"
    )


def test_a_folder_that_cannot_be_made_is_told_before_the_work(files, tmp_path, capsys):
    arguments = ["run", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--out"]
    (tmp_path / "file").touch()
    assert main([*arguments, str(tmp_path / "file")]) == 1
    assert main([*arguments, str(tmp_path / "file" / "out")]) == 1
    err = capsys.readouterr().err
    assert "[1/" not in err
    assert "is a file; give a folder" in err
    assert "cannot be written to" in err


def test_a_gap_of_an_input_in_the_training_span_is_named(files, capsys):
    log = _log()
    log.iloc[50:150, log.columns.get_loc("outdoor_temp")] = np.nan
    log.to_csv(files / "log.csv")
    assert _run(files, "-q") == 1
    assert "T_oa" in capsys.readouterr().err


def test_an_outage_in_the_training_span_is_bridged_and_one_in_the_test_named(files, capsys):
    log = _log()
    holed = log.copy()
    holed.iloc[50:70, log.columns.get_loc("outdoor_temp")] = np.nan
    holed.to_csv(files / "log.csv")
    settings = read_settings(files / "zone.toml")
    train = split_log(read_log(files / "log.csv", settings)[0], settings).train
    out = slice(50, 70)
    assert train.iloc[out]["T_za"].isna().all()
    assert train.drop(columns="T_za").notna().all(axis=None)
    np.testing.assert_allclose(
        train["T_oa"].iloc[out], np.linspace(*train["T_oa"].iloc[[49, 70]].to_numpy(), 22)[1:-1], rtol=1e-12
    )
    holed = log.copy()
    holed.iloc[-50:-40, log.columns.get_loc("outdoor_temp")] = np.nan
    holed.to_csv(files / "log.csv")
    assert _run(files, "-q") == 1
    assert "T_oa" in capsys.readouterr().err


def test_a_span_that_the_log_cuts_is_told(files):
    (files / "zone.toml").write_text(
        CONFIG.replace("start = 2024-01-11", "start = 2024-01-11\nend = 2024-03-01").replace(
            "end = 2024-01-10", "start = 2023-12-24\nend = 2024-01-10"
        ),
        encoding="utf-8",
    )
    settings = read_settings(files / "zone.toml")
    log = read_log(files / "log.csv", settings)[0]
    data = split_log(log, settings)
    assert data.remarks == (
        f"[train] start = 2023-12-24 is before the first measured row; it starts at {log.index[0]}.",
        f"[test] end = 2024-03-01 is after the last measured row; it ends at {log.index[-1]}.",
    )
    (files / "zone.toml").write_text(CONFIG, encoding="utf-8")
    whole = split_log(log, read_settings(files / "zone.toml"))
    assert not whole.remarks
    assert whole.later.index[0] == log.index[log.index.get_loc(whole.train.index[-1]) + 1]
    utc = log.tz_localize("UTC")
    (files / "zone.toml").write_text(
        CONFIG.replace("start = 2024-01-11", "start = 2024-01-11T00:00:00Z"), encoding="utf-8"
    )
    assert not split_log(utc, read_settings(files / "zone.toml")).remarks


@pytest.mark.usefixtures("empty_pictures")
def test_a_sensor_that_stands_still_is_told(files, capsys):
    log = _log()
    log.iloc[-60:, 0] = 21.0
    log.to_csv(files / "log.csv")
    assert _run(files) == 0
    assert "T_za is 21 degC from 2024-01-12 12:00:00" in capsys.readouterr().err
    log.iloc[:, 0] = 21.0
    log.to_csv(files / "log.csv")
    assert _run(files, "-q") == 1
    assert "T_za is the same in all rows" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_run_that_is_stopped_leaves_nothing(files, name):
    (files / "scratch").mkdir()
    (files / "zone.toml").write_text(CONFIG.replace("n_starts = 2", "n_starts = 5000"), encoding="utf-8")
    arguments = ["run", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--out", str(files / "out")]
    running = subprocess.Popen(
        [sys.executable, "-m", "skhybrid", *arguments], stderr=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(files / "scratch")},
    )  # fmt: skip
    for line in running.stderr:
        if line.startswith("[1/"):
            break
    running.send_signal(getattr(signal, name))
    _, err = running.communicate(timeout=60)
    assert (running.returncode, err) == (130, "skhybrid: stopped\n")
    assert not (files / "out").exists()
    assert not list((files / "scratch").iterdir())


# ---------------------------------------------------------------------------------------------- old folders, full disks
@pytest.fixture(scope="module")
def result(ran):
    return ran.result


@pytest.fixture
def old(files, result, monkeypatch):
    """A folder with the files of an earlier run and one of the user's; the next run finds its study done."""
    monkeypatch.setattr("skhybrid.cli._study.run_study", lambda *_: result)
    folder = files / "out"
    folder.mkdir()
    for name in FILES:
        (folder / name).write_text("old", encoding="utf-8")
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    return folder


def test_metrics_hold_no_number_that_json_lacks(result):
    building = result.building.assign(value=np.inf, std=np.nan, remark="")
    odd = replace(result, building=building, settings=replace(result.settings, log={"table": float("nan")}))
    found = json.loads(metrics_text(odd), parse_constant=pytest.fail)
    assert found["settings"]["log"] == {"table": None}
    assert {one["value"] for one in found["building"].values()} == {None}
    assert found["models"] == json.loads(metrics_text(result))["models"]


@pytest.mark.usefixtures("empty_pictures")
def test_a_report_is_one_file(files, result, monkeypatch, capsys):
    monkeypatch.setattr("skhybrid.study.run_study", lambda *_: result)
    given = ["report", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--out"]
    assert main([*given, str(files / "page.html")]) == 0
    assert "Temperature: " in (files / "page.html").read_text(encoding="utf-8")
    assert str(files / "page.html") in capsys.readouterr().out
    assert main([*given, str(files)]) == 1
    assert "is a folder; give a file" in capsys.readouterr().err
    assert main([*given, str(files / "page.html"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdicts"]


def _contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def _fail(error):
    def fail(*_, **__):
        raise error

    return fail


def test_a_second_run_replaces_every_file_of_the_first_and_no_other(files, old, capsys):
    assert _run(files, "-q") == 0
    assert capsys.readouterr().err == ""
    found = _contents(old)
    assert set(found) == {*FILES, "notes.txt"}
    assert {name for name, content in found.items() if content in (b"old", b"mine")} == {"notes.txt"}


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("part", ["write_csv", "save_model", "write_report", "study_picture"])
def test_a_run_that_fails_in_its_report_leaves_the_old_files(files, old, capsys, monkeypatch, part):
    before = _contents(old)
    monkeypatch.setattr(f"skhybrid.study.outputs.{part}", _fail(OSError(errno.ENOSPC, "No space left on device")))
    assert _run(files, "-q") == 1
    assert _contents(old) == before
    err = capsys.readouterr().err
    assert err == f"skhybrid: error: [Errno 28] cannot write: No space left on device: '{old}'\n"


def test_a_disk_that_fills_up_leaves_the_old_files(files, old, capsys):
    before = _contents(old)
    soft, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, most))
    try:
        assert _run(files, "-q") == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, most))
    assert _contents(old) == before
    assert f"cannot write: File too large: '{old}'" in capsys.readouterr().err


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_a_swap_that_is_interrupted_is_finished(result, old, monkeypatch, stop):
    replace_, calls = Path.replace, []

    def interrupted(self, target):
        calls.append(target)
        if len(calls) == 3:
            raise stop
        return replace_(self, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(stop):
        write_outputs(result, old)
    found = _contents(old)
    assert set(found) == {*FILES, "notes.txt"}
    assert b"old" not in found.values()


@pytest.fixture
def process(monkeypatch):
    """Runs the command line as a process does, with its handlers of signals."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)}

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["skhybrid", *map(str, arguments)])
        return main()

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)
    _output._received.clear()


def _terminate(*_, **__):
    os.kill(os.getpid(), signal.SIGTERM)


def _swallow(*_, **__):
    with suppress(BaseException):
        _terminate()


def _swallow_and_work_on(*_, **__):
    _swallow()
    time.sleep(30)


def _fail_after_a_signal(*_, **__):
    _swallow()
    raise ImportError("numpy failed to import")


def _lose_a_worker(*_, **__):
    _swallow()
    raise RuntimeError("a worker process was terminated")


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("act", [_terminate, _swallow, _fail_after_a_signal, _lose_a_worker])
@pytest.mark.parametrize(
    "part", ["study.read_settings", "cli._study.run_study", "study.outputs.save_model", "study.outputs.study_picture"]
)
def test_a_stop_ends_with_its_code_wherever_it_arrives(files, old, result, process, monkeypatch, capsys, part, act):
    before = _contents(old)
    done = {"read_settings": read_settings, "run_study": lambda *_: result}.get(
        part.rpartition(".")[2], lambda *_: None
    )

    def acting(*args, **kwargs):
        act()
        return done(*args)

    monkeypatch.setattr(f"skhybrid.{part}", acting)
    code = process("run", files / "log.csv", "--config", files / "zone.toml", "--out", old, "-q")
    assert (code, capsys.readouterr().err) == (130, "skhybrid: stopped\n")
    assert _contents(old) == before


def test_a_stop_that_a_library_swallows_is_raised_again(files, old, process, monkeypatch):
    monkeypatch.setattr("skhybrid.cli._study.run_study", _swallow_and_work_on)
    started = time.monotonic()
    assert process("run", files / "log.csv", "--config", files / "zone.toml", "--out", old, "-q") == 130
    assert time.monotonic() - started < 15


def test_a_stop_inside_an_exec_keeps_its_code(tmp_path):
    """``python -m`` exits with SIGINT's code after a KeyboardInterrupt in an exec of text, though it was caught."""
    program = (
        "import os, signal, sys\nfrom skhybrid.cli import demo, main\n"
        "demo.command.callback = lambda **_: exec('os.kill(os.getpid(), signal.SIGTERM)', globals())\nsys.exit(main())"
    )
    (tmp_path / "stopped.py").write_text(program, encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), str(Path(skhybrid.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "stopped", "demo"], capture_output=True, text=True, timeout=60, check=False,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "skhybrid: stopped\n")


def test_a_stop_while_it_starts_ends_with_its_code(files):
    """The handlers stand before the libraries are imported."""
    arguments = ["run", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--out", str(files / "out")]
    running = subprocess.Popen([sys.executable, "-m", "skhybrid", *arguments], stderr=subprocess.PIPE, text=True)
    status = Path(f"/proc/{running.pid}/status")
    until = time.monotonic() + 30
    while time.monotonic() < until:
        caught = status.read_text(encoding="utf-8").split("SigCgt:")[1].split()[0]
        if int(caught, 16) >> (signal.SIGTERM - 1) & 1:
            break
        time.sleep(0.001)
    running.send_signal(signal.SIGTERM)
    _, err = running.communicate(timeout=60)
    assert (running.returncode, err) == (130, "skhybrid: stopped\n")


def test_little_is_imported_before_signals_are_handled():
    """A signal in the time until then ends the process as the system says, not with the documented code."""
    program = (
        "import sys; before = set(sys.modules); import skhybrid.cli; "
        "sys.exit(bool({'argparse', 'email', 'importlib.metadata', 'numpy'} & (set(sys.modules) - before)))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 0


def test_help_loads_no_library_of_numbers():
    """They take seconds."""
    program = (
        "import sys; from skhybrid.cli import main; assert main(['--help']) == 0; "
        "sys.exit(bool({'numpy', 'sklearn', 'torch'} & set(sys.modules)))"
    )
    assert (
        subprocess.run([sys.executable, "-c", program], check=False, timeout=60, stdout=subprocess.DEVNULL).returncode
        == 0
    )


# ------------------------------------------------------------------------------------------------------ configurations
@pytest.mark.parametrize(
    ("sep", "decimal", "dates"),
    [(";", ",", "%d.%m.%Y %H:%M"), ("\t", ".", "%m/%d/%Y %I:%M %p"), (";", ".", "%Y-%m-%d %H:%M")],
)
def test_a_log_of_another_country_is_proposed_and_read(tmp_path, sep, decimal, dates):
    log = _log()
    log.to_csv(tmp_path / "log.csv", sep=sep, decimal=decimal, date_format=dates, encoding="utf-8-sig")
    settings = settings_from(tomllib.loads(propose_settings(tmp_path / "log.csv")))
    frame, _ = read_log(tmp_path / "log.csv", settings)
    np.testing.assert_allclose(frame["T_za"], log["room_temp"])


@pytest.mark.parametrize("dates", ["%d/%m/%Y %H:%M", "%m/%d/%y %I:%M %p", "%Y-%m-%d %H:%M", "%d.%m.%Y %H:%M"])
def test_a_proposal_says_how_dates_are_written_so_that_a_file_of_one_day_is_read(tmp_path, dates):
    log = _log(40)
    log.to_csv(tmp_path / "log.csv", date_format=dates)
    proposed = tomllib.loads(propose_settings(tmp_path / "log.csv"))
    assert proposed.get("dayfirst") == {"%d/": True, "%m/": False}.get(dates[:3])
    day = log.loc["2024-02-01"]
    day.to_csv(tmp_path / "day.csv", date_format=dates)
    frame, _ = read_log(tmp_path / "day.csv", settings_from(proposed))
    assert list(frame.index) == list(day.index)


@pytest.mark.parametrize(
    ("first", "end", "start", "test"),
    [
        (5 * 24, 10 * 24, "2024-01-11", "2024-01-24"),
        (5 * 24, 10 * 24 + 6, "2024-01-12", "2024-01-24"),  # the rest of that day is no whole day
        (5 * 24, 8 * 24, "2024-01-01", "2024-01-21"),  # bridged
        (8 * 24 + 13, 8 * 24 + 15, "2024-01-01", "2024-01-21"),  # short enough to be filled
        (24 * 24 + 13, 24 * 24 + 19, "2024-01-01", "2024-01-26"),  # the test begins on the day after it
        (28 * 24, 28 * 24 + 6, "2024-01-01", "2024-01-19"),  # too late for a test after it
    ],
)
def test_a_proposal_trains_over_outages_and_tests_on_days_without_one(tmp_path, first, end, start, test):
    log = _log(30)
    log.drop(log.index[first:end]).to_csv(tmp_path / "log.csv")
    settings = settings_from(tomllib.loads(propose_settings(tmp_path / "log.csv")))
    assert (str(settings.train["start"]), str(settings.test["start"])) == (start, test)
    data = split_log(read_log(tmp_path / "log.csv", settings)[0], settings)
    assert data.train.drop(columns="T_za").notna().all(axis=None)
    assert data.later.drop(columns="T_za").notna().all(axis=None)


@pytest.mark.parametrize(
    ("change", "comment"),
    [
        (lambda log: log.iloc[: 4 * 24], "# too few days without a long gap"),
        (lambda log: log.drop(columns="room_temp"), '# T_za = "..."  # room temperature: not found'),
        (lambda log: log.rename(columns={"room_temp": "Sensor 3"}), "perhaps 'Sensor 3'"),
        (lambda log: log[["room_temp", "outdoor_temp"]], '# u_heat = "..."  # no column looks like heating'),
    ],
)
def test_what_a_proposal_could_not_find_is_a_comment(tmp_path, change, comment):
    change(_log()).to_csv(tmp_path / "log.csv")
    text = propose_settings(tmp_path / "log.csv")
    assert comment in text
    tomllib.loads(text)


def test_a_log_of_one_row_gets_no_proposal(tmp_path):
    _log().iloc[:1].to_csv(tmp_path / "log.csv")
    with pytest.raises(ValueError, match="two are the least"):
        propose_settings(tmp_path / "log.csv")


def test_a_room_number_is_no_room_temperature_and_an_infinite_cell_no_unit(tmp_path):
    log = _log().assign(solar=0.3)
    log.insert(0, "Room number", 7)
    log.iloc[50, log.columns.get_loc("solar")] = np.inf
    log.drop(columns="solar_W_m2").to_csv(tmp_path / "log.csv")
    proposed = tomllib.loads(propose_settings(tmp_path / "log.csv"))
    assert proposed["columns"]["T_za"] == "room_temp"
    assert "units" not in proposed


def test_a_proposed_configuration_runs_as_it_stands(files, capsys):
    assert main(["check", str(files / "log.csv"), "--config", str(files / "new.toml")]) == 0
    text = (files / "new.toml").read_text(encoding="utf-8")
    proposed = tomllib.loads(text)
    assert proposed["columns"] == {
        "T_za": "room_temp", "T_oa": "outdoor_temp", "q_sol": "solar_W_m2", "Q_hvac": "hvac_kW",
    }  # fmt: skip
    assert proposed["units"] == {"q_sol": "W/m2"}
    assert proposed["forecaster"] == {"model": "schedule"}
    assert tomllib.loads(text.replace("# [site]", "[site]").replace("# lat", "lat"))["site"]["latitude"] == 52.4
    data = split_log(read_log(files / "log.csv", settings_from(proposed))[0], settings_from(proposed))
    assert len(data.train)
    assert data.test_start > data.train.index[-1]


def test_a_configuration_that_is_there_is_used_and_kept(files, capsys):
    text = (files / "zone.toml").read_text(encoding="utf-8")
    assert main(["check", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["columns"]["room_temp"]["reason"] == "it was given"
    assert (files / "zone.toml").read_text(encoding="utf-8") == text
    assert main(["check", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--overwrite"]) == 0
    assert (
        settings_from(tomllib.loads((files / "zone.toml").read_text(encoding="utf-8"))).columns["T_za"] == "room_temp"
    )


def test_capacities_are_proposed_with_their_signs_and_known_where_they_are_given(tmp_path, capsys):
    log, config = tmp_path / "log.csv", tmp_path / "zone.toml"
    make_office(n_days=4, random_state=0).X.to_csv(log)
    assert main(["check", str(log), "--config", str(config), "-q"]) == 0
    assert "kW of u_cool: its capacity" in capsys.readouterr().out
    text = config.read_text(encoding="utf-8")
    assert "# known = { Q_h = 6.0, Q_c = -5.0 }" in text
    config.write_text(text.replace("# known", "known"), encoding="utf-8")
    assert main(["check", str(log), "--config", str(config), "-q"]) == 0
    assert "capacity" not in capsys.readouterr().out


def test_roles_whose_kw_the_settings_fix():
    roles = ("T_oa", "T_za_hall", "u_heat_hall", "u_cool_hall", "T_za_attic", "Q_heat_attic")
    columns = {role: role for role in roles}
    known = {"columns": columns, "estimator": {"known": {"Q_h": 6.0}}}
    assert settings_from(known).scaled_roles == ["u_heat_hall"]
    of_one = {"T_za": "a", "T_oa": "b", "Q_heat": "c", "u_heat_2": "d"}
    electric = {"columns": of_one, "plant": {"electricity": True, "cop": 3.0}, "estimator": {"known": {"Q_h_2": 1.0}}}
    assert settings_from(electric).scaled_roles == ["u_heat_2", "Q_heat"]


@pytest.mark.parametrize("option", [["--timezone", "Europe/Berlin"], ["--format", "csv"]])
def test_options_that_a_configuration_would_overrule_are_refused(option, files, capsys):
    given = ["check", str(files / "log.csv"), "--config", str(files / "zone.toml"), *option]
    assert main(given) == 2
    assert f"correct it, without {option[0]}" in capsys.readouterr().err
    assert main([*given, "--overwrite"]) == 0


def test_the_columns_of_real_logs_are_found(shared_data):
    home = tomllib.loads(propose_settings(shared_data / "dutch_home_2.csv"))
    assert home["columns"] == {
        "T_za": "T_in_degC", "T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd",
    }  # fmt: skip
    assert home["units"]["u_heat"] == "percent"  # not 1/largest value, which depends on the log's length
    assert "scale" not in home
    office = tomllib.loads(propose_settings(shared_data / "small_office_chicago_irregular.csv"))
    assert office["columns"]["Q_hvac"] == "q_hvac_kW"
    assert (office["label"], office["timezone"]) == ("right", "-06:00")
    assert (home["label"], home["timezone"]) == ("left", "UTC")
    assert "truth_gains_kW" not in office["columns"].values()


@pytest.mark.parametrize("name", ["dutch_home_2", "small_office"])
def test_the_kept_configurations_fit_their_logs(shared_data, name):
    settings = read_settings(Path(__file__).parents[1] / "examples" / "configs" / f"{name}.toml")
    log = {"small_office": "small_office_chicago_irregular"}.get(name, name)
    data = split_log(read_log(shared_data / f"{log}.csv", settings)[0], settings)
    assert data.train.drop(columns="T_za").notna().all(axis=None)
    assert data.later.drop(columns="T_za").notna().all(axis=None)
    assert data.later.index[0] == data.train.index[-1] + pd.Timedelta("15min")
    assert str(data.test_start.date()) == str(settings.test["start"])
    if "u_heat" in data.train:
        assert 0.5 < data.train["u_heat"].max() <= 1.0
    assert make_models(settings)[0].label == "hybrid"


# -------------------------------------------------------------------------------------------------------------- parts
def test_a_declared_network_is_understood():
    settings = Settings(
        columns={"q_sol": "sun"},
        network={
            "capacitances": {"za": "C_za"}, "resistors": {"R_zo": ["za", "T_oa"]}, "solar": {"za": "rest"},
        }
    )  # fmt: skip
    for one in make_models(settings)[:2]:  # the schedule model, and an identification
        network = (getattr(one.estimator, "gray_box", None) or one.estimator).network
        assert network.states == ("T_za",)
        assert network.resistors["R_zo"] == ("za", "T_oa")


def test_the_hybrid_is_the_predictors_default_unless_more_is_said():
    hybrid = make_models(Settings())[0].estimator
    assert hybrid.gray_box is None
    assert hybrid.forecaster is None
    known = make_models(Settings(estimator={"known": {"Q_h": 8.0, "R_zo": 4.0}}))[0].estimator
    assert known.gray_box is None
    assert (known.network, known.known) == (None, {"Q_h": 8.0})
    two_stage = make_models(Settings(forecaster={"model": "profile"}))
    assert isinstance(two_stage[0].estimator.gray_box, PeriodicDisturbanceID)
    assert two_stage[0].estimator.gray_box.network.name == "2R2C"
    assert "hybrid, two-stage (profile)" not in [one.label for one in two_stage]


@pytest.fixture
def profile_study(files):
    settings = read_settings(files / "zone.toml")
    return settings, split_log(read_log(files / "log.csv", settings)[0], settings)


def test_a_study_reads_each_span_once(profile_study, monkeypatch):
    settings, data = profile_study
    spans, parse = [], _table._parse

    def counted(estimator, X, *args):
        spans.append((X.index[0], X.index[-1]))
        return parse(estimator, X, *args)

    monkeypatch.setattr(_table, "_parse", counted)
    run_study(settings, data)
    frames = (data.train, data.later)
    expected = [
        *((frame.index[0], frame.index[-1]) for frame in frames),
        (data.history.index[0], data.future.index[-1]),
    ]
    assert sorted(spans) == sorted(expected)


def test_a_study_fits_and_back_tests_every_model_once_on_shared_tables(profile_study, monkeypatch):
    settings, data = profile_study
    fitted, tested = [], []

    def backtested(model, X, y, **given):
        tested.append((id(model), type(X), given.get("quantiles")))
        return backtest(model, X, y, **given)

    fit = HybridPredictor.fit
    monkeypatch.setattr(HybridPredictor, "fit", lambda self, X, y: fitted.append(type(X)) or fit(self, X, y))
    monkeypatch.setattr("skhybrid.study.scores.backtest", backtested)
    result = run_study(settings, data)
    assert fitted == [_table.ZoneTable] * 4  # the hybrid and three baselines
    assert len({model for model, *_ in tested}) == len(tested) == len(result.frames)
    assert [quantiles for *_, quantiles in tested] == [INTERVAL] + [None] * (len(tested) - 1)
    assert sum(kind is pd.DataFrame for _, kind, _ in tested) == 1  # yesterday, which is not an estimator of tables


@pytest.mark.parametrize(
    ("given", "message"),
    [({"test": {"start": "2024-02-31"}}, r"\[test\] start = '2024-02-31'"),
     ({"train": {"start": "2024-01-01"}, "test": {"start": "soon"}}, r"\[test\] start = 'soon'"),
     ({"load": {"setpoint": "wanted"}}, "column 'wanted', has no value from")],
)  # fmt: skip
def test_spans_and_set_points_that_are_not_there_are_named(given, message):
    frame = _log(12).rename(columns={"room_temp": "T_za", "outdoor_temp": "T_oa"})[["T_za", "T_oa"]]
    settings = settings_from({"columns": {"T_za": "T_za", "T_oa": "T_oa"}, "step": "1h", **given})
    for rows in (frame, frame.assign(setpoint=np.nan)):
        with pytest.raises(ValueError, match=message):
            split_log(rows, settings)


@pytest.mark.parametrize("of", [identify_building, describe_rooms])
def test_a_log_without_a_complete_row_is_refused(of):
    columns = {name: name for name in (("T_za",) if of is identify_building else ("T_za_a", "T_za_b"))}
    frame = pd.DataFrame(20.0, pd.date_range("2024-01-01", periods=48, freq="1h"), [*columns]).assign(T_oa=np.nan)
    with pytest.raises(ValueError, match="no row of the log has all inputs"):
        of(settings_from({"columns": columns | {"T_oa": "T_oa"}, "step": "1h"}), frame)


def test_a_proposal_counts_days_by_the_calendar(tmp_path):
    index = pd.date_range("2021-03-01", "2021-04-10 12:00", freq="1h", tz="Europe/Amsterdam")  # an hour is skipped
    log = _log(60)[: len(index)].set_axis(index.map(pd.Timestamp.isoformat)).rename_axis("timestamp")
    log.to_csv(tmp_path / "log.csv")
    report = LogReport(read_any_log(tmp_path / "log.csv", timezone="Europe/Amsterdam"))
    spans = tomllib.loads(propose_settings(tmp_path / "log.csv", report))
    assert [str(day) for day in spans["train"].values()] == ["2021-03-01", "2021-03-27"]
    assert [str(day) for day in spans["test"].values()] == ["2021-03-28", "2021-04-09"]


@pytest.mark.parametrize("text", ['a "b" \\ c\td', "Temp\n(°C)", "\x07"])
def test_texts_survive_toml(text):
    assert tomllib.loads(f"a = {as_toml(text)}")["a"] == text


def test_spans_that_are_not_given_are_two_thirds_and_one():
    frame = _log(n_days=12).rename(columns={"room_temp": "T_za", "outdoor_temp": "T_oa", "hvac_kW": "Q_hvac"})
    data = split_log(frame[["T_oa", "Q_hvac", "T_za"]], Settings(step="1h"))
    assert len(data.train) == 8 * 24
    assert len(data.later) == 4 * 24
    assert data.future.index[0] == pd.Timestamp("2024-01-12")
    assert data.held_out


def test_yesterday_is_what_was_measured_a_day_before_and_knows_nothing_later():
    frame = _log(5).rename(columns={"room_temp": "T_za"})
    model = Yesterday().fit(frame)
    paths = model.predict_from(frame, [47, 60], "1D")
    np.testing.assert_array_equal(paths[0], frame["T_za"].to_numpy()[24:48])
    changed = frame.copy()
    changed.iloc[61:, 0] = -99.0
    np.testing.assert_array_equal(model.predict_from(changed, [47, 60], "1D"), paths)
    np.testing.assert_array_equal(model.predict_from(frame, [47], "2D")[0, 24:], paths[0])
    follows = Yesterday().fit(frame[:48]).predict_from(frame[48:], [0, 5])  # the last day of the training comes before
    np.testing.assert_array_equal(follows, model.predict_from(frame, [48, 53]))
    apart = Yesterday().fit(frame[:48]).predict_from(frame[60:], [0])
    assert (apart == frame["T_za"].iloc[60]).all()


def test_the_table_marks_the_best_and_names_another_model_that_wins():
    table = pd.DataFrame(
        {"rmse": [0.3, 0.5], "mae": [0.2, 0.4], "load_rmse": [np.nan, 1.0], "seconds": 1.0}, index=["ARX", "hybrid"]
    )
    lines = format_table(table).splitlines()
    assert lines[2].startswith("* ARX")
    assert lines[2].split()[-2] == "-"
    assert "Another model forecasts better here: the error of ARX" in verdict(table)


COMMANDS = {"check", "fit", "forecast", "update", "backtest", "identify", "run", "report", "search", "zone", "serve",
            "demo", "export", "zone init", "zone tick", "zone status", "export emhass",
            "fleet", "fleet fit", "fleet tick", "fleet status"}  # fmt: skip


def test_fit_learns_from_as_many_days_as_a_zone_folder_does():
    (days,) = (one for one in importlib.import_module("skhybrid.cli.fit").command.params if one.name == "days")
    assert days.default == TRAINING_DAYS  # stated in both, as the command line loads the study only when it is needed


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_begins_with_what_a_command_has_and_ends_with_an_example_of_it(name, capsys):
    assert main([*name.split(), "-h"]) == 0
    out = capsys.readouterr().out
    assert f"Example:\n    skhybrid {name} " in out
    if "Commands:" not in out:
        options = re.findall(r"^  (?:-., )?(--[\w-]+)", out, re.MULTILINE)
        assert options[-4:] == ["--json", "--strict", "--quiet", "--help"]


@pytest.mark.parametrize(
    ("name", "required"),
    [*((n, True) for n in ("fit", "backtest", "identify", "run", "report", "search")),
     *((n, False) for n in ("check", "zone init", "export emhass"))],
)  # fmt: skip
def test_help_marks_a_configuration_that_a_command_does_not_go_without(name, required, capsys):
    assert main([*name.split(), "-h"]) == 0
    told = capsys.readouterr().out.partition("--config zone.toml")[2].partition("  --")[0]
    assert told
    assert ("[required]" in told) == required


@pytest.mark.parametrize("name", ["", "zone", "export"])
def test_a_list_of_commands_cuts_no_sentence(name, capsys):
    assert main([*name.split(), "-h"]) == 0
    listed = capsys.readouterr().out.partition("Commands:")[2]
    assert listed
    assert "..." not in listed
    if name == "zone":
        assert re.findall(r"^  (\w+)  ", listed, re.MULTILINE) == ["init", "tick", "status"]


PAGES = [p for part in ("start", "how_to") for p in (Path(__file__).parents[1] / "docs" / part).glob("*.rst")]
TEXTS = [
    page.read_text(encoding="utf-8").replace("\\\n", "") for page in PAGES
]  # with commands over several lines on one
SHOWN = [line for text in TEXTS for line in re.findall(r"^   \$ skhybrid (\w.+)$", text, re.MULTILINE)]


@pytest.mark.parametrize("line", sorted(set(SHOWN)))
def test_the_commands_of_the_docs_are_those_of_the_command_line(line):
    import click

    at, words = _group(), shlex.split(line)
    while isinstance(at, click.Group):
        at = at.get_command(click.Context(at), words.pop(0))
    parent = click.Context(at, help_option_names=["-h", "--help"])  # which the command keeps for later calls
    at.make_context(line, words, parent)


def test_the_docs_show_every_command():
    assert len(SHOWN) > 10
    assert {name for name in COMMANDS if not any(line.startswith(name) for line in SHOWN)} == set()


def test_a_shell_completes_commands():
    given = {"_SKHYBRID_COMPLETE": "bash_complete", "COMP_WORDS": "skhybrid fo", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "skhybrid"], capture_output=True, text=True, timeout=60, check=False,
        env={**os.environ, **given},
    )  # fmt: skip
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "plain,forecast", "")


@pytest.mark.parametrize("words", ["check", "fit", "forecast --log", "update --log", "zone tick kitchen --log",
                                   "export emhass"])  # fmt: skip
def test_a_shell_completes_the_file_of_a_log(words):
    from click.shell_completion import ShellComplete

    *before, last = words.split()
    found = ShellComplete(_group(), {}, "skhybrid", "_SKHYBRID_COMPLETE").get_completions([*before, last], "th")
    assert [item.type for item in found] == ["file"]


def test_a_command_that_fails_says_what_it_warned_of(capsys):
    """So does a study inside it, which records its warnings."""

    def fail(**options):
        with recorded_warnings():
            warn_user("the stage never moved", ExcitationWarning)
            raise ValueError("too few rows")

    with pytest.raises(ValueError, match="too few rows"):
        as_command("fail", "skhybrid fail")(fail).main([], standalone_mode=False)
    assert capsys.readouterr().err == "warning: the stage never moved\n"


@pytest.mark.usefixtures("empty_pictures")
def test_stages_alone_give_no_kilowatt_and_no_heat_loss(files, capsys):
    """Nor does a command name a class of the package."""
    log = _log()
    log["hvac_kW"] /= 5.0
    log.rename(columns={"hvac_kW": "stage"}).to_csv(files / "log.csv")
    (files / "zone.toml").write_text(CONFIG.replace('Q_hvac = "hvac_kW"', 'u_heat = "stage"'), encoding="utf-8")
    assert main(["identify", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert found["heat loss"]["value"] is None
    assert found["heat loss"]["remark"] == "not identified: no capacity of the plant is known"
    assert found["time constant 1"]["value"] > 1.0
    assert "warning: the scale of the network" in err
    assert _run(files) == 0
    out, err = capsys.readouterr()
    assert "load RMSE [-]" in out
    assert "[kW]" not in out
    assert not re.search(r"\b(?:\w+ID|GrayBoxRC|CONV|OD)\b", out + err)
    page = (files / "out" / "report.html").read_text(encoding="utf-8")
    assert "load RMSE [-]" in page
    assert page.count("the scale of the network is not identifiable") == 1


def test_a_forecast_without_an_interval_shows_none():
    time = pd.date_range("2024-01-01", periods=2, freq="3h")
    frame = pd.DataFrame({"T_za": [20.0, 21.0], "q_0.1": [np.nan, 20.5], "q_0.9": [np.nan, 21.5]}, index=time)
    first, second = _text(SimpleNamespace(frame=frame, summary={})).splitlines()[2:4]
    assert first.split()[2:] == ["20.0", "-"]
    assert second.split()[2:] == ["21.0", "20.5", "to", "21.5"]


def test_a_model_that_cannot_be_written_is_refused_before_the_fit(files, tmp_path, capsys):
    assert main(["fit", str(files / "log.csv"), "--config", str(files / "zone.toml"), "--model", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"skhybrid: error: --model {tmp_path} is a folder; give a file.\n"


@pytest.mark.parametrize(
    ("command", "words"),
    [("check {log} --config {here}", "--config {here} is a folder; give a file."),
     ("check {log} --config {log}/a.toml", "--config {log}/a.toml cannot be written to; give another file."),
     ("forecast --model none.skops --log {log} --out {here}", "--out {here} is a folder; give a file."),
     ("export emhass {log} --config {toml} --out {here}", "--out {here} is a folder; give a file."),
     ("zone init {log} --log {log}", "DIR {log} is a file; give a folder.")],
)  # fmt: skip
def test_a_place_that_cannot_be_written_to_is_named_with_its_option(command, words, files, tmp_path, capsys):
    """It was ``[Errno 21] cannot write: Is a directory``, after the work."""
    names = {"log": files / "log.csv", "toml": files / "zone.toml", "here": tmp_path}
    assert main(command.format(**names).split()) == 1
    assert capsys.readouterr().err == f"skhybrid: error: {words.format(**names)}\n"


@pytest.mark.parametrize(
    "command",
    ["fit LOG --config zone.toml --model m --days", "zone tick kitchen --log LOG --refit-after",
     "fleet fit houses --jobs", "search LOG --config zone.toml --store s --jobs"],
)  # fmt: skip
def test_a_number_beyond_all_use_is_refused(command, capsys):
    """It overflowed, in a traceback or after the work."""
    assert main([*command.split(), "1" + 20 * "0"]) == 2
    assert "is not in the range" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "words"),
    [("report LOG --config TOML --out LOG", "as the log and as --out"),
     ("fit LOG --config TOML --model LOG", "as the log and as --model"),
     ("backtest LOG --config TOML --out TOML", "as --config and as --out"),
     ("check LOG --config LOG --overwrite", "as the log and as --config"),
     ("export emhass LOG --config TOML --out LOG", "as the source and as --out")],
)  # fmt: skip
def test_no_command_writes_over_what_it_reads(command, words, files, capsys):
    """A report over the log would cost the measurements."""
    names = {"LOG": files / "log.csv", "TOML": files / "zone.toml"}
    before = {path: path.read_bytes() for path in names.values()}
    assert main([str(names.get(word, word)) for word in command.split()]) == 2
    assert words in capsys.readouterr().err
    assert {path: path.read_bytes() for path in names.values()} == before


def test_the_building_is_told_with_its_units(files, capsys):
    assert main(["identify", str(files / "log.csv"), "--config", str(files / "zone.toml"), "-q"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^heat loss \[W/K\] +\d+", out, re.MULTILINE)
    assert "std. error" in out.splitlines()[0]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("export emhass log --hours -3", "a plan of -3 h in steps of 0.5 h is too short; give two steps or more"),
        ("export emhass log --step inf", "a plan of 6 h in steps of inf h is too short; give two steps or more"),
        ("export emhass log --hours 1e9", "a plan of 1e+09 h is longer than a year"),
        ("search log --config config --store out --models foo", "framework 'foo' is not known"),
        ("forecast --model model --log log --weather rain.csv", "there is no file 'rain.csv'"),
        ("zone tick folder --log log --weather rain.csv", "there is no file 'rain.csv'"),
        ("zone tick folder --log log --weather .", "'.' is a folder; give a file in it"),
        ("serve folder --weather rain.csv", "there is no file 'rain.csv'"),
    ],
)
def test_what_is_wrong_from_the_start_is_said_before_a_file_is_read(files, monkeypatch, capsys, command, said):
    monkeypatch.chdir(files)
    names = {"config": "zone.toml", "log": "none.csv", "model": "none.skops"}  # of which only the first one exists
    assert main([names.get(word, word) for word in command.split()]) == 1
    assert capsys.readouterr().err.startswith(f"skhybrid: error: {said}")


def test_a_store_of_a_search_that_is_a_file_is_refused(files, capsys):
    log = files / "log.csv"
    place = [str(log), "--config", str(files / "zone.toml"), "--models", "ridge", "-q"]
    assert main(["search", *place, "--store", str(log)]) == 1
    assert capsys.readouterr().err == f"skhybrid: error: --store {log} is a file; give a folder.\n"


def test_json_has_numbers_of_numpy_as_numbers_and_none_that_is_not_finite():
    content = {"n": np.int64(3), "x": np.float32(0.5), "gap": np.nan, "parts": (np.inf, np.bool_(True)), 2: Path("a")}
    expected = {"n": 3, "x": 0.5, "gap": None, "parts": [None, True], "2": "a"}
    assert json.loads(strict_json(content)) == expected


def test_a_search_prints_its_candidates_with_units(files, capsys):
    place = [str(files / "log.csv"), "--config", str(files / "zone.toml"), "--store", str(files / "store")]
    assert main(["search", *place, "--models", "ridge,profile", "-q"]) == 0
    out, err = capsys.readouterr()
    assert not err
    head, *rows = out.splitlines()
    assert re.split(r"  +", head.strip()) == ["model", "case", "RMSE [K]", "time [s]"]
    assert sorted(row.split()[0] for row in rows) == ["profile", "ridge"]
    errors = [float(row.split()[2]) for row in rows]
    assert errors == sorted(errors)


def test_progress_on_a_terminal_leaves_a_line_to_what_follows(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    say = _output.Progress(quiet=False)
    say(1, 3, "reading")
    say(2, 3, "learning")
    say.note("a note")
    say(2, 3, "learning")
    _output.report_error("it failed.")
    say(3, 3, "writing")
    lines = re.sub(r"[^\n]*\r\033\[K", "", capsys.readouterr().err).splitlines()
    assert [line.split("  ")[-1].partition(",")[0] for line in lines] == [
        "learning", "a note", "learning", "skhybrid: error: it failed.", "writing"
    ]  # fmt: skip
    assert "s left" in lines[0]
