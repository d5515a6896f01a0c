"""The command line with a log of several rooms: proposal, fit, forecast, update, back-test, and what is refused."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid.cli import main
from skhybrid.cli._output import Progress
from skhybrid.cli._study import read_study
from skhybrid.datasets import make_house
from skhybrid.exceptions import SkhybridWarning
from skhybrid.logs import LogReport
from skhybrid.persistence import load_model, save_model
from skhybrid.study import propose_settings, read_log, read_settings, split_log
from skhybrid.study.log_reading import metered_heat
from skhybrid.study.log_split import with_facades
from skhybrid.study.settings import settings_from
from skhybrid.study.thermostat import Schedule
from skhybrid.study.zone_loads import of_whole_plant
from skhybrid.study.zone_part import rows_of_zone, settings_of_zone
from skhybrid.zone import ZoneFolder, ZoneModel, day_ahead
from skhybrid.zone.day_ahead import _summary
from skhybrid.zone.rows_ahead import rows_ahead, schedules_of
from skhybrid.zone.training_rows import refuse_empty
from skhybrid.zone.zone_identification import describe_rooms
from skhybrid.zone.zone_state import measured_rows

sys.path.insert(0, str(Path(__file__).parent / "rooms"))
from three_rooms import make_rooms

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning"),
    pytest.mark.usefixtures("quick_fits"),
]
ZONES = ("kitchen", "hall")
N_KNOWN = 8 * 24
CONFIG = """
name = "house"
step = "1h"
adjacency = [["kitchen", "hall"]]
[columns]
T_oa = "T_out_degC"
q_sol = "ghi_kW_m2"
T_za_kitchen = "T_kitchen_degC"
Q_hvac_kitchen = "Q_kitchen_kW"
T_za_hall = "T_hall_degC"
Q_hvac_hall = "Q_hall_kW"
[network]
name = "1R1C"
[train]
end = 2024-01-15
[test]
start = 2024-01-16
end = 2024-01-17
"""


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    X = make_rooms()[0].drop(columns=["T_za_study", "Q_hvac_study"])
    X = X.rename(columns={"T_oa": "T_out_degC", "q_sol": "ghi_kW_m2"})
    X = X.rename(columns={f"T_za_{zone}": f"T_{zone}_degC" for zone in ZONES})
    X = X.rename(columns={f"Q_hvac_{zone}": f"Q_{zone}_kW" for zone in ZONES})
    return X[: N_KNOWN + 96].rename_axis("time")


@pytest.fixture(scope="module")
def folder(log, tmp_path_factory) -> Path:
    """A folder with the log, its configuration and a fitted model."""
    made = tmp_path_factory.mktemp("house")
    log.to_csv(made / "log.csv")
    log[:N_KNOWN].to_csv(made / "known.csv")
    (made / "house.toml").write_text(CONFIG, encoding="utf-8")
    assert run("fit", made / "known.csv", "--config", made / "house.toml", "--model", made / "house.skops") == 0
    return made


def run(*arguments: object) -> int:
    return main([*map(str, arguments), "-q"])


def refusal(capsys, *arguments: object) -> str:
    assert run(*arguments) != 0
    return capsys.readouterr().err


# ------------------------------------------------------------------------------------------------- names and proposals
def test_check_proposes_a_configuration_with_the_rooms(folder, tmp_path, capsys):
    assert run("check", folder / "log.csv", "--config", tmp_path / "made.toml") == 0
    assert re.search("T_za_hall +'T_hall_degC'", capsys.readouterr().out)
    text = (tmp_path / "made.toml").read_text(encoding="utf-8")
    made = settings_from(tomllib.loads(text))
    assert dict(made.columns) == tomllib.loads(CONFIG)["columns"]
    assert made.zones == list(ZONES)
    assert "T_za =" not in text


ROOMS = {
    "valves": (["Kitchen temp (°C)", "Hall temp (°C)", "Outdoor temp (°C)", "Kitchen valve (%)", "Hall valve (%)"], {
        "T_oa": "Outdoor temp (°C)", "T_za_kitchen": "Kitchen temp (°C)", "u_heat_kitchen": "Kitchen valve (%)",
        "T_za_hall": "Hall temp (°C)", "u_heat_hall": "Hall valve (%)"}),
    "roles": (["T_oa", "T_za_a1", "Q_a1", "T_heat_set_a1", "T_za_b1", "Q_hvac_b1", "q_sol_b1"], {
        "T_oa": "T_oa", "T_za_a1": "T_za_a1", "Q_hvac_a1": "Q_a1", "T_heat_set_a1": "T_heat_set_a1",
        "T_za_b1": "T_za_b1", "Q_hvac_b1": "Q_hvac_b1", "q_sol_b1": "q_sol_b1"}),
    "heat": (["t_out_C", "east_temp_C", "west_temp_C", "east_heat_kW", "west_heat_kW", "east_heat_stage"], {
        "T_oa": "t_out_C", "T_za_east": "east_temp_C", "Q_heat_east": "east_heat_kW", "T_za_west": "west_temp_C",
        "Q_heat_west": "west_heat_kW"}),
    "words": (["Living Room Temp", "Kitchen Temp", "Living Room Valve", "Kitchen Valve"], {
        "T_za_living": "Living Room Temp", "u_heat_living": "Living Room Valve", "T_za_kitchen": "Kitchen Temp",
        "u_heat_kitchen": "Kitchen Valve"}),
    "numbers": (["Room 1 temp (°C)", "Room 2 temp (°C)", "Valve room 1 (%)", "room_2 valve"], {
        "T_za_room1": "Room 1 temp (°C)", "u_heat_room1": "Valve room 1 (%)", "T_za_room2": "Room 2 temp (°C)",
        "u_heat_room2": "room_2 valve"}),
    "bedrooms": (["Living room temp", "Living room valve", "Bedroom 1 temp", "Bedroom 1 valve",
                  "Bedroom 1 set-point"], {
        "T_za_living": "Living room temp", "u_heat_living": "Living room valve", "T_za_bedroom1": "Bedroom 1 temp",
        "u_heat_bedroom1": "Bedroom 1 valve", "T_heat_set_bedroom1": "Bedroom 1 set-point"}),
    "words of one room": (["Kitchen temp", "Kitchen valve", "Kitchen floor temp", "Hall temp", "Hall valve",
                           "master_bedroom_temp", "Valve master bedroom"], {
        "T_za_kitchen": "Kitchen temp", "u_heat_kitchen": "Kitchen valve", "T_za_hall": "Hall temp",
        "u_heat_hall": "Hall valve", "T_za_master_bedroom": "master_bedroom_temp",
        "u_heat_master_bedroom": "Valve master bedroom"}),
    "radiators": (["Kitchen temp", "Kitchen radiator temp", "Hall temp", "Hall radiator temp", "Kitchen valve",
                   "Hall valve"], {
        "T_za_kitchen": "Kitchen temp", "u_heat_kitchen": "Kitchen valve", "T_za_hall": "Hall temp",
        "u_heat_hall": "Hall valve"}),
    "a room of another form": (["Kitchen temp", "Kitchen valve", "Hall temp", "Hall valve",
                                "Indoor temp of big red attic", "Big red attic valve", "Big red attic set-point"], {
        "T_za_kitchen": "Kitchen temp", "u_heat_kitchen": "Kitchen valve", "T_za_hall": "Hall temp",
        "u_heat_hall": "Hall valve"}),
    "one sun": (["Kitchen temp (°C)", "Hall temp (°C)", "Solar (W/m²)", "Kitchen valve (%)", "Hall valve (%)"], {
        "q_sol": "Solar (W/m²)", "T_za_kitchen": "Kitchen temp (°C)", "u_heat_kitchen": "Kitchen valve (%)",
        "T_za_hall": "Hall temp (°C)", "u_heat_hall": "Hall valve (%)"}),
    "places": (["Room air temp", "Room floor temp", "Heat stage"], {"T_za": "Room air temp", "u_heat": "Heat stage"}),
}  # fmt: skip


@pytest.mark.parametrize("case", list(ROOMS))
def test_rooms_are_found_in_names(case):
    names, expected = ROOMS[case]
    index = pd.date_range("2024-01-01", periods=48, freq="1h")
    report = LogReport(pd.DataFrame(np.random.default_rng(0).uniform(0.1, 0.9, (48, len(names))), index, names))
    assert report.roles == expected


def _of_rooms(columns: list[str], rooms: tuple[str, ...]) -> pd.DataFrame:
    """A log of rooms of the same columns, with their names before these if there are several; percents are whole."""
    index, rng = pd.date_range("2024-01-01", periods=96, freq="1h"), np.random.default_rng(0)
    frame = pd.DataFrame({"outdoor temp": rng.uniform(0.0, 9.0, 96)}, index)
    for room in rooms:
        own = {"room temp": rng.uniform(19.0, 22.0, 96)}
        own |= {name: rng.uniform(0.1, 0.9, 96) for name in columns}
        own |= {name: np.round(100.0 * own[name]) for name in columns if name == "heating power"}
        frame = frame.assign(**{f"{room} {name}".strip(): values for name, values in own.items()})
    return frame


COLUMNS = {
    "percent": ["heating power"],
    "set-points of modes": ["heating valve", "heating setpoint unocc", "effective heating setpoint"],
    "a sum and its part": ["hvac power kW", "heating power kW"],
    "heat and a cooling stage": ["heating power kW", "heating valve", "cooling valve"],
    "electricity and heat": ["heat pump power kW", "delivered heat kW"],
}


@pytest.mark.parametrize("case", list(COLUMNS))
def test_columns_of_rooms_have_the_roles_that_those_of_one_have(case):
    """Of two columns for a role the first was taken, not the better; a meter left out the stage of the other side."""
    one, two = (LogReport(_of_rooms(COLUMNS[case], rooms)) for rooms in (("",), ("kitchen", "hall")))
    expected = {role: name for role, name in one.roles.items() if role == "T_oa"}
    for room in ("kitchen", "hall"):
        expected |= {f"{role}_{room}": f"{room} {name}" for role, name in one.roles.items() if role != "T_oa"}
    assert two.roles == expected
    assert len(one.roles) > 2


def test_electricity_of_rooms_is_proposed_with_a_coefficient_of_performance():
    report = LogReport(_of_rooms(["heat pump power kW"], ZONES))
    (text,) = {finding.text for finding in report.findings if "electricity" in finding.text}
    assert "[plant] electricity = true, cop = 3.0" in text
    made = propose_settings("log.csv", report)
    assert tomllib.loads(made)["plant"] == {"electricity": True, "cop": 3.0}
    assert "most_heat" not in made


def test_an_unused_meter_of_a_room_is_its_own_and_shared_by_none():
    """With roles given, a second meter of one room counted as a plant that all rooms share, an attic as the room."""
    frame = _of_rooms(["heating power kW", "radiator power kW", "heating setpoint", "heating setpoint unocc"], ZONES)
    found = LogReport(frame)
    given = LogReport(frame.assign(**{"attic room temp": frame["hall room temp"]}), found.roles)
    assert given.roles == found.roles
    assert not [text for text in given.cannot if "share the plant" in text]
    asked = [finding.where for finding in found.findings if "could be heat or cold" in finding.text]
    assert asked == ["kitchen radiator power kW", "hall radiator power kW"]


def test_a_room_that_was_renamed_is_an_error_that_names_both():
    index = pd.date_range("2024-01-01", periods=48, freq="1h")
    rng = np.random.default_rng(0)
    names = ["T_oa", "T_za_hall", "Q_hvac_hall", "T_za_guest", "Q_hvac_guest", "T_za_spare", "Q_hvac_spare"]
    log = pd.DataFrame(rng.uniform(18.0, 22.0, (48, 7)), index, names)
    log.iloc[20:, 3:5], log.iloc[:20, 5:] = np.nan, np.nan
    (found,) = (one for one in LogReport(log).findings if one.level == "error")
    text = (
        "T_za_guest ends at 2024-01-01 19:00:00 and T_za_spare begins at 2024-01-01 20:00:00, so that no row has both"
    )
    assert found.text.startswith(text)
    with pytest.raises(ValueError, match=r"; Q_hvac_guest ends at .* and Q_hvac_spare begins at .*: is this one room"):
        split_log(log, settings_from({"columns": {role: role for role in names}, "step": "1h"}))


def test_one_plant_is_one_zone():
    """Sensors in several rooms of which none has a plant of its own are no building of zones."""
    names = ["kitchen_temp_C", "hall_temp_C", "outdoor_temp_C", "hvac_kW"]
    index = pd.date_range("2024-01-01", periods=48, freq="1h")
    report = LogReport(pd.DataFrame(np.random.default_rng(0).uniform(0.1, 0.9, (48, 4)), index, names))
    assert not report.zones
    assert "Q_hvac" in report.roles
    wanted = "name the column of the room temperature ('kitchen_temp_C' or 'hall_temp_C'?) as T_za, or log it."
    assert wanted in report.next_steps
    assert "to forecast several rooms, name each of them, such as T_za_kitchen and T_za_hall." in report.next_steps


def test_a_room_that_is_named_by_a_direction_has_the_sun_of_all_facades(log):
    """The irradiance on the south facade was the room's own, so that no other room had it."""
    names = {"T_out_degC": "T_oa", "ghi_kW_m2": "q_sol", "T_hall_degC": "T_za_south", "T_kitchen_degC": "T_za_north"}
    rows = log.rename(columns=names).tz_localize("UTC")[[*names.values()]]
    site = {"latitude": 52.4, "longitude": 4.9}
    settings = settings_from({"columns": {role: role for role in rows}, "step": "1h", "site": site})
    whole = with_facades(rows, settings)
    one = with_facades(rows.rename(columns={"T_za_south": "T_za"}), settings_of_zone(settings, "south"))
    for zone in ("south", "north"):
        own = rows_of_zone(whole, settings, zone)
        sun = [role for role in own if role.startswith("q_sol")]
        assert sun == ["q_sol", "q_sol_east", "q_sol_south_facade", "q_sol_west", "q_sol_north_facade"]
        np.testing.assert_array_equal(own[sun], one.filter(like="q_sol"))


