"""The paper's sections 4.3 and 4.4 again: temperature and load a day ahead, conventional against hybrid.

Writes ``results/paper_forecast.md`` and ``results/paper_forecast_*.png``.  About 15 minutes on one core, most of them
networks in training: ``python benchmarks/paper_forecast.py``.  What a method forecast is kept in ``benchmarks/.rows``,
so that a run that was stopped goes on where it was; ``--again default`` computes the named methods anew, and
``--again`` alone all of them; ``--report`` writes what there is.
"""

from __future__ import annotations

import argparse
import re
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _paper_forecast_claims import CLAIMS, WHY, judge
from _paper_forecast_data import LOGS, PER_DAY, Log, available, methods, midnights
from _paper_forecast_figures import DRAWN, draw_all
from _report import write_table

from skhybrid.exceptions import SkhybridWarning

ROWS = Path(__file__).parent / ".rows" / "paper_forecast"
COMMAND = "python benchmarks/paper_forecast.py"
WINDOWS = ("0-6 h", "6-12 h", "12-18 h", "18-24 h")


# ------------------------------------------------------------------------------------------------------------ forecasts
def forecast(model: Any, log: Log) -> pd.DataFrame:
    """What one method says of every test row.

    Returns
    -------
    DataFrame
        By stamp: ``temperature`` [degC], forecast from the last midnight before; ``load`` [kW], which holds the
        measured temperature; ``plan`` [kW], which holds the set-points, where there are any.
    """
    begun = time.perf_counter()
    X = log.after
    model.fit(log.train, log.train["T_za"])
    fitted = time.perf_counter()
    origins = midnights(X.index)
    origins = origins[(X.index[origins] >= log.test_start) & (origins + PER_DAY < len(X))]
    paths = model.predict_from(X, origins)
    rows = origins[:, None] + np.arange(1, PER_DAY + 1)
    out = pd.DataFrame({"temperature": np.nan}, index=X.index)
    out.iloc[rows.ravel(), 0] = paths.ravel()
    held = X["T_za"].interpolate(limit_direction="both")
    out["load"] = log.heat(model.predict_load(X, held))
    out["plan"] = np.nan if log.band is None else log.heat(model.predict_load(X, log.band))
    out = out[out.index >= log.test_start]
    out.attrs = {"fit": fitted - begun, "predict": time.perf_counter() - fitted}
    return out


def kept(name: str, log: Log, seed: int, again: list[str] | None, compute: bool) -> dict[str, pd.DataFrame]:
    """The forecasts of every method, from an earlier run if there is one; without ``compute`` from that run only."""
    out = {}
    for method, make in methods(log, seed).items():
        path = ROWS / f"{name} {seed} {method}.pkl".replace(" ", "_")
        redo = again is not None and (not again or method in again)
        if not compute and not path.is_file():
            continue
        if compute and (redo or not path.is_file()):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SkhybridWarning)
                made = forecast(make(), log)
            part = path.with_suffix(".part")
            ROWS.mkdir(parents=True, exist_ok=True)
            made.to_pickle(part)
            part.replace(path)
            print(f"{name}, seed {seed}, {method}: {made.attrs['fit']:.1f} s to fit", flush=True)
        out[method] = pd.read_pickle(path)
    return out


# --------------------------------------------------------------------------------------------------------------- scores
def rmse(error: pd.Series) -> float:
    """Root of the mean square; NaN is left out."""
    return float(np.sqrt(np.nanmean(np.square(error))))


