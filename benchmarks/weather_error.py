"""Cost of an uncertain weather forecast: day-ahead errors and intervals with measured and with forecast weather.

Every model runs on every log of the forecast benchmark, with the weather known in advance and with weather forecasts
of three levels of error (:class:`skhybrid.forecasting.WeatherError`).  Origins are 25 h apart, at most 60 of them.
Writes ``results/weather_error.md``; with ``--set-points`` also ``results/weather_error_set_points.md``, of forecasts by
the default with set-points known and heat not.  Finished rows are kept in ``benchmarks/.rows``.  Logs that are not
beside the checkout are left out.  ``python benchmarks/weather_error.py [--data NAME ...] [--origins N] [--set-points]``
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _forecast_data import BEAM_AND_SKY, DataSet, chosen, data_sets
from _forecast_models import bounds_for
from _report import write_table
from set_points_known import Log
from set_points_known import logs as logs_with_setpoints

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor
from skhybrid.exceptions import SkhybridWarning
from skhybrid.model_selection import backtest, score_backtest, score_intervals

STORE = Path(__file__).parent / ".rows"
WEATHER = ("measured", "low", "medium", "high")
MODELS: dict[str, Callable[[DataSet], Any]] = {
    "hybrid": lambda data: HybridPredictor(),
    "ARX re-fitted": lambda data: ARXRegressor(adapt="refit"),
    "ARX": lambda data: ARXRegressor(),
    "CONV": lambda data: GrayBoxRC(
        known=dict(data.known), bounds=bounds_for(data), n_starts=12, horizon="1D", random_state=0
    ),
}
MOST_ORIGINS = 60
NOTE = (
    "RMSE over all leads of a day [K], coverage [-] and mean width [K] of 80 % intervals.  The weather after each "
    "origin is what was measured, or a forecast with errors of the level low, medium or high (Zheng et al. 2025, "
    "doi:10.1080/19401493.2025.2453537); intervals are asked for with the same `weather_error=`.  Models are trained "
    "on measured weather.  One draw of the weather per origin, the same for all models."
)

SETPOINTS = (
    "The default with set-points known and heat not: the thermostat acts inside the forecast.  RMSE, coverage [-] "
    "and mean width of 80 % intervals over all leads of a day.  Weather as in weather_error.md: errors of a forecast "
    "change each forecast, and its intervals allow for them."
)


def rows_of_data(data: DataSet, n_origins: int) -> list[dict[str, object]]:
    """One row per model and weather."""
    train, later = (frame.drop(columns=list(BEAM_AND_SKY), errors="ignore") for frame in (data.train, data.later))
    later = later[later.index < data.start + n_origins * pd.Timedelta("25h") + pd.Timedelta("1D")]
    found: list[dict[str, object]] = []
    for name, make in MODELS.items():
        model = make(data).fit(train, train["T_za"])
        levels = (0.1, 0.9) if hasattr(model, "predict_quantiles_from") else None
        for weather in WEATHER:
            error = None if weather == "measured" else weather
            table = backtest(
                model,
                later,
                later["T_za"],
                origin_step="25h",
                start=data.start,
                quantiles=levels,
                weather_error=error,
            )
            row = {"data": data.name, "model": name, "weather": weather, "rmse": float(score_backtest(table)["rmse"])}
            if levels is not None:
                scores = score_intervals(table)
                row |= {"coverage": float(scores["coverage"]), "width": float(scores["width"])}
            found.append(row)
            print(row, flush=True)
    return found


def tables(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """RMSE, its ratio to measured weather, coverage and width."""
    names, order = list(dict.fromkeys(frame["data"])), [(m, w) for m in MODELS for w in WEATHER]
    out = {}
    for column, heading in (("rmse", "RMSE [K]"), ("coverage", "Coverage of 80 % intervals"), ("width", "Width [K]")):
        wide = frame.pivot_table(index=["model", "weather"], columns="data", values=column).reindex(order)[names]
        out[heading] = wide.dropna(how="all").round(3)
    rmse = out["RMSE [K]"]
    ratio = rmse / rmse.xs("measured", level="weather").reindex(rmse.index.get_level_values("model")).to_numpy()
    ratio["geometric mean"] = np.exp(np.log(ratio).mean(axis=1))
    out["RMSE relative to measured weather"] = ratio.round(3)
    return out


def rows_under_setpoints(log: Log, name: str, n_origins: int) -> list[dict[str, object]]:
    """One row per weather, of temperature and load where only set-points are known."""
    model = HybridPredictor(known={"Q_h": 6.0} if log.capacity else None, random_state=0)
    model.fit(log.train, log.train["T_za"])
    later = log.later[: log.start + 100 * n_origins + 97]
    found: list[dict[str, object]] = []
    for weather in WEATHER:
        table = backtest(
            model,
            later,
            later["T_za"],
            origin_step="25h",
            start=later.index[log.start],
            quantiles=(0.1, 0.9),
            weather_error=None if weather == "measured" else weather,
            heat_known=False,
        )
        of_load = {"y_pred": "Q_hvac_pred", "q_0.1": "Q_hvac_0.1", "q_0.9": "Q_hvac_0.9"}
        load = table.drop(columns=list(of_load)).rename(columns={old: new for new, old in of_load.items()})
        load["y_true"] = log.load(table.rename(columns=lambda column: str(column).removesuffix("_true")))
        row: dict[str, object] = {"data": name, "weather": weather}
        for quantity, frame in (("T", table), ("load", load)):
            scores = score_intervals(frame)
            row |= {f"{quantity} rmse": float(score_backtest(frame)["rmse"])}
            row |= {f"{quantity} {score}": float(scores[score]) for score in ("coverage", "width")}
        found.append(row)
        print(row, flush=True)
    return found


def tables_under_setpoints(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Summary of all logs, and errors, coverages and widths of each."""
    wide = frame.pivot_table(index="weather", columns="data").reindex(list(WEATHER))
    summary = pd.DataFrame(index=wide.index)
    for quantity, unit in (("T", "K"), ("load", "kW")):
        rmse, coverage = wide[f"{quantity} rmse"], wide[f"{quantity} coverage"]
        summary[f"RMSE of {quantity} [{unit}], geometric mean"] = np.exp(np.log(rmse).mean(axis=1)).round(3)
        ends = zip(coverage.mean(axis=1), coverage.min(axis=1), coverage.max(axis=1), strict=True)
        summary[f"coverage of {quantity}"] = [f"{mean:.2f} ({low:.2f} to {high:.2f})" for mean, low, high in ends]
    columns = {"rmse": "RMSE", "coverage": "coverage", "width": "width"}
    names = {f"{q} {c}": f"{q}, {shown}" for q in ("T", "load") for c, shown in columns.items()}
    each = frame.set_index(["data", "weather"])[list(names)].rename(columns=names).round(3)
    return {"All logs": summary, "Temperature [K] and load [kW] by log": each}


