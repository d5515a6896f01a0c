"""Readers of ecobee's formats, Donate Your Data and the EPA's thermostat data, on samples in their true form."""

from __future__ import annotations

import gzip
import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skhybrid.logs import read_log
from skhybrid.logs.readers import ecobee, epa_thermostat, home_assistant, influx
from skhybrid.logs.readers.plant_stages import full_load
from skhybrid.logs.text_files import head_of
from skhybrid.study import propose_settings, read_settings
from skhybrid.study import read_log as read_zone_log
from skhybrid.study.settings import settings_from

SAMPLES = Path(__file__).parent / "log_samples"
PORTAL, DONATED, EPA = (SAMPLES / n for n in ("ecobee_portal.csv", "donate_your_data.csv", "epa_interval.csv"))


def _written(folder: Path, text: str, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "reader"),
    [
        ("ecobee_portal.csv", ecobee),
        ("donate_your_data.csv", ecobee),
        ("epa_interval.csv", epa_thermostat),
        ("home_assistant_history.csv", home_assistant),
        ("influx_annotated.csv", influx),
        ("metadata.csv", None),
    ],
)
def test_only_the_reader_of_a_format_claims_its_sample(name, reader, tmp_path):
    marked = tmp_path / name
    marked.write_text((SAMPLES / name).read_text(encoding="utf-8"), encoding="utf-8-sig")  # with a byte order mark
    for path in (SAMPLES / name, marked):
        claims = [r for r in (ecobee, epa_thermostat, home_assistant, influx) if r.looks_like(path, head_of(path))]
        assert claims == ([] if reader is None else [reader])


@pytest.mark.parametrize(
    "name",
    [
        "ecobee_portal.csv", "donate_your_data.csv", "epa_interval.csv", "home_assistant_history.csv",
        "influx_annotated.csv",
    ],
)  # fmt: skip
def test_a_compressed_file_is_as_the_file(tmp_path, name):
    """All were known by their content, and most then refused as no UTF-8."""
    path = tmp_path / f"{name}.gz"
    path.write_bytes(gzip.compress((SAMPLES / name).read_bytes()))
    found, plain = read_log(path), read_log(SAMPLES / name)
    assert found.format == plain.format
    # the zone of the EPA's stamps comes from the file beside it
    pd.testing.assert_frame_equal(found.frame.tz_localize(None), plain.frame.tz_localize(None))


@pytest.mark.parametrize(
    ("name", "reader"),
    [("donate_your_data.csv", ecobee), ("influx_annotated.csv", influx), ("ecobee_portal.csv", ecobee)],
)
def test_unknown_zone(name, reader):
    with pytest.raises(ValueError, match="timezone='Mars/Base' is unknown"):
        reader.read(SAMPLES / name, timezone="Mars/Base")


# ------------------------------------------------------------------------------------------------------ ecobee's portal
def test_the_portal_export():
    log = ecobee.read(PORTAL, timezone="America/Toronto")
    assert (log.format, log.label, log.held) == ("ecobee portal", "left", frozenset())
    assert len(log.frame) == 36  # the rest of the day is empty
    assert log.frame.index[0] == pd.Timestamp("2024-01-15 06:00", tz="America/Toronto")
    assert log.frame.index[-1] == pd.Timestamp("2024-01-15 13:55", tz="UTC")
    assert dict(log.roles) == {
        "T_za": "Current Temp (F)",
        "T_oa": "Outdoor Temp (F)",
        "T_heat_set": "Heat Set Temp (F)",
        "u_heat": "Heat Stage 1 (sec)",
        "u_aux": "Aux Heat 1 (sec)",
    }
    assert log.scale["Heat Stage 1 (sec)"] * 300.0 == pytest.approx(1.0)
    assert log.units["Current Temp (F)"] == "degF"
    assert log.units["Current Humidity (%RH)"] == "percent"
    assert "Wind Speed (km/h)" not in log.units
    assert "System Mode" not in log.frame
    assert log.frame["Current Temp (F)"].iloc[0] == 67.7
    text = " ".join(log.notes)
    assert "Main Floor" in text
    assert "'Cool Set Temp (F)' is not used, because this log shows no cooling" in text


