"""Names of columns that are no quantity of the model, or may be none, in the words of building systems."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.logs import LogReport
from skhybrid.logs.naming import guess_role, unit_in_name

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
