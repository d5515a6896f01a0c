"""The paper's complete method of selection (3.2, 3.3, 4.2) on its office in both climates: train, compare, choose.

``python benchmarks/selection_study.py run --store DIR --hours H`` trains an even part of the design matrix, level by
level, and keeps every result in DIR.  It may be stopped and started again at any time.  One process per climate keeps
two cores busiest: ``--climates oakland --jobs 1`` beside ``--climates chicago --jobs 1``.
``python benchmarks/selection_study.py compare --store DIR --offices 7 --repeats 10`` puts the chosen cases beside
ridge, ARX, the default and the gray box in several offices; it may be stopped and started again too.
``python benchmarks/selection_study.py report --store DIR`` writes ``results/selection_study.*`` from what is stored;
without ``--store`` it reads the candidates of the last report from ``results/selection_study.csv``.
"""

from __future__ import annotations

import argparse
import signal
import time
import warnings
from pathlib import Path
from typing import Any

import _study_baselines
import _study_offices
from _study_plan import CHUNK, CLIMATES, ORDER, Split, Unit, estimator, load, units
from _study_store import n_finished

from skhybrid.model_selection import DesignMatrixSearchCV

COMMAND = "python benchmarks/selection_study.py"


class Stopped(KeyboardInterrupt):
    """The time is up, or a user stops the run; a search must not record this as the failure of a candidate."""


def _stop(number: int, frame: Any) -> None:
    raise Stopped(signal.Signals(number).name)


def run(store: Path, hours: float, todo: list[Unit], n_jobs: int) -> bool:
    """Train what is not in the store yet; True if all was finished."""
    store.mkdir(parents=True, exist_ok=True)
    usual = {number: signal.signal(number, _stop) for number in (signal.SIGTERM, signal.SIGALRM)}
    signal.setitimer(signal.ITIMER_REAL, 3600.0 * hours)
    begun, n_done = time.monotonic(), 0
    climates = list(dict.fromkeys(unit.climate for unit in todo))
    try:
        data = {climate: load(climate) for climate in climates}
        for climate in climates:
            _study_baselines.run(store, climate, data[climate])
        for i, unit in enumerate(todo, 1):
            n_new, seconds = search(store, unit, data[unit.climate], n_jobs)
            n_done += n_new
            elapsed = time.monotonic() - begun
            print(
                f"[{elapsed / 3600:.2f} h] {i}/{len(todo)} {unit}: {n_new} candidates in {seconds:.0f} s; "
                f"{n_done} since the start, {60 * n_done / elapsed:.1f} per minute",
                flush=True,
            )
    except KeyboardInterrupt:
        print("stopped; the same command continues", flush=True)
        return False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in usual.items():
            signal.signal(number, handler)
    return True


def search(store: Path, unit: Unit, data: Split, n_jobs: int, **changes: Any) -> tuple[int, float]:
    """Run one search; returns the number of new candidates and the seconds."""
    begun = time.time()
    made = DesignMatrixSearchCV(
        estimator(**changes),
        unit.matrix(),
        cv=[data.rows],
        store=store / f"{unit.climate}.sqlite",
        n_jobs=n_jobs,
        refit=False,
        chunk_size=CHUNK[unit.framework],
        verbose=0,
    )
    before = n_finished(made.store)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made.fit(data.X, data.y)
    return n_finished(made.store) - before, time.time() - begun


def main() -> None:
    """Run, or report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["run", "compare", "report"])
    parser.add_argument(
        "--store", type=Path, help="folder of results; a report without one reads the last report's .csv"
    )
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--levels", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--climates", nargs="+", default=list(CLIMATES), choices=list(CLIMATES))
    parser.add_argument("--frameworks", nargs="+", default=list(ORDER), choices=list(ORDER), help="in this order")
    parser.add_argument("--by-size", action="store_true", help="one size of all frameworks, then the next size")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--offices", type=int, default=7, help="compare: offices of each climate")
    parser.add_argument("--repeats", type=int, default=10, help="compare: networks of the chosen case")
    given = parser.parse_args()
    if given.store is None and given.what != "report":
        parser.error(f"{given.what} needs --store, the folder of results.")
    if given.what == "run":
        todo = list(units(given.levels, given.climates, given.frameworks, given.by_size))
        run(given.store, given.hours, todo, given.jobs)
    elif given.what == "compare":
        _study_offices.run(given.store, given.climates, given.offices, given.repeats)
    else:
        from _study_report import report

        report(given.store)


if __name__ == "__main__":
    main()
