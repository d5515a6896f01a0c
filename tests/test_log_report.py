"""Roles and units from names, and the report on a log before anything is fitted."""

from __future__ import annotations

import json
from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import load_dutch_home, make_office
from skhybrid.logs import LogReport, RawLog, read_log, to_left_label
from skhybrid.logs.conversion import Channel, channels_of, roles_without_label, to_roles
from skhybrid.logs.log_findings import (
    clock_findings,
    counter_findings,
    daylight_changes,
    doubts_on_temperatures,
    gap_findings,
    gaps_of,
    sensor_findings,
    unit_switch,
)
from skhybrid.logs.naming import NAMED_BY_ROLE, guess_role, unit_in_name
from skhybrid.logs.standstills import standstills, without_standstills
from skhybrid.logs.zone_names import assign_zone_roles
from skhybrid.study import propose_settings, read_settings
from skhybrid.study import read_log as read_study_log


@pytest.fixture
def frame():
    """A heated room, ten days of quarter-hours, with names as a German logger writes them."""
    index = pd.date_range("2024-01-15", periods=960, freq="15min", tz="Europe/Berlin", name="time")
    hour = index.hour + index.minute / 60
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        {
            "Raumtemperatur [°C]": 20 + np.sin(2 * np.pi * hour / 24) + rng.normal(0, 0.05, 960),
            "Außentemperatur [°C]": 3 + 5 * np.sin(2 * np.pi * (hour - 9) / 24) + rng.normal(0, 0.1, 960),
            "Globalstrahlung (W/m²)": np.clip(400 * np.sin(2 * np.pi * (hour - 6) / 24), 0, None),
            "Heizung Ventil (%)": np.where((hour > 6) & (hour < 20), 60.0, 5.0),
            "Luftfeuchte (%)": 45.0,
        },
        index=index,
    )


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("Zone Temp (°F)", "T_za", "degF"),
        ("Raumtemperatur", "T_za", None),
        ("Außentemperatur [°C]", "T_oa", "degC"),
        ("Indoor Temperature", "T_za", None),
        ("Outdoor Temp (F)", "T_oa", "degF"),
        ("OAT", "T_oa", None),
        ("Température extérieure", "T_oa", None),
        ("Binnentemperatuur", "T_za", None),
        ("Heat Set Temp (F)", "T_heat_set", "degF"),
        ("set_cool_degC", "T_cool_set", "degC"),
        ("Aux Heat 1 (sec)", "u_heat", "s"),
        ("Ketel modulatie %", "u_heat", "percent"),
        ("Heizleistung [kW]", "Q_heat", "kW"),
        ("Heat meter MWh", "Q_heat", "MWh"),
        ("ghi_kW_m2", "q_sol", "kW/m2"),
        ("Supply water temp", None, None),
        ("Current Humidity (%RH)", None, None),
        ("T_ctrl", "T_za", None),
        ("Sensor 3", None, None),
        ("Heat pump electricity [kWh]", "Q_heat", "kWh"),
        ("Heat pump power [kW]", "Q_heat", "kW"),
        ("Heat pump status", "u_heat", None),
        ("Heat pump supply temp", None, None),
        ("Heat pump circulation pump", None, None),
        ("Htg SP (°F)", "T_heat_set", "degF"),
        ("Clg SP (°F)", "T_cool_set", "degF"),
        ("Clg SP", "T_cool_set", None),
        ("Htg Valve (%)", "u_heat", "percent"),
        ("Clg Valve (%)", "u_cool", "percent"),
        ("CHW Valve", "u_cool", None),
        ("HHW Valve", "u_heat", None),
        ("CHW supply temp", None, None),
        ("sensor.heat_meter", "Q_heat", None),
        ("Wärmezähler", "Q_heat", None),
        ("Wärmemengenzähler (GJ)", "Q_heat", "GJ"),
        ("Kältezähler", "Q_cool", None),
        ("Cooling energy", "Q_cool", None),
        ("HVAC Heat Rate", "Q_hvac", None),
        ("Room Temp Offset", None, None),
        ("Heating Alarm", None, None),
        ("Heating degree days", None, None),
        ("PV Power [kW]", None, "kW"),
        ("Total power", None, None),
        ("Household consumption [kWh]", None, "kWh"),
        ("Heat pump compressor [Hz]", "u_heat", None),
        ("Compressor stage", "u_cool", None),
        ("climate.kitchen.heating", "u_heat", None),
        ("Heat/cool valve", None, None),
        ("Heat/cool setpoint", "T_heat_set", None),
        ("Cold energy today", "Q_cool", None),
        ("Heat counter [m3]", None, None),
        ("Boiler gas (m³)", None, None),
        ("HW meter kBtu", None, "kBtu"),
        ("Globalstrahlung [J/cm²]", "q_sol", "J/cm2"),
        ("GHI Wh/m2", "q_sol", "Wh/m2"),
        ("VAV-1 Eff Clg Stpt", "T_cool_set", None),
        ("VAV-1 HtgSpt", "T_heat_set", None),
        ("EFFCLG-SP", "T_cool_set", None),
        ("Clg Setpt", "T_cool_set", None),
        ("ZN-T", "T_za", None),
        ("setting.power", None, None),
        ("T° ambiante", "T_za", None),
        ("Température ambiante extérieure", "T_oa", None),
        ("Compteur de chaleur", "Q_heat", None),
        ("compteur_chaleur_kWh", "Q_heat", "kWh"),
        ("Kessel Modulation %", "u_heat", "percent"),
        ("Cooling (tons)", "Q_cool", "tons"),
        ("Room thermometer", None, None),
        ("temperature_2m (°C)", "T_oa", "degC"),
        ("Zone Total Heating Rate [W](TimeStep)", "Q_heat", "W"),
        ("Heating output BTU/h", "Q_heat", "Btu/h"),
        ("Heating (therms)", "Q_heat", "therm"),
        ("Heat Pump (kWhs)", "Q_heat", "kWh"),  # it was a stage in percent
        ("Heat (kW-hr)", "Q_heat", "kWh"),  # it was kW
        ("Heating (Gcal)", "Q_heat", "Gcal"),  # it was kW, as were those below
        ("Heating (MMBtu/hr)", "Q_heat", "MMBtu/h"),
        ("Heating power (kWth)", "Q_heat", "kW"),
        ("Heating power (MBtu/h)", None, None),  # thousands, or millions
        ("Heat (kW/h)", None, None),
        ("Radiation (mW/cm²)", None, None),
        ("Cooling energy (ton-hours)", "Q_cool", "ton-h"),
        ("Heating power (kcal/h)", "Q_heat", "kcal/h"),
        ("Heizung Gas m³", None, None),
        ("Compressor power (W)", "Q_cool", "W"),
        ("Temperatura pokoju", "T_za", None),
        ("Temperatura zewnętrzna", "T_oa", None),
        ("Zużycie ciepła kWh", "Q_heat", "kWh"),
        ("Temperatura zadana", "T_heat_set", None),
        ("Rumstemperatur", "T_za", None),
        ("Utomhustemperatur", "T_oa", None),
        ("Værelse køling kW", "Q_cool", "kW"),
        ("Värmeeffekt kW", "Q_heat", "kW"),
        ("Börvärde värme", "T_heat_set", None),
        ("Potência de aquecimento (kW)", "Q_heat", "kW"),
        ("Temperatura interna", "T_za", None),
        ("室温", "T_za", None),
        ("室外温度", "T_oa", None),
        ("暖房出力 [kW]", "Q_heat", "kW"),
        ("Heating_kWh_15min", "Q_heat", "kWh"),  # it was a stage in percent
        ("P_heating_kW_1", "Q_heat", "kW"),
        ("GHI kW/m2 avg", "q_sol", None),
        ("Heat pump cooling electricity [kWh]", "Q_cool", "kWh"),  # it was left out beside that of heating
        ("Heat pump heating electricity [kWh]", "Q_heat", "kWh"),
        ("Wärmepumpe Kühlen [%]", "u_cool", "percent"),
        ("AC heat pump power kW", "Q_hvac", "kW"),
        ("Fan coil cooling [%]", "u_cool", "percent"),  # nothing read it
        ("Fan coil fan [%]", None, "percent"),
        ("Ventilation [%]", None, "percent"),  # it was a radiator's valve
        ("Ventilöffnung [%]", "u_heat", "percent"),
        ("Solar thermal power [kW]", None, "kW"),  # it was the plant's heat
        ("Zone Windows Total Heat Gain Rate [W]", None, "W"),
        ("Heat recovery efficiency [%]", None, "percent"),
        ("target_temp_low", "T_heat_set", None),
        ("target_temp_high", "T_cool_set", None),  # it was that of heating
        ("Upper floor setpoint", "T_heat_set", None),
        ("Occupied Cooling Setpoint", "T_cool_set", None),  # nothing read it
        ("Boiler setpoint", None, None),  # it was a room's, in degF
        ("Boiler room setpoint", "T_heat_set", None),
        ("zone outdoor_temp", "T_oa", None),  # it was a room's
    ],
)
def test_names_in_the_languages_of_buildings(name, role, unit):
    assert unit_in_name(name) == unit
    assert guess_role(name, unit).role == role


