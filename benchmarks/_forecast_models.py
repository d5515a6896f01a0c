"""Models of the forecast benchmark by name, each made for a data set and a seed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from _forecast_baselines import Held, LeftAlone, Oracle, Yesterday
from _forecast_data import BEAM_AND_SKY, DataSet
from _n4sid import N4SID
from sklearn.pipeline import make_pipeline

from skhybrid import (
    ARXRegressor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
)
from skhybrid.forecasting import BoostedRegressor

Make = Callable[[DataSet, int], Any]
ADAPTING = {None: "hybrid, static", "linear": "hybrid, linear", "full": "hybrid, full"}
#: the default, whose ratios are reported; what they are ratios to; and the gray boxes alone
HYBRID, ARX, REFITTED, ORACLE = ADAPTING[HybridPredictor().adapt], "ARX", "ARX re-fitted", "oracle"
AIR_ORACLE = "oracle with air"
GRAY_BOXES = ("CONV", "ID alone", "OD alone")
#: with the same inputs as the default
COMPETITORS = (
    ARX, REFITTED, "ARX, multi-step", "ARX, multi-step, re-fitted", "boosting, direct", "boosting on ARX", "N4SID"
)  # fmt: skip
#: the paper's final configuration (4.2, 4.4) of every framework; case01 has the same features in all four.
NETWORK_CASE = {"case": "case01", "n_layers": 1, "activation": "relu", "residual_of": None}


class Model(NamedTuple):
    """A model of the benchmark, as it is made."""

    make: Make
    group: str = "cheap"  # "cheap", "hybrid" or "networks": what a command runs
    random: bool = False  # whether it draws random numbers, so that seeds matter
    facades: bool = False  # whether it reads the irradiance on facades
    applies: Callable[[DataSet], bool] = lambda data: True


def bounds_for(data: DataSet) -> dict[str, tuple[float, float]] | None:
    """The paper's bounds, scaled by the size of the plant relative to the 6 kW of the paper's office.

    They are those of a room of 57 m2.  A school with a hundred times the heat lies far outside them, and a gray
    box at its bounds (errors of 8-12 K) would not be a fair baseline.  None if only stages were logged.
    """
    if "Q_hvac" not in data.train:
        return None
    k = max(1.0, float(data.train["Q_hvac"].abs().max()) / 6.0)
    masses = dict.fromkeys(("C_w", "C_za"), (0.1 * k, 40.0 * k))
    return masses | dict.fromkeys(("R_zw", "R_zo"), (0.1 / k, 40.0 / k)) | {"A_win": (0.1 * k, 25.0 * k)}


def _two_stage(forecaster: str, **settings: Any) -> Make:
    """The two-stage scheme with the best identification of the package."""

    def make(data: DataSet, seed: int) -> Any:
        model = DisturbanceForecaster(model=forecaster, **settings)
        identification = PeriodicDisturbanceID(known=dict(data.known), bounds=bounds_for(data))
        return HybridPredictor(identification, model, random_state=seed)

    return make


def _alone(identification: type) -> Make:
    def make(data: DataSet, seed: int) -> Any:
        settings = {"known": dict(data.known), "bounds": bounds_for(data)}
        return LeftAlone(identification(**settings, n_starts=12, random_state=seed))

    return make


def with_facades(make: Make) -> Make:
    """The same model after a transformer that adds irradiance on four facades, from beam and sky if logged."""

    def piped(data: DataSet, seed: int) -> Any:
        from skhybrid.preprocessing import FacadeIrradiance  # type: ignore[attr-defined]

        assert data.site is not None  # has_facades
        logged = {name: name for name in BEAM_AND_SKY if name in data.train}
        latitude, longitude = data.site
        return make_pipeline(FacadeIrradiance(latitude=latitude, longitude=longitude, **logged), make(data, seed))

    return piped


def has_facades(data: DataSet) -> bool:
    """Whether a site is known, and the package has the transformer."""
    import skhybrid.preprocessing

    return data.site is not None and hasattr(skhybrid.preprocessing, "FacadeIrradiance")


def _hybrid(adapt: str | None) -> Make:
    return lambda data, seed: HybridPredictor(adapt=adapt, random_state=seed)


MODELS: dict[str, Model] = {
    "yesterday": Model(lambda data, seed: Yesterday()),
    "last temperature": Model(lambda data, seed: Held()),
    "CONV": Model(_alone(GrayBoxRC)),
    "ID alone": Model(_alone(InputDisturbanceID)),
    "OD alone": Model(_alone(OutputDisturbanceID)),
    "last week's disturbance": Model(_two_stage("last_week")),
    "hour-of-week mean": Model(_two_stage("profile")),
    "ridge": Model(_two_stage("ridge")),
    "boosting, direct": Model(lambda data, seed: BoostedRegressor(random_state=seed)),
    "boosting on ARX": Model(lambda data, seed: BoostedRegressor(residual_of="arx", random_state=seed)),
    "N4SID": Model(lambda data, seed: N4SID()),
    ARX: Model(lambda data, seed: ARXRegressor()),
    "ARX, facades": Model(with_facades(lambda data, seed: ARXRegressor()), facades=True, applies=has_facades),
    REFITTED: Model(lambda data, seed: ARXRegressor(adapt="refit")),
    "ARX re-fitted, facades": Model(
        with_facades(lambda data, seed: ARXRegressor(adapt="refit")), facades=True, applies=has_facades
    ),
    "ARX, multi-step": Model(lambda data, seed: ARXRegressor(objective="multi_step")),
    "ARX, multi-step, re-fitted": Model(lambda data, seed: ARXRegressor(objective="multi_step", adapt="refit")),
    "MLP": Model(_two_stage("mlp", **NETWORK_CASE), "networks", random=True),
    "CNN": Model(_two_stage("cnn", **NETWORK_CASE), "networks", random=True),
    "RNN": Model(_two_stage("rnn", **NETWORK_CASE), "networks", random=True),
    "LSTM": Model(_two_stage("lstm", **NETWORK_CASE), "networks", random=True),
    **{name: Model(_hybrid(adapt), "hybrid") for adapt, name in ADAPTING.items()},
    f"{HYBRID}, facades": Model(
        with_facades(lambda data, seed: HybridPredictor(random_state=seed)), "hybrid", facades=True, applies=has_facades
    ),
    ORACLE: Model(lambda data, seed: Oracle(data.truth), applies=lambda data: data.truth is not None),
    AIR_ORACLE: Model(
        lambda data, seed: Oracle(data.truth, knows_air=True), applies=lambda data: data.truth is not None
    ),
}
