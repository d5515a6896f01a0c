"""Names of columns that are no quantity of the model, or may be none, in the words of building systems."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.logs import LogReport
from skhybrid.logs.naming import guess_role, unit_in_name
from skhybrid.logs.zone_names import assign_zone_roles

STAMPS = pd.date_range("2024-01-15", periods=240, freq="1h")
HOURS = np.asarray(STAMPS.hour)
ROOM = 20.0 + np.sin(HOURS / 4.0)


def role_of(name):
    return guess_role(name, unit_in_name(name)).role


@pytest.mark.parametrize(
    "name",
    [
        "Discharge_Air_Temperature_Heating_Setpoint",  # it was the room's, as were those below
        "Mixed_Air_Temperature_Setpoint",
        "SA-T-SP",
        "DAT-SP",
        "HWST SP",
        "HW Loop Temp Setpoint",
        "opentherm control setpoint",
        "Outside_Air_Temperature_Setpoint",
        "Zulufttemperatur Sollwert",
        "Consigne de soufflage",
        "Setpoint mandata",
        "Temperatura zadana zasilania",
        "Börvärde framledning",
        "Zone Ideal Loads Mixed Air Temperature [C](Hourly)",
        "Room 101 RA-T",
        "Room 101 DA-T",
        "Raum 12 VL-Temp",
        "Abluft Raum Temp",
        "Zone slab temperature",
        "Raum Oberflächentemperatur",
        "Raum Taupunkttemperatur",
        "Surface Inside Face Temperature [C](Hourly)",
        "Surface Outside Face Temperature [C](Hourly)",
        "Evaporator out temp",  # it was outdoors
        "Coil in temp",  # it was the room's
        "Aanvoer CV",  # it was a stage
        "Heizgrenze",
    ],
)
def test_air_and_water_of_a_plant_and_surfaces_are_no_room(name):
    assert role_of(name) is None


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("AHU 2 Zone Temp", "T_za"),
        ("Storage room temperature", "T_za"),
        ("Heat pump outdoor temp", "T_oa"),
        ("Surface heating valve", "u_heat"),
        ("HHW Valve", "u_heat"),
        ("CHW kBtu", "Q_cool"),
    ],
)
def test_names_beside_those_of_plants_keep_their_roles(name, role):
    assert role_of(name) == role


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("Unoccupied_Zone_Air_Temperature_Setpoint", "Zone_Air_Temperature_Setpoint"),
        ("Sollwert Heizen Nacht", "Sollwert Heizen"),
        ("Minimum Heating Setpoint", "Heating Setpoint"),
        ("Consigne chauffage réduit", "Consigne chauffage"),
    ],
)
def test_the_set_point_of_a_mode_is_told_and_gives_way(name, other):
    alone = LogReport(pd.DataFrame({name: ROOM}, STAMPS))
    assert alone.roles == {"T_heat_set": name}
    assert any("is the set-point of one mode" in f.text for f in alone.findings if f.where == name)
    assert LogReport(pd.DataFrame({name: ROOM, other: ROOM}, STAMPS)).roles == {"T_heat_set": other}


@pytest.mark.parametrize(
    ("name", "better", "word"),
    [
        ("Zone Operative Temperature [C]", "Zone Air Temperature [C]", "operative"),
        ("Zone Mean Radiant Temperature [C]", "Zone Mean Air Temperature [C]", "radiant"),
        ("Room temp max", "Room temp", "max"),
        ("Living room wall temp", "Living room temp", "wall"),
        ("Raum Bodentemperatur", "Raumtemperatur", "bodentemperatur"),
        ("Simulated room temperature", "Room temperature", "simulated"),
        ("Room 1 radiator temperature", "Room 1 temperature", "radiator"),
        ("Aussentemperatur gemittelt", "Aussentemperatur", "gemittelt"),
        ("Rated heating power (kW)", "Heating power (kW)", "rated"),
        ("Heating capacity (kW)", "Heating power (kW)", "heating capacity"),
        ("Boiler gas (kWh)", "Boiler heat (kWh)", "gas"),
        ("Heating:NaturalGas [J](Hourly)", "Baseboard Total Heating Rate [W](Hourly)", "gas"),
        ("Heating (therms)", "Heat meter (kWh)", "therm"),
    ],
)
def test_a_word_of_another_quantity_is_told_and_gives_way(name, better, word):
    alone = LogReport(pd.DataFrame({name: ROOM}, STAMPS))
    (role,) = alone.roles
    (told,) = [f for f in alone.findings if f.text.startswith(f"{word!r} in its name")]
    assert (told.level, told.where) == ("warning", name)
    assert LogReport(pd.DataFrame({name: ROOM, better: ROOM}, STAMPS)).roles == {role: better}


@pytest.mark.parametrize(
    "name", ["Room temp 1st floor", "Ground floor room temp", "Zone temp mean", "Gästezimmer Heizung (kW)"]
)
def test_storeys_means_and_guests_are_not_doubted(name):
    assert " may say " not in guess_role(name, unit_in_name(name)).reason


@pytest.mark.parametrize(
    ("name", "role", "is_electricity"),
    [
        ("Chiller power (kW)", "Q_cool", True),  # it was cold
        ("Chiller cooling load (kW)", "Q_cool", False),
        ("Chiller (tons)", "Q_cool", False),
        ("Elektroheizung kWh", "Q_heat", True),
        ("Heat pump heat output (W)", "Q_heat", False),  # its electricity came before it
        ("Riscaldamento potenza elettrica kW", "Q_heat", True),
        ("Consommation chauffage kWh", "Q_heat", True),
        ("boiler switch:0.apower", "Q_heat", True),  # of Shelly, it was heat
        ("HVAC cooling power (kW)", "Q_cool", False),  # it was heat, by its sign
        ("Zone Radiant HVAC Heating Rate [W](Hourly)", "Q_heat", False),
    ],
)
def test_electricity_and_cold_are_told_from_heat(name, role, is_electricity):
    guess = guess_role(name, unit_in_name(name))
    assert (guess.role, guess.is_electricity) == (role, is_electricity)


def test_a_meter_of_shelly_counts_watt_hours_and_its_temperatures_are_numbered():
    """Its counter was read in kWh, and its power by its values."""
    heat = {"heater switch:0.apower": HOURS % 5, "heater switch:0.aenergy.total": np.cumsum(HOURS % 5)}
    for (name, values), unit in zip(heat.items(), ("W", "Wh counter"), strict=True):
        columns = LogReport(pd.DataFrame({"Room temp": ROOM, name: values.astype(float)}, STAMPS)).columns
        assert columns.loc[name, ["role", "unit", "assumed"]].tolist() == ["Q_heat", unit, False]


@pytest.mark.parametrize(
    "name", ["global_tilted_irradiance", "Direktstrahlung", "Radiación difusa W/m2", "Incident Solar Radiation [W/m2]"]
)
def test_sun_that_is_not_all_of_it_on_the_horizontal_is_told(name):
    found = LogReport(pd.DataFrame({name: 100.0 + ROOM}, STAMPS)).findings
    assert any("is a part of the sun's irradiance" in f.text for f in found)


@pytest.mark.parametrize("quantities", [("Operative", "Mean Radiant", "Mean Air"), ("Operative",)])
def test_temperatures_of_air_are_those_of_the_rooms_of_a_simulation(quantities):
    """The first of several temperatures of each zone was taken, in silence."""
    frame = pd.DataFrame({"Environment:Site Outdoor Air Drybulb Temperature [C](Hourly)": ROOM - 15.0}, STAMPS)
    for quantity in quantities:
        for place, zone in enumerate(("KITCHEN", "OFFICE")):
            frame[f"{zone}:Zone {quantity} Temperature [C](Hourly)"] = ROOM + place
    for zone in ("KITCHEN", "OFFICE"):
        frame[f"{zone}:Zone Air System Sensible Heating Rate [W](Hourly)"] = 300.0 + HOURS
    report = LogReport(frame)
    assert report.roles["T_za_kitchen"] == f"KITCHEN:Zone {quantities[-1]} Temperature [C](Hourly)"
    told = [f.where for f in report.findings if f.text.startswith("'operative' in its name")]
    assert told == ([report.roles[f"T_za_{zone}"] for zone in ("kitchen", "office")] if len(quantities) == 1 else [])


@pytest.mark.parametrize(
    "name",
    [
        "ZN-T Deadband",
        "Heating setpoint deadband",
        "Room temperature (std)",
        "room_temp_count",
        "Zone Temp Error",
        "Heating SP Reset",
        "Outside_Air_Lockout_Temperature_Setpoint",
        "Economizer high limit setpoint",
        "Zone Heating Setpoint Not Met Time [hr](Hourly)",
        "Predicted zone temp",
        "Temperature outdoor (forecast)",
        "Heating valve (supply water)",
        "Estimated heat load kW",
        "Design outdoor temperature",
        "Zone Lights Total Heating Rate [W](Hourly)",  # it was the plant's heat, as were those below
        "Zone Electric Equipment Total Heating Energy [J](Hourly)",
        "Zone Total Internal Total Heating Rate [W](Hourly)",
        "Zone Air Heat Balance Outdoor Air Transfer Rate [W](Hourly)",
        "Cooling Coil Latent Cooling Rate [W](Hourly)",
        "HeatRejection:Electricity [J](Hourly)",
        "Immersion heater energy kWh",
        "Chiller kW/ton",
        "SPACE1-1 IN NODE:System Node Temperature [C](Hourly)",
        "CHW-DT",
        "Chill",  # of wind, as Domoticz exports it, was cooling, as was alternating current
        "System overview AC Consumption L1 (W)",
        "Langwellige Strahlung",
        "Gegenstrahlung",
    ],
)
def test_what_is_no_measured_quantity_of_a_room_has_no_role(name):
    assert role_of(name) is None


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Temperature (outdoor)", "T_oa"),
        ("Temperature (living room)", "T_za"),
        ("Power (heat pump) kW", "Q_heat"),
        ("Cooling setpoint (occupied)", "T_cool_set"),
        ("Zone temperature (°C) (mean)", "T_za"),
        ("HVAC equipment heating energy (kWh)", "Q_heat"),
        ("Zone Ideal Loads Supply Air Total Heating Energy [J](Hourly)", "Q_heat"),
        ("Zone Ideal Loads Supply Air Total Cooling Rate [W](Hourly)", "Q_cool"),
        ("Sonnenstrahlung W/m2", "q_sol"),
    ],
)
def test_words_in_brackets_that_are_no_unit_count(name, role):
    """They were left out, and with them the place of a sensor."""
    assert role_of(name) == role


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("reaTZon_y", "T_za"),  # of Modelica and BOPTEST, whose names said nothing
        ("TRooAir.y", "T_za"),
        ("weaSta_reaWeaTDryBul_y", "T_oa"),
        ("weaSta_reaWeaTWetBul_y", None),
        ("weaSta_reaWeaHGloHor_y", "q_sol"),
        ("reaTSetHea_y", "T_heat_set"),
        ("reaTSetCoo_y", "T_cool_set"),
        ("reaTSup_y", None),
        ("reaQHea_y", "Q_heat"),
        ("yCoo", "u_cool"),
        ("ZNT-HTGSP", "T_heat_set"),  # it was a stage, as were the two below
        ("CLGSETP_SCH:Schedule Value [](Hourly)", "T_cool_set"),
        ("heatsp", "T_heat_set"),
        ("Nominal cooling capacity", "Q_cool"),
        ("heatpump_elec", "Q_heat"),
        ("Wärmemenge", "Q_heat"),
        ("Internal_Air_Temperature", "T_za"),
        ("Indetemperatur", "T_za"),
        ("Ute temp", "T_oa"),
        ("Kamer ingestelde temperatuur", "T_heat_set"),  # it was the room's
        ("Koude kWh", "Q_cool"),
        ("Potencia frigorífica kW", "Q_cool"),
        ("Moc chłodnicza kW", "Q_cool"),
        ("Topný výkon kW", "Q_heat"),
        ("Radiazione globale", "q_sol"),
        ("Promieniowanie słoneczne", "q_sol"),
        ("I_sol", "q_sol"),  # nothing read it, nor any of those below
        ("制热功率(kW)", "Q_heat"),
        ("太阳辐射(W/m2)", "q_sol"),
        ("室内湿度", None),
        ("供水温度", None),
        ("실내온도", "T_za"),
        ("실외온도", "T_oa"),
        ("난방 설정온도", "T_heat_set"),
        ("Температура в комнате", "T_za"),
        ("Наружная температура, °C", "T_oa"),
        ("Температура подачи", None),
        ("Влажность в комнате", None),
        ("Мощность отопления, кВт", "Q_heat"),
        ("Külső hőmérséklet", "T_oa"),
        ("Belső hőmérséklet", "T_za"),
        ("İç sıcaklık", "T_za"),
        ("Dış sıcaklık", "T_oa"),
        ("Εξωτερική θερμοκρασία", "T_oa"),
        ("Teplota venku", "T_oa"),
        ("Zon temperatuur", None),
    ],
)
def test_names_of_simulations_and_of_more_languages(name, role):
    assert role_of(name) == role


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("Wärme [kWh/15 min]", None, None),  # it was a stage in minutes
        ("Heating kWh/day", None, None),  # it was a stage
        ("Heating energy kWh/15min", None, None),  # it was kW
        ("Heating MBTU", None, None),
        ("Irradiance (klux)", None, None),  # it was kW/m2
        ("Heat (kilowatt-hours)", "Q_heat", "kWh"),
        ("Qheat kJ/h", "Q_heat", "kJ/h"),  # its unit was not read without brackets, nor those below
        ("Heating kcal/h", "Q_heat", "kcal/h"),
        ("heating_MMBtu/h", "Q_heat", "MMBtu/h"),
        ("Heating kBtu/hr", "Q_heat", "kBtu/h"),
        ("Heating runtime (min)", "u_heat", "min"),
    ],
)
def test_units_of_energy_per_other_times_are_asked_about(name, role, unit):
    assert (role_of(name), unit_in_name(name)) == (role, unit)


@pytest.mark.parametrize(
    ("name", "values", "role", "unit", "told"),
    [
        ("heating", 180.0 * ROOM, "Q_heat", "W", "values reach 3780: W is assumed"),  # it was left out
        ("Heizung", 0.2 * ROOM, "Q_heat", "kW", "kW is assumed"),  # it was 4 %
        ("cooling", 180.0 * ROOM, "Q_cool", "W", "W is assumed"),
        ("heating", 3.0 * ROOM, "u_heat", "percent", "if it is heat, give Q_heat and its unit"),
        ("heating", np.round(ROOM) % 2.0, "u_heat", "-", ""),
        ("Heizung Ventil", 0.2 * ROOM, "u_heat", "percent", "of a stage or valve; values reach 4"),
        ("heating_power_w", 5.0 * ROOM, "Q_heat", "W", ""),  # it was 105 kW
        ("heating_watts", 5.0 * ROOM, "Q_heat", "W", ""),  # it was a stage, as was the one below
        ("cooling_btu_h", 5.0 * ROOM, "Q_cool", "Btu/h", ""),
        ("Stellgröße Heizen", np.round(12.0 * ROOM), None, None, "beyond 100 %; give u_heat and 1 / its full scale"),
        ("Heizung", np.round(12.0 * ROOM), None, None, "beyond 100 %"),  # of a bus, up to 255
        ("heating_valve_w", 3.0 * ROOM, "u_heat", "percent", ""),  # of the west
    ],
)
def test_what_is_named_after_a_plant_alone_is_heat_where_its_values_are(name, values, role, unit, told):
    found = LogReport(pd.DataFrame({name: values}, STAMPS)).columns.astype(object).loc[name]
    assert tuple(found[["role", "unit"]].where(found.notna(), None)) == (role, unit)
    assert told in found["reason"]


def test_a_valve_that_hardly_opens_is_asked_about_or_shown_by_another():
    """It was heat in kW, which nobody was told could be a valve."""
    few = pd.DataFrame({"heating hall": 0.2 * ROOM}, STAMPS)
    asked = [f.text for f in LogReport(few).findings if "give it as u_heat" in f.text]
    assert len(asked) == 1
    told = LogReport(few, {"u_heat": "heating hall"}, {"u_heat": "percent"})
    np.testing.assert_allclose(told.frame["u_heat"], 0.002 * ROOM)
    rooms = {f"temp {room}": ROOM for room in ("hall", "bath")}
    both = LogReport(few.assign(**{"heating bath": 4.0 * ROOM}, **rooms))
    assert both.columns.loc[["heating hall", "heating bath"], "role"].tolist() == ["u_heat_hall", "u_heat_bath"]
    assert not [f for f in both.findings if "give it as u_heat" in f.text]


@pytest.mark.parametrize(
    ("name", "role", "is_electricity"),
    [
        ("Huonelämpötila", "T_za", False),
        ("huonelampo", "T_za", False),
        ("Ulkolämpötila [°C]", "T_oa", False),
        ("ulkolampotila", "T_oa", False),
        ("Ulkolämpö", "T_oa", False),
        ("lämmitys", "u_heat", False),
        ("Etuhuone venttiili", "u_heat", False),
        ("lammitysteho_kW", "Q_heat", False),
        ("Lämmönkulutus kWh", "Q_heat", False),
        ("Kaukolämpö (MWh)", "Q_heat", False),
        ("Sähkölämmitys kW", "Q_heat", True),
        ("Lämpöpumpun sähkö kWh", "Q_heat", True),
        ("Värmepump effekt kW", "Q_heat", True),  # it was left out as a pump's
        ("Jäähdytysteho", "Q_cool", False),
        ("Viilennys %", "u_cool", False),
        ("asetusarvo", "T_heat_set", False),
        ("Jäähdytyksen asetusarvo", "T_cool_set", False),
        ("Auringonsäteily", "q_sol", False),
        ("sähkö kWh", None, False),
        ("Menoveden lämpötila", None, False),
        ("Käyttöveden lämmitys kWh", None, False),
        ("Huoneen kosteus %", None, False),
    ],
)
def test_names_in_finnish(name, role, is_electricity):
    guess = guess_role(name, unit_in_name(name))
    assert (guess.role, guess.is_electricity) == (role, is_electricity)


@pytest.mark.parametrize(
    ("outdoor", "room", "heat"),
    [
        ("weaDat.weaBus.TDryBul", "zon{}.TAir", "zon{}.QHea_flow"),
        ("weaBus.TDryBul", "flo.zon[{}].T", "hea[{}].Q_flow"),  # they were refused
        ("TOut", "TRooAir[{}]", "QHea_flow[{}]"),  # the first was taken for all
        ("TDryBul", "zon[{}].TAir", "zon[{}].QHea"),
        ("weaSta_reaWeaTDryBul_y", "reaTZon{}_y", "reaQHea{}_y"),
    ],
)
def test_numbered_zones_of_modelica(outdoor, room, heat):
    frame = pd.DataFrame({outdoor: ROOM + 255.0}, STAMPS)
    for k in (1, 2):
        frame[room.format(k)] = ROOM + 273.15
        frame[heat.format(k)] = 500.0 + HOURS
        frame[f"wal.T[{k}]"] = ROOM + 273.15
    zones = {f"{role}_zone{k}": name.format(k) for k in (1, 2) for role, name in (("T_za", room), ("Q_heat", heat))}
    assert LogReport(frame).roles == {"T_oa": outdoor, **zones}
    one = LogReport(frame[[outdoor, room.format(1), heat.format(1)]])
    assert one.roles == {"T_oa": outdoor, "T_za": room.format(1), "Q_heat": heat.format(1)}


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("room2 temp", "T_za"),
        ("TAIR_ZONE1", "T_za"),
        ("TAMB", "T_oa"),
        ("TSETHEAT", "T_heat_set"),
        ("tambient", "T_oa"),
        ("heatingTarget", "T_heat_set"),
        ("coolingTarget", "T_cool_set"),
        ("Ruimtetemperatuur gemeten 1.01", "T_za"),
        ("Ruimtetemperatuur berekend koelen 1.01", "T_cool_set"),  # of Priva, which calculates what it holds
        ("WMZ Energie [MWh]", "Q_heat"),
        ("OSA Temp", "T_oa"),
        ("Wunschtemperatur Zone 1", "T_heat_set"),  # it was the room's
        ("Soll Heizen", "T_heat_set"),  # it had no role, as the one below
        ("Kühlen Soll (°C)", "T_cool_set"),
        ("Température séjour", "T_za"),
    ],
)
def test_names_that_said_nothing(name, role):
    assert role_of(name) == role


@pytest.mark.parametrize("name", ["Air Temperature (°C)", "avg(temp)", "Temperature", "tairmean"])
def test_the_one_temperature_beside_that_outdoors_is_the_rooms(name):
    """A log with one room need not say of which its temperature is; a boiler's has a word of it."""
    frame = pd.DataFrame({name: ROOM, "Outside Dry-Bulb Temperature (°C)": ROOM - 15.0, "Pellet temp": ROOM}, STAMPS)
    assert LogReport(frame).roles == {"T_za": name, "T_oa": "Outside Dry-Bulb Temperature (°C)"}
    assert "T_za" not in LogReport(frame[[name, "Pellet temp"]]).roles  # it may be the weather's
    assert "T_za" not in LogReport(frame.assign(temp=ROOM)).roles
    assert LogReport(frame.assign(**{"Room temp": ROOM})).roles["T_za"] == "Room temp"