def test_a_counter_of_hours_or_starts_is_no_meter_of_heat():
    """Their values only rise, so they were read as kWh."""
    for name in ("Betriebsstundenzähler Brenner", "Heating starts counter"):
        assert guess_role(name).role == "u_heat"  # whose values, as those of a counter, are refused
    for name in ("Heat counter", "Hourly heat counter", "Stundenwert Wärmezähler"):
        assert guess_role(name).role == "Q_heat"


def test_two_set_points_without_a_side_are_the_lower_and_the_upper():
    found = assign_zone_roles(dict.fromkeys(("Max setpoint", "target_temp_high", "target_temp_low")))
    assert [guess.role for guess in found.values()] == [None, "T_cool_set", "T_heat_set"]


def test_a_name_without_a_quantity_says_so():
    for name in ("outdoor", "woonkamer"):
        assert guess_role(name).reason == "its name says where it measures, but not what"


def test_the_set_point_in_force_and_the_whole_sun_count():
    names = ("Occ Htg Stpt", "Night heating setpoint", "Htg Stpt", "Eff Htg Stpt")
    for better, other in (
        ("GHI W/m2", "DNI W/m2"), ("shortwave_radiation", "diffuse_radiation"), ("Zone temp", "Zone floor temp"),
        ("Außentemperatur", "Außentemperatur gedämpft"),
    ):  # fmt: skip
        assert [guess.role is None for guess in assign_zone_roles({other: None, better: None}).values()] == [
            True,
            False,
        ]
    for n in (2, 3, 4):
        roles = {name: guess.role for name, guess in assign_zone_roles(dict.fromkeys(names[:n])).items()}
        assert roles == dict.fromkeys(names[:n]) | {names[max(n - 1, 2) if n > 2 else 0]: "T_heat_set"}


@pytest.mark.parametrize(("last", "is_heat"), [("on", False), ("0.7", True)])
def test_a_column_of_on_and_off_is_no_heat(tmp_path, last, is_heat):
    rows = "".join(f"2024-01-01 {h:02d}:00,{20 + h / 10},{'on' if h > 11 else 'off'}\n" for h in range(24))
    (tmp_path / "log.csv").write_text(
        f"time,room temp,Heating power\n{rows}2024-01-02 00:00,20,{last}\n", encoding="utf-8"
    )
    report = LogReport(read_log(tmp_path / "log.csv"))
    assert ("Q_heat" in report.roles) == is_heat
    assert ("give u_heat or u_cool" in report.columns.loc["Heating power", "reason"]) == (not is_heat)


@pytest.mark.parametrize(
    ("names", "used"),
    [
        (("Heat pump electrical power (W)", "Heat pump thermal output (W)"), 1),
        (("HP power consumed kW", "HP power produced kW"), 1),
        (("HVAC power (kW)", "Heat meter (Wh)"), 0),
        (("Heating stage", "Heating power (kW)"), 1),
    ],
)
def test_of_two_meters_of_one_heat_one_is_taken(names, used):
    """Electricity of a heat pump stood for its heat, and a part of the heat was added to all of it."""
    found = assign_zone_roles({name: unit_in_name(name) for name in names})
    assert [guess.role is not None for guess in found.values()] == [place == used for place in range(2)]
    assert "was taken for the same quantity" in found[names[1 - used]].reason


def test_a_column_without_values_has_a_role_only_where_it_is_given(frame):
    """The configuration that it was proposed for could not be fitted."""
    valve, sun, room = "Heizung Ventil (%)", "Globalstrahlung (W/m²)", "Raumtemperatur [°C]"
    log = frame.assign(**{valve: np.nan, sun: np.nan, "Heizung 2 (%)": 50.0, "cooling": np.nan})
    found = LogReport(log)
    assert found.roles["u_heat"] == "Heizung 2 (%)"
    assert {"u_cool", "q_sol"}.isdisjoint(found.roles)
    assert found.columns["reason"][[valve, sun, "cooling"]].tolist() == ["no row has a number"] * 3
    given = LogReport(log, {"T_za": room, "T_oa": "Außentemperatur [°C]", "u_heat": valve})
    assert any(f.where == valve and f.text == "no row has a number." for f in given.findings)
    assert "T_za" in LogReport(frame.assign(**{room: np.nan})).roles  # an error is told of it


def test_a_role_has_one_column():
    found = assign_zone_roles({"Room A temp": None, "Room B temp": None, "hvac kW": "kW", "heat valve": None})
    assert found["Room A temp"].role == "T_za"
    assert found["Room B temp"].role is None
    assert "'Room A temp'" in found["Room B temp"].reason
    assert found["heat valve"].role is None  # its heat is measured


def test_the_reason_of_a_role_that_was_given():
    found = assign_zone_roles({"Sensor 3": None, "T_oa": None}, {"T_za": "Sensor 3", "T_oa": "T_oa"})
    assert [guess.reason for guess in found.values()] == ["it was given", NAMED_BY_ROLE]


