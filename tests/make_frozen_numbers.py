"""Frozen numbers of the package: the functions that compute them, and a script that writes them to a file.

``python tests/make_frozen_numbers.py`` writes ``tests/frozen/numbers.json``, which ``test_frozen_numbers.py`` compares.
Write it anew only where a number is meant to change, and say in the commit why.  Names of sections on the command line
write these alone.  Only public names are used, so that internals may move.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
)
from skhybrid.datasets import load_small_office, make_office, read_zone_csv
from skhybrid.model_selection import DesignMatrixSearchCV, RollingOriginSplit, design_matrix

FROZEN = Path(__file__).parent / "frozen" / "numbers.json"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
DAY = 96  # rows of 15 min
TRAINING, LATER = 16 * DAY, 4 * DAY
#: of a series every so many values are kept; a number that shares no factor with a day's rows
EVERY = 19
LEVELS = (0.1, 0.5, 0.9)
HOMES = ("home_2", "home_3")
BUILDINGS = ("small_office", *HOMES, "office")
#: capacities [kW] of plants whose heat is not measured.  Where none is known all heat is relative, and a search stops
#: somewhere in a flat valley; another order of a sum moves that place.
KNOWN = {"small_office": {}, "home_2": {"Q_h": 8.0}, "home_3": {"Q_h": 8.0}, "office": {"Q_h": 6.0, "Q_c": -6.0}}

Numbers = dict[str, np.ndarray]


class Building(NamedTuple):
    """A log in two parts; the second continues the first."""

    X: pd.DataFrame
    y: pd.Series
    later: pd.DataFrame

    def future(self, first: int, n_rows: int = DAY) -> pd.DataFrame:
        """Known inputs of later rows."""
        return self.later.iloc[first : first + n_rows].drop(columns="T_za")


def _load(name: str) -> pd.DataFrame:
    if name == "small_office":
        return load_small_office().X.iloc[42 * DAY :]
    if name == "office":
        # one missing measurement, a morning without any, and one in the rows to forecast
        X = make_office(n_days=20, start="2023-10-09", climate="chicago", random_state=7).X
        for rows in (slice(300, 301), slice(5 * DAY + 20, 5 * DAY + 44), slice(TRAINING + 60, TRAINING + 65)):
            X.iloc[rows, X.columns.get_loc("T_za")] = np.nan
        return X
    columns = {"T_za": "T_in_degC", "T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd"}
    log = read_zone_csv(
        SHARED_DATA / f"dutch_{name}.csv", columns, timezone="Europe/Amsterdam", units={"u_heat": "percent"}
    )
    return log.loc["2021-11-15":]


@cache
def building(name: str) -> Building:
    """The log of a building, 16 days and 4 days."""
    X = _load(name).iloc[: TRAINING + LATER]
    return Building(X.iloc[:TRAINING], X["T_za"].iloc[:TRAINING], X.iloc[TRAINING:])


# ---------------------------------------------------------------------------------------------------------- parts
def _series(values: object) -> np.ndarray:
    """A few of the rows of an array."""
    return np.asarray(values, dtype=np.float64)[::EVERY].ravel()


def _frame(numbers: Numbers, name: str, frame: pd.DataFrame) -> None:
    numbers.update({f"{name}/{column}": _series(frame[column]) for column in frame})


def _setpoints(later: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    busy = (later.index.hour >= 7) & (later.index.hour < 18)
    return np.where(busy, 20.5, 17.0), np.where(busy, 24.0, 27.0)


def _loads(numbers: Numbers, model: object, later: pd.DataFrame) -> None:
    two_days = later.iloc[: 2 * DAY]
    _frame(numbers, "load", model.predict_load(two_days, 20.0 + np.sin(np.arange(len(two_days)) / 20.0)))
    limits = (-2.0, np.where(two_days.index.hour < 5, 0.0, 3.0))
    _frame(numbers, "load_in_band", model.predict_load(two_days, _setpoints(two_days), limits))


def _zeta(numbers: Numbers, name: str, zeta: pd.Series) -> None:
    numbers[name] = np.append(_series(zeta), [zeta.mean(), zeta.std(), len(zeta)])


def _drift(numbers: Numbers, name: str, days: pd.DataFrame) -> None:
    numbers[name] = days[["statistic", "threshold", "drifted"]].to_numpy(dtype=np.float64).ravel()


def _hybrid(model: HybridPredictor, log: Building) -> Numbers:
    """Forecasts of a fitted hybrid, and what it is after an update and after it has learned from the rows."""
    numbers: Numbers = {"predict": _series(model.predict(log.later))}
    numbers["predict_from"] = _series(model.predict_from(log.later, [30, 200], horizon="6h").T)
    _frame(numbers, "forecast", model.forecast(log.X, log.future(0)))
    _frame(numbers, "forecast_elsewhere", model.forecast(log.later.iloc[50 : 50 + 2 * DAY], log.future(50 + 2 * DAY)))
    numbers["quantiles"] = _series(model.predict_quantiles(log.later, LEVELS))
    _loads(numbers, model, log.later)
    numbers["theta"] = model.gray_box_.theta_.to_numpy()
    _zeta(numbers, "zeta", model.zeta_)
    new = log.later.iloc[: 3 * DAY]
    model.update(new.iloc[:10])
    model.update(new.iloc[10:])
    _frame(numbers, "updated", model.forecast(None, log.future(3 * DAY), quantiles=LEVELS))
    _drift(numbers, "drift", model.drift())
    model.partial_fit(new, new["T_za"])
    _frame(numbers, "learned", model.forecast(None, log.future(3 * DAY)))
    numbers["learned/theta"] = model.gray_box_.theta_.to_numpy()
    numbers["learned/quantiles"] = _series(model.predict_quantiles(log.later.iloc[3 * DAY :], LEVELS))
    numbers["learned/predict"] = _series(model.predict(log.later.iloc[3 * DAY :]))
    return numbers


# -------------------------------------------------------------------------------------------------------- sections
def schedule(name: str) -> Numbers:
    """The default."""
    log = building(name)
    model = HybridPredictor().fit(log.X, log.y)
    numbers = {"weights": model.weights_.to_numpy().ravel()}
    for adapt in (None, "linear"):
        model.set_params(adapt=adapt)
        numbers[f"adapt_{adapt}"] = _series(model.predict(log.later))
    return numbers | _hybrid(model.set_params(adapt="full"), log)


def schedule_long(name: str) -> Numbers:
    """The default over a history long enough that ``adapt="full"`` fits the network again."""
    X = _load(name).iloc[: 45 * DAY]
    training = X.iloc[: 14 * DAY]
    model = HybridPredictor(horizon="12h").fit(training, training["T_za"])
    numbers = {}
    for adapt in (None, "linear", "full"):
        model.set_params(adapt=adapt)
        numbers[f"adapt_{adapt}"] = _series(model.predict_from(X, [20 * DAY, 38 * DAY + 30, 44 * DAY]).T)
    return numbers


def two_stage(name: str) -> Numbers:
    """An identified network and a ridge of its disturbance."""
    log = building(name)
    gray_box = OutputDisturbanceID(n_starts=5, random_state=0)
    model = HybridPredictor(gray_box, DisturbanceForecaster("ridge"), random_state=0).fit(log.X, log.y)
    numbers = {}
    for adapt in (None, "linear"):
        model.set_params(adapt=adapt)
        numbers[f"adapt_{adapt}"] = _series(model.predict(log.later))
    return numbers | _hybrid(model.set_params(adapt="full"), log)


def two_stage_output(name: str) -> Numbers:
    """The same of an output disturbance."""
    log = building(name)
    gray_box = PeriodicDisturbanceID(known=KNOWN[name], n_starts=1)
    # identified again, a building with a flat valley would come to rest elsewhere
    adapt = "full" if name == "office" else "linear"
    model = HybridPredictor(gray_box, disturbance="output", adapt=adapt, random_state=0)
    return _hybrid(model.fit(log.X, log.y), log)


def _gray_box(model: object, log: Building) -> Numbers:
    model.fit(log.X, log.y)
    numbers: Numbers = {"theta": model.theta_.to_numpy(), "theta_std": model.theta_std_.to_numpy()}
    numbers["noise_std"] = np.array([model.noise_std_])
    numbers["disturbance"] = model.disturbance_.to_numpy(dtype=np.float64)
    numbers["predict"] = _series(model.predict(log.later))
    numbers["rolled"] = _series(model.set_params(horizon="1D").predict(log.later))
    _loads(numbers, model, log.later)
    for kind in ("input", "output"):
        for smooth in (False, True):
            zeta = model.estimate_disturbance(log.later, kind, smooth)
            numbers[f"zeta_{kind}{'_smooth' * smooth}"] = _series(zeta)
    numbers["zeta_of_training"] = _series(model.estimate_disturbance(log.X))
    return numbers


def conventional(name: str) -> Numbers:
    return _gray_box(GrayBoxRC(known=KNOWN[name], n_starts=5, random_state=0), building(name))


def input_disturbance(name: str) -> Numbers:
    return _gray_box(InputDisturbanceID(known=KNOWN[name], n_starts=5, random_state=0), building(name))


def output_disturbance(name: str) -> Numbers:
    return _gray_box(OutputDisturbanceID(known=KNOWN[name], n_starts=5, random_state=0), building(name))


def periodic(name: str) -> Numbers:
    return _gray_box(PeriodicDisturbanceID(known=KNOWN[name], n_starts=2, random_state=0), building(name))


def multi_step(name: str) -> Numbers:
    """An objective over many steps, of a log with a gap of ten hours whose rows are absent."""
    log = building(name)
    kept = np.r_[0 : 4 * DAY + 10, 4 * DAY + 50 : 10 * DAY]
    model = OutputDisturbanceID(known=KNOWN[name], n_starts=2, random_state=0, objective="multi_step")
    return _gray_box(model, log._replace(X=log.X.iloc[kept], y=log.y.iloc[kept]))


def arx(name: str) -> Numbers:
    """The black box, static and fitted again at every origin."""
    log = building(name)
    numbers = {}
    for adapt in (None, "refit"):
        model = ARXRegressor(adapt=adapt).fit(log.X, log.y)
        numbers[f"predict_{adapt}"] = _series(model.predict(log.later))
        numbers[f"quantiles_{adapt}"] = _series(model.predict_quantiles(log.later, LEVELS))
    return numbers | {"coef": model.coef_, "alpha": np.array([model.alpha_])}


@cache
def _hourly(name: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Hourly weather and internal gain, the truth of two buildings; training and later rows."""
    if name == "small_office":
        whole = load_small_office()
        whole.X, whole.heat_gain = whole.X.iloc[42 * DAY : 75 * DAY], whole.heat_gain.iloc[42 * DAY : 75 * DAY]
    else:
        whole = make_office(n_days=33, start="2023-10-09", climate="chicago", random_state=7)
    rows = whole.X[["T_oa", "q_sol"]].assign(zeta=whole.heat_gain).resample("1h").mean()
    rows.iloc[200:204, 2] = np.nan
    return rows.iloc[: 28 * 24], rows.iloc[28 * 24 :]


