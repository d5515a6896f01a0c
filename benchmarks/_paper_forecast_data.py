"""The logs and the methods of the study of the paper's sections 4.3 and 4.4; ``paper_forecast.py`` runs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from _reference_data import EPW, reference
from sklearn.frozen import FrozenEstimator

from skhybrid import (
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    TwoStagePredictor,
)
from skhybrid.datasets import load_small_office, make_office, read_epw, read_zone_csv

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
    weather = read_epw(reference(EPW[climate], "leave this log out with --logs"))
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
    path = reference(f"dutch_home_{number}.csv", "leave this log out with --logs")
    X = read_zone_csv(path, columns, timezone="Europe/Amsterdam")
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


#: logs of which every seed is another office
SIMULATED = ("oakland", "chicago")


def midnights(index: pd.DatetimeIndex) -> np.ndarray:
    """Rows that begin a local day."""
    return np.flatnonzero(index == index.normalize())


def methods(log: Log, seed: int, n_repeats: int) -> dict[str, Callable[[], Any]]:
    """Makers of models by name; those that share an identification are given it fitted."""

    @cache
    def identified(kind: type) -> FrozenEstimator:
        made = kind(known=log.known, n_starts=STARTS, horizon="1D", random_state=seed)
        return FrozenEstimator(made.fit(log.train, log.train["T_za"]))

    def hybrid(kind: type, forecaster: DisturbanceForecaster, **settings: Any) -> HybridPredictor:
        return HybridPredictor(identified(kind), forecaster, adapt=None, random_state=seed, **settings)

    def lstm(kind: type, refit: bool = False, **settings: Any) -> HybridPredictor:
        """The paper's final network: DEEP_AR_LSTM_FORECAST-case01, one layer, ReLU (paper 4.2)."""
        size = {"n_layers": 1, "activation": "relu"}
        # all are kept, so that each can be scored; validation chooses among them, as with repeats="best"
        several = {"n_repeats": n_repeats, "repeats": "mean", "refit": refit}
        network = DisturbanceForecaster.published("lstm", "case01", **several, **size)
        return hybrid(kind, network, intervals=False, **settings)

    out: dict[str, Callable[[], Any]] = {}
    if log.theta is not None:
        out["TRUE, no disturbance"] = lambda: TwoStagePredictor.conventional(GrayBoxRC(known=log.theta))
    for name, kind in (("CONV", GrayBoxRC), ("ID", InputDisturbanceID), ("OD", OutputDisturbanceID)):
        out[f"{name} alone"] = lambda kind=kind: identified(kind)
        out[f"{name}, no disturbance"] = lambda kind=kind: TwoStagePredictor.conventional(identified(kind))
    out |= {
        "hybrid OD, LSTM": lambda: lstm(OutputDisturbanceID),
        "hybrid OD, LSTM on all days": lambda: lstm(OutputDisturbanceID, refit=True),
        "hybrid OD, profile": lambda: hybrid(OutputDisturbanceID, DisturbanceForecaster("profile")),
        "hybrid OD, ridge": lambda: hybrid(OutputDisturbanceID, DisturbanceForecaster("ridge")),
        "default": lambda: HybridPredictor(random_state=seed),
    }
    if seed == 0 and log.band is not None:  # networks train for long: their variants once, on the simulated buildings
        out["hybrid ID, LSTM"] = lambda: lstm(InputDisturbanceID)
        out["hybrid OD, LSTM, output"] = lambda: lstm(OutputDisturbanceID, disturbance="output")
    return out