@pytest.fixture(scope="module")
def staged() -> pd.DataFrame:
    """Two weeks of two rooms with the stages of their heaters."""
    return make_house(14, 2, sampling_time="1h", random_state=3).X


@pytest.mark.parametrize(
    "known", [{"Q_h": 2.0}, {"Q_h_living": 2.0, "Q_h_kitchen": 2.0}, {"Q_h": 9.0, "Q_h_living": 2.0}]
)
@pytest.mark.slow
def test_capacities_of_rooms_hold_for_identification_and_forecast(known, staged):
    """The identification took those of rooms alone, and the forecast that of all alone."""
    content = {"columns": {role: role for role in staged}, "step": "1h", "adjacency": [["living", "kitchen"]]}
    estimator = {"name": "conventional", "n_starts": 1, "known": known}
    settings = settings_from(content | {"estimator": estimator, "network": {"name": "1R1C"}})
    rooms = describe_rooms(settings, staged).rooms["value"]
    model = ZoneModel.fit(settings, staged)
    assert model.scaled
    for zone in settings.zones:
        capacity = known.get(f"Q_h_{zone}", known.get("Q_h"))
        assert rooms[zone, "capacity Q_h"] == capacity
        assert model.parts()[zone].settings.capacities == {"Q_h": capacity}
        assert model.predictor.own_[zone].known == {"Q_h": capacity}
    delivered = measured_rows(staged, settings, staged.index[-1])
    np.testing.assert_allclose(delivered["Q_hvac_living"], 2.0 * staged["u_heat_living"])
    one_unknown = settings_from(content | {"estimator": estimator | {"known": {"Q_h_living": 2.0}}})
    assert not ZoneModel(model.predictor, one_unknown).scaled


