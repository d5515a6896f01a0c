"""Cut the shipped small office (``skhybrid/datasets/data/small_office_*.csv.gz``) from year-long EnergyPlus tables.

    python benchmarks/data/make_small_office.py FOLDER

FOLDER holds ``small_office_chicago_irregular.csv`` and ``small_office_chicago_shifted.csv``: powers are means over,
and temperatures values at, the 15 minutes that end at the stamp.  Here means move to the start of their step.

The year-long tables are EnergyPlus 25.2 runs (PyPI package ``pyenergyplus-lbnl``: engine, reference models, weather)
of the DOE reference small office.  Credit: EnergyPlus (LBNL/DOE); reference buildings: Deru et al. (2011).
"""

from __future__ import annotations

import argparse
import gzip
from pathlib import Path

import pandas as pd

from skhybrid.datasets import read_zone_csv

TARGET = Path(__file__).resolve().parents[2] / "skhybrid" / "datasets" / "data"
SPAN = slice("2018-08-20 00:00", "2018-12-16 23:45")
#: shipped name -> (column, decimals); names beginning with T_ are values at the stamp.
COLUMNS = {
    "T_za": ("T_in_degC", 3),
    "T_oa": ("T_out_degC", 2),
    "set_heat": ("set_heat_degC", 1),
    "set_cool": ("set_cool_degC", 1),
    "q_sol": ("ghi_kW_m2", 4),
    "dni": ("dni_kW_m2", 3),
    "dhi": ("dhi_kW_m2", 3),
    "Q_hvac": ("q_hvac_kW", 3),
    "stage_heat": ("stage_heat", 4),
    "stage_cool": ("stage_cool", 4),
    "heat_gain": ("truth_gains_kW", 3),
    "people": ("truth_people", 2),
}
#: what the shifted run shares with the other one, and so is shipped once.
SHARED = ("T_oa", "q_sol", "dni", "dhi", "people")


def cut(path: Path) -> pd.DataFrame:
    """The span of a year-long table, left-labelled and rounded."""
    names = {role: column for role, (column, _) in COLUMNS.items()}
    frame = read_zone_csv(path, names, label="right").loc[SPAN]
    return frame.round({role: decimals for role, (_, decimals) in COLUMNS.items()})


def write(frame: pd.DataFrame, control: str) -> None:
    """Write without the time of writing in the archive, so that equal data give equal files."""
    path = TARGET / f"small_office_{control}.csv.gz"
    text = frame.to_csv(date_format="%Y-%m-%dT%H:%M%z", lineterminator="\n")
    path.write_bytes(gzip.compress(text.encode(), compresslevel=9, mtime=0))
    print(f"{path.name}: {len(frame)} rows, {path.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the year-long tables are")
    folder = parser.parse_args().folder
    write(cut(folder / "small_office_chicago_irregular.csv"), "irregular")
    write(cut(folder / "small_office_chicago_shifted.csv").drop(columns=list(SHARED)), "shifted")


if __name__ == "__main__":
    main()
