"""Readers of Home Assistant's recorder, statistics and history, and of InfluxDB's annotated CSV."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skhybrid.logs import read_log
from skhybrid.logs.counters import power_of_counter
from skhybrid.logs.readers import entity_states, home_assistant, influx

SAMPLES = Path(__file__).parent / "log_samples"
HISTORY, INFLUX = SAMPLES / "home_assistant_history.csv", SAMPLES / "influx_annotated.csv"
START = pd.Timestamp("2024-01-10 06:00", tz="UTC")
T0 = START.timestamp()
NEW = """
CREATE TABLE states_meta (metadata_id INTEGER NOT NULL, entity_id VARCHAR(255), PRIMARY KEY (metadata_id));
CREATE TABLE state_attributes (attributes_id INTEGER NOT NULL, hash BIGINT, shared_attrs TEXT,
  PRIMARY KEY (attributes_id));
CREATE TABLE states (state_id INTEGER NOT NULL, entity_id CHAR(0), state VARCHAR(255), attributes CHAR(0),
  event_id SMALLINT, last_changed CHAR(0), last_changed_ts FLOAT, last_reported_ts FLOAT, last_updated CHAR(0),
  last_updated_ts FLOAT, old_state_id INTEGER, attributes_id INTEGER, origin_idx SMALLINT, metadata_id INTEGER,
  PRIMARY KEY (state_id));
CREATE INDEX ix_states_metadata_id_last_updated_ts ON states (metadata_id, last_updated_ts);
CREATE TABLE recorder_runs (run_id INTEGER NOT NULL, start DATETIME NOT NULL, "end" DATETIME,
  closed_incorrect BOOLEAN NOT NULL, created DATETIME NOT NULL, PRIMARY KEY (run_id));
CREATE TABLE statistics_meta (id INTEGER NOT NULL, statistic_id VARCHAR(255), source VARCHAR(32),
  unit_of_measurement VARCHAR(255), has_mean BOOLEAN, has_sum BOOLEAN, name VARCHAR(255), PRIMARY KEY (id));
CREATE TABLE statistics (id INTEGER NOT NULL, created CHAR(0), created_ts FLOAT, metadata_id INTEGER, start CHAR(0),
  start_ts FLOAT, mean FLOAT, min FLOAT, max FLOAT, last_reset CHAR(0), last_reset_ts FLOAT, state FLOAT, sum FLOAT,
  PRIMARY KEY (id));
CREATE TABLE statistics_short_term (id INTEGER NOT NULL, metadata_id INTEGER, start_ts FLOAT, mean FLOAT, min FLOAT,
  max FLOAT, state FLOAT, sum FLOAT, PRIMARY KEY (id));
"""
OLD = """
CREATE TABLE states (state_id INTEGER NOT NULL, domain VARCHAR(64), entity_id VARCHAR(255), state VARCHAR(255),
  attributes TEXT, event_id INTEGER, last_changed DATETIME, last_updated DATETIME, created DATETIME,
  PRIMARY KEY (state_id));
