"""One run of the forecast benchmark, and the folder of runs, which can be filled in pieces.

A run is a data set, a model and a seed.  It is kept as a CSV file, written completely or not at all.  Its first line
describes the run (JSON after ``#``).  Each further line holds, for one origin, the sum of squared errors and the number
of errors of each hour ahead, of the temperature [K] or of the load [kW].
"""

from __future__ import annotations

import contextlib
import datetime
import json
import re
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from _forecast_data import BEAM_AND_SKY, DataSet
from _forecast_models import Model
from sklearn.pipeline import Pipeline

from skhybrid.model_selection import backtest

STORE = Path(__file__).parent / ".forecast"
HOURS = 24
#: distance of load origins; 25 h, so that every lead meets every hour of the day
LOAD_STEP = pd.Timedelta("25h")
_COLUMNS = [f"{kind}_{hour}" for kind in ("square", "count") for hour in range(1, HOURS + 1)]
_WARM: set[str] = set()


class Errors(NamedTuple):
    """Errors by origin and hour ahead."""

    origin: pd.Index  # (n,)
    square: np.ndarray  # (n, 24) sums of squared errors of lead hour 1 ... 24
    count: np.ndarray  # (n, 24) how many errors that is


class Run(NamedTuple):
    """A run, as stored."""

    facts: dict[str, Any]  # data, model, seed, tag, fit_seconds, predict_ms, load_mean, date
    temperature: Errors  # [K]
    load: Errors | None  # [kW]


def by_hour(origin: Any, hour: Any, error: Any) -> Errors:
    """Sum squared errors by origin and hour ahead (1 ... 24); NaN and later hours are left out.

    Raises
    ------
    ValueError
        If no error is left.
    """
    values, hours = np.asarray(error, dtype=np.float64) ** 2, np.asarray(hour, dtype=np.int64)
    row, names = pd.factorize(np.asarray(origin))
    known = np.isfinite(values) & (hours >= 1) & (hours <= HOURS) & (row >= 0)
    square, count = np.zeros((len(names), HOURS)), np.zeros((len(names), HOURS))
    np.add.at(square, (row[known], hours[known] - 1), values[known])
    np.add.at(count, (row[known], hours[known] - 1), 1.0)
    if not known.any():
        raise ValueError("no forecast meets a measurement.")
    return Errors(pd.Index(names), square, count)


# ---------------------------------------------------------------------------------------------------------- one run
def assess(data: DataSet, name: str, spec: Model, seed: int, tag: str) -> Run:
    """Fit on the training rows, forecast from every origin, and compare."""
    extra = [] if spec.facades else [c for c in BEAM_AND_SKY if c in data.train]
    train, later = data.train.drop(columns=extra), data.later.drop(columns=extra)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if name not in _WARM and spec.group != "networks":
            _warm(_made(spec, data, seed), train)
            _WARM.add(name)
        begun = time.process_time()
        model = _made(spec, data, seed).fit(train, train["T_za"])
        fitted = time.process_time()
        frame = backtest(model, later, later["T_za"], origin_step=data.origin_step, start=data.start)
        seconds = time.process_time() - fitted
        load, mean = load_errors(model, data, later)
    lead = np.ceil(frame["lead"] / pd.Timedelta("1h")).astype(int)
    temperature = by_hour(frame["origin"].astype(str), lead, frame["y_pred"] - frame["y_true"])
    facts = {
        "data": data.name,
        "model": name,
        "seed": seed,
        "tag": tag,
        "fit_seconds": round(fitted - begun, 4),
        "predict_ms": round(1e3 * seconds / len(temperature.origin), 4),
        "load_mean": mean,
        "date": str(datetime.date.today()),
    }
    return Run(facts, temperature, load)


def _made(spec: Model, data: DataSet, seed: int) -> Any:
    """A model, with the days off of the data set where it takes them."""
    model = spec.make(data, seed)
    last = model[-1] if isinstance(model, Pipeline) else model
    if data.holidays is not None and hasattr(last, "holidays"):
        last.set_params(holidays=data.holidays)
    return model


def _warm(model: Any, train: pd.DataFrame) -> None:
    """Compile and load everything before the clock starts."""
    rows = train.iloc[: 5 * 96]
    with contextlib.suppress(Exception):  # too short for this model: then the first run is slower
        model.fit(rows, rows["T_za"])
        backtest(model, train.iloc[5 * 96 : 8 * 96], train["T_za"].iloc[5 * 96 : 8 * 96])