def _disturbance(model: DisturbanceForecaster, name: str) -> Numbers:
    training, later = _hourly(name)
    model.fit(training, training["zeta"])
    return {
        "predict": np.asarray(model.predict(later), dtype=np.float64)[::3],
        "forecast": model.forecast(None, later.iloc[:24]).to_numpy(dtype=np.float64),
        "forecast_elsewhere": model.forecast(later.iloc[7:90], later.iloc[90:110]).to_numpy(dtype=np.float64),
    }


def baselines(name: str) -> Numbers:
    """Baselines of the disturbance."""
    return {
        f"{model}/{key}": values
        for model in ("profile", "last_week", "persistence", "ridge")
        for key, values in _disturbance(DisturbanceForecaster(model), name).items()
    }


#: small networks of few epochs; by themselves, for as corrections they might weigh nothing
_SMALL = {"residual_of": None, "max_epochs": 5, "hidden_size": 8, "random_state": 0, "learning_rate": 0.01}
NETWORKS = {
    "mlp": DisturbanceForecaster("mlp", **_SMALL),
    "mlp_deep": DisturbanceForecaster("mlp", n_layers=2, activation="selu", **_SMALL),
    "mlp_plain": DisturbanceForecaster("mlp", dropout=0.0, **_SMALL),
    "mlp_residual": DisturbanceForecaster("mlp", **_SMALL | {"residual_of": "profile", "max_epochs": 20}),
    "cnn": DisturbanceForecaster("cnn", n_channels=4, **_SMALL),
    "rnn": DisturbanceForecaster("rnn", **_SMALL),
    "lstm": DisturbanceForecaster("lstm", **_SMALL),
    "lstm_plain": DisturbanceForecaster("lstm", dropout=0.0, **_SMALL),
}


