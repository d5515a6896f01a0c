"""The models that a study compares: the hybrid, two-stage models, gray boxes, black boxes and yesterday."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .. import identification
from .._time import rows_of
from ..forecasting import ARXRegressor, BoostedRegressor, DisturbanceForecaster
from ..forecasting.named_models import check_parameters
from ..hybrid import BuildingPredictor, HybridPredictor, TwoStagePredictor
from ..hybrid.schedule_predictor import DEFAULT_NETWORK
from ..thermal import RCNetwork, get_network
from .keys import check_keys
from .log_split import FACADES
from .settings import ESTIMATORS, SCHEDULE, Settings

HYBRID = "hybrid"  # label of the model whose forecast is shown
ALONE = "hybrid, each zone by itself"  # label of the same without neighbours, where there are several zones
YESTERDAY = "yesterday"  # label of the simplest rule
#: models of one zone that several zones are compared with, each fitted to every zone
_OF_EACH_ZONE = ("ARX re-fitted", "ARX, multi-step, re-fitted", YESTERDAY)
#: baselines of the disturbance in the two-stage scheme: label and note
_TWO_STAGE = {
    "ridge": ("hybrid, two-stage (ridge)", "disturbance linear in calendar, weather and lags"),
    "profile": ("hybrid, two-stage (profile)", "disturbance = its mean by hour of the week"),
    "last_week": ("hybrid, two-stage (last_week)", "disturbance = that of a week before"),
    "persistence": ("hybrid, two-stage (persistence)", "disturbance stays as it is"),
}
_IDENTIFIED_NETWORK = "2R2C"  # network of the identifications where the settings name none


class StudyModel(NamedTuple):
    """One row of the comparison.

    Attributes
    ----------
    label : str, its name in tables and pictures
    estimator : estimator, not fitted
    note : str, what it is, in a few words
    """

    label: str
    estimator: Any
    note: str


class Yesterday(RegressorMixin, BaseEstimator):
    """Forecast the temperature of 24 hours before; beyond a day, the last known day is repeated."""

    def fit(self, X: pd.DataFrame, y: Any = None) -> Yesterday:
        """Keep the temperatures; the last day of them is the forecast of the first rows that follow.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; by default ``T_za`` of X.
        """
        self.past_ = pd.Series(np.asarray(X["T_za"] if y is None else y, dtype=np.float64), X.index).ffill().bfill()
        return self

    def predict_from(self, X: pd.DataFrame, origins: Any, horizon: Any = "1D") -> np.ndarray:
        """Forecasts [degC] (n_origins, n_leads) of the rows after each of the given origins.

        Where there is no day before, the first temperature takes its place.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Consecutive rows with a DatetimeIndex and ``T_za``, which is read up to each origin.
        origins : sequence of int, row numbers of X
        horizon : timedelta-like, default="1D"
        """
        check_is_fitted(self)
        step = X.index[1] - X.index[0]
        day, n_leads = rows_of("1D", step), rows_of(horizon, step)
        past = self.past_.iloc[-day:] if self.past_.index[-1] + step == X.index[0] else self.past_.iloc[:0]
        known = pd.concat([past, X["T_za"]]).ffill().fillna(self.past_.iloc[-1]).to_numpy(dtype=np.float64)
        back = (np.arange(n_leads) % day) + 1 - day  # 0 is the origin itself
        return known[np.maximum(np.asarray(origins)[:, None] + len(past) + back, 0)]


def make_models(settings: Settings, memory: Any = None) -> list[StudyModel]:
    """The models of a study, unfitted; the hybrid comes first.

    Parameters
    ----------
    settings : Settings
    memory : str or joblib.Memory, optional
        Where the identification that the two-stage models share is kept, so that it is run once.
    """
    made = _models_of_zone(settings, None if settings.zones else memory)
    if not settings.zones:
        return made
    building = BuildingPredictor(made[0].estimator, adjacency=settings.adjacency)
    hybrid = StudyModel(HYBRID, building, "each zone under its neighbours' forecasts")
    return [hybrid, *(one for one in made if one.label in _OF_EACH_ZONE)]


def _models_of_zone(settings: Settings, memory: Any) -> list[StudyModel]:
    given, common = make_forecaster(settings), common_settings(settings)
    hybrid, note = _schedule(settings) if given is None else _two_stage(settings, given, memory)
    spans = {"horizon": settings.horizon, "random_state": settings.random_state}
    plain = TwoStagePredictor.conventional(make_gray_box(settings, "output"), memory=memory, **spans)
    reading = {"horizon": settings.horizon, "holidays": settings.holidays}
    multi_step = ARXRegressor(objective="multi_step", adapt="refit", **reading)
    boosted = BoostedRegressor(residual_of="arx", **common)
    rows = [
        (HYBRID, hybrid, note),
        ("building model alone", make_gray_box(settings, "output"), "its last disturbance fades"),
        ("building model, no disturbance", plain, "expects no unmeasured heat, as the paper's conventional approach"),
        ("simple building model", make_gray_box(settings, "conventional"), "identified and used without a disturbance"),
        ("ARX", ARXRegressor(**reading), "black box, fitted once"),
        ("ARX re-fitted", ARXRegressor(adapt="refit", **reading), "fitted at every origin"),
        ("ARX, multi-step, re-fitted", multi_step, "fitted on errors at many leads, at every origin"),
        ("boosting on ARX", boosted, "gradient-boosted trees on the errors of ARX"),
    ]
    for name, (label, note) in _TWO_STAGE.items():
        if given is None or name != given.model:
            baseline, _ = _two_stage(settings, DisturbanceForecaster(name), memory)
            rows.append((label, baseline.set_params(intervals=False), note))
    rows.append((YESTERDAY, Yesterday(), "the temperature at this time of the last day before"))
    return [StudyModel(*row) for row in rows]


def identified_by(settings: Settings) -> str:
    """Label of the model that identifies the building: the hybrid, or with the schedule model two-stage ridge."""
    return _TWO_STAGE["ridge"][0] if make_forecaster(settings) is None else HYBRID


def common_settings(settings: Settings) -> dict[str, Any]:
    """The settings that all hybrid predictors take."""
    return {name: getattr(settings, name) for name in ("horizon", "holidays", "random_state")}


def _schedule(settings: Settings) -> tuple[HybridPredictor, str]:
    """The schedule model, with what the settings say of its network and capacities, and a note on it."""
    network: Any = make_network(settings.network) if settings.network else None
    if settings.columns and not _has_sun(settings):
        network = replace(get_network(network or DEFAULT_NETWORK), solar={})
    made = HybridPredictor(network=network, known=settings.capacities or None, **common_settings(settings))
    return made, "network with learned schedules, blended with ARX, updated at every origin"


def _two_stage(settings: Settings, forecaster: DisturbanceForecaster, memory: Any) -> tuple[HybridPredictor, str]:
    """The two-stage scheme with the identification of the settings, and a note on it."""
    own = settings.estimator.get("name", "periodic")
    made = HybridPredictor(make_gray_box(settings), forecaster, memory=memory, **common_settings(settings))
    return made, f"{own} identification, {forecaster.model} disturbance forecast"


def make_gray_box(settings: Settings, name: str | None = None) -> Any:
    """The identification of the settings, or another one with those of the settings that hold for it too."""
    own = str(settings.estimator.get("name", "periodic"))
    chosen = name or own
    made = getattr(identification, ESTIMATORS[chosen])()
    given = {k: v for k, v in settings.estimator.items() if k != "name"}
    if chosen != own:  # what is known of the building holds for any identification
        given = {k: v for k, v in given.items() if k in ("known", "bounds", "warmup")}
        given["n_starts"] = 12  # more starts found no better minimum on the logs tried
    network: str | RCNetwork = make_network(settings.network)
    if not _has_sun(settings):
        network = replace(get_network(network), solar={})
    common: dict[str, Any] = {"network": network, "random_state": settings.random_state}
    if settings.site:  # an identification cannot tell five window areas apart
        common["columns"] = dict.fromkeys(FACADES)
    common |= {"horizon": settings.horizon} if name is not None else {}
    check_keys("estimator", given, made.get_params(deep=False))
    return made.set_params(**{**common, **{k: _tupled(v) for k, v in given.items()}})


def _has_sun(settings: Settings) -> bool:
    return any(role.startswith("q_sol") for role in settings.columns)


def make_forecaster(settings: Settings) -> DisturbanceForecaster | None:
    """The disturbance forecaster of the settings; None for the schedule model, which needs none."""
    given = {"model": SCHEDULE} | dict(settings.forecaster)
    made = DisturbanceForecaster("ridge")
    check_keys("forecaster", given, made.get_params(deep=False))
    if given["model"] != SCHEDULE:
        made.set_params(**given)
        try:
            check_parameters(made)
        except ValueError as error:
            raise ValueError(f"[forecaster] {error}") from None
        return made
    unused = [key for key in given if key != "model"]
    if unused:
        raise ValueError(f"[forecaster] {unused[0]} has no effect with model = {SCHEDULE!r}; remove it.")
    return None


def make_network(given: Mapping[str, Any]) -> str | RCNetwork:
    """The network of the catalogue that ``[network]`` names, or a declared one; ``"rest"`` is the remaining share."""
    if "capacitances" not in given:
        if set(given) - {"name"}:
            raise ValueError("[network] declares a network without capacitances; give them, or only a name.")
        return str(given.get("name", _IDENTIFIED_NETWORK))
    declared = {k: _with_rest(_tupled(v)) if k in ("solar", "heated") else _tupled(v) for k, v in given.items()}
    try:
        return RCNetwork(**{"name": "declared", "resistors": {}, **declared})
    except TypeError as error:  # a number or a table in place of a name
        raise ValueError(f"[network] cannot be read ({error}); declare it as skhybrid.thermal.RCNetwork is.") from None


def _tupled(value: Any) -> Any:
    """Lists of TOML as tuples, which bounds and resistors are."""
    if isinstance(value, list):
        return tuple(_tupled(v) for v in value)
    return {k: _tupled(v) for k, v in value.items()} if isinstance(value, dict) else value


def _with_rest(declared: Any) -> Any:
    """Shares with None for ``"rest"``, since TOML has no None."""
    if not isinstance(declared, dict):
        return declared
    return {key: None if value == "rest" else _with_rest(value) for key, value in declared.items()}