def test_what_was_read(frame):
    report = LogReport(frame)
    assert report.roles == {
        "T_za": "Raumtemperatur [°C]",
        "T_oa": "Außentemperatur [°C]",
        "q_sol": "Globalstrahlung (W/m²)",
        "u_heat": "Heizung Ventil (%)",
    }
    assert report.frame["q_sol"].max() == pytest.approx(0.4)
    assert report.frame["u_heat"].max() == pytest.approx(0.6)
    assert report.days == {"working days": 8, "weekend days": 2}
    assert str(report.step) == "0 days 00:15:00"
    assert "'Luftfeuchte (%)', because" in str(report)
    assert not [f for f in report.findings if f.level != "note"]
    json.dumps(report.to_dict(), allow_nan=False)
    page = report._repr_html_()
    assert '<tr class="off"><td>Luftfeuchte (%)</td><td>unused</td><td></td>' in page
    assert "nan" not in page


def test_values_tell_a_unit_that_names_do_not(frame):
    plain = frame.set_axis(["room temp", "outdoor temp", "solar", "heat valve", "humidity"], axis=1)
    report = LogReport(plain.assign(**{name: plain[name] * 1.8 + 32 for name in ("room temp", "outdoor temp")}))
    assert report.columns.loc[["room temp", "outdoor temp"], "unit"].tolist() == ["degF", "degF"]
    assert report.columns.loc["solar", "unit"] == "W/m2"
    assert report.columns.loc["heat valve", "unit"] == "percent"
    assert report.columns["assumed"].sum() == 4
    assert report.frame["T_za"].mean() == pytest.approx(frame.iloc[:, 0].mean())
    assert any("kW of u_heat" in text for text in report.cannot)


def test_seconds_of_a_stage_are_not_scaled_by_their_largest_value(frame):
    seconds = pd.DataFrame({"Room Temp (C)": frame.iloc[:, 0], "Heat Stage 1 (sec)": 90.0}, index=frame.index)
    assert LogReport(seconds).frame["u_heat"].iloc[0] == pytest.approx(90 / 900)
    raw = RawLog(seconds, "ecobee", {"Heat Stage 1 (sec)": "s"}, scale={"Heat Stage 1 (sec)": 1 / 300})
    assert LogReport(raw).frame["u_heat"].iloc[0] == pytest.approx(0.3)


def test_seconds_of_a_stage_are_not_among_the_units_that_are_not_converted(tmp_path):
    rows = [f"2024-01-15 00:{m:02d},20.0,{60 * (m % 20)},{m}" for m in range(0, 60, 5)]
    (tmp_path / "log.csv").write_text(
        "\n".join(["time,Room temp (°C),Heat Stage 1 (sec),Wind (m/s)", *rows]), encoding="utf-8"
    )
    (note,) = [note for note in read_log(tmp_path / "log.csv").notes if "not converted" in note]
    assert "'Wind (m/s)' in m/s" in note
    assert "Heat Stage" not in note


def test_a_stage_beyond_every_known_scale_is_not_used(frame):
    odd = frame.iloc[:, :2].assign(**{"Heizung Ventil": np.arange(960) % 256.0})
    report = LogReport(odd)
    assert "u_heat" not in report.roles
    assert report.columns.loc["Heizung Ventil", "reason"] == (
        "values reach 255, beyond 100 %; give u_heat and 1 / its full scale under [scale] if it is a stage, or Q_heat "
        "and its unit if it is heat"
    )
    known = {"T_za": frame.columns[0], "u_heat": "Heizung Ventil"}
    assert LogReport(odd, known, scale={"u_heat": 1 / 255}).frame["u_heat"].max() == 1.0
    assert LogReport(odd, known).findings[0].level == "error"  # not scaled by its largest value


def test_values_below_zero_are_those_of_no_stage(frame):
    valve = frame.columns[3]
    log = frame.rename(columns={valve: "Heating"}).assign(Heating=frame[valve] - 20.0)
    report = LogReport(log)
    assert "u_heat" not in report.roles
    assert report.columns.loc["Heating", "reason"] == (
        "values from -15 to 40 are not those of a stage; give Q_heat and its unit if it is heat"
    )
    offset = log.assign(Heating=frame[valve] - 5.2)  # of a sensor at rest
    assert LogReport(offset).roles["u_heat"] == "Heating"


def test_a_counter_is_no_stage(frame):
    """The m3 of a gas meter, below 100, were taken for percent."""
    counter = np.arange(len(frame)) // 20 * 0.1
    report = LogReport(frame.assign(**{"Heating gas": counter}).drop(columns=frame.columns[3]))
    assert "u_heat" not in report.roles
    assert (
        "values only rise, as those of a counter; if it counts heat, give Q_heat"
        in report.columns.loc["Heating gas", "reason"]
    )
    given = LogReport(report.raw.frame, {"Q_heat": "Heating gas"}, {"Q_heat": "kWh counter"}, {"Q_heat": 10.0}).frame[
        "Q_heat"
    ]
    assert given.sum() * 0.25 == pytest.approx(10.0 * counter[-1], rel=0.03)


def test_a_meter_without_a_unit_is_a_counter(frame):
    meter = 1200.0 + np.arange(960) // 2
    report = LogReport(frame.iloc[:, :2].assign(Wärmezähler=meter))
    assert report.columns.loc["Wärmezähler", ["role", "unit", "assumed"]].tolist() == ["Q_heat", "kWh counter", True]


def test_a_counter_of_wh_is_not_called_one_of_watts(frame):
    """Readings taken for W would be a heat that grows from day to day."""
    meter = 1000.0 * np.cumsum(0.5 + 0.5 * (frame.index.hour > 6))
    report = LogReport(frame.iloc[:, :2].assign(Wärmezähler=meter))
    (asked,) = (one.text for one in report.findings if "4000 kW" in one.text)
    assert asked == "values reach 4000 kW: does it count Wh? Then give 'Wh counter' as its unit."


def test_meters_become_kilowatts(frame):
    power = pd.Series(np.where(frame.index.hour > 6, 4.0, 1.0), index=frame.index)
    counter = (power * 0.25).cumsum().shift(fill_value=0.0) + 17000.0
    report = LogReport(frame.iloc[:, :2].assign(**{"Heat meter (kWh)": counter}))
    np.testing.assert_allclose(report.frame["Q_heat"].iloc[:-1], power.iloc[:-1], rtol=1e-9)
    per_row = LogReport(frame.iloc[:, :2].assign(**{"Heat (kWh)": power * 0.25}))
    np.testing.assert_allclose(per_row.frame["Q_heat"], power)