"""
SENSOR = {"unit_of_measurement": "°C", "device_class": "temperature"}
CLIMATE = {"hvac_modes": ["off", "heat"], "min_temp": 7, "max_temp": 30, "friendly_name": "Living room"}


def _climate(action: str, now: float, target: float) -> dict[str, object]:
    return CLIMATE | {"hvac_action": action, "current_temperature": now, "temperature": target}


#: entity, minutes after the start, state, attributes
STATES = [
    *(("sensor.outdoor", 7 * i, str(round(2.0 + 0.1 * i, 1)), SENSOR) for i in range(8)),
    ("sensor.outdoor", 57, "unavailable", SENSOR),
    ("climate.living", 0, "heat", _climate("idle", 20.0, 20.5)),
    ("climate.living", 10.5, "heat", _climate("heating", 19.9, 20.5)),
    ("climate.living", 30, "heat", _climate("heating", 20.6, 20.5)),
    ("climate.living", 33, "heat", _climate("idle", 20.7, 20.5)),
    ("climate.living", 50, "unavailable", CLIMATE),
    ("switch.pump", 2, "on", {}),
    ("switch.pump", 40, "off", {}),
    ("sensor.mood", 3, "sunny", {}),
    ("automation.night", 4, "on", {}),
    ("sensor.heat_meter", 60, "12.5", {"unit_of_measurement": "kWh"}),
]


def _database(folder: Path, states: list[tuple] = STATES, name: str = "home-assistant_v2.db") -> Path:
    """A recorder's database of the schema since 2023."""
    path = folder / name
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(NEW)
        names = {entity: i + 1 for i, entity in enumerate(dict.fromkeys(row[0] for row in states))}
        database.executemany("INSERT INTO states_meta VALUES (?, ?)", [(i, entity) for entity, i in names.items()])
        for i, (entity, minute, state, attributes) in enumerate(states):
            shared = json.dumps(attributes, ensure_ascii=False)
            database.execute("INSERT INTO state_attributes VALUES (?, 0, ?)", (i + 1, shared))
            database.execute(
                "INSERT INTO states (state, last_updated_ts, attributes_id, metadata_id) VALUES (?, ?, ?, ?)",
                (state, T0 + 60 * minute, i + 1, names[entity]),
            )
        rows = [(1, "sensor.outdoor", "°C", 1, 0), (2, "sensor.heat_meter", "kWh", 0, 1), (3, "sensor.gas", "m³", 0, 1)]
        database.executemany("INSERT INTO statistics_meta VALUES (?, ?, 'recorder', ?, ?, ?, NULL)", rows)
        for hour in range(48):
            at = T0 - 3600 * (48 - hour)
            if hour != 30:
                database.execute(
                    "INSERT INTO statistics (metadata_id, start_ts, state, sum) VALUES (2, ?, ?, ?)",
                    (at, hour, 3.0 * hour),
                )
            database.execute(
                "INSERT INTO statistics (metadata_id, start_ts, mean, min, max) VALUES (1, ?, ?, 0, 9)", (at, hour / 10)
            )
    return path


def test_the_states_of_a_recorder(tmp_path):
    path = _database(tmp_path)
    assert home_assistant.looks_like(path, "")
    log = home_assistant.read(path)
    frame = log.frame
    assert (log.format, log.label, log.held) == ("Home Assistant states", "left", frozenset())
    assert frame.index[0] == START
    assert len(frame) == 61
    at = {minute: START + pd.Timedelta(minutes=minute) for minute in range(61)}
    assert frame.loc[at[13], "sensor.outdoor"] == 2.1  # held until the next change, at 14
    assert frame.loc[at[14], "sensor.outdoor"] == 2.2
    assert frame.loc[at[56], "sensor.outdoor"] == 2.7
    assert frame.loc[at[57] :, "sensor.outdoor"].isna().all()  # unavailable
    assert frame["switch.pump"].iloc[[1, 2, 39, 40]].tolist() == pytest.approx([np.nan, 1.0, 1.0, 0.0], nan_ok=True)
    heating = frame["climate.living.heating"]
    assert heating.iloc[[10, 11, 32, 33]].tolist() == [0.0, 1.0, 1.0, 0.0]  # a change at 10:30 is in force at 11
    assert heating.iloc[50:].isna().all()
    assert "climate.living.cooling" not in frame
    assert dict(log.roles) == {
        "T_za": "climate.living.current_temperature",
        "T_heat_set": "climate.living.temperature",
        "u_heat": "climate.living.heating",
        "mode": "climate.living.mode",
    }
    assert log.units["sensor.outdoor"] == "degC"
    assert log.units["climate.living.current_temperature"] == "degC"  # the unit that the sensors share
    assert "climate.living.heating" not in log.units
    text = " ".join(log.notes)
    assert "no numbers: sensor.mood." in text
    assert "automation.night" not in frame
    assert "reach over 2 days: read them with table='statistics'" in text


def test_a_zone_a_step_and_named_entities(tmp_path):
    path = _database(tmp_path)
    log = home_assistant.read(path, entities=["sensor.outdoor"], step="10min", timezone="Europe/Berlin")
    assert list(log.frame) == ["sensor.outdoor"]
    assert log.frame.index[0] == pd.Timestamp("2024-01-10 07:00", tz="Europe/Berlin")
    assert log.frame["sensor.outdoor"].iloc[:3].tolist() == [2.0, 2.1, 2.2]
    with pytest.raises(ValueError, match=r"has no entity 'sensor\.attic', only automation\.night, climate\.living"):
        home_assistant.read(path, entities=["sensor.attic"])
    with pytest.raises(ValueError, match="timezone='Mars' is unknown"):
        home_assistant.read(path, timezone="Mars")