def test_a_proposal_asks_for_the_capacity_of_each_room(staged, tmp_path):
    staged.to_csv(tmp_path / "log.csv")
    assert "# known = { Q_h_living = 6.0, Q_h_kitchen = 6.0 }" in propose_settings(tmp_path / "log.csv")


def test_the_load_of_a_room_is_that_of_its_meter_and_its_stage():
    names = ["Q_hvac_hall", "Q_total_hall", "Q_hvac_unclipped_hall", "Q_total_unclipped_hall", "Q_hvac_attic"]
    load = pd.DataFrame([[1.0, 3.0, 2.0, 4.0, 5.0]], columns=names)
    found = of_whole_plant(load)
    assert found.to_dict("list") == {"Q_hvac_hall": [3.0], "Q_hvac_unclipped_hall": [4.0], "Q_hvac_attic": [5.0]}


# ------------------------------------------------------------------------------------------------------ the whole path
def test_a_planned_day_has_columns_per_zone(folder, log, tmp_path, capsys):
    ahead = log[: N_KNOWN + 24].copy()
    ahead.iloc[N_KNOWN:, [ahead.columns.get_loc(f"T_{zone}_degC") for zone in ZONES]] = np.nan
    ahead.to_csv(tmp_path / "planned.csv")
    common = ("--model", folder / "house.skops", "--log", tmp_path / "planned.csv")
    assert run("forecast", *common, "--out", tmp_path / "out.csv") == 0
    assert "lowest temperature of hall [degC]" in capsys.readouterr().out
    found = pd.read_csv(tmp_path / "out.csv", index_col=0, parse_dates=True)
    model = load_model(folder / "house.skops")
    by_role = ahead.rename(columns={column: role for role, column in tomllib.loads(CONFIG)["columns"].items()})
    expected = model.forecast(by_role[:N_KNOWN], by_role[N_KNOWN:].drop(columns=[f"T_za_{zone}" for zone in ZONES]))
    for zone in ZONES:
        np.testing.assert_allclose(found[f"T_za_{zone}"], expected[f"T_za_{zone}"], atol=1e-3)
        assert found[f"T_za_{zone}"].between(found[f"q_0.1_{zone}"], found[f"q_0.9_{zone}"]).mean() > 0.5
    assert not any(c.startswith("zeta") for c in found)