def test_power_of_a_meter_begins_at_its_reading_whatever_the_label(frame):
    """Readings are of their stamps; only means have a label."""
    power = pd.Series(np.where(frame.index.hour > 6, 4.0, 1.0), index=frame.index)
    meter = (power * 0.25).cumsum().shift(fill_value=0.0).where(frame.index.minute == 0) + 17000.0
    raw = RawLog(frame.iloc[:, :1].set_axis(["room"], axis=1).assign(meter=meter), "csv")
    channels = channels_of(raw, {"T_za": "room", "Q_hvac": "meter"}, {"Q_hvac": "kWh"}, {})
    left = to_roles(raw, channels)
    assert left["Q_hvac"].notna().sum() == 239  # hours but for the last
    without = roles_without_label(raw, channels)
    right = to_left_label(left.assign(q_sol=1.0), without)
    pd.testing.assert_series_equal(right["Q_hvac"], left["Q_hvac"].iloc[:-1], check_freq=False)
    assert without == ["Q_hvac"]


def test_a_meter_that_hardly_moves_is_a_counter(frame):
    slow = 12345.0 + np.arange(960) // 200  # four rises in ten days
    report = LogReport(frame.iloc[:, :2].assign(**{"Heat meter (kWh)": slow}))
    assert report.frame["Q_heat"].sum() == pytest.approx(4 * 4.0)  # four times 1 kWh in a quarter of an hour
    starts = np.where(np.arange(960) > 950, 2.0, 0.0)  # heat per row of a plant that starts at the end
    assert LogReport(frame.iloc[:, :2].assign(**{"Heat (kWh)": starts})).frame["Q_heat"].iloc[-1] == pytest.approx(8.0)


def test_irradiation_of_each_row_becomes_irradiance(frame):
    """J/cm2 of a weather service, and Wh/m2, were read as W/m2."""
    room, outdoor, sun = frame.columns[:3]
    truth = frame[sun] / 1000.0
    for unit, factor in (("Wh/m²", 250.0), ("J/cm2", 90.0), ("MJ/m2", 0.9)):
        report = LogReport(frame[[room, outdoor]].assign(**{f"Global radiation [{unit}]": factor * truth}))
        np.testing.assert_allclose(report.frame["q_sol"], truth)
        assert f'q_sol = "{unit.replace("²", "2")}"' in propose_settings("log.csv", report)


def test_set_points_of_a_plant_that_is_off(frame, tmp_path):
    """0 degC would be a set-point to cool to; the word off is none."""
    log = frame.iloc[:, :2].assign(**{"Cooling setpoint": np.where(frame.index.hour < 7, 0.0, 24.0)})
    report = LogReport(log)
    assert report.frame["T_cool_set"].isna().sum() == 280
    assert ("Cooling setpoint", "280 values such as 0 taken as missing.") in [f[1:] for f in report.findings]
    heating = LogReport(log.rename(columns={"Cooling setpoint": "Heating setpoint"}))
    assert "is 0 degC in 280 rows: if the plant is off then, leave them empty." in [f.text for f in heating.findings]
    log.assign(**{"Cooling setpoint": np.where(frame.index.hour < 7, "Off", "24")}).to_csv(tmp_path / "log.csv")
    words = LogReport(read_log(tmp_path / "log.csv"))
    assert words.frame["T_cool_set"].isna().sum() == 280


def test_a_counter_stays_one_in_rows_that_do_not_show_it(frame):
    """A proposal names it, so that the meaning of a column does not change with the rows at hand."""
    meter = pd.Series(17000.0 + np.arange(960.0), index=frame.index, name="Heat (kWh)")
    report = LogReport(frame.iloc[:, :1].assign(**{meter.name: meter}))
    assert report.columns.loc[meter.name, "unit"] == "kWh counter"
    assert 'Q_heat = "kWh counter"' in propose_settings("log.csv", report)
    few, standing = meter[:4], pd.Series(17000.0, frame.index, name=meter.name)
    for rows, power in ((few, [4.0, 4.0, 4.0]), (standing, np.zeros(959))):
        raw = RawLog(rows.to_frame(), "csv", {meter.name: "kWh"})
        channels = channels_of(raw, {"Q_heat": meter.name}, {"Q_heat": "kWh counter"}, {})
        np.testing.assert_allclose(to_roles(raw, channels)["Q_heat"][:-1], power)


def test_a_column_with_fewer_rows_than_others_has_a_step_of_its_own(frame):
    hourly = pd.Series(np.where(np.arange(960) % 4 == 0, 3.0, np.nan), index=frame.index)  # of each hour
    report = LogReport(frame.iloc[:, :2].assign(**{"Heat (kWh)": hourly}))
    assert report.frame["Q_heat"].dropna().unique().tolist() == [3.0]
    assert report.excitation.loc["Q_heat", "hours run"] == pytest.approx(240.0)
    run = LogReport(frame.iloc[:, :2].assign(**{"Heat Stage 1 (min)": 10.0 * hourly}))
    assert run.frame["u_heat"].dropna().unique().tolist() == [0.5]


@pytest.mark.parametrize(("part", "words"), [(0.1, "tenths of a degree"), (0.01, "hundredths of a degree")])
def test_whole_numbers_of_parts_of_a_degree(frame, part, words):
    """As Modbus and Zigbee write them: 205 was read as degF, and 260 as K."""
    room, outdoor = frame.columns[:2]
    names = {room: "room temp", outdoor: "outdoor temp"}
    log = frame.rename(columns=names)[list(names.values())].assign(**{"heating set-point": 21.0})
    report = LogReport((log / part).round())
    assert report.columns["scale"].tolist() == [part, part, part]
    np.testing.assert_allclose(report.frame, log, atol=part)
    assert any(f"are those of {words}" in finding.text for finding in report.findings)
    assert f"[scale]\nT_za = {part}\nT_oa = {part}\nT_heat_set = {part}\n" in propose_settings("log.csv", report)
    degrees = LogReport((log / part).round().assign(**{"outdoor temp": log["outdoor temp"]}))  # of a weather service
    np.testing.assert_allclose(degrees.frame["T_oa"], log["outdoor temp"])


def test_outdoor_temperature_of_a_cold_log_is_in_the_unit_of_the_room(frame):
    room = 68.0 + np.sin(np.arange(960) / 9)
    cold = pd.DataFrame({"Room Temp": room, "Outdoor Temp": 20.0 + 15.0 * np.sin(np.arange(960) / 30)}, frame.index)
    report = LogReport(cold)
    assert report.columns.loc["Outdoor Temp", ["unit", "assumed"]].tolist() == ["degF", True]
    assert report.frame["T_oa"].max() < 2.0
    named = cold.rename(columns={"Outdoor Temp": "T_oa"})
    assert LogReport(named.rename(columns={"Room Temp": "Room Temp (°F)"})).columns.loc["T_oa", "unit"] == "degC"
    assert LogReport(named.rename(columns={"Room Temp": "T_za"})).columns.loc["T_oa", "unit"] == "degF"


def test_a_stuck_sensor_is_found_and_not_used(frame):
    room = frame.columns[0]
    frame.loc["2024-01-18":"2024-01-19", room] = 19.5
    found = [f for f in LogReport(frame).findings if f.where == room]
    assert "stuck" in found[0].text
    assert "2024-01-18" in found[0].text
    cleaned = without_standstills(frame, room)
    assert cleaned["2024-01-18":"2024-01-19"].notna().sum() == 1
    assert cleaned["2024-01-20":].notna().all()