def test_places_alone_are_temperatures_where_their_values_are():
    """'indoor' and 'outdoor' had no role; humidity and whole numbers have none still."""
    frame = pd.DataFrame({"indoor": ROOM, "outdoor": ROOM - 15.0}, STAMPS)
    assert LogReport(frame).roles == {"T_za": "indoor", "T_oa": "outdoor"}
    assert not LogReport(frame + 40.0).roles
    assert not LogReport(frame.round()).roles
    assert LogReport(frame.assign(**{"Room temp": ROOM})).roles == {"T_za": "Room temp", "T_oa": "outdoor"}
    assert LogReport(frame.assign(lounge=ROOM)).roles == {"T_oa": "outdoor"}  # which of two is not said


def test_a_temperature_in_two_units_is_no_other_room():
    names = ["inside temp.celsius", "inside temp.fahrenheit", "heating kW"]
    frame = pd.DataFrame(dict(zip(names, (ROOM, 1.8 * ROOM + 32.0, 1.0 + ROOM), strict=True)), STAMPS)
    assert not [f for f in LogReport(frame).findings if "does it serve" in f.text]
    other = LogReport(frame.rename(columns={"inside temp.fahrenheit": "bedroom temp.fahrenheit"}))
    assert [f.where for f in other.findings if "does it serve" in f.text] == ["heating kW"]