def test_set_points_may_be_given_per_zone(folder, log, tmp_path, capsys):
    log[N_KNOWN : N_KNOWN + 24][["T_out_degC", "ghi_kW_m2"]].to_csv(tmp_path / "weather.csv")
    common = ("--model", folder / "house.skops", "--log", folder / "known.csv", "--weather", tmp_path / "weather.csv")
    assert run("forecast", *common, "--setpoint", "21", "--setpoint", "hall:12", "--json") == 0
    rows = pd.DataFrame(json.loads(capsys.readouterr().out)["forecast"])
    assert set(rows["T_heat_set_hall"]) == {12.0}
    assert set(rows["T_heat_set_kitchen"]) == {21.0}
    assert rows["Q_hvac_hall"].max() < 0.05, "the hall is warmer than 12 degC without heat"
    assert rows["Q_hvac_kitchen"].mean() > 0.5
    found = refusal(capsys, "forecast", *common, "--setpoint", "hall:20")
    assert "no set-point is given for 'kitchen'; give one for all, or --setpoint kitchen:21,24." in found
    assert "--setpoint names the zone 'attic'" in refusal(capsys, "forecast", *common, "--setpoint", "attic:20")


def test_the_table_of_several_zones_is_one_of_each_with_its_set_points(folder, log, tmp_path, capsys):
    """All zones side by side took 137 columns of a terminal for two of them, without any set-point."""
    log[N_KNOWN : N_KNOWN + 24][["T_out_degC", "ghi_kW_m2"]].to_csv(tmp_path / "weather.csv")
    common = ("--model", folder / "house.skops", "--log", folder / "known.csv", "--weather", tmp_path / "weather.csv")
    assert run("forecast", *common, "--setpoint", "21", "--setpoint", "hall:12") == 0
    lines = capsys.readouterr().out.splitlines()
    for zone, setpoint in (("kitchen", "21.0"), ("hall", "12.0")):
        head, units, *rows = lines[lines.index(zone) + 1 :][:10]
        assert {"room", "heat", "outdoors", "sun"} <= set(head.split())
        assert "heat to" in head
        assert all(row.split()[-3] == setpoint for row in rows)
        assert max(map(len, (head, units, *rows))) <= 100


@pytest.fixture(scope="module")
def held(log) -> tuple[ZoneModel, pd.DataFrame]:
    """A model and its log, in which the kitchen has set-points of its own, and the hall those of the building."""
    rows = log.rename(columns={column: role for role, column in tomllib.loads(CONFIG)["columns"].items()})
    rows = rows.assign(T_heat_set=np.where(rows.index.hour < 6, 17.0, 21.0), T_cool_set=26.0)
    rows = rows.assign(T_heat_set_kitchen=rows["T_heat_set"] - 1.0, T_cool_set_kitchen=25.0)
    settings = tomllib.loads(CONFIG)
    settings["columns"] |= {role: role for role in rows if "_set" in role}
    made = ZoneModel.fit(settings_from(settings), rows[:N_KNOWN])
    assert made.thermostat_learned
    return made, rows


def test_zones_with_set_points_of_their_own_are_forecast(held, tmp_path):
    """As by the predictor itself, whose rows ahead have the columns of the training."""
    (model, rows), weather = held, tmp_path / "weather.csv"
    rows[N_KNOWN - 1 : N_KNOWN + 25][["T_oa", "q_sol"]].rename_axis("time").to_csv(weather)
    found = day_ahead(model, rows[:N_KNOWN], weather, ("21,24", "hall:18,26")).frame
    wanted = {"T_heat_set": 18.0, "T_cool_set": 26.0, "T_heat_set_kitchen": 21.0, "T_cool_set_kitchen": 24.0}
    ahead = rows[N_KNOWN : N_KNOWN + 24][["T_oa", "q_sol"]].assign(**wanted)
    core = model.predictor.forecast(model.readable(rows[:N_KNOWN]).history, ahead, quantiles=(0.1, 0.9))
    for name in ("T_za_hall", "Q_hvac_hall", "Q_hvac_0.9_hall", "T_za_kitchen", "Q_hvac_kitchen"):
        np.testing.assert_allclose(found[name], core[name], atol=1e-6)
    of_log = rows.copy()
    of_log.loc[of_log.index[N_KNOWN:], [c for c in rows if c.startswith(("T_za", "Q_"))]] = np.nan
    planned = day_ahead(model, of_log[: N_KNOWN + 24]).frame
    assert {"Q_hvac_0.1_hall", "Q_hvac_0.1_kitchen"} <= set(planned)
    for zone, name in (("kitchen", "T_cool_set_kitchen"), ("hall", "T_cool_set")):
        text = f"{name} is not given for the rows ahead, .* such as --setpoint {zone}:21,24"
        with pytest.raises(ValueError, match=text):
            day_ahead(model, rows[:N_KNOWN], weather, ("21,24", f"{zone}:20"))


