"""A fleet: zones per second of fit and forecast, memory, size of the store, a tick, and what 100 000 zones would take.

``python benchmarks/fleet.py`` measures what is missing (kept in ``benchmarks/.fleet``) and writes ``results/fleet.md``.
Zones have six weeks at 15 min: every other one is an office of :func:`skhybrid.datasets.make_office`, the others are
six weeks of the EnergyPlus year of the small office, from different days on.  Each measurement is a process of its own.

    python benchmarks/fleet.py --zones 12 --short 200     a few minutes
    python benchmarks/fleet.py --zones 1000 --short 10000
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from _forecast_data import office_run
from _report import write_table

from skhybrid import ARXRegressor, HybridPredictor
from skhybrid.datasets import make_office
from skhybrid.fleet import ZoneFleet

FOLDER = Path(__file__).parent / ".fleet"
DAYS, SHORT_DAYS = 42, 8
TARGETS = {
    "fit and forecast on one core [zones/s]": 1.8,
    "the same on two processes [ratio]": 1.7,
    "size of a saved zone [MB]": 1.0,
    "tick of 1 000 zones on two cores [s]": 60.0,
}


def zone_rows(number: int) -> pd.DataFrame:
    """Six weeks and two days of a zone."""
    if number % 2:
        year = office_run("irregular" if number % 4 == 1 else "shifted")
        start = (number * 17) % (len(year) // 96 - DAYS - 2)
        rows = year.iloc[start * 96 : (start + DAYS + 2) * 96]
        return rows[["T_oa", "q_sol", "Q_hvac", "T_za"]]
    start = pd.Timestamp("2023-01-01") + pd.Timedelta(days=(number * 11) % 300)
    return make_office(DAYS + 2, start=start, sampling_time="15min", random_state=number).X.tz_localize("Etc/GMT+6")


def make_data(n_zones: int) -> Path:
    """Datasets of the training; of the day after it; of both, that day not yet measured; and of one more such day."""
    folder = FOLDER / "data"
    for number in range(n_zones):
        done = folder / "tick" / f"zone={number:05d}" / "rows.parquet"  # written last
        if done.exists():
            continue
        rows, day = zone_rows(number), 96
        parts = {
            "train": rows[: DAYS * day],
            "ahead": rows[DAYS * day : (DAYS + 1) * day].drop(columns="T_za"),
            "plan": rows[: (DAYS + 1) * day].assign(T_za=rows["T_za"].where(np.arange(len(rows)) < DAYS * day)),
            "tick": rows.assign(T_za=rows["T_za"].where(np.arange(len(rows)) < (DAYS + 1) * day)),
        }
        for name, part in parts.items():
            path = folder / name / f"zone={number:05d}" / "rows.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            part.to_parquet(path)
    return folder


def first(folder: Path, n_zones: int) -> Path:
    """A dataset of the first zones only, by links."""
    some = folder.parent / "some" / f"{n_zones}" / folder.name
    some.mkdir(parents=True, exist_ok=True)
    for zone in sorted(folder.iterdir())[:n_zones]:
        if not (some / zone.name).exists():
            (some / zone.name).symlink_to(zone)
    return some


def peak_memory() -> float:
    """Highest memory of this process and of its largest worker [MB]."""
    own, workers = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return (own + workers) / 1024


def fit(n_zones: int, n_jobs: int) -> dict[str, float]:
    """Fit and forecast the first zones."""
    data, store = FOLDER / "data", FOLDER / f"store-{n_zones}-{n_jobs}"
    shutil.rmtree(store, ignore_errors=True)
    warm_up()
    fleet = ZoneFleet(HybridPredictor(), store=store, fallback=ARXRegressor(), n_jobs=n_jobs)
    began, spent = time.perf_counter(), time.process_time()
    fleet.fit(first(data / "train", n_zones))
    failed = len(fleet.errors_)
    found = fleet.forecast(None, first(data / "ahead", n_zones))
    seconds, cpu = time.perf_counter() - began, time.process_time() - spent
    sizes = [sum(file.stat().st_size for file in store.glob(f"{zone}.*")) for zone in fleet.zones_]
    return {
        "zones": n_zones,
        "processes": n_jobs,
        "seconds": seconds,
        "cpu of the parent": cpu,
        "zones/s": n_zones / seconds,
        "peak memory [MB]": peak_memory(),
        "MB per zone, mean": float(np.mean(sizes)) / 1e6,
        "MB per zone, largest": max(sizes) / 1e6,
        "forecast zones": int(found["zone"].nunique()),
        "fallback": failed,
    }


def tick(n_zones: int, n_jobs: int) -> dict[str, float]:
    """A new day and a forecast of the next one, on a copy of the store."""
    source, store = FOLDER / f"store-{n_zones}-1", FOLDER / "store-tick"
    shutil.rmtree(store, ignore_errors=True)
    shutil.copytree(source, store)
    fleet = ZoneFleet(HybridPredictor(), store=store, fallback=ARXRegressor(), n_jobs=n_jobs)
    warm_up()
    fleet.tick(first(FOLDER / "data" / "plan", n_zones))  # the forecast that the next tick will score
    began = time.perf_counter()
    found = fleet.tick(first(FOLDER / "data" / "tick", n_zones))
    seconds = time.perf_counter() - began
    began = time.perf_counter()
    fleet.status(page=FOLDER / "status.html")
    return {
        "zones": n_zones,
        "processes": n_jobs,
        "tick [s]": seconds,
        "tick of 1 000 [s]": 1000 * seconds / n_zones,
        "status of 1 000 [s]": 1000 * (time.perf_counter() - began) / n_zones,
        "forecast zones": int(found["zone"].nunique()),
        "peak memory [MB]": peak_memory(),
    }


def short(n_zones: int, n_jobs: int) -> dict[str, float]:
    """Many small zones, in which the store and the scheduler show: ARX on eight days at 1 h."""
    rows = make_office(SHORT_DAYS, sampling_time="1h", random_state=0).X
    store = FOLDER / "store-short"
    shutil.rmtree(store, ignore_errors=True)
    fleet = ZoneFleet(ARXRegressor(), store=store, n_jobs=n_jobs)
    began = time.perf_counter()
    fleet.fit((f"zone {number:06d}", rows + 1e-6 * number) for number in range(n_zones))
    fitted = time.perf_counter() - began
    began = time.perf_counter()
    fleet.fit((f"zone {number:06d}", rows + 1e-6 * number) for number in range(n_zones))
    again = time.perf_counter() - began
    began = time.perf_counter()
    n_listed = len(fleet.zones_)
    listed = time.perf_counter() - began
    return {
        "zones": n_zones,
        "fit [ms/zone]": 1e3 * fitted / n_zones,
        "fit again, nothing new [ms/zone]": 1e3 * again / n_zones,
        "listing the store [s]": listed,
        "files": 2 * n_listed,
        "peak memory [MB]": peak_memory(),
    }


def warm_up() -> None:
    """Compile and import before the clock starts."""
    rows = zone_rows(0)
    HybridPredictor(network="1R1C").fit(rows[: 8 * 96], rows["T_za"][: 8 * 96])


def measured(name: str, *given: int) -> dict[str, float]:
    """A measurement, from the file that keeps it or of a new process."""
    kept = FOLDER / "measured.json"
    known = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    key = f"{name} {' '.join(map(str, given))}"
    if key not in known:
        print(key, flush=True)
        command = [sys.executable, __file__, "--one", name, *map(str, given)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        known[key] = json.loads(done.stdout.splitlines()[-1])
        kept.write_text(json.dumps(known, indent=1), encoding="utf-8")
    return known[key]


def tables(n_zones: int, n_short: int) -> None:
    """Measure what is missing, and write the table."""
    fits = pd.DataFrame([measured("fit", n, 1) for n in sorted({max(2, n_zones // 4), n_zones})])
    both = measured("fit", n_zones, 2)
    ticks = pd.DataFrame([measured("tick", n_zones, n) for n in (1, 2)])
    shorts = pd.DataFrame([measured("short", n, 1) for n in sorted({max(10, n_short // 10), n_short})])
    one, two = fits.iloc[-1], pd.Series(both)
    values = [one["zones/s"], two["zones/s"] / one["zones/s"], one["MB per zone, largest"]]
    values.append(ticks["tick of 1 000 [s]"].iloc[-1])
    goals = pd.DataFrame({"measured": values, "target": list(TARGETS.values())}, index=list(TARGETS))
    many = 100_000
    grown = {
        "fit and forecast, one core [h]": many / one["zones/s"] / 3600,
        "fit and forecast, 64 cores at the ratio of two [h]": many / one["zones/s"] / 64 / 3600 * 2 / values[1],
        "tick, two cores [min]": many / 1000 * values[-1] / 60,
        "store [GB]": many * one["MB per zone, mean"] / 1000,
        "files in the store": 2 * many,
        "listing the store [s]": many / shorts["zones"].iloc[-1] * shorts["listing the store [s]"].iloc[-1],
        "memory beyond one zone [MB]": many * slope(shorts["zones"], shorts["peak memory [MB]"]),
    }
    write_table(
        "fleet",
        "A fleet of zones",
        f"python benchmarks/fleet.py --zones {n_zones} --short {n_short}",
        {
            "Goals": goals.rename_axis("what"),
            "Fit and forecast": pd.concat([fits, pd.DataFrame([both])]).set_index("zones"),
            "A tick": ticks.set_index("zones"),
            "Short zones": shorts.set_index("zones"),
            "100 000 zones, extrapolated": pd.DataFrame({"value": grown}).rename_axis("what"),
        },
        "Six weeks at 15 min per zone, offices and EnergyPlus in turn; short zones: eight days at 1 h, ARX.  Memory is "
        "that of the parent and of its largest worker.  The extrapolation is proportional, except for memory, which "
        "grows by the slope between the two numbers of short zones.  The parent holds one path per zone and the table "
        "that a method returns; the store needs two files per zone.",
    )


def slope(zones: pd.Series, memory: pd.Series) -> float:
    """Growth of memory per zone [MB], at least 0."""
    return max(0.0, float(memory.iloc[-1] - memory.iloc[0])) / max(zones.iloc[-1] - zones.iloc[0], 1)


def main() -> None:
    """Run one measurement, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--zones", type=int, default=60)
    parser.add_argument("--short", type=int, default=1000)
    parser.add_argument("--one", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.one:
        name, *numbers = given.one
        print(json.dumps({"fit": fit, "tick": tick, "short": short}[name](*map(int, numbers))))
        return
    make_data(given.zones)
    tables(given.zones, given.short)


if __name__ == "__main__":
    main()