@pytest.mark.parametrize("sample", [PORTAL, DONATED])
def test_a_header_in_mid_file_is_no_row(sample, tmp_path):
    head, *lines = sample.read_text(encoding="utf-8").splitlines()
    at = next((k for k, line in enumerate(lines) if line.startswith("Date,Time")), -1)
    lines.insert(at + 4, head if at < 0 else lines[at])
    path = _written(tmp_path, "\n".join([head, *lines]), sample.name)
    found, whole = (ecobee.read(one, timezone="America/Toronto").frame for one in (path, sample))
    pd.testing.assert_frame_equal(found, whole)


def test_without_a_zone_the_portal_is_local_time_and_says_so():
    log = ecobee.read(PORTAL)
    assert log.frame.index.tz is None
    assert "give timezone=" in " ".join(log.notes)


def test_a_celsius_account_with_a_furnace(tmp_path):
    text = PORTAL.read_text(encoding="utf-8").replace(" (F)", " (C)").replace(",Aux Heat 1 (sec)", ",Economizer")
    log = ecobee.read(_written(tmp_path, text))
    assert log.units["Current Temp (C)"] == "degC"
    assert log.roles["T_za"] == "Current Temp (C)"
    assert log.roles["u_heat"] == "Heat Stage 1 (sec)"
    assert "u_aux" not in log.roles


def _portal(stamps: pd.DatetimeIndex) -> str:
    rows = [f"{t:%Y-%m-%d},{t:%H:%M:%S},70,40,{i % 2 * 300}," for i, t in enumerate(stamps)]
    return "\n".join(["Date,Time,Current Temp (F),Outdoor Temp (F),Heat Stage 1 (sec)", *rows])


def test_a_portal_clock_that_is_set_forward_and_one_that_is_not(tmp_path):
    utc = pd.date_range("2024-03-10 06:00", "2024-03-10 09:00", freq="5min", tz="UTC")
    wall = utc.tz_convert("America/Toronto")
    for clock, n_notes in ((wall.tz_localize(None), 0), ((utc - pd.Timedelta("5h")).tz_localize(None), 1)):
        log = ecobee.read(_written(tmp_path, _portal(clock)), timezone="America/Toronto")
        assert (log.frame.index == wall).all()
        assert sum("standard time" in note for note in log.notes) == n_notes


def test_the_repeated_hour_in_autumn(tmp_path):
    wall = pd.date_range("2024-11-03 04:00", "2024-11-03 08:00", freq="5min", tz="UTC").tz_convert("America/Toronto")
    log = ecobee.read(_written(tmp_path, _portal(wall.tz_localize(None))), timezone="America/Toronto")
    assert (log.frame.index == wall).all()


# ------------------------------------------------------------------------------------- Donate Your Data, and the API
def test_donate_your_data_is_utc_and_its_two_stages_are_one_plant():
    log = ecobee.read(DONATED)
    assert log.format == "Donate Your Data"
    assert log.frame.index[0] == pd.Timestamp("2019-01-10 11:30", tz="UTC")
    assert log.roles["u_heat"] == "auxiliary heat at full load"
    assert "u_aux" not in log.roles
    load = log.frame["auxiliary heat at full load"] * log.scale["auxiliary heat at full load"]
    assert load.iloc[0] == 0.0
    assert load.iloc[2] == pytest.approx(0.65)  # the first stage alone
    assert load.iloc[5] == pytest.approx(1.0)  # both
    assert load.iloc[9] == pytest.approx(0.65 * 210 / 300 + 90 / 300)
    assert "0.65, 1 of the full capacity (lower stages run on" in " ".join(log.notes)
    assert log.frame.index.tz_convert("America/Chicago")[0] == ecobee.read(DONATED, "America/Chicago").frame.index[0]


def test_a_day_without_the_second_stage_has_the_same_channel(tmp_path):
    lines = DONATED.read_text(encoding="utf-8").splitlines()
    log = ecobee.read(_written(tmp_path, "\n".join([*lines[:1], *lines[-10:]])))
    whole = ecobee.read(DONATED).frame["auxiliary heat at full load"]
    assert (log.frame["auxiliary heat at full load"] == whole.iloc[-10:]).all()