def test_a_zone_without_a_plant_needs_no_set_point_and_leaves_others_their_thermostat(held, tmp_path):
    rows, weather = held[1].drop(columns=["Q_hvac_hall"]), tmp_path / "weather.csv"
    rows[N_KNOWN - 1 : N_KNOWN + 25][["T_oa", "q_sol"]].rename_axis("time").to_csv(weather)
    settings = tomllib.loads(CONFIG)
    settings["columns"] = {role: role for role in rows}
    model = ZoneModel.fit(settings_from(settings), rows[:N_KNOWN])
    assert model.facts()["thermostat"] == "learned"
    found = day_ahead(model, rows[:N_KNOWN], weather, ("kitchen:21,24",))
    assert {"Q_hvac_0.1_kitchen", "q_0.1_kitchen", "q_0.1_hall"} <= set(found.frame)
    assert not {"Q_hvac_hall", "T_heat_set_hall"} & set(found.frame)
    assert not any("ideal" in text for text in found.remarks)
    for given in ("21,24", "hall:22,24"), ("hall:22,24",):
        with pytest.raises(ValueError, match=r"--setpoint names 'hall', which .*; name one of 'kitchen'\."):
            day_ahead(model, rows[:N_KNOWN], weather, given)


def test_a_heated_zone_without_set_points_runs_as_usual_or_as_planned(held, tmp_path):
    """In rows ahead with the set-points of others: the hall was taken as not heated at all."""
    names = {"T_heat_set": "T_heat_set_kitchen", "T_cool_set": "T_cool_set_kitchen"}
    rows = held[1].drop(columns=list(names.values())).rename(columns=names)
    settings = tomllib.loads(CONFIG)
    settings["columns"] = {role: role for role in rows}
    model = ZoneModel.fit(settings_from(settings), rows[:N_KNOWN])
    assert model.facts()["thermostat"] == "learned in part (no set-points of hall in the log)"
    of_log = rows[: N_KNOWN + 24].copy()
    of_log.loc[of_log.index[N_KNOWN:], [c for c in rows if c.startswith(("T_za", "Q_"))]] = np.nan
    with pytest.warns(SkhybridWarning, match="zone 'hall': no thermostat was learned, as the training had no set-poin"):
        found = day_ahead(model, of_log)
    assert {"Q_hvac_0.1_hall", "Q_hvac_0.1_kitchen"} <= set(found.frame)
    usual = rows["Q_hvac_hall"][:N_KNOWN].mean()
    assert found.frame["Q_hvac_hall"].mean() == pytest.approx(usual, rel=0.5)
    planned = day_ahead(model, of_log.assign(Q_hvac_hall=rows["Q_hvac_hall"])).frame
    assert "Q_hvac_hall" not in planned
    assert "Q_hvac_0.1_kitchen" in planned
    weather = tmp_path / "weather.csv"
    rows[N_KNOWN - 1 : N_KNOWN + 25][["T_oa", "q_sol"]].rename_axis("time").to_csv(weather)
    by_option = day_ahead(model, rows[:N_KNOWN], weather, ("kitchen:21,24",)).frame
    np.testing.assert_allclose(by_option["Q_hvac_hall"], found.frame["Q_hvac_hall"], atol=0.5)
    for_all = day_ahead(model, rows[:N_KNOWN], weather, ("21,24",))
    assert any("the thermostat of hall is an ideal one" in text for text in for_all.remarks)
    assert {"q_0.1_hall", "q_0.1_kitchen", "Q_hvac_0.1_kitchen"} <= set(for_all.frame)
    assert "Q_hvac_0.1_hall" not in for_all.frame
    T, low, high = (for_all.frame[f"{name}_hall"] for name in ("T_za", "q_0.1", "q_0.9"))
    assert ((low < T) & (high > T)).all()  # the interval is about what the thermostat holds
    held_at = T.clip(21.0, 24.0)
    np.testing.assert_allclose(T[-12:], held_at[-12:], atol=0.05)


def test_a_day_of_a_building_sums_heating_and_cooling_of_each_zone():
    day = pd.date_range("2024-07-01", periods=4, freq="2h")
    given = pd.DataFrame({"T_za_kitchen": 20.0, "T_za_hall": 21.0, "Q_hvac_kitchen": [1.0, 0.0, -2.0, -1.0]}, day)
    found = _summary(given.assign(Q_hvac_hall=[0.5, 0.0, -1.0, 0.0]), settings_from(tomllib.loads(CONFIG)), scaled=True)
    assert (found["heating of kitchen [kWh]"], found["cooling of kitchen [kWh]"]) == (2.0, 6.0)
    assert (found["heating of hall [kWh]"], found["cooling of hall [kWh]"]) == (1.0, 2.0)
    assert found["largest load [kW]"] == 3.0


def test_why_a_thermostat_is_ideal_names_the_zone():
    roles = ("T_oa", "T_za_a", "Q_hvac_a", "T_heat_set_a", "T_za_b", "Q_hvac_b", "T_za_c", "Q_hvac_c")
    learned, not_learned = (
        SimpleNamespace(thermostat_learned_=known, training_=SimpleNamespace(ranges={"Q_hvac": (0.0, 1.0)}))
        for known in (True, False)
    )
    settings = settings_from({"columns": {role: role for role in roles}})
    model = ZoneModel(SimpleNamespace(own_={"a": learned, "b": not_learned, "c": not_learned}), settings)
    assert not model.thermostat_learned
    assert model.why_ideal == "no set-points of b, c in the log"
    model = ZoneModel(SimpleNamespace(own_={"a": not_learned, "b": not_learned}), settings)
    assert model.why_ideal == (
        "the log is too short, or the plant or set-points of a never moved; no set-points of b in the log"
    )


def test_every_zone_without_a_set_point_is_named():
    index = pd.date_range("2024-01-05", periods=4, freq="1h")
    plan = pd.DataFrame({"T_oa": 5.0}, index)
    roles = ["T_oa", *(f"{role}_{zone}" for zone in "abc" for role in ("T_za", "Q_hvac"))]
    settings = settings_from({"columns": {role: role for role in roles}, "step": "1h"})
    with pytest.raises(ValueError, match=r"set-point is given for 'b', 'c'; .*--setpoint b:21,24 --setpoint c:21,24\."):
        rows_ahead(
            settings,
            index[0],
            ["T_oa", "Q_hvac_a", "Q_hvac_b", "Q_hvac_c"],
            plan=plan,
            schedule={"a": Schedule.of_text("21,24")},
        )