def test_rows_between_two_runs_are_missing(tmp_path):
    path = _database(tmp_path)
    with closing(sqlite3.connect(path)) as database, database:
        runs = [("05:00", "06:20:30"), ("06:45:00", None)]
        for i, (start, end) in enumerate(runs):
            stamp = None if end is None else f"2024-01-10 {end}.000000"
            row = (i, f"2024-01-10 {start}:00.000000"[:26], stamp)
            database.execute("INSERT INTO recorder_runs VALUES (?, ?, ?, 0, '2024-01-10 05:00:00')", row)
        database.execute("UPDATE recorder_runs SET start = '2024-01-10 06:45:00.000000' WHERE run_id = 1")
    log = home_assistant.read(path)
    assert log.frame["switch.pump"].iloc[20] == 1.0
    assert log.frame.iloc[21:45].isna().all(axis=None)
    assert log.frame["switch.pump"].iloc[45] == 0.0
    assert "did not run for 24 of 61 rows" in " ".join(log.notes)


@pytest.mark.parametrize("begun", ["", "CREATE TABLE states_meta (metadata_id INTEGER, entity_id VARCHAR(255));"])
def test_the_old_schema_gives_the_same(tmp_path, begun):
    """Also where an upgrade to the new one was stopped at its first table."""
    path = tmp_path / "home-assistant.db"
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(OLD + begun)
        for entity, minute, state, attributes in STATES:
            stamp = f"{START + pd.Timedelta(minutes=minute):%Y-%m-%d %H:%M:%S.%f}"
            row = (entity.split(".")[0], entity, state, json.dumps(attributes), stamp, stamp)
            database.execute(
                "INSERT INTO states (domain, entity_id, state, attributes, last_changed, last_updated) "
                "VALUES (?, ?, ?, ?, ?, ?)",
                row,
            )
    new, old = home_assistant.read(_database(tmp_path)), home_assistant.read(path)
    pd.testing.assert_frame_equal(old.frame, new.frame)
    assert (old.units, old.roles) == (new.units, new.roles)


def test_hourly_statistics(tmp_path):
    log = home_assistant.read(_database(tmp_path), table="statistics")
    assert (log.format, log.label) == ("Home Assistant statistics", "left")
    assert log.frame.index[0] == START - pd.Timedelta("48h")
    assert log.frame["sensor.outdoor"].iloc[7] == pytest.approx(0.7)
    meter = log.frame["sensor.heat_meter"]
    assert meter.iloc[5] == pytest.approx(3.0)  # 3 kWh in the hour
    assert np.isnan(meter.iloc[[0, 30, 31]]).all()  # no hour before; no row; over two hours
    assert dict(log.units) == {"sensor.outdoor": "degC", "sensor.heat_meter": "kW"}
    assert "sensor.gas" not in log.frame
    with pytest.raises(ValueError, match="has no statistics with numbers"):
        home_assistant.read(tmp_path / "home-assistant_v2.db", table="statistics_short_term")


def test_a_database_that_is_in_use_is_read_and_not_written(tmp_path):
    path = _database(tmp_path)
    expected = home_assistant.read(path).frame
    before = path.read_bytes()
    with closing(sqlite3.connect(path, isolation_level=None)) as writer:
        writer.execute("BEGIN EXCLUSIVE")
        log = home_assistant.read(path)
        pd.testing.assert_frame_equal(log.frame, expected)
        assert "newest rows may be missing" in log.notes[0]
        writer.execute("ROLLBACK")
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_copy_with_a_write_ahead_log_elsewhere_gets_no_files_beside_it(tmp_path):
    path = _database(tmp_path)
    expected = home_assistant.read(path).frame
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        pd.testing.assert_frame_equal(home_assistant.read(path).frame, expected)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    pd.testing.assert_frame_equal(home_assistant.read(path).frame, expected)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_thermostat_that_heats_and_cools():
    row = {
        "hvac_modes": ["off", "heat_cool"],
        "target_temp_low": 68,
        "target_temp_high": 76,
        "current_temperature": 70.5,
    }
    rows = [row | {"hvac_action": "cooling"}, row | {"hvac_action": "off"}, None]
    found = entity_states.climate_values(rows, ["heat_cool", "off", "unavailable"])
    assert found["cooling"].tolist() == pytest.approx([1.0, 0.0, np.nan], nan_ok=True)
    assert found["heating"].tolist() == pytest.approx([0.0, 0.0, np.nan], nan_ok=True)
    roles = entity_states.climate_roles(["climate.a"], [f"climate.a.{name}" for name in found])
    assert roles["T_heat_set"] == "climate.a.target_temp_low"
    assert roles["u_cool"] == "climate.a.cooling"
    assert entity_states.climate_roles(["climate.a", "climate.b"], []) == {}


