"""Intervals of a day's heating and cooling [kWh] and of its largest load [kW], where only set-points are known.

``python benchmarks/day_totals.py`` runs what is missing and writes ``results/day_totals.md``: the intervals of
``HybridPredictor.sample``, beside the sums of each row's own quantiles and paths whose rows are drawn independently.
The logs and the days are those of ``set_points_known.py``; finished rows are kept in ``benchmarks/.day_totals``.

    python benchmarks/day_totals.py --data "office autumn"           some rows
    python benchmarks/day_totals.py --buildings FOLDER/dev           buildings that make_buildings.py made
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from _forecast_data import chosen
from _report import RESULTS
from set_points_known import DAY, Log, logs

from skhybrid import HybridPredictor

STORE = Path(__file__).parent / ".day_totals"
N_SAMPLES, LEVELS, HOURS = 200, (0.1, 0.9), 0.25
JOINT, SUMMED, APART = "paths", "sums of quantiles", "rows apart"
TOTALS = ("heating", "cooling", "largest load")
_LEAST = 0.2  # share of the days with some heating or cooling, below which its sum is not judged
_SOME = 0.5  # kWh that are some


def totals(load: np.ndarray) -> dict[str, np.ndarray]:
    """Of each path (n, H): heating and cooling [kWh], and the largest load [kW]."""
    heat, cold = (np.maximum(sign * load, 0.0).sum(axis=1) * HOURS for sign in (1.0, -1.0))
    return dict(zip(TOTALS, (heat, cold, np.abs(load).max(axis=1)), strict=True))


def intervals(paths: np.ndarray, rng: np.random.Generator) -> dict[str, dict[str, np.ndarray]]:
    """(2,) interval of each total, by each way to make one from paths (n, H)."""
    bands = np.quantile(paths, LEVELS, axis=0)
    found = {
        way: {name: np.quantile(values, LEVELS) for name, values in totals(of).items()}
        for way, of in ((JOINT, paths), (APART, rng.permuted(paths, axis=0)))
    }
    found[SUMMED] = {name: np.sort(values) for name, values in totals(bands).items()}
    return found


def assess(log: Log) -> dict[str, dict[str, float]]:
    """Coverage and mean width of the intervals of each total, from every midnight of the test."""
    model = HybridPredictor(known={"Q_h": 6.0} if log.capacity else None, random_state=0)
    model.fit(log.train, log.train["T_za"])
    later, rng, seconds = log.later, np.random.default_rng(0), []
    plant = [name for name in later if name in ("T_za", "Q_hvac", *log.capacity)]
    clock = later.index.hour * 60 + later.index.minute
    origins = [k for k in np.flatnonzero(clock == 0) - 1 if k >= log.start and k + DAY < len(later)]
    found, truth = [], []
    for k in origins:
        ahead = later[k + 1 : k + 1 + DAY]
        begin = time.perf_counter()
        samples = model.sample(later[: k + 1], ahead.drop(columns=plant), N_SAMPLES, random_state=int(k))
        seconds.append(time.perf_counter() - begin)
        found.append(intervals(samples["Q_hvac"].to_numpy().reshape(N_SAMPLES, DAY), rng))
        truth.append(totals(log.load(ahead)[None]))
    out: dict[str, dict[str, float]] = {}
    for name in TOTALS:
        true = np.array([one[name][0] for one in truth])
        if np.mean(true > _SOME) < _LEAST:
            continue
        row = {"mean": float(true.mean()), "days": len(true), "seconds": float(np.mean(seconds))}
        for way in (JOINT, SUMMED, APART):
            band = np.array([one[way][name] for one in found])
            row[f"coverage, {way}"] = float(np.mean((band[:, 0] <= true) & (true <= band[:, 1])))
            row[f"width, {way}"] = float((band[:, 1] - band[:, 0]).mean())
        out[name] = row
    return out


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of the names of rows")
    parser.add_argument("--buildings", type=Path, nargs="+", default=[], help="folders that make_buildings.py made")
    parser.add_argument("--again", action="store_true", help="repeat what is kept")
    parser.add_argument("--store", type=Path, default=STORE)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    options.store.mkdir(parents=True, exist_ok=True)
    loaders, rows = logs(options.buildings), []
    wanted = chosen(list(loaders), options.data)
    for name, load in loaders.items():
        path = options.store / f"{name.replace(': ', '_')}.json"
        if name in wanted and (options.again or not path.is_file()):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                path.write_text(json.dumps(assess(load())), encoding="utf-8")
            print(name, path.read_text(encoding="utf-8"), flush=True)
        if path.is_file():
            kept = json.loads(path.read_text(encoding="utf-8"))
            rows += [{"log": name, "total": total, **values} for total, values in kept.items()]
    print(pd.DataFrame(rows).round(2).to_string())


if __name__ == "__main__":
    main()