def networks(name: str) -> Numbers:
    """The four networks, after few epochs."""
    numbers = {}
    for label, model in NETWORKS.items():
        for key, values in _disturbance(model, name).items():
            numbers[f"{label}/{key}"] = values
        losses = [[epoch["train_loss"], epoch["valid_loss"]] for epoch in model.history_]
        numbers[f"{label}/losses"] = np.array(losses).ravel()
        numbers[f"{label}/weight"] = np.array([model.network_weight_])
    return numbers


def _searched(name: str, frameworks: list[str], size: object) -> Numbers:
    log = building(name)
    forecaster = DisturbanceForecaster(max_epochs=4, random_state=0)
    estimator = HybridPredictor(GrayBoxRC(known=KNOWN[name], n_starts=2, random_state=0), forecaster)
    matrix = design_matrix(frameworks, cases=["case01"], size=size)
    cv = RollingOriginSplit(train="10D", test="2D", step="3D", n_splits=2)
    search = DesignMatrixSearchCV(estimator, matrix, cv=cv, verbose=0).fit(log.X, log.y)
    found = search.cv_results_
    scores = [found[f"{part}_test_score"] for part in ("split0", "split1", "mean", "std")]
    return {"scores": np.concatenate(scores), "predict": _series(search.predict(log.later))}