def test_a_thermostat_with_one_set_point_that_heats_and_cools():
    """It had no set-point at all."""
    row = {"hvac_modes": ["off", "heat", "cool"], "temperature": 21.0, "current_temperature": 20.5}
    rows = [row | {"hvac_action": "heating"}, row | {"hvac_action": "cooling"}, row | {"hvac_action": "off"}]
    found = entity_states.climate_values(rows, ["heat", "cool", "off"])
    assert found["mode"].tolist() == [1.0, -1.0, 0.0]
    roles = entity_states.climate_roles(["climate.a"], [f"climate.a.{name}" for name in found])
    assert roles["T_heat_set"] == roles["T_cool_set"] == "climate.a.temperature"
    assert roles["mode"] == "climate.a.mode"
    untold = entity_states.climate_values([row], ["heat"])  # it does not say when it runs
    assert not {"heating", "cooling"} & set(untold)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda p: p.write_bytes(p.read_bytes()[:5000]), "cannot be read as Home Assistant's database"),
        (lambda p: p.write_bytes(b"SQLite format 3\x00" + b"x" * 400), "cannot be read as Home Assistant's database"),
        (lambda p: _only(p, "CREATE TABLE log (t, v)"), "has no tables of Home Assistant's recorder"),
        (lambda p: _only(p, OLD), "has no entity with numbers, only none at all|has no table|no entity with numbers"),
    ],
    ids=["cut off", "damaged", "another database", "no states"],
)
def test_a_database_that_cannot_be_read(tmp_path, spoil, says):
    path = _database(tmp_path)
    spoil(path)
    with pytest.raises(ValueError, match=says):
        home_assistant.read(path, table="states" if "entity" in says else None)


def _only(path: Path, script: str) -> None:
    path.unlink()
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(script)


def test_another_database_is_not_claimed(tmp_path):
    path = tmp_path / "meters.db"
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE readings (t, v)")
    assert not home_assistant.looks_like(path, "")


# -------------------------------------------------------------------------------------------------------- its history
def test_the_long_csv_of_a_history():
    log = home_assistant.read(HISTORY, timezone="Europe/Amsterdam")
    assert list(log.frame) == ["sensor.living_room_temperature", "binary_sensor.boiler", "sensor.outdoor_temperature"]
    room, boiler = log.frame["sensor.living_room_temperature"], log.frame["binary_sensor.boiler"]
    assert log.frame.index[-1] == pd.Timestamp("2024-03-30 23:55", tz="Europe/Amsterdam")
    assert (log.frame.index[1:] - log.frame.index[:-1] == pd.Timedelta("1min")).all()
    at = {m: pd.Timestamp(f"2024-03-30 22:{m:02d}", tz="UTC") for m in range(60)}
    assert room[at[24]] == 20.4
    assert np.isnan(room[at[29]])  # unavailable from 22:25
    assert room[at[31]] == 20.4
    assert boiler[at[10]] == 0.0
    assert boiler[at[11]] == 1.0
    assert boiler[at[32]] == 0.0
    text = " ".join(log.notes)
    assert "climate.living_room" in text
    assert "names no units" in text


def test_histories_one_below_the_other_are_read_as_one(tmp_path):
    header, *rows = HISTORY.read_text(encoding="utf-8-sig").splitlines()
    both = [header, *rows[:9], header, *rows[5:]]
    (tmp_path / "both.csv").write_text("\n".join(both), encoding="utf-8")
    pd.testing.assert_frame_equal(home_assistant.read(tmp_path / "both.csv").frame, home_assistant.read(HISTORY).frame)


def test_a_history_read_in_pieces_is_the_same(monkeypatch):
    whole = home_assistant.read(HISTORY)
    monkeypatch.setattr(home_assistant, "_PIECE", 4)
    pd.testing.assert_frame_equal(home_assistant.read(HISTORY).frame, whole.frame)


