"""Parameters of candidates: which network they identify, which model they fit, and what that costs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from ...forecasting import DisturbanceForecaster
from ...forecasting.cases import RECURRENT, resolve_case
from ...hybrid import HybridPredictor, TwoStagePredictor
from ...hybrid.predictor import takes_two_stages
from .fingerprint import as_plain

BASELINE = "baseline"  # parameter of a candidate that is an estimator of its own, fitted and scored on the same splits
#: sizes with which the time to fit a candidate grows
_COSTLY = ("n_layers", "hidden_size", "n_channels", "filter_size", "max_epochs", "n_repeats", "n_estimators")


def last_step(estimator: Any) -> Any:
    """The last step of a Pipeline, or the estimator itself."""
    return estimator.steps[-1][1] if isinstance(estimator, Pipeline) else estimator


def forecaster_prefix(estimator: Any) -> str:
    """Prefix of a forecaster's parameters, such as ``"forecaster__"``; an estimator without one is refused."""
    if isinstance(estimator, DisturbanceForecaster):
        return ""
    if isinstance(estimator, HybridPredictor | TwoStagePredictor):
        return "forecaster__"
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        return f"{name}__{forecaster_prefix(last)}"
    raise ValueError(
        f"{type(estimator).__name__} has no forecaster of the disturbance; give a HybridPredictor, a Pipeline that "
        "ends in one, or a DisturbanceForecaster, or parameter grids instead of a design matrix."
    )


def identification_params(estimator: Any, params: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters by which a network is identified: all but the forecaster's and the kind of disturbance."""
    try:
        prefix = forecaster_prefix(estimator)
    except ValueError:
        return dict(params)
    before = prefix.removesuffix("forecaster__")
    own = (f"{before}forecaster", f"{before}disturbance")
    return {name: value for name, value in params.items() if name not in own and not name.startswith(prefix)}


def model_of(estimator: Any, params: Mapping[str, Any]) -> Any:
    """The model of a candidate's forecaster; None where it has no forecaster or names none."""
    try:
        prefix = forecaster_prefix(estimator)
    except ValueError:
        return None
    if f"{prefix}model" in params:
        return params[f"{prefix}model"]
    given = params.get(prefix.removesuffix("__"))
    return estimator.get_params().get(f"{prefix}model") if given is None else getattr(given, "model", given)


def shares_network(estimator: Any, params: Mapping[str, Any]) -> bool:
    """Whether a candidate identifies a thermal network first, which others may share; else it is fitted as a whole."""
    try:
        return takes_two_stages(last_step(clone(estimator).set_params(**clone(dict(params), safe=False))))
    except (ValueError, TypeError, AttributeError):  # its fit will say what is wrong
        return False


def stack_key(params: Mapping[str, Any]) -> tuple[str, ...]:
    """Sorting key of candidates; those whose first two parts are equal train as one stack."""
    own = _own_names(params)
    model, case = own.pop("model", None), own.pop("case", None)
    history = f"{_days_of_history(model, case)} d" if isinstance(model, str) and model in RECURRENT else str(case)
    others = ("activation", "dropout", "random_state", *(["n_layers"] if model == "mlp" else []))
    same_shape = {name: own.pop(name, None) for name in others}
    return (history, as_plain(own), str(case), as_plain(same_shape))


def effort_of(params: Mapping[str, Any]) -> float:
    """A rough measure of the time that a candidate takes: its costly sizes times the days of history of its case."""
    own = _own_names(params)
    sizes = [value for name in _COSTLY if isinstance(value := own.get(name), int | float) and value > 0]
    return float(np.prod([*sizes, _days_of_history(own.get("model"), own.get("case")) or 1]))


def _own_names(params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters by their own names, without those of the steps that they belong to."""
    return {name.split("__")[-1]: value for name, value in params.items()}


def _days_of_history(model: Any, case: Any) -> int:
    """Days of history that a network's case reads; 0 for other models."""
    with suppress(ValueError):
        return resolve_case(case, model).pattern_days
    return 0
