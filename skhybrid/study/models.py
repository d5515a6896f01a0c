"""The models that a study compares: the default hybrid, the published one, gray boxes, black boxes, simple rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .. import identification
from .._time import rows_of
from ..forecasting import ARXRegressor, DisturbanceForecaster
from ..hybrid import HybridPredictor
from ..thermal import RCNetwork, get_network
from .data import FACADES
from .settings import ESTIMATORS, Settings

#: the row of the comparison that all others are rivals of.
HYBRID = "hybrid"
#: forecaster that stands for the default, the schedule model.
DEFAULT = "schedule"
#: forecasters of the published scheme that any claim must be measured against: label and what it is.
_BASELINES = {
    "ridge": ("hybrid, published (ridge)", "disturbance linear in calendar, weather and lags"),
    "profile": ("hybrid, profile", "disturbance = its mean by hour of week"),
    "last_week": ("hybrid, last_week", "disturbance = that of a week before"),
    "persistence": ("hybrid, persistence", "disturbance stays as it is"),
}
#: where a study without a network of its own finds the identification's.
_IDENTIFIED = "2R2C"


class Rival(NamedTuple):
    """One row of the comparison."""

    label: str
    estimator: Any
    note: str


class Yesterday(RegressorMixin, BaseEstimator):
    """Tomorrow's temperature is what was measured 24 hours before.

    Nothing is learned; the last known day is repeated as far as the horizon reaches.
    """

    def fit(self, X: pd.DataFrame, y: Any = None) -> Yesterday:
        """Note the mean temperature, which stands in where there is no yesterday.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Consecutive rows.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC].

        Returns
        -------
        self
        """
        self.mean_ = float(np.nanmean(np.asarray(X["T_za"] if y is None else y, dtype=np.float64)))
        return self

    def predict_from(self, X: pd.DataFrame, origins: Any, horizon: Any = "1D") -> np.ndarray:
        """Forecast the rows after each of the given origins.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Consecutive rows with a DatetimeIndex and ``T_za``, which is read up to each origin.
        origins : sequence of int
            Row numbers of X.
        horizon : timedelta-like
            How far ahead.

        Returns
        -------
        ndarray of shape (n_origins, n_leads)
        """
        check_is_fitted(self)
        step = X.index[1] - X.index[0]
        day, n_leads = rows_of("1D", step), rows_of(horizon, step)
        known = X["T_za"].ffill().fillna(self.mean_).to_numpy(dtype=np.float64)
        back = (np.arange(n_leads) % day) + 1 - day  # 0 is the origin itself
        return known[np.maximum(np.asarray(origins)[:, None] + back, 0)]


def make_models(settings: Settings, memory: Any = None) -> list[Rival]:
    """The models of a study, unfitted; the hybrid comes first.

    Parameters
    ----------
    settings : Settings
        Network, estimator and forecaster settings.
    memory : str or joblib.Memory, optional
        Where the identification that the hybrids share is kept, so that it is run once.

    Returns
    -------
    list of Rival
    """
    model = str(settings.forecaster.get("model", DEFAULT))

    def published(**forecaster: Any) -> HybridPredictor:
        parts = {"gray_box": make_gray_box(settings), "forecaster": make_forecaster(settings, **forecaster)}
        return HybridPredictor(**parts, horizon=settings.horizon, memory=memory, random_state=settings.random_state)

    found = [
        _main_rival(settings, published),
        Rival("conventional OD", make_gray_box(settings, "output"), "output disturbance identified, none forecast"),
        Rival("conventional CONV", make_gray_box(settings, "conventional"), "no disturbance at all"),
        Rival("ARX", ARXRegressor(horizon=settings.horizon), "black box, fitted once"),
        Rival("ARX re-fitted", ARXRegressor(horizon=settings.horizon, adapt="refit"), "at every origin"),
    ]
    found += [Rival(label, published(model=name), note) for name, (label, note) in _BASELINES.items() if name != model]
    return [*found, Rival("yesterday", Yesterday(), "the temperature 24 h before")]


def identifies(settings: Settings) -> str:
    """Label of the row whose identification tells of the building: the hybrid's own, but for the default scheme.

    Parameters
    ----------
    settings : Settings
        Forecaster settings.

    Returns
    -------
    str
    """
    return _BASELINES["ridge"][0] if settings.forecaster.get("model", DEFAULT) == DEFAULT else HYBRID


def _main_rival(settings: Settings, published: Callable[..., HybridPredictor]) -> Rival:
    """The schedule model, or the two-stage scheme where the settings name a forecaster."""
    model = settings.forecaster.get("model", DEFAULT)
    if model != DEFAULT:
        own = settings.estimator.get("name", "periodic")
        return Rival(HYBRID, published(), f"{own} identification, {model} disturbance forecast")
    network = make_network(settings.network) if settings.network else None
    capacities = {k: v for k, v in settings.estimator.get("known", {}).items() if k.startswith("Q_")}
    made = HybridPredictor(
        network=network, known=capacities or None, horizon=settings.horizon, random_state=settings.random_state
    )
    return Rival(HYBRID, made, "network with learned schedules, blended with ARX, adapting at every origin")


def make_gray_box(settings: Settings, name: str | None = None) -> Any:
    """The identification that the settings ask for, or the one of that name with what of the settings fits it.

    Parameters
    ----------
    settings : Settings
        Network and estimator settings.
    name : str, optional
        One of conventional, input, output, periodic.

    Returns
    -------
    estimator
    """
    own = str(settings.estimator.get("name", "periodic"))
    chosen = name or own
    made = getattr(identification, ESTIMATORS[chosen])()
    given = {k: v for k, v in settings.estimator.items() if k != "name"}
    if chosen != own:  # what is known of the building holds for every identification
        given = {k: v for k, v in given.items() if k in ("known", "bounds", "warmup")}
        given["n_starts"] = 12  # more found no better minimum on the logs tried, and cost time
    network: str | RCNetwork = make_network(settings.network)
    if not any(role.startswith("q_sol") for role in settings.columns):  # a log without sun: none enters the network
        network = replace(get_network(network), solar={})
    common: dict[str, Any] = {"network": network, "random_state": settings.random_state}
    if settings.site:  # five window areas are more than an identification can tell apart
        common["columns"] = {f"q_sol_{name}": None for name in FACADES}
    common |= {"horizon": settings.horizon} if name is not None else {}
    _refuse_unknown("estimator", given, made.get_params(deep=False))
    return made.set_params(**{**common, **{k: _tupled(v) for k, v in given.items()}})


def make_forecaster(settings: Settings, **other: Any) -> DisturbanceForecaster:
    """The disturbance forecaster of the settings.

    Parameters
    ----------
    settings : Settings
        Forecaster settings.
    **other
        Settings that replace them all.

    Returns
    -------
    DisturbanceForecaster
    """
    given = dict(other or settings.forecaster)
    made = DisturbanceForecaster("ridge")
    _refuse_unknown("forecaster", given, made.get_params(deep=False))
    return made.set_params(**given)


def make_network(given: Mapping[str, Any]) -> str | RCNetwork:
    """A network of the catalogue by its name, or one that is declared.

    Parameters
    ----------
    given : mapping
        The ``[network]`` table; in its ``solar`` and ``heated``, ``"rest"`` is the node that gets what is left.

    Returns
    -------
    str or RCNetwork
    """
    if "capacitances" not in given:
        if set(given) - {"name"}:
            raise ValueError("[network] declares a network without capacitances; give them, or only a name.")
        return str(given.get("name", _IDENTIFIED))
    declared = {k: _with_rest(_tupled(v)) if k in ("solar", "heated") else _tupled(v) for k, v in given.items()}
    return RCNetwork(**{"name": "declared", "resistors": {}, **declared})


def _tupled(value: Any) -> Any:
    """TOML's lists as the tuples that bounds and resistors are."""
    if isinstance(value, list):
        return tuple(_tupled(v) for v in value)
    return {k: _tupled(v) for k, v in value.items()} if isinstance(value, dict) else value


def _with_rest(declared: Any) -> Any:
    """TOML has no None: ``"rest"`` among shares stands for it."""
    if not isinstance(declared, dict):
        return declared
    return {key: None if value == "rest" else _with_rest(value) for key, value in declared.items()}


def _refuse_unknown(table: str, given: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    for key in given:
        if key not in known:
            raise ValueError(f"unknown key {key!r} in [{table}]; known are {', '.join(sorted(known))}.")