def test_a_history_with_a_further_column_is_the_same(tmp_path):
    header, *rows = HISTORY.read_text(encoding="utf-8-sig").splitlines()
    path = tmp_path / "more.csv"
    path.write_text("\n".join([f"{header},note", *(f"{row},x" for row in rows)]), encoding="utf-8")
    pd.testing.assert_frame_equal(home_assistant.read(path).frame, home_assistant.read(HISTORY).frame)


@pytest.mark.parametrize("minimal", [False, True])
def test_the_json_of_a_history_is_the_same_and_has_units(tmp_path, minimal):
    """It was refused; with minimal_response, only the first state of an entity says what it is."""
    lists = []
    for name, rows in pd.read_csv(HISTORY, dtype=str, keep_default_na=False, encoding="utf-8-sig").groupby("entity_id"):
        unit = {"unit_of_measurement": "°C"} if name.endswith("_temperature") else {}
        states = rows.assign(attributes=[unit] * len(rows)).to_dict(orient="records")
        rest = [{k: row[k] for k in ("state", "last_changed")} for row in states[1:]] if minimal else states[1:]
        lists.append([states[0], *rest])
    (tmp_path / "history.json").write_text(json.dumps(lists), encoding="utf-8")
    log, of_csv = read_log(tmp_path / "history.json", step="5min"), read_log(HISTORY, step="5min")
    pd.testing.assert_frame_equal(log.frame[list(of_csv.frame)], of_csv.frame)
    assert log.format == of_csv.format == "Home Assistant history"
    assert log.units == dict.fromkeys(("sensor.living_room_temperature", "sensor.outdoor_temperature"), "degC")
    assert not any("names no units" in note for note in log.notes)
    lists[0][1].pop("last_changed")
    (tmp_path / "history.json").write_text(json.dumps(lists), encoding="utf-8")
    with pytest.raises(ValueError, match=r"line 2 of 'history\.json': 'nan' is not a time stamp"):
        read_log(tmp_path / "history.json")


def test_what_a_history_does_not_have_is_refused(tmp_path):
    """A slip in one of several entities left its channel out in silence."""
    named = ["binary_sensor.boiler", "sensor.outdor_temperature"]
    with pytest.raises(ValueError, match=r"has no entity 'sensor\.outdor_temperature', only binary_sensor\.boiler, "):
        home_assistant.read(HISTORY, entities=named)
    assert list(home_assistant.read(HISTORY, entities=named[:1]).frame) == named[:1]
    for path in (HISTORY, _database(tmp_path)):
        with pytest.raises(ValueError, match=r"entities='sensor.a' is one text; give a list of entities"):
            home_assistant.read(path, entities="sensor.a")
    with pytest.raises(ValueError, match=r"table='statistics' is for a database, but 'home_assistant_history\.csv'"):
        home_assistant.read(HISTORY, table="statistics")


@pytest.mark.parametrize("every", [5, 15])
def test_a_counter_rises_evenly_between_its_readings(every):
    """Held by the minute, the heat of a quarter of an hour came in one minute."""
    power = np.where(np.arange(2 * 1440) % 480 < 240, 6.0, 0.0)  # four hours on, four off
    readings = np.append(100.0, 100.0 + np.cumsum(power / 60.0))[::every]
    changed = np.append(True, np.diff(readings) > 0.0)
    stamps, grid = T0 + 60.0 * every * np.flatnonzero(changed), T0 + 60.0 * np.arange(2 * 1440)
    held = pd.Series(entity_states.hold(stamps, readings[changed], grid), entity_states.utc_index(grid, None))
    np.testing.assert_allclose(power_of_counter(held)[:-1], power[:-1], atol=1e-6)
    reset = np.where(stamps > T0 + 86400.0, readings[changed] - 124.0, readings[changed])
    held = entity_states.hold(stamps, reset, grid)
    assert (np.diff(held) < 0.0).sum() == 1
    assert held[grid <= T0 + 86000.0].min() == 100.0


