"""The forecast benchmark: day-ahead error of temperature and load, every model on every log.

``python benchmarks/forecast.py`` runs what is missing and writes ``results/forecast.md``, ``forecast.csv`` and
``forecast.png``.  Finished runs are kept in ``benchmarks/.forecast``, so it may be stopped at any moment and continued.
``--tag`` names a version of the code; runs with another tag are repeated.  Logs that are not beside the checkout
(``../shared/data``) are left out.  Run it on one core (``OMP_NUM_THREADS=1``), because times are those of one core.

    python benchmarks/forecast.py --quick                                a subset, in about two minutes
    python benchmarks/forecast.py --data office --models ARX "hybrid*"   some rows, some columns
    python benchmarks/forecast.py --models "hybrid*" --tag blend         again, since the code has changed
    python benchmarks/forecast.py --networks                             with the paper's networks (hours)
    python benchmarks/forecast.py --tables-only                          from what is kept
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from _forecast_data import DataSet, chosen, data_sets, varies
from _forecast_models import ARX, HYBRID, MODELS, REFITTED, Model
from _forecast_store import STORE, assess, is_done, write_run
from _forecast_tables import write_results
from _report import RESULTS

QUICK_DATA = ("dutch home 2", "dutch home 3", "office autumn, new control")
QUICK_MODELS = ("yesterday", "CONV", "hour-of-week mean", ARX, REFITTED, HYBRID)


def tasks(
    loaders: dict[str, Callable[[int], DataSet]], models: list[str], seeds: int
) -> Iterator[tuple[str, int, list[str]]]:
    """Data set, seed and the models for which this seed matters."""
    for name in loaders:
        for seed in range(seeds):
            yield name, seed, [m for m in models if seed == 0 or varies(name) or MODELS[m].random]


def run_one(data: DataSet, name: str, spec: Model, seed: int, tag: str, store: Path) -> None:
    """Run, keep and print the result; a failure is printed, and tried again by the next command."""
    begun = time.perf_counter()
    try:
        run = assess(data, name, spec, seed, tag)
    except Exception as error:  # one model must not end a night's run
        print(f"{data.name} | {name} | {seed}: FAILED, {type(error).__name__}: {error}", flush=True)
        return
    write_run(run, store)
    rmse = (run.temperature.square.sum() / run.temperature.count.sum()) ** 0.5
    print(f"{data.name} | {name} | {seed}: {rmse:.3f} K, {time.perf_counter() - begun:.1f} s", flush=True)


def fill(options: argparse.Namespace) -> None:
    """Run what is requested and missing."""
    loaders = data_sets(options.buildings)
    loaders = {n: loaders[n] for n in chosen(list(loaders), options.data)}
    groups = {"cheap", *([] if options.no_hybrid else ["hybrid"]), *(["networks"] if options.networks else [])}
    usual = [n for n, spec in MODELS.items() if spec.group in groups]
    models = usual if options.models is None else chosen(list(MODELS), options.models)
    for name, seed, wanted in tasks(loaders, models, options.seeds):
        left = [m for m in wanted if not is_done(name, m, seed, options.tag, options.store)]
        data = loaders[name](seed) if left else None
        for model in left:
            if data is not None and MODELS[model].applies(data):
                run_one(data, model, MODELS[model], seed, options.tag or "1", options.store)


def read_options(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="names of data sets, their beginnings or patterns")
    parser.add_argument("--models", nargs="+", help="names of models, their beginnings or patterns")
    parser.add_argument("--seeds", type=int, default=3, help="realisations of make_office, starts of networks")
    parser.add_argument("--buildings", type=Path, nargs="+", default=[], help="folders that make_buildings.py made")
    parser.add_argument("--tag", help="version of the code; runs with another tag are repeated")
    parser.add_argument("--networks", action="store_true", help="the paper's networks too, which take hours")
    parser.add_argument("--no-hybrid", action="store_true", help="without the hybrid default")
    parser.add_argument("--quick", action="store_true", help="a small subset")
    parser.add_argument("--tables-only", action="store_true", help="write the tables of what is kept")
    parser.add_argument("--store", type=Path, default=STORE, help="where runs are kept")
    parser.add_argument("--results", type=Path, help="where tables and figure are written")
    options = parser.parse_args(arguments)
    if options.results is None:  # a subset must not replace the tables of the whole
        options.results = options.store / "quick" if options.quick else RESULTS
    if options.quick:
        options.data, options.models = options.data or [*QUICK_DATA], options.models or [*QUICK_MODELS]
        options.seeds = 1
    return options


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the tables."""
    options = read_options(arguments)
    if not options.tables_only:
        fill(options)
    for path in write_results(options.store, options.results):
        print(path)


if __name__ == "__main__":
    main()