@pytest.mark.parametrize("zone", ["", "_hall"])
def test_a_room_that_its_plant_holds_is_not_stuck(zone):
    """A simulation holds its set-point exactly for days; a stuck sensor lets no control change the heat."""
    index = pd.date_range("2024-01-15", periods=240, freq="1h", tz="Europe/Berlin")
    wave = np.sin(np.arange(240) / 4)
    T, Q, low = f"T_za{zone}", f"Q_hvac{zone}", f"T_heat_set{zone}"
    frame = pd.DataFrame({T: 20.0 + wave, "T_oa": wave, Q: 3.0 + wave, low: 21.0}, index)
    at, n = slice(48, 120), 72
    for value, heat, n_stuck in ((21.0, 3.0 + wave[at], 0), (21.0, 3.0, n), (20.5, 3.0 + wave[at], n)):
        spell = frame.copy()
        spell.iloc[at, [0, 2]] = np.column_stack([np.full(n, value), np.broadcast_to(heat, n)])
        assert without_standstills(spell, T).isna().sum() == max(n_stuck - 1, 0)
        said = [f.text for f in LogReport(spell, {name: name for name in spell}).findings if f.where == T]
        assert len([text for text in said if "stuck" in text]) == bool(n_stuck)
    outdoors = frame.assign(T_oa=frame["T_oa"].mask(np.isin(np.arange(240), np.arange(48, 120)), 21.0))
    assert [text for text in doubts_on_temperatures(outdoors, [T]) if text.startswith("T_oa is 21 degC")]  # no plant


@pytest.mark.parametrize("name", ["Q_hvac", "Q_heat", "Q_hvac_hall", "Q_hall"])
def test_cooling_that_is_positive_is_asked_about(name):
    """No heater runs for hours while it is hotter outdoors than in the room."""
    office = make_office(14, "chicago", start="2023-07-10", random_state=2)
    role, zone = (
        "T_za_hall" if name.endswith("hall") else "T_za",
        office.X.drop(columns=["u_heat", "u_cool"]),
    )
    log, heat = zone.rename(columns={"T_za": role}), 6.0 * office.X["u_heat"] - 6.0 * office.X["u_cool"]
    columns = {column: column for column in (*log, name)}
    asked = []
    for values in (heat.abs(), heat.clip(lower=0.0), heat, 0.0 * heat):
        found = LogReport(log.assign(**{name: values}), columns, scaled=[]).findings
        asked.append([(f.level, f.where) for f in found if "is it cooling" in f.text])
    assert asked == [[("warning", name)], [], [], []]
    known = LogReport(log.assign(**{name: heat.abs()}), columns, scaled=[name])  # electricity, which is positive
    assert not [f for f in known.findings if "is it cooling" in f.text]


def test_a_room_and_outdoors_that_are_swapped_are_found(frame):
    names = ["Raumtemperatur [°C]", "Außentemperatur [°C]"]
    assert not [f for f in LogReport(frame).findings if "swapped" in f.text]
    found = LogReport(frame.rename(columns=dict(zip(names, names[::-1], strict=True)))).findings
    words = "T_za goes from -2 to 8 degC while T_oa stays within 19 to 21 degC: are the two columns swapped?"
    assert [(f.level, f.where, f.text) for f in found if "swapped" in f.text] == [("warning", names[0], words)]
    two_rooms = frame.rename(columns={names[0]: "T_za_hall", names[1]: "T_oa"}).assign(T_za_attic=frame[names[1]])
    outdoors = LogReport(two_rooms, {role: role for role in ("T_oa", "T_za_hall", "T_za_attic")})
    assert not [f for f in outdoors.findings if "swapped" in f.text], "a cold attic is as cold as it is outdoors"


def test_what_contradicts_itself_is_an_error(frame):
    room, out = frame.columns[:2]
    same = LogReport(frame.assign(**{out: frame[room]})).findings[0]
    assert (same.level, same.where) == ("error", room)
    assert same.text == "T_za and T_oa hold the same values; one is of another column."
    crossed = LogReport(frame.assign(T_heat_set=24.0, T_cool_set=np.where(np.arange(960) < 3, 26.0, 21.0))).findings[0]
    words = f"is above T_cool_set in 957 rows, first at {frame.index[3]}: are they swapped?"
    assert (crossed.level, crossed.where, crossed.text) == ("error", "T_heat_set", words)


@pytest.mark.parametrize(("zone", "side"), [("", "T_heat_set"), ("_hall", "T_heat_set"), ("", "T_cool_set")])
def test_a_plant_that_fails_for_days_is_told(zone, side):
    index = pd.date_range("2024-01-15", periods=240, freq="1h", tz="Europe/Berlin")
    sign = 1.0 if side == "T_heat_set" else -1.0
    T, wanted = f"T_za{zone}", 20.0 + 6.0 * sign * (index.hour >= 6)  # a set-back, after which it takes a morning
    held = wanted - sign * np.select([index.hour == 6, index.hour == 7], [5.0, 3.5], 0.0)
    frame = pd.DataFrame({T: held, "T_oa": np.sin(np.arange(240) / 4), side: wanted, "Q_hvac": 2.0 * sign}, index)
    slow = frame.copy()
    slow.iloc[100:130, 0] = wanted[100:130] - sign * np.linspace(9.0, 3.5, 30)  # it comes back, but slowly

    def found(log):
        said = LogReport(log, {name: name for name in log}).findings
        return [(f.level, f.where, f.text) for f in said if "did the plant fail" in f.text]

    assert not found(frame)
    assert not found(slow)
    failed = frame.copy()
    failed.iloc[100:160, 0] = 20.0 - sign * np.linspace(4.0, 14.0, 60)
    beyond = "below" if sign > 0 else "above"
    text = f"is more than 3 K {beyond} {side} from {index[100]} to {index[159]}: did the plant fail?"
    (level, where, said), *others = found(failed)
    assert (level, where, others) == ("warning", T, [])
    assert said.startswith(text)
    assert not found(failed.drop(columns="Q_hvac").assign(**{"u_cool" if sign > 0 else "u_heat": 0.5}))
    if zone:  # what heats another room tells nothing of this one
        other = "u_cool_hall" if sign > 0 else "u_heat_hall"
        assert not found(failed.drop(columns="Q_hvac").assign(**{"T_za_attic": held, other: 0.5, "Q_hvac_attic": 2.0}))


@pytest.mark.parametrize("number", [1, 2, 3])
def test_no_room_of_a_shipped_log_is_taken_for_outdoors(number):
    log = load_dutch_home(number).X
    swap = {"T_za": "T_oa", "T_oa": "T_za"}
    found = [[f for f in LogReport(X).findings if "swapped" in f.text] for X in (log, log.rename(columns=swap))]
    assert [len(some) for some in found] == [0, 1]


