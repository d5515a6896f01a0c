"""The paper's synthetic office, an EnergyPlus run of a small office, and readers of logs and weather files."""

from ..logs import read_zone_csv, regularize
from ..logs.even_steps import RegularizeReport
from ._benchmark import BenchmarkLog, load_benchmark
from ._epw import read_epw
from ._house import make_house
from ._office import make_office
from ._shipped_logs import load_dutch_home, load_small_office
from ._thermostat_plan import make_prbs
from ._weather import make_weather
from ._weather_files import read_weather, weather_on_steps

__all__ = [
    "BenchmarkLog",
    "RegularizeReport",
    "load_benchmark",
    "load_dutch_home",
    "load_small_office",
    "make_house",
    "make_office",
    "make_prbs",
    "make_weather",
    "read_epw",
    "read_weather",
    "read_zone_csv",
    "regularize",
    "weather_on_steps",
]
