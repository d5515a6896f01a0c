"""Make the response of single EnergyPlus zones to a kW, which the gain of forecasts is measured against.

    pip install pyenergyplus-lbnl
    python benchmarks/make_step_tests.py [--out FOLDER] [--only BUILDING ...]

Writes ``FOLDER/steps``: a year's log per zone under its thermostat, ``<zone>_irregular.csv``, with a ``meta.csv`` of
place and spans of training and test (as ``make_buildings.py``), and ``<zone>_<season>_steps.csv`` of the tests.  From
all of these come ``benchmarks/data/step_tests.csv``, a row per step, and ``step_gains.csv``, their median, lowest and
highest by zone, season and lead.  Files that are there are not made again; about 12 minutes of one core for all.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path

import pandas as pd
from _buildings import Building, table_of
from _step_tests import LEADS, TESTED, Plant, single_zones, step_gains
from make_buildings import meta_of, write

DATA = Path(__file__).parent / "data"
HEAD = """\
# Warming of single EnergyPlus zones per kW of convective heat to the zone air from an hour on, open loop: the heat of
# the zone's thermostat is replayed with its own plant off, without and with 10 W/m2 more; neighbours keep their
# thermostats.  {what}
# Made by benchmarks/make_step_tests.py (EnergyPlus 25.2, PyPI package pyenergyplus-lbnl).
"""
TESTS = "A row per step (day, start_h: hour of local standard time); K_per_kW_<lead>: after so many hours [K/kW]."
GAINS = "lead_h [h]; median, low, high [K/kW] of steps at 4 hours of 3 days."


def _steps(folder: Path, zone: Building, season: str) -> Path:
    return folder / f"{zone.name}_{season}_steps.csv"


def _log(folder: Path, zone: Building) -> Path:
    return folder / f"{zone.name}_irregular.csv"


def _make(building: Building, folder: Path) -> None:
    zones = single_zones(building)
    todo = [(z, s) for z in zones for s in z.seasons if not _steps(folder, z, s).is_file()]
    if not todo and all(_log(folder, z).is_file() for z in zones):
        return
    begin = time.perf_counter()
    plant = Plant(building)
    log = plant.log()
    for zone in zones:
        write(table_of(log, zone, {zone.zones[0]: 1.0}, None), _log(folder, zone))
    for zone, season in todo:
        write(step_gains(plant, zone, season, log).round(5), _steps(folder, zone, season), index=False)
        print(f"{zone.name}, {season}: {time.perf_counter() - begin:.0f} s since its start", flush=True)


def _reference(folder: Path) -> None:
    """Put all that is made into the reference."""
    zones = [zone for building in TESTED for zone in single_zones(building)]
    paths = [_steps(folder, zone, season) for zone in zones for season in zone.seasons]
    tests = pd.concat([pd.read_csv(path) for path in paths if path.is_file()])
    values = [f"K_per_kW_{lead:g}h" for lead in LEADS]
    long = tests.rename(columns=dict(zip(values, LEADS, strict=True))).melt(
        ["zone", "season"], list(LEADS), var_name="lead_h", value_name="gain"
    )
    groups = long.groupby(["zone", "season", "lead_h"], sort=False)["gain"]
    gains = groups.agg(median="median", low="min", high="max").reset_index().sort_values(["zone", "season", "lead_h"])
    for name, what, table in (("step_tests", TESTS, tests), ("step_gains", GAINS, gains.round(4))):
        part = DATA / f"{name}.part"
        part.write_text(HEAD.format(what=what) + table.to_csv(index=False, lineterminator="\n"), encoding="utf-8")
        part.replace(DATA / f"{name}.csv")


def main() -> None:
    """Make the missing runs, then the reference."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / ".buildings")
    parser.add_argument("--only", nargs="+", choices=[b.name for b in TESTED])
    options = parser.parse_args()
    if importlib.util.find_spec("pyenergyplus") is None:
        parser.exit(1, "make_step_tests.py needs EnergyPlus: pip install pyenergyplus-lbnl\n")
    folder = options.out / "steps"
    folder.mkdir(parents=True, exist_ok=True)
    for building in TESTED:
        if options.only is None or building.name in options.only:
            _make(building, folder)
    made = [zone for building in TESTED for zone in single_zones(building) if _log(folder, zone).is_file()]
    write(meta_of(made), folder / "meta.csv", index=False)
    _reference(folder)


if __name__ == "__main__":
    main()