def test_a_column_that_changes_its_unit_is_an_error(frame):
    room = frame.columns[0]
    mixed = frame[room].where(frame.index < "2024-01-20", frame[room] * 1.8 + 32)
    assert unit_switch(mixed) == pd.Timestamp("2024-01-20", tz="Europe/Berlin")
    assert unit_switch(frame[room]) is None
    first = LogReport(frame.assign(**{room: mixed})).findings[0]
    assert first.level == "error"
    assert "2024-01-20 00:00" in first.text


def test_jumps_gaps_duplicates_and_the_clock(frame):
    room = frame.columns[0]
    frame.iloc[400, 0] += 9.0
    naive = frame.tz_localize(None)
    broken = pd.concat([naive.iloc[:200], naive.iloc[240:500], naive.iloc[499:]])
    report = LogReport(broken)
    texts = {f.where: f.text for f in report.findings if f.level == "warning"}
    assert "jumps by" in texts[room]
    assert any("1 stamp occurs twice" in f.text for f in report.findings)
    assert any("no time zone" in f.text for f in report.findings)
    assert report.gaps["hours"].tolist() == [10.25]
    shifted = LogReport(frame.set_axis(frame.index + pd.Timedelta("6h"), axis=0))
    assert any("culminates at 18:" in f.text for f in shifted.findings)


@pytest.mark.parametrize(("day", "n_told"), [("2023-10-29", 1), ("2023-10-24", 2)])
def test_a_clock_that_was_put_back_is_told_on_a_sunday_of_autumn(day, n_told):
    index = pd.date_range(day, periods=48, freq="1h")
    twice = pd.DatetimeIndex([*index[:3], *index[2:]])
    texts = [f.text for f in clock_findings(twice, pd.Timedelta("1h"), "left") if f.level == "warning"]
    assert len(texts) == n_told
    assert texts[0].startswith(
        f"the clock of the stamps has daylight saving: an hour occurs twice from {day} 02:00:00; give timezone"
    ) == (n_told == 1)


@pytest.mark.parametrize(("months", "hour"), [("2023-10", "occurs twice from 2023-10-29 02"),
                                              ("2024-03", "is missing after 2024-03-31 01:45")])  # fmt: skip
def test_one_change_of_clocks_is_one_warning(frame, months, hour):
    index = pd.date_range(f"{months}-10", periods=len(frame) * 4, freq="15min", tz="Europe/Berlin")
    sun = 0.5 * np.sin((index.tz_convert("UTC").hour - 6.0) / 12.0 * np.pi).to_numpy().clip(0.0)
    log = pd.DataFrame({"Room [°C]": 20.0 + np.arange(len(index)) % 7, "Sun [kW/m2]": sun}, index.tz_localize(None))
    (found,) = (f for f in LogReport(log).findings if f.level == "warning")
    assert f"has daylight saving: an hour {hour}" in found.text
    assert "sun rises and sets" in str(LogReport(log.drop(index=log.index[log.index.day_of_week == 6])))


def test_electricity_is_not_taken_for_heat(frame):
    report = LogReport(frame.iloc[:, :2].assign(**{"Wärmepumpe Strom (kW)": 1.0 + np.arange(960) % 7}))
    assert report.electricity() == ["Q_heat"]
    assert any("coefficient of performance" in f.text for f in report.findings)
    assert any(text.startswith("kW of Q_heat") for text in report.cannot)
    told = LogReport(report.raw, report.roles, scaled=["Q_heat"])
    assert not any("coefficient of performance" in f.text for f in told.findings)
    assert not any(text.startswith("kW of") for text in told.cannot)


@pytest.mark.parametrize(
    "name",
    ["Heat pump electricity [kW]", "Heat pump power [kW]", "Heat Pump Energy (kWh)", "warmtepomp_vermogen_kW",
     "Waermepumpe [kW]", "Pompe à chaleur (kW)"],
)  # fmt: skip
def test_a_heat_pump_is_electricity_with_a_proposed_plant(frame, name):
    report = LogReport(frame.iloc[:, :2].assign(**{name: 1.0 + np.arange(960) % 7}))
    assert report.electricity() == ["Q_heat"]
    assert "\n[plant]\nelectricity = true" in propose_settings("log.csv", report)


@pytest.mark.parametrize("name", ["WP Heizleistung [kW]", "Heat pump thermal power [kW]"])
def test_the_heat_of_a_heat_pump_is_heat(frame, name):
    report = LogReport(frame.iloc[:, :2].assign(**{name: 1.0 + np.arange(960) % 7}))
    assert report.roles["Q_heat"] == name
    assert report.electricity() == []


def test_what_a_log_cannot_tell(frame):
    without_plant = LogReport(frame.iloc[:, :2])
    assert any("no column shows when the plant ran" in text for text in without_plant.cannot)
    room, outdoor, _, valve, _ = (frame[name] for name in frame)
    rooms = pd.DataFrame({"T_za_a": room, "T_za_b": room + 1.0, "T_oa": outdoor, "u_heat": valve / 100.0})
    shared = LogReport(rooms, {name: name for name in rooms})
    assert "tomorrow from set-points: the zones share the plant u_heat." in shared.cannot
    assert not any("no set-point is logged" in text for text in shared.cannot)
    alone = LogReport(frame)
    assert any("no set-point is logged" in text for text in alone.cannot)
    assert "a day-ahead forecast of the temperature, from 10 days (two weeks would be better)." in alone.can
    unnamed = LogReport(frame.iloc[:, [0]].set_axis(["Sensor 3"], axis=1))
    assert any("no room temperature" in text for text in unnamed.cannot)
    assert unnamed.roles == {}


def test_days_of_a_log_of_changes_are_counted_after_holding(frame):
    """Its channels share no stamps, and few rows have the room's temperature."""
    rounded = frame.iloc[:, :4].round(1)
    parts = [
        rounded.iloc[:, [k]][rounded.iloc[:, k] != rounded.iloc[:, k].shift()].shift(freq=f"{60 * k + 7}s")
        for k in range(4)
    ]
    changes = pd.concat(parts).sort_index()
    report = LogReport(RawLog(changes, "change of value", held=frozenset(rounded)))
    assert sum(report.days.values()) in (9, 10)
    assert not [f for f in report.findings if "no value" in f.text]
    assert report.excitation.loc["u_heat", "hours run"] == pytest.approx(10 * (13.75 + 10.25 / 12), rel=0.01)
    text = propose_settings("log.csv", report)
    assert "\n[train]\nstart = 2024-01-1" in text
    assert 'step = "15min"' in text


def test_no_rows_are_refused():
    with pytest.raises(ValueError, match="no time stamps"):
        LogReport(pd.DataFrame({"a": [1.0]}))
    with pytest.raises(ValueError, match="two are the least"):
        LogReport(pd.DataFrame({"a": [1.0]}, index=pd.DatetimeIndex(["2024-01-01"])))


def test_a_column_that_the_log_lacks_is_refused(frame):
    """``check`` took another column for the room in its place, and said nothing of the slip."""
    with pytest.raises(ValueError, match="T_za is to be the column 'Rom temp', but the log has "):
        LogReport(frame, {"T_za": "Rom temp"})
    with pytest.raises(ValueError, match="label='end' must be 'left', 'right' or None"):
        LogReport(frame, label="end")


