"""The paper's sections 4.3 and 4.4 again: temperature and load a day ahead, conventional against hybrid.

Writes ``results/paper_forecast.md`` and ``results/paper_forecast_*.png``.  Hours on one core, most of them networks in
training: ``python benchmarks/paper_forecast.py --offices 7 --repeats 10``.  What a method forecast is kept in
``benchmarks/.rows``, so that a run that was stopped goes on where it was; ``--again default`` computes the named
methods anew, and ``--again`` alone all of them; ``--report`` writes what there is; ``--logs``, ``--methods`` and
``--out`` are for a part.
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
from _paper_forecast_data import LOGS, PER_DAY, SIMULATED, Log, methods, midnights
from _paper_forecast_figures import DRAWN, draw_all
from _paper_good_and_bad import draw_good_and_bad, forecast_days
from _report import RESULTS, spread, write_table
from _single_networks import chosen_network, single_networks

from skhybrid.exceptions import SkhybridWarning

ROWS = Path(__file__).parent / ".rows" / "paper_forecast"
COMMAND = "python benchmarks/paper_forecast.py"
#: of the repeats of one method on one log
NETWORKS = {"lowest": np.min, "median": np.median, "highest": np.max}
WINDOWS = ("0-6 h", "6-12 h", "12-18 h", "18-24 h")


# ------------------------------------------------------------------------------------------------------------ forecasts
def forecast(model: Any, log: Log) -> pd.DataFrame:
    """Forecast every test row by one method.

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
    rows = origins[:, None] + np.arange(1, PER_DAY + 1)
    networks = []
    if len(getattr(getattr(model, "forecaster_", None), "repeats_", ())):
        each = single_networks(model)
        model, measured = chosen_network(model, each), X["T_za"].to_numpy()
        networks = [rmse(one.predict_from(X, origins) - measured[rows]) for one in each]
    paths = model.predict_from(X, origins)
    out = pd.DataFrame({"temperature": np.nan}, index=X.index)
    out.iloc[rows.ravel(), 0] = paths.ravel()
    held = X["T_za"].interpolate(limit_direction="both")
    out["load"] = log.heat(model.predict_load(X, held))
    out["plan"] = np.nan if log.band is None else log.heat(model.predict_load(X, log.band))
    out = out[out.index >= log.test_start]
    out.attrs = {"fit": fitted - begun, "predict": time.perf_counter() - fitted, "networks": networks}
    return out


def kept(name: str, log: Log, seed: int, given: argparse.Namespace) -> dict[str, pd.DataFrame]:
    """The forecasts of every method, from an earlier run if there is one; for a report from that run only."""
    out, again = {}, given.again
    for method, make in methods(log, seed, given.repeats).items():
        repeats = f" of {given.repeats}" if "LSTM" in method else ""
        path = ROWS / f"{name} {seed} {method}{repeats}.pkl".replace(" ", "_")
        redo = again is not None and (not again or method in again)
        compute = not given.report and (given.methods is None or method in given.methods)
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


def kept_days(log: Log, given: argparse.Namespace) -> pd.DataFrame | None:
    """Days of a good and of a bad model, from an earlier run if there is one; None if there is none for a report."""
    path = ROWS / "good_and_bad.pkl"
    if not path.is_file() and not given.report and given.methods is None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkhybridWarning)
            days = forecast_days(log)
        days.to_pickle(path.with_suffix(".part"))
        path.with_suffix(".part").replace(path)
    return pd.read_pickle(path) if path.is_file() else None


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
    if networks := said.attrs["networks"]:
        parts |= {f"network {word} K": float(f(networks)) for word, f in NETWORKS.items()}
    return parts | {"fit s": said.attrs["fit"], "predict s": said.attrs["predict"]}


