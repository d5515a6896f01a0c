"""The only calls of the search into the training of networks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any

from ...forecasting.extras import require_networks
from ...forecasting.joint_fit import fit_each
from ...forecasting.named_models import is_network

#: the module that loads torch and skorch
_TRAINING = "skhybrid.forecasting.networks.jobs"


def need_networks(models: Iterable[Any]) -> bool:
    """Whether there are networks among the models of candidates.

    Raises
    ------
    ImportError
        If there are, and torch or skorch is not installed.
    """
    networks = {model for model in models if is_network(model)}
    for model in sorted(networks):
        require_networks(model)
    return bool(networks)


def preload_networks() -> None:
    """Load torch before the first task: joblib restarts a worker whose memory has grown by 300 MB after a task."""
    import_module(_TRAINING)


def fit_together(models: Sequence[Any], X: Any, y: Any) -> list[Any]:
    """Fit models on the same rows; networks of equal shape are trained as one stack."""
    return fit_each(models, X, y)
