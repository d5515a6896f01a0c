"""Time of one step of a controller: ``update``, then a forecast from the temperature measured now.

``python benchmarks/control_speed.py`` writes ``results/control_speed.md``, in about a minute on one core; with
``--zones 8`` it writes ``results/control_speed_zones.md``, of simulated houses whose zones are forecast together.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import pandas as pd
from _report import write_table

from skhybrid import BuildingPredictor, HybridPredictor, InputDisturbanceID, TwoStagePredictor
from skhybrid.datasets import make_house, make_office
from skhybrid.exceptions import SkhybridWarning

DAY, TRAIN, STEPS = 96, 28 * 96, 40
FITS = "Processor time of a fit with neighbours, six weeks"
LEVELS = (0.1, 0.5, 0.9)
#: call -> what a controller asks for, with the rows ahead and the temperature now
CALLS: dict[str, Callable[[Any, pd.DataFrame, float], object]] = {
    "forecast": lambda model, future, T: model.forecast(None, future),
    "forecast, T_za": lambda model, future, T: model.forecast(None, future, T_za=T),
    "affine_forecast, T_za": lambda model, future, T: model.affine_forecast(None, future, T_za=T),
    "the same, 3 quantiles": lambda model, future, T: model.affine_forecast(None, future, T_za=T, quantiles=LEVELS),
    "to_state_space, T_za": lambda model, future, T: model.to_state_space(None, future, T_za=T),
}
MODELS = {
    "default": lambda: HybridPredictor(),
    "two-stage, ridge": lambda: TwoStagePredictor(InputDisturbanceID(n_starts=2), random_state=0),
    "gray box (ID)": lambda: InputDisturbanceID(n_starts=2, random_state=0),
}


def measured(model: Any, X: pd.DataFrame, call: Callable[[Any, pd.DataFrame, float], object]) -> np.ndarray:
    """(STEPS, 2) milliseconds of an update by one row and of the call after it, and the first call left out."""
    out, now = np.empty((STEPS + 1, 2)), TRAIN + 5 * DAY
    model.update(X[TRAIN:now])
    for i in range(STEPS + 1):
        row, future, T = X[now : now + 1], X[now + 1 : now + 1 + DAY], float(X["T_za"].iloc[now + 1])
        begin = time.perf_counter()
        model.update(row)
        middle = time.perf_counter()
        call(model, future, T)
        out[i] = middle - begin, time.perf_counter() - middle
        now += 1
    return 1e3 * out[1:]


def houses(n_zones: int, n_days: int = 28) -> tuple[pd.DataFrame, pd.DataFrame, list[tuple[str, str]]]:
    """Inputs, temperatures and neighbours of houses of up to eight zones each, as if in one weather."""
    X, y, adjacency = [], [], []
    for k, zones in enumerate(np.array_split(np.arange(n_zones), -(-n_zones // 8))):
        house = make_house(n_days, zones=len(zones), random_state=k)
        heated = house.X[[name for name in house.X if not name.startswith("u_heat")]].join(house.heat)
        own = {name: f"{name}_{k}" for name in heated if name != "T_oa"}
        X.append(heated.rename(columns=own))
        y.append(house.y.rename(columns=own))
        adjacency += [(f"{one}_{k}", f"{other}_{k}") for one, other in house.adjacency]
    whole = pd.concat(X, axis=1)
    return whole.loc[:, ~whole.columns.duplicated()], pd.concat(y, axis=1), adjacency


def fits(n_zones: int) -> pd.DataFrame:
    """Processor time of a fit with neighbours to six weeks, of a quarter of the zones, of half and of all."""
    out = {}
    for n in (n_zones // 4, n_zones // 2, n_zones):
        X, y, adjacency = houses(n, 42)
        begin = time.process_time()
        BuildingPredictor(adjacency=adjacency).fit(X, y)
        out[n] = {"fit [s]": time.process_time() - begin}
    return pd.DataFrame(out).T.rename_axis("zones")


def of_zones(n_zones: int) -> None:
    """Time fits, then a building of some zones, with and without neighbours, and its zones one by one, in turn."""
    X, y, adjacency = houses(n_zones)
    train, now = 21 * DAY, 26 * DAY
    building = BuildingPredictor(adjacency=adjacency).fit(X[:train], y[:train])
    building.update(X[train:now])
    models = {"with neighbours": building, "without": building.without_neighbours()}
    models |= {"one by one": deepcopy(list(building.own_.values()))}
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in models}
    for row in range(now, now + STEPS // 2 + 1):
        for name, model in models.items():
            parts = model if isinstance(model, list) else [model]
            begin = time.process_time()
            for one in parts:
                one.update(X[row : row + 1])
            middle = time.process_time()
            for one in parts:
                one.forecast(None, X[row + 1 : row + 1 + DAY])
            spent[name].append((middle - begin, time.process_time() - middle))
    each = {name: 1e3 * np.array(found[1:]) / n_zones for name, found in spent.items()}
    middles = {name: np.append(np.median(found, axis=0), found[:, 1].min()) for name, found in each.items()}
    names = ["update, one row [ms]", "forecast [ms]", "its least [ms]"]
    table = pd.DataFrame(middles, names).T.rename_axis("forecast")
    table["its least, to one by one"] = table[names[2]] / table.loc["one by one", names[2]]
    print(table.round(2))
    write_table(
        "control_speed_zones",
        "Time of one step of a building",
        f"python benchmarks/control_speed.py --zones {n_zones}",
        {"Processor time per zone, median over 20 steps, and the least": table, FITS: fits(n_zones)},
        f"make_house, {n_zones} zones in houses of up to 8, 15 min, 21 days of training and 5 of history; 24 h ahead.  "
        "With neighbours each zone has two predictors; one by one: the predictors of the zones by themselves, each of "
        "which reads the rows anew.",
    )


def main() -> None:
    """Fit the models, time them and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--zones", type=int, help="time a building of so many zones")
    n_zones = parser.parse_args().zones
    warnings.simplefilter("ignore", SkhybridWarning)
    if n_zones is not None:
        of_zones(n_zones)
        return
    office = make_office(n_days=36, random_state=3)
    heat = 6.0 * office.X["u_heat"] - 5.0 * office.X["u_cool"]
    X = office.X.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=heat)
    rows = {}
    for name, make in MODELS.items():
        model = make().fit(X[:TRAIN], office.y[:TRAIN])
        for asked, call in CALLS.items():
            if "quantiles" in asked and name.startswith("gray box"):
                continue
            spent = measured(deepcopy(model), X, call)
            (update, answer), (_, least) = np.median(spent, axis=0), spent.min(axis=0)
            rows[name, asked] = {"update, one row [ms]": update, "the call [ms]": answer, "its least [ms]": least}
    table = pd.DataFrame(rows).T.rename_axis(index=["model", "call after the update"])
    print(table.round(2))
    write_table(
        "control_speed",
        "Time of one step of a controller",
        "python benchmarks/control_speed.py",
        {"Median over 40 steps, on the wall, and the least": table},
        "make_office, 15 min, 28 days of training and 5 of history; 24 h ahead.",
    )


if __name__ == "__main__":
    main()
