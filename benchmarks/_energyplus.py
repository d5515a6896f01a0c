"""One EnergyPlus year: a reference building under a climate, with schedules that Python sets, 15 min by 15 min.

Needs ``pip install pyenergyplus-lbnl`` (engine, reference buildings, TMY3 weather); imports nothing of skhybrid, so
that an environment of its own will do.  Credit: EnergyPlus (LBNL/DOE); reference buildings: Deru et al. (2011),
NREL/TP-5500-46861; prototype buildings of standard 90.1-2019: PNNL.
"""

from __future__ import annotations

import csv
import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

STEPS_PER_HOUR = 4
N_STEPS = 365 * 24 * STEPS_PER_HOUR
#: the year of the label; its 1 January is a Monday.
YEAR = 2018
#: days of that year on which the schedules of the offices are those of a holiday
DAYS_OFF = (
    "2018-01-01", "2018-01-15", "2018-02-19", "2018-05-28", "2018-07-04", "2018-09-03", "2018-10-08", "2018-11-22",
    "2018-12-25",
)  # fmt: skip
#: kinds of internal gain whose schedules an occupancy may replace.
GAINS = ("People", "Lights", "ElectricEquipment", "GasEquipment")
#: kind of gain -> field of its schedule; and the field of its zone.
SCHEDULE_OF = dict.fromkeys(GAINS, "schedule_name") | {"People": "number_of_people_schedule_name"}
SPACE = "zone_or_zonelist_or_space_or_spacelist_name"

#: variables of a zone that are held over a zone time step, and of the system steps within it.
_HELD = {
    "gain_convective": "Zone Total Internal Convective Heating Rate",
    "gain_radiant": "Zone Total Internal Radiant Heating Rate",
    "gain_visible": "Zone Total Internal Visible Radiation Heating Rate",
    "gain_return": "Zone Lights Return Air Heating Rate",
    "people": "Zone People Occupant Count",
    "set_heat": "Zone Thermostat Heating Setpoint Temperature",
    "set_cool": "Zone Thermostat Cooling Setpoint Temperature",
}
#: a zone without people, or without lights, has no such variable: there are none.
_MAY_BE_ABSENT = ("Zone People Occupant Count", "Zone Lights Return Air Heating Rate")
_AVERAGED = {"heating": "Zone Air System Sensible Heating Rate", "cooling": "Zone Air System Sensible Cooling Rate"}
#: an equipment without radiation that an actuator gives its power, and what switches an air loop off.
_SOURCE = {"fuel_type": "None", "schedule_name": "replay", "design_level": 0.0}
_FORCE_OFF = 1.0
_SITE = {
    "T_out": "Site Outdoor Air Drybulb Temperature",
    "dni": "Site Direct Solar Radiation Rate per Area",
    "dhi": "Site Diffuse Solar Radiation Rate per Area",
    "altitude": "Site Solar Altitude Angle",
}


def load_model(model: str) -> dict:
    """Input of a building as epJSON; ``model`` names one of ``pyenergyplus.dataset`` (90.1-2019 with ``ashrae/``)."""
    from pyenergyplus.dataset import ashrae_models, ref_models, weather_files

    family, _, name = model.rpartition("/")
    source = (ashrae_models if family == "ashrae" else ref_models)[name]
    with tempfile.TemporaryDirectory() as folder:
        idf = shutil.copy(source, Path(folder) / "model.idf")
        _engine(folder, idf, weather_files["usa_il_chicago"], ["--convert-only"])
        return json.loads((Path(folder) / "model.epJSON").read_text(encoding="utf-8"))


def prepare(document: dict, weather: str) -> dict:
    """Set step, year, site and design days; drop daylight saving, written outputs and energy-management programs.

    The programs of the prototypes shift set-points (optimum start) and dim lights; here both come from the schedules.
    """
    # the transformer only counts electricity, and its meters point at what the programs report
    meters = ("Output:", "UtilityCost:", "Meter:Custom", "ElectricLoadCenter:Transformer")
    dropped = (*meters, "EnergyManagementSystem:", "RunPeriodControl:DaylightSavingTime")
    kept = {kind: value for kind, value in document.items() if not kind.startswith(dropped)}
    kept["Timestep"] = {"Timestep 1": {"number_of_timesteps_per_hour": STEPS_PER_HOUR}}
    kept["RunPeriod"] = {
        "year": {
            "begin_month": 1,
            "begin_day_of_month": 1,
            "begin_year": YEAR,
            "end_month": 12,
            "end_day_of_month": 31,
            "end_year": YEAR,
            "apply_weekend_holiday_rule": "No",
            "use_weather_file_daylight_saving_period": "No",
            "use_weather_file_holidays_and_special_days": "No",
            "use_weather_file_rain_indicators": "Yes",
            "use_weather_file_snow_indicators": "Yes",
        }
    }
    kept["SimulationControl"] = {
        "control": {
            "do_zone_sizing_calculation": "Yes",
            "do_system_sizing_calculation": "Yes",
            "do_plant_sizing_calculation": "Yes",
            "run_simulation_for_sizing_periods": "No",
            "run_simulation_for_weather_file_run_periods": "Yes",
        }
    }
    header = _weather_header(weather)
    kept["Site:Location"] = {"site": {k: header[k] for k in ("latitude", "longitude", "time_zone", "elevation")}}
    for day in kept["SizingPeriod:DesignDay"].values():
        _set_design_day(day, header)
    return kept


