"""Intervals of the sums and extremes of a day, by paths of the whole day, where only set-points are known.

``python benchmarks/day_totals.py`` runs what is missing and writes ``results/day_totals.md``: the intervals of
``HybridPredictor.sample``, beside those of sums of each row's own quantiles and of paths whose rows are drawn apart.
The logs are those of ``set_points_known.py``; finished rows are kept in ``benchmarks/.day_totals``.

    python benchmarks/day_totals.py --data "office autumn"           some rows
    python benchmarks/day_totals.py --buildings FOLDER/dev           buildings that make_buildings.py made
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from _forecast_data import chosen
from _report import write_table
from set_points_known import DAY, Log, logs, options_of

from skhybrid import HybridPredictor

STORE = Path(__file__).parent / ".day_totals"
N_SAMPLES, LEVELS, HOURS = 200, (0.1, 0.9), 0.25
PATHS, QUANTILES, APART = "paths", "quantiles", "apart"
ENERGY, PEAK, WARMEST, COLDEST = "energy [kWh]", "largest load [kW]", "highest T_za [degC]", "lowest T_za [degC]"


def totals(load: np.ndarray, T: np.ndarray, sign: float) -> dict[str, np.ndarray]:
    """Of paths (n, H) of a day: heating (or cooling, of ``sign`` -1), the largest load, and the extremes of T_za."""
    energy = np.maximum(sign * load, 0.0).sum(axis=1) * HOURS
    return {ENERGY: energy, PEAK: np.abs(load).max(axis=1), WARMEST: T.max(axis=1), COLDEST: T.min(axis=1)}


def intervals(load: np.ndarray, T: np.ndarray, sign: float, rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """80 % intervals of each total, by each way to make them from paths (n, H)."""
    apart = (rng.permuted(paths, axis=0) for paths in (load, T))
    bands = (np.quantile(paths, LEVELS, axis=0) for paths in (load, T))
    return {
        PATHS: pd.DataFrame(totals(load, T, sign)).quantile(LEVELS),
        QUANTILES: pd.DataFrame(totals(*bands, sign)).apply(np.sort),
        APART: pd.DataFrame(totals(*apart, sign)).quantile(LEVELS),
    }


def assess(log: Log) -> dict[str, dict[str, float]]:
    """Coverage and mean width of the intervals of each total, from every midnight of the test."""
    model = HybridPredictor(known={"Q_h": 6.0} if log.capacity else None, random_state=0)
    model.fit(log.train, log.train["T_za"])
    later, rng, days = log.later, np.random.default_rng(0), []
    unknown = ["T_za", *(log.capacity or ["Q_hvac"])]
    clock = later.index.hour * 60 + later.index.minute
    for k in np.flatnonzero(clock == 0) - 1:
        ahead = later[k + 1 : k + 1 + DAY]
        if k < log.start or len(ahead) < DAY:
            continue
        samples = model.sample(later[: k + 1], ahead.drop(columns=unknown), N_SAMPLES, random_state=int(k))
        load, T = (samples[name].to_numpy().reshape(N_SAMPLES, DAY) for name in ("Q_hvac", "T_za"))
        sign = 1.0 if load.sum() >= 0.0 else -1.0
        truth = totals(log.load(ahead)[None], ahead["T_za"].to_numpy()[None], sign)
        found = {way: band.to_numpy() for way, band in intervals(load, T, sign, rng).items()}
        days.append((np.array([value[0] for value in truth.values()]), found))
    true = np.array([one for one, _ in days])
    rows = {name: {"days": len(days), "mean": float(of)} for name, of in zip(truth, true.mean(axis=0), strict=True)}
    for way in (PATHS, QUANTILES, APART):
        low, high = np.array([band[way] for _, band in days]).swapaxes(0, 1)
        inside, width = ((low <= true) & (true <= high)).mean(axis=0), (high - low).mean(axis=0)
        for k, row in enumerate(rows.values()):
            row |= {f"coverage, {way}": float(inside[k]), f"width, {way}": float(width[k])}
    return rows


def tables(runs: dict[str, dict[str, dict[str, float]]]) -> dict[str, pd.DataFrame]:
    """A table for each total, and one of the means over the logs."""
    by_total = {
        name: pd.DataFrame({log: run[name] for log, run in runs.items()}).T for name in (ENERGY, PEAK, WARMEST, COLDEST)
    }
    covered = [f"coverage, {way}" for way in (PATHS, QUANTILES, APART)]
    means = pd.DataFrame({name: table[covered].mean() for name, table in by_total.items()}).T.round(2)
    found = {"Mean coverage": means.rename_axis("total")}
    for name, table in by_total.items():
        whole = table.assign(days=table["days"].astype(int).astype(str))
        found[name[0].upper() + name[1:]] = whole.rename_axis("log")
    return found


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the table."""
    options = options_of(__doc__, STORE, arguments)
    loaders, runs = logs(options.buildings), {}
    wanted = chosen(list(loaders), options.data)
    for name, load in loaders.items():
        path = options.store / f"{name.replace(': ', '_')}.json"
        if name in wanted and (options.again or not path.is_file()):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                path.write_text(json.dumps(assess(load())), encoding="utf-8")
            print(name, flush=True)
        if path.is_file():
            runs[name] = json.loads(path.read_text(encoding="utf-8"))
    write_table(
        "day_totals",
        "Sums and extremes of a day",
        " ".join(["python benchmarks/day_totals.py", *sys.argv[1:]]),
        tables(runs),
        "Weather and set-points known, a forecast at every midnight of the test: coverage and mean width of 80 % "
        f"intervals.  `{PATHS}`: quantiles of the totals of {N_SAMPLES} paths of `HybridPredictor.sample`.  "
        f"`{QUANTILES}`: totals of the quantiles of each row.  `{APART}`: as `{PATHS}`, but each row drawn by itself.  "
        "The energy is that of heating or of cooling, whichever is forecast to be more.",
        options.results,
    )


if __name__ == "__main__":
    main()
