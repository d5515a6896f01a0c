"""The logs and the methods of the study of the paper's sections 4.3 and 4.4; ``paper_forecast.py`` runs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from skhybrid import (
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
)
from skhybrid.datasets import load_small_office, make_office, read_epw, read_zone_csv

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
EPW = {
    "oakland": SHARED / "USA_CA_Oakland.Intl.AP.724930_TMY3.epw",
    "chicago": SHARED / "USA_IL_Chicago-OHare.Intl.AP.725300_TMY3.epw",
}
PER_DAY = 96
STARTS = 20
#: a day of the paper's simulated data is judged in the heating season, months after the training
SUMMER, WINTER, DAYS = "2023-07-08", "2023-12-01", 210
#: a boiler's signal has no unit: its kW are relative to this
BOILER = 8.0


class Log(NamedTuple):
    """A thermostat log cut into training and what follows, with the heat that was delivered."""

    train: pd.DataFrame  # roles, T_za among them
    after: pd.DataFrame  # the rows after it, without a gap
    test_start: pd.Timestamp  # first forecast; rows of ``after`` before it are history
    capacity: Mapping[str, float] | None  # stage -> kW; None if the log holds the heat itself
    known: Mapping[str, float] | None  # given to an identification
    band: pd.DataFrame | None  # heating and cooling set-point of ``after`` [degC]
    theta: Mapping[str, float] | None  # the true network, where there is one

    def heat(self, table: pd.DataFrame) -> pd.Series:
        """Heat [kW] of a log's or of a load's rows."""
        if self.capacity is None:
            return table["Q_hvac"]
        return sum((table[role] * q for role, q in self.capacity.items()), pd.Series(0.0, table.index))


def _simulated(climate: str, seed: int) -> Log:
    weather = read_epw(EPW[climate]) if EPW[climate].is_file() else None
    office = make_office(DAYS, climate, start=SUMMER, weather=weather, random_state=3000 + seed)
    n = 28 * PER_DAY
    return Log(
        office.X[:n],
        office.X[n:],
        pd.Timestamp(WINTER),
        {"u_heat": 6.0, "u_cool": -6.0},
        {"Q_h": 6.0},
        office.setpoints[n:],
        office.theta,
    )


def _home(number: int) -> Log:
    columns = {"T_za": "T_in_degC", "T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd"}
    X = read_zone_csv(SHARED / f"dutch_home_{number}.csv", columns, timezone="Europe/Amsterdam")
    X["u_heat"] /= 78.0
    after = X["2021-12-01":"2021-12-31"]
    return Log(X["2021-11-01":"2021-11-30"], after, after.index[0], {"u_heat": BOILER}, {"Q_h": BOILER}, None, None)


def _office() -> Log:
    log = load_small_office("irregular")
    after = log.X["2018-10-15":"2018-12-15"]
    band = log.frame.loc[after.index, ["set_heat", "set_cool"]]
    start = after.index[after.index.searchsorted(pd.Timestamp("2018-10-22", tz=after.index.tz))]
    return Log(log.X["2018-09-17":"2018-10-14"], after, start, None, None, band, None)


#: name -> log of a seed; a seed draws another office, and for logs that are given it only seeds the fits
LOGS: dict[str, Callable[[int], Log]] = {
    "oakland": lambda seed: _simulated("oakland", seed),
    "chicago": lambda seed: _simulated("chicago", seed),
    "home 2": lambda _: _home(2),
    "home 3": lambda _: _home(3),
    "small office": lambda _: _office(),
}


def available() -> list[str]:
    """The logs that are at hand: homes lie beside the checkout only."""
    return [name for name in LOGS if "home" not in name or SHARED.is_dir()]


class Conventional:
    """The paper's conventional approach: a gray box that expects no disturbance."""

    def __init__(self, gray_box: Any) -> None:
        self.gray_box = gray_box

    def fit(self, X: pd.DataFrame, y: pd.Series) -> Conventional:
        """Identify the network."""
        self.gray_box.fit(X, y)
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray) -> np.ndarray:
        """A day of temperature after each origin (paper Eq. ID_hybrid without zeta)."""
        return self.gray_box.drive(X, origins, np.zeros((len(origins), PER_DAY)))

    def predict_load(self, X: pd.DataFrame, setpoint: Any) -> pd.DataFrame:
        """The load, computed again from the measurements at every midnight (paper Eq. inverseQ2)."""
        origins = np.union1d([0], midnights(X.index))
        longest = int(np.diff(np.append(origins, len(X))).max())
        return self.gray_box.required_heat(X, setpoint, origins, np.zeros((len(origins), longest)))


def midnights(index: pd.DatetimeIndex) -> np.ndarray:
    """Rows that begin a local day."""
    return np.flatnonzero(index == index.normalize())


def _lstm(gray_box: Any, seed: int, **settings: Any) -> HybridPredictor:
    """The paper's final network: DEEP_AR_LSTM_FORECAST-case01, one layer, ReLU (paper 4.2)."""
    network = DisturbanceForecaster("lstm", "case01", n_layers=1, activation="relu", residual_of=None)
    return HybridPredictor(gray_box, network, adapt=None, random_state=seed, **settings)


def _with_baseline(gray_box: Any, model: str, seed: int) -> HybridPredictor:
    return HybridPredictor(gray_box, DisturbanceForecaster(model), adapt=None, random_state=seed)


def methods(log: Log, seed: int) -> dict[str, Callable[[], Any]]:
    """Makers of unfitted models, by name."""

    def identify(kind: type) -> Any:
        return kind(known=log.known, n_starts=STARTS, random_state=seed)

    out: dict[str, Callable[[], Any]] = {
        "conventional CONV": lambda: Conventional(identify(GrayBoxRC)),
        "conventional ID": lambda: Conventional(identify(InputDisturbanceID)),
        "conventional OD": lambda: Conventional(identify(OutputDisturbanceID)),
        "hybrid OD, LSTM": lambda: _lstm(identify(OutputDisturbanceID), seed),
        "hybrid OD, profile": lambda: _with_baseline(identify(OutputDisturbanceID), "profile", seed),
        "hybrid OD, ridge": lambda: _with_baseline(identify(OutputDisturbanceID), "ridge", seed),
        "default": lambda: HybridPredictor(random_state=seed),
    }
    if seed == 0 and log.band is not None:  # networks train for long: their variants once, on the simulated buildings
        out["hybrid ID, LSTM"] = lambda: _lstm(identify(InputDisturbanceID), seed)
        out["hybrid OD, LSTM, output"] = lambda: _lstm(identify(OutputDisturbanceID), seed, disturbance="output")
    if log.theta is not None:
        out = {"TRUE, no disturbance": lambda: Conventional(GrayBoxRC(known=log.theta))} | out
    return out