def load_errors(model: Any, data: DataSet, later: pd.DataFrame) -> tuple[Errors | None, float]:
    """Error of the heat that would have held the measured temperature, and the mean of the delivered heat [kW].

    As in a study (``skhybrid.study``), the measured temperature is the set-point.
    """
    delivered = data.delivered()
    if delivered is None or (data.truth is not None and hasattr(model, "truth")):
        return None, np.nan
    block = ((_wall(later.index) - _wall(later.index)[0].normalize()) // LOAD_STEP).to_numpy()
    first = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1])
    load = _predicted_load(model, later, later["T_za"].interpolate(limit_direction="both"), first, data)
    if load is None:
        return None, np.nan
    stages = [power * load[role] for role, power in data.capacity.items() if role in load]
    heat = sum(stages[1:], start=stages[0]) if stages else load["Q_hvac"]
    origin_row = first[np.searchsorted(first, np.arange(len(later)), side="right") - 1]
    hour = (np.arange(len(later)) - origin_row) * (later.index[1] - later.index[0]) // pd.Timedelta("1h") + 1
    known = later["T_za"].notna() & later["T_za"].shift(-1).notna() & (later.index[origin_row] >= data.start)
    errors = by_hour(later.index[origin_row].astype(str)[known], hour[known], (heat - delivered)[known])
    return errors, float(delivered[known].abs().mean())


def _wall(index: pd.DatetimeIndex) -> pd.DatetimeIndex:
    return index.tz_localize(None) if index.tz is not None else index


def _predicted_load(model: Any, rows: pd.DataFrame, setpoint: pd.Series, origins: np.ndarray, data: DataSet) -> Any:
    """The load from the states at the origins, or None if the model predicts no load."""
    if isinstance(model, Pipeline):
        model, rows = model[-1], model[:-1].transform(rows)
    if hasattr(model, "load_from"):
        return model.load_from(rows, setpoint, origins, data.limits())
    if not hasattr(model, "predict_load"):
        return None
    usual = model.origin_step
    try:
        return model.set_params(origin_step=LOAD_STEP).predict_load(rows, setpoint, data.limits())
    finally:
        model.set_params(origin_step=usual)


# ------------------------------------------------------------------------------------------------------------- store
def path_of(data: str, model: str, seed: int, store: Path = STORE) -> Path:
    """File of a run."""
    folder, name = (re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") for text in (data, model))
    return store / folder / f"{name}__{seed}.csv"


def write_run(run: Run, store: Path = STORE) -> Path:
    """Keep a run."""
    path = path_of(run.facts["data"], run.facts["model"], run.facts["seed"], store)
    frames = []
    for what, errors in (("temperature", run.temperature), ("load", run.load)):
        if errors is not None:
            values = pd.DataFrame(np.hstack([errors.square, errors.count]), columns=_COLUMNS)
            values.insert(0, "origin", errors.origin)
            values.insert(0, "what", what)
            frames.append(values)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    with part.open("w", encoding="utf-8") as file:
        file.write(f"# {json.dumps(run.facts)}\n")
        pd.concat(frames).to_csv(file, index=False, float_format="%.7g")
    part.replace(path)
    return path


def read_facts(path: Path) -> dict[str, Any]:
    """The first line of a kept run."""
    with path.open(encoding="utf-8") as file:
        return json.loads(file.readline().removeprefix("#"))


def read_run(path: Path) -> Run:
    """A kept run."""
    table = pd.read_csv(path, skiprows=1, dtype={"origin": str})

    def errors(what: str) -> Errors | None:
        rows = table[table["what"] == what]
        values = rows[_COLUMNS].to_numpy()
        return Errors(pd.Index(rows["origin"]), values[:, :HOURS], values[:, HOURS:]) if len(rows) else None

    temperature = errors("temperature")
    assert temperature is not None
    return Run(read_facts(path), temperature, errors("load"))


def read_runs(store: Path = STORE) -> Iterator[Run]:
    """All kept runs."""
    for path in sorted(store.glob("*/*__*.csv")):
        yield read_run(path)


def is_done(data: str, model: str, seed: int, tag: str | None, store: Path = STORE) -> bool:
    """Whether a run is kept, with this tag if one is given."""
    path = path_of(data, model, seed, store)
    return path.is_file() and tag in (None, read_facts(path)["tag"])