def kept_rows(path: Path, runs: dict[str, Callable[[], list[dict[str, object]]]]) -> list[dict[str, object]]:
    """Rows of an earlier run, and those of the logs that it lacks, which are kept as they come."""
    rows = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    done = {row["data"] for row in rows}
    for name, run in runs.items():
        if name in done:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkhybridWarning)
            rows += run()
        path.parent.mkdir(exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(rows), encoding="utf-8")
        part.replace(path)
    return rows


def main() -> None:
    """Run what is missing, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of names of data sets")
    parser.add_argument("--origins", type=int, default=MOST_ORIGINS, help="at most so many (%(default)s)")
    parser.add_argument("--set-points", action="store_true", help="only set-points known, in place of the heat")
    options = parser.parse_args()
    command = shlex.join(["python", "benchmarks/weather_error.py", *sys.argv[1:]])
    if options.set_points:
        runs = {
            name: lambda name=name, load=load: rows_under_setpoints(load(), name, options.origins)
            for name, load in logs_with_setpoints([]).items()
        }
    else:
        runs = {name: lambda load=load: rows_of_data(load(0), options.origins) for name, load in data_sets().items()}
    runs = {name: runs[name] for name in chosen(list(runs), options.data)}
    if options.set_points:
        name, title, note = "weather_error_set_points", "Weather forecasts where only set-points are known", SETPOINTS
        found = tables_under_setpoints(pd.DataFrame(kept_rows(STORE / f"{name}.json", runs)))
    else:
        name, title, note = "weather_error", "Forecasts under the error of a weather forecast", NOTE
        found = tables(pd.DataFrame(kept_rows(STORE / f"{name}.json", runs)))
    print(write_table(name, title, command, found, note))


if __name__ == "__main__":
    main()
