"""Models of a forecaster by name, the libraries that they need, and the check of a forecaster's parameters."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from .._arguments import check_bool, check_integer, check_rate, check_verbose, is_number
from .._table import ZoneTable
from .baselines import LastWeek, NoDisturbance, Persistence, WeeklyProfile
from .cases import ACTIVATIONS, NETWORKS, SIZES, resolve_case
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


def networks_available() -> bool:
    """Whether torch and skorch are installed."""
    try:
        return all(find_spec(name) is not None for name in ("torch", "skorch"))
    except (ImportError, ValueError):  # an import hook refuses them, or their place in sys.modules is taken
        return False


def require_networks(model: Any, device: str = "cpu") -> None:
    """Refuse a network whose libraries are missing (ImportError), or a device that torch cannot use (ValueError).

    Any other model of a forecaster is accepted.
    """
    if not is_network(model):
        return
    if not networks_available():
        raise ImportError(
            f'model={model!r} needs torch and skorch; install them with pip install "skhybrid[networks]".'
        )
    if device != "cpu":
        from .networks.jobs import torch_device  # torch loads here

        torch_device(device)


def fit_baseline(name: str, table: ZoneTable, target: np.ndarray, n_leads: int) -> Any:
    """Fit one of ``BASELINES`` to training rows with history ``zeta`` and a target (n_rows,), NaN where missing."""
    if name == "ridge":
        return RidgeForecaster().fit(table, target, n_leads)
    return BASELINES[name]().fit(table, target)


def check_parameters(forecaster: Any) -> None:
    """Refuse unknown or impossible parameters of a forecaster, also those that only networks read."""
    model, names = forecaster.model, (*NETWORKS, *BASELINES)
    if isinstance(model, type) or not (isinstance(model, str) or (hasattr(model, "fit") and hasattr(model, "predict"))):
        raise ValueError(f"model={model!r} is neither one of {', '.join(names)} nor a regressor instance.")
    if isinstance(model, str) and model not in names:
        raise ValueError(f"model={model!r} is not known; use {', '.join(names)} or a scikit-learn regressor.")
    if is_network(model):
        resolve_case(forecaster.case, model)
    check_verbose(forecaster.verbose)
    _check_choices(forecaster)
    _check_numbers(forecaster)


def refuse_unread(forecaster: Any) -> None:
    """Refuse a case or a size that the model does not read: a search over it would compare copies.

    Settings of the training pass, as the estimator of a design matrix has them for networks and baselines alike.
    """
    model = forecaster.model
    read = {"case", *SIZES[model]} if is_network(model) else set()
    for name in ("case", *dict.fromkeys(name for sizes in SIZES.values() for name in sizes)):
        value = getattr(forecaster, name)
        if name not in read and value != type(forecaster)().get_params(deep=False)[name]:
            able = [net for net in NETWORKS if name == "case" or name in SIZES[net]]
            raise ValueError(
                f"forecaster__{name}={value!r} does nothing with model={model!r}; leave it out, or set "
                f"forecaster__model to one of {', '.join(able)}."
            )


def _check_choices(forecaster: Any) -> None:
    if not isinstance(forecaster.device, str):
        raise ValueError(f"device={forecaster.device!r} must be the name of a device, such as 'cpu' or 'cuda'.")
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
        check_integer(name, getattr(forecaster, name), low)
    for name in ("dropout", "validation_fraction"):
        value = getattr(forecaster, name)
        if not (is_number(value) and 0.0 <= value < 1.0):
            raise ValueError(f"{name}={value!r} is outside [0, 1).")
    check_rate("learning_rate", forecaster.learning_rate)
    check_bool("refit", forecaster.refit)
    if is_network(forecaster.model) and forecaster.residual_of is not None and forecaster.validation_fraction == 0.0:
        raise ValueError(
            f"validation_fraction=0 leaves no rows that say how much of the correction to residual_of="
            f"{forecaster.residual_of!r} to use; give a fraction, or residual_of=None."
        )
