"""Tables and figure of the forecast benchmark, from the runs that are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _forecast_data import KNOWN, data_sets, group_of
from _forecast_models import AIR_ORACLE, ARX, COMPETITORS, GRAY_BOXES, HYBRID, MODELS, ORACLE, REFITTED
from _forecast_ratios import Ratio, geometric_mean, ratio
from _forecast_store import Errors, Run, read_runs
from _report import RESULTS, write_table

LEADS = (1, 2, 3, 6, 9, 12, 18, 24)
NOTE = (
    "RMSE over all leads of 15 min to 24 h, inputs known over the horizon, temperature known to the origin; every "
    "model at the same origins.  *New control*: trained on one plan of set-points, tested on another.  ± is the "
    "standard deviation over seeds (of the data in `make_office`, of the network's start elsewhere).  Brackets: 90 % "
    "interval of a paired bootstrap by blocks of three days of origins.  Load: the heat that would have held the "
    "measured temperature, within what the plant ever gave, against the heat delivered; origins 25 h apart.  *Alone*: "
    "no disturbance is forecast.  *Calendar known*: models that take holidays have the days on which nobody worked; in "
    "winter there is none.  Bounds of gray boxes are the paper's, moved with the size of the plant.  *Oracle*: "
    "true network and state, hour-of-week mean of the true gains of the training weeks (with air: outdoor air by its "
    "conductance, which the change of season does not spoil).  Competitors have the default's "
    "inputs; each lead is compared with the best one at it.  ``forecast.csv`` counts the seeds of each row.  Times are "
    "of one core."
)
Runs = dict[tuple[str, str], list[Run]]


def gathered(runs: Iterable[Run]) -> Runs:
    """Runs by data set and model, in the order of the benchmark; one per seed."""
    found: Runs = {}
    for run in runs:
        found.setdefault((run.facts["data"], run.facts["model"]), []).append(run)
    names = list(data_sets())
    models = list(MODELS)

    def place(key: tuple[str, str]) -> tuple[int, str, int]:
        data, model = key
        rank = names.index(data) if data in names else len(names)
        return rank, data, models.index(model) if model in models else len(models)

    return {key: sorted(found[key], key=lambda r: r.facts["seed"]) for key in sorted(found, key=place)}


def rmse(errors: Errors, hours: slice = slice(None)) -> float:
    """Root mean squared error over some hours ahead, by default over all."""
    return float(np.sqrt(errors.square[:, hours].sum() / errors.count[:, hours].sum()))


def mean_rmse(mine: list[Run], hours: slice = slice(None)) -> float:
    """Error of the temperature over some hours ahead, the mean over seeds."""
    return float(np.mean([rmse(r.temperature, hours) for r in mine]))


def family(data: str) -> str:
    """Building and season, shared by data sets that differ in their control only."""
    return data.split(",")[0]


def compared(runs: Runs, model: str, other: str) -> dict[str, Ratio]:
    """Ratio of a model's error to another's on every data set that has both."""
    return {
        data: ratio([r.temperature for r in mine], [r.temperature for r in runs[data, other]], family(data))
        for (data, name), mine in runs.items()
        if name == model and (data, other) in runs
    }


# ------------------------------------------------------------------------------------------------------------ numbers
def summary(runs: Runs) -> pd.DataFrame:
    """One row per data set and model: the contents of ``forecast.csv``."""
    models = dict.fromkeys(model for _, model in runs)
    ratios = {other: {m: compared(runs, m, other) for m in models} for other in (ARX, REFITTED)}
    rows = []
    for (data, model), mine in runs.items():
        facts = pd.DataFrame([r.facts for r in mine])
        scores = [rmse(r.temperature) for r in mine]
        row: dict[str, Any] = {"data": data, "model": model, "seeds": len(mine)}
        row |= {"origins": len(mine[0].temperature.origin), "rmse": np.mean(scores)}
        row["rmse_sd"] = np.std(scores, ddof=1) if len(mine) > 1 else np.nan
        for hour in LEADS:
            row[f"rmse_{hour}h"] = mean_rmse(mine, slice(hour - 1, hour))
        loads = [rmse(r.load) for r in mine if r.load is not None]
        row["load_rmse"] = np.mean(loads) if loads else np.nan
        row["load_percent"] = 100.0 * row["load_rmse"] / facts["load_mean"].mean()
        for label, other in (("arx", ARX), ("refit", REFITTED)):
            found = ratios[other][model].get(data)
            row[f"to_{label}"], row[f"to_{label}_low"], row[f"to_{label}_high"] = found[:3] if found else [np.nan] * 3
        row["fit_seconds"], row["predict_ms"] = facts["fit_seconds"].median(), facts["predict_ms"].median()
        row["tag"] = ", ".join(sorted(set(facts["tag"].astype(str))))
        rows.append(row)
    return pd.DataFrame(rows)


def crossed(runs: Runs, keep: Callable[[str], bool], cell: Callable[[list[Run]], str]) -> pd.DataFrame:
    """Models by data sets."""
    cells: dict[str, dict[str, str]] = {}
    for (data, model), mine in runs.items():
        if keep(data):
            cells.setdefault(data, {})[model] = cell(mine)
    models = dict.fromkeys(model for column in cells.values() for model in column)
    return pd.DataFrame(cells, dtype=object).fillna("").loc[_in_order(list(models))].rename_axis(index="model")


def _in_order(models: list[str]) -> list[str]:
    return sorted(models, key=lambda m: list(MODELS).index(m) if m in MODELS else len(MODELS))


def error_cell(mine: list[Run]) -> str:
    """Error of the temperature, with the spread over seeds."""
    scores = [rmse(r.temperature) for r in mine]
    spread = f" ± {np.std(scores, ddof=1):.3f}" if len(scores) > 1 else ""
    return f"{np.mean(scores):.3f}{spread}"


def load_cell(mine: list[Run]) -> str:
    """Error of the load, and that in percent of the mean load."""
    loads = [rmse(r.load) for r in mine if r.load is not None]
    if not loads:
        return ""
    mean = np.mean([r.facts["load_mean"] for r in mine])
    return f"{np.mean(loads):.2f} ({100.0 * np.mean(loads) / mean:.0f} %)"


def ratio_table(runs: Runs, other: str, keep: Callable[[str], bool]) -> pd.DataFrame:
    """Ratios of all models to one, with a geometric mean if a model has every data set of the table."""
    datas = list(dict.fromkeys(data for data, model in runs if keep(data) and (data, other) in runs))
    rows = {}
    for model in _in_order(list(dict.fromkeys(model for data, model in runs if data in datas))):
        found = {d: r for d, r in compared(runs, model, other).items() if d in datas}
        row = {d: str(found[d]) if d in found else "" for d in datas}
        whole = len(found) == len(datas) and model != other
        rows[model] = row | {"geometric mean": str(geometric_mean(list(found.values()))) if whole else ""}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("model").drop(other)


def by_lead(runs: Runs, keep: Callable[[str], bool]) -> pd.DataFrame:
    """Error by hour ahead, the geometric mean over data sets, for models that have them all."""
    datas = {data for data, _ in runs if keep(data)}
    rows = {}
    for model in _in_order(list(dict.fromkeys(m for _, m in runs))):
        mine = [runs[data, model] for data in datas if (data, model) in runs]
        if mine and len(mine) == len(datas):
            logs = [np.log([mean_rmse(some, slice(h - 1, h)) for h in LEADS]) for some in mine]
            rows[model] = [f"{v:.3f}" for v in np.exp(np.mean(logs, axis=0))]
    return pd.DataFrame.from_dict(rows, orient="index", columns=[f"{h} h" for h in LEADS]).rename_axis("model")


def goals(runs: Runs) -> pd.DataFrame:
    """The default beside its targets, on every data set."""
    asked = (
        (ARX, (ARX,), 0.85),
        (REFITTED, (REFITTED,), 0.95),
        ("best competitor", COMPETITORS, 0.95),
        (ORACLE, (ORACLE,), 1.10),
        (AIR_ORACLE, (AIR_ORACLE,), 1.10),
        ("best of " + ", ".join(GRAY_BOXES), GRAY_BOXES, 1.0),
    )
    rows: dict[str, dict[str, str]] = {}
    for data in dict.fromkeys(data for data, model in runs if model == HYBRID):
        row = {}
        for name, others, limit in asked:
            heading, best = f"to {name}, at most {limit:.2f}", best_of(runs, data, others)
            if best is None:
                row[heading] = ""
                continue
            found = compared({k: v for k, v in runs.items() if k[0] == data}, HYBRID, best)[data]
            row[heading] = f"{found}{'' if found.value <= limit else ' **missed**'}"
        rows[data] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("data")


def best_of(runs: Runs, data: str, models: Iterable[str], hours: slice = slice(None)) -> str | None:
    """The model with the least error on a data set; None if none has run there."""
    return min((m for m in models if (data, m) in runs), key=lambda m: mean_rmse(runs[data, m], hours), default=None)


def beside_the_best(runs: Runs) -> pd.DataFrame:
    """The default's error relative to the best competitor over all leads, and to the best at each of some leads."""
    rows = {}
    spans = {"all leads": slice(None)} | {f"{h} h": slice(h - 1, h) for h in (1, 6, 12, 24)}
    for data in dict.fromkeys(data for data, model in runs if model == HYBRID):
        row = {"best competitor": best_of(runs, data, COMPETITORS)}
        if row["best competitor"] is None:
            continue
        for label, hours in spans.items():
            best = best_of(runs, data, COMPETITORS, hours)
            row[label] = f"{mean_rmse(runs[data, HYBRID], hours) / mean_rmse(runs[data, best], hours):.2f}"
        rows[data] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("data")