@pytest.mark.parametrize("source", [DONATED, "epa"])
def test_a_month_with_blank_stages_is_read_by_the_configuration_of_another(source, tmp_path):
    """It was refused, since it lacked the column of both stages."""
    if source == "epa":
        hours = pd.date_range("2021-01-01", periods=48, freq="h")
        rows = [f"{t},0,0,,{10 * (t.hour % 6)},{t.hour % 6},66.{t.hour},30.5" for t in hours]
        text, stages = "\n".join([f"{HEADER},temp_out", *rows]), r"heat_runtime_stg\d"
    else:
        text, stages = source.read_text(encoding="utf-8"), r"auxHeat\d"
    (tmp_path / "zone.toml").write_text(propose_settings(_written(tmp_path, text)), encoding="utf-8")
    settings = read_settings(tmp_path / "zone.toml")
    assert settings.columns["u_heat"].endswith("at full load")
    table = pd.read_csv(_written(tmp_path, text), dtype=str)
    table.loc[:, table.columns.str.fullmatch(stages)] = ""
    frame, report = read_zone_log(_written(tmp_path, table.to_csv(index=False)), settings)
    assert frame["u_heat"].isna().all()
    assert frame["T_za"].notna().all()
    assert f"u_heat: {len(frame)} rows left missing" in report
    assert any("this log shows no " in note for note in read_log(tmp_path / "log.csv").notes)  # not that none ran
    assert "u_heat" not in settings_from(tomllib.loads(propose_settings(tmp_path / "log.csv"))).columns


def test_stages_of_which_only_the_highest_is_counted():
    stages = pd.DataFrame({"1": [300.0, 100.0, 0.0, np.nan], "2": [0.0, 200.0, 300.0, np.nan]})
    total, how = full_load(stages, 300.0, 0.65)
    np.testing.assert_allclose(total, [195.0, 265.0, 300.0, np.nan])
    assert "only the highest" in how
    three, _ = full_load(pd.DataFrame([[300.0, 300.0, 300.0], [300.0, 300.0, 0.0], [300.0, 0.0, 0.0]]), 300.0, 0.65)
    np.testing.assert_allclose(three, [300.0, 200.0, 100.0])
    briefly, how = full_load(pd.DataFrame({"1": [20.0, 10.0, 0.0], "2": [10.0, 5.0, 0.0]}), 300.0, 0.65)
    np.testing.assert_allclose(briefly, [16.5, 8.25, 0.0])
    assert "lower stages run on" in how


API = "date,time,auxHeat1,compCool1,compCool2,zoneAveTemp,zoneHeatTemp,zoneCoolTemp,outdoorTemp,zoneHvacMode"
API_ROWS = [
    "2024-07-01,00:00:00,0,300,0,765,680,760,841,compressorCoolStage10n",
    "2024-07-01,00:05:00,0,0,0,758,,760,840,",
]


def test_the_names_and_tenths_of_the_api(tmp_path):
    log = ecobee.read(_written(tmp_path, "\n".join([API, *API_ROWS])), timezone="America/New_York")
    assert log.format == "ecobee API"
    assert log.frame.index[1] == pd.Timestamp("2024-07-01 04:05", tz="UTC")
    assert log.frame["zoneAveTemp"].tolist() == [76.5, 75.8]
    assert log.units["zoneAveTemp"] == "degF"
    assert log.roles["u_cool"] == "compCool1"
    assert "u_heat" not in log.roles
    assert "T_heat_set" not in log.roles
    assert "divided by 10" in " ".join(log.notes)


def test_the_json_of_a_runtime_report_is_that_log(tmp_path):
    names = API.removeprefix("date,time,")
    report = {"columns": names, "reportList": [{"thermostatIdentifier": "4123", "rowCount": 2, "rowList": API_ROWS}]}
    path = _written(tmp_path, json.dumps(report), "report.json")
    assert ecobee.looks_like(path, path.read_text(encoding="utf-8"))
    other = ecobee.read(_written(tmp_path, "\n".join([API, *API_ROWS])))
    pd.testing.assert_frame_equal(ecobee.read(path).frame, other.frame)
    report["reportList"] *= 2
    with pytest.raises(ValueError, match="holds 2 thermostats; request a report of one of them"):
        ecobee.read(_written(tmp_path, json.dumps(report), "report.json"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda t: t[: t.index("2024-01-15,08:30:00") + 60],
            r"line \d+ of 'log.csv' has \d+ cells, but the header has 22; the file may",
        ),
        (lambda t: t.replace("Current Temp (F)", "Room (F)"), "has no column 'Current Temp'"),
        (lambda t: t.split("2024-01-15,06:00:00")[0], "has a header but no rows"),
        (
            lambda t: t.replace(",67.7,", ",6z.7,", 1),
            r"line 7 of 'log.csv', column 'Current Temp \(F\)': '6z.7' is not a nu",
        ),
        (lambda t: "a,b\n1,2\n", "not a log of an ecobee thermostat"),
        (
            lambda t: t.replace("2024-01-15,06:10", "2024-13-15,06:10"),
            r"row 9 of 'log\.csv': the time stamp '2024-13-15 06:10:00' is not",
        ),
    ],
    ids=["cut off", "no zone temperature", "no rows", "no number", "another file", "no date"],
)
def test_an_ecobee_log_that_cannot_be_read(tmp_path, change, says):
    with pytest.raises(ValueError, match=says):
        ecobee.read(_written(tmp_path, change(PORTAL.read_text(encoding="utf-8"))))