def read_schedules(document: dict, weather: str, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Values of schedules over the year, (N_STEPS,) each, from a run without any building."""
    kinds = ("Version", "Building", "GlobalGeometryRules", "Timestep", "RunPeriod", "Site:Location")
    bare = {k: v for k, v in document.items() if k in kinds or k.startswith(("Schedule", "RunPeriodControl"))}
    control = document["SimulationControl"]["control"]
    bare["SimulationControl"] = {"control": {k: "No" if "sizing_calc" in k else v for k, v in control.items()}}
    run = simulate(bare, weather, schedules=names)
    return {name: run[f"schedule:{name}"].to_numpy() for name in names}


def _weather_header(weather: str) -> dict[str, float]:
    """Site and design conditions (99.6 % heating, 0.4 % cooling) from the head of an EPW file."""
    with Path(weather).open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)
        place, design = next(rows), next(rows)
    latitude, longitude, zone, elevation = map(float, place[6:10])
    cooling = design.index("Cooling")
    return {
        "latitude": latitude,
        "longitude": longitude,
        "time_zone": zone,
        "elevation": elevation,
        "winter": float(design[design.index("Heating") + 2]),
        "summer_range": float(design[cooling + 2]),
        "summer": float(design[cooling + 3]),
        "summer_wet": float(design[cooling + 4]),
        "pressure": 101325.0 * (1.0 - 2.25577e-5 * elevation) ** 5.2559,
    }


def _set_design_day(day: dict, header: dict[str, float]) -> None:
    summer = day["day_type"] == "SummerDesignDay"
    dry, wet = (header["summer"], header["summer_wet"]) if summer else (header["winter"], header["winter"])
    day["maximum_dry_bulb_temperature"] = dry
    day["daily_dry_bulb_temperature_range"] = header["summer_range"] if summer else 0.0
    day["humidity_condition_type"], day["wetbulb_or_dewpoint_at_maximum_dry_bulb"] = "WetBulb", wet
    day["barometric_pressure"] = header["pressure"]


def site(weather: str) -> dict[str, float]:
    """Latitude and longitude [deg] and time zone [h] of a climate of ``pyenergyplus.dataset``."""
    from pyenergyplus.dataset import weather_files

    header = _weather_header(weather_files[weather])
    return {name: header[name] for name in ("latitude", "longitude", "time_zone")}


def schedules_of(document: dict, zones: tuple[str, ...]) -> dict[str, set[str]]:
    """Names of schedules by what they drive: each kind of gain in the zones, and set-points ``heat`` and ``cool``."""
    found: dict[str, set[str]] = {kind: set() for kind in GAINS}
    for kind in GAINS:
        for gain in document.get(kind, {}).values():
            if gain[SPACE] in zones:
                found[kind].add(gain[SCHEDULE_OF[kind]])
    found |= {"heat": set(), "cool": set()}
    controls = [c for c in document["ZoneControl:Thermostat"].values() if c["zone_or_zonelist_name"] in zones]
    for control in controls:
        for i in range(1, 5):
            if control.get(f"control_{i}_object_type") == "ThermostatSetpoint:DualSetpoint":
                dual = document["ThermostatSetpoint:DualSetpoint"][control[f"control_{i}_name"]]
                found["heat"].add(dual["heating_setpoint_temperature_schedule_name"])
                found["cool"].add(dual["cooling_setpoint_temperature_schedule_name"])
    return found


def air_loops_of(document: dict, zones: tuple[str, ...]) -> set[str]:
    """Names of the air loops that serve zones and no other zone.

    Raises
    ------
    ValueError
        If a loop serves other zones too.
    """
    connections = {c["zone_name"]: c for c in document["ZoneHVAC:EquipmentConnections"].values()}
    terminals = {n: t for kind, all_ in document.items() if kind.startswith("AirTerminal:") for n, t in all_.items()}
    inlets = {}
    for zone, connection in connections.items():
        units = document["ZoneHVAC:EquipmentList"][connection["zone_conditioning_equipment_list_name"]]["equipment"]
        for unit in (document["ZoneHVAC:AirDistributionUnit"].get(u["zone_equipment_name"]) for u in units):
            if unit is not None:
                inlets[terminals[unit["air_terminal_name"]]["air_inlet_node_name"]] = zone
    loops = {loop["demand_side_inlet_node_names"]: name for name, loop in document["AirLoopHVAC"].items()}
    found = set()
    for splitter in document["AirLoopHVAC:ZoneSplitter"].values():
        served = {inlets[node["outlet_node_name"]] for node in splitter["nodes"]}
        if served & set(zones):
            if not served <= set(zones):
                raise ValueError(f"the air loop of {zones} serves {sorted(served - set(zones))} too.")
            found.add(loops[splitter["inlet_node_name"]])
    return found


def simulate(
    document: dict,
    weather: str,
    zones: tuple[str, ...] = (),
    overrides: dict[str, np.ndarray] | None = None,
    schedules: tuple[str, ...] = (),
    replay: dict[str, np.ndarray] | None = None,
    days: tuple[str, str] | None = None,
) -> pd.DataFrame:
    """Run the year, or its days (first, last), with ``overrides`` (schedule name -> (N_STEPS,)) in place of schedules.

    Sizing sees the schedules of the model, so that two runs which differ in overrides have the same plant.
    ``replay`` (zone -> (N_STEPS,) [W]) is heat into the air of zones, whose air loops are off then; where it is NaN,
    the thermostat acts.
    Returns one row a step, stamped with its end: site variables, ``<variable>:<zone>`` and ``schedule:<name>``.
    """
    from pyenergyplus.dataset import weather_files

    if days is not None:
        begin, end = (pd.Timestamp(day) for day in days)
        span = {"begin_month": begin.month, "begin_day_of_month": begin.day}
        span |= {"end_month": end.month, "end_day_of_month": end.day}
        document = document | {"RunPeriod": {"year": document["RunPeriod"]["year"] | span}}
    if replay is not None:
        always = {"replay": {"hourly_value": 1.0}}
        sources = {f"replay {zone}": _SOURCE | {SPACE: zone} for zone in replay}
        document = document | {
            "Schedule:Constant": document.get("Schedule:Constant", {}) | always,
            "OtherEquipment": document.get("OtherEquipment", {}) | sources,
        }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.epJSON"
        path.write_text(json.dumps(document), encoding="utf-8")
        recorder = _Recorder(document, zones, overrides or {}, schedules, replay)
        _engine(folder, path, weather_files[weather], [], recorder)
    return recorder.frame(days)


def _engine(folder, model, weather, options, recorder=None) -> None:
    """Run EnergyPlus; raise with the lines that it logged as severe if it failed."""
    from pyenergyplus.api import EnergyPlusAPI

    api = EnergyPlusAPI()
    state = api.state_manager.new_state()
    api.runtime.set_console_output_status(state, False)
    if recorder is not None:
        recorder.attach(api, state)
    status = api.runtime.run_energyplus(state, [*options, "-d", str(folder), "-w", str(weather), str(model)])
    api.state_manager.delete_state(state)
    if recorder is not None and recorder.error is not None:
        raise recorder.error
    if status != 0:
        log = (Path(folder) / "eplusout.err").read_text(encoding="utf-8", errors="replace").splitlines()
        raise RuntimeError("EnergyPlus failed: " + " | ".join(x for x in log if "Severe" in x or "Fatal" in x)[:1500])


class _Recorder:
    """Sets schedules at the start of each step of the year and reads variables at the end of each system step."""

    def __init__(self, document, zones, overrides, schedules, replay=None):
        self.kinds = {
            name.upper(): kind for kind in document if kind.startswith("Schedule:") for name in document[kind]
        }
        self.overrides, self.replay = overrides, replay or {}
        self.loops = air_loops_of(document, tuple(replay)) if replay else set()
        self.held = {key: (name, "Environment") for key, name in _SITE.items()}
        self.held |= {f"{key}:{zone}": (name, zone) for zone in zones for key, name in _HELD.items()}
        self.held |= {f"schedule:{name}": ("Schedule Value", name) for name in schedules}
        self.held |= {f"T:{zone}": ("Zone Air Temperature", zone) for zone in zones}
        self.averaged = {f"{key}:{zone}": (name, zone) for zone in zones for key, name in _AVERAGED.items()}
        self.values = np.full((N_STEPS, len(self.held)), np.nan)
        self.means = np.zeros((N_STEPS, len(self.averaged)))
        self.hours = np.zeros(N_STEPS)
        self.handles: tuple[list[int], list[int], list[tuple[int, np.ndarray]]] | None = None
        self.switches: list[int] = []
        self.error: Exception | None = None

    def attach(self, api, state) -> None:
        self.api, self.exchange = api, api.exchange
        for name, key in [*self.held.values(), *self.averaged.values()]:
            self.exchange.request_variable(state, name, key)
        api.runtime.callback_begin_zone_timestep_before_init_heat_balance(state, self._guard(self._set))
        if self.replay:  # set at the start of a step alone, the status had no effect
            for point in ("after_predictor_after_hvac_managers", "inside_system_iteration_loop"):
                getattr(api.runtime, f"callback_{point}")(state, self._guard(self._switch))
        api.runtime.callback_end_system_timestep_after_hvac_reporting(state, self._guard(self._read))

    def _guard(self, work):
        """Keep the first exception (ctypes would print and forget it) and stop the run."""

        def callback(state):
            if self.error is not None or not self.exchange.api_data_fully_ready(state):
                return
            if self.exchange.kind_of_sim(state) != 3:  # 3: a period of the weather file; 1 and 2 are design days
                return
            try:
                work(state)
            except Exception as error:
                self.error = error
                self.api.runtime.stop_simulation(state)

        return callback

    def _find(self, state) -> None:
        def variable(name, key):
            handle = self.exchange.get_variable_handle(state, name, key)
            if handle < 0 and name not in _MAY_BE_ABSENT:
                raise RuntimeError(f"EnergyPlus has no variable {name!r} for {key!r}")
            return handle

        def actuator(kind, control, key):
            handle = self.exchange.get_actuator_handle(state, kind, control, key)
            if handle < 0:
                raise RuntimeError(f"EnergyPlus has no {control!r} of {kind} {key!r}")
            return handle

        setters = [
            (actuator(self.kinds[name.upper()], "Schedule Value", name), values)
            for name, values in self.overrides.items()
        ]
        setters += [
            (actuator("OtherEquipment", "Power Level", f"replay {zone}"), np.nan_to_num(heat))
            for zone, heat in self.replay.items()
        ]
        self.switches = [actuator("AirLoopHVAC", "Availability Status", loop) for loop in sorted(self.loops)]
        self.handles = (
            [variable(*v) for v in self.held.values()],
            [variable(*v) for v in self.averaged.values()],
            setters,
        )

    def _row(self, state) -> int:
        hour = (self.exchange.day_of_year(state) - 1) * 24 + self.exchange.hour(state)
        return hour * STEPS_PER_HOUR + self.exchange.zone_time_step_number(state) - 1

    def _set(self, state) -> None:
        if self.handles is None:
            self._find(state)
        row = self._row(state)
        for handle, values in self.handles[2]:
            self.exchange.set_actuator_value(state, handle, float(values[row]))

    def _switch(self, state) -> None:
        """Air loops off where heat is replayed."""
        if self.handles is None:
            return
        forced = np.isfinite(next(iter(self.replay.values()))[self._row(state)])
        for handle in self.switches:
            if forced:
                self.exchange.set_actuator_value(state, handle, _FORCE_OFF)
            else:
                self.exchange.reset_actuator(state, handle)

    def _read(self, state) -> None:
        if self.handles is None or self.exchange.warmup_flag(state):
            return
        row, hours = self._row(state), self.exchange.system_time_step(state)
        read = self.exchange.get_variable_value
        self.values[row] = [read(state, handle) if handle >= 0 else 0.0 for handle in self.handles[0]]
        self.means[row] += [hours * read(state, handle) for handle in self.handles[1]]
        self.hours[row] += hours

    def frame(self, days: tuple[str, str] | None = None) -> pd.DataFrame:
        index = pd.date_range(f"{YEAR}-01-01 00:15", periods=N_STEPS, freq="15min", name="timestamp")
        day = 24 * STEPS_PER_HOUR
        begin, end = (pd.Timestamp(d).day_of_year for d in days) if days is not None else (1, N_STEPS // day)
        rows = slice((begin - 1) * day, end * day)
        if not np.allclose(self.hours[rows], 1.0 / STEPS_PER_HOUR):
            raise RuntimeError("EnergyPlus left out steps of the year")
        table = pd.DataFrame(self.values[rows], index[rows], columns=list(self.held))
        table[list(self.averaged)] = self.means[rows] / self.hours[rows, None]
        return table
