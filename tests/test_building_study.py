"""Several zones in the other commands: a study with its report, identification, a zone folder and its server."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid.cli import main
from skhybrid.identification import GrayBoxRC, identify_rooms
from skhybrid.inspection import RoomMapDisplay
from skhybrid.persistence import load_model
from skhybrid.study import read_log, read_settings, split_log
from skhybrid.study.zone_part import data_of, forecast_of, settings_of_zone
from skhybrid.thermal import building_network
from skhybrid.zone import DayAhead, ZoneFolder, ZoneModel, zone_folder, zone_state
from skhybrid.zone.forecast_archive import open_archive

sys.path.insert(0, str(Path(__file__).parent / "rooms"))
from three_rooms import make_rooms

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")]
ZONES = ("kitchen", "hall")
CONFIG = """
name = "house <b>&"
step = "1h"
adjacency = [["kitchen", "hall"]]
[columns]
T_oa = "T_oa"
q_sol = "q_sol"
T_za_kitchen = "T_za_kitchen"
Q_hvac_kitchen = "Q_hvac_kitchen"
T_za_hall = "T_za_hall"
Q_hvac_hall = "Q_hvac_hall"
[network]
name = "1R1C"
[estimator]
name = "conventional"
n_starts = 2
[train]
end = 2024-01-15
[test]
start = 2024-01-16
end = 2024-01-19
[tariff]
price = 0.3
currency = "EUR"
"""


def run(*arguments: object) -> int:
    return main([*map(str, arguments), "-q"])


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    X = make_rooms()[0].drop(columns=["T_za_study", "Q_hvac_study"])
    return X[: 13 * 24].rename_axis("time")


@pytest.fixture(scope="module")
def place(log, tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("house")
    log.to_csv(made / "log.csv")
    (made / "house.toml").write_text(CONFIG, encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def study(place) -> Path:
    """The folder of a study."""
    assert run("run", place / "log.csv", "--config", place / "house.toml", "--out", place / "out") == 0
    return place / "out"


# ------------------------------------------------------------------------------------------------------------ the study
def test_a_study_has_errors_and_verdicts_of_each_zone(study):
    found = json.loads((study / "metrics.json").read_text(encoding="utf-8"))
    frame = pd.read_csv(study / "backtest.csv", parse_dates=["time", "origin"])
    models = [label for label, row in found["models"].items() if row["rmse"] is not None]
    assert {"hybrid", "hybrid, each zone by itself", "ARX re-fitted", "yesterday"} <= set(models)
    for zone in ZONES:
        own = frame[frame["zone"] == zone]
        for label in models:
            rmse = np.sqrt(((own[label] - own["y_true"]) ** 2).mean())
            assert found["zones"][zone][label] == pytest.approx(rmse, abs=1e-4)
        assert found["zones"][zone]["load_rmse"] > 0
    levels = [found["zones"][zone]["level"] for zone in found["zones"]]
    assert levels == sorted(levels, key=["not usable", "use with care", "usable"].index)
    order = [one["quantity"] for one in found["verdicts"]]
    assert order == [f"{what} of {zone}" for zone in found["zones"] for what in ("temperature", "load")]
    assert found["building"]["exchange"][0]["zones"] == list(ZONES)
    assert set(found["building"]["zones"]["hall"]) >= {"heat loss", "solar aperture"}


@pytest.mark.slow
def test_a_study_of_rooms_that_share_a_boiler_has_no_loads(log, tmp_path):
    heat = ["Q_hvac_kitchen", "Q_hvac_hall"]
    boiler = log.drop(columns=heat).assign(Boiler=log[heat].sum(axis=1) / log[heat].sum(axis=1).max())
    boiler.to_csv(tmp_path / "log.csv")
    config = CONFIG.replace('Q_hvac_kitchen = "Q_hvac_kitchen"', 'u_heat = "Boiler"')
    (tmp_path / "house.toml").write_text(config.replace('Q_hvac_hall = "Q_hvac_hall"', ""), encoding="utf-8")
    assert run("run", tmp_path / "log.csv", "--config", tmp_path / "house.toml", "--out", tmp_path / "out") == 0
    found = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert {one["quantity"] for one in found["verdicts"]} == {f"temperature of {zone}" for zone in ZONES}
    assert "the zones share the plant of the column Boiler" in (tmp_path / "out" / "report.html").read_text(
        encoding="utf-8"
    )


def test_yesterday_is_the_temperature_of_the_zone_a_day_before(study, log):
    frame = pd.read_csv(study / "backtest.csv", parse_dates=["time"])
    hall = frame[frame["zone"] == "hall"]  # the day before the test is the last of the training
    before = log["T_za_hall"].reindex(pd.DatetimeIndex(hall["time"]) - pd.Timedelta("1D"))
    np.testing.assert_allclose(hall["yesterday"], before, atol=1e-3)


def test_the_forecast_of_a_study_is_that_of_its_model(study, place):
    settings = read_settings(place / "house.toml")
    data = split_log(read_log(place / "log.csv", settings)[0], settings)
    expected = load_model(study / "model.skops").forecast(
        data.history,
        data.future.drop(columns=list(data.setpoint), errors="ignore").drop(columns=settings.roles_of("T_za")),
    )
    found = pd.read_csv(study / "forecast.csv", index_col=0, parse_dates=True)
    for zone in ZONES:
        np.testing.assert_allclose(found[f"T_za_{zone}"], expected[f"T_za_{zone}"], atol=1e-3)
        np.testing.assert_allclose(found[f"T_za_measured_{zone}"], data.future[f"T_za_{zone}"], atol=1e-3)
        np.testing.assert_allclose(found[f"Q_hvac_delivered_{zone}"], data.future[f"Q_hvac_{zone}"], atol=1e-3)
    cost = json.loads((study / "metrics.json").read_text(encoding="utf-8"))["next_day_cost"]
    assert cost["value"] == pytest.approx(0.3 * sum(found[f"Q_hvac_{zone}"].abs().sum() for zone in ZONES), abs=0.01)
    assert f"{cost['value']:.2f}\u00a0EUR" in (study / "report.html").read_text(encoding="utf-8")


def test_the_report_has_a_verdict_a_row_and_panels_per_zone(study):
    page = (study / "report.html").read_text(encoding="utf-8")
    found = json.loads((study / "metrics.json").read_text(encoding="utf-8"))
    assert "house &lt;b&gt;&amp;" in page
    assert "house <b>&" not in page
    boxes = re.findall(r'class="judged [^"]*"><b>(\w+): ', page)
    assert [name.lower() for name in boxes] == list(found["zones"])
    for zone in ZONES:
        assert f"<td>{zone}</td><td>{found['zones'][zone]['hybrid']:.2f}</td>" in page
        assert page.count(f">{zone} [degC]<") == page.count(f">{zone} [kW]<") + 2  # of days and weeks, in two widths
    assert "W/K</text>" in page
    assert "The floor plan of the configuration" in page
    assert not re.search(r'(?:src|href)="(?!data:|#)', page), "the page needs nothing else"
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_the_part_of_a_zone_has_the_names_of_a_single_one(place):
    settings = read_settings(place / "house.toml")
    data = split_log(read_log(place / "log.csv", settings)[0], settings)
    own = data_of(data, settings, "hall")
    assert list(own.train) == ["T_oa", "q_sol", "Q_hvac", "T_za"]
    pd.testing.assert_series_equal(own.later["T_za"], data.later["T_za_hall"], check_names=False)
    assert dict(settings_of_zone(settings, "hall").columns)["Q_hvac"] == "Q_hvac_hall"
    frame = pd.DataFrame({"T_za_hall": [1.0], "q_0.1_hall": [2.0], "T_za_kitchen": [3.0], "T_oa": [4.0]})
    assert forecast_of(frame, settings, "hall").to_dict("list") == {"T_za": [1.0], "q_0.1": [2.0]}


def test_a_zone_that_never_moves_is_refused_by_its_name(place, log, tmp_path, capsys):
    log.assign(T_za_hall=20.0).to_csv(tmp_path / "stuck.csv")
    assert run("run", tmp_path / "stuck.csv", "--config", place / "house.toml", "--out", tmp_path / "out") == 1
    assert "T_za_hall is the same in all rows" in capsys.readouterr().err


def test_a_sensor_that_stands_still_in_one_zone_is_a_remark(place, log):
    settings = read_settings(place / "house.toml")
    frame = read_log(place / "log.csv", settings)[0]
    frame.iloc[-120:-48, list(frame).index("T_za_hall")] = 20.0
    (remark,) = split_log(frame, settings).remarks
    assert remark.startswith("T_za_hall is 20 degC from ")


def test_identify_tells_the_rooms_and_what_they_exchange(place, log, capsys):
    common = ("identify", place / "log.csv", "--config", place / "house.toml")
    assert run(*common, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["zones"]) == list(ZONES)
    assert found["zones"]["kitchen"]["heat loss"]["unit"] == "W/K"
    X = log.drop(columns=[f"T_za_{zone}" for zone in ZONES])
    network = building_network(ZONES, [ZONES], room="1R1C", solar="q_sol")
    fits = identify_rooms(GrayBoxRC(network, n_starts=2, random_state=0), X, log[[f"T_za_{zone}" for zone in ZONES]])
    assert found["exchange"][0]["value"] == pytest.approx(1000.0 / fits.theta["R_kitchen_hall"], rel=1e-3)
    for zone in ZONES:
        outdoors = pytest.approx(1000.0 / fits.theta[f"R_zo_{zone}"], rel=1e-3)
        assert found["zones"][zone]["heat loss"]["value"] == outdoors, "what goes to the neighbour is no loss"
    assert run(*common) == 0
    assert "kitchen - hall [W/K]" in capsys.readouterr().out


# ------------------------------------------------------------------------------------------------- the map of the rooms
def test_rooms_are_placed_by_who_is_next_to_whom():
    couplings = {("a", "b"): 100.0, ("b", "c"): None, ("c", "d"): 25.0}
    display = RoomMapDisplay.from_predictions(couplings, {"a": 0.5, "b": 0.2, "c": None, "d": 0.1})
    texts = {text.get_text().split("\n")[0]: np.array(text.get_position()) for text in display.ax_.texts}
    steps = [np.linalg.norm(texts[a] - texts[b]) for a, b in ("ab", "bc", "cd")]
    np.testing.assert_allclose(steps, 1.0, rtol=0.02)
    assert np.linalg.norm(texts["a"] - texts["d"]) == pytest.approx(3.0, rel=0.02), "a row of rooms is a line"
    assert {"100 W/K", "25 W/K", "a", "d"} <= set(texts)
    styles = [line.get_linestyle() for line in display.ax_.lines]
    assert styles.count("--") == 1, "what is not known is dashed"
    widths = [line.get_linewidth() for line in display.ax_.lines]
    assert widths[0] > widths[2]
    with pytest.raises(ValueError, match="couplings name the zone 'e'"):
        RoomMapDisplay.from_predictions({("a", "e"): None}, {"a": 0.5})
    alone = RoomMapDisplay.from_predictions({}, {"a": 0.5})
    assert {text.get_text() for text in alone.ax_.texts} == {"a\n0.50 K"}
    unknown = RoomMapDisplay.from_predictions({("a", "b"): np.nan}, {"a": 0.5, "b": np.nan})
    assert {text.get_text() for text in unknown.ax_.texts} == {"a\n0.50 K", "b"}
    assert [line.get_linestyle() for line in unknown.ax_.lines] == ["--"]
    building = SimpleNamespace(zones_=["a", "b"], coupled_={})
    with pytest.raises(ValueError, match="errors name the zone 'B', but there are a, b"):
        RoomMapDisplay.from_estimator(building, errors={"a": 0.5, "B": 0.5})


# ----------------------------------------------------------------------------------------- a zone folder and its server
def _cheap(zone, log, weather=None, schedule=None):
    """A forecast that costs nothing: each zone stays as it is."""
    now = log.history.iloc[-1]
    index = pd.date_range(now.name, periods=25, freq="1h")[1:]
    found = {}
    for k, name in enumerate(zone.zones):
        T = now[f"T_za_{name}"] + 0.0 * np.arange(24)
        found |= {f"T_za_{name}": T, f"q_0.1_{name}": T - 1, f"q_0.9_{name}": T + 1, f"Q_hvac_{name}": 0.0 * T + k}
    return DayAhead(pd.DataFrame(found, index), {}, ())


@pytest.fixture(scope="module")
def folder(place, study, log) -> Path:
    """A folder whose model is that of the study, with two forecasts that have run out."""
    made = place / "folder"
    log[: 8 * 24].to_csv(place / "known.csv")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zone_folder, "forecast_day", _cheap)
        patch.setattr(ZoneModel, "fit", lambda settings, frame: ZoneModel(load_model(study / "model.skops"), settings))
        assert run("zone", "init", made, "--log", place / "known.csv", "--config", place / "house.toml") == 0
        for day in (10, 11, 12):
            log[: day * 24].to_csv(place / "known.csv")
            assert run("zone", "tick", made, "--log", place / "known.csv", "--setpoint", "21") == 0
    return made


def test_status_scores_each_zone_by_what_was_measured(folder, log, capsys):
    assert run("zone", "status", folder, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["zones"]) == set(ZONES)
    for k, zone in enumerate(ZONES):
        days = [log[f"T_za_{zone}"].iloc[day * 24 : (day + 1) * 24] for day in (10, 11)]
        origins = [log[f"T_za_{zone}"].iloc[day * 24 - 1] for day in (10, 11)]
        error = np.concatenate([origin - day for origin, day in zip(origins, days, strict=True)])
        heat = k - log[f"Q_hvac_{zone}"].iloc[240:288]
        weeks = found["zones"][zone]["last four weeks"]
        assert weeks["forecasts"] == 2
        assert weeks["temperature [K]"]["rmse"] == pytest.approx(np.sqrt((error**2).mean()), abs=2e-3)
        assert weeks["temperature [K]"]["coverage"] == pytest.approx((np.abs(error) <= 1).mean(), abs=2e-3)
        assert weeks["load [kW]"]["rmse"] == pytest.approx(np.sqrt((heat**2).mean()), abs=2e-3)
        assert [one["quantity"] for one in found["zones"][zone]["verdicts"]] == ["temperature", "load"]
    assert run("zone", "status", folder) == 0
    assert "  hall:\n    drift:" in capsys.readouterr().out


def test_a_zone_whose_thermometer_is_silent_is_named_by_the_status(folder, log, tmp_path, capsys, monkeypatch):
    quiet = {"statistic": 0.0, "threshold": 4.0, "drifted": False, "since": pd.NaT, "kind": ""}
    monkeypatch.setattr(zone_state, "drift_days", lambda model: pd.DataFrame(quiet, log.index[:1]))
    shutil.copytree(folder, tmp_path / "house")
    last = log.index[8 * 24 - 1]  # of twelve days
    with closing(sqlite3.connect(tmp_path / "house" / "archive.sqlite")) as database, database:
        database.execute("UPDATE measured SET T_za_hall = NULL WHERE time > ?", (last.isoformat(),))
    assert run("zone", "status", tmp_path / "house", "--json") == 0
    states = json.loads(capsys.readouterr().out)["zones"]
    assert states["kitchen"]["last measured"] is None
    assert states["kitchen"]["drift"]["drifted"] is False
    hall = states["hall"]
    assert hall["last measured"] == f"{last} (4 days ago)"
    assert hall["drift"] == {}
    first, second = hall["verdicts"][0]["reasons"][:2]
    assert first == "no past forecast can be scored yet"
    assert second == f"no temperature was measured since {last} (4 days ago)"
    assert run("zone", "status", tmp_path / "house") == 0
    told = capsys.readouterr().out
    assert told.count("last measured:") == 1
    assert f"  hall:\n    last measured: {last} (4 days ago)\n    drift: not known before" in told


@pytest.mark.slow
def test_the_server_takes_and_gives_columns_per_zone(folder, log, monkeypatch):
    pytest.importorskip("fastapi")
    from fastapi.testclient import TestClient

    from skhybrid.server.app import make_app

    monkeypatch.setattr(zone_folder, "forecast_day", _cheap)
    client = TestClient(make_app(folder), base_url="http://127.0.0.1:8765")
    page = client.get("/").text
    boxes = re.findall(r'class="judged [^"]*"><b>(\w+): ', page)
    assert [name.lower() for name in boxes] == list(client.get("/status").json()["zones"])
    assert all(page.count(f">{zone} [degC]<") == 6 for zone in ZONES), "three figures in two widths"
    rows = log[12 * 24 :].reset_index()
    rows["time"] = rows["time"].map(pd.Timestamp.isoformat)
    posted = client.post("/rows", json=rows.to_dict("records")).json()
    assert (posted["new_steps"], posted["forecast_from"]) == (24, str(log.index[-1].isoformat()))
    found = client.get("/forecast").json()
    assert found["zones"] == list(ZONES)
    assert found["units"]["T_za_low_hall"] == "degC"
    first = found["rows"][0]
    assert first["T_za_hall"] == pytest.approx(log["T_za_hall"].iloc[-1], abs=1e-3)
    assert first["T_za_low_kitchen"] == pytest.approx(first["T_za_kitchen"] - 1, abs=1e-3)
    with open_archive(folder / "archive.sqlite") as archive:
        kept = archive.measured(log.index[-24])
    np.testing.assert_allclose(kept["T_za_hall"], log["T_za_hall"].iloc[-24:])
    assert client.post("/rows", json=[{"time": "2024-01-21T00:00", "T_za_hall": 500.0}]).status_code == 422


def test_the_page_of_a_building_before_its_first_forecast(folder):
    pytest.importorskip("fastapi")
    from fastapi.testclient import TestClient

    from skhybrid.server.app import make_app

    (folder / "archive.sqlite").unlink()
    answer = TestClient(make_app(folder), base_url="http://127.0.0.1:8765").get("/")
    assert answer.status_code == 200
    assert "There is no forecast yet" in answer.text


def test_set_points_of_an_unknown_zone_are_refused(folder, place, capsys):
    assert run("zone", "tick", folder, "--log", place / "known.csv", "--setpoint", "attic:20") == 1
    assert "--setpoint names the zone 'attic'" in capsys.readouterr().err
    assert ZoneFolder(folder).zones == list(ZONES)
