"""Parameters of candidates: the network they identify, the model they fit, what that costs, and all as text."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from ... import __version__
from ...forecasting import DisturbanceForecaster
from ...forecasting.cases import RECURRENT, resolve_case
from ...forecasting.named_models import networks_available
from ...hybrid import HybridPredictor, TwoStagePredictor
from ...hybrid.predictor import takes_two_stages
from ...parallel.stored_settings import VERSION, WITHOUT_EFFECT, as_plain, is_estimator, name_of

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


def settings_of(estimator: Any, X: Any, y: Any, splits: Sequence[tuple[Any, Any]], scoring: Any) -> dict[str, str]:
    """Data, splits, scoring and parameters of the estimator by name, for a store to compare with its own."""
    found = {**_data("X", X), **_data("y", y)}
    found["cv"] = f"{len(splits)} splits ({_digest(*(np.asarray(rows) for split in splits for rows in split))})"
    found["scoring"] = as_plain(scoring)
    found["estimator"] = name_of(type(estimator))
    for name, value in sorted(estimator.get_params(deep=True).items()):
        if name.split("__")[-1] not in WITHOUT_EFFECT:
            found[f"parameter {name}"] = name_of(type(value)) if is_estimator(value) else as_plain(value)
    versions = {"skhybrid": __version__} | {name: version(name) for name in ("numpy", "scikit-learn")}
    if networks_available():
        versions["torch"] = version("torch")
    return found | {f"{VERSION}{name}": number for name, number in versions.items()}


def candidate_id(params: Mapping[str, Any]) -> str:
    """A short id of a candidate's parameters, the same in every process."""
    return hashlib.sha256(as_plain(params).encode()).hexdigest()[:32]


def _data(name: str, data: Any) -> dict[str, str]:
    """Size, names, stamps and values one by one, so that a difference can be named."""
    table = pd.DataFrame(data if isinstance(data, pd.DataFrame | pd.Series) else np.asarray(data))
    found = {f"rows of {name}": str(len(table))}
    if isinstance(data, pd.DataFrame):
        found[f"columns of {name}"] = ", ".join(map(str, table.columns))
    if isinstance(table.index, pd.DatetimeIndex) and len(table):
        found[f"first stamp of {name}"] = str(table.index[0])
        found[f"last stamp of {name}"] = str(table.index[-1])
    return found | {f"values of {name}": _digest(pd.util.hash_pandas_object(table, index=True).to_numpy())}


def _digest(*arrays: np.ndarray) -> str:
    total = hashlib.sha256()
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
        total.update(b"|")
    return total.hexdigest()[:16]