# ---------------------------------------------------------------------------------------------------------------- EPA
def test_the_epa_interval_file_takes_its_offset_from_the_metadata():
    log = epa_thermostat.read(EPA)
    assert (log.format, log.label) == ("EPA thermostat", "left")
    assert log.frame.index[0] == pd.Timestamp("2021-01-01 06:00", tz="UTC")
    assert len(log.frame) == 48
    assert dict(log.roles) == {
        "T_za": "temp_in",
        "T_heat_set": "heating_setpoint",
        "u_heat": "heat_runtime_stg1",
        "u_aux": "auxiliary_heat_runtime",
    }
    assert log.frame["heat_runtime_stg1"].iloc[6] * log.scale["heat_runtime_stg1"] == pytest.approx(1.0)
    assert log.units["temp_in"] == "degF"
    assert log.frame.iloc[25].isna().all()
    assert "this log shows no cooling" in " ".join(log.notes)
    assert "mean of its hour" in " ".join(log.notes)
    other = epa_thermostat.read(EPA, utc_offset="+05:30").frame.index[0]
    assert other == pd.Timestamp("2020-12-31 18:30", tz="UTC")


def test_epa_without_metadata_has_naive_stamps(tmp_path):
    log = epa_thermostat.read(_written(tmp_path, EPA.read_text(encoding="utf-8")))
    assert log.frame.index.tz is None
    assert "the stamps have no zone" in " ".join(log.notes)
    with pytest.raises(ValueError, match=r"'metadata\.csv' does not name the file 'log.csv'"):
        epa_thermostat.read(tmp_path / "log.csv", metadata=SAMPLES / "metadata.csv")
    with pytest.raises(ValueError, match="is 'CST'; write it as -0600"):
        epa_thermostat.read(tmp_path / "log.csv", utc_offset="CST")


def test_the_epas_data_in_a_time_zone(tmp_path):
    """A proposed configuration, which names the offset, could not be read with it."""
    head, *rows = EPA.read_text(encoding="utf-8").splitlines()
    log = _written(tmp_path, "\n".join([f"{head},outdoor_temp", *(f"{row},40.5" for row in rows)]), EPA.name)
    (tmp_path / "metadata.csv").write_text((SAMPLES / "metadata.csv").read_text(encoding="utf-8"), encoding="utf-8")
    proposed = propose_settings(log)
    assert '\ntimezone = "-06:00"' in proposed
    frame, _ = read_zone_log(log, read_settings(_written(tmp_path, proposed, "zone.toml")))
    assert frame.index[0] == pd.Timestamp("2021-01-01 00:00-06:00")
    assert str(read_log(log, timezone="America/Denver").frame.index[0]) == "2020-12-31 23:00:00-07:00"
    local = read_log(_written(tmp_path, EPA.read_text(encoding="utf-8")), timezone="America/Denver")
    assert str(local.frame.index[0]) == "2021-01-01 00:00:00-07:00"
    assert "the stamps have no zone" not in " ".join(local.notes)
    with pytest.raises(ValueError, match="is '-0690'; write it as -0600"):
        read_log(log, utc_offset="-0690")


HEADER = "datetime,cool_runtime_stg1,cool_runtime_stg2,cool_runtime_equiv,heat_runtime_stg1,heat_runtime_stg2,temp_in"


def test_epa_plants_of_two_stages(tmp_path):
    rows = ["2021-01-01 00:00:00,0,,,60,20,66.5", "2021-01-01 01:00:00,10,,6.5,30,0,67"]
    log = epa_thermostat.read(_written(tmp_path, "\n".join([HEADER, *rows])))
    assert log.roles["u_cool"] == "cool_runtime_equiv"
    assert log.roles["u_heat"] == "heat_runtime at full load"
    assert log.frame["heat_runtime at full load"].tolist() == pytest.approx([0.65 * 40 + 20, 0.65 * 30])
    assert log.scale["heat_runtime at full load"] == pytest.approx(1 / 60)