def test_a_grid_too_large_to_hold_is_refused(monkeypatch):
    monkeypatch.setattr(entity_states, "MOST_CELLS", 100)
    with pytest.raises(ValueError, match=r"makes 55 rows of .* for 3 channels, too many to hold; name those"):
        home_assistant.read(HISTORY)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t[:-20], r"line 22 of 'log.csv': '2024-' is not a time stamp; the file may be cut off"),
        (lambda t: t.splitlines()[0] + "\n", "has a header but no rows"),
        (lambda t: "", "is empty"),
        (
            lambda t: t.splitlines()[0] + "\nsensor.a,sunny,2024-01-01T00:00:00Z\n",
            "no entity with numbers, only sensor.a",
        ),
    ],
    ids=["cut off", "no rows", "empty", "text"],
)
def test_a_history_that_cannot_be_read(tmp_path, change, says):
    path = tmp_path / "log.csv"
    path.write_text(change(HISTORY.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(ValueError, match=says):
        home_assistant.read(path)


# ------------------------------------------------------------------------------------------------------------ Influx
def test_annotated_csv_with_several_tables():
    log = influx.read(INFLUX)
    living, outdoor, burner = log.frame
    assert living == "°C value domain=sensor entity_id=living_temp"
    assert burner == "opentherm burner boiler=attic"
    assert dict(log.units) == {living: "degC", outdoor: "degC"}
    assert log.label is None
    assert log.frame.index[0] == pd.Timestamp("2024-01-10 00:10", tz="UTC")
    assert log.frame[living].dropna().tolist() == pytest.approx([19.5 + 0.1 * i for i in range(18)])
    assert log.frame[outdoor].notna().sum() == 17
    assert log.frame[burner].dropna().tolist() == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0] * 3
    assert log.frame[burner].first_valid_index() == pd.Timestamp("2024-01-10 00:10:00.5", tz="UTC")
    assert "they hold text: opentherm mode." in " ".join(log.notes)
    in_oslo = influx.read(INFLUX, timezone="Europe/Oslo")
    assert in_oslo.frame.index[0].hour == 1
    assert in_oslo.first == pd.Timestamp("2024-01-10 00:10", tz="UTC")
    assert str(in_oslo.first.tz) == "UTC"  # where a day of windows begins


def test_annotated_csv_read_in_pieces_is_the_same(monkeypatch):
    whole = influx.read(INFLUX)
    monkeypatch.setattr(influx, "_PIECE", 5)
    pd.testing.assert_frame_equal(influx.read(INFLUX).frame, whole.frame)


PIVOTED = """#group,false,false,false,true,false,false
#datatype,string,long,dateTime:RFC3339,string,double,boolean
#default,_result,,,,,
,result,table,_time,room,temperature,heating
,,0,2024-01-10T00:00:00Z,attic,19.5,true
,,0,2024-01-10T00:10:00Z,attic,,false
"""


def test_a_pivoted_query_has_a_channel_per_column(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(PIVOTED, encoding="utf-8")
    frame = influx.read(path).frame
    assert frame["temperature room=attic"].tolist() == pytest.approx([19.5, np.nan], nan_ok=True)
    assert frame["heating room=attic"].tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (PIVOTED[:-24], r"line 6 of 'log.csv' has 4 cells, but its table has 7 columns"),
        ("\n".join(PIVOTED.splitlines()[:4]), "has no numbers"),
        (PIVOTED.replace("_time", "time"), "a table without _time at line 4"),
        (PIVOTED.replace("19.5", "warm"), r"line 5 of 'log.csv', 'temperature room=attic': 'warm' is not a number"),
        (PIVOTED.replace("T00:10:00Z", ""), "'2024-01-10' is not a time stamp"),
        (
            PIVOTED.replace("2024-01-10T00:10", "2024-01-10 late"),
            "line 6 of 'log.csv': '2024-01-10 late:00Z' is no",
        ),
        (
            "#datatype,string,long\n#group,true,true\n#default,,\n,error,reference\n,failed to parse query,897\n",
            "error messa",
        ),
    ],
    ids=["cut off", "no rows", "no time", "no number", "a date", "no stamp", "an error"],
)
def test_annotated_csv_that_cannot_be_read(tmp_path, text, says):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=says):
        influx.read(path)