def _parts(error: pd.Series, time: pd.DatetimeIndex, unit: str) -> dict[str, float]:
    """RMSE over all rows, by 6-hour window of the day, and by kind of day."""
    out = {unit: rmse(error)}
    out |= {f"{w} {unit}": rmse(error[time.hour // 6 == i]) for i, w in enumerate(WINDOWS)}
    weekend = time.day_of_week >= 5
    return out | {f"weekend {unit}": rmse(error[weekend]), f"weekday {unit}": rmse(error[~weekend])}


# --------------------------------------------------------------------------------------------------------------- tables
def _over_seeds(frames: list[pd.DataFrame], method: str, quantity: str) -> str:
    """One cell, from the seeds in which the method was run."""
    return spread([f.loc[method, quantity] for f in frames if method in f.index and quantity in f])


def table_of(runs: dict[str, list[pd.DataFrame]], quantity: str) -> pd.DataFrame:
    """One row per method, one column per log: median (lowest to highest)."""
    names = list(dict.fromkeys(m for frames in runs.values() for m in frames[0].index))
    names = [m for m in names if any(quantity in f and m in f.index for frames in runs.values() for f in frames)]
    cells = {m: {log: _over_seeds(frames, m, quantity) for log, frames in runs.items()} for m in names}
    table = pd.DataFrame(cells).T.rename_axis("method")
    return table.loc[(table != "").any(axis=1), (table != "").any()]


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
    for word in NETWORKS:
        found = table_of(runs, f"network {word} K")
        if len(found):
            out[f"Temperature, RMSE [K] of the {word} of the single networks"] = found
    for name, frames in runs.items():
        out[f"{name}: temperature by window of the day, RMSE [K]"] = windows_of(frames, "K")
        out[f"{name}: load by window of the day, RMSE of hourly means [kW]"] = windows_of(frames, "kW")
    out["Seconds to fit, without the identification, which several methods share"] = table_of(runs, "fit s")
    return out


FIGURES = {
    "windows": "RMSE by 6-hour window of the day, forecasts from midnight (dots: runs)",
    "oakland": "Oakland, heating season: five days",
    "chicago": "Chicago, heating season: five days",
    "home_2": "A Dutch home, December: five days",
    "home_3": "Another Dutch home, December: five days",
    "small_office": "The EnergyPlus small office, autumn: five days",
}
GOOD_AND_BAD = {
    "good_training": "Chicago, a good disturbance model on days of its training (RMSE without -> with its forecast)",
    "good_test": "The same on days of the test",
    "bad_training": "Chicago, a bad disturbance model on days of its training",
    "bad_test": "The same on days of the test",
}


INTRO = """**Section 4.3**: the paper's office (`make_office`) under Oakland and Chicago TMY3 weather, four summer
weeks of training from 8 July, then every midnight from 1 December to 1 February, nothing learned in between
(`adapt=None`; the default as it comes), in several offices. **Section 4.4**: four weeks of training, then the
weeks that follow, of two real homes (November; every midnight of December) and of the EnergyPlus small office (17
September to 14 October; every midnight from 22 October to 14 December).

**Methods.** `no disturbance` is the paper's conventional approach: the identified network with the state that the
measurements up to midnight give, and zeta = 0 after it. `alone` is the identification's own forecast, in which its
disturbance persists (OD: an ARMA that decays; ID: a heat that stays); the paper has no such row. Hybrid: the same
network with a forecast input disturbance; `LSTM` is the paper's DEEP_AR_LSTM_FORECAST-case01 (20 hidden, ReLU, up to
1000 epochs, patience 150, stopped on the last week of training and not on the test days as in the paper), of several
repeats the one that this week chooses; `on all days`: trained as long again on all four weeks, which every other
method has; `output`: the same on the output disturbance.

**Load**: the heat within the plant's limits that holds the measured temperature (paper Eq. 16), sought anew from
every midnight, against the heat that was delivered: stage x 6 kW in the simulations, measured in the small office,
signal x an assumed 8 kW in the homes. `Heat that holds the set-points` knows no temperature after midnight, only the
thermostat's two set-points."""


def note(runs: dict[str, list[pd.DataFrame]], repeats: int) -> str:
    """The setup, its differences from the paper, and the figures."""
    loads = ", ".join(f"{name} {np.median([f['mean load kW'].iloc[0] for f in fs]):.2g}" for name, fs in runs.items())
    counts = ", ".join(f"{name} {len(frames)}" for name, frames in runs.items())
    names = [name.replace(" ", "_") for name in runs]
    drawn = {f: t for f, t in FIGURES.items() if f in ("windows", *names)} | (GOOD_AND_BAD if "chicago" in runs else {})
    pictures = [f"![{t}](paper_forecast_{f}.png)\n\n*{t}.*" for f, t in drawn.items()]
    paragraphs = [" ".join(paragraph.split("\n")) for paragraph in INTRO.split("\n\n")]
    paragraphs.append(
        f"Runs: {counts} (a simulated run is another office); repeats of each network: {repeats}; cells are medians "
        f"(lowest to highest) over runs; a verdict is given where all runs agree. Mean size of the delivered heat "
        f"[kW]: {loads}."
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
    parser.add_argument("--offices", type=int, default=7, help="simulated offices of each climate")
    parser.add_argument("--repeats", type=int, default=10, help="networks of each LSTM")
    parser.add_argument("--logs", nargs="+", default=list(LOGS), choices=list(LOGS), metavar="LOG")
    parser.add_argument("--methods", nargs="+", metavar="METHOD", help="methods to run; all by default")
    parser.add_argument("--again", nargs="*", metavar="METHOD", help="methods to compute anew; none named: all")
    parser.add_argument("--report", action="store_true", help="compute nothing: tables and figures of what is kept")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the tables and figures")
    given = parser.parse_args()
    begin = time.perf_counter()
    runs: dict[str, list[pd.DataFrame]] = {}
    shown = {}
    for name in given.logs:
        for seed in range(given.offices if name in SIMULATED else 1):
            log = LOGS[name](seed)
            said = kept(name, log, seed, given)
            if not set(DRAWN) <= set(said):  # a report of a run that was stopped
                continue
            if seed == 0:
                shown[name] = (log, said)
            runs.setdefault(name, []).append(pd.DataFrame({m: measure(s, log) for m, s in said.items()}).T)
        for frame in runs.get(name, [])[:1]:
            print(name, frame[["K", "kW"]].round(2).to_dict(), flush=True)
    if not runs:
        raise SystemExit(f"there is nothing to report; a run needs the methods {', '.join(DRAWN)}.")
    draw_all(shown, runs, given.out)
    if "chicago" in shown and (days := kept_days(shown["chicago"][0], given)) is not None:
        draw_good_and_bad(days, given.out)
    title = "The paper's sections 4.3 and 4.4 again: a day ahead, conventional against hybrid"
    command = f"{COMMAND} --offices {given.offices} --repeats {given.repeats}"
    write_table("paper_forecast", title, command, tables(runs), note(runs, given.repeats), given.out)
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