def measure(said: pd.DataFrame, log: Log) -> dict[str, float]:
    """Every number of one method on one log."""
    X = log.after.loc[said.index]
    error = said["temperature"] - X["T_za"]
    # a temperature at a stamp is that of the step before it, of whose window it is
    parts = _parts(error, (error.index - pd.Timedelta("15min")), "K")
    parts["T correlation"] = float(said["temperature"].corr(X["T_za"]))
    heat, load = (series.resample("1h").mean() for series in (log.heat(X), said["load"]))
    parts |= _parts(load - heat, heat.index, "kW")
    parts["load correlation"] = float(load.corr(heat))
    parts["load bias kW"] = float((load - heat).mean())
    mean = float(heat.abs().mean())
    parts["mean load kW"], parts["load %"] = mean, 100 * parts["kW"] / mean
    quarter = (load - heat).groupby([heat.index.normalize(), heat.index.hour // 6]).mean()
    parts["6 h kW"] = rmse(quarter)
    if said["plan"].notna().any():
        plan = said["plan"].resample("1h").mean()
        parts["plan kW"] = rmse(plan - heat)
        parts["day kWh"] = rmse(24 * (plan.resample("1D").mean() - heat.resample("1D").mean()))
    return parts | {"fit s": said.attrs["fit"], "predict s": said.attrs["predict"]}


def _parts(error: pd.Series, time: pd.DatetimeIndex, unit: str) -> dict[str, float]:
    """RMSE over all rows, by 6-hour window of the day, and by kind of day."""
    out = {unit: rmse(error)}
    out |= {f"{w} {unit}": rmse(error[time.hour // 6 == i]) for i, w in enumerate(WINDOWS)}
    weekend = time.day_of_week >= 5
    return out | {f"weekend {unit}": rmse(error[weekend]), f"weekday {unit}": rmse(error[~weekend])}


# --------------------------------------------------------------------------------------------------------------- tables
def spread(values: list[float]) -> str:
    """Median, with the lowest and highest if they differ."""
    values = [v for v in values if np.isfinite(v)]
    if not values:
        return ""
    middle, low, high = (f"{f(values):.3g}" for f in (np.median, min, max))
    return middle if low == high else f"{middle} ({low} to {high})"


def _over_seeds(frames: list[pd.DataFrame], method: str, quantity: str) -> str:
    """One cell, from the seeds in which the method was run."""
    return spread([f.loc[method, quantity] for f in frames if method in f.index and quantity in f])


def table_of(runs: dict[str, list[pd.DataFrame]], quantity: str) -> pd.DataFrame:
    """One row per method, one column per log: median (lowest to highest)."""
    names = list(dict.fromkeys(m for frames in runs.values() for m in frames[0].index))
    cells = {m: {log: _over_seeds(frames, m, quantity) for log, frames in runs.items()} for m in names}
    table = pd.DataFrame(cells).T.rename_axis("method")
    return table.loc[:, (table != "").any()]


def windows_of(frames: list[pd.DataFrame], unit: str) -> pd.DataFrame:
    """One row per method, one column per 6-hour window and kind of day."""
    columns = [unit, *(f"{w} {unit}" for w in WINDOWS), f"weekday {unit}", f"weekend {unit}"]
    cells = {m: {c: _over_seeds(frames, m, c) for c in columns} for m in frames[0].index}
    return pd.DataFrame(cells).T.rename_axis("method").rename(columns={unit: "all"})


def tables(runs: dict[str, list[pd.DataFrame]]) -> dict[str, pd.DataFrame]:
    """Every table of the report."""
    out = {
        "What the paper says, and what holds": judge(CLAIMS, runs),
        "Temperature a day ahead, RMSE [K]": table_of(runs, "K"),
        "Heat that holds the measured temperature, RMSE of hourly means [kW]": table_of(runs, "kW"),
        "The same in percent of the mean load": table_of(runs, "load %"),
        "The same, RMSE of 6-hour means [kW]": table_of(runs, "6 h kW"),
        "Heat that holds the set-points, RMSE of hourly means [kW]": table_of(runs, "plan kW"),
        "The same, RMSE of a day's sum [kWh]": table_of(runs, "day kWh"),
    }
    for name, frames in runs.items():
        out[f"{name}: temperature by window of the day, RMSE [K]"] = windows_of(frames, "K")
        out[f"{name}: load by window of the day, RMSE of hourly means [kW]"] = windows_of(frames, "kW")
    out["Seconds to fit"] = table_of(runs, "fit s")
    return out


FIGURES = {
    "windows": "RMSE by 6-hour window of the day, forecasts from midnight (dots: seeds)",
    "oakland": "Oakland, heating season: five days",
    "chicago": "Chicago, heating season: five days",
    "home_2": "A Dutch home, December: five days",
    "home_3": "Another Dutch home, December: five days",
    "small_office": "The EnergyPlus small office, autumn: five days",
}


INTRO = """**Section 4.3**: the paper's office (`make_office`) under Oakland and Chicago TMY3 weather, four summer
weeks of training from 8 July, then every midnight from 1 December to 1 February, nothing learned in between
(`adapt=None`; the default as it comes); a seed is another office. **Section 4.4**: four weeks of training, then the
weeks that follow, of two real homes (November; every midnight of December) and of the EnergyPlus small office (17
September to 14 October; every midnight from 22 October to 14 December); a seed is another network.

**Methods.** Conventional: the identified network with the state that the measurements up to midnight give, and no
disturbance after it. Hybrid: the same network with a forecast input disturbance; `LSTM` is the paper's
DEEP_AR_LSTM_FORECAST-case01 alone (20 hidden, ReLU, up to 1000 epochs, patience 150, stopped on the end of the training
data and not on the test days as in the paper), `output` the same on the output disturbance.

**Load**: the heat within the plant's limits that holds the measured temperature (paper Eq. inverseQ2), sought anew from
every midnight, against the heat that was delivered: stage x 6 kW in the simulations, measured in the small office,
signal x an assumed 8 kW in the homes. `Heat that holds the set-points` knows no temperature after midnight, only the
thermostat's two set-points."""


def note(runs: dict[str, list[pd.DataFrame]]) -> str:
    """The setup, its differences from the paper, and the figures."""
    loads = ", ".join(f"{name} {np.median([f['mean load kW'].iloc[0] for f in fs]):.2g}" for name, fs in runs.items())
    counts = ", ".join(f"{name} {len(frames)}" for name, frames in runs.items())
    names = [name.replace(" ", "_") for name in runs]
    pictures = [f"![{t}](paper_forecast_{f}.png)\n\n*{t}.*" for f, t in FIGURES.items() if f in ("windows", *names)]
    paragraphs = [" ".join(paragraph.split("\n")) for paragraph in INTRO.split("\n\n")]
    paragraphs.append(
        f"Seeds: {counts}; cells are medians (lowest to highest). Mean size of the delivered heat [kW]: {loads}."
    )
    return "\n\n".join([*paragraphs, reasons(runs), *pictures])


def reasons(runs: dict[str, list[pd.DataFrame]]) -> str:
    """Known reasons for differences from the paper, with their numbers."""

    def middle(name: str, field: str) -> str:
        method, quantity = field.split("|")
        return f"{np.median([f.loc[method, quantity] for f in runs[name]]):.3g}"

    lines = ["**Where we differ from the paper, and why**", ""]
    for name, text in WHY.items():
        if name in runs:
            lines.append(f"- {name}: " + re.sub(r"{([^}]*)}", lambda field, n=name: middle(n, field[1]), text))
    return "\n".join(lines)


# ----------------------------------------------------------------------------------------------------------------- main
def main() -> None:
    """Run what is missing, then write tables and figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--again", nargs="*", metavar="METHOD", help="methods to compute anew; none named: all")
    parser.add_argument("--report", action="store_true", help="compute nothing: tables and figures of what is kept")
    given = parser.parse_args()
    begin = time.perf_counter()
    runs: dict[str, list[pd.DataFrame]] = {}
    shown = {}
    for name in available():
        for seed in range(given.seeds):
            log = LOGS[name](seed)
            said = kept(name, log, seed, given.again, not given.report)
            if not set(DRAWN) <= set(said):  # a report of a run that was stopped
                continue
            if seed == 0:
                shown[name] = (log, said)
            runs.setdefault(name, []).append(pd.DataFrame({m: measure(s, log) for m, s in said.items()}).T)
        for frame in runs.get(name, [])[:1]:
            print(name, frame[["K", "kW"]].round(2).to_dict(), flush=True)
    draw_all(shown, runs)
    title = "The paper's sections 4.3 and 4.4 again: a day ahead, conventional against hybrid"
    write_table("paper_forecast", title, COMMAND, tables(runs), note(runs))
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