def test_a_shared_plant_asks_for_its_stage_and_not_for_set_points():
    index = pd.date_range("2024-01-05", periods=4, freq="1h")
    plan, roles = pd.DataFrame({"T_oa": 5.0}, index), ["T_oa", "T_za_a", "T_za_b", "u_heat"]
    settings = settings_from({"columns": {role: role for role in roles}, "step": "1h"})
    for schedule in (None, Schedule.of_text("21")):
        with pytest.raises(ValueError, match=r"zones share the plant 'u_heat', .* in rows of the log after"):
            rows_ahead(settings, index[0], ["T_oa", "u_heat"], plan=plan, schedule=schedule)
    planned = rows_ahead(settings, index[0], ["T_oa", "u_heat"], plan=plan.assign(u_heat=0.5))
    assert planned.planned


def test_a_plant_is_called_by_its_columns():
    index = pd.date_range("2024-01-05", periods=4, freq="1h")
    plan = pd.DataFrame({"T_oa": 5.0}, index)
    columns = {"T_za": "room", "T_oa": "out", "Q_heat": "boiler", "Q_cool": "chiller"}
    settings = settings_from({"columns": columns, "step": "1h"})
    with pytest.raises(ValueError, match="fill in 'boiler', 'chiller' in the rows ahead"):
        rows_ahead(settings, index[0], ["T_oa", "Q_hvac"], plan=plan)


def test_update_takes_in_new_rows(folder, log, tmp_path, capsys):
    model = tmp_path / "house.skops"
    model.write_bytes((folder / "house.skops").read_bytes())
    log[: N_KNOWN + 30].to_csv(tmp_path / "later.csv")
    common = ("update", "--model", model, "--log", tmp_path / "later.csv")
    assert run(*common, "--json") == 0
    until = {"known until": str(log.index[N_KNOWN + 29]), "learned until": str(log.index[N_KNOWN - 1])}
    assert json.loads(capsys.readouterr().out) == {"new rows": 30, **until}
    assert run(*common, "--json") == 0
    assert json.loads(capsys.readouterr().out)["new rows"] == 0


def test_a_building_learns_from_new_rows(folder, log, tmp_path, capsys):
    model = tmp_path / "house.skops"
    model.write_bytes((folder / "house.skops").read_bytes())
    before = ZoneModel.load(model).learned_until
    log[: N_KNOWN + 96].to_csv(tmp_path / "later.csv")
    assert run("update", "--model", model, "--log", tmp_path / "later.csv", "--relearn", "--json") == 0
    after = ZoneModel.load(model)
    assert after.learned_until > before
    printed = json.loads(capsys.readouterr().out)
    assert (printed["known until"], printed["learned until"]) == (str(after.known_until), str(after.learned_until))


def test_a_model_file_keeps_everything(folder, log, tmp_path):
    model = load_model(folder / "house.skops")
    save_model(model, tmp_path / "again.skops")
    again = load_model(tmp_path / "again.skops")
    by_role = log.rename(columns={column: role for role, column in tomllib.loads(CONFIG)["columns"].items()})
    tomorrow = by_role[N_KNOWN : N_KNOWN + 24].drop(columns=[f"T_za_{zone}" for zone in ZONES])
    levels = [0.1, 0.9]
    pd.testing.assert_frame_equal(*[one.forecast(None, tomorrow, quantiles=levels) for one in (model, again)])
    drawn = [one.sample(None, tomorrow, 5, random_state=0) for one in (model, again)]
    np.testing.assert_array_equal(*drawn)
    pd.testing.assert_frame_equal(again.shares_, model.shares_)
    assert again.coupled_["hall"].neighbours == ("kitchen",)
    updated = [one.update(by_role[N_KNOWN : N_KNOWN + 3]).forecast(None, tomorrow[3:]) for one in (model, again)]
    pd.testing.assert_frame_equal(*updated)