def test_the_report_as_json_has_blanks_and_stamps_that_occur_twice(frame):
    blank = frame.mask(np.arange(len(frame))[:, None] + np.arange(frame.shape[1]) < 2)
    twice = pd.concat([blank.iloc[:2], blank]).sort_index(kind="stable")
    told = json.loads(json.dumps(LogReport(twice).to_dict(), allow_nan=False))
    assert list(told["first_rows"]) == [str(stamp) for stamp in frame.index[:3]]
    assert told["timezone"] == "Europe/Berlin"
    assert None in next(iter(told["first_rows"].values())).values()


@pytest.mark.parametrize(("role", "unit"), [("T_za", "kWh/m2"), ("T_oa", "MJ/m2"), ("u_heat", "Wh/m2")])
def test_a_unit_of_irradiation_is_for_the_sun_alone(role, unit):
    """A temperature in kWh/m2 was four times as high, and one in MJ/m2 about the same."""
    log = pd.DataFrame(
        {name: np.arange(96.0) % 7 for name in ("T_za", "T_oa", "u_heat")},
        pd.date_range("2024-01-01", periods=96, freq="15min"),
    )
    with pytest.raises(ValueError, match=f"gives '{role}' the unit '{unit}', which is not one of"):
        LogReport(log, units={role: unit})


@pytest.mark.parametrize("what", ["unit", "scale"])
def test_what_is_given_for_a_role_without_a_column_is_named(frame, what):
    given = {"units": {"T_ground": "degF"}} if what == "unit" else {"scale": {"T_ground": 0.1}}
    (told,) = [found for found in LogReport(frame, **given).findings if found.where == "T_ground"]
    assert told == ("warning", "T_ground", f"its {what} is given, but no column has this role; name its column too.")


def test_columns_without_numbers_are_named(frame):
    odd = frame.assign(mode="auto", wave=1j)
    report = LogReport(odd)
    assert [f.text for f in report.findings if f.where == "log"] == [
        "'mode' holds no real numbers and is left out", "'wave' holds no real numbers and is left out",
    ]  # fmt: skip
    assert "mode" not in report.columns.index
    with pytest.raises(ValueError, match="two columns 'a'"):
        LogReport(frame.iloc[:, :2].set_axis(["a", "a"], axis=1))


def test_numbers_and_units_in_words(frame):
    room = frame.columns[0]
    plain = frame.set_axis(["Room (°F)", "Outdoor (°C)", "Sun (W/m²)", "Heat valve", "RH"], axis=1)
    plain["Room (°F)"] = plain["Room (°F)"] * 1.8 + 32.0
    plain.loc["2024-01-18":"2024-01-19 14:15", "Room (°F)"] = 65.9
    plain.iloc[5:8, 1] = 90.0, 91.0, 92.0
    plain = plain.drop(plain.index[500:540])
    report = LogReport(
        plain, {"u_heat": "Heat valve", "T_za": "Room (°F)", "T_oa": "Outdoor (°C)"}, scale={"u_heat": 0.01}
    )
    found = {f.where: f.text for f in reversed(report.findings)}
    assert found["Room (°F)"].startswith("stays at 18.83 degC for 38 h from 2024-01-18")
    assert found["Outdoor (°C)"].startswith("3 values beyond -90 to 60 degC, first 90 at")
    assert found["clock"].startswith("the log does not say") or found["clock"].startswith("1 gap; the longest")
    assert "; 1 gap, the longest of" in str(report)
    assert "u_heat      'Heat valve': fraction, 0.01 times the column;" in str(report)
    assert room not in str(report)


@pytest.mark.parametrize(
    ("zone", "line"),
    [("Europe/Berlin", 'timezone = "Europe/Berlin"\n'), ("UTC", 'timezone = "UTC"  # better the local zone'),
     ("-06:00", 'timezone = "-06:00"  # better the local zone'), (None, '# timezone = "..."  # the local zone')],
)  # fmt: skip
def test_a_proposal_asks_for_the_local_zone_where_the_log_has_none(frame, zone, line):
    index = pd.date_range("2024-01-15", periods=960, freq="15min", tz=zone, name="time")
    report = LogReport(frame.set_axis(index, axis=0))
    assert f"\n{line}" in propose_settings("log.csv", report)
    texts = [finding.text for finding in report.findings if finding.where == "clock"]
    assert any("without daylight saving; give timezone" in text for text in texts) == (zone in ("UTC", "-06:00"))


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S+01:00", "%d %b %Y %H:%M +0100", "%Y-%m-%d %H:%M:%S+01:00"])
def test_a_proposal_names_the_offset_of_stamps_in_any_form(write, form):
    rows = [f"{stamp:{form}},20.5,{stamp.hour}" for stamp in pd.date_range("2024-01-15", periods=240, freq="h")]
    assert '\ntimezone = "+01:00"' in propose_settings(write("\n".join(["time,room temp,outdoor temp", *rows])))


def test_power_that_cannot_be_is_asked_about(frame):
    sun, valve = frame.columns[2:4]
    heat = frame.assign(**{"Heating [kW]": 0.05 * frame[valve]}).drop(columns=valve)
    changed = {
        "Heating [kW]": [(-1.0, 0.0, "give [scale] Q_heat = -1 if its sign is reversed, or Q_cool"),
                         (0.0, 2.0, "is 2 in all rows: does the sensor or meter work?"),
                         (1000.0, 0.0, "values reach 3000 kW: are they W?"), (1.0, 0.0, "")],
        sun: [(0.0, 300.0, "is 0.3 in all rows"), (1.0, 0.0, "")],
    }  # fmt: skip
    for name, cases in changed.items():
        for factor, offset, words in cases:
            report = LogReport(heat.assign(**{name: factor * heat[name] + offset}))
            found = [f.text for f in report.findings if f.where == name]
            assert [words in text for text in found] == ([True] if words else []), (name, factor, found)
    switch = (heat["Heating [kW]"] > heat["Heating [kW]"].mean()).astype(float)
    found = [f.text for f in LogReport(heat.assign(**{"Heating [kW]": switch})).findings if f.where == "Heating [kW]"]
    assert found == ["is 0 or 1 kW in all rows: is it a switch? Then give it as u_heat or u_cool."]
    fraction = frame.rename(columns={valve: "Heating valve %"}).assign(**{"Heating valve %": frame[valve] / 100.0})
    found = [f.text for f in LogReport(fraction).findings if f.where == "Heating valve %"]
    assert found == ["reaches 0.6 % only: is it a fraction? Then give '-' as its unit."]
    never = LogReport(heat.assign(**{"Heating [kW]": 2.0}))
    assert "the effect of Q_heat: it never changed." in never.cannot