def search_baselines(name: str) -> Numbers:
    """A search over baselines, of both kinds of disturbance."""
    return _searched(name, ["ridge", "profile", "persistence"], "paper")


def search_networks(name: str) -> Numbers:
    """A search over networks, of both kinds of disturbance."""
    return _searched(name, ["mlp", "lstm"], {"n_layers": [1], "hidden_size": [4, 8]})


SECTIONS: dict[str, tuple[Callable[[str], Numbers], str]] = {
    f"{function.__name__}-{name}": (function, name)
    for function, names in (
        (schedule, BUILDINGS),
        (schedule_long, ("small_office", "home_2")),
        (two_stage, BUILDINGS),
        (two_stage_output, BUILDINGS),
        (conventional, BUILDINGS),
        (input_disturbance, BUILDINGS),
        (output_disturbance, BUILDINGS),
        (periodic, BUILDINGS),
        (multi_step, ("office",)),
        (arx, BUILDINGS),
        (baselines, ("small_office", "office")),
        (networks, ("small_office", "office")),
        (search_baselines, ("office",)),
        (search_networks, ("office",)),
    )
    for name in names
}


def compute(section: str) -> Numbers:
    """The numbers of one section, by the code that is imported."""
    function, name = SECTIONS[section]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(name)


def read() -> dict[str, Numbers]:
    """The frozen numbers, by section."""
    frozen = json.loads(FROZEN.read_text(encoding="utf-8"))
    return {
        section: {key: np.array(values, dtype=np.float64) for key, values in numbers.items()}
        for section, numbers in frozen.items()
    }


def write(sections: list[str]) -> None:
    """Compute sections and write them to the file beside those that it holds."""
    frozen = json.loads(FROZEN.read_text(encoding="utf-8")) if FROZEN.exists() else {}
    for section in sections:
        numbers = compute(section).items()
        # shortest digits that read back to the bit
        frozen[section] = {k: [None if np.isnan(v) else float(v) for v in values] for k, values in numbers}
    lines = [
        f'"{section}": {{\n' + ",\n".join(f'  "{k}": {json.dumps(v)}' for k, v in frozen[section].items()) + "\n}"
        for section in SECTIONS
        if section in frozen
    ]
    FROZEN.parent.mkdir(exist_ok=True)
    FROZEN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    write(sys.argv[1:] or list(SECTIONS))