def worth_of_calendar(runs: Runs) -> pd.DataFrame:
    """Error of models that know the days off relative to their error without them."""
    rows: dict[str, dict[str, str]] = {}
    for (data, model), mine in runs.items():
        without = runs.get((data.removesuffix(KNOWN), model))
        if data.endswith(KNOWN) and without is not None and (value := mean_rmse(mine) / mean_rmse(without)) != 1.0:
            rows.setdefault(model, {})[data.removesuffix(KNOWN)] = f"{value:.2f}"
    return pd.DataFrame.from_dict(rows, orient="index").fillna("").rename_axis("model")


def times(runs: Runs) -> pd.DataFrame:
    """Seconds of a fit and milliseconds of a forecast, medians and worst over the data sets."""
    facts = pd.DataFrame([r.facts for mine in runs.values() for r in mine]).groupby("model")
    table = facts[["fit_seconds", "predict_ms"]].agg(["median", "max"])
    table.columns = ["fit [s]", "fit, slowest [s]", "forecast [ms an origin]", "forecast, slowest [ms]"]
    return table.loc[_in_order(list(table.index))].map(lambda v: f"{v:.3g}")


# ------------------------------------------------------------------------------------------------------------ results
def write_results(store: Path, folder: Path = RESULTS) -> list[Path]:
    """Write ``forecast.md``, ``forecast.csv`` and ``forecast.png`` of what is kept; their paths."""
    from _forecast_figure import draw

    runs = gathered(read_runs(store))
    if not runs:
        return []
    table = summary(runs)
    groups = {
        "small office": lambda data: data.startswith("office") and not data.endswith(KNOWN),
        "small office" + KNOWN: lambda data: data.endswith(KNOWN),
        "homes and the paper's office": lambda data: data.startswith(("dutch", "make_office")),
    }
    for further in dict.fromkeys(group_of(data) for data, _ in runs if group_of(data)):
        groups[f"further buildings, {further}"] = partial(_is_of, further)
    tables: dict[str, pd.DataFrame] = {}
    if any(model == HYBRID for _, model in runs):
        tables[f"What is asked of the default ({HYBRID}): ratio of errors"] = goals(runs)
        beside = beside_the_best(runs)
        if len(beside):
            tables["The default's error relative to the best competitor (asked: at most 1.00 at each lead)"] = beside
    for label, keep in groups.items():
        if any(keep(data) for data, _ in runs):
            tables |= _group_tables(runs, label, keep)
    if len(worth := worth_of_calendar(runs)):
        tables["Error with the calendar relative to that without it"] = worth
    tables["RMSE by hour ahead [K], geometric mean of all data sets but further buildings"] = by_lead(
        runs, lambda data: not group_of(data) and not data.endswith(KNOWN)
    )
    tables["Times"] = times(runs)
    folder.mkdir(parents=True, exist_ok=True)
    csv = folder / "forecast.csv"
    part = csv.with_suffix(".part")
    table.to_csv(part, index=False, float_format="%.4g")
    part.replace(csv)
    command = "python benchmarks/forecast.py"
    md = write_table("forecast", "Day-ahead forecasts: who wins where", command, tables, NOTE, folder)
    return [md, csv, draw(runs, folder / "forecast.png")]


def _is_of(group: str, data: str) -> bool:
    return group_of(data) == group


def _group_tables(runs: Runs, label: str, keep: Callable[[str], bool]) -> dict[str, pd.DataFrame]:
    """Errors, ratios and loads of the data sets of one kind; many data sets become rows."""
    tables = {f"RMSE [K], {label}": crossed(runs, keep, error_cell)}
    for other in (ARX, REFITTED):
        if any(keep(data) and model == other for data, model in runs):
            tables[f"Ratio to {other}, {label}"] = ratio_table(runs, other, keep)
    loads = crossed(runs, keep, load_cell)
    loads = loads.loc[(loads != "").any(axis=1), (loads != "").any(axis=0)]
    if len(loads):
        tables[f"RMSE of the load [kW] (percent of the mean load), {label}"] = loads
    wide = label.startswith("further")
    return {k: v.T.rename_axis("data") if wide else v for k, v in tables.items()}