@pytest.mark.parametrize(("outdoor", "asked"), [(-15.0, True), (8.0, False)])
def test_an_air_conditioner_that_runs_in_the_cold_is_asked_about(outdoor, asked):
    """It was taken for cooling, in silence."""
    runs = (HOURS % 4 > 0).astype(float)
    frame = pd.DataFrame({"Room temp": ROOM, "Outdoor temp": ROOM + outdoor, "AC on": runs}, STAMPS)
    (told, *others) = [f.text for f in LogReport(frame).findings if f.where == "AC on"] or [""]
    assert not others
    assert (
        "runs in 75 % of the hours when it is 10 K colder outdoors" in told and "give it as u_heat" in told
    ) == asked
    both = LogReport(frame.assign(**{"Heat valve": 1.0 - runs}))
    assert not [f for f in both.findings if f.where == "AC on"]


@pytest.mark.parametrize("zone", ["zon1", "roo2", "zone1", "room_3", "master_bedroom"])
def test_the_name_of_a_zone_is_found_as_it_was_given(zone):
    names = {f"{zone} valve": None, f"{zone} temp": None}
    found = assign_zone_roles(names, {f"T_za_{zone}": f"{zone} temp", "T_za_hall": "hall temp"})
    assert [guess.role for guess in found.values()] == [f"u_heat_{zone}", f"T_za_{zone}"]


@pytest.mark.parametrize(
    "names", [["tC"], ["tC", "tF"], ["Temp C", "Temp F"], ["tF"], ["temperature:0.tC", "temperature:0.tF"]]
)
def test_a_temperature_in_two_units_is_one(names):
    """Shelly writes tC and tF, of which none was placed."""
    values = {name: ROOM if name.endswith("C") else 1.8 * ROOM + 32.0 for name in names}
    report = LogReport(pd.DataFrame({"outdoor temperature [°C]": ROOM - 15.0, **values}, STAMPS))
    assert report.roles["T_za"] == names[0]
    np.testing.assert_allclose(report.frame["T_za"], ROOM)