@pytest.mark.parametrize(
    ("others", "plant", "asked"),
    [
        (["Bedroom temp"], "Boiler [kW]", ["Bedroom temp"]),
        (["Bedroom temp", "Indoor temp hall"], "Boiler [kW]", ["Bedroom temp", "Indoor temp hall"]),
        (["Bedroom temp"], "Living heat [kW]", []),  # the room's own
        (["Bedroom temp"], None, []),
        (["Bedroom RH (%)", "Flow temp"], "Boiler [kW]", []),
    ],
)
def test_a_plant_that_may_serve_other_rooms_is_asked_about(frame, others, plant, asked):
    named = frame.iloc[:, :4].set_axis(["Living room temp", "Outdoor temp", "Sun (W/m²)", plant or "x"], axis=1)
    named = named.drop(columns="x", errors="ignore").assign(**dict.fromkeys(others, frame.iloc[:, 0] - 2.0))
    found = [f.text for f in LogReport(named).findings if f.where == plant and "does it serve" in f.text]
    assert [all(repr(name) in text for name in asked) for text in found] == [True] * bool(asked)
    if plant is not None:
        columns = {"T_za": "Living room temp", "T_oa": "Outdoor temp", "Q_heat": plant}
        assert not [f for f in LogReport(named, columns).findings if "does it serve" in f.text]


def test_infinite_values_are_an_error(frame):
    room = frame.columns[0]
    frame.iloc[:, 0] = -np.inf
    found = LogReport(frame).findings[0]
    assert (found.level, found.where, found.text) == ("error", room, "960 values are infinite.")


def test_what_counts_as_a_finding():
    hours = pd.date_range("2024-03-31", periods=30, freq="1h")
    assert list(daylight_changes(hours.delete(2))) == [pd.Timestamp("2024-03-31 01:00")]  # a Sunday
    autumn = hours + pd.Timedelta("210D")
    assert list(daylight_changes(autumn.insert(2, autumn[2]))) == [autumn[2]]
    for other in (
        autumn.repeat(2),
        hours.delete(8),
        (hours - pd.Timedelta("4D")).delete(2),
        hours.delete(2).tz_localize("UTC"),
    ):
        assert not len(daylight_changes(other))
    index = pd.date_range("2024-01-01", periods=200, freq="1h")
    full = pd.Series(20.0 + np.arange(200) % 7, index)
    assert list(sensor_findings("T_za", "room", full)) == []
    (found,) = sensor_findings("T_za", "room", full.mask(np.arange(200) % 20 == 0))
    assert found.text == "5 % of the rows have no value."
    for last, n_found in ((52, 0), (53, 1)):  # three hours are filled, four are not
        texts = [
            one.text for one in sensor_findings("T_oa", "out", full.mask((index >= index[50]) & (index <= index[last])))
        ]
        assert texts == n_found * [f"no value from {index[50]} to {index[last]}; gaps of more than 3 h are not filled."]
    assert list(sensor_findings("T_oa", "out", full.mask(index > index[-5]))) == []  # rows ahead
    for hours_at_rest, n_found in ((23, 0), (24, 1)):
        resting = full.where((np.arange(200) < 50) | (np.arange(200) > 50 + hours_at_rest), 19.0)
        assert len(standstills("T_za", resting)) == n_found
    assert standstills("T_za", pd.Series(19.0, index[[0, 1, 198, 199]])).empty  # equal before and after an outage


def test_a_row_far_from_all_others_is_named():
    index = pd.date_range("2024-01-01", periods=200, freq="1h")
    for stamp in ("2042-03-05", "1970-01-01"):
        stamps = index.insert(0, pd.Timestamp(stamp)).sort_values()
        note, found = gap_findings(gaps_of(stamps, pd.Timedelta("1h")), stamps)
        assert note.level == "note"
        assert found.level == "warning"
        assert f"1 row from {stamp} 00:00:00 on" in found.text
    halves = index[:100].append(index[:100] + pd.Timedelta("400D"))
    assert [one.level for one in gap_findings(gaps_of(halves, pd.Timedelta("1h")), halves)] == ["note"]


@pytest.mark.parametrize(
    ("stamps", "told"),
    [
        (lambda index: index.normalize(), True),  # the hour is in a column of its own
        (lambda index: index.where(index.hour < 12, index - pd.Timedelta("12h")), True),  # neither AM nor PM
        (lambda index: index[::2].repeat(2), True),  # two rooms
        (lambda index: index.tz_localize(None), False),
        (lambda index: index[0] + pd.to_timedelta(np.arange(960) // 6, "min"), False),  # ten seconds, cut to minutes
    ],
)
def test_many_rows_with_the_stamp_of_another_one(frame, tmp_path, stamps, told):
    log = frame.set_axis(stamps(frame.index), axis=0)
    report = LogReport(log)
    errors = [f.text for f in report.findings if f.level == "error"]
    assert ["rows have the stamp of another row and other values" in text for text in errors] == (
        [True] if told else []
    )
    log.rename_axis("time").to_csv(tmp_path / "log.csv")
    (tmp_path / "zone.toml").write_text(propose_settings("log.csv", report), encoding="utf-8")
    with pytest.raises(ValueError, match="Give each row a stamp of its own") if told else nullcontext():
        read_study_log(tmp_path / "log.csv", read_settings(tmp_path / "zone.toml"))
    again = LogReport(pd.concat([log, log]))
    assert told or "error" not in {f.level for f in again.findings}


def test_a_counter_that_is_set_to_zero_is_named():
    readings = pd.Series(np.arange(100.0), pd.date_range("2024-01-01", periods=100, freq="1h"))
    assert list(counter_findings("meter", readings)) == []
    (found,) = counter_findings("meter", readings.where(np.arange(100) < 60, readings - 60.0))
    assert "the counter falls at 2024-01-03 12:00:00: it was set to zero" in found.text


@pytest.mark.parametrize(("spikes", "unit"), [(1, "degC"), (2, "degC"), (200, "degF")])
def test_a_spike_of_a_sensor_does_not_make_a_column_one_of_fahrenheit(spikes, unit):
    index = pd.date_range("2024-01-01", periods=400, freq="1h")
    frame = pd.DataFrame({"T_za": 20.0 + np.arange(400) % 5, "T_oa": 10.0 + np.arange(400) % 7}, index)
    frame.iloc[100 : 100 + spikes, 1] = 85.0
    assert LogReport(frame).columns.loc["T_oa", "unit"] == unit


def test_channels_are_those_of_the_format_unless_given():
    frame = pd.DataFrame({"a": [1.0], "b": [2.0], "c": [3.0]}, pd.date_range("2024-01-01", periods=1, freq="1h"))
    raw = RawLog(frame, "CSV", units={"a": "degF", "b": "rpm"}, roles={"T_za": "a", "x_fan": "b"}, scale={"b": 0.5})
    channels = channels_of(raw, {"T_za": "c"}, {"T_za": "K"}, {"T_za": 2.0})
    assert channels == [Channel("T_za", "c", "K", 2.0), Channel("x_fan", "b", "rpm", 0.5)]
    assert to_roles(raw, channels[1:])["x_fan"].tolist() == [1.0]  # neither role nor unit are known