def test_backtest_judges_every_zone(folder, tmp_path, capsys):
    common = ("backtest", folder / "log.csv", "--config", folder / "house.toml")
    assert run(*common, "--out", tmp_path / "backtest.csv", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    quantities = [f"{what} of {zone}" for zone in ZONES for what in ("temperature", "load")]
    assert [one["quantity"] for one in found["verdicts"]] == quantities
    assert found["table"]["hybrid"]["load_rmse"] > 0
    frame = pd.read_csv(tmp_path / "backtest.csv")
    error = frame["y_pred"] - frame["y_true"]
    assert found["table"]["hybrid"]["rmse"] == pytest.approx(np.sqrt((error**2).mean()), abs=1e-4)
    of_hall = np.sqrt((error[frame["zone"] == "hall"] ** 2).mean())
    assert found["table"]["hybrid"]["rmse_hall"] == pytest.approx(of_hall, abs=1e-4)
    log = pd.read_csv(folder / "log.csv", index_col=0, parse_dates=True)["T_hall_degC"]
    hall = frame[frame["zone"] == "hall"]
    np.testing.assert_allclose(hall["y_true"], log.reindex(pd.DatetimeIndex(hall["time"])), rtol=1e-5)
    assert found["table"]["hybrid"]["rmse"] < found["table"]["yesterday"]["rmse"]


# --------------------------------------------------------------------------------------------------------- refused
@pytest.mark.parametrize(
    "command",
    [
        ("search", "log.csv", "--store", "made"),
        ("export", "emhass", "log.csv"),
    ],
)
def test_commands_of_one_zone_refuse_several(command, folder, tmp_path, capsys):
    given = [folder / a if a == "log.csv" else tmp_path / a if a == "made" else a for a in command]
    message = refusal(capsys, *given, "--config", folder / "house.toml")
    assert "describes several zones (kitchen, hall)" in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("[columns]", "[plant]\nmost_heat = 8.0\n[columns]"),
            r"\[plant\] most_heat is of one zone.*; remove it, and give the limits of zones in Python",
        ),
        (("[network]", 'Q_cool_hall = "cold"\n[network]'), "has Q_hvac_hall and Q_cool_hall, and a model reads"),
        (("[network]", 'Q_hvac = "heat"\nQ_cool = "cold"\n[network]'), "both sides as Q_heat and Q_cool"),
        (('"hall"]]', '"attic"]]'), "names 'attic'"),
        (('[["kitchen", "hall"]]', '["hall"]'), "list of pairs"),
        (("T_za_kitchen", "T_za"), "adjacency is of several zones"),
        (('adjacency = [["kitchen"', 'adjacent = [["kitchen"'), "did you mean 'adjacency'"),
    ],
)
def test_a_configuration_that_cannot_be_right_is_refused(change, message, tmp_path):
    assert change[0] in CONFIG
    (tmp_path / "house.toml").write_text(CONFIG.replace(*change), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read_settings(tmp_path / "house.toml")


def test_set_points_are_given_once_for_each_zone():
    """``--setpoint 21 --setpoint 24``, heating and cooling for some, heated to 24 in silence."""
    assert schedules_of(()) is None
    assert schedules_of((), ["hall"]) is None
    with pytest.raises(ValueError, match="names the zone 'hall', but the model is of one zone: leave the name out"):
        schedules_of(("20", "hall:21,24"))
    with pytest.raises(ValueError, match="--setpoint is given twice; give heating and cooling in one, such as 21,24"):
        schedules_of(("21", "24"))
    with pytest.raises(ValueError, match="--setpoint is given twice for 'hall'; give"):
        schedules_of(("hall:21", "20", "hall:24"), ["hall", "study"])
    assert schedules_of(("6:00=21,22:00=17;24",)).heat == {360: 21.0, 1320: 17.0}
    both = schedules_of(("hall:6:00=21,22:00=17", "20,26"), ["hall", "study"])
    assert both["hall"].heat == {360: 21.0, 1320: 17.0}
    assert both[""].cool == {0: 26.0}
    by_zone = {"hall": "6:00=21,22:00=17", "": "20,26"}
    assert schedules_of(by_zone, ["hall", "study"]) == both == schedules_of(both, ["hall"])
    assert schedules_of("20,26") == both[""] == schedules_of({"": both[""]})


@pytest.mark.parametrize(
    ("given", "message"),
    [(21.0, r"21\.0 are not text; give them as on the command line, such as '21,24'"), ((21.0, 24.0), "not text"),
     ({"hall": 21.0}, "not text"), ({"attic": "21"}, "names the zone 'attic', but the model has 'hall'"),
     ("attic:21", "names the zone 'attic'"), ({"hall": ""}, "is empty")],
)  # fmt: skip
def test_set_points_that_are_no_text_or_of_no_zone_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        schedules_of(given, ["hall"])


# ------------------------------------------------------------------------------------------------------- a dead meter
def _ahead(log, now, silent_from=None):
    """A log up to a row, and the weather of the day after it; from a row on without the heat of the hall."""
    rows = log[: now + 24].copy()
    rows.loc[rows.index[now:], rows.columns.difference(["T_out_degC", "ghi_kW_m2"])] = np.nan
    if silent_from is not None:
        rows.loc[rows.index[silent_from:], "Q_hall_kW"] = np.nan
    return rows


@pytest.mark.slow
def test_a_dead_heat_meter_costs_its_room_alone(log, tmp_path):
    (tmp_path / "house.toml").write_text(CONFIG, encoding="utf-8")
    log[:N_KNOWN].to_csv(tmp_path / "log.csv")
    house = ZoneFolder.init(tmp_path / "house", tmp_path / "log.csv", tmp_path / "house.toml")
    schedule = {"": "21", "hall": "18"}
    _ahead(log, N_KNOWN + 24, silent_from=N_KNOWN + 16).to_csv(tmp_path / "log.csv")
    done = house.tick(tmp_path / "log.csv", schedule=schedule)
    assert (done.learned, done.n_new) == ("", 16)  # up to twelve hours are waited for
    now = N_KNOWN + 48
    _ahead(log, now, silent_from=N_KNOWN + 16).to_csv(tmp_path / "log.csv")
    done = house.tick(tmp_path / "log.csv", schedule=schedule)
    assert done.learned == "the heat of 'hall' is logged no more"
    assert "hall was learned without its heat, since 'Q_hall_kW' had no values: its load is not known" in done.remarks
    found = done.forecast.frame
    assert found.index[0] == log.index[now]
    assert {"T_za_kitchen", "T_za_hall", "Q_hvac_kitchen"} <= set(found)
    assert "Q_hvac_hall" not in found
    assert house.load().not_learned == {"hall": ["Q_hvac_hall"]}
    without = settings_from(tomllib.loads(CONFIG.replace('Q_hvac_hall = "Q_hall_kW"', "")))
    names = {column: role for role, column in without.columns.items()}
    rows = _ahead(log, now).rename(columns=names)[list(names.values())]
    expected = day_ahead(ZoneModel.fit(without, rows), rows, schedule="21").frame
    pd.testing.assert_frame_equal(found[list(expected)], expected, check_freq=False, rtol=1e-6)
    _ahead(log, now + 24, silent_from=N_KNOWN + 16).to_csv(tmp_path / "log.csv")
    done = house.tick(tmp_path / "log.csv", schedule=schedule)
    assert (done.learned, done.n_new) == ("", 24)
    _ahead(log, now + 24).to_csv(tmp_path / "log.csv")  # the meter is back
    assert house.tick(tmp_path / "log.csv", schedule=schedule).learned == ""


def test_a_room_with_meters_of_heat_and_of_cold_has_their_difference(folder, log, tmp_path):
    """Cold that is logged as positive cools; the model, its remarks and its messages know it as one heat."""
    heat = log["Q_hall_kW"] - 0.5 * log["Q_hall_kW"].max()
    meters = log.assign(heat_kW=heat.clip(lower=0.0), cold_kW=-heat.clip(upper=0.0))
    assert (meters["cold_kW"] > 0.0).any()
    meters[:N_KNOWN].to_csv(tmp_path / "log.csv")
    config = CONFIG.replace('Q_hvac_hall = "Q_hall_kW"', 'Q_heat_hall = "heat_kW"\nQ_cool_hall = "cold_kW"')
    settings = settings_from(tomllib.loads(config))
    frame, _ = read_log(tmp_path / "log.csv", settings)
    np.testing.assert_allclose(frame["Q_hvac_hall"], heat[:N_KNOWN], atol=1e-9)
    model = ZoneModel.fit(settings, frame)
    assert {"Q_hvac_kitchen", "Q_hvac_hall"} <= set(model.covered())
    assert model.not_learned == {}
    with pytest.raises(ValueError, match="'heat_kW', 'cold_kW' \\(Q_hvac_hall\\) has no values in the log"):
        refuse_empty(frame.assign(Q_hvac_hall=np.nan), settings)


@pytest.mark.parametrize("heat", ["Q_hvac_hall", "Q_hall", "Q_heat_hall"])
def test_electricity_of_rooms_becomes_heat_and_costs(heat, log, tmp_path):
    """As of one zone; the cost is that of all rooms."""
    meters = [f"Q_{zone}_kW" for zone in ZONES]
    log = log.assign(**{meter: log[meter].clip(lower=0.0) / 3.0 for meter in meters})
    log[:N_KNOWN].to_csv(tmp_path / "log.csv")
    log[N_KNOWN : N_KNOWN + 24][["T_out_degC", "ghi_kW_m2"]].to_csv(tmp_path / "weather.csv")
    config = CONFIG.replace("Q_hvac_hall", heat) + "[plant]\nelectricity = true\ncop = 3.0\n[tariff]\nprice = 0.3\n"
    settings = settings_from(tomllib.loads(config))
    frame, _ = read_log(tmp_path / "log.csv", settings)
    np.testing.assert_allclose(frame[["Q_hvac_kitchen", "Q_hvac_hall"]], 3.0 * log[meters][:N_KNOWN], atol=1e-9)
    model = ZoneModel.fit(settings, frame)
    found = day_ahead(model, tmp_path / "log.csv", tmp_path / "weather.csv", "22")
    total = 0.0
    for zone in ZONES:
        np.testing.assert_allclose(found.frame[f"electricity_kW_{zone}"], found.frame[f"Q_hvac_{zone}"].abs() / 3.0)
        total += found.frame[f"electricity_kW_{zone}"].sum()
    assert total > 1.0
    assert found.summary["electricity [kWh]"] == pytest.approx(total, abs=0.01)
    assert found.summary["cost of electricity"] == pytest.approx(0.3 * total, abs=0.01)


def test_the_heat_of_a_room_whose_name_begins_as_a_role_is_no_cold(log):
    config = CONFIG.replace("Q_hvac_hall", "Q_cool_hall").replace("T_za_hall", "T_za_cool_hall")
    settings = settings_from(tomllib.loads(config.replace('"hall"]]', '"cool_hall"]]')))
    heat = log["Q_hall_kW"].clip(lower=0.0)
    found = metered_heat(pd.DataFrame({"Q_cool_hall": heat}), settings)
    np.testing.assert_array_equal(found["Q_hvac_cool_hall"], heat)


def test_the_heat_of_a_room_may_be_named_by_the_room_alone(log):
    settings = settings_from(tomllib.loads(CONFIG.replace("Q_hvac_hall", "Q_hall")))
    frame = log[:N_KNOWN].rename(columns={column: role for role, column in settings.columns.items()})
    model = ZoneModel.fit(settings, frame)
    assert {"Q_hvac_kitchen", "Q_hvac_hall"} <= set(model.covered())
    assert model.not_learned == {}


@pytest.mark.slow
def test_a_room_without_values_of_its_heat_is_studied_without_it(folder, log, tmp_path, capsys):
    log.assign(Q_hall_kW=np.nan).to_csv(tmp_path / "log.csv")
    given = (tmp_path / "log.csv", "--config", folder / "house.toml")
    data = read_study(str(given[0]), read_settings(given[-1]), Progress(quiet=True))
    remark = "zone 'hall' is learned without its heat, since 'Q_hall_kW' had no values at the end: "
    assert data.remarks[0].startswith(remark)
    assert {"Q_hvac_kitchen", "T_za_hall"} <= set(data.train) & set(data.future)
    assert "Q_hvac_hall" not in {*data.train, *data.future}
    assert main([*map(str, ("backtest", *given)), "--json"]) == 0
    found = capsys.readouterr()
    assert remark in found.err
    quantities = [one["quantity"] for one in json.loads(found.out)["verdicts"]]
    assert quantities == ["temperature of kitchen", "load of kitchen", "temperature of hall"]
    assert main([*map(str, ("identify", *given)), "--json"]) == 0
    found = capsys.readouterr()
    assert remark in found.err
    assert "not identified" in json.loads(found.out)["zones"]["hall"]["heat loss"]["remark"]


def test_where_all_heat_is_missing_a_building_is_refused(log):
    rows = log.rename(columns={column: role for role, column in tomllib.loads(CONFIG)["columns"].items()})
    rows = rows.assign(Q_hvac_kitchen=np.nan, Q_hvac_hall=np.nan)
    with pytest.raises(ValueError, match=r"'Q_kitchen_kW' \(Q_hvac_kitchen\) has no values in the log"):
        ZoneModel.fit(settings_from(tomllib.loads(CONFIG)), rows)
