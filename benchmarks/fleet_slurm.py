"""A fleet on Slurm: the same models as one process makes, also where a job is killed or reaches its wall time.

``python benchmarks/fleet_slurm.py`` needs the commands of Slurm, two free processors and ``pip install dask-jobqueue``,
takes a quarter of an hour, and writes ``results/fleet_slurm.md``.  The nodes have to share the folder for temporary
files (``TMPDIR``).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import joblib
import pandas as pd
from _report import write_table
from dask.distributed import Client

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office
from skhybrid.fleet import ZoneFleet

DAYS = 15
CASES = ("two jobs", "one of them killed after 10 s", "jobs of a minute, replaced when they end")


def make_data(folder: Path, n_zones: int) -> tuple[Path, Path]:
    """Datasets of the training and of the day after it."""
    for number in range(n_zones):
        rows = make_office(DAYS + 1, sampling_time="1h", random_state=number).X.tz_localize("Etc/GMT+6")
        for name, part in (("train", rows[: DAYS * 24]), ("ahead", rows[DAYS * 24 :].drop(columns="T_za"))):
            path = folder / name / f"zone={number:05d}" / "rows.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            part.to_parquet(path)
    return folder / "train", folder / "ahead"


def kill_a_job() -> None:
    """Kill the first job of the queue."""
    time.sleep(10)
    jobs = subprocess.run(["squeue", "-h", "-t", "R", "-o", "%i"], capture_output=True, text=True, check=True).stdout
    subprocess.run(["scancel", "--signal=KILL", jobs.split()[0]], check=True)


def on_slurm(case: str, fit: Callable[[], ZoneFleet], logs: Path) -> tuple[ZoneFleet, float, int]:
    """The fleet fitted by two jobs, the seconds, and the number of jobs that ran."""
    from dask_jobqueue import SLURMCluster

    ends = case == CASES[2]
    with (
        SLURMCluster(
            cores=1,
            processes=1,
            memory="2GB",
            walltime="00:01:00" if ends else "00:30:00",
            job_script_prologue=["export OMP_NUM_THREADS=1"],
            log_directory=str(logs),
        ) as cluster,
        Client(cluster) as client,
    ):
        if ends:
            cluster.adapt(minimum_jobs=2, maximum_jobs=2)
        else:
            cluster.scale(jobs=2)
        client.wait_for_workers(2, timeout=300)
        if case == CASES[1]:
            threading.Thread(target=kill_a_job, daemon=True).start()
        began = time.perf_counter()
        with joblib.parallel_config(backend="dask"):
            fleet = fit()
        return fleet, time.perf_counter() - began, len(list(logs.glob("*.out")))


def main() -> None:
    """Fit the fleet by one process and by Slurm, and compare the forecasts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--zones", type=int, default=160)
    n_zones = parser.parse_args().zones
    if shutil.which("sbatch") is None or find_spec("dask_jobqueue") is None:
        parser.exit(0, "There is no Slurm, or no dask-jobqueue: nothing is measured.\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        train, ahead = make_data(folder, n_zones)
        began = time.perf_counter()
        alone = ZoneFleet(HybridPredictor(), store=folder / "alone", n_jobs=1).fit(train)
        rows = [{"case": "one process", "seconds": time.perf_counter() - began, "jobs": 0, "failed zones": 0}]
        wanted = alone.forecast(None, ahead)
        for number, case in enumerate(CASES):
            fleet = ZoneFleet(HybridPredictor(), store=folder / f"store-{number}")
            made, seconds, n_jobs = on_slurm(case, lambda fleet=fleet: fleet.fit(train), folder / f"logs-{number}")
            same = "yes" if made.forecast(None, ahead).equals(wanted) else "no"
            one = {"case": case, "seconds": seconds, "jobs": n_jobs, "failed zones": len(made.errors_)}
            rows.append(one | {"same forecasts, bit for bit": same})
            print(rows[-1], flush=True)
    version = subprocess.run(["sinfo", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    note = f"{n_zones} zones, {DAYS} days at 1 h; {version}, with dask-jobqueue.  Jobs: those that Slurm started."
    table = pd.DataFrame(rows).fillna("").set_index("case")
    write_table(
        "fleet_slurm", "A fleet on Slurm", f"python benchmarks/fleet_slurm.py --zones {n_zones}", {"Fits": table}, note
    )


if __name__ == "__main__":
    main()
