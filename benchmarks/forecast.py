"""Day-ahead error of the hybrid and of its rivals on the reference logs, same and new control.

Writes ``results/forecast.md``; logs that are not beside the checkout (``../shared/data``) are left out.  About five
minutes on one core: ``python benchmarks/forecast.py``.
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import pandas as pd
from _report import write_table

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
)
from skhybrid.datasets import load_small_office, make_office, read_zone_csv
from skhybrid.exceptions import SkhybridWarning
from skhybrid.model_selection import backtest, score_backtest

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def _office(control: str):
    train, test = load_small_office("irregular"), load_small_office(control)
    return train.X["2018-09-03":"2018-10-14"], test.X["2018-10-21":"2018-12-15"], "2018-10-22", "25h", None


def _home(number: int):
    columns = {"T_za": "T_in_degC", "T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd"}
    X = read_zone_csv(SHARED / f"dutch_home_{number}.csv", columns, timezone="Europe/Amsterdam")
    X["u_heat"] /= 78.0
    return X[:"2021-11-30"], X["2021-11-30":"2021-12-31"], "2021-12-01", "5h", {"Q_h": 8.0}


def _paper(climate: str, start: str):
    office = make_office(n_days=56, climate=climate, start=start, random_state=2024)
    return office.X[: 28 * 96], office.X[27 * 96 :], office.X.index[28 * 96], "1D", {"Q_h": 6.0}


DATA = {
    "office, same control": lambda: _office("irregular"),
    "office, new control": lambda: _office("shifted"),
    "paper's office, oakland": lambda: _paper("oakland", "2023-07-08"),
    "paper's office, chicago": lambda: _paper("chicago", "2023-10-07"),
    "dutch home 2": lambda: _home(2),
    "dutch home 3": lambda: _home(3),
}


def models(known):
    """Estimators by name; the forecasters share the identification of the default."""

    def hybrid(model: str, **settings):
        return HybridPredictor(
            PeriodicDisturbanceID(known=known), DisturbanceForecaster(model=model), random_state=0, **settings
        )

    return {
        "conventional CONV": GrayBoxRC(known=known, n_starts=12, random_state=0),
        "conventional OD": OutputDisturbanceID(known=known, n_starts=12, random_state=0),
        "hybrid, persistence": hybrid("persistence"),
        "hybrid, last week": hybrid("last_week"),
        "hybrid, profile": hybrid("profile"),
        "hybrid, frozen": hybrid("ridge", adapt=None),
        "hybrid (default)": hybrid("ridge"),
        "ARX": ARXRegressor(),
        "ARX re-fitted": ARXRegressor(adapt="refit"),
    }


def main() -> None:
    """Run all and write the table."""
    rows = []
    for name, load in DATA.items():
        if "home" in name and not SHARED.is_dir():
            continue
        train, test, start, every, known = load()
        for label, model in models(known).items():
            begin = time.perf_counter()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SkhybridWarning)
                model.fit(train, train["T_za"])
            frame = backtest(model, test, test["T_za"], origin_step=every, start=start)
            score = score_backtest(frame)
            rows.append(
                {
                    "data": name,
                    "model": label,
                    "rmse": float(score["rmse"]),
                    "mae": float(score["mae"]),
                    "origins": frame["origin"].nunique(),
                    "seconds": time.perf_counter() - begin,
                }
            )
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    order = list(models(None))
    write_table(
        "forecast",
        "Day-ahead error of the room temperature",
        "python benchmarks/forecast.py",
        {
            "RMSE [K]": table.pivot_table(index="model", columns="data", values="rmse", sort=False).loc[order],
            "MAE [K]": table.pivot_table(index="model", columns="data", values="mae", sort=False).loc[order],
            "Origins and seconds (fit and back-test)": table.groupby("data", sort=False).agg(
                origins=("origins", "first"), seconds=("seconds", "sum")
            ),
        },
        "One run; at so few origins a few per cent are noise. A kW of a Dutch home is relative to an assumed boiler of "
        "8 kW.",
    )


if __name__ == "__main__":
    main()
