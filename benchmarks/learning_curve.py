"""Day-ahead error by length of training: 1, 3, 7, 14 and 28 days before the same test weeks.

``python benchmarks/learning_curve.py`` runs what is missing (kept in ``benchmarks/.forecast/learning``, as for
``forecast.py``) and writes ``results/learning_curve.md``, ``learning_curve.csv`` and ``learning_curve.png``.  Every log
has several dates.  Training of any length ends at the date, and the next two weeks are the test, so all lengths are
compared at the same origins.

    python benchmarks/learning_curve.py --quick             one date of two logs, 1 and 3 days
    python benchmarks/learning_curve.py --models "hybrid*" --tag blend
    python benchmarks/learning_curve.py --tables-only
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from _forecast_data import CHICAGO, DataSet, chosen, office_run, read_home, split
from _forecast_figure import draw_learning
from _forecast_models import ARX, HYBRID, MODELS, REFITTED
from _forecast_ratios import geometric_mean, ratio
from _forecast_store import STORE, Run, is_done, read_runs
from _forecast_tables import rmse
from _report import RESULTS, write_table
from forecast import run_one

from skhybrid.datasets import make_office

DAYS, TEST_DAYS = (1, 3, 7, 14, 28), 14
SIMPLE = ("yesterday", "last temperature", "CONV")
CURVES = (*SIMPLE, ARX, REFITTED, HYBRID)
OFFICE_DATES = ("2018-02-05", "2018-04-16", "2018-06-18", "2018-09-17", "2018-11-05")
HOME_DATES = ("2021-11-22", "2021-12-01", "2021-12-10")
PAPER_DATES = ("2023-07-31", "2023-10-30", "2024-01-29")


def _cut(run: Callable[[], pd.DataFrame], log: str, date: str, days: int, step: str, **facts: object) -> DataSet:
    """``days`` of training before the date, and a test of two weeks from the date on."""
    day = pd.Timestamp(date)
    first, last, end = (str((day + pd.Timedelta(d, unit="D")).date()) for d in (-days, -1, TEST_DAYS - 1))
    rows = run()
    return split(name_of(log, date, days), rows, rows, (first, last, date, end), step, **facts)


def _paper_run(climate: str, date: str) -> pd.DataFrame:
    """Four weeks before the date and two after it; the perturbed weekend is the first, which only 28 days include."""
    start = pd.Timestamp(date) - pd.Timedelta(max(DAYS), unit="D")
    return make_office(max(DAYS) + TEST_DAYS, climate, start=start, random_state=start.day_of_year).X


def name_of(log: str, date: str, days: int) -> str:
    """The name under which a case is kept."""
    return f"{log}, {date}, {days} days"


def cases() -> dict[tuple[str, str, int], Callable[[], DataSet]]:
    """Data sets by log, date and days of training."""
    found: dict[tuple[str, str, int], Callable[[], DataSet]] = {}
    for days in DAYS:
        for date in OFFICE_DATES:
            run = partial(office_run, "irregular")
            found["office", date, days] = partial(_cut, run, "office", date, days, "7h", site=CHICAGO)
        for number in (2, 3):
            log = f"dutch home {number}"
            for date in HOME_DATES:
                run, known = partial(read_home, number), {"Q_h": 8.0}
                found[log, date, days] = partial(_cut, run, log, date, days, "5h", known=known)
        for climate in ("oakland", "chicago"):
            log, known = f"make_office {climate}", {"Q_h": 6.0}
            for date in PAPER_DATES:
                run = partial(_paper_run, climate, date)
                found[log, date, days] = partial(_cut, run, log, date, days, "7h", known=known)
    return found


def fill(options: argparse.Namespace, wanted: dict[tuple[str, str, int], Callable[[], DataSet]]) -> None:
    """Run what is requested and missing."""
    for (log, date, days), load in wanted.items():
        name = name_of(log, date, days)
        left = [m for m in options.models if not is_done(name, m, 0, options.tag, options.store)]
        data = load() if left else None
        for model in left:
            if data is not None and MODELS[model].applies(data):
                run_one(data, model, MODELS[model], 0, options.tag or "1", options.store)


# ------------------------------------------------------------------------------------------------------------ results
def table_of(runs: dict[tuple[str, str, int, str], Run]) -> pd.DataFrame:
    """One row per case and model: the error, and its ratio to the best simple baseline of that case."""
    frame = pd.DataFrame([(*key, rmse(run.temperature)) for key, run in runs.items()])
    frame.columns = pd.Index(["log", "date", "days", "model", "rmse"])
    simple = frame[frame["model"].isin(SIMPLE)].groupby(["log", "date", "days"])["rmse"].min().rename("best_simple")
    frame = frame.join(simple, on=["log", "date", "days"])
    order = {model: i for i, model in enumerate(MODELS)}
    frame = frame.sort_values(["log", "date", "days", "model"], key=lambda c: c.map(order) if c.name == "model" else c)
    return frame.assign(to_best_simple=frame["rmse"] / frame["best_simple"])


def means(frame: pd.DataFrame, column: str) -> pd.DataFrame:
    """Geometric means over dates, by log and model, one column per length of training."""
    logs = np.log(frame[column]).groupby([frame["log"], frame["model"], frame["days"]], sort=False).mean()
    table = np.exp(logs).reset_index().pivot_table(values=column, index=["log", "model"], columns="days", sort=False)
    return table.rename(columns=lambda d: f"{d} days").map(lambda v: "" if np.isnan(v) else f"{v:.3f}")


def default_against(runs: dict[tuple[str, str, int, str], Run], frame: pd.DataFrame) -> pd.DataFrame:
    """Ratio of the default to each baseline over all cases, and how often it is worse than the best simple one."""
    rows: dict[str, dict[str, str]] = {}
    for days in sorted(frame["days"].unique()):
        mine = {key[:3]: run for key, run in runs.items() if key[2] == days and key[3] == HYBRID}
        row = {}
        for other in (*SIMPLE, ARX, REFITTED):
            theirs = {key[:3]: run for key, run in runs.items() if key[3] == other}
            found = [
                ratio([mine[k].temperature], [theirs[k].temperature], " ".join(k[:2])) for k in mine if k in theirs
            ]
            row[f"to {other}"] = str(geometric_mean(found)) if found else ""
        worst = frame[(frame["model"] == HYBRID) & (frame["days"] == days)]["to_best_simple"]
        row["worse than the best simple one"] = f"{int((worst > 1).sum())} of {len(worst)}"
        row["worst ratio to it"] = f"{worst.max():.2f}" if len(worst) else ""
        rows[f"{days} days"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("training")


def write_results(store: Path, folder: Path) -> list[Path]:
    """Write table, CSV and figure of what is kept."""
    runs = {}
    for run in read_runs(store):
        log, date, days = run.facts["data"].split(", ")
        runs[log, date, int(days.split()[0]), run.facts["model"]] = run
    if not runs:
        return []
    frame = table_of(runs)
    folder.mkdir(parents=True, exist_ok=True)
    csv = folder / "learning_curve.csv"
    part = csv.with_suffix(".part")
    frame.to_csv(part, index=False, float_format="%.4g")
    part.replace(csv)
    tables = {}
    if (frame["model"] == HYBRID).any():
        tables[f"The default ({HYBRID}): ratio of errors, geometric mean of all logs and dates"] = default_against(
            runs, frame
        )
    tables["RMSE [K], geometric mean of the dates"] = means(frame, "rmse")
    note = (
        "Training of any length ends at the date; the next two weeks are the test.  Brackets: 90 % interval "
        f"of a paired bootstrap by blocks of three days of origins.  Simple baselines: {', '.join(SIMPLE)}."
    )
    command = "python benchmarks/learning_curve.py"
    md = write_table("learning_curve", "How much training a forecast needs", command, tables, note, folder)
    return [md, csv, draw_learning(frame, CURVES, folder / "learning_curve.png")]


def read_options(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", help="names of models, their beginnings or patterns")
    parser.add_argument("--data", nargs="+", help="names of logs, their beginnings or patterns")
    parser.add_argument("--tag", help="version of the code; runs with another tag are repeated")
    parser.add_argument("--quick", action="store_true", help="one date of two logs, 1 and 3 days")
    parser.add_argument("--tables-only", action="store_true", help="write the tables of what is kept")
    parser.add_argument("--store", type=Path, default=STORE / "learning", help="where runs are kept")
    parser.add_argument("--results", type=Path, help="where tables and figure are written")
    options = parser.parse_args(arguments)
    if options.results is None:  # a subset must not replace the tables of the whole
        options.results = options.store / "quick" if options.quick else RESULTS
    options.models = list(CURVES) if options.models is None else chosen(list(MODELS), options.models)
    return options


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the tables."""
    options = read_options(arguments)
    every = cases()
    logs = chosen(list(dict.fromkeys(log for log, _, _ in every)), options.data)
    wanted = {key: load for key, load in every.items() if key[0] in logs}
    if options.quick:
        dates = {log: next(date for name, date, _ in every if name == log) for log in ("office", "dutch home 2")}
        wanted = {k: load for k, load in wanted.items() if dates.get(k[0]) == k[1] and k[2] in DAYS[:2]}
    if not options.tables_only:
        fill(options, wanted)
    for path in write_results(options.store, options.results):
        print(path)


if __name__ == "__main__":
    main()
