"""The table of the public benchmark of day-ahead room temperature, which any scikit-learn estimator enters.

    python benchmarks/leaderboard.py skhybrid:HybridPredictor --name default
    python benchmarks/leaderboard.py my_models.py:make_model --name "my model" --logs "dutch home*"

The estimator is an object, a class or a function without arguments.  It is cloned, fitted on the training rows of every
log of ``skhybrid.datasets.load_benchmark()`` and forecasts from every origin of the test.  One without ``predict_from``
is not shown the room temperature, which its ``predict`` would read from the row that it forecasts.  Results are kept in
``results/leaderboard.csv``, from which ``results/leaderboard.md`` is written; ``--table`` writes that alone.
"""

from __future__ import annotations

import argparse
import datetime
import importlib
import importlib.util
import inspect
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _forecast_data import DataSet, chosen, data_sets
from _forecast_store import by_hour, load_errors
from _report import RESULTS, write_table
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.model_selection._search import BaseSearchCV
from sklearn.pipeline import Pipeline

from skhybrid._table import predicted_by
from skhybrid.datasets._benchmark import LOGS
from skhybrid.model_selection import backtest, score_intervals

LEADS = (1, 6, 12, 24)  # hours ahead
NAME = "leaderboard"
KEY = ["model", "log"]


class WithoutTemperature(RegressorMixin, BaseEstimator):
    """A regressor that reads all columns but ``T_za``."""

    def __init__(self, regressor: Any) -> None:
        self.regressor = regressor

    def fit(self, X: pd.DataFrame, y: pd.Series) -> WithoutTemperature:
        """Fit a clone on the rows that are measured."""
        known = y.notna()
        self.regressor_ = clone(self.regressor).fit(X[known].drop(columns="T_za"), y[known])
        return self

    def predict(self, X: pd.DataFrame) -> np.ndarray:
        """Temperature [degC] of every row."""
        return predicted_by(self.regressor_, X.drop(columns="T_za"))


def estimator_of(spec: str) -> Any:
    """The estimator that ``module:name`` or ``file.py:name`` names."""
    place, _, name = spec.rpartition(":")
    module = _module(place) if place else None
    if not hasattr(module, name):
        raise SystemExit(f"{place} has no {name!r}." if place else f"{spec!r} is neither module:name nor file.py:name.")
    made = getattr(module, name)
    if callable(made):
        try:
            inspect.signature(made).bind()
        except TypeError as error:
            raise SystemExit(
                f"{spec} cannot be called without arguments: {error}; name what makes the estimator."
            ) from None
        made = made()
    if missing := [part for part in ("get_params", "fit", "predict") if not hasattr(made, part)]:
        raise SystemExit(f"{spec} is no estimator of scikit-learn: {type(made).__name__} has no {missing[0]}.")
    return made if hasattr(_last(made), "predict_from") else WithoutTemperature(made)


def _module(place: str) -> Any:
    """The module of that name, or of that file, which may import what is next to it."""
    if place.endswith(".py"):
        if not Path(place).is_file():
            raise SystemExit(f"there is no file {place!r}.")
        sys.path.insert(0, str(Path(place).parent.resolve()))
        found: Any = importlib.util.spec_from_file_location(Path(place).stem, place)
        module = sys.modules[found.name] = importlib.util.module_from_spec(found)
        found.loader.exec_module(module)
        return module
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if not place.startswith(str(error.name)):
            raise
        raise SystemExit(f"there is no module {place!r}; give a file as my_models.py:name.") from None


def _last(estimator: Any) -> Any:
    """The estimator at the end of a pipeline or inside a search."""
    while isinstance(estimator, Pipeline | BaseSearchCV):
        estimator = estimator[-1] if isinstance(estimator, Pipeline) else estimator.estimator
    return estimator


