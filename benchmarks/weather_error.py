"""Cost of an uncertain weather forecast: day-ahead errors and intervals with measured and with forecast weather.

Every model runs on every log of the forecast benchmark, with the weather known in advance and with weather forecasts
of three levels of error (:class:`skhybrid.forecasting.WeatherError`).  Origins are 25 h apart, at most 60 of them.
Writes ``results/weather_error.md``; finished rows are kept in ``benchmarks/.rows``.  Logs that are not beside the
checkout are left out.  ``python benchmarks/weather_error.py [--data NAME ...] [--origins N]``
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
from _forecast_data import BEAM_AND_SKY, DataSet, data_sets
from _forecast_models import bounds_for
from _report import write_table

from skhybrid import ARXRegressor, GrayBoxRC, HybridPredictor
from skhybrid.exceptions import SkhybridWarning
from skhybrid.model_selection import backtest, score_backtest, score_intervals

STORE = Path(__file__).parent / ".rows" / "weather_error.json"
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


def main() -> None:
    """Run what is missing, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of names of data sets")
    parser.add_argument("--origins", type=int, default=MOST_ORIGINS, help="at most so many (%(default)s)")
    options = parser.parse_args()
    rows = json.loads(STORE.read_text(encoding="utf-8")) if STORE.is_file() else []
    done = {row["data"] for row in rows}
    for name, load in data_sets().items():
        if name in done or (options.data and not name.startswith(tuple(options.data))):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkhybridWarning)
            rows += rows_of_data(load(0), options.origins)
        STORE.parent.mkdir(exist_ok=True)
        part = STORE.with_suffix(".part")
        part.write_text(json.dumps(rows), encoding="utf-8")
        part.replace(STORE)
    title = "Forecasts under the error of a weather forecast"
    command = shlex.join(["python", "benchmarks/weather_error.py", *sys.argv[1:]])
    print(write_table("weather_error", title, command, tables(pd.DataFrame(rows)), NOTE))


if __name__ == "__main__":
    main()