def test_the_file_log_of_fhem(tmp_path):
    """It was refused, since its cells have no separator."""
    lines = []
    for k in range(48):
        at = f"2018-10-{1 + k // 24:02d}_{k % 24:02d}"
        lines += [
            f"{at}:05:00 Bad measured-temp: {20 + k / 10:.1f}",
            f"{at}:10:00.123 Bad T: {20 + k} H: 45 valve: {k} %",
        ]
        lines += [f"{at}:20:00 Pumpe {('on', 'off')[k % 2]}", f"{at}:30:00 WZ power: {k} W"]
    (tmp_path / "fhem.log").write_text("\n".join([lines[0], "2018-10-01 shutdown", *lines[1:]]), encoding="utf-8")
    log = read_log(tmp_path / "fhem.log")
    assert (log.format, log.units) == ("FHEM", {"Bad valve": "percent", "WZ power": "W"})
    assert list(log.frame) == ["Bad measured-temp", "Bad T", "Bad H", "Bad valve", "Pumpe", "WZ power"]
    assert log.frame.loc["2018-10-01 01:05:00", "Bad measured-temp"] == 20.1
    assert log.frame.loc["2018-10-02 23:10:00", ["Bad T", "Bad H", "Bad valve"]].tolist() == [67.0, 45.0, 47.0]
    assert log.frame["Pumpe"].dropna().tolist() == [1.0, 0.0] * 24
    assert "1 line that FHEM does not write so left out" in log.notes
    assert list(read_log(tmp_path / "fhem.log", columns=["Pumpe"]).frame) == ["Pumpe"]
    lines = ["2018-10-01_00:00:00 Bad T: 21.0 H: 45 valve: 3 %", "shutdown", "2018-13-45_01:00:00 Bad T: 1 H: 45"]
    (tmp_path / "fhem.log").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(ValueError, match=r"row 3 of 'fhem\.log': the time stamp '2018-13-45 01:00:00' is not a date"):
        read_log(tmp_path / "fhem.log")


def test_the_statistics_of_loxone(tmp_path):
    """They were refused as a web page or XML."""
    parts = [
        ("Raum &amp; Flur", "Temperatur,Soll", lambda k: f'V="{20 + k / 10:.1f}" V2="{21 - k % 2}"'),
        ("Aussentemperatur", "Value", lambda k: f'V="{k / 10:.1f}"'),
    ]
    text = ""
    for name, outputs, values in parts:
        text += '<?xml version="1.0" encoding="utf-8"?>\n'
        text += f'<Statistics Name="{name}" NumOutputs="{outputs.count(",") + 1}" Outputs="{outputs}">\n'
        text += "".join(f'<S T="2024-01-01 {k:02d}:00:00" {values(k)}/>\n' for k in range(24)) + "</Statistics>\n"
    (tmp_path / "log.xml").write_text(text, encoding="utf-8")
    log = read_log(tmp_path / "log.xml")
    assert (log.format, log.frame.index[-1]) == ("Loxone", pd.Timestamp("2024-01-01 23:00"))
    assert list(log.frame) == ["Raum & Flur Temperatur", "Raum & Flur Soll", "Aussentemperatur"]
    np.testing.assert_allclose(log.frame["Raum & Flur Temperatur"], 20 + np.arange(24) / 10)
    np.testing.assert_allclose(log.frame["Raum & Flur Soll"], 21 - np.arange(24) % 2)
    np.testing.assert_allclose(log.frame["Aussentemperatur"], np.arange(24) / 10)
    (tmp_path / "log.xml").write_text(text.replace("2024-01-01 23", "2024-13-01 23"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"row 26 of 'log\.xml': the time stamp '2024-13-01 23:00:00' is not a date"):
        read_log(tmp_path / "log.xml")


def test_raw_statistics_as_csv_are_read_by_sensor(tmp_path):
    """With their column of stamps given, the values of all sensors were mixed in silence."""
    stamps = pd.date_range("2024-01-01", periods=200, freq="1h", tz="UTC")
    rows = [(t.timestamp(), sensor, T, T - 0.2) for t in stamps for sensor, T in ((7, 20.0), (12, 5.0 + t.hour))]
    path = tmp_path / "statistics.csv"
    pd.DataFrame(rows, columns=["start_ts", "metadata_id", "mean", "min"]).to_csv(path)
    for given in ({}, {"time_column": "start_ts"}):
        with pytest.raises(ValueError, match="point_column='metadata_id' and value_column='mean'"):
            read_log(path, format="CSV", **given)
    named = {"time_column": "start_ts", "point_column": "metadata_id", "value_column": "mean"}
    frame = read_log(path, "change of value", **named).frame
    assert (frame.index == stamps).all()
    np.testing.assert_array_equal(frame["12"], 5.0 + stamps.hour)