def score(estimator: Any, data: DataSet) -> dict[str, float]:
    """Errors of an estimator on one log: K over all leads and at some hours ahead, kW, coverage of 80 % intervals."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = clone(estimator).fit(data.train, data.train["T_za"])
        model = getattr(model, "best_estimator_", model)
        settings: dict[str, Any] = {"origin_step": data.origin_step, "start": data.start}
        if hasattr(_last(model), "predict_quantiles_from"):
            settings["quantiles"] = (0.1, 0.9)
        frame = backtest(model, data.later, data.later["T_za"], **settings)
        _refuse_missing(frame)
        load, _ = load_errors(model, data, data.later)
    hours = np.ceil(frame["lead"] / pd.Timedelta("1h")).astype(int)
    errors = by_hour(frame["origin"].astype(str), hours, frame["y_pred"] - frame["y_true"])
    found = {"K": _rmse(errors.square.sum(), errors.count.sum())}
    for hour in LEADS:
        found[f"K, {hour} h"] = _rmse(errors.square[:, hour - 1].sum(), errors.count[:, hour - 1].sum())
    found["kW"] = np.nan if load is None else _rmse(load.square.sum(), load.count.sum())
    found["coverage"] = float(score_intervals(frame)["coverage"]) if "quantiles" in settings else np.nan
    return found


def _refuse_missing(frame: pd.DataFrame) -> None:
    """Refuse forecasts that are left out, because an error without the hard hours is no error of the log."""
    missing = frame["y_true"].notna() & ~np.isfinite(frame["y_pred"])
    if missing.any():
        first = frame.loc[missing, "time"].iloc[0]
        raise ValueError(
            f"{missing.sum()} of {len(frame)} forecasts are no number (first at {first}); forecast every row."
        )


def _rmse(square: float, count: float) -> float:
    return float(np.sqrt(square / count)) if count else np.nan


def read(folder: Path) -> pd.DataFrame:
    """The kept results, one row per model and log."""
    path = folder / f"{NAME}.csv"
    return pd.read_csv(path) if path.is_file() else pd.DataFrame(columns=[*KEY, "K", "date"])


def enter(name: str, log: str, found: dict[str, float], folder: Path) -> None:
    """Keep one result, in place of an earlier one of the same model and log."""
    kept = read(folder)
    others = kept[(kept["model"] != name) | (kept["log"] != log)]
    row = {"model": name, "log": log, **found, "date": str(datetime.date.today())}
    table = pd.DataFrame([*others.to_dict("records"), row]).sort_values(KEY)
    part = folder / f"{NAME}.part"
    table.to_csv(part, index=False, float_format="%.6g")
    part.replace(folder / f"{NAME}.csv")


def tables(results: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Errors by log, the best mean first, and by lead; means are geometric, over the models that have every log."""
    wide = results.pivot_table(index="model", columns="log", values="K", sort=False)
    wide = wide[[name for name in LOGS if name in wide]]
    mean = np.exp(np.log(wide).mean(axis=1, skipna=False)).rename("geometric mean")
    order = mean.sort_values(na_position="last").index
    by_log = wide.join(mean).loc[order].map(_cell)
    columns = [f"K, {hour} h" for hour in LEADS]
    whole = results[results["model"].isin(mean.dropna().index)]
    leads = np.exp(np.log(whole.set_index("model")[columns]).groupby(level=0).mean())
    rest = whole.groupby("model")[["kW", "coverage"]].mean()
    by_lead = leads.join(rest).reindex([name for name in order if name in leads.index]).map(_cell)
    return {
        "RMSE over all leads [K]": by_log.rename_axis("model"),
        "At some hours ahead [K], load [kW], coverage of the 80 % intervals [-]": by_lead.rename_axis("model"),
    }


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.3f}"


NOTE = (
    "The logs, splits and origins of `skhybrid.datasets.load_benchmark()`, which do not change: weather and delivered "
    "heat of the next day are known, the room temperature up to the origin.  At h hours ahead: the four quarters of an "
    "hour that end there.  kW: the heat that holds the measured temperature, against the delivered heat, mean of the "
    "logs where both are known.  To enter: `python benchmarks/leaderboard.py my_models.py:make_model --name NAME`."
)


def main(arguments: list[str] | None = None) -> None:
    """Score an estimator and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("estimator", nargs="?", help="module:name or file.py:name")
    parser.add_argument("--name", help="row of the table; by default what the estimator is called")
    parser.add_argument("--logs", nargs="+", help="names of logs, their beginnings or patterns")
    parser.add_argument("--table", action="store_true", help="only write the table of what is kept")
    parser.add_argument("--results", type=Path, default=RESULTS)
    given = parser.parse_args(arguments)
    if not given.table:
        if given.estimator is None:
            parser.error("name an estimator, such as skhybrid:HybridPredictor, or pass --table.")
        estimator = estimator_of(given.estimator)
        name, loaders = given.name or given.estimator.rpartition(":")[2], data_sets()
        logs = chosen(list(LOGS), given.logs)
        given.results.mkdir(parents=True, exist_ok=True)
        for log in logs:
            found = score(estimator, loaders[log](0))
            enter(name, log, found, given.results)
            print(f"{name} | {log}: {found['K']:.3f} K", flush=True)
    if read(given.results).empty:
        parser.error(f"no result is kept in {given.results}; name an estimator.")
    title, command = "Leaderboard: room temperature a day ahead", "python benchmarks/leaderboard.py --table"
    write_table(NAME, title, command, tables(read(given.results)), NOTE, given.results)


if __name__ == "__main__":
    main()
