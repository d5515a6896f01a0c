"""Baselines without a network, on the same rows and with the same score as the candidates of the study."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from _study_plan import Split, gray_box

from skhybrid import ARXRegressor, HybridPredictor, TwoStagePredictor
from skhybrid.model_selection.search.tasks import MeasuredRmse

#: simple enough that a network must beat them; the package's default is shown too, but is not simple
SIMPLE = ("ridge", "profile", "last_week", "persistence", "arx")
MAKERS: dict[str, Callable[[], Any]] = {
    "arx": lambda: ARXRegressor(),
    "OD alone": gray_box,
    "OD, no disturbance": lambda: TwoStagePredictor.conventional(gray_box()),
    "default, adapt=None": lambda: HybridPredictor(adapt=None),
    "default": lambda: HybridPredictor(),
}


def path_of(store: Path, climate: str) -> Path:
    """File of the baselines of a climate."""
    return store / f"baselines_{climate}.csv"


def read(store: Path, climate: str) -> pd.DataFrame:
    """The kept results: ``framework``, ``rmse`` [K], ``fit_time`` and ``score_time`` [s]."""
    path = path_of(store, climate)
    if not path.is_file():
        return pd.DataFrame(columns=["framework", "rmse", "fit_time", "score_time"])
    return pd.read_csv(path)


def run(store: Path, climate: str, data: Split) -> None:
    """Fit and score those that are not kept yet; each is written when it is done."""
    table = read(store, climate)
    for name, make in MAKERS.items():
        if name in set(table["framework"]):
            continue
        begun = time.perf_counter()
        model = make().fit(*data.train)
        fitted = time.perf_counter()
        rmse = MeasuredRmse()(model, *data.test)
        row = [name, rmse, fitted - begun, time.perf_counter() - fitted]
        table = pd.DataFrame([*table.to_numpy().tolist(), row], columns=table.columns)
        part = path_of(store, climate).with_suffix(".part")
        table.to_csv(part, index=False)
        part.replace(path_of(store, climate))
        print(f"{climate} {name}: {rmse:.3f} K, {row[2]:.0f} s and {row[3]:.0f} s", flush=True)
