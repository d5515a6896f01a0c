"""Models of a forecaster by name, and the check of its parameters."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np

from .._table import ZoneTable
from .baselines import LastWeek, NoDisturbance, Persistence, WeeklyProfile
from .cases import ACTIVATIONS, NETWORKS
from .features import TIME_ENCODINGS
from .ridge import RidgeForecaster

BASELINES: dict[str, Any] = {
    "profile": WeeklyProfile,
    "last_week": LastWeek,
    "persistence": Persistence,
    "ridge": RidgeForecaster,
    "none": NoDisturbance,
}
#: the least value of each integer
_LEAST = dict.fromkeys(("n_layers", "hidden_size", "n_channels", "filter_size"), 1) | {"pool_size": 0}
_LEAST |= dict.fromkeys(("max_epochs", "patience", "batch_size", "n_repeats"), 1)


def is_network(model: Any) -> bool:
    """Whether a model is the name of a network."""
    return isinstance(model, str) and model in NETWORKS


def fit_baseline(name: str, table: ZoneTable, target: np.ndarray, n_leads: int) -> Any:
    """Fit one of ``BASELINES`` to training rows with history ``zeta`` and a target (n_rows,), NaN where missing."""
    if name == "ridge":
        return RidgeForecaster().fit(table, target, n_leads)
    return BASELINES[name]().fit(table, target)


def check_parameters(forecaster: Any) -> None:
    """Refuse unknown or impossible parameters of a forecaster; those of networks are read only where it is one."""
    model, names = forecaster.model, (*NETWORKS, *BASELINES)
    if isinstance(model, type) or not (isinstance(model, str) or hasattr(model, "fit")):
        raise ValueError(f"model={model!r} is neither one of {', '.join(names)} nor a regressor instance.")
    if isinstance(model, str) and model not in names:
        raise ValueError(f"model={model!r} is not known; use {', '.join(names)} or a scikit-learn regressor.")
    if is_network(model):
        _check_choices(forecaster)
        _check_numbers(forecaster)


def _check_choices(forecaster: Any) -> None:
    for name, choices in (
        ("activation", ACTIVATIONS),
        ("time_encoding", TIME_ENCODINGS),
        ("residual_of", (None, *(name for name in BASELINES if name != "none"))),
        ("repeats", ("best", "mean")),
    ):
        value = getattr(forecaster, name)
        if value not in choices:
            raise ValueError(f"{name}={value!r} is not known; use one of {', '.join(map(repr, choices))}.")


def _check_numbers(forecaster: Any) -> None:
    for name, low in _LEAST.items():
        value = getattr(forecaster, name)
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
            raise ValueError(f"{name}={value!r} must be an integer of at least {low}.")
    for name in ("dropout", "validation_fraction"):
        value = getattr(forecaster, name)
        if not (isinstance(value, Real) and 0.0 <= float(value) < 1.0):
            raise ValueError(f"{name}={value!r} is outside [0, 1).")
    rate = forecaster.learning_rate
    if not (isinstance(rate, Real) and 0.0 < float(rate) < np.inf):
        raise ValueError(f"learning_rate={rate!r} is outside (0, inf).")
