"""Make the EnergyPlus years that the day-ahead forecast is tuned (``dev``) and, once, tested on (``held``, ``replay``).

``rooms`` has every room of some offices.

    pip install pyenergyplus-lbnl
    python benchmarks/make_buildings.py [--out FOLDER] [--only NAME ...] [--group dev|held|replay|rooms]

Writes ``FOLDER/dev/<name>_{irregular,shifted}.csv``, the same under ``held``, ``<name>_{irregular,replayed}.csv`` under
``replay`` (heat of other people's thermostat), and a ``meta.csv`` in each with place and spans of training and test.
Files that are there are not made again; a file is whole or not there.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path

import pandas as pd
from _buildings import (
    BUILDINGS,
    CONTROLS,
    REPLAYABLE,
    REPLAYED,
    SEASONS,
    Building,
    make_tables,
)
from _energyplus import site
from _office_rooms import OFFICES, Rooms, tables_of_rooms

#: folder -> buildings and their runs
GROUPS = {
    "dev": ([b for b in BUILDINGS if not b.held_out], CONTROLS),
    "held": ([b for b in BUILDINGS if b.held_out], CONTROLS),
    "replay": (list(REPLAYABLE), REPLAYED),
    "rooms": (list(OFFICES), CONTROLS),
}


def write(table: pd.DataFrame, path: Path, index: bool = True) -> None:
    part = path.with_suffix(".part")
    if index:
        table = table.set_axis(table.index.map(pd.Timestamp.isoformat).rename("timestamp"))
    table.to_csv(part, index=index)
    part.replace(path)


def _make(building: Building, folder: Path, controls: tuple[str, ...] = CONTROLS) -> None:
    missing = tuple(control for control in controls if not _path(folder, building, control).is_file())
    if not missing:
        return
    begin = time.perf_counter()
    make = tables_of_rooms if isinstance(building, Rooms) else make_tables
    for control, table in make(building, missing):
        write(table, _path(folder, building, control))
        print(f"{building.name}, {control}: {time.perf_counter() - begin:.0f} s since its start", flush=True)


def _path(folder: Path, building: Building, control: str) -> Path:
    return folder / f"{building.name}_{control}.csv"


def meta_of(buildings: list[Building]) -> pd.DataFrame:
    rows = []
    for building in buildings:
        for season in building.seasons:
            spans = dict(zip(("train_start", "train_end", "test_start", "test_end"), SEASONS[season], strict=True))
            about = {
                "name": building.name,
                "building": building.model,
                "zones": "; ".join(building.zones),
                "use": building.use,
                "climate": building.climate,
            }
            rows.append(about | site(building.climate) | {"season": season} | spans)
    return pd.DataFrame(rows)


def main() -> None:
    """Make the missing years."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / ".buildings")
    parser.add_argument("--group", choices=list(GROUPS))
    parser.add_argument(
        "--only", nargs="+", choices=sorted({b.name for members, _ in GROUPS.values() for b in members})
    )
    args = parser.parse_args()
    if importlib.util.find_spec("pyenergyplus") is None:
        parser.exit(1, "make_buildings.py needs EnergyPlus: pip install pyenergyplus-lbnl\n")
    for group in GROUPS if args.group is None else (args.group,):
        members, controls = GROUPS[group]
        folder = args.out / group
        folder.mkdir(parents=True, exist_ok=True)
        for building in members:
            if args.only is None or building.name in args.only:
                _make(building, folder, controls)
        made = [b for b in members if all(_path(folder, b, c).is_file() for c in controls)]
        if made:
            write(meta_of(made), folder / "meta.csv", index=False)


if __name__ == "__main__":
    main()
