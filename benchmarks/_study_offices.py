"""The final comparison of the study in several offices: the chosen case, ridge, ARX, the default, the gray box."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from _single_networks import chosen_network, single_networks
from _study_plan import CLIMATES, TEST_DAYS, TRAIN_DAYS, Split, gray_box
from sklearn.frozen import FrozenEstimator

from skhybrid import ARXRegressor, DisturbanceForecaster, HybridPredictor, TwoStagePredictor
from skhybrid.datasets import make_office
from skhybrid.model_selection.search.tasks import MeasuredRmse

#: the case that the rules choose in each climate, in the size with its lowest error: framework, case, size
CHOSEN: dict[str, tuple[str, str, dict[str, Any]]] = {
    "oakland": ("rnn", "case01", {"n_layers": 2, "hidden_size": 20, "activation": "selu"}),
    "chicago": ("mlp", "case01", {"n_layers": 1, "hidden_size": 10, "activation": "relu"}),
}
MODELS = ("the choice", "the choice on all days", "ridge", "arx", "default", "OD alone", "OD, no disturbance")
NAME = "selection_study_offices.csv"
COLUMNS = ["climate", "office", "model", "repeats", "rmse", "lowest", "highest", "seconds"]


def office(climate: str, number: int) -> Split:
    """The rows of one office; number 0 is that of the study."""
    days = TRAIN_DAYS + TEST_DAYS
    made = make_office(n_days=days, climate=climate, start=CLIMATES[climate], random_state=2024 + number)
    return Split(made.X, made.y)


def models(climate: str, data: Split, repeats: int) -> dict[str, Callable[[], Any]]:
    """Makers of models by name; the two-stage ones share one identification."""
    identified = FrozenEstimator(gray_box().fit(*data.train))
    framework, case, size = CHOSEN[climate]

    def two_stage(forecaster: DisturbanceForecaster) -> HybridPredictor:
        return HybridPredictor(identified, forecaster, adapt=None, intervals=False, random_state=0)

    def network(refit: bool) -> HybridPredictor:
        several = {"n_repeats": repeats, "repeats": "mean", "refit": refit}
        return two_stage(DisturbanceForecaster.published(framework, case, **several, **size))

    return {
        "the choice": lambda: network(False),
        "the choice on all days": lambda: network(True),
        "ridge": lambda: two_stage(DisturbanceForecaster("ridge")),
        "arx": lambda: ARXRegressor(),
        "default": lambda: HybridPredictor(),
        "OD alone": lambda: identified,
        "OD, no disturbance": lambda: TwoStagePredictor.conventional(identified),
    }


def read(folder: Path) -> pd.DataFrame:
    """The kept results, one row per climate, office, model and number of repeats."""
    path = folder / NAME
    return pd.read_csv(path) if path.is_file() else pd.DataFrame(columns=COLUMNS)


def write(results: pd.DataFrame, folder: Path) -> None:
    """Keep results, completely or not at all."""
    part = (folder / NAME).with_suffix(".part")
    results.to_csv(part, index=False, float_format="%.6g")
    part.replace(folder / NAME)


def run(store: Path, climates: list[str], n_offices: int, repeats: int) -> None:
    """Fit and score what is not kept yet; each result is written when it is there, so that a run may be stopped."""
    store.mkdir(parents=True, exist_ok=True)
    for number in range(n_offices):
        for climate in climates:
            data: Split | None = None
            made: dict[str, Callable[[], Any]] = {}
            for name in MODELS:
                kept, key = read(store), [climate, number, name, repeats]
                if (kept[COLUMNS[:4]] == key).all(axis=1).any():
                    continue
                if data is None:
                    data = office(climate, number)
                    made = models(climate, data, repeats)
                row = dict(zip(COLUMNS, key, strict=False)) | score(made[name](), data)
                write(pd.DataFrame([*kept.to_dict("records"), row], columns=COLUMNS), store)
                print(f"{climate}, office {number}, {name}: {row['rmse']:.3f} K in {row['seconds']:.0f} s", flush=True)


def score(model: Any, data: Split) -> dict[str, float]:
    """RMSE [K] on the test, with the lowest and highest of single networks; a network is the one validation chooses."""
    begun = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(*data.train)
        each = []
        if len(getattr(getattr(model, "forecaster_", None), "repeats_", ())):
            networks = single_networks(model)
            model = chosen_network(model, networks)
            each = [MeasuredRmse()(one, *data.test) for one in networks]
        rmse = MeasuredRmse()(model, *data.test)
    seconds = time.perf_counter() - begun
    return {"rmse": rmse, "lowest": min(each, default=rmse), "highest": max(each, default=rmse), "seconds": seconds}


def comparison(results: pd.DataFrame) -> pd.DataFrame:
    """One row per climate and model: median (range) over offices, range of single networks, offices it is best in."""
    rows = []
    results = results[results["repeats"] == results["repeats"].max()]
    for climate, here in results.groupby("climate", sort=False):
        wide = here.pivot_table(index="office", columns="model", values="rmse").dropna()
        best = wide.idxmin(axis=1).value_counts()
        for name in wide:
            of = here[(here["model"] == name) & here["office"].isin(wide.index)]
            rows.append(
                {
                    "climate": climate,
                    "model": name,
                    "RMSE [K]": _spread(of["rmse"]),
                    "single networks [K]": f"{of['lowest'].min():.3f}-{of['highest'].max():.3f}"
                    if (of["lowest"] != of["highest"]).any()
                    else "",
                    "best in": f"{best.get(name, 0)} of {len(wide)} offices",
                    "middle": float(of["rmse"].median()),
                }
            )
    table = pd.DataFrame(rows).sort_values(["climate", "middle"])
    return table.drop(columns="middle").set_index("climate")


def _spread(errors: pd.Series) -> str:
    return f"{errors.median():.3f} ({errors.min():.3f}-{errors.max():.3f})"
