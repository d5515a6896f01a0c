"""The makers of EnergyPlus years (``benchmarks/make_buildings.py``): draws, plans, spans, files; runs no EnergyPlus."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("benchmarks/ is not beside the tests", allow_module_level=True)
DAYS = 365
MODULES = ("_buildings", "_energyplus", "make_buildings", "_office_rooms")


@pytest.fixture
def makers(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    yield tuple(importlib.import_module(name) for name in MODULES)
    for name in MODULES:
        sys.modules.pop(name, None)


def _workday(low, high, first=8, last=18):
    """A schedule: ``high`` on weekdays from ``first`` to ``last`` [h], else ``low``; 1 January is a Monday."""
    days = np.full((DAYS, 96), float(low))
    for day in range(DAYS):
        if day % 7 < 5:
            days[day, first * 4 : last * 4] = high
    return days.ravel()


def _building(makers, use="office", seed=1):
    return makers[0].Building("b", "small_office", "usa_il_chicago", ("Core_ZN",), use, seed)


GAINS = {"People": {"occ"}, "Lights": {"light"}, "ElectricEquipment": {"plug"}, "GasEquipment": set()}


@pytest.mark.parametrize("use", ["office", "school", "shop", "restaurant", "home"])
def test_occupancy_is_irregular_seeded_and_bounded(makers, use):
    reference = {"occ": _workday(0, 0.95), "light": _workday(0.05, 0.9), "plug": _workday(0.4, 0.9)}
    drawn = makers[0].occupy(_building(makers, use), GAINS, reference)
    again = makers[0].occupy(_building(makers, use), GAINS, reference)
    other = makers[0].occupy(_building(makers, use, seed=2), GAINS, reference)
    for name, values in drawn.items():
        np.testing.assert_array_equal(values, again[name])
        assert np.abs(values - other[name]).max() > 0.1
        assert values.shape == (DAYS * 96,)
        assert (values >= 0).all()
        assert (values <= 2).all()
    people = drawn["occ"].reshape(DAYS, 96)
    # nobody in the dead of night, nor on the week-ends that the reference leaves empty
    assert (people[:, :12] == 0).all()
    assert (people[5::7] == 0).all()
    mondays = people[0::7, 40:60].mean(axis=1)
    assert mondays.std() > 0.05 * mondays.mean()
    # lights and stand-by never fall below what runs day and night
    assert drawn["light"].min() == pytest.approx(0.05)
    assert drawn["plug"].min() == pytest.approx(0.4)


def test_warped_days_begin_later_and_end_earlier_as_drawn(makers):
    days = _workday(0, 1)[:96].reshape(1, 96)
    (late,) = makers[0]._warp(days, np.array([[1.0, -2.0]]))
    hours = (np.arange(96) + 0.5) / 4
    present = hours[late > 0.5]
    assert present[0] == pytest.approx(9.125, abs=0.26)
    assert present[-1] == pytest.approx(15.875, abs=0.26)


def test_shifted_setpoints_are_new_every_day_and_keep_a_dead_band(makers):
    reference = {"h": _workday(15.6, 21.0, 6, 22), "c": _workday(26.7, 24.0, 6, 22)}
    plan = makers[0].plan_setpoints(_building(makers), {"h"}, {"c"}, reference)
    assert (plan["c"] - plan["h"]).min() >= 1.5 - 1e-12
    noon = plan["h"].reshape(DAYS, 96)[:, 60]
    assert len(np.unique(noon.round(6))) > 0.9 * DAYS
    # heating starts up to three hours early, and never later than in the reference
    weekdays = np.flatnonzero(np.arange(DAYS) % 7 < 5)
    starts = np.array([_first_rise(plan["h"].reshape(DAYS, 96)[d]) for d in weekdays])
    assert starts.min() == 24 - 12
    assert np.mean(starts <= 24) > 0.95
    assert 13.0 < plan["h"].min() < plan["h"].max() < 24.0


def _first_rise(day):
    """Row of the first rise of a day."""
    rises = np.flatnonzero(np.diff(day) > 1e-9)
    return int(rises[0]) + 1 if len(rises) else -1


def test_a_model_without_setback_gets_one_on_some_nights(makers):
    flat = {"h": np.full(DAYS * 96, 21.0), "c": np.full(DAYS * 96, 24.0)}
    nights = makers[0].plan_setpoints(_building(makers), {"h"}, {"c"}, flat)["h"].reshape(DAYS, 96)
    depth = nights[:, 28] - nights[:, 8]  # 7 h against 2 h; events begin at 6 h at the earliest
    assert 0.3 < np.mean(depth > 0.9) < 0.7
    programmed = makers[0].programme_home({"h"}, {"c"}, flat)
    for day, hour, heat, cool in ((0, 3, 19.0, 24.0), (0, 12, 19.5, 25.5), (5, 12, 21.0, 24.0), (0, 20, 21.0, 24.0)):
        row = day * 96 + hour * 4
        assert (programmed["h"][row], programmed["c"][row]) == (heat, cool)


def test_spans_are_apart_and_give_150_origins_a_building(makers):
    buildings = makers[0]
    held = [b for b in buildings.BUILDINGS if b.held_out]
    dev = [b for b in buildings.BUILDINGS if not b.held_out]
    assert len(held) >= 4
    assert len(dev) >= 4
    for field in ("name", "seed", "climate"):
        assert not {getattr(b, field) for b in held} & {getattr(b, field) for b in dev}
    assert len({b.name for b in buildings.BUILDINGS}) == len(buildings.BUILDINGS)
    for building in buildings.BUILDINGS:
        origins = 0
        for season in building.seasons:
            first, last, begin, end = map(pd.Timestamp, buildings.SEASONS[season])
            assert last - first == pd.Timedelta("41D")  # the last day counts too: six weeks
            assert begin - last >= pd.Timedelta("7D")
            origins += int((end - begin) / pd.Timedelta("25h")) + 1
        assert origins >= 150


def test_area_of_floors(makers):
    corners = [(0, 0), (4, 0), (4, 3), (0, 3)]
    floor = {
        "zone_name": "A",
        "surface_type": "Floor",
        "vertices": [
            {"vertex_x_coordinate": x, "vertex_y_coordinate": y, "vertex_z_coordinate": 2.7} for x, y in corners
        ],
    }
    surfaces = {"1": floor, "2": {**floor, "zone_name": "B"}, "3": {**floor, "surface_type": "Wall"}}
    area = makers[0].floor_areas({"BuildingSurface:Detailed": surfaces}, ("A",))
    assert area == {"A": pytest.approx(12.0)}


def test_a_file_is_whole_or_absent_and_made_once(makers, tmp_path, monkeypatch):
    make = makers[2]
    asked = []
    table = pd.DataFrame({"T_in_degC": [1.0]}, index=pd.DatetimeIndex(["2018-01-01 00:15"]).tz_localize("-06:00"))

    def tables(building, controls):
        asked.append(controls)
        yield controls[0], table
        if len(asked) == 1:
            raise KeyboardInterrupt
        yield from ((control, table) for control in controls[1:])

    monkeypatch.setattr(make, "make_tables", tables)
    with pytest.raises(KeyboardInterrupt):
        make._make(_building(makers), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["b_irregular.csv"]
    make._make(_building(makers), tmp_path)
    make._make(_building(makers), tmp_path)
    assert asked == [("irregular", "shifted"), ("shifted",)]
    assert (tmp_path / "b_shifted.csv").read_text(encoding="utf-8").splitlines() == [
        "timestamp,T_in_degC",
        "2018-01-01T00:15:00-06:00,1.0",
    ]


class _Exchange:
    """As much of EnergyPlus as the recorder asks for: one step of two system steps, of 5 and of 10 minutes."""

    def __init__(self):
        self.minutes, self.set = 5, {}

    def api_data_fully_ready(self, state):
        return True

    def kind_of_sim(self, state):
        return 3

    def warmup_flag(self, state):
        return False

    def day_of_year(self, state):
        return 2

    def hour(self, state):
        return 1

    def zone_time_step_number(self, state):
        return 3

    def system_time_step(self, state):
        return self.minutes / 60

    def request_variable(self, state, name, key):
        pass

    def get_variable_handle(self, state, name, key):
        return {"Zone Air Temperature": 1, "Zone Air System Sensible Heating Rate": 2}.get(
            name, -1 if "People" in name else 3
        )

    def get_actuator_handle(self, state, kind, what, name):
        return {
            ("Schedule:Compact", "Schedule Value", "OCC"): 7,
            ("OtherEquipment", "Power Level", "replay Z"): 8,
            ("AirLoopHVAC", "Availability Status", "AHU Z"): 9,
        }[kind, what, name]

    def set_actuator_value(self, state, handle, value):
        self.set[handle] = value

    def reset_actuator(self, state, handle):
        self.set[handle] = None

    def get_variable_value(self, state, handle):
        return {1: 20.0 + self.minutes, 2: 100.0 * self.minutes, 3: 1.0}[handle]


def test_the_recorder_averages_power_and_keeps_the_last_temperature(makers):
    energyplus = makers[1]
    values = np.arange(energyplus.N_STEPS, dtype=float)
    recorder = energyplus._Recorder({"Schedule:Compact": {"Occ": {}}}, ("Z",), {"OCC": values}, ())
    recorder.exchange = exchange = _Exchange()
    recorder._guard(recorder._set)(None)
    row = 96 + 4 + 2
    assert exchange.set == {7: row}
    for exchange.minutes in (5, 10):
        recorder._guard(recorder._read)(None)
    assert recorder.error is None
    assert recorder.hours[row] == pytest.approx(0.25)
    held = dict(zip(recorder.held, recorder.values[row], strict=True))
    assert held["T:Z"] == 30.0
    assert held["people:Z"] == 0.0
    mean = recorder.means[row, list(recorder.averaged).index("heating:Z")] / 0.25
    assert mean == pytest.approx((5 * 500 + 10 * 1000) / 15)
    with pytest.raises(RuntimeError, match="left out steps"):
        recorder.frame()


def _served(*zones_by_loop):
    """A document of air loops, each with the rooms that it serves."""
    rooms = [zone for zones in zones_by_loop for zone in zones]
    return {
        "ZoneHVAC:EquipmentConnections": {
            zone: {"zone_name": zone, "zone_conditioning_equipment_list_name": f"list {zone}"} for zone in rooms
        },
        "ZoneHVAC:EquipmentList": {
            f"list {zone}": {
                "equipment": [{"zone_equipment_name": f"fan {zone}"}, {"zone_equipment_name": f"adu {zone}"}]
            }
            for zone in rooms
        },
        "ZoneHVAC:AirDistributionUnit": {f"adu {zone}": {"air_terminal_name": f"box {zone}"} for zone in rooms},
        "AirTerminal:SingleDuct:VAV:Reheat": {f"box {zone}": {"air_inlet_node_name": f"in {zone}"} for zone in rooms},
        "AirLoopHVAC": {
            f"AHU {zones[0]}": {"demand_side_inlet_node_names": f"duct {zones[0]}"} for zones in zones_by_loop
        },
        "AirLoopHVAC:ZoneSplitter": {
            f"splitter {zones[0]}": {
                "inlet_node_name": f"duct {zones[0]}",
                "nodes": [{"outlet_node_name": f"in {zone}"} for zone in zones],
            }
            for zones in zones_by_loop
        },
    }


def test_the_air_loops_of_rooms_serve_no_others(makers):
    energyplus, document = makers[1], _served(("A", "B"), ("C",), ("D",))
    assert energyplus.air_loops_of(document, ("C",)) == {"AHU C"}
    assert energyplus.air_loops_of(document, ("A", "D", "B")) == {"AHU A", "AHU D"}
    with pytest.raises(ValueError, match=r"'A'.*serves.*'B'"):
        energyplus.air_loops_of(document, ("A",))


def test_replayed_heat_stands_in_for_the_air_loop_where_there_is_some(makers):
    energyplus = makers[1]
    row, heat = 96 + 4 + 2, np.full(energyplus.N_STEPS, np.nan)
    recorder = energyplus._Recorder(_served(("Z",)), ("Z",), {}, (), {"Z": heat})
    recorder.exchange = exchange = _Exchange()
    recorder._guard(recorder._set)(None)
    recorder._guard(recorder._switch)(None)
    assert recorder.error is None
    assert exchange.set == {8: 0.0, 9: None}
    heat = heat.copy()
    heat[row] = -1500.0
    recorder = energyplus._Recorder(_served(("Z",)), ("Z",), {}, (), {"Z": heat})
    recorder.exchange = exchange = _Exchange()
    recorder._guard(recorder._set)(None)
    recorder._guard(recorder._switch)(None)
    assert exchange.set == {8: -1500.0, 9: energyplus._FORCE_OFF}


def replaying(runs, lights):
    """A simulation of a zone that notes its runs (occupancy, replayed heat)."""
    keys = ("T", "heating", "cooling", "set_heat", "set_cool", "people")
    gains = ("gain_convective", "gain_radiant", "gain_visible", "gain_return")
    names = (*(f"{key}:Z" for key in (*keys, *gains)), "T_out", "dni", "dhi", "altitude")

    def simulate(document, weather, zones=(), overrides=None, replay=None):
        runs.append((overrides["occ"], replay))
        index = pd.date_range("2018-01-01 00:15", periods=DAYS * 96, freq="15min")
        run = pd.DataFrame(dict.fromkeys(names, 0.0), index)
        if replay is None:
            return run.assign(**{"heating:Z": 3000.0 + 1000.0 * overrides["occ"].mean()})
        # lights heat the return air, which stays in the zone and counts as delivered, a step later
        heating = np.where(np.isfinite(replay["Z"]), np.roll(lights, 1), 0.0)
        given = {"gain_convective:Z": 500.0 + np.nan_to_num(replay["Z"]), "gain_return:Z": lights}
        return run.assign(**given, **{"heating:Z": heating})

    return simulate


def test_a_replay_follows_other_people_and_leaves_a_day_to_the_thermostat(makers, monkeypatch):
    """The heat of days two and three is that of a run under another draw of people."""
    buildings, runs = makers[0], []
    building = buildings.Building("b", "m", "c", ("Z",), "office", 1)
    lights = 300.0 * _workday(0.05, 0.9)
    reference = {"occ": _workday(0, 0.95), "light": _workday(0.05, 0.9), "plug": _workday(0.4, 0.9)}
    monkeypatch.setattr(buildings, "load_model", lambda model: {})
    monkeypatch.setattr(buildings, "prepare", lambda document, weather: {})
    monkeypatch.setattr(buildings, "schedules_of", lambda *_: GAINS | {"heat": set(), "cool": set()})
    monkeypatch.setattr(buildings, "read_schedules", lambda *_: reference)
    monkeypatch.setattr(buildings, "simulate", replaying(runs, lights))
    monkeypatch.setattr(buildings, "site", lambda climate: {"time_zone": -6.0})
    monkeypatch.setitem(sys.modules, "pyenergyplus.dataset", SimpleNamespace(weather_files={"c": "c"}))
    monkeypatch.setitem(sys.modules, "pyenergyplus", SimpleNamespace())
    ((control, table),) = buildings.make_tables(building, ("replayed",))
    assert control == "replayed"
    (others, none), (own, replay) = runs
    assert none is None
    assert np.abs(others - own).max() > 0.1
    np.testing.assert_array_equal(own, buildings.occupy(building, GAINS, reference)["occ"])
    day = np.arange(DAYS * 96) // 96
    np.testing.assert_array_equal(np.isnan(replay["Z"]), day % 3 == 0)
    np.testing.assert_array_equal(table["replayed"], day % 3 > 0)
    gains = 0.5 + np.where(day % 3 > 0, np.roll(lights, 1), 0.0) / 1000.0
    np.testing.assert_allclose(table["truth_gains_kW"], gains, atol=1e-5)
    expected = np.where(day % 3 > 0, 3.0 + others.mean(), 0.0)
    np.testing.assert_allclose(table["q_hvac_kW"], expected, atol=1e-5)


def _two_rooms():
    """Two zones with a thermostat plan and people in common, and an attic that has neither."""
    where = "zone_or_zonelist_or_space_or_spacelist_name"
    duals = {f"{zone} dual": {f"{side}_setpoint_temperature_schedule_name": side for side in ("heating", "cooling")}
             for zone in ("A", "B")}  # fmt: skip
    control = "ThermostatSetpoint:DualSetpoint"
    return {
        "Schedule:Compact": {name: {"data": [name]} for name in ("occ", "light", "heating", "cooling")},
        "People": {f"{z} people": {where: z, "number_of_people_schedule_name": "occ"} for z in ("A", "B")},
        "Lights": {f"{zone} light": {where: zone, "schedule_name": "light"} for zone in ("A", "B", "Attic")},
        "ThermostatSetpoint:DualSetpoint": duals,
        "ZoneControl:Thermostat": {
            f"{zone} thermostat": {
                "zone_or_zonelist_name": zone, "control_1_object_type": control, "control_1_name": f"{zone} dual",
            }
            for zone in ("A", "B")
        },
    }  # fmt: skip


def test_rooms_get_schedules_of_their_own(makers):
    energyplus, office_rooms = makers[1], makers[3]
    document = _two_rooms()
    before = repr(document)
    apart = office_rooms.with_schedules_apart(document, ("A", "B"))
    assert repr(document) == before
    for zone in ("A", "B"):
        used = energyplus.schedules_of(apart, (zone,))
        assert used["People"] == {f"{zone} occ"}
        assert used["Lights"] == {f"{zone} light"}
        assert used["heat"] == {f"{zone} heating"}
        assert used["cool"] == {f"{zone} cooling"}
        assert apart["Schedule:Compact"][f"{zone} heating"] == {"data": ["heating"]}
    assert apart["Lights"]["Attic light"]["schedule_name"] == "light"


def test_air_mixes_through_doors_both_ways_and_less_in_the_ring(makers):
    office_rooms = makers[3]
    rooms = ("Core", "S", "E", "N", "W")
    office = office_rooms.Rooms("b", "m", "c", rooms, "office", 1, doors=0.25)
    mixing = office_rooms.with_doors({}, office)["ZoneMixing"].values()
    flows = {(m["source_zone_or_space_name"], m["zone_or_space_name"]): m["design_flow_rate"] for m in mixing}
    assert len(flows) == 16
    assert flows["Core", "N"] == flows["N", "Core"] == 0.25
    assert flows["S", "E"] == flows["E", "S"] == pytest.approx(0.05)
    assert ("S", "N") not in flows
    closed = office_rooms.Rooms("b", "m", "c", rooms, "office", 1, doors=0.0)
    assert office_rooms.with_doors({}, closed) == {}


def test_a_room_keeps_its_own_level(makers):
    office_rooms = makers[3]
    reference = {"h": _workday(15.6, 21.0), "c": _workday(26.7, 24.0)}
    levels = []
    for seed in (1, 2):
        plans = office_rooms.own_level(_building(makers, seed=seed), {"h", "c"}, reference)
        (level,) = {*(plans["h"] - reference["h"]).round(9), *(plans["c"] - reference["c"]).round(9)}
        levels.append(level)
    assert abs(levels[0] - levels[1]) > 0.05
    assert np.abs(levels).max() <= 2.0