@pytest.mark.parametrize("second", ["0", ""])
def test_an_epa_log_in_which_the_second_stage_never_ran_has_the_column_of_both(second, tmp_path):
    """A configuration made in a colder month names it."""
    rows = [f"2021-04-01 0{h}:00:00,0,,,{run},{second},66.5" for h, run in enumerate((30, 0))]
    log = epa_thermostat.read(_written(tmp_path, "\n".join([HEADER, *rows])))
    assert log.frame["heat_runtime at full load"].tolist() == pytest.approx([0.65 * 30, 0.0])
    assert log.frame["cool_runtime at full load"].tolist() == [0.0, 0.0]
    assert log.roles["u_heat"] == "heat_runtime_stg1"
    assert "u_cool" not in log.roles
    assert "full load" not in " ".join(log.notes)


def test_an_epa_log_without_emergency_heat_has_the_column_with_it(tmp_path):
    header = "datetime,heat_runtime_stg1,auxiliary_heat_runtime,emergency_heat_runtime,temp_in"
    rows = ["2021-04-01 00:00:00,30,6,0,66.5", "2021-04-01 01:00:00,0,0,0,67"]
    log = epa_thermostat.read(_written(tmp_path, "\n".join([header, *rows])))
    assert log.frame["auxiliary_runtime with emergency heat"].tolist() == [6.0, 0.0]
    assert log.roles["u_aux"] == "auxiliary_heat_runtime"


def test_an_epa_compressor_of_two_stages_and_a_plant_that_hardly_ran(tmp_path):
    header = "datetime,cool_runtime_stg1,cool_runtime_stg2,heat_runtime_stg1,temp_in"
    rows = ["2021-01-01 00:00:00,60,20,0.5,66.5", "2021-01-01 01:00:00,30,0,0,67"]
    log = epa_thermostat.read(_written(tmp_path, "\n".join([header, *rows])))
    assert log.frame["cool_runtime at full load"].tolist() == pytest.approx([0.72 * 40 + 20, 0.72 * 30])
    assert log.roles["u_heat"] == "heat_runtime_stg1"


def test_the_older_epa_format_of_days(tmp_path):
    hours = [f"{h:02d}" for h in range(24)]
    header = ",".join(
        ["thermostat_id", "date", "cool_runtime", "heat_runtime", *(f"temp_in_{h}" for h in hours)]
        + [f"auxiliary_heat_runtime_{h}" for h in hours]
    )
    rows = [
        ",".join(["a1", day, "0", "480", *map(str, range(60, 84)), *["6"] * 24]) for day in ("2014-01-01", "2014-01-02")
    ]
    path = _written(tmp_path, "\n".join([header, *rows]))
    assert epa_thermostat.looks_like(path, path.read_text(encoding="utf-8"))
    log = epa_thermostat.read(path, utc_offset="-5")
    assert log.frame.shape == (48, 4)
    assert log.frame["temp_in"].iloc[25] == 61.0
    assert log.frame.index[24] == pd.Timestamp("2014-01-02 05:00", tz="UTC")
    local = epa_thermostat.read(path, timezone="America/Chicago").frame.index[24]
    assert local == pd.Timestamp("2014-01-02 06:00", tz="UTC")
    assert (log.frame["heat_runtime"] == 20.0).all()
    assert "u_heat" not in log.roles
    assert "too coarse for a role" in " ".join(log.notes)
    with pytest.raises(ValueError, match="holds 2 thermostats"):
        epa_thermostat.read(_written(tmp_path, "\n".join([header, rows[0], rows[1].replace("a1", "b2")])))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.replace(",60.0,", ",3600,"), "has 3600 minutes in an hour, first at 2021-01-01 05:00"),
        (lambda t: t.replace("temp_in", "indoor"), "has no column 'temp_in'"),
        (lambda t: t[: t.rindex(",") - 8], "the file may be cut off"),
        (lambda t: t.splitlines()[0], "has a header but no rows"),
        (lambda t: "", "is empty"),
    ],
    ids=["seconds", "no temperature", "cut off", "no rows", "empty"],
)
def test_an_epa_file_that_cannot_be_read(tmp_path, change, says):
    with pytest.raises(ValueError, match=says):
        epa_thermostat.read(_written(tmp_path, change(EPA.read_text(encoding="utf-8"))))


def test_a_file_that_is_absent():
    with pytest.raises(FileNotFoundError, match=r"there is no file 'absent\.csv'"):
        read_log("absent.csv", "ecobee")
